// What the station answers: the page, pictures, and JSON routes that each are one step of a survey.
#pragma once
#include <functional>
#include <memory>
#include <string>

#include "http_server.h"
#include "workspace.h"

namespace vss::station {

class Routes {
 public:
  // `tell` sends a JSON message to every open page.
  Routes(Workspace& workspace, std::function<void(const Json&)> tell);
  Response Answer(const Request& request);
  // Method and path below /api/ of every route: '#' stands for the number of a picture, '*' for a name.
  static std::vector<std::pair<std::string, std::string>> Table();

 private:
  struct Asked;
  struct Route;
  static const std::vector<Route> kGetRoutes, kPostRoutes;
  static std::optional<Asked> Matched(std::string_view path, std::string_view name, const Asked& nothing);
  Response Dispatch(const Request& request);
  Response ReportPage();
  Response Overlay(int image);
  Response Page(const Request& request) const;
  Response PictureBytes(int image) const;
  Response Thumbnail(int image);
  Json SurveyInfo() const;
  Json State(std::int64_t since) const;
  Result<Json> LinesOf(int image);
  Result<Json> ProjectionOf(int image);
  std::optional<Json> OutlinesOf(const std::string& part) const;  // empty: there is no such part
  Result<Json> BeforeOf(int image, std::int64_t edit) const;
  Result<Json> Scene();
  Json Knowledge() const;
  Response Exported(const std::string& name) const;
  Json CalibrationJobs() const;
  Response Calibrated(const std::string& name) const;
  Result<Json> Drawing(const Json& body) const;
  Result<Json> Measure(const Request& request) const;
  Json History(const Request& request) const;
  Json Manual() const;
  Response ManualPicture(const std::string& name) const;

  Workspace& workspace_;
  std::function<void(const Json&)> tell_;
  std::mutex mutex_;
  std::map<int, std::string> thumbnails_;
};

// An error as an answer: 400, 422 or 500 by its code.
Response AnswerOf(const Error& error);
Response AnswerOf(const StoreError& error);
Response AnswerOf(const Json& json);

// A whole number that is all of `text`.
std::optional<std::int64_t> NumberIn(std::string_view text);

}  // namespace vss::station
