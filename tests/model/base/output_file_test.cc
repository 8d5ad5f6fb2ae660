#include "thicklens/base/output_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tests/model/base/output_fixture.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using ::testing::StartsWith;
using ::thicklens::testing::ContentOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::FileRefusal;
using ::thicklens::testing::FolderRefusal;
using ::thicklens::testing::kMarker;
using ::thicklens::testing::StatusOfChild;
using ::thicklens::testing::TemporaryFolder;

TEST(OutputFile, NothingAtTheTargetBeforeCommit) {
  const TemporaryFolder folder;
  OutputFile file(folder / "a.yaml");
  EXPECT_THAT(folder.Entries(), ElementsAre(MatchesRegex("[.]a[.]yaml[.][0-9a-f]{16}[.]part")));
  file.Commit("content\n");
  EXPECT_THAT(folder.Entries(), ElementsAre("a.yaml"));
  EXPECT_EQ(ContentOf(folder / "a.yaml"), "content\n");
  EXPECT_EQ(file.path(), folder / "a.yaml");
}

TEST(OutputFile, WithoutCommitTheOldFileStays) {
  const TemporaryFolder folder;
  folder.Put("a.yaml", "old");
  { const OutputFile file(folder / "a.yaml"); }
  EXPECT_THAT(folder.Entries(), ElementsAre("a.yaml"));
  EXPECT_EQ(ContentOf(folder / "a.yaml"), "old");
  WriteFileAtomically(folder / "a.yaml", "new, shorter or longer");
  EXPECT_EQ(ContentOf(folder / "a.yaml"), "new, shorter or longer");
}

TEST(OutputFile, PartOfAKilledRunIsRemoved) {
  const TemporaryFolder folder;
  folder.Put(".a.yaml.0123456789abcdef.part", "left behind by a killed run");
  WriteFileAtomically(folder / "a.yaml", "new");
  EXPECT_THAT(folder.Entries(), ElementsAre("a.yaml"));
  EXPECT_EQ(ContentOf(folder / "a.yaml"), "new");
}

TEST(OutputFile, SecondClaimantIsRefused) {
  const TemporaryFolder folder;
  OutputFile first(folder / "a.yaml");
  EXPECT_THAT(FileRefusal(folder / "a.yaml"),
              AllOf(HasSubstr(folder / "a.yaml"), HasSubstr("another run")));
  EXPECT_EQ(StatusOfChild([&] { return FileRefusal(folder / "a.yaml") == "(no error)" ? 0 : 3; }),
            3);
  first.Commit("first");
  EXPECT_EQ(ContentOf(folder / "a.yaml"), "first");
  WriteFileAtomically(folder / "a.yaml", "later");
  EXPECT_EQ(ContentOf(folder / "a.yaml"), "later");
}

TEST(OutputFile, LockOfAKilledRunIsGone) {
  const TemporaryFolder folder;
  // _exit runs no destructor: the part file stays, as after a kill.
  StatusOfChild([&] {
    auto* file = new OutputFile(folder / "a.yaml");
    return file->path().empty() ? 1 : 0;
  });
  EXPECT_THAT(folder.Entries(), ElementsAre(HasSubstr(".part")));
  WriteFileAtomically(folder / "a.yaml", "new");
  EXPECT_THAT(folder.Entries(), ElementsAre("a.yaml"));
}

// Several threads claim, drop and commit as fast as they can. The target always has one complete
// content, and two claimants never hold the same output.
TEST(OutputFile, ManyClaimantsOneHolder) {
  const TemporaryFolder folder;
  std::atomic<int> holders{0}, most{0}, claims{0}, other_errors{0};
  ParallelFor(8, 8, [&](int worker) {
    for (int i = 0; i < 200; ++i) {
      try {
        OutputFile file(folder / "a");
        const int now = ++holders;
        if (now > 1) most = now;
        ++claims;
        --holders;
        if (i % 2 == 0) file.Commit(std::string(5000, static_cast<char>('a' + worker)));
      } catch (const Error& e) {
        if (std::string(e.what()).find("another run") == std::string::npos) ++other_errors;
      }
    }
  });
  EXPECT_EQ(most, 0);
  EXPECT_EQ(other_errors, 0);
  EXPECT_GT(claims, 0);
  EXPECT_THAT(folder.Entries(), ElementsAre("a"));
  const std::string content = ContentOf(folder / "a");
  EXPECT_EQ(content, std::string(5000, content.at(0)));
}

