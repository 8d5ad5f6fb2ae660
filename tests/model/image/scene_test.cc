#include "thicklens/model/scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "support/matrix_lens.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {
namespace {

using ::thicklens::testing::MatrixLens;
using ::thicklens::testing::MatrixLenses;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

constexpr int kWidth = 9;
constexpr int kHeight = 7;
constexpr std::size_t kCount = std::size_t{kWidth} * kHeight;

std::size_t IndexOf(int x, int y) {
  return static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x);
}

// A coarse sensor with the axis off its centre, so that range and z differ much and every sign
// shows.
Camera CameraFor(const ThickLens& lens, double focus_depth_mm) {
  Camera camera = TestCameraFocusedAt(focus_depth_mm, "test-camera", lens,
                                      TestSensor(kWidth, kHeight, 0.9, {3.25, 4.5}));
  camera.calibration->blur_ratio.reset();
  return camera;
}

Camera BenchCamera(double focus_depth_mm = 640) {
  return CameraFor({12.5, 12.8, 3.0, 4.46}, focus_depth_mm);
}

LinearImage GreyImage(int width = kWidth, int height = kHeight) {
  return {
      width, height, 1,
      std::vector<float>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.5F)};
}

RawDepthMap MapOf(float value) { return {kWidth, kHeight, std::vector<float>(kCount, value)}; }

DepthConvention Convention(DepthKind kind, double unit_mm = 1) {
  DepthConvention convention;
  convention.kind = kind;
  convention.unit_mm = unit_mm;
  convention.aperture_step_mm = 0.7;
  return convention;
}

std::string MessageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

void ExpectSays(const std::string& message, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) {
    EXPECT_NE(message.find(part), std::string::npos) << part << " in: " << message;
  }
}

// The point at which the chief ray through a pixel meets depth z. The traced lens gives the landing
// of a chief ray from height 1 there, and a paraxial landing is proportional to the height.
Eigen::Vector2d ScenePointMm(const MatrixLens& oracle, const Camera& camera, int x, int y,
                             double depth_mm) {
  const double landing_of_one_mm = oracle.Landing(1, depth_mm, 0, camera.image_distance_mm());
  const Eigen::Vector2d landing_mm =
      (camera.sensor.principal_point_px - Eigen::Vector2d(x, y)) * camera.sensor.pixel_pitch_mm;
  return landing_mm / landing_of_one_mm;
}

TEST(MakeScene, RangeIsTheLengthOfTheChiefRay) {
  for (const MatrixLens& oracle : MatrixLenses()) {
    SCOPED_TRACE(oracle.name());
    const Camera camera = CameraFor(oracle.AsThickLens(4), 640);
    RawDepthMap map = MapOf(0);
    std::vector<double> depth_mm(kCount);
    double largest_ratio = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const std::size_t index = IndexOf(x, y);
        depth_mm[index] = 300 + 17 * x + 40 * y;
        const Eigen::Vector2d point_mm = ScenePointMm(oracle, camera, x, y, depth_mm[index]);
        const double range_mm =
            std::sqrt(point_mm.squaredNorm() + depth_mm[index] * depth_mm[index]);
        largest_ratio = std::max(largest_ratio, range_mm / depth_mm[index]);
        map.values[index] = static_cast<float>(range_mm / 1000);
      }
    }
    ASSERT_GT(largest_ratio, 1.02);
    const Scene scene =
        MakeScene(camera, GreyImage(), map, Convention(DepthKind::kRange, 1000), "range.pfm");
    for (std::size_t i = 0; i < kCount; ++i) {
      EXPECT_NEAR(scene.depth_mm[i], depth_mm[i], 1e-6 * depth_mm[i]);
    }
  }
}

