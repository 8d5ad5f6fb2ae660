#include "thicklens/estimator/render.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "estimator/views/ray_irradiance.h"
#include "estimator/views/ray_landing.h"
#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;
using thicklens::testing::WideLens;

const double kPi = std::acos(-1.0);

model::LightField FieldOf(int s_count, int t_count, int u_count, int v_count, int channels,
                          const std::function<double(int, int, int, int, int)>& value) {
  model::LightField field = model::MakeLightField(s_count, t_count, u_count, v_count, channels);
  std::size_t i = 0;
  for (int c = 0; c < channels; ++c) {
    for (int l = 0; l < v_count; ++l) {
      for (int k = 0; k < u_count; ++k) {
        for (int t = 0; t < t_count; ++t) {
          for (int s = 0; s < s_count; ++s) {
            field.values[i++] = static_cast<float>(value(s, t, k, l, c));
          }
        }
      }
    }
  }
  return field;
}

model::LightField RandomField(int s_count, int t_count, int u_count, int v_count, int channels,
                              unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  return FieldOf(s_count, t_count, u_count, v_count, channels,
                 [&](int, int, int, int, int) { return uniform(engine); });
}

Eigen::ArrayXXd RandomWeights(int u_count, int v_count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0.1, 1);
  return Eigen::ArrayXXd::NullaryExpr(v_count, u_count, [&] { return uniform(engine); });
}

// A wide field on few pixels, so that the fall-off is large.
model::Camera WideCamera(model::Psf psf = model::Psf::kGaussian) {
  model::Camera camera =
      TestCameraFocusedAt(640, "wide", WideLens(), TestSensor(15, 11, 0.9, {6, 4}));
  camera.psf = psf;
  return camera;
}

// Gives the light field a camera on those planes.
void AddCamera(model::LightField* field, const model::LightFieldPlanes& planes,
               model::Psf psf = model::Psf::kGaussian, double pitch_mm = 0.9) {
  model::Camera camera = WideCamera(psf);
  camera.sensor.width_px = field->s_count;
  camera.sensor.height_px = field->t_count;
  camera.sensor.pixel_pitch_mm = pitch_mm;
  field->grid = model::GridOnPlanes(camera, planes, field->u_count, field->v_count);
  field->camera = camera;
  field->landing_step_px = LandingStepPx(camera, *field->grid);
}

const model::LightFieldPlanes kInFocus{0, 640};
// ST off the plane of focus: rays land beside their samples.
const model::LightFieldPlanes kOffFocus{60, 100};

double IrradianceAt(const model::LightField& field, const model::Ray& ray) {
  return model::RelativeIrradiance(field.camera->lens, field.camera->image_distance_mm(),
                                   field.grid->planes, ray);
}

model::LinearImage TakePhotograph(const model::LightField& field, const Eigen::ArrayXXd& weights,
                                  bool falloff, int threads = 1) {
  const model::Camera* camera = falloff && field.camera ? &*field.camera : nullptr;
  const auto reference = kernels::NewReference<float>();
  model::LinearImage photograph =
      Photograph(field, weights, camera, nullptr, reference.get(), threads);
  const model::LinearImage cpu = Photograph(field, weights, camera, nullptr, nullptr, threads);
  for (std::size_t i = 0; i < photograph.values.size(); ++i) {
    EXPECT_NEAR(cpu.values[i], photograph.values[i], 2e-6) << i;
  }
  return photograph;
}

// --- The photograph.

TEST(Photograph, IsTheWeightedMeanOfTheViews) {
  model::LightField field = RandomField(9, 7, 3, 5, 3, 1);
  const Eigen::ArrayXXd weights = 3 * RandomWeights(3, 5, 2);
  field.present.assign(15, true);
  field.present[1 * 3 + 2] = field.present[4 * 3] = false;
  const model::LinearImage image = TakePhotograph(field, weights, true);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 9; ++x) {
      for (int c = 0; c < 3; ++c) {
        double sum = 0;
        double weight = 0;
        for (int l = 0; l < 5; ++l) {
          for (int k = 0; k < 3; ++k) {
            if ((k == 2 && l == 1) || (k == 0 && l == 4)) continue;
            sum += weights(l, k) * model::ViewImage(field, k, l).at(x, y, c);
            weight += weights(l, k);
          }
        }
        EXPECT_NEAR(image.at(x, y, c), sum / weight, 1e-6);
      }
    }
  }
}

