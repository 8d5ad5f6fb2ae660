#include "estimator/projection/scene_projection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <random>
#include <vector>

#include "support/error_message.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;

constexpr double kPi = 3.14159265358979323846;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

DisparityMap MapOf(int width, int height, const std::function<double(int, int)>& disparity,
                   const Eigen::Vector2d& step = {1, 1}) {
  DisparityMap map{width, height, {}, step};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.disparity.push_back(static_cast<float>(disparity(x, y)));
  }
  return map;
}

Eigen::ArrayXXd Weights(model::ApertureShape shape, int u_count, int v_count) {
  return model::ApertureWeights(shape, u_count, v_count);
}

// A slanted floor with two nearer things on it, which hide some of it.
DisparityMap Occluded() {
  return MapOf(90, 70, [](int x, int y) {
    if (x > 20 && x < 45 && y > 15 && y < 50) return 1.75 + 0.004 * x;
    if (std::hypot(x - 62, y - 40) < 11) return -1.1;
    return -0.6 + 0.006 * x - 0.003 * y;
  });
}

std::vector<double> RandomImage(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> value(0, 1);
  std::vector<double> image(count);
  for (double& v : image) v = value(random);
  return image;
}

template <typename Real>
SceneProjection<Real> Make(const DisparityMap& map, const Eigen::ArrayXXd& weights,
                           double tolerance_px = 0.2, int threads = 2,
                           Interpolation interpolation = Interpolation::kCubic) {
  ProjectionOptions options;
  options.tolerance_px = tolerance_px;
  options.threads = threads;
  options.interpolation = interpolation;
  return MakeSceneProjection<Real>(map, weights, options);
}

// Keys' kernel, a = -1/2.
double Cubic(double t) {
  t = std::abs(t);
  if (t >= 2) return 0;
  return t <= 1 ? 1.5 * t * t * t - 2.5 * t * t + 1 : -0.5 * t * t * t + 2.5 * t * t - 4 * t + 2;
}

// The pixels and weights that the pixel i reads from a source: cubic if that is selected and
// possible.
struct Read {
  double value = 0;
  bool is_cubic = false;
};
Read ReadAt(const DisparityMap& map, std::size_t i, const kernels::OccludedSample& from, bool cubic,
            const std::vector<double>& x) {
  const double tolerance = 0.3 / map.step.cwiseAbs().maxCoeff();
  const double px = std::clamp<double>(static_cast<double>(i % Index(map.width_px)) + from.source_x,
                                       0, map.width_px - 1);
  const double py = std::clamp<double>(static_cast<double>(i / Index(map.width_px)) + from.source_y,
                                       0, map.height_px - 1);
  double sum = 0, share = 0, best = 1e300, closest = 0;
  const int column = static_cast<int>(px), row = static_cast<int>(py);
  cubic = cubic && column >= 1 && row >= 1 && column + 2 < map.width_px && row + 2 < map.height_px;
  for (int j = row - 1; cubic && j <= row + 2; ++j) {
    for (int n = column - 1; cubic && n <= column + 2; ++n) {
      const std::size_t at = Index(j) * Index(map.width_px) + Index(n);
      cubic = std::abs(double{map.disparity[at]} - from.disparity) <= tolerance;
      sum += Cubic(px - n) * Cubic(py - j) * x[at];
    }
  }
  if (cubic) return {sum, true};
  sum = 0;
  for (int j = row; j <= std::min(row + 1, map.height_px - 1); ++j) {
    const double wy = 1 - std::abs(py - j);
    if (!(wy > 0)) continue;
    for (int n = column; n <= std::min(column + 1, map.width_px - 1); ++n) {
      const double wx = 1 - std::abs(px - n);
      if (!(wx > 0)) continue;
      const std::size_t at = Index(j) * Index(map.width_px) + Index(n);
      const double apart = std::abs(double{map.disparity[at]} - from.disparity);
      if (apart < best) {
        best = apart;
        closest = x[at];
      }
      if (apart > tolerance) continue;
      sum += wx * wy * x[at];
      share += wx * wy;
    }
  }
  return {share > 0 ? sum / share : closest, false};
}

