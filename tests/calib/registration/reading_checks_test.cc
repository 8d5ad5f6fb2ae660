#include "calib/registration/reading_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace thicklens::calib {
namespace {

using model::BenchDirection;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kOffsetMm = 30, kReferenceMm = 400;

// A sweep of 21 frames at every fifth millimetre, with scales as 1/z and a little noise.
struct Bench {
  FocusSweep sweep;
  std::vector<FrameMeasurement> frames;
  std::vector<ScaleSample> samples;
  ScaleModel law;
  FrameStructureFinding structure;

  explicit Bench(BenchDirection direction = BenchDirection::kAway) {
    std::mt19937 random(6);
    std::normal_distribution<double> normal(0, 1);
    sweep.direction = direction;
    sweep.reading_sigma_mm = 0.05;
    for (std::size_t i = 0; i < 21; ++i) {
      const double depth_mm = 350 + 5.0 * static_cast<double>(i);
      const double reading_mm = model::DirectionSign(direction) * (depth_mm - kOffsetMm);
      FrameMeasurement frame;
      frame.image = "/somewhere/frame-" + std::to_string(i) + ".png";
      frame.statistics.content_hash = 1000 + i;
      ScaleSample sample;
      sample.frame = i;
      sample.scale = kReferenceMm / depth_mm * (1 + 2e-5 * normal(random));
      sample.registration.scale_sigma = 2e-5;
      frames.push_back(frame);
      samples.push_back(sample);
      sweep.frames.push_back({frame.image, 0});
      SetReading(i, reading_mm + 0.05 * normal(random));
    }
    law.done = true;
    law.kind = ScaleKind::kInverseDepth;
    law.offset_mm = {kOffsetMm, 0.1, {}};
    law.reference_depth_mm = kReferenceMm;
    law.reading_rms_mm = 0.06;
  }
  void SetReading(std::size_t i, double reading_mm) {
    frames[i].reading_mm = samples[i].reading_mm = sweep.frames[i].reading_mm = reading_mm;
  }
  void Swap(std::size_t a, std::size_t b) {
    const double reading_mm = frames[a].reading_mm;
    SetReading(a, frames[b].reading_mm);
    SetReading(b, reading_mm);
  }
  std::vector<std::size_t> Used() const {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < frames.size(); ++i) used.push_back(i);
    return used;
  }
  std::vector<std::size_t> Reject() {
    RejectWrongReadings(sweep, samples, law, &frames);
    std::vector<std::size_t> rejected;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (!frames[i].rejection.empty()) rejected.push_back(i);
    }
    return rejected;
  }
  std::optional<std::string> Reason() const { return ReasonAgainstScales(frames, Used(), law); }
};

using Indices = std::vector<std::size_t>;

TEST(RejectWrongReadings, LetsAGoodSweepBe) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward})
    EXPECT_EQ(Bench(direction).Reject(), Indices{});
}

TEST(RejectWrongReadings, NamesAShiftedReadingWithItsAmount) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    for (const double error_mm : {2.0, -12.5}) {
      Bench bench(direction);
      const double right_mm = bench.frames[7].reading_mm;
      bench.SetReading(7, right_mm + error_mm);
      ASSERT_EQ(bench.Reject(), Indices{7});
      // The written reading minus the right one. It includes the error of the reading.
      EXPECT_NEAR(bench.frames[7].reading_error_mm, error_mm, 0.2);
      const std::string amount = error_mm > 0 ? "off by 2." : "off by -12.";
      EXPECT_THAT(bench.frames[7].rejection, AllOf(HasSubstr(amount), Not(HasSubstr("swapped"))));
      const std::string before = "belongs to the reading ";
      const auto at = bench.frames[7].rejection.find(before);
      ASSERT_NE(at, std::string::npos);
      EXPECT_NEAR(std::stod(bench.frames[7].rejection.substr(at + before.size())), right_mm, 0.2);
    }
  }
}

TEST(RejectWrongReadings, ASmallErrorIsLeftToTheFit) {
  Bench bench;
  bench.SetReading(7, bench.frames[7].reading_mm + 0.2);
  EXPECT_EQ(bench.Reject(), Indices{});
}

