#ifndef THICKLENS_CALIB_SRC_BLUR_FIT_H_
#define THICKLENS_CALIB_SRC_BLUR_FIT_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// One frame's blur. Absolute: sigma^2. Relative to a reference frame (`relative_scale` > 0, this
// frame's size over the reference's): (sigma^2 + 1/12) - scale^2 (sigma_ref^2 + 1/12), which is
// free of the target's own softness.
struct BlurSample {
  std::size_t frame = 0;
  double reading_mm = 0;
  double variance_px2 = 0;
  double error_px2 = 0;
  double relative_scale = 0;
};

// What the fit may assume about sigma^2 at focus.
struct BlurFitSetup {
  model::ThickLens lens;
  double pixel_pitch_mm = 0;
  // The bench zero comes from elsewhere: it is held, and its error is carried into the results.
  // (Fitted along, it would be dragged by what a real lens does that the blur law does not say.)
  model::Estimate offset_mm;
  model::BenchDirection direction = model::BenchDirection::kAway;
  double reading_sigma_mm = 0;
  double reference_reading_mm = 0;  // of relative samples
  // S0, px^2: free, or held by a given value (sigma 0: fixed).
  std::optional<model::Estimate> floor_variance_px2;
  bool target_softness = false;  // a softness of the target, scaling as 1/z, is fitted too
  double start_focus_depth_mm = 0;
};

struct BlurFitResult {
  bool done = false;
  std::string message = "not run";
  // (zf mm, kappa, S0 px^2, offset mm) and their covariance; a floor that was held has a row of 0.
  Eigen::Vector4d values{0, 0, 0, 0};
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  double target_softness_px2 = 0;  // at the plane of focus
  double chi2_per_dof = 0;
  std::vector<double> weights;        // of the robust loss, a sample each
  std::vector<double> variances_px2;  // absolute sigma^2 of each sample, by the model's reference
  std::string weak_direction;         // set if the data leave a combination of parameters free
};

// Fits sigma^2 = S0 + A (1/z - 1/zf)^2, A = (kappa r K/p)^2, K = f1 zf/(zf - f1), z = offset +-
// reading, with errors of the meter and of the readings, and a Cauchy loss. The covariance is that
// of the reweighted problem, times chi^2 per degree of freedom where that exceeds 1; its rank is
// checked on the eigenvalues of the normal matrix in units of the parameters.
BlurFitResult FitBlur(const std::vector<BlurSample>& samples, const BlurFitSetup& setup);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SRC_BLUR_FIT_H_
