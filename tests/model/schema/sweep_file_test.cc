#include "thicklens/model/sweep_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tests/model/schema/sweep_folder.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::thicklens::testing::ContentOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::SweepFolder;
using ::thicklens::testing::TemporaryFolder;

TEST_F(SweepFolder, DefaultsAreUnknownAndAway) {
  const SweepFile sweep = Read(frames_);
  EXPECT_FALSE(sweep.offset_mm.has_value());
  EXPECT_EQ(sweep.direction, BenchDirection::kAway);
  EXPECT_EQ(sweep.target, SweepTarget::kAuto);
  EXPECT_FALSE(sweep.floor.given_px || sweep.floor.from_px || sweep.floor.to_px);
  EXPECT_EQ(sweep.roi.width, 0);
  EXPECT_EQ(sweep.reading_sigma_mm, 0);
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("reading_sigma_mm is not stated")));
}

TEST_F(SweepFolder, Offset) {
  EXPECT_FALSE(Read(frames_ + "offset_mm: unknown\n").offset_mm.has_value());
  EXPECT_EQ(Read(frames_ + "offset_mm: -3.5\n").offset_mm.value().value, -3.5);
  const Estimate offset =
      Read(frames_ + "offset_mm: {value: 106.2, sigma: 0.5}\n").offset_mm.value();
  EXPECT_EQ(offset.value, 106.2);
  EXPECT_EQ(offset.sigma, 0.5);
  EXPECT_THAT(ErrorWith(frames_ + "offset_mm: unkown\n"), HasSubstr("s.yaml:4:12: offset_mm"));
  EXPECT_THAT(ErrorWith(frames_ + "offset_mm: [1]\n"), HasSubstr("offset_mm"));
  EXPECT_THAT(ErrorWith(frames_ + "offset_mm: {value: 1, sigma: -1}\n"),
              HasSubstr("offset_mm.sigma"));
}

// Each statement about the plane of focus, with its key.
struct StatementOfFocus {
  const char* key;
  std::optional<Estimate> SweepFile::*field;
};
constexpr StatementOfFocus kStatementsOfFocus[] = {
    {"focus_depth_mm", &SweepFile::focus_depth_mm},
    {"working_distance_mm", &SweepFile::working_distance_mm},
    {"image_distance_mm", &SweepFile::image_distance_mm},
    {"optical_tube_length_mm", &SweepFile::optical_tube_length_mm},
    {"magnification", &SweepFile::magnification}};

TEST_F(SweepFolder, PlaneOfFocus) {
  for (const StatementOfFocus& of : kStatementsOfFocus) {
    SCOPED_TRACE(of.key);
    const std::string key = of.key;
    EXPECT_FALSE((Read(frames_).*of.field).has_value());
    EXPECT_FALSE((Read(frames_ + key + ": unknown\n").*of.field).has_value());
    EXPECT_EQ((Read(frames_ + key + ": 2.5\n").*of.field).value().value, 2.5);
    EXPECT_EQ((Read(frames_ + key + ": 2.5\n").*of.field).value().sigma, 0);
    const SweepFile sweep = Read(frames_ + key + ": {value: 0.5, sigma: 0.02}\n");
    EXPECT_EQ((sweep.*of.field).value().value, 0.5);
    EXPECT_EQ((sweep.*of.field).value().sigma, 0.02);
    for (const StatementOfFocus& other : kStatementsOfFocus)
      EXPECT_EQ((sweep.*other.field).has_value(), other.key == of.key);
    const std::string place = "s.yaml:4:" + std::to_string(key.size() + 3) + ": " + key;
    EXPECT_THAT(ErrorWith(frames_ + key + ": 0\n"), HasSubstr(place + ": must be > 0, found 0"));
    EXPECT_THAT(ErrorWith(frames_ + key + ": -3\n"), HasSubstr(place + ": must be > 0, found -3"));
    EXPECT_THAT(ErrorWith(frames_ + key + ": near\n"), HasSubstr(place));
    EXPECT_THAT(ErrorWith(frames_ + key + ": {value: -3}\n"),
                HasSubstr(key + ".value: must be > 0, found -3"));
    EXPECT_THAT(ErrorWith(frames_ + key + ": {value: 3, sigma: -1}\n"),
                HasSubstr(key + ".sigma: must be >= 0"));
    EXPECT_THAT(ErrorWith(frames_ + key + ": {value: 3, tolerance: 1}\n"),
                HasSubstr("unknown key 'tolerance'"));
  }
}

