#include "thicklens/io/light_field_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;
using thicklens::testing::WithMethod;

constexpr int kS = 6, kT = 5;

void FillAtRandom(model::LightField* light_field, float lo, float hi, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> any(lo, hi);
  for (float& value : light_field->values) value = any(generator);
}

model::LightField Relative(int u_count, int v_count, int channels, float lo = 0, float hi = 1) {
  model::LightField light_field = model::MakeLightField(kS, kT, u_count, v_count, channels);
  light_field.weights = model::ApertureWeights(model::ApertureShape::kGaussian, u_count, v_count);
  light_field.origin.method = "dibr";
  FillAtRandom(&light_field, lo, hi, 3);
  return light_field;
}

model::LightField WithCamera(int u_count, int v_count) {
  model::LightField light_field = Relative(u_count, v_count, 3);
  const model::Camera camera = WithMethod(thicklens::testing::SmallCamera(kS, kT, {2.75, 1.5}));
  light_field.camera = camera;
  light_field.grid = model::DefaultGrid(camera, u_count, v_count);
  light_field.landing_step_px = {1e-17, 1.0 / 3};
  return light_field;
}

bool SameBits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

class LightFieldFolder : public ::testing::Test {
 protected:
  std::string Write(const model::LightField& light_field, ViewFormat format,
                    std::size_t* clipped = nullptr) {
    OutputFolder folder(folder_ / "lf", kLightFieldMarker, LightFieldEntries());
    const std::size_t count = WriteLightField(light_field, format, &folder);
    if (clipped != nullptr) *clipped = count;
    folder.Commit();
    return folder_ / "lf";
  }
  std::string WriteHci(const model::LightField& light_field) {
    OutputFolder folder = ClaimHciFolder(folder_ / "hci");
    WriteHciLightField(light_field, &folder);
    folder.Commit();
    return folder_ / "hci";
  }
  // A folder in the HCI layout whose view `number` is grey of that level; 8 bit.
  std::string PutNumbered(const std::vector<int>& numbers, int width_px = 4, int height_px = 3) {
    for (const int number : numbers) PutView(number, width_px, height_px, 3);
    return folder_ / "numbered";
  }
  void PutView(int number, int width_px, int height_px, int channels) {
    std::vector<unsigned char> png;
    const cv::Mat grey(height_px, width_px, CV_8UC(channels),
                       cv::Scalar(number, number, number, 255));
    cv::imencode(".png", grey, png);
    char name[40];
    std::snprintf(name, sizeof name, "numbered/input_Cam%03d.png", number);
    folder_.Put(name, {png.begin(), png.end()});
  }
  static std::vector<int> Square(int edge) {
    std::vector<int> numbers;
    for (int i = 0; i < edge * edge; ++i) numbers.push_back(i);
    return numbers;
  }
  // The 3 x 2 views in a numbering of 9 a row: u from 2, v from 1.
  static std::vector<int> Rectangle() { return {11, 12, 13, 20, 21, 22}; }

  static std::string Refusal(const std::string& folder, const LightFieldReading& reading = {}) {
    const std::string message = ErrorOf([&] { ReadLightField(folder, reading); });
    EXPECT_THAT(message, HasSubstr(folder));
    EXPECT_EQ(message.find('\n'), std::string::npos);
    return message;
  }

  TemporaryFolder folder_;
};

// The encoded level of a point of a view.
int LevelOf(const model::LightField& light_field, int k, int l) {
  const double light = model::ViewImage(light_field, k, l).values.front();
  return static_cast<int>(std::lround(255 * light_field.transfer.Encode(light)));
}

TEST_F(LightFieldFolder, TiffKeepsEveryBit) {
  for (const int channels : {1, 3}) {
    model::LightField light_field = Relative(3, 2, channels, -2, 5);
    light_field.values[4] = -0.0F;
    light_field.values[5] = 1e-42F;
    light_field.transfer = model::TransferCurve::Gamma(2.2);
    std::size_t clipped = 1;
    const model::LightField back =
        ReadLightField(Write(light_field, ViewFormat::kTiff, &clipped), {});
    EXPECT_EQ(clipped, 0U);
    EXPECT_TRUE(SameBits(back.values, light_field.values));
    EXPECT_EQ(back.u_count, 3);
    EXPECT_EQ(back.v_count, 2);
    EXPECT_EQ(back.s_count, kS);
    EXPECT_EQ(back.t_count, kT);
    EXPECT_EQ(back.channels, channels);
    EXPECT_TRUE((back.weights == light_field.weights).all());
    EXPECT_EQ(back.transfer, light_field.transfer);
    EXPECT_EQ(back.origin.method, "dibr");
    EXPECT_THAT(back.present, IsEmpty());
    EXPECT_FALSE(back.camera);
  }
}

