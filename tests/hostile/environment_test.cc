// Environment variables that are missing, wrong or absurd.
#include <unistd.h>

#include <filesystem>

#include "hostile/hostile_test.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

class HostileEnvironment : public HostileTest {
 protected:
  // Returns the results of estimate and calibrate, without what differs from run to run.
  std::string Results(const std::string& name) {
    return testing::ContentOf(Work(name + "/scene/radiance.tiff")) +
           testing::ContentOf(Work(name + "/scene/disparity.tiff")) +
           testing::ContentOf(Work(name + "/scene/confidence.png"));
  }
  // Each setting gives the outputs of a usual run.
  void ExpectNoDifference(const std::vector<std::string>& settings) {
    ExpectDone(Shell(Estimate("usual")), {"new usual"});
    ExpectDone(Shell(Explain("usual.json")), {"new usual.json"});
    Put("grey.pgm", "P5\n2 2\n255\nabcd");
    for (const std::string& setting : settings) {
      SCOPED_TRACE(setting);
      ExpectDone(Shell("export " + setting + "; " + Estimate("new") + " && " + Explain("new.json") +
                       " && \"$T\" compare grey.pgm grey.pgm --quiet"),
                 {"new new", "new new.json"});
      EXPECT_EQ(Results("new"), Results("usual"));
      EXPECT_EQ(testing::ContentOf(Work("new.json")), testing::ContentOf(Work("usual.json")));
      fs::remove_all(Work("new"));
      fs::remove(Work("new.json"));
    }
  }
};

THICKLENS_SITUATION(HostileEnvironment, NoneAtAll,
                    "The environment is empty; HOME is not set; PATH is empty",
                    "The result is the same as usual") {
  ExpectNoDifference({"PATH=", "HOME=/nonexistent", "HOME= XDG_CACHE_HOME= XDG_CONFIG_HOME="});
  for (const char* start : {"env -i ", "env -u HOME -u PATH -u USER "})
    ExpectDone(Shell(start + Explain("new.json") + "; rm new.json"), {});
}

THICKLENS_SITUATION(HostileEnvironment, TemporaryFolders,
                    "TMPDIR does not exist, is a file, may not be written, is relative or empty",
                    "Commands that do not need it succeed; the others refuse it with its name; "
                    "nothing is left in the current folder") {
  Put("file", "");
  for (const char* folder : {"/nonexistent", "file", "/proc", ".", "relative", "''"}) {
    SCOPED_TRACE(folder);
    const std::string set = std::string("TMPDIR=") + folder + " ";
    ExpectDone(Shell(set + Estimate("new")), {"new new"});
    fs::remove_all(Work("new"));
    const Outcome outcome = Shell(set + "\"$T\" doctor --hard-cases --only optics/none");
    EXPECT_LE(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.changes, ::testing::IsEmpty());
  }
}

THICKLENS_SITUATION(
    HostileEnvironment, ADecimalComma,
    "LC_ALL is de_DE, which has decimal commas and dots between thousands",
    "Numbers in all outputs have decimal points; inputs with decimal points are read") {
  const Outcome made =
      Shell("mkdir ../locales && localedef -i de_DE -f UTF-8 ../locales/de_DE.UTF-8");
  const std::string set = "LOCPATH=" + Quoted(Beside("locales")) + " LC_ALL=de_DE.UTF-8";
  const Outcome known = Shell("export " + set + "; /usr/bin/printf '%.1f' 1,5");
  if (known.out != "1,5") GTEST_SKIP() << "the locale de_DE cannot be had here: " << made.err;
  ExpectNoDifference({set});
  MakeSweep();
  ExpectDone(Shell(Calibrate("usual.yaml")), {"new usual.yaml"});
  ExpectDone(Shell("export " + set + "; " + Calibrate("new.yaml")), {"new new.yaml"});
  const auto without_date = [&](const std::string& name) {
    const Outcome outcome = Shell("grep -v date: " + name);
    return outcome.out;
  };
  EXPECT_EQ(without_date("new.yaml"), without_date("usual.yaml"));
}

THICKLENS_SITUATION(HostileEnvironment, LocalesThatAreNone,
                    "LC_ALL, LANG and LANGUAGE name no locale, a path, a format, or are very long",
                    "The result is the same as usual") {
  ExpectNoDifference({"LC_ALL=xx_YY.nope", "LC_ALL=../../../../etc", "LANG=%s%n",
                      "LC_ALL=" + std::string(10000, 'x'), "LC_ALL=tr_TR.UTF-8 LANGUAGE=tr"});
}

