#include "thicklens/model/scene_simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>

#include "random_draws.h"
#include "ray_irradiance.h"
#include "ray_set.h"
#include "scene_texture.h"
#include "thicklens/error.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/parallel.h"

namespace thicklens::model {
namespace {

// No ray of a picture or a view goes farther from the middle of the aperture or of its pixel, in
// standard deviations: what a plane must stand.
constexpr double kFarthestDeviations = 6;
// What a texture's tile must hold; beyond it repeats itself.
constexpr double kTextureDeviations = 4;
// Smallest side of a texture's tile: below it nothing could be drawn.
constexpr double kSmallestTilePx = 16;
constexpr int kMaxViews = 99;

bool Fail(std::string* why, const std::string& message) {
  if (why != nullptr) *why = message;
  return false;
}

std::string LayerPlace(std::size_t index, const SceneLayer& layer) {
  return layer.name.empty() ? fmt::format("layers[{}]", index)
                            : fmt::format("layers[{}] '{}'", index, layer.name);
}

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
    return fmt::format("texture.feature_size_px is {}: it must be > 0, or 0 to have it chosen",
                       texture.feature_size_px);
  }
  if (!std::isfinite(texture.angle_deg)) {
    return fmt::format("texture.angle_deg is {}: it must be finite", texture.angle_deg);
  }
  return "";
}

std::string OutlineComplaint(const OutlineOptions& outline) {
  using Shape = OutlineOptions::Shape;
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

std::string LayerComplaint(const SceneLayer& layer) {
  if (!(layer.plane.depth_mm > 0) || !std::isfinite(layer.plane.depth_mm)) {
    return fmt::format("plane.depth_mm is {}: it must be finite and > 0", layer.plane.depth_mm);
  }
  if (!layer.plane.slope.allFinite()) {
    return fmt::format("plane.slope is [{}, {}]: it must be finite", layer.plane.slope.x(),
                       layer.plane.slope.y());
  }
  for (const GlossOptions& gloss : layer.gloss) {
    const std::string complaint = GlossComplaint(gloss);
    if (!complaint.empty()) return complaint;
  }
  const std::string outline = OutlineComplaint(layer.outline);
  return outline.empty() ? TextureComplaint(layer.texture) : outline;
}

bool IsValidTruth(const Camera& camera, std::string* why) {
  std::string inner;
  if (!camera.IsValid(&inner)) return Fail(why, "camera: " + inner);
  const auto missing = [&](const char* field) {
    return Fail(why, fmt::format("camera '{}': {} is missing: a simulation needs it as the truth",
                                 camera.name, field));
  };
  if (!camera.calibration || !camera.calibration->image_distance_mm)
    return missing("image_distance_mm");
  if (!camera.calibration->blur_ratio) return missing("blur_ratio");
  if (!std::isfinite(camera.focus_depth_mm())) {
    return Fail(why, fmt::format("camera '{}' is focused at infinity: a scene needs a finite plane "
                                 "of focus, because the samples of its views lie there",
                                 camera.name));
  }
  return true;
}

struct SceneRay {
  Eigen::Vector2d aperture_mm;
  Eigen::Vector2d slope;  // mm to the right and down per mm of depth

  Eigen::Vector2d PositionMm(double depth_mm) const { return aperture_mm + depth_mm * slope; }
};

// z of the ray with z = z0 + g . (A + slope z), derived here: (z0 + g . A)/(1 - g . slope). A plane
// that has passed CheckPlane is met by every ray.
double HitDepthMm(const PlaneOptions& plane, const SceneRay& ray) {
  return (plane.depth_mm + plane.slope.dot(ray.aperture_mm)) / (1 - plane.slope.dot(ray.slope));
}

struct Hit {
  std::size_t layer = 0;
  double depth_mm = std::numeric_limits<double>::infinity();
  Eigen::Vector2d position_mm{0, 0};
};

}  // namespace

