#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/registration/cancel_callback.h"
#include "calib/registration/image_scale.h"
#include "calib/registration/radial_distortion.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSamples = 5;
// A law holds if this part of the frames follows it; a fifth may be wrong.
constexpr double kMinFollowing = 0.75;
// A frame follows a law within this part of the range of the readings, or within that many standard
// deviations.
constexpr double kFollowsWithin = 0.03;
constexpr double kFollowsSigmas = 5;
constexpr double kSortedWithin = 0.01, kSortedFollowing = 0.9;
// Maximum scatter of the readings, relative to the stated error.
constexpr double kStatedScatter = 1.5;
// A scale that changes by less than this over the sweep is constant, unless a target within the
// longest bench would explain the change.
constexpr double kConstantChange = 1e-3;
constexpr double kLongestBenchMm = 1e4;
// A change over the sweep below which scatter about the law is that of the registrations.
constexpr double kSmallChange = 0.02;
constexpr double kSignificant = 4;
// Common error of the registrations from one end of a sweep to the other, measured on simulated
// sweeps of known scale.
constexpr double kScaleBias = 3e-5;
// Effect of a distortion on the scale of an affine map, as a part of its change of the image height
// at the corner. The tiles do not reach the corner.
constexpr double kScalePerCornerDistortion = 0.4;
constexpr double kLikelyDistortion = 0.02;  // maximum assumed distortion at the corner
// Sigma at the corner below which even a zero distortion is stated.
constexpr double kKnownDistortion = 0.01;
constexpr int kBlocks = 8;  // blocks of the jackknife

// 1/scale = (offset + sign reading)/reference_depth.
struct Law {
  double offset_mm = 0;
  double reference_depth_mm = 0;
};

struct Point {
  double reading_mm, inverse_scale;
  double inverse_scale_sigma;
};
using Points = std::vector<Point>;

Points PointsOf(const std::vector<ScaleSample>& samples) {
  Points points;
  for (const ScaleSample& s : samples) {
    points.push_back({s.reading_mm, 1 / s.scale, s.registration.scale_sigma / (s.scale * s.scale)});
  }
  return points;
}

// reading = sign (z_reference/scale - offset). The readings carry most of the error, and the error
// of the scale is converted to an error of the reading.
double ReadingError(const Point& p, const Law& law, double sign) {
  return p.reading_mm - sign * (law.reference_depth_mm * p.inverse_scale - law.offset_mm);
}

// sqrt(reading_sigma^2 + (z_reference sigma(1/scale))^2), mm.
double ReadingSigma(const Point& p, const Law& law, double reading_sigma_mm) {
  return std::max(std::hypot(reading_sigma_mm, law.reference_depth_mm * p.inverse_scale_sigma),
                  1e-6);
}

struct ReadingResidual {
  double reading_mm, inverse_scale, sign, sigma_mm;

  template <typename T>
  bool operator()(const T* offset_mm, const T* reference_depth_mm, T* residual) const {
    const T predicted = sign * (reference_depth_mm[0] * inverse_scale - offset_mm[0]);
    residual[0] = (predicted - reading_mm) / sigma_mm;
    return true;
  }
};

std::optional<Law> SolveLaw(const Points& points, double sign, double reading_sigma_mm,
                            const Law& start, Eigen::Matrix2d* covariance) {
  Law law = start;
  ceres::Problem problem;
  for (const Point& p : points) {
    const double sigma_mm = ReadingSigma(p, start, reading_sigma_mm);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ReadingResidual, 1, 1, 1>(
            new ReadingResidual{p.reading_mm, p.inverse_scale, sign, sigma_mm}),
        new ceres::CauchyLoss(3), &law.offset_mm, &law.reference_depth_mm);
  }
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  SolveOrStop(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return std::nullopt;
  if (covariance != nullptr) {
    ceres::Covariance::Options covariance_options;
    covariance_options.algorithm_type = ceres::DENSE_SVD;
    ceres::Covariance estimate(covariance_options);
    const std::vector<const double*> parameters = {&law.offset_mm, &law.reference_depth_mm};
    if (!estimate.Compute(parameters, &problem)) return std::nullopt;
    Eigen::Matrix<double, 2, 2, Eigen::RowMajor> matrix;
    estimate.GetCovarianceMatrix(parameters, matrix.data());
    *covariance = matrix;
  }
  return law;
}

