#include "tools/commands/camera_init.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"
#include "tools/io/image_library.h"
#include "tools/support/child_process.h"
#include "tools/support/dng_tags.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;

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
  // A folder for each test, because the tests run side by side.
  static const TemporaryFolder folder;
  const std::string path = folder / name;
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

// ---- Raw files.

constexpr char kMosaic[] = THICKLENS_SOURCE_DIR "/tests/data/images/mosaic.dng";

// A sensor of 40 x 30 px, of which 32 x 24 saw light.
io::RawFacts SmallSensor() {
  io::RawFacts raw;
  raw.sensor_width_px = 40;
  raw.sensor_height_px = 30;
  raw.active_left_px = 6;
  raw.active_top_px = 4;
  raw.active_width_px = 32;
  raw.active_height_px = 24;
  return raw;
}

// EXIF for a raw file, which states the size of an image.
Exiv2::ExifData ExifOfSize(std::uint32_t width_px, std::uint32_t height_px) {
  Exiv2::ExifData exif = TypicalExif();
  exif["Exif.Photo.PixelXDimension"] = width_px;
  exif["Exif.Photo.PixelYDimension"] = height_px;
  return exif;
}

io::PhotoExif ReadOfRaw(const Exiv2::ExifData& exif, const io::RawFacts& raw = SmallSensor()) {
  return io::ReadPhotoExif(WritePhoto("of_raw.png", exif), 32, 24, &raw);
}

TEST(ReadPhotoExif, TakesThePitchOfARawFileFromTheSizeOfTheCamerasOwnImage) {
  for (const auto& [width_px, height_px] :
       {std::pair{32, 24}, {31, 23}, {23, 31}, {34, 26}, {40, 30}}) {
    const io::PhotoExif photo = ReadOfRaw(
        ExifOfSize(static_cast<std::uint32_t>(width_px), static_cast<std::uint32_t>(height_px)));
    ASSERT_TRUE(photo.pixel_pitch_mm) << width_px << " x " << height_px << photo.why_no_pitch;
    EXPECT_NEAR(*photo.pixel_pitch_mm, 0.005, 1e-9);
    EXPECT_EQ(photo.pitch_source, "EXIF FocalPlaneXResolution");
    EXPECT_FALSE(photo.made_width_px || photo.made_height_px);  // not about these pixels
  }
  EXPECT_TRUE(ReadOfRaw(TypicalExif()).pixel_pitch_mm);  // no size is stated
}

TEST(ReadPhotoExif, TakesNoPitchForOtherPixelsThanThoseOfTheSensor) {
  // A small JPEG, a sensor of twice the pixels (half-size raw), an image cut to 16:9.
  for (const auto& [width_px, height_px] : {std::pair{16, 12}, {64, 48}, {32, 18}}) {
    const io::PhotoExif photo = ReadOfRaw(
        ExifOfSize(static_cast<std::uint32_t>(width_px), static_cast<std::uint32_t>(height_px)));
    EXPECT_FALSE(photo.pixel_pitch_mm);
    EXPECT_THAT(photo.why_no_pitch,
                AllOf(HasSubstr(std::to_string(width_px) + " x " + std::to_string(height_px)),
                      HasSubstr("32 x 24 px"), HasSubstr("is not stated")));
  }
  io::RawFacts small = SmallSensor();
  small.why_resampled = "it holds interpolated colours";
  EXPECT_THAT(ReadOfRaw(TypicalExif(), small).why_no_pitch,
              HasSubstr("is not stated: it holds interpolated colours"));
  const io::RawFacts raw = SmallSensor();
  const io::PhotoExif developed =
      io::ReadPhotoExif(WritePhoto("developed.png", TypicalExif()), 16, 12, &raw);
  EXPECT_THAT(developed.why_no_pitch, AllOf(HasSubstr("16 x 12"), HasSubstr("scaled or cropped")));
  EXPECT_THAT(ReadOfRaw(Exiv2::ExifData()).why_no_pitch,
              AllOf(HasSubstr("FocalPlaneXResolution"), HasSubstr("TIFF/EP")));
  Exiv2::ExifData narrow = TypicalExif();
  narrow["Exif.Photo.FocalPlaneYResolution"] = Exiv2::Rational(1000, 1);
  EXPECT_THAT(ReadOfRaw(narrow).why_no_pitch, HasSubstr("not square"));
}

// 32 x 24 px of 5 um have a diagonal of 0.2 mm.
TEST(ReadPhotoExif, TakesNoPitchThatTheEquivalentFocalLengthContradicts) {
  const auto of_equivalent_mm = [](int mm) {
    Exiv2::ExifData exif = TypicalExif();
    exif["Exif.Photo.FocalLengthIn35mmFilm"] = static_cast<std::uint16_t>(mm);
    return ReadOfRaw(exif);
  };
  EXPECT_TRUE(of_equivalent_mm(5408).pixel_pitch_mm);  // 25 mm * 43.267/0.2
  EXPECT_TRUE(of_equivalent_mm(4600).pixel_pitch_mm);
  // Pixels twice as large, as binning makes them, and half of them.
  for (const int mm : {2704, 10816}) {
    EXPECT_THAT(of_equivalent_mm(mm).why_no_pitch,
                AllOf(HasSubstr("5 um"), HasSubstr("0.2 mm"), HasSubstr("25 mm")));
  }
}

