// Frames of a simulated sweep, whose blur is a transfer function, against edges behind a Gaussian
// or a disc written as areas: an edge holds every frequency.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "support/blur_oracles.h"
#include "support/macro_scene.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using thicklens::testing::GaussianShare;
using thicklens::testing::MacroScene;
using thicklens::testing::MeanOverPixel;
using thicklens::testing::ShareBelow;

constexpr double kPi = 3.14159265358979323846;

// The light at x behind an edge that blurs of both kinds have softened.
double SoftEdge(Psf psf, double x, double defocus_px, double gaussian_px) {
  if (psf == Psf::kGaussian) return GaussianShare(x, std::hypot(defocus_px, gaussian_px));
  if (!(gaussian_px > 0) || !(defocus_px > 0)) {
    return ShareBelow(defocus_px > 0 ? psf : Psf::kGaussian, x, std::max(defocus_px, gaussian_px));
  }
  // The integral is over the chords of the disc: x = R sin(phi) has the weight 2/pi cos^2(phi).
  double sum = 0;
  constexpr int kSteps = 96;
  for (int i = 0; i < kSteps; ++i) {
    const double phi = kPi * ((i + 0.5) / kSteps - 0.5);
    sum += 2 * std::pow(std::cos(phi), 2) / kSteps *
           GaussianShare(x - 2 * defocus_px * std::sin(phi), gaussian_px);
  }
  return sum;
}

TEST(TransferOraclesTest, FramesOfAnEdgeAreExactToAMillionth) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double floor_px : {0.0, 0.6}) {
      for (const double defocus_px : {-3.1, 0.7, 6.0}) {
        SCOPED_TRACE(PsfName(psf) + ", floor " + std::to_string(floor_px) + " px, defocus " +
                     std::to_string(defocus_px) + " px");
        SweepSimulationOptions options;
        options.camera = MacroScene::Camera(49, 9, psf);
        options.camera.calibration->blur_floor_px->value = floor_px;
        options.target.kind = TargetKind::kKnifeEdge;
        options.target.contrast = 0.8;
        options.target.edge_angle_deg = 6;
        options.first_depth_mm = MacroScene::DepthOf(defocus_px);
        options.frame_count = 1;
        options.lamp_falloff = false;
        options.effects.without = {Effect::kFalloff};
        const LinearImage frame = SweepSimulator(options, {}).RenderNoiseless(0);
        // Through the middle of the frame; the upper end leans right, bright is on the right.
        const Eigen::Vector2d direction = MacroScene::Direction(6), edge_px(24, 4);
        for (int y = 0; y < 9; y += 4) {
          for (int x = 0; x < 49; ++x) {
            const double across_px = direction.dot(Eigen::Vector2d(x, y) - edge_px);
            // If only the pixel softens the edge of a disc, its ends have kinks.
            const double share = MeanOverPixel(
                [&](double dy) {
                  return MeanOverPixel(
                      [&](double dx) {
                        return SoftEdge(psf, across_px + direction.dot(Eigen::Vector2d(dx, dy)),
                                        std::abs(defocus_px), floor_px);
                      },
                      24);
                },
                4);
            EXPECT_NEAR(frame.at(x, y, 0), 0.1 + 0.8 * share, 1e-6) << x << " " << y;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::model
