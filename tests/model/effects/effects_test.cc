#include "thicklens/model/effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "model/effects/effect_bounds.h"
#include "model/optics/airy.h"
#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/model/blur_transfer.h"
#include "thicklens/model/effect_impact.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::model {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;
using thicklens::testing::ThickMacroLens;

constexpr double kPi = 3.14159265358979323846;

// A thick lens of f/5.6 with 4.5 um pixels, focused at 300 mm.
Camera TheCamera(Psf psf = Psf::kGaussian, double floor_px = 0.5) {
  const ThickLens lens = ThickMacroLens(4.46);
  Camera camera = TestCameraFocusedAt(300, "macro", lens, TestSensor(640, 480, 0.0045, {300, 250}));
  camera.psf = psf;
  camera.calibration->blur_floor_px = Estimate{floor_px, 0};
  return camera;
}

EffectConditions ConditionsOf(const Camera& camera) {
  EffectConditions conditions;
  conditions.camera = camera;
  return conditions;
}

EffectSite PlaceAt(double x, double y, double depth_mm) {
  EffectSite place;
  place.position_px = {x, y};
  place.depth_mm = depth_mm;
  return place;
}

TEST(EffectsTest, NamesAndSetsGoBothWays) {
  EXPECT_EQ(AllEffects().size(), 25U);
  for (std::size_t i = 0; i < AllEffects().size(); ++i) {
    const EffectFacts& facts = AllEffects()[i];
    EXPECT_EQ(static_cast<std::size_t>(facts.effect), i);
    EXPECT_EQ(EffectFromName(facts.name), facts.effect);
    EXPECT_TRUE(EffectSet::All().Has(facts.effect));
  }
  const EffectSet two = EffectSetFromNames("occlusion,defocus");
  EXPECT_THAT(two.Names(), ElementsAre("defocus", "occlusion"));
  EXPECT_EQ(JoinedNames(two.Without({Effect::kDefocus})), "occlusion");
  EXPECT_EQ(JoinedNames(EffectSet()), "none");
  EXPECT_EQ(two.Both({Effect::kDefocus, Effect::kTilt}), EffectSet({Effect::kDefocus}));
  EXPECT_THAT(ErrorOf([] { EffectSetFromNames("defocus,bokeh"); }),
              HasSubstr("effect \"bokeh\" is unknown: it must be one of thickness, defocus"));
}

TEST(EffectsTest, ToleranceHasAUnit) {
  EXPECT_DOUBLE_EQ(EffectToleranceFromText("0.25gl").grey_levels, 0.25);
  EXPECT_DOUBLE_EQ(EffectToleranceFromText("0.1px").px.value(), 0.1);
  for (const char* wrong : {"0.5", "gl", "-1gl", "0px", "infgl", "nanpx", "1 gl", "1mm", ""}) {
    EXPECT_THAT(ErrorOf([&] { EffectToleranceFromText(wrong); }), HasSubstr("0.5gl or 0.1px"))
        << wrong;
  }
}

// The oracle of "displacement 0": rays of the paper's two-plane parametrisation through both
// lenses, [S16].
TEST(EffectsTest, ThinLensOfTheSameFocusPutsRaysInTheSamePlace) {
  const Camera camera = TheCamera();
  const ThickLens thin = ThinLensEquivalent(camera.lens);
  const double thin_mm = ImageDistanceMm(thin, 300);
  EXPECT_NEAR(thin_mm, camera.focal_scale_px() * camera.sensor.pixel_pitch_mm, 1e-9);
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> uniform(-3, 3);
  const LightFieldPlanes planes{20, 200};
  for (int i = 0; i < 50; ++i) {
    const Ray ray{uniform(engine), uniform(engine), uniform(engine), uniform(engine)};
    const Eigen::Vector2d difference =
        LandingPointMm(camera.lens, camera.image_distance_mm(), planes, ray) -
        LandingPointMm(thin, thin_mm, planes, ray);
    EXPECT_LT(difference.norm(), 1e-12);
  }
  const EffectImpact impact =
      ImpactAt(Effect::kThickness, ConditionsOf(camera), PlaceAt(0, 0, 250), EffectSet::All());
  EXPECT_EQ(FactsOf(Effect::kThickness).unit, EffectUnit::kRelative);
  EXPECT_GT(impact.amount, 0);
  EXPECT_GT(impact.grey_levels, 0);
  EXPECT_EQ(ImpactAt(Effect::kThickness, ConditionsOf(camera), PlaceAt(0, 0, 250),
                     EffectSet::All().Without({Effect::kFalloff}))
                .grey_levels,
            0);
}

