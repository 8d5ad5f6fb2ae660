#ifndef THICKLENS_CALIB_CALIBRATE_H_
#define THICKLENS_CALIB_CALIBRATE_H_

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_gates.h"

namespace thicklens::calib {

struct CalibrationOptions {
  GateOptions gates;
  int threads = 0;  // 0: one per core
  // Called now and then with (steps done, steps in all); false stops the run (Interrupted).
  std::function<bool(int done, int total)> progress;

  bool IsValid(std::string* why) const;
};

// A result with both kinds of error: sigma is statistical, `systematic` an interval around it.
struct Result {
  double value = 0;
  double sigma = 0;
  std::optional<Eigen::Vector2d> systematic;  // (lo, hi), absolute values
};

// What was measured on one frame. Depths are from Ap with the offset that was given or found.
struct FrameMeasurement {
  std::string image;
  double reading_mm = 0;
  double depth_mm = 0;
  FrameStatistics statistics;
  std::string rejection;             // empty: used
  double mean_edge_slope = 0;        // MES, linear grey per px
  double normalised_edge_slope = 0;  // MES over the frame's mean grey, per px
  int edge_count = 0;
  double source_blur_sigma_px = 0;    // Zhuo-Sim as the source has it
  double blur_sigma_px = 0;           // lens and defocus, pixel box and operator removed
  double blur_sigma_error_px = 0;     // its standard deviation
  bool in_blur_fit = false;           // false: outside the meter's range, or rejected
  double blur_fit_weight = 0;         // 0 to 1, of the robust loss
  std::optional<double> image_scale;  // relative to the reference frame
  bool in_scale_fit = false;
};

// The source's recipe: sharpest frame, then the mean of sigma/r_defocus. No error estimate: the
// recipe has none.
struct SourceRecipe {
  bool done = false;
  std::string message = "not run";
  int sharpest_frame = -1;  // index into frames
  double focus_depth_mm = 0;
  double image_distance_mm = 0;
  double blur_ratio = 0;  // dominated by frames near focus (the ratio diverges there)
  int ratio_frames = 0;   // frames in the mean; the sharpest has r_defocus = 0 and is left out
};

// Normalised sharpness: a parabola through the logarithm over the top of the curve.
struct SharpnessPeak {
  bool done = false;
  std::string message = "not run";
  double focus_depth_mm = 0;
  double sigma_mm = 0;
  int frames_used = 0;
  // log(index) = c0 + c1 x + c2 x^2, x = (1/z - 1/z0) z0, z0 = reference_depth_mm.
  Eigen::Vector3d log_parabola{0, 0, 0};
  double reference_depth_mm = 0;
  double from_depth_mm = 0, to_depth_mm = 0;  // the frames fitted
};

// Bench zero from the image scale: 1/scale = (offset + direction * reading)/z_reference.
struct ScaleLaw {
  bool done = false;
  std::string message = "not run";
  int reference_frame = -1;
  Result offset_mm;
  double reference_depth_mm = 0;  // z of the reference frame by the fit; scale = z_reference/z
  double reading_rms_mm = 0;      // scatter of the readings about the law
  int frames_used = 0;
};

// sigma^2 = S0 + A (1/z - 1/zf)^2, fitted by Ceres in (zf, kappa, floor); the bench zero is held
// and its error carried into the results.
struct BlurFit {
  bool done = false;
  std::string message = "not run";
  double chi2_per_dof = 0;
  int frames_used = 0;
  std::vector<std::string> undetermined;  // parameters that the data do not fix
};

enum class Outcome { kOk, kPartial, kRefused };
std::string OutcomeName(Outcome outcome);

struct Calibration {
  Outcome outcome = Outcome::kRefused;
  std::string reason = "not run";     // of anything but kOk
  std::vector<std::string> warnings;  // one line each

  std::optional<Result> image_distance_mm;
  std::optional<Result> focus_depth_mm;
  std::optional<Result> blur_ratio;
  std::optional<Result> blur_floor_px;
  std::optional<Result> bench_offset_mm;
  // Of the parameters named, in their units; sigma^2 on the diagonal.
  std::vector<std::string> covariance_order;
  Eigen::MatrixXd covariance;

  SourceRecipe source;
  SharpnessPeak sharpness;
  ScaleLaw scale;
  BlurFit blur;
  std::vector<FrameMeasurement> frames;  // in the sweep's order
  int frames_used = 0;  // in the blur fit; before there is one, those that passed the gates
  double seconds = 0;
};

// Whether a calibration can be attempted at all: frames and different readings, without opening
// any.
bool HasEnoughFrames(const FocusSweep& sweep, std::string* why);

// Runs the gates, the meters and both methods. Bad data end in a Calibration whose outcome is
// kRefused or kPartial with the reason; a wrong file or setting throws Error.
Calibration Calibrate(const FocusSweep& sweep, const CalibrationOptions& options);

// The camera with what was found, as it is written. Manufacturer's values stay as they are. With
// `use_source_recipe` its d1 and kappa are taken instead; their sigmas are 0, because
// the recipe has no error estimate, not because they are exact.
model::Camera CalibratedCamera(const model::Camera& camera, const Calibration& calibration,
                               bool use_source_recipe);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_H_
