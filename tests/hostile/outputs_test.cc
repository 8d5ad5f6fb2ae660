// Places to which an output cannot or must not be written.
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>

#include "hostile/hostile_test.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::HasSubstr;

class HostileOutputs : public HostileTest {
 protected:
  // The commands that write a file, and those that write a folder.
  static std::vector<std::string> ToFile(const std::string& output) {
    return {Explain(output), Render(output), "\"$T\" report lf -o " + output + " --quiet",
            "\"$T\" camera init --focal-mm 50 --f-number 2 --pitch-um 5 --size 10x10 -o " + output};
  }
  static std::vector<std::string> ToFolder(const std::string& output) {
    return {Estimate(output), "\"$T\" simulate image scene.yaml --quiet -o " + output,
            "\"$T\" simulate sweep recipe.yaml --quiet -o " + output,
            "\"$T\" simulate light-field scene.yaml --views 2x2 --quiet -o " + output,
            "\"$T\" render lf --convert hci --quiet -o " + output};
  }
  static std::vector<std::string> ToAny(const std::string& output) {
    std::vector<std::string> all = ToFile(output);
    const std::vector<std::string> more = ToFolder(output);
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  void ExpectEachRefused(const std::vector<std::string>& scripts, const std::string& name) {
    for (const std::string& script : scripts) {
      SCOPED_TRACE(script);
      const Outcome outcome = Shell(script);
      ExpectRefused(outcome, outcome.exit_code == 2 ? 2 : 1, {name});
    }
  }
};

THICKLENS_SITUATION(HostileOutputs, AFolderThatMayNotBeWritten,
                    "The output's folder is read-only, or belongs to another user",
                    "Refused before any work with the output's name; nothing is created") {
  std::string why_not;
  fs::create_directory(Work("closed"));
  const std::string user = AsOrdinaryUser(&why_not);
  if (user.empty()) GTEST_SKIP() << why_not;
  ASSERT_EQ(::chmod(Work("closed").c_str(), 0555), 0);
  for (std::string script : ToAny("closed/new.png")) {
    SCOPED_TRACE(script);
    script.replace(script.find("\"$T\""), 4, user + " \"$T\"");
    ExpectRefused(Shell(script), 1, {"closed/new.png", "Permission denied"});
  }
}

THICKLENS_SITUATION(HostileOutputs, AnotherUsersFile,
                    "The output exists and belongs to another user, in a folder like `/tmp` in "
                    "which only owners may replace",
                    "Refused with the output's name; the older content stays, nothing is left "
                    "beside it") {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can make files of another user";
  std::string why_not;
  const std::string user = AsOrdinaryUser(&why_not);
  if (user.empty()) GTEST_SKIP() << why_not;
  Put("shared/theirs.json", "theirs");
  Put("shared/lf/lightfield.yaml", "theirs");
  ASSERT_EQ(::chmod(Work("shared").c_str(), 01777), 0);
  for (std::string script : {Explain("shared/theirs.json"), Estimate("shared/lf")}) {
    SCOPED_TRACE(script);
    script.replace(script.find("\"$T\""), 4, user + " \"$T\"");
    const Outcome outcome = Shell(script);
    ExpectRefused(outcome, 1, {"shared/"});
  }
}

THICKLENS_SITUATION(HostileOutputs, AReadOnlyFileSystem,
                    "The output lies in a file system that is mounted read-only",
                    "Refused before any work with the output's name and the reason") {
  SKIP_WITHOUT_MOUNTS();
  fs::create_directory(Work("ro"));
  for (const std::string& script : ToAny("ro/new.png")) {
    SCOPED_TRACE(script);
    ExpectRefused(Shell("unshare -m sh -c " +
                        Quoted("mount -t tmpfs none ro && mount -o remount,ro ro && " + script)),
                  1, {"ro/new", "Read-only file system"});
  }
}

THICKLENS_SITUATION(HostileOutputs, DevicesPipesAndSockets,
                    "The output is `/dev/full`, `/dev/null`, a named pipe or a socket",
                    "Refused with its name, at once; it stays unchanged") {
  ASSERT_EQ(::mkfifo(Work("pipe").c_str(), 0666), 0);
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  Work("socket").copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  for (const std::string name : {"/dev/full", "/dev/null", "pipe", "socket"})
    ExpectEachRefused(ToAny(name), name);
  ::close(socket);
}

THICKLENS_SITUATION(
    HostileOutputs, ADanglingLink, "The output is a link to nothing",
    "Refused with its name, as `cp` does; the link stays, and its target is not created") {
  fs::create_symlink("nothing", Work("dangling"));
  ExpectEachRefused(ToAny("dangling"), "dangling");
}

THICKLENS_SITUATION(HostileOutputs, ALoopOfLinks, "The output is a link that leads back to itself",
                    "Refused with its name; the link stays") {
  fs::create_symlink("loop", Work("pool"));
  fs::create_symlink("pool", Work("loop"));
  ExpectEachRefused(ToAny("loop"), "loop");
}

THICKLENS_SITUATION(HostileOutputs, PlacesThatAreNone,
                    "The output lies below a file, in a folder that does not exist, or is `.`, "
                    "`..`, `/`, the folder of the inputs, or a folder in place of a file",
                    "Refused with its name; nothing is created") {
  for (const std::string name : {"picture.png/new", "none/new", ".", "..", "/"})
    ExpectEachRefused(ToAny(name), name);
  for (const std::string name : {"lf", "lf/"}) ExpectEachRefused(ToFile(name), name);
  ExpectEachRefused(ToFolder("scene.yaml"), "scene.yaml");
}

THICKLENS_SITUATION(HostileOutputs, OneOutputUnderTwoNames,
                    "Two outputs of one command are the same file: spelled differently, or through "
                    "a link to the folder",
                    "Wrong usage, with the name") {
  fs::create_directory(Work("folder"));
  fs::create_directory_symlink("folder", Work("link"));
  const std::string command =
      "\"$T\" camera init --focal-mm 50 --f-number 2 --pitch-um 5 --size 10x10 -o ";
  ExpectRefused(Shell(command + "folder/a --json ./folder/../folder/a"), 2, {"a"});
  ExpectRefused(Shell(command + "folder/a --json link/a"), 2, {"link/a"});
}

THICKLENS_SITUATION(HostileOutputs, AnInputUnderAnotherName,
                    "The output is an input: through a hard link, a link, a link to its folder, "
                    "another spelling",
                    "Refused with the name; the input stays") {
  fs::create_hard_link(Work("camera.yaml"), Work("hard.yaml"));
  fs::create_symlink("camera.yaml", Work("soft.yaml"));
  fs::create_directory_symlink(".", Work("here"));
  for (const std::string name :
       {"camera.yaml", "hard.yaml", "soft.yaml", "here/camera.yaml", "././lf/../camera.yaml"})
    ExpectEachRefused({Explain(name)}, name);
}

THICKLENS_SITUATION(HostileOutputs, AMountPoint,
                    "The output folder is an empty mount point, such as that of `docker run -v`",
                    "The output is written into it, complete") {
  SKIP_WITHOUT_MOUNTS();
  fs::create_directory(Work("mount"));
  for (const std::string& script : ToFolder("mount")) {
    SCOPED_TRACE(script);
    const Outcome outcome =
        Shell("unshare -m sh -c " + Quoted("mount -t tmpfs none mount && " + script +
                                           " && find mount -type f | wc -l && find "
                                           "mount -name '.*'"));
    ExpectDone(outcome, {});
    EXPECT_GE(std::atoi(outcome.out.c_str()), 3) << outcome.out;
    EXPECT_THAT(outcome.out, ::testing::Not(HasSubstr("mount"))) << "hidden files";
  }
}

THICKLENS_SITUATION(
    HostileOutputs, AFolderThatIsReplacedDuringTheRun,
    "The folder of the output is renamed while the command runs, and another folder takes its name",
    "Done in one of the two folders, or refused; no file is left incomplete, and no file of the "
    "new folder is touched") {
  fs::create_directory(Work("out"));
  const Outcome outcome = Shell(
      "\"$T\" simulate sweep recipe.yaml --quiet -o out/new & p=$!; i=0; while [ -z \"$(ls -A "
      "out)\" ] && kill -0 $p 2>/dev/null && [ $i -lt 2000 ]; do i=$((i + 1)); done; kill -STOP "
      "$p; "
      "mv out moved; mkdir out; echo mine > out/letter; kill -CONT $p; wait $p; code=$?; rm "
      "out/letter; find out moved; exit $code");
  EXPECT_LE(outcome.exit_code, 1) << outcome.err;
  const bool is_there = fs::exists(Work("out/new")) || fs::exists(Work("moved/new"));
  EXPECT_EQ(is_there, outcome.exit_code == 0) << outcome.out;
  if (outcome.exit_code == 1) {
    EXPECT_THAT(ErrorsIn(outcome.err), ::testing::ElementsAre(HasSubstr("out/new")));
  }
  for (const char* folder : {"out", "moved"}) {
    for (const auto& [path, description] : TreeOf(Work(folder))) {
      EXPECT_EQ(path.rfind("new", 0), 0U) << folder << "/" << path << " is left over";
    }
  }
}

THICKLENS_SITUATION(HostileOutputs, TwoRunsOnOneOutput,
                    "Two runs write the same file, and the same folder, at the same time",
                    "At least one succeeds; the other succeeds or is refused with the output's "
                    "name; the output is complete") {
  for (const std::string& script : {Explain("new"), Estimate("new")}) {
    SCOPED_TRACE(script);
    fs::remove_all(Work("new"));
    const Outcome outcome = Shell("(" + script + "; echo $? > a) & (" + script +
                                  "; echo $? > b) & wait; cat a b; rm a b; " + script);
    ExpectNothingBut(outcome, {"new"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, AnyOf("0\n0\n", "0\n1\n", "1\n0\n"));
    for (const std::string& error : ErrorsIn(outcome.err)) EXPECT_THAT(error, HasSubstr("new"));
  }
}

THICKLENS_SITUATION(HostileOutputs, PermissionsThatTheUserWants,
                    "umask is 077, 027 or 000, and the output replaces an older one",
                    "Files and folders have the permissions that the umask leaves, no more") {
  for (const char* mask : {"077", "027", "000"}) {
    SCOPED_TRACE(mask);
    const std::string set = std::string("umask ") + mask + "; ";
    const auto bits = static_cast<mode_t>(~std::stoi(mask, nullptr, 8));
    for (int run = 0; run < 2; ++run) {
      EXPECT_EQ(Shell(set + Explain("new.json") + "; " + Estimate("new")).exit_code, 0);
      const auto mode = [&](const std::string& name) {
        struct stat status {};
        EXPECT_EQ(::stat(Work(name).c_str(), &status), 0) << name;
        return status.st_mode & 0777U;
      };
      EXPECT_EQ(mode("new.json"), 0666U & bits);
      EXPECT_EQ(mode("new"), 0777U & bits);
      EXPECT_EQ(mode("new/scene"), 0777U & bits);
      EXPECT_EQ(mode("new/scene/radiance.tiff"), 0666U & bits);
      EXPECT_EQ(mode("new/lightfield.yaml"), 0666U & bits);
    }
    fs::remove_all(Work("new"));
    fs::remove(Work("new.json"));
  }
}

THICKLENS_SITUATION(HostileOutputs, NoPermissionsAtAll,
                    "umask is 0777, so that users may not open the files that they create",
                    "Refused with the output's name, or done; nothing is left beside it") {
  std::string why_not;
  const std::string user = AsOrdinaryUser(&why_not);
  if (user.empty()) GTEST_SKIP() << why_not;
  for (std::string script : {Explain("new"), Estimate("new")}) {
    SCOPED_TRACE(script);
    script.replace(script.find("\"$T\""), 4, user + " \"$T\"");
    const Outcome outcome = Shell("umask 0777; " + script);
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    ExpectNothingBut(outcome, {"new"});
    fs::remove_all(Work("new"));
  }
}

}  // namespace
}  // namespace thicklens::hostile
