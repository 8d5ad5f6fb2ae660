#include "ray_bundle.h"

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

// Of positions (x, y) from a point that lies at `from_centre` from the outline's centre, in its
// unit. However large the outline is, its border is compared near the point, in double: float has
// not the digits. Of a disc, |c + d|^2 <= R^2 is |d|^2 + 2 c.d <= (R - |c|)(R + |c|).
Flags Inside(const OutlineOptions& outline, const Eigen::Vector2d& from_centre, const RayNumbers& x,
             const RayNumbers& y) {
  if (outline.shape == OutlineOptions::Shape::kDisc) {
    const double c = from_centre.norm();
    // By 2R, so that nothing overflows where R is large.
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

// Keeps, for each ray, the nearest of what is offered.
class Nearest {
 public:
  explicit Nearest(Eigen::Index count) : count_(static_cast<std::size_t>(count)) {
    depth_mm_.fill(std::numeric_limits<double>::infinity());
    shown_.fill(0);
  }

  // `inside`, `depth_mm`: of each ray.
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

RayBundle::RayBundle(const SceneGeometry& geometry, const std::vector<SceneRay>& rays)
    : geometry_(geometry), rays_(rays) {
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
  chief.facing = 1 - plane.slope.dot(chief.slope);
  chief.depth_mm = plane.depth_mm / chief.facing;
  chief.position_mm = chief.depth_mm * chief.slope;
  return chief;
}

RayBundle::Meeting RayBundle::Meet(std::size_t layer, const ChiefHit& chief,
                                   const RayPart& part) const {
  const OnLayer& on = on_layer_[layer];
  Meeting meeting;
  if (!on.tilted) {
    meeting.x_mm = on.across_x.segment(part.first, part.count);
    meeting.y_mm = on.across_y.segment(part.first, part.count);
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
  meeting.x_mm = on.across_x.segment(part.first, part.count) +
                 along_mm * slope_x_.segment(part.first, part.count) +
                 slope.x() * meeting.beyond_mm;
  meeting.y_mm = on.across_y.segment(part.first, part.count) +
                 along_mm * slope_y_.segment(part.first, part.count) +
                 slope.y() * meeting.beyond_mm;
  return meeting;
}

// K/p (X/z - t) = K/p ((X - Xc) - (z - zc) t)/z.
std::array<RayNumbers, 2> RayBundle::ChiefOffsetsPx(const ChiefHit& chief,
                                                    const Meeting& meeting) const {
  const Eigen::Vector2f slope = chief.slope.cast<float>();
  const RayNumbers px_per_mm = static_cast<float>(geometry_.scale_px()) /
                               (static_cast<float>(chief.depth_mm) + meeting.beyond_mm);
  return {{px_per_mm * (meeting.x_mm - slope.x() * meeting.beyond_mm),
           px_per_mm * (meeting.y_mm - slope.y() * meeting.beyond_mm)}};
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
      const auto [x_px, y_px] = ChiefOffsetsPx(chiefs[k], meeting);
      inside = outline.shape == OutlineOptions::Shape::kMask
                   ? Inside(geometry_.mask(layers[k]), centre_px, x_px, y_px)
                   : Inside(outline, centre_px - outline.centre, x_px, y_px);
    } else {
      inside = Inside(outline, chiefs[k].position_mm - outline.centre, meeting.x_mm, meeting.y_mm);
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
  const auto [x_px, y_px] = ChiefOffsetsPx(chiefs[surface], meeting);
  const double scale_px = geometry_.scale_px();
  const Eigen::Vector2d& slope = chiefs[surface].slope;
  Nearest nearest(part.count);
  for (std::size_t k = 0; k < layers.size(); ++k) {
    const SceneLayer& layer = geometry_.layers()[layers[k]];
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
      const Eigen::Vector2d& middle_mm = chiefs[k].position_mm;
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
