// A file of records: the complete records are read, whatever happened to the others.
#include "thicklens/io/journal_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using thicklens::testing::ContentOf;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

constexpr char kSort[] = "some-kind/1";

std::vector<std::string> RecordsOf(const JournalFile& journal) {
  std::vector<std::string> records;
  for (std::size_t i = 0; i < journal.size(); ++i) records.push_back(journal.Read(i));
  return records;
}

class JournalFileTest : public ::testing::Test {
 protected:
  std::string Path() const { return folder_ / "journal"; }
  void Write(const std::vector<std::string>& records) const {
    JournalFile journal(Path(), kSort);
    for (const std::string& record : records) journal.Append({record});
  }
  std::vector<std::string> Records() const { return RecordsOf(JournalFile(Path(), kSort)); }

  TemporaryFolder folder_;
};

TEST_F(JournalFileTest, RecordsComeBackInTheNextRun) {
  const std::string bytes("\0\n\xff record 3", 12);
  {
    JournalFile journal(Path(), kSort);
    EXPECT_EQ(journal.size(), 0U);
    for (const std::string& record : {std::string("one"), std::string(), bytes}) {
      journal.Append({record});
      EXPECT_EQ(journal.Read(journal.size() - 1), record);
    }
  }
  EXPECT_THAT(Records(), ElementsAre("one", "", bytes));
  Write({"four"});
  EXPECT_THAT(Records(), ElementsAre("one", "", bytes, "four"));
  EXPECT_THAT(ContentOf(Path()),
              HasSubstr("some-kind/1\nrecord 3 "
                        // sha256sum of "one"
                        "7692c3ad3540bb803c020b3aee66cd8887123234ea0c6e7143c0add73ff431ed"
                        "\none\nrecord 0 "));
}

TEST_F(JournalFileTest, CutAnywhereItKeepsWhatIsWhole) {
  const std::vector<std::string> all = {"first", std::string(70, 'x'), "third"};
  Write(all);
  const std::string whole = ContentOf(Path());
  std::size_t seen = 0;
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    SCOPED_TRACE(length);
    folder_.Put("journal", whole.substr(0, length));
    std::size_t count = 0;
    {
      JournalFile journal(Path(), kSort);
      count = journal.size();
      EXPECT_THAT(RecordsOf(journal), ::testing::ElementsAreArray(all.data(), count));
      journal.Append({"new"});
    }
    ASSERT_GE(count, seen);
    seen = count;
    std::vector<std::string> expected(all.begin(),
                                      all.begin() + static_cast<std::ptrdiff_t>(count));
    expected.emplace_back("new");
    EXPECT_EQ(Records(), expected);
  }
  EXPECT_EQ(seen, all.size());
}

TEST_F(JournalFileTest, ADamagedRecordIsLeftOut) {
  Write({"first", "second", "third"});
  const std::string whole = ContentOf(Path());
  const std::size_t second = whole.find("second");
  const std::size_t line = whole.find("record 6");
  for (std::size_t at = line; at < second + 7; ++at) {
    SCOPED_TRACE(at);
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 1);
    folder_.Put("journal", damaged);
    JournalFile journal(Path(), kSort);
    const std::vector<std::string> records = RecordsOf(journal);
    const std::size_t hash = line + std::string("record 6 ").size();
    if (at >= hash && at + 1 != second) {
      EXPECT_THAT(records, ElementsAre("first", "third"));
      EXPECT_EQ(journal.bytes_left_out(), second + 7 - line);
    } else {  // the start of the next record is unknown
      EXPECT_THAT(records, ElementsAre("first"));
      EXPECT_EQ(journal.bytes_left_out(), whole.size() - line);
    }
  }
}

TEST_F(JournalFileTest, WhatIsLeftOutAtTheEndGoesWithTheNextRecord) {
  Write({"first", std::string(500, 'x')});
  const std::string whole = ContentOf(Path());
  folder_.Put("journal", whole.substr(0, whole.size() - 5));
  Write({"short"});
  JournalFile journal(Path(), kSort);
  EXPECT_EQ(journal.bytes_left_out(), 0U);
  EXPECT_THAT(RecordsOf(journal), ElementsAre("first", "short"));
}

