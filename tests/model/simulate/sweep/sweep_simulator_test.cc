#include "thicklens/model/sweep_simulator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "model/base/random_draws.h"
#include "model/simulate/sweep/edge_spread.h"
#include "model/simulate/sweep/periodic_picture.h"
#include "model/simulate/sweep/sweep_target.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

constexpr double kPi = 3.14159265358979323846;

// A thin 50 mm lens at f/2.8 that is focused at 300 mm.
constexpr double kFocalMm = 50, kFocusMm = 300, kRadiusMm = 50 / 5.6, kPitchMm = 0.0045;
constexpr double kRatio = 0.45, kFloorPx = 0.5;
constexpr double kImageMm = 60;  // 1/50 = 1/60 + 1/300

Camera MacroCamera(int width_px, int height_px) {
  Camera camera;
  camera.name = "macro";
  camera.lens = {kFocalMm, kFocalMm, 0, kRadiusMm};
  camera.sensor.width_px = width_px;
  camera.sensor.height_px = height_px;
  camera.sensor.pixel_pitch_mm = kPitchMm;
  camera.sensor.principal_point_px = {(width_px - 1) / 2.0, (height_px - 1) / 2.0};
  camera.sensor.transfer = TransferCurve::Linear();
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = Estimate{kImageMm, 0};
  camera.calibration->blur_ratio = Estimate{kRatio, 0};
  camera.calibration->blur_floor_px = Estimate{kFloorPx, 0};
  camera.calibration->evidence.method = "assumed";
  return camera;
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

LinearPicture UniformPicture() { return {4, 3, 1, std::vector<float>(12, 0.37f)}; }

SweepSimulationOptions UniformOptions(int width_px, int height_px, double depth_mm) {
  SweepSimulationOptions options = StillOptions(width_px, height_px, depth_mm);
  options.target.kind = TargetKind::kPicture;
  options.target.picture_path = "uniform";
  return options;
}

struct Moments {
  double mean = 0;
  double variance = 0;
};
Moments MomentsOf(const std::vector<double>& values) {
  Moments moments;
  for (const double value : values) moments.mean += value / static_cast<double>(values.size());
  for (const double value : values) {
    moments.variance += std::pow(value - moments.mean, 2) / static_cast<double>(values.size() - 1);
  }
  return moments;
}

// Sample moments of n normal draws stay within 4.5 of their own standard deviations.
void ExpectMoments(const std::vector<double>& values, double mean, double variance) {
  const auto n = static_cast<double>(values.size());
  const Moments found = MomentsOf(values);
  EXPECT_NEAR(found.mean, mean, 4.5 * std::sqrt(variance / n));
  EXPECT_NEAR(found.variance / variance, 1, 4.5 * std::sqrt(2 / n));
}

// ---------------------------------------------------------------------------- periodic pictures

cv::Mat RandomSamples(int rows, int columns) {
  RandomDraws draws(7, RandomDraws::Purpose::kTexture, 0);
  cv::Mat samples(rows, columns, CV_64F);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) samples.at<double>(i, j) = 1 + 0.3 * draws.Normal();
  }
  return samples;
}

// Transfer functions written out once more, by integrals where the library has formulas.
double GaussianOracle(double sigma, double f_square) {
  return std::exp(-2 * kPi * kPi * sigma * sigma * f_square);
}
double DiscOracle(double radius, double f) {
  // Projection of the disc on the frequency's direction, x = R sin(phi).
  double sum = 0;
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) {
    const double phi = kPi * ((i + 0.5) / kSteps - 0.5);
    sum += std::pow(std::cos(phi), 2) * std::cos(2 * kPi * f * radius * std::sin(phi));
  }
  return 2 * sum / kSteps;
}
double BoxOracle(double f) { return f == 0 ? 1 : std::sin(kPi * f) / (kPi * f); }

TEST(PeriodicPictureTest, EqualsTheDirectSumOfItsFourierSeries) {
  for (const auto& [columns, rows] : {std::pair{60, 45}, std::pair{45, 64}, std::pair{5, 90}}) {
    const PeriodicPicture picture(RandomSamples(rows, columns));
    for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
      for (const double defocus : {0.0, 0.8, 4.0}) {
        const AxisSampling x{-2.31, 0.0313, 37};
        const AxisSampling y{0.77, 0.0191, 21};
        const cv::Mat frame = picture.Evaluate(x, y, {kFloorPx, psf, defocus});
        ASSERT_EQ(frame.rows, 21);
        ASSERT_EQ(frame.cols, 37);
        for (int probe = 0; probe < 6; ++probe) {
          const int i = probe * 13 % 21;
          const int j = probe * 23 % 37;
          std::complex<double> sum = 0;
          for (int b = -picture.max_y_frequency(); b <= picture.max_y_frequency(); ++b) {
            for (int a = -picture.max_x_frequency(); a <= picture.max_x_frequency(); ++a) {
              const double fx = a * x.step, fy = b * y.step;
              const double f_square = fx * fx + fy * fy;
              const double defocused = psf == Psf::kDisc
                                           ? DiscOracle(2 * defocus, std::sqrt(f_square))
                                           : GaussianOracle(defocus, f_square);
              sum += picture.Coefficient(a, b) * GaussianOracle(kFloorPx, f_square) * defocused *
                     BoxOracle(fx) * BoxOracle(fy) *
                     std::polar(
                         1.0, 2 * kPi * (a * (x.start + j * x.step) + b * (y.start + i * y.step)));
            }
          }
          EXPECT_NEAR(frame.at<double>(i, j), sum.real(), 1e-9) << columns << "x" << rows;
          EXPECT_NEAR(sum.imag(), 0, 1e-9);
        }
      }
    }
  }
}

