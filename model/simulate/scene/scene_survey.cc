#include "model/simulate/scene/scene_survey.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/optics/ray_irradiance.h"
#include "model/simulate/scene/ray_set.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"

namespace thicklens::model {
namespace {

// Maximum distance of a ray of a photograph from the middle of the aperture, in standard
// deviations.
constexpr double kReachDeviations = kGaussianDeviations;
// Factor that widens a reach because the depth changes along the way.
constexpr double kReachMargin = 1.1;
// Maximum number of blocks around the image that are included because blur mixes in their light.
constexpr int kMaxMargin = 16;
// Number of samples of a pixel on each axis, and factors that compensate for the missed maxima of
// slope and bend between them.
constexpr int kSamples = 2;
constexpr float kMissedSlope = 1.35F;
constexpr float kMissedNonlinearity = 1.5F;

constexpr int kBlockSamples = SceneSurvey::kBlockPx * kSamples;

// Extremes of one layer in one block.
struct Detail {
  Eigen::Array4f dark = Eigen::Array4f::Constant(std::numeric_limits<float>::infinity());
  Eigen::Array4f bright = -dark;
  Eigen::Array4f slope = Eigen::Array4f::Zero();
  Eigen::Array4f bend = Eigen::Array4f::Zero();

  void Add(const Detail& other) {
    dark = dark.min(other.dark);
    bright = bright.max(other.bright);
    slope = slope.max(other.slope);
    bend = bend.max(other.bend);
  }
};

// The blocks of the image and of a margin around it.
struct BlockGrid {
  int columns = 0, rows = 0, margin = 0;

  ImageRegion RegionOf(int column, int row) const {
    constexpr int kPx = SceneSurvey::kBlockPx;
    const Eigen::Vector2d low(column * kPx - 0.5, row * kPx - 0.5);
    return {low, low.array() + kPx};
  }
  std::size_t count() const {
    return static_cast<std::size_t>(columns + 2 * margin) *
           static_cast<std::size_t>(rows + 2 * margin);
  }
  std::size_t IndexOf(int column, int row) const {
    return static_cast<std::size_t>(row + margin) * static_cast<std::size_t>(columns + 2 * margin) +
           static_cast<std::size_t>(column + margin);
  }
};

// The detail that chief rays see of a layer in each block, without its outline.
class LayerDetail {
 public:
  LayerDetail(const SceneGeometry& geometry, const SceneTexture& texture, std::size_t layer,
              const BlockGrid& grid, int threads)
      : geometry_(geometry), texture_(texture), layer_(layer), grid_(grid), details_(grid.count()) {
    const int samples = kBlockSamples * (grid.columns + 2 * grid.margin) + 2;
    ParallelFor(grid.rows + 2 * grid.margin, threads,
                [&](int i) { LookAtRow(i - grid.margin, samples); });
    anything_.dark = texture.Darkest();
    anything_.bright = texture.Brightest();
    for (const Detail& detail : details_) anything_.Add(detail);
  }

  // The detail of all blocks within a distance of one block. Beyond the surveyed blocks, any value
  // of the texture and the steepest surveyed slope are assumed.
  Detail Around(int column, int row, double distance_px) const {
    const int reach = static_cast<int>(std::ceil(distance_px / SceneSurvey::kBlockPx));
    if (reach > kMaxMargin) return anything_;
    Detail found;
    for (int j = std::max(row - reach, -grid_.margin);
         j <= std::min(row + reach, grid_.rows + grid_.margin - 1); ++j) {
      for (int i = std::max(column - reach, -grid_.margin);
           i <= std::min(column + reach, grid_.columns + grid_.margin - 1); ++i) {
        found.Add(details_[grid_.IndexOf(i, j)]);
      }
    }
    return found;
  }

 private:
  // Samples one row, from one sample before the first block on. A ray that meets nothing gives NaN.
  void Sample(int sample_row, std::vector<Eigen::Array4f>* lights) const {
    const double y_px = (sample_row + 0.5) / kSamples - 0.5;
    const int first = -kBlockSamples * grid_.margin - 1;
    for (std::size_t i = 0; i < lights->size(); ++i) {
      const double x_px = (first + static_cast<int>(i) + 0.5) / kSamples - 0.5;
      const SceneRay ray = geometry_.RayAt({x_px, y_px}, {0, 0});
      const PlaneOptions& plane = geometry_.layers()[layer_].plane;
      const bool is_plane = geometry_.height_field(layer_) == nullptr;
      if (is_plane && !(plane.slope.dot(ray.slope) < 1)) {
        (*lights)[i].setConstant(std::numeric_limits<float>::quiet_NaN());
        continue;
      }
      (*lights)[i] =
          LayerLight(geometry_, texture_, layer_, ray, geometry_.HitOn(layer_, ray).on_texture);
    }
  }

