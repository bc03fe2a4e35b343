// What is drawn over a picture: its line image, and the parts projected into it.
#pragma once
#include <span>
#include <string>
#include <vector>

#include "vss/feature/line_image.h"
#include "vss/identify/view.h"
#include "vss/image/grey_image.h"
#include "vss/knowledge/object_model.h"
#include "vss/product/make_part.h"
#include "vss/product/product.h"

namespace vss {

// A piece of a part's contour in a picture: points in `img` px.
struct ProjectedContour {
  int part = 0;  // index into the product's parts
  bool hidden = false;
  std::vector<Eigen::Vector2d> points;
};

// The solids of all parts: empty where the knowledge base does not describe one.
std::vector<std::optional<WorldSolid>> SolidsOf(const Product& product, const KnowledgeBase& knowledge);

// All contours of all parts that fall into the picture, cut where they become hidden. A part without a solid
// is drawn from its vertices and circles, nothing hidden.
std::vector<ProjectedContour> ProjectParts(const Product& product,
                                           const std::vector<std::optional<WorldSolid>>& solids,
                                           const View& view);

// A colour for each part by its index, "#rrggbb", told apart on dark and light pictures.
std::string PartColor(int part);

// The SVG elements (no <svg> around them) of a line image: lines used by a part in its colour, the others in
// amber. `image`: the picture's index, as the parts' matches name it. `lens`: bends straight lines as the
// lens does; may be null.
std::string LineElements(const LineImage& lines, const Intrinsics* lens, const Product& product, int image);

// The SVG elements of projected contours, hidden ones dashed.
std::string ContourElements(std::span<const ProjectedContour> contours);

// A picture with elements over it as a whole SVG file (or element); the picture is embedded as JPEG, at most
// `max_side_px` large.
std::string OverlaySvg(const GreyView& picture, const std::string& elements, int max_side_px);

// A picture with its line image over it.
std::string LineOverlaySvg(const GreyView& picture, const LineImage& lines, const Intrinsics* lens);

// "data:image/jpeg;base64,..." of a picture, shrunk to at most `max_side_px`.
std::string JpegDataUri(const GreyView& picture, int max_side_px);
std::string Base64(std::span<const std::uint8_t> bytes);
// Text for HTML and SVG.
std::string Escaped(std::string_view text);

}  // namespace vss
