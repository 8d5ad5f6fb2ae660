#include "thicklens/io/image_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_io.h"
#include "tools/io/image_library.h"
#include "tools/support/dng_tags.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;

std::string PathOf(const std::string& name) {
  return std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/" + name;
}

DecodedImage Read(const std::string& name, const ImageReading& reading = {}) {
  // The name says nothing about the kind.
  return DecodeImageFile(ReadWholeFile(PathOf(name)), "some/file", reading);
}

std::string Refusal(const std::string& name, const ImageReading& reading = {}) {
  return ErrorOf([&] { Read(name, reading); });
}

#define SKIP_WITHOUT_LIBRARY() \
  if (!HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts"

// The formula of the files, see tests/data/images/README.md.
double Grey8(int x, int y) { return 10 + 30 * (x % 6) + 7 * (y % 5); }
double Rgb8(int x, int y, int c) { return Grey8(x, y) + 20 * c; }
double Rgb16(int x, int y, int c) { return 257 * Rgb8(x, y, c) + x % 6; }
double Grey16(int x, int y, int /*c*/) { return Rgb16(x, y, 0); }

using Formula = std::function<double(int x, int y, int c)>;

// The largest difference from the formula.
double Difference(const cv::Mat& pixels, const Formula& formula) {
  cv::Mat values;
  pixels.convertTo(values, CV_64F);
  double largest = 0;
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x) {
      for (int c = 0; c < values.channels(); ++c) {
        const double difference =
            std::abs(values.ptr<double>(y)[x * values.channels() + c] - formula(x, y, c));
        largest = std::max(largest, std::isnan(difference) ? 1e300 : difference);
      }
    }
  }
  return largest;
}

struct SampleCase {
  std::string name;
  int type;
  Formula formula;
};

TEST(ImageFile, ReadsEveryArrangementOfATiffFile) {
  for (const std::string name :
       {"u16_contig", "u16_planar", "u16_tiled", "u16_planar_tiled", "u16_big_endian",
        "u16_bigtiff", "u16_lzw", "u16_zip", "u16_packbits", "u16_zstd", "u16_lzma",
        "u16_lzw_predictor2", "u16_zip_predictor2"}) {
    SCOPED_TRACE(name);
    const DecodedImage image = Read(name + ".tif");
    EXPECT_EQ(image.pixels.type(), CV_16UC3);
    EXPECT_EQ(Difference(image.pixels, Rgb16), 0);
    EXPECT_THAT(image.facts.channels, ElementsAre("R", "G", "B"));
    EXPECT_EQ(image.facts.sample_type, "unsigned 16-bit integers");
    EXPECT_EQ(image.facts.full_scale, 65535);
    EXPECT_FALSE(image.facts.significant_bits);
  }
}

TEST(ImageFile, ReadsEverySampleTypeOfATiffFile) {
  const std::vector<SampleCase> cases = {
      {"u8.tif", CV_8UC3, Rgb8},
      {"i8.tif", CV_8SC1, [](int x, int y, int) { return Grey8(x, y) - 100; }},
      {"i16.tif", CV_16SC1, [](int x, int y, int) { return Grey16(x, y, 0) - 30000; }},
      {"i32.tif", CV_32SC1, [](int x, int y, int) { return Grey16(x, y, 0) * 1000 - 20000000; }},
      {"u32.tif", CV_64FC1, [](int x, int y, int) { return Grey16(x, y, 0) * 65000; }},
      {"f16.tif", CV_32FC1, [](int x, int y, int) { return Grey8(x, y) / 4 - 8; }},
      {"f32.tif", CV_32FC1, [](int x, int y, int) { return Grey8(x, y) / 4 - 8; }},
      {"f64.tif", CV_64FC1, [](int x, int y, int) { return Grey8(x, y) / 4 - 8; }},
      {"f32_zip_predictor3.tif", CV_32FC1, [](int x, int y, int) { return Grey8(x, y) / 4 - 8; }},
      {"f32_be_planar.tif", CV_32FC3, [](int x, int y, int c) { return Rgb8(x, y, c) / 4; }},
      {"white_is_0.tif", CV_8UC1, [](int x, int y, int) { return Grey8(x, y); }},
      {"bilevel.tif", CV_8UC1, [](int x, int y, int) { return Grey8(x, y) > 100 ? 255 : 0; }},
      {"palette.tif", CV_8UC3, [](int x, int y, int c) {
         return (x + 6 * y) * std::array<int, 3>{1, 3, 7}[static_cast<std::size_t>(c)] % 256;
       }}};
  for (const SampleCase& c : cases) {
    SCOPED_TRACE(c.name);
    const DecodedImage image = Read(c.name);
    EXPECT_EQ(image.pixels.type(), c.type);
    EXPECT_EQ(Difference(image.pixels, c.formula), 0);
  }
}

TEST(ImageFile, SpreadsFewBitsOrLeavesThem) {
  const auto twelve = [](int x, int y, int) { return 16 * Grey8(x, y) + x; };
  ImageReading as_stored;
  as_stored.spread_bits = false;
  const DecodedImage stored = Read("u12_packed.tif", as_stored);
  EXPECT_EQ(Difference(stored.pixels, twelve), 0);
  EXPECT_EQ(stored.facts.full_scale, 4095);
  EXPECT_EQ(stored.facts.significant_bits, 12);
  EXPECT_EQ(stored.facts.container_bits, 16);
  const DecodedImage spread = Read("u12_packed.tif");
  EXPECT_EQ(
      Difference(spread.pixels,
                 [&](int x, int y, int c) { return std::round(twelve(x, y, c) * 65535 / 4095); }),
      0);
  EXPECT_EQ(spread.facts.full_scale, 65535);

  const auto pgm = [](int x, int y, int) { return std::floor(Grey16(x, y, 0) / 16); };
  EXPECT_EQ(Difference(Read("u12.pgm", as_stored).pixels, pgm), 0);
  EXPECT_EQ(
      Difference(Read("u12.pgm").pixels,
                 [&](int x, int y, int c) { return std::round(pgm(x, y, c) * 65535 / 4095); }),
      0);
  const auto four = [](int x, int y, int) { return std::floor(Grey8(x, y) / 16); };
  EXPECT_EQ(Difference(Read("u4.png", as_stored).pixels, four), 0);
  EXPECT_EQ(
      Difference(Read("u4.png").pixels, [&](int x, int y, int c) { return 17 * four(x, y, c); }),
      0);
}

