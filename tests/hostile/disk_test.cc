// Disks that are full, over quota or broken, at each point of the writing.
#include <unistd.h>

#include <cerrno>
#include <filesystem>

#include "hostile/hostile_test.h"
#include "support/sanitizers.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class HostileDisk : public HostileTest {
 protected:
  // The commands, each of which writes disk/new. Some of them replace an older output.
  static std::vector<std::string> Writers() {
    return {Explain("disk/new"),
            Render("disk/new.png"),
            Estimate("disk/new"),
            Estimate("disk/new --store views"),
            Estimate("disk/new --format tiff"),
            "\"$T\" estimate picture.png depth.pfm --depth-kind z --depth-unit mm --camera "
            "camera.yaml --views 2x2 --quiet -o disk/new --json disk/new.json",
            "\"$T\" simulate image scene.yaml --quiet -o disk/new"};
  }

  // Mounts a file system with these options at disk, runs the command there, and prints which
  // entries were written and whether they are complete, that is, have the same names as `whole`.
  static std::string InDisk(const std::string& options, const std::string& script) {
    return "unshare -m sh -c " +
           Quoted("mount -t tmpfs -o " + options + " none disk || exit 98; " + script +
                  "; code=$?; find disk -mindepth 1 | sort; exit $code");
  }

  static bool IsOfNoSpace(const std::string& error) {
    for (const char* reason : {"No space left", "cannot be written"}) {
      if (error.find(reason) != std::string::npos) return true;
    }
    return false;
  }

  // Increases the disk from too small a size to one that is large enough. The command is refused
  // until the disk is large enough, and until then it leaves nothing there.
  void GrowDisk(const std::string& option, int first, int last) {
    fs::create_directory(Work("disk"));
    int refused = 0;
    for (const std::string& script : Writers()) {
      SCOPED_TRACE(script);
      const Outcome whole = Shell(InDisk("size=4m", script));
      ASSERT_EQ(whole.exit_code, 0) << whole.err;
      const std::string json = "disk/new.json\n";
      std::string all_but_json = whole.out;
      if (const auto at = all_but_json.find(json); at != std::string::npos)
        all_but_json.erase(at, json.size());
      int done = 0;
      for (int size = first; size <= last && done < 2; ++size) {
        SCOPED_TRACE(option + std::to_string(size));
        const Outcome outcome = Shell(InDisk(option + std::to_string(size), script));
        if (outcome.exit_code == 0) {
          ++done;
          EXPECT_EQ(outcome.out, whole.out);
          continue;
        }
        ++refused;
        EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
        // Either the earlier outputs are complete, or there is nothing.
        EXPECT_THAT(outcome.out, ::testing::AnyOf(IsEmpty(), json, all_but_json)) << outcome.err;
        const std::vector<std::string> errors = ErrorsIn(outcome.err);
        ASSERT_EQ(errors.size(), 1U) << outcome.err;
        EXPECT_THAT(errors[0], HasSubstr("disk/new"));
        EXPECT_TRUE(IsOfNoSpace(errors[0])) << errors[0];
      }
      EXPECT_GT(done, 0);
    }
    EXPECT_GT(refused, 20);
  }
};

THICKLENS_SITUATION(HostileDisk, ADiskThatIsTooSmall,
                    "Outputs go to a disk of 1, 2, 3, ... pages, up to a disk that is large enough",
                    "Refused with the output's name and the reason, and each output is complete or "
                    "absent; or done, and every output is complete") {
  SKIP_WITHOUT_MOUNTS();
  GrowDisk("nr_blocks=", 1, 40);
}

THICKLENS_SITUATION(HostileDisk, ADiskWithoutRoomForFiles,
                    "Outputs go to a disk that takes 1, 2, 3, ... files and folders more",
                    "As on a disk that is too small") {
  SKIP_WITHOUT_MOUNTS();
  GrowDisk("size=4m,nr_inodes=", 1, 40);
}

