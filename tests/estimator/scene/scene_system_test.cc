// The systems of a photograph are compared with dense matrices that are computed from their
// formulas, and the priors with the functionals that they approximate.
#include "estimator/scene/scene_system.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <random>
#include <vector>

#include "estimator/scene/scene_priors.h"
#include "estimator/scene/scene_strength.h"

namespace thicklens::estimator {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::size_t Index(Eigen::Index i) { return static_cast<std::size_t>(i); }

template <typename Real>
ImageMap<Real> MapOf(const MatrixXd& matrix) {
  const auto multiply = [](const MatrixXd& m, const Real* x, int channels, Real* y) {
    for (int channel = 0; channel < channels; ++channel) {
      for (Eigen::Index row = 0; row < m.rows(); ++row) {
        double sum = 0;
        for (Eigen::Index i = 0; i < m.cols(); ++i) {
          sum += m(row, i) * static_cast<double>(x[channel * m.cols() + i]);
        }
        y[channel * m.rows() + row] = static_cast<Real>(sum);
      }
    }
  };
  return {[matrix, multiply](const Real* x, int channels, Real* y) {
            multiply(matrix, x, channels, y);
          },
          [transposed = MatrixXd(matrix.transpose()), multiply](
              const Real* y, int channels, Real* x) { multiply(transposed, y, channels, x); }};
}

// A blur that is another one at each pixel, rows with sum 1.
MatrixXd MakeBlur(int width, int height) {
  MatrixXd blur = MatrixXd::Zero(width * height, width * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double sigma = 0.3 + 1.2 * x / width;
      for (int v = 0; v < height; ++v) {
        for (int u = 0; u < width; ++u) {
          const double r2 = (u - x) * (u - x) + (v - y) * (v - y);
          blur(y * width + x, v * width + u) = std::exp(-r2 / (2 * sigma * sigma));
        }
      }
      blur.row(y * width + x) /= blur.row(y * width + x).sum();
    }
  }
  return blur;
}

struct Made {
  int width = 0, height = 0, channels = 2;
  MatrixXd blur;
  VectorXd weight, slope_squared;
  MatrixXd photograph;  // a column a channel
};

// Makes a random case. The default size has more rows than a band.
Made MakeCase(int width = 7, int height = 20) {
  Made made;
  made.width = width;
  made.height = height;
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(0.2, 1);
  const int pixels = made.width * made.height;
  made.blur = MakeBlur(made.width, made.height);
  made.slope_squared = VectorXd::NullaryExpr(pixels, [&] { return uniform(engine); });
  made.weight = made.slope_squared.unaryExpr([&](double s2) { return s2 * uniform(engine); });
  made.photograph = MatrixXd::NullaryExpr(pixels, made.channels, [&] { return uniform(engine); });
  return made;
}

template <typename Real>
std::vector<Real> Values(const MatrixXd& matrix) {
  std::vector<Real> values;
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    values.push_back(static_cast<Real>(matrix.data()[i]));
  }
  return values;
}

template <typename Real>
DataTerm<Real> DataOf(const Made& made, int threads = 1) {
  DataTerm<Real> data;
  data.width_px = made.width;
  data.height_px = made.height;
  data.channels = made.channels;
  data.threads = threads;
  data.projection = MapOf<Real>(made.blur);
  data.photograph = Values<Real>(made.photograph);
  data.weight = Values<Real>(made.weight);
  data.row_norm2 = Values<Real>(made.blur.rowwise().squaredNorm());
  return data;
}

// Forward differences of all pixels, across then down; those that leave the image are 0.
MatrixXd Differences(const Made& made) {
  const int pixels = made.width * made.height;
  MatrixXd differences = MatrixXd::Zero(2 * pixels, pixels);
  for (int y = 0; y < made.height; ++y) {
    for (int x = 0; x < made.width; ++x) {
      const int here = y * made.width + x;
      if (x + 1 < made.width) {
        differences(here, here) = -1;
        differences(here, here + 1) = 1;
      }
      if (y + 1 < made.height) {
        differences(pixels + here, here) = -1;
        differences(pixels + here, here + made.width) = 1;
      }
    }
  }
  return differences;
}

