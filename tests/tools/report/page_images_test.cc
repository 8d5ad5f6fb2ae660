#include "tools/report/page_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/transfer_curve.h"

namespace thicklens::tools {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr float kMissing = std::numeric_limits<float>::quiet_NaN();

std::vector<int> Pixel(const cv::Mat& image, int x, int y) {
  std::vector<int> values;
  for (int c = 0; c < image.channels(); ++c) {
    values.push_back(image.ptr<unsigned char>(y)[x * image.channels() + c]);
  }
  return values;
}

// The vectors of RFC 4648, section 10.
TEST(PageImages, Base64IsThatOfTheRfc) {
  const std::pair<const char*, const char*> vectors[] = {{"", ""},
                                                         {"f", "Zg=="},
                                                         {"fo", "Zm8="},
                                                         {"foo", "Zm9v"},
                                                         {"foob", "Zm9vYg=="},
                                                         {"fooba", "Zm9vYmE="},
                                                         {"foobar", "Zm9vYmFy"}};
  for (const auto& [plain, encoded] : vectors) {
    const std::string text = plain;
    EXPECT_EQ(Base64({text.begin(), text.end()}), encoded);
  }
  EXPECT_EQ(Base64({0xfb, 0xff, 0xfe}), "+//+");
}

// CIE lightness from the colour's relative luminance, written out.
double Lightness(const std::array<std::uint8_t, 3>& colour) {
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  const double luminance = 0.2126 * srgb.Decode(colour[0] / 255.0) +
                           0.7152 * srgb.Decode(colour[1] / 255.0) +
                           0.0722 * srgb.Decode(colour[2] / 255.0);
  return 116 * std::cbrt(luminance) - 16;
}

TEST(PageImages, TheMapBecomesLighterEvenly) {
  for (int i = 0; i < 16; ++i) {
    const double step = Lightness(MapColour((i + 1) / 16.0)) - Lightness(MapColour(i / 16.0));
    EXPECT_GT(step, 2.5) << i;  // 80 of lightness over 16 steps are 5 each
    EXPECT_LT(step, 7.5) << i;
  }
  EXPECT_EQ(MapColourCss(-3), "#440154");
  EXPECT_EQ(MapColourCss(7), "#fde725");
}

TEST(PageImages, MapsValuesAndHatchesHoles) {
  const std::vector<float> values = {1, 2, 3, kMissing, kMissing, kMissing};
  const cv::Mat near_dark = ColourMapped(values, 3, 2, {1, 3, false}, 100);
  EXPECT_THAT(Pixel(near_dark, 0, 0), ElementsAre(68, 1, 84));
  EXPECT_THAT(Pixel(near_dark, 1, 0), ElementsAre(33, 144, 141));
  EXPECT_THAT(Pixel(near_dark, 2, 0), ElementsAre(253, 231, 37));
  const std::vector<int> hole = Pixel(near_dark, 1, 1);
  EXPECT_EQ(hole[0], hole[1]);
  EXPECT_EQ(hole[1], hole[2]);
  EXPECT_THAT(Pixel(ColourMapped(values, 3, 2, {1, 3, true}, 100), 0, 0),
              ElementsAre(253, 231, 37));
}

// Between a near and a far half there is no value of the middle, at any size.
TEST(PageImages, ShrinksAMapWithoutMixingDepths) {
  std::vector<float> values;
  for (int i = 0; i < 90 * 7; ++i) values.push_back(i % 90 < 41 ? 1.0F : 2.0F);
  const cv::Mat shown = ColourMapped(values, 90, 7, {1, 2, false}, 17);
  EXPECT_EQ(shown.cols, 17);
  for (int x = 0; x < shown.cols; ++x) {
    // The step is at 41/90 of the width: 7.7 of 17 px.
    EXPECT_THAT(Pixel(shown, x, 0), x < 8 ? ElementsAre(68, 1, 84) : ElementsAre(253, 231, 37))
        << x;
  }
}

// The mean of black and white light is 188 of 255 in sRGB.
TEST(PageImages, ShrinksInLinearLight) {
  model::LinearImage image{8, 2, 1, {}};
  for (int i = 0; i < 16; ++i) image.values.push_back(i % 2 == 0 ? 0.0F : 1.0F);
  const cv::Mat shown = ShownImage(image, 4);
  ASSERT_EQ(shown.size(), cv::Size(4, 1));
  EXPECT_THAT(Pixel(shown, 1, 0), ElementsAre(188));
  EXPECT_THAT(Pixel(ShownImage(image, 8), 1, 0), ElementsAre(255));
}

TEST(PageImages, KeepsWhatLeavesTheRangeInside) {
  const cv::Mat shown = ShownImage({4, 1, 1, {-0.5F, 1.5F, kMissing, 0.5F}}, 10);
  EXPECT_THAT(Pixel(shown, 0, 0), ElementsAre(0));
  EXPECT_THAT(Pixel(shown, 1, 0), ElementsAre(255));
  EXPECT_THAT(Pixel(shown, 3, 0), ElementsAre(188));
}

TEST(PageImages, TakesFramesAsEncoded) {
  cv::Mat deep(1, 1, CV_16UC4, cv::Scalar(65535, 32768, 0, 7));
  EXPECT_THAT(Pixel(ShownImage(deep), 0, 0), ElementsAre(255, 128, 0));
}

TEST(PageImages, DifferencesAreAroundMidGrey) {
  const cv::Mat a(2, 2, CV_8UC3, cv::Scalar(10, 100, 200));
  const cv::Mat b(2, 2, CV_8UC3, cv::Scalar(13, 95, 0));
  EXPECT_THAT(Pixel(AmplifiedDifference(a, b, 4), 1, 1), ElementsAre(116, 148, 255));
}

TEST(PageImages, TheGainFitsTheDifferences) {
  const auto gain = [](int difference) {
    const cv::Mat a(10, 10, CV_8UC1, cv::Scalar(100 + difference));
    const cv::Mat b(10, 10, CV_8UC1, cv::Scalar(100));
    return GainForDifferences({{a, b}});
  };
  EXPECT_EQ(gain(0), 32);
  EXPECT_EQ(gain(7), 16);  // 16 * 7 = 112 fits into 128, 32 * 7 does not
  EXPECT_EQ(gain(100), 1);
  // One pixel in a thousand does not count.
  cv::Mat a(10, 100, CV_8UC1, cv::Scalar(7));
  a.at<unsigned char>(3, 3) = 255;
  EXPECT_EQ(GainForDifferences({{a, cv::Mat::zeros(10, 100, CV_8UC1)}}), 16);
}

TEST(PageImages, SmallImagesAreExactAndCrisp) {
  const cv::Mat small(20, 30, CV_8UC3, cv::Scalar(1, 2, 3));
  const std::string tag = EmbeddedImage(small, "a \"b\"", Packing::kSmall, 100);
  EXPECT_THAT(tag, HasSubstr("<img class=\"crisp\" src=\"data:image/png;base64,iVBOR"));
  EXPECT_THAT(tag, HasSubstr("width=\"30\" height=\"20\" alt=\"a &quot;b&quot;\""));
  EXPECT_THAT(tag, HasSubstr("max-width: 120px"));
  const cv::Mat large(300, 300, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_THAT(EmbeddedImage(large, "", Packing::kSmall, 100), HasSubstr("data:image/jpeg;"));
  EXPECT_THAT(EmbeddedImage(large, "", Packing::kExact, 100), HasSubstr("data:image/png;"));
  EXPECT_THAT(EmbeddedImage(large, "", Packing::kExact, 100), Not(HasSubstr("crisp")));
}

}  // namespace
}  // namespace thicklens::tools
