// What a surveyor checks a result by, as the station keeps it: with every digit, so that a report and a
// product made later say what the run said.
#pragma once
#include "part_json.h"

namespace vss::station {

Json JsonOf(const std::vector<ContourResidual>& residuals, const std::vector<std::string>& image_files);
Json JsonOf(const std::vector<Straightness>& straightness);
Json JsonOf(const SurveyChecks& checks, const std::vector<std::string>& image_files);
// Each throws where `json` is anything else, or names a picture that the survey does not have.
std::vector<ContourResidual> ContourResidualsOf(const Json& json,
                                                const std::vector<std::string>& image_files);
std::vector<Straightness> StraightnessOf(const Json& json);
SurveyChecks SurveyChecksOf(const Json& json, const std::vector<std::string>& image_files);

// Takes them out of a part or a run: the page shows none of them, and they are most of it.
void RemoveChecks(Json& part_or_run);

}  // namespace vss::station
