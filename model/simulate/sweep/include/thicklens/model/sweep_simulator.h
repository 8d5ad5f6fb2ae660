#ifndef THICKLENS_MODEL_SWEEP_SIMULATOR_H_
#define THICKLENS_MODEL_SWEEP_SIMULATOR_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/effect_choice.h"
#include "thicklens/model/pupil_law.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// The flat target in front of the camera.
enum class TargetKind {
  kDeadLeaves,
  kPinkNoise,
  kWhiteNoise,
  kCheckerboard,
  kSiemensStar,
  kPicture,      // the user's own
  kPrintedEdge,  // a slanted edge, soft by its ink: a Gaussian of ink_sigma_mm on the target
  kKnifeEdge,    // a slanted edge without softness
};
std::string TargetKindName(TargetKind kind);  // "dead-leaves", "pink-noise", ...

struct TargetOptions {
  TargetKind kind = TargetKind::kDeadLeaves;
  std::string picture_path;  // kPicture, for messages and the record
  // (bright - dark)/(bright + dark) of two-valued targets; leaves have every grey between the two;
  // noise has the relative standard deviation contrast/2; a picture keeps its own contrast.
  double contrast = 0.6;
  // Radius of the smallest leaf, shortest period of the noise, side of a square, width of a star's
  // sector at half the field's shorter side from its centre, width of the whole picture.
  // 0: chosen from the field of view (2 px, 2 px, 24 px, 36 cycles, as wide as the frames see).
  double feature_size_mm = 0;
  // Of edges, from the vertical; positive: the upper end leans right. Bright is on the right.
  double edge_angle_deg = 5;
  double ink_sigma_mm = 0.1;  // kPrintedEdge
  // About the vertical line through the axis; positive: the right side is nearer to the camera.
  double tilt_deg = 0;
};

struct SweepSimulationOptions {
  Camera camera;  // size, pitch, lens; its calibration gives d1, kappa and the floor
  TargetOptions target;

  double first_depth_mm = 0;  // true z of the first frame
  double step_mm = 0;         // between frames, may be negative
  int frame_count = 0;
  double bench_offset_mm = 0;  // z = offset + reading or offset - reading
  BenchDirection direction = BenchDirection::kAway;
  double reading_sigma_mm = 0;  // sd of the error of each written reading

  double light_level = 0.5;        // mean linear grey at the plane of focus, of full scale
  bool lamp_falloff = true;        // irradiance of the target as (zf/z)^2
  double flicker = 0;              // relative sd of the lamp, per frame
  double drift_sigma_px = 0;       // sd of the lateral position of the target, per frame, at zf
  double full_well_electrons = 0;  // shot noise: electrons at full scale; 0: no shot noise
  double read_noise_electrons = 0;
  int bits = 8;
  // How the light of a point spreads over the pupil; its second moment is (kappa r)^2 in any case.
  // Absent: the paper's law where fall-off is on, else uniform.
  std::optional<PupilLaw> pupil_law;
  // Of SweepEffects; kAuto has them all.
  EffectChoice effects;
  std::uint64_t seed = 1;

  bool IsValid(std::string* why) const;
};

// What a simulated sweep can have. Diffraction is not among them: a lens floor holds it.
EffectSet SweepEffects();

// Reads schema thicklens/simulate-sweep/1 (docs/file-formats.md).
SweepSimulationOptions ReadSweepSimulation(const std::string& path);

// A bench sweep of a flat target, frame by frame, grey: at each depth the target through the exact
// transfer functions of defocus, lens floor and pixel box, at the image scale of its chief rays;
// each of its effects can be left out.
// Textures are periodic and band-limited by definition (what a frame sees beyond their tile is
// their repetition); edges are in closed form. Every column of a
// tilted target is at its own depth, within about .01 px of its blur and place.
// `target_picture` is linear light, for kPicture
// alone.
class SweepSimulator {
 public:
  // Throws Error if the options are not valid.
  SweepSimulator(const SweepSimulationOptions& options, const LinearPicture& target_picture);
  ~SweepSimulator();
  SweepSimulator(const SweepSimulator&) = delete;
  SweepSimulator& operator=(const SweepSimulator&) = delete;

  // Thread safe; the same index gives the same bits in any order and on any thread.
  // Linear light before noise and quantisation, 1 at full scale, not clipped.
  LinearPicture RenderNoiseless(int frame_index) const;
  // What the camera stores: noise, transfer curve, rounding, clipping.
  StoredPicture RenderFrame(int frame_index) const;

  const SweepTruth& truth() const;
  const EffectDecision& effects() const;
  // The options' camera as its stored values say it: without the transfer curve's effect linear.
  const Camera& camera() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SWEEP_SIMULATOR_H_
