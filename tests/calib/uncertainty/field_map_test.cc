// The map over the field is compared with targets that are composed of sweeps at known depths.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <vector>

#include "calib/calibrate/target_calibration.h"
#include "tests/calib/known_texture.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

constexpr int kSizePx = 256;

// Case iii with the target `farther_mm` beyond its stated position.
SimulatedSweep SweepAt(double farther_mm, double focus_shift_mm = 0) {
  model::SweepSimulationOptions options = SweepCase("iii", kSizePx, 3);
  options.target.kind = model::TargetKind::kWhiteNoise;
  options.first_depth_mm += farther_mm + focus_shift_mm;
  options.bench_offset_mm += farther_mm + focus_shift_mm;
  options.lamp_falloff = false;
  SimulatedSweep s = Simulate(options);
  s.sweep.offset_mm = model::Estimate{s.sweep.offset_mm->value - farther_mm - focus_shift_mm, 0};
  GiveFloor(&s);
  return s;
}

// Each part of the field is from a sweep of its own; `depth_at` returns how much farther the target
// is at a column.
template <typename DepthAt>
SimulatedSweep InStrips(int strips, const DepthAt& depth_at) {
  SimulatedSweep whole = SweepAt(0);
  const int width = kSizePx / strips;
  for (int k = 0; k < strips; ++k) {
    const SimulatedSweep part = SweepAt(depth_at((k + 0.5) * width - 0.5 * kSizePx));
    const cv::Rect strip(k * width, 0, width, kSizePx);
    for (std::size_t i = 0; i < part.stored->size(); ++i)
      (*part.stored)[i](strip).copyTo((*whole.stored)[i](strip));
  }
  return whole;
}

TEST(FieldMap, AFlatTargetHasOneDepthAndNoTilt) {
  const SimulatedSweep s = SweepAt(0);
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  EXPECT_EQ(c.diagnostics.field.clusters.size(), 1U);
  EXPECT_EQ(c.diagnostics.field.tiles.size(), 25U);
  EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, 0,
              4 * c.diagnostics.field.tilt_right_deg->sigma);
  EXPECT_NEAR(c.diagnostics.field.tilt_down_deg->value, 0,
              4 * c.diagnostics.field.tilt_down_deg->sigma);
  EXPECT_LT(c.diagnostics.field.tilt_right_deg->sigma, 1);
  EXPECT_NEAR(c.diagnostics.field.curvature_mm->value, 0,
              4 * c.diagnostics.field.curvature_mm->sigma);
  EXPECT_NEAR(c.diagnostics.field.astigmatism_mm->value, 0,
              4 * c.diagnostics.field.astigmatism_mm->sigma);
  for (const FieldTile& tile : c.diagnostics.field.tiles) {
    ASSERT_TRUE(tile.done) << tile.message;
    EXPECT_NEAR(tile.focus_depth_mm.value, s.truth.focus_depth_mm, 1);
  }
  EXPECT_TRUE(c.diagnostics.channels.empty());  // grey frames
  // The results of a flat field are those of the fit, whatever map shows that it is flat.
  CalibrationOptions coarse;
  coarse.map_field = false;
  const Calibration again = Calibrate(s.sweep, coarse);
  EXPECT_EQ(c.summary.focus_depth_mm->value, again.summary.focus_depth_mm->value);
  EXPECT_EQ(c.summary.focus_depth_mm->sigma, again.summary.focus_depth_mm->sigma);
  EXPECT_EQ(c.summary.image_distance_mm->value, again.summary.image_distance_mm->value);
  EXPECT_EQ(c.summary.blur_ratio->value, again.summary.blur_ratio->value);
  EXPECT_EQ(c.diagnostics.covariance, again.diagnostics.covariance);
}

TEST(FieldMap, IsLeftOutOnRequest) {
  CalibrationOptions options;
  options.map_field = false;
  const Calibration c = Calibrate(SweepAt(0).sweep, options);
  EXPECT_TRUE(c.summary.focus_depth_mm);
  EXPECT_FALSE(c.diagnostics.field.done);
  EXPECT_TRUE(c.diagnostics.field.tiles.empty());
}

