#include "thicklens/calib/error_budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

namespace thicklens::calib {
namespace {

constexpr double kTwoSided95 = 1.96;  // standard deviations
constexpr char kNoRemedy[] = "no remedy";
// Smallest outer defocus of a sweep relative to that of a point at infinity: a sweep at focus alone
// would make every error of zf infinite.
constexpr double kSmallestReach = 1e-4;

double HalfOf(const Eigen::Vector2d& interval) { return 0.5 * (interval.y() - interval.x()); }

// The standard deviation of a result that the bench offset causes, by the covariance of the fit.
// Without one it is `otherwise`.
double SigmaOfOffset(const Calibration& calibration, const std::string& name, double otherwise) {
  const std::vector<std::string>& order = calibration.diagnostics.covariance_order;
  const auto row = std::find(order.begin(), order.end(), name);
  const auto offset = std::find(order.begin(), order.end(), "bench_offset_mm");
  const Eigen::MatrixXd& covariance = calibration.diagnostics.covariance;
  if (row == order.end() || offset == order.end() ||
      covariance.rows() != static_cast<Eigen::Index>(order.size()))
    return otherwise;
  const auto i = row - order.begin(), j = offset - order.begin();
  const double variance = covariance(j, j);
  return variance > 0 ? std::abs(covariance(i, j)) / std::sqrt(variance) : 0;
}

// [D164] The root mean square of zf/z - 1 over the frames of the fit.
double ReachOf(const Calibration& calibration, double focus_depth_mm) {
  double squares = 0;
  int count = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.in_blur_fit || !(frame.depth_mm > 0)) continue;
    squares += std::pow(focus_depth_mm / frame.depth_mm - 1, 2);
    ++count;
  }
  return count == 0 ? 1 : std::max(std::sqrt(squares / count), kSmallestReach);
}

class Budget {
 public:
  explicit Budget(const Calibration& calibration) : calibration_(calibration) {
    const CalibrationSummary& summary = calibration.summary;
    const auto is_found = [](const std::optional<Result>& result) {
      return result && std::isfinite(result->value) && std::isfinite(result->sigma);
    };
    has_focus_ = is_found(summary.focus_depth_mm) && is_found(summary.image_distance_mm) &&
                 summary.focus_depth_mm->value > 0;
    has_ratio_ = is_found(summary.blur_ratio) && summary.blur_ratio->value > 0;
    if (has_focus_) reach_ = ReachOf(calibration, summary.focus_depth_mm->value);
  }

  std::vector<ErrorTerm> All() {
    if (!has_focus_ && !has_ratio_) return {};
    AddStatistical();
    for (const SystematicPart& part : calibration_.diagnostics.systematic_parts) {
      ErrorTerm term;
      term.name = part.name;
      term.focus_depth_mm = HalfOf(part.focus_depth_mm);
      term.image_distance_mm = HalfOf(part.image_distance_mm);
      term.blur_ratio = HalfOf(part.blur_ratio);
      term.remedy = part.remedy;
      Add(std::move(term));
    }
    std::stable_sort(terms_.begin(), terms_.end(),
                     [](const ErrorTerm& a, const ErrorTerm& b) { return a.effect > b.effect; });
    return std::move(terms_);
  }

 private:
  // [D164] hypot(dd1/(d1' zf e), dkappa/kappa), with d1' = |dd1/dzf|, the slope of the lens, and e
  // the reach. An error of d1 is counted as the error of zf that it would be.
  void Add(ErrorTerm term) {
    double focus = 0, ratio = 0;
    if (has_focus_) {
      const double zf_mm = calibration_.summary.focus_depth_mm->value;
      const double slope = SlopeOfDistance();
      const double moved_mm =
          std::max(term.focus_depth_mm, slope > 0 ? term.image_distance_mm / slope : 0.0);
      focus = moved_mm / (zf_mm * reach_);
    }
    if (has_ratio_) ratio = term.blur_ratio / calibration_.summary.blur_ratio->value;
    term.effect = std::hypot(focus, ratio);
    if (!std::isfinite(term.effect)) term.effect = 0;  // it cannot be compared
    terms_.push_back(std::move(term));
  }

  // |dd1/dzf| by the results themselves; 0: their errors do not show it.
  double SlopeOfDistance() const {
    const Result& zf = *calibration_.summary.focus_depth_mm;
    const Result& d1 = *calibration_.summary.image_distance_mm;
    if (zf.sigma > 0 && d1.sigma > 0) return d1.sigma / zf.sigma;
    double slope = 0;
    for (const SystematicPart& part : calibration_.diagnostics.systematic_parts) {
      if (HalfOf(part.focus_depth_mm) > 0)
        slope = std::max(slope, HalfOf(part.image_distance_mm) / HalfOf(part.focus_depth_mm));
    }
    return slope;
  }

