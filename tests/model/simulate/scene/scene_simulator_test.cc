#include "thicklens/model/scene_simulator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "support/blur_oracles.h"
#include "support/error_message.h"
#include "support/macro_scene.h"
#include "thicklens/base/error.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::BoxTransfer;
using thicklens::testing::DiscTransfer;
using thicklens::testing::ErrorOf;
using thicklens::testing::GaussianTransfer;
using thicklens::testing::MacroScene;

constexpr double kPi = 3.14159265358979323846;

constexpr double kThicknessMm = MacroScene::kThicknessMm, kRearMm = MacroScene::kRearMm;
constexpr double kFocusMm = MacroScene::kFocusMm, kPitchMm = MacroScene::kPitchMm;
constexpr double kRadiusMm = MacroScene::kRadiusMm, kRatio = MacroScene::kRatio;
constexpr double kScaleMm =
    MacroScene::kFrontMm * kFocusMm / (kFocusMm - MacroScene::kFrontMm);  // K = 60
constexpr double kScalePx = kScaleMm / kPitchMm;
// c(z)/p: px to the left per mm of aperture, and the sigma of defocus.
double ShiftPxPerMm(double depth_mm) { return kScalePx * (1 / depth_mm - 1 / kFocusMm); }
double DefocusPx(double depth_mm) { return kRatio * kRadiusMm * std::abs(ShiftPxPerMm(depth_mm)); }
// The depth nearer than focus where aperture steps of one sigma move by `px`.
double DepthOfShift(double px) { return 1 / (1 / kFocusMm + px / (kRatio * kRadiusMm * kScalePx)); }

SceneLayer Leaves(double depth_mm, double radius_px) {
  SceneLayer layer = MacroScene::Uniform(depth_mm, 0.5);
  layer.texture.kind = TextureKind::kDeadLeaves;
  layer.texture.feature_size_px = radius_px;
  return layer;
}

SceneLayer WithRectangle(SceneLayer layer, double x, double y, double width, double height) {
  layer.outline.shape = OutlineOptions::Shape::kRectangle;
  layer.outline.centre = {x, y};
  layer.outline.size = {width, height};
  return layer;
}

SceneSimulationOptions SceneOf(const Camera& camera, std::vector<SceneLayer> layers) {
  SceneSimulationOptions options;
  options.camera = camera;
  options.layers = std::move(layers);
  options.effects.base = EffectSelectionOptions::Base::kAll;
  options.sampling_error_grey_levels = 0;
  options.effects.without = {Effect::kFalloff, Effect::kDiffraction};
  return options;
}

double NormalBelow(double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; }
// A Gaussian edge behind the pixel box, added up.
double EdgeBehindPixel(double distance_px, double sigma_px) {
  double sum = 0;
  for (int i = 0; i < 100; ++i)
    sum += NormalBelow((distance_px + (i + 0.5) / 100 - 0.5) / sigma_px);
  return sum / 100;
}

// Least squares fit of mean + a cos(w . x) + b sin(w . x), x from the principal point, to green.
struct Wave {
  double mean = 0, cosine = 0, sine = 0;
};
Wave FitWave(const LinearImage& image, const Eigen::Vector2d& centre_px,
             const Eigen::Vector2d& cycles_per_px) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right(0, 0, 0);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double phase = 2 * kPi * cycles_per_px.dot(Eigen::Vector2d(x, y) - centre_px);
      const Eigen::Vector3d row(1, std::cos(phase), std::sin(phase));
      normal += row * row.transpose();
      right += row * static_cast<double>(image.at(x, y, 1));
    }
  }
  const Eigen::Vector3d solved = normal.inverse() * right;
  return {solved(0), solved(1), solved(2)};
}

double LargestDifference(const LinearImage& a, const LinearImage& b) {
  EXPECT_EQ(a.values.size(), b.values.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.values.size(), b.values.size()); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a.values[i] - b.values[i])));
  }
  return largest;
}

// ----------------------------------------------------------------------------------- photograph

TEST(SceneSimulatorTest, UniformSceneGivesAUniformImage) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    // Points in front of focus and behind it look alike if both have the same light.
    const SceneSimulator simulator(
        SceneOf(MacroScene::Camera(20, 16, psf, 0.5),
                {MacroScene::Uniform(310, 0.4),
                 WithRectangle(MacroScene::Uniform(294, 0.4), 9, 8, 6, 5)}),
        {});
    const LinearImage image = simulator.RenderNoiseless({1, {}});
    ASSERT_EQ(image.values.size(), 20u * 16 * 3);
    for (const float light : image.values) EXPECT_NEAR(light, 0.4f, 1e-6f);
  }
}

