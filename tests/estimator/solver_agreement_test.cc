// Every solver is compared with one closed form, and with itself on other numbers of threads. If
// the whole scene has one disparity of whole pixels, each step is a product in the Fourier domain.
// The image is even at its borders, whose effect decays before it reaches the other parts.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/scene_data.h"
#include "estimator/scene/scene_priors.h"
#include "estimator/scene/scene_system.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {
namespace {

constexpr int kAcross = 66, kDown = 60, kViews = 3, kDisparity = 1;
constexpr double kGamma = 0.7, kRidge = 0.1 / (kViews * kViews);
constexpr double kPi = 3.14159265358979323846;

// Rounding of values up to 1 in float. The solvers agree to 1e-8.
constexpr double kStored = 1.3e-7;
constexpr double kFloat = 1e-4;

EstimateInput EvenAtTheBorders() {
  EstimateInput input;
  input.image = {kAcross, kDown, 1, {}};
  for (int y = 0; y < kDown; ++y) {
    for (int x = 0; x < kAcross; ++x) {
      const double dx = x - 31.5, dy = y - 30.2;
      const double wave = 1 + std::cos(1.9 * dx + 0.6 * dy);
      input.image.values.push_back(
          static_cast<float>(0.4 + 0.25 * wave * std::exp(-(dx * dx + dy * dy) / 4.5)));
    }
  }
  input.disparity = {kAcross, kDown, std::vector<float>(kAcross * kDown, kDisparity), {1, 1}};
  // The two axes differ. No wave is lost to the blur, whose transfer is at least 0.2 on each axis.
  Eigen::Array3d across(0.15, 0.6, 0.25), down(0.22, 0.6, 0.18);
  input.weights = (down.matrix() * across.matrix().transpose()).array();
  return input;
}

Eigen::MatrixXd ImageFrom(const EstimateInput& input) {
  return Eigen::Map<const Eigen::Matrix<float, kDown, kAcross, Eigen::RowMajor>>(
             input.image.values.data())
      .cast<double>();
}

// exp(-2 pi i j k/n)
Eigen::MatrixXcd Waves(int n) {
  Eigen::MatrixXcd waves(n, n);
  for (int j = 0; j < n; ++j) {
    for (int k = 0; k < n; ++k) waves(j, k) = std::polar(1.0, -2 * kPi * ((j * k) % n) / n);
  }
  return waves;
}

// Differences of neighbouring aperture samples, v outer: D^T D.
Eigen::MatrixXd Smoothness() {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kViews * kViews, kViews * kViews);
  const auto link = [&](int a, int b) {
    normal(a, a) += 1;
    normal(b, b) += 1;
    normal(a, b) -= 1;
    normal(b, a) -= 1;
  };
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      if (k + 1 < kViews) link(l * kViews + k, l * kViews + k + 1);
      if (l + 1 < kViews) link(l * kViews + k, (l + 1) * kViews + k);
    }
  }
  return normal;
}

using RaysOfWave = std::function<Eigen::VectorXcd(const Eigen::VectorXcd& h)>;

// Views of a solver that maps a wave of amplitude 1 in the photograph to the rays `rays_of_wave` of
// the scene's points; h is the share of each in the photograph. View (k, l) shows at x the points x
// + a disparity.
std::vector<Eigen::MatrixXd> ExactViewsByWaves(const EstimateInput& input,
                                               const RaysOfWave& rays_of_wave) {
  const Eigen::MatrixXcd across = Waves(kAcross), down = Waves(kDown);
  const Eigen::MatrixXcd photograph = down * ImageFrom(input) * across.transpose();
  std::vector<Eigen::MatrixXcd> views(kViews * kViews, Eigen::MatrixXcd(kDown, kAcross));
  for (int j = 0; j < kDown; ++j) {
    for (int i = 0; i < kAcross; ++i) {
      Eigen::VectorXcd shift(kViews * kViews), h(kViews * kViews);
      for (int n = 0; n < kViews * kViews; ++n) {
        const int a = n % kViews - 1, b = n / kViews - 1;
        shift[n] = std::polar(
            1.0, 2 * kPi * kDisparity *
                     (static_cast<double>(a * i) / kAcross + static_cast<double>(b * j) / kDown));
        h[n] = input.weights(b + 1, a + 1) * shift[n];
      }
      const Eigen::VectorXcd rays = rays_of_wave(h) * photograph(j, i);
      for (int n = 0; n < kViews * kViews; ++n) {
        views[static_cast<std::size_t>(n)](j, i) = shift[n] * rays[n];
      }
    }
  }
  std::vector<Eigen::MatrixXd> shown;
  for (const Eigen::MatrixXcd& view : views) {
    shown.push_back((down.conjugate() * view * across.adjoint()).real() / (kAcross * kDown));
  }
  return shown;
}
std::vector<float> ViewsByWaves(const EstimateInput& input, const RaysOfWave& rays_of_wave) {
  std::vector<float> values;
  for (const Eigen::MatrixXd& shown : ExactViewsByWaves(input, rays_of_wave)) {
    for (int y = 0; y < kDown; ++y) {
      for (int x = 0; x < kAcross; ++x) values.push_back(static_cast<float>(shown(y, x)));
    }
  }
  return values;
}