// Each ray shares its light between the pixels around its landing point, and a pixel is the mean of
// the light that reaches it. Rays that land nearest to a pixel outside of the image are not
// counted.
TEST(Photograph, PutsEachRayWhereItLands) {
  model::LightField field = RandomField(15, 11, 5, 3, 1, 3);
  field.landing_step_px = {0.7, -1.35};
  const Eigen::ArrayXXd weights = RandomWeights(5, 3, 4);
  const model::LinearImage image = TakePhotograph(field, weights, false);
  std::vector<double> sum(15 * 11, 0.0);
  std::vector<double> weight(15 * 11, 0.0);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 5; ++k) {
      for (int t = 0; t < 11; ++t) {
        for (int s = 0; s < 15; ++s) {
          const double landing_x = s + 0.7 * (k - 2);
          const double landing_y = t - 1.35 * (l - 1);
          if (landing_x < -0.5 || landing_x >= 14.5 || landing_y < -0.5 || landing_y >= 10.5) {
            continue;
          }
          for (int y = 0; y < 11; ++y) {
            for (int x = 0; x < 15; ++x) {
              const double hat = std::max(0.0, 1 - std::abs(landing_x - x)) *
                                 std::max(0.0, 1 - std::abs(landing_y - y));
              const auto i = static_cast<std::size_t>(y * 15 + x);
              sum[i] +=
                  weights(l, k) * hat *
                  field.values[field.ViewStart(0, k, l) + static_cast<std::size_t>(t * 15 + s)];
              weight[i] += weights(l, k) * hat;
            }
          }
        }
      }
    }
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    EXPECT_NEAR(image.values[i], sum[i] / weight[i], 1e-5);
  }
}

TEST(Photograph, OfAUniformRadianceIsUniform) {
  for (const model::LightFieldPlanes& planes : {kInFocus, kOffFocus}) {
    model::LightField field = FieldOf(15, 11, 3, 3, 3, [](int, int, int, int, int) { return 0.7; });
    AddCamera(&field, planes);
    for (const float value : TakePhotograph(field, RandomWeights(3, 3, 5), false).values) {
      EXPECT_NEAR(value, 0.7, 1e-6);
    }
  }
}

// By [S12], the light of a pixel is the sum of its rays' radiance times cos(alpha) cos^3(beta).
TEST(Photograph, WeakensRaysByTheirIrradiance) {
  model::LightField field = RandomField(15, 11, 3, 3, 3, 6);
  AddCamera(&field, kInFocus);
  field.present.assign(9, true);
  field.present[5] = false;
  const Eigen::ArrayXXd weights = RandomWeights(3, 3, 7);
  const model::LinearImage image = TakePhotograph(field, weights, true);
  double weight = 0;
  std::vector<double> sum(image.values.size(), 0.0);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      if (k == 2 && l == 1) continue;
      const double on_axis = IrradianceAt(field, field.grid->RayAt(6, 4, k, l));
      weight += weights(l, k);
      const model::LinearImage view = model::ViewImage(field, k, l);
      for (int y = 0; y < 11; ++y) {
        for (int x = 0; x < 15; ++x) {
          for (int c = 0; c < 3; ++c) {
            sum[static_cast<std::size_t>((y * 15 + x) * 3 + c)] +=
                weights(l, k) * view.at(x, y, c) *
                IrradianceAt(field, field.grid->RayAt(x, y, k, l)) / on_axis;
          }
        }
      }
    }
  }
  double weakest = 1;
  for (std::size_t i = 0; i < sum.size(); ++i) {
    EXPECT_NEAR(image.values[i], sum[i] / weight, 2e-6);
    weakest = std::min(weakest, sum[i] / weight);
  }
  EXPECT_LT(weakest, 0.3);  // otherwise the effect would be invisible
}

