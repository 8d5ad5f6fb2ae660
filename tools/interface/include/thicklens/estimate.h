#ifndef THICKLENS_ESTIMATE_H_
#define THICKLENS_ESTIMATE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/depth_fit.h"
#include "thicklens/effects.h"
#include "thicklens/estimator/blur_check.h"
#include "thicklens/estimator/depth_contradiction.h"
#include "thicklens/estimator/depth_flips.h"
#include "thicklens/estimator/depth_values.h"
#include "thicklens/estimator/falloff_evidence.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/photo_aperture.h"
#include "thicklens/estimator/refine_depth.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/run.h"
#include "thicklens/scene_form.h"
#include "thicklens/solver.h"

namespace thicklens {

// How the aperture of the photograph weighs the views. Without a statement the camera's PSF says it
// and, without a camera, the weights are equal, which a notice reports.
struct ApertureOptions {
  std::optional<model::ApertureShape> shape;  // weights of this shape
  // Take the positions of the views (and, if they are stated, their weights) from this light field.
  std::shared_ptr<const ApertureViews> views_of;
};

// The sensor pixel of the image's top-left pixel, px; for an image of a part of the sensor.
struct SensorOrigin {
  int x = 0, y = 0;  // column and row of the sensor, px
};

// The consequence of a contradiction between EXIF and camera.
enum class ExifCheck {
  kRequire,  // throw Error if the photograph's EXIF contradicts the camera
  kIgnore,   // report contradictions as notices
};

// Meaning of the clipped values of a photograph in an estimate by SceneSolver. The other solvers
// take them as data.
enum class ClippedHighlights {
  kBounds,  // lower bounds of the light: the residual counts below them only [D181]
  kData,    // the light itself
};

// The clipped values of a photograph.
struct PhotoClipping {
  double share = 0;  // of all its values
  // Per channel the encoded value, 1 at full scale, at which it is clipped; for an image of linear
  // light the light. 0: the channel is not clipped. Empty: not looked for.
  std::vector<double> levels;
  bool at_full_scale = true;  // every level is the largest that the type has
};
// Finds the levels at which the channels of an image are clipped [D182]: full scale where the
// values pile up at it, and a lower level where so many are equal to the largest that neither noise
// nor the image's content explains it. Alpha is not looked at.
THICKLENS_EXPORT PhotoClipping FindClipping(const Image& photo);

// How rays are filled that the centre view does not show.
enum class HiddenRays {
  kSolver,  // as the solver estimates them
  kTelea,   // by the inpainting of section 6 of the supplement [D99], for comparison
};

// How an estimated light field is kept.
enum class LightFieldForm {
  kViews,  // U x V views
  // The radiance and the disparity of the scene (scene_form.h), from which every view follows; by a
  // solver that finds them (SceneSolver with HiddenRays::kSolver). Others have views.
  kScene,
};

// Whether the faults of a depth map are repaired by the photograph [D191] to [D193], [D196].
enum class DepthRefining {
  kAuto,  // those that map and photograph show for certain
  kOn,    // also those that are only probable
  kOff,   // none
};

// Everything of `thicklens estimate` that determines its result, with the same defaults. Only the
// choice of a solver for a limit of time or quality (--within, --quality, --psnr-loss) is left to
// the caller, who gives a SolverChooser as the solver.
struct EstimateOptions {
  // Numbers of views, at least two in all. Absent: 7 x 7, or those of aperture.views_of.
  std::optional<ViewCounts> views;
  std::optional<PixelRect> crop;  // take only this rectangle of photograph and depth, px
  std::optional<SensorOrigin> sensor_origin;  // needs a camera; 0 to 100000 px
  // Position of the lens when the photograph was taken, in the unit of the camera's
  // calibration.focus_positions, which give d1 of it. Absent: the one that the photograph's
  // metadata state in dioptres, otherwise that of the calibration.
  std::optional<double> lens_position;
  // Whether photograph and depth map are first undistorted by the camera's distortion, if it states
  // one; false: they are undistorted already.
  bool undistort = true;
  ExifCheck exif = ExifCheck::kRequire;  // what a contradiction does
  ApertureOptions aperture;              // weights of the views
  // Depth of the ST plane from Ap, mm, 0 < st_depth_mm <= 1e9; absent: the plane of focus. Needs a
  // camera.
  std::optional<double> st_depth_mm;
  DepthFit depth_fit;                                 // how a map of another size or camera is used
  bool smooth_depth = true;                           // smooth a noisy depth along surfaces [D94]
  DepthRefining refine_depth = DepthRefining::kAuto;  // which faults of the depth are repaired
  EffectSelection effects;                            // effects that the estimate models
  AnySolver solver = SceneSolver{};                   // how the light field is computed
  HiddenRays hidden_rays = HiddenRays::kSolver;       // how hidden rays are filled
  LightFieldForm form = LightFieldForm::kViews;       // how the light field is kept
  // Meaning of the clipped values of the photograph.
  ClippedHighlights clipped = ClippedHighlights::kBounds;
  // "auto", "cpu", "opencl", "opencl:PLATFORM" or "opencl:PLATFORM:DEVICE". auto: the processor for
  // SceneSolver, the best device for BlockSolver.
  std::string device = "auto";
  // Limit for the whole process, MiB, 0 < limit <= 1e9. SceneSolver then solves in bands; absent:
  // four fifths of the available memory for SceneSolver, none for the others.
  std::optional<double> memory_limit_mib;

