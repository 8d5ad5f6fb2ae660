#include "tools/options/sweep_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tools/options/option_values.h"
#include "tools/options/sweep_options.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

std::string CameraText(const std::string& pitch_mm, const std::string& calibration) {
  return "schema: thicklens/camera/2\nname: bench\n"
         "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, "
         "aperture_radius_mm: 9}\n"
         "sensor: {width_px: 9, height_px: 9, pixel_pitch_mm: " +
         pitch_mm + ", principal_point_px: [4, 4], transfer: linear}\n" + calibration;
}

// The camera with its aperture 20 mm behind the front of the lens.
std::string Placed(std::string camera) {
  const std::string before = "lens: {";
  return camera.insert(camera.find(before) + before.size(), "aperture_behind_front_mm: 20, ");
}

constexpr char kMeasured[] =
    "calibration: {blur_floor_px: {value: 0.52, sigma: 0.01}, evidence: {method: joint}}\n";

class SweepInputTest : public ::testing::Test {
 protected:
  SweepInputTest() {
    folder_.Put("a.png");
    folder_.Put("camera.yaml", CameraText("0.005", ""));
    folder_.Put("edge.yaml", CameraText("0.005", kMeasured));
    folder_.Put("other.yaml", CameraText("0.006", kMeasured));
    arguments_.input = Sweep("");
  }
  std::string Sweep(const std::string& rest) {
    return folder_.Put("sweep.yaml",
                       "schema: thicklens/sweep/1\ncamera: camera.yaml\n"
                       "frames: [{image: a.png, reading_mm: 1}]\n" +
                           rest);
  }

  TemporaryFolder folder_;
  SweepArguments arguments_;
};

TEST_F(SweepInputTest, FloorFromACalibratedCamera) {
  Sweep("blur_floor_px: 0.9\n");
  arguments_.floor_from = folder_ / "edge.yaml";
  const thicklens::Sweep input = ReadSweepInput(arguments_);
  EXPECT_EQ(input.description.floor.given_px.value().value, 0.52);
  EXPECT_EQ(input.description.floor.given_px.value().sigma, 0.01);
  EXPECT_THAT(arguments_.Files(), Contains(folder_ / "edge.yaml"));
}

TEST_F(SweepInputTest, FloorFromAnUnfitCameraIsRefused) {
  arguments_.floor_from = folder_ / "other.yaml";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              AllOf(StartsWith("--floor-from: "), HasSubstr("sensor.pixel_pitch_mm 0.006"),
                    HasSubstr("'bench' of this sweep has 0.005")));
  arguments_.floor_from = folder_ / "camera.yaml";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              AllOf(StartsWith("--floor-from: "), HasSubstr("no calibration")));
  arguments_.floor_from = folder_ / "none.yaml";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              AllOf(StartsWith("--floor-from: "), HasSubstr("none.yaml")));
}

TEST_F(SweepInputTest, CompressedFramesAreReported) {
  EXPECT_THAT(ReadSweepInput(arguments_).notices, Not(Contains(HasSubstr("JPEG"))));
  folder_.Put("b.JPG", "\xFF\xD8\xFF");
  folder_.Put("c.jpeg", "\xFF\xD8\xFF");
  folder_.Put("sweep.yaml",
              "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes: [{image: a.png, reading_mm: "
              "1}, {image: b.JPG, reading_mm: 2}, {image: c.jpeg, reading_mm: 3}]\n");
  EXPECT_THAT(ReadSweepInput(arguments_).notices,
              Contains(StartsWith("2 of 3 frames are JPEG files")));
  folder_.Put("b.JPG", "\x89PNG");  // a name says nothing
  EXPECT_THAT(ReadSweepInput(arguments_).notices,
              Contains(StartsWith("1 of 3 frames are JPEG files")));
}

// The file may leave it out where the command line states it.
TEST_F(SweepInputTest, AReadingSigmaThatIsStatedIsNotMissed) {
  const auto missed = Contains(HasSubstr("reading_sigma_mm is not stated"));
  arguments_.reading_sigma_mm.reset();
  EXPECT_THAT(ReadSweepInput(arguments_).notices, missed);
  arguments_.reading_sigma_mm = 0.05;
  EXPECT_THAT(ReadSweepInput(arguments_).notices, Not(missed));
}

