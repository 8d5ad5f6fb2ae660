#include "tools/interface/depth_plausibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens {
namespace {

// Displacement between neighbouring views above which whole numbers without a scale are no px.
constexpr double kMaxOfWholePx = 3;
// Shares of the image by which the outermost views may see half of the points apart. Light fields
// have less than a twentieth, and a wide portrait lens blurs a far background by an eighth: whole
// numbers beyond that are grey levels. Stated disparities may blur most of a small image away, but
// the views must have something in common.
constexpr double kMaxOfWholeNumbers = 1.0 / 8, kMaxOfDisparity = 1, kMaxOfDepth = 1.0 / 2;
// Diameter over focal length of the widest lenses.
constexpr double kWidestLens = 1.4;
// Displacement over the whole aperture that is no visible parallax, and one that is, px.
constexpr double kInvisiblePx = 0.3, kVisiblePx = 1;
// Points beyond are too few to count.
constexpr double kFew = 0.005;

std::string NameFor(const DepthMap& map) { return map.source.empty() ? "depth" : map.source; }

struct Range {
  double least = 0, median = 0, most = 0;
};

double At(std::vector<float>* values, double share) {
  const auto at = values->begin() +
                  static_cast<std::ptrdiff_t>(share * static_cast<double>(values->size() - 1));
  std::nth_element(values->begin(), at, values->end());
  return static_cast<double>(*at);
}

// Standard deviation of the positions on an axis, in view steps.
double SpreadSteps(const Eigen::ArrayXd& weights) {
  double sum = 0;
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    const double offset = static_cast<double>(k) - static_cast<double>(weights.size() - 1) / 2;
    sum += weights[k] * offset * offset;
  }
  return std::sqrt(sum);
}

std::string ScaleAdvice(const DepthMap& map, const Range& px, const RunScope& run) {
  if (map.meaning.kind != DepthKind::kDisparity) {
    return fmt::format("are {}, and the camera's aperture and focus, right?",
                       map.meaning.kind == DepthKind::kInverse
                           ? fmt::format("{} and {}", run.Option("depth.meaning.inverse_scale_dpt"),
                                         run.Option("depth.meaning.inverse_offset_dpt"))
                           : run.Option("depth.meaning.unit"));
  }
  // A map of the same order whose middle is in focus and whose ends are 1 px per view step off.
  const DepthMeaning& meaning = map.meaning;
  const double reach = std::max(px.most - px.median, px.median - px.least);
  const std::string options = fmt::format(
      "px per view step = scale * value + offset is what {} and {} state",
      run.Option("depth.meaning.disparity_scale"), run.Option("depth.meaning.disparity_offset_px"));
  if (!(reach > 1e-3 * std::abs(px.median))) return options;  // one depth has no scale
  const double scale = meaning.disparity_scale / reach;
  const double offset = (meaning.disparity_offset_px - px.median) / reach;
  return fmt::format(
      "{}; for a first try, with the median in focus and at most 1 px per view step: {} {:.3g} {} "
      "{:.3g}",
      options, run.Option("depth.meaning.disparity_scale"), scale,
      run.Option("depth.meaning.disparity_offset_px"), offset);
}

}  // namespace

