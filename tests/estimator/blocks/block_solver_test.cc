// The block solver against a dense solution that is written down from the formulas, and its
// promises.
#include "thicklens/estimator/block_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "tests/estimator/solver_inputs.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/estimator/render.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::GaussianWeights;
using ::testing::HasSubstr;
using testing::NoiseInput;
using testing::WithSolverCamera;
using thicklens::testing::ErrorOf;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

struct MadeUp {
  int width_px = 12, height_px = 9, channels = 1;
  int u_count = 3, v_count = 3;
  double near_px = 0.8, far_px = -0.6;  // disparity along x
  double step_px = 0;                   // added to the right half: an occlusion
  unsigned seed = 1;
};

EstimateInput MakeInput(const MadeUp& made_up) {
  return NoiseInput(
      made_up.width_px, made_up.height_px, made_up.channels,
      GaussianWeights(made_up.u_count, made_up.v_count),
      [&](int x, int) {
        const double share = made_up.width_px > 1 ? x / (made_up.width_px - 1.0) : 0;
        const double jump = 2 * x >= made_up.width_px ? made_up.step_px : 0;
        return made_up.far_px + (made_up.near_px - made_up.far_px) * share + jump;
      },
      made_up.seed);
}

EstimateInput MakeCameraInput(const MadeUp& made_up, const model::LightFieldPlanes& planes,
                              double depth_mm, double slope_mm_per_px) {
  return WithSolverCamera(MakeInput(made_up), planes,
                          [=](int x) { return depth_mm + slope_mm_per_px * x; });
}

// H and D, dense, for one block that is the whole image.
struct Dense {
  Eigen::MatrixXd h, d;
};

int RayOf(const EstimateInput& input, int i, int j, int k, int l) {
  return ((l * static_cast<int>(input.weights.cols()) + k) * input.image.height_px + j) *
             input.image.width_px +
         i;
}

// The point where ray (i, j, k, l) lands, from [S16] and the orientation of the image.
Eigen::Vector2d LandingPx(const EstimateInput& input, int i, int j, int k, int l) {
  if (!input.grid) return {i, j};
  return model::ImagePositionPx(
      input.camera->sensor,
      model::LandingPointMm(input.camera->lens, input.camera->image_distance_mm(),
                            input.grid->planes, input.grid->RayAt(i, j, k, l)));
}

double HatPx(double distance_px) { return std::max(0.0, 1 - std::abs(distance_px)); }

