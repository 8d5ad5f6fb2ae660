// Reading, averaging and checking the files that correct the frames of a sweep.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/frames.h"
#include "thicklens/io/image_file.h"
#include "thicklens/opencv.h"
#include "thicklens/sweep.h"
#include "tools/support/bench_simulation.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using testing::SmallBenchSimulation;
using testing::TemporaryFolder;
using Files = std::vector<std::string>;

constexpr int kSensorSidePx = 144;  // of the sensor of SmallBenchSimulation

class FrameFilesForCorrection : public ::testing::Test {
 protected:
  // Writes a PNG file of 16 bits of a level in parts of full scale, with Gaussian noise.
  std::string Put(const std::string& name, const cv::Mat& light, double noise = 0.002) {
    cv::Mat noisy = light.clone(), stored;
    random_.fill(noisy, cv::RNG::NORMAL, 0, noise);
    noisy += light;
    noisy.convertTo(stored, CV_16U, 65535);
    return PutStored(name, stored);
  }
  std::string PutStored(const std::string& name, const cv::Mat& stored,
                        const io::ImageWriting& writing = {}) {
    const std::string path = folder_ / name;
    WriteFileAtomically(path, io::EncodeImageFile(stored, io::FormatOfName(name), writing));
    return path;
  }
  static cv::Mat Level(double level) {
    return cv::Mat(kSensorSidePx, kSensorSidePx, CV_32F, cv::Scalar(level));
  }
  // Detail of 4 to 20 px, as a target has.
  static cv::Mat Target(double level) {
    cv::Mat target(kSensorSidePx, kSensorSidePx, CV_32F);
    for (int y = 0; y < kSensorSidePx; ++y) {
      for (int x = 0; x < kSensorSidePx; ++x) {
        target.at<float>(y, x) =
            static_cast<float>(level * (1 + 0.4 * std::sin(0.6 * x) * std::sin(0.45 * y)));
      }
    }
    return target;
  }
  static cv::Mat Shading() {
    cv::Mat shading(kSensorSidePx, kSensorSidePx, CV_32F);
    for (int y = 0; y < kSensorSidePx; ++y) {
      for (int x = 0; x < kSensorSidePx; ++x)
        shading.at<float>(y, x) = static_cast<float>(
            1 / (1 + (std::pow(x - 71.5, 2) + std::pow(y - 71.5, 2)) / (71.5 * 71.5)));
    }
    return shading;
  }

  Sweep SweepOf(const std::string& frame) {
    Sweep sweep;
    sweep.camera = SmallBenchSimulation().camera;
    sweep.camera.sensor.transfer = TransferCurve::Linear();
    sweep.description.source = "sweep.yaml";
    sweep.description.full_scale = 65535;
    sweep.description.frames = {{frame, 0}};
    return sweep;
  }
  Sweep Corrected(const Files& dark, const Files& flat, const Files& defects = {}) {
    Sweep sweep = SweepOf(frame_);
    sweep.description.correction = {dark, flat, defects};
    return ExamineFrames(sweep);
  }
  std::string Refusal(const Files& dark, const Files& flat, const Files& defects = {}) {
    return ErrorOf([&] { Corrected(dark, flat, defects); });
  }

  TemporaryFolder folder_;
  cv::RNG random_{7};
  std::string frame_ = Put("f0.png", Target(0.3).mul(Shading()) + 0.05, 0.004);
  std::string dark_ = Put("dark.png", Level(0.05));
  std::string flat_ = Put("flat.png", 0.6 * Shading() + 0.05);
};

TEST_F(FrameFilesForCorrection, APhotographIsCorrectedAsAFrameIs) {
  const Image photo = ReadImage(Put("photo.png", Target(0.3).mul(Shading()) + 0.05, 0));
  const model::CorrectionFiles files{
      {Put("d.png", Level(0.05), 0)}, {Put("f.png", 0.6 * Shading() + 0.05, 0)}, {}};
  const Image corrected = CorrectPhotograph(photo, files, TransferCurve::Linear());
  ASSERT_TRUE(corrected.is_linear());
  EXPECT_EQ(corrected.facts(), photo.facts());
  EXPECT_EQ(corrected.is_from_file(), photo.is_from_file());
  EXPECT_EQ(corrected.source(), photo.source());
  // The flat is divided by its mean.
  const double gain = cv::mean(Shading())[0];
  const cv::Mat target = Target(0.3);
  for (int y = 0; y < kSensorSidePx; y += 5) {
    for (int x = 0; x < kSensorSidePx; x += 5) {
      EXPECT_NEAR(static_cast<double>(
                      corrected.light().values[static_cast<std::size_t>(y * kSensorSidePx + x)]),
                  gain * static_cast<double>(target.at<float>(y, x)), 1e-4);
    }
  }
}

