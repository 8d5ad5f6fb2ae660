#include "thicklens/calib/verification.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

constexpr char kImageDistance[] = "image_distance_mm";
constexpr char kFocusDepth[] = "focus_depth_mm";
constexpr char kBlurRatio[] = "blur_ratio";
constexpr char kFloor[] = "blur_floor_px";
constexpr char kOffset[] = "bench_offset_mm";

// Standard normal deviate that is exceeded in 5 % of the cases: a change is found in the other 95
// %.
constexpr double kPower95 = 1.645;

// Returns the covariance of two parameters that a calibration names; 0 if it does not name both.
double CovarianceOf(const std::vector<std::string>& order, const Eigen::MatrixXd& covariance,
                    const std::string& a, const std::string& b) {
  const auto place = [&](const std::string& name) {
    return static_cast<Eigen::Index>(std::find(order.begin(), order.end(), name) - order.begin());
  };
  const Eigen::Index i = place(a), j = place(b);
  return i < covariance.rows() && j < covariance.cols() ? covariance(i, j) : 0.0;
}

// Standard deviation of an even distribution over the interval.
double SpreadOf(const Eigen::Vector2d& interval) {
  return (interval.y() - interval.x()) / std::sqrt(12.0);
}

// A part that the numbers of the camera file cause moves both calibrations alike.
bool IsOfCameraFile(const SystematicPart& part) {
  return part.name.rfind("lens.", 0) == 0 || part.name.rfind("sensor.", 0) == 0;
}

class Verifier {
 public:
  Verifier(const model::Camera& stored, const FocusSweep& sweep, const Calibration& found,
           const VerificationOptions& options)
      : camera_(stored),
        stored_(*stored.calibration),
        sweep_(sweep),
        found_(found),
        options_(options) {}

  Verification Run() {
    TakeParameters();
    CountJointly();
    WarnOfExactValues();
    WarnOfBenchOffset();
    Decide();
    return result_;
  }

 private:
  double Systematic(Eigen::Vector2d SystematicPart::*interval) const {
    double variance = 0;
    for (const SystematicPart& part : found_.diagnostics.systematic_parts) {
      if (!IsOfCameraFile(part)) variance += std::pow(SpreadOf(part.*interval), 2);
    }
    return std::sqrt(variance);
  }

  // `why_not` is empty if the parameter is to be counted.
  void Take(const char* name, const std::optional<model::Estimate>& stored,
            const std::optional<Result>& found, double systematic, const std::string& why_not) {
    if (!stored || !found || !std::isfinite(found->value)) return;
    ComparedParameter parameter;
    parameter.name = name;
    parameter.stored = *stored;
    parameter.found = {found->value, found->sigma};
    parameter.difference = found->value - stored->value;
    parameter.systematic_sigma = systematic;
    parameter.sigma = std::sqrt(stored->sigma * stored->sigma + found->sigma * found->sigma +
                                systematic * systematic);
    parameter.counted = why_not.empty() && parameter.sigma > 0;
    parameter.why_not_counted =
        why_not.empty() && !parameter.counted ? "neither value states an error" : why_not;
    result_.parameters.push_back(parameter);
  }

  bool IsFixed(const char* name) const {
    const std::vector<std::string>& open = found_.diagnostics.blur.undetermined;
    return std::find(open.begin(), open.end(), name) == open.end();
  }

  // Whether a statement gives the plane of focus, so that the sweep does not measure d1.
  bool FocusIsStated() const {
    const std::string& origin = found_.diagnostics.bench_offset_from;
    return !origin.empty() && origin != kFromScale && origin != kFromOffset;
  }

  std::optional<model::Estimate> StoredFocusDepth() const {
    if (!stored_.image_distance_mm) return std::nullopt;
    const double zf = camera_.focus_depth_mm();
    if (!std::isfinite(zf)) return std::nullopt;
    const double slope = model::ImageDistanceSlope(camera_.lens, zf);
    return model::Estimate{zf, stored_.image_distance_mm->sigma / std::abs(slope)};
  }

