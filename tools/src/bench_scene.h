#ifndef THICKLENS_TOOLS_BENCH_SCENE_H_
#define THICKLENS_TOOLS_BENCH_SCENE_H_

#include <cstdint>
#include <functional>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::tools {

// One picture that every solver can be measured on, with the light field it is a picture of: a
// slanted plane of noise from .75 m to 1.5 m before a lens of f/1.4 that is focused at 1 m, so that
// the blur goes from 0 to 3 px of sigma, in grey, 8 bits, with noise of one grey level.
struct BenchScene {
  estimator::EstimateInput input;
  model::LightField truth;  // no values: it is not known
  bool has_truth() const { return !truth.values.empty(); }
};
// Of any scene; colours stay. Its camera, and how many views its options have. The photograph is
// made of hundreds of rays a pixel, far finer than any solver's views.
BenchScene SimulateBenchScene(const model::SceneSimulationOptions& options,
                              const std::vector<model::LayerPixels>& pixels,
                              const model::SceneRun& run);

model::LightField GreyViews(const model::LightField& colours);

// f/1.4, 12.5 mm, thin, focused at 1 m.
model::Camera BenchCamera(int width_px, int height_px);
// What the two scenes below are simulated from.
model::SceneSimulationOptions SlantedScene(const model::Camera& camera, int u_count, int v_count,
                                           std::uint64_t seed);
model::SceneSimulationOptions CardsScene(const model::Camera& camera, int u_count, int v_count,
                                         std::uint64_t seed);
// With any other lens that is focused there; the planes' depths stay.
BenchScene MakeBenchScene(const model::Camera& camera, int u_count, int v_count, std::uint64_t seed,
                          int threads, const std::function<void(int done, int total)>& progress);
BenchScene MakeBenchScene(int width_px, int height_px, int u_count, int v_count, std::uint64_t seed,
                          int threads, const std::function<void(int done, int total)>& progress);

// Three cards of leaves from .7 m to .9 m before a wall of noise at 1.2 m, seen by BenchCamera:
// many rays pass beside a card to what the centre view does not show.
BenchScene MakeOccludedScene(int width_px, int height_px, int u_count, int v_count,
                             std::uint64_t seed, int threads,
                             const std::function<void(int done, int total)>& progress);

// The same for a part of the picture.
BenchScene PartOf(const BenchScene& scene, const model::PixelRect& part);
BenchScene MiddleOf(const BenchScene& scene, int width_px, int height_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SCENE_H_
