#include "vss/simulate/random_scene.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "vss/simulate/random.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Vector2d Turned(const Vector2d& v, double yaw) { return Eigen::Rotation2Dd(yaw) * v; }

// A rectangle on the floor or on a plate that something stands in.
struct Footprint {
  Vector2d center = Vector2d::Zero();
  double yaw = 0;
  Vector2d half = Vector2d::Zero();

  Vector2d Axis(int i) const { return Turned(Vector2d::Unit(i), yaw); }
  // Half the extent along a unit direction.
  double Reach(const Vector2d& d) const {
    return half.x() * std::abs(d.dot(Axis(0))) + half.y() * std::abs(d.dot(Axis(1)));
  }
};

// Separating axes (Gottschalk, Lin, Manocha 1996).
bool Apart(const Footprint& a, const Footprint& b, double gap_mm) {
  for (const Footprint* f : {&a, &b})
    for (int i = 0; i < 2; ++i) {
      const Vector2d d = f->Axis(i);
      if (std::abs(d.dot(a.center - b.center)) >= a.Reach(d) + b.Reach(d) + gap_mm) return true;
    }
  return false;
}

class SceneDrawer {
 public:
  SceneDrawer(const RandomSceneOptions& options, const KnowledgeBase& knowledge)
      : options_(options),
        knowledge_(knowledge),
        random_(options.seed),
        area_min_(Floor(options.rig.stops).min()),
        area_max_(Floor(options.rig.stops).max()) {}

  Result<SimulatedScene> Run() {
    for (const char* kind : {"box", "angle", "tee", "i_beam", "channel", "bracket", "holed_plate", "pipe"})
      if (!knowledge_.Find(kind) && (options_.kinds.empty() || Wanted(kind)))
        return InputError(
            "random scenes need the object \"{}\", which the knowledge base lacks; add it, or name the kinds "
            "to draw",
            kind);
    scene_.seed = options_.seed;
    layout_ = options_.layout.value_or(random_.Pick({Layout::kMixed, Layout::kMixed, Layout::kPanel,
                                                     Layout::kStacked, Layout::kStacked, Layout::kRound}));
    clutter_ = options_.clutter.value_or(random_.Chance(0.5));
    static constexpr const char* kNames[] = {"mixed", "panel", "stacked", "round", "bare"};
    scene_.name =
        fmt::format("random {}, {}{}", options_.seed, kNames[int(layout_)], clutter_ ? ", clutter" : "");
    const int drawn = random_.Integer(5, 15);
    wanted_ = layout_ == Layout::kBare ? 0 : options_.num_parts.value_or(drawn);
    AddRandomRig(options_.seed, options_.rig, scene_);
    DrawSurfaces();
    if (layout_ == Layout::kPanel) AddPanel();
    if (layout_ == Layout::kStacked) AddPlates();
    constexpr int kTries = 60;  // a part
    for (int k = 0; k < kTries * wanted_ && Count() < wanted_; ++k) AddSomething();
    if (clutter_) AddClutter();
    return std::move(scene_);
  }

 private:
  int Count() const { return static_cast<int>(scene_.parts.size()); }
  bool Wanted(const std::string& kind) const {
    return options_.kinds.empty() ||
           std::find(options_.kinds.begin(), options_.kinds.end(), kind) != options_.kinds.end();
  }
  double LogUniform(double from, double to) { return from * std::pow(to / from, random_.Uniform()); }

  // --- looks ---

  void DrawSurfaces() {
    const bool light_floor = random_.Chance(0.25);
    scene_.ground = {light_floor ? random_.Uniform(0.4, 0.55) : random_.Uniform(0.09, 0.18), 0,
                     random_.Uniform(0.03, 0.08),
                     clutter_ ? random_.Uniform(0.1, light_floor ? 0.2 : 0.4) : random_.Uniform(0, 0.1)};
    steel_albedo_ = light_floor ? random_.Uniform(0.15, 0.28) : random_.Uniform(0.3, 0.55);
    steel_grain_ = random_.Uniform(0.02, 0.08);
    steel_patches_ = clutter_ ? random_.Uniform(0.1, 0.4) : random_.Uniform(0, 0.1);
    steel_gloss_ = random_.Chance(0.5) ? 0 : random_.Uniform(0.01, 0.1);
  }
  Material Steel() {
    return {steel_albedo_ * random_.Uniform(0.8, 1.25), steel_gloss_,
            steel_grain_ * random_.Uniform(0.7, 1.4), steel_patches_};
  }