TEST(MakeScene, DisparityIsTheShiftBetweenTracedViews) {
  for (const MatrixLens& oracle : MatrixLenses()) {
    SCOPED_TRACE(oracle.name());
    for (const double focus_mm : {640.0, std::numeric_limits<double>::infinity()}) {
      const Camera camera = CameraFor(oracle.AsThickLens(4), focus_mm);
      DepthConvention convention = Convention(DepthKind::kDisparity);
      convention.disparity_scale = -2.5;
      convention.disparity_offset_px = 0.125;
      RawDepthMap map = MapOf(0);
      std::vector<double> depth_mm(kCount);
      for (std::size_t i = 0; i < kCount; ++i) {
        depth_mm[i] = 150 + 60 * static_cast<double>(i);
        // Shift to the left, in px, as the view moves one step to the right.
        const double centre_mm = oracle.Landing(5, depth_mm[i], 0, camera.image_distance_mm());
        const double right_mm =
            oracle.Landing(5, depth_mm[i], convention.aperture_step_mm, camera.image_distance_mm());
        const double disparity_px = (right_mm - centre_mm) / camera.sensor.pixel_pitch_mm;
        map.values[i] = static_cast<float>((disparity_px - 0.125) / -2.5);
      }
      const Scene scene = MakeScene(camera, GreyImage(), map, convention, "disparity.pfm");
      // A float near 0.05 has steps of 4e-9, which is 1e-4 of the smallest disparity used.
      for (std::size_t i = 0; i < kCount; ++i) {
        EXPECT_NEAR(scene.depth_mm[i], depth_mm[i], 3e-4 * depth_mm[i]);
      }
    }
  }
}

TEST(MakeScene, DisparityZeroIsThePlaneOfFocusInFloatMapsAndAHoleInIntegerOnes) {
  const Camera camera = BenchCamera();
  RawDepthMap map = MapOf(0);
  map.values[5] = 0.002F;
  const DepthConvention convention = Convention(DepthKind::kDisparity);
  const Scene as_float = MakeScene(camera, GreyImage(), map, convention, "d.pfm");
  EXPECT_NEAR(as_float.depth_mm[0], 640, 1e-3);
  EXPECT_LT(as_float.depth_mm[5], 640);
  EXPECT_EQ(as_float.depth.holes, 0U);
  map.integer = true;
  const Scene as_integer = MakeScene(camera, GreyImage(), map, convention, "d.png");
  EXPECT_TRUE(std::isnan(as_integer.depth_mm[0]));
  EXPECT_EQ(as_integer.depth.valid, 1U);
  EXPECT_EQ(as_integer.depth_mm[5], as_float.depth_mm[5]);
}

TEST(MakeScene, DisparityAtOrBehindInfinityIsAHole) {
  // 1/zf + d p/(da K) = 0 at d = -da K/(p zf).
  const Camera camera = BenchCamera();
  const DepthConvention convention = Convention(DepthKind::kDisparity);
  const double scale_mm = DefocusScaleMm(camera.lens, camera.image_distance_mm());
  const double at_infinity_px = -convention.aperture_step_mm * scale_mm / (0.9 * 640);
  RawDepthMap map = MapOf(0);
  map.values[0] = static_cast<float>(at_infinity_px * 1.001);
  map.values[1] = -3;
  map.values[2] = static_cast<float>(at_infinity_px * 0.99);
  const Scene scene = MakeScene(camera, GreyImage(), map, convention, "d.pfm");
  EXPECT_TRUE(std::isnan(scene.depth_mm[0]));
  EXPECT_TRUE(std::isnan(scene.depth_mm[1]));
  EXPECT_NEAR(scene.depth_mm[2], 64000, 100);
  EXPECT_EQ(scene.depth.holes, 2U);
  // Focused at infinity, d = 0 is infinity itself.
  RawDepthMap near = MapOf(0.01F);
  near.values[0] = 0;
  const Scene far_focus = MakeScene(BenchCamera(std::numeric_limits<double>::infinity()),
                                    GreyImage(), near, convention, "d.pfm");
  EXPECT_TRUE(std::isnan(far_focus.depth_mm[0]));
  EXPECT_EQ(far_focus.depth.holes, 1U);
}

