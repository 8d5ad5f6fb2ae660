#include "calib/calibrate/response_effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <string>

#include "calib/fit/frame_outliers.h"
#include "calib/fit/known_focus.h"
#include "calib/registration/scale_tracking.h"
#include "calib/response/light_exponent.h"
#include "calib/response/processing_traces.h"
#include "calib/response/response_frames.h"
#include "calib/response/weak_detail.h"
#include "calib/sweep/fixed_pattern_removal.h"
#include "calib/uncertainty/astigmatism.h"
#include "calib/uncertainty/systematic_advice.h"

namespace thicklens::calib {
namespace {

constexpr double kMinNoiseSteps = 0.6;  // noise that rounding does not hide, steps of the file
constexpr double kAgrees = 0.1;         // |ln exponent| of a curve that describes the frames
constexpr double kReachOfCurve = 3;     // standard deviations within which a usual curve is named
constexpr double kReachOfLoss = 2;      // standard deviations
constexpr double kSmoothnessOfDemosaicing = 0.45;  // of a bilinear one, the smoothest
constexpr double kMinSmoothness = 0.38;            // smaller values are reported
constexpr double kSmoothingOnRatio = 0.03;         // relative change of kappa, at most
constexpr double kMinContrastPower = 0.09;         // |ln power| that is reported
constexpr double kPowerOfSmoothing = 0.15;  // ln power that smoothing of encoded values may cause
constexpr double kDoubtfulSigmas =
    2.5;  // standard deviations at which a large power is not excluded
constexpr double kPowerToRatio = 0.15;        // relative change of kappa per |ln power|, at most
constexpr double kLargestRatioChange = 0.5;   // of kappa
constexpr double kClippingMargin = 1.0 / 64;  // of full scale, over which a clipped value spreads

BlurTask TaskWith(const BlurTask& task, const FocusSweep& sweep, FrameStore& store) {
  BlurTask other(sweep, store);
  other.frames = task.frames;
  other.reference = task.reference;
  other.scales = task.scales;
  other.scale_follows_readings = task.scale_follows_readings;
  other.law = task.law;
  other.offset_mm = task.offset_mm;
  other.scale_centre_mm = task.scale_centre_mm;
  other.reading_sigma_mm = task.reading_sigma_mm;
  other.reading_sigma_is_known = task.reading_sigma_is_known;
  other.start_focus_depth_mm = task.start_focus_depth_mm;
  other.pixel_noise = task.pixel_noise;
  other.rows_had_bands = task.rows_had_bands;
  other.columns_had_bands = task.columns_had_bands;
  other.threads = task.threads;
  other.tick = task.tick;
  return other;
}

class ResponseCheck {
 public:
  ResponseCheck(const BlurTask& task, const BlurEvidence& evidence, const BlurFitResult& fit,
                Calibration* calibration)
      : task_(task), evidence_(evidence), fit_(fit), result_(*calibration) {}

  void Run() {
    if (task_.scales.empty()) return;
    frames_ = FramesReadBy(task_.store);
    if (frames_.frames.size() < 5) return;
    size_ = task_.store.Grey(frames_.frames.front().frame).size();
    CameraResponse& response = result_.diagnostics.response;
    response.measured = true;
    response.light_exponent = MeasureLightExponent(frames_, size_);
    response.noise_rise = MeasureNoiseRise(frames_, size_, LeastNoise());
    if (response.ContradictsTransfer() && !MayBeSharpening()) {
      ReportTransfer();
    } else if (response.ContradictsTransfer() || ChangesContrast()) {
      ReportContrast();
    }
    response.weak_detail_loss = MeasureWeakDetailLoss(InTrueLight(), size_);
    response.block_grid = MeasureBlockGrid(frames_, size_);
    if (response.LosesWeakDetail() || response.IsCompressed()) ReportProcessing();
    if (response.IsSharpened()) ReportSharpening();
    if (!response.LosesWeakDetail() && !response.IsCompressed()) ReportSmoothing();
  }