  void TakeParameters() {
    if (found_.summary.outcome == Outcome::kRefused) return;
    const std::string open = "the sweep does not determine it";
    const std::string of_focus = FocusIsStated()
                                     ? fmt::format("it follows from {}, which is stated",
                                                   found_.diagnostics.bench_offset_from)
                                     : std::string();
    Take(kImageDistance, stored_.image_distance_mm, found_.summary.image_distance_mm,
         Systematic(&SystematicPart::image_distance_mm), IsFixed(kImageDistance) ? of_focus : open);
    Take(kFocusDepth, StoredFocusDepth(), found_.summary.focus_depth_mm,
         Systematic(&SystematicPart::focus_depth_mm), "it follows from image_distance_mm");
    Take(kBlurRatio, stored_.blur_ratio, found_.summary.blur_ratio,
         Systematic(&SystematicPart::blur_ratio), IsFixed(kBlurRatio) ? "" : open);
    const bool floor_is_stated = sweep_.floor.given_px || sweep_.floor.from_px;
    Take(kFloor, stored_.blur_floor_px, found_.summary.blur_floor_px, 0,
         !IsFixed(kFloor)  ? open
         : floor_is_stated ? "the sweep states it and does not measure it"
                           : "");
    Take(kOffset, stored_.bench_offset_mm, found_.summary.bench_offset_mm, 0,
         sweep_.offset_mm ? "the sweep states it and does not measure it"
         : options_.same_bench
             ? ""
             : "it describes the position of the camera on the bench, which may have changed");
  }

  std::vector<ComparedParameter*> Counted() {
    std::vector<ComparedParameter*> counted;
    for (ComparedParameter& parameter : result_.parameters) {
      if (parameter.counted) counted.push_back(&parameter);
    }
    return counted;
  }

  // [D90] chi^2 = d^T C^-1 d with C = C_stored + C_found + systematic variances, in units of the
  // sigmas of the differences.
  void CountJointly() {
    const std::vector<ComparedParameter*> counted = Counted();
    const auto count = static_cast<Eigen::Index>(counted.size());
    if (count == 0) return;
    Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(count, count);
    Eigen::VectorXd deviation(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const ComparedParameter& a = *counted[static_cast<std::size_t>(i)];
      deviation[i] = a.deviation();
      for (Eigen::Index j = 0; j < i; ++j) {
        const ComparedParameter& b = *counted[static_cast<std::size_t>(j)];
        const double covariance =
            CovarianceOf(stored_.covariance_order, stored_.covariance, a.name, b.name) +
            CovarianceOf(found_.diagnostics.covariance_order, found_.diagnostics.covariance, a.name,
                         b.name);
        correlation(i, j) = correlation(j, i) = covariance / (a.sigma * b.sigma);
      }
    }
    Eigen::LLT<Eigen::MatrixXd> factor(correlation);
    if (factor.info() != Eigen::Success) {
      result_.warnings.emplace_back(
          "the sum of the covariance matrices of the stored and the new calibration is not "
          "positive definite: the parameters are treated as independent");
      factor.compute(Eigen::MatrixXd::Identity(count, count));
    }
    result_.degrees_of_freedom = static_cast<int>(count);
    result_.chi_square = deviation.dot(factor.solve(deviation));
    result_.p_value = ChiSquareTail(result_.chi_square, result_.degrees_of_freedom);
    const Eigen::MatrixXd information = factor.solve(Eigen::MatrixXd::Identity(count, count));
    const double needed =
        std::sqrt(ChiSquareExceeded(options_.significance, result_.degrees_of_freedom)) + kPower95;
    for (Eigen::Index i = 0; i < count; ++i) {
      ComparedParameter& parameter = *counted[static_cast<std::size_t>(i)];
      parameter.smallest_detectable = needed * parameter.sigma / std::sqrt(information(i, i));
    }
  }

  const ComparedParameter* Find(const char* name) const {
    for (const ComparedParameter& parameter : result_.parameters) {
      if (parameter.name == name) return &parameter;
    }
    return nullptr;
  }

  void WarnOfExactValues() {
    std::string names;
    for (const ComparedParameter& parameter : result_.parameters) {
      if (!parameter.counted || parameter.stored.sigma > 0) continue;
      names += (names.empty() ? "" : ", ") + parameter.name;
    }
    if (names.empty()) return;
    result_.warnings.push_back(
        fmt::format("the stored calibration (method '{}') states no error of {}: these values are "
                    "treated as exact",
                    stored_.evidence.method, names));
  }

