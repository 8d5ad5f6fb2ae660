#ifndef THICKLENS_ESTIMATOR_DEPTH_CONTRADICTION_H_
#define THICKLENS_ESTIMATOR_DEPTH_CONTRADICTION_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// A fault of a depth map that contradicts its photograph.
enum class DepthCause {
  kNone,          // nothing: the map as it is
  kRows,          // its rows are stored from the bottom
  kColumns,       // its columns are stored from the right
  kBoth,          // it is turned by 180 degrees
  kQuarterRight,  // it has to be turned by 90 degrees clockwise; square maps only
  kQuarterLeft,   // it has to be turned by 90 degrees counter-clockwise; square maps only
  kShift,         // it lies beside the photograph
  kSign,          // near and far are exchanged
  kScale,         // its disparities need another scale
  kOffset,        // they need another offset, as with another plane of focus
  kScaleOffset,   // they need both
  kSharp,         // the photograph is sharp at all depths
  kOtherImage,    // it belongs to another image
};
// Returns "none", "rows", "columns", "both", "quarter-right", "quarter-left", "shift", "sign",
// "scale", "offset", "scale-and-offset", "sharp" or "other-image".
THICKLENS_EXPORT std::string DepthCauseName(DepthCause cause);

// The evidence of the photograph about the map after one change.
struct DepthCauseTrial {
  DepthCause cause = DepthCause::kNone;  // the reason that the change removes
  double scale = 1;                      // factor of the disparities
  double offset_px = 0;  // added to the disparities then, px per view step of the larger step
  int shift_x_px = 0, shift_y_px = 0;  // by which the map moves right and down, px
  // Standard deviations by which the edges of the map lie on edges of the photograph more often
  // than at other places. Absent for maps with hardly any edge, and for changes of the values.
  std::optional<double> edges;
  // Logarithm of the likelihood ratio of the spectra of the photograph's tiles against the map as
  // it is, and its standard deviation. Absent where fewer than 6 tiles show one depth.
  std::optional<double> spectra, spectra_sigma;
  // Standard deviations by which the map, so changed, explains the reduced photograph better than
  // the map as it is; 0 where their squares differ by less than 1 %. Found only for changes that
  // leave the amount of blur. A narrower blur explains any photograph better.
  std::optional<double> residual;
};

// What CheckContradiction found.
struct DepthContradiction {
  std::string message = "not run";  // how it ended, one line
  bool is_contradicted = false;     // the photograph contradicts the map
  // The causes that explain the photograph, the most likely one first; the others do so about as
  // well. Empty without a contradiction.
  std::vector<DepthCauseTrial> causes;
  // The causes are changes of the values, and the photograph does not decide by 4 standard
  // deviations which of the two signs the changed disparities have.
  bool is_sign_open = false;
  // Why scale and offset of the values were not tested; empty if they were, and where the order or
  // the place of the map is the fault.
  std::string values_untested = {};
  std::vector<DepthCauseTrial> trials;  // all that were tested, the map as it is first
  double seconds = 0;                   // time of the check
};

// How CheckContradiction is run.
struct DepthContradictionOptions {
  bool falloff = true;  // use the irradiance of [S12] if there is a camera
  // Error of the photograph's compression, in its encoded values, which its noise does not show.
  double compression_sigma = 0;
  double photo_aperture = 1;  // of SceneOptions
  // Whether scale and offset of the values are tested also where the place of the edges agrees:
  // where something else casts doubt on them.
  bool check_values = true;
  int threads = 0;  // 0: one per core

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Checks whether a photograph contradicts its depth map, and finds the most likely reasons.
//
// Edges of the depth are edges of the photograph as well, at least in part. For each place of the
// map within a tenth of the image, sum the strength of its edges times the rank of the
// photograph's gradient, and both once more with the cosine and the sine of twice their direction:
//
//   C(t) = sum_x e(x) [R(x + t) - 1/2 + R(x + t) cos 2(theta_d(x) - theta_I(x + t))]
//
// less its mean over 17 x 17 px around t, and divided by the standard deviation at places farther
// off. It does not depend on blur, scale or sign. Only a map whose edges lie there no more often
// than elsewhere may be turned, shifted or another image's; only one whose edges lie there may have
// wrong values. These are tested by the spectra of tiles, as in PhotoAperture, which contain |d|
// alone, so that the sign follows from the residual at edges only. Derived here [D184], [D185].
//
// Throws Error for inputs that do not fit. The result does not depend on the number of threads.
THICKLENS_EXPORT DepthContradiction CheckContradiction(const EstimateInput& input,
                                                       const DepthContradictionOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_CONTRADICTION_H_
