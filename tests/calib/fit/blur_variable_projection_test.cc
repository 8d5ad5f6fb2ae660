// The fit of the blur eliminates the errors of the readings. It is compared with a plain reference
// that keeps them: one dense matrix, and derivatives by complex steps, which are exact to rounding.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "calib/fit/blur_costs.h"
#include "calib/fit/blur_fit.h"
#include "calib/fit/blur_prediction.h"
#include "calib/fit/variable_projection.h"
#include "calib/fit/whitened_covariance.h"
#include "support/test_cameras.h"
#include "tests/calib/blur_samples.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::BlurBench;
using thicklens::testing::kReferencePx2;
using thicklens::testing::WithTexture;

using Complex = std::complex<double>;

// V of a frame, px^2 of the target, as the paper defines it.
Complex PlainVariance(const BlurFitSetup& setup, const Eigen::Vector4cd& global, Complex depth_mm,
                      double scale) {
  const double f1 = setup.lens.front_focal_length_mm;
  const Complex zf = global[kFocusDepth];
  const Complex defocus = setup.law == BlurModel::kPerspective ? 1.0 / depth_mm - 1.0 / zf
                                                               : (depth_mm - zf) / (zf * zf);
  const Complex sigma_px = global[kBlurRatio] * setup.lens.aperture_radius_mm * f1 * zf /
                           (zf - f1) * defocus / setup.pixel_pitch_mm;
  return (global[kFloorVariance] + sigma_px * sigma_px) / (scale * scale);
}

// The covariance with its small diagonal regularisation, which is added to a sample before it is
// weighted, and to the reference after.
Eigen::MatrixXd WeightedCovariance(const Eigen::MatrixXd& covariance,
                                   const Eigen::VectorXd& weights) {
  const Eigen::VectorXd variances = covariance.diagonal();
  const auto regularisation = [](const Eigen::VectorXd& of) {
    return 1e-9 * of.maxCoeff() + 1e-12;
  };
  const Eigen::VectorXd root = weights.cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd weighted = covariance;
  weighted.diagonal().array() += regularisation(variances);
  weighted = root.asDiagonal() * weighted * root.asDiagonal();
  for (Eigen::Index i = 0; i < variances.size(); ++i) {
    if (variances[i] == 0) weighted(i, i) = regularisation(variances.cwiseQuotient(weights));
  }
  return weighted;
}

// The whole problem: global parameters, softness of each blur estimator, scale law, error of each
// reading.
struct Reference {
  const BlurFitSetup& setup;
  const BlurWeights& weights;
  bool has_scales;

  Eigen::VectorXd Unknowns(const BlurParameters& p) const {
    Eigen::VectorXd all(Columns());
    all << p.global,
        Eigen::Map<const Eigen::VectorXd>(p.softness_px2.data(),
                                          Eigen::Index(setup.estimators.size())),
        p.scale_model.head(has_scales ? 3 : 0), p.errors_mm;
    return all;
  }
  Eigen::Index Few() const {
    return 4 + Eigen::Index(setup.estimators.size()) + (has_scales ? 3 : 0);
  }
  Eigen::Index Columns() const { return Few() + Eigen::Index(setup.frames.size()); }

