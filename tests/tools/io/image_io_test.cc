#include "thicklens/io/image_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/data_hash.h"
#include "thicklens/io/frame_files.h"
#include "tools/support/image_file_bytes.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::TemporaryFolder;
using tools::Encoded;

std::string MessageOf(const std::string& bytes) {
  try {
    DecodeImage(bytes, "some/frame.png");
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

class PngRoundTrip : public ::testing::TestWithParam<std::array<int, 2>> {};

TEST_P(PngRoundTrip, KeepsEveryValue) {
  const auto [channels, bits] = GetParam();
  model::EncodedImage image{7, 5, channels, bits, {}};
  std::mt19937 generator(3);
  std::uniform_int_distribution<int> any(0, bits == 8 ? 255 : 65535);
  for (int i = 0; i < 7 * 5 * channels; ++i)
    image.values.push_back(static_cast<std::uint16_t>(any(generator)));
  const model::EncodedImage back = ToEncodedImage(DecodeImage(EncodePng(image), "memory"));
  EXPECT_EQ(back.width_px, 7);
  EXPECT_EQ(back.height_px, 5);
  EXPECT_EQ(back.channels, channels);
  EXPECT_EQ(back.bits, bits);
  EXPECT_EQ(back.values, image.values);
}

INSTANTIATE_TEST_SUITE_P(ChannelsAndBits, PngRoundTrip,
                         ::testing::Values(std::array<int, 2>{1, 8}, std::array<int, 2>{1, 16},
                                           std::array<int, 2>{3, 8}, std::array<int, 2>{3, 16},
                                           std::array<int, 2>{4, 8}, std::array<int, 2>{4, 16}));

// A round trip alone would not detect red and blue exchanged twice: OpenCV's own order is BGR.
TEST(DecodeImage, GivesRedFirst) {
  const cv::Mat bgr(2, 2, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat rgb = DecodeImage(Encoded(bgr, ".png"), "memory");
  EXPECT_EQ(rgb.at<cv::Vec3b>(1, 1), cv::Vec3b(30, 20, 10));
  const cv::Mat bgra(2, 2, CV_16UC4, cv::Scalar(1000, 2000, 3000, 4000));
  const cv::Mat rgba = DecodeImage(Encoded(bgra, ".png"), "memory");
  EXPECT_EQ(rgba.at<cv::Vec4w>(0, 1), cv::Vec4w(3000, 2000, 1000, 4000));
}

// A JPEG with an EXIF orientation of 6 (to be turned by 90 degrees when shown).
TEST(DecodeImage, DoesNotTurnByExifOrientation) {
  std::string jpeg = Encoded(cv::Mat(8, 24, CV_8U, cv::Scalar(100)), ".jpg");
  const std::string tiff("II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0", 26);
  std::string segment("Exif\0\0", 6);
  segment += tiff;
  const std::string marker("\xFF\xE1\0", 3);
  jpeg.insert(2, marker + static_cast<char>(segment.size() + 2) + segment);
  ASSERT_EQ(
      cv::imdecode(std::vector<unsigned char>(jpeg.begin(), jpeg.end()), cv::IMREAD_COLOR).size(),
      cv::Size(8, 24))
      << "the image must be one that OpenCV would turn";
  EXPECT_EQ(DecodeImage(jpeg, "memory").size(), cv::Size(24, 8));
}

TEST(DecodeImage, NamesTheFileThatIsNoImage) {
  for (const std::string& bytes : {std::string(), std::string("hello"), std::string(4096, 'x')}) {
    EXPECT_THAT(MessageOf(bytes), StartsWith("some/frame.png: cannot be decoded as an image"));
  }
}

TEST(DecodeImage, RefusesATruncatedPng) {
  cv::Mat noise(64, 64, CV_8U);
  cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
  const std::string whole = Encoded(noise, ".png");
  EXPECT_THAT(MessageOf(whole.substr(0, whole.size() / 2)), HasSubstr("broken PNG: it ends after"));
}

TEST(DecodeImage, RefusesFloats) {
  EXPECT_THAT(MessageOf(Encoded(cv::Mat(4, 4, CV_32F, cv::Scalar(0.5)), ".tiff")),
              AllOf(HasSubstr("8 or 16 bits"), HasSubstr("found 32-bit floats")));
}

// The message is not that of the function inside that fails.
TEST(DecodeImage, SaysWhatIsWrongWithABrokenFile) {
  for (const std::string extension : {".ppm", ".bmp"}) {
    std::string bytes = Encoded(cv::Mat(40, 40, CV_8UC3, cv::Scalar(1, 2, 3)), extension);
    bytes.resize(bytes.size() / 2);
    EXPECT_THAT(MessageOf(bytes), HasSubstr("cannot be decoded as an image")) << extension;
    EXPECT_THAT(MessageOf(bytes), AnyOf(HasSubstr("are expected"), HasSubstr("end of file")))
        << extension;
  }
}

TEST(ReadImageFile, NamesTheMissingFile) {
  try {
    ReadImageFile("/nowhere/frame.png");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), StartsWith("/nowhere/frame.png: cannot be read"));
  }
}

// FIPS 180-2, appendix B.1, and the empty message.
TEST(Sha256Hex, AgreesWithTheStandard) {
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256Hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(FrameFiles, DigestDoesNotDependOnWhatWasReadFirst) {
  const TemporaryFolder folder;
  std::vector<model::SweepFrame> frames;
  for (int i = 0; i < 3; ++i) {
    frames.push_back({folder / ("digest_" + std::to_string(i) + ".png"), 10.5 + i});
    WriteFileAtomically(frames.back().image, Encoded(cv::Mat(4, 4, CV_8U, cv::Scalar(i)), ".png"));
  }
  std::string lines;
  for (const model::SweepFrame& frame : frames) {
    lines += Sha256Hex(ReadWholeFile(frame.image)) + (frame.reading_mm == 10.5   ? " 10.5\n"
                                                      : frame.reading_mm == 11.5 ? " 11.5\n"
                                                                                 : " 12.5\n");
  }
  FrameFiles unread(frames);
  FrameFiles backwards(frames);
  for (const std::size_t i : {2U, 0U, 2U}) backwards.Read(i);
  EXPECT_EQ(unread.DataSha256(), Sha256Hex(lines));
  EXPECT_EQ(backwards.DataSha256(), Sha256Hex(lines));

  frames[1].reading_mm = 11.50001;
  EXPECT_NE(FrameFiles(frames).DataSha256(), Sha256Hex(lines)) << "readings belong to the data";
}

}  // namespace
}  // namespace thicklens::io
