// Effects of simulated sweeps: each can be left out, and leaves the rest as it was.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "model/base/random_draws.h"
#include "model/simulate/sweep/edge_spread.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::ElementsAre;
using ::testing::Gt;
using ::testing::HasSubstr;
using ::testing::Pair;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;

constexpr double kPi = 3.14159265358979323846;
constexpr double kFocusMm = 300;

// A thick lens with a wide field, so that every effect matters but the aberrations, whose tests are
// in aberrated_sweep_test.cc.
SweepSimulationOptions WideSweep() {
  SweepSimulationOptions options;
  Camera& camera = options.camera;
  camera = TestCameraFocusedAt(kFocusMm, "wide", {16, 16, 4, 3},
                               TestSensor(160, 120, 0.08, {70, 55}), {0.5, 0});
  camera.psf = Psf::kDisc;
  camera.calibration->blur_floor_px = Estimate{0.4, 0};
  options.first_depth_mm = 120;
  options.step_mm = 90;
  options.frame_count = 5;
  options.bench_offset_mm = 10;
  options.reading_sigma_mm = 0.5;
  options.target.tilt_deg = 0.1;
  options.flicker = 0.05;
  options.drift_sigma_px = 2;
  options.full_well_electrons = 5000;
  options.read_noise_electrons = 12;
  options.corner_stops = -1;
  options.speck_count = 3;
  options.speck_radius_px = 6;
  options.band_amplitude = 0.2;
  options.exposure_drift_stops = 0.5;
  return options;
}

SweepSimulationOptions With(const EffectSet& effects) {
  SweepSimulationOptions options = WideSweep();
  options.effects.base = EffectSelectionOptions::Base::kGiven;
  options.effects.given = effects;
  return options;
}

std::vector<LinearImage> Frames(const SweepSimulationOptions& options) {
  const SweepSimulator simulator(options, {});
  std::vector<LinearImage> frames;
  for (int i = 0; i < options.frame_count; ++i) frames.push_back(simulator.RenderNoiseless(i));
  return frames;
}

double Largest(const LinearImage& a, const LinearImage& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a.values[i] - b.values[i])));
  }
  return largest;
}

TEST(SweepEffectsTest, EachIsSwitchedAlone) {
  const std::vector<LinearImage> all = Frames(With(SweepEffects()));
  const EffectSet of_light = {Effect::kThickness,     Effect::kDefocus,  Effect::kApertureShape,
                              Effect::kFalloff,       Effect::kPixelBox, Effect::kLensFloor,
                              Effect::kLampFalloff,   Effect::kFlicker,  Effect::kDrift,
                              Effect::kMagnification, Effect::kTilt,     Effect::kShading,
                              Effect::kDust,          Effect::kBands,    Effect::kExposureDrift};
  for (const Effect effect : SweepEffects().Effects()) {
    SCOPED_TRACE(EffectName(effect));
    const std::vector<LinearImage> without = Frames(With(SweepEffects().Without({effect})));
    double change = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
      change = std::max(change, Largest(all[i], without[i]));
    if (of_light.Has(effect)) {
      EXPECT_GT(change, 1e-5);
    } else {
      EXPECT_EQ(change, 0);  // differences of the encoded values
    }
  }
}

// A frame in the plane of focus shows the same part of the target, also without the effects that
// would increase the part of the target that frames need.
TEST(SweepEffectsTest, TheTargetStaysTheSameWithoutThem) {
  SweepSimulationOptions options = With({Effect::kPixelBox, Effect::kMagnification,
                                         Effect::kDefocus, Effect::kLensFloor, Effect::kDrift});
  options.first_depth_mm = kFocusMm - 2 * options.step_mm;
  options.drift_sigma_px = 0;
  const LinearImage in_focus = Frames(options)[2];
  for (const Effect effect : {Effect::kMagnification, Effect::kDefocus, Effect::kDrift}) {
    SCOPED_TRACE(EffectName(effect));
    SweepSimulationOptions without = options;
    without.effects.without.Add(effect);
    EXPECT_LT(Largest(Frames(without)[2], in_focus), 1e-6);
  }
}