TEST_F(FrameFilesForCorrection, APhotographWithoutFilesStaysAndFloatsAreRefused) {
  const Image photo = ReadImage(frame_);
  EXPECT_FALSE(CorrectPhotograph(photo, {}, TransferCurve::Linear()).is_linear());
  const Image floats = Image::FromLight(2, 1, ChannelOrder::kGrey, {0.1F, 0.2F});
  EXPECT_THAT(ErrorOf([&] {
                CorrectPhotograph(floats, {{dark_}, {}, {}}, TransferCurve::Srgb());
              }),
              HasSubstr("an 8 or 16 bit file is expected"));
  EXPECT_THAT(ErrorOf([&] { photo.WithLight({0.5F}); }), HasSubstr("1"));
}

TEST_F(FrameFilesForCorrection, DarkAndFlatGiveTheLightOfTheTarget) {
  Files darks, flats;
  for (int i = 0; i < 6; ++i) {
    darks.push_back(Put("dark" + std::to_string(i) + ".png", Level(0.05)));
    flats.push_back(Put("flat" + std::to_string(i) + ".png", 0.6 * Shading() + 0.05));
  }
  const Sweep sweep = Corrected(darks, flats);
  EXPECT_THAT(sweep.notices, IsEmpty());
  ASSERT_THAT(sweep.correction_lines, SizeIs(2));
  EXPECT_THAT(sweep.correction_lines[0],
              AllOf(HasSubstr("dark"), HasSubstr("6 frames"), HasSubstr("mean 5 %")));
  const calib::FocusSweep focus = FocusSweepOf(sweep);
  const cv::Mat grey = calib::LinearGrey(focus.read_frame(0), focus, 0);
  const cv::Mat expected = Target(0.3) * cv::mean(Shading())[0];
  // Noise of 0.004 and of the averages, enlarged where the flat is dark.
  EXPECT_LT(cv::norm(grey, expected, cv::NORM_L2) / kSensorSidePx, 0.008);
  EXPECT_LT(std::abs(cv::mean(grey - expected)[0]), 0.0005);
}

// An average that was written is read as what it was.
TEST_F(FrameFilesForCorrection, AnAverageKeepsItsRecord) {
  const Files files = {Put("a.png", Level(0.2)), Put("b.png", Level(0.2)),
                       Put("c.png", Level(0.2))};
  FrameAverageOptions options;
  options.method = calib::FrameAveraging::kMedian;
  options.full_scale = 65535;
  const AveragedFrames frames = AverageFrames(files, options);
  EXPECT_EQ(frames.average.frames, 3U);
  EXPECT_NEAR(frames.average.noise_sigma, 0.002, 0.0002);
  const std::string path = folder_ / "average.tif";
  WriteFileAtomically(path, EncodeAveragedFrames(frames));
  const AveragedFrames again = AverageFrames({path});
  EXPECT_EQ(cv::norm(again.average.light, frames.average.light, cv::NORM_INF), 0);
  EXPECT_EQ(again.average.frames, 3U);
  EXPECT_EQ(again.average.noise_sigma, frames.average.noise_sigma);
  EXPECT_EQ(again.bits, 16);
  EXPECT_EQ(again.white, 65535);
  EXPECT_EQ(again.transfer, "linear");
}

TEST_F(FrameFilesForCorrection, ValuesOfEightBitsAreAveragedAsLight) {
  const auto level = [](int value) {
    return cv::Mat(kSensorSidePx, kSensorSidePx, CV_8U, cv::Scalar(value));
  };
  const Files files = {PutStored("one.png", level(100)), PutStored("two.png", level(104))};
  FrameAverageOptions options;
  options.transfer = TransferCurve::Linear();
  EXPECT_NEAR(AverageFrames(files, options).average.mean_level, 102.0 / 255, 1e-6);
  options.transfer = TransferCurve::Gamma(2);
  EXPECT_NEAR(AverageFrames(files, options).average.mean_level,
              0.5 * (100.0 * 100 + 104.0 * 104) / (255.0 * 255), 1e-6);
}

// Values of 10 bits averaged as such are those of a sweep whose white is at 1023.
TEST_F(FrameFilesForCorrection, AnAverageWithAnotherWhiteIsConverted) {
  const cv::Mat stored(kSensorSidePx, kSensorSidePx, CV_16U, cv::Scalar(100));
  const std::string path = folder_ / "average.tif";
  FrameAverageOptions options;
  WriteFileAtomically(path,
                      EncodeAveragedFrames(AverageFrames({PutStored("d.png", stored)}, options)));
  Sweep sweep =
      SweepOf(PutStored("f.png", cv::Mat(kSensorSidePx, kSensorSidePx, CV_16U, cv::Scalar(700))));
  sweep.description.full_scale = 1023;
  sweep.description.correction.dark = {path};
  sweep = ExamineFrames(sweep);
  const calib::FocusSweep focus = FocusSweepOf(sweep);
  const cv::Mat grey = calib::LinearGrey(focus.read_frame(0), focus, 0);
  EXPECT_NEAR(grey.at<float>(9, 9), 600.0 / 1023, 1e-4);
}

