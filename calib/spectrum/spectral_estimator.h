#ifndef THICKLENS_CALIB_SPECTRUM_SPECTRAL_ESTIMATOR_H_
#define THICKLENS_CALIB_SPECTRUM_SPECTRAL_ESTIMATOR_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/spectrum/frame_spectrum.h"
#include "calib/spectrum/relative_spectrum.h"

namespace thicklens::calib {

// The data of a frame that the estimator needs.
struct EstimatorFrame {
  std::size_t frame = 0;  // index into the sweep
  FramePlace place;       // relative to the reference
  double rotation_rad = 0;
  double expected_variance_px2 = 0;  // expected V = sigma^2/scale^2, px^2 of the target
  double pixel_noise = 0;
};

// A part of the target whose blur is fitted separately.
struct EstimatorRegion {
  TargetWindow window;
  std::vector<std::size_t>
      frames;                 // index into SpectralEstimatorSetup::frames, including the reference
  std::size_t reference = 0;  // index into `frames`
  std::vector<Mode> modes;
  std::vector<SpectrumSample> samples;  // one sample per frame
  WindowLeakage leakage;
};

struct SpectralEstimatorSetup {
  std::vector<EstimatorFrame> frames;
  std::size_t reference = 0;  // index into `frames`
  Eigen::Vector2d origin_px{0, 0};
  Eigen::Vector2d size_px{0, 0};  // size of the frames
  model::Psf psf = model::Psf::kGaussian;
  int modes_per_ring = 200;
  // Leaves out the modes that are constant along the rows (or the columns): those of bands that
  // were divided out, with the errors of that.
  bool without_row_modes = false, without_column_modes = false;
  int threads = 0;
  std::function<cv::Mat(std::size_t frame)> read_grey;  // argument: index into the sweep
  std::function<void()> tick;                           // called once per frame
};

// Plans the largest window that all of its frames see, and selects the frames that keep enough
// modes in it: sqrt(V - Vmin) is below 1/35 of its smaller side, or up to 1/16 where too few frames
// would remain. `part` and `place` select a smaller window: its size relative to the whole, and its
// centre from -1/2 to 1/2 of the whole. Returns std::nullopt where fewer than five frames would
// remain.
std::optional<EstimatorRegion> PlanRegion(const SpectralEstimatorSetup& setup, double part,
                                          const Eigen::Vector2d& place);

// The modes of a window among which those of a region are chosen, in the order of |nu|, and the
// least power of a chosen one, relative to the noise.
std::vector<Mode> CandidateModes(const TargetWindow& window);
inline constexpr double kSignalToNoise = 4;
// The frames that show which modes have power: the reference and its sharpest companions.
std::vector<std::size_t> FramesThatShowModes(const SpectralEstimatorSetup& setup,
                                             const EstimatorRegion& region);
// The number of leading modes that are measured in a frame of that scale, whose V is larger than
// the least one by `added_variance_px2`.
std::size_t ModesInBand(const std::vector<Mode>& modes, const TargetWindow& window, double scale,
                        double added_variance_px2);

// Reads every frame once and measures its spectrum in every region. Frames that a region does not
// see are removed from it.
void MeasureRegions(const SpectralEstimatorSetup& setup, std::vector<EstimatorRegion>* regions);

// The leakage of a measured region's window for blur along x and along y, for a blur of up to
// `largest_variance_px2` beyond that of the reference, px^2 of the target. Both axes are turned by
// `angle_rad` from x towards y, as RelativeBlurOptions::axis_angle_rad.
AxisLeakage MeasureAxisLeakage(const SpectralEstimatorSetup& setup, const EstimatorRegion& region,
                               double largest_variance_px2, double angle_rad = 0);

// Part of a measured region: only those frames and modes for which the predicates are true. The
// argument of `frame` is an index into SpectralEstimatorSetup::frames. The reference must be kept.
EstimatorRegion PartOf(const EstimatorRegion& region,
                       const std::function<bool(std::size_t frame)>& frame,
                       const std::function<bool(const Mode& mode)>& mode);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_SPECTRAL_ESTIMATOR_H_
