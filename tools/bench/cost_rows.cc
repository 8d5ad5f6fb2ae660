#include "tools/bench/cost_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/printable_text.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/pareto_front.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

std::string OrDash(const std::optional<double>& value, const char* form) {
  return value ? fmt::format(fmt::runtime(form), *value) : "-";
}

std::string GroupOf(const CostRow& row) { return fmt::format("{} {}", row.scene, row.views); }

// Returns the groups in the order of their first rows.
std::vector<std::string> GroupsOf(const std::vector<CostRow>& rows) {
  std::vector<std::string> groups;
  for (const CostRow& row : rows) {
    if (std::find(groups.begin(), groups.end(), GroupOf(row)) == groups.end()) {
      groups.push_back(GroupOf(row));
    }
  }
  return groups;
}

// Quotes a cell of a table of comma-separated values.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : PrintableUtf8(text)) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string RowText(const CostRow& row) {
  const std::string begin = fmt::format("{:<2}{:<32}", row.on_front ? ">" : "", row.Name());
  if (!row.failure.empty()) return fmt::format("{}  {}\n", begin, row.failure);
  // For a sample, only the extrapolated time contains the time of solving.
  const auto measured = [&](const std::vector<double>& seconds) {
    return row.sample ? std::string("-") : fmt::format("{:.2g}", Median(seconds));
  };
  return fmt::format(
      "{}{:>10}{:>10}{:>16}{:>8.2g}{:>8}{:>8}{:>6}{:>7}{:>9}{:>8}{:>7.2f}{:>7.2f}{:>7.2f}"
      "{:>7.3f}{:>6.1f}{}\n",
      begin, row.time().MeasuredCell(), row.time().ExtrapolatedCell(), row.time().RangeCell(),
      Median(row.setup_seconds), measured(row.solve_seconds), measured(row.views_seconds),
      OrDash(row.peak_memory_mib, "{:.0f}"),
      row.iterations ? fmt::format("{}", *row.iterations) : "-",
      OrDash(row.relative_residual, "{:.0e}"), OrDash(row.rcond, "{:.0e}"), row.scores.psnr_mean_db,
      row.scores.psnr_centre_db, row.scores.psnr_corner_db, row.scores.ssim_mean,
      row.reprojection_db, row.converged ? "" : "  not converged");
}

}  // namespace

void MarkFront(std::vector<CostRow>* rows) {
  for (const std::string& group : GroupsOf(*rows)) {
    std::vector<CostRow*> of_group;
    std::vector<std::pair<double, double>> points;
    for (CostRow& row : *rows) {
      if (GroupOf(row) != group || !row.failure.empty()) continue;
      of_group.push_back(&row);
      points.emplace_back(Median(row.seconds), ErrorGreyLevels(row.scores.psnr_mean_db));
    }
    const std::vector<bool> on_front = ParetoFront(points);
    for (std::size_t i = 0; i < of_group.size(); ++i) of_group[i]->on_front = on_front[i];
  }
}

double ErrorGreyLevels(double psnr_db) { return 255 * std::pow(10, -psnr_db / 20); }

json CostRowJson(const CostRow& row) {
  const auto or_null = [](const auto& value) { return value ? json(*value) : json(); };
  json out = {{"scene", row.scene},
              {"views", {row.views, row.views}},
              {"name", row.Name()},
              {"plan", row.is_warping ? json() : PlanJson(row.plan)},
              {"failure", row.failure.empty() ? json() : json(row.failure)}};
  if (!row.failure.empty()) return out;
  const auto measured = [&](const std::vector<double>& seconds) {
    return row.sample ? json() : json(Median(seconds));
  };
  out.update(row.time().Json());
  out.update({{"setup_seconds", Median(row.setup_seconds)},
              {"solve_seconds", measured(row.solve_seconds)},
              {"views_seconds", measured(row.views_seconds)},
              {"extrapolated_from", nullptr},
              {"scored_area", ScoredAreaJson(row.scored)},
              {"peak_memory_mib", or_null(row.peak_memory_mib)},
              {"iterations", or_null(row.iterations)},
              {"converged", row.converged},
              {"relative_residual", or_null(row.relative_residual)},
              {"rcond_min", or_null(row.rcond)},
              {"psnr_true_views_db",
               {{"mean", row.scores.psnr_mean_db},
                {"centre", row.scores.psnr_centre_db},
                {"corner", row.scores.psnr_corner_db}}},
              {"ssim_true_views",
               {{"mean", row.scores.ssim_mean},
                {"centre", row.scores.ssim_centre},
                {"corner", row.scores.ssim_corner}}},
              {"reprojection_psnr_db", row.reprojection_db},
              {"on_front", row.on_front}});
  if (row.sample) {
    out["extrapolated_from"] = {{"solved", row.sample->solved}, {"of", row.sample->all}};
  }
  return out;
}

