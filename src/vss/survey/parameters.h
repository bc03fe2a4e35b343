// The parameters of all steps, gathered: what `[parameters]`, --set, `vss parameters` and the station's form
// know.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/feature/line_image.h"
#include "vss/identify/scene.h"
#include "vss/product/seams.h"
#include "vss/reconstruct/reconstruct.h"

namespace vss {

// The options of every step of a survey.
struct SurveyOptions {
  LineOptions lines;
  IdentifyOptions identify;
  ReconstructOptions reconstruct;
  SeamOptions seams;
  int threads = 0;  // 0: as many as the machine has
};

// Sets one parameter of any step. Errors: no such name (the nearest one is proposed), a value out of range.
Status SetSurveyParameter(std::string_view name, double value, SurveyOptions& options);

// All parameters in the order of the steps, with their values in `options` beside the defaults.
std::vector<ParameterInfo> SurveyParameters(const SurveyOptions& options = {});

}  // namespace vss
