#include "routes.h"

#include <algorithm>
#include <charconv>
#include <climits>
#include <cmath>
#include <fstream>

#include "calibration.h"
#include "checks_json.h"
#include "commands.h"
#include "live_fit.h"
#include "split_part.h"
#include "station_manual.h"
#include "station_page.h"
#include "vss/base/files.h"
#include "vss/base/output_folder.h"
#include "vss/export/export.h"
#include "vss/image/grey_image.h"
#include "vss/image/thumbnail.h"

namespace vss::station {

std::optional<std::int64_t> NumberIn(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || text.empty()) return std::nullopt;
  return value;
}
namespace {

constexpr int kThumbnailPx = 280, kThumbnailQuality = 82;
constexpr int kMaxHistoryRows = 500;
constexpr std::size_t kMaxPictureBytes = 256 << 20;
constexpr std::size_t kPngBitDepthAt = 24;  // in the header chunk, which comes first

std::int64_t QueryNumber(const Request& request, const std::string& name, std::int64_t otherwise) {
  const auto at = request.query.find(name);
  return at == request.query.end() ? otherwise : NumberIn(at->second).value_or(otherwise);
}

Response NotFound(const std::string& what) {
  return {404, "application/json", Json{{"error", what}}.dump(), {}};
}

std::string TypeOf(std::string_view name) {
  auto ends = [&](std::string_view e) {
    return name.size() >= e.size() && name.substr(name.size() - e.size()) == e;
  };
  if (ends(".html")) return "text/html; charset=utf-8";
  if (ends(".js")) return "text/javascript; charset=utf-8";
  if (ends(".css")) return "text/css; charset=utf-8";
  if (ends(".svg")) return "image/svg+xml";
  if (ends(".jpg")) return "image/jpeg";
  return "application/octet-stream";
}

// What the browser keeps as a file.
Response File(std::string type, const std::string& name, std::string text) {
  return {200,
          std::move(type),
          std::move(text),
          {{"Content-Disposition", fmt::format("attachment; filename=\"{}\"", name)}}};
}

Json ParametersJson(const std::vector<ParameterInfo>& parameters) {
  Json list = Json::array();
  for (const auto& p : parameters)
    list.push_back({{"name", p.name},
                    {"type", p.type},
                    {"unit", p.unit},
                    {"help", p.help},
                    {"min", p.min},
                    {"max", p.max},
                    {"default", p.default_value},
                    {"value", p.value}});
  return list;
}

Json UndoJson(std::int64_t edit, const std::string& label) {
  return edit == 0 ? Json() : Json{{"edit", edit}, {"label", label}};
}

}  // namespace

Response AnswerOf(const Error& error) {
  const int status = error.code == ErrorCode::kUsage ? 400 : error.code == ErrorCode::kInternal ? 500 : 422;
  return {status,
          "application/json",
          Json{{"error", error.message}}.dump(-1, ' ', false, Json::error_handler_t::replace),
          {}};
}

Response AnswerOf(const StoreError& error) {
  Json body = {{"error", error.message}};
  if (error.present)
    body["present"] = {
        {"kind", error.present->kind}, {"id", error.present->id}, {"version", error.present->version}};
  return {error.why == StoreError::kFailed ? 500 : 409,
          "application/json",
          body.dump(-1, ' ', false, Json::error_handler_t::replace),
          {}};
}

Response AnswerOf(const Json& json) {
  return {200, "application/json", json.dump(-1, ' ', false, Json::error_handler_t::replace), {}};
}

Routes::Routes(Workspace& workspace, std::function<void(const Json&)> tell)
    : workspace_(workspace), tell_(std::move(tell)) {}

Response Routes::Answer(const Request& request) {
  try {
    return Dispatch(request);
  } catch (const Json::exception& e) {
    return AnswerOf(Error{ErrorCode::kUsage, std::string("what was asked is malformed: ") + e.what()});
  }
}