// The result is compared with the mean of the public function over many rays of the Gaussian
// aperture.
TEST(EffectsTest, FalloffIsTheMeanOverTheAperture) {
  const Camera camera = TheCamera();
  const double sigma_mm = 0.45 * camera.lens.aperture_radius_mm;
  std::mt19937 engine(2);
  std::normal_distribution<double> normal(0, sigma_mm);
  const LightFieldPlanes planes{0, 300};
  const auto mean_at = [&](const Eigen::Vector2d& position_px) {
    const Eigen::Vector2d s =
        (position_px - camera.sensor.principal_point_px) * 300 / camera.focal_scale_px();
    double sum = 0;
    for (int i = 0; i < 200000; ++i) {
      const Ray ray{s.x(), s.y(), normal(engine), normal(engine)};
      sum += RelativeIrradiance(camera.lens, camera.image_distance_mm(), planes, ray);
    }
    return sum / 200000;
  };
  const double expected = 1 - mean_at({0, 0}) / mean_at({300, 250});
  const EffectImpact impact =
      ImpactAt(Effect::kFalloff, ConditionsOf(camera), PlaceAt(0, 0, 300), EffectSet::All());
  EXPECT_NEAR(impact.amount, expected, 0.02 * expected);
  const double stored = 255 * (1 - TransferCurve::Srgb().Encode(1 - impact.amount));
  EXPECT_GE(impact.grey_levels, stored);
  // In the plane of focus all rays of a position meet the same point.
  EXPECT_LT(impact.grey_levels, 1.05 * stored);
}

TEST(EffectsTest, AiryPatternHasItsTextbookRadius) {
  // f/8: a disc of radius R = 2 kappa r with D/(2 R) = 8.
  Camera camera = TheCamera(Psf::kDisc, 0);
  const double rear_mm = camera.image_distance_mm() - camera.lens.lens_thickness_mm;
  camera.lens.aperture_radius_mm = rear_mm / 16 / (2 * 0.45);
  EXPECT_NEAR(AiryRadiusPx(camera, 550e-6) * 4.5, 1.21967 * 0.55 * 8, 1e-4);
  // 83.8 % within the first dark ring, 91.0 % within the second, of radius 7.01559/3.83171.
  const std::vector<double> quantiles = AiryQuantiles(1000);
  const auto share_within = [&](double airy_radii) {
    return std::upper_bound(quantiles.begin(), quantiles.end(), airy_radii) - quantiles.begin();
  };
  EXPECT_NEAR(static_cast<double>(share_within(1)), 838, 1);
  EXPECT_NEAR(static_cast<double>(share_within(7.01559 / 3.83171)), 910, 1);
}

// The Fourier transform of the field of a Gaussian aperture, summed.
TEST(EffectsTest, GaussianApertureDiffractsToAGaussian) {
  const Camera camera = TheCamera(Psf::kGaussian, 0);
  const double wavelength_mm = 550e-6;
  const double s_mm = 0.45 * camera.lens.aperture_radius_mm;
  const double rear_mm = camera.image_distance_mm() - camera.lens.lens_thickness_mm;
  const double sigma_px = AiryRadiusPx(camera, wavelength_mm) / kGaussianAiryRadius;
  const auto intensity = [&](double x_px) {
    double field = 0;
    for (int i = -400; i <= 400; ++i) {
      const double a_mm = i * s_mm / 50;
      field += std::exp(-a_mm * a_mm / (4 * s_mm * s_mm)) *
               std::cos(2 * kPi * a_mm * x_px * camera.sensor.pixel_pitch_mm /
                        (wavelength_mm * rear_mm));
    }
    return field * field;
  };
  EXPECT_NEAR(intensity(sigma_px) / intensity(0), std::exp(-0.5), 1e-6);
  EXPECT_NEAR(intensity(2 * sigma_px) / intensity(0), std::exp(-2), 1e-6);
}

