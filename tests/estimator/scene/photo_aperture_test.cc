#include "thicklens/estimator/photo_aperture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "support/error_message.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using Verdict = PhotoAperture::Verdict;

constexpr int kW = 256, kH = 160;
constexpr int kViews = 5;

// Discs of many sizes before each other, whose edges are a px wide: the power spectrum is near
// |f|^-3 up to the frequencies of the pixels.
class Leaves {
 public:
  explicit Leaves(unsigned seed) : values_(static_cast<std::size_t>(kSide) * kSide, 0.5F) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int leaf = 0; leaf < 6000; ++leaf) {
      const double radius = 1.5 / std::sqrt(1e-3 + unit(engine));
      const double x = kSide * unit(engine), y = kSide * unit(engine);
      const double value = 0.15 + 0.7 * unit(engine);
      const int reach = static_cast<int>(radius) + 2;
      for (int j = static_cast<int>(y) - reach; j <= static_cast<int>(y) + reach; ++j) {
        for (int i = static_cast<int>(x) - reach; i <= static_cast<int>(x) + reach; ++i) {
          const double cover = std::clamp(radius + 0.5 - std::hypot(i - x, j - y), 0.0, 1.0);
          float& at = values_[Place(i, j)];
          at += static_cast<float>(cover * (value - static_cast<double>(at)));
        }
      }
    }
  }
  double operator()(double x, double y) const {
    const double i = std::floor(x), j = std::floor(y);
    const double a = x - i, b = y - j;
    return (1 - b) * ((1 - a) * At(i, j) + a * At(i + 1, j)) +
           b * ((1 - a) * At(i, j + 1) + a * At(i + 1, j + 1));
  }

 private:
  static constexpr int kSide = 320;
  static std::size_t Place(int i, int j) {
    return static_cast<std::size_t>((j % kSide + kSide) % kSide) * kSide +
           static_cast<std::size_t>((i % kSide + kSide) % kSide);
  }
  double At(double i, double j) const {
    return static_cast<double>(values_[Place(static_cast<int>(i), static_cast<int>(j))]);
  }
  std::vector<float> values_;
};

// Disparity of a plane, at column x: from -0.4 to 1.6 px per view step, so that neither a reversed
// map nor another focus looks the same.
constexpr double kSlope = 2.0 / kW, kAtZero = -0.4;
double DisparityAt(double x) { return kAtZero + kSlope * x; }

// The photograph of that plane through an aperture of `share` of the views', computed from rays
// through 11 x 11 samples that have the second moment of kViews x kViews samples of the same
// weight. The point at p in the centre view is at p - d(p) a in the view a, so that the pixel x
// shows p = (x + kAtZero a)/(1 - kSlope a).
EstimateInput PlaneInput(double share, double noise_levels, unsigned seed) {
  constexpr int kFine = 11;
  const double step = share * std::sqrt((kViews * kViews - 1.0) / (kFine * kFine - 1.0));
  const Leaves texture(seed);
  EstimateInput input;
  input.image = {kW, kH, 1, {}};
  input.disparity = {kW, kH, {}, {1, 1}};
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, kViews, kViews);
  input.transfer = model::TransferCurve::Linear();
  std::mt19937 engine(seed + 100);
  std::normal_distribution<double> noise(0, noise_levels / 255);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      double sum = 0;
      for (int k = 0; k < kFine; ++k) {
        const double a = step * (k - (kFine - 1) / 2);
        const double p = (x + kAtZero * a) / (1 - kSlope * a);
        for (int l = 0; l < kFine; ++l) {
          const double b = step * (l - (kFine - 1) / 2);
          sum += texture(p, y + DisparityAt(p) * b);
        }
      }
      const double stored = sum / (kFine * kFine) + noise(engine);
      input.image.values.push_back(static_cast<float>(std::round(255 * stored) / 255));
      input.disparity.disparity.push_back(static_cast<float>(DisparityAt(x)));
    }
  }
  return input;
}

void Reverse(EstimateInput* input) {
  model::FlipDepth(model::DepthFlip::kColumns, kW, &input->disparity.disparity);
}

class SharesAndNoises : public ::testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(SharesAndNoises, AreMeasuredWithinTheirErrors) {
  const auto [share, noise_levels] = GetParam();
  const PhotoAperture found = MeasurePhotoAperture(PlaneInput(share, noise_levels, 1), {});
  ASSERT_TRUE(found.share);
  // The square is what blur determines; its error holds for small shares as well.
  EXPECT_NEAR(*found.share * *found.share, share * share, 2.5 * found.sigma_of_square)
      << *found.share << " +- " << *found.sigma;
  EXPECT_LT(found.sigma_of_square, 0.35);
  if (share == 1) {
    EXPECT_EQ(found.verdict, Verdict::kCaptured) << found.message;
  } else {
    EXPECT_LT(found.used_share(), 0.85) << found.message;
  }
  if (share == 0) {
    EXPECT_EQ(found.verdict, Verdict::kSharp) << found.message;
  }
  EXPECT_FALSE(found.regions.empty());
}

