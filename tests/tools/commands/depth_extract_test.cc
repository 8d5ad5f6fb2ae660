// thicklens depth extract, and estimate and explain with the depth map inside a photograph. The
// files and the right values are those of tests/data/embedded_depth/README.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/io/depth_io.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

// In focus at 1 m, so that the maps of 0.25 to 2.5 dioptres have both signs of disparity.
constexpr char kCameraOfPhone[] =
    "schema: thicklens/camera/2\n"
    "name: phone\n"
    "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, "
    "aperture_radius_mm: 2}\n"
    "sensor: {width_px: 64, height_px: 48, pixel_pitch_mm: 0.1, "
    "principal_point_px: [31.5, 23.5], transfer: srgb}\n"
    "psf: gaussian\n"
    "calibration:\n"
    "  image_distance_mm: {value: 52.6315789, sigma: 0}\n"
    "  blur_ratio: {value: 0.5, sigma: 0}\n"
    "  blur_floor_px: {value: 0.4, sigma: 0}\n"
    "  evidence: {method: assumed}\n";

class DepthInsideTest : public ::testing::Test {
 protected:
  ProgramResult Start(const Arguments& arguments) const {
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }
  ProgramResult Refused(const Arguments& arguments, int exit_code) const {
    ProgramResult result = Start(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
    return result;
  }
  Arguments Estimate(const std::string& photo, const Arguments& more) const {
    Arguments arguments = {"estimate", photo, "--views",       "3x3",    "--threads",
                           "1",        "-o",  folder_ / "out", "--json", folder_ / "e.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  nlohmann::json Json() const { return nlohmann::json::parse(ContentOf(folder_ / "e.json")); }

  // A copy, which messages name by its short path.
  std::string Photo(const std::string& name) const {
    return folder_.Put(
        name, ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/tests/data/embedded_depth/" + name));
  }

  TemporaryFolder folder_;
  std::string camera_ = folder_.Put("camera.yaml", kCameraOfPhone);
};

TEST_F(DepthInsideTest, EstimateUsesItAndSaysSo) {
  const ProgramResult result = Start(Estimate(Photo("gdepth_inverse.jpg"), {"--camera", camera_}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              HasSubstr("depth map    The depth map inside is used: GDepth, RangeInverse from 0.4 "
                        "to 2.5 m along the optical axis; PNG, 32 x 24 px"));
  EXPECT_THAT(result.err, HasSubstr("32 x 24 px brought to 64 x 48 px"));
  const nlohmann::json json = Json();
  EXPECT_THAT(json["embedded_depth"].get<std::string>(), HasSubstr("GDepth"));
  EXPECT_NEAR(json["depth"]["min_mm"], 1000 / 2.08, 0.1);
  EXPECT_NEAR(json["depth"]["max_mm"], 2500, 0.1);
}

TEST_F(DepthInsideTest, TheKindMayBeGivenIfItAgrees) {
  EXPECT_EQ(
      Start(Estimate(Photo("gdepth_inverse.jpg"), {"--camera", camera_, "--depth-kind", "inverse"}))
          .exit_code,
      0);
}

TEST_F(DepthInsideTest, OptionsThatContradictItAreRefused) {
  const std::string photo = Photo("gdepth_inverse.jpg");
  EXPECT_THAT(Refused(Estimate(photo, {"--depth-kind", "disparity"}), 2).err,
              AllOf(HasSubstr("--depth-kind disparity: the depth map inside " + photo),
                    HasSubstr("inverse depth (1/z)"), HasSubstr("leave the option out")));
  EXPECT_THAT(
      Refused(Estimate(photo, {"--camera", camera_, "--depth-unit", "m", "--zero-is", "value"}), 2)
          .err,
      HasSubstr("--depth-unit, --zero-is: the depth map inside"));
  EXPECT_THAT(Refused(Estimate(photo, {"--orientation", "displayed"}), 2).err,
              HasSubstr("used as they are stored"));
}

TEST_F(DepthInsideTest, WithoutACameraTheRemedyIsNamed) {
  EXPECT_THAT(Refused(Estimate(Photo("gdepth_inverse.jpg"), {}), 2).err,
              AllOf(HasSubstr("--camera is missing"), HasSubstr("inverse depth (1/z)"),
                    HasSubstr("thicklens camera init --from-exif"),
                    HasSubstr("--focal-mm MM --f-number N --pitch-um UM"),
                    HasSubstr("--depth-kind disparity")));
  EXPECT_THAT(Refused(Estimate(Photo("dynamic_depth.jpg"), {}), 2).err,
              AllOf(HasSubstr("z (along the optical axis)"), Not(HasSubstr("inverse.pfm"))));
}

// The photograph in the place of its depth map: the commands name what their user can do.
TEST_F(DepthInsideTest, APhotographAsItsDepthMapIsRefusedWithTheWayToTheMap) {
  const std::string photo = Photo("gdepth_inverse.jpg");
  EXPECT_THAT(
      Refused(
          Estimate(photo, {photo, "--camera", camera_, "--depth-kind", "z", "--depth-unit", "mm"}),
          1)
          .err,
      HasSubstr("by the same command without a depth map, or by `thicklens depth extract`"));
}

TEST_F(DepthInsideTest, APhotographWithoutOneIsRefusedWithWhatWasLookedFor) {
  EXPECT_THAT(Refused(Estimate(Photo("second_image.jpg"), {}), 1).err,
              AllOf(HasSubstr("no DEPTH was given"), HasSubstr("GDepth and Dynamic Depth"),
                    HasSubstr("found: a second image of 16 x 12 px"),
                    HasSubstr("z, range, disparity or inverse")));
  EXPECT_THAT(Refused({"depth", "extract", Photo("stereo_pair.jpg"), "-o", folder_ / "out"}, 2).err,
              HasSubstr(".pfm or .png is expected"));
  EXPECT_THAT(
      Refused({"depth", "extract", Photo("stereo_pair.jpg"), "-o", folder_ / "out.pfm"}, 1).err,
      AllOf(HasSubstr("it holds no depth map"), HasSubstr("a stereo pair")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out.pfm"));
}

TEST_F(DepthInsideTest, ExtractWritesDioptresAsPfm) {
  const std::string out = folder_ / "map.pfm", json = folder_ / "e.json";
  const ProgramResult result =
      Start({"depth", "extract", Photo("gdepth_inverse.jpg"), "-o", out, "--json", json});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("32 x 24 px, 32-bit floats, dioptres (1/m)"),
                                HasSubstr("--depth-kind inverse"), HasSubstr("wrote " + out)));
  const model::RawDepthMap map = io::ReadDepthMap(out);
  EXPECT_EQ(map.width_px, 32);
  EXPECT_NEAR(map.values.front(), 2.08, 1e-5);
  EXPECT_NEAR(map.values.back(), 0.4, 1e-5);
  EXPECT_EQ(Json()["form"], "GDepth");
  EXPECT_EQ(Json()["options"], nlohmann::json::array({"--depth-kind", "inverse"}));
}

// The options that extract prints make estimate find the same depths in the file.
TEST_F(DepthInsideTest, EstimateTakesTheWrittenFileByThePrintedOptions) {
  const std::string json = folder_ / "e.json";
  for (const char* photo : {"gdepth_inverse.jpg", "dynamic_depth.jpg"}) {
    const std::string path = Photo(photo);
    ASSERT_EQ(Start(Estimate(path, {"--camera", camera_})).exit_code, 0);
    const nlohmann::json inside = Json()["depth"];
    for (const char* name : {"map.pfm", "map.png"}) {
      const std::string map = folder_ / name;
      ASSERT_EQ(Start({"depth", "extract", path, "-o", map, "--json", json}).exit_code, 0);
      Arguments more = {map, "--camera", camera_};
      const nlohmann::json extracted = Json();
      for (const auto& option : extracted["options"]) more.push_back(option);
      const ProgramResult result = Start(Estimate(path, more));
      ASSERT_EQ(result.exit_code, 0) << name << result.err;
      EXPECT_TRUE(Json()["embedded_depth"].is_null());
      for (const char* field : {"min_mm", "median_mm", "max_mm"}) {
        EXPECT_NEAR(Json()["depth"][field].get<double>(), inside[field].get<double>(), 0.6)
            << photo << " " << name << " " << field;
      }
    }
  }
}

TEST_F(DepthInsideTest, APngOfAnInverseDepthHasTheStoredNumbers) {
  const std::string out = folder_ / "map.png";
  ASSERT_EQ(Start({"depth", "extract", Photo("gdepth_inverse.jpg"), "-o", out}).exit_code, 0);
  const io::DepthFile file = io::ReadDepthFile(out);
  EXPECT_EQ(file.map.largest_of_type, 255);
  EXPECT_EQ(file.map.values.front(), 51);
  EXPECT_EQ(file.map.values.back(), 255);
}

TEST_F(DepthInsideTest, ExplainTakesAPhotographAsDepthMap) {
  const ProgramResult result = Start(
      {"explain", camera_, "--depth", Photo("gdepth_inverse.jpg"), "--json", folder_ / "e.json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("The depth map inside is used: GDepth"));
  EXPECT_THAT(Start({"explain", camera_, "--depth", Photo("second_image.jpg")}).err,
              HasSubstr("--depth-kind is missing"));
}

TEST_F(DepthInsideTest, ABrokenPhotographLeavesNoFile) {
  std::string bytes = ContentOf(Photo("gdepth_inverse.jpg"));
  bytes.replace(bytes.find(">0.4<"), 5, ">9.4<");
  const std::string photo = folder_.Put("broken.jpg", bytes);
  EXPECT_THAT(Refused({"depth", "extract", photo, "-o", folder_ / "map.pfm"}, 1).err,
              AllOf(HasSubstr(photo), HasSubstr("GDepth:Near is 9.4 and GDepth:Far is 2.5")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "map.pfm"));
  EXPECT_THAT(Refused(Estimate(photo, {"--camera", camera_}), 1).err,
              HasSubstr("0 < Near < Far is expected"));
}

}  // namespace
}  // namespace thicklens::tools