// A wide and fast lens, so that the fall-off is large; the mean over the aperture of [S12],
// relative to the same place of the aperture at the principal point, by a grid.
TEST(SceneSimulatorTest, FallOffIsThatOfTheFormula) {
  constexpr double kFastRadiusMm = 30;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    SceneSimulationOptions options =
        SceneOf(MacroScene::Camera(16, 12, psf, 0), {MacroScene::Uniform(330, 1)});
    options.effects.without = {Effect::kDiffraction};
    options.camera.sensor.pixel_pitch_mm = 2;
    options.camera.lens.aperture_radius_mm = kFastRadiusMm;
    const double image_mm = options.camera.image_distance_mm();
    const SceneSimulator simulator(options, {});
    const LinearImage image = simulator.RenderNoiseless({1, {}});
    const auto irradiance = [&](const Eigen::Vector2d& position_px) {
      double sum = 0, weights = 0;
      const double sigma_mm = kRatio * kFastRadiusMm;
      for (double a = -4.95; a < 5; a += 0.1) {
        for (double b = -4.95; b < 5; b += 0.1) {
          const double weight =
              ApertureTransmission(psf, kRatio, kFastRadiusMm, {a * sigma_mm, b * sigma_mm});
          if (weight == 0) continue;
          // The ray meets the plane of focus where the pixel's chief ray does.
          const Eigen::Vector2d focus_mm =
              (position_px - options.camera.sensor.principal_point_px) * 2 / kScaleMm * kFocusMm;
          const Ray ray{focus_mm.x(), focus_mm.y(), a * sigma_mm, b * sigma_mm};
          const Ray on_axis{0, 0, ray.u_mm, ray.v_mm};
          const auto irradiance_of = [&](const Ray& which) {
            return RelativeIrradiance(options.camera.lens, image_mm, {0, kFocusMm}, which);
          };
          sum += weight * irradiance_of(ray) / irradiance_of(on_axis);
          weights += weight;
        }
      }
      return sum / weights;
    };
    EXPECT_NEAR(irradiance(options.camera.sensor.principal_point_px), 1, 1e-12);
    double least = 1;
    for (const auto& [x, y] : {std::pair{0, 0}, {8, 6}, {15, 0}, {15, 11}, {3, 9}}) {
      const double expected = irradiance(Eigen::Vector2d(x, y));
      EXPECT_NEAR(image.at(x, y, 0), expected, 6e-4) << x << " " << y;
      least = std::min(least, expected);
    }
    EXPECT_LT(least, 0.89);
    // The views are radiance.
    const LinearImage view = simulator.RenderView({2, -1}, {1, {}});
    for (const float light : view.values) EXPECT_NEAR(light, 1, 1e-6f);
  }
}

TEST(SceneSimulatorTest, SineHasTheModulationOfItsBlur) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double floor_px : {0.0, 0.8}) {
      for (const double depth_mm : {kFocusMm, DepthOfShift(1.2), 303.5}) {
        for (const auto& [period_px, angle_deg] :
             {std::pair{7.0, 0.0}, {12.0, 60.0}, {4.1, 90.0}}) {
          SceneSimulationOptions options =
              SceneOf(MacroScene::Camera(20, 16, psf, floor_px),
                      {MacroScene::Sine(depth_mm, period_px, angle_deg)});
          options.rays_per_pixel = 1000;
          const SceneSimulator simulator(options, {});
          const Eigen::Vector2d f =
              Eigen::Vector2d(std::cos(angle_deg * kPi / 180), std::sin(angle_deg * kPi / 180)) /
              period_px;
          const Wave wave = FitWave(simulator.RenderNoiseless({1, {}}),
                                    options.camera.sensor.principal_point_px, f);
          const double sigma_px = DefocusPx(depth_mm);
          const double defocus = psf == Psf::kGaussian ? GaussianTransfer(sigma_px, f.norm())
                                                       : DiscTransfer(2 * sigma_px, f.norm());
          const double expected = 0.5 * 0.8 * defocus * GaussianTransfer(floor_px, f.norm()) *
                                  BoxTransfer(f.x()) * BoxTransfer(f.y());
          EXPECT_NEAR(wave.mean, 0.5, 5e-4);
          EXPECT_NEAR(wave.cosine, expected, 0.0025) << depth_mm << " " << period_px;
          EXPECT_NEAR(wave.sine, 0, 0.0025);
        }
      }
    }
  }
}

// Six hundred rays, at the largest blur and the finest detail of the scenes: the image differs
// from one of fifteen times as many by less than half a grey level, rms.
TEST(SceneSimulatorTest, SixHundredRaysAreEnough) {
  SceneSimulationOptions options =
      SceneOf(MacroScene::Camera(24, 20, Psf::kGaussian, 0.5),
              {Leaves(1 / (2 / kFocusMm - 1 / DepthOfShift(3)), 2),
               WithRectangle(Leaves(DepthOfShift(3), 2), 8, 9, 12, 11)});
  const LinearImage image = SceneSimulator(options, {}).RenderNoiseless({2, {}});
  options.rays_per_pixel = 9000;
  const LinearImage fine = SceneSimulator(options, {}).RenderNoiseless({2, {}});
  double sum = 0;
  for (std::size_t i = 0; i < fine.values.size(); ++i)
    sum += std::pow(static_cast<double>(image.values[i] - fine.values[i]), 2);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(fine.values.size())), 0.5 / 255);
}

