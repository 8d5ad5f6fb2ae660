#include "thicklens/io/depth_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "tools/io/image_library.h"
#include "tools/io/png_check.h"
#include "tools/support/image_file_bytes.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;
using tools::Encoded;

// 1, 2, 3 in the lower row, 4, 5, 6 in the upper one; big endian.
const std::string kBigEndianValues(
    "\x3F\x80\x00\x00\x40\x00\x00\x00\x40\x40\x00\x00"
    "\x40\x80\x00\x00\x40\xA0\x00\x00\x40\xC0\x00\x00",
    24);

std::string Swapped(std::string values) {
  for (std::size_t i = 0; i + 4 <= values.size(); i += 4)
    std::reverse(values.begin() + static_cast<std::ptrdiff_t>(i),
                 values.begin() + static_cast<std::ptrdiff_t>(i) + 4);
  return values;
}

class DepthFileTest : public ::testing::Test {
 protected:
  model::RawDepthMap Read(const std::string& bytes) {
    return ReadDepthMap(folder_.Put("depth", bytes));
  }
  std::string Refusal(const std::string& bytes) {
    const std::string path = folder_.Put("depth", bytes);
    const std::string message = ErrorOf([&] { ReadDepthMap(path); });
    EXPECT_THAT(message, StartsWith(path));
    EXPECT_EQ(message.find('\n'), std::string::npos);
    return message;
  }

  TemporaryFolder folder_;
};

// A TIFF file of 3 x 2 px of 16 bits, little endian: `photometric` 0 is MINISWHITE, 1 MINISBLACK;
// `no_data` is the text of the tag GDAL_NODATA, absent if it is empty.
std::string SmallTiff(int photometric, std::string no_data) {
  const auto number = [](std::size_t value, int bytes) {
    std::string text;
    for (int i = 0; i < bytes; ++i, value >>= 8) text += static_cast<char>(value & 0xFF);
    return text;
  };
  constexpr std::size_t kShort = 3, kLong = 4, kAscii = 2;
  if (!no_data.empty()) no_data += '\0';
  while (!no_data.empty() && no_data.size() < 6) no_data += '\0';  // longer than an entry holds
  struct Entry {
    std::size_t tag, type, count, value;
  };
  std::vector<Entry> entries = {{256, kShort, 1, 3},
                                {257, kShort, 1, 2},
                                {258, kShort, 1, 16},
                                {259, kShort, 1, 1},
                                {262, kShort, 1, static_cast<std::size_t>(photometric)},
                                {273, kLong, 1, 8},
                                {277, kShort, 1, 1},
                                {278, kShort, 1, 2},
                                {279, kLong, 1, 12}};
  if (!no_data.empty()) entries.push_back({42113, kAscii, no_data.size(), 20});
  std::string values;
  for (const std::size_t value : {885U, 900U, 1000U, 1100U, 1152U, 9999U})
    values += number(value, 2);
  const std::size_t directory = 8 + values.size() + no_data.size();
  std::string bytes =
      "II" + number(42, 2) + number(directory, 4) + values + no_data + number(entries.size(), 2);
  for (const Entry& entry : entries)
    bytes += number(entry.tag, 2) + number(entry.type, 2) + number(entry.count, 4) +
             number(entry.value, 4);
  return bytes + number(0, 4);
}

TEST_F(DepthFileTest, ATiffWhoseZeroIsWhiteIsReadAsStored) {
  for (const int photometric : {0, 1}) {
    const DepthFile file = ReadDepthFile(folder_.Put("d.tif", SmallTiff(photometric, "")));
    EXPECT_THAT(file.map.values, ElementsAre(885, 900, 1000, 1100, 1152, 9999));
    if (photometric == 0) {
      EXPECT_THAT(file.notes, ElementsAre(HasSubstr("MINISWHITE")));
    } else {
      EXPECT_THAT(file.notes, ElementsAre());
    }
  }
}

TEST_F(DepthFileTest, AStatedValueWithoutDataIsAHole) {
  const DepthFile file = ReadDepthFile(folder_.Put("d.tif", SmallTiff(1, "9999")));
  EXPECT_EQ(file.map.values[4], 1152);
  EXPECT_TRUE(std::isnan(file.map.values[5]));
  EXPECT_THAT(file.notes, ElementsAre(HasSubstr("states 9999 as its value without data")));
  for (const char* other : {"none", "nan", "0", "-32768"})
    EXPECT_EQ(ReadDepthFile(folder_.Put("d.tif", SmallTiff(1, other))).map.values[5], 9999)
        << other;
}

