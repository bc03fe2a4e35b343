#include "vss/knowledge/check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "vss/knowledge/build_solid.h"
#include "vss/knowledge/define.h"
#include "vss/knowledge/repair.h"

namespace vss {
namespace {

constexpr int kMaxCorners = 4096;  // of the ranges: all of them up to 12 dimensions
constexpr int kNumBetween = 200;   // places between the corners
constexpr double kKept_mm = 1e-5;
constexpr double kOnGround_mm = 1e-3;  // a point this near to the support touches it

using Dimensions = std::vector<double>;

class Checker {
 public:
  explicit Checker(Definition definition)
      : definition_(std::move(definition)), n_(definition_.dimensions.size()) {}

  std::vector<KnowledgeFinding> Run() {
    CheckRangeEnds();
    for (const Dimensions& x : Places()) CheckPlace(x);
    return std::move(findings_);
  }

 private:
  // One finding for each line and sort: the same mistake shows at many places.
  void Find(bool is_error, SourcePosition at, const std::string& sort, const std::string& sentence) {
    if (!seen_.insert(fmt::format("{}:{}:{}", at.line, at.column, sort)).second) return;
    findings_.push_back(
        {is_error, fmt::format("{}:{}:{}: {}", definition_.file, at.line, at.column, sentence)});
  }

  bool Keeps(const Dimensions& x) const {
    for (const ConstraintGap& gap : ConstraintGaps(definition_, x))
      if (!(gap.distance_mm <= kKept_mm)) return false;
    return true;
  }

  void CheckRangeEnds() {
    for (std::size_t i = 0; i < n_; ++i) {
      const DimensionDef& d = definition_.dimensions[i];
      for (const double end : {d.min_mm, d.max_mm}) {
        std::vector<std::optional<double>> known(n_);
        known[i] = end;
        const Dimensions x = UsualDimensions(definition_, known);
        if (Keeps(x)) continue;
        int line = 0;
        for (const ConstraintGap& gap : ConstraintGaps(definition_, x))
          if (gap.distance_mm > kKept_mm) line = definition_.constraints[gap.constraint].at.line;
        Find(false, definition_.dimension_at[i], end == d.min_mm ? "low" : "high",
             fmt::format(
                 "{} = {:g} mm is in the range but cannot be reached: the constraint of line {} forbids it; "
                 "narrow the range",
                 d.name, end, line));
      }
    }
  }

  // Corners of the ranges and places between, moved to where the constraints hold.
  std::vector<Dimensions> Places() const {
    std::vector<Dimensions> places;
    const int all = n_ < 12 ? 1 << n_ : kMaxCorners;
    std::mt19937 random(1);
    for (int c = 0; c < all + kNumBetween; ++c) {
      Dimensions x(n_);
      for (std::size_t i = 0; i < n_; ++i) {
        const DimensionDef& d = definition_.dimensions[i];
        const double t = random() / static_cast<double>(std::mt19937::max());
        if (c < all)
          x[i] = (n_ < 12 ? (c >> i & 1) != 0 : t < 0.5) ? d.max_mm : d.min_mm;
        else if (d.min_mm > 0)
          x[i] = d.min_mm * std::pow(d.max_mm / d.min_mm, t);
        else
          x[i] = d.min_mm + t * (d.max_mm - d.min_mm);
      }
      x = NearestAllowed(definition_, x);
      if (Keeps(x)) places.push_back(std::move(x));
    }
    return places;
  }

  void CheckPlace(const Dimensions& x) {
    if (auto solid = CheckSolid(definition_, x); !solid) {
      const std::string& message = solid.error().message;  // FILE:LINE:COLUMN: at DIMENSIONS: sentence
      const std::size_t sort = message.rfind(": ");
      if (seen_.insert(message.substr(0, message.find(": at ")) + message.substr(sort).substr(0, 16)).second)
        findings_.push_back({true, message});
      return;
    }
    const Solid solid = BuildSolid(definition_, x);
    for (std::size_t p = 0; p < definition_.resting_poses.size(); ++p)
      if (!definition_.propped[p]) CheckRest(static_cast<int>(p), solid, x);
  }

  // Does the centre of gravity lie above the points that touch the support?
  void CheckRest(int pose, const Solid& solid, const Dimensions& x) {
    const Eigen::Matrix3d& turn = definition_.resting_poses[pose].rested_from_part;
    double lowest = 1e300, volume = 0;
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    for (const SolidFace& face : solid.faces) {
      for (const auto& t : face.triangles) {
        const double v = t[0].dot(t[1].cross(t[2])) / 6;
        volume += v;
        moment += v * (t[0] + t[1] + t[2]) / 4;
        for (const auto& p : t) lowest = std::min(lowest, (turn * p).z());
      }
    }
    const Eigen::Vector2d center = (turn * (moment / volume)).head<2>();
    std::vector<Eigen::Vector2d> feet;
    for (const SolidFace& face : solid.faces)
      for (const auto& t : face.triangles)
        for (const auto& p : t)
          if ((turn * p).z() < lowest + kOnGround_mm) feet.push_back((turn * p).head<2>());
    if (InHull(feet, center)) return;
    std::string where;
    for (std::size_t i = 0; i < n_; ++i)
      where += fmt::format("{}{} {:g} mm", i ? ", " : "", definition_.dimensions[i].name, x[i]);
    Find(false, definition_.rest_at[pose], "tips",
         fmt::format("at {}: it tips over in the pose '{}'; turn it otherwise, or say propped where "
                     "something holds it",
                     where, definition_.resting_poses[pose].name));
  }

  // Is p in the convex hull of the points: is there no direction in which it lies beyond all of them?
  static bool InHull(const std::vector<Eigen::Vector2d>& points, const Eigen::Vector2d& p) {
    std::vector<double> angles;
    for (const auto& q : points) {
      if ((q - p).norm() < kOnGround_mm) return true;
      angles.push_back(std::atan2(q.y() - p.y(), q.x() - p.x()));
    }
    std::sort(angles.begin(), angles.end());
    double widest = angles.empty() ? 7 : angles.front() + 2 * M_PI - angles.back();
    for (std::size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
    return widest <= M_PI + 1e-9;
  }

  Definition definition_;
  std::size_t n_;
  std::set<std::string> seen_;
  std::vector<KnowledgeFinding> findings_;
};

}  // namespace

std::vector<KnowledgeFinding> CheckKnowledge(const std::string& text, const std::string& file) {
  auto variants = Define(text, file);
  if (!variants) return {{true, variants.error().message}};
  std::vector<KnowledgeFinding> findings;
  std::set<std::string> said;  // what the first variant shows too is no matter of the others
  for (Definition& definition : *variants) {
    const std::string name = definition.variant;
    for (KnowledgeFinding& f : Checker(std::move(definition)).Run()) {
      if (!said.insert(f.message).second) continue;
      f.message = InVariant(f.message, name);
      findings.push_back(std::move(f));
    }
  }
  return findings;
}

}  // namespace vss