TEST(Photograph, OfAUniformRadianceIsOneAtThePrincipalPointAndFallsOffAroundIt) {
  // All rays of the principal point exist in both cases.
  for (const model::LightFieldPlanes& planes : {kInFocus, {60, 300}}) {
    model::LightField field = FieldOf(15, 11, 5, 5, 1, [](int, int, int, int, int) { return 1.0; });
    // Fine pixels where rays land between them, so that the mean over a pixel is that of its
    // middle.
    AddCamera(&field, planes, model::Psf::kGaussian, planes.uv_depth_mm > 0 ? 0.05 : 0.9);
    const model::LinearImage image =
        TakePhotograph(field, model::ApertureWeights(model::ApertureShape::kGaussian, 5, 5), true);
    EXPECT_NEAR(image.at(6, 4, 0), 1, planes.uv_depth_mm > 0 ? 1e-4 : 1e-6);
    EXPECT_LT(image.at(14, 4, 0), image.at(10, 4, 0));
    EXPECT_LT(image.at(10, 4, 0), image.at(6, 4, 0));
    EXPECT_LT(image.at(6, 10, 0), image.at(6, 7, 0));
  }
}

TEST(Photograph, HasTheSameBitsForAnyNumberOfThreads) {
  model::LightField field = RandomField(15, 11, 5, 5, 3, 8);
  AddCamera(&field, kInFocus);
  const Eigen::ArrayXXd weights = RandomWeights(5, 5, 9);
  EXPECT_EQ(TakePhotograph(field, weights, true, 1).values,
            TakePhotograph(field, weights, true, 3).values);
}

TEST(Photograph, RefusesWeightsThatDoNotFit) {
  model::LightField field = RandomField(4, 3, 3, 5, 1, 10);
  const auto error_for = [&field](const Eigen::ArrayXXd& weights) {
    return ErrorOf([&] { TakePhotograph(field, weights, false); });
  };
  EXPECT_THAT(error_for(Eigen::ArrayXXd::Ones(3, 5)), AllOf(HasSubstr("5x3"), HasSubstr("3x5")));
  EXPECT_THAT(error_for(-Eigen::ArrayXXd::Ones(5, 3)), HasSubstr(">= 0"));
  EXPECT_THAT(error_for(Eigen::ArrayXXd::Zero(5, 3)), HasSubstr("weight > 0"));
  Eigen::ArrayXXd only_absent = Eigen::ArrayXXd::Zero(5, 3);
  only_absent(0, 1) = 1;
  field.present.assign(15, true);
  field.present[1] = false;
  EXPECT_THAT(error_for(only_absent), HasSubstr("present"));
}

// A light field that was estimated with whole rays to the nearest pixel is put together so.
TEST(Photograph, PutsWholeRaysToTheNearestPixelWhereTheEstimateDid) {
  model::LightField field = RandomField(15, 11, 5, 3, 1, 33);
  field.landing_step_px = {0.7, -1.35};
  field.origin.splat = "nearest";
  const Eigen::ArrayXXd weights = RandomWeights(5, 3, 34);
  const model::LinearImage image = TakePhotograph(field, weights, false);
  std::vector<double> sum(15 * 11, 0.0);
  std::vector<double> weight(15 * 11, 0.0);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 5; ++k) {
      for (int t = 0; t < 11; ++t) {
        for (int s = 0; s < 15; ++s) {
          const double x = std::floor(s + 0.7 * (k - 2) + 0.5);
          const double y = std::floor(t - 1.35 * (l - 1) + 0.5);
          if (!(x >= 0 && x < 15 && y >= 0 && y < 11)) continue;
          const auto i = static_cast<std::size_t>(y * 15 + x);
          sum[i] += weights(l, k) * model::ViewImage(field, k, l).at(s, t, 0);
          weight[i] += weights(l, k);
        }
      }
    }
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    ASSERT_GT(weight[i], 0);
    EXPECT_NEAR(image.values[i], sum[i] / weight[i], 1e-6) << i;
  }
}

