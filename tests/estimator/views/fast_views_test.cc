// The renderer and the warper, which are made for speed, against plain references.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "estimator/views/surface_taps.h"
#include "support/error_message.h"
#include "tests/estimator/views/plain_views.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::estimator {
namespace {

using testing::PlainView;
using testing::PlainWarp;
using ::thicklens::testing::ErrorOf;

using Shape = std::function<double(int x, int y, double noise)>;

struct ReferenceCase {
  const char* name;
  int width, height;
  Eigen::Vector2d step;
  double noise;  // amplitude, unit of the map
  Shape disparity;
  std::vector<std::pair<double, double>> views;
};

DisparityMap MapOf(const ReferenceCase& reference) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> uniform(-reference.noise, reference.noise);
  DisparityMap map{reference.width, reference.height, {}, reference.step};
  for (int y = 0; y < reference.height; ++y) {
    for (int x = 0; x < reference.width; ++x) {
      map.disparity.push_back(static_cast<float>(reference.disparity(x, y, uniform(engine))));
    }
  }
  return map;
}

double Magnitude(const std::vector<float>& values) {
  double largest = 1;
  for (const float value : values) largest = std::max(largest, std::abs(double{value}));
  return largest;
}

void ExpectNear(const char* what, const std::vector<float>& found,
                const std::vector<float>& expected, int width, double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto row = static_cast<std::size_t>(width);
    ASSERT_NEAR(found[i], expected[i], tolerance) << what << " at " << i % row << ", " << i / row;
  }
}

// Warps with the reference implementation that devices are compared with.
std::vector<float> DeviceReferenceWarp(const model::LinearImage& image, const DisparityMap& map,
                                       const CompactView& view) {
  std::vector<float> values;
  kernels::NewReferenceWarp({image.width_px, image.height_px, image.channels, &image.values,
                             &map.disparity, static_cast<float>(SurfaceTolerance(map))})
      ->Warp({&view.disparity, view.shift.x(), view.shift.y(), &view.occluded, &view.boundary},
             &values);
  return values;
}

// The fraction of a sample that belongs to another surface, and its disparity. A fraction of 0
// means none.
kernels::BoundarySample BoundarySampleAt(const ViewDisparity& view, std::size_t i) {
  for (const kernels::BoundarySample& boundary : view.boundary) {
    if (static_cast<std::size_t>(boundary.index) == i) return boundary;
  }
  return {};
}

// Fractions just below the smallest one that counts are treated like those just above it, and so
// are two surfaces of the same fraction.
void ExpectBoundarySamplesAlike(const ViewDisparity& view, const ViewDisparity& plain,
                                double tolerance) {
  constexpr double kRounding = 2e-5, kMinShare = 0.01;
  int alike = 0;
  for (std::size_t i = 0; i < view.visibility.size(); ++i) {
    const kernels::BoundarySample found = BoundarySampleAt(view, i),
                                  expected = BoundarySampleAt(plain, i);
    if (found.share == 0 || expected.share == 0) {
      ASSERT_LT(found.share + expected.share, kMinShare + kRounding) << "sample " << i;
      continue;
    }
    ASSERT_NEAR(found.share, expected.share, kRounding) << "sample " << i;
    if (std::abs(found.other.disparity - expected.other.disparity) > tolerance) continue;
    ++alike;
    EXPECT_EQ(found.other.index == found.index, expected.other.index == expected.index);
    EXPECT_NEAR(found.other.source_x, expected.other.source_x, tolerance + 1e-5);
    EXPECT_NEAR(found.other.source_y, expected.other.source_y, tolerance + 1e-5);
  }
  EXPECT_GE(alike, 0.95 * static_cast<double>(plain.boundary.size()));
}

// Returns the sources as a list of all samples.
CompactView ListOf(const ViewDisparity& view) {
  CompactView list;
  list.width_px = view.width_px;
  list.height_px = view.height_px;
  list.disparity.assign(view.disparity.size(), std::nanf(""));
  for (std::size_t i = 0; i < view.disparity.size(); ++i) {
    list.occluded.push_back(
        {static_cast<std::int32_t>(i), view.source_x[i], view.source_y[i], view.disparity[i]});
  }
  return list;
}

