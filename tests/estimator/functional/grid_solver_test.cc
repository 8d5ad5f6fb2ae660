// The functional on the grid: H and D against the matrices of the kernels, the solver against one
// block as large as the image, and against a dense solution that is written down from the
// formulas.
#include "thicklens/estimator/grid_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "estimator/blocks/block_system.h"
#include "estimator/functional/grid_links.h"
#include "estimator/projection/grid_photograph.h"
#include "estimator/views/warped_views.h"
#include "support/error_message.h"
#include "tests/estimator/solver_inputs.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {
namespace {

using ::testing::ElementsAre;
using testing::ExpectStepsAreReported;
using testing::GaussianWeights;
using ::testing::HasSubstr;
using testing::NoiseInput;
using testing::WithSolverCamera;
using thicklens::testing::ErrorOf;

std::size_t Index(Eigen::Index i) { return static_cast<std::size_t>(i); }

// A slant with a near patch that hides some of it.
EstimateInput Occluded(int width, int height, int channels, const Eigen::ArrayXXd& weights) {
  return NoiseInput(width, height, channels, weights, [=](int x, int y) {
    const bool patch = x > width / 3 && x < 2 * width / 3 && y > height / 3 && y < height - 2;
    return patch ? 1.6 : -0.8 + 1.4 * x / width - 0.3 * y / height;
  });
}

// ST elsewhere than in the plane of focus: rays land beside the pixels, some beside the image.
EstimateInput WithCamera(int width, int height, double st_depth_mm) {
  return WithSolverCamera(Occluded(width, height, 1, GaussianWeights(3, 3)), {0, st_depth_mm},
                          [](int x) { return 600 + 30 * x; });
}

std::vector<EstimateInput> Inputs() {
  Eigen::ArrayXXd some = GaussianWeights(3, 3);
  some(0, 1) = some(2, 2) = 0;
  some /= some.sum();
  return {
      Occluded(23, 17, 1, GaussianWeights(3, 5)), Occluded(19, 13, 1, some),
      Occluded(16, 9, 1, GaussianWeights(4, 1)), Occluded(12, 15, 1, GaussianWeights(1, 3)),
      // Longer than a band; whole disparities, one but for rounding; the steps of a camera.
      NoiseInput(530, 5, 1, GaussianWeights(3, 2), [](int x, int) { return 0.9 - 0.004 * x; }),
      NoiseInput(11, 8, 1, GaussianWeights(3, 3), [](int x, int) { return x < 6 ? 1.0 : -2.0; }),
      NoiseInput(9, 6, 1, GaussianWeights(3, 3), [](int, int) { return 1e-20; }),
      NoiseInput(1, 9, 1, GaussianWeights(3, 3), [](int, int) { return 0.0; }),
      WithCamera(17, 12, 800), WithCamera(17, 12, 500), WithCamera(17, 12, 250),
      WithCamera(17, 12, 2000),
      // Higher than two bands of the photograph.
      WithCamera(6, 75, 250)};
}

std::vector<double> RandomNumbers(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> numbers(count);
  for (double& number : numbers) number = uniform(engine);
  return numbers;
}

double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// H and D of one input by both ways. Blocks number rays by the pixels they land on, and have no
// others.
class Operators {
 public:
  explicit Operators(const EstimateInput& input, int threads = 1)
      : field_(input, true, 1),
        block_(field_.Block(0, 0, input.image.width_px, input.image.height_px)) {
    light_field_ = WarpToAllViews(input, true, 1, &disparity_);
    std::vector<std::vector<float>> irradiance;
    const std::vector<double> of_block = field_.IrradianceOf(block_);
    if (!of_block.empty()) {
      irradiance.resize(Index(block_.views()), std::vector<float>(light_field_.view_size()));
      ForRays([&](std::size_t ray, std::size_t sample) {
        irradiance[sample / light_field_.view_size()][sample % light_field_.view_size()] =
            static_cast<float>(of_block[ray]);
      });
    }
    links = std::make_unique<GridLinks>(input.disparity, disparity_, block_, threads);
    photograph = std::make_unique<GridPhotograph<double>>(block_, irradiance, threads);
    const auto kernels = kernels::NewReference<double>();
    const auto splat = kernels::Splat::kBilinear;
    h = kernels::Compress(
        kernels->WeightRays(block_, splat, kernels->FindRays(block_, splat), of_block));
    const RayField::Slopes slopes = field_.SlopesOf(block_, true);
    d = kernels::Compress(kernels->WarpDifferences(block_, slopes.u, slopes.v));
  }

