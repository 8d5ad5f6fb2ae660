#ifndef THICKLENS_MODEL_SWEEP_SIMULATOR_H_
#define THICKLENS_MODEL_SWEEP_SIMULATOR_H_

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/aperture_outline.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/lens_aberrations.h"
#include "thicklens/model/pupil_law.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::model {

// The flat target in front of the camera.
enum class TargetKind {
  kDeadLeaves,    // discs of many sizes that occlude each other
  kPinkNoise,     // noise whose amplitude decreases as 1/frequency
  kWhiteNoise,    // noise with the same amplitude at all frequencies
  kCheckerboard,  // bright and dark squares
  kSiemensStar,   // bright and dark sectors around the middle
  kImage,         // an image of the user
  kGrid,          // a grid of known size, black on white, once
  kPrintedEdge,   // a slanted edge blurred by its ink: a Gaussian of ink_sigma_mm on the target
  kKnifeEdge,     // a slanted sharp edge
  kMesh,          // dark wires that cross, on a bright ground
  kGroundGlass,   // speckle: light whose distribution is that of a sum of random waves
  kPinholes,      // bright discs on a dark ground, apart from one another
  kBeads,         // dark discs on a bright ground, apart from one another
};
THICKLENS_EXPORT std::string TargetKindName(TargetKind kind);  // "dead-leaves", "pink-noise", ...

// A part that stands out of the plane of the target and shows the pattern, too. It hides what is
// behind it.
struct ReliefPartOptions {
  // kRectangle and kDisc fill the size. kGear is a disc with 12 teeth, whose depth is a fifth of
  // its radius.
  enum class Shape { kRectangle, kDisc, kGear };
  Shape shape = Shape::kRectangle;  // outline
  Eigen::Vector2d centre_mm{0, 0};  // from the target's centre, X right, Y down
  Eigen::Vector2d size_mm{0, 0};    // width and height; of a round part equal, the diameter
  double height_mm = 0;             // above the target, toward the camera, > 0
};

// The flat target: its pattern, and how it stands.
struct TargetOptions {
  TargetKind kind = TargetKind::kDeadLeaves;  // what is on the target
  std::string image_path;  // path of the image (kImage), for messages and the record
  // Value of (bright - dark)/(bright + dark) for two-valued targets. Leaves have every grey between
  // the two. Noise has the relative standard deviation contrast/2. An image (kImage) keeps its
  // own contrast.
  double contrast = 0.6;
  // Size of the detail on the target: radius of the smallest leaf, shortest period of the noise,
  // side of a square, width of a star's sector (at half the field's shorter side from its centre)
  // or width of the whole image (kImage). The value 0 selects it from the field of view: 2 px, 2
  // px, 24 px, 36 cycles, or the width that the frames see. Of a mesh it is the period (24 px), of
  // ground glass the width of a grain (4 px), and of pinholes and beads the diameter (3 px).
  double feature_size_mm = 0;
  std::optional<TargetGrid> grid;  // kGrid only
  // Angle of an edge from the vertical; positive: the upper end leans right. The bright side is on
  // the right.
  double edge_angle_deg = 5;
  double ink_sigma_mm = 0.1;  // kPrintedEdge only
  // Angle about the vertical line through the axis; positive: the right side is nearer to the
  // camera.
  double tilt_deg = 0;
  // Distance of the pinholes or beads from their neighbours, mm; each is displaced at random by up
  // to a fifth of it. 0: 36 px.
  double spacing_mm = 0;
  // Parts of a relief, which do not touch one another. A target with relief is not tilted and no
  // edge, and the lens has no aberrations.
  std::vector<ReliefPartOptions> relief;
};

