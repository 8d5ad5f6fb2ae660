// The images of a sweep and their readings: tables, folders and lists.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/model/schema/sweep_folder.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::kSweepHead;
using ::thicklens::testing::SweepFolder;

TEST_F(SweepFolder, TablesOfEveryMake) {
  ExpectThreeFrames("file,reading\na.png,400\nb.png,401.5\nc.png,-3\n");
  ExpectThreeFrames("a.png,400\nb.png,401.5\nc.png,-3\n");
  ExpectThreeFrames("a.png,400\nb.png,401.5\nc.png,-3");
  ExpectThreeFrames("file;reading\na.png;400\nb.png;401.5\nc.png;-3\n");
  ExpectThreeFrames("file\treading\na.png\t400\nb.png\t401.5\nc.png\t-3\n");
  ExpectThreeFrames("Datei;Position\na.png;400\nb.png;401,5\nc.png;-3\n");
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
  EXPECT_THAT(ErrorOfTable("a.png,1\nb.png,401,5\n"),
              AllOf(StartsWith(csv + ":2: "), HasSubstr("401,5 with a decimal comma")));
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
  EXPECT_THAT(ErrorOfTable(""), HasSubstr("no row has"));
  EXPECT_THAT(ErrorOfTable("file,reading\n"), HasSubstr("no row has"));
  EXPECT_THAT(ErrorWith("frames_csv: none.csv\n"), HasSubstr("none.csv"));
}

TEST_F(SweepFolder, FilesWithoutARowAreNamed) {
  EXPECT_THAT(ErrorOfTable("b.png,1\n"),
              AllOf(HasSubstr("a.png"), HasSubstr("no row"), HasSubstr("2 such")));
  // Hidden files and files that are not images are ignored.
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
  // Without frames_dir, names refer to the table's folder, or to the folders in it.
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
              HasSubstr("the folder does not exist"));
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
  folder_.Put("odd [1]/s.yaml",
              std::string(kSweepHead) +
                  "frames_csv: r.csv\nframes_glob: raw/x*.png\nreading_sigma_mm: 0\n");
  const SweepFile sweep = ReadSweep(folder_ / "odd [1]/s.yaml", &notices_);
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_EQ(sweep.frames[1].image, folder_ / "odd [1]/raw/x2.png");
  EXPECT_THAT(notices_, IsEmpty());
  folder_.Put("r.csv", "a.png,1\n");
  EXPECT_THAT(ErrorWith("frames_csv: r.csv\nframes_glob: '*.webp'\n"),
              AllOf(HasSubstr("s.yaml:4:14: frames_glob"), HasSubstr("no file matches '*.webp'")));
}

TEST_F(SweepFolder, GlobIsRelativeToFramesDir) {
  folder_.Put("raw/x1.png");
  folder_.Put("raw/x2.png");
  folder_.Put("raw/dark.png");
  folder_.Put("r.csv", "x1.png,1\nx2.png,2\n");
  const SweepFile sweep =
      Read("frames_csv: r.csv\nframes_dir: raw\nframes_glob: x*.png\nreading_sigma_mm: 0\n");
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_EQ(sweep.frames[1].image, folder_ / "raw/x2.png");
  EXPECT_THAT(notices_, IsEmpty());
  // Relative to the sweep's file, as before, if nothing in frames_dir matches.
  Read("frames_csv: r.csv\nframes_dir: raw\nframes_glob: raw/x*.png\nreading_sigma_mm: 0\n");
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("frames_glob")));
}

