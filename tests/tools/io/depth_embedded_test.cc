// Depth maps inside photographs. The files and the right values are those of
// tests/data/embedded_depth/README.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/depth_io.h"
#include "tools/io/depth/embedded_parts.h"
#include "tools/io/depth/jpeg_parts.h"
#include "tools/io/image_library.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;

std::string PhotoWithDepth(const std::string& name) {
  return ReadWholeFile(std::string(THICKLENS_SOURCE_DIR) + "/tests/data/embedded_depth/" + name);
}

EmbeddedDepth DepthInside(const std::string& name) {
  const EmbeddedDepthSearch found = FindEmbeddedDepth(PhotoWithDepth(name), name);
  if (!found.depth) throw Error(name + ": no depth was found");
  return *found.depth;
}

// The depths in the middle of the left and of the right half, below the middle.
std::vector<float> HalvesOf(const EmbeddedDepth& depth) {
  const model::RawDepthMap map = DepthsOf(depth);
  const auto width = static_cast<std::size_t>(map.width_px);
  const std::size_t row = static_cast<std::size_t>(map.height_px) * 3 / 4 * width;
  return {map.values[row + width / 4], map.values[row + width * 3 / 4]};
}

// The bytes with another text of the same length in the place of the first `from`.
std::string Altered(std::string bytes, const std::string& from, const std::string& to) {
  EXPECT_EQ(from.size(), to.size());
  const std::size_t at = bytes.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return bytes.replace(at, from.size(), to);
}

std::string EmbeddedRefusal(const std::string& bytes) {
  std::string message = ErrorOf([&] { FindEmbeddedDepth(bytes, "photo.jpg"); });
  EXPECT_THAT(message, StartsWith("photo.jpg: "));
  return message;
}

auto AboutDepth(float value) { return ::testing::FloatNear(value, 1e-4F * value); }

TEST(EmbeddedDepthTest, GDepthOfInverseRangeIsInDioptres) {
  const EmbeddedDepth depth = DepthInside("gdepth_inverse.jpg");
  EXPECT_EQ(depth.kind, model::DepthKind::kInverse);
  EXPECT_EQ(depth.map.width_px, 32);
  EXPECT_EQ(depth.map.height_px, 24);
  EXPECT_THAT(HalvesOf(depth), ElementsAre(AboutDepth(2.08F), AboutDepth(0.4F)));
  EXPECT_EQ(depth.form, "GDepth");
  EXPECT_THAT(depth.description,
              AllOf(HasSubstr("RangeInverse from 0.4 to 2.5 m along the optical axis"),
                    HasSubstr("PNG, 32 x 24 px")));
  EXPECT_THAT(depth.warnings, IsEmpty());
  EXPECT_FALSE(DepthsOf(depth).integer);
}

TEST(EmbeddedDepthTest, GDepthAlongTheRayIsARangeInMillimetres) {
  const EmbeddedDepth depth = DepthInside("gdepth_linear_ray.jpg");
  EXPECT_EQ(depth.kind, model::DepthKind::kRange);
  EXPECT_THAT(HalvesOf(depth), ElementsAre(AboutDepth(420), AboutDepth(900)));
  EXPECT_THAT(depth.warnings, ElementsAre(HasSubstr("stored as JPEG")));
}

// An inverse range is no inverse depth: it is turned into the range itself.
TEST(EmbeddedDepthTest, AnInverseRangeAlongTheRayIsARange) {
  EmbeddedDepth depth;
  depth.map = {2, 1, {0, 255}, true, 255};
  depth.kind = model::DepthKind::kRange;
  depth.is_inverse = true;
  depth.offset = 2.5;
  depth.scale = (0.5 - 2.5) / 255;
  EXPECT_THAT(DepthsOf(depth).values, ElementsAre(AboutDepth(400), AboutDepth(2000)));
}

TEST(EmbeddedDepthTest, TheExtendedPacketIsPutTogether) {
  const EmbeddedDepth depth = DepthInside("gdepth_extended.jpg");
  EXPECT_EQ(depth.map.width_px, 256);
  EXPECT_EQ(depth.map.height_px, 192);
  for (const auto& [x, y] : {std::pair(0, 0), std::pair(255, 0), std::pair(17, 101)})
    EXPECT_EQ(depth.map.values[static_cast<std::size_t>(256 * y + x)], (37 * x + 101 * y) % 256);
  EXPECT_THAT(depth.notes, Contains(HasSubstr("GDepth:Units is absent, which stands for metres")));
}