// --- Fall-off, as the estimator uses it.

TEST(RelativeFalloff, IsTheIrradianceOverThatAtThePrincipalPoint) {
  for (const model::LightFieldPlanes& planes : {kInFocus, kOffFocus}) {
    model::LightField field = RandomField(15, 11, 3, 5, 1, 11);
    AddCamera(&field, planes);
    const Eigen::ArrayXXd weights = 2 * RandomWeights(3, 5, 12);
    // The view's ray that lands at the principal point, found by bisection of [S16].
    model::Ray ray = field.grid->RayAt(0, 0, 2, 1);
    for (double* position : {&ray.s_mm, &ray.t_mm}) {
      double low = -1e4;
      double high = 1e4;
      for (int n = 0; n < 80; ++n) {
        *position = (low + high) / 2;
        const Eigen::Vector2d landing = model::LandingPointMm(
            field.camera->lens, field.camera->image_distance_mm(), planes, ray);
        // P < 0: a larger s lands at a smaller i_x.
        ((position == &ray.s_mm ? landing.x() : landing.y()) > 0 ? low : high) = *position;
      }
    }
    const double unit = IrradianceAt(field, ray);
    const std::vector<float> falloff = RelativeFalloff(*field.grid, *field.camera, weights, 2, 1);
    ASSERT_EQ(falloff.size(), 165U);
    for (const auto& [i, j] : {std::pair{0, 0}, {14, 0}, {6, 4}, {3, 10}}) {
      EXPECT_NEAR(falloff[static_cast<std::size_t>(j * 15 + i)],
                  IrradianceAt(field, field.grid->RayAt(i, j, 2, 1)) / unit, 1e-6);
    }
  }
}

// H with the nearest pixel for g, applied to a uniform radiance.
TEST(FalloffOfImage, IsTheMeanOfTheRaysNearestToAPixel) {
  for (const model::LightFieldPlanes& planes : {kInFocus, kOffFocus}) {
    model::LightField field = RandomField(15, 11, 3, 5, 1, 13);
    AddCamera(&field, planes, model::Psf::kGaussian, 0.15);
    const Eigen::ArrayXXd weights = RandomWeights(3, 5, 14);
    std::vector<double> sum(165, 0.0);
    std::vector<double> weight(165, 0.0);
    for (int l = 0; l < 5; ++l) {
      for (int k = 0; k < 3; ++k) {
        const std::vector<float> falloff =
            RelativeFalloff(*field.grid, *field.camera, weights, k, l);
        for (int t = 0; t < 11; ++t) {
          for (int s = 0; s < 15; ++s) {
            const Eigen::Vector2d landing = model::ImagePositionPx(
                field.camera->sensor,
                model::LandingPointMm(field.camera->lens, field.camera->image_distance_mm(), planes,
                                      field.grid->RayAt(s, t, k, l)));
            const double x = std::floor(landing.x() + 0.5);
            const double y = std::floor(landing.y() + 0.5);
            if (!(x >= 0 && x < 15 && y >= 0 && y < 11)) continue;
            const auto i = static_cast<std::size_t>(y * 15 + x);
            sum[i] += weights(l, k) * falloff[static_cast<std::size_t>(t * 15 + s)];
            weight[i] += weights(l, k);
          }
        }
      }
    }
    const std::vector<float> falloff = FalloffOfImage(*field.grid, *field.camera, weights, 15, 11);
    EXPECT_EQ(falloff, FalloffOfImage(*field.grid, *field.camera, weights, 15, 11, 3));
    int shifted = 0;
    for (std::size_t i = 0; i < sum.size(); ++i) {
      shifted += weight[i] < weights.sum() - 1e-9 ? 1 : 0;
      if (weight[i] > 0) {
        EXPECT_NEAR(falloff[i], sum[i] / weight[i], 1e-6) << i;
      } else {
        EXPECT_GT(falloff[i], 0);
      }
    }
    EXPECT_EQ(shifted > 0, planes.uv_depth_mm > 0);
  }
}