// |sum_n h_n R_n - 1|^2 + gamma |D R|^2 + mu |R - 1|^2
Eigen::VectorXcd RaysOfTheFunctional(const Eigen::VectorXcd& h) {
  Eigen::MatrixXcd normal = h.conjugate() * h.transpose();
  normal += kGamma * Smoothness();
  normal.diagonal().array() += kRidge;
  return normal.partialPivLu().solve(h.conjugate() +
                                     kRidge * Eigen::VectorXcd::Ones(kViews * kViews));
}

// |H r - 1|^2 + mu |r - 1|^2, the same r toward the whole aperture.
Eigen::VectorXcd RaysOfTheScene(const Eigen::VectorXcd& h) {
  const std::complex<double> sum = h.sum();
  constexpr double kMu = kRidge * kViews * kViews;
  return Eigen::VectorXcd::Constant(kViews * kViews,
                                    (std::conj(sum) + kMu) / (std::norm(sum) + kMu));
}

// Infinite where one is no number, or the sizes differ.
double LargestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::abs(double{a[i]} - double{b[i]});
    if (std::isnan(difference)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, difference);
  }
  return largest;
}

// A solver by its name, as it is run on so many threads.
struct Way {
  std::string name;
  std::function<std::vector<float>(const EstimateInput& input, int threads)> run;
};

template <typename Options>
Options OptionsOf(bool double_precision) {
  Options options;
  options.gamma = kGamma;
  options.ridge = kRidge;
  options.double_precision = double_precision;
  options.tolerance = double_precision ? 1e-11 : 1e-6;
  options.max_iterations = 5000;
  return options;
}

std::vector<Way> FunctionalWays(bool double_precision) {
  std::vector<Way> ways;
  ways.push_back({"functional", [=](const EstimateInput& input, int threads) {
                    FunctionalSummary summary;
                    return EstimateFunctional(input, OptionsOf<FunctionalOptions>(double_precision),
                                              RunOnThreads(threads), &summary)
                        .values;
                  }});
  ways.push_back({"grid", [=](const EstimateInput& input, int threads) {
                    FunctionalSummary summary;
                    return EstimateOnGrid(input, OptionsOf<GridOptions>(double_precision),
                                          RunOnThreads(threads), &summary)
                        .values;
                  }});
  return ways;
}

std::vector<Way> BlockWays(int block_px) {
  std::vector<Way> ways;
  for (const BlockSolver solver : BuiltInBlockSolvers()) {
    ways.push_back(
        {"blocks " + BlockSolverName(solver), [=](const EstimateInput& input, int threads) {
           BlockOptions options;
           options.solver = solver;
           options.gamma = kGamma;
           options.ridge = kRidge;
           options.block_px = block_px;
           options.tolerance = 1e-12;
           options.max_iterations = 5000;
           BlockSummary summary;
           return EstimateByBlocks(input, options, RunOnThreads(threads), &summary).values;
         }});
  }
  return ways;
}

SceneOptions SceneOf(Prior prior, bool double_precision) {
  SceneOptions options;
  options.prior = prior;
  options.strength_rule = StrengthRule::kGiven;
  options.strength = kRidge * kViews * kViews;
  options.tolerance = double_precision ? 1e-11 : 1e-6;
  options.max_iterations = 1000;
  options.double_precision = double_precision;
  options.slope_weights = false;
  return options;
}

Way SceneWay(Prior prior, bool double_precision, kernels::Backend* backend = nullptr) {
  return {"scene " + PriorName(prior) + (backend ? " on a device" : ""),
          [=](const EstimateInput& input, int threads) {
            SceneSummary summary;
            SolverRun run = RunOnThreads(threads);
            run.backend = backend;
            return EstimateScene(input, SceneOf(prior, double_precision), run, &summary).values;
          }};
}

