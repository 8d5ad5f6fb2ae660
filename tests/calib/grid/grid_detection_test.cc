// Grids and marks in simulated frames and drawn sheets.
#include "calib/grid/grid_detection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "calib/grid/grid_geometry.h"
#include "calib/grid/sheet_marks.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/model/target_page.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

// A sweep of case ii, whose camera sees about 15 x 15 mm at 300 mm, before a grid.
model::SweepSimulationOptions GridSweep(const std::string& grid, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, seed);
  options.bits = 16;
  options.drift_sigma_px = 0.3;
  options.target = {};
  options.target.kind = model::TargetKind::kGrid;
  options.target.contrast = 0.6;
  options.target.grid = model::ParseTargetGrid(grid);
  return options;
}

// px per mm of the target, in the frame in which it is sharpest.
double TruePxPerMm(const SimulatedSweep& s, std::size_t frame) {
  const model::Camera& camera = s.sweep.camera;
  return camera.lens.front_focal_length_mm *
         (s.truth.image_distance_mm - camera.lens.lens_thickness_mm) /
         (camera.lens.rear_focal_length_mm * camera.sensor.pixel_pitch_mm *
          (s.truth.frames[frame].depth_mm - s.centre_mm));
}

TEST(GridDetection, FindsEveryPatternWhereItIs) {
  for (const char* pattern :
       {"chequerboard:9x6:1.4", "chequerboard:8x6:1.4", "charuco:9x6:1.4", "circles:8x6:1.3"}) {
    model::SweepSimulationOptions options = GridSweep(pattern, 3);
    const double zf_mm = options.camera.focus_depth_mm();
    options.first_depth_mm = zf_mm;
    options.frame_count = 1;
    options.step_mm = 1;
    const SimulatedSweep s = Simulate(options);
    const auto found =
        DetectGrid(LinearGrey(s.sweep.read_frame(0), s.sweep, 0), *options.target.grid);
    ASSERT_TRUE(found) << pattern;
    const std::vector<Eigen::Vector2d> points = model::GridPoints(*options.target.grid);
    EXPECT_EQ(found->ids.size(), points.size()) << pattern;
    // The board stands in the middle, within half a sample of the texture, at the true scale but
    // for the centre of perspective.
    const Eigen::Vector2d half_mm = 0.5 * options.target.grid->SizeMm();
    const model::Sensor& sensor = options.camera.sensor;
    const Eigen::Vector2d middle_px(0.5 * (sensor.width_px - 1), 0.5 * (sensor.height_px - 1));
    Eigen::Vector2d mean(0, 0);
    double product = 0, square = 0, apart = 0;
    const auto count = static_cast<double>(found->ids.size());
    const auto at_mm = [&](std::size_t i) {
      return Eigen::Vector2d(points[static_cast<std::size_t>(found->ids[i])] - half_mm);
    };
    for (const Eigen::Vector2d& at : found->image_px) mean += (at - middle_px) / count;
    for (std::size_t i = 0; i < found->ids.size(); ++i) {
      product += at_mm(i).dot(found->image_px[i] - middle_px - mean);
      square += at_mm(i).squaredNorm();
    }
    const double px_per_mm = product / square;
    for (std::size_t i = 0; i < found->ids.size(); ++i)
      apart += (found->image_px[i] - middle_px - mean - px_per_mm * at_mm(i)).squaredNorm();
    EXPECT_LT(mean.norm(), 0.6) << pattern;
    EXPECT_NEAR(px_per_mm / TruePxPerMm(s, 0), 1, 0.005) << pattern;
    EXPECT_LT(std::sqrt(apart / (2 * count)), 0.06) << pattern;
  }
}

// A board that is held upside down is read from its own first corner, and not from the image's.
TEST(GridDetection, ABoardUpsideDownKeepsItsNumbers) {
  model::SweepSimulationOptions options = GridSweep("chequerboard:9x6:1.4", 4);
  options.first_depth_mm = options.camera.focus_depth_mm();
  options.frame_count = 1;
  options.step_mm = 1;
  const SimulatedSweep s = Simulate(options);
  const cv::Mat light = LinearGrey(s.sweep.read_frame(0), s.sweep, 0);
  cv::Mat turned;
  cv::rotate(light, turned, cv::ROTATE_180);
  const auto upright = DetectGrid(light, *options.target.grid);
  const auto upside_down = DetectGrid(turned, *options.target.grid);
  ASSERT_TRUE(upright && upside_down);
  for (std::size_t i = 0; i < upright->ids.size(); ++i) {
    const Eigen::Vector2d back(light.cols - 1 - upside_down->image_px[i].x(),
                               light.rows - 1 - upside_down->image_px[i].y());
    EXPECT_LT((back - upright->image_px[i]).norm(), 0.2);
  }
}