std::string CostTable(const std::vector<CostRow>& rows) {
  std::string text;
  for (const std::string& group : GroupsOf(rows)) {
    const auto first = std::find_if(rows.begin(), rows.end(),
                                    [&](const CostRow& row) { return GroupOf(row) == group; });
    const auto scored = std::find_if(first, rows.end(), [&](const CostRow& row) {
      return GroupOf(row) == group && row.failure.empty();
    });
    text += fmt::format(
        "\n{0}, {1} x {1} views{2}\n", PrintableUtf8(first->scene), first->views,
        scored == rows.end() ? std::string() : "; scores of " + ScoredAreaText(scored->scored));
    constexpr char kForm[] =
        "{:<34}{:>10}{:>10}{:>16}{:>8}{:>8}{:>8}{:>6}{:>7}{:>9}{:>8}{:>7}{:>7}{:>7}{:>7}{:>6}\n";
    text += fmt::format(kForm, "", "seconds", "seconds", "", "", "", "", "", "", "", "", "", "", "",
                        "", "");
    text += fmt::format(kForm, "", "measured", "extrapol.", "least .. most", "set-up", "solve",
                        "views", "MiB", "iter.", "residual", "rcond", "PSNR", "centre", "corner",
                        "SSIM", "photo");
    for (const CostRow& row : rows) {
      if (GroupOf(row) == group) text += RowText(row);
    }
  }
  return text;
}

std::string CostCsv(const std::vector<CostRow>& rows) {
  std::string csv =
      "scene,views,plan,seconds,least_seconds,most_seconds,setup_seconds,solve_seconds,"
      "views_seconds,extrapolated_seconds,extrapolated_least_seconds,extrapolated_most_seconds,"
      "blocks_solved,blocks_in_all,scored_parts,scored_width_px,scored_height_px,"
      "peak_memory_mib,iterations,converged,"
      "relative_residual,rcond_min,psnr_mean_db,psnr_centre_db,psnr_corner_db,ssim_mean,"
      "ssim_centre,ssim_corner,reprojection_psnr_db,on_front,failure\n";
  const auto number = [](const auto& value) {
    return value ? fmt::format("{:.6g}", static_cast<double>(*value)) : std::string();
  };
  for (const CostRow& row : rows) {
    if (!row.failure.empty()) {
      csv += fmt::format("{},{},{}{}{}\n", Quoted(row.scene), row.views, Quoted(row.Name()),
                         std::string(28, ','), Quoted(row.failure));
      continue;
    }
    const auto [least, most] = std::minmax_element(row.seconds.begin(), row.seconds.end());
    const auto cell = [&](double seconds, bool is_extrapolated) {
      return row.sample.has_value() == is_extrapolated ? fmt::format("{:.6g}", seconds)
                                                       : std::string();
    };
    const double seconds = Median(row.seconds);
    csv += fmt::format(
        "{},{},{},{},{},{},{:.6g},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.4f},"
        "{:.4f},{:.4f},{:.6f},{:.6f},{:.6f},{:.4f},{},\n",
        Quoted(row.scene), row.views, Quoted(row.Name()), cell(seconds, false), cell(*least, false),
        cell(*most, false), Median(row.setup_seconds), cell(Median(row.solve_seconds), false),
        cell(Median(row.views_seconds), false), cell(seconds, true), cell(*least, true),
        cell(*most, true), row.sample ? fmt::format("{}", row.sample->solved) : "",
        row.sample ? fmt::format("{}", row.sample->all) : "", row.scored.parts, row.scored.width_px,
        row.scored.height_px, number(row.peak_memory_mib), number(row.iterations),
        row.converged ? 1 : 0, number(row.relative_residual), number(row.rcond),
        row.scores.psnr_mean_db, row.scores.psnr_centre_db, row.scores.psnr_corner_db,
        row.scores.ssim_mean, row.scores.ssim_centre, row.scores.ssim_corner, row.reprojection_db,
        row.on_front ? 1 : 0);
  }
  return csv;
}

}  // namespace thicklens::tools