TEST_F(SweepInputTest, TheCameraInUseIsTheOneCompared) {
  Sweep("blur_floor_px: {from_calibration: other.yaml}\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              HasSubstr("sweep.yaml:4:35: blur_floor_px.from_calibration: "));
  // Another camera on the command line, of the floor's pitch.
  arguments_.camera_path = folder_ / "other.yaml";
  EXPECT_EQ(ReadSweepInput(arguments_).description.floor.given_px.value().value, 0.52);
  // A floor on the command line takes the place of the other camera's.
  arguments_.camera_path.clear();
  arguments_.floor_px = "0.3:0.1";
  EXPECT_EQ(ReadSweepInput(arguments_).description.floor.given_px.value().value, 0.3);
  arguments_.floor_px = "unknown";
  EXPECT_FALSE(ReadSweepInput(arguments_).description.floor.given_px);
}

TEST_F(SweepInputTest, OneFloorIsEnough) {
  arguments_.floor_from = folder_ / "edge.yaml";
  arguments_.floor_px = "0.3";
  EXPECT_THROW(ReadSweepInput(arguments_), UsageError);
}

// Messages of the interface name the option as it is typed.
TEST_F(SweepInputTest, AnOffsetIsNeededForItsStandardDeviation) {
  arguments_.offset_sigma_mm = 0.5;
  EXPECT_EQ(ErrorOf([&] { ReadSweepInput(arguments_); }),
            "--offset-sigma-mm: the offset itself is missing, give --offset-mm");
  arguments_.offset_mm = "unknown";
  EXPECT_EQ(ErrorOf([&] { ReadSweepInput(arguments_); }),
            "--offset-sigma-mm: an unknown offset has no standard deviation");
  EXPECT_THROW(ReadSweepInput(arguments_), UsageError);
  arguments_.offset_mm = "12.5";
  const thicklens::Sweep input = ReadSweepInput(arguments_);
  EXPECT_EQ(input.description.offset_mm.value().value, 12.5);
  EXPECT_EQ(input.description.offset_mm.value().sigma, 0.5);
}

TEST_F(SweepInputTest, AFolderNeedsReadingsAndACamera) {
  arguments_.input = folder_ / "frames";
  folder_.Put("frames/a.png");
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), HasSubstr("needs --readings"));
  arguments_.readings_csv = folder_.Put("readings.csv", "file,reading\na.png,1\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), StartsWith("--camera: "));
  EXPECT_THROW(ReadSweepInput(arguments_), UsageError);
  arguments_.camera_path = folder_ / "camera.yaml";
  EXPECT_EQ(ReadSweepInput(arguments_).description.frames.size(), 1U);
  arguments_.input = folder_ / "sweep.yaml";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), HasSubstr("is not a folder"));
}

TEST_F(SweepInputTest, ReadingsInTheNamesAreProposedAndRead) {
  arguments_.input = folder_ / "frames";
  arguments_.camera_path = folder_ / "camera.yaml";
  folder_.Put("frames/z10um.png");
  folder_.Put("frames/z9.5um.png");
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              HasSubstr("--reading-from-name 'z{reading}um.png'"));
  arguments_.readings.name_pattern = "z{reading}um.png";
  const model::SweepFile sweep = ReadSweepInput(arguments_).description;
  EXPECT_EQ(sweep.frames.at(0).reading_mm, 0.0095);
  EXPECT_EQ(sweep.readings, "'z{reading}um.png' in the names of 2 files, um");
  arguments_.readings_csv = folder_.Put("readings.csv", "file,z\nz10um.png,1\nz9.5um.png,2\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), HasSubstr("exclude each other"));
  arguments_.readings.name_pattern.clear();
  arguments_.readings.unit = "furlong";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), StartsWith("--unit: "));
  arguments_.readings.unit = "counts";
  arguments_.readings.scale_mm = 0.5;
  EXPECT_EQ(ReadSweepInput(arguments_).description.frames.at(1).reading_mm, 1);
  arguments_.readings.scale_mm = 0;
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), StartsWith("--reading-scale: "));
}