// A measured floor holds the diffraction; only without one does it matter.
TEST(EffectsTest, DiffractionIsNotCountedTwice) {
  const EffectSite place = PlaceAt(300, 250, 300);
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    const EffectImpact measured =
        ImpactAt(Effect::kDiffraction, ConditionsOf(TheCamera(psf, 0.5)), place, EffectSet::All());
    const EffectImpact alone =
        ImpactAt(Effect::kDiffraction, ConditionsOf(TheCamera(psf, 0)), place, EffectSet::All());
    EXPECT_EQ(measured.grey_levels, 0);
    EXPECT_DOUBLE_EQ(measured.amount, alone.amount);
    EXPECT_GT(alone.grey_levels, 1);
  }
}

// The constants of the aperture's shape, integrated.
TEST(EffectsTest, DiscAndGaussianDifferAsStated) {
  constexpr double kStep = 1e-4;
  double not_shared = 0, farthest = 0, first = 0, second = 0, psi = 0, weighted = 0;
  for (int i = 90000; i >= 0; --i) {     // from outside, where psi is 0
    const double r = (i + 0.5) * kStep;  // sigmas
    const double difference = (r < 2 ? 1 / (4 * kPi) : 0) - std::exp(-r * r / 2) / (2 * kPi);
    const double within = std::min(r * r / 4, 1.0) - 1 + std::exp(-r * r / 2);
    not_shared += std::abs(difference) * kPi * r * kStep;
    weighted += 2 / kPi * r * std::abs(difference) * 2 * kPi * r * kStep;
    first += std::abs(within) * kStep;
    psi -= within / (2 * kPi * r) * kStep;
    second += std::abs(psi) * 2 * kPi * r * kStep;
    if (r < 2) {
      const double u = r / 2;
      const double edge = 0.5 + (u * std::sqrt(1 - u * u) + std::asin(u)) / kPi;
      farthest = std::max(farthest, std::abs(edge - std::erfc(-r / std::sqrt(2.0)) / 2));
    }
  }
  EXPECT_NEAR(not_shared, 0.2887, 1e-4);
  EXPECT_NEAR(farthest, 0.0404, 1e-4);
  EXPECT_NEAR(first, 0.2216, 1e-4);
  EXPECT_NEAR(second, 0.0940, 1e-4);
  EXPECT_NEAR(weighted, 0.587, 1e-3);
}

// Images in closed form, blurred in closed form: never beyond the bound, and near it.
TEST(EffectsTest, BlurBoundHoldsForWavesAndEdges) {
  for (const double f : {0.02, 0.1, 0.3, 0.5}) {        // cycles per px along x
    for (const double sigma : {0.05, 0.2, 0.7, 2.0}) {  // added
      for (const double other : {0.0, 0.5, 2.0}) {
        const double w = 2 * kPi * f;
        EffectSite wave;  // 0.5 + 0.5 cos before any blur
        wave.jump = 0;
        wave.slope = 0.5 * w;
        wave.bend = 0.5 * w * w;
        EffectOptics::Smoothing smoothing;
        smoothing.gaussian_px2 = other * other;
        smoothing.boxed = true;
        const double change = 0.5 * GaussianTransfer(other, f, 0) * PixelBoxTransfer(f, 0) *
                              (1 - GaussianTransfer(sigma, f, 0));
        const double bound = BlurChange(wave, sigma * sigma, smoothing);
        EXPECT_GE(bound, change) << f << " " << sigma << " " << other;
        if (sigma < 0.3 / f / 2 && other == 0) {
          EXPECT_LT(bound, 4 * change);
        }
      }
    }
  }
  // An edge of 0 and 1 along y, through the box: the largest change is near the foot of the ramp.
  for (const double sigma : {0.05, 0.2, 0.7, 3.0}) {
    for (const double other : {0.0, 0.5, 2.0}) {
      const auto ramp = [](double x, double s) {
        if (s == 0) return std::clamp(x + 0.5, 0.0, 1.0);
        double sum = 0;
        for (int i = 0; i < 200; ++i) {
          sum += std::erfc(-(x + (i + 0.5) / 200 - 0.5) / s / std::sqrt(2.0)) / 2 / 200;
        }
        return sum;
      };
      double change = 0;
      for (double x = -12; x <= 12; x += 0.01) {
        change = std::max(change, std::abs(ramp(x, std::hypot(sigma, other)) - ramp(x, other)));
      }
      EffectOptics::Smoothing smoothing;
      smoothing.gaussian_px2 = other * other;
      smoothing.boxed = true;
      const double bound = BlurChange(EffectSite(), sigma * sigma, smoothing);
      EXPECT_GE(bound, change) << sigma << " " << other;
      EXPECT_LT(bound, 8 * change) << sigma << " " << other;
    }
  }
}

