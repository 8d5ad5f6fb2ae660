#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/calib/blur_model.h"
#include "tools/report/calibration_figures.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/calibration_text.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;
using calib::FrameMeasurement;

constexpr int kCurveSteps = 400;
constexpr double kBandSigmas = 2;

// The blur of the frames, grouped by their use in the fit.
struct BlurPoints {
  PlotSeries fitted = Points("in the fit", Ink::kFit, Mark::kDot);
  PlotSeries doubted = Points("down-weighted", Ink::kFit, Mark::kRing);
  PlotSeries left_out = Points("left out", Ink::kData, Mark::kCross);
  PlotSeries zhuo_sim = Points("paper's estimator (Zhuo-Sim)", Ink::kMuted, Mark::kDiamond);
  PlotSeries fitted_residuals = Points("", Ink::kFit, Mark::kDot);
  PlotSeries doubted_residuals = Points("", Ink::kFit, Mark::kRing);
  std::vector<double> xs;
  double largest_residual = 0;
};

BlurPoints BlurPointsOf(const Calibration& calibration, const std::optional<calib::BlurModel>& law,
                        const Abscissa& abscissa) {
  BlurPoints points;
  for (const FrameMeasurement& frame : calibration.frames) {
    const double x = abscissa.Of(frame);
    if (frame.rejection.empty() && frame.source_blur_sigma_px > 0)
      AddPoint(&points.zhuo_sim, x, frame.source_blur_sigma_px,
               PointName(frame, abscissa, "Zhuo-Sim sigma [px]", frame.source_blur_sigma_px));
    if (!calib::HasBlur(frame)) continue;
    const bool in_fit = frame.in_blur_fit && frame.rejection.empty();
    const bool full = frame.blur_fit_weight >= 0.5;
    PlotSeries* series = !in_fit ? &points.left_out : full ? &points.fitted : &points.doubted;
    AddPoint(series, x, frame.blur_sigma_px,
             PointName(frame, abscissa, "sigma [px]", frame.blur_sigma_px));
    series->y_error.push_back(frame.blur_sigma_error_px);
    points.xs.push_back(x);
    const std::optional<double> residual = law ? law->ResidualSigmas(frame) : std::nullopt;
    if (!residual) continue;
    AddPoint(full ? &points.fitted_residuals : &points.doubted_residuals, x, *residual,
             PointName(frame, abscissa, "residual/sd", *residual));
    if (std::isfinite(*residual))
      points.largest_residual = std::max(points.largest_residual, std::abs(*residual));
  }
  return points;
}

CurvePoints ModelCurve(const calib::BlurModel& law, const std::pair<double, double>& x_range) {
  CurvePoints curve;
  for (int i = 0; i <= kCurveSteps; ++i) {
    const double z_mm = x_range.first + (x_range.second - x_range.first) * i / kCurveSteps;
    if (calib::IsDepth(z_mm)) curve.emplace_back(z_mm, law.SigmaPx(z_mm));
  }
  return curve;
}

PlotBand ModelBand(const calib::BlurModel& law, const CurvePoints& curve) {
  PlotBand band;
  band.label = "its uncertainty, ± 2 sd";
  for (const auto& [z_mm, sigma_px] : curve) {
    const std::optional<double> error_px = law.SigmaErrorPx(z_mm);
    if (!error_px) continue;
    band.x.push_back(z_mm);
    band.lo.push_back(sigma_px - kBandSigmas * *error_px);
    band.hi.push_back(sigma_px + kBandSigmas * *error_px);
  }
  return band;
}

PlotSeries SideCurve(std::string label, Stroke stroke, const calib::BlurModel& law,
                     const std::pair<double, double>& x_range) {
  PlotSeries series = Curve(std::move(label), Ink::kData, stroke, ModelCurve(law, x_range));
  series.thin = true;
  return series;
}

// Returns the range from the first frame to the last, extended to a focus that is not far outside
// the sweep.
std::pair<double, double> XRange(const std::vector<double>& xs,
                                 const std::vector<PlotLine>& focus_lines) {
  const auto [lo, hi] = std::minmax_element(xs.begin(), xs.end());
  const double span = *hi - *lo;
  std::pair<double, double> range = {*lo, *hi};
  for (const PlotLine& line : focus_lines)
    if (line.position > *lo - span / 2 && line.position < *hi + span / 2)
      range = {std::min(range.first, line.position), std::max(range.second, line.position)};
  return range;
}

void AddModels(const FocusSweep& sweep, const Calibration& calibration,
               const std::optional<calib::BlurModel>& law, const std::pair<double, double>& x_range,
               Plot* plot) {
  if (law) {
    const CurvePoints curve = ModelCurve(*law, x_range);
    plot->series.push_back(Curve("fitted law", Ink::kFit, Stroke::kSolid, curve));
    plot->bands.push_back(ModelBand(*law, curve));
  }
  if (const auto side =
          calib::BlurModel::OfSide(sweep, calibration, calibration.diagnostics.nearer))
    plot->series.push_back(SideCurve("nearer side only", Stroke::kSolid, *side, x_range));
  if (const auto side =
          calib::BlurModel::OfSide(sweep, calibration, calibration.diagnostics.farther))
    plot->series.push_back(SideCurve("farther side only", Stroke::kDashed, *side, x_range));
}

