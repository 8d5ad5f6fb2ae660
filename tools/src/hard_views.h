#ifndef THICKLENS_TOOLS_HARD_VIEWS_H_
#define THICKLENS_TOOLS_HARD_VIEWS_H_

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "hard_case.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// Scenes of hard cases, given by disparity: their light fields are known in closed form.

// Radiance at a place of a view, px.
using Radiance = std::function<double(double x, double y)>;
// What the centre view's pixel sees, px per view step.
using DisparityOf = std::function<double(int x, int y)>;
// Radiance of view (a, b), in steps from the centre, at (x, y).
using ViewOf = std::function<double(double a, double b, double x, double y)>;

struct HardPicture {
  int width_px = 40, height_px = 30;
  int u_count = 3, v_count = 3;
  int channels = 1;  // all alike but for a factor that ChannelFactor has; 4: RGB and alpha
  int bits = 16;
};
double ChannelFactor(int channel);

// What ViewsAre usually leaves out at the border.
constexpr int kTruthBorderPx = 8;

// Waves of several directions about .5, nothing shorter than 9 px, within [.15, .85].
double Waves(double x, double y);

// A surface of disparity d + g x, painted with radiance at the centre view's places: view (a, b)
// shows at x what the centre view has at (x + a d)/(1 - a g), and at y the same without slope.
ViewOf SlantedSurface(const Radiance& radiance, double disparity_px, double slope);

// Writes picture.png, the mean of the views, in linear light.
void WriteMeanOfViews(const std::filesystem::path& folder, const HardPicture& shape,
                      const ViewOf& view);
// Writes picture.png of any radiance.
void WritePicture(const std::filesystem::path& folder, const HardPicture& shape,
                  const Radiance& radiance);
// Writes depth.pfm; NaN is a hole.
void WriteDepth(const std::filesystem::path& folder, const HardPicture& shape,
                const DisparityOf& disparity);

// `estimate` of these files into `views`, with more arguments.
HardRun EstimateOf(const HardPicture& shape, const std::vector<std::string>& more,
                   Requirement required);

// Rms difference of all views from the truth, `border_px` cut; throws Error where a value is no
// number or the sizes are not what was asked for.
Requirement ViewsAre(const HardPicture& shape, const ViewOf& view, int border_px, double limit);
// How far views leave the range of the picture's values, over that range; throws Error where their
// light is not that of the photograph, to a tenth.
Requirement ViewsWithinPicture(const HardPicture& shape, double limit);
// The same; where iterations converged, that the views are these (if any), to an rms; where they
// did not, that the summary is partial and says so; or that the run was refused because they led
// nowhere, or because a block is singular.
Requirement SolvedOrTold(const HardPicture& shape, double limit, const ViewOf& truth,
                         double rms_limit);
// Largest difference between two views.
Requirement ViewsAreAlike(const HardPicture& shape, double limit);
// All values are numbers.
Requirement ViewsAreNumbers(const HardPicture& shape);
// Largest difference from one radiance (times ChannelFactor).
Requirement ViewsAreAll(const HardPicture& shape, double radiance, double limit);

// The arguments of every solver, prior and precision of this build; and with each device what runs
// on one: the scene solver in both precisions, and the blocks' matrices, which are the same for all
// who solve them.
struct Way {
  std::vector<std::string> arguments;
  std::string solver;        // scene, blocks, functional, grid
  bool is_iterative = true;  // has a tolerance
};
std::vector<Way> EveryWay(const HardMachine& machine);

// One run for each way.
std::vector<HardRun> ByEveryWay(const HardPicture& shape, const HardMachine& machine,
                                const std::vector<std::string>& more, const Requirement& required);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_HARD_VIEWS_H_