// Read noise is added to the electrons and does not change their number.
TEST(SweepEffectsTest, EachNoiseHasDrawsOfItsOwn) {
  SweepSimulationOptions options = With({Effect::kShotNoise, Effect::kReadNoise});
  options.bits = 16;
  options.camera.sensor.transfer = TransferCurve::Linear();
  const auto stored = [&](const EffectSet& effects) {
    options.effects.given = effects;
    return SweepSimulator(options, {}).RenderFrame(1);
  };
  const EncodedImage both = stored({Effect::kShotNoise, Effect::kReadNoise});
  const EncodedImage none = stored({});
  for (const Effect effect : {Effect::kShotNoise, Effect::kReadNoise}) {
    SCOPED_TRACE(EffectName(effect));
    const EncodedImage one = stored({effect});
    double squares = 0;
    for (std::size_t i = 0; i < both.values.size(); ++i) {
      // The shot noise of one pixel is that of its light; the reading's is the same everywhere.
      const double other_sd =
          effect == Effect::kReadNoise
              ? std::sqrt(none.values[i] / 65535.0 / options.full_well_electrons)
              : options.read_noise_electrons / options.full_well_electrons;
      squares += std::pow((both.values[i] - one.values[i]) / 65535.0 / other_sd, 2);
    }
    // 19200 pixels give a standard error of 0.5 %.
    EXPECT_NEAR(std::sqrt(squares / static_cast<double>(both.values.size())), 1, 0.02);
  }
}

// cos(alpha) cos^3(beta) of [S12], written out once more for the aperture's middle, where rays make
// the chief ray's angle atan(x/K) in front of the lens and atan(x/d1) behind it; K the image
// distance of a thin lens of f1 that is focused alike.
TEST(SweepEffectsTest, FalloffIsThatOfTheChiefRayOfAPinhole) {
  for (const bool thick : {true, false}) {
    EffectSet effects = {Effect::kPixelBox};
    if (thick) effects.Add(Effect::kThickness);
    const SweepSimulationOptions options = With(effects);
    const std::vector<LinearImage> even = Frames(options);
    effects.Add(Effect::kFalloff);
    const std::vector<LinearImage> falling = Frames(With(effects));
    const Camera& camera = options.camera;
    const double scale_mm = camera.lens.front_focal_length_mm * kFocusMm /
                            (kFocusMm - camera.lens.front_focal_length_mm);
    const double distance_mm = thick ? camera.image_distance_mm() : scale_mm;
    for (const int y : {0, 55, 119}) {
      for (const int x : {0, 70, 159}) {
        const double beside_mm = 0.08 * std::hypot(x - 70, y - 55);
        const double expected = std::cos(std::atan(beside_mm / scale_mm)) *
                                std::pow(std::cos(std::atan(beside_mm / distance_mm)), 3);
        const auto i = static_cast<std::size_t>(y * 160 + x);
        EXPECT_NEAR(static_cast<double>(falling[2].values[i] / even[2].values[i]), expected, 1e-5)
            << x << ", " << y;
      }
    }
  }
}

// The fall-off of the whole aperture is compared with a mean over random rays.
TEST(SweepEffectsTest, FalloffOfTheApertureIsTheMeanOfItsRays) {
  SweepSimulationOptions options = With({Effect::kDefocus, Effect::kApertureShape,
                                         Effect::kPixelBox, Effect::kThickness, Effect::kFalloff});
  options.target.contrast = 1e-7;
  SweepSimulationOptions even_options = options;
  even_options.effects.given.Remove(Effect::kFalloff);
  const double found = static_cast<double>(Frames(options)[0].values[0]) /
                       static_cast<double>(Frames(even_options)[0].values[0]);
  const Camera& camera = options.camera;
  // A disc of twice kappa r, the ray's slope that of the line from the plane of focus.
  const double scale_mm =
      camera.lens.front_focal_length_mm * kFocusMm / (kFocusMm - camera.lens.front_focal_length_mm);
  const double radius_mm = 2 * camera.blur_ratio() * camera.lens.aperture_radius_mm;
  const auto mean = [&](const Eigen::Vector2d& landing_mm) {
    constexpr int kSide = 400;
    double sum = 0;
    int count = 0;
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const Eigen::Vector2d unit((2 * i + 1.0) / kSide - 1, (2 * j + 1.0) / kSide - 1);
        if (unit.norm() > 1) continue;
        const Eigen::Vector2d at_mm = radius_mm * unit;
        // The ray goes from the point of the plane of focus at -X to the aperture.
        const Eigen::Vector2d focus_mm = landing_mm * kFocusMm / scale_mm;
        const double front = (focus_mm - at_mm).norm() / kFocusMm;
        const double behind = (landing_mm + at_mm).norm() / camera.image_distance_mm();
        sum += std::cos(std::atan(front)) * std::pow(std::cos(std::atan(behind)), 3);
        ++count;
      }
    }
    return sum / count;
  };
  const Eigen::Vector2d corner_mm = 0.08 * Eigen::Vector2d(-70, -55);
  EXPECT_NEAR(found, mean(corner_mm) / mean({0, 0}), 2e-4);
  EXPECT_LT(found, 0.8);
}

