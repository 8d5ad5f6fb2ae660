#include "tools/bench/cost_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/printable_text.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_report.h"
#include "tools/report/light_field_figures.h"
#include "tools/report/page_figures.h"
#include "tools/report/page_style.h"

namespace thicklens::tools {
namespace {

struct SolverLook {
  const char* solver;
  Ink ink;
  Mark mark;
};
constexpr SolverLook kLooks[] = {{"scene", Ink::kFit, Mark::kDot},
                                 {"functional", Ink::kPeak, Mark::kDiamond},
                                 {"grid", Ink::kTruth, Mark::kRing},
                                 {"blocks", Ink::kSource, Mark::kCross}};

std::vector<const CostRow*> FrontOf(const std::vector<CostRow>& rows) {
  std::vector<const CostRow*> front;
  for (const CostRow& row : rows) {
    if (row.on_front) front.push_back(&row);
  }
  std::sort(front.begin(), front.end(), [](const CostRow* a, const CostRow* b) {
    return Median(a->seconds) < Median(b->seconds);
  });
  return front;
}

// The names of the points of the front, as far as there is room for them.
std::vector<PlotNote> FrontNotes(const std::vector<const CostRow*>& front) {
  constexpr double kRoom = 1.15;  // a ratio of errors: the height of a line of text
  std::vector<PlotNote> notes;
  for (const CostRow* row : front) {
    const double error = ErrorGreyLevels(row->scores.psnr_mean_db);
    if (row->is_warping || (!notes.empty() && kRoom * error > notes.back().y)) continue;
    notes.push_back({row->Name(), Median(row->seconds), error});
  }
  return notes;
}

std::string Cells(const CostRow& row) {
  if (!row.failure.empty()) {
    return fmt::format("<td colspan=\"12\">{}</td>", EscapeXml(row.failure));
  }
  const auto [least, most] = std::minmax_element(row.seconds.begin(), row.seconds.end());
  const auto seconds = [&](bool is_extrapolated) {
    return row.sample.has_value() == is_extrapolated ? fmt::format("{:.3g}", Median(row.seconds))
                                                     : std::string("–");
  };
  const auto or_dash = [](const auto& value, const char* form) {
    return value ? fmt::format(fmt::runtime(form), *value) : std::string("–");
  };
  std::string cells;
  for (const std::string& cell :
       {seconds(false), seconds(true), fmt::format("{:.3g}–{:.3g}", *least, *most),
        or_dash(row.peak_memory_mib, "{:.0f}"), or_dash(row.iterations, "{}"),
        or_dash(row.relative_residual, "{:.0e}"), or_dash(row.rcond, "{:.0e}"),
        fmt::format("{:.2f}", row.scores.psnr_mean_db),
        fmt::format("{:.2f}", row.scores.psnr_centre_db),
        fmt::format("{:.2f}", row.scores.psnr_corner_db),
        fmt::format("{:.4f}", row.scores.ssim_mean), fmt::format("{:.1f}", row.reprojection_db)}) {
    cells += TableCell(EscapeXml(TrueMinus(cell)));
  }
  return cells;
}

std::string TableOf(const std::vector<CostRow>& rows) {
  std::string html =
      "<div class=\"wide\"><table>\n<thead><tr><th></th><th class=\"number\">seconds, measured</th>"
      "<th class=\"number\">seconds, extrapolated</th>"
      "<th class=\"number\">from–to</th><th class=\"number\">MiB</th>"
      "<th class=\"number\">iterations</th><th class=\"number\">residual</th>"
      "<th class=\"number\">rcond</th><th class=\"number\">PSNR, dB</th>"
      "<th class=\"number\">centre</th><th class=\"number\">corner</th>"
      "<th class=\"number\">SSIM</th><th class=\"number\">image again, dB</th></tr></thead>\n"
      "<tbody>\n";
  for (const CostRow& row : rows) {
    html += fmt::format("<tr{}><th scope=\"row\">{}</th>{}</tr>\n",
                        row.on_front ? " class=\"chosen\"" : "", EscapeXml(row.Name()), Cells(row));
  }
  return html + "</tbody></table></div>\n";
}

std::string ScoredParagraph(const std::vector<CostRow>& rows) {
  for (const CostRow& row : rows) {
    if (!row.failure.empty()) continue;
    return fmt::format("<p class=\"soft\">Scores are for {}.</p>\n", ScoredAreaText(row.scored));
  }
  return "";
}

}  // namespace

std::vector<std::vector<CostRow>> CostGroups(const std::vector<CostRow>& rows) {
  std::vector<std::vector<CostRow>> groups;
  for (const CostRow& row : rows) {
    const auto of_row = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
      return group.front().scene == row.scene && group.front().views == row.views;
    });
    if (of_row == groups.end()) {
      groups.push_back({row});
    } else {
      of_row->push_back(row);
    }
  }
  return groups;
}