TEST_F(LightFieldFolder, BandsThatAreNoColoursAreNotWritten) {
  for (const ViewFormat format : {ViewFormat::kPng, ViewFormat::kTiff}) {
    for (const int channels : {2, 4, 5}) {
      EXPECT_THAT(ErrorOf([&] { Write(Relative(3, 2, channels), format); }),
                  AllOf(HasSubstr("channels is " + std::to_string(channels)),
                        HasSubstr("1 (grey) or 3 (RGB)")));
    }
  }
}

// A round trip alone would not detect red and blue exchanged twice.
TEST_F(LightFieldFolder, TiffHasRedFirst) {
  model::LightField light_field = model::MakeLightField(1, 1, 1, 1, 3);
  light_field.values = {0.25F, 0.5F, 0.75F};
  const std::string tiff =
      ContentOf(Write(light_field, ViewFormat::kTiff) + "/views/view_00_00.tiff");
  std::string pixel(12, '\0');
  std::memcpy(pixel.data(), light_field.values.data(), pixel.size());
  EXPECT_NE(tiff.find(pixel), std::string::npos);
}

TEST_F(LightFieldFolder, PngIsWithinHalfALevel) {
  model::LightField light_field = Relative(3, 2, 3);
  std::size_t clipped = 1;
  const std::string folder = Write(light_field, ViewFormat::kPng, &clipped);
  EXPECT_EQ(clipped, 0U);
  const model::LightField back = ReadLightField(folder, {});
  ASSERT_EQ(back.values.size(), light_field.values.size());
  for (std::size_t i = 0; i < back.values.size(); ++i) {
    const double stored = light_field.transfer.Encode(light_field.values[i]);
    EXPECT_NEAR(light_field.transfer.Encode(back.values[i]), stored, 0.501 / 65535);
  }
  EXPECT_EQ(ReadImageFile(folder + "/views/view_01_02.png").type(), CV_16UC3);
}

TEST_F(LightFieldFolder, PngReportsWhatItClips) {
  model::LightField light_field = Relative(2, 1, 1);
  light_field.values[0] = 1.5F;
  light_field.values[1] = -0.01F;
  light_field.values[2] = std::nanf("");
  light_field.values[3] = 1.000001F;  // less than half a level
  std::size_t clipped = 0;
  Write(light_field, ViewFormat::kPng, &clipped);
  EXPECT_EQ(clipped, 3U);
}

TEST_F(LightFieldFolder, TheCameraComesWithIt) {
  const model::LightField light_field = WithCamera(3, 3);
  const model::LightField back = ReadLightField(Write(light_field, ViewFormat::kTiff), {});
  ASSERT_TRUE(back.camera && back.grid);
  EXPECT_EQ(back.camera->image_distance_mm(), 15.94);
  EXPECT_EQ(back.camera->sensor.principal_point_px, Eigen::Vector2d(2.75, 1.5));
  EXPECT_EQ(back.grid->planes.plane_spacing_mm, light_field.grid->planes.plane_spacing_mm);
  EXPECT_EQ(back.grid->u_step_mm, light_field.grid->u_step_mm);
  EXPECT_EQ(back.grid->s_step_mm, light_field.grid->s_step_mm);
  EXPECT_EQ(back.landing_step_px, light_field.landing_step_px);
  EXPECT_THAT(folder_.Entries(), ElementsAre("lf"));
}

TEST_F(LightFieldFolder, ACameraOfAnotherSizeIsRefused) {
  const std::string folder = Write(WithCamera(3, 3), ViewFormat::kTiff);
  const std::string path = folder + "/camera.yaml";
  std::string yaml = ContentOf(path);
  yaml.replace(yaml.find("width_px: 6"), 11, "width_px: 7");
  std::ofstream(path) << yaml;
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("camera.yaml"), HasSubstr("7x5"), HasSubstr("6x5")));
}