// The straight line 1/scale = intercept + slope reading by repeated medians (Siegel 1982) [L7]. Up
// to half of the points may be wrong by any amount.
struct Line {
  double intercept = 0, slope = 0;
  double slope_sigma = 0;  // from the scatter about the line, at least the stated errors
};

Line FitLine(const Points& points, double reading_sigma_mm) {
  Line line;
  std::vector<double> slopes;
  for (const Point& a : points) {
    std::vector<double> from_here;
    for (const Point& b : points) {
      if (a.reading_mm != b.reading_mm) {
        from_here.push_back((a.inverse_scale - b.inverse_scale) / (a.reading_mm - b.reading_mm));
      }
    }
    if (!from_here.empty()) slopes.push_back(Median(from_here));
  }
  line.slope = Median(slopes);
  std::vector<double> intercepts, errors, readings, distances, stated;
  for (const Point& p : points) intercepts.push_back(p.inverse_scale - line.slope * p.reading_mm);
  line.intercept = Median(intercepts);
  for (const double i : intercepts) errors.push_back(std::abs(i - line.intercept));
  for (const Point& p : points) readings.push_back(p.reading_mm);
  const double middle_mm = Median(readings);
  for (const Point& p : points) {
    distances.push_back(std::abs(p.reading_mm - middle_mm));
    stated.push_back(std::hypot(p.inverse_scale_sigma, line.slope * reading_sigma_mm));
  }
  const double scatter = std::max(1.4826 * Median(errors), Median(stated));
  const double spread_mm = 1.4826 * Median(distances);  // robust against a wrong reading
  // A repeated median is 1.25 times as uncertain as least squares.
  line.slope_sigma =
      1.25 * scatter / std::max(spread_mm, 1e-12) / std::sqrt(static_cast<double>(points.size()));
  return line;
}

// The range of the readings, extrapolated from the inner part without a tenth at each end. Outliers
// therefore do not affect it.
double RobustRange(const Points& points) {
  std::vector<double> readings;
  for (const Point& p : points) readings.push_back(p.reading_mm);
  std::sort(readings.begin(), readings.end());
  const std::size_t cut = readings.size() / 10;
  const auto kept = static_cast<double>(readings.size() - 1 - 2 * cut);
  return (readings[readings.size() - 1 - cut] - readings[cut]) *
         static_cast<double>(readings.size() - 1) / kept;
}

// Leaves out one run of neighbouring readings after the other. Errors that neighbours share (a
// scale that is not quite linear, a lens that distorts) appear as changes of the result.
double JackknifeSigma(Points points, double sign, double reading_sigma_mm, const Law& law) {
  const int n = static_cast<int>(points.size());
  const int blocks = std::min(kBlocks, n / 2);
  if (blocks < 4) return 0;
  std::sort(points.begin(), points.end(),
            [](const Point& a, const Point& b) { return a.reading_mm < b.reading_mm; });
  std::vector<double> offsets;
  for (int block = 0; block < blocks; ++block) {
    Points rest;
    for (int i = 0; i < n; ++i) {
      if (i * blocks / n != block) rest.push_back(points[static_cast<std::size_t>(i)]);
    }
    const std::optional<Law> without = SolveLaw(rest, sign, reading_sigma_mm, law, nullptr);
    if (without) offsets.push_back(without->offset_mm);
  }
  double mean = 0, sum = 0;
  const auto count = static_cast<double>(offsets.size());
  for (const double offset : offsets) mean += offset / count;
  for (const double offset : offsets) sum += (offset - mean) * (offset - mean);
  return std::sqrt((count - 1) / count * sum);
}

// The error of the readings that explains the size of the law's residuals, at least the stated
// error.
double ScatterOfReadings(const Points& points, const Law& law, double sign,
                         double reading_sigma_mm) {
  std::vector<double> errors, from_scale;
  for (const Point& p : points) {
    errors.push_back(std::abs(ReadingError(p, law, sign)));
    from_scale.push_back(law.reference_depth_mm * p.inverse_scale_sigma);
  }
  const double scatter_mm = 1.4826 * Median(errors);
  const double scale_mm = Median(from_scale);
  const double rest = scatter_mm * scatter_mm - scale_mm * scale_mm;
  return std::max({reading_sigma_mm, std::sqrt(std::max(0.0, rest)), 1e-6});
}

