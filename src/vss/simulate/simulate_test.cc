#include "vss/simulate/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <set>

#include "vss/feature/line_image.h"
#include "vss/simulate/random.h"
#include "vss/simulate/random_scene.h"
#include "vss/simulate/shadows.h"
#include "vss/simulate/visibility.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const KnowledgeBase& Knowledge() {
  static const KnowledgeBase knowledge = *LoadKnowledge({}, ".");
  return knowledge;
}

ScenePart MakePart(const std::string& kind, std::vector<double> dimensions_mm, double x, double y, double z,
                   double yaw) {
  ScenePart part;
  part.id = "p1";
  part.object.model = Knowledge().Find(kind);
  part.object.dimensions_mm = std::move(dimensions_mm);
  part.object.placement << x, y, z, yaw, 0, 0;
  part.material = {0.6, 0, 0, 0};
  return part;
}

// A dark floor, even light from above, no noise: one camera with a bent lens 3 m up, tilted by 20 degrees.
SimulatedScene PlainScene() {
  SimulatedScene scene;
  AddRandomRig(3, {.stops = {1, 1}}, scene);
  scene.pictures.resize(1);
  scene.lamps.clear();
  scene.ground = {0.1, 0, 0, 0};
  for (SceneCamera& c : scene.cameras) c.read_noise = c.shot_noise = c.vignetting = 0;
  return scene;
}

RenderedPicture Render(const SimulatedScene& scene, int picture = 0) {
  const SceneMesh mesh = MakeMesh(scene);
  const auto& camera = scene.cameras[std::size_t(scene.pictures[std::size_t(picture)].camera)].camera;
  return RenderPicture(scene, mesh, picture, *PixelRays::Make(camera, 1));
}

// Mean distance (px, across) of the found line at the projection of edge a-b from it; empty where no line
// lies there.
std::optional<double> OffsetOfLine(const LineImage& lines, const SimulatedScene& scene, const Vector3d& a,
                                   const Vector3d& b) {
  const ScenePicture& picture = scene.pictures[0];
  const Intrinsics& lens = scene.cameras[std::size_t(picture.camera)].camera.intrinsics;
  const auto ideal = [&](const Vector3d& p) {
    const Vector3d q = picture.cam_from_world * p;
    return lens.IdealFromNormalized({q.x() / q.z(), q.y() / q.z()});
  };
  const Vector2d from = ideal(a), to = ideal(b), along = (to - from).normalized(),
                 across(-along.y(), along.x());
  constexpr double kNearPx = 1;
  std::optional<double> offset;
  double longest = 0.5 * (to - from).norm();
  for (const LineSegment& s : lines.segments) {
    const double start = across.dot(s.ideal_start - from), end = across.dot(s.ideal_end - from);
    const double length = (s.ideal_end - s.ideal_start).norm();
    if (std::abs(start) > kNearPx || std::abs(end) > kNearPx || length < longest) continue;
    longest = length;
    offset = (start + end) / 2;
  }
  return offset;
}

// Does the lower edge of the side below a-b lie so near in the picture that the two look like one?
bool IsDouble(const SimulatedScene& scene, const Vector3d& a, const Vector3d& b) {
  const Intrinsics& lens = scene.cameras[0].camera.intrinsics;
  const auto ideal = [&](const Vector3d& p) {
    const Vector3d q = scene.pictures[0].cam_from_world * p;
    return lens.IdealFromNormalized({q.x() / q.z(), q.y() / q.z()});
  };
  const Vector2d along = (ideal(b) - ideal(a)).normalized(), across(-along.y(), along.x());
  constexpr double kApartPx = 5;
  const Vector3d below((a.x() + b.x()) / 2, (a.y() + b.y()) / 2, 0);
  return std::abs(across.dot(ideal(below) - ideal(a))) < kApartPx;
}