MatrixXd GradientMatrix(const Made& made, const VectorXd& gradient_weight) {
  const MatrixXd differences = Differences(made);
  VectorXd twice(2 * gradient_weight.size());
  twice << gradient_weight, gradient_weight;
  return differences.transpose() * twice.asDiagonal() * differences;
}

MatrixXd DataMatrix(const Made& made) {
  return made.blur.transpose() * made.weight.asDiagonal() * made.blur;
}

RadianceLimits Accurate() {
  RadianceLimits limits;
  limits.tolerance = 1e-12;
  limits.max_iterations = 2000;
  return limits;
}

double LargestError(const std::vector<double>& found, const MatrixXd& expected) {
  double largest = 0;
  for (Eigen::Index i = 0; i < expected.size(); ++i) {
    largest = std::max(largest, std::abs(found[Index(i)] - expected.data()[i]));
  }
  return largest;
}

TEST(SceneSystem, SolvesTheRidge) {
  const Made made = MakeCase();
  constexpr double kMu = 0.02;
  const MatrixXd tikhonov_weight = (kMu * made.slope_squared).asDiagonal();
  const MatrixXd expected =
      (DataMatrix(made) + tikhonov_weight)
          .ldlt()
          .solve(made.blur.transpose() * made.weight.asDiagonal() * made.photograph +
                 tikhonov_weight * made.photograph);
  const DataTerm<double> data = DataOf<double>(made);
  const std::vector<double> slope_squared = Values<double>(made.slope_squared);
  SceneSystem<double> system(data);
  std::vector<double> found = data.photograph;
  const RadianceOutcome outcome =
      SolveRadiance(Prior::kRidge, kMu, data, slope_squared, Accurate(), &system, &found);
  EXPECT_LT(LargestError(found, expected), 1e-9);
  EXPECT_TRUE(outcome.converged);
  EXPECT_EQ(outcome.reweightings, 0);
  EXPECT_GT(outcome.iterations, 3);
}

TEST(SceneSystem, SolvesTheGradientPrior) {
  const Made made = MakeCase();
  constexpr double kEta = 0.03;
  const MatrixXd identity =
      MatrixXd::Identity(made.slope_squared.size(), made.slope_squared.size());
  const MatrixXd expected =
      (DataMatrix(made) + GradientMatrix(made, kEta * made.slope_squared) + 1e-6 * identity)
          .ldlt()
          .solve(made.blur.transpose() * made.weight.asDiagonal() * made.photograph);
  const DataTerm<double> data = DataOf<double>(made);
  SceneSystem<double> system(data);
  std::vector<double> found = data.photograph;
  SolveRadiance(Prior::kGradient, kEta, data, Values<double>(made.slope_squared), Accurate(),
                &system, &found);
  EXPECT_LT(LargestError(found, expected), 1e-8);
}

// [D181] The oracle has a slack z >= 0 for every bound: |H r - I - z|^2. Without r, which is a
// linear function of z, this is a least-squares problem in z >= 0, solved one variable at a time.
// The bounds are the brightest sixth of one channel, and every fifth pixel of the other.
bool IsBound(const Made& made, int channel, Eigen::Index i) {
  return channel == 0 ? made.photograph(i, 0) > 0.85 : i % 5 == 0;
}

struct BoundedCase {
  Made made = MakeCase();
  MatrixXd system;  // H^T W H + P, of one channel
  std::vector<std::size_t> bounds;
  MatrixXd expected;
  int met = 0, exceeded = 0;  // bounds with and without a residual
};

