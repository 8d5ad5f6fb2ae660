#include "thicklens/calib/sweep_transfer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calib/drawn_edges.h"
#include "calib/imaging/painted_sweep.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::DrawnEdge;
using thicklens::testing::EncodedBytes;
using thicklens::testing::Paint;
using thicklens::testing::PaintedOptions;
using thicklens::testing::PaintedSweep;

PaintedSweep SmallSweep() {
  PaintedOptions options;
  options.size_px = 160;
  options.depths_mm = {396, 400, 404};
  return Paint(options, [](double x, double y) { return x * x + y * y <= 1 ? 1.0 : 0.0; });
}

// Without an edge the curve is that of the fitted floor, defocus and pixel.
TEST(SweepTransfer, IsModelledForATexture) {
  const PaintedSweep painted = SmallSweep();
  const SweepTransfer found = MeasureSweepTransfer(painted.sweep, painted.calibration, 1);
  ASSERT_TRUE(found.done) << found.message;
  ASSERT_EQ(found.frames.size(), 3U);
  ASSERT_TRUE(found.at_focus);
  const FrameTransfer& focus = found.frames[1];
  EXPECT_FALSE(focus.is_measured);
  for (std::size_t i = 0; i <= 50; i += 10) {
    const double f = static_cast<double>(i) / 100;
    EXPECT_NEAR(focus.curve.transfer[i],
                model::GaussianTransfer(0.3, f, 0) * model::PixelBoxTransfer(f, 0), 1e-6);
    EXPECT_NEAR(found.at_focus->curve.transfer[i], focus.curve.transfer[i], 1e-6);
    const double radius_px =
        model::BlurRadiusMm(painted.sweep.camera.lens,
                            painted.calibration.summary.image_distance_mm->value, 404) /
        0.005;
    EXPECT_NEAR(found.frames[2].curve.transfer[i],
                std::abs(model::GaussianTransfer(0.3, f, 0) * model::DiscTransfer(radius_px, f, 0) *
                         model::PixelBoxTransfer(f, 0)),
                1e-6);
  }
  EXPECT_GT(focus.mtf50->value, found.frames[0].mtf50->value);
  EXPECT_GT(focus.mtf50->value, found.frames[2].mtf50->value);
}

TEST(SweepTransfer, IsMeasuredAtEdges) {
  PaintedSweep painted = SmallSweep();
  painted.sweep.target = model::SweepTarget::kKnifeEdge;
  const double sigmas_px[] = {3, 0.8, 2};
  for (std::size_t i = 0; i < 3; ++i) {
    painted.stored->at(i) =
        EncodedBytes(DrawnEdge(160, 5, sigmas_px[i], 0.1, 0.8), 1, static_cast<unsigned>(i + 1));
  }
  painted.calibration.frames[2].rejection = "rejected by a test";
  const SweepTransfer found = MeasureSweepTransfer(painted.sweep, painted.calibration, 2);
  ASSERT_TRUE(found.done) << found.message;
  ASSERT_EQ(found.frames.size(), 2U);
  for (const FrameTransfer& frame : found.frames) {
    EXPECT_TRUE(frame.is_measured);
    EXPECT_EQ(frame.edges, 1);
    ASSERT_TRUE(frame.mtf50);
    const double f = frame.mtf50->value;
    EXPECT_NEAR(
        model::GaussianTransfer(sigmas_px[frame.frame], f, 0) * model::PixelBoxTransfer(f, 0), 0.5,
        0.02);
  }
}

// m = f1/(zf - f1): 1 mm in the plane of focus is m mm on the sensor.
TEST(SweepTransfer, UnitsAreThoseOfSensorAndObject) {
  model::Camera camera = thicklens::testing::PaintedCamera(160);
  EXPECT_FALSE(TransferUnitsOf(camera).object_lp_per_mm);
  EXPECT_DOUBLE_EQ(TransferUnitsOf(camera).sensor_lp_per_mm, 200);
  camera.calibration.emplace();
  camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(camera.lens, 400), 0};
  ASSERT_TRUE(TransferUnitsOf(camera).object_lp_per_mm);
  EXPECT_NEAR(*TransferUnitsOf(camera).object_lp_per_mm, 200 * 50 / 350.0, 1e-9);
}

}  // namespace
}  // namespace thicklens::calib
