// The order that the shifts between views show, for scenes whose order is known.
#include "tools/io/lightfields/view_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/io/light_field_io.h"
#include "thicklens/model/transfer_curve.h"
#include "tools/io/lightfields/view_grid.h"

namespace thicklens::io {

void PrintTo(ViewOrder order, std::ostream* stream) {
  constexpr std::array<const char*, 6> kNames = {"undecided", "as stated",        "swapped",
                                                 "mirrored",  "swapped mirrored", "irregular"};
  *stream << kNames[static_cast<std::size_t>(order)];
}

namespace {

using ::testing::AnyOf;

constexpr int kOrderS = 120, kOrderT = 90;

// The encoded value of a scene, 0 to 1, at a place of a plane, px.
using OrderTexture = std::function<double(double x, double y)>;

double HashOf(int x, int y, int seed) {
  auto bits = static_cast<std::uint32_t>(x * 73856093 ^ y * 19349663 ^ seed * 83492791);
  bits = (bits ^ bits >> 15U) * 2246822519U;
  bits = (bits ^ bits >> 13U) * 3266489917U;
  return (bits >> 8U) / static_cast<double>(1U << 24U);
}

// Random values on a lattice, with smooth values between them.
double LatticeNoise(double x, double y, double pitch, int seed) {
  const double at_x = x / pitch, at_y = y / pitch;
  const int x0 = static_cast<int>(std::floor(at_x)), y0 = static_cast<int>(std::floor(at_y));
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double fx = smooth(at_x - x0), fy = smooth(at_y - y0);
  return (1 - fy) * ((1 - fx) * HashOf(x0, y0, seed) + fx * HashOf(x0 + 1, y0, seed)) +
         fy * ((1 - fx) * HashOf(x0, y0 + 1, seed) + fx * HashOf(x0 + 1, y0 + 1, seed));
}
double RichTexture(double x, double y) {
  return 0.2 + 0.35 * LatticeNoise(x, y, 5, 1) + 0.35 * LatticeNoise(x, y, 13, 2);
}

struct OrderScene {
  OrderTexture texture = RichTexture;
  // Disparities of the left, the middle and the right third, px per view.
  std::array<double, 3> disparities = {1, 1, 1};
  double noise = 0;      // standard deviation of the encoded values
  int jpeg_quality = 0;  // 0: the views are not compressed
};

// The view `a` steps to the right and `b` steps down: what the middle view has at x is at x - a d.
std::vector<float> OrderView(const OrderScene& scene, double a, double b, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  cv::Mat levels(kOrderT, kOrderS, CV_8U);
  std::vector<float> light;
  const model::TransferCurve curve = model::TransferCurve::Srgb();
  for (int y = 0; y < kOrderT; ++y) {
    for (int x = 0; x < kOrderS; ++x) {
      const double d = scene.disparities[static_cast<std::size_t>(3 * x / kOrderS)];
      const double value =
          std::clamp(scene.texture(x + a * d, y + b * d) + scene.noise * normal(random), 0.0, 1.0);
      levels.at<unsigned char>(y, x) = cv::saturate_cast<unsigned char>(255 * value);
      light.push_back(static_cast<float>(curve.Decode(value)));
    }
  }
  if (scene.jpeg_quality == 0) return light;
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", levels, bytes, {cv::IMWRITE_JPEG_QUALITY, scene.jpeg_quality});
  levels = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  for (std::size_t i = 0; i < light.size(); ++i)
    light[i] = static_cast<float>(curve.Decode(levels.data[i] / 255.0));
  return light;
}

// Where the view that is stored in column k, row l was taken, views to the right and down.
using OrderPlace = std::function<std::array<int, 2>(int k, int l)>;

model::LightField OrderedLightField(const OrderScene& scene, int u_count, int v_count,
                                    const OrderPlace& place) {
  model::LightField light_field = FullFrame(u_count, v_count);
  light_field.s_count = kOrderS;
  light_field.t_count = kOrderT;
  light_field.channels = 1;
  light_field.values.resize(light_field.ViewStart(1, 0, 0));
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k < u_count; ++k) {
      const auto [a, b] = place(k, l);
      const std::vector<float> view =
          OrderView(scene, a, b, static_cast<unsigned>(1000 + 100 * l + k));
      std::copy(
          view.begin(), view.end(),
          light_field.values.begin() + static_cast<std::ptrdiff_t>(light_field.ViewStart(0, k, l)));
    }
  }
  return light_field;
}

