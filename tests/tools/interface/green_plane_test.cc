#include "tools/interface/green_plane.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/calibrate.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/io/image_io.h"
#include "tools/io/image_library.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/dng_tags.h"
#include "tools/support/fake_calibration.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using testing::ContentOf;
using ::testing::DoubleEq;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using tools::TiffTag;

// ---- Conversions.

TEST(GreenPlaneSweep, HasThePixelsOfTheGreenPlane) {
  calib::FocusSweep sweep;
  sweep.camera.sensor.width_px = 101;
  sweep.camera.sensor.height_px = 80;
  sweep.camera.sensor.pixel_pitch_mm = 0.004;
  sweep.camera.sensor.principal_point_px = {50.5, 20.5};  // between two pixels
  sweep.camera.statements["sensor.pixel_pitch_mm"] = {0.001, false};
  sweep.camera.statements["sensor.principal_point_px[0]"] = {4, false};
  sweep.camera.statements["lens.aperture_radius_mm"] = {0.1, false};
  sweep.camera.calibration.emplace();
  sweep.floor.given_px = Measured{0.6, 0.02};
  sweep.floor.from_px = 0.2;
  sweep.floor.to_px = 0.8;
  sweep.roi = {11, 20, 40, 31};  // columns 11 to 50, rows 20 to 50
  const calib::FocusSweep green = GreenPlaneSweep(sweep);
  EXPECT_EQ(green.sensor_px_per_px, 2);
  EXPECT_EQ(green.camera.sensor.width_px, 50);
  EXPECT_EQ(green.camera.sensor.height_px, 40);
  EXPECT_DOUBLE_EQ(green.camera.sensor.pixel_pitch_mm, 0.008);
  // Pixel 25 of the green plane is centred between the pixels 50 and 51.
  EXPECT_EQ(green.camera.sensor.principal_point_px, Eigen::Vector2d(25, 10));
  EXPECT_DOUBLE_EQ(green.camera.statements.at("sensor.pixel_pitch_mm").tolerance, 0.002);
  EXPECT_EQ(green.camera.statements.at("sensor.principal_point_px[0]").tolerance, 2);
  EXPECT_EQ(green.camera.statements.at("lens.aperture_radius_mm").tolerance, 0.1);
  EXPECT_FALSE(green.camera.calibration);
  EXPECT_DOUBLE_EQ(green.floor.given_px->value, 0.3);
  EXPECT_DOUBLE_EQ(green.floor.given_px->sigma, 0.01);
  EXPECT_DOUBLE_EQ(*green.floor.from_px, 0.1);
  EXPECT_DOUBLE_EQ(*green.floor.to_px, 0.4);
  // Its pixels that lie inside have the columns 12 to 49 and the rows 20 to 49 of the sensor.
  EXPECT_EQ(green.roi.x, 6);
  EXPECT_EQ(green.roi.y, 10);
  EXPECT_EQ(green.roi.width, 19);
  EXPECT_EQ(green.roi.height, 15);
}