 private:
  ResponseFrames FramesReadBy(FrameStore& store) const {
    ResponseFrames frames;
    frames.read_grey = [&store](std::size_t frame) { return store.Grey(frame); };
    frames.centre = centre();
    frames.psf = result_.diagnostics.blur.better_psf;
    frames.tick = task_.tick;
    const model::TransferCurve& curve = task_.sweep.camera.sensor.transfer;
    const double full_scale = FullScale();
    for (const ScaleSample& sample : task_.scales) {
      const FrameMeasurement& measured = result_.frames[sample.frame];
      if (sample.scale_is_from_reading || !measured.rejection.empty()) continue;
      ResponseFrame frame;
      frame.frame = sample.frame;
      frame.registration = sample.registration;
      frame.registration.scale = sample.scale;
      frame.variance_px2 = FittedDefocusVariance(evidence_.setup, fit_, measured.depth_mm);
      if (const FixedPatternRemoval* removal = store.correction(); removal != nullptr)
        frame.filled = removal->filled();
      if (measured.statistics.saturated_fraction > 0)
        frame.brightest =
            curve.Decode(measured.statistics.saturation_level / full_scale - kClippingMargin);
      if (measured.statistics.black_fraction > 0)
        frame.darkest =
            curve.Decode(measured.statistics.black_level / full_scale + kClippingMargin);
      frames.frames.push_back(frame);
    }
    return frames;
  }

  cv::Point2d centre() const { return RegionCentre(task_.sweep); }

  // The frames in light that is corrected for a wrong transfer, so that processing is not confused
  // with it.
  ResponseFrames InTrueLight() const {
    ResponseFrames frames = frames_;
    const CameraResponse& response = result_.diagnostics.response;
    if (!response.ContradictsTransfer()) return frames;
    const double exponent = response.light_exponent->value;
    for (ResponseFrame& frame : frames.frames) {
      if (frame.darkest >= 0) frame.darkest = std::pow(frame.darkest, exponent);
      frame.brightest = std::pow(frame.brightest, exponent);
    }
    frames.read_grey = [read = frames_.read_grey, exponent](std::size_t frame) {
      cv::Mat light;
      cv::pow(cv::max(read(frame), 0), exponent, light);
      return light;
    };
    return frames;
  }

  // The largest value of the files.
  double FullScale() const {
    return task_.store.Stored(task_.scales.front().frame).depth() == CV_8U ? 255 : 65535;
  }

  // Noise in linear light that the rounding of the file does not hide.
  double LeastNoise() {
    const FrameStatistics& typical = result_.frames[frames_.frames.front().frame].statistics;
    const double step = 1 / FullScale();
    const model::TransferCurve& curve = task_.sweep.camera.sensor.transfer;
    return kMinNoiseSteps *
           (curve.Decode(typical.mean_encoded + step) - curve.Decode(typical.mean_encoded));
  }

  // ---- transfer ----
  FocusSweep AsReadWith(const model::TransferCurve& curve) const {
    FocusSweep sweep = task_.sweep;
    sweep.camera.sensor.transfer = curve;
    return sweep;
  }

  std::optional<model::Estimate> ExponentBy(const model::TransferCurve& curve) const {
    const FocusSweep sweep = AsReadWith(curve);
    FrameStore store(sweep);
    ResponseFrames frames = FramesReadBy(store);
    const model::TransferCurve& stated = task_.sweep.camera.sensor.transfer;
    for (ResponseFrame& frame : frames.frames) {
      if (frame.darkest >= 0) frame.darkest = curve.Decode(stated.Encode(frame.darkest));
      if (frame.brightest <= 1) frame.brightest = curve.Decode(stated.Encode(frame.brightest));
    }
    return MeasureLightExponent(frames, size_);
  }

  // The curve whose light the blur conserves: a usual one, or else a power.
  std::optional<model::TransferCurve> BetterCurve() const {
    const model::TransferCurve& stated = task_.sweep.camera.sensor.transfer;
    std::optional<model::TransferCurve> best;
    double least = std::numeric_limits<double>::infinity();
    std::optional<model::Estimate> of_linear;
    for (const model::TransferCurve& curve :
         {model::TransferCurve::Linear(), model::TransferCurve::Srgb()}) {
      if (curve == stated) continue;
      const std::optional<model::Estimate> exponent = ExponentBy(curve);
      if (curve == model::TransferCurve::Linear()) of_linear = exponent;
      if (!exponent || !(exponent->value > 0)) continue;
      const double off = std::abs(std::log(exponent->value));
      if (off < std::max(kAgrees, kReachOfCurve * exponent->sigma / exponent->value) &&
          off < least) {
        least = off;
        best = curve;
      }
    }
    if (best) return best;
    if (stated == model::TransferCurve::Linear())
      of_linear = result_.diagnostics.response.light_exponent;
    if (!of_linear || !(of_linear->value > 0.1 && of_linear->value < 10)) return std::nullopt;
    return model::TransferCurve::Gamma(std::round(100 * of_linear->value) / 100);
  }

