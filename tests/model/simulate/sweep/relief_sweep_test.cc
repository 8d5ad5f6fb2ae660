#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "model/simulate/sweep/relief_image.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

// A small bench without noise, whose target is even or has dead leaves.
SweepSimulationOptions Bench(TargetKind kind) {
  SweepSimulationOptions options =
      ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/demo.yaml");
  options.camera.sensor.width_px = 120;
  options.camera.sensor.height_px = 90;
  options.camera.sensor.principal_point_px = {59.5, 44.5};
  options.target.kind = kind;
  options.frame_count = 9;
  options.step_mm = 2;
  options.first_depth_mm = 292;
  options.reading_sigma_mm = options.drift_sigma_px = options.flicker = 0;
  options.full_well_electrons = options.read_noise_electrons = 0;
  options.bits = 16;
  return options;
}

double LargestDifference(const LinearImage& a, const LinearImage& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i)
    largest = std::max(
        largest, std::abs(static_cast<double>(a.values[i]) - static_cast<double>(b.values[i])));
  return largest;
}

ReliefPartOptions Part(double size_mm, double height_mm) {
  ReliefPartOptions part;
  part.size_mm = {size_mm, size_mm};
  part.height_mm = height_mm;
  return part;
}

// A part that covers the whole field is a target that stands nearer.
TEST(ReliefSweep, APartThatCoversTheFieldIsANearerTarget) {
  SweepSimulationOptions with = Bench(TargetKind::kDeadLeaves);
  with.target.relief = {Part(100, 2)};
  SweepSimulationOptions nearer = Bench(TargetKind::kDeadLeaves);
  const SweepSimulator relief(with, {}), flat(nearer, {});
  for (const int frame : {1, 4, 8}) {
    // The part of frame i stands where the target of frame i - 1 does. The lamp's light there is
    // that of its own depth in both.
    EXPECT_LT(LargestDifference(relief.RenderNoiseless(frame), flat.RenderNoiseless(frame - 1)),
              2e-4)
        << frame;
  }
  EXPECT_THAT(relief.truth().relief_mm, ::testing::ElementsAre(2.0));
}

// A part far from the middle leaves the middle as it was.
TEST(ReliefSweep, FarFromThePartTheTargetIsAsItWas) {
  SweepSimulationOptions with = Bench(TargetKind::kDeadLeaves);
  with.target.relief = {Part(0.6, 3)};
  with.target.relief[0].centre_mm = {1.5, 0};
  const SweepSimulator relief(with, {}), flat(Bench(TargetKind::kDeadLeaves), {});
  const LinearImage a = relief.RenderNoiseless(7), b = flat.RenderNoiseless(7);
  double left = 0, right = 0;
  for (int y = 0; y < a.height_px; ++y) {
    for (int x = 0; x < a.width_px; ++x) {
      const auto i = static_cast<std::size_t>(y * a.width_px + x);
      double& side = x < 50 ? left : right;
      side = std::max(
          side, std::abs(static_cast<double>(a.values[i]) - static_cast<double>(b.values[i])));
    }
  }
  EXPECT_LT(left, 1e-4);
  EXPECT_GT(right, 0.02);
}

// The mean over the aperture, position by position: the plain sum that the image replaces. The
// target is a slanted wave, the part an even half plane.
TEST(ReliefSweep, AStepHidesThePartOfTheApertureThatItStandsIn) {
  constexpr int kSide = 96;
  constexpr double kStepPx = 0.5, kPartPx = 1.2, kTargetPx = -2.0;
  ReliefLayer target, part;
  target.light = cv::Mat(kSide, kSide, CV_64F);
  part.light = cv::Mat(kSide, kSide, CV_64F, cv::Scalar(0.7));
  part.cover = cv::Mat::zeros(kSide, kSide, CV_64F);
  const auto wave = [](double x, double y) {
    return 1 + 0.6 * std::cos(2 * kPi * (3 * x + 2 * y) / kSide);
  };
  const auto cover = [](double x) { return 0.5 * std::erfc((std::abs(x - 48) - 20) / 2); };
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      target.light.at<double>(y, x) = wave(x, y);
      part.cover.at<double>(y, x) = cover(x);
    }
  }
  target.defocus_px = kTargetPx;
  part.defocus_px = kPartPx;
  const TransferOfDefocus transfer = [](double sigma_px, const Eigen::Vector2d& f) {
    return GaussianTransfer(sigma_px, f.x(), f.y());
  };
  target.blurred = Filtered(target.light, kStepPx, [&](const Eigen::Vector2d& f) {
    return transfer(std::abs(kTargetPx), f);
  });
  const cv::Mat image = ReliefImage(target, {part}, kStepPx, Psf::kGaussian, transfer);
  for (const int x : {20, 25, 28, 31, 48, 66, 68, 71}) {
    const int y = 40;
    double sum = 0, weights = 0;
    for (double ax = -5; ax <= 5; ax += 0.05) {
      for (double ay = -5; ay <= 5; ay += 0.1) {
        const double weight = std::exp(-(ax * ax + ay * ay) / 2);
        const double hidden = cover(x - kPartPx / kStepPx * ax);
        const double light = hidden * 0.7 + (1 - hidden) * wave(x - kTargetPx / kStepPx * ax,
                                                                y - kTargetPx / kStepPx * ay);
        sum += weight * light;
        weights += weight;
      }
    }
    EXPECT_NEAR(image.at<double>(y, x), sum / weights, 0.004) << x;
  }
}