TEST(MakeScene, HolesOfZAndRangeAndTheStatistics) {
  for (const DepthKind kind : {DepthKind::kZ, DepthKind::kRange}) {
    for (const bool integer : {false, true}) {
      RawDepthMap map = MapOf(0);
      map.integer = integer;
      map.values[0] = kNan;
      map.values[1] = kInfinity;
      map.values[2] = -kInfinity;
      map.values[10] = 5000;
      map.values[20] = 2500;
      map.values[30] = 7500;
      const Scene scene = MakeScene(BenchCamera(), GreyImage(), map,
                                    Convention(kind, DepthUnitMm("tum5000")), "depth.png");
      EXPECT_EQ(scene.depth.valid, 3U);
      EXPECT_EQ(scene.depth.holes, kCount - 3);
      for (const std::size_t hole : {0, 1, 2, 3, 62}) {
        EXPECT_TRUE(std::isnan(scene.depth_mm[hole])) << hole;
      }
      if (kind == DepthKind::kZ) {
        EXPECT_EQ(scene.depth.min_mm, 500);
        EXPECT_EQ(scene.depth.median_mm, 1000);
        EXPECT_EQ(scene.depth.max_mm, 1500);
        EXPECT_EQ(scene.depth_mm[20], 500);
      }
    }
  }
}

// A point at 2 m has 0.5 dioptres.
TEST(MakeScene, InverseDepthIsLinearInDioptres) {
  Camera camera = BenchCamera();
  camera.calibration.reset();  // not needed
  DepthConvention convention = Convention(DepthKind::kInverse);
  convention.inverse_scale_dpt = 0.01;
  convention.inverse_offset_dpt = 0.5;
  RawDepthMap map = MapOf(0);
  map.values[1] = 50;
  map.values[2] = 150;
  map.values[3] = -50;   // at infinity
  map.values[4] = -100;  // beyond it
  const Scene scene = MakeScene(camera, GreyImage(), map, convention, "inverse.pfm");
  EXPECT_EQ(scene.depth_mm[0], 2000);
  EXPECT_EQ(scene.depth_mm[1], 1000);
  EXPECT_EQ(scene.depth_mm[2], 500);
  EXPECT_TRUE(std::isnan(scene.depth_mm[3]));
  EXPECT_TRUE(std::isnan(scene.depth_mm[4]));
  EXPECT_EQ(scene.depth.holes, 2U);
  map.integer = true;
  EXPECT_TRUE(
      std::isnan(MakeScene(camera, GreyImage(), map, convention, "inverse.png").depth_mm[0]));
}

TEST(InverseScale, IsLinearBetweenItsEnds) {
  const InverseScale scale = InverseScaleBetween(2500, 400, 255);
  EXPECT_NEAR(1000 / scale.offset_dpt, 2500, 1e-9);
  EXPECT_NEAR(1000 / (255 * scale.scale_dpt + scale.offset_dpt), 400, 1e-9);
  EXPECT_NEAR(127.5 * scale.scale_dpt + scale.offset_dpt, (0.4 + 2.5) / 2, 1e-12);
  EXPECT_EQ(InverseScaleBetween(kInfinity, 400, 1).offset_dpt, 0);
  EXPECT_LT(InverseScaleBetween(400, 2500, 255).scale_dpt, 0);
  EXPECT_THROW(InverseScaleBetween(400, 400, 255), Error);
  EXPECT_THROW(InverseScaleBetween(0, 400, 255), Error);
  EXPECT_THROW(InverseScaleBetween(2500, -400, 255), Error);
  EXPECT_THROW(InverseScaleBetween(2500, 400, 0), Error);
}

TEST(MakeScene, KeepsTheImage) {
  LinearImage image = GreyImage();
  image.values[17] = 0.25F;
  const Scene scene =
      MakeScene(BenchCamera(), image, MapOf(600), Convention(DepthKind::kZ), "z.pfm");
  EXPECT_EQ(scene.image.values, image.values);
  EXPECT_EQ(scene.image.at(8, 1, 0), 0.25F);
}