TEST(FieldMap, SlowATiltIsMeasuredInDegrees) {
  constexpr double kTiltDeg = 8;
  const double mm_per_px = 400 * 0.006 / (12.5 * 400 / (400 - 12.5));
  // Positive means that the right side is nearer.
  const SimulatedSweep s = InStrips(
      16, [&](double x_px) { return -x_px * mm_per_px * std::tan(kTiltDeg * CV_PI / 180); });
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, kTiltDeg, 1);
  EXPECT_NEAR(c.diagnostics.field.tilt_down_deg->value, 0, 1);
  EXPECT_EQ(c.diagnostics.field.clusters.size(), 1U);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("tilted")));
}

// The target is simulated with a tilt, for a lens whose focus determines depths well. The result
// agrees within the stated error of the map.
TEST(FieldMap, FindsTheTiltThatWasSimulated) {
  for (const double tilt_deg : {1.0, -2.0}) {
    SCOPED_TRACE(tilt_deg);
    model::SweepSimulationOptions options =
        model::ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/demo.yaml");
    options.target.tilt_deg = tilt_deg;
    SimulatedSweep s = Simulate(options);
    GiveFloor(&s);
    const Calibration c = Calibrate(s.sweep, {});
    ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
    EXPECT_LT(c.diagnostics.field.tilt_right_deg->sigma, 0.05);
    EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, tilt_deg,
                3.5 * c.diagnostics.field.tilt_right_deg->sigma);
    EXPECT_NEAR(c.diagnostics.field.tilt_down_deg->value, 0,
                3.5 * c.diagnostics.field.tilt_down_deg->sigma);
    EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm,
                4 * c.summary.focus_depth_mm->sigma);
  }
}

TEST(FieldMap, SlowALongSweepIsMappedFromAPartOfItsFrames) {
  model::SweepSimulationOptions options = SweepCase("iii", 192, 3);
  options.target.kind = model::TargetKind::kWhiteNoise;
  options.step_mm *= static_cast<double>(options.frame_count) / 150;
  options.frame_count = 150;
  SimulatedSweep s = Simulate(options);
  GiveFloor(&s);
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, 0,
              4 * c.diagnostics.field.tilt_right_deg->sigma);
  for (const FieldTile& tile : c.diagnostics.field.tiles) {
    ASSERT_TRUE(tile.done) << tile.message;
    EXPECT_NEAR(tile.focus_depth_mm.value, s.truth.focus_depth_mm, 1);
  }
}

TEST(FieldMap, DepthsOfATargetInStepsAreParted) {
  constexpr double kStepMm = 12;
  const SimulatedSweep s = InStrips(2, [](double x_px) { return x_px < 0 ? 0.0 : kStepMm; });
  const Calibration c = CalibrateTarget(s.sweep, {});  // before it looks for one depth
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  ASSERT_GE(c.diagnostics.field.clusters.size(), 2U);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("not at one depth")));
  // A part that is farther than its reading states is in focus at a smaller reading.
  const double truth = s.truth.focus_depth_mm;
  EXPECT_NEAR(c.diagnostics.field.clusters.front().focus_depth_mm.value, truth - kStepMm, 1.5);
  EXPECT_NEAR(c.diagnostics.field.clusters.back().focus_depth_mm.value, truth, 1.5);
  // Both values are in the interval.
  ASSERT_TRUE(c.summary.focus_depth_mm->systematic);
  EXPECT_LT(c.summary.focus_depth_mm->systematic->x(), truth - kStepMm + 1.5);
  EXPECT_GT(c.summary.focus_depth_mm->systematic->y(), truth - 1.5);
}

TEST(FieldMap, OneOfTheDepthsIsMeasuredAlone) {
  constexpr double kStepMm = 12;
  const SimulatedSweep s = InStrips(2, [](double x_px) { return x_px < 0 ? 0.0 : kStepMm; });
  const Calibration c = Calibrate(s.sweep, {});
  const ReliefFinding& relief = c.diagnostics.target.relief;
  ASSERT_TRUE(relief.region) << c.summary.reason << "\n" << c.diagnostics.target.ReliefMap();
  EXPECT_NEAR(std::abs(relief.parts[1].nearer_mm.value), kStepMm, 1.5);
  const bool is_left = relief.region->x + relief.region->width / 2 < kSizePx / 2;
  EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm - (is_left ? 0 : kStepMm), 1);
  EXPECT_EQ(c.diagnostics.field.clusters.size(), 1U);
}

constexpr double kMiddleMm = 300, kRatio = 0.45;