struct KnownOrder {
  const char* name;
  ViewOrder order;
  OrderPlace place;
};
const std::vector<KnownOrder>& KnownOrders() {
  static const std::vector<KnownOrder> orders = {
      {"in order", ViewOrder::kAsStated,
       [](int k, int l) {
         return std::array<int, 2>{k, l};
       }},
      // This is also the order of a scene with the opposite depths.
      {"both backwards", ViewOrder::kAsStated,
       [](int k, int l) {
         return std::array<int, 2>{-k, -l};
       }},
      {"exchanged", ViewOrder::kSwapped,
       [](int k, int l) {
         return std::array<int, 2>{l, k};
       }},
      {"columns backwards", ViewOrder::kMirrored,
       [](int k, int l) {
         return std::array<int, 2>{-k, l};
       }},
      {"rows backwards", ViewOrder::kMirrored,
       [](int k, int l) {
         return std::array<int, 2>{k, -l};
       }},
      {"exchanged, columns backwards", ViewOrder::kSwappedMirrored, [](int k, int l) {
         return std::array<int, 2>{-l, k};
       }}};
  return orders;
}

void ExpectEveryOrder(const OrderScene& scene, int u_count = 3, int v_count = 3) {
  for (const KnownOrder& known : KnownOrders()) {
    const ViewOrderFinding finding =
        FindViewOrder(OrderedLightField(scene, u_count, v_count, known.place));
    EXPECT_EQ(finding.order, known.order) << known.name << ": " << finding.why;
    EXPECT_EQ(finding.step_ratio, 1) << known.name;
  }
}
// The order may not show, but no other order may be found.
void ExpectNoFalseOrder(const OrderScene& scene, int u_count = 3, int v_count = 3) {
  for (const KnownOrder& known : KnownOrders()) {
    const ViewOrderFinding finding =
        FindViewOrder(OrderedLightField(scene, u_count, v_count, known.place));
    EXPECT_THAT(finding.order, AnyOf(known.order, ViewOrder::kUndecided)) << known.name;
  }
}

TEST(ViewOrderOfShifts, PlanesOfEveryDisparity) {
  for (const double disparity : {-3.0, -1.0, -0.3, 0.3, 1.0, 2.0, 3.0}) {
    SCOPED_TRACE(disparity);
    ExpectEveryOrder({RichTexture, {disparity, disparity, disparity}});
  }
}

TEST(ViewOrderOfShifts, DisparitiesOfBothSigns) {
  ExpectEveryOrder({RichTexture, {1.5, 0.2, -0.8}});
  ExpectEveryOrder({RichTexture, {-2, 0, 2}});
}

TEST(ViewOrderOfShifts, NoiseAndJpeg) {
  ExpectEveryOrder({RichTexture, {1, 0.5, -1}, 0.03});
  for (const int quality : {95, 75, 50}) {
    SCOPED_TRACE(quality);
    ExpectEveryOrder({RichTexture, {1, 0.6, -1}, 0.01, quality});
  }
}

TEST(ViewOrderOfShifts, LittleTextureIsNoReasonForAnAlarm) {
  const OrderTexture faint = [](double x, double y) { return 0.4 + 0.03 * RichTexture(x, y); };
  for (const double noise : {0.0, 0.005, 0.02, 0.1}) {
    SCOPED_TRACE(noise);
    ExpectNoFalseOrder({faint, {1, 1, 1}, noise});
    ExpectNoFalseOrder({faint, {1, 0.5, -1}, noise, 75});
    ExpectNoFalseOrder({[](double, double) { return 0.5; }, {1, 1, 1}, noise});
  }
}

