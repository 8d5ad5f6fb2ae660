// The EXIF data of a photograph are compared with the camera file for its estimate.
#include "tools/interface/exif_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/model/camera_file.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::CentredSensor;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using thicklens::testing::TestCamera;
using thicklens::testing::ThinLens;
using thicklens::testing::WithMethod;
using Arguments = std::vector<std::string>;

constexpr int kPhotoWidthPx = 60, kPhotoHeightPx = 40;

// 50 mm at f/2.8, focused at 300 mm; a sensor of 36 x 24 mm.
model::Camera BenchLens() {
  const model::ThickLens lens = ThinLens(50, 50 / (2 * 2.8));
  return WithMethod(
      TestCamera("bench lens", lens, CentredSensor(kPhotoWidthPx, kPhotoHeightPx, 0.6),
                 {model::ImageDistanceMm(lens, 300), 0.001}, {0.45, 0.001}),
      "joint-blur-fit");
}

PhotoSize Whole() { return {kPhotoWidthPx, kPhotoHeightPx, false}; }

// The verdict on one quantity; "" where it is not compared.
std::string VerdictOn(const std::string& quantity, const io::PhotoExif& exif,
                      const model::Camera& camera = BenchLens(), const PhotoSize& size = Whole()) {
  for (const ExifComparison& finding : CompareExif(exif, camera, size)) {
    if (finding.quantity == quantity) return ExifVerdictName(finding.verdict);
  }
  return "";
}

TEST(CompareExif, TheFocalLengthMayBeOffByItsRoundingAndTheStatedTolerance) {
  const auto verdict = [](double exif_mm, double tolerance_mm) {
    model::Camera camera = BenchLens();
    if (tolerance_mm > 0) camera.statements["lens.front_focal_length_mm"] = {tolerance_mm, false};
    io::PhotoExif exif;
    exif.focal_length_mm = exif_mm;
    return VerdictOn("focal length", exif, camera);
  };
  EXPECT_EQ(verdict(50, 0), "agrees");
  EXPECT_EQ(verdict(50.04, 0), "undecided");  // 0.005 of rounding
  EXPECT_EQ(verdict(50.04, 0.04), "agrees");
  EXPECT_EQ(verdict(49, 0.6), "agrees");       // a whole number: 0.5 of rounding
  EXPECT_EQ(verdict(49, 0.4), "contradicts");  // beyond the stated tolerance
  EXPECT_EQ(verdict(48.2, 1), "contradicts");  // 0.05 of rounding
  EXPECT_EQ(verdict(48, 0), "undecided");      // nothing is stated, and EXIF may be nominal
  EXPECT_EQ(verdict(35, 0), "contradicts");
  EXPECT_EQ(verdict(70, 0), "contradicts");
}

TEST(CompareExif, BothFocalLengthsOfAThickLensCount) {
  model::Camera camera = BenchLens();
  camera.lens.rear_focal_length_mm = 51.2;
  io::PhotoExif exif;
  exif.focal_length_mm = 51.23;
  EXPECT_EQ(VerdictOn("focal length", exif, camera), "undecided");
  exif.focal_length_mm = 50.7;
  EXPECT_EQ(VerdictOn("focal length", exif, camera), "agrees");
}

// The camera file of a microscope has an equivalent lens, which is not the one that EXIF describes.
TEST(CompareExif, LengthsAreNotComparedWithThoseOfAnObjective) {
  model::Camera camera = BenchLens();
  io::PhotoExif exif;
  exif.focal_length_mm = 35;
  exif.f_number = 8;
  exif.subject_distance_mm = 3000;
  for (const char* quantity : {"focal length", "f-number", "focus distance"})
    EXPECT_EQ(VerdictOn(quantity, exif, camera), "contradicts") << quantity;
  camera.objective = model::Objective{4, 0.1, 200};
  camera.lens = model::LensOfObjective(*camera.objective);
  for (const char* quantity : {"focal length", "f-number", "focus distance"})
    EXPECT_EQ(VerdictOn(quantity, exif, camera), "") << quantity;
}

TEST(CompareExif, TheFNumberMayBeOffByAThirdOfAStopAtMost) {
  const auto verdict = [](double number, double camera_number = 2.8) {
    model::Camera camera = BenchLens();
    camera.lens.aperture_radius_mm = 50 / (2 * camera_number);
    io::PhotoExif exif;
    exif.f_number = number;
    return VerdictOn("f-number", exif, camera);
  };
  EXPECT_EQ(verdict(2.8), "agrees");
  EXPECT_EQ(verdict(2.9), "undecided");
  EXPECT_EQ(verdict(3.2), "contradicts");  // the next third of a stop
  EXPECT_EQ(verdict(2.5), "contradicts");
  EXPECT_EQ(verdict(8), "contradicts");
  // A whole number is not rounded to one.
  EXPECT_EQ(verdict(2, 2.4), "contradicts");
  EXPECT_EQ(verdict(4, 3.5), "contradicts");
  EXPECT_EQ(verdict(2, 2), "agrees");
}

