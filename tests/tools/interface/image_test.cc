#include "thicklens/image.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/opencv.h"

namespace thicklens {
namespace {

using testing::ErrorOf;

TEST(ImageTest, BlueFirstIsRearranged) {
  const Image image = Image::FromEncoded(2, 1, ChannelOrder::kBgr, 8, {1, 2, 3, 4, 5, 6});
  EXPECT_EQ(image.order(), ChannelOrder::kRgb);
  EXPECT_EQ(image.encoded().values, (std::vector<std::uint16_t>{3, 2, 1, 6, 5, 4}));
}

TEST(ImageTest, AlphaStaysLast) {
  const Image image = Image::FromEncoded(1, 1, ChannelOrder::kBgra, 8, {1, 2, 3, 200});
  EXPECT_EQ(image.encoded().values, (std::vector<std::uint16_t>{3, 2, 1, 200}));
  EXPECT_EQ(image.WithoutAlpha().encoded().values, (std::vector<std::uint16_t>{3, 2, 1}));
}

// Reading an image of cv::imread in the wrong order would change the grey by the difference of the
// weights of red and blue.
TEST(ImageTest, MatricesKeepTheirColoursInBothOrders) {
  cv::Mat mat(2, 2, CV_8UC3, cv::Scalar(10, 20, 30));  // blue, green, red
  const Image image = ImageFromMat(mat, ChannelOrder::kBgr);
  EXPECT_EQ(image.encoded().values[0], 30);
  EXPECT_EQ(image.encoded().values[2], 10);
  const cv::Mat back = MatFromImage(image, ChannelOrder::kBgr);
  EXPECT_EQ(cv::countNonZero(back.reshape(1) != mat.reshape(1)), 0);
  EXPECT_EQ(MatFromImage(image, ChannelOrder::kRgb).at<cv::Vec3b>(1, 1), cv::Vec3b(30, 20, 10));
}

TEST(ImageTest, ARectangleKeepsCurveAndName) {
  const Image image = Image::FromEncoded(3, 2, ChannelOrder::kGrey, 8, {1, 2, 3, 4, 5, 6},
                                         TransferCurve::Linear(), "a.png");
  const Image part = image.Cropped({1, 0, 2, 2});
  EXPECT_EQ(part.width_px(), 2);
  EXPECT_EQ(part.encoded().values, (std::vector<std::uint16_t>{2, 3, 5, 6}));
  ASSERT_TRUE(part.transfer());
  EXPECT_EQ(part.transfer()->Name(), TransferCurve::Linear().Name());
  EXPECT_EQ(part.source(), "a.png");
  EXPECT_EQ(ErrorOf([&] { image.Cropped({2, 0, 2, 2}); }).rfind("a.png: ", 0), 0U);
}

TEST(ImageTest, TheBytesOfAFileAreThoseThatAreWritten) {
  const testing::TemporaryFolder folder;
  const Image light =
      Image::FromLight(2, 1, ChannelOrder::kGrey, {0.25F, 1.5F}, TransferCurve::Linear());
  ImageFileOptions options;
  options.bits = 16;
  options.description = "two pixels";
  const EncodedImageFile file = EncodeImage(light, options);
  EXPECT_EQ(file.clipped_values, 1U);
  EXPECT_EQ(WriteImage(folder / "a.png", light, options), 1U);
  EXPECT_EQ(testing::ContentOf(folder / "a.png"), file.bytes);
  EXPECT_EQ(ReadImage(folder / "a.png").encoded().values,
            (std::vector<std::uint16_t>{16384, 65535}));
}

TEST(ImageTest, LightIsEncodedByItsCurve) {
  const Image light = Image::FromLight(3, 1, ChannelOrder::kGrey, {0.25F, 1.5F, -0.1F},
                                       TransferCurve::Gamma(2), "rendered");
  const Image stored = light.Encoded(8);
  EXPECT_EQ(stored.bits(), 8);
  EXPECT_EQ(stored.encoded().values, (std::vector<std::uint16_t>{128, 255, 0}));  // 127.5 is up
  EXPECT_EQ(light.Encoded(16).encoded().values, (std::vector<std::uint16_t>{32768, 65535, 0}));
  ASSERT_TRUE(stored.transfer());
  EXPECT_EQ(*stored.transfer(), TransferCurve::Gamma(2));
  EXPECT_EQ(stored.source(), "rendered");
  EXPECT_EQ(stored.Encoded(8).encoded().values, stored.encoded().values);
  EXPECT_EQ(ErrorOf([&] { stored.Encoded(16); }),
            "rendered: its values are encoded in 8 bits already, 16 are requested");
  EXPECT_EQ(ErrorOf([&] { light.Encoded(12); }), "rendered: 8 or 16 bits are expected, found 12");
  EXPECT_EQ(ErrorOf([] { Image().Encoded(8); }),
            "image: at least one pixel is expected, found an empty image");
}

TEST(ImageTest, AFileNeedsPixelsAndHasTheirBits) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "a.png";
  EXPECT_TRUE(Image().is_empty());
  EXPECT_EQ(ErrorOf([&] { WriteImage(path, Image()); }),
            path + ": image: at least one pixel is expected, found an empty image");
  ImageFileOptions options;
  options.bits = 16;
  const Image of_8 = Image::FromEncoded(1, 1, ChannelOrder::kGrey, 8, {7});
  EXPECT_FALSE(of_8.is_empty());
  try {
    WriteImage(path, of_8, options);
    ADD_FAILURE();
  } catch (const OptionError& error) {
    EXPECT_EQ(error.field(), "bits");
  }
  EXPECT_TRUE(folder.Entries().empty());
  const Image of_16 = Image::FromEncoded(1, 1, ChannelOrder::kGrey, 16, {7});
  for (const int bits : {8, 16}) {
    options.bits = bits;
    WriteImage(path, of_16, options);
    EXPECT_EQ(ReadImage(path).bits(), 16);
  }
}

TEST(ImageTest, DepthMapsBecomeMatricesAndBack) {
  const DepthMeaning millimetres{DepthKind::kZ, LengthUnit::kMillimetre};
  const cv::Mat of_8 = (cv::Mat_<std::uint8_t>(1, 3) << 0, 7, 255);
  const DepthMap whole = DepthMapFromMat(of_8, millimetres, "map");
  EXPECT_TRUE(whole.is_integer);
  EXPECT_EQ(whole.width_px, 3);
  EXPECT_EQ(whole.height_px, 1);
  EXPECT_EQ(whole.values, (std::vector<float>{0, 7, 255}));
  EXPECT_EQ(whole.meaning.unit, LengthUnit::kMillimetre);
  EXPECT_EQ(whole.source, "map");
  const cv::Mat of_16 = (cv::Mat_<std::uint16_t>(2, 2) << 1, 2, 3, 65535);
  const cv::Mat again = MatFromDepthMap(DepthMapFromMat(of_16, millimetres));
  ASSERT_EQ(again.type(), CV_16UC1);
  EXPECT_EQ(cv::countNonZero(again != of_16), 0);
  const cv::Mat floats = (cv::Mat_<float>(2, 1) << 0.5F, -3.25F);
  const DepthMap map = DepthMapFromMat(floats, {DepthKind::kDisparity});
  EXPECT_FALSE(map.is_integer);
  const cv::Mat floats_again = MatFromDepthMap(map);
  ASSERT_EQ(floats_again.type(), CV_32FC1);
  EXPECT_EQ(cv::countNonZero(floats_again != floats), 0);
}

TEST(ImageTest, RefusesMatricesThatAreNoDepthMap) {
  const DepthMeaning disparity{DepthKind::kDisparity};
  EXPECT_THROW(DepthMapFromMat(cv::Mat(1, 1, CV_8UC1), DepthMeaning()), OptionError);
  EXPECT_EQ(ErrorOf([&] { DepthMapFromMat(cv::Mat(), disparity, "map"); }),
            "map: the matrix is empty");
  EXPECT_THROW(DepthMapFromMat(cv::Mat(1, 1, CV_32FC3), disparity), Error);
  EXPECT_THROW(DepthMapFromMat(cv::Mat(1, 1, CV_64FC1), disparity), Error);
  EXPECT_THROW(MatFromDepthMap(DepthMap()), OptionError);
  for (const float value : {0.5F, -1.0F, 65536.0F, std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_THROW(MatFromDepthMap(DepthMap{1, 1, {value}, true, disparity, ""}), Error) << value;
  }
}

TEST(ImageTest, AnEmptyFrameIsNamed) {
  class EmptyFrames : public FrameSource {
   public:
    Image Read(std::size_t /*index*/) const override { return {}; }
  };
  Sweep sweep;
  sweep.description.frames = {{"", 1}, {"frames/b.png", 2}};
  sweep.frames = std::make_shared<EmptyFrames>();
  const calib::FocusSweep measured = FocusSweepOf(sweep);
  EXPECT_EQ(ErrorOf([&] { measured.read_frame(0); }),
            "frame 0: FrameSource::Read returned an empty image");
  EXPECT_EQ(ErrorOf([&] { measured.read_frame(1); }),
            "frame 1 (frames/b.png): FrameSource::Read returned an empty image");
  EXPECT_EQ(ErrorOf([] { MatFromImage(Image(), ChannelOrder::kGrey); }), "image: it is empty");
}

TEST(ImageTest, RefusesWhatDoesNotFit) {
  EXPECT_THROW(Image::FromEncoded(0, 1, ChannelOrder::kGrey, 8, {}), Error);
  EXPECT_THROW(Image::FromEncoded(1, 1, ChannelOrder::kGrey, 12, {1}), Error);
  EXPECT_THROW(Image::FromEncoded(1, 1, ChannelOrder::kGrey, 8, {256}), Error);
  EXPECT_THROW(Image::FromEncoded(1, 1, ChannelOrder::kRgb, 8, {1}), Error);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(Image::FromLight(1, 1, ChannelOrder::kGrey, {nan}), Error);
  EXPECT_THROW(ImageFromMat(cv::Mat(), ChannelOrder::kBgr), Error);
  EXPECT_THROW(ImageFromMat(cv::Mat(1, 1, CV_8UC3), ChannelOrder::kGrey), Error);
  EXPECT_THROW(ImageFromMat(cv::Mat(1, 1, CV_64FC1), ChannelOrder::kGrey), Error);
}

}  // namespace
}  // namespace thicklens
