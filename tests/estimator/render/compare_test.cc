#include "thicklens/estimator/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "support/error_message.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/encoded_values.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

constexpr double kPi = 3.14159265358979323846;

model::EncodedValues Noise(int width_px, int height_px, int channels, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  model::EncodedValues image{width_px, height_px, channels, {}};
  for (int i = 0; i < width_px * height_px * channels; ++i) image.values.push_back(uniform(random));
  return image;
}

template <typename ValueAt>
model::EncodedValues Drawn(int width_px, int height_px, const ValueAt& value_at) {
  model::EncodedValues image{width_px, height_px, 1, {}};
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) image.values.push_back(static_cast<float>(value_at(x, y)));
  }
  return image;
}

model::EncodedValues Flat(int width_px, int height_px, double value) {
  return Drawn(width_px, height_px, [value](int, int) { return value; });
}

double GreyAt(const model::EncodedValues& image, int x, int y) {
  const float* value = image.values.data() + (y * image.width_px + x) * image.channels;
  if (image.channels == 1) return value[0];
  return 0.2126 * value[0] + 0.7152 * value[1] + 0.0722 * value[2];
}

// SSIM as its paper defines it: window by window, with weighted moments about the weighted means.
double SlowSsim(const model::EncodedValues& a, const model::EncodedValues& b, int border_px) {
  const int margin = std::max(border_px, 5);
  double sum = 0;
  int windows = 0;
  for (int y = margin; y < a.height_px - margin; ++y) {
    for (int x = margin; x < a.width_px - margin; ++x) {
      double weights = 0, mean_a = 0, mean_b = 0;
      const auto weight = [](int i, int j) { return std::exp(-(i * i + j * j) / 4.5); };
      for (int j = -5; j <= 5; ++j) {
        for (int i = -5; i <= 5; ++i) {
          weights += weight(i, j);
          mean_a += weight(i, j) * GreyAt(a, x + i, y + j);
          mean_b += weight(i, j) * GreyAt(b, x + i, y + j);
        }
      }
      mean_a /= weights;
      mean_b /= weights;
      double variance_a = 0, variance_b = 0, covariance = 0;
      for (int j = -5; j <= 5; ++j) {
        for (int i = -5; i <= 5; ++i) {
          const double of_a = GreyAt(a, x + i, y + j) - mean_a;
          const double of_b = GreyAt(b, x + i, y + j) - mean_b;
          variance_a += weight(i, j) * of_a * of_a / weights;
          variance_b += weight(i, j) * of_b * of_b / weights;
          covariance += weight(i, j) * of_a * of_b / weights;
        }
      }
      const double luminance =
          (2 * mean_a * mean_b + 1e-4) / (mean_a * mean_a + mean_b * mean_b + 1e-4);
      sum += luminance * (2 * covariance + 9e-4) / (variance_a + variance_b + 9e-4);
      ++windows;
    }
  }
  return sum / windows;
}

TEST(Psnr, IsThatOfAConstantDifference) {
  const ImageScores scores = CompareImages(Flat(20, 14, 0.5), Flat(20, 14, 0.25), 0);
  EXPECT_NEAR(scores.psnr_db, -20 * std::log10(0.25), 1e-12);
}

TEST(Psnr, PoolsTheChannels) {
  model::EncodedValues reference = Noise(16, 12, 3, 1);
  for (float& value : reference.values) value *= 0.5F;
  model::EncodedValues other = reference;
  for (std::size_t i = 1; i < other.values.size(); i += 3) other.values[i] += 0.125F;
  EXPECT_NEAR(CompareImages(reference, other, 2).psnr_db, -10 * std::log10(1.0 / 64 / 3), 1e-6);
}

TEST(Psnr, IsInfiniteForEqualImagesAndWhatLiesInTheBorderDoesNotCount) {
  const model::EncodedValues reference = Noise(20, 17, 1, 2);
  EXPECT_EQ(CompareImages(reference, reference, 0).psnr_db,
            std::numeric_limits<double>::infinity());
  model::EncodedValues other = reference;
  other.values[3 * 20 + 9] += 0.5F;       // y = 3
  other.values[8 * 20 + 20 - 4] += 0.5F;  // x = 16
  EXPECT_EQ(CompareImages(reference, other, 4).psnr_db, std::numeric_limits<double>::infinity());
  const double one_of_14x11 = -10 * std::log10(0.25 / (14 * 11));
  const double two_of_14x11 = -10 * std::log10(0.50 / (14 * 11));
  EXPECT_NEAR(CompareImages(reference, other, 3).psnr_db, two_of_14x11, 1e-5);
  other.values[8 * 20 + 20 - 4] = reference.values[8 * 20 + 20 - 4];
  EXPECT_NEAR(CompareImages(reference, other, 3).psnr_db, one_of_14x11, 1e-5);
}

