// H on the grid against the sum over rays that its formula is, written down ray by ray.
#include "estimator/projection/grid_photograph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ostream>
#include <random>
#include <vector>

#include "thicklens/kernels/kernels.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// An image of width x height px from views of s x t samples, by (shift, fraction) of each column
// and row of them.
struct Landing {
  int shift;
  double fraction;
};
struct Case {
  int width, height, s_count, t_count;
  std::vector<Landing> columns, rows;
  bool has_irradiance = false;
};
std::ostream& operator<<(std::ostream& out, const Case& of) {
  return out << of.width << "x" << of.height << " px, views of " << of.s_count << "x" << of.t_count
             << (of.has_irradiance ? ", irradiance" : "");
}

// One of the views has no weight.
kernels::BlockGeometry GeometryOf(const Case& of) {
  kernels::BlockGeometry image;
  image.width_px = of.width;
  image.height_px = of.height;
  image.s_count = of.s_count;
  image.t_count = of.t_count;
  image.u_count = static_cast<int>(of.columns.size());
  image.v_count = static_cast<int>(of.rows.size());
  for (const Landing& column : of.columns) {
    image.s_shift.push_back(column.shift);
    image.s_fraction.push_back(column.fraction);
  }
  for (const Landing& row : of.rows) {
    image.t_shift.push_back(row.shift);
    image.t_fraction.push_back(row.fraction);
  }
  for (int view = 0; view < image.views(); ++view) {
    image.view_weight.push_back(view == 1 ? 0 : 0.2 + 0.05 * view);
  }
  return image;
}

const std::vector<Landing> kOnPixels{{0, 0}, {0, 0}, {0, 0}};
const std::vector<Landing> kToBothSides{{-1, 0.3}, {0, -0.35}, {0, 0}, {0, 0.35}, {1, -0.3}};
// Some land beside the image, the last ones all.
const std::vector<Landing> kFar{{-9, 0.49}, {-2, -0.5}, {3, 0}, {12, 0.2}, {400, -0.1}};

std::vector<Case> Cases() {
  std::vector<Case> cases;
  // The widths are around strips of 64 floats or 32 doubles and vectors of 8 or 4, with remainders
  // of both.
  for (const int width : {1, 2, 3, 7, 8, 9, 15, 31, 33, 63, 64, 65, 66, 71, 72, 127, 130, 200}) {
    for (const auto& columns : {kOnPixels, kToBothSides, kFar}) {
      cases.push_back({width, 5, width, 5, columns, kToBothSides});
    }
    cases.push_back({width, 4, width, 4, kToBothSides, kOnPixels, true});
  }
  // Several bands; views that are larger or smaller than the image.
  cases.push_back({70, 301, 70, 301, kToBothSides, kFar, true});
  cases.push_back({70, 40, 90, 33, kFar, kToBothSides, true});
  cases.push_back({90, 33, 70, 40, kToBothSides, kFar});
  return cases;
}

template <typename Number>
std::vector<Number> RandomNumbers(std::size_t count, double least, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(least, 1);
  std::vector<Number> numbers(count);
  for (Number& number : numbers) number = static_cast<Number>(uniform(engine));
  return numbers;
}

template <typename Real>
class GridPhotographTest : public ::testing::Test {
 protected:
  struct Problem {
    kernels::BlockGeometry image;
    std::vector<std::vector<float>> irradiance;
    std::vector<Real> rays, photograph;
  };
  static Problem ProblemOf(const Case& of) {
    Problem problem;
    problem.image = GeometryOf(of);
    const std::size_t view_size = Index(of.s_count) * Index(of.t_count);
    const std::size_t views = Index(problem.image.views());
    for (unsigned view = 0; of.has_irradiance && view < views; ++view) {
      // The irradiance of a view without weight is not computed.
      problem.irradiance.push_back(view == 1 ? std::vector<float>()
                                             : RandomNumbers<float>(view_size, 0.2, view));
    }
    problem.rays = RandomNumbers<Real>(views * view_size, -1, 99);
    problem.photograph = RandomNumbers<Real>(Index(problem.image.pixels()), -1, 98);
    return problem;
  }

  // Calls visit(ray, x, y, w g, E) for each ray that lands nearest to a pixel of the image and
  // each pixel (x, y) of it, for all of the image's within 1 px of where it lands.
  template <typename Visit>
  static void ForRays(const Problem& problem, const Visit& visit) {
    const kernels::BlockGeometry& image = problem.image;
    std::size_t ray = 0;
    for (int view = 0; view < image.views(); ++view) {
      const int k = view % image.u_count, l = view / image.u_count;
      for (int t = 0; t < image.t_count; ++t) {
        for (int s = 0; s < image.s_count; ++s, ++ray) {
          const int near_x = s + image.s_shift[Index(k)], near_y = t + image.t_shift[Index(l)];
          if (near_x < 0 || near_x >= image.width_px || near_y < 0 || near_y >= image.height_px) {
            continue;
          }
          const double landing_x = near_x + image.s_fraction[Index(k)];
          const double landing_y = near_y + image.t_fraction[Index(l)];
          const double irradiance =
              problem.irradiance.empty() || problem.irradiance[Index(view)].empty()
                  ? 1
                  : problem.irradiance[Index(view)][Index(t * image.s_count + s)];
          for (int y = std::max(0, near_y - 1); y < std::min(image.height_px, near_y + 2); ++y) {
            for (int x = std::max(0, near_x - 1); x < std::min(image.width_px, near_x + 2); ++x) {
              const double share = std::max(0.0, 1 - std::abs(landing_x - x)) *
                                   std::max(0.0, 1 - std::abs(landing_y - y));
              visit(ray, Index(y * image.width_px + x), image.view_weight[Index(view)] * share,
                    irradiance);
            }
          }
        }
      }
    }
  }

