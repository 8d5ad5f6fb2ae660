#ifndef THICKLENS_CALIB_SWEEP_FIXED_PATTERN_REMOVAL_H_
#define THICKLENS_CALIB_SWEEP_FIXED_PATTERN_REMOVAL_H_

#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

// Structure that is fixed to the frame, and is removed from the linear light of every frame of a
// sweep. It has the size of the region of interest.
class FixedPatternRemoval {
 public:
  // `log_gain`: ln of the relative light that passes at each pixel, CV_32F. `filled`: CV_8U, not 0
  // at the pixels whose values are not used; empty: none.
  FixedPatternRemoval(const cv::Mat& log_gain, const cv::Mat& filled);

  // Both corrections in one; `more` comes on top of this one.
  FixedPatternRemoval With(const FixedPatternRemoval& more) const;

  // Divides by the gain. Then each pixel to be filled becomes the mean of the pixels around its
  // group, with weights 1/distance^3. `light` is CV_32F.
  void Apply(cv::Mat* light) const;

  // CV_8U, not 0 at the pixels that are filled. The caller must not write to it.
  const cv::Mat& filled() const { return filled_; }

 private:
  struct Source {
    cv::Point from;
    float weight;
  };
  struct Fill {
    cv::Point at;
    std::vector<Source> sources;  // weights that sum to 1
  };

  cv::Mat log_gain_, filled_, inverse_gain_;
  std::vector<Fill> fills_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_FIXED_PATTERN_REMOVAL_H_
