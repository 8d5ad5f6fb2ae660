#ifndef THICKLENS_ESTIMATOR_BLUR_CHECK_H_
#define THICKLENS_ESTIMATOR_BLUR_CHECK_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Whether a photograph asks for another blur than camera and depth say.
//
// The scene is solved for, with total variation, as if the blur of every point were `blur_scale`
// times as wide (as with another blur ratio kappa), or as if the camera were focused elsewhere, so
// that every disparity is `focus_offset_px` larger. Weights, noise and the strength of the prior
// stay as they are for the given blur. Looked at are blocks of 32 x 32 px, without the pixels that
// look past edges. One is unexplained if the misfit W |H r - I|^2 has more than 1.2 times the
// variance of the noise; there another blur must do better in generalised cross-validation.
//
// Too wide a blur shows: it cannot explain the details that the photograph has. Too narrow a blur
// does not: the radiance takes up what it leaves, and nothing is unexplained. So a narrower blur is
// proposed where it explains most of what the given one leaves, and a wider one never. A plane of
// focus that is off makes the blur too wide on one side of it; where the unexplained blocks lie on
// that side alone, a narrower blur explains them as well. Derived here [D109].
struct BlurTrial {
  double blur_scale = 1;
  double focus_offset_px = 0;  // per view step, on the axis of the larger step; near is positive
  // Cross-validation, the mean over the blocks, over that of the given blur. Blocks that tell
  // nothing any more count as unchanged.
  double score = 1;
  // The same over the unexplained blocks, of what exceeds 1.2 variances of the noise.
  double unexplained = 1;
  double compared_share = 0;  // of the photograph's pixels, in blocks that tell something
};

struct BlurCheckOptions {
  bool falloff = true;  // the irradiance of [S12], where there is a camera
  int threads = 0;      // 0: one per core
  // For the whole process. Where the picture takes more, rows in its middle are looked at.
  std::optional<double> memory_limit_mib;
  // Called from any thread, one at a time, for each trial and now and then between. May throw to
  // stop.
  std::function<void(int done, int total)> progress;

  bool IsValid(std::string* why) const;
};

struct BlurCheck {
  std::string message = "not run";
  double noise_sigma = 0;      // of stored values, in the picture that was looked at
  int blocks = 0;              // that tell something
  int unexplained_blocks = 0;  // of these, with the given blur
  std::vector<BlurTrial> trials;
  // Of the trials, the widest blur and the smallest offset that do about as well as the best. Both:
  // the photograph does not tell which of them it is.
  std::optional<BlurTrial> narrower_blur, other_focus;
  // Nothing beyond was tried.
  bool narrower_blur_at_end = false, other_focus_at_end = false;
  int width_px = 0, height_px = 0;  // that were looked at, of the picture at its halved size
  int halvings = 0;                 // of that size
  int iterations = 0;
  double seconds = 0;
};

// Solves once for the photograph, at half its size unless it is small, and where blocks are left
// unexplained six to sixteen times more. Throws Error for options and inputs that do not fit, and a
// memory limit that is too low. The result does not depend on the number of threads.
BlurCheck CheckBlur(const EstimateInput& input, const BlurCheckOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLUR_CHECK_H_
