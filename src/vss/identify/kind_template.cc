#include "vss/identify/kind_template.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A face counts as seen from above where its normal rises by this (6 degrees).
constexpr double kMinRise = 0.1;

// Left of, above, and height of the pair's edges over the dimensions' ranges.
void SetRanges(const ObjectModel& model, int rest, KindTemplate::Pair& pair) {
  const auto defs = model.dimensions();
  const int n = int(defs.size());
  struct Place {
    Vector3d value;  // left, above, height
    Eigen::Matrix3Xd by_dimension;
  };
  PlacedObject object = UsualObject(model, rest);
  auto place = [&]() {
    const WorldSolid solid = PlaceSolid(object);
    const auto &a = solid.edges[std::size_t(pair.first)], &b = solid.edges[std::size_t(pair.second)];
    const auto& from = solid.vertices[std::size_t(a.start)];
    const auto& to = solid.vertices[std::size_t(b.start)];
    const Vector2d u = EdgeDirection(solid, a).head<2>().normalized();
    Eigen::Matrix3d m = Eigen::Matrix3d::Zero();  // of the offset
    m.row(0) << -u.y(), u.x(), 0;
    m(1, 2) = 1;
    Place p;
    p.value = m * (to.point - from.point);
    p.value.z() = from.point.z();
    p.by_dimension = (m * (to.by_state - from.by_state)).rightCols(n);
    p.by_dimension.row(2) = from.by_state.row(2).tail(n);
    return p;
  };
  const Place usual = place();
  const std::vector<double> usual_mm = object.dimensions_mm;
  auto set = [&](const Vector3d& lo, const Vector3d& hi) {
    Eigen::AlignedBox1d* ranges[] = {&pair.left, &pair.above, &pair.height};
    for (int k = 0; k < 3; ++k)
      *ranges[k] =
          Eigen::AlignedBox1d(Eigen::Matrix<double, 1, 1>(lo[k]), Eigen::Matrix<double, 1, 1>(hi[k]));
  };
  // Linear? The same derivatives at both ends of every range.
  bool linear = true;
  for (int i = 0; i < n && linear; ++i)
    for (double end : {defs[std::size_t(i)].min_mm, defs[std::size_t(i)].max_mm}) {
      object.dimensions_mm = usual_mm;
      object.dimensions_mm[std::size_t(i)] = end;
      const Place other = place();
      linear &= other.by_dimension.allFinite() &&
                (other.by_dimension - usual.by_dimension).cwiseAbs().maxCoeff() < 1e-6;
    }
  if (!linear) {
    set(Vector3d::Constant(-INFINITY), Vector3d::Constant(INFINITY));
    return;
  }
  Vector3d lo = usual.value, hi = usual.value;
  for (int i = 0; i < n; ++i) {
    const double down = defs[std::size_t(i)].min_mm - usual_mm[std::size_t(i)],
                 up = defs[std::size_t(i)].max_mm - usual_mm[std::size_t(i)];
    const Vector3d j = usual.by_dimension.col(i);
    lo += (j * down).cwiseMin(j * up);
    hi += (j * down).cwiseMax(j * up);
  }
  set(lo, hi);
}

// The solid of an object as usual, and which of its contours may start it.
class TemplateMaker {
 public:
  TemplateMaker(const ObjectModel& model, int rest)
      : model_(model), rest_(rest), solid_(PlaceSolid(UsualObject(model, rest))) {}