double Waves(int x, int y, double noise) {
  return 0.7 * std::sin(x / 7.0) * std::cos(y / 9.0) - 0.3 + noise;
}

// Steps, a thin bar and a round thing before a wall.
double Things(int x, int y, double noise) {
  const double wall = -0.8 + 0.01 * x;
  const bool is_round = (x - 20) * (x - 20) + (y - 14) * (y - 14) < 70;
  const bool is_bar = x == 38 || y == 31;
  return (is_round ? 1.4 : is_bar ? 0.9 : wall + 0.25 * (y / 12)) + noise;
}

double Plane(int x, int y, double noise) { return -1.3 + 0.09 * x - 0.05 * y + noise; }

const std::vector<std::pair<double, double>>& AllKinds() {
  static const std::vector<std::pair<double, double>> views = {
      {1, 0}, {-2, 0}, {0, 1}, {0, -3}, {3, -3}, {2, 1}, {-0.5, 0.5}, {1.5, -2.5}, {-2.5, 0.5}};
  return views;
}

const std::vector<ReferenceCase>& ReferenceCases() {
  static const std::vector<ReferenceCase> cases = {
      {"Smooth", 53, 37, {1, 1}, 0, Waves, AllKinds()},
      {"SlightlyRough", 53, 37, {1, 1}, 0.05, Waves, AllKinds()},
      {"Rough", 37, 29, {1, 1}, 0.15, Waves, AllKinds()},
      {"Noise", 31, 33, {1, 1}, 1.5, Waves, AllKinds()},
      {"Things", 53, 41, {1, 1}, 0.001, Things, AllKinds()},
      {"RoughThings", 53, 41, {1, 1}, 0.08, Things, AllKinds()},
      {"StepsThatDiffer", 53, 41, {-0.4, 0.9}, 0.05, Things, AllKinds()},
      {"StepsInMm",
       41,
       39,
       {0.11, 0.07},
       0.4,
       [](int x, int y, double noise) { return 9 * Things(x, y, 0) + noise; },
       AllKinds()},
      {"StepsOfOneAxis", 41, 39, {0, 0.7}, 0.05, Things, AllKinds()},
      {"Slant", 47, 35, {1, 1}, 0, Plane, AllKinds()},
      {"TurnedOver", 41, 23, {1, 1}, 0.02, Plane, {{9, 0}, {14, 3}, {-13, 12}, {0, -17}}},
      {"Wound", 45, 33, {1, 1}, 0.04, Waves, {{7, 0}, {-9, 5}, {12, -12}, {0, 8}}},
      {"DrawnOut", 33, 27, {1, 1}, 0.09, Waves, {{-40, 12}, {90, 0}, {61, -57}}},
      {"DrawnOutFar",
       9,
       7,
       {1, 1},
       0.09,
       [](int, int, double noise) { return noise; },
       {{900, 0}, {-0.5, 800}, {600, -700}}},
      {"FarAway",
       43,
       31,
       {1, 1},
       0.05,
       [](int x, int y, double noise) { return 8 + Things(x, y, noise); },
       {{2, 1}, {-3, 3}}},
      {"AlmostAllOutside",
       43,
       31,
       {1, 1},
       0.05,
       [](int x, int y, double noise) { return 14.3 + Things(x, y, noise); },
       {{3, 0}, {2, -2}}},
      {"AllOutside",
       13,
       11,
       {1, 1},
       0.05,
       [](int x, int y, double noise) { return 1e7 + Things(x, y, noise); },
       {{3, 0}, {-2, 2}}},
      // Pixels, edges and diagonals of cells are exactly on samples.
      {"OnSamples", 24, 19, {1, 1}, 0, [](int, int, double) { return 1.0; }, AllKinds()},
      {"OnHalfSamples", 24, 19, {1, 1}, 0, [](int, int, double) { return -0.5; }, AllKinds()},
      {"OnEdges",
       40,
       21,
       {1, 1},
       0,
       [](int x, int y, double) { return (x + 2 * y) / 16.0; },
       AllKinds()},
      {"OneRow", 17, 1, {1, 1}, 0.4, Waves, AllKinds()},
      {"OneColumn", 1, 15, {1, 1}, 0.4, Waves, AllKinds()},
      {"OnePixel", 1, 1, {1, 1}, 0.4, Waves, AllKinds()},
      {"OneCell", 2, 2, {1, 1}, 0.09, Waves, AllKinds()},
      {"OneCellWithJump", 2, 2, {1, 1}, 1.5, Waves, AllKinds()},
      {"TwoRows", 19, 2, {1, 1}, 0.07, Waves, AllKinds()},
      {"TwoColumns", 2, 13, {1, 1}, 0.07, Waves, AllKinds()},
  };
  return cases;
}