TEST(ConvertToSensorPixels, ConvertsAllThatIsInPixels) {
  calib::Calibration green = tools::MakeUpCalibration(9, 380, 5).calibration;
  green.summary.blur_floor_px = calib::Result{0.5, 0.01, Eigen::Vector2d(0.4, 0.7)};
  green.diagnostics.blur.estimator = "relative spectrum";
  green.diagnostics.magnification = calib::MagnificationCheck{};
  green.diagnostics.magnification->period_px = 12;
  green.diagnostics.blur_slope_px_per_mm = model::Estimate{3, 0.1};
  green.diagnostics.field.tiles.resize(1);
  green.diagnostics.field.tiles[0].centre_px = {10, 0};
  green.diagnostics.target.relief.region = model::RegionOfInterest{3, 5, 40, 31};
  green.examples.resize(2);
  green.examples[0].is_edge = true;
  green.examples[0].x = {1};
  green.examples[1].x = {0.2};
  calib::Calibration found = green;
  ConvertToSensorPixels(&found);
  EXPECT_DOUBLE_EQ(found.summary.blur_floor_px->value, 1);
  EXPECT_DOUBLE_EQ(found.summary.blur_floor_px->sigma, 0.02);
  EXPECT_EQ(*found.summary.blur_floor_px->systematic, Eigen::Vector2d(0.8, 1.4));
  EXPECT_EQ(found.summary.blur_ratio->value, green.summary.blur_ratio->value);
  EXPECT_EQ(found.summary.image_distance_mm->value, green.summary.image_distance_mm->value);
  const calib::FrameMeasurement &frame = found.frames[3], &before = green.frames[3];
  EXPECT_DOUBLE_EQ(frame.blur_sigma_px, 2 * before.blur_sigma_px);
  EXPECT_DOUBLE_EQ(frame.blur_sigma_error_px, 2 * before.blur_sigma_error_px);
  EXPECT_DOUBLE_EQ(frame.source_blur_sigma_px, 2 * before.source_blur_sigma_px);
  EXPECT_DOUBLE_EQ(frame.mean_edge_slope, before.mean_edge_slope / 2);
  EXPECT_DOUBLE_EQ(frame.normalised_edge_slope, before.normalised_edge_slope / 2);
  EXPECT_DOUBLE_EQ(frame.statistics.top_gradient, before.statistics.top_gradient / 2);
  // d1, kappa, floor, offset: the covariance of the floor with itself has its square.
  const Eigen::MatrixXd &c = found.diagnostics.covariance, &b = green.diagnostics.covariance;
  EXPECT_DOUBLE_EQ(c(2, 2), 4 * b(2, 2));
  EXPECT_DOUBLE_EQ(c(1, 2), 2 * b(1, 2));
  EXPECT_DOUBLE_EQ(c(2, 1), 2 * b(2, 1));
  EXPECT_DOUBLE_EQ(c(0, 3), b(0, 3));
  EXPECT_DOUBLE_EQ(std::exp(found.diagnostics.sharpness.log_parabola[0]),
                   std::exp(green.diagnostics.sharpness.log_parabola[0]) / 2);
  EXPECT_EQ(found.diagnostics.field.tiles[0].centre_px, Eigen::Vector2d(20.5, 0.5));
  const model::RegionOfInterest& region = *found.diagnostics.target.relief.region;
  EXPECT_THAT((std::vector<int>{region.x, region.y, region.width, region.height}),
              ::testing::ElementsAre(6, 10, 80, 62));
  EXPECT_EQ(found.diagnostics.magnification->period_px, 24);
  EXPECT_DOUBLE_EQ(found.diagnostics.blur_slope_px_per_mm->value, 6);
  EXPECT_DOUBLE_EQ(found.diagnostics.blur_slope_px_per_mm->sigma, 0.2);
  EXPECT_THAT(found.examples[0].x, ::testing::ElementsAre(DoubleEq(2)));
  EXPECT_THAT(found.examples[1].x, ::testing::ElementsAre(DoubleEq(0.1)));
}

TEST(ConvertToSensorPixels, AllowsForTheDiagonalOfTheTwoSitesOnEdges) {
  calib::Calibration found = tools::MakeUpCalibration(9, 380, 5).calibration;
  found.summary.blur_floor_px = calib::Result{0.65, 0.01, std::nullopt};
  found.diagnostics.blur.estimator = "edges";
  ConvertToSensorPixels(&found);
  EXPECT_NEAR(found.summary.blur_floor_px->systematic->x(), 1.2, 1e-9);
  EXPECT_NEAR(found.summary.blur_floor_px->systematic->y(), std::sqrt(1.94), 1e-9);
  EXPECT_THAT(found.summary.warnings, ::testing::Contains(HasSubstr("green sites")));
}

// ---- A simulated sweep as a camera with a mosaic takes it.

