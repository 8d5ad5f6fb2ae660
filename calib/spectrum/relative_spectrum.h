#ifndef THICKLENS_CALIB_SPECTRUM_RELATIVE_SPECTRUM_H_
#define THICKLENS_CALIB_SPECTRUM_RELATIVE_SPECTRUM_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/spectrum/frame_spectrum.h"
#include "calib/spectrum/window_leakage.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Blur of the frames of a sweep relative to each other [D77], independent of the texture. The
// windowed spectra of all frames are fitted together by
//   G_i(nu) = g_i H_i(nu) exp(-2 pi i nu.t_i) T(nu).
// T is the texture's own spectrum (free at every frequency: variable projection), g_i a gain near
// 1, t_i a shift that the registration left over, and H_i the transfer function of the blur:
//   Gaussian: exp(-2 pi^2 V_i |nu|^2);  disc: the blur floor's Gaussian times the disc's.
// V_i, px^2 of the target, is the blur variance over scale^2, without the pixel box. T contains any
// common blur, so that V is known only up to a constant. (The shape of a disc would determine the
// constant, but the reference's V is held there, too.)

struct SpectrumSample {
  double scale = 1;
  FrameSpectrum spectrum;
  double pixel_noise = 0;         // standard deviation of a pixel of the frame
  double start_variance_px2 = 0;  // V, relative to the reference for a Gaussian, otherwise absolute
  // V along x and along y at the start of FitAxialBlur; absent: start_variance_px2 for both.
  std::optional<Eigen::Vector2d> start_variances_px2;
};

struct RelativeBlurOptions {
  model::Psf psf = model::Psf::kGaussian;
  // A mode is used in a frame where 2 pi^2 (V - Vmin) nu^2 is below this limit. It is 2 for a
  // Gaussian. A disc's first zero is at 1.84; its limit must be well below.
  double band = 2;
  double floor_variance_px2 = 0.25;  // disc: sigma^2 of the blur floor, sensor px
  // Holds g at 1: the spectra are relative to the mean of their frame. A halo around the blur takes
  // contrast at all frequencies alike, which a free gain would take for a change of the light.
  bool hold_gains = false;
  // FitAxialBlur: the angle by which its axes are turned from x and y, from x towards y.
  double axis_angle_rad = 0;
};

struct RelativeBlur {
  bool done = false;
  std::string message = "not run";
  Eigen::VectorXd variances_px2;  // V of each sample; that of the reference is held
  Eigen::MatrixXd covariance;     // covariance of V; 0 in row and column of the reference
  Eigen::VectorXd gains;          // g
  Eigen::Matrix2Xd shifts_px;     // t
  Eigen::VectorXd noise_ratio;    // scatter about the fit over what the pixel noise explains
  // Power of the scatter about the fit over that of the sample's own spectrum: the mean of rings of
  // |nu| with equally many modes. Near 0, the fit describes the sample; near 1, the sample shows
  // another image.
  Eigen::VectorXd misfit;
  std::vector<int> modes_used;  // number of modes of each sample
  double chi2_per_dof = 0;      // all samples, relative to the pixel noise
  // Departure of the shape from the family [D79]: H exp(4 tails u^2), u = 2 pi^2 v nu^2, where v is
  // the defocus alone. It is the same in all frames and does not change the second moment. 0 is the
  // family itself; to first order a disc is a Gaussian with -1/24. The value is one step of the fit
  // from 0; `variance_by_tails` is the response of V.
  model::Estimate tails;
  Eigen::VectorXd variance_by_tails;  // dV/d tails, px^2
  Eigen::ArrayXcd texture;            // T
};

// Factor by which neighbouring modes widen the variances of independent ones. They share a sixth of
// their noise and of the texture's amplitude (the transform of the squared Hann window), so that it
// is (1 + 2/36)^2.
inline constexpr double kSharedNoise = 1.114;
// The noise of a spectrum is that of a complex value. The derivatives by gains and blurs are
// affected only by its real part.
inline constexpr double kRealPart = 0.5;

RelativeBlur FitRelativeBlur(const std::vector<SpectrumSample>& samples, std::size_t reference,
                             const TargetWindow& window, const std::vector<Mode>& modes,
                             const WindowLeakage& leakage, const RelativeBlurOptions& options);

// Blur along x and along y of each sample.
struct AxialBlur {
  bool done = false;
  std::string message = "not run";
  Eigen::Matrix2Xd
      variances_px2;            // V_x and V_y, px^2 of the target; those of the reference are held
  Eigen::MatrixXd covariance;   // of V_x and V_y of the samples in turn: x0, y0, x1, y1 ..
  Eigen::VectorXd gains;        // g
  Eigen::Matrix2Xd shifts_px;   // t
  Eigen::VectorXd noise_ratio;  // scatter about the fit over what the pixel noise explains
  Eigen::VectorXd misfit;       // as that of RelativeBlur
  std::vector<int> modes_used;  // number of modes of each sample
  double chi2_per_dof = 0;      // all samples, relative to the pixel noise
  Eigen::ArrayXcd texture;      // T
};

// Fits the spectra with two variances per frame: V |nu|^2 in H becomes V_x nu_x^2 + V_y nu_y^2
// [D129]. Along a direction of frequency, V is then V_x cos^2 + V_y sin^2; a disc becomes an
// ellipse. V_x and V_y are each known up to a constant of its own. The band is a limit for each
// direction, because different frames may be sharpest along x and along y. It also ends where a
// frame is so much sharper than the reference that the window's leakage, which is measured on the
// reference, is not known.
AxialBlur FitAxialBlur(const std::vector<SpectrumSample>& samples, std::size_t reference,
                       const TargetWindow& window, const std::vector<Mode>& modes,
                       const AxisLeakage& leakage, const RelativeBlurOptions& options);

// The mean of the variances along x and along y, with its covariance. Unlike either of them and
// unlike a fit with one V, it does not depend on which direction has more texture. The tails are
// unknown, with an infinite sigma.
RelativeBlur MeanOfAxes(const AxialBlur& axial);

// The transfer function H of one frame at |nu|, cycles per target px.
double BlurTransfer(const RelativeBlurOptions& options, double variance_px2, double scale,
                    double nu);

// Measured H of one sample, for a plot: averaged over rings of |nu|, relative to the fitted
// texture.
struct TransferRing {
  double nu = 0;  // cycles per target px
  double measured = 0;
};
std::vector<TransferRing> MeasuredTransfer(const SpectrumSample& sample, const RelativeBlur& fit,
                                           std::size_t index, double reference_variance_px2,
                                           const TargetWindow& window,
                                           const std::vector<Mode>& modes,
                                           const WindowLeakage& leakage);

// Selects the modes with the largest values in `power` above `least_power`, up to `most_per_ring`
// in each of 24 rings of equal width in ln|nu|, so that strongly and weakly blurred frames both
// keep some. The result is in the order of |nu|.
std::vector<Mode> StrongestModes(const std::vector<Mode>& modes, const Eigen::ArrayXd& power,
                                 const TargetWindow& window, double least_power, int most_per_ring);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_RELATIVE_SPECTRUM_H_
