// Simulated images are compared with formulas that need no simulator: transfer functions, areas
// of apertures behind an edge, the light of a scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/blur_oracles.h"
#include "support/macro_scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

using thicklens::testing::DiscTransfer;
using thicklens::testing::MacroScene;
using thicklens::testing::MeanOverPixel;
using thicklens::testing::ShareBelow;

constexpr double kPi = 3.14159265358979323846;
const SceneRun kRun{2, {}};
const EffectSet kAperture = {Effect::kDefocus, Effect::kApertureShape, Effect::kOcclusion};

// Rms and largest difference of an image's green from light(position).
struct Misfit {
  double rms = 0, largest = 0;
};
template <typename Light>
Misfit MisfitOf(const LinearImage& image, const Light& light) {
  Misfit misfit;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double error =
          std::abs(static_cast<double>(image.at(x, y, 1)) - light(Eigen::Vector2d(x, y)));
      misfit.largest = std::max(misfit.largest, error);
      misfit.rms += error * error / (image.width_px * image.height_px);
    }
  }
  misfit.rms = std::sqrt(misfit.rms);
  return misfit;
}

// The sampler is a quadrature. Its error relative to the transfer function decreases with the
// number of rays and stays within the stated error. With the largest number of rays it is a
// hundred-thousandth. Values that must be exact to a millionth are tested on views and on frames of
// sweeps.
TEST(SceneOraclesTest, SinesComeCloserToTheTransferFunctionAsTheLawOfTheSamplingSays) {
  constexpr double kPeriodPx = 9, kAngleDeg = 33, kSigmaPx = 2;
  const Eigen::Vector2d f = MacroScene::Direction(kAngleDeg) / kPeriodPx;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    const double transfer = psf == Psf::kGaussian
                                ? std::exp(-2 * kPi * kPi * kSigmaPx * kSigmaPx * f.squaredNorm())
                                : DiscTransfer(2 * kSigmaPx, f.norm(), 400);
    const double box =
        std::sin(kPi * f.x()) / (kPi * f.x()) * std::sin(kPi * f.y()) / (kPi * f.y());
    std::vector<double> errors;
    for (int rays = 64; rays <= 65536; rays *= 4) {
      const SceneSimulationOptions options = MacroScene::Options(
          MacroScene::Camera(12, 10, psf),
          {MacroScene::Sine(MacroScene::DepthOf(kSigmaPx), kPeriodPx, kAngleDeg)},
          kAperture.With({Effect::kPixelBox}), rays);
      const SceneSimulator simulator(options, {});
      const Misfit misfit =
          MisfitOf(simulator.RenderNoiseless(kRun), [&](const Eigen::Vector2d& at_px) {
            const Eigen::Vector2d from_axis = at_px - options.camera.sensor.principal_point_px;
            return 0.5 + 0.4 * transfer * box * std::cos(2 * kPi * f.dot(from_axis));
          });
      EXPECT_LE(255 * misfit.rms, simulator.sampling_error_grey_levels()) << rays;
      errors.push_back(misfit.rms);
    }
    EXPECT_LT(errors.back() / errors.front(), std::pow(1024, -0.65));
    EXPECT_LT(errors.back(), 2e-5);
  }
}

// The edge of a scene in closed form, behind aperture and pixel.
TEST(SceneOraclesTest, EdgesSpreadAsTheSharesOfTheirBlurSay) {
  constexpr double kSigmaPx = 2.2, kAngleDeg = 20, kEdgePx = 1.3;
  const Eigen::Vector2d direction = MacroScene::Direction(kAngleDeg);
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    SceneLayer layer = MacroScene::Sine(MacroScene::DepthOf(kSigmaPx), kEdgePx, kAngleDeg);
    layer.texture.kind = TextureKind::kEdge;
    const SceneSimulationOptions options = MacroScene::Options(
        MacroScene::Camera(24, 18, psf), {layer}, kAperture.With({Effect::kPixelBox}), 4096);
    const SceneSimulator simulator(options, {});
    const auto behind_aperture = [&](double across_px) {
      if (psf == Psf::kGaussian) {
        return ShareBelow(psf, across_px, std::hypot(kSigmaPx, kEdgePx));
      }
      double sum = 0;  // over the disc's projection, 2/pi cos^2 of the angle whose sine is x/R
      constexpr int kSteps = 64;
      for (int i = 0; i < kSteps; ++i) {
        const double phi = kPi * ((i + 0.5) / kSteps - 0.5);
        sum += 2 * std::pow(std::cos(phi), 2) / kSteps *
               ShareBelow(Psf::kGaussian, across_px - 2 * kSigmaPx * std::sin(phi), kEdgePx);
      }
      return sum;
    };
    const Misfit misfit =
        MisfitOf(simulator.RenderNoiseless(kRun), [&](const Eigen::Vector2d& at_px) {
          const double across_px = direction.dot(at_px - Eigen::Vector2d(11.5, 8.5));
          return 0.1 + 0.8 * MeanOverPixel(
                                 [&](double y) {
                                   return MeanOverPixel(
                                       [&](double x) {
                                         return behind_aperture(
                                             across_px + direction.dot(Eigen::Vector2d(x, y)));
                                       },
                                       4);
                                 },
                                 4);
        });
    EXPECT_LE(255 * misfit.rms, simulator.sampling_error_grey_levels());
    EXPECT_LE(255 * misfit.largest, 3 * simulator.sampling_error_grey_levels());
  }
}

