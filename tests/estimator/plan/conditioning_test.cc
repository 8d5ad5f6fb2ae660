// Conditioning of the systems: eigenvalues are compared with closed forms and bounds, and the
// limits of float are tested.
#include "thicklens/estimator/conditioning.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstddef>

#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

EstimateInput Plane(int size_px, int views, double disparity_px, double slope = 0) {
  EstimateInput input;
  input.image = model::LinearImage{
      size_px, size_px, 1, std::vector<float>(static_cast<std::size_t>(size_px * size_px), 0.5F)};
  input.disparity.width_px = input.disparity.height_px = size_px;
  for (int i = 0; i < size_px * size_px; ++i) {
    input.disparity.disparity.push_back(
        static_cast<float>(disparity_px + slope * (i % size_px - size_px / 2)));
  }
  input.weights = Eigen::ArrayXXd::Constant(views, views, 1.0 / (views * views));
  return input;
}

// In focus the pixels are independent: w w^T + gamma D^T D + mu of the rays of one pixel, by hand.
TEST(Conditioning, OfAPlaneInFocusIsThatOfOnePixel) {
  for (const int views : {2, 3, 4}) {
    const int rays = views * views;
    for (const double gamma : {1e-6, 1.0, 1e3}) {
      constexpr double kRidge = 1e-3;
      Eigen::MatrixXd pixel = Eigen::MatrixXd::Constant(rays, rays, 1.0 / (rays * rays));
      pixel.diagonal().array() += kRidge;
      const auto add_link = [&](int a, int b) {
        pixel(a, a) += gamma;
        pixel(b, b) += gamma;
        pixel(a, b) -= gamma;
        pixel(b, a) -= gamma;
      };
      for (int l = 0; l < views; ++l) {
        for (int k = 0; k < views; ++k) {
          if (k + 1 < views) add_link(l * views + k, l * views + k + 1);
          if (l + 1 < views) add_link(l * views + k, (l + 1) * views + k);
        }
      }
      const Eigen::VectorXd values =
          Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(pixel).eigenvalues();
      BlockOptions options;
      options.gamma = gamma;
      options.ridge = kRidge;
      const Conditioning found = ConditioningOfBlock(Plane(4, views, 0), options);
      EXPECT_EQ(found.unknowns, 16 * rays);
      EXPECT_NEAR(found.smallest, values.minCoeff(), 1e-9 * values.maxCoeff());
      EXPECT_NEAR(found.largest, values.maxCoeff(), 1e-9 * values.maxCoeff());
      // In scene-ray form w^T A^-1 w, and all ones are an eigenvector of A: 1/(K mu).
      FunctionalOptions functional;
      functional.gamma = gamma;
      functional.ridge = kRidge;
      const Conditioning of_rays = ConditioningOfSceneRays(Plane(4, views, 0), functional);
      EXPECT_EQ(of_rays.unknowns, 16);
      EXPECT_NEAR(of_rays.largest, 1 + 1 / (rays * kRidge), 1e-6 / kRidge);
      EXPECT_NEAR(of_rays.smallest, 1 + 1 / (rays * kRidge), 1e-6 / kRidge);
    }
  }
}

// 1 <= eigenvalues <= 1 + 1/mu' with mu' = K mu, whatever blur and depth: never singular. Rows of
// H1 sum to 1, and of a plane its columns to 1 at most but at the border, where rays that would
// leave the image stay in it.
TEST(Conditioning, OfSceneRaysIsBoundedByTheRidgeAlone) {
  constexpr double kBorder = 1.3;
  for (const double disparity_px : {0.0, 0.4, 1.0, 2.0}) {
    for (const double slope : {0.0, 0.15}) {
      for (const double ridge_of_point : {5e-2, 5e-3, 5e-4}) {
        const EstimateInput input = Plane(12, 3, disparity_px, slope);
        FunctionalOptions options;
        options.gamma = 1e6;  // nearly the limit
        options.ridge = ridge_of_point / 9;
        const Conditioning found = ConditioningOfSceneRays(input, options);
        EXPECT_GE(found.smallest, 1 - 1e-9);
        EXPECT_LE(found.largest, 1 + kBorder / ridge_of_point);
        EXPECT_LE(found.condition(), 1 + kBorder / ridge_of_point);
        EXPECT_GE(found.largest, 1 + 0.5 / ridge_of_point);  // the bound is met, nearly
      }
    }
  }
}

TEST(Conditioning, GrowsWithGammaAndWithoutARidgeIsInfinite) {
  const EstimateInput input = Plane(8, 3, 0.7);
  const auto condition = [&](double gamma, double ridge) {
    BlockOptions options;
    options.gamma = gamma;
    options.ridge = ridge;
    return ConditioningOfBlock(input, options);
  };
  double last = 0;
  for (const double gamma : {1.0, 1e2, 1e4, 1e6}) {
    const double now = condition(gamma, 1e-3).condition();
    EXPECT_GT(now, 10 * last);
    last = now;
  }
  EXPECT_GT(condition(1, 1e-8).condition(), 1e5 * condition(1, 1e-2).condition());
  // The matrix is singular up to the last bits.
  const Conditioning singular = condition(1, 0);
  EXPECT_LT(std::abs(singular.smallest), 1e-12 * singular.largest);
}

// Float fails where double does not: the condition is beyond one's digits and within the other's.
TEST(Conditioning, FloatFailsWhereDoubleDoesNot) {
  const EstimateInput input = Plane(8, 3, 0.7);
  BlockOptions options;
  const Conditioning usual = ConditioningOfBlock(input, options);
  ASSERT_TRUE(usual.float_error && usual.double_error);
  EXPECT_LT(*usual.float_error, 1e-3);
  EXPECT_LT(*usual.double_error, 1e-11);
  options.ridge = 1e-9;
  const Conditioning hard = ConditioningOfBlock(input, options);
  EXPECT_GT(hard.condition(), 1e8);
  EXPECT_FALSE(hard.float_error && *hard.float_error < 0.01);
  ASSERT_TRUE(hard.double_error);
  EXPECT_LT(*hard.double_error, 1e-5);
}

// Explicit stencils with a depth that varies are not symmetric; they are looked at all the same.
TEST(Conditioning, TakesTheSourcesStencilByItsSingularValues) {
  BlockOptions options;
  options.stencil = Stencil::kSource;
  const Conditioning found = ConditioningOfBlock(Plane(6, 3, 0.5, 0.1), options);
  EXPECT_GT(found.largest, found.smallest);
  EXPECT_GE(found.smallest, 0);
}

TEST(Conditioning, RefusesWhatIsTooLarge) {
  EXPECT_THROW(ConditioningOfBlock(Plane(40, 3, 0.5), {}), Error);
  EXPECT_THROW(ConditioningOfSceneRays(Plane(80, 3, 0.5), {}), Error);
  BlockOptions wrong;
  wrong.gamma = -1;
  EXPECT_THROW(ConditioningOfBlock(Plane(4, 2, 0), wrong), Error);
}

}  // namespace
}  // namespace thicklens::estimator