  // --- sizes ---

  // Thickness of plate as mills roll it (EN 10029), mm.
  double Thickness() {
    for (;;) {
      const double t =
          random_.Pick({6., 8., 10., 12., 15., 20., 20., 25., 25., 30., 30., 35., 40., 50., 60.});
      if (t >= options_.min_thickness_mm || options_.min_thickness_mm > 60)
        return std::max(t, options_.min_thickness_mm);
    }
  }
  double WallThickness() { return std::min(Thickness(), std::max(40., options_.min_thickness_mm)); }
  // Cut lengths are whole millimetres, give or take a saw.
  double Cut(double from, double to) { return std::round(LogUniform(from, to)) + random_.Uniform(-0.8, 0.8); }

  std::vector<double> Dimensions(const std::string& kind) {
    const double t = WallThickness();
    if (kind == "angle")
      return {Cut(400, 1700), Cut(std::max(120., 4 * t), 260), Cut(std::max(120., 4 * t), 300), t};
    if (kind == "tee")
      return {Cut(450, 1800), Cut(std::max(140., 5 * t), 300), Cut(180, 420), t, WallLike(t)};
    if (kind == "i_beam")
      return {Cut(450, 1800), Cut(std::max(140., 5 * t), 300), Cut(200, 500), t, WallLike(t)};
    if (kind == "channel")
      return {Cut(450, 1700), Cut(std::max(160., 5 * t), 360), Cut(std::max(90., 3.5 * t), 200), t,
              WallLike(t)};
    if (kind == "bracket") {
      const double length = Cut(220, 600), height = Cut(200, 600);
      return {length, height, t,
              std::clamp(random_.Uniform(0.12, 0.3) * std::min(length, height), 25., 150.)};
    }
    if (kind == "pipe") {
      const double diameter = Cut(180, 700);
      return {diameter, Cut(100, 450), std::min(std::max(10., random_.Uniform(0.035, 0.1) * diameter), 40.)};
    }
    if (kind == "holed_plate") {
      const double a = Cut(400, 1300), b = Cut(300, 900), length = std::max(a, b), width = std::min(a, b);
      const double hole = Cut(0.25 * width, 0.6 * width), room_x = length / 2 - hole / 2 - 40,
                   room_y = width / 2 - hole / 2 - 40;
      return {length,
              width,
              Thickness(),
              hole,
              random_.Uniform(-0.5, 0.5) * room_x,
              random_.Uniform(-0.5, 0.5) * room_y};
    }
    switch (random_.Integer(0, 2)) {  // box
      case 0:
        return Longer(Cut(350, 1700), Cut(200, 700), Thickness());  // a plate
      case 1:
        return {Cut(450, 1700), t, Cut(150, 650)};  // a plate or flat bar on edge
      default:
        return Longer(Cut(250, 800), Cut(180, 600), Cut(120, 650));  // a block
    }
  }
  // Of a web or flange beside another of thickness t.
  double WallLike(double t) {
    return std::clamp(t + random_.Pick({-10., -5., 0., 0., 5., 10.}), options_.min_thickness_mm, 60.);
  }
  static std::vector<double> Longer(double a, double b, double height) {
    return {std::max(a, b), std::min(a, b), height};
  }

  // --- places ---

  // What stands where, by the support's number: -1 the ground, else an index into the scene's parts.
  struct Standing {
    Footprint footprint;
    int support = -1;
    double height_mm = 0;  // of its own
  };

