// Every kind of object that a name can refer to instead of a file, for every input of every
// command.
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>
#include <random>

#include "hostile/hostile_images.h"
#include "hostile/hostile_test.h"
#include "support/sanitizers.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;

// Each command with an @ in the place of each of its inputs in turn. The output is called new.
const std::vector<std::string>& Slots() {
  static const std::string estimate =
      "estimate picture.png depth.pfm --depth-kind z --depth-unit "
      "mm --camera camera.yaml -o new ";
  static const std::string depth = " --depth-kind z --depth-unit mm ";
  static const std::vector<std::string> slots = {
      "explain @ --depth-range 290:310", "explain camera.yaml --depth @" + depth,
      "estimate @ depth.pfm" + depth + "--camera camera.yaml -o new",
      "estimate picture.png @" + depth + "--camera camera.yaml -o new",
      "estimate picture.png depth.pfm" + depth + "--camera @ -o new",
      "estimate @ --camera camera.yaml -o new", "depth extract @ -o new.pfm",
      "plan @ --focus-mm 300 -o new", "frames average @ -o new.tif",
      "frames defects --dark @ -o new.txt", "frames defects --flat @ -o new.png",
      "undistort picture.png --distortion @ -o new", "undistort picture.png --camera @ -o new",
      "undistort @ --distortion calibration.yml -o new",
      "undistort @ --depth --distortion calibration.yml -o new",
      "calibrate one.yaml --distortion @ -o new", estimate + "--distortion @",
      estimate + "--profile @ --within 3600s", estimate + "--aperture-of @",
      "render @ --as-captured -o new.png", "compare @ picture.png", "compare picture.png @",
      "compare lf lf --dibr @ depth.pfm" + depth, "compare lf lf --dibr picture.png @" + depth,
      "calibrate @ -o new", "calibrate frames --readings @ --camera camera.yaml -o new",
      "calibrate one.yaml --camera @ -o new", "calibrate one.yaml --truth @ -o new",
      "calibrate one.yaml --floor-from @ -o new", "simulate sweep @ -o new",
      "simulate image @ -o new", "simulate light-field @ -o new", "report @ -o new",
      "report lf --photo @ --depth depth.pfm --depth-kind disparity -o new",
      "report lf --photo picture.png --depth @ --depth-kind disparity -o new",
      "report lf --truth @ -o new", "report lf --sweep @ -o new",
      "report lf --calibration @ -o new", "report lf --estimate @ -o new",
      "report lf --comparison @ -o new",
      "camera init --from-exif @ --focal-mm 50 --f-number 2 --pitch-um 5 -o new",
      // Inputs that other files name.
      "calibrate sweep-of-it.yaml -o new", "calibrate camera-of-it.yaml -o new",
      "simulate image texture-of-it.yaml -o new", "simulate image scene-of-it.yaml -o new",
      "render views-of-it --as-captured -o new.png"};
  return slots;
}

class HostileInputs : public HostileTest {
 protected:
  HostileInputs() {
    fs::create_directory(Work("frames"));
    fs::copy(Work("picture.png"), Work("frames/a.png"));
    Put("calibration.yml",
        "image_size: [64, 48]\nK: [90, 0, 32, 0, 90, 24, 0, 0, 1]\n"
        "D: [-0.1, 0, 0, 0]\n");
    Put("one.yaml",
        "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes:\n"
        "  - {image: frames/a.png, reading_mm: 1}\n");
  }

  // Makes the files that name the input `name`.
  void NameInFiles(const std::string& name) {
    // The sensor is large enough for a calibration to start.
    std::string sweep = "schema: thicklens/sweep/1\ncamera: " THICKLENS_SOURCE_DIR
                        "/configs/cameras/case-ii.yaml\nframes:\n  - {image: " +
                        name + ", reading_mm: 1}\n";
    for (int reading_mm = 2; reading_mm < 7; ++reading_mm) {
      const std::string file = "other-" + std::to_string(reading_mm) + ".png";
      constexpr int kSidePx = 512;
      Put(file, PngOf(kSidePx, kSidePx, 8, 0, Deflated(std::string(kSidePx * (kSidePx + 1), 0))));
      sweep += "  - {image: " + file + ", reading_mm: " + std::to_string(reading_mm) + "}\n";
    }
    Put("sweep-of-it.yaml", sweep);
    Put("camera-of-it.yaml", "schema: thicklens/sweep/1\ncamera: " + name +
                                 "\nframes:\n  - {image: frames/a.png, reading_mm: 1}\n");
    std::string scene = testing::ContentOf(Work("scene.yaml"));
    const std::size_t kind = scene.find("kind: noise");
    scene.replace(kind, scene.find('}', kind) - kind, "kind: image, image: " + name);
    Put("texture-of-it.yaml", scene);
    scene = testing::ContentOf(Work("scene.yaml"));
    const std::string camera = "camera: camera.yaml";
    scene.replace(scene.find(camera), camera.size(), "camera: " + name);
    Put("scene-of-it.yaml", scene);
    fs::copy(Work("lf"), Work("views-of-it"), fs::copy_options::recursive);
    fs::remove(Work("views-of-it/views/view_00_01.png"));
    fs::create_symlink("../../" + name, Work("views-of-it/views/view_00_01.png"));
  }

