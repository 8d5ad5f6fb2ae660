#ifndef THICKLENS_SWEEP_H_
#define THICKLENS_SWEEP_H_

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/camera.h"
#include "thicklens/image.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/video_sweep.h"
#include "thicklens/run.h"

namespace thicklens {
namespace calib {
class FrameCorrection;
}

// Where the frames of a sweep come from, if not from its files. The functions are called from
// several threads at once.
class THICKLENS_EXPORT FrameSource {
 public:
  virtual ~FrameSource();
  // Returns the frame `index`, encoded, of the sensor's size. Throws Error that names the frame. If
  // it returns an empty image, the call that measures the frames throws such an Error.
  virtual Image Read(std::size_t index) const = 0;
};

// A focus sweep: photographs of one flat target at known readings of a bench. The frames are read
// one by one while they are measured; they are never all in memory.
struct Sweep {
  // The content of the sweep's file: frames, readings in mm, offset, direction, target, floor and
  // region (thicklens/model/sweep_file.h).
  model::SweepFile description;
  // The camera without calibration; its lens and sensor are used.
  Camera camera;
  // Null: the frames are the image files that `description` names.
  std::shared_ptr<const FrameSource> frames;
  // The truth of a simulated sweep, if it is known; a calibration does not use it.
  std::optional<model::SweepTruth> truth;
  // The assumptions that were made when the sweep was read, one line each.
  std::vector<std::string> notices;
  // Describes what shows the full scale of the frames' values, in one line; empty: ExamineFrames
  // has not been called, or the frames are not files.
  std::string full_scale_reason;
  // The dark, the flat and the defects that the frames are corrected by; null: none. ExamineFrames
  // makes it from the files that `description.correction` names, unless it is set.
  std::shared_ptr<const calib::FrameCorrection> correction;
  // The description of the files for the correction, one line for each of dark, flat and defects.
  std::vector<std::string> correction_lines;

  // Returns true if a calibration can be attempted: the camera, the readings and the options of
  // the description are possible and finite. Does not open a frame.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Statements that replace those of the sweep's file. An absent or empty value keeps the file's.
struct SweepOverrides {
  std::string camera_path;                // another camera file
  std::string truth_path;                 // the truth of a simulated sweep
  bool offset_unknown = false;            // the bench offset is to be found from the image scale
  std::optional<double> offset_mm;        // finite
  std::optional<double> offset_sigma_mm;  // finite, >= 0; needs an offset
  // Statements about the plane of focus (model::SweepFile). Each value is finite and > 0, each
  // sigma finite and >= 0.
  std::optional<Measured> focus_depth_mm;          // zf from Ap
  std::optional<Measured> working_distance_mm;     // from the front of the lens's barrel
  std::optional<Measured> image_distance_mm;       // d1, from Ap to the sensor
  std::optional<Measured> optical_tube_length_mm;  // from the rear focal plane to the sensor
  std::optional<Measured> magnification;           // in the plane of focus, dimensionless
  std::optional<double> target_period_mm;          // period of a periodic target, finite, > 0
  std::optional<model::TargetGrid> target_grid;    // the grid on the target
  std::string grid_views;                          // folder of further views of the grid
  std::optional<double> stage_alignment_deg;       // finite, > 0; see model::SweepFile
  std::optional<model::BenchDirection> direction;  // sign of the reading in z
  std::optional<model::SweepMotion> moves;         // the part that moves
  std::optional<double> reading_sigma_mm;          // finite, >= 0
  bool floor_unknown = false;                  // discards what the file states of the blur floor
  std::optional<Measured> floor_px;            // value and sigma finite and >= 0
  std::string floor_from_calibration;          // a camera file; excludes floor_px and floor_unknown
  std::optional<model::SweepTarget> target;    // kind of the target
  std::optional<model::RegionOfInterest> roi;  // px, inside the sensor
  // The value in the files that stands for white, 1 to 65535, e.g. 1023 for values of 10 bits.
  std::optional<int> full_scale;
  std::optional<model::SweepRaw> raw;  // what is measured of raw files
  // Files by which the frames are corrected. Each list that is not empty replaces that of the file.
  model::CorrectionFiles correction;
  // File with the lens distortion of the frames, "FILE" or "FILE:CAMERA" (thicklens/distortion.h),
  // instead of that of the camera file; "none": the frames are undistorted already.
  std::string distortion;
  // Which readings are read, and in which unit (thicklens/model/readings.h).
  model::ReadingOptions readings;
  // Which frames of a video are used, and its constant speed: for ReadSweepFolder of a video, and
  // for a sweep file with a video, whose statements they complete and may not contradict.
  model::VideoSelection video;

  // Returns whether all statements are in their range and do not contradict each other. Otherwise
  // `why`, if not null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Reads a sweep's description (schema thicklens/sweep/1), or the sweep.yaml of a folder, and its
// camera; checks that the frames exist and opens none, except that a video is decoded once. Throws
// OptionError, and Error with file:line:column.
THICKLENS_EXPORT Sweep ReadSweep(const std::string& path, const SweepOverrides& overrides = {},
                                 const RunControl& run = {});
// Reads a folder of frames with a table of their readings (docs/file-formats.md), or one file (or a
// folder with one file) whose pages are the frames, or a video, which is decoded once.
// `readings_csv` is empty if `overrides.readings` states that the readings are in the names or in
// the metadata of the frames, if the OME-XML of the pages has them, or if `overrides.video` states
// a constant speed. `overrides.camera_path` is required.
THICKLENS_EXPORT Sweep ReadSweepFolder(const std::string& folder, const std::string& readings_csv,
                                       const SweepOverrides& overrides, const RunControl& run = {});

// Returns the sweep with the full scale of its frames (`description.full_scale`, unless it is given
// or that of the container) and what shows it, and with a notice if the files state another
// transfer curve than the camera. Files for the correction are averaged, checked against the first
// frame and kept as `correction`. It reads the first frame; if that has 16 bits of which the file
// does not state how many are used, it reads frames until their values show it. Calibrate and
// VerifyCamera do this unless it has been done. Throws Error if the values do not show the full
// scale and the result depends on it, and OptionError.
THICKLENS_EXPORT Sweep ExamineFrames(Sweep sweep, const RunControl& run = {});

// Assumptions about the sweep and its camera, one line each, which Calibrate reports before it
// measures.
THICKLENS_EXPORT std::vector<std::string> NoticesOf(const Sweep& sweep);

}  // namespace thicklens

#endif  // THICKLENS_SWEEP_H_
