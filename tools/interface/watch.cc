#include "thicklens/watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/io/readings.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/opencv.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/sweep_of_frames.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

constexpr char kDoneName[] = "done";
// After so many frames it must be known what value stands for white.
constexpr std::size_t kFramesToExamine = 5;

// The size of a file and since when it has it.
struct SizeOfFile {
  std::uintmax_t bytes = 0;
  double since_s = 0;
};

// A file of the folder that may become a frame.
struct Candidate {
  SizeOfFile size;
  std::optional<double> failed_since_s;  // since when it cannot be decoded or has no own reading
  std::string failure;                   // the last reason
  std::string state;                     // what it waited for in the last look
  bool has_own_reading = false;          // without a table: its reading was found
  bool is_left_out = false;
  std::optional<std::size_t> frame;  // index of the measured frame
};

// A reason without the path that it begins with.
std::string WithoutPath(const std::string& reason, const std::string& path) {
  const std::string begin = path + ": ";
  return reason.rfind(begin, 0) == 0 ? reason.substr(begin.size()) : reason;
}

std::string NameOf(const std::string& path) { return fs::path(path).filename().string(); }

}  // namespace

bool WatchOptions::IsValid(std::string* why) const {
  return checks::NonNegative(why, "settle_s", settle_s) &&
         checks::NonNegative(why, "broken_after_s", broken_after_s) &&
         (!pause_s || checks::Positive(why, "pause_s", *pause_s)) &&
         checks::WholeBetween(why, "most_per_look", 1, 100000, most_per_look) &&
         checks::Residual(why, "wanted_blur_ratio_error", wanted_blur_ratio_error);
}

struct FolderWatch::Impl {
  Impl(std::string of, std::string readings_csv, const SweepOverrides& with,
       const WatchOptions& how, const RunControl& run)
      : folder(std::move(of)),
        table(std::move(readings_csv)),
        overrides(with),
        options(how),
        control(run) {}

  WatchUpdate Look(double now_s);
  Sweep Finish() const;

  // Updates a size. Returns whether it has not changed for long enough.
  bool IsSettled(const std::string& path, double now_s, SizeOfFile* size);
  // The images that are whole; counts the others.
  std::vector<std::string> Whole(double now_s, WatchUpdate* update);
  // Reads the readings of whole images. Returns whether there are any.
  bool ReadReadings(const std::vector<std::string>& whole, double now_s, WatchUpdate* update);
  // Images whose own reading, in the name or in the file, can be read.
  std::vector<std::string> WithOwnReading(const std::vector<std::string>& whole, double now_s,
                                          WatchUpdate* update);
  void TakeChangedReadings();
  void Measure(double now_s, WatchUpdate* update);
  // The file of a frame; null if it is none of the folder.
  Candidate* CandidateOf(const std::string& image);
  // Reads a frame. Returns whether this is possible.
  bool Decode(const model::SweepFrame& frame, Candidate* candidate, double now_s, cv::Mat* stored,
              WatchUpdate* update);
  bool Examine(double now_s, WatchUpdate* update);
  void SetStates(const std::vector<std::string>& images, const std::string& state);
  Sweep SweepOfMeasured() const;
  void Fail(Candidate* candidate, const std::string& path, const std::string& reason, double now_s,
            WatchUpdate* update) const;
  void LeaveOut(Candidate* candidate, const std::string& path, const std::string& reason,
                WatchUpdate* update) const;
  void End(double now_s, bool is_busy, WatchUpdate* update) const;
  static void Wait(const std::string& reason, WatchUpdate* update) {
    if (update->waiting++ == 0) update->waiting_reason = reason;
  }

  std::string folder, table;
  SweepOverrides overrides;
  WatchOptions options;
  RunControl control;

  std::map<std::string, Candidate> candidates;  // by the path
  SizeOfFile table_size;
  std::uintmax_t table_bytes_read = 0;
  std::set<std::string> images_read;  // that the sweep below was read with
  std::optional<Sweep> sweep;         // of all whole images that have a reading
  std::optional<Sweep> examined;
  std::set<std::string> failed_now;  // images that this look could not decode
  std::string blocked;               // why no frame can be measured; empty: nothing is wrong
  std::string table_failure;         // why the last settled table could not be read; empty: it was
  std::optional<calib::SweepProgress> progress;
  calib::SweepProgressReport report;
  std::map<std::string, std::string> rejection_of;  // by the image
  std::vector<std::string> measured;                // images, by the index of the frame
  std::optional<double> changed_s;                  // when the folder changed last
};

bool FolderWatch::Impl::IsSettled(const std::string& path, double now_s, SizeOfFile* size) {
  std::error_code failure;
  const std::uintmax_t bytes = fs::file_size(path, failure);
  if (failure) return false;
  if (size->bytes != bytes) {
    *size = {bytes, now_s};
    changed_s = now_s;
  }
  return bytes > 0 && now_s - size->since_s >= options.settle_s;
}