// The segments of the extended packet may stand in any order.
TEST(EmbeddedDepthTest, TheExtendedPacketMayBeOutOfOrder) {
  const std::string bytes = PhotoWithDepth("gdepth_extended.jpg");
  const std::string mark("http://ns.adobe.com/xmp/extension/\0", 35);
  const std::size_t first = bytes.find(mark) - 4, second = bytes.find(mark, first + 10) - 4;
  ASSERT_NE(bytes.find(mark, first + 10), std::string::npos) << "the packet has only one segment";
  const auto length = [&](std::size_t at) {
    return 2 + static_cast<std::size_t>(static_cast<unsigned char>(bytes[at + 2])) * 256 +
           static_cast<unsigned char>(bytes[at + 3]);
  };
  ASSERT_EQ(first + length(first), second);
  const std::string swapped = bytes.substr(0, first) + bytes.substr(second, length(second)) +
                              bytes.substr(first, length(first)) +
                              bytes.substr(second + length(second));
  const EmbeddedDepthSearch found = FindEmbeddedDepth(swapped, "photo.jpg");
  ASSERT_TRUE(found.depth);
  EXPECT_EQ(found.depth->map.values, DepthInside("gdepth_extended.jpg").map.values);
  const std::string without = bytes.substr(0, second) + bytes.substr(second + length(second));
  EXPECT_THAT(EmbeddedRefusal(without), HasSubstr("extended XMP: "));
  const std::string doubled =
      bytes.substr(0, second) + bytes.substr(second, length(second)) + bytes.substr(second);
  EXPECT_TRUE(FindEmbeddedDepth(doubled, "photo.jpg").depth);
}

TEST(EmbeddedDepthTest, DynamicDepthIsBehindThePicture) {
  const EmbeddedDepth depth = DepthInside("dynamic_depth.jpg");
  EXPECT_EQ(depth.kind, model::DepthKind::kZ);
  EXPECT_EQ(depth.form, "Dynamic Depth");
  EXPECT_THAT(HalvesOf(depth), ElementsAre(AboutDepth(1400), AboutDepth(3000)));
}

TEST(EmbeddedDepthTest, AnItemOfTheContainerFollowsThoseBeforeIt) {
  const EmbeddedDepth depth = DepthInside("container_depth.jpg");
  EXPECT_EQ(depth.kind, model::DepthKind::kInverse);
  EXPECT_THAT(HalvesOf(depth), ElementsAre(AboutDepth(1.65F), AboutDepth(0.25F)));
}

TEST(EmbeddedDepthTest, WithoutAUnitTheDepthsAreRelative) {
  const EmbeddedDepthSearch found = FindEmbeddedDepth(
      Altered(PhotoWithDepth("dynamic_depth.jpg"), "Meters", "  None"), "photo.jpg");
  ASSERT_TRUE(found.depth);
  EXPECT_FALSE(found.depth->has_unit);
  EXPECT_THAT(found.depth->description, HasSubstr("from 1 to 3 (no unit)"));
}

TEST(EmbeddedDepthTest, ApplesDisparityBehindAJpegIsFoundByItsXmp) {
  const EmbeddedDepth depth = DepthInside("apple_disparity.jpg");
  EXPECT_EQ(depth.kind, model::DepthKind::kInverse);
  EXPECT_THAT(HalvesOf(depth), ElementsAre(AboutDepth(1.01F), AboutDepth(3.05F)));
}

TEST(EmbeddedDepthTest, OtherImagesAreNamed) {
  const auto others = [](const std::string& name) {
    const EmbeddedDepthSearch found = FindEmbeddedDepth(PhotoWithDepth(name), name);
    EXPECT_FALSE(found.depth);
    return found.others;
  };
  EXPECT_THAT(others("second_image.jpg"),
              ElementsAre("a second image of 16 x 12 px that is not stated to be depth"));
  EXPECT_THAT(others("stereo_pair.jpg"), ElementsAre(HasSubstr("a stereo pair")));
  const std::string cut = PhotoWithDepth("second_image.jpg");
  EXPECT_THAT(FindEmbeddedDepth(cut.substr(0, cut.size() - 1), "photo.jpg").others,
              ElementsAre(HasSubstr("outside the 894 bytes of the file")));
}

// The lowest bytes of a number, the highest of them first.
std::string HighFirst(std::size_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xFFU);
  return text;
}

std::string Segment(char marker, const std::string& content) {
  return std::string("\xFF") + marker + HighFirst(content.size() + 2, 2) + content;
}

