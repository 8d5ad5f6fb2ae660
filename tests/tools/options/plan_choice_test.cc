// The profile that estimate chooses a plan by, and the words about its choice.
#include "tools/options/plan_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "support/sample_profile.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/profile_measurement.h"
#include "tools/options/estimate_plan.h"
#include "tools/options/estimate_profile.h"
#include "tools/options/quality_target_options.h"
#include "tools/support/child_process.h"
#include "tools/system/build_info.h"
#include "tools/system/machine.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::kSampleWorkload;
using thicklens::testing::SamplePlan;
using thicklens::testing::SampleProfile;
using thicklens::testing::TemporaryFolder;

TEST(QualityTargetText, IsAsTyped) {
  EXPECT_EQ(QualityTargetText({"best", {}, {}}), "--quality best");
  EXPECT_EQ(QualityTargetText({"", 3.0, 1.0}), "--within 3s --psnr-loss 1dB");
}

TEST(ChoiceText, HoldsTheTimeAgainstWhatWasExpected) {
  const estimator::PlanChoice choice =
      estimator::ChoosePlan(SampleProfile(), {"standard", {}, {}}, "", kSampleWorkload, 2);
  EXPECT_THAT(ChoiceText(choice, 10), HasSubstr("8 s expected, 10 s taken (+25 %)"));
}

std::string Written(const TemporaryFolder& folder, const json& profile) {
  const std::string path = folder / "profile.json";
  std::ofstream(path) << profile.dump();
  return path;
}

// The environment for as long as this lives.
class Environment {
 public:
  Environment(const char* name, const char* value) : name_(name) {
    const char* before = std::getenv(name);
    if (before != nullptr) before_ = before;
    Set(value);
  }
  ~Environment() { Set(before_ ? before_->c_str() : nullptr); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  void Set(const char* value) {
    if (value == nullptr) {
      unsetenv(name_.c_str());
    } else {
      setenv(name_.c_str(), value, 1);
    }
  }
  std::string name_;
  std::optional<std::string> before_;
};

TEST(Profile, IsLookedForWhereAPersonsSettingsAre) {
  const TemporaryFolder folder;
  {
    const Environment config("XDG_CONFIG_HOME", (folder / "config").c_str());
    EXPECT_EQ(UserProfilePath(), folder / "config/thicklens/profile.json");
    EXPECT_FALSE(ProfileFor("").is_own);  // there is none
    std::filesystem::create_directories(folder / "config/thicklens");
    std::ofstream(UserProfilePath()) << ProfileJson(SampleProfile()).dump();
    EXPECT_EQ(ProfileFor("").from, UserProfilePath());
    EXPECT_THROW(ProfileFor(folder / "none.json"), Error);
    std::ofstream(UserProfilePath()) << "nonsense";
    try {
      ProfileFor("");
      ADD_FAILURE() << "no refusal";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("measure it again"), HasSubstr("delete it")));
    }
  }
  const Environment config("XDG_CONFIG_HOME", nullptr);
  const Environment home("HOME", "/home/somebody");
  EXPECT_EQ(UserProfilePath(), "/home/somebody/.config/thicklens/profile.json");
  const Environment no_home("HOME", nullptr);
  EXPECT_EQ(UserProfilePath(), "");
  EXPECT_FALSE(ProfileFor("").is_own);
}

TEST(Profile, IsOfThisMachineIfAllOfItIs) {
  estimator::EstimateProfile profile = SampleProfile();
  profile.processor = ProcessorName();
  profile.build = BuildInfo();
  profile.threads = 2;
  profile.is_own = true;
  EXPECT_EQ(IsFromHere(profile, 2), ProcessorName() != kUnknownProcessor);
  EXPECT_FALSE(IsFromHere(profile, 1));
  profile.build += " and more";
  EXPECT_FALSE(IsFromHere(profile, 2));
  EXPECT_FALSE(IsFromHere(DefaultProfile(), DefaultProfile().threads));
}