TEST_F(SweepFolder, TheMovingPartIsReadAndWritten) {
  EXPECT_FALSE(Read(frames_).moves.has_value());
  EXPECT_THAT(SweepToYaml(Read(frames_)), Not(HasSubstr("moves")));
  for (const SweepMotion part :
       {SweepMotion::kTarget, SweepMotion::kCamera, SweepMotion::kLens, SweepMotion::kSensor}) {
    const SweepFile sweep = Read(frames_ + "moves: " + SweepMotionName(part) + "\n");
    EXPECT_EQ(sweep.moves.value(), part);
    EXPECT_THAT(SweepToYaml(sweep), HasSubstr("moves: " + SweepMotionName(part) + "\n"));
    EXPECT_EQ(MovesFocus(part), part == SweepMotion::kLens || part == SweepMotion::kSensor);
  }
  EXPECT_THAT(ErrorWith(frames_ + "moves: stage\n"),
              AllOf(HasSubstr("s.yaml:4:8: moves"), HasSubstr("sensor")));
}

TEST_F(SweepFolder, StatementsOfFocusAreWrittenOnlyIfThereAreAny) {
  const SweepFile none = Read(frames_);
  for (const StatementOfFocus& of : kStatementsOfFocus)
    EXPECT_THAT(SweepToYaml(none), Not(HasSubstr(of.key)));
  SweepFile all = none;
  all.camera_path = "c.yaml";
  all.frames = {{"a.png", 1}};
  double value = 1.0 / 3;
  for (const StatementOfFocus& of : kStatementsOfFocus)
    all.*of.field = Estimate{value += 1, value / 7};
  folder_.Put("back.yaml", SweepToYaml(all));
  const SweepFile back = ReadSweep(folder_ / "back.yaml", nullptr);
  for (const StatementOfFocus& of : kStatementsOfFocus) {
    SCOPED_TRACE(of.key);
    EXPECT_EQ((back.*of.field).value().value, (all.*of.field).value().value);
    EXPECT_EQ((back.*of.field).value().sigma, (all.*of.field).value().sigma);
  }
}

TEST_F(SweepFolder, Floor) {
  const auto floor = [&](const std::string& text) {
    return Read(frames_ + "blur_floor_px: " + text + "\n").floor;
  };
  const auto error = [&](const std::string& text) {
    return ErrorWith(frames_ + "blur_floor_px: " + text + "\n");
  };
  EXPECT_FALSE(floor("unknown").given_px.has_value());
  EXPECT_EQ(floor("0.5").given_px.value().value, 0.5);
  EXPECT_EQ(floor("{value: 0.5, sigma: 0.1}").given_px.value().sigma, 0.1);
  EXPECT_EQ(floor("{from: 0.2, to: 0.7}").from_px.value(), 0.2);
  EXPECT_EQ(floor("{from: 0.2, to: 0.7}").to_px.value(), 0.7);
  EXPECT_THAT(error("{from: 0.7, to: 0.2}"), HasSubstr("0.7 and 0.2"));
  EXPECT_THAT(error("{from: 0.7}"), HasSubstr("'to' is missing"));
  EXPECT_THAT(error("{value: 1, from: 0, to: 2}"), HasSubstr("exactly one of"));
  EXPECT_THAT(error("{}"), HasSubstr("expected"));
  EXPECT_THAT(error("-1"), HasSubstr("must be >= 0, found -1"));
  EXPECT_THAT(error("[0, 1]"), HasSubstr("blur_floor_px"));
}

// A camera file with this lens, pitch and `calibration` (a flow map, or nothing).
std::string CameraText(double focal_mm, double radius_mm, double pitch_mm,
                       const std::string& calibration) {
  const std::string f = YamlNumber(focal_mm);
  return "schema: thicklens/camera/2\nname: edge\n"
         "lens: {front_focal_length_mm: " +
         f + ", rear_focal_length_mm: " + f +
         ", lens_thickness_mm: 0, aperture_radius_mm: " + YamlNumber(radius_mm) +
         "}\nsensor: {width_px: 9, height_px: 9, pixel_pitch_mm: " + YamlNumber(pitch_mm) +
         ", principal_point_px: [4, 4], transfer: linear}\n" +
         (calibration.empty() ? "" : "calibration: " + calibration + "\n");
}

