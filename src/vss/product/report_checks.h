// The sections of the report that a surveyor checks a result by.
#pragma once
#include <string>

#include "vss/product/product.h"

namespace vss {

// As built against as designed; empty where no design was given.
std::string DeviationSection(const Product& product);

// Residuals contour by contour; empty where nothing was measured in the grey values.
std::string ContoursSection(const Product& product, const std::vector<std::string>& image_names);

// What single pictures decide, cameras, scale, temperature.
std::string ChecksSection(const Product& product, const std::vector<std::string>& image_names);

}  // namespace vss
