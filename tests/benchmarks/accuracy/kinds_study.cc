#include "benchmarks/accuracy/kinds_study.h"

#include <fmt/format.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>
#include <random>

#include "benchmarks/accuracy/fisher_bound.h"
#include "benchmarks/accuracy/summary.h"
#include "benchmarks/accuracy/trial.h"
#include "support/sample_statistics.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens::accuracy {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kFloorSigmaPx2 = 0.01;
constexpr double kLevel = 0.95, kRejectionP = 0.01;
constexpr double kSilentSigmas = 4;
// Quantiles of the magnitude of a Gaussian error, in standard deviations.
constexpr double kGaussianMedian = 0.6745, kGaussian90 = 1.645;
// A goal is the larger of its figure and this many times the bound of Cramer and Rao.
constexpr double kAboveBound = 1.2;
constexpr double kWidestInterval = 3;  // half of it over the 90 % quantile of the error
// Fewer sweeps do not show a quantile: the check of a goal is then a test of how many errors exceed
// it.
constexpr int kShowQuantiles = 60;
constexpr double kMaxWrongReasons = 0.02;  // of the refusals

struct Kind {
  std::string name;
  bool disturbed = false, gives_offset = true, measures_floor = false;
  bool mixes = true;                       // with other disturbances
  std::optional<double> reading_sigma_mm;  // stated to the calibration, if not the truth
  std::vector<std::string> may_refuse;
  std::vector<std::string> mixed;  // names of the kinds of a mixture
  YAML::Node simulate;
};

// `over` replaces what it names; maps are merged, and null removes a key.
YAML::Node Merged(const YAML::Node& base, const YAML::Node& over) {
  if (!base.IsMap() || !over.IsMap()) return YAML::Clone(over);
  YAML::Node result = YAML::Clone(base);
  for (const auto& entry : over) {
    const auto key = entry.first.as<std::string>();
    if (entry.second.IsNull()) {
      result.remove(key);
    } else {
      result[key] = result[key] ? Merged(result[key], entry.second) : YAML::Clone(entry.second);
    }
  }
  return result;
}

Kind ReadKind(const YAML::Node& node) {
  Kind kind;
  for (const auto& entry : node) {
    const auto key = entry.first.as<std::string>();
    const YAML::Node& value = entry.second;
    if (key == "name") {
      kind.name = value.as<std::string>();
    } else if (key == "disturbed") {
      kind.disturbed = value.as<bool>();
    } else if (key == "mixes") {
      kind.mixes = value.as<bool>();
    } else if (key == "offset") {
      kind.gives_offset = value.as<bool>();
    } else if (key == "floor") {
      kind.measures_floor = value.as<std::string>() == "measured";
    } else if (key == "reading_sigma_mm") {
      kind.reading_sigma_mm = value.as<double>();
    } else if (key == "may_refuse") {
      kind.may_refuse = value.as<std::vector<std::string>>();
    } else if (key == "simulate") {
      kind.simulate = value;
    } else {
      throw Error(fmt::format("kind '{}': unknown key '{}'", kind.name, key));
    }
  }
  return kind;
}

struct Study {
  std::string folder;  // of the file, for the paths in it
  YAML::Node base;
  std::vector<Kind> kinds;
};

Study ReadStudy(const std::string& path) {
  Study study;
  try {
    const YAML::Node root = YAML::LoadFile(path);
    study.folder = fs::absolute(path).parent_path().string();
    study.base = root["base"];
    for (const YAML::Node& node : root["kinds"]) study.kinds.push_back(ReadKind(node));
  } catch (const YAML::Exception& e) {
    throw Error(path + ": " + e.what());
  }
  return study;
}

// The simulation of a kind, read by the reader of such files.
model::SweepSimulationOptions SimulationOf(const Study& study, const Kind& kind,
                                           std::uint64_t seed) {
  YAML::Node merged =
      kind.simulate.IsMap() ? Merged(study.base, kind.simulate) : YAML::Clone(study.base);
  merged["camera"] =
      (fs::path(study.folder) / merged["camera"].as<std::string>()).lexically_normal().string();
  merged["seed"] = seed;
  static std::atomic<int> number{0};
  const fs::path path =
      fs::temp_directory_path() / fmt::format("thicklens-kind-{}-{}.yaml", getpid(), number++);
  std::ofstream(path) << merged << "\n";
  const model::SweepSimulationOptions options = model::ReadSweepSimulation(path.string());
  fs::remove(path);
  return options;
}

struct KindTrial {
  Trial trial;
  std::uint64_t seed = 0;
  bool wrong_reason = false;
  std::string reason;  // in full
  bool warned = false;
  std::vector<std::string> mixed;  // names of the kinds of a mixture
};

