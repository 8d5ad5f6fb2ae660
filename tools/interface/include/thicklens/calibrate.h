#ifndef THICKLENS_CALIBRATE_H_
#define THICKLENS_CALIBRATE_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/camera.h"
#include "thicklens/export.h"
#include "thicklens/run.h"
#include "thicklens/sweep.h"

namespace thicklens {

enum class CalibrationMethod {
  kFit,    // joint fit of the blur of all frames, with uncertainties
  kPaper,  // the paper's recipe: the sharpest frame, then the mean of sigma/r; no uncertainty
};

// What Calibrate does with a sweep that determines no camera.
enum class OnRefusal {
  kThrow,   // it throws CalibrationRefused
  kReturn,  // it returns a Calibration whose camera has no calibration; look at the summary
};

struct CalibrateOptions {
  CalibrationMethod method = CalibrationMethod::kFit;
  // Also fit tiles of the field and colour channels: tilt, curvature, focus per colour.
  bool map_field = true;
  OnRefusal on_refusal = OnRefusal::kThrow;

  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The result of a calibration for people and programs: what was found, and whether it can be used.
struct CalibrationSummary {
  calib::Outcome outcome = calib::Outcome::kRefused;  // kOk, kPartial or kRefused
  std::string reason = "not run";                     // of an outcome other than kOk
  std::vector<std::string> warnings;                  // one line each
  // Values with statistical sigma and systematic interval; absent: not determined.
  std::optional<calib::Result> image_distance_mm;  // d1, from Ap to the sensor
  std::optional<calib::Result> focus_depth_mm;     // zf, from Ap toward the scene [S13]
  std::optional<calib::Result> blur_ratio;         // kappa, dimensionless
  std::optional<calib::Result> blur_floor_px;      // sigma of the lens floor
  std::optional<calib::Result> bench_offset_mm;    // depth of reading 0 from Ap
  double chi2_per_dof = 0;                         // of the blur fit; 0: there is none
  int frames_used = 0, frames_rejected = 0;
  double seconds = 0;

  // One line: outcome, d1, zf and kappa with their sigmas, frames, time.
  THICKLENS_EXPORT std::string BriefReport() const;
};

// Evidence behind the result: intermediate results, alternatives, causes (calib/calibration.h says
// what each one is).
struct CalibrationDiagnostics {
  std::vector<std::string> covariance_order;
  Eigen::MatrixXd covariance;
  calib::SharpestReading sharpest;
  std::optional<Measured> focus_reading_mm;
  std::vector<calib::Diagnosis> diagnoses;
  calib::FrameStructureFinding structure;
  calib::SourceRecipe paper_recipe;
  calib::SharpnessPeak sharpness;
  calib::ScaleModel scale;
  calib::BlurFit blur;
  calib::SideFit nearer, farther;
  calib::FieldMap field;
  std::vector<calib::ChannelFocus> channels;
  std::optional<calib::MagnificationCheck> magnification;
  std::vector<calib::SystematicPart> systematic_parts;
  std::string advice;
};

struct Calibration {
  // The sweep's camera with the calibrated values and their evidence (hash of the frames, version,
  // date). Without a calibration if the outcome is kRefused.
  Camera camera;
  CalibrationSummary summary;
  CalibrationDiagnostics diagnostics;
  std::vector<calib::FrameMeasurement> frames;  // one record per frame, in the sweep's order
  std::vector<calib::BlurExample> examples;     // blur of three frames, for plots
};

// A sweep that determines no camera. The message is the reason.
class THICKLENS_EXPORT CalibrationRefused : public Error {
 public:
  explicit CalibrationRefused(std::shared_ptr<const Calibration> calibration);
  ~CalibrationRefused() override;
  const Calibration& calibration() const { return *calibration_; }

 private:
  std::shared_ptr<const Calibration> calibration_;
};

// Calibrates a camera from a focus sweep: image distance d1, blur ratio kappa, blur floor and bench
// offset with their covariance (the paper, section on calibration; the fit of [D56] and after). It
// is what `thicklens calibrate` does. Deterministic: the result does not depend on the number of
// threads, except the date in the evidence.
//
// Throws OptionError for options that are not valid, CalibrationRefused as the options say, Error
// for frames that cannot be read, and Interrupted.
THICKLENS_EXPORT Calibration Calibrate(const Sweep& sweep, const CalibrateOptions& options,
                                       const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_CALIBRATE_H_
