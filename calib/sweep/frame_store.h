#ifndef THICKLENS_CALIB_SWEEP_FRAME_STORE_H_
#define THICKLENS_CALIB_SWEEP_FRAME_STORE_H_

#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/sweep/fixed_pattern_removal.h"
#include "calib/sweep/kept_frames.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// The frames of a sweep for steps that use them repeatedly. They are kept as they were read
// (KeptFrames), together with those of other stores if the sweep's own reader keeps them. The store
// is thread safe, and results do not depend on which frames are kept.
class FrameStore {
 public:
  // `sweep` must outlive the store. The limit is that of a reader that keeps no frames itself.
  explicit FrameStore(const FocusSweep& sweep, std::size_t byte_limit = KeptFrames::kDefaultLimit);

  // Returns the whole frame as its file stores it. The caller must not write to it. Throws what the
  // reader throws.
  cv::Mat Stored(std::size_t index);

  // Removes `correction`, or nothing, from all light that is returned from now on. Must not be
  // called while another thread reads.
  void SetCorrection(const std::optional<FixedPatternRemoval>& correction);
  // The correction that is set; null: none.
  const FixedPatternRemoval* correction() const { return correction_.get(); }

  // Divides the light of frame i by exp(log_gain[i][line]) from now on, where the lines are the
  // rows (or columns) of the region of interest; a frame without values is not changed. It replaces
  // what was set before. Must not be called while another thread reads.
  void SetLineGains(const std::vector<std::vector<double>>& log_gain, bool are_columns);

  // Returns the region of interest in linear light, CV_32F, corrected.
  cv::Mat Grey(std::size_t index);
  // Returns one colour channel, corrected: 0 red, 1 green, 2 blue; a frame with one channel has 0
  // alone. Throws Error if the frame has no such channel.
  cv::Mat Channel(std::size_t index, int channel);

  std::size_t kept_bytes() const { return kept_.kept_bytes(); }

 private:
  const FocusSweep& sweep_;
  KeptFrames kept_;
  std::unique_ptr<const FixedPatternRemoval> correction_;
  std::vector<cv::Mat> line_factors_;  // one row or column for each frame; empty: none

  void Correct(std::size_t index, cv::Mat* light) const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_FRAME_STORE_H_
