// A sweep's target that is not square to the axis.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "model/simulate/sweep/tilted_target.h"
#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::ThinLens;

constexpr double kPi = 3.14159265358979323846;
constexpr double kFocusMm = 300;

SweepSimulationOptions Sweep(TargetKind kind, double tilt_deg) {
  SweepSimulationOptions options;
  options.camera =
      TestCameraFocusedAt(kFocusMm, "bench", ThinLens(50, 6), CentredSensor(160, 120, 0.02));
  options.camera.calibration->blur_floor_px = Estimate{0.5, 0};
  options.target.kind = kind;
  options.target.tilt_deg = tilt_deg;
  options.first_depth_mm = 306;
  options.frame_count = 1;
  options.effects.base = EffectSelectionOptions::Base::kGiven;
  options.effects.given = {Effect::kDefocus, Effect::kPixelBox, Effect::kMagnification,
                           Effect::kLensFloor, Effect::kTilt};
  return options;
}

double Largest(const LinearImage& a, const LinearImage& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a.values[i] - b.values[i])));
  }
  return largest;
}

// The point at which a ray through the middle of the aperture meets the plane is found by stepping
// along the ray.
TEST(TiltedTargetTest, IsWhereChiefRaysMeetThePlane) {
  const double tilt_rad = 0.4, depth_mm = 200, scale_px = 900;
  const TiltedTarget target(tilt_rad, depth_mm, scale_px);
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(0, 0), {120, -40}, {-200, 90}}) {
    double near_mm = 1, far_mm = 1000;
    for (int i = 0; i < 100; ++i) {
      const double z = (near_mm + far_mm) / 2;
      (z + px.x() / scale_px * z * std::tan(tilt_rad) < depth_mm ? near_mm : far_mm) = z;
    }
    EXPECT_NEAR(target.DepthMm(px.x()), near_mm, 1e-9);
    const Eigen::Vector3d point(px.x() / scale_px * near_mm, px.y() / scale_px * near_mm, near_mm);
    // Its length along the plane, from the line about which that is turned.
    const double along_mm = std::copysign(std::hypot(point.x(), point.z() - depth_mm), point.x());
    EXPECT_NEAR(target.At(px).x(), along_mm, 1e-9);
    EXPECT_NEAR(target.At(px).y(), point.y(), 1e-9);
    const double step_px = 1e-4;
    const Eigen::Vector2d across =
        (target.At({px.x() + step_px, px.y()}) - target.At({px.x() - step_px, px.y()})) /
        (2 * step_px);
    EXPECT_NEAR(target.PixelAcrossMm(px.x()), across.x(), 1e-8);
    EXPECT_NEAR(target.DownPerColumnMm(px), across.y(), 1e-8);
  }
}

TEST(TiltedTargetTest, StripsKeepWithinWhatIsAllowed) {
  for (const double steepness : {0.0, 1e-4, 0.003, 0.5}) {
    const std::vector<ColumnStrip> strips = StripsOf(150, steepness);
    int columns = 0;
    for (const ColumnStrip& strip : strips) {
      EXPECT_EQ(strip.first, columns);
      columns += strip.count;
      if (strip.count > 1) {
        EXPECT_LE(steepness * strip.count / 2, 0.01 + 1e-12);
      }
    }
    EXPECT_EQ(columns, 150);
  }
}

TEST(TiltedSweepTest, ATiltOfNothingIsNone) {
  for (const TargetKind kind : {TargetKind::kDeadLeaves, TargetKind::kPrintedEdge}) {
    const SweepSimulator square(Sweep(kind, 0), {}), tilted(Sweep(kind, 1e-9), {});
    EXPECT_LT(Largest(square.RenderNoiseless(0), tilted.RenderNoiseless(0)), 1e-6);
  }
}