TEST(ImageFile, KeepsAlphaAsItIs) {
  const DecodedImage straight = Read("straight_alpha.tif");
  EXPECT_EQ(straight.facts.alpha, AlphaKind::kStraight);
  EXPECT_THAT(straight.facts.channels, ElementsAre("R", "G", "B", "A"));
  const auto with_alpha = [](int x, int y, int c) { return Rgb16(x, y, c == 3 ? 0 : c); };
  EXPECT_EQ(Difference(straight.pixels, with_alpha), 0);
  const DecodedImage associated = Read("associated_alpha.tif");
  EXPECT_EQ(associated.facts.alpha, AlphaKind::kAssociated);
  EXPECT_EQ(Difference(associated.pixels, with_alpha), 0);
  for (const std::string name : {"grey_alpha.tif", "grey_alpha16.png"}) {
    const DecodedImage grey = Read(name);
    EXPECT_THAT(grey.facts.channels, ElementsAre("Y", "A"));
    EXPECT_EQ(Difference(grey.pixels,
                         [](int x, int y, int c) {
                           return c == 0 ? Grey16(x, y, 0) : std::floor(Grey16(x, y, 0) / 2);
                         }),
              0);
    // The narrow door makes RGBA of it.
    const cv::Mat wide = ReadImageFile(PathOf(name));
    EXPECT_EQ(wide.type(), CV_16UC4);
    EXPECT_EQ(wide.at<cv::Vec4w>(1, 2)[1], static_cast<int>(Grey16(2, 1, 0)));
  }
  const auto eight = [](int x, int y, int c) { return c == 3 ? 255 - 40 * x : Rgb8(x, y, c); };
  EXPECT_EQ(Difference(Read("straight_alpha.png").pixels, eight), 0);
  EXPECT_EQ(Difference(Read("alpha.pam").pixels, eight), 0);
  SKIP_WITHOUT_LIBRARY();
  EXPECT_EQ(Difference(Read("alpha.webp").pixels, eight), 0);
  EXPECT_EQ(Read("alpha.webp").facts.alpha, AlphaKind::kStraight);
}

TEST(ImageFile, RefusesByNameWhatIsNoColourImage) {
  EXPECT_THAT(Refusal("cmyk.tif"), AllOf(StartsWith("some/file: "), HasSubstr("CMYK")));
  EXPECT_THAT(Refusal("lab.tif"), HasSubstr("Lab"));
  EXPECT_THAT(Refusal("c64.tif"), HasSubstr("complex numbers"));
  EXPECT_THAT(Refusal("i64.tif"), HasSubstr("signed 64-bit integers"));
  EXPECT_THAT(Refusal("imagej.tif"), HasSubstr("ImageJ stack of 2 images"));
  EXPECT_THAT(Refusal("mosaic.tif"), AllOf(HasSubstr("mosaic (RGGB)"), HasSubstr("develop it")));
  EXPECT_THAT(Refusal("cmyk.jpg"), HasSubstr("CMYK"));
  SKIP_WITHOUT_LIBRARY();
  EXPECT_THAT(Refusal("animated.webp"), HasSubstr("animation"));
}

TEST(ImageFile, NeverTakesOneOfSeveralPagesWithoutAWord) {
  EXPECT_THAT(Refusal("pages.tif"), HasSubstr("found 3 pages (6x5, 6x4, 6x3 px)"));
  EXPECT_THAT(ErrorOf([] { ReadImageFile(PathOf("stack.ome.tif")); }), HasSubstr("found 2 pages"));
  ImageReading reading;
  for (int k = 0; k < 3; ++k) {
    reading.page = k;
    const DecodedImage image = Read("pages.tif", reading);
    EXPECT_EQ(image.pixels.rows, 5 - k);
    EXPECT_EQ(image.facts.page, k);
    EXPECT_EQ(image.facts.pages, 3);
    EXPECT_EQ(Difference(image.pixels, [&](int x, int y, int) { return Grey16(x, y, 0) + k; }), 0);
  }
  reading.page = 3;
  EXPECT_THAT(Refusal("pages.tif", reading), HasSubstr("page 3 is not there: it has 3"));
  const auto pages = DecodeImagePages(ReadWholeFile(PathOf("stack.ome.tif")), "s");
  ASSERT_EQ(pages.size(), 2U);
  EXPECT_EQ(Difference(pages[1].pixels, [](int x, int y, int) { return Grey8(x, y) + 1; }), 0);
  EXPECT_THAT(pages[0].facts.description, HasSubstr("PhysicalSizeZ=\"2.5\""));
  // A reduced copy is no page.
  EXPECT_EQ(Difference(Read("pyramid.tif").pixels, Rgb8), 0);
}

TEST(ImageFile, ReadsWhatAPngFileStates) {
  const ImageFacts gamma = Read("gamma.png").facts;
  EXPECT_EQ(gamma.transfer, StatedTransfer::kGamma);
  EXPECT_NEAR(gamma.gamma, 2.2, 1e-4);
  ASSERT_TRUE(gamma.chromaticities);
  EXPECT_THAT(*gamma.chromaticities, ElementsAre(.64, .33, .3, .6, .15, .06, .3127, .329));
  const ImageFacts linear = Read("linear.png").facts;
  EXPECT_EQ(linear.transfer, StatedTransfer::kLinear);
  EXPECT_EQ(linear.significant_bits, 12);
  EXPECT_EQ(Read("srgb.png").facts.transfer, StatedTransfer::kSrgb);
  EXPECT_EQ(Read("pq.png").facts.transfer, StatedTransfer::kPq);  // before gAMA
  EXPECT_EQ(Read("hlg.png").facts.transfer, StatedTransfer::kHlg);
  EXPECT_EQ(Read("straight_alpha.png").facts.transfer, StatedTransfer::kAbsent);
  EXPECT_EQ(Difference(Read("gamma.png").pixels, Rgb16), 0);
}

