// A photograph and its depth map are undistorted by the camera's distortion before an estimate.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/distortion.h"
#include "thicklens/estimate.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::ErrorOf;

constexpr int kPhotoWidth = 120, kPhotoHeight = 90;
constexpr double kLengthPx = 110, kRadial = 0.18;  // 8.4 % at the corner
constexpr double kMiddleX = 59.5, kMiddleY = 44.5, kEdgeX = 80;
constexpr float kNearMm = 900, kFarMm = 1100;

LensDistortion Pincushion() {
  LensDistortion d;
  d.width_px = kPhotoWidth;
  d.height_px = kPhotoHeight;
  d.focal_length_px = {kLengthPx, kLengthPx};
  d.principal_point_px = {kMiddleX, kMiddleY};
  d.coefficients = {kRadial, 0, 0, 0};
  return d;
}

// The place that a pixel of the photograph shows: r of r' = r (1 + k r^2), by bisection.
std::pair<double, double> PlaceShownAt(int x, int y) {
  const double u = (x - kMiddleX) / kLengthPx, v = (y - kMiddleY) / kLengthPx;
  const double far = std::hypot(u, v);
  double low = 0, high = 1;
  for (int i = 0; i < 50; ++i) {
    const double r = (low + high) / 2;
    (r * (1 + kRadial * r * r) < far ? low : high) = r;
  }
  const double shrink = far > 0 ? low / far : 1;
  return {kMiddleX + kLengthPx * u * shrink, kMiddleY + kLengthPx * v * shrink};
}

double SceneLight(double x, double y) {
  return 0.4 + 0.2 * std::sin(0.35 * x + 0.1 * y) + 0.1 * std::cos(0.3 * y);
}

class UndistortedEstimate : public ::testing::Test {
 protected:
  UndistortedEstimate() {
    std::vector<float> light, depth;
    for (int y = 0; y < kPhotoHeight; ++y) {
      for (int x = 0; x < kPhotoWidth; ++x) {
        const auto [at_x, at_y] = PlaceShownAt(x, y);
        light.push_back(static_cast<float>(SceneLight(at_x, at_y)));
        depth.push_back(at_x < kEdgeX ? kNearMm : kFarMm);
      }
    }
    photo_ = Image::FromLight(kPhotoWidth, kPhotoHeight, ChannelOrder::kGrey, light,
                              TransferCurve::Linear(), "photo");
    depth_ = {kPhotoWidth, kPhotoHeight, depth, false, {}, "depth"};
    depth_.meaning.unit = LengthUnit::kMillimetre;
    camera_ = testing::SmallCamera(kPhotoWidth, kPhotoHeight, {kMiddleX, kMiddleY});
    camera_.distortion = Pincushion();
    camera_.calibration->evidence.undistorted = true;
    options_.views = {3, 3};
    options_.smooth_depth = false;
  }

  Problem Prepared(EstimateDiagnostics* found) {
    RunControl run;
    run.notice = [this](const Notice& notice) { notices_.push_back(notice.text); };
    return PrepareProblem(photo_, depth_, camera_, options_, found, run);
  }
  // The largest difference of the photograph from the undistorted scene in the middle.
  static double LargestError(const model::LinearImage& light, int origin_x = 0, int origin_y = 0) {
    double largest = 0;
    for (int y = 12; y < light.height_px - 12; ++y) {
      for (int x = 16; x < light.width_px - 16; ++x) {
        largest = std::max(largest, std::abs(static_cast<double>(light.at(x, y, 0)) -
                                             SceneLight(x + origin_x, y + origin_y)));
      }
    }
    return largest;
  }

  Image photo_;
  DepthMap depth_;
  Camera camera_;
  EstimateOptions options_;
  std::vector<std::string> notices_;
};

TEST_F(UndistortedEstimate, PhotographAndDepthAreThoseOfAPerfectLens) {
  EstimateDiagnostics found;
  const Problem problem = Prepared(&found);
  EXPECT_GT(LargestError(photo_.light()), 0.1);
  EXPECT_LT(LargestError(problem.photograph()), 0.01);
  EXPECT_THAT(found.undistorted, HasSubstr("OpenCV model with 4 coefficients"));
  EXPECT_GT(found.without_source_share, 0.05);
  EXPECT_EQ(found.holes_filled, static_cast<std::size_t>(std::lround(found.without_source_share *
                                                                     kPhotoWidth * kPhotoHeight)));
  // No edge to black appears where the photograph ends.
  EXPECT_GT(problem.photograph().at(0, 0, 0), 0.1F);
  // The edge of the depth is straight, and no depth lies between the two.
  const std::vector<float>& disparity = problem.disparity();
  const float near = disparity[45 * kPhotoWidth + 60], far = disparity[45 * kPhotoWidth + 100];
  EXPECT_NE(near, far);
  for (int y = 10; y < kPhotoHeight - 10; ++y) {
    for (int x = 15; x < kPhotoWidth - 15; ++x) {
      const float value = disparity[static_cast<std::size_t>(y * kPhotoWidth + x)];
      ASSERT_TRUE(value == near || value == far) << x << " " << y;
      if (std::abs(x - kEdgeX) > 1) {
        ASSERT_EQ(value == near, x < kEdgeX) << x << " " << y;
      }
    }
  }
  // The light field is that of a camera without distortion.
  EXPECT_FALSE(problem.camera()->distortion);
  EXPECT_THAT(notices_, Contains(AllOf(HasSubstr("undistorted"), HasSubstr("no source"))));
}

