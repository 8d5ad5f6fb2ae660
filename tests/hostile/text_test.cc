// Text files that are wrong on purpose: YAML, tables, JSON.
#include <filesystem>

#include "hostile/hostile_test.h"
#include "support/sanitizers.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class HostileText : public HostileTest {
 protected:
  std::string Camera() const { return testing::ContentOf(Work("camera.yaml")); }
  // Returns camera.yaml with another value.
  std::string CameraWith(const std::string& from, const std::string& to) const {
    std::string camera = Camera();
    EXPECT_NE(camera.find(from), std::string::npos) << from << "\n" << camera;
    return camera.replace(camera.find(from), from.size(), to);
  }
  Outcome ExplainCamera(const std::string& content) {
    Put("hostile.yaml", content);
    const std::string limit = testing::kIsSanitized ? "" : "ulimit -v 2000000; ";
    return Shell(limit + "\"$T\" explain hostile.yaml --depth-range 290:310", 60);
  }
  void ExpectCameraRefused(const std::string& content,
                           const std::vector<std::string>& reported = {}) {
    std::vector<std::string> all = {"hostile.yaml"};
    all.insert(all.end(), reported.begin(), reported.end());
    ExpectRefused(ExplainCamera(content), 1, all);
  }
  Outcome CalibrateTable(const std::string& content) {
    fs::create_directory(Work("frames"));
    for (const char* name : {"a", "b", "c", "d", "e"}) {
      fs::copy(Work("picture.png"), Work(std::string("frames/") + name + ".png"),
               fs::copy_options::overwrite_existing);
    }
    Put("table.csv", content);
    return Shell(
        "\"$T\" calibrate frames --readings table.csv --camera camera.yaml --dry-run -o new", 60);
  }
};

THICKLENS_SITUATION(HostileText, AliasesThatMultiply,
                    "A YAML file has eleven lists, each of ten aliases of the one before",
                    "Refused with the key or value, at once and with little memory") {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string alias = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" +
            Repeated(alias + ", ", 9) + alias + "]\n";
  }
  ExpectCameraRefused(Camera() + bomb, {"unknown key 'a0'"});
  ExpectCameraRefused(bomb + CameraWith("name: small", "name: *a11"), {"unknown key 'a0'"});
}

THICKLENS_SITUATION(HostileText, NestingWithoutEnd,
                    "A YAML file opens 100,000 lists or maps within each other, in flow and block "
                    "style",
                    "Refused with line and column; no overflow of the stack") {
  ExpectCameraRefused(Camera() + "x: " + Repeated("[", 100000) + Repeated("]", 100000));
  ExpectCameraRefused(Camera() + "x: " + Repeated("{a: ", 100000));
  ExpectCameraRefused(Repeated("- ", 50000));
  ExpectCameraRefused(Repeated("? ", 50000));
  ExpectCameraRefused(Repeated(",", 1000000));
}

THICKLENS_SITUATION(HostileText, AnAnchorThatHoldsItself,
                    "A YAML list contains an alias of itself, and so does a map",
                    "Refused with the field; no endless loop") {
  ExpectCameraRefused(
      CameraWith("principal_point_px: [11.5, 7.5]", "principal_point_px: &p [*p, *p]"),
      {"principal_point_px"});
  ExpectCameraRefused("&r\n" + Camera() + "x: *r\n", {"unknown key 'x'"});
}

THICKLENS_SITUATION(HostileText, ANulByte, "A YAML file and a table contain NUL bytes",
                    "Refused with the file and the line") {
  ExpectCameraRefused(CameraWith("small", std::string("sm\0all", 6)), {"hostile.yaml:2", "NUL"});
  ExpectCameraRefused(Camera() + std::string(3, '\0'), {"NUL"});
  ExpectRefused(CalibrateTable(std::string("file,reading\na\0.png,3\n", 22)), 1,
                {"table.csv:2", "NUL"});
}

THICKLENS_SITUATION(HostileText, AByteOrderMarkAndCarriageReturns,
                    "YAML and a table begin with a byte order mark and end lines with CR LF",
                    "Read as if they had none") {
  std::string camera = "\xEF\xBB\xBF" + Camera();
  for (std::size_t at = 0; (at = camera.find('\n', at)) != std::string::npos; at += 2)
    camera.insert(at, "\r");
  ExpectDone(ExplainCamera(camera), {});
  ExpectDone(CalibrateTable("\xEF\xBB\xBF"
                            "file,reading\r\na.png,3\r\nb.png,4\r\nc.png,5\r\n"
                            "d.png,6\r\ne.png,7\r\n"),
             {});
}