TEST(RelativeFalloff, RefusesWeightsThatDoNotFit) {
  model::LightField field = RandomField(4, 3, 3, 5, 1, 15);
  AddCamera(&field, kInFocus);
  EXPECT_THAT(ErrorOf([&] {
                RelativeFalloff(*field.grid, *field.camera, Eigen::ArrayXXd::Ones(3, 5), 0, 0);
              }),
              HasSubstr("5x3"));
  EXPECT_THAT(ErrorOf([&] {
                FalloffOfImage(*field.grid, *field.camera, Eigen::ArrayXXd::Zero(5, 3), 4, 3);
              }),
              HasSubstr("sum is 0"));
}

// --- Other apertures.

TEST(WeightsForRadius, TheCapturedApertureGivesTheOwnWeights) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    model::LightField field = RandomField(4, 3, 5, 3, 1, 16);
    AddCamera(&field, kInFocus, psf);
    field.weights = model::ApertureWeights(model::ApertureShapeOf(psf), 5, 3);
    const Eigen::ArrayXXd weights = WeightsForRadius(field, field.camera->lens.aperture_radius_mm);
    EXPECT_LT((weights - field.weights).abs().maxCoeff(), 1e-12);
  }
}

// The blur of a smaller aperture is kappa R. The samples are few, so only nearly: they carry kappa
// r exactly, and the Gaussian between them is cut at two standard deviations.
TEST(WeightsForRadius, ASmallerApertureCarriesItsOwnBlur) {
  for (const model::LightFieldPlanes& planes : {kInFocus, kOffFocus}) {
    model::LightField field = RandomField(4, 3, 9, 9, 1, 16);
    AddCamera(&field, planes);
    field.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 9, 9);
    const model::ApertureSamples samples =
        model::SampleAperture(model::Psf::kGaussian, 0.45, 4.46, 9, 9);
    double before = 2;
    for (const double share : {0.9, 0.7, 0.5, 0.35}) {
      const Eigen::ArrayXXd weights = WeightsForRadius(field, share * 4.46);
      EXPECT_NEAR(weights.sum(), 1, 1e-12);
      double moment = 0;
      for (int l = 0; l < 9; ++l) {
        for (int k = 0; k < 9; ++k) {
          moment += weights(l, k) * std::pow((k - 4) * samples.u_step_mm, 2);
        }
      }
      const double blur_ratio = std::sqrt(moment) / (0.45 * 4.46);
      EXPECT_NEAR(blur_ratio, share, 0.05) << share;
      EXPECT_LT(blur_ratio, before);
      before = blur_ratio;
    }
  }
}

// The rim may run through views: they are inside, whatever the rounding.
TEST(WeightsForRadius, IsADiscOfTwiceKappaTimesTheRadius) {
  model::LightField field = RandomField(4, 3, 9, 9, 1, 17);
  AddCamera(&field, kInFocus, model::Psf::kDisc);
  const double step_mm = field.grid->u_step_mm;
  for (const int squared_steps : {1, 2, 4, 5, 8, 9, 10, 13, 16, 17, 18, 20, 25}) {
    const auto views_within = [](double squared) {
      int views = 0;
      for (int b = -4; b <= 4; ++b) {
        for (int a = -4; a <= 4; ++a) views += a * a + b * b <= squared ? 1 : 0;
      }
      return views;
    };
    const double radius_mm = std::sqrt(squared_steps) * step_mm / (2 * 0.45);
    if (radius_mm > field.camera->lens.aperture_radius_mm) break;
    const Eigen::ArrayXXd on_rim = WeightsForRadius(field, radius_mm);
    EXPECT_EQ((on_rim > 0).count(), views_within(squared_steps)) << squared_steps;
    EXPECT_NEAR(on_rim.maxCoeff(), 1.0 / views_within(squared_steps), 1e-12);
    EXPECT_EQ((WeightsForRadius(field, 0.99 * radius_mm) > 0).count(),
              views_within(0.98 * squared_steps))
        << squared_steps;
  }
}

