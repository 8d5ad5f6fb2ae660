#include "benchmarks/accuracy/tables.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <iostream>

#include "benchmarks/accuracy/fisher_bound.h"
#include "support/sample_statistics.h"

namespace thicklens::accuracy {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kFloorSigmaPx2 = 0.01;
constexpr int kManyFrames = 30;
constexpr double kRejectionP = 0.001;
// Quantiles of the magnitude of a Gaussian error, in standard deviations.
constexpr double kGaussianMedian = 0.6745;
constexpr double kGaussian90 = 1.645;

void Print(const std::string& line) { std::cout << line << "\n"; }

Summary Of(const Run& run, const std::function<bool(const Trial&)>& belongs) {
  std::vector<const Trial*> trials;
  for (const Trial& trial : run.trials) {
    if (belongs(trial)) trials.push_back(&trial);
  }
  return Summarise(trials);
}

// JSON has no NaN.
Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json CoverageJson(const Coverage& c) {
  return {{"inside", c.inside},
          {"trials", c.trials},
          {"coverage", c.fraction()},
          {"binomial_p", c.binomial_p},
          {"sigma_over_scatter", Number(c.sigma_ratio)},
          {"inverse_robust_z", Number(c.sigma_ratio_z)},
          {"rms_z", Number(c.rms_z)},
          {"mean_z", Number(c.mean_z)},
          {"mean_z_over_its_error", Number(c.mean_over_error)}};
}

Json SummaryJson(const Summary& s) {
  Json json = {{"sweeps", s.trials},
               {"done", s.done},
               {"partial", s.partial},
               {"refusals", s.refusals},
               {"focus_depth_error_median_mm", Number(s.focus_median_mm)},
               {"focus_depth_error_90_mm", Number(s.focus_90_mm)},
               {"focus_depth_error_median_steps", Number(s.focus_median_steps)},
               {"focus_depth_error_90_steps", Number(s.focus_90_steps)},
               {"image_distance_error_median_um", Number(s.image_distance_median_um)},
               {"image_distance_error_90_um", Number(s.image_distance_90_um)},
               {"blur_ratio_relative_error_median", Number(s.blur_ratio_median)},
               {"blur_ratio_relative_error_90", Number(s.blur_ratio_90)},
               {"seconds_per_sweep", s.mean_seconds},
               {"coverage",
                {{"focus_depth_mm", CoverageJson(s.focus_depth)},
                 {"image_distance_mm", CoverageJson(s.image_distance)},
                 {"blur_ratio", CoverageJson(s.blur_ratio)}}}};
  if (s.floor_90_px) json["blur_floor_error_90_px"] = Number(*s.floor_90_px);
  if (s.recipe_median_mm) json["recipe_focus_depth_error_median_mm"] = *s.recipe_median_mm;
  if (s.recipe_over_focus) json["recipe_over_focus_depth_error"] = Number(*s.recipe_over_focus);
  return json;
}

std::string Times(const std::optional<double>& ratio) {
  return ratio ? fmt::format("{:.1f}", *ratio) : "-";
}

Json PrintErrors(const Run& run) {
  Print(
      "\nErrors per case and target: median and 90 % of the magnitude; recipe: median error of the"
      "\nsharpest frame by mean-normalised index over the median error of zf; s: CPU of a "
      "calibration");
  Print(fmt::format("{:<5}{:<14}{:<9}{:>5}{:>6}{:>9}{:>9}{:>8}{:>8}{:>8}{:>8}{:>9}{:>9}{:>8}{:>7}",
                    "case", "target", "floor", "done", "of", "zf mm", "90 %", "% step", "90 %",
                    "kappa %", "90 %", "d1 um", "90 %", "recipe", "s"));
  Json rows = Json::array();
  for (const std::string& name : run.cases) {
    for (const model::TargetKind target : run.targets) {
      for (const Floor floor : {Floor::kExact, Floor::kDrawn, Floor::kMeasured}) {
        const Summary s = Of(run, [&](const Trial& trial) {
          return trial.key.case_name == name && trial.key.target == target && trial.floor == floor;
        });
        if (s.trials == 0) continue;
        const std::string what = model::TargetKindName(target);
        Print(fmt::format(
            "{:<5}{:<14}{:<9}{:>5}{:>6}{:>9.4f}{:>9.4f}{:>8.2f}{:>8.2f}{:>8.2f}"
            "{:>8.2f}{:>9.3f}{:>9.3f}{:>8}{:>7.2f}",
            name, what, FloorName(floor), s.done, s.trials, s.focus_median_mm, s.focus_90_mm,
            100 * s.focus_median_steps, 100 * s.focus_90_steps, 100 * s.blur_ratio_median,
            100 * s.blur_ratio_90, s.image_distance_median_um, s.image_distance_90_um,
            Times(s.recipe_over_focus), s.mean_seconds));
        if (s.floor_90_px) {
          Print(fmt::format("{:<28}floor: 90 % of errors up to {:.4f} px", "", *s.floor_90_px));
        }
        for (const auto& [reason, count] : s.refusals) {
          Print(fmt::format("{:<28}{} x {}", "", count, reason));
        }
        Json row = SummaryJson(s);
        row["case"] = name;
        row["target"] = what;
        row["floor"] = FloorName(floor);
        rows.push_back(row);
      }
    }
  }
  return rows;
}

// One goal of one case. `bound` is the smallest error that is possible, if it is known.
struct Goal {
  std::string what;
  double measured = 0;
  double limit = 0;
  std::optional<double> bound;
  bool at_least = false;  // true: the limit is a minimum