TEST(MakeScene, ZNeedsNoCalibration) {
  Camera camera = BenchCamera();
  camera.calibration.reset();
  EXPECT_NO_THROW(MakeScene(camera, GreyImage(), MapOf(600), Convention(DepthKind::kZ), "z.pfm"));
  EXPECT_THROW(MakeScene(camera, GreyImage(), MapOf(600), Convention(DepthKind::kRange), "z.pfm"),
               Error);
}

TEST(MakeScene, SizeMismatchNamesBothSizes) {
  const std::string message = MessageOf([] {
    MakeScene(BenchCamera(), GreyImage(8, 7), MapOf(600), Convention(DepthKind::kZ), "depth.png");
  });
  ExpectSays(message, {"depth.png", "9x7", "8x7"});
  RawDepthMap broken = MapOf(600);
  broken.values.pop_back();
  EXPECT_THROW(
      MakeScene(BenchCamera(), GreyImage(), broken, Convention(DepthKind::kZ), "depth.png"), Error);
}

TEST(MakeScene, NegativeDepthNamesThePixel) {
  for (const DepthKind kind : {DepthKind::kZ, DepthKind::kRange}) {
    RawDepthMap map = MapOf(600);
    map.values[IndexOf(4, 2)] = -3.5F;
    ExpectSays(MessageOf([&] {
                 MakeScene(BenchCamera(), GreyImage(), map, Convention(kind), "depth.pfm");
               }),
               {"depth.pfm", "(4, 2)", "-3.5"});
  }
}

TEST(MakeScene, AllHolesIsAnError) {
  for (const float value : {0.0F, kNan, kInfinity}) {
    ExpectSays(MessageOf([&] {
                 MakeScene(BenchCamera(), GreyImage(), MapOf(value), Convention(DepthKind::kZ),
                           "empty.png");
               }),
               {"empty.png", "holes"});
  }
}

TEST(MakeScene, WrongUnitStopsWithTheNumbers) {
  RawDepthMap millimetres = MapOf(600);
  millimetres.values[0] = 400;
  millimetres.values[1] = 1500;
  EXPECT_NO_THROW(MakeScene(BenchCamera(), GreyImage(), millimetres,
                            Convention(DepthKind::kZ, DepthUnitMm("mm")), "z.png"));
  // Millimetres taken for metres.
  ExpectSays(MessageOf([&] {
               MakeScene(BenchCamera(), GreyImage(), millimetres,
                         Convention(DepthKind::kZ, DepthUnitMm("m")), "z.png");
             }),
             {"z.png", "400000", "600000", "1.5e+06", "median", "mm", "unit"});
  RawDepthMap metres = MapOf(0.6F);
  metres.values[0] = 0.4F;
  metres.values[1] = 1.5F;
  EXPECT_NO_THROW(MakeScene(BenchCamera(), GreyImage(), metres,
                            Convention(DepthKind::kZ, DepthUnitMm("m")), "z.png"));
  // Metres taken for millimetres: nearer than the front focal point.
  ExpectSays(MessageOf([&] {
               MakeScene(BenchCamera(), GreyImage(), metres,
                         Convention(DepthKind::kZ, DepthUnitMm("mm")), "z.png");
             }),
             {"z.png", "0.4 to 1.5 mm", "median 0.6 mm", "front focal point at 12.5 mm"});
  // A room photographed with a phone's lens, where the wrong depths are beyond f1 = 4 mm.
  const Camera phone = CameraFor({4, 4, 0, 1}, 3000);
  ExpectSays(MessageOf([&] {
               MakeScene(phone, GreyImage(), MapOf(4.5F),
                         Convention(DepthKind::kZ, DepthUnitMm("mm")), "room.pfm");
             }),
             {"room.pfm", "4.5", "3000", "1000"});
}