TEST_F(LightFieldFolder, MissingViewsNeedAWord) {
  model::LightField light_field = Relative(3, 3, 1);
  light_field.present.assign(9, true);
  light_field.present[3 * 1 + 2] = false;
  for (std::size_t i = 0; i < light_field.view_size(); ++i)
    light_field.values[light_field.ViewStart(0, 2, 1) + i] = 0;
  const std::string folder = Write(light_field, ViewFormat::kTiff);
  EXPECT_FALSE(fs::exists(folder + "/views/view_01_02.tiff"));
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("view (2, 1)"), HasSubstr("the option sparse")));
  LightFieldReading reading;
  reading.sparse = true;
  const model::LightField back = ReadLightField(folder, reading);
  EXPECT_EQ(back.present, light_field.present);
  EXPECT_TRUE(SameBits(back.values, light_field.values));
}

TEST_F(LightFieldFolder, InnerViewsAndCropAreThoseOfTheWhole) {
  const model::LightField whole = WithCamera(5, 3);
  const std::string folder = Write(whole, ViewFormat::kTiff);
  LightFieldReading reading;
  reading.u_count = 3;
  reading.v_count = 1;
  reading.crop = model::PixelRect{2, 1, 3, 4};
  const model::LightField part = ReadLightField(folder, reading);
  const model::LightField expected =
      model::CropViews(model::InnerViews(whole, 3, 1), *reading.crop);
  EXPECT_TRUE(SameBits(part.values, expected.values));
  EXPECT_EQ(part.camera->sensor.principal_point_px, Eigen::Vector2d(0.75, 0.5));
  EXPECT_TRUE(part.weights.isApprox(expected.weights, 1e-15));
  reading.u_count = 2;
  EXPECT_THAT(Refusal(folder, reading), HasSubstr("odd"));
  reading.u_count = 0;
  reading.crop = model::PixelRect{4, 0, 3, 1};
  EXPECT_THAT(Refusal(folder, reading), HasSubstr("6x5"));
}

TEST_F(LightFieldFolder, NamesTheViewThatIsGoneOrBroken) {
  const model::LightField light_field = Relative(3, 3, 3);
  for (const ViewFormat format : {ViewFormat::kPng, ViewFormat::kTiff}) {
    const std::string folder = Write(light_field, format);
    const std::string view =
        folder + "/views/view_02_01" + (format == ViewFormat::kPng ? ".png" : ".tiff");
    const std::string whole = ContentOf(view);
    const auto message_with = [&](const std::string& bytes) {
      std::ofstream(view, std::ios::binary) << bytes;
      const std::string message = Refusal(folder);
      EXPECT_THAT(message, AllOf(StartsWith("view (1, 2): "), HasSubstr("view_02_01")));
      return message;
    };
    message_with(whole.substr(0, whole.size() / 2));
    message_with("no image");
    EXPECT_THAT(message_with(""), HasSubstr("cannot be decoded"));
    fs::remove(view);
    EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("view (1, 2)"), HasSubstr("No such file")));
  }
}

TEST_F(LightFieldFolder, NamesTheViewOfAnotherSizeOrKind) {
  const std::string folder = Write(Relative(3, 3, 3), ViewFormat::kPng);
  const std::string other = folder_ / "other";
  const auto message_with = [&](int width_px, int height_px, int channels) {
    const model::EncodedImage image{
        width_px, height_px, channels, 16,
        std::vector<std::uint16_t>(static_cast<std::size_t>(width_px * height_px * channels))};
    std::ofstream(folder + "/views/view_00_02.png", std::ios::binary) << EncodePng(image);
    return Refusal(folder);
  };
  EXPECT_THAT(message_with(5, 6, 3),
              AllOf(HasSubstr("view (2, 0)"), HasSubstr("5x6"), HasSubstr("6x5")));
  EXPECT_THAT(message_with(6, 5, 1), AllOf(HasSubstr("view (2, 0)"), HasSubstr("1 channel")));
  const std::string tiff = Write(Relative(3, 3, 3), ViewFormat::kTiff);
  std::vector<unsigned char> bytes;
  cv::imencode(".tiff", cv::Mat(kT, kS, CV_16UC3, cv::Scalar(1, 2, 3)), bytes);
  folder_.Put("lf/views/view_00_00.tiff", {bytes.begin(), bytes.end()});
  EXPECT_THAT(Refusal(tiff), AllOf(HasSubstr("view (0, 0)"), HasSubstr("16 bits")));
}