std::string BlurCaption(const std::optional<calib::BlurModel>& law) {
  if (!law)
    return "No law was fitted to these points: the smallest blur should have frames on both sides.";
  std::string caption =
      "A good sweep has its smallest blur inside the sweep and both arms on the fitted curve; "
      "frames marked by rings were down-weighted, and those marked by crosses were left out";
  if (law->floor_from_frames())
    caption +=
        ", and the height of the curve's bottom is estimated from the points, since the floor was "
        "not "
        "determined";
  return caption + ".";
}

ReportFigure ResidualFigure(const calib::BlurFit& fit, BlurPoints points, const Abscissa& abscissa,
                            const std::pair<double, double>& x_range) {
  if (points.fitted_residuals.x.size() + points.doubted_residuals.x.size() < 2) return {};
  Plot plot;
  plot.id = "blur-residuals";
  plot.title = "Residuals of the blur fit";
  plot.x_axis.label = abscissa.label;
  plot.x_axis.range = x_range;
  plot.y_axis.label = "residual / sd";
  const double limit = 1.1 * std::clamp(points.largest_residual, 3.0, 8.0);
  plot.y_axis.range = {-limit, limit};
  plot.height_px = 210;
  plot.lines = {Level(0), Level(2), Level(-2)};
  plot.series = {std::move(points.fitted_residuals), std::move(points.doubted_residuals)};
  const std::string widened = Typeset(AsSentence(WidenedLine(fit)));
  return FigureOf(
      {plot},
      "Nearly all points should scatter between the dotted lines without a trend; a bow means that "
      "lens and model differ, and a single outlier that its reading or its frame is bad (each "
      "residual is in units of its standard deviation, from blur and "
      "reading)." +
          (widened.empty() ? "" : " " + widened));
}

}  // namespace

std::vector<ReportFigure> BlurFigures(const FocusSweep& sweep, const Calibration& calibration,
                                      const std::vector<ResultRow>& rows,
                                      const model::SweepTruth* truth, const Abscissa& abscissa) {
  const std::optional<calib::BlurModel> law =
      abscissa.is_depth ? calib::BlurModel::Of(sweep, calibration) : std::nullopt;
  BlurPoints points = BlurPointsOf(calibration, law, abscissa);
  if (points.xs.size() < 2) return {};
  Plot plot;
  plot.id = "blur";
  plot.title = "Blur against depth";
  plot.x_axis.label = abscissa.label;
  plot.y_axis.label = "blur sigma [px]";
  plot.height_px = 380;
  if (abscissa.is_depth) plot.lines = FocusLines(rows);
  // Both figures share this range.
  std::pair<double, double> x_range = XRange(points.xs, plot.lines);
  plot.series = {std::move(points.zhuo_sim), std::move(points.left_out), std::move(points.fitted),
                 std::move(points.doubted)};
  if (abscissa.is_depth) AddModels(sweep, calibration, law, x_range, &plot);
  if (truth != nullptr && abscissa.is_depth)
    plot.series.push_back(Curve("true law", Ink::kTruth, Stroke::kDashed,
                                ModelCurve(calib::BlurModel::OfTruth(sweep, *truth), x_range)));
  const double pad = 0.04 * (x_range.second - x_range.first);
  x_range = {x_range.first - pad, x_range.second + pad};
  plot.x_axis.range = x_range;
  return {FigureOf({plot}, BlurCaption(law)),
          ResidualFigure(calibration.diagnostics.blur, std::move(points), abscissa, x_range)};
}

ReportFigure ReadingErrorFigure(const FocusSweep& sweep, const Calibration& calibration,
                                const Abscissa& abscissa) {
  PlotSeries errors = Points("", Ink::kFit, Mark::kDot);
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!(frame.reading_error_sigma_mm > 0) || !frame.rejection.empty()) continue;
    AddPoint(&errors, abscissa.Of(frame), frame.reading_error_mm,
             PointName(frame, abscissa, "reading error [mm]", frame.reading_error_mm));
    errors.y_error.push_back(frame.reading_error_sigma_mm);
  }
  if (errors.x.size() < 2) return {};
  Plot plot;
  plot.id = "reading-errors";
  plot.title = "Errors of the bench readings";
  plot.x_axis.label = abscissa.label;
  plot.y_axis.label = "written − fitted [mm]";
  plot.height_px = 210;
  plot.lines = {Level(0)};
  const double stated_mm = sweep.reading_sigma_mm;
  if (stated_mm > 0)
    for (const double sign : {-1.0, 1.0}) plot.lines.push_back(Level(sign * 2 * stated_mm));
  plot.series = {std::move(errors)};
  std::string caption =
      "Difference of each written reading from the one that the fit estimates, with its standard "
      "deviation";
  if (stated_mm > 0)
    caption += fmt::format(
        "; nearly all should lie between the dotted lines, twice the stated "
        "{:.2g} mm",
        stated_mm);
  return FigureOf({plot},
                  caption + ". A step means a slipped clamp, a trend a scale in another unit.");
}

}  // namespace thicklens::tools