TEST(PeriodicPictureTest, RunsThroughItsSamplesWhereThereIsNoBlur) {
  // Odd counts: every frequency has its phase. The pixel box is undone by a step that is tiny.
  const cv::Mat samples = RandomSamples(33, 27);
  const PeriodicPicture picture(samples);
  for (int i = 0; i < 33; i += 5) {
    for (int j = 0; j < 27; j += 4) {
      const cv::Mat value = picture.Evaluate({j / 27.0, 1e-7, 1}, {i / 33.0, 1e-7, 1}, {});
      EXPECT_NEAR(value.at<double>(0, 0), samples.at<double>(i, j), 1e-9);
    }
  }
}

TEST(PeriodicPictureTest, CosineKeepsItsFormWithTheAmplitudeOfTheTransfer) {
  constexpr int kCount = 48;
  cv::Mat samples(kCount, kCount, CV_64F);
  for (int i = 0; i < kCount; ++i) {
    for (int j = 0; j < kCount; ++j) {
      samples.at<double>(i, j) = 1 + 0.5 * std::cos(2 * kPi * (5.0 * j + 2.0 * i) / kCount);
    }
  }
  const PeriodicPicture picture(samples);
  const double step = 1 / 31.7;
  const cv::Mat frame =
      picture.Evaluate({0.1, step, 40}, {0.2, step, 30}, {kFloorPx, Psf::kGaussian, 1.1});
  const double amplitude = 0.5 * GaussianOracle(std::hypot(kFloorPx, 1.1), 29 * step * step) *
                           BoxOracle(5 * step) * BoxOracle(2 * step);
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 40; ++j) {
      const double phase = 2 * kPi * (5 * (0.1 + j * step) + 2 * (0.2 + i * step));
      EXPECT_NEAR(frame.at<double>(i, j), 1 + amplitude * std::cos(phase), 1e-10);
    }
  }
}

// ---------------------------------------------------------------------------------------- edges

// The edge spread by adding up: over the disc's projection, and over the pixel's area with three
// Gauss-Legendre nodes in each tenth of its sides.
double EdgeOracle(double angle_rad, double sigma, double radius, double distance) {
  constexpr int kParts = 10;
  const double nodes[] = {-std::sqrt(0.6) / 2, 0, std::sqrt(0.6) / 2};
  const double weights[] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  std::vector<std::pair<double, double>> side;  // place and weight
  for (int i = 0; i < kParts; ++i) {
    for (int k = 0; k < 3; ++k) {
      side.emplace_back((i + 0.5 + nodes[k]) / kParts - 0.5, weights[k] / kParts);
    }
  }
  const int disc_steps = radius > 0 ? 200 : 1;
  double sum = 0;
  for (int k = 0; k < disc_steps; ++k) {
    const double phi = kPi * ((k + 0.5) / disc_steps - 0.5);
    const double weight = radius > 0 ? 2 * std::pow(std::cos(phi), 2) / disc_steps : 1;
    const double shifted = distance + (radius > 0 ? radius * std::sin(phi) : 0);
    for (const auto& [x, x_weight] : side) {
      for (const auto& [y, y_weight] : side) {
        const double d = shifted + x * std::cos(angle_rad) + y * std::sin(angle_rad);
        sum += weight * x_weight * y_weight * std::erfc(-d / sigma / std::sqrt(2.0)) / 2;
      }
    }
  }
  return sum;
}

TEST(EdgeSpreadTest, EqualsTheConvolutionAddedUp) {
  struct Case {
    double sigma, radius;
  };
  for (const Case& c : {Case{0.5, 0}, Case{3, 0}, Case{0.5, 0.3}, Case{0.7, 6}, Case{1.5, 18}}) {
    for (const double angle_deg : {0.0, 5.0, -31.0, 45.0, 90.0}) {
      const double angle_rad = angle_deg * kPi / 180;
      const EdgeSpread edge(angle_rad, c.sigma, c.radius);
      for (const double d : {0.0, 0.31, -0.9, 0.6 * c.radius, -c.radius - 0.4}) {
        EXPECT_NEAR(edge.At(d), EdgeOracle(angle_rad, c.sigma, c.radius, d), 2e-8)
            << "angle " << angle_deg << " sigma " << c.sigma << " R " << c.radius << " d " << d;
      }
    }
  }
}

