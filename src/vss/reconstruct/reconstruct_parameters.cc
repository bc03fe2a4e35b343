// The parameters of reconstruction: their one declaration.
#include "vss/reconstruct/reconstruct.h"

namespace vss {

std::span<const ParameterOf<ReconstructOptions>> ReconstructParameters() {
  using O = ReconstructOptions;
  static const ParameterOf<O> rows[] = {
      {"reconstruct.draw_to_lines", &O::draw_to_lines, 0, 1, "",
       "Draw the parts to the lines first; not needed where they lie within reconstruct.search_px already."},
      {"reconstruct.search_px", &O::search_px, 0.5, 20, "px",
       "How far from its predicted place an edge is looked for in the first round."},
      {"reconstruct.piece_length_px", &O::piece_length_px, 4, 64, "px",
       "Length of the pieces of contour that are measured one by one, for a lens blur of one pixel or less."},
      {"reconstruct.adjust_cameras", &O::adjust_cameras, 0, 1, "",
       "Adjust cameras and gantry stops jointly with the parts, under their priors."},
      {"reconstruct.camera_rotation_sigma_mrad", &O::camera_rotation_sigma_mrad, 1e-4, 100, "mrad",
       "How well a carried camera's direction is known where its file does not say."},
      {"reconstruct.camera_position_sigma_mm", &O::camera_position_sigma_mm, 1e-4, 100, "mm",
       "How well a carried camera's place is known where its file does not say."},
      {"reconstruct.picture_rotation_sigma_mrad", &O::picture_rotation_sigma_mrad, 1e-4, 100, "mrad",
       "How well the direction of a hand-held or robot-held picture is known."},
      {"reconstruct.picture_position_sigma_mm", &O::picture_position_sigma_mm, 1e-4, 100, "mm",
       "How well the place of a hand-held or robot-held picture is known."},
      {"reconstruct.stop_sigma_mm", &O::stop_sigma_mm, 1e-4, 100, "mm",
       "How well the carriage stops where the survey says it does."},
      {"reconstruct.ground_sigma_mm", &O::ground_sigma_mm, 1e-3, 100, "mm",
       "How flat the ground is, and how well it is z = 0."},
      {"reconstruct.contact_sigma_mm", &O::contact_sigma_mm, 1e-3, 100, "mm",
       "How closely a part lies on the one that it stands on."},
      {"reconstruct.wall_sigma_mm", &O::wall_sigma_mm, 0, 100, "mm",
       "How closely upright faces of two parts lie against each other where they seem to, unless the "
       "pictures "
       "show them apart; 0: none is taken to."},
      {"reconstruct.free_bias_px", &O::free_bias_px, 1e-4, 10, "px",
       "How far chamfers and the like may pull a free edge alike in all pictures."},
      {"reconstruct.contact_bias_px", &O::contact_bias_px, 1e-4, 10, "px",
       "How far a contact shadow or a weld may pull an edge that lies on something alike in all pictures."},
      {"reconstruct.round_bias_px", &O::round_bias_px, 1e-4, 10, "px",
       "How far shading may pull a rim alike in all pictures."},
      {"reconstruct.limb_bias_px", &O::limb_bias_px, 1e-4, 10, "px",
       "How far the outline of a cylinder may be pulled inwards, where its surface turns away from the "
       "light."},
      {"reconstruct.shadowed_bias_px", &O::shadowed_bias_px, 1e-4, 10, "px",
       "How far the shadow behind a low, dark part may pull its outline in all pictures that see it so."},
      {"reconstruct.tilt_sigma_deg", &O::tilt_sigma_deg, 0.01, 10, "deg",
       "How far parts lean, where they do."},
      {"reconstruct.allow_tilt", &O::allow_tilt, 0, 1, "", "Let a part lean where the pictures demand it."},
      {"reconstruct.allow_ground", &O::allow_ground, 0, 1, "",
       "Find the height and slope of the ground that the workpiece stands on where the pictures demand "
       "another "
       "than z = 0."},
      {"reconstruct.full_covariance", &O::full_covariance, 0, 1, "",
       "Write the covariance of every vertex, and the correlations, into product.json."},
  };
  return rows;
}

}  // namespace vss
