// The effect of a camera on points at some depths, by formulas that are written out here.
#include "thicklens/explain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/special_numbers.h"
#include "support/test_cameras.h"
#include "thicklens/image.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using testing::CentredSensor;
using ::testing::ElementsAre;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using testing::TestCamera;

// f1 50 mm, f2 52 mm, thickness 4 mm, r 10 mm, focused at 1000 mm: K = f1 zf/(zf - f1), and the
// rear principal plane is f2 zf/(zf - f1) in front of the sensor.
constexpr double kF1Mm = 50, kF2Mm = 52, kThicknessMm = 4, kRadiusMm = 10, kThickFocusMm = 1000;
constexpr double kScaleMm = kF1Mm * kThickFocusMm / (kThickFocusMm - kF1Mm);
constexpr double kRearMm = kF2Mm * kThickFocusMm / (kThickFocusMm - kF1Mm);
constexpr double kBlurRatio = 0.4, kThickFloorPx = 0.5;

Camera CameraOfThickLens(int width_px = 64, int height_px = 48, double pitch_mm = 0.005) {
  Camera camera = TestCamera("thick", {kF1Mm, kF2Mm, kThicknessMm, kRadiusMm},
                             CentredSensor(width_px, height_px, pitch_mm),
                             {kThicknessMm + kRearMm, 0.001}, {kBlurRatio, 0.01});
  camera.calibration->blur_floor_px = Measured{kThickFloorPx, 0};
  return camera;
}

ExplainOptions Between(double near_mm, double far_mm, int count = 9) {
  ExplainOptions options;
  options.depth_range = DepthRange{near_mm, far_mm};
  options.depth_count = count;
  return options;
}

ExplainOptions OfMap(int width_px, int height_px, std::vector<float> values,
                     const DepthMeaning& meaning) {
  ExplainOptions options;
  options.depth = DepthMap{width_px, height_px, std::move(values), false, meaning, "depth.pfm"};
  return options;
}

// Standard deviation or bound of one effect, grey levels.
double GreyLevelsOf(const CameraExplanation& explanation, Effect effect) {
  for (const model::LargestEffectImpact& finding : explanation.effects.findings) {
    if (finding.effect == effect) return finding.impact.grey_levels;
  }
  ADD_FAILURE() << model::EffectName(effect) << " is not judged";
  return testing::kNan;
}

TEST(ExplainInterfaceTest, EveryDepthHasTheBlurOfTheThickLens) {
  const double pitch_mm = CameraOfThickLens().sensor.pixel_pitch_mm;
  const CameraExplanation explanation =
      ExplainCamera(CameraOfThickLens(), Between(500, testing::kInfinity, 5));
  EXPECT_EQ(explanation.depth_range.near_mm, 500);
  EXPECT_EQ(explanation.depth_range.far_mm, testing::kInfinity);
  EXPECT_FALSE(explanation.costs);
  const model::Explanation& camera = explanation.camera;
  EXPECT_EQ(camera.camera_name, "thick");
  EXPECT_NEAR(camera.image_distance_mm, kThicknessMm + kRearMm, 1e-12);
  EXPECT_NEAR(camera.focus_depth_mm, kThickFocusMm, 1e-8);
  ASSERT_EQ(camera.rows.size(), 5U);
  for (int i = 0; i < 5; ++i) {
    SCOPED_TRACE(i);
    const model::DepthRow& row = camera.rows[static_cast<std::size_t>(i)];
    const double inverse_per_mm = (4 - i) / 4.0 / 500;  // equal steps from 1/500 to 0
    EXPECT_NEAR(1 / row.depth_mm, inverse_per_mm, 1e-15);
    const double radius_px =
        kRadiusMm * kScaleMm * std::abs(inverse_per_mm - 1 / kThickFocusMm) / pitch_mm;
    EXPECT_NEAR(row.blur_radius_px, radius_px, 1e-9);
    EXPECT_NEAR(row.defocus_sigma_px, kBlurRatio * radius_px, 1e-9);
    EXPECT_NEAR(row.sigma_px, std::hypot(kBlurRatio * radius_px, kThickFloorPx), 1e-9);
    EXPECT_NEAR(row.magnification, kF1Mm * kRearMm / kF2Mm * inverse_per_mm, 1e-12);
    // The thin lens of 50 mm at the same distance of the sensor.
    const double image_mm = kThicknessMm + kRearMm;
    EXPECT_NEAR(row.thin_blur_radius_px,
                kRadiusMm * std::abs(image_mm * inverse_per_mm - (image_mm / kF1Mm - 1)) / pitch_mm,
                1e-9);
    EXPECT_NEAR(row.thin_magnification, image_mm * inverse_per_mm, 1e-12);
  }
  EXPECT_NEAR(camera.working_f_number, kRearMm / (2 * kRadiusMm), 1e-12);
  ASSERT_EQ(camera.depth_of_field.size(), 2U);
  for (const model::DepthOfFieldRow& field : camera.depth_of_field) {
    const double step_per_mm = field.blur_radius_px * pitch_mm / (kRadiusMm * kScaleMm);
    EXPECT_NEAR(field.near_mm, 1 / (1 / kThickFocusMm + step_per_mm), 1e-9);
    EXPECT_NEAR(field.far_mm, 1 / (1 / kThickFocusMm - step_per_mm), 1e-9);
  }
}

