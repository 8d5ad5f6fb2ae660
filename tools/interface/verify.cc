#include "thicklens/verify.h"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "thicklens/base/error.h"
#include "tools/interface/measured_sweep.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {

CameraVerification VerifyCamera(const Camera& stored, const Sweep& sweep,
                                const VerifyOptions& options, const RunControl& control) {
  checks::RequireValid(control);
  std::string why;
  if (!options.IsValid(&why)) throw OptionError(why.substr(0, why.find(' ')), why);
  if (!stored.calibration) {
    throw Error(fmt::format(
        "{}: calibration is missing: a camera that thicklens calibrate wrote is expected",
        stored.source.empty() ? fmt::format("camera '{}'", stored.name) : stored.source));
  }
  RunScope run(control);
  Sweep own = sweep;
  own.camera = stored;
  own.camera.calibration.reset();
  MeasuredSweep measured = MeasureSweep(own, false, &run);
  CameraVerification verification{
      calib::VerifyCalibration(stored, measured.sweep, measured.calibration, options),
      std::move(measured.calibration)};
  const std::string& of_stored = stored.calibration->evidence.data_sha256;
  if (!of_stored.empty() && measured.files != nullptr &&
      of_stored == measured.files->DataSha256()) {
    verification.verdict = calib::Verdict::kUndetermined;
    verification.reason =
        "this is the sweep that the stored calibration was made from: take a new one";
  }
  return verification;
}

}  // namespace thicklens