TEST(SweepEffectsTest, EdgesWithoutThePixelBoxAreTheBlurredStep) {
  const EdgeSpread gaussian(0.1, 1.5, 0, false), disc(0.1, 0, 3, false), both(0.1, 0.8, 3, false);
  for (const double d : {-2.5, -0.7, 0.0, 0.4, 2.9}) {
    EXPECT_NEAR(gaussian.At(d), std::erfc(-d / 1.5 / std::sqrt(2.0)) / 2, 1e-12);
    // The part of the disc left of d, added up.
    constexpr int kSlices = 200000;
    double inside = 0, blurred = 0, whole = 0;
    for (int i = 0; i < kSlices; ++i) {
      const double x = -3 + 6 * (i + 0.5) / kSlices;
      const double chord = std::sqrt(9 - x * x);
      whole += chord;
      if (x < d) inside += chord;
      blurred += chord * std::erfc(-(d - x) / 0.8 / std::sqrt(2.0)) / 2;
    }
    EXPECT_NEAR(disc.At(d), inside / whole, 1e-5);
    EXPECT_NEAR(both.At(d), blurred / whole, 1e-6);
  }
}

// cos^4 of an angle whose tangent grows with the distance from the axis, with the stated value in
// the farthest corner, in every frame.
TEST(SweepEffectsTest, ShadingIsFixedToTheFrame) {
  const std::vector<LinearImage> plain = Frames(With({}));
  const std::vector<LinearImage> shaded = Frames(With({Effect::kShading}));
  const double far2 = std::pow(159 - 70, 2) + std::pow(119 - 55, 2);
  const double angle_at_corner = std::acos(std::pow(0.5, 0.25));
  for (std::size_t i = 0; i < plain.size(); ++i) {
    for (int y = 0; y < 120; y += 7) {
      for (int x = 0; x < 160; x += 7) {
        const double r2 = std::pow(x - 70, 2) + std::pow(y - 55, 2);
        const double angle = std::atan(std::tan(angle_at_corner) * std::sqrt(r2 / far2));
        const auto at = static_cast<std::size_t>(y * 160 + x);
        EXPECT_NEAR(static_cast<double>(shaded[i].values[at]),
                    std::pow(std::cos(angle), 4) * static_cast<double>(plain[i].values[at]), 1e-6);
      }
    }
  }
}

