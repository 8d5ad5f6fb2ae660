#include "thicklens/model/sweep_simulator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <string>
#include <vector>

#include "support/blur_oracles.h"
#include "support/sample_moments.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::BoxTransfer;
using thicklens::testing::CentredSensor;
using thicklens::testing::DiscTransfer;
using thicklens::testing::ExpectMoments;
using thicklens::testing::GaussianTransfer;
using thicklens::testing::Moments;
using thicklens::testing::TestCamera;
using thicklens::testing::ThinLens;
using thicklens::testing::WithMethod;

constexpr double kPi = 3.14159265358979323846;

// A thin 50 mm lens at f/2.8 that is focused at 300 mm.
constexpr double kFocalMm = 50, kFocusMm = 300, kRadiusMm = 50 / 5.6, kPitchMm = 0.0045;
constexpr double kRatio = 0.45, kFloorPx = 0.5;
constexpr double kImageMm = 60;  // 1/50 = 1/60 + 1/300

Camera MacroCamera(int width_px, int height_px) {
  Camera camera = TestCamera("macro", ThinLens(kFocalMm, kRadiusMm),
                             CentredSensor(width_px, height_px, kPitchMm, TransferCurve::Linear()),
                             {kImageMm, 0}, {kRatio, 0});
  camera.calibration->blur_floor_px = Estimate{kFloorPx, 0};
  return WithMethod(camera);
}

// Thin-lens optics by similar triangles, apart from the library's formulas.
double PixelOnTargetMm(double depth_mm) { return kPitchMm * depth_mm / kImageMm; }
double DefocusSigmaPx(double depth_mm) {
  const double image_mm = kFocalMm * depth_mm / (depth_mm - kFocalMm);  // where it would be sharp
  return kRatio * kRadiusMm * std::abs(kImageMm - image_mm) / image_mm / kPitchMm;
}

// One frame at `depth_mm` with every effect off.
SweepSimulationOptions StillOptions(int width_px, int height_px, double depth_mm) {
  SweepSimulationOptions options;
  options.camera = MacroCamera(width_px, height_px);
  options.first_depth_mm = depth_mm;
  options.frame_count = 1;
  options.lamp_falloff = false;
  options.effects.without = {Effect::kFalloff};
  return options;
}

LinearImage UniformImage() { return {4, 3, 1, std::vector<float>(12, 0.37f)}; }

SweepSimulationOptions UniformOptions(int width_px, int height_px, double depth_mm) {
  SweepSimulationOptions options = StillOptions(width_px, height_px, depth_mm);
  options.target.kind = TargetKind::kImage;
  options.target.image_path = "uniform";
  return options;
}

// ---------------------------------------------------------------------------------------- edges

// Place, px, and variance, px^2, of the line spread of the edge that the middle row crosses.
// Differences of neighbouring pixels are the line spread behind one more box of a pixel.
Moments LineSpread(const LinearImage& image) {
  const int y = image.height_px / 2;
  double mass = 0, first = 0, second = 0;
  for (int x = 0; x + 1 < image.width_px; ++x) {
    const double difference = static_cast<double>(image.at(x + 1, y, 0)) - image.at(x, y, 0);
    const double position = x + 0.5;
    mass += difference;
    first += difference * position;
    second += difference * position * position;
  }
  first /= mass;
  return {first, second / mass - first * first - 2.0 / 12};
}

TEST(SweepSimulatorTest, EdgeFramesCarryFloorDefocusAndInk) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const TargetKind kind : {TargetKind::kKnifeEdge, TargetKind::kPrintedEdge}) {
      for (const double depth_mm : {292.0, 299.5, 300.0, 306.0}) {
        SweepSimulationOptions options = StillOptions(161, 3, depth_mm);
        options.camera.psf = psf;
        options.target.kind = kind;
        options.target.edge_angle_deg = 0;
        options.target.ink_sigma_mm = 0.05;
        const SweepSimulator simulator(options, {});
        const double ink_px =
            kind == TargetKind::kPrintedEdge ? 0.05 / PixelOnTargetMm(depth_mm) : 0;
        const double expected =
            std::pow(kFloorPx, 2) + std::pow(DefocusSigmaPx(depth_mm), 2) + ink_px * ink_px;
        EXPECT_NEAR(LineSpread(simulator.RenderNoiseless(0)).variance, expected,
                    1e-3 + 1e-4 * expected)
            << PsfName(psf) << " at " << depth_mm;
        EXPECT_NEAR(simulator.truth().frames[0].blur_sigma_px,
                    std::hypot(kFloorPx, DefocusSigmaPx(depth_mm)), 1e-9);
      }
    }
  }
}