TEST(OutputFile, MissingFolderAndFolderAsTarget) {
  const TemporaryFolder folder;
  EXPECT_THAT(FileRefusal(folder / "none/a.yaml"),
              AllOf(HasSubstr("none/a.yaml"), HasSubstr("does not exist")));
  EXPECT_THAT(FileRefusal(folder.path()), HasSubstr("is a folder"));
  EXPECT_THAT(FileRefusal(folder / "a/"), HasSubstr("is a folder"));
  EXPECT_THAT(FileRefusal(""), HasSubstr("empty"));
  EXPECT_THAT(FileRefusal(folder / std::string(256, 'a')),
              HasSubstr("cannot be written: File name too long"));
  EXPECT_THAT(folder.Entries(), IsEmpty());
}

TEST(OutputFile, DevicesAreNotReplaced) {
  EXPECT_THAT(FileRefusal("/dev/null"), HasSubstr("device"));
}

TEST(OutputFile, LinkStaysALink) {
  const TemporaryFolder folder;
  folder.Put("real/a.yaml", "old");
  fs::create_symlink("real/a.yaml", folder / "link.yaml");
  WriteFileAtomically(folder / "link.yaml", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link.yaml"));
  EXPECT_EQ(ContentOf(folder / "real/a.yaml"), "new");
  EXPECT_THAT(folder.Entries(), ElementsAre("link.yaml", "real"));
}

TEST(OutputFile, AReadOnlyFolderIsRefusedAtOnce) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  const TemporaryFolder folder;
  fs::permissions(folder.path(), fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(FileRefusal(folder / "a"), HasSubstr("cannot be written"));
  EXPECT_THAT(FolderRefusal(folder / "a"), HasSubstr("cannot be written"));
  fs::permissions(folder.path(), fs::perms::owner_all);
}

TEST(OutputFile, FullDiskLeavesTheOldFile) {
  const TemporaryFolder folder;
  folder.Put("a", "old");
  const int status = StatusOfChild([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const std::string error =
        ErrorOf([&] { WriteFileAtomically(folder / "a", std::string(100000, 'x')); });
    return error.find("cannot be written: File too large") == std::string::npos ? 1 : 0;
  });
  EXPECT_EQ(status, 0);
  EXPECT_EQ(ContentOf(folder / "a"), "old");
  EXPECT_THAT(folder.Entries(), ElementsAre("a"));
}

TEST(OutputFile, MovesWithItsClaim) {
  const TemporaryFolder folder;
  OutputFile a(folder / "a");
  OutputFile b(std::move(a));
  OutputFile c(folder / "c");
  c = std::move(b);  // drops the claim on c
  EXPECT_THAT(folder.Entries(), ElementsAre(HasSubstr(".a.")));
  c.Commit("x");
  EXPECT_THAT(folder.Entries(), ElementsAre("a"));
}

TEST(OutputFile, AnyBytes) {
  const TemporaryFolder folder;
  std::string bytes("\0\r\n\xFF", 4);
  for (int i = 0; i < 18; ++i) bytes += bytes;
  WriteFileAtomically(folder / "a", bytes);
  EXPECT_EQ(ReadWholeFile(folder / "a"), bytes);
  WriteFileAtomically(folder / "empty", "");
  EXPECT_EQ(ReadWholeFile(folder / "empty"), "");
}

TEST(OutputFolder, AppearsWholeAtCommit) {
  const TemporaryFolder folder;
  OutputFolder out(folder / "out", kMarker);
  out.Write(kMarker, "t");
  out.Write("frames/a.png", "a");
  EXPECT_FALSE(fs::exists(folder / "out"));
  EXPECT_EQ(ContentOf(out.staging_path() + "/frames/a.png"), "a");
  out.Commit();
  EXPECT_THAT(folder.Entries(), ElementsAre("out"));
  EXPECT_EQ(ContentOf(folder / "out/frames/a.png"), "a");
}

TEST(OutputFolder, TrailingSlashesMeanTheSame) {
  const TemporaryFolder folder;
  for (const char* name : {"out/", "out//", "out/.", "./out/"}) {
    OutputFolder out(folder / name, kMarker);
    out.Write(kMarker, name);
    out.Commit();
    EXPECT_THAT(folder.Entries(), ElementsAre("out"));
    EXPECT_EQ(ContentOf(folder / "out/truth.yaml"), name);
  }
}

TEST(OutputFolder, ReplacesOnlyItsOwn) {
  const TemporaryFolder folder;
  folder.Put("thesis/chapter.tex", "years");
  EXPECT_THAT(FolderRefusal(folder / "thesis"),
              AllOf(HasSubstr("thesis"), HasSubstr(kMarker), HasSubstr("not replaced")));
  folder.Put("file", "x");
  EXPECT_THAT(FolderRefusal(folder / "file"), HasSubstr("is a file"));
  EXPECT_THAT(FolderRefusal(folder / "none/out"), HasSubstr("does not exist"));
  for (const char* name : {"", ".", "..", "/"})
    EXPECT_NE(FolderRefusal(name), "(no error)") << name;
  EXPECT_EQ(ContentOf(folder / "thesis/chapter.tex"), "years");
  EXPECT_THAT(folder.Entries(), ElementsAre("file", "thesis"));

  fs::create_directory(folder / "empty");
  folder.Put("own/truth.yaml", "old");
  folder.Put("own/old-frame.png", "old");
  for (const char* name : {"empty", "own"}) {
    OutputFolder out(folder / name, kMarker);
    out.Write(kMarker, "new");
    out.Commit();
    EXPECT_EQ(ContentOf(folder / name + "/truth.yaml"), "new");
  }
  EXPECT_FALSE(fs::exists(folder / "own/old-frame.png"));
  EXPECT_THAT(folder.Entries(), ElementsAre("empty", "file", "own", "thesis"));
}

// An output folder of the program to which another program has added a file.
TEST(OutputFolder, NamesWhatWouldBeLost) {
  TemporaryFolder folder;
  const std::vector<std::string> own = {kMarker, "frames"};
  folder.Put("out/" + std::string(kMarker));
  folder.Put("out/frames/a.png");
  { OutputFolder fine(folder / "out", kMarker, own); }
  OutputFolder claimed(folder / "out", kMarker, own);
  folder.Put("out/notes.txt");
  EXPECT_THAT(ErrorOf([&] { claimed.Commit(); }), HasSubstr("'notes.txt'"));
  EXPECT_TRUE(fs::exists(folder / "out/notes.txt"));
}

// The output is one folder deeper, and its own entries give the names there.
TEST(OutputFolder, NamesWhatWouldBeLostOneFolderDeeper) {
  const std::vector<std::string> own = {kMarker, "views/view_[0-9].png", "views/view_[0-9].tiff"};
  const auto put_own = [](TemporaryFolder* folder) {
    folder->Put("out/" + std::string(kMarker));
    folder->Put("out/views/view_1.png");
    folder->Put("out/views/view_2.tiff");
  };
  {
    TemporaryFolder folder;
    put_own(&folder);
    OutputFolder claimed(folder / "out", kMarker, own);
    claimed.Write(kMarker, "new");
    claimed.Commit();
    EXPECT_FALSE(fs::exists(folder / "out/views"));
  }
  for (const char* other : {"notes.txt", "view_12.png", "view_1.png.txt", "view_3.png/mine"}) {
    TemporaryFolder folder;
    put_own(&folder);
    OutputFolder claimed(folder / "out", kMarker, own);
    const std::string path = folder.Put("out/views/" + std::string(other), "years");
    const std::string name = std::string(other).substr(0, std::string(other).find('/'));
    EXPECT_THAT(ErrorOf([&] { claimed.Commit(); }), HasSubstr("'views/" + name + "'"));
    EXPECT_EQ(ContentOf(path), "years");
  }
  TemporaryFolder folder;
  put_own(&folder);
  fs::remove_all(folder / "out/views");
  folder.Put("out/views", "a file of that name");
  EXPECT_THAT(FolderRefusal(folder / "out", own), HasSubstr("'views'"));
  EXPECT_EQ(ContentOf(folder / "out/views"), "a file of that name");
}

TEST(OutputFolder, LooksAgainBeforeItReplaces) {
  const TemporaryFolder folder;
  {
    OutputFolder out(folder / "out", kMarker);
    out.Write(kMarker, "new");
    folder.Put("out/somebody's", "came meanwhile");
    EXPECT_THAT(ErrorOf([&] { out.Commit(); }), HasSubstr("not replaced"));
  }
  EXPECT_EQ(ContentOf(folder / "out/somebody's"), "came meanwhile");
  EXPECT_THAT(folder.Entries(), ElementsAre("out"));
}

TEST(OutputFolder, WithoutCommitTheOldOneStays) {
  const TemporaryFolder folder;
  folder.Put("out/truth.yaml", "old");
  {
    OutputFolder out(folder / "out", kMarker);
    out.Write(kMarker, "new");
  }
  EXPECT_THAT(folder.Entries(), ElementsAre("out"));
  EXPECT_EQ(ContentOf(folder / "out/truth.yaml"), "old");
}

// The staging folder is removed during the run, so that the second of the two renames fails.
TEST(OutputFolder, OldOneComesBackIfCommitFails) {
  const TemporaryFolder folder;
  folder.Put("out/truth.yaml", "old");
  {
    OutputFolder out(folder / "out", kMarker);
    fs::remove_all(out.staging_path());
    EXPECT_THAT(ErrorOf([&] { out.Commit(); }), HasSubstr("cannot be written"));
  }
  EXPECT_THAT(folder.Entries(), ElementsAre("out"));
  EXPECT_EQ(ContentOf(folder / "out/truth.yaml"), "old");
}

TEST(OutputFolder, NobodysFolderIsInTheWay) {
  const TemporaryFolder folder;
  folder.Put("out/truth.yaml", "old");
  folder.Put(".out.old-1/mine", "somebody's");
  OutputFolder out(folder / "out", kMarker);
  out.Write(kMarker, "new");
  out.Commit();
  EXPECT_EQ(ContentOf(folder / ".out.old-1/mine"), "somebody's");
  EXPECT_THAT(folder.Entries(), ElementsAre(".out.old-1", "out"));
}

TEST(OutputFolder, StaleStagingIsEmptiedAndSecondClaimantRefused) {
  const TemporaryFolder folder;
  folder.Put(".out.0123456789abcdef.part/frames/stale.png", "x");
  OutputFolder out(folder / "out", kMarker);
  EXPECT_THAT(FolderRefusal(folder / "out/"), HasSubstr("another run"));
  out.Write(kMarker, "t");
  out.Commit();
  EXPECT_FALSE(fs::exists(folder / "out/frames"));
  EXPECT_THAT(folder.Entries(), ElementsAre("out"));
}

TEST(OutputFolder, ManyClaimantsOneHolder) {
  const TemporaryFolder folder;
  std::atomic<int> other_errors{0};
  std::mutex mutex;
  std::string last_error;
  ParallelFor(8, 8, [&](int worker) {
    for (int i = 0; i < 50; ++i) {
      const std::string error = ErrorOf([&] {
        OutputFolder out(folder / "out", kMarker);
        out.Write(kMarker, std::to_string(worker));
        out.Write("frames/a", std::to_string(worker));
        if (i % 2 == 0) out.Commit();
      });
      if (error != "(no error)" && error.find("another run") == std::string::npos) {
        ++other_errors;
        const std::lock_guard<std::mutex> lock(mutex);
        last_error = error;
      }
    }
  });
  EXPECT_EQ(other_errors, 0) << last_error;
  EXPECT_THAT(folder.Entries(), ElementsAre("out"));
  EXPECT_EQ(ContentOf(folder / "out/truth.yaml"), ContentOf(folder / "out/frames/a"));
}

TEST(OutputFolder, VanishedMeanwhileIsAnError) {
  const TemporaryFolder folder;
  const std::string parent = folder / "parent";
  const auto vanish = [&] { fs::remove_all(parent); };
  const std::string why = "was removed or renamed by another process";
  {
    fs::create_directory(parent);
    OutputFolder output(parent + "/out", "marker");
    output.Write("inner/first", "1");
    vanish();
    EXPECT_THAT(ErrorOf([&] { output.Write("inner/second", "2"); }),
                AllOf(StartsWith(parent + "/out/inner/second: "), HasSubstr(why)));
    EXPECT_THAT(ErrorOf([&] { output.Write("marker", "2"); }), HasSubstr(why));
    EXPECT_THAT(ErrorOf([&] { output.Commit(); }),
                AllOf(StartsWith(parent + "/out: "), HasSubstr(why)));
    EXPECT_FALSE(fs::exists(parent));
  }
  // Another process that created the folders again has not created their content.
  fs::create_directory(parent);
  OutputFolder output(parent + "/out", "marker");
  const std::string staging = output.staging_path();
  output.Write("marker", "1");
  vanish();
  fs::create_directories(staging);
  {
    OutputFolder dropped = std::move(output);
    EXPECT_THAT(ErrorOf([&] { dropped.Commit(); }), HasSubstr(why));
  }
  // The folder that another process created there is not removed.
  EXPECT_TRUE(fs::exists(staging));
}

TEST(OutputFile, VanishedMeanwhileIsAnError) {
  const TemporaryFolder folder;
  std::string part;
  {
    OutputFile output(folder / "out");
    part = folder.Entries().at(0);
    fs::remove(folder / part);
    folder.Put(part, "of somebody else");
    EXPECT_THAT(ErrorOf([&] { output.Commit("mine"); }),
                HasSubstr("was removed or renamed by another process"));
  }
  EXPECT_FALSE(fs::exists(folder / "out"));
  EXPECT_EQ(ContentOf(folder / part), "of somebody else");
}

TEST(OutputFolder, IsThereAtEveryMomentWhileItIsReplaced) {
  const TemporaryFolder folder;
  const std::string a = folder / "a", b = folder / "b";
  fs::create_directory(a);
  fs::create_directory(b);
  if (::renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) != 0)
    GTEST_SKIP() << "this file system cannot exchange two names";
  const std::string path = folder / "out";
  const auto replace = [&](const std::string& content) {
    OutputFolder output(path, "marker");
    output.Write("marker", content);
    output.Commit();
  };
  replace("0");
  std::atomic<bool> done{false};
  std::atomic<int> missing{0}, seen{0};
  std::thread watcher([&] {
    while (!done) {
      ++(fs::exists(path + "/marker") ? seen : missing);
    }
  });
  for (int i = 1; i <= 300; ++i) replace(std::to_string(i));
  done = true;
  watcher.join();
  EXPECT_EQ(missing, 0);
  EXPECT_GT(seen, 0);
  EXPECT_EQ(ReadWholeFile(path + "/marker"), "300");
  // No other file is left in the folder.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 3);
}

TEST(OutputFolder, FullDiskIsAnError) {
  const TemporaryFolder folder;
  const int status = StatusOfChild([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    OutputFolder out(folder / "out", kMarker);
    const std::string error = ErrorOf([&] { out.Write("a/b", std::string(100000, 'x')); });
    return error.find("out/a/b: cannot be written: File too large") == std::string::npos ? 1 : 0;
  });
  EXPECT_EQ(status, 0);
  EXPECT_THAT(folder.Entries(), IsEmpty());
}

TEST(ReadWholeFile, NamesPathAndReason) {
  const TemporaryFolder folder;
  EXPECT_THAT(ErrorOf([&] { ReadWholeFile(folder / "none"); }),
              AllOf(HasSubstr(folder / "none"), HasSubstr("No such file")));
  EXPECT_THAT(ErrorOf([&] { ReadWholeFile(folder.path()); }), HasSubstr("is a folder"));
  // Reading the first page of one's own memory is an input error, not an empty file.
  if (fs::exists("/proc/self/mem")) {
    EXPECT_THAT(ErrorOf([] { ReadWholeFile("/proc/self/mem"); }), HasSubstr("cannot be read"));
  }
}

}  // namespace
}  // namespace thicklens