  static Footprint FootprintOf(const PlacedObject& object) {
    PlacedObject at_origin = object;
    at_origin.placement.setZero();
    const WorldSolid solid = PlaceSolid(at_origin, false);
    Eigen::AlignedBox2d box;
    for (const auto& f : solid.faces)
      for (const auto& t : f.triangles)
        for (const auto& p : t) box.extend(Vector2d(p.head<2>()));
    return {object.placement.head<2>() + Turned(box.center(), object.placement[3]), object.placement[3],
            box.sizes() / 2};
  }
  static double HeightOf(const PlacedObject& object) { return vss::TopOf(object) - object.placement[2]; }

  bool Within(const Footprint& inner, const Footprint& outer, double margin_mm) const {
    for (int i = 0; i < 2; ++i) {
      const Vector2d d = outer.Axis(i);
      if (std::abs(d.dot(inner.center - outer.center)) + inner.Reach(d) + margin_mm > outer.half[i])
        return false;
    }
    return true;
  }
  bool InArea(const Footprint& f) const {
    for (int i = 0; i < 2; ++i) {
      const double reach = f.Reach(Vector2d::Unit(i));
      if (f.center[i] - reach < area_min_[i] || f.center[i] + reach > area_max_[i]) return false;
    }
    return true;
  }
  // Beside what stands on the same support: tall neighbours keep some distance, or nothing between them would
  // be seen.
  bool Free(const Footprint& f, double height_mm, int support) const {
    return std::all_of(standing_.begin(), standing_.end(), [&](const Standing& s) {
      constexpr double kLeastGapMm = 40, kGapByHeight = 0.15;
      if (s.support != support) return true;
      return Apart(f, s.footprint, kLeastGapMm + kGapByHeight * std::min(height_mm, s.height_mm));
    });
  }

  void Place(PlacedObject object, int support, const Footprint& footprint) {
    ScenePart part;
    part.id = fmt::format("p{}", Count() + 1);
    part.stands_on = support < 0 ? "ground" : scene_.parts[std::size_t(support)].id;
    part.material = Steel();
    const double height = HeightOf(object);
    part.object = std::move(object);
    scene_.parts.push_back(std::move(part));
    standing_.push_back({footprint, support, height});
  }

  double TopOf(int support) const {
    return support < 0 ? 0 : vss::TopOf(scene_.parts[std::size_t(support)].object);
  }

  PlacedObject Object(const std::string& kind, std::vector<double> dimensions_mm) const {
    PlacedObject object;
    object.model = knowledge_.Find(kind);
    object.dimensions_mm = std::move(dimensions_mm);
    return object;
  }

  // The dimensions keep the knowledge base's own rules.
  static bool Possible(const PlacedObject& object) {
    return object.model->Violations(object.dimensions_mm).empty();
  }

  std::string Kind() {
    static constexpr const char* kMixed[] = {"box",   "box",     "box",     "tee",         "i_beam",
                                             "angle", "channel", "bracket", "holed_plate", "pipe"};
    static constexpr const char* kRoundKinds[] = {"box",  "holed_plate", "holed_plate", "pipe",
                                                  "pipe", "tee",         "bracket"};
    constexpr int kTries = 100;
    for (int k = 0; k < kTries; ++k) {
      const std::string kind =
          layout_ == Layout::kRound ? kRoundKinds[random_.Integer(0, 6)] : kMixed[random_.Integer(0, 9)];
      if (Wanted(kind)) return kind;
    }
    return options_.kinds.front();
  }

  // A plate that lies flat, of some size, is something to stand on.
  bool Bears(int part) const {
    constexpr double kLeastWidthMm = 350, kMostHeightMm = 100;
    const PlacedObject& o = scene_.parts[std::size_t(part)].object;
    return o.model->kind() == "box" && o.dimensions_mm[1] >= kLeastWidthMm &&
           o.dimensions_mm[2] <= kMostHeightMm;
  }

