// The functional solver against dense solutions that are written down from the formulas.
#include "thicklens/estimator/functional_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "support/difference_matrix.h"
#include "support/error_message.h"
#include "tests/estimator/plain_rays.h"
#include "tests/estimator/solver_inputs.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {
namespace {

using testing::ExpectStepsAreReported;
using testing::GaussianWeights;
using ::testing::HasSubstr;
using testing::NoiseInput;
using testing::PhotographMatrix;
using testing::ViewMatrix;
using testing::WithSolverCamera;
using thicklens::testing::DifferenceMatrix;
using thicklens::testing::ErrorOf;

constexpr double kPi = 3.14159265358979323846;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::size_t Index(Eigen::Index i) { return static_cast<std::size_t>(i); }

// A slant with a jump in its right half, that hides something.
EstimateInput MakeInput(int width, int height, int channels, const Eigen::ArrayXXd& weights,
                        double jump_px = 1.7) {
  return NoiseInput(width, height, channels, weights, [=](double x, int) {
    return -0.6 + 1.1 * x / width + (2 * x >= width ? jump_px : 0);
  });
}

// A camera whose grid has ST elsewhere than in the plane of focus: rays land between the pixels.
EstimateInput MakeCameraInput(int width, int height) {
  return WithSolverCamera(MakeInput(width, height, 1, GaussianWeights(3, 3)), {0, 500},
                          [](int x) { return 600 + 30 * x; });
}

Eigen::VectorXd ChannelOf(const model::LinearImage& image, int channel) {
  Eigen::VectorXd values(image.width_px * image.height_px);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    values[i] = image.values[Index(i * image.channels + channel)];
  }
  return values;
}

// The minimiser R of |H R - I|^2 + gamma |D R|^2 + mu |R - R0|^2 by its normal equations, all rays
// at once; plane after plane.
Eigen::VectorXd DenseRays(const Eigen::MatrixXd& h, const Eigen::VectorXd& photograph, int u_count,
                          int v_count, double gamma, double mu) {
  const Eigen::Index pixels = h.rows();
  const Eigen::MatrixXd d = DifferenceMatrix(u_count, v_count);
  const Eigen::MatrixXd smooth = gamma * d.transpose() * d;
  Eigen::MatrixXd normal = h.transpose() * h;
  for (Eigen::Index k = 0; k < smooth.rows(); ++k) {
    for (Eigen::Index n = 0; n < smooth.cols(); ++n) {
      normal.block(k * pixels, n * pixels, pixels, pixels).diagonal().array() += smooth(k, n);
    }
  }
  normal.diagonal().array() += mu;
  const Eigen::VectorXd start = photograph.replicate(u_count * v_count, 1);
  return normal.ldlt().solve(h.transpose() * photograph + mu * start);
}

FunctionalOptions Precise() {
  FunctionalOptions options;
  options.tolerance = 1e-5;  // float reaches this tolerance reliably
  return options;
}

// `photograph_disparity` is the disparity of the rays that meet on the photograph's pixels;
// `radiance` is their mean.
void ExpectDenseSolution(const EstimateInput& input, const DisparityMap& photograph_disparity,
                         const model::LinearImage& radiance, const FunctionalOptions& options,
                         double accuracy = 2e-4) {
  const auto u_count = static_cast<int>(input.weights.cols());
  const auto v_count = static_cast<int>(input.weights.rows());
  FunctionalSummary summary;
  const model::LightField found = EstimateFunctional(input, options, RunOnThreads(1), &summary);
  EXPECT_TRUE(summary.converged) << summary.message;
  EXPECT_LE(summary.relative_residual, options.tolerance);
  EXPECT_GT(summary.iterations, 2);
  const double mu = options.ridge.value_or(1e-2 / (u_count * v_count));
  EXPECT_DOUBLE_EQ(summary.ridge, mu);
  EXPECT_EQ(summary.gamma, options.gamma);

  const Eigen::MatrixXd h = PhotographMatrix(photograph_disparity, input.weights);
  const Eigen::Index pixels = h.rows();
  for (int channel = 0; channel < input.image.channels; ++channel) {
    const Eigen::VectorXd rays =
        DenseRays(h, ChannelOf(radiance, channel), u_count, v_count, options.gamma, mu);
    for (int l = 0; l < v_count; ++l) {
      for (int k = 0; k < u_count; ++k) {
        const Eigen::VectorXd expected =
            ViewMatrix(input.disparity, found.u_offset(k), found.v_offset(l)) *
            rays.segment((l * u_count + k) * pixels, pixels);
        const model::LinearImage view = model::ViewImage(found, k, l);
        EXPECT_LT((ChannelOf(view, channel) - expected).lpNorm<Eigen::Infinity>(), accuracy)
            << "view " << k << ", " << l << ", channel " << channel;
      }
    }
  }
}

