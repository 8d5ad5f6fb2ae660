// Tables of readings by time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "support/error_message.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::DoubleEq;
using ::testing::DoubleNear;
using ::testing::HasSubstr;
using ::testing::Optional;
using ::testing::Pointwise;
using ::thicklens::testing::ErrorOf;

std::vector<double> TimesOf(const std::string& table, const ReadingOptions& options = {}) {
  std::vector<double> times;
  for (const TimedReading& row : TimedReadingsOfTable(table, "t.csv", options).rows)
    times.push_back(row.time_s);
  return times;
}

MATCHER(IsTime, "") { return std::abs(std::get<0>(arg) - std::get<1>(arg)) < 1e-6; }

TEST(TimedReadings, ColumnsOfTimesByTheirNames) {
  for (const std::string name : {"time", "time_s", "t", "t_s", "Time [s]", "timestamp", "Zeit (s)",
                                 "elapsed", "seconds", "s"}) {
    const std::string table = name + ",z_um\n0,100\n0.5,200\n";
    EXPECT_TRUE(HasTimes(table, "t.csv", {})) << name;
    const TimedReadingSet set = TimedReadingsOfTable(table, "t.csv", {});
    ASSERT_EQ(set.rows.size(), 2U) << name;
    EXPECT_DOUBLE_EQ(set.rows[1].time_s, 0.5) << name;
    EXPECT_DOUBLE_EQ(set.rows[1].reading_mm, 0.2) << name;
  }
  EXPECT_FALSE(HasTimes("frame,z_mm\n0,1\n1,2\n", "t.csv", {}));
  EXPECT_FALSE(HasTimes("0,1\n1,2\n", "t.csv", {})) << "whole numbers are frames";
  EXPECT_TRUE(HasTimes("0.0,1\n0.1,2\n", "t.csv", {}));
  EXPECT_TRUE(HasTimes("00:00:00,1\n00:00:01,2\n", "t.csv", {}));
}

TEST(TimedReadings, UnitsOfTime) {
  const std::vector<double> expected = {0, 0.25, 60};
  EXPECT_THAT(TimesOf("time_ms,z_mm\n0,1\n250,2\n60000,3\n"), Pointwise(IsTime(), expected));
  EXPECT_THAT(TimesOf("t [us];z_mm\n0;1\n250000;2\n60000000;3\n"), Pointwise(IsTime(), expected));
  EXPECT_THAT(TimesOf("time,z_mm\n0 ms,1\n250 ms,2\n1 min,3\n"), Pointwise(IsTime(), expected));
  EXPECT_THAT(TimesOf("time;z_mm\n0,0;1\n0,25;2\n60,0;3\n"), Pointwise(IsTime(), expected));
  EXPECT_THAT(TimesOf("time,z_mm\n00:00:00,1\n00:00:00.250,2\n01:00,3\n"),
              Pointwise(IsTime(), expected));
  ReadingOptions options;
  options.time_unit = "ms";
  EXPECT_THAT(TimesOf("time,z_mm\n0,1\n250,2\n60000,3\n", options), Pointwise(IsTime(), expected));
  EXPECT_FALSE(TimedReadingsOfTable("time,z_mm\n0,1\n9,2\n", "t.csv", {}).is_time_unit_stated);
  EXPECT_TRUE(TimedReadingsOfTable("time_s,z_mm\n0,1\n9,2\n", "t.csv", {}).is_time_unit_stated);
  EXPECT_THAT(TimedReadingsOfTable("time,z_mm\n0,1\n9,2\n", "t.csv", {}).description,
              AllOf(HasSubstr("times from column 1 'time'"), HasSubstr("no unit is stated")));
}

