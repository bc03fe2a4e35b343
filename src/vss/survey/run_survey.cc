#include "vss/survey/run_survey.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>

#include "vss/base/parallel.h"
#include "vss/identify/weigh.h"
#include "vss/product/make_part.h"
#include "vss/product/seams.h"

namespace vss {
namespace {

// Notes how long each step took.
class Stopwatch {
 public:
  explicit Stopwatch(std::vector<StepTime>& steps) : steps_(steps) {}
  void Stop(std::string step) {
    const auto now = Clock::now();
    steps_.push_back({std::move(step), std::chrono::duration<double>(now - start_).count()});
    start_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::vector<StepTime>& steps_;
  Clock::time_point start_ = Clock::now();
};

struct GreyRange {
  int min = std::numeric_limits<int>::max(), max = 0;
};

GreyRange RangeOf(const GreyView& image) {
  GreyRange range;
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) {
      const int grey = image.At(u, v);
      range.min = std::min(range.min, grey);
      range.max = std::max(range.max, grey);
    }
  return range;
}

// A picture whose darkest and brightest pixel differ by no more than the rounding of 8 bit holds nothing.
Status CheckContent(const GreyView& image, const std::string& path) {
  constexpr double kEmptyRange = 2.0 / 255.0;
  const GreyRange range = RangeOf(image);
  if (range.max - range.min > kEmptyRange * image.MaxValue()) return {};
  const char* what = range.max <= kEmptyRange * image.MaxValue() ? "all black" : "of one grey value";
  return InputError(
      "{}: the picture is {} (grey values {} to {} of {}); take it again, or take it out of the survey", path,
      what, range.min, range.max, image.MaxValue());
}

Result<GreyImage> LinearPicture(const Survey& survey, int index) {
  VSS_ASSIGN(GreyImage picture, ReadSurveyPicture(survey, index));
  const SurveyImage& image = survey.images[static_cast<std::size_t>(index)];
  if (survey.cameras[static_cast<std::size_t>(image.camera)].response == Response::kSrgb)
    return LinearFromSrgb(picture.view());
  return picture;
}

// Calls body(i) for every picture in parallel and tells of progress; an error only on cancel.
Status ForEachPicture(std::size_t count, std::string_view step, int threads, const Progress& progress,
                      const std::function<void(std::size_t)>& body) {
  std::atomic<int> done = 0;
  std::mutex reporting;
  ParallelFor(count, threads, [&](std::size_t i) {
    if (progress.Cancelled()) return;
    body(i);
    const std::lock_guard lock(reporting);
    progress.Report(step, ++done, static_cast<int>(count));
  });
  if (progress.Cancelled()) return Cancelled();
  return {};
}

// The survey as identification looks at it. Pixels much finer than the edges of cut steel are straight show
// more texture than edges, and take their time; so large pictures of that kind are reduced.
struct ReducedSurvey {
  std::vector<Camera> cameras;
  std::vector<GreyImage> pictures;
  std::vector<LineImage> lines;
  std::vector<View> views;
};

int ReductionFactor(std::span<const View> views) {
  constexpr double kStraightMm =
      1;                           // thermal cuts: ISO 9013, tolerances of squareness of 4 to 25 mm of plate
  constexpr int kEnoughPx = 1000;  // of a picture's longer side
  int size = 0;
  for (const auto& v : views) size = std::max({size, v.camera->width_px, v.camera->height_px});
  return std::max(1, std::min(size / kEnoughPx, static_cast<int>(kStraightMm / TypicalMmPerPx(views))));
}

Result<ReducedSurvey> Reduce(const Survey& survey, const std::vector<GreyImage>& pictures,
                             std::span<const View> views, int factor, const SurveyOptions& options,
                             const Progress& progress) {
  ReducedSurvey out;
  for (const auto& camera : survey.cameras) out.cameras.push_back(Reduced(camera, factor));
  out.lines.resize(pictures.size());
  out.pictures.resize(pictures.size());
  VSS_RETURN_IF_ERROR(
      ForEachPicture(pictures.size(), "reduced pictures", options.threads, progress, [&](std::size_t i) {
        thread_local LineWorkspace workspace;
        const Camera& camera = out.cameras[static_cast<std::size_t>(survey.images[i].camera)];
        out.pictures[i] = Reduced(pictures[i].view(), factor);
        out.lines[i] = DetectLines(out.pictures[i].view(), &camera.intrinsics, options.lines, &workspace);
      }));
  for (std::size_t i = 0; i < views.size(); ++i) {
    out.views.push_back(MakeView(views[i].image,
                                 out.cameras[static_cast<std::size_t>(survey.images[i].camera)],
                                 views[i].cam_from_world, views[i].stop, &out.lines[i]));
    out.views.back().picture = out.pictures[i].view();
  }
  return out;
}

// Which lines lie on which part as reconstruction has it, in the pictures as it has them.
void Match(const Reconstruction& reconstruction, std::vector<View> views, const SurveyOptions& options,
           std::vector<IdentifiedPart>& parts) {
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i] = MakeView(views[i].image, *views[i].camera, reconstruction.cam_from_world[i], views[i].stop,
                        views[i].lines);
  std::vector<PlacedObject> objects;
  for (const auto& part : reconstruction.parts) objects.push_back(part.object);
  auto matches = MatchLines(views, objects, options.identify, options.threads);
  for (std::size_t i = 0; i < parts.size(); ++i) parts[i].matches = std::move(matches[i]);
}

void WarnOfOutlyingPictures(const Survey& survey, Product& product) {
  for (const auto& p : product.checks->pictures)
    if (p.outlying)
      product.warnings.push_back(fmt::format(
          "picture {} contradicts the others: without it, {} of {} would be {:+.2f} mm ({:.1f} sigma); look "
          "whether its camera or carriage stood still",
          survey.images[static_cast<std::size_t>(p.image)].file, p.unknown, p.part, p.change_mm,
          std::abs(p.change_mm) / p.sigma_mm));
}

// The known lengths as indices into the identified parts, which are called part-1, part-2, ... in their
// order.
Result<std::vector<KnownLength>> KnownLengths(const SurveyOptions& options,
                                              const std::vector<IdentifiedPart>& parts) {
  std::vector<KnownLength> out;
  for (const auto& named : options.known_lengths) {
    std::size_t part = 0;
    while (part < parts.size() && PartId(static_cast<int>(part)) != named.part) ++part;
    if (part == parts.size())
      return InputError("--known-length {}.{}: there is no {}; {} parts were found, part-1, part-2, ...",
                        named.part, named.dimension, named.part, parts.size());
    const auto& model = *parts[part].object.model;
    const auto defs = model.dimensions();
    std::size_t dimension = 0;
    while (dimension < defs.size() && defs[dimension].name != named.dimension) ++dimension;
    if (dimension == defs.size())
      return InputError("--known-length {}.{}: {} is a {}, which has no {}", named.part, named.dimension,
                        named.part, model.kind(), named.dimension);
    out.push_back({static_cast<int>(part), static_cast<int>(dimension), named.value_mm, named.sigma_mm});
  }
  return out;
}

}  // namespace