// Each row is multiplied by one factor, which has the stated period and amplitude, and another
// phase in each frame.
TEST(SweepEffectsTest, BandsAreWavesOfTheRowsWithOtherPhases) {
  const std::vector<LinearImage> plain = Frames(With({}));
  for (const bool square : {false, true}) {
    for (const bool columns : {false, true}) {
      SweepSimulationOptions options = With({Effect::kBands});
      options.band_period_px = 20;
      options.bands_are_square = square;
      options.bands_are_columns = columns;
      const std::vector<LinearImage> banded = Frames(options);
      std::vector<double> first;
      for (std::size_t i = 0; i < plain.size(); ++i) {
        const auto factor = [&](int x, int y) {
          const auto at = static_cast<std::size_t>(y * 160 + x);
          return static_cast<double>(banded[i].values[at]) /
                 static_cast<double>(plain[i].values[at]);
        };
        double mean = 0, most = 0;
        for (int line = 0; line < 100; ++line) {
          const double here = columns ? factor(line, 3) : factor(3, line);
          EXPECT_NEAR(here, columns ? factor(line, 90) : factor(140, line), 1e-5);
          EXPECT_NEAR(here, columns ? factor(line + 20, 3) : factor(3, line + 20), 1e-5);
          mean += here / 100;
          most = std::max(most, std::abs(here - 1));
          if (square) {
            EXPECT_NEAR(std::abs(here - 1), 0.2, 1e-5);
          }
        }
        EXPECT_NEAR(mean, 1, 0.021) << "whole periods; a square wave may split them 9 to 11";
        EXPECT_NEAR(most, 0.2, 0.004);
        first.push_back(factor(0, 0));
      }
      if (!square) {
        EXPECT_GT(*std::max_element(first.begin(), first.end()),
                  *std::min_element(first.begin(), first.end()) + 0.02);
      }
    }
  }
}

TEST(SweepEffectsTest, TheExposureDriftsByItsStops) {
  const std::vector<LinearImage> plain = Frames(With({}));
  const std::vector<LinearImage> drifted = Frames(With({Effect::kExposureDrift}));
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const double stops = 0.5 * (static_cast<double>(i) / 4 - 0.5);
    EXPECT_NEAR(static_cast<double>(drifted[i].values[777]),
                std::exp2(stops) * static_cast<double>(plain[i].values[777]), 1e-5);
  }
}

TEST(SweepEffectsTest, SpecksTakeTheirPartOfTheLightInEveryFrame) {
  SweepSimulationOptions options = With({Effect::kDust});
  const std::vector<LinearImage> plain = Frames(With({}));
  const std::vector<LinearImage> dusty = Frames(options);
  double area_px2 = 0;
  for (std::size_t at = 0; at < plain[0].values.size(); ++at) {
    const double kept =
        static_cast<double>(dusty[0].values[at]) / static_cast<double>(plain[0].values[at]);
    EXPECT_GT(kept, std::pow(1 - options.speck_depth, options.speck_count) - 1e-5);
    EXPECT_LT(kept, 1 + 1e-5);
    area_px2 += (1 - kept) / options.speck_depth;
    EXPECT_NEAR(static_cast<double>(dusty[3].values[at]),
                kept * static_cast<double>(plain[3].values[at]), 1e-6);
  }
  EXPECT_LT(area_px2, options.speck_count * kPi * 6.5 * 6.5);
  EXPECT_GT(area_px2, kPi * 2 * 2) << "radii from 2 to 6 px; some may be cut by the border";
  options.speck_count = 0;
  EXPECT_EQ(Largest(Frames(options)[2], plain[2]), 0);
}

// The frames do not change; the readings have the closed form of each error.
TEST(SweepEffectsTest, TheStageWritesItsErrors) {
  SweepSimulationOptions options = WideSweep();
  options.reading_sigma_mm = 0;
  options.frame_count = 8;
  options.stage.there_and_back = true;
  const SweepTruth right = SweepSimulator(options, {}).truth();
  options.stage.backlash_mm = 0.4;
  options.stage.screw_error_mm = 0.2;
  options.stage.screw_period_mm = 3;
  options.stage.screw_phase_deg = 90;
  options.stage.slip_mm = -0.5;
  options.stage.slip_from_frame = 6;
  options.stage.lead_error = 0.01;
  const SweepSimulator simulator(options, {});
  const SweepTruth& truth = simulator.truth();
  for (std::size_t i = 0; i < 8; ++i) {
    const double reading_mm = right.frames[i].reading_mm;
    EXPECT_EQ(right.frames[i].depth_mm, right.frames[7 - i].depth_mm);
    EXPECT_EQ(truth.frames[i].depth_mm, right.frames[i].depth_mm);
    // The fifth frame repeats the position at the turn, which is not approached anew.
    const bool is_falling = i > 4;
    const double back = is_falling == (options.step_mm > 0) ? 1 : 0;
    const double expected = 1.01 * reading_mm + 0.2 * std::cos(2 * kPi * reading_mm / 3) +
                            0.4 * back - (i >= 6 ? 0.5 : 0);
    EXPECT_NEAR(truth.frames[i].reading_mm, expected, 1e-9) << i;
  }
  options.effects.without = {Effect::kReadingError};
  EXPECT_EQ(SweepSimulator(options, {}).truth().frames[6].reading_mm, right.frames[6].reading_mm);
  options.effects.without = {};
  options.stage = {};
  options.stage.resolution_mm = 0.25;
  const SweepTruth rounded = SweepSimulator(options, {}).truth();
  for (const SweepTruth::Frame& frame : rounded.frames)
    EXPECT_NEAR(std::remainder(frame.reading_mm, 0.25), 0, 1e-9);
}

