// What parts stand on: the ground, whose height and slope may be unknowns, or another part; and what they lie
// against.
#include <cmath>

#include "vss/identify/upright_faces.h"
#include "vss/reconstruct/adjustment.h"

namespace vss {
namespace {

using Eigen::RowVectorXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Parts that do not lean stand as level as the ground: 0.1 mm in a metre.
constexpr double kLevelSigmaRad = 1e-4;

// Of the part's vertices the one that lies lowest against a plane of this normal; empty where it has none.
std::optional<Vector3d> LowestVertex(const WorldSolid& solid, const Vector3d& normal) {
  const Vector3d* lowest = nullptr;
  for (const auto& v : solid.vertices)
    if (!lowest || normal.dot(v.point) < normal.dot(*lowest)) lowest = &v.point;
  return lowest ? std::optional(*lowest) : std::nullopt;
}

// How high, above the plane z = 0 and where the part is placed, the plane parallel to the ground lies that
// the part touches from above.
double FootHeight(const PlacedObject& object, const WorldSolid& solid, const Vector3d& normal) {
  const Vector3d place = object.placement.head<3>();
  const auto lowest = LowestVertex(solid, normal);
  return lowest ? place.z() + normal.dot(*lowest - place) / normal.z() : place.z();
}

double TopOf(const WorldSolid& solid, const PlacedObject& on_it) {
  if (const auto top = TopUnder(solid, on_it.placement[0], on_it.placement[1], on_it.placement[2]))
    return *top;
  double z = 0;
  for (const auto& v : solid.vertices) z = std::max(z, v.point.z());
  for (const auto& c : solid.circles) z = std::max(z, c.center.point.z());
  return z;
}

// Derivative by the state of a number that depends on a placed object; central differences.
template <class F>
RowVectorXd ByState(const PlacedObject& object, const F& f) {
  constexpr double kStepMm = 0.05, kStepRad = 1e-5;
  const VectorXd x = object.State();
  RowVectorXd j(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double step = i >= 3 && i < kPlacementSize ? kStepRad : kStepMm;
    PlacedObject moved = object;
    VectorXd y = x;
    y[i] = x[i] + step;
    moved.SetState(y);
    const double plus = f(moved);
    y[i] = x[i] - step;
    moved.SetState(y);
    j[i] = (plus - f(moved)) / (2 * step);
  }
  return j;
}

double GapBetween(const WorldSolid& solid, const WorldSolid& other, const WallTie& wall) {
  const auto &mine = solid.faces[static_cast<std::size_t>(wall.face)],
             &wall_face = other.faces[static_cast<std::size_t>(wall.other_face)];
  return wall_face.normal_in_part.dot(MiddleOf(mine) - wall_face.triangles.front()[0]);
}

}  // namespace

std::vector<WallTie> FindWallTies(std::span<const AdjustedPart> parts, double reach_mm) {
  std::vector<WallTie> walls;
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object, false));
  for (std::size_t p = 0; p < solids.size(); ++p)
    for (std::size_t f = 0; f < solids[p].faces.size(); ++f) {
      const auto& face = solids[p].faces[f];
      if (!IsUpright(face)) continue;
      double nearest = reach_mm;
      WallTie wall{static_cast<int>(p), static_cast<int>(f), -1, -1};
      for (std::size_t q = 0; q < solids.size(); ++q)
        for (std::size_t g = 0; g < solids[q].faces.size(); ++g) {
          const auto way = p == q ? std::nullopt : WayToWall(face, solids[q].faces[g]);
          if (!way || std::abs(*way) >= nearest) continue;
          nearest = std::abs(*way);
          wall.other = static_cast<int>(q), wall.other_face = static_cast<int>(g);
        }
      if (wall.other >= 0) walls.push_back(wall);
    }
  return walls;
}

std::pair<double, RowVectorXd> Adjustment::GapOf(const WallTie& wall) const {
  const auto p = static_cast<std::size_t>(wall.part), q = static_cast<std::size_t>(wall.other);
  const WorldSolid solid = PlaceSolid(parts[p].object, false), other = PlaceSolid(parts[q].object, false);
  RowVectorXd j = RowVectorXd::Zero(layout_.size);
  j.segment(layout_.part[p], parts[p].object.StateSize()) = ByState(
      parts[p].object, [&](const PlacedObject& o) { return GapBetween(PlaceSolid(o, false), other, wall); });
  j.segment(layout_.part[q], parts[q].object.StateSize()) = ByState(
      parts[q].object, [&](const PlacedObject& o) { return GapBetween(solid, PlaceSolid(o, false), wall); });
  return {GapBetween(solid, other, wall), std::move(j)};
}

