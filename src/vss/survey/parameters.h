// The parameters of all steps, gathered: what `[parameters]`, --set, `vss parameters` and the station's form
// know.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/feature/line_image.h"
#include "vss/identify/scene.h"
#include "vss/product/nominal.h"
#include "vss/product/seams.h"
#include "vss/product/temperature.h"
#include "vss/reconstruct/reconstruct.h"

namespace vss {

// A dimension that is known from elsewhere, as a user names it: part-1.length=1200.0 (+-0.1 where nothing is
// said).
struct NamedLength {
  std::string part, dimension;
  double value_mm = 0, sigma_mm = 0.1;
};
Result<NamedLength> ParseKnownLength(const std::string& text);

// The options of every step of a survey.
struct SurveyOptions {
  LineOptions lines;
  IdentifyOptions identify;
  ReconstructOptions reconstruct;
  SeamOptions seams;
  TemperatureOptions temperature;
  NominalOptions nominal;
  std::vector<NamedLength> known_lengths;  // of the parts by their ids
  int threads = 0;                         // 0: as many as the machine has
};

// Sets one parameter of any step. Errors: no such name (the nearest one is proposed), a value out of range.
Status SetSurveyParameter(std::string_view name, double value, SurveyOptions& options);

// All parameters in the order of the steps, with their values in `options` beside the defaults.
std::vector<ParameterInfo> SurveyParameters(const SurveyOptions& options = {});

}  // namespace vss
