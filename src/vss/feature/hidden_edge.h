// A second edge close beside a fitted one, seen in what the fit left.
#pragma once
#include <optional>

#include "vss/feature/strip_fit.h"

namespace vss {

struct HiddenEdge {
  StripEdge main, other;  // offsets relative to the frame of the fit, slopes zero
  double gain = 0;        // by how much the sum of squared residuals falls, over their variance after it
};

// Fits one edge and two to the mean profile across the edge: two parallel edges hardly differ from it. Empty
// where two fit no better than one.
std::optional<HiddenEdge> FindHiddenEdge(const StripProfile& profile, Simd simd);

}  // namespace vss