TEST_F(DepthFileTest, PfmOfEitherByteOrderHasItsRowsBottomUp) {
  for (const std::string& bytes :
       {"Pf\n3 2\n1.0\n" + kBigEndianValues, "Pf\n3 2\n-1.0\n" + Swapped(kBigEndianValues),
        "Pf 3\n2\t-0.0039\n" + Swapped(kBigEndianValues), "Pf\r\n3 2\r\n1\n" + kBigEndianValues}) {
    const model::RawDepthMap map = Read(bytes);
    EXPECT_EQ(map.width_px, 3);
    EXPECT_EQ(map.height_px, 2);
    EXPECT_THAT(map.values, ElementsAre(4, 5, 6, 1, 2, 3));
    EXPECT_FALSE(map.integer);
  }
}

// A value may look like white space: there is exactly one such byte between the scale and the
// values.
TEST_F(DepthFileTest, PfmValuesMayBeginWithWhiteSpace) {
  EXPECT_THAT(Read(std::string("Pf\n1 1\n-1\n\x0A\x20\x0D\x40", 14)).values,
              ElementsAre(::testing::FloatNear(2.2051F, 1e-3F)));
}

TEST_F(DepthFileTest, PfmRoundTripKeepsEveryBit) {
  model::RawDepthMap map{2, 3, {}, false};
  map.values = {0.1F,
                -0.0F,
                std::numeric_limits<float>::infinity(),
                std::numeric_limits<float>::denorm_min(),
                std::nanf("3"),
                -1e30F};
  const model::RawDepthMap back = Read(EncodePfm(map));
  EXPECT_EQ(back.width_px, 2);
  EXPECT_EQ(back.height_px, 3);
  ASSERT_EQ(back.values.size(), 6U);
  EXPECT_EQ(std::memcmp(back.values.data(), map.values.data(), 6 * sizeof(float)), 0);
}

TEST_F(DepthFileTest, ABrokenPfmIsRefused) {
  EXPECT_THAT(Refusal("Pf\n3 2\n1.0\n" + kBigEndianValues.substr(0, 23)),
              AllOf(HasSubstr("23 bytes"), HasSubstr("3x2"), HasSubstr("24")));
  EXPECT_THAT(Refusal("Pf\n3 2\n1.0\n" + kBigEndianValues + "x"), HasSubstr("25 bytes"));
  EXPECT_THAT(Refusal("PF\n1 1\n1.0\n" + kBigEndianValues.substr(0, 12)),
              HasSubstr("three channels"));
  EXPECT_THAT(Refusal("Pf\n3 0\n1.0\n"), HasSubstr("found '0'"));
  EXPECT_THAT(Refusal("Pf\n3.5 2\n1.0\n"), HasSubstr("found '3.5'"));
  EXPECT_THAT(Refusal("Pf\n-3 2\n1.0\n"), HasSubstr("found '-3'"));
  EXPECT_THAT(Refusal("Pf\n3 99999999999\n1.0\n"), HasSubstr("found '99999999999'"));
  EXPECT_THAT(Refusal("Pf\n3 2\n0\n" + kBigEndianValues), HasSubstr("found '0'"));
  EXPECT_THAT(Refusal("Pf\n3 2\nnan\n" + kBigEndianValues), HasSubstr("found 'nan'"));
  EXPECT_THAT(Refusal("Pf\n3 2\nx\n" + kBigEndianValues), HasSubstr("found 'x'"));
  EXPECT_THAT(Refusal("Pf\n3 2\n1.0"), HasSubstr("broken PFM"));
  EXPECT_THAT(Refusal("Pf\n3"), HasSubstr("broken PFM"));
  EXPECT_THAT(Refusal("Pf"), HasSubstr("broken PFM"));
}

TEST_F(DepthFileTest, IntegerImagesAreReadAsTheyAre) {
  const cv::Mat shallow = (cv::Mat_<unsigned char>(2, 2) << 0, 1, 200, 255);
  const cv::Mat deep = (cv::Mat_<unsigned short>(1, 3) << 0, 5000, 65535);
  const model::RawDepthMap from_shallow = Read(Encoded(shallow, ".png"));
  EXPECT_THAT(from_shallow.values, ElementsAre(0, 1, 200, 255));
  EXPECT_TRUE(from_shallow.integer);
  for (const char* format : {".png", ".tiff"}) {
    const model::RawDepthMap map = Read(Encoded(deep, format));
    EXPECT_EQ(map.width_px, 3);
    EXPECT_EQ(map.height_px, 1);
    EXPECT_THAT(map.values, ElementsAre(0, 5000, 65535));
    EXPECT_TRUE(map.integer);
  }
}

TEST_F(DepthFileTest, FloatImagesAreReadAsTheyAre) {
  const cv::Mat depth = (cv::Mat_<float>(2, 2) << 0.1F, -3.0F, 1e-30F, 1e30F);
  for (const std::string& format : {std::string(".tiff"), std::string(".exr")}) {
    if (format == ".exr" && !io::HasImageLibrary()) continue;
    const std::string bytes =
        Encoded(depth, format, {cv::IMWRITE_EXR_TYPE, cv::IMWRITE_EXR_TYPE_FLOAT});
    const model::RawDepthMap map = Read(bytes);
    EXPECT_THAT(map.values, ElementsAre(0.1F, -3.0F, 1e-30F, 1e30F)) << format;
    EXPECT_FALSE(map.integer);
  }
}