TEST(ImageFile, CarriesTheColourProfile) {
  const std::string profile = Read("profile.png").facts.icc_profile;
  EXPECT_EQ(profile.size(), 196U);
  EXPECT_EQ(Read("profile.png").facts.icc_description, "Test profile");
  EXPECT_THAT(Read("profile.png").facts.OneLine(), HasSubstr("profile 'Test profile'"));
  EXPECT_EQ(Read("smooth.jpg").facts.icc_profile, profile);
  SKIP_WITHOUT_LIBRARY();
  EXPECT_EQ(Read("plain.webp").facts.icc_profile, profile);
}

TEST(ImageFile, TurnsEveryKindByOneRule) {
  ImageReading shown;
  shown.orientation = ImageOrientation::kDisplayed;
  // Where EXIF 2.3 has row 0 and column 0: pixel (x, y) of the displayed image in the stored one.
  const auto place = [](int orientation, int x, int y, int columns, int rows) {
    const int right = columns - 1, bottom = rows - 1;
    switch (orientation) {
      case 2:
        return cv::Point(right - x, y);  // row 0 is the top, column 0 the right side
      case 3:
        return cv::Point(right - x, bottom - y);
      case 4:
        return cv::Point(x, bottom - y);
      case 5:
        return cv::Point(y, x);
      case 6:
        return cv::Point(y, bottom - x);  // row 0 is the right side, column 0 the top
      case 7:
        return cv::Point(right - y, bottom - x);
      case 8:
        return cv::Point(right - y, x);
      default:
        return cv::Point(x, y);
    }
  };
  const auto check = [&](const std::string& name, int orientation) {
    SCOPED_TRACE(name);
    const DecodedImage stored = Read(name), turned = Read(name, shown);
    EXPECT_EQ(stored.facts.orientation, orientation);
    EXPECT_FALSE(stored.facts.is_orientation_applied);
    EXPECT_EQ(turned.facts.is_orientation_applied, orientation != 1);
    const bool is_swapped = orientation >= 5;
    ASSERT_EQ(turned.pixels.cols, is_swapped ? stored.pixels.rows : stored.pixels.cols);
    EXPECT_EQ(turned.facts.stored_width_px, stored.pixels.cols);
    for (int y = 0; y < turned.pixels.rows; ++y) {
      for (int x = 0; x < turned.pixels.cols; ++x) {
        const cv::Point from = place(orientation, x, y, stored.pixels.cols, stored.pixels.rows);
        ASSERT_EQ(turned.pixels.at<cv::Vec3b>(y, x), stored.pixels.at<cv::Vec3b>(from));
      }
    }
    EXPECT_EQ(ReadImageFile(PathOf(name)).size(), stored.pixels.size());
  };
  check("orientation6.tif", 6);
  check("orientation6.png", 6);
  for (int k = 1; k <= 8; ++k) check("orientation" + std::to_string(k) + ".jpg", k);
  SKIP_WITHOUT_LIBRARY();
  check("turned1.heic", 8);  // a turn by 90 degrees anticlockwise
  check("turned3.heic", 6);
  check("mirrored0.heic", 4);
  check("mirrored1.heic", 2);
}

TEST(ImageFile, ReadsThePixelPitchOfExif) {
  ASSERT_TRUE(Read("orientation1.jpg").facts.pixel_pitch_mm);
  EXPECT_NEAR(*Read("orientation1.jpg").facts.pixel_pitch_mm, 0.005, 1e-9);
  EXPECT_FALSE(Read("orientation2.jpg").facts.pixel_pitch_mm);
}

double Smooth(int x, int c) { return std::round(40 + 20 * c + (160 - 20 * c) * x / 31.0); }

TEST(ImageFile, ReadsLossyFilesNearly) {
  const Formula smooth = [](int x, int, int c) { return Smooth(x, c); };
  EXPECT_LE(Difference(Read("ycbcr_jpeg.tif").pixels, smooth), 3);
  EXPECT_EQ(Difference(Read("text.ppm").pixels, smooth), 0);
  EXPECT_LE(Difference(Read("smooth.jpg").pixels, smooth), 3);
  EXPECT_LE(Difference(Read("grey.jpg").pixels, smooth), 2);
  EXPECT_EQ(Read("grey.jpg").pixels.type(), CV_8UC1);
  SKIP_WITHOUT_LIBRARY();
  EXPECT_LE(Difference(Read("rgb.heic").pixels, Rgb8), 2);
  const DecodedImage ten = Read("u10.heic");
  EXPECT_EQ(ten.facts.significant_bits, 10);
  EXPECT_LE(Difference(ten.pixels, Rgb16), 300);
  const DecodedImage twelve = Read("u12.avif");
  EXPECT_EQ(twelve.facts.file_kind, "AVIF");
  EXPECT_EQ(twelve.facts.significant_bits, 12);
  EXPECT_LE(Difference(twelve.pixels, Rgb16), 5000);  // half of the colours' pixels
}

// Codes of ITU-T H.273 in the place of those of u12.avif, which specify nothing.
DecodedImage AvifWithCodes(char primaries_high, char primaries, char transfer) {
  std::string bytes = ReadWholeFile(PathOf("u12.avif"));
  const std::size_t at = bytes.find("colrnclx") + 8;
  bytes[at] = primaries_high;
  bytes[at + 1] = primaries;
  bytes[at + 3] = transfer;
  return DecodeImageFile(bytes, "f.avif");
}

