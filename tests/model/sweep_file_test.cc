#include "thicklens/model/sweep_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_simulator.h"
#include "thicklens/model/yaml_reader.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::thicklens::testing::ContentOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

constexpr char kHead[] = "schema: thicklens/sweep/1\ncamera: cam/c.yaml\n";

// A folder with a sweep file, a table and three frames.
class SweepFolder : public ::testing::Test {
 protected:
  SweepFolder() {
    for (const char* name : {"a.png", "b.png", "c.png"}) folder_.Put(name);
  }

  SweepFile Read(const std::string& rest) {
    folder_.Put("s.yaml", kHead + rest);
    notices_.clear();
    return ReadSweep(folder_ / "s.yaml", &notices_);
  }
  std::string ErrorWith(const std::string& rest) {
    return ErrorOf([&] { Read(rest); });
  }
  SweepFile ReadTable(const std::string& table, const std::string& rest = "") {
    folder_.Put("r.csv", table);
    return Read("frames_csv: r.csv\n" + rest);
  }
  std::string ErrorOfTable(const std::string& table) {
    return ErrorOf([&] { ReadTable(table); });
  }
  void ExpectThreeFrames(const std::string& table) {
    SCOPED_TRACE(table);
    const SweepFile sweep = ReadTable(table);
    ASSERT_THAT(sweep.frames, SizeIs(3));
    EXPECT_EQ(sweep.frames[0].image, folder_ / "a.png");
    EXPECT_EQ(sweep.frames[0].reading_mm, 400);
    EXPECT_EQ(sweep.frames[1].image, folder_ / "b.png");
    EXPECT_EQ(sweep.frames[1].reading_mm, 401.5);
    EXPECT_EQ(sweep.frames[2].reading_mm, -3);
  }

  TemporaryFolder folder_;
  std::vector<std::string> notices_;
  const std::string frames_ = "frames: [{image: a.png, reading_mm: 1}]\n";
};

TEST_F(SweepFolder, TablesOfEveryMake) {
  ExpectThreeFrames("file,reading\na.png,400\nb.png,401.5\nc.png,-3\n");
  ExpectThreeFrames("a.png,400\nb.png,401.5\nc.png,-3\n");
  ExpectThreeFrames("a.png,400\nb.png,401.5\nc.png,-3");
  ExpectThreeFrames("file;reading\na.png;400\nb.png;401.5\nc.png;-3\n");
  ExpectThreeFrames("file\treading\na.png\t400\nb.png\t401.5\nc.png\t-3\n");
  ExpectThreeFrames("file,reading\r\na.png,400\r\nb.png,401.5\r\nc.png,-3\r\n");
  ExpectThreeFrames(
      "\xEF\xBB\xBF"
      "a.png,400\nb.png,401.5\nc.png,-3\n");
  ExpectThreeFrames("\"file\",\"reading\"\n\"a.png\",\"400\"\n\"b.png\",401.5\nc.png,-3\n");
  ExpectThreeFrames("a.png, +400 \n  b.png , 4.015e2\n\n\nc.png,-3,more,columns\n\n");
}

TEST_F(SweepFolder, NamesWithQuotesCommasAndLineBreaks) {
  folder_.Put("x, \"y\".png");
  const SweepFile sweep = ReadTable("a.png,1\nb.png,2\nc.png,3\n\"x, \"\"y\"\".png\",4\n");
  ASSERT_THAT(sweep.frames, SizeIs(4));
  EXPECT_EQ(sweep.frames[3].image, folder_ / "x, \"y\".png");
}