constexpr char kMeasuredFloor[] =
    "{blur_floor_px: {value: 0.52, sigma: 0.01}, evidence: {method: joint}}";
constexpr char kFloorFromEdge[] = "blur_floor_px: {from_calibration: edge/camera.yaml}\n";

TEST_F(SweepFolder, FloorOfAnotherCalibration) {
  const std::string camera =
      folder_.Put("edge/camera.yaml", CameraText(50, 9, 0.005, kMeasuredFloor));
  const SweepFile sweep = Read(frames_ + kFloorFromEdge);
  const Estimate floor = sweep.floor.given_px.value();
  EXPECT_EQ(floor.value, 0.52);
  EXPECT_EQ(floor.sigma, 0.01);
  EXPECT_EQ(sweep.floor_origin.value().camera_path, camera);
  EXPECT_THAT(
      ErrorWith(frames_ + "blur_floor_px: {from_calibration: edge/camera.yaml, value: 1}\n"),
      HasSubstr("exactly one of"));
  EXPECT_FALSE(Read(frames_ + "blur_floor_px: 0.5\n").floor_origin);
}

TEST_F(SweepFolder, AFloorThatWasNotMeasuredIsRefused) {
  const auto error = [&](const std::string& calibration) {
    folder_.Put("edge/camera.yaml", CameraText(50, 9, 0.005, calibration));
    return ErrorWith(frames_ + kFloorFromEdge);
  };
  const std::string place = "s.yaml:4:35: blur_floor_px.from_calibration: ";
  EXPECT_THAT(error(""),
              AllOf(HasSubstr(place), HasSubstr("edge/camera.yaml contains no calibration:")));
  EXPECT_THAT(error("{blur_ratio: 0.4, evidence: {method: joint}}"),
              AllOf(HasSubstr(place), HasSubstr("no calibration.blur_floor_px")));
  for (const std::string method : {"assumed", "source-recipe"}) {
    EXPECT_THAT(error("{blur_floor_px: 0.5, evidence: {method: " + method + "}}"),
                AllOf(HasSubstr(place), HasSubstr("method is '" + method + "'")));
  }
  EXPECT_THAT(error("{blur_floor_px: -1, evidence: {method: joint}}"),
              AllOf(HasSubstr(place), HasSubstr("camera.yaml:5:30: calibration.blur_floor_px")));
  EXPECT_THAT(ErrorWith(frames_ + "blur_floor_px: {from_calibration: none.yaml}\n"),
              AllOf(HasSubstr(place), HasSubstr("none.yaml")));
}

TEST_F(SweepFolder, AFloorOfAnotherCameraIsRefused) {
  const auto camera = [](double focal_mm, double radius_mm, double pitch_mm) {
    return ParseCamera(CameraText(focal_mm, radius_mm, pitch_mm, ""), "c.yaml");
  };
  folder_.Put("edge/camera.yaml", CameraText(50, 9, 0.005, kMeasuredFloor));
  const SweepFile sweep = Read(frames_ + kFloorFromEdge);
  const auto error = [&](const Camera& used) {
    return ErrorOf([&] { RequireFloorOfCamera(sweep, used); });
  };
  RequireFloorOfCamera(sweep, camera(50, 9, 0.005));
  RequireFloorOfCamera(sweep, camera(50.000001, 9, 0.005));
  EXPECT_THAT(
      error(camera(50, 9, 0.006)),
      AllOf(HasSubstr("s.yaml:4:35: blur_floor_px.from_calibration: "),
            HasSubstr("sensor.pixel_pitch_mm 0.005"), HasSubstr("'edge' of this sweep has 0.006")));
  EXPECT_THAT(error(camera(35, 9, 0.005)),
              AllOf(HasSubstr("lens.front_focal_length_mm 50"), HasSubstr("this sweep has 35:")));
  EXPECT_THAT(error(camera(50, 4.5, 0.005)), HasSubstr("lens.aperture_radius_mm 9"));
  Camera other = camera(50, 9, 0.005);
  other.lens.lens_thickness_mm = 3;
  EXPECT_THAT(error(other), HasSubstr("lens.lens_thickness_mm 0"));
  other = camera(50, 9, 0.005);
  other.lens.rear_focal_length_mm = 66;
  EXPECT_THAT(error(other), HasSubstr("lens.rear_focal_length_mm 50"));
  // A floor that is stated belongs to the camera that it is stated for.
  RequireFloorOfCamera(Read(frames_ + "blur_floor_px: 0.5\n"), camera(35, 9, 0.005));
}