  std::size_t samples() const { return light_field_.view_size() * Index(block_.views()); }
  // Converts to the numbering of blocks and back (0 for rays that are in no block).
  std::vector<double> ToBlock(const std::vector<double>& samples) const {
    std::vector<double> rays(Index(block_.rays()));
    ForRays([&](std::size_t ray, std::size_t sample) { rays[ray] = samples[sample]; });
    return rays;
  }
  std::vector<double> FromBlock(const std::vector<double>& rays) const {
    std::vector<double> found(samples());
    ForRays([&](std::size_t ray, std::size_t sample) { found[sample] = rays[ray]; });
    return found;
  }

  std::unique_ptr<GridLinks> links;
  std::unique_ptr<GridPhotograph<double>> photograph;
  kernels::CsrMatrix<double> h, d;

 private:
  void ForRays(const std::function<void(std::size_t ray, std::size_t sample)>& visit) const {
    for (int view = 0; view < block_.views(); ++view) {
      const int k = view % block_.u_count, l = view / block_.u_count;
      for (int y = 0; y < block_.height_px; ++y) {
        for (int x = 0; x < block_.width_px; ++x) {
          if (!block_.Exists(k, l, x, y)) continue;
          const int s = x - block_.s_shift[Index(k)], t = y - block_.t_shift[Index(l)];
          visit(Index(view * block_.pixels() + y * block_.width_px + x),
                Index((view * block_.t_count + t) * block_.s_count + s));
        }
      }
    }
  }

  RayField field_;
  kernels::BlockGeometry block_;
  model::LightField light_field_;
  std::vector<std::vector<float>> disparity_;
};

TEST(GridPhotograph, IsTheMatrixOfTheKernels) {
  const auto kernels = kernels::NewReference<double>();
  for (const EstimateInput& input : Inputs()) {
    for (const int threads : {1, 2, 50}) {
      const Operators operators(input, threads);
      const std::vector<double> rays = RandomNumbers(operators.samples(), 1);
      std::vector<double> found(operators.photograph->pixels());
      operators.photograph->Apply(rays.data(), found.data());
      const std::vector<double> expected = kernels->Multiply(operators.h, operators.ToBlock(rays));
      for (std::size_t i = 0; i < found.size(); ++i) ASSERT_NEAR(found[i], expected[i], 1e-6);
    }
  }
}

// Otherwise the inputs would not test what they are made for.
TEST(GridPhotograph, SomeRaysLandNearerToAnotherPixel) {
  const auto step_px = [](double st_depth_mm) {
    return WarpedLightField(WithCamera(17, 12, st_depth_mm), true, 1).landing_step_px.x();
  };
  EXPECT_GT(std::abs(step_px(250)), 0.6);
  EXPECT_LT(step_px(250) * step_px(2000), 0);  // to either side
}

TEST(GridPhotograph, PassesTheDotProductTest) {
  for (const EstimateInput& input : Inputs()) {
    const Operators operators(input);
    const std::vector<double> x = RandomNumbers(operators.samples(), 2);
    const std::vector<double> y = RandomNumbers(operators.photograph->pixels(), 3);
    std::vector<double> forward(y.size()), back(x.size());
    operators.photograph->Apply(x.data(), forward.data());
    operators.photograph->AddTransposed(y.data(), back.data());
    EXPECT_NEAR(Dot(forward, y), Dot(x, back), 1e-12 * static_cast<double>(y.size()));
  }
}

TEST(GridLinks, AreTheDifferencesOfTheKernels) {
  const auto kernels = kernels::NewReference<double>();
  for (const EstimateInput& input : Inputs()) {
    const Operators operators(input);
    const std::vector<double> rays = RandomNumbers(operators.samples(), 4);
    std::vector<double> found(rays.size());
    operators.links->Apply(0.7, 0.2, rays.data(), found.data());
    const std::vector<double> expected = operators.FromBlock(kernels->MultiplyTransposed(
        operators.d, kernels->Multiply(operators.d, operators.ToBlock(rays))));
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_NEAR(found[i], 0.7 * expected[i] + 0.2 * rays[i], 1e-12)
          << input.image.width_px << "x" << input.image.height_px << ", ray " << i;
    }
  }
}