// A DNG file whose mosaic has the values of a grey image: the sensor's colours are all the same.
std::string DngOf(const cv::Mat& grey) {
  std::string dng = ContentOf(THICKLENS_SOURCE_DIR "/tests/data/images/mosaic.dng");
  dng.resize(dng.size() + dng.size() % 2);
  const auto at = static_cast<std::uint32_t>(dng.size());
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const unsigned value = grey.at<std::uint16_t>(y, x);
      dng += static_cast<char>(value & 0xFFU);
      dng += static_cast<char>(value >> 8U);
    }
  }
  const auto width = static_cast<std::uint32_t>(grey.cols);
  const auto height = static_cast<std::uint32_t>(grey.rows);
  tools::DngTags tags;
  tags.sensor = {{256, TiffTag::kLong, {width}},   {257, TiffTag::kLong, {height}},
                 {273, TiffTag::kLong, {at}},      {278, TiffTag::kLong, {height}},
                 {50714, TiffTag::kShort, {0}},    {279, TiffTag::kLong, {2 * width * height}},
                 {50717, TiffTag::kShort, {65535}}};
  tags.main = {{50728, TiffTag::kRational, {1, 1, 1, 1, 1, 1}}};
  return tools::DngEdit(std::move(dng)).With(tags);
}

// The sweep of SmallBenchSimulation with four times the pixels, in DNG files.
class GreenPlaneTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!io::HasImageLibrary()) return;
    shared_ = std::make_unique<TemporaryFolder>();
    SweepSimulation simulation = testing::SmallBenchSimulation();
    model::Sensor& sensor = simulation.camera.sensor;
    sensor.width_px = sensor.height_px = 288;
    sensor.principal_point_px.setConstant(143.5);
    simulation.bits = 16;
    simulated_ = std::make_unique<Sweep>(SimulateSweep(simulation, *shared_ / "sweep"));
    raw_ = std::make_unique<Sweep>(*simulated_);
    for (std::size_t i = 0; i < raw_->description.frames.size(); ++i) {
      std::string& image = raw_->description.frames[i].image;
      image = shared_->Put(std::to_string(i) + ".dng", DngOf(io::ReadImageFile(image)));
    }
    raw_->description.floor.given_px = Measured{0.5, 0.01};
  }
  static void TearDownTestSuite() {
    raw_.reset();
    simulated_.reset();
    shared_.reset();
  }
  void SetUp() override {
    if (!io::HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts";
  }
  static Sweep By(model::SweepRaw raw) {
    Sweep sweep = *raw_;
    sweep.description.raw = raw;
    return sweep;
  }
  static CalibrateOptions Fast() {
    CalibrateOptions options;
    options.map_field = false;
    return options;
  }

  static std::unique_ptr<TemporaryFolder> shared_;
  static std::unique_ptr<Sweep> simulated_, raw_;
};

std::unique_ptr<TemporaryFolder> GreenPlaneTest::shared_;
std::unique_ptr<Sweep> GreenPlaneTest::simulated_, GreenPlaneTest::raw_;

TEST_F(GreenPlaneTest, FramesAreTheMeansOfTheTwoGreenSites) {
  const cv::Mat mosaic = io::ReadImageFile(simulated_->description.frames[4].image);
  io::FrameFiles files(raw_->description.frames, std::nullopt, io::RawTreatment::kMosaicGreen);
  const cv::Mat green = files.Read(4);
  ASSERT_EQ(green.type(), CV_16UC1);
  ASSERT_EQ(green.size(), cv::Size(144, 144));
  for (int y = 0; y < green.rows; y += 7) {
    for (int x = 0; x < green.cols; ++x) {
      const double mean = (mosaic.at<std::uint16_t>(2 * y, 2 * x + 1) +
                           mosaic.at<std::uint16_t>(2 * y + 1, 2 * x)) /
                          2.0;
      EXPECT_NEAR(green.at<std::uint16_t>(y, x), mean, 0.6);
    }
  }
}

