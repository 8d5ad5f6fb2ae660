#include "light_field_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "calibration_summary.h"
#include "light_field_figures.h"
#include "page_pictures.h"
#include "page_style.h"
#include "svg_plot.h"

namespace thicklens::tools {
namespace {

constexpr char kNone[] = "–";
// Differences below are what rounding alone makes.
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

std::string Times(int a, int b) { return fmt::format("{}\u00A0×\u00A0{}", a, b); }

// "1 view", "49 views".
std::string Counted(int count, const std::string& what) {
  return fmt::format("{}\u00A0{}{}", count, what, count == 1 ? "" : "s");
}

int PresentViews(const model::LightField& light_field) {
  return light_field.present.empty()
             ? light_field.u_count * light_field.v_count
             : static_cast<int>(
                   std::count(light_field.present.begin(), light_field.present.end(), true));
}

// Every solver of this program writes its name there; "simulated" and "imported" are no estimates.
bool IsEstimated(const LightFieldPageInput& input) {
  const std::string& method = input.light_field->origin.method;
  return input.estimate || method == "blocks";
}

// What made the light field: the record of the run if there is one, else the light field's file.
EstimateRecord Origin(const LightFieldPageInput& input) {
  if (input.estimate) return *input.estimate;
  const model::LightField& light_field = *input.light_field;
  const model::LightFieldOrigin& origin = light_field.origin;
  EstimateRecord record;
  record.solver = origin.method;
  record.u_count = light_field.u_count;
  record.v_count = light_field.v_count;
  record.s_count = light_field.s_count;
  record.t_count = light_field.t_count;
  record.block_solver = origin.block_solver;
  record.stencil = origin.stencil;
  record.splat = origin.splat;
  record.device = origin.device;
  record.gamma = origin.gamma;
  record.ridge = origin.ridge;
  record.block_px = origin.block_px;
  record.total_seconds = origin.seconds;
  record.relative_residual = origin.relative_residual;
  record.rcond_min = origin.rcond_min;
  if (!origin.method.empty() && (IsEstimated(input) || !origin.effects.empty()))
    record.effects = origin.effects;
  return record;
}

std::string WithSigma(const model::Estimate& estimate) {
  if (!(estimate.sigma > 0)) return RoundedTo(estimate.value, 0);
  return fmt::format("{}\u00A0±\u00A0{}", RoundedTo(estimate.value, estimate.sigma),
                     RoundedSigma(estimate.sigma));
}

// What the calibrated values rest on.
std::string EvidenceInWords(const model::Evidence& evidence) {
  if (evidence.method == "assumed") return " (assumed, not measured)";
  if (evidence.method == "simulated") return " (of a simulated camera: true, not measured)";
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

std::string RunInWords(const LightFieldPageInput& input) {
  const EstimateRecord record = Origin(input);
  const model::LightField& light_field = *input.light_field;
  std::string text =
      fmt::format("{} views of {} px in {}", Times(light_field.u_count, light_field.v_count),
                  Times(light_field.s_count, light_field.t_count),
                  light_field.channels == 3 ? "colour" : "grey");
  if (!IsEstimated(input))
    return text +
           (record.solver.empty() ? "." : fmt::format(", {}.", PrintableUtf8(record.solver)));
  text += fmt::format(", estimated from one photograph and its depth map by the solver {}",
                      PrintableUtf8(record.solver));
  if (record.block_px)
    text +=
        fmt::format(" ({} of {}\u00A0px)",
                    record.blocks ? Counted(*record.blocks, "block") : "blocks", *record.block_px);
  if (record.total_seconds) text += fmt::format(" in {:.1f}\u00A0s", *record.total_seconds);
  if (record.peak_rss_mib)
    text += fmt::format(" with at most {:.0f}\u00A0MiB of memory", *record.peak_rss_mib);
  return text + ".";
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
      " The plain alternative, the photograph warped to each view by its depth (DIBR), reaches "
      "{}\u00A0dB in the mean: {}",
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
      "<th class=\"number\">mean ΔE94</th><th class=\"number\">MACADE stand-in</th></tr></thead>\n"
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
  return html +
         "</tbody></table></div>\n<p class=\"soft\">Against the true views, on stored values. "
         "PSNR, "
         "SSIM and the MACADE stand-in (agreement of edge directions; the definition of MACADE "
         "itself could not be had): higher is better. ΔE94, the difference of colours as seen: "
         "lower is better. DIBR is the photograph warped to each view by its depth.</p>\n";
}

// Black or white, whichever is read more easily on the colour.
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
      "Where the views lie in the aperture; yellow is best. Views far from the centre see what "
      "the photograph does not and are expected to be worse.";
  if (judged > 0)
    html += worse > 0 ? fmt::format(" ▾ marks the {} of {} where DIBR is better.", worse, judged)
                      : std::string(" DIBR is better in none of them.");
  return html + "</p>\n";
}

std::string Numbers(const LightFieldPageInput& input) {
  if (!input.comparison) return "";
  return ScoresTable(*input.comparison) + HeatTable(input.comparison->views);
}

std::string OriginRow(const std::string& label, const std::string& value) {
  if (value.empty()) return "";
  return fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", EscapeXml(label),
                     EscapeXml(value));
}

std::string Seconds(const EstimateRecord& record) {
  if (!record.total_seconds) return "";
  std::string text = fmt::format("{:.2f} s", *record.total_seconds);
  if (record.setup_seconds && record.solve_seconds && record.views_seconds)
    text += fmt::format(": set-up {:.2f}, solve {:.2f}, views {:.2f}", *record.setup_seconds,
                        *record.solve_seconds, *record.views_seconds);
  return text;
}

std::string HowItWasMade(const LightFieldPageInput& input) {
  const EstimateRecord record = Origin(input);
  const auto number = [](const std::optional<double>& value, const char* format) {
    return value ? fmt::format(fmt::runtime(format), *value) : std::string();
  };
  const auto count = [](const std::optional<int>& value, const std::string& unit) {
    return value ? fmt::format("{}{}", *value, unit) : std::string();
  };
  std::string rows;
  rows += OriginRow(IsEstimated(input) ? "solver" : "made by", record.solver);
  rows += OriginRow("solver of a block", record.block_solver);
  rows += OriginRow("stencil of the smoothness", record.stencil);
  rows += OriginRow("rays reach the pixels by", record.splat);
  rows += OriginRow("smoothness gamma", number(record.gamma, "{:.6g}"));
  rows += OriginRow("ridge mu", number(record.ridge, "{:.4g}"));
  rows += OriginRow("edge of a block", count(record.block_px, " px"));
  rows += OriginRow("blocks", count(record.blocks, ""));
  rows += OriginRow("largest relative residual", number(record.relative_residual, "{:.2e}"));
  rows += OriginRow("smallest rcond", number(record.rcond_min, "{:.2e}"));
  if (record.effects)
    rows += OriginRow(
        "effects of image formation",
        record.effects->empty() ? "none" : fmt::format("{}", fmt::join(*record.effects, ", ")));
  rows += OriginRow("holes of the depth map filled", count(record.holes_filled, " px"));
  rows += OriginRow("device", record.device);
  rows += OriginRow("threads", count(record.threads, ""));
  rows += OriginRow("time", Seconds(record));
  rows += OriginRow("peak memory", number(record.peak_rss_mib, "{:.0f} MiB"));
  const model::LightFieldOrigin& origin = input.light_field->origin;
  rows += OriginRow("made with thicklens", origin.version);
  rows += OriginRow("on", origin.date);
  const std::string table =
      rows.empty() ? ""
                   : "<div class=\"wide\"><table>\n<tbody>\n" + rows + "</tbody></table></div>\n";
  return table + fmt::format("<p class=\"soft\">This page: thicklens {}, {}.</p>\n",
                             EscapeXml(input.version), EscapeXml(input.date));
}

}  // namespace

LightFieldPage MakeLightFieldPage(const LightFieldPageInput& input) {
  const std::string title =
      IsEstimated(input) ? "A light field from one photograph" : "A light field";
  LightFieldPage page;
  page.html = PageHead(title, SvgPlotStyle() + LightFieldFigureStyle());
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
  add("picture", "What the estimate starts from", PictureAndDepthFigure(input));
  add("views", "The views", ViewFigures(input));
  add("epipolar", "The scene points as lines", EpipolarFigure(input));
  add("refocus", "Refocused", RefocusFigure(input));
  add("numbers", "How good it is", Numbers(input));
  add("how", "How it was made", HowItWasMade(input));
  page.html += "</main>\n</body>\n</html>\n";
  return page;
}

}  // namespace thicklens::tools
