// thicklens calibrate --watch: what the frames of a sweep show while they arrive.
#include "tools/commands/calibrate_watch.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/watch.h"
#include "tools/options/interface_options.h"
#include "tools/report/rounding.h"
#include "tools/report/watch_text.h"
#include "tools/system/interrupt.h"
#include "tools/system/wait_for_line.h"

namespace thicklens::tools {
namespace {

constexpr double kLookSeconds = 0.5;  // between two looks at the folder

// Prints the lines as they come: the output may be a pipe.
void PrintNow(const CommonOptions& common, const std::string& text) {
  if (text.empty()) return;
  PrintResult(common, text);
  std::fflush(stdout);
}

// Returns what ends the sweep after a look; empty: nothing does. Waits until the next look.
std::string EndOf(const WatchUpdate& update, const FinishOnInterrupt& interrupt, LineWaiter* line) {
  if (update.is_ended) return update.ended_by;
  if (interrupt.IsAsked()) return "an interrupt";
  if (line->WaitFor(update.added.empty() ? kLookSeconds : 0)) return "a line on standard input";
  return "";
}

}  // namespace

WatchedSweep WatchSweep(const SweepArguments& arguments, std::optional<double> pause_s,
                        const CommonOptions& common) {
  OptionNames names = SweepOptionNames();
  names.Add({{"pause_s", "--watch-pause"}});
  const CommandRun run(common, names);
  return WithOptionNames(names, [&] {
    WatchOptions options;
    options.pause_s = pause_s;
    FolderWatch watch(arguments.input, arguments.readings_csv, SweepOverridesOf(arguments), options,
                      run.control());
    std::optional<FinishOnInterrupt> interrupt(std::in_place);
    PrintNow(common, fmt::format("watching {}: Enter, Ctrl-C, a file named done in it{} ends the "
                                 "sweep\n",
                                 PrintableUtf8(arguments.input),
                                 pause_s ? fmt::format(" or a pause of {:g} s", *pause_s) : ""));
    LineWaiter line;
    WatchText text;
    std::vector<LeftOutFile> left_out;
    std::string ended_by;
    calib::SweepProgressReport progress;
    const Clock::time_point start = Clock::now();
    for (bool is_all = false; ended_by.empty() || !is_all;) {
      WatchUpdate update = watch.Look(SecondsSince(start));
      PrintNow(common, text.Lines(update));
      left_out.insert(left_out.end(), update.left_out.begin(), update.left_out.end());
      // After the end, what is ready is still measured.
      is_all = !ended_by.empty() &&
               update.added.size() < static_cast<std::size_t>(options.most_per_look);
      if (ended_by.empty()) ended_by = EndOf(update, *interrupt, &line);
      progress = std::move(update.progress);
      // An interrupt ends the program as usual from here on.
      if (!ended_by.empty()) interrupt.reset();
      ThrowIfCancelled();
    }
    PrintNow(common, fmt::format("ended by {}: {} frames, {} of them usable\n\n", ended_by,
                                 progress.frames.size(), progress.usable));
    return WatchedSweep{watch.Finish(), WatchJson(progress, left_out, ended_by)};
  });
}

}  // namespace thicklens::tools