TEST(WeightsForRadius, CountsInViewStepsWithoutACamera) {
  const model::LightField field = RandomField(4, 3, 7, 7, 1, 18);
  EXPECT_EQ((WeightsForRadius(field, 1) > 0).count(), 5);
  EXPECT_EQ((WeightsForRadius(field, 1.42) > 0).count(), 9);
  const Eigen::ArrayXXd all = WeightsForRadius(field, 100);
  EXPECT_NEAR(all.minCoeff(), 1.0 / 49, 1e-15);
  EXPECT_NEAR(all.maxCoeff(), 1.0 / 49, 1e-15);
}

TEST(WeightsForRadius, FallsBackToTheViewsNearestToTheCentre) {
  const Eigen::ArrayXXd one = WeightsForRadius(RandomField(4, 3, 3, 3, 1, 19), 0);
  EXPECT_EQ(one(1, 1), 1);
  EXPECT_EQ((one > 0).count(), 1);
  const Eigen::ArrayXXd four = WeightsForRadius(RandomField(4, 3, 4, 4, 1, 20), 0.3);
  EXPECT_EQ((four > 0).count(), 4);
  EXPECT_EQ(four(1, 2), 0.25);

  model::LightField without_centre = RandomField(4, 3, 3, 5, 1, 21);
  without_centre.present.assign(15, true);
  without_centre.present[2 * 3 + 1] = false;
  const Eigen::ArrayXXd around = WeightsForRadius(without_centre, 0);
  EXPECT_EQ((around > 0).count(), 4);
  EXPECT_EQ(around(2, 1), 0);
  EXPECT_EQ(WeightsForRadius(without_centre, 9)(2, 1), 0);

  // A Gaussian so narrow that nothing of it is left.
  model::LightField even = RandomField(4, 3, 2, 2, 1, 22);
  AddCamera(&even, kInFocus);
  EXPECT_EQ((WeightsForRadius(even, 1e-3) == 0.25).count(), 4);
  EXPECT_EQ((WeightsForRadius(even, 0) == 0.25).count(), 4);
}

TEST(WeightsForRadius, RefusesWhatIsNoRadius) {
  const model::LightField field = RandomField(4, 3, 3, 3, 1, 23);
  EXPECT_THAT(ErrorOf([&] { WeightsForRadius(field, -1); }), HasSubstr("-1 view steps"));
  EXPECT_THAT(ErrorOf([&] { WeightsForRadius(field, std::nan("")); }), HasSubstr("nan"));
  model::LightField with_camera = field;
  AddCamera(&with_camera, kInFocus);
  EXPECT_THAT(ErrorOf([&] { WeightsForRadius(with_camera, 4.5); }),
              AllOf(HasSubstr("4.5 mm"), HasSubstr("4.46 mm"), HasSubstr("never captured")));
}

// --- Refocusing.

// Views of a texture parallel to the image: the point at x in the centre view is at x - a d.
model::LightField LayerField(int u_count, int v_count, double u_px, double v_px,
                             const std::function<double(double, double)>& texture) {
  return FieldOf(32, 26, u_count, v_count, 1, [&](int s, int t, int k, int l, int) {
    return texture(s + (k - (u_count - 1) / 2.0) * u_px, t + (l - (v_count - 1) / 2.0) * v_px);
  });
}

double Waves(double x, double y) {
  return 0.5 + 0.3 * std::sin(2 * kPi * x / 11 + 0.3) * std::cos(2 * kPi * y / 13);
}

TEST(Refocus, BringsBackTheCentreViewOfALayer) {
  for (const auto& [u_px, v_px] : {std::pair{1.0, 1.0}, {0.63, -0.41}, {-1.0, 2.0}}) {
    for (const int u_count : {5, 4}) {
      const model::LightField field = LayerField(u_count, 3, u_px, v_px, Waves);
      const model::LinearImage image = Refocus(field, u_px, v_px, RandomWeights(u_count, 3, 24), 1);
      const bool whole = u_px == std::round(u_px) && u_count == 5;
      for (int y = 0; y < 26; ++y) {
        for (int x = 0; x < 32; ++x) {
          // Whole shifts are exact up to the border, where fewer views have a share; taps of the
          // cubic convolution are repeated there.
          const bool inside = x >= 4 && x < 28 && y >= 4 && y < 22;
          if (!whole && !inside) continue;
          EXPECT_NEAR(image.at(x, y, 0), Waves(x, y), whole ? 1e-6 : 4e-3) << x << ", " << y;
        }
      }
    }
  }
}