TEST_F(SweepFolder, TableErrorsNameTheLine) {
  const std::string csv = folder_ / "r.csv";
  EXPECT_THAT(ErrorOfTable("file,reading\na.png,1\nb.png,two\n"),
              AllOf(StartsWith(csv + ":3: "), HasSubstr("'two'")));
  EXPECT_THAT(ErrorOfTable("file,reading\r\na.png,1\r\nb.png,two"), StartsWith(csv + ":3: "));
  EXPECT_THAT(ErrorOfTable("a.png,1\n\n\nb.png,4 mm\n"),
              AllOf(StartsWith(csv + ":4: "), HasSubstr("'4 mm'")));
  EXPECT_THAT(ErrorOfTable("a.png;1\nb.png;401,5\n"), HasSubstr("'401,5'"));
  EXPECT_THAT(ErrorOfTable("a.png,1\nb.png,nan\n"), StartsWith(csv + ":2: "));
  EXPECT_THAT(ErrorOfTable("a.png,1\nb.png,+-2\n"), StartsWith(csv + ":2: "));
  EXPECT_THAT(ErrorOfTable("a.png,1\nb.png\n"),
              AllOf(StartsWith(csv + ":2: "), HasSubstr("two columns")));
  EXPECT_THAT(ErrorOfTable("a.png,1\n,2\n"), AllOf(StartsWith(csv + ":2: "), HasSubstr("missing")));
  EXPECT_THAT(ErrorOfTable("a.png,1\nb.png,2\na.png,3\n"),
              AllOf(StartsWith(csv + ":3: "), HasSubstr("'a.png'"), HasSubstr("line 1")));
  EXPECT_THAT(ErrorOfTable("a.png,1\n./a.png,3\n"),
              AllOf(StartsWith(csv + ":2: "), HasSubstr("already")));
  EXPECT_THAT(ErrorOfTable("a.png,1\nnone.png,2\n"),
              AllOf(StartsWith(csv + ":2: "), HasSubstr("'none.png' is not in")));
  EXPECT_THAT(ErrorOfTable("a.png,1\n\"b.png,2\n"),
              AllOf(StartsWith(csv + ":2: "), HasSubstr("CSV")));
  EXPECT_THAT(ErrorOfTable("a.png,1\nb\"b.png,2\nc.png,3\n"),
              AllOf(StartsWith(csv + ":2: "), HasSubstr("CSV")));
  EXPECT_THAT(ErrorOfTable(""), HasSubstr("no rows"));
  EXPECT_THAT(ErrorOfTable("file,reading\n"), HasSubstr("no rows"));
  EXPECT_THAT(ErrorWith("frames_csv: none.csv\n"), HasSubstr("none.csv"));
}

TEST_F(SweepFolder, FilesWithoutARowAreNamed) {
  EXPECT_THAT(ErrorOfTable("b.png,1\n"),
              AllOf(HasSubstr("a.png"), HasSubstr("no row"), HasSubstr("2 such")));
  // Neither hidden files nor files that are no pictures.
  folder_.Put("._a.png");
  folder_.Put("notes.txt");
  ReadTable("a.png,1\nb.png,2\nc.png,3\n", "reading_sigma_mm: 0\n");
  EXPECT_THAT(notices_, IsEmpty());
}

TEST_F(SweepFolder, TableInAnotherFolderAndUnits) {
  folder_.Put("bench/frames/x.JPG");
  folder_.Put("bench/r.csv", "x.JPG,2\n");
  const SweepFile sweep =
      Read("frames_csv: bench/r.csv\nframes_dir: bench/frames\nreadings_unit: in\n");
  ASSERT_THAT(sweep.frames, SizeIs(1));
  EXPECT_EQ(sweep.frames[0].image, folder_ / "bench/frames/x.JPG");
  EXPECT_EQ(sweep.frames[0].reading_mm, 50.8);
  // Without frames_dir: the table's folder, or the folders in it.
  EXPECT_EQ(Read("frames_csv: bench/r.csv\n").frames.at(0).image, folder_ / "bench/frames/x.JPG");

  const std::vector<std::pair<std::string, double>> units = {
      {"mm", 2}, {"um", 0.002}, {"cm", 20}, {"m", 2000}, {"in", 50.8}};
  for (const auto& [unit, reading_mm] : units) {
    EXPECT_EQ(
        Read("frames_csv: bench/r.csv\nreadings_unit: " + unit + "\n").frames.at(0).reading_mm,
        reading_mm);
  }
  EXPECT_THAT(ErrorWith("frames_csv: bench/r.csv\nreadings_unit: feet\n"),
              AllOf(HasSubstr("s.yaml:4:16: readings_unit"), HasSubstr("'feet'")));
  EXPECT_THAT(ErrorWith("readings_unit: cm\n" + frames_), HasSubstr("reading_mm"));
  EXPECT_THAT(ErrorWith("frames_csv: bench/r.csv\nframes_dir: none\n"),
              HasSubstr("no such folder"));
}

TEST_F(SweepFolder, SameNameInTwoFoldersIsAskedBack) {
  folder_.Put("bench/one/x.png");
  folder_.Put("bench/two/x.png");
  folder_.Put("bench/r.csv", "x.png,2\n");
  EXPECT_THAT(ErrorWith("frames_csv: bench/r.csv\n"),
              AllOf(HasSubstr("r.csv:1: "), HasSubstr("one/x.png"), HasSubstr("two/x.png")));
  folder_.Put("bench/r.csv", "two/x.png,2\none/x.png,3\n");
  EXPECT_EQ(Read("frames_csv: bench/r.csv\n").frames.at(0).image, folder_ / "bench/two/x.png");
}

