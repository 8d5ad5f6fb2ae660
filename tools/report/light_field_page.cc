#include "tools/report/light_field_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/estimate_figures.h"
#include "tools/report/light_field_figures.h"
#include "tools/report/light_field_origin.h"
#include "tools/report/page_images.h"
#include "tools/report/page_style.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {
namespace {

constexpr char kNone[] = "–";
// Smaller differences are due to rounding.
constexpr double kAlikeDb = 0.005;

std::string Paragraph(const std::string& text) {
  return text.empty() ? "" : fmt::format("<p>{}</p>\n", EscapeXml(text));
}

std::string Psnr(double psnr_db) {
  return std::isfinite(psnr_db) ? TrueMinus(fmt::format("{:.2f}", psnr_db)) : "∞";
}

std::string Optional(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : kNone;
}

int PresentViews(const model::LightField& light_field) {
  return light_field.present.empty()
             ? light_field.u_count * light_field.v_count
             : static_cast<int>(
                   std::count(light_field.present.begin(), light_field.present.end(), true));
}

std::string WithSigma(const model::Estimate& estimate) {
  if (!(estimate.sigma > 0)) return RoundedTo(estimate.value, 0);
  return fmt::format("{}\u00A0±\u00A0{}", RoundedTo(estimate.value, estimate.sigma),
                     RoundedSigma(estimate.sigma));
}

// Describes the evidence for the calibrated values.
std::string EvidenceInWords(const model::Evidence& evidence) {
  if (evidence.method == "assumed") return " (assumed, not measured)";
  if (evidence.method == "simulated") return " (true values of a simulated camera, not measured)";
  if (evidence.frames_used > 0)
    return fmt::format(" (calibrated from {})", Counted(evidence.frames_used, "frame"));
  return evidence.method.empty() ? "" : fmt::format(" (by {})", PrintableUtf8(evidence.method));
}

std::string CameraInWords(const model::LightField& light_field) {
  if (!light_field.camera)
    return "There is no camera: distances are disparities, in px from view to view.";
  const model::Camera& camera = *light_field.camera;
  if (!camera.calibration) return fmt::format("Camera {}.", PrintableUtf8(camera.name));
  const model::CameraCalibration& calibration = *camera.calibration;
  std::vector<std::string> found;
  if (calibration.image_distance_mm)
    found.push_back(
        fmt::format("image distance d1 = {}\u00A0mm", WithSigma(*calibration.image_distance_mm)));
  if (calibration.blur_ratio)
    found.push_back(fmt::format("blur ratio κ = {}", WithSigma(*calibration.blur_ratio)));
  if (calibration.evidence.focus_depth_mm)
    found.push_back(
        fmt::format("in focus at {}\u00A0mm", WithSigma(*calibration.evidence.focus_depth_mm)));
  return fmt::format("Camera {}: {}{}.", PrintableUtf8(camera.name), fmt::join(found, ", "),
                     found.empty() ? "nothing calibrated" : EvidenceInWords(calibration.evidence));
}

// "lower than the estimate by 1.20 dB"
std::string DibrAgainst(double dibr_db, double estimate_db) {
  const double gain_db = dibr_db - estimate_db;
  if (dibr_db == estimate_db || std::abs(gain_db) < kAlikeDb) return "the same as the estimate";
  if (!std::isfinite(gain_db)) return gain_db > 0 ? "better" : "worse";
  return fmt::format("{:.2f}\u00A0dB {} than the estimate", std::abs(gain_db),
                     gain_db > 0 ? "better" : "worse");
}

bool DibrIsBetter(const LightFieldPageInput& input) {
  return input.comparison && input.comparison->dibr_mean &&
         input.comparison->dibr_mean->psnr_db - input.comparison->mean.psnr_db >= kAlikeDb;
}

std::string QualityInWords(const LightFieldPageInput& input) {
  if (!input.comparison) return "";
  const ComparisonRecord& comparison = *input.comparison;
  std::string text = fmt::format("Against the true views: PSNR {}\u00A0dB in the mean",
                                 Psnr(comparison.mean.psnr_db));
  if (comparison.centre)
    text += fmt::format(", {}\u00A0dB in the centre", Psnr(comparison.centre->psnr_db));
  if (comparison.corner)
    text += fmt::format(", {}\u00A0dB in the corners", Psnr(comparison.corner->psnr_db));
  text += ".";
  if (!comparison.dibr_mean) return text;
  text += fmt::format(
      " The baseline, depth-image-based rendering (DIBR: the photograph warped to each view by its "
      "depth), reaches {}\u00A0dB in the mean: {}",
      Psnr(comparison.dibr_mean->psnr_db),
      DibrAgainst(comparison.dibr_mean->psnr_db, comparison.mean.psnr_db));
  if (comparison.dibr_centre && comparison.centre)
    text += fmt::format("; in the centre {}\u00A0dB, {}", Psnr(comparison.dibr_centre->psnr_db),
                        DibrAgainst(comparison.dibr_centre->psnr_db, comparison.centre->psnr_db));
  text += ".";
  if (comparison.views_above_dibr && !comparison.views.empty())
    text += fmt::format(" The estimate is above DIBR in {} of {} views.",
                        *comparison.views_above_dibr, comparison.views.size());
  return text;
}

std::string Outcome(const LightFieldPageInput& input) {
  const std::string views = Counted(PresentViews(*input.light_field), "view");
  std::string outcome = IsEstimated(input) ? fmt::format("{} from one photograph", views) : views;
  if (!input.comparison || !input.comparison->dibr_mean) return outcome;
  const double gain_db = input.comparison->mean.psnr_db - input.comparison->dibr_mean->psnr_db;
  if (DibrIsBetter(input)) return outcome + "; warping by depth (DIBR) is better here";
  return outcome + (gain_db >= kAlikeDb ? ", better than warping by depth (DIBR)"
                                        : ", as good as warping by depth (DIBR)");
}

std::string Warnings(const LightFieldPageInput& input) {
  if (input.warnings.empty()) return "";
  std::string items;
  for (const std::string& warning : input.warnings)
    items += fmt::format("<li>{}</li>\n", EscapeXml(warning));
  return "<ul class=\"warnings\">\n" + items + "</ul>\n";
}

std::string Summary(const LightFieldPageInput& input) {
  const bool judged = input.comparison && input.comparison->dibr_mean;
  std::string html = fmt::format("<div class=\"verdict {}\">\n<p class=\"outcome\">{}</p>\n",
                                 !judged               ? "plain"
                                 : DibrIsBetter(input) ? "partial"
                                                       : "ok",
                                 EscapeXml(Outcome(input)));
  html += Paragraph(RunInWords(input));
  html += Paragraph(CameraInWords(*input.light_field));
  html += Paragraph(QualityInWords(input));
  html += Warnings(input);
  return html + "</div>\n";
}

std::string ScoreCells(const std::optional<ScoresRecord>& scores) {
  if (!scores) {
    std::string none;
    for (int i = 0; i < 4; ++i) none += TableCell(kNone);
    return none;
  }
  return TableCell(Psnr(scores->psnr_db)) + TableCell(Optional(scores->ssim, 4)) +
         TableCell(Optional(scores->delta_e94_mean, 3)) +
         TableCell(Optional(scores->macade_standin, 4));
}

std::string ScoresTable(const ComparisonRecord& comparison) {
  std::string html =
      "<div class=\"wide\"><table>\n<thead><tr><th>views</th><th>by</th>"
      "<th class=\"number\">PSNR [dB]</th><th class=\"number\">SSIM</th>"
      "<th class=\"number\">mean ΔE94</th><th class=\"number\">edge orientation</th></tr></thead>\n"
      "<tbody>\n";
  struct Row {
    const char* views;
    std::optional<ScoresRecord> estimate, dibr;
  };
  for (const Row& row : {Row{"mean", comparison.mean, comparison.dibr_mean},
                         Row{"centre", comparison.centre, comparison.dibr_centre},
                         Row{"corners", comparison.corner, comparison.dibr_corner}}) {
    if (row.estimate)
      html += fmt::format("<tr><th scope=\"rowgroup\" rowspan=\"{}\">{}</th>", row.dibr ? 2 : 1,
                          row.views) +
              TableCell("estimate", "chosen") + ScoreCells(row.estimate) + "</tr>\n";
    if (row.estimate && row.dibr)
      html += "<tr>" + TableCell("DIBR", "soft") + ScoreCells(row.dibr) + "</tr>\n";
  }
  std::string area;
  if (comparison.u_count > 0 && comparison.s_count > 0) {
    area = fmt::format(", {} views of {} px{}", Times(comparison.u_count, comparison.v_count),
                       Times(comparison.s_count, comparison.t_count),
                       comparison.border_px.value_or(0) > 0
                           ? fmt::format(" without a border of {} px", *comparison.border_px)
                           : std::string());
  }
  return html +
         fmt::format(
             "</tbody></table></div>\n<p class=\"soft\">Against the true views{}, on stored "
             "values. PSNR, ",
             area) +
         "SSIM and edge orientation (the similarity of the directions of edges, an approximation "
         "of MACADE, whose definition is not available): higher is better. ΔE94, the perceived "
         "colour difference: lower is better. DIBR is the photograph warped to each view by its "
         "depth.</p>\n";
}

// Returns black or white, whichever is easier to read on the colour.
std::string InkOn(double position) {
  const auto colour = MapColour(position);
  const double luma = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2];
  return luma > 110 ? "#10141a" : "#ffffff";
}