TEST(SweepSimulatorTest, EdgeHasItsTwoGreysSlantAndPlace) {
  SweepSimulationOptions options = StillOptions(101, 81, kFocusMm);
  options.target.kind = TargetKind::kKnifeEdge;
  options.target.contrast = 0.5;
  options.target.edge_angle_deg = 10;
  options.light_level = 0.4;
  const LinearImage image = SweepSimulator(options, {}).RenderNoiseless(0);
  EXPECT_NEAR(image.at(0, 40, 0), 0.2, 1e-6);
  EXPECT_NEAR(image.at(100, 40, 0), 0.6, 1e-6);
  EXPECT_NEAR(image.at(50, 40, 0), 0.4, 1e-6);
  // The edge is 10 degrees from the vertical, so 30 rows up it is 30 tan 10 px = 5.29 px further
  // right.
  EXPECT_LT(image.at(55, 10, 0), 0.4);
  EXPECT_GT(image.at(56, 10, 0), 0.4);
  EXPECT_LT(image.at(44, 70, 0), 0.4);
  EXPECT_GT(image.at(45, 70, 0), 0.4);
}

TEST(SweepSimulatorTest, ImageScaleIsOneOverDepth) {
  // The principal point far from the middle: the edge wanders toward it as the target recedes.
  SweepSimulationOptions options = StillOptions(200, 3, 290);
  options.camera.sensor.principal_point_px = {12.25, 1};
  options.target.kind = TargetKind::kKnifeEdge;
  options.target.edge_angle_deg = 0;
  options.step_mm = 2;
  options.frame_count = 11;
  const SweepSimulator simulator(options, {});
  for (int i = 0; i < 11; ++i) {
    const double expected_px = 12.25 + (99.5 - 12.25) * kFocusMm / (290 + 2 * i);
    EXPECT_NEAR(LineSpread(simulator.RenderNoiseless(i)).mean, expected_px, 1e-4) << i;
  }
}

// ------------------------------------------------------------------------------------- textures

// The Fourier component of an image at a frequency in cycles per px, behind a window that falls to
// 0 at the borders and has the sum 1.
std::complex<double> Component(const LinearImage& image, double fx, double fy) {
  std::complex<double> sum = 0;
  double weights = 0;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double w = std::pow(
          std::sin(kPi * (x + 0.5) / image.width_px) * std::sin(kPi * (y + 0.5) / image.height_px),
          4);
      weights += w;
      sum += w * static_cast<double>(image.at(x, y, 0)) *
             std::polar(1.0, -2 * kPi * (fx * x + fy * y));
    }
  }
  return sum / weights;
}

TEST(SweepSimulatorTest, CheckerboardHasTheSizeAndTheModulationOfItsDepth) {
  constexpr double kSquareMm = 0.25;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    SweepSimulationOptions options = StillOptions(192, 192, 294);
    options.camera.psf = psf;
    options.target.kind = TargetKind::kCheckerboard;
    options.target.feature_size_mm = kSquareMm;
    options.step_mm = 3;
    options.frame_count = 5;
    const SweepSimulator simulator(options, {});
    for (int i = 0; i < 5; ++i) {
      const double depth_mm = 294 + 3 * i;
      const LinearImage image = simulator.RenderNoiseless(i);
      const double f = PixelOnTargetMm(depth_mm) / (2 * kSquareMm);
      const double sigma = DefocusSigmaPx(depth_mm);
      const double defocused = psf == Psf::kDisc ? DiscTransfer(2 * sigma, f * std::sqrt(2.0))
                                                 : GaussianTransfer(sigma, f * std::sqrt(2.0));
      // Two square waves multiplied: amplitude (2/pi)^2 of each of the four components.
      const double expected = options.light_level * options.target.contrast * 4 / (kPi * kPi) *
                              GaussianTransfer(kFloorPx, f * std::sqrt(2.0)) * defocused *
                              std::pow(BoxTransfer(f), 2);
      const double found = std::abs(Component(image, f, f));
      // The target is drawn by the mean light of its samples' cells, half a px of the nearest
      // frame.
      EXPECT_NEAR(found, std::abs(expected), 4e-3 * std::abs(expected))
          << PsfName(psf) << " at " << depth_mm;
      if (sigma < 3) {
        EXPECT_GT(found, std::abs(Component(image, 1.02 * f, f)));
        EXPECT_GT(found, std::abs(Component(image, 0.98 * f, f)));
      }
    }
  }
}