// The files are those of image_file_test.cc; an EXR file may have other channels besides Z.
TEST_F(DepthFileTest, EverySampleTypeIsRead) {
  const auto file = [](const std::string& name) {
    return std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/" + name;
  };
  for (const char* name : {"f16.tif", "f32.tif", "f64.tif"}) {
    const model::RawDepthMap map = ReadDepthMap(file(name));
    EXPECT_THAT(map.values.front(), -5.5F) << name;
    EXPECT_FALSE(map.integer) << name;
  }
  const model::RawDepthMap wide = ReadDepthMap(file("u32.tif"));
  EXPECT_EQ(wide.values.front(), 167050000.0F);
  EXPECT_TRUE(wide.integer);
  EXPECT_EQ(ReadDepthMap(file("i16.tif")).values.front(), -27430);
  EXPECT_EQ(ReadDepthMap(file("u12.pgm")).values.front(), 160);  // its maximum is 4095
  if (!io::HasImageLibrary()) return;
  for (const char* name : {"z.exr", "layer_z.exr", "mixed.exr"})
    EXPECT_EQ(ReadDepthMap(file(name)).values.front(), 102.5F) << name;
}

TEST_F(DepthFileTest, WhatIsNoDepthMapIsRefused) {
  const cv::Mat colour(2, 2, CV_16UC3, cv::Scalar(1, 2, 3));
  EXPECT_THAT(Refusal(Encoded(colour, ".png")),
              AllOf(HasSubstr("16-bit values in 3 channel"), HasSubstr("one channel"),
                    HasSubstr("its channels differ")));
  EXPECT_THAT(Refusal(Encoded(colour, ".tiff")), HasSubstr("3 channel"));
  if (io::HasImageLibrary()) {
    EXPECT_THAT(Refusal(Encoded(cv::Mat(2, 2, CV_32FC3, cv::Scalar(1, 2, 3)), ".exr")),
                HasSubstr("3 channel"));
  }
  EXPECT_THAT(Refusal("GIF89a"),
              AllOf(HasSubstr("PFM, NPY, PNG, PGM, TIFF, EXR or JPEG"), HasSubstr("found GIF")));
  EXPECT_THAT(Refusal("a text"), HasSubstr("not a depth map"));
  EXPECT_THAT(Refusal(""), HasSubstr("not a depth map"));
  EXPECT_THAT(ErrorOf([&] { ReadDepthMap(folder_ / "none.pfm"); }), HasSubstr("none.pfm"));
  EXPECT_THAT(ErrorOf([&] { ReadDepthMap(folder_.path()); }), HasSubstr("is a folder"));
}

TEST_F(DepthFileTest, EqualChannelsAreOneMap) {
  const cv::Mat grey = (cv::Mat_<unsigned short>(1, 3) << 7, 0, 65535);
  cv::Mat rgb, rgba;
  cv::merge(std::vector<cv::Mat>{grey, grey, grey}, rgb);
  const cv::Mat opaque(1, 3, CV_16U, cv::Scalar(65535));
  cv::merge(std::vector<cv::Mat>{grey, grey, grey, opaque}, rgba);
  for (const cv::Mat& image : {rgb, rgba}) {
    const std::string path = folder_.Put("depth", Encoded(image, ".png"));
    const DepthFile file = ReadDepthFile(path);
    EXPECT_THAT(file.map.values, ElementsAre(7, 0, 65535));
    EXPECT_TRUE(file.map.integer);
    EXPECT_EQ(file.map.largest_of_type, 65535);
    ASSERT_FALSE(file.notes.empty());
    EXPECT_THAT(file.notes.front(), HasSubstr("3 channels"));
  }
  // PF: the same in floats.
  const std::string three = kBigEndianValues.substr(0, 4);
  EXPECT_THAT(Read("PF\n1 1\n1.0\n" + three + three + three).values, ElementsAre(1));
}

TEST_F(DepthFileTest, TransparentPixelsAreHoles) {
  const cv::Mat grey = (cv::Mat_<unsigned char>(1, 3) << 7, 8, 9);
  const cv::Mat alpha = (cv::Mat_<unsigned char>(1, 3) << 255, 0, 1);
  cv::Mat rgba;
  cv::merge(std::vector<cv::Mat>{grey, grey, grey, alpha}, rgba);
  const model::RawDepthMap map = Read(Encoded(rgba, ".png"));
  EXPECT_EQ(map.values[0], 7);
  EXPECT_TRUE(std::isnan(map.values[1]));
  EXPECT_EQ(map.values[2], 9);
}

