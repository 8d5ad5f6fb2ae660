// The former names of commands and options, which work until version 1.0.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/deprecation.h"
#include "tools/options/deprecated_names.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

// The former names of `simulate image` and its options.
std::vector<std::string> NamesOfSimulateImage() {
  std::vector<std::string> names;
  for (const DeprecatedName& name : DeprecatedNames()) {
    const bool is_command = name.kind == NameKind::kCommand && name.now == "simulate image";
    const bool is_option =
        name.kind == NameKind::kOption && name.where.find("`simulate image`") != std::string::npos;
    if (is_command || is_option) names.push_back(name.former);
  }
  return names;
}

class DeprecatedOnCommandLine : public ::testing::TestWithParam<std::string> {
 protected:
  DeprecatedOnCommandLine() {
    folder_.Put("camera.yaml",
                "schema: thicklens/camera/2\nname: wide\n"
                "lens: {front_focal_length_mm: 6, rear_focal_length_mm: 6, lens_thickness_mm: 1.5, "
                "aperture_radius_mm: 1.2}\n"
                "sensor: {width_px: 64, height_px: 48, pixel_pitch_mm: 0.09, "
                "principal_point_px: [31.5, 23.5], transfer: srgb}\n"
                "psf: disc\n");
    folder_.Put("scene.yaml",
                "schema: thicklens/simulate-scene/1\ncamera: camera.yaml\n"
                "truth: {focus_depth_mm: 200, blur_ratio: 0.5, blur_floor_px: 0.4}\n"
                "layers:\n"
                "- {name: wall, plane: {depth_mm: 700}, texture: {kind: dead-leaves}}\n"
                "noise_sigma_grey_levels: 1\nviews: [3, 3]\n");
  }

