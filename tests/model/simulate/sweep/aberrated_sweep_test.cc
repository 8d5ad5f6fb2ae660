// Sweeps of an aberrated lens: the blur of each place and direction, and the displaced image.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <opencv2/core.hpp>
#include <utility>

#include "model/base/random_draws.h"
#include "model/simulate/sweep/field_blur.h"
#include "model/simulate/sweep/periodic_image.h"
#include "support/test_cameras.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;

constexpr double kPi = 3.14159265358979323846;
constexpr double kFocusMm = 300;

cv::Mat RandomSamples(int side) {
  RandomDraws draws(7, RandomDraws::Purpose::kTexture, 0);
  cv::Mat samples(side, side, CV_64F);
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) samples.at<double>(i, j) = 1 + 0.3 * draws.Normal();
  }
  return samples;
}

FrameBlur MappedBlur(Psf psf, double xx, double xy, double yy) {
  FrameBlur blur{0.5, psf, 0};
  Eigen::Matrix2d map;
  map << xx, xy, xy, yy;
  blur.defocus_map_px = map;
  return blur;
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

// Sigma of a step along one axis, from the second moment of its derivative about its mean, without
// the pixel box.
double SigmaOfEdge(const LinearImage& image, int row) {
  double sum = 0, first = 0, second = 0;
  for (int x = 1; x < image.width_px; ++x) {
    const auto at = static_cast<std::size_t>(row * image.width_px + x);
    const double d = static_cast<double>(image.values[at] - image.values[at - 1]);
    sum += d;
    first += d * x;
    second += d * x * x;
  }
  const double mean = first / sum;
  // The difference of neighbours is a box of one pixel, too.
  return std::sqrt(second / sum - mean * mean - 1.0 / 6);
}

// A Gaussian under a matrix M has the transfer function exp(-2 pi^2 |M f|^2).
TEST(AberratedSweep, AMappedGaussianHasItsTransferFunction) {
  const PeriodicImage image(RandomSamples(41));
  const AxisSampling x{-1.31, 0.0271, 23}, y{0.77, 0.0213, 17};
  const FrameBlur blur = MappedBlur(Psf::kGaussian, 1.4, -0.8, 0.3);
  const cv::Mat frame = image.Evaluate(x, y, blur);
  for (const auto& [i, j] : {std::pair{0, 0}, std::pair{9, 20}, std::pair{16, 7}}) {
    std::complex<double> sum = 0;
    for (int b = -20; b <= 20; ++b) {
      for (int a = -20; a <= 20; ++a) {
        const double fx = a * x.step, fy = b * y.step;
        const double along = 1.4 * fx - 0.8 * fy, across = -0.8 * fx + 0.3 * fy;
        const auto box = [](double f) { return f == 0 ? 1 : std::sin(kPi * f) / (kPi * f); };
        sum += image.Coefficient(a, b) * box(fx) * box(fy) *
               std::exp(-2 * kPi * kPi *
                        (0.25 * (fx * fx + fy * fy) + along * along + across * across)) *
               std::polar(1.0, 2 * kPi * (a * (x.start + j * x.step) + b * (y.start + i * y.step)));
      }
    }
    EXPECT_NEAR(frame.at<double>(i, j), sum.real(), 1e-9);
  }
}

// A disc under a matrix is an ellipse: the light of many rays, each displaced by M times its place.
TEST(AberratedSweep, AMappedDiscIsTheMeanOfItsRays) {
  const PeriodicImage image(RandomSamples(21));
  const double step = 0.04;
  const FrameBlur blur = MappedBlur(Psf::kDisc, 1.2, 0.5, -0.7);
  const double found = image.Evaluate({0.3, step, 1}, {0.6, step, 1}, blur).at<double>(0, 0);
  double sum = 0;
  int rays = 0;
  constexpr int kSide = 60;
  FrameBlur still = blur;
  still.defocus_map_px.reset();
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      // The disc of a sigma of 1 px has a radius of 2 px.
      const Eigen::Vector2d ray(4 * (i + 0.5) / kSide - 2, 4 * (j + 0.5) / kSide - 2);
      if (ray.norm() > 2) continue;
      const Eigen::Vector2d shift = *blur.defocus_map_px * ray;
      sum +=
          image
              .Evaluate({0.3 + step * shift.x(), step, 1}, {0.6 + step * shift.y(), step, 1}, still)
              .at<double>(0, 0);
      ++rays;
    }
  }
  EXPECT_NEAR(found, sum / rays, 5e-4);
}