// The stage that moves the part, and its systematic errors, which belong to the effect
// "reading-error". They change what is written down, not where the part is.
struct StageOptions {
  // True: the second half of the frames repeats the positions of the first half on the way back.
  bool there_and_back = false;
  // Reading of a position that is approached by falling readings, minus the reading of the same
  // position approached by rising ones, mm.
  double backlash_mm = 0;
  // Periodic error of a lead screw: amplitude and period, mm, and phase, degrees. The reading is
  // too large by screw_error_mm sin(2 pi reading/screw_period_mm + screw_phase_deg).
  double screw_error_mm = 0;
  double screw_period_mm = 1;  // of the right reading
  double screw_phase_deg = 0;  // at reading 0
  double slip_mm = 0;          // added to the readings from a frame on: lost steps, a loose clamp
  int slip_from_frame = 0;     // the first such frame, in the order of exposure
  double resolution_mm = 0;    // readings are rounded to multiples of it; 0: they are not
  double lead_error = 0;       // relative error of all readings: 0.01 for a lead that is 1 % wrong

  // The written reading for the right one. `is_falling`: the position was approached by falling
  // readings.
  THICKLENS_EXPORT double Written(double reading_mm, bool is_falling, int frame_index) const;
};

// What SweepSimulator simulates. The defaults are those of the file's schema.
struct SweepSimulationOptions {
  Camera camera;         // image size, pitch, lens; its calibration gives d1, kappa and the floor
  TargetOptions target;  // what is photographed

  // The part that moves. Where it is the lens or the sensor, the target is in the camera's plane of
  // focus when the sensor is at the camera's image distance, the fall-off of the light and its
  // distribution over the pupil are those of that state, and the two members behind it are about
  // d1 in place of z.
  SweepMotion moves = SweepMotion::kTarget;
  double first_depth_mm = 0;           // true z of the first frame, from Ap
  double first_image_distance_mm = 0;  // true d1 of the first frame; lens or sensor only
  double step_mm = 0;                  // step between frames in z or d1, may be negative
  int frame_count = 0;                 // number of frames
  double bench_offset_mm = 0;          // z (or d1) = offset + reading, or offset - reading
  BenchDirection direction = BenchDirection::kAway;  // sign of the reading in z (or d1)
  double reading_sigma_mm = 0;                       // sd of the error of each written reading
  // > 0: the readings are whole counts of a drive of the lens or the sensor, so many per mm, and
  // count 0 is at the offset. 0: they are in mm.
  double counts_per_mm = 0;
  StageOptions stage;  // order of the positions; systematic errors

  double light_level = 0.5;         // mean linear grey at the plane of focus, of full scale
  bool lamp_falloff = true;         // the irradiance of the target is proportional to (zf/z)^2
  double flicker = 0;               // relative sd of the lamp, per frame
  double drift_sigma_px = 0;        // sd of the lateral position of the target, per frame, at zf
  double full_well_electrons = 0;   // shot noise: electrons at full scale; 0: no shot noise
  double read_noise_electrons = 0;  // standard deviation of the read noise
  int bits = 8;                     // 8 or 16 per encoded value
  // Fixed to the frame: light at the farthest corner over that on the axis, in stops (factors of 2;
  // negative: darker), and soft discs on the sensor at random places, each of which takes a part of
  // the light. Their radii are from a third of speck_radius_px to speck_radius_px.
  double corner_stops = 0;
  int speck_count = 0;         // number of specks on the sensor
  double speck_depth = 0.4;    // part of the light that a speck takes, 0 to 1
  double speck_radius_px = 9;  // radius of the largest speck, px
  // Field curvature, astigmatism, distortion and axial colour of the lens. The plane of focus of
  // the camera is the medial focus on the axis. Distortion displaces the blurred image of a lens
  // without it. With axial colour the frames have three channels, of equal light.
  LensAberrations aberrations;
  // The outline of the aperture; other than round ones need a camera whose PSF is a disc, the
  // uniform pupil law and a flat texture, and a lens without field curvature and astigmatism. Its
  // size is such that the second moment of the light is (kappa r)^2.
  ApertureOutline aperture;
  // Bands of the light in rows or columns: a lamp that flickers while the shutter rolls. The phase
  // is another one in each frame.
  double band_amplitude = 0;        // relative, 0 to 1; 0: none
  double band_period_px = 24;       // period of the bands, px
  bool bands_are_square = false;    // the lamp is switched on and off; false: a sine
  bool bands_are_columns = false;   // the sensor is mounted on its side; false: rows
  double exposure_drift_stops = 0;  // change of the exposure from the first to the last frame
  // Distribution of the light of a point over the pupil; its second moment is (kappa r)^2 in any
  // case. If it is absent, the law of the paper is used where fall-off is on, and the uniform law
  // otherwise.
  std::optional<PupilLaw> pupil_law;
  // A choice of SweepEffects(); kAuto selects all of them.
  EffectSelectionOptions effects;
  std::uint64_t seed = 1;            // of textures, noise and errors
  std::vector<std::string> notices;  // of the file, one line each: names that are deprecated

