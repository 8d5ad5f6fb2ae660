// Depth where there is none: FillHoles against maps of which the truth is known.
#include "thicklens/estimator/fill_holes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

using Surface = std::function<double(int x, int y)>;
using Mask = std::function<bool(int x, int y)>;

struct Case {
  int width, height;
  Surface truth;
  Mask is_hole;
  Surface light = [](int, int) { return 0.2; };  // of the image

  std::size_t At(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
  DisparityMap Map() const {
    DisparityMap map{width, height, {}, {1, 1}};
    ForAll([&](int x, int y) {
      map.disparity.push_back(is_hole(x, y) ? kNan : static_cast<float>(truth(x, y)));
    });
    return map;
  }
  model::LinearImage Image() const {
    model::LinearImage image{width, height, 1, {}};
    ForAll([&](int x, int y) { image.values.push_back(static_cast<float>(light(x, y))); });
    return image;
  }
  DisparityMap Filled() const { return FillHoles(Map(), Image(), nullptr); }
  void ForAll(const std::function<void(int, int)>& visit) const {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) visit(x, y);
    }
  }
};

// --- One surface.

double Plane(int x, int y) { return 0.7 + 0.011 * x - 0.023 * y; }
bool IsInside(int x, int y, int x0, int y0, int x1, int y1) {
  return x >= x0 && x < x1 && y >= y0 && y < y1;
}

struct HoleCase {
  const char* name;
  Mask is_hole;
};
std::vector<HoleCase> HolesOfAPlane() {
  const auto speckle = [](int x, int y) { return (x * 7919 + y * 104729 + x * y * 31) % 10 < 3; };
  return {
      {"OnePixel", [](int x, int y) { return x == 20 && y == 17; }},
      {"Inside", [](int x, int y) { return IsInside(x, y, 10, 8, 45, 33); }},
      {"Disc", [](int x, int y) { return std::hypot(x - 30, y - 20) < 12; }},
      {"AtTheBorder", [](int x, int y) { return IsInside(x, y, 40, 5, 64, 30); }},
      {"Corner", [](int x, int y) { return IsInside(x, y, 0, 0, 20, 18); }},
      {"AllAround", [](int x, int y) { return !IsInside(x, y, 16, 12, 48, 36); }},
      {"HalfOfIt", [](int x, int) { return x >= 32; }},
      {"Speckle", speckle},
      {"Rows", [](int, int y) { return y % 2 == 1; }},
  };
}
class FillHolesOfAPlane : public ::testing::TestWithParam<HoleCase> {};

// 1/z of a plane is linear in the image, and so is its disparity.
TEST_P(FillHolesOfAPlane, GivesItBack) {
  const Case plane{64, 48, Plane, GetParam().is_hole};
  const DisparityMap full = plane.Filled();
  plane.ForAll([&](int x, int y) {
    EXPECT_NEAR(full.disparity[plane.At(x, y)], Plane(x, y), 2e-5) << x << ", " << y;
  });
}
INSTANTIATE_TEST_SUITE_P(Holes, FillHolesOfAPlane, ::testing::ValuesIn(HolesOfAPlane()),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST(FillHoles, LeavesWhatIsKnownAndCountsTheRest) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(-2, 2);
  std::bernoulli_distribution is_hole(0.4);
  const Case noise{31, 23, [&](int, int) { return uniform(engine); },
                   [&](int, int) { return is_hole(engine); }};
  const DisparityMap map = noise.Map();
  std::size_t filled = 0;
  const DisparityMap full = FillHoles(map, noise.Image(), &filled);
  std::size_t holes = 0;
  for (std::size_t i = 0; i < map.disparity.size(); ++i) {
    if (std::isnan(map.disparity[i])) {
      ++holes;
      EXPECT_TRUE(std::isfinite(full.disparity[i]));
      EXPECT_GE(full.disparity[i], -6);
      EXPECT_LE(full.disparity[i], 6);
    } else {
      EXPECT_EQ(full.disparity[i], map.disparity[i]);
    }
  }
  EXPECT_EQ(filled, holes);
  EXPECT_GT(holes, 200U);
}

