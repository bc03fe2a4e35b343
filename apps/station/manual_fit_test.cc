#include "manual_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "collect_picks.h"
#include "part_of_fit.h"
#include "snap.h"
#include "workspace.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Two cameras three metres above the floor, tilted inwards.
struct Rig {
  Camera camera;
  std::vector<View> views;

  Rig() {
    camera.width_px = camera.height_px = 512;
    camera.intrinsics.fx_px = camera.intrinsics.fy_px = 520;
    camera.intrinsics.cx_px = camera.intrinsics.cy_px = 255.5;
    for (const Vector3d& eye : {Vector3d(-1200, -900, 3000), Vector3d(1300, 700, 3100)}) {
      Eigen::Matrix3d r;
      r.row(2) = -eye.normalized().transpose();
      r.row(0) = r.row(2).transpose().cross(Vector3d::UnitZ()).normalized().transpose();
      r.row(1) = r.row(2).transpose().cross(Vector3d(r.row(0).transpose())).transpose();
      views.push_back(MakeView(int(views.size()), camera, {r, -(r * eye)}, -1, nullptr));
    }
  }
};

PlacedObject TrueBox(const KnowledgeBase& knowledge) {
  PlacedObject box;
  box.model = knowledge.Find("box");
  box.placement << 80, -40, 0, 0.6, 0, 0;
  box.dimensions_mm = {900, 400, 250};
  return box;
}

// The visible edges of the box in every picture, as lines with noise.
std::vector<Pick> LinesOf(const PlacedObject& object, const std::vector<View>& views, double sigma_px,
                          std::mt19937& random) {
  std::normal_distribution<double> noise(0, sigma_px);
  const WorldSolid solid = PlaceSolid(object, false);
  std::vector<Pick> picks;
  for (const auto& view : views) {
    std::map<int, std::vector<Vector2d>> seen;
    for (const auto& s : SampleContour(solid, view, 4, 4))
      if (s.visible && s.source == ContourSample::Source::kEdge) seen[s.index].push_back(s.ideal);
    for (const auto& [edge, points] : seen) {
      if (points.size() < 4) continue;
      Pick p;
      p.image = view.image;
      p.line = int(picks.size());
      p.contour = edge;
      p.ideal_start = points.front() + Vector2d(noise(random), noise(random));
      p.ideal_end = points.back() + Vector2d(noise(random), noise(random));
      p.sigma_offset_px = 0.05;
      p.sigma_angle_rad = 0.001;
      picks.push_back(p);
    }
  }
  return picks;
}

class ManualFit : public testing::Test {
 protected:
  void SetUp() override {
    const std::vector<std::string> names = {"box"};
    knowledge = LoadKnowledge(names, ".").value();
    truth = TrueBox(knowledge);
    question.model = truth.model;
  }
  Rig rig;
  KnowledgeBase knowledge;
  PlacedObject truth;
  FitQuestion question;
  std::mt19937 random{3};
};

TEST_F(ManualFit, FindsABoxFromNothing) {
  question.picks = LinesOf(truth, rig.views, 0.05, random);
  const auto answer = FitPicks(question, rig.views);
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_TRUE(answer->placed);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(answer->object.dimensions_mm[std::size_t(i)], truth.dimensions_mm[std::size_t(i)], 2);
    EXPECT_TRUE(answer->observable[std::size_t(i)]);
    EXPECT_LT(std::abs(answer->object.dimensions_mm[std::size_t(i)] - truth.dimensions_mm[std::size_t(i)]),
              5 * answer->sigma_mm[std::size_t(i)]);
  }
  EXPECT_NEAR(std::remainder(answer->object.placement[3] - truth.placement[3], 2 * kPi), 0, 0.01);
  EXPECT_LT(answer->rms_px, 0.5);
}

