// Sweeps of a lens that distorts: the frames are undistorted before they are measured.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_correction.h"
#include "thicklens/model/lens_distortion.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr double kFocalPx = 300;

model::LensDistortion Radial(const cv::Size& size, double k1) {
  model::LensDistortion d;
  d.width_px = size.width;
  d.height_px = size.height;
  d.focal_length_px = {kFocalPx, kFocalPx};
  d.principal_point_px = {0.5 * (size.width - 1), 0.5 * (size.height - 1)};
  d.coefficients = {k1, 0, 0, 0};
  return d;
}

// The frame that a lens with r' = r (1 + k1 r^2) makes of what a perfect one would show: each of
// its pixels shows the place r that bisection finds, apart from the code.
cv::Mat DistortedFrame(const cv::Mat& frame, double k1) {
  cv::Mat map_x(frame.size(), CV_32F), map_y(frame.size(), CV_32F), light, out;
  const double x0 = 0.5 * (frame.cols - 1), y0 = 0.5 * (frame.rows - 1);
  for (int y = 0; y < frame.rows; ++y) {
    for (int x = 0; x < frame.cols; ++x) {
      const double distorted = std::hypot(x - x0, y - y0) / kFocalPx;
      double low = 0, high = 1;
      for (int i = 0; i < 40; ++i) {
        const double r = (low + high) / 2;
        (r * (1 + k1 * r * r) < distorted ? low : high) = r;
      }
      const double shrink = distorted > 0 ? low / distorted : 1;
      map_x.at<float>(y, x) = static_cast<float>(x0 + shrink * (x - x0));
      map_y.at<float>(y, x) = static_cast<float>(y0 + shrink * (y - y0));
    }
  }
  frame.convertTo(light, CV_32F);
  cv::remap(light, out, map_x, map_y, cv::INTER_LANCZOS4, cv::BORDER_REFLECT_101);
  out.convertTo(out, frame.type());
  return out;
}

class UndistortedSweep : public ::testing::Test {
 protected:
  static model::SweepSimulationOptions Options() {
    model::SweepSimulationOptions options = testing::SweepCase("ii", 256, 3);
    options.camera.sensor.transfer = model::TransferCurve::Linear();
    return options;
  }
  static testing::SimulatedSweep Distorted(double k1) {
    testing::SimulatedSweep sweep = testing::Simulate(Options());
    for (cv::Mat& frame : *sweep.stored) frame = DistortedFrame(frame, k1);
    return sweep;
  }
  static Calibration Calibrated(const FocusSweep& sweep) {
    CalibrationOptions options;
    options.map_field = false;
    return Calibrate(sweep, options);
  }
};

TEST_F(UndistortedSweep, GreyAndChannelsAreUndistortedAfterTheCorrection) {
  constexpr double kPincushion = 0.3;
  testing::SimulatedSweep straight = testing::Simulate(Options());
  testing::SimulatedSweep bent = Distorted(kPincushion);
  const cv::Rect middle(48, 48, 160, 160);
  // Without the noise, which both interpolations change.
  const auto difference = [&](const cv::Mat& a, const cv::Mat& b) {
    cv::Mat smooth_a, smooth_b;
    cv::GaussianBlur(a.clone(), smooth_a, {}, 1.5);
    cv::GaussianBlur(b.clone(), smooth_b, {}, 1.5);
    return cv::norm(smooth_a, smooth_b, cv::NORM_L2);
  };
  const std::size_t index = straight.sweep.frames.size() / 2;
  const auto sharp = static_cast<int>(index);
  const cv::Mat plain = LinearGrey(straight.frame(sharp), straight.sweep, index)(middle);
  FocusSweep sweep = bent.sweep;
  const cv::Mat stored = bent.frame(sharp);
  const double before = difference(LinearGrey(stored, sweep, index)(middle), plain);
  sweep.camera.distortion = Radial(stored.size(), kPincushion);
  EXPECT_LT(difference(LinearGrey(stored, sweep, index)(middle), plain), 0.2 * before);
  sweep.roi = {48, 48, 160, 160};
  const cv::Mat part = LinearGrey(stored, sweep, index);
  EXPECT_EQ(part.size(), middle.size());
  EXPECT_LT(difference(part, plain), 0.2 * before);
  EXPECT_LT(cv::norm(LinearChannel(stored, sweep, index, 0), part, cv::NORM_INF), 1e-6);
  // A dark of the sensor is where the sensor is: it is subtracted before.
  cv::Mat dark = cv::Mat::zeros(stored.size(), CV_32F);
  cv::rectangle(dark, {20, 20, 12, 12}, cv::Scalar(0.2), cv::FILLED);
  cv::Mat lit = stored.clone(), light;
  const double full = stored.depth() == CV_8U ? 255 : 65535;
  lit.convertTo(light, CV_32F, 1 / full);
  cv::Mat(light + dark).convertTo(lit, stored.type(), full);
  sweep.roi = {};
  const cv::Mat expected = LinearGrey(stored, sweep, index);
  sweep.correction = std::make_shared<const FrameCorrection>(dark, cv::Mat(), cv::Mat());
  EXPECT_LT(cv::norm(LinearGrey(lit, sweep, index), expected, cv::NORM_INF), 3 / full);
}