void ExpectAll(const std::vector<Way>& ways, const std::vector<float>& expected, double accuracy) {
  const EstimateInput input = EvenAtTheBorders();
  for (const Way& way : ways) {
    EXPECT_LT(LargestDifference(way.run(input, 1), expected), accuracy) << way.name;
  }
}

TEST(SolverAgreement, TheClosedFormIsNotTheWarpedImage) {
  const EstimateInput input = EvenAtTheBorders();
  const std::vector<float> warped = WarpedLightField(input, true, 1).values;
  const std::vector<float> functional = ViewsByWaves(input, RaysOfTheFunctional);
  const std::vector<float> scene = ViewsByWaves(input, RaysOfTheScene);
  EXPECT_GT(LargestDifference(warped, functional), 0.03);
  EXPECT_GT(LargestDifference(warped, scene), 0.03);
  EXPECT_GT(LargestDifference(functional, scene), 0.005);
}

TEST(SolverAgreement, TheFunctionalInDoubleIsTheClosedForm) {
  std::vector<Way> ways = FunctionalWays(true);
  for (Way& way : BlockWays(1000)) ways.push_back(std::move(way));
  ExpectAll(ways, ViewsByWaves(EvenAtTheBorders(), RaysOfTheFunctional), kStored);
}

TEST(SolverAgreement, TheFunctionalInFloatIsTheClosedForm) {
  ExpectAll(FunctionalWays(false), ViewsByWaves(EvenAtTheBorders(), RaysOfTheFunctional), kFloat);
}

// Light fields are stored in float; the radiance of the scene's points, which the middle view
// shows, is solved for in double.
TEST(SolverAgreement, TheRadianceInDoubleIsTheClosedForm) {
  const EstimateInput input = EvenAtTheBorders();
  const Eigen::MatrixXd expected = ExactViewsByWaves(input, RaysOfTheScene)[kViews * kViews / 2];
  const auto projection = MakeSceneProjection<double>(input.disparity, input.weights, {});
  DataTerm<double> data = DataTermOf(projection, input.image, 1);
  data.weight.assign(data.pixels(), 1);
  data.row_norm2 = SquaredRows<double>(input.disparity, input.weights);
  RadianceLimits limits;
  limits.tolerance = 1e-14;
  limits.max_iterations = 1000;
  SceneSystem<double> system(data);
  std::vector<double> radiance(data.pixels(), 0);
  SolveRadiance(Prior::kRidge, kRidge * kViews * kViews, data,
                std::vector<double>(data.pixels(), 1), limits, &system, &radiance);
  double largest = 0;
  for (int y = 0; y < kDown; ++y) {
    for (int x = 0; x < kAcross; ++x) {
      const double found = radiance[static_cast<std::size_t>(y * kAcross + x)];
      largest = std::max(largest, std::abs(found - expected(y, x)));
    }
  }
  EXPECT_LT(largest, 1e-10);
}

TEST(SolverAgreement, TheSceneSolverIsTheClosedForm) {
  const std::vector<float> expected = ViewsByWaves(EvenAtTheBorders(), RaysOfTheScene);
  ExpectAll({SceneWay(Prior::kRidge, true)}, expected, kStored);
  // A machine on which tests run has an OpenCL device: none is a failure here.
  const auto device = kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr);
  ExpectAll({SceneWay(Prior::kRidge, false), SceneWay(Prior::kRidge, false, device.get())},
            expected, kFloat);
}

TEST(SolverAgreement, EachSolverAgreesWithItselfOnOneTwoAndFourThreads) {
  std::vector<Way> ways = BlockWays(16);
  for (const bool double_precision : {true, false}) {
    for (Way& way : FunctionalWays(double_precision)) ways.push_back(std::move(way));
    for (const Prior prior :
         {Prior::kRidge, Prior::kGradient, Prior::kTotalVariation, Prior::kPatches}) {
      ways.push_back(SceneWay(prior, double_precision));
    }
  }
  const EstimateInput input = EvenAtTheBorders();
  for (const Way& way : ways) {
    const std::vector<float> one = way.run(input, 1);
    for (const int threads : {2, 4}) {
      EXPECT_EQ(LargestDifference(way.run(input, threads), one), 0)
          << way.name << ", threads: " << threads;
    }
  }
}

}  // namespace
}  // namespace thicklens::estimator
