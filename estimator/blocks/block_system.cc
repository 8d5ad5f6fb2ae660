#include "estimator/blocks/block_system.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "estimator/views/ray_irradiance.h"
#include "estimator/views/ray_landing.h"
#include "estimator/views/same_point.h"
#include "estimator/views/warped_views.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

using kernels::BlockGeometry;
using kernels::CsrMatrix;
using kernels::CsrPattern;

// Calls visit(ray, k, l, s, t) for every existing ray of the block.
template <typename Visit>
void ForEachRay(const BlockGeometry& block, const Visit& visit) {
  for (int l = 0; l < block.v_count; ++l) {
    for (int k = 0; k < block.u_count; ++k) {
      for (int y = 0; y < block.height_px; ++y) {
        for (int x = 0; x < block.width_px; ++x) {
          if (!block.Exists(k, l, x, y)) continue;
          const int ray = ((l * block.u_count + k) * block.height_px + y) * block.width_px + x;
          visit(Index(ray), k, l, block.first_x + x - block.s_shift[Index(k)],
                block.first_y + y - block.t_shift[Index(l)]);
        }
      }
    }
  }
}

// Returns the index of the entry (row, column) in the values of a pattern.
std::size_t EntryOf(const CsrPattern& pattern, int row, int column) {
  const auto begin = pattern.column.begin() + pattern.row_start[Index(row)];
  const auto end = pattern.column.begin() + pattern.row_start[Index(row) + 1];
  return static_cast<std::size_t>(std::lower_bound(begin, end, column) - pattern.column.begin());
}

void AddMatrix(const CsrMatrix<double>& a, double scale, const CsrPattern& pattern,
               std::vector<double>* values) {
  for (int row = 0; row < a.rows; ++row) {
    for (std::int64_t e = a.row_start[Index(row)]; e < a.row_start[Index(row) + 1]; ++e) {
      const auto entry = static_cast<std::size_t>(e);
      (*values)[EntryOf(pattern, row, a.column[entry])] += scale * a.value[entry];
    }
  }
}

// Returns the pixels of one channel, row by row.
std::vector<double> PixelsOf(const model::LinearImage& image, const BlockGeometry& block,
                             int channel) {
  std::vector<double> pixels;
  pixels.reserve(Index(block.pixels()));
  for (int y = 0; y < block.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < block.width_px; ++x) {
      pixels.push_back(image.at(block.first_x + x, block.first_y + y, channel));
    }
  }
  return pixels;
}

template <typename Number>
std::string_view BytesOf(const Number* numbers, std::size_t count) {
  return {reinterpret_cast<const char*>(numbers), count * sizeof(Number)};
}
template <typename Number>
std::string_view BytesOf(const std::vector<Number>& numbers) {
  return BytesOf(numbers.data(), numbers.size());
}

}  // namespace

RayField::RayField(const EstimateInput& input, bool falloff, int threads)
    : input_(input), prior_(WarpToAllViews(input, falloff, threads, &disparity_)) {
  if (!falloff || !input.camera) return;
  irradiance_.resize(disparity_.size());
  ParallelFor(u_count() * v_count(), threads, [&](int view) {
    irradiance_[Index(view)] = RelativeFalloff(*input_.grid, input_.camera_of_falloff(),
                                               input_.weights, view % u_count(), view / u_count());
  });
}

BlockGeometry RayField::Block(int x, int y, int width_px, int height_px) const {
  return BlockOf(prior_, {x, y, width_px, height_px}, input_.weights);
}

RayField::Slopes RayField::SlopesOf(const BlockGeometry& block, bool cut_occluded) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Slopes slopes;
  slopes.u.assign(Index(block.rays()), kNone);
  slopes.v = slopes.u;
  const int width = input_.image.width_px;
  ForEachRay(block, [&](std::size_t ray, int k, int l, int s, int t) {
    const int view = l * block.u_count + k;
    const double disparity = disparity_[Index(view)][Index(t) * Index(width) + Index(s)];
    const double m_u = -disparity * input_.disparity.step.x();
    const double m_v = -disparity * input_.disparity.step.y();
    const auto linked = [&](int next, double next_s, double next_t) {
      return !cut_occluded ||
             ShowsSamePoint(input_.disparity, disparity_[Index(next)], next_s, next_t, disparity);
    };
    // Without a next view the slope still serves the six-term mask.
    if (k + 1 == block.u_count ? !cut_occluded : linked(view + 1, s + m_u, t)) slopes.u[ray] = m_u;
    if (l + 1 == block.v_count ? !cut_occluded : linked(view + block.u_count, s, t + m_v)) {
      slopes.v[ray] = m_v;
    }
  });
  return slopes;
}