std::string TextureKindName(TextureKind kind) {
  switch (kind) {
    case TextureKind::kUniform:
      return "uniform";
    case TextureKind::kSine:
      return "sine";
    case TextureKind::kCheckerboard:
      return "checkerboard";
    case TextureKind::kDeadLeaves:
      return "dead-leaves";
    case TextureKind::kNoise:
      return "noise";
    case TextureKind::kPicture:
      return "picture";
  }
  throw Error("no such kind of texture");
}

bool SceneSimulationOptions::IsValid(std::string* why) const {
  if (!IsValidTruth(camera, why)) return false;
  bool has_whole_layer = false;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::string complaint = LayerComplaint(layers[i]);
    if (!complaint.empty()) return Fail(why, LayerPlace(i, layers[i]) + ": " + complaint);
    has_whole_layer |= layers[i].outline.shape == OutlineOptions::Shape::kWhole;
  }
  if (!has_whole_layer) {
    return Fail(why, fmt::format("layers: none of {} is without an outline: every pixel must see "
                                 "something, so a background is needed",
                                 layers.size()));
  }
  if (!(rays_per_pixel >= 16 && rays_per_pixel <= 100000)) {
    return Fail(why,
                fmt::format("rays_per_pixel is {}: it must be from 16 to 100000", rays_per_pixel));
  }
  if (!(noise_sigma_grey_levels >= 0) || !std::isfinite(noise_sigma_grey_levels)) {
    return Fail(why, fmt::format("noise_sigma_grey_levels is {}: it must be finite and >= 0",
                                 noise_sigma_grey_levels));
  }
  if (bits != 8 && bits != 16) {
    return Fail(why, fmt::format("bits is {}: it must be 8 or 16", bits));
  }
  if (!(u_count >= 1 && u_count <= kMaxViews && v_count >= 1 && v_count <= kMaxViews)) {
    return Fail(why, fmt::format("views is {}x{}: both counts must be from 1 to {}", u_count,
                                 v_count, kMaxViews));
  }
  return true;
}

struct SceneSimulator::Impl {
  Impl(const SceneSimulationOptions& given, const std::vector<LinearPicture>& pictures)
      : options(given), sensor(options.camera.sensor) {
    std::string why;
    if (!options.IsValid(&why)) throw Error(why);
    const Camera& camera = options.camera;
    scale_px = camera.focal_scale_px();
    focus_depth_mm = camera.focus_depth_mm();
    aperture_sigma_mm = camera.blur_ratio() * camera.lens.aperture_radius_mm;
    if (camera.calibration->blur_floor_px) floor_px = camera.calibration->blur_floor_px->value;
    photograph_rays = PhotographRays(camera.psf, floor_px, options.rays_per_pixel);
    view_rays = ViewRays(floor_px);
    MakeTextures(pictures);
    MakeExposure();
  }

  // x of a picture position, px; A on the aperture, mm. The slope (x - cx) p/K of the chief ray
  // less A/zf: all rays of a position meet in the plane of focus.
  SceneRay RayAt(const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm) const {
    return {aperture_mm,
            (position_px - sensor.principal_point_px) / scale_px - aperture_mm / focus_depth_mm};
  }

  // Where the picture shows what a point's chief ray meets.
  Eigen::Vector2d ChiefPositionPx(const Eigen::Vector2d& point_mm, double depth_mm) const {
    return sensor.principal_point_px + scale_px / depth_mm * point_mm;
  }

  bool IsInside(const OutlineOptions& outline, const Eigen::Vector2d& point_mm,
                double depth_mm) const {
    using Shape = OutlineOptions::Shape;
    if (outline.shape == Shape::kWhole) return true;
    const Eigen::Vector2d from_centre =
        (outline.unit == OutlineOptions::Unit::kPx ? ChiefPositionPx(point_mm, depth_mm)
                                                   : point_mm) -
        outline.centre;
    if (outline.shape == Shape::kDisc)
      return from_centre.squaredNorm() <= outline.radius * outline.radius;
    return (2 * from_centre.cwiseAbs().array() <= outline.size.array()).all();
  }