// A sweep of a lens in whose frames the blur along x is smallest `astigmatism_mm` farther than the
// blur along y, about kMiddleMm. The frames are rendered in closed form. At the ends of the sweep,
// a halo takes `halo` of the contrast of all frequencies.
FocusSweep AstigmaticSweep(double astigmatism_mm, unsigned seed, double halo = 0) {
  constexpr double kFocalMm = 50, kRadiusMm = 8.9286, kPitchMm = 0.009, kOffsetMm = 190;
  constexpr int kWidth = 200, kHeight = 150;
  constexpr double kNoise = 0.002, kFloorPx2 = 0.25, kReadingSigmaMm = 0.05;
  const double radius_px_mm = kRadiusMm / kPitchMm * kFocalMm * kMiddleMm / (kMiddleMm - kFocalMm);
  const Eigen::Vector2d focus_mm(kMiddleMm + 0.5 * astigmatism_mm,
                                 kMiddleMm - 0.5 * astigmatism_mm);
  FocusSweep sweep;
  sweep.camera.lens = {kFocalMm, kFocalMm, 0, kRadiusMm};
  sweep.camera.sensor.width_px = kWidth;
  sweep.camera.sensor.height_px = kHeight;
  sweep.camera.sensor.pixel_pitch_mm = kPitchMm;
  sweep.camera.sensor.principal_point_px = {0.5 * (kWidth - 1), 0.5 * (kHeight - 1)};
  sweep.reading_sigma_mm = kReadingSigmaMm;
  sweep.offset_mm = model::Estimate{kOffsetMm, 0};
  sweep.floor.given_px = model::Estimate{std::sqrt(kFloorPx2), 0.01};
  const thicklens::testing::KnownTexture texture(seed, 0.4, 400);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, kReadingSigmaMm);
  std::vector<cv::Mat> stored;
  for (int i = 0; i < 21; ++i) {
    const double depth_mm = 285.4 + 1.5 * i;
    thicklens::testing::TextureView view;
    view.scale = kMiddleMm / depth_mm;
    Eigen::Vector2d variance_px2;  // on the target
    for (const int axis : {0, 1}) {
      // The slope of R along each axis is that of a lens with this zf.
      const double slope_px_mm = radius_px_mm * focus_mm[axis] * (kMiddleMm - kFocalMm) /
                                 (kMiddleMm * (focus_mm[axis] - kFocalMm));
      const double sigma_px = kRatio * slope_px_mm * (1 / depth_mm - 1 / focus_mm[axis]);
      variance_px2[axis] = (kFloorPx2 + sigma_px * sigma_px) / (view.scale * view.scale);
    }
    const cv::Mat light = thicklens::testing::WithWhiteNoise(
        texture.RenderPlane(
            kWidth, kHeight, sweep.camera.sensor.principal_point_px, view,
            [&](const Eigen::Vector2d& nu) {
              // Its own astigmatism is that of the core.
              const Eigen::Vector2d off_mm = (focus_mm.array() - depth_mm).cwiseAbs() / 15;
              const double share = off_mm.dot(nu.cwiseAbs2()) / std::max(nu.squaredNorm(), 1e-12);
              return (1 - halo * share) *
                     std::exp(-2 * CV_PI * CV_PI * variance_px2.dot(nu.cwiseAbs2()));
            }),
        kNoise, 100 * seed + static_cast<unsigned>(i));
    stored.emplace_back();
    light.convertTo(stored.back(), CV_16U, 65535);
    sweep.frames.push_back({"frame-" + std::to_string(i), depth_mm - kOffsetMm + normal(random)});
  }
  sweep.read_frame = [stored](std::size_t i) { return stored[i]; };
  return sweep;
}

// Where the mean of both variances is smallest: the mean of both foci in 1/z, each with the slope
// that AstigmaticSweep gives its blur.
double MedialMm(double astigmatism_mm) {
  double sum = 0, weights = 0;
  for (const double sign : {-1.0, 1.0}) {
    const double zf_mm = kMiddleMm + 0.5 * sign * astigmatism_mm;
    const double weight = std::pow(zf_mm / (zf_mm - 50), 2);
    sum += weight / zf_mm;
    weights += weight;
  }
  return weights / sum;
}

bool SaysAstigmatic(const Calibration& c) {
  for (const std::string& warning : c.summary.warnings) {
    if (warning.find("the lens is astigmatic") != std::string::npos) return true;
  }
  return false;
}

