#include "reduced_views.h"

namespace vss::station {

Eigen::Vector3d MiddleOfReduction(std::span<const Part> parts) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0;
  for (const auto& part : parts) {
    for (const auto& v : part.vertices) sum += v, ++n;
    for (const auto& c : part.circles) sum += c.center, ++n;
  }
  if (n > 0) sum /= n;
  sum.z() = 0;
  return sum;
}

void ReduceViews(const Json& run, std::vector<View>& views) {
  const auto at = run.find("temperature");
  if (at == run.end() || !at->contains("middle")) return;
  const double factor = at->at("factor").get<double>();
  const Eigen::Vector3d middle = VectorOf(at->at("middle"));
  for (auto& view : views) {
    const Eigen::Vector3d eye = middle + factor * (view.center_in_world - middle);
    RigidTransform cam_from_world = view.cam_from_world;
    cam_from_world.translation = -(cam_from_world.rotation * eye);
    const LineImage* lines = view.lines;
    const GreyView picture = view.picture;
    view = MakeView(view.image, *view.camera, cam_from_world, view.stop, lines);
    view.picture = picture;
  }
}

}  // namespace vss::station
