#include "model/simulate/scene/ray_bundle.h"

#include <cmath>
#include <limits>

namespace thicklens::model {
namespace {

using Flags = Eigen::Array<bool, Eigen::Dynamic, 1, Eigen::ColMajor, kRaysAtOnce, 1>;

Flags Inside(const SceneMask& mask, const Eigen::Vector2d& centre_px, const RayNumbers& x_px,
             const RayNumbers& y_px) {
  Flags inside(x_px.size());
  mask.AreInside(centre_px, x_px.data(), y_px.data(), static_cast<int>(x_px.size()), inside.data());
  return inside;
}

// Tests positions (x, y) relative to a point at `from_centre` from the outline's centre, in the
// outline's unit. The border of the outline is subtracted from the point in double because float
// has too few digits for a large outline. For a disc, |c + d|^2 <= R^2 is |d|^2 + 2 c.d <= (R -
// |c|)(R + |c|).
Flags Inside(const OutlineOptions& outline, const Eigen::Vector2d& from_centre, const RayNumbers& x,
             const RayNumbers& y) {
  if (outline.shape == OutlineOptions::Shape::kDisc) {
    const double c = from_centre.norm();
    // Both sides are divided by 2R, so that nothing overflows where R is large.
    const double scale = 1 / (2 * outline.radius);
    const Eigen::Vector2f direction = (2 * scale * from_centre).cast<float>();
    return static_cast<float>(scale) * (x.square() + y.square()) + direction.x() * x +
               direction.y() * y <=
           static_cast<float>(scale * (outline.radius - c) * (outline.radius + c));
  }
  const Eigen::Array2d half = outline.size.array() / 2;
  const Eigen::Array2f low = (-half - from_centre.array()).cast<float>();
  const Eigen::Array2f high = (half - from_centre.array()).cast<float>();
  return x >= low.x() && x <= high.x() && y >= low.y() && y <= high.y();
}

// Keeps the nearest of the offered layers for each ray.
class Nearest {
 public:
  explicit Nearest(Eigen::Index count) : count_(static_cast<std::size_t>(count)) {
    depth_mm_.fill(std::numeric_limits<double>::infinity());
    shown_.fill(0);
  }

  // `inside` and `depth_mm` have one value per ray.
  template <typename Depth>
  void Offer(std::size_t which, const Depth& depth_mm, const Flags* inside) {
    for (std::size_t i = 0; i < count_; ++i) {
      const auto ray = static_cast<Eigen::Index>(i);
      const double depth = depth_mm(ray);
      if (depth < depth_mm_[i] && (inside == nullptr || (*inside)(ray))) {
        depth_mm_[i] = depth;
        shown_[i] = which;
      }
    }
  }

  const RayBundle::Shown& shown() const { return shown_; }

 private:
  const std::size_t count_;
  std::array<double, kRaysAtOnce> depth_mm_;
  RayBundle::Shown shown_;
};

}  // namespace

RayBundle::RayBundle(const SceneGeometry& geometry, const std::vector<SceneRay>& rays,
                     bool occlusion)
    : geometry_(geometry), occlusion_(occlusion), rays_(rays) {
  for (const SceneRay& ray : rays_) {
    const Eigen::Vector2d landing_px =
        geometry_.PositionOf(ray) - geometry_.sensor().principal_point_px;
    landings_px_.push_back(landing_px);
    farthest_landing_.low_px = farthest_landing_.low_px.cwiseMin(landing_px);
    farthest_landing_.high_px = farthest_landing_.high_px.cwiseMax(landing_px);
    aperture_.low_mm = aperture_.low_mm.cwiseMin(ray.aperture_mm);
    aperture_.high_mm = aperture_.high_mm.cwiseMax(ray.aperture_mm);
  }
  const auto count = static_cast<Eigen::Index>(rays.size());
  slope_x_.resize(count);
  slope_y_.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const SceneRay& ray = rays_[static_cast<std::size_t>(i)];
    slope_x_(i) = static_cast<float>(ray.slope.x());
    slope_y_(i) = static_cast<float>(ray.slope.y());
  }
  for (const SceneLayer& layer : geometry.layers()) {
    const PlaneOptions& plane = layer.plane;
    OnLayer on;
    on.tilted = plane.slope != Eigen::Vector2d(0, 0);
    on.across_x.resize(count);
    on.across_y.resize(count);
    if (on.tilted) {
      on.lift.resize(count);
      on.tilt.resize(count);
    }
    for (Eigen::Index i = 0; i < count; ++i) {
      const SceneRay& ray = rays_[static_cast<std::size_t>(i)];
      const Eigen::Vector2f across_mm = ray.PositionMm(plane.depth_mm).cast<float>();
      on.across_x(i) = across_mm.x();
      on.across_y(i) = across_mm.y();
      if (!on.tilted) continue;
      on.lift(i) = static_cast<float>(plane.slope.dot(ray.aperture_mm));
      on.tilt(i) = static_cast<float>(plane.slope.dot(ray.slope));
    }
    on_layer_.push_back(std::move(on));
  }
}

