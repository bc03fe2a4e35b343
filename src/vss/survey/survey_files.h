// What a survey leaves in its output folder.
#pragma once
#include "vss/base/output_folder.h"
#include "vss/survey/run_survey.h"

namespace vss {

// Adds product.json, report.html and overlays/NAME.svg to `out`. Nothing is
// written before out.Commit(). An error where a picture cannot be read again, or on cancel.
Status AddSurveyFiles(const Survey& survey, const SurveyOptions& options, const SurveyOutcome& outcome,
                      const Progress& progress, OutputFolder& out);

}  // namespace vss