// An image with an index that lists a second one `images` times, in each of `entries` entries of
// its directory. The second one is an empty image or, with `whole`, a copy of the first one.
std::string WithIndex(std::size_t images, std::size_t entries, bool whole) {
  constexpr std::size_t kHeader = 8, kEntry = 12, kImage = 16, kBegin = 10;
  const std::string empty = "\xFF\xD8\xFF\xD9";
  const std::size_t table = kHeader + 2 + entries * kEntry, end = table + (images + 1) * kImage;
  const std::size_t listed = whole ? end : end + 2;  // from the header of the index
  std::string index = "MPF" + HighFirst(0, 1) + "MM" + HighFirst(42, 2) + HighFirst(kHeader, 4) +
                      HighFirst(entries, 2);
  for (std::size_t i = 0; i < entries; ++i) {
    index += HighFirst(0xB002, 2) + HighFirst(7, 2) + HighFirst((images + 1) * kImage, 4) +
             HighFirst(table, 4);
  }
  for (std::size_t i = 0; i <= images; ++i) {
    index += HighFirst(0, 4) + HighFirst(whole ? kBegin + end : empty.size(), 4) +
             HighFirst(listed, 4) + HighFirst(0, 4);
  }
  const std::string first = "\xFF\xD8" + Segment('\xE2', index);
  return whole ? first + first : first + "\xFF\xD9" + empty;
}

TEST(EmbeddedDepthTest, AnIndexIsTakenOnce) {
  EXPECT_EQ(PartsOfJpeg(WithIndex(200, 3, false), "photo.jpg").images.size(), 200U);
}

// 65 KB may list thousands of images, each as large as the file.
TEST(EmbeddedDepthTest, TheImagesOfAnIndexAreLimited) {
  const std::vector<std::string> many =
      FindEmbeddedDepth(WithIndex(200, 1, false), "photo.jpg").others;
  ASSERT_EQ(many.size(), 101U);
  EXPECT_EQ(many.front(), "a second image of 0 x 0 px that is not stated to be depth");
  EXPECT_THAT(many.back(), HasSubstr("of 201 images, of which 100 behind"));
  const std::vector<std::string> large =
      FindEmbeddedDepth(WithIndex(50, 1, true), "photo.jpg").others;
  ASSERT_EQ(large.size(), 3U);
  EXPECT_THAT(large.back(), HasSubstr("together larger than the"));
}

// Metadata that say nothing of depth may be damaged, in the photograph and in the images behind it.
TEST(EmbeddedDepthTest, DamagedPacketsWithoutDepthAreNoErrors) {
  const std::string photo = PhotoWithDepth("apple_disparity.jpg");
  const std::string xmp_mark("http://ns.adobe.com/xap/1.0/\0", 29);
  const std::string extension_mark("http://ns.adobe.com/xmp/extension/\0", 35);
  const std::string guid = "http://ns.apple.com/pixeldatainf";  // a text of the packet behind
  ASSERT_EQ(guid.size(), 32U);
  ASSERT_NE(photo.find(guid), std::string::npos);
  const std::string packet = Segment('\xE1', xmp_mark + "<a>" + guid + "</a>");
  const std::string cut = Segment(
      '\xE1', extension_mark + guid + HighFirst(1000, 4) + HighFirst(0, 4) + "<b>http://x/</b>");
  const std::size_t behind = photo.find("\xFF\xD8\xFF", 1) + 2;
  const auto with = [&](std::size_t at, const std::string& segments) {
    return photo.substr(0, at) + segments + photo.substr(at);
  };
  // The index states the length of the image behind; without one that image is found as well.
  const std::string longer = Altered(with(behind, cut), "MPF", "XPF");
  for (const std::string& bytes :
       {with(2, Segment('\xE1', xmp_mark + "<a>")), with(2, packet + cut), longer}) {
    EXPECT_TRUE(FindEmbeddedDepth(bytes, "photo.jpg").depth);
  }
  const std::string stated = "<a xmlns:GDepth='http://ns.google.com/photos/1.0/depthmap/'>";
  EXPECT_THAT(EmbeddedRefusal(with(2, Segment('\xE1', xmp_mark + stated))),
              HasSubstr("not valid XML"));
  EXPECT_THAT(EmbeddedRefusal(with(2, Segment('\xE1', xmp_mark + stated + guid + "</a>") + cut)),
              HasSubstr("extended XMP: 16 of its 1000 bytes"));
}

