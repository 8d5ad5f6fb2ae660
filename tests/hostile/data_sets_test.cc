// Data sets from untrusted sources: light fields and sweeps that contain traps, and a current
// folder with files whose names programs look for.
#include <unistd.h>

#include <filesystem>

#include "hostile/hostile_test.h"
#include "support/sanitizers.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class HostileDataSets : public HostileTest {
 protected:
  // Replaces one line of the description of lf.
  void ChangeDescription(const std::string& key, const std::string& value) {
    std::string text = testing::ContentOf(Work("lf/lightfield.yaml"));
    const std::size_t begin = text.find("\n" + key + ":");
    ASSERT_NE(begin, std::string::npos) << key;
    const std::size_t end = text.find('\n', begin + 1);
    Put("lf/lightfield.yaml", text.replace(begin, end - begin, "\n" + key + ": " + value));
  }
};

THICKLENS_SITUATION(
    HostileDataSets, ALightFieldThatNamesFilesElsewhere,
    "The description of a light field names as its camera `../../../etc/passwd`, "
    "`/etc/passwd`, or a link to it",
    "Refused with the line and without opening the file; the link is refused with its name") {
  ExpectDone(Shell(Estimate("with-camera")), {"new with-camera"});
  fs::remove_all(Work("lf"));
  fs::rename(Work("with-camera"), Work("lf"));
  const std::string up = Repeated("../", 20) + "etc/passwd";
  for (const std::string& name :
       std::vector<std::string>{up, "/etc/passwd", "views/" + up, "./x/../" + up}) {
    SCOPED_TRACE(name);
    ChangeDescription("camera", name);
    const Outcome outcome = Shell(Render("new.png"));
    ExpectRefused(outcome, 1, {"lightfield.yaml:", "camera", name});
    EXPECT_THAT(outcome.err, Not(HasSubstr("root")));
  }
  ChangeDescription("camera", "camera.yaml");
  fs::remove(Work("lf/camera.yaml"));
  fs::create_symlink("/etc/passwd", Work("lf/camera.yaml"));
  ExpectRefused(Shell(Render("new.png")), 1, {"camera.yaml"});
}

THICKLENS_SITUATION(HostileDataSets, ViewsThatAreLinksElsewhere,
                    "Views of a light field are links to an image elsewhere, to `/etc/passwd` and "
                    "to a file that may not be read",
                    "An image is read; everything else is refused with the name of the view, and "
                    "its content is not shown") {
  const std::string view = Work("lf/views/view_00_01.png");
  fs::rename(view, Work("elsewhere.png"));
  fs::create_symlink("../../elsewhere.png", view);
  ExpectDone(Shell(Render("new.png")), {"new new.png"});
  fs::remove(view);
  fs::create_symlink("/etc/passwd", view);
  const Outcome outcome = Shell(Render("new2.png"));
  ExpectRefused(outcome, 1, {"view_00_01.png", "cannot be decoded"});
  EXPECT_THAT(outcome.err, Not(HasSubstr("root")));
}

THICKLENS_SITUATION(HostileDataSets, ALightFieldOfHugeViews,
                    "The description of a light field announces 100,000 x 100,000 pixels, or 1,000 "
                    "x 1,000 views; the files have 24 x 16",
                    "Refused with the view or the sizes, at once and with little memory") {
  const std::string limit = testing::kIsSanitized ? "" : "ulimit -v 4000000; ";
  for (const std::string size : {"[100000, 100000]", "[9000, 9000]"}) {
    SCOPED_TRACE(size);
    ChangeDescription("size", size);
    ExpectRefused(Shell(limit + Render("new.png"), 60), 1,
                  {"lf", "24x16", size.substr(1, size.find(',') - 1)});
  }
  ChangeDescription("size", "[24, 16]");
  ChangeDescription("views", "[1000, 1000]");
  ExpectRefused(Shell(limit + Render("new.png"), 60), 1, {"lightfield.yaml:", "weights"});
}