KindTrial RunOne(const Kind& kind, const model::SweepSimulationOptions& options) {
  testing::SimulatedSweep simulated = testing::Simulate(options);
  if (options.target.kind == model::TargetKind::kKnifeEdge)
    simulated.sweep.target = model::SweepTarget::kKnifeEdge;
  if (model::MovesFocus(options.moves)) simulated.sweep.moves = options.moves;
  if (!kind.gives_offset) simulated.sweep.offset_mm.reset();
  if (kind.reading_sigma_mm) simulated.sweep.reading_sigma_mm = *kind.reading_sigma_mm;
  if (options.counts_per_mm > 0) {
    constexpr double kStatedSigmaMm = 0.5;
    simulated.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth,
                                     {simulated.truth.focus_depth_mm, kStatedSigmaMm},
                                     "focus_depth_mm"}};
  }
  if (!kind.measures_floor) testing::GiveDrawnFloor(&simulated, options.seed);
  KindTrial result;
  result.seed = options.seed;
  result.mixed = kind.mixed;
  calib::CalibrationOptions how;
  how.threads = 1;
  try {
    const calib::Calibration c = calib::Calibrate(simulated.sweep, how);
    FillTrial(c, simulated.truth, &result.trial);
    result.trial.seconds = c.summary.seconds;
    result.reason = c.summary.reason;
    result.warned = !c.summary.warnings.empty();
  } catch (const std::exception& e) {
    result.reason = std::string("error: ") + e.what();
  }
  result.trial.step_mm = std::abs(options.step_mm);
  result.trial.true_blur_ratio = simulated.truth.blur_ratio;
  result.wrong_reason =
      !result.trial.done &&
      std::none_of(kind.may_refuse.begin(), kind.may_refuse.end(), [&](const std::string& words) {
        return result.reason.find(words) != std::string::npos;
      });
  return result;
}

// Distance of the truth from the interval and the value, in sigmas.
double SigmasBeyond(const Measured& m) {
  const double low = std::min(m.interval_low, m.error), high = std::max(m.interval_high, m.error);
  const double beyond = std::max({0.0, low, -high});
  return m.sigma > 0 ? beyond / m.sigma : beyond > 0 ? HUGE_VAL : 0;
}

// The errors of one of the results over all sweeps of a kind.
struct Row {
  double median = 0, quantile_90 = 0;     // of the magnitude of the error
  double goal_median = 0, goal_90 = 0;    // limits of these
  int inside_sigmas = 0, inside_all = 0;  // 1.96 sigmas; the interval and 2 sigmas
  int trials = 0, silent = 0;
  double half_width_ratio = 0;  // median half of the interval and 2 sigmas over quantile_90
  std::vector<double> errors;   // magnitudes

  // Says where the errors are larger than the goals.
  std::vector<std::string> MissedGoals(const char* name) const {
    std::vector<std::string> missed;
    const auto compare = [&](const char* what, double figure, double goal, double level) {
      if (!std::isfinite(goal) || trials == 0) return;
      const auto beyond = static_cast<int>(
          std::count_if(errors.begin(), errors.end(), [&](double e) { return e > goal; }));
      const bool is_missed = trials >= kShowQuantiles
                                 ? figure > goal
                                 : beyond > level * trials &&
                                       testing::BinomialTestP(beyond, trials, level) < kRejectionP;
      if (is_missed)
        missed.push_back(fmt::format("{}: {} {:.3g} % above the goal of {:.3g} %", name, what,
                                     100 * figure, 100 * goal));
    };
    compare("median", median, goal_median, 0.5);
    compare("90 % quantile", quantile_90, goal_90, 0.1);
    return missed;
  }

  Json ToJson() const {
    return {{"median", median},
            {"quantile_90", quantile_90},
            {"goal_median", std::isfinite(goal_median) ? Json(goal_median) : Json(nullptr)},
            {"goal_90", std::isfinite(goal_90) ? Json(goal_90) : Json(nullptr)},
            {"inside_1.96_sigma", inside_sigmas},
            {"inside_interval_and_2_sigma", inside_all},
            {"trials", trials},
            {"beyond_4_sigma", silent},
            {"half_width_over_quantile_90", half_width_ratio}};
  }
};

Row RowOf(const std::vector<KindTrial>& trials, Measured Trial::*result, double unit) {
  Row row;
  std::vector<double> errors, widths;
  for (const KindTrial& one : trials) {
    if (!one.trial.done) continue;
    const Measured& m = one.trial.*result;
    ++row.trials;
    errors.push_back(std::abs(m.error) / unit);
    widths.push_back((0.5 * (m.interval_high - m.interval_low) + 2 * m.sigma) / unit);
    row.inside_sigmas += std::abs(m.error) <= 1.96 * m.sigma;
    const double beyond = SigmasBeyond(m);
    row.inside_all += beyond <= 2;
    row.silent += beyond > kSilentSigmas;
  }
  if (errors.empty()) return row;
  row.median = testing::Median(errors);
  row.quantile_90 = testing::Quantile(errors, 0.9);
  row.half_width_ratio = testing::Median(widths) / row.quantile_90;
  row.errors = std::move(errors);
  return row;
}