TEST(Ssim, IsThatOfTheDirectSum) {
  for (const int channels : {1, 3}) {
    const model::EncodedValues a = Noise(31, 26, channels, 3);
    model::EncodedValues b = Noise(31, 26, channels, 4);
    for (std::size_t i = 0; i < b.values.size(); ++i)
      b.values[i] = 0.7F * a.values[i] + 0.3F * b.values[i];
    for (const int border_px : {0, 5, 8}) {
      EXPECT_NEAR(CompareImages(a, b, border_px).ssim, SlowSsim(a, b, border_px), 1e-10)
          << channels << " channels, border " << border_px;
    }
  }
}

TEST(Ssim, IsSymmetricAndOneForEqualImages) {
  const model::EncodedValues a = Noise(40, 30, 1, 5);
  const model::EncodedValues b = Noise(40, 30, 1, 6);
  EXPECT_NEAR(CompareImages(a, a, 0).ssim, 1, 1e-12);
  EXPECT_NEAR(CompareImages(a, b, 0).ssim, CompareImages(b, a, 0).ssim, 1e-12);
  EXPECT_LT(CompareImages(a, b, 0).ssim, 0.2);
}

TEST(Ssim, OfFlatImagesIsThatOfTheirMeans) {
  const double expected = (2 * 0.25 * 0.75 + 1e-4) / (0.0625 + 0.5625 + 1e-4);
  EXPECT_NEAR(CompareImages(Flat(15, 15, 0.25), Flat(15, 15, 0.75), 0).ssim, expected, 1e-9);
}

TEST(Ssim, IsNotDefinedWhereNoWindowFits) {
  const model::EncodedValues narrow = Noise(10, 30, 1, 7);
  EXPECT_TRUE(std::isnan(CompareImages(narrow, narrow, 0).ssim));
  const model::EncodedValues just_fits = Noise(11, 11, 1, 7);
  EXPECT_NEAR(CompareImages(just_fits, just_fits, 0).ssim, 1, 1e-12);
}

TEST(DeltaE94, AgreesWithPublishedPairs) {
  const Eigen::Vector3d reference(100, 21.57210357, 272.22819350);
  EXPECT_NEAR(DeltaE94(reference, {100, 426.67945353, 72.39590835}), 83.7792255, 1e-7);
  EXPECT_NEAR(DeltaE94(reference, {100, 74.05216981, 276.45318193}), 10.0539320, 1e-7);
  EXPECT_NEAR(DeltaE94(reference, {100, 8.32281957, -73.58297716}), 57.5354537, 1e-7);
  EXPECT_NEAR(DeltaE94({0.9, 16.3, -2.22}, {0.7, 14.2, -1.80}), 1.249, 5e-4);
}

TEST(DeltaE94, WeightsLightnessChromaAndHueSeparately) {
  EXPECT_DOUBLE_EQ(DeltaE94({40, 30, 40}, {47, 30, 40}), 7);
  // Chroma from 50 to 55: the weight is 1 + 0.045 * 50, and in the other direction 1 + 0.045 * 55.
  EXPECT_NEAR(DeltaE94({40, 30, 40}, {40, 33, 44}), 5 / 3.25, 1e-12);
  EXPECT_NEAR(DeltaE94({40, 33, 44}, {40, 30, 40}), 5 / 3.475, 1e-12);
  // The chroma is the same and the hue differs: weight 1 + 0.015 * 50, distance sqrt(10^2 + 10^2).
  EXPECT_NEAR(DeltaE94({40, 30, 40}, {40, 40, 30}), std::sqrt(200) / 1.75, 1e-12);
  EXPECT_NEAR(DeltaE94({40, 0, 0}, {40, 3, 4}), 5, 1e-12);  // from grey: weights 1
  EXPECT_EQ(DeltaE94({40, 30, 40}, {40, 30, 40}), 0);
}