TEST(RenderPicture, PutsTheEdgesOfABoxWhereTheCameraSeesThem) {
  std::vector<double> offsets;
  for (int k = 0; k < 6; ++k) {
    SimulatedScene scene = PlainScene();
    const Vector2d place =
        Vector2d(scene.pictures[0].gantry_mm->head<2>()) + Vector2d(37 * k - 90, 120 - 41 * k);
    scene.parts.push_back(
        MakePart("box", {900, 600, 200}, place.x(), place.y(), 0, RadFromDeg(-40 + 17 * k)));
    const RenderedPicture picture = Render(scene);
    const LineImage lines = DetectLines(picture.image.view(), &scene.cameras[0].camera.intrinsics, {});
    const TruePart truth = TruthOf(scene)[0];
    std::vector<Vector3d> top;
    for (const auto& v : truth.vertices)
      if (v.z() > 100) top.push_back(v);
    ASSERT_EQ(top.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = i + 1; j < 4; ++j)
        if ((top[i] - top[j]).norm() < 950 && !IsDouble(scene, top[i], top[j]))  // the diagonals are longer
          if (const auto offset = OffsetOfLine(lines, scene, top[i], top[j])) offsets.push_back(*offset);
  }
  ASSERT_GE(offsets.size(), 12U);
  double mean = 0, square = 0;
  for (const double o : offsets) mean += o / double(offsets.size()), square += o * o / double(offsets.size());
  EXPECT_LT(std::abs(mean), 0.005);
  EXPECT_LT(std::sqrt(square), 0.01);  // the detector's own share and 8 bits included
}

TEST(RenderPicture, GivesAPixelOnAnEdgeItsExactShare) {
  // A plate that fills half of the picture, its edge almost along a row: each row's mean tells where the edge
  // lies.
  SimulatedScene scene = PlainScene();
  SceneCamera& camera = scene.cameras[0];
  camera.camera.intrinsics = {LensModel::kPinhole, 512, 512, 255.5, 255.5, {}, 0, 0};
  ScenePicture& picture = scene.pictures[0];
  picture.cam_from_world.rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  picture.cam_from_world.translation = -(picture.cam_from_world.rotation * Vector3d(0, 0, 3000));
  for (const double shift_mm :
       {0.0, -0.6, -1.7, -2.9,
        -4.4}) {  // the camera stands over the plate  // 512 px at 2900 mm: 5.66 mm a pixel
    scene.parts = {MakePart("box", {8000, 3000, 100}, 0, 1500 + shift_mm, 0, 0)};
    const SceneMesh mesh = MakeMesh(scene);
    const PixelRays rays = *PixelRays::Make(camera.camera, 1);
    const Visibility visible = FindVisible(mesh, picture.cam_from_world, rays);
    std::vector<PixelShare> shares;
    double covered = 0;
    const int column = 100 + PixelRays::kMargin, columns = 40;
    for (int u = column; u < column + columns; ++u)
      for (int v = PixelRays::kMargin; v < 512 + PixelRays::kMargin; ++v) {
        SharesOf(visible, rays, u, v, shares);
        for (const PixelShare& s : shares)
          if (mesh.surfaces[std::size_t(mesh.planes[std::size_t(s.plane)].surface)].part == 0)
            covered += std::accumulate(s.share.begin(), s.share.end(), 0.0) / 4;
      }
    const double edge_v =
        255.5 - 512 * shift_mm / 2900;  // rows above it (v up to half a pixel past the last row's centre)
    EXPECT_NEAR(covered / columns, edge_v + 0.5, 0.006) << shift_mm;
  }
}

TEST(RenderPicture, TheNearerPartHidesTheOther) {
  SimulatedScene scene = PlainScene();
  const Vector3d g = *scene.pictures[0].gantry_mm;
  scene.parts = {MakePart("box", {300, 300, 100}, g.x(), g.y(), 0, 0),
                 MakePart("box", {1200, 1200, 20}, g.x(), g.y(), 600, 0)};
  const RenderedPicture both = Render(scene);
  scene.parts.pop_back();
  const RenderedPicture alone = Render(scene);
  EXPECT_GT(alone.seen_px[0], 1500);
  EXPECT_EQ(both.seen_px[0], 0);
  EXPECT_GT(both.seen_px[1], 40000);
}