void Adjustment::DropBrokenWalls(double most_sigmas) {
  std::erase_if(walls, [&](const WallTie& wall) {
    auto [gap, j] = GapOf(wall);
    for (const int part : {wall.part, wall.other}) {
      const auto p = static_cast<std::size_t>(part);
      for (std::size_t i = 0; i < parts[p].free.size(); ++i)
        if (!parts[p].free[i]) j[layout_.part[p] + static_cast<Eigen::Index>(i)] = 0;
    }
    const double variance =
        options.wall_sigma_mm * options.wall_sigma_mm - (j * covariance_ * j.transpose())(0);
    return variance > 0 && gap * gap > most_sigmas * most_sigmas * variance;
  });
}

void Adjustment::Lean(int part, double tilt_sigma_rad) {
  auto& p = parts[static_cast<std::size_t>(part)];
  p.leans = p.free[4] = p.free[5] = true;
  p.prior_sigma[4] = p.prior_sigma[5] = tilt_sigma_rad;
}

void Adjustment::FreeGround() {
  ground.free = ground.pull_free = true;
  for (auto& p : parts) p.free[4] = p.free[5] = true;
}

void Adjustment::AddTie(const RowVectorXd& by_unknowns, double residual, double sigma) {
  h_.selfadjointView<Eigen::Lower>().rankUpdate(by_unknowns.transpose(), 1 / (sigma * sigma));
  g_ -= residual / (sigma * sigma) * by_unknowns.transpose();
}

void Adjustment::AddGroundPrior() {
  const Vector3d sigma(options.ground_height_sigma_mm, options.ground_slope_sigma,
                       options.ground_slope_sigma);
  const Vector3d w = sigma.cwiseAbs2().cwiseInverse();
  h_.diagonal().segment<kGroundSize>(layout_.ground) += w;
  g_.segment<kGroundSize>(layout_.ground) -= w.cwiseProduct(ground.value);
  const double pull_weight = 1 / (options.common_pull_px * options.common_pull_px);
  h_(layout_.pull, layout_.pull) += pull_weight;
  g_[layout_.pull] -= pull_weight * ground.pull_px;
}

// A part that does not lean is turned as the ground is: about the horizontal axis (slope_y, -slope_x), here
// in the part's own directions.
void Adjustment::AddSlopeTies(std::size_t part) {
  const auto& placement = parts[part].object.placement;
  const double c = std::cos(placement[3]), s = std::sin(placement[3]);
  const double along_x = ground.value[1], along_y = ground.value[2];
  RowVectorXd about_x = RowVectorXd::Zero(layout_.size), about_y = about_x;
  about_x[layout_.part[part] + 4] = about_y[layout_.part[part] + 5] = 1;
  about_x[layout_.ground + 1] = s;
  about_x[layout_.ground + 2] = -c;
  about_y[layout_.ground + 1] = c;
  about_y[layout_.ground + 2] = s;
  AddTie(about_x, placement[4] + s * along_x - c * along_y, kLevelSigmaRad);
  AddTie(about_y, placement[5] + c * along_x + s * along_y, kLevelSigmaRad);
}

void Adjustment::AddTies() {
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object, false));
  const Vector3d normal = ground.Normal();
  AddGroundPrior();
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto& part = parts[p];
    if (ground.free && !part.leans) AddSlopeTies(p);
    if (part.stands_on == kLoose) continue;
    RowVectorXd j = RowVectorXd::Zero(layout_.size);
    j.segment(layout_.part[p], part.object.StateSize()) = ByState(
        part.object, [&](const PlacedObject& o) { return FootHeight(o, PlaceSolid(o, false), normal); });
    double residual = FootHeight(part.object, solids[p], normal), sigma = options.ground_sigma_mm;
    if (part.stands_on < 0) {
      // Where a leaning part touches the ground, else where it is placed.
      const Vector3d place = part.object.placement.head<3>();
      const Vector3d touch = part.leans ? LowestVertex(solids[p], normal).value_or(place) : place;
      residual -= ground.HeightAt(place.x(), place.y());
      j.segment<2>(layout_.part[p]) -= ground.value.tail<2>().transpose();
      j[layout_.ground] = -1;
      j.segment<2>(layout_.ground + 1) = -touch.head<2>().transpose();
    } else {
      const auto s = static_cast<std::size_t>(part.stands_on);
      residual -= TopOf(solids[s], part.object);
      sigma = options.contact_sigma_mm;
      j.segment(layout_.part[s], parts[s].object.StateSize()) -= ByState(
          parts[s].object, [&](const PlacedObject& o) { return TopOf(PlaceSolid(o, false), part.object); });
    }
    AddTie(j, residual, sigma);
  }
  for (const auto& wall : walls) {
    const auto [gap, j] = GapOf(wall);
    AddTie(j, gap, options.wall_sigma_mm);
  }
}

}  // namespace vss