void Print(const std::string& line) { std::cout << line << "\n" << std::flush; }

std::string Percent(double value) { return fmt::format("{:.2f}", 100 * value); }

Json EachTrial(const std::vector<KindTrial>& trials) {
  const auto measured = [](const Measured& m) {
    return Json{{"error", m.error},
                {"sigma", m.sigma},
                {"interval_minus_truth", {m.interval_low, m.interval_high}}};
  };
  Json list = Json::array();
  for (const KindTrial& one : trials) {
    Json entry = {{"seed", one.seed}};
    if (!one.mixed.empty()) entry["mixed"] = one.mixed;
    if (one.trial.done) {
      entry["focus_depth_mm"] = measured(one.trial.focus_depth_mm);
      entry["image_distance_mm"] = measured(one.trial.image_distance_mm);
      entry["blur_ratio"] = measured(one.trial.blur_ratio);
      entry["warned"] = one.warned;
    } else {
      entry["refused"] = one.reason;
      entry["wrong_reason"] = one.wrong_reason;
    }
    list.push_back(std::move(entry));
  }
  return list;
}

Json Report(const Kind& kind, const std::vector<KindTrial>& trials,
            const model::SweepSimulationOptions& options) {
  Row focus = RowOf(trials, &Trial::focus_depth_mm, std::abs(options.step_mm));
  Row ratio = RowOf(trials, &Trial::blur_ratio, options.camera.blur_ratio());
  const Row distance = RowOf(trials, &Trial::image_distance_mm, 1);
  // The figures are for a step of depth and for a stated bench offset: without one, zf and kappa
  // have the error of the offset, and their goal is that their intervals cover the truth.
  const bool moves_focus = model::MovesFocus(options.moves);
  const Bound bound = moves_focus ? Bound{} : BoundsOf(options, kFloorSigmaPx2).together;
  const double allowed = kind.disturbed ? 2 : 1;
  const double steps = bound.focus_depth_mm / std::abs(options.step_mm);
  focus.goal_median = allowed * std::max(0.015, kAboveBound * kGaussianMedian * steps);
  focus.goal_90 = allowed * std::max(0.04, kAboveBound * kGaussian90 * steps);
  ratio.goal_median = HUGE_VAL;
  ratio.goal_90 = std::max(kind.disturbed ? 0.015 : 0.007,
                           kAboveBound * kGaussian90 * bound.relative_blur_ratio);
  if (!kind.gives_offset) focus.goal_median = focus.goal_90 = ratio.goal_90 = HUGE_VAL;
  int done = 0, wrong = 0;
  double seconds = 0;
  std::map<std::string, int> reasons;
  for (const KindTrial& one : trials) {
    done += one.trial.done;
    wrong += one.wrong_reason;
    seconds += one.trial.seconds / static_cast<double>(trials.size());
    if (!one.trial.done) ++reasons[one.trial.reason.empty() ? one.reason : one.trial.reason];
  }
  std::vector<std::string> faults = focus.MissedGoals("zf");
  for (const std::string& missed : ratio.MissedGoals("kappa")) faults.push_back(missed);
  const auto covered = [&](const char* name, const Row& row) {
    const int inside = kind.disturbed ? row.inside_all : row.inside_sigmas;
    // Too much coverage is no fault of a disturbed kind.
    const bool fails = row.trials > 0 &&
                       testing::BinomialTestP(inside, row.trials, kLevel) < kRejectionP &&
                       (!kind.disturbed || inside < kLevel * row.trials);
    if (fails) faults.push_back(fmt::format("{} covered in {} of {}", name, inside, row.trials));
    if (kind.disturbed && row.trials >= kShowQuantiles && row.half_width_ratio > kWidestInterval)
      faults.push_back(fmt::format("{}: half of the interval is {:.2f} times the 90 % quantile",
                                   name, row.half_width_ratio));
    if (row.silent > 0)
      faults.push_back(fmt::format("{}: {} beyond 4 sigma of the interval", name, row.silent));
    return fmt::format("{}/{}{}", inside, row.trials, fails ? " !" : "");
  };
  const auto figure = [](double value, double goal) {
    return Percent(value) + (value > goal ? " !" : "");
  };
  Print(fmt::format(
      "| {} | {}/{} | {} | {} | {} | {} | {} | {} | {:.1f} | {:.1f} | {} | {} | {:.2f} |",
      kind.name, done, trials.size(), moves_focus ? "-" : figure(focus.median, focus.goal_median),
      moves_focus ? "-" : figure(focus.quantile_90, focus.goal_90),
      figure(ratio.quantile_90, ratio.goal_90), covered("zf", focus), covered("d1", distance),
      covered("kappa", ratio), focus.half_width_ratio, ratio.half_width_ratio,
      focus.silent + ratio.silent + distance.silent, wrong, seconds));
  const auto refused = static_cast<double>(trials.size()) - done;
  if (wrong > kMaxWrongReasons * refused)
    faults.push_back(fmt::format("{} of {} refusals for another reason", wrong, refused));
  for (const std::string& fault : faults) std::cerr << "  fault: " << fault << "\n";
  for (const auto& [reason, count] : reasons)
    std::cerr << fmt::format("  {} x {}\n", count, reason);
  return {{"kind", kind.name},
          {"disturbed", kind.disturbed},
          {"sweeps", trials.size()},
          {"done", done},
          {"focus_depth_steps", focus.ToJson()},
          {"image_distance_mm", distance.ToJson()},
          {"blur_ratio_relative", ratio.ToJson()},
          {"wrong_reasons", wrong},
          {"refusals", reasons},
          {"faults", faults},
          {"seconds", seconds},
          {"each", EachTrial(trials)}};
}

