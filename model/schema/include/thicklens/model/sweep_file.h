#ifndef THICKLENS_MODEL_SWEEP_FILE_H_
#define THICKLENS_MODEL_SWEEP_FILE_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/aperture_outline.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/lens_aberrations.h"
#include "thicklens/model/readings.h"
#include "thicklens/model/target_grid.h"
#include "thicklens/model/video_selection.h"

namespace thicklens::model {

// Direction of the bench scale [D56]: z = offset + reading (away) or z = offset - reading (toward),
// where z is the depth from Ap, mm.
enum class BenchDirection { kAway, kToward };
// Name of the direction: "away" or "toward".
THICKLENS_EXPORT std::string BenchDirectionName(BenchDirection direction);
THICKLENS_EXPORT double DirectionSign(BenchDirection direction);  // +1 away, -1 toward

// The part that moves along the axis from frame to frame.
enum class SweepMotion {
  kTarget,  // the target: z = offset + reading or offset - reading
  kCamera,  // the whole camera, which changes the depth of the target in the same way
  kLens,    // the lens: a focus ring, helicoid or motor; target and sensor stand still
  kSensor,  // the sensor or the camera back; target and lens stand still
};
// Name of the part: "target", "camera", "lens" or "sensor".
THICKLENS_EXPORT std::string SweepMotionName(SweepMotion motion);
// Whether the distance from the lens to the sensor changes.
THICKLENS_EXPORT bool MovesFocus(SweepMotion motion);

// Kind of the photographed target.
enum class SweepTarget {
  kAuto,         // not stated: the frames decide
  kTexture,      // a flat pattern with detail everywhere
  kPrintedEdge,  // one straight edge, which is blurred by its ink
  kKnifeEdge,    // one straight edge that is sharp
  kPoints,       // pinholes or beads, apart from one another
};
// Name of the kind: "auto", "texture", "printed-edge", "knife-edge" or "points".
THICKLENS_EXPORT std::string SweepTargetName(SweepTarget target);

// Choice of the light that is measured of raw files.
enum class SweepRaw {
  kDemosaiced,  // the light of the interpolated colours, at the sensor's sampling
  kGreen,       // the mean of the two green sites of each 2 x 2 px, not interpolated
};
// Name of the choice: "demosaiced" or "green".
THICKLENS_EXPORT std::string SweepRawName(SweepRaw raw);

// Prior knowledge of the blur floor, px: nothing, a value, or an interval.
struct FloorKnowledge {
  std::optional<Estimate> given_px;      // a value and its standard deviation, px
  std::optional<double> from_px, to_px;  // both or neither are present
};

// Origin of a given floor that was taken from another calibration. The floor is valid only for this
// lens on these pixels.
struct FloorOrigin {
  std::string place;          // for messages: "sweep.yaml:4:17: blur_floor_px.from_calibration: "
  std::string camera_path;    // the camera file with the other calibration
  ThickLens lens;             // the lens of that camera
  double pixel_pitch_mm = 0;  // its pixel pitch, mm
};

// The part of each frame that is measured.
struct RegionOfInterest {
  int x = 0, y = 0, width = 0, height = 0;  // px; width 0: the whole field
};

// Files that correct the frames of a sweep, as paths that can be opened. Each list is averaged.
struct CorrectionFiles {
  std::vector<std::string> dark;     // exposures without light, which are subtracted
  std::vector<std::string> flat;     // exposures of an even surface, by which is divided
  std::vector<std::string> defects;  // masks or lists of pixels that are replaced
  // Whether there are none.
  bool IsEmpty() const { return dark.empty() && flat.empty() && defects.empty(); }
};

// One frame of a sweep.
struct SweepFrame {
  std::string image;      // path that can be opened
  double reading_mm = 0;  // what the scale of the bench shows; not a depth
  // The page of a file of several, counted from 0; absent: the file has one image.
  std::optional<int> page = std::nullopt;