  Eigen::VectorXcd Residuals(const Eigen::VectorXcd& u) const {
    std::vector<Complex> all;
    double low = 1e9, high = -1e9;
    for (const FitFrame& frame : setup.frames) {
      low = std::min(low, frame.reading_mm);
      high = std::max(high, frame.reading_mm);
    }
    const auto reading = [&](std::size_t f) {
      return setup.frames[f].reading_mm - u[Few() + Eigen::Index(f)];
    };
    for (std::size_t m = 0; m < setup.estimators.size(); ++m) {
      const BlurSamples& estimator = setup.estimators[m];
      const auto n = Eigen::Index(estimator.frames.size());
      Eigen::VectorXcd raw(n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const std::size_t f = estimator.frames[std::size_t(i)];
        const Complex depth_mm =
            u[kBenchOffset] + model::DirectionSign(setup.direction) * reading(f);
        raw[i] = PlainVariance(setup, u.head<4>(), depth_mm, setup.frames[f].scale) +
                 u[4 + Eigen::Index(m)] - estimator.variances_px2[i];
      }
      const Eigen::MatrixXcd lower =
          Eigen::MatrixXd(
              WeightedCovariance(estimator.covariance, weights.estimators[m]).llt().matrixL())
              .cast<Complex>();
      const Eigen::VectorXcd white = lower.triangularView<Eigen::Lower>().solve(raw);
      all.insert(all.end(), white.begin(), white.end());
    }
    for (std::size_t f = 0; has_scales && f < setup.frames.size(); ++f) {
      if (!setup.frames[f].scale_sigma) continue;
      const Complex x = (2.0 * reading(f) - low - high) / (high - low);
      const Eigen::Vector3cd law = u.segment<3>(Few() - 3);
      all.push_back(std::sqrt(weights.scales[Eigen::Index(f)]) / *setup.frames[f].scale_sigma *
                    (setup.frames[f].scale * (law[0] + law[1] * x + law[2] * x * x) - 1.0));
    }
    for (std::size_t f = 0; f < setup.frames.size(); ++f) {
      all.push_back(std::sqrt(weights.readings[Eigen::Index(f)]) / setup.reading_sigma_mm *
                    u[Few() + Eigen::Index(f)]);
    }
    return Eigen::Map<Eigen::VectorXcd>(all.data(), Eigen::Index(all.size()));
  }
  Eigen::MatrixXd Jacobian(const Eigen::VectorXd& u) const {
    constexpr double kStep = 1e-30;
    Eigen::MatrixXd jacobian(Residuals(u.cast<Complex>()).size(), Columns());
    for (Eigen::Index c = 0; c < Columns(); ++c) {
      Eigen::VectorXcd moved = u.cast<Complex>();
      moved[c] += Complex(0, kStep);
      jacobian.col(c) = Residuals(moved).imag() / kStep;
    }
    return jacobian;
  }
  // Covariance of the named columns, by the SVD of all columns.
  static Eigen::MatrixXd Covariance(const Eigen::MatrixXd& jacobian) {
    const Eigen::VectorXd norms = jacobian.colwise().norm();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(jacobian * norms.cwiseInverse().asDiagonal(),
                                                Eigen::ComputeThinV);
    const Eigen::MatrixXd half = norms.cwiseInverse().asDiagonal() * svd.matrixV() *
                                 svd.singularValues().cwiseInverse().asDiagonal();
    return half * half.transpose();
  }
};

// Edges on every other frame and a relative blur estimator, with scales, some with reduced weights.
struct SmallCase {
  BlurFitSetup setup;
  BlurWeights weights;
  BlurParameters point;
  std::vector<WhitenedCovariance> information;
};

SmallCase DrawnCase(BlurModel law, model::BenchDirection direction, double reading_sigma_mm) {
  BlurBench bench;
  bench.law = law;
  bench.direction = direction;
  bench.count = 15;
  bench.reference = 6;
  bench.reading_sigma_mm = reading_sigma_mm;
  bench.scales_tell = true;
  bench.scale_sigma = 3e-4;
  std::mt19937 random(11);
  SmallCase c;
  c.setup = bench.Setup(&random);
  BlurSamples edges = bench.Absolute(0.05, 0.3, &random);
  BlurSamples half = edges;
  half.frames.clear();
  half.variances_px2.resize(8);
  half.covariance = edges.covariance.topLeftCorner(8, 8);
  for (Eigen::Index i = 0; i < 8; ++i) {
    half.frames.push_back(std::size_t(14 - 2 * i));  // not in order
    half.variances_px2[i] = edges.variances_px2[14 - 2 * i];
  }
  c.setup.estimators = {half, bench.Relative(0.01, kReferencePx2, &random)};
  c.weights.estimators = {Eigen::VectorXd::Ones(8), Eigen::VectorXd::Ones(15)};
  c.weights.readings = c.weights.scales = Eigen::VectorXd::Ones(15);
  c.weights.estimators[0][3] = 0.4;
  c.weights.estimators[1][9] = 0.1;
  c.weights.readings[2] = 0.3;
  c.weights.scales[11] = 0.2;
  c.point.global << bench.focus_mm + 0.3, bench.ratio, bench.floor_px2, bench.offset_mm;
  const double reference_px2 = bench.OnTarget(bench.Depth(bench.reference));
  c.point.softness_px2 = {0.3, kReferencePx2 - reference_px2};
  c.point.scale_model << 1, -0.2, 0.01;
  c.point.errors_mm = Eigen::VectorXd::Zero(15);
  for (Eigen::Index i = 0; i < 15; ++i)
    c.point.errors_mm[i] = reading_sigma_mm * std::sin(1.7 * double(i));
  for (const BlurSamples& estimator : c.setup.estimators)
    c.information.emplace_back(estimator.covariance);
  return c;
}

