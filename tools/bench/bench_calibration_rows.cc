#include "tools/bench/bench_calibration_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "tools/bench/bench_machine.h"
#include "tools/bench/pareto_front.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

// The number of sigmas of an interval that contains 95 % of a Gaussian; one sigma contains 68.27 %.
constexpr double kSigmas95 = 1.96;
constexpr double kExpected68 = 0.6827, kExpected95 = 0.95;

// Reasons that differ only in their numbers count as the same reason.
std::string Countable(const std::string& reason) {
  constexpr char kDigits[] = "0123456789";
  std::string countable;
  std::size_t from = 0;
  while (from < reason.size()) {
    const std::size_t number = std::min(reason.find_first_of(kDigits, from), reason.size());
    countable += reason.substr(from, number - from);
    if (number == reason.size()) break;
    countable += '#';
    from = std::min(reason.find_first_not_of(kDigits, number), reason.size());
    // Decimals after the point are removed, unless the point ends a sentence.
    if (from + 1 < reason.size() && reason[from] == '.' &&
        std::isdigit(static_cast<unsigned char>(reason[from + 1])) != 0) {
      from = std::min(reason.find_first_not_of(kDigits, from + 1), reason.size());
    }
  }
  return countable;
}

double Least(const std::vector<double>& values) {
  return *std::min_element(values.begin(), values.end());
}
double Most(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

json FractionJson(int inside, int trials, double expected) {
  return {{"inside", inside},
          {"trials", trials},
          {"fraction", static_cast<double>(inside) / trials},
          {"expected", expected},
          {"standard_error", BinomialStandardError(expected, trials)}};
}

json ErrorsJson(const CalibrationErrors& errors) {
  if (errors.count == 0) return json();
  const IntervalCoverage& coverage = errors.coverage;
  json covered_68, covered_95;  // null where no interval is stated
  if (coverage.trials > 0) {
    covered_68 = FractionJson(coverage.inside_68, coverage.trials, kExpected68);
    covered_95 = FractionJson(coverage.inside_95, coverage.trials, kExpected95);
  }
  return {{"sweeps", errors.count},
          {"median_absolute", errors.median_absolute},
          {"root_mean_square", errors.root_mean_square},
          {"covered_by_68_percent", covered_68},
          {"covered_by_95_percent", covered_95}};
}

// The cells are empty if nothing is known.
std::string ErrorsCsv(const CalibrationErrors& errors) {
  std::string cells = fmt::format(",{}", errors.count);
  cells += errors.count == 0
               ? ",,"
               : fmt::format(",{:.6g},{:.6g}", errors.median_absolute, errors.root_mean_square);
  const IntervalCoverage& coverage = errors.coverage;
  return cells + (coverage.trials == 0 ? ",,"
                                       : fmt::format(",{:.4f},{:.4f}", coverage.fraction_68(),
                                                     coverage.fraction_95()));
}

std::string ErrorCell(const CalibrationErrors& errors) {
  return errors.count == 0 ? "-" : fmt::format("{:.3g}", errors.median_absolute);
}

std::string CoverageCell(const IntervalCoverage& coverage) {
  return coverage.trials == 0 ? "-"
                              : fmt::format("{:.0f} {:>3.0f}", 100 * coverage.fraction_68(),
                                            100 * coverage.fraction_95());
}

std::string ErrorCells(const CalibrationRow& row) {
  return fmt::format("{:>9}{:>9}{:>9}{:>8}{:>8}", ErrorCell(row.focus_depth_mm),
                     ErrorCell(row.image_distance_um), ErrorCell(row.blur_ratio_percent),
                     CoverageCell(row.focus_depth_mm.coverage),
                     CoverageCell(row.blur_ratio_percent.coverage));
}

std::string RowText(const CalibrationRow& row) {
  return fmt::format(
      "{}{:<13}{:>6}{:>7}{:>9.2g}{:>19}{}{:>9}\n", row.on_front ? "* " : "  ", row.method,
      row.field_px, row.frames, Median(row.seconds),
      fmt::format("{:.2g} to {:.2g}", Least(row.seconds), Most(row.seconds)),
      row.IsOfAllSweeps() ? ErrorCells(row)
                          : fmt::format("{:>9}{:>9}{:>9}{:>8}{:>8}", "-", "-", "-", "-", "-"),
      row.refused + row.partial == 0 ? "0" : fmt::format("{}, {}", row.refused, row.partial));
}

// The errors of rows for which some sweeps gave no result, in a table of their own.
std::string TextOfFewerSweeps(const std::vector<CalibrationRow>& rows) {
  std::string text;
  for (const CalibrationRow& row : rows) {
    const std::array<int, 3> counts = {row.focus_depth_mm.count, row.image_distance_um.count,
                                       row.blur_ratio_percent.count};
    if (row.IsOfAllSweeps() || *std::max_element(counts.begin(), counts.end()) == 0) continue;
    text +=
        fmt::format("  {:<13}{:>6}{:>7}{:>14}{}\n", row.method, row.field_px, row.frames,
                    fmt::format("{}, {}, {}", counts[0], counts[1], counts[2]), ErrorCells(row));
  }
  if (text.empty()) return "";
  return fmt::format(
             "\nThese rows are from fewer sweeps and cannot be compared with the rows above: a "
             "method refuses\nthe harder sweeps\n  "
             "{:<13}{:>6}{:>7}{:>14}{:>9}{:>9}{:>9}{:>8}{:>8}\n",
             "method", "field", "frames", "sweeps", "zf mm", "d1 um", "kappa %", "zf", "kappa") +
         text;
}

}  // namespace