TEST(ImageFile, ReadsColourCodesOfHeif) {
  SKIP_WITHOUT_LIBRARY();
  EXPECT_EQ(Read("u12.avif").facts.transfer, StatedTransfer::kAbsent);
  EXPECT_FALSE(Read("u12.avif").facts.chromaticities);
  const ImageFacts facts = AvifWithCodes(0, 9, 8).facts;
  EXPECT_EQ(facts.transfer, StatedTransfer::kLinear);
  ASSERT_TRUE(facts.chromaticities);
  EXPECT_NEAR((*facts.chromaticities)[0], 0.708, 1e-6);  // the red of ITU-R BT.2020
  EXPECT_EQ(AvifWithCodes(0, 1, 16).facts.transfer, StatedTransfer::kPq);
  // The image has no codes, its tiles have.
  EXPECT_EQ(Read("tiles.avif").facts.transfer, StatedTransfer::kPq);
}

// libheif 1.15 loses memory where it is asked for codes that it does not know; the leak sanitizer
// reports that.
TEST(ImageFile, UnknownColourCodesOfHeifMeanNothing) {
  SKIP_WITHOUT_LIBRARY();
  const ImageFacts primaries = AvifWithCodes(1, 9, 13).facts,
                   transfer = AvifWithCodes(0, 9, 99).facts;
  EXPECT_FALSE(primaries.chromaticities);
  EXPECT_EQ(primaries.transfer, StatedTransfer::kSrgb);
  EXPECT_TRUE(transfer.chromaticities);
  EXPECT_EQ(transfer.transfer, StatedTransfer::kAbsent);
}

TEST(ImageFile, ReadsPnmAndPfm) {
  EXPECT_EQ(Difference(Read("u16.ppm").pixels, Rgb16), 0);
  EXPECT_EQ(Difference(Read("bits.pbm").pixels,
                       [](int x, int y, int) { return Grey8(x, y) > 100 ? 255 : 0; }),
            0);
  const DecodedImage pfm = Read("big_endian.pfm");
  EXPECT_EQ(Difference(pfm.pixels, [](int x, int y, int) { return Grey8(x, y) / 4 + 100; }), 0);
  EXPECT_EQ(pfm.facts.value_scale, 2);
  EXPECT_EQ(
      Difference(Read("crlf.pfm").pixels, [](int x, int y, int c) { return Rgb8(x, y, c) / 4; }),
      0);
}

TEST(ImageFile, ReadsBmpAndDicom) {
  SKIP_WITHOUT_LIBRARY();
  EXPECT_EQ(Difference(Read("rgb.bmp").pixels, Rgb8), 0);
  EXPECT_EQ(Read("grey.bmp").pixels.channels(), 1);
  EXPECT_EQ(Difference(Read("grey.bmp").pixels, [](int x, int y, int) { return Grey8(x, y); }), 0);
  ImageReading as_stored;
  as_stored.spread_bits = false;
  const DecodedImage dicom = Read("u12.dcm", as_stored);
  EXPECT_EQ(
      Difference(dicom.pixels, [](int x, int y, int) { return std::floor(Grey16(x, y, 0) / 16); }),
      0);
  EXPECT_EQ(dicom.facts.significant_bits, 12);
}

TEST(ImageFile, ReadsEveryChannelOfAnExrFile) {
  SKIP_WITHOUT_LIBRARY();
  const Formula depth = [](int x, int y, int) { return Grey8(x, y) / 4 + 100; };
  EXPECT_EQ(Difference(Read("z.exr").pixels, depth), 0);
  EXPECT_THAT(Read("z.exr").facts.channels, ElementsAre("Z"));
  EXPECT_EQ(Difference(Read("layer_z.exr").pixels, depth), 0);
  EXPECT_EQ(Read("layer_z.exr").facts.sample_type, "half floats");
  EXPECT_THAT(Read("layer_z.exr").facts.channels, ElementsAre("depth.Z"));

  const DecodedImage rgb = Read("rgb_half.exr");
  EXPECT_EQ(rgb.pixels.type(), CV_32FC3);
  EXPECT_EQ(Difference(rgb.pixels, [](int x, int y, int c) { return Rgb8(x, y, c) / 64; }), 0);
  EXPECT_EQ(rgb.facts.transfer, StatedTransfer::kLinear);
  ASSERT_TRUE(rgb.facts.chromaticities);
  EXPECT_NEAR((*rgb.facts.chromaticities)[6], 0.3127, 1e-6);

  const DecodedImage mixed = Read("mixed.exr");
  EXPECT_THAT(mixed.facts.channels, ElementsAre("R", "Z", "id"));
  EXPECT_EQ(Difference(mixed.pixels,
                       [](int x, int y, int c) {
                         return c == 2 ? Grey16(x, y, 0) * 65000 : Grey8(x, y) / 4 + 100;
                       }),
            0);
  ImageReading one;
  one.channels = {"Z"};
  EXPECT_EQ(Difference(Read("mixed.exr", one).pixels, depth), 0);
  one.channels = {"W"};
  EXPECT_THAT(Refusal("mixed.exr", one), HasSubstr("no channel 'W': it has R, Z, id"));
  ImageReading layer;
  layer.layer = "depth";
  EXPECT_EQ(Difference(Read("layer_z.exr", layer).pixels, depth), 0);
  layer.layer = "colour";
  EXPECT_THAT(Refusal("layer_z.exr", layer), HasSubstr("no channel of the layer 'colour'"));
}

TEST(ImageFile, ReadsPartsAndWindowsOfAnExrFile) {
  SKIP_WITHOUT_LIBRARY();
  EXPECT_THAT(Refusal("parts.exr"), HasSubstr("found 2 parts ('left' 6x5, 'right' 6x5 px)"));
  ImageReading reading;
  reading.part = "right";
  EXPECT_EQ(Difference(Read("parts.exr", reading).pixels,
                       [](int x, int y, int) { return Grey8(x, y) / 4 + 101; }),
            0);
  reading.part = "middle";
  EXPECT_THAT(Refusal("parts.exr", reading), HasSubstr("the part 'middle' is not there"));
  // Data at (2, -1) to (7, 3) of a display of 8 x 6 px.
  const DecodedImage window = Read("window.exr");
  EXPECT_EQ(window.pixels.size(), cv::Size(8, 6));
  EXPECT_THAT(window.facts.OneLine(), HasSubstr("data window, 6 x 5 px at (2, -1)"));
  EXPECT_EQ(Difference(window.pixels,
                       [](int x, int y, int) {
                         return x < 2 || y > 3 ? 0 : Grey8(x - 2, y + 1) / 4 + 100;
                       }),
            0);
}

