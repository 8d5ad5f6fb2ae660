#include "calib/sweep/frame_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;

constexpr int kWidth = 20, kHeight = 10;

// Frames that are made when they are read, each with its own grey. Reads are counted.
struct CountedSweep {
  FocusSweep sweep;
  std::shared_ptr<std::vector<std::atomic<int>>> reads;

  explicit CountedSweep(std::size_t frames, int type = CV_8U)
      : reads(std::make_shared<std::vector<std::atomic<int>>>(frames)) {
    sweep.camera.sensor.width_px = kWidth;
    sweep.camera.sensor.height_px = kHeight;
    sweep.camera.sensor.transfer = model::TransferCurve::Linear();
    for (std::size_t i = 0; i < frames; ++i)
      sweep.frames.push_back({"frame-" + std::to_string(i), static_cast<double>(i)});
    sweep.read_frame = [counts = reads, type](std::size_t i) {
      ++(*counts)[i];
      const auto value = static_cast<double>(i + 1);
      return cv::Mat(kHeight, kWidth, type, cv::Scalar(value, 2 * value, 3 * value, 255));
    };
  }
  int ReadsOf(std::size_t i) const { return (*reads)[i]; }
};

TEST(FrameStore, ReadsASmallSweepOnce) {
  const CountedSweep counted(5);
  FrameStore store(counted.sweep);
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(store.Stored(i).at<std::uint8_t>(3, 4), i + 1);
      EXPECT_FLOAT_EQ(store.Grey(i).at<float>(3, 4), static_cast<float>(i + 1) / 255);
    }
  }
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(counted.ReadsOf(i), 1) << i;
  EXPECT_EQ(store.kept_bytes(), 5U * kWidth * kHeight);
}

TEST(FrameStore, ReadsNothingThatIsNotAskedFor) {
  const CountedSweep counted(3);
  FrameStore store(counted.sweep);
  store.Stored(1);
  EXPECT_EQ(counted.ReadsOf(0), 0);
  EXPECT_EQ(counted.ReadsOf(2), 0);
}

TEST(FrameStore, KeepsNoMoreThanItsLimitAndWhatCameFirst) {
  constexpr std::size_t kFrame = kWidth * kHeight;
  for (const std::size_t limit : {std::size_t{0}, kFrame - 1, kFrame, 2 * kFrame + kFrame / 2}) {
    const CountedSweep counted(4);
    FrameStore store(counted.sweep, limit);
    for (int round = 0; round < 3; ++round) {
      for (std::size_t i : {2U, 0U, 3U, 1U}) {
        EXPECT_EQ(store.Stored(i).at<std::uint8_t>(0, 0), i + 1);
        EXPECT_LE(store.kept_bytes(), limit);
      }
    }
    const std::size_t fit = limit / kFrame;
    EXPECT_EQ(store.kept_bytes(), fit * kFrame);
    EXPECT_EQ(counted.ReadsOf(2), fit >= 1 ? 1 : 3);
    EXPECT_EQ(counted.ReadsOf(0), fit >= 2 ? 1 : 3);
    EXPECT_EQ(counted.ReadsOf(3), 3);
    EXPECT_EQ(counted.ReadsOf(1), 3);
  }
}

TEST(FrameStore, CountsTheBytesOfWideAndColouredPixels) {
  const CountedSweep counted(1, CV_16UC3);
  FrameStore store(counted.sweep);
  store.Stored(0);
  EXPECT_EQ(store.kept_bytes(), 6U * kWidth * kHeight);
}

TEST(FrameStore, ThreadsGetTheirFramesAndTheLimitHolds) {
  constexpr std::size_t kFrame = kWidth * kHeight;
  const CountedSweep counted(16);
  FrameStore store(counted.sweep, 6 * kFrame);
  std::atomic<int> wrong{0}, over{0};
  ParallelFor(2000, 8, [&](int k) {
    const auto i = static_cast<std::size_t>(k * 7 % 16);
    if (store.Stored(i).at<std::uint8_t>(9, 19) != i + 1) ++wrong;
    if (store.kept_bytes() > 6 * kFrame) ++over;
  });
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(over, 0);
  EXPECT_EQ(store.kept_bytes(), 6 * kFrame);
}

TEST(FrameStore, AFrameThatTwoReadAtOnceIsKeptOnce) {
  // While the store reads a frame for one thread, another thread asks for it and is served first.
  CountedSweep counted(1);
  FrameStore* store = nullptr;
  auto read = counted.sweep.read_frame;
  auto depth = std::make_shared<int>(0);
  counted.sweep.read_frame = [&store, read, depth](std::size_t i) {
    if (++*depth == 1) store->Stored(i);
    return read(i);
  };
  FrameStore kept(counted.sweep);
  store = &kept;
  EXPECT_EQ(kept.Stored(0).at<std::uint8_t>(0, 0), 1);
  EXPECT_EQ(counted.ReadsOf(0), 2);
  EXPECT_EQ(kept.kept_bytes(), std::size_t{kWidth * kHeight});
}