TEST(SceneSimulatorTest, EdgeIsAsWideAsTheBlurOfTheNearerLayer) {
  const double near_mm = DepthOfShift(2.5);
  // The right half is x > 20.3 in the image. It is bright in front of dark, then behind it: a
  // blurred background does not soften the edge of an object in focus.
  for (const bool focused : {false, true}) {
    const double front_mm = focused ? kFocusMm : near_mm;
    const double back_mm = focused ? 306 : kFocusMm;
    SceneSimulationOptions options =
        SceneOf(MacroScene::Camera(40, 9, Psf::kGaussian, 0.4),
                {WithRectangle(MacroScene::Uniform(front_mm, 0.9), 20.3 + 100, 4, 200, 400),
                 MacroScene::Uniform(back_mm, 0.1)});
    options.rays_per_pixel = 3000;
    const SceneSimulator simulator(options, {});
    const LinearImage image = simulator.RenderNoiseless({1, {}});
    const double sigma_px = std::hypot(0.4, focused ? 0 : 2.5);
    for (int x = 8; x < 32; ++x) {
      EXPECT_NEAR(image.at(x, 4, 2), 0.1 + 0.8 * EdgeBehindPixel(x - 20.3, sigma_px), 0.005)
          << x << " " << focused;
    }
  }
}

// ---------------------------------------------------------------------------------- light field

TEST(SceneSimulatorTest, ViewsOfAFrontoParallelPlaneAreDisplacedByTheDisparity) {
  for (const double depth_mm : {DepthOfShift(1.5), kFocusMm, 304.0}) {
    const SceneSimulationOptions options = SceneOf(MacroScene::Camera(24, 20, Psf::kGaussian, 0),
                                                   {MacroScene::Sine(depth_mm, 16, 30)});
    const LightField light_field = SceneSimulator(options, {}).RenderLightField(4, 3, {1, {}});
    const LightFieldGrid grid = DefaultGrid(options.camera, 4, 3);
    const Eigen::Vector2d f = Eigen::Vector2d(std::cos(kPi / 6), std::sin(kPi / 6)) / 16;
    for (int l = 0; l < 3; ++l) {
      for (int k = 0; k < 4; ++k) {
        // View (a, b) shows at x the point of the centre view at x + (a, b) d.
        const Eigen::Vector2d shift_px =
            ShiftPxPerMm(depth_mm) *
            Eigen::Vector2d((k - 1.5) * grid.u_step_mm, (l - 1.0) * grid.v_step_mm);
        const Wave wave = FitWave(ViewImage(light_field, k, l),
                                  options.camera.sensor.principal_point_px - shift_px, f);
        const double expected = 0.4 * BoxTransfer(f.x()) * BoxTransfer(f.y());
        EXPECT_NEAR(wave.mean, 0.5, 1e-4);
        EXPECT_NEAR(wave.cosine, expected, 5e-4);
        EXPECT_NEAR(wave.sine, 0, 5e-4) << k << " " << l << " " << depth_mm;
      }
    }
  }
}

TEST(SceneSimulatorTest, WholeShiftsRepeatTheCentreViewOfATexture) {
  const double depth_mm = DepthOfShift(2);
  const SceneSimulator simulator(
      SceneOf(MacroScene::Camera(30, 24, Psf::kDisc, 0.5), {Leaves(depth_mm, 2)}), {});
  const LinearImage centre = simulator.RenderView({0, 0}, {1, {}});
  // Three px to the left and two down: this view's (x, y) is the centre's (x + 3, y - 2).
  const LinearImage view =
      simulator.RenderView({3 / ShiftPxPerMm(depth_mm), -2 / ShiftPxPerMm(depth_mm)}, {1, {}});
  double change = 0;
  for (int y = 2; y < 24; ++y) {
    for (int x = 0; x < 27; ++x) {
      EXPECT_NEAR(view.at(x, y, 0), centre.at(x + 3, y - 2, 0), 1e-4);
      change += std::abs(static_cast<double>(view.at(x, y, 0) - centre.at(x, y, 0)));
    }
  }
  EXPECT_GT(change / (22 * 27), 0.02);
}