// The truth: kappa 0.45, and d1 of 60 mm for a lens of 50 mm that is focused at 300 mm.
TEST_F(GreenPlaneTest, BothMethodsFindTheSameCamera) {
  const Calibration whole = Calibrate(By(model::SweepRaw::kDemosaiced), Fast());
  const Calibration green = Calibrate(By(model::SweepRaw::kGreen), Fast());
  for (const Calibration* found : {&whole, &green}) {
    ASSERT_TRUE(found->summary.image_distance_mm && found->summary.blur_ratio) << found->refusal;
    EXPECT_NEAR(found->summary.image_distance_mm->value, 60,
                5 * found->summary.image_distance_mm->sigma);
    EXPECT_NEAR(found->summary.blur_ratio->value, 0.45, 5 * found->summary.blur_ratio->sigma);
  }
  // The frames are the same, and so is most of their noise.
  EXPECT_NEAR(green.summary.image_distance_mm->value, whole.summary.image_distance_mm->value,
              whole.summary.image_distance_mm->sigma);
  EXPECT_NEAR(green.summary.blur_ratio->value, whole.summary.blur_ratio->value,
              1.5 * whole.summary.blur_ratio->sigma);
  EXPECT_LT(green.summary.blur_ratio->sigma, 1.5 * whole.summary.blur_ratio->sigma);
  // The camera is that of the whole sensor, and the blur has its pixels.
  EXPECT_EQ(green.camera.sensor.width_px, 288);
  EXPECT_EQ(green.camera.sensor.pixel_pitch_mm, simulated_->camera.sensor.pixel_pitch_mm);
  EXPECT_EQ(green.camera.sensor.principal_point_px, Eigen::Vector2d(143.5, 143.5));
  ASSERT_TRUE(green.summary.blur_floor_px && whole.summary.blur_floor_px);
  EXPECT_NEAR(green.summary.blur_floor_px->value, whole.summary.blur_floor_px->value, 0.02);
  const calib::FrameMeasurement &far_green = green.frames.front(), &far = whole.frames.front();
  ASSERT_GT(far.blur_sigma_px, 1);
  EXPECT_NEAR(far_green.blur_sigma_px / far.blur_sigma_px, 1, 0.03);
}

TEST_F(GreenPlaneTest, AFloorThatIsNotStatedHasTheSameInterval) {
  for (const auto raw : {model::SweepRaw::kDemosaiced, model::SweepRaw::kGreen}) {
    Sweep sweep = By(raw);
    sweep.description.floor = {};
    const calib::CalibrationSummary found = Calibrate(sweep, Fast()).summary;
    EXPECT_THAT(found.warnings, ::testing::Contains(HasSubstr("values from 0 to ")));
    // 1 px of the sensor, or more where the texture does not exclude it, but not 1 px of the plane.
    ASSERT_TRUE(found.blur_floor_px && found.blur_floor_px->systematic);
    EXPECT_EQ(found.blur_floor_px->systematic->x(), 0);
    EXPECT_GE(found.blur_floor_px->systematic->y(), 0.999);
    EXPECT_LT(found.blur_floor_px->systematic->y(), 2);
  }
}

TEST_F(GreenPlaneTest, OtherFramesAreRefusedByName) {
  Sweep images = *simulated_;
  images.description.raw = model::SweepRaw::kGreen;
  EXPECT_EQ(FieldOfOptionError([&] { ExamineFrames(images); }), "raw");
  EXPECT_THAT(ErrorOf([&] { Calibrate(images, Fast()); }),
              AllOf(HasSubstr("frame_000.png"), HasSubstr("raw files only")));
  // The first frame is a raw file, and another one is none.
  Sweep mixed = By(model::SweepRaw::kGreen);
  mixed.description.frames[5].image = simulated_->description.frames[5].image;
  EXPECT_THAT(ErrorOf([&] { Calibrate(mixed, Fast()); }),
              AllOf(HasSubstr("frame_005.png"), HasSubstr("a raw file is expected")));
  Sweep small = By(model::SweepRaw::kGreen);
  small.camera.sensor.width_px = 200;
  EXPECT_THAT(ErrorOf([&] { Calibrate(small, Fast()); }),
              AllOf(HasSubstr(".dng"), HasSubstr("144 x 144"), HasSubstr("200 x 288")));
}

}  // namespace
}  // namespace thicklens
