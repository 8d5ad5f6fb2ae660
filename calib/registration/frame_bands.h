#ifndef THICKLENS_CALIB_REGISTRATION_FRAME_BANDS_H_
#define THICKLENS_CALIB_REGISTRATION_FRAME_BANDS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/registration/frame_structure.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// ln of the mean light of each row and of each column of a frame.
struct LightProfiles {
  std::vector<double> rows, columns;
};
LightProfiles ProfilesOf(const cv::Mat& grey);

// The lines that may have bands.
enum class BandAxis { kRows, kColumns };

// The axis along whose lines neighbouring frames differ far more than along the other one, although
// the target itself does not have such lines. Std::nullopt: there is none. `profiles` are in the
// order of the readings; `samples`, if there are any, give the places of their frames on the target
// (null: unknown, and the target is taken to be at the same place in neighbouring frames). It is a
// suspicion only: a target that moves along one axis alone has this effect as well.
std::optional<BandAxis> SuspectedBands(const std::vector<const LightProfiles*>& profiles,
                                       const std::vector<const ScaleSample*>& samples,
                                       cv::Point2d centre);

// The frame with each line divided by its mean light, times the mean of the frame. Bands have no
// effect on it. It is for registrations alone: the target's own lines are lost.
cv::Mat WithEvenLines(const cv::Mat& grey, BandAxis axis);

// Bands of the light: factors of the rows (or columns) that are others in each frame.
struct FrameBands {
  bool done = false;                // true if they were measured
  std::string message = "not run";  // how it ended; without a result, the reason
  // Whether the lines of this axis vary beyond what the errors of this method explain, which the
  // other axis shows.
  bool is_significant = false;
  // ln of the light of each line of a frame relative to the mean of the frame, by the index of the
  // frame in the sweep; empty for frames that are not used.
  std::vector<std::vector<double>> log_gain;
  // Standard deviation of log_gain over the lines: median of the frames, with the standard
  // deviation of the value of a frame.
  model::Estimate deviation{0, 0};
  std::optional<double> period_px;  // where most of the frames show the same period
};

// Measures the bands of registered frames [D141]:
//   ln m_i(y) = c_i + b_i(y) + (G_i * t)(q),  q = c + (y - c - shift_i)/scale_i,
// where m_i is the mean of the light over the lines' part of the target that all frames show, t the
// profile of the target, and G_i the blur of frame i beyond that of the sharpest frame. t is common
// to all frames and moves and blurs with them; the bands b_i are independent of each other. t is
// the Wiener estimate for the ratio of the variances of b and t. Whatever the bands of all frames
// have in common, after the motion and the blur of the target, is taken for the target, which has
// no effect. What all frames have in common at the same lines and is smooth is left in the frames:
// it is shading. A frame that could not be registered is placed by the others.
FrameBands MeasureBands(const FramePlaces& places, BandAxis axis, int threads);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_FRAME_BANDS_H_