TEST_F(FrameFilesForCorrection, DefectsComeFromListsAndMasks) {
  const std::string list = folder_ / "bad.txt";
  WriteFileAtomically(list, "# x y\n3 5\n 7,9 1234567\n\n10 11 # hot\n");
  cv::Mat mask = cv::Mat::zeros(kSensorSidePx, kSensorSidePx, CV_8U);
  mask.at<std::uint8_t>(20, 30) = 1;
  const cv::Mat found =
      ReadDefects({list, PutStored("mask.png", mask)}, kSensorSidePx, kSensorSidePx);
  EXPECT_EQ(cv::countNonZero(found), 4);
  for (const cv::Point& place :
       {cv::Point(3, 5), cv::Point(7, 9), cv::Point(10, 11), cv::Point(30, 20)})
    EXPECT_EQ(found.at<std::uint8_t>(place), 255) << place;
  EXPECT_THAT(DefectList(found), HasSubstr("\n3 5\n7 9\n10 11\n30 20\n"));
  EXPECT_THAT(Corrected({}, {}, {list}).correction_lines,
              Contains(AllOf(HasSubstr("bad.txt"), HasSubstr("3 pixels"))));
  WriteFileAtomically(list, "1 2\nx y\n");
  EXPECT_THAT(ErrorOf([&] { ReadDefects({list}, kSensorSidePx, kSensorSidePx); }),
              AllOf(HasSubstr("bad.txt:2"), HasSubstr("'x y'")));
  WriteFileAtomically(list, "144 2\n");
  EXPECT_THAT(ErrorOf([&] { ReadDefects({list}, kSensorSidePx, kSensorSidePx); }),
              AllOf(HasSubstr("bad.txt:1"), HasSubstr("(144, 2)"), HasSubstr("from 0")));
  EXPECT_THAT(ErrorOf([&] { ReadDefects({folder_ / "mask.png"}, 99, kSensorSidePx); }),
              AllOf(HasSubstr("mask.png"), HasSubstr("144 x 144"), HasSubstr("99 x 144")));
}

// ---- what does not fit the frames ----

TEST_F(FrameFilesForCorrection, AnotherSizeKindOrCurveIsNamedWithBothValues) {
  const std::string small =
      PutStored("small.png", cv::Mat(100, kSensorSidePx, CV_16U, cv::Scalar(9000)));
  EXPECT_THAT(Refusal({}, {small}),
              AllOf(HasSubstr("flat"), HasSubstr("small.png"), HasSubstr("144 x 100"),
                    HasSubstr("f0.png"), HasSubstr("144 x 144")));
  const std::string colour = PutStored(
      "colour.png", cv::Mat(kSensorSidePx, kSensorSidePx, CV_16UC3, cv::Scalar::all(30000)));
  EXPECT_THAT(Refusal({}, {colour}), AllOf(HasSubstr("colour.png"), HasSubstr("3 channels"),
                                           HasSubstr("f0.png has 1 channel")));
  io::ImageWriting linear;
  linear.is_linear = true;
  Sweep sweep = SweepOf(frame_);
  sweep.camera.sensor.transfer = TransferCurve::Srgb();
  sweep.description.correction.flat = {PutStored(
      "linear.png", cv::Mat(kSensorSidePx, kSensorSidePx, CV_16U, cv::Scalar(30000)), linear)};
  EXPECT_THAT(ErrorOf([&] { ExamineFrames(sweep); }),
              AllOf(HasSubstr("linear.png"), HasSubstr("linear"), HasSubstr("f0.png"),
                    HasSubstr("none, and the camera file srgb")));
  // An average was decoded already, with a curve that its record names.
  const std::string average = folder_ / "average.tif";
  WriteFileAtomically(average, EncodeAveragedFrames(AverageFrames({flat_})));
  sweep.description.correction.flat = {average};
  EXPECT_THAT(ErrorOf([&] { ExamineFrames(sweep); }),
              AllOf(HasSubstr("average.tif"), HasSubstr("curve linear"), HasSubstr("srgb")));
}

TEST_F(FrameFilesForCorrection, FilesOfUnequalTypesAreNotAveraged) {
  const std::string bytes =
      PutStored("bytes.png", cv::Mat(kSensorSidePx, kSensorSidePx, CV_8U, cv::Scalar(9)));
  EXPECT_THAT(ErrorOf([&] {
                AverageFrames({dark_, bytes});
              }),
              AllOf(HasSubstr("bytes.png"), HasSubstr("8 bits"), HasSubstr("dark.png")));
  EXPECT_THAT(Refusal({bytes}, {}), HasSubstr("bytes.png"));
}