namespace {
Response AnswerOf(Result<Json> result) {
  if (!result) return station::AnswerOf(result.error());
  return station::AnswerOf(*result);
}
}  // namespace

// What a route is asked: the body of a POST; the number in the place of '#' and the name in the place of '*'
// of its path.
struct Routes::Asked {
  const Request& request;
  const Json& body;
  int image = 0;
  std::string name;
};

struct Routes::Route {
  const char* path;
  Response (*answer)(Routes& routes, const Asked& asked);
};

const std::vector<Routes::Route> Routes::kPostRoutes = {
    {"command",
     [](Routes& r, const Asked& a) { return RunCommand(r.workspace_, a.request, a.body, r.tell_); }},
    {"fit", [](Routes& r, const Asked& a) { return AnswerOf(LiveFit(r.workspace_, a.body)); }},
    {"propose", [](Routes& r, const Asked& a) { return AnswerOf(ProposedContours(r.workspace_, a.body)); }},
    {"cut", [](Routes& r, const Asked& a) { return AnswerOf(CutPreview(r.workspace_, a.body)); }},
    {"drawing", [](Routes& r, const Asked& a) { return AnswerOf(r.Drawing(a.body)); }},
};
const std::vector<Routes::Route> Routes::kGetRoutes = {
    {"survey", [](Routes& r, const Asked&) { return station::AnswerOf(r.SurveyInfo()); }},
    {"state", [](Routes& r,
                 const Asked& a) { return station::AnswerOf(r.State(QueryNumber(a.request, "since", 0))); }},
    {"knowledge", [](Routes& r, const Asked&) { return station::AnswerOf(r.Knowledge()); }},
    {"scene", [](Routes& r, const Asked&) { return AnswerOf(r.Scene()); }},
    {"outlines/*",
     [](Routes& r, const Asked& a) {
       const auto outlines = r.OutlinesOf(a.name);
       return outlines ? station::AnswerOf(*outlines) : NotFound("there is no part of that name");
     }},
    {"measure", [](Routes& r, const Asked& a) { return AnswerOf(r.Measure(a.request)); }},
    {"history", [](Routes& r, const Asked& a) { return station::AnswerOf(r.History(a.request)); }},
    {"manual", [](Routes& r, const Asked&) { return station::AnswerOf(r.Manual()); }},
    {"manual/*", [](Routes& r, const Asked& a) { return r.ManualPicture(a.name); }},
    {"product.json",
     [](Routes& r, const Asked&) {
       return File("application/json", "product.json",
                   ProductToJson(r.workspace_.ProductNow(), r.workspace_.image_files()));
     }},
    {"report.html", [](Routes& r, const Asked&) { return r.ReportPage(); }},
    {"export/*", [](Routes& r, const Asked& a) { return r.Exported(a.name); }},
    {"calibration", [](Routes& r, const Asked&) { return station::AnswerOf(r.CalibrationJobs()); }},
    {"calibration/*", [](Routes& r, const Asked& a) { return r.Calibrated(a.name); }},
    {"pictures/#/image", [](Routes& r, const Asked& a) { return r.PictureBytes(a.image); }},
    {"pictures/#/thumb", [](Routes& r, const Asked& a) { return r.Thumbnail(a.image); }},
    {"pictures/#/lines", [](Routes& r, const Asked& a) { return AnswerOf(r.LinesOf(a.image)); }},
    {"pictures/#/projection", [](Routes& r, const Asked& a) { return AnswerOf(r.ProjectionOf(a.image)); }},
    {"pictures/#/before",
     [](Routes& r, const Asked& a) {
       return AnswerOf(r.BeforeOf(a.image, QueryNumber(a.request, "edit", 0)));
     }},
    {"pictures/#/overlay.svg", [](Routes& r, const Asked& a) { return r.Overlay(a.image); }},
};

