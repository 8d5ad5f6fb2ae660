// The pages of one file as frames of a sweep.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;

// Readings 10, 11, .. of rows with these names.
ReadingSet RowsOf(const std::vector<std::string>& names) {
  ReadingSet set;
  set.source = "t.csv";
  double reading_mm = 10;
  for (const std::string& name : names) {
    set.rows.push_back({name, reading_mm, "t.csv:" + std::to_string(set.rows.size() + 1) + ": "});
    reading_mm += 1;
  }
  return set;
}

std::vector<int> PagesOf(const std::vector<std::string>& names) {
  std::vector<int> pages;
  for (const SweepFrame& frame : SweepFromPages("a/s.tif", 3, RowsOf(names), "c", nullptr).frames)
    pages.push_back(frame.page.value_or(-1));
  return pages;
}

std::string Refusal(const std::vector<std::string>& names) {
  return ErrorOf([&] { PagesOf(names); });
}

TEST(SweepPages, RowsNameThemByIndexOrByNumber) {
  EXPECT_THAT(PagesOf({"s.tif[0]", "s.tif[1]", "s.tif[2]"}), ElementsAre(0, 1, 2));
  EXPECT_THAT(PagesOf({"other/s.tif[2]", "[0]", "s.tif[1]"}), ElementsAre(2, 0, 1));
  EXPECT_THAT(PagesOf({"0", "1", "2"}), ElementsAre(0, 1, 2));
  EXPECT_THAT(PagesOf({"3", "2", "1"}), ElementsAre(2, 1, 0)) << "no row is 0: counted from 1";
}

TEST(SweepPages, FramesHaveTheirReadingsAndNames) {
  const SweepFile sweep = SweepFromPages("a/s.tif", 2, RowsOf({"1", "0"}), "c.yaml", nullptr);
  ASSERT_EQ(sweep.frames.size(), 2U);
  EXPECT_EQ(sweep.frames[0].image, "a/s.tif");
  EXPECT_EQ(sweep.frames[0].Name(), "a/s.tif[1]");
  EXPECT_EQ(sweep.frames[0].reading_mm, 10);
  EXPECT_EQ(sweep.camera_path, "c.yaml");
  EXPECT_EQ(SweepFrame({"a.png", 3}).Name(), "a.png");
}

TEST(SweepPages, EveryRowAndEveryPageNeedsItsPartner) {
  EXPECT_THAT(Refusal({"s.tif"}),
              AllOf(HasSubstr("t.csv:1: s.tif has 3 pages, and 's.tif' is none"),
                    HasSubstr("'s.tif[0]' to 's.tif[2]'")));
  EXPECT_THAT(Refusal({"s.tif[0]", "s.tif[1]"}), HasSubstr("page 2 (counted from 0) has no row"));
  EXPECT_THAT(Refusal({"0", "1", "3"}),
              HasSubstr("t.csv:3: '3' is not a page of s.tif, which has 3"));
  EXPECT_THAT(Refusal({"0", "1", "1"}), HasSubstr("already has a reading, at t.csv:2"));
  EXPECT_THAT(Refusal({"r.tif[0]"}), HasSubstr("'r.tif[0]' is none of them"));
  EXPECT_THAT(Refusal({"s.tif[-1]"}), HasSubstr("is none of them"));
  EXPECT_THAT(Refusal({"s.tif[99999999999]"}), HasSubstr("is none of them"));
  EXPECT_THAT(Refusal({}), HasSubstr("page 0 (counted from 0) has no row"));
}

TEST(SweepPages, OfTheListInASweepsFile) {
  const TemporaryFolder folder;
  folder.Put("s.tif", "x");
  const auto read = [&](const std::string& frames) {
    return ReadSweep(
        folder.Put("sweep.yaml", "schema: thicklens/sweep/1\ncamera: c.yaml\nframes:\n" + frames),
        nullptr);
  };
  const SweepFile sweep = read(
      "  - {image: s.tif, page: 0, reading_mm: 1}\n  - {image: s.tif, page: 4, reading_mm: 2}\n");
  EXPECT_EQ(sweep.frames[1].page, 4);
  EXPECT_THAT(SweepToYaml(sweep), HasSubstr("page: 4"));
  EXPECT_THAT(ErrorOf([&] {
                read(
                    "  - {image: s.tif, page: 1, reading_mm: 1}\n"
                    "  - {image: s.tif, page: 1, reading_mm: 2}\n");
              }),
              HasSubstr("'s.tif', page 1 is listed twice"));
  EXPECT_THAT(ErrorOf([&] { read("  - {image: s.tif, page: -1, reading_mm: 1}\n"); }),
              AllOf(HasSubstr("page"), HasSubstr("-1")));
}

TEST(SweepPages, APhotographInTwoFilesIsOneFrame) {
  const TemporaryFolder folder;
  for (const char* name : {"a.cr2", "a.jpg", "b.cr2", "b.jpg"}) folder.Put(name, "x");
  std::vector<std::string> notices;
  const SweepFile sweep = SweepFromFolder(
      folder.path(), folder.Put("t.csv", "file,z_mm\na.cr2,1\nb.cr2,2\n"), "c", &notices);
  EXPECT_EQ(sweep.frames.size(), 2U);
  EXPECT_THAT(notices, ::testing::Contains(
                           AllOf(HasSubstr("a.jpg and 1 more"),
                                 HasSubstr("names the same photograph with another ending"))));
  SweepReading reading;
  reading.readings.name_pattern = "z{reading}";
  EXPECT_THAT(ErrorOf([&] { SweepFromFolder(folder.path(), "", "c", reading, nullptr); }),
              AllOf(HasSubstr("one photograph in two files"), HasSubstr("frames_glob ('*.jpg')")));
}

}  // namespace
}  // namespace thicklens::model