// OpenCV draws the images; the reader has tables of the same maps, so that the share of the
// pixels on the map tests the decision and not the tables.
TEST_F(DepthFileTest, APictureInFalseColoursIsNamed) {
  cv::Mat ramp(16, 256, CV_8U);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x)
      ramp.at<unsigned char>(y, x) = static_cast<unsigned char>(x);
  }
  const std::vector<std::pair<int, std::string>> maps = {{cv::COLORMAP_JET, "'jet'"},
                                                         {cv::COLORMAP_VIRIDIS, "'viridis'"},
                                                         {cv::COLORMAP_MAGMA, "'magma'"},
                                                         {cv::COLORMAP_TURBO, "'turbo'"}};
  for (const auto& [code, name] : maps) {
    cv::Mat image;
    cv::applyColorMap(ramp, image, code);
    EXPECT_THAT(
        Refusal(Encoded(image, ".png")),
        AllOf(HasSubstr("it is an image in the colours of the map " + name), HasSubstr("100.0 %")));
    EXPECT_THAT(Refusal(Encoded(image, ".jpg")), HasSubstr(name));
  }
  cv::Mat noise(64, 64, CV_8UC3);
  cv::RNG random(5);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_THAT(Refusal(Encoded(noise, ".png")),
              AllOf(HasSubstr("no known colour map"), HasSubstr("R + 256.0*G + 65536.0*B")));
}

struct ColoursOfMap {
  std::string name;
  std::vector<cv::Vec3b> colours;  // red first
};

// The colours are those of matplotlib 3.6.3, get_cmap(NAME)(i) for i = 5, 25, .., 245.
TEST_F(DepthFileTest, MapsOfMatplotlibAreNamed) {
  const std::vector<ColoursOfMap> maps = {{"Spectral",
                                           {{169, 13, 69},
                                            {212, 61, 79},
                                            {237, 98, 70},
                                            {249, 145, 83},
                                            {253, 191, 111},
                                            {254, 228, 145},
                                            {255, 252, 186},
                                            {238, 248, 164},
                                            {202, 234, 158},
                                            {153, 214, 164},
                                            {100, 192, 166},
                                            {59, 146, 185},
                                            {77, 101, 173}}},
                                          {"Blues",
                                           {{243, 248, 254},
                                            {227, 238, 249},
                                            {212, 228, 244},
                                            {196, 218, 238},
                                            {171, 208, 230},
                                            {143, 194, 222},
                                            {111, 176, 215},
                                            {84, 159, 205},
                                            {60, 140, 195},
                                            {39, 119, 184},
                                            {22, 99, 170},
                                            {8, 79, 153},
                                            {8, 58, 122}}},
                                          {"coolwarm",
                                           {{64, 85, 200},
                                            {89, 119, 227},
                                            {115, 150, 245},
                                            {143, 177, 254},
                                            {170, 199, 253},
                                            {196, 213, 243},
                                            {218, 220, 224},
                                            {237, 210, 195},
                                            {246, 190, 164},
                                            {246, 163, 133},
                                            {237, 131, 102},
                                            {220, 93, 74},
                                            {195, 46, 49}}},
                                          {"nipy_spectral",
                                           {{47, 0, 53},
                                            {135, 0, 152},
                                            {0, 0, 197},
                                            {0, 122, 221},
                                            {0, 164, 187},
                                            {0, 166, 104},
                                            {0, 180, 0},
                                            {0, 234, 0},
                                            {176, 255, 0},
                                            {247, 221, 0},
                                            {255, 141, 0},
                                            {233, 0, 0},
                                            {204, 44, 44}}},
                                          {"rainbow of matplotlib",
                                           {{118, 16, 255},
                                            {78, 77, 252},
                                            {38, 134, 245},
                                            {2, 183, 235},
                                            {42, 221, 221},
                                            {82, 245, 203},
                                            {122, 255, 183},
                                            {162, 249, 160},
                                            {203, 228, 134},
                                            {242, 194, 107},
                                            {255, 147, 77},
                                            {255, 92, 47},
                                            {255, 31, 16}}}};
  for (const ColoursOfMap& map : maps) {
    cv::Mat image(16, 8 * static_cast<int>(map.colours.size()), CV_8UC3);
    for (int x = 0; x < image.cols; ++x) {
      const cv::Vec3b& colour = map.colours[static_cast<std::size_t>(x / 8)];
      image.col(x).setTo(cv::Scalar(colour[2], colour[1], colour[0]));
    }
    EXPECT_THAT(
        Refusal(Encoded(image, ".png")),
        AllOf(HasSubstr("in the colours of the map '" + map.name + "'"), HasSubstr("100.0 %")));
  }
}

// A grey ramp with a tint of `levels` in blue.
cv::Mat TintedRamp(int levels) {
  cv::Mat image(64, 128, CV_8UC3);
  for (int x = 0; x < image.cols; ++x)
    image.col(x).setTo(cv::Scalar(x + 40 + levels, x + 40, x + 40));
  return image;
}