TEST_F(SweepFolder, PeriodOfTheTarget) {
  EXPECT_FALSE(Read(frames_).target_period_mm);
  EXPECT_EQ(Read(frames_ + "target_period_mm: 5.0\n").target_period_mm.value(), 5);
  EXPECT_THAT(ErrorWith(frames_ + "target_period_mm: 0\n"),
              HasSubstr("s.yaml:4:19: target_period_mm: must be > 0"));
  EXPECT_THAT(ErrorWith(frames_ + "target_period_px: 5\n"),
              HasSubstr("this field is 'target_period_mm'"));
}

TEST_F(SweepFolder, RoiDirectionTarget) {
  const SweepFile sweep = Read(
      frames_ +
      "roi_px: [1, 2, 30, 40]\ndirection: toward\ntarget: knife-edge\nreading_sigma_mm: 0.05\n");
  EXPECT_EQ(sweep.roi.x, 1);
  EXPECT_EQ(sweep.roi.y, 2);
  EXPECT_EQ(sweep.roi.width, 30);
  EXPECT_EQ(sweep.roi.height, 40);
  EXPECT_EQ(sweep.direction, BenchDirection::kToward);
  EXPECT_EQ(DirectionSign(sweep.direction), -1);
  EXPECT_EQ(DirectionSign(BenchDirection::kAway), 1);
  EXPECT_EQ(sweep.target, SweepTarget::kKnifeEdge);
  EXPECT_EQ(sweep.reading_sigma_mm, 0.05);
  EXPECT_THAT(notices_, IsEmpty());
  EXPECT_THAT(ErrorWith(frames_ + "roi_px: [1, 2, 0, 40]\n"), HasSubstr("roi_px[2]"));
  EXPECT_THAT(ErrorWith(frames_ + "roi_px: [-1, 2, 3, 40]\n"), HasSubstr("roi_px[0]"));
  EXPECT_THAT(ErrorWith(frames_ + "roi_px: [1, 2, 3]\n"), HasSubstr("a list of 4"));
  EXPECT_THAT(ErrorWith(frames_ + "direction: left\n"), HasSubstr("away, toward"));
  EXPECT_THAT(ErrorWith(frames_ + "target: edge\n"), HasSubstr("printed-edge"));
  EXPECT_THAT(ErrorWith(frames_ + "reading_sigma_mm: -1\n"), HasSubstr("must be >= 0"));
  for (const char* name : {"auto", "texture", "printed-edge", "knife-edge", "points"})
    EXPECT_EQ(SweepTargetName(Read(frames_ + "target: " + name + "\n").target), name);
}

TEST_F(SweepFolder, OrderAndRepeatsAreReported) {
  ReadTable("a.png,1\nb.png,3\nc.png,2\n", "reading_sigma_mm: 1\n");
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("not in order")));
  ReadTable("a.png,3\nb.png,2\nc.png,2\n", "reading_sigma_mm: 1\n");
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("1 frames have the same reading")));
}