double Light(int x) { return 0.2 + 0.5 * x / 63; }

TEST(ImageFile, ReadsTheSensorOfARawFileAndNeverItsPreview) {
  SKIP_WITHOUT_LIBRARY();
  ImageReading reading;
  reading.raw = RawTreatment::kMosaicGreen;
  const DecodedImage green = Read("mosaic.dng", reading);
  EXPECT_EQ(green.pixels.type(), CV_32FC1);
  EXPECT_EQ(green.pixels.size(), cv::Size(32, 24));
  constexpr double kLevel = 1.0 / (4095 - 256);
  EXPECT_LE(Difference(green.pixels,
                       [](int x, int, int) { return (Light(2 * x) + Light(2 * x + 1)) / 2; }),
            kLevel);
  ASSERT_TRUE(green.facts.raw);
  EXPECT_EQ(green.facts.raw->mosaic, "RGGB");
  EXPECT_THAT(green.facts.raw->black_level, ElementsAre(256, 256, 256, 256));
  EXPECT_EQ(green.facts.raw->white_level, 4095);
  EXPECT_EQ(green.facts.raw->sensor_px_per_px, 2);
  EXPECT_EQ(green.facts.raw->active_width_px, 64);
  EXPECT_EQ(green.facts.transfer, StatedTransfer::kLinear);
  ASSERT_TRUE(green.facts.raw->camera_white_balance);
  EXPECT_NEAR((*green.facts.raw->camera_white_balance)[0], 2, 1e-4);
  EXPECT_NEAR((*green.facts.raw->camera_white_balance)[2], 1.5, 1e-4);

  reading.raw = RawTreatment::kMosaicPlanes;
  const DecodedImage planes = Read("mosaic.dng", reading);
  EXPECT_THAT(planes.facts.channels, ElementsAre("R", "G1", "G2", "B"));
  EXPECT_LE(Difference(planes.pixels,
                       [](int x, int, int c) {
                         const double share = c == 0 ? 0.5 : c == 3 ? 2.0 / 3 : 1;
                         return share * Light(2 * x + (c == 1 || c == 3 ? 1 : 0));
                       }),
            kLevel);

  // A grey ramp: the white balance of the camera makes the channels equal.
  const DecodedImage colours = Read("mosaic.dng");
  EXPECT_EQ(colours.pixels.type(), CV_16UC3);
  EXPECT_EQ(colours.pixels.size(), cv::Size(64, 48));
  const cv::Mat inner = colours.pixels(cv::Rect(4, 4, 56, 40));
  EXPECT_LE(Difference(inner, [](int x, int, int) { return 65535 * Light(x + 4); }), 100);
  EXPECT_THAT(colours.facts.raw->treatment, HasSubstr("AHD"));
  // Without a white balance in the file, none is taken from the image.
  const cv::Mat unbalanced = Read("no_balance.dng").pixels;
  const cv::Scalar mean = cv::mean(unbalanced(cv::Rect(4, 4, 56, 40)));
  EXPECT_NEAR(mean[0] / mean[1], 0.5, 0.02);
  EXPECT_NEAR(mean[2] / mean[1], 2.0 / 3, 0.02);
  const cv::Mat narrow = ReadImageFile(PathOf("mosaic.dng"));
  EXPECT_EQ(cv::norm(narrow, colours.pixels, cv::NORM_INF), 0);
  EXPECT_EQ(Read("turned.dng").facts.orientation, 6);

  reading.raw = RawTreatment::kMosaicGreen;
  EXPECT_LE(Difference(Read("mosaic.tif", reading).pixels,
                       [](int x, int y, int) {
                         return (Grey16(2 * x + 1, 2 * y, 0) + Grey16(2 * x, 2 * y + 1, 0)) / 2 /
                                65535;
                       }),
            1e-6);
}

// The mosaic of 64 x 48 px with other tags.
RawFacts FactsOfDng(const std::vector<tools::TiffTag>& sensor) {
  tools::DngTags tags;
  tags.sensor = sensor;
  const std::string dng = tools::DngEdit(ReadWholeFile(PathOf("mosaic.dng"))).With(tags);
  return DecodeImageFile(dng, "a.dng").facts.raw.value();
}

TEST(ImageFile, SaysWhichPixelsOfTheSensorARawFileHas) {
  SKIP_WITHOUT_LIBRARY();
  using tools::TiffTag;
  constexpr std::uint16_t kActiveArea = 50829, kDefaultScale = 50718;
  EXPECT_EQ(Read("mosaic.dng").facts.raw->why_resampled, "");
  const RawFacts cut = FactsOfDng({{kActiveArea, TiffTag::kLong, {2, 4, 46, 62}}});
  EXPECT_EQ(cut.why_resampled, "");
  EXPECT_EQ(cut.sensor_width_px, 64);
  EXPECT_EQ(cut.sensor_height_px, 48);
  EXPECT_EQ(cut.active_left_px, 4);
  EXPECT_EQ(cut.active_top_px, 2);
  EXPECT_EQ(cut.active_width_px, 58);
  EXPECT_EQ(cut.active_height_px, 44);
  EXPECT_THAT(FactsOfDng({{kDefaultScale, TiffTag::kRational, {2, 1, 1, 1}}}).why_resampled,
              HasSubstr("2 times as wide as high"));
  // The bytes of the mosaic are now interpolated colours of 32 x 32 px.
  EXPECT_THAT(FactsOfDng({{256, TiffTag::kLong, {32}},
                          {257, TiffTag::kLong, {32}},
                          {258, TiffTag::kShort, {16, 16, 16}},
                          {262, TiffTag::kShort, {34892}},
                          {277, TiffTag::kShort, {3}},
                          {278, TiffTag::kLong, {32}},
                          {50714, TiffTag::kShort, {256, 256, 256}},
                          {33421, TiffTag::kShort, {}},
                          {33422, TiffTag::kShort, {}},
                          {50717, TiffTag::kShort, {4095, 4095, 4095}}})
                  .why_resampled,
              HasSubstr("interpolated colours"));
}