TEST(SweepEffectsTest, ReadingsAndNoiseAreLeftOutToo) {
  SweepSimulationOptions options = WideSweep();
  options.effects.without = {Effect::kReadingError, Effect::kShotNoise, Effect::kReadNoise,
                             Effect::kQuantisation, Effect::kTransferCurve};
  const SweepSimulator simulator(options, {});
  for (const SweepTruth::Frame& frame : simulator.truth().frames) {
    EXPECT_DOUBLE_EQ(frame.reading_mm, frame.depth_mm - 10);
  }
  const EncodedImage stored = simulator.RenderFrame(1);
  EXPECT_EQ(stored.bits, 16);
  EXPECT_EQ(simulator.camera().sensor.transfer.Encode(0.25), 0.25);
  const LinearImage right = simulator.RenderNoiseless(1),
                    found = ToLinear(stored, TransferCurve::Linear());
  for (std::size_t i = 0; i < right.values.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(found.values[i]),
                std::clamp(static_cast<double>(right.values[i]), 0.0, 1.0), 0.6 / 65535);
  }
}

TEST(SweepEffectsTest, AutoHasAll) {
  EXPECT_EQ(SweepSimulator(WideSweep(), {}).effects().on, SweepEffects());
  SweepSimulationOptions options = WideSweep();
  options.effects.without = {Effect::kDrift};
  const SweepSimulator simulator(options, {});
  EXPECT_EQ(simulator.effects().on, SweepEffects().Without({Effect::kDrift}));
  // The record names the effects that were left out, and how much they would have changed at most.
  EXPECT_THAT(simulator.truth().effects.left_out_grey_levels,
              ElementsAre(Pair(EffectName(Effect::kDrift), Gt(1))));
}