  // The nearest layer along the ray.
  Hit Trace(const SceneRay& ray) const {
    Hit nearest;
    for (std::size_t i = 0; i < options.layers.size(); ++i) {
      const SceneLayer& layer = options.layers[i];
      const double depth_mm = HitDepthMm(layer.plane, ray);
      if (!(depth_mm < nearest.depth_mm)) continue;
      const Eigen::Vector2d position_mm = ray.PositionMm(depth_mm);
      if (!IsInside(layer.outline, position_mm, depth_mm)) continue;
      nearest = {i, depth_mm, position_mm};
    }
    return nearest;
  }

  // RGB; the fourth number means nothing.
  Eigen::Array4d LightAlong(const SceneRay& ray) const {
    const Hit hit = Trace(ray);
    Eigen::Array4d light =
        textures[hit.layer].At(hit.position_mm.x(), hit.position_mm.y()).cast<double>();
    for (const GlossOptions& gloss : options.layers[hit.layer].gloss) {
      const Eigen::Vector2d from_centre_px =
          ChiefPositionPx(ray.PositionMm(gloss.depth_mm), gloss.depth_mm) - gloss.centre_px;
      light += gloss.strength *
               std::exp(-from_centre_px.squaredNorm() / (2 * gloss.sigma_px * gloss.sigma_px));
    }
    return light;
  }

  double RelativeIrradiance(const Eigen::Vector2d& position_px, const SceneRay& ray) const {
    return RayIrradiance(ray.slope,
                         sensor.pixel_pitch_mm * (position_px - sensor.principal_point_px),
                         ray.aperture_mm, options.camera.image_distance_mm());
  }

  // (12) fixes its constant k by exposure: uniform radiance 1 gives 1 at the principal point.
  void MakeExposure() {
    double sum = 0;
    for (const PixelRay& ray : photograph_rays) {
      const Eigen::Vector2d aperture_mm = aperture_sigma_mm * ray.aperture;
      sum += RelativeIrradiance(sensor.principal_point_px,
                                RayAt(sensor.principal_point_px, aperture_mm));
    }
    exposure = static_cast<double>(photograph_rays.size()) / sum;
  }

  Eigen::Array3d PhotographAt(int x, int y) const {
    Eigen::Array4d sum(0, 0, 0, 0);
    for (const PixelRay& sample : photograph_rays) {
      const Eigen::Vector2d position_px = Eigen::Vector2d(x, y) + sample.offset_px;
      const SceneRay ray = RayAt(position_px, aperture_sigma_mm * sample.aperture);
      const Eigen::Array4d light = LightAlong(ray);
      sum += options.falloff ? (exposure * RelativeIrradiance(position_px, ray) * light).eval()
                             : light;
    }
    return sum.head<3>() / static_cast<double>(photograph_rays.size());
  }

  Eigen::Array3d ViewAt(int x, int y, const Eigen::Vector2d& aperture_mm) const {
    Eigen::Array4d sum(0, 0, 0, 0);
    for (const PixelRay& sample : view_rays) {
      sum += LightAlong(RayAt(Eigen::Vector2d(x, y) + sample.offset_px, aperture_mm));
    }
    return sum.head<3>() / static_cast<double>(view_rays.size());
  }

  // Calls work(row) for every row, on the run's threads.
  static void ForRows(int count, const SceneRun& run, const std::function<void(int)>& work) {
    std::mutex mutex;
    int done = 0;
    ParallelFor(count, run.threads, [&](int row) {
      work(row);
      if (!run.progress) return;
      const std::lock_guard<std::mutex> lock(mutex);
      run.progress(++done, count);
    });
  }

