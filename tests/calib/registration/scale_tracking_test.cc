// Scales of whole sweeps: simulated ones, one with a lens that distorts, and a real one.
#include "calib/registration/scale_tracking.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "tests/calib/registration/wave_image.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;
using thicklens::testing::View;
using thicklens::testing::WaveImage;

using GreyReader = std::function<cv::Mat(std::size_t)>;

std::vector<std::size_t> AllFrames(const FocusSweep& sweep) {
  std::vector<std::size_t> frames(sweep.frames.size());
  std::iota(frames.begin(), frames.end(), std::size_t{0});
  return frames;
}

std::vector<ScaleSample> Track(const FocusSweep& sweep, const GreyReader& read, int threads = 0) {
  std::optional<double> offset_mm;
  if (sweep.offset_mm) offset_mm = sweep.offset_mm->value;
  return TrackScale(sweep, read, AllFrames(sweep), sweep.frames.size() / 2, offset_mm, threads,
                    [] {});
}

ScaleModel Fit(const FocusSweep& sweep, const std::vector<ScaleSample>& samples) {
  return FitScaleModel(samples, static_cast<int>(sweep.frames.size() / 2), sweep.reading_sigma_mm,
                       sweep.direction, RegionCornerRadiusPx(sweep));
}

SimulatedSweep Sweep(const std::string& name, model::TargetKind kind, int frames,
                     std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase(name, 192, seed);
  options.target.kind = kind;
  options.step_mm *= (options.frame_count - 1.0) / (frames - 1.0);
  options.frame_count = frames;
  return thicklens::testing::Simulate(options);
}

GreyReader Reader(const SimulatedSweep& s) {
  return [&s](std::size_t i) { return LinearGrey((*s.stored)[i], s.sweep, i); };
}

void ExpectTrueScales(const SimulatedSweep& s, const std::vector<ScaleSample>& samples) {
  EXPECT_EQ(samples.size(), s.truth.frames.size());
  for (const ScaleSample& sample : samples) {
    const double scale = s.TrueScale(sample.frame, s.truth.frames.size() / 2);
    EXPECT_NEAR(sample.scale, scale, 5 * sample.registration.scale_sigma + 1e-9) << sample.frame;
    EXPECT_LT(sample.registration.scale_sigma, 1e-3);
    EXPECT_EQ(sample.scale, sample.registration.scale);
    EXPECT_EQ(sample.reading_mm, s.truth.frames[sample.frame].reading_mm);
  }
}

TEST(TrackScale, FindsTheScalesWithAndWithoutAnOffset) {
  for (const model::TargetKind kind :
       {model::TargetKind::kDeadLeaves, model::TargetKind::kCheckerboard}) {
    SimulatedSweep s = Sweep("iii", kind, 15, 1);
    ExpectTrueScales(s, Track(s.sweep, Reader(s)));
    s.sweep.offset_mm.reset();
    const auto samples = Track(s.sweep, Reader(s));
    ExpectTrueScales(s, samples);
    const ScaleModel law = Fit(s.sweep, samples);
    ASSERT_TRUE(law.done) << law.message;
    EXPECT_NEAR(law.offset_mm.value, -s.centre_mm, 3 * law.offset_mm.sigma);
    EXPECT_LT(law.offset_mm.sigma, 2);
  }
}

// Spokes look the same at every scale. Therefore the scale is computed from the readings, and only
// the shifts are measured.
TEST(TrackScale, TakesAStarsScalesFromTheReadings) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kSiemensStar, 15, 8);
  s.sweep.offset_mm->value = 3;  // the scale is that of the stated depths, right or wrong
  const auto samples = Track(s.sweep, Reader(s));
  EXPECT_EQ(samples.size(), 15U);
  for (const ScaleSample& sample : samples) {
    EXPECT_TRUE(sample.scale_is_from_reading);
    EXPECT_EQ(sample.registration.scale_sigma, 0);
    EXPECT_NEAR(sample.scale,
                (s.sweep.frames[7].reading_mm + 3) / (s.sweep.frames[sample.frame].reading_mm + 3),
                1e-12);
    EXPECT_EQ(sample.registration.scale, sample.scale);
    EXPECT_LT(sample.registration.shift_px.norm(), 8);  // the bench drifts by 1 px a frame
    EXPECT_NEAR(sample.registration.rotation_rad, 0, 1e-3);
  }
  const auto one = Track(s.sweep, Reader(s), 1);
  ASSERT_EQ(one.size(), samples.size());
  for (std::size_t i = 0; i < one.size(); ++i)
    EXPECT_EQ(one[i].registration.shift_px, samples[i].registration.shift_px);
  const ScaleModel law = Fit(s.sweep, samples);
  EXPECT_FALSE(law.done || law.contradicts_readings);
  EXPECT_EQ(law.kind, ScaleKind::kUnknown);
  EXPECT_THAT(law.message, HasSubstr("looks the same at every scale"));
  EXPECT_THAT(law.message, Not(HasSubstr("state offset_mm")));
}