  // An error of the bench offset moves all depths, including zf.
  void WarnOfBenchOffset() {
    const ComparedParameter* focus = Find(kFocusDepth);
    if (focus == nullptr || sweep_.offset_mm || FocusIsStated() || !found_.summary.bench_offset_mm)
      return;
    const double offset_sigma = found_.summary.bench_offset_mm->sigma;
    const double covariance = CovarianceOf(found_.diagnostics.covariance_order,
                                           found_.diagnostics.covariance, kImageDistance, kOffset);
    const double d1_sigma =
        found_.summary.image_distance_mm ? found_.summary.image_distance_mm->sigma : 0;
    if (!(offset_sigma > 0) || !(d1_sigma > 0)) return;
    result_.warnings.push_back(fmt::format(
        "the bench offset is not stated, and the sweep determines it to +- {:.3g} mm only: the "
        "error of zf is therefore +- {:.3g} mm (correlation of d1 and bench offset {:.2f}){}",
        offset_sigma, focus->found.sigma, covariance / (d1_sigma * offset_sigma),
        options_.same_bench ? "; the stored bench offset is compared, too"
                            : "; if the camera has not moved on the bench (same_bench), or if "
                              "offset_mm is measured, a smaller change can be detected"));
  }

  // A change of d1 adds to the blur sigma(z) = kappa r |c(z)|/p, where
  // c(z) = f1 D/(f2 z) - (D - f2)/f2, so that d c/d d1 = -(1 - f1/z)/f2; derived here [D89],
  // evaluated at z = zf.
  double BlurPxOf(double d1_change_mm, double blur_ratio) const {
    const model::ThickLens& lens = camera_.lens;
    const double zf = camera_.focus_depth_mm();
    return blur_ratio * lens.aperture_radius_mm * std::abs(d1_change_mm) *
           std::abs(1 - lens.front_focal_length_mm / zf) /
           (lens.rear_focal_length_mm * camera_.sensor.pixel_pitch_mm);
  }

  void Decide() {
    if (found_.summary.outcome == Outcome::kRefused) {
      result_.reason = "the new sweep gives no calibration: " + found_.summary.reason;
      return;
    }
    const ComparedParameter* d1 = Find(kImageDistance);
    if (result_.degrees_of_freedom == 0) {
      result_.reason = "the stored and the new calibration have no parameter in common";
      return;
    }
    double kappa = 0;
    if (stored_.blur_ratio) {
      kappa = stored_.blur_ratio->value;
    } else if (found_.summary.blur_ratio) {
      kappa = found_.summary.blur_ratio->value;
    }
    if (d1 != nullptr && d1->counted) {
      result_.detectable_blur_px = BlurPxOf(d1->smallest_detectable, kappa);
    }
    if (result_.p_value < options_.significance) {
      result_.verdict = Verdict::kDoesNotHold;
      result_.reason = fmt::format(
          "chi-square {:.1f} for {} parameter(s), which chance exceeds with a probability of "
          "{:.2g}: {}",
          result_.chi_square, result_.degrees_of_freedom, result_.p_value, Deviations());
      return;
    }
    const std::string too_coarse = TooCoarse(d1, Find(kBlurRatio));
    if (!too_coarse.empty()) {
      result_.reason = too_coarse;
      return;
    }
    result_.verdict = Verdict::kHolds;
    result_.reason.clear();
  }

  std::string Deviations() const {
    std::string text;
    for (const ComparedParameter& parameter : result_.parameters) {
      if (!parameter.counted) continue;
      text += fmt::format("{}{} {:.7g}, stored {:.7g} ({:+.1f} sigma)", text.empty() ? "" : ", ",
                          parameter.name, parameter.found.value, parameter.stored.value,
                          parameter.deviation());
    }
    return text;
  }

