// Photographs with ICC profiles, which Little CMS makes here from known curves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lcms2.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/image.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/light_field.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::io {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

// x and y of red, green and blue in CIE 1931.
using Primaries = std::array<double, 6>;
constexpr Primaries kSrgbPrimaries = {0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
constexpr Primaries kDisplayP3 = {0.680, 0.320, 0.265, 0.690, 0.150, 0.060};

std::string Saved(cmsHPROFILE profile) {
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile, nullptr, &size);
  std::string bytes(size, '\0');
  cmsSaveProfileToMem(profile, bytes.data(), &size);
  cmsCloseProfile(profile);
  return bytes;
}

// The profile of a display with these primaries, white D65, and one curve. Frees the curve.
std::string RgbProfile(const Primaries& xy, cmsToneCurve* curve) {
  const cmsCIExyY white{0.3127, 0.3290, 1};
  const cmsCIExyYTRIPLE primaries{{xy[0], xy[1], 1}, {xy[2], xy[3], 1}, {xy[4], xy[5], 1}};
  cmsToneCurve* curves[] = {curve, curve, curve};
  const std::string bytes = Saved(cmsCreateRGBProfile(&white, &primaries, curves));
  cmsFreeToneCurve(curve);
  return bytes;
}

std::string GreyProfile(double gamma) {
  cmsToneCurve* curve = cmsBuildGamma(nullptr, gamma);
  const std::string bytes = Saved(cmsCreateGrayProfile(cmsD50_xyY(), curve));
  cmsFreeToneCurve(curve);
  return bytes;
}