TEST(RenderPicture, WithoutShadowsEveryFaceIsOfOneGrey) {
  SimulatedScene scene = PlainScene();
  const Vector3d g = *scene.pictures[0].gantry_mm;
  scene.parts = {MakePart("box", {700, 500, 300}, g.x(), g.y(), 0, 0.3)};
  // Grey values of pixels whose neighbours are like them to a level: those within faces.
  const auto greys = [&] {
    const RenderedPicture picture = Render(scene);
    std::set<int> found;
    const GreyView view = picture.image.view();
    for (int v = 1; v < view.height - 1; ++v)
      for (int u = 1; u < view.width - 1; ++u)
        if (std::abs(view.At(u + 1, v) - view.At(u - 1, v)) <= 1 &&
            std::abs(view.At(u, v + 1) - view.At(u, v - 1)) <= 1)
          found.insert(view.At(u, v));
    return found.size();
  };
  EXPECT_GT(greys(), 10U);  // the floor darkens towards the box
  scene.shadows = false;
  EXPECT_LE(greys(), 8U);  // floor, top, two sides, and what lies between by chance
}

TEST(Shadows, AHalfCoveredLampIsHalfDark) {
  SimulatedScene scene = PlainScene();
  scene.parts = {MakePart("box", {4000, 4000, 100}, 2000, 0, 0, 0)};  // from x = 0 on
  const SceneMesh mesh = MakeMesh(scene);
  Shadows shadows(mesh, {{{500, 0, 3000}, 200, 1, false, 0}});
  // The shadow of the edge at x = 0, 100 mm up, seen from the lamp: at x = -500 * 100 / 2900.
  const double edge = -500.0 * 100 / 2900;
  std::vector<int> bodies;
  shadows.Near(0, 0, {edge, 0, 0}, 10, bodies);
  ASSERT_EQ(bodies.size(), 1U);
  const auto covered = [&](double x) { return shadows.Covered(0, 0, {x, 0, 0}, 0.01, bodies); };
  EXPECT_NEAR(covered(edge), 0.5, 1e-3);
  const double half_penumbra = 200.0 * 100 / 2900;
  EXPECT_NEAR(covered(edge - 1.01 * half_penumbra), 0, 1e-6);
  EXPECT_NEAR(covered(edge + 1.01 * half_penumbra), 1, 1e-5);
  // A quarter of the way: the disc's segment beyond half its radius is (pi / 3 - sqrt(3) / 4) / pi.
  EXPECT_NEAR(covered(edge - 0.5 * half_penumbra), (kPi / 3 - std::sqrt(3) / 4) / kPi, 1e-3);
  shadows.Near(0, 0, {-2000, 0, 0}, 10, bodies);
  EXPECT_TRUE(bodies.empty());
}

TEST(Shadows, AHoleLetsTheLightThrough) {
  SimulatedScene scene = PlainScene();
  scene.parts = {MakePart("holed_plate", {800, 600, 20, 300, 0, 0}, 0, 0, 400, 0)};
  const SceneMesh mesh = MakeMesh(scene);
  Shadows shadows(mesh, {{{0, 0, 3000}, 50, 1, false, 0}});
  std::vector<int> bodies;
  const auto covered = [&](double x) {
    shadows.Near(0, 0, {x, 0, 0}, 10, bodies);
    return bodies.empty() ? 0 : shadows.Covered(0, 0, {x, 0, 0}, 1, bodies);
  };
  EXPECT_NEAR(covered(0), 0, 1e-6);
  EXPECT_NEAR(covered(300), 1, 1e-6);
  EXPECT_NEAR(covered(700), 0, 1e-6);
}

TEST(Simulate, TheSameSeedGivesTheSameBytesWithAnyNumberOfThreads) {
  RandomSceneOptions options;
  options.seed = 5;
  options.rig.stops = {1, 1};
  options.rig.size_px = 128;
  options.num_parts = 4;
  options.clutter = true;
  const auto bytes = [&](int threads) {
    const SimulatedScene scene = *DrawRandomScene(options, Knowledge());
    std::vector<std::vector<std::uint8_t>> pngs(scene.pictures.size());
    EXPECT_TRUE(RenderPictures(scene, threads, {}, [&](int i, const RenderedPicture& p) {
      pngs[std::size_t(i)] = EncodePng(p.image.view());
    }));
    return pngs;
  };
  const auto once = bytes(1);
  EXPECT_EQ(once, bytes(3));
  options.seed = 6;
  EXPECT_NE(once, bytes(1));
}