TEST(CompareExif, TheFocusDistanceMayBeFromTheApertureOrFromTheSensor) {
  const auto verdict = [](double mm) {
    io::PhotoExif exif;
    exif.subject_distance_mm = mm;
    return VerdictOn("focus distance", exif);
  };
  EXPECT_EQ(verdict(300), "agrees");
  EXPECT_EQ(verdict(360), "agrees");  // zf + d1
  EXPECT_EQ(verdict(400), "agrees");  // in steps of 100 mm, and rings are rough
  EXPECT_EQ(verdict(480), "undecided");
  EXPECT_EQ(verdict(1000), "undecided");  // a whole number of metres
  model::Camera half_metre = BenchLens();
  half_metre.calibration->image_distance_mm->value = model::ImageDistanceMm(half_metre.lens, 500);
  io::PhotoExif metre;
  metre.subject_distance_mm = 1000;
  EXPECT_EQ(VerdictOn("focus distance", metre, half_metre), "undecided");
  EXPECT_EQ(verdict(1200), "contradicts");
  EXPECT_EQ(verdict(std::numeric_limits<double>::infinity()), "contradicts");
  model::Camera uncalibrated = BenchLens();
  uncalibrated.calibration.reset();
  io::PhotoExif exif;
  exif.subject_distance_mm = 1000;
  EXPECT_EQ(VerdictOn("focus distance", exif, uncalibrated), "");
}

TEST(CompareExif, ThePitchAndTheCropFactorAreThoseOfTheSensor) {
  io::PhotoExif exif;
  exif.focal_length_mm = 50;
  exif.pixel_pitch_mm = 0.61;
  exif.focal_length_35mm = 50;
  EXPECT_EQ(VerdictOn("pixel pitch", exif), "agrees");
  EXPECT_EQ(VerdictOn("crop factor", exif), "agrees");
  exif.pixel_pitch_mm = 0.64;
  EXPECT_EQ(VerdictOn("pixel pitch", exif), "undecided");
  exif.pixel_pitch_mm = 0.39;
  exif.focal_length_35mm = 75;  // a sensor of APS-C
  EXPECT_EQ(VerdictOn("pixel pitch", exif), "contradicts");
  EXPECT_EQ(VerdictOn("crop factor", exif), "contradicts");
  // The equivalent focal length says nothing about a part of the sensor.
  EXPECT_EQ(VerdictOn("crop factor", exif, BenchLens(), {30, 20, true}), "");
}

TEST(CompareExif, AScaledOrCroppedImageIsReported) {
  io::PhotoExif exif;
  exif.made_width_px = 600;
  exif.made_height_px = 400;
  EXPECT_EQ(VerdictOn("image size", exif), "undecided");
  exif.made_pixel_pitch_mm = 0.06;  // scaled by 1/10 as those that the camera file is of
  EXPECT_EQ(VerdictOn("image size", exif), "agrees");
  exif.made_pixel_pitch_mm = 0.6;
  EXPECT_EQ(VerdictOn("image size", exif), "undecided");
  exif.made_width_px = kPhotoHeightPx;  // turned
  exif.made_height_px = kPhotoWidthPx;
  EXPECT_EQ(VerdictOn("image size", exif), "agrees");
  exif.digital_zoom = 2;
  EXPECT_EQ(VerdictOn("digital zoom", exif), "undecided");
  exif.orientation = 6;
  EXPECT_EQ(VerdictOn("orientation", exif), "undecided");
}

TEST(CompareExif, SaysNothingWithoutExif) {
  EXPECT_TRUE(io::PhotoExif().IsEmpty());
  EXPECT_THAT(CompareExif(io::PhotoExif(), BenchLens(), Whole()), IsEmpty());
}

Exiv2::ExifData MatchingExif() {
  Exiv2::ExifData exif;
  exif["Exif.Photo.FocalLength"] = Exiv2::Rational(50, 1);
  exif["Exif.Photo.FNumber"] = Exiv2::Rational(28, 10);
  exif["Exif.Photo.SubjectDistance"] = Exiv2::Rational(3, 10);
  exif["Exif.Photo.FocalLengthIn35mmFilm"] = std::uint16_t{50};
  exif["Exif.Photo.PixelXDimension"] = std::uint32_t{kPhotoWidthPx};
  exif["Exif.Photo.PixelYDimension"] = std::uint32_t{kPhotoHeightPx};
  return exif;
}