TEST(BlurPrediction, DerivativesAreThoseOfItsValue) {
  for (const BlurModel law : {BlurModel::kPerspective, BlurModel::kTelecentric}) {
    BlurFitSetup setup;
    setup.lens = testing::WideLens(4.4643);
    setup.pixel_pitch_mm = 0.006;
    setup.law = law;
    for (const double depth_mm : {300.0, 399.0, 400.0, 470.0}) {
      const Eigen::Vector4d global(400, 0.45, 0.25, 30);
      const BlurPrediction p = PredictBlur(setup, global, depth_mm, 0.9);
      const auto at = [&](int parameter, double depth_step) {
        Eigen::Vector4cd moved = global.cast<Complex>();
        if (parameter >= 0) moved[parameter] += Complex(0, 1e-30);
        return PlainVariance(setup, moved, Complex(depth_mm, depth_step), 0.9);
      };
      EXPECT_NEAR(p.value, at(-1, 0).real(), 1e-12 * p.value);
      for (const int i : {kFocusDepth, kBlurRatio, kFloorVariance}) {
        const double expected = at(i, 0).imag() / 1e-30;
        EXPECT_NEAR(p.by_global[i], expected, 1e-11 * std::abs(expected) + 1e-12) << i;
      }
      const double by_depth = at(-1, 1e-30).imag() / 1e-30;
      EXPECT_NEAR(p.by_depth, by_depth, 1e-11 * std::abs(by_depth) + 1e-12);
      EXPECT_EQ(p.by_global[kBenchOffset], p.by_depth);
      const double step_mm = 1e-3;
      const double slopes = PredictBlur(setup, global, depth_mm + step_mm, 0.9).by_depth -
                            PredictBlur(setup, global, depth_mm - step_mm, 0.9).by_depth;
      EXPECT_NEAR(p.by_depth_twice, slopes / (2 * step_mm), 1e-7 * std::abs(p.by_depth_twice));
      EXPECT_NEAR(DefocusVariance(setup, 400, depth_mm),
                  0.81 * (at(-1, 0).real() - 0.25 / 0.81) / (0.45 * 0.45), 1e-10);
    }
  }
}

TEST(WhitenedCovariance, IsTheInverseForAnyWeights) {
  BlurBench bench;
  std::mt19937 random(3);
  const BlurSamples samples = bench.Relative(0.02, kReferencePx2, &random);
  const WhitenedCovariance information(samples.covariance);
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(bench.count);
  weights[3] = 0.2;
  weights[20] = 0.01;
  weights[Eigen::Index(bench.reference)] = 0.5;
  const Eigen::VectorXd factors = information.Factors(weights);
  const Eigen::MatrixXd expected = WeightedCovariance(samples.covariance, weights).inverse();
  const Eigen::MatrixXd white = information.Whitened(factors.asDiagonal());
  const auto r = Eigen::Index(bench.reference);
  const Eigen::MatrixXd found = white.transpose() * white;
  EXPECT_NEAR(found(r, r) / expected(r, r), 1, 1e-9);
  for (Eigen::Index i = 0; i < bench.count; ++i) {
    for (Eigen::Index j = 0; j < bench.count; ++j) {
      if (i == r && j == r) continue;
      EXPECT_NEAR(found(i, j), expected(i, j), 1e-9 * std::sqrt(expected(i, i) * expected(j, j)))
          << i << " " << j;
    }
  }
  const Eigen::MatrixXd scaled = factors.asDiagonal() * information.matrix() * factors.asDiagonal();
  EXPECT_LT((scaled - found).norm(), 1e-9 * found.norm());
  EXPECT_LT((information.TransposeWhitened(information.Whitened(weights)) -
             information.matrix() * weights)
                .norm(),
            1e-9 * (information.matrix() * weights).norm());
}

