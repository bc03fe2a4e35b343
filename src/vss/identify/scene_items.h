// The objects that may stand in a scene, each with what it stands on, and how they get along with each other.
#pragma once
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "vss/identify/hypothesis.h"
#include "vss/identify/overlap.h"

namespace vss {

// One object that may stand in the scene.
struct SceneItem {
  Hypothesis h;
  Volume volume;
  std::vector<WorldSolid::Circle> circles;
  bool has_edges = false;
  std::string kind;
  int support_item = -1;  // index into the items; -1: ground
  double top_mm = 0;
  int serial = 0;        // no two hypotheses kept have the same, though one take the other's place
  int candidate = -1;    // of the ledger
  double alone = NAN;    // log-odds before the choice; 0: it stands nowhere
  double by_world = 0;   // log-odds of what edges of the world say of it, see SceneChoice
  bool refuted = false;  // see SceneChoice::DropRefuted()
  bool endless = false;  // it lies where something without ends does
  std::optional<std::vector<LineRef>> claimed;  // lines on its visible contour, once somebody asked

  WorldSolid Solid() const { return PlaceSolid(h.object, false); }
};

// Do two boxes fill nearly the same frame?
bool SameFrame(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b);
// What stands on an item ends over it, to within what its edges and the item's may be off together.
constexpr double kOverhangPx = 3;
// Of a box, in plan.
Eigen::AlignedBox2d Footprint(const Eigen::AlignedBox3d& box, double overhang_mm = 0);
// From where to where the item reaches along a direction, mm.
std::pair<double, double> Extent(const SceneItem& item, const Eigen::Vector3d& direction);

class SceneItems {
 public:
  static constexpr int kGround = -1;

  // `mm_per_px`: typical size of a pixel in the scene.
  explicit SceneItems(double mm_per_px) : mm_per_px_(mm_per_px) {}

  int size() const { return int(items_.size()); }
  SceneItem& operator[](int i) { return items_[std::size_t(i)]; }
  const SceneItem& operator[](int i) const { return items_[std::size_t(i)]; }
  auto begin() { return items_.begin(); }
  auto end() { return items_.end(); }

  // Adds a hypothesis, unless it does not rest on `support` (an item, or the ground) or is known already and
  // no better now.
  void Keep(Hypothesis h, int support);
  // Has Keep() added or bettered anything since this was last called?
  bool TakeChanged() { return std::exchange(changed_, false); }

  // Can the two not stand in one scene? (Cached, as is Flush().)
  bool Conflicts(int a, int b);
  // Do two lie against each other, parallel and both ends flush?
  bool Flush(int a, int b);
  // Is there no better item of its kind in nearly the same frame?
  bool BestOfItsPlace(int i) const;
  // The item of the same kind at the same place that stands on `support`; -1: none.
  int TwinOn(int i, int support) const;
  // On how many supports the item stands, one on the other.
  int Level(int i) const;
  // Marks that `above` is tried on the plate `below`; false where it was before.
  bool TryOn(int above, int below) {
    return reseated_.insert({(*this)[above].serial, (*this)[below].serial}).second;
  }

 private:
  bool ShareRim(int a, int b) const;
  bool AreFlush(const SceneItem& a, const SceneItem& b) const;
  bool OfOneOutline(const SceneItem& above, const SceneItem& below) const;
  void Replace(SceneItem& old, SceneItem item);

  double mm_per_px_;
  std::vector<SceneItem> items_;
  bool changed_ = false;
  std::map<std::pair<int, int>, bool> conflicts_, flush_;  // of items, by serial number
  std::set<std::pair<int, int>> reseated_;                 // items tried on plates: what, on what
  int num_kept_ = 0;
};

}  // namespace vss
