#include "tools/bench/bench_source_rows.h"

#include <fmt/format.h>

#include <algorithm>

#include "thicklens/base/printable_text.h"
#include "thicklens/estimator/block_solver.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/whole_time.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

template <typename Value>
json OrNull(const std::optional<Value>& value) {
  return value ? json(*value) : json();
}

std::string OrDash(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "-";
}

std::string UsualSolver() { return estimator::BlockSolverName(estimator::DefaultBlockSolver()); }

std::string Heading(int table) {
  switch (table) {
    case 1:
      return fmt::format(
          "Table 1. Light field from an image by blocks of 16 px ({}, gamma 1): matrices "
          "by\nOpenCL kernels, or everything on one thread; below, the other solvers of this "
          "program",
          UsualSolver());
    case 2:
      return "Table 2. Image from a light field: OpenCL, transfers included, against one "
             "thread;\nbelow, the fastest code of this program for the processor. The second of "
             "two images;\nbandwidth: bytes that must be moved per second, divided by the "
             "machine's triad";
    case 3:
      return "Table 3. Linear solvers of the blocks (16 px, gamma 1; iterations to 1e-6, "
             "residual\nrecomputed), then the whole image at once; one thread each, except "
             "ViennaCL, which\nselects an OpenCL device itself";
    default:
      return "Table 4. Thick against thin lens, focused on the same plane: the image computed "
             "again\nfrom the estimate (the paper's measure), and the true views, which this "
             "measure does not use";
  }
}

// Returns the implementation that the ratios of a table refer to.
std::string BaseOf(int table) { return table == 3 ? UsualSolver() : "cpu"; }

const SourceRow* BaseRow(const SourceRow& row, const std::vector<SourceRow>& rows) {
  const auto base = std::find_if(rows.begin(), rows.end(), [&](const SourceRow& other) {
    return other.failure.empty() && other.table == row.table && other.image == row.image &&
           other.views == row.views && other.implementation == BaseOf(row.table);
  });
  return base == rows.end() ? nullptr : &*base;
}

WholeTime TimeOf(const SourceRow& row) { return {row.seconds, row.extrapolated.has_value()}; }

// Returns whether two rows compare the same work: with the same number of threads, and both
// measured or both extrapolated from the same blocks.
bool IsSameWork(const SourceRow& a, const SourceRow& b) {
  return a.threads == b.threads && a.extrapolated.has_value() == b.extrapolated.has_value();
}

std::string Ratio(double base, double seconds) { return fmt::format("{:.3g}", base / seconds); }

std::optional<double> BandwidthShare(const SourceRow& row) {
  if (!row.triad_seconds) return std::nullopt;
  return *row.triad_seconds / Median(row.seconds);
}

std::string NameColumns(const SourceRow& row) {
  return fmt::format("{:<9} {:>5}  {:<17}", row.image, fmt::format("{0}x{0}", row.views),
                     row.implementation);
}

std::string TimeLine(const SourceRow& row, const std::vector<SourceRow>& rows) {
  const WholeTime time = TimeOf(row);
  const SourceRow* base = BaseRow(row, rows);
  std::string published = "-", published_ratio = "-";
  if (row.published) {
    published = fmt::format("{:.2f}", MeanOf(*row.published));
    if (base != nullptr && base->published) {
      published_ratio = Ratio(MeanOf(*base->published), MeanOf(*row.published));
    }
  }
  std::string more;
  if (row.table == 2) more = fmt::format("{:>11}", OrDash(BandwidthShare(row), 2));
  if (row.table == 3) {
    more = fmt::format("{:>11}{}",
                       row.relative_residual ? fmt::format("{:.1e}", *row.relative_residual) : "-",
                       row.converged.value_or(true) ? "" : " not converged");
  }
  const std::string ratio =
      base == nullptr ? "-" : Ratio(Median(base->seconds), Median(row.seconds));
  const bool is_same_work = base != nullptr && IsSameWork(*base, row);
  return fmt::format("{}{:>8}{:>10}{:>10}{:>22}{:>9}{:>9}{:>11}{:>9}{:>9}{}\n", NameColumns(row),
                     row.threads, time.MeasuredCell(), time.ExtrapolatedCell(), time.RangeCell(),
                     is_same_work ? ratio : "-", is_same_work ? "-" : ratio, published,
                     published_ratio, OrDash(row.psnr_true_views_db, 2), more);
}

std::string FidelityLine(const SourceRow& row) {
  return fmt::format(
      "{}{:>10}{:>10}{:>9}{:>8}{:>12}{:>8}{:>9}\n", NameColumns(row), TimeOf(row).MeasuredCell(),
      TimeOf(row).ExtrapolatedCell(), OrDash(row.macade_standin, 3), OrDash(row.delta_e94_mean, 2),
      row.published_fidelity ? fmt::format("{:.3f}", MeanOf(row.published_fidelity->macade)) : "-",
      row.published_fidelity ? fmt::format("{:.2f}", MeanOf(row.published_fidelity->delta_e94_mean))
                             : "-",
      OrDash(row.psnr_true_views_db, 2));
}