TEST(EffectsTest, NothingWithoutACauseMatters) {
  // The place is in the plane of focus, on the axis, of uniform brightness.
  EffectSite place = PlaceAt(300, 250, 300);
  place.dark = place.bright = 0.4;
  place.jump = 0;
  EffectConditions conditions = ConditionsOf(TheCamera());
  conditions.bench = BenchConditions();
  for (const EffectFacts& facts : AllEffects()) {
    const EffectImpact impact = ImpactAt(facts.effect, conditions, place, EffectSet::All());
    const bool always =
        facts.effect == Effect::kQuantisation || facts.effect == Effect::kTransferCurve;
    if (!always) {
      EXPECT_LT(impact.grey_levels, 1e-9) << facts.name;
    }
  }
}

TEST(EffectsTest, BenchMovesLightAndScaleAsItsGeometrySays) {
  EffectConditions conditions = ConditionsOf(TheCamera());
  conditions.bench = BenchConditions{true, 0.01, 0.3, 0.05, 2};
  const EffectSite place = PlaceAt(0, 250, 330);
  const auto amount = [&](Effect effect) {
    return ImpactAt(effect, conditions, place, EffectSet::All()).amount;
  };
  EXPECT_NEAR(amount(Effect::kLampFalloff), 1 - std::pow(300.0 / 330, 2), 1e-12);
  EXPECT_NEAR(amount(Effect::kMagnification), 300 * (1 - 300.0 / 330), 1e-9);
  EXPECT_DOUBLE_EQ(amount(Effect::kFlicker), 0.01);
  EXPECT_DOUBLE_EQ(amount(Effect::kDrift), 0.3);
  EXPECT_DOUBLE_EQ(amount(Effect::kReadingError), 0.05);
  const double beside_mm = 300 * 330 / conditions.camera.focal_scale_px();
  EXPECT_NEAR(amount(Effect::kTilt), beside_mm * std::tan(2 * kPi / 180), 1e-9);
  conditions.bench->corner_stops = -2;
  conditions.bench->speck_depth = 0.4;
  EXPECT_DOUBLE_EQ(amount(Effect::kDust), 0.4);
  EXPECT_NEAR(ShadingAt(conditions.camera.sensor, -2, conditions.camera.sensor.principal_point_px),
              1, 1e-12);
  EXPECT_GT(amount(Effect::kShading), 0.1);
  EXPECT_LT(amount(Effect::kShading), 0.75);
  conditions.bench->aberrations.astigmatism_mm = 6;
  conditions.bench->aberrations.distortion = 0.02;
  EXPECT_NEAR(amount(Effect::kAberrations), 3, 0.05);
  EXPECT_GT(amount(Effect::kDistortion), 0.1);
  conditions.bench->band_amplitude = 0.3;
  EXPECT_DOUBLE_EQ(amount(Effect::kBands), 0.3);
  EXPECT_NEAR(BandFactor(0.3, 2.25, false), 1.3, 1e-12);
  EXPECT_NEAR(BandFactor(0.3, 0.6, true), 0.7, 1e-12);
  conditions.bench->exposure_drift_stops = -2;
  EXPECT_DOUBLE_EQ(amount(Effect::kExposureDrift), 0.5);
  conditions.bench.reset();
  for (const Effect effect : {Effect::kLampFalloff, Effect::kMagnification, Effect::kTilt,
                              Effect::kShading, Effect::kDust, Effect::kBands,
                              Effect::kExposureDrift, Effect::kAberrations, Effect::kDistortion}) {
    EXPECT_EQ(amount(effect), 0);
  }
}