TEST(LabOf, KnowsPrimariesAndGreys) {
  const auto expect = [](const Eigen::Vector3d& srgb, const Eigen::Vector3d& lab) {
    EXPECT_LT((LabOf(srgb) - lab).cwiseAbs().maxCoeff(), 0.006)
        << srgb.transpose() << ": " << LabOf(srgb).transpose();
  };
  expect({1, 0, 0}, {53.24, 80.09, 67.20});
  expect({0, 1, 0}, {87.73, -86.18, 83.18});
  expect({0, 0, 1}, {32.30, 79.19, -107.86});
  expect({1, 1, 0}, {97.14, -21.55, 94.48});
  expect({1, 1, 1}, {100, 0, 0});
  expect({0.5, 0.5, 0.5}, {53.39, 0, 0});
  expect({0, 0, 0}, {0, 0, 0});
  // Both curves are linear here: L* = (29/3)^3 Y.
  const double grey = 1 / 255.0;
  expect({grey, grey, grey}, {24389 / 27.0 * grey / 12.92, 0, 0});
}

TEST(MeanDeltaE94, AveragesInsideTheBorderAndTakesGreyAsRgb) {
  model::EncodedValues reference = Flat(12, 12, 0.5);
  model::EncodedValues other = reference;
  other.values[6 * 12 + 6] = 0.75F;
  other.values[0] = 0;
  const double one = DeltaE94(LabOf({0.5, 0.5, 0.5}), LabOf({0.75, 0.75, 0.75}));
  EXPECT_NEAR(CompareImages(reference, other, 1).delta_e94_mean, one / 100, 1e-9);
  // Red against green, half and half.
  model::EncodedValues red{12, 12, 3, {}}, mixed{12, 12, 3, {}};
  for (int i = 0; i < 144; ++i) {
    red.values.insert(red.values.end(), {1, 0, 0});
    if (i % 2 == 0) mixed.values.insert(mixed.values.end(), {1, 0, 0});
    if (i % 2 == 1) mixed.values.insert(mixed.values.end(), {0, 1, 0});
  }
  EXPECT_NEAR(CompareImages(red, mixed, 0).delta_e94_mean,
              DeltaE94({53.24, 80.09, 67.20}, {87.73, -86.18, 83.18}) / 2, 0.01);
}

TEST(MacadeStandin, IsOneForEqualOrientation) {
  const model::EncodedValues reference = Noise(60, 50, 1, 8);
  model::EncodedValues weaker = reference;
  model::EncodedValues inverted = reference;
  for (float& value : weaker.values) value = 0.25F + 0.5F * value;
  for (float& value : inverted.values) value = 1 - value;
  for (const model::EncodedValues& other : {reference, weaker, inverted}) {
    const auto standin = CompareImages(reference, other, 0).macade_standin;
    ASSERT_TRUE(standin);
    EXPECT_NEAR(*standin, 1, 1e-6);
  }
}

TEST(MacadeStandin, IsTwoOverPiForRandomOrientation) {
  const auto standin =
      CompareImages(Noise(300, 300, 1, 9), Noise(300, 300, 1, 10), 0).macade_standin;
  ASSERT_TRUE(standin);
  // Some 30 000 edge pixels have a standard deviation of 0.308 each; neighbours are correlated.
  EXPECT_NEAR(*standin, 2 / kPi, 0.01);
}

TEST(MacadeStandin, IsTheCosineBetweenTwoRamps) {
  const auto ramp = [](double angle) {
    return Drawn(30, 30, [angle](int x, int y) {
      return 0.5 + 0.015 * (std::cos(angle) * (x - 15) + std::sin(angle) * (y - 15));
    });
  };
  for (const double angle : {0.0, 0.3, kPi / 4, 1.2, 2.5}) {
    const auto standin = CompareImages(ramp(0.1), ramp(0.1 + angle), 0).macade_standin;
    ASSERT_TRUE(standin);
    EXPECT_NEAR(*standin, std::abs(std::cos(angle)), 1e-4) << angle;
  }
  EXPECT_NEAR(*CompareImages(ramp(0), ramp(kPi / 2), 0).macade_standin, 0, 1e-4);
}

