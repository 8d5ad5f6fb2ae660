// Solve against the functions that it calls, and the checks of all options that it takes.
#include "thicklens/estimator/solve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "tests/estimator/solver_inputs.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/base/cancel.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/estimator/blur_check.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::GaussianWeights;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::NoiseInput;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

EstimateInput SmallInput() {
  return NoiseInput(24, 18, 3, GaussianWeights(3, 3),
                    [](int x, int) { return x < 12 ? 0.3 : 1.2; });
}

// All solvers, the block solver also with iterations, and the fastest prior.
std::vector<SolverOptions> AllSolvers() {
  SceneOptions scene;
  scene.prior = Prior::kRidge;
  BlockOptions iterative;
  iterative.solver = BlockSolver::kCg;
  return {scene, BlockOptions(), iterative, FunctionalOptions(), GridOptions()};
}

void ExpectResult(const SolverSummary& found, const SolverResult& expected) {
  EXPECT_EQ(found.message, expected.message);
  EXPECT_EQ(found.converged, expected.converged);
  EXPECT_EQ(found.relative_residual, expected.relative_residual);
  EXPECT_EQ(found.threads, expected.threads);
  EXPECT_EQ(found.device, expected.device);
  EXPECT_GT(found.predicted_memory_mib, 0);
  EXPECT_GT(found.solve_seconds, 0);
}

void ExpectRays(const model::LightField& found, const model::LightField& expected) {
  ASSERT_FALSE(expected.values.empty());
  EXPECT_EQ(found.values, expected.values);
  EXPECT_EQ(found.origin.method, expected.origin.method);
}

TEST(Solve, IsTheSceneSolverBitForBit) {
  const EstimateInput input = SmallInput();
  SceneOptions options;
  options.prior = Prior::kGradient;
  SceneSummary summary;
  SceneMaps maps, found_maps;
  const model::LightField expected = EstimateScene(input, options, {}, &summary, &maps);
  SolverSummary found;
  ExpectRays(Solve(input, options, {}, &found, &found_maps), expected);
  ExpectResult(found, summary);
  EXPECT_EQ(found.solver, "scene");
  EXPECT_EQ(found.iterations, summary.iterations);
  EXPECT_EQ(found.rcond_min, std::nullopt);
  EXPECT_THAT(found.blocks, IsEmpty());
  const auto& diagnostics = std::get<SceneDiagnostics>(found.diagnostics);
  EXPECT_EQ(diagnostics.prior, Prior::kGradient);
  EXPECT_EQ(diagnostics.strength, summary.strength);
  EXPECT_EQ(diagnostics.residual_rms, summary.residual_rms);
  EXPECT_EQ(found_maps.residual, maps.residual);
  EXPECT_EQ(found_maps.confidence, maps.confidence);
}

TEST(Solve, IsTheBlockSolverBitForBit) {
  const EstimateInput input = SmallInput();
  for (const BlockSolver solver : {DefaultBlockSolver(), BlockSolver::kCg}) {
    SCOPED_TRACE(BlockSolverName(solver));
    BlockOptions options;
    options.solver = solver;
    options.block_px = 10;
    BlockSummary summary;
    const model::LightField expected = EstimateByBlocks(input, options, {}, &summary);
    SolverSummary found;
    ExpectRays(Solve(input, options, {}, &found), expected);
    ExpectResult(found, summary);
    EXPECT_EQ(found.solver, "blocks");
    EXPECT_EQ(found.iterations.has_value(), IsIterative(solver));
    EXPECT_EQ(found.iterations.value_or(0), summary.iterations);
    EXPECT_EQ(found.rcond_min.has_value(), !IsIterative(solver));
    EXPECT_EQ(found.rcond_min, summary.rcond_min);
    const auto& diagnostics = std::get<BlockDiagnostics>(found.diagnostics);
    EXPECT_EQ(diagnostics.block_px, 10);
    EXPECT_EQ(diagnostics.ridge, summary.ridge);
    ASSERT_EQ(found.blocks.size(), summary.blocks.size());
    ASSERT_EQ(found.blocks.size(), 6U);
    for (std::size_t i = 0; i < found.blocks.size(); ++i) {
      EXPECT_EQ(found.blocks[i].x, summary.blocks[i].x);
      EXPECT_EQ(found.blocks[i].relative_residual, summary.blocks[i].relative_residual);
    }
  }
}