TEST_F(ManualFit, SaysWhatOneEdgeDoesNotDetermineAndWhichWould) {
  auto all = LinesOf(truth, rig.views, 0.05, random);
  question.picks = {all.front()};
  const auto one = FitPicks(question, rig.views);
  ASSERT_TRUE(one);
  EXPECT_FALSE(one->placed);
  // All lines on the floor, of every picture: they tell place, length and width.
  const WorldSolid solid = PlaceSolid(truth, false);
  question.picks.clear();
  for (const auto& p : all) {
    const auto& e = solid.edges[std::size_t(p.contour)];
    if (std::min(solid.vertices[std::size_t(e.start)].point.z(),
                 solid.vertices[std::size_t(e.end)].point.z()) < 1 &&
        std::max(solid.vertices[std::size_t(e.start)].point.z(),
                 solid.vertices[std::size_t(e.end)].point.z()) < 1)
      question.picks.push_back(p);
  }
  ASSERT_GE(question.picks.size(), 2u);
  const auto floor = FitPicks(question, rig.views);
  ASSERT_TRUE(floor);
  EXPECT_FALSE(floor->observable[2]) << "edges on the floor say nothing of the height";
  bool hinted = false;
  for (const auto& h : floor->hints) hinted = hinted || h.dimension == "height";
  EXPECT_TRUE(hinted);
}

TEST_F(ManualFit, KeepsADimensionThatTheOperatorGave) {
  question.picks = LinesOf(truth, rig.views, 0.05, random);
  question.fixed_mm["height"] = 240;
  const auto answer = FitPicks(question, rig.views);
  ASSERT_TRUE(answer);
  EXPECT_DOUBLE_EQ(answer->object.dimensions_mm[2], 240);
}

TEST_F(ManualFit, RefusesAContourThatTheObjectDoesNotHave) {
  question.picks = LinesOf(truth, rig.views, 0.05, random);
  question.picks[0].contour = 99;
  EXPECT_FALSE(FitPicks(question, rig.views));
  question.picks.clear();
  EXPECT_FALSE(FitPicks(question, rig.views));
}

TEST_F(ManualFit, CollectsTheLinesThatLieOnTheContourAndNoOthers) {
  const auto all = LinesOf(truth, rig.views, 0.05, random);
  Pick stray = all.front();
  stray.line = 999;
  stray.ideal_start += Vector2d(15, 15);
  stray.ideal_end += Vector2d(15, 15);
  auto lines_of = [&](int image) {
    std::vector<Pick> lines;
    for (const auto& p : all)
      if (p.image == image) lines.push_back(p);
    if (image == stray.image) lines.push_back(stray);
    return lines;
  };
  const auto found = CollectPicks(
      truth, rig.views, nullptr, 2, [](const Pick&) { return false; }, lines_of);
  EXPECT_GE(found.size(), all.size() * 8 / 10);
  for (const auto& p : found) {
    EXPECT_NE(p.line, 999);
    EXPECT_EQ(p.contour, all[std::size_t(p.line)].contour);
  }
}

TEST_F(ManualFit, ComesBackFromAPartToTheObjectItWas) {
  question.picks = LinesOf(truth, rig.views, 0.05, random);
  const auto answer = FitPicks(question, rig.views);
  ASSERT_TRUE(answer);
  const Part part = PartOfFit(*answer, question);
  const PlacedObject again = PlacedObjectOf(part, knowledge);
  EXPECT_LT((again.State() - answer->object.State()).norm(), 1e-6);
  const auto files = std::vector<std::string>{"a.png", "b.png"};
  StationPart kept{part, true, "why"};
  kept.part.id = "part-1";
  kept.part.contour_residuals = {{"edge", 3, 0, "contact", 1, 0.012345678901, 0.2, 41, false, true},
                                 {"limb", 0, 1, "limb", 0, -0.1, 0.3, 9, true}};
  kept.part.straightness = {{2, 0.31, 0.07, 5}};
  kept.part.observable = {true, true, false, true, false, false, true, true, true};
  kept.part.singular_values = Eigen::Vector3d(30, 2, 0.1);
  const auto read = PartFromJson(Json::parse(PartToJson(kept, files).dump()), files);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->confirmed);
  EXPECT_EQ(read->part.matches.size(), part.matches.size());
  EXPECT_LT((read->part.covariance - part.covariance).norm(), 1e-9 * part.covariance.norm());
  Product before, after;
  before.parts = {kept.part};
  after.parts = {read->part};
  EXPECT_EQ(ProductToJson(after, files), ProductToJson(before, files))
      << "a product made of it says the same, residuals of contours and bent edges too";
}

