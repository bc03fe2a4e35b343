// A workpiece at the temperature that its pictures were taken at, and the same at 20 degrees (ISO 1).
#pragma once
#include <span>

#include "vss/base/parameters.h"
#include "vss/product/product.h"

namespace vss {

struct TemperatureOptions {
  double workpiece_c = 20;            // 20: nothing is reduced
  double expansion_ppm_per_k = 11.5;  // structural steel
};
std::span<const ParameterOf<TemperatureOptions>> TemperatureParameters();

// Shrinks (or stretches) all parts and seams, about the middle of the workpiece on the ground, to what they
// are at 20 degrees, sigmas and covariances with them, and notes that in the product.
void ReduceToReferenceTemperature(const TemperatureOptions& options, Product& product);

}  // namespace vss
