// thicklens plan.
#include "thicklens/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

class PlanProgram : public ::testing::Test {
 protected:
  ProgramResult Start(const Arguments& more) const {
    Arguments arguments = {"plan", folder_ / "camera.yaml"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }

  void SetUp() override {
    // A data sheet gives these values.
    const ProgramResult result =
        ChildProgram({"camera", "init", "--focal-mm", "50", "--f-number", "2.8", "--pitch-um",
                      "4.5", "--size", "640x480", "-o", folder_ / "camera.yaml"},
                     folder_.path(), 0)
            .Wait();
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  static Arguments Small(const Arguments& more) {
    Arguments arguments = {"--focus-mm", "300", "--region", "128x112", "--floor", "0.5,0.02"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  TemporaryFolder folder_;
};

TEST_F(PlanProgram, WritesASweepThatCanBeSimulatedAndCalibrated) {
  const ProgramResult result = Start(Small(
      {"--wanted", "zf=0.06 mm,kappa=2%", "--offset-sigma-mm", "0.03", "-o", folder_ / "plan.yaml",
       "--readings-out", folder_ / "readings.csv", "--json", folder_ / "plan.json"}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              AllOf(StartsWith("sweep "), HasSubstr("(wanted 0.06 mm)"), HasSubstr("noise"),
                    HasSubstr("would help most"), HasSubstr("thicklens simulate sweep ")));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "plan.json"));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_LE(json["sigma"]["focus_depth_mm"], 0.06);
  EXPECT_NEAR(json["wanted"]["blur_ratio"], 0.02 * 0.45, 1e-12);
  EXPECT_LE(json["sigma"]["blur_ratio"], 0.02 * 0.45);

  const SweepSimulation simulation = ReadSweepSimulation(folder_ / "plan.yaml");
  EXPECT_EQ(simulation.frame_count, json["frames"]);
  EXPECT_EQ(simulation.first_depth_mm, json["nearest_mm"]);
  EXPECT_EQ(simulation.step_mm, json["step_mm"]);
  EXPECT_EQ(simulation.camera.sensor.width_px, 128);
  EXPECT_NEAR(simulation.camera.focus_depth_mm(), 300, 1e-9);
  EXPECT_THAT(ContentOf(folder_ / "readings.csv"), StartsWith("image,reading_mm\nframe_000.png,"));
  // The two commands of the output.
  const ProgramResult simulated =
      ChildProgram({"simulate", "sweep", folder_ / "plan.yaml", "-o", folder_ / "sweep"},
                   folder_.path(), 0)
          .Wait();
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const ProgramResult calibrated =
      ChildProgram({"calibrate", folder_ / "sweep/sweep.yaml", "--no-field", "--json",
                    folder_ / "found.json", "-o", folder_ / "found.yaml"},
                   folder_.path(), 0)
          .Wait();
  ASSERT_EQ(calibrated.exit_code, 0) << calibrated.err;
  const auto found = nlohmann::json::parse(ContentOf(folder_ / "found.json"));
  // The simulated offset is exact, and the floor of the file is unknown: an error of at most 0.5
  // px^2 moves the focus by less than the plan's interval would.
  EXPECT_NEAR(found["focus_depth_mm"]["value"], 300, 0.1);
}

TEST_F(PlanProgram, RefusesWhatCannotBeReached) {
  const ProgramResult result =
      Start(Small({"--wanted", "zf=0.01mm", "--offset-sigma-mm", "0.03", "--most-frames", "30",
                   "-o", folder_ / "plan.yaml", "--json", folder_ / "plan.json"}));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("30 frames reach a standard deviation of 0.03"),
                                HasSubstr("needed would be a stated bench offset")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "plan.yaml"));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "plan.json"));
  EXPECT_EQ(json["status"], "refused");
  EXPECT_EQ(json["frames"], 30);
}

TEST_F(PlanProgram, WrongUsageNamesTheOption) {
  const auto expect_usage = [&](const Arguments& arguments, const std::string& text) {
    const ProgramResult result = Start(arguments);
    EXPECT_EQ(result.exit_code, 2) << text;
    EXPECT_THAT(result.err, HasSubstr(text));
  };
  expect_usage({}, "--focus-mm: the distance at which the lens is focused is needed");
  expect_usage({"--focus-mm", "49"}, "beyond the focal length of 50 mm");
  expect_usage({"--focus-mm", "300", "--wanted", "zf=0.1inch"}, "--wanted: standard deviations");
  expect_usage({"--focus-mm", "300", "--wanted", "x=1"}, "--wanted: standard deviations");
  expect_usage({"--focus-mm", "300", "--frames", "3"}, "--frames is 3: it must be from 9");
  expect_usage({"--focus-mm", "300", "--region", "1000x10"},
               "--region: WIDTHxHEIGHT up to 640x480");
  expect_usage({"--focus-mm", "300", "--range", "310,290"}, "--range is 310");
  expect_usage({"--focus-mm", "300", "--noise", "0.01", "--full-well", "1000"}, "--full-well");
}

TEST_F(PlanProgram, AWrongCameraIsNamed) {
  const ProgramResult result =
      ChildProgram({"plan", "missing.yaml", "--focus-mm", "300"}, folder_.path(), 0).Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("missing.yaml"));
}

TEST(PlannedSimulation, IsWhatItsFileSays) {
  TemporaryFolder folder;
  PlanConditions conditions;
  conditions.camera = ReadCamera(THICKLENS_SOURCE_DIR "/configs/cameras/case-iii.yaml");
  conditions.camera.calibration.reset();
  conditions.focus_depth_mm = 421.7;
  conditions.noise_sigma = 0.013;
  conditions.texture = model::TargetKind::kPinkNoise;
  conditions.lamp_falloff = false;
  conditions.bits = 16;
  const SweepDesign design = {333.3, 7.7, 21, 0.37};
  WriteCamera(folder / "it's.yaml", conditions.camera);
  WriteFileAtomically(folder / "plan.yaml", PlannedSimulationYaml(conditions, design, "it's.yaml"));
  const SweepSimulation read = ReadSweepSimulation(folder / "plan.yaml");
  const SweepSimulation made = PlannedSimulation(conditions, design);
  EXPECT_EQ(read.first_depth_mm, made.first_depth_mm);
  EXPECT_EQ(read.step_mm, made.step_mm);
  EXPECT_EQ(read.frame_count, made.frame_count);
  EXPECT_EQ(read.target.kind, made.target.kind);
  EXPECT_EQ(read.target.feature_size_mm, made.target.feature_size_mm);
  EXPECT_EQ(read.full_well_electrons, made.full_well_electrons);
  EXPECT_NEAR(read.read_noise_electrons / read.full_well_electrons, 0.013, 1e-15);
  EXPECT_EQ(read.lamp_falloff, made.lamp_falloff);
  EXPECT_EQ(read.bits, made.bits);
  EXPECT_NEAR(read.camera.focus_depth_mm(), made.camera.focus_depth_mm(), 1e-9);
  EXPECT_EQ(read.camera.blur_ratio(), made.camera.blur_ratio());
}

TEST(PlanInterface, RefusesOptionsByTheirField) {
  PlanConditions conditions;
  conditions.camera = ReadCamera(THICKLENS_SOURCE_DIR "/configs/cameras/case-iii.yaml");
  conditions.focus_depth_mm = 400;
  conditions.bits = 12;
  try {
    ProposeSweep(conditions, {});
    FAIL();
  } catch (const OptionError& error) {
    EXPECT_EQ(error.field(), "bits");
  }
}

}  // namespace
}  // namespace thicklens::tools
