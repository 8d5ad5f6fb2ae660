// thicklens bench calibration: accuracy of calibrations against run time.
#include "tools/bench/bench_calibration.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/io/simulated_sweep.h"
#include "thicklens/model/grey_focus.h"
#include "thicklens/model/thick_lens.h"
#include "tools/bench/bench_calibration_page.h"
#include "tools/bench/bench_calibration_rows.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_report.h"
#include "tools/bench/bench_sweep.h"
#include "tools/options/option_values.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

constexpr int kDefaultSweeps = 24, kFullSweeps = 100;
constexpr int kMinFieldPx = 16;

struct BenchCalibrationOptions {
  CommonOptions common;
  std::string sweep_path, report_folder;  // empty: none
  std::string frames, fields;             // as given; empty: the defaults
  std::optional<int> sweeps;
  bool full = false;
  std::int64_t seed = 1;
};

// The grid of measurements: each of these fields with each of these numbers of frames.
struct Grid {
  std::vector<int> fields_px, frames;  // the largest first
};

// One call of the calibration, and the rows that it gives.
struct Method {
  calib::CalibrationOptions options;
  struct Reading {
    std::string name;
    std::function<CalibrationTrial(const calib::Calibration&, const BenchSweep&)> trial;
  };
  std::vector<Reading> readings;
};

// CPU time of this thread, because other sweeps and other programs use the machine as well.
double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::optional<CalibrationError> ErrorOf(const std::optional<calib::Result>& result, double truth,
                                        double scale) {
  if (!result) return std::nullopt;
  return CalibrationError{scale * (result->value - truth), scale * result->sigma};
}

constexpr double kMmToUm = 1000;
double ToPercentOf(double truth) { return 100 / truth; }

// Frames in colour are calibrated as grey.
double GreyFocusMm(const model::SweepTruth& truth) {
  return model::GreyFocusDepthMm(truth.aberrations, truth.focus_depth_mm);
}

CalibrationTrial OfFit(const calib::Calibration& c, const BenchSweep& bench) {
  CalibrationTrial trial;
  trial.outcome = c.summary.outcome;
  trial.reason = c.summary.reason;
  if (c.summary.outcome == calib::Outcome::kRefused) return trial;
  const model::SweepTruth& truth = bench.truth;
  trial.focus_depth_mm = ErrorOf(c.summary.focus_depth_mm, GreyFocusMm(truth), 1);
  trial.image_distance_um = ErrorOf(c.summary.image_distance_mm, truth.image_distance_mm, kMmToUm);
  trial.blur_ratio_percent =
      ErrorOf(c.summary.blur_ratio, truth.blur_ratio, ToPercentOf(truth.blur_ratio));
  return trial;
}

// The trial of a part of the calibration: done, or refused with its own reason or that of the whole
// calibration.
CalibrationTrial OfPart(bool done, const std::string& message, const calib::Calibration& c) {
  CalibrationTrial trial;
  if (done) {
    trial.outcome = calib::Outcome::kOk;
  } else {
    trial.reason = c.summary.outcome == calib::Outcome::kRefused ? c.summary.reason : message;
  }
  return trial;
}

CalibrationTrial OfPeak(const calib::Calibration& c, const BenchSweep& bench) {
  const calib::SharpnessPeak& peak = c.diagnostics.sharpness;
  const model::ThickLens& lens = bench.sweep.camera.lens;
  const bool done = peak.done && peak.focus_depth_mm > lens.front_focal_length_mm;
  CalibrationTrial trial = OfPart(done, peak.message, c);
  if (!done) return trial;
  trial.focus_depth_mm =
      CalibrationError{peak.focus_depth_mm - GreyFocusMm(bench.truth), peak.sigma_mm};
  const double image_distance_mm = model::ImageDistanceMm(lens, peak.focus_depth_mm);
  trial.image_distance_um =
      CalibrationError{kMmToUm * (image_distance_mm - bench.truth.image_distance_mm), std::nullopt};
  return trial;
}

