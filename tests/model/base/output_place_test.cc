// Places of outputs: links, permissions, mount points, folders without permission to write.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tests/model/base/output_fixture.h"
#include "thicklens/base/output_file.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::thicklens::testing::ContentOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::FileRefusal;
using ::thicklens::testing::FolderRefusal;
using ::thicklens::testing::kMarker;
using ::thicklens::testing::OwnMounts;
using ::thicklens::testing::TemporaryFolder;
using ::thicklens::testing::TextOfChild;
using ::thicklens::testing::TextOfChildWithMount;
using ::thicklens::testing::Unless;
using ::thicklens::testing::WriteFolder;

constexpr uid_t kNobody = 65534;

mode_t ModeOf(const std::string& path) {
  struct stat info {};
  EXPECT_EQ(::lstat(path.c_str(), &info), 0) << path;
  return info.st_mode & 07777;
}

// ---- Links.

TEST(OutputPlace, ALinkInThePlaceOfAPartIsNotFollowed) {
  const TemporaryFolder folder;
  folder.Put("home/precious", "precious");
  for (const std::string part : {".a.part", ".a.0123456789abcdef.part"}) {
    fs::create_symlink("home/precious", folder / part);
    WriteFileAtomically(folder / "a", "new");
    EXPECT_TRUE(fs::is_symlink(folder / part));
    fs::remove(folder / part);
    fs::create_directory_symlink("home", folder / part);
    fs::remove(folder / "a");
    WriteFolder(folder / "a", "new");
    EXPECT_TRUE(fs::is_symlink(folder / part));
    fs::remove(folder / part);
    fs::remove_all(folder / "a");
  }
  EXPECT_EQ(ContentOf(folder / "home/precious"), "precious");
}

TEST(OutputPlace, PartsHaveNamesThatCannotBeGuessed) {
  const TemporaryFolder folder;
  std::string first;
  {
    const OutputFile file(folder / "a");
    first = folder.Entries().at(0);
  }
  const OutputFile file(folder / "a");
  EXPECT_NE(folder.Entries().at(0), first);
}

TEST(OutputPlace, ALinkedFolderIsReplacedWhereItIs) {
  const TemporaryFolder folder;
  folder.Put("disk/out/truth.yaml", "old");
  fs::create_directory_symlink("disk/out", folder / "out");
  WriteFolder(folder / "out", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "out"));
  EXPECT_EQ(ContentOf(folder / "disk/out/truth.yaml"), "new");
  EXPECT_THAT(folder.Entries(), ElementsAre("disk", "out"));
}

// `cp` refuses as well. The link must not be replaced by a file.
TEST(OutputPlace, ALinkToNothingIsRefused) {
  const TemporaryFolder folder;
  fs::create_symlink("nothing", folder / "link");
  fs::create_symlink("ring", folder / "ring");
  for (const char* name : {"link", "ring"}) {
    EXPECT_THAT(FileRefusal(folder / name),
                AllOf(StartsWith(folder / name), HasSubstr("symbolic link to")));
    EXPECT_THAT(FolderRefusal(folder / name), HasSubstr("symbolic link to"));
  }
  EXPECT_THAT(folder.Entries(), ElementsAre("link", "ring"));
}

TEST(OutputPlace, StandardOutputAndItsNamesAreNoFile) {
  const TemporaryFolder folder;
  for (const char* name : {"-", "/dev/stdout", "/proc/self/fd/1"}) {
    EXPECT_NE(FileRefusal(name), "(no error)") << name;
    EXPECT_NE(FolderRefusal(name), "(no error)") << name;
  }
  EXPECT_THAT(FileRefusal("-"), HasSubstr("standard output"));
}

TEST(OutputPlace, AnyNameThatAFileMayHave) {
  const TemporaryFolder folder;
  for (const std::string& name : {std::string("two\nlines"), std::string("\xFF\xFE"),
                                  std::string(255, 'a'), std::string("*?[a]")}) {
    WriteFileAtomically(folder / name, "first");
    WriteFileAtomically(folder / name, "second");
    EXPECT_EQ(ContentOf(folder / name), "second");
    EXPECT_THAT(folder.Entries(), ElementsAre(name));
    fs::remove(folder / name);
    WriteFolder(folder / name, "first");
    WriteFolder(folder / name, "second");
    EXPECT_EQ(ContentOf(folder / name + "/frames/a.png"), "second");
    EXPECT_THAT(folder.Entries(), ElementsAre(name));
    fs::remove_all(folder / name);
  }
}

