// The robust parabola that a sweep's blur follows on the target, and the start of the fit from it.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "calib/fit/blur_fit.h"
#include "thicklens/base/statistics.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

constexpr int kTriplets = 400;
constexpr double kTrimmed = 0.7;  // part of the samples by which a candidate is judged
// A parabola passes three samples exactly and a fourth by chance.
constexpr std::ptrdiff_t kMinJudged = 5;
constexpr double kFarOff = 6;          // standard deviations
constexpr double kModelError = 0.002;  // part of the range of V: no lens follows the law better

using Line = Eigen::Vector3d;

double ValueAt(const Line& c, double x) { return c[0] + x * (c[1] + x * c[2]); }
double SlopeAt(const Line& c, double x) { return c[1] + 2 * x * c[2]; }

std::optional<Line> LeastSquares(const Eigen::VectorXd& x, const Eigen::VectorXd& v,
                                 const Eigen::VectorXd& weights) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Eigen::Vector3d row(1, x[i], x[i] * x[i]);
    normal += weights[i] * row * row.transpose();
    right += weights[i] * v[i] * row;
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> solver(normal);
  if (solver.rank() < 3) return std::nullopt;
  return Line(solver.solve(right));
}

class Search {
 public:
  Search(const Eigen::VectorXd& depths_mm, const Eigen::VectorXd& variances,
         const Eigen::VectorXd& errors, double reading_sigma_mm)
      : v_(variances), errors_(errors) {
    result_.middle_mm = 0.5 * (depths_mm.minCoeff() + depths_mm.maxCoeff());
    result_.unit_mm = std::max(0.5 * (depths_mm.maxCoeff() - depths_mm.minCoeff()), 1e-9);
    x_ = (depths_mm.array() - result_.middle_mm) / result_.unit_mm;
    reading_sigma_ = reading_sigma_mm / result_.unit_mm;
    model_error_ = kModelError * (v_.maxCoeff() - v_.minCoeff());
  }

  Parabola Run() {
    const Eigen::Index n = x_.size();
    if (n < 4) return result_;
    std::optional<Line> best;
    double least = 0;
    std::mt19937 random(20);
    std::uniform_int_distribution<Eigen::Index> pick(0, n - 1);
    for (int t = 0; t < kTriplets; ++t) {
      Eigen::VectorXd weights = Eigen::VectorXd::Zero(n);
      for (int a = 0; a < 3; ++a) weights[pick(random)] = 1;
      const std::optional<Line> line = LeastSquares(x_, v_, weights);
      if (!line) continue;
      const double cost = TrimmedCost(*line);
      if (!best || cost < least) {
        best = line;
        least = cost;
      }
    }
    if (!best) return result_;
    Refine(*best);
    return result_;
  }

 private:
  Eigen::VectorXd Sigmas(const Line& line) const {
    Eigen::VectorXd sigmas(x_.size());
    for (Eigen::Index i = 0; i < x_.size(); ++i) {
      const double reading = SlopeAt(line, x_[i]) * reading_sigma_;
      sigmas[i] = std::sqrt(errors_[i] * errors_[i] + reading * reading +
                            model_error_ * model_error_ + 1e-18);
    }
    return sigmas;
  }

  Eigen::VectorXd Residuals(const Line& line) const {
    Eigen::VectorXd residuals(x_.size());
    for (Eigen::Index i = 0; i < x_.size(); ++i) residuals[i] = v_[i] - ValueAt(line, x_[i]);
    return residuals;
  }

  double TrimmedCost(const Line& line) const {
    const Eigen::ArrayXd squares = (Residuals(line).array() / Sigmas(line).array()).square();
    std::vector<double> sorted(squares.begin(), squares.end());
    const auto part =
        static_cast<std::ptrdiff_t>(std::ceil(kTrimmed * static_cast<double>(sorted.size())));
    const auto kept =
        std::min(std::max(kMinJudged, part), static_cast<std::ptrdiff_t>(sorted.size()));
    std::nth_element(sorted.begin(), sorted.begin() + kept - 1, sorted.end());
    double sum = 0;
    for (auto s = sorted.begin(); s != sorted.begin() + kept; ++s) sum += *s;
    return sum;
  }