  void AddStatistical() {
    const CalibrationSummary& summary = calibration_.summary;
    ErrorTerm noise, offset;
    noise.name = kNoiseTerm;
    noise.remedy = "take more frames, or use a finer bench scale";
    offset.name = kOffsetTerm;
    offset.remedy = RemedyOfOffset();
    noise.is_statistical = offset.is_statistical = true;
    const double zero_mm = summary.bench_offset_mm && std::isfinite(summary.bench_offset_mm->sigma)
                               ? summary.bench_offset_mm->sigma
                               : 0;
    const auto split = [](double sigma, double of_offset, double* noise_part, double* offset_part) {
      of_offset = std::min(of_offset, sigma);
      *offset_part = kTwoSided95 * of_offset;
      *noise_part = kTwoSided95 * std::sqrt(sigma * sigma - of_offset * of_offset);
    };
    if (has_focus_) {
      const double zf_sigma = summary.focus_depth_mm->sigma;
      const double d1_sigma = summary.image_distance_mm->sigma;
      // Without a covariance, zf moves as the offset does.
      const double part = zf_sigma > 0 ? std::min(zero_mm / zf_sigma, 1.0) : 0;
      const double d1_of_offset =
          zero_mm > 0 ? SigmaOfOffset(calibration_, "image_distance_mm", part * d1_sigma) : 0;
      split(d1_sigma, d1_of_offset, &noise.image_distance_mm, &offset.image_distance_mm);
      split(zf_sigma, d1_sigma > 0 ? zf_sigma * d1_of_offset / d1_sigma : 0, &noise.focus_depth_mm,
            &offset.focus_depth_mm);
    }
    if (has_ratio_)
      split(summary.blur_ratio->sigma,
            zero_mm > 0 ? SigmaOfOffset(calibration_, "blur_ratio", 0) : 0, &noise.blur_ratio,
            &offset.blur_ratio);
    Add(std::move(noise));
    if (offset.focus_depth_mm > 0 || offset.blur_ratio > 0) Add(std::move(offset));
  }

  // A statement can only be made more exactly.
  std::string RemedyOfOffset() const {
    const std::string& origin = calibration_.diagnostics.bench_offset_from;
    if (!origin.empty() && origin != "the image scale")
      return fmt::format("state {} more exactly", origin);
    return "state the magnification (by target_period_mm with a grid or ruler in view), "
           "image_distance_mm, focus_depth_mm or offset_mm; or sweep over a longer range, so that "
           "the image scale determines it better";
  }

  const Calibration& calibration_;
  bool has_focus_ = false, has_ratio_ = false;
  double reach_ = 1;
  std::vector<ErrorTerm> terms_;
};

}  // namespace

std::vector<ErrorTerm> ErrorTerms(const Calibration& calibration) {
  return Budget(calibration).All();
}

bool HasNoRemedy(const ErrorTerm& term) { return term.remedy.rfind(kNoRemedy, 0) == 0; }

std::string TermInWords(const std::string& name) {
  const bool is_key = name.find('.') != std::string::npos;
  return name == kNoiseTerm || is_key ? name : "the " + name;
}

std::string LargestErrorInWords(const std::vector<ErrorTerm>& terms) {
  double all = 0;
  for (const ErrorTerm& term : terms) all += term.effect;
  if (!(all > 0)) return "";
  const auto share = [all](const ErrorTerm& term) { return 100 * term.effect / all; };
  const ErrorTerm& largest = terms.front();
  const std::string text =
      fmt::format("{:.0f} % of the error is due to {}", share(largest), TermInWords(largest.name));
  if (!HasNoRemedy(largest)) return text + ": " + largest.remedy;
  const auto next = std::find_if(terms.begin(), terms.end(), [](const ErrorTerm& term) {
    return term.effect > 0 && !HasNoRemedy(term);
  });
  if (next == terms.end()) return text + ", which no measurement makes smaller";
  return fmt::format("{}, which no measurement makes smaller; next, {:.0f} % is due to {}: {}",
                     text, share(*next), TermInWords(next->name), next->remedy);
}

double HalfWidth(const Result& result) {
  double systematic = 0;
  if (result.systematic && result.systematic->allFinite())
    systematic = std::max(
        {0.0, result.systematic->y() - result.value, result.value - result.systematic->x()});
  return systematic + kTwoSided95 * std::max(0.0, result.sigma);
}

void CountFrames(Calibration* calibration) {
  CalibrationSummary& summary = calibration->summary;
  const bool has_fit = calibration->diagnostics.blur.done;
  summary.frames_used = summary.frames_rejected = summary.frames_left_out = 0;
  for (FrameMeasurement& frame : calibration->frames) {
    if (!frame.rejection.empty()) {
      ++summary.frames_rejected;
    } else if (!has_fit || frame.in_blur_fit) {
      ++summary.frames_used;
    } else {
      ++summary.frames_left_out;
      if (frame.not_in_fit.empty()) frame.not_in_fit = "its blur could not be measured";
    }
  }
}

}  // namespace thicklens::calib
