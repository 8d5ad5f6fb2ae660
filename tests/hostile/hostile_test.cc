#include "hostile/hostile_test.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "support/test_cameras.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field.h"
#include "tools/system/program_run.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::TestCamera;
using thicklens::testing::TestSensor;
using thicklens::testing::ThinLens;
using thicklens::testing::WithMethod;

constexpr int kWidthPx = 24, kHeightPx = 16;
constexpr unsigned kNobody = 65534;

constexpr char kScene[] = R"(schema: thicklens/simulate-scene/1
camera: camera.yaml
size_px: [24, 16]
layers:
  - plane: {depth_mm: 301, slope: [0.4, 0]}
    texture: {kind: noise, colour: [0.5, 0.5, 0.45]}
)";

model::Camera SmallCamera() {
  model::Camera camera =
      TestCamera("small", ThinLens(50, 8.9286),
                 TestSensor(kWidthPx, kHeightPx, 0.0045, {11.5, 7.5}), {60, 0.001}, {0.45, 0.002});
  camera.calibration->blur_floor_px = model::Estimate{0.5, 0.01};
  return WithMethod(camera);
}

// An image whose values differ from pixel to pixel.
model::EncodedImage SmallImage() {
  model::EncodedImage image{kWidthPx, kHeightPx, 3, 8, {}};
  for (int i = 0; i < kWidthPx * kHeightPx * 3; ++i)
    image.values.push_back(static_cast<std::uint16_t>(60 + i * 37 % 120));
  return image;
}

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string PathOf(const std::string& change) { return change.substr(change.find(' ') + 1); }

// Messages are for people, and nobody reads one that is longer than this.
constexpr std::size_t kLongestMessageBytes = 6000;

}  // namespace

std::string Repeated(const std::string& text, int times) {
  std::string repeated;
  for (int i = 0; i < times; ++i) repeated += text;
  return repeated;
}

std::string Quoted(const std::string& text) { return tools::ShellCommand({text}); }

std::vector<std::string> ErrorsIn(const std::string& err) {
  constexpr char kPrefix[] = "thicklens: error: ";
  std::vector<std::string> errors;
  for (const std::string& line : LinesOf(err)) {
    if (line.rfind(kPrefix, 0) == 0) errors.push_back(line.substr(sizeof kPrefix - 1));
  }
  return errors;
}

HostileTest::HostileTest() {
  for (const char* folder : {"work", "tmp", "run"}) fs::create_directory(root_ / folder);
  const model::Camera camera = SmallCamera();
  Put("camera.yaml", model::CameraToYaml(camera));
  Put("picture.png", io::EncodePng(SmallImage()));
  model::RawDepthMap depth{kWidthPx, kHeightPx, {}};
  for (int i = 0; i < kWidthPx * kHeightPx; ++i)
    depth.values.push_back(301.0F + 0.01F * static_cast<float>(i % kWidthPx));
  Put("depth.pfm", io::EncodePfm(depth));
  Put("scene.yaml", kScene);
  Put("recipe.yaml",
      "schema: thicklens/simulate-sweep/1\n"
      "camera: " THICKLENS_SOURCE_DIR
      "/configs/cameras/case-ii.yaml\n"
      "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
      "size_px: [96, 96]\n"
      "target: {kind: dead-leaves, contrast: 0.6}\n"
      "bench: {first_depth_mm: 290, step_mm: 2, frames: 11, reading_sigma_mm: 0.05}\n"
      "noise: {full_well_electrons: 10000}\n");

  model::LightField light_field = model::MakeLightField(kWidthPx, kHeightPx, 2, 2, 3);
  for (std::size_t i = 0; i < light_field.values.size(); ++i)
    light_field.values[i] = 0.2F + 0.01F * static_cast<float>(i * 37 % 50);
  OutputFolder folder(Work("lf"), io::kLightFieldMarker, io::LightFieldEntries());
  io::WriteLightField(light_field, io::ViewFormat::kPng, &folder);
  folder.Commit();
}