Dense DenseOf(const EstimateInput& input, bool falloff) {
  const int width = input.image.width_px;
  const int height = input.image.height_px;
  const int u_count = static_cast<int>(input.weights.cols());
  const int v_count = static_cast<int>(input.weights.rows());
  const int rays = width * height * u_count * v_count;
  Dense dense{Eigen::MatrixXd::Zero(width * height, rays), Eigen::MatrixXd::Zero(2 * rays, rays)};
  Eigen::ArrayXXd at_axis = Eigen::ArrayXXd::Ones(v_count, u_count);
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k < u_count; ++k) {
      const double a = k - (u_count - 1) / 2.0;
      const double b = l - (v_count - 1) / 2.0;
      if (falloff) {
        // The ray of this view that lands at the principal point: P s = Q u.
        const auto c = model::ProjectionOf(input.camera->lens, input.camera->image_distance_mm(),
                                           input.grid->planes);
        const model::Ray ray{c.q / c.p * a * input.grid->u_step_mm,
                             c.q / c.p * b * input.grid->v_step_mm, a * input.grid->u_step_mm,
                             b * input.grid->v_step_mm};
        at_axis(l, k) = model::RelativeIrradiance(
            input.camera->lens, input.camera->image_distance_mm(), input.grid->planes, ray);
      }
      const ViewDisparity view = RenderDisparity(input.disparity, a, b);
      const ViewDisparity right = RenderDisparity(input.disparity, a + 1, b);
      const ViewDisparity below = RenderDisparity(input.disparity, a, b + 1);
      for (int j = 0; j < height; ++j) {
        for (int i = 0; i < width; ++i) {
          const int ray = RayOf(input, i, j, k, l);
          const Eigen::Vector2d at = LandingPx(input, i, j, k, l);
          for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
              dense.h(y * width + x, ray) =
                  input.weights(l, k) * HatPx(x - at.x()) * HatPx(y - at.y());
            }
          }
          // Rays that land nearest to no pixel of the image are not of the block.
          const bool inside = std::floor(at.x() + 0.5) >= 0 && std::floor(at.x() + 0.5) < width &&
                              std::floor(at.y() + 0.5) >= 0 && std::floor(at.y() + 0.5) < height;
          if (!inside) dense.h.col(ray).setZero();
          const double disparity = view.disparity[Index(j * width + i)];
          const auto link = [&](const ViewDisparity& next, int next_k, int next_l, double s,
                                double t, int row) {
            if (next_k >= u_count || next_l >= v_count || !inside) return;
            Eigen::RowVectorXd weights = Eigen::RowVectorXd::Zero(rays);
            double sum = 0;
            for (int tt = 0; tt < height; ++tt) {
              for (int ss = 0; ss < width; ++ss) {
                const double weight = HatPx(ss - s) * HatPx(tt - t);
                if (weight == 0) continue;
                const Eigen::Vector2d there = LandingPx(input, ss, tt, next_k, next_l);
                if (std::floor(there.x() + 0.5) < 0 || std::floor(there.x() + 0.5) >= width ||
                    std::floor(there.y() + 0.5) < 0 || std::floor(there.y() + 0.5) >= height) {
                  continue;
                }
                const double other = next.disparity[Index(tt * width + ss)];
                if (std::abs(other - disparity) * input.disparity.step.maxCoeff() > 0.3) return;
                weights(RayOf(input, ss, tt, next_k, next_l)) = weight;
                sum += weight;
              }
            }
            if (std::abs(sum - 1) > 1e-12) return;  // a tap is missing
            weights(ray) -= 1;
            dense.d.row(row) = weights;
          };
          link(right, k + 1, l, i - disparity * input.disparity.step.x(), j, ray);
          link(below, k, l + 1, i, j - disparity * input.disparity.step.y(), rays + ray);
        }
      }
    }
  }
  for (int pixel = 0; pixel < dense.h.rows(); ++pixel)
    dense.h.row(pixel) /= dense.h.row(pixel).sum();
  if (!falloff) return dense;
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k < u_count; ++k) {
      for (int j = 0; j < height; ++j) {
        for (int i = 0; i < width; ++i) {
          dense.h.col(RayOf(input, i, j, k, l)) *=
              model::RelativeIrradiance(input.camera->lens, input.camera->image_distance_mm(),
                                        input.grid->planes, input.grid->RayAt(i, j, k, l)) /
              at_axis(l, k);
        }
      }
    }
  }
  return dense;
}

Eigen::VectorXd ChannelOf(const std::vector<float>& values, int channel, int channels) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(values.size()) / channels);
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    out(i) = values[static_cast<std::size_t>(i) * Index(channels) + Index(channel)];
  }
  return out;
}

Eigen::VectorXd AllOfIt(const std::vector<float>& values) { return ChannelOf(values, 0, 1); }

double LargestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, static_cast<double>(std::abs(a[i] - b[i])));
  }
  return largest;
}

BlockOptions OneBlock() {
  BlockOptions options;
  options.block_px = 1000;
  return options;
}

void ExpectDenseSolution(const EstimateInput& input, BlockOptions options) {
  const Dense dense = DenseOf(input, options.falloff && input.camera.has_value());
  const double mu = 1e-2 / static_cast<double>(input.weights.size());
  const Eigen::MatrixXd normal = dense.h.transpose() * dense.h +
                                 options.gamma * dense.d.transpose() * dense.d +
                                 mu * Eigen::MatrixXd::Identity(dense.h.cols(), dense.h.cols());
  const model::LightField prior = WarpedLightField(input, options.falloff, 1);
  const Eigen::VectorXd right =
      dense.h.transpose() * ChannelOf(input.image.values, 0, input.image.channels) +
      mu * AllOfIt(prior.values);
  const Eigen::VectorXd expected = normal.ldlt().solve(right);

  BlockSummary summary;
  const model::LightField found = EstimateByBlocks(input, options, RunOnThreads(1), &summary);
  EXPECT_LT((AllOfIt(found.values) - expected).lpNorm<Eigen::Infinity>(), 2e-6);
  EXPECT_LT(summary.relative_residual, 1e-12);
  EXPECT_GT(summary.rcond_min.value_or(0), 1e-5);
}