// ---- Permissions.

class Umask {
 public:
  explicit Umask(mode_t mask) : older_(::umask(mask)) {}
  ~Umask() { ::umask(older_); }
  Umask(const Umask&) = delete;
  Umask& operator=(const Umask&) = delete;

 private:
  mode_t older_;
};

TEST(OutputPlace, NewOnesHaveThePermissionsOfPlainFiles) {
  const TemporaryFolder folder;
  for (const mode_t mask : {mode_t{022}, mode_t{077}, mode_t{002}}) {
    const Umask set(mask);
    const std::string name = folder / std::to_string(mask);
    WriteFileAtomically(name, "x");
    WriteFolder(name + "d", "x");
    EXPECT_EQ(ModeOf(name), 0666 & ~mask);
    EXPECT_EQ(ModeOf(name + "d"), 0777 & ~mask);
    EXPECT_EQ(ModeOf(name + "d/frames"), 0777 & ~mask);
    EXPECT_EQ(ModeOf(name + "d/frames/a.png"), 0666 & ~mask);
  }
}

TEST(OutputPlace, OlderOnesLeaveTheirPermissions) {
  const TemporaryFolder folder;
  const Umask set(022);
  for (const mode_t mode : {mode_t{0600}, mode_t{0664}, mode_t{0700}}) {
    const std::string file = folder.Put("a", "older");
    ASSERT_EQ(::chmod(file.c_str(), mode), 0);
    WriteFileAtomically(file, "new");
    EXPECT_EQ(ModeOf(file), mode);
    EXPECT_EQ(ContentOf(file), "new");
  }
  folder.Put("d/truth.yaml", "older");
  ASSERT_EQ(::chmod((folder / "d").c_str(), 0750), 0);
  WriteFolder(folder / "d", "new");
  EXPECT_EQ(ModeOf(folder / "d"), mode_t{0750});
}

// ---- What needs another user or mounts: in a child process.

TEST(OutputPlace, AMountPointIsWrittenInto) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  EXPECT_CHILD_SUCCEEDS(TextOfChildWithMount(out, [&]() -> std::string {
    fs::create_directory(out + "/lost+found");
    WriteFolder(out, "old", {kMarker, "frames"});
    std::string wrong = Unless(ContentOf(out + "/truth.yaml") == "old", "it is not written");
    std::ofstream(out + "/frames/of-the-older-one") << "x";
    {
      OutputFolder replaced(out, kMarker, {kMarker, "frames", "new"});
      replaced.Write("new", "2");
      replaced.Write(kMarker, "new");
      wrong += Unless(ContentOf(out + "/truth.yaml") == "old", "it goes before Commit");
      const std::string second = FolderRefusal(out);
      wrong += Unless(second.find("another run") != std::string::npos, "two write it: " + second);
      replaced.Commit();
    }
    wrong += Unless(ContentOf(out + "/truth.yaml") == "new", "it is not replaced");
    wrong += Unless(!fs::exists(out + "/frames"), "the older content stays");
    int entries = 0;
    for (const auto& entry : fs::directory_iterator(out)) {
      static_cast<void>(entry);
      ++entries;
    }
    wrong += Unless(entries == 3 && fs::exists(out + "/lost+found"), "other entries are there");

    std::ofstream(out + "/thesis.tex") << "years";
    const std::string refusal = FolderRefusal(out, {kMarker, "new"});
    wrong +=
        Unless(refusal.find("'thesis.tex', which would be lost") != std::string::npos, refusal);
    fs::remove(out + "/truth.yaml");
    const std::string foreign = FolderRefusal(out);
    wrong += Unless(foreign.find("is not replaced") != std::string::npos, foreign);
    wrong += Unless(ContentOf(out + "/thesis.tex") == "years", "the thesis is lost");
    return wrong;
  }));
}