TEST_F(SweepFolder, GlobChoosesTheFiles) {
  folder_.Put("odd [1]/raw/x1.png");
  folder_.Put("odd [1]/raw/x2.png");
  folder_.Put("odd [1]/raw/dark.png");
  folder_.Put("odd [1]/r.csv", "x1.png,1\nx2.png,2\n");
  folder_.Put(
      "odd [1]/s.yaml",
      std::string(kHead) + "frames_csv: r.csv\nframes_glob: raw/x*.png\nreading_sigma_mm: 0\n");
  const SweepFile sweep = ReadSweep(folder_ / "odd [1]/s.yaml", &notices_);
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_EQ(sweep.frames[1].image, folder_ / "odd [1]/raw/x2.png");
  EXPECT_THAT(notices_, IsEmpty());
  folder_.Put("r.csv", "a.png,1\n");
  EXPECT_THAT(ErrorWith("frames_csv: r.csv\nframes_glob: '*.webp'\n"),
              AllOf(HasSubstr("s.yaml:4:14: frames_glob"), HasSubstr("no file matches '*.webp'")));
}

TEST_F(SweepFolder, ListOfFrames) {
  const SweepFile sweep =
      Read("frames:\n- {image: b.png, reading_mm: 412.0}\n- {image: ./a.png, reading_mm: -1}\n");
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_EQ(sweep.frames[0].image, folder_ / "b.png");
  EXPECT_EQ(sweep.frames[0].reading_mm, 412);
  EXPECT_EQ(sweep.frames[1].image, folder_ / "a.png");
  EXPECT_EQ(sweep.camera_path, folder_ / "cam/c.yaml");
  EXPECT_EQ(sweep.source, folder_ / "s.yaml");

  EXPECT_THAT(ErrorWith("frames:\n- {image: none.png, reading_mm: 1}\n"),
              AllOf(HasSubstr("s.yaml:4:11: frames[0].image"), HasSubstr("does not exist")));
  EXPECT_THAT(
      ErrorWith("frames:\n- {image: a.png, reading_mm: 1}\n- {image: ./a.png, reading_mm: 2}\n"),
      AllOf(HasSubstr("s.yaml:5:11: frames[1].image"), HasSubstr("twice")));
  EXPECT_THAT(ErrorWith("frames: [{image: a.png, reading_cm: 1}]\n"), HasSubstr("wrong unit"));
  EXPECT_THAT(ErrorWith("frames: [{image: a.png}]\n"), HasSubstr("'reading_mm' is missing"));
  EXPECT_THAT(ErrorWith("frames: [{image: a.png, reading_mm: nan}]\n"), HasSubstr("finite"));
  EXPECT_THAT(ErrorWith("frames: []\n"), HasSubstr("s.yaml:3:9: frames: a frame at least"));
  EXPECT_THAT(ErrorWith(""), HasSubstr("either 'frames'"));
  EXPECT_THAT(ErrorWith(frames_ + "frames_csv: r.csv\n"), HasSubstr("either 'frames'"));
  EXPECT_THAT(ErrorWith(frames_ + "frames_dir: x\n"), HasSubstr("goes with 'frames_csv'"));
  EXPECT_THAT(ErrorWith(frames_ + "frames_glob: x\n"), HasSubstr("goes with 'frames_csv'"));
  EXPECT_THAT(ErrorWith(frames_ + "offset_cm: 3\n"), HasSubstr("this field is 'offset_mm'"));
}

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
  EXPECT_THAT(error("{value: 1, from: 0, to: 2}"), HasSubstr("not a mixture"));
  EXPECT_THAT(error("{}"), HasSubstr("expected"));
  EXPECT_THAT(error("-1"), HasSubstr("must be >= 0, found -1"));
  EXPECT_THAT(error("[0, 1]"), HasSubstr("blur_floor_px"));
}

// A camera file with this lens, pitch and `calibration` (a flow map, or nothing).
std::string CameraText(double focal_mm, double radius_mm, double pitch_mm,
                       const std::string& calibration) {
  const std::string f = YamlNumber(focal_mm);
  return "schema: thicklens/camera/1\nname: edge\n"
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
      HasSubstr("not a mixture"));
  EXPECT_FALSE(Read(frames_ + "blur_floor_px: 0.5\n").floor_origin);
}