struct Gathered {
  std::vector<double> image;
  std::vector<bool> is_cubic;  // all rays of the pixel
};

// The photograph pixel by pixel and ray by ray, from the rendered views alone.
Gathered PlainGather(const DisparityMap& map, const Eigen::ArrayXXd& weights,
                     const std::vector<double>& x, Interpolation interpolation) {
  Gathered gathered{std::vector<double>(map.disparity.size(), 0.0),
                    std::vector<bool>(map.disparity.size(), true)};
  std::vector<double>& y = gathered.image;
  for (int l = 0; l < weights.rows(); ++l) {
    for (int k = 0; k < weights.cols(); ++k) {
      if (weights(l, k) == 0) continue;
      const ViewDisparity view =
          RenderDisparity(map, k - (static_cast<double>(weights.cols()) - 1) / 2,
                          l - (static_cast<double>(weights.rows()) - 1) / 2);
      for (std::size_t i = 0; i < y.size(); ++i) {
        const auto boundary =
            std::find_if(view.boundary.begin(), view.boundary.end(),
                         [&](const auto& one) { return static_cast<std::size_t>(one.index) == i; });
        const double share = boundary != view.boundary.end() ? double{boundary->share} : 0;
        const bool cubic = interpolation == Interpolation::kCubic && share == 0;
        Read read =
            ReadAt(map, i, {0, view.source_x[i], view.source_y[i], view.disparity[i]}, cubic, x);
        if (!read.is_cubic) gathered.is_cubic[i] = false;
        if (share > 0) {
          read.value += share * (ReadAt(map, i, boundary->other, false, x).value - read.value);
        }
        y[i] += weights(l, k) * read.value;
      }
    }
  }
  return gathered;
}

// The transfer of a wave by interpolation at `shift` from a sample.
std::complex<double> Transfer(double shift, double frequency, Interpolation interpolation) {
  std::complex<double> sum = 0;
  for (int n = static_cast<int>(std::floor(shift)) - 1; n <= std::floor(shift) + 2; ++n) {
    const double weight = interpolation == Interpolation::kCubic
                              ? Cubic(shift - n)
                              : std::max(0.0, 1 - std::abs(shift - n));
    sum += weight * std::exp(std::complex<double>(0, 2 * kPi * frequency * n));
  }
  return sum;
}

class SceneProjectionBetween : public ::testing::TestWithParam<Interpolation> {};

INSTANTIATE_TEST_SUITE_P(Interpolations, SceneProjectionBetween,
                         ::testing::Values(Interpolation::kLinear, Interpolation::kCubic),
                         [](const ::testing::TestParamInfo<Interpolation>& which) {
                           return which.param == Interpolation::kCubic ? "Cubic" : "Linear";
                         });

// A wave stays a wave: H multiplies it by sum_k w_k times the transfer of the interpolation at the
// view's shift.
TEST_P(SceneProjectionBetween, OfConstantDepthIsAProductInTheFourierDomain) {
  const Eigen::ArrayXXd weights = Weights(model::ApertureShape::kGaussian, 7, 5);
  for (const double d : {0.75, -1.375, 0.0}) {
    const DisparityMap map = MapOf(80, 60, [&](int, int) { return d; });
    const auto projection = Make<double>(map, weights, 0.2, 2, GetParam());
    for (const auto& [fx, fy] : {std::pair{0.05, 0.11}, std::pair{0.23, -0.31}}) {
      std::complex<double> transfer = 0;
      for (int l = 0; l < 5; ++l) {
        for (int k = 0; k < 7; ++k)
          transfer += weights(l, k) * Transfer((k - 3) * d, fx, GetParam()) *
                      Transfer((l - 2) * d, fy, GetParam());
      }
      std::vector<double> x(projection.pixels()), y(projection.pixels());
      const auto wave = [&, fx = fx, fy = fy](int i, int j) {
        return std::exp(std::complex<double>(0, 2 * kPi * (fx * i + fy * j)));
      };
      for (int j = 0; j < 60; ++j) {
        for (int i = 0; i < 80; ++i) x[Index(j * 80 + i)] = wave(i, j).real();
      }
      projection.Apply(x.data(), 1, y.data());
      for (int j = 5; j < 55; ++j) {
        for (int i = 8; i < 72; ++i)
          ASSERT_NEAR(y[Index(j * 80 + i)], (transfer * wave(i, j)).real(), 1e-12)
              << d << " at " << i << ", " << j;
      }
    }
  }
}