TEST(Solve, IsTheFunctionalAndTheGridSolverBitForBit) {
  const EstimateInput input = SmallInput();
  WholeImageOptions whole;
  whole.gamma = 0.5;
  const FunctionalOptions options{whole};
  const GridOptions grid_options{whole};
  FunctionalSummary functional, grid;
  const model::LightField by_functional = EstimateFunctional(input, options, {}, &functional);
  const model::LightField on_grid = EstimateOnGrid(input, grid_options, {}, &grid);
  ASSERT_NE(by_functional.values, on_grid.values);
  SolverSummary found;
  ExpectRays(Solve(input, options, {}, &found), by_functional);
  ExpectResult(found, functional);
  EXPECT_EQ(found.solver, "functional");
  EXPECT_EQ(found.iterations, functional.iterations);
  EXPECT_EQ(std::get<FunctionalDiagnostics>(found.diagnostics).gamma, 0.5);
  ExpectRays(Solve(input, grid_options, {}, &found), on_grid);
  ExpectResult(found, grid);
  EXPECT_EQ(found.solver, "grid");
  EXPECT_EQ(found.iterations, grid.iterations);
  EXPECT_EQ(std::get<FunctionalDiagnostics>(found.diagnostics).ridge, grid.ridge);
}

TEST(Solve, ComputesOnTheProcessorWithoutABackend) {
  const EstimateInput input = SmallInput();
  const auto processor = kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr);
  for (const SolverOptions& options : AllSolvers()) {
    SCOPED_TRACE(SolverName(options));
    SolverSummary given, none;
    const model::LightField expected = Solve(input, options, RunOn(processor.get()), &given);
    ExpectRays(Solve(input, options, {}, &none), expected);
    EXPECT_EQ(none.device, "cpu");
    EXPECT_EQ(none.device, given.device);
  }
}

TEST(Solve, NeedsNoSummary) {
  const EstimateInput input = SmallInput();
  for (const SolverOptions& options : AllSolvers()) {
    SCOPED_TRACE(SolverName(options));
    SolverSummary summary;
    ExpectRays(Solve(input, options, {}, nullptr), Solve(input, options, {}, &summary));
  }
  EXPECT_FALSE(
      EstimateScene(input, std::get<SceneOptions>(AllSolvers()[0]), {}, nullptr).values.empty());
  EXPECT_FALSE(EstimateByBlocks(input, {}, {}, nullptr).values.empty());
  EXPECT_FALSE(EstimateFunctional(input, {}, {}, nullptr).values.empty());
  EXPECT_FALSE(EstimateOnGrid(input, {}, {}, nullptr).values.empty());
}

TEST(Solve, GivesTheViewsToASink) {
  const EstimateInput input = SmallInput();
  int views = 0;
  SceneViewSink sink;
  sink.take = [&](int, int, const model::LinearImage&, const std::vector<Confidence>&) { ++views; };
  SolverRun run = RunTo(sink);
  run.threads = 1;
  EXPECT_THAT(Solve(input, SceneOptions(), run, nullptr).values, IsEmpty());
  EXPECT_EQ(views, 9);
}

class NoStore : public BlockStore {
 public:
  void Begin(const BlockRun& /*run*/) override {}
  std::optional<SolvedBlock> Find(int /*block*/) override { return std::nullopt; }
  void Keep(int /*block*/, const SolvedBlock& /*solved*/) override { ++kept; }
  int kept = 0;
};

TEST(Solve, RefusesWhatTheSolverDoesNotUse) {
  const EstimateInput input = SmallInput();
  NoStore store;
  SolverRun with_store = RunOnThreads(1);
  with_store.store = &store;
  const SceneViewSink sink;
  SceneMaps maps;
  for (const SolverOptions& options : AllSolvers()) {
    const std::string name = SolverName(options);
    SCOPED_TRACE(name);
    SolverSummary summary;
    if (name == "blocks") {
      store.kept = 0;
      Solve(input, options, with_store, &summary);
      EXPECT_EQ(store.kept, static_cast<int>(summary.blocks.size()));
    } else {
      EXPECT_THAT(ErrorOf([&] { Solve(input, options, with_store, &summary); }),
                  AllOf(StartsWith(name), HasSubstr("a store of blocks is given")));
      EXPECT_EQ(summary.message, "not run");
    }
    if (name == "scene") continue;
    EXPECT_THAT(ErrorOf([&] { Solve(input, options, RunTo(sink), &summary); }),
                HasSubstr("a sink of views is given"));
    EXPECT_THAT(ErrorOf([&] { Solve(input, options, {}, &summary, &maps); }),
                AllOf(StartsWith(name), HasSubstr("maps are asked for")));
  }
}

