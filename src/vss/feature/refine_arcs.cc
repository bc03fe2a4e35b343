// Elliptical arcs at their places of maximum likelihood.
#include "vss/feature/arc_curve.h"
#include "vss/feature/arc_fit.h"
#include "vss/feature/ellipse_fit.h"

namespace vss {
namespace {

using Eigen::Vector2d;

// The ellipse as taken: a distorting lens makes something near to one of the contour's points.
void ProjectToPicture(const Scene& s, EllipticalArc& arc) {
  if (!s.lens) {
    arc.center = arc.ideal_center, arc.axes = arc.ideal_axes, arc.angle_rad = arc.ideal_angle_rad;
    arc.from_rad = arc.ideal_from_rad, arc.to_rad = arc.ideal_to_rad;
    return;
  }
  constexpr int kPoints = 40;
  const Ellipse e{arc.ideal_center, arc.ideal_axes, arc.ideal_angle_rad};
  s.b.arc_points.clear();
  for (int i = 0; i <= kPoints; ++i)
    s.b.arc_points.push_back(
        s.Img(e.PointAt(arc.ideal_from_rad + (arc.ideal_to_rad - arc.ideal_from_rad) * i / kPoints)));
  if (const auto fit = FitEllipse(s.b.arc_points))
    arc.center = fit->ellipse.center, arc.axes = fit->ellipse.axes, arc.angle_rad = fit->ellipse.angle_rad;
}

// Whether a place (ideal) lies on the arc.
bool LiesOn(const EllipticalArc& arc, const ArcCurve& curve, const ArcRange& range, const Vector2d& p) {
  constexpr double kOnPx = 1.5;
  if ((p - arc.ideal_center).norm() > arc.ideal_axes.x() + kOnPx) return false;
  const auto place = curve.At(p, 0);
  return std::abs(place.distance) < kOnPx && range.Has(place.around);
}

// Whether the arc tells where its centre is at least as well as its own size.
bool IsKnown(const EllipticalArc& arc) {
  return arc.covariance(0, 0) + arc.covariance(1, 1) < arc.ideal_axes.y() * arc.ideal_axes.y();
}

// Whether so much of the ellipse is seen that its edge points tell where the rest would be.
bool IsMostlySeen(const EllipticalArc& arc) {
  constexpr double kShare = 0.75;
  return !IsWholeEllipse(arc) && arc.ideal_to_rad - arc.ideal_from_rad > kShare * 2 * kPi;
}

// Arcs and straight pieces that tell of a part of a longer arc go.
void DropCovered(const Scene& s, std::vector<EllipticalArc>& arcs) {
  s.b.arc_covered.assign(arcs.size(), 0);
  for (std::size_t i = 0; i < arcs.size(); ++i) {
    if (s.b.arc_covered[i]) continue;
    const EllipticalArc& arc = arcs[i];
    const ArcCurve curve({arc.ideal_center, arc.ideal_axes, arc.ideal_angle_rad});
    const ArcRange range = ArcRangeOf(arc);
    for (std::size_t j = 0; j < arcs.size(); ++j) {
      const EllipticalArc& other = arcs[j];
      if (i == j || s.b.arc_covered[j] || other.bright_inside != arc.bright_inside ||
          other.num_points > arc.num_points)
        continue;
      const Ellipse e{other.ideal_center, other.ideal_axes, other.ideal_angle_rad};
      constexpr int kPlaces = 8, kMost = 6;
      int on = 0;
      for (int k = 0; k < kPlaces; ++k)
        on += LiesOn(arc, curve, range,
                     e.PointAt(other.ideal_from_rad +
                               (other.ideal_to_rad - other.ideal_from_rad) * (k + 0.5) / kPlaces));
      s.b.arc_covered[j] = on >= kMost;
    }
    for (std::size_t j = 0; j < s.b.pieces.size(); ++j) {
      if (s.b.in_arc[j]) continue;
      const StraightPiece& p = s.b.pieces[j];
      const Vector2d middle = p.line.point + 0.5 * (p.from + p.to) * p.line.direction,
                     half = 0.5 * (p.to - p.from) * p.line.direction;
      s.b.in_arc[j] = LiesOn(arc, curve, range, middle) && LiesOn(arc, curve, range, middle - half) &&
                      LiesOn(arc, curve, range, middle + half);
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < arcs.size(); ++i)
    if (!s.b.arc_covered[i]) arcs[kept++] = arcs[i];
  arcs.resize(kept);
}

}  // namespace

void RefineArcs(const Scene& s, std::vector<EllipticalArc>& arcs) {
  constexpr int kRounds = 4;  // an arc that grew tells its ellipse better, and may grow on
  std::size_t kept = 0;
  for (std::size_t k = 0; k < arcs.size(); ++k) {
    EllipticalArc arc = arcs[k];
    if (IsMostlySeen(arc)) ExtendArc(s, arc);
    bool moved = false, explained = false;
    for (int i = 0; i < kRounds; ++i) {
      if (moved && (ArcRangeOf(arc).whole || !ExtendArc(s, arc))) break;
      const ArcMove move = MoveArc(s, arc);
      if (!move.moved) break;
      moved = true, explained = move.explained;
    }
    if (k >= s.b.num_sure_arcs && !(explained && IsKnown(arc))) continue;
    if (moved) ProjectToPicture(s, arc);
    arcs[kept++] = arc;
  }
  arcs.resize(kept);
  DropCovered(s, arcs);
}

}  // namespace vss