TEST(SweepSimulatorTest, ImageStandsUprightAndCovers) {
  // Four greys in four quarters, as the user's image has them.
  LinearImage quarters{64, 64, 1, {}};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      quarters.values.push_back(0.1f + (x < 32 ? 0.0f : 0.3f) + (y < 32 ? 0.0f : 0.15f));
    }
  }
  SweepSimulationOptions options = StillOptions(96, 96, kFocusMm);
  options.target.kind = TargetKind::kImage;
  options.target.image_path = "quarters";
  const LinearImage image = SweepSimulator(options, quarters).RenderNoiseless(0);
  const double scale = 0.5 / 0.325;  // mean light 0.5
  EXPECT_NEAR(image.at(20, 20, 0), 0.1 * scale, 0.02);
  EXPECT_NEAR(image.at(75, 20, 0), 0.4 * scale, 0.02);
  EXPECT_NEAR(image.at(20, 75, 0), 0.25 * scale, 0.02);
  EXPECT_NEAR(image.at(75, 75, 0), 0.55 * scale, 0.02);
}

TEST(SweepSimulatorTest, BlurKeepsTheLightAndTheLampFallsAsTheSquare) {
  SweepSimulationOptions options = UniformOptions(24, 18, 285);
  options.step_mm = 5;
  options.frame_count = 7;
  options.light_level = 0.3;
  const SweepSimulator steady(options, UniformImage());
  options.lamp_falloff = true;
  const SweepSimulator falling(options, UniformImage());
  for (int i = 0; i < 7; ++i) {
    const double falloff = std::pow(kFocusMm / (285 + 5 * i), 2);
    const LinearImage even = steady.RenderNoiseless(i);
    const LinearImage lamp = falling.RenderNoiseless(i);
    for (std::size_t k = 0; k < even.values.size(); ++k) {
      EXPECT_NEAR(even.values[k], 0.3, 1e-6);
      EXPECT_NEAR(lamp.values[k], 0.3 * falloff, 1e-6);
    }
  }
}

// ---------------------------------------------------------------------------------------- noise

TEST(SweepSimulatorTest, ShotAndReadNoiseHaveTheirVariances) {
  for (const double level : {0.02, 0.5}) {
    for (const double read : {0.0, 12.0}) {
      SweepSimulationOptions options = UniformOptions(256, 256, kFocusMm);
      options.light_level = level;
      options.full_well_electrons = 10000;
      options.read_noise_electrons = read;
      options.bits = 16;
      const EncodedImage frame = SweepSimulator(options, UniformImage()).RenderFrame(0);
      std::vector<double> electrons;
      for (const auto value : frame.values) electrons.push_back(value / 65535.0 * 10000);
      const double quantum = 10000 / 65535.0;
      ExpectMoments(electrons, 10000 * level, 10000 * level + read * read + quantum * quantum / 12);
    }
  }
}

TEST(SweepSimulatorTest, NoiseOfPixelsAndFramesIsIndependent) {
  SweepSimulationOptions options = UniformOptions(200, 200, kFocusMm);
  options.full_well_electrons = 1000;
  options.bits = 16;
  options.frame_count = 2;
  const SweepSimulator simulator(options, UniformImage());
  const EncodedImage first = simulator.RenderFrame(0);
  const EncodedImage second = simulator.RenderFrame(1);
  const auto deviation = [](const EncodedImage& frame, std::size_t i) {
    return (frame.values[i] / 65535.0 - 0.5) / std::sqrt(0.5 / 1000);
  };
  double neighbours = 0, frames = 0;
  for (std::size_t i = 0; i + 1 < first.values.size(); ++i) {
    neighbours += deviation(first, i) * deviation(first, i + 1) / 40000;
    frames += deviation(first, i) * deviation(second, i) / 40000;
  }
  EXPECT_NEAR(neighbours, 0, 4.5 / 200);
  EXPECT_NEAR(frames, 0, 4.5 / 200);
}