  // Throw Error instead of returning a partial result, with EstimateSummary::partial_reason.
  bool strict = false;

  // Returns true if all members are valid and do not contradict each other. Otherwise `why`, if not
  // null, gets the field, the value and the constraint. NaN is never valid.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// ---- What comes back.

// Time of the parts of an estimate, s.
struct EstimateSeconds {
  double prepare = 0;                           // camera, aperture, depth, effects
  double setup = 0, blur_check = 0, solve = 0;  // of the solver, and of check_blur
  double photo_aperture = 0;                    // measuring the photograph's aperture
  double depth_flips = 0;                       // the search for reversed rows and columns
  double contradiction = 0;                     // whether the photograph contradicts the depth
  double views = 0;                             // making the views, and inpainting
  double sink = 0;  // giving views and confidence to a ViewSink; shared among the threads
  // The sum of all parts, s.
  double total() const {
    return prepare + setup + photo_aperture + blur_check + solve + depth_flips + contradiction +
           views + sink;
  }
};

// The result in numbers.
struct EstimateSummary {
  std::string message = "not run";  // of the solver
  std::string solver;               // "scene", "blocks", "functional", "grid" or a program's own
  std::string prior;                // of SceneSolver; otherwise empty
  // Numbers of views across and down, size of a view, and its channels.
  int u_count = 0, v_count = 0, width_px = 0, height_px = 0, channels = 0;
  std::optional<int> iterations;  // absent: a direct solver
  bool converged = false;         // the iterations reached their tolerance; direct: true
  // Residual of the system relative to its right side, recomputed; smallest reciprocal condition
  // number of the blocks of a direct solver.
  std::optional<double> relative_residual, rcond_min;
  std::string device;                // that computed: "cpu", "opencl:0:0"
  int threads = 0;                   // number of threads that computed
  std::vector<std::string> effects;  // names of the effects that were taken into account
  // Why the result is partial: the iterations did not converge, or the photograph contradicts the
  // depth. Empty: it is complete.
  std::string partial_reason;
  std::vector<std::string> warnings;  // what may make the result wrong, one line each
  EstimateSeconds seconds;            // where the time went