// What `name` gives for '#' and '*' of `path`; empty where it does not match. A number that no picture has is
// -1.
std::optional<Routes::Asked> Routes::Matched(std::string_view path, std::string_view name,
                                             const Asked& nothing) {
  const std::size_t mark = std::min(path.find_first_of("#*"), path.size());
  if (name.substr(0, mark) != path.substr(0, mark)) return std::nullopt;
  if (mark == path.size()) return name.size() == mark ? std::optional(nothing) : std::nullopt;
  const std::string_view rest = name.substr(mark), tail = path.substr(mark + 1);
  if (path[mark] == '*') return Asked{nothing.request, nothing.body, 0, std::string(rest)};
  if (rest.size() < tail.size() || rest.substr(rest.size() - tail.size()) != tail) return std::nullopt;
  const auto number = NumberIn(rest.substr(0, rest.size() - tail.size()));
  return Asked{nothing.request, nothing.body,
               number && *number >= 0 && *number <= INT_MAX ? int(*number) : -1, ""};
}

Response Routes::Dispatch(const Request& request) {
  const std::string& path = request.path;
  if (path.rfind("/api/", 0) != 0) {
    if (request.method != "GET")
      return {405, "application/json", "{\"error\":\"the page is only read\"}", {{"Allow", "GET, HEAD"}}};
    return Page(request);
  }
  const std::string name = path.substr(5);
  const Asked nothing{request, Json(), 0, ""};
  if (request.method == "POST") {
    const Json body = Json::parse(request.body, nullptr, false);
    if (!body.is_object())
      return station::AnswerOf(Error{ErrorCode::kUsage, "what was posted is not a JSON object"});
    for (const auto& route : kPostRoutes)
      if (name == route.path) return route.answer(*this, {request, body, 0, ""});
    return NotFound("there is no such command");
  }
  for (const auto& route : kGetRoutes) {
    const auto asked = Matched(route.path, name, nothing);
    if (!asked) continue;
    if (asked->image < 0 || std::size_t(asked->image) >= workspace_.survey().images.size())
      return NotFound("there is no such picture");
    return route.answer(*this, *asked);
  }
  return NotFound("there is nothing of that name");
}

std::vector<std::pair<std::string, std::string>> Routes::Table() {
  std::vector<std::pair<std::string, std::string>> table;
  for (const auto& route : kGetRoutes) table.emplace_back("GET", route.path);
  for (const auto& route : kPostRoutes) table.emplace_back("POST", route.path);
  return table;
}

Response Routes::ReportPage() {
  auto report = workspace_.Report();
  return report ? File("text/html; charset=utf-8", "report.html", std::move(report->html))
                : station::AnswerOf(report.error());
}

Response Routes::Overlay(int image) {
  auto report = workspace_.Report();
  if (!report) return station::AnswerOf(report.error());
  return File("image/svg+xml", OutputNames(workspace_.image_files())[std::size_t(image)] + ".svg",
              std::move(report->overlays[std::size_t(image)]));
}

Response Routes::Page(const Request& request) const {
  const std::string name = request.path == "/" ? "index.html" : request.path.substr(1);
  for (const auto& file : station_page()) {
    if (file.name != name) continue;
    const std::string tag = fmt::format("\"{:x}\"", std::hash<std::string_view>{}(file.text));
    if (request.if_none_match == tag) return {304, TypeOf(name), "", {{"ETag", tag}}};
    return {200, TypeOf(name), std::string(file.text), {{"ETag", tag}, {"Cache-Control", "no-cache"}}};
  }
  if (name == "index.html")
    return {503,
            "text/plain; charset=utf-8",
            "This vss was built without its page: npm was not found. Install npm (Debian: apt install npm) "
            "and build again.\n",
            {}};
  return NotFound("there is no such page");
}