// JSON and EXIF come through the interface as well, and a table through a sweep's file.
TEST_F(SweepInputTest, ReadingsOfOtherSourcesComeThrough) {
  arguments_.input = folder_ / "frames";
  arguments_.camera_path = folder_ / "camera.yaml";
  folder_.Put("frames/a.png");
  folder_.Put("frames/b.png");
  folder_.Put("frames/a.json", R"({"LensPosition": 4})");
  folder_.Put("frames/b.json", R"({"LensPosition": 5})");
  arguments_.readings.source = "sidecar";
  EXPECT_EQ(ReadSweepInput(arguments_).description.frames.at(1).reading_mm, 250);
  arguments_.readings.source.clear();
  arguments_.readings_csv =
      folder_.Put("metadata.txt", R"({"FrameKey-0-0-0": {"FileName": "a.png", "ZPositionUm": 10},
                                      "FrameKey-0-0-1": {"FileName": "b.png", "ZPositionUm": 20}})");
  EXPECT_EQ(ReadSweepInput(arguments_).description.frames.at(1).reading_mm, 0.02);
  // Without a notice that the sigma is not stated, if an option states it.
  arguments_.reading_sigma_mm = 0.05;
  const thicklens::Sweep sweep = ReadSweepInput(arguments_);
  EXPECT_TRUE(std::none_of(sweep.notices.begin(), sweep.notices.end(), [](const auto& notice) {
    return notice.find("reading_sigma_mm") != std::string::npos;
  }));
}

TEST_F(SweepInputTest, ThePeriodOfTheTargetComesThrough) {
  Sweep("target_period_mm: 5\n");
  EXPECT_EQ(ReadSweepInput(arguments_).description.target_period_mm.value(), 5);
  EXPECT_EQ(ReadSweepInput(arguments_).description.raw, model::SweepRaw::kDemosaiced);
  Sweep("raw: green\n");
  EXPECT_EQ(ReadSweepInput(arguments_).description.raw, model::SweepRaw::kGreen);
  arguments_.raw = "demosaiced";
  EXPECT_EQ(ReadSweepInput(arguments_).description.raw, model::SweepRaw::kDemosaiced);
}

// ---- the plane of focus ----

// Each option for the plane of focus, with what it becomes.
struct FocusOption {
  const char* option;
  std::string SweepArguments::*text;
  std::optional<Measured> model::SweepFile::*stated;
  const char* key;
};
const FocusOption kFocusOptions[] = {
    {"--focus-depth-mm", &SweepArguments::focus_depth_mm, &model::SweepFile::focus_depth_mm,
     "focus_depth_mm"},
    {"--working-distance-mm", &SweepArguments::working_distance_mm,
     &model::SweepFile::working_distance_mm, "working_distance_mm"},
    {"--image-distance-mm", &SweepArguments::image_distance_mm,
     &model::SweepFile::image_distance_mm, "image_distance_mm"},
    {"--tube-length-mm", &SweepArguments::tube_length_mm, &model::SweepFile::optical_tube_length_mm,
     "optical_tube_length_mm"},
    {"--magnification", &SweepArguments::magnification, &model::SweepFile::magnification,
     "magnification"}};

