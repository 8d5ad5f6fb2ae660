#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_MEMORY_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_MEMORY_H_

#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

// Bytes of H; and of the rays of the aperture from which it is made, which are then no longer.
struct ProjectionBytes {
  double held = 0;
  double fan = 0;
};

// The most that the whole process is expected to hold while a scene is estimated, bytes: what it
// holds already, and what the estimate keeps from its beginning to its end, and the largest of what
// it needs to set a band of the picture up, to solve it, and to make the views.
class SceneMemory {
 public:
  struct Keeps {
    bool photograph = false;   // one without fall-off, beside the input's
    bool maps = false;         // SceneMaps
    bool light_field = false;  // all views
    double sink_bytes = 0;     // that a sink holds for each view it is given
    bool device = false;       // OpenCL, whose memory may be the machine's
  };
  // To be made before the estimate begins. `reach_px`: how many rows the fan of a pixel reaches up
  // and down.
  SceneMemory(const EstimateInput& input, const SceneOptions& options, const Keeps& keeps,
              int reach_px);

  // In bands of at most so many rows, of which H takes so much; and views of the fan are kept, from
  // when H is made to when they are shown, that take so much. What is freed while H is made goes
  // back to the system, or stays for what is asked for next (ReturnFreedMemory).
  enum class Freed { kReturned, kStays };
  double MostBytes(int rows, const ProjectionBytes& projection, double kept_fan_bytes = 0,
                   Freed freed = Freed::kReturned) const;
  // What H of a band takes if each pixel takes so much where the picture does not end.
  ProjectionBytes OfRows(int rows, const ProjectionBytes& per_pixel) const;
  // More than any pixel takes.
  ProjectionBytes LargestPerPixel() const;

 private:
  double RowBytes() const;  // of a pixel that has a row of its own
  double SetupBytes(double pixels, const ProjectionBytes& projection, Freed freed) const;
  double SolveBytes(double pixels) const;
  double PatchesBytes(double pixels) const;
  double ReliefBytes(double pixels) const;
  double PlaneBytes(double pixels, double planes) const;
  double ViewsBytes() const;

  double before_ = 0;
  int width_px_ = 0, height_px_ = 0, channels_ = 0;
  int u_count_ = 0, v_count_ = 0, seen_views_ = 0;
  int threads_ = 1, reach_px_ = 0;
  double real_ = 0;  // bytes of a number of the solver
  bool patches_ = false;
  Keeps keeps_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_MEMORY_H_
