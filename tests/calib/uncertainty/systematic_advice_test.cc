// Later widening of an interval, and the advice that follows from it.
#include "calib/uncertainty/systematic_advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "calib/uncertainty/systematic_parts.h"
#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::BlurBench;

// Results whose only systematic parts are those that a test adds.
Calibration Plain(double zf_mm, double zf_sigma_mm, double zero_sigma_mm,
                  const model::ThickLens& lens) {
  Calibration c;
  c.summary.focus_depth_mm = Result{zf_mm, zf_sigma_mm, Eigen::Vector2d(zf_mm - 1, zf_mm + 2)};
  const double d1_mm = model::ImageDistanceMm(lens, zf_mm);
  c.summary.image_distance_mm =
      Result{d1_mm, std::abs(model::ImageDistanceSlope(lens, zf_mm)) * zf_sigma_mm,
             Eigen::Vector2d(d1_mm - 0.002, d1_mm + 0.001)};
  c.summary.bench_offset_mm = Result{0, zero_sigma_mm, std::nullopt};
  return c;
}

TEST(WidenFocus, AddsToBothIntervals) {
  const model::ThickLens lens = BlurBench().lens;
  Calibration c = Plain(400, 0.1, 0, lens);
  WidenFocus("jump of the readings", 5, "fix it", lens, &c);
  EXPECT_NEAR(c.summary.focus_depth_mm->systematic->x(), 400 - 1 - 5, 1e-9);
  EXPECT_NEAR(c.summary.focus_depth_mm->systematic->y(), 400 + 2 + 5, 1e-9);
  const double d1_mm = c.summary.image_distance_mm->value;
  // rho + f2 zf/(zf - f1) at 405 and at 395 mm.
  const double low_mm = 3 + 12.8 * 405 / 392.5, high_mm = 3 + 12.8 * 395 / 382.5;
  EXPECT_NEAR(c.summary.image_distance_mm->systematic->x(), d1_mm - 0.002 + (low_mm - d1_mm), 1e-9);
  EXPECT_NEAR(c.summary.image_distance_mm->systematic->y(), d1_mm + 0.001 + (high_mm - d1_mm),
              1e-9);
  ASSERT_EQ(c.diagnostics.systematic_parts.size(), 1U);
  EXPECT_EQ(c.diagnostics.systematic_parts[0].name, "jump of the readings");
  EXPECT_EQ(c.diagnostics.systematic_parts[0].remedy, "fix it");
  EXPECT_NEAR(c.diagnostics.systematic_parts[0].focus_depth_mm.x(), -5, 1e-12);
  EXPECT_NEAR(c.diagnostics.systematic_parts[0].focus_depth_mm.y(), 5, 1e-12);
  EXPECT_EQ(c.diagnostics.systematic_parts[0].blur_ratio.norm(), 0);
  EXPECT_THAT(c.diagnostics.advice, HasSubstr(" is due to the jump of the readings: fix it"));
}

TEST(WidenFocusAndRatio, AddsToOneSideOfEachInterval) {
  const model::ThickLens lens = BlurBench().lens;
  Calibration c = Plain(400, 0.1, 0, lens);
  c.summary.blur_ratio = Result{0.4, 0.01, Eigen::Vector2d(0.39, 0.42)};
  WidenFocusAndRatio("astigmatism", {-5, 0}, {0, 0.03}, "use another lens", lens, &c);
  EXPECT_NEAR(c.summary.focus_depth_mm->systematic->x(), 399 - 5, 1e-9);
  EXPECT_NEAR(c.summary.focus_depth_mm->systematic->y(), 402, 1e-9);
  const double d1_mm = c.summary.image_distance_mm->value;
  const double high_mm = 3 + 12.8 * 395 / 382.5;  // rho + f2 zf/(zf - f1) at 395 mm
  EXPECT_NEAR(c.summary.image_distance_mm->systematic->x(), d1_mm - 0.002, 1e-9);
  EXPECT_NEAR(c.summary.image_distance_mm->systematic->y(), d1_mm + 0.001 + (high_mm - d1_mm),
              1e-9);
  EXPECT_NEAR(c.summary.blur_ratio->systematic->x(), 0.39, 1e-12);
  EXPECT_NEAR(c.summary.blur_ratio->systematic->y(), 0.45, 1e-12);
  ASSERT_EQ(c.diagnostics.systematic_parts.size(), 1U);
  EXPECT_EQ(c.diagnostics.systematic_parts[0].blur_ratio, Eigen::Vector2d(0, 0.03));
}

// Nearer than the focal point there is no image. One hundredth beyond it, d1 is rho + 101 f2.
TEST(WidenFocus, StopsShortOfTheFocalPoint) {
  const model::ThickLens lens = BlurBench().lens;
  for (const double move_mm : {387.4, 390.0, 5000.0}) {
    Calibration c = Plain(400, 0.1, 0, lens);
    WidenFocus("jump of the readings", move_mm, "fix it", lens, &c);
    EXPECT_NEAR(c.diagnostics.systematic_parts[0].image_distance_mm.y(),
                3 + 101 * 12.8 - c.summary.image_distance_mm->value, 1e-6);
    EXPECT_NEAR(c.summary.focus_depth_mm->systematic->x(), 399 - (400 - 12.625), 1e-9);
    EXPECT_NEAR(c.summary.focus_depth_mm->systematic->y() - c.summary.focus_depth_mm->value,
                move_mm + 2, 1e-9);
  }
  Calibration c = Plain(400, 0.1, 0, lens);
  WidenFocus("jump of the readings", 387, "fix it", lens, &c);
  EXPECT_NEAR(c.diagnostics.systematic_parts[0].image_distance_mm.y(),
              3 + 12.8 * 13 / 0.5 - c.summary.image_distance_mm->value, 1e-6);
}