  void LookAtRow(int row, int samples) {
    std::vector<Eigen::Array4f> above(static_cast<std::size_t>(samples)), here = above,
                                                                          below = above;
    Sample(row * kBlockSamples - 1, &above);
    Sample(row * kBlockSamples, &here);
    for (int k = 0; k < kBlockSamples; ++k) {
      Sample(row * kBlockSamples + k + 1, &below);
      for (std::size_t i = 1; i + 1 < here.size(); ++i) {
        const int column = static_cast<int>(i - 1) / kBlockSamples - grid_.margin;
        const Eigen::Array4f right = here[i + 1] - here[i], left = here[i] - here[i - 1];
        const Eigen::Array4f down = below[i] - here[i], up = here[i] - above[i];
        Detail detail;
        if (!here[i].isFinite().all()) continue;
        detail.dark = detail.bright = here[i];
        if ((right + left + down + up).isFinite().all()) {
          detail.slope = kMissedSlope * kSamples * (right.square() + down.square()).sqrt();
          detail.bend = kMissedNonlinearity * kSamples * kSamples *
                        ((right - left).abs() + (down - up).abs());
        }
        details_[grid_.IndexOf(column, row)].Add(detail);
      }
      above.swap(here);
      here.swap(below);
    }
  }

  const SceneGeometry& geometry_;
  const SceneTexture& texture_;
  const std::size_t layer_;
  const BlockGrid& grid_;
  std::vector<Detail> details_;
  Detail anything_;
};

// The minimum and maximum 1/z of the layer over the region. For a plane 1/z is linear there.
std::pair<double, double> InverseDepths(const SceneGeometry& geometry, std::size_t layer,
                                        const ImageRegion& region) {
  if (const HeightField* field = geometry.height_field(layer)) {
    const ValueRange shifts = field->ShiftsOver(region);
    return {1 / field->DepthMm(shifts.low), 1 / field->DepthMm(shifts.high)};
  }
  const PlaneOptions& plane = geometry.layers()[layer].plane;
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const Eigen::Vector2d& corner_px : region.Corners()) {
    const double inverse =
        (1 - plane.slope.dot(geometry.RayAt(corner_px, {0, 0}).slope)) / plane.depth_mm;
    least = std::min(least, inverse);
    most = std::max(most, inverse);
  }
  return {least, most};
}

// The block's pixel that is farthest from the axis.
Eigen::Vector2d FarthestPx(const SceneBlock& block, const Eigen::Vector2d& axis_px) {
  const Eigen::Vector2d low_px(block.x0, block.y0), high_px(block.x1 - 1, block.y1 - 1);
  return ((axis_px - low_px).array().abs() > (high_px - axis_px).array().abs())
      .select(low_px, high_px);
}

// Minimum of the fall-off at a position, with or without thickness: that of the chief ray, with a
// margin for the other rays.
double LeastIrradiance(const Camera& camera, const Eigen::Vector2d& position_px) {
  constexpr double kOfOthers = 0.98;
  const Eigen::Vector2d from_axis_px = position_px - camera.sensor.principal_point_px;
  const auto at = [&](double image_distance_mm) {
    return RayIrradiance(from_axis_px / camera.focal_scale_px(),
                         camera.sensor.pixel_pitch_mm * from_axis_px, {0, 0}, image_distance_mm);
  };
  return kOfOthers * std::min(at(camera.image_distance_mm()),
                              at(camera.focal_scale_px() * camera.sensor.pixel_pitch_mm));
}

// Gloss moves relative to its layer from ray to ray. Wherever it may be visible, all of it is
// counted: its steepest slope s exp(-1/2)/sigma, and its sharpest bend 2 s/sigma^2, which is in its
// middle.
Detail GlossOf(const SceneLayer& layer) {
  Detail detail;
  detail.dark = detail.bright = Eigen::Array4f::Zero();
  for (const GlossOptions& gloss : layer.gloss) {
    detail.bright += static_cast<float>(gloss.strength);
    detail.slope += static_cast<float>(gloss.strength * std::exp(-0.5) / gloss.sigma_px);
    detail.bend += static_cast<float>(2 * gloss.strength / (gloss.sigma_px * gloss.sigma_px));
  }
  return detail;
}

// Rays through aperture positions up to a given distance see a height field in a region like chief
// rays, but compressed. Derived here [D42]: x' = x + A V(x'), so that dx'/dx is at most m = 1/(1 -
// a), a = |A| |grad V|, and its jumps from pixel to pixel are at most m^3 |A| jump(grad V). Returns
// false if a is too large for these bounds; the rays may then meet the field more than once.
bool Compress(const HeightField& field, const ImageRegion& region, double aperture_mm,
              Detail* detail) {
  constexpr double kSteepest = 0.3;
  const double steepness = aperture_mm * field.SteepestOver(region);
  if (!(steepness <= kSteepest)) return false;
  const auto most = static_cast<float>(1 / (1 - steepness));
  const auto jump = static_cast<float>(aperture_mm * field.SharpestOver(region));
  detail->bend = most * most * (detail->bend + 2 * most * jump * detail->slope);
  detail->slope *= most;
  return true;
}

// The depths from which blur spreads to a block.
class BlurDepths {
 public:
  BlurDepths(const SceneGeometry& geometry, double inverse_focus)
      : geometry_(geometry), inverse_focus_(inverse_focus) {}