THICKLENS_SITUATION(HostileDisk, ALimitOnTheSizeOfFiles,
                    "`ulimit -f` allows files of 0, 512, 1,024 ... bytes; SIGXFSZ is ignored or "
                    "not",
                    "Refused with the output's name and `File too large`, or done; nothing is left "
                    "beside it") {
  for (const char* trap : {"", "trap '' XFSZ; "}) {
    for (const char* blocks : {"0", "1", "2", "8"}) {
      for (const std::string& script :
           {Explain("new.png"), Estimate("new.png"), Render("new.png")}) {
        SCOPED_TRACE(std::string(trap) + blocks + " " + script);
        // The limit holds for all files, so the standard output goes into a pipe.
        const Outcome outcome =
            Shell("{ (" + std::string(trap) + "ulimit -f " + blocks + "; exec " + script +
                  ") 2>&1; echo $? >code; } | cat >&2; read code "
                  "<code; rm code; exit $code");
        ExpectNothingBut(outcome, {"new.png"});
        EXPECT_EQ(fs::exists(Work("new.png")), outcome.exit_code == 0);
        if (outcome.exit_code != 0) {
          ASSERT_EQ(outcome.exit_code, 1) << outcome.err;
          EXPECT_THAT(ErrorsIn(outcome.err), ::testing::ElementsAre(HasSubstr("File too large")));
        }
        fs::remove_all(Work("new.png"));
      }
    }
  }
}

#ifdef THICKLENS_WRITE_FAULTS

class HostileWrites : public HostileTest {
 protected:
  // Lets the first call that writes fail, then the second and so on, until the command succeeds.
  // The previous output stays until the new one is complete.
  void FailEachCall(const std::string& script, int error, const std::string& reason) {
    SCOPED_TRACE(script + ", " + reason);
    ASSERT_EQ(Shell(script).exit_code, 0);
    const FolderTree older = TreeOf(Work("disk"));
    constexpr int kMaxCalls = 120;
    int failed = 0;
    for (int call = 1; call <= kMaxCalls; ++call) {
      SCOPED_TRACE(call);
      // Linked libraries write nothing there.
      const Outcome outcome =
          Shell("THICKLENS_FAULT_MARK=failed THICKLENS_WRITE_FAULT=" + std::to_string(call) + ":" +
                std::to_string(error) + ":" + Quoted(Work("disk/")) +
                " LD_PRELOAD=" + Quoted(THICKLENS_WRITE_FAULTS) + " " + script);
      if (!fs::exists(Work("failed"))) {
        EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
        EXPECT_GT(failed, 2);
        return;
      }
      fs::remove(Work("failed"));
      ++failed;
      // fsync may fail at the end, for example on a folder or where it is not supported. The output
      // is complete then.
      if (outcome.exit_code != 0) {
        EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
        EXPECT_THAT(ErrorsIn(outcome.err), ::testing::ElementsAre(::testing::AllOf(
                                               HasSubstr("disk/"), HasSubstr(reason))));
        EXPECT_THAT(Changes(older, TreeOf(Work("disk"))), IsEmpty());
      } else {
        std::vector<std::string> names, older_names;
        for (const auto& [path, content] : TreeOf(Work("disk"))) names.push_back(path);
        for (const auto& [path, content] : older) older_names.push_back(path);
        EXPECT_EQ(names, older_names);
      }
    }
    ADD_FAILURE() << "more than " << kMaxCalls << " calls";
  }
};

THICKLENS_SITUATION(
    HostileWrites, EachCallThatWritesFailsInTurn,
    "The first, the second, ... of the calls that create, write, sync or rename fails, and so do "
    "all later ones: no space is left, the quota is exceeded, or the disk has an error",
    "Refused with the output's name and the reason, the older output stays whole and nothing is "
    "left beside it; never an exit code of 0 without the complete output") {
  fs::create_directory(Work("disk"));
  FailEachCall(Explain("disk/new"), ENOSPC, "No space left on device");
  FailEachCall(Explain("disk/new"), EDQUOT, "Disk quota exceeded");
  FailEachCall(Explain("disk/new"), EIO, "Input/output error");
  fs::remove_all(Work("disk/new"));
  FailEachCall(Estimate("disk/new"), ENOSPC, "No space left on device");
  FailEachCall(Estimate("disk/new"), EDQUOT, "Disk quota exceeded");
  fs::remove_all(Work("disk/new"));
  FailEachCall(Estimate("disk/new --format tiff"), EIO, "Input/output error");
}

#endif  // THICKLENS_WRITE_FAULTS

}  // namespace
}  // namespace thicklens::hostile
