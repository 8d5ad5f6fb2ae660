#ifndef THICKLENS_CALIB_SPECTRUM_EXPECTED_BLUR_H_
#define THICKLENS_CALIB_SPECTRUM_EXPECTED_BLUR_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/spectrum/relative_spectrum.h"

namespace thicklens::calib {

// A frame whose spectrum is expected, before it is taken.
struct ExpectedSpectrum {
  double scale = 1;         // relative to the reference
  double variance_px2 = 0;  // V: sigma^2/scale^2, px^2 of the target, absolute
  double noise = 0;       // variance of a complex value of the spectrum, before the box is divided
  std::size_t modes = 0;  // number of leading modes that are measured
};

// The errors that FitRelativeBlur is expected to have.
struct ExpectedBlur {
  bool done = false;
  std::string message = "not run";
  Eigen::MatrixXd covariance;   // of V; 0 in row and column of the reference
  std::vector<int> modes_used;  // number of modes of each frame in its band
};

// The inverse of the Fisher information about V, with the gains and the texture eliminated [D152]:
// for the spectra G_i(k) = g_i H_i(k) T(k) + noise, with P_k = sum_i |H_i|^2/N_i, it is
//   sum_k |T|^2 (delta_ij |H_i|^2/N_i - |H_i|^2/N_i |H_j|^2/N_j/P_k) d_i d_j, d = (1, d ln H/dV).
// `power` is |T|^2 of each mode, the texture's without any blur. It is the same information that
// FitRelativeBlur has at the end of its fit.
ExpectedBlur ExpectBlur(const std::vector<ExpectedSpectrum>& frames, std::size_t reference,
                        const TargetWindow& window, const std::vector<Mode>& modes,
                        const Eigen::ArrayXd& power, const RelativeBlurOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_EXPECTED_BLUR_H_
