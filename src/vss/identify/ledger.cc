#include "vss/identify/ledger.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "vss/base/parallel.h"
#include "vss/identify/open_ends.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Pieces of a line this long have one owner each.
constexpr double kOwnedPx = 6;
// A shadow is no longer than that many times what casts it is high (a lamp 27 degrees above the horizon), and
// ends as much earlier or later.
constexpr double kShadowReach = 2, kShadowEndPx = 5, kShadowSkew = 0.035;
// A contour counts as missed where what it says is below this (log-odds): faint and shaded ones stay above.
constexpr double kClearlyAgainst = -1;
// Two faces are one plane where they are level to within this, and no farther apart.
constexpr double kSeamStepPx = 1.5, kSeamGapsPx[] = {0.75, 1.5, 3, 5};

// What the solid's corners and rims cover in a picture; all of it where some are behind the camera.
Eigen::AlignedBox2d ScreenOf(const WorldSolid& solid, const View& view) {
  Eigen::AlignedBox2d box;
  const Eigen::AlignedBox2d all(Vector2d::Constant(-1e9), Vector2d::Constant(1e9));
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles)
      for (const auto& p : t) {
        const auto ideal = view.ProjectIdeal(p);
        if (!ideal) return all;
        box.extend(*ideal);
      }
  return box;
}

// The share of an edge on which one of its two faces goes on, in its plane, on `other`.
double SeamShare(const WorldSolid& solid, const SolidEdge& edge, const Volume& mine, const Volume& other,
                 double mm_per_px) {
  constexpr int kSteps = 5;
  const Vector3d &start = solid.vertices[std::size_t(edge.start)].point,
                 &end = solid.vertices[std::size_t(edge.end)].point;
  const Vector3d left = solid.faces[std::size_t(edge.left_face)].normal_in_part,
                 right = solid.faces[std::size_t(edge.right_face)].normal_in_part;
  int seams = 0;
  for (int i = 0; i < kSteps; ++i) {
    const Vector3d p = start + (end - start) * ((i + 0.5) / kSteps);
    // However thin the other part is there.
    const auto goes_on = [&](const Vector3d& face, const Vector3d& beyond) {
      const Vector3d depth = kSeamStepPx * mm_per_px * face;
      return std::any_of(std::begin(kSeamGapsPx), std::end(kSeamGapsPx), [&](double gap) {
        const Vector3d at = p + gap * mm_per_px * beyond;
        return other.Contains(at - depth) && !other.Contains(at + depth) && !mine.Contains(at - depth);
      });
    };
    seams += goes_on(left, right) || goes_on(right, left);
  }
  return double(seams) / kSteps;
}

// May the edge be the shadow of a higher edge of `other`, level, parallel and of the same length?
bool MayBeShadow(const WorldSolid& solid, const SolidEdge& edge, const WorldSolid& other, double mm_per_px) {
  const auto ends = [](const WorldSolid& s, const SolidEdge& e) {
    return std::pair(s.vertices[std::size_t(e.start)].point, s.vertices[std::size_t(e.end)].point);
  };
  const auto [start, end] = ends(solid, edge);
  const Vector3d along = (end - start).normalized();
  if (std::abs(along.z()) > kShadowSkew) return false;
  return std::any_of(other.edges.begin(), other.edges.end(), [&](const SolidEdge& o) {
    auto [from, to] = ends(other, o);
    if ((to - from).dot(along) < 0) std::swap(from, to);
    const double higher = from.z() - start.z();
    if (higher < kSeamStepPx * mm_per_px || (to - from).normalized().cross(along).norm() > kShadowSkew)
      return false;
    const double flush = kShadowEndPx * mm_per_px;
    if (std::abs((from - start).dot(along)) > flush || std::abs((to - end).dot(along)) > flush) return false;
    Vector3d aside = from - start;
    aside -= along * along.dot(aside);
    return aside.head<2>().norm() < kShadowReach * higher;
  });
}

// Of an edge or a rim in the world, mm; of a limb 0: how long it is depends on who looks.
double LengthOf(const WorldSolid& solid, const MeasuredContours::Contour& contour) {
  const auto i = std::size_t(contour.index);
  if (contour.source == ContourSample::Source::kCircle) return 2 * kPi * solid.circles[i].radius_mm;
  if (contour.source != ContourSample::Source::kEdge) return 0;
  const SolidEdge& e = solid.edges[i];
  return (solid.vertices[std::size_t(e.end)].point - solid.vertices[std::size_t(e.start)].point).norm();
}