TEST(TrackScale, AStarWithoutAnOffsetLeavesTheReferenceAlone) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kSiemensStar, 7, 8);
  s.sweep.offset_mm.reset();
  const auto samples = Track(s.sweep, Reader(s));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].frame, 3U);
  const ScaleModel law = Fit(s.sweep, samples);
  EXPECT_THAT(law.message, HasSubstr("looks the same at every scale"));
  EXPECT_TRUE(law.shows_no_scale);
}

// Frames at impossible depths have no scale and give no sample.
TEST(TrackScale, AStarsFramesAtNoDepthAreLeftOut) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kSiemensStar, 7, 8);
  s.sweep.frames[1].reading_mm = -5;
  s.sweep.frames[5].reading_mm = 1e5;
  EXPECT_EQ(Track(s.sweep, Reader(s)).size(), 5U);
}

// The edge is measured by the edge estimator, which needs no shift.
TEST(TrackScale, AKnifeEdgeIsNotGivenAScale) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kSiemensStar, 7, 8);
  s.sweep.target = model::SweepTarget::kKnifeEdge;
  for (const ScaleSample& sample : Track(s.sweep, Reader(s)))
    EXPECT_FALSE(sample.scale_is_from_reading);
}

TEST(TrackScale, ThreadsDoNotChangeABit) {
  const SimulatedSweep s = Sweep("iv", model::TargetKind::kDeadLeaves, 9, 2);
  const auto one = Track(s.sweep, Reader(s), 1);
  const auto four = Track(s.sweep, Reader(s), 4);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].frame, four[i].frame);
    EXPECT_EQ(one[i].scale, four[i].scale);
    EXPECT_EQ(one[i].registration.scale_sigma, four[i].registration.scale_sigma);
    EXPECT_EQ(one[i].registration.cubic, four[i].registration.cubic);
  }
}

TEST(TrackScale, TicksOnceAFrame) {
  const SimulatedSweep s = Sweep("iv", model::TargetKind::kDeadLeaves, 7, 2);
  int ticks = 0;
  TrackScale(s.sweep, Reader(s), {0, 2, 3, 6}, 3, std::nullopt, 1, [&ticks] { ++ticks; });
  EXPECT_EQ(ticks, 3);  // the reference has nothing to be registered to
  ticks = 0;
  const SimulatedSweep star = Sweep("iv", model::TargetKind::kSiemensStar, 7, 2);
  TrackScale(star.sweep, Reader(star), {0, 2, 3, 6}, 3, 0.0, 1, [&ticks] { ++ticks; });
  EXPECT_EQ(ticks, 3);
}

// If a reading is wrong, the registration starts far off. The frame is registered nevertheless, so
// that the law can determine the error of the reading.
TEST(TrackScale, AFrameWithAWrongReadingIsRegistered) {
  for (const std::size_t wrong : {std::size_t{3}, std::size_t{7}}) {  // 7: the reference
    SimulatedSweep s = Sweep("iii", model::TargetKind::kDeadLeaves, 15, 3);
    s.sweep.offset_mm.reset();
    s.sweep.frames[wrong].reading_mm += 150;
    const auto samples = Track(s.sweep, Reader(s));
    ASSERT_EQ(samples.size(), 15U);
    const ScaleModel law = Fit(s.sweep, samples);
    ASSERT_TRUE(law.done) << law.message;
    EXPECT_EQ(law.frames_used, 14);
    EXPECT_NEAR(law.offset_mm.value, -s.centre_mm, 3 * law.offset_mm.sigma);
  }
}

TEST(TrackScale, ReadingsInARandomOrderAreNamed) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kDeadLeaves, 15, 4);
  s.sweep.offset_mm.reset();
  std::mt19937 random(5);
  std::vector<double> readings;
  for (const auto& frame : s.sweep.frames) readings.push_back(frame.reading_mm);
  std::shuffle(readings.begin(), readings.end(), random);
  for (std::size_t i = 0; i < readings.size(); ++i) s.sweep.frames[i].reading_mm = readings[i];
  const auto samples = Track(s.sweep, Reader(s));
  EXPECT_GT(samples.size(), 12U);
  const ScaleModel law = Fit(s.sweep, samples);
  EXPECT_FALSE(law.done);
  EXPECT_EQ(law.kind, ScaleKind::kUnknown);
  EXPECT_THAT(law.message, HasSubstr("does not follow the readings"));
}

TEST(TrackScale, OneImageRepeatedIsConstant) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kDeadLeaves, 9, 6);
  s.sweep.offset_mm.reset();
  const GreyReader same = [&s](std::size_t) { return LinearGrey((*s.stored)[4], s.sweep, 4); };
  const ScaleModel law = Fit(s.sweep, Track(s.sweep, same));
  EXPECT_EQ(law.kind, ScaleKind::kConstant) << law.message;
}

TEST(TrackScale, TheWrongDirectionIsReversed) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kDeadLeaves, 9, 7);
  s.sweep.offset_mm.reset();
  s.sweep.direction = model::BenchDirection::kToward;
  const ScaleModel law = Fit(s.sweep, Track(s.sweep, Reader(s)));
  EXPECT_EQ(law.kind, ScaleKind::kReversed) << law.message;
}