// Exact for a texture of the second degree: which tap belongs to which sample.
TEST(Refocus, IsExactForAQuadraticTexture) {
  const auto texture = [](double x, double y) {
    return 0.01 * x * x - 0.02 * x * y + 0.005 * y * y;
  };
  const model::LightField field = LayerField(3, 3, 0.37, -1.61, texture);
  const model::LinearImage image = Refocus(field, 0.37, -1.61, RandomWeights(3, 3, 25), 1);
  for (int y = 3; y < 23; ++y) {
    for (int x = 3; x < 29; ++x) EXPECT_NEAR(image.at(x, y, 0), texture(x, y), 2e-5);
  }
}

TEST(Refocus, AveragesTheViewsThatAreInside) {
  const model::LightField field = RandomField(12, 9, 3, 1, 3, 26);
  const Eigen::ArrayXXd weights = RandomWeights(3, 1, 27);
  const model::LinearImage image = Refocus(field, 4, 0, weights, 1);
  for (int x = 0; x < 12; ++x) {
    for (int c = 0; c < 3; ++c) {
      double sum = 0;
      double weight = 0;
      for (int k = 0; k < 3; ++k) {
        const int s = x - (k - 1) * 4;
        if (s < 0 || s >= 12) continue;
        sum += weights(0, k) * model::ViewImage(field, k, 0).at(s, 5, c);
        weight += weights(0, k);
      }
      EXPECT_NEAR(image.at(x, 5, c), sum / weight, 1e-6) << x;
    }
  }
}

TEST(Refocus, IsBlackWhereNoViewIs) {
  model::LightField field = FieldOf(12, 9, 3, 1, 1, [](int, int, int, int, int) { return 1.0; });
  field.present = {true, false, false};
  const Eigen::ArrayXXd weights = Eigen::ArrayXXd::Ones(1, 3);
  const model::LinearImage image = Refocus(field, 5, 0, weights, 1);  // x + 5 of the first view
  for (int x = 0; x < 12; ++x) EXPECT_EQ(image.at(x, 4, 0), x <= 6 ? 1 : 0) << x;
  for (const float value : Refocus(field, 1e12, 0, weights, 1).values) EXPECT_EQ(value, 0);
}

TEST(Refocus, AtZeroIsThePhotographWithoutFalloff) {
  const model::LightField field = RandomField(15, 11, 3, 5, 3, 28);
  const Eigen::ArrayXXd weights = RandomWeights(3, 5, 29);
  const model::LinearImage refocused = Refocus(field, 0, 0, weights, 1);
  const model::LinearImage photograph = TakePhotograph(field, weights, false);
  for (std::size_t i = 0; i < photograph.values.size(); ++i) {
    EXPECT_NEAR(refocused.values[i], photograph.values[i], 1e-6);
  }
}

TEST(Refocus, HasTheSameBitsForAnyNumberOfThreads) {
  const model::LightField field = RandomField(15, 11, 5, 5, 3, 30);
  const Eigen::ArrayXXd weights = RandomWeights(5, 5, 31);
  EXPECT_EQ(Refocus(field, 0.3, -0.7, weights, 1).values,
            Refocus(field, 0.3, -0.7, weights, 4).values);
}

