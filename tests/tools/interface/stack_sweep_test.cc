// A sweep whose frames are the pages of one file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/data_hash.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/sweep.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

constexpr char kImages[] = THICKLENS_SOURCE_DIR "/tests/data/images/";

// tests/data/images/stack.ome.tif has two pages of 6 x 5 px, 2.5 um apart; the second has values
// one higher than the first.
class StackSweepTest : public ::testing::Test {
 protected:
  StackSweepTest() {
    stack_ = folder_ / "stack.ome.tif";
    fs::copy_file(std::string(kImages) + "stack.ome.tif", stack_);
    overrides_.camera_path = folder_.Put(
        "camera.yaml",
        "schema: thicklens/camera/2\nname: bench\n"
        "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, "
        "aperture_radius_mm: 9}\n"
        "sensor: {width_px: 6, height_px: 5, pixel_pitch_mm: 0.005, principal_point_px: [3, 2], "
        "transfer: linear}\n");
  }

  TemporaryFolder folder_;
  std::string stack_;
  SweepOverrides overrides_;
};

TEST_F(StackSweepTest, TakesPositionsFromTheOmeXml) {
  const Sweep sweep = ReadSweepFolder(stack_, "", overrides_);
  ASSERT_EQ(sweep.description.frames.size(), 2U);
  EXPECT_EQ(sweep.description.frames[1].page, 1);
  EXPECT_DOUBLE_EQ(sweep.description.frames[1].reading_mm - sweep.description.frames[0].reading_mm,
                   0.0025);
  EXPECT_THAT(sweep.description.readings,
              AllOf(HasSubstr("PhysicalSizeZ"), HasSubstr("OME-XML of 2 pages")));
}

TEST_F(StackSweepTest, TakesReadingsFromATable) {
  const std::string table =
      folder_.Put("t.csv", "file,z_mm\nstack.ome.tif[0],5\nstack.ome.tif[1],7\n");
  for (const std::string& input : {stack_, folder_.path()}) {
    const Sweep sweep = ReadSweepFolder(input, table, overrides_);
    ASSERT_EQ(sweep.description.frames.size(), 2U) << input;
    EXPECT_EQ(sweep.description.frames[1].reading_mm, 7);
  }
}

TEST_F(StackSweepTest, FramesAreThePages) {
  const Sweep sweep = ReadSweepFolder(stack_, "", overrides_);
  io::FrameFiles files(sweep.description.frames);
  const cv::Mat first = files.Read(0), second = files.Read(1);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 6; ++x) {
      EXPECT_EQ(first.at<unsigned char>(y, x), 10 + 30 * x + 7 * y);
      EXPECT_EQ(second.at<unsigned char>(y, x), 11 + 30 * x + 7 * y);
    }
  }
  EXPECT_THAT(io::FilesReadLine(files.Files()), HasSubstr("2 pages of stack.ome.tif: TIFF"));
  const std::string digest = io::Sha256Hex(ReadWholeFile(stack_));
  EXPECT_EQ(files.DataSha256(), io::Sha256Hex(digest + " 0 0\n" + digest + " 1 0.0025\n"));
}

TEST_F(StackSweepTest, RefusalsSayWhatIsThere) {
  const auto refusal = [&](const std::string& input, const std::string& table) {
    return ErrorOf([&] { ReadSweepFolder(input, table, overrides_); });
  };
  EXPECT_THAT(refusal(stack_, folder_.Put("t.csv", "file,z_mm\nstack.ome.tif,5\n")),
              AllOf(HasSubstr("t.csv:2: "), HasSubstr("has 2 pages"), HasSubstr("OME-XML")));
  const std::string plain = folder_ / "pages.tif";
  fs::copy_file(std::string(kImages) + "pages.tif", plain);
  EXPECT_THAT(refusal(plain, ""),
              AllOf(HasSubstr("no OME-XML"), HasSubstr("--readings"), HasSubstr("'pages.tif[0]'")));
  const std::string one = folder_ / "one.png";
  fs::copy_file(std::string(kImages) + "smooth.png", one);
  EXPECT_THAT(refusal(one, ""), HasSubstr("it has one image; a folder of frames"));
  overrides_.readings.name_pattern = "z{reading}";
  EXPECT_THAT(refusal(stack_, ""), HasSubstr("one name and one set of metadata"));
}

}  // namespace
}  // namespace thicklens