// JSON has no infinity: what could not be said is null, and the part is there all the same.
TEST_F(ManualFit, KeepsAPartWithAResidualThatIsNoNumber) {
  question.picks = LinesOf(truth, rig.views, 0.05, random);
  const auto answer = FitPicks(question, rig.views);
  ASSERT_TRUE(answer);
  StationPart kept{PartOfFit(*answer, question), false, ""};
  kept.part.id = "part-1";
  kept.part.matches[0].residual_px = INFINITY;
  const auto files = std::vector<std::string>{"a.png", "b.png"};
  const auto read = PartFromJson(Json::parse(PartToJson(kept, files).dump()), files);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_FALSE(std::isfinite(read->part.matches[0].residual_px));
}

// A hole's diameter and place stand in its rim only.
TEST_F(ManualFit, SaysWhichRimWouldShowAHole) {
  const std::vector<std::string> names = {"holed_plate"};
  const KnowledgeBase plates = LoadKnowledge(names, ".").value();
  PlacedObject plate;
  plate.model = plates.Find("holed_plate");
  plate.placement << 80, -40, 0, 0.6, 0, 0;
  plate.dimensions_mm = {900, 500, 30, 200, 0, 60};
  question = {};
  question.model = plate.model;
  question.picks = LinesOf(plate, rig.views, 0.05, random);
  const auto edges = FitPicks(question, rig.views);
  ASSERT_TRUE(edges) << edges.error().message;
  const auto hint = std::find_if(edges->hints.begin(), edges->hints.end(),
                                 [](const Hint& h) { return h.dimension == "hole_diameter"; });
  ASSERT_NE(hint, edges->hints.end());
  EXPECT_TRUE(hint->is_circle);
  Pick rim;
  rim.image = hint->image;
  rim.contour = hint->contour;
  rim.is_circle = true;
  rim.sigma_offset_px = 0.05;
  for (const auto& s : SampleContour(PlaceSolid(plate, false), rig.views[std::size_t(hint->image)], 4, 4))
    if (s.visible && s.source == ContourSample::Source::kCircle && s.index == hint->contour)
      rim.ideal_points.push_back(s.ideal);
  question.picks.push_back(rim);
  question.start = edges->object;
  const auto all = FitPicks(question, rig.views);
  ASSERT_TRUE(all);
  const auto defs = plate.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    EXPECT_TRUE(all->observable[i]) << defs[i].name << " is not observable";
    EXPECT_NEAR(all->object.dimensions_mm[i], plate.dimensions_mm[i], 4 * all->sigma_mm[i]) << defs[i].name;
  }
  EXPECT_TRUE(all->hints.empty());
}

// A step edge, blurred, along a line through (u0, v0) with direction `angle`; bright on the left.
GreyImage StepImage(double offset, double angle) {
  GreyImage image(120, 100, 8);
  for (int v = 0; v < 100; ++v)
    for (int u = 0; u < 120; ++u) {
      const double d = -std::sin(angle) * (u - 60) + std::cos(angle) * (v - 50) - offset;
      image.Row8(v)[u] =
          static_cast<std::uint8_t>(std::lround(60 + 60 * (1 - std::erf(d / (0.7 * std::sqrt(2.0))))));
    }
  return image;
}

TEST(Snap, MovesADrawnLineOntoTheEdge) {
  Intrinsics lens;
  lens.fx_px = lens.fy_px = 100;
  lens.cx_px = 60, lens.cy_px = 50;
  for (double offset : {-2.3, 0.4, 3.1}) {
    const double angle = 0.3;
    const GreyImage image = StepImage(offset, angle);
    LineSegment drawn;
    drawn.start = {25, 40};
    drawn.end = {95, 40 + 70 * std::tan(angle)};
    const LineSegment snapped = SnapToEdge(image.view(), lens, drawn);
    ASSERT_GT(snapped.contrast, 20);
    const Vector2d n(-std::sin(angle), std::cos(angle));
    for (const auto& p : {snapped.start, snapped.end}) EXPECT_NEAR(n.dot(p - Vector2d(60, 50)), offset, 0.1);
    const Vector2d along = snapped.end - snapped.start, left(along.y(), -along.x());  // as seen on the screen
    EXPECT_GT(left.dot(-n), 0) << "the bright side lies to the left";
  }
}

