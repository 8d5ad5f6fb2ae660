// Tests the way from a sweep to a camera to a photograph: the calibrated camera renders the blur
// that was simulated, whatever law the pupil followed.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/estimator/render.h"

namespace thicklens::tools {
namespace {

constexpr double kSpotSigmaPx = 2.5;

// The views of a small Gaussian spot at a depth on the axis.
model::LightField SpotAt(const model::Camera& camera, int views, double depth_mm) {
  model::LightField field;
  field.camera = camera;
  field.grid = model::DefaultGrid(camera, views, views);
  field.u_count = field.v_count = views;
  field.s_count = camera.sensor.width_px;
  field.t_count = camera.sensor.height_px;
  field.channels = 1;
  field.weights = model::ApertureWeights(model::ApertureShapeOf(camera.psf), views, views);
  const double disparity_px = model::DisparityPx(camera, field.grid->u_step_mm, depth_mm);
  const Eigen::Vector2d& axis_px = camera.sensor.principal_point_px;
  for (int l = 0; l < views; ++l) {
    for (int k = 0; k < views; ++k) {
      for (int y = 0; y < field.t_count; ++y) {
        for (int x = 0; x < field.s_count; ++x) {
          // The point at x in the centre view is at x - a d in view a.
          const Eigen::Vector2d beside(x - axis_px.x() + field.u_offset(k) * disparity_px,
                                       y - axis_px.y() + field.v_offset(l) * disparity_px);
          field.values.push_back(static_cast<float>(
              std::exp(-beside.squaredNorm() / (2 * kSpotSigmaPx * kSpotSigmaPx))));
        }
      }
    }
  }
  return field;
}

// The second moment along x about the centroid, px^2.
double VarianceAlongX(const model::LinearImage& image) {
  double sum = 0, first = 0, second = 0;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double value = image.values[static_cast<std::size_t>(y * image.width_px + x)];
      sum += value;
      first += value * x;
      second += value * x * x;
    }
  }
  return second / sum - std::pow(first / sum, 2);
}

TEST(BlurRoundTrip, RendersTheSimulatedBlurUnderAnyPupilLaw) {
  for (const model::PupilLaw law : model::AllPupilLaws()) {
    SCOPED_TRACE(model::PupilLawName(law));
    model::SweepSimulationOptions options = testing::SweepCase("iii", 160, 31);
    options.pupil_law = law;
    testing::SimulatedSweep simulated = testing::Simulate(options);
    testing::GiveFloor(&simulated);
    calib::CalibrationOptions how;
    how.map_field = false;
    const calib::Calibration found = calib::Calibrate(simulated.sweep, how);
    ASSERT_EQ(found.summary.outcome, calib::Outcome::kOk) << found.summary.reason;
    const model::Camera camera = calib::CalibratedCamera(simulated.sweep.camera, found, false);
    const double floor2_px2 = std::pow(simulated.truth.blur_floor_px, 2);
    for (const bool falloff : {true, false}) {
      for (const std::size_t frame : {std::size_t{0}, simulated.truth.frames.size() - 1}) {
        const model::SweepTruth::Frame& truth = simulated.truth.frames[frame];
        const model::LightField field = SpotAt(camera, 9, truth.depth_mm);
        const model::LinearImage image = estimator::Photograph(
            field, field.weights, falloff ? &camera : nullptr, nullptr, nullptr, 1);
        const double rendered_px = std::sqrt(VarianceAlongX(image) - kSpotSigmaPx * kSpotSigmaPx);
        const double simulated_px =
            std::sqrt(truth.blur_sigma_px * truth.blur_sigma_px - floor2_px2);
        ASSERT_GT(simulated_px, 1.5);
        // Kappa's interval, its error and that of the focus, and a little of the spot's own
        // fall-off.
        const double by_focus = found.summary.focus_depth_mm->sigma /
                                std::abs(truth.depth_mm - simulated.truth.focus_depth_mm);
        const double kappa = found.summary.blur_ratio->value;
        const double reach =
            3 * std::hypot(found.summary.blur_ratio->sigma / kappa, by_focus) + 0.003;
        EXPECT_LT(reach, 0.012);
        EXPECT_GT(simulated_px / rendered_px,
                  found.summary.blur_ratio->systematic->x() / kappa - reach)
            << "depth " << truth.depth_mm << (falloff ? ", with fall-off" : "");
        EXPECT_LT(simulated_px / rendered_px,
                  found.summary.blur_ratio->systematic->y() / kappa + reach)
            << "depth " << truth.depth_mm << (falloff ? ", with fall-off" : "");
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::tools
