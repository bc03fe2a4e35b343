// A picture of a simulated scene: light, optics, sensor.
#pragma once
#include <vector>

#include "vss/image/grey_image.h"
#include "vss/simulate/mesh.h"
#include "vss/simulate/pixel_rays.h"

namespace vss {

struct RenderedPicture {
  GreyImage image;  // 8 bit, proportional to light
  std::vector<std::int32_t>
      seen_px;  // of each part of the scene: pixels that show it, parts of pixels counted
};

// `rays`: of the picture's camera. Light is gathered at every pixel, or at every plane's piece of it; each
// quarter of a pixel then holds the mean of what lies in it, and the optics' blur and the pixel's area are
// one filter over the quarters. Exposure: the 99.3rd percentile of the picture becomes scene.exposure_grey.
// Then photon and read noise, and 8 bit. The same bytes for the same scene and picture number.
RenderedPicture RenderPicture(const SimulatedScene& scene, const SceneMesh& mesh, int picture,
                              const PixelRays& rays);

}  // namespace vss
