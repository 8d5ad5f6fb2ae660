#include "tools/io/image_file_kind.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/io/image_file.h"
#include "tools/io/image_library.h"
#include "tools/support/image_file_bytes.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;
using tools::Encoded;

struct Case {
  std::string extension;
  ImageFileKind kind;
  std::vector<int> settings;
};

// Data that compress very well, in every format.
const std::vector<Case>& Cases() {
  static const std::vector<Case> cases = {
      {".png", ImageFileKind::kPng, {cv::IMWRITE_PNG_COMPRESSION, 9}},
      {".jpg", ImageFileKind::kJpeg, {}},
      {".jpg",
       ImageFileKind::kJpeg,
       {cv::IMWRITE_JPEG_OPTIMIZE, 1, cv::IMWRITE_JPEG_PROGRESSIVE, 1, cv::IMWRITE_JPEG_QUALITY,
        1}},
      {".tiff", ImageFileKind::kTiff, {cv::IMWRITE_TIFF_COMPRESSION, 1}},
      {".tiff", ImageFileKind::kTiff, {cv::IMWRITE_TIFF_COMPRESSION, 5}},
      {".tiff", ImageFileKind::kTiff, {cv::IMWRITE_TIFF_COMPRESSION, 8}},
      {".tiff", ImageFileKind::kTiff, {cv::IMWRITE_TIFF_COMPRESSION, 32773}},
      {".bmp", ImageFileKind::kBmp, {}},
      {".pgm", ImageFileKind::kPnm, {cv::IMWRITE_PXM_BINARY, 1}},
      {".pgm", ImageFileKind::kPnm, {cv::IMWRITE_PXM_BINARY, 0}}};
  return cases;
}

std::string EncodedAs(const Case& c, const cv::Mat& image) {
  return Encoded(image, c.extension, c.settings);
}

std::string With(std::string bytes, std::size_t at, const std::string& others) {
  return bytes.replace(at, others.size(), others);
}

TEST(ImageFileKind, EvenImagesCanBeInTheirFiles) {
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.extension);
    const bool is_of_library = c.kind == ImageFileKind::kExr || c.kind == ImageFileKind::kWebp ||
                               c.kind == ImageFileKind::kBmp;
    if (is_of_library && !HasImageLibrary()) continue;
    for (const int size : {1, 3000}) {
      const std::string bytes = EncodedAs(c, cv::Mat(size, size, CV_8U, cv::Scalar(128)));
      EXPECT_EQ(KindOfImage(bytes), c.kind);
      EXPECT_EQ(DecodeImageFile(bytes, "x").pixels.size(), cv::Size(size, size));
    }
  }
}

TEST(ImageFileKind, SizesThatCannotBeAreRefused) {
  const cv::Mat small(16, 16, CV_8U, cv::Scalar(128));
  const auto refusal = [](const std::string& bytes) {
    const auto kind = KindOfImage(bytes);
    return kind ? ErrorOf([&] { RequirePossibleSize(bytes, *kind, "f"); }) : "(no kind)";
  };
  const auto cannot_be = AllOf(StartsWith("f: a broken image: "), HasSubstr("px do not fit into "));

  const std::string png = EncodedAs(Cases()[0], small);
  EXPECT_EQ(refusal(png), "(no error)");
  EXPECT_THAT(refusal(With(png, 16, "\x7F\xFF\xFF\xFF")), cannot_be);

  const std::string jpeg = EncodedAs(Cases()[1], small);
  EXPECT_EQ(refusal(jpeg), "(no error)");
  const std::size_t frame = jpeg.find("\xFF\xC0");
  ASSERT_NE(frame, std::string::npos);
  EXPECT_THAT(refusal(With(jpeg, frame + 5, "\xFF\xF0\xFF\xF0")), cannot_be);

  const std::string tiff = EncodedAs(Cases()[3], small);
  EXPECT_EQ(refusal(tiff), "(no error)");
  using namespace std::string_literals;
  const std::size_t length = tiff.find("\x01\x01\x03\0\x01\0\0\0\x10\0"s);
  ASSERT_NE(length, std::string::npos);  // ImageLength, one short, 16
  const std::string tall = With(tiff, length + 8, "\xFF\xFF"s);
  const std::size_t width = tiff.find("\0\x01\x03\0\x01\0\0\0\x10\0"s);
  ASSERT_NE(width, std::string::npos);
  EXPECT_THAT(refusal(With(tall, width + 8, "\xFF\xFF"s)), cannot_be);

  const std::string bmp = EncodedAs(Cases()[7], small);
  EXPECT_EQ(refusal(bmp), "(no error)");
  EXPECT_THAT(refusal(With(bmp, 18, "\x01\x00\x00\x40\x00\x00\x00\x80"s)), cannot_be);
  // The oldest kind: 12 bytes, sides of 16 bits, one plane, 24 bits.
  const std::string oldest = With(bmp, 14, "\x0C\0\0\0\x10\0\x10\0\x01\0\x18\0"s);
  EXPECT_EQ(refusal(oldest), "(no error)");
  EXPECT_THAT(refusal(With(oldest, 18, "\xFF\xFF\xFF\xFF"s)), cannot_be);
  // A header of a size that no kind has is read as the usual one.
  EXPECT_THAT(refusal(With(With(bmp, 14, "\x18\x18\x18\x18"s), 18, "\x01\x00\x00\x40"s)),
              cannot_be);

  EXPECT_EQ(refusal("P5 # a\n# b\n 16 16 255\n" + std::string(256, 'x')), "(no error)");
  EXPECT_THAT(refusal("P5 # a\n# b\n 16000 16000 255\n" + std::string(256, 'x')), cannot_be);
  EXPECT_THAT(refusal("P6 99999999999999999999 16000"), cannot_be);
  EXPECT_THAT(refusal("P5 #\r16000 16000 255 "), cannot_be);
  EXPECT_THAT(refusal("\xFF\xD8\xFF\x01 \xFF\xD0\xFF\xFF" + jpeg.substr(frame, 5) +
                      "\xFF\xF0\xFF\xF0" + jpeg.substr(frame + 9)),
              cannot_be);
  EXPECT_EQ(refusal("P5"), "(no kind)");
  EXPECT_EQ(KindOfImage("II+\0\x08"s), ImageFileKind::kTiff);

  const std::string exr =
      "\x76\x2F\x31\x01\x02\0\0\0"s
      "owner\0string\0\x02\0\0\0me"s
      "dataWindow\0box2i\0\x10\0\0\0"s +
      std::string(8, '\0');
  EXPECT_EQ(refusal(exr + "\x0F\0\0\0\x0F\0\0\0"s), "(no error)");
  EXPECT_THAT(refusal(exr + "\xFF\xFF\xFF\x7F\xFF\xFF\xFF\x7F"s), cannot_be);
}

