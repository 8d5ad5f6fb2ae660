// Depth maps of another camera, part or size than the photograph. The oracle of the registration is
// a ray tracer: both cameras look at the same sphere before the same plane.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/depth.h"
#include "thicklens/depth_fit.h"
#include "thicklens/image.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

model::LensDistortion Pinhole(int width_px, int height_px, double focal_px,
                              std::vector<double> coefficients = {0, 0, 0, 0}) {
  model::LensDistortion lens;
  lens.width_px = width_px;
  lens.height_px = height_px;
  lens.focal_length_px = {focal_px, focal_px};
  lens.principal_point_px = {(width_px - 1) / 2.0, (height_px - 1) / 2.0};
  lens.coefficients = std::move(coefficients);
  return lens;
}

// Ray and scene in the axes of the photograph's camera, mm. The depth along the axis of the camera
// whose rotation into these axes is `rotation`.
struct Traced {
  Eigen::Vector3d point;
  bool is_sphere = false;
};
const Eigen::Vector3d kSphere(40, -20, 900);
constexpr double kRadius = 170;
Traced Trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d to = origin - kSphere;
  const double a = direction.squaredNorm(), b = direction.dot(to);
  const double c = to.squaredNorm() - kRadius * kRadius;
  const double root = b * b - a * c;
  if (root > 0) return {origin + (-b - std::sqrt(root)) / a * direction, true};
  // The plane 0.2 x + z = 1600.
  const Eigen::Vector3d normal(0.2, 0, 1);
  return {origin + (1600 - normal.dot(origin)) / normal.dot(direction) * direction, false};
}

struct TwoCameras {
  DepthCamera camera;
  DepthMap depth;               // z, of the depth camera
  std::vector<double> truth;    // z, of the photograph's camera
  std::vector<bool> is_hidden;  // from the depth camera
  Image photo;
};
TwoCameras MakeTwoCameras(bool is_range) {
  constexpr int kPhotoWidth = 160, kPhotoHeight = 120;
  TwoCameras made;
  made.camera.photo_lens = Pinhole(kPhotoWidth, kPhotoHeight, 180);
  made.camera.depth_lens = Pinhole(96, 54, 75);
  made.camera.rotation = (Eigen::AngleAxisd(0.04, Eigen::Vector3d::UnitY()) *
                          Eigen::AngleAxisd(-0.02, Eigen::Vector3d(1, 0, 1).normalized()))
                             .toRotationMatrix();
  made.camera.translation_mm = {60, -8, 5};
  made.depth.width_px = 96;
  made.depth.height_px = 54;
  made.depth.meaning.kind = is_range ? DepthKind::kRange : DepthKind::kZ;
  made.depth.meaning.unit = LengthUnit::kMetre;
  made.depth.source = "kinect.png";
  const auto direction = [](const model::LensDistortion& lens, int x, int y) {
    return Eigen::Vector3d((x - lens.principal_point_px.x()) / lens.focal_length_px.x(),
                           (y - lens.principal_point_px.y()) / lens.focal_length_px.y(), 1);
  };
  for (int y = 0; y < 54; ++y) {
    for (int x = 0; x < 96; ++x) {
      const Eigen::Vector3d ray = direction(made.camera.depth_lens, x, y);
      const Traced hit = Trace(made.camera.translation_mm, made.camera.rotation * ray);
      const Eigen::Vector3d own =
          made.camera.rotation.transpose() * (hit.point - made.camera.translation_mm);
      made.depth.values.push_back(static_cast<float>((is_range ? own.norm() : own.z()) / 1000));
    }
  }
  std::vector<float> light;
  for (int y = 0; y < kPhotoHeight; ++y) {
    for (int x = 0; x < kPhotoWidth; ++x) {
      const Traced hit = Trace(Eigen::Vector3d::Zero(), direction(made.camera.photo_lens, x, y));
      made.truth.push_back(hit.point.z());
      const Traced seen = Trace(made.camera.translation_mm, hit.point - made.camera.translation_mm);
      made.is_hidden.push_back((seen.point - hit.point).norm() > 1);
      light.push_back(hit.is_sphere ? 0.6F : 0.2F);
    }
  }
  made.photo = Image::FromLight(kPhotoWidth, kPhotoHeight, ChannelOrder::kGrey, std::move(light),
                                TransferCurve::Srgb(), "photo.png");
  return made;
}