THICKLENS_SITUATION(HostileDataSets, AnOlderOutputWithLinksInIt,
                    "The older light field at the place of the output has a `views` folder, or a "
                    "view, that is a link to the user's own files",
                    "Replaced or refused; what the links lead to stays as it was") {
  Put("mine/view_00_00.png", "mine");
  Put("mine/letter.txt", "mine, too");
  for (const bool whole_folder : {true, false}) {
    SCOPED_TRACE(whole_folder);
    fs::remove_all(Work("out"));
    fs::copy(Work("lf"), Work("out"), fs::copy_options::recursive);
    if (whole_folder) {
      fs::remove_all(Work("out/views"));
      fs::create_directory_symlink("../mine", Work("out/views"));
    } else {
      fs::remove(Work("out/views/view_00_00.png"));
      fs::create_symlink("../../mine/view_00_00.png", Work("out/views/view_00_00.png"));
    }
    const Outcome outcome = Shell(Estimate("out"));
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    EXPECT_EQ(testing::ContentOf(Work("mine/view_00_00.png")), "mine");
    EXPECT_EQ(testing::ContentOf(Work("mine/letter.txt")), "mine, too");
  }
}

THICKLENS_SITUATION(
    HostileDataSets, LibrariesInTheCurrentFolder,
    "The current folder contains libraries with the names of libraries that the program loads",
    "They are not loaded") {
  const Outcome needed = Shell("LD_TRACE_LOADED_OBJECTS=1 \"$T\"; readelf -d \"$T\" 2>/dev/null");
  ASSERT_THAT(needed.out, HasSubstr("libcsv.so"));
  // A file that is not a library stops any program that tries to load it.
  ExpectDone(Shell("LD_TRACE_LOADED_OBJECTS=1 \"$T\" | while read name arrow rest; do case $name "
                   "in *.so*) echo trap > \"${name##*/}\";; esac; done; rm -f ld-linux*; ls | "
                   "grep -c '\\.so' > count; mkdir traps; mv *.so* traps; test $(cat count) -gt "
                   "20"),
             {"new count", "new traps"});
  ExpectDone(Shell("cd traps; \"$T\" explain ../camera.yaml --depth-range 290:310 --quiet"), {});
  // This library is loaded as soon as an image needs it: a bitmap of 2 x 2 px.
  ExpectDone(
      Shell("cd traps; echo trap > thicklens_image_library.so; printf '"
            "BM\\106\\0\\0\\0\\0\\0\\0\\0\\066\\0\\0\\0\\050\\0\\0\\0"
            "\\002\\0\\0\\0\\002\\0\\0\\0\\001\\0\\030\\0\\0\\0\\0\\0\\020\\0\\0\\0"
            "\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0"
            "abcdef\\0\\0ghijkl\\0\\0' > ../a.bmp; \"$T\" compare ../a.bmp ../a.bmp --quiet"),
      {"new a.bmp", "new traps/thicklens_image_library.so"});
}

THICKLENS_SITUATION(HostileDataSets, SettingsInTheCurrentFolder,
                    "The current folder contains profiles, and XDG_CONFIG_HOME, HOME, "
                    "XDG_CACHE_HOME or POCL_CACHE_DIR is relative",
                    "No profile and no compiled kernel is read from there or written there") {
  for (const char* folder : {"thicklens", ".config/thicklens"})
    Put(std::string(folder) + "/profile.json", "a trap");
  for (const char* variables : {"XDG_CONFIG_HOME=.", "XDG_CONFIG_HOME= HOME=."}) {
    SCOPED_TRACE(variables);
    ExpectDone(Shell(std::string("env ") + variables + " " + Estimate("new --within 3600s")),
               {"new new"});
    fs::remove_all(Work("new"));
  }
  for (const char* variable : {"XDG_CACHE_HOME=.", "POCL_CACHE_DIR=cache"}) {
    SCOPED_TRACE(variable);
    // If there is no device, the option is refused.
    const Outcome outcome =
        Shell(std::string("env ") + variable + " " + Estimate("new --device opencl"));
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    ExpectNothingBut(outcome, {"new"});
    fs::remove_all(Work("new"));
  }
}

}  // namespace
}  // namespace thicklens::hostile
