#ifndef THICKLENS_ESTIMATOR_DEPTH_VALUES_H_
#define THICKLENS_ESTIMATOR_DEPTH_VALUES_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// One way to make disparities of a map: scale * d + offset.
struct DepthValuesTrial {
  double scale = 1;      // factor of the map's disparities
  double offset_px = 0;  // added then, px per view step of the larger step
  // Logarithm of the likelihood ratio of the spectra of the photograph's tiles against spectra
  // without the ripples of a blur.
  double evidence = 0;
};

// What FitDepthValues found.
struct DepthValuesFit {
  std::string message = "not run";  // how it ended, one line
  // The photograph determines scale and offset, and its blur is that of the stated aperture.
  bool is_found = false;
  DepthValuesTrial given;                       // the map as it is
  DepthValuesTrial best;                        // the values that agree best
  double scale_sigma = 0, offset_sigma_px = 0;  // standard deviations of the best
  // Logarithm of the likelihood ratio of the best against the map as it is, and its standard
  // deviation.
  double gain = 0, gain_sigma = 0;
  // With DepthValuesSearch::kAll: other values that explain the blur about as well, as those on
  // the other side of the plane of focus may. is_found is false if there are any.
  std::vector<DepthValuesTrial> others;
  int tiles = 0;       // number of tiles that were compared
  double seconds = 0;  // time that it took
};

// Which values are looked for.
enum class DepthValuesSearch {
  kNear,  // those about the given ones: a scale of 0.7 to 1.4
  kAll,   // all with a positive scale: nothing is known but which values are near
};

// How FitDepthValues is run.
struct DepthValuesOptions {
  DepthValuesSearch search = DepthValuesSearch::kNear;  // which values are looked for
  // Error of the photograph's compression, in its encoded values, which its noise does not show.
  double compression_sigma = 0;
  int threads = 0;  // 0: one per core

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Finds the scale and the offset of the disparities with which the blur of the photograph agrees.
//
// An aperture has frequencies that it does not let through; the spectrum of a tile that shows one
// depth has minima there, which depend on its blur and not on its texture. The evidence of tiles of
// 32 x 32 and 64 x 64 px, at every frequency and limited for each tile, is summed for all values,
// and the largest sum is that of the best ones. Their standard deviations are those of a delete-one
// jackknife over 4 x 4 parts of the photograph, with a systematic part. Derived here [D195],
// [D196].
//
// A scale cannot be distinguished from another width of the aperture, and a pair of scale and
// offset not from the negative of both. Where a disc explains the photograph better than the stated
// aperture, nothing is found. An aperture without ripples, as a Gaussian one, shows nothing, nor
// does a photograph that is sharp at all depths.
//
// Throws Error for options and inputs that do not fit. The result does not depend on the number of
// threads.
THICKLENS_EXPORT DepthValuesFit FitDepthValues(const EstimateInput& input,
                                               const DepthValuesOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_VALUES_H_