TEST(ReadingErrorProjection, GivesTheCovarianceOfTheWholeProblem) {
  for (const BlurModel law : {BlurModel::kPerspective, BlurModel::kTelecentric}) {
    for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
      for (const double reading_sigma_mm : {0.01, 0.3}) {
        SCOPED_TRACE(reading_sigma_mm);
        const SmallCase c = DrawnCase(law, direction, reading_sigma_mm);
        const BlurResiduals residuals(c.setup, c.information, c.weights);
        const Reference reference{c.setup, c.weights, true};
        const Eigen::VectorXd u = reference.Unknowns(c.point);
        ASSERT_EQ(residuals.columns(), reference.Few());
        const ReducedProblem reduced = Reduce(residuals, c.point);
        const Eigen::VectorXd values = reference.Residuals(u.cast<Complex>()).real();
        ASSERT_EQ(residuals.rows(), values.size());
        EXPECT_LT((reduced.values - values).norm(), 1e-9 * values.norm());

        // Fixed parameters have no column: the bench offset, and the floor, which one sweep cannot
        // distinguish from softness.
        std::vector<Eigen::Index> few = {kFocusDepth, kBlurRatio, 4, 5, 6, 7, 8};
        std::vector<Eigen::Index> all = few;
        for (Eigen::Index f = 0; f < 15; ++f) all.push_back(reference.Few() + f);
        const Eigen::MatrixXd whole = Reference::Covariance(reference.Jacobian(u)(Eigen::all, all));
        const Eigen::MatrixXd left = Reference::Covariance(reduced.jacobian(Eigen::all, few));
        for (Eigen::Index a = 0; a < left.rows(); ++a) {
          for (Eigen::Index b = 0; b < left.rows(); ++b) {
            EXPECT_NEAR(left(a, b), whole(a, b), 1e-8 * std::sqrt(whole(a, a) * whole(b, b)))
                << a << " " << b;
          }
        }
        const Eigen::VectorXd variances =
            ErrorVariances(residuals, c.point, reduced.error_response(Eigen::all, few), left);
        for (Eigen::Index f = 0; f < 15; ++f)
          EXPECT_NEAR(variances[f] / whole(left.rows() + f, left.rows() + f), 1, 1e-8) << f;
      }
    }
  }
}

TEST(ReadingErrorProjection, LeavesTheGradientOfTheWholeProblem) {
  for (const double reading_sigma_mm : {0.01, 0.3, 3.0}) {
    SCOPED_TRACE(reading_sigma_mm);
    const SmallCase c =
        DrawnCase(BlurModel::kPerspective, model::BenchDirection::kAway, reading_sigma_mm);
    const BlurResiduals residuals(c.setup, c.information, c.weights);
    BlurParameters best = c.point;
    ASSERT_TRUE(SolveErrors(residuals, &best));
    const Reference reference{c.setup, c.weights, true};
    const Eigen::VectorXd u = reference.Unknowns(best);
    const Eigen::MatrixXd jacobian = reference.Jacobian(u);
    const Eigen::VectorXd values = reference.Residuals(u.cast<Complex>()).real();
    const Eigen::VectorXd gradient = jacobian.transpose() * values;
    // The unit is that of the sum whose terms cancel.
    for (Eigen::Index f = 0; f < 15; ++f) {
      EXPECT_LT(std::abs(gradient[reference.Few() + f]),
                1e-6 * jacobian.col(reference.Few() + f).norm() * values.norm())
          << f;
    }
    const ReducedProblem reduced = Reduce(residuals, best);
    const Eigen::VectorXd left = reduced.jacobian.transpose() * reduced.values;
    for (Eigen::Index p = 0; p < reference.Few(); ++p)
      EXPECT_NEAR(left[p], gradient[p], 1e-5 * jacobian.col(p).norm() * values.norm()) << p;
    // No other errors nearby give a smaller sum.
    std::mt19937 random(5);
    std::normal_distribution<double> normal(0, 0.1 * reading_sigma_mm);
    for (int trial = 0; trial < 50; ++trial) {
      BlurParameters other = best;
      for (double& error : other.errors_mm) error += normal(random);
      EXPECT_GT(residuals.Values(*residuals.At(other)).squaredNorm(), values.squaredNorm());
    }
  }
}

