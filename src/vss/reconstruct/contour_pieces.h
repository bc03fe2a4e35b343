// The visible contour of all parts in one picture, cut into short pieces along which an edge can be measured:
// each knows how far its surroundings are free of other contours, and which parallel contours share its
// strip.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/identify/contour.h"
#include "vss/reconstruct/edge_profile.h"

namespace vss {

// How much the place of an edge in the picture can be trusted to be the solid's edge.
enum class ContourClass {
  kFree,     // nothing near behind it: top edges, outlines
  kContact,  // lies on the ground or on another part, or in a corner of its own: shadow and weld pull it
  kRound,    // rim of a cylinder
  kLimb,     // its outline: there the light falls as the square root of the distance, within a few pixels
  // An edge or rim of a dark face before what the part stands on, close above it: its shadow lies behind it,
  // and where that is about as dark as the face, the shadow's border is the step that shows.
  kShadowed,
};
inline constexpr int kNumContourClasses = 5;
// "free", "contact", "round", "limb", "shadowed": as product.json has it.
const char* NameOf(ContourClass edge_class);

struct ContourPiece {
  int part = 0;
  ContourSample sample;
  ProfileCurve curve;  // in img, normal = tangent turned by +90 degrees (u towards v)
  ContourClass edge_class = ContourClass::kFree;
  // Of an outline, where one side of it is another thing than the face: 1 where that lies along the curve's
  // normal, -1 against it; 0: both sides are faces of the part, or a limb.
  int background = 0;
  double above_foot_px = 0;  // height above the part's origin, as a length at its depth
  double half_length_px = 0;
  double reach_minus_px = 0, reach_plus_px = 0;  // free of crossing contours
  std::vector<ProfileCurve> neighbours;          // parallel contours within reach
};

// A straight edge seen from end to end that is too short for a piece, or too near to edges that cross its
// strip: to be measured together with all that is seen around it (short_edge.h).
struct ShortEdge {
  ContourPiece piece;  // the edge as a whole; the reaches mean nothing
  // Pieces of other contours around, straight: each knows which contour it is of.
  struct Around {
    ProfileCurve curve;
    double half_length_px = 0;
    int contour = 0;
  };
  std::vector<Around> around;
};

struct PieceOptions {
  double length_px = 8;         // of a piece
  double reach_px = 4;          // wanted on both sides
  double vertex_margin_px = 2;  // kept clear at the ends of edges
  double min_gap_px = 1.2;      // parallel contours nearer than that cannot be told apart
  double touch_mm =
      12;  // other parts hide only what lies deeper behind them: parts that touch may overlap a little
  int only_part = -1;         // pieces of that part alone are wanted; -1: of all
  double contact_gap_mm = 4;  // an edge that near to the ground or to another part's face lies on it
};

// `solids` of all parts, `occluders[i]` the solids of all others that may hide part i. Short edges go to
// `short_edges`, if asked for.
std::vector<ContourPiece> CutContour(std::span<const WorldSolid> solids, std::span<const Occluders> occluders,
                                     const View& view, const PieceOptions& options,
                                     std::vector<ShortEdge>* short_edges = nullptr);

// Height of that face of `solid` which looks up at (x, y) and lies nearest to height z, or empty beside the
// solid.
std::optional<double> TopUnder(const WorldSolid& solid, double x_mm, double y_mm, double z_mm);

}  // namespace vss