// The rays of a point are drawn and weighted one by one by [S12], and compared with an edge at
// f/1.4: the width of the blur, its position and its brightness, off the axis and on it.
TEST(SweepEffectsTest, FalloffWeightsTheRaysOfABlurredEdge) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double depth_mm : {240.0, 400.0}) {
      SCOPED_TRACE(PsfName(psf) + " at " + std::to_string(depth_mm) + " mm");
      SweepSimulationOptions options =
          With({Effect::kDefocus, Effect::kApertureShape, Effect::kThickness, Effect::kFalloff});
      options.camera.psf = psf;
      options.camera.lens.aperture_radius_mm = 16 / 2.8;
      options.camera.sensor.pixel_pitch_mm = 0.02;
      options.camera.sensor.width_px = 201;
      options.camera.sensor.height_px = 3;
      options.camera.sensor.principal_point_px = {0, 1};  // 2 mm of one side
      options.target.kind = TargetKind::kKnifeEdge;
      options.target.edge_angle_deg = 0;
      options.target.contrast = 1;
      options.first_depth_mm = depth_mm;
      options.frame_count = 1;
      options.lamp_falloff = false;
      const LinearImage frame = SweepSimulator(options, {}).RenderNoiseless(0);
      const Camera& camera = options.camera;
      const double sigma_mm = camera.blur_ratio() * camera.lens.aperture_radius_mm;
      const double scale_mm = DefocusScaleMm(camera.lens, camera.image_distance_mm());
      const double c = DefocusPerAperture(camera.lens, camera.image_distance_mm(), depth_mm);
      // The target's centre is in the middle of a frame at the depth nearest to focus: here.
      const double edge_mm = 0.02 * 100;
      const auto seen = [&](double landing_mm, double* whole) {
        double sum = 0;
        *whole = 0;
        constexpr int kSide = 401;
        for (int i = 0; i < kSide; ++i) {
          for (int j = 0; j < kSide; ++j) {
            const double reach = psf == Psf::kDisc ? 2 : 5;
            const Eigen::Vector2d unit =
                reach * Eigen::Vector2d((2 * i + 1.0) / kSide - 1, (2 * j + 1.0) / kSide - 1);
            if (psf == Psf::kDisc && unit.norm() > 2) continue;
            const Eigen::Vector2d at_mm = sigma_mm * unit, landing(landing_mm, 0);
            const double front = (landing / scale_mm - at_mm / kFocusMm).norm();
            const double behind = (landing + at_mm).norm() / camera.image_distance_mm();
            const double weight = (psf == Psf::kDisc ? 1 : std::exp(-unit.squaredNorm() / 2)) *
                                  std::cos(std::atan(front)) *
                                  std::pow(std::cos(std::atan(behind)), 3);
            *whole += weight;
            if (landing_mm + at_mm.x() * c > edge_mm) sum += weight;
          }
        }
        return sum;
      };
      double on_axis = 0, whole = 0;
      seen(0, &on_axis);
      for (int x = 0; x <= 200; x += 8) {
        const double share = seen(0.02 * x, &whole) / on_axis;
        EXPECT_NEAR(static_cast<double>(frame.at(x, 1, 0)) / (2 * options.light_level), share,
                    0.004)
            << x;
      }
    }
  }
}

// Cameras of all fields: fall-off changes no encoded value by more than its bound.
TEST(SweepEffectsTest, FalloffKeepsToItsBound) {
  RandomDraws draws(11, RandomDraws::Purpose::kTexture, 3);
  int matters = 0;
  for (int i = 0; i < 40; ++i) {
    SweepSimulationOptions options = WideSweep();
    options.camera.sensor.width_px = 48;
    options.camera.sensor.height_px = 40;
    options.camera.sensor.principal_point_px = {20 * draws.Uniform(), 30 * draws.Uniform()};
    options.camera.sensor.pixel_pitch_mm = 0.002 * std::pow(40, draws.Uniform());
    options.camera.lens.aperture_radius_mm = 0.02 * std::pow(100, draws.Uniform());
    options.frame_count = 2;
    options.step_mm = 300 * draws.Uniform();
    options.effects.base = EffectSelectionOptions::Base::kAll;
    SweepSimulationOptions even = options;
    even.effects.without = {Effect::kFalloff};
    const SweepSimulator all(options, {}), without(even, {});
    double bound = 0;
    for (const LargestEffectImpact& finding : all.effects().findings) {
      if (finding.effect == Effect::kFalloff) bound = finding.impact.grey_levels;
    }
    matters += bound > 0.5 ? 1 : 0;
    const TransferCurve& curve = options.camera.sensor.transfer;
    for (int frame = 0; frame < 2; ++frame) {
      const LinearImage a = all.RenderNoiseless(frame), b = without.RenderNoiseless(frame);
      double largest = 0;
      for (std::size_t p = 0; p < a.values.size(); ++p) {
        const auto stored = [&](float value) {
          return 255 * curve.Encode(std::clamp(static_cast<double>(value), 0.0, 1.0));
        };
        largest = std::max(largest, std::abs(stored(a.values[p]) - stored(b.values[p])));
      }
      EXPECT_LE(largest, 1.001 * bound + 1e-3) << i;
    }
  }
  EXPECT_GT(matters, 10);
}

TEST(SweepEffectsTest, RefusesWhatASweepDoesNotHave) {
  SweepSimulationOptions options = WideSweep();
  options.effects.without = {Effect::kOcclusion};
  try {
    const SweepSimulator simulator(options, {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("effect occlusion does not apply to this image"));
  }
}

}  // namespace
}  // namespace thicklens::model