// A texture is no grid, and a blurred grid none that can be measured.
TEST(GridDetection, SeesNoGridWhereThereIsNone) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, 5);
  options.first_depth_mm = options.camera.focus_depth_mm();
  options.frame_count = 1;
  options.step_mm = 1;
  const SimulatedSweep s = Simulate(options);
  const cv::Mat light = LinearGrey(s.sweep.read_frame(0), s.sweep, 0);
  for (const char* pattern : {"chequerboard:9x6:1.4", "charuco:9x6:1.4", "circles:8x6:1.3"})
    EXPECT_FALSE(DetectGrid(light, model::ParseTargetGrid(pattern))) << pattern;
  EXPECT_THAT(FindMarkers(light, model::kSheetDictionary), ::testing::IsEmpty());
}

// The frames of a whole sweep: the image distance of the truth, and the stated distortion.
TEST(GridDetection, SlowSweepsGiveImageDistanceAndDistortion) {
  for (const double distortion : {0.0, -0.06}) {
    model::SweepSimulationOptions options = GridSweep("chequerboard:9x8:1.4", 6);
    options.aberrations.distortion = distortion;
    options.target.tilt_deg = 3;
    options.frame_count = 11;
    options.step_mm = 2;
    options.first_depth_mm = 290;
    const SimulatedSweep s = Simulate(options);
    FocusSweep sweep = s.sweep;
    sweep.target_grid = options.target.grid;
    sweep.stage_alignment_deg = 0.01;
    const GridGeometry found = MeasureGrid(sweep, 0, [] {});
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_TRUE(found.follows_readings);
    EXPECT_GE(found.frames_used, 6);
    ASSERT_TRUE(found.image_distance_mm);
    EXPECT_LT(std::abs(found.image_distance_mm->value - s.truth.image_distance_mm),
              3 * found.image_distance_mm->sigma);
    EXPECT_LT(found.image_distance_mm->sigma, 0.01 * s.truth.image_distance_mm);
    EXPECT_EQ(found.distortion_is_used, distortion != 0) << found.verdict;
    if (distortion == 0) continue;
    // Where the lens images a corner: displaced by the stated part of its distance.
    const model::Sensor& sensor = options.camera.sensor;
    const Eigen::Vector2d corner(10, 10);
    const double farthest_px = model::FarthestCornerPx(sensor);
    const Eigen::Vector2d from_axis = corner - sensor.principal_point_px;
    const Eigen::Vector2d truth =
        model::WithoutDistortion(distortion, from_axis, farthest_px) + sensor.principal_point_px;
    EXPECT_LT((found.lens->Distorted(truth) - corner).norm(), 1.0);
    EXPECT_GT((truth - corner).norm(), 5);
  }
}

// The sheet of `thicklens target`, photographed: drawn at `px_per_mm` and seen through a
// homography.
cv::Mat SheetInView(const model::TargetPage& page, const cv::Matx33d& to_image, cv::Size size_px) {
  constexpr double kPxPerMm = 12;
  cv::Mat sheet(static_cast<int>(page.height_mm * kPxPerMm),
                static_cast<int>(page.width_mm * kPxPerMm), CV_32F, cv::Scalar(0.9));
  const auto fill = [&](double x, double y, double width, double height, double light) {
    const auto px = [](double mm) { return static_cast<int>(std::lround(mm * kPxPerMm)); };
    cv::rectangle(sheet, {px(x), px(y)}, {px(x + width) - 1, px(y + height) - 1}, {light},
                  cv::FILLED);
  };
  fill(page.pattern.x, page.pattern.y, page.pattern.width, page.pattern.height, 0.5);
  for (const model::PlacedMark& mark : page.marks) {
    const auto modules = model::MarkerModules(model::kSheetDictionary, mark.number);
    const double side = mark.area.width / static_cast<double>(modules.size());
    fill(mark.area.x - side, mark.area.y - side, mark.area.width + 2 * side,
         mark.area.height + 2 * side, 0.9);
    for (std::size_t i = 0; i < modules.size(); ++i) {
      for (std::size_t j = 0; j < modules.size(); ++j) {
        if (modules[i][j])
          fill(mark.area.x + static_cast<double>(j) * side,
               mark.area.y + static_cast<double>(i) * side, side, side, 0.05);
      }
    }
  }
  const cv::Matx33d from_sheet(1 / kPxPerMm, 0, 0.5 / kPxPerMm, 0, 1 / kPxPerMm, 0.5 / kPxPerMm, 0,
                               0, 1);
  cv::Mat image;
  cv::GaussianBlur(sheet, sheet, {}, 3);
  cv::warpPerspective(sheet, image, cv::Mat(to_image * from_sheet), size_px, cv::INTER_LINEAR,
                      cv::BORDER_CONSTANT, {0.3});
  cv::GaussianBlur(image, image, {}, 0.8);
  return image;
}

model::TargetPage TexturePage() {
  model::TargetRequest request;
  request.sheet = {210, 297, true};
  return model::LayOutTarget(request);
}