BoundedCase MakeBounded(const MatrixXd& prior, const MatrixXd& prior_right) {
  BoundedCase bounded;
  const Made& made = bounded.made;
  const Eigen::Index pixels = made.blur.rows();
  bounded.system = DataMatrix(made) + prior;
  const auto factor = bounded.system.ldlt();
  const MatrixXd weighted = made.blur.transpose() * made.weight.asDiagonal();
  bounded.expected = MatrixXd(pixels, made.channels);
  for (int channel = 0; channel < made.channels; ++channel) {
    std::vector<Eigen::Index> at;
    for (Eigen::Index i = 0; i < pixels; ++i) {
      if (IsBound(made, channel, i)) at.push_back(i);
    }
    const auto count = static_cast<Eigen::Index>(at.size());
    MatrixXd lift(pixels, count);  // W^(1/2) times what a slack changes, r included
    const VectorXd root = made.weight.cwiseSqrt();
    for (Eigen::Index j = 0; j < count; ++j) {
      bounded.bounds.push_back(static_cast<std::size_t>(channel * pixels + at[Index(j)]));
      lift.col(j) = factor.solve(weighted.col(at[Index(j)]));
    }
    const VectorXd start =
        factor.solve(weighted * made.photograph.col(channel) + prior_right.col(channel));
    // The derivative by z_j is -2 W_j ((H r(z))_j - I_j - z_j).
    MatrixXd shown(count, count);
    VectorXd left(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      left[i] = made.blur.row(at[Index(i)]).dot(start) - made.photograph(at[Index(i)], channel);
      for (Eigen::Index j = 0; j < count; ++j)
        shown(i, j) = made.blur.row(at[Index(i)]).dot(lift.col(j));
    }
    VectorXd slack = VectorXd::Zero(count);
    for (int sweep = 0; sweep < 5000; ++sweep) {
      for (Eigen::Index i = 0; i < count; ++i) {
        const double gradient = left[i] + shown.row(i).dot(slack) - slack[i];
        slack[i] = std::max(0.0, slack[i] + gradient / (1 - shown(i, i)));
      }
    }
    bounded.expected.col(channel) = start + lift * slack;
    for (Eigen::Index i = 0; i < count; ++i) ++(slack[i] > 0 ? bounded.exceeded : bounded.met);
  }
  return bounded;
}

TEST(SceneSystem, MeetsBoundsLikeLeastSquaresWithSlacks) {
  const Made made = MakeCase();
  constexpr double kMu = 0.02;
  VectorXd ridge = kMu * made.slope_squared;
  for (Eigen::Index i = 0; i < ridge.size(); ++i) {
    if (IsBound(made, 0, i) || IsBound(made, 1, i)) ridge[i] *= 0.01;
  }
  const MatrixXd tikhonov_weight = ridge.asDiagonal();
  const BoundedCase bounded = MakeBounded(tikhonov_weight, tikhonov_weight * made.photograph);
  ASSERT_GT(bounded.met, 10);
  ASSERT_GT(bounded.exceeded, 10);
  DataTerm<double> data = DataOf<double>(made);
  data.bounds = bounded.bounds;
  SceneSystem<double> system(data);
  std::vector<double> found = data.photograph;
  const RadianceOutcome outcome = SolveRadiance(
      Prior::kRidge, kMu, data, Values<double>(made.slope_squared), Accurate(), &system, &found);
  EXPECT_TRUE(outcome.converged);
  EXPECT_LT(LargestError(found, bounded.expected), 1e-8);
  DataTerm<double> all = DataOf<double>(made);
  SceneSystem<double> plain(all);
  std::vector<double> without = data.photograph;
  SolveRadiance(Prior::kRidge, kMu, all, Values<double>(made.slope_squared), Accurate(), &plain,
                &without);
  EXPECT_GT(LargestError(without, bounded.expected), 0.01);
  // The misfit has no part above the bounds.
  MatrixXd residual = made.blur * bounded.expected - made.photograph;
  for (const std::size_t i : data.bounds) residual.data()[i] = std::min(0.0, residual.data()[i]);
  double misfit = 0;
  for (int channel = 0; channel < made.channels; ++channel)
    misfit += made.weight.dot(residual.col(channel).cwiseAbs2());
  EXPECT_NEAR(system.DataMisfit(found), misfit, 1e-8);
}