TEST_F(SweepFolder, PathsOfATable) {
  const std::string sigma = "reading_sigma_mm: 0\n";
  // Absolute paths that name the files of the folder, also through a link.
  const auto rows = [](const std::string& before) {
    return before + "a.png,400\n" + before + "b.png,401.5\n" + before + "c.png,-3\n";
  };
  ExpectThreeFrames(rows(folder_.path() + "/"));
  fs::create_directory_symlink(folder_.path(), folder_ / "link");
  ExpectThreeFrames(rows(folder_ / "link/"));
  ExpectThreeFrames(rows("./"));
  ExpectThreeFrames(rows("../" + fs::path(folder_.path()).filename().string() + "/"));
  const auto in_order = [](const std::string& before) {
    return before + "a.png,1\n" + before + "b.png,2\n" + before + "c.png,3\n";
  };
  ReadTable(in_order(folder_.path() + "/"), sigma);
  EXPECT_THAT(notices_, IsEmpty());
  // Names without their ending, and paths of another computer, which are reported.
  ReadTable("a,1\nb,2\nc,3\n", sigma);
  EXPECT_THAT(notices_, IsEmpty());
  for (const char* other : {"C:\\sweep\\", "/nowhere/sweep/", "raw/"}) {
    ExpectThreeFrames(rows(other));
    ReadTable(in_order(other), sigma);
    EXPECT_THAT(notices_, ElementsAre(AllOf(HasSubstr("r.csv:1: "), HasSubstr("2 more rows"))));
  }
  // Names on the disk in the encoding of the table, and in UTF-8.
  folder_.Put("latin/m\xFCnze.png");
  folder_.Put("latin/caf\xC3\xA9.png");
  folder_.Put("latin/r.csv", "m\xFCnze.png,1\ncaf\xE9.png,2\n");
  EXPECT_EQ(Read("frames_csv: latin/r.csv\n").frames.at(0).image, folder_ / "latin/m\xFCnze.png");
  EXPECT_EQ(Read("frames_csv: latin/r.csv\n").frames.at(1).image,
            folder_ / "latin/caf\xC3\xA9.png");
  // The table's folder comes before frames_dir.
  folder_.Put("bench/frames/x.png");
  folder_.Put("bench/r.csv", "frames/x.png,2\n");
  EXPECT_EQ(Read("frames_csv: bench/r.csv\nframes_dir: bench/frames\n").frames.at(0).image,
            folder_ / "bench/frames/x.png");
  EXPECT_THAT(
      ErrorOfTable(rows(folder_.path() + "/") + "link/a.png,5\n"),
      AllOf(HasSubstr("r.csv:4: "), HasSubstr("already has a reading"), HasSubstr("r.csv:1")));
}

TEST_F(SweepFolder, FieldsThatSelectTheColumns) {
  const std::string table = "file,where,elsewhere\na.png,1,400000\nb.png,2,401500\nc.png,3,-3000\n";
  EXPECT_THAT(ErrorOfTable(table),
              AllOf(HasSubstr("r.csv:1: "), HasSubstr("column 2 'where', column 3 'elsewhere'"),
                    HasSubstr("--column")));
  const SweepFile sweep = ReadTable(table, "readings_column: elsewhere\nreadings_unit: um\n");
  EXPECT_EQ(sweep.frames.at(1).reading_mm, 401.5);
  EXPECT_EQ(sweep.readings,
            "column 3 'elsewhere' of r.csv, um, 3 rows; files from column 1 'file'");
  EXPECT_EQ(ReadTable(table,
                      "readings_column: 2\nreadings_file_column: file\n"
                      "readings_unit: steps\nreadings_scale_mm: 0.25\n")
                .frames.at(1)
                .reading_mm,
            0.5);
  // The options of a caller replace the fields.
  SweepReading reading;
  reading.readings.column = "where";
  reading.readings.unit = "mm";
  EXPECT_EQ(ReadSweep(folder_ / "s.yaml", reading, nullptr).frames.at(1).reading_mm, 2);
  EXPECT_THAT(ErrorOfTable(table, "readings_scale_mm: 0\nreadings_column: 2\n"),
              HasSubstr("other than 0"));
  EXPECT_THAT(ErrorWith(frames_ + "readings_column: z\n"),
              AllOf(HasSubstr("s.yaml:4:"), HasSubstr("applies only to 'frames_csv'")));
  Read(frames_);
  EXPECT_THAT(ErrorOf([&] { ReadSweep(folder_ / "s.yaml", reading, nullptr); }),
              AllOf(HasSubstr("s.yaml:3:"), HasSubstr("--column")));
}

