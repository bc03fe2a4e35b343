// Pictures made for looking at: shrunk, or in colour.
#pragma once
#include <cstdint>
#include <vector>

#include "vss/image/grey_image.h"

namespace vss {

// The picture as 8 bit with its longer side at most `max_side_px`: averaged over areas, never enlarged.
GreyImage ShrinkTo(const GreyView& image, int max_side_px);

// PNG bytes of a picture of 8 bit red, green, blue, rows without gaps.
std::vector<std::uint8_t> EncodeRgbPng(const std::vector<std::uint8_t>& rgb, int width, int height);

}  // namespace vss