TEST(MacadeStandin, CountsAnEdgeThatWasLostAsNothing) {
  const model::EncodedValues ramp = Drawn(20, 20, [](int x, int) { return 0.02 * x; });
  const model::EncodedValues half =
      Drawn(20, 20, [](int x, int y) { return y < 10 ? 0.02 * x : 0.5; });
  ASSERT_TRUE(CompareImages(ramp, Flat(20, 20, 0.5), 0).macade_standin);
  EXPECT_EQ(*CompareImages(ramp, Flat(20, 20, 0.5), 0).macade_standin, 0);
  // Rows 10 to 18 of 1 to 18: without any gradient from 11 on, an oblique one in rows 9 and 10.
  const double standin = *CompareImages(ramp, half, 0).macade_standin;
  EXPECT_GT(standin, 8.0 / 18);
  EXPECT_LT(standin, 10.0 / 18);
}

TEST(MacadeStandin, LooksAtEdgesOfTheReferenceOnly) {
  EXPECT_FALSE(CompareImages(Flat(20, 20, 0.5), Noise(20, 20, 1, 11), 0).macade_standin);
  // A gradient of less than 2/255 per px is taken for noise.
  const auto ramp = [](double slope) {
    return Drawn(20, 20, [slope](int x, int) { return slope * x; });
  };
  EXPECT_FALSE(CompareImages(ramp(1.9 / 255), ramp(0.02), 0).macade_standin);
  EXPECT_TRUE(CompareImages(ramp(2.1 / 255), ramp(0.02), 0).macade_standin);
  // A step of 0.8 in the middle (gradient 0.4 per px), and away from it a ramp of 0.1 per px, less
  // than half of that, which is turned by a quarter. Only the step counts.
  const auto step = [](bool turned) {
    return Drawn(60, 60, [turned](int x, int y) {
      const double level = x < 30 ? 0.1 : 0.9;
      if (x > 15 && x < 45) return level;
      const int along = (turned ? y : x) % 4;
      return level + 0.1 * (x < 30 ? along : -along);
    });
  };
  const auto standin = CompareImages(step(false), step(true), 0).macade_standin;
  ASSERT_TRUE(standin);
  EXPECT_NEAR(*standin, 1, 1e-9);
}

TEST(CompareImages, RefusesWhatDoesNotFit) {
  const model::EncodedValues image = Noise(20, 12, 1, 12);
  const auto message = [&](const model::EncodedValues& other, int border_px) {
    return ErrorOf([&] { CompareImages(image, other, border_px); });
  };
  EXPECT_THAT(message(Noise(21, 12, 1, 1), 0), AllOf(HasSubstr("20x12"), HasSubstr("21x12")));
  EXPECT_THAT(message(Noise(20, 12, 3, 1), 0), HasSubstr("3 channel"));
  EXPECT_THAT(message(image, 6), AllOf(HasSubstr("border of 6 px"), HasSubstr("0 to 5")));
  EXPECT_THAT(message(image, -1), HasSubstr("border of -1 px"));
  EXPECT_EQ(message(image, 5), "(no error)");
  EXPECT_THAT(message(model::EncodedValues{20, 12, 1, {0.5F}}, 0), HasSubstr("1 values"));
}

// Views of a texture that differ from it by `difference(k, l)`, stored as they are.
template <typename Difference>
model::LightField LightFieldOf(int u_count, int v_count, const Difference& difference) {
  model::LightField light_field = model::MakeLightField(24, 20, u_count, v_count, 1);
  light_field.transfer = model::TransferCurve::Linear();
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k < u_count; ++k) {
      model::EncodedValues texture = Noise(24, 20, 1, 77);
      for (float& value : texture.values)
        value = static_cast<float>(0.25 + 0.25 * value + difference(k, l));
      model::SetView(&light_field, k, l, {24, 20, 1, texture.values});
    }
  }
  return light_field;
}
model::LightField PlainLightField(int u_count, int v_count) {
  return LightFieldOf(u_count, v_count, [](int, int) { return 0.0; });
}
double PsnrOf(double difference) { return -20 * std::log10(difference); }