class EstimateExifTest : public ::testing::Test {
 protected:
  std::string Photo(const std::string& name, const Exiv2::ExifData& exif) const {
    std::vector<unsigned char> bytes;
    cv::Mat image(kPhotoHeightPx, kPhotoWidthPx, CV_8UC3);
    cv::randu(image, 60, 200);
    cv::imencode(fs::path(name).extension().string(), image, bytes);
    const std::string path = folder_.Put(name, {bytes.begin(), bytes.end()});
    const auto file = Exiv2::ImageFactory::open(path);
    file->readMetadata();
    Exiv2::ExifData all = file->exifData();  // the tags that make a TIFF file
    for (const auto& entry : exif) all[entry.key()] = entry.value();
    file->setExifData(all);
    file->writeMetadata();
    return path;
  }
  ProgramResult Estimate(const std::string& photo, const Arguments& more = {}) const {
    const model::RawDepthMap map{kPhotoWidthPx, kPhotoHeightPx,
                                 std::vector<float>(kPhotoWidthPx * kPhotoHeightPx, 320), false};
    Arguments arguments = {
        "estimate",     photo,      folder_.Put("depth.pfm", io::EncodePfm(map)),
        "--depth-kind", "z",        "--depth-unit",
        "mm",           "--camera", folder_.Put("camera.yaml", model::CameraToYaml(BenchLens())),
        "--views",      "3x3",      "-o",
        folder_ / "lf", "--json",   folder_ / "lf.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  nlohmann::json Json() const { return nlohmann::json::parse(ContentOf(folder_ / "lf.json")); }

  TemporaryFolder folder_, scratch_;
};

TEST_F(EstimateExifTest, WhatAgreesIsSilentInEveryKindOfFile) {
  for (const char* name : {"photo.jpg", "photo.png", "photo.tif"}) {
    SCOPED_TRACE(name);
    const ProgramResult result = Estimate(Photo(name, MatchingExif()));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, Not(HasSubstr("EXIF")));
    std::map<std::string, std::string> verdicts;
    const nlohmann::json json = Json();  // outlives the loop
    for (const auto& finding : json["exif"]["findings"]) {
      verdicts[finding["quantity"]] = finding["verdict"];
    }
    EXPECT_EQ(verdicts.size(), 5U);
    EXPECT_EQ(verdicts["focal length"], "agrees");
    EXPECT_EQ(verdicts["focus distance"], "agrees");
    fs::remove_all(folder_ / "lf");
  }
}

TEST_F(EstimateExifTest, APhotographWithoutExifGivesNoReport) {
  const ProgramResult result = Estimate(Photo("photo.png", Exiv2::ExifData()));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, Not(HasSubstr("EXIF")));
  EXPECT_TRUE(Json()["exif"].is_null());
}

TEST_F(EstimateExifTest, AnotherSettingIsRefusedWithBothValues) {
  Exiv2::ExifData exif = MatchingExif();
  exif["Exif.Photo.FocalLength"] = Exiv2::Rational(350, 10);
  exif["Exif.Photo.FNumber"] = Exiv2::Rational(80, 10);
  exif["Exif.Photo.SubjectDistance"] = Exiv2::URational(0xffffffffU, 1);
  for (const char* name : {"photo.jpg", "photo.png", "photo.tif"}) {
    SCOPED_TRACE(name);
    const std::string photo = Photo(name, exif);
    const ProgramResult result = Estimate(photo);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, AllOf(HasSubstr(name), HasSubstr("camera.yaml"), HasSubstr("35 mm"),
                                  HasSubstr("50 mm"), HasSubstr("f-number"), HasSubstr("infinity"),
                                  HasSubstr("--ignore-exif")));
    EXPECT_FALSE(fs::exists(folder_ / "lf"));
    EXPECT_EQ(Json()["status"], "refused");
  }
  const ProgramResult ignored = Estimate(folder_ / "photo.jpg", {"--ignore-exif"});
  ASSERT_EQ(ignored.exit_code, 0) << ignored.err;
  EXPECT_THAT(ignored.err, AllOf(HasSubstr("focal length"), HasSubstr("ignored")));
  EXPECT_EQ(Json()["exif"]["ignored"], true);
}

TEST_F(EstimateExifTest, WhatCannotBeDecidedIsAWarning) {
  Exiv2::ExifData exif = MatchingExif();
  exif["Exif.Photo.PixelXDimension"] = std::uint32_t{1000};
  exif["Exif.Photo.PixelYDimension"] = std::uint32_t{900};
  const ProgramResult result = Estimate(Photo("photo.jpg", exif));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err,
              AllOf(HasSubstr("image size"), HasSubstr("1000 x 900 px"), HasSubstr("60 x 40 px")));
}

// Numbers that are none do not stop a run.
TEST_F(EstimateExifTest, UnusableValuesAreLeftOut) {
  Exiv2::ExifData exif;
  exif["Exif.Photo.FocalLength"] = Exiv2::Rational(50, 0);
  exif["Exif.Photo.FNumber"] = Exiv2::Rational(0, 1);
  exif["Exif.Photo.SubjectDistance"] = Exiv2::Rational(0, 1);  // unknown, by the standard
  exif["Exif.Image.Orientation"] = std::uint16_t{99};
  const ProgramResult result = Estimate(Photo("photo.jpg", exif));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, Not(HasSubstr("EXIF")));
}

}  // namespace
}  // namespace thicklens::tools