  // A picture whose pixels are light(x, y).
  template <typename Light>
  LinearPicture Render(const SceneRun& run, const Light& light) const {
    LinearPicture picture{sensor.width_px, sensor.height_px, 3, {}};
    picture.values.resize(3 * static_cast<std::size_t>(sensor.width_px) *
                          static_cast<std::size_t>(sensor.height_px));
    ForRows(sensor.height_px, run, [&](int y) {
      float* value = picture.values.data() +
                     3 * static_cast<std::size_t>(y) * static_cast<std::size_t>(sensor.width_px);
      for (int x = 0; x < sensor.width_px; ++x) {
        const Eigen::Array3d rgb = light(x, y);
        for (int c = 0; c < 3; ++c) *value++ = static_cast<float>(rgb(c));
      }
    });
    return picture;
  }

  // The corners of the picture, `margin_px` beyond its outermost pixels.
  std::array<Eigen::Vector2d, 4> PictureCornersPx(double margin_px) const {
    const double low = -0.5 - margin_px;
    const Eigen::Vector2d high(sensor.width_px - 0.5 + margin_px,
                               sensor.height_px - 0.5 + margin_px);
    return {{{low, low}, {high.x(), low}, {low, high.y()}, {high.x(), high.y()}}};
  }

  // The rays through the picture's corners and the corners of a square of the aperture: where the
  // slopes and crossings of all rays between them have their bounds.
  std::vector<SceneRay> OutermostRays(double deviations) const {
    std::vector<SceneRay> rays;
    const double reach_mm = deviations * aperture_sigma_mm;
    for (const Eigen::Vector2d& position_px : PictureCornersPx(deviations * floor_px)) {
      for (const double x : {-reach_mm, reach_mm}) {
        for (const double y : {-reach_mm, reach_mm}) rays.push_back(RayAt(position_px, {x, y}));
      }
    }
    return rays;
  }

  // Throws unless every ray meets the plane beyond the front focal point: z > f1 as
  // z0 + g . A > f1 (1 - g . slope) > 0, which is linear in the ray, so that corners suffice.
  void CheckPlane(const std::string& place, const PlaneOptions& plane) const {
    const double focal_mm = options.camera.lens.front_focal_length_mm;
    for (const SceneRay& ray : OutermostRays(kFarthestDeviations)) {
      const double below = 1 - plane.slope.dot(ray.slope);
      const double above = plane.depth_mm + plane.slope.dot(ray.aperture_mm);
      if (below > 0 && above > focal_mm * below) continue;
      throw Error(fmt::format(
          "{}: its plane, depth_mm {} and slope [{}, {}], is not met by every ray of the picture "
          "farther than the lens's front focal length {} mm: less slope or more depth is needed",
          place, plane.depth_mm, plane.slope.x(), plane.slope.y(), focal_mm));
    }
  }

  // The largest px on the plane, mm: with X = z t along the chief ray of slope t, the step per px
  // is p/K times dX/dt = z 1 + z^2/z0 t g^T, whose norm is at most z + z^2/z0 |t| |g|.
  double CoarsestPixelMm(const PlaneOptions& plane) const {
    double largest_mm = 0;
    for (const Eigen::Vector2d& corner_px : PictureCornersPx(0)) {
      const SceneRay ray = RayAt(corner_px, {0, 0});
      const double depth_mm = HitDepthMm(plane, ray);
      const double stretch = 1 + depth_mm / plane.depth_mm * ray.slope.norm() * plane.slope.norm();
      largest_mm = std::max(largest_mm, depth_mm * stretch / scale_px);
    }
    return largest_mm;
  }

  // The outline's bounding box on the plane, mm; nothing if it is whole, or reaches so far beside
  // the picture that no chief ray meets the plane there.
  std::optional<std::pair<Eigen::Vector2d, Eigen::Vector2d>> OutlineBox(
      const SceneLayer& layer) const {
    const OutlineOptions& outline = layer.outline;
    if (outline.shape == OutlineOptions::Shape::kWhole) return std::nullopt;
    const Eigen::Vector2d half = outline.shape == OutlineOptions::Shape::kDisc
                                     ? Eigen::Vector2d(outline.radius, outline.radius)
                                     : Eigen::Vector2d(outline.size / 2);
    Eigen::Vector2d low = outline.centre - half;
    Eigen::Vector2d high = outline.centre + half;
    if (outline.unit == OutlineOptions::Unit::kMm) return std::make_pair(low, high);
    const std::array<Eigen::Vector2d, 4> corners_px = {
        {low, {high.x(), low.y()}, {low.x(), high.y()}, high}};
    low.setConstant(std::numeric_limits<double>::infinity());
    high = -low;
    for (const Eigen::Vector2d& corner_px : corners_px) {
      const SceneRay ray = RayAt(corner_px, {0, 0});
      if (!(layer.plane.slope.dot(ray.slope) < 1)) return std::nullopt;
      const Eigen::Vector2d at_mm = ray.PositionMm(HitDepthMm(layer.plane, ray));
      low = low.cwiseMin(at_mm);
      high = high.cwiseMax(at_mm);
    }
    return std::make_pair(low, high);
  }

