#include "tools/interface/clipped_highlights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "thicklens/estimate.h"

namespace thicklens {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kLampsWidth = 160, kLampsHeight = 120;

// Grey values, 1 at full scale, of a scene with lamps of the given light, some px wide.
std::vector<double> LampSceneOf(const std::vector<double>& lamps, double noise, unsigned seed) {
  std::vector<double> values;
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < kLampsHeight; ++y) {
    for (int x = 0; x < kLampsWidth; ++x) {
      double value = 0.3 + 0.2 * std::sin(0.11 * x + 0.05 * y);
      for (std::size_t i = 0; i < lamps.size(); ++i) {
        const double r = std::hypot(x - 20.0 - 30.0 * static_cast<double>(i), y - 60.0);
        // Discs whose edge is a px wide.
        value += (lamps[i] - value) * std::clamp(6.5 - r, 0.0, 1.0);
      }
      values.push_back(value + noise * normal(engine));
    }
  }
  return values;
}

// `limit`: of full scale, per channel.
Image StoredLamps(const std::vector<double>& grey, const std::vector<double>& limits,
                  int bits = 8) {
  const double full_scale = bits == 8 ? 255 : 65535;
  std::vector<std::uint16_t> values;
  for (const double value : grey) {
    for (const double limit : limits) {
      values.push_back(
          static_cast<std::uint16_t>(std::lround(full_scale * std::clamp(value, 0.0, limit))));
    }
  }
  return Image::FromEncoded(kLampsWidth, kLampsHeight,
                            limits.size() == 3 ? ChannelOrder::kRgb : ChannelOrder::kGrey, bits,
                            std::move(values));
}

TEST(FindClipping, FindsFullScale) {
  for (const double noise : {0.0, 0.004, 0.02}) {
    for (const int bits : {8, 16}) {
      const PhotoClipping found =
          FindClipping(StoredLamps(LampSceneOf({1.2, 1.5, 4}, noise, 1), {1, 1, 1}, bits));
      EXPECT_THAT(found.levels, ElementsAre(1, 1, 1)) << noise << ", " << bits;
      EXPECT_TRUE(found.at_full_scale);
      EXPECT_NEAR(found.share, 3 * 3.14159 * 6 * 6 / (kLampsWidth * kLampsHeight), 0.003) << noise;
    }
  }
}

TEST(FindClipping, FindsLevelsBelowFullScale) {
  // Clipped by the sensor, and then multiplied by a white balance: each channel has its own level.
  for (const double noise : {0.0, 0.008}) {
    const PhotoClipping found =
        FindClipping(StoredLamps(LampSceneOf({1.2, 1.5, 4}, noise, 2), {250.0 / 255, 0.8, 1}));
    EXPECT_THAT(found.levels, ElementsAre(DoubleNear(250.0 / 255, 1e-6), DoubleNear(0.8, 1e-6), 1));
    EXPECT_FALSE(found.at_full_scale);
  }
  // A single lamp shows it if noise would make its values differ.
  EXPECT_THAT(FindClipping(StoredLamps(LampSceneOf({3}, 0.012, 3), {0.9})).levels,
              ElementsAre(DoubleNear(0.9, 0.002)));
}

TEST(FindClipping, ClaimsNothingThatIsNotClipped) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    // Lamps below the limit, in noise of a fraction of a level to several.
    for (const double noise : {0.0, 0.001, 0.002, 0.004, 0.012}) {
      const PhotoClipping found =
          FindClipping(StoredLamps(LampSceneOf({0.7, 0.8, 0.93}, noise, seed), {1, 1, 1}));
      EXPECT_EQ(found.share, 0) << noise << ", " << seed;
      const PhotoClipping one = FindClipping(StoredLamps(LampSceneOf({0.93}, noise, seed), {1}));
      EXPECT_EQ(one.share, 0) << noise << ", " << seed;
    }
  }
  // A flat bright area without noise may be what it shows.
  EXPECT_EQ(FindClipping(StoredLamps(LampSceneOf({0.9}, 0, 1), {1})).share, 0);
  // An image that was stretched to full scale has one largest value.
  std::vector<double> stretched = LampSceneOf({}, 0.01, 5);
  const double largest = *std::max_element(stretched.begin(), stretched.end());
  for (double& value : stretched) value /= largest;
  EXPECT_EQ(FindClipping(StoredLamps(stretched, {1}, 16)).share, 0);
  EXPECT_EQ(FindClipping(StoredLamps(stretched, {1}, 8)).share, 0);
  // One level everywhere.
  EXPECT_EQ(
      FindClipping(StoredLamps(std::vector<double>(kLampsWidth * kLampsHeight, 0.6), {1})).share,
      0);
  EXPECT_EQ(FindClipping(Image()).share, 0);
}

