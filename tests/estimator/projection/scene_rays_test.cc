#include "estimator/projection/scene_rays.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "tests/estimator/plain_rays.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using model::ApertureShape;

DisparityMap MapOf(int width, int height, const std::function<double(int, int)>& disparity,
                   const Eigen::Vector2d& step = {1, 1}) {
  DisparityMap map{width, height, {}, step};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.disparity.push_back(static_cast<float>(disparity(x, y)));
  }
  return map;
}

// A slanted floor, with a nearer and a farther thing that hide some of it; no whole number of
// vectors wide.
DisparityMap Occluded() {
  return MapOf(37, 23, [](int x, int y) {
    if (x > 8 && x < 20 && y > 5 && y < 16) return 1.75 + 0.01 * x;
    if (std::hypot(x - 28, y - 12) < 5) return -1.1;
    return -0.6 + 0.03 * x - 0.01 * y;
  });
}

struct Case {
  DisparityMap map;
  Eigen::ArrayXXd weights;
};

std::vector<Case> Cases() {
  return {
      {Occluded(), model::ApertureWeights(ApertureShape::kGaussian, 3, 5)},
      {Occluded(), model::ApertureWeights(ApertureShape::kDisc, 5, 5)},  // some have no weight
      {Occluded(), model::ApertureWeights(ApertureShape::kUniform, 4, 1)},
      {MapOf(21, 9, [](int x, int y) { return 0.5 - 0.02 * x + 0.03 * y; }, {1.5, -0.8}),
       model::ApertureWeights(ApertureShape::kGaussian, 3, 3)},
      {MapOf(16, 8, [](int, int) { return 1.0; }),
       model::ApertureWeights(ApertureShape::kGaussian, 3, 3)},
      {MapOf(9, 1, [](int x, int) { return 0.1 * x; }),
       model::ApertureWeights(ApertureShape::kGaussian, 3, 3)},
      {MapOf(1, 9, [](int, int y) { return 0.1 * y; }),
       model::ApertureWeights(ApertureShape::kGaussian, 3, 3)},
      {MapOf(3, 2, [](int, int) { return 0.0; }),
       model::ApertureWeights(ApertureShape::kUniform, 2, 2)},
  };
}

std::vector<float> RandomNumbers(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> numbers(count);
  for (float& number : numbers) number = uniform(engine);
  return numbers;
}

SceneRays<float> Make(const Case& made, int threads = 1) {
  return SceneRays<float>(made.map, made.weights, threads, nullptr);
}

// The planes without their margins.
Eigen::VectorXd Dense(const SceneRays<float>& rays, const std::vector<float>& planes) {
  Eigen::VectorXd dense(static_cast<Eigen::Index>(rays.view_count() * rays.pixels()));
  for (std::size_t k = 0; k < rays.view_count(); ++k) {
    for (std::size_t i = 0; i < rays.pixels(); ++i) {
      dense[static_cast<Eigen::Index>(k * rays.pixels() + i)] = planes[k * rays.plane_stride() + i];
    }
  }
  return dense;
}
Eigen::VectorXd Dense(const std::vector<float>& image) {
  return Eigen::Map<const Eigen::VectorXf>(image.data(), static_cast<Eigen::Index>(image.size()))
      .cast<double>();
}

TEST(SceneRays, EqualTheRaysOneByOne) {
  for (const Case& made : Cases()) {
    SceneRays<float> rays = Make(made);
    const Eigen::MatrixXd h = testing::PhotographMatrix(made.map, made.weights);
    const std::vector<float> planes = RandomNumbers(rays.view_count() * rays.plane_stride(), 1);
    std::vector<float> photograph(rays.pixels());
    rays.Apply(planes.data(), rays.plane_stride(), photograph.data());
    EXPECT_LT((Dense(photograph) - h * Dense(rays, planes)).lpNorm<Eigen::Infinity>(), 1e-5)
        << made.map.width_px << "x" << made.map.height_px;
  }
}

TEST(SceneRays, TransposedEqualTheRaysOneByOne) {
  for (const Case& made : Cases()) {
    SceneRays<float> rays = Make(made);
    const Eigen::MatrixXd h = testing::PhotographMatrix(made.map, made.weights);
    const std::vector<float> photograph = RandomNumbers(rays.pixels(), 2);
    std::vector<float> planes(rays.view_count() * rays.plane_stride(), 7.0F);
    rays.ApplyTransposed(photograph.data(), planes.data());
    EXPECT_LT((Dense(rays, planes) - h.transpose() * Dense(photograph)).lpNorm<Eigen::Infinity>(),
              1e-5)
        << made.map.width_px << "x" << made.map.height_px;
    for (std::size_t k = 0; k < rays.view_count(); ++k) {
      for (std::size_t i = rays.pixels(); i < rays.plane_stride(); ++i) {
        ASSERT_EQ(planes[k * rays.plane_stride() + i], 0.0F);
      }
    }
  }
}

