#ifndef THICKLENS_CALIB_FOCUS_SWEEP_H_
#define THICKLENS_CALIB_FOCUS_SWEEP_H_

#include <cstddef>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/grid_geometry.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/conjugates.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::calib {

class FrameCorrection;

// Reads the frame of an index as its file stores it: 8 or 16 bit, 1, 3 (RGB) or 4 channels. It must
// be callable from several threads at once. It throws an Error that names the file.
using FrameReader = std::function<cv::Mat(std::size_t index)>;

// A sweep that is ready to be measured. The frames are streamed through `read_frame`; they are
// never all held in memory.
struct FocusSweep {
  model::Camera camera;                      // d1 and kappa need not be known
  std::vector<model::SweepFrame> frames;     // in the order of the sweep
  FrameReader read_frame;                    // set by the caller
  double reading_sigma_mm = 0;               // standard deviation of a reading, mm; 0: not stated
  std::optional<model::Estimate> offset_mm;  // absent: found from the image scale
  // Statements about the plane of focus, by the sweep's file or the data of an objective. The names
  // are the keys of the files, "magnification" or "lens.magnification".
  std::vector<model::StatedConjugate> stated_focus;
  model::BenchDirection direction = model::BenchDirection::kAway;  // sign of the reading in z
  // The part that moves; absent: not stated. Where the lens or the sensor moves, `offset_mm` is d1
  // at reading 0, and `direction` the sign of the reading in d1.
  std::optional<model::SweepMotion> moves;
  // True: the readings are the distances, mm from Ap, on which the lens is focused by its own
  // scale.
  bool readings_are_focus_distances = false;
  // True: the readings are steps or counts of a drive of the lens or the sensor, whose length is
  // not known. They stand where millimetres would.
  bool readings_are_counts = false;
  // The reading as it was written, in `shown_unit`, for a reading of this sweep that stands for
  // another one: of an equivalent target, or of counts. Messages show it. Null: in mm, as it is.
  std::function<double(double reading_mm)> shown_reading;
  std::string shown_unit = "mm";                          // of shown_reading
  model::SweepTarget target = model::SweepTarget::kAuto;  // kind of the target, if it is stated
  model::FloorKnowledge floor;                            // what is known of the blur floor, px
  std::optional<double> target_period_mm;                 // period of a periodic target
  std::optional<model::TargetGrid> target_grid;           // the grid on the target
  // Names of further views of the grid, for messages, and their reader, as `read_frame`.
  std::vector<std::string> grid_views;
  FrameReader read_grid_view;  // set by the caller if there are views
  // Standard deviation of the angle between the motion and the optical axis, degrees, if stated.
  std::optional<double> stage_alignment_deg;
  // The size of the grid in the frames, which Calibrate finds.
  std::vector<GridScale> grid_scales;
  // The part of the frames that is measured, after the camera's distortion was taken out of them.
  // Pixels of it that the distorted frames do not show are black, and MakeFocusSweep leaves them
  // out.
  model::RegionOfInterest roi;
  // Dark, flat and defects that LinearGrey and LinearChannel correct the light by, of the size of
  // the frames; null: none.
  std::shared_ptr<const FrameCorrection> correction;
  // Pixels of the sensor per pixel of the frames: 2 for the green plane of a mosaic. Camera, floor,
  // region and results have the pixels of the frames. Messages have those of the sensor, and so has
  // the interval of a floor that is not stated.
  int sensor_px_per_px = 1;

  // True if a calibration can be attempted: the camera and the values are possible. Otherwise `why`
  // (unless it is null) receives the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Makes a FocusSweep from its description. The caller sets `read_frame`. A working distance becomes
// a depth from Ap; an objective states its magnification unless the description does. Throws Error
// if the description takes its floor from the calibration of another camera, or if its working
// distance cannot be converted.
THICKLENS_EXPORT FocusSweep MakeFocusSweep(const model::SweepFile& file,
                                           const model::Camera& camera);

// Returns the sweep with frames that are undistorted by `distortion` before they are measured. Its
// region is the part of `region` that they then show. Throws Error if they show nothing of it.
THICKLENS_EXPORT FocusSweep WithDistortion(FocusSweep sweep,
                                           const model::LensDistortion& distortion,
                                           const model::RegionOfInterest& region);

// Returns the region of interest of a stored frame. Throws an Error that names the frame if its
// size is not the sensor's, or if its depth or channels are not those of FrameReader.
THICKLENS_EXPORT cv::Mat RegionOf(const cv::Mat& stored, const FocusSweep& sweep,
                                  std::size_t index);

// Returns the region as linear grey light in [0, 1], CV_32F (0.2126 R + 0.7152 G + 0.0722 B). A
// correction of the sweep is applied, and then the camera's distortion is taken out, after which
// light may be below 0 or above 1. Throws as RegionOf does.
THICKLENS_EXPORT cv::Mat LinearGrey(const cv::Mat& stored, const FocusSweep& sweep,
                                    std::size_t index);

// Returns one channel of the linear light, CV_32F, corrected likewise: 0 red, 1 green, 2 blue; a
// frame with one channel has 0 alone. Throws as RegionOf does, and also if the frame has no such
// channel.
THICKLENS_EXPORT cv::Mat LinearChannel(const cv::Mat& stored, const FocusSweep& sweep,
                                       std::size_t index, int channel);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FOCUS_SWEEP_H_
