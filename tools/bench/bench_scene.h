#ifndef THICKLENS_TOOLS_BENCH_BENCH_SCENE_H_
#define THICKLENS_TOOLS_BENCH_BENCH_SCENE_H_

#include <cstdint>
#include <functional>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::tools {

// One image that every solver can be measured on, with its true light field: a slanted plane of
// noise from 0.75 m to 1.5 m in front of a lens of f/1.4 that is focused at 1 m, so that the blur
// goes from 0 to 3 px of sigma, in grey, 8 bits, with noise of one grey level.
struct BenchScene {
  estimator::EstimateInput input;
  model::LightField truth;  // without values: the truth is not known
  bool has_truth() const { return !truth.values.empty(); }
};
// Simulates any scene and keeps colours. The options give the camera and the number of views. The
// photograph is made of hundreds of rays for each pixel, far finer than any solver's views.
BenchScene SimulateBenchScene(const model::SceneSimulationOptions& options,
                              const std::vector<model::LayerPixels>& pixels,
                              const model::SceneRun& run);

model::LightField GreyViews(const model::LightField& colours);

// f/1.4, 12.5 mm, thin, focused at 1 m.
model::Camera BenchCamera(int width_px, int height_px);
// Options that the two scenes below are simulated from.
model::SceneSimulationOptions SlantedScene(const model::Camera& camera, int u_count, int v_count,
                                           std::uint64_t seed);
model::SceneSimulationOptions CardsScene(const model::Camera& camera, int u_count, int v_count,
                                         std::uint64_t seed);
// Makes the slanted scene with any other lens that is focused at 1 m; the depths of the planes
// stay.
BenchScene MakeBenchScene(const model::Camera& camera, int u_count, int v_count, std::uint64_t seed,
                          int threads, const std::function<void(int done, int total)>& progress);
BenchScene MakeBenchScene(int width_px, int height_px, int u_count, int v_count, std::uint64_t seed,
                          int threads, const std::function<void(int done, int total)>& progress);

// Three cards of leaves from 0.7 m to 0.9 m in front of a wall of noise at 1.2 m, seen by
// BenchCamera: many rays pass beside a card to background that the centre view does not show.
BenchScene MakeOccludedScene(int width_px, int height_px, int u_count, int v_count,
                             std::uint64_t seed, int threads,
                             const std::function<void(int done, int total)>& progress);

// Cut a part out of the image, with everything that belongs to it.
BenchScene PartOf(const BenchScene& scene, const model::PixelRect& part);
BenchScene MiddleOf(const BenchScene& scene, int width_px, int height_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_SCENE_H_
