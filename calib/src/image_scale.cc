#include "thicklens/calib/image_scale.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "edge_pixels.h"

namespace thicklens::calib {
namespace {

constexpr int kFewestSamples = 5;
constexpr int kCoarseSizePx = 256;  // where a registration starts
constexpr double kLargestRefinement = 1e-3;
constexpr double kMaxAnisotropy = 0.015;
// Readings that scatter by more of their range than this come from registrations that failed.
constexpr double kLargestScatter = 0.03;
constexpr double kMinCorrelation = 0.6;
// What a registration may be wrong by from one end of a sweep to the other and still look straight:
// measured on simulated sweeps, whose scales are known.
constexpr double kScaleBias = 2e-4;

struct Law {
  double offset_mm = 0;
  double reference_depth_mm = 0;
};

// reading = direction (z_reference/scale - offset): the readings carry the error, so the residual
// is theirs.
struct ReadingResidual {
  double reading_mm, inverse_scale, sign, sigma_mm;

  template <typename T>
  bool operator()(const T* offset_mm, const T* reference_depth_mm, T* residual) const {
    const T predicted = sign * (reference_depth_mm[0] * inverse_scale - offset_mm[0]);
    residual[0] = (predicted - reading_mm) / sigma_mm;
    return true;
  }
};

// The straight line 1/scale = a + b reading by least squares, as a start and for the tests of its
// slope.
struct Line {
  double intercept = 0, slope = 0, slope_sigma = 0;
};

Line FitLine(const std::vector<ScaleSample>& samples) {
  const auto n = static_cast<double>(samples.size());
  double x = 0, y = 0;
  for (const ScaleSample& s : samples) {
    x += s.reading_mm / n;
    y += 1 / s.scale / n;
  }
  double xx = 0, xy = 0, rest = 0;
  for (const ScaleSample& s : samples) {
    xx += (s.reading_mm - x) * (s.reading_mm - x);
    xy += (s.reading_mm - x) * (1 / s.scale - y);
  }
  Line line;
  line.slope = xy / xx;
  line.intercept = y - line.slope * x;
  for (const ScaleSample& s : samples) {
    const double r = 1 / s.scale - line.intercept - line.slope * s.reading_mm;
    rest += r * r;
  }
  line.slope_sigma = std::sqrt(rest / std::max(1.0, n - 2) / xx);
  return line;
}

std::optional<Law> SolveLaw(const std::vector<ScaleSample>& samples, double sign, double sigma_mm,
                            const Law& start, Eigen::Matrix2d* covariance) {
  Law law = start;
  ceres::Problem problem;
  for (const ScaleSample& s : samples) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ReadingResidual, 1, 1, 1>(
                                 new ReadingResidual{s.reading_mm, 1 / s.scale, sign, sigma_mm}),
                             new ceres::CauchyLoss(3), &law.offset_mm, &law.reference_depth_mm);
  }
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
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

double ReadingError(const ScaleSample& sample, const Law& law, double sign) {
  return sample.reading_mm - sign * (law.reference_depth_mm / sample.scale - law.offset_mm);
}

// Leaves out one run of neighbouring readings after the other: errors that neighbours share (a
// scale that is not quite linear, a lens that distorts) show in how far the result moves.
double JackknifeSigma(std::vector<ScaleSample> samples, double sign, double sigma_mm,
                      const Law& law) {
  constexpr int kBlocks = 8;
  const int n = static_cast<int>(samples.size());
  const int blocks = std::min(kBlocks, n / 2);
  if (blocks < 4) return 0;
  std::sort(samples.begin(), samples.end(),
            [](const ScaleSample& a, const ScaleSample& b) { return a.reading_mm < b.reading_mm; });
  std::vector<double> offsets;
  for (int block = 0; block < blocks; ++block) {
    std::vector<ScaleSample> rest;
    for (int i = 0; i < n; ++i) {
      if (i * blocks / n != block) rest.push_back(samples[static_cast<std::size_t>(i)]);
    }
    const std::optional<Law> without = SolveLaw(rest, sign, sigma_mm, law, nullptr);
    if (without) offsets.push_back(without->offset_mm);
  }
  double mean = 0, sum = 0;
  const auto count = static_cast<double>(offsets.size());
  for (const double offset : offsets) mean += offset / count;
  for (const double offset : offsets) sum += (offset - mean) * (offset - mean);
  return std::sqrt((count - 1) / count * sum);
}

// Maximises the enhanced correlation coefficient over an affine map; returns its value.
double FindAffine(const cv::Mat& reference, const cv::Mat& frame, int iterations, cv::Mat* warp) {
  const cv::TermCriteria criteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, iterations,
                                  1e-5);
  return cv::findTransformECC(reference, frame, *warp, cv::MOTION_AFFINE, criteria, cv::noArray(),
                              5);
}

}  // namespace

