// The table of hard cases with one test for each row, and tests that the judge detects wrong
// outcomes.
#include "tools/stress/stress_suite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/sweep_file.h"
#include "tools/stress/stress_case.h"
#include "tools/stress/stress_sweeps.h"
#include "tools/stress/stress_views.h"
#include "tools/support/child_process.h"
#include "tools/system/interrupt.h"

namespace thicklens::tools {

// GoogleTest prints this as the name of a parameter.
void PrintTo(const StressCase& hard, std::ostream* out) { *out << hard.name; }

namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Sanitizers and busy machines take longer than a person would wait.
constexpr double kLimitSeconds = 100;

// One way of each solver in each precision and on each device for which it has one, and for blocks
// a direct and an iterative one. All ways are tested by `doctor --hard-cases`, which takes minutes.
const Capabilities& ThisMachine() {
  static const Capabilities capabilities = [] {
    Capabilities found = ExamineCapabilities();
    found.every_way = false;
    return found;
  }();
  return capabilities;
}

class StressCaseTest : public ::testing::TestWithParam<StressCase> {};

TEST_P(StressCaseTest, IsAsRequired) {
  const thicklens::testing::TemporaryFolder folder;
  const StressResult result =
      RunStressCase(GetParam(), folder.path(), THICKLENS_PROGRAM, ThisMachine(), kLimitSeconds);
  EXPECT_FALSE(result.outcomes.empty());
  for (const StressOutcome& outcome : result.outcomes) {
    EXPECT_TRUE(outcome.as_required) << result.required << "\n"
                                     << outcome.command << "\n"
                                     << outcome.measured;
  }
}

std::string TestName(const ::testing::TestParamInfo<StressCase>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Table, StressCaseTest, ::testing::ValuesIn(AllStressCases()), TestName);

TEST(StressCases, AreSixtyAtLeastAndNoneTwice) {
  std::set<std::string> names;
  for (const StressCase& hard : AllStressCases()) {
    EXPECT_TRUE(names.insert(hard.name).second) << hard.name;
    EXPECT_NE(hard.why, "") << hard.name;
    EXPECT_NE(hard.required, "") << hard.name;
  }
  EXPECT_GE(names.size(), 60U);
}

// Returns the outcome of a synthetic command.
StressOutcome OutcomeOf(const StressRun& run, double limit_seconds = kLimitSeconds) {
  const thicklens::testing::TemporaryFolder folder;
  StressCase hard;
  hard.prepare = [&](const fs::path& at, const Capabilities&) {
    const StressImage shape;
    WriteImage(at, shape, Waves);
    WriteDepth(at, shape, [](int, int) { return 0.5; });
    return std::vector<StressRun>{run};
  };
  return RunStressCase(hard, folder.path(), THICKLENS_PROGRAM, {}, limit_seconds).outcomes.front();
}

Requirement ErrorIs(double error, double limit) {
  return Solved([=](const fs::path&, const nlohmann::json&) { return error; }, limit);
}

TEST(StressCaseJudge, SeesErrorsThatAreTooLarge) {
  const StressImage shape;
  EXPECT_TRUE(OutcomeOf(EstimateOf(shape, {}, ErrorIs(1, 1))).as_required);
  EXPECT_THAT(OutcomeOf(EstimateOf(shape, {}, ErrorIs(2, 1))).measured,
              HasSubstr("error 2, more than 1"));
  EXPECT_FALSE(OutcomeOf(EstimateOf(shape, {}, ErrorIs(std::nan(""), 1))).as_required);
  // The views do not have the requested form.
  EXPECT_FALSE(OutcomeOf(EstimateOf(shape, {}, ViewsAreAll(shape, 0.5, 0.1))).as_required);
  StressImage other = shape;
  other.channels = 3;
  EXPECT_THAT(OutcomeOf(EstimateOf(shape, {}, ViewsAreNumbers(other))).measured,
              HasSubstr("1 channel(s) came out"));
}

TEST(StressCaseJudge, SeesWhatIsNotRefused) {
  const StressImage shape;
  EXPECT_THAT(OutcomeOf(EstimateOf(shape, {}, Refused({}))).measured, HasSubstr("not refused"));
  const std::vector<std::string> impossible = {"--solver", "grid", "--gamma", "0"};
  EXPECT_TRUE(OutcomeOf(EstimateOf(shape, impossible, Refused({"gamma"}))).as_required);
  EXPECT_THAT(OutcomeOf(EstimateOf(shape, impossible, Refused({"lambda"}))).measured,
              HasSubstr("refused without the text 'lambda'"));
  EXPECT_THAT(OutcomeOf(EstimateOf(shape, impossible, ErrorIs(0, 1))).measured,
              AllOf(HasSubstr("refused: "), HasSubstr("gamma")));
  Requirement either = ErrorIs(0, 1);
  either.or_refused_with = {"gamma"};
  EXPECT_TRUE(OutcomeOf(EstimateOf(shape, impossible, either)).as_required);
  either.or_refused_with = {"lambda"};
  EXPECT_FALSE(OutcomeOf(EstimateOf(shape, impossible, either)).as_required);
}

TEST(StressCaseJudge, SeesWhatHangs) {
  const StressImage shape;
  const StressOutcome outcome = OutcomeOf(EstimateOf(shape, {}, ErrorIs(0, 1)), 1e-6);
  EXPECT_FALSE(outcome.as_required);
  EXPECT_THAT(outcome.measured, HasSubstr("not finished after"));
}

// Views as an estimate would have left them.
void WriteViewsOf(const fs::path& folder, const StressImage& shape, const ViewOf& view) {
  model::LightField views =
      model::MakeLightField(shape.width_px, shape.height_px, shape.u_count, shape.v_count, 1);
  views.transfer = model::TransferCurve::Linear();
  for (int l = 0; l < shape.v_count; ++l) {
    for (int k = 0; k < shape.u_count; ++k) {
      float* values = views.values.data() + views.ViewStart(0, k, l);
      for (int y = 0; y < shape.height_px; ++y) {
        for (int x = 0; x < shape.width_px; ++x) {
          *values++ = static_cast<float>(view(views.u_offset(k), views.v_offset(l), x, y));
        }
      }
    }
  }
  OutputFolder output((folder / "views").string(), io::kLightFieldMarker, io::LightFieldEntries());
  io::WriteLightField(views, io::ViewFormat::kTiff, &output);
  output.Commit();
}

// The photograph of a plane, and views that are these.
class StressCaseViews : public ::testing::Test {
 protected:
  StressCaseViews() : truth_(SlantedSurface(Waves, 1.5, 0)) {
    WriteMeanOfViews(folder_.path(), shape_, truth_);
  }
  double ErrorOf(const Requirement& required, const ViewOf& view,
                 const nlohmann::json& summary = {}) {
    WriteViewsOf(folder_.path(), shape_, view);
    return required.error(folder_.path(), summary);
  }
  // The photograph itself in each view.
  ViewOf Warped() const {
    return [truth = truth_](double a, double b, double x, double y) {
      double sum = 0;
      for (int l = -1; l <= 1; ++l) {
        for (int k = -1; k <= 1; ++k) sum += truth(k, l, x + 1.5 * a, y + 1.5 * b);
      }
      return sum / 9;
    };
  }

