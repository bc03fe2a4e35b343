// Stands in for step.cc where VSS was built without Open CASCADE.
#include "vss/export/export.h"
#include "vss/export/step.h"

namespace vss {

bool CanWriteStep() { return false; }

Result<std::string> WriteStep(const Product&, std::span<const PartSolid>) {
  return UsageError(
      "STEP is not part of this build, which was made without Open CASCADE; install "
      "libocct-data-exchange-dev "
      "and build again, or leave step out of --format");
}

}  // namespace vss