TEST(SceneSystem, MeetsBoundsOfTheGradientPriorFromAnyStart) {
  const Made made = MakeCase();
  constexpr double kEta = 0.03;
  const MatrixXd prior =
      GradientMatrix(made, kEta * made.slope_squared) +
      1e-6 * MatrixXd::Identity(made.slope_squared.size(), made.slope_squared.size());
  const BoundedCase bounded =
      MakeBounded(prior, MatrixXd::Zero(made.photograph.rows(), made.channels));
  DataTerm<double> data = DataOf<double>(made);
  data.bounds = bounded.bounds;
  SceneSystem<double> system(data);
  for (const double start : {0.0, 1.0, 40.0}) {
    std::vector<double> found(data.photograph.size(), start);
    SolveRadiance(Prior::kGradient, kEta, data, Values<double>(made.slope_squared), Accurate(),
                  &system, &found);
    EXPECT_LT(LargestError(found, bounded.expected), 1e-7) << start;
  }
}

// No direction lowers the functional of total variation with bounds at its solution.
TEST(SceneSystem, MinimisesVariationWithBounds) {
  const Made made = MakeCase();
  constexpr double kLambda = 0.05;
  DataTerm<double> data = DataOf<double>(made);
  for (std::size_t i = 0; i < data.photograph.size(); i += 4) data.bounds.push_back(i);
  const std::vector<double> slope_squared = Values<double>(made.slope_squared);
  SceneSystem<double> system(data);
  std::vector<double> found = data.photograph;
  const RadianceOutcome outcome = SolveRadiance(Prior::kTotalVariation, kLambda, data,
                                                slope_squared, Accurate(), &system, &found);
  EXPECT_TRUE(outcome.converged);
  const MatrixXd differences = Differences(made);
  const Eigen::Index pixels = made.blur.rows();
  const auto functional = [&](const std::vector<double>& radiance) {
    const Eigen::Map<const MatrixXd> r(radiance.data(), pixels, made.channels);
    MatrixXd residual = made.blur * r - made.photograph;
    for (const std::size_t i : data.bounds) residual.data()[i] = std::min(0.0, residual.data()[i]);
    double sum = 1e-6 * r.squaredNorm();
    for (int channel = 0; channel < made.channels; ++channel)
      sum += made.weight.dot(residual.col(channel).cwiseAbs2());
    const MatrixXd steps = differences * r;
    for (Eigen::Index i = 0; i < pixels; ++i) {
      const double g = made.slope_squared[i] *
                       (steps.row(i).squaredNorm() + steps.row(pixels + i).squaredNorm());
      sum += kLambda * std::sqrt(g + kVariationEps * kVariationEps);
    }
    return sum;
  };
  const double least = functional(found);
  std::mt19937 engine(7);
  std::normal_distribution<double> normal(0, 1);
  for (int direction = 0; direction < 40; ++direction) {
    std::vector<double> tried = found;
    for (double& value : tried) value += 1e-3 * normal(engine);
    EXPECT_GT(functional(tried), least);
  }
  for (std::size_t i = 0; i < found.size(); i += 3) {
    for (const double step : {-1e-3, 1e-3}) {
      std::vector<double> tried = found;
      tried[i] += step;
      EXPECT_GT(functional(tried), least) << i;
    }
  }
}

TEST(SceneSystem, TheResidualIsThatOfAnyAnswer) {
  const Made made = MakeCase();
  const DataTerm<double> data = DataOf<double>(made);
  const std::vector<double> slope_squared = Values<double>(made.slope_squared);
  SceneSystem<double> system(data);
  system.SetPrior(GradientPrior(slope_squared, 0.1));
  const MatrixXd a = DataMatrix(made) + GradientMatrix(made, 0.1 * made.slope_squared) +
                     1e-6 * MatrixXd::Identity(made.blur.rows(), made.blur.cols());
  const MatrixXd b = made.blur.transpose() * made.weight.asDiagonal() * made.photograph;
  const MatrixXd x = MatrixXd::Constant(b.rows(), b.cols(), 0.4);
  EXPECT_NEAR(system.RelativeResidual(Values<double>(x)), (a * x - b).norm() / b.norm(), 1e-12);
}