Result<GreyImage> ReadSurveyPicture(const Survey& survey, int index) {
  const SurveyImage& image = survey.images[static_cast<std::size_t>(index)];
  const Camera& camera = survey.cameras[static_cast<std::size_t>(image.camera)];
  VSS_ASSIGN(GreyImage picture, ReadImage(image.path));
  if (picture.width() != camera.width_px || picture.height() != camera.height_px)
    return InputError(
        "{}: the picture has {} x {} pixels, but camera \"{}\" has {} x {}; name the camera that took it",
        image.path.string(), picture.width(), picture.height(), camera.id, camera.width_px, camera.height_px);
  VSS_RETURN_IF_ERROR(CheckContent(picture.view(), image.path.string()));
  return picture;
}

Result<std::vector<GreyImage>> ReadSurveyPictures(const Survey& survey, int threads,
                                                  const Progress& progress) {
  const std::size_t count = survey.images.size();
  std::vector<std::optional<Result<GreyImage>>> results(count);
  VSS_RETURN_IF_ERROR(ForEachPicture(count, "pictures", threads, progress, [&](std::size_t i) {
    results[i] = LinearPicture(survey, static_cast<int>(i));
  }));
  std::vector<GreyImage> pictures;
  for (auto& result : results) {
    if (!*result) return tl::unexpected(result->error());
    pictures.push_back(std::move(**result));
  }
  return pictures;
}