TEST(EdgeSpreadTest, WithoutBlurItIsTheAreaOfThePixelBehindTheEdge) {
  const EdgeSpread upright(0, 0, 0);
  for (const double d : {-0.7, -0.5, -0.2, 0.0, 0.3, 0.49, 0.8}) {
    EXPECT_NEAR(upright.At(d), std::clamp(d + 0.5, 0.0, 1.0), 3e-6) << d;
  }
  const EdgeSpread diagonal(kPi / 4, 0, 0);
  for (const double d : {0.0, 0.1, 0.3, 0.6, 0.7}) {
    const double cut_off = 1 / std::sqrt(2.0) - d;  // height of the corner beyond the edge
    EXPECT_NEAR(diagonal.At(d), 1 - cut_off * cut_off, 1e-9) << d;
    EXPECT_NEAR(diagonal.At(-d), cut_off * cut_off, 1e-9) << d;
  }
}

TEST(EdgeSpreadTest, DiscAloneIsTheLimitOfASmallGaussian) {
  // The two roads: closed form without a Gaussian, Fourier series with one.
  for (const double angle_rad : {0.0, 0.1, 0.7}) {
    const EdgeSpread closed(angle_rad, 0, 5);
    const EdgeSpread series(angle_rad, 0.004, 5);
    for (double d = -6; d <= 6; d += 0.137) {
      // A variance of 1.6e-5 times half the largest curvature, which is near the disc's rim.
      EXPECT_NEAR(closed.At(d), series.At(d), 2e-6) << angle_rad << " " << d;
    }
  }
}

TEST(EdgeSpreadTest, RisesFromZeroToOneAndIsAntisymmetric) {
  for (const double radius : {0.0, 4.0}) {
    const EdgeSpread edge(0.09, 0.6, radius);
    double before = 0;
    for (double d = -edge.reach_px() - 1; d <= edge.reach_px() + 1; d += 0.01) {
      EXPECT_GE(edge.At(d), before - 1e-8);
      EXPECT_NEAR(edge.At(d) + edge.At(-d), 1, 1e-8);
      before = edge.At(d);
    }
    EXPECT_EQ(edge.At(-1e6), 0);
    EXPECT_EQ(edge.At(1e6), 1);
  }
}

// Place, px, and variance, px^2, of the line spread of the edge that the middle row crosses.
// Differences of neighbouring pixels are the line spread behind one more box of a pixel.
Moments LineSpread(const LinearPicture& picture) {
  const int y = picture.height_px / 2;
  double mass = 0, first = 0, second = 0;
  for (int x = 0; x + 1 < picture.width_px; ++x) {
    const double difference = static_cast<double>(picture.at(x + 1, y, 0)) - picture.at(x, y, 0);
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
  const LinearPicture picture = SweepSimulator(options, {}).RenderNoiseless(0);
  EXPECT_NEAR(picture.at(0, 40, 0), 0.2, 1e-6);
  EXPECT_NEAR(picture.at(100, 40, 0), 0.6, 1e-6);
  EXPECT_NEAR(picture.at(50, 40, 0), 0.4, 1e-6);
  // 10 degrees from the vertical: 30 rows up it stands 30 tan 10 px = 5.29 px further right.
  EXPECT_LT(picture.at(55, 10, 0), 0.4);
  EXPECT_GT(picture.at(56, 10, 0), 0.4);
  EXPECT_LT(picture.at(44, 70, 0), 0.4);
  EXPECT_GT(picture.at(45, 70, 0), 0.4);
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

// The Fourier component of a picture at a frequency in cycles per px, behind a window that falls to
// 0 at the borders and has the sum 1.
std::complex<double> Component(const LinearPicture& picture, double fx, double fy) {
  std::complex<double> sum = 0;
  double weights = 0;
  for (int y = 0; y < picture.height_px; ++y) {
    for (int x = 0; x < picture.width_px; ++x) {
      const double w = std::pow(std::sin(kPi * (x + 0.5) / picture.width_px) *
                                    std::sin(kPi * (y + 0.5) / picture.height_px),
                                4);
      weights += w;
      sum += w * static_cast<double>(picture.at(x, y, 0)) *
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
      const LinearPicture picture = simulator.RenderNoiseless(i);
      const double f = PixelOnTargetMm(depth_mm) / (2 * kSquareMm);
      const double sigma = DefocusSigmaPx(depth_mm);
      const double defocused = psf == Psf::kDisc ? DiscOracle(2 * sigma, f * std::sqrt(2.0))
                                                 : GaussianOracle(sigma, 2 * f * f);
      // Two square waves multiplied: amplitude (2/pi)^2 of each of the four components.
      const double expected = options.light_level * options.target.contrast * 4 / (kPi * kPi) *
                              GaussianOracle(kFloorPx, 2 * f * f) * defocused *
                              std::pow(BoxOracle(f), 2);
      const double found = std::abs(Component(picture, f, f));
      // The target is drawn by the mean light of its samples' cells, half a px of the nearest
      // frame.
      EXPECT_NEAR(found, std::abs(expected), 4e-3 * std::abs(expected))
          << PsfName(psf) << " at " << depth_mm;
      if (sigma < 3) {
        EXPECT_GT(found, std::abs(Component(picture, 1.02 * f, f)));
        EXPECT_GT(found, std::abs(Component(picture, 0.98 * f, f)));
      }
    }
  }
}

TEST(SweepSimulatorTest, PictureStandsUprightAndCovers) {
  // Four greys in four quarters, as the user's picture has them.
  LinearPicture quarters{64, 64, 1, {}};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      quarters.values.push_back(0.1f + (x < 32 ? 0.0f : 0.3f) + (y < 32 ? 0.0f : 0.15f));
    }
  }
  SweepSimulationOptions options = StillOptions(96, 96, kFocusMm);
  options.target.kind = TargetKind::kPicture;
  options.target.picture_path = "quarters";
  const LinearPicture picture = SweepSimulator(options, quarters).RenderNoiseless(0);
  const double scale = 0.5 / 0.325;  // mean light 0.5
  EXPECT_NEAR(picture.at(20, 20, 0), 0.1 * scale, 0.02);
  EXPECT_NEAR(picture.at(75, 20, 0), 0.4 * scale, 0.02);
  EXPECT_NEAR(picture.at(20, 75, 0), 0.25 * scale, 0.02);
  EXPECT_NEAR(picture.at(75, 75, 0), 0.55 * scale, 0.02);
}

