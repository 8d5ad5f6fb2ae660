#include "thicklens/model/undistort.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;

constexpr int kWidth = 320, kHeight = 240;
constexpr double kFocalPx = 300;

LensDistortion Radial(double k1, double k2 = 0) {
  LensDistortion d;
  d.width_px = kWidth;
  d.height_px = kHeight;
  d.focal_length_px = {kFocalPx, kFocalPx};
  d.principal_point_px = {158.5, 121};
  d.coefficients = {k1, k2, 0, 0};
  return d;
}

// The position in the undistorted image of a pixel of the photograph, by bisection of the published
// formula r' = r (1 + k1 r^2 + k2 r^4): the forward model of the photograph, apart from the code.
Eigen::Vector2d UndistortedAt(double k1, double k2, double x, double y) {
  const Eigen::Vector2d centre(158.5, 121);
  const Eigen::Vector2d away = (Eigen::Vector2d(x, y) - centre) / kFocalPx;
  const double distorted = away.norm();
  if (distorted == 0) return centre;
  double low = 0, high = 1.2;
  for (int i = 0; i < 60; ++i) {
    const double r = (low + high) / 2;
    (r * (1 + k1 * r * r + k2 * std::pow(r, 4)) < distorted ? low : high) = r;
  }
  return centre + kFocalPx * away * (low / distorted);
}

// Bright lines with a profile of Gaussians, straight in the undistorted scene: x = a_i + s y and
// y = b_i + t x. Their photograph is evaluated at the position that each pixel shows.
constexpr double kSlope = 0.07, kSpacing = 40, kProfilePx = 2.0;
double Scene(const Eigen::Vector2d& p) {
  const double across = p.x() - kSlope * p.y();
  const double off = across - kSpacing * std::round(across / kSpacing);
  return std::exp(-off * off / (2 * kProfilePx * kProfilePx));
}

LinearImage Photograph(double k1, double k2) {
  LinearImage image{kWidth, kHeight, 1, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      image.values.push_back(static_cast<float>(Scene(UndistortedAt(k1, k2, x, y))));
  }
  return image;
}

// The centroid of the line nearest to column `x` in row `y`.
double LineAt(const LinearImage& image, int x, int y) {
  double sum = 0, moment = 0;
  for (int i = x - 12; i <= x + 12; ++i) {
    const double value = std::max(0.0, static_cast<double>(image.at(i, y, 0)) - 1e-3);
    sum += value;
    moment += value * i;
  }
  return moment / sum;
}

// The largest departure of the middle lines from where straight ones are.
double LargestBendPx(const LinearImage& image) {
  double largest = 0;
  for (int y = 20; y < kHeight - 20; y += 5) {
    for (int line = 1; line <= 6; ++line) {
      const double expected = kSpacing * line + kSlope * y;
      if (expected < 40 || expected > kWidth - 40) continue;
      largest = std::max(
          largest, std::abs(LineAt(image, static_cast<int>(std::lround(expected)), y) - expected));
    }
  }
  return largest;
}

TEST(Undistort, StraightensTheLinesOfAScene) {
  for (const auto& [k1, k2] : {std::pair(-0.15, 0.02), std::pair(0.12, 0.0)}) {
    const LinearImage photo = Photograph(k1, k2);
    EXPECT_GT(LargestBendPx(photo), 1.5);
    std::size_t missing = 0;
    const LinearImage straight = Undistorted(photo, Radial(k1, k2), &missing);
    EXPECT_LT(LargestBendPx(straight), 0.1) << k1;
    if (k1 < 0) {
      EXPECT_EQ(missing, 0U);  // a barrel's photograph shows more than the undistorted frame
    } else {
      EXPECT_GT(missing, 1000U);
      EXPECT_EQ(straight.at(0, 0, 0), 0);
    }
  }
}

TEST(Undistort, LeavesAnImageWithoutDistortionAsItIs) {
  LinearImage image{kWidth, kHeight, 3, {}};
  for (int i = 0; i < 3 * kWidth * kHeight; ++i)
    image.values.push_back(static_cast<float>((i * 7919) % 1000) / 1000);
  std::size_t missing = 1;
  EXPECT_EQ(Undistorted(image, Radial(0), &missing).values, image.values);
  EXPECT_EQ(missing, 0U);
}