TEST_F(DepthFileTest, NearlyGreyIsNoColourMap) {
  EXPECT_THAT(Refusal(Encoded(TintedRamp(6), ".png")),
              AllOf(HasSubstr("its channels differ, but by little"), HasSubstr("at most 6 of 255"),
                    Not(HasSubstr("colours of the map"))));
}

TEST_F(DepthFileTest, ALossyWebpIsReadAsAJpegIs) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "no WebP in this build";
  for (const int quality : {60, 101}) {  // 101: without losses
    const std::string bytes =
        Encoded(TintedRamp(quality > 100 ? 0 : 3), ".webp", {cv::IMWRITE_WEBP_QUALITY, quality});
    const DepthFile file = ReadDepthFile(folder_.Put("depth", bytes));
    EXPECT_NEAR(file.map.values[10], 50, 12);
    EXPECT_EQ(file.is_lossy, quality <= 100);
    ASSERT_EQ(file.warnings.size(), quality > 100 ? 0U : 1U);
    if (quality > 100) continue;
    EXPECT_THAT(file.warnings.front(), HasSubstr("lossy WebP"));
  }
}

TEST_F(DepthFileTest, AJpegIsReadWithAWarning) {
  const std::string path =
      folder_.Put("depth", Encoded(cv::Mat(8, 8, CV_8U, cv::Scalar(9)), ".jpg"));
  const DepthFile file = ReadDepthFile(path);
  EXPECT_EQ(file.map.values.front(), 9);
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings.front(), HasSubstr("JPEG"));
}

TEST_F(DepthFileTest, TheScaleOfPfmIsAppliedExceptForThatOfMiddlebury) {
  const auto first = [&](const std::string& scale, PfmScale use) {
    DepthReading reading;
    reading.pfm_scale = use;
    const std::string path = folder_.Put("depth", "Pf\n3 2\n" + scale + "\n" + kBigEndianValues);
    return ReadDepthFile(path, reading).map.values.front();
  };
  EXPECT_EQ(first("2", PfmScale::kByRule), 8);
  EXPECT_EQ(first("2", PfmScale::kIgnored), 4);
  EXPECT_EQ(first("0.003922", PfmScale::kByRule), 4);
  EXPECT_NEAR(first("0.003922", PfmScale::kApplied), 4.0 / 255, 1e-5);
  EXPECT_EQ(first("1", PfmScale::kApplied), 4);
}

// Three equal channels are one map, and the rule for the scale is that of one channel.
TEST_F(DepthFileTest, TheScaleOfPfmInColourFollowsTheSameRule) {
  const std::string one = kBigEndianValues.substr(0, 4);
  const auto file = [&](const std::string& scale, PfmScale use) {
    DepthReading reading;
    reading.pfm_scale = use;
    return ReadDepthFile(folder_.Put("depth", "PF\n1 1\n" + scale + "\n" + one + one + one),
                         reading);
  };
  const DepthFile applied = file("2", PfmScale::kByRule);
  EXPECT_THAT(applied.map.values, ElementsAre(2));
  EXPECT_THAT(applied.notes, Contains("The header's scale 2 is applied to the values."));
  EXPECT_THAT(applied.description, Not(HasSubstr("not applied")));
  EXPECT_THAT(file("2", PfmScale::kIgnored).map.values, ElementsAre(1));
  EXPECT_THAT(file("0.003922", PfmScale::kByRule).map.values, ElementsAre(1));
}

// LF may be the first byte of a value: the number of bytes decides.
TEST_F(DepthFileTest, PfmLinesMayEndWithCrLf) {
  EXPECT_THAT(Read("Pf\r\n3 2\r\n1.0\r\n" + kBigEndianValues).values,
              ElementsAre(4, 5, 6, 1, 2, 3));
  const std::string begins_with_lf("\n\0\0\0", 4);
  EXPECT_EQ(Read("Pf\r\n1 1\r\n-1.0\r" + begins_with_lf).values.size(), 1U);
}

std::string Npy(const std::string& dictionary, const std::string& values) {
  std::string header = "\x93NUMPY";
  header += '\x01';
  header += '\0';
  header += static_cast<char>(dictionary.size() + 1);
  header += '\0';
  return header + dictionary + "\n" + values;
}