TEST(EmbeddedDepthTest, HeicStatesItsMeaningInTheXmpOfTheDepthImage) {
  if (!HasImageLibrary()) GTEST_SKIP() << "this build reads no HEIF";
  const EmbeddedDepth disparity = DepthInside("apple_disparity.heic");
  EXPECT_EQ(disparity.kind, model::DepthKind::kInverse);
  // The pixels come as they are stored, though both images state to be turned.
  EXPECT_EQ(disparity.map.width_px, 128);
  EXPECT_EQ(disparity.map.height_px, 64);
  EXPECT_THAT(HalvesOf(disparity), ElementsAre(AboutDepth(0.9F), AboutDepth(2.5F)));
  EXPECT_THAT(disparity.warnings, IsEmpty());
  const EmbeddedDepth z = DepthInside("apple_depth.heic");
  EXPECT_EQ(z.kind, model::DepthKind::kZ);
  EXPECT_THAT(HalvesOf(z), ElementsAre(AboutDepth(1400), AboutDepth(3000)));
  EXPECT_THAT(z.warnings, ElementsAre(HasSubstr("depthData:Accuracy is relative")));
  EXPECT_THAT(EmbeddedRefusal(PhotoWithDepth("apple_wrong_range.heic")),
              AllOf(HasSubstr("apdi:FloatMinValue is 3"), HasSubstr("apdi:FloatMaxValue is 0.5")));
  const EmbeddedDepthSearch none =
      FindEmbeddedDepth(PhotoWithDepth("depth_without_xmp.heic"), "photo.heic");
  EXPECT_FALSE(none.depth);
  EXPECT_THAT(none.others, ElementsAre(HasSubstr("a depth image of 128 x 64 px whose unit")));
}

TEST(EmbeddedDepthTest, WrongFieldsOfGDepthAreNamed) {
  const std::string photo = PhotoWithDepth("gdepth_inverse.jpg");
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, ">0.4<", ">2.5<")),
              AllOf(HasSubstr("GDepth:Near is 2.5 and GDepth:Far is 2.5"),
                    HasSubstr("0 < Near < Far is expected")));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, ">0.4<", ">abc<")), HasSubstr("GDepth:Near is 'abc'"));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, ">0.4<", ">nan<")), HasSubstr("GDepth:Near is 'nan'"));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, ">RangeInverse<", ">InverseRange<")),
              AllOf(HasSubstr("GDepth:Format is 'InverseRange'"),
                    HasSubstr("RangeInverse or RangeLinear is expected")));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, ">m<", ">y<")),
              AllOf(HasSubstr("GDepth:Units is 'y'"), HasSubstr("m or mm is expected")));
  const std::string data = "<GDepth:Data>iVBORw0K";
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, data, "<GDepth:Data>iVB!Rw0K")),
              AllOf(HasSubstr("GDepth:Data: character"), HasSubstr("is '!'")));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, data, "<GDepth:Data>AAAAAAAA")),
              HasSubstr("a PNG or JPEG image is expected"));
  std::string without = Altered(photo, "<GDepth:Data>", "<GDepth:Dada>");
  EXPECT_THAT(EmbeddedRefusal(Altered(without, "</GDepth:Data>", "</GDepth:Dada>")),
              HasSubstr("GDepth:Data is missing"));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, "</rdf:RDF>", "</rdf:RDD>")),
              HasSubstr("not valid XML"));
}

TEST(EmbeddedDepthTest, WrongItemsOfAContainerAreNamed) {
  const std::string photo = PhotoWithDepth("dynamic_depth.jpg");
  EXPECT_THAT(EmbeddedRefusal(photo.substr(0, photo.size() - 1)),
              AllOf(HasSubstr("item 2 of the container (android/depthmap)"),
                    HasSubstr("the file ends at 4867")));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, "Length>79<", "Length>-1<")), HasSubstr("is '-1'"));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, "Length>79<", "Length>00<")),
              HasSubstr("Item:Length"));
  EXPECT_THAT(EmbeddedRefusal(Altered(photo, "Length>79<", "Length>78<")),
              HasSubstr("android/depthmap"));
  const std::string uri = "<DepthMap:DepthURI>android/depthmap<";
  const std::string other =
      Altered(Altered(photo, uri, "<DepthMap:DepthURI>android/depthmaq<"), ">Depth<", ">Dopth<");
  EXPECT_THAT(EmbeddedRefusal(other),
              AllOf(HasSubstr("DepthMap:DepthURI is 'android/depthmaq'"),
                    HasSubstr("which has 'primary_image', 'android/depthmap'")));
}