CalibrationTrial OfSource(const calib::Calibration& c, const BenchSweep& bench) {
  const calib::SourceRecipe& source = c.diagnostics.paper_recipe;
  CalibrationTrial trial = OfPart(source.done, source.message, c);
  if (!source.done) return trial;
  const model::SweepTruth& truth = bench.truth;
  const auto error = [](double difference) { return CalibrationError{difference, std::nullopt}; };
  trial.focus_depth_mm = error(source.focus_depth_mm - GreyFocusMm(truth));
  trial.image_distance_um = error(kMmToUm * (source.image_distance_mm - truth.image_distance_mm));
  trial.blur_ratio_percent =
      error(ToPercentOf(truth.blur_ratio) * (source.blur_ratio - truth.blur_ratio));
  return trial;
}

std::vector<Method> Methods() {
  calib::CalibrationOptions fit;
  fit.threads = 1;  // the sweeps run side by side
  calib::CalibrationOptions no_field = fit;
  no_field.map_field = false;
  calib::CalibrationOptions no_fit = no_field;
  no_fit.fit_blur = false;
  return {{fit, {{"fit", OfFit}}},
          {no_field, {{"fit-no-field", OfFit}}},
          {no_fit, {{"peak", OfPeak}, {"source", OfSource}}}};
}

