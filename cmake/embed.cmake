# vss_embed(TARGET NAME FILES...): links the bytes of FILES into TARGET. The header "NAME.h" declares
#   std::span<const vss::EmbeddedFile> NAME();    one {name, text} for each file, sorted by name.
function(vss_embed target name)
  set(out ${CMAKE_BINARY_DIR}/embedded)
  set(source ${out}/${name}.cc)
  list(SORT ARGN)
  add_custom_command(
    OUTPUT ${source}
    COMMAND ${CMAKE_COMMAND} -DOUT=${source} -DNAME=${name} "-DFILES=${ARGN}" -P ${CMAKE_SOURCE_DIR}/cmake/embed_files.cmake
    DEPENDS ${ARGN} ${CMAKE_SOURCE_DIR}/cmake/embed_files.cmake
    VERBATIM)
  file(WRITE ${out}/${name}.h.in "#pragma once\n#include <span>\n#include \"vss/base/embedded_file.h\"\nnamespace vss {\nstd::span<const EmbeddedFile> ${name}();\n}\n")
  configure_file(${out}/${name}.h.in ${out}/${name}.h COPYONLY)
  target_sources(${target} PRIVATE ${source})
  target_include_directories(${target} PUBLIC ${out})
endfunction()