// ---- what is no dark or no flat ----

TEST_F(FrameFilesForCorrection, APhotographIsNoDark) {
  EXPECT_THAT(Refusal({frame_}, {}),
              AllOf(HasSubstr("dark"), HasSubstr("leaves no image"), HasSubstr("without light")));
  EXPECT_THAT(Refusal({Put("p.png", Target(0.12))}, {}),
              AllOf(HasSubstr("p.png"), HasSubstr("structure"), HasSubstr("without light")));
}

// A camera may add a level to its values: an even dark is used, with a doubt.
TEST_F(FrameFilesForCorrection, ABrightEvenDarkIsADoubt) {
  const Sweep sweep = Corrected({Put("p.png", Level(0.12))}, {});
  ASSERT_NE(sweep.correction, nullptr);
  EXPECT_THAT(sweep.notices, Contains(AllOf(HasSubstr("p.png"), HasSubstr("light reached"))));
  EXPECT_THAT(Corrected({dark_}, {}).notices, Not(Contains(HasSubstr("light reached"))));
}

TEST_F(FrameFilesForCorrection, AFlatNeedsLightEverywhere) {
  EXPECT_THAT(Refusal({}, {Put("n.png", Level(0.001), 0.0002)}),
              AllOf(HasSubstr("n.png"), HasSubstr("no light")));
  EXPECT_THAT(Refusal({dark_}, {dark_}), AllOf(HasSubstr("no light"), HasSubstr("after the dark")));
  cv::Mat circle = Level(0.5);
  circle.rowRange(0, 20).setTo(0.001);
  const std::string flat = Put("circle.png", circle, 0.0002);
  EXPECT_THAT(Refusal({}, {flat}), AllOf(HasSubstr("circle.png"), HasSubstr("2880 pixels"),
                                         HasSubstr("below 2 %"), HasSubstr("roi_px")));
  Sweep sweep = SweepOf(frame_);
  sweep.description.roi = {0, 32, kSensorSidePx, 96};
  sweep.description.correction.flat = {flat};
  EXPECT_NE(ExamineFrames(sweep).correction, nullptr);
}

TEST_F(FrameFilesForCorrection, AClippedFlatIsRefused) {
  cv::Mat clipped = 1.3 * Shading();
  EXPECT_THAT(Refusal({}, {Put("c.png", clipped)}),
              AllOf(HasSubstr("c.png"), HasSubstr("clipped"), HasSubstr("shorter")));
  // An average keeps what its first file showed.
  const std::string average = folder_ / "average.tif";
  WriteFileAtomically(average, EncodeAveragedFrames(AverageFrames({folder_ / "c.png"})));
  EXPECT_THAT(Refusal({}, {average}), HasSubstr("clipped"));
}

TEST_F(FrameFilesForCorrection, AFlatThatShowsATargetIsRefused) {
  EXPECT_THAT(Refusal({}, {Put("t.png", Target(0.5))}),
              AllOf(HasSubstr("t.png"), HasSubstr("structure"), HasSubstr("even surface")));
  cv::Mat faint = Level(0.5) + 0.1 * (Target(0.5) - 0.5);
  EXPECT_THAT(Corrected({}, {Put("p.png", faint)}).notices,
              Contains(AllOf(HasSubstr("p.png"), HasSubstr("structure"))));
}

// The noise that is left in a flat is the same in all frames.
TEST_F(FrameFilesForCorrection, ANoisyFlatIsADoubtThatMoreFlatsRemove) {
  Files flats;
  for (int i = 0; i < 8; ++i)
    flats.push_back(Put("n" + std::to_string(i) + ".png", 0.6 * Shading() + 0.05, 0.02));
  EXPECT_THAT(Corrected({}, {flats[0]}).notices,
              Contains(AllOf(HasSubstr("n0.png"), HasSubstr("noise"), HasSubstr("at least"))));
  EXPECT_THAT(Corrected({}, {flat_}).notices, Not(Contains(HasSubstr("at least"))));
}

TEST_F(FrameFilesForCorrection, FilesThatAreMissingAreNamed) {
  EXPECT_THAT(Refusal({}, {folder_ / "none.png"}), HasSubstr("none.png"));
  EXPECT_THAT(Refusal({}, {}, {folder_ / "none.txt"}), HasSubstr("none.txt"));
  EXPECT_THAT(ErrorOf([] { AverageFrames({}); }), HasSubstr("no file"));
  FrameAverageOptions options;
  options.full_scale = 0;
  EXPECT_THAT(ErrorOf([&] { AverageFrames({flat_}, options); }), HasSubstr("full_scale"));
}

}  // namespace
}  // namespace thicklens