// Is `p` inside the solid? By the number of faces above it.
bool Inside(const WorldSolid& solid, const Vector3d& p) {
  int crossings = 0;
  for (const auto& face : solid.faces)
    for (const auto& t : face.triangles) {
      const auto side = [&](const Vector3d& a, const Vector3d& b) {
        return (b.x() - a.x()) * (p.y() - a.y()) - (b.y() - a.y()) * (p.x() - a.x());
      };
      const double a = side(t[0], t[1]), b = side(t[1], t[2]), c = side(t[2], t[0]);
      if (!((a > 0 && b > 0 && c > 0) || (a < 0 && b < 0 && c < 0))) continue;
      const double z = (a * t[2].z() + b * t[0].z() + c * t[1].z()) / (a + b + c);
      crossings += z > p.z();
    }
  return crossings % 2 == 1;
}

class RandomScene : public testing::TestWithParam<const char*> {};

TEST_P(RandomScene, HasPartsThatDoNotRunThroughEachOtherAndKeepTheKnowledgeBasesRules) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    RandomSceneOptions options;
    options.seed = seed;
    options.layout = *LayoutNamed(GetParam());
    const SimulatedScene scene = *DrawRandomScene(options, Knowledge());
    EXPECT_GE(scene.parts.size(), 4U) << seed;
    std::vector<WorldSolid> solids;
    for (const auto& part : scene.parts) {
      EXPECT_TRUE(part.object.model->Violations(part.object.dimensions_mm).empty()) << part.id;
      EXPECT_TRUE(part.object.model->MayStandOn(part.stands_on == "ground" ? "ground" : "box"));
      solids.push_back(PlaceSolid(part.object, false));
    }
    Random random(seed);
    for (std::size_t i = 0; i < solids.size(); ++i)
      for (int k = 0; k < 300; ++k) {
        // A point just below the surface of part i.
        const auto& faces = solids[i].faces;
        const auto& face = faces[std::size_t(random.Integer(0, int(faces.size()) - 1))];
        const auto& t = face.triangles[std::size_t(random.Integer(0, int(face.triangles.size()) - 1))];
        double a = random.Uniform(), b = random.Uniform();
        if (a + b > 1) a = 1 - a, b = 1 - b;
        const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
        const Vector3d p = t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]) - 0.2 * normal;
        for (std::size_t j = 0; j < solids.size(); ++j)
          ASSERT_FALSE(j != i && Inside(solids[j], p))
              << "seed " << seed << ": " << scene.parts[i].id << " in " << scene.parts[j].id;
      }
  }
}
INSTANTIATE_TEST_SUITE_P(Layouts, RandomScene, testing::Values("mixed", "panel", "stacked", "round"));

TEST(RandomScene, WithoutPartsThereIsStillClutter) {
  RandomSceneOptions options;
  options.layout = Layout::kBare;
  options.clutter = true;
  const SimulatedScene scene = *DrawRandomScene(options, Knowledge());
  EXPECT_TRUE(scene.parts.empty());
  EXPECT_FALSE(scene.lines.empty());
  EXPECT_FALSE(scene.stones.empty());
}

TEST(Simulate, TheFolderReadsBackAsTheSurveyItIs) {
  RandomSceneOptions options;
  options.rig.stops = {1, 1};
  options.rig.size_px = 64;
  const SimulatedScene scene = *DrawRandomScene(options, Knowledge());
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "vss_simulate_test";
  std::filesystem::remove_all(folder);
  {
    auto out = OutputFolder::Open(folder);
    ASSERT_TRUE(out);
    ASSERT_TRUE(AddSimulatedSurvey(scene, 1, {}, *out));
    ASSERT_TRUE(out->Commit());
  }
  const auto survey = ReadSurvey(folder);
  ASSERT_TRUE(survey) << survey.error().message;
  const Survey expected = SurveyOf(scene, folder);
  ASSERT_EQ(survey->images.size(), expected.images.size());
  for (std::size_t i = 0; i < expected.images.size(); ++i) {
    EXPECT_EQ(survey->images[i].file, expected.images[i].file);
    EXPECT_LT(
        (survey->images[i].cam_from_world.translation - expected.images[i].cam_from_world.translation).norm(),
        1e-9);
  }
  const auto truth = ReadTruth(folder / "truth.json");
  ASSERT_TRUE(truth) << truth.error().message;
  const auto parts = TruthOf(scene);
  ASSERT_EQ(truth->size(), parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_EQ((*truth)[i].kind, parts[i].kind);
    EXPECT_EQ((*truth)[i].vertices.size(), parts[i].vertices.size());
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace vss