  // The blur of the frames in the light of another curve, with everything else as it was.
  std::optional<BlurFitSetup> SetupBy(const model::TransferCurve& curve) const {
    const FocusSweep sweep = AsReadWith(curve);
    FrameStore store(sweep);
    BlurEvidence evidence = MeasureBlur(TaskWith(task_, sweep, store));
    Calibration scratch = result_;
    if (evidence.setup.estimators.empty()) return std::nullopt;
    if (evidence_.axial) TakeMeanOfAxes(sweep, &evidence);
    if (RejectOutliers(sweep, &evidence, &scratch)) return std::nullopt;
    evidence.setup.floor_variance_px2 = evidence_.setup.floor_variance_px2;
    return evidence.setup;
  }

  void ReportTransfer() {
    CameraResponse& response = result_.diagnostics.response;
    const std::optional<model::TransferCurve> better = BetterCurve();
    std::string text = fmt::format(
        "the frames contradict sensor.transfer: {} of the camera file: out of focus the mean of "
        "textured parts changes against that of flat parts, although a lens spreads light and "
        "loses none. The light is the value that was read to the power {:.3g} +- {:.2g} (1 if the "
        "transfer were right); gain, black level, vignetting and clipping do not explain this",
        task_.sweep.camera.sensor.transfer.Name(), response.light_exponent->value,
        response.light_exponent->sigma);
    if (better) response.better_transfer = better->Name();
    const auto setup = better ? SetupBy(*better) : std::nullopt;
    const BlurFitResult trial =
        setup ? FitBlurWith(*setup, evidence_.known_focus, &fit_) : BlurFitResult();
    if (trial.done) {
      text += fmt::format(
          "; with transfer {} kappa is {:.4f} instead of {:.4f}, and zf moves by {:+.3f} mm",
          better->Name(), trial.values[kBlurRatio], result_.summary.blur_ratio->value,
          trial.values[kFocusDepth] - fit_.values[kFocusDepth]);
      WidenByTrials("sensor.transfer",
                    fmt::format("state transfer: {} in the camera file", better->Name()), {*setup},
                    fit_, &result_, evidence_.known_focus);
    } else {
      text += fmt::format(
          "; {}, so that the effect on kappa is unknown and the interval of kappa does not "
          "contain it",
          better ? "the blur could not be fitted with transfer " + better->Name()
                 : "no transfer that could be tried describes the frames");
    }
    // A power that is no usual curve may be local tone mapping.
    const bool is_usual = better && (*better == model::TransferCurve::Linear() ||
                                     *better == model::TransferCurve::Srgb());
    if (!is_usual) WidenByContrast();
    text += better ? fmt::format(". State transfer: {} in the camera file, use ", better->Name())
                   : ". Use ";
    text +=
        "frames whose transfer is known (raw), or measure the transfer (a camera that changes "
        "the contrast of each part of an image by itself looks the same)";
    result_.summary.warnings.push_back(text);
  }

  // ---- contrast ----
  // Whether the noise shows some sharpening, and no usual curve describes the frames. A wide
  // unsharp mask raises the noise of 4 x 4 px nearly as much as that of single pixels.
  bool MayBeSharpening() const {
    constexpr double kMinWideRise = 0.05;
    const auto& rise = result_.diagnostics.response.noise_rise;
    if (!rise ||
        !(rise->value > kMinWideRise && rise->value > CameraResponse::kSignificant * rise->sigma))
      return false;
    const std::optional<model::TransferCurve> better = BetterCurve();
    return !better ||
           !(*better == model::TransferCurve::Linear() || *better == model::TransferCurve::Srgb());
  }

  double LogPower() const {
    const auto& power = result_.diagnostics.response.light_exponent;
    return power && power->value > 0 ? std::log(power->value) : 0;
  }

