// Hard cases of scenes and images, each with every way to a light field.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tools/stress/stress_suite.h"
#include "tools/stress/stress_views.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr double kHole = std::numeric_limits<double>::quiet_NaN();

// A case that runs every way on one image.
StressCase ByAll(std::string name, std::string why, std::string required, const StressImage& shape,
                 std::function<void(const fs::path&)> write, const Requirement& outcome) {
  StressCase hard;
  hard.name = "scene/" + std::move(name);
  hard.why = std::move(why);
  hard.required = std::move(required);
  hard.prepare = [=](const fs::path& folder, const Capabilities& capabilities) {
    write(folder);
    return ByEveryWay(shape, capabilities, {}, outcome);
  };
  return hard;
}

// A surface whose views are known.
StressCase Surface(std::string name, std::string why, const StressImage& shape, double disparity_px,
                   double slope, double limit, const std::function<bool(int, int)>& is_hole = {}) {
  const ViewOf view = SlantedSurface(Waves, disparity_px, slope);
  return ByAll(
      std::move(name), std::move(why),
      fmt::format("views differ from the true ones by at most {:g} of full scale, rms, without a "
                  "border of 8 px",
                  limit),
      shape,
      [=](const fs::path& folder) {
        WriteMeanOfViews(folder, shape, view);
        WriteDepth(folder, shape, [&](int x, int y) {
          return is_hole && is_hole(x, y) ? kHole : disparity_px + slope * x;
        });
      },
      ViewsAre(shape, view, kTruthBorderPx, limit));
}

// An image and a depth that no light field explains well: the result must stay bounded. The
// paper's functional takes all contrast for detail that was blurred; only its ridge bounds it.
StressCase Bounded(std::string name, std::string why, const StressImage& shape,
                   const Radiance& image, const DisparityOf& disparity, double limit,
                   double limit_of_source) {
  StressCase hard;
  hard.name = "scene/" + std::move(name);
  hard.why = std::move(why);
  hard.required = fmt::format(
      "no view leaves the range of the scene's light by more than {:g} of it (scene), {:g} (the "
      "paper's functional, by blocks or not)",
      limit, limit_of_source);
  // A clipped image shows less than the light of the scene, which is estimated beyond full scale.
  double brightest = 0;
  for (int y = 0; y < shape.height_px; ++y) {
    for (int x = 0; x < shape.width_px; ++x) brightest = std::max(brightest, image(x, y));
  }
  // The values of an image without clipped pixels are rounded, and state the range themselves.
  if (brightest <= 1) brightest = 0;
  hard.prepare = [=](const fs::path& folder, const Capabilities& capabilities) {
    WriteImage(folder, shape, image);
    WriteDepth(folder, shape, disparity);
    std::vector<StressRun> runs;
    for (const Way& way : EveryWay(capabilities)) {
      runs.push_back(
          EstimateOf(shape, way.arguments,
                     ViewsWithinImage(shape, way.solver == "scene" ? limit : limit_of_source,
                                      way.solver == "scene" ? brightest : 0)));
    }
    return runs;
  };
  return hard;
}

StressCase Uniform(std::string name, std::string why, double radiance) {
  const StressImage shape;
  return ByAll(
      std::move(name), std::move(why), "every ray has the image's value, to 0.001 of full scale",
      shape,
      [=](const fs::path& folder) {
        WriteImage(folder, shape, [=](double, double) { return radiance; });
        WriteDepth(folder, shape, [](int x, int y) { return 0.1 * x - 2 + (y > 15 ? 1.5 : 0); });
      },
      ViewsAreAll(shape, radiance, 1e-3));
}

Radiance Noise() {
  return [](double x, double y) {
    // Each pixel has its own value, the same on every machine.
    std::mt19937 engine(static_cast<unsigned>(1000 * y + x));
    engine.discard(3);
    return static_cast<double>(engine()) / 4294967295.0;
  };
}