TEST(GridLinks, AreSymmetric) {
  for (const EstimateInput& input : Inputs()) {
    const Operators operators(input);
    const std::vector<double> x = RandomNumbers(operators.samples(), 5);
    const std::vector<double> y = RandomNumbers(operators.samples(), 6);
    std::vector<double> of_x(x.size()), of_y(y.size());
    operators.links->Apply(1, 0, x.data(), of_x.data());
    operators.links->Apply(1, 0, y.data(), of_y.data());
    EXPECT_NEAR(Dot(of_x, y), Dot(x, of_y), 1e-12 * static_cast<double>(x.size()));
  }
}

GridOptions Precise() {
  GridOptions options;
  options.double_precision = true;
  options.tolerance = 1e-11;
  options.max_iterations = 10000;
  return options;
}

model::LightField OneBlock(const EstimateInput& input, const GridOptions& options) {
  BlockOptions blocks;
  blocks.solver = BlockSolver::kEigen;
  blocks.gamma = options.gamma;
  blocks.ridge = options.ridge;
  blocks.falloff = options.falloff;
  blocks.block_px = std::max(input.image.width_px, input.image.height_px);
  BlockSummary summary;
  return EstimateByBlocks(input, blocks, RunOnThreads(1), &summary);
}

void ExpectOneBlock(const EstimateInput& input, const GridOptions& options,
                    double accuracy = 2e-6) {
  FunctionalSummary summary;
  const model::LightField found = EstimateOnGrid(input, options, RunOnThreads(1), &summary);
  EXPECT_TRUE(summary.converged) << summary.message;
  const model::LightField expected = OneBlock(input, options);
  ASSERT_EQ(found.values.size(), expected.values.size());
  for (std::size_t i = 0; i < found.values.size(); ++i) {
    ASSERT_NEAR(found.values[i], expected.values[i], accuracy)
        << input.image.width_px << "x" << input.image.height_px << ", " << i;
  }
}

TEST(GridSolver, IsOneBlockAsLargeAsTheImage) {
  for (const EstimateInput& input : Inputs()) {
    if (input.image.width_px < 100) ExpectOneBlock(input, Precise());
  }
}

TEST(GridSolver, IsOneBlockForOtherStrengthsAndColours) {
  GridOptions options = Precise();
  options.gamma = 0.05;
  options.ridge = 0.02;
  ExpectOneBlock(Occluded(14, 11, 3, GaussianWeights(3, 3)), options);
  ExpectOneBlock(Occluded(14, 11, 5, GaussianWeights(3, 3)), options);
  options.falloff = false;
  ExpectOneBlock(WithCamera(14, 11, 500), options);
}

TEST(GridSolver, IsOneBlockInFloat) {
  GridOptions options = Precise();
  options.double_precision = false;
  options.tolerance = 1e-5;
  ExpectOneBlock(Occluded(23, 17, 1, GaussianWeights(3, 3)), options, 1e-3);
}