TEST(CompareLightFields, GivesMeanCentreAndCorners) {
  const auto difference = [](int k, int l) { return 0.01 * (1 + k + 3 * l); };
  const LightFieldScores scores =
      CompareLightFields(PlainLightField(3, 3), LightFieldOf(3, 3, difference), 2, std::nullopt, 1);
  ASSERT_EQ(scores.views.size(), 9U);
  double sum = 0;
  for (const ViewScores& view : scores.views) {
    EXPECT_NEAR(view.scores.psnr_db, PsnrOf(difference(view.u, view.v)), 1e-4);
    EXPECT_FALSE(view.dibr);
    sum += PsnrOf(difference(view.u, view.v));
  }
  EXPECT_EQ(scores.views[1].u, 1);
  EXPECT_EQ(scores.views[1].v, 0);
  EXPECT_NEAR(scores.mean.psnr_db, sum / 9, 1e-4);
  EXPECT_NEAR(scores.centre.psnr_db, PsnrOf(0.05), 1e-4);
  EXPECT_NEAR(scores.corner.psnr_db,
              (PsnrOf(0.01) + PsnrOf(0.03) + PsnrOf(0.07) + PsnrOf(0.09)) / 4, 1e-4);
  EXPECT_NEAR(scores.mean.macade_standin.value_or(0), 1, 1e-3);
  EXPECT_FALSE(scores.dibr_mean || scores.dibr_centre || scores.dibr_corner);
}

TEST(CompareLightFields, AveragesTheMiddleViewsOfEvenCounts) {
  const auto difference = [](int k, int l) { return 0.01 * (1 + k + 4 * l); };
  const LightFieldScores scores =
      CompareLightFields(PlainLightField(4, 3), LightFieldOf(4, 3, difference), 0, std::nullopt, 1);
  EXPECT_NEAR(scores.centre.psnr_db, (PsnrOf(0.06) + PsnrOf(0.07)) / 2, 1e-4);
  EXPECT_NEAR(scores.corner.psnr_db,
              (PsnrOf(0.01) + PsnrOf(0.04) + PsnrOf(0.09) + PsnrOf(0.12)) / 4, 1e-4);
}

TEST(CompareLightFields, MeansOfScoresAreMeans) {
  // If there is only the centre view, all three scores are equal to those of CompareImages.
  model::LightField reference = model::MakeLightField(24, 20, 1, 1, 3);
  model::LightField other = reference;
  const model::EncodedValues a = Noise(24, 20, 3, 5);
  const model::EncodedValues b = Noise(24, 20, 3, 6);
  model::SetView(&reference, 0, 0, {24, 20, 3, a.values});
  model::SetView(&other, 0, 0, {24, 20, 3, b.values});
  other.transfer = model::TransferCurve::Linear();  // for storing it; the reference's counts
  const ImageScores expected =
      CompareImages(model::EncodedValuesOf(model::ViewImage(reference, 0, 0), reference.transfer),
                    model::EncodedValuesOf(model::ViewImage(other, 0, 0), reference.transfer), 3);
  const LightFieldScores scores = CompareLightFields(reference, other, 3, std::nullopt, 1);
  for (const ImageScores& mean : {scores.mean, scores.centre, scores.corner}) {
    EXPECT_EQ(mean.psnr_db, expected.psnr_db);
    EXPECT_EQ(mean.ssim, expected.ssim);
    EXPECT_EQ(mean.delta_e94_mean, expected.delta_e94_mean);
    EXPECT_EQ(mean.macade_standin, expected.macade_standin);
  }
}