TEST_F(LightFieldFolder, WhatIsNoLightFieldIsRefused) {
  EXPECT_THAT(Refusal(folder_ / "none"), HasSubstr("does not exist"));
  EXPECT_THAT(Refusal(folder_.Put("file", "x")), HasSubstr("is a file"));
  folder_.Put("empty/readme.txt");
  EXPECT_THAT(Refusal(folder_ / "empty"),
              AllOf(HasSubstr("lightfield.yaml"), HasSubstr("input_Cam000.png")));
  folder_.Put("broken/lightfield.yaml", "schema: thicklens/camera/2\n");
  EXPECT_THAT(Refusal(folder_ / "broken"), HasSubstr("lightfield.yaml:1:9"));
}

TEST_F(LightFieldFolder, AnInvalidLightFieldIsNotWritten) {
  model::LightField light_field = Relative(3, 3, 1);
  light_field.weights *= 2;
  EXPECT_THAT(ErrorOf([&] { Write(light_field, ViewFormat::kPng); }), HasSubstr("weights"));
  EXPECT_THAT(ErrorOf([&] { WriteHci(light_field); }), HasSubstr("weights"));
  EXPECT_THAT(folder_.Entries(), IsEmpty());
}

TEST_F(LightFieldFolder, HciIsWithinHalfALevelOfSrgb) {
  model::LightField light_field = Relative(3, 2, 3);
  light_field.transfer = model::TransferCurve::Linear();  // the layout is sRGB none the less
  const std::string folder = WriteHci(light_field);
  const model::LightField back = ReadLightField(folder, {});
  EXPECT_EQ(back.u_count, 3);
  EXPECT_EQ(back.v_count, 2);
  EXPECT_EQ(back.origin.method, "imported");
  EXPECT_EQ(back.transfer, model::TransferCurve::Srgb());
  EXPECT_TRUE(back.weights.isApproxToConstant(1.0 / 6, 1e-14));
  ASSERT_EQ(back.values.size(), light_field.values.size());
  for (std::size_t i = 0; i < back.values.size(); ++i) {
    EXPECT_NEAR(model::TransferCurve::Srgb().Encode(back.values[i]),
                model::TransferCurve::Srgb().Encode(light_field.values[i]), 0.501 / 255);
  }
  EXPECT_THAT(ContentOf(folder + "/parameters.cfg"),
              AllOf(HasSubstr("\nnum_cams_x = 3\n"), HasSubstr("\nnum_cams_y = 2\n"),
                    HasSubstr("\nimage_resolution_x_px = 6\n"), Not(HasSubstr("_mm")),
                    Not(HasSubstr("_m "))));
}

double ParameterOf(const std::string& config, const std::string& key) {
  std::istringstream lines(config);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(key + " = ", 0) == 0) return std::stod(line.substr(key.size() + 3));
  }
  ADD_FAILURE() << key << " is missing";
  return 0;
}

// The benchmark's own formula from depth to disparity agrees with the camera.
TEST_F(LightFieldFolder, HciParametersGiveTheCamerasDisparity) {
  const model::LightField light_field = WithCamera(3, 3);
  const std::string config = ContentOf(WriteHci(light_field) + "/parameters.cfg");
  const double aperture_step_mm = light_field.grid->u_step_mm;  // UV lies on the aperture
  for (const double depth_mm : {400.0, 1000.0, 5000.0}) {
    const double pinhole_px = ParameterOf(config, "baseline_mm") *
                              ParameterOf(config, "focal_length_mm") *
                              (1 / depth_mm - 1e-3 / ParameterOf(config, "focus_distance_m")) * kS /
                              ParameterOf(config, "sensor_size_mm");
    const double expected_px = model::DisparityPx(*light_field.camera, aperture_step_mm, depth_mm);
    EXPECT_NEAR(pinhole_px, expected_px, 1e-9 * std::abs(expected_px));
  }
}

TEST_F(LightFieldFolder, HciNumbersGoAlongRows) {
  const model::LightField light_field = ReadLightField(PutNumbered(Square(4)), {});
  ASSERT_EQ(light_field.u_count, 4);
  ASSERT_EQ(light_field.v_count, 4);
  EXPECT_EQ(LevelOf(light_field, 3, 0), 3);
  EXPECT_EQ(LevelOf(light_field, 1, 2), 9);
}