std::string Columns(int table) {
  const auto names = [](const char* image, const char* views) {
    return fmt::format("{:<9} {:>5}  {:<17}", image, views, "");
  };
  if (table == 4) {
    constexpr char kForm[] = "{}{:>10}{:>10}{:>9}{:>8}{:>12}{:>8}{:>9}\n";
    return fmt::format(kForm, names("", ""), "seconds", "seconds", "", "", "", "", "") +
           fmt::format(kForm, names("image", "views"), "measured", "extrapol.", "MACADE'", "M-dE94",
                       "published:", "", "PSNR dB");
  }
  const char* more = table == 2 ? "  bandwidth" : table == 3 ? "   residual" : "";
  constexpr char kForm[] = "{}{:>8}{:>10}{:>10}{:>22}{:>9}{:>9}{:>11}{:>9}{:>9}{}\n";
  return fmt::format(kForm, names("", ""), "", "seconds", "seconds", "", "x faster", "x faster", "",
                     "", "", "") +
         fmt::format(kForm, names("image", "views"), "threads", "measured", "extrapol.", "runs",
                     "as much", "unlike", "published:", "x faster", "PSNR dB", more);
}

// Groups rows of one image with one number of views, whose scores have the same area.
std::string SourceGroupOf(const SourceRow& row) {
  return fmt::format("{} {}", row.image, row.views);
}

std::string GroupLine(const SourceRow& row) {
  if (!row.scored || !(row.psnr_true_views_db || row.delta_e94_mean)) return "";
  return fmt::format("{0}, {1} x {1} views: scores are for {2}\n", PrintableUtf8(row.image),
                     row.views, ScoredAreaText(*row.scored));
}

std::string Footnotes(int table, const std::vector<SourceRow>& rows) {
  std::string text;
  std::vector<std::string> samples;
  for (const SourceRow& row : rows) {
    if (row.table != table || !row.extrapolated) continue;
    const std::string sample =
        fmt::format("{} of {} of {} with {}x{} views", row.extrapolated->solved,
                    row.extrapolated->all, row.image, row.views, row.views);
    if (std::find(samples.begin(), samples.end(), sample) == samples.end())
      samples.push_back(sample);
  }
  if (!samples.empty()) {
    std::string list;
    for (const std::string& sample : samples) list += (list.empty() ? "" : ", ") + sample;
    text += fmt::format(
        "extrapol.: from blocks: {}; --full runs all. Residuals of blocks are the largest of "
        "these\n",
        list);
  }
  if (table != 4) {
    text += fmt::format(
        "x faster, as much: relative to the row with the same number of threads and the same work; "
        "unlike:\nrelative to other threads{}\n",
        samples.empty() ? "" : ",\nor a measured time against an extrapolated one");
  }
  if (table == 4) {
    text +=
        "MACADE': an approximation, because the paper's definition is not available. For two "
        "lenses\nfocused on the same plane the rays are the same, so only the fall-off can "
        "differ\n";
  }
  return text;
}

}  // namespace

json SourceRowJson(const SourceRow& row, const std::vector<SourceRow>& rows) {
  const auto or_null = [](const std::string& text) { return text.empty() ? json() : json(text); };
  if (!row.failure.empty()) {
    return {{"table", row.table},
            {"image", row.image},
            {"size", {row.width_px, row.height_px}},
            {"views", {row.views, row.views}},
            {"implementation", row.implementation},
            {"failure", row.failure}};
  }
  json out = {{"table", row.table},
              {"image", row.image},
              {"size", {row.width_px, row.height_px}},
              {"views", {row.views, row.views}},
              {"implementation", row.implementation},
              {"block_solver", or_null(row.block_solver)},
              {"device", or_null(row.device)},
              {"failure", nullptr},
              {"threads", row.threads},
              {"extrapolated_from", nullptr},
              {"scored_area", row.scored ? ScoredAreaJson(*row.scored) : json()},
              {"published_seconds", nullptr},
              {"published_seconds_of_images", OrNull(row.published)},
              {"psnr_true_views_db", OrNull(row.psnr_true_views_db)}};
  out.update(TimeOf(row).Json());
  if (row.extrapolated) {
    out["extrapolated_from"] = {{"blocks", row.extrapolated->solved},
                                {"of", row.extrapolated->all}};
  }
  if (row.published) out["published_seconds"] = MeanOf(*row.published);
  const SourceRow* base = BaseRow(row, rows);
  out["times_faster"] = out["times_faster_unlike"] = nullptr;
  if (base != nullptr) {
    out[IsSameWork(*base, row) ? "times_faster" : "times_faster_unlike"] =
        Median(base->seconds) / Median(row.seconds);
  }
  out["times_faster_than"] = base == nullptr ? json() : json(base->implementation);
  if (row.table == 2) out["bandwidth_share"] = OrNull(BandwidthShare(row));
  if (row.table == 3) {
    out["relative_residual"] = OrNull(row.relative_residual);
    out["converged"] = OrNull(row.converged);
  }
  if (row.table == 4) {
    out["macade_standin"] = OrNull(row.macade_standin);
    out["delta_e94_mean"] = OrNull(row.delta_e94_mean);
    out["published_macade_of_images"] = nullptr;
    out["published_delta_e94_mean_of_images"] = nullptr;
    if (row.published_fidelity) {
      out["published_macade_of_images"] = row.published_fidelity->macade;
      out["published_delta_e94_mean_of_images"] = row.published_fidelity->delta_e94_mean;
    }
  }
  return out;
}

std::string SourceTableText(int table, const std::vector<SourceRow>& rows) {
  std::string text = fmt::format("{}\n{}", Heading(table), Columns(table));
  std::string group;
  for (const SourceRow& row : rows) {
    if (row.table != table) continue;
    if (SourceGroupOf(row) != group) text += GroupLine(row);
    group = SourceGroupOf(row);
    if (!row.failure.empty()) {
      text += fmt::format("{}  not run: {}\n", NameColumns(row), row.failure);
    } else {
      text += table == 4 ? FidelityLine(row) : TimeLine(row, rows);
    }
  }
  return text + Footnotes(table, rows);
}

}  // namespace thicklens::tools