// If rays are placed to a tolerance, the sums differ by the tolerance times the slope of the
// image. With a tolerance near 0 all surfaces except flat ones get rows of their own. Rows are
// linear; a product beside an edge may be cubic along one axis only.
TEST_P(SceneProjectionBetween, EqualsTheRaysOneByOne) {
  const Interpolation interpolation = GetParam();
  const DisparityMap map = Occluded();
  const std::vector<double> x = RandomImage(map.disparity.size(), 3);
  for (const auto shape : {model::ApertureShape::kUniform, model::ApertureShape::kGaussian,
                           model::ApertureShape::kDisc}) {
    for (const auto& [u, v] : {std::pair{5, 5}, std::pair{4, 3}, std::pair{1, 3}}) {
      const Eigen::ArrayXXd weights = Weights(shape, u, v);
      const Gathered linear = PlainGather(map, weights, x, Interpolation::kLinear);
      const Gathered cubic = PlainGather(map, weights, x, Interpolation::kCubic);
      // Compares the pixels at which the rays give the right value, and returns the number of these
      // pixels.
      const auto compare = [&](const SceneProjection<double>& projection, double tolerance) {
        std::vector<bool> is_linear(x.size(), interpolation == Interpolation::kLinear);
        for (const std::int32_t pixel : projection.rows.pixel) is_linear[Index(pixel)] = true;
        std::vector<double> y(x.size());
        projection.Apply(x.data(), 1, y.data());
        int compared = 0;
        for (std::size_t i = 0; i < y.size(); ++i) {
          if (!is_linear[i] && !cubic.is_cubic[i]) continue;
          ++compared;
          EXPECT_NEAR(y[i], is_linear[i] ? linear.image[i] : cubic.image[i], tolerance)
              << weights.cols() << "x" << weights.rows() << " at " << i;
        }
        return compared;
      };
      const auto strict = Make<double>(map, weights, 1e-9, 2, interpolation);
      EXPECT_GT(compare(strict, 1e-6), 0.85 * static_cast<double>(x.size()));
      const auto usual = Make<double>(map, weights, 0.2, 2, interpolation);
      EXPECT_LE(usual.row_share(), strict.row_share());
      compare(usual, 0.1);
    }
  }
}

TEST(SceneProjection, FlatSurfacesNeedNoRowsButAtBordersAndEdges) {
  const Eigen::ArrayXXd weights = Weights(model::ApertureShape::kUniform, 5, 5);
  const DisparityMap map = MapOf(100, 80, [](int x, int) { return x < 50 ? 1.5 : -0.5; });
  const auto projection = Make<float>(map, weights);
  for (const std::int32_t pixel : projection.rows.pixel) {
    const int x = pixel % 100, y = pixel / 100;
    const bool at_border = x < 4 || x > 95 || y < 4 || y > 75;
    EXPECT_TRUE(at_border || std::abs(x - 49.5) < 9) << x << ", " << y;
  }
  const auto sharp = Make<float>(MapOf(100, 80, [](int, int) { return 0.0; }), weights);
  EXPECT_TRUE(sharp.rows.pixel.empty());
}

