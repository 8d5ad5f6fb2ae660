#include "thicklens/estimator/scene_form.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "thicklens/base/index.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/light_field_description.h"

namespace thicklens::estimator {
namespace {

// Returns what is wrong with a plane of the scene, or an empty text.
std::string PlaneComplaint(const char* name, int width_px, int height_px, int channels,
                           const std::vector<float>& values, const model::LightField& frame,
                           int expected_channels) {
  if (width_px != frame.s_count || height_px != frame.t_count || channels != expected_channels) {
    return fmt::format("{}: it has {}x{} px in {} channel(s): {}x{} px in {} are needed", name,
                       width_px, height_px, channels, frame.s_count, frame.t_count,
                       expected_channels);
  }
  const std::size_t count = Index(width_px) * Index(height_px) * Index(channels);
  if (values.size() != count) {
    return fmt::format("{}: {} values: {} are needed", name, values.size(), count);
  }
  const auto wrong =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (wrong == values.end()) return "";
  const auto pixel = static_cast<std::size_t>(wrong - values.begin()) / Index(channels);
  return fmt::format("{}: the value at ({}, {}) is {}: it must be finite", name,
                     pixel % Index(width_px), pixel / Index(width_px), *wrong);
}

std::string Complaint(const SceneForm& scene) {
  const model::LightField& frame = scene.frame;
  if (!frame.values.empty()) {
    return fmt::format("frame: it has {} values: a scene has none", frame.values.size());
  }
  std::string why;
  if (!model::IsValidDescription(frame, &why)) return "frame." + why;
  if (!std::all_of(frame.present.begin(), frame.present.end(), [](bool there) { return there; })) {
    return "frame.present: a view is missing: a scene has all views";
  }
  const model::LinearImage& radiance = scene.radiance;
  why = PlaneComplaint("radiance", radiance.width_px, radiance.height_px, radiance.channels,
                       radiance.values, frame, frame.channels);
  if (!why.empty()) return why;
  const DisparityMap& disparity = scene.disparity;
  why = PlaneComplaint("disparity", disparity.width_px, disparity.height_px, 1, disparity.disparity,
                       frame, 1);
  if (!why.empty()) return why;
  if (!disparity.step.allFinite()) {
    return fmt::format("disparity.step is ({}, {}): both must be finite", disparity.step.x(),
                       disparity.step.y());
  }
  if (!scene.confidence.empty() && scene.confidence.size() != frame.view_size()) {
    return fmt::format("confidence: {} bytes: {} are needed, or none", scene.confidence.size(),
                       frame.view_size());
  }
  return "";
}

}  // namespace

bool SceneForm::IsValid(std::string* why) const {
  std::string complaint = Complaint(*this);
  return complaint.empty() || Fail(why, std::move(complaint));
}

}  // namespace thicklens::estimator
