// What stands on plates: parts seated on a plate that was found below them, and plates joined on which
// something stands upright.
#pragma once
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "vss/identify/scene_data.h"

namespace vss {

// What was taken to stand on the ground may stand on a plate that lies there: adds it there.
void ReseatOnPlates(SceneData& data);

// A plate on which something stands upright shows as two, one on either side: of two of one kind and height
// in one line, the whole is tried too, with what stands between them as it stands.
class PlateJoiner {
 public:
  explicit PlateJoiner(SceneData& data) : data_(data) {}
  // Adds the wholes of all halves; each is tried once.
  void JoinAll();

 private:
  bool MayBeHalves(int a, int b, double farthest_mm) const;
  bool Halves(int a, int b, int between) const;
  void Join(int a, int b, int between);
  bool IsNew(int a, int b);

  SceneData& data_;
  std::set<std::pair<std::string, std::vector<long>>> joined_;  // wholes tried: kind, place
};

}  // namespace vss
