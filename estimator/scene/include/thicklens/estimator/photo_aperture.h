#ifndef THICKLENS_ESTIMATOR_PHOTO_APERTURE_H_
#define THICKLENS_ESTIMATOR_PHOTO_APERTURE_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// How wide the aperture was through which a photograph was taken, over that of the views: 1 if the
// photograph shows the blur that depth and views predict, 0 if it is equally sharp at all depths.
// The standard deviation of its blur is that share of the predicted one.
//
// The photograph is cut into tiles of 32 x 32 px that show one depth. The expected spectrum of a
// tile is
//
//   A(direction) |f|^(-alpha) exp(-(2 pi sigma0 f)^2) OTF^2(s d f) + N,
//
// where d is the tile's disparity, s the share, sigma0 a blur of the whole photograph (the lens at
// its focus, the file), and N noise up to that of the photograph. A, alpha and N are chosen for
// each tile, sigma0 for all together. The negative logarithm of the likelihood of independent
// exponentially distributed powers (Whittle) is divided by the tile's overdispersion and limited,
// so that no single texture decides. If the share differs from 1, a Gaussian aperture of the same
// standard deviation is tried as well, and the likelier of the two is taken. The standard deviation
// of the share is the larger one of the likelihood and of a delete-one jackknife over 4 x 4 parts
// of the photograph, with a systematic 0.05; and the variance of the blur is uncertain by 0.25
// px^2, as sharp textures differ by that. Derived here [D179].
//
// A share below 1 is also what a wrong map may look like. So the map with its rows, its columns or
// both reversed, and with eight offsets of its disparity, is tried with the whole aperture: unless
// the measured share is clearly likelier than all of these, the verdict is kContradicted. A scale
// of the disparities that is wrong everywhere is the same as another aperture and cannot be
// distinguished from it.
struct PhotoAperture {
  // Meaning of the share for the photograph.
  enum class Verdict {
    kNotMeasured,   // it was stated
    kCaptured,      // the share is consistent with 1
    kSharp,         // the share is consistent with 0
    kPartial,       // the share lies between
    kUndecided,     // the photograph does not show it
    kContradicted,  // a reversed map or another focus explains the photograph better
  };
  // The share of one part of the photograph.
  struct Region {
    int x = 0, y = 0, width_px = 0, height_px = 0;  // top-left pixel and size, photograph's px
    int tiles = 0;                                  // number of tiles
    double predicted_sigma_px = 0;                  // rms of their predicted blur, photograph's px
    // Measured share, and its standard deviation; absent where the part does not show it.
    std::optional<double> share, sigma;
  };
  Verdict verdict = Verdict::kNotMeasured;  // what the share says
  std::string message = "not run";          // how it ended, one line
  // The measured share and its standard deviation, which contains the scatter between regions;
  // absent if too few tiles have texture.
  std::optional<double> share, sigma;
  // Standard deviation of the share's square. A blur of some tenths of a px cannot be distinguished
  // from none, so that this and not `sigma` decides what is consistent with 0 and 1.
  double sigma_of_square = 0;
  // Logarithms of the likelihoods of the measured share over 1, and over 0.
  double evidence_against_captured = 0, evidence_against_sharp = 0;
  int tiles = 0;                // number of tiles with texture and one depth
  double largest_sigma_px = 0;  // of their predicted blur, photograph's px
  std::vector<Region> regions;  // parts with tiles, row by row
  double seconds = 0;           // time of the measurement

  // The share that an estimate should use: that of the verdict.
  THICKLENS_EXPORT double used_share() const;
  // Whether the photograph shows less than the predicted blur, beyond doubt.
  THICKLENS_EXPORT bool is_narrower() const;
};

// How MeasurePhotoAperture is run.
struct PhotoApertureOptions {
  int threads = 0;  // 0: one per core
  // Error of the photograph's compression, in its encoded values, which its noise does not show.
  double compression_sigma = 0;

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Measures the share. Throws Error for options and inputs that do not fit. The result does not
// depend on the number of threads.
THICKLENS_EXPORT PhotoAperture MeasurePhotoAperture(const EstimateInput& input,
                                                    const PhotoApertureOptions& options);

// Returns "not measured", "captured", "sharp", "partial", "undecided" or "contradicted".
THICKLENS_EXPORT std::string PhotoVerdictName(PhotoAperture::Verdict verdict);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PHOTO_APERTURE_H_