TEST_F(JournalFileTest, MuchThatCannotBeReadIsNotThrownAway) {
  Write({std::string(100000, 'x')});
  std::string damaged = ContentOf(Path());
  damaged[12] = 'R';  // of "record"
  folder_.Put("journal", damaged);
  EXPECT_THAT(ErrorOf([&] { Records(); }), AllOf(HasSubstr(Path()), HasSubstr("is damaged")));
  EXPECT_EQ(ContentOf(Path()), damaged);
}

TEST_F(JournalFileTest, ClearRemovesAllRecords) {
  Write({"first", "second"});
  {
    JournalFile journal(Path(), kSort);
    journal.Clear();
    EXPECT_EQ(journal.size(), 0U);
    journal.Append({"third"});
  }
  EXPECT_THAT(Records(), ElementsAre("third"));
}

TEST_F(JournalFileTest, WhereALinkLeadsItIsAndGoes) {
  fs::create_directory(folder_ / "far");
  fs::create_symlink(folder_ / "far/journal", Path());
  Write({"one"});
  EXPECT_TRUE(fs::is_symlink(Path()));
  EXPECT_TRUE(fs::exists(folder_ / "far/journal"));
  {
    JournalFile journal(Path(), kSort);
    EXPECT_EQ(journal.Read(0), "one");
    EXPECT_TRUE(journal.Remove());
  }
  EXPECT_TRUE(fs::is_symlink(Path()));
  EXPECT_FALSE(fs::exists(folder_ / "far/journal"));
}

TEST_F(JournalFileTest, MayBeStopped) {
  Write({"one", "two", "three"});
  int calls = 0;
  const auto stop = [&] {
    if (++calls == 2) throw std::runtime_error("stop");
  };
  EXPECT_THROW(JournalFile(Path(), kSort, stop), std::runtime_error);
  EXPECT_EQ(Records().size(), 3U);
}

TEST_F(JournalFileTest, ANumberOfBytesThatCannotBeIsNoRecord) {
  const std::string hash(64, '0');
  for (const std::string bytes :
       {"18446744073709551615", "99999999999999999999999", "-1", "", "7"}) {
    folder_.Put("journal", std::string(kSort) + "\nrecord " + bytes + " " + hash + "\nshort\n");
    EXPECT_THAT(Records(), ElementsAre());
  }
}

TEST_F(JournalFileTest, OtherFilesAreLeftAlone) {
  for (const std::string content : {"a text of yours", "some-kind/2\n", "some-kind/11\n", "\n"}) {
    folder_.Put("journal", content);
    EXPECT_THAT(ErrorOf([&] { Records(); }),
                AllOf(HasSubstr(Path()), HasSubstr("'some-kind/1'"), HasSubstr("another kind")));
    EXPECT_EQ(ContentOf(Path()), content);
  }
  EXPECT_THAT(ErrorOf([&] { JournalFile(folder_.path(), kSort); }), HasSubstr(folder_.path()));
  EXPECT_THAT(ErrorOf([&] { JournalFile(folder_ / "none/journal", kSort); }),
              HasSubstr("No such file"));
  EXPECT_THAT(ErrorOf([] { JournalFile("/dev/null", kSort); }), HasSubstr("not a regular file"));
}

TEST_F(JournalFileTest, AJournalBelongsToOneRun) {
  JournalFile journal(Path(), kSort);
  journal.Append({"one"});
  EXPECT_THAT(ErrorOf([&] { Records(); }), AllOf(HasSubstr(Path()), HasSubstr("another run")));
}

TEST_F(JournalFileTest, WithoutRecordsOrServedItIsGone) {
  Write({});
  EXPECT_FALSE(fs::exists(Path()));
  Write({"one"});
  EXPECT_TRUE(fs::exists(Path()));
  {
    JournalFile journal(Path(), kSort);
    EXPECT_TRUE(journal.Remove());
    EXPECT_FALSE(fs::exists(Path()));
    folder_.Put("journal", "of somebody else");
    EXPECT_FALSE(journal.Remove());
  }
  EXPECT_EQ(ContentOf(Path()), "of somebody else");
}

}  // namespace
}  // namespace thicklens::io