  std::string Verdict() const {
    if (at_least ? measured >= limit : measured <= limit) return "met";
    return bound && *bound > limit ? "OUT OF REACH" : "MISSED";
  }
};

std::vector<Goal> GoalsOf(const Summary& s, const model::SweepSimulationOptions& options,
                          Floor floor) {
  const FisherBounds bounds = BoundsOf(options, kFloorSigmaPx2);
  const Bound& bound = floor == Floor::kDrawn ? bounds.together : bounds.scaled;
  const double steps = 100 * bound.focus_depth_mm / std::abs(options.step_mm);
  const bool many = options.frame_count >= kManyFrames;
  const double ratio_limit = !many ? 4.0 : options.camera.psf == model::Psf::kDisc ? 2.0 : 0.7;
  std::vector<Goal> goals;
  if (many) {
    goals.push_back(
        {"zf, median, % of a step", 100 * s.focus_median_steps, 3.0, kGaussianMedian * steps});
  }
  goals.push_back(
      {"zf, 90 %, % of a step", 100 * s.focus_90_steps, many ? 7.0 : 5.0, kGaussian90 * steps});
  goals.push_back({"kappa, 90 %, %", 100 * s.blur_ratio_90, ratio_limit,
                   kGaussian90 * 100 * bound.relative_blur_ratio});
  if (s.recipe_over_focus)
    goals.push_back({"recipe over zf", *s.recipe_over_focus, 10, std::nullopt, true});
  goals.push_back({"refused", static_cast<double>(s.trials - s.done), 0, std::nullopt});
  return goals;
}

Json PrintGoals(const Run& run) {
  Print(
      "\nGoals, aperiodic textures together, and the edge whose floor is measured; bound: what "
      "an error of\nthe floor (where drawn) and of the readings leave, from the last table");
  Print(fmt::format("{:<5}{:<10}{:<26}{:>10}{:>10}{:>10}", "case", "floor", "goal", "measured",
                    "limit", "bound"));
  Json rows = Json::array();
  for (const std::string& name : run.cases) {
    TrialKey key;
    key.case_name = name;
    const model::SweepSimulationOptions options = Simulation(key, run.settings);
    for (const Floor floor : {Floor::kExact, Floor::kDrawn, Floor::kMeasured}) {
      const Summary s = Of(run, [&](const Trial& trial) {
        return trial.key.case_name == name && trial.floor == floor &&
               (floor == Floor::kMeasured || IsAperiodic(trial.key.target));
      });
      if (s.trials == 0) continue;
      for (const Goal& goal : GoalsOf(s, options, floor)) {
        Print(fmt::format("{:<5}{:<10}{:<26}{:>10.2f}{:>10}{:>10}  {}", name, FloorName(floor),
                          goal.what, goal.measured,
                          fmt::format("{}{}", goal.at_least ? ">= " : "<= ", goal.limit),
                          goal.bound ? fmt::format("{:.2f}", *goal.bound) : "-", goal.Verdict()));
        rows.push_back({{"case", name},
                        {"floor", FloorName(floor)},
                        {"goal", goal.what},
                        {"measured", Number(goal.measured)},
                        {"limit", goal.limit},
                        {"bound", goal.bound ? Json(*goal.bound) : Json(nullptr)},
                        {"verdict", goal.Verdict()}});
      }
    }
  }
  return rows;
}

// The three results of a group, by name.
std::vector<std::pair<std::string, Coverage>> Coverages(const Summary& s) {
  return {{"zf", s.focus_depth}, {"d1", s.image_distance}, {"kappa", s.blur_ratio}};
}

Json PrintCoverage(const Run& run, bool aperiodic_alone) {
  Print(
      fmt::format("\nCoverage of value +- 1.96 sigma, floors drawn, {}: sigma over scatter "
                  "robust, of medians\nand by z; mean z, and that over its own standard error",
                  aperiodic_alone ? "aperiodic textures" : "all textures"));
  Print(fmt::format("{:<6}{:<7}{:>8}{:>8}{:>10}{:>10}{:>9}{:>8}{:>8}{:>8}{:>7}  {}", "case",
                    "result", "inside", "of", "coverage", "p", "sigma/sc", "1/z", "rms z", "mean z",
                    "errors", "at 0.1 %"));
  Json rows = Json::array();
  std::map<std::string, std::vector<Coverage>> by_result;
  std::vector<double> ratios;
  for (const std::string& name : run.cases) {
    const Summary s = Of(run, [&](const Trial& trial) {
      return trial.key.case_name == name && trial.floor == Floor::kDrawn &&
             (!aperiodic_alone || IsAperiodic(trial.key.target));
    });
    if (s.done == 0) continue;
    for (const auto& [result, c] : Coverages(s)) {
      by_result[result].push_back(c);
      ratios.push_back(c.sigma_ratio);
      Print(
          fmt::format("{:<6}{:<7}{:>8}{:>8}{:>10.3f}{:>10.4f}{:>9.2f}{:>8.2f}{:>8.2f}{:>8.2f}"
                      "{:>7.1f}  {}",
                      name, result, c.inside, c.trials, c.fraction(), c.binomial_p, c.sigma_ratio,
                      c.sigma_ratio_z, c.rms_z, c.mean_z, c.mean_over_error,
                      c.binomial_p < kRejectionP ? "REJECTED" : "not rejected"));
      Json row = CoverageJson(c);
      row["case"] = name;
      row["result"] = result;
      rows.push_back(row);
    }
  }
  std::vector<Coverage> all;
  for (const auto& [result, coverages] : by_result) {
    const Coverage pooled = Pooled(coverages);
    Print(fmt::format("{:<6}{:<7}{:>8}{:>8}{:>10.3f}{:>10.4f}", "all", result, pooled.inside,
                      pooled.trials, pooled.fraction(), pooled.binomial_p));
    Json row = CoverageJson(pooled);
    row["case"] = "all";
    row["result"] = result;
    rows.push_back(row);
    all.push_back(pooled);
  }
  const Coverage pooled = Pooled(all);
  Print(
      fmt::format("pooled coverage {:.3f} (goal 0.94 to 0.96); median sigma over scatter {:.2f} "
                  "(goal 0.95 to 1.05)",
                  pooled.fraction(), testing::Median(ratios)));
  return {{"rows", rows},
          {"pooled_coverage", pooled.fraction()},
          {"median_sigma_over_scatter", Number(testing::Median(ratios))}};
}

Json BoundJson(const Bound& b) {
  return {{"focus_depth_sigma_mm", b.focus_depth_mm},
          {"image_distance_sigma_um", 1000 * b.image_distance_mm},
          {"blur_ratio_relative_sigma", b.relative_blur_ratio}};
}

Json PrintBounds(const Run& run) {
  Print(
      fmt::format("\nWhat cannot be done better, as 90 % of the magnitude of a Gaussian error: "
                  "floor known to {} px^2;\nreadings as the sweep states them, with exact blur, "
                  "without and with exact image scales",
                  kFloorSigmaPx2));
  Print(fmt::format("{:<6}{:<20}{:>12}{:>12}{:>12}{:>12}", "case", "known worst", "zf mm",
                    "% of step", "kappa %", "d1 um"));
  Json rows = Json::array();
  for (std::size_t i = 0; i < run.cases.size(); ++i) {
    TrialKey key;
    key.case_name = run.cases[i];
    const model::SweepSimulationOptions options = Simulation(key, run.settings);
    const FisherBounds bounds = BoundsOf(options, kFloorSigmaPx2);
    const std::vector<std::pair<std::string, Bound>> parts = {
        {"floor", bounds.floor},
        {"readings", bounds.readings},
        {"readings, with scale", bounds.scaled},
        {"floor and that", bounds.together}};
    for (const auto& [part, b] : parts) {
      Print(fmt::format("{:<6}{:<20}{:>12.4f}{:>12.2f}{:>12.4f}{:>12.4f}", key.case_name, part,
                        kGaussian90 * b.focus_depth_mm,
                        100 * kGaussian90 * b.focus_depth_mm / std::abs(options.step_mm),
                        100 * kGaussian90 * b.relative_blur_ratio,
                        1000 * kGaussian90 * b.image_distance_mm));
    }
    rows.push_back({{"case", key.case_name},
                    {"floor", BoundJson(bounds.floor)},
                    {"readings", BoundJson(bounds.readings)},
                    {"readings_with_scale", BoundJson(bounds.scaled)},
                    {"together", BoundJson(bounds.together)}});
  }
  return rows;
}

}  // namespace

bool IsAperiodic(model::TargetKind target) {
  switch (target) {
    case model::TargetKind::kDeadLeaves:
    case model::TargetKind::kPinkNoise:
    case model::TargetKind::kWhiteNoise:
    case model::TargetKind::kImage:
      return true;
    default:
      return false;
  }
}

nlohmann::ordered_json PrintTables(const Run& run) {
  Json json;
  json["size_px"] = run.settings.size_px;
  json["psf"] = model::PsfName(run.settings.psf);
  json["first_seed"] = run.settings.first_seed;
  json["errors"] = PrintErrors(run);
  json["goals"] = PrintGoals(run);
  json["coverage_aperiodic"] = PrintCoverage(run, true);
  json["coverage_all"] = PrintCoverage(run, false);
  json["bounds"] = PrintBounds(run);
  return json;
}

}  // namespace thicklens::accuracy