// A lamp that is reflected by the gloss of a plane in focus moves and is blurred like an object at
// the depth of its mirror image, and is visible in that layer only.
TEST(SceneSimulatorTest, GlossShowsItsLampAtTheDepthOfTheMirrorImage) {
  const double image_depth_mm = DepthOfShift(-1.5);
  SceneLayer glossy = WithRectangle(MacroScene::Uniform(kFocusMm, 0.25), 19.5, 19.5, 34, 34);
  glossy.gloss.push_back({image_depth_mm, {20, 19}, 2, 0.5});
  const Camera camera = MacroScene::Camera(40, 40, Psf::kGaussian, 0);
  const SceneSimulator simulator(SceneOf(camera, {glossy, MacroScene::Uniform(kFocusMm + 1, 0.1)}),
                                 {});
  struct Spot {
    double sum = 0, x = 0, y = 0, variance_x = 0;
  };
  const auto spot_of = [](const LinearImage& image) {
    Spot spot;
    for (int y = 4; y < 36; ++y) {
      for (int x = 4; x < 36; ++x) {
        const double light = static_cast<double>(image.at(x, y, 1)) - 0.25;
        spot.sum += light;
        spot.x += light * x;
        spot.y += light * y;
        spot.variance_x += light * x * x;
      }
    }
    spot.x /= spot.sum;
    spot.y /= spot.sum;
    spot.variance_x = spot.variance_x / spot.sum - spot.x * spot.x;
    return spot;
  };
  const double kWhole = 0.5 * 2 * kPi * 2 * 2, kPixel = 1 / 12.0;
  const Eigen::Vector2d aperture_mm(4, -3);
  const Eigen::Vector2d shift_px = ShiftPxPerMm(image_depth_mm) * aperture_mm;
  const LinearImage view = simulator.RenderView(aperture_mm, {1, {}});
  const Spot seen = spot_of(view);
  EXPECT_NEAR(seen.sum, kWhole, 0.01 * kWhole);
  EXPECT_NEAR(seen.x, 20 - shift_px.x(), 0.02);
  EXPECT_NEAR(seen.y, 19 - shift_px.y(), 0.02);
  EXPECT_NEAR(seen.variance_x, 4 + kPixel, 0.05);
  EXPECT_NEAR(view.at(0, 0, 1), 0.1, 1e-6);

  const double blur_px = DefocusPx(image_depth_mm);
  const Spot photographed = spot_of(simulator.RenderNoiseless({1, {}}));
  EXPECT_NEAR(photographed.x, 20, 0.05);
  EXPECT_NEAR(photographed.variance_x, 4 + kPixel + blur_px * blur_px,
              0.05 * (4 + blur_px * blur_px));
}

// The whole chain once more, by the light-field grid's own rays and a search along each of them.
class LightFieldPlanesTest : public ::testing::TestWithParam<double> {};

INSTANTIATE_TEST_SUITE_P(UvDepths, LightFieldPlanesTest, ::testing::Values(0, 150, -200));

TEST_P(LightFieldPlanesTest, SlantedPlaneIsMetWhereTheGridsRaysMeetIt) {
  SceneSimulationOptions options =
      SceneOf(MacroScene::Camera(44, 30, Psf::kGaussian, 0), {MacroScene::Sine(297, 40, 25)});
  options.uv_depth_mm = GetParam();
  const Eigen::Vector2d slope(3, -2);
  options.layers[0].plane.slope = slope;
  const SceneSimulator simulator(options, {});
  const LightField light_field = simulator.RenderLightField(5, 5, {1, {}});
  const LightFieldGrid grid =
      GridOnPlanes(options.camera, {GetParam(), kFocusMm - GetParam()}, 5, 5);
  EXPECT_EQ(light_field.grid->planes.uv_depth_mm, GetParam());
  const RawDepthMap depth = simulator.RenderDepth();
  const double period_mm = 40 * 297 / kScalePx;
  for (const auto& [k, l] : {std::pair{2, 2}, {0, 2}, {4, 1}, {3, 4}}) {
    const LinearImage view = ViewImage(light_field, k, l);
    for (int y = 0; y < 30; y += 7) {
      for (int x = 0; x < 44; x += 7) {
        const Ray ray = grid.RayAt(x, y, k, l);
        double near_mm = 200, far_mm = 500;
        for (int i = 0; i < 60; ++i) {
          const double depth_mm = (near_mm + far_mm) / 2;
          const double plane_mm = 297 + slope.dot(PositionAtDepthMm(grid.planes, ray, depth_mm));
          (depth_mm < plane_mm ? near_mm : far_mm) = depth_mm;
        }
        const Eigen::Vector2d at_mm = PositionAtDepthMm(grid.planes, ray, near_mm);
        const double along_mm =
            std::cos(25 * kPi / 180) * at_mm.x() + std::sin(25 * kPi / 180) * at_mm.y();
        const double expected = 0.5 + 0.4 * std::cos(2 * kPi * along_mm / period_mm) *
                                          BoxTransfer(std::cos(25 * kPi / 180) / 40) *
                                          BoxTransfer(std::sin(25 * kPi / 180) / 40);
        EXPECT_NEAR(view.at(x, y, 0), expected, 1e-3);
        if (k == 2 && l == 2 && GetParam() == 0) {  // chief rays
          EXPECT_NEAR(depth.values[static_cast<std::size_t>(y * 44 + x)], near_mm, 1e-4);
        }
      }
    }
  }
}