TEST_F(DepthFileTest, NpyOfAnyTypeAndOrderIsRead) {
  const std::string rows = "'fortran_order': False, 'shape': (2, 3), }";
  EXPECT_THAT(Read(Npy("{'descr': '>f4', " + rows, kBigEndianValues)).values,
              ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(Read(Npy("{'descr': '<f4', " + rows, Swapped(kBigEndianValues))).values,
              ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(
      Read(Npy("{'descr': '>f4', 'fortran_order': True, 'shape': (2, 3), }", kBigEndianValues))
          .values,
      ElementsAre(1, 3, 5, 2, 4, 6));
  const model::RawDepthMap bytes =
      Read(Npy("{'descr': '|u1', 'fortran_order': False, 'shape': (1, 2, 2), }", "\1\2\3\xFF"));
  EXPECT_THAT(bytes.values, ElementsAre(1, 2, 3, 255));
  EXPECT_TRUE(bytes.integer);
  EXPECT_EQ(bytes.largest_of_type, 255);
  EXPECT_THAT(Read(Npy("{'descr': '<i2', 'fortran_order': False, 'shape': (1, 2), }",
                       std::string("\xFF\xFF\x00\x01", 4)))
                  .values,
              ElementsAre(-1, 256));
  // Half floats: 1, -2, the smallest one and infinity.
  EXPECT_THAT(Read(Npy("{'descr': '<f2', 'fortran_order': False, 'shape': (2, 2), }",
                       std::string("\x00\x3C\x00\xC0\x01\x00\x00\x7C", 8)))
                  .values,
              ElementsAre(1, -2, 5.9604644775390625e-8F, std::numeric_limits<float>::infinity()));
}

TEST_F(DepthFileTest, NpyWithEqualChannelsIsRead) {
  const auto shape = [](const std::string& sides, const std::string& order = "False") {
    return "{'descr': '|u1', 'fortran_order': " + order + ", 'shape': (" + sides + "), }";
  };
  EXPECT_THAT(Read(Npy(shape("2, 2, 3"), "\1\1\1\2\2\2\3\3\3\4\4\4")).values,
              ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Read(Npy(shape("3, 2, 2"), "\1\2\3\4\1\2\3\4\1\2\3\4")).values,
              ElementsAre(1, 2, 3, 4));
  // In Fortran order the first index runs fastest.
  EXPECT_THAT(Read(Npy(shape("2, 2, 3", "True"), "\1\3\2\4\1\3\2\4\1\3\2\4")).values,
              ElementsAre(1, 2, 3, 4));
  const std::string path =
      folder_.Put("depth", Npy(shape("2, 2, 4"), "\1\1\1\7\2\2\2\7\3\3\3\7\4\4\4\7"));
  const DepthFile file = ReadDepthFile(path);
  EXPECT_THAT(file.map.values, ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(file.notes,
              Contains(HasSubstr("3 channels are equal: they are one map. The fourth")));
  EXPECT_THAT(Refusal(Npy(shape("2, 2, 3"), "\1\1\1\2\2\2\3\3\3\4\4\5")),
              AllOf(HasSubstr("whose channels differ: 4 and 5 at pixel (1, 1)"),
                    HasSubstr("save one of them")));
  EXPECT_THAT(Refusal(Npy(shape("2, 2, 3"), "\1\1\1")), HasSubstr("2x2 px in 3 channels"));
}

// The entries of a ZIP archive's directory, with zeros where this reader looks at nothing.
std::string ZipDirectory(const std::vector<std::string>& entries) {
  std::string bytes("PK\x03\x04");
  for (const std::string& entry : entries) {
    bytes += "PK\x01\x02" + std::string(24, '\0');
    bytes += static_cast<char>(entry.size());
    bytes += std::string(17, '\0') + entry;
  }
  return bytes;
}

TEST_F(DepthFileTest, AnNpzArchiveIsRefusedWithTheRemedy) {
  const std::string two = ZipDirectory({"depth.npy", "mask.npy", "readme.txt"});
  EXPECT_THAT(Refusal(two),
              AllOf(HasSubstr("found an NPZ archive of the arrays depth, mask: save"),
                    HasSubstr("numpy.save('depth.npy', numpy.load('"), HasSubstr("')['depth'])")));
  EXPECT_THAT(Refusal(two.substr(0, 40)), HasSubstr("found a ZIP archive"));
  // Names that are not shown are mentioned.
  const std::string many =
      ZipDirectory({"1.npy", "2.npy", "3.npy", "4.npy", "5.npy", "6.npy", "7.npy"});
  EXPECT_THAT(Refusal(many), HasSubstr("arrays 1, 2, 3, 4, 5, 6, ..: save"));
  EXPECT_THAT(Refusal(ZipDirectory({"a.txt"})), HasSubstr("found a ZIP archive"));
}

TEST_F(DepthFileTest, OtherFilesOfDepthAreRefusedWithTheRemedy) {
  const std::string size("PIEH\3\0\0\0\2\0\0\0", 12);
  const std::pair<std::string, std::string> files[] = {
      {size + kBigEndianValues, "numpy.fromfile('depth', '<f4')[3:].reshape(2, 3))"},
      {size + kBigEndianValues + kBigEndianValues, "[3:].reshape(2, 3, 2)[..., 0])"},
      {"ply\nformat ascii 1.0\n", "project them into the photograph"},
      {"3&2&1&" + kBigEndianValues, "numpy.fromfile('depth', '<f4', offset=6).reshape(2, 3))"},
      {"1.5,2,3\n4,nan,6\n", "numpy.loadtxt('depth', delimiter=',')"},
      {"1 2 3\n4 5 6\n", "numpy.loadtxt('depth'))"},
      {"MATLAB 5.0 MAT-file", "scipy.io.loadmat('depth')['NAME']"},
      {"MATLAB 7.3 MAT-file", "h5py.File('depth')['NAME'][()].T"},
      {"\x89HDF\r\n\x1a\n", "h5py.File('depth')['NAME'][()])"}};
  for (const auto& [bytes, remedy] : files) EXPECT_THAT(Refusal(bytes), HasSubstr(remedy));
  EXPECT_THAT(Refusal("some text"), Not(HasSubstr("loadtxt")));
  EXPECT_THAT(Refusal(size + kBigEndianValues.substr(1)), Not(HasSubstr("fromfile")));
}

TEST_F(DepthFileTest, ABrokenNpyIsRefused) {
  const std::string rows = "'fortran_order': False, 'shape': (2, 3), }";
  EXPECT_THAT(Refusal(Npy("{'descr': '<f4', " + rows, kBigEndianValues.substr(0, 23))),
              AllOf(HasSubstr("23 bytes"), HasSubstr("24 are expected")));
  EXPECT_THAT(Refusal(Npy("{'descr': '<c8', " + rows, kBigEndianValues)), HasSubstr("'<c8'"));
  // A byte 0 is no letter of a type.
  for (const std::string& type : {std::string("\0008", 2), std::string("u\0", 2)})
    EXPECT_THAT(Refusal(Npy("{'descr': '" + type + "', " + rows, "")), HasSubstr("of the type"));
  EXPECT_THAT(Refusal(Npy("{'descr': [('x', '<f4')], " + rows, kBigEndianValues)),
              HasSubstr("structured"));
  EXPECT_THAT(Refusal(Npy("{" + rows, kBigEndianValues)), HasSubstr("'descr'"));
  EXPECT_THAT(Refusal(Npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 3, 2), }", "")),
              HasSubstr("(height, width)"));
  EXPECT_THAT(Refusal(Npy("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,"
                          " 2), }",
                          "")),
              HasSubstr("shape"));
  EXPECT_THAT(
      Refusal(Npy("{'descr': '<f8', 'fortran_order': False, 'shape': (99999, 99999), }", "")),
      HasSubstr("0 bytes"));
  EXPECT_THAT(Refusal("\x93NUMPY\x01"), HasSubstr("header"));
  EXPECT_THAT(Refusal(std::string("\x93NUMPY\x02\0\xFF\xFF\xFF\xFF{", 13)),
              HasSubstr("a header of 4294967295 bytes"));
}

TEST_F(DepthFileTest, AChannelIsTakenByItsName) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "no EXR in this build";
  const std::string path = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/mixed.exr";
  DepthReading reading;
  reading.channel = "Z";
  EXPECT_EQ(ReadDepthFile(path, reading).map.values.front(), 102.5F);
  // RGB and Z in separate parts: one part has Z.
  const std::string parts = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/rgb_and_z.exr";
  for (const char* const channel : {"", "Z"}) {
    DepthReading of_part;
    of_part.channel = channel;
    const DepthFile file = ReadDepthFile(parts, of_part);
    EXPECT_EQ(file.map.values.front(), 102.5F);
    ASSERT_FALSE(file.notes.empty());
    EXPECT_THAT(file.notes.front(), AllOf(HasSubstr("The part "), HasSubstr("(Z) of 2 is taken")));
  }
  DepthReading of_none;
  of_none.channel = "nothing";
  EXPECT_THAT(ErrorOf([&] { ReadDepthFile(parts, of_none); }),
              HasSubstr("none of its 2 parts has the channel 'nothing'"));
  EXPECT_THAT(ErrorOf([] {
                ReadDepthFile(std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/parts.exr");
              }),
              HasSubstr("none of its 2 parts has a channel named Z, depth or disparity: 'left' ("));
  reading.channel = "nothing";
  EXPECT_THAT(ErrorOf([&] { ReadDepthFile(path, reading); }),
              AllOf(HasSubstr("no channel 'nothing'"), HasSubstr("Z")));
}

TEST_F(DepthFileTest, ThePartOfAnExrFileIsChosenByItsHeader) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "no EXR in this build";
  const std::string images = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/";
  // A deep part is not decoded beside a plain one, and a part may have the name of a depth.
  for (const char* const name : {"deep_and_z.exr", "named_part.exr"}) {
    SCOPED_TRACE(name);
    const DepthFile file = ReadDepthFile(images + name);
    EXPECT_EQ(file.map.values.front(), 102.5F);
    EXPECT_THAT(file.notes, Contains(HasSubstr("of 2 is taken")));
  }
  // A channel's name that two parts have does not choose between them.
  for (const char* const channel : {"", "Z"}) {
    DepthReading reading;
    reading.channel = channel;
    EXPECT_THAT(ErrorOf([&] { ReadDepthFile(images + "stereo_z.exr", reading); }),
                AllOf(HasSubstr("'left' (Z), 'right' (Z); extract the part"),
                      Not(HasSubstr("--depth-channel"))));
  }
  EXPECT_THAT(ErrorOf([&] { ReadDepthFile(images + "parts.exr"); }),
              HasSubstr("name the channel that is the depth by --depth-channel"));
}

TEST_F(DepthFileTest, AChannelThatIsNoColourMayBeNamed) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "no EXR in this build";
  const std::string path = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/mist.exr";
  EXPECT_THAT(ErrorOf([&] { ReadDepthFile(path); }),
              HasSubstr("if one of them is the depth, name it by --depth-channel"));
  DepthReading reading;
  reading.channel = "Mist";
  EXPECT_EQ(ReadDepthFile(path, reading).map.values.front(), 102.5F);
  const std::string colours = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/rgb_half.exr";
  EXPECT_THAT(ErrorOf([&] { ReadDepthFile(colours); }), Not(HasSubstr("--depth-channel")));
}