TEST(BlockSolver, SolvesTheSystemOfTheFunctional) {
  ExpectDenseSolution(MakeInput({}), OneBlock());
}

TEST(BlockSolver, SolvesItWithAnOcclusion) {
  MadeUp made_up;
  made_up.step_px = 1.7;
  ExpectDenseSolution(MakeInput(made_up), OneBlock());
}

TEST(BlockSolver, SolvesItForEvenAndUnequalCounts) {
  MadeUp made_up;
  made_up.u_count = 4;
  made_up.v_count = 2;
  ExpectDenseSolution(MakeInput(made_up), OneBlock());
}

TEST(BlockSolver, SolvesItWithACamera) {
  ExpectDenseSolution(MakeCameraInput({}, {0, 800}, 700, 25), OneBlock());
}

TEST(BlockSolver, SolvesItOnPlanesWhereRaysLandBetweenPixels) {
  const EstimateInput input = MakeCameraInput({}, {0, 500}, 700, 10);
  ASSERT_GT(std::abs(WarpedLightField(input, true, 1).landing_step_px.x()), 0.2);
  ExpectDenseSolution(input, OneBlock());
}

TEST(BlockSolver, WithoutTheFallOffTheCameraHasNone) {
  BlockOptions options = OneBlock();
  options.falloff = false;
  ExpectDenseSolution(MakeCameraInput({}, {0, 800}, 700, 25), options);
}

TEST(BlockSolver, AConstantImageHasAConstantLightField) {
  MadeUp made_up{21, 13, 3, 3, 3, 1.3, -0.9, 0.8, 1};
  EstimateInput input = MakeInput(made_up);
  for (std::size_t i = 0; i < input.image.values.size(); ++i) {
    input.image.values[i] = 0.2F * static_cast<float>(i % 3 + 1);
  }
  for (const Stencil stencil : {Stencil::kWarp, Stencil::kSource}) {
    if (stencil == Stencil::kSource && !IsBuiltIn(BlockSolver::kUmfpack)) continue;
    BlockOptions options;
    options.stencil = stencil;
    options.block_px = 8;
    BlockSummary summary;
    const model::LightField found = EstimateByBlocks(input, options, {}, &summary);
    for (int channel = 0; channel < 3; ++channel) {
      const std::size_t begin = found.ViewStart(channel, 0, 0);
      for (std::size_t i = 0; i < 9 * found.view_size(); ++i) {
        ASSERT_NEAR(found.values[begin + i], 0.2 * (channel + 1), 1e-6);
      }
    }
  }
}

TEST(BlockSolver, OneThreadAndTwoGiveTheSameBits) {
  const EstimateInput input = MakeInput({40, 37, 3, 3, 3, 1.1, -0.7, 0.6, 4});
  std::vector<float> first;
  for (const int threads : {1, 2, 3}) {
    BlockOptions options;
    SolverRun run;
    run.threads = threads;
    BlockSummary summary;
    const model::LightField found = EstimateByBlocks(input, options, run, &summary);
    EXPECT_EQ(summary.blocks.size(), 9u);  // 3 x 3 blocks of 16 px, those at the border smaller
    if (first.empty()) first = found.values;
    EXPECT_EQ(found.values, first);
  }
}