std::vector<std::string> FolderWatch::Impl::Whole(double now_s, WatchUpdate* update) {
  std::vector<std::string> whole;
  for (const std::string& path : model::ImagesOfFolder(folder)) {
    ThrowIfCancelled();
    const auto [at, is_new] = candidates.try_emplace(path);
    Candidate& candidate = at->second;
    if (is_new) {
      candidate.size.since_s = now_s;
      changed_s = now_s;
    }
    const std::uintmax_t bytes = candidate.size.bytes;
    const bool is_settled = IsSettled(path, now_s, &candidate.size);
    if (candidate.size.bytes != bytes && !candidate.frame) {  // a file that grows is tried again
      candidate.failed_since_s.reset();
      candidate.failure.clear();
      candidate.is_left_out = false;
    }
    if (candidate.is_left_out) continue;
    if (is_settled || candidate.frame) {
      whole.push_back(path);
    } else {
      candidate.state = "it was still being written";
      Wait(NameOf(path) + " is still being written", update);
    }
  }
  return whole;
}

void FolderWatch::Impl::SetStates(const std::vector<std::string>& images,
                                  const std::string& state) {
  for (const std::string& path : images) candidates.at(path).state = state;
}

void FolderWatch::Impl::LeaveOut(Candidate* candidate, const std::string& path,
                                 const std::string& reason, WatchUpdate* update) const {
  candidate->is_left_out = true;
  candidate->failure = WithoutPath(reason, path);
  update->left_out.push_back({path, candidate->failure});
}

void FolderWatch::Impl::Fail(Candidate* candidate, const std::string& path,
                             const std::string& reason, double now_s, WatchUpdate* update) const {
  if (!candidate->failed_since_s) candidate->failed_since_s = now_s;
  candidate->failure = WithoutPath(reason, path);
  if (now_s - *candidate->failed_since_s >= options.broken_after_s) {
    LeaveOut(candidate, path, reason, update);
  } else {
    Wait(reason, update);
  }
}

std::vector<std::string> FolderWatch::Impl::WithOwnReading(const std::vector<std::string>& whole,
                                                           double now_s, WatchUpdate* update) {
  std::vector<std::string> with;
  for (const std::string& path : whole) {
    Candidate& candidate = candidates.at(path);
    if (!candidate.has_own_reading) {
      try {
        io::ReadReadings("", {path}, overrides.readings);
        candidate.has_own_reading = true;
        candidate.failed_since_s.reset();
        candidate.failure.clear();
      } catch (const Interrupted&) {
        throw;
      } catch (const Error& error) {
        Fail(&candidate, path, error.what(), now_s, update);
        continue;
      }
    }
    with.push_back(path);
  }
  return with;
}

bool FolderWatch::Impl::ReadReadings(const std::vector<std::string>& whole, double now_s,
                                     WatchUpdate* update) {
  bool table_is_new = false;
  if (!table.empty()) {
    std::error_code failure;
    if (!fs::exists(table, failure)) {
      SetStates(whole, "the table of readings did not exist");
      if (!whole.empty()) Wait("the table of readings does not exist yet", update);
      return false;
    }
    // A row that is only half written must not be read: "31" of "31.5".
    if (!IsSettled(table, now_s, &table_size)) {
      if (!sweep) {
        SetStates(whole, "the table of readings was still being written");
        if (!whole.empty()) Wait("the table of readings is still being written", update);
        return false;
      }
    } else {
      table_is_new = table_size.bytes != table_bytes_read;
    }
  }
  const std::vector<std::string> images =
      table.empty() ? WithOwnReading(whole, now_s, update) : whole;
  std::set<std::string> now(images.begin(), images.end());
  // While the table is being written, its last reading stands.
  const bool is_table_settled = table.empty() || now_s - table_size.since_s >= options.settle_s;
  if (!images.empty() && is_table_settled && (table_is_new || now != images_read)) {
    try {
      sweep = ReadSweepOfFrames(folder, images, table, overrides, control).sweep;
      images_read = std::move(now);
      table_bytes_read = table_size.bytes;
      table_failure.clear();
    } catch (const Interrupted&) {
      throw;
    } catch (const OptionError&) {
      throw;
    } catch (const Error& error) {
      table_failure = error.what();
      SetStates(images, table_failure);
      Wait(table_failure, update);
      return sweep.has_value();
    }
    TakeChangedReadings();
  }
  std::set<std::string> with_reading;
  if (sweep) {
    for (const model::SweepFrame& frame : sweep->description.frames)
      with_reading.insert(frame.image);
  }
  for (const std::string& path : images) {
    const std::string normal = fs::path(path).lexically_normal().string();
    if (with_reading.count(normal) == 0 && with_reading.count(path) == 0) {
      candidates.at(path).state = "it had no reading";
      Wait(NameOf(path) + " has no reading yet", update);
    }
  }
  return sweep.has_value();
}