TEST(FunctionalSolver, MinimisesTheFunctional) {
  const EstimateInput input = MakeInput(8, 7, 1, GaussianWeights(3, 3));
  ExpectDenseSolution(input, input.disparity, input.image, Precise());
}

// The result is exact to the rounding of a light field, which is stored in float.
TEST(FunctionalSolver, MinimisesItInDouble) {
  FunctionalOptions options = Precise();
  options.double_precision = true;
  options.tolerance = 1e-12;
  const EstimateInput input = MakeInput(8, 7, 3, GaussianWeights(3, 3));
  ExpectDenseSolution(input, input.disparity, input.image, options, 2e-7);
}

TEST(FunctionalSolver, MinimisesItForOtherStrengths) {
  const EstimateInput input = MakeInput(9, 5, 1, GaussianWeights(3, 3));
  FunctionalOptions options = Precise();
  options.gamma = 0.02;
  options.ridge = 0.004;
  ExpectDenseSolution(input, input.disparity, input.image, options);
}

TEST(FunctionalSolver, MinimisesItInColourForUnequalCounts) {
  const EstimateInput input = MakeInput(10, 4, 3, GaussianWeights(4, 2));
  ExpectDenseSolution(input, input.disparity, input.image, Precise());
}

TEST(FunctionalSolver, MinimisesItWhereViewsHaveNoWeight) {
  Eigen::ArrayXXd weights = GaussianWeights(3, 3);
  weights(0, 0) = 0;
  weights(2, 1) = 0;
  weights /= weights.sum();
  const EstimateInput input = MakeInput(8, 6, 1, weights);
  ExpectDenseSolution(input, input.disparity, input.image, Precise());
}

TEST(FunctionalSolver, MinimisesItOnPlanesWhereRaysLandBetweenPixels) {
  const EstimateInput input = MakeCameraInput(9, 6);
  const Eigen::Vector2d landing_px = WarpedLightField(input, true, 1).landing_step_px;
  ASSERT_GT(std::abs(landing_px.x()), 0.2);
  DisparityMap photograph_disparity = input.disparity;
  for (float& d : photograph_disparity.disparity) {
    d -= static_cast<float>(landing_px.x() / input.disparity.step.x());
  }
  const model::LinearImage radiance =
      WithoutFalloff(input.image, *input.grid, *input.camera, input.weights, 1);
  ExpectDenseSolution(input, photograph_disparity, radiance, Precise());
  FunctionalOptions options = Precise();
  options.falloff = false;
  ExpectDenseSolution(input, photograph_disparity, input.image, options);
}

// Strong smoothness leaves one radiance r for all rays of a point: |H r - I|^2 + U V mu |r - I|^2.
TEST(FunctionalSolver, TendsToAnEvenRadianceWithARidge) {
  const EstimateInput input = MakeInput(13, 9, 1, GaussianWeights(3, 3));
  FunctionalOptions options = Precise();
  options.gamma = 1e5;
  options.ridge = 0.02 / 9;
  FunctionalSummary summary;
  const model::LightField found = EstimateFunctional(input, options, RunOnThreads(1), &summary);

  const Eigen::MatrixXd rays = PhotographMatrix(input.disparity, input.weights);
  const Eigen::Index pixels = rays.rows();
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(pixels, pixels);
  for (int k = 0; k < 9; ++k) h += rays.middleCols(k * pixels, pixels);
  Eigen::MatrixXd normal = h.transpose() * h;
  normal.diagonal().array() += 0.02;
  const Eigen::VectorXd photograph = ChannelOf(input.image, 0);
  const Eigen::VectorXd radiance =
      normal.ldlt().solve(h.transpose() * photograph + 0.02 * photograph);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::VectorXd expected = ViewMatrix(input.disparity, k - 1, l - 1) * radiance;
      EXPECT_LT((ChannelOf(model::ViewImage(found, k, l), 0) - expected).lpNorm<Eigen::Infinity>(),
                2e-4);
    }
  }
}