TEST(ViewOrderOfShifts, NoiseAloneIsUndecided) {
  for (const int quality : {0, 75}) {
    const OrderScene scene{[](double, double) { return 0.5; }, {1, 1, 1}, 0.05, quality};
    const ViewOrderFinding finding =
        FindViewOrder(OrderedLightField(scene, 3, 3, KnownOrders()[0].place));
    EXPECT_EQ(finding.order, ViewOrder::kUndecided);
    EXPECT_NE(finding.why, "");
  }
}

TEST(ViewOrderOfShifts, RepeatedPatterns) {
  const auto wave = [](double x, double period) {
    return std::sin(2 * 3.14159265358979 * x / period);
  };
  for (const double disparity : {0.7, 2.0, 3.0}) {
    SCOPED_TRACE(disparity);
    const std::array<double, 3> all = {disparity, disparity, disparity};
    ExpectNoFalseOrder({[&](double x, double) { return 0.5 + 0.3 * wave(x, 6); }, all});
    ExpectNoFalseOrder({[&](double, double y) { return 0.5 + 0.3 * wave(y, 9); }, all, 0.01});
    ExpectNoFalseOrder(
        {[&](double x, double y) { return 0.5 + 0.3 * wave(x, 8) * wave(y, 8); }, all, 0.01, 75});
    // Diagonal stripes shift alike across and down.
    ExpectNoFalseOrder({[&](double x, double y) { return 0.5 + 0.3 * wave(x + y, 11); }, all});
  }
}

TEST(ViewOrderOfShifts, TwoByTwoViews) {
  ExpectEveryOrder({RichTexture, {1, 0.5, -1}, 0.01}, 2, 2);
}

TEST(ViewOrderOfShifts, ARowOrAColumnShowsItsAxisOnly) {
  const OrderScene scene{RichTexture, {1, 0.5, -1}, 0.01};
  for (const KnownOrder& known : KnownOrders()) {
    const bool is_exchanged =
        known.order == ViewOrder::kSwapped || known.order == ViewOrder::kSwappedMirrored;
    for (const auto& [u_count, v_count] : {std::array<int, 2>{5, 1}, std::array<int, 2>{1, 5}}) {
      const ViewOrder order =
          FindViewOrder(OrderedLightField(scene, u_count, v_count, known.place)).order;
      if (is_exchanged) {
        EXPECT_THAT(order, AnyOf(ViewOrder::kSwapped, ViewOrder::kSwappedMirrored)) << known.name;
      } else {
        EXPECT_EQ(order, ViewOrder::kAsStated) << known.name;
      }
    }
  }
}

TEST(ViewOrderOfShifts, ShuffledViewsAreNotInAnyOrder) {
  const ViewOrderFinding finding =
      FindViewOrder(OrderedLightField({RichTexture, {1, 0.5, -1}}, 4, 4, [](int k, int l) {
        const int shuffled = (7 * (4 * l + k) + 5) % 16;
        return std::array<int, 2>{shuffled % 4, shuffled / 4};
      }));
  EXPECT_THAT(finding.order, AnyOf(ViewOrder::kIrregular, ViewOrder::kUndecided));
}