TEST(Snap, LeavesALineWhereThereIsNoEdge) {
  GreyImage flat(100, 100, 8);
  for (int v = 0; v < 100; ++v) std::fill(flat.Row8(v), flat.Row8(v) + 100, std::uint8_t(90));
  Intrinsics lens;
  lens.fx_px = lens.fy_px = 100;
  LineSegment drawn;
  drawn.start = {20, 20};
  drawn.end = {80, 50};
  const LineSegment same = SnapToEdge(flat.view(), lens, drawn);
  EXPECT_EQ(same.contrast, 0);
  EXPECT_EQ(same.start, drawn.start);
}

// A disc on a dark floor, as the rig's first camera sees it: bright inside the rim of `radius` around (x, y)
// at height z.
GreyImage DiscImage(const View& view, const Vector3d& center, double radius) {
  constexpr int kFine = 4;  // samples a pixel each way
  GreyImage image(512, 512, 8);
  for (int v = 0; v < 512; ++v)
    for (int u = 0; u < 512; ++u) {
      int inside = 0;
      for (int i = 0; i < kFine * kFine; ++i) {
        const Vector2d img(u - 0.5 + (i % kFine + 0.5) / kFine, v - 0.5 + (i / kFine + 0.5) / kFine);
        const Vector3d ray = view.RayOfIdeal(img),
                       p = view.center_in_world + (center.z() - view.center_in_world.z()) / ray.z() * ray;
        inside += (p - center).norm() < radius;
      }
      image.Row8(v)[u] = std::uint8_t(40 + 160 * inside / (kFine * kFine));
    }
  return image;
}

TEST(Snap, MovesACurveOntoItsRimAndFollowsItAllRound) {
  const Rig rig;
  const View& view = rig.views[0];
  const Vector3d center(150, 60, 200);
  const GreyImage image = DiscImage(view, center, 260);
  std::array<Vector2d, 3> clicked;
  const double turns[] = {0.2, 1.1, 2.3};  // not half of it
  for (std::size_t i = 0; i < 3; ++i)
    clicked[i] = *view.ProjectInside(center + 260 * Vector3d(std::cos(turns[i]), std::sin(turns[i]), 0)) +
                 Vector2d(i == 1 ? 1.5 : -1, 1);
  const auto arc = SnapToRim(image.view(), view, clicked);
  ASSERT_TRUE(arc) << arc.error().message;
  EXPECT_GT(arc->contrast, 60);
  EXPECT_TRUE(arc->bright_inside);
  EXPECT_NEAR(arc->to_rad - arc->from_rad, 2 * kPi, 0.1) << "the whole rim is seen";
  const Eigen::Rotation2Dd turn(arc->angle_rad);
  for (int k = 0; k < 12; ++k) {
    const double t = k * kPi / 6;
    const Vector2d p =
        arc->center + turn * Vector2d(arc->axes.x() * std::cos(t), arc->axes.y() * std::sin(t));
    const Vector3d ray = view.RayOfIdeal(p),
                   on_disc = view.center_in_world + (center.z() - view.center_in_world.z()) / ray.z() * ray;
    EXPECT_NEAR((on_disc - center).norm(), 260, 1) << "a pixel is some 6 mm";
  }
}

TEST(Snap, LeavesACurveWhereThereIsNoEdgeAndRefusesAStraightOne) {
  const Rig rig;
  GreyImage flat(512, 512, 8);
  for (int v = 0; v < 512; ++v) std::fill(flat.Row8(v), flat.Row8(v) + 512, std::uint8_t(90));
  const auto arc =
      SnapToRim(flat.view(), rig.views[0], {Vector2d(200, 200), Vector2d(260, 180), Vector2d(300, 230)});
  ASSERT_TRUE(arc) << arc.error().message;
  EXPECT_EQ(arc->contrast, 0);
  EXPECT_LT(arc->to_rad - arc->from_rad, 6) << "from the first click to the last, not all round";
  const auto straight =
      SnapToRim(flat.view(), rig.views[0], {Vector2d(100, 100), Vector2d(200, 151), Vector2d(300, 200)});
  ASSERT_FALSE(straight);
  EXPECT_NE(straight.error().message.find("straight line"), std::string::npos);
}

}  // namespace
}  // namespace vss::station