bool CalibrationRow::IsOfAllSweeps() const {
  const std::array<int, 3> counts = {focus_depth_mm.count, image_distance_um.count,
                                     blur_ratio_percent.count};
  return std::all_of(counts.begin(), counts.end(),
                     [&](int count) { return count == 0 || count == sweeps; });
}

double BinomialStandardError(double expected_fraction, int trials) {
  return std::sqrt(expected_fraction * (1 - expected_fraction) / trials);
}

CalibrationErrors ErrorsOf(const std::vector<CalibrationError>& errors) {
  CalibrationErrors result;
  if (errors.empty()) return result;
  result.count = static_cast<int>(errors.size());
  std::vector<double> magnitudes;
  double squares = 0;
  for (const CalibrationError& error : errors) {
    const double magnitude = std::abs(error.error);
    magnitudes.push_back(magnitude);
    squares += magnitude * magnitude;
    if (!error.sigma) continue;
    ++result.coverage.trials;
    if (magnitude <= *error.sigma) ++result.coverage.inside_68;
    if (magnitude <= kSigmas95 * *error.sigma) ++result.coverage.inside_95;
  }
  result.median_absolute = Median(magnitudes);
  result.root_mean_square = std::sqrt(squares / result.count);
  return result;
}

CalibrationRow MakeCalibrationRow(const std::string& method, int frames, int field_px,
                                  const std::vector<CalibrationTrial>& trials) {
  CalibrationRow row;
  row.method = method;
  row.frames = frames;
  row.field_px = field_px;
  std::vector<CalibrationError> focus, distance, ratio;
  for (const CalibrationTrial& trial : trials) {
    ++row.sweeps;
    row.seconds.push_back(trial.seconds);
    if (trial.outcome == calib::Outcome::kOk) ++row.ok;
    if (trial.outcome == calib::Outcome::kPartial) ++row.partial;
    if (trial.outcome == calib::Outcome::kRefused) ++row.refused;
    if (trial.outcome != calib::Outcome::kOk) ++row.reasons[Countable(trial.reason)];
    if (trial.focus_depth_mm) focus.push_back(*trial.focus_depth_mm);
    if (trial.image_distance_um) distance.push_back(*trial.image_distance_um);
    if (trial.blur_ratio_percent) ratio.push_back(*trial.blur_ratio_percent);
  }
  row.focus_depth_mm = ErrorsOf(focus);
  row.image_distance_um = ErrorsOf(distance);
  row.blur_ratio_percent = ErrorsOf(ratio);
  return row;
}