// IEC 61966-2-1 as the parametric curve of ICC.1:2010, table 65, function type 3.
cmsToneCurve* SrgbCurve() {
  const double values[] = {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  return cmsBuildParametricToneCurve(nullptr, 4, values);
}

// A curve of no camera: light = value^2 (3 - 2 value).
cmsToneCurve* SCurve() {
  std::vector<cmsUInt16Number> table;
  for (int i = 0; i < 1024; ++i) {
    const double value = i / 1023.0;
    table.push_back(
        static_cast<cmsUInt16Number>(std::lround(65535 * value * value * (3 - 2 * value))));
  }
  return cmsBuildTabulatedToneCurve16(nullptr, 1024, table.data());
}

cv::Mat Ramp(int channels) {
  cv::Mat image(4, 64, CV_MAKETYPE(CV_16U, channels));
  for (int y = 0; y < image.rows; ++y) {
    for (int i = 0; i < image.cols * channels; ++i)
      image.ptr<std::uint16_t>(y)[i] =
          static_cast<std::uint16_t>(1000 + i * 60000 / (64 * channels));
  }
  return image;
}

std::string PngWith(const std::string& profile, int channels = 3) {
  ImageWriting writing;
  writing.icc_profile = profile;
  return EncodeImageFile(Ramp(channels), ImageFormat::kPng, writing);
}

ImageFacts FactsWith(const std::string& profile, int channels = 3) {
  ImageFacts facts;
  DecodeImage(PngWith(profile, channels), "a.png", &facts);
  return facts;
}

TEST(ColourProfile, StatesTheTransferCurve) {
  const ImageFacts p3 = FactsWith(RgbProfile(kDisplayP3, SrgbCurve()));
  EXPECT_EQ(p3.transfer, StatedTransfer::kSrgb);
  EXPECT_FALSE(p3.icc_profile.empty());

  constexpr double kAdobe = 563.0 / 256;
  const ImageFacts adobe = FactsWith(RgbProfile(kSrgbPrimaries, cmsBuildGamma(nullptr, kAdobe)));
  EXPECT_EQ(adobe.transfer, StatedTransfer::kGamma);
  EXPECT_NEAR(adobe.gamma, kAdobe, 1e-3);

  const ImageFacts linear = FactsWith(RgbProfile(kSrgbPrimaries, cmsBuildGamma(nullptr, 1)));
  EXPECT_EQ(linear.transfer, StatedTransfer::kLinear);

  const ImageFacts grey = FactsWith(GreyProfile(1.8), 1);
  EXPECT_EQ(grey.transfer, StatedTransfer::kGamma);
  EXPECT_NEAR(grey.gamma, 1.8, 1e-3);
}

TEST(ColourProfile, LeavesValuesOfAKnownCurveAsTheyAre) {
  const std::string png = PngWith(RgbProfile(kDisplayP3, SrgbCurve()));
  EXPECT_EQ(cv::norm(DecodeImage(png, "a.png"), Ramp(3), cv::NORM_INF), 0);
}

// The primaries are those of sRGB, so that the conversion is that of each channel alone.
TEST(ColourProfile, ConvertsValuesOfAnotherCurve) {
  ImageFacts facts;
  const cv::Mat converted =
      DecodeImage(PngWith(RgbProfile(kSrgbPrimaries, SCurve())), "a.png", &facts);
  EXPECT_EQ(facts.transfer, StatedTransfer::kSrgb);
  EXPECT_EQ(facts.icc_profile, "");
  EXPECT_THAT(facts.notes, Contains(HasSubstr("converted to sRGB")));
  const cv::Mat ramp = Ramp(3);
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  for (int x = 4; x < ramp.cols; ++x) {  // the darkest are those of a table
    for (int c = 0; c < 3; ++c) {
      const double value = ramp.at<cv::Vec3w>(0, x)[c] / 65535.0;
      const double expected = 65535 * srgb.Encode(value * value * (3 - 2 * value));
      EXPECT_NEAR(converted.at<cv::Vec3w>(0, x)[c], expected, 65535 / 1000.0) << x << ' ' << c;
    }
  }
}

TEST(ColourProfile, ConvertsGrey) {
  cmsToneCurve* curve = SCurve();
  const std::string profile = Saved(cmsCreateGrayProfile(cmsD50_xyY(), curve));
  cmsFreeToneCurve(curve);
  const cv::Mat converted = DecodeImage(PngWith(profile, 1), "a.png");
  ASSERT_EQ(converted.type(), CV_16UC1);
  const double value = Ramp(1).at<std::uint16_t>(0, 40) / 65535.0;
  EXPECT_NEAR(converted.at<std::uint16_t>(0, 40),
              65535 * model::TransferCurve::Srgb().Encode(value * value * (3 - 2 * value)),
              65535 / 1000.0);
}

TEST(ColourProfile, IsIgnoredWithAWordIfItDoesNotFit) {
  EXPECT_THAT(FactsWith(GreyProfile(2.2)).notes, Contains(HasSubstr("for other channels")));
  EXPECT_THAT(FactsWith("no profile at all").notes, Contains(HasSubstr("damaged")));
  std::string broken = RgbProfile(kSrgbPrimaries, SrgbCurve());
  for (std::size_t i = 130; i < broken.size(); i += 7) broken[i] = '\xFF';
  const std::string png = PngWith(broken);
  EXPECT_NO_THROW(DecodeImage(png, "a.png"));
}

TEST(ColourProfile, GoesFromThePhotographToTheLightFieldAndItsViews) {
  const TemporaryFolder folder;
  const std::string profile = RgbProfile(kDisplayP3, SrgbCurve());
  const std::string photo = folder.Put("photo.png", PngWith(profile));
  const Image image = ReadImage(photo);
  EXPECT_EQ(image.ColourProfile(model::TransferCurve::Srgb()), profile);
  EXPECT_EQ(image.ColourProfile(model::TransferCurve::Linear()), "") << "its curve is another one";

  LightField light_field = model::MakeLightField(8, 8, 2, 1, 3);
  light_field.colour_profile = profile;
  WriteLightField(folder / "lf", light_field);
  const LightField read = ReadLightField(folder / "lf");
  EXPECT_EQ(read.colour_profile, profile);
  for (const char* name : {"view.png", "view.jpg", "view.tif"}) {
    WriteImage(folder / name, ViewOf(read, 1, 0));
    EXPECT_EQ(ReadImageData(folder / name).facts.icc_profile, profile) << name;
  }
}

}  // namespace
}  // namespace thicklens::io