TEST(SweepSimulatorTest, BlurKeepsTheLightAndTheLampFallsAsTheSquare) {
  SweepSimulationOptions options = UniformOptions(24, 18, 285);
  options.step_mm = 5;
  options.frame_count = 7;
  options.light_level = 0.3;
  const SweepSimulator steady(options, UniformPicture());
  options.lamp_falloff = true;
  const SweepSimulator falling(options, UniformPicture());
  for (int i = 0; i < 7; ++i) {
    const double falloff = std::pow(kFocusMm / (285 + 5 * i), 2);
    const LinearPicture even = steady.RenderNoiseless(i);
    const LinearPicture lamp = falling.RenderNoiseless(i);
    for (std::size_t k = 0; k < even.values.size(); ++k) {
      EXPECT_NEAR(even.values[k], 0.3, 1e-6);
      EXPECT_NEAR(lamp.values[k], 0.3 * falloff, 1e-6);
    }
  }
}

TargetTile Tile(TargetKind kind, double contrast, double feature_size_mm) {
  TargetOptions options;
  options.kind = kind;
  options.contrast = contrast;
  options.feature_size_mm = feature_size_mm;
  TileRequest request;
  request.width_mm = 12;
  request.height_mm = 9;
  request.spacing_mm = 0.02;
  request.pixel_mm = 0.04;
  request.field_mm = 8;
  RandomDraws draws(3, RandomDraws::Purpose::kTexture, 0);
  return DrawTargetTile(options, request, UniformPicture(), &draws);
}

TEST(SweepTargetTest, EveryTextureHasTheMeanOneAndNoNegativeLight) {
  for (const TargetKind kind :
       {TargetKind::kDeadLeaves, TargetKind::kPinkNoise, TargetKind::kWhiteNoise,
        TargetKind::kCheckerboard, TargetKind::kSiemensStar, TargetKind::kPicture}) {
    const TargetTile tile = Tile(kind, 0.6, 0);
    EXPECT_NEAR(cv::mean(tile.samples)[0], 1, 1e-12) << TargetKindName(kind);
    double low, high;
    cv::minMaxLoc(tile.samples, &low, &high);
    EXPECT_GE(low, 0) << TargetKindName(kind);
    EXPECT_LE(high, 2.1) << TargetKindName(kind);
    EXPECT_GE(tile.width_mm, 12 - 1e-9);
    EXPECT_GE(tile.height_mm, 9 - 1e-9);
    if (kind != TargetKind::kPicture) {
      EXPECT_GT(high - low, 0.5) << TargetKindName(kind);
    }
  }
}

TEST(SweepTargetTest, DeadLeavesHaveEveryGreyOfTheContrast) {
  const TargetTile tile = Tile(TargetKind::kDeadLeaves, 0.6, 0);
  // Uniform greys in [0.4, 1.6]: standard deviation 1.2/sqrt(12); the count of leaves is large but
  // the large ones weigh most.
  cv::Scalar mean, deviation;
  cv::meanStdDev(tile.samples, mean, deviation);
  EXPECT_NEAR(deviation[0], 1.2 / std::sqrt(12.0), 0.05);
}

// Mean power of the tile's spectrum in a ring of frequencies, cycles per mm.
double RingPower(const TargetTile& tile, double from, double to) {
  const PeriodicPicture picture(tile.samples);
  double sum = 0;
  int count = 0;
  for (int b = 0; b <= picture.max_y_frequency(); ++b) {
    for (int a = -picture.max_x_frequency(); a <= picture.max_x_frequency(); ++a) {
      const double f = std::hypot(a / tile.width_mm, b / tile.height_mm);
      if (f < from || f > to) continue;
      sum += std::norm(picture.Coefficient(a, b));
      ++count;
    }
  }
  return sum / count;
}