TEST(RejectWrongReadings, AnImpreciseScaleSaysLittle) {
  Bench bench;
  bench.samples[7].registration.scale_sigma = 1e-3;  // 0.4 mm
  bench.SetReading(7, bench.frames[7].reading_mm + 2);
  EXPECT_EQ(bench.Reject(), Indices{});
}

TEST(RejectWrongReadings, NamesASwappedPairBothWays) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    Bench bench(direction);
    bench.Swap(4, 12);
    ASSERT_EQ(bench.Reject(), (Indices{4, 12}));
    EXPECT_THAT(bench.frames[4].rejection, HasSubstr("swapped with frame-12.png"));
    EXPECT_THAT(bench.frames[12].rejection, HasSubstr("swapped with frame-4.png"));
  }
}

TEST(RejectWrongReadings, TwoWrongReadingsAreNotASwap) {
  Bench bench;
  bench.SetReading(4, bench.frames[4].reading_mm + 11);
  bench.SetReading(12, bench.frames[12].reading_mm + 17);
  ASSERT_EQ(bench.Reject(), (Indices{4, 12}));
  for (const std::size_t i : {4U, 12U})
    EXPECT_THAT(bench.frames[i].rejection, Not(HasSubstr("swapped")));
}

TEST(RejectWrongReadings, TwoSwappedPairsAreDistinguished) {
  Bench bench;
  bench.Swap(2, 9);
  bench.Swap(5, 14);
  ASSERT_EQ(bench.Reject(), (Indices{2, 5, 9, 14}));
  EXPECT_THAT(bench.frames[2].rejection, HasSubstr("swapped with frame-9.png"));
  EXPECT_THAT(bench.frames[14].rejection, HasSubstr("swapped with frame-5.png"));
}

TEST(RejectWrongReadings, NamesARepeatedImageBothWays) {
  Bench bench;
  bench.frames[9].statistics.content_hash = bench.frames[3].statistics.content_hash;
  ASSERT_EQ(bench.Reject(), (Indices{3, 9}));
  EXPECT_THAT(bench.frames[9].rejection,
              AllOf(HasSubstr("repeated image"), HasSubstr("frame-3.png")));
  EXPECT_THAT(bench.frames[3].rejection, HasSubstr("frame-9.png"));
}

// Two images of one reading may be equal (an averaged pair, a copy), so no reading is in doubt.
TEST(RejectWrongReadings, TheImageOfOneReadingMayBeThereTwice) {
  Bench bench;
  bench.frames[9].statistics.content_hash = bench.frames[3].statistics.content_hash;
  bench.samples[9] = bench.samples[3];
  bench.samples[9].frame = 9;
  bench.SetReading(9, bench.frames[3].reading_mm);
  EXPECT_EQ(bench.Reject(), Indices{});
}

// If there are three equal images, the message must name one that is at another reading.
TEST(RejectWrongReadings, ARepeatedImageIsComparedWithOneOfAnotherReading) {
  Bench bench;
  for (const std::size_t i : {5U, 9U}) {
    bench.frames[i].statistics.content_hash = bench.frames[3].statistics.content_hash;
  }
  bench.SetReading(5, bench.frames[3].reading_mm);
  bench.Reject();
  EXPECT_THAT(bench.frames[3].rejection, HasSubstr("frame-9.png"));
  EXPECT_THAT(bench.frames[5].rejection, HasSubstr("frame-9.png"));
}

TEST(RejectWrongReadings, LeavesRejectedFramesAlone) {
  Bench bench;
  bench.frames[7].rejection = "dark";
  bench.frames[9].rejection = "dark";
  bench.frames[8].statistics.content_hash = bench.frames[9].statistics.content_hash;
  bench.SetReading(7, bench.frames[7].reading_mm + 3);
  EXPECT_EQ(bench.Reject(), (Indices{7, 9}));
  EXPECT_EQ(bench.frames[7].rejection, "dark");
}

TEST(RejectWrongReadings, WithoutAModelNoReadingIsJudged) {
  Bench bench;
  bench.law.done = false;
  bench.SetReading(7, bench.frames[7].reading_mm + 3);
  EXPECT_EQ(bench.Reject(), Indices{});
}