// Effect of an unknown remainder of distortion on the offset: the difference between the scales
// with and without it.
double DistortionSigma(const Points& points, double sign, double reading_sigma_mm, const Law& law,
                       double corner_sigma) {
  Points bent = points;
  for (Point& p : bent) {
    const double scale = 1 / p.inverse_scale;
    const double change = kScalePerCornerDistortion * corner_sigma * std::min(1.0, scale * scale) *
                          CubicPerDistortion(scale);
    p.inverse_scale /= 1 + change;
  }
  const std::optional<Law> moved = SolveLaw(bent, sign, reading_sigma_mm, law, nullptr);
  return moved ? std::abs(moved->offset_mm - law.offset_mm) : 0;
}

class ModelFinder {
 public:
  ModelFinder(const std::vector<ScaleSample>& samples, double reading_sigma_mm,
              model::BenchDirection direction)
      : points_(PointsOf(samples)),
        reading_sigma_mm_(std::max(reading_sigma_mm, 0.0)),
        direction_(direction) {}

  // Determines which law holds, with the reason if it is not the wanted one.
  void Classify(ScaleModel* result) {
    range_mm_ = RobustRange(points_);
    line_ = FitLine(points_, reading_sigma_mm_);
    const double change = std::abs(line_.slope) * range_mm_;
    const double change_sigma = line_.slope_sigma * range_mm_;
    result->change_over_sweep = model::Estimate{line_.slope * range_mm_, change_sigma};
    // 1/slope is the distance of a target in the reference frame.
    const bool is_large = change > kConstantChange || std::abs(line_.slope) * kLongestBenchMm > 1;
    if (std::abs(line_.slope) > kSignificant * line_.slope_sigma && is_large) {
      ClassifySloped(result);
    } else {
      ClassifyFlat(change, change_sigma, result);
    }
  }

  // Fits the offset with its error. Returns false, with the reason, if the fit fails.
  bool Solve(const std::optional<model::Estimate>& distortion_at_corner, ScaleModel* result) const {
    const double sign = model::DirectionSign(direction_);
    Law law{line_.intercept * sign / line_.slope, sign / line_.slope};
    double sigma_mm = reading_sigma_mm_;
    Eigen::Matrix2d covariance;
    // The scatter of the readings about the law is the scale of the loss; a few rounds are enough
    // to converge.
    for (int round = 0; round < 4; ++round) {
      sigma_mm = ScatterOfReadings(points_, law, sign, reading_sigma_mm_);
      const std::optional<Law> solved = SolveLaw(points_, sign, sigma_mm, law, &covariance);
      if (!solved || !(solved->reference_depth_mm > 0)) {
        result->message = "the fit of the image scale did not converge";
        return false;
      }
      law = *solved;
    }
    double sum = 0;
    for (const Point& p : points_) {
      const double error_mm = ReadingError(p, law, sign);
      if (!(std::abs(error_mm) < kFollowsSigmas * ReadingSigma(p, law, sigma_mm))) continue;
      sum += error_mm * error_mm;
      ++result->frames_used;
    }
    result->reading_rms_mm = std::sqrt(sum / std::max(1, result->frames_used));
    const double change = range_mm_ / law.reference_depth_mm;
    const double distortion_mm =
        distortion_at_corner
            ? DistortionSigma(points_, sign, sigma_mm, law,
                              std::min(kLikelyDistortion, distortion_at_corner->sigma))
            : 0;
    const double statistical_mm =
        std::max(std::sqrt(covariance(0, 0)), JackknifeSigma(points_, sign, sigma_mm, law));
    const double bias_mm = law.reference_depth_mm * kScaleBias / change;
    result->offset_mm.value = law.offset_mm;
    result->offset_mm.sigma = std::hypot(std::hypot(statistical_mm, bias_mm), distortion_mm);
    result->reference_depth_mm = law.reference_depth_mm;
    return true;
  }