  void AddSomething() {
    std::vector<int> supports;
    for (int i = 0; i < Count(); ++i)
      if (Bears(i) && scene_.parts[std::size_t(i)].stands_on == "ground") supports.push_back(i);
    const double share = layout_ == Layout::kStacked ? 0.7 : layout_ == Layout::kPanel ? 0.0 : 0.25;
    const int support = !supports.empty() && random_.Chance(share)
                            ? supports[std::size_t(random_.Integer(0, int(supports.size()) - 1))]
                            : -1;
    PlacedObject object = Object(Kind(), {});
    object.dimensions_mm = Dimensions(object.model->kind());
    if (!Possible(object)) return;
    object.placement[2] = TopOf(support);
    if (support < 0) {
      object.placement[0] = random_.Uniform(area_min_.x(), area_max_.x());
      object.placement[1] = random_.Uniform(area_min_.y(), area_max_.y());
      object.placement[3] = random_.Uniform(-kPi / 2, kPi / 2);
    } else {
      const Footprint& plate = standing_[std::size_t(support)].footprint;
      const Vector2d at(random_.Uniform(-1, 1) * plate.half.x(), random_.Uniform(-1, 1) * plate.half.y());
      object.placement.head<2>() = plate.center + Turned(at, plate.yaw);
      // On a workpiece most things run along or across it.
      object.placement[3] = random_.Chance(0.6)
                                ? plate.yaw + random_.Pick({0., kPi / 2}) + 0.01 * random_.Normal()
                                : random_.Uniform(-kPi / 2, kPi / 2);
    }
    const Footprint f = FootprintOf(object);
    if (!InArea(f) || !Free(f, HeightOf(object), support)) return;
    constexpr double kMarginMm = 30;
    if (support >= 0 && !Within(f, standing_[std::size_t(support)].footprint, kMarginMm)) return;
    Place(std::move(object), support, f);
  }

  void AddPlates() {
    const int n = random_.Integer(1, std::max(1, wanted_ / 4));
    for (int k = 0; k < n * 20 && Count() < n; ++k) {
      PlacedObject plate = Object("box", Longer(Cut(900, 2200), Cut(700, 1500), Thickness()));
      plate.placement[0] = random_.Uniform(area_min_.x(), area_max_.x());
      plate.placement[1] = random_.Uniform(area_min_.y(), area_max_.y());
      plate.placement[3] = random_.Uniform(-kPi / 2, kPi / 2);
      const Footprint f = FootprintOf(plate);
      if (InArea(f) && Free(f, 0, -1)) Place(std::move(plate), -1, f);
    }
  }

