// The data of a photograph for the scene solver: weights, slopes, strengths.
#include "estimator/scene/scene_data.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/encoding_slope.h"
#include "estimator/scene/scene_priors.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

TEST(SceneData, PlanesAndPixelsHoldTheSameNumbers) {
  const model::LinearImage image{2, 2, 3, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}};
  const std::vector<float> planes = Planar<float>(image);
  EXPECT_EQ(planes, (std::vector<float>{1, 4, 7, 10, 2, 5, 8, 11, 3, 6, 9, 12}));
  EXPECT_EQ(Interleaved(planes, 2, 2, 3).values, image.values);
}

TEST(SceneData, OccludedPixelsHaveLessWeight) {
  const std::vector<double> squares{4, 4, 9};
  const std::vector<float> occluded{0, 0.05F, 1};
  const std::vector<double> weights = DataWeights(squares, occluded, true);
  EXPECT_NEAR(weights[0], 4, 1e-12);
  EXPECT_NEAR(weights[1], 2, 1e-6);
  EXPECT_NEAR(weights[2], 9.0 / 401, 1e-9);
  EXPECT_EQ(DataWeights(squares, occluded, false), squares);
}

// The rows are compared with the operator itself, in the middle of an image with one depth.
TEST(SceneData, SquaredRowsAreThoseOfTheProjection) {
  for (const float disparity_px : {0.0F, 0.7F, -1.5F}) {
    const DisparityMap map{25, 25, std::vector<float>(625, disparity_px), {1, 0.8}};
    const Eigen::ArrayXXd weights = model::ApertureWeights(model::ApertureShape::kGaussian, 5, 3);
    const SceneProjection<double> projection = MakeSceneProjection<double>(map, weights, {});
    std::vector<double> one(625, 0.0), row(625);
    constexpr std::size_t kMiddle = 12 * 25 + 12;
    one[kMiddle] = 1;
    projection.ApplyTransposed(one.data(), 1, row.data());
    double expected = 0;
    for (const double value : row) expected += value * value;
    EXPECT_NEAR(SquaredRows<double>(map, weights)[kMiddle], expected, 0.1 * expected);
  }
}

// kappa = 0: whatever the depth, every view is the photograph, and a row a single one.
TEST(SceneData, SquaredRowsOfAnApertureWithoutBlurAreOne) {
  const DisparityMap map{3, 2, std::vector<float>(6, 40), {0, 0}};
  const Eigen::ArrayXXd weights = model::ApertureWeights(model::ApertureShape::kGaussian, 3, 3);
  for (const double row : SquaredRows<double>(map, weights)) EXPECT_NEAR(row, 1, 1e-12);
}

TEST(SceneData, BlurIsThatOfThePlacesOfTheAperture) {
  const DisparityMap map{2, 1, {-2, 0.5F}, {1, 1}};
  const Eigen::ArrayXXd weights = model::ApertureWeights(model::ApertureShape::kUniform, 5, 5);
  const std::vector<float> sigma_px = BlurSigmaPx(map, weights);
  EXPECT_NEAR(sigma_px[0], 2 * std::sqrt(2.0), 1e-5);  // of -2, -1, 0, 1, 2 the variance is 2
  EXPECT_NEAR(sigma_px[1], 0.5 * std::sqrt(2.0), 1e-5);
}

TEST(EncodingSlope, IsTheDerivativeOfTheCurve) {
  for (const double light : {0.01, 0.1, 0.5, 0.9}) {
    const model::LinearImage image{3, 3, 1, std::vector<float>(9, static_cast<float>(light))};
    EXPECT_NEAR(EncodingSlopes(image, model::TransferCurve::Srgb(), 2)[4],
                1.055 / 2.4 * std::pow(light, 1 / 2.4 - 1), 2e-3 * std::pow(light, 1 / 2.4 - 1));
    EXPECT_NEAR(EncodingSlopes(image, model::TransferCurve::Gamma(2.2), 2)[4],
                std::pow(light, 1 / 2.2 - 1) / 2.2, 2e-3 * std::pow(light, 1 / 2.2 - 1));
    EXPECT_NEAR(EncodingSlopes(image, model::TransferCurve::Linear(), 2)[4], 1, 1e-6);
  }
  // Black has that of the darkest light that counts.
  const model::LinearImage black{1, 1, 1, {-0.01F}};
  const double darkest = std::pow(kDarkest, 2.2);
  EXPECT_NEAR(EncodingSlopes(black, model::TransferCurve::Gamma(2.2), 0)[0],
              std::pow(darkest, 1 / 2.2 - 1) / 2.2, 0.02);
}

TEST(EncodingSlope, TheTableIsTheCurve) {
  for (const auto& transfer : {model::TransferCurve::Srgb(), model::TransferCurve::Gamma(2.2),
                               model::TransferCurve::Linear()}) {
    const EncodedValueTable table(transfer);
    for (double light = -0.2; light < 1.3; light += 0.00137) {
      EXPECT_NEAR(static_cast<double>(table.Encode(static_cast<float>(light))),
                  transfer.Encode(light), 2e-5)
          << transfer.Name() << " " << light;
    }
  }
}

// A map that takes nine tenths away, and a slope of the light: both variances are known.
TEST(SceneStrength, IsTheNoiseOverWhatThePriorSpeaksOf) {
  DataTerm<double> data;
  data.width_px = 40;
  data.height_px = 30;
  data.channels = 1;
  data.projection.apply = [](const double* x, int, double* y) {
    for (int i = 0; i < 40 * 30; ++i) y[i] = 0.1 * x[i];
  };
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) data.photograph.push_back(x % 2 == 0 ? 0.5 : 0.3);
  }
  const std::vector<double> slope_squared(40 * 30, 4.0);
  constexpr double kSigma = 0.02;
  const double lost = 4 * 0.81 * (0.25 + 0.09) / 2;
  EXPECT_NEAR(StrengthForNoise(Prior::kRidge, kSigma, data, slope_squared),
              0.2 * kSigma * kSigma / (lost - kSigma * kSigma), 1e-9);
  const double slope = 4 * 0.04 * (39.0 / 40) / 2;
  EXPECT_NEAR(StrengthForNoise(Prior::kGradient, kSigma, data, slope_squared),
              0.125 * kSigma * kSigma / (slope - 2 * kSigma * kSigma), 1e-9);
  EXPECT_EQ(StrengthForNoise(Prior::kPatches, 4.0 / 255, data, slope_squared),
            StrengthForNoise(Prior::kTotalVariation, 4.0 / 255, data, slope_squared));
  EXPECT_NEAR(StrengthForNoise(Prior::kTotalVariation, 4.0 / 255, data, slope_squared), 8e-3,
              1e-12);
}

}  // namespace
}  // namespace thicklens::estimator