TEST(SweepTargetTest, NoiseHasItsSpectrum) {
  // A small contrast, so that the soft limits do not bend the spectrum. Shortest period 0.1 mm.
  const TargetTile pink = Tile(TargetKind::kPinkNoise, 0.05, 0.1);
  const TargetTile white = Tile(TargetKind::kWhiteNoise, 0.05, 0.1);
  EXPECT_NEAR(RingPower(pink, 1.9, 2.1) / RingPower(pink, 7.9, 8.1), 16, 3);
  EXPECT_NEAR(RingPower(white, 1.9, 2.1) / RingPower(white, 7.9, 8.1), 1, 0.2);
  EXPECT_LT(RingPower(white, 11, 20), 1e-3 * RingPower(white, 5, 9));
  cv::Scalar mean, deviation;
  cv::meanStdDev(white.samples, mean, deviation);
  EXPECT_NEAR(deviation[0], 0.025, 0.0002);
}

TEST(SweepTargetTest, SiemensStarTurnsIntoItself) {
  // 36 cycles: half a turn changes nothing, a quarter neither.
  const TargetTile tile = Tile(TargetKind::kSiemensStar, 0.8, 0);
  const PeriodicPicture picture(tile.samples);
  const auto at = [&](double x_mm, double y_mm) {
    return picture
        .Evaluate({x_mm / tile.width_mm + 0.5, 1e-3, 1}, {y_mm / tile.height_mm + 0.5, 1e-3, 1},
                  {3, Psf::kGaussian, 0})
        .at<double>(0, 0);
  };
  for (const double angle : {0.02, 0.3, 1.1}) {
    const double x = 2.5 * std::cos(angle), y = 2.5 * std::sin(angle);
    EXPECT_NEAR(at(x, y), at(-x, -y), 0.01);
    const double turned = angle + 2 * kPi / 36;
    EXPECT_NEAR(at(x, y), at(2.5 * std::cos(turned), 2.5 * std::sin(turned)), 0.02);
    const double opposite = angle + kPi / 36;
    EXPECT_NEAR(at(x, y) + at(2.5 * std::cos(opposite), 2.5 * std::sin(opposite)), 2, 0.05);
  }
}

TEST(SweepTargetTest, RefusesFeaturesThatTheTileCannotShow) {
  for (const TargetKind kind : {TargetKind::kDeadLeaves, TargetKind::kWhiteNoise,
                                TargetKind::kCheckerboard, TargetKind::kSiemensStar}) {
    EXPECT_THROW(Tile(kind, 0.6, 0.001), Error) << TargetKindName(kind);
    EXPECT_THROW(Tile(kind, 0.6, 1000), Error) << TargetKindName(kind);
  }
}

TEST(SweepTargetTest, LargeFieldsAreDrawnCoarser) {
  TargetOptions options;
  TileRequest request;
  request.width_mm = 100;  // 100000 samples wanted
  request.height_mm = 2;
  request.spacing_mm = 0.001;
  request.pixel_mm = 0.002;
  request.field_mm = 2;
  RandomDraws draws(3, RandomDraws::Purpose::kTexture, 0);
  const TargetTile tile = DrawTargetTile(options, request, {}, &draws);
  EXPECT_EQ(tile.samples.cols, 4096);
  EXPECT_NEAR(tile.width_mm, 100, 1e-9);
  EXPECT_GE(tile.height_mm, 2);
  EXPECT_NEAR(tile.height_mm / tile.samples.rows, tile.width_mm / tile.samples.cols, 1e-12);
}

// ---------------------------------------------------------------------------------------- noise

TEST(RandomDrawsTest, PoissonFollowsItsDistribution) {
  for (const double mean : {0.3, 4.0, 9.9, 10.1, 45.0, 700.0}) {
    RandomDraws draws(11, RandomDraws::Purpose::kSensor, 5);
    constexpr int kDraws = 200000;
    const int size = static_cast<int>(mean + 10 * std::sqrt(mean) + 20);
    std::vector<double> seen(static_cast<std::size_t>(size));
    for (int i = 0; i < kDraws; ++i) {
      const double k = draws.Poisson(mean);
      ASSERT_EQ(k, std::floor(k));
      ASSERT_GE(k, 0);
      ++seen[static_cast<std::size_t>(std::min<double>(k, size - 1))];
    }
    // Chi-square over the counts with at least 20 expected, the rest in one class.
    double chi2 = 0, rest_seen = kDraws, rest_expected = kDraws;
    int classes = 0;
    for (int k = 0; k < size; ++k) {
      const double expected = kDraws * std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.0));
      if (expected < 20) continue;
      const double found = seen[static_cast<std::size_t>(k)];
      chi2 += std::pow(found - expected, 2) / expected;
      rest_seen -= found;
      rest_expected -= expected;
      ++classes;
    }
    if (rest_expected > 5) chi2 += std::pow(rest_seen - rest_expected, 2) / rest_expected;
    EXPECT_LT(chi2, classes + 4.5 * std::sqrt(2.0 * classes) + 5) << "mean " << mean;
    EXPECT_GT(chi2, classes - 4.5 * std::sqrt(2.0 * classes) - 5) << "mean " << mean;
  }
  RandomDraws draws(11, RandomDraws::Purpose::kSensor, 5);
  EXPECT_EQ(draws.Poisson(0), 0);
  EXPECT_EQ(draws.Poisson(-1), 0);
}

