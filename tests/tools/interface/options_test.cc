// Every option struct of the interface refuses NaN, infinities, negative and empty values, and
// names the field.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/thicklens.h"

namespace thicklens {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Expects that the options are not valid, and that the reason begins with the field.
template <typename Options>
void ExpectRefused(const Options& options, const std::string& field) {
  std::string why;
  EXPECT_FALSE(options.IsValid(&why)) << field;
  EXPECT_EQ(why.substr(0, why.find(':')), field) << why;
  EXPECT_FALSE(options.IsValid(nullptr));
}

template <typename Options>
void ExpectValid(const Options& options) {
  std::string why;
  EXPECT_TRUE(options.IsValid(&why)) << why;
}

// Sets a number of the options to each of the values, and expects that each is refused.
template <typename Options, typename Number>
void ExpectEachRefused(Options options, Number Options::*member, const std::string& field,
                       const std::vector<double>& values) {
  for (const double value : values) {
    options.*member = value;
    ExpectRefused(options, field);
  }
}

TEST(InterfaceOptionsTest, DefaultsAreValid) {
  ExpectValid(RunControl());
  ExpectValid(ImageFileOptions());
  ExpectValid(SweepOverrides());
  ExpectValid(CalibrateOptions());
  ExpectValid(LightFieldReadOptions());
  ExpectValid(EffectSelection());
  ExpectValid(SceneSolver());
  ExpectValid(BlockSolver());
  ExpectValid(FunctionalSolver());
  ExpectValid(GridSolver());
  ExpectValid(EstimateOptions());
  ExpectValid(RenderAperture());
  ExpectValid(PhotographOptions());
  ExpectValid(CompareOptions());
}

TEST(InterfaceOptionsTest, ThreadsAreBounded) {
  for (const int threads : {-1, 1025, std::numeric_limits<int>::min()}) {
    RunControl run;
    run.threads = threads;
    ExpectRefused(run, "threads");
  }
}

TEST(InterfaceOptionsTest, ImageFilesHaveEightOrSixteenBits) {
  ImageFileOptions options;
  for (const int bits : {0, -8, 12, 32}) {
    options.bits = bits;
    ExpectRefused(options, "bits");
  }
  ExpectEachRefused(ImageFileOptions(), &ImageFileOptions::noise_levels, "noise_levels",
                    {kNan, kInfinity, -kInfinity, -1});
}

TEST(InterfaceOptionsTest, DepthNeedsAUnitOrNone) {
  ExpectRefused(DepthMeaning{}, "unit");  // an empty statement is none
  ExpectRefused(DepthMeaning{DepthKind::kRange}, "unit");
  ExpectRefused(DepthMeaning{DepthKind::kDisparity, LengthUnit::kMetre}, "unit");
  ExpectRefused(DepthMeaning{static_cast<DepthKind>(7), LengthUnit::kMetre}, "kind");
  ExpectRefused(DepthMeaning{DepthKind::kZ, static_cast<LengthUnit>(-1)}, "unit");
  ExpectValid(DepthMeaning{DepthKind::kZ, LengthUnit::kTum5000});
  ExpectValid(DepthMeaning{DepthKind::kDisparity});
}

TEST(InterfaceOptionsTest, DisparitiesHaveAFiniteScale) {
  const DepthMeaning disparity{DepthKind::kDisparity};
  ExpectEachRefused(disparity, &DepthMeaning::disparity_scale, "disparity_scale",
                    {kNan, kInfinity, -kInfinity, 0});
  ExpectEachRefused(disparity, &DepthMeaning::disparity_offset_px, "disparity_offset_px",
                    {kNan, kInfinity, -kInfinity});
  const DepthMeaning z{DepthKind::kZ, LengthUnit::kMetre};
  ExpectEachRefused(z, &DepthMeaning::disparity_scale, "disparity_scale", {kNan, 2});
  ExpectEachRefused(z, &DepthMeaning::disparity_offset_px, "disparity_offset_px", {kNan, 1});
}

TEST(InterfaceOptionsTest, DepthMapsHaveAllValues) {
  DepthMap map;
  map.meaning = {DepthKind::kDisparity};
  ExpectRefused(map, "width_px");
  map.width_px = map.height_px = 2;
  ExpectRefused(map, "values");
  map.values.assign(4, 0.0F);
  ExpectValid(map);
  map.meaning.disparity_scale = kNan;
  ExpectRefused(map, "meaning.disparity_scale");
}

TEST(InterfaceOptionsTest, SweepStatementsAreFinite) {
  ExpectEachRefused(SweepOverrides(), &SweepOverrides::offset_mm, "offset_mm",
                    {kNan, kInfinity, -kInfinity});
  ExpectEachRefused(SweepOverrides(), &SweepOverrides::offset_sigma_mm, "offset_sigma_mm",
                    {kNan, kInfinity, -1});
  ExpectEachRefused(SweepOverrides(), &SweepOverrides::reading_sigma_mm, "reading_sigma_mm",
                    {kNan, kInfinity, -1});
  ExpectEachRefused(SweepOverrides(), &SweepOverrides::target_period_mm, "target_period_mm",
                    {kNan, kInfinity, 0, -1});
  const std::pair<const char*, std::optional<Measured> SweepOverrides::*> of_focus[] = {
      {"focus_depth_mm", &SweepOverrides::focus_depth_mm},
      {"working_distance_mm", &SweepOverrides::working_distance_mm},
      {"image_distance_mm", &SweepOverrides::image_distance_mm},
      {"optical_tube_length_mm", &SweepOverrides::optical_tube_length_mm},
      {"magnification", &SweepOverrides::magnification}};
  for (const auto& [name, member] : of_focus) {
    SweepOverrides focus;
    focus.*member = Measured{2.5, 0.1};
    ExpectValid(focus);
    for (const double value : {kNan, kInfinity, 0.0, -2.5}) {
      focus.*member = Measured{value, 0.1};
      ExpectRefused(focus, std::string(name) + ".value");
    }
    for (const double sigma : {kNan, kInfinity, -0.1}) {
      focus.*member = Measured{2.5, sigma};
      ExpectRefused(focus, std::string(name) + ".sigma");
    }
  }
  SweepOverrides floor;
  floor.floor_px = Measured{kNan, 0};
  ExpectRefused(floor, "floor_px.value");
  floor.floor_px = Measured{1, -1};
  ExpectRefused(floor, "floor_px.sigma");
  SweepOverrides roi;
  roi.roi = model::RegionOfInterest{0, 0, 0, 10};
  ExpectRefused(roi, "roi.width");
  SweepOverrides raw;
  raw.raw = static_cast<model::SweepRaw>(2);
  ExpectRefused(raw, "raw");
}

TEST(InterfaceOptionsTest, SweepStatementsDoNotContradictEachOther) {
  SweepOverrides overrides;
  overrides.offset_unknown = true;
  overrides.offset_mm = 1;
  ExpectRefused(overrides, "offset_mm");
  overrides = {};
  overrides.floor_unknown = true;
  overrides.floor_px = Measured{1, 0};
  ExpectRefused(overrides, "floor_px");
  overrides.floor_from_calibration = "camera.yaml";
  ExpectRefused(overrides, "floor_from_calibration");
}

TEST(InterfaceOptionsTest, SceneSolver) {
  ExpectEachRefused(thicklens::SceneSolver(), &thicklens::SceneSolver::tolerance, "tolerance",
                    {kNan, kInfinity, -kInfinity, 0, 1, -0.1});
  thicklens::SceneSolver given;
  given.strength_rule = StrengthRule::kGiven;
  ExpectEachRefused(given, &thicklens::SceneSolver::strength, "strength", {kNan, kInfinity, 0, -1});
  ExpectEachRefused(thicklens::SceneSolver(), &thicklens::SceneSolver::strength, "strength",
                    {kNan, 1});
  thicklens::SceneSolver iterations;
  for (const int count : {0, -1, 1000001}) {
    iterations.max_iterations = count;
    ExpectRefused(iterations, "max_iterations");
  }
  thicklens::SceneSolver prior;
  prior.prior = static_cast<Prior>(9);
  ExpectRefused(prior, "prior");
}

TEST(InterfaceOptionsTest, BlockSolver) {
  using Blocks = thicklens::BlockSolver;
  ExpectEachRefused(Blocks(), &Blocks::gamma, "gamma", {kNan, kInfinity, 0, -1});
  ExpectEachRefused(Blocks(), &Blocks::ridge, "ridge", {kNan, kInfinity, -1});
  Blocks direct;
  direct.tolerance = 0.1;
  ExpectRefused(direct, "tolerance");  // a direct solver has none
  Blocks iterative;
  iterative.linear = Blocks::Linear::kCg;
  ExpectEachRefused(iterative, &Blocks::tolerance, "tolerance", {kNan, kInfinity, 0, 1, -1});
  iterative.max_iterations = 0;
  ExpectRefused(iterative, "max_iterations");
  Blocks block_px;
  block_px.block_px = 0;
  ExpectRefused(block_px, "block_px");
}

TEST(InterfaceOptionsTest, FunctionalSolver) {
  using Functional = thicklens::FunctionalSolver;
  ExpectEachRefused(Functional(), &Functional::gamma, "gamma", {kNan, kInfinity, 0, -1});
  ExpectEachRefused(Functional(), &Functional::ridge, "ridge", {kNan, kInfinity, 0, -1});
  ExpectEachRefused(Functional(), &Functional::tolerance, "tolerance", {kNan, kInfinity, 0, 1, -1});
}

TEST(InterfaceOptionsTest, EstimateNumbersAreInTheirRange) {
  ExpectEachRefused(EstimateOptions(), &EstimateOptions::st_depth_mm, "st_depth_mm",
                    {kNan, kInfinity, -kInfinity, 0, -1, 2e9});
  ExpectEachRefused(EstimateOptions(), &EstimateOptions::memory_limit_mib, "memory_limit_mib",
                    {kNan, kInfinity, 0, -1, 2e9});
  EstimateOptions options;
  options.views = {1, 1};
  ExpectRefused(options, "views");
  options.views = {0, 7};
  ExpectRefused(options, "views.u");
  options.views = {7, 100};
  ExpectRefused(options, "views.v");
  options = {};
  options.crop = PixelRect{0, 0, 0, 10};
  ExpectRefused(options, "crop.width");
  options = {};
  options.sensor_origin = SensorOrigin{-1, 0};
  ExpectRefused(options, "sensor_origin.x");
}

TEST(InterfaceOptionsTest, EstimateSolverIsChecked) {
  EstimateOptions options;
  thicklens::SceneSolver scene;
  scene.tolerance = kNan;
  options.solver = scene;
  ExpectRefused(options, "solver.tolerance");
  options.solver = std::shared_ptr<const Solver>();
  ExpectRefused(options, "solver");
  options.solver = SolverChooser();
  ExpectRefused(options, "solver");
}

TEST(InterfaceOptionsTest, EstimateDeviceFitsTheSolver) {
  EstimateOptions options;
  for (const char* device : {"", "gpu", "opencl:", "opencl:-1", "cpu:0"}) {
    options.device = device;
    ExpectRefused(options, "device");
  }
  options.device = "opencl";
  options.solver = thicklens::GridSolver();
  ExpectRefused(options, "device");
  thicklens::BlockSolver vienna;
  vienna.linear = thicklens::BlockSolver::Linear::kViennaCl;
  options.solver = vienna;
  ExpectRefused(options, "device");
}

TEST(InterfaceOptionsTest, EffectsAreConsistent) {
  EffectSelection effects;
  effects.given = {Effect::kDefocus};
  ExpectRefused(effects, "given");
  effects = {};
  effects.tolerance = model::EffectTolerance{kNan, {}};
  ExpectRefused(effects, "tolerance");
  effects.tolerance = model::EffectTolerance{0.5, kInfinity};
  ExpectRefused(effects, "tolerance");
  effects.tolerance = model::EffectTolerance{};
  effects.base = EffectSelection::Base::kAll;
  ExpectRefused(effects, "tolerance");
  EstimateOptions options;
  options.effects.without = {Effect::kApertureShape};
  options.aperture.shape = model::ApertureShape::kDisc;
  ExpectRefused(options, "aperture");
}

TEST(InterfaceOptionsTest, RenderNumbersAreFinite) {
  ExpectEachRefused(RenderAperture(), &RenderAperture::radius, "radius",
                    {kNan, kInfinity, -kInfinity, -1});
  ExpectRefused(FocusOptions(), "depth_mm");  // neither depth nor disparity
  ExpectEachRefused(FocusOptions(), &FocusOptions::depth_mm, "depth_mm", {kNan, kInfinity, 0, -1});
  ExpectEachRefused(FocusOptions(), &FocusOptions::disparity_px, "disparity_px",
                    {kNan, kInfinity, -kInfinity});
}

TEST(InterfaceOptionsTest, ExplainNeedsDepths) {
  ExpectRefused(ExplainOptions(), "depth_range");  // neither a range nor a map
  ExplainOptions range;
  for (const double near_mm : {kNan, kInfinity, 0.0, -1.0}) {
    range.depth_range = DepthRange{near_mm, 1000};
    ExpectRefused(range, "depth_range.near_mm");
  }
  for (const double far_mm : {kNan, 100.0, 99.0, -kInfinity}) {
    range.depth_range = DepthRange{100, far_mm};
    ExpectRefused(range, "depth_range.far_mm");
  }
  range.depth_range = DepthRange{100, kInfinity};
  ExpectValid(range);
  range.depth = DepthMap{1, 1, {1}, false, {DepthKind::kZ, LengthUnit::kMillimetre}, ""};
  ExpectRefused(range, "depth_range");
  ExplainOptions map;
  map.depth = DepthMap{1, 1, {1}, false, {DepthKind::kDisparity}, ""};
  ExpectRefused(map, "depth.meaning.kind");
}

TEST(InterfaceOptionsTest, ExplainNumbersAreInTheirRange) {
  ExplainOptions options;
  options.depth_range = DepthRange{100, 1000};
  for (const double value : {kNan, kInfinity, -1.0}) {
    ExplainOptions wrong = options;
    wrong.full_well_electrons = value;
    ExpectRefused(wrong, "full_well_electrons");
    wrong = options;
    wrong.full_well_electrons = 1000;
    wrong.read_noise_electrons = value;
    ExpectRefused(wrong, "read_noise_electrons");
    wrong = options;
    wrong.bench = model::BenchConditions{};
    wrong.bench->flicker = value;
    ExpectRefused(wrong, "bench.flicker");
    wrong.bench = model::BenchConditions{};
    wrong.bench->drift_sigma_px = value;
    ExpectRefused(wrong, "bench.drift_sigma_px");
    wrong.bench = model::BenchConditions{};
    wrong.bench->reading_sigma_mm = value;
    ExpectRefused(wrong, "bench.reading_sigma_mm");
  }
  ExplainOptions wrong = options;
  wrong.read_noise_electrons = 3;  // without the electrons at full scale
  ExpectRefused(wrong, "read_noise_electrons");
  wrong = options;
  wrong.bench = model::BenchConditions{};
  wrong.measure_costs = true;
  ExpectRefused(wrong, "measure_costs");
  for (const double tilt_deg : {kNan, 90.0, -90.0}) {
    wrong.bench->tilt_deg = tilt_deg;
    ExpectRefused(wrong, "bench.tilt_deg");
  }
  wrong = options;
  for (const int count : {0, 1, 10001}) {
    wrong.depth_count = count;
    ExpectRefused(wrong, "depth_count");
  }
  wrong = options;
  for (const int bits : {0, 33}) {
    wrong.bits = bits;
    ExpectRefused(wrong, "bits");
  }
  ExpectEachRefused(options, &ExplainOptions::uv_depth_mm, "uv_depth_mm",
                    {kNan, kInfinity, -kInfinity});
}

TEST(InterfaceOptionsTest, CompareBorderIsBounded) {
  CompareOptions options;
  for (const int border_px : {-1, 100001}) {
    options.border_px = border_px;
    ExpectRefused(options, "border_px");
  }
}

TEST(InterfaceOptionsTest, WrongOptionsThrowWithTheirField) {
  try {
    ReadDepth("there is no such file", {DepthKind::kZ});
    FAIL();
  } catch (const OptionError& error) {  // before the file is opened
    EXPECT_EQ(error.field(), "unit");
  }
}

}  // namespace
}  // namespace thicklens
