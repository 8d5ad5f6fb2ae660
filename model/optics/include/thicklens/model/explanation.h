#ifndef THICKLENS_MODEL_EXPLANATION_H_
#define THICKLENS_MODEL_EXPLANATION_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// Depths from Ap; far_mm may be +inf.
struct DepthRange {
  double near_mm = 0;  // the nearer end, mm from Ap
  double far_mm = 0;   // the farther end, mm from Ap
};

// The blur and magnification of a calibrated camera at one depth.
struct DepthRow {
  double depth_mm = 0;                // may be +inf
  double blur_radius_mm = 0;          // r_defocus on the sensor, mm [S25]
  double blur_radius_px = 0;          // the same in px
  double defocus_sigma_px = 0;        // kappa r_defocus/p
  double defocus_sigma_error_px = 0;  // its standard deviation from those of kappa and d1
  double sigma_px = 0;                // with the blur floor; without the pixel box
  double magnification = 0;           // of the chief ray, absolute value
  double thin_blur_radius_px = 0;     // of a thin lens at the same image distance
  double thin_magnification = 0;      // likewise
};

// Depths from Ap between which the blur radius is at most a limit [D6].
struct DepthOfFieldRow {
  double blur_radius_px = 0;  // the limit, px
  double near_mm = 0;         // the nearer end, mm from Ap
  double far_mm = 0;          // may be +inf
};

// The camera treated as a thin lens (f1 = f2 = the front value, rho = 0) whose sensor does not
// move.
struct ThinComparison {
  bool same_lens = false;                // the lens is already thin
  std::optional<double> focus_depth_mm;  // absent: the sensor is in front of every image
  double scale_ratio = 1;                // magnification, thin over thick, at every depth
  double corner_shift_px = 0;            // the resulting shift at the farthest corner
  // Between the front focal length and this depth, rays through the rim of the aperture land within
  // kThinTolerancePx of where they land behind the thick lens, relative to the chief ray; may be
  // +inf.
  double alike_up_to_mm = 0;
};
// The difference of landing points, px, below which a thin and a thick lens count as alike.
constexpr double kThinTolerancePx = 0.1;

// The effect of a calibrated camera on points at several depths.
struct Explanation {
  std::string camera_name;              // Camera::name
  double front_focal_length_mm = 0;     // f1, mm
  double image_distance_mm = 0;         // d1 from Ap to the sensor, mm
  double image_distance_sigma_mm = 0;   // its standard deviation, mm
  double focus_depth_mm = 0;            // may be +inf
  double blur_ratio = 0;                // kappa, dimensionless
  double blur_ratio_sigma = 0;          // its standard deviation
  std::optional<double> blur_floor_px;  // sigma of the blur floor, px; absent: not calibrated
  std::vector<DepthRow> rows;           // one per depth, from near to far
  std::vector<DepthOfFieldRow> depth_of_field;  // one per limit of the blur radius
  double hyperfocal_mm = 0;     // plane of focus whose blur radius at infinity is 1 px
  double working_f_number = 0;  // D/(2 r)
  ThinComparison thin;          // the camera as a thin lens
  // The distortion that is taken out of the camera's images before they are used; absent: none.
  std::optional<LensDistortion> distortion;
};

// Returns `count` depths (>= 2), equally spaced in 1/z, where the blur changes by equal steps.
THICKLENS_EXPORT std::vector<double> InverselySpacedDepthsMm(const DepthRange& range, int count);

// Throws Error naming the field if the camera has no image distance or no blur ratio.
THICKLENS_EXPORT Explanation ExplainCamera(const Camera& camera, const DepthRange& range,
                                           int count);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EXPLANATION_H_