TEST(SweepSimulatorTest, QuantisesAfterTheTransferCurveAndClips) {
  for (const int bits : {8, 16}) {
    SweepSimulationOptions options = StillOptions(64, 48, kFocusMm);
    options.camera.sensor.transfer = TransferCurve::Srgb();
    options.target.contrast = 1;
    options.light_level = 0.8;  // the brightest leaves are beyond full scale
    options.bits = bits;
    const SweepSimulator simulator(options, {});
    const LinearImage light = simulator.RenderNoiseless(0);
    const EncodedImage stored = simulator.RenderFrame(0);
    EXPECT_EQ(stored.bits, bits);
    EXPECT_EQ(stored.channels, 1);
    const double full_scale = bits == 8 ? 255 : 65535;
    int clipped = 0;
    for (std::size_t i = 0; i < stored.values.size(); ++i) {
      const double x = std::clamp<double>(light.values[i], 0, 1);
      // IEC 61966-2-1, written out.
      const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
      EXPECT_NEAR(stored.values[i], encoded * full_scale, 0.5001 + full_scale * 1e-6);
      clipped += stored.values[i] == full_scale;
    }
    EXPECT_GT(clipped, 10);
  }
}

// ---------------------------------------------------------------------- bench, lamp and drift

TEST(SweepSimulatorTest, ReadingsFollowTheBenchWithTheirError) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    SweepSimulationOptions options = UniformOptions(2, 2, 280);
    options.step_mm = 0.02;
    options.frame_count = 2000;
    options.bench_offset_mm = 412.5;
    options.direction = direction;
    options.reading_sigma_mm = 0.07;
    const SweepSimulator simulator(options, UniformImage());
    const SweepTruth& truth = simulator.truth();
    EXPECT_EQ(truth.bench_offset_mm, 412.5);
    ASSERT_EQ(truth.frames.size(), 2000u);
    EXPECT_EQ(truth.frames[0].image, "frames/frame_000.png");
    EXPECT_EQ(truth.frames[1234].image, "frames/frame_1234.png");
    std::vector<double> errors;
    for (std::size_t i = 0; i < 2000; ++i) {
      const double depth_mm = 280 + 0.02 * static_cast<double>(i);
      EXPECT_NEAR(truth.frames[i].depth_mm, depth_mm, 1e-9);
      const double reading_mm =
          direction == BenchDirection::kAway ? depth_mm - 412.5 : 412.5 - depth_mm;
      errors.push_back(truth.frames[i].reading_mm - reading_mm);
    }
    ExpectMoments(errors, 0, 0.07 * 0.07);
  }
}

TEST(SweepSimulatorTest, TruthIsTheCamerasCalibration) {
  const SweepSimulator simulator(UniformOptions(4, 4, 290), UniformImage());
  EXPECT_DOUBLE_EQ(simulator.truth().image_distance_mm, kImageMm);
  EXPECT_NEAR(simulator.truth().focus_depth_mm, kFocusMm, 1e-9);
  EXPECT_EQ(simulator.truth().blur_ratio, kRatio);
  EXPECT_EQ(simulator.truth().blur_floor_px, kFloorPx);
}

TEST(SweepSimulatorTest, FlickerHasItsDeviation) {
  SweepSimulationOptions options = UniformOptions(2, 2, kFocusMm);
  options.frame_count = 1500;
  options.flicker = 0.05;
  const SweepSimulator simulator(options, UniformImage());
  std::vector<double> levels;
  for (int i = 0; i < 1500; ++i) levels.push_back(simulator.RenderNoiseless(i).values[0]);
  ExpectMoments(levels, 0.5, std::pow(0.5 * 0.05, 2));
}