THICKLENS_SITUATION(HostileText, Utf16, "A YAML file is UTF-16 with a byte order mark",
                    "Read as YAML defines it") {
  for (const bool is_big : {false, true}) {
    std::string wide = is_big ? "\xFE\xFF" : "\xFF\xFE";
    for (const char c : Camera()) wide += is_big ? std::string({'\0', c}) : std::string({c, '\0'});
    const Outcome outcome = ExplainCamera(wide);
    ExpectDone(outcome, {});
    EXPECT_THAT(outcome.out, HasSubstr("camera small"));
  }
}

THICKLENS_SITUATION(HostileText, Tabs, "YAML is indented by tabs", "Refused with line and column") {
  ExpectCameraRefused(CameraWith("\n  image_distance_mm", "\n\timage_distance_mm"),
                      {"hostile.yaml:"});
}

THICKLENS_SITUATION(HostileText, ValuesOfAMegabyte,
                    "A key, a name, a text and a number in a YAML file have a million characters",
                    "Refused with the place and the beginning of the value: a message of at most a "
                    "page") {
  const std::string big(1000000, '9');
  ExpectCameraRefused(Camera() + big + ": 1\n");
  ExpectCameraRefused(Camera() + "? " + big + "\n: 1\n");
  ExpectCameraRefused(CameraWith("width_px: 24", "width_px: " + big), {"sensor.width_px", "9999"});
  ExpectCameraRefused(CameraWith("psf: gaussian", "psf: " + big), {"psf", "9999"});
  ExpectCameraRefused(CameraWith("thicklens/camera/", big), {"schema", "9999"});
  ExpectCameraRefused("'" + big + "'", {"9999"});
}

THICKLENS_SITUATION(HostileText, AHundredThousandKeys,
                    "A YAML file has a map of 100,000 keys, 100,000 documents, or 50,000 anchors",
                    "Refused at the first error, within seconds") {
  std::string keys, anchors;
  for (int i = 0; i < 100000; ++i) keys += "k" + std::to_string(i) + ": 1\n";
  for (int i = 0; i < 50000; ++i) {
    const std::string name = "k" + std::to_string(i);
    anchors += name + ": &" + name + " 1\n";
  }
  ExpectCameraRefused(Camera() + keys, {"unknown key 'k0'"});
  ExpectCameraRefused(Camera() + anchors, {"unknown key 'k0'"});
  ExpectCameraRefused(Camera() + Repeated("psf: gaussian\n", 50000), {"'psf' is given twice"});
  ExpectCameraRefused(Repeated("---\n", 100000), {"one YAML document"});
}

THICKLENS_SITUATION(
    HostileText, ATableLineOfAMegabyte,
    "A table has a line of a million characters: one cell, one number, one quoted "
    "cell that does not end, half a million columns",
    "Refused with the line and the beginning of the cell; columns after the second are not read") {
  const std::string big(1000000, '9');
  ExpectRefused(CalibrateTable("file,reading\na.png,1\n" + big + ",3\n"), 1,
                {"table.csv:3", "999"});
  ExpectRefused(CalibrateTable("file,reading\na.png,1\nb.png," + big + "\n"), 1,
                {"table.csv:3", "999"});
  ExpectRefused(CalibrateTable("file,reading\na.png,1\n\"" + big), 1, {"table.csv:3"});
  ExpectDone(CalibrateTable("file,reading\na.png,1" + Repeated(",x", 500000) +
                            "\nb.png,2\nc.png,3\nd.png,4\ne.png,5\n"),
             {});
}

THICKLENS_SITUATION(HostileText, ATableOfAHundredThousandFrames,
                    "A table names 100,000 frames, all of which exist (as links)",
                    "A dry run reads it within seconds") {
  fs::create_directories(Work("frames/all"));
  constexpr int kSide = 317;
  std::string rows = "file,reading\n";
  for (int i = 0; i < kSide; ++i) {
    fs::copy(Work("picture.png"), Work("frames/all/f" + std::to_string(i) + ".png"));
    fs::create_directory_symlink("all", Work("frames/d" + std::to_string(i)));
    for (int k = 0; k < kSide; ++k) {
      rows += "d" + std::to_string(i) + "/f" + std::to_string(k) + ".png," +
              std::to_string(i * kSide + k) + "\n";
    }
  }
  Put("frames/table.csv", rows);
  Put("many.yaml",
      "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes_csv: frames/table.csv\n"
      "frames_dir: frames\nframes_glob: frames/d*/f*.png\n");
  const Outcome outcome = Shell("\"$T\" calibrate many.yaml --dry-run -o new");
  ExpectDone(outcome, {});
  EXPECT_THAT(outcome.out, HasSubstr("100489"));
}