  // Whether the power of the light differs from 1 by more than sharpening alone by the same filter
  // everywhere, a Gaussian filter of encoded values or demosaicing explain, though by less than a
  // wrong transfer of the usual ones makes. Sharpening that depends on the contrast and local tone
  // mapping do that.
  bool ChangesContrast() const {
    const CameraResponse& response = result_.diagnostics.response;
    const auto& power = response.light_exponent;
    if (!power || !(power->value > 0)) return false;
    const double sigma = power->sigma / power->value;
    const double off = std::abs(LogPower());
    const double rise = response.noise_rise ? std::max(0.0, response.noise_rise->value) : 0;
    const double unexplained =
        LogPower() < 0 ? off - 0.2 * rise - 0.17 * rise * rise : off - kPowerOfSmoothing;
    if (unexplained > kMinContrastPower && off > CameraResponse::kSignificant * sigma) return true;
    return unexplained > CameraResponse::kMinExponent && off > kDoubtfulSigmas * sigma;
  }

  double RatioOfContrast() const {
    return std::min(kLargestRatioChange, kPowerToRatio * std::abs(LogPower()));
  }

  void WidenByContrast() {
    const double move = RatioOfContrast() * result_.summary.blur_ratio->value;
    WidenRatio("contrast changed by the camera", {-move, move},
               "use raw frames, or switch sharpening and local tone mapping off", &result_);
  }

  void ReportContrast() {
    const model::Estimate& power = *result_.diagnostics.response.light_exponent;
    result_.summary.warnings.push_back(fmt::format(
        "the camera, or a program, changed the contrast of detail: out of focus the mean of "
        "textured parts changes against that of flat parts, by a power of the light of {:.3g} +- "
        "{:.2g} (1 for a lens alone). Sharpening that depends on the contrast and local tone "
        "mapping "
        "have this effect, and a slightly wrong sensor.transfer as well; these frames do not "
        "distinguish them. kappa may be wrong by {:.2g} %, by simulated sweeps, which the interval "
        "of kappa contains: use raw frames, or switch sharpening and local tone mapping off",
        power.value, power.sigma, 100 * RatioOfContrast()));
    WidenByContrast();
  }

  // ---- processing ----
  // Whether the frames exclude that light was read by another one of the usual curves, whose powers
  // are about 2.2 and its inverse. If they contradict the stated one, the light was corrected.
  bool IsTransferDecided() const {
    constexpr double kNearestUsual = 0.55;  // |ln power|, a little less than that of gamma-1.8
    const CameraResponse& response = result_.diagnostics.response;
    if (response.ContradictsTransfer()) return true;
    const auto& power = response.light_exponent;
    return power && power->value > 0 &&
           std::abs(std::log(power->value)) + 2 * power->sigma / power->value < kNearestUsual;
  }

  // Names another cause that a loss may have; empty: there is none.
  std::string OtherCauseOfLoss() const {
    if (IsTransferDecided()) return "";
    const auto& power = result_.diagnostics.response.light_exponent;
    return fmt::format(
        " A wrong sensor.transfer has this effect as well, and moves kappa in either direction; "
        "these frames do not exclude it ({}): state the transfer that is known of the camera",
        power ? fmt::format("power {:.2g} +- {:.2g}", power->value, power->sigma)
              : "its power could not be measured");
  }

  std::string CauseOfLoss(const std::string& grid) const {
    const CameraResponse& response = result_.diagnostics.response;
    if (response.IsCompressed())
      return "Compression is a cause: " + grid + "; noise reduction may be another";
    if (response.block_grid)
      return "Noise reduction has this effect; no blocks of a strong compression are seen";
    return "Noise reduction and compression have this effect; whether the frames show the blocks "
           "of a compression could not be measured";
  }