// Half the size: the same lines at half their positions.
TEST(Undistort, AnImageOfHalfTheSizeIsUndistortedByTheSameModel) {
  const LinearImage photo = Photograph(-0.15, 0.02);
  LinearImage half{kWidth / 2, kHeight / 2, 1, {}};
  for (int y = 0; y < half.height_px; ++y) {
    for (int x = 0; x < half.width_px; ++x) {
      half.values.push_back((photo.at(2 * x, 2 * y, 0) + photo.at(2 * x + 1, 2 * y, 0) +
                             photo.at(2 * x, 2 * y + 1, 0) + photo.at(2 * x + 1, 2 * y + 1, 0)) /
                            4);
    }
  }
  const LinearImage straight = Undistorted(half, Radial(-0.15, 0.02));
  for (int y = 10; y < half.height_px - 10; y += 5) {
    // Row y of the small image has its centre at 2 y + 0.5 of the large one.
    const double expected = (kSpacing * 2 + kSlope * (2 * y + 0.5) + 0.5) / 2 - 0.5;
    double sum = 0, moment = 0;
    for (int i = static_cast<int>(expected) - 8; i <= static_cast<int>(expected) + 8; ++i) {
      sum += static_cast<double>(straight.at(i, y, 0));
      moment += static_cast<double>(straight.at(i, y, 0)) * i;
    }
    EXPECT_NEAR(moment / sum, expected, 0.1) << y;
  }
}

// At an edge of a depth map no value between the two surfaces may appear.
TEST(Undistort, DepthsAreThoseOfTheMap) {
  std::vector<float> depth, out(static_cast<std::size_t>(kWidth) * kHeight);
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      depth.push_back(x == 17 && y == 120 ? kNone : (x + y) % 90 < 45 ? 1000.0F : 2000.0F);
  }
  const std::size_t missing = UndistortInto(Radial(0.12), depth.data(), 1, {0, 0, kWidth, kHeight},
                                            Resampling::kNearest, kNone, out.data());
  std::size_t holes = 0;
  for (const float value : out) {
    if (std::isnan(value)) {
      ++holes;
    } else {
      EXPECT_TRUE(value == 1000.0F || value == 2000.0F) << value;
    }
  }
  EXPECT_GT(missing, 1000U);
  EXPECT_GE(holes, missing);
  EXPECT_LE(holes, missing + 4);  // the hole of the map
}

// Beyond the photograph, the image goes on with the value at its border.
TEST(Undistort, ContinuesBeyondItsSource) {
  LinearImage ramp{kWidth, kHeight, 2, {}};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    ramp.values.push_back(1 + static_cast<float>(i % kWidth));
    ramp.values.push_back(1000 + static_cast<float>(i / kWidth));
  }
  const LensDistortion d = Radial(0.2);
  std::size_t missing = 0;
  const LinearImage straight = Undistorted(ramp, d, &missing);
  LinearImage whole = straight;
  ContinueBeyondSource(d, &whole);
  ASSERT_GT(missing, 1000U);
  const SourcePositions sources = SourcesOf(d, 0, 0, kWidth, kHeight);
  for (std::size_t i = 0; i < sources.x.size(); ++i) {
    if (std::isnan(sources.x[i])) {
      EXPECT_GE(whole.values[2 * i + 1], 999) << i;  // of the second channel
      continue;
    }
    EXPECT_EQ(whole.values[2 * i], straight.values[2 * i]);
  }
  // The corner has the value of the border on the diagonal, which is nearly that of the
  // photograph's own corner.
  EXPECT_NEAR(whole.at(0, 0, 0), 1, 8);
  EXPECT_NEAR(whole.at(0, 0, 1), 1000, 8);
}

TEST(Undistort, TheRegionWithSourceHasOne) {
  const LensDistortion d = Radial(0.12);
  const PixelRect region = RegionWithSource(d, {0, 0, kWidth, kHeight});
  EXPECT_GT(region.width, kWidth / 2);
  EXPECT_GT(region.height, kHeight / 2);
  EXPECT_LT(region.width, kWidth);
  const SourcePositions sources = SourcesOf(d, region.x, region.y, region.width, region.height);
  for (const float x : sources.x) ASSERT_FALSE(std::isnan(x));
  const PixelRect whole = RegionWithSource(Radial(-0.1), {5, 6, 300, 200});
  EXPECT_EQ(std::vector<int>({whole.x, whole.y, whole.width, whole.height}),
            std::vector<int>({5, 6, 300, 200}));
}

TEST(Undistort, RefusesWhatItCannotDo) {
  const LinearImage photo = Photograph(0, 0);
  EXPECT_THAT(ErrorOf([&] {
                Undistorted({kWidth, 100, 1, photo.values}, Radial(-0.1));
              }),
              HasSubstr("same aspect ratio"));
  LensDistortion wrong = Radial(-0.1);
  wrong.coefficients.pop_back();
  EXPECT_THAT(ErrorOf([&] { Undistorted(photo, wrong); }), HasSubstr("coefficients"));
}

}  // namespace
}  // namespace thicklens::model