  const StressImage shape_;
  const ViewOf truth_;
  const thicklens::testing::TemporaryFolder folder_;
};

TEST_F(StressCaseViews, TrueOnesPassAndWarpedOnesDoNot) {
  const Requirement required = ViewsAre(shape_, truth_, kTruthBorderPx, 0.03);
  EXPECT_LT(ErrorOf(required, truth_), 1e-6);
  EXPECT_GT(ErrorOf(required, Warped()), required.limit);
}

TEST_F(StressCaseViews, BlackIsNoAnswer) {
  const ViewOf black = [](double, double, double, double) { return 0.0; };
  EXPECT_THROW(ErrorOf(ViewsWithinImage(shape_, 0.5), black), Error);
  EXPECT_THROW(ErrorOf(ViewsAreAlike(shape_, 0.5), black), Error);
  EXPECT_LT(ErrorOf(ViewsWithinImage(shape_, 0.5), truth_), 0.5);
  const ViewOf loud = [this](double a, double b, double x, double y) {
    return 0.5 + 4 * (truth_(a, b, x, y) - 0.5);
  };
  EXPECT_GT(ErrorOf(ViewsWithinImage(shape_, 0.5), loud), 0.5);
}

TEST_F(StressCaseViews, WhatIsNoNumberIsNoAnswer) {
  const ViewOf broken = [this](double a, double b, double x, double y) {
    return a > 0 && x == 3 && y == 4 ? std::nan("") : truth_(a, b, x, y);
  };
  EXPECT_THROW(ErrorOf(ViewsAreNumbers(shape_), broken), Error);
  EXPECT_THROW(ErrorOf(ViewsWithinImage(shape_, 9), broken), Error);
}

TEST_F(StressCaseViews, ASummaryMustSayWhetherItConverged) {
  const Requirement required = SolvedOrReported(shape_, 0.5, truth_, 0.03);
  const nlohmann::json done = {{"converged", true}, {"status", "ok"}, {"reason", ""}};
  const nlohmann::json cut = {{"converged", false}, {"status", "partial"}, {"reason", "not yet"}};
  const nlohmann::json quiet = {{"converged", false}, {"status", "ok"}, {"reason", ""}};
  const nlohmann::json without_reason = {
      {"converged", false}, {"status", "partial"}, {"reason", ""}};
  EXPECT_LT(ErrorOf(required, truth_, done), 0.5);
  EXPECT_LT(ErrorOf(required, Warped(), cut), 0.5);
  EXPECT_THROW(ErrorOf(required, Warped(), done), Error);
  EXPECT_THROW(ErrorOf(required, truth_, quiet), Error);
  EXPECT_THROW(ErrorOf(required, truth_, without_reason), Error);
}

TEST(StressCaseSweeps, TheTruthMustLieWithinTheStatedErrors) {
  model::SweepTruth truth;
  truth.image_distance_mm = 60;
  truth.focus_depth_mm = 300;
  truth.blur_ratio = 0.45;
  const auto error = [&](double distance_mm, double focus_mm, double focus_sigma_mm) {
    const nlohmann::json summary = {
        {"image_distance_mm", {{"value", distance_mm}, {"sigma", 0.001}, {"systematic", nullptr}}},
        {"focus_depth_mm", {{"value", focus_mm}, {"sigma", focus_sigma_mm}}},
        {"blur_ratio", {{"value", 0.46}, {"sigma", 0.01}, {"systematic", {0.45, 0.47}}}},
        {"error_terms", nlohmann::json::array()}};
    return FindsTruth(truth, 10).error("", summary);
  };
  EXPECT_NEAR(error(60.002, 300, 0.01), 2, 1e-6);
  EXPECT_NEAR(error(60, 300.06, 0.01), 6, 1e-6);
  EXPECT_THROW(error(60.02, 300, 0.01), Error);
  EXPECT_THROW(error(60, 300, 0), Error);
  const nlohmann::json reported = {{"warnings", {"a focal length looks wrong"}},
                                   {"error_terms", nlohmann::json::array()}};
  EXPECT_EQ(Warned({"focal length", "wrong"}).error("", reported), 0);
  EXPECT_THROW(Warned({"aperture"}).error("", reported), Error);
}

TEST(RunProgram, TheEndOfAProgramIsReported) {
  const thicklens::testing::TemporaryFolder folder;
  const auto shell = [&](const std::string& script) {
    return RunProgram("/bin/sh", {"-c", script}, folder.path(), 60);
  };
  const ProgramRun ended = shell("echo out; echo err >&2; pwd; exit 7");
  EXPECT_EQ(ended.exit_code, 7);
  EXPECT_THAT(ended.out, AllOf(HasSubstr("out\n"), HasSubstr(folder.path())));
  EXPECT_EQ(ended.err, "err\n");
  const ProgramRun crashed = shell("kill -SEGV $$");
  EXPECT_EQ(crashed.exit_code, -1);
  EXPECT_EQ(crashed.signal, SIGSEGV);
  EXPECT_TRUE(RunProgram("/bin/sh", {"-c", "sleep 60"}, folder.path(), 0.01).timed_out);
  EXPECT_THROW(RunProgram("/no/such/program", {}, folder.path(), 1), Error);
}

// Ctrl-C is for the whole group: a child that has ended by it was not at fault.
TEST(RunProgram, IsInterruptedWithItsChild) {
  const thicklens::testing::TemporaryFolder folder;
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        CatchSignals();
        const CancelScope scope(ProgramToken());
        try {
          RunProgram("/bin/sh", {"-c", "kill -INT $PPID $$"}, folder.path(), 60);
        } catch (const Interrupted&) {
          std::_Exit(0);
        }
        std::_Exit(1);
      },
      ::testing::ExitedWithCode(0), "");
}