TEST_F(SweepFolder, AFloorThatWasNotMeasuredIsRefused) {
  const auto error = [&](const std::string& calibration) {
    folder_.Put("edge/camera.yaml", CameraText(50, 9, 0.005, calibration));
    return ErrorWith(frames_ + kFloorFromEdge);
  };
  const std::string place = "s.yaml:4:35: blur_floor_px.from_calibration: ";
  EXPECT_THAT(error(""),
              AllOf(HasSubstr(place), HasSubstr("edge/camera.yaml holds no calibration:")));
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
            HasSubstr("sensor.pixel_pitch_mm 0.005"), HasSubstr("'edge' of this sweep 0.006")));
  EXPECT_THAT(error(camera(35, 9, 0.005)),
              AllOf(HasSubstr("lens.front_focal_length_mm 50"), HasSubstr("this sweep 35:")));
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
  for (const char* name : {"auto", "texture", "printed-edge", "knife-edge"})
    EXPECT_EQ(SweepTargetName(Read(frames_ + "target: " + name + "\n").target), name);
}

TEST_F(SweepFolder, OrderAndRepeatsAreTold) {
  ReadTable("a.png,1\nb.png,3\nc.png,2\n", "reading_sigma_mm: 1\n");
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("not in order")));
  ReadTable("a.png,3\nb.png,2\nc.png,2\n", "reading_sigma_mm: 1\n");
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("1 frames share")));
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

TEST_F(SweepFolder, FromAFolderWithItsFramesBelow) {
  folder_.Put("picam/frames/XP005_Z-1X0Y0@1#1.jpg");
  folder_.Put("picam/frames/XP005_Z0X0Y0@1#1.jpg");
  const std::string csv = folder_.Put(
      "picam/positions.csv", "file,z_raw_mm\nXP005_Z0X0Y0@1#1.jpg,0\nXP005_Z-1X0Y0@1#1.jpg,-1\n");
  for (const char* name : {"picam", "picam/", "picam/frames"}) {
    notices_.clear();
    const SweepFile sweep = SweepFromFolder(folder_ / name, csv, "c.yaml", &notices_);
    ASSERT_THAT(sweep.frames, SizeIs(2)) << name;
    EXPECT_EQ(sweep.frames[1].image, folder_ / "picam/frames/XP005_Z-1X0Y0@1#1.jpg");
    EXPECT_EQ(sweep.frames[1].reading_mm, -1);
    EXPECT_EQ(sweep.camera_path, "c.yaml");
    EXPECT_THAT(notices_, ElementsAre(HasSubstr("reading_sigma_mm")));
  }
  EXPECT_THAT(ErrorOf([&] { SweepFromFolder(folder_ / "none", csv, "c.yaml", nullptr); }),
              HasSubstr("no such folder"));
}

TEST(SweepTruth, ComesBackWithTheSameBits) {
  SweepTruth truth;
  truth.image_distance_mm = 47.0 / 3;
  truth.focus_depth_mm = 1e3 / 3;
  truth.blur_ratio = 0.45;
  truth.blur_floor_px = 0.1;
  truth.bench_offset_mm = -0.0;
  truth.frames = {{"frames/a, b: c.png", 1.0 / 3, -1e300, 5e-324}, {"b", 2, 3, 4}};
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

// The examples of docs/file-formats.md, as a user would copy them.
TEST(FileFormatsPage, ExamplesAreRead) {
  const std::string page = ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/docs/file-formats.md");
  const auto example = [&](const std::string& schema) {
    const std::string fence = "```yaml\n";
    const std::size_t begin = page.find(fence + "schema: " + schema) + fence.size();
    return page.substr(begin, page.find("```", begin) - begin);
  };
  const TemporaryFolder folder;
  EXPECT_EQ(ParseCamera(example("thicklens/camera/1"), "page").name, "bench-camera");

  folder.Put("bench/frames/1.png");
  folder.Put("bench/positions.csv", "1.png,400\n");
  const std::string sweep = folder.Put("bench/sweep.yaml", example("thicklens/sweep/1"));
  EXPECT_THAT(ReadSweep(sweep, nullptr).frames, SizeIs(1));

  folder.Put("cameras/macro-bench.yaml",
             ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/macro-bench.yaml"));
  const std::string recipe = folder.Put("sweeps/s.yaml", example("thicklens/simulate-sweep/1"));
  EXPECT_EQ(ReadSweepSimulation(recipe).frame_count, 35);

  const SweepTruth truth = ReadSweepTruth(folder.Put("t.yaml", example("thicklens/sweep-truth/1")));
  EXPECT_EQ(truth.frames.at(0).depth_mm, 282.6);
}

}  // namespace
}  // namespace thicklens::model
