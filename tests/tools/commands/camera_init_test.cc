#include "tools/commands/camera_init.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

CameraDescription DataSheet() {
  CameraDescription camera;
  camera.front_focal_length_mm = 12.5;
  camera.rear_focal_length_mm = 12.8;
  camera.lens_thickness_mm = -1;
  camera.f_number = 1.4;
  camera.pixel_pitch_um = 6;
  camera.size_px = Eigen::Vector2i(640, 480);
  camera.principal_point_px = Eigen::Vector2d(320, 240);
  camera.transfer = "srgb";
  return camera;
}

// A photograph of 32 x 24 px with the EXIF data that a test needs.
std::string WritePhoto(const std::string& name, const Exiv2::ExifData& exif) {
  const std::string path = ::testing::TempDir() + "/" + name;
  model::EncodedImage image{32, 24, 1, 8, {}};
  image.values.assign(32 * 24, 128);
  WriteFileAtomically(path, io::EncodePng(image));
  const auto file = Exiv2::ImageFactory::open(path);
  file->setExifData(exif);
  file->writeMetadata();
  return path;
}

Exiv2::ExifData TypicalExif() {
  Exiv2::ExifData exif;
  exif["Exif.Photo.FocalLength"] = Exiv2::Rational(250, 10);
  exif["Exif.Photo.FNumber"] = Exiv2::Rational(28, 10);
  exif["Exif.Photo.FocalPlaneXResolution"] = Exiv2::Rational(2000, 1);
  exif["Exif.Photo.FocalPlaneYResolution"] = Exiv2::Rational(2000, 1);
  exif["Exif.Photo.FocalPlaneResolutionUnit"] = std::uint16_t{3};  // per cm: 5 um
  exif["Exif.Image.Model"] = "Bench 1";
  return exif;
}

