#ifndef THICKLENS_CALIBRATE_H_
#define THICKLENS_CALIBRATE_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/camera.h"
#include "thicklens/run.h"
#include "thicklens/sweep.h"

namespace thicklens {
namespace io {
struct FilesRead;
}

// Which of the two results becomes the camera's calibration.
enum class CalibrationMethod {
  kFit,    // joint fit of the blur of all frames, with uncertainties
  kPaper,  // the paper's recipe: the sharpest frame, then the mean of sigma/r; no uncertainty
};

// What Calibrate does with a sweep that determines no camera.
enum class OnRefusal {
  kThrow,   // it throws CalibrationRefused
  kReturn,  // it returns a Calibration with its refusal, whose camera has no calibration
};

// The options of Calibrate.
struct CalibrateOptions {
  CalibrationMethod method = CalibrationMethod::kFit;  // the result that becomes the calibration
  // Also fit tiles of the field and colour channels: tilt, curvature, focus per colour.
  bool map_field = true;
  OnRefusal on_refusal = OnRefusal::kThrow;  // what a refusal does

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The results, and the evidence behind them (thicklens/calib/calibration.h says what each is).
using CalibrationSummary = calib::CalibrationSummary;
// The evidence behind the results, in full.
using CalibrationDiagnostics = calib::CalibrationDiagnostics;

// Everything that a calibration found, with one record per frame, and the camera that has it.
struct Calibration : calib::Calibration {
  // The sweep's camera with the calibrated values and their evidence (hash of the frames, version,
  // date). Without a calibration if it was refused.
  Camera camera;
  // Why the sweep determines no camera by the chosen method, one line; empty: it does. The summary
  // has the outcome of the fit, which kPaper does not need.
  std::string refusal;
  // The facts about the frames' files (thicklens/io/files_read.h); null: they are not files.
  std::shared_ptr<const std::vector<io::FilesRead>> frames_read = nullptr;
};

// A sweep that determines no camera. The message is the reason.
class THICKLENS_EXPORT CalibrationRefused : public Error {
 public:
  // Makes the error of a refused calibration. Throws Error if it is null.
  explicit CalibrationRefused(std::shared_ptr<const Calibration> calibration);
  ~CalibrationRefused() override;
  // The findings before the refusal; valid as long as the error.
  const Calibration& calibration() const { return *calibration_; }

 private:
  std::shared_ptr<const Calibration> calibration_;
};

// Calibrates a camera from a focus sweep: image distance d1, blur ratio kappa, blur floor and bench
// offset with their covariance (the paper, section on calibration; the fit of [D56] and after). It
// is what `thicklens calibrate` does. Deterministic: the result does not depend on the number of
// threads, except the date in the evidence.
//
// A sweep that determines only some of the values gives a Calibration whose `summary.outcome` is
// kPartial and whose `summary.reason` says which are missing; nothing is thrown. Throws OptionError
// for options that are not valid, CalibrationRefused as the options say, Error for frames that
// cannot be read, and Interrupted.
THICKLENS_EXPORT Calibration Calibrate(const Sweep& sweep, const CalibrateOptions& options = {},
                                       const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_CALIBRATE_H_