THICKLENS_SITUATION(HostileText, ASweepFileOfAHundredThousandFrames,
                    "A sweep's YAML file lists 100,000 frames, none of which exists",
                    "Refused at the first, within seconds") {
  std::string sweep = "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes:\n";
  for (int i = 0; i < 100000; ++i) {
    sweep += "  - {image: f" + std::to_string(i) + ".png, reading_mm: " + std::to_string(i) + "}\n";
  }
  Put("many.yaml", sweep);
  ExpectRefused(Shell("\"$T\" calibrate many.yaml -o new"), 1, {"many.yaml:4", "f0.png"});
}

THICKLENS_SITUATION(HostileText, ADamagedProfile,
                    "The JSON of a profile is cut off, nested 100,000 times, a list, has NaN, "
                    "1e999, numbers below 0 and texts in place of numbers, or a million characters "
                    "in a field",
                    "Refused with the file and the field") {
  const std::string shipped =
      testing::ContentOf(THICKLENS_SOURCE_DIR "/configs/profiles/default.json");
  const auto with = [&](const std::string& key, const std::string& value) {
    std::string changed = shipped;
    const std::size_t begin = changed.find("\"" + key + "\":");
    EXPECT_NE(begin, std::string::npos) << key;
    const std::size_t end = changed.find_first_of(",\n", begin);
    return changed.replace(begin, end - begin, "\"" + key + "\": " + value);
  };
  const std::vector<std::pair<std::string, std::string>> damaged = {
      {shipped.substr(0, shipped.size() / 2), "not a JSON object"},
      {Repeated("[", 100000), "not a JSON object"},
      {Repeated("{\"a\":", 100000), "not a JSON object"},
      {"[1, 2]", "not a JSON object"},
      {with("probe_seconds", "NaN"), "not a JSON object"},
      {with("probe_seconds", "1e999"), "profile.json"},
      {with("probe_seconds", "-1"), "probe_seconds"},
      {with("threads", "\"many\""), "threads"},
      {with("threads", "1e300"), "threads"},
      {with("schema", "\"" + std::string(1000000, 'x') + "\""), "schema"},
      {with("runs", "\"" + std::string(1000000, 'x') + "\""), "runs"}};
  for (const auto& [content, reported] : damaged) {
    SCOPED_TRACE(content.substr(0, 60));
    Put("profile.json", content);
    ExpectRefused(Shell(Estimate("new --profile profile.json --within 3600s")), 1,
                  {"profile.json", reported});
  }
}

THICKLENS_SITUATION(HostileText, NumbersThatAreNone,
                    "Numbers of a camera are `.nan`, `.inf`, 1e400, hexadecimal, have a decimal "
                    "comma or a unit",
                    "Refused with line, field and value") {
  for (const char* number :
       {".nan", "nan", "-.inf", "inf", "1e400", "0x10", "'8,9'", "8.9 mm", "''"}) {
    SCOPED_TRACE(number);
    ExpectCameraRefused(
        CameraWith("aperture_radius_mm: 8.9286", std::string("aperture_radius_mm: ") + number),
        {"hostile.yaml:", "lens.aperture_radius_mm"});
    ExpectCameraRefused(CameraWith("width_px: 24", std::string("width_px: ") + number),
                        {"hostile.yaml:", "sensor.width_px"});
  }
}

THICKLENS_SITUATION(
    HostileText, NumbersBeyondMeasure,
    "Each number of a camera in turn is 1e308, -1e308, 1e-308, 1e29 or 1e-29",
    "Refused with the field and the value, or accepted, and then every result is a number") {
  const std::vector<std::pair<std::string, std::string>> fields = {
      {"front_focal_length_mm", "50"}, {"rear_focal_length_mm", "50"},
      {"lens_thickness_mm", "0"},      {"aperture_radius_mm", "8.9286"},
      {"pixel_pitch_mm", "0.0045"},    {"image_distance_mm", "{value: 60"},
      {"blur_ratio", "{value: 0.45"},  {"blur_floor_px", "{value: 0.5"},
      {"principal_point_px", "[11.5"},
  };
  for (const auto& [field, value] : fields) {
    const std::string opening = value.substr(0, value.find_first_of("0123456789"));
    for (const char* number : {"1e308", "-1e308", "1e-308", "1e29", "1e-29"}) {
      SCOPED_TRACE(field + " " + number);
      const Outcome outcome =
          ExplainCamera(CameraWith(field + ": " + value, field + ": " + opening + number));
      if (outcome.exit_code == 1) {
        ExpectRefused(outcome, 1, {"hostile.yaml", field});
        continue;
      }
      ExpectDone(outcome, {});
      EXPECT_THAT(outcome.out, Not(HasSubstr("nan")));
    }
  }
}

}  // namespace
}  // namespace thicklens::hostile
