#include "tools/report/light_field_origin.h"

#include <fmt/format.h>

#include <optional>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {

bool IsEstimated(const LightFieldPageInput& input) {
  // The solver without the method that filled its occluded rays: "scene" of "scene+telea".
  const std::string& whole = input.light_field->origin.method;
  const std::string method = whole.substr(0, whole.find('+'));
  return input.estimate || method == "scene" || method == "blocks" || method == "functional" ||
         method == "grid";
}

std::string Times(int a, int b) { return fmt::format("{}\u00A0×\u00A0{}", a, b); }

std::string Counted(int count, const std::string& what) {
  return fmt::format("{}\u00A0{}{}", count, what, count == 1 ? "" : "s");
}

namespace {

// Returns the origin of the light field: the record of the run if there is one, otherwise the light
// field's file.
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
  record.prior = origin.prior;
  record.strength = origin.strength;
  record.noise_sigma = origin.noise_sigma;
  record.iterations = origin.iterations;
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
  if (record.files_seconds) text += fmt::format(", files {:.2f}", *record.files_seconds);
  return text;
}

// All solvers except scene have one prior, which their ridge mu determines.
bool RidgeTellsPrior(const EstimateRecord& record) {
  return record.ridge && record.prior == "ridge";
}

std::string PriorInWords(const EstimateRecord& record) {
  if (RidgeTellsPrior(record)) return "";
  return record.prior == "tv" ? "total variation" : record.prior;
}

std::string StrengthInWords(const EstimateRecord& record) {
  if (!record.strength || RidgeTellsPrior(record)) return "";
  return fmt::format(
      "{:.3g}{}", *record.strength,
      record.strength_rule.empty() ? "" : fmt::format(" ({})", record.strength_rule));
}

std::string GreyLevels(const std::optional<double>& stored) {
  return stored ? fmt::format("{:.2f} grey levels", 255 * *stored) : "";
}

std::string Percent(const std::optional<double>& share) {
  return share ? fmt::format("{:.1f} %", 100 * *share) : "";
}

std::string IterationsInWords(const EstimateRecord& record) {
  if (!record.iterations) return "";
  return fmt::format("{}{}", *record.iterations,
                     record.converged == false ? ", not converged" : "");
}

}  // namespace

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
  else if (!record.prior.empty())
    text += fmt::format(" (prior {})", PrintableUtf8(record.prior));
  if (record.total_seconds) text += fmt::format(" in {:.1f}\u00A0s", *record.total_seconds);
  if (record.peak_rss_mib)
    text += fmt::format(" with at most {:.0f}\u00A0MiB of memory", *record.peak_rss_mib);
  return text + ".";
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
  for (const auto& [what, source] : input.sources) rows += OriginRow(what, source);
  rows += OriginRow("prior", PriorInWords(record));
  rows += OriginRow("strength of the prior", StrengthInWords(record));
  rows += OriginRow("noise of the photograph", GreyLevels(record.noise_sigma));
  rows += OriginRow("residual of the photograph (rms)", GreyLevels(record.residual_rms));
  rows += OriginRow("rays that the centre view does not show", Percent(record.occluded_fraction));
  rows += OriginRow("pixels whose blur is computed one by one (occlusions, steep surfaces)",
                    Percent(record.row_share));
  rows += OriginRow("iterations", IterationsInWords(record));
  rows += OriginRow("solver of a block", record.block_solver);
  rows += OriginRow("stencil of the smoothness", record.stencil);
  rows += OriginRow("rays reach the pixels by", record.splat);
  rows += OriginRow("smoothness gamma", number(record.gamma, "{:.6g}"));
  rows += OriginRow("ridge mu", number(record.ridge, "{:.4g}"));
  rows += OriginRow("edge of a block", count(record.block_px, " px"));
  rows += OriginRow("blocks", count(record.blocks, ""));
  rows += OriginRow(record.iterations ? "relative residual" : "largest relative residual",
                    number(record.relative_residual, "{:.2e}"));
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

}  // namespace thicklens::tools