Plot CostFigure(const std::vector<CostRow>& rows, const std::string& id) {
  Plot plot;
  plot.id = id;
  plot.title = fmt::format("Error of the true views against seconds: {0}, {1} by {1} views",
                           PrintableUtf8(rows.front().scene), rows.front().views);
  plot.heading =
      fmt::format("{0}, {1} × {1} views", PrintableUtf8(rows.front().scene), rows.front().views);
  plot.x_axis = {"seconds", std::nullopt, true};
  plot.y_axis = {"error of the true views, grey levels", std::nullopt, true};
  plot.height_px = 420;
  for (const SolverLook& look : kLooks) {
    PlotSeries series;
    series.label = look.solver;
    series.ink = look.ink;
    series.mark = look.mark;
    for (const CostRow& row : rows) {
      if (row.is_warping || row.plan.solver != look.solver || !row.failure.empty()) continue;
      if (row.sample) series.label = std::string(look.solver) + " (extrapolated seconds)";
      series.x.push_back(Median(row.seconds));
      series.y.push_back(ErrorGreyLevels(row.scores.psnr_mean_db));
      series.names.push_back(fmt::format("{}: {:.3g} s{}, {:.2f} dB", row.Name(),
                                         Median(row.seconds), row.sample ? " extrapolated" : "",
                                         row.scores.psnr_mean_db));
    }
    plot.series.push_back(std::move(series));
  }
  const std::vector<const CostRow*> front = FrontOf(rows);
  std::vector<double> seconds, errors;
  for (const CostRow* row : front) {
    seconds.push_back(Median(row->seconds));
    errors.push_back(ErrorGreyLevels(row->scores.psnr_mean_db));
  }
  plot.series.push_back(FrontLine(seconds, errors));
  plot.notes = FrontNotes(front);
  for (const CostRow& row : rows) {
    if (!row.is_warping || !row.failure.empty()) continue;
    plot.lines.push_back({fmt::format("warping alone (DIBR), {:.2g} s", Median(row.seconds)),
                          Ink::kMuted, Stroke::kDashed, false,
                          ErrorGreyLevels(row.scores.psnr_mean_db)});
  }
  return plot;
}

std::string CostPage(const std::vector<CostRow>& rows, const std::string& about) {
  constexpr char kTitle[] = "Accuracy and run time";
  std::string html = PageHead("benchmark", kTitle, SvgPlotStyle() + LightFieldFigureStyle());
  html += fmt::format("<h1>{}</h1>\n<p class=\"under-title\">{}</p>\n", kTitle, EscapeXml(about));
  int number = 0;
  for (const std::vector<CostRow>& group : CostGroups(rows)) {
    const std::string heading = fmt::format(
        "{0}, {1} × {1} views", PrintableUtf8(group.front().scene), group.front().views);
    html += fmt::format("<section>\n<h2>{}</h2>\n", EscapeXml(heading));
    html += Figure(SvgPlot(CostFigure(group, fmt::format("prices-{}", ++number))),
                   "Run time and error of each way to the views",
                   "Rms difference from the true views, in grey levels of 255; down and to the "
                   "left is better. Pointing at a mark shows its name.");
    html += ScoredParagraph(group) + TableOf(group) + "</section>\n";
  }
  html +=
      "<p class=\"soft\">Bold: on the Pareto front, which uses extrapolated seconds as they are. "
      "Extrapolated: from four parts of the image, with the worst of their iterations, residuals "
      "and rcond. MiB: largest increase of memory during the run. PSNR, SSIM and the image again "
      "refer to the same area in all rows of a table, which its heading names. Image again: the "
      "PSNR of the photograph computed from the views; a wrong light field can have a high one, "
      "too.</p>\n";
  return html + "</main>\n</body>\n</html>\n";
}

}  // namespace thicklens::tools