// A container's own folders cannot be renamed.
TEST(OutputPlace, AFolderOfALowerLayerIsWrittenInto) {
  const TemporaryFolder folder;
  const std::string disk = folder / "disk";
  EXPECT_CHILD_SUCCEEDS(TextOfChildWithMount(disk, [&]() -> std::string {
    for (const char* name : {"lower/out/frames", "upper", "work", "merged"})
      fs::create_directories(disk + "/" + name);
    std::ofstream(disk + "/lower/out/truth.yaml") << "older";
    std::ofstream(disk + "/lower/out/frames/old") << "older";
    const std::string options =
        "lowerdir=" + disk + "/lower,upperdir=" + disk + "/upper,workdir=" + disk + "/work";
    const std::string merged = disk + "/merged";
    if (::mount("overlay", merged.c_str(), "overlay", 0, options.c_str()) != 0)
      return std::string("skip: no overlay can be mounted: ") + std::strerror(errno);
    WriteFolder(merged + "/out", "new", {kMarker, "frames"});
    return Unless(ContentOf(merged + "/out/truth.yaml") == "new", "it is not replaced") +
           Unless(ContentOf(merged + "/out/frames/a.png") == "new", "its frame is not written") +
           Unless(!fs::exists(merged + "/out/frames/old"), "the older content stays") +
           Unless(std::distance(fs::directory_iterator(merged), {}) == 1, "something is left");
  }));
}

// A run that was killed between the older marker's end and the new one's beginning.
TEST(OutputPlace, TheNextRunRemovesThePartsOfAKilledRunInAMountPoint) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  EXPECT_CHILD_SUCCEEDS(TextOfChildWithMount(out, [&]() -> std::string {
    fs::create_directories(out + "/.thicklens.0123456789abcdef.part");
    std::ofstream(out + "/.thicklens.0123456789abcdef.part/.commit-begun") << "";
    fs::create_directories(out + "/frames");
    std::ofstream(out + "/frames/half") << "x";
    std::ofstream(out + "/mine") << "x";
    const std::string refusal = FolderRefusal(out, {kMarker, "frames"});
    std::string wrong = Unless(refusal.find("'mine'") != std::string::npos, refusal);
    fs::remove(out + "/mine");
    WriteFolder(out, "new", {kMarker, "frames"});
    wrong += Unless(ContentOf(out + "/frames/a.png") == "new", "it is not written");
    wrong += Unless(!fs::exists(out + "/frames/half"), "the half one stays");
    return wrong;
  }));
}

// The folder was a mount point when that run was killed, and is none any more.
TEST(OutputPlace, TheNextReplacementRemovesThePartsOfAKilledRun) {
  for (const bool is_whole : {false, true}) {
    const TemporaryFolder folder;
    const std::string out = folder / "out";
    fs::create_directories(out + "/.thicklens.0123456789abcdef.part/frames");
    std::ofstream(out + "/.thicklens.0123456789abcdef.part/.commit-begun") << "";
    fs::create_directories(out + "/frames");
    std::ofstream(out + "/frames/old") << "x";
    if (is_whole) std::ofstream(out + "/" + kMarker) << "old";
    std::ofstream(out + "/mine") << "x";
    EXPECT_THAT(FolderRefusal(out, {kMarker, "frames"}), ::testing::HasSubstr("'mine'"));
    EXPECT_TRUE(fs::exists(out + "/frames/old"));
    fs::remove(out + "/mine");
    WriteFolder(out, "new", {kMarker, "frames"});
    EXPECT_EQ(ContentOf(out + "/frames/a.png"), "new");
    EXPECT_FALSE(fs::exists(out + "/frames/old"));
    EXPECT_EQ(std::distance(fs::directory_iterator(out), {}), 2) << "marker and frames";
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  }
}

// A run that was killed before it replaced anything does not say to whom the content belongs.
TEST(OutputPlace, FilesThatAKilledRunDidNotTouchAreKept) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  fs::create_directories(out + "/.thicklens.0123456789abcdef.part/frames");
  fs::create_directories(out + "/frames");
  std::ofstream(out + "/frames/photo.raw") << "mine";
  EXPECT_THAT(FolderRefusal(out, {kMarker, "frames"}),
              ::testing::HasSubstr("contains other files"));
  EXPECT_EQ(ContentOf(out + "/frames/photo.raw"), "mine");
  // A mount point is written in place.
  const std::string place = folder / "place";
  EXPECT_CHILD_SUCCEEDS(TextOfChildWithMount(place, [&]() -> std::string {
    fs::create_directories(place + "/.thicklens.0123456789abcdef.part");
    fs::create_directories(place + "/frames");
    std::ofstream(place + "/frames/photo.raw") << "mine";
    const std::string refusal = FolderRefusal(place, {kMarker, "frames"});
    return Unless(refusal.find("contains other files") != std::string::npos, refusal) +
           Unless(ContentOf(place + "/frames/photo.raw") == "mine", "the photo is lost");
  }));
}

