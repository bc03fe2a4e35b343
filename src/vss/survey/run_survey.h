// The main job: from the pictures of a survey to product definition data, step by step.
#pragma once
#include <string>
#include <vector>

#include "vss/base/progress.h"
#include "vss/feature/line_image.h"
#include "vss/identify/view.h"
#include "vss/image/grey_image.h"
#include "vss/knowledge/object_model.h"
#include "vss/product/product.h"
#include "vss/survey/parameters.h"
#include "vss/survey/survey.h"

namespace vss {

struct StepTime {
  std::string step;
  double seconds = 0;
};

struct SurveyOutcome {
  std::vector<LineImage> lines;  // one a picture
  KnowledgeBase knowledge;
  Product product;                             // its warnings hold the survey's too
  std::vector<RigidTransform> cam_from_world;  // of each picture, adjusted
  std::vector<StepTime> steps;                 // in their order
};

// One picture as it lies on disk. Errors: missing, damaged, of another size than its camera, without content.
Result<GreyImage> ReadSurveyPicture(const Survey& survey, int image);

// All pictures, with grey values proportional to light, in parallel. Errors name the picture; the first in
// the survey's order.
Result<std::vector<GreyImage>> ReadSurveyPictures(const Survey& survey, int threads,
                                                  const Progress& progress);

// The line images of the pictures that ReadSurveyPictures gave, in parallel. An error only on cancel.
Result<std::vector<LineImage>> DetectSurveyLines(const Survey& survey, const std::vector<GreyImage>& pictures,
                                                 const SurveyOptions& options, const Progress& progress);

// The pictures as identification sees them; pictures taken at one gantry displacement share a stop. Point
// into `survey` and `lines`, which must outlive them.
std::vector<View> MakeViews(const Survey& survey, const std::vector<LineImage>& lines,
                            const std::vector<GreyImage>& pictures = {});

// The survey's pictures by name, as files refer to them.
std::vector<std::string> ImageFiles(const Survey& survey);

// The whole chain. `options` as they are (see OptionsOf). Writes nothing. The same result for any number of
// threads.
Result<SurveyOutcome> RunSurvey(const Survey& survey, const SurveyOptions& options, const Progress& progress);

// Defaults, then the survey's [parameters].
Result<SurveyOptions> OptionsOf(const Survey& survey);

}  // namespace vss