TEST(SceneProjection, KeepsAUniformImage) {
  const auto projection = Make<double>(Occluded(), Weights(model::ApertureShape::kDisc, 7, 7));
  const std::vector<double> ones(projection.pixels(), 1.0);
  std::vector<double> y(projection.pixels());
  projection.Apply(ones.data(), 1, y.data());
  for (const double value : y) ASSERT_NEAR(value, 1, 1e-12);
}

template <typename Real>
double AdjointError(const DisparityMap& map, const Eigen::ArrayXXd& weights) {
  const auto projection = Make<Real>(map, weights);
  const std::size_t size = 3 * projection.pixels();
  const std::vector<double> a = RandomImage(size, 5), b = RandomImage(size, 6);
  const std::vector<Real> x(a.begin(), a.end()), y(b.begin(), b.end());
  std::vector<Real> forward(size), back(size);
  projection.Apply(x.data(), 3, forward.data());
  projection.ApplyTransposed(y.data(), 3, back.data());
  double left = 0, right = 0;
  for (std::size_t i = 0; i < size; ++i) {
    left += static_cast<double>(forward[i]) * static_cast<double>(y[i]);
    right += static_cast<double>(x[i]) * static_cast<double>(back[i]);
  }
  return std::abs(left - right) / std::abs(left);
}

TEST(SceneProjection, PassesTheDotProductTest) {
  for (const auto shape : {model::ApertureShape::kUniform, model::ApertureShape::kDisc}) {
    const Eigen::ArrayXXd weights = Weights(shape, 5, 7);
    EXPECT_LT(AdjointError<double>(Occluded(), weights), 1e-14);
    EXPECT_LT(AdjointError<float>(Occluded(), weights), 1e-6);
  }
  // A sparse set of views is no sum of few products.
  std::mt19937 random(9);
  Eigen::ArrayXXd sparse = Eigen::ArrayXXd::Zero(7, 7);
  for (int n = 0; n < 12; ++n)
    sparse(static_cast<int>(random() % 7), static_cast<int>(random() % 7)) += 1;
  sparse /= sparse.sum();
  EXPECT_LT(AdjointError<double>(Occluded(), sparse), 1e-14);
}

TEST(SceneProjection, SameBitsOnAnyNumberOfThreads) {
  const Eigen::ArrayXXd weights = Weights(model::ApertureShape::kGaussian, 5, 5);
  const auto one = Make<float>(Occluded(), weights, 0.2, 1);
  const std::vector<double> image = RandomImage(one.pixels(), 7);
  const std::vector<float> x(image.begin(), image.end());
  std::vector<float> expected(x.size()), y(x.size());
  one.Apply(x.data(), 1, expected.data());
  std::vector<float> expected_back(x.size());
  one.ApplyTransposed(x.data(), 1, expected_back.data());
  for (const int threads : {2, 3, 5}) {
    const auto several = Make<float>(Occluded(), weights, 0.2, threads);
    several.Apply(x.data(), 1, y.data());
    EXPECT_EQ(y, expected);
    several.ApplyTransposed(x.data(), 1, y.data());
    EXPECT_EQ(y, expected_back);
  }
}

TEST(SceneProjection, SamplesHiddenFromTheCentreViewAreMarked) {
  const Eigen::ArrayXXd weights = Weights(model::ApertureShape::kUniform, 5, 1);
  const DisparityMap map = MapOf(60, 20, [](int x, int) { return x >= 20 && x < 40 ? 2 : 0; });
  const auto projection = Make<float>(map, weights);
  // Beside the near strip the background has disparity 0; views move the strip by 2 px a step.
  EXPECT_EQ(projection.occluded_fraction[Index(10 * 60 + 10)], 0);
  EXPECT_EQ(projection.occluded_fraction[Index(10 * 60 + 30)], 0);
  // x = 20 is uncovered by the two views in which the strip has gone right.
  EXPECT_NEAR(projection.occluded_fraction[Index(10 * 60 + 20)], 0.4, 1e-6);
}