TEST(FunctionalSolver, AConstantImageHasAConstantLightField) {
  EstimateInput input = MakeInput(21, 13, 3, GaussianWeights(3, 3));
  for (std::size_t i = 0; i < input.image.values.size(); ++i) {
    input.image.values[i] = 0.2F * static_cast<float>(i % 3);
  }
  FunctionalSummary summary;
  const model::LightField found = EstimateFunctional(input, Precise(), RunOnThreads(1), &summary);
  for (int channel = 0; channel < 3; ++channel) {
    for (std::size_t i = found.ViewStart(channel, 0, 0);
         i < found.ViewStart(channel, 0, 0) + 9 * found.view_size(); ++i) {
      ASSERT_NEAR(found.values[i], 0.2F * static_cast<float>(channel), 1e-5);
    }
  }
}

// A sharp plane out of focus: views of the truth are the texture, displaced.
TEST(FunctionalSolver, IsNearerToTheTruthThanTheWarpedPhotograph) {
  constexpr int kSize = 72;
  constexpr double kDisparity = 0.8;
  const auto texture = [](double x, double y) {
    return 0.5 + 0.12 * std::cos(2 * kPi * (0.11 * x + 0.05 * y)) +
           0.12 * std::cos(2 * kPi * (0.07 * x - 0.12 * y)) + 0.1 * std::sin(2 * kPi * 0.02 * x);
  };
  const auto view = [&](double a, double b, int i) {
    return texture(i % kSize + a * kDisparity, i / kSize + b * kDisparity);
  };
  EstimateInput input = MakeInput(kSize, kSize, 1, GaussianWeights(5, 5), 0);
  // An aperture of five times as many samples with the same second moment.
  const Eigen::ArrayXXd fine = GaussianWeights(25, 25);
  const auto moment = [](const Eigen::ArrayXXd& weights) {
    double sum = 0;
    for (Eigen::Index k = 0; k < weights.cols(); ++k) {
      const double a = static_cast<double>(k) - static_cast<double>(weights.cols() - 1) / 2;
      sum += weights.col(k).sum() * a * a;
    }
    return sum;
  };
  const double scale = std::sqrt(moment(input.weights) / moment(fine));
  for (int i = 0; i < kSize * kSize; ++i) {
    double sum = 0;
    for (int l = 0; l < 25; ++l) {
      for (int k = 0; k < 25; ++k) {
        sum += fine(l, k) * view((k - 12) * scale, (l - 12) * scale, i);
      }
    }
    input.image.values[Index(i)] = static_cast<float>(sum);
    input.disparity.disparity[Index(i)] = static_cast<float>(kDisparity);
  }
  FunctionalSummary summary;
  const model::LightField found = EstimateFunctional(input, {}, {}, &summary);
  const model::LightField warped = WarpedLightField(input, true, 1);
  const auto squared_error = [&](const model::LightField& light_field) {
    double sum = 0;
    for (int l = 0; l < 5; ++l) {
      for (int k = 0; k < 5; ++k) {
        for (int i = 0; i < kSize * kSize; ++i) {
          const int x = i % kSize, y = i / kSize;
          if (x < 8 || y < 8 || x >= kSize - 8 || y >= kSize - 8) continue;
          const double error =
              light_field.values[light_field.ViewStart(0, k, l) + Index(i)] - view(k - 2, l - 2, i);
          sum += error * error;
        }
      }
    }
    return sum;
  };
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(squared_error(found), squared_error(warped) / 10);
}

TEST(FunctionalSolver, SameBitsOnAnyNumberOfThreads) {
  const EstimateInput input = MakeInput(101, 67, 3, GaussianWeights(5, 3));
  FunctionalSummary summary;
  const model::LightField one = EstimateFunctional(input, {}, RunOnThreads(1), &summary);
  for (const int threads : {2, 3}) {
    EXPECT_EQ(EstimateFunctional(input, {}, RunOnThreads(threads), &summary).values, one.values);
    EXPECT_EQ(summary.threads, threads);
  }
}

TEST(FunctionalSolver, FloatIsAsGoodAsDouble) {
  const EstimateInput input = MakeInput(101, 67, 1, GaussianWeights(5, 5));
  FunctionalOptions options;
  options.tolerance = 1e-5;
  FunctionalSummary in_float, in_double;
  const model::LightField one = EstimateFunctional(input, options, {}, &in_float);
  options.double_precision = true;
  const model::LightField other = EstimateFunctional(input, options, {}, &in_double);
  EXPECT_NE(one.values, other.values);
  for (std::size_t i = 0; i < one.values.size(); ++i) {
    ASSERT_NEAR(one.values[i], other.values[i], 1e-4) << i;
  }
}