// The token alone stops a solver: there is no report that could throw.
TEST(Solve, IsCancelledWithoutAReport) {
  const EstimateInput input = SmallInput();
  CancelToken token;
  token.Cancel();
  const CancelScope scope(&token);
  for (const SolverOptions& options : AllSolvers()) {
    EXPECT_THROW(Solve(input, options, {}, nullptr), Interrupted) << SolverName(options);
  }
}

TEST(Solve, ReportsItsStepsAndStopsIfTheReportThrows) {
  const EstimateInput input = SmallInput();
  for (const SolverOptions& options : AllSolvers()) {
    SCOPED_TRACE(SolverName(options));
    testing::ExpectStepsAreReported(
        [&](const SolverRun& run) { Solve(input, options, run, nullptr); });
  }
}

// One value of one member that is not valid: what the reason has to begin with, and the change.
template <typename Options>
struct Fault {
  std::string reason;
  std::function<void(Options*)> make;
};

template <typename Options>
void ExpectFaultsAreNamed(const std::vector<Fault<Options>>& faults) {
  for (const Fault<Options>& fault : faults) {
    Options options;
    std::string why = "unchanged";
    EXPECT_TRUE(options.IsValid(&why));
    EXPECT_EQ(why, "unchanged");
    fault.make(&options);
    EXPECT_FALSE(options.IsValid(&why)) << fault.reason;
    EXPECT_FALSE(options.IsValid(nullptr));
    EXPECT_THAT(why, AllOf(StartsWith(fault.reason + ": it must be "), Not(HasSubstr("\n"))));
  }
}

// The faults of a member whose values are those of a kind.
template <typename Options, typename Member>
void AddNumber(const std::string& name, Member member, const std::vector<double>& values,
               std::vector<Fault<Options>>* faults) {
  for (const double value : values) {
    const std::string text = std::isnan(value)     ? "nan"
                             : value == kInfinity  ? "inf"
                             : value == -kInfinity ? "-inf"
                                                   : ::testing::PrintToString(value);
    faults->push_back({name + " is " + text, [=](Options* options) { options->*member = value; }});
  }
}
template <typename Options, typename Member>
void AddWhole(const std::string& name, Member member, const std::vector<int>& values,
              std::vector<Fault<Options>>* faults) {
  for (const int value : values) {
    faults->push_back({name + " is " + std::to_string(value),
                       [=](Options* options) { options->*member = value; }});
  }
}
template <typename Options, typename Enum>
void AddEnum(const std::string& name, Enum Options::*member, int count,
             std::vector<Fault<Options>>* faults) {
  for (const int value : {-1, count}) {
    faults->push_back({name + " is " + std::to_string(value),
                       [=](Options* options) { options->*member = static_cast<Enum>(value); }});
  }
}

const std::vector<double> kNotPositive = {kNan, kInfinity, -kInfinity, 0, -1};
const std::vector<double> kNegative = {kNan, kInfinity, -kInfinity, -1};
const std::vector<double> kNoTolerances = {kNan, kInfinity, -kInfinity, 0, -1, 1, 2};
const std::vector<int> kBelowOne = {0, -1, std::numeric_limits<int>::min()};