TEST(EffectsTest, VignettingNeedsUvOffTheAperture) {
  EffectConditions conditions = ConditionsOf(TheCamera());
  const EffectSite corner = PlaceAt(0, 0, 300);
  EXPECT_EQ(ImpactAt(Effect::kVignetting, conditions, corner, EffectSet::All()).amount, 0);
  conditions.planes = LightFieldPlanes{0, 300};
  EXPECT_EQ(ImpactAt(Effect::kVignetting, conditions, corner, EffectSet::All()).amount, 0);
  conditions.planes = LightFieldPlanes{30, 270};
  // The share of a Gaussian's light that is outside the same Gaussian after a displacement, as a
  // sum.
  const double s_mm = std::hypot(300, 250) * 300 / conditions.camera.focal_scale_px();
  const double wander = 30 * s_mm / 270 / (0.45 * conditions.camera.lens.aperture_radius_mm);
  double lost = 0;
  for (double x = -10; x < 10; x += 1e-3) {
    const double here = std::exp(-x * x / 2), there = std::exp(-(x - wander) * (x - wander) / 2);
    lost += std::max(0.0, here - there) / std::sqrt(2 * kPi) * 1e-3;
  }
  EXPECT_NEAR(ImpactAt(Effect::kVignetting, conditions, corner, EffectSet::All()).amount, lost,
              1e-3);
}

TEST(EffectsTest, WhatIsLeftOutStaysWithinTheToleranceAllTogether) {
  EffectConditions conditions = ConditionsOf(TheCamera());
  conditions.bits = 8;
  conditions.encoded_noise_grey_levels = 0.3;
  std::vector<EffectSite> places = PlacesBetween(conditions.camera, 299.9, 300.1, false);
  for (EffectSite& place : places) place.bright = 0.6;
  const EffectSet all = EffectSet::All();
  EffectSet last = all;
  for (const double grey_levels : {0.01, 0.1, 0.5, 2.0, 20.0, 3000.0}) {
    EffectTolerance tolerance;
    tolerance.grey_levels = grey_levels;
    const EffectSet chosen = RequiredEffects(conditions, places, all, tolerance);
    EXPECT_EQ(chosen.Without(last), EffectSet()) << grey_levels;  // never more for less accuracy
    last = chosen;
    // Both kinds of noise together, 0.42, or one of them, or none.
    if (grey_levels == 0.5) {
      EXPECT_FALSE(chosen.Has(Effect::kReadNoise));
    }
    if (grey_levels == 0.1) {
      EXPECT_TRUE(chosen.Has(Effect::kReadNoise));
    }
    double sum = 0;
    for (const Effect effect : all.Without(chosen).Effects()) {
      if (FactsOf(effect).random) continue;
      double most = 0;
      for (const EffectSite& place : places) {
        most = std::max(most, ImpactAt(effect, conditions, place, all).grey_levels);
      }
      sum += most;
    }
    EXPECT_LE(sum, grey_levels + 1e-12);
  }
  EXPECT_EQ(last, EffectSet());
}

// The diffraction is then simulated with and without a floor.
TEST(EffectsTest, ALensFloorThatWasNotMeasuredIsNothing) {
  EffectConditions conditions = ConditionsOf(TheCamera());
  const EffectSite place = PlacesBetween(conditions.camera, 300, 300, false).front();
  const EffectSet others = EffectSet::All().Without({Effect::kLensFloor});
  EXPECT_GT(ImpactAt(Effect::kLensFloor, conditions, place, others).grey_levels, 0);
  conditions.camera.calibration->blur_floor_px.reset();
  EXPECT_EQ(ImpactAt(Effect::kLensFloor, conditions, place, others).grey_levels, 0);
  EXPECT_GT(ImpactAt(Effect::kDiffraction, conditions, place, others).grey_levels, 0);
}

TEST(EffectsTest, ToleranceInPxJudgesDisplacements) {
  const EffectConditions conditions = ConditionsOf(TheCamera());
  const double shift = 0.2 / (0.45 * 4.46 * conditions.camera.focal_scale_px());
  const std::vector<EffectSite> places =
      PlacesBetween(conditions.camera, 300, 1 / (1 / 300.0 - shift), false);
  const EffectSet optics{Effect::kDefocus, Effect::kLensFloor};
  EXPECT_EQ(RequiredEffects(conditions, places, optics, EffectToleranceFromText("0.19px")), optics);
  EXPECT_EQ(RequiredEffects(conditions, places, optics, EffectToleranceFromText("0.21px")),
            EffectSet({Effect::kLensFloor}));
  // An effect that displaces nothing is compared by its grey levels.
  EffectConditions wide = conditions;
  wide.camera.lens.lens_thickness_mm = 20;
  wide.camera.calibration->image_distance_mm = Estimate{ImageDistanceMm(wide.camera.lens, 300), 0};
  wide.camera.sensor.pixel_pitch_mm = 0.05;
  const EffectSet both{Effect::kThickness, Effect::kFalloff};
  const std::vector<EffectSite> at_focus = PlacesBetween(wide.camera, 300, 300, false);
  ASSERT_GT(ImpactAt(Effect::kThickness, wide, at_focus.back(), both).grey_levels, 0.5);
  EXPECT_EQ(RequiredEffects(wide, at_focus, both, EffectToleranceFromText("5px")), both);
}

