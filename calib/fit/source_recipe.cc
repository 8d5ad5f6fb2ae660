#include "calib/fit/source_recipe.h"

#include <algorithm>

#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

SourceRecipe RunSourceRecipe(const model::Camera& camera,
                             const std::vector<FrameMeasurement>& frames,
                             const std::vector<std::size_t>& used) {
  SourceRecipe recipe;
  const auto sharpest_by = [&](double FrameMeasurement::*index) {
    return *std::max_element(used.begin(), used.end(), [&](std::size_t a, std::size_t b) {
      return frames[a].*index < frames[b].*index;
    });
  };
  const std::size_t sharpest = sharpest_by(&FrameMeasurement::mean_edge_slope);
  recipe.sharpest_frame = static_cast<int>(sharpest);
  recipe.focus_depth_mm = frames[sharpest].depth_mm;
  recipe.image_distance_mm = model::ImageDistanceMm(camera.lens, recipe.focus_depth_mm);
  const std::size_t normalised = sharpest_by(&FrameMeasurement::normalised_edge_slope);
  recipe.sharpest_normalised_frame = static_cast<int>(normalised);
  recipe.normalised_focus_depth_mm = frames[normalised].depth_mm;
  double sum = 0;
  for (const std::size_t i : used) {
    const FrameMeasurement& frame = frames[i];
    // The sharpest frame itself has r_defocus = 0 by construction (up to rounding).
    if (frame.depth_mm == recipe.focus_depth_mm || !(frame.source_blur_sigma_px > 0)) continue;
    const double radius_px =
        model::BlurRadiusMm(camera.lens, recipe.image_distance_mm, frame.depth_mm) /
        camera.sensor.pixel_pitch_mm;
    sum += frame.source_blur_sigma_px / radius_px;
    ++recipe.ratio_frames;
  }
  if (recipe.ratio_frames > 0) recipe.blur_ratio = sum / recipe.ratio_frames;
  recipe.done = recipe.ratio_frames > 0;
  recipe.message = recipe.done ? "done" : "no frame away from focus has measurable edges";
  return recipe;
}

}  // namespace thicklens::calib
