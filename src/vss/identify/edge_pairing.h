// Which edge of the world a line of one picture shows: pairs of lines of two pictures meet in space, and the
// other pictures judge.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "vss/identify/edge_fitter.h"

namespace vss {

class EdgePairing {
 public:
  // `fitter` must outlive it.
  explicit EdgePairing(const EdgeFitter& fitter, std::span<const LineIndex> indices);

  // The segments of view `i` that may start an edge.
  std::span<const int> Paired(int i) const { return paired_[std::size_t(i)]; }
  // The best explanation of line `line` of view `i` as an edge in the world; empty where no two pictures
  // agree.
  std::optional<EdgeCandidate> Explain(int i, int line) const;

 private:
  Eigen::AlignedBox2d RoomIn(const View& other, const View& view, const ViewLine& a) const;
  void PairUp(const View& va, const ViewLine& a, const View& vb, const ViewLine& b,
              std::vector<EdgeCandidate>& out) const;
  bool Place(const View& va, const ViewLine& a, const View& vb, const ViewLine& b, EdgeCandidate& c) const;
  std::optional<EdgeCandidate> Best(int i, int line, std::vector<EdgeCandidate>& candidates) const;
  bool FindSupport(EdgeCandidate& c, double least_score) const;
  bool Beside(const View& view, const ViewLine& l, const Eigen::Vector3d& start,
              const Eigen::Vector3d& end) const;
  bool SameDepth(const View& view, const EdgeCandidate& a, const EdgeCandidate& b) const;

  const EdgeFitter& fitter_;
  std::vector<std::vector<int>> paired_;  // by view
};

}  // namespace vss