  // One base plate, stiffeners along it, brackets that hold them up.
  void AddPanel() {
    const Vector2d room = area_max_ - area_min_;
    PlacedObject base =
        Object("box", {Cut(std::min(2600., 0.5 * room.x()), 0.9 * room.x()),
                       Cut(1300, std::min(2700., 0.8 * room.y())), std::min(Thickness(), 40.)});
    if (base.dimensions_mm[0] < base.dimensions_mm[1])
      std::swap(base.dimensions_mm[0], base.dimensions_mm[1]);
    base.placement[3] = RadFromDeg(random_.Uniform(-4, 4));
    const Vector2d middle = (area_min_ + area_max_) / 2;
    base.placement[0] = middle.x() + random_.Uniform(-200, 200);
    base.placement[1] = middle.y() + random_.Uniform(-100, 100);
    const double length = base.dimensions_mm[0], width = base.dimensions_mm[1], yaw = base.placement[3],
                 top = base.dimensions_mm[2];
    const Vector2d center = base.placement.head<2>();
    Place(base, -1, FootprintOf(base));
    // In the base plate's own coordinates from here on.
    const auto on_base = [&](PlacedObject object, double x, double y, double turn) {
      object.placement.head<2>() = center + Turned({x, y}, yaw);
      object.placement[2] = top;
      object.placement[3] = yaw + turn;
      return object;
    };
    const int most = std::max(1, static_cast<int>((width - 200) / 450));
    const int n = std::clamp(random_.Integer(2, 4), 1, std::min(most, std::max(1, wanted_ - 1)));
    const double height = Cut(220, 420), spacing = width / n;
    for (int i = 0; i < n && Count() < wanted_; ++i) {
      const std::string kind = random_.Pick({"tee", "tee", "angle", "box"});
      const double t = WallThickness(), u = WallLike(t), l = Cut(0.75 * length, 0.96 * length);
      const double y = -width / 2 + (i + 0.5) * spacing + random_.Uniform(-0.08, 0.08) * spacing;
      const double x = random_.Uniform(-0.5, 0.5) * (length - l - 60);
      PlacedObject stiffener =
          kind == "tee"     ? Object(kind, {l, Cut(std::max(140., 5 * t), 240), height, t, u})
          : kind == "angle" ? Object(kind, {l, Cut(std::max(120., 4 * t), 180), height, t})
                            : Object(kind, {l, t, height});
      if (!Wanted(kind) || !Possible(stiffener)) continue;
      // Faces of the web that a bracket may lean on, and how high it may reach there.
      struct Web {
        double y, side, most_height;
      };
      const double half = stiffener.dimensions_mm[1] / 2;
      const std::vector<Web> webs =
          kind == "tee" ? std::vector<Web>{{y + t / 2, 1, height - u - 15}, {y - t / 2, -1, height - u - 15}}
          : kind == "angle" ? std::vector<Web>{{y - half, -1, height - 20}}
                            : std::vector<Web>{{y + t / 2, 1, height - 20}, {y - t / 2, -1, height - 20}};
      stiffener = on_base(std::move(stiffener), x, y, 0);
      const Footprint f = FootprintOf(stiffener);
      if (!Free(f, 0, 0)) continue;
      const std::size_t own = standing_.size();
      Place(std::move(stiffener), 0, f);
      const double room_y = spacing / 2 - 160;
      if (room_y < 180 || !Wanted("bracket")) continue;
      const Web& web = webs[std::size_t(random_.Integer(0, int(webs.size()) - 1))];
      const int brackets = random_.Integer(0, 2);
      for (int k = 0; k < brackets && Count() < wanted_; ++k) {
        constexpr double kGapMm = 1;  // tacked, not pressed on
        const double bl = Cut(180, std::min(450., std::max(181., room_y + 100))),
                     bh = std::min(Cut(180, 400), web.most_height);
        PlacedObject bracket =
            Object("bracket", {bl, bh, WallThickness(), std::clamp(0.22 * std::min(bl, bh), 25., 100.)});
        if (!Possible(bracket)) continue;
        const double bx = x + (k + random_.Uniform(0.2, 0.8) - brackets / 2.0) * 0.8 * l / brackets;
        bracket = on_base(std::move(bracket), bx, web.y + web.side * (bl / 2 + kGapMm), web.side * kPi / 2);
        const Footprint place = FootprintOf(bracket);
        // Clear of everything but its own stiffener.
        const bool clear = std::all_of(standing_.begin() + 1, standing_.end(), [&](const Standing& s) {
          return s.support < 0 || &s == &standing_[own] || Apart(place, s.footprint, 30);
        });
        if (clear && Within(place, standing_[0].footprint, 20)) Place(std::move(bracket), 0, place);
      }
    }
  }
  // --- clutter ---

  Vector2d Somewhere() {
    return {random_.Uniform(area_min_.x() - 400, area_max_.x() + 400),
            random_.Uniform(area_min_.y() - 400, area_max_.y() + 400)};
  }
  bool OnOpenFloor(const Vector2d& p, double radius_mm) const {
    return std::all_of(standing_.begin(), standing_.end(), [&](const Standing& s) {
      return s.support >= 0 || Apart({p, 0, {radius_mm, radius_mm}}, s.footprint, 5);
    });
  }