TEST(MakeScene, FarAndNearScenesPass) {
  // A landscape with a foreground, by a camera focused on the bench; one without, focused far; a
  // macro scene by a camera focused at infinity.
  RawDepthMap landscape = MapOf(3e5F);
  landscape.values[7] = 5000;
  const DepthConvention z = Convention(DepthKind::kZ);
  EXPECT_NO_THROW(MakeScene(BenchCamera(), GreyImage(), landscape, z, "z.pfm"));
  EXPECT_NO_THROW(MakeScene(BenchCamera(5000), GreyImage(), MapOf(3e5F), z, "z.pfm"));
  const Camera at_infinity = BenchCamera(std::numeric_limits<double>::infinity());
  EXPECT_NO_THROW(MakeScene(at_infinity, GreyImage(), MapOf(100), z, "z.pfm"));
  EXPECT_NO_THROW(MakeScene(at_infinity, GreyImage(), MapOf(3e6F), z, "z.pfm"));
}

TEST(MakeScene, RefusesImpossibleConventions) {
  const auto expect_refusal = [](const std::string& named, const DepthConvention& convention) {
    ExpectSays(
        MessageOf([&] { MakeScene(BenchCamera(), GreyImage(), MapOf(1), convention, "map.pfm"); }),
        {"map.pfm", named});
  };
  expect_refusal("unit", Convention(DepthKind::kZ, 0));
  expect_refusal("unit", Convention(DepthKind::kRange, std::nan("")));
  DepthConvention disparity = Convention(DepthKind::kDisparity);
  disparity.aperture_step_mm = 0;
  expect_refusal("aperture_step_mm", disparity);
  disparity = Convention(DepthKind::kDisparity);
  disparity.disparity_scale = 0;
  expect_refusal("disparity_scale", disparity);
  disparity = Convention(DepthKind::kDisparity);
  disparity.disparity_offset_px = std::nan("");
  expect_refusal("disparity_offset_px", disparity);
  DepthConvention inverse = Convention(DepthKind::kInverse);
  inverse.inverse_scale_dpt = 0;
  expect_refusal("inverse_scale_dpt", inverse);
  inverse = Convention(DepthKind::kInverse);
  inverse.inverse_offset_dpt = std::nan("");
  expect_refusal("inverse_offset_dpt", inverse);
}

TEST(Depth, NamesAndUnits) {
  EXPECT_EQ(DepthKindFromName("z"), DepthKind::kZ);
  EXPECT_EQ(DepthKindFromName("range"), DepthKind::kRange);
  EXPECT_EQ(DepthKindFromName("disparity"), DepthKind::kDisparity);
  EXPECT_EQ(DepthKindFromName("inverse"), DepthKind::kInverse);
  ExpectSays(MessageOf([] { DepthKindFromName("depth"); }), {"depth", "z", "range", "disparity"});
  EXPECT_EQ(DepthUnitMm("mm"), 1);
  EXPECT_EQ(DepthUnitMm("cm"), 10);
  EXPECT_EQ(DepthUnitMm("m"), 1000);
  EXPECT_EQ(DepthUnitMm("tum5000") * 5000, 1000);
  ExpectSays(MessageOf([] { DepthUnitMm("inch"); }), {"inch", "mm", "cm", "m", "tum5000"});
}

TEST(Image, EveryEncodedValueSurvivesLinearLightAndBack) {
  for (const TransferCurve& curve :
       {TransferCurve::Srgb(), TransferCurve::Gamma(2.2), TransferCurve::Linear()}) {
    SCOPED_TRACE(curve.Name());
    for (const int bits : {8, 16}) {
      EncodedImage image{256, bits == 8 ? 1 : 256, 1, bits, {}};
      const int count = bits == 8 ? 256 : 65536;
      for (int value = 0; value < count; ++value) {
        image.values.push_back(static_cast<std::uint16_t>(value));
      }
      const LinearImage linear = ToLinear(image, curve);
      EXPECT_EQ(linear.values.front(), 0);
      EXPECT_EQ(linear.values.back(), 1);
      EXPECT_EQ(ToEncoded(linear, curve, bits).values, image.values);
    }
  }
}