// The measurement goes from files to files, on images so small that it takes seconds.
TEST(MeasureProfile, GivesWhatEstimateCanChooseBy) {
  using Use = ProfileCase::Use;
  ProfileRun run;
  run.cases = {{64, 2, false, true, 1, Use::kTimeAndViews},
               {80, 3, true, true, 1, Use::kTimeAndViews},
               {96, 2, true, false, 1, Use::kTime},
               {112, 2, false, false, 1, Use::kCheck}};
  run.threads = 1;
  run.repeat = 2;
  run.program = THICKLENS_PROGRAM;
  int reported = 0;
  run.progress = [&](int done, int total) {
    EXPECT_LT(done, total);
    ++reported;
  };
  estimator::EstimatePlan ridge, tv;
  ridge.prior = "ridge";
  tv.prior = "tv";
  const MeasuredProfile measured = MeasureProfile({ridge, tv}, run);
  EXPECT_EQ(reported, 4 + 16);
  EXPECT_EQ(measured.judged, 2);
  EXPECT_EQ(measured.profile.runs, 2);
  for (const estimator::TimedWorkload& timed : measured.loads[0]) {
    EXPECT_GT(timed.parts.read, 0);
    EXPECT_GT(timed.parts.setup, 0);
    EXPECT_GT(timed.parts.solve, 0);
    EXPECT_GT(timed.parts.files, 0);
    EXPECT_GE(timed.seconds - timed.parts.read - timed.parts.setup - timed.parts.solve -
                  timed.parts.files,
              0);
  }
  ASSERT_EQ(measured.loads.size(), 2U);
  EXPECT_EQ(measured.loads[0].size(), 3U);
  EXPECT_EQ(measured.checks[1].size(), 1U);
  const estimator::EstimateProfile& profile = measured.profile;
  EXPECT_NEAR(profile.largest.megapixels, 0.009216, 1e-9);  // the check is not in it
  EXPECT_EQ(profile.largest.views, 9);
  EXPECT_GT(profile.best_psnr_db(), profile.warping_psnr_db);
  const TemporaryFolder folder;
  const estimator::EstimateProfile read = ReadProfile(Written(folder, ProfileJson(profile)));
  EXPECT_NEAR(read.plans[1].time_model.Seconds(kSampleWorkload),
              profile.plans[1].time_model.Seconds(kSampleWorkload), 1e-9);
  EXPECT_THAT(ProfileTable(measured), AllOf(HasSubstr("scene ridge"), HasSubstr("0.01 megapixels, "
                                                                                "1 channel(s)")));
  run.progress = [](int, int) { throw Error("stop"); };
  EXPECT_THROW(MeasureProfile({ridge}, run), Error);
  run.progress = {};
  run.program = "/bin/false";
  try {
    MeasureProfile({ridge}, run);
    ADD_FAILURE() << "no refusal";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(StartsWith("/bin/false estimate picture.png"),
                                    HasSubstr("--prior ridge: it ended with 1")));
  }
}

TEST(MeasureProfile, AMissingTemporaryFolderIsReported) {
  const Environment nowhere("TMPDIR", "/no/such/folder");
  try {
    MeasureProfile({estimator::EstimatePlan()}, ProfileRun());
    ADD_FAILURE() << "no refusal";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("TMPDIR: no folder for temporary files can be created in "
                                        "'/no/such/folder'"));
  }
}

TEST(Profile, IsReadAsItWasWritten) {
  const TemporaryFolder folder;
  const estimator::EstimateProfile profile = SampleProfile();
  const estimator::EstimateProfile read = ReadProfile(Written(folder, ProfileJson(profile)));
  EXPECT_EQ(ProfileJson(read), ProfileJson(profile));
  EXPECT_EQ(read.from, folder / "profile.json");
}

TEST(Profile, OneShipsAndHasSomethingForEverybody) {
  const estimator::EstimateProfile profile = DefaultProfile();
  EXPECT_GE(profile.plans.size(), 4U);
  EXPECT_GT(profile.best_psnr_db(), profile.warping_psnr_db + 1);
  for (const estimator::PlanProfile& plan : profile.plans) {
    EXPECT_GT(plan.time_model.Seconds(kSampleWorkload), 0) << estimator::PlanName(plan.plan);
  }
  const auto seconds_of = [&](const std::string& quality) {
    return estimator::ChoosePlan(profile, {quality, {}, {}}, quality, kSampleWorkload, 1)
        .expected_seconds;
  };
  EXPECT_LE(seconds_of("draft"), seconds_of("standard"));
  EXPECT_LE(seconds_of("standard"), seconds_of("best"));
}