std::optional<double> RegisterScale(const cv::Mat& reference, const cv::Mat& frame,
                                    double expected_scale) {
  const double shrink =
      std::min(1.0, static_cast<double>(kCoarseSizePx) / std::max(reference.cols, reference.rows));
  const cv::Point2d centre(0.5 * (reference.cols * shrink - 1),
                           0.5 * (reference.rows * shrink - 1));
  cv::Mat warp = (cv::Mat_<float>(2, 3) << expected_scale, 0, (1 - expected_scale) * centre.x, 0,
                  expected_scale, (1 - expected_scale) * centre.y);
  try {
    double correlation = 0;
    if (shrink < 1) {
      cv::Mat small_reference, small_frame;
      cv::resize(reference, small_reference, cv::Size(), shrink, shrink, cv::INTER_AREA);
      cv::resize(frame, small_frame, cv::Size(), shrink, shrink, cv::INTER_AREA);
      correlation = FindAffine(small_reference, small_frame, 60, &warp);
      warp.at<float>(0, 2) /= static_cast<float>(shrink);
      warp.at<float>(1, 2) /= static_cast<float>(shrink);
    }
    if (!(shrink < 1)) correlation = FindAffine(reference, frame, 60, &warp);
    if (!(correlation > kMinCorrelation)) return std::nullopt;
    if (shrink < 1) {
      // A shrunk picture leaves 1.5e-4 of scale over a sweep, the full one a fifth of it. But what
      // moves the answer by more has left the maximum that the shrunk one has found.
      cv::Mat refined = warp.clone();
      if (FindAffine(reference, frame, 15, &refined) > kMinCorrelation &&
          std::abs(refined.at<float>(0, 0) / warp.at<float>(0, 0) - 1) < kLargestRefinement) {
        warp = refined;
      }
    }
  } catch (const cv::Exception&) {
    return std::nullopt;  // ECC says by an exception that it did not converge
  }
  const double xx = warp.at<float>(0, 0), xy = warp.at<float>(0, 1);
  const double yx = warp.at<float>(1, 0), yy = warp.at<float>(1, 1);
  const double scale_x = std::hypot(xx, yx);
  const double scale_y = std::hypot(xy, yy);
  const double determinant = xx * yy - xy * yx;
  if (!(determinant > 0) || !(std::abs(scale_x / scale_y - 1) < kMaxAnisotropy))
    return std::nullopt;
  return std::sqrt(determinant);
}

ScaleLaw FitScaleLaw(const std::vector<ScaleSample>& samples, int reference_frame,
                     double reading_sigma_mm, model::BenchDirection direction) {
  ScaleLaw result;
  result.reference_frame = reference_frame;
  if (samples.size() < kFewestSamples) {
    result.message = fmt::format("the image scale could be measured on {} frames, {} are needed",
                                 samples.size(), kFewestSamples);
    return result;
  }
  const double sign = model::DirectionSign(direction);
  const Line line = FitLine(samples);
  const auto [nearest, farthest] = std::minmax_element(
      samples.begin(), samples.end(),
      [](const ScaleSample& a, const ScaleSample& b) { return a.reading_mm < b.reading_mm; });
  const double change = line.slope * (farthest->reading_mm - nearest->reading_mm);
  if (!(std::abs(line.slope) > 4 * line.slope_sigma) || !(std::abs(change) > 1e-3)) {
    result.message =
        "the image scale does not change with the reading (telecentric lens, moving sensor, or one "
        "picture "
        "repeated): the bench zero cannot be found from it, state offset_mm";
    return result;
  }
  if (!(line.slope * sign > 0)) {
    result.message = fmt::format(
        "the target looks larger at larger readings, so direction must be '{}', not '{}' (or the "
        "readings "
        "are reversed)",
        direction == model::BenchDirection::kAway ? "toward" : "away",
        model::BenchDirectionName(direction));
    return result;
  }

  Law law{line.intercept * sign / line.slope, sign / line.slope};
  double sigma_mm = std::max(reading_sigma_mm, 1e-6);
  Eigen::Matrix2d covariance;
  // The scatter of the readings about the law sets the scale of the loss; three rounds settle it.
  for (int round = 0; round < 3; ++round) {
    std::vector<double> errors;
    errors.reserve(samples.size());
    for (const ScaleSample& s : samples) errors.push_back(std::abs(ReadingError(s, law, sign)));
    sigma_mm = std::max({1.4826 * Median(errors), reading_sigma_mm, 1e-6});
    const std::optional<Law> solved = SolveLaw(samples, sign, sigma_mm, law, &covariance);
    if (!solved) {
      result.message = "the fit of the image scale did not converge";
      return result;
    }
    law = *solved;
  }
  double sum = 0;
  for (const ScaleSample& s : samples) {
    const double error_mm = ReadingError(s, law, sign);
    if (!(std::abs(error_mm) < 5 * sigma_mm)) continue;
    sum += error_mm * error_mm;
    ++result.frames_used;
  }
  result.reading_rms_mm = std::sqrt(sum / std::max(1, result.frames_used));
  const double range_mm = farthest->reading_mm - nearest->reading_mm;
  if (!(result.reading_rms_mm < kLargestScatter * range_mm)) {
    result.message = fmt::format(
        "the image scale is not found reliably on this target (the readings scatter by {:.2g} mm "
        "about "
        "1/z): state offset_mm",
        result.reading_rms_mm);
    return result;
  }
  result.offset_mm.value = law.offset_mm;
  result.offset_mm.sigma = std::hypot(
      std::max(std::sqrt(covariance(0, 0)), JackknifeSigma(samples, sign, sigma_mm, law)),
      law.reference_depth_mm * kScaleBias / std::abs(change));
  result.reference_depth_mm = law.reference_depth_mm;
  result.done = true;
  result.message = "converged";
  return result;
}

}  // namespace thicklens::calib