  TextureRequest RequestFor(const SceneLayer& layer) const {
    TextureRequest request;
    request.pixel_mm = layer.plane.depth_mm / scale_px;
    request.coarsest_pixel_mm = CoarsestPixelMm(layer.plane);
    request.low_mm.setConstant(std::numeric_limits<double>::infinity());
    request.high_mm = -request.low_mm;
    for (const SceneRay& ray : OutermostRays(kTextureDeviations)) {
      const Eigen::Vector2d at_mm = ray.PositionMm(HitDepthMm(layer.plane, ray));
      request.low_mm = request.low_mm.cwiseMin(at_mm);
      request.high_mm = request.high_mm.cwiseMax(at_mm);
    }
    request.centre_mm = (request.low_mm + request.high_mm) / 2;
    if (const auto box = OutlineBox(layer)) {
      request.centre_mm = (box->first + box->second) / 2;
      request.low_mm = request.low_mm.cwiseMax(box->first);
      request.high_mm = request.high_mm.cwiseMin(box->second);
    }
    const Eigen::Vector2d middle_mm = (request.low_mm + request.high_mm) / 2;
    const Eigen::Vector2d half_mm =
        ((request.high_mm - request.low_mm) / 2).cwiseMax(kSmallestTilePx / 2 * request.pixel_mm);
    request.low_mm = middle_mm - half_mm;
    request.high_mm = middle_mm + half_mm;
    return request;
  }

  void MakeTextures(const std::vector<LinearPicture>& pictures) {
    const LinearPicture none;
    for (std::size_t i = 0; i < options.layers.size(); ++i) {
      const SceneLayer& layer = options.layers[i];
      const std::string place = LayerPlace(i, layer);
      CheckPlane(place, layer.plane);
      RandomDraws draws(options.seed, RandomDraws::Purpose::kTexture,
                        static_cast<std::uint32_t>(i));
      try {
        textures.emplace_back(layer.texture, RequestFor(layer),
                              i < pictures.size() ? pictures[i] : none, &draws);
      } catch (const Error& error) {
        throw Error(place + ": " + error.what());
      }
    }
  }

  SceneSimulationOptions options;
  Sensor sensor;
  double scale_px = 0;  // K/p
  double focus_depth_mm = 0;
  double aperture_sigma_mm = 0;  // kappa r
  double floor_px = 0;
  double exposure = 1;
  std::vector<PixelRay> photograph_rays, view_rays;
  std::vector<SceneTexture> textures;  // of the layers
};

SceneSimulator::SceneSimulator(const SceneSimulationOptions& options,
                               const std::vector<LinearPicture>& pictures)
    : impl_(std::make_unique<Impl>(options, pictures)) {}

SceneSimulator::~SceneSimulator() = default;

LinearPicture SceneSimulator::RenderNoiseless(const SceneRun& run) const {
  return impl_->Render(run, [this](int x, int y) { return impl_->PhotographAt(x, y); });
}

StoredPicture SceneSimulator::Store(const LinearPicture& noiseless) const {
  const SceneSimulationOptions& options = impl_->options;
  return ToStoredWithNoise(noiseless, options.camera.sensor.transfer, options.bits,
                           options.noise_sigma_grey_levels / 255, options.seed);
}