TEST(SceneSimulatorTest, ViewsBeyondTheApertureAreRefused) {
  SceneSimulationOptions options =
      SceneOf(MacroScene::Camera(44, 30, Psf::kGaussian, 0), {MacroScene::Sine(297, 40, 25)});
  options.uv_depth_mm = 299.9;
  const SceneSimulator simulator(options, {});
  EXPECT_THAT(ErrorOf([&] {
                simulator.RenderLightField(3, 3, {1, {}});
              }),
              AllOf(HasSubstr("uv_depth_mm is 299.9"), HasSubstr("nearer to the aperture")));
  options.uv_depth_mm = std::numeric_limits<double>::infinity();
  std::string why;
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("uv_depth_mm is inf"));
}

TEST(SceneSimulatorTest, EdgesStandWhereTheNearerLayersDisparityPutsThem) {
  const double near_mm = DepthOfShift(2);
  const SceneSimulationOptions options =
      SceneOf(MacroScene::Camera(48, 40, Psf::kGaussian, 0),
              {MacroScene::Uniform(305, 0),
               WithRectangle(MacroScene::Uniform(near_mm, 1), 24.3, 19.1, 17.5, 12.25)});
  const LightField light_field = SceneSimulator(options, {}).RenderLightField(3, 3, {2, {}});
  const LightFieldGrid grid = DefaultGrid(options.camera, 3, 3);
  const double d_px = grid.u_step_mm * ShiftPxPerMm(near_mm);
  EXPECT_GT(d_px, 2);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d shift_px(-(k - 1) * d_px, -(l - 1) * d_px);
      const LinearImage view = ViewImage(light_field, k, l);
      for (int y = 0; y < 40; ++y) {
        for (int x = 0; x < 48; ++x) {
          // Share of the pixel inside the rectangle.
          const auto inside = [](double at, double low, double high) {
            return std::max(0.0, std::min(at + 0.5, high) - std::max(at - 0.5, low));
          };
          const double expected =
              inside(x, 24.3 - 8.75 + shift_px.x(), 24.3 + 8.75 + shift_px.x()) *
              inside(y, 19.1 - 6.125 + shift_px.y(), 19.1 + 6.125 + shift_px.y());
          EXPECT_NEAR(view.at(x, y, 0), expected, 0.025) << x << " " << y << " " << k << " " << l;
        }
      }
    }
  }
}

TEST(SceneSimulatorTest, DiscAndMillimetresDescribeTheSamePart) {
  const double depth_mm = 296;
  const Camera camera = MacroScene::Camera(40, 32, Psf::kGaussian, 0);
  SceneLayer in_px = MacroScene::Uniform(depth_mm, 1);
  in_px.outline.shape = OutlineOptions::Shape::kDisc;
  in_px.outline.centre = {17.2, 15.6};
  in_px.outline.radius = 9.5;
  SceneLayer in_mm = in_px;
  const double px_mm = depth_mm / kScalePx;
  in_mm.outline.unit = OutlineOptions::Unit::kMm;
  in_mm.outline.centre = px_mm * (in_px.outline.centre - camera.sensor.principal_point_px);
  in_mm.outline.radius = px_mm * 9.5;
  const Eigen::Vector2d aperture_mm(1.3, -0.9);
  const LinearImage a = SceneSimulator(SceneOf(camera, {in_px, MacroScene::Uniform(302, 0)}), {})
                            .RenderView(aperture_mm, {1, {}});
  const LinearImage b = SceneSimulator(SceneOf(camera, {MacroScene::Uniform(302, 0), in_mm}), {})
                            .RenderView(aperture_mm, {1, {}});
  EXPECT_LT(LargestDifference(a, b), 0.03);
  double area = 0, x_sum = 0, y_sum = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 40; ++x) {
      area += static_cast<double>(a.at(x, y, 0));
      x_sum += x * static_cast<double>(a.at(x, y, 0));
      y_sum += y * static_cast<double>(a.at(x, y, 0));
    }
  }
  EXPECT_NEAR(area, kPi * 9.5 * 9.5, 0.3);
  EXPECT_NEAR(x_sum / area, 17.2 - 1.3 * ShiftPxPerMm(depth_mm), 0.01);
  EXPECT_NEAR(y_sum / area, 15.6 + 0.9 * ShiftPxPerMm(depth_mm), 0.01);
}

// The photograph is the mean of the views over the aperture. This includes occlusions, a slant and
// the blur floor.
TEST(SceneSimulatorTest, PhotographIsTheMeanOfItsViews) {
  SceneLayer back = Leaves(304, 2);
  back.plane.slope = {1, -2};
  SceneSimulationOptions options =
      SceneOf(MacroScene::Camera(14, 11, Psf::kGaussian, 0.5),
              {back, WithRectangle(Leaves(DepthOfShift(2), 2), 4, 5, 7, 6),
               WithRectangle(MacroScene::Uniform(299, 0.9), 10, 8, 5, 5)});
  options.rays_per_pixel = 5000;
  const SceneSimulator simulator(options, {});
  const LinearImage image = simulator.RenderNoiseless({2, {}});
  std::vector<double> mean(image.values.size(), 0.0);
  double weights = 0;
  constexpr double kStep = 0.3;  // standard deviations
  for (double a = -4.05; a < 4.1; a += kStep) {
    for (double b = -4.05; b < 4.1; b += kStep) {
      const double weight = std::exp(-(a * a + b * b) / 2);
      const LinearImage view =
          simulator.RenderView(kRatio * kRadiusMm * Eigen::Vector2d(a, b), {2, {}});
      for (std::size_t i = 0; i < mean.size(); ++i)
        mean[i] += weight * static_cast<double>(view.values[i]);
      weights += weight;
    }
  }
  double sum = 0;
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double error = mean[i] / weights - static_cast<double>(image.values[i]);
    EXPECT_LT(std::abs(error), 0.012);
    sum += error * error;
  }
  EXPECT_LT(std::sqrt(sum / static_cast<double>(mean.size())), 0.0025);
}