TEST(SceneRays, PassTheDotProductTest) {
  for (const Case& made : Cases()) {
    SceneRays<float> rays = Make(made);
    const std::vector<float> y = RandomNumbers(rays.pixels(), 3);
    std::vector<float> x = RandomNumbers(rays.view_count() * rays.plane_stride(), 4);
    std::vector<float> forward(y.size()), back(x.size());
    rays.Apply(x.data(), rays.plane_stride(), forward.data());
    rays.ApplyTransposed(y.data(), back.data());
    const double left = Dense(forward).dot(Dense(y));
    const double right = Dense(rays, x).dot(Dense(rays, back));
    EXPECT_NEAR(left, right, 1e-6 * Dense(y).norm() * Dense(forward).norm());
  }
}

TEST(SceneRays, PassItInDoubleToTheLastDigits) {
  for (const Case& made : Cases()) {
    SceneRays<double> rays(made.map, made.weights, 1, nullptr);
    const std::vector<float> random_y = RandomNumbers(rays.pixels(), 3);
    const std::vector<float> random_x = RandomNumbers(rays.view_count() * rays.plane_stride(), 4);
    const std::vector<double> y(random_y.begin(), random_y.end());
    const std::vector<double> x(random_x.begin(), random_x.end());
    std::vector<double> forward(y.size()), back(x.size());
    rays.Apply(x.data(), rays.plane_stride(), forward.data());
    rays.ApplyTransposed(y.data(), back.data());
    double left = 0, right = 0;
    for (std::size_t i = 0; i < y.size(); ++i) left += forward[i] * y[i];
    for (std::size_t i = 0; i < x.size(); ++i) right += x[i] * back[i];
    EXPECT_NEAR(left, right, 1e-12 * static_cast<double>(y.size()));
  }
}

// If all rays of a point are equal, H is that of the scene.
TEST(SceneRays, OfALambertianSceneAreItsProjection) {
  const Case made = Cases()[1];
  ProjectionOptions options;
  options.tolerance_px = 1e-9;
  options.interpolation = Interpolation::kLinear;
  const auto projection = MakeSceneProjection<float>(made.map, made.weights, options);
  SceneRays<float> rays = Make(made);
  std::vector<float> image = RandomNumbers(rays.plane_stride(), 5);
  std::vector<float> expected(rays.pixels()), found(rays.pixels());
  projection.Apply(image.data(), 1, expected.data());
  rays.Apply(image.data(), 0, found.data());
  for (std::size_t i = 0; i < found.size(); ++i) ASSERT_NEAR(found[i], expected[i], 2e-6);
}

TEST(SceneRays, ShowWhatAViewSees) {
  const Case made = Cases()[0];
  const SceneRays<float> rays = Make(made);
  std::vector<float> image = RandomNumbers(rays.plane_stride(), 6);
  std::vector<float> shown(rays.pixels());
  rays.Show(3 * 4 + 2, image.data(), shown.data());
  image.resize(rays.pixels());
  const Eigen::VectorXd expected = testing::ViewMatrix(made.map, 1, 2) * Dense(image);
  EXPECT_LT((Dense(shown) - expected).lpNorm<Eigen::Infinity>(), 1e-5);
}

TEST(SceneRays, SameBitsOnAnyNumberOfThreads) {
  for (const Case& made : Cases()) {
    SceneRays<float> one = Make(made);
    const std::vector<float> planes = RandomNumbers(one.view_count() * one.plane_stride(), 7);
    std::vector<float> expected(one.pixels()), found(one.pixels());
    std::vector<float> expected_back(planes.size()), found_back(planes.size());
    one.Apply(planes.data(), one.plane_stride(), expected.data());
    one.ApplyTransposed(expected.data(), expected_back.data());
    for (const int threads : {2, 3}) {
      SceneRays<float> several = Make(made, threads);
      several.Apply(planes.data(), several.plane_stride(), found.data());
      EXPECT_EQ(found, expected);
      several.ApplyTransposed(expected.data(), found_back.data());
      EXPECT_EQ(found_back, expected_back);
    }
  }
}

}  // namespace
}  // namespace thicklens::estimator
