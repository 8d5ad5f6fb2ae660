#include "model/simulate/scene/scene_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

// Maximum distance of a ray of an image or a view from the middle of the aperture and of its pixel,
// in standard deviations. CheckPlane tests all rays within it.
constexpr double kFarthestDeviations = 6;
// A texture's tile covers the rays within this distance and repeats itself beyond it.
constexpr double kTextureDeviations = 4;
// Smallest side of a texture's tile; a smaller tile could show nothing.
constexpr double kSmallestTilePx = 16;

}  // namespace

std::string LayerPlace(std::size_t index, const SceneLayer& layer) {
  return layer.name.empty() ? fmt::format("layers[{}]", index)
                            : fmt::format("layers[{}] '{}'", index, layer.name);
}

SceneGeometry::SceneGeometry(const SceneSimulationOptions& options,
                             const std::vector<LayerPixels>& pixels)
    : layers_(options.layers),
      sensor_(options.camera.sensor),
      focal_mm_(options.camera.lens.front_focal_length_mm),
      scale_px_(options.camera.focal_scale_px()),
      focus_depth_mm_(options.camera.focus_depth_mm()),
      aperture_sigma_mm_(options.camera.blur_ratio() * options.camera.lens.aperture_radius_mm) {
  const auto& floor = options.camera.calibration->blur_floor_px;
  if (floor) floor_px_ = floor->value;
  masks_.resize(layers_.size());
  heights_.resize(layers_.size());
  const LayerPixels none;
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    AddPixels(options.camera, i, i < pixels.size() ? pixels[i] : none);
  }
}

void SceneGeometry::AddPixels(const Camera& camera, std::size_t index, const LayerPixels& pixels) {
  const SceneLayer& layer = layers_[index];
  const std::string place = LayerPlace(index, layer);
  if (layer.outline.shape == OutlineOptions::Shape::kMask) {
    masks_[index].emplace(pixels.mask, sensor_.width_px, sensor_.height_px,
                          fmt::format("{}: outline.mask '{}'", place, layer.outline.mask_path));
  }
  if (!layer.depth) return;
  const std::string name = fmt::format("{}: depth.map '{}'", place, layer.depth->map_path);
  if (pixels.depth.values.empty()) throw Error(name + " is empty");
  LinearImage same_size{sensor_.width_px, sensor_.height_px, 1, {}};
  same_size.values.resize(static_cast<std::size_t>(sensor_.width_px) *
                          static_cast<std::size_t>(sensor_.height_px));
  const Scene scene =
      MakeScene(camera, std::move(same_size), pixels.depth, layer.depth->convention, name);
  if (scene.depth.holes > 0) {
    throw Error(fmt::format("{}: {} of its {} values are holes: a surface needs a depth everywhere",
                            name, scene.depth.holes, scene.depth_mm.size()));
  }
  heights_[index].emplace(sensor_.width_px, sensor_.height_px, scene.depth_mm, scale_px_,
                          focus_depth_mm_);
}

double SceneGeometry::DefocusPx(double depth_mm) const {
  return std::abs(aperture_sigma_mm_ * scale_px_ * (1 / depth_mm - 1 / focus_depth_mm_));
}

bool SceneGeometry::IsInside(std::size_t layer, const Eigen::Vector2d& point_mm,
                             double depth_mm) const {
  using Shape = OutlineOptions::Shape;
  const OutlineOptions& outline = layers_[layer].outline;
  if (outline.shape == Shape::kWhole) return true;
  if (outline.shape == Shape::kMask) {
    return masks_[layer]->IsInside(ChiefPositionPx(point_mm, depth_mm));
  }
  const Eigen::Vector2d from_centre =
      (outline.unit == OutlineOptions::Unit::kPx ? ChiefPositionPx(point_mm, depth_mm) : point_mm) -
      outline.centre;
  if (outline.shape == Shape::kDisc)
    return from_centre.squaredNorm() <= outline.radius * outline.radius;
  return (2 * from_centre.cwiseAbs().array() <= outline.size.array()).all();
}

SceneHit SceneGeometry::HitOn(std::size_t layer, const SceneRay& ray) const {
  if (!heights_[layer]) {
    const double depth_mm = HitDepthMm(layers_[layer].plane, ray);
    return {layer, depth_mm, ray.PositionMm(depth_mm)};
  }
  const HeightField& field = *heights_[layer];
  const Eigen::Vector2d position_px = PositionOf(ray);
  // A chief ray meets the point at its own position.
  if (ray.aperture_mm == Eigen::Vector2d(0, 0)) {
    return {layer, field.DepthMm(field.ShiftAt(position_px)), position_px};
  }
  const ValueRange shifts =
      field.IntersectionShiftBounds({position_px, position_px}, {ray.aperture_mm, ray.aperture_mm});
  const double shift =
      field.FirstIntersection(position_px, ray.aperture_mm, shifts.high, shifts.low);
  return {layer, field.DepthMm(shift), position_px + shift * ray.aperture_mm};
}