TEST(FrameStore, ARegionOfAColourFrame) {
  for (const int type : {CV_8UC3, CV_8UC4, CV_16UC3}) {
    CountedSweep counted(2, type);
    counted.sweep.roi = {2, 3, 5, 4};
    const float full_scale = CV_MAT_DEPTH(type) == CV_8U ? 255 : 65535;
    FrameStore store(counted.sweep);
    EXPECT_EQ(store.Stored(1).size(), cv::Size(kWidth, kHeight));
    for (int c = 0; c < 3; ++c) {
      const cv::Mat channel = store.Channel(1, c);
      ASSERT_EQ(channel.size(), cv::Size(5, 4));
      ASSERT_EQ(channel.type(), CV_32F);
      EXPECT_FLOAT_EQ(channel.at<float>(3, 4), static_cast<float>(2 * (c + 1)) / full_scale);
    }
    EXPECT_FLOAT_EQ(store.Grey(1).at<float>(0, 0),
                    (0.2126F * 2 + 0.7152F * 4 + 0.0722F * 6) / full_scale);
    EXPECT_THAT(ErrorOf([&] { store.Channel(1, 3); }), HasSubstr("frame-1: channel 3"));
    EXPECT_THAT(ErrorOf([&] { store.Channel(1, -1); }), HasSubstr("channel -1"));
    EXPECT_EQ(counted.ReadsOf(1), 1);
  }
}

TEST(FrameStore, AGreyFrameHasOneChannel) {
  const CountedSweep counted(1);
  FrameStore store(counted.sweep);
  EXPECT_FLOAT_EQ(store.Channel(0, 0).at<float>(0, 0), 1.0F / 255);
  EXPECT_THAT(ErrorOf([&] { store.Channel(0, 1); }), HasSubstr("channel 1"));
}

TEST(FrameStore, LinesAreDividedByTheirGain) {
  const CountedSweep counted(2);
  for (const bool columns : {false, true}) {
    FrameStore store(counted.sweep);
    const cv::Mat plain = store.Grey(1).clone();
    std::vector<double> log_gain(static_cast<std::size_t>(columns ? plain.cols : plain.rows));
    for (std::size_t k = 0; k < log_gain.size(); ++k) log_gain[k] = 0.1 * static_cast<double>(k);
    store.SetLineGains({{}, log_gain}, columns);
    const cv::Mat divided = store.Grey(1);
    for (int y = 0; y < plain.rows; ++y) {
      for (int x = 0; x < plain.cols; ++x)
        EXPECT_NEAR(divided.at<float>(y, x),
                    plain.at<float>(y, x) * std::exp(-0.1 * (columns ? x : y)), 1e-6);
    }
    EXPECT_EQ(store.Grey(0).at<float>(2, 3), FrameStore(counted.sweep).Grey(0).at<float>(2, 3))
        << "a frame without values is not changed";
  }
}

TEST(FrameStore, StoresOfSweepsWithOneReaderThatKeepsFramesShareThem) {
  CountedSweep counted(3);
  constexpr std::size_t kTwo = 2U * kWidth * kHeight;
  counted.sweep.read_frame = KeptFrames::Of(counted.sweep.read_frame, kTwo);
  FocusSweep other = counted.sweep;
  other.camera.sensor.transfer = model::TransferCurve::Srgb();
  FrameStore first(counted.sweep), second(other);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(first.Stored(i).data == second.Stored(i).data, i < 2) << i;
    EXPECT_EQ(counted.ReadsOf(i), i < 2 ? 1 : 2);
    EXPECT_LT(second.Grey(i).at<float>(0, 0), first.Grey(i).at<float>(0, 0)) << "its own light";
  }
  EXPECT_EQ(first.kept_bytes(), kTwo);
  EXPECT_EQ(second.kept_bytes(), kTwo);
}

TEST(FrameStore, AFrameThatCannotBeReadIsTriedAgain) {
  CountedSweep counted(1);
  auto read = counted.sweep.read_frame;
  auto broken = std::make_shared<bool>(true);
  counted.sweep.read_frame = [read, broken](std::size_t i) {
    if (*broken) throw Error("frame-0: gone");
    return read(i);
  };
  FrameStore store(counted.sweep);
  EXPECT_THAT(ErrorOf([&] { store.Stored(0); }), HasSubstr("gone"));
  *broken = false;
  EXPECT_EQ(store.Stored(0).at<std::uint8_t>(0, 0), 1);
}

TEST(LinearGrey, EveryTransferCurveInTurnIsDecodedAsItsOwn) {
  // The table of one camera must not be used for frames of another.
  CountedSweep counted(1);
  for (const char* name : {"srgb", "linear", "gamma-2.2", "srgb", "linear"}) {
    for (const int depth : {CV_8U, CV_16U}) {
      counted.sweep.camera.sensor.transfer = model::TransferCurve::FromName(name);
      const cv::Mat stored(kHeight, kWidth, depth, cv::Scalar(100));
      const double decoded =
          counted.sweep.camera.sensor.transfer.Decode(100 / (depth == CV_8U ? 255.0 : 65535.0));
      EXPECT_FLOAT_EQ(LinearGrey(stored, counted.sweep, 0).at<float>(0, 0),
                      static_cast<float>(decoded))
          << name << depth;
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