TEST(ImageFile, SaysOnOneLineWhatWasRead) {
  EXPECT_EQ(Read("u12_packed.tif").facts.OneLine(),
            "TIFF, 6 x 5 px, 1 channel (Y), unsigned 12-bit integers (12 significant in 16 bits), "
            "transfer not stated");
  EXPECT_EQ(Read("orientation6.png").facts.OneLine(),
            "PNG, 6 x 5 px, 3 channels (R G B), unsigned 8-bit integers, transfer not stated, "
            "orientation 6 (not applied: as stored)");
}

TEST(ImageFile, NamesTheKindsThatAreRead) {
  const auto refusal = [](const std::string& bytes) {
    return ErrorOf([&] { DecodeImageFile(bytes, "f"); });
  };
  EXPECT_THAT(refusal("hello"), AllOf(StartsWith("f: "), HasSubstr("a PNG, TIFF, ")));
  EXPECT_THAT(refusal(""), HasSubstr("file is expected"));
  EXPECT_THAT(refusal("GIF89a...."), HasSubstr("it is a GIF file; a PNG"));
  EXPECT_THAT(refusal("SIMPLE  =                    T"), HasSubstr("it is a FITS file"));
  EXPECT_THAT(refusal("8BPS"), HasSubstr("PSD"));
}

TEST(ImageFile, RefusesTruncatedFiles) {
  std::vector<std::string> names = {"u16_planar.tif", "u16_tiled.tif",  "u16_zip.tif", "f32.tif",
                                    "gamma.png",      "smooth.jpg",     "u16.ppm",     "text.ppm",
                                    "bits.pbm",       "big_endian.pfm", "alpha.pam"};
  if (HasImageLibrary()) {
    names.insert(names.end(), {"z.exr", "mixed.exr", "alpha.webp", "rgb.bmp", "rgb.heic",
                               "u12.avif", "mosaic.dng"});
  }
  for (const std::string& name : names) {
    const std::string bytes = ReadWholeFile(PathOf(name));
    for (const double share : {0.0, 0.1, 0.5, 0.8}) {
      const auto size = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
      EXPECT_THAT(ErrorOf([&] { DecodeImageFile(bytes.substr(0, size), "f"); }), StartsWith("f: "))
          << name << ", " << size << " of " << bytes.size() << " bytes";
    }
  }
}

// A decoder may make anything of it, but every refusal names the file.
TEST(ImageFile, SurvivesDamagedFiles) {
  std::mt19937 random(4);
  std::set<std::string> paths;  // in the same order on each machine
  for (const auto& entry : std::filesystem::directory_iterator(PathOf("")))
    paths.insert(entry.path().string());
  for (const std::string& path : paths) {
    const std::string bytes = ReadWholeFile(path);
    for (int k = 0; k < 12; ++k) {
      std::string damaged = bytes;
      for (int i = 0; i < 3; ++i)
        damaged[random() %
                std::min<std::size_t>(damaged.size(), k % 2 == 0 ? 300 : damaged.size())] =
            static_cast<char>(random());
      ImageReading reading;
      reading.raw = static_cast<RawTreatment>(k % 3);
      const std::string refusal = ErrorOf([&] { DecodeImagePages(damaged, "f", reading); });
      if (refusal != "(no error)") {
        EXPECT_THAT(refusal, StartsWith("f: ")) << path;
      }
    }
  }
}