void SceneGeometry::Consider(const SceneRay& ray, std::size_t layer, SceneHit* nearest) const {
  if (heights_[layer]) {
    const SceneHit hit = HitOn(layer, ray);
    if (hit.depth_mm < nearest->depth_mm) *nearest = hit;
    return;
  }
  const double depth_mm = HitDepthMm(layers_[layer].plane, ray);
  if (!(depth_mm < nearest->depth_mm)) return;
  const Eigen::Vector2d position_mm = ray.PositionMm(depth_mm);
  if (IsInside(layer, position_mm, depth_mm)) {
    *nearest = {layer, depth_mm, position_mm};
  }
}

SceneHit SceneGeometry::Trace(const SceneRay& ray) const {
  SceneHit nearest;
  for (std::size_t i = 0; i < layers_.size(); ++i) Consider(ray, i, &nearest);
  return nearest;
}

SceneHit SceneGeometry::Trace(const SceneRay& ray, const std::vector<std::size_t>& layers) const {
  SceneHit nearest;
  for (const std::size_t i : layers) Consider(ray, i, &nearest);
  return nearest;
}

// The points that chief rays meet of a convex region form a convex set, and so do outlines except
// masks. Corners therefore suffice.
bool SceneGeometry::Covers(std::size_t index, const ImageRegion& region) const {
  const SceneLayer& layer = layers_[index];
  if (layer.outline.shape == OutlineOptions::Shape::kWhole) return true;
  const bool is_mask = layer.outline.shape == OutlineOptions::Shape::kMask;
  if (is_mask && !masks_[index]->Covers(region)) return false;
  for (const Eigen::Vector2d& corner_px : region.Corners()) {
    const SceneRay ray = RayAt(corner_px, {0, 0});
    if (!(layer.plane.slope.dot(ray.slope) < 1)) return false;
    const double depth_mm = HitDepthMm(layer.plane, ray);
    if (!is_mask && !IsInside(index, ray.PositionMm(depth_mm), depth_mm)) return false;
  }
  return true;
}

bool SceneGeometry::MayTouch(std::size_t index, const ImageRegion& region) const {
  const SceneLayer& layer = layers_[index];
  const OutlineOptions& outline = layer.outline;
  if (outline.shape == OutlineOptions::Shape::kWhole) return true;
  if (outline.shape == OutlineOptions::Shape::kMask) return masks_[index]->MayTouch(region);
  BoxMm box{region.low_px, region.high_px};  // in the outline's unit
  if (outline.unit == OutlineOptions::Unit::kMm) {
    const auto on_plane = BoxOf(layer.plane, region);
    if (!on_plane) return true;
    box = *on_plane;
  }
  const Eigen::Vector2d nearest = outline.centre.cwiseMax(box.first).cwiseMin(box.second);
  const Eigen::Vector2d away = (nearest - outline.centre).cwiseAbs();
  if (outline.shape == OutlineOptions::Shape::kDisc) return away.norm() <= outline.radius;
  return (2 * away.array() <= outline.size.array()).all();
}

ImageRegion SceneGeometry::WholeImage() const {
  return {{-0.5, -0.5}, {sensor_.width_px - 0.5, sensor_.height_px - 0.5}};
}

// The rays through the corners of the image and the corners of a square of the aperture. The slopes
// and crossings of all rays between them have their extremes there.
std::vector<SceneRay> SceneGeometry::OutermostRays(double deviations) const {
  std::vector<SceneRay> rays;
  const double reach_mm = deviations * aperture_sigma_mm_;
  for (const Eigen::Vector2d& position_px :
       WholeImage().Widened(deviations * floor_px_).Corners()) {
    for (const double x : {-reach_mm, reach_mm}) {
      for (const double y : {-reach_mm, reach_mm}) rays.push_back(RayAt(position_px, {x, y}));
    }
  }
  return rays;
}

// The image positions at which chief rays show the points of the plane that rays meet.
ImageRegion SceneGeometry::ChiefRegion(const PlaneOptions& plane) const {
  ImageRegion region = WholeImage();
  for (const SceneRay& ray : OutermostRays(kTextureDeviations)) {
    const double depth_mm = HitDepthMm(plane, ray);
    const Eigen::Vector2d at_px = ChiefPositionPx(ray.PositionMm(depth_mm), depth_mm);
    region.low_px = region.low_px.cwiseMin(at_px);
    region.high_px = region.high_px.cwiseMax(at_px);
  }
  return region;
}

// The condition z > f1 is z0 + g . A > f1 (1 - g . slope) > 0, which is linear in the ray. Corners
// therefore suffice.
void SceneGeometry::CheckPlane(const std::string& place, const PlaneOptions& plane) const {
  for (const SceneRay& ray : OutermostRays(kFarthestDeviations)) {
    const double below = 1 - plane.slope.dot(ray.slope);
    const double above = plane.depth_mm + plane.slope.dot(ray.aperture_mm);
    if (below > 0 && above > focal_mm_ * below) continue;
    throw Error(fmt::format(
        "{}: some rays of the image do not meet its plane, depth_mm {} and slope [{}, {}], "
        "beyond the lens's front focal length {} mm: a smaller slope or a larger depth is needed",
        place, plane.depth_mm, plane.slope.x(), plane.slope.y(), focal_mm_));
  }
}