TEST(RandomDrawsTest, NormalHasItsMomentsAndTails) {
  RandomDraws draws(12, RandomDraws::Purpose::kSensor, 0);
  std::vector<double> values(200000);
  for (double& value : values) value = draws.Normal();
  ExpectMoments(values, 0, 1);
  double fourth = 0;
  int beyond_two = 0;
  for (const double value : values) {
    fourth += std::pow(value, 4) / 200000;
    beyond_two += std::abs(value) > 2;
  }
  EXPECT_NEAR(fourth, 3, 4.5 * std::sqrt(96.0 / 200000));
  EXPECT_NEAR(beyond_two / 200000.0, 0.0455, 0.0021);
}

TEST(SweepSimulatorTest, ShotAndReadNoiseHaveTheirVariances) {
  for (const double level : {0.02, 0.5}) {
    for (const double read : {0.0, 12.0}) {
      SweepSimulationOptions options = UniformOptions(256, 256, kFocusMm);
      options.light_level = level;
      options.full_well_electrons = 10000;
      options.read_noise_electrons = read;
      options.bits = 16;
      const StoredPicture frame = SweepSimulator(options, UniformPicture()).RenderFrame(0);
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
  const SweepSimulator simulator(options, UniformPicture());
  const StoredPicture first = simulator.RenderFrame(0);
  const StoredPicture second = simulator.RenderFrame(1);
  const auto deviation = [](const StoredPicture& frame, std::size_t i) {
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
    const LinearPicture light = simulator.RenderNoiseless(0);
    const StoredPicture stored = simulator.RenderFrame(0);
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
    const SweepSimulator simulator(options, UniformPicture());
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
  const SweepSimulator simulator(UniformOptions(4, 4, 290), UniformPicture());
  EXPECT_DOUBLE_EQ(simulator.truth().image_distance_mm, kImageMm);
  EXPECT_NEAR(simulator.truth().focus_depth_mm, kFocusMm, 1e-9);
  EXPECT_EQ(simulator.truth().blur_ratio, kRatio);
  EXPECT_EQ(simulator.truth().blur_floor_px, kFloorPx);
}

TEST(SweepSimulatorTest, FlickerHasItsDeviation) {
  SweepSimulationOptions options = UniformOptions(2, 2, kFocusMm);
  options.frame_count = 1500;
  options.flicker = 0.05;
  const SweepSimulator simulator(options, UniformPicture());
  std::vector<double> levels;
  for (int i = 0; i < 1500; ++i) levels.push_back(simulator.RenderNoiseless(i).values[0]);
  ExpectMoments(levels, 0.5, std::pow(0.5 * 0.05, 2));
}

TEST(SweepSimulatorTest, DriftHasItsDeviationOnBothAxesAndScalesWithThePicture) {
  // An upright edge shows the drift to the right, a level one the drift down: its bright side is
  // below, so that the picture's middle column read downward is the row of the upright one.
  std::vector<double> right, down;
  for (const double angle_deg : {0.0, 90.0}) {
    SweepSimulationOptions options = StillOptions(33, 33, kFocusMm);
    options.target.kind = TargetKind::kKnifeEdge;
    options.target.edge_angle_deg = angle_deg;
    options.drift_sigma_px = 1.5;
    options.frame_count = 800;
    const SweepSimulator simulator(options, {});
    for (int i = 0; i < options.frame_count; ++i) {
      LinearPicture picture = simulator.RenderNoiseless(i);
      if (angle_deg == 90) {
        LinearPicture turned = picture;
        for (int y = 0; y < 33; ++y) {
          for (int x = 0; x < 33; ++x) {
            turned.values[static_cast<std::size_t>(y * 33 + x)] = picture.at(y, x, 0);
          }
        }
        picture = turned;
      }
      (angle_deg == 0 ? right : down).push_back(LineSpread(picture).mean - 16);
    }
  }
  ExpectMoments(right, 0, 1.5 * 1.5);
  ExpectMoments(down, 0, 1.5 * 1.5);
  double product = 0;
  for (std::size_t i = 0; i < right.size(); ++i) product += right[i] * down[i] / 800;
  EXPECT_NEAR(product, 0, 4.5 * 2.25 / std::sqrt(800.0));

  // The same displacement on the target looks smaller from farther.
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
  const LinearPicture still = SweepSimulator(options, {}).RenderNoiseless(0);
  options.drift_sigma_px = 1.5;
  const LinearPicture moved = SweepSimulator(options, {}).RenderNoiseless(0);
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
  std::vector<StoredPicture> backward(9), parallel(9);
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
  const LinearPicture a = plain.RenderNoiseless(0), b = more.RenderNoiseless(0);
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
    const char* told;
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
    EXPECT_FALSE(options.IsValid(&why)) << c.told;
    EXPECT_THAT(why, HasSubstr(c.told));
    EXPECT_THROW(SweepSimulator(options, {}), Error) << c.told;
  }
}

TEST(SweepSimulatorTest, RefusesFramesAndPicturesThatAreNotThere) {
  const SweepSimulator simulator(UniformOptions(4, 4, kFocusMm), UniformPicture());
  EXPECT_THROW(simulator.RenderNoiseless(1), Error);
  EXPECT_THROW(simulator.RenderFrame(-1), Error);
  EXPECT_THROW(SweepSimulator(UniformOptions(4, 4, kFocusMm), {}), Error);
  const LinearPicture black{2, 2, 1, std::vector<float>(4, 0.0f)};
  EXPECT_THROW(SweepSimulator(UniformOptions(4, 4, kFocusMm), black), Error);
}

// ----------------------------------------------------------------------------------------- file

class SweepSimulationFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) /
              (std::string("sweep_simulation_") + test->name());
    std::filesystem::create_directories(folder_);
    WriteFileAtomically((folder_ / "camera.yaml").string(),
                        "schema: thicklens/camera/2\n"
                        "name: macro\n"
                        "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, "
                        "lens_thickness_mm: 0, aperture_radius_mm: 9}\n"
                        "sensor: {width_px: 640, height_px: 481, pixel_pitch_mm: 0.0045, "
                        "principal_point_px: [319.5, 240], transfer: srgb}\n"
                        "psf: disc\n");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  SweepSimulationOptions Read(const std::string& text) const {
    const std::string path = (folder_ / "sweep.yaml").string();
    WriteFileAtomically(path, text);
    return ReadSweepSimulation(path);
  }

  std::string MessageOf(const std::string& text) const {
    try {
      Read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

const char kHead[] =
    "schema: thicklens/simulate-sweep/1\n"
    "camera: camera.yaml\n";
const char kTruth[] = "truth: {focus_depth_mm: 300, blur_ratio: 0.4, blur_floor_px: 0.6}\n";
const char kTarget[] = "target: {kind: dead-leaves}\n";
const char kBench[] = "bench: {first_depth_mm: 290, step_mm: 1, frames: 21}\n";

TEST_F(SweepSimulationFileTest, ReadsEveryField) {
  const SweepSimulationOptions options =
      Read(std::string(kHead) + kTruth +
           "size_px: [400, 301]\n"
           "target: {kind: picture, picture: scene.png, contrast: 0.7, feature_size_mm: 3,\n"
           "         edge_angle_deg: -4, ink_sigma_mm: 0.02}\n"
           "bench: {first_depth_mm: 310, step_mm: -1.5, frames: 12, offset_mm: 106.5,\n"
           "        direction: toward, reading_sigma_mm: 0.07}\n"
           "light: {level: 0.4, lamp_falloff: false, flicker: 0.02}\n"
           "drift_sigma_px: 1.25\n"
           "noise: {full_well_electrons: 9000, read_noise_electrons: 5}\n"
           "bits: 16\n"
           "seed: 77\n");
  EXPECT_NEAR(options.camera.image_distance_mm(), 60, 1e-12);
  EXPECT_EQ(options.camera.blur_ratio(), 0.4);
  EXPECT_EQ(options.camera.calibration->blur_floor_px->value, 0.6);
  EXPECT_EQ(options.camera.psf, Psf::kDisc);
  EXPECT_EQ(options.camera.sensor.width_px, 400);
  EXPECT_EQ(options.camera.sensor.height_px, 301);
  EXPECT_EQ(options.camera.sensor.principal_point_px.x(), 199.5);
  EXPECT_EQ(options.camera.sensor.principal_point_px.y(), 150);
  EXPECT_EQ(options.target.kind, TargetKind::kPicture);
  EXPECT_EQ(options.target.picture_path, (folder_ / "scene.png").string());
  EXPECT_EQ(options.target.contrast, 0.7);
  EXPECT_EQ(options.target.feature_size_mm, 3);
  EXPECT_EQ(options.target.edge_angle_deg, -4);
  EXPECT_EQ(options.target.ink_sigma_mm, 0.02);
  EXPECT_EQ(options.first_depth_mm, 310);
  EXPECT_EQ(options.step_mm, -1.5);
  EXPECT_EQ(options.frame_count, 12);
  EXPECT_EQ(options.bench_offset_mm, 106.5);
  EXPECT_EQ(options.direction, BenchDirection::kToward);
  EXPECT_EQ(options.reading_sigma_mm, 0.07);
  EXPECT_EQ(options.light_level, 0.4);
  EXPECT_FALSE(options.lamp_falloff);
  EXPECT_EQ(options.flicker, 0.02);
  EXPECT_EQ(options.drift_sigma_px, 1.25);
  EXPECT_EQ(options.full_well_electrons, 9000);
  EXPECT_EQ(options.read_noise_electrons, 5);
  EXPECT_EQ(options.bits, 16);
  EXPECT_EQ(options.seed, 77u);
}

TEST_F(SweepSimulationFileTest, WhatIsLeftOutHasTheDefaultsOfTheOptions) {
  const SweepSimulationOptions options = Read(std::string(kHead) + kTruth + kTarget + kBench);
  const SweepSimulationOptions defaults;
  EXPECT_EQ(options.camera.sensor.width_px, 640);
  EXPECT_EQ(options.target.contrast, defaults.target.contrast);
  EXPECT_EQ(options.light_level, defaults.light_level);
  EXPECT_EQ(options.lamp_falloff, defaults.lamp_falloff);
  EXPECT_EQ(options.full_well_electrons, 0);
  EXPECT_EQ(options.bits, 8);
  EXPECT_EQ(options.seed, 1u);
  EXPECT_EQ(options.direction, BenchDirection::kAway);
}

TEST_F(SweepSimulationFileTest, ImageDistanceMayStandForTheFocusDepth) {
  const SweepSimulationOptions options = Read(
      std::string(kHead) + "truth: {image_distance_mm: 60, blur_ratio: 0.4, blur_floor_px: 0.6}\n" +
      kTarget + kBench);
  EXPECT_NEAR(options.camera.focus_depth_mm(), 300, 1e-9);
}

TEST_F(SweepSimulationFileTest, EveryKindOfTargetHasItsName) {
  const std::pair<const char*, TargetKind> kinds[] = {
      {"dead-leaves", TargetKind::kDeadLeaves},   {"pink-noise", TargetKind::kPinkNoise},
      {"white-noise", TargetKind::kWhiteNoise},   {"checkerboard", TargetKind::kCheckerboard},
      {"siemens-star", TargetKind::kSiemensStar}, {"printed-edge", TargetKind::kPrintedEdge},
      {"knife-edge", TargetKind::kKnifeEdge}};
  for (const auto& [name, kind] : kinds) {
    const auto options =
        Read(std::string(kHead) + kTruth + "target: {kind: " + name + "}\n" + kBench);
    EXPECT_EQ(options.target.kind, kind);
    EXPECT_EQ(TargetKindName(kind), name);
  }
}

TEST_F(SweepSimulationFileTest, TellsWhatIsWrongAndWhere) {
  const std::string head = kHead;
  const std::string rest = std::string(kTarget) + kBench;
  const std::pair<std::string, const char*> cases[] = {
      {"schema: thicklens/sweep/1\n", "thicklens/simulate-sweep/1"},
      {head + kTruth + rest + "sed: 3\n", "sweep.yaml:6:1: unknown key 'sed'; did you mean 'seed'"},
      {head + kTruth + kTarget + "bench: {first_depth_cm: 29, step_mm: 1, frames: 3}\n",
       "wrong unit: this field is 'first_depth_mm'"},
      {head + kTruth + kBench, "'target' is missing"},
      {head + kTruth + kTarget, "'bench' is missing"},
      {head + rest, "image_distance_mm is missing: a simulation needs it as the truth"},
      {head + "truth: {focus_depth_mm: 300, blur_ratio: 0.4}\n" + rest, "blur_floor_px is missing"},
      {head + "truth: {focus_depth_mm: 300, image_distance_mm: 60}\n" + rest,
       "truth.image_distance_mm: focus_depth_mm says the same"},
      {head + "truth: {focus_depth_mm: 30, blur_ratio: 0.4, blur_floor_px: 0}\n" + rest,
       "truth.focus_depth_mm: must be above the lens's front_focal_length_mm 50, found 30"},
      {head + kTruth + "size_px: [641, 10]\n" + rest, "from 1 to 640"},
      {head + kTruth + "size_px: [10]\n" + rest, "a list of 2"},
      {head + kTruth + "target: {kind: leaves}\n" + kBench, "dead-leaves"},
      {head + kTruth + "target: {kind: picture}\n" + kBench, "needs the picture's path"},
      {head + kTruth + "target: {kind: knife-edge, picture: a.png}\n" + kBench,
       "only a target of the kind 'picture'"},
      {head + kTruth + rest + "noise: {read_noise_electrons: 3}\n", "needs noise.full_well"},
      {head + kTruth + rest + "bits: 12\n", "bits is 12: it must be 8 or 16"},
      {head + kTruth + rest + "light: {lamp_falloff: 1}\n", "true, false"},
  };
  for (const auto& [text, told] : cases) {
    EXPECT_THAT(MessageOf(text), HasSubstr(told)) << text;
    EXPECT_EQ(MessageOf(text).find('\n'), std::string::npos);
  }
}

TEST(ShippedSweepsTest, AllCanBeReadAndStarted) {
  const auto folder = std::filesystem::path(THICKLENS_SOURCE_DIR) / "configs" / "sweeps";
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".yaml") continue;
    SweepSimulationOptions options = ReadSweepSimulation(entry.path().string());
    // The brightest leaf of every frame stays below full scale.
    const double near_mm =
        std::min(options.first_depth_mm,
                 options.first_depth_mm + (options.frame_count - 1) * options.step_mm);
    EXPECT_LT(options.light_level * (1 + options.target.contrast) *
                  std::pow(options.camera.focus_depth_mm() / near_mm, 2),
              0.95)
        << entry.path();
    options.camera.sensor.width_px = 16;
    options.camera.sensor.height_px = 12;
    EXPECT_EQ(SweepSimulator(options, {}).truth().frames.size(),
              static_cast<std::size_t>(options.frame_count));
    ++count;
  }
  EXPECT_GE(count, 6);
}

}  // namespace
}  // namespace thicklens::model