TEST(ReadPhotoExif, TakesThePitchOfTiffEpWithItsUnits) {
  const TemporaryFolder folder;
  io::RawFacts raw;
  raw.sensor_width_px = raw.active_width_px = 64;
  raw.sensor_height_px = raw.active_height_px = 48;
  const auto pitch_mm = [&](bool in_main, std::uint32_t per_unit, std::uint32_t unit) {
    const std::vector<TiffTag> fields = {{0x920E, TiffTag::kRational, {per_unit, 1}},
                                         {0x920F, TiffTag::kRational, {per_unit, 1}},
                                         {0x9210, TiffTag::kShort, {unit}}};
    DngTags tags;
    (in_main ? tags.main : tags.sensor) = fields;
    const std::string path = folder.Put("a.dng", DngEdit(ContentOf(kMosaic)).With(tags));
    const io::PhotoExif photo = io::ReadPhotoExif(path, 64, 48, &raw);
    EXPECT_EQ(photo.pitch_source, "TIFF/EP FocalPlaneXResolution") << photo.why_no_pitch;
    return photo.pixel_pitch_mm.value_or(0);
  };
  EXPECT_NEAR(pitch_mm(true, 5080, 1), 0.005, 1e-9);    // inch
  EXPECT_NEAR(pitch_mm(true, 5080, 2), 0.005, 1e-9);    // inch, as in EXIF
  EXPECT_NEAR(pitch_mm(true, 200000, 2), 0.005, 1e-9);  // metre
  EXPECT_NEAR(pitch_mm(true, 2000, 3), 0.005, 1e-9);    // cm
  EXPECT_NEAR(pitch_mm(true, 200, 4), 0.005, 1e-9);     // mm
  EXPECT_NEAR(pitch_mm(false, 2000, 3), 0.005, 1e-9);
}

TEST(SourcesOf, NamesTheFieldsOfARawFile) {
  io::ImageFacts facts;
  facts.raw = SmallSensor();
  io::PhotoExif photo;
  photo.pitch_source = "EXIF FocalPlaneXResolution";
  const std::string comment = SourcesComment(SourcesOf({}, photo, &facts));
  EXPECT_EQ(comment,
            "# width_px, height_px: the active area of the raw file's sensor, which has 40 x 30 "
            "px; it begins at (6, 4)\n"
            "# pixel_pitch_mm: EXIF FocalPlaneXResolution\n");
  EXPECT_THAT(SourcesComment(SourcesOf(DataSheet(), photo, &facts)),
              AllOf(HasSubstr("height_px: given\n"), HasSubstr("pitch_mm: given\n")));
}

// The mosaic of tests/data/images/README.md, as a camera writes it: a few pixels are masked, and
// EXIF states the size of a JPEG that is a little smaller still.
std::string RawPhoto(const TemporaryFolder& folder, std::uint32_t made_width_px) {
  constexpr std::uint16_t kActiveArea = 50829;
  DngTags tags;
  tags.sensor = {{kActiveArea, TiffTag::kLong, {2, 4, 46, 62}}};
  tags.exif = {{0x829D, TiffTag::kRational, {28, 10}},
               {0x920A, TiffTag::kRational, {250, 10}},
               {0xA002, TiffTag::kLong, {made_width_px}},
               {0xA003, TiffTag::kLong, {42}},
               {0xA20E, TiffTag::kRational, {2000, 1}},
               {0xA20F, TiffTag::kRational, {2000, 1}},
               {0xA210, TiffTag::kShort, {3}}};
  return folder.Put("a.dng", DngEdit(ContentOf(kMosaic)).With(tags));
}

TEST(CameraInit, DescribesTheSensorOfARawFile) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts";
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {
      "camera",          "init",   "--from-exif",    RawPhoto(folder, 56), "-o",
      folder / "c.yaml", "--json", folder / "c.json"};
  const ProgramResult result = ChildProgram(arguments, folder.path(), 0).Wait();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const model::Camera camera = model::ReadCamera(folder / "c.yaml");
  EXPECT_EQ(camera.sensor.width_px, 58);
  EXPECT_EQ(camera.sensor.height_px, 44);
  EXPECT_NEAR(camera.sensor.pixel_pitch_mm, 0.005, 1e-9);
  EXPECT_EQ(camera.sensor.transfer.Name(), "linear");
  EXPECT_THAT(ContentOf(folder / "c.yaml"),
              AllOf(HasSubstr("# width_px, height_px: the active area of the raw file's sensor, "
                              "which has 64 x 48 px; it begins at (4, 2)\n"),
                    HasSubstr("# pixel_pitch_mm: EXIF FocalPlaneXResolution\n")));
  const auto json = nlohmann::json::parse(ContentOf(folder / "c.json"));
  EXPECT_EQ(json.at("pixel_pitch_source"), "EXIF FocalPlaneXResolution");
  EXPECT_THAT(json.at("size_source").get<std::string>(), HasSubstr("64 x 48 px"));
}

TEST(CameraInit, AsksForThePitchOfARawFileThatDoesNotStateIt) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts";
  const TemporaryFolder folder;
  const ProgramResult result =
      ChildProgram({"camera", "init", "--from-exif", RawPhoto(folder, 28)}, folder.path(), 0)
          .Wait();
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.err, AllOf(HasSubstr("--pitch-um UM (its FocalPlaneXResolution counts"),
                                HasSubstr("28 x 42"), HasSubstr("58 x 44")));
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