  // One line: solver, views, size, residual, time, and the number of warnings.
  THICKLENS_EXPORT std::string BriefReport() const;
};

// One quantity in which the photograph's EXIF and the camera were compared, both as text with
// units: "35 mm", "50 +- 0.1 mm".
struct ExifComparison {
  // Whether the two values can be of one photograph.
  enum class Verdict {
    kAgrees,       // both are equal within rounding
    kUndecided,    // the difference is within rounding and nominal values, or cannot be compared
    kContradicts,  // the photograph is of another lens, setting or sensor
  };
  std::string quantity, photo, camera;  // name, and the two values
  Verdict verdict = Verdict::kAgrees;   // whether they agree
  std::string remark;                   // what a disagreement may mean
};

THICKLENS_EXPORT std::string ExifVerdictName(ExifComparison::Verdict verdict);  // "agrees", ...

// What SceneSolver::check_blur proposes, in the numbers that a user can change: those of the map of
// disparities, or those of the camera. Nothing of it is applied. Absent: not proposed.
struct BlurProposal {
  // A blur that explains the photograph better.
  struct NarrowerBlur {
    // Either the meaning of the map for which the blur is as narrow as proposed, or kappa.
    std::optional<double> disparity_scale, disparity_offset_px, blur_ratio;
  };
  // A plane of focus that explains the photograph better.
  struct OtherFocus {
    // Either the offset of the disparities, px per view step, or the plane of focus, mm from Ap,
    // which may be infinite.
    std::optional<double> disparity_offset_px, focus_depth_mm;
  };
  std::optional<NarrowerBlur> narrower_blur;  // the proposed blur
  std::optional<OtherFocus> other_focus;      // the proposed plane of focus
};

// A part of the photograph that the estimate does not explain, px; rms in encoded values, 1 at full
// scale.
struct UnexplainedPatch {
  int x = 0, y = 0, width_px = 0, height_px = 0;  // top-left pixel, and size, px
  double residual_rms = 0;                        // rms of H r - I, in encoded values
};

// How far the estimate can be trusted, and what its input was like.
struct EstimateDiagnostics {
  TransferCurve transfer = TransferCurve::Srgb();  // curve by which the photograph was decoded
  std::string transfer_from;                       // "image", "camera", "file" or "assumed"
  // The distortion that was taken out of photograph and depth map, in words; empty: none.
  std::string undistorted;
  // How the depth map came to the photograph's pixels, in words; empty: it had them.
  std::string depth_fit;
  double without_source_share = 0;   // share of the pixels that the distorted photograph lacks
  bool has_exif = false;             // EXIF was found and compared
  std::vector<ExifComparison> exif;  // one per compared quantity
  std::string aperture_shape;        // "uniform", "gaussian", "disc", ...
  std::string aperture_from;         // "option", "light-field", "camera", "assumed"
  std::optional<double> aperture_calibrated_sigma_mm;  // kappa r, with a camera
  Eigen::Vector2d aperture_sigma_mm{0, 0};             // that the views have, along u and v [D30]
  Eigen::Vector2d aperture_corner_change{0, 0};  // relative change of it in the corners, largest
  model::EffectSelection effects;                // chosen effects, and their impacts
  std::optional<model::DepthStatistics> depth;   // mm from Ap, with a camera
  std::size_t holes_filled = 0;                  // number of pixels of the map
  double holes_share = 0;                        // the same over all pixels
  model::DepthHoles holes;                       // the map's holes by reason
  std::pair<double, double> disparity_range_px{0, 0};         // px per view step
  std::optional<double> depth_noise_px, depth_noise_left_px;  // px per view step [D93], [D94]
  // Repairs of the depth map; absent with DepthRefining::kOff.
  std::optional<estimator::DepthRefinement> depth_refinement;
  // Of SceneSolver, and of relative maps: scale and offset with which the blur of the photograph
  // agrees. Absent: not looked for, because a camera states them or the photograph is sharp.
  std::optional<estimator::DepthValuesFit> depth_values;
  // They differ for certain from those of the map. They are applied unless the depth is not to be
  // refined.
  bool are_depth_values_wrong = false;
  double largest_step_px = 0;  // displacement between neighbouring views
  double coarse_share = 0;     // share of the pixels whose step is above 3 px
  std::optional<double> strength, noise_sigma, residual_rms;  // noise, residual in encoded values
  // The error of rounding the photograph to its bits, in encoded values. Storing removes noise and
  // leaves its own errors, so that both together are what a residual is compared with; the solver
  // uses `noise_sigma` alone.
  double rounding_sigma = 0;
  // The error of the compression of a JPEG file, in encoded values, over all channels, without the
  // rounding. It is measured when the file is read.
  std::optional<double> compression_sigma;
  std::optional<double> compression_sigma_of_mean;  // likewise for the mean of the channels
  // The noise and what storing did, for a residual over all channels; absent without noise_sigma.
  THICKLENS_EXPORT std::optional<double> DoubtSigma() const;
  // Likewise for the mean of the channels.
  THICKLENS_EXPORT std::optional<double> DoubtSigmaOfMean() const;
  // Shares of SceneSolver: pixels with a row of their own in H, rays past edges, blocks that stay
  // unexplained.
  std::optional<double> row_share, occluded_fraction, unexplained_share;
  std::vector<UnexplainedPatch> patches;      // by descending residual
  std::optional<StrengthRule> strength_rule;  // of SceneSolver
  int bands = 1;                              // parts in which the image was solved
  int reweightings = 0;                       // of total variation
  double predicted_memory_mib = 0;            // of the whole process
  std::optional<double> gamma, ridge;         // gamma and mu of the functional
  std::optional<int> block_px;                // edge of a block, px
  int blocks_from_store = 0;                  // of BlockSolver::store
  // Shares of all rays: seen by the whole aperture, in part, blurred too strongly for details, and
  // filled in. The sum is 1.
  double rays_visible = 0, rays_partly_visible = 0, rays_blurred = 0, rays_filled_in = 0;
  std::optional<estimator::InpaintSummary> inpainting;  // of HiddenRays::kTelea
  std::optional<estimator::BlurCheck> blur_check;       // of SceneSolver::check_blur
  BlurProposal blur_proposal;                           // that follows from it
  // Of SceneSolver: what PhotoKind::kAuto measured; absent if the aperture was stated.
  std::optional<estimator::PhotoAperture> photo_aperture;
  // The aperture of the photograph over that of the views by which it was explained; 1: as stated.
  double used_photo_aperture = 1;
  PhotoClipping clipping;  // clipped values of the photograph
  // Of SceneSolver: the largest light of the scene's points, 1 at full scale.
  std::optional<double> brightest;
  // Whether the photograph shows the fall-off; absent: not tested, because the effect was stated or
  // does not matter.
  std::optional<estimator::FalloffEvidence> falloff;
  // Of SceneSolver, for a photograph that stays unexplained.
  std::optional<estimator::DepthFlipCheck> depth_flips;
  // Of SceneSolver: whether the photograph contradicts the depth, and the likely causes.
  std::optional<estimator::DepthContradiction> contradiction;
  std::vector<Notice> notices;  // remarks on the call, in their order
};

// One block of BlockSolver: position and size in px.
struct BlockRecord {
  // Top-left pixel and size; number of rays that are solved for; iterations, 0 for direct solvers.
  int x = 0, y = 0, width_px = 0, height_px = 0, unknowns = 0, iterations = 0;
  std::optional<double> rcond;   // reciprocal condition number; direct solvers
  double relative_residual = 0;  // recomputed from the solution
};

// The estimated light field, and everything known of it.
struct LightFieldEstimate {
  // U x V views of S x T px, linear light; without values if the views went to a sink, and if
  // `scene` is present.
  LightField light_field;
  // With LightFieldForm::kScene: what the views follow from. RenderView shows one of them, and
  // ViewsOf all.
  std::optional<SceneForm> scene;
  EstimateSummary summary;          // the result in numbers
  EstimateDiagnostics diagnostics;  // how far to trust it
  std::vector<BlockRecord> blocks;  // of BlockSolver, row by row
  // The problem that the solver started from: the photograph in linear light, its disparity,
  // weights and grid.
  std::optional<Problem> problem;
  std::vector<bool> was_hole;  // per pixel of the depth map: its value was filled in
  // Per pixel of the photograph, from SceneSolver: residual, occluded fraction and blur. Without
  // radiance, which the middle of the light field shows, and confidence, which follows.
  std::optional<estimator::SceneMaps> maps;
  // One byte per ray, view by view (index l * U + k), row by row: how well the photograph shows it
  // (docs/file-formats.md).
  std::vector<std::uint8_t> confidence;
};

// Receives the views of an estimate as they are made: each once, in any order, from several threads
// at once. May throw to end the estimate.
class THICKLENS_EXPORT ViewSink {
 public:
  virtual ~ViewSink();
  // Gets the view (k, l), linear light.
  virtual void TakeView(int k, int l, const model::LinearImage& view) = 0;
  // One byte per ray of the view, row by row.
  virtual void TakeConfidence(int k, int l, const std::vector<std::uint8_t>& confidence,
                              int width_px) = 0;
  // Memory that the sink needs for one view of `values` numbers while it takes it, bytes.
  virtual double BytesForView(double values) const;
};

// ---- The estimate, at once or in its two steps.

// Estimates the light field of one photograph and its depth. It is what `thicklens estimate` does
// with the same options, bit for bit. `camera` is the calibrated camera (lengths from Ap); without
// one the depth must be a disparity, and the light field is relative.
//
// Steps: crop; camera, EXIF and part of the sensor; linear light; aperture weights; grid; depth to
// disparity, holes filled; noise smoothed; effects chosen; solver; occluded rays; checks. Sources:
// the paper's (10), (16), (18) to (21) for the model and the functional, [D101] for SceneSolver.
//
// Photograph and depth are taken by value: whoever moves them there does not hold them twice while
// the light field is solved for. The result does not depend on the number of threads. Throws
// OptionError for options, Error for inputs that do not fit each other (sizes, units, EXIF that
// contradicts the camera, disparities larger than the image) and for what the solver refuses, and
// Interrupted.
THICKLENS_EXPORT LightFieldEstimate EstimateLightField(Image photo, DepthMap depth,
                                                       const std::optional<Camera>& camera,
                                                       const EstimateOptions& options = {},
                                                       const RunControl& run = {});

// The same, with the views given to `sink`: the returned light field and confidence have no values.
// SceneSolver never holds more than a few views. Same bits, except that a memory limit may need
// fewer bands. An estimate with `scene` gives no views to the sink.
THICKLENS_EXPORT LightFieldEstimate EstimateLightFieldTo(ViewSink* sink, Image photo,
                                                         DepthMap depth,
                                                         const std::optional<Camera>& camera,
                                                         const EstimateOptions& options = {},
                                                         const RunControl& run = {});

// The steps before the solver. `diagnostics` (may be null) gets what they found.
THICKLENS_EXPORT Problem PrepareProblem(Image photo, DepthMap depth,
                                        const std::optional<Camera>& camera,
                                        const EstimateOptions& options,
                                        EstimateDiagnostics* diagnostics,
                                        const RunControl& run = {});

// Writes the light field with its confidence as `thicklens estimate` does, completely or not at
// all. The HCI layout has no place for a confidence, a camera or weights. LightFieldFormat::kScene
// needs an estimate with `scene`; the other formats then render its views. Returns the number of
// clipped values. Throws OptionError, and Error, also for a confidence that is neither empty nor
// has one byte for each ray.
THICKLENS_EXPORT std::size_t WriteLightField(const std::string& folder,
                                             const LightFieldEstimate& estimate,
                                             LightFieldFormat format = LightFieldFormat::kPng,
                                             const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_ESTIMATE_H_
