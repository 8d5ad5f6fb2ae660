// The camera by a grid, from points that OpenCV projected.
#include "calib/grid/grid_geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "tests/calib/grid/grid_bench.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::GridBench;

const std::vector<double> kBarrel = {-0.25, 0.1, 0.0008, -0.0006, 0};

GridGeometry Measured(const GridBench& bench, const GridViews& views,
                      std::optional<double> alignment_deg = std::nullopt) {
  FocusSweep sweep = bench.Camera();
  sweep.stage_alignment_deg = alignment_deg;
  return GeometryOf(sweep, views);
}

double Sigmas(const model::Estimate& found, double truth) {
  return (found.value - truth) / found.sigma;
}

TEST(GridGeometry, TiltedViewsDetermineEverything) {
  GridBench bench(1);
  bench.coefficients = kBarrel;
  GridViews views;
  bench.Sweep(15, 80, {0.02, -0.03, 0.1}, {4, -3, 260}, {0.02, 0.01}, &views);
  bench.Tilted(8, 230, &views);
  const GridGeometry found = Measured(bench, views);
  ASSERT_TRUE(found.done) << found.message;
  ASSERT_TRUE(found.focal_length_px && found.principal_x_px && found.principal_y_px);
  EXPECT_LT(std::abs(Sigmas(*found.focal_length_px, 1500)), 3);
  EXPECT_LT(std::abs(Sigmas(*found.principal_x_px, 330)), 3);
  EXPECT_LT(std::abs(Sigmas(*found.principal_y_px, 230)), 3);
  EXPECT_LT(found.focal_length_px->sigma, 3);
  EXPECT_LT(found.principal_x_px->sigma, 2);
  EXPECT_THAT(found.open, IsEmpty());
  // d1 = rho + f2 f_px p/f1
  EXPECT_NEAR(found.image_distance_mm->value, 0.006 * found.focal_length_px->value, 1e-9);
  EXPECT_TRUE(found.distortion_is_used) << found.verdict;
  model::LensDistortion truth = *found.lens;
  truth.focal_length_px = {1500, 1500};
  truth.principal_point_px = {330, 230};
  truth.coefficients = kBarrel;
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(20, 20), {600, 460}, {320, 20}, {20, 240}}) {
    const Eigen::Vector2d apart = found.lens->Distorted(at) - at - (truth.Distorted(at) - at);
    EXPECT_LT(apart.norm(), 1.0) << at.transpose();
  }
}

TEST(GridGeometry, AnotherSolverFindsTheSame) {
  GridBench bench(2);
  bench.coefficients = kBarrel;
  GridViews views;
  bench.Tilted(12, 250, &views);
  const GridGeometry found = Measured(bench, views);
  ASSERT_TRUE(found.done) << found.message;
  std::vector<std::vector<cv::Point3f>> target;
  std::vector<std::vector<cv::Point2f>> image;
  const std::vector<Eigen::Vector2d> points = bench.Centred();
  for (const GridView& view : views.views) {
    target.emplace_back();
    image.emplace_back();
    for (std::size_t i = 0; i < view.ids.size(); ++i) {
      const Eigen::Vector2d& at = points[static_cast<std::size_t>(view.ids[i])];
      target.back().emplace_back(at.x(), at.y(), 0);
      image.back().emplace_back(view.image_px[i].x(), view.image_px[i].y());
    }
  }
  cv::Mat camera, coefficients, deviations;
  std::vector<cv::Mat> rotations, places;
  cv::calibrateCamera(target, image, {640, 480}, camera, coefficients, rotations, places,
                      deviations, cv::noArray(), cv::noArray(), cv::CALIB_FIX_ASPECT_RATIO);
  // OpenCV knows no wrong sheet, so that its errors are smaller.
  EXPECT_LT(std::abs(found.focal_length_px->value - camera.at<double>(0, 0)),
            found.focal_length_px->sigma);
  EXPECT_LT(std::abs(found.principal_x_px->value - camera.at<double>(0, 2)),
            found.principal_x_px->sigma);
  EXPECT_LT(std::abs(found.lens->coefficients[0] - coefficients.at<double>(0)),
            std::sqrt(found.lens->covariance(3, 3)));
  EXPECT_GT(found.focal_length_px->sigma, 0.5 * deviations.at<double>(0));
}

TEST(GridGeometry, ASweepAlongTheAxisFixesTheVanishingPointAlone) {
  GridBench bench(3);
  GridViews views;
  bench.Sweep(21, 80, {0, 0, 0.02}, {2, -1, 260}, {0.03, -0.02}, &views);
  const GridGeometry found = Measured(bench, views);
  ASSERT_TRUE(found.done) << found.message;
  EXPECT_FALSE(found.principal_x_px);
  // The readings and the size of the squares give the scale of the depth.
  ASSERT_TRUE(found.focal_length_px);
  EXPECT_LT(std::abs(Sigmas(*found.focal_length_px, 1500)), 3);
  ASSERT_EQ(found.combinations.size(), 3U);
  EXPECT_LT(std::abs(Sigmas(found.combinations[1].value, 330 + 1500 * 0.03)), 3);
  EXPECT_LT(std::abs(Sigmas(found.combinations[2].value, 230 - 1500 * 0.02)), 3);
  EXPECT_LT(found.combinations[1].value.sigma, 5);
  EXPECT_THAT(found.open, Contains(HasSubstr("principal point x")));
  EXPECT_THAT(found.open, Contains(HasSubstr("direction of the motion")));
  EXPECT_FALSE(found.distortion_is_found) << found.verdict;
}