std::string HeatTable(const std::vector<ViewRecord>& views) {
  if (views.size() < 2) return "";
  int u_last = 0, v_last = 0, worse = 0, judged = 0;
  ColourRange range{std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity(), false};
  for (const ViewRecord& view : views) {
    u_last = std::max(u_last, view.u);
    v_last = std::max(v_last, view.v);
    if (view.dibr_psnr_db) ++judged;
    if (!std::isfinite(view.psnr_db)) continue;
    range.lo = std::min(range.lo, view.psnr_db);
    range.hi = std::max(range.hi, view.psnr_db);
  }
  std::string rows;
  for (int v = 0; v <= v_last; ++v) {
    rows += fmt::format("<tr><th scope=\"row\">v {}</th>", v);
    for (int u = 0; u <= u_last; ++u) {
      const auto view = std::find_if(views.begin(), views.end(), [&](const ViewRecord& entry) {
        return entry.u == u && entry.v == v;
      });
      if (view == views.end()) {
        rows += "<td>–</td>";
        continue;
      }
      const bool below = view->dibr_psnr_db && view->psnr_db < *view->dibr_psnr_db;
      if (below) ++worse;
      const double position = std::isfinite(view->psnr_db) ? range.Position(view->psnr_db) : 1;
      rows += fmt::format("<td style=\"background: {}; color: {}\" title=\"{}\">{}{}</td>",
                          MapColourCss(position), InkOn(position),
                          view->dibr_psnr_db
                              ? fmt::format("estimate {}, DIBR {} dB", Psnr(view->psnr_db),
                                            Psnr(*view->dibr_psnr_db))
                              : fmt::format("{} dB", Psnr(view->psnr_db)),
                          std::isfinite(view->psnr_db) ? fmt::format("{:.1f}", view->psnr_db) : "∞",
                          below ? "\u00A0▾" : "");
    }
    rows += "</tr>\n";
  }
  std::string html =
      "<h3>PSNR of each view [dB]</h3>\n<div class=\"wide\"><table class=\"heat\">\n"
      "<thead><tr><th></th>";
  for (int u = 0; u <= u_last; ++u) html += fmt::format("<th>u {}</th>", u);
  html += "</tr></thead>\n<tbody>\n" + rows + "</tbody></table></div>\n<p class=\"soft\">";
  html +=
      "The table shows the positions of the views in the aperture; yellow is best. Views far from "
      "the centre show areas that the photograph does not and are expected to be worse.";
  if (judged > 0)
    html += worse > 0 ? fmt::format(" ▾ marks the {} of {} where DIBR is better.", worse, judged)
                      : std::string(" DIBR is better in none of them.");
  return html + "</p>\n";
}