// [D40] The largest px on the plane, mm. With X = z t along the chief ray of slope t, the step per
// px is p/K times dX/dt = z 1 + z^2/z0 t g^T, whose norm is at most z + z^2/z0 |t| |g|.
double SceneGeometry::CoarsestPixelMm(const PlaneOptions& plane) const {
  double largest_mm = 0;
  for (const Eigen::Vector2d& corner_px : WholeImage().Corners()) {
    const SceneRay ray = RayAt(corner_px, {0, 0});
    const double depth_mm = HitDepthMm(plane, ray);
    const double stretch = 1 + depth_mm / plane.depth_mm * ray.slope.norm() * plane.slope.norm();
    largest_mm = std::max(largest_mm, depth_mm * stretch / scale_px_);
  }
  return largest_mm;
}

// Bounding box of the points that chief rays through the region meet; nothing if the ray of a
// corner misses the plane.
std::optional<SceneGeometry::BoxMm> SceneGeometry::BoxOf(const PlaneOptions& plane,
                                                         const ImageRegion& region) const {
  BoxMm box;
  box.first.setConstant(std::numeric_limits<double>::infinity());
  box.second = -box.first;
  for (const Eigen::Vector2d& corner_px : region.Corners()) {
    const SceneRay ray = RayAt(corner_px, {0, 0});
    if (!(plane.slope.dot(ray.slope) < 1)) return std::nullopt;
    const Eigen::Vector2d at_mm = ray.PositionMm(HitDepthMm(plane, ray));
    box.first = box.first.cwiseMin(at_mm);
    box.second = box.second.cwiseMax(at_mm);
  }
  return box;
}

// The outline's bounding box on the plane. The result is nothing if the outline is whole, or
// extends so far beside the image that no chief ray meets the plane there.
std::optional<SceneGeometry::BoxMm> SceneGeometry::OutlineBox(std::size_t index) const {
  const SceneLayer& layer = layers_[index];
  const OutlineOptions& outline = layer.outline;
  if (outline.shape == OutlineOptions::Shape::kWhole) return std::nullopt;
  if (outline.shape == OutlineOptions::Shape::kMask) {
    const ImageRegion met = ChiefRegion(layer.plane);  // an extent may be infinite
    const ImageRegion& extent = masks_[index]->extent();
    return BoxOf(layer.plane,
                 {extent.low_px.cwiseMax(met.low_px), extent.high_px.cwiseMin(met.high_px)});
  }
  const Eigen::Vector2d half = outline.shape == OutlineOptions::Shape::kDisc
                                   ? Eigen::Vector2d(outline.radius, outline.radius)
                                   : Eigen::Vector2d(outline.size / 2);
  const BoxMm box{outline.centre - half, outline.centre + half};
  if (outline.unit == OutlineOptions::Unit::kMm) return box;
  return BoxOf(layer.plane, {box.first, box.second});
}

TextureRequest SceneGeometry::RequestFor(std::size_t index) const {
  const SceneLayer& layer = layers_[index];
  TextureRequest request;
  if (layer.depth) {
    const ImageRegion image = WholeImage();
    request.pixel_mm = request.coarsest_pixel_mm = 1;
    request.low_mm = image.low_px;
    request.high_mm = image.high_px;
    request.centre_mm = (image.low_px + image.high_px) / 2;
  } else {
    request.pixel_mm = layer.plane.depth_mm / scale_px_;
    request.coarsest_pixel_mm = CoarsestPixelMm(layer.plane);
    request.low_mm.setConstant(std::numeric_limits<double>::infinity());
    request.high_mm = -request.low_mm;
    for (const SceneRay& ray : OutermostRays(kTextureDeviations)) {
      const Eigen::Vector2d at_mm = ray.PositionMm(HitDepthMm(layer.plane, ray));
      request.low_mm = request.low_mm.cwiseMin(at_mm);
      request.high_mm = request.high_mm.cwiseMax(at_mm);
    }
    request.centre_mm = (request.low_mm + request.high_mm) / 2;
    if (const auto box = OutlineBox(index)) {
      request.centre_mm = (box->first + box->second) / 2;
      request.low_mm = request.low_mm.cwiseMax(box->first);
      request.high_mm = request.high_mm.cwiseMin(box->second);
    }
  }
  const Eigen::Vector2d middle_mm = (request.low_mm + request.high_mm) / 2;
  const Eigen::Vector2d half_mm =
      ((request.high_mm - request.low_mm) / 2).cwiseMax(kSmallestTilePx / 2 * request.pixel_mm);
  request.low_mm = middle_mm - half_mm;
  request.high_mm = middle_mm + half_mm;
  return request;
}

}  // namespace thicklens::model
