#include "thicklens/base/temporaries.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kLimit_s = 5;

std::string NewFile(const std::string& path) {
  std::ofstream(path) << "content";
  return path;
}

// A process in which outputs were abandoned cannot make any more. Therefore each of these tests
// runs in a process of its own, whose exit code is the result.
class AbandonOutputsTest : public ::testing::Test {
 protected:
  AbandonOutputsTest() { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
  ~AbandonOutputsTest() override { GTEST_FLAG_SET(death_test_style, style_); }

  // Ends the process.
  template <typename Work>
  [[noreturn]] static void Judge(const Work& work) {
    work();
    std::_Exit(::testing::Test::HasFailure() ? 1 : 0);
  }

 private:
  const std::string style_ = GTEST_FLAG_GET(death_test_style);
};

#define EXPECT_RIGHT_IN_A_PROCESS(...) \
  EXPECT_EXIT(Judge(__VA_ARGS__), ::testing::ExitedWithCode(0), "")

TEST_F(AbandonOutputsTest, RemovesWhatIsListedAndNothingElse) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    const Temporary file([&] { return NewFile(folder / "file"); });
    const Temporary inner([&] {
      fs::create_directories(folder / "inner/deep");
      NewFile(folder / "inner/deep/file");
      return folder / "inner";
    });
    NewFile(folder / "other");
    {
      const Temporary gone([&] { return NewFile(folder / "finished"); });
    }
    EXPECT_THAT(AbandonOutputs(kLimit_s), IsEmpty());
    EXPECT_THAT(folder.Entries(), ElementsAre("finished", "other"));
  });
}

// A report's folder goes with the part that was begun in it, and stays where a page lies in it.
TEST_F(AbandonOutputsTest, AFolderOfThePersonsGoesOnlyWhileItIsEmpty) {
  for (const bool has_output : {false, true}) {
    EXPECT_RIGHT_IN_A_PROCESS([has_output] {
      const testing::TemporaryFolder folder;
      const Temporary report(
          [&] {
            fs::create_directory(folder / "report");
            return folder / "report";
          },
          Abandon::kIfEmpty);
      const Temporary part([&] { return NewFile(folder / "report/.page.part"); });
      if (has_output) WriteFileAtomically(folder / "report/page.html", "page");
      const std::vector<std::string> in_place = AbandonOutputs(kLimit_s);
      EXPECT_EQ(in_place.size(), has_output ? 1U : 0U) << "an output there is news";
      EXPECT_EQ(fs::exists(folder / "report"), has_output);
      EXPECT_FALSE(fs::exists(folder / "report/.page.part"));
      EXPECT_EQ(fs::exists(folder / "report/page.html"), has_output);
    });
  }
}

TEST_F(AbandonOutputsTest, WhatIsKeptBeforeStaysAndAfterwardsNothingCanBeKept) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    Temporary kept([&] { return NewFile(folder / "kept"); });
    Temporary late([&] { return NewFile(folder / "late"); });
    kept.Keep();
    AbandonOutputs(kLimit_s);
    EXPECT_THROW(late.Keep(), Interrupted);
    EXPECT_THAT(folder.Entries(), ElementsAre("kept"));
  });
}

// A file of another process may have the same name in the meantime.
TEST_F(AbandonOutputsTest, LeavesWhatIsNotWhatWasMadeThere) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    const Temporary file([&] { return NewFile(folder / "file"); });
    NewFile(folder / "new");
    fs::rename(folder / "new", folder / "file");
    AbandonOutputs(kLimit_s);
    EXPECT_THAT(folder.Entries(), ElementsAre("file"));
  });
}

TEST_F(AbandonOutputsTest, NothingIsMadeOrPutInPlaceAfterwards) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    OutputFile file(folder / "file.txt");
    OutputFolder output(folder / "output", "marker");
    output.Write("marker", "");
    AbandonOutputs(kLimit_s);
    EXPECT_THAT(folder.Entries(), IsEmpty());
    EXPECT_ANY_THROW(file.Commit("text"));
    EXPECT_ANY_THROW(output.Commit());
    EXPECT_THROW(OutputFile(folder / "later.txt"), Interrupted);
    EXPECT_THROW(OutputFolder(folder / "later", "marker"), Interrupted);
    EXPECT_THROW(Temporary([]() -> std::string { throw std::runtime_error("was called"); }),
                 Interrupted);
    EXPECT_THROW(PutInPlace("later", []() -> std::optional<std::string> { std::abort(); }),
                 Interrupted);
    EXPECT_THAT(folder.Entries(), IsEmpty());
  });
}

TEST_F(AbandonOutputsTest, SaysWhatIsInPlace) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    const OutputFile unfinished(folder / "unfinished.txt");
    WriteFileAtomically(folder / "first.txt", "text");
    OutputFolder output(folder / "second", "marker");
    output.Write("marker", "");
    output.Commit();
    EXPECT_THAT(AbandonOutputs(kLimit_s), ElementsAre(folder / "first.txt", folder / "second"));
    EXPECT_THAT(folder.Entries(), ElementsAre("first.txt", "second"));
  });
}

// An output folder that replaces another one: the one before is listed until it is removed.
TEST_F(AbandonOutputsTest, WhatWasReplacedGoes) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    const std::optional<Temporary> replaced =
        PutInPlace("output", [&] { return std::optional(NewFile(folder / "before")); });
    EXPECT_EQ(replaced.value().path(), folder / "before");
    EXPECT_FALSE(PutInPlace("failed", [] { return std::optional<std::string>(); }).has_value());
    EXPECT_THAT(AbandonOutputs(kLimit_s), ElementsAre("output"));
    EXPECT_THAT(folder.Entries(), IsEmpty());
  });
}

// Another thread continues to write into a staging folder.
TEST_F(AbandonOutputsTest, AFolderThatStillGetsFilesGoesAsWell) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    OutputFolder output(folder / "output", "marker");
    std::atomic<bool> has_begun{false};
    std::thread writer([&] {
      try {
        for (int i = 0;; ++i) {
          output.Write("file-" + std::to_string(i), "text");
          has_begun = true;
        }
      } catch (const Error&) {  // the folder is gone
      }
    });
    while (!has_begun) std::this_thread::yield();
    AbandonOutputs(60);
    writer.join();
    EXPECT_THAT(folder.Entries(), IsEmpty());
  });
}

// The step is either done or never begun, whatever the timing.
TEST_F(AbandonOutputsTest, DoesNotTearWhatIsBeingPutInPlace) {
  EXPECT_RIGHT_IN_A_PROCESS([] {
    const testing::TemporaryFolder folder;
    std::atomic<bool> is_inside{false};
    bool is_done = false;
    std::thread other([&] {
      PutInPlace("output", [&] {
        is_inside = true;
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        is_done = true;
        return std::optional(std::string());
      });
    });
    while (!is_inside) std::this_thread::yield();
    EXPECT_THAT(AbandonOutputs(60), ElementsAre("output"));
    EXPECT_TRUE(is_done);
    other.join();
  });
}

TEST(Temporary, WhatCannotBeMadeIsNotListed) {
  EXPECT_THROW(Temporary([]() -> std::string { throw Error("full"); }), Error);
}

TEST(Temporary, MovesWithItsPath) {
  const testing::TemporaryFolder folder;
  Temporary first([&] { return NewFile(folder / "file"); });
  Temporary second = std::move(first);
  EXPECT_EQ(second.path(), folder / "file");
  first = std::move(second);
  EXPECT_EQ(first.path(), folder / "file");
}

}  // namespace
}  // namespace thicklens