TEST(SceneSimulatorTest, LightFieldStandsOnTheDefaultGrid) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    SceneSimulationOptions options =
        SceneOf(MacroScene::Camera(12, 10, psf, 0.5), {Leaves(302, 2)});
    options.camera.sensor.transfer = TransferCurve::Srgb();
    const SceneSimulator simulator(options, {});
    const LightField light_field = simulator.RenderLightField(5, 3, {1, {}});
    std::string why;
    EXPECT_TRUE(light_field.IsValid(&why)) << why;
    EXPECT_EQ(light_field.channels, 3);
    EXPECT_EQ(light_field.origin.method, "simulated");
    EXPECT_EQ(light_field.landing_step_px, Eigen::Vector2d(0, 0));
    EXPECT_TRUE(light_field.transfer == TransferCurve::Srgb());
    ASSERT_TRUE(light_field.grid && light_field.camera);
    EXPECT_EQ(light_field.camera->name, "macro");
    const LightFieldGrid grid = DefaultGrid(options.camera, 5, 3);
    EXPECT_EQ(light_field.grid->u_step_mm, grid.u_step_mm);
    EXPECT_EQ(light_field.grid->v_step_mm, grid.v_step_mm);
    EXPECT_EQ(light_field.grid->planes.plane_spacing_mm, grid.planes.plane_spacing_mm);
    EXPECT_TRUE((light_field.weights == ApertureWeights(ApertureShapeOf(psf), 5, 3)).all());
    for (int l = 0; l < 3; ++l) {
      for (int k = 0; k < 5; ++k) {
        const LinearImage view =
            simulator.RenderView({(k - 2) * grid.u_step_mm, (l - 1) * grid.v_step_mm}, {1, {}});
        EXPECT_LT(LargestDifference(ViewImage(light_field, k, l), view), 1e-6);
      }
    }
    EXPECT_EQ(LargestDifference(ViewImage(light_field, 2, 1), simulator.RenderView({0, 0}, {})), 0);
  }
}

// ---------------------------------------------------------------------------------------- depth

TEST(SceneSimulatorTest, DepthIsThatOfTheNearestLayerOnEachChiefRay) {
  SceneLayer left = MacroScene::Uniform(300, 0.2), right = MacroScene::Uniform(300, 0.4);
  left.plane.slope = {4, 0};  // they cross in the column of the principal point
  right.plane.slope = {-4, 1};
  SceneLayer coin = MacroScene::Uniform(290, 0.6);
  coin.outline.shape = OutlineOptions::Shape::kDisc;
  coin.outline.centre = {30, 12};
  coin.outline.radius = 6.2;
  const Camera camera = MacroScene::Camera(50, 40, Psf::kGaussian, 0.5);
  std::vector<SceneLayer> layers = {left, right, coin};
  std::vector<float> first;
  for (int turn = 0; turn < 3; ++turn) {
    std::rotate(layers.begin(), layers.begin() + 1, layers.end());
    const SceneSimulator simulator(SceneOf(camera, layers), {});
    const RawDepthMap map = simulator.RenderDepth();
    EXPECT_FALSE(map.integer);
    ASSERT_EQ(map.values.size(), 50u * 40);
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 50; ++x) {
        const double tx = (x - camera.sensor.principal_point_px.x()) / kScalePx;
        const double ty = (y - camera.sensor.principal_point_px.y()) / kScalePx;
        double expected = std::min(300 / (1 - 4 * tx), 300 / (1 + 4 * tx - ty));
        if (std::hypot(x - 30, y - 12) <= 6.2) expected = 290;
        EXPECT_EQ(map.values[static_cast<std::size_t>(y * 50 + x)], static_cast<float>(expected));
      }
    }
    if (turn == 0) first = map.values;
    EXPECT_EQ(map.values, first);
    const SceneTruth truth = simulator.Truth(map);
    EXPECT_EQ(truth.nearest_depth_mm, 290);
    EXPECT_EQ(truth.farthest_depth_mm,
              static_cast<double>(*std::max_element(first.begin(), first.end())));
    EXPECT_NEAR(truth.largest_blur_sigma_px, DefocusPx(290), 1e-9);
    EXPECT_NEAR(truth.focus_depth_mm, kFocusMm, 1e-9);
    EXPECT_EQ(truth.blur_floor_px, 0.5);
  }
}