ChiefHit RayBundle::ChiefAt(const Eigen::Vector2d& centre_px, std::size_t layer) const {
  const PlaneOptions& plane = geometry_.layers()[layer].plane;
  ChiefHit chief;
  chief.slope = geometry_.RayAt(centre_px, {0, 0}).slope;
  if (const HeightField* field = geometry_.height_field(layer)) {
    chief.shift = field->ShiftAt(centre_px);
    chief.depth_mm = field->DepthMm(chief.shift);
    chief.on_texture = centre_px;
    const ImageRegion landing = {centre_px + farthest_landing_.low_px,
                                 centre_px + farthest_landing_.high_px};
    chief.shifts = field->IntersectionShiftBounds(landing, aperture_);
    // The rays meet the field once if V grows more slowly along x + A V than V itself.
    const double farthest_mm =
        aperture_.low_mm.cwiseAbs().cwiseMax(aperture_.high_mm.cwiseAbs()).norm();
    chief.is_met_once = farthest_mm * field->SteepestOver(HeightField::ReachedRegion(
                                          landing, aperture_, chief.shifts)) <
                        1;
    return chief;
  }
  chief.facing = 1 - plane.slope.dot(chief.slope);
  chief.depth_mm = plane.depth_mm / chief.facing;
  chief.on_texture = chief.depth_mm * chief.slope;
  return chief;
}

RayBundle::Meeting RayBundle::Meet(std::size_t layer, const ChiefHit& chief,
                                   const RayPart& part) const {
  if (const HeightField* field = geometry_.height_field(layer)) {
    return MeetHeights(*field, chief, part);
  }
  const OnLayer& on = on_layer_[layer];
  Meeting meeting;
  if (!on.tilted) {
    meeting.x = on.across_x.segment(part.first, part.count);
    meeting.y = on.across_y.segment(part.first, part.count);
    meeting.beyond_mm.setZero(part.count);
    return meeting;
  }
  const auto chief_mm = static_cast<float>(chief.depth_mm);
  const auto facing = static_cast<float>(chief.facing);
  const auto from_axis_mm =
      static_cast<float>(chief.depth_mm - geometry_.layers()[layer].plane.depth_mm);
  const Eigen::Vector2f slope = chief.slope.cast<float>();
  const auto tilt = on.tilt.segment(part.first, part.count);
  meeting.beyond_mm = (on.lift.segment(part.first, part.count) + chief_mm * tilt) / (facing - tilt);
  const RayNumbers along_mm = meeting.beyond_mm + from_axis_mm;
  meeting.x = on.across_x.segment(part.first, part.count) +
              along_mm * slope_x_.segment(part.first, part.count) + slope.x() * meeting.beyond_mm;
  meeting.y = on.across_y.segment(part.first, part.count) +
              along_mm * slope_y_.segment(part.first, part.count) + slope.y() * meeting.beyond_mm;
  return meeting;
}

RayBundle::Meeting RayBundle::MeetHeights(const HeightField& field, const ChiefHit& chief,
                                          const RayPart& part) const {
  Meeting meeting;
  meeting.x.resize(part.count);
  meeting.y.resize(part.count);
  meeting.beyond_mm.resize(part.count);
  for (Eigen::Index i = 0; i < part.count; ++i) {
    const auto ray = static_cast<std::size_t>(part.first + i);
    const Eigen::Vector2d& aperture_mm = rays_[ray].aperture_mm;
    const Eigen::Vector2d position_px = chief.on_texture + landings_px_[ray];
    const double shift =
        occlusion_ && !chief.is_met_once
            ? field.FirstIntersection(position_px, aperture_mm, chief.shifts.high, chief.shifts.low)
            : field.IntersectionNearShift(position_px, aperture_mm, chief.shift, chief.shifts);
    const Eigen::Vector2d from_chief_px = landings_px_[ray] + shift * aperture_mm;
    meeting.x(i) = static_cast<float>(from_chief_px.x());
    meeting.y(i) = static_cast<float>(from_chief_px.y());
    meeting.beyond_mm(i) = static_cast<float>(field.DepthMm(shift) - chief.depth_mm);
  }
  return meeting;
}