std::string MessageOf(const CameraDescription& description,
                      const std::optional<io::PhotoExif>& photo) {
  try {
    DescribedCamera(description, photo, std::nullopt);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(DescribedCamera, TakesADataSheetAsItIs) {
  const model::Camera camera = DescribedCamera(DataSheet(), std::nullopt, std::nullopt);
  EXPECT_EQ(camera.lens.front_focal_length_mm, 12.5);
  EXPECT_EQ(camera.lens.rear_focal_length_mm, 12.8);
  EXPECT_EQ(camera.lens.lens_thickness_mm, -1);
  EXPECT_DOUBLE_EQ(camera.lens.aperture_radius_mm, 12.5 / 2.8);
  EXPECT_DOUBLE_EQ(camera.sensor.pixel_pitch_mm, 0.006);
  EXPECT_EQ(camera.sensor.width_px, 640);
  EXPECT_EQ(camera.sensor.height_px, 480);
  EXPECT_EQ(camera.sensor.principal_point_px, Eigen::Vector2d(320, 240));
  EXPECT_THAT(model::AssumedFields(camera), IsEmpty());
  EXPECT_FALSE(camera.calibration);
}

TEST(DescribedCamera, MarksItsDefaultsAsAssumedInTheFileToo) {
  CameraDescription description = DataSheet();
  description.rear_focal_length_mm.reset();
  description.lens_thickness_mm.reset();
  description.principal_point_px.reset();
  const model::Camera camera = DescribedCamera(description, std::nullopt, std::nullopt);
  EXPECT_EQ(camera.lens.rear_focal_length_mm, 12.5);
  EXPECT_EQ(camera.lens.lens_thickness_mm, 0);
  EXPECT_EQ(camera.sensor.principal_point_px, Eigen::Vector2d(319.5, 239.5));
  const model::Camera read = model::ParseCamera(model::CameraToYaml(camera), "memory");
  EXPECT_THAT(model::AssumedFields(read),
              ElementsAre("lens.lens_thickness_mm", "lens.rear_focal_length_mm",
                          "sensor.principal_point_px[0]", "sensor.principal_point_px[1]"));
}

TEST(DescribedCamera, MarksATransferCurveThatNobodyStatedAsAssumed) {
  CameraDescription description = DataSheet();
  description.transfer.reset();
  const model::Camera camera = DescribedCamera(description, std::nullopt, std::nullopt);
  EXPECT_EQ(camera.sensor.transfer.Name(), "srgb");
  const std::string yaml = model::CameraToYaml(camera);
  EXPECT_THAT(yaml, HasSubstr("transfer: {value: srgb, assumed: true}"));
  const model::Camera read = model::ParseCamera(yaml, "memory");
  EXPECT_EQ(read.sensor.transfer.Name(), "srgb");
  EXPECT_THAT(model::AssumedFields(read), ElementsAre("sensor.transfer"));
}

TEST(DescribedCamera, TakesRawValuesAsLinearWithoutAssumingIt) {
  CameraDescription description = DataSheet();
  description.transfer.reset();
  io::ImageFacts facts;
  facts.raw.emplace();
  const model::Camera camera = DescribedCamera(description, std::nullopt, std::nullopt, &facts);
  EXPECT_EQ(camera.sensor.transfer.Name(), "linear");
  EXPECT_THAT(model::AssumedFields(camera), IsEmpty());
}

TEST(DescribedCamera, AssumesTheStatedCurveOfAPhotographForTheCamera) {
  CameraDescription description = DataSheet();
  description.transfer.reset();
  io::ImageFacts facts;
  facts.transfer = io::StatedTransfer::kLinear;
  const model::Camera camera = DescribedCamera(description, std::nullopt, std::nullopt, &facts);
  EXPECT_EQ(camera.sensor.transfer.Name(), "linear");
  EXPECT_THAT(model::AssumedFields(camera), ElementsAre("sensor.transfer"));
}

TEST(DescribedCamera, EverythingThatIsMissingIsReportedAtOnce) {
  EXPECT_THAT(MessageOf({}, std::nullopt), AllOf(HasSubstr("--focal-mm"), HasSubstr("--f-number"),
                                                 HasSubstr("--pitch-um"), HasSubstr("--size")));
  io::PhotoExif photo;
  photo.why_no_pitch = "EXIF has no FocalPlaneXResolution";
  EXPECT_THAT(MessageOf({}, photo), HasSubstr("--pitch-um UM (EXIF has no FocalPlaneXResolution)"));
}

TEST(DescribedCamera, PrefersWhatIsGivenToThePhotograph) {
  CameraDescription description;
  description.front_focal_length_mm = 26;
  io::PhotoExif photo;
  photo.focal_length_mm = 25;
  photo.f_number = 2.5;
  photo.pixel_pitch_mm = 0.005;
  photo.model = "Bench 1";
  const model::Camera camera = DescribedCamera(description, photo, Eigen::Vector2i(32, 24));
  EXPECT_EQ(camera.name, "Bench 1");
  EXPECT_EQ(camera.lens.front_focal_length_mm, 26);
  EXPECT_DOUBLE_EQ(camera.lens.aperture_radius_mm, 26 / 5.0);
  const auto assumed = model::AssumedFields(camera);
  EXPECT_THAT(assumed, ::testing::Not(Contains("lens.front_focal_length_mm")));
  EXPECT_THAT(assumed, Contains("lens.aperture_radius_mm"));
  EXPECT_THAT(assumed, Contains("sensor.pixel_pitch_mm"));
}

TEST(ReadPhotoExif, ReadsLensAndPitch) {
  const io::PhotoExif photo = io::ReadPhotoExif(WritePhoto("typical.png", TypicalExif()), 32, 24);
  ASSERT_TRUE(photo.focal_length_mm && photo.f_number && photo.pixel_pitch_mm);
  EXPECT_NEAR(*photo.focal_length_mm, 25, 1e-6);
  EXPECT_NEAR(*photo.f_number, 2.8, 1e-6);
  EXPECT_NEAR(*photo.pixel_pitch_mm, 0.005, 1e-9);
  EXPECT_EQ(photo.model, "Bench 1");
}

TEST(ReadPhotoExif, TakesInchesWhereNoUnitIsGiven) {
  Exiv2::ExifData exif = TypicalExif();
  exif.erase(exif.findKey(Exiv2::ExifKey("Exif.Photo.FocalPlaneResolutionUnit")));
  const io::PhotoExif photo = io::ReadPhotoExif(WritePhoto("inches.png", exif), 32, 24);
  ASSERT_TRUE(photo.pixel_pitch_mm);
  EXPECT_NEAR(*photo.pixel_pitch_mm, 25.4 / 2000, 1e-8);
}

// The resolution is that of the image out of the camera; a smaller copy keeps the number.
TEST(ReadPhotoExif, TakesNoPitchFromAScaledOrCutImage) {
  Exiv2::ExifData exif = TypicalExif();
  exif["Exif.Photo.PixelXDimension"] = std::uint32_t{64};
  exif["Exif.Photo.PixelYDimension"] = std::uint32_t{48};
  const io::PhotoExif photo = io::ReadPhotoExif(WritePhoto("scaled.png", exif), 32, 24);
  EXPECT_FALSE(photo.pixel_pitch_mm);
  EXPECT_THAT(photo.why_no_pitch, AllOf(HasSubstr("32 x 24"), HasSubstr("64 x 48")));
}

TEST(ReadPhotoExif, KnowsNothingOfAnImageWithoutExif) {
  const io::PhotoExif photo = io::ReadPhotoExif(WritePhoto("bare.png", Exiv2::ExifData()), 32, 24);
  EXPECT_FALSE(photo.focal_length_mm || photo.f_number || photo.pixel_pitch_mm);
  EXPECT_THAT(photo.why_no_pitch, HasSubstr("FocalPlaneXResolution"));
}

TEST(ReadPhotoExif, UsesNoZeroDenominator) {
  Exiv2::ExifData exif = TypicalExif();
  exif["Exif.Photo.FocalLength"] = Exiv2::Rational(25, 0);
  exif["Exif.Photo.FNumber"] = Exiv2::Rational(0, 1);
  const io::PhotoExif photo = io::ReadPhotoExif(WritePhoto("zero.png", exif), 32, 24);
  EXPECT_FALSE(photo.focal_length_mm || photo.f_number);
}

}  // namespace
}  // namespace thicklens::tools