TEST(Profile, IsRefusedByNameOfFileAndField) {
  const TemporaryFolder folder;
  const auto refusal = [&](const json& profile) {
    try {
      ReadProfile(Written(folder, profile));
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no refusal");
  };
  const json good = ProfileJson(SampleProfile());
  EXPECT_EQ(refusal(good), "no refusal");
  const auto with = [&](const std::string& pointer, const json& value) {
    json changed = good;
    changed[json::json_pointer(pointer)] = value;
    return refusal(changed);
  };
  EXPECT_THAT(refusal("text"), HasSubstr("profile.json: is not a JSON object"));
  EXPECT_THAT(with("/schema", "other"), HasSubstr("schema: 'thicklens/estimate-profile/5'"));
  EXPECT_THAT(with("/threads", 0), HasSubstr("threads: a whole number from 1 to"));
  EXPECT_THAT(with("/threads", 10'000'000'000), HasSubstr("threads: a whole number from 1 to"));
  EXPECT_THAT(with("/runs", 2.5), HasSubstr("runs: a whole number from 1 to"));
  EXPECT_THAT(with("/plans", json::array()), HasSubstr("at least one plan"));
  EXPECT_THAT(with("/plans/1/seconds", {1, 2}), HasSubstr("plans[1]: seconds: "));
  EXPECT_THAT(with("/plans/1/seconds/0", -1), HasSubstr("plans[1]: seconds: "));
  EXPECT_THAT(with("/plans/0/plan/solver", "magic"), HasSubstr("plans[0]: solver: scene, blocks"));
  EXPECT_THAT(with("/plans/0/plan/prior", "magic"), HasSubstr("plans[0]: "));
  EXPECT_THAT(with("/plans/0/plan/device", "gpu"), HasSubstr("device: cpu or opencl"));
  EXPECT_THAT(with("/largest/views", "many"), HasSubstr("largest: views: a whole number"));
  EXPECT_THAT(with("/plans/0/plan/tolerance", 7), HasSubstr("plans[0]: "));
  EXPECT_THAT(with("/plans/0/plan/block_px", 7), HasSubstr("--block-px requires --solver blocks"));
  json lacking = good;
  lacking["plans"][2].erase("psnr_db");
  EXPECT_THAT(refusal(lacking), HasSubstr("plans[2]: 'psnr_db' is missing"));
  EXPECT_THROW(ReadProfile(folder / "nothing.json"), Error);
}

// The program: an image of the demo's size.
class EstimateTarget : public ::testing::Test {
 protected:
  // A person's own profile is none of the test's.
  EstimateTarget() : config_("XDG_CONFIG_HOME", (folder_ / "config").c_str()) {
    ChildProgram simulate({"simulate", "image", THICKLENS_SOURCE_DIR "/configs/scenes/demo.yaml",
                           "-o", folder_ / "scene", "--quiet"},
                          folder_.path(), 0);
    EXPECT_EQ(simulate.Wait().exit_code, 0);
  }
  ProgramResult Estimate(std::vector<std::string> more) {
    std::vector<std::string> arguments = {"estimate",
                                          folder_ / "scene/picture.png",
                                          folder_ / "scene/depth.pfm",
                                          "--depth-kind",
                                          "z",
                                          "--depth-unit",
                                          "mm",
                                          "--camera",
                                          folder_ / "scene/camera.yaml",
                                          "--views",
                                          "3x3",
                                          "-o",
                                          folder_ / "lf",
                                          "--json",
                                          folder_ / "estimate.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ChildProgram program(arguments, folder_.path(), 0);
    return program.Wait();
  }
  json Summary() const {
    std::ifstream file(folder_ / "estimate.json");
    return json::parse(file);
  }
  TemporaryFolder folder_;
  Environment config_;
};

TEST_F(EstimateTarget, IsTakenFromTheProfileAndHeldAgainstWhatItTook) {
  const std::string profile = Written(folder_, ProfileJson(SampleProfile()));
  const ProgramResult result = Estimate({"--quality", "draft", "--profile", profile});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("--quality draft: scene gradient, about"));
  EXPECT_THAT(result.out, HasSubstr("plan         --solver scene --prior gradient: "));
  const json summary = Summary();
  EXPECT_EQ(summary["prior"], "gradient");
  EXPECT_EQ(summary["plan"]["asked"], "--quality draft");
  EXPECT_EQ(summary["plan"]["seconds"], summary["seconds"]["total"]);
  EXPECT_GT(summary["plan"]["expected_seconds"].get<double>(), 0);
}

// The law of this profile says that nothing but reading takes any time.
TEST_F(EstimateTarget, CountsReading) {
  estimator::EstimateProfile profile = SampleProfile();
  profile.plans = {SamplePlan("ridge", 1e-12, 40)};
  // The profile is that of this machine, so that no probe is needed.
  profile.processor = ProcessorName();
  profile.build = BuildInfo();
  profile.threads = 1;
  const ProgramResult result = Estimate(
      {"--quality", "best", "--threads", "1", "--profile", Written(folder_, ProfileJson(profile))});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const double read = Summary()["seconds"]["read"].get<double>();
  EXPECT_GT(read, 1e-5);
  EXPECT_GE(Summary()["plan"]["expected_seconds"].get<double>(), 0.5 * read);
}

TEST_F(EstimateTarget, ThatCannotBeMetLeavesNothingBehind) {
  const ProgramResult result = Estimate({"--within", "1e-6s"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("--within 1e-06s cannot be met"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "lf"));
  EXPECT_EQ(Summary()["status"], "refused");
}

TEST_F(EstimateTarget, ExcludesWhatItChooses) {
  const std::vector<std::vector<std::string>> wrong = {
      {"--quality", "draft", "--solver", "grid"},
      {"--within", "2s", "--prior", "tv"},
      {"--psnr-loss", "1dB", "--tolerance", "0.1"},
      {"--quality", "draft", "--within", "2s"},
      {"--within", "2m"},
      {"--within", "-1"},
      {"--psnr-loss", "much"},
      {"--quality", "good"},
      {"--profile", "file"},
      {"--quality", "best", "--check-blur"},
      {"--quality", "best", "--photo", "sharp"},
      {"--quality", "best", "--max-iterations", "1"},
      {"--within", "2", "--gamma", "1"}};
  for (const std::vector<std::string>& arguments : wrong) {
    EXPECT_EQ(Estimate(arguments).exit_code, 2) << ::testing::PrintToString(arguments);
  }
}

TEST_F(EstimateTarget, WithoutOneIsNoPlan) {
  ASSERT_EQ(Estimate({}).exit_code, 0);
  EXPECT_TRUE(Summary()["plan"].is_null());
}

}  // namespace
}  // namespace thicklens::tools