TEST(OutputPlace, AFullMountPointKeepsTheOlderContent) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  EXPECT_CHILD_SUCCEEDS(TextOfChildWithMount(out, [&]() -> std::string {
    WriteFolder(out, "old");
    const std::string full = ErrorOf([&] { WriteFolder(out, std::string(3 << 20, 'x')); });
    return Unless(full.find("No space left on device") != std::string::npos, full) +
           Unless(ContentOf(out + "/truth.yaml") == "old", "the older one is lost") +
           Unless(ContentOf(out + "/frames/a.png") == "old", "its frame is lost");
  }));
}

TEST(OutputPlace, AFileThatIsAMountPointIsWrittenInto) {
  const TemporaryFolder folder;
  EXPECT_CHILD_SUCCEEDS(TextOfChild([&]() -> std::string {
    const std::string there = folder.Put("there", "a long older content");
    const std::string here = folder.Put("here");
    if (const std::string skip = OwnMounts(); !skip.empty()) return skip;
    if (::mount(there.c_str(), here.c_str(), nullptr, MS_BIND, nullptr) != 0)
      return std::string("skip: no bind mount: ") + std::strerror(errno);
    std::string wrong;
    {
      OutputFile file(here);
      const std::string second = FileRefusal(here);
      wrong += Unless(second.find("another run") != std::string::npos, "two write it: " + second);
      file.Commit("new");
    }
    wrong += Unless(ContentOf(there) == "new", "it is not written");
    WriteFileAtomically(here, "longer than before");
    return wrong + Unless(ContentOf(there) == "longer than before", "it does not grow");
  }));
}

// The folder around it belongs to another user, as that of a volume in a container may.
TEST(OutputPlace, AFolderInOneThatMayNotBeWrittenToIsWrittenInto) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to become another user";
  const TemporaryFolder folder;
  ASSERT_EQ(::chmod(folder.path().c_str(), 0755), 0);
  const std::string out = folder / "out", file = folder.Put("file", "older");
  fs::create_directory(out);
  ASSERT_EQ(::chown(out.c_str(), kNobody, kNobody), 0);
  ASSERT_EQ(::chown(file.c_str(), kNobody, kNobody), 0);
  const std::string of_root = folder.Put("of-root", "root's");
  EXPECT_CHILD_SUCCEEDS(TextOfChild([&]() -> std::string {
    if (::setgid(kNobody) != 0 || ::setuid(kNobody) != 0) return "skip: no other user";
    // The temporary folder may lie below one that only root may enter.
    if (::access(out.c_str(), W_OK | X_OK) != 0)
      return std::string("skip: another user cannot reach it: ") + std::strerror(errno);
    std::string wrong;
    WriteFolder(out, "old");
    WriteFolder(out, "new");
    WriteFileAtomically(file, "new");
    wrong += Unless(ContentOf(out + "/truth.yaml") == "new", "the folder is not written");
    wrong += Unless(ContentOf(file) == "new", "the file is not written");
    for (const std::string& path : {folder / "more", of_root}) {
      const std::string refusal = FileRefusal(path);
      wrong += Unless(refusal == path + ": cannot be written: Permission denied", refusal);
    }
    const std::string refusal = FolderRefusal(folder / "more");
    return wrong + Unless(refusal.find("Permission denied") != std::string::npos, refusal);
  }));
  EXPECT_EQ(ContentOf(of_root), "root's");
}

// A file that its owner has protected from himself is not replaced either.
TEST(OutputPlace, AReadOnlyFileOrFolderIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to become another user";
  const TemporaryFolder folder;
  ASSERT_EQ(::chmod(folder.path().c_str(), 0777), 0);
  const std::string file = folder.Put("file", "older");
  folder.Put("out/truth.yaml", "older");
  for (const std::string& path : {file, folder / "out"}) {
    ASSERT_EQ(::chown(path.c_str(), kNobody, kNobody), 0);
    ASSERT_EQ(::chmod(path.c_str(), path == file ? 0444 : 0555), 0);
  }
  EXPECT_CHILD_SUCCEEDS(TextOfChild([&]() -> std::string {
    if (::setgid(kNobody) != 0 || ::setuid(kNobody) != 0) return "skip: no other user";
    const std::string of_file = FileRefusal(file);
    const std::string of_folder = FolderRefusal(folder / "out");
    return Unless(of_file.find("Permission denied") != std::string::npos, of_file) +
           Unless(of_folder.find("Permission denied") != std::string::npos, of_folder);
  }));
}

}  // namespace
}  // namespace thicklens
