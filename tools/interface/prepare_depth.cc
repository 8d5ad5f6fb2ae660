// Converts a depth map to the disparity of a photograph's pixels.
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "thicklens/estimator/fill_holes.h"
#include "tools/interface/depth_causes.h"
#include "tools/interface/depth_reports.h"
#include "tools/interface/problem.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

std::string NameOf(const DepthMap& map) { return map.source.empty() ? "depth" : map.source; }

double UnitMm(LengthUnit unit) {
  return unit == LengthUnit::kNone ? 1 : model::DepthUnitMm(LengthUnitName(unit));
}

// Step between views on the aperture, mm, along u, or along v where there is one view in u.
double ApertureStepMm(const model::LightFieldGrid& grid, const Camera& camera) {
  const Eigen::Vector2d step = model::ApertureStepsMm(grid, camera);
  return std::abs(step.x() != 0 ? step.x() : step.y());
}

estimator::DisparityMap WithoutHoles(const estimator::DisparityMap& map,
                                     const model::LinearImage& image, double at_infinity,
                                     PreparedDepth* prepared) {
  for (const float disparity : map.disparity) prepared->was_hole.push_back(std::isnan(disparity));
  return estimator::FillHoles(map, image, &prepared->holes, at_infinity);
}

// `raw` has the map's values, in which NaN marks the holes.
PreparedDepth PrepareByCamera(const DepthMap& map, const model::RawDepthMap& raw,
                              const model::LinearImage& image, const Camera& camera,
                              const model::LightFieldGrid& grid, RunScope* run) {
  model::DepthConvention convention;
  convention.kind = map.meaning.kind;
  convention.unit_mm = UnitMm(map.meaning.unit);
  convention.disparity_scale = map.meaning.disparity_scale;
  convention.disparity_offset_px = map.meaning.disparity_offset_px;
  convention.inverse_scale_dpt = map.meaning.inverse_scale_dpt;
  convention.inverse_offset_dpt = map.meaning.inverse_offset_dpt;
  if (convention.kind == DepthKind::kDisparity) {
    convention.aperture_step_mm = ApertureStepMm(grid, camera);
  }
  // Only the size of the image matters here.
  model::LinearImage empty{map.width_px, map.height_px, 1, {}};
  empty.values.assign(map.values.size(), 0.0F);
  const auto make = [&] {
    return model::MakeScene(camera, std::move(empty), raw, convention, NameOf(map));
  };
  const model::Scene scene = run == nullptr ? make() : NamingCauseInMap(map, *run, make);
  PreparedDepth prepared;
  prepared.depth = scene.depth;
  prepared.disparity = WithFileContext(NameOf(map), [&] {
    return WithoutHoles(
        estimator::DisparityOnGrid(grid, scene.depth_mm, map.width_px, map.height_px), image,
        estimator::DisparityAtInfinity(grid), &prepared);
  });
  return prepared;
}

}  // namespace

PreparedDepth PrepareDepth(const DepthMap& map, const model::LinearImage& image,
                           const Camera* camera, const model::LightFieldGrid* grid, RunScope* run) {
  if (map.width_px != image.width_px || map.height_px != image.height_px) {
    throw Error(fmt::format("{}: it is {}x{} px, the image is {}x{} px: the sizes must be equal",
                            NameOf(map), map.width_px, map.height_px, image.width_px,
                            image.height_px));
  }
  if (map.meaning.is_relative) {
    throw Error(fmt::format(
        "{}: the scale and the offset of a relative map are not known: an estimate finds them, and "
        "nothing else can use it",
        NameOf(map)));
  }
  model::DepthHoles found;
  const model::RawDepthMap raw = MarkedMap(map, run, &found);
  if (camera != nullptr) {
    PreparedDepth prepared = PrepareByCamera(map, raw, image, *camera, *grid, run);
    prepared.found_holes = found;
    return prepared;
  }
  if (map.meaning.kind != DepthKind::kDisparity) {
    throw OptionError("depth.meaning.kind",
                      fmt::format("depth.meaning.kind: {} needs a camera; without a camera only a "
                                  "disparity map can be used",
                                  map.meaning.kind == DepthKind::kRange     ? "range"
                                  : map.meaning.kind == DepthKind::kInverse ? "inverse"
                                                                            : "z"));
  }
  PreparedDepth prepared;
  prepared.found_holes = found;
  prepared.disparity = WithFileContext(NameOf(map), [&] {
    return WithoutHoles(estimator::DisparityFromMap(raw, map.meaning.disparity_scale,
                                                    map.meaning.disparity_offset_px),
                        image, -std::numeric_limits<double>::infinity(), &prepared);
  });
  return prepared;
}

}  // namespace thicklens