// Formula: K/p (X/z - t) = K/p ((X - Xc) - (z - zc) t)/z.
std::array<RayNumbers, 2> RayBundle::ChiefOffsetsPx(std::size_t layer, const ChiefHit& chief,
                                                    const Meeting& meeting) const {
  if (geometry_.height_field(layer) != nullptr) return {{meeting.x, meeting.y}};
  const Eigen::Vector2f slope = chief.slope.cast<float>();
  const RayNumbers px_per_mm = static_cast<float>(geometry_.scale_px()) /
                               (static_cast<float>(chief.depth_mm) + meeting.beyond_mm);
  return {{px_per_mm * (meeting.x - slope.x() * meeting.beyond_mm),
           px_per_mm * (meeting.y - slope.y() * meeting.beyond_mm)}};
}

RayBundle::Shown RayBundle::NearestAlong(const Eigen::Vector2d& centre_px,
                                         const std::vector<std::size_t>& layers,
                                         const std::vector<ChiefHit>& chiefs,
                                         const RayPart& part) const {
  Nearest nearest(part.count);
  for (std::size_t k = 0; k < layers.size(); ++k) {
    const OutlineOptions& outline = geometry_.layers()[layers[k]].outline;
    const Meeting meeting = Meet(layers[k], chiefs[k], part);
    const auto depth_mm = chiefs[k].depth_mm + meeting.beyond_mm.cast<double>();
    if (outline.shape == OutlineOptions::Shape::kWhole) {
      nearest.Offer(k, depth_mm, nullptr);
      continue;
    }
    Flags inside;
    if (outline.unit == OutlineOptions::Unit::kPx) {
      const auto [x_px, y_px] = ChiefOffsetsPx(layers[k], chiefs[k], meeting);
      inside = outline.shape == OutlineOptions::Shape::kMask
                   ? Inside(geometry_.mask(layers[k]), centre_px, x_px, y_px)
                   : Inside(outline, centre_px - outline.centre, x_px, y_px);
    } else {
      inside = Inside(outline, chiefs[k].on_texture - outline.centre, meeting.x, meeting.y);
    }
    nearest.Offer(k, depth_mm, &inside);
  }
  return nearest.shown();
}

RayBundle::Shown RayBundle::NearestFromMiddle(const Eigen::Vector2d& centre_px,
                                              const std::vector<std::size_t>& layers,
                                              const std::vector<ChiefHit>& chiefs,
                                              std::size_t surface, const RayPart& part) const {
  const Meeting meeting = Meet(layers[surface], chiefs[surface], part);
  const auto [x_px, y_px] = ChiefOffsetsPx(layers[surface], chiefs[surface], meeting);
  const double scale_px = geometry_.scale_px();
  const Eigen::Vector2d& slope = chiefs[surface].slope;
  Nearest nearest(part.count);
  for (std::size_t k = 0; k < layers.size(); ++k) {
    const SceneLayer& layer = geometry_.layers()[layers[k]];
    if (const HeightField* field = geometry_.height_field(layers[k])) {
      nearest.Offer(
          k,
          [&, &x = x_px, &y = y_px](Eigen::Index i) {
            return field->DepthMm(
                field->ShiftAt(centre_px + Eigen::Vector2f(x(i), y(i)).cast<double>()));
          },
          nullptr);
      continue;
    }
    const Eigen::Vector2d per_px = layer.plane.slope / scale_px;
    const Eigen::Array<double, Eigen::Dynamic, 1, Eigen::ColMajor, kRaysAtOnce, 1> depth_mm =
        layer.plane.depth_mm /
        (chiefs[k].facing - per_px.x() * x_px.cast<double>() - per_px.y() * y_px.cast<double>());
    if (layer.outline.shape == OutlineOptions::Shape::kWhole) {
      nearest.Offer(k, depth_mm, nullptr);
      continue;
    }
    Flags inside;
    const Eigen::Vector2d& centre = layer.outline.centre;
    if (layer.outline.unit == OutlineOptions::Unit::kPx) {
      inside = layer.outline.shape == OutlineOptions::Shape::kMask
                   ? Inside(geometry_.mask(layers[k]), centre_px, x_px, y_px)
                   : Inside(layer.outline, centre_px - centre, x_px, y_px);
    } else {
      const Eigen::Vector2d& middle_mm = chiefs[k].on_texture;
      inside = Inside(
          layer.outline, middle_mm - centre,
          (depth_mm * (slope.x() + x_px.cast<double>() / scale_px) - middle_mm.x()).cast<float>(),
          (depth_mm * (slope.y() + y_px.cast<double>() / scale_px) - middle_mm.y()).cast<float>());
    }
    nearest.Offer(k, depth_mm, &inside);
  }
  return nearest.shown();
}

}  // namespace thicklens::model