// All points at one disparity in (0, 1): dense H and D of the formulas.
TEST(GridSolver, MinimisesTheFunctional) {
  constexpr int kWidth = 8, kHeight = 7, kViews = 3, kPixels = kWidth * kHeight;
  constexpr double kDisparity = 0.4, kGamma = 0.8, kRidge = 0.01;
  const EstimateInput input = NoiseInput(kWidth, kHeight, 1, GaussianWeights(kViews, kViews),
                                         [](int, int) { return kDisparity; });
  const auto ray = [](int k, int l, int s, int t) {
    return ((l * kViews + k) * kHeight + t) * kWidth + s;
  };
  constexpr int kRays = kViews * kViews * kPixels;
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(kPixels, kRays);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(kRays, kRays) * kRidge;
  const auto add_difference = [&](int here, int near, int far) {
    // If m = -0.4, the near sample is at the ray's own position less one and has the weight 0.4.
    Eigen::VectorXd row = Eigen::VectorXd::Zero(kRays);
    const double w = static_cast<float>(kDisparity);
    row[here] = -1;
    row[near] = w;
    row[far] = 1 - w;
    normal += kGamma * row * row.transpose();
  };
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      for (int t = 0; t < kHeight; ++t) {
        for (int s = 0; s < kWidth; ++s) {
          h(t * kWidth + s, ray(k, l, s, t)) = input.weights(l, k);
          if (k + 1 < kViews && s > 0)
            add_difference(ray(k, l, s, t), ray(k + 1, l, s - 1, t), ray(k + 1, l, s, t));
          if (l + 1 < kViews && t > 0)
            add_difference(ray(k, l, s, t), ray(k, l + 1, s, t - 1), ray(k, l + 1, s, t));
        }
      }
    }
  }
  normal += h.transpose() * h;
  const model::LightField prior = WarpedLightField(input, true, 1);
  const Eigen::VectorXd right =
      h.transpose() *
          Eigen::Map<const Eigen::VectorXf>(input.image.values.data(), kPixels).cast<double>() +
      kRidge * Eigen::Map<const Eigen::VectorXf>(prior.values.data(), kRays).cast<double>();
  const Eigen::VectorXd expected = normal.ldlt().solve(right);

  GridOptions options = Precise();
  options.gamma = kGamma;
  options.ridge = kRidge;
  FunctionalSummary summary;
  const model::LightField found = EstimateOnGrid(input, options, RunOnThreads(1), &summary);
  EXPECT_TRUE(summary.converged);
  for (int i = 0; i < kRays; ++i) ASSERT_NEAR(found.values[Index(i)], expected[i], 1e-6) << i;

  // If the solver stops early, the reported residual is that of the answer in this system.
  options.max_iterations = 7;
  options.double_precision = false;
  const model::LightField early = EstimateOnGrid(input, options, RunOnThreads(1), &summary);
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(summary.iterations, 7);
  const Eigen::VectorXd answer =
      Eigen::Map<const Eigen::VectorXf>(early.values.data(), kRays).cast<double>();
  EXPECT_NEAR(summary.relative_residual, (right - normal * answer).norm() / right.norm(), 1e-6);
  EXPECT_THAT(summary.message, HasSubstr("above the tolerance"));
}

// Rays that land beside the image are no unknowns.
TEST(GridSolver, TheReportedResidualIsThatOfTheBlocksSystem) {
  const EstimateInput input = WithCamera(17, 12, 250);
  GridOptions options = Precise();
  options.max_iterations = 4;
  FunctionalSummary summary;
  const model::LightField found = EstimateOnGrid(input, options, RunOnThreads(1), &summary);
  const RayField field(input, true, 1);
  const auto kernels = kernels::NewReference<double>();
  const BlockSystem system =
      MakeBlockSystem(field, field.Block(0, 0, 17, 12), {}, 1e-2 / 9, kernels.get());
  const std::vector<double> answer =
      Operators(input).ToBlock({found.values.begin(), found.values.end()});
  const std::vector<double> product = kernels->Multiply(system.matrix, answer);
  double left = 0;
  for (std::size_t i = 0; i < product.size(); ++i) {
    left += std::pow(system.right_sides[0][i] - product[i], 2);
  }
  const double right = Dot(system.right_sides[0], system.right_sides[0]);
  EXPECT_NEAR(summary.relative_residual, std::sqrt(left / right), 1e-5 * summary.relative_residual);
}