std::vector<StressCase> Depths() {
  const StressImage usual;
  std::vector<StressCase> cases;
  cases.push_back(
      Surface("in-focus", "no blur at all: the photograph is every view", usual, 0, 0, 0.005));
  cases.push_back(Surface("constant-depth", "every pixel has the same blur, without a zero", usual,
                          1.5, 0, 0.03));
  cases.push_back(
      Surface("slanted-through-focus", "the blur is 0 along a line", usual, -1.6, 0.08, 0.02));
  cases.push_back(Bounded(
      "one-pixel-depth-steps",
      "depth jumps from pixel to pixel: nearly all "
      "rays are hidden by a neighbour",
      usual, Waves, [](int x, int y) { return (x + y) % 2 == 0 ? 1.0 : -1.0; }, 0.1, 0.1));
  cases.push_back(Bounded(
      "depth-spikes", "one pixel in fifty is far nearer than its neighbours", usual, Waves,
      [](int x, int y) { return (x + 7 * y) % 50 == 0 ? 6.0 : 0.3; }, 0.2, 0.5));
  cases.push_back(Surface("hole-of-one-pixel", "depth is missing in one pixel", usual, 1.5, 0, 0.03,
                          [](int x, int y) { return x == 20 && y == 15; }));
  cases.push_back(Surface("hole-of-a-third", "depth is missing in a third of the image", usual, 1.5,
                          0, 0.03, [](int x, int) { return x > 12 && x < 26; }));
  cases.push_back(Surface("one-valid-pixel", "depth is known in one pixel only", usual, 1.5, 0,
                          0.03, [](int x, int y) { return x != 20 || y != 15; }));
  cases.push_back(ByAll(
      "all-holes", "no depth is known", "refused: the depth map has no valid value", usual,
      [=](const fs::path& folder) {
        WriteImage(folder, usual, Waves);
        WriteDepth(folder, usual, [](int, int) { return kHole; });
      },
      Refused({"depth.pfm"})));
  return cases;
}

std::vector<StressCase> Images() {
  const StressImage usual;
  const DisparityOf slanted = [](int x, int) { return 0.04 * x - 0.8; };
  std::vector<StressCase> cases;
  cases.push_back(Uniform("uniform", "the depths cannot be distinguished", 0.5));
  cases.push_back(Uniform("black", "no light: every relative error divides by 0", 0));
  cases.push_back(Uniform("white", "everything is saturated", 1));
  cases.push_back(Bounded(
      "half-saturated", "half of the image is cut off at full scale", usual,
      [](double x, double y) { return 2 * Waves(x, y); }, slanted, 0.2, 0.5));
  cases.push_back(Bounded(
      "checkerboard-at-nyquist", "alternating black and white: no blur could have left it", usual,
      [](double x, double y) { return static_cast<int>(x + y) % 2 == 0 ? 0.9 : 0.1; }, slanted, 1,
      10));
  cases.push_back(Bounded("noise-alone", "no part of the image fits its depth", usual, Noise(),
                          slanted, 0.4, 10));
  cases.push_back(Bounded(
      "one-bright-pixel", "a point of light where blur should be", usual,
      [](double x, double y) { return x == 20 && y == 15 ? 1.0 : 0.05; },
      [](int, int) { return 0.8; }, 3, 5));
  return cases;
}

StressImage Sized(int width_px, int height_px, int channels = 1, int bits = 16) {
  StressImage shape;
  shape.width_px = width_px;
  shape.height_px = height_px;
  shape.channels = channels;
  shape.bits = bits;
  return shape;
}

std::vector<StressCase> Sizes() {
  const DisparityOf half = [](int, int) { return 0.5; };
  std::vector<StressCase> cases;
  cases.push_back(
      Bounded("one-pixel", "the image is 1 x 1 px", Sized(1, 1), Waves, half, 0.01, 0.01));
  cases.push_back(
      Bounded("one-row", "the image is 1 px high", Sized(40, 1), Waves, half, 0.1, 0.1));
  cases.push_back(
      Bounded("one-column", "the image is 1 px wide", Sized(1, 40), Waves, half, 0.1, 0.1));
  cases.push_back(
      Surface("prime-sizes", "37 x 23 px: nothing divides them", Sized(37, 23), 1.5, 0, 0.03));
  cases.push_back(
      Surface("colour-16-bit", "three channels of 16 bits", Sized(40, 30, 3), 1.5, 0, 0.03));
  cases.push_back(Surface("colour-8-bit", "three channels of 8 bits: rounding is noise",
                          Sized(40, 30, 3, 8), 1.5, 0, 0.03));
  cases.push_back(Surface("alpha", "four channels, the last of which is not light",
                          Sized(40, 30, 4), 1.5, 0, 0.03));
  return cases;
}

}  // namespace

std::vector<StressCase> SceneStressCases() {
  std::vector<StressCase> all;
  for (std::vector<StressCase> part : {Depths(), Images(), Sizes()}) {
    for (StressCase& hard : part) all.push_back(std::move(hard));
  }
  return all;
}

}  // namespace thicklens::tools