TEST(Image, StoringClipsAndRounds) {
  const LinearImage image{6, 1, 1, {-0.2F, 1.7F, kNan, 0.5F / 255, 0.49F / 255, kInfinity}};
  const EncodedImage stored = ToEncoded(image, TransferCurve::Linear(), 8);
  EXPECT_EQ(stored.values, (std::vector<std::uint16_t>{0, 255, 0, 1, 0, 255}));
  EXPECT_EQ(stored.bits, 8);
  EXPECT_THROW(ToEncoded(image, TransferCurve::Linear(), 12), Error);
}

TEST(Image, RefusesWrongSizesAndValues) {
  EncodedImage image{2, 1, 1, 8, {3, 256}};
  EXPECT_THROW(ToLinear(image, TransferCurve::Srgb()), Error);
  image.values = {3};
  EXPECT_THROW(ToLinear(image, TransferCurve::Srgb()), Error);
  image.values = {3, 4};
  EXPECT_NO_THROW(ToLinear(image, TransferCurve::Srgb()));
  image.bits = 10;
  EXPECT_THROW(ToLinear(image, TransferCurve::Srgb()), Error);
}

TEST(Image, GreyIsTakenInLinearLight) {
  const EncodedImage stored{1, 1, 3, 8, {255, 128, 0}};
  const LinearImage grey = ToGrey(ToLinear(stored, TransferCurve::Srgb()));
  EXPECT_EQ(grey.channels, 1);
  EXPECT_EQ(grey.width_px, 1);
  ASSERT_EQ(grey.values.size(), 1U);
  EXPECT_NEAR(grey.values[0], 0.2126 + 0.7152 * 0.2158605, 1e-6);
}

TEST(DepthMap, FlipsReverseRowsColumnsOrBoth) {
  const std::vector<float> map = {1, 2, 3, 4, 5, 6};
  const auto flipped = [&map](const std::string& name) {
    std::vector<float> values = map;
    FlipDepth(DepthFlipFromName(name), 3, &values);
    return values;
  };
  EXPECT_EQ(flipped("none"), map);
  EXPECT_EQ(flipped("rows"), (std::vector<float>{4, 5, 6, 1, 2, 3}));
  EXPECT_EQ(flipped("columns"), (std::vector<float>{3, 2, 1, 6, 5, 4}));
  EXPECT_EQ(flipped("both"), (std::vector<float>{6, 5, 4, 3, 2, 1}));
  for (const char* first : {"none", "rows", "columns", "both"}) {
    for (const char* second : {"none", "rows", "columns", "both"}) {
      std::vector<float> values = flipped(first);
      FlipDepth(DepthFlipFromName(second), 3, &values);
      const DepthFlip both = Combined(DepthFlipFromName(first), DepthFlipFromName(second));
      EXPECT_EQ(values, flipped(DepthFlipName(both))) << first << " " << second;
    }
  }
  EXPECT_THROW(DepthFlipFromName("rot180"), Error);
  std::vector<float> partial(5);
  EXPECT_THROW(FlipDepth(DepthFlip::kRows, 3, &partial), Error);
}

TEST(Image, GreyDropsAlpha) {
  const LinearImage rgba{2, 1, 4, {0.1F, 0.2F, 0.3F, 0.9F, 0.4F, 0.5F, 0.6F, 0.0F}};
  const LinearImage rgb{2, 1, 3, {0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F}};
  EXPECT_EQ(ToGrey(rgba).values, ToGrey(rgb).values);
  const LinearImage grey{2, 1, 1, {0.1F, 0.7F}};
  EXPECT_EQ(ToGrey(grey).values, grey.values);
  const LinearImage two{1, 1, 2, {0.1F, 0.7F}};
  EXPECT_THROW(ToGrey(two), Error);
}

}  // namespace
}  // namespace thicklens::model