TEST(BlockSolver, AFactorServesAllChannels) {
  const EstimateInput colour = MakeInput({20, 18, 3, 3, 3, 1.1, -0.7, 0, 4});
  BlockSummary summary;
  const model::LightField all = EstimateByBlocks(colour, {}, {}, &summary);
  for (int channel = 0; channel < 3; ++channel) {
    EstimateInput grey = colour;
    grey.image.channels = 1;
    grey.image.values.clear();
    for (std::size_t i = Index(channel); i < colour.image.values.size(); i += 3) {
      grey.image.values.push_back(colour.image.values[i]);
    }
    const model::LightField one = EstimateByBlocks(grey, {}, {}, &summary);
    const auto begin =
        all.values.begin() + static_cast<std::ptrdiff_t>(all.ViewStart(channel, 0, 0));
    EXPECT_TRUE(std::equal(one.values.begin(), one.values.end(), begin)) << channel;
  }
}

TEST(BlockSolver, SolversAgree) {
  const EstimateInput input = MakeInput({33, 20, 1, 5, 3, 1.1, -0.7, 0.6, 4});
  std::vector<model::LightField> found;
  for (const BlockSolver solver : BuiltInBlockSolvers()) {
    SCOPED_TRACE(BlockSolverName(solver));
    BlockOptions options;
    options.solver = solver;
    options.tolerance = 1e-12;
    options.max_iterations = 5000;
    BlockSummary summary;
    found.push_back(EstimateByBlocks(input, options, {}, &summary));
    EXPECT_EQ(found.back().origin.block_solver, BlockSolverName(solver));
    // Stored in float, 6e-8 for values below 1; the solutions themselves agree to 1e-8 and better.
    EXPECT_LT(LargestDifference(found.back().values, found.front().values), 1.3e-7);
    EXPECT_LE(summary.relative_residual, IsIterative(solver) ? 1e-12 : 1e-13);
    EXPECT_TRUE(summary.converged);
    EXPECT_EQ(summary.rcond_min.has_value(), !IsIterative(solver));
    EXPECT_EQ(summary.iterations > 0, IsIterative(solver));
  }
}

TEST(BlockSolver, IterationsThatAreCutShortSaySo) {
  const EstimateInput input = MakeInput({33, 20, 1, 5, 3, 1.1, -0.7, 0.6, 4});
  for (const BlockSolver solver : BuiltInBlockSolvers()) {
    if (!IsIterative(solver)) continue;
    SCOPED_TRACE(BlockSolverName(solver));
    BlockOptions options;
    options.solver = solver;
    options.max_iterations = 3;
    BlockSummary summary;
    const model::LightField found = EstimateByBlocks(input, options, {}, &summary);
    EXPECT_FALSE(summary.converged);
    EXPECT_GT(summary.relative_residual, options.tolerance);
    EXPECT_LE(summary.relative_residual, 1);
    EXPECT_LE(summary.iterations, 3);
    EXPECT_THAT(found.origin.relative_residual, ::testing::Optional(summary.relative_residual));
    EXPECT_FALSE(found.origin.rcond_min.has_value());
  }
}

TEST(BlockSolver, DeviceAndReferenceAgree) {
  const EstimateInput input = MakeInput({33, 20, 3, 3, 5, 1.1, -0.7, 0.6, 4});
  const auto device = kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr);
  for (const Stencil stencil : {Stencil::kWarp, Stencil::kSource}) {
    BlockOptions options;
    options.stencil = stencil;
    options.rcond_min = 0;
    BlockSummary summary;
    const model::LightField there = EstimateByBlocks(input, options, RunOn(device.get()), &summary);
    EXPECT_THAT(summary.device, HasSubstr("opencl"));
    const model::LightField here = EstimateByBlocks(input, options, {}, &summary);
    EXPECT_LT(LargestDifference(there.values, here.values), 1.3e-7);
  }
}