  void ReportProcessing() {
    const CameraResponse& response = result_.diagnostics.response;
    const model::Estimate loss = response.weak_detail_loss.value_or(model::Estimate{0, 0});
    const bool loses = response.LosesWeakDetail();
    const double kappa = result_.summary.blur_ratio->value;
    const double usual = CameraResponse::kLossToRatio * std::max(0.0, loss.value);
    // Without significance the loss may be as large as its errors allow.
    const double loss_at_most = std::max(0.0, loss.value) + (loses ? 0 : kReachOfLoss * loss.sigma);
    const double bound =
        CameraResponse::kLargestFactor * CameraResponse::kLossToRatio * loss_at_most;
    const double most = std::min(kLargestRatioChange, bound);
    const std::string grid =
        response.block_grid
            ? fmt::format(
                  "the steps at the borders of blocks of 8 x 8 px are {:.0f} % larger than "
                  "others, as compression (JPEG) makes them",
                  100 * response.block_grid->value)
            : "";
    const std::string at_most =
        bound > kLargestRatioChange
            ? fmt::format(
                  "by simulated sweeps, {:.2g} % are possible; the interval of kappa is widened by "
                  "{:.2g} % only, which is a limit of this program",
                  100 * bound, 100 * most)
            : fmt::format(
                  "at most {:.2g} %, by simulated sweeps, which the interval of kappa contains",
                  100 * most);
    std::string text;
    if (loses) {
      text = fmt::format(
          "the camera, or a program, removed weak detail: per factor e of contrast, detail loses "
          "{:.2g} +- {:.2g} % beyond what the blur takes, and a lens loses nothing. {}. This makes "
          "kappa too large, by about {:.2g} % here ({}): use frames without noise reduction "
          "(raw), in a file without loss.{}",
          100 * loss.value, 100 * loss.sigma, CauseOfLoss(grid), 100 * usual, at_most,
          OtherCauseOfLoss());
    } else {
      text = fmt::format(
          "the frames were strongly compressed: {}. Compression removes weak detail and makes "
          "kappa "
          "too large{}: use files without loss, or of a higher quality",
          grid,
          response.weak_detail_loss
              ? fmt::format(" (by the weak detail of these frames: {})", at_most)
              : ", by an amount that this target does not show and that the interval of kappa does "
                "not contain");
    }
    result_.summary.warnings.push_back(text);
    if (most > 0)
      WidenRatio("removed weak detail",
                 {-most * kappa, loses && !IsTransferDecided() ? most * kappa : 0},
                 "use frames without noise reduction and compression", &result_);
  }

  void ReportSmoothing() {
    const auto smoothness = MeasureNoiseSmoothness(frames_, size_, LeastNoise() / kMinNoiseSteps);
    if (!smoothness ||
        !(smoothness->value + CameraResponse::kSignificant * smoothness->sigma < kMinSmoothness))
      return;
    result_.summary.warnings.push_back(fmt::format(
        "the frames are smoothed: the noise of 2 x 2 px has {:.2f} +- {:.2f} of the power that "
        "that of 4 x 4 px gives, a sensor has 1, and demosaicing leaves {:.2f} or more. Noise "
        "reduction or compression does this. A filter that is the same everywhere changes the blur "
        "floor alone; one that keeps edges makes kappa too large, by up to {:.2g} % in simulated "
        "sweeps, which the interval of kappa contains: use frames without noise reduction (raw)",
        smoothness->value, smoothness->sigma, kSmoothnessOfDemosaicing, 100 * kSmoothingOnRatio));
    WidenRatio("noise reduction", {-kSmoothingOnRatio * result_.summary.blur_ratio->value, 0},
               "use frames without noise reduction", &result_);
  }

  void ReportSharpening() {
    const model::Estimate& rise = *result_.diagnostics.response.noise_rise;
    result_.summary.warnings.push_back(fmt::format(
        "the frames are sharpened: the noise of single pixels has {:.0f} +- {:.0f} % more power "
        "than that of 4 x 4 px, and only sharpening makes noise rise toward fine detail. A filter "
        "that is the same in all frames changes the blur floor and moves kappa by less than {:.1g} "
        "% (by simulated sweeps); the blur floor is that of lens and sharpening together, and a "
        "floor that was measured without sharpening does not hold",
        100 * rise.value, 100 * rise.sigma, 100 * CameraResponse::kSharpeningOnRatio));
    const double move = CameraResponse::kSharpeningOnRatio * result_.summary.blur_ratio->value;
    WidenRatio("sharpening", {-move, move}, "switch the sharpening of the camera off", &result_);
  }

  const BlurTask& task_;
  const BlurEvidence& evidence_;
  const BlurFitResult& fit_;
  Calibration& result_;
  ResponseFrames frames_;
  cv::Size size_;
};

}  // namespace

void CheckCameraResponse(const BlurTask& task, const BlurEvidence& evidence,
                         const BlurFitResult& fit, Calibration* calibration) {
  ResponseCheck(task, evidence, fit, calibration).Run();
}

}  // namespace thicklens::calib