  // The name for messages: "stack.tif[3]" for page 3, otherwise the path.
  std::string Name() const { return page ? image + "[" + std::to_string(*page) + "]" : image; }
};

// A focus sweep as its file describes it, schema thicklens/sweep/1 (docs/file-formats.md).
// All readings are in mm, independent of the unit in the file.
struct SweepFile {
  std::string source;                 // name of the file, for messages
  std::string camera_path;            // path that can be opened
  double reading_sigma_mm = 0;        // standard deviation of the error of a reading, mm
  bool reading_sigma_stated = false;  // false: the scatter about the law of image scale is used
  std::optional<Estimate> offset_mm;  // absent: unknown
  // The part that moves; absent: not stated. Where the lens or the sensor moves, `offset_mm` is d1
  // at reading 0, and readings that grow "away" are those at which the sensor is farther from the
  // lens. The statements about the plane of focus are of the reading at focus.
  std::optional<SweepMotion> moves;
  // True: the readings were stated in dioptres and are the distances, mm from Ap, on which the
  // lens is focused by its own scale. False: they are positions on a scale.
  bool readings_are_focus_distances = false;
  // True: the readings are steps or counts of a drive whose length is not stated. They stand where
  // millimetres would.
  bool readings_are_counts = false;
  // Statements about the plane of focus (model::StatedConjugate), each > 0. They determine the
  // depths of the sweep where neither `offset_mm` nor the image scale does; otherwise they are
  // compared with them. All are absent unless they are stated.
  std::optional<Estimate> focus_depth_mm;            // zf from Ap
  std::optional<Estimate> working_distance_mm;       // from the front of the lens's barrel
  std::optional<Estimate> image_distance_mm;         // d1, from Ap to the sensor
  std::optional<Estimate> optical_tube_length_mm;    // from the rear focal plane to the sensor
  std::optional<Estimate> magnification;             // in the plane of focus, > 0
  BenchDirection direction = BenchDirection::kAway;  // whether readings grow away from the camera
  SweepTarget target = SweepTarget::kAuto;           // what was photographed
  FloorKnowledge floor;                              // what is known of the blur floor
  std::optional<FloorOrigin> floor_origin;  // present if another calibration gave the floor
  std::optional<double> target_period_mm;   // period of a periodic target (docs/file-formats.md)
  // The grid on the target, by which focal length, principal point and distortion are found.
  std::optional<TargetGrid> target_grid;
  // Images of the same grid with the same focus, tilted, as paths that can be opened.
  std::vector<std::string> grid_views;
  // Standard deviation of the angle between the motion of the sweep and the optical axis, degrees,
  // which is 0 otherwise. Absent: the stage may be mounted anyhow.
  std::optional<double> stage_alignment_deg;
  RegionOfInterest roi;  // the part that is measured
  // The value in the files that stands for white, 1 to 65535; absent: that of their container, the
  // one that they state, or the one that their values show.
  std::optional<int> full_scale;
  SweepRaw raw = SweepRaw::kDemosaiced;  // what is measured of raw files
  CorrectionFiles correction;            // what the frames are corrected by
  std::vector<SweepFrame> frames;        // in the order of the file
  // Describes in one line which readings were read, and in which unit; empty: the file lists them.
  std::string readings;
};

// How the readings of a sweep are read.
struct SweepReading {
  ReadingOptions readings;  // each value that is given replaces that of the sweep's file
  // Reads the readings; empty: ReadTextReadings, which reads tables of text and names of files.
  ReadingReader reader;
  // Completes what the sweep's file states of its video; a value that both state must be equal.
  VideoSelection video;
  VideoFramesReader video_reader;  // empty: a sweep file with a video is refused
};

// Reads the YAML file and, with `frames_csv`, the table; with `video`, also the times of its
// frames, by SweepReading::video_reader. Throws Error with file:line:column for invalid content,
// also for a row without a file, an image in `frames_dir` (or of `frames_glob`) without a row,
// duplicate rows and readings that are no numbers. Assumptions about missing or unusual content are
// added to `notices`, which may be null.
THICKLENS_EXPORT SweepFile ReadSweep(const std::string& path, std::vector<std::string>* notices);
THICKLENS_EXPORT SweepFile ReadSweep(const std::string& path, const SweepReading& reading,
                                     std::vector<std::string>* notices);

// Copies value and sigma of calibration.blur_floor_px of a camera file to the floor of `sweep`.
// Throws Error if the file contains no measured floor. The message begins with `place`, the place
// where the path was given, with ": " at its end.
THICKLENS_EXPORT void TakeFloorOfCalibration(const std::string& camera_path,
                                             const std::string& place, SweepFile* sweep);

// Throws Error if the floor was taken from the calibration of another lens or pixel pitch than
// `camera` has.
THICKLENS_EXPORT void RequireFloorOfCamera(const SweepFile& sweep, const Camera& camera);

// A sweep of a folder of images and a table of readings; all other fields have their defaults. The
// command `thicklens calibrate DIR --readings` uses it. Throws Error as ReadSweep does for rows and
// images without partner; `notices` may be null.
THICKLENS_EXPORT SweepFile SweepFromFolder(const std::string& folder,
                                           const std::string& readings_csv,
                                           const std::string& camera_path,
                                           std::vector<std::string>* notices);
// Likewise with options. `table` is empty if the readings come from the files themselves.
THICKLENS_EXPORT SweepFile SweepFromFolder(const std::string& folder, const std::string& table,
                                           const std::string& camera_path,
                                           const SweepReading& reading,
                                           std::vector<std::string>* notices);
// A sweep of the pages of one file, `pages` of them. A row of `readings` names its page as
// "stack.tif[3]", counted from 0, or by its number alone, counted from 0 or from 1. Throws Error
// for a row or a page without its partner; `notices` may be null.
THICKLENS_EXPORT SweepFile SweepFromPages(const std::string& path, int pages,
                                          const ReadingSet& readings,
                                          const std::string& camera_path,
                                          std::vector<std::string>* notices);
// Whether a file of that name is taken for an image, by its ending.
THICKLENS_EXPORT bool IsNameOfImage(const std::string& path);
// The images that a sweep from a folder has: those in the folder or, if it contains none, in its
// direct sub-folders. Throws Error if the folder cannot be read.
THICKLENS_EXPORT std::vector<std::string> ImagesOfFolder(const std::string& folder);

// The YAML text of a sweep. Paths in `sweep` are written unchanged; they should therefore be
// relative to the folder of the written file.
// Readings in counts are in a table beside that file, "readings.csv" (ReadingsTable).
THICKLENS_EXPORT std::string SweepToYaml(const SweepFile& sweep);
// The table of the readings of a sweep whose images are in one folder: name of the image and
// reading, in mm or in counts.
THICKLENS_EXPORT std::string ReadingsTable(const SweepFile& sweep);

// Parameters with which a sweep was simulated, schema thicklens/sweep-truth/1.
struct SweepTruth {
  double image_distance_mm = 0;              // d1 from Ap to the sensor, mm
  double focus_depth_mm = 0;                 // zf from Ap, mm
  double blur_ratio = 0;                     // kappa, dimensionless
  double blur_floor_px = 0;                  // sigma of the blur floor, px
  SweepMotion moves = SweepMotion::kTarget;  // the part that moves
  double bench_offset_mm = 0;       // z of reading 0, mm from Ap; d1 where lens or sensor move
  double tilt_deg = 0;              // tilt of the target, as in TargetOptions
  std::vector<double> relief_mm;    // heights of the parts above the target, toward the camera, mm
  double corner_stops = 0;          // shading: light at the farthest corner over the axis, stops
  int specks = 0;                   // number of specks on the sensor
  LensAberrations aberrations;      // of the lens, all 0 if there are none
  ApertureOutline aperture;         // outline of the aperture
  double counts_per_mm = 0;         // counts of the readings per mm; 0: the readings are in mm
  double band_amplitude = 0;        // relative amplitude of the bands of the light
  double exposure_drift_stops = 0;  // change of the exposure over the sweep, stops
  std::string pupil_law;            // PupilLawName; empty: not stated
  // The true values of one frame.
  struct Frame {
    std::string image;      // file name of the frame
    double depth_mm = 0;    // true z from Ap
    double reading_mm = 0;  // the reading with its error; a count where counts_per_mm > 0
    // Second-moment sigma of the blur, sqrt(floor^2 + (kappa r_defocus/p)^2), without the pixel
    // box. With axial colour it is that of light whose zf is focus_depth_mm.
    double blur_sigma_px = 0;
    double image_distance_mm = 0;  // d1, from Ap to the sensor; 0: that of the sweep
  };
  std::vector<Frame> frames;      // in the order of the sweep
  EffectSelectionRecord effects;  // written, but not read
};
// Throws Error with file:line:column for invalid content.
THICKLENS_EXPORT SweepTruth ReadSweepTruth(const std::string& path);
// The YAML text of the parameters.
THICKLENS_EXPORT std::string SweepTruthToYaml(const SweepTruth& truth);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SWEEP_FILE_H_