TEST_F(LightFieldFolder, ARectangleInsideTheGridIsALightField) {
  const std::string folder = PutNumbered(Rectangle());
  LightFieldReading reading;
  reading.grid = 9;
  const model::LightField by_option = ReadLightField(folder, reading);
  folder_.Put("numbered/parameters.cfg", "[extrinsics]\r\nnum_cams_y = 9\r\n num_cams_x = 9 \r\n");
  const model::LightField by_file = ReadLightField(folder, {});
  for (const model::LightField& light_field : {by_option, by_file}) {
    ASSERT_EQ(light_field.u_count, 3);
    ASSERT_EQ(light_field.v_count, 2);
    EXPECT_EQ(LevelOf(light_field, 0, 0), 11);
    EXPECT_EQ(LevelOf(light_field, 2, 1), 22);
    EXPECT_THAT(light_field.present, IsEmpty());
  }
}

TEST_F(LightFieldFolder, TheGridIsNotGuessed) {
  const std::string folder = PutNumbered(Rectangle());
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("6 views"), HasSubstr("the option grid")));
  LightFieldReading reading;
  reading.grid = 8;  // 13 and 20 are at other positions then
  EXPECT_THAT(Refusal(folder, reading), HasSubstr("missing: input_Cam"));
  // The number of views is a square, but their numbering is not that of a square.
  EXPECT_THAT(Refusal(PutNumbered({11, 12, 20, 21})), HasSubstr("the option grid"));
  folder_.Put("numbered/parameters.cfg", "[extrinsics]\nnum_cams_x = nine\n");
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("parameters.cfg:2"), HasSubstr("'nine'")));
  folder_.Put("numbered/parameters.cfg", "[extrinsics]\n");
  EXPECT_THAT(Refusal(folder),
              AllOf(HasSubstr("num_cams_x is missing"), HasSubstr("the option grid")));
}

TEST_F(LightFieldFolder, AMissingHciViewIsNamedUnlessSparse) {
  const std::string folder = PutNumbered({11, 12, 13, 20, 22, 31});
  LightFieldReading reading;
  reading.grid = 9;
  EXPECT_THAT(Refusal(folder, reading),
              AllOf(HasSubstr("input_Cam021.png"), HasSubstr("input_Cam029.png"),
                    HasSubstr("input_Cam030.png"), HasSubstr("the option sparse")));
  reading.sparse = true;
  const model::LightField light_field = ReadLightField(folder, reading);
  EXPECT_EQ(light_field.present,
            (std::vector<bool>{true, true, true, true, false, true, false, false, true}));
  EXPECT_EQ(light_field.weights(1, 1), 0);
  EXPECT_DOUBLE_EQ(light_field.weights(2, 2), 1.0 / 6);
  EXPECT_EQ(LevelOf(light_field, 2, 2), 31);
  EXPECT_EQ(LevelOf(light_field, 1, 1), 0);
}

TEST_F(LightFieldFolder, NamesTheHciViewThatDoesNotFit) {
  const std::string folder = PutNumbered(Square(3));
  PutView(5, 3, 3, 3);
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("view (2, 1)"), HasSubstr("3x3"), HasSubstr("4x3")));
  PutView(5, 4, 3, 1);
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("view (2, 1)"), HasSubstr("1 channel")));
  PutView(5, 4, 3, 4);  // alpha is not light
  EXPECT_EQ(LevelOf(ReadLightField(folder, {}), 2, 1), 5);
  const std::string png = ContentOf(folder + "/input_Cam005.png");
  folder_.Put("numbered/input_Cam005.png", png.substr(0, png.size() - 20));
  EXPECT_THAT(Refusal(folder), AllOf(HasSubstr("view (2, 1)"), HasSubstr("input_Cam005.png"),
                                     HasSubstr("broken PNG")));
  // The inner view alone is asked for, and it is whole.
  LightFieldReading reading;
  reading.u_count = reading.v_count = 1;
  EXPECT_EQ(LevelOf(ReadLightField(folder, reading), 0, 0), 4);
}