TEST(EffectsTest, ChoiceIsReadAndFollowed) {
  const EffectSelectionOptions choice =
      EffectSelectionOptionsFromText("defocus,falloff", "falloff", "2gl");
  EXPECT_EQ(choice.given, EffectSet({Effect::kDefocus, Effect::kFalloff}));
  EXPECT_EQ(choice.tolerance.grey_levels, 2);
  const EffectConditions conditions = ConditionsOf(TheCamera());
  const std::vector<EffectSite> places = PlacesBetween(conditions.camera, 250, 350, true);
  const EffectSet model = EffectSet::All().Without({Effect::kTilt, Effect::kVignetting});
  const auto on = [&](EffectSelectionOptions wanted) {
    return SelectEffects(wanted, conditions, places, model).on;
  };
  EXPECT_EQ(on(choice), EffectSet({Effect::kDefocus}));
  EXPECT_EQ(on(EffectSelectionOptionsFromText("none", "", "")), EffectSet());
  EXPECT_EQ(on(EffectSelectionOptionsFromText("all", "drift", "")),
            model.Without({Effect::kDrift}));
  EffectSelectionOptions automatic = EffectSelectionOptionsFromText("auto", "", "");
  EXPECT_FALSE(on(automatic).Has(Effect::kQuantisation));
  EXPECT_TRUE(on(automatic).Has(Effect::kOcclusion));
  automatic.kept = {Effect::kQuantisation};
  EXPECT_TRUE(on(automatic).Has(Effect::kQuantisation));
  automatic.without = automatic.kept;
  EXPECT_FALSE(on(automatic).Has(Effect::kQuantisation));
  EXPECT_EQ(SelectEffects(automatic, conditions, places, model).findings.size(), 23U);
  EXPECT_THAT(ErrorOf([&] { on(EffectSelectionOptionsFromText("auto", "tilt,drift", "")); }),
              HasSubstr("effect tilt does not apply to this image: its effects are thickness"));
}

TEST(EffectsTest, SaysWhatIsWrong) {
  EffectConditions conditions = ConditionsOf(TheCamera());
  const std::vector<EffectSite> places = {PlaceAt(0, 0, 300)};
  const auto message = [&](const EffectConditions& wrong) {
    return ErrorOf([&] { FindImpacts(wrong, places, EffectSet::All()); });
  };
  EffectConditions wrong = conditions;
  wrong.camera.calibration->blur_ratio.reset();
  EXPECT_THAT(message(wrong), HasSubstr("camera 'macro': image_distance_mm and blur_ratio must"));
  wrong = conditions;
  wrong.wavelength_mm = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(wrong), HasSubstr("wavelength_mm is nan: it must be finite and > 0"));
  wrong = conditions;
  wrong.bits = 0;
  EXPECT_THAT(message(wrong), HasSubstr("bits is 0: it must be from 1 to 32"));
  wrong = conditions;
  wrong.planes = LightFieldPlanes{300, 0};
  EXPECT_THAT(message(wrong), HasSubstr("planes: UV at 300 mm, ST 0 mm beyond it"));
  wrong = conditions;
  wrong.bench = BenchConditions{true, -1, 0, 0, 0};
  EXPECT_THAT(message(wrong), HasSubstr("bench.flicker is -1"));
  wrong.bench = BenchConditions{true, 0, 0, 0, 90};
  EXPECT_THAT(message(wrong), HasSubstr("bench.tilt_deg is 90"));
  EXPECT_THAT(ErrorOf([&] { FindImpacts(conditions, {}, EffectSet::All()); }),
              HasSubstr("the list of places is empty"));
  EXPECT_THAT(ErrorOf([&] { PlacesBetween(conditions.camera, 0, 1, false); }),
              HasSubstr("depths from 0 to 1 mm"));
  EffectTolerance none;
  none.grey_levels = 0;
  EXPECT_THAT(ErrorOf([&] { RequiredEffects(conditions, places, EffectSet::All(), none); }),
              HasSubstr("tolerance in grey_levels is 0"));
}

}  // namespace
}  // namespace thicklens::model