void ExpectAstigmatism(double truth_mm, unsigned seed) {
  SCOPED_TRACE(truth_mm);
  const Calibration c = Calibrate(AstigmaticSweep(truth_mm, seed), {});
  const FieldMap& field = c.diagnostics.field;
  ASSERT_TRUE(field.astigmatism_mm) << c.summary.reason;
  ASSERT_TRUE(field.along_x && field.along_y);
  const model::Estimate& found = *field.astigmatism_mm;
  EXPECT_NEAR(found.value, truth_mm, std::max(3 * found.sigma, 0.03 * std::abs(truth_mm)));
  EXPECT_LT(found.sigma, 0.2);
  for (const double sign : {-1.0, 1.0}) {
    const AxisFocus& along = sign > 0 ? *field.along_x : *field.along_y;
    EXPECT_NEAR(along.focus_depth_mm.value, kMiddleMm + 0.5 * sign * truth_mm,
                std::max(4 * along.focus_depth_mm.sigma, 0.03 * std::abs(truth_mm)));
    EXPECT_NEAR(along.blur_ratio.value, kRatio, std::max(4 * along.blur_ratio.sigma, 0.01));
  }
  const auto expect_within = [](const Result& result, double truth) {
    ASSERT_TRUE(result.systematic);
    EXPECT_GT(truth, result.systematic->x() - 2 * result.sigma);
    EXPECT_LT(truth, result.systematic->y() + 2 * result.sigma);
  };
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio);
  expect_within(*c.summary.blur_ratio, kRatio);
  expect_within(*c.summary.focus_depth_mm, kMiddleMm);
  // The mean of both variances is fitted where they differ, with the errors of an isotropic lens.
  EXPECT_EQ(c.diagnostics.blur.astigmatic_blur_px > 0, truth_mm != 0);
  const Result& ratio = *c.summary.blur_ratio;
  EXPECT_LT(0.5 * (ratio.systematic->y() - ratio.systematic->x()) + 2 * ratio.sigma, 0.015);
  EXPECT_LT(std::abs(ratio.value - kRatio), 0.01);
  EXPECT_NEAR(c.summary.focus_depth_mm->value, MedialMm(truth_mm),
              std::max(4 * c.summary.focus_depth_mm->sigma, 0.01));
  const bool has_part =
      std::any_of(c.diagnostics.systematic_parts.begin(), c.diagnostics.systematic_parts.end(),
                  [](const SystematicPart& part) { return part.name == "astigmatism"; });
  EXPECT_EQ(SaysAstigmatic(c), truth_mm != 0);
  if (truth_mm != 0) {
    EXPECT_THAT(c.summary.warnings,
                Contains(HasSubstr("along x is smallest at a depth of " +
                                   fmt::format("{:.2f}", field.along_x->focus_depth_mm.value))));
  }
  EXPECT_EQ(has_part, truth_mm != 0);
}

TEST(FieldMap, AnIsotropicLensHasNoAstigmatism) { ExpectAstigmatism(0, 1); }
TEST(FieldMap, MeasuresAstigmatismOf2Mm) { ExpectAstigmatism(-2, 2); }
TEST(FieldMap, MeasuresAstigmatismOf6Mm) { ExpectAstigmatism(-6, 6); }
TEST(FieldMap, MeasuresAstigmatismOf12Mm) { ExpectAstigmatism(-12, 4); }
TEST(FieldMap, MeasuresAstigmatismOfTheOtherSign) { ExpectAstigmatism(4, 5); }

// The stated sigma of the astigmatism is compared with its deviations over new noise and readings.
TEST(FieldMap, SlowAstigmatismSigmaIsTheScatter) {
  for (const double truth_mm : {0.0, -4.0}) {
    constexpr int kRuns = 10;
    double squares = 0;
    for (unsigned run = 0; run < kRuns; ++run) {
      const Calibration c = Calibrate(AstigmaticSweep(truth_mm, 20 + run), {});
      ASSERT_TRUE(c.diagnostics.field.astigmatism_mm);
      const model::Estimate& found = *c.diagnostics.field.astigmatism_mm;
      squares += std::pow((found.value - truth_mm) / found.sigma, 2) / kRuns;
    }
    // chi^2 of 10 draws is outside of these limits in one of 1000 cases.
    EXPECT_GT(squares, 0.14) << truth_mm;
    EXPECT_LT(squares, 2.96) << truth_mm;
  }
}

