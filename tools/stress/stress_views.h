#ifndef THICKLENS_TOOLS_STRESS_STRESS_VIEWS_H_
#define THICKLENS_TOOLS_STRESS_STRESS_VIEWS_H_

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "thicklens/model/scene.h"
#include "tools/stress/stress_case.h"

namespace thicklens::tools {

// Scenes of hard cases, given by disparity: their light fields are known in closed form.

// Radiance at a position in a view, px.
using Radiance = std::function<double(double x, double y)>;
// Disparity at a pixel of the centre view, px per view step.
using DisparityOf = std::function<double(int x, int y)>;
// Radiance of view (a, b), in steps from the centre, at (x, y).
using ViewOf = std::function<double(double a, double b, double x, double y)>;

struct StressImage {
  int width_px = 40, height_px = 30;
  int u_count = 3, v_count = 3;
  int channels = 1;  // equal up to ChannelFactor; 4: RGB and alpha
  int bits = 16;
};
double ChannelFactor(int channel);

// Border that ViewsAre usually leaves out.
constexpr int kTruthBorderPx = 8;

// Waves of several directions around 0.5, no wavelength shorter than 9 px, within [0.15, 0.85].
double Waves(double x, double y);

// A surface of disparity d + g x, painted with radiance at the centre view's positions: view (a, b)
// shows at x what the centre view shows at (x + a d)/(1 - a g), and at y the same without slope.
ViewOf SlantedSurface(const Radiance& radiance, double disparity_px, double slope);

// Writes picture.png, the mean of the views, in linear light.
void WriteMeanOfViews(const std::filesystem::path& folder, const StressImage& shape,
                      const ViewOf& view);
// Writes picture.png of any radiance.
void WriteImage(const std::filesystem::path& folder, const StressImage& shape,
                const Radiance& radiance);
// Writes depth.pfm; NaN is a hole.
void WriteDepth(const std::filesystem::path& folder, const StressImage& shape,
                const DisparityOf& disparity);

// Returns the run of `estimate` on these files into `views`, with additional arguments.
StressRun EstimateOf(const StressImage& shape, const std::vector<std::string>& more,
                     Requirement required);

// Measures the rms difference of all views from the truth, without `border_px`. Throws Error if a
// value is not a number or the sizes are not as requested.
Requirement ViewsAre(const StressImage& shape, const ViewOf& view, int border_px, double limit);
// Measures how far views leave the range of the photograph's values, relative to that range, which
// reaches at least up to `brightest` (of full scale). Throws Error if their light differs from that
// of the photograph by more than a tenth.
Requirement ViewsWithinImage(const StressImage& shape, double limit, double brightest = 0);
// Requires the same range. If the iterations converged, the views must also be `truth` (if given)
// within an rms. If they did not, the summary must be partial and report it. A refusal because the
// iterations diverged or a block is singular is also accepted.
Requirement SolvedOrReported(const StressImage& shape, double limit, const ViewOf& truth,
                             double rms_limit);
// Measures the largest difference between two views.
Requirement ViewsAreAlike(const StressImage& shape, double limit);
// Requires that all values are numbers.
Requirement ViewsAreNumbers(const StressImage& shape);
// Measures the largest difference from one radiance (times ChannelFactor).
Requirement ViewsAreAll(const StressImage& shape, double radiance, double limit);

// The arguments of every solver, prior and precision of this build and, for each device, of what
// runs on it: the scene solver in both precisions, and the blocks' matrices, which are the same for
// all solvers of blocks.
struct Way {
  std::vector<std::string> arguments;
  std::string solver;        // scene, blocks, functional, grid
  bool is_iterative = true;  // has a tolerance
};
std::vector<Way> EveryWay(const Capabilities& capabilities);

// Returns one run for each way.
std::vector<StressRun> ByEveryWay(const StressImage& shape, const Capabilities& capabilities,
                                  const std::vector<std::string>& more,
                                  const Requirement& required);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_STRESS_STRESS_VIEWS_H_