class ReferenceComparisonTest : public ::testing::TestWithParam<ReferenceCase> {};

TEST_P(ReferenceComparisonTest, RendersWhatThePlainReferenceDoes) {
  const DisparityMap map = MapOf(GetParam());
  const DisparityRenderer renderer(map);
  for (const auto& [a, b] : GetParam().views) {
    SCOPED_TRACE(::testing::Message() << "view " << a << ", " << b);
    const ViewDisparity view = renderer.Render(a, b);
    const ViewDisparity plain = PlainView(map, a, b);
    const int width = map.width_px;
    for (std::size_t i = 0; i < view.visibility.size(); ++i) {
      ASSERT_EQ(view.visibility[i], plain.visibility[i])
          << i % static_cast<std::size_t>(width) << ", " << i / static_cast<std::size_t>(width);
    }
    // The positions are in float, so that they are rounded.
    const double rounding = 1e-6 * std::max(std::abs(a), std::abs(b));
    const double tolerance = Magnitude(map.disparity) * rounding;
    ExpectNear("disparity", view.disparity, plain.disparity, width, tolerance);
    const double px_per_unit = std::max(std::abs(a * map.step.x()), std::abs(b * map.step.y()));
    ExpectNear("x", view.source_x, plain.source_x, width, tolerance * px_per_unit + 1e-6);
    ExpectNear("y", view.source_y, plain.source_y, width, tolerance * px_per_unit + 1e-6);
    ExpectBoundarySamplesAlike(view, plain, tolerance);
  }
}

