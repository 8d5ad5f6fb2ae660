#include "benchmarks/accuracy/pupil_law_study.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <iostream>
#include <map>

#include "support/sample_statistics.h"
#include "thicklens/base/parallel.h"

namespace thicklens::accuracy {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kCoverage = 0.95;
constexpr double kRejectionP = 0.01;
constexpr model::TargetKind kTextures[] = {
    model::TargetKind::kDeadLeaves, model::TargetKind::kWhiteNoise, model::TargetKind::kPinkNoise};

// One cell of the table: how often the intervals of one result contain the truth.
struct Cell {
  int done = 0, covered = 0;
  double error = 0, half_width = 0;  // sums

  void Add(const Measured& result) {
    ++done;
    const double low = result.interval_low - 2 * result.sigma;
    const double high = result.interval_high + 2 * result.sigma;
    covered += low <= 0 && 0 <= high ? 1 : 0;
    error += result.error;
    half_width += (high - low) / 2;
  }
};

// The probability of at most this many successes.
double AtMostP(int successes, int trials, double probability) {
  double sum = 0;
  for (int k = 0; k <= successes; ++k) {
    sum +=
        std::exp(std::lgamma(trials + 1.0) - std::lgamma(k + 1.0) - std::lgamma(trials - k + 1.0) +
                 k * std::log(probability) + (trials - k) * std::log1p(-probability));
  }
  return std::min(1.0, sum);
}

Json CellJson(const Cell& cell, double unit) {
  return {{"sweeps", cell.done},
          {"covered", cell.covered},
          {"p_of_so_few", AtMostP(cell.covered, cell.done, kCoverage)},
          {"mean_error", unit * cell.error / cell.done},
          {"mean_half_width", unit * cell.half_width / cell.done}};
}

}  // namespace

nlohmann::ordered_json RunPupilLawStudy(const std::vector<std::string>& cases,
                                        const TrialSettings& settings, int sweeps, int threads) {
  struct Key {
    model::PupilLaw law;
    bool zero_is_known;
    TrialKey trial;
  };
  std::vector<Key> keys;
  for (const model::PupilLaw law : model::AllPupilLaws()) {
    for (std::size_t c = 0; c < cases.size(); ++c) {
      for (const bool known : {true, false}) {
        for (int i = 0; i < sweeps; ++i) {
          keys.push_back({law,
                          known,
                          {cases[c], static_cast<int>(c), kTextures[i % 3],
                           1000 * static_cast<int>(law) + i / 3}});
        }
      }
    }
  }
  std::vector<Trial> trials(keys.size());
  std::atomic<std::size_t> done{0};
  ParallelFor(static_cast<int>(keys.size()), threads, [&](int i) {
    const Key& key = keys[static_cast<std::size_t>(i)];
    TrialSettings its = settings;
    its.pupil_law = key.law;
    its.zero_is_known = key.zero_is_known;
    trials[static_cast<std::size_t>(i)] = RunTrials(key.trial, its, {Floor::kDrawn}).front();
    if (const std::size_t count = ++done; count % 100 == 0 || count == keys.size())
      std::cerr << fmt::format("{} of {} sweeps\n", count, keys.size());
  });

  std::cout << fmt::format(
      "\nTruth within the systematic interval widened by 2 sigma: sweeps that cover it, the "
      "probability of so\nfew at a coverage of 95 %, mean error, mean half width (kappa in % of "
      "it, "
      "zf in mm, d1 in um); {} px\n{:<9}{:<6}{:<8}{:<7}{:>7}{:>5}{:>9}{:>9}{:>10}{:>11}  {}\n",
      settings.size_px, "law", "case", "zero", "result", "inside", "of", "share", "p", "mean err",
      "half width", "at 1 %");
  Json rows = Json::array();
  int contradicted = 0, all_covered = 0, all_done = 0, refused = 0;
  for (std::size_t first = 0; first < keys.size(); first += static_cast<std::size_t>(sweeps)) {
    std::map<std::string, Cell> cells;
    double kappa = 1;
    std::map<std::string, int> reasons;
    for (std::size_t i = first; i < first + static_cast<std::size_t>(sweeps); ++i) {
      const Trial& trial = trials[i];
      kappa = trial.true_blur_ratio;
      if (!trial.done) {
        ++reasons[trial.reason];
        ++refused;
        continue;
      }
      cells["kappa"].Add(trial.blur_ratio);
      cells["zf"].Add(trial.focus_depth_mm);
      cells["d1"].Add(trial.image_distance_mm);
    }
    const Key& key = keys[first];
    for (const auto& [name, unit] :
         {std::pair<std::string, double>{"kappa", 100 / kappa}, {"zf", 1}, {"d1", 1000}}) {
      const Cell& cell = cells[name];
      if (cell.done == 0) continue;
      const double p = AtMostP(cell.covered, cell.done, kCoverage);
      contradicted += p < kRejectionP ? 1 : 0;
      all_covered += cell.covered;
      all_done += cell.done;
      std::cout << fmt::format(
          "{:<9}{:<6}{:<8}{:<7}{:>7}{:>5}{:>9.3f}{:>9.3f}{:>10.3g}{:>11.3g}  {}\n",
          model::PupilLawName(key.law), key.trial.case_name,
          key.zero_is_known ? "given" : "unknown", name, cell.covered, cell.done,
          static_cast<double>(cell.covered) / cell.done, p, unit * cell.error / cell.done,
          unit * cell.half_width / cell.done, p < kRejectionP ? "CONTRADICTED" : "");
      Json row = {{"law", model::PupilLawName(key.law)},
                  {"case", key.trial.case_name},
                  {"zero", key.zero_is_known ? "given" : "unknown"},
                  {"result", name}};
      row.update(CellJson(cell, unit));
      rows.push_back(row);
    }
    for (const auto& [reason, count] : reasons)
      std::cout << fmt::format("{:<30}{} x {}\n", "", count, reason);
  }
  std::cout << fmt::format(
      "pooled coverage {:.4f} of {} results; {} of {} cells contradicted; {} "
      "sweeps refused\n",
      static_cast<double>(all_covered) / std::max(1, all_done), all_done, contradicted, rows.size(),
      refused);
  return {{"rows", rows},
          {"pooled_coverage", static_cast<double>(all_covered) / std::max(1, all_done)},
          {"cells_contradicted", contradicted},
          {"refused", refused}};
}

}  // namespace thicklens::accuracy
