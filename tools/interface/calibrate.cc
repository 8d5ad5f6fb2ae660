#include "thicklens/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <utility>

#include "thicklens/base/utc_time.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/opencv.h"
#include "thicklens/version.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

ChannelOrder OwnOrder(const Image& image) { return image.order(); }

// Why there is no camera to write; empty: there is one.
std::string RefusalOf(const calib::Calibration& found, CalibrationMethod method) {
  if (method == CalibrationMethod::kPaper) return found.source.done ? "" : found.source.message;
  return found.outcome == calib::Outcome::kRefused ? found.reason : "";
}

Calibration Split(calib::Calibration found) {
  Calibration split;
  CalibrationSummary& summary = split.summary;
  summary.outcome = found.outcome;
  summary.reason = found.reason;
  summary.warnings = found.warnings;
  summary.image_distance_mm = found.image_distance_mm;
  summary.focus_depth_mm = found.focus_depth_mm;
  summary.blur_ratio = found.blur_ratio;
  summary.blur_floor_px = found.blur_floor_px;
  summary.bench_offset_mm = found.bench_offset_mm;
  summary.chi2_per_dof = found.blur.chi2_per_dof;
  summary.frames_used = found.frames_used;
  summary.frames_rejected =
      static_cast<int>(std::count_if(found.frames.begin(), found.frames.end(),
                                     [](const auto& frame) { return !frame.rejection.empty(); }));
  summary.seconds = found.seconds;
  CalibrationDiagnostics& more = split.diagnostics;
  more.covariance_order = std::move(found.covariance_order);
  more.covariance = std::move(found.covariance);
  more.sharpest = std::move(found.sharpest);
  more.focus_reading_mm = found.focus_reading_mm;
  more.diagnoses = std::move(found.diagnoses);
  more.structure = found.structure;
  more.paper_recipe = std::move(found.source);
  more.sharpness = std::move(found.sharpness);
  more.scale = std::move(found.scale);
  more.blur = std::move(found.blur);
  more.nearer = std::move(found.nearer);
  more.farther = std::move(found.farther);
  more.field = std::move(found.field);
  more.channels = std::move(found.channels);
  more.magnification = found.magnification;
  more.systematic_parts = std::move(found.systematic_parts);
  more.advice = std::move(found.advice);
  split.frames = std::move(found.frames);
  split.examples = std::move(found.examples);
  return split;
}

}  // namespace

CalibrationRefused::CalibrationRefused(std::shared_ptr<const Calibration> calibration)
    : Error(calibration->summary.reason), calibration_(std::move(calibration)) {}
CalibrationRefused::~CalibrationRefused() = default;

Calibration Calibrate(const Sweep& sweep, const CalibrateOptions& options, const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValid(options);
  RunScope scope(run);
  for (const std::string& notice : sweep.notices) scope.Warn(notice);
  for (const std::string& notice : sweep.camera.notices) scope.Warn(notice);
  const std::vector<std::string> assumed = model::AssumedFields(sweep.camera);
  if (!assumed.empty()) {
    scope.Warn(fmt::format("camera '{}': assumed, neither published nor measured: {}",
                           sweep.camera.name, fmt::join(assumed, ", ")));
  }
  calib::FocusSweep focus_sweep = calib::MakeFocusSweep(sweep.description, sweep.camera);
  std::shared_ptr<io::FrameFiles> files;
  if (sweep.frames == nullptr) {
    files = std::make_shared<io::FrameFiles>(sweep.description.frames);
    focus_sweep.read_frame = [files](std::size_t i) { return files->Read(i); };
  } else {
    focus_sweep.read_frame = [frames = sweep.frames](std::size_t i) {
      const Image image = frames->Read(i);
      return MatFromImage(image, OwnOrder(image));
    };
  }
  calib::CalibrationOptions settings;
  settings.map_field = options.map_field;
  settings.threads = run.threads;
  settings.progress = [progress = scope.ProgressOf("measuring"), token = CurrentCancelToken()](
                          int done, int total) {
    progress(done, total);
    return token == nullptr || !token->IsCancelled();
  };
  const calib::Calibration found = calib::Calibrate(focus_sweep, settings);
  ThrowIfCancelled();
  const std::string refusal = RefusalOf(found, options.method);
  Calibration calibration = Split(found);
  calibration.camera = sweep.camera;
  calibration.camera.calibration.reset();
  if (!refusal.empty()) {
    calibration.summary.outcome = calib::Outcome::kRefused;
    calibration.summary.reason = refusal;
    if (options.on_refusal == OnRefusal::kThrow) {
      throw CalibrationRefused(std::make_shared<const Calibration>(std::move(calibration)));
    }
    return calibration;
  }
  calibration.camera =
      calib::CalibratedCamera(sweep.camera, found, options.method == CalibrationMethod::kPaper);
  if (calibration.camera.calibration) {
    model::Evidence& evidence = calibration.camera.calibration->evidence;
    if (files != nullptr) evidence.data_sha256 = files->DataSha256();
    evidence.version = LibraryVersion();
    evidence.date = NowIso8601();
  }
  return calibration;
}

std::string CalibrationSummary::BriefReport() const {
  const auto number = [](const char* name, const std::optional<calib::Result>& value,
                         const char* unit) {
    return value ? fmt::format("{} {:.6g} +- {:.2g}{}", name, value->value, value->sigma, unit)
                 : fmt::format("{} not determined", name);
  };
  std::string text =
      fmt::format("calibration {}: {}, {}, {}; {} frames used, {} rejected, {:.1f} s",
                  calib::OutcomeName(outcome), number("d1", image_distance_mm, " mm"),
                  number("zf", focus_depth_mm, " mm"), number("kappa", blur_ratio, ""), frames_used,
                  frames_rejected, seconds);
  if (outcome != calib::Outcome::kOk) text += "; " + reason;
  return text;
}

}  // namespace thicklens
