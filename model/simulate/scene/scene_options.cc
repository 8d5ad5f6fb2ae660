// Valid options of a simulated scene.
#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "model/simulate/scene/scene_geometry.h"
#include "model/simulate/simulated_camera.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

constexpr int kMaxViews = 99;

std::string TextureComplaint(const TextureOptions& texture) {
  if (!(texture.colour.array() >= 0).all() || !(texture.colour.array() <= 1).all()) {
    return fmt::format("texture.colour is [{}, {}, {}]: each must be from 0 to 1",
                       texture.colour.x(), texture.colour.y(), texture.colour.z());
  }
  if (!(texture.contrast > 0 && texture.contrast <= 1)) {
    return fmt::format("texture.contrast is {}: it must be above 0 and at most 1",
                       texture.contrast);
  }
  if (!(texture.saturation >= 0 && texture.saturation <= 1)) {
    return fmt::format("texture.saturation is {}: it must be from 0 to 1", texture.saturation);
  }
  if (!(texture.feature_size_px >= 0) || !std::isfinite(texture.feature_size_px)) {
    return fmt::format(
        "texture.feature_size_px is {}: it must be > 0, or 0 for a size chosen by the program",
        texture.feature_size_px);
  }
  if (!std::isfinite(texture.angle_deg)) {
    return fmt::format("texture.angle_deg is {}: it must be finite", texture.angle_deg);
  }
  return "";
}

std::string OutlineComplaint(const OutlineOptions& outline) {
  using Shape = OutlineOptions::Shape;
  if (outline.shape == Shape::kMask && outline.unit != OutlineOptions::Unit::kPx) {
    return "outline: a mask is given in mm: it must be in px, because it covers the pixels of the "
           "image";
  }
  if (!outline.centre.allFinite()) {
    return fmt::format("outline: its centre is [{}, {}]: it must be finite", outline.centre.x(),
                       outline.centre.y());
  }
  if (outline.shape == Shape::kRectangle &&
      (!(outline.size.array() > 0).all() || !outline.size.allFinite())) {
    return fmt::format("outline: its size is [{}, {}]: both must be finite and > 0",
                       outline.size.x(), outline.size.y());
  }
  if (outline.shape == Shape::kDisc && (!(outline.radius > 0) || !std::isfinite(outline.radius))) {
    return fmt::format("outline: its radius is {}: it must be finite and > 0", outline.radius);
  }
  return "";
}

std::string GlossComplaint(const GlossOptions& gloss) {
  if (!(gloss.depth_mm > 0) || !std::isfinite(gloss.depth_mm)) {
    return fmt::format("gloss: depth_mm is {}: it must be finite and > 0", gloss.depth_mm);
  }
  if (!gloss.centre_px.allFinite()) {
    return fmt::format("gloss: centre_px is [{}, {}]: it must be finite", gloss.centre_px.x(),
                       gloss.centre_px.y());
  }
  if (!(gloss.sigma_px > 0) || !std::isfinite(gloss.sigma_px)) {
    return fmt::format("gloss: sigma_px is {}: it must be finite and > 0", gloss.sigma_px);
  }
  if (!(gloss.strength >= 0) || !std::isfinite(gloss.strength)) {
    return fmt::format("gloss: strength is {}: it must be finite and >= 0", gloss.strength);
  }
  return "";
}

std::string DepthComplaint(const SceneLayer& layer) {
  if (layer.depth->convention.kind == DepthKind::kDisparity) {
    return "depth.kind is disparity: it must be z or range";
  }
  if (layer.depth->convention.kind == DepthKind::kInverse) {
    return "depth.kind is inverse: it must be z or range";
  }
  if (layer.outline.shape != OutlineOptions::Shape::kWhole) {
    return "outline: it is given for a layer with a depth map, which covers the whole image and "
           "must not have an outline";
  }
  return "";
}

std::string PlaneComplaint(const SceneLayer& layer) {
  if (!(layer.plane.depth_mm > 0) || !std::isfinite(layer.plane.depth_mm)) {
    return fmt::format("plane.depth_mm is {}: it must be finite and > 0", layer.plane.depth_mm);
  }
  if (!layer.plane.slope.allFinite()) {
    return fmt::format("plane.slope is [{}, {}]: it must be finite", layer.plane.slope.x(),
                       layer.plane.slope.y());
  }
  return "";
}

