#include "thicklens/scene_form.h"

#include <fmt/format.h>

#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/io/scene_form_files.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

void RequireIndex(const char* name, double index, int count) {
  if (index >= 0 && index <= count - 1) return;
  throw Error(fmt::format("{} is {:g}: it must be from 0 to {}", name, index, count - 1));
}

}  // namespace

bool IsSceneForm(const std::string& folder) { return io::IsSceneForm(folder); }

SceneForm ReadSceneForm(const std::string& folder, const RunControl& run) {
  checks::RequireValid(run);
  const RunScope scope(run);
  return io::ReadSceneForm(folder);
}

void WriteSceneForm(OutputFolder* folder, const SceneForm& scene, const RunControl& run) {
  checks::RequireValid(run);
  if (folder == nullptr) throw Error("folder: a claimed folder is expected, found null");
  const RunScope scope(run);
  io::WriteSceneForm(scene, folder);
}

void WriteSceneForm(const std::string& folder, const SceneForm& scene, const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValidInput("scene", scene);
  const RunScope scope(run);
  OutputFolder output = ClaimLightFieldFolder(folder, LightFieldFormat::kScene);
  io::WriteSceneForm(scene, &output);
  ThrowIfCancelled();
  output.Commit();
}

Image RenderView(const SceneForm& scene, double u, double v) {
  checks::RequireValidInput("scene", scene);
  const model::LightField& frame = scene.frame;
  RequireIndex("u", u, frame.u_count);
  RequireIndex("v", v, frame.v_count);
  if (frame.channels != 1 && frame.channels != 3) {
    throw Error(fmt::format("scene: 1 or 3 channels are expected, found {}", frame.channels));
  }
  model::LinearImage view = estimator::SceneRenderer(scene).View(u - (frame.u_count - 1) / 2.0,
                                                                 v - (frame.v_count - 1) / 2.0);
  Image image = Image::FromLight(
      view.width_px, view.height_px, view.channels == 1 ? ChannelOrder::kGrey : ChannelOrder::kRgb,
      std::move(view.values), frame.transfer, fmt::format("view ({:g}, {:g})", u, v));
  image.SetColourProfile(frame.colour_profile);
  return image;
}

LightField ViewsOf(const SceneForm& scene, const RunControl& run) {
  checks::RequireValid(run);
  const RunScope scope(run);
  return estimator::ViewsOf(scene, run.threads);
}

}  // namespace thicklens