Outcome HostileTest::Shell(const std::string& script, double limit_seconds) {
  const std::string whole = "T=" + Quoted(THICKLENS_PROGRAM) +
                            "\nexport T\nTMPDIR=" + Quoted(root_ / "tmp") + "\nexport TMPDIR\ncd " +
                            Quoted(root_ / "work") + " || exit 99\n" + script;
  const FolderTree before = TreeOf(root_ / "work");
  // `timeout` ends the whole group of processes, RunProgram only the process that it started.
  const tools::ProgramRun run = tools::RunProgram(
      "/usr/bin/timeout",
      {"-s", "KILL", std::to_string(static_cast<int>(limit_seconds)), "/bin/sh", "-c", whole},
      root_ / "run", limit_seconds + 10);
  Outcome outcome;
  constexpr int kKilled = 137;
  outcome.exit_code = run.exit_code;
  outcome.timed_out = run.timed_out || run.signal == SIGKILL ||
                      (run.exit_code == kKilled && run.seconds >= limit_seconds);
  outcome.seconds = run.seconds;
  outcome.out = run.out;
  outcome.err = run.err;
  outcome.changes = Changes(before, TreeOf(root_ / "work"));
  EXPECT_FALSE(outcome.timed_out) << "after " << limit_seconds << " s:\n" << script;
  EXPECT_THAT(TreeOf(root_ / "tmp"), IsEmpty()) << "left among the temporary files by\n" << script;
  return outcome;
}

void HostileTest::ExpectRefused(const Outcome& outcome, int exit_code,
                                const std::vector<std::string>& reported) const {
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  const std::vector<std::string> errors = ErrorsIn(outcome.err);
  EXPECT_EQ(errors.size(), 1U) << outcome.err.substr(0, kLongestMessageBytes);
  for (const std::string& error : errors) {
    EXPECT_LE(error.size(), kLongestMessageBytes);
    EXPECT_EQ(thicklens::PrintableUtf8(error), error);
    for (const std::string& text : reported)
      EXPECT_THAT(error.substr(0, kLongestMessageBytes), HasSubstr(text));
  }
  EXPECT_THAT(outcome.changes, IsEmpty());
}

void HostileTest::ExpectDone(const Outcome& outcome,
                             const std::vector<std::string>& changes) const {
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(ErrorsIn(outcome.err), IsEmpty());
  EXPECT_THAT(outcome.changes, ElementsAreArray(changes));
}

void HostileTest::ExpectNothingBut(const Outcome& outcome,
                                   const std::vector<std::string>& outputs) const {
  for (const std::string& change : outcome.changes) {
    EXPECT_THAT(outputs, ::testing::Contains(PathOf(change))) << change << "\n" << outcome.err;
  }
}

void HostileTest::MakeSweep() {
  ExpectDone(Shell("\"$T\" simulate sweep recipe.yaml -o sweep --quiet"), {"new sweep"});
}

std::string HostileTest::AsOrdinaryUser(std::string* why_not) {
  if (::geteuid() != 0) return "env";
  ::chmod(root_.path().c_str(), 0755);
  for (const char* folder : {"work", "tmp"}) {
    if (::chown((root_ / folder).c_str(), kNobody, kNobody) != 0) *why_not = "chown failed";
  }
  for (const auto& entry : fs::recursive_directory_iterator(root_ / "work")) {
    if (::lchown(entry.path().c_str(), kNobody, kNobody) != 0) *why_not = "chown failed";
  }
  const std::string user = "setpriv --reuid 65534 --regid 65534 --clear-groups";
  const Outcome outcome = Shell(user + " \"$T\" --version");
  if (outcome.exit_code == 0) return user;
  *why_not = "the program cannot be started as the user nobody: " + outcome.err;
  return "";
}

bool HostileTest::HasMountNamespaces(std::string* why_not) {
  if (::geteuid() != 0) {
    *why_not = "file systems are mounted by root only";
    return false;
  }
  testing::TemporaryFolder folder;
  const tools::ProgramRun run = tools::RunProgram(
      "/bin/sh", {"-c", "mkdir m && unshare -m sh -c 'mount -t tmpfs none m'"}, folder.path(), 20);
  if (run.exit_code == 0) return true;
  *why_not = "no mount namespace can be had here: " + run.err;
  return false;
}

std::string HostileTest::Explain(const std::string& output) {
  return "\"$T\" explain camera.yaml --depth-range 290:310 --quiet --json " + output;
}

std::string HostileTest::Estimate(const std::string& output) {
  return "\"$T\" estimate picture.png depth.pfm --depth-kind z --depth-unit mm --camera "
         "camera.yaml --views 2x2 --quiet -o " +
         output;
}

std::string HostileTest::Render(const std::string& output) {
  return "\"$T\" render lf --as-captured --quiet -o " + output;
}

std::string HostileTest::Calibrate(const std::string& output) {
  return "\"$T\" calibrate sweep --no-field --quiet -o " + output;
}

}  // namespace thicklens::hostile