// Every pixel of the sum has the blur of its place.
TEST(AberratedSweep, AFieldOfBlursIsTheBlurOfEachPlace) {
  const PeriodicImage image(RandomSamples(151));
  const cv::Size size(120, 90);
  const double step = 1 / 140.0;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    const auto blur_at = [&](const Eigen::Vector2d& place) {
      const Eigen::Vector2d from_axis = place - Eigen::Vector2d(60, 40);
      const double rho2 = from_axis.squaredNorm() / 6000;
      const Eigen::Vector2d radial = from_axis.normalized();
      const Eigen::Matrix2d map =
          (1.5 - 2 * rho2) * Eigen::Matrix2d::Identity() + 0.9 * rho2 * radial * radial.transpose();
      return MappedBlur(psf, map(0, 0), map(0, 1), map(1, 1));
    };
    const FieldBlur field = DecomposeBlur(size, blur_at);
    EXPECT_LT(field.blurs.size(), 60U);
    const AxisSampling x{0.1, step, size.width}, y{0.3, step, size.height};
    cv::Mat sum = cv::Mat::zeros(size, CV_64F);
    for (std::size_t k = 0; k < field.blurs.size(); ++k) {
      cv::Mat weights;
      field.weights[k].convertTo(weights, CV_64F);
      sum += image.Evaluate(x, y, field.blurs[k]).mul(weights);
    }
    for (const auto& [column, row] : {std::pair{0, 0}, std::pair{60, 40}, std::pair{119, 89},
                                      std::pair{33, 71}, std::pair{101, 5}, std::pair{62, 44}}) {
      const double right =
          image
              .Evaluate({0.1 + column * step, step, 1}, {0.3 + row * step, step, 1},
                        blur_at(Eigen::Vector2d(column, row)))
              .at<double>(0, 0);
      EXPECT_NEAR(sum.at<double>(row, column), right, 1e-3) << column << ", " << row;
    }
  }
}

// The blur across an edge is kappa r K/p (1/z - 1/z'), z' the focus of that place and direction.
TEST(AberratedSweep, AnEdgeHasTheBlurOfItsPlaceAndDirection) {
  SweepSimulationOptions options = Sharp(TargetKind::kKnifeEdge);
  options.target.edge_angle_deg = 0;
  options.aberrations.field_curvature_mm = -6;
  options.aberrations.field_astigmatism_mm = 4;
  const SweepSimulator simulator(options, {});
  const double corner2 = 79.5 * 79.5 + 59.5 * 59.5;
  const double k_mm = 50 * kFocusMm / (kFocusMm - 50);
  for (int frame = 0; frame < options.frame_count; ++frame) {
    const LinearImage image = simulator.RenderNoiseless(frame);
    for (const int row : {2, 30, 58, 116}) {
      // The edge is a vertical line through the axis: its normal x is the tangent.
      const double rho2 = std::pow(row - row % 4 + 1.5 - 59.5, 2) / corner2;
      const double u = 1 / (kFocusMm - 6 * rho2), apart_mm = 4 * rho2;
      const double half =
          apart_mm == 0 ? 0 : (1 - std::sqrt(1 + std::pow(apart_mm * u, 2))) / apart_mm;
      const double z = 292 + 8 * frame;
      const double sigma_px = 0.45 * 8.9 * k_mm / 0.02 * (1 / z - (u + half));
      EXPECT_NEAR(SigmaOfEdge(image, row), std::hypot(0.5, sigma_px), 0.02)
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