THICKLENS_SITUATION(HostileEnvironment, TimeZones,
                    "TZ is empty, a path, very long, garbage, or 24 hours ahead",
                    "Dates in outputs are those of UTC") {
  for (const std::string& zone :
       std::vector<std::string>{"''", ":/etc/passwd", "../../etc/passwd", "XXX-24:59:59", "'<>'",
                                "%n%s", std::string(10000, 'T'), "XYZ24XYZ,M13.9.9"}) {
    SCOPED_TRACE(zone.substr(0, 60));
    const Outcome outcome =
        Shell("date -u +%Y-%m-%dT%H; export TZ=" + zone + "; " + Estimate("new") +
              " && grep date: new/lightfield.yaml; rm -r new; date -u "
              "+%Y-%m-%dT%H");
    ExpectDone(outcome, {});
    const std::string hour = outcome.out.substr(0, 13),
                      later = outcome.out.substr(outcome.out.size() - 14, 13);
    EXPECT_THAT(outcome.out,
                ::testing::AnyOf(HasSubstr("date: " + hour), HasSubstr("date: " + later)));
    EXPECT_THAT(outcome.out, HasSubstr("Z\n"));
  }
}

THICKLENS_SITUATION(
    HostileEnvironment, SettingsOfOpenMpAndBlas,
    "OMP_NUM_THREADS is -1, 0, 1000000 or not a number, OMP_STACKSIZE 1k or 100G, OMP_THREAD_LIMIT "
    "1, OPENBLAS_NUM_THREADS 0, -5 or 1000000, GOMP_CPU_AFFINITY 999",
    "The result is the same as usual") {
  ExpectNoDifference({"OMP_NUM_THREADS=-1", "OMP_NUM_THREADS=0", "OMP_NUM_THREADS=1000000",
                      "OMP_NUM_THREADS=many", "OMP_STACKSIZE=1k", "OMP_STACKSIZE=100G",
                      "OMP_THREAD_LIMIT=1", "OMP_DYNAMIC=true OMP_NESTED=true OMP_SCHEDULE=odd",
                      "OPENBLAS_NUM_THREADS=0", "OPENBLAS_NUM_THREADS=-5",
                      "OPENBLAS_NUM_THREADS=1000000", "OPENBLAS_CORETYPE=none",
                      "GOMP_CPU_AFFINITY=999"});
}

THICKLENS_SITUATION(
    HostileEnvironment, SettingsOfOpenCl,
    "POCL_CACHE_DIR is `/dev/null`, a file or the current folder, POCL_DEVICES and OCL_ICD_VENDORS "
    "name things that do not exist",
    "The result is the same as usual, and nothing is created in the current folder") {
  ExpectNoDifference({"POCL_CACHE_DIR=/dev/null", "POCL_CACHE_DIR=$PWD/camera.yaml",
                      "POCL_DEVICES=none", "OCL_ICD_VENDORS=/nonexistent",
                      "OCL_ICD_FILENAMES=none.so", "CL_CONFIG_USE_VECTORIZER=maybe"});
}

THICKLENS_SITUATION(HostileEnvironment, SettingsOfOpenCv,
                    "OPENCV_DUMP_ERRORS, OPENCV_IO_MAX_IMAGE_PIXELS and others have values that "
                    "OpenCV refuses, OPENCV_TRACE is on, limits are 1",
                    "The result is the same as usual, and OpenCV creates no file") {
  ExpectNoDifference({"OPENCV_DUMP_ERRORS=odd", "OPENCV_DUMP_CONFIG=odd", "OPENCV_TRACE=1",
                      "OPENCV_TRACE=odd", "OPENCV_BUFFER_AREA_ALWAYS_SAFE=odd",
                      "OPENCV_IO_MAX_IMAGE_PIXELS=odd", "OPENCV_IO_MAX_IMAGE_PIXELS=1",
                      "OPENCV_IO_MAX_IMAGE_WIDTH=1", "OPENCV_FOR_THREADS_NUM=odd",
                      "OPENCV_FOR_THREADS_NUM=-7", "OPENCV_OPENCL_RUNTIME=odd",
                      "OPENCV_CPU_DISABLE=odd", "OPENCV_TEMP_PATH=/dev/null",
                      "OPENCV_LOG_LEVEL=VERBOSE", "OPENCV_SKIP_CPU_BASELINE_CHECK=odd"});
}

THICKLENS_SITUATION(HostileEnvironment, SettingsOfOtherLibraries,
                    "Variables of glog, the C library's allocator and TIFF have absurd values",
                    "The result is the same as usual, and no log is written") {
  ExpectNoDifference({"GLOG_minloglevel=-7 GLOG_v=9 GLOG_logtostderr=odd", "GLOG_log_dir=$PWD",
                      "MALLOC_ARENA_MAX=-1 MALLOC_PERTURB_=165 MALLOC_CHECK_=odd",
                      "COLUMNS=0 TERM= NO_COLOR= CLICOLOR_FORCE=1"});
}

}  // namespace
}  // namespace thicklens::hostile
