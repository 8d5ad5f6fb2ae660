// The image of a dot against formulas [S25], [S26] and against a lens traced surface by surface.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/macro_scene.h"
#include "support/matrix_lens.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

using thicklens::testing::MacroScene;
using thicklens::testing::MatrixLens;

constexpr double kPi = 3.14159265358979323846;
const SceneRun kRun{2, {}};
const EffectSet kEffects = {Effect::kDefocus, Effect::kApertureShape, Effect::kOcclusion,
                            Effect::kPixelBox};

struct Spot {
  double sum = 0;
  Eigen::Vector2d centroid_px{0, 0}, variance_px2{0, 0};
};
Spot SpotOf(const LinearImage& image) {
  Spot spot;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double light = static_cast<double>(image.at(x, y, 1));
      const Eigen::Vector2d at_px(x, y);
      spot.sum += light;
      spot.centroid_px += light * at_px;
      spot.variance_px2 += light * at_px.cwiseProduct(at_px);
    }
  }
  spot.centroid_px /= spot.sum;
  spot.variance_px2 =
      spot.variance_px2 / spot.sum - spot.centroid_px.cwiseProduct(spot.centroid_px);
  return spot;
}

// An image of a small soft dot, dark at its sides: a Gaussian of kDotPx, four samples to the px,
// as textures have them, so that nothing is resampled. The limit of their band adds 1/2 px.
constexpr double kDotPx = 1.25;
constexpr int kDotSamples = 64;
LinearImage DotImage() {
  LinearImage image{kDotSamples, kDotSamples, 1, {}};
  const auto gauss = [](int i) {
    return std::exp(-std::pow((i - (kDotSamples - 1) / 2.0) / (4 * kDotPx), 2) / 2);
  };
  for (int y = 0; y < kDotSamples; ++y) {
    for (int x = 0; x < kDotSamples; ++x) {
      image.values.push_back(static_cast<float>(gauss(x) * gauss(y)));
    }
  }
  return image;
}
constexpr double kDotVariancePx2 = kDotPx * kDotPx + 0.25;
constexpr double kDotLightPx2 = 2 * kPi * kDotPx * kDotPx;

// A small bright dot off the axis, through lenses of every sort that are traced surface by surface:
// the place and the width of its image, of the photograph and of a view beside the middle.
TEST(TracedDotTest, ADotsImageIsWhereAndAsWideAsTheTracedLensPutsIt) {
  constexpr double kPitchMm = 0.005, kRatio = 0.45;
  const Eigen::Vector2d axis_px(-210.3, 160.2), wanted_px(19.2, 20.4);
  int number = 0;
  for (const MatrixLens& lens : testing::MatrixLenses()) {
    const Psf psf = ++number % 2 == 0 ? Psf::kGaussian : Psf::kDisc;
    const double focus_mm = 12 * lens.AsThickLens(1).front_focal_length_mm;
    const double image_mm = lens.ConjugateMm(focus_mm);
    for (const double depth_mm : {0.85 * focus_mm, focus_mm, 1.3 * focus_mm}) {
      SCOPED_TRACE(lens.name() + ", depth/focus " + std::to_string(depth_mm / focus_mm));
      // On the sensor, for 1 mm on the aperture and for 1 mm on the object.
      const auto per_aperture = [&](double at_mm) { return lens.Landing(0, at_mm, 1, image_mm); };
      const double per_object = lens.Landing(1, depth_mm, 0, image_mm);
      // 2.5 px of sigma at the far depth.
      const double radius_mm = 2.5 * kPitchMm / (kRatio * std::abs(per_aperture(1.3 * focus_mm)));
      Camera camera = MacroScene::Camera(40, 40, psf);
      camera.lens = lens.AsThickLens(radius_mm);
      camera.sensor.pixel_pitch_mm = kPitchMm;
      camera.sensor.principal_point_px = axis_px;
      camera.calibration->image_distance_mm->value = image_mm;
      // The image is turned: x = cx - i_x/p.
      SceneLayer dot = MacroScene::Uniform(depth_mm, 1);
      dot.texture.kind = TextureKind::kImage;
      dot.texture.feature_size_px = kDotSamples / 4.0;
      dot.outline.shape = OutlineOptions::Shape::kRectangle;
      dot.outline.unit = OutlineOptions::Unit::kMm;
      dot.outline.centre = -kPitchMm / per_object * (wanted_px - axis_px);
      dot.outline.size.setConstant(kDotSamples / 4 * kPitchMm / std::abs(per_object));
      const SceneSimulator simulator(
          MacroScene::Options(camera, {dot, MacroScene::Uniform(2 * focus_mm, 0)}, kEffects, 1000),
          {{DotImage(), {}, {}}});

      // [S25], [S26]: sigma = kappa r |c(z)|, c = [f1 D - (D - f2) z]/(f2 z), D = d1 - rho.
      const ThickLens& thick = camera.lens;
      const double d_mm = image_mm - thick.lens_thickness_mm;
      const double c =
          (thick.front_focal_length_mm * d_mm - (d_mm - thick.rear_focal_length_mm) * depth_mm) /
          (thick.rear_focal_length_mm * depth_mm);
      EXPECT_NEAR(std::abs(c), std::abs(per_aperture(depth_mm)), 1e-12);
      const double sigma_px = kRatio * radius_mm * std::abs(c) / kPitchMm;

      const Spot photographed = SpotOf(simulator.RenderNoiseless(kRun));
      EXPECT_LT((photographed.centroid_px - wanted_px).norm(), 2e-5);
      const double variance_px2 = sigma_px * sigma_px + kDotVariancePx2 + 1.0 / 12;
      EXPECT_NEAR(photographed.variance_px2.x(), variance_px2, 0.005 * variance_px2);
      EXPECT_NEAR(photographed.variance_px2.y(), variance_px2, 0.005 * variance_px2);
      EXPECT_NEAR(photographed.sum / kDotLightPx2, 1, 1e-4);

      const Eigen::Vector2d aperture_mm = radius_mm * Eigen::Vector2d(0.8, -0.5);
      const Spot seen = SpotOf(simulator.RenderView(aperture_mm, kRun));
      Eigen::Vector2d expected_px;
      for (int i = 0; i < 2; ++i) {
        expected_px(i) =
            axis_px(i) -
            lens.Landing(dot.outline.centre(i), depth_mm, aperture_mm(i), image_mm) / kPitchMm;
      }
      EXPECT_LT((seen.centroid_px - expected_px).norm(), 2e-5);
    }
  }
}

}  // namespace
}  // namespace thicklens::model
