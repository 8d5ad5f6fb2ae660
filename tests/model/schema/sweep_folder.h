#ifndef THICKLENS_TESTS_MODEL_SCHEMA_SWEEP_FOLDER_H_
#define THICKLENS_TESTS_MODEL_SCHEMA_SWEEP_FOLDER_H_

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::testing {

inline constexpr char kSweepHead[] = "schema: thicklens/sweep/1\ncamera: cam/c.yaml\n";

// A folder with a sweep file, a table and three frames.
class SweepFolder : public ::testing::Test {
 protected:
  SweepFolder() {
    for (const char* name : {"a.png", "b.png", "c.png"}) folder_.Put(name);
  }

  model::SweepFile Read(const std::string& rest) {
    folder_.Put("s.yaml", kSweepHead + rest);
    notices_.clear();
    return model::ReadSweep(folder_ / "s.yaml", &notices_);
  }
  std::string ErrorWith(const std::string& rest) {
    return ErrorOf([&] { Read(rest); });
  }
  model::SweepFile ReadTable(const std::string& table, const std::string& rest = "") {
    folder_.Put("r.csv", table);
    return Read("frames_csv: r.csv\n" + rest);
  }
  std::string ErrorOfTable(const std::string& table, const std::string& rest = "") {
    return ErrorOf([&] { ReadTable(table, rest); });
  }
  void ExpectThreeFrames(const std::string& table) {
    SCOPED_TRACE(table);
    const model::SweepFile sweep = ReadTable(table);
    ASSERT_EQ(sweep.frames.size(), 3U);
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

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_MODEL_SCHEMA_SWEEP_FOLDER_H_
