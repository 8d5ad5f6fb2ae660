// Sweeps of an aberrated lens: the blur of each place and direction, and the displaced image.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <utility>

#include "model/base/random_draws.h"
#include "model/simulate/sweep/field_blur.h"
#include "support/test_cameras.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;

constexpr double kPi = 3.14159265358979323846;
constexpr double kFocusMm = 300;

cv::Mat RandomSamples(int width, int height) {
  RandomDraws draws(7, RandomDraws::Purpose::kTexture, 0);
  cv::Mat samples(height, width, CV_64F);
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) samples.at<double>(i, j) = 1 + 0.3 * draws.Normal();
  }
  return samples;
}

Eigen::Matrix2d Map(double xx, double xy, double yy) {
  Eigen::Matrix2d map;
  map << xx, xy, xy, yy;
  return map;
}

SweepSimulationOptions Sharp(TargetKind kind) {
  SweepSimulationOptions options;
  options.camera = TestCameraFocusedAt(kFocusMm, "aberrated", {50, 50, 0, 8.9},
                                       TestSensor(160, 120, 0.02, {79.5, 59.5}), {0.45, 0});
  options.camera.psf = Psf::kGaussian;
  options.camera.calibration->blur_floor_px = Estimate{0.5, 0};
  options.target.kind = kind;
  options.first_depth_mm = 292;
  options.step_mm = 8;
  options.frame_count = 3;
  options.lamp_falloff = false;
  options.effects.base = EffectSelectionOptions::Base::kGiven;
  options.effects.given = {Effect::kDefocus,  Effect::kLensFloor,   Effect::kMagnification,
                           Effect::kPixelBox, Effect::kAberrations, Effect::kDistortion};
  return options;
}

// Sigma of a step along x without the pixel box, from the distance of the places where 16 % and 84
// % of it are reached.
double SigmaOfEdge(const LinearImage& image, int row) {
  const auto value = [&](int x) {
    return static_cast<double>(image.values[static_cast<std::size_t>(row * image.width_px + x)]);
  };
  // Beside the edge: far from it, an even field is not quite even (FieldBlur).
  const double dark = value(image.width_px / 2 - 16), bright = value(image.width_px / 2 + 15);
  const auto place_of = [&](double part) {
    const double level = dark + part * (bright - dark);
    int x = 1;
    while (value(x) < level) ++x;
    // The inverse of the normal distribution makes the interpolation exact for a Gaussian.
    const auto quantile = [&](double light) {
      const double share = std::clamp((light - dark) / (bright - dark), 1e-9, 1 - 1e-9);
      double low = -7, high = 7;
      for (int i = 0; i < 60; ++i) {
        const double middle = (low + high) / 2;
        (std::erfc(-middle / std::sqrt(2.0)) / 2 < share ? low : high) = middle;
      }
      return low;
    };
    const double before = quantile(value(x - 1)), here = quantile(value(x));
    return x - (here - quantile(level)) / (here - before);
  };
  const double width = place_of(0.841344746) - place_of(0.158655254);
  return std::sqrt(width * width / 4 - 1.0 / 12);
}

// A Gaussian under a matrix M has the transfer function exp(-2 pi^2 |M f|^2), a disc that of its
// radius of 2 px at |M f|.
TEST(AberratedSweep, AWaveLosesWhatTheMapSays) {
  constexpr int kSide = 60;  // a size that the FFT likes
  constexpr double kStepPx = 0.5;
  const Eigen::Matrix2d map = Map(1.4, -0.8, 0.3);
  for (const auto& [a, b] : {std::pair{3, 0}, std::pair{0, 4}, std::pair{2, 3}, std::pair{-2, 3}}) {
    cv::Mat wave(kSide, kSide, CV_64F);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x)
        wave.at<double>(y, x) = 1 + 0.5 * std::cos(2 * kPi * (a * x + b * y) / kSide);
    }
    const Eigen::Vector2d f = Eigen::Vector2d(a, b) / (kSide * kStepPx);
    const double mapped = std::hypot(1.4 * f.x() - 0.8 * f.y(), -0.8 * f.x() + 0.3 * f.y());
    for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
      const cv::Mat blurred =
          Blurred(wave, kStepPx, {psf, nullptr, [&](const Eigen::Vector2d&) { return map; }, 0.5});
      const double transfer = psf == Psf::kGaussian
                                  ? std::exp(-2 * kPi * kPi * mapped * mapped)
                                  : std::cyl_bessel_j(1, 4 * kPi * mapped) / (2 * kPi * mapped);
      for (const auto& [x, y] : {std::pair{0, 0}, std::pair{17, 40}, std::pair{59, 33}}) {
        EXPECT_NEAR(blurred.at<double>(y, x),
                    1 + 0.5 * transfer * std::cos(2 * kPi * (a * x + b * y) / kSide), 1e-6)
            << a << ", " << b << " " << PsfName(psf);
      }
    }
  }
}