// A lens that distorts by 1 % at the corner, in closed form. If the distortion were ignored, the
// bench offset would be 2 mm off.
TEST(TrackScale, DistortionIsFoundAndTakenOut) {
  constexpr int kSizePx = 192;
  FocusSweep sweep;
  sweep.camera.sensor.width_px = sweep.camera.sensor.height_px = kSizePx;
  sweep.camera.sensor.principal_point_px.setConstant(0.5 * (kSizePx - 1));
  const double corner_px = 0.5 * (kSizePx - 1) * std::sqrt(2);
  EXPECT_NEAR(RegionCornerRadiusPx(sweep), corner_px, 1e-9);
  const WaveImage texture(3);
  for (const double distortion : {-0.01, 0.01}) {
    std::vector<cv::Mat> images;
    sweep.frames.clear();
    for (int i = 0; i < 11; ++i) {
      const double depth_mm = 320 + 16 * i;  // 400 mm in the middle
      sweep.frames.push_back({"frame", depth_mm - 30});
      View view;
      view.scale = 400 / depth_mm;
      view.distortion = distortion / (corner_px * corner_px);
      view.noise = 0.003;
      images.push_back(texture.Render(kSizePx, view, static_cast<unsigned>(i)));
    }
    const auto samples = Track(sweep, [&](std::size_t i) { return images[i]; });
    ASSERT_EQ(samples.size(), 11U);
    for (const ScaleSample& s : samples) {
      const double scale = 400 / (sweep.frames[s.frame].reading_mm + 30);
      EXPECT_NEAR(s.scale / scale, 1, 3e-4) << scale;
    }
    const ScaleModel law = Fit(sweep, samples);
    ASSERT_TRUE(law.done && law.distortion_at_corner) << law.message;
    EXPECT_NEAR(law.distortion_at_corner->value, distortion, 1e-3);
    EXPECT_NEAR(law.offset_mm.value, 30, 0.3);
    EXPECT_NEAR(law.offset_mm.value, 30, 3 * law.offset_mm.sigma);
  }
}

TEST(RegionCentre, IsSeenFromTheRegion) {
  FocusSweep sweep;
  sweep.camera.sensor.width_px = 640;
  sweep.camera.sensor.height_px = 480;
  sweep.camera.sensor.principal_point_px = {300, 250};
  sweep.roi.x = 100;
  sweep.roi.y = 50;
  sweep.roi.width = 400;
  sweep.roi.height = 300;
  EXPECT_EQ(RegionCentre(sweep), cv::Point2d(200, 200));
  EXPECT_DOUBLE_EQ(RegionCornerRadiusPx(sweep), std::hypot(200, 200));
}

// A camera over a flat 5 mm grid, scales from 0.44 to 3.4; the distance from the camera is about
// reading + 106.2 to 106.5 mm by the grid's pitch.
TEST(TrackScale, SlowTheRealSweepFollowsInverseDepth) {
  const std::string folder = THICKLENS_SHARED_DATA_DIR "/picam_sweep/";
  std::ifstream table(folder + "positions.csv");
  if (!table) GTEST_SKIP() << "no " << folder;
  FocusSweep sweep;
  std::string line;
  std::getline(table, line);
  while (std::getline(table, line)) {
    const auto comma = line.find(',');
    const double reading_mm = std::stod(line.substr(comma + 1));
    if (reading_mm >= -94) sweep.frames.push_back({line.substr(0, comma), reading_mm});
  }
  ASSERT_EQ(sweep.frames.size(), 115U);
  sweep.camera.sensor.width_px = sweep.camera.sensor.height_px = 400;
  sweep.camera.sensor.principal_point_px = {199.5, 199.5};
  sweep.camera.sensor.transfer = model::TransferCurve::Srgb();
  const GreyReader read = [&](std::size_t i) {
    const cv::Mat stored =
        cv::imread(folder + "frames/" + sweep.frames[i].image, cv::IMREAD_GRAYSCALE);
    return LinearGrey(stored, sweep, i);
  };
  std::size_t reference = 0;
  while (sweep.frames[reference].reading_mm != -50) ++reference;
  const auto samples = TrackScale(sweep, read, AllFrames(sweep), reference, std::nullopt, 0, [] {});
  std::size_t between = 0;
  for (const ScaleSample& s : samples) between += s.reading_mm >= -90 ? 1U : 0U;
  EXPECT_EQ(between, 111U);
  const ScaleModel law = FitScaleModel(samples, static_cast<int>(reference), 0, sweep.direction,
                                       RegionCornerRadiusPx(sweep));
  ASSERT_TRUE(law.done) << law.message;
  EXPECT_EQ(law.kind, ScaleKind::kInverseDepth);
  EXPECT_NEAR(law.offset_mm.value, 106.5, 1);
  EXPECT_LT(law.offset_mm.sigma, 1);
  EXPECT_LT(law.reading_rms_mm, 0.6);
}

}  // namespace
}  // namespace thicklens::calib
