#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_MEMORY_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_MEMORY_H_

#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

// Bytes of H, and of the aperture's rays from which H is made, which are freed afterwards.
struct ProjectionBytes {
  double held = 0;
  double bundle = 0;
};

// Predicts the maximum memory of the whole process while a scene is estimated, bytes. It is the sum
// of the memory in use before, the memory that the estimate keeps from its beginning to its end,
// and the largest of the needs of three steps: setting up a band of the image, solving it, and
// making the views.
class SceneMemory {
 public:
  struct Keeps {
    bool photograph = false;   // one without fall-off, in addition to the input's
    bool maps = false;         // SceneMaps
    bool light_field = false;  // all views
    double sink_bytes = 0;     // memory that a sink holds for each view that it receives
    bool device = false;       // OpenCL, whose memory may be the machine's
  };
  // Must be constructed before the estimate begins. `reach_px`: number of rows that the bundle of a
  // pixel reaches up and down.
  SceneMemory(const EstimateInput& input, const SceneOptions& options, int threads,
              const Keeps& keeps, int reach_px);

  // Returns the maximum for bands of at most `rows` rows, with `projection` as the memory of H.
  // `kept_bundle_bytes` are the views of the bundle that are kept from the making of H until they
  // are shown. Memory that is freed while H is made is returned to the system or stays for later
  // requests (ReturnFreedMemory).
  enum class Freed { kReturned, kStays };
  double MostBytes(int rows, const ProjectionBytes& projection, double kept_bundle_bytes = 0,
                   Freed freed = Freed::kReturned) const;
  // Returns the memory of H of a band if `per_pixel` is the memory per pixel far from the image's
  // borders.
  ProjectionBytes OfRows(int rows, const ProjectionBytes& per_pixel) const;
  // Returns an upper bound for any pixel.
  ProjectionBytes LargestPerPixel() const;

 private:
  double RowBytes() const;  // memory of a pixel that has a row of its own
  double SetupBytes(double pixels, const ProjectionBytes& projection, Freed freed) const;
  double SolveBytes(double pixels) const;
  double PatchesBytes(double pixels) const;
  double ShadingGuideBytes(double pixels) const;
  double PlaneBytes(double pixels, double planes) const;
  double ViewsBytes() const;

  double before_ = 0;
  int width_px_ = 0, height_px_ = 0, channels_ = 0;
  int u_count_ = 0, v_count_ = 0, visible_views_ = 0;
  int threads_ = 1, reach_px_ = 0;
  double real_ = 0;  // bytes of a number of the solver
  bool patches_ = false;
  Keeps keeps_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_MEMORY_H_