TEST(CompareLightFields, ViewsWithoutDifferenceDoNotHideTheOthers) {
  const auto difference = [](int k, int) { return k == 1 ? 0.0 : 0.02; };
  const LightFieldScores scores =
      CompareLightFields(PlainLightField(3, 1), LightFieldOf(3, 1, difference), 0, std::nullopt, 1);
  EXPECT_NEAR(scores.mean.psnr_db, PsnrOf(0.02), 1e-4);
  EXPECT_EQ(scores.centre.psnr_db, std::numeric_limits<double>::infinity());
  const LightFieldScores same =
      CompareLightFields(PlainLightField(3, 1), PlainLightField(3, 1), 0, std::nullopt, 1);
  EXPECT_EQ(same.mean.psnr_db, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(same.mean.ssim, 1, 1e-12);
  EXPECT_EQ(same.mean.delta_e94_mean, 0);
}

TEST(CompareLightFields, TakesTheViewsThatBothHave) {
  const auto difference = [](int k, int l) { return 0.01 * (1 + k + 3 * l); };
  model::LightField reference = PlainLightField(3, 3);
  model::LightField other = LightFieldOf(3, 3, difference);
  reference.present = {true, false, false, false, true, true, true, false, false};
  other.present = {false, true, true, false, true, true, true, true, true};
  const LightFieldScores scores = CompareLightFields(reference, other, 0, std::nullopt, 1);
  ASSERT_EQ(scores.views.size(), 3U);  // (1, 1), (2, 1), (0, 2)
  EXPECT_NEAR(scores.centre.psnr_db, PsnrOf(0.05), 1e-4);
  EXPECT_NEAR(scores.corner.psnr_db, PsnrOf(0.07), 1e-4);
  EXPECT_NEAR(scores.mean.psnr_db, (PsnrOf(0.05) + PsnrOf(0.06) + PsnrOf(0.07)) / 3, 1e-4);
  other.present.assign(9, false);
  other.present[1] = true;
  EXPECT_THAT(ErrorOf([&] { CompareLightFields(reference, other, 0, std::nullopt, 1); }),
              HasSubstr("no view in common"));
}

constexpr int kWide = 40;
constexpr int kHigh = 32;

// The point at x in the centre view is at x - a d, y - b d in the view (a, b).
model::LightField ShiftedTexture(const model::EncodedValues& texture, int disparity_px) {
  model::LightField light_field = model::MakeLightField(kWide, kHigh, 3, 3, 1);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      model::LinearImage view{kWide, kHigh, 1, {}};
      for (int y = 0; y < kHigh; ++y) {
        for (int x = 0; x < kWide; ++x) {
          const int from_x = std::clamp(x + (k - 1) * disparity_px, 0, kWide - 1);
          const int from_y = std::clamp(y + (l - 1) * disparity_px, 0, kHigh - 1);
          view.values.push_back(texture.values[static_cast<std::size_t>(from_y * kWide + from_x)]);
        }
      }
      model::SetView(&light_field, k, l, view);
    }
  }
  return light_field;
}

DibrInput DibrOf(const model::EncodedValues& texture, float disparity_px) {
  DibrInput dibr;
  dibr.photograph = {kWide, kHigh, 1, texture.values};
  dibr.disparity.width_px = kWide;
  dibr.disparity.height_px = kHigh;
  dibr.disparity.disparity.assign(texture.values.size(), disparity_px);
  return dibr;
}

TEST(CompareLightFields, WarpsThePhotographIntoEachView) {
  const model::EncodedValues texture = Noise(kWide, kHigh, 1, 13);
  const model::LightField truth = ShiftedTexture(texture, 2);
  const model::LightField still = ShiftedTexture(texture, 0);
  const LightFieldScores right = CompareLightFields(truth, still, 6, DibrOf(texture, 2), 1);
  ASSERT_TRUE(right.dibr_mean && right.dibr_centre && right.dibr_corner);
  EXPECT_GT(right.dibr_mean->psnr_db, 100);
  EXPECT_GT(right.dibr_corner->psnr_db, 100);
  EXPECT_LT(right.corner.psnr_db, 15);  // the texture is noise
  const LightFieldScores wrong = CompareLightFields(truth, still, 6, DibrOf(texture, -2), 1);
  EXPECT_LT(wrong.dibr_corner->psnr_db, 15);
  EXPECT_GT(wrong.dibr_centre->psnr_db, 100);  // needs no disparity
}

// Two means that are printed together are over the same views, although each has another view
// without a difference.
TEST(CompareLightFields, MeansOfEstimateAndBaselineAreOverTheSameViews) {
  const model::EncodedValues texture = Noise(kWide, kHigh, 1, 15);
  const model::LightField truth = ShiftedTexture(texture, 2);
  model::LightField other = ShiftedTexture(texture, 1);
  model::SetView(&other, 0, 0, model::ViewImage(truth, 0, 0));
  model::SetView(&other, 1, 1, model::ViewImage(other, 0, 0));
  // If the disparity is 1 px instead of 2, only the middle view is warped without error.
  const LightFieldScores scores = CompareLightFields(truth, other, 6, DibrOf(texture, 1), 1);
  double own = 0, warped = 0;
  int count = 0;
  for (const ViewScores& view : scores.views) {
    const bool is_own_finite = std::isfinite(view.scores.psnr_db);
    EXPECT_EQ(is_own_finite, view.u != 0 || view.v != 0);
    if (!is_own_finite || !std::isfinite(view.dibr->psnr_db)) continue;
    own += view.scores.psnr_db;
    warped += view.dibr->psnr_db;
    ++count;
  }
  ASSERT_GE(count, 7);
  EXPECT_NEAR(scores.mean.psnr_db, own / count, 1e-9);
  EXPECT_NEAR(scores.dibr_mean->psnr_db, warped / count, 1e-9);
}