// A rank and a residual do not show this fault: without a ridge UMFPACK solves the system to a
// perfect residual and reproduces the photograph, while the light field is noise.
TEST(BlockSolver, WithoutARidgeTheResidualIsPerfectAndTheLightFieldIsNot) {
  if (!IsBuiltIn(BlockSolver::kUmfpack)) GTEST_SKIP() << "built without UMFPACK";
  EstimateInput input = MakeInput({16, 16, 1, 3, 3, 1.6, 1.6, 0, 2});
  BlockOptions options;
  options.solver = BlockSolver::kUmfpack;
  BlockSummary summary;
  const model::LightField good = EstimateByBlocks(input, options, {}, &summary);
  const double good_range = AllOfIt(good.values).lpNorm<Eigen::Infinity>();
  EXPECT_LT(good_range, 6);

  options.ridge = 0;
  EXPECT_THAT(ErrorOf([&] { EstimateByBlocks(input, options, {}, &summary); }),
              AllOf(HasSubstr("block of 16x16 px at (0, 0)"), HasSubstr("rcond is"),
                    HasSubstr("at least 1e-12"), HasSubstr("ridge")));

  options.rcond_min = 0;  // the guard is off
  const model::LightField garbage = EstimateByBlocks(input, options, {}, &summary);
  EXPECT_LT(summary.rcond_min.value_or(1), 1e-12);
  EXPECT_LT(summary.relative_residual, 1e-8);
  const auto kernels = kernels::NewReference<float>();
  const model::LinearImage again =
      Photograph(garbage, input.weights, nullptr, nullptr, kernels.get(), 1);
  const double reprojection =
      (AllOfIt(again.values) - AllOfIt(input.image.values)).lpNorm<Eigen::Infinity>();
  const double range = AllOfIt(garbage.values).lpNorm<Eigen::Infinity>();
  EXPECT_LT(reprojection, 1e-5 * range);
  EXPECT_GT(range, 100 * good_range) << "rcond " << *summary.rcond_min;
}

TEST(BlockSolver, RefusesWhatCannotBeMeant) {
  const EstimateInput good = MakeInput({});
  BlockSummary summary;
  const auto message = [&](const EstimateInput& input, const BlockOptions& options) {
    return ErrorOf([&] { EstimateByBlocks(input, options, {}, &summary); });
  };
  BlockOptions options;
  options.gamma = 0;
  EXPECT_THAT(message(good, options), AllOf(HasSubstr("gamma is 0"), HasSubstr("geometry")));
  options.gamma = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(good, options), HasSubstr("gamma is nan"));
  options = {};
  options.ridge = -1;
  EXPECT_THAT(message(good, options), HasSubstr("ridge is -1"));
  options = {};
  options.block_px = 0;
  EXPECT_THAT(message(good, options), HasSubstr("block_px is 0"));

  EstimateInput input = good;
  input.weights = Eigen::ArrayXXd::Ones(1, 1);
  EXPECT_THAT(message(input, {}), HasSubstr("1x1"));
  input = good;
  input.weights *= 2;
  EXPECT_THAT(message(input, {}), HasSubstr("have the sum 2"));
  input = good;
  input.disparity.width_px = 11;
  EXPECT_THAT(message(input, {}), AllOf(HasSubstr("11x9"), HasSubstr("12x9")));
  input = good;
  input.disparity.disparity[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message(input, {}), HasSubstr("holes"));
  input = good;
  input.image.values[3] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(message(input, {}), HasSubstr("must be finite"));
  input = good;
  input.disparity.disparity[3] = 12.5F;
  EXPECT_THAT(message(input, {}), AllOf(HasSubstr("12.5 px per view step"), HasSubstr("12 px")));
  input = MakeCameraInput({}, {100, 500}, 700, 10);
  EXPECT_THAT(message(input, {}), AllOf(HasSubstr("UV plane"), HasSubstr("100 mm")));
  input = good;
  input.image.channels = 0;
  EXPECT_THAT(message(input, {}), HasSubstr("0 channels"));
}

TEST(BlockSolver, BlocksLargerThanTheImageAreTheImage) {
  BlockSummary summary;
  EstimateByBlocks(MakeInput({}), OneBlock(), {}, &summary);
  EXPECT_EQ(summary.block_px, 12);
  ASSERT_EQ(summary.blocks.size(), 1u);
  EXPECT_EQ(summary.blocks[0].width_px, 12);
  EXPECT_EQ(summary.blocks[0].height_px, 9);
}