// Every point spreads its light by the Gaussian of its own place: the sum over all points.
TEST(AberratedSweep, EveryPointHasTheBlurOfItsPlace) {
  const cv::Mat sharp = RandomSamples(120, 90);
  constexpr double kStepPx = 0.5;
  const auto map = [](const Eigen::Vector2d& at) {
    const Eigen::Vector2d from_axis = at - Eigen::Vector2d(60, 40);
    const double rho2 = from_axis.squaredNorm() / 6000;
    const Eigen::Vector2d radial = from_axis.normalized();
    return Eigen::Matrix2d((2 - 1.2 * rho2) * Eigen::Matrix2d::Identity() +
                           0.9 * rho2 * radial * radial.transpose());
  };
  const cv::Mat blurred = Blurred(sharp, kStepPx, {Psf::kGaussian, nullptr, map, 0.5});
  double total = 0, before = 0;
  for (int y = 0; y < sharp.rows; ++y) {
    for (int x = 0; x < sharp.cols; ++x) {
      total += blurred.at<double>(y, x);
      before += sharp.at<double>(y, x);
    }
  }
  EXPECT_NEAR(total / before, 1, 1e-4) << "no light is lost";
  for (const auto& [x, y] : {std::pair{60, 40}, std::pair{33, 60}, std::pair{85, 30}}) {
    double sum = 0;
    for (int j = 0; j < sharp.rows; ++j) {
      for (int i = 0; i < sharp.cols; ++i) {
        const Eigen::Matrix2d m = map(Eigen::Vector2d(i, j));
        const Eigen::Vector2d d = kStepPx * Eigen::Vector2d(x - i, y - j);
        const double det = m(0, 0) * m(1, 1) - m(0, 1) * m(0, 1);
        const Eigen::Vector2d u((m(1, 1) * d.x() - m(0, 1) * d.y()) / det,
                                (-m(0, 1) * d.x() + m(0, 0) * d.y()) / det);
        sum += sharp.at<double>(j, i) * kStepPx * kStepPx * std::exp(-0.5 * u.squaredNorm()) /
               (2 * kPi * std::abs(det));
      }
    }
    EXPECT_NEAR(blurred.at<double>(y, x), sum, 2e-3) << x << ", " << y;
  }
}

// The blur across an edge is kappa r K/p (1/z - 1/z'), z' the focus of that place and direction.
TEST(AberratedSweep, AnEdgeHasTheBlurOfItsPlaceAndDirection) {
  SweepSimulationOptions options = Sharp(TargetKind::kKnifeEdge);
  options.target.edge_angle_deg = 0;
  options.first_depth_mm = 286;
  options.step_mm = 30;
  options.frame_count = 2;
  options.aberrations.field_curvature_mm = -6;
  options.aberrations.field_astigmatism_mm = 4;
  const SweepSimulator simulator(options, {});
  const double corner2 = 79.5 * 79.5 + 59.5 * 59.5;
  const double k_mm = 50 * kFocusMm / (kFocusMm - 50);
  for (int frame = 0; frame < options.frame_count; ++frame) {
    const LinearImage image = simulator.RenderNoiseless(frame);
    for (const int row : {4, 30, 58, 114}) {
      // The edge is a vertical line through the axis: its normal x is the tangent.
      const double rho2 = std::pow(row - 59.5, 2) / corner2;
      const double u = 1 / (kFocusMm - 6 * rho2), apart_mm = 4 * rho2;
      const double half = (1 - std::sqrt(1 + std::pow(apart_mm * u, 2))) / apart_mm;
      const double z = 286 + 30 * frame;
      const double sigma_px = 0.45 * 8.9 * k_mm / 0.02 * (1 / z - (u + half));
      EXPECT_NEAR(SigmaOfEdge(image, row), std::hypot(0.5, sigma_px), 0.01)
          << "frame " << frame << ", row " << row;
    }
  }
}

// In the focus of the blur along x, the image is that of a lens in focus, blurred along y alone.
TEST(AberratedSweep, ATextureIsBlurredAlongOneAxis) {
  SweepSimulationOptions options = Sharp(TargetKind::kDeadLeaves);
  options.camera.calibration->blur_floor_px = Estimate{1, 0};
  options.aberrations.astigmatism_mm = 8;
  options.frame_count = 1;
  const double half = (1 - std::sqrt(1 + std::pow(8 / kFocusMm, 2))) / 8;
  options.first_depth_mm = 1 / (1 / kFocusMm + half);
  EXPECT_GT(options.first_depth_mm, kFocusMm + 3.9);
  const LinearImage image = SweepSimulator(options, {}).RenderNoiseless(0);
  options.effects.given.Remove(Effect::kDefocus);
  const LinearImage sharp = SweepSimulator(options, {}).RenderNoiseless(0);
  const double k_mm = 50 * kFocusMm / (kFocusMm - 50);
  const double sigma_px = std::abs(0.45 * 8.9 * k_mm / 0.02 * 2 * half);
  ASSERT_GT(sigma_px, 1);
  double largest = 0, change = 0;
  for (int y = 20; y < 100; y += 3) {
    for (int x = 5; x < 155; x += 3) {
      const auto value = [&](const LinearImage& of, int row) {
        return static_cast<double>(of.values[static_cast<std::size_t>(row * 160 + x)]);
      };
      double sum = 0, weights = 0;
      for (int k = -15; k <= 15; ++k) {
        const double weight = std::exp(-k * k / (2 * sigma_px * sigma_px));
        sum += weight * value(sharp, y + k);
        weights += weight;
      }
      largest = std::max(largest, std::abs(value(image, y) - sum / weights));
      change = std::max(change, std::abs(value(image, y) - value(sharp, y)));
    }
  }
  EXPECT_LT(largest, 0.002);
  EXPECT_GT(change, 0.05);
}