// The total variation, written down again.
double Functional(const Made& made, double lambda, const MatrixXd& r) {
  double sum = 1e-6 * r.squaredNorm();
  const MatrixXd misfit = made.blur * r - made.photograph;
  for (Eigen::Index i = 0; i < r.rows(); ++i) {
    sum += made.weight[i] * misfit.row(i).squaredNorm();
    double squares = 0;
    for (Eigen::Index c = 0; c < r.cols(); ++c) {
      if (i % made.width + 1 < made.width) squares += std::pow(r(i + 1, c) - r(i, c), 2);
      if (i + made.width < r.rows()) squares += std::pow(r(i + made.width, c) - r(i, c), 2);
    }
    sum += lambda * std::sqrt(made.slope_squared[i] * squares + 0.004 * 0.004);
  }
  return sum;
}

MatrixXd MatrixOf(const Made& made, const std::vector<double>& values) {
  return Eigen::Map<const MatrixXd>(values.data(), made.width * made.height, made.channels);
}

// The minimum of the quadratic that touches the total variation at x.
void SolveReweighted(const CgLimits& limits, SceneSystem<double>* system, std::vector<double>* x) {
  bool touched = false;
  const auto renew = [&] {
    if (!touched) system->ReweightVariation();
    touched = true;
    return true;
  };
  system->SolveRenewed(limits, renew, x);
}

// Each quadratic is above the functional and touches it, so that no minimum of one is above the one
// before.
TEST(SceneSystem, ReweightingsLowerTheTotalVariationFunctionalToItsMinimum) {
  const Made made = MakeCase();
  constexpr double kLambda = 0.02;
  const DataTerm<double> data = DataOf<double>(made);
  const std::vector<double> slope_squared = Values<double>(made.slope_squared);
  SceneSystem<double> system(data);
  system.SetVariation(VariationPrior(slope_squared, kLambda));
  std::vector<double> radiance = data.photograph;
  CgLimits limits;
  limits.tolerance = 1e-10;
  limits.max_iterations = 1000;
  double before = Functional(made, kLambda, MatrixOf(made, radiance));
  const double first = before;
  for (int n = 0; n < 100; ++n) {
    SolveReweighted(limits, &system, &radiance);
    const double now = Functional(made, kLambda, MatrixOf(made, radiance));
    ASSERT_LE(now, before * (1 + 1e-9)) << n;
    before = now;
  }
  EXPECT_LT(before, 0.85 * first);
  const MatrixXd at = MatrixOf(made, radiance);
  for (Eigen::Index i = 0; i < at.size(); i += 13) {
    constexpr double kStep = 1e-5;
    MatrixXd more = at;
    MatrixXd less = at;
    more.data()[i] += kStep;
    less.data()[i] -= kStep;
    const double slope =
        (Functional(made, kLambda, more) - Functional(made, kLambda, less)) / (2 * kStep);
    EXPECT_NEAR(slope, 0, 2e-5) << i;
  }
}

TEST(SceneSystem, SolvesTotalVariationByAFewReweightings) {
  const Made made = MakeCase();
  constexpr double kLambda = 0.01;
  const DataTerm<double> data = DataOf<double>(made);
  SceneSystem<double> system(data);
  std::vector<double> radiance = data.photograph;
  RadianceLimits limits;
  int calls = 0;
  limits.on_iteration = [&] { ++calls; };
  const RadianceOutcome outcome =
      SolveRadiance(Prior::kTotalVariation, kLambda, data, Values<double>(made.slope_squared),
                    limits, &system, &radiance);
  EXPECT_EQ(calls, outcome.iterations);
  EXPECT_GT(outcome.reweightings, 1);
  EXPECT_LE(outcome.reweightings, outcome.iterations + 1);
  EXPECT_DOUBLE_EQ(outcome.relative_residual, system.RelativeResidual(radiance));
  EXPECT_EQ(outcome.converged, outcome.relative_residual <= limits.tolerance);
  // The minimum, by many.
  std::vector<double> best = radiance;
  CgLimits accurate;
  accurate.tolerance = 1e-10;
  for (int n = 0; n < 60; ++n) {
    SolveReweighted(accurate, &system, &best);
  }
  const double least = Functional(made, kLambda, MatrixOf(made, best));
  const double start = Functional(made, kLambda, made.photograph);
  EXPECT_LT(Functional(made, kLambda, MatrixOf(made, radiance)) - least, 0.01 * (start - least));
}