TEST(ReadingErrorProjection, RefusesWhatLiesBehindTheLens) {
  SmallCase c = DrawnCase(BlurModel::kPerspective, model::BenchDirection::kAway, 0.1);
  c.point.global[kBenchOffset] = -1000;
  const BlurResiduals residuals(c.setup, c.information, c.weights);
  EXPECT_FALSE(SolveErrors(residuals, &c.point));
}

// The answer, and not only the covariance, is a minimum of the whole problem, including the errors,
// even if the errors of the readings are as large as the depth of field (case ii of the sweeps).
TEST(ReadingErrorProjection, FitBlurEndsAtTheMinimumOfTheWholeProblem) {
  for (const bool is_steep : {false, true}) {
    SCOPED_TRACE(is_steep);
    BlurBench bench;
    bench.reading_sigma_mm = 0.07;
    if (is_steep) {
      bench.lens = testing::ThinLens(50, 8.93);
      bench.pitch_mm = 0.0045;
      bench.focus_mm = 300;
      bench.first_mm = 285;
      bench.last_mm = 315;
      bench.reference = 15;
    }
    std::mt19937 random(7);
    const BlurFitSetup setup = WithTexture(bench, 0.02, 0, &random);
    const BlurFitResult fit = FitBlur(setup);
    ASSERT_TRUE(fit.done) << fit.message;
    ASSERT_EQ(fit.weights.minCoeff(), 1);
    BlurWeights weights{{Eigen::VectorXd::Ones(bench.count)},
                        Eigen::VectorXd::Ones(bench.count),
                        Eigen::VectorXd::Ones(bench.count)};
    const Reference reference{setup, weights, false};
    BlurParameters end;
    end.global = fit.values;
    end.softness_px2 = fit.softness_px2;
    end.errors_mm = fit.reading_errors_mm;
    const Eigen::VectorXd u = reference.Unknowns(end);
    std::vector<Eigen::Index> all = {kFocusDepth, kBlurRatio, 4};
    for (Eigen::Index f = 0; f < bench.count; ++f) all.push_back(5 + f);
    const Eigen::MatrixXd jacobian = reference.Jacobian(u)(Eigen::all, all);
    const Eigen::VectorXd values = reference.Residuals(u.cast<Complex>()).real();
    const Eigen::MatrixXd covariance = Reference::Covariance(jacobian);
    // The change that one more step of the whole problem would make, in standard deviations.
    const Eigen::VectorXd step = covariance * (jacobian.transpose() * values);
    for (Eigen::Index i = 0; i < step.size(); ++i)
      EXPECT_LT(std::abs(step[i]), 2e-3 * std::sqrt(covariance(i, i))) << i;
    EXPECT_NEAR(fit.chi2_per_dof, values.squaredNorm() / (bench.count - 3), 1e-6);
    const double factor = fit.error_factor * fit.error_factor;
    for (const int a : {0, 1}) {
      for (const int b : {0, 1}) {
        EXPECT_NEAR(fit.covariance(a, b) / factor, covariance(a, b),
                    1e-8 * std::sqrt(covariance(a, a) * covariance(b, b)));
      }
    }
    for (Eigen::Index f = 0; f < bench.count; ++f) {
      EXPECT_NEAR(fit.reading_error_sigmas_mm[f] / fit.error_factor,
                  std::sqrt(covariance(3 + f, 3 + f)), 1e-8);
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