TEST(DisparityAtDepthPx, IsThatOfTheCamerasViews) {
  model::LightField field = RandomField(15, 11, 3, 7, 1, 32);
  EXPECT_THAT(ErrorOf([&] { DisparityAtDepthPx(field, 500); }), HasSubstr("no camera"));
  AddCamera(&field, kInFocus);
  const model::ApertureSamples samples =
      model::SampleAperture(model::Psf::kGaussian, 0.45, 4.46, 3, 7);
  ASSERT_GT(std::abs(samples.u_step_mm - samples.v_step_mm), 0.1);
  for (const double depth_mm : {300.0, 640.0, 2000.0}) {
    const Eigen::Vector2d disparity_px = DisparityAtDepthPx(field, depth_mm);
    EXPECT_NEAR(disparity_px.x(), model::DisparityPx(*field.camera, samples.u_step_mm, depth_mm),
                1e-9);
    EXPECT_NEAR(disparity_px.y(), model::DisparityPx(*field.camera, samples.v_step_mm, depth_mm),
                1e-9);
  }
}

// --- All views at a glance.

// Tells the view, the sample and the channel.
double Label(int s, int t, int k, int l, int c) {
  return s + 10 * t + 100 * k + 1000 * l + 10000 * c;
}

TEST(Mosaic, HasTheViewsSideBySide) {
  const model::LightField field = FieldOf(4, 3, 2, 3, 3, Label);
  const model::LinearImage mosaic = Mosaic(field, 2);
  ASSERT_EQ(mosaic.width_px, 4 + 2 + 4);
  ASSERT_EQ(mosaic.height_px, 3 + 2 + 3 + 2 + 3);
  ASSERT_EQ(mosaic.channels, 3);
  EXPECT_EQ(mosaic.at(0, 0, 0), 0);
  EXPECT_EQ(mosaic.at(3, 2, 1), Label(3, 2, 0, 0, 1));
  EXPECT_EQ(mosaic.at(4, 2, 1), 0);
  EXPECT_EQ(mosaic.at(6, 0, 2), Label(0, 0, 1, 0, 2));
  EXPECT_EQ(mosaic.at(9, 12, 2), Label(3, 2, 1, 2, 2));
  EXPECT_EQ(mosaic.at(1, 4, 1), 0);
  EXPECT_EQ(Mosaic(field, 0).width_px, 8);
  EXPECT_THAT(ErrorOf([&] { Mosaic(field, -1); }), HasSubstr("gap_px is -1"));
}

TEST(Epipolar, StacksARowOrAColumnOfAllViews) {
  const model::LightField field = FieldOf(4, 3, 2, 3, 3, Label);
  const model::LinearImage row = EpipolarRow(field, 1, 2, 2);
  ASSERT_EQ(row.width_px, 4);
  ASSERT_EQ(row.height_px, 2 * 2);
  EXPECT_EQ(row.at(3, 1, 0), Label(3, 1, 0, 2, 0));
  EXPECT_EQ(row.at(2, 2, 2), Label(2, 1, 1, 2, 2));
  const model::LinearImage column = EpipolarColumn(field, 3, 1, 4);
  ASSERT_EQ(column.width_px, 3 * 4);
  ASSERT_EQ(column.height_px, 3);
  EXPECT_EQ(column.at(3, 0, 0), Label(3, 0, 1, 0, 0));
  EXPECT_EQ(column.at(4, 2, 1), Label(3, 2, 1, 1, 1));
  EXPECT_EQ(column.at(11, 1, 2), Label(3, 1, 1, 2, 2));

  EXPECT_THAT(ErrorOf([&] { EpipolarRow(field, 3, 0, 1); }), HasSubstr("row t is 3"));
  EXPECT_THAT(ErrorOf([&] { EpipolarRow(field, 0, -1, 1); }), HasSubstr("view row l is -1"));
  EXPECT_THAT(ErrorOf([&] { EpipolarRow(field, 0, 0, 0); }), HasSubstr("repeat_px is 0"));
  EXPECT_THAT(ErrorOf([&] { EpipolarColumn(field, 4, 0, 1); }), HasSubstr("column s is 4"));
  EXPECT_THAT(ErrorOf([&] { EpipolarColumn(field, 0, 2, 1); }), HasSubstr("view column k is 2"));
}

}  // namespace
}  // namespace thicklens::estimator