TEST_F(SweepInputTest, StatementsOfThePlaneOfFocusReplaceThoseOfTheFile) {
  folder_.Put("camera.yaml", Placed(CameraText("0.005", "")));
  for (const FocusOption& of : kFocusOptions) {
    SCOPED_TRACE(of.option);
    Sweep(std::string(of.key) + ": {value: 90, sigma: 3}\n");
    SweepArguments arguments = arguments_;
    const auto stated = [&] { return (ReadSweepInput(arguments).description.*of.stated).value(); };
    EXPECT_EQ(stated().value, 90);
    EXPECT_EQ(stated().sigma, 3);
    arguments.*of.text = "75.5";
    EXPECT_EQ(stated().value, 75.5);
    EXPECT_EQ(stated().sigma, 0);
    arguments.*of.text = "75.5:0.25";
    EXPECT_EQ(stated().sigma, 0.25);
    for (const char* wrong : {"0", "-3", "3:-1", "3:1:1", "near", "3:", "unknown", "nan"}) {
      arguments.*of.text = wrong;
      EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments); }),
                  AllOf(StartsWith(std::string(of.option) + ": "), HasSubstr("VALUE:SIGMA"),
                        HasSubstr(std::string("'") + wrong + "'")));
      EXPECT_THROW(ReadSweepInput(arguments), UsageError);
    }
    EXPECT_EQ(SweepOptionNames()(std::string(of.key) + ".sigma"), of.option);
  }
}

TEST_F(SweepInputTest, AWorkingDistanceNeedsThePlaceOfTheAperture) {
  arguments_.working_distance_mm = "75.5";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              HasSubstr("state lens.aperture_behind_front_mm in the camera file"));
  folder_.Put("camera.yaml", Placed(CameraText("0.005", "")));
  EXPECT_TRUE(ReadSweepInput(arguments_).IsValid(nullptr));
  arguments_.working_distance_mm = "10";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              HasSubstr("it is a depth of 30 mm from the aperture"));
}

// A statement that the lens makes impossible is found when the sweep is checked.
TEST_F(SweepInputTest, AnImageDistanceInFrontOfEveryImageIsNotValid) {
  arguments_.image_distance_mm = "49";
  const thicklens::Sweep input = ReadSweepInput(arguments_);
  std::string why;
  EXPECT_FALSE(input.IsValid(&why));
  EXPECT_THAT(why, AllOf(HasSubstr("image_distance_mm is 49"), HasSubstr("larger than 50 mm")));
}

TEST_F(SweepInputTest, TheMovingPartMayBeGiven) {
  Sweep("moves: lens\n");
  EXPECT_EQ(ReadSweepInput(arguments_).description.moves.value(), model::SweepMotion::kLens);
  arguments_.moves = "sensor";
  EXPECT_EQ(ReadSweepInput(arguments_).description.moves.value(), model::SweepMotion::kSensor);
}

TEST_F(SweepInputTest, ThePeriodOfTheTargetMayBeGiven) {
  Sweep("target_period_mm: 5\n");
  arguments_.target_period_mm = 2.5;
  EXPECT_EQ(ReadSweepInput(arguments_).description.target_period_mm.value(), 2.5);
  arguments_.target_period_mm = -2.5;
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), StartsWith("--target-period-mm: "));
  EXPECT_THROW(ReadSweepInput(arguments_), UsageError);
}

TEST_F(SweepInputTest, TheGridOfTheTargetMayBeGiven) {
  Sweep("target_grid: {pattern: chequerboard, columns: 9, rows: 6, square_mm: 5}\n");
  arguments_.target_grid = "charuco:11x8:10";
  arguments_.stage_alignment_deg = 0.2;
  const model::SweepFile file = ReadSweepInput(arguments_).description;
  EXPECT_EQ(file.target_grid->Description(),
            "ChArUco board of 11 x 8 squares of 10 mm, markers of 7 mm, 4x4_250");
  EXPECT_EQ(file.stage_alignment_deg.value(), 0.2);
  arguments_.target_grid = "charuco:11x8";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }),
              AllOf(StartsWith("--grid: "), HasSubstr("PATTERN:COLUMNSxROWS:SQUARE_MM")));
  EXPECT_THROW(ReadSweepInput(arguments_), UsageError);
}

TEST_F(SweepInputTest, ViewsOfAGridNeedTheGrid) {
  Sweep("");
  arguments_.grid_views = "tilted";
  EXPECT_THAT(ErrorOf([&] { ReadSweepInput(arguments_); }), HasSubstr("give --grid"));
}