// No damage may crash, hang or allocate what the file cannot hold.
TEST(EmbeddedDepthTest, DamagedFilesAreReadOrRefused) {
  std::mt19937 random(37);
  for (const char* name : {"gdepth_inverse.jpg", "dynamic_depth.jpg", "container_depth.jpg",
                           "apple_disparity.jpg", "stereo_pair.jpg"}) {
    const std::string whole = PhotoWithDepth(name);
    for (int i = 0; i < 200; ++i) {
      std::string bytes = whole;
      for (int k = 0; k < 4; ++k)
        bytes[random() % bytes.size()] = static_cast<char>(random() & 0xFFU);
      if (i % 4 == 0) bytes.resize(random() % bytes.size());
      try {
        FindEmbeddedDepth(bytes, "photo.jpg");
      } catch (const Error& error) {
        EXPECT_THAT(error.what(), StartsWith("photo.jpg"));
      }
    }
  }
}

TEST(EmbeddedDepthTest, PhotographsWithoutDepthHaveNone) {
  for (const char* name : {"grey.jpg", "orientation6.jpg"}) {
    const std::string path = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/" + name;
    const EmbeddedDepthSearch found = ReadEmbeddedDepthFile(path);
    EXPECT_FALSE(found.depth);
    EXPECT_THAT(found.others, IsEmpty());
  }
  EXPECT_FALSE(FindEmbeddedDepth("", "empty").depth);
  EXPECT_FALSE(FindEmbeddedDepth("\xFF\xD8\xFF", "short").depth);
}

EmbeddedDepth SmallMap() {
  EmbeddedDepth depth;
  depth.map = {2, 2, {0, 100, 0, 100}, true, 255};
  depth.kind = model::DepthKind::kInverse;
  depth.is_inverse = true;
  return depth;
}

TEST(EmbeddedDepthTest, EnlargingInterpolatesTheStoredNumbers) {
  const EmbeddedDepth large = Enlarged(SmallMap(), 8, 8, "photo.jpg");
  const std::vector<float> row(large.map.values.begin(), large.map.values.begin() + 8);
  // Pixel 3.5 of 8 lies between the two columns; the outer quarters are beyond their centres.
  EXPECT_THAT(row, ElementsAre(0, 0, 12.5F, 37.5F, 62.5F, 87.5F, 100, 100));
  EXPECT_THAT(large.notes, ElementsAre(HasSubstr("2 x 2 px and is enlarged to 8 x 8 px")));
}

TEST(EmbeddedDepthTest, EnlargingMixesNothingAcrossHoles) {
  EmbeddedDepth small = SmallMap();
  small.map.values[3] = std::numeric_limits<float>::quiet_NaN();
  const EmbeddedDepth large = Enlarged(small, 8, 8, "photo.jpg");
  std::size_t holes = 0;
  for (const float number : large.map.values) {
    holes += std::isnan(number) ? 1 : 0;
    EXPECT_TRUE(std::isnan(number) || number == 0 || number == 100) << number;
  }
  EXPECT_EQ(holes, 16U);
}

TEST(EmbeddedDepthTest, AnotherAspectRatioIsRefused) {
  EXPECT_THAT(ErrorOf([] { Enlarged(SmallMap(), 80, 10, "photo.jpg"); }),
              AllOf(StartsWith("photo.jpg: "), HasSubstr("2 x 2 px"), HasSubstr("80 x 10 px"),
                    HasSubstr("an equal aspect ratio is expected")));
  EXPECT_THAT(ErrorOf([] { Enlarged(SmallMap(), 1, 1, "photo.jpg"); }),
              HasSubstr("was the photograph made smaller?"));
}

TEST(EmbeddedDepthTest, Base64IsDecoded) {
  EXPECT_EQ(DecodeBase64("", "x"), "");
  EXPECT_EQ(DecodeBase64("QQ==", "x"), "A");
  EXPECT_EQ(DecodeBase64("QUI=", "x"), "AB");
  EXPECT_EQ(DecodeBase64(" QU\r\nJD ", "x"), "ABC");
  EXPECT_EQ(DecodeBase64("QUI", "x"), "AB");  // some writers leave the padding out
  EXPECT_EQ(DecodeBase64("+/8=", "x"), "\xFB\xFF");
  for (const char* wrong : {"Q", "QQ=Q", "Q-==", "QQ===", "QUJDR"})
    EXPECT_NE(ErrorOf([&] { DecodeBase64(wrong, "x"); }), "(no error)") << wrong;
}

}  // namespace
}  // namespace thicklens::io
