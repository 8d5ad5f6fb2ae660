#ifndef THICKLENS_CALIB_REGISTRATION_FRAME_STRUCTURE_H_
#define THICKLENS_CALIB_REGISTRATION_FRAME_STRUCTURE_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// The known geometric relations between the frames of a sweep.
struct FramePlaces {
  const FocusSweep& sweep;
  // Linear grey light of a frame, CV_32F.
  std::function<cv::Mat(std::size_t)> read_grey;
  std::vector<std::size_t> used;     // frames that passed the quality checks
  std::vector<ScaleSample> samples;  // the registered frames, including the reference
  cv::Point2d centre;                // centre of the scales, px
  std::function<void()> tick;        // called for each frame that is read; may throw
};

// Looks for structure that belongs to the frame or to the light and not to the target:
//   vignetting: ln I_i(p) - ln I_ref(q), where q is the place of p in the reference, contains
//     v (|p|^2 - |q|^2)/R^2 in addition to a gain and a slope of the light. The images are so small
//     that the blur does not matter; v comes from the frames with the most different scales.
//   bands: the ratio of neighbouring frames varies from row to row and not from column to column (a
//     lamp that flickers under a rolling shutter), beyond the variation of the target itself.
//   fixed structure: the fine structure of the nearest frames correlates with that of the farthest
//     ones at the same place of the sensor, more than 5 px beside it and more than at other places,
//     where the target moved by more than 6 px.
// Derived here [D66]. A part that the sweep cannot show stays empty.
FrameStructureFinding MeasureStructure(const FramePlaces& places);

// Whether the sweep shows that this structure is too small to matter. A small or short sweep does
// not show it.
bool VignettingIsExcluded(const FrameStructureFinding& structure);
bool FixedStructureIsExcluded(const FrameStructureFinding& structure);

// Whether the bands alone explain that so many of the frames could not be registered. The costs
// were measured on simulated sweeps of dead leaves with sinusoidal bands of a different phase in
// each frame: a standard deviation of 2 % costs up to 4 frames of 31, 4 % costs 6 or 7, 7 % costs 8
// to 10, 10 % costs 14 or 15, and 21 % costs all but 3. Half as many again are put down to them.
bool BandsExplain(const FrameStructureFinding& structure, std::size_t missing, std::size_t frames);

// Describes the bands and their remedy; empty without bands.
std::string BandsInWords(const FrameStructureFinding& structure);

// Describes each structure that was found, and its remedy, in one text: "the corners are 35 %
// darker than the centre (vignetting, or a lamp that moves with the camera)", and so on. The text
// is empty where none was found.
std::string StructureInWords(const FrameStructureFinding& structure);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_FRAME_STRUCTURE_H_