TEST(TimedReadings, ClocksAndDates) {
  EXPECT_THAT(SecondsOfTime("10:20:30.5"), Optional(DoubleEq(37230.5)));
  EXPECT_THAT(SecondsOfTime("20:30,5"), Optional(DoubleEq(1230.5)));
  EXPECT_THAT(SecondsOfTime("1.5"), Optional(DoubleEq(1.5)));
  EXPECT_THAT(SecondsOfTime("12 ms"), Optional(DoubleNear(0.012, 1e-12)));
  EXPECT_THAT(SecondsOfTime("1970-01-02T00:00:01Z"), Optional(DoubleEq(86401)));
  EXPECT_THAT(SecondsOfTime("2026-11-27 10:20:30+01:00"), Optional(DoubleEq(1795771230.0)));
  for (const std::string wrong : {"", "abc", "10:61:00", "10:20:60", "1:2:3:4", "-1:00",
                                  "2026-13-01T00:00:00", "5 mm", ":", "1:"}) {
    EXPECT_FALSE(SecondsOfTime(wrong)) << wrong;
  }
}

TEST(TimedReadings, OtherClocksAndDates) {
  EXPECT_THAT(SecondsOfTime("12:00:01 AM"), Optional(DoubleEq(1)));
  EXPECT_THAT(SecondsOfTime("1:20:30.5 pm"), Optional(DoubleEq(48030.5)));
  EXPECT_THAT(SecondsOfTime("12:30 p.m."), Optional(DoubleEq(45000)));
  EXPECT_THAT(SecondsOfTime("02.01.1970 00:00:01,5"), Optional(DoubleEq(86401.5)));
  EXPECT_THAT(SecondsOfTime("2.1.1970 1:00:00 PM"), Optional(DoubleEq(86400.0 + 46800)));
  for (const std::string wrong :
       {"13:00:00 PM", "0:10:00 AM", "10:20:30 XM", "01/02/2026 10:20:30", "32.01.2026 10:00:00"}) {
    EXPECT_FALSE(SecondsOfTime(wrong)) << wrong;
  }
  EXPECT_THAT(ErrorOf([] { TimesOf("time,z_mm\n01/02/2026 10:20:30,1\n"); }),
              HasSubstr("may be exchanged"));
  EXPECT_THAT(ErrorOf([] { TimesOf("time,z_mm\n10:20:30:05,1\n"); }), HasSubstr("time code"));
}

TEST(TimedReadings, SeveralColumnsAreChosenByOptions) {
  const std::string both = "frame,time_s,z_mm\n0,0,1\n1,0.1,2\n";
  EXPECT_THAT(ErrorOf([&] { HasTimes(both, "t.csv", {}); }),
              AllOf(HasSubstr("t.csv"), HasSubstr("'time_s'"), HasSubstr("'frame'"),
                    HasSubstr("--time-column"), HasSubstr("--file-column")));
  ReadingOptions by_time, by_frame;
  by_time.time_column = "time_s";
  by_frame.file_column = "frame";
  EXPECT_TRUE(HasTimes(both, "t.csv", by_time));
  EXPECT_FALSE(HasTimes(both, "t.csv", by_frame));
  EXPECT_THAT(TimesOf(both, by_time), Pointwise(IsTime(), std::vector<double>{0, 0.1}));
  EXPECT_THAT(ErrorOf([&] { HasTimes("time_s,elapsed_s,z\n0,0,1\n", "t.csv", {}); }),
              HasSubstr("several columns have times"));
}

TEST(TimedReadings, WrongTimesAreNamedWithTheirLine) {
  EXPECT_THAT(ErrorOf([] { TimesOf("time_s,z_mm\n0,1\nsoon,2\n"); }),
              AllOf(HasSubstr("t.csv:3: "), HasSubstr("'soon'"), HasSubstr("hh:mm:ss.f")));
  EXPECT_THAT(ErrorOf([] { TimesOf("time_s,z_mm\n0,1\n2,2\n1,3\n"); }),
              AllOf(HasSubstr("t.csv:4: "), HasSubstr("1 s does not follow")));
  EXPECT_THAT(TimesOf("time_s,z_mm\n2,1\n1,2\n0,3\n"),
              Pointwise(IsTime(), std::vector<double>{0, 1, 2}))
      << "a table from the last row to the first";
  std::string why;
  ReadingOptions options;
  options.time_unit = "fortnight";
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("time_unit"));
  options.time_unit = "ms";
  options.time_column = "t";
  EXPECT_TRUE(options.IsValid(&why));
  options.file_column = "frame";
  EXPECT_FALSE(options.IsValid(&why));
}

}  // namespace
}  // namespace thicklens::model