TEST_F(UndistortedEstimate, ACropIsCutFromTheUndistortedImages) {
  options_.crop = PixelRect{20, 10, 60, 50};
  EstimateDiagnostics found;
  const Problem problem = Prepared(&found);
  EXPECT_EQ(problem.width_px(), 60);
  EXPECT_LT(LargestError(problem.photograph(), 20, 10), 0.01);
}

// Where the photograph continues a clipped corner, it is no more than a lower bound either.
TEST_F(UndistortedEstimate, ClippedValuesAreContinuedLikeThePhotograph) {
  constexpr int kClippedPx = 12;
  std::vector<std::uint16_t> values;
  for (int y = 0; y < kPhotoHeight; ++y) {
    for (int x = 0; x < kPhotoWidth; ++x) {
      const bool is_clipped = x < kClippedPx && y < kClippedPx;
      const float light = photo_.light().at(x, y, 0);
      values.push_back(static_cast<std::uint16_t>(is_clipped ? 255 : std::lround(255 * light)));
    }
  }
  photo_ = Image::FromEncoded(kPhotoWidth, kPhotoHeight, ChannelOrder::kGrey, 8, std::move(values),
                              TransferCurve::Linear(), "photo");
  EstimateDiagnostics found;
  const Problem problem = Prepared(&found);
  ASSERT_FALSE(problem.input().clipped.empty());
  EXPECT_GT(found.without_source_share, 0.05);
  for (const auto& [x, y] : {std::pair{0, 0}, {2, 1}, {1, 3}}) {
    EXPECT_GT(problem.photograph().at(x, y, 0), 0.98F) << x << " " << y;
    EXPECT_EQ(problem.input().clipped[static_cast<std::size_t>(y * kPhotoWidth + x)], 1)
        << x << " " << y;
  }
  EXPECT_EQ(problem.input().clipped[45 * kPhotoWidth + 60], 0);
  EXPECT_THAT(notices_, Contains(HasSubstr("of its values are clipped")));
  // A part without that corner has no clipped values, of which nothing is said then.
  notices_.clear();
  for (const ClippedHighlights meaning : {ClippedHighlights::kBounds, ClippedHighlights::kData}) {
    options_.clipped = meaning;
    options_.crop = PixelRect{50, 40, 60, 40};
    EXPECT_THAT(Prepared(&found).input().clipped, IsEmpty());
    EXPECT_EQ(found.clipping.share, 0);
    EXPECT_THAT(notices_, Not(Contains(HasSubstr("clipped"))));
  }
}

TEST_F(UndistortedEstimate, APartOfTheSensorHasItsPartOfTheDistortion) {
  const PixelRect part{10, 5, 90, 70};
  photo_ = photo_.Cropped(part);
  depth_ = depth_.Cropped(part);
  options_.sensor_origin = SensorOrigin{10, 5};
  EstimateDiagnostics found;
  EXPECT_LT(LargestError(Prepared(&found).photograph(), 10, 5), 0.01);
}

TEST_F(UndistortedEstimate, ImagesThatAreUndistortedAlreadyStay) {
  options_.undistort = false;
  EstimateDiagnostics found;
  EXPECT_EQ(Prepared(&found).photograph().values, photo_.light().values);
  EXPECT_THAT(found.undistorted, IsEmpty());
}

TEST_F(UndistortedEstimate, ACalibrationOfOtherFramesIsReported) {
  EstimateDiagnostics found;
  camera_.calibration->evidence.undistorted = false;
  camera_.calibration->evidence.method = "joint-blur-fit";
  Prepared(&found);
  EXPECT_THAT(notices_, Contains(HasSubstr("frames that were not undistorted")));
  notices_.clear();
  camera_.calibration->evidence.undistorted = true;
  camera_.distortion.reset();
  Prepared(&found);
  EXPECT_THAT(notices_, Contains(HasSubstr("states no lens.distortion any more")));
  EXPECT_THAT(found.undistorted, IsEmpty());
}

TEST_F(UndistortedEstimate, MapsOfAnotherSizeAreBroughtToThePhotographBefore) {
  const DepthMap whole = depth_;
  depth_ = whole.Cropped({0, 0, 60, 45});
  EstimateDiagnostics found;
  Prepared(&found);
  EXPECT_THAT(found.depth_fit, HasSubstr("60 x 45 px brought to"));
  EXPECT_THAT(found.undistorted, HasSubstr("OpenCV model"));
  depth_ = whole.Cropped({0, 0, 60, 30});
  EXPECT_THAT(ErrorOf([&] { Prepared(&found); }),
              AllOf(HasSubstr("depth"), HasSubstr("60x30"), HasSubstr("depth_fit.part")));
}

TEST(DoubtOfDistortion, ComparesTheFocalLengths) {
  Camera camera = testing::SmallCamera(kPhotoWidth, kPhotoHeight, {kMiddleX, kMiddleY});
  EXPECT_THAT(DoubtOfDistortion(camera), IsEmpty());
  camera.distortion = Pincushion();
  const double own_px =
      (camera.image_distance_mm() - camera.lens.lens_thickness_mm) / camera.sensor.pixel_pitch_mm;
  camera.distortion->focal_length_px.setConstant(own_px);
  EXPECT_THAT(DoubtOfDistortion(camera), IsEmpty());
  camera.distortion->focal_length_px.setConstant(1.5 * own_px);
  EXPECT_THAT(DoubtOfDistortion(camera), AllOf(HasSubstr("px"), HasSubstr("image distance")));
  // Near objects have a longer image distance, which is not known before a calibration.
  camera.calibration.reset();
  EXPECT_THAT(DoubtOfDistortion(camera), Not(HasSubstr("image distance")));
}

}  // namespace
}  // namespace thicklens
