#ifndef THICKLENS_ESTIMATOR_BLUR_CHECK_H_
#define THICKLENS_ESTIMATOR_BLUR_CHECK_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/base/progress.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Checks whether a photograph requires another blur than camera and depth specify.
//
// The scene is solved for, with total variation, as if the blur of every point were `blur_scale`
// times as wide (as with another blur ratio kappa), or as if the camera were focused elsewhere, so
// that every disparity is `focus_offset_px` larger. Weights, noise and the strength of the prior
// remain those of the given blur. The check covers blocks of 32 x 32 px, without the pixels that
// look past edges. A block is unexplained if the misfit W |H r - I|^2 has more than 1.2 times the
// variance of the noise; there another blur must do better in generalised cross-validation.
//
// Too wide a blur is detected: it cannot explain the details that the photograph has. Too narrow a
// blur is not: the radiance takes up the remainder, and nothing is unexplained. So a narrower blur
// is proposed where it explains most of the misfit of the given one, and a wider one never. A wrong
// plane of focus makes the blur too wide on one side of it; where the unexplained blocks are on
// that side alone, a narrower blur explains them as well. Derived here [D109].
struct BlurTrial {
  double blur_scale = 1;  // tested blur over the given one
  double focus_offset_px =
      0;  // px per view step, on the axis of the larger step; nearer is positive
  // Cross-validation score: the mean over the blocks, relative to that of the given blur. Blocks
  // that are no longer informative count as unchanged.
  double score = 1;
  // Excess of that score over 1.2 variances of the noise in the unexplained blocks, relative to
  // that of the given blur.
  double unexplained = 1;
  double compared_share = 0;  // share of the photograph's pixels in informative blocks
};

// How CheckBlur is run.
struct BlurCheckOptions {
  bool falloff = true;  // use the irradiance of [S12] if there is a camera
  int threads = 0;      // 0: one per core
  // Error of the photograph's compression, in its encoded values, which its noise does not show.
  double compression_sigma = 0;
  // Limit for the whole process. Where the image needs more, only rows in its middle are checked.
  std::optional<double> memory_limit_mib;
  ProgressFunction progress;  // called for each trial and repeatedly between trials

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// What CheckBlur found.
struct BlurCheck {
  std::string message = "not run";  // how it ended, one line
  // The noise of encoded values in the image that was checked, with
  // BlurCheckOptions::compression_sigma.
  double noise_sigma = 0;
  int blocks = 0;                 // number of informative blocks
  int unexplained_blocks = 0;     // number of these that the given blur leaves unexplained
  std::vector<BlurTrial> trials;  // the blurs and planes of focus that were tested
  // The widest blur and the smallest offset of the trials that do about as well as the best. If
  // both are set, the photograph does not decide between them.
  std::optional<BlurTrial> narrower_blur, other_focus;
  // True: the proposal is at the end of the tested range.
  bool narrower_blur_at_end = false, other_focus_at_end = false;
  int width_px = 0, height_px = 0;  // size of the part that was checked, in px of the halved image
  int halvings = 0;                 // number of times that the image was halved
  int iterations = 0;               // of all solves together
  double seconds = 0;               // time of the check
};

// Solves once for the photograph, at half its size unless it is small, and six to sixteen times
// more if blocks remain unexplained. Throws Error for options and inputs that do not fit, and for a
// memory limit that is too low. The result does not depend on the number of threads.
THICKLENS_EXPORT BlurCheck CheckBlur(const EstimateInput& input, const BlurCheckOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLUR_CHECK_H_
