#ifndef THICKLENS_CALIB_CALIBRATION_H_
#define THICKLENS_CALIB_CALIBRATION_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/diagnosis.h"
#include "thicklens/calib/frame_statistics.h"
#include "thicklens/model/camera.h"

// What a calibration finds.
namespace thicklens::calib {

// A result with both kinds of error: sigma is statistical, `systematic` an interval around it.
struct Result {
  double value = 0;
  double sigma = 0;
  std::optional<Eigen::Vector2d> systematic;  // (lo, hi), absolute values
};

// One source of systematic error: how far each result may lie from its value because of it,
// (lowest, highest) with lowest <= 0 <= highest, in the result's unit.
struct SystematicPart {
  std::string name;  // "lens floor", "side of focus", "lens.front_focal_length_mm"
  Eigen::Vector2d focus_depth_mm{0, 0};
  Eigen::Vector2d image_distance_mm{0, 0};
  Eigen::Vector2d blur_ratio{0, 0};
  std::string remedy;  // what would shrink it, said to a person at the bench
};

// What was measured on one frame. Depths are from Ap with the offset that was given or found.
struct FrameMeasurement {
  std::string image;
  double reading_mm = 0;
  double depth_mm = 0;
  FrameStatistics statistics;
  std::string rejection;             // empty: used
  double mean_edge_slope = 0;        // MES, linear grey per px
  double normalised_edge_slope = 0;  // MES over the frame's mean grey, per px
  int edge_count = 0;
  double source_blur_sigma_px = 0;    // Zhuo-Sim as the source has it
  double blur_sigma_px = 0;           // lens and defocus, pixel box and operator removed
  double blur_sigma_error_px = 0;     // its standard deviation
  bool in_blur_fit = false;           // false: outside the meter's range, or rejected
  std::string not_in_fit;             // why a frame that was not rejected is not in it
  double blur_fit_weight = 0;         // 0 to 1, of the robust loss
  std::optional<double> image_scale;  // relative to the reference frame
  double image_scale_sigma = 0;       // its standard deviation
  bool in_scale_fit = false;
  // Written reading minus the one that the joint fit believes, and its standard deviation; 0 in
  // frames that are not in the fit.
  double reading_error_mm = 0;
  double reading_error_sigma_mm = 0;
};

// The source's recipe: sharpest frame, then the mean of sigma/r_defocus. No error estimate: the
// recipe has none.
struct SourceRecipe {
  bool done = false;
  std::string message = "not run";
  int sharpest_frame = -1;  // index into frames
  double focus_depth_mm = 0;
  double image_distance_mm = 0;
  double blur_ratio = 0;  // dominated by frames near focus (the ratio diverges there)
  int ratio_frames = 0;   // frames in the mean; the sharpest has r_defocus = 0 and is left out
  // The same recipe with the index divided by the frame's mean grey.
  int sharpest_normalised_frame = -1;
  double normalised_focus_depth_mm = 0;
};

// Normalised sharpness: a parabola through the logarithm over the top of the curve.
struct SharpnessPeak {
  bool done = false;
  std::string message = "not run";
  double focus_depth_mm = 0;
  double sigma_mm = 0;
  int frames_used = 0;
  // [D70] log(index) = c0 + c1 x + c2 x^2, x = (1/z - 1/z0) z0, z0 = reference_depth_mm.
  Eigen::Vector3d log_parabola{0, 0, 0};
  double reference_depth_mm = 0;
  double from_depth_mm = 0, to_depth_mm = 0;  // the frames fitted
};

// How the image scale goes with the reading.
enum class ScaleKind {
  kUnknown,       // too few registrations, or none of the others
  kInverseDepth,  // as 1/z: a camera whose pupil stands still
  kConstant,      // telecentric, or the sensor moves
  kReversed,      // as 1/z with the other direction
};

// Bench zero from the image scale: 1/scale = (offset + direction * reading)/z_reference.
struct ScaleLaw {
  bool done = false;  // the offset was found; kInverseDepth alone
  std::string message = "not run";
  ScaleKind kind = ScaleKind::kUnknown;
  bool contradicts_readings = false;  // frames were registered, and most agree with no law at all
  // By how much 1/scale grows over the range of the readings, relative: positive where the target
  // looks smaller at larger readings ("away"). There whenever enough frames were registered.
  std::optional<model::Estimate> change_over_sweep;
  bool shows_no_scale = false;  // the target looks the same at every scale (spokes): not looked for
  int reference_frame = -1;
  Result offset_mm;  // the bench zero: where the aperture is
  // The depth at which the size on the sensor goes to infinity, from the aperture: the light of a
  // point off the axis spreads unevenly over the pupil (model::CentreOfPerspectiveMm, by the
  // paper's law). It is part of offset_mm.
  double centre_mm = 0;
  // The lowest and the highest offset_mm that the known pupil laws give.
  Eigen::Vector2d offset_of_pupil_laws_mm{0, 0};
  // Of the reference frame, from there: 1/scale = (line_zero_mm + direction reading)/it.
  double reference_depth_mm = 0;
  double line_zero_mm() const { return offset_mm.value - centre_mm; }
  double reading_rms_mm = 0;  // scatter of the readings about the law
  int frames_used = 0;
  // Radial distortion that the registrations show: relative change of the image height at the
  // corner of the region (positive: pincushion), if there were enough of them to tell.
  std::optional<model::Estimate> distortion_at_corner;
};

// What the image scale says of d1 where a length on the target is known (sweep file:
// target_period_mm): m = f1 D/(f2 z), independent of sharpness.
struct MagnificationCheck {
  double period_px = 0;  // measured in the reference frame
  double period_mm = 0;  // as stated
  model::Estimate image_distance_mm;
};

// One frame's blur as it was measured, for the eye: an edge's profile, or the transfer relative to
// the reference against frequency.
struct BlurExample {
  int frame = -1;  // index into frames
  bool is_edge = false;
  std::vector<double> x;         // edge: distance from it, px; else frequency, cycles per px
  std::vector<double> measured;  // edge: 0 dark to 1 bright; else transfer, 1 at frequency 0
  std::vector<double> gaussian;  // the fit with a Gaussian, at x
  std::vector<double> disc;      // the fit with a disc, at x; may be empty
};

// One side of focus fitted alone.
struct SideFit {
  bool done = false;
  std::string message = "not run";
  model::Estimate focus_depth_mm;
  model::Estimate blur_ratio;
  int frames_used = 0;
};

// Focus over the field: the same fit on each tile of a regular grid.
struct FieldTile {
  Eigen::Vector2d centre_px{0, 0};  // in the full picture
  bool done = false;
  std::string message = "not run";
  model::Estimate focus_depth_mm;
  int cluster = 0;  // index into FieldMap::clusters
};
struct DepthCluster {
  model::Estimate focus_depth_mm;
  int tiles = 0;
};
struct FieldMap {
  bool done = false;
  std::string message = "not run";
  int columns = 0, rows = 0;
  std::vector<FieldTile> tiles;  // row by row
  // zf(x, y) = centre + tilt + curvature; absent where too few tiles were fitted.
  // Degrees between the target and the sensor about the vertical and the horizontal axis: positive
  // where the target's right side, or its bottom, is nearer to the camera.
  std::optional<model::Estimate> tilt_right_deg, tilt_down_deg;
  std::optional<model::Estimate> curvature_mm;    // zf at the outermost tile minus at the centre
  std::optional<model::Estimate> astigmatism_mm;  // zf of horizontal blur minus of vertical blur
  std::vector<DepthCluster> clusters;             // one: the target is at one depth
};

// One colour channel fitted alone.
struct ChannelFocus {
  std::string name;  // "red", "green", "blue"
  bool done = false;
  std::string message = "not run";
  model::Estimate focus_depth_mm;
};

// sigma^2 = S0 + A (1/z - 1/zf)^2, fitted by Ceres in (zf, kappa, floor); the bench zero is held
// and its error carried into the results.
struct BlurFit {
  bool done = false;
  std::string message = "not run";
  double chi2_per_dof = 0;
  int frames_used = 0;
  std::vector<std::string> undetermined;  // parameters that the data do not fix
  std::string weak_direction;             // the combination of parameters that is known worst
  double weak_correlation = 0;            // theirs
  std::string meter;                      // "edges" or "relative spectrum"
  // The PSF family whose second moment the blur ratio is, and, of spectra, the band of the fit: up
  // to this 2 pi^2 sigma^2 nu^2, with sigma the blur beyond that of the sharpest frame.
  model::Psf family = model::Psf::kGaussian;
  std::optional<double> band;
  // How the family's shape was changed, its second moment held, because the frames show it beyond
  // doubt: H exp(4 tails u^2), u = 2 pi^2 sigma^2 nu^2. A pupil that obeys the sine condition has
  // about (kappa r/d1)^2/2. 0: not at all.
  double tails = 0;
  model::Psf better_psf = model::Psf::kGaussian;       // the shape that describes the frames better
  std::optional<double> gaussian_misfit, disc_misfit;  // chi^2 per dof of the meter with each
  double outside_mm = 0;  // how far the focus lies outside the sweep; 0: inside
};

enum class Outcome { kOk, kPartial, kRefused };
std::string OutcomeName(Outcome outcome);

struct Calibration {
  Outcome outcome = Outcome::kRefused;
  std::string reason = "not run";     // of anything but kOk
  std::vector<std::string> warnings;  // one line each