TEST(FitDepth, RegistersTheMapOfAnotherCamera) {
  for (const bool is_range : {false, true}) {
    const TwoCameras made = MakeTwoCameras(is_range);
    DepthFit fit;
    fit.camera = std::make_shared<const DepthCamera>(made.camera);
    std::string described;
    const DepthMap found = FitDepth(made.depth, made.photo, fit, &described);
    EXPECT_EQ(found.meaning.kind, DepthKind::kZ);
    EXPECT_EQ(found.meaning.unit, LengthUnit::kMillimetre);
    EXPECT_THAT(described, HasSubstr("registered from the camera"));
    std::vector<double> errors_mm;
    int seen = 0, wrong = 0, missing = 0, hidden = 0, filled = 0;
    for (std::size_t i = 0; i < found.values.size(); ++i) {
      const int x = static_cast<int>(i % 160), y = static_cast<int>(i / 160);
      if (x < 16 || y < 16 || x >= 144 || y >= 104) continue;
      const auto z = static_cast<double>(found.values[i]);
      if (made.is_hidden[i]) {
        ++hidden;
        // No value of the sphere is invented behind it.
        filled += z < 1200 ? 1 : 0;
        continue;
      }
      ++seen;
      // Between two surfaces one sample of the depth camera, 2.4 px, may be missing.
      missing += std::isnan(z) ? 1 : 0;
      if (std::isnan(z)) continue;
      // The surfaces are at least 400 mm apart.
      wrong += std::abs(z - made.truth[i]) > 100 ? 1 : 0;
      errors_mm.push_back(std::abs(z - made.truth[i]));
    }
    std::sort(errors_mm.begin(), errors_mm.end());
    EXPECT_LT(errors_mm[errors_mm.size() / 2], 0.5);
    EXPECT_LT(errors_mm[errors_mm.size() * 9 / 10], 10);
    EXPECT_GT(hidden, 200);
    EXPECT_LT(wrong, 0.01 * seen) << is_range;
    EXPECT_LT(missing, 0.06 * seen) << is_range;
    EXPECT_LT(filled, 0.25 * hidden) << is_range;
  }
}

TEST(FitDepth, ADisparityCannotBeRegistered) {
  TwoCameras made = MakeTwoCameras(false);
  made.depth.meaning = DepthMeaning{};
  made.depth.meaning.kind = DepthKind::kDisparity;
  DepthFit fit;
  fit.camera = std::make_shared<const DepthCamera>(made.camera);
  EXPECT_THAT(ErrorOf([&] { FitDepth(made.depth, made.photo, fit); }),
              HasSubstr("depths in z, range or inverse are expected"));
}

Image EvenPhoto(int width_px, int height_px) {
  return Image::FromLight(
      width_px, height_px, ChannelOrder::kGrey,
      std::vector<float>(static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px),
                         0.4F),
      TransferCurve::Srgb(), "photo.png");
}
DepthMap EvenDepth(int width_px, int height_px, float value_mm) {
  DepthMap depth;
  depth.width_px = width_px;
  depth.height_px = height_px;
  depth.values.assign(static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px),
                      value_mm);
  depth.meaning.kind = DepthKind::kZ;
  depth.meaning.unit = LengthUnit::kMillimetre;
  depth.source = "depth.png";
  return depth;
}

TEST(FitDepth, AnotherAspectIsRefusedWithWhatHelps) {
  EXPECT_THAT(ErrorOf([&] { FitDepth(EvenDepth(96, 54, 900), EvenPhoto(384, 288)); }),
              AllOf(HasSubstr("depth.png: it is 96x54 px, the image photo.png is 384x288 px"),
                    HasSubstr("aspect ratios, 1.778 and 1.333"), HasSubstr("depth_fit.part"),
                    HasSubstr("depth_fit.camera")));
  // Rounding to whole pixels is no other aspect: 384/7 = 54.9, 288/7 = 41.1.
  EXPECT_EQ(FitDepth(EvenDepth(55, 41, 900), EvenPhoto(384, 288)).width_px, 384);
}

TEST(FitDepth, AStatedPartGetsItsDepthAndTheRestNone) {
  DepthFit fit;
  fit.part = model::PixelRect{0, 24, 96, 54};
  std::string described;
  const DepthMap found = FitDepth(EvenDepth(48, 27, 900), EvenPhoto(96, 96), fit, &described);
  for (int y = 0; y < 96; ++y) {
    const float value = found.values[static_cast<std::size_t>(y * 96 + 40)];
    if (y >= 24 && y < 78) {
      EXPECT_FLOAT_EQ(value, 900) << y;
    } else {
      EXPECT_TRUE(std::isnan(value)) << y;
    }
  }
  EXPECT_THAT(described, HasSubstr("on the part 0,24,96,54"));
  fit.part = model::PixelRect{200, 0, 96, 54};
  EXPECT_THAT(ErrorOf([&] { FitDepth(EvenDepth(48, 27, 900), EvenPhoto(96, 96), fit); }),
              HasSubstr("no pixel of the photograph has a depth"));
}