void MarkFront(std::vector<CalibrationRow>* rows) {
  std::vector<std::pair<double, double>> points;
  for (const CalibrationRow& row : *rows) {
    points.emplace_back(Median(row.seconds), row.IsComparable()
                                                 ? row.image_distance_um.median_absolute
                                                 : std::numeric_limits<double>::infinity());
  }
  const std::vector<bool> on_front = ParetoFront(points);
  for (std::size_t i = 0; i < rows->size(); ++i) (*rows)[i].on_front = on_front[i];
}

json CalibrationRowJson(const CalibrationRow& row) {
  return {{"method", row.method},
          {"field_px", row.field_px},
          {"frames", row.frames},
          {"sweeps", row.sweeps},
          {"ok", row.ok},
          {"partial", row.partial},
          {"refused", row.refused},
          {"errors_are_of_all_sweeps", row.IsOfAllSweeps()},
          {"reasons", row.reasons},
          {"seconds", Median(row.seconds)},
          {"seconds_least", Least(row.seconds)},
          {"seconds_most", Most(row.seconds)},
          {"seconds_of_sweeps", row.seconds},
          {"focus_depth_error_mm", ErrorsJson(row.focus_depth_mm)},
          {"image_distance_error_um", ErrorsJson(row.image_distance_um)},
          {"blur_ratio_error_percent", ErrorsJson(row.blur_ratio_percent)},
          {"pareto_front", row.on_front}};
}

std::string CalibrationRowsCsv(const std::vector<CalibrationRow>& rows) {
  std::string csv =
      "method,field_px,frames,sweeps,ok,partial,refused,seconds,seconds_least,seconds_most";
  for (const auto& [quantity, unit] :
       {std::pair("focus_depth", "mm"), {"image_distance", "um"}, {"blur_ratio", "percent"}}) {
    csv += fmt::format(
        ",{0}_sweeps,{0}_median_error_{1},{0}_rms_error_{1},{0}_covered_68,{0}_covered_95",
        quantity, unit);
  }
  csv += ",pareto_front\n";
  for (const CalibrationRow& row : rows) {
    csv += fmt::format("{},{},{},{},{},{},{},{:.6g},{:.6g},{:.6g}{}{}{},{}\n", row.method,
                       row.field_px, row.frames, row.sweeps, row.ok, row.partial, row.refused,
                       Median(row.seconds), Least(row.seconds), Most(row.seconds),
                       ErrorsCsv(row.focus_depth_mm), ErrorsCsv(row.image_distance_um),
                       ErrorsCsv(row.blur_ratio_percent), row.on_front ? 1 : 0);
  }
  return csv;
}

std::string CalibrationRowsText(const std::vector<CalibrationRow>& rows) {
  std::string text = fmt::format(
      "  {:<13}{:>6}{:>7}{:>9}{:>19}{:>9}{:>9}{:>9}{:>8}{:>8}{:>9}\n"
      "  {:<13}{:>6}{:>7}{:>9}{:>19}{:>9}{:>9}{:>9}{:>8}{:>8}{:>9}\n",
      "method", "field", "frames", "seconds", "", "zf", "d1", "kappa", "zf", "kappa", "refused,",
      "", "px", "", "median", "range", "mm", "um", "%", "68  95", "68  95", "partial");
  std::map<std::string, std::map<std::string, int>> reasons;  // how often, by method
  for (const CalibrationRow& row : rows) {
    text += RowText(row);
    for (const auto& [reason, count] : row.reasons) reasons[reason][row.method] += count;
  }
  text += TextOfFewerSweeps(rows);
  for (const auto& [reason, by_method] : reasons) {
    text += "\n";
    for (const auto& [method, count] : by_method) {
      text +=
          fmt::format("{}{} x {}", method == by_method.begin()->first ? "" : ", ", count, method);
    }
    text += ": " + reason;
  }
  return text + (reasons.empty() ? "" : "\n");
}

}  // namespace thicklens::tools