// So are those of zf and kappa. The part of kappa that the estimator's own accuracy leaves is
// added.
TEST(FieldMap, SlowSigmasOfAnAstigmaticLensAreTheScatter) {
  constexpr int kRuns = 12;
  constexpr double kTruthMm = -6;
  double focus = 0, ratio = 0;
  CalibrationOptions without_map;
  without_map.map_field = false;
  for (unsigned run = 0; run < kRuns; ++run) {
    const Calibration c = Calibrate(AstigmaticSweep(kTruthMm, 40 + run), without_map);
    ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio) << c.summary.reason;
    EXPECT_TRUE(SaysAstigmatic(c));
    const Result& zf = *c.summary.focus_depth_mm;
    const Result& kappa = *c.summary.blur_ratio;
    focus += std::pow((zf.value - MedialMm(kTruthMm)) / zf.sigma, 2) / kRuns;
    ratio += std::pow((kappa.value - kRatio) / std::hypot(kappa.sigma, 0.003 * kRatio), 2) / kRuns;
    EXPECT_LT(kappa.sigma, 0.01);
  }
  // chi^2 of 12 draws is outside of these limits in one of 1000 cases.
  for (const double squares : {focus, ratio}) {
    EXPECT_GT(squares, 0.18);
    EXPECT_LT(squares, 2.75);
  }
}

// Where the blur has a halo that takes contrast at all frequencies, more of it along x, one free
// gain for both axes would move the focus of each toward that of the other.
TEST(FieldMap, AHaloDoesNotMixTheFociOfBothAxes) {
  constexpr double kTruthMm = -6;
  const Calibration c = Calibrate(AstigmaticSweep(kTruthMm, 7, 0.5), {});
  ASSERT_TRUE(c.summary.focus_depth_mm && c.diagnostics.field.along_x) << c.summary.reason;
  EXPECT_NEAR(c.summary.focus_depth_mm->value, MedialMm(kTruthMm), 0.5);
  EXPECT_NEAR(c.diagnostics.field.astigmatism_mm->value, kTruthMm, 0.5);
  EXPECT_TRUE(std::any_of(
      c.diagnostics.systematic_parts.begin(), c.diagnostics.systematic_parts.end(),
      [](const SystematicPart& part) { return part.name == "contrast of the blur's halo"; }));
}

// This seed registers with a displacement like a distortion of -6 %, which is the astigmatism.
TEST(FieldMap, AstigmatismIsNotTakenForDistortion) {
  CalibrationOptions without_map;
  without_map.map_field = false;
  const Calibration c = Calibrate(AstigmaticSweep(-6, 49), without_map);
  ASSERT_TRUE(c.summary.blur_ratio) << c.summary.reason;
  EXPECT_NEAR(c.summary.blur_ratio->value, kRatio, 0.01);
  for (const std::string& warning : c.summary.warnings) {
    if (warning.find("like distorted images") != std::string::npos) {
      EXPECT_THAT(warning, HasSubstr("as an astigmatic lens makes it"));
    }
  }
}

TEST(FieldMap, EachColourHasItsOwnFocus) {
  // Red, green and blue are in focus at readings 3 mm apart.
  const double shifts_mm[] = {-3, 0, 3};
  SimulatedSweep s = SweepAt(0);
  std::vector<SimulatedSweep> colours;
  for (const double shift : shifts_mm) colours.push_back(SweepAt(shift));
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    const std::vector<cv::Mat> channels = {(*colours[0].stored)[i], (*colours[1].stored)[i],
                                           (*colours[2].stored)[i]};
    cv::Mat image;
    cv::merge(channels, image);
    (*s.stored)[i] = image;
  }
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_EQ(c.diagnostics.channels.size(), 3U) << c.summary.reason;
  const char* const names[] = {"red", "green", "blue"};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(c.diagnostics.channels[k].name, names[k]);
    ASSERT_TRUE(c.diagnostics.channels[k].done) << c.diagnostics.channels[k].message;
    EXPECT_NEAR(c.diagnostics.channels[k].focus_depth_mm.value,
                s.truth.focus_depth_mm - shifts_mm[k], 0.5);
  }
}

}  // namespace
}  // namespace thicklens::calib