// In a bowl, the difference from the plane is spread between the rims without a seam. The solution
// of the membrane equation is found by plain repeated averaging.
TEST(FillHoles, BendsTheSurfaceToItsRims) {
  const Case bowl{40, 40, [](int x, int y) { return 2e-4 * (x * x + x * y) + 0.01 * y; },
                  [](int x, int y) { return IsInside(x, y, 12, 10, 28, 30); }};
  std::vector<double> membrane(1600, 0.0);
  bowl.ForAll([&](int x, int y) { membrane[bowl.At(x, y)] = bowl.truth(x, y); });
  for (int round = 0; round < 3000; ++round) {
    std::vector<double> next = membrane;
    bowl.ForAll([&](int x, int y) {
      if (!bowl.is_hole(x, y)) return;
      next[bowl.At(x, y)] = (membrane[bowl.At(x - 1, y)] + membrane[bowl.At(x + 1, y)] +
                             membrane[bowl.At(x, y - 1)] + membrane[bowl.At(x, y + 1)]) /
                            4;
    });
    membrane = next;
  }
  const DisparityMap full = bowl.Filled();
  bowl.ForAll([&](int x, int y) {
    EXPECT_NEAR(full.disparity[bowl.At(x, y)], membrane[bowl.At(x, y)], 1e-4) << x << ", " << y;
  });
}

// Noise is neither a slope nor an edge: past the border it must not grow.
TEST(FillHoles, DoesNotMagnifyNoiseBeyondItsBorder) {
  std::mt19937 engine(11);
  std::normal_distribution<double> noise(0, 0.05);
  for (const double slope : {0.0, 0.004}) {
    const auto truth = [slope](int x, int) { return 0.5 + slope * x; };
    const Case wall{96, 64, [&](int x, int y) { return truth(x, y) + noise(engine); },
                    [](int x, int y) { return x < 24 || x >= 80 || y >= 44; }};
    const DisparityMap full = wall.Filled();
    double sum = 0;
    wall.ForAll([&](int x, int y) {
      const double error = full.disparity[wall.At(x, y)] - truth(x, y);
      EXPECT_LT(std::abs(error), 0.25) << x << ", " << y;
      if (wall.is_hole(x, y)) sum += error * error / (96 * 64 - 56 * 44);
    });
    EXPECT_LT(std::sqrt(sum), 0.05);
  }
}

// --- Two surfaces.

// Near on the left of an edge, far on the right; both slant. The sensor lost a strip around it.
constexpr int kEdge = 40;
double Near(int x, int y) { return 1.5 + 0.004 * x + 0.002 * y; }
double Far(int x, int y) { return -0.4 - 0.003 * x + 0.005 * y; }
double Step(int x, int y, int edge) { return x < edge ? Near(x, y) : Far(x, y); }

// Number of pixels that are on the wrong side, and of those on neither side.
struct Sides {
  int wrong = 0, between = 0;
};
Sides SidesOf(const Case& step, const DisparityMap& full, const Surface& expected) {
  Sides sides;
  step.ForAll([&](int x, int y) {
    const double found = full.disparity[step.At(x, y)];
    const double off_near = std::abs(found - Near(x, y));
    const double off_far = std::abs(found - Far(x, y));
    if (std::min(off_near, off_far) > 1e-3) ++sides.between;
    if (std::abs(found - expected(x, y)) > 1e-3) ++sides.wrong;
  });
  return sides;
}

TEST(FillHoles, FollowsTheEdgeOfTheImageBetweenTwoSurfaces) {
  for (const int half_width : {1, 4, 15}) {
    // The edge of the image wanders through the strip, and off its middle.
    const auto edge = [half_width](int y) {
      return kEdge + static_cast<int>(std::lround(0.6 * half_width * std::sin(0.2 * y)));
    };
    const Surface truth = [&](int x, int y) { return Step(x, y, edge(y)); };
    Case step{80, 60, truth, [&](int x, int) { return std::abs(x - kEdge) <= half_width; }};
    step.light = [&](int x, int y) { return x < edge(y) ? 0.2 : 0.3; };
    const Sides sides = SidesOf(step, step.Filled(), truth);
    EXPECT_EQ(sides.between, 0) << half_width;
    EXPECT_EQ(sides.wrong, 0) << half_width;
  }
}

