// The full scale of a sweep's frames, from their values and from what is stated.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "thicklens/opencv.h"
#include "thicklens/simulate.h"
#include "thicklens/sweep.h"
#include "tools/interface/stated_transfer.h"
#include "tools/io/image_library.h"
#include "tools/support/bench_simulation.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::SmallBenchSimulation;
using testing::TemporaryFolder;

// Two frames of 16 bits that show every value from 0 to `highest`, one step per pixel; the last 100
// pixels have `highest`.
class ExamineFramesTest : public ::testing::Test {
 protected:
  Sweep SweepOf(int highest, int clipped, const TransferCurve& transfer = TransferCurve::Linear()) {
    Sweep sweep;
    sweep.camera = SmallBenchSimulation().camera;
    sweep.camera.sensor.transfer = transfer;
    sweep.description.source = "sweep.yaml";
    for (const std::string name : {"f0.tif", "f1.tif"}) {
      cv::Mat frame(256, 256, CV_16U);
      for (int i = 0; i < 65536; ++i) {
        frame.at<std::uint16_t>(i / 256, i % 256) =
            static_cast<std::uint16_t>(i >= 65536 - clipped ? highest : i % highest);
      }
      io::ImageWriting linear;
      linear.is_linear = true;
      const std::string path = folder_ / name;
      WriteFileAtomically(path, io::EncodeImageFile(frame, io::ImageFormat::kTiff, linear));
      sweep.description.frames.push_back({path, 0});
    }
    return sweep;
  }

  TemporaryFolder folder_;
};

TEST_F(ExamineFramesTest, ClippedValuesOfTenBitsAreScaled) {
  const Sweep sweep = ExamineFrames(SweepOf(1023, 100));
  ASSERT_TRUE(sweep.description.full_scale);
  EXPECT_EQ(*sweep.description.full_scale, 1023);
  EXPECT_THAT(sweep.full_scale_reason, HasSubstr("right-aligned values of 10 bits"));
  const cv::Mat frame = FocusSweepOf(sweep).read_frame(0);
  EXPECT_EQ(frame.at<std::uint16_t>(255, 255), 65535);
}

TEST_F(ExamineFramesTest, DarkValuesAreRefusedWithTheOption) {
  EXPECT_THAT(ErrorOf([&] { ExamineFrames(SweepOf(760, 0)); }),
              AllOf(HasSubstr("sweep.yaml"), HasSubstr("759 of 65535"),
                    HasSubstr("full_scale 1023, or 65535 for 16 bits")));
}

TEST_F(ExamineFramesTest, WhereTheScaleDoesNotMatterItIsANotice) {
  const Sweep sweep = ExamineFrames(SweepOf(3000, 0));
  EXPECT_FALSE(sweep.description.full_scale);
  EXPECT_THAT(sweep.notices, Contains(HasSubstr("full_scale 4095")));
  EXPECT_THAT(ErrorOf([&] { ExamineFrames(SweepOf(3000, 0, TransferCurve::Srgb())); }),
              HasSubstr("full_scale 4095"));
}

TEST_F(ExamineFramesTest, AStatedFullScaleIsUsedAsItIs) {
  Sweep sweep = SweepOf(760, 0);
  sweep.description.full_scale = 1023;
  sweep = ExamineFrames(sweep);
  EXPECT_EQ(sweep.description.full_scale, 1023);
  EXPECT_THAT(sweep.notices, IsEmpty());
  sweep.description.full_scale = 700;
  EXPECT_THAT(ErrorOf([&] { FocusSweepOf(sweep).read_frame(1); }),
              AllOf(HasSubstr("f1.tif"), HasSubstr("above the full scale of 700")));
}

TEST_F(ExamineFramesTest, RawFramesNeedACameraWithLinearValues) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts";
  Sweep sweep;
  sweep.camera = SmallBenchSimulation().camera;
  sweep.camera.sensor.transfer = TransferCurve::Srgb();
  sweep.description.frames = {{THICKLENS_SOURCE_DIR "/tests/data/images/mosaic.dng", 0}};
  EXPECT_THAT(ErrorOf([&] { ExamineFrames(sweep); }),
              AllOf(HasSubstr("mosaic.dng"), HasSubstr("linear"), HasSubstr("srgb")));
  sweep.camera.sensor.transfer = TransferCurve::Linear();
  const Sweep examined = ExamineFrames(sweep);
  EXPECT_FALSE(examined.description.full_scale);
  EXPECT_EQ(examined.full_scale_reason, "the files state it");
}

TEST(StatedTransfer, AContradictionHasBothValues) {
  Camera camera;
  camera.name = "bench";
  io::ImageFacts facts;
  EXPECT_EQ(TransferContradiction(facts, camera), "");
  facts.transfer = io::StatedTransfer::kLinear;
  camera.sensor.transfer = TransferCurve::Srgb();
  EXPECT_THAT(
      TransferContradiction(facts, camera),
      AllOf(HasSubstr("curve linear"), HasSubstr("camera 'bench' has sensor.transfer: srgb")));
  camera.sensor.transfer = TransferCurve::Linear();
  EXPECT_EQ(TransferContradiction(facts, camera), "");
  facts.transfer = io::StatedTransfer::kPq;
  EXPECT_THAT(TransferContradiction(facts, camera), HasSubstr("PQ"));
  facts.transfer = io::StatedTransfer::kGamma;
  facts.gamma = 2.2;
  camera.sensor.transfer = TransferCurve::Srgb();
  EXPECT_EQ(TransferContradiction(facts, camera), "");
  camera.sensor.transfer = TransferCurve::Gamma(2.2);
  EXPECT_EQ(TransferContradiction(facts, camera), "");
}

}  // namespace
}  // namespace thicklens