  // The number of steps from the first position at which a frame is taken.
  THICKLENS_EXPORT int StepsOf(int frame_index) const;
  // The frame that is farthest from the first one.
  THICKLENS_EXPORT int FarthestFrame() const;
  // Whether the position of a frame is approached by falling readings.
  THICKLENS_EXPORT bool IsFalling(int frame_index) const;
  // Distance d1 of the sensor from Ap in a frame, mm.
  THICKLENS_EXPORT double ImageDistanceMm(int frame_index) const;
  // Depth z of the target from Ap in a frame, mm.
  THICKLENS_EXPORT double DepthMm(int frame_index) const;
  // The depth of the target where the sensor is at a distance d1 and lens or sensor move, mm: a
  // lens that moves away from the sensor comes nearer to the target.
  THICKLENS_EXPORT double DepthAt(double image_distance_mm) const;

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Returns the effects that a simulated sweep can have. Diffraction is not among them because a lens
// floor includes it.
THICKLENS_EXPORT EffectSet SweepEffects();

// Reads a file of the schema thicklens/simulate-sweep/1 (docs/file-formats.md). Throws Error if it
// is not valid.
THICKLENS_EXPORT SweepSimulationOptions ReadSweepSimulation(const std::string& path);

// A bench sweep of a flat target, frame by frame, in grey or, with axial colour, in RGB. Each frame
// shows the target at its depth through the exact transfer functions of defocus, blur floor and
// pixel box, at the image scale of its chief rays. Each effect can be left out. Textures are
// periodic and band-limited by definition: beyond the tile a frame sees its repetition. Edges have
// a closed form. Each column of a tilted target is at its own depth, within about 0.01 px of its
// blur and position. Parts of a relief have the scale and the blur of their own depths, and hide
// what is behind them from a part of the aperture.
class THICKLENS_EXPORT SweepSimulator {
 public:
  // `target_image` is linear light; only kImage uses it. Throws Error if the options are not
  // valid.
  SweepSimulator(const SweepSimulationOptions& options, const LinearImage& target_image);
  ~SweepSimulator();
  SweepSimulator(const SweepSimulator&) = delete;
  SweepSimulator& operator=(const SweepSimulator&) = delete;

  // Returns linear light before noise and quantisation, 1 at full scale, not clipped. Thread safe:
  // the same index gives the same bits in any order and on any thread. Throws Error if the frame
  // does not exist.
  LinearImage RenderNoiseless(int frame_index) const;
  // Returns the encoded values of the camera: noise, transfer curve, rounding and clipping are
  // applied. Thread safe; throws Error if the frame does not exist.
  EncodedImage RenderFrame(int frame_index) const;

  // The parameters and the true depth, reading and blur of every frame.
  const SweepTruth& truth() const;
  // The effects that the frames have.
  const EffectSelection& effects() const;
  // The camera of the options with which the encoded values must be interpreted. Its transfer curve
  // is linear if that effect is off, and its PSF is Gaussian if the effect aperture shape is off.
  const Camera& camera() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SWEEP_SIMULATOR_H_