// A camera with an image distance of 56 mm and pixels of 0.01 mm, and a sheet before it that is
// turned about the vertical.
SheetMarks MarksOfSheet(double tilt_deg, double depth_mm, double stated_f1_mm, int shown = 4) {
  model::TargetPage page = TexturePage();
  page.marks.resize(static_cast<std::size_t>(shown));
  FocusSweep sweep;
  const double focal_px = 5600, angle = tilt_deg * 3.14159265358979 / 180;
  sweep.camera.sensor.width_px = 1200;
  sweep.camera.sensor.height_px = 1590;
  sweep.camera.sensor.pixel_pitch_mm = 0.01;
  sweep.camera.sensor.principal_point_px = {599.5, 794.5};
  sweep.camera.lens = {stated_f1_mm, stated_f1_mm, 0, 5};
  const cv::Matx33d camera(focal_px, 0, 599.5, 0, focal_px, 794.5, 0, 0, 1);
  const double c = std::cos(angle), s = std::sin(angle);
  // Columns: right and down on the sheet, and its middle.
  const cv::Matx33d pose(c, 0, 0, 0, 1, 0, -s, 0, depth_mm);
  const cv::Matx33d centred(1, 0, -page.width_mm / 2, 0, 1, -page.height_mm / 2, 0, 0, 1);
  MarkedFrame frame;
  frame.reading_mm = 7;
  frame.light = SheetInView(page, camera * pose * centred, {1200, 1590});
  return FindSheetMarks(sweep, {frame});
}

TEST(SheetMarks, GiveMagnificationAndTilt) {
  const double depth_mm = 1100;
  // f1 (1 + m) = 56 mm, m = 56/1100.
  const double f1_mm = 56 / (1 + 56 / depth_mm);
  for (const double tilt_deg : {0.0, 8.0, -15.0}) {
    const SheetMarks found = MarksOfSheet(tilt_deg, depth_mm, f1_mm);
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_EQ(found.marks, 4);
    EXPECT_EQ(found.side_mm, 8);
    ASSERT_EQ(found.scales.size(), 1U);
    EXPECT_EQ(found.scales[0].reading_mm, 7);
    EXPECT_NEAR(found.scales[0].magnification, 56 / depth_mm, 0.001 * 56 / depth_mm);
    EXPECT_GT(found.scales[0].sigma, 0);
    ASSERT_TRUE(found.tilt_right_deg && found.tilt_down_deg);
    EXPECT_NEAR(found.tilt_right_deg->value, tilt_deg, 3 * found.tilt_right_deg->sigma + 0.2);
    EXPECT_NEAR(found.tilt_down_deg->value, 0, 3 * found.tilt_down_deg->sigma + 0.2);
    EXPECT_LT(found.tilt_right_deg->sigma, 2);
  }
}

// Three marks show scale and tilt as well, with larger errors; two marks the scale.
TEST(SheetMarks, AreSeenInPart) {
  const double depth_mm = 1100, f1_mm = 56 / (1 + 56 / depth_mm);
  for (const int shown : {3, 2}) {
    const SheetMarks found = MarksOfSheet(10, depth_mm, f1_mm, shown);
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_EQ(found.marks, shown);
    const GridScale& scale = found.scales[0];
    EXPECT_NEAR(scale.magnification, 56 / depth_mm, 3 * scale.sigma);
    EXPECT_LT(scale.sigma, 0.02 * scale.magnification);
    EXPECT_NEAR(found.tilt_right_deg->value, 10, 3 * found.tilt_right_deg->sigma);
  }
}

TEST(SheetMarks, AreNotNeeded) {
  model::TargetRequest request;
  request.sheet = {210, 297, true};
  request.has_marks = false;
  const model::TargetPage page = model::LayOutTarget(request);
  EXPECT_TRUE(page.marks.empty());
  FocusSweep sweep;
  sweep.camera.sensor.width_px = sweep.camera.sensor.height_px = 600;
  sweep.camera.sensor.pixel_pitch_mm = 0.01;
  sweep.camera.lens = {50, 50, 0, 5};
  const SheetMarks found = FindSheetMarks(
      sweep, {{0, SheetInView(page, cv::Matx33d(2, 0, 20, 0, 2, 5, 0, 0, 1), {600, 600})}});
  EXPECT_FALSE(found.done);
  EXPECT_EQ(found.message, "no marks of a sheet are in view");
}

// The statement by frames in front of and behind the plane of focus: m = f1/(zf - f1).
TEST(GridScales, GiveTheMagnificationInThePlaneOfFocus) {
  const double f1_mm = 50, zf_mm = 300;
  std::vector<GridScale> scales;
  for (const double beyond_mm : {-20.0, -5.0, 5.0, 30.0}) {
    const double m = f1_mm / (zf_mm - f1_mm) * zf_mm / (zf_mm + beyond_mm);
    scales.push_back({100 - beyond_mm, m, 1e-5});
  }
  const auto found = MagnificationOfGrid(scales, f1_mm, -1, 100, "target_grid");
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->value.value, 0.2, 1e-9);
  EXPECT_NEAR(found->value.sigma, 0.003 * 0.2, 1e-6);
  EXPECT_EQ(found->name, "target_grid");
  EXPECT_FALSE(MagnificationOfGrid({}, f1_mm, 1, 0, "target_grid"));
}

}  // namespace
}  // namespace thicklens::calib