INSTANTIATE_TEST_SUITE_P(PhotoApertureOf, SharesAndNoises,
                         ::testing::Combine(::testing::Values(0.0, 0.3, 0.6, 1.0),
                                            ::testing::Values(0.3, 3.0)));

// Views through one point of the aperture, and a scene in focus, predict no blur.
TEST(PhotoAperture, OfNoPredictedBlurIsUndecided) {
  EstimateInput input = PlaneInput(1, 1, 1);
  input.disparity.step = {0, 0};
  const PhotoAperture of_one_point = MeasurePhotoAperture(input, {});
  EXPECT_EQ(of_one_point.verdict, Verdict::kUndecided);
  EXPECT_THAT(of_one_point.message, HasSubstr("no blur anywhere"));
  EXPECT_EQ(of_one_point.used_share(), 1);
  input.disparity.step = {1, 1};
  std::fill(input.disparity.disparity.begin(), input.disparity.disparity.end(), 0.0F);
  EXPECT_EQ(MeasurePhotoAperture(input, {}).verdict, Verdict::kUndecided);
}

TEST(PhotoAperture, ErrorsAreThoseOfManyTextures) {
  double squares = 0;
  constexpr int kRuns = 9;
  for (unsigned seed = 10; seed < 10 + kRuns; ++seed) {
    const double share = seed % 3 == 0 ? 0.6 : seed % 3 == 1 ? 1 : 0.4;
    const PhotoAperture found = MeasurePhotoAperture(PlaneInput(share, 1, seed), {});
    ASSERT_TRUE(found.share);
    const double off = (*found.share * *found.share - share * share) / found.sigma_of_square;
    EXPECT_LT(std::abs(off), 3) << "seed " << seed << ": " << *found.share << " for " << share;
    squares += off * off / kRuns;
  }
  EXPECT_LT(squares, 2);
  EXPECT_GT(squares, 0.02);  // errors that are never reached would say nothing
}

TEST(PhotoAperture, AReversedMapOfACapturedPhotographIsNotCalledSharp) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    EstimateInput input = PlaneInput(1, 1, seed);
    Reverse(&input);
    const PhotoAperture found = MeasurePhotoAperture(input, {});
    EXPECT_EQ(found.used_share(), 1) << found.message;
  }
}

TEST(PhotoAperture, AnotherPlaneOfFocusIsNotCalledASmallerAperture) {
  for (const double offset_px : {-0.6, 0.6}) {
    EstimateInput input = PlaneInput(1, 1, 2);
    for (float& value : input.disparity.disparity) value += static_cast<float>(offset_px);
    EXPECT_EQ(MeasurePhotoAperture(input, {}).used_share(), 1) << offset_px;
  }
}

TEST(PhotoAperture, AScaleThatIsTooLargeLooksLikeASmallerAperture) {
  EstimateInput input = PlaneInput(1, 1, 3);
  for (float& value : input.disparity.disparity) value *= 1.7F;
  const PhotoAperture found = MeasurePhotoAperture(input, {});
  EXPECT_EQ(found.verdict, Verdict::kPartial);
  EXPECT_NEAR(found.used_share(), 1 / 1.7, 0.1);
  EXPECT_THAT(found.message, HasSubstr("scale of the depth"));
}

TEST(PhotoAperture, WithoutTextureOrBlurNothingIsDecided) {
  EstimateInput flat = PlaneInput(1, 1, 1);
  std::mt19937 engine(4);
  std::normal_distribution<float> noise(0.5F, 1.0F / 255);
  for (float& value : flat.image.values) value = noise(engine);
  PhotoAperture found = MeasurePhotoAperture(flat, {});
  EXPECT_EQ(found.verdict, Verdict::kUndecided);
  EXPECT_EQ(found.used_share(), 1);
  EXPECT_THAT(found.message, HasSubstr("does not show"));

  EstimateInput in_focus = PlaneInput(0, 1, 1);
  for (float& value : in_focus.disparity.disparity) value *= 0.05F;
  found = MeasurePhotoAperture(in_focus, {});
  EXPECT_EQ(found.verdict, Verdict::kUndecided) << found.message;
  EXPECT_EQ(found.used_share(), 1);
}