// Half a pixel of an occluded sample may be in front of what is hidden, and half a pixel of a
// visible one may be behind.
TEST(SceneProjection, CountsWhatIsOccludedByTheShareOfItsPixel) {
  const Eigen::ArrayXXd weights = Weights(model::ApertureShape::kUniform, 3, 1);
  const DisparityMap map = MapOf(60, 20, [](int x, int) { return x >= 20 && x < 40 ? 2.75 : 0; });
  const auto projection = Make<float>(map, weights);
  // In the view where the strip moves 2.75 px to the right, it begins at 22.25, so that three
  // quarters of the sample at 22 are occluded background. The other two views show nothing hidden
  // there.
  const auto occluded = [&](int x) { return projection.occluded_fraction[Index(10 * 60 + x)]; };
  EXPECT_NEAR(occluded(20), 1.0 / 3, 1e-6);
  EXPECT_NEAR(occluded(21), 1.0 / 3, 1e-6);
  EXPECT_NEAR(occluded(22), 0.75 / 3, 1e-6);
  EXPECT_NEAR(occluded(23), 0, 1e-6);
  // On the other side by the other view: 39.5 - 2.75 = 36.75.
  EXPECT_NEAR(occluded(36), 0, 1e-6);
  EXPECT_NEAR(occluded(37), 0.75 / 3, 1e-6);
  EXPECT_NEAR(occluded(38), 1.0 / 3, 1e-6);
}

// A near object is photographed before a wall, each of one radiance. The near object's share of a
// pixel of the photograph is the mean over the views of the area that it covers.
TEST(SceneProjection, MixesSurfacesByTheAreaThatEachCovers) {
  const Eigen::ArrayXXd weights = Weights(model::ApertureShape::kUniform, 5, 3);
  constexpr double kNear = 1.3, kFar = -0.4;
  const auto is_near = [](int x, int y) { return x >= 20 && x < 33 && y >= 10 && y < 19; };
  const DisparityMap map =
      MapOf(60, 30, [&](int x, int y) { return is_near(x, y) ? kNear : kFar; });
  std::vector<double> radiance;
  for (int i = 0; i < 60 * 30; ++i) radiance.push_back(is_near(i % 60, i / 60) ? 0.9 : 0.2);
  std::vector<double> photograph(radiance.size());
  Make<double>(map, weights).Apply(radiance.data(), 1, photograph.data());
  const auto overlap = [](double at, double first, double last) {
    return std::max(0.0, std::min(at + 0.5, last + 0.5) - std::max(at - 0.5, first - 0.5));
  };
  for (int y = 5; y < 25; ++y) {
    for (int x = 10; x < 45; ++x) {
      double expected = 0;
      for (int l = -1; l <= 1; ++l) {
        for (int k = -2; k <= 2; ++k) {
          const double near = overlap(x + k * kNear, 20, 32) * overlap(y + l * kNear, 10, 18);
          expected += (0.2 + 0.7 * near) / 15;
        }
      }
      // A share below a hundredth is left out of a view.
      ASSERT_NEAR(photograph[Index(y * 60 + x)], expected, 0.01 * 0.7 / 15 + 1e-5)
          << x << ", " << y;
    }
  }
}

TEST(PhotographDisparity, IsWithoutTheLandingOfItsSamples) {
  DisparityMap on_grid = MapOf(3, 1, [](int x, int) { return 0.5 * x; }, {2, -1});
  const DisparityMap map = PhotographDisparity(on_grid, {0.8, -0.4});
  for (int i = 0; i < 3; ++i)
    EXPECT_FLOAT_EQ(map.disparity[Index(i)], 0.5F * static_cast<float>(i) - 0.4F);
  EXPECT_EQ(PhotographDisparity(on_grid, {0, 0}).disparity, on_grid.disparity);
  EXPECT_THAT(ErrorOf([&] {
                PhotographDisparity(on_grid, {0.8, 0.4});
              }),
              HasSubstr("ratio of these must be that of the steps"));
}

}  // namespace
}  // namespace thicklens::estimator
