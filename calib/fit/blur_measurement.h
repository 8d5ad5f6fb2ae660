#ifndef THICKLENS_CALIB_FIT_BLUR_MEASUREMENT_H_
#define THICKLENS_CALIB_FIT_BLUR_MEASUREMENT_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/spectrum/spectral_meter.h"
#include "calib/spectrum/spectral_options.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

inline constexpr double kUsualRatio = 0.45;  // kappa to start with

// Everything that is known of a sweep when its blur is to be measured.
struct BlurTask {
  BlurTask(const FocusSweep& its_sweep, FrameStore& its_store)
      : sweep(its_sweep), store(its_store) {}

  const FocusSweep& sweep;
  FrameStore& store;
  std::vector<std::size_t> frames;      // of the sweep, those that passed the gates
  std::size_t reference = 0;            // of the sweep
  std::vector<ScaleSample> scales;      // registered frames
  bool scale_follows_readings = false;  // the scales obey a law: they may tell readings' errors
  BlurLaw law = BlurLaw::kPerspective;
  model::Estimate offset_mm;
  double scale_centre_mm = 0;  // depth of the centre of perspective
  double reading_sigma_mm = 0;
  bool reading_sigma_is_known = true;
  double start_focus_depth_mm = 0;
  double pixel_noise = 0;  // standard deviation of a pixel, of the sweep as a whole
  int threads = 0;
  std::function<void()> tick;  // once a frame and pass
};

// What the meters say.
struct BlurEvidence {
  BlurFitSetup setup;               // frames and meters filled in; the floor is left open
  std::vector<std::size_t> frames;  // of the sweep, for each of setup.frames
  int edges = -1, spectrum = -1;    // which of setup.meters they are, if they are there
  // Edges of a target that is not stated to be one, where its texture is what is fitted: what the
  // lens floor cannot exceed.
  std::optional<BlurSamples> unstated_edges;
  // The spectral meter with other choices, for the systematic errors: see CompareChoices.
  std::optional<BlurSamples> other_psf, narrow_band;
  model::Psf better_psf = model::Psf::kGaussian;
  std::optional<double> gaussian_misfit, disc_misfit;
  double shape_dof = 0;  // degrees of freedom of each misfit; 0: they are means over few edges
  std::vector<BlurExample> examples;
  std::vector<double> frame_noise_ratios;  // spectral scatter over the pixel noise, of setup.frames
  std::string message;                     // why there is no meter
  // The spectral meter's own set-up with what was found, for parts of the field and channels. It
  // reads the frames of the task's store.
  SpectralMeterSetup spectral;
  std::vector<std::size_t> fit_index;  // of spectral.frames in setup.frames
  double assumed_floor_px2 = 0;        // S0 that a disc's transfer function was told
  MeterRegion region;                  // the whole field, as measured
  RelativeBlur blur;                   // and as fitted
  double taken_tails = 0;              // of the blur: the family has them (TakeTails)
};

// Measures edges where the target has them (and is not stated to be a texture), and the relative
// spectra of all that could be registered. The other choices are left open.
BlurEvidence MeasureBlur(const BlurTask& task);

// One region's relative blur as samples of a fit, their frames those of the meter.
BlurSamples AsSamples(const RelativeBlur& blur, const MeterRegion& region);

// The same, their frames those of evidence.setup.
BlurSamples FitSamples(const BlurEvidence& evidence, const RelativeBlur& blur,
                       const MeterRegion& region);

// The fit of a region's frames. Frames of which next to no mode is left in the band say nothing of
// such a blur, and are left out of the region.
struct FittedRegion {
  MeterRegion region;
  RelativeBlur blur;
};
FittedRegion FitRegion(MeterRegion region, const RelativeBlurOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_MEASUREMENT_H_