  void AddClutter() {
    const double lengthwise = random_.Uniform(-0.5, 0.5);
    for (int k = random_.Integer(1, 5); k > 0; --k) {
      const double yaw = lengthwise + random_.Pick({0., kPi / 2});
      const Vector2d middle = Somewhere(), reach = Turned({random_.Uniform(300, 2200), 0}, yaw);
      const bool white = scene_.ground.albedo < 0.3;
      scene_.lines.push_back({middle - reach, middle + reach, random_.Pick({50., 75., 100.}),
                              white ? random_.Uniform(0.3, 0.6) : random_.Uniform(0.1, 0.7)});
    }
    for (int k = random_.Integer(1, 4); k > 0; --k) AddCable();
    for (int k = random_.Integer(5, 30); k > 0; --k) {
      const Vector2d p = Somewhere();
      const double size = random_.Uniform(20, 70);
      if (OnOpenFloor(p, size))
        scene_.stones.push_back({p, size, scene_.ground.albedo * random_.Uniform(0.8, 2)});
    }
    for (int k = random_.Integer(0, 3); k > 0; --k) AddOffcut();
  }

  // Runs about the floor; ends before what it would run through.
  void AddCable() {
    Cable cable;
    cable.diameter_mm = random_.Uniform(10, 25);
    cable.albedo = random_.Uniform(0.03, 0.08);
    Vector2d p = Somewhere();
    double heading = random_.Uniform(0, 2 * kPi);
    const int n = random_.Integer(4, 10);
    constexpr double kStepMm = 220;
    for (int i = 0; i < n && OnOpenFloor(p, 60); ++i) {
      cable.points.push_back(p);
      heading += 0.6 * random_.Normal();
      const Vector2d next = p + Turned({kStepMm, 0}, heading);
      if (!OnOpenFloor((p + next) / 2, 60)) break;
      p = next;
    }
    if (cable.points.size() >= 3) scene_.cables.push_back(std::move(cable));
  }

  // A remnant of the saw: three or four sides, no two of them parallel.
  void AddOffcut() {
    Offcut offcut;
    const Vector2d p = Somewhere();
    const double size = random_.Uniform(60, 160), turn = random_.Uniform(0, 2 * kPi);
    if (!OnOpenFloor(p, size)) return;
    const int n = random_.Integer(3, 4);
    for (int i = 0; i < n; ++i)
      offcut.outline.push_back(p + Turned({size * random_.Uniform(0.5, 1), 0},
                                          turn + 2 * kPi * (i + random_.Uniform(-0.15, 0.15)) / n));
    offcut.height_mm = random_.Pick({10., 15., 20.});
    offcut.material = Steel();
    scene_.offcuts.push_back(std::move(offcut));
  }

  const RandomSceneOptions& options_;
  const KnowledgeBase& knowledge_;
  Random random_;
  SimulatedScene scene_;
  Layout layout_ = Layout::kMixed;
  bool clutter_ = false;
  int wanted_ = 0;
  double steel_albedo_ = 0.4, steel_grain_ = 0.05, steel_patches_ = 0, steel_gloss_ = 0;
  Vector2d area_min_, area_max_;  // where parts may lie
  std::vector<Standing> standing_;
};

}  // namespace

Result<Layout> LayoutNamed(const std::string& name) {
  if (name == "mixed") return Layout::kMixed;
  if (name == "panel") return Layout::kPanel;
  if (name == "stacked") return Layout::kStacked;
  if (name == "round") return Layout::kRound;
  if (name == "bare") return Layout::kBare;
  return UsageError("there is no layout \"{}\"; take mixed, panel, stacked, round or bare", name);
}

Result<SimulatedScene> DrawRandomScene(const RandomSceneOptions& options, const KnowledgeBase& knowledge) {
  return SceneDrawer(options, knowledge).Run();
}

double TopOf(const PlacedObject& object) {
  double top = -std::numeric_limits<double>::infinity();
  const WorldSolid solid = PlaceSolid(object, false);
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles)
      for (const auto& p : t) top = std::max(top, p.z());
  return top;
}

}  // namespace vss