  // Returns the reason why agreement would prove nothing; empty if it is meaningful.
  std::string TooCoarse(const ComparedParameter* d1, const ComparedParameter* kappa) const {
    if (d1 != nullptr && FocusIsStated()) {
      return fmt::format(
          "the sweep does not measure image_distance_mm, the main parameter of a calibration: it "
          "follows from {}, which is stated",
          found_.diagnostics.bench_offset_from);
    }
    if (d1 == nullptr || !d1->counted) {
      return "the sweep does not determine image_distance_mm, the main parameter of a calibration";
    }
    if (!(result_.detectable_blur_px <= options_.needed_blur_px)) {
      return fmt::format(
          "the calibrations agree, but only a change of image_distance_mm of {:.3g} mm or more "
          "could be detected, which changes sigma of the blur by {:.3g} px; a change of {:g} px "
          "must be detectable: take more frames, on both sides of focus",
          d1->smallest_detectable, result_.detectable_blur_px, options_.needed_blur_px);
    }
    if (kappa != nullptr && kappa->counted &&
        !(kappa->smallest_detectable <= options_.needed_blur_ratio * kappa->stored.value)) {
      return fmt::format(
          "the calibrations agree, but only a change of blur_ratio of {:.3g} or more could be "
          "detected; a change of {:.3g} ({:g} %) must be detectable: take frames farther from "
          "focus",
          kappa->smallest_detectable, options_.needed_blur_ratio * kappa->stored.value,
          100 * options_.needed_blur_ratio);
    }
    return "";
  }

  const model::Camera& camera_;
  const model::CameraCalibration& stored_;
  const FocusSweep& sweep_;
  const Calibration& found_;
  const VerificationOptions& options_;
  Verification result_;
};

}  // namespace

bool VerificationOptions::IsValid(std::string* why) const {
  const auto fails = [why](const char* name, double value, const char* range) {
    return Fail(why, fmt::format("{} is {}: it must be {}", name, value, range));
  };
  if (!(significance > 0 && significance < 1)) {
    return fails("significance", significance, "above 0 and below 1");
  }
  const std::pair<const char*, double> changes[] = {{"needed_blur_px", needed_blur_px},
                                                    {"needed_blur_ratio", needed_blur_ratio}};
  for (const auto& [name, value] : changes) {
    if (!(value > 0 && std::isfinite(value))) return fails(name, value, "finite and above 0");
  }
  return true;
}

double ComparedParameter::deviation() const { return sigma > 0 ? difference / sigma : 0; }

std::string VerdictName(Verdict verdict) {
  if (verdict == Verdict::kHolds) return "holds";
  return verdict == Verdict::kDoesNotHold ? "does-not-hold" : "cannot-tell";
}

Verification VerifyCalibration(const model::Camera& stored, const FocusSweep& sweep,
                               const Calibration& found, const VerificationOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error(why);
  if (!stored.calibration) {
    throw Error(
        fmt::format("camera '{}' has no calibration to verify: calibrate it first", stored.name));
  }
  return Verifier(stored, sweep, found, options).Run();
}

// [L10] Q(1) = erfc(sqrt(x/2)), Q(2) = exp(-x/2),
// Q(n + 2) = Q(n) + (x/2)^(n/2) exp(-x/2)/Gamma(n/2 + 1).
double ChiSquareTail(double x, int degrees_of_freedom) {
  if (!(x > 0)) return 1;
  const double half = x / 2;
  int n = degrees_of_freedom % 2 == 0 ? 2 : 1;
  double tail = n == 2 ? std::exp(-half) : std::erfc(std::sqrt(half));
  for (; n < degrees_of_freedom; n += 2) {
    tail += std::exp(n / 2.0 * std::log(half) - half - std::lgamma(n / 2.0 + 1));
  }
  return std::min(tail, 1.0);
}

double ChiSquareExceeded(double p, int degrees_of_freedom) {
  double low = 0, high = 1;
  while (ChiSquareTail(high, degrees_of_freedom) > p && high < 1e6) high *= 2;
  for (int i = 0; i < 200 && high - low > 1e-12 * high; ++i) {
    const double middle = (low + high) / 2;
    (ChiSquareTail(middle, degrees_of_freedom) > p ? low : high) = middle;
  }
  return high;
}

}  // namespace thicklens::calib
