#include "vss/identify/placed_object.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const KnowledgeBase& Knowledge() {
  static const KnowledgeBase knowledge = *LoadKnowledge({}, ".");
  return knowledge;
}

PlacedObject Place(const std::string& kind, const std::string& pose, std::vector<double> dimensions_mm,
                   double yaw_rad, double z_mm = 0) {
  PlacedObject object;
  object.model = Knowledge().Find(kind);
  const auto poses = object.model->resting_poses();
  const auto found = std::find_if(poses.begin(), poses.end(), [&](const auto& p) { return p.name == pose; });
  EXPECT_NE(found, poses.end()) << kind << " " << pose;
  object.resting_pose = int(found - poses.begin());
  object.dimensions_mm = std::move(dimensions_mm);
  object.placement << 700, -200, z_mm, yaw_rad, 0, 0;
  return object;
}

// Of all points of its faces.
Eigen::AlignedBox3d BoxOf(const WorldSolid& solid) {
  Eigen::AlignedBox3d box;
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles)
      for (const auto& p : t) box.extend(p);
  return box;
}

// Have two solids the same corners?
bool SameCorners(const WorldSolid& a, const WorldSolid& b) {
  if (a.vertices.size() != b.vertices.size()) return false;
  return std::all_of(a.vertices.begin(), a.vertices.end(), [&](const WorldPoint& p) {
    return std::any_of(b.vertices.begin(), b.vertices.end(),
                       [&](const WorldPoint& q) { return (p.point - q.point).norm() < 1e-9; });
  });
}

TEST(PlaceSolid, LaysEveryShippedObjectOnItsSupportInEveryPose) {
  for (const auto& model : Knowledge().objects) {
    const std::vector<std::optional<double>> unknown(model->dimensions().size());
    for (const RestingPose& pose : model->resting_poses()) {
      const PlacedObject object = Place(model->kind(), pose.name, model->UsualDimensions(unknown), 0.7, 35);
      const WorldSolid solid = PlaceSolid(object);
      EXPECT_NEAR(BoxOf(solid).min().z(), 35, 1e-9) << model->kind() << " " << pose.name;
      const Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d::UnitZ()) * pose.rested_from_part;
      EXPECT_LT((solid.world_from_part.rotation - turn).norm(), 1e-12) << model->kind() << " " << pose.name;
      // The corners are those of the part frame, moved as world_from_part says.
      const Solid part = model->InstantiateUnchecked(object.dimensions_mm);
      for (std::size_t i = 0; i < part.vertices.size(); ++i)
        EXPECT_LT((solid.world_from_part * part.vertices[i].point_in_part - solid.vertices[i].point).norm(),
                  1e-9);
    }
  }
}

TEST(PlaceSolid, DifferentiatesInEveryPose) {
  for (const auto& model : Knowledge().objects) {
    const std::vector<std::optional<double>> unknown(model->dimensions().size());
    for (const RestingPose& pose : model->resting_poses()) {
      PlacedObject object = Place(model->kind(), pose.name, model->UsualDimensions(unknown), 0.7, 35);
      object.placement[4] = 0.01;
      object.placement[5] = -0.02;
      const WorldSolid solid = PlaceSolid(object);
      for (int k = 0; k < object.StateSize(); ++k) {
        const double step = k >= 3 && k < kPlacementSize ? 1e-6 : 1e-3;
        const auto at = [&](double change) {
          PlacedObject moved = object;
          Eigen::VectorXd state = object.State();
          state[k] += change;
          moved.SetState(state);
          return PlaceSolid(moved, false);
        };
        const WorldSolid ahead = at(step), behind = at(-step);
        for (std::size_t v = 0; v < solid.vertices.size(); ++v) {
          const Vector3d numeric = (ahead.vertices[v].point - behind.vertices[v].point) / (2 * step);
          EXPECT_LT((numeric - solid.vertices[v].by_state.col(k)).norm(), 1e-5 * (1 + numeric.norm()))
              << model->kind() << " " << pose.name << " state " << k;
        }
      }
    }
  }
}