// --------------------------------------------------------------------- noise, threads, interrupt

SceneSimulationOptions NoisyScene() {
  SceneSimulationOptions options =
      SceneOf(MacroScene::Camera(40, 30, Psf::kGaussian, 0.5),
              {Leaves(303, 2), WithRectangle(Leaves(297, 2), 20, 15, 15, 11)});
  options.rays_per_pixel = 64;
  options.noise_sigma_grey_levels = 2;
  return options;
}

TEST(SceneSimulatorTest, SameBitsOnAnyNumberOfThreads) {
  const SceneSimulator simulator(NoisyScene(), {});
  const SceneSimulator again(NoisyScene(), {});
  const LinearImage one = simulator.RenderNoiseless({1, {}});
  EXPECT_EQ(one.values, again.RenderNoiseless({3, {}}).values);
  EXPECT_EQ(simulator.Store(one).values, again.Store(one).values);
  EXPECT_EQ(simulator.RenderLightField(3, 2, {1, {}}).values,
            again.RenderLightField(3, 2, {3, {}}).values);
  EXPECT_EQ(simulator.RenderDepth().values, again.RenderDepth().values);

  SceneSimulationOptions other = NoisyScene();
  other.seed = 2;
  const SceneSimulator second(other, {});
  EXPECT_NE(one.values, second.RenderNoiseless({1, {}}).values);
  EXPECT_NE(simulator.Store(one).values, second.Store(one).values);
  EXPECT_EQ(simulator.RenderDepth().values, second.RenderDepth().values);
}

TEST(SceneSimulatorTest, NoiseHasItsSigmaInEncodedGreyLevels) {
  for (const int bits : {8, 16}) {
    SceneSimulationOptions options = NoisyScene();
    options.camera.sensor.transfer = TransferCurve::Srgb();
    options.bits = bits;
    const SceneSimulator simulator(options, {});
    const LinearImage flat{60, 60, 3, std::vector<float>(60 * 60 * 3, 0.2f)};
    const EncodedImage stored = simulator.Store(flat);
    EXPECT_EQ(stored.bits, bits);
    const double mean = TransferCurve::Srgb().Encode(0.2) * 255;
    double sum = 0, square = 0;
    for (const std::uint16_t value : stored.values) {
      const double error = value * 255 / stored.full_scale() - mean;
      sum += error / 10800;
      square += error * error / 10800;
    }
    EXPECT_NEAR(sum, 0, 0.09);  // 4.5 standard deviations of the mean
    EXPECT_NEAR(square, 4 + (bits == 8 ? 1.0 / 12 : 0), 4.5 * 4 * std::sqrt(2.0 / 10800));

    options.noise_sigma_grey_levels = 0;
    EXPECT_EQ(SceneSimulator(options, {}).Store(flat).values,
              ToEncoded(flat, TransferCurve::Srgb(), bits).values);
  }
}

TEST(SceneSimulatorTest, ProgressIsReportedAndMayStopIt) {
  const SceneSimulator simulator(NoisyScene(), {});
  std::vector<int> done;
  simulator.RenderNoiseless({2, [&](int count, int total) {
                               EXPECT_EQ(total, 30);
                               done.push_back(count);
                             }});
  ASSERT_EQ(done.size(), 30u);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(done[static_cast<std::size_t>(i)], i + 1);

  std::atomic<int> calls{0};
  EXPECT_THROW(simulator.RenderLightField(3, 3,
                                          {2,
                                           [&](int, int total) {
                                             EXPECT_EQ(total, 3 * 3 * 30);
                                             if (++calls == 5) throw Interrupted();
                                           }}),
               Interrupted);
  EXPECT_LT(calls, 10);
}

// ------------------------------------------------------------------------------------- refusals

