#ifndef THICKLENS_CALIB_SPECTRUM_SPECTRAL_TRANSFER_H_
#define THICKLENS_CALIB_SPECTRUM_SPECTRAL_TRANSFER_H_

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The transfer function H of the blur at one frequency, and d ln H/dV.
struct TransferAndSlope {
  double value = 1, log_slope = 0;  // units: 1 and 1/px^2
};

// H of a frame of that scale at |nu|, cycles per target px, for a blur of V px^2 on the target:
//   Gaussian: exp(-2 pi^2 V nu^2);  disc: the blur floor's Gaussian times the disc's, for the part
//   of V beyond the floor.
// `floor_variance_px2` is the sigma^2 of the blur floor on the sensor; a Gaussian does not use it.
// Noise may make V, or the disc's part of it, negative: H is continued smoothly.
TransferAndSlope SpectralTransfer(model::Psf psf, double floor_variance_px2, double variance_px2,
                                  double scale, double nu);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_SPECTRAL_TRANSFER_H_