  // Every command refuses the input and names it, soon and with little memory. `usual` is how a
  // program is started.
  void ExpectEachRefusesIt(const std::string& name, const std::string& start = "") {
    for (const std::string& slot : Slots()) {
      std::string arguments = slot;
      if (arguments.find('@') != std::string::npos) arguments.replace(arguments.find('@'), 1, name);
      SCOPED_TRACE(arguments);
      constexpr int kSoon = 60;
      const std::string limit = testing::kIsSanitized ? "" : "ulimit -v 4000000; ";
      const Outcome outcome = Shell(limit + start + " \"$T\" " + arguments, kSoon);
      const int code = outcome.exit_code == 2 ? 2 : 1;
      // The name of a view is relative to its folder.
      const bool is_view = slot.rfind("render views-", 0) == 0;
      if (outcome.timed_out) return;  // the other commands would time out as well
      ExpectRefused(outcome, code, {is_view ? "view_00_01.png" : name});
    }
  }
};

THICKLENS_SITUATION(HostileInputs, AnEmptyFile,
                    "Every input of every command in turn is an empty file",
                    "Refused with the name of the file; no output") {
  Put("void", "");
  NameInFiles("void");
  ExpectEachRefusesIt("void");
}

THICKLENS_SITUATION(HostileInputs, RandomBytes,
                    "Every input of every command in turn is a file of random bytes",
                    "Refused with the name of the file; no output") {
  std::mt19937 engine(5);
  std::string bytes;
  for (int i = 0; i < 5000; ++i) bytes += static_cast<char>(engine() & 0xFFU);
  Put("noise", bytes);
  NameInFiles("noise");
  ExpectEachRefusesIt("noise");
}

THICKLENS_SITUATION(HostileInputs, AFolder,
                    "Every input of every command in turn is an empty folder",
                    "Refused with the name of the folder; no output") {
  fs::create_directory(Work("folder"));
  NameInFiles("folder");
  ExpectEachRefusesIt("folder");
}

THICKLENS_SITUATION(HostileInputs, ADanglingLink,
                    "Every input of every command in turn is a link to nothing",
                    "Refused with the name of the link; no output") {
  fs::create_symlink("nothing", Work("dangling"));
  NameInFiles("dangling");
  ExpectEachRefusesIt("dangling");
}

THICKLENS_SITUATION(HostileInputs, ALoopOfLinks,
                    "Every input of every command in turn is a link that leads back to itself",
                    "Refused with the name of the link; no output") {
  fs::create_symlink("loop", Work("pool"));
  fs::create_symlink("pool", Work("loop"));
  NameInFiles("loop");
  ExpectEachRefusesIt("loop");
}

THICKLENS_SITUATION(HostileInputs, ANamedPipe,
                    "Every input of every command in turn is a named pipe that nobody writes to",
                    "Refused with its name, at once; no output") {
  ASSERT_EQ(::mkfifo(Work("pipe").c_str(), 0666), 0);
  NameInFiles("pipe");
  ExpectEachRefusesIt("pipe");
}

THICKLENS_SITUATION(HostileInputs, ASocket, "Every input of every command in turn is a socket",
                    "Refused with its name; no output") {
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(Work("socket").size(), sizeof address.sun_path);
  Work("socket").copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  NameInFiles("socket");
  ExpectEachRefusesIt("socket");
  ::close(socket);
}

THICKLENS_SITUATION(HostileInputs, ADeviceWithoutEnd,
                    "Every input of every command in turn is `/dev/zero`, through a link",
                    "Refused with its name, at once and with little memory; no output") {
  fs::create_symlink("/dev/zero", Work("zeros"));
  NameInFiles("zeros");
  ExpectEachRefusesIt("zeros");
}

THICKLENS_SITUATION(HostileInputs, ASparseFileOfATebibyte,
                    "Every input of every command in turn is a sparse file of 1 TiB",
                    "Refused with its name, at once and with little memory; no output") {
  Put("sparse", "");
  if (::truncate(Work("sparse").c_str(), off_t{1} << 40) != 0)
    GTEST_SKIP() << "the file system has no sparse files of that size";
  NameInFiles("sparse");
  ExpectEachRefusesIt("sparse");
}

THICKLENS_SITUATION(HostileInputs, AFileThatMayNotBeRead,
                    "Every input of every command in turn is a file that the user may not read",
                    "Refused with the name of the file and `Permission denied`; no output") {
  std::string why_not;
  Put("secret", "");
  NameInFiles("secret");
  const std::string start = AsOrdinaryUser(&why_not);
  if (start.empty()) GTEST_SKIP() << why_not;
  ASSERT_EQ(::chmod(Work("secret").c_str(), 0), 0);
  ExpectEachRefusesIt("secret", start);
}

THICKLENS_SITUATION(HostileInputs, AProcessSubstitution,
                    "An input is `/dev/stdin` behind a pipe, like a process substitution",
                    "Refused with its name, whether or not data arrive; no output") {
  for (const char* from : {"cat camera.yaml | ", "sleep 3 | "}) {
    for (const char* command :
         {"\"$T\" explain /dev/stdin --depth-range 290:310",
          "\"$T\" estimate /dev/stdin depth.pfm --depth-kind disparity -o new",
          "\"$T\" calibrate frames --readings /dev/stdin --camera camera.yaml -o new"}) {
      SCOPED_TRACE(std::string(from) + command);
      ExpectRefused(Shell(std::string(from) + command), 1, {"/dev/stdin"});
    }
  }
}

}  // namespace
}  // namespace thicklens::hostile