TEST(SweepSimulatorTest, DriftHasItsDeviationOnBothAxesAndScalesWithTheImage) {
  // An upright edge shows the drift to the right, a level one the drift down: its bright side is
  // below, so that the image's middle column read downward is the row of the upright one.
  std::vector<double> right, down;
  for (const double angle_deg : {0.0, 90.0}) {
    SweepSimulationOptions options = StillOptions(33, 33, kFocusMm);
    options.target.kind = TargetKind::kKnifeEdge;
    options.target.edge_angle_deg = angle_deg;
    options.drift_sigma_px = 1.5;
    options.frame_count = 800;
    const SweepSimulator simulator(options, {});
    for (int i = 0; i < options.frame_count; ++i) {
      LinearImage image = simulator.RenderNoiseless(i);
      if (angle_deg == 90) {
        LinearImage turned = image;
        for (int y = 0; y < 33; ++y) {
          for (int x = 0; x < 33; ++x) {
            turned.values[static_cast<std::size_t>(y * 33 + x)] = image.at(y, x, 0);
          }
        }
        image = turned;
      }
      (angle_deg == 0 ? right : down).push_back(LineSpread(image).mean - 16);
    }
  }
  ExpectMoments(right, 0, 1.5 * 1.5);
  ExpectMoments(down, 0, 1.5 * 1.5);
  double product = 0;
  for (std::size_t i = 0; i < right.size(); ++i) product += right[i] * down[i] / 800;
  EXPECT_NEAR(product, 0, 4.5 * 2.25 / std::sqrt(800.0));

  // A given displacement on the target appears smaller from a larger distance.
  SweepSimulationOptions options = StillOptions(301, 3, 330);
  options.target.kind = TargetKind::kKnifeEdge;
  options.target.edge_angle_deg = 0;
  options.drift_sigma_px = 1.5;
  EXPECT_NEAR(LineSpread(SweepSimulator(options, {}).RenderNoiseless(0)).mean - 150,
              right[0] * kFocusMm / 330, 2e-4);
}

TEST(SweepSimulatorTest, DriftMovesTexturesAsItMovesEdges) {
  SweepSimulationOptions options = StillOptions(192, 192, kFocusMm);
  options.target.kind = TargetKind::kCheckerboard;
  options.target.feature_size_mm = 0.25;
  const LinearImage still = SweepSimulator(options, {}).RenderNoiseless(0);
  options.drift_sigma_px = 1.5;
  const LinearImage moved = SweepSimulator(options, {}).RenderNoiseless(0);
  options.target.kind = TargetKind::kKnifeEdge;
  options.target.edge_angle_deg = 0;
  const double right_px = LineSpread(SweepSimulator(options, {}).RenderNoiseless(0)).mean - 95.5;
  // Phases of the components (f, f) and (f, -f): their sum turns with the drift in x alone.
  const double f = PixelOnTargetMm(kFocusMm) / 0.5;
  const auto turn = [&](double fy) {
    return std::arg(Component(moved, f, fy) / Component(still, f, fy));
  };
  EXPECT_NEAR(-(turn(f) + turn(-f)) / (4 * kPi * f), right_px, 1e-3);
}

// ---------------------------------------------------------------------------- reproducibility

TEST(SweepSimulatorTest, SameBitsInAnyOrderAndOnAnyThread) {
  SweepSimulationOptions options = StillOptions(48, 40, 290);
  options.step_mm = 2;
  options.frame_count = 9;
  options.flicker = 0.02;
  options.drift_sigma_px = 1;
  options.full_well_electrons = 5000;
  options.read_noise_electrons = 4;
  const SweepSimulator simulator(options, {});
  std::vector<EncodedImage> backward(9), parallel(9);
  for (int i = 8; i >= 0; --i) backward[static_cast<std::size_t>(i)] = simulator.RenderFrame(i);
  const SweepSimulator again(options, {});
  ParallelFor(9, 4, [&](int i) { parallel[static_cast<std::size_t>(i)] = again.RenderFrame(i); });
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(backward[i].values, parallel[i].values) << i;
    EXPECT_EQ(simulator.truth().frames[i].reading_mm, again.truth().frames[i].reading_mm);
  }
  options.seed = 2;
  const SweepSimulator other(options, {});
  EXPECT_NE(other.RenderNoiseless(0).values, simulator.RenderNoiseless(0).values);
}