TEST(PhotoAperture, TheResultDoesNotDependOnThreads) {
  const EstimateInput input = PlaneInput(0.6, 1, 5);
  PhotoApertureOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const PhotoAperture a = MeasurePhotoAperture(input, one), b = MeasurePhotoAperture(input, three);
  EXPECT_EQ(a.share, b.share);
  EXPECT_EQ(a.sigma, b.sigma);
  EXPECT_EQ(a.message, b.message);
}

TEST(PhotoAperture, InvalidOptionsAreRefused) {
  PhotoApertureOptions options;
  options.compression_sigma = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&] { MeasurePhotoAperture(PlaneInput(0, 1, 1), options); }),
              HasSubstr("compression_sigma"));
  SceneOptions scene;
  std::string why;
  for (const double share : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    scene.photo_aperture = share;
    EXPECT_FALSE(scene.IsValid(&why));
    EXPECT_THAT(why, HasSubstr("photo_aperture"));
  }
}

// ---- The estimate with another aperture.

double PsnrDb(const model::LightField& a, const model::LightField& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i)
    sum += std::pow(static_cast<double>(a.values[i]) - static_cast<double>(b.values[i]), 2);
  return -10 * std::log10(sum / static_cast<double>(a.values.size()));
}

// The true views, away from the border, where they show what the photograph does not.
model::LightField TrueViews(unsigned seed, const model::LightField& like) {
  const Leaves texture(seed);
  model::LightField truth = like;
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      const double a = k - (kViews - 1) / 2.0, b = l - (kViews - 1) / 2.0;
      model::LinearImage view{kW, kH, 1, {}};
      for (int y = 0; y < kH; ++y) {
        for (int x = 0; x < kW; ++x) {
          const double p = (x + kAtZero * a) / (1 - kSlope * a);
          view.values.push_back(static_cast<float>(texture(p, y + DisparityAt(p) * b)));
        }
      }
      model::SetView(&truth, k, l, view);
    }
  }
  return truth;
}

model::LightField Inner(const model::LightField& light_field) {
  model::LightField inner = light_field;
  inner.values.clear();
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      const model::LinearImage view = model::ViewImage(light_field, k, l);
      for (int y = 8; y < kH - 8; ++y) {
        for (int x = 8; x < kW - 8; ++x) inner.values.push_back(view.at(x, y, 0));
      }
    }
  }
  return inner;
}

TEST(PhotoAperture, ASharpPhotographIsTheCentreViewAndNotWorseThanWarping) {
  for (const double noise_levels : {1.0}) {
    const EstimateInput input = PlaneInput(0, noise_levels, 6);
    SceneOptions options;
    options.photo_aperture = 0;
    SceneSummary summary;
    const model::LightField sharp = EstimateScene(input, options, {}, &summary);
    const model::LightField truth = Inner(TrueViews(6, sharp));
    const model::LightField warped = WarpedLightField(input, false, 0);
    const double sharp_db = PsnrDb(Inner(sharp), truth);
    EXPECT_GT(sharp_db, PsnrDb(Inner(warped), truth) - 0.1) << noise_levels;
    options.photo_aperture = 1;
    const model::LightField captured = EstimateScene(input, options, {}, &summary);
    EXPECT_GT(sharp_db, PsnrDb(Inner(captured), truth) + 3) << noise_levels;
  }
}

TEST(PhotoAperture, TheEffectiveApertureEstimatesBetterThanTheStatedOne) {
  const EstimateInput input = PlaneInput(0.6, 1, 7);
  SceneOptions options;
  SceneSummary summary;
  const model::LightField stated = EstimateScene(input, options, {}, &summary);
  const model::LightField truth = Inner(TrueViews(7, stated));
  options.photo_aperture = 0.6;
  const double right_db = PsnrDb(Inner(EstimateScene(input, options, {}, &summary)), truth);
  EXPECT_GT(right_db, PsnrDb(Inner(stated), truth) + 2);
  EXPECT_GT(right_db, PsnrDb(Inner(WarpedLightField(input, false, 0)), truth));
}

TEST(PhotoAperture, BandsOfAnotherApertureAgreeWithTheWhole) {
  const EstimateInput input = PlaneInput(0.6, 1, 8);
  SceneOptions options;
  options.photo_aperture = 0.6;
  SceneSummary summary;
  const model::LightField whole = EstimateScene(input, options, {}, &summary);
  options.least_bands = 3;
  const model::LightField bands = EstimateScene(input, options, {}, &summary);
  EXPECT_EQ(summary.bands, 3);
  EXPECT_GT(PsnrDb(whole, bands), 50);
}

}  // namespace
}  // namespace thicklens::estimator