TEST_F(SweepFolder, NamesWithOtherCapitalsAndWithoutEndings) {
  folder_.Put("k/FRAME_0.PNG");
  folder_.Put("k/Frame_1.png");
  folder_.Put("k.csv", "file,z\nframe_0.png,1\nframe_1,2\n");
  const SweepFile sweep = Read("frames_dir: k\nframes_csv: k.csv\n");
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_EQ(sweep.frames[0].image, folder_ / "k/FRAME_0.PNG");
  EXPECT_EQ(sweep.frames[1].image, folder_ / "k/Frame_1.png");
  EXPECT_THAT(notices_, Contains(HasSubstr("of the same name with other capitals")));
  folder_.Put("k/FRAME_1.png");
  EXPECT_THAT(ErrorWith("frames_dir: k\nframes_csv: k.csv\n"),
              AllOf(HasSubstr("'frame_1' may be"), HasSubstr("capitals")));
  // A camera that saves each photograph twice.
  folder_.Put("p/a.CR2");
  folder_.Put("p/a.JPG");
  folder_.Put("p.csv", "file,z\na,1\n");
  EXPECT_THAT(ErrorWith("frames_dir: p\nframes_csv: p.csv\n"),
              AllOf(HasSubstr("write its ending, too")));
  folder_.Put("p.csv", "frame,z\n0,1\n");
  EXPECT_THAT(ErrorWith("frames_dir: p\nframes_csv: p.csv\n"),
              AllOf(HasSubstr("'0' names no file"), HasSubstr("numbers of frames")));
}

TEST_F(SweepFolder, ReadingsFromTheNames) {
  folder_.Put("n/z-10um.png");
  folder_.Put("n/z10um.png");
  folder_.Put("n/z0um.png");
  folder_.Put("n/z2.5um.png");
  const SweepFile sweep = Read("frames_dir: n\nreadings_from_name: 'z{reading}um'\n");
  ASSERT_THAT(sweep.frames, SizeIs(4));
  EXPECT_EQ(sweep.frames[0].reading_mm, -0.01);
  EXPECT_EQ(sweep.frames[2].reading_mm, 0.0025);
  EXPECT_EQ(sweep.frames[3].image, folder_ / "n/z10um.png");  // in the order of the readings
  EXPECT_THAT(sweep.readings, HasSubstr("um"));
  EXPECT_THAT(ErrorWith("frames_dir: n\nreadings_from_name: 'z{reading}mm'\n"),
              AllOf(HasSubstr("n/z-10um.png"), HasSubstr("does not contain")));
  EXPECT_THAT(ErrorWith("frames_dir: n\nreadings_from_name: z\n"), HasSubstr("{reading}"));
  EXPECT_THAT(ErrorWith("frames_dir: n\nreadings_from: exif\n"), HasSubstr("thicklens::io"));
  EXPECT_THAT(ErrorWith("frames_csv: r.csv\nreadings_from: exif\n"), HasSubstr("either 'frames'"));
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
  EXPECT_THAT(ErrorWith("frames: []\n"), HasSubstr("s.yaml:3:9: frames: at least one frame"));
  EXPECT_THAT(ErrorWith(""), HasSubstr("either 'frames'"));
  EXPECT_THAT(ErrorWith(frames_ + "frames_csv: r.csv\n"), HasSubstr("either 'frames'"));
  EXPECT_THAT(ErrorWith(frames_ + "frames_dir: x\n"), HasSubstr("applies only to 'frames_csv'"));
  EXPECT_THAT(ErrorWith(frames_ + "frames_glob: x\n"), HasSubstr("applies only to 'frames_csv'"));
  EXPECT_THAT(ErrorWith(frames_ + "offset_cm: 3\n"), HasSubstr("this field is 'offset_mm'"));
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
              HasSubstr("the folder does not exist"));
}

}  // namespace
}  // namespace thicklens::model