TEST(BlockSolver, TheMemoryLimitChoosesTheBlocks) {
  const EstimateInput input = MakeInput({64, 48, 1, 3, 3, 1.1, -0.7, 0, 4});
  BlockOptions options;
  SolverRun run;
  run.memory_limit_mib = 1;
  BlockSummary summary;
  EXPECT_THAT(ErrorOf([&] { EstimateByBlocks(input, options, run, &summary); }),
              AllOf(HasSubstr("memory limit 1 MiB"), HasSubstr("must be at least")));
  run.memory_limit_mib = 1e5;
  EstimateByBlocks(input, options, run, &summary);
  EXPECT_EQ(summary.block_px, 64);
  const double all = summary.predicted_memory_mib;
  // Known to be too much from smaller blocks.
  options.block_px = 64;
  run.memory_limit_mib = 0.7 * all;
  EXPECT_THAT(ErrorOf([&] { EstimateByBlocks(input, options, run, &summary); }),
              AllOf(HasSubstr("blocks of 64 px need"), HasSubstr("or use smaller blocks")));
  run.memory_limit_mib.reset();
  options.block_px = 4;
  EstimateByBlocks(input, options, run, &summary);
  EXPECT_EQ(summary.block_px, 4);
  EXPECT_LT(summary.predicted_memory_mib, all);
  options.block_px.reset();
  run.memory_limit_mib = summary.predicted_memory_mib + 0.5 * (all - summary.predicted_memory_mib);
  EstimateByBlocks(input, options, run, &summary);
  EXPECT_GT(summary.block_px, 4);
  EXPECT_LT(summary.block_px, 64);
  EXPECT_LE(summary.predicted_memory_mib, *run.memory_limit_mib);
}

TEST(BlockSolver, ProgressCountsBlocksAndMayStop) {
  const EstimateInput input = MakeInput({40, 37, 1, 3, 3, 1.1, -0.7, 0.6, 4});
  SolverRun run;
  int calls = 0;
  int last = 0;
  run.progress = [&](int done, int total) {
    EXPECT_EQ(total, 9);
    EXPECT_EQ(done, last + 1);
    last = done;
    ++calls;
  };
  BlockSummary summary;
  EXPECT_EQ(summary.message, "not run");
  EstimateByBlocks(input, {}, run, &summary);
  EXPECT_EQ(calls, 9);
  EXPECT_THAT(summary.message, HasSubstr("9 blocks of 16 px"));
  run.progress = [](int, int) { throw Interrupted(); };
  EXPECT_THROW(EstimateByBlocks(input, {}, run, &summary), Interrupted);
}

// Keeps blocks as floats, as a file does, and counts.
class StoreInMemory : public BlockStore {
 public:
  void Begin(const BlockRun& run) override {
    settings = run.settings;
    data_bytes.clear();
    for (const BlockRun::Data& data : run.data) {
      for (const std::string_view bytes : data.bytes) data_bytes[data.name] += bytes;
    }
  }
  std::optional<SolvedBlock> Find(int block) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = blocks.find(block);
    return found == blocks.end() ? std::nullopt : std::make_optional(found->second);
  }
  void Keep(int block, const SolvedBlock& solved) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++kept;
    SolvedBlock& place = blocks[block] = solved;
    for (std::vector<double>& channel : place.channels) {
      for (double& value : channel) value = static_cast<float>(value);
    }
  }

  std::vector<std::pair<std::string, std::string>> settings;
  std::map<std::string, std::string> data_bytes;
  std::map<int, SolvedBlock> blocks;
  int kept = 0;

 private:
  std::mutex mutex_;
};