void FolderWatch::Impl::TakeChangedReadings() {
  std::map<std::string, double> reading_of;
  for (const model::SweepFrame& frame : sweep->description.frames)
    reading_of[frame.image] = frame.reading_mm;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const auto found = reading_of.find(measured[i]);
    if (found == reading_of.end() || found->second == report.frames[i].reading_mm) continue;
    progress->SetReading(i, found->second);
  }
}

Candidate* FolderWatch::Impl::CandidateOf(const std::string& image) {
  auto at = candidates.find(image);
  if (at == candidates.end()) {
    at = std::find_if(candidates.begin(), candidates.end(), [&](const auto& entry) {
      return fs::path(entry.first).lexically_normal() == fs::path(image);
    });
  }
  return at == candidates.end() ? nullptr : &at->second;
}

bool FolderWatch::Impl::Decode(const model::SweepFrame& frame, Candidate* candidate, double now_s,
                               cv::Mat* stored, WatchUpdate* update) {
  if (failed_now.count(frame.image) > 0) return false;
  try {
    *stored = io::FrameFiles({frame}, sweep->description.full_scale).Read(0);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    failed_now.insert(frame.image);
    Fail(candidate, frame.image, error.what(), now_s, update);
    return false;
  }
  candidate->failed_since_s.reset();
  candidate->failure.clear();
  return true;
}

// Finds once which value stands for white, and by what the frames are corrected, from the frames
// that can be decoded. Returns whether it is known.
bool FolderWatch::Impl::Examine(double now_s, WatchUpdate* update) {
  if (examined) return true;
  Sweep decoded = *sweep;
  decoded.description.frames.clear();
  for (const model::SweepFrame& frame : sweep->description.frames) {
    ThrowIfCancelled();
    Candidate* candidate = CandidateOf(frame.image);
    if (candidate == nullptr || candidate->is_left_out) continue;
    cv::Mat stored;
    if (!Decode(frame, candidate, now_s, &stored, update)) continue;
    decoded.description.frames.push_back(frame);
    // Further frames are read only to find which of 16 bits are used.
    if (sweep->description.full_scale || stored.depth() != CV_16U) break;
  }
  const std::vector<model::SweepFrame>& frames = decoded.description.frames;
  if (frames.empty()) return false;
  blocked.clear();
  try {
    examined = ExamineFrames(decoded, control);
  } catch (const Interrupted&) {
    throw;
  } catch (const UndecidedFullScale& error) {
    if (frames.size() >= kFramesToExamine) throw;
    blocked = error.what();
    Wait("more frames are needed to find which value stands for white", update);
  }
  if (!examined) {
    for (const model::SweepFrame& frame : frames) CandidateOf(frame.image)->state = blocked;
    return false;
  }
  calib::SweepProgressOptions settings;
  settings.wanted_blur_ratio_error = options.wanted_blur_ratio_error;
  progress.emplace(FocusSweepOf(*examined), settings);
  return true;
}