// Returns the trials of each reading of the method, in its order.
std::vector<CalibrationTrial> RunMethod(const Method& method, const calib::FocusSweep& sweep,
                                        const BenchSweep& bench) {
  std::vector<CalibrationTrial> trials;
  const double begin = ThreadSeconds();
  calib::Calibration calibration;
  try {
    calibration = calib::Calibrate(sweep, method.options);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {  // only this sweep fails, the others go on
    calibration.summary.reason = error.what();
  }
  const double seconds = ThreadSeconds() - begin;
  for (const Method::Reading& reading : method.readings) {
    trials.push_back(reading.trial(calibration, bench));
    trials.back().seconds = seconds;
  }
  return trials;
}

std::vector<int> LargestFirst(std::vector<int> values) {
  std::sort(values.begin(), values.end(), std::greater<>());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

std::vector<int> WithinOrThrow(const std::string& option, const std::string& text, int least,
                               int most, const std::string& what) {
  const std::vector<int> values = SplitPixels(option, text, ',', "N,N,...");
  for (const int value : values) {
    if (value < least || value > most) {
      throw UsageError(fmt::format("{}: numbers from {} to {} ({}) are expected, found {}", option,
                                   least, most, what, value));
    }
  }
  return values;
}

Grid GridOf(const BenchCalibrationOptions& options,
            const model::SweepSimulationOptions& description) {
  Grid grid;
  const int count = description.frame_count;
  const model::Sensor& sensor = description.camera.sensor;
  const int side_px = std::min(sensor.width_px, sensor.height_px);
  if (side_px < kMinFieldPx) {
    throw Error(fmt::format("{}: the sensor's shorter side is {} px, at least {} px are needed",
                            options.sweep_path, side_px, kMinFieldPx));
  }
  if (!options.frames.empty()) {
    grid.frames = WithinOrThrow("--frames", options.frames, 1, count, "the frames of the sweep");
  } else {
    for (const int part : options.full ? std::vector<int>{2, 3, 4, 6, 8} : std::vector<int>{2, 4})
      grid.frames.push_back((count + part - 1) / part);
    grid.frames.push_back(count);
  }
  if (!options.fields.empty()) {
    grid.fields_px = WithinOrThrow("--field-px", options.fields, kMinFieldPx, side_px,
                                   "the sensor's shorter side");
  } else {
    for (const int field_px : options.full ? std::vector<int>{64, 96, 128, 192, 256, 384}
                                           : std::vector<int>{64, 128, 256}) {
      if (field_px <= side_px) grid.fields_px.push_back(field_px);
    }
    if (grid.fields_px.empty()) grid.fields_px.push_back(side_px);
  }
  grid.frames = LargestFirst(grid.frames);
  grid.fields_px = LargestFirst(grid.fields_px);
  return grid;
}

// The trials of every row, ordered by sweep.
class TrialTable {
 public:
  TrialTable(const Grid& grid, const std::vector<Method>& methods, int sweeps) : grid_(grid) {
    for (const Method& method : methods) {
      for (const Method::Reading& reading : method.readings) names_.push_back(reading.name);
    }
    trials_.resize(names_.size() * grid.fields_px.size() * grid.frames.size(),
                   std::vector<CalibrationTrial>(static_cast<std::size_t>(sweeps)));
  }

  // `reading` counts through the readings of all methods, `field` and `frames` are indices into the
  // grid.
  std::vector<CalibrationTrial>& At(std::size_t reading, std::size_t field, std::size_t frames) {
    return trials_[(reading * grid_.fields_px.size() + field) * grid_.frames.size() + frames];
  }

  std::vector<CalibrationRow> Rows() {
    std::vector<CalibrationRow> rows;
    for (std::size_t reading = 0; reading < names_.size(); ++reading) {
      for (std::size_t field = 0; field < grid_.fields_px.size(); ++field) {
        for (std::size_t frames = 0; frames < grid_.frames.size(); ++frames) {
          rows.push_back(MakeCalibrationRow(names_[reading], grid_.frames[frames],
                                            grid_.fields_px[field], At(reading, field, frames)));
        }
      }
    }
    MarkFront(&rows);
    return rows;
  }

 private:
  const Grid& grid_;
  std::vector<std::string> names_;
  std::vector<std::vector<CalibrationTrial>> trials_;
};

// Measures one simulated sweep with all methods.
void MeasureSweep(const BenchSweep& bench, const Grid& grid, const std::vector<Method>& methods,
                  std::size_t sweep, const std::function<void()>& tell, TrialTable* table) {
  std::size_t first_reading = 0;
  for (const Method& method : methods) {
    for (std::size_t field = 0; field < grid.fields_px.size(); ++field) {
      for (std::size_t frames = 0; frames < grid.frames.size(); ++frames) {
        ThrowIfCancelled();
        const auto trials = RunMethod(
            method, PartOfSweep(bench, grid.frames[frames], grid.fields_px[field]), bench);
        for (std::size_t i = 0; i < trials.size(); ++i)
          table->At(first_reading + i, field, frames)[sweep] = trials[i];
        tell();
      }
    }
    first_reading += method.readings.size();
  }
}

std::vector<CalibrationRow> Measure(const BenchCalibrationOptions& options,
                                    const model::SweepSimulationOptions& description,
                                    const Grid& grid, int sweeps) {
  const model::LinearImage target_image = io::ReadTargetImage(description.target);
  const std::vector<Method> methods = Methods();
  TrialTable table(grid, methods, sweeps);
  const int runs = static_cast<int>(methods.size() * grid.fields_px.size() * grid.frames.size());
  ProgressLine progress("calibrating", options.common.quiet);
  std::atomic<int> done{0};
  cv::setNumThreads(1);  // otherwise the CPU time of its threads is not counted
  ParallelFor(sweeps, options.common.threads, [&](int i) {
    const BenchSweep bench =
        MakeBenchSweep(description, target_image, grid.fields_px.front(),
                       static_cast<std::uint64_t>(options.seed) + static_cast<std::uint64_t>(i));
    MeasureSweep(
        bench, grid, methods, static_cast<std::size_t>(i),
        [&] { progress.Show(++done, sweeps * runs); }, &table);
  });
  return table.Rows();
}

std::string AboutText(const BenchCalibrationOptions& options,
                      const model::SweepSimulationOptions& description, int sweeps,
                      const std::string& processor) {
  return fmt::format(
      "{}: {} simulated sweeps of up to {} frames, {} mm apart, target {}, seeds from {}; {}, CPU "
      "time with one thread per calibration",
      options.sweep_path.empty() ? "bench sweep" : options.sweep_path, sweeps,
      description.frame_count, std::abs(description.step_mm),
      model::TargetKindName(description.target.kind), options.seed, processor);
}

std::string TextOf(const std::string& about, int sweeps, const std::vector<CalibrationRow>& rows) {
  const double percent_68 = 100 * BinomialStandardError(0.6827, sweeps);
  const double percent_95 = 100 * BinomialStandardError(0.95, sweeps);
  return about + "\n\n" + CalibrationRowsText(rows) +
         fmt::format(
             "\n* on the Pareto front: no other row has as small an error of d1 in as little "
             "time.\nErrors: medians of magnitudes over all sweeps. 68, 95: percentage of the "
             "stated\nintervals of that level that contain the truth; over all sweeps, chance "
             "changes\nthem by {:.0f} and {:.0f}. peak and source come from one run that ends "
             "before the\nfit; d1 of peak is computed from its zf by (13); source states no "
             "intervals.\n",
             percent_68, percent_95);
}

json SweepJson(const BenchCalibrationOptions& options,
               const model::SweepSimulationOptions& description) {
  return {{"description", options.sweep_path.empty() ? "built in" : options.sweep_path},
          {"target", model::TargetKindName(description.target.kind)},
          {"frames", description.frame_count},
          {"step_mm", std::abs(description.step_mm)},
          {"reading_sigma_mm", description.reading_sigma_mm},
          {"first_seed", options.seed}};
}

CommandResult BenchCalibration(const BenchCalibrationOptions& options) {
  const model::SweepSimulationOptions description =
      options.sweep_path.empty() ? BenchSweepOptions()
                                 : model::ReadSweepSimulation(options.sweep_path);
  ReportDeprecated(options.common, description.notices);
  const Grid grid = GridOf(options, description);
  const int sweeps = options.sweeps.value_or(options.full ? kFullSweeps : kDefaultSweeps);
  BenchReport report(options.report_folder);

  const std::vector<CalibrationRow> rows = Measure(options, description, grid, sweeps);
  ThrowIfCancelled();
  json summary = BenchSummary({{"sweep", SweepJson(options, description)},
                               {"sweeps", sweeps},
                               {"seconds_are", "CPU time of one thread"}});
  const std::string about =
      AboutText(options, description, sweeps, summary["machine"]["processor"].get<std::string>());
  report.Commit(CalibrationCostPage(rows, about), CalibrationRowsCsv(rows),
                {CalibrationCostFigure(rows)});
  json json_rows = json::array();
  for (const CalibrationRow& row : rows) json_rows.push_back(CalibrationRowJson(row));
  summary["rows"] = json_rows;
  PrintResult(options.common, TextOf(about, sweeps, rows));
  return {std::move(summary), "", !options.report_folder.empty()};
}

}  // namespace

void AddBenchCalibrationCommand(CLI::App* bench, CommandAction* action) {
  CLI::App* command = bench->add_subcommand(
      "calibration",
      "Calibration methods by number of frames and field: errors, coverage, seconds");
  const auto options = std::make_shared<BenchCalibrationOptions>();
  command
      ->add_option("--sweep", options->sweep_path,
                   "Sweep to simulate, as for `simulate sweep`; default: 50 mm at f/2.8 on 300 mm, "
                   "31 frames of dead leaves")
      ->type_name("CONFIG");
  command
      ->add_option("--frames", options->frames,
                   "Numbers of frames to use, e.g. 31,16,8; default: all, a half, a "
                   "quarter")
      ->type_name("N,...");
  command
      ->add_option("--field-px", options->fields,
                   "Sides of the square in the middle of the sensor; default 256,128,64")
      ->type_name("PX,...");
  command
      ->add_option("--sweeps", options->sweeps,
                   fmt::format("Number of simulated sweeps; default {}, with --full {}",
                               kDefaultSweeps, kFullSweeps))
      ->check(CLI::Range(1, 100000))
      ->type_name("N");
  command->add_flag("--full", options->full, "More fields, more numbers of frames, more sweeps");
  command
      ->add_option("--seed", options->seed,
                   "Seed of the first sweep; each further sweep uses the next number")
      ->check(CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max() / 2))
      ->capture_default_str()
      ->type_name("N");
  AddBenchReportOption(command, &options->report_folder);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RequireDistinctFiles({options->report_folder, options->common.json_path},
                           {options->sweep_path});
      RunCommand(options->common, [&] { return BenchCalibration(*options); });
    };
  });
}

}  // namespace thicklens::tools
