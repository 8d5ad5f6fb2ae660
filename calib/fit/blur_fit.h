#ifndef THICKLENS_CALIB_FIT_BLUR_FIT_H_
#define THICKLENS_CALIB_FIT_BLUR_FIT_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// How the blur goes with depth.
enum class BlurLaw {
  kPerspective,  // sigma^2 = S0 + A (1/z - 1/zf)^2, [S25], [S26] [D71]
  // sigma^2 = S0 + A ((z - zf)/zf^2)^2: a telecentric pupil, whose image scale does not change. The
  // same slope at focus, so that kappa means the same.
  kTelecentric,
};

// What one meter says of the frames: blur variance on the target, px^2 of the reference frame,
//   V_i = sigma_i^2/scale_i^2 + c,
// c a nuisance of the target: its own softness (print) or, of relative measurements, whatever the
// reference has. Without the pixel box.
struct BlurSamples {
  std::vector<std::size_t> frames;  // index into BlurFitSetup::frames
  Eigen::VectorXd variances_px2;    // V
  Eigen::MatrixXd covariance;       // of the measurements
  // c where it is known: 0 of a knife edge that was measured absolutely.
  std::optional<double> held_softness_px2;
};

// A frame of the fit.
struct FitFrame {
  double reading_mm = 0;
  double scale = 1;  // image scale relative to the reference
  // Standard deviation of the scale where it was measured: it then tells the reading's error too,
  // by a smooth law (second order) that is fitted along.
  std::optional<double> scale_sigma;
};

struct BlurFitSetup {
  model::ThickLens lens;
  double pixel_pitch_mm = 0;
  BlurLaw law = BlurLaw::kPerspective;
  // The bench zero comes from elsewhere: it is held, and its error is carried into the results.
  // (Fitted along, it would be dragged by what a real lens does that the blur law does not say.)
  model::Estimate offset_mm;
  model::BenchDirection direction = model::BenchDirection::kAway;
  double reading_sigma_mm = 0;
  bool reading_sigma_is_known = true;  // false: errors are taken from the scatter about the fit
  std::vector<FitFrame> frames;
  std::vector<BlurSamples> meters;
  // S0, px^2: free, or given with its sigma (0: fixed).
  std::optional<model::Estimate> floor_variance_px2;
};

// Parameters of a result, in this order.
enum BlurParameter { kFocusDepth, kBlurRatio, kFloorVariance, kBenchOffset, kBlurParameters };

struct BlurFitResult {
  bool done = false;
  std::string message = "not run";
  // (zf mm, kappa, S0 px^2, offset mm) and their covariance; what was held has a row of 0.
  Eigen::Vector4d values{0, 0, 0, 0};
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  std::vector<double> softness_px2;  // c of each meter
  double chi2_per_dof = 0;
  double error_factor = 1;  // by which the errors were widened because chi^2 asks for it
  // Of each frame: written reading minus the believed one, its standard deviation; the residual of
  // the blur in its own standard deviations (the largest of the meters) and the weight it was
  // given.
  Eigen::VectorXd reading_errors_mm, reading_error_sigmas_mm, residuals, weights;
  std::string weak_direction;  // the combination of parameters known worst, with their correlation
  double weak_correlation = 0;
};

// sigma^2 at a depth by the law, without the floor, for kappa = 1, px^2.
double DefocusVariance(const BlurFitSetup& setup, double focus_depth_mm, double depth_mm);
// The same for a result's own zf and kappa.
double FittedDefocusVariance(const BlurFitSetup& setup, const BlurFitResult& fit, double depth_mm);

// Fits (zf, kappa, S0, the targets' c, every reading's error, the scale's law) by Ceres to the
// blur, the readings and the scales at once; the readings' errors are eliminated (variable
// projection). Frames that lie beyond four of their standard deviations lose weight (Huber).
// Covariance by SVD of the weighted Jacobian of what is left; times chi^2 per degree of freedom
// where that is larger than chance makes it (99 %), or always where nobody knows the readings'
// error. `start` saves the search for a start.
BlurFitResult FitBlur(const BlurFitSetup& setup, const BlurFitResult* start = nullptr);

// A robust parabola V(z) through the samples of a meter, which any target follows whatever c is
// (least trimmed squares over seeded triplets).
struct Parabola {
  bool done = false;
  Eigen::Vector3d coefficients{0, 0, 0};  // of 1, x, x^2
  double middle_mm = 0, unit_mm = 1;      // x = (z - middle)/unit
  std::vector<bool> follows;              // within six standard deviations
  Eigen::VectorXd residuals_px2, sigmas_px2;
  double vertex_mm = 0;
  double At(double depth_mm) const;
  // Where it has a value: the nearer depth to `near_mm` first; nothing below its vertex.
  std::vector<double> DepthsOf(double variance_px2, double near_mm) const;
};
Parabola FitParabola(const Eigen::VectorXd& depths_mm, const Eigen::VectorXd& variances_px2,
                     const Eigen::VectorXd& errors_px2, double reading_sigma_mm);

// (zf, kappa) from a parabola for a given floor: the fit's start.
struct FocusAndRatio {
  double focus_depth_mm = 0, blur_ratio = 0;
};
std::optional<FocusAndRatio> FromParabola(const Parabola& parabola, const BlurFitSetup& setup,
                                          double reference_depth_mm, double floor_variance_px2);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_FIT_H_