TEST(ExplainInterfaceTest, TheRangeOfAMapIsThatOfItsDepths) {
  const float hole = std::numeric_limits<float>::quiet_NaN();
  const CameraExplanation explanation = ExplainCamera(
      CameraOfThickLens(3, 2),
      OfMap(3, 2, {0.75F, hole, 2.5F, 0.0F, 1.5F, 1.0F}, {DepthKind::kZ, LengthUnit::kMetre}));
  EXPECT_DOUBLE_EQ(explanation.depth_range.near_mm, 750);
  EXPECT_DOUBLE_EQ(explanation.depth_range.far_mm, 2500);
  ASSERT_EQ(explanation.camera.rows.size(), 9U);  // by default
  EXPECT_EQ(explanation.camera.rows.front().depth_mm, explanation.depth_range.near_mm);
  EXPECT_EQ(explanation.camera.rows.back().depth_mm, explanation.depth_range.far_mm);
}

// A pixel at x mm from the principal point shows a point that is x/m from the axis, m = K/z: the
// range is z sqrt(1 + (x/K)^2).
TEST(ExplainInterfaceTest, RangesAreAlongTheChiefRays) {
  const CameraExplanation explanation = ExplainCamera(
      CameraOfThickLens(5, 3, 2),
      OfMap(5, 3, std::vector<float>(15, 80), {DepthKind::kRange, LengthUnit::kCentimetre}));
  EXPECT_NEAR(explanation.depth_range.far_mm, 800, 1e-9);  // the pixel on the axis
  const double corner_mm = std::hypot(4, 2);
  // Depths are floats, which are 6e-5 mm apart here.
  EXPECT_NEAR(explanation.depth_range.near_mm, 800 / std::hypot(1, corner_mm / kScaleMm), 1e-4);
}

// White light of N electrons has a noise of sqrt(N), and rounding the deviation of a uniform
// distribution, 1/sqrt(12) step.
TEST(ExplainInterfaceTest, NoiseHasTheDeviationsOfElectronsAndSteps) {
  Camera camera = CameraOfThickLens();
  camera.sensor.transfer = TransferCurve::Linear();
  ExplainOptions options = Between(500, 2000);
  options.full_well_electrons = 10000;
  options.read_noise_electrons = 30;
  options.bits = 10;
  const CameraExplanation explanation = ExplainCamera(camera, options);
  EXPECT_NEAR(GreyLevelsOf(explanation, Effect::kShotNoise), 255 * 100 / 10000.0, 1e-9);
  EXPECT_NEAR(GreyLevelsOf(explanation, Effect::kReadNoise), 255 * 30 / 10000.0, 1e-9);
  EXPECT_NEAR(GreyLevelsOf(explanation, Effect::kQuantisation), 255 / 1023.0 / std::sqrt(12.0),
              1e-9);
  EXPECT_TRUE(explanation.effects.on.Has(Effect::kShotNoise));
  EXPECT_TRUE(explanation.effects.on.Has(Effect::kDefocus));
  const CameraExplanation dark = ExplainCamera(camera, Between(500, 2000));
  EXPECT_EQ(GreyLevelsOf(dark, Effect::kShotNoise), 0);
}

// Every simulated image is rounded and has a transfer curve, however little that changes: by less
// than 1e-7 grey levels at 32 bits.
TEST(ExplainInterfaceTest, EffectsAreTheChosenOnes) {
  ExplainOptions options = Between(500, 2000);
  options.bits = 32;
  const CameraExplanation automatic = ExplainCamera(CameraOfThickLens(), options);
  EXPECT_LT(GreyLevelsOf(automatic, Effect::kQuantisation), 1e-7);
  EXPECT_TRUE(automatic.effects.on.Has(Effect::kQuantisation));
  EXPECT_TRUE(automatic.effects.on.Has(Effect::kTransferCurve));
  EXPECT_FALSE(automatic.effects.on.Has(Effect::kShotNoise));
  options.effects.without = {Effect::kDefocus};
  EXPECT_FALSE(ExplainCamera(CameraOfThickLens(), options).effects.on.Has(Effect::kDefocus));
  options.effects = {};
  options.effects.base = EffectSelection::Base::kGiven;
  options.effects.given = {Effect::kDefocus};
  EXPECT_EQ(ExplainCamera(CameraOfThickLens(), options).effects.on, EffectSet({Effect::kDefocus}));
}

// Where a lamp flickers by 1 %, white changes by 1 % of full scale.
TEST(ExplainInterfaceTest, ABenchAddsItsOwnEffects) {
  ExplainOptions options = Between(500, 2000);
  EXPECT_EQ(GreyLevelsOf(ExplainCamera(CameraOfThickLens(), options), Effect::kFlicker), 0);
  options.bench = model::BenchConditions{};
  options.bench->flicker = 0.01;
  Camera camera = CameraOfThickLens();
  camera.sensor.transfer = TransferCurve::Linear();
  EXPECT_NEAR(GreyLevelsOf(ExplainCamera(camera, options), Effect::kFlicker), 2.55, 1e-9);
}