// A half-plane out of focus before a sine in focus, where all rays of a pixel meet in one point.
// The pixel receives the share of the aperture that is not behind the edge, a circular segment of
// the disc. The edge, a disc of huge radius, is oblique and off every symmetry of the rays.
TEST(SceneOraclesTest, AnOccludersEdgeHidesItsShareOfTheAperture) {
  constexpr double kFarPx = 1e7, kEdgeAtPx = 0.37, kLight = 0.9;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double sigma_px : {0.8, 2.5}) {
      for (const double angle_deg : {0.0, 37.0, 118.0}) {
        const Eigen::Vector2d direction = MacroScene::Direction(angle_deg);
        const Eigen::Vector2d middle(13, 10);
        SceneLayer occluder = MacroScene::Uniform(MacroScene::DepthOf(sigma_px), kLight);
        occluder.outline.shape = OutlineOptions::Shape::kDisc;
        occluder.outline.radius = kFarPx;
        occluder.outline.centre = middle + (kFarPx + kEdgeAtPx) * direction;
        const SceneSimulationOptions options = MacroScene::Options(
            MacroScene::Camera(26, 20, psf),
            {occluder, MacroScene::Sine(MacroScene::kFocusMm, 7, 60)}, kAperture, 600);
        const SceneSimulator simulator(options, {});
        const Eigen::Vector2d f = MacroScene::Direction(60) / 7;
        const Misfit misfit =
            MisfitOf(simulator.RenderNoiseless(kRun), [&](const Eigen::Vector2d& at_px) {
              const double occluded =
                  ShareBelow(psf, direction.dot(at_px - middle) - kEdgeAtPx, sigma_px);
              const Eigen::Vector2d from_axis = at_px - options.camera.sensor.principal_point_px;
              const double behind = 0.5 + 0.4 * std::cos(2 * kPi * f.dot(from_axis));
              return occluded * kLight + (1 - occluded) * behind;
            });
        EXPECT_LE(255 * misfit.rms, simulator.sampling_error_grey_levels());
        EXPECT_LE(255 * misfit.largest, 2 * simulator.sampling_error_grey_levels());
      }
    }
  }
}

TEST(SceneOraclesTest, BlurNeitherMakesNorTakesLight) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double ratio : {0.0, 0.1, 0.45}) {
      Camera camera = MacroScene::Camera(56, 56, psf);
      camera.calibration->blur_ratio->value = ratio;
      const EffectSet effects = kAperture.With({Effect::kPixelBox});
      // Whole periods of a sine.
      const LinearImage sine =
          SceneSimulator(
              MacroScene::Options(camera, {MacroScene::Sine(MacroScene::DepthOf(4), 8, 0)}, effects,
                                  100),
              {})
              .RenderNoiseless(kRun);
      double mean = 0;
      for (const float light : sine.values) mean += static_cast<double>(light);
      EXPECT_NEAR(mean / static_cast<double>(sine.values.size()), 0.5, 1e-6);

      // A patch of known area before black, all of whose light lands in the image.
      SceneLayer patch = MacroScene::Uniform(MacroScene::DepthOf(4), 0.7);
      patch.outline.shape = OutlineOptions::Shape::kDisc;
      patch.outline.centre = {27.2, 28.1};
      patch.outline.radius = 5.3;
      const LinearImage spot =
          SceneSimulator(
              MacroScene::Options(camera, {patch, MacroScene::Uniform(320, 0)}, effects, 600), {})
              .RenderNoiseless(kRun);
      double sum = 0;
      for (std::size_t i = 0; i < spot.values.size(); i += 3) {
        sum += static_cast<double>(spot.values[i]);
      }
      EXPECT_NEAR(sum / (0.7 * kPi * 5.3 * 5.3), 1, 1.5e-3) << PsfName(psf) << " " << ratio;
    }
  }
}

// No pixel, no sampling: a view of a tilted sine is a formula, 1/z of a tilted plane linear in the
// image.
TEST(SceneOraclesTest, ViewsOfATiltedSineAreExactInClosedForm) {
  SceneLayer layer = MacroScene::Sine(296, 25, 25);
  const Eigen::Vector2d tilt(3, -2);
  layer.plane.slope = tilt;
  const SceneSimulationOptions options =
      MacroScene::Options(MacroScene::Camera(32, 24, Psf::kDisc), {layer}, {}, 16);
  const SceneSimulator simulator(options, {});
  const double per_mm = 2 * kPi / (25 * 296 / MacroScene::ScalePx());
  for (const Eigen::Vector2d& aperture_mm :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(3, -1.5), Eigen::Vector2d(-6, 4)}) {
    const Misfit misfit =
        MisfitOf(simulator.RenderView(aperture_mm, kRun), [&](const Eigen::Vector2d& at_px) {
          const Eigen::Vector2d t =
              (at_px - options.camera.sensor.principal_point_px) / MacroScene::ScalePx();
          // X = t z + A (1 - z/zf) with z = z0 + g . X, solved for z.
          const double depth_mm = (296 + tilt.dot(aperture_mm)) /
                                  (1 - tilt.dot(t - aperture_mm / MacroScene::kFocusMm));
          const Eigen::Vector2d on_plane_mm =
              t * depth_mm + aperture_mm * (1 - depth_mm / MacroScene::kFocusMm);
          EXPECT_NEAR(depth_mm, 296 + tilt.dot(on_plane_mm), 1e-9);
          return 0.5 + 0.4 * std::cos(per_mm * MacroScene::Direction(25).dot(on_plane_mm));
        });
    EXPECT_LT(misfit.largest, 1e-6);
  }
  const RawDepthMap depth = simulator.RenderDepth();
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      const Eigen::Vector2d t = (Eigen::Vector2d(x, y) - options.camera.sensor.principal_point_px) /
                                MacroScene::ScalePx();
      EXPECT_NEAR(1 / static_cast<double>(depth.values[static_cast<std::size_t>(32 * y + x)]),
                  (1 - tilt.dot(t)) / 296, 1e-9);
    }
  }
}

}  // namespace
}  // namespace thicklens::model