TEST(ImageFile, SeveralThreadsDecodeAtOnce) {
  std::vector<std::string> names = {"u16_planar.tif", "gamma.png", "smooth.jpg", "u16.ppm"};
  if (HasImageLibrary())
    names.insert(names.end(),
                 {"mixed.exr", "alpha.webp", "rgb.heic", "u12.dcm", "mosaic.dng", "rgb.bmp"});
  std::vector<cv::Mat> alone;
  for (const std::string& name : names) alone.push_back(Read(name).pixels);
  std::vector<std::thread> threads;
  std::array<int, 4> differences{};
  for (std::size_t t = 0; t < differences.size(); ++t) {
    threads.emplace_back([&, t] {
      for (std::size_t k = 0; k < 4 * names.size(); ++k) {
        const std::size_t i = (k + t) % names.size();
        if (cv::norm(Read(names[i]).pixels, alone[i], cv::NORM_INF) != 0) ++differences[t];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(differences, ElementsAre(0, 0, 0, 0));
}

TEST(UsedBits, AreTheHighestValueAndAllSetBits) {
  const cv::Mat values = (cv::Mat_<std::uint16_t>(1, 3) << 0, 0x30, 0x500);
  const UsedBits used = BitsOf(values);
  EXPECT_EQ(used.highest, 0x500U);
  EXPECT_EQ(used.set_bits, 0x530U);
  EXPECT_EQ(used.LowestBit(), 4);
  EXPECT_EQ(BitsOf(cv::Mat(2, 2, CV_8U, cv::Scalar(0))).LowestBit(), -1);
  EXPECT_THAT(ErrorOf([] { BitsOf(cv::Mat(2, 2, CV_32F, cv::Scalar(0))); }),
              HasSubstr("32-bit floats"));
}

TEST(ImageFormat, FollowsTheEnding) {
  EXPECT_EQ(FormatOfName("a.b/c.PNG"), ImageFormat::kPng);
  EXPECT_EQ(FormatOfName("c.tiff"), ImageFormat::kTiff);
  EXPECT_EQ(FormatOfName("c.pfm"), ImageFormat::kPfm);
  EXPECT_THAT(ErrorOf([] { FormatOfName("a.png/c.gif"); }),
              AllOf(StartsWith("a.png/c.gif: "), HasSubstr(".jpg"), HasSubstr("found '.gif'")));
  EXPECT_THAT(ErrorOf([] { FormatOfName("png"); }), HasSubstr("found ''"));
  if (!HasImageLibrary()) {
    EXPECT_THAT(ErrorOf([] { FormatOfName("c.exr"); }), HasSubstr("THICKLENS_WITH_GPL=OFF"));
    return;
  }
  EXPECT_EQ(FormatOfName("c.jpeg"), ImageFormat::kJpeg);
  EXPECT_EQ(FormatOfName("c.exr"), ImageFormat::kExr);
}

cv::Mat RandomImage(int type) {
  cv::Mat image(19, 23, type);
  cv::RNG random(5);
  if (image.depth() == CV_32F) {
    random.fill(image, cv::RNG::UNIFORM, -3, 7);
  } else {
    random.fill(image, cv::RNG::UNIFORM, 0, image.depth() == CV_8U ? 256 : 65536);
  }
  return image;
}

TEST(ImageFormat, HoldsWhatWasWritten) {
  struct Written {
    ImageFormat format;
    std::vector<int> types;
  };
  std::vector<Written> all = {
      {ImageFormat::kPng, {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4}},
      {ImageFormat::kTiff,
       {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4, CV_32FC1, CV_32FC3}},
      {ImageFormat::kPnm, {CV_8UC1, CV_8UC3, CV_16UC1, CV_16UC3}},
      {ImageFormat::kPfm, {CV_32FC1, CV_32FC3}}};
  if (HasImageLibrary()) {
    all.push_back({ImageFormat::kExr, {CV_32FC1, CV_32FC3, CV_32FC4}});
    all.push_back({ImageFormat::kBmp, {CV_8UC3}});
    all.push_back({ImageFormat::kWebp, {CV_8UC3, CV_8UC4}});
  }
  for (const Written& written : all) {
    for (const int type : written.types) {
      SCOPED_TRACE(NameOf(written.format) + ", type " + std::to_string(type));
      const cv::Mat image = RandomImage(type);
      ImageWriting writing;
      writing.jpeg_quality = 100;
      const std::string bytes = EncodeImageFile(image, written.format, writing);
      const DecodedImage back = DecodeImageFile(bytes, "memory");
      EXPECT_EQ(back.facts.file_kind, NameOf(written.format));
      ASSERT_EQ(back.pixels.type(), type);
      if (written.format == ImageFormat::kWebp && image.channels() == 4) {
        // Colours behind alpha 0 are free.
        for (int i = 0; i < image.rows * image.cols; ++i) {
          const auto was = image.at<cv::Vec4b>(i), is = back.pixels.at<cv::Vec4b>(i);
          ASSERT_TRUE(was[3] == 0 || was == is);
        }
      } else {
        EXPECT_EQ(cv::norm(back.pixels, image, cv::NORM_INF), 0);
      }
    }
  }
}

TEST(ImageFormat, WritesJpegNearly) {
  cv::Mat image(32, 48, CV_8UC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x)
      image.at<cv::Vec3b>(y, x) = {uchar(x * 5), uchar(y * 7), 90};
  }
  const std::string bytes = EncodeImageFile(image, ImageFormat::kJpeg);
  EXPECT_THAT(bytes, StartsWith("\xFF\xD8\xFF"));
  EXPECT_LE(cv::norm(DecodeImageFile(bytes, "memory").pixels, image, cv::NORM_INF), 10);
  const cv::Mat grey(16, 16, CV_8UC1, cv::Scalar(77));
  EXPECT_EQ(cv::norm(DecodeImageFile(EncodeImageFile(grey, ImageFormat::kJpeg), "m").pixels, grey,
                     cv::NORM_INF),
            0);
}

// Blurred noise of 35 levels, with white noise of one level, before compression.
cv::Mat GreyTexture(double blur_px) {
  constexpr int kSize = 256;
  cv::RNG random(7);
  cv::Mat texture(kSize, kSize, CV_32F), noise(kSize, kSize, CV_32F);
  random.fill(texture, cv::RNG::NORMAL, 0, 1);
  random.fill(noise, cv::RNG::NORMAL, 0, 1);
  cv::GaussianBlur(texture, texture, {0, 0}, blur_px);
  cv::Scalar mean, deviation;
  cv::meanStdDev(texture, mean, deviation);
  cv::Mat stored;
  cv::Mat(128 + (texture - mean[0]) * (35 / deviation[0]) + noise).convertTo(stored, CV_8U);
  return stored;
}

double RmsDifference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat difference;
  cv::subtract(a, b, difference, cv::noArray(), CV_32F);
  return cv::norm(difference) /
         std::sqrt(static_cast<double>(difference.total()) * difference.channels());
}

// The error with the rounding to whole levels, which a difference of pixels has too.
double WithRounding(double levels) { return std::hypot(levels, 1 / std::sqrt(12.0)); }

// The oracle is the difference from the pixels before compression.
TEST(JpegError, IsThatOfThePixels) {
  for (const double blur_px : {1.0, 3.0}) {
    const cv::Mat stored = GreyTexture(blur_px);
    for (const int quality : {50, 75, 90, 95}) {
      SCOPED_TRACE(std::to_string(blur_px) + " px, quality " + std::to_string(quality));
      ImageWriting writing;
      writing.jpeg_quality = quality;
      const std::string bytes = EncodeImageFile(stored, ImageFormat::kJpeg, writing);
      const double error = RmsDifference(DecodeImageFile(bytes, "memory").pixels, stored);
      const std::optional<JpegError> found = MeasureJpegError(bytes);
      ASSERT_TRUE(found);
      EXPECT_LT(WithRounding(found->rms_levels), 1.3 * error);
      EXPECT_GT(WithRounding(found->rms_levels), error / 1.3);
      EXPECT_DOUBLE_EQ(found->mean_levels, found->rms_levels);  // it has one channel
    }
  }
}

// Blurred noise in brightness and, more strongly blurred, in two differences of colours. The left
// part is plain but for noise of half a level.
cv::Mat ColouredTexture() {
  const cv::Mat brightness = GreyTexture(1.2), warmth = GreyTexture(2.5), tint = GreyTexture(3.5);
  cv::RNG random(11);
  cv::Mat image(brightness.size(), CV_32FC3), noise(brightness.size(), CV_32FC3), stored;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const float strength = x < image.cols / 2 ? 0 : 0.5F;
      const float light = strength * static_cast<float>(brightness.at<uchar>(y, x) - 128);
      const float warm = strength * static_cast<float>(warmth.at<uchar>(x, y) - 128);
      const float green =
          strength * static_cast<float>(tint.at<uchar>(y, image.cols - 1 - x) - 128);
      image.at<cv::Vec3f>(y, x) = {130 + light + warm, 120 + light + green, 110 + light - warm};
    }
  }
  random.fill(noise, cv::RNG::NORMAL, 0, 0.5);
  cv::Mat(image + noise).convertTo(stored, CV_8U);
  return stored;
}