// The command line as CLI11 reads it.
TEST(SweepStatements, AreReadFromTheCommandLine) {
  CLI::App app;
  SweepArguments arguments;
  AddSweepStatements(&app, &arguments);
  app.parse(
      "--focus-depth-mm 120:1 --working-distance-mm 90 --image-distance-mm 75:0.5 "
      "--tube-length-mm 160 --magnification 0.5:0.01 --target-period-mm 0.5");
  const SweepOverrides overrides = SweepOverridesOf(arguments);
  EXPECT_EQ(overrides.focus_depth_mm.value().sigma, 1);
  EXPECT_EQ(overrides.working_distance_mm.value().value, 90);
  EXPECT_EQ(overrides.image_distance_mm.value().sigma, 0.5);
  EXPECT_EQ(overrides.optical_tube_length_mm.value().value, 160);
  EXPECT_EQ(overrides.magnification.value().value, 0.5);
  EXPECT_EQ(overrides.target_period_mm.value(), 0.5);
  for (const char* wrong : {"0", "-1", "nan", "fine"}) {
    CLI::App again;
    AddSweepStatements(&again, &arguments);
    EXPECT_THROW(again.parse(std::string("--target-period-mm ") + wrong), CLI::ParseError) << wrong;
  }
}

// Numbers of the camera that affect a result and have no stated tolerance are reported once.
TEST_F(SweepInputTest, MissingTolerancesAreReportedUnlessTheTruthIsKnown) {
  Sweep("");
  const auto reported = [&] {
    const thicklens::Sweep input = ReadSweepInput(arguments_);
    return std::count_if(input.notices.begin(), input.notices.end(), [](const std::string& line) {
      return line.find("no tolerance is stated") != std::string::npos;
    });
  };
  EXPECT_EQ(reported(), 1);
  // The error of an objective's magnification is known without a statement, that of a pitch is not.
  const std::string objective =
      "schema: thicklens/camera/2\nname: bench\n"
      "lens: {magnification: 10, numerical_aperture: 0.25, tube_lens_focal_length_mm: 200}\n"
      "sensor: {width_px: 9, height_px: 9, pixel_pitch_mm: PITCH, principal_point_px: [4, 4], "
      "transfer: linear}\n";
  const auto with_pitch = [&](const std::string& pitch) {
    std::string text = objective;
    return text.replace(text.find("PITCH"), 5, pitch);
  };
  const auto text_with_tolerance_of_magnification = [&] {
    std::string text = with_pitch("0.005");
    return text.replace(text.find("magnification: 10"), 17,
                        "magnification: {value: 10, tolerance: 0.1}");
  };
  folder_.Put("camera.yaml", with_pitch("0.005"));
  EXPECT_EQ(reported(), 1);
  folder_.Put("camera.yaml", with_pitch("{value: 0.005, tolerance: 0.00001}"));
  EXPECT_EQ(reported(), 0);
  // A notice states the assumed tolerance of the magnification unless it is stated or measured.
  const auto tells = [&](const std::string& words) {
    const thicklens::Sweep input = ReadSweepInput(arguments_);
    return std::any_of(input.notices.begin(), input.notices.end(), [&](const std::string& line) {
      return line.find(words) != std::string::npos;
    });
  };
  EXPECT_TRUE(tells("the 5 % that ISO 8039 allows") && tells("equivalent thin lens"));
  folder_.Put("camera.yaml", text_with_tolerance_of_magnification());
  EXPECT_TRUE(!tells("ISO 8039") && tells("equivalent thin lens"));
  folder_.Put("camera.yaml", CameraText("0.005", ""));
  EXPECT_EQ(reported(), 1);
  arguments_.truth_path =
      folder_.Put("known.yaml",
                  "schema: thicklens/sweep-truth/1\nimage_distance_mm: 57\nfocus_depth_mm: 400\n"
                  "blur_ratio: 0.4\nblur_floor_px: 0.5\nbench_offset_mm: 10\n"
                  "frames: [{image: a.png, depth_mm: 11, reading_mm: 1, blur_sigma_px: 2}]\n");
  EXPECT_EQ(reported(), 0);
}

}  // namespace
}  // namespace thicklens::tools