  std::optional<Result> image_distance_mm;
  std::optional<Result> focus_depth_mm;
  std::optional<Result> blur_ratio;
  std::optional<Result> blur_floor_px;
  std::optional<Result> bench_offset_mm;
  // Of the parameters named, in their units; sigma^2 on the diagonal.
  std::vector<std::string> covariance_order;
  Eigen::MatrixXd covariance;

  // What was determined even where the rest is refused; needs neither camera nor bench zero.
  SharpestReading sharpest;
  // The reading of the plane of focus by the blur fit, whose error does not hold the bench zero's:
  // where focus lies in the sweep.
  std::optional<model::Estimate> focus_reading_mm;
  // The symptoms whose causes were compared, with what was named.
  std::vector<Diagnosis> diagnoses;
  FrameStructureFinding structure;

  SourceRecipe source;
  SharpnessPeak sharpness;
  ScaleLaw scale;
  BlurFit blur;
  SideFit nearer, farther;  // the frames on each side of focus alone
  FieldMap field;
  std::vector<ChannelFocus> channels;  // of colour frames
  std::optional<MagnificationCheck> magnification;
  std::vector<SystematicPart> systematic_parts;  // largest first, by their part of d1
  std::string advice;                            // what would shrink the largest error, and to what
  std::vector<BlurExample> examples;             // nearest, sharpest and farthest frame
  std::vector<FrameMeasurement> frames;          // in the sweep's order
  int frames_used = 0;  // in the blur fit; before there is one, those that passed the gates
  double seconds = 0;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATION_H_