Response Routes::PictureBytes(int image) const {
  const auto& path = workspace_.survey().images[std::size_t(image)].path;
  const std::vector<std::pair<std::string, std::string>> keep = {{"Cache-Control", "private, max-age=3600"}};
  // What every browser shows goes out as it is; 16 bit, TIFF and PGM do not.
  if (auto bytes = ReadTextFile(path, kMaxPictureBytes); bytes && bytes->size() > kPngBitDepthAt) {
    if (bytes->compare(0, 4, "\x89PNG") == 0 && (*bytes)[kPngBitDepthAt] == 8)
      return {200, "image/png", std::move(*bytes), keep};
    if (bytes->compare(0, 2, "\xff\xd8") == 0) return {200, "image/jpeg", std::move(*bytes), keep};
  }
  const auto picture = ReadImage(path);
  if (!picture) return station::AnswerOf(picture.error());
  const auto png = EncodePng(picture->view());
  return {200, "image/png", std::string(png.begin(), png.end()), keep};
}

Response Routes::Thumbnail(int image) {
  const std::vector<std::pair<std::string, std::string>> keep = {{"Cache-Control", "private, max-age=3600"}};
  {
    std::lock_guard lock(mutex_);
    if (const auto at = thumbnails_.find(image); at != thumbnails_.end())
      return {200, "image/jpeg", at->second, keep};
  }
  const auto picture = ReadImage(workspace_.survey().images[std::size_t(image)].path);
  if (!picture) return station::AnswerOf(picture.error());
  const auto bytes = EncodeJpeg(ShrinkTo(picture->view(), kThumbnailPx).view(), kThumbnailQuality);
  std::string text(bytes.begin(), bytes.end());
  std::lock_guard lock(mutex_);
  thumbnails_[image] = text;
  return {200, "image/jpeg", std::move(text), keep};
}

Json Routes::SurveyInfo() const {
  const Survey& s = workspace_.survey();
  Json images = Json::array(), cameras = Json::array();
  for (const auto& image : s.images) {
    const Eigen::Vector3d center = image.cam_from_world.Inverse().translation;
    Json one = {{"file", image.file},
                {"camera", image.camera},
                {"center", JsonOf(center)},
                {"rotation", JsonOf(image.cam_from_world.rotation)}};
    if (image.gantry_mm) one["gantry"] = JsonOf(*image.gantry_mm);
    images.push_back(std::move(one));
  }
  for (const auto& c : s.cameras)
    cameras.push_back({{"id", c.id},
                       {"width", c.width_px},
                       {"height", c.height_px},
                       {"fx", c.intrinsics.fx_px},
                       {"fy", c.intrinsics.fy_px},
                       {"cx", c.intrinsics.cx_px},
                       {"cy", c.intrinsics.cy_px},
                       {"residual_px", c.quality ? Json(c.quality->residual_px) : Json()}});
  return {{"name", s.name},         {"images", images},       {"cameras", cameras},
          {"warnings", s.warnings}, {"step", CanWriteStep()}, {"version", VSS_VERSION}};
}

Json Routes::State(std::int64_t since) const {
  const UndoState undo = workspace_.store().State();
  Json items = Json::array();
  for (const auto& item : workspace_.store().Since(since)) {
    if (since == 0 && !item.value) continue;
    Json value = item.value ? *item.value : Json();
    if (item.kind == "calibration" && item.value) value = WithoutFiles(std::move(value));
    if (value.is_object() && (item.kind == "part" || item.kind == "settings")) RemoveChecks(value);
    items.push_back(
        {{"kind", item.kind}, {"id", item.id}, {"value", std::move(value)}, {"version", item.version}});
  }
  Json parameters = Json::array();
  if (const auto options = workspace_.Options()) parameters = ParametersJson(SurveyParameters(*options));
  return {{"revision", undo.revision},
          {"since", since},
          {"items", items},
          {"undo", UndoJson(undo.undo_edit, undo.undo_label)},
          {"redo", UndoJson(undo.redo_edit, undo.redo_label)},
          {"run", workspace_.RunState()},
          {"stale", workspace_.RunIsOfOtherCameras()},
          {"parameters", parameters}};
}

