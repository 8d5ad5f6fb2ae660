#include "tools/report/explain_figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/printable_text.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {
namespace {

constexpr int kPoints = 241;
constexpr double kStandardErrors = 2;
// For a larger ratio of depths, a curve over depth is compressed at its near end.
constexpr double kFarRatio = 4;

PlotSeries Curve(const std::string& label, Ink ink, Stroke stroke) {
  PlotSeries series;
  series.label = label;
  series.ink = ink;
  series.mark = Mark::kNone;
  series.stroke = stroke;
  return series;
}

}  // namespace

std::string BlurCurveSvg(const model::Camera& camera, const model::DepthRange& range) {
  const model::Explanation known = model::ExplainCamera(camera, range, kPoints);
  const bool by_inverse = !(range.far_mm < kFarRatio * range.near_mm);
  const auto abscissa = [by_inverse](double depth_mm) {
    return by_inverse ? 1000 / depth_mm : depth_mm;
  };
  Plot plot;
  plot.id = "blur-against-depth";
  plot.title = fmt::format("Sigma of the defocus blur against depth, camera {}",
                           PrintableUtf8(known.camera_name));
  plot.heading = fmt::format("{}: blur against depth", PrintableUtf8(known.camera_name));
  plot.x_axis.label = by_inverse ? "1/depth [1/m]" : "depth [mm]";
  plot.y_axis.label = "defocus sigma [px]";
  const bool thick = !known.thin.same_lens;
  PlotSeries curve =
      Curve(thick ? "thick lens, as calibrated" : "as calibrated", Ink::kFit, Stroke::kSolid);
  PlotSeries thin = Curve("thin lens at the same image distance", Ink::kMuted, Stroke::kDashed);
  PlotBand band;
  band.label = fmt::format("\u00B1{:g} standard errors of d1 and kappa", kStandardErrors);
  bool has_errors = false;
  for (const model::DepthRow& row : known.rows) {
    const double x = abscissa(row.depth_mm);
    curve.x.push_back(x);
    curve.y.push_back(row.defocus_sigma_px);
    thin.x.push_back(x);
    thin.y.push_back(known.blur_ratio * row.thin_blur_radius_px);
    const double error_px = kStandardErrors * row.defocus_sigma_error_px;
    band.x.push_back(x);
    band.lo.push_back(std::max(0.0, row.defocus_sigma_px - error_px));
    band.hi.push_back(row.defocus_sigma_px + error_px);
    has_errors = has_errors || error_px > 0;
  }
  if (has_errors) plot.bands.push_back(std::move(band));
  plot.series.push_back(std::move(curve));
  if (thick) plot.series.push_back(std::move(thin));
  plot.lines.push_back({std::isfinite(known.focus_depth_mm)
                            ? fmt::format("in focus at {:.5g} mm", known.focus_depth_mm)
                            : "in focus at infinity",
                        Ink::kPeak, Stroke::kDotted, true, abscissa(known.focus_depth_mm)});
  return SvgFile(SvgPlot(plot));
}

}  // namespace thicklens::tools