  static std::vector<double> SumsOfWeights(const Problem& problem) {
    std::vector<double> sums(problem.photograph.size());
    ForRays(problem,
            [&](std::size_t, std::size_t pixel, double weight, double) { sums[pixel] += weight; });
    return sums;
  }

  static constexpr double kAccuracy = sizeof(Real) == 8 ? 1e-13 : 2e-6;
};
using Precisions = ::testing::Types<float, double>;
TYPED_TEST_SUITE(GridPhotographTest, Precisions);

TYPED_TEST(GridPhotographTest, IsTheSumOverRays) {
  for (const Case& of : Cases()) {
    const auto problem = this->ProblemOf(of);
    const std::vector<double> weights = this->SumsOfWeights(problem);
    std::vector<double> expected(weights.size());
    this->ForRays(problem, [&](std::size_t ray, std::size_t pixel, double weight, double e) {
      expected[pixel] += e * weight * problem.rays[ray];
    });
    for (const int threads : {1, 3}) {
      const GridPhotograph<TypeParam> photograph(problem.image, problem.irradiance, threads);
      // Whatever was there before.
      std::vector<TypeParam> found(weights.size(), std::numeric_limits<TypeParam>::quiet_NaN());
      photograph.Apply(problem.rays.data(), found.data());
      for (std::size_t i = 0; i < found.size(); ++i) {
        ASSERT_NEAR(found[i], weights[i] > 0 ? expected[i] / weights[i] : 0, this->kAccuracy)
            << of << ", pixel " << i << ", " << threads << " threads";
      }
    }
  }
}

// Values that land outside the image stay the same to the last bit.
TYPED_TEST(GridPhotographTest, AddsToTheRaysOfEachPixel) {
  for (const Case& of : Cases()) {
    const auto problem = this->ProblemOf(of);
    const std::vector<double> weights = this->SumsOfWeights(problem);
    std::vector<double> expected(problem.rays.begin(), problem.rays.end());
    std::vector<bool> is_reached(expected.size());
    this->ForRays(problem, [&](std::size_t ray, std::size_t pixel, double weight, double e) {
      if (weight == 0) return;
      expected[ray] += e * weight / weights[pixel] * problem.photograph[pixel];
      is_reached[ray] = true;
    });
    for (const int threads : {1, 3}) {
      const GridPhotograph<TypeParam> photograph(problem.image, problem.irradiance, threads);
      std::vector<TypeParam> found = problem.rays;
      photograph.AddTransposed(problem.photograph.data(), found.data());
      for (std::size_t i = 0; i < found.size(); ++i) {
        ASSERT_NEAR(found[i], expected[i], is_reached[i] ? this->kAccuracy : 0)
            << of << ", ray " << i << ", " << threads << " threads";
      }
    }
  }
}

TYPED_TEST(GridPhotographTest, HasTheSameBitsForAnyNumberOfThreads) {
  std::vector<Case> cases = Cases();
  // Much enough for threads.
  cases.push_back({251, 300, 251, 300, kToBothSides, kToBothSides});
  for (const Case& of : cases) {
    const auto problem = this->ProblemOf(of);
    const auto both_ways = [&](int threads) {
      const GridPhotograph<TypeParam> photograph(problem.image, problem.irradiance, threads);
      std::vector<TypeParam> numbers(problem.photograph.size()), rays = problem.rays;
      photograph.Apply(problem.rays.data(), numbers.data());
      photograph.AddTransposed(problem.photograph.data(), rays.data());
      numbers.insert(numbers.end(), rays.begin(), rays.end());
      return numbers;
    };
    const std::vector<TypeParam> one = both_ways(1);
    for (const int threads : {2, 3}) EXPECT_EQ(both_ways(threads), one) << of << ", " << threads;
  }
}

TYPED_TEST(GridPhotographTest, PassesTheDotProductTest) {
  for (const Case& of : Cases()) {
    const auto problem = this->ProblemOf(of);
    const GridPhotograph<TypeParam> photograph(problem.image, problem.irradiance, 3);
    std::vector<TypeParam> forward(problem.photograph.size()), back(problem.rays.size());
    photograph.Apply(problem.rays.data(), forward.data());
    photograph.AddTransposed(problem.photograph.data(), back.data());
    double of_pixels = 0, of_rays = 0, size = 0;
    for (std::size_t i = 0; i < forward.size(); ++i) {
      of_pixels += static_cast<double>(forward[i]) * problem.photograph[i];
      size += std::abs(static_cast<double>(forward[i]) * problem.photograph[i]);
    }
    for (std::size_t i = 0; i < back.size(); ++i) {
      of_rays += static_cast<double>(back[i]) * problem.rays[i];
    }
    EXPECT_NEAR(of_pixels, of_rays, (sizeof(TypeParam) == 8 ? 1e-12 : 1e-5) * size) << of;
  }
}

}  // namespace
}  // namespace thicklens::estimator