TEST(FindClipping, FindsTheLimitOfLinearLight) {
  const std::vector<double> scene = LampSceneOf({3, 5}, 0.01, 6);
  std::vector<float> values;
  for (const double value : scene) values.push_back(static_cast<float>(std::min(value, 1.7)));
  const auto light = [&] {
    return Image::FromLight(kLampsWidth, kLampsHeight, ChannelOrder::kGrey, values);
  };
  EXPECT_THAT(FindClipping(light()).levels, ElementsAre(DoubleNear(1.7, 1e-6)));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(scene[i]);
  EXPECT_EQ(FindClipping(light()).share, 0);
}

// A rendered image without noise may show one even area that is its brightest.
TEST(FindClipping, DoesNotClaimTheEvenAreaOfALinearImageWithoutNoise) {
  const auto found = [](const std::vector<double>& lamps, double noise, double limit) {
    std::vector<float> values;
    for (const double value : LampSceneOf(lamps, noise, 11))
      values.push_back(static_cast<float>(std::min(value, limit)));
    return FindClipping(
        Image::FromLight(kLampsWidth, kLampsHeight, ChannelOrder::kGrey, std::move(values)));
  };
  // The lamp is clipped or not: its values are the same.
  EXPECT_EQ(found({0.9}, 0, 10).share, 0);
  EXPECT_EQ(found({3}, 0, 0.9).share, 0);
  EXPECT_EQ(found({1.7}, 0, 10).share, 0);
  // Noise would make them differ, and three areas have no reason to agree.
  EXPECT_THAT(found({3}, 0.012, 0.9).levels, ElementsAre(DoubleNear(0.9, 1e-6)));
  EXPECT_THAT(found({3, 4, 5}, 0, 1.7).levels, ElementsAre(DoubleNear(1.7, 1e-6)));
}

// The values of a clipped disc of a JPEG file, which scatter about full scale.
TEST(ClippedHighlights, OfCompressedPhotographsAreWholeAreas) {
  std::vector<double> scene = LampSceneOf({3}, 0, 8);
  std::mt19937 engine(9);
  std::normal_distribution<double> scatter(0, 2.0 / 255);
  for (double& value : scene) value = std::min(value, 1.0) + scatter(engine);
  const Image photo = StoredLamps(scene, {1});
  EstimateDiagnostics diagnostics;
  const auto marked = [&] {
    const std::vector<std::uint8_t> marks = MarksOf(ClippedPartsOf(photo, &diagnostics).value());
    return std::count(marks.begin(), marks.end(), 1);
  };
  const auto alone = static_cast<double>(marked());
  diagnostics.compression_sigma = 2.0 / 255;
  const auto areas = static_cast<double>(marked());
  EXPECT_NEAR(areas, 3.14159 * 6 * 6, 15);
  EXPECT_LT(alone, 0.75 * areas);
}

TEST(ClippedHighlights, AreMarkedAndReported) {
  const Image photo = StoredLamps(LampSceneOf({2}, 0.004, 7), {0.5, 1, 1});
  EstimateOptions options;
  EstimateDiagnostics diagnostics;
  const std::optional<Image> parts = ClippedPartsOf(photo, &diagnostics);
  ASSERT_TRUE(parts.has_value());
  const std::vector<std::uint8_t> marks = MarksOf(*parts);
  ASSERT_EQ(marks.size(), photo.encoded().values.size());
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (i % 3 == 0) continue;
    EXPECT_EQ(marks[i], photo.encoded().values[i] == 255 ? 1 : 0) << i;
  }
  std::vector<Notice> notices;
  RunControl control;
  control.notice = [&](const Notice& notice) { notices.push_back(notice); };
  const auto report = [&] {
    notices.clear();
    RunScope run(control);
    ReportClipping("lamps.png", options, diagnostics.clipping, &run);
    return notices.empty() ? "" : notices.front().text;
  };
  EXPECT_THAT(report(), HasSubstr("lamps.png: 0.39 % of its values are clipped"));
  EXPECT_THAT(report(), HasSubstr("green at full scale, blue at full scale"));
  EXPECT_THAT(report(), HasSubstr("at least that"));
  options.solver = SolverChooser([](const Problem&, double) { return SolverChoice(); });
  EXPECT_THAT(report(), HasSubstr("if the solver scene is chosen, the light there is at least"));
  options.solver = BlockSolver{};
  EXPECT_THAT(report(), HasSubstr("this solver takes them as the light itself"));
  options.clipped = ClippedHighlights::kData;
  EXPECT_THAT(report(), HasSubstr("they are taken as the light itself"));
  diagnostics.clipping = {};
  EXPECT_EQ(report(), "");
}

TEST(ClippedHighlights, OfAPartAreThoseThatItShows) {
  PhotoClipping clipping;
  clipping.levels = {0.5, 1, 0};
  clipping.share = 0.1;
  LimitToMarks({0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0}, &clipping);  // 4 px
  EXPECT_THAT(clipping.levels, ElementsAre(0, 1, 0));
  EXPECT_DOUBLE_EQ(clipping.share, 2.0 / 12);
  LimitToMarks(std::vector<std::uint8_t>(12, 0), &clipping);
  EXPECT_THAT(clipping.levels, ElementsAre(0, 0, 0));
  EXPECT_EQ(clipping.share, 0);
}

}  // namespace
}  // namespace thicklens