TEST(SceneSystem, StopsAtTheLimitOfIterationsAndSaysSo) {
  const Made made = MakeCase();
  const DataTerm<double> data = DataOf<double>(made);
  SceneSystem<double> system(data);
  for (const Prior prior : {Prior::kRidge, Prior::kGradient, Prior::kTotalVariation}) {
    std::vector<double> radiance = data.photograph;
    RadianceLimits limits;
    limits.tolerance = 1e-9;
    limits.max_iterations = 5;
    const RadianceOutcome outcome = SolveRadiance(
        prior, 1e-3, data, Values<double>(made.slope_squared), limits, &system, &radiance);
    EXPECT_EQ(outcome.iterations, 5);
    EXPECT_FALSE(outcome.converged);
    EXPECT_GT(outcome.relative_residual, 1e-9);
  }
}

TEST(SceneSystem, FloatAgreesWithDouble) {
  const Made made = MakeCase();
  const DataTerm<double> data = DataOf<double>(made);
  const DataTerm<float> data_f = DataOf<float>(made);
  for (const Prior prior : {Prior::kRidge, Prior::kGradient, Prior::kTotalVariation}) {
    SceneSystem<double> system(data);
    SceneSystem<float> system_f(data_f);
    std::vector<double> found = data.photograph;
    std::vector<float> found_f = data_f.photograph;
    RadianceLimits limits;
    limits.tolerance = 1e-5;
    SolveRadiance(prior, 5e-3, data, Values<double>(made.slope_squared), limits, &system, &found);
    SolveRadiance(prior, 5e-3, data_f, Values<float>(made.slope_squared), limits, &system_f,
                  &found_f);
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_NEAR(static_cast<double>(found_f[i]), found[i], 5e-4) << PriorName(prior);
    }
  }
}

TEST(SceneSystem, AnyNumberOfThreadsGivesTheSameBits) {
  const Made made = MakeCase();
  std::vector<float> first;
  for (const int threads : {1, 2, 3}) {
    const DataTerm<float> data = DataOf<float>(made, threads);
    SceneSystem<float> system(data);
    std::vector<float> radiance = data.photograph;
    SolveRadiance(Prior::kTotalVariation, 5e-3, data, Values<float>(made.slope_squared), {},
                  &system, &radiance);
    if (first.empty()) first = radiance;
    EXPECT_EQ(radiance, first) << threads;
  }
}

// V of the formula with the whole trace; one probe of 560 pixels is not exact.
TEST(SceneSystem, CrossValidationIsThatOfTheDenseMatrices) {
  const Made made = MakeCase(14, 40);
  const DataTerm<double> data = DataOf<double>(made);
  const std::vector<double> slope_squared = Values<double>(made.slope_squared);
  const VectorXd root = made.weight.cwiseSqrt();
  for (const bool ridge : {true, false}) {
    const double strength = 0.3;
    MatrixXd prior = 1e-6 * MatrixXd::Identity(made.blur.rows(), made.blur.cols());
    if (ridge) {
      prior = (strength * made.slope_squared).asDiagonal();
    } else {
      prior += GradientMatrix(made, strength * made.slope_squared);
    }
    MatrixXd right = made.blur.transpose() * made.weight.asDiagonal();
    if (ridge) right += prior;
    const MatrixXd smoother = made.blur * (DataMatrix(made) + prior).ldlt().solve(right);
    const MatrixXd misfit = root.asDiagonal() * (smoother * made.photograph - made.photograph);
    const double left = 1 - 1.4 * smoother.trace() / static_cast<double>(made.blur.rows());
    const double expected =
        misfit.squaredNorm() / static_cast<double>(misfit.size()) / (left * left);

    SceneSystem<double> system(data);
    std::vector<double> radiance = data.photograph;
    SolveRadiance(ridge ? Prior::kRidge : Prior::kGradient, strength, data, slope_squared,
                  Accurate(), &system, &radiance);
    int iterations = 0;
    EXPECT_NEAR(CrossValidation(data, radiance, {}, &system, &iterations), expected,
                0.1 * expected);
    EXPECT_GT(iterations, 0);
  }
}

}  // namespace
}  // namespace thicklens::estimator