TEST(FunctionalSolver, TheLightFieldHasItsOrigin) {
  const EstimateInput input = MakeCameraInput(20, 10);
  FunctionalSummary summary;
  EXPECT_EQ(summary.message, "not run");
  const model::LightField found = EstimateFunctional(input, {}, {}, &summary);
  std::string why;
  EXPECT_TRUE(found.IsValid(&why)) << why;
  EXPECT_EQ(found.origin.method, "functional");
  EXPECT_EQ(found.origin.gamma, 1);
  EXPECT_EQ(found.origin.ridge, 1e-2 / 9);
  EXPECT_EQ(found.origin.iterations, summary.iterations);
  EXPECT_THAT(found.origin.effects, ::testing::ElementsAre("defocus", "falloff"));
  EXPECT_TRUE(found.camera.has_value());
  EXPECT_NE(found.landing_step_px.x(), 0);
  EXPECT_GT(summary.predicted_memory_mib, 0);
}

TEST(FunctionalSolver, MissingConvergenceIsReported) {
  const EstimateInput input = MakeInput(40, 30, 1, GaussianWeights(3, 3));
  FunctionalOptions options;
  options.max_iterations = 2;
  options.tolerance = 1e-4;
  FunctionalSummary summary;
  EstimateFunctional(input, options, {}, &summary);
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(summary.iterations, 2);
  EXPECT_GT(summary.relative_residual, 1e-4);
  EXPECT_THAT(summary.message, HasSubstr("above the tolerance"));
  // Float cannot reach this tolerance, so the solver stops and reports that.
  options.max_iterations = 100000;
  options.tolerance = 1e-12;
  EstimateFunctional(input, options, {}, &summary);
  EXPECT_FALSE(summary.converged);
  EXPECT_LT(summary.relative_residual, 1e-5);
  EXPECT_LT(summary.iterations, 2000);
}

TEST(FunctionalSolver, CountsItsStepsAndStopsOnRequest) {
  const EstimateInput input = MakeInput(40, 30, 3, GaussianWeights(3, 3));
  const int steps = ExpectStepsAreReported([&](const SolverRun& run) {
    FunctionalSummary summary;
    EstimateFunctional(input, {}, run, &summary);
  });
  EXPECT_GT(steps, 9 * 4);
}

TEST(FunctionalSolver, RefusesMoreMemoryThanItMayHave) {
  const EstimateInput input = MakeInput(200, 200, 1, GaussianWeights(7, 7));
  SolverRun run;
  run.memory_limit_mib = 10;
  FunctionalSummary summary;
  EXPECT_THAT(ErrorOf([&] { EstimateFunctional(input, {}, run, &summary); }),
              HasSubstr("memory limit 10 MiB"));
  run.memory_limit_mib = 10000;
  EstimateFunctional(input, {}, run, &summary);
  EXPECT_LT(summary.predicted_memory_mib, 10000);
  // A plane and a disparity for each of the rays, and the light field.
  EXPECT_GT(summary.predicted_memory_mib, 200.0 * 200 * 49 * 3 * 4 / (1 << 20));
}

TEST(FunctionalSolver, RefusesOptionsThatDoNotFit) {
  const EstimateInput input = MakeInput(8, 7, 1, GaussianWeights(3, 3));
  FunctionalSummary summary;
  const auto error = [&](const std::function<void(FunctionalOptions*)>& change) {
    FunctionalOptions options;
    change(&options);
    return ErrorOf([&] { EstimateFunctional(input, options, {}, &summary); });
  };
  EXPECT_THAT(error([](auto* o) { o->gamma = 0; }), HasSubstr("gamma is 0"));
  EXPECT_THAT(error([](auto* o) { o->gamma = kNan; }), HasSubstr("gamma is nan"));
  EXPECT_THAT(error([](auto* o) { o->ridge = 0; }), HasSubstr("ridge is 0"));
  EXPECT_THAT(error([](auto* o) { o->ridge = kNan; }), HasSubstr("ridge is nan"));
  EXPECT_THAT(error([](auto* o) { o->tolerance = 1; }), HasSubstr("tolerance is 1"));
  EXPECT_THAT(error([](auto* o) { o->tolerance = 0; }), HasSubstr("tolerance is 0"));
  EXPECT_THAT(error([](auto* o) { o->max_iterations = 0; }), HasSubstr("max_iterations is 0"));
  EXPECT_THAT(ErrorOf([&] { EstimateFunctional(input, {}, RunOnThreads(-1), &summary); }),
              HasSubstr("functional solver: threads is -1"));
  EstimateInput holes = input;
  holes.disparity.disparity[3] = static_cast<float>(kNan);
  EXPECT_THAT(ErrorOf([&] { EstimateFunctional(holes, {}, {}, &summary); }), HasSubstr("holes"));
}

}  // namespace
}  // namespace thicklens::estimator
