#include "tools/bench/bench_calibration_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "thicklens/base/printable_text.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_report.h"
#include "tools/report/light_field_figures.h"
#include "tools/report/page_figures.h"
#include "tools/report/page_style.h"

namespace thicklens::tools {
namespace {

struct MethodLook {
  const char* method;
  Ink ink;
  Mark mark;
};
constexpr MethodLook kLooks[] = {{"fit", Ink::kFit, Mark::kDot},
                                 {"fit-no-field", Ink::kFit, Mark::kRing},
                                 {"peak", Ink::kPeak, Mark::kDiamond},
                                 {"source", Ink::kSource, Mark::kCross}};

std::string NameOf(const CalibrationRow& row) {
  return fmt::format("{}, {} frames of {} px", row.method, row.frames, row.field_px);
}

std::string ErrorHtml(const CalibrationErrors& errors) {
  return errors.count == 0 ? "–" : fmt::format("{:.3g}", errors.median_absolute);
}

std::string CoverageHtml(const IntervalCoverage& coverage) {
  return coverage.trials == 0 ? "–"
                              : fmt::format("{:.0f}, {:.0f}", 100 * coverage.fraction_68(),
                                            100 * coverage.fraction_95());
}

constexpr const char* kErrorNames[] = {"zf, mm",       "d1, µm",       "kappa, %",
                                       "zf: 68, 95 %", "d1: 68, 95 %", "kappa: 68, 95 %"};

std::vector<std::string> ErrorCellsHtml(const CalibrationRow& row) {
  return {ErrorHtml(row.focus_depth_mm),
          ErrorHtml(row.image_distance_um),
          ErrorHtml(row.blur_ratio_percent),
          CoverageHtml(row.focus_depth_mm.coverage),
          CoverageHtml(row.image_distance_um.coverage),
          CoverageHtml(row.blur_ratio_percent.coverage)};
}

std::string TableHtml(const std::vector<CalibrationRow>& rows) {
  std::string html = "<div class=\"wide\"><table>\n<thead><tr><th></th>";
  for (const char* name : {"seconds", "from–to", "refused", "in part"}) {
    html += fmt::format("<th class=\"number\">{}</th>", name);
  }
  for (const char* name : kErrorNames) html += fmt::format("<th class=\"number\">{}</th>", name);
  html += "</tr></thead>\n<tbody>\n";
  for (const CalibrationRow& row : rows) {
    const auto [least, most] = std::minmax_element(row.seconds.begin(), row.seconds.end());
    html += fmt::format("<tr{}><th scope=\"row\">{}</th>", row.on_front ? " class=\"chosen\"" : "",
                        EscapeXml(NameOf(row)));
    for (const std::string& cell :
         {fmt::format("{:.3g}", Median(row.seconds)), fmt::format("{:.3g}–{:.3g}", *least, *most),
          fmt::format("{}", row.refused), fmt::format("{}", row.partial)}) {
      html += TableCell(EscapeXml(cell));
    }
    for (const std::string& cell : ErrorCellsHtml(row)) {
      html += TableCell(EscapeXml(row.IsOfAllSweeps() ? cell : "–"));
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

// The errors of rows for which some sweeps gave no result.
std::string TableOfFewerHtml(const std::vector<CalibrationRow>& rows) {
  std::string body;
  for (const CalibrationRow& row : rows) {
    const int most = std::max(
        {row.focus_depth_mm.count, row.image_distance_um.count, row.blur_ratio_percent.count});
    if (row.IsOfAllSweeps() || most == 0) continue;
    body += fmt::format(
        "<tr><th scope=\"row\">{}</th>{}", EscapeXml(NameOf(row)),
        TableCell(fmt::format("{}, {}, {}", row.focus_depth_mm.count, row.image_distance_um.count,
                              row.blur_ratio_percent.count)));
    for (const std::string& cell : ErrorCellsHtml(row)) body += TableCell(EscapeXml(cell));
    body += "</tr>\n";
  }
  if (body.empty()) return "";
  std::string html =
      "<p>These rows are from fewer sweeps and cannot be compared with the rows above: a method "
      "refuses the harder sweeps.</p>\n<div class=\"wide\"><table>\n<thead><tr>"
      "<th></th><th class=\"number\">sweeps with zf, d1, kappa</th>";
  for (const char* name : kErrorNames) html += fmt::format("<th class=\"number\">{}</th>", name);
  return html + "</tr></thead>\n<tbody>\n" + body + "</tbody></table></div>\n";
}

}  // namespace

Plot CalibrationCostFigure(const std::vector<CalibrationRow>& rows) {
  Plot plot;
  plot.id = "prices-calibration";
  plot.title = "Median error of d1 against seconds of the calibration";
  plot.x_axis = {"seconds", std::nullopt, true};
  plot.y_axis = {"median error of d1, µm", std::nullopt, true};
  plot.height_px = 420;
  for (const MethodLook& look : kLooks) {
    PlotSeries series;
    series.label = look.method;
    series.ink = look.ink;
    series.mark = look.mark;
    for (const CalibrationRow& row : rows) {
      if (row.method != look.method || !row.IsComparable()) continue;
      series.x.push_back(Median(row.seconds));
      series.y.push_back(row.image_distance_um.median_absolute);
      series.names.push_back(fmt::format("{}: {:.3g} s, {:.3g} µm", NameOf(row),
                                         Median(row.seconds),
                                         row.image_distance_um.median_absolute));
    }
    plot.series.push_back(std::move(series));
  }
  std::vector<const CalibrationRow*> front;
  for (const CalibrationRow& row : rows) {
    if (row.on_front) front.push_back(&row);
  }
  std::sort(front.begin(), front.end(), [](const CalibrationRow* a, const CalibrationRow* b) {
    return Median(a->seconds) < Median(b->seconds);
  });
  std::vector<double> seconds, errors;
  for (const CalibrationRow* row : front) {
    seconds.push_back(Median(row->seconds));
    errors.push_back(row->image_distance_um.median_absolute);
    constexpr double kRoom = 1.15;  // a ratio of errors: the height of a line of text
    if (!plot.notes.empty() && kRoom * errors.back() > plot.notes.back().y) continue;
    plot.notes.push_back({NameOf(*row), seconds.back(), errors.back()});
  }
  plot.series.push_back(FrontLine(seconds, errors));
  return plot;
}

std::string CalibrationCostPage(const std::vector<CalibrationRow>& rows, const std::string& about) {
  constexpr char kTitle[] = "Accuracy and run time of calibrations";
  std::string html = PageHead("benchmark", kTitle, SvgPlotStyle() + LightFieldFigureStyle());
  html += fmt::format("<h1>{}</h1>\n<p class=\"under-title\">{}</p>\n", kTitle,
                      EscapeXml(PrintableUtf8(about)));
  html += Figure(SvgPlot(CalibrationCostFigure(rows)), "Each method, by frames and field",
                 "Median over the sweeps of the error of d1; down and to the left is better. "
                 "Pointing at a mark shows its name.");
  html += TableHtml(rows) + TableOfFewerHtml(rows);
  html +=
      "<p class=\"soft\">Bold: on the Pareto front. Errors: medians of magnitudes over all sweeps. "
      "68, 95: percentage of the stated intervals of that level that contain the truth. peak and "
      "source come from one run that ends before the fit.</p>\n";
  return html + "</main>\n</body>\n</html>\n";
}

}  // namespace thicklens::tools