TEST(SceneSimulatorTest, RefusesScenesThatCannotBe) {
  const SceneSimulationOptions good = NoisyScene();
  const auto message = [&](const std::function<void(SceneSimulationOptions*)>& change) {
    SceneSimulationOptions options = good;
    change(&options);
    return ErrorOf([&] { SceneSimulator(options, {}); });
  };
  using Options = SceneSimulationOptions;
  EXPECT_EQ(message([](Options*) {}), "(no error)");
  EXPECT_THAT(message([](Options* o) { o->layers.erase(o->layers.begin()); }),
              HasSubstr("none of the 1 is without an outline"));
  EXPECT_THAT(message([](Options* o) { o->layers.clear(); }), HasSubstr("none of the 0"));
  EXPECT_THAT(
      message([](Options* o) { o->layers[1].name = "card", o->layers[1].plane.depth_mm = -1; }),
      HasSubstr("layers[1] 'card': plane.depth_mm is -1"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].plane.depth_mm = 49; }),
              HasSubstr("layers[0]: some rays of the image do not meet its plane, depth_mm 49 "
                        "and slope [0, 0],"));
  // 25 px of slope 0.000075 each: a plane that rises by 600 leaves the right of the image.
  EXPECT_THAT(message([](Options* o) {
                o->layers[0].plane.slope = {700, 0};
              }),
              HasSubstr("some rays of the image do not meet its plane"));
  EXPECT_THAT(message([](Options* o) {
                o->layers[0].plane.slope = {700, 0};
                o->camera.calibration->blur_ratio->value = 0;
              }),
              HasSubstr("some rays of the image do not meet its plane"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].plane.slope.y() = NAN; }),
              HasSubstr("plane.slope is [0, nan]"));
  EXPECT_THAT(message([](Options* o) { o->layers[1].outline.size.x() = 0; }),
              HasSubstr("outline: its size is [0, 11]"));
  EXPECT_THAT(
      message([](Options* o) { o->layers[1].outline.shape = OutlineOptions::Shape::kDisc; }),
      HasSubstr("outline: its radius is 0"));
  EXPECT_THAT(message([](Options* o) { o->layers[1].outline.centre.x() = INFINITY; }),
              HasSubstr("outline: its centre is"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].texture.colour.y() = 1.5; }),
              HasSubstr("texture.colour is [0.5, 1.5, 0.5]"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].texture.contrast = 0; }),
              HasSubstr("texture.contrast is 0"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].texture.saturation = 2; }),
              HasSubstr("texture.saturation is 2"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].texture.feature_size_px = -1; }),
              HasSubstr("texture.feature_size_px is -1"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].texture.feature_size_px = 0.1; }),
              HasSubstr("layers[0]: texture.feature_size_px is 0.1: for dead-leaves"));
  EXPECT_THAT(message([](Options* o) { o->layers[0].texture.angle_deg = NAN; }),
              HasSubstr("texture.angle_deg is nan"));
  EXPECT_THAT(message([](Options* o) {
                o->layers[0].texture.kind = TextureKind::kImage;
                o->layers[0].texture.feature_size_px = 0;
              }),
              HasSubstr("layers[0]: texture.image '' is empty"));
  EXPECT_THAT(message([](Options* o) { o->rays_per_pixel = 15; }),
              HasSubstr("rays_per_pixel is 15"));
  EXPECT_THAT(message([](Options* o) { o->noise_sigma_grey_levels = NAN; }),
              HasSubstr("noise_sigma_grey_levels is nan"));
  EXPECT_THAT(message([](Options* o) { o->bits = 12; }), HasSubstr("bits is 12"));
  EXPECT_THAT(message([](Options* o) { o->v_count = 100; }), HasSubstr("views is 5x100"));
  EXPECT_THAT(message([](Options* o) { o->camera.calibration->blur_ratio.reset(); }),
              HasSubstr("blur_ratio is missing"));
  EXPECT_THAT(message([](Options* o) { o->camera.calibration.reset(); }),
              HasSubstr("image_distance_mm is missing"));
  EXPECT_THAT(message([](Options* o) {
                o->camera.calibration->image_distance_mm->value = kThicknessMm + kRearMm;
              }),
              HasSubstr("focused at infinity"));
  EXPECT_EQ(message([](Options* o) { o->camera.calibration->blur_floor_px.reset(); }),
            "(no error)");
  EXPECT_THAT(ErrorOf([&] {
                SceneSimulator(good, {}).RenderView({30, 0}, {});
              }),
              HasSubstr("aperture position [30, 0] mm"));
}

TEST(SceneSimulatorTest, EveryLayerIsPaintedAnew) {
  const Camera camera = MacroScene::Camera(24, 24, Psf::kGaussian, 0);
  SceneSimulationOptions options = SceneOf(camera, {Leaves(300, 2), Leaves(310, 2)});
  const LinearImage first = SceneSimulator(options, {}).RenderView({0, 0}, {1, {}});
  options.layers[0].plane.depth_mm = 320;
  options.layers[1].plane.depth_mm = 300;
  const LinearImage second = SceneSimulator(options, {}).RenderView({0, 0}, {1, {}});
  EXPECT_GT(LargestDifference(first, second), 0.1);
}

// A pinhole, an outline outside the image, and a slanted outline beyond its plane's horizon.
TEST(SceneSimulatorTest, LimitCasesAreDrawn) {
  SceneSimulationOptions options = NoisyScene();
  options.camera.calibration->blur_ratio->value = 0;
  options.layers[1].outline.centre = {-500, 15};
  SceneLayer steep = Leaves(299, 2);
  steep.plane.slope = {300, 0};
  options.layers.push_back(WithRectangle(steep, 60, 15, 200, 5));
  const SceneSimulator simulator(options, {});
  const LinearImage image = simulator.RenderNoiseless({1, {}});
  for (const float light : image.values) EXPECT_TRUE(light > 0 && light < 1);
  const LightField light_field = simulator.RenderLightField(3, 3, {1, {}});
  EXPECT_EQ(LargestDifference(ViewImage(light_field, 0, 0), ViewImage(light_field, 2, 1)), 0);
}

}  // namespace
}  // namespace thicklens::model