TEST(GridGeometry, AShortSweepLeavesImageDistanceAndDepthOpen) {
  GridBench bench(4);
  GridViews views;
  bench.Sweep(9, 0.2, {0, 0, 0}, {2, -1, 260}, {0, 0}, &views);
  const GridGeometry found = Measured(bench, views);
  ASSERT_TRUE(found.done) << found.message;
  EXPECT_FALSE(found.focal_length_px);
  EXPECT_FALSE(found.image_distance_mm);
  EXPECT_THAT(found.open, Contains(::testing::AllOf(HasSubstr("image distance"),
                                                    HasSubstr("distance of the target"))));
  // The ratio f/z is fixed.
  EXPECT_LT(std::abs(Sigmas(found.combinations[0].value, 1500 / 260.0)), 3);
  EXPECT_LT(found.combinations[0].value.sigma, 0.006 * 1500 / 260.0);
}

TEST(GridGeometry, AnAlignedStageGivesThePrincipalPoint) {
  GridBench bench(5);
  GridViews views;
  bench.Sweep(21, 80, {0.05, 0.08, 0.02}, {2, -1, 260}, {0.0005, -0.0005}, &views);
  EXPECT_FALSE(Measured(bench, views).principal_x_px);
  const GridGeometry found = Measured(bench, views, 0.05);
  ASSERT_TRUE(found.principal_x_px);
  EXPECT_LT(std::abs(Sigmas(*found.principal_x_px, 330)), 3);
  EXPECT_LT(std::abs(Sigmas(*found.principal_y_px, 230)), 3);
  EXPECT_LT(found.principal_x_px->sigma, 5);
  ASSERT_TRUE(found.tilt_right_deg && found.tilt_down_deg);
}

// The tilts have the sense of the field map: positive where right, or the bottom, is nearer.
TEST(GridGeometry, TheTiltOfTheTargetHasItsSense) {
  GridBench bench(6);
  GridViews views;
  const double angle = 6 * 3.14159265 / 180;
  // About y by a positive angle: z = -sin(angle) x, so that the right side is nearer.
  bench.Sweep(21, 80, {0, angle, 0}, {0, 0, 260}, {0, 0}, &views);
  const GridGeometry found = Measured(bench, views, 0.02);
  ASSERT_TRUE(found.tilt_right_deg) << found.message;
  EXPECT_NEAR(found.tilt_right_deg->value, 6, 3 * found.tilt_right_deg->sigma + 0.1);
  EXPECT_LT(found.tilt_right_deg->sigma, 0.5);
  EXPECT_NEAR(found.tilt_down_deg->value, 0, 3 * found.tilt_down_deg->sigma + 0.1);
}

// The size on the axis is that of the depth there, however the target is tilted and wherever the
// grid lies on it.
TEST(GridGeometry, ATiltedGridHasTheSizeOfItsDepthOnTheAxis) {
  for (const double degrees : {0.0, 15.0}) {
    GridBench bench(60);
    bench.cx = 319.5;
    bench.cy = 239.5;
    const double angle = degrees * 3.14159265 / 180;
    constexpr double kRightMm = 6, kDepthMm = 260;
    GridViews views;
    bench.Sweep(11, 40, {0, angle, 0}, {kRightMm, -2, kDepthMm}, {0, 0}, &views);
    const GridGeometry found = Measured(bench, views);
    ASSERT_EQ(found.scales.size(), 11U) << found.message;
    const double middle_mm = kDepthMm + kRightMm * std::tan(angle);
    double squares = 0;
    for (const GridScale& scale : found.scales) {
      const double truth = 1500 * 0.006 / (middle_mm + scale.reading_mm);
      // The camera file's focal length is 8 % short, which makes the tilt smaller.
      EXPECT_NEAR(scale.magnification, truth, 0.003 * truth) << degrees;
      EXPECT_LT(std::abs(scale.magnification - truth), 3.5 * scale.sigma) << degrees;
      squares += std::pow((scale.magnification - truth) / scale.sigma, 2) / 11;
    }
    if (degrees == 0) {
      EXPECT_LT(squares, 2.5);
      EXPECT_GT(squares, 0.2);
    }
  }
}

