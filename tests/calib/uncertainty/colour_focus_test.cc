// Colours that come into focus at different depths change the results.
#include "calib/uncertainty/colour_focus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

Calibration Found(const Eigen::Vector3d& focus_mm, double sigma_mm) {
  Calibration found;
  found.summary.focus_depth_mm = Result{300.4, 0.05, Eigen::Vector2d(300.4, 300.4)};
  found.summary.image_distance_mm = Result{60, 0.002, Eigen::Vector2d(60, 60)};
  found.summary.blur_ratio = Result{0.45, 0.001, Eigen::Vector2d(0.45, 0.45)};
  const char* const names[] = {"red", "green", "blue"};
  for (int c = 0; c < 3; ++c) {
    ChannelFocus channel;
    channel.name = names[c];
    channel.done = true;
    channel.focus_depth_mm = {focus_mm[c], sigma_mm};
    channel.blur_ratio = {0.45, 0.001};
    found.diagnostics.channels.push_back(channel);
  }
  return found;
}

// The sensor stays: K = f D/f of all colours is that of grey, while a fit with the camera's f takes
// f zf/(zf - f) of the colour.
TEST(ColourFocus, TheRatioIsThatOfTheSensorWhereItIs) {
  const model::ThickLens lens{50, 50, 0, 9};
  const model::Estimate ratio = RatioOfColour({0.45, 0.01}, 310, 300, lens);
  EXPECT_NEAR(ratio.value, 0.45 * (50 * 310.0 / 260) / (50 * 300.0 / 250), 1e-12);
  EXPECT_NEAR(ratio.sigma, 0.01 * ratio.value / 0.45, 1e-12);
  EXPECT_DOUBLE_EQ(RatioOfColour({0.45, 0.01}, 300, 300, lens).value, 0.45);
}

TEST(ColourFocus, EqualColoursChangeNothing) {
  Calibration found = Found({300.5, 300.4, 300.3}, 0.1);
  EXPECT_FALSE(ColoursDiffer(found.diagnostics.channels));
  EXPECT_THAT(ColoursInWords(found), IsEmpty());
  FollowColours({50, 50, 0, 9}, false, &found);
  EXPECT_THAT(found.diagnostics.systematic_parts, IsEmpty());
  EXPECT_EQ(found.summary.focus_depth_mm->systematic, Eigen::Vector2d(300.4, 300.4));
}

// 2, 0 and -1 mm about 300.4 mm: the mean of grey is at 300.35 mm. The focal length may be that of
// any colour, so that d1 has their root mean square about 300.4 mm.
TEST(ColourFocus, TheIntervalOfTheImageDistanceHasTheSpreadOfTheColours) {
  Calibration found = Found({302, 300, 299}, 0.01);
  EXPECT_TRUE(ColoursDiffer(found.diagnostics.channels));
  EXPECT_THAT(ColoursInWords(found), HasSubstr("red at 302.00 +- 0.01 mm"));
  FollowColours({50, 50, 0, 9}, false, &found);
  ASSERT_EQ(found.diagnostics.systematic_parts.size(), 1U);
  EXPECT_EQ(found.diagnostics.systematic_parts[0].name, "axial colour");
  const double grey_mm = 1 / (0.2126 / 302 + 0.7152 / 300 + 0.0722 / 299);
  EXPECT_NEAR(found.summary.focus_depth_mm->systematic->x(), grey_mm, 1e-9);
  EXPECT_EQ(found.summary.focus_depth_mm->systematic->y(), 300.4);
  const double spread_mm =
      std::sqrt(0.2126 * 1.6 * 1.6 + 0.7152 * 0.4 * 0.4 + 0.0722 * 1.4 * 1.4 - 1e-4);
  const auto distance_mm = [](double zf) { return 50 * zf / (zf - 50); };
  EXPECT_NEAR(found.summary.image_distance_mm->systematic->x(),
              60 + distance_mm(300.4 + spread_mm) - distance_mm(300.4), 1e-9);
  EXPECT_NEAR(found.summary.image_distance_mm->systematic->y(),
              60 + distance_mm(300.4 - spread_mm) - distance_mm(300.4), 1e-9);
}

// A fit of grey gives a kappa that is too small. That of the colours takes its place, with the
// errors of both, and what depends on it follows.
TEST(ColourFocus, TheRatioIsTheMeanOfTheColours) {
  Calibration found = Found({302, 300, 299}, 0.01);
  found.summary.blur_ratio = Result{0.44, 0.0022, Eigen::Vector2d(0.44, 0.45)};
  const double ratios[] = {0.455, 0.449, 0.46};
  for (std::size_t c = 0; c < 3; ++c) found.diagnostics.channels[c].blur_ratio.value = ratios[c];
  found.diagnostics.blur_slope_px_per_mm = model::Estimate{2, 0.01};
  found.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio"};
  found.diagnostics.covariance = Eigen::Vector2d(0.002, 0.0022).cwiseAbs2().asDiagonal();
  found.diagnostics.covariance(0, 1) = found.diagnostics.covariance(1, 0) = 1e-6;
  FollowColours({50, 50, 0, 9}, false, &found);
  const double mean = 0.2126 * 0.455 + 0.7152 * 0.449 + 0.0722 * 0.46;
  const double mean_sigma = 0.001 * std::sqrt(0.2126 * 0.2126 + 0.7152 * 0.7152 + 0.0722 * 0.0722);
  const double growth = mean / 0.44;
  const Result& ratio = *found.summary.blur_ratio;
  EXPECT_NEAR(ratio.value, mean, 1e-12);
  EXPECT_NEAR(ratio.sigma, std::hypot(0.0022 * growth, mean_sigma), 1e-12);
  EXPECT_NEAR(ratio.systematic->x(), mean, 1e-12);
  EXPECT_NEAR(ratio.systematic->y(), mean + 0.01 * growth, 1e-12);
  EXPECT_NEAR(found.diagnostics.blur_slope_px_per_mm->value, 2 * growth, 1e-12);
  EXPECT_NEAR(found.diagnostics.covariance(1, 1), ratio.sigma * ratio.sigma, 1e-12);
  EXPECT_NEAR(found.diagnostics.covariance(0, 1), 1e-6 * growth, 1e-15);
  EXPECT_NEAR(found.diagnostics.covariance(0, 0), 4e-6, 1e-15);
}

// Where the sensor moves, its distance is measured, and zf follows from a focal length that may be
// that of any colour.
TEST(ColourFocus, TheFocusOfASensorThatMovesHasTheSpreadOfTheColours) {
  Calibration found = Found({302, 300, 299}, 0.01);
  FollowColours({50, 50, 0, 9}, true, &found);
  const double spread_mm =
      std::sqrt(0.2126 * 1.6 * 1.6 + 0.7152 * 0.4 * 0.4 + 0.0722 * 1.4 * 1.4 - 1e-4);
  EXPECT_NEAR(found.summary.focus_depth_mm->systematic->x(), 300.4 - spread_mm, 1e-9);
  EXPECT_NEAR(found.summary.focus_depth_mm->systematic->y(), 300.4 + spread_mm, 1e-9);
}

// A colour that could not be measured is no reason for a statement.
TEST(ColourFocus, ColoursThatWereNotMeasuredSayNothing) {
  Calibration found = Found({302, 300, 299}, 0.01);
  found.diagnostics.channels[2].done = false;
  EXPECT_FALSE(ColoursDiffer(found.diagnostics.channels));
  EXPECT_THAT(ColoursInWords(found), IsEmpty());
}

}  // namespace
}  // namespace thicklens::calib
