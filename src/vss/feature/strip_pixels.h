// The pixels about an edge, in its own coordinates.
#pragma once
#include <cstddef>

#include "vss/feature/strip_fit.h"

namespace vss {

struct StripWindow {
  double low, high;  // of t
};

// Fills along, across and grey of `buffers`, column by column, and the columns;
// how many pixels. Columns of which the neighbours leave less than `side_px` on
// either side of the edge are left out.
std::size_t TakePixels(const GreyView& image, const StripFrame& frame,
                       std::span<const StripNeighbour> neighbours, const StripSettings& settings,
                       double side_px, StripWindow window, StripBuffers& buffers);

}  // namespace vss
