#include "thicklens/calibrate.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/version.h"
#include "tools/interface/measured_sweep.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

// Why there is no camera to write; empty: there is one.
std::string RefusalOf(const calib::Calibration& found, CalibrationMethod method) {
  if (method == CalibrationMethod::kPaper) {
    const calib::SourceRecipe& recipe = found.diagnostics.paper_recipe;
    if (recipe.done) return "";
    // A sweep can be refused before the recipe begins.
    const bool was_run = recipe.message != calib::SourceRecipe().message;
    return was_run ? recipe.message : found.summary.reason;
  }
  return found.summary.outcome == calib::Outcome::kRefused ? found.summary.reason : "";
}

const std::string& MessageOf(const std::shared_ptr<const Calibration>& calibration) {
  if (calibration == nullptr) throw Error("calibration: a calibration is expected, found null");
  return calibration->refusal;
}

}  // namespace

CalibrationRefused::CalibrationRefused(std::shared_ptr<const Calibration> calibration)
    : Error(MessageOf(calibration)), calibration_(std::move(calibration)) {}
CalibrationRefused::~CalibrationRefused() = default;

Calibration Calibrate(const Sweep& sweep, const CalibrateOptions& options, const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValid(options);
  RunScope scope(run);
  MeasuredSweep measured = MeasureSweep(sweep, options.map_field, &scope);
  Calibration calibration{std::move(measured.calibration), sweep.camera, ""};
  if (measured.files != nullptr) {
    calibration.frames_read =
        std::make_shared<const std::vector<io::FilesRead>>(measured.files->Files());
  }
  calibration.camera.calibration.reset();
  calibration.refusal = RefusalOf(calibration, options.method);
  if (!calibration.refusal.empty()) {
    if (options.on_refusal == OnRefusal::kThrow) {
      throw CalibrationRefused(std::make_shared<const Calibration>(std::move(calibration)));
    }
    return calibration;
  }
  calibration.camera = calib::CalibratedCamera(sweep.camera, calibration,
                                               options.method == CalibrationMethod::kPaper);
  if (calibration.camera.calibration) {
    model::Evidence& evidence = calibration.camera.calibration->evidence;
    if (measured.files != nullptr) evidence.data_sha256 = measured.files->DataSha256();
    evidence.version = LibraryVersion();
    evidence.date = NowIso8601();
  }
  return calibration;
}

}  // namespace thicklens