std::vector<double> RayField::IrradianceOf(const BlockGeometry& block) const {
  if (irradiance_.empty()) return {};
  std::vector<double> irradiance(Index(block.rays()), 0.0);
  const int width = input_.image.width_px;
  ForEachRay(block, [&](std::size_t ray, int k, int l, int s, int t) {
    irradiance[ray] = irradiance_[Index(l * block.u_count + k)][Index(t) * Index(width) + Index(s)];
  });
  return irradiance;
}

std::vector<BlockRun::Data> RayField::Data() const {
  const Eigen::ArrayXXd& weights = input_.weights;
  BlockRun::Data depth{"depth map", {BytesOf(input_.disparity.disparity)}};
  depth.bytes.push_back(BytesOf(input_.disparity.step.data(), 2));
  for (const auto& view : disparity_) depth.bytes.push_back(BytesOf(view));
  BlockRun::Data falloff{"fall-off", {}};
  for (const auto& view : irradiance_) falloff.bytes.push_back(BytesOf(view));
  // The landing positions depend on the step from view to view, which the prior knows.
  return {{"image", {BytesOf(input_.image.values)}},
          {"aperture",
           {BytesOf(weights.data(), static_cast<std::size_t>(weights.size())),
            BytesOf(prior_.landing_step_px.data(), 2)}},
          std::move(depth),
          std::move(falloff),
          {"warped image", {BytesOf(prior_.values)}}};
}

BlockSystem MakeBlockSystem(const RayField& rays, const BlockGeometry& block,
                            const BlockOptions& options, double ridge,
                            kernels::Kernels<double>* kernels) {
  const CsrMatrix<double> h = kernels::Compress(kernels->WeightRays(
      block, options.splat, kernels->FindRays(block, options.splat), rays.IrradianceOf(block)));

  const bool warp = options.stencil == Stencil::kWarp;
  const RayField::Slopes slopes = rays.SlopesOf(block, warp);
  // This is D with -G = D^T D, or G itself.
  const CsrMatrix<double> smoothness =
      kernels::Compress(warp ? kernels->WarpDifferences(block, slopes.u, slopes.v)
                             : kernels->SixTermMasks(block, slopes.u, slopes.v));
  const CsrPattern pattern =
      kernels::SumPattern(kernels::NormalPattern(h), warp ? kernels::NormalPattern(smoothness)
                                                          : kernels::PatternOf(smoothness));

  std::vector<double> values(static_cast<std::size_t>(pattern.entries()), 0.0);
  kernels->AddNormalProduct(h, 1, pattern, &values);
  if (warp) {
    kernels->AddNormalProduct(smoothness, options.gamma, pattern, &values);
  } else {
    AddMatrix(smoothness, -options.gamma, pattern, &values);
  }
  std::vector<bool> exists(Index(block.rays()), false);
  ForEachRay(block, [&](std::size_t ray, int, int, int, int) { exists[ray] = true; });
  for (int ray = 0; ray < block.rays(); ++ray) {
    values[EntryOf(pattern, ray, ray)] += exists[Index(ray)] ? ridge : 1;
  }

  BlockSystem system{block, {}, {}, {}};
  system.matrix.rows = system.matrix.columns = pattern.rows;
  system.matrix.row_start = pattern.row_start;
  system.matrix.column = pattern.column;
  system.matrix.value = std::move(values);

  const model::LightField& prior = rays.prior();
  for (int channel = 0; channel < prior.channels; ++channel) {
    std::vector<double> right =
        kernels->MultiplyTransposed(h, PixelsOf(rays.input().image, block, channel));
    std::vector<double> start(right.size(), 0.0);
    ForEachRay(block, [&](std::size_t ray, int k, int l, int s, int t) {
      start[ray] =
          prior.values[prior.ViewStart(channel, k, l) + Index(t) * Index(prior.s_count) + Index(s)];
      right[ray] += ridge * start[ray];
    });
    system.right_sides.push_back(std::move(right));
    system.starts.push_back(std::move(start));
  }
  return system;
}

}  // namespace thicklens::estimator
