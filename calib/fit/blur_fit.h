#ifndef THICKLENS_CALIB_FIT_BLUR_FIT_H_
#define THICKLENS_CALIB_FIT_BLUR_FIT_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// Dependence of the blur on depth.
enum class BlurModel {
  kPerspective,  // sigma^2 = S0 + A (1/z - 1/zf)^2, [S25], [S26] [D71]
  // sigma^2 = S0 + A ((z - zf)/zf^2)^2: a telecentric pupil, whose image scale does not change. The
  // slope at focus is equal to that of kPerspective, so that kappa has the same meaning.
  kTelecentric,
};

// The measurements of one estimator: blur variance on the target, px^2 of the reference frame,
//   V_i = sigma_i^2/scale_i^2 + c,
// without the pixel box. c is a nuisance of the target: its own softness (print) or, for relative
// measurements, the blur of the reference.
struct BlurSamples {
  std::vector<std::size_t> frames;  // index into BlurFitSetup::frames
  Eigen::VectorXd variances_px2;    // V
  Eigen::MatrixXd covariance;       // covariance of the measurements
  // c where it is known: 0 for a knife edge that was measured absolutely.
  std::optional<double> held_softness_px2;
};

// A frame of the fit.
struct FitFrame {
  double reading_mm = 0;
  double scale = 1;  // image scale relative to the reference
  // Standard deviation of the scale where it was measured. The scale then also constrains the
  // reading's error, by a smooth law (second order) that is part of the fit.
  std::optional<double> scale_sigma;
};

struct BlurFitSetup {
  model::ThickLens lens;
  double pixel_pitch_mm = 0;
  BlurModel law = BlurModel::kPerspective;
  // The bench offset comes from elsewhere: it is held, and its error is propagated to the results.
  // If it were a free parameter, it would absorb the deviations of a real lens from the blur law.
  model::Estimate offset_mm;
  model::BenchDirection direction = model::BenchDirection::kAway;
  double reading_sigma_mm = 0;
  bool reading_sigma_is_known = true;  // false: errors are estimated from the scatter about the fit
  std::vector<FitFrame> frames;
  std::vector<BlurSamples> estimators;
  // S0, px^2: free, or given with its sigma (0: fixed).
  std::optional<model::Estimate> floor_variance_px2;
  // Half of the difference of 1/zf along x and along y, 1/mm: of an astigmatic lens whose variances
  // are the means of those along both. The mean follows the law about the medial focus, the mean
  // of both in 1/z, and has a minimum of its own there beside S0 [D137]:
  //   (V_x + V_y)/2 = S0 + A (1/z - 1/zf)^2 + A half_astigmatism^2.
  double half_astigmatism_per_mm = 0;
};

// Parameters of a result, in this order.
enum BlurParameter { kFocusDepth, kBlurRatio, kFloorVariance, kBenchOffset, kBlurParameters };

struct BlurFitResult {
  bool done = false;
  std::string message = "not run";
  // (zf mm, kappa, S0 px^2, offset mm) and their covariance. A held parameter has a row of 0.
  Eigen::Vector4d values{0, 0, 0, 0};
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  std::vector<double> softness_px2;  // c of each estimator
  double chi2_per_dof = 0;
  double error_factor = 1;  // factor by which the errors were widened because of chi^2
  // For each frame: the written reading minus the fitted one, and its standard deviation; the
  // residual of the blur in its own standard deviations (the largest of the estimators); and the
  // weight.
  Eigen::VectorXd reading_errors_mm, reading_error_sigmas_mm, residuals, weights;
  std::string weak_direction;  // the least certain combination of parameters, and their correlation
  double weak_correlation = 0;
};

// Returns sigma^2 at a depth by the law, without the floor, for kappa = 1, px^2.
double DefocusVariance(const BlurFitSetup& setup, double focus_depth_mm, double depth_mm);
// Returns sigma^2 at a depth for the zf and kappa of a result, without the floor, px^2.
double FittedDefocusVariance(const BlurFitSetup& setup, const BlurFitResult& fit, double depth_mm);

// Fits (zf, kappa, S0, the targets' c, every reading's error, the scale's law) by Ceres to the
// blur, the readings and the scales at once. The readings' errors are eliminated (variable
// projection). Frames that deviate by more than four of their standard deviations lose weight
// (Huber). The covariance is from the SVD of the weighted Jacobian of the remaining parameters. It
// is multiplied by chi^2 per degree of freedom where that is larger than chance makes it (99 %), or
// always where the readings' error is unknown. `start` replaces the search for a start.
BlurFitResult FitBlur(const BlurFitSetup& setup, const BlurFitResult* start = nullptr);

// Returns what astigmatism adds to sigma^2 at every depth for kappa = 1, px^2; 0 without it.
double AstigmaticVariance(const BlurFitSetup& setup, double focus_depth_mm);

// A robust parabola V(z) through the samples of an estimator, which any target follows whatever c
// is (least trimmed squares over seeded triplets).
struct Parabola {
  bool done = false;
  Eigen::Vector3d coefficients{0, 0, 0};  // coefficients of 1, x, x^2
  double middle_mm = 0, unit_mm = 1;      // x = (z - middle)/unit
  std::vector<bool> follows;              // true within six standard deviations
  Eigen::VectorXd residuals_px2, sigmas_px2;
  double vertex_mm = 0;
  double At(double depth_mm) const;
  // Returns the depths at which the parabola has a value, the depth nearer to `near_mm` first;
  // empty for a value below its vertex.
  std::vector<double> DepthsOf(double variance_px2, double near_mm) const;
};
Parabola FitParabola(const Eigen::VectorXd& depths_mm, const Eigen::VectorXd& variances_px2,
                     const Eigen::VectorXd& errors_px2, double reading_sigma_mm);

// (zf, kappa) from a parabola for a given floor, as the start of the fit.
struct FocusAndRatio {
  double focus_depth_mm = 0, blur_ratio = 0;
};
std::optional<FocusAndRatio> FromParabola(const Parabola& parabola, const BlurFitSetup& setup,
                                          double reference_depth_mm, double floor_variance_px2);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_FIT_H_
