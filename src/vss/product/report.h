// The report of a survey: one HTML file that needs nothing else.
#pragma once
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/feature/line_image.h"
#include "vss/identify/view.h"
#include "vss/image/grey_image.h"
#include "vss/knowledge/object_model.h"
#include "vss/product/product.h"

namespace vss {

struct ReportInput {
  const Product* product = nullptr;
  const KnowledgeBase* knowledge = nullptr;
  std::span<const View> views;           // one a picture, in the survey's order
  std::span<const LineImage> lines;      // one a picture
  std::vector<std::string> image_files;  // the pictures' names
  std::vector<std::pair<std::string, double>> step_seconds;
  std::vector<ParameterInfo> parameters;          // of this run
  std::function<Result<GreyImage>(int)> picture;  // reads picture i again
  int num_cameras = 0;
};

struct ReportFiles {
  std::string html;
  std::vector<std::string> overlays;  // one SVG a picture
};

// An error only where a picture cannot be read again. `threads` as in ParallelFor; the same bytes for any
// number.
Result<ReportFiles> MakeReport(const ReportInput& input, int threads);

}  // namespace vss