TEST_P(ReferenceComparisonTest, WarpsAsThePlainReferenceDoes) {
  const DisparityMap map = MapOf(GetParam());
  std::mt19937 engine(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const int channels : {1, 2, 3, 4, 5}) {
    model::LinearImage image{map.width_px, map.height_px, channels, {}};
    image.values.resize(map.disparity.size() * static_cast<std::size_t>(channels));
    for (float& value : image.values) value = uniform(engine);
    const ImageWarper warper(image, map);
    for (const auto& [a, b] : GetParam().views) {
      SCOPED_TRACE(::testing::Message() << "view " << a << ", " << b);
      const ViewDisparity view = PlainView(map, a, b);
      const model::LinearImage warped = warper.Warp(view);
      EXPECT_EQ(warped.channels, channels);
      model::LinearImage of_compact{1, 1, 1, {0}};  // of another size before
      const CompactView compact = DisparityRenderer(map).RenderCompact(a, b);
      warper.Warp(compact, &of_compact);
      EXPECT_EQ(of_compact.values, warper.Warp(RenderDisparity(map, a, b)).values);
      ExpectNear("value", warped.values, PlainWarp(image, map, view).values,
                 map.width_px * channels, 2e-6);
      ExpectNear("value of the device's reference", DeviceReferenceWarp(image, map, compact),
                 of_compact.values, map.width_px * channels, 1e-5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Maps, ReferenceComparisonTest, ::testing::ValuesIn(ReferenceCases()),
                         [](const auto& tested) { return tested.param.name; });

// Sources far beyond the image, on its rim, on pixels and a hair beside them.
TEST(ImageWarper, CutsSourcesAsThePlainReferenceDoes) {
  DisparityMap map{9, 7, std::vector<float>(63, 0), {1, 1}};
  model::LinearImage image{9, 7, 3, {}};
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < 189; ++i) image.values.push_back(uniform(engine));
  for (int i = 0; i < 63; i += 5) map.disparity[static_cast<std::size_t>(i)] = 0.5F;
  ViewDisparity view = RenderDisparity(map, 0, 0);
  const std::vector<float> sources = {0,     -0.0F,  1e-9F, -1e-6F, 0.25F, -0.75F, 3,     -3,
                                      8,     -8,     8.5F,  -8.5F,  1e4F,  -1e4F,  3e9F,  -3e9F,
                                      1e38F, -1e38F, 2.5F,  -2.5F,  6,     -6,     1e-3F, -1e-3F};
  for (std::size_t shift = 0; shift < sources.size(); ++shift) {
    for (std::size_t i = 0; i < 63; ++i) {
      view.source_x[i] = sources[(i + shift) % sources.size()];
      view.source_y[i] = sources[(5 * i + 7 * shift) % sources.size()];
    }
    ExpectNear("value", ImageWarper(image, map).Warp(view).values,
               PlainWarp(image, map, view).values, 27, 2e-6);
    ExpectNear("value of the device's reference", DeviceReferenceWarp(image, map, ListOf(view)),
               PlainWarp(image, map, view).values, 27, 1e-5);
  }
}

// The outermost pixels are off a sample by the last digit of a float.
TEST(DisparityRenderer, DoesNotLoseTheBorderToRounding) {
  for (const float disparity : {std::nextafter(1.0F, 2.0F), std::nextafter(3.0F, 2.0F)}) {
    const DisparityMap map{11, 9, std::vector<float>(99, disparity), {1, 1}};
    const DisparityRenderer renderer(map);
    for (const double sense : {1.0, -1.0}) {
      const ViewDisparity view = renderer.Render(sense, sense);
      const long moved = std::lround(disparity);
      EXPECT_EQ(std::count(view.visibility.begin(), view.visibility.end(), Visibility::kVisible),
                (11 - moved) * (9 - moved));
    }
    // A hundred times the tolerance is beside it.
    const DisparityMap beside{11, 9, std::vector<float>(99, disparity + 1e-3F), {1, 1}};
    const ViewDisparity view = RenderDisparity(beside, 1, 0);
    EXPECT_EQ(std::count(view.visibility.begin(), view.visibility.end(), Visibility::kVisible),
              (10 - std::lround(disparity)) * 9);
  }
}

TEST(DisparityRenderer, TakesAnyFiniteView) {
  DisparityMap map{9, 7, std::vector<float>(63, 0), {1, 1}};
  // A plane in focus does not move.
  EXPECT_EQ(DisparityRenderer(map).Render(1e300, -1e300).visibility,
            std::vector<Visibility>(63, Visibility::kVisible));
  map.disparity.assign(63, -1e-3F);
  const ViewDisparity view = DisparityRenderer(map).Render(1e300, 1e300);
  EXPECT_EQ(view.visibility, std::vector<Visibility>(63, Visibility::kOccluded));
  EXPECT_EQ(view.disparity, map.disparity);
}

TEST(DisparityRenderer, RefusesWhatRenderDisparityRefuses) {
  DisparityMap map{3, 2, std::vector<float>(6, 0), {1, 1}};
  const DisparityRenderer renderer(map);
  EXPECT_THAT(ErrorOf([&] { renderer.Render(0, std::nan("")); }), ::testing::HasSubstr("finite"));
  map.disparity[2] = std::nanf("");
  EXPECT_THAT(ErrorOf([&] { DisparityRenderer refused(map); }), ::testing::HasSubstr("holes"));
}

TEST(ImageWarper, RefusesWhatWarpImageRefuses) {
  const DisparityMap map{3, 2, std::vector<float>(6, 0), {1, 1}};
  const DisparityMap other{2, 2, std::vector<float>(4, 0), {1, 1}};
  const model::LinearImage image{3, 2, 1, std::vector<float>(6, 0)};
  const ImageWarper warper(image, map);
  EXPECT_THAT(ErrorOf([&] { warper.Warp(RenderDisparity(other, 0, 0)); }),
              ::testing::HasSubstr("2x2"));
  EXPECT_THAT(ErrorOf([&] { ImageWarper refused(image, other); }), ::testing::HasSubstr("3x2"));
  const model::LinearImage cut{3, 2, 1, std::vector<float>(5, 0)};
  EXPECT_THAT(ErrorOf([&] { ImageWarper refused(cut, map); }), ::testing::HasSubstr("5 values"));
}

}  // namespace
}  // namespace thicklens::estimator