TEST(PlaceSolid, TurnsABeamOntoItsSide) {
  const WorldSolid solid = PlaceSolid(Place("i_beam", "side", {900, 220, 320, 25, 30}, 0), false);
  EXPECT_LT((BoxOf(solid).sizes() - Vector3d(900, 320, 220)).norm(), 1e-9);
  // What was up lies to the side: z of the part along y of the world, level.
  EXPECT_LT((solid.world_from_part.rotation.col(2) - Vector3d(0, -1, 0)).norm(), 1e-12);
  EXPECT_LT((solid.world_from_part.rotation.col(1) - Vector3d(0, 0, 1)).norm(), 1e-12);
}

TEST(PlaceSolid, LaysABracketFlat) {
  const WorldSolid solid = PlaceSolid(Place("bracket", "flat", {500, 400, 40, 90}, 0), false);
  EXPECT_LT((BoxOf(solid).sizes() - Vector3d(500, 400, 40)).norm(), 1e-9);
  // On its other face it is the mirror image: the same with length and height exchanged, turned by a quarter.
  PlacedObject other = Place("bracket", "flat", {400, 500, 40, 90}, kPi / 2);
  Eigen::AlignedBox3d box = BoxOf(PlaceSolid(other, false));
  EXPECT_LT((box.sizes() - Vector3d(500, 400, 40)).norm(), 1e-9);
}

TEST(PlaceSolid, TurnsAChannelUpsideDownAndOnAFlange) {
  const WorldSolid down = PlaceSolid(Place("channel", "flanges_down", {800, 300, 140, 25, 20}, 0), false);
  EXPECT_LT((BoxOf(down).sizes() - Vector3d(800, 300, 140)).norm(), 1e-9);
  EXPECT_LT((down.world_from_part.rotation.col(2) + Vector3d::UnitZ()).norm(), 1e-12);
  // The back's outer face is on top, whole; the flanges' tips are on the floor.
  double top_area = 0, floor_area = 0;
  for (const auto& f : down.faces)
    for (const auto& t : f.triangles) {
      const double area = (t[1] - t[0]).cross(t[2] - t[0]).norm() / 2;
      if (std::min({t[0].z(), t[1].z(), t[2].z()}) > 140 - 1e-9) top_area += area;
      if (std::max({t[0].z(), t[1].z(), t[2].z()}) < 1e-9) floor_area += area;
    }
  EXPECT_NEAR(top_area, 800 * 300, 1e-6);
  EXPECT_NEAR(floor_area, 2 * 800 * 20, 1e-6);
  const WorldSolid side = PlaceSolid(Place("channel", "side", {800, 300, 140, 25, 20}, 0), false);
  EXPECT_LT((BoxOf(side).sizes() - Vector3d(800, 140, 300)).norm(), 1e-9);
}

TEST(PlaceSolid, AnAngleOnItsOtherLegIsOneWithWidthAndHeightExchanged) {
  // The angle tipped over onto its upright leg, by hand: a quarter turn about x, its lowest corner on the
  // floor.
  const WorldSolid upright = PlaceSolid(Place("angle", "base", {900, 200, 120, 15}, 0), false);
  const Matrix3d tip = Eigen::AngleAxisd(kPi / 2, Vector3d::UnitX()).toRotationMatrix();
  WorldSolid tipped = upright;
  Eigen::AlignedBox3d box;
  for (auto& v : tipped.vertices) {
    v.point = tip * v.point;
    box.extend(v.point);
  }
  const Vector3d middle(700, -200, 0);
  for (auto& v : tipped.vertices)
    v.point += middle - Vector3d(box.center().x(), box.center().y(), box.min().z());
  const WorldSolid exchanged = PlaceSolid(Place("angle", "base", {900, 120, 200, 15}, kPi), false);
  EXPECT_TRUE(SameCorners(tipped, exchanged));
}

TEST(RelatedOf, HasThePartsFacesAndDirection) {
  const RelatedSolid beam = RelatedOf(Place("i_beam", "side", {900, 220, 320, 25, 30}, kPi / 2));
  EXPECT_EQ(beam.kind, "i_beam");
  EXPECT_LT((beam.along - Vector3d::UnitY()).norm(), 1e-12);
  const RelatedSolid beside = RelatedOf(Place("box", "base", {900, 100, 20}, kPi / 2));
  EXPECT_EQ(DistanceOf(beam.triangles, beside.triangles, 1000), 0);
}

}  // namespace
}  // namespace vss