  static bool IsCommand() { return GetParam().front() != '-'; }
  static bool IsFlag() { return GetParam() == "--attribute"; }
  static std::string Now() {
    return PresentName(IsCommand() ? NameKind::kCommand : NameKind::kOption, GetParam());
  }
  ProgramResult Run(const Arguments& arguments) const {
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  // A command line with that name of a command or an option of `simulate image`.
  Arguments With(const std::string& name, const Arguments& more) const {
    Arguments words = {"simulate", IsCommand() ? name.substr(name.find(' ') + 1) : "image",
                       folder_ / "scene.yaml", "--effects", "defocus,falloff"};
    if (!IsCommand()) words.push_back(name);
    if (!IsCommand() && !IsFlag()) words.emplace_back("0.25gl");
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::string Warning() const {
    return "thicklens: warning: " + DeprecationText({GetParam(), Now()}) + "\n";
  }

  TemporaryFolder folder_, scratch_;
};

// The summary without what differs between any two runs.
nlohmann::json Steady(nlohmann::json summary) {
  if (!summary.is_structured()) return summary;
  if (summary.is_object()) {
    for (const char* key : {"output", "seconds", "image_seconds", "picture_seconds",
                            "estimate_seconds", "calibration_seconds"}) {
      summary.erase(key);
    }
  }
  for (nlohmann::json& value : summary) value = Steady(value);
  return summary;
}

TEST_P(DeprecatedOnCommandLine, DoesTheSameWithOneWarning) {
  const auto run = [this](const std::string& name, const std::string& out) {
    return Run(With(name, {"-o", folder_ / out, "--json", folder_ / out + ".json"}));
  };
  const ProgramResult now = run(Now(), "now");
  const ProgramResult former = run(GetParam(), "former");
  ASSERT_EQ(now.exit_code, 0) << now.err;
  ASSERT_EQ(former.exit_code, 0) << former.err;
  EXPECT_EQ(former.err, Warning() + now.err);
  EXPECT_THAT(former.out, Not(HasSubstr("deprecated")));
  EXPECT_EQ(ContentOf(folder_ / "former/picture.png"), ContentOf(folder_ / "now/picture.png"));
  EXPECT_EQ(ContentOf(folder_ / "former/depth.pfm"), ContentOf(folder_ / "now/depth.pfm"));
  const auto summary = [this](const std::string& name) {
    return Steady(nlohmann::json::parse(ContentOf(folder_ / name)));
  };
  EXPECT_EQ(summary("former.json"), summary("now.json"));
  EXPECT_EQ(summary("former.json").contains("ablation"), IsFlag());
}

TEST_P(DeprecatedOnCommandLine, IsQuietIfAsked) {
  const ProgramResult result = Run(With(GetParam(), {"-o", folder_ / "out", "--quiet"}));
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, IsEmpty());
  EXPECT_THAT(result.out, IsEmpty());
}

TEST_P(DeprecatedOnCommandLine, IsNotInTheHelp) {
  const std::string former = GetParam();
  const std::string word = former.substr(former.find(' ') + 1);
  for (const Arguments& words :
       {Arguments{"--help"}, Arguments{"simulate", "--help"},
        Arguments{"simulate", "image", "--help"}, Arguments{"simulate", "sweep", "--help"}}) {
    const std::string text = Run(words).out;
    EXPECT_THAT(text, AllOf(HasSubstr("--help"), Not(HasSubstr("  " + word))));
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeprecatedOnCommandLine, ::testing::ValuesIn(NamesOfSimulateImage()),
                         [](const auto& tested) {
                           std::string name;
                           for (const char letter : tested.param) {
                             if (letter >= 'a' && letter <= 'z') name += letter;
                           }
                           return name;
                         });

// The notice comes before the error, which is of a file that does not exist.
TEST(DeprecatedOption, IsOneOfSimulateSweepToo) {
  const TemporaryFolder folder, scratch;
  const ProgramResult result =
      ChildProgram({"simulate", "sweep", folder / "none.yaml", "-o", folder / "out", "--attribute"},
                   scratch.path(), 0)
          .Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(
      result.err,
      AllOf(StartsWith("thicklens: warning: " + DeprecationText({"--attribute", "--ablate"}) +
                       "\nthicklens: error: "),
            HasSubstr("none.yaml"), EndsWith("\n")));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 2);
}

ProgramResult RunIn(const TemporaryFolder& scratch, const Arguments& arguments) {
  return ChildProgram(arguments, scratch.path(), 0).Wait();
}

// One warning, and then the error of this place.
void ExpectWarningThenError(const ProgramResult& result, const std::string& former,
                            const std::string& now, const std::string& place) {
  EXPECT_THAT(result.err, AllOf(StartsWith("thicklens: warning: " + DeprecationText({former, now}) +
                                           "\nthicklens: error: "),
                                HasSubstr(place), EndsWith("\n")));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 2);
}