void ReportPlausibility(const DepthMap& map, const estimator::DisparityMap& disparity,
                        const Eigen::ArrayXXd& weights, bool is_focus_on_grid,
                        const std::optional<Camera>& camera,
                        const std::optional<model::DepthStatistics>& depth, RunScope* run) {
  const bool along_u = std::abs(disparity.step.x()) >= std::abs(disparity.step.y());
  const double step = along_u ? disparity.step.x() : disparity.step.y();
  std::vector<float> px, sizes;
  px.reserve(disparity.disparity.size());
  sizes.reserve(disparity.disparity.size());
  for (const float value : disparity.disparity) {
    px.push_back(static_cast<float>(static_cast<double>(value) * step));
    sizes.push_back(std::abs(px.back()));
  }
  const auto rounded = [](double value) { return std::abs(value) < 1e-9 ? 0 : value; };
  const Range range{rounded(At(&px, 0)), rounded(At(&px, 0.5)), rounded(At(&px, 1))};
  const Range size{At(&sizes, 0), At(&sizes, 0.5), At(&sizes, 1)};
  const auto views = static_cast<double>(std::max(weights.rows(), weights.cols()) - 1);
  const double spread = SpreadSteps(along_u ? Eigen::ArrayXd(weights.colwise().sum().transpose())
                                            : Eigen::ArrayXd(weights.rowwise().sum()));
  run->Inform(fmt::format(
      "{}: {}neighbouring views move by {:.3g} .. {:.3g} px (median {:.3g}){}", NameFor(map),
      depth ? fmt::format("depth {:.6g} .. {:.6g} mm (median {:.6g}): ", depth->min_mm,
                          depth->max_mm, depth->median_mm)
            : "",
      range.least, range.most, range.median,
      is_focus_on_grid
          ? fmt::format("; the blur has a standard deviation of up to {:.2g} px (median {:.2g})",
                        size.most * spread, size.median * spread)
          : ""));
  const DepthMeaning& meaning = map.meaning;
  const bool has_no_scale = map.is_integer && meaning.kind == DepthKind::kDisparity &&
                            meaning.disparity_scale == 1 && meaning.disparity_offset_px == 0;
  const int size_px = std::min(disparity.width_px, disparity.height_px);
  // Whole numbers may be px, such as those of a stereo pair.
  if (has_no_scale && size.median > kMaxOfWholePx &&
      size.median * views > kMaxOfWholeNumbers * size_px) {
    throw Error(fmt::format(
        "{}: the whole numbers of the map are taken as px per view step: the median of {:.4g} px "
        "moves a point by {:.4g} px between the outermost views, and the image has {} px; {}",
        NameFor(map), size.median, size.median * views, size_px, ScaleAdvice(map, range, *run)));
  }
  const double most =
      (meaning.kind == DepthKind::kDisparity ? kMaxOfDisparity : kMaxOfDepth) * size_px;
  if (size.median * views > most && size.median > kMaxOfWholePx) {
    throw Error(fmt::format(
        "{}: disparities from {:.4g} to {:.4g} px per view step: the median moves a point by "
        "{:.4g} px between the outermost views, a large part of the {} px of the image; {}",
        NameFor(map), range.least, range.most, size.median * views, size_px,
        ScaleAdvice(map, range, *run)));
  }
  const double seen_px = std::abs(At(&sizes, 1 - kFew)) * views;
  if (!(seen_px < kInvisiblePx)) return;
  const std::string remedy =
      !(seen_px > 1e-9) ? "everything lies in the plane of focus"
      : meaning.kind == DepthKind::kDisparity
          ? fmt::format("{} of {:.3g} times the present one would show {:g} px",
                        run->Option("depth.meaning.disparity_scale"), kVisiblePx / seen_px,
                        kVisiblePx)
          : "";
  const auto aperture = [&] {
    const double factor = kVisiblePx / seen_px;
    const double radius_mm = camera->lens.aperture_radius_mm * factor;
    return fmt::format(
        "an aperture radius of {:.3g} mm (f/{:.2g}) instead of {:.3g} mm (f/{:.2g}) would show "
        "{:g} px{}",
        radius_mm, camera->lens.rear_focal_length_mm / (2 * radius_mm),
        camera->lens.aperture_radius_mm,
        camera->lens.rear_focal_length_mm / (2 * camera->lens.aperture_radius_mm), kVisiblePx,
        2 * radius_mm > kWidestLens * camera->lens.rear_focal_length_mm
            ? ", but no lens has it: depths that differ more from the focus do"
            : "");
  };
  run->Warn(fmt::format(
      "{}: no visible parallax: the views differ by at most {:.2g} px over the whole aperture; {}",
      NameFor(map), seen_px, remedy.empty() && camera ? aperture() : remedy));
}

}  // namespace thicklens
