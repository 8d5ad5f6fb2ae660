#ifndef THICKLENS_MODEL_SWEEP_FILE_H_
#define THICKLENS_MODEL_SWEEP_FILE_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/effect_choice.h"

namespace thicklens::model {

// Which way the bench scale runs [D56]: z = offset + reading (away) or offset - reading (toward).
enum class BenchDirection { kAway, kToward };
std::string BenchDirectionName(BenchDirection direction);
double DirectionSign(BenchDirection direction);  // +1 away, -1 toward

enum class SweepTarget { kAuto, kTexture, kPrintedEdge, kKnifeEdge };
std::string SweepTargetName(SweepTarget target);

// What is known of the lens floor beforehand: nothing, a value, or an interval.
struct FloorKnowledge {
  std::optional<Estimate> given_px;
  std::optional<double> from_px, to_px;  // both or none
};

// Where a given floor comes from, if from another calibration. It is a floor of this lens on these
// pixels and of no other.
struct FloorOrigin {
  std::string place;  // "sweep.yaml:4:17: blur_floor_px.from_calibration: ", for messages
  std::string camera_path;
  ThickLens lens;
  double pixel_pitch_mm = 0;
};

struct RegionOfInterest {
  int x = 0, y = 0, width = 0, height = 0;  // px; width 0: the whole field
};

struct SweepFrame {
  std::string image;  // path as it can be opened
  double reading_mm = 0;
};

// A focus sweep as its file describes it, schema thicklens/sweep/1 (docs/file-formats.md).
// Readings are in mm here, whatever unit the file gives them in.
struct SweepFile {
  std::string source;       // the file, for messages
  std::string camera_path;  // resolved
  double reading_sigma_mm = 0;
  bool reading_sigma_stated = false;
  std::optional<Estimate> offset_mm;  // absent: unknown
  BenchDirection direction = BenchDirection::kAway;
  SweepTarget target = SweepTarget::kAuto;
  FloorKnowledge floor;
  std::optional<FloorOrigin> floor_origin;
  std::optional<double> target_period_mm;  // of a periodic target (docs/file-formats.md)
  RegionOfInterest roi;
  std::vector<SweepFrame> frames;  // in the file's order
};

// Reads the YAML and, with `frames_csv`, the table. Throws Error with file:line:column, also for a
// row without a file, a picture in `frames_dir` (or of `frames_glob`) without a row, duplicate rows
// and rows that are no numbers. What was taken for granted is told in `notices`.
SweepFile ReadSweep(const std::string& path, std::vector<std::string>* notices);

// Takes value and sigma of calibration.blur_floor_px of a camera file into `sweep`. Throws Error
// where the file holds none that was measured; `place` (where the path was given, with ": " at its
// end) begins the message.
void TakeFloorOfCalibration(const std::string& camera_path, const std::string& place,
                            SweepFile* sweep);

// Throws Error if the floor was taken from the calibration of another lens or pixel pitch than
// `camera` has.
void RequireFloorOfCamera(const SweepFile& sweep, const Camera& camera);

// A sweep out of a folder and a table, all else at its default: `thicklens calibrate DIR
// --readings`.
SweepFile SweepFromFolder(const std::string& folder, const std::string& readings_csv,
                          const std::string& camera_path, std::vector<std::string>* notices);

// The YAML text. Paths in `sweep` are written as they stand, so they should be relative to where
// the text will lie.
std::string SweepToYaml(const SweepFile& sweep);

// What a simulated sweep was made with, schema thicklens/sweep-truth/1.
struct SweepTruth {
  double image_distance_mm = 0;
  double focus_depth_mm = 0;
  double blur_ratio = 0;
  double blur_floor_px = 0;
  double bench_offset_mm = 0;
  double tilt_deg = 0;    // of the target, as TargetOptions has it
  std::string pupil_law;  // PupilLawName; empty: not stated
  struct Frame {
    std::string image;
    double depth_mm = 0;    // true z
    double reading_mm = 0;  // as the bench showed it, with its error
    // sqrt(floor^2 + (kappa r_defocus/p)^2), without the pixel box: the second moment.
    double blur_sigma_px = 0;
  };
  std::vector<Frame> frames;
  EffectRecord effects;  // not read
};
SweepTruth ReadSweepTruth(const std::string& path);
std::string SweepTruthToYaml(const SweepTruth& truth);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SWEEP_FILE_H_
