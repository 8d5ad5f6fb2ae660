#include "thicklens/model/grey_focus.h"

#include <gtest/gtest.h>

#include <cmath>

namespace thicklens::model {
namespace {

constexpr double kFocusMm = 300;

TEST(GreyFocus, IsThatOfTheLensWithoutAxialColour) {
  LensAberrations aberrations;
  EXPECT_EQ(GreyFocusDepthMm(aberrations, kFocusMm), kFocusMm);
  aberrations.axial_colour_mm.emplace(0, 0, 0);
  EXPECT_EQ(GreyFocusDepthMm(aberrations, kFocusMm), kFocusMm);
}

// The depth at which the mean of the squared blurs of the colours, in proportion to 1/z - 1/zf of
// the colour, is smallest: found by parts.
TEST(GreyFocus, HasTheLeastBlurOfAllColours) {
  LensAberrations aberrations;
  aberrations.axial_colour_mm.emplace(20, -3, -9);
  const auto blur = [](double depth_mm) {
    return 0.2126 * std::pow(1 / depth_mm - 1 / (kFocusMm + 20), 2) +
           0.7152 * std::pow(1 / depth_mm - 1 / (kFocusMm - 3), 2) +
           0.0722 * std::pow(1 / depth_mm - 1 / (kFocusMm - 9), 2);
  };
  double low_mm = kFocusMm - 9, high_mm = kFocusMm + 20;
  for (int i = 0; i < 100; ++i) {
    const double a_mm = low_mm + (high_mm - low_mm) / 3, b_mm = high_mm - (high_mm - low_mm) / 3;
    if (blur(a_mm) < blur(b_mm))
      high_mm = b_mm;
    else
      low_mm = a_mm;
  }
  EXPECT_NEAR(GreyFocusDepthMm(aberrations, kFocusMm), low_mm, 1e-4);
  EXPECT_GT(GreyFocusDepthMm(aberrations, kFocusMm), kFocusMm + 0.5);
}

}  // namespace
}  // namespace thicklens::model