TEST(FillHoles, FollowsABlurredEdgeOfANoisyImage) {
  std::mt19937 engine(5);
  std::normal_distribution<double> noise(0, 0.003);
  const Surface truth = [](int x, int y) { return Step(x, y, kEdge); };
  Case step{80, 60, truth, [](int x, int) { return std::abs(x - kEdge) <= 12; }};
  step.light = [&](int x, int) {
    return 0.3 + 0.15 * std::erf((x - kEdge + 0.5) / (1.5 * std::sqrt(2.0))) + noise(engine);
  };
  const Sides sides = SidesOf(step, step.Filled(), truth);
  EXPECT_EQ(sides.between, 0);
  EXPECT_LT(sides.wrong, 3 * 60);
}

// A sensor is blind beside near things, not on them.
TEST(FillHoles, TakesTheFarSurfaceWhereTheImageDeterminesNothing) {
  for (const int half_width : {1, 4, 15}) {
    Case step{80, 60, [](int x, int y) { return Step(x, y, kEdge); },
              [&](int x, int) { return std::abs(x - kEdge) <= half_width; }};
    const Sides sides =
        SidesOf(step, step.Filled(), [&](int x, int y) { return Step(x, y, kEdge - half_width); });
    EXPECT_EQ(sides.between, 0) << half_width;
    EXPECT_EQ(sides.wrong, 0) << half_width;
  }
}

// Speckle of the near surface that hangs together with the shadow beside it stays near.
TEST(FillHoles, KeepsSpeckleOnItsSurfaceBesideAShadow) {
  Case step{80, 60, [](int x, int y) { return Step(x, y, kEdge); },
            [](int x, int y) {
              return (x >= kEdge && x < kEdge + 20) || (x < kEdge && x >= 20 && y % 4 == 2);
            }};
  const Sides sides = SidesOf(step, step.Filled(), [](int x, int y) { return Step(x, y, kEdge); });
  EXPECT_EQ(sides.between, 0);
  EXPECT_EQ(sides.wrong, 0);
}

// The near surface lies between two parts of the far one, as the image shows. A single wrong
// value beside the hole is ignored.
TEST(FillHoles, KeepsAPoleAndIgnoresALoneValue) {
  const auto is_pole = [](int x) { return x >= 36 && x < 41; };
  const Surface truth = [&](int x, int y) { return is_pole(x) ? Near(x, y) : Far(x, y); };
  Case pole{80, 60, truth, [](int, int y) { return y >= 20 && y < 38; }};
  pole.light = [&](int x, int) { return is_pole(x) ? 0.5 : 0.2; };
  for (const float wrong : {9.0F, -9.0F}) {
    DisparityMap map = pole.Map();
    map.disparity[pole.At(60, 19)] = wrong;
    const Sides sides = SidesOf(pole, FillHoles(map, pole.Image(), nullptr), truth);
    EXPECT_EQ(sides.wrong, 1);  // the value itself
  }
}

// --- Hard cases.

TEST(FillHoles, SpreadsTheOnlyValueThereIs) {
  const Case one{70, 50, [](int, int) { return 0.75; },
                 [](int x, int y) { return x != 2 || y != 1; }};
  std::size_t filled = 0;
  for (const float value : FillHoles(one.Map(), one.Image(), &filled).disparity) {
    EXPECT_FLOAT_EQ(value, 0.75F);
  }
  EXPECT_EQ(filled, 3499U);
}

