#include "thicklens/estimator/inpaint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

constexpr int kWidth = 40, kHeight = 24, kViews = 5;
constexpr float kGarbage = 9;

// A card of 10 x 8 px in front of a background, each of a disparity of its own.
struct Scene {
  double background_px = 0, card_px = 2;
  double top = 7.5, bottom = 15.5;

  bool IsCard(double x, double y) const { return x >= 14.5 && x < 24.5 && y >= top && y < bottom; }
  // Radiance at the position of the centre view that a point has there.
  static double Background(double x, double y, int channel) {
    return 0.3 + 0.004 * x + 0.006 * y + 0.05 * channel;
  }

  DisparityMap Map() const {
    DisparityMap map{kWidth, kHeight, {}, {1, 1}};
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        map.disparity.push_back(static_cast<float>(IsCard(x, y) ? card_px : background_px));
      }
    }
    return map;
  }
  bool ShowsCard(double a, double b, int x, int y) const {
    return IsCard(x + a * card_px, y + b * card_px);
  }
  // True for a point that is not visible from the centre although it is inside of its image.
  bool IsOccluded(double a, double b, int x, int y) const {
    return !ShowsCard(a, b, x, y) && IsCard(x + a * background_px, y + b * background_px);
  }
  double Truth(double a, double b, int x, int y, int channel) const {
    if (ShowsCard(a, b, x, y)) return 0.9;
    return Background(x + a * background_px, y + b * background_px, channel);
  }
};

// The truth, with garbage where a test puts it.
template <typename IsGarbage>
model::LightField FieldOf(const Scene& scene, int channels, const IsGarbage& is_garbage) {
  model::LightField field = model::MakeLightField(kWidth, kHeight, kViews, kViews, channels);
  for (int channel = 0; channel < channels; ++channel) {
    for (int l = 0; l < kViews; ++l) {
      for (int k = 0; k < kViews; ++k) {
        float* view = field.values.data() + field.ViewStart(channel, k, l);
        for (int y = 0; y < kHeight; ++y) {
          for (int x = 0; x < kWidth; ++x) {
            const double a = field.u_offset(k), b = field.v_offset(l);
            view[y * kWidth + x] = is_garbage(a, b, x, y)
                                       ? kGarbage
                                       : static_cast<float>(scene.Truth(a, b, x, y, channel));
          }
        }
      }
    }
  }
  return field;
}
model::LightField WithGarbage(const Scene& scene, int channels) {
  return FieldOf(scene, channels,
                 [&](double a, double b, int x, int y) { return scene.IsOccluded(a, b, x, y); });
}

class InpaintTest : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Backgrounds, InpaintTest, ::testing::Values(0.0, 1.0, -1.0));

TEST_P(InpaintTest, FillsWhatTheCardHides) {
  const Scene scene{GetParam(), GetParam() + 2};
  model::LightField field = WithGarbage(scene, 3);
  const model::LightField before = field;
  InpaintSummary summary;
  InpaintOccludedRays(scene.Map(), {}, &field, &summary);
  std::size_t occluded = 0;
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      const double a = field.u_offset(k), b = field.v_offset(l);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          if (scene.IsOccluded(a, b, x, y)) ++occluded;
          for (int channel = 0; channel < 3; ++channel) {
            const std::size_t i =
                field.ViewStart(channel, k, l) + static_cast<std::size_t>(y * kWidth + x);
            if (scene.IsOccluded(a, b, x, y)) {
              // Between the background and the card that it is next to.
              EXPECT_GT(field.values[i], 0.25F);
              EXPECT_LT(field.values[i], 0.95F);
            } else {
              ASSERT_EQ(field.values[i], before.values[i]) << x << ' ' << y;
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(summary.holes, occluded);
  EXPECT_EQ(summary.filled + summary.carried, occluded);
  EXPECT_GT(summary.carried, occluded / 2);  // views on one side show the same strip
  EXPECT_GT(summary.views_visited, 3);
  EXPECT_GE(summary.seconds, 0);
  EXPECT_THAT(summary.message, HasSubstr("Telea"));
}

// Values that were filled in one view appear in the other views of the same points.
TEST_P(InpaintTest, CarriesARadianceToAllThatShowThePoint) {
  const Scene scene{GetParam(), GetParam() + 2};
  model::LightField field = WithGarbage(scene, 1);
  InpaintSummary summary;
  InpaintOccludedRays(scene.Map(), {}, &field, &summary);
  // The row in the middle of the card: the strip that is revealed at its right in the view a = 1,
  // b = 0 is revealed in a = 2 as well.
  const auto at = [&](int k, int x) {
    return field.values[field.ViewStart(0, k, 2) + static_cast<std::size_t>(11 * kWidth + x)];
  };
  const int shift = static_cast<int>(scene.background_px);
  int compared = 0;
  for (int x = 0; x < kWidth; ++x) {
    if (!scene.IsOccluded(1, 0, x, 11)) continue;
    EXPECT_EQ(at(3, x), at(4, x - shift)) << x;
    ++compared;
  }
  EXPECT_EQ(compared, 2);
}

// Garbage that is beyond the border of the centre image is not replaced.
TEST(Inpaint, LeavesWhatIsBeyondTheBorder) {
  const Scene scene{2, 4};
  const auto is_beyond = [](double a, double b, int x, int y) {
    const double centre_x = x + 2 * a, centre_y = y + 2 * b;
    return centre_x < 0 || centre_x > kWidth - 1 || centre_y < 0 || centre_y > kHeight - 1;
  };
  model::LightField field = FieldOf(scene, 1, is_beyond);
  InpaintSummary summary;
  InpaintOccludedRays(scene.Map(), {}, &field, &summary);
  int garbage = 0;
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          if (!is_beyond(field.u_offset(k), field.v_offset(l), x, y)) continue;
          EXPECT_EQ(
              field.values[field.ViewStart(0, k, l) + static_cast<std::size_t>(y * kWidth + x)],
              kGarbage);
          ++garbage;
        }
      }
    }
  }
  EXPECT_GT(garbage, 100);
}