TEST(ExplainInterfaceTest, NoticesOfTheCameraAreWarnings) {
  Camera camera = CameraOfThickLens();
  camera.notices = {"first remark", "second remark"};
  std::vector<std::string> texts;
  RunControl run;
  run.notice = [&](const Notice& notice) {
    EXPECT_EQ(notice.level, Notice::Level::kWarning);
    texts.push_back(notice.text);
  };
  ExplainCamera(camera, Between(500, 2000), run);
  EXPECT_THAT(texts, ElementsAre("first remark", "second remark"));
}

TEST(ExplainInterfaceTest, WrongOptionsAreNamedBeforeAnythingIsNoticed) {
  Camera camera = CameraOfThickLens();
  camera.notices = {"remark"};
  std::vector<std::string> texts;
  RunControl run;
  run.notice = [&](const Notice& notice) { texts.push_back(notice.text); };
  const auto field_of = [&](const ExplainOptions& options) {
    return FieldOfOptionError([&] { ExplainCamera(camera, options, run); });
  };
  EXPECT_EQ(field_of({}), "depth_range");
  EXPECT_EQ(field_of(Between(testing::kNan, 1000)), "depth_range.near_mm");
  EXPECT_EQ(field_of(Between(500, testing::kNan)), "depth_range.far_mm");
  EXPECT_EQ(field_of(Between(500, 1000, 1)), "depth_count");
  EXPECT_EQ(field_of(OfMap(2, 2, {}, {DepthKind::kZ, LengthUnit::kMillimetre})), "depth.values");
  ExplainOptions noise = Between(500, 1000);
  noise.full_well_electrons = testing::kNan;
  EXPECT_EQ(field_of(noise), "full_well_electrons");
  run.threads = -1;
  EXPECT_EQ(field_of(Between(500, 1000)), "threads");
  EXPECT_THAT(texts, IsEmpty());
}

TEST(ExplainInterfaceTest, ACameraWithoutCalibrationIsRefused) {
  Camera camera = CameraOfThickLens();
  camera.calibration.reset();
  EXPECT_THAT(ErrorOf([&] { ExplainCamera(camera, Between(500, 1000)); }),
              HasSubstr("image_distance_mm"));
  camera = CameraOfThickLens();
  camera.calibration->blur_ratio.reset();
  EXPECT_THAT(ErrorOf([&] { ExplainCamera(camera, Between(500, 1000)); }), HasSubstr("blur_ratio"));
}

TEST(ExplainInterfaceTest, AMapThatDoesNotFitIsNamed) {
  const DepthMeaning metres{DepthKind::kZ, LengthUnit::kMetre};
  EXPECT_THAT(ErrorOf([&] {
                ExplainCamera(CameraOfThickLens(3, 2), OfMap(2, 3, {1, 1, 1, 1, 1, 1}, metres));
              }),
              AllOf(StartsWith("depth.pfm: "), HasSubstr("2x3 px"), HasSubstr("3x2 px")));
  EXPECT_THAT(ErrorOf([&] {
                ExplainCamera(CameraOfThickLens(2, 1), OfMap(2, 1, {0, 0}, metres));
              }),
              StartsWith("depth.pfm: "));
  EXPECT_THAT(ErrorOf([&] {
                ExplainCamera(CameraOfThickLens(2, 1), OfMap(2, 1, {-1, -2}, metres));
              }),
              AllOf(StartsWith("depth.pfm: "), HasSubstr("multiply the values by -1")));
}

TEST(ExplainInterfaceTest, ACancelledTokenEndsTheCall) {
  CancelToken token;
  token.Cancel();
  RunControl run;
  run.cancel = &token;
  EXPECT_THROW(ExplainCamera(
                   CameraOfThickLens(3, 2),
                   OfMap(3, 2, std::vector<float>(6, 1), {DepthKind::kZ, LengthUnit::kMetre}), run),
               Interrupted);
}

TEST(ExplainInterfaceTest, ReportsWhatIsFoundInADepthMap) {
  ExplainOptions options = OfMap(64, 48, std::vector<float>(64 * 48, 900),
                                 DepthMeaning{DepthKind::kZ, LengthUnit::kMillimetre});
  for (std::size_t i = 0; i < 64; ++i) options.depth->values[i] = 9999;
  for (std::size_t i = 64; i < 70; ++i) options.depth->values[i] = -1;
  options.depth->warnings = {"A warning of its reader."};
  std::string notices;
  RunControl run;
  run.notice = [&](const Notice& notice) { notices += notice.text + "\n"; };
  ExplainCamera(CameraOfThickLens(), options, run);
  EXPECT_THAT(notices, AllOf(HasSubstr("A warning of its reader."),
                             HasSubstr("64 pixels (2.1 %) have exactly the value 9999"),
                             HasSubstr("are negative and taken as 'no depth'")));
}

}  // namespace
}  // namespace thicklens