// The scene simulator traces rays and supports planes of any slope. It paints by X and Y, the sweep
// by the distance along the target.
TEST(TiltedSweepTest, ShowsAnEdgeAsRaysDo) {
  for (const double tilt_deg : {25.0, -40.0}) {
    for (const double edge_deg : {8.0, 55.0}) {
      SCOPED_TRACE(::testing::Message() << tilt_deg << ", " << edge_deg);
      SweepSimulationOptions sweep = Sweep(TargetKind::kPrintedEdge, tilt_deg);
      sweep.target.edge_angle_deg = edge_deg;
      sweep.target.ink_sigma_mm = 0.25;
      const LinearImage found = SweepSimulator(sweep, {}).RenderNoiseless(0);

      SceneSimulationOptions scene;
      scene.camera = sweep.camera;
      scene.effects = sweep.effects;
      scene.effects.given = {Effect::kDefocus, Effect::kPixelBox, Effect::kLensFloor,
                             Effect::kOcclusion};
      scene.sampling_error_grey_levels = 0;
      scene.rays_per_pixel = 3000;
      SceneLayer plane;
      plane.plane.depth_mm = sweep.first_depth_mm;
      plane.plane.slope = {-std::tan(tilt_deg * kPi / 180), 0};
      plane.texture.kind = TextureKind::kEdge;
      plane.texture.contrast = sweep.target.contrast;
      plane.texture.colour.setConstant(sweep.light_level);
      const Eigen::Vector2d towards_bright(
          std::cos(edge_deg * kPi / 180) / std::cos(tilt_deg * kPi / 180),
          std::sin(edge_deg * kPi / 180));
      plane.texture.angle_deg = std::atan2(towards_bright.y(), towards_bright.x()) * 180 / kPi;
      const double pixel_mm = sweep.first_depth_mm / sweep.camera.focal_scale_px();
      plane.texture.feature_size_px = sweep.target.ink_sigma_mm / towards_bright.norm() / pixel_mm;
      // Its middle, through which the edge goes, on the axis.
      plane.outline.shape = OutlineOptions::Shape::kRectangle;
      plane.outline.unit = OutlineOptions::Unit::kMm;
      plane.outline.size = {500, 500};
      SceneLayer behind;
      behind.plane.depth_mm = 2000;
      behind.texture.kind = TextureKind::kUniform;
      scene.layers = {plane, behind};
      const LinearImage rays = SceneSimulator(scene, {}).RenderNoiseless({2, {}});

      // The sweep neglects the change of depth within the blur of a pixel, and the scene has the
      // sampling error of 3000 rays.
      double largest = 0, squares = 0;
      for (std::size_t i = 0; i < found.values.size(); ++i) {
        const double error = static_cast<double>(found.values[i] - rays.values[3 * i]);
        largest = std::max(largest, std::abs(error));
        squares += error * error;
      }
      EXPECT_LT(largest, 0.004);
      EXPECT_LT(std::sqrt(squares / static_cast<double>(found.values.size())), 6e-4);
      // Without tilt the image is different.
      sweep.effects.without.Add(Effect::kTilt);
      EXPECT_GT(Largest(SweepSimulator(sweep, {}).RenderNoiseless(0), found), 0.02);
    }
  }
}

TEST(TiltedSweepTest, TheLampIsNearerToTheNearSide) {
  SweepSimulationOptions options = Sweep(TargetKind::kPrintedEdge, 30);
  options.target.contrast = 1e-9;
  options.effects.given.Add(Effect::kLampFalloff);
  const LinearImage light = SweepSimulator(options, {}).RenderNoiseless(0);
  const TiltedTarget target(30 * kPi / 180, options.first_depth_mm,
                            options.camera.focal_scale_px());
  for (const int x : {0, 79, 159}) {
    EXPECT_NEAR(light.at(x, 60, 0),
                options.light_level * std::pow(kFocusMm / target.DepthMm(x - 79.5), 2),
                2e-3 * options.light_level)
        << x;
  }
}

// The stated impact of each effect holds for every frame, whatever the tilt is.
TEST(TiltedSweepTest, EffectsKeepToTheirBounds) {
  for (const double tilt_deg : {0.0, 5.0, -30.0}) {
    for (const double first_mm : {290.0, 330.0}) {
      SweepSimulationOptions options = Sweep(TargetKind::kDeadLeaves, tilt_deg);
      options.first_depth_mm = first_mm;
      options.camera.psf = Psf::kDisc;
      const EffectSet all = {Effect::kDefocus,     Effect::kApertureShape, Effect::kFalloff,
                             Effect::kPixelBox,    Effect::kLensFloor,     Effect::kMagnification,
                             Effect::kLampFalloff, Effect::kTilt};
      // Without blur only the geometry is left.
      for (const EffectSet& given : {all, all.Without({Effect::kDefocus, Effect::kApertureShape}),
                                     EffectSet{Effect::kMagnification, Effect::kTilt}}) {
        options.effects.given = given;
        const SweepSimulator with(options, {});
        for (const LargestEffectImpact& finding : with.effects().findings) {
          if (!given.Has(finding.effect)) continue;
          SCOPED_TRACE(::testing::Message() << EffectName(finding.effect) << ", tilt " << tilt_deg
                                            << ", " << first_mm << " mm, " << JoinedNames(given));
          SweepSimulationOptions fewer = options;
          fewer.effects.given.Remove(finding.effect);
          EXPECT_LE(
              255 * Largest(SweepSimulator(fewer, {}).RenderNoiseless(0), with.RenderNoiseless(0)),
              finding.impact.grey_levels + 0.01);
        }
      }
    }
  }
}

TEST(TiltedSweepTest, RefusesWhatLooksPastTheTarget) {
  std::string why;
  SweepSimulationOptions options = Sweep(TargetKind::kDeadLeaves, 90);
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("target.tilt_deg is 90"));
  options.target.tilt_deg = 80;
  options.camera.sensor.pixel_pitch_mm = 0.15;
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("miss the target"));
}

}  // namespace
}  // namespace thicklens::model