// Telea's method continues the surroundings of a hole: a hole in a plane of radiance that is
// isolated is filled with an error of a few per cent of the range of the radiance around it.
TEST(Inpaint, ContinuesASmoothBackground) {
  const Scene scene{0, 2};
  model::LightField field = WithGarbage(scene, 1);
  // The card has the radiance of the background, so that no other radiance is near.
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          if (!scene.ShowsCard(field.u_offset(k), field.v_offset(l), x, y)) continue;
          field.values[field.ViewStart(0, k, l) + static_cast<std::size_t>(y * kWidth + x)] =
              static_cast<float>(Scene::Background(x, y, 0));
        }
      }
    }
  }
  InpaintSummary summary;
  InpaintOccludedRays(scene.Map(), {}, &field, &summary);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_NEAR(field.values[field.ViewStart(0, 4, 2) + static_cast<std::size_t>(y * kWidth + x)],
                  Scene::Background(x, y, 0), 0.015)
          << x << ' ' << y;
    }
  }
}

// A hole that reaches the border of the image: nothing beyond may leak in.
TEST(Inpaint, FillsHolesAtTheBorder) {
  const Scene scene{0, 2, -100, 100};  // from top to bottom
  // This holds in the middle row of views only. In the rows above and below, the way to the
  // background leaves the image.
  model::LightField field = FieldOf(scene, 1, [&](double a, double b, int x, int y) {
    return b == 0 && scene.IsOccluded(a, b, x, y);
  });
  InpaintSummary summary;
  InpaintOccludedRays(scene.Map(), {}, &field, &summary);
  EXPECT_GT(summary.holes, 0U);
  for (const float value : field.values) {
    EXPECT_GT(value, 0.25F);
    EXPECT_LT(value, 0.95F);
  }
}

TEST(Inpaint, ThreadsMakeNoDifference) {
  const Scene scene{1, 3};
  std::vector<float> first;
  for (const int threads : {1, 3}) {
    model::LightField field = WithGarbage(scene, 3);
    InpaintOptions options;
    options.threads = threads;
    InpaintSummary summary;
    InpaintOccludedRays(scene.Map(), options, &field, &summary);
    if (first.empty()) first = field.values;
    EXPECT_EQ(field.values, first);
  }
}

TEST(Inpaint, ViewsThatAreMissingAreLeftOut) {
  const Scene scene{0, 2};
  model::LightField field = WithGarbage(scene, 1);
  field.present.assign(kViews * kViews, true);
  field.present[2 * kViews + 4] = false;
  const model::LightField before = field;
  InpaintSummary summary;
  InpaintOccludedRays(scene.Map(), {}, &field, &summary);
  const auto begin = field.values.begin() + static_cast<std::ptrdiff_t>(field.ViewStart(0, 4, 2));
  EXPECT_TRUE(
      std::equal(begin, begin + kWidth * kHeight,
                 before.values.begin() + static_cast<std::ptrdiff_t>(before.ViewStart(0, 4, 2))));
}

TEST(Inpaint, NothingOccludedNothingDone) {
  DisparityMap flat{kWidth, kHeight, std::vector<float>(kWidth * kHeight, 0.0F), {1, 1}};
  model::LightField field = model::MakeLightField(kWidth, kHeight, 3, 3, 1);
  InpaintSummary summary;
  InpaintOccludedRays(flat, {}, &field, &summary);
  EXPECT_EQ(summary.holes, 0U);
  EXPECT_EQ(summary.views_visited, 0);
}

TEST(Inpaint, RefusesWhatDoesNotFit) {
  const Scene scene;
  model::LightField field = model::MakeLightField(8, 8, 3, 3, 1);
  InpaintSummary summary;
  EXPECT_THAT(ErrorOf([&] { InpaintOccludedRays(scene.Map(), {}, &field, &summary); }),
              AllOf(HasSubstr("40x24"), HasSubstr("8x8")));
  InpaintOptions options;
  options.radius_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&] { InpaintOccludedRays(scene.Map(), options, &field, &summary); }),
              HasSubstr("radius_px"));
  options = {};
  options.progress = [](int, int) { throw Interrupted(); };
  field = WithGarbage(scene, 1);
  EXPECT_THROW(InpaintOccludedRays(scene.Map(), options, &field, &summary), Interrupted);
}

}  // namespace
}  // namespace thicklens::estimator