std::string LayerComplaint(const SceneLayer& layer) {
  const std::string surface = layer.depth ? DepthComplaint(layer) : PlaneComplaint(layer);
  if (!surface.empty()) return surface;
  for (const GlossOptions& gloss : layer.gloss) {
    const std::string complaint = GlossComplaint(gloss);
    if (!complaint.empty()) return complaint;
  }
  const std::string outline = OutlineComplaint(layer.outline);
  return outline.empty() ? TextureComplaint(layer.texture) : outline;
}

}  // namespace

std::string TextureKindName(TextureKind kind) {
  switch (kind) {
    case TextureKind::kUniform:
      return "uniform";
    case TextureKind::kSine:
      return "sine";
    case TextureKind::kEdge:
      return "edge";
    case TextureKind::kCheckerboard:
      return "checkerboard";
    case TextureKind::kSiemensStar:
      return "siemens-star";
    case TextureKind::kDeadLeaves:
      return "dead-leaves";
    case TextureKind::kNoise:
      return "noise";
    case TextureKind::kImage:
      return "image";
  }
  throw Error("no such kind of texture");
}

EffectSet ImageEffects() {
  return {Effect::kThickness, Effect::kDefocus,   Effect::kApertureShape, Effect::kFalloff,
          Effect::kOcclusion, Effect::kPixelBox,  Effect::kLensFloor,     Effect::kDiffraction,
          Effect::kShotNoise, Effect::kReadNoise, Effect::kQuantisation,  Effect::kTransferCurve};
}

bool SceneSimulationOptions::IsValid(std::string* why) const {
  if (!IsSimulatable(camera, why)) return false;
  bool has_whole_layer = false;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::string complaint = LayerComplaint(layers[i]);
    if (!complaint.empty()) return Fail(why, LayerPlace(i, layers[i]) + ": " + complaint);
    has_whole_layer |= layers[i].outline.shape == OutlineOptions::Shape::kWhole;
  }
  if (!has_whole_layer) {
    return Fail(why,
                fmt::format("layers: none of the {} is without an outline: at least one such layer "
                            "is needed as a background, so that every pixel sees a surface",
                            layers.size()));
  }
  if (!(rays_per_pixel >= 16 && rays_per_pixel <= 100000)) {
    return Fail(why,
                fmt::format("rays_per_pixel is {}: it must be from 16 to 100000", rays_per_pixel));
  }
  const std::pair<const char*, double> amounts[] = {
      {"noise_sigma_grey_levels", noise_sigma_grey_levels},
      {"sampling_error_grey_levels", sampling_error_grey_levels},
      {"full_well_electrons", full_well_electrons},
      {"read_noise_electrons", read_noise_electrons}};
  for (const auto& [field, value] : amounts) {
    if (!(value >= 0) || !std::isfinite(value)) {
      return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, value));
    }
  }
  if (read_noise_electrons > 0 && !(full_well_electrons > 0)) {
    return Fail(why, fmt::format("read_noise_electrons is {}: noise in electrons needs "
                                 "full_well_electrons > 0",
                                 read_noise_electrons));
  }
  if (!(wavelength_mm > 0) || !std::isfinite(wavelength_mm)) {
    return Fail(why, fmt::format("wavelength_mm is {}: it must be finite and > 0", wavelength_mm));
  }
  if (bits != 8 && bits != 16) {
    return Fail(why, fmt::format("bits is {}: it must be 8 or 16", bits));
  }
  if (!(u_count >= 1 && u_count <= kMaxViews && v_count >= 1 && v_count <= kMaxViews)) {
    return Fail(why, fmt::format("views is {}x{}: both counts must be from 1 to {}", u_count,
                                 v_count, kMaxViews));
  }
  if (!std::isfinite(uv_depth_mm)) {
    return Fail(why, fmt::format("uv_depth_mm is {}: it must be finite", uv_depth_mm));
  }
  return true;
}

}  // namespace thicklens::model