RawDepthMap SceneSimulator::RenderDepth() const {
  const Sensor& sensor = impl_->sensor;
  RawDepthMap map{sensor.width_px, sensor.height_px, {}, false};
  map.values.reserve(static_cast<std::size_t>(sensor.width_px) *
                     static_cast<std::size_t>(sensor.height_px));
  for (int y = 0; y < sensor.height_px; ++y) {
    for (int x = 0; x < sensor.width_px; ++x) {
      const Hit hit = impl_->Trace(impl_->RayAt(Eigen::Vector2d(x, y), {0, 0}));
      map.values.push_back(static_cast<float>(hit.depth_mm));
    }
  }
  return map;
}

SceneTruth SceneSimulator::Truth(const RawDepthMap& depth) const {
  const Camera& camera = impl_->options.camera;
  SceneTruth truth;
  truth.image_distance_mm = camera.image_distance_mm();
  truth.focus_depth_mm = camera.focus_depth_mm();
  truth.blur_ratio = camera.blur_ratio();
  truth.blur_floor_px = impl_->floor_px;
  truth.falloff = impl_->options.falloff;
  truth.seed = impl_->options.seed;
  const auto [nearest, farthest] = std::minmax_element(depth.values.begin(), depth.values.end());
  truth.nearest_depth_mm = static_cast<double>(*nearest);
  truth.farthest_depth_mm = static_cast<double>(*farthest);
  // r_defocus has its only minimum in the plane of focus: it is largest at one of the two ends.
  for (const double depth_mm : {truth.nearest_depth_mm, truth.farthest_depth_mm}) {
    const double radius_mm = BlurRadiusMm(camera.lens, truth.image_distance_mm, depth_mm);
    truth.largest_blur_sigma_px = std::max(
        truth.largest_blur_sigma_px, truth.blur_ratio * radius_mm / camera.sensor.pixel_pitch_mm);
  }
  return truth;
}

LinearPicture SceneSimulator::RenderView(const Eigen::Vector2d& aperture_mm,
                                         const SceneRun& run) const {
  const double reach_mm = kFarthestDeviations * impl_->aperture_sigma_mm;
  if (!(aperture_mm.cwiseAbs().array() <= reach_mm).all()) {
    throw Error(fmt::format("aperture position [{}, {}] mm: both must be from {} to {}",
                            aperture_mm.x(), aperture_mm.y(), -reach_mm, reach_mm));
  }
  return impl_->Render(run, [&](int x, int y) { return impl_->ViewAt(x, y, aperture_mm); });
}

LightField SceneSimulator::RenderLightField(int u_count, int v_count, const SceneRun& run) const {
  const Camera& camera = impl_->options.camera;
  const LightFieldGrid grid = DefaultGrid(camera, u_count, v_count);
  LightField light_field = MakeLightField(grid.s_count, grid.t_count, u_count, v_count, 3);
  light_field.weights = ApertureWeights(ApertureShapeOf(camera.psf), u_count, v_count);
  light_field.transfer = camera.sensor.transfer;
  light_field.grid = grid;
  light_field.camera = camera;
  light_field.origin.method = "simulated";
  // Sample (i, j) of the plane of focus lies on the ray of pixel (i, j), whatever the view: Q = 0.
  Impl::ForRows(u_count * v_count * grid.t_count, run, [&](int row) {
    const int y = row % grid.t_count;
    const int view = row / grid.t_count;
    const Ray ray = grid.RayAt(0, y, view % u_count, view / u_count);
    for (int x = 0; x < grid.s_count; ++x) {
      const Eigen::Array3d rgb = impl_->ViewAt(x, y, {ray.u_mm, ray.v_mm});
      for (int c = 0; c < 3; ++c) {
        light_field.values[light_field.ViewStart(c, view % u_count, view / u_count) +
                           static_cast<std::size_t>(y * grid.s_count + x)] =
            static_cast<float>(rgb(c));
      }
    }
  });
  return light_field;
}

}  // namespace thicklens::model