TEST(FitDepth, LengthsAreInterpolatedAsInverses) {
  // A plane through which the inverse depth is linear in the pixel; the depth itself is not.
  DepthMap depth = EvenDepth(24, 24, 0);
  const auto inverse = [](double x) { return 1e-3 + 2e-5 * x; };
  for (int i = 0; i < 24 * 24; ++i)
    depth.values[static_cast<std::size_t>(i)] =
        static_cast<float>(1 / inverse((i % 24 + 0.5) * 4 - 0.5));
  const DepthMap found = FitDepth(depth, EvenPhoto(96, 96));
  for (int x = 4; x < 92; ++x)
    EXPECT_NEAR(
        static_cast<double>(found.values[static_cast<std::size_t>(40 * 96 + x)]) * inverse(x), 1,
        1e-5)
        << x;
}

TEST(FitDepth, LowConfidenceIsNoDepth) {
  DepthMap depth = EvenDepth(4, 1, 900);
  depth.confidence = {0, 0.3F, 0.6F, 1};
  DepthFit fit;
  fit.min_confidence = 0.5;
  const DepthMap found = FitDepth(depth, EvenPhoto(4, 1), fit);
  EXPECT_TRUE(std::isnan(found.values[0]));
  EXPECT_TRUE(std::isnan(found.values[1]));
  EXPECT_EQ(found.values[2], 900);
  EXPECT_EQ(found.values[3], 900);
  depth.confidence.assign(4, 0.2F);
  EXPECT_THAT(ErrorOf([&] { FitDepth(depth, EvenPhoto(4, 1), fit); }),
              HasSubstr("no value has a confidence"));
  depth.confidence.clear();
  EXPECT_THAT(ErrorOf([&] { FitDepth(depth, EvenPhoto(4, 1), fit); }),
              HasSubstr("has no confidence"));
}

std::string Pgm(const std::string& values, int width, int height) {
  return "P5\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n" + values;
}

TEST(ReadDepthConfidence, HasTheFullScaleOfItsTypeOrTheStatedOne) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "confidence.pgm";
  WriteFileAtomically(path, Pgm({'\0', '\x02', '\x01', '\x02'}, 2, 2));
  DepthMap depth = EvenDepth(2, 2, 900);
  ReadDepthConfidence(path, 2.0, &depth);
  EXPECT_EQ(depth.confidence, (std::vector<float>{0, 1, 0.5F, 1}));
  ReadDepthConfidence(path, std::nullopt, &depth);
  EXPECT_FLOAT_EQ(depth.confidence[1], 2 / 255.0F);
  depth.flip = model::DepthFlip::kRows;
  ReadDepthConfidence(path, 2.0, &depth);
  EXPECT_EQ(depth.confidence, (std::vector<float>{0.5F, 1, 0, 1}));
  EXPECT_THAT(ErrorOf([&] { ReadDepthConfidence(path, 1.0, &depth); }),
              HasSubstr("a confidence from 0 to 1 is expected, found 2"));
  DepthMap other = EvenDepth(3, 2, 900);
  EXPECT_THAT(ErrorOf([&] { ReadDepthConfidence(path, 2.0, &other); }),
              AllOf(HasSubstr("2x2 px"), HasSubstr("3x2 px: the sizes must be equal")));
}

constexpr char kCameraFile[] =
    "schema: thicklens/depth-camera/1\n"
    "depth: {width_px: 96, height_px: 54, focal_length_px: [75, 76], principal_point_px: [47, "
    "26],\n"
    "        coefficients: [0.1, -0.02, 0, 0]}\n"
    "photo: {width_px: 160, height_px: 120, focal_length_px: [180, 180], principal_point_px: [79, "
    "59]}\n"
    "rotation: [1, 0, 0, 0, 0, -1, 0, 1, 0]\n"
    "translation_mm: [25, 0, -3]\n";

TEST(ReadDepthCamera, ReadsWhatIsStatedAndRefusesWhatIsNoRotation) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "kinect.yaml";
  std::string text = kCameraFile;
  WriteFileAtomically(path, text);
  const DepthCamera camera = ReadDepthCamera(path);
  EXPECT_EQ(camera.depth_lens.focal_length_px, Eigen::Vector2d(75, 76));
  EXPECT_EQ(camera.depth_lens.coefficients, (std::vector<double>{0.1, -0.02, 0, 0}));
  EXPECT_EQ(camera.photo_lens.width_px, 160);
  EXPECT_EQ(camera.rotation * Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -1, 0));
  EXPECT_EQ(camera.translation_mm, Eigen::Vector3d(25, 0, -3));
  text.replace(text.find("0, -1, 0, 1, 0]"), 15, "0, 1, 0, 1, 0]");
  WriteFileAtomically(path, text);
  EXPECT_THAT(ErrorOf([&] { ReadDepthCamera(path); }),
              AllOf(HasSubstr("kinect.yaml:1"), HasSubstr("a rotation is expected")));
}

}  // namespace
}  // namespace thicklens
