// How far images are apart, against closed forms.
#include "thicklens/model/image_change.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/special_numbers.h"

namespace thicklens::model {
namespace {

using thicklens::testing::kPi;

// A product of waves with a period of 16 px, moved to the right and down.
EncodedValues Waves(double right_px, double down_px) {
  EncodedValues image{66, 50, 3, {}};  // whole periods inside the outermost pixels
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double light =
          std::cos(2 * kPi * (x - right_px) / 16) * std::cos(2 * kPi * (y - down_px) / 16);
      for (int c = 0; c < 3; ++c) {
        image.values.push_back(static_cast<float>(0.5 + 0.1 * (c + 1) * light));
      }
    }
  }
  return image;
}

ImageChange Change(const EncodedValues& a, const EncodedValues& b) {
  ImageChangeAccumulator accumulator;
  accumulator.Add(a, b);
  return accumulator.Result();
}

TEST(ImageChangeTest, AShiftIsAShift) {
  for (const double shift_px : {0.01, 0.2}) {
    // Central differences give sin(w)/w of the slope of a wave, w = 2 pi/16.
    const double seen = std::sin(2 * kPi / 16) / (2 * kPi / 16);
    EXPECT_NEAR(Change(Waves(0, 0), Waves(shift_px, 0)).as_shift_px, shift_px / seen,
                0.02 * shift_px);
    EXPECT_NEAR(Change(Waves(0, 0), Waves(0.6 * shift_px, 0.8 * shift_px)).as_shift_px,
                shift_px / seen, 0.02 * shift_px);
  }
}

TEST(ImageChangeTest, ReportsRmsLargestAndPsnr) {
  EncodedValues dark{4, 3, 1, std::vector<float>(12, 0.25F)};
  EncodedValues bright = dark;
  bright.values[5] += 0.1F;
  const ImageChange change = Change(dark, bright);
  EXPECT_NEAR(change.largest_grey_levels, 25.5, 1e-4);
  EXPECT_NEAR(change.rms_grey_levels, 25.5 / std::sqrt(12), 1e-4);
  EXPECT_NEAR(change.psnr_db, 10 * std::log10(12 / 0.01), 1e-4);
  EXPECT_TRUE(std::isnan(change.as_shift_px));
  EXPECT_TRUE(Change(dark, dark).nothing());
  EXPECT_TRUE(std::isinf(Change(dark, dark).psnr_db));
}

TEST(ImageChangeTest, PartsAddUp) {
  ImageChangeAccumulator whole, first, second;
  EXPECT_GT(whole.Add(Waves(0, 0), Waves(0.1, 0)), 0);
  whole.Add(Waves(1, 0), Waves(1, 0.5));
  first.Add(Waves(0, 0), Waves(0.1, 0));
  second.Add(Waves(1, 0), Waves(1, 0.5));
  first.Add(second);
  EXPECT_NEAR(first.Result().rms_grey_levels, whole.Result().rms_grey_levels, 1e-9);
  EXPECT_EQ(first.Result().largest_grey_levels, whole.Result().largest_grey_levels);
  EXPECT_NEAR(first.Result().as_shift_px, whole.Result().as_shift_px, 1e-9);
}

TEST(ImageChangeTest, DifferencesAreTheMeanOfTheChannels) {
  const EncodedValues before{2, 1, 3, {0, 0, 0, 0.5F, 0.5F, 0.5F}};
  const EncodedValues after{2, 1, 3, {0.1F, 0, 0.2F, 0.5F, 0.4F, 0.5F}};
  const std::vector<float> difference = GreyLevelDifference(before, after);
  ASSERT_EQ(difference.size(), 2U);
  EXPECT_NEAR(difference[0], 25.5, 1e-4);
  EXPECT_NEAR(difference[1], -8.5, 1e-4);
}

}  // namespace
}  // namespace thicklens::model
