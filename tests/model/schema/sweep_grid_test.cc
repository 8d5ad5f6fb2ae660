// The grid of a sweep and the covariance of a distortion in files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/error_message.h"
#include "tests/model/schema/sweep_folder.h"
#include "tests/support/test_cameras.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::SweepFolder;

TEST_F(SweepFolder, AGridIsReadAndWritten) {
  EXPECT_FALSE(Read(frames_).target_grid);
  const SweepFile sweep =
      Read(frames_ +
           "target_grid: {pattern: charuco, columns: 11, rows: 8, square_mm: 10, marker_mm: 6, "
           "dictionary: 5x5_100}\ngrid_views: [a.png, b.png]\nstage_alignment_deg: 0.2\n");
  ASSERT_TRUE(sweep.target_grid);
  EXPECT_EQ(sweep.target_grid->pattern, GridPattern::kCharuco);
  EXPECT_EQ(sweep.target_grid->columns, 11);
  EXPECT_EQ(sweep.target_grid->rows, 8);
  EXPECT_EQ(sweep.target_grid->marker_mm, 6);
  EXPECT_EQ(sweep.target_grid->dictionary, "5x5_100");
  ASSERT_EQ(sweep.grid_views.size(), 2U);
  EXPECT_THAT(sweep.grid_views[1], HasSubstr("b.png"));
  EXPECT_EQ(sweep.stage_alignment_deg.value(), 0.2);
  const std::string yaml = SweepToYaml(sweep);
  EXPECT_THAT(yaml, HasSubstr("pattern: charuco"));
  EXPECT_THAT(yaml, HasSubstr("dictionary: 5x5_100"));
  EXPECT_THAT(yaml, HasSubstr("stage_alignment_deg: 0.2"));
  const SweepFile board =
      Read(frames_ + "target_grid: {pattern: checkerboard, columns: 9, rows: 7, square_mm: 2.5}\n");
  EXPECT_EQ(board.target_grid->pattern, GridPattern::kChequerboard);
}

TEST_F(SweepFolder, AWrongGridIsRefusedAtItsPlace) {
  EXPECT_THAT(ErrorWith(frames_ + "target_grid: charuco\n"), HasSubstr("a map with pattern"));
  EXPECT_THAT(
      ErrorWith(frames_ + "target_grid: {pattern: circles, columns: 2, rows: 7, square_mm: 3}\n"),
      HasSubstr("columns must be from 3 to 200, found 2"));
  EXPECT_THAT(ErrorWith(frames_ + "target_grid: {pattern: circles, columns: 9, rows: 7, square_mm: "
                                  "3, marker_mm: 2}\n"),
              HasSubstr("only the pattern charuco has markers"));
  EXPECT_THAT(ErrorWith(frames_ + "grid_views: [a.png]\n"), HasSubstr("target_grid is missing"));
  EXPECT_THAT(ErrorWith(frames_ + "stage_alignment_deg: 60\n"), HasSubstr("at most 45 degrees"));
}

LensDistortion WithCovariance() {
  LensDistortion distortion;
  distortion.width_px = 640;
  distortion.height_px = 480;
  distortion.focal_length_px = {1500, 1500};
  distortion.principal_point_px = {330, 230};
  distortion.coefficients = {-0.2, 0.05, 0.001, -0.001, 0};
  distortion.covariance = Eigen::MatrixXd::Identity(8, 8);
  distortion.covariance(0, 1) = distortion.covariance(1, 0) = 0.25;
  return distortion;
}

TEST(DistortionCovariance, IsWrittenAndReadBack) {
  Camera camera = thicklens::testing::WithMethod(
      thicklens::testing::TestCamera("c", thicklens::testing::ThinLens(10, 2),
                                     thicklens::testing::CentredSensor(640, 480, 0.006), {11, 0}));
  camera.distortion = WithCovariance();
  const std::string yaml = CameraToYaml(camera);
  const Camera back = ParseCamera(yaml, "c.yaml");
  ASSERT_TRUE(back.distortion);
  EXPECT_TRUE(back.distortion->covariance.isApprox(camera.distortion->covariance));
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string other = yaml;
    other.replace(other.find(from), from.size(), to);
    return ErrorOf([&] { ParseCamera(other, "c.yaml"); });
  };
  EXPECT_THAT(changed("principal_point_x_px", "principal_point_z_px"),
              HasSubstr("principal_point_x_px"));
  EXPECT_THAT(changed("0.25", "0.5"), HasSubstr("must be symmetric"));
}

// Focal length and principal point have units of px, and the coefficients none.
TEST(DistortionCovariance, IsScaledWithTheImage) {
  const LensDistortion half = WithCovariance().ScaledTo(320, 240);
  EXPECT_DOUBLE_EQ(half.covariance(0, 0), 0.25);
  EXPECT_DOUBLE_EQ(half.covariance(0, 1), 0.0625);
  EXPECT_DOUBLE_EQ(half.covariance(5, 5), 1);
  LensDistortion wrong = WithCovariance();
  wrong.covariance = Eigen::MatrixXd::Identity(7, 7);
  std::string why;
  EXPECT_FALSE(wrong.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("8 x 8 finite numbers are expected"));
}

}  // namespace
}  // namespace thicklens::model