std::string Numbers(const LightFieldPageInput& input) {
  if (!input.comparison) return "";
  return ScoresTable(*input.comparison) + HeatTable(input.comparison->views);
}

}  // namespace

LightFieldPage MakeLightFieldPage(const LightFieldPageInput& input) {
  const std::string title =
      IsEstimated(input) ? "A light field from one photograph" : "A light field";
  LightFieldPage page;
  page.html = PageHead(kLightFieldPage, title,
                       SvgPlotStyle() + LightFieldFigureStyle() + EstimateFigureStyle());
  page.html +=
      fmt::format("<h1>{}</h1>\n<p class=\"under-title\">{}</p>\n", title,
                  EscapeXml(fmt::format(
                      "{} · {} views of {} px · {}", input.name,
                      Times(input.light_field->u_count, input.light_field->v_count),
                      Times(input.light_field->s_count, input.light_field->t_count), input.date)));
  const auto add = [&page](const std::string& id, const std::string& heading,
                           const std::string& content) {
    if (content.empty()) return;
    page.sections.push_back(id);
    page.html += fmt::format(
        "<section id=\"{}\">\n{}{}</section>\n", id,
        heading.empty() ? "" : fmt::format("<h2>{}</h2>\n", EscapeXml(heading)), content);
  };
  add("summary", "", Summary(input));
  add("sweep", "The focus sweep", SweepFigure(input));
  add("calibration", "",
      input.calibration.empty() ? ""
                                : "<div class=\"inlined\">\n" + input.calibration + "</div>\n");
  add("image", "Input of the estimate", ImageAndDepthFigure(input));
  add("residual", "Residual", ResidualFigure(input));
  add("confidence", "Observed and filled-in areas", ConfidenceFigure(input));
  add("views", "The views", ViewFigures(input));
  add("epipolar", "The scene points as lines", EpipolarFigure(input));
  add("refocus", "Refocused", RefocusFigure(input));
  add("numbers", "Accuracy", Numbers(input));
  add("how", "How it was made", HowItWasMade(input));
  page.html += "</main>\n</body>\n</html>\n";
  return page;
}

}  // namespace thicklens::tools
