#ifndef THICKLENS_CALIB_FIT_BLUR_MEASUREMENT_H_
#define THICKLENS_CALIB_FIT_BLUR_MEASUREMENT_H_

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/registration/image_scale.h"
#include "calib/registration/spot_tracking.h"
#include "calib/registration/stage_comparison.h"
#include "calib/spectrum/spectral_estimator.h"
#include "calib/spectrum/spectral_options.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {

// The least numbers of frames and of modes of a fit, and of modes of each of its frames.
inline constexpr std::size_t kMinFramesOfFit = 5, kMinModesOfFit = 12;
inline constexpr int kMinModesOfFrame = 16;
// The part of what all frames show that is measured, along each axis.
inline constexpr double kWholeField = 0.98;
// The time of the fit grows with the square of the frames: with many, each needs fewer modes.
int ModesPerRing(std::size_t frames);

inline constexpr double kDefaultRatio = 0.45;  // kappa at the start of a fit

// The input for the measurement of a sweep's blur.
struct BlurTask {
  BlurTask(const FocusSweep& its_sweep, FrameStore& its_store)
      : sweep(its_sweep), store(its_store) {}

  const FocusSweep& sweep;
  FrameStore& store;
  std::vector<std::size_t> frames;      // indices into the sweep; they passed the quality checks
  std::size_t reference = 0;            // index into the sweep
  std::vector<ScaleSample> scales;      // registered frames
  bool scale_follows_readings = false;  // then they may constrain readings' errors
  BlurModel law = BlurModel::kPerspective;
  model::Estimate offset_mm;
  // Present: the plane of focus is known, and `offset_mm` is where the search of the offset starts.
  std::optional<model::StatedConjugate> known_focus;
  bool zero_is_open = false;   // nothing determines the offset; `offset_mm` is arbitrary
  double scale_centre_mm = 0;  // depth of the centre of perspective
  double reading_sigma_mm = 0;
  bool reading_sigma_is_known = true;
  double start_focus_depth_mm = 0;
  double pixel_noise = 0;  // standard deviation of a pixel, for the whole sweep
  // Bands were divided out of the rows (columns): their modes are not used.
  bool rows_had_bands = false, columns_had_bands = false;
  int threads = 0;
  std::function<void()> tick;  // called once per frame and pass
};

// The blur along x and along y of an astigmatic lens, of the frames of BlurEvidence::region.
struct AxialEvidence {
  AxisLeakage leakage;
  AxialBlur blur;
  // Indices into setup.frames: left out of a long sweep to save time, not because of their blur.
  std::vector<std::size_t> thinned_out;
  // Whether the gains were held because the family does not describe the shape of the blur, and
  // the samples that free gains would give.
  bool gains_are_held = false;
  std::optional<BlurSamples> free_gains;
};

// The measurements of the estimators.
struct BlurEvidence {
  BlurFitSetup setup;  // has frames and estimators; the floor is left open
  std::optional<model::StatedConjugate> known_focus;  // as in BlurTask
  bool zero_is_open = false;                          // as in BlurTask
  std::vector<std::size_t> frames;  // indices into the sweep, for each of setup.frames
  // Indices into setup.estimators; -1: absent. Points take the place of edges: both measure the
  // blur itself, with the softness of the target.
  int edges = -1, spectrum = -1;
  bool by_points = false;  // true: `edges` are points
  SpotFinding spots;       // of a target of points
  // Why the points of a frame of the sweep have no blur, by its index.
  std::map<std::size_t, std::string> without_points;
  // Edges of a target that is not stated to be an edge, where its texture is fitted. They give an
  // upper limit of the blur floor.
  std::optional<BlurSamples> unstated_edges;
  // The spectral estimator with other choices, for the systematic errors: see CompareChoices.
  std::optional<BlurSamples> other_psf, narrow_band;
  model::Psf better_psf = model::Psf::kGaussian;
  std::optional<double> gaussian_misfit, disc_misfit;
  double shape_dof = 0;  // degrees of freedom of each misfit; 0: they are means over few edges
  std::vector<BlurExample> examples;
  // Scatter of the spectrum of each of setup.frames about the fit: over the pixel noise, and over
  // the frame's own spectrum (RelativeBlur::misfit). 0: the frame has no spectrum.
  std::vector<double> frame_noise_ratios, frame_misfits;
  std::string message;  // reason why there is no estimator
  // The spectral estimator's own set-up with its results, for parts of the field and channels. It
  // reads the frames from the task's store.
  SpectralEstimatorSetup spectral;
  std::vector<std::size_t> fit_index;  // for each of spectral.frames its index in setup.frames
  double assumed_floor_px2 = 0;        // S0 in a disc's transfer function
  EstimatorRegion region;              // the whole field, as measured
  RelativeBlur blur;                   // the whole field, as fitted
  double taken_tails = 0;              // tails of the blur that the family includes (TakeTails)
  // Present: the lens is astigmatic, and the spectral estimator has the mean of both variances
  // (TakeMeanOfAxes).
  std::optional<AxialEvidence> axial;
};

// Measures edges where the target has them (and is not stated to be a texture), and the relative
// spectra of all registered frames. The other choices are left open.
BlurEvidence MeasureBlur(const BlurTask& task);

// Evidence of the blur about the readings' errors, by the estimator with the most frames.
ReadingEvidence EvidenceOfBlur(const BlurEvidence& evidence);

// Notes the scatter of the frames of a region about its fit, for RejectOutliers.
void NoteScatter(const EstimatorRegion& region, const Eigen::VectorXd& noise_ratio,
                 const Eigen::VectorXd& misfit, BlurEvidence* evidence);

// Takes a region and its blur in place of those of the whole field, with the samples of the
// spectral estimator. The effect of the tails on V, if the new blur has none, stays that of the
// frames before.
void ReplaceSpectralBlur(EstimatorRegion region, RelativeBlur blur, BlurEvidence* evidence);

// Returns one region's relative blur as samples of a fit. Their frames are indices of the
// estimator.
BlurSamples AsSamples(const RelativeBlur& blur, const EstimatorRegion& region);

// Returns the same samples with their frames as indices into evidence.setup.frames.
BlurSamples FitSamples(const BlurEvidence& evidence, const RelativeBlur& blur,
                       const EstimatorRegion& region);

// The fit of a region's frames. Frames with almost no mode left in the band give no information
// about such a blur, and are removed from the region.
struct FittedRegion {
  EstimatorRegion region;
  RelativeBlur blur;
};
FittedRegion FitRegion(EstimatorRegion region, const RelativeBlurOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_MEASUREMENT_H_