TEST_F(SweepFolder, FullScaleIsAValueOfTheContainer) {
  EXPECT_FALSE(Read(frames_).full_scale);
  SweepFile sweep = Read(frames_ + "full_scale: 1023\n");
  EXPECT_EQ(sweep.full_scale, 1023);
  EXPECT_THAT(SweepToYaml(sweep), HasSubstr("full_scale: 1023\n"));
  EXPECT_THAT(ErrorWith(frames_ + "full_scale: 0\n"), HasSubstr("full_scale"));
  EXPECT_THAT(ErrorWith(frames_ + "full_scale: 65536\n"), HasSubstr("full_scale"));
  EXPECT_THAT(ErrorWith(frames_ + "full_scale: white\n"), HasSubstr("full_scale"));
  EXPECT_EQ(sweep.raw, SweepRaw::kDemosaiced);
  EXPECT_THAT(SweepToYaml(sweep), Not(HasSubstr("raw:")));
  sweep = Read(frames_ + "raw: green\n");
  EXPECT_EQ(sweep.raw, SweepRaw::kGreen);
  EXPECT_THAT(SweepToYaml(sweep), HasSubstr("raw: green\n"));
  EXPECT_THAT(ErrorWith(frames_ + "raw: red\n"), HasSubstr("raw"));
  EXPECT_TRUE(sweep.correction.IsEmpty());
  sweep = Read(frames_ + "dark: [d0.png, /d1.png]\nflat: w.tif\ndefects: bad.txt\n");
  EXPECT_THAT(sweep.correction.dark, ElementsAre(EndsWith("/d0.png"), "/d1.png"));
  EXPECT_THAT(sweep.correction.flat, ElementsAre(EndsWith("/w.tif")));
  EXPECT_THAT(sweep.correction.defects, ElementsAre(EndsWith("/bad.txt")));
  const std::string yaml = SweepToYaml(sweep);
  EXPECT_THAT(yaml, HasSubstr("/d0.png, /d1.png]\n"));
  EXPECT_THAT(ErrorWith(frames_ + "dark: []\n"), HasSubstr("dark: one file or more"));
  EXPECT_THAT(ErrorWith(frames_ + "flat: {a: b}\n"), HasSubstr("flat"));
}

TEST_F(SweepFolder, YamlComesBack) {
  folder_.Put("q/[1], {2}: #3.png");
  SweepFile sweep =
      Read(frames_ +
           "roi_px: [1, 2, 30, 40]\ndirection: toward\ntarget: texture\nreading_sigma_mm: 0.1\n");
  sweep.offset_mm = Estimate{1.0 / 3, 1e-300};
  sweep.target_period_mm = 5.0 / 3;
  sweep.camera_path = "cam: 1.yaml";
  sweep.frames = {{"a.png", 1.0 / 3}, {"q/[1], {2}: #3.png", -1e-17}};
  for (const int kind : {0, 1, 2}) {
    sweep.floor = {};
    if (kind == 1) sweep.floor.given_px = Estimate{0.1, 0.01};
    if (kind == 2) sweep.floor.from_px = 0.1;
    if (kind == 2) sweep.floor.to_px = 1.0 / 3;
    const std::string text = SweepToYaml(sweep);
    folder_.Put("back.yaml", text);
    const SweepFile back = ReadSweep(folder_ / "back.yaml", nullptr);
    EXPECT_EQ(back.camera_path, folder_ / "cam: 1.yaml");
    EXPECT_EQ(back.offset_mm.value().value, 1.0 / 3);
    EXPECT_EQ(back.offset_mm.value().sigma, 1e-300);
    EXPECT_EQ(back.direction, BenchDirection::kToward);
    EXPECT_EQ(back.target, SweepTarget::kTexture);
    EXPECT_EQ(back.target_period_mm, sweep.target_period_mm);
    EXPECT_EQ(back.roi.height, 40);
    EXPECT_TRUE(back.reading_sigma_stated);
    EXPECT_EQ(back.floor.given_px.has_value(), kind == 1);
    EXPECT_EQ(back.floor.to_px, sweep.floor.to_px);
    ASSERT_THAT(back.frames, SizeIs(2));
    EXPECT_EQ(back.frames[1].image, folder_ / "q/[1], {2}: #3.png");
    EXPECT_EQ(back.frames[1].reading_mm, -1e-17);
  }
}

