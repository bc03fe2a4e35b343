// Four cameras three metres above the world's origin, for the tests of identification, each with the exact
// line image of what is drawn.
#pragma once
#include <map>
#include <vector>

#include "vss/camera/camera.h"
#include "vss/identify/contour.h"

namespace vss::test {

struct FourViews {
  std::vector<Camera> cameras;
  std::vector<LineImage> lines;
  std::vector<View> views;

  FourViews() {
    using Eigen::Vector3d;
    for (const Vector3d& place : {Vector3d(-900, -400, 3000), Vector3d(900, -300, 3000),
                                  Vector3d(-700, 500, 3000), Vector3d(800, 600, 3000)}) {
      Camera c;
      c.width_px = c.height_px = 512;
      c.intrinsics.fx_px = c.intrinsics.fy_px = 500;
      c.intrinsics.cx_px = c.intrinsics.cy_px = 255.5;
      const Vector3d forward = -place.normalized(), right = forward.cross(Vector3d::UnitY()).normalized();
      RigidTransform t;
      t.rotation.row(0) = right.transpose();
      t.rotation.row(1) = forward.cross(right).transpose();
      t.rotation.row(2) = forward.transpose();
      t.translation = -(t.rotation * place);
      c.cam_from_world = t;
      cameras.push_back(c);
    }
    lines.resize(cameras.size());
    for (std::size_t i = 0; i < cameras.size(); ++i)
      views.push_back(MakeView(int(i), cameras[i], *cameras[i].cam_from_world, int(i), &lines[i]));
  }
  FourViews(const FourViews&) = delete;  // the views point into it

  // Each visible edge is one segment.
  void Draw(const PlacedObject& object) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      std::map<int, std::pair<ContourSample, ContourSample>> ends;
      for (const auto& s : SampleContour(PlaceSolid(object, false), views[v], 2, 3)) {
        if (!s.visible) continue;
        ends.try_emplace(s.index, s, s);
        ends.at(s.index).second = s;
      }
      for (const auto& [edge, pair] : ends) AddLine(v, pair.first.ideal, pair.second.ideal);
    }
  }

  // A line of the world, as paint or a shadow draws it.
  void Draw(const Eigen::Vector3d& start, const Eigen::Vector3d& end) {
    for (std::size_t v = 0; v < views.size(); ++v)
      AddLine(v, *views[v].ProjectIdeal(start), *views[v].ProjectIdeal(end));
  }

 private:
  void AddLine(std::size_t view, const Eigen::Vector2d& start, const Eigen::Vector2d& end) {
    LineSegment l;
    l.start = l.ideal_start = start;
    l.end = l.ideal_end = end;
    lines[view].segments.push_back(l);
  }
};

}  // namespace vss::test