  // Adds one object by its minimum and maximum 1/z.
  void Add(double least, double most) {
    const bool least_is_farther =
        std::abs(least - inverse_focus_) > std::abs(most - inverse_focus_);
    ends_.push_back(least_is_farther ? least : most);
    least_ = std::min(least_, least);
    most_ = std::max(most_, most);
  }

  double sigma_px() const { return geometry_.DefocusPx(1 / MostBlurred()); }
  void Fill(EffectSite* place) const {
    const double here = MostBlurred();
    place->depth_mm = 1 / here;
    place->sharpest_depth_mm = 1 / std::clamp(inverse_focus_, least_, most_);
    if (ends_.size() < 2) return;
    double there = here;
    for (const double end : ends_) {
      if (std::abs(end - here) >= std::abs(there - here)) there = end;
    }
    place->other_depth_mm = 1 / there;
  }

 private:
  double MostBlurred() const {
    double most_blurred = ends_.front();
    for (const double end : ends_) {
      if (std::abs(end - inverse_focus_) > std::abs(most_blurred - inverse_focus_)) {
        most_blurred = end;
      }
    }
    return most_blurred;
  }

  const SceneGeometry& geometry_;
  const double inverse_focus_;
  std::vector<double> ends_;
  double least_ = std::numeric_limits<double>::infinity(), most_ = -least_;
};

}  // namespace

Eigen::Array4f LayerLight(const SceneGeometry& geometry, const SceneTexture& texture,
                          std::size_t layer, const SceneRay& ray,
                          const Eigen::Vector2d& on_texture) {
  Eigen::Array4f light = texture.At(on_texture.x(), on_texture.y());
  for (const GlossOptions& gloss : geometry.layers()[layer].gloss) {
    const Eigen::Vector2d from_centre_px =
        geometry.ChiefPositionPx(ray.PositionMm(gloss.depth_mm), gloss.depth_mm) - gloss.centre_px;
    light += static_cast<float>(gloss.strength * std::exp(-from_centre_px.squaredNorm() /
                                                          (2 * gloss.sigma_px * gloss.sigma_px)));
  }
  return light;
}

double ReachPx(const SceneGeometry& geometry, std::size_t index, const ImageRegion& region,
               double landing_px, double deviations) {
  const SceneLayer& layer = geometry.layers()[index];
  const PlaneOptions& plane = layer.plane;
  double sigma_px = 0;
  for (const GlossOptions& gloss : layer.gloss) {
    sigma_px = std::max(sigma_px, geometry.DefocusPx(gloss.depth_mm));
  }
  if (const HeightField* field = geometry.height_field(index)) {
    const double aperture_mm = deviations * geometry.aperture_sigma_mm();
    const ApertureBox aperture = {Eigen::Vector2d::Constant(-aperture_mm),
                                  Eigen::Vector2d::Constant(aperture_mm)};
    const ValueRange met = field->IntersectionShiftBounds(region.Widened(landing_px), aperture);
    return landing_px + std::max(deviations * sigma_px,
                                 aperture_mm * std::max(std::abs(met.low), std::abs(met.high)));
  }
  for (const Eigen::Vector2d& corner_px : region.Corners()) {
    const SceneRay ray = geometry.RayAt(corner_px, {0, 0});
    if (plane.slope.dot(ray.slope) < 1) {
      sigma_px = std::max(sigma_px, geometry.DefocusPx(HitDepthMm(plane, ray)));
    }
  }
  return landing_px + kReachMargin * deviations * sigma_px;
}

std::vector<std::size_t> MetLayers(const SceneGeometry& geometry, const ImageRegion& region,
                                   double landing_px, double deviations) {
  struct Candidate {
    std::size_t layer;
    double least, most;  // of 1/z
    bool covers;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < geometry.layers().size(); ++i) {
    const ImageRegion reached =
        region.Widened(ReachPx(geometry, i, region, landing_px, deviations));
    if (!geometry.MayTouch(i, reached)) continue;
    const auto [least, most] = InverseDepths(geometry, i, reached);
    candidates.push_back({i, least, most, geometry.Covers(i, reached)});
  }
  double nearest_cover = -std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : candidates) {
    if (candidate.covers) nearest_cover = std::max(nearest_cover, candidate.least);
  }
  std::vector<std::size_t> met;
  for (const Candidate& candidate : candidates) {
    if (candidate.most >= nearest_cover) met.push_back(candidate.layer);
  }
  return met;
}

