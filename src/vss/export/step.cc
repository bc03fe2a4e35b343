// Loads vss_step.so (step_module.cc) from the program's folder: it brings 67 libraries, which only a program that writes
// STEP should wait for.
#include "vss/export/step.h"

#include <dlfcn.h>

#include <filesystem>

#include "vss/export/export.h"
#include "vss/export/step_module.h"

namespace vss {
namespace {

std::filesystem::path ModulePath() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "vss_step.so";
}

}  // namespace

bool CanWriteStep() {
  std::error_code error;
  return std::filesystem::exists(ModulePath(), error);
}

Result<std::string> WriteStep(const Product& product, std::span<const PartSolid> solids) {
  if (!CanWriteStep())
    return UsageError(
        "STEP is not part of this build: made without Open CASCADE, it has no {}; install "
        "libocct-data-exchange-dev and build again, or leave step out of --format",
        ModulePath().string());
  // Never closed: Open CASCADE's libraries do not bear being unloaded.
  static void* const module = ::dlopen(ModulePath().c_str(), RTLD_NOW | RTLD_LOCAL);
  static void* const write = module ? ::dlsym(module, kWriteStepName) : nullptr;
  if (!write) {
    const char* why = ::dlerror();
    return tl::unexpected<Error>({ErrorCode::kInternal, fmt::format("{} cannot be loaded: {}", ModulePath().string(), why ? why : "unknown reason")});
  }
  Result<std::string> text;
  reinterpret_cast<WriteStepFunction*>(write)(product, solids, text);
  return text;
}

}  // namespace vss