// The mean of the three channels, not rounded.
cv::Mat MeanOfChannels(const cv::Mat& image) {
  cv::Mat wide, mean;
  image.convertTo(wide, CV_32F);
  cv::transform(wide, mean, cv::Matx13f(1 / 3.0F, 1 / 3.0F, 1 / 3.0F));
  return mean;
}

TEST(JpegError, OfColoursIsThatOfThePixels) {
  const cv::Mat stored = ColouredTexture();
  for (const bool halves_colours : {false, true}) {
    for (const int quality : {50, 75, 90, 95}) {
      SCOPED_TRACE(fmt::format("quality {}, halved {}", quality, halves_colours));
      ImageWriting writing;
      writing.jpeg_quality = quality;
      writing.halves_colours = halves_colours;
      const std::string bytes = EncodeImageFile(stored, ImageFormat::kJpeg, writing);
      const cv::Mat decoded = DecodeImageFile(bytes, "memory").pixels;
      const double error = RmsDifference(decoded, stored);
      const double of_mean = RmsDifference(MeanOfChannels(decoded), MeanOfChannels(stored));
      const std::optional<JpegError> found = MeasureJpegError(bytes);
      ASSERT_TRUE(found);
      EXPECT_LT(WithRounding(found->rms_levels), 1.4 * error);
      EXPECT_GT(WithRounding(found->rms_levels), error / 1.4);
      // The errors of three roundings are independent.
      const double mean_levels = std::hypot(found->mean_levels, 1 / 6.0);
      EXPECT_LT(mean_levels, 1.4 * of_mean);
      EXPECT_GT(mean_levels, of_mean / 1.4);
      EXPECT_LT(found->mean_levels, found->rms_levels);
    }
  }
}

TEST(JpegError, IsNothingWhereNothingIsLost) {
  const cv::Mat flat(64, 64, CV_8UC1, cv::Scalar(77));
  ImageWriting writing;
  writing.jpeg_quality = 100;
  const auto found = MeasureJpegError(EncodeImageFile(flat, ImageFormat::kJpeg, writing));
  ASSERT_TRUE(found);
  EXPECT_LT(found->rms_levels, 0.1);
}

TEST(JpegError, IsAFactOfTheImageIfAskedFor) {
  const std::string bytes = EncodeImageFile(GreyTexture(1), ImageFormat::kJpeg);
  EXPECT_FALSE(DecodeImageFile(bytes, "memory").facts.jpeg_error);
  ImageReading reading;
  reading.measures_compression = true;
  const std::optional<JpegError> found = DecodeImageFile(bytes, "memory", reading).facts.jpeg_error;
  ASSERT_TRUE(found);
  EXPECT_EQ(found->rms_levels, MeasureJpegError(bytes)->rms_levels);
}

TEST(JpegError, IsUnknownForOtherFiles) {
  const cv::Mat stored = GreyTexture(1);
  EXPECT_FALSE(MeasureJpegError(EncodeImageFile(stored, ImageFormat::kPng)));
  EXPECT_FALSE(MeasureJpegError(""));
  const std::string bytes = EncodeImageFile(stored, ImageFormat::kJpeg);
  EXPECT_FALSE(MeasureJpegError(bytes.substr(0, bytes.size() / 2)));
}

TEST(ImageFormat, RefusesWhatAKindDoesNotHold) {
  const auto refusal = [](int type, ImageFormat format) {
    return ErrorOf([&] { EncodeImageFile(RandomImage(type), format); });
  };
  EXPECT_EQ(refusal(CV_32FC3, ImageFormat::kPng),
            "a PNG file does not hold 32-bit floats in 3 channel(s)");
  EXPECT_THAT(refusal(CV_16UC3, ImageFormat::kJpeg), HasSubstr("does not hold"));
  EXPECT_THAT(refusal(CV_8UC4, ImageFormat::kBmp), HasSubstr("4 channel(s)"));
  EXPECT_THAT(refusal(CV_8UC1, ImageFormat::kExr), HasSubstr("unsigned 8-bit"));
  EXPECT_THAT(ErrorOf([] { EncodeImageFile(cv::Mat(), ImageFormat::kPng); }),
              HasSubstr("no pixels"));
}

TEST(ImageFormat, WritesProfilesAndDescriptions) {
  const std::string profile = Read("profile.png").facts.icc_profile;
  ImageWriting writing;
  writing.icc_profile = profile;
  writing.description = "what it shows";
  for (const ImageFormat format : {ImageFormat::kPng, ImageFormat::kTiff, ImageFormat::kJpeg}) {
    const ImageFacts facts =
        DecodeImageFile(EncodeImageFile(RandomImage(CV_8UC3), format, writing), "m").facts;
    EXPECT_EQ(facts.icc_profile, profile) << NameOf(format);
    EXPECT_EQ(facts.description, format == ImageFormat::kPng ? "" : "what it shows");
  }
  ImageWriting linear;
  linear.is_linear = true;
  EXPECT_EQ(DecodeImageFile(EncodeImageFile(RandomImage(CV_16UC3), ImageFormat::kPng, linear), "m")
                .facts.transfer,
            StatedTransfer::kLinear);
}

}  // namespace
}  // namespace thicklens::io