// One bit a pixel: decoding spreads 0 and 1 to 0 and 255.
TEST_F(DepthFileTest, APngWhoseNumbersWouldBeChangedIsRefused) {
  const cv::Mat bits = (cv::Mat_<unsigned char>(2, 2) << 0, 255, 255, 0);
  EXPECT_THAT(Refusal(Encoded(bits, ".png", {cv::IMWRITE_PNG_BILEVEL, 1})),
              HasSubstr("8- or 16-bit values in one channel, found values of 1 bit, as of a mask"));
}

TEST_F(DepthFileTest, ABrokenImageIsRefused) {
  cv::Mat depth(40, 40, CV_16U);
  cv::randu(depth, 0, 65535);
  const std::string png = Encoded(depth, ".png");
  EXPECT_THAT(Refusal(png.substr(0, png.size() / 2)), HasSubstr("broken PNG: it ends after"));
  std::string flipped = png;
  flipped[png.size() / 2] = static_cast<char>(flipped[png.size() / 2] ^ 1);
  EXPECT_THAT(Refusal(flipped), HasSubstr("checksum"));
  EXPECT_THAT(Refusal(png.substr(0, 8)), HasSubstr("broken PNG"));
  const std::string tiff = Encoded(depth, ".tiff");
  EXPECT_THAT(Refusal(tiff.substr(0, tiff.size() / 2)), HasSubstr("cannot be decoded"));
  const std::string exr = Encoded(cv::Mat(40, 40, CV_32F, cv::Scalar(1)), ".exr");
  EXPECT_THAT(Refusal(exr.substr(0, exr.size() / 2)), HasSubstr("cannot be decoded"));
}

