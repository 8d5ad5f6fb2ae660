#ifndef THICKLENS_CALIB_SPECTRUM_SPECTRAL_METER_H_
#define THICKLENS_CALIB_SPECTRUM_SPECTRAL_METER_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/spectrum/frame_spectrum.h"
#include "calib/spectrum/relative_spectrum.h"

namespace thicklens::calib {

// A frame as the meter needs it.
struct MeterFrame {
  std::size_t frame = 0;  // index into the sweep
  FramePlace place;       // relative to the reference
  double rotation_rad = 0;
  double expected_variance_px2 = 0;  // V = sigma^2/scale^2 to be expected, of the target
  double pixel_noise = 0;
};

// A part of the target whose blur is fitted by itself.
struct MeterRegion {
  TargetWindow window;
  std::vector<std::size_t>
      frames;                 // index into SpectralMeterSetup::frames, the reference among them
  std::size_t reference = 0;  // index into `frames`
  std::vector<Mode> modes;
  std::vector<SpectrumSample> samples;  // one a frame
  WindowLeakage leakage;
};

struct SpectralMeterSetup {
  std::vector<MeterFrame> frames;
  std::size_t reference = 0;  // index into `frames`
  Eigen::Vector2d origin_px{0, 0};
  Eigen::Vector2d size_px{0, 0};  // of the frames
  model::Psf psf = model::Psf::kGaussian;
  int modes_per_ring = 200;
  int threads = 0;
  std::function<cv::Mat(std::size_t frame)> read_grey;  // by the sweep's index
  std::function<void()> tick;                           // once a frame
};

// The largest window that every one of the frames sees, and the frames that keep enough modes in
// it: sqrt(V - Vmin) below 1/35 of its smaller side, up to 1/16 where too few would be left. `part`
// and `place` cut a smaller one out: its size in parts of the whole, its middle from -1/2 to 1/2 of
// the whole. Nothing where fewer than five frames would be left.
std::optional<MeterRegion> PlanRegion(const SpectralMeterSetup& setup, double part,
                                      const Eigen::Vector2d& place);

// Reads every frame once and measures its spectrum in every region; frames that a region does not
// see are dropped from it.
void MeasureRegions(const SpectralMeterSetup& setup, std::vector<MeterRegion>* regions);

// A measured region with those of its frames and modes alone for which the predicates hold; `frame`
// gets an index into SpectralMeterSetup::frames. The reference must be kept.
MeterRegion PartOf(const MeterRegion& region, const std::function<bool(std::size_t frame)>& frame,
                   const std::function<bool(const Mode& mode)>& mode);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_SPECTRAL_METER_H_
