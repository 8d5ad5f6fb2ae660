#ifndef THICKLENS_CALIB_FOCUS_SWEEP_H_
#define THICKLENS_CALIB_FOCUS_SWEEP_H_

#include <cstddef>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// Reads the frame of an index as its file stores it: 8 or 16 bit, 1, 3 (RGB) or 4 channels. Must be
// callable from several threads at once. Throws Error that names the file.
using FrameReader = std::function<cv::Mat(std::size_t index)>;

// A sweep ready to be measured: frames are streamed through `read_frame`, never all held.
struct FocusSweep {
  model::Camera camera;  // d1 and kappa need not be known
  std::vector<model::SweepFrame> frames;
  FrameReader read_frame;
  double reading_sigma_mm = 0;
  std::optional<model::Estimate> offset_mm;  // absent: found from the image scale
  model::BenchDirection direction = model::BenchDirection::kAway;
  model::SweepTarget target = model::SweepTarget::kAuto;
  model::FloorKnowledge floor;
  std::optional<double> target_period_mm;  // of a periodic target
  model::RegionOfInterest roi;

  // True if a calibration can be attempted: frames, distinct readings, a possible camera.
  bool IsValid(std::string* why) const;
};

// A FocusSweep from its description; `read_frame` is left to the caller. Throws Error if the
// description takes its floor from the calibration of another camera.
FocusSweep MakeFocusSweep(const model::SweepFile& file, const model::Camera& camera);

// The region of interest of a frame as stored. Throws Error naming the frame if its size is not the
// sensor's, or its depth or channels are none of those above.
cv::Mat RegionOf(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index);

// The same as linear grey light in [0, 1], CV_32F (.2126 R + .7152 G + .0722 B).
cv::Mat LinearGrey(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index);

// One channel of it: 0 red, 1 green, 2 blue; of a frame with one channel 0 alone. Throws Error
// naming the frame if it has no such channel.
cv::Mat LinearChannel(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index,
                      int channel);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FOCUS_SWEEP_H_
