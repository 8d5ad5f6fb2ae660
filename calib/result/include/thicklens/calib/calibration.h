#ifndef THICKLENS_CALIB_CALIBRATION_H_
#define THICKLENS_CALIB_CALIBRATION_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/camera_response.h"
#include "thicklens/calib/diagnosis.h"
#include "thicklens/calib/fixed_pattern.h"
#include "thicklens/calib/frame_light.h"
#include "thicklens/calib/frame_statistics.h"
#include "thicklens/calib/grid_geometry.h"
#include "thicklens/calib/stage_errors.h"
#include "thicklens/calib/target_finding.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

// These types report what a calibration finds.
namespace thicklens::calib {

// A result with both kinds of error: sigma is the statistical standard deviation, and `systematic`
// is an interval around the value.
struct Result {
  double value = 0;                           // the result, in the unit of the field's name
  double sigma = 0;                           // statistical standard deviation
  std::optional<Eigen::Vector2d> systematic;  // (lo, hi), absolute values
};

// One source of systematic error. Each member is the interval (lowest, highest) in which the result
// may differ from its value because of this source, with lowest <= 0 <= highest, in the result's
// unit.
struct SystematicPart {
  std::string name;  // "blur floor", "side of focus", "lens.front_focal_length_mm"
  Eigen::Vector2d focus_depth_mm{0, 0};     // change of zf, mm
  Eigen::Vector2d image_distance_mm{0, 0};  // change of d1, mm
  Eigen::Vector2d blur_ratio{0, 0};         // change of kappa
  std::string remedy;                       // action at the bench that would shrink this part
};

// The measurements on one frame. Depths are from Ap, and use the offset that was given or found.
struct FrameMeasurement {
  std::string image;      // file name of the frame
  double reading_mm = 0;  // what the scale of the bench shows
  // Depth of the target: offset plus or minus reading. Where the lens or the sensor moves, it is
  // the depth at which the camera, focused as it was calibrated, shows a target with the same blur;
  // 0: there is none, because the blur is that of a point beyond infinity.
  double depth_mm = 0;
  double depth_per_reading = 1;  // |d depth/d reading|, other than 1 where lens or sensor move
  // d1 of this frame, from Ap, mm. Present where the lens or the sensor moves.
  std::optional<double> image_distance_mm;
  FrameStatistics statistics;         // levels, contrast and noise
  std::string rejection;              // empty if the frame is used
  double mean_edge_slope = 0;         // MES, linear grey per px
  double normalised_edge_slope = 0;   // MES over the frame's mean grey, per px
  int edge_count = 0;                 // number of edge pixels of the slopes
  double source_blur_sigma_px = 0;    // measured by the method of Zhuo and Sim, as in the paper
  double blur_sigma_px = 0;           // of lens and defocus, without pixel box and operator
  double blur_sigma_error_px = 0;     // its standard deviation
  bool in_blur_fit = false;           // false: outside the estimator's range, or rejected
  std::string not_in_fit;             // reason why a frame that was not rejected is not in the fit
  double blur_fit_weight = 0;         // 0 to 1, from the robust loss
  std::optional<double> image_scale;  // relative to the reference frame
  double image_scale_sigma = 0;       // its standard deviation
  bool in_scale_fit = false;          // false: not registered, rejected, or no offset was found
  // The written reading minus the joint fit's estimate of it, and the standard deviation of this
  // difference. Both are 0 in frames that are not in the fit.
  double reading_error_mm = 0;
  double reading_error_sigma_mm = 0;  // see reading_error_mm
  // The part of reading_error_mm that is the stage's (StageErrors); `depth_mm` is without it.
  double stage_error_mm = 0;
};

// Result of the paper's recipe: the depth of the sharpest frame, then the mean of sigma/r_defocus.
// It has no error estimate because the recipe has none.
struct SourceRecipe {
  bool done = false;                // true if the recipe gave a result
  std::string message = "not run";  // how it ended; without a result, the reason
  int sharpest_frame = -1;          // index into frames
  double focus_depth_mm = 0;        // depth from Ap of the sharpest frame
  double image_distance_mm = 0;     // d1 of that depth [S13]
  double blur_ratio = 0;            // dominated by frames near focus (the ratio diverges there)
  int ratio_frames = 0;  // frames in the mean; the sharpest has r_defocus = 0 and is left out
  // Result of the same recipe with the index divided by the frame's mean grey.
  int sharpest_normalised_frame = -1;
  double normalised_focus_depth_mm = 0;  // depth from Ap of that frame
};

// Peak of the normalised sharpness: a parabola is fitted to the logarithm over the top of the
// curve.
struct SharpnessPeak {
  bool done = false;                // true if a peak was found
  std::string message = "not run";  // how it ended; without a result, the reason
  double focus_depth_mm = 0;        // depth of the peak from Ap
  double sigma_mm = 0;              // its standard deviation
  int frames_used = 0;              // number of frames in the parabola
  // [D70] log(index) = c0 + c1 x + c2 x^2, x = (1/z - 1/z0) z0, z0 = reference_depth_mm.
  Eigen::Vector3d log_parabola{0, 0, 0};
  double reference_depth_mm = 0;              // z0 from Ap
  double from_depth_mm = 0, to_depth_mm = 0;  // range of the fitted frames
};

// Dependence of the image scale on the reading.
enum class ScaleKind {
  kUnknown,       // too few registrations, or none of the laws below
  kInverseDepth,  // as 1/z: a camera whose pupil does not move
  kConstant,      // telecentric, or the sensor moves
  kReversed,      // as 1/z with the opposite direction
  kMovingFocus,   // as a lens or a sensor that moves changes it
};

// The bench offset from the image scale: 1/scale = (offset + direction * reading)/z_reference.
struct ScaleModel {
  bool done = false;                     // true if the offset was found; for kInverseDepth alone
  std::string message = "not run";       // how it ended; without a result, the reason
  ScaleKind kind = ScaleKind::kUnknown;  // the law that the scales follow
  bool contradicts_readings = false;     // most of the registered frames agree with no law at all
  // Relative increase of 1/scale over the range of the readings: positive where the target looks
  // smaller at larger readings ("away"). It is present whenever enough frames were registered.
  std::optional<model::Estimate> change_over_sweep;
  // The scale of one target was measured, but it changes too little over the sweep to determine the
  // offset, which the target's blur does not need.
  bool changes_too_little = false;
  bool shows_no_scale = false;  // the target (spokes) looks the same at any scale: not sought
  int reference_frame = -1;     // index of the frame with scale 1; -1: none
  Result offset_mm;             // the bench offset: position of the aperture
  // Depth, from the aperture, at which the size on the sensor goes to infinity. It is not 0 because
  // the light of a point off the axis spreads unevenly over the pupil
  // (model::CentreOfPerspectiveMm, by the paper's law). It is part of offset_mm.
  double centre_mm = 0;
  // The lowest and the highest offset_mm that the known pupil laws give.
  Eigen::Vector2d offset_of_pupil_laws_mm{0, 0};
  // Depth of the reference frame from the centre of perspective:
  // 1/scale = (line_zero_mm + direction * reading)/reference_depth_mm.
  double reference_depth_mm = 0;
  // The bench offset as measured from the centre of perspective, mm.
  double line_zero_mm() const { return offset_mm.value - centre_mm; }
  double reading_rms_mm = 0;  // scatter of the readings about the law
  int frames_used = 0;        // number of frames in the fit
  // Radial distortion that the registrations show, as the relative change of the image height at
  // the corner of the region (positive: pincushion). It is absent where too few registrations
  // determine it.
  std::optional<model::Estimate> distortion_at_corner;
};

// d1 from the image scale where a length on the target is known (sweep file: target_period_mm):
// m = f1 D/(f2 z). It does not depend on sharpness.
struct MagnificationCheck {
  double period_px = 0;               // measured in the reference frame
  double period_mm = 0;               // as stated
  model::Estimate image_distance_mm;  // d1 from Ap to the sensor
};

// The measured blur of one frame, for plots: an edge's profile, or the transfer relative to the
// reference against frequency.
struct BlurExample {
  int frame = -1;                // index into frames
  bool is_edge = false;          // true: a profile; false: a transfer
  std::vector<double> x;         // distance from the edge, px; or frequency, cycles per px
  std::vector<double> measured;  // edge: 0 dark to 1 bright; or transfer, 1 at frequency 0
  std::vector<double> gaussian;  // fit with a Gaussian, at x
  std::vector<double> disc;      // fit with a disc, at x; may be empty
};

// Result of a fit to the frames on one side of focus.
struct SideFit {
  bool done = false;                // true if the fit gave a result
  std::string message = "not run";  // how it ended; without a result, the reason
  model::Estimate focus_depth_mm;   // zf from Ap
  model::Estimate blur_ratio;       // kappa, dimensionless
  int frames_used = 0;              // number of frames on this side
};

// In-focus object distance and blur ratio of the blur along one direction in the image.
struct AxisFocus {
  model::Estimate focus_depth_mm;  // zf from Ap, without the error of the bench offset
  model::Estimate blur_ratio;      // kappa, dimensionless
};
// Focus over the field, from the same fit on each tile of a regular grid.
struct FieldTile {
  Eigen::Vector2d centre_px{0, 0};  // in the full image
  bool done = false;                // true if the tile was fitted
  std::string message = "not run";  // how it ended; without a result, the reason
  model::Estimate focus_depth_mm;   // zf of the tile, from Ap
  model::Estimate blur_ratio;       // kappa of the tile, dimensionless
  int cluster = 0;                  // index into FieldMap::clusters
  // The blur along the tangent and along the radius of the tile's position; present with
  // FieldMap::field_astigmatism_mm where the tile's texture determines both.
  std::optional<AxisFocus> sagittal, tangential;
};
// Tiles whose in-focus object distances agree: a part of the target at one depth.
struct DepthCluster {
  model::Estimate focus_depth_mm;  // weighted mean of the tiles, from Ap
  int tiles = 0;                   // number of tiles
};
// In-focus object distance over the field of view.
struct FieldMap {
  bool done = false;                // true if enough tiles were fitted
  std::string message = "not run";  // how it ended; without a result, the reason
  int columns = 0, rows = 0;        // size of the grid, in tiles
  std::vector<FieldTile> tiles;     // row by row
  // The model is zf(x, y) = centre + tilt + curvature; its terms are absent where too few tiles
  // were fitted. The tilts are the angles in degrees between the target and the sensor about the
  // vertical and the horizontal axis: positive where the target's right side, or its bottom, is
  // nearer to the camera.
  std::optional<model::Estimate> tilt_right_deg, tilt_down_deg;
  std::optional<model::Estimate> curvature_mm;    // zf at the outermost tile minus zf at the centre
  std::optional<model::Estimate> astigmatism_mm;  // zf of horizontal blur minus zf of vertical blur
  // The blur along x (horizontal) and along y (vertical); present with astigmatism_mm.
  std::optional<AxisFocus> along_x, along_y;
  // Sagittal minus tangential focus in the farthest corner of the image: zf of the blur along the
  // tangent minus that along the radius, by the law that it grows with the square of the distance
  // from the axis. A tilt of the target, which displaces both alike, is no part of it. Measured
  // only where one variance for all directions does not describe the tiles.
  std::optional<model::Estimate> field_astigmatism_mm;
  std::vector<DepthCluster> clusters;  // a single cluster: the target is at one depth
};

// Result of a fit to one colour channel. The errors are those of the differences between colours:
// they do not contain what all colours share, the errors of readings and bench offset.
struct ChannelFocus {
  std::string name;                 // "red", "green", "blue"
  bool done = false;                // true if the channel was fitted
  std::string message = "not run";  // how it ended; without a result, the reason
  model::Estimate focus_depth_mm;   // zf of this colour, from Ap
  model::Estimate blur_ratio;       // kappa of this colour, dimensionless
};

// The largest chi^2 per degree of freedom at which a shape of the blur counts as one that fits the
// frames. Simulated sweeps have 0.7 to 1.5 with the true shape.
inline constexpr double kLargestMisfitOfShape = 3;

// The fit of sigma^2 = S0 + A (1/z - 1/zf)^2 by Ceres in (zf, kappa, floor). The bench offset is
// held, and its error is propagated to the results.
struct BlurFit {
  bool done = false;                      // true if the fit gave a result
  std::string message = "not run";        // how it ended; without a result, the reason
  double chi2_per_dof = 0;                // chi^2 of the frames per degree of freedom
  int frames_used = 0;                    // number of frames in the fit
  std::vector<std::string> undetermined;  // parameters that the data do not fix
  std::string weak_direction;             // the combination of parameters that is least certain
  double weak_correlation = 0;            // correlation of these parameters
  std::string estimator;                  // "edges" or "relative spectrum"
  // The PSF family whose second moment is the blur ratio. For spectra also the band of the fit:
  // frequencies up to this value of 2 pi^2 sigma^2 nu^2, where sigma is the blur beyond that of the
  // sharpest frame.
  model::Psf family = model::Psf::kGaussian;
  std::optional<double> band;  // absent: not from spectra
  // Change of the family's shape at constant second moment, applied where the frames show it beyond
  // doubt: H exp(4 tails u^2), u = 2 pi^2 sigma^2 nu^2. A pupil that obeys the sine condition has
  // about (kappa r/d1)^2/2. 0: no change.
  double tails = 0;
  model::Psf better_psf = model::Psf::kGaussian;  // the shape that describes the frames better
  std::optional<double> gaussian_misfit,
      disc_misfit;        // chi^2 per dof of the estimator with each shape
  double outside_mm = 0;  // distance of the focus outside the sweep; 0: inside
  // Sigma of the blur that an astigmatic lens has in the plane of medial focus beside the blur
  // floor, where the law has the mean of the variances along x and along y [D137]: px of the frames
  // as they were calibrated. 0: the law has one variance for all directions.
  double astigmatic_blur_px = 0;
};

// A complete result (kOk), one that lacks a parameter (kPartial), or none (kRefused).
enum class Outcome { kOk, kPartial, kRefused };
// Name of the outcome: "ok", "partial" or "refused".
THICKLENS_EXPORT std::string OutcomeName(Outcome outcome);

// The result of a calibration for people and programs: what was found, and whether it can be used.
struct CalibrationSummary {
  Outcome outcome = Outcome::kRefused;  // of the fit
  std::string reason = "not run";       // of an outcome other than kOk
  std::vector<std::string> warnings;    // one line each
  // Values with statistical sigma and systematic interval; absent: not determined.
  std::optional<Result> image_distance_mm;  // d1, from Ap to the sensor
  std::optional<Result> focus_depth_mm;     // zf, from Ap toward the scene [S13]
  std::optional<Result> blur_ratio;         // kappa, dimensionless
  std::optional<Result> blur_floor_px;      // sigma of the blur floor
  // Depth of reading 0 from Ap or, where the lens or the sensor moves, d1 of reading 0.
  std::optional<Result> bench_offset_mm;
  double chi2_per_dof = 0;  // of the blur fit; 0: there is none
  // In the blur fit, or, before the fit, the frames that passed the quality checks.
  int frames_used = 0;
  int frames_rejected = 0;  // frames that failed a check
  // Frames that passed the checks and are not in the blur fit. With those that are used and those
  // that were rejected they are all frames of the sweep.
  int frames_left_out = 0;
  double seconds = 0;  // time of the calibration