// The views in the middle are in order, others are not.
TEST(ViewOrderOfShifts, AnOrderThatOnlySomeViewsHaveIsUndecided) {
  const std::vector<std::pair<const char*, OrderPlace>> orders = {
      {"the first row backwards",
       [](int k, int l) {
         return std::array<int, 2>{l == 0 ? 4 - k : k, l};
       }},
      {"the last row backwards",
       [](int k, int l) {
         return std::array<int, 2>{l == 4 ? 4 - k : k, l};
       }},
      {"two rows exchanged",
       [](int k, int l) {
         return std::array<int, 2>{k, l == 0 ? 1 : l == 1 ? 0 : l};
       }},
      {"two columns exchanged", [](int k, int l) {
         return std::array<int, 2>{k == 0 ? 4 : k == 4 ? 0 : k, l};
       }}};
  for (const OrderScene& scene :
       {OrderScene{RichTexture, {1, 0.5, -1}, 0.01}, OrderScene{RichTexture, {0.4, 0.4, 0.4}}}) {
    for (const auto& [name, place] : orders) {
      const ViewOrderFinding finding = FindViewOrder(OrderedLightField(scene, 5, 5, place));
      EXPECT_THAT(finding.order, AnyOf(ViewOrder::kUndecided, ViewOrder::kIrregular)) << name;
      EXPECT_TRUE(finding.order == ViewOrder::kIrregular || finding.why != "") << name;
    }
  }
}

TEST(ViewOrderOfShifts, FiveByFiveViewsOfEveryOrder) {
  ExpectEveryOrder({RichTexture, {1, 0.5, -1}, 0.02}, 5, 5);
  ExpectEveryOrder({RichTexture, {0.3, 0.4, -0.3}, 0.01}, 5, 5);
}

// A quilt whose rows of tiles are read from the top: within a row the views are in order.
TEST(ViewOrderOfShifts, JumpsWithinOneRowAreUndecided) {
  const ViewOrderFinding finding =
      FindViewOrder(OrderedLightField({RichTexture, {1, 0.5, -1}, 0.01}, 12, 1, [](int k, int l) {
        return std::array<int, 2>{4 * (2 - k / 4) + k % 4, l};
      }));
  EXPECT_THAT(finding.order, AnyOf(ViewOrder::kUndecided, ViewOrder::kIrregular));
}

TEST(ViewOrderOfShifts, DisparitiesAreThoseOfTheScene) {
  const ViewOrderFinding finding = FindViewOrder(
      OrderedLightField({RichTexture, {0.5, 0.5, 0.5}}, 3, 3, KnownOrders()[0].place));
  EXPECT_NEAR(finding.least_px, 0.5, 0.1);
  EXPECT_NEAR(finding.most_px, 0.5, 0.1);
  EXPECT_FALSE(finding.is_line);
}

TEST(ViewOrderOfShifts, AnotherStepDownIsFound) {
  const ViewOrderFinding finding =
      FindViewOrder(OrderedLightField({RichTexture, {1, 0.6, -1}}, 3, 3, [](int k, int l) {
        return std::array<int, 2>{k, 2 * l};
      }));
  EXPECT_EQ(finding.order, ViewOrder::kAsStated);
  EXPECT_EQ(finding.step_ratio, 2);
}

// Rendered scenes of the 4D Light Field Benchmark, the inner views of 9 x 9.
TEST(ViewOrderOfShifts, ScenesOfTheBenchmark) {
  for (const char* name : {"lf_antinous", "lf_backgammon"}) {
    const std::string folder = std::string(THICKLENS_SHARED_DATA_DIR) + "/" + name;
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "there is no " << folder;
    for (int change = 0; change < 4; ++change) {
      LightFieldReading reading;
      reading.grid = 9;
      reading.sparse = true;
      reading.layout = "hci";
      reading.swap_uv = change == 1 || change == 3;
      reading.mirror_u = change >= 2;
      const ViewOrder order = FindViewOrder(ReadLightField(folder, reading)).order;
      constexpr std::array<ViewOrder, 4> kRight = {ViewOrder::kAsStated, ViewOrder::kSwapped,
                                                   ViewOrder::kMirrored,
                                                   ViewOrder::kSwappedMirrored};
      EXPECT_EQ(order, kRight[static_cast<std::size_t>(change)]) << name;
    }
  }
}

}  // namespace
}  // namespace thicklens::io
