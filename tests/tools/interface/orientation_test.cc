// Images whose files say that they are shown turned.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <exiv2/exiv2.hpp>
#include <optional>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimate.h"
#include "thicklens/image.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using testing::ErrorOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

constexpr int kWidth = 48, kHeight = 32;

// A photograph that is stored lying: its EXIF says that it is turned clockwise by 90 degrees for
// display. The pixel (0, 0) is white.
class OrientationTest : public ::testing::Test {
 protected:
  std::string Photo() const {
    const std::string path = folder_ / "photo.png";
    model::EncodedImage image{kWidth, kHeight, 1, 8, {}};
    for (int i = 0; i < kWidth * kHeight; ++i)
      image.values.push_back(static_cast<std::uint16_t>(i == 0 ? 255 : 40 + i % 7));
    WriteFileAtomically(path, io::EncodePng(image));
    const auto file = Exiv2::ImageFactory::open(path);
    Exiv2::ExifData exif;
    exif["Exif.Image.Orientation"] = std::uint16_t{6};
    file->setExifData(exif);
    file->writeMetadata();
    return path;
  }

  static DepthMap Depth(int width_px, int height_px) {
    DepthMap depth{width_px, height_px, {}, false, {}, "depth.pfm"};
    depth.values.assign(static_cast<std::size_t>(width_px * height_px), -0.5F);
    depth.meaning.kind = DepthKind::kDisparity;
    return depth;
  }

  static std::string Estimate(const Image& photo, const DepthMap& depth,
                              std::vector<std::string>* notices) {
    EstimateOptions options;
    options.views = ViewCounts{3, 3};
    RunControl run;
    run.notice = [notices](const Notice& notice) { notices->push_back(notice.text); };
    return ErrorOf([&] { EstimateLightField(photo, depth, std::nullopt, options, run); });
  }

  TemporaryFolder folder_;
};

TEST_F(OrientationTest, PixelsAreAsStoredUnlessTurningIsAskedFor) {
  const Image stored = ReadImage(Photo());
  EXPECT_EQ(stored.width_px(), kWidth);
  EXPECT_EQ(stored.facts()->orientation, 6);
  EXPECT_FALSE(stored.facts()->is_orientation_applied);
  EXPECT_EQ(stored.encoded().values.front(), 255);

  ImageReadOptions options;
  options.orientation = Orientation::kDisplayed;
  const Image shown = ReadImage(Photo(), options);
  EXPECT_EQ(shown.width_px(), kHeight);
  EXPECT_EQ(shown.height_px(), kWidth);
  EXPECT_TRUE(shown.facts()->is_orientation_applied);
  EXPECT_EQ(shown.encoded().values[kHeight - 1], 255);  // the top left comes to the top right
}

TEST_F(OrientationTest, AnEstimateSaysThatItIsNotAppliedAndADifferentSizeNamesIt) {
  std::vector<std::string> notices;
  EXPECT_THAT(Estimate(ReadImage(Photo()), Depth(kHeight, kWidth), &notices),
              AllOf(HasSubstr("the sizes must be equal"), HasSubstr("orientation 6 is not applied"),
                    HasSubstr("photo.orientation")));
  EXPECT_THAT(notices, Contains(HasSubstr("orientation 6 is not applied")));
}

TEST_F(OrientationTest, ADepthMapOfTheTurnedImageFitsTheTurnedPhotograph) {
  ImageReadOptions options;
  options.orientation = Orientation::kDisplayed;
  std::vector<std::string> notices;
  EXPECT_EQ(Estimate(ReadImage(Photo(), options), Depth(kHeight, kWidth), &notices), "(no error)");
  EXPECT_THAT(notices, Contains(HasSubstr("orientation 6 is applied")));
}

}  // namespace
}  // namespace thicklens