TEST(ReasonAgainstScales, AGoodSweepHasNone) { EXPECT_FALSE(Bench().Reason()); }

TEST(ReasonAgainstScales, OneImageForAllFramesIsRecognised) {
  Bench bench;
  for (FrameMeasurement& frame : bench.frames) frame.statistics.content_hash = 7;
  bench.law.kind = ScaleKind::kConstant;
  const auto reason = bench.Reason();
  ASSERT_TRUE(reason);
  EXPECT_THAT(*reason, AllOf(HasSubstr("one image was repeated"), HasSubstr("21 frames")));
  // A few copies only concern these frames.
  for (std::size_t i = 3; i < 21; ++i) bench.frames[i].statistics.content_hash = i;
  bench.law.kind = ScaleKind::kInverseDepth;
  EXPECT_FALSE(bench.Reason());
}

TEST(ReasonAgainstScales, ReversedReadingsForbidAResult) {
  Bench bench;
  bench.law = {};
  bench.law.kind = ScaleKind::kReversed;
  bench.law.message = "direction must be 'toward'";
  EXPECT_EQ(bench.Reason(), "direction must be 'toward'");
}

// The blur gives the reading at focus all the same.
TEST(ReasonAgainstScales, AConstantScaleIsNoReason) {
  Bench bench;
  bench.law = {};
  bench.law.kind = ScaleKind::kConstant;
  bench.law.message = "the image scale does not change";
  EXPECT_FALSE(bench.Reason());
}

// The law of a star, whose scales are computed from the readings.
ScaleModel StarModel() {
  Bench bench;
  for (ScaleSample& sample : bench.samples) sample.scale_is_from_reading = true;
  return FitScaleModel(bench.samples, 12, 0.05, BenchDirection::kAway);
}

TEST(ReasonOfUnknownOffset, TheReasonHasAdvice) {
  Bench bench;
  bench.law.message = "the image scale does not change";
  EXPECT_EQ(ReasonOfUnknownOffset(bench.law),
            "offset_mm is not stated and could not be determined: the image scale does not change; "
            "to calibrate without the image scale, state offset_mm");
  EXPECT_THAT(ReasonOfUnknownOffset(StarModel()),
              AllOf(HasSubstr("looks the same at every scale"),
                    HasSubstr("state offset_mm, or use a texture")));
}

TEST(RegistrationAdvice, ReportsWhereFewRegisterAndNoModelIsFound) {
  Bench bench;
  const auto advice = [&] {
    return RegistrationAdvice(bench.sweep, bench.frames, bench.Used(), bench.law, bench.structure);
  };
  bench.law = {};
  for (std::size_t i = 0; i < 10; ++i) bench.frames[i].image_scale = 1;
  EXPECT_EQ(advice(), "") << "registration was not tried";
  bench.law.reference_frame = 3;
  EXPECT_THAT(advice(), AllOf(HasSubstr("only 10 of 21 frames could be registered"),
                              HasSubstr("state target: knife-edge"), HasSubstr("decoded wrongly")));
  bench.structure.measured = true;
  bench.structure.bands = model::Estimate{0.1, 0.01};
  EXPECT_THAT(advice(),
              AllOf(HasSubstr("only 10 of 21 frames could be registered to one another: whole rows "
                              "brighten together by 10 %"),
                    HasSubstr("rolling shutter"), Not(HasSubstr("knife-edge"))))
      << "such bands keep most frames from being registered";
  bench.structure.bands = model::Estimate{0.05, 0.005};
  EXPECT_THAT(advice(), AllOf(HasSubstr("whole rows brighten together by 5 %"),
                              HasSubstr("If this is not the cause: every frame must show")));
  bench.structure.bands.reset();
  bench.structure.vignetting = model::Estimate{-0.3, 0.01};
  EXPECT_THAT(advice(), AllOf(HasSubstr("vignetting"), HasSubstr("If this is not the cause")));
  bench.structure = {};
  bench.sweep.target = model::SweepTarget::kKnifeEdge;
  EXPECT_EQ(advice(), "") << "it is stated already";
  bench.sweep.target = model::SweepTarget::kAuto;
  bench.law.done = true;
  EXPECT_EQ(advice(), "");
  bench.law = StarModel();
  EXPECT_FALSE(bench.law.done);
  EXPECT_EQ(advice(), "") << "a star registers to nothing";
  bench.law = {};
  bench.law.reference_frame = 3;
  EXPECT_NE(advice(), "");
  bench.frames[10].image_scale = 1;
  EXPECT_EQ(advice(), "");
}