// The undistorted frame of a pincushion has corners that the photograph does not show.
TEST_F(UndistortedSweep, ThePartThatTheFramesShowIsMeasured) {
  model::Camera camera = Options().camera;
  camera.distortion = Radial({camera.sensor.width_px, camera.sensor.height_px}, 0.2);
  model::SweepFile file;
  const model::RegionOfInterest cut = MakeFocusSweep(file, camera).roi;
  EXPECT_GT(cut.width, camera.sensor.width_px / 2);
  EXPECT_LT(cut.width, camera.sensor.width_px);
  file.roi = {100, 100, 40, 40};
  EXPECT_EQ(MakeFocusSweep(file, camera).roi.width, 40);
  file.roi = {};
  camera.distortion = Radial({camera.sensor.width_px, camera.sensor.height_px}, -0.2);
  EXPECT_EQ(MakeFocusSweep(file, camera).roi.width, 0);  // the whole field
}

TEST_F(UndistortedSweep, HasTheResultOfALensWithoutDistortion) {
  constexpr double kPincushion = 0.25;  // 9 % at the corner
  const Calibration clean = Calibrated(testing::Simulate(Options()).sweep);
  const testing::SimulatedSweep bent = Distorted(kPincushion);
  // Without the file it is refused, or a warning says that the frames look distorted.
  const Calibration distorted = Calibrated(bent.sweep);
  const bool is_refused = distorted.summary.outcome == Outcome::kRefused;
  EXPECT_THAT(
      is_refused ? std::vector<std::string>{distorted.summary.reason} : distorted.summary.warnings,
      Contains(HasSubstr("distort")));
  FocusSweep sweep = bent.sweep;
  const cv::Size size(sweep.camera.sensor.width_px, sweep.camera.sensor.height_px);
  sweep.camera.distortion = Radial(size, kPincushion);
  sweep.roi = {40, 40, size.width - 80, size.height - 80};
  const Calibration found = Calibrated(sweep);
  ASSERT_NE(found.summary.outcome, Outcome::kRefused) << found.summary.reason;
  ASSERT_TRUE(found.summary.image_distance_mm && found.summary.blur_ratio);
  const Result& d1 = *found.summary.image_distance_mm;
  const Result& kappa = *found.summary.blur_ratio;
  const Result& clean_kappa = *clean.summary.blur_ratio;
  EXPECT_NEAR(d1.value, bent.truth.image_distance_mm, 3 * d1.sigma);
  EXPECT_NEAR(kappa.value, bent.truth.blur_ratio, 3 * kappa.sigma);
  EXPECT_NEAR(kappa.value, clean_kappa.value, 3 * std::hypot(kappa.sigma, clean_kappa.sigma));
  for (const std::string& warning : found.summary.warnings)
    EXPECT_THAT(warning, ::testing::Not(HasSubstr("like distorted images")));
  const model::Camera camera = CalibratedCamera(sweep.camera, found, false);
  EXPECT_TRUE(camera.calibration->evidence.undistorted);
  EXPECT_TRUE(camera.distortion);
}

}  // namespace
}  // namespace thicklens::calib