TEST(SolverOptions, OfTheSceneSolverAreChecked) {
  std::vector<Fault<SceneOptions>> faults;
  AddEnum("prior", &SceneOptions::prior, 4, &faults);
  AddEnum("strength_rule", &SceneOptions::strength_rule, 3, &faults);
  AddNumber("strength", &SceneOptions::strength, kNegative, &faults);
  AddNumber("tolerance", &SceneOptions::tolerance, kNoTolerances, &faults);
  AddWhole("max_iterations", &SceneOptions::max_iterations, kBelowOne, &faults);
  AddWhole("least_bands", &SceneOptions::least_bands, kBelowOne, &faults);
  ExpectFaultsAreNamed(faults);

  for (const double strength : kNotPositive) {
    SceneOptions given;
    given.strength_rule = StrengthRule::kGiven;
    given.strength = strength;
    std::string why;
    EXPECT_FALSE(given.IsValid(&why)) << strength;
    EXPECT_THAT(why, HasSubstr("it must be finite and > 0"));
  }
}

TEST(SolverOptions, OfTheBlockSolverAreChecked) {
  std::vector<Fault<BlockOptions>> faults;
  AddEnum("solver", &BlockOptions::solver, 6, &faults);
  AddEnum("stencil", &BlockOptions::stencil, 2, &faults);
  AddEnum("splat", &BlockOptions::splat, 2, &faults);
  AddNumber("gamma", &BlockOptions::gamma, kNotPositive, &faults);
  AddNumber("ridge", &BlockOptions::ridge, kNegative, &faults);
  AddWhole("block_px", &BlockOptions::block_px, kBelowOne, &faults);
  AddNumber("rcond_min", &BlockOptions::rcond_min, {kNan, kInfinity, -kInfinity, -1, 1}, &faults);
  AddNumber("tolerance", &BlockOptions::tolerance, kNoTolerances, &faults);
  AddWhole("max_iterations", &BlockOptions::max_iterations, kBelowOne, &faults);
  ExpectFaultsAreNamed(faults);
}

template <typename Options>
void ExpectFunctionalFaultsAreNamed() {
  std::vector<Fault<Options>> faults;
  AddNumber("gamma", &Options::gamma, kNotPositive, &faults);
  AddNumber("ridge", &Options::ridge, kNotPositive, &faults);
  AddNumber("tolerance", &Options::tolerance, kNoTolerances, &faults);
  AddWhole("max_iterations", &Options::max_iterations, kBelowOne, &faults);
  ExpectFaultsAreNamed(faults);
}

TEST(SolverOptions, OfTheFunctionalAndTheGridSolverAreChecked) {
  ExpectFunctionalFaultsAreNamed<FunctionalOptions>();
  ExpectFunctionalFaultsAreNamed<GridOptions>();
}

TEST(SolverOptions, OfARunAndOfTheBlurCheckAreChecked) {
  std::vector<Fault<SolverRun>> faults;
  AddWhole("threads", &SolverRun::threads, {-1, std::numeric_limits<int>::min()}, &faults);
  AddNumber("memory_limit_mib", &SolverRun::memory_limit_mib, kNotPositive, &faults);
  ExpectFaultsAreNamed(faults);

  std::vector<Fault<BlurCheckOptions>> of_check;
  AddWhole("threads", &BlurCheckOptions::threads, {-1}, &of_check);
  AddNumber("memory_limit_mib", &BlurCheckOptions::memory_limit_mib, kNotPositive, &of_check);
  ExpectFaultsAreNamed(of_check);
}

TEST(SolverOptions, AreRefusedWithTheNameOfTheSolver) {
  const EstimateInput input = SmallInput();
  const std::vector<std::string> names = {"scene solver", "block solver", "block solver",
                                          "functional solver", "grid solver"};
  const std::vector<SolverOptions> solvers = AllSolvers();
  for (std::size_t i = 0; i < solvers.size(); ++i) {
    SCOPED_TRACE(i);
    std::string why;
    EXPECT_TRUE(IsValid(solvers[i], &why)) << why;
    SolverOptions wrong = solvers[i];
    std::visit([](auto& options) { options.tolerance = kNan; }, wrong);
    EXPECT_FALSE(IsValid(wrong, &why));
    EXPECT_EQ(why, "tolerance is nan: it must be > 0 and < 1");
    EXPECT_EQ(ErrorOf([&] { Solve(input, wrong, {}, nullptr); }), names[i] + ": " + why);
    EXPECT_EQ(ErrorOf([&] { Solve(input, solvers[i], RunOnThreads(-1), nullptr); }),
              names[i] + ": threads is -1: it must be >= 0");
  }
}

}  // namespace
}  // namespace thicklens::estimator