// workpiece.step, workpiece.glb, parts.csv, seams.csv: as `vss export` writes them.
Response Routes::Exported(const std::string& name) const {
  static const std::map<std::string, std::pair<std::string, std::string>> kFiles = {
      // name: format, type
      {"workpiece.step", {"step", "model/step"}},
      {"workpiece.glb", {"glb", "model/gltf-binary"}},
      {"parts.csv", {"csv", "text/csv; charset=utf-8"}},
      {"seams.csv", {"csv", "text/csv; charset=utf-8"}}};
  const auto file = kFiles.find(name);
  if (file == kFiles.end()) return NotFound("there is no such export");
  auto files = ExportProduct(workspace_.ProductNow(), workspace_.knowledge(),
                             std::vector<std::string>{file->second.first});
  if (!files) return station::AnswerOf(files.error());
  for (auto& one : *files)
    if (one.name == name) return File(file->second.second, name, std::move(one.content));
  return NotFound("there is no such export");
}

Json Routes::CalibrationJobs() const {
  Json jobs = Json::array();
  for (const auto& job : FindCalibrationJobs(workspace_.survey().folder)) jobs.push_back(job.name);
  std::vector<ParameterInfo> parameters;
  ListParameters(CalibrationParameters(), CalibrationOptions{}, parameters);
  return {{"jobs", jobs}, {"parameters", ParametersJson(parameters)}};
}

// report.html (to look at), calibration.json and cameras/ID.toml of the last calibration.
Response Routes::Calibrated(const std::string& name) const {
  const auto item = workspace_.store().Get("calibration", "last");
  if (!item) return NotFound("nothing was calibrated yet");
  const Json& last = *item->value;
  if (name == "report.html")
    return {200, "text/html; charset=utf-8", last.at("report").get<std::string>(), {}};
  if (name == "calibration.json") return File("application/json", name, last.at("json").get<std::string>());
  const Json& files = last.at("files");
  for (const auto& [id, text] : files.items())
    if (name == "cameras/" + id + ".toml")
      return File("application/toml", id + ".toml", text.get<std::string>());
  return NotFound("the calibration has no such file");
}

Json Routes::History(const Request& request) const {
  Json rows = Json::array();
  const int limit = int(std::clamp<std::int64_t>(QueryNumber(request, "limit", 100), 1, kMaxHistoryRows));
  for (const auto& h : workspace_.store().History(QueryNumber(request, "before", 0), limit))
    rows.push_back({{"revision", h.revision},
                    {"edit", h.edit},
                    {"action", h.action},
                    {"who", h.who},
                    {"when", h.when},
                    {"label", h.label}});
  Json out = {{"rows", rows}};
  if (const std::int64_t edit = QueryNumber(request, "edit", 0); edit > 0) {
    Json differences = Json::array();
    for (const auto& d : workspace_.store().DifferencesOf(edit))
      differences.push_back({{"kind", d.kind},
                             {"id", d.id},
                             {"before", d.before ? *d.before : Json()},
                             {"after", d.after ? *d.after : Json()}});
    out["differences"] = differences;
  }
  return out;
}

Response Routes::ManualPicture(const std::string& name) const {
  for (const auto& file : station_manual())
    if (file.name == name && TypeOf(name) == "image/jpeg")
      return {200, "image/jpeg", std::string(file.text), {{"Cache-Control", "private, max-age=3600"}}};
  return NotFound("the manual has no such picture");
}

Json Routes::Manual() const {
  Json pages = Json::array();
  for (const auto& file : station_manual())
    if (TypeOf(file.name) != "image/jpeg") pages.push_back({{"name", file.name}, {"text", file.text}});
  return {{"pages", pages}};
}

}  // namespace vss::station
