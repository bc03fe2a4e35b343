#!/usr/bin/env bash
# rooms_test.sh SOURCE ROOM...: a room includes only itself and rooms before it; rooms include nothing of apps.
# Third-party libraries with one home stand in no other room's header.
set -euo pipefail
source=$1
shift
failed=0
complain() {
  echo "$1"
  failed=1
}

before=()
for room in "$@"; do
  before+=("$room")
  [[ -d $source/src/vss/$room ]] || continue
  while IFS=: read -r file line include; do
    other=$(sed -E 's|.*"vss/([a-z_]+)/.*|\1|' <<<"$include")
    [[ " ${before[*]} " == *" $other "* ]] || complain "$file:$line: room $room includes room $other, which comes after it"
  done < <(grep -rnE '#include "vss/[a-z_]+/' "$source/src/vss/$room" || true)
done
while IFS=: read -r file line _; do
  complain "$file:$line: the library includes an app"
done < <(grep -rnE '#include "(\.\./)*apps?/' "$source/src/vss" || true)
for folder in "$source"/src/vss/*/; do
  [[ " $* " == *" $(basename "$folder") "* ]] || complain "$folder: this room is not in VSS_ROOMS"
done
while IFS=: read -r file line _; do
  complain "$file:$line: a header includes OpenCV, Ceres, toml++, JSON or CLI11, which have a home in source files only"
done < <(grep -rnE '#include <(opencv2|ceres|toml\+\+|nlohmann|CLI|spdlog)/' "$source/src/vss" --include='*.h' || true)
while IFS=: read -r file line _; do
  complain "$file:$line: Open CASCADE's headers are included in the room export alone"
done < <(grep -rnE '#include <[A-Za-z0-9_]+\.hxx>' "$source/src/vss" --include='*.h' --include='*.cc' | grep -v '/vss/export/' || true)
exit $failed