// A line of the target is seen at the distorted places of its points.
TEST(AberratedSweep, DistortionBendsAnEdge) {
  for (const double distortion : {-0.1, 0.08}) {
    SweepSimulationOptions options = Sharp(TargetKind::kKnifeEdge);
    options.target.edge_angle_deg = 0;
    options.aberrations.distortion = distortion;
    options.camera.calibration->blur_floor_px = Estimate{1.5, 0};
    // The edge is in the middle of the image, 39.5 px from the axis.
    options.camera.sensor.principal_point_px = {40, 59.5};
    options.first_depth_mm = kFocusMm;
    options.frame_count = 1;
    const LinearImage image = SweepSimulator(options, {}).RenderNoiseless(0);
    const double corner2 = 119 * 119 + 59.5 * 59.5;
    for (const int row : {0, 20, 59, 90, 119}) {
      // The ideal point (39.5, Y) that lands on this row, by bisection.
      const auto landing = [&](double y) {
        return y * (1 + distortion * (39.5 * 39.5 + y * y) / corner2);
      };
      double low = -150, high = 150;
      for (int i = 0; i < 80; ++i) {
        const double middle = (low + high) / 2;
        (landing(middle) < row - 59.5 ? low : high) = middle;
      }
      const double expected = 40 + 39.5 * (1 + distortion * (39.5 * 39.5 + low * low) / corner2);
      double crossing = 0;
      for (int x = 1; x < 160; ++x) {
        const auto at = static_cast<std::size_t>(row * 160 + x);
        const double before = static_cast<double>(image.values[at - 1]) - 0.5,
                     here = static_cast<double>(image.values[at]) - 0.5;
        if (before < 0 && here >= 0) crossing = x - here / (here - before);
      }
      EXPECT_NEAR(crossing, expected, 0.02) << distortion << ", row " << row;
    }
  }
}

// A texture is displaced like the points of an undistorted image. The blur is so strong that linear
// interpolation between its pixels is exact enough.
TEST(AberratedSweep, DistortionDisplacesATexture) {
  SweepSimulationOptions options = Sharp(TargetKind::kDeadLeaves);
  options.aberrations.distortion = 0.07;
  options.first_depth_mm = 260;
  options.frame_count = 1;
  const auto frame = [&](const EffectSet& without) {
    SweepSimulationOptions other = options;
    other.effects.given = options.effects.given.Without(without);
    return SweepSimulator(other, {}).RenderNoiseless(0);
  };
  const LinearImage bent = frame({}), straight = frame({Effect::kDistortion});
  const double corner2 = 79.5 * 79.5 + 59.5 * 59.5;
  double largest = 0, moved = 0;
  for (int y = 4; y < 116; y += 3) {
    for (int x = 4; x < 156; x += 3) {
      const Eigen::Vector2d seen(x - 79.5, y - 59.5);
      double r = 1;
      for (int i = 0; i < 200; ++i) r = 1 / (1 + 0.07 * r * r * seen.squaredNorm() / corner2);
      const Eigen::Vector2d from = r * seen + Eigen::Vector2d(79.5, 59.5);
      const int left = static_cast<int>(from.x()), top = static_cast<int>(from.y());
      const auto value = [&](int column, int row) {
        return static_cast<double>(straight.values[static_cast<std::size_t>(row * 160 + column)]);
      };
      const double fx = from.x() - left, fy = from.y() - top;
      const double expected =
          (1 - fy) * ((1 - fx) * value(left, top) + fx * value(left + 1, top)) +
          fy * ((1 - fx) * value(left, top + 1) + fx * value(left + 1, top + 1));
      const double found = static_cast<double>(bent.values[static_cast<std::size_t>(y * 160 + x)]);
      largest = std::max(largest, std::abs(found - expected));
      moved = std::max(moved, std::abs(found - value(x, y)));
    }
  }
  EXPECT_LT(largest, 0.003);
  EXPECT_GT(moved, 0.03);
}

}  // namespace
}  // namespace thicklens::model