TEST(CompareLightFields, GivesTheSameOnAnyNumberOfThreads) {
  const model::EncodedValues texture = Noise(kWide, kHigh, 1, 14);
  const model::LightField truth = ShiftedTexture(texture, 1);
  const model::LightField still = ShiftedTexture(texture, 0);
  const LightFieldScores one = CompareLightFields(truth, still, 3, DibrOf(texture, 0.7F), 1);
  const LightFieldScores four = CompareLightFields(truth, still, 3, DibrOf(texture, 0.7F), 4);
  ASSERT_EQ(one.views.size(), four.views.size());
  for (std::size_t i = 0; i < one.views.size(); ++i) {
    EXPECT_EQ(one.views[i].scores.psnr_db, four.views[i].scores.psnr_db);
    EXPECT_EQ(one.views[i].scores.ssim, four.views[i].scores.ssim);
    EXPECT_EQ(one.views[i].dibr->psnr_db, four.views[i].dibr->psnr_db);
  }
  EXPECT_EQ(one.mean.psnr_db, four.mean.psnr_db);
  EXPECT_EQ(one.mean.macade_standin, four.mean.macade_standin);
  EXPECT_EQ(one.dibr_mean->delta_e94_mean, four.dibr_mean->delta_e94_mean);
}

TEST(CompareLightFields, RefusesWhatDoesNotFit) {
  const model::LightField reference = PlainLightField(3, 3);
  const auto message = [&](const model::LightField& other, int border_px,
                           const std::optional<DibrInput>& dibr) {
    return ErrorOf([&] { CompareLightFields(reference, other, border_px, dibr, 2); });
  };
  EXPECT_THAT(message(PlainLightField(5, 3), 0, std::nullopt),
              AllOf(HasSubstr("3x3 views"), HasSubstr("5x3"), HasSubstr("inner views")));
  EXPECT_THAT(message(model::MakeLightField(24, 21, 3, 3, 1), 0, std::nullopt),
              AllOf(HasSubstr("24x20 px"), HasSubstr("24x21 px")));
  EXPECT_THAT(message(model::MakeLightField(24, 20, 3, 3, 3), 0, std::nullopt),
              HasSubstr("3 channel"));
  EXPECT_THAT(message(reference, 10, std::nullopt), HasSubstr("border of 10 px"));
  DibrInput dibr;
  dibr.photograph = model::ViewImage(reference, 1, 1);
  dibr.disparity.width_px = 24;
  dibr.disparity.height_px = 19;
  dibr.disparity.disparity.assign(24 * 19, 0.0F);
  EXPECT_THAT(message(reference, 0, dibr), AllOf(HasSubstr("24x19"), HasSubstr("24x20")));
  dibr.photograph.channels = 3;
  dibr.photograph.values.resize(24 * 20 * 3);
  EXPECT_THAT(message(reference, 0, dibr), AllOf(HasSubstr("photograph"), HasSubstr("3 channel")));
}

TEST(CompareLightFields, RefusesViewsOfOtherSteps) {
  model::LightField reference = PlainLightField(3, 1);
  reference.grid = model::LightFieldGrid{24, 20, 3, 1, {0, 300}, 0.1, 0.1, 0.5, 0, {0, 0}};
  model::LightField other = reference;
  const auto message = [&] {
    return ErrorOf([&] { CompareLightFields(reference, other, 0, std::nullopt, 1); });
  };
  other.grid->u_step_mm = 0.51;  // a calibration's error
  other.grid->v_step_mm = 3;     // of one view: nothing
  EXPECT_EQ(message(), "(no error)");
  other.grid->u_step_mm = 0.6;
  EXPECT_THAT(message(), AllOf(HasSubstr("0.5 mm"), HasSubstr("0.6 mm")));
  other.grid.reset();
  EXPECT_EQ(message(), "(no error)");
}

}  // namespace
}  // namespace thicklens::estimator
