#include "calib/spectrum/spectral_options.h"

namespace thicklens::calib {

model::Psf OtherPsf(model::Psf psf) {
  return psf == model::Psf::kGaussian ? model::Psf::kDisc : model::Psf::kGaussian;
}

double UsualBand(model::Psf psf) {
  return psf == model::Psf::kGaussian ? 2 : 1;  // a disc's first zero is at 1.84
}

RelativeBlurOptions SpectralOptions(model::Psf psf, double floor_variance_px2, double part) {
  RelativeBlurOptions options;
  options.psf = psf;
  options.band = part * UsualBand(psf);
  options.floor_variance_px2 = floor_variance_px2;
  return options;
}

}  // namespace thicklens::calib
