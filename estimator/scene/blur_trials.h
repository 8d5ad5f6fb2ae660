#ifndef THICKLENS_ESTIMATOR_SCENE_BLUR_TRIALS_H_
#define THICKLENS_ESTIMATOR_SCENE_BLUR_TRIALS_H_

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/lower_bounds.h"
#include "thicklens/estimator/blur_check.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// Explains one photograph with one blur after the other.
class BlurTrials {
 public:
  struct Photograph {
    model::LinearImage image;  // without fall-off
    DisparityMap disparity;    // disparity of its pixels, 0 in the plane of focus
    Eigen::ArrayXXd weights;
    model::TransferCurve transfer;
    double noise_sigma = 0;  // of encoded values
    ClippedValues clipped = {};
  };
  // Solves with the given blur, whose H is `given`. `options` apply to the other blurs; their
  // `progress` is called repeatedly, from any thread, and may throw to stop.
  BlurTrials(Photograph photograph, const SceneProjection<float>& given, ProjectionOptions options);

  // Results of the given blur, as defined in BlurCheck.
  int blocks() const { return blocks_; }
  int unexplained_blocks() const { return unexplained_blocks_; }
  BlurTrial given() const;
  int iterations() const { return iterations_; }

  // Solves with another blur, starting from the last solution.
  BlurTrial Try(double blur_scale, double focus_offset_px);

 private:
  struct Block {
    double pixels = 0;  // count of pixels that the whole aperture sees as the centre does
    double misfit = 0;  // mean of their W (H r - I)^2, relative to that of the noise
    double trace = 0;   // mean of their part of the trace
  };

  std::vector<Block> Solve(const SceneProjection<float>& projection, const DisparityMap& disparity);
  std::size_t BlockOf(std::size_t pixel) const;

  const Photograph photograph_;
  const ProjectionOptions options_;
  std::vector<float> slope_squared_, weight_, radiance_;
  std::vector<unsigned char> is_visible_;
  double strength_ = 0;
  int iterations_ = 0;
  std::vector<Block> given_;
  int blocks_ = 0, unexplained_blocks_ = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_BLUR_TRIALS_H_