TEST(BlockSolver, GoesOnFromTheBlocksOfAStoreToTheSameBits) {
  MadeUp made_up;
  made_up.width_px = 20;
  made_up.channels = 3;
  const EstimateInput input = MakeInput(made_up);
  for (const BlockSolver solver : {DefaultBlockSolver(), BlockSolver::kCg}) {
    BlockOptions options;
    options.solver = solver;
    options.block_px = 5;
    SolverRun run;
    run.threads = 2;
    BlockSummary whole;
    const model::LightField expected = EstimateByBlocks(input, options, run, &whole);
    ASSERT_EQ(whole.blocks.size(), 8U);
    EXPECT_EQ(whole.blocks_from_store, 0);

    StoreInMemory store;
    run.store = &store;
    run.progress = [](int done, int) {
      if (done >= 3) throw std::runtime_error("stop");
    };
    BlockSummary cut;
    EXPECT_THROW(EstimateByBlocks(input, options, run, &cut), std::runtime_error);
    const int kept = store.kept;
    ASSERT_GE(kept, 3);
    ASSERT_LT(kept, 8);

    run.progress = {};
    BlockSummary resumed;
    const model::LightField found = EstimateByBlocks(input, options, run, &resumed);
    EXPECT_EQ(found.values, expected.values);
    EXPECT_EQ(resumed.blocks_from_store, kept);
    EXPECT_EQ(store.kept, 8);
    EXPECT_EQ(resumed.relative_residual, whole.relative_residual);
    EXPECT_EQ(resumed.rcond_min, whole.rcond_min);
    EXPECT_EQ(resumed.iterations, whole.iterations);
    for (std::size_t i = 0; i < whole.blocks.size(); ++i) {
      EXPECT_EQ(resumed.blocks[i].entries, whole.blocks[i].entries);
      EXPECT_EQ(resumed.blocks[i].unknowns, whole.blocks[i].unknowns);
    }
  }
}

TEST(BlockSolver, BlocksOfAStoreThatCannotBeAreSolvedAgain) {
  const EstimateInput input = MakeInput({});
  BlockOptions options;
  options.block_px = 6;
  SolverRun run;
  BlockSummary summary;
  const model::LightField expected = EstimateByBlocks(input, options, run, &summary);
  StoreInMemory right;
  run.store = &right;
  EstimateByBlocks(input, options, run, &summary);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::function<void(SolvedBlock*)>> damages = {
      [](SolvedBlock* block) { block->report.x += 6; },
      [](SolvedBlock* block) { block->report.height_px -= 1; },
      [](SolvedBlock* block) { block->report.unknowns -= 1; },
      [](SolvedBlock* block) { block->report.iterations = -1; },
      [](SolvedBlock* block) { block->report.rcond.reset(); },
      [](SolvedBlock* block) { block->report.rcond = 1e-14; },
      [](SolvedBlock* block) { block->report.rcond = std::numeric_limits<double>::infinity(); },
      [=](SolvedBlock* block) { block->report.rcond = kNone; },
      [=](SolvedBlock* block) { block->report.relative_residual = kNone; },
      [](SolvedBlock* block) { block->channels.clear(); },
      [](SolvedBlock* block) { block->channels.push_back(block->channels[0]); },
      [](SolvedBlock* block) { block->channels[0].pop_back(); },
      [=](SolvedBlock* block) { block->channels[0][7] = kNone; },
  };
  for (std::size_t i = 0; i < damages.size(); ++i) {
    SCOPED_TRACE(i);
    StoreInMemory store;
    store.blocks = right.blocks;
    damages[i](&store.blocks.at(1));
    run.store = &store;
    const model::LightField found = EstimateByBlocks(input, options, run, &summary);
    EXPECT_EQ(found.values, expected.values);
    EXPECT_EQ(store.kept, 1);
    EXPECT_EQ(summary.blocks_from_store, static_cast<int>(right.blocks.size()) - 1);
  }
}