 private:
  void ClassifySloped(ScaleModel* result) const {
    // The law of the fitted line, independent of its direction.
    const double own_sign = line_.slope > 0 ? 1 : -1;
    const Law law{own_sign * line_.intercept / line_.slope, 1 / std::abs(line_.slope)};
    const double sigma_mm = ScatterOfReadings(points_, law, own_sign, reading_sigma_mm_);
    const std::size_t following = CountFollowing(law, own_sign, reading_sigma_mm_);
    // The criterion is the scatter of the readings themselves, not their stated error. A bench with
    // a coarse scale is no reason to doubt a law that its readings follow.
    const double own_mm = ScatterOfReadings(points_, law, own_sign, 0);
    const bool is_close =
        own_mm < std::max(kFollowsWithin * range_mm_, kStatedScatter * reading_sigma_mm_);
    if (!AreEnough(following)) {
      DoesNotFollow(following, result);
    } else if (!is_close) {
      result->changes_too_little = std::abs(line_.slope) * range_mm_ < kSmallChange;
      result->message = fmt::format(
          "readings and image scales scatter by {:.2g} mm about their law, {:.0f} % of the "
          "readings' range: too much to determine the bench offset (the readings are worse than "
          "stated, or the texture is small or faint)",
          sigma_mm, 100 * sigma_mm / range_mm_);
    }
    if (!AreEnough(following) || !is_close) {
      if (is_close && AreEnough(CountFollowing(law, own_sign, sigma_mm))) {
        result->message += fmt::format(
            "; if the readings are only accurate to about {:.2g} mm, state reading_sigma_mm",
            sigma_mm);
      }
    } else if (line_.slope * model::DirectionSign(direction_) > 0) {
      result->kind = ScaleKind::kInverseDepth;
    } else {
      result->kind = ScaleKind::kReversed;
      result->message = fmt::format(
          "the target looks {} at larger readings, so direction must be '{}', not '{}' (or the "
          "readings are reversed)",
          line_.slope > 0 ? "smaller" : "larger",
          direction_ == model::BenchDirection::kAway ? "toward" : "away",
          model::BenchDirectionName(direction_));
    }
  }

  std::size_t CountFollowing(const Law& law, double sign, double reading_sigma_mm) const {
    std::size_t following = 0;
    for (const Point& p : points_) {
      const double within_mm = std::max(kFollowsWithin * range_mm_,
                                        kFollowsSigmas * ReadingSigma(p, law, reading_sigma_mm));
      following += std::abs(ReadingError(p, law, sign)) < within_mm ? 1U : 0U;
    }
    return following;
  }

  bool AreEnough(std::size_t following) const {
    return static_cast<double>(following) >= kMinFollowing * static_cast<double>(points_.size());
  }

  void ClassifyFlat(double change, double change_sigma, ScaleModel* result) const {
    std::vector<double> inverses;
    for (const Point& p : points_) inverses.push_back(p.inverse_scale);
    const double middle = Median(inverses);
    std::size_t apart = 0;
    for (const Point& p : points_) {
      const double within = std::max(kConstantChange, kFollowsSigmas * p.inverse_scale_sigma);
      apart += std::abs(p.inverse_scale - middle) > within ? 1U : 0U;
    }
    if (!AreEnough(points_.size() - apart)) {
      DoesNotFollow(points_.size() - apart, result);
    } else if (const double most = change + 2 * change_sigma;
               most < kConstantChange && range_mm_ > most * kLongestBenchMm) {
      result->kind = ScaleKind::kConstant;
      result->changes_too_little = true;
      result->message =
          "the image scale does not change with the reading (a telecentric lens, a moving sensor, "
          "frames that were aligned, or one image repeated): it does not determine the bench "
          "offset";
    } else {
      result->changes_too_little = true;
      result->message = fmt::format(
          "the readings span {:.3g} mm, too little to determine how the image scale changes with "
          "them (by {:.2g} +- {:.2g} %): state offset_mm, or extend the sweep",
          range_mm_, 100 * change, 100 * change_sigma);
    }
  }

  void DoesNotFollow(std::size_t following, ScaleModel* result) const {
    constexpr std::size_t kEnoughToContradict = 8;
    result->contradicts_readings =
        points_.size() >= kEnoughToContradict && 2 * following < points_.size();
    result->message = fmt::format(
        "the image scale does not follow the readings: only {} of {} frames agree with one law "
        "(1/z, reversed or constant){}. Check that every frame has its own reading",
        following, points_.size(), InAnotherOrder());
  }

  std::string InAnotherOrder() const {
    const std::size_t following = std::max(FollowingWhenSorted(true), FollowingWhenSorted(false));
    if (static_cast<double>(following) < kSortedFollowing * static_cast<double>(points_.size()))
      return "";
    return fmt::format(
        "; in another order {} of them would agree: the readings belong to other frames of the "
        "sweep (the table is sorted differently)",
        following == points_.size() ? "all" : std::to_string(following));
  }