TEST(GridGeometry, TheErrorOfTheSizesIsPartOfTheMagnification) {
  std::vector<GridScale> scales;
  for (const double reading_mm : {-1.0, 0.0, 1.0}) scales.push_back({reading_mm, 0.1, 1e-5});
  const auto sure = MagnificationOfGrid(scales, 50, 1, 0, kFromGrid);
  for (GridScale& scale : scales) scale.sigma = 0.002;
  const auto unsure = MagnificationOfGrid(scales, 50, 1, 0, kFromGrid);
  ASSERT_TRUE(sure && unsure);
  EXPECT_EQ(unsure->value.value, sure->value.value);
  EXPECT_NEAR(std::pow(unsure->value.sigma, 2), std::pow(sure->value.sigma, 2) + 4e-6, 1e-8);
}

// None of them may pass for a distortion.
TEST(GridGeometry, NoFalseDistortion) {
  const double half = 55;  // mm, of the sheet's diagonal
  const std::function<Eigen::Vector3d(const Eigen::Vector2d&)> sheets[] = {
      // flat; bent about an axis; a dome; twisted; stretched and sheared by the printer
      [](const Eigen::Vector2d& at) { return Eigen::Vector3d(at.x(), at.y(), 0); },
      [=](const Eigen::Vector2d& at) {
        return Eigen::Vector3d(at.x(), at.y(), 0.06 * half * std::pow(at.x() / half, 2));
      },
      [=](const Eigen::Vector2d& at) {
        return Eigen::Vector3d(at.x(), at.y(), -0.05 * at.squaredNorm() / half);
      },
      [=](const Eigen::Vector2d& at) {
        return Eigen::Vector3d(at.x(), at.y(), 0.04 * at.x() * at.y() / half);
      },
      [](const Eigen::Vector2d& at) {
        return Eigen::Vector3d(1.004 * at.x() + 0.003 * at.y(), 0.997 * at.y(), 0);
      }};
  std::uint64_t seed = 20;
  for (const auto& sheet : sheets) {
    for (const auto& [tilt, has_views] : {std::pair(0.12, false), std::pair(0.0, true)}) {
      GridBench bench(seed++);
      bench.sheet = sheet;
      GridViews views;
      bench.Sweep(11, 80, {0.3 * tilt, tilt, 0.02}, {2, -1, 260}, {0.01, 0}, &views);
      if (has_views) bench.Tilted(6, 240, &views);
      const GridGeometry found = Measured(bench, views);
      ASSERT_TRUE(found.done) << found.message;
      EXPECT_FALSE(found.distortion_is_found) << seed << ": " << found.verdict;
    }
  }
}

// Errors of single points of the print are the same in all frames.
TEST(GridGeometry, AnUnevenPrintIsNoDistortion) {
  for (const std::uint64_t seed : {40U, 41U}) {
    GridBench bench(seed), print(seed + 100);
    std::map<std::pair<double, double>, Eigen::Vector2d> errors;
    for (const Eigen::Vector2d& at : bench.Centred())
      errors[{at.x(), at.y()}] = 0.05 * Eigen::Vector2d(print.Normal(), print.Normal());
    bench.sheet = [&errors](const Eigen::Vector2d& at) {
      const Eigen::Vector2d error = errors.at({at.x(), at.y()});
      return Eigen::Vector3d(at.x() + error.x(), at.y() + error.y(), 0);
    };
    GridViews views;
    bench.Sweep(15, 80, {0, 0.05, 0.02}, {2, -1, 260}, {0.01, 0}, &views);
    bench.Tilted(6, 240, &views);
    const GridGeometry found = Measured(bench, views);
    EXPECT_FALSE(found.distortion_is_found) << found.verdict;
    EXPECT_LT(std::abs(Sigmas(*found.focal_length_px, 1500)), 3);
  }
}

// A program that aligned the frames made them all of one size, so that a distortion is one of the
// target as well.
TEST(GridGeometry, AlignedFramesGiveNoGeometry) {
  GridBench bench(7);
  bench.coefficients = kBarrel;
  GridViews views;
  for (int i = 0; i < 15; ++i) {
    GridView view = bench.View({0, 0, 0}, {0, 0, 260});
    view.position_mm = 5.0 * i;
    views.frames.push_back(view);
    views.readings_mm.push_back(5.0 * i);
  }
  const GridGeometry found = Measured(bench, views);
  EXPECT_FALSE(found.done);
  EXPECT_FALSE(found.distortion_is_found);
  EXPECT_THAT(found.message, HasSubstr("aligned or scaled by a program"));
}

// A long sweep of a flat target with a strong distortion needs no tilted views.
TEST(GridGeometry, ALongSweepShowsAStrongDistortion) {
  GridBench bench(8);
  bench.coefficients = {-0.35, 0.12, 0, 0, 0};
  GridViews views;
  bench.Sweep(25, 160, {0.04, 0.1, 0.02}, {2, -1, 260}, {0, 0}, &views);
  const GridGeometry found = Measured(bench, views, 0.1);
  EXPECT_TRUE(found.distortion_is_found) << found.verdict;
}

TEST(GridGeometry, AGridThatIsNotSeenIsSaid) {
  const GridGeometry found = Measured(GridBench(9), {});
  EXPECT_FALSE(found.done);
  EXPECT_THAT(found.message, HasSubstr("no frame shows the chequerboard of 12 x 9 squares"));
}

}  // namespace
}  // namespace thicklens::calib