// Every setting that changes the blocks also changes the description of the run that a store gets.
TEST(BlockSolver, AStoreGetsEverythingThatBlocksDependOn) {
  MadeUp made_up;
  made_up.width_px = made_up.height_px = 8;
  const model::LightFieldPlanes planes{0, 780};
  const auto reported = [](const EstimateInput& input, const BlockOptions& options,
                           int threads = 0) {
    StoreInMemory store;
    SolverRun run = RunOnThreads(threads);
    run.store = &store;
    BlockSummary summary;
    EstimateByBlocks(input, options, run, &summary);
    return std::make_pair(store.settings, store.data_bytes);
  };
  const EstimateInput usual = MakeCameraInput(made_up, planes, 800, 1);
  const auto of_usual = reported(usual, {});
  EXPECT_EQ(reported(usual, {}, 2), of_usual) << "the result does not depend on them";

  const std::vector<std::function<void(BlockOptions*)>> settings = {
      [](BlockOptions* o) { o->gamma = 2; },
      [](BlockOptions* o) { o->ridge = 0.1; },
      [](BlockOptions* o) { o->block_px = 4; },
      [](BlockOptions* o) { o->splat = kernels::Splat::kNearest; },
      [](BlockOptions* o) { o->solver = BlockSolver::kBicgstab; },
      [](BlockOptions* o) { o->rcond_min = 1e-13; },
      [](BlockOptions* o) { o->falloff = false; },
  };
  for (std::size_t i = 0; i < settings.size(); ++i) {
    BlockOptions options;
    settings[i](&options);
    EXPECT_NE(reported(usual, options), of_usual) << i;
  }
  BlockOptions iterative;
  iterative.solver = BlockSolver::kCg;
  const auto of_iterative = reported(usual, iterative);
  BlockOptions other = iterative;
  other.tolerance = 1e-5;
  EXPECT_NE(reported(usual, other), of_iterative);
  other = iterative;
  other.max_iterations = 999;
  EXPECT_NE(reported(usual, other), of_iterative);
  BlockOptions stencil;
  stencil.solver = BlockSolver::kEigen;
  const auto of_warp = reported(usual, stencil);
  stencil.stencil = Stencil::kSource;
  EXPECT_NE(reported(usual, stencil), of_warp);

  const std::vector<std::function<void(EstimateInput*)>> inputs = {
      [](EstimateInput* input) { input->image.values[5] += 1e-6F; },
      [](EstimateInput* input) { input->disparity.disparity[5] *= 1.000001F; },
      [](EstimateInput* input) { input->disparity.step.x() *= 1 + 1e-9; },
      [](EstimateInput* input) {
        input->weights(0, 0) += 0.01;
        input->weights(1, 1) -= 0.01;
      },
  };
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    EstimateInput input = usual;
    inputs[i](&input);
    EXPECT_NE(reported(input, {}), of_usual) << i;
  }
  EXPECT_NE(reported(MakeCameraInput(made_up, {0, 781}, 800, 1), {}), of_usual);
}

// Rays that land beside the image are in no block.
TEST(BlockSolver, RaysBesideTheImageKeepThePrior) {
  const EstimateInput input = MakeCameraInput({}, {0, 500}, 700, 10);
  BlockSummary summary;
  const model::LightField found = EstimateByBlocks(input, {}, {}, &summary);
  const model::LightField prior = WarpedLightField(input, true, 1);
  int beside = 0;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 12; ++i) {
      const double x = std::floor(LandingPx(input, i, 4, k, 1).x() + 0.5);
      if (x >= 0 && x < 12) continue;
      ++beside;
      const std::size_t ray = found.ViewStart(0, k, 1) + Index(4 * 12 + i);
      EXPECT_EQ(found.values[ray], prior.values[ray]);
    }
  }
  EXPECT_GT(beside, 0);
}

TEST(BlockSolver, TheLightFieldSaysHowItWasMade) {
  BlockOptions options;
  options.gamma = 2;
  options.ridge = 0.01;
  BlockSummary summary;
  const model::LightField found =
      EstimateByBlocks(MakeCameraInput({}, {0, 800}, 700, 25), options, {}, &summary);
  EXPECT_EQ(found.origin.method, "blocks");
  EXPECT_EQ(found.origin.gamma, 2);
  EXPECT_EQ(found.origin.ridge, 0.01);
  EXPECT_EQ(found.origin.block_px, 12);
  EXPECT_EQ(found.origin.effects, (std::vector<std::string>{"defocus", "falloff"}));
  EXPECT_TRUE(found.camera.has_value());
  std::string why;
  EXPECT_TRUE(found.IsValid(&why)) << why;
}

}  // namespace
}  // namespace thicklens::estimator