TEST(SweepTruth, ComesBackWithTheSameBits) {
  SweepTruth truth;
  truth.image_distance_mm = 47.0 / 3;
  truth.focus_depth_mm = 1e3 / 3;
  truth.blur_ratio = 0.45;
  truth.blur_floor_px = 0.1;
  truth.bench_offset_mm = -0.0;
  truth.frames = {{"frames/a, b: c.png", 1.0 / 3, -1e29, 5e-324}, {"b", 2, 3, 4}};
  const TemporaryFolder folder;
  const std::string file = folder.Put("t.yaml", SweepTruthToYaml(truth));
  const SweepTruth back = ReadSweepTruth(file);
  const auto same = [](double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; };
  EXPECT_TRUE(same(back.image_distance_mm, truth.image_distance_mm));
  EXPECT_TRUE(same(back.focus_depth_mm, truth.focus_depth_mm));
  EXPECT_TRUE(same(back.blur_ratio, truth.blur_ratio));
  EXPECT_TRUE(same(back.blur_floor_px, truth.blur_floor_px));
  EXPECT_TRUE(same(back.bench_offset_mm, truth.bench_offset_mm));
  ASSERT_THAT(back.frames, SizeIs(2));
  EXPECT_EQ(back.frames[0].image, truth.frames[0].image);
  EXPECT_TRUE(same(back.frames[0].depth_mm, truth.frames[0].depth_mm));
  EXPECT_TRUE(same(back.frames[0].reading_mm, truth.frames[0].reading_mm));
  EXPECT_TRUE(same(back.frames[0].blur_sigma_px, truth.frames[0].blur_sigma_px));
  folder.Put("t.yaml", SweepTruthToYaml(truth) + "more: 1\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweepTruth(file); }), HasSubstr("unknown key 'more'"));
}

// zf of grey follows from that of the colours, for those who compare results with the file.
TEST(SweepTruth, SaysWhereGreyIsInFocus) {
  SweepTruth truth;
  truth.image_distance_mm = 60;
  truth.focus_depth_mm = 300;
  truth.frames = {{"a", 1, 2, 3}};
  EXPECT_THAT(SweepTruthToYaml(truth), Not(HasSubstr("grey_focus_depth_mm")));
  truth.aberrations.axial_colour_mm.emplace(2, 0, -1);
  const std::string text = SweepTruthToYaml(truth);
  const TemporaryFolder folder;
  const std::string file = folder.Put("t.yaml", text);
  const YamlNode written = YamlNode::LoadFile(file);
  EXPECT_EQ(written.At("focus_depth_mm").Number(), 300);
  EXPECT_NEAR(written.At("grey_focus_depth_mm").Number(),
              1 / (0.2126 / 302 + 0.7152 / 300 + 0.0722 / 299), 1e-9);
  const SweepTruth back = ReadSweepTruth(file);
  EXPECT_EQ(back.aberrations.axial_colour_mm, truth.aberrations.axial_colour_mm);
}

// The examples of docs/file-formats.md, as a user would copy them.
TEST(FileFormatsPage, ExamplesAreRead) {
  const std::string page = ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/docs/file-formats.md");
  const auto example = [&](const std::string& schema) {
    const std::string fence = "```yaml\n";
    const std::size_t begin = page.find(fence + "schema: " + schema) + fence.size();
    return page.substr(begin, page.find("```", begin) - begin);
  };
  const TemporaryFolder folder;
  EXPECT_EQ(ParseCamera(example("thicklens/camera/2"), "page").name, "bench-camera");
  const Camera microscope = ParseCamera(example("thicklens/camera/2\nname: microscope"), "page");
  EXPECT_EQ(microscope.objective.value().magnification, 10);
  EXPECT_EQ(microscope.statements.at("lens.magnification").tolerance, 0.2);

  folder.Put("bench/frames/1.png");
  folder.Put("bench/positions.csv", "1.png,400\n");
  const std::string sweep = folder.Put("bench/sweep.yaml", example("thicklens/sweep/1"));
  EXPECT_THAT(ReadSweep(sweep, nullptr).frames, SizeIs(1));

  const std::string macro =
      folder.Put("bench/macro.yaml", example("thicklens/sweep/1\ncamera: macro.yaml"));
  EXPECT_EQ(ReadSweep(macro, nullptr).magnification.value().value, 0.5);

  folder.Put("cameras/macro-bench.yaml",
             ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/macro-bench.yaml"));
  const std::string recipe = folder.Put("sweeps/s.yaml", example("thicklens/simulate-sweep/1"));
  EXPECT_EQ(ReadSweepSimulation(recipe).frame_count, 35);

  const SweepTruth truth = ReadSweepTruth(folder.Put("t.yaml", example("thicklens/sweep-truth/1")));
  EXPECT_EQ(truth.frames.at(0).depth_mm, 282.6);
}

}  // namespace
}  // namespace thicklens::model