TEST(RejectUnregistered, NamesFramesThatShowSomethingElseWhereTheOthersFollowAModel) {
  Bench bench;
  bench.samples.erase(bench.samples.begin() + 6);
  bench.law.done = false;
  const auto reject = [&] {
    RejectUnregistered(bench.samples, bench.Used(), 12, bench.law, bench.structure, &bench.frames);
  };
  reject();
  EXPECT_EQ(bench.frames[6].rejection, "");
  bench.law.done = true;
  bench.structure.bands = model::Estimate{0.1, 0.01};
  reject();
  EXPECT_THAT(bench.frames[6].rejection, AllOf(HasSubstr("bands"), Not(HasSubstr("another part"))));
  Bench many;  // more frames than bands of 2 % cost
  many.samples.resize(14);
  many.law.done = true;
  many.structure.bands = model::Estimate{0.02, 0.002};
  RejectUnregistered(many.samples, many.Used(), 12, many.law, many.structure, &many.frames);
  EXPECT_THAT(many.frames[20].rejection,
              AllOf(HasSubstr("bands"), HasSubstr("or it shows another part of the target")));
  bench.structure = {};
  reject();
  EXPECT_THAT(bench.frames[6].rejection,
              AllOf(HasSubstr("cannot be registered: to frame-12.png"),
                    HasSubstr("another part of the target, or too little of it")));
  for (std::size_t i = 0; i < bench.frames.size(); ++i) {
    EXPECT_EQ(bench.frames[i].rejection.empty(), i != 6) << i;
  }
}

TEST(IsLoneEdge, AStatedEdgeWithoutAModelWhoseScalesAreFewOrInDisorder) {
  Bench bench;
  bench.law = {};
  for (const auto target : {model::SweepTarget::kKnifeEdge, model::SweepTarget::kPrintedEdge}) {
    bench.sweep.target = target;
    EXPECT_TRUE(IsLoneEdge(bench.sweep, 21, 10, bench.law));
    EXPECT_FALSE(IsLoneEdge(bench.sweep, 21, 11, bench.law));
    bench.law.contradicts_readings = true;
    EXPECT_TRUE(IsLoneEdge(bench.sweep, 21, 20, bench.law));
    bench.law.contradicts_readings = false;
  }
  bench.law.kind = ScaleKind::kInverseDepth;
  EXPECT_FALSE(IsLoneEdge(bench.sweep, 21, 6, bench.law)) << "a texture around it shows the scale";
  bench.law.kind = ScaleKind::kUnknown;
  for (const auto target : {model::SweepTarget::kAuto, model::SweepTarget::kTexture}) {
    bench.sweep.target = target;
    EXPECT_FALSE(IsLoneEdge(bench.sweep, 21, 1, bench.law));
  }
}

TEST(ForgetScales, KeepsTheReferenceAloneAndSaysWhatIsTaken) {
  Bench bench;
  bench.law = {};
  bench.law.reference_frame = 12;
  bench.law.contradicts_readings = true;
  ForgetScales(bench.sweep, &bench.samples, &bench.law);
  ASSERT_EQ(bench.samples.size(), 1u);
  EXPECT_EQ(bench.samples[0].frame, 12u);
  EXPECT_FALSE(bench.law.contradicts_readings);
  EXPECT_EQ(bench.law.message, "a lone edge shows no image scale");
  bench.sweep.offset_mm = model::Estimate{30, 0.1};
  ForgetScales(bench.sweep, &bench.samples, &bench.law);
  EXPECT_THAT(bench.law.message, HasSubstr("the given offset_mm is used unchecked"));
}

}  // namespace
}  // namespace thicklens::calib