// One line of the world, or may be: edges of two parts that one picture shows one behind the other are two.
bool MayBeOneLine(const WorldSolid& a, const MeasuredContours::Contour& of_a, const WorldSolid& b,
                  const MeasuredContours::Contour& of_b, double mm_per_px) {
  constexpr double kAsidePx = 3;  // what the places of two edges may be off together
  if (of_a.source != ContourSample::Source::kEdge || of_b.source != ContourSample::Source::kEdge) return true;
  const SolidEdge &ea = a.edges[std::size_t(of_a.index)], &eb = b.edges[std::size_t(of_b.index)];
  const Vector3d& start = a.vertices[std::size_t(ea.start)].point;
  const Vector3d along = (a.vertices[std::size_t(ea.end)].point - start).normalized();
  const auto aside = [&](int vertex) {
    return along.cross(b.vertices[std::size_t(vertex)].point - start).norm();
  };
  return std::max(aside(eb.start), aside(eb.end)) < kAsidePx * mm_per_px;
}

// Contours that lie on one line.
class Groups {
 public:
  explicit Groups(std::size_t size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t Root(std::size_t i) const {
    while (parent_[i] != i) i = parent_[i];
    return i;
  }
  void Join(std::size_t a, std::size_t b) {
    a = Root(a), b = Root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace

void Ledger::Add(std::span<const PlacedObject> objects, int threads) {
  constexpr int kManyViews = 40;  // the search looks at some pictures, the decision at many
  const std::size_t first = candidates_.size();
  candidates_.resize(first + objects.size());
  ParallelFor(objects.size(), threads, [&](std::size_t i) {
    Candidate& c = candidates_[first + i];
    const WorldSolid solid = PlaceSolid(objects[i], false);
    const auto views = ViewsThatSee(solid, scene_, kManyViews);
    c.prior = PriorLogOdds(objects[i], scene_.mm_per_px);
    c.measured = MeasureContours(solid, views, scene_, {.grey = true});
    c.painted = WeighPainted(solid, views, scene_, {.rings = true});
    c.body.Add(solid, int(first + i));
    c.volume = MakeVolume(solid);
    c.solid = solid;
    c.in_views = PlacesOf(c);
  });
}

const Ledger::Candidate::InView* Ledger::Candidate::In(int view) const {
  const auto it = std::lower_bound(in_views.begin(), in_views.end(), view,
                                   [](const InView& a, int v) { return a.view < v; });
  return it == in_views.end() || it->view != view ? nullptr : &*it;
}

std::vector<Ledger::Candidate::InView> Ledger::PlacesOf(const Candidate& c) const {
  std::vector<Candidate::InView> places;
  const auto& box = c.volume.box;
  for (const int v : scene_.ViewsNear(box)) {
    const View& view = scene_.views[std::size_t(v)];
    const auto seen = std::find_if(c.measured.views.begin(), c.measured.views.end(),
                                   [&](const auto& in_view) { return in_view.view == v; });
    const bool is_seen = seen != c.measured.views.end();
    if (!is_seen && !view.MayShowBall(box.center(), box.sizes().norm() / 2)) continue;
    places.push_back({v, is_seen ? int(seen - c.measured.views.begin()) : -1, ScreenOf(c.solid, view)});
  }
  return places;
}

std::vector<int> Ledger::ViewsOf(std::span<const int> set) const {
  std::vector<int> views;
  for (const int i : set)
    for (const auto& in_view : candidates_[std::size_t(i)].measured.views) views.push_back(in_view.view);
  std::sort(views.begin(), views.end());
  views.erase(std::unique(views.begin(), views.end()), views.end());
  return views;
}

const std::vector<int>& Ledger::Linked(int candidate, double near_mm) {
  shown_in_.resize(scene_.views.size());
  while (links_.size() < candidates_.size()) Link(int(links_.size()), near_mm);
  return links_[std::size_t(candidate)];
}

// Links a candidate with those linked before.
void Ledger::Link(int candidate, double near_mm) {
  const Candidate& c = candidates_[std::size_t(candidate)];
  std::vector<int> linked;
  for (const auto& place : c.in_views) {
    auto& others = shown_in_[std::size_t(place.view)];
    for (const int k : others)
      if (place.screen.intersects(candidates_[std::size_t(k)].In(place.view)->screen)) linked.push_back(k);
    others.push_back(candidate);
  }
  for (const auto& in_view : c.measured.views) {
    const LineIndex& index = scene_.lines[std::size_t(in_view.view)];
    int last = -1;
    for (const auto& m : in_view.samples) {
      if (m.line < 0) continue;
      const int line = index.WholeOf(m.line);
      if (line == std::exchange(last, line)) continue;
      auto& others = on_line_[(std::int64_t(in_view.view) << 32) + line];
      linked.insert(linked.end(), others.begin(), others.end());
      if (others.empty() || others.back() != candidate) others.push_back(candidate);
    }
  }
  const auto reach_of = [&](const Candidate& other) {
    return std::max(
        {near_mm, kShadowReach * other.volume.box.sizes().z(), *std::rbegin(kSeamGapsPx) * scene_.mm_per_px});
  };
  for (int k = 0; k < candidate; ++k) {
    const Candidate& other = candidates_[std::size_t(k)];
    const Vector3d reach = Vector3d::Constant(std::max(reach_of(c), reach_of(other)));
    const Eigen::AlignedBox3d near(other.volume.box.min() - reach, other.volume.box.max() + reach);
    if (near.intersects(c.volume.box)) linked.push_back(k);
  }
  std::sort(linked.begin(), linked.end());
  linked.erase(std::unique(linked.begin(), linked.end()), linked.end());
  std::erase(linked, candidate);
  for (const int k : linked) links_[std::size_t(k)].push_back(candidate);
  links_.push_back(std::move(linked));
}

const std::vector<bool>& Ledger::Hidden(int i, int slot, int k) {
  auto& slots = hidden_[{i, k}];
  const Candidate& c = candidates_[std::size_t(i)];
  if (slots.empty()) {
    slots.resize(c.measured.views.size());
    for (std::size_t s = 0; s < slots.size(); ++s) {
      const auto& in_view = c.measured.views[s];
      const auto v = std::size_t(in_view.view);
      const auto *mine = c.In(in_view.view), *other = candidates_[std::size_t(k)].In(in_view.view);
      if (!mine || !other || !mine->screen.intersects(other->screen)) continue;
      std::vector<Vector3d> points;
      for (const auto& sample : in_view.samples) points.push_back(sample.point_in_world);
      auto hidden = HiddenBy(scene_.views[v], candidates_[std::size_t(k)].body, points);
      if (std::find(hidden.begin(), hidden.end(), true) != hidden.end()) slots[s] = std::move(hidden);
    }
  }
  return slots[std::size_t(slot)];
}

const std::vector<double>& Ledger::Seams(int i, int k) {
  const auto [it, is_new] = seams_.try_emplace({i, k});
  if (!is_new) return it->second;
  const Candidate &mine = candidates_[std::size_t(i)], &other = candidates_[std::size_t(k)];
  const double longest = kShadowReach * other.volume.box.sizes().z();
  const Vector3d reach = Vector3d::Constant(std::max(longest, *std::rbegin(kSeamGapsPx) * scene_.mm_per_px));
  const Eigen::AlignedBox3d near(other.volume.box.min() - reach, other.volume.box.max() + reach);
  if (!near.intersects(mine.volume.box)) return it->second;
  const auto& contours = mine.measured.contours;
  it->second.resize(contours.size());
  for (std::size_t n = 0; n < contours.size(); ++n) {
    if (contours[n].source != ContourSample::Source::kEdge) continue;
    const SolidEdge& edge = mine.solid.edges[std::size_t(contours[n].index)];
    it->second[n] = MayBeShadow(mine.solid, edge, other.solid, scene_.mm_per_px)
                        ? 1
                        : SeamShare(mine.solid, edge, mine.volume, other.volume, scene_.mm_per_px);
  }
  return it->second;
}

std::vector<Ledger::Share> Ledger::Weigh(std::span<const int> set) {
  assert(std::all_of(set.begin(), set.end(), [&](int i) { return i >= 0 && i < size(); }));
  std::vector<std::size_t> first_contour(set.size() + 1);
  for (std::size_t n = 0; n < set.size(); ++n)
    first_contour[n + 1] = first_contour[n] + candidates_[std::size_t(set[n])].measured.contours.size();
  Groups groups(first_contour.back());
  struct Vote {
    std::size_t contour;
    int view;
    ContourVote::Contour said;
  };
  std::vector<Vote> votes;
  std::vector<char> visible;
  std::vector<std::size_t> offset;
  struct Owner {
    double distance_px;
    std::size_t contour;
  };
  std::unordered_map<std::int64_t, Owner> owners;             // by line and piece of it
  std::unordered_map<int, std::vector<std::size_t>> on_line;  // the contours on each line
  const auto one_line = [&](std::size_t a, std::size_t b) {
    const auto candidate = [&](std::size_t contour) {
      const auto n =
          std::upper_bound(first_contour.begin(), first_contour.end(), contour) - first_contour.begin() - 1;
      return std::pair(&candidates_[std::size_t(set[std::size_t(n)])],
                       contour - first_contour[std::size_t(n)]);
    };
    const auto [of_a, i] = candidate(a);
    const auto [of_b, k] = candidate(b);
    return MayBeOneLine(of_a->solid, of_a->measured.contours[i], of_b->solid, of_b->measured.contours[k],
                        scene_.mm_per_px);
  };
  std::vector<const Candidate::InView*> places(set.size());  // in the view at hand
  for (const int v : ViewsOf(set)) {
    const LineIndex& index = scene_.lines[std::size_t(v)];
    for (std::size_t n = 0; n < set.size(); ++n) places[n] = candidates_[std::size_t(set[n])].In(v);
    owners.clear();
    on_line.clear();
    visible.clear();
    offset.assign(set.size() + 1, 0);
    auto key = [](const MeasuredContours::Sample& m) {
      return (std::int64_t(m.line) << 24) + std::int64_t(std::max(0.0, m.along_px) / kOwnedPx);
    };
    for (std::size_t n = 0; n < set.size(); ++n) {
      offset[n] = visible.size();
      const Candidate& c = candidates_[std::size_t(set[n])];
      const int slot = places[n] ? places[n]->slot : -1;
      if (slot < 0) continue;
      const auto& samples = c.measured.views[std::size_t(slot)].samples;
      visible.resize(visible.size() + samples.size(), 1);
      char* mine = visible.data() + offset[n];
      for (std::size_t m = 0; m < set.size(); ++m) {
        if (set[m] == set[n] || !places[m] || !places[n]->screen.intersects(places[m]->screen)) continue;
        const auto& hidden = Hidden(set[n], slot, set[m]);
        for (std::size_t i = 0; i < hidden.size(); ++i)
          if (hidden[i]) mine[i] = 0;
      }
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const auto& m = samples[i];
        if (!mine[i] || m.line < 0 || m.lost != 0) continue;
        const std::size_t contour = first_contour[n] + std::size_t(m.contour);
        const auto [it, is_new] = owners.try_emplace(key(m), Owner{m.distance_px, contour});
        if (!is_new && m.distance_px < it->second.distance_px) it->second = {m.distance_px, contour};
      }
    }
    offset[set.size()] = visible.size();
    for (std::size_t n = 0; n < set.size(); ++n) {
      const Candidate& c = candidates_[std::size_t(set[n])];
      const int slot = places[n] ? places[n]->slot : -1;
      if (slot < 0) continue;
      const auto& in_view = c.measured.views[std::size_t(slot)];
      const char* mine = visible.data() + offset[n];
      auto taken = [&](std::size_t i) {
        const auto& m = in_view.samples[i];
        const auto it = owners.find(key(m));
        return it != owners.end() &&
               (it->second.contour < first_contour[n] || it->second.contour >= first_contour[n + 1]);
      };
      for (std::size_t i = 0; i < in_view.samples.size(); ++i) {
        const auto& m = in_view.samples[i];
        if (!mine[i] || m.line < 0 || m.lost != 0 || taken(i)) continue;
        const std::size_t contour = first_contour[n] + std::size_t(m.contour);
        auto& others = on_line[index.WholeOf(m.line)];
        if (std::find(others.begin(), others.end(), contour) != others.end()) continue;
        for (std::size_t other : others)
          if (groups.Root(other) != groups.Root(contour) && one_line(other, contour))
            groups.Join(other, contour);
        others.push_back(contour);
      }
      for (const auto& said :
           VoteOf(
               c.measured, in_view, [&](std::size_t i) { return mine[i] != 0; }, taken, scene_, false)
               .contours)
        votes.push_back({first_contour[n] + std::size_t(said.contour), int(v), said});
    }
  }
  // Pieces of one contour fail and are found together, whether in one candidate or several.
  std::unordered_map<std::int64_t, double> open_px;  // by group and view
  std::vector<int> num_views(first_contour.back());
  std::vector<int> last_view(first_contour.back(), -1);
  for (const Vote& vote : votes) {
    const std::size_t root = groups.Root(vote.contour);
    open_px[(std::int64_t(root) << 20) + vote.view] += vote.said.open_px;
    if (last_view[root] != vote.view) ++num_views[root], last_view[root] = vote.view;
  }
  std::vector<Share> out(set.size());
  for (std::size_t n = 0; n < set.size(); ++n) {
    const Candidate& c = candidates_[std::size_t(set[n])];
    out[n].log_odds = c.prior - c.painted.edges;
    out[n].elevated_log_odds = kElevatedPrior * c.prior - c.painted.all;
  }
  std::vector<double> sums(first_contour.back());
  std::vector<EdgeShown> shown(first_contour.back());  // of edges
  std::vector<bool> shows(first_contour.back());
  for (const Vote& vote : votes) {
    if (vote.said.open_px <= 0) continue;
    const std::size_t root = groups.Root(vote.contour);
    const double all_px = open_px[(std::int64_t(root) << 20) + vote.view];
    const double pieces = IndependentPieces(all_px) * vote.said.open_px / all_px;
    shows[vote.contour] = true;
    EdgeShown& edge = shown[vote.contour];
    ++edge.num_views;
    edge.open_px += vote.said.open_px;
    edge.supported_px += vote.said.supported_px;
    sums[vote.contour] +=
        (vote.said.ends + pieces * vote.said.per_piece) / std::sqrt(double(num_views[root]));
  }
  for (std::size_t n = 0; n < set.size(); ++n) {
    const auto& contours = candidates_[std::size_t(set[n])].measured.contours;
    for (const int k : set) {
      if (k == set[n]) continue;
      const auto& seams = Seams(set[n], k);
      for (std::size_t c = 0; c < seams.size(); ++c) {
        double& sum = sums[first_contour[n] + c];
        if (sum > 0) sum *= 1 - seams[c];
        if (seams[c] > 0) shown[first_contour[n] + c] = {};
      }
    }
    double all_mm = 0, missed_mm = 0;
    for (std::size_t k = 0; k < contours.size(); ++k) {
      const double log_odds = sums[first_contour[n] + k];
      out[n].log_odds += log_odds;
      if (contours[k].elevated) out[n].elevated_log_odds += log_odds;
      (log_odds > 0 ? out[n].shown : out[n].missed) += std::abs(log_odds);
      if (!shows[first_contour[n] + k]) continue;
      const double length =
          contours[k].weight * LengthOf(candidates_[std::size_t(set[n])].solid, contours[k]);
      all_mm += length;
      if (log_odds < kClearlyAgainst) missed_mm += length;
    }
    out[n].missed_share = all_mm > 0 ? missed_mm / all_mm : 0;
    std::vector<EdgeShown> edges(candidates_[std::size_t(set[n])].solid.edges.size());
    for (std::size_t k = 0; k < contours.size(); ++k)
      if (contours[k].source == ContourSample::Source::kEdge)
        edges[std::size_t(contours[k].index)] = shown[first_contour[n] + k];
    out[n].missing_ends = MissingEnds(candidates_[std::size_t(set[n])].solid, edges);
    const double open_ledges = OpenLedges(candidates_[std::size_t(set[n])].measured,
                                          std::span(sums).subspan(first_contour[n], contours.size()));
    out[n].log_odds += open_ledges;
    out[n].elevated_log_odds += open_ledges;
  }
  return out;
}

}  // namespace vss