std::vector<KindTrial> RunAll(const Study& study, const std::vector<Kind>& kinds,
                              std::uint64_t first_seed, int threads) {
  std::vector<KindTrial> trials(kinds.size());
  ParallelFor(static_cast<int>(kinds.size()), threads, [&](int i) {
    const auto index = static_cast<std::size_t>(i);
    trials[index] = RunOne(kinds[index], SimulationOf(study, kinds[index], first_seed + index));
  });
  return trials;
}

// Two or three of the disturbances at once; a true reason of any of them is one of the mixture.
Kind MixtureOf(const std::vector<Kind>& disturbed, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  Kind mixture;
  mixture.name = "mixture";
  mixture.disturbed = true;
  mixture.simulate = YAML::Node(YAML::NodeType::Map);
  const int count = 2 + static_cast<int>(engine() % 2);
  for (int k = 0; k < count; ++k) {
    const Kind& one = disturbed[engine() % disturbed.size()];
    mixture.mixed.push_back(one.name);
    if (one.simulate.IsMap()) mixture.simulate = Merged(mixture.simulate, one.simulate);
    mixture.gives_offset = mixture.gives_offset && one.gives_offset;
    if (one.reading_sigma_mm) mixture.reading_sigma_mm = one.reading_sigma_mm;
    mixture.may_refuse.insert(mixture.may_refuse.end(), one.may_refuse.begin(),
                              one.may_refuse.end());
  }
  return mixture;
}

}  // namespace

Json RunKindsStudy(const KindsOptions& options) {
  const Study study = ReadStudy(options.path);
  for (const std::string& name : options.names) {
    if (std::none_of(study.kinds.begin(), study.kinds.end(),
                     [&](const Kind& kind) { return kind.name == name; }))
      throw Error(fmt::format("{} has no kind '{}'", options.path, name));
  }
  Print(
      "| kind | done | zf median, % of a step | 90 % | kappa 90 %, % | covered: zf | d1 | kappa | "
      "width zf | kappa | beyond 4 sigma | wrong reasons | s |");
  Print("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
  Json rows = Json::array();
  std::vector<Kind> disturbed;
  std::uint64_t seed = options.first_seed;
  for (const Kind& kind : study.kinds) {
    if (kind.disturbed && kind.mixes) disturbed.push_back(kind);
    const std::uint64_t first = seed;
    seed += 100000;  // the seeds of a kind do not depend on the others that run
    if (options.sweeps == 0) continue;
    if (!options.names.empty() &&
        std::find(options.names.begin(), options.names.end(), kind.name) == options.names.end())
      continue;
    const std::vector<Kind> kinds(static_cast<std::size_t>(options.sweeps), kind);
    rows.push_back(Report(kind, RunAll(study, kinds, first, options.threads),
                          SimulationOf(study, kind, first)));
  }
  if (options.mixtures > 0) {
    std::vector<Kind> mixtures;
    for (int i = 0; i < options.mixtures; ++i)
      mixtures.push_back(MixtureOf(disturbed, seed + static_cast<std::uint64_t>(i)));
    rows.push_back(Report(mixtures.front(), RunAll(study, mixtures, seed, options.threads),
                          SimulationOf(study, study.kinds.front(), seed)));
  }
  return rows;
}

}  // namespace thicklens::accuracy