// A flat scene of one radiance is its own light field; where there is a camera, radiance.
TEST(GridSolver, AConstantImageHasAConstantLightField) {
  EstimateInput input = Occluded(31, 22, 3, GaussianWeights(3, 3));
  for (std::size_t i = 0; i < input.image.values.size(); ++i) {
    input.image.values[i] = 0.2F * static_cast<float>(i % 3 + 1);
  }
  GridOptions options;
  options.tolerance = 1e-5;
  FunctionalSummary summary;
  const model::LightField found = EstimateOnGrid(input, options, RunOnThreads(1), &summary);
  for (int channel = 0; channel < 3; ++channel) {
    const std::size_t start = found.ViewStart(channel, 0, 0);
    for (std::size_t i = start; i < start + 9 * found.view_size(); ++i) {
      ASSERT_NEAR(found.values[i], 0.2F * static_cast<float>(channel + 1), 1e-4);
    }
  }
}

TEST(GridSolver, SameBitsOnAnyNumberOfThreads) {
  for (const EstimateInput& input :
       {Occluded(301, 37, 3, GaussianWeights(5, 3)), WithCamera(91, 70, 500)}) {
    GridOptions options;
    options.max_iterations = 15;
    FunctionalSummary summary;
    const model::LightField one = EstimateOnGrid(input, options, RunOnThreads(1), &summary);
    for (const int threads : {2, 3}) {
      EXPECT_EQ(EstimateOnGrid(input, options, RunOnThreads(threads), &summary).values, one.values);
      EXPECT_EQ(summary.threads, threads);
    }
  }
}

TEST(GridSolver, TheLightFieldHasItsOrigin) {
  FunctionalSummary summary;
  const model::LightField found = EstimateOnGrid(WithCamera(20, 12, 500), {}, {}, &summary);
  std::string why;
  EXPECT_TRUE(found.IsValid(&why)) << why;
  EXPECT_EQ(found.origin.method, "grid");
  EXPECT_EQ(found.origin.device, "cpu");
  EXPECT_EQ(found.origin.gamma, 1);
  EXPECT_EQ(found.origin.ridge, 1e-2 / 9);
  EXPECT_EQ(found.origin.iterations, summary.iterations);
  EXPECT_EQ(found.origin.relative_residual, summary.relative_residual);
  EXPECT_THAT(found.origin.effects, ElementsAre("defocus", "falloff"));
  EXPECT_NE(found.landing_step_px.x(), 0);
  EXPECT_TRUE(summary.converged);
  EXPECT_LE(summary.relative_residual, 1e-3);
}

TEST(GridSolver, CountsItsStepsAndStopsOnRequest) {
  const EstimateInput input = Occluded(40, 30, 3, GaussianWeights(3, 3));
  const int steps = ExpectStepsAreReported([&](const SolverRun& run) {
    FunctionalSummary summary;
    EstimateOnGrid(input, {}, run, &summary);
  });
  EXPECT_GT(steps, 30);
}

TEST(GridSolver, RefusesMoreMemoryThanItMayHave) {
  const EstimateInput input = Occluded(200, 200, 1, GaussianWeights(7, 7));
  GridOptions options;
  SolverRun run;
  run.memory_limit_mib = 10;
  FunctionalSummary summary;
  EXPECT_THAT(ErrorOf([&] { EstimateOnGrid(input, options, run, &summary); }),
              AllOf(HasSubstr("memory limit 10 MiB"), HasSubstr("at least as large")));
  run.memory_limit_mib = 10000;
  options.max_iterations = 1;
  EstimateOnGrid(input, options, run, &summary);
  // Four vectors, the light field and a disparity for each of the rays.
  const double rays_mib = 200.0 * 200 * 49 * 4 / (1 << 20);
  EXPECT_GT(summary.predicted_memory_mib, 6 * rays_mib);
  options.double_precision = true;
  EstimateOnGrid(input, options, run, &summary);
  EXPECT_GT(summary.predicted_memory_mib, 10 * rays_mib);
}

TEST(GridSolver, RefusesOptionsThatDoNotFit) {
  GridOptions options;
  options.ridge = 0;
  FunctionalSummary summary;
  EXPECT_THAT(ErrorOf([&] {
                EstimateOnGrid(Occluded(8, 7, 1, GaussianWeights(3, 3)), options, {}, &summary);
              }),
              HasSubstr("grid solver: ridge is 0"));
}

}  // namespace
}  // namespace thicklens::estimator