void FolderWatch::Impl::Measure(double now_s, WatchUpdate* update) {
  int left = options.most_per_look;
  const std::size_t before = measured.size();
  failed_now.clear();
  if (!Examine(now_s, update)) return;
  for (const model::SweepFrame& frame : sweep->description.frames) {
    ThrowIfCancelled();
    Candidate* candidate = CandidateOf(frame.image);
    if (candidate == nullptr || candidate->frame || candidate->is_left_out) continue;
    if (left == 0) {
      candidate->state = "it was not measured yet";
      Wait(NameOf(frame.image) + " is measured next", update);
      continue;
    }
    cv::Mat stored;
    if (!Decode(frame, candidate, now_s, &stored, update)) continue;
    try {
      if (examined->description.full_scale != sweep->description.full_scale)
        stored = io::FrameFiles({frame}, examined->description.full_scale).Read(0);
      progress->Add(frame, stored);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {  // it does not fit the camera or the full scale
      LeaveOut(candidate, frame.image, error.what(), update);
      continue;
    }
    candidate->frame = measured.size();
    measured.push_back(frame.image);
    update->added.push_back(*candidate->frame);
    --left;
  }
  report = progress->Report();
  for (std::size_t i = 0; i < report.frames.size(); ++i) {
    std::string& known = rejection_of[report.frames[i].image];
    if (i < before && known.empty() && !report.frames[i].rejection.empty())
      update->rejected.push_back(i);
    known = report.frames[i].rejection;
  }
}

void FolderWatch::Impl::End(double now_s, bool is_busy, WatchUpdate* update) const {
  if (is_busy) return;
  std::error_code failure;
  if (fs::exists(fs::path(folder) / kDoneName, failure)) {
    update->is_ended = true;
    update->ended_by = fmt::format("the file {}", kDoneName);
  } else if (options.pause_s && changed_s && now_s - *changed_s >= *options.pause_s) {
    update->is_ended = true;
    update->ended_by = fmt::format("a pause of {:g} s", *options.pause_s);
  }
}

WatchUpdate FolderWatch::Impl::Look(double now_s) {
  WatchUpdate update;
  if (!changed_s) changed_s = now_s;
  const std::vector<std::string> whole = Whole(now_s, &update);
  const std::size_t unfinished = update.waiting;
  if (ReadReadings(whole, now_s, &update)) Measure(now_s, &update);
  update.progress = report;
  const bool is_retried = std::any_of(candidates.begin(), candidates.end(), [](const auto& entry) {
    return entry.second.failed_since_s && !entry.second.is_left_out && !entry.second.frame;
  });
  const bool table_grows = !table.empty() && now_s - table_size.since_s < options.settle_s;
  End(now_s, unfinished > 0 || is_retried || table_grows || !update.added.empty(), &update);
  return update;
}

// The measured frames with the readings of the last table that was whole.
Sweep FolderWatch::Impl::SweepOfMeasured() const {
  std::error_code failure;
  const bool is_as_read =
      table.empty() || (fs::file_size(table, failure) == table_bytes_read && !failure);
  Sweep found;
  if (is_as_read) {
    found = ReadSweepOfFrames(folder, measured, table, overrides, control).sweep;
  } else {
    found = *sweep;
    std::vector<model::SweepFrame>& frames = found.description.frames;
    const std::set<std::string> kept(measured.begin(), measured.end());
    frames.erase(std::remove_if(frames.begin(), frames.end(),
                                [&](const auto& frame) { return kept.count(frame.image) == 0; }),
                 frames.end());
    found.notices.push_back(fmt::format(
        "{}: the readings are those before its last change: {}", table,
        table_failure.empty() ? "it was still being written when the sweep ended" : table_failure));
  }
  std::set<std::string> with_reading;
  for (const model::SweepFrame& frame : found.description.frames) with_reading.insert(frame.image);
  for (const std::string& image : measured) {
    if (with_reading.count(image) == 0) {
      found.notices.push_back(
          fmt::format("{} is left out: its reading is not in the table any more", image));
    }
  }
  if (with_reading.empty())
    throw Error(fmt::format("{}: none of the measured frames has a reading any more", table));
  return found;
}

Sweep FolderWatch::Impl::Finish() const {
  const auto reason_of = [](const Candidate& candidate) {
    return candidate.failure.empty() ? candidate.state : candidate.failure;
  };
  if (measured.empty()) {
    std::string reason = blocked.empty() ? table_failure : blocked;
    for (const auto& [path, candidate] : candidates) {
      if (!reason.empty()) break;
      if (!reason_of(candidate).empty()) reason = path + ": " + reason_of(candidate);
    }
    throw Error(fmt::format("{}: no frame arrived that could be measured{}{}", folder,
                            reason.empty() ? "" : ": ", reason));
  }
  Sweep found = SweepOfMeasured();
  for (const auto& [path, candidate] : candidates) {
    if (candidate.frame) continue;
    const std::string reason = reason_of(candidate);
    found.notices.push_back(
        fmt::format("{} is left out: {}", path, reason.empty() ? "it was not examined" : reason));
  }
  return found;
}

FolderWatch::FolderWatch(const std::string& folder, const std::string& readings_csv,
                         const SweepOverrides& overrides, const WatchOptions& options,
                         const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValid(overrides);
  checks::RequireValid(options);
  const RunScope scope(run);
  std::error_code failure;
  if (!fs::is_directory(folder, failure)) {
    throw Error(fmt::format(
        "{}: a folder into which the frames are written is expected, and there is none", folder));
  }
  if (overrides.camera_path.empty()) {
    throw OptionError(
        "camera_path",
        fmt::format("camera_path: {} is a folder of frames, which needs a camera file "
                    "(thicklens camera init makes one)",
                    folder));
  }
  if (readings_csv.empty() != overrides.readings.IsWithoutTable()) {
    throw OptionError("readings", fmt::format("readings: {} needs either a table of readings, or "
                                              "that they are in the names or in the files",
                                              folder));
  }
  model::ReadCamera(overrides.camera_path);
  impl_ = std::make_unique<Impl>(folder, readings_csv, overrides, options, run);
}
FolderWatch::~FolderWatch() = default;

WatchUpdate FolderWatch::Look(double now_s) {
  const RunScope scope(impl_->control);
  return impl_->Look(now_s);
}
Sweep FolderWatch::Finish() const {
  const RunScope scope(impl_->control);
  return impl_->Finish();
}

}  // namespace thicklens