TEST(PngCheck, PassesWholeFilesAndTellsTheirBits) {
  const std::string deep = Encoded(cv::Mat(3, 3, CV_16U, cv::Scalar(7)), ".png");
  const std::string shallow = Encoded(cv::Mat(3, 3, CV_8UC3, cv::Scalar(7)), ".png");
  for (const std::string& bytes : {deep, shallow, deep + "behind the end", std::string("no png")})
    EXPECT_EQ(ErrorOf([&] { RequireWholePng(bytes, "p"); }), "(no error)");
  EXPECT_EQ(PngBits(deep), 16);
  EXPECT_EQ(PngBits(shallow), 8);
  EXPECT_EQ(PngBits("no png"), 0);
  // At every place where it can end, and for every byte that can be wrong.
  for (std::size_t size = 8; size < deep.size(); ++size)
    EXPECT_NE(ErrorOf([&] { RequireWholePng(deep.substr(0, size), "p"); }), "(no error)") << size;
  for (std::size_t at = 8; at < deep.size(); ++at) {
    std::string wrong = deep;
    wrong[at] = static_cast<char>(wrong[at] ^ 0x10);
    EXPECT_NE(ErrorOf([&] { RequireWholePng(wrong, "p"); }), "(no error)") << at;
  }
}

TEST(DepthData, ReadsTheBenchmarksDisparity) {
  const std::string path =
      std::string(THICKLENS_SHARED_DATA_DIR) + "/lf_antinous/gt_disp_lowres.pfm";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  const model::RawDepthMap map = ReadDepthMap(path);
  EXPECT_EQ(map.width_px, 512);
  EXPECT_EQ(map.height_px, 512);
  const auto [least, most] = std::minmax_element(map.values.begin(), map.values.end());
  EXPECT_NEAR(*least, -3.13, 0.01);
  EXPECT_NEAR(*most, 2.69, 0.01);
}

}  // namespace
}  // namespace thicklens::io