TEST(SweepSimulatorTest, OneEffectDoesNotChangeTheDrawsOfAnother) {
  SweepSimulationOptions options = StillOptions(32, 32, 295);
  options.reading_sigma_mm = 0.1;
  const SweepSimulator plain(options, {});
  options.flicker = 0.1;
  options.full_well_electrons = 1000;
  const SweepSimulator more(options, {});
  EXPECT_EQ(plain.truth().frames[0].reading_mm, more.truth().frames[0].reading_mm);
  const LinearImage a = plain.RenderNoiseless(0), b = more.RenderNoiseless(0);
  const double ratio = static_cast<double>(b.values[0]) / a.values[0];
  EXPECT_NE(ratio, 1);
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    EXPECT_NEAR(b.values[i], ratio * a.values[i], 1e-6);
  }
}

// --------------------------------------------------------------------------------------- errors

TEST(SweepSimulatorTest, RefusesImpossibleOptions) {
  struct Case {
    std::function<void(SweepSimulationOptions*)> spoil;
    const char* reported;
  };
  const double nan = std::nan("");
  const Case cases[] = {
      {[](auto* o) { o->camera.calibration.reset(); }, "image_distance_mm is missing"},
      {[](auto* o) { o->camera.calibration->blur_ratio.reset(); }, "blur_ratio is missing"},
      {[](auto* o) { o->camera.calibration->blur_floor_px.reset(); }, "blur_floor_px is missing"},
      {[](auto* o) { o->camera.calibration->image_distance_mm->value = 50; }, "infinity"},
      {[](auto* o) { o->camera.sensor.width_px = 0; }, "width_px"},
      {[](auto* o) { o->target.contrast = 0; }, "target.contrast is 0"},
      {[](auto* o) { o->target.contrast = 1.2; }, "target.contrast is 1.2"},
      {[=](auto* o) { o->target.feature_size_mm = nan; }, "target.feature_size_mm is nan"},
      {[](auto* o) { o->target.edge_angle_deg = 91; }, "target.edge_angle_deg is 91"},
      {[](auto* o) { o->target.ink_sigma_mm = -1; }, "target.ink_sigma_mm is -1"},
      {[](auto* o) { o->frame_count = 0; }, "bench.frames is 0"},
      {[](auto* o) { o->first_depth_mm = 0; }, "depths run from 0"},
      {[=](auto* o) { o->step_mm = nan; }, "depths run from"},
      {[](auto* o) { o->frame_count = 3, o->step_mm = -200; }, "to -100 mm"},
      {[=](auto* o) { o->bench_offset_mm = nan; }, "bench.offset_mm"},
      {[](auto* o) { o->reading_sigma_mm = -0.1; }, "bench.reading_sigma_mm is -0.1"},
      {[](auto* o) { o->drift_sigma_px = -1; }, "drift_sigma_px is -1"},
      {[](auto* o) { o->full_well_electrons = -1; }, "noise.full_well_electrons is -1"},
      {[](auto* o) { o->read_noise_electrons = 3; }, "needs noise.full_well_electrons"},
      {[](auto* o) { o->light_level = 1.5; }, "light.level is 1.5"},
      {[](auto* o) { o->flicker = 0.6; }, "light.flicker is 0.6"},
      {[](auto* o) { o->bits = 12; }, "bits is 12"},
  };
  for (const Case& c : cases) {
    SweepSimulationOptions options = StillOptions(8, 8, kFocusMm);
    std::string why;
    ASSERT_TRUE(options.IsValid(&why)) << why;
    c.spoil(&options);
    EXPECT_FALSE(options.IsValid(&why)) << c.reported;
    EXPECT_THAT(why, HasSubstr(c.reported));
    EXPECT_THROW(SweepSimulator(options, {}), Error) << c.reported;
  }
}

TEST(SweepSimulatorTest, RefusesFramesAndImagesThatAreNotThere) {
  const SweepSimulator simulator(UniformOptions(4, 4, kFocusMm), UniformImage());
  EXPECT_THROW(simulator.RenderNoiseless(1), Error);
  EXPECT_THROW(simulator.RenderFrame(-1), Error);
  EXPECT_THROW(SweepSimulator(UniformOptions(4, 4, kFocusMm), {}), Error);
  const LinearImage black{2, 2, 1, std::vector<float>(4, 0.0f)};
  EXPECT_THROW(SweepSimulator(UniformOptions(4, 4, kFocusMm), black), Error);
}

}  // namespace
}  // namespace thicklens::model