TEST(ReliefSweep, ImpossiblePartsAreRefused) {
  const auto why_not = [](const SweepSimulationOptions& options) {
    std::string why;
    return options.IsValid(&why) ? std::string("valid") : why;
  };
  SweepSimulationOptions options = Bench(TargetKind::kDeadLeaves);
  options.target.relief = {Part(2, 0)};
  EXPECT_THAT(why_not(options), HasSubstr("height_mm is 0: it must be > 0"));
  options.target.relief = {Part(0, 1)};
  EXPECT_THAT(why_not(options), HasSubstr("size_mm is [0, 0]: both must be > 0"));
  options.target.relief = {Part(2, 1), Part(1, 2)};
  EXPECT_THAT(why_not(options), HasSubstr("parts 1 and 2 overlap"));
  options.target.relief = {Part(2, 1)};
  EXPECT_EQ(why_not(options), "valid");
  options.target.tilt_deg = 3;
  EXPECT_THAT(why_not(options), HasSubstr("target.relief is stated"));
}

// ---- kinds of targets ----

// A frame in focus, in linear light.
cv::Mat InFocus(SweepSimulationOptions options) {
  options.first_depth_mm = options.camera.focus_depth_mm();
  options.frame_count = 1;
  const SweepSimulator simulator(options, {});
  const LinearImage image = simulator.RenderNoiseless(0);
  cv::Mat light(image.height_px, image.width_px, CV_64F);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x)
      light.at<double>(y, x) =
          static_cast<double>(image.values[static_cast<std::size_t>(y * image.width_px + x)]);
  }
  return light;
}

// Four of nine parts of a mesh are open: the light is 1 + c there and 1 - c elsewhere, with mean
// 1 - c/9.
TEST(TargetKinds, AMeshHasWiresOfAThirdOfItsPeriod) {
  SweepSimulationOptions options = Bench(TargetKind::kMesh);
  options.target.contrast = 0.6;
  options.target.feature_size_mm = 0.9;  // 40 px
  const cv::Mat light = InFocus(options);
  double lowest = 0, highest = 0;
  cv::minMaxLoc(light, &lowest, &highest);
  EXPECT_NEAR(highest / lowest, (1 + 0.6) / (1 - 0.6), 0.35);
  const double mean = cv::mean(light(cv::Rect(0, 0, 120, 80)))[0];
  EXPECT_NEAR(highest / mean, (1 + 0.6) / (1 - 0.6 / 9), 0.15);
}

// The light of speckle has an exponential distribution: its standard deviation is its mean, which
// pixel and blur floor lower.
TEST(TargetKinds, GroundGlassShowsSpeckle) {
  SweepSimulationOptions options = Bench(TargetKind::kGroundGlass);
  options.target.contrast = 1;
  options.target.feature_size_mm = 0.2;  // 9 px: pixel and floor hardly matter
  const cv::Mat light = InFocus(options);
  cv::Scalar mean, deviation;
  cv::meanStdDev(light, mean, deviation);
  EXPECT_NEAR(deviation[0] / mean[0], 1, 0.15);
  const double below = static_cast<double>(cv::countNonZero(light < mean[0] * std::log(2.0))) /
                       static_cast<double>(light.total());
  EXPECT_NEAR(below, 0.5, 0.08) << "the median of an exponential distribution is ln 2 of its mean";
}

// The flux of a bright point is its area times the step of the light.
TEST(TargetKinds, PinholesHaveTheFluxOfTheirArea) {
  SweepSimulationOptions options = Bench(TargetKind::kPinholes);
  options.target.contrast = 0.9;
  options.target.feature_size_mm = 0.1;
  options.target.spacing_mm = 0.9;
  const cv::Mat light = InFocus(options);
  double ground = 0, highest = 0;
  cv::minMaxLoc(light, &ground, &highest);
  const double px_mm =
      options.camera.sensor.pixel_pitch_mm /
      std::abs(ChiefRayMagnification(options.camera.lens, options.camera.image_distance_mm(),
                                     options.camera.focus_depth_mm()));
  const double area_px = kPi * 0.05 * 0.05 / (px_mm * px_mm);
  const double share = area_px / std::pow(0.9 / px_mm, 2);
  const double step = 1.9 / 0.1 - 1;  // over the ground
  EXPECT_NEAR(cv::mean(light)[0] / ground - 1, share * step, 0.25 * share * step);
  options.target.kind = TargetKind::kBeads;
  const cv::Mat dark = InFocus(options);
  double lowest = 0, bright = 0;
  cv::minMaxLoc(dark, &lowest, &bright);
  EXPECT_LT(lowest, 0.6 * bright);
  EXPECT_GT(cv::mean(dark)[0], 0.95 * bright);
}

}  // namespace
}  // namespace thicklens::model