  KindTemplate Make() const {
    KindTemplate t;
    t.model = &model_;
    t.resting_pose = rest_;
    const std::size_t n = solid_.edges.size();
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = i + 1; k < n; ++k)
        if (ArePair(solid_.edges[i], solid_.edges[k])) t.pairs.push_back(PairOf(int(i), int(k)));
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < n; ++k)
        if (AreSlant(solid_.edges[i], solid_.edges[k])) t.slants.push_back({int(i), int(k)});
    for (std::size_t i = 0; i < solid_.circles.size(); ++i)
      if (IsAbove(solid_.circles[i].plane_face)) t.rims.push_back(int(i));
    return t;
  }

 private:
  bool IsAbove(int face) const {
    const auto& f = solid_.faces[std::size_t(face)];
    return !f.is_cylinder && f.normal_in_part.z() > kMinRise;
  }

  Vector3d Unit(const SolidEdge& e) const { return EdgeDirection(solid_, e).normalized(); }

  // Parallel, of one face seen from above?
  bool ArePair(const SolidEdge& a, const SolidEdge& b) const {
    if (a.weight <= 0 || b.weight <= 0) return false;
    bool shared = false;
    for (int f : {a.left_face, a.right_face}) shared |= (f == b.left_face || f == b.right_face) && IsAbove(f);
    return shared && Unit(a).cross(Unit(b)).norm() <= 1e-6;
  }

  KindTemplate::Pair PairOf(int first, int second) const {
    const auto &a = solid_.edges[std::size_t(first)], &b = solid_.edges[std::size_t(second)];
    const int n = int(model_.dimensions().size());
    const Vector3d da = EdgeDirection(solid_, a);
    const Vector3d unit = da.normalized();
    // Same extent at all dimensions: the ends' difference along the edge does not depend on any.
    auto along = [&](int vertex) {
      const auto& v = solid_.vertices[std::size_t(vertex)];
      return std::pair{unit.dot(v.point), Eigen::RowVectorXd(unit.transpose() * v.by_state)};
    };
    const bool turned = da.dot(EdgeDirection(solid_, b)) < 0;
    const int b_start = turned ? b.end : b.start, b_end = turned ? b.start : b.end;
    const auto as = along(a.start), ae = along(a.end), bs = along(b_start), be = along(b_end);
    const bool same = std::abs(as.first - bs.first) + std::abs(ae.first - be.first) < 1e-6 &&
                      (as.second - bs.second).tail(n).norm() + (ae.second - be.second).tail(n).norm() < 1e-9;
    // Level with each other at all dimensions.
    const auto& va = solid_.vertices[std::size_t(a.start)];
    const auto& vb = solid_.vertices[std::size_t(b_start)];
    const bool level = std::abs(va.point.z() - vb.point.z()) < 1e-6 &&
                       (va.by_state.row(2) - vb.by_state.row(2)).tail(n).norm() < 1e-9;
    KindTemplate::Pair pair{first, second, same, same && level, {}, {}, {}};
    SetRanges(model_, rest_, pair);
    return pair;
  }

  // A slanted edge and an upright one of one face?
  bool AreSlant(const SolidEdge& a, const SolidEdge& b) const {
    if (a.weight <= 0 || b.weight <= 0) return false;
    const double rise = std::abs(Unit(a).z());
    if (rise < kMinRise || rise > 1 - kMinRise || std::abs(Unit(b).z()) < 1 - 1e-9) return false;
    bool one_face = false;
    for (int f : {a.left_face, a.right_face}) one_face |= f == b.left_face || f == b.right_face;
    return one_face;
  }

  const ObjectModel& model_;
  int rest_;
  WorldSolid solid_;
};

}  // namespace

Vector3d EdgeDirection(const WorldSolid& s, const SolidEdge& e) {
  return s.vertices[std::size_t(e.end)].point - s.vertices[std::size_t(e.start)].point;
}

PlacedObject UsualObject(const ObjectModel& model, int rest) {
  PlacedObject o;
  o.model = &model;
  o.resting_pose = rest;
  const std::vector<std::optional<double>> none(model.dimensions().size());
  o.dimensions_mm = model.UsualDimensions(none);
  return o;
}

std::vector<KindTemplate> MakeTemplates(const KnowledgeBase& knowledge) {
  std::vector<KindTemplate> out;
  for (const auto& model : knowledge.objects)
    for (std::size_t rest = 0; rest < model->resting_poses().size(); ++rest)
      out.push_back(TemplateMaker(*model, int(rest)).Make());
  return out;
}

}  // namespace vss