  // One line: outcome, d1, zf and kappa with their sigmas, frames, time.
  THICKLENS_EXPORT std::string BriefReport() const;
};

// A plane of focus by a source that the result does not use.
struct ComparedFocus {
  std::string name;                // "magnification", "the image scale", "offset_mm"
  model::Estimate focus_depth_mm;  // zf from Ap by it, mm
  bool agrees = false;             // within three standard deviations of both
};

// Evidence behind the result: intermediate results, alternatives, causes.
struct CalibrationDiagnostics {
  // Covariance of the named parameters, in their units; sigma^2 is on the diagonal.
  std::vector<std::string> covariance_order;
  Eigen::MatrixXd covariance;  // one row and column per name; empty: none

  // Results that are determined even where the rest is refused. They need neither camera nor bench
  // offset.
  SharpestReading sharpest;
  // Reading at the plane of focus by the blur fit: the position of focus in the sweep. Its error
  // does not include that of the bench offset.
  std::optional<model::Estimate> focus_reading_mm;
  // Growth of the sigma of the defocus on the sensor at focus, without the blur floor, px per mm of
  // reading [D131]. In a short sweep it depends neither on the camera nor on the bench offset. It
  // is present where focus_reading_mm is.
  std::optional<model::Estimate> blur_slope_px_per_mm;
  // Magnification in the plane of focus, f1/(zf - f1), dimensionless; present where zf is.
  std::optional<model::Estimate> magnification_at_focus;
  model::SweepMotion moves = model::SweepMotion::kTarget;  // the part that moves
  bool moves_is_recognised = false;  // true: the frames or the unit of the readings show it
  // d1 of the positions of the lens or of the sensor, in rising order of the position; present
  // where they move and d1 is known.
  std::optional<model::FocusPositions> focus_positions;
  // The source of the bench offset: "offset_mm", "the image scale", or the name of the statement
  // of the sweep's file or the camera file. Empty: nothing does.
  std::string bench_offset_from;
  // The other sources of the bench offset that were compared with it: statements that were not
  // used, and the image scale.
  std::vector<ComparedFocus> compared_focus;
  // The symptoms whose causes were compared, with the causes that are named.
  std::vector<Diagnosis> diagnoses;
  FrameStructureFinding structure;  // vignetting, bands and dust of the frames
  // Shading, dust and defective pixels that were removed. `structure` describes what is left.
  FixedPattern fixed_pattern;
  FrameLight light;         // bands, exposure and white balance that change from frame to frame
  CameraResponse response;  // transfer curve and processing, by the frames
  GridGeometry grid;        // focal length, principal point and distortion by a grid
  SheetMarks marks;         // of the target's sheet
  StageErrors stage;        // systematic errors of the stage, by scale and blur of the frames
  // Length of a step or count of the drive, mm, where the readings are counts and a statement
  // about the plane of focus determines it; 0 +- infinity where nothing does. The readings of the
  // result are then counts, and blur_slope_px_per_mm is per count.
  std::optional<model::Estimate> step_length_mm;

  TargetFinding target;                // what was measured on the target, and its depths
  SourceRecipe paper_recipe;           // the paper's method, for comparison
  SharpnessPeak sharpness;             // in-focus object distance by sharpness alone
  ScaleModel scale;                    // the bench offset from the image scale
  BlurFit blur;                        // the fit behind the results
  SideFit nearer, farther;             // fits of the frames on each side of focus
  FieldMap field;                      // focus over the field
  std::vector<ChannelFocus> channels;  // of colour frames
  std::optional<MagnificationCheck> magnification;  // present if the target's period is stated
  // In the order of ErrorTerms (thicklens/calib/error_budget.h), the largest first.
  std::vector<SystematicPart> systematic_parts;
  std::string advice;  // the largest term of the error, and how to make it smaller
};

// Everything that a calibration found.
struct Calibration {
  CalibrationSummary summary;            // the result
  CalibrationDiagnostics diagnostics;    // the evidence behind it
  std::vector<FrameMeasurement> frames;  // one record per frame, in the sweep's order
  std::vector<BlurExample> examples;     // blur of the nearest, sharpest and farthest frame
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATION_H_