  // Number of frames that follow the law if the smallest reading is assigned to the largest image
  // and so on (or to the smallest). If they are many more than sorted random values would give, the
  // readings belong to the sweep but are assigned to wrong frames.
  std::size_t FollowingWhenSorted(bool larger_reading_is_farther) const {
    std::vector<double> readings, inverses;
    for (const Point& p : points_) {
      readings.push_back(p.reading_mm);
      inverses.push_back(p.inverse_scale);
    }
    std::sort(readings.begin(), readings.end());
    std::sort(inverses.begin(), inverses.end());
    if (!larger_reading_is_farther) std::reverse(inverses.begin(), inverses.end());
    const double sign = larger_reading_is_farther ? 1 : -1;
    Points sorted = points_;
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      sorted[i].reading_mm = readings[i];
      sorted[i].inverse_scale = inverses[i];
    }
    const Line line = FitLine(sorted, reading_sigma_mm_);
    if (!(sign * line.slope > kSignificant * line.slope_sigma)) return 0;
    const Law law{sign * line.intercept / line.slope, sign / line.slope};
    std::size_t following = 0;
    for (const Point& p : sorted) {
      // Sorted noise bends at both ends by more than a hundredth of its range.
      const double within_mm = std::max(kSortedWithin * range_mm_,
                                        kFollowsSigmas * ReadingSigma(p, law, reading_sigma_mm_));
      following += std::abs(ReadingError(p, law, sign)) < within_mm ? 1U : 0U;
    }
    return following;
  }

  Points points_;
  double reading_sigma_mm_;
  model::BenchDirection direction_;
  double range_mm_ = 0;
  Line line_;
};

std::optional<model::Estimate> DistortionAtCorner(const std::vector<ScaleSample>& samples,
                                                  double corner_radius_px) {
  if (!(corner_radius_px > 0)) return std::nullopt;
  auto distortion = FitRadialDistortion(samples);
  if (!distortion) return std::nullopt;
  distortion->value *= corner_radius_px * corner_radius_px;
  distortion->sigma *= corner_radius_px * corner_radius_px;
  return distortion;
}

}  // namespace

ScaleModel FitScaleModel(const std::vector<ScaleSample>& samples, int reference_frame,
                         double reading_sigma_mm, model::BenchDirection direction,
                         double corner_radius_px) {
  ScaleModel result;
  result.reference_frame = reference_frame;
  if (std::any_of(samples.begin(), samples.end(),
                  [](const ScaleSample& s) { return s.scale_is_from_reading; })) {
    result.shows_no_scale = true;
    result.message =
        "the target looks the same at every scale (spokes from one point), so that its image scale "
        "cannot be measured";
    return result;
  }
  std::set<double> readings;
  for (const ScaleSample& s : samples) readings.insert(s.reading_mm);
  if (readings.size() < kMinSamples) {
    result.message = fmt::format(
        "the image scale could be measured on {} frames only, but {} are needed{}", readings.size(),
        kMinSamples, readings.size() < samples.size() ? " at different readings" : "");
    return result;
  }
  ModelFinder finder(samples, reading_sigma_mm, direction);
  finder.Classify(&result);
  const auto distortion = DistortionAtCorner(samples, corner_radius_px);
  // Frames that do not follow the law may not show one target. Where the scale is constant, a
  // distortion is not visible at all.
  if ((result.kind == ScaleKind::kInverseDepth || result.kind == ScaleKind::kReversed) &&
      distortion &&
      (distortion->sigma < kKnownDistortion ||
       std::abs(distortion->value) > kSignificant * distortion->sigma))
    result.distortion_at_corner = distortion;
  if (result.kind != ScaleKind::kInverseDepth || !finder.Solve(distortion, &result)) return result;
  double shared = 0;
  for (const ScaleSample& s : samples) shared = std::max(shared, s.shared_stretch_sigma);
  // A change of every scale s by gamma (s - 1) moves the zero by -gamma z_reference.
  result.offset_mm.sigma = std::hypot(result.offset_mm.sigma, shared * result.reference_depth_mm);
  result.done = true;
  result.message = "converged";
  return result;
}

}  // namespace thicklens::calib