  // Repeats weighted least squares on the samples that follow until their set does not change.
  void Refine(Line line) {
    for (int round = 0; round < 10; ++round) {
      const Eigen::VectorXd sigmas = Sigmas(line);
      const Eigen::ArrayXd off = (Residuals(line).array() / sigmas.array()).abs();
      const double scatter =
          std::max(1.0, 1.4826 * Median(std::vector<double>(off.begin(), off.end())));
      std::vector<bool> follows(static_cast<std::size_t>(x_.size()));
      Eigen::VectorXd weights(x_.size());
      for (Eigen::Index i = 0; i < x_.size(); ++i) {
        follows[static_cast<std::size_t>(i)] = off[i] < kFarOff * scatter;
        weights[i] = follows[static_cast<std::size_t>(i)] ? 1 / (sigmas[i] * sigmas[i]) : 0;
      }
      const bool settled = round > 0 && follows == result_.follows;
      result_.follows = follows;
      result_.sigmas_px2 = sigmas * scatter;
      const std::optional<Line> refined = LeastSquares(x_, v_, weights);
      if (!refined) return;
      line = *refined;
      if (settled) break;
    }
    result_.coefficients = line;
    result_.residuals_px2 = Residuals(line);
    result_.vertex_mm =
        line[2] != 0 ? result_.middle_mm - result_.unit_mm * 0.5 * line[1] / line[2] : 0;
    result_.done = true;
  }

  Eigen::VectorXd x_, v_, errors_;
  double reading_sigma_ = 0, model_error_ = 0;
  Parabola result_;
};

}  // namespace

double Parabola::At(double depth_mm) const {
  return ValueAt(coefficients, (depth_mm - middle_mm) / unit_mm);
}

std::vector<double> Parabola::DepthsOf(double variance_px2, double near_mm) const {
  const double middle = -0.5 * coefficients[1] / coefficients[2];
  const double squared = middle * middle - (coefficients[0] - variance_px2) / coefficients[2];
  if (!(squared >= 0)) return {};
  const double apart = std::sqrt(squared);
  std::vector<double> depths = {middle_mm + unit_mm * (middle - apart),
                                middle_mm + unit_mm * (middle + apart)};
  if (std::abs(depths[1] - near_mm) < std::abs(depths[0] - near_mm))
    std::swap(depths[0], depths[1]);
  return depths;
}

Parabola FitParabola(const Eigen::VectorXd& depths_mm, const Eigen::VectorXd& variances_px2,
                     const Eigen::VectorXd& errors_px2, double reading_sigma_mm) {
  return Search(depths_mm, variances_px2, errors_px2, reading_sigma_mm).Run();
}

// [D73] V = S0 z^2/zr^2 + A (1 - z/zf)^2/zr^2 + c. With a the coefficient of z^2 times zr^2:
//   A/zf^2 = a - S0, zf = vertex a/(a - S0). Telecentric: V = S0 + A ((z - zf)/zf^2)^2 + c.
std::optional<FocusAndRatio> FromParabola(const Parabola& parabola, const BlurFitSetup& setup,
                                          double reference_depth_mm, double floor_variance_px2) {
  if (!parabola.done) return std::nullopt;
  const double f1 = setup.lens.front_focal_length_mm;
  const double a2 = parabola.coefficients[2] / (parabola.unit_mm * parabola.unit_mm);
  FocusAndRatio found;
  double root = 0;  // sqrt(A)/zf
  if (setup.law == BlurModel::kPerspective) {
    const double a = a2 * reference_depth_mm * reference_depth_mm;
    if (!(a > floor_variance_px2)) return std::nullopt;
    found.focus_depth_mm = parabola.vertex_mm * a / (a - floor_variance_px2);
    root = std::sqrt(a - floor_variance_px2);
  } else {
    if (!(a2 > 0)) return std::nullopt;
    found.focus_depth_mm = parabola.vertex_mm;
    root = std::sqrt(a2) * found.focus_depth_mm;
  }
  if (!(found.focus_depth_mm > f1)) return std::nullopt;
  found.blur_ratio = root * setup.pixel_pitch_mm * (found.focus_depth_mm - f1) /
                     (setup.lens.aperture_radius_mm * f1);
  return found;
}

}  // namespace thicklens::calib