TEST(DeprecatedOption, OfTargetDrawsTheSame) {
  const TemporaryFolder folder, scratch;
  const Arguments begin = {"target", "--feature-mm", "1", "-o"};
  const auto draw = [&](const std::string& file, const Arguments& more) {
    Arguments all = begin;
    all.push_back(folder / file);
    all.insert(all.end(), more.begin(), more.end());
    return RunIn(scratch, all);
  };
  const ProgramResult now = draw("now.svg", {"--paper", "100x80"});
  const ProgramResult former = draw("former.svg", {"--size", "100x80"});
  ASSERT_EQ(now.exit_code, 0) << now.err;
  ASSERT_EQ(former.exit_code, 0) << former.err;
  EXPECT_THAT(now.err, IsEmpty());
  EXPECT_EQ(former.err, "thicklens: warning: " + DeprecationText({"--size", "--paper"}) + "\n");
  EXPECT_EQ(ContentOf(folder / "former.svg"), ContentOf(folder / "now.svg"));
  const ProgramResult both = draw("both.svg", {"--size", "a3", "--paper", "a4"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.err, AllOf(HasSubstr("--paper"), HasSubstr("--size")));
  EXPECT_EQ(draw("none.svg", {"--size="}).exit_code, 2);
}

TEST(DeprecatedOption, OfToleranceIsOneOfEachCommandWithEffects) {
  const TemporaryFolder folder, scratch;
  for (const Arguments& command :
       {Arguments{"explain", folder / "none.yaml", "--depth-range", "100:200"},
        Arguments{"render", folder / "none.yaml", "--as-captured", "-o", folder / "a.png"},
        Arguments{"simulate", "light-field", folder / "none.yaml", "-o", folder / "lf"}}) {
    Arguments all = command;
    all.insert(all.end(), {"--tolerance", "1gl"});
    const ProgramResult result = RunIn(scratch, all);
    EXPECT_EQ(result.exit_code, 1);
    ExpectWarningThenError(result, "--tolerance", "--effect-tolerance", "none.yaml");
  }
}

TEST(DeprecatedValue, OfAnOptionIsAccepted) {
  const TemporaryFolder folder, scratch;
  const ProgramResult calibrate =
      RunIn(scratch, {"calibrate", folder / "none.yaml", "--method", "source"});
  EXPECT_EQ(calibrate.exit_code, 1);
  ExpectWarningThenError(calibrate, "--method source", "--method paper", "none.yaml");
  const ProgramResult estimate = RunIn(
      scratch, {"estimate", folder / "none.png", folder / "none.pfm", "--depth-kind", "disparity",
                "--solver", "blocks", "--stencil", "source", "-o", folder / "lf"});
  EXPECT_EQ(estimate.exit_code, 1);
  ExpectWarningThenError(estimate, "--stencil source", "--stencil paper", "none.png");
  for (const char* value : {"paper", "fit"}) {
    const ProgramResult result =
        RunIn(scratch, {"calibrate", folder / "none.yaml", "--method", value});
    EXPECT_THAT(result.err, AllOf(HasSubstr("none.yaml"), Not(HasSubstr("deprecated"))));
  }
}

TEST(DeprecatedCommand, OfBenchIsAcceptedAndHidden) {
  const TemporaryFolder scratch;
  const ProgramResult result = RunIn(scratch, {"bench", "source", "--camera", "none.yaml"});
  EXPECT_EQ(result.exit_code, 2);
  ExpectWarningThenError(result, "bench source", "bench paper", "--camera requires --image");
  EXPECT_THAT(RunIn(scratch, {"bench", "--help"}).out,
              AllOf(HasSubstr("  paper "), Not(HasSubstr("  source "))));
}

// The warning of a file comes once for both words, and not with --quiet.
TEST(DeprecatedYaml, GivesOneWarning) {
  const TemporaryFolder folder, scratch;
  const auto run = [&](Arguments arguments) {
    return ChildProgram(arguments, scratch.path(), 0).Wait();
  };
  const std::string head = std::string("schema: thicklens/simulate-scene/1\ncamera: ") +
                           THICKLENS_SOURCE_DIR +
                           "/configs/cameras/case-ii.yaml\n"
                           "truth: {focus_depth_mm: 300, blur_ratio: 0.45}\n"
                           "size_px: [40, 30]\nlayers:\n- plane: {depth_mm: 303}\n  texture: ";
  const std::string leaves = folder.Put("leaves.yaml", head + "{kind: dead-leaves}\n");
  ASSERT_EQ(run({"simulate", "image", leaves, "-o", folder / "leaves"}).exit_code, 0);
  const std::string file = "leaves/picture.png}\n";
  const std::string former = folder.Put("a.yaml", head + "{kind: picture, picture: " + file);
  const std::string now = folder.Put("b.yaml", head + "{kind: image, image: " + file);
  const ProgramResult of_former = run({"simulate", "image", former, "-o", folder / "a"});
  const ProgramResult of_now = run({"simulate", "image", now, "-o", folder / "b"});
  ASSERT_EQ(of_former.exit_code, 0) << of_former.err;
  ASSERT_EQ(of_now.exit_code, 0) << of_now.err;
  const std::string text = DeprecationText({"picture", "image"});
  EXPECT_THAT(of_former.err, AllOf(HasSubstr("a.yaml:"), HasSubstr(text)));
  EXPECT_EQ(of_former.err.find(text), of_former.err.rfind(text));
  EXPECT_THAT(of_now.err, Not(HasSubstr("deprecated")));
  EXPECT_EQ(ContentOf(folder / "a/picture.png"), ContentOf(folder / "b/picture.png"));
  EXPECT_THAT(run({"simulate", "image", former, "-o", folder / "a", "--quiet"}).err,
              Not(HasSubstr("deprecated")));
}

}  // namespace
}  // namespace thicklens::tools