TEST(FillHoles, RefusesWhatItCannotFill) {
  const Case nothing{7, 5, [](int, int) { return 0.0; }, [](int, int) { return true; }};
  EXPECT_THAT(ErrorOf([&] { FillHoles(nothing.Map(), nothing.Image(), nullptr); }),
              AllOf(HasSubstr("35"), HasSubstr("holes")));
  const Case one{7, 5, Plane, [](int x, int y) { return x == y; }};
  model::LinearImage narrow = one.Image();
  narrow.width_px = 5;
  narrow.height_px = 7;
  EXPECT_THAT(ErrorOf([&] { FillHoles(one.Map(), narrow, nullptr); }),
              AllOf(HasSubstr("7x5"), HasSubstr("5x7")));
  DisparityMap map = one.Map();
  map.disparity.pop_back();
  EXPECT_THAT(ErrorOf([&] { FillHoles(map, one.Image(), nullptr); }), HasSubstr("34 values"));
}

// Jumps are those of px per view step, whatever the map's unit is.
TEST(FillHoles, DoesNotDependOnTheUnit) {
  Case step{80, 60, [](int x, int y) { return Step(x, y, kEdge); },
            [](int x, int) { return std::abs(x - kEdge) <= 6; }};
  const DisparityMap full = step.Filled();
  DisparityMap in_mm = step.Map();
  for (float& value : in_mm.disparity) value *= 64;
  in_mm.step = {1.0 / 64, -1.0 / 128};
  in_mm = FillHoles(in_mm, step.Image(), nullptr);
  for (std::size_t i = 0; i < full.disparity.size(); ++i) {
    EXPECT_NEAR(in_mm.disparity[i] / 64, full.disparity[i], 1e-5);
  }
}

// A wall that is one pixel wide separates two holes: the neighbours of one hole are not neighbours
// of the other.
TEST(FillHoles, AHoleBehindAThinWallIsNotReachedThroughIt) {
  const auto near_then_far = [](int x, int) { return x <= 10 ? 3.0 : 0.0; };
  Case c{24, 40, near_then_far,
         [](int x, int y) { return y >= 3 && y < 37 && x >= 5 && x < 16 && x != 10; }};
  // The edge of the wall is stronger than that at the far end of its hole, which is too high to be
  // decided by the known pixels above and below it.
  c.light = [](int x, int) { return x <= 10 ? 0.2 : x < 16 ? 0.6 : 0.5; };
  const DisparityMap full = c.Filled();
  c.ForAll([&](int x, int y) {
    EXPECT_NEAR(full.disparity[c.At(x, y)], near_then_far(x, y), 1e-5) << x << " " << y;
  });
}

// A floor to the horizon with the sky above it: its plane leads beyond infinity.
TEST(FillHoles, NothingIsBeyondInfinity) {
  constexpr double kAtInfinity = -0.3;
  const auto floor = [](int, int y) { return kAtInfinity + 0.02 * (y - 14); };
  const Case c{40, 40, floor, [](int, int y) { return y < 16; }};
  const DisparityMap full = FillHoles(c.Map(), c.Image(), nullptr, kAtInfinity);
  c.ForAll([&](int x, int y) {
    EXPECT_NEAR(full.disparity[c.At(x, y)], std::max(kAtInfinity, floor(x, y)), 0.02)
        << x << " " << y;
    EXPECT_GE(full.disparity[c.At(x, y)], static_cast<float>(kAtInfinity));
  });
  // If no disparity of infinity is given, the plane continues.
  EXPECT_LT(c.Filled().disparity[c.At(20, 0)], kAtInfinity - 0.1);
}

TEST(FillHoles, AnImageThatIsNotFiniteIsRefusedByItsPixel) {
  const Case c{8, 6, Plane, [](int x, int y) { return x == 3 && y == 3; }};
  model::LinearImage image = c.Image();
  image.values[c.At(5, 2)] = kNan;
  EXPECT_THAT(ErrorOf([&] { FillHoles(c.Map(), image, nullptr); }),
              AllOf(HasSubstr("pixel (5, 2) is nan"), HasSubstr("finite")));
}

}  // namespace
}  // namespace thicklens::estimator