TEST(WidenFocus, MakesNoIntervalWhereThereIsNone) {
  const model::ThickLens lens = BlurBench().lens;
  Calibration c = Plain(400, 0.1, 0, lens);
  c.summary.focus_depth_mm->systematic.reset();
  c.summary.image_distance_mm->systematic.reset();
  WidenFocus("jump of the readings", 5, "fix it", lens, &c);
  EXPECT_FALSE(c.summary.focus_depth_mm->systematic);
  EXPECT_FALSE(c.summary.image_distance_mm->systematic);
  EXPECT_EQ(c.diagnostics.systematic_parts.size(), 1U);
}

// ---- the advice ----

SystematicPart PartOfImageDistance(const std::string& name, double low_mm, double high_mm) {
  SystematicPart part;
  part.name = name;
  part.image_distance_mm = {low_mm, high_mm};
  part.remedy = "fix " + name;
  return part;
}

// The slope of d1 by hand, f1 f2/(zf - f1)^2 = 12.5 12.8/387.5^2 = 1.0656e-3: the widths that the
// noise of 0.4 mm and the zero of 0.3 mm have in d1 are each 3.92 times as large, 1.671e-3 and
// 1.253e-3 mm.
TEST(WidenFocus, TheAdviceNamesTheLargestShare) {
  struct Case {
    double first_mm, second_mm;  // widths of two additional parts
    double zero_mm;              // part of the bench offset in the total of 0.5 mm
    const char* advice;
  };
  // WidenFocus itself adds 2.131e-6 mm.
  const Case cases[] = {
      {0.001, 0.004, 0.3, "50 % of the error is due to the second: fix second"},
      {0.004, 0.001, 0.3, "50 % of the error is due to the first: fix first"},
      {0.001, 0.001, 0.3, "34 % of the error is due to noise and readings: take more frames"},
      {0.0016, 0.001, 0.3, "30 % of the error is due to noise and readings"},
      {0.0017, 0.001, 0.3, "30 % of the error is due to the first"},
      {0.0014, 0.001, 0.4, "31 % of the error is due to the bench offset: state the magnification"},
      {0.0018, 0.001, 0.4, "31 % of the error is due to the first"},
      // The share of the zero is not larger than the whole error of zf.
      {0.001, 0.001, 7, "51 % of the error is due to the bench offset"},
  };
  const model::ThickLens lens = BlurBench().lens;
  Calibration stated = Plain(400, 0.5, 7, lens);
  stated.diagnostics.bench_offset_from = "magnification";
  WidenFocus("a hair", 0.001, "nothing", lens, &stated);
  EXPECT_THAT(stated.diagnostics.advice,
              EndsWith("the bench offset: state magnification more exactly"));
  for (const Case& k : cases) {
    SCOPED_TRACE(k.advice);
    Calibration c = Plain(400, 0.5, k.zero_mm, lens);
    c.diagnostics.systematic_parts = {
        PartOfImageDistance("first", -0.25 * k.first_mm, 0.75 * k.first_mm),
        PartOfImageDistance("second", -k.second_mm, 0)};
    WidenFocus("a hair", 0.001, "nothing", lens, &c);
    EXPECT_THAT(c.diagnostics.advice, StartsWith(k.advice));
    ASSERT_EQ(c.diagnostics.systematic_parts.size(), 3U);
    for (std::size_t i = 1; i < 3; ++i) {
      const auto width = [&](std::size_t p) {
        return c.diagnostics.systematic_parts[p].image_distance_mm.y() -
               c.diagnostics.systematic_parts[p].image_distance_mm.x();
      };
      EXPECT_GE(width(i - 1), width(i));
    }
  }
}

// Some callers have not fitted a zero. It has no share then, and no value of it is read.
TEST(WidenFocus, WithoutAZeroItHasNoShare) {
  const model::ThickLens lens = BlurBench().lens;
  Calibration c = Plain(400, 0.5, 0, lens);
  Calibration without = c;
  without.summary.bench_offset_mm.reset();
  for (Calibration* each : {&c, &without}) WidenFocus("a hair", 0.001, "nothing", lens, each);
  EXPECT_THAT(without.diagnostics.advice,
              StartsWith("100 % of the error is due to noise and readings"));
  EXPECT_EQ(without.diagnostics.advice, c.diagnostics.advice);
}

TEST(WidenFocus, WithoutAnyErrorThereIsNoAdvice) {
  const model::ThickLens lens = BlurBench().lens;
  Calibration c = Plain(400, 0, 0, lens);
  WidenFocus("nothing", 0, "nothing", lens, &c);
  EXPECT_EQ(c.diagnostics.advice, "");
}

}  // namespace
}  // namespace thicklens::calib