Result<std::vector<LineImage>> DetectSurveyLines(const Survey& survey, const std::vector<GreyImage>& pictures,
                                                 const SurveyOptions& options, const Progress& progress) {
  std::vector<LineImage> lines(pictures.size());
  VSS_RETURN_IF_ERROR(ForEachPicture(pictures.size(), "lines", options.threads, progress, [&](std::size_t i) {
    thread_local LineWorkspace workspace;  // only saves allocations: the result does not depend on it
    const SurveyImage& image = survey.images[i];
    lines[i] =
        DetectLines(pictures[i].view(), &survey.cameras[static_cast<std::size_t>(image.camera)].intrinsics,
                    options.lines, &workspace);
    lines[i].image = image.path.filename().string();
  }));
  return lines;
}

std::vector<View> MakeViews(const Survey& survey, const std::vector<LineImage>& lines,
                            const std::vector<GreyImage>& pictures) {
  constexpr double kSameStop_mm = 1e-3;  // displacements are written with fewer digits than this
  std::vector<Eigen::Vector3d> stops;
  std::vector<View> views;
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    const SurveyImage& image = survey.images[i];
    int stop = -1;
    if (image.gantry_mm) {
      const auto same = std::find_if(stops.begin(), stops.end(), [&](const auto& s) {
        return (s - *image.gantry_mm).norm() < kSameStop_mm;
      });
      stop = static_cast<int>(same - stops.begin());
      if (same == stops.end()) stops.push_back(*image.gantry_mm);
    }
    views.push_back(MakeView(static_cast<int>(i), survey.cameras[static_cast<std::size_t>(image.camera)],
                             image.cam_from_world, stop, &lines[i]));
    if (!pictures.empty()) views.back().picture = pictures[i].view();
  }
  return views;
}

std::vector<std::string> ImageFiles(const Survey& survey) {
  std::vector<std::string> files;
  for (const auto& image : survey.images) files.push_back(image.file);
  return files;
}

Result<SurveyOptions> OptionsOf(const Survey& survey) {
  SurveyOptions options;
  for (const auto& [name, value] : survey.parameters)
    VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value, options));
  return options;
}

Result<SurveyOutcome> RunSurvey(const Survey& survey, const SurveyOptions& options,
                                const Progress& progress) {
  SurveyOutcome outcome;
  Stopwatch watch(outcome.steps);
  VSS_ASSIGN(outcome.knowledge, LoadKnowledge(survey.knowledge, survey.folder));
  watch.Stop("knowledge");
  VSS_ASSIGN(const std::vector<GreyImage> pictures, ReadSurveyPictures(survey, options.threads, progress));
  watch.Stop("pictures");
  VSS_ASSIGN(outcome.lines, DetectSurveyLines(survey, pictures, options, progress));
  watch.Stop("lines");
  const std::vector<View> views = MakeViews(survey, outcome.lines, pictures);
  std::optional<ReducedSurvey> reduced;
  if (const int factor = ReductionFactor(views); factor > 1) {
    VSS_ASSIGN(reduced, Reduce(survey, pictures, views, factor, options, progress));
    watch.Stop("reduced pictures");
  }
  VSS_ASSIGN(SceneResult scene,
             IdentifyScene(std::span<const View>(reduced ? reduced->views : views), outcome.knowledge,
                           options.identify, options.threads, progress));
  watch.Stop("identify");
  std::vector<GreyView> grey;
  for (const auto& picture : pictures) grey.push_back(picture.view());
  ReconstructOptions reconstruct = options.reconstruct;
  VSS_ASSIGN(reconstruct.known_lengths, KnownLengths(options, scene.parts));
  VSS_ASSIGN(const Reconstruction reconstruction,
             ReconstructScene(views, grey, scene.parts, reconstruct, options.threads, progress));
  outcome.cam_from_world = reconstruction.cam_from_world;
  Match(reconstruction, views, options, scene.parts);
  watch.Stop("reconstruct");
  outcome.product = MakeProduct(scene, reconstruction, views);
  WarnOfOutlyingPictures(survey, outcome.product);
  outcome.product.survey = survey.name;
  outcome.product.warnings.insert(outcome.product.warnings.begin(), survey.warnings.begin(),
                                  survey.warnings.end());
  outcome.product.seams = FindSeams(outcome.product, outcome.knowledge, options.seams);
  ReduceToReferenceTemperature(options.temperature, outcome.product);
  watch.Stop("product");
  if (progress.Cancelled()) return Cancelled();
  return outcome;
}

}  // namespace vss