TEST_F(LightFieldFolder, OtherFilesAreNoViews) {
  const std::string folder = PutNumbered(Square(2));
  for (const char* name : {"input_Cam3.png", "input_Cam0004.png", "input_Cam-01.png",
                           "input_Cam004.jpg", "input_Cam.png", "gt_disp_lowres.pfm"}) {
    folder_.Put(std::string("numbered/") + name, "none");
  }
  EXPECT_EQ(ReadLightField(folder, {}).u_count, 2);
}

TEST_F(LightFieldFolder, TheBenchmarksOwnFoldersAreNotReplaced) {
  const std::string folder = PutNumbered(Square(2));
  folder_.Put("numbered/parameters.cfg", "[extrinsics]\nnum_cams_x = 2\n");
  EXPECT_THAT(ErrorOf([&] { ClaimHciFolder(folder); }),
              AllOf(HasSubstr(folder), HasSubstr("not replaced")));
  const model::LightField light_field = Relative(3, 3, 1);
  const std::string ours = WriteHci(light_field);
  EXPECT_EQ(ErrorOf([&] { WriteHci(Relative(2, 2, 1)); }), "(no error)");
  EXPECT_FALSE(fs::exists(ours + "/input_Cam004.png"));
  folder_.Put("hci/notes.txt", "mine");
  EXPECT_THAT(ErrorOf([&] { ClaimHciFolder(ours); }), HasSubstr("notes.txt"));
}

// The point at x in the centre view is at x - a d in the view a to the right, and likewise for b
// down.
void ExpectDisparitySign(const model::LightField& light_field, const model::RawDepthMap& map) {
  const int centre = light_field.u_count / 2;
  const auto difference = [&](int a, int b, double sign) {
    const model::LinearImage middle = model::ViewImage(light_field, centre, centre);
    const model::LinearImage view = model::ViewImage(light_field, centre + a, centre + b);
    double sum = 0;
    int count = 0;
    for (int y = 20; y < 492; ++y) {
      for (int x = 20; x < 492; ++x) {
        const double d = map.values[static_cast<std::size_t>(y * 512 + x)];
        const int from_x = static_cast<int>(std::lround(x - sign * a * d));
        const int from_y = static_cast<int>(std::lround(y - sign * b * d));
        sum += std::abs(middle.at(x, y, 1) - view.at(from_x, from_y, 1));
        ++count;
      }
    }
    return sum / count;
  };
  for (const auto& [a, b] : {std::array<int, 2>{2, 0}, std::array<int, 2>{0, 2}})
    EXPECT_LT(2 * difference(a, b, 1), difference(a, b, -1)) << a << ", " << b;
}

TEST(LightFieldData, ReadsAntinous) {
  const std::string folder = std::string(THICKLENS_SHARED_DATA_DIR) + "/lf_antinous";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  EXPECT_THAT(ErrorOf([&] { ReadLightField(folder, {}); }), HasSubstr("the option grid"));
  LightFieldReading reading;
  reading.grid = 9;
  const model::LightField light_field = ReadLightField(folder, reading);
  EXPECT_EQ(light_field.u_count, 7);
  EXPECT_EQ(light_field.v_count, 7);
  EXPECT_EQ(light_field.s_count, 512);
  EXPECT_EQ(light_field.channels, 3);
  const model::EncodedImage centre = ToEncodedImage(ReadImageFile(folder + "/input_Cam040.png"));
  EXPECT_EQ(model::ToEncoded(model::ViewImage(light_field, 3, 3), light_field.transfer, 8).values,
            centre.values);
  ExpectDisparitySign(light_field, ReadDepthMap(folder + "/gt_disp_lowres.pfm"));
}

TEST(LightFieldData, ReadsBackgammonByItsParameters) {
  const std::string folder = std::string(THICKLENS_SHARED_DATA_DIR) + "/lf_backgammon";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  LightFieldReading reading;
  reading.crop = model::PixelRect{100, 200, 64, 32};
  const model::LightField light_field = ReadLightField(folder, reading);
  EXPECT_EQ(light_field.u_count, 5);
  EXPECT_EQ(light_field.v_count, 5);
  const model::EncodedImage view =
      model::CropImage(ToEncodedImage(ReadImageFile(folder + "/input_Cam033.png")), *reading.crop);
  EXPECT_EQ(model::ToEncoded(model::ViewImage(light_field, 4, 1), light_field.transfer, 8).values,
            view.values);
}

}  // namespace
}  // namespace thicklens::io