TEST(ShellCommand, CanBeTypedAgain) {
  EXPECT_EQ(ShellCommand({"thicklens", "explain", "camera.yaml", "500:2000"}),
            "thicklens explain camera.yaml 500:2000");
  EXPECT_EQ(ShellCommand({"a b", "", "it's", "$x"}), "'a b' '' 'it'\\''s' '$x'");
}

TEST(DoctorStressSuite, RunsOneAndKeepsItsFiles) {
  const thicklens::testing::TemporaryFolder folder, scratch;
  const std::string kept = folder / "kept", summary = folder / "summary.json";
  const ProgramResult result =
      ChildProgram({"doctor", "--hard-cases", "--only", "optics/no-aperture", "--keep", kept,
                    "--json", summary},
                   scratch.path(), 0)
          .Wait();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("ok   optics/no-aperture"),
                    HasSubstr("$ thicklens explain camera.yaml"), HasSubstr("1 of 1 as required")));
  EXPECT_TRUE(fs::exists(fs::path(kept) / "optics/no-aperture/camera.yaml"));
  const auto json = nlohmann::json::parse(ReadWholeFile(summary));
  EXPECT_EQ(json["rows"].size(), 1U);
  EXPECT_EQ(json["rows"][0]["as_required"], true);
  EXPECT_EQ(json["status"], "ok");
  // Files that are there are not written over.
  const ProgramResult again =
      ChildProgram({"doctor", "--hard-cases", "--only", "optics/no-aperture", "--keep", kept},
                   scratch.path(), 0)
          .Wait();
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("is not empty"));
}

TEST(DoctorStressSuite, KnowsItsNames) {
  const thicklens::testing::TemporaryFolder scratch;
  const ProgramResult result =
      ChildProgram({"doctor", "--hard-cases", "--only", "optic"}, scratch.path(), 0).Wait();
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("there is no hard case or group 'optic'"),
                                HasSubstr("optics/no-aperture")));
}

}  // namespace
}  // namespace thicklens::tools
