// DisparityRenderer draws a disparity map into other views.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "estimator/views/boundary_samples.h"
#include "estimator/views/disparity_buffer.h"
#include "estimator/views/hole_filler.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/cell_row.h"

namespace thicklens::estimator {
namespace {

// Neighbours whose disparities differ by more than this, px per view step, belong to two surfaces.
constexpr double kSameSurfacePx = 0.2;

// This exceeds the width of any image; whole numbers up to it are exact in float.
constexpr float kFarAwayPx = 4194304;

// The limit keeps the displacement of disparity 0 at 0 in float as well.
constexpr double kLargestShift = 1e30;

void CheckMap(const DisparityMap& map) {
  if (map.width_px < 1 || map.height_px < 1 ||
      map.disparity.size() != Index(map.width_px) * Index(map.height_px)) {
    throw Error(
        fmt::format("disparity map: {} values for {}x{} px: the count must be the product of these "
                    "numbers, and not 0",
                    map.disparity.size(), map.width_px, map.height_px));
  }
  if (!std::all_of(map.disparity.begin(), map.disparity.end(),
                   [](float d) { return std::isfinite(d); })) {
    throw Error("disparity map: it has holes, which must be filled before a view is rendered");
  }
}

Vertex VertexOf(const kernels::PixelRow& row, int x, int y) {
  const std::size_t i = Index(x);
  return {x + static_cast<double>(row.offset_x[i]), y + static_cast<double>(row.offset_y[i]),
          row.disparity[i]};
}

// Paints the cell at x of the row between `upper` and `lower`, whatever its kind.
void PaintCell(const kernels::PixelRow& upper, const kernels::PixelRow& lower, int x, int y,
               DisparityBuffer* buffer) {
  const Vertex p00 = VertexOf(upper, x, y);
  const Vertex p11 = VertexOf(lower, x + 1, y + 1);
  buffer->DrawTriangle(p00, VertexOf(upper, x + 1, y), p11);
  buffer->DrawTriangle(p00, p11, VertexOf(lower, x, y + 1));
}

// Paints such a cell if it is not odd.
void PaintRegularCell(const kernels::PixelRow& upper, const kernels::PixelRow& lower, int x, int y,
                      DisparityBuffer* buffer) {
  const kernels::ViewRow row{y, buffer->width_px(), buffer->height_px()};
  const kernels::Rectangle around = kernels::RectangleOf(upper.bounds(), lower.bounds(), row, x);
  for (float dy = around.above; dy <= around.below; ++dy) {
    for (float dx = around.left; dx <= around.right; ++dx) {
      buffer->Put(x + static_cast<int>(dx), y + static_cast<int>(dy),
                  kernels::CellDisparity(upper.corners(), lower.corners(), x, dx, dy));
    }
  }
}

void PaintSurfaces(const DisparityMap& map, const std::vector<char>& is_surface,
                   const Eigen::Vector2d& shift, DisparityBuffer* buffer) {
  const int width = map.width_px;
  kernels::PixelRow upper(Index(width));
  kernels::PixelRow lower(Index(width));
  kernels::CellRow cells(Index(width));
  const auto shift_x = static_cast<float>(std::clamp(shift.x(), -kLargestShift, kLargestShift));
  const auto shift_y = static_cast<float>(std::clamp(shift.y(), -kLargestShift, kLargestShift));
  kernels::PlacePixels(map.disparity.data(), shift_x, shift_y, kFarAwayPx, &upper);
  for (int y = 0; y + 1 < map.height_px; ++y) {
    ThrowIfCancelled();
    kernels::PlacePixels(map.disparity.data() + Index(y + 1) * Index(width), shift_x, shift_y,
                         kFarAwayPx, &lower);
    kernels::SampleCells(upper, lower, {y, width, map.height_px}, &cells);
    const char* const is_cell = is_surface.data() + Index(y) * Index(width);
    float* const row = buffer->row(y);
    float nowhere = 0;
    for (int x = 0; x + 1 < width; ++x) {
      const std::size_t i = Index(x);
      const kernels::CellSamples samples =
          is_cell[i] ? cells.samples[i] : kernels::CellSamples::kNone;
      if (samples <= kernels::CellSamples::kTwo) {
        // None, one (the first is the last) and two samples alternate on a slope; the code avoids a
        // branch.
        const bool any = samples != kernels::CellSamples::kNone;
        float* const first = any ? row + x + cells.first[i] : &nowhere;
        *first = kernels::Most(*first, cells.first_disparity[i]);
        float* const last = any ? row + x + cells.last[i] : &nowhere;
        *last = kernels::Most(*last, cells.last_disparity[i]);
      } else if (samples == kernels::CellSamples::kSeveral) {
        PaintRegularCell(upper, lower, x, y, buffer);
      } else {
        PaintCell(upper, lower, x, y, buffer);
      }
    }
    std::swap(upper, lower);
  }
}

void PaintAlone(const DisparityMap& map, const std::vector<int>& alone,
                const Eigen::Vector2d& shift, DisparityBuffer* buffer) {
  const std::size_t width = Index(map.width_px);
  for (const int index : alone) {
    ThrowIfCancelled();
    const std::size_t i = Index(index);
    const double disparity = map.disparity[i];
    buffer->DrawSquare({static_cast<double>(i % width) - shift.x() * disparity,
                        static_cast<double>(i / width) - shift.y() * disparity, disparity});
  }
}

void FindSources(const DisparityMap& map, const SupportedPixels& supported, DisparityBuffer buffer,
                 CompactView* view) {
  HoleFiller filler(map, supported, buffer, view->shift);
  const std::vector<HoleFiller::Sample>& holes = filler.holes();
  view->occluded.reserve(holes.size());
  if (holes.size() == map.disparity.size()) {  // the view looks past the image: use the centre view
    for (std::size_t i = 0; i < holes.size(); ++i) {
      view->occluded.push_back({static_cast<std::int32_t>(i), 0, 0, map.disparity[i]});
    }
  } else {
    for (const HoleFiller::Sample& hole : holes) {
      ThrowIfCancelled();
      const HoleFiller::Source from = filler.Background(hole.x, hole.y);
      view->occluded.push_back({static_cast<std::int32_t>(buffer.Index(hole.x, hole.y)),
                                static_cast<float>(from.way_x), static_cast<float>(from.way_y),
                                from.disparity});
    }
  }
  view->disparity = std::move(buffer).TakeDisparity();
  for (const CompactView::Occluded& occluded : view->occluded) {
    view->disparity[Index(occluded.index)] = std::numeric_limits<float>::quiet_NaN();
  }
}

}  // namespace

DisparityRenderer::DisparityRenderer(const DisparityMap& map) : map_(map) {
  CheckMap(map);
  const int width = map.width_px;
  const int height = map.height_px;
  const double px_per_unit = map.step.cwiseAbs().maxCoeff();
  is_surface_.assign(map.disparity.size(), 0);
  std::vector<char> is_alone(map.disparity.size(), width == 1 || height == 1);
  for (int y = 0; y + 1 < height; ++y) {
    ThrowIfCancelled();
    const std::size_t row = Index(y) * Index(width);
    for (std::size_t i = row; i + 1 < row + Index(width); ++i) {
      const std::size_t below = i + Index(width);
      const auto [low, high] = std::minmax(
          {map.disparity[i], map.disparity[i + 1], map.disparity[below], map.disparity[below + 1]});
      is_surface_[i] = (static_cast<double>(high) - low) * px_per_unit <= kSameSurfacePx;
      if (is_surface_[i]) continue;
      is_alone[i] = is_alone[i + 1] = is_alone[below] = is_alone[below + 1] = true;
    }
  }
  for (std::size_t i = 0; i < is_alone.size(); ++i) {
    if (is_alone[i]) alone_.push_back(static_cast<int>(i));
  }
  supported_ = std::make_shared<const SupportedPixels>(FindSupported(map, is_surface_));
}

CompactView DisparityRenderer::RenderCompact(double a, double b) const {
  CompactView view;
  view.width_px = map_.width_px;
  view.height_px = map_.height_px;
  view.shift = {a * map_.step.x(), b * map_.step.y()};
  if (!view.shift.allFinite()) {
    throw Error(fmt::format("view ({}, {}) steps from the centre: both must be finite", a, b));
  }
  if (view.shift.isZero(0)) {
    view.disparity = map_.disparity;
    return view;
  }
  DisparityBuffer buffer(map_.width_px, map_.height_px);
  PaintSurfaces(map_, is_surface_, view.shift, &buffer);
  PaintAlone(map_, alone_, view.shift, &buffer);
  FindSources(map_, *supported_, std::move(buffer), &view);
  view.boundary = FindBoundarySamples(map_, alone_, view);
  return view;
}

ViewDisparity DisparityRenderer::Render(double a, double b) const {
  ViewDisparity view;
  Expand(RenderCompact(a, b), &view);
  return view;
}

const CompactView::Occluded& CompactView::OccludedAt(std::size_t i) const {
  return *std::lower_bound(occluded.begin(), occluded.end(), i,
                           [](const Occluded& h, std::size_t at) { return Index(h.index) < at; });
}

void Expand(const CompactView& compact, ViewDisparity* view) {
  view->width_px = compact.width_px;
  view->height_px = compact.height_px;
  view->disparity = compact.disparity;
  view->boundary = compact.boundary;
  view->visibility.assign(view->disparity.size(), Visibility::kVisible);
  view->source_x.resize(view->disparity.size());
  view->source_y.resize(view->disparity.size());
  for (std::size_t i = 0; i < view->disparity.size(); ++i) {
    view->source_x[i] = static_cast<float>(compact.shift.x() * view->disparity[i]);
    view->source_y[i] = static_cast<float>(compact.shift.y() * view->disparity[i]);
  }
  for (const CompactView::Occluded& occluded : compact.occluded) {
    const std::size_t i = Index(occluded.index);
    view->disparity[i] = occluded.disparity;
    view->visibility[i] = Visibility::kOccluded;
    view->source_x[i] = occluded.source_x;
    view->source_y[i] = occluded.source_y;
  }
}

ViewDisparity RenderDisparity(const DisparityMap& map, double a, double b) {
  return DisparityRenderer(map).Render(a, b);
}

}  // namespace thicklens::estimator
