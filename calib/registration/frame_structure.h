#ifndef THICKLENS_CALIB_REGISTRATION_FRAME_STRUCTURE_H_
#define THICKLENS_CALIB_REGISTRATION_FRAME_STRUCTURE_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// Where the frames of a sweep lie against one another, as far as it is known.
struct FramePlaces {
  const FocusSweep& sweep;
  // Linear grey light of a frame, CV_32F.
  std::function<cv::Mat(std::size_t)> read_grey;
  std::vector<std::size_t> used;     // frames that passed the gates
  std::vector<ScaleSample> samples;  // those that were registered, the reference among them
  cv::Point2d centre;                // of the scales
  std::function<void()> tick;        // called for each frame that is read; may throw
};

// Looks for what belongs to the frame or to the light and not to the target:
//   vignetting: ln I_i(p) - ln I_ref(q), q the place of p in the reference, is
//     v (|p|^2 - |q|^2)/R^2 besides a gain and a slope of the light, on pictures so small that the
//     blur does not matter; v from the frames of the most different scales;
//   bands: the ratio of frames that are neighbours varies from row to row and not from column to
//     column (a lamp that flickers under a rolling shutter), beyond what the target itself does;
//   fixed structure: the fine structure of the nearest frames correlates with that of the farthest
//     ones at the same place of the sensor, more than 5 px beside and more than at other places,
//     where the target moved by more than 6 px.
// Derived here [D66]. What the sweep cannot show stays empty.
FrameStructureFinding MeasureStructure(const FramePlaces& places);

// Whether the sweep shows that there is none of it large enough to matter; a small or short one
// does not.
bool VignettingIsExcluded(const FrameStructureFinding& structure);
bool FixedStructureIsExcluded(const FrameStructureFinding& structure);

// Whether the bands are so strong that they alone keep frames, or more than half of them, from
// being registered. Measured on simulated sweeps of dead leaves with sinusoidal bands of a phase of
// their own in each frame: a standard deviation of 2 % costs up to 4 frames of 31, 4 % costs 6 or
// 7, 7 % costs 8 to 10, 10 % costs 14 or 15, 21 % all but 3.
bool BandsHideFrames(const FrameStructureFinding& structure);
bool BandsHideMostFrames(const FrameStructureFinding& structure);

// "the corners are 35 % darker than the centre (vignetting, or a lamp that moves with the camera)",
// and so on: those that are there, with what to do, one after the other. Empty where none is.
std::string StructureInWords(const FrameStructureFinding& structure);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_FRAME_STRUCTURE_H_