SceneSurvey::SceneSurvey(const Camera& camera, const SceneGeometry& geometry,
                         const std::vector<SceneTexture>& textures, double landing_px,
                         int threads) {
  const Sensor& sensor = geometry.sensor();
  columns_ = (sensor.width_px + kBlockPx - 1) / kBlockPx;
  rows_ = (sensor.height_px + kBlockPx - 1) / kBlockPx;
  BlockGrid grid{columns_, rows_, 0};
  std::vector<double> reaches;  // block by block, one per layer of the block
  for (int row = 0; row < rows_; ++row) {
    ThrowIfCancelled();
    for (int column = 0; column < columns_; ++column) {
      SceneBlock block;
      block.x0 = column * kBlockPx;
      block.y0 = row * kBlockPx;
      block.x1 = std::min(block.x0 + kBlockPx, sensor.width_px);
      block.y1 = std::min(block.y0 + kBlockPx, sensor.height_px);
      const ImageRegion region = grid.RegionOf(column, row);
      block.layers = MetLayers(geometry, region, landing_px, kReachDeviations);
      for (const std::size_t layer : block.layers) {
        reaches.push_back(ReachPx(geometry, layer, region, landing_px, kReachDeviations));
      }
      blocks_.push_back(std::move(block));
    }
  }
  if (!reaches.empty()) {
    const double farthest_px = *std::max_element(reaches.begin(), reaches.end());
    grid.margin = static_cast<int>(std::min<double>(std::ceil(farthest_px / kBlockPx), kMaxMargin));
  }
  std::vector<LayerDetail> details;
  for (std::size_t i = 0; i < textures.size(); ++i) {
    details.emplace_back(geometry, textures[i], i, grid, threads);
  }

  auto reach = reaches.begin();
  for (int row = 0; row < rows_; ++row) {
    ThrowIfCancelled();
    for (int column = 0; column < columns_; ++column) {
      SceneBlock& block = blocks_[static_cast<std::size_t>(row * columns_ + column)];
      Detail seen, gloss;
      gloss.dark = gloss.bright = Eigen::Array4f::Zero();
      BlurDepths depths(geometry, 1 / camera.focus_depth_mm());
      for (const std::size_t i : block.layers) {
        const SceneLayer& layer = geometry.layers()[i];
        const double reach_px = *reach++;
        Detail around = details[i].Around(column, row, reach_px);
        if (const HeightField* field = geometry.height_field(i)) {
          const ImageRegion reached = grid.RegionOf(column, row).Widened(reach_px);
          const auto [least, most] = InverseDepths(geometry, i, reached);
          if (Compress(*field, reached, kReachDeviations * geometry.aperture_sigma_mm(), &around)) {
            depths.Add(least, most);
          } else {
            block.has_folds = true;
            depths.Add(least, least);
            depths.Add(most, most);
          }
        } else {
          const auto [least, most] = InverseDepths(geometry, i, grid.RegionOf(column, row));
          depths.Add(least, most);
        }
        seen.Add(around);
        for (const GlossOptions& image : layer.gloss) {
          depths.Add(1 / image.depth_mm, 1 / image.depth_mm);
        }
        const Detail of_layer = GlossOf(layer);
        gloss.bright += of_layer.bright;
        gloss.slope += of_layer.slope;
        gloss.bend += of_layer.bend;
      }
      block.sigma_px = depths.sigma_px();
      EffectSite place;
      place.position_px = FarthestPx(block, sensor.principal_point_px);
      depths.Fill(&place);
      // Fall-off can only make the light darker than the radiance.
      const double darkening = LeastIrradiance(camera, place.position_px);
      for (int c = 0; c < 3; ++c) {
        place.dark = darkening * static_cast<double>(seen.dark(c));
        place.bright = static_cast<double>(seen.bright(c) + gloss.bright(c));
        place.slope = static_cast<double>(seen.slope(c) + gloss.slope(c));
        place.bend = static_cast<double>(seen.bend(c) + gloss.bend(c));
        place.jump = block.layers.size() > 1 || block.has_folds ? place.bright - place.dark : 0;
        block.places[static_cast<std::size_t>(c)] = place;
      }
    }
  }
}

std::vector<EffectSite> SceneSurvey::Places() const {
  std::vector<EffectSite> places;
  for (const SceneBlock& block : blocks_) {
    places.insert(places.end(), block.places.begin(), block.places.end());
  }
  return places;
}

}  // namespace thicklens::model
