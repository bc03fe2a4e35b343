// The product as it stands, and parts measured anew.
#include <algorithm>

#include "checks_json.h"
#include "reduced_views.h"
#include "vss/product/make_part.h"
#include "workspace.h"

namespace vss::station {

std::string DoubtOf(const Part& part) {
  if (part.doubtful && part.runner_up && !part.runner_up->kind.empty())
    return fmt::format("It could also be a {}: {:.0f} speaks for it, {:.0f} for this.", part.runner_up->kind,
                       part.runner_up->log_odds, part.log_odds);
  if (part.doubtful) return fmt::format("Little speaks for it (log-odds {:.0f}).", part.log_odds);
  std::string hidden;
  for (const auto& d : part.dimensions)
    if (!d.observable) hidden += (hidden.empty() ? "" : ", ") + d.name;
  return hidden.empty() ? "" : fmt::format("No picture shows its {}.", hidden);
}

namespace {

// What the last run checked, as far as it speaks of parts that are as the run found them.
void AddChecks(const Json& run, const std::vector<std::string>& image_files, Product& product) {
  if (const auto at = run.find("temperature"); at != run.end())
    product.temperature =
        ReducedTemperature{at->at("workpiece_c").get<double>(), at->at("expansion_ppm_per_k").get<double>(),
                           at->at("factor").get<double>()};
  if (!run.contains("checks")) return;
  product.checks = SurveyChecksOf(run["checks"], image_files);
  std::erase_if(product.checks->pictures, [&](const PictureCheck& check) {
    return !check.part.empty() &&
           std::none_of(product.parts.begin(), product.parts.end(),
                        [&](const Part& p) { return p.id == check.part && p.source == "automatic"; });
  });
}

}  // namespace

Product Workspace::ProductNow() const {
  Product product;
  product.survey = survey().name;
  product.warnings = survey().warnings;
  for (auto& p : Parts()) product.parts.push_back(std::move(p.part));
  std::int64_t version = 0;
  product.seams = FindSeams(product, knowledge_, OptionsOfLastRun(&version).seams);
  if (const auto run = store_->Get("settings", "run")) {
    product.warnings = run->value->value("warnings", product.warnings);
    for (const auto& u : run->value->value("unknown", Json::array()))
      product.unknown.push_back({VectorOf(u["center"]), VectorOf(u["extent"]), u.value("num_lines", 0)});
    AddChecks(*run->value, image_files_, product);
  }
  return product;
}

Result<Part> Workspace::Measured(const Part& part) const {
  std::int64_t version = 0;
  const SurveyOptions options = OptionsOfLastRun(&version);
  const std::vector<LineImage> no_lines(survey().images.size());
  std::vector<View> views = MakeViews(survey(), no_lines);
  if (const auto run = store_->Get("settings", "run")) ReduceViews(*run->value, views);
  std::vector<IdentifiedPart> found;
  std::map<std::string, int> index;
  std::vector<StationPart> parts = Parts();
  std::erase_if(parts, [&](const auto& p) { return !knowledge_.Find(p.part.kind); });
  for (const auto& p : parts) {
    index[p.part.id] = int(found.size());
    IdentifiedPart one;
    one.object = PlacedObjectOf(p.part, knowledge_);
    one.matches = p.part.matches;
    one.views = p.part.images;  // the pictures are the views, in their order
    one.log_odds = p.part.log_odds;
    found.push_back(std::move(one));
  }
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (const auto at = index.find(parts[i].part.stands_on); at != index.end())
      found[i].stands_on = at->second;
  const auto mine = index.find(part.id);
  if (mine == index.end())
    return UsageError("the knowledge base has no kind \"{}\"; it cannot be measured", part.kind);
  VSS_ASSIGN(const auto pictures, ReadSurveyPictures(survey(), options_.threads, Progress{}));
  std::vector<GreyView> grey;
  for (const auto& picture : pictures) grey.push_back(picture.view());
  VSS_ASSIGN(const Reconstruction all,
             ReconstructScene(views, grey, found, options.reconstruct, options_.threads, Progress{}));
  const ReconstructedPart& measured = all.parts[std::size_t(mine->second)];
  if (measured.views.empty())
    return UsageError("no picture shows edges of {} where it is; correct its lines first", part.id);
  Part out = part;
  SetReconstruction(measured, views, out);
  for (const auto& m : out.matches)  // a picture with a line of the part stays one of its pictures
    if (std::find(out.images.begin(), out.images.end(), m.image) == out.images.end())
      out.images.push_back(m.image);
  std::sort(out.images.begin(), out.images.end());
  return out;
}

Result<ReportFiles> Workspace::Report() {
  Product product = ProductNow();
  std::vector<LineImage> lines;
  std::vector<FlatLineImage> numbers;
  for (std::size_t i = 0; i < survey().images.size(); ++i) {
    VSS_ASSIGN(const auto edited, Lines(int(i)));
    numbers.push_back(FlatLines(*edited));
    lines.push_back(std::move(numbers.back().lines));
  }
  // The station's numbers of lines to places in `lines`; a line that was removed is left out.
  for (auto& part : product.parts)
    std::erase_if(part.matches, [&](ContourMatch& m) {
      const auto& of = m.is_arc ? numbers[std::size_t(m.image)].arc_numbers
                                : numbers[std::size_t(m.image)].segment_numbers;
      const auto at = std::find(of.begin(), of.end(), m.line);
      m.line = int(at - of.begin());
      return at == of.end();
    });
  std::vector<View> views = Views();
  for (auto& view : views) view.lines = &lines[std::size_t(view.image)];
  std::int64_t version = 0;
  ReportInput input;
  input.product = &product;
  input.knowledge = &knowledge_;
  input.views = views;
  input.lines = lines;
  input.image_files = image_files_;
  if (const auto run = store_->Get("settings", "run"))
    for (const auto& s : run->value->value("steps", Json::array()))
      input.step_seconds.emplace_back(s.value("step", ""), s.value("seconds", 0.0));
  input.parameters = SurveyParameters(OptionsOfLastRun(&version));
  input.picture = [this](int image) { return ReadSurveyPicture(survey(), image); };
  input.num_cameras = int(survey().cameras.size());
  return MakeReport(input, options_.threads);
}

}  // namespace vss::station