// OpenEXR takes the memory for a value before it finds that the file has none.
TEST(ImageFileKind, AttributesLargerThanTheFileAreRefused) {
  using namespace std::string_literals;
  const auto refusal = [](const std::string& bytes) {
    return ErrorOf([&] { RequirePossibleSize(bytes, ImageFileKind::kExr, "f"); });
  };
  const std::string owner = "owner\0string\0\x02\0\0\0me"s;
  const std::string large = "x\0blob\0\0\0\0\x63"s;  // 1.6 GB
  const std::string one = "\x76\x2F\x31\x01\x02\0\0\0"s + owner;
  EXPECT_EQ(refusal(one), "(no error)");
  EXPECT_EQ(refusal(one + "\0"s), "(no error)");
  EXPECT_EQ(refusal(one + large),
            "f: a broken image: 1660944384 bytes of 'x' do not fit into 38 bytes");
  EXPECT_THAT(refusal(one + "x\0blob\0\xFF\xFF\xFF\xFF"s), HasSubstr("-1 bytes of 'x'"));
  EXPECT_EQ(refusal(one + "\0"s + large), "(no error)");  // pixels
  // Several parts: their headers follow one another, and an empty one ends them.
  const std::string several = "\x76\x2F\x31\x01\x02\x10\0\0"s + owner + "\0"s + owner;
  EXPECT_EQ(refusal(several + "\0\0"s + large), "(no error)");
  EXPECT_THAT(refusal(several + large), HasSubstr("1660944384 bytes of 'x'"));
  EXPECT_THAT(refusal(several + "\0"s + large), HasSubstr("1660944384 bytes of 'x'"));
  // Cut off anywhere, and at every place another byte.
  for (std::size_t i = 0; i < several.size(); ++i) {
    refusal(several.substr(0, i));
    refusal(With(several, i, "\x7F"s));
  }
}

TEST(ImageFileKind, IsFoundByTheContents) {
  using namespace std::string_literals;
  EXPECT_EQ(KindOfImage("RIFF....WEBPVP8 "), ImageFileKind::kWebp);
  EXPECT_EQ(KindOfImage("\0\0\0\x14"
                        "ftypheic\0\0\0\0heic"s),
            ImageFileKind::kHeif);
  EXPECT_EQ(KindOfImage("\0\0\0\x18"
                        "ftypmif1\0\0\0\0mif1avif"s),
            ImageFileKind::kHeif);
  EXPECT_EQ(KindOfImage("\0\0\0\x14"
                        "ftypcrx \0\0\0\1crx "s),
            ImageFileKind::kRaw);
  EXPECT_EQ(KindOfImage("FUJIFILMCCD-RAW 0201"), ImageFileKind::kRaw);
  EXPECT_EQ(KindOfImage(std::string(128, '\0') + "DICM"), ImageFileKind::kDicom);
  EXPECT_EQ(KindOfImage("PF\n1 1\n-1\n"), ImageFileKind::kPfm);
  EXPECT_EQ(KindOfImage("P7\nWIDTH 1"), ImageFileKind::kPnm);
  for (const std::string& bytes :
       {""s, "GIF89a"s, "\x0Aplain"s, "NITF02.10"s, "RIFF....AVI "s, "P1["s, "RIFF"s,
        "\0\0\0\x14"
        "ftypisom\0\0\0\0isom"s}) {
    EXPECT_FALSE(KindOfImage(bytes).has_value()) << bytes;
  }
  EXPECT_EQ(NameOfOtherKind("\0\0\0\x14"
                            "ftypisom\0\0\0\0isom"s),
            "MP4 or MOV video");
  EXPECT_EQ(NameOfOtherKind("RIFF....AVI "), "AVI video");
  EXPECT_EQ(NameOfOtherKind("nothing"), "");
}

}  // namespace
}  // namespace thicklens::io
