// The key `video` of a sweep file: a video and its readings.
#include "model/schema/sweep_video.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"

namespace thicklens::model {
namespace {

constexpr int kMaxFrames = 1'000'000;

// Takes a statement of the file. One of the command line may complete the file, but not contradict
// it: a file that is kept must say what was measured.
template <typename Value, typename Read>
void Take(const YamlNode& video, const char* key, const char* option, const Read& read,
          std::optional<Value>* value) {
  const auto node = video.Find(key);
  if (!node) return;
  const Value stated = read(*node);
  if (*value && !(**value == stated)) {
    throw node->ErrorHere(
        fmt::format("{} contradicts {} {}; state one of them", stated, option, **value));
  }
  *value = stated;
}

VideoSelection SelectionOf(const YamlNode& video, const VideoSelection& options) {
  VideoSelection selection = options;
  const auto number = [](const YamlNode& node) { return node.Number(); };
  Take(video, "reading_start", "--reading-start", number, &selection.reading_start);
  Take(video, "reading_end", "--reading-end", number, &selection.reading_end);
  const auto time = [](const YamlNode& node) { return node.NonNegativeNumber(); };
  Take(video, "time_start_s", "--time-start", time, &selection.time_start_s);
  Take(video, "time_end_s", "--time-end", time, &selection.time_end_s);
  std::optional<std::string> offset;
  if (!options.time_offset.empty()) offset = options.time_offset;
  Take(
      video, "time_offset", "--time-offset", [](const YamlNode& node) { return node.Text(); },
      &offset);
  selection.time_offset = offset.value_or("");
  Take(
      video, "every", "--every", [](const YamlNode& node) { return node.Integer(1, kMaxFrames); },
      &selection.every);
  Take(
      video, "frames", "--frames", [](const YamlNode& node) { return node.Integer(2, kMaxFrames); },
      &selection.frames);
  return selection;
}

// A constant speed has a unit and no columns.
void RequireNoColumns(const YamlNode& root) {
  for (const char* key : {"readings_column", "readings_file_column", "readings_decimal",
                          "readings_time_column", "readings_time_unit"}) {
    if (const auto extra = root.Find(key)) {
      throw extra->ErrorHere(
          "this key applies only to a table ('frames_csv'), and the video has a constant speed");
    }
  }
}

// Throws Error unless there is either a table or a constant speed.
void RequireOneSource(const YamlNode& root, const YamlNode& video,
                      const VideoSelection& selection) {
  const bool has_speed = selection.reading_start.has_value();
  const auto table = root.Find("frames_csv");
  if (table && has_speed) {
    const bool is_of_file = video.IsMap() && video.Has("reading_start");
    throw table->ErrorHere(fmt::format(
        "a table of readings, and also a constant speed ({}): one of them is expected",
        is_of_file ? "video.reading_start, video.reading_end" : "--reading-start, --reading-end"));
  }
  if (!table && !has_speed) {
    throw video.ErrorHere(
        "a video needs a table of its readings by time or by frame ('frames_csv'), or a constant "
        "speed ('reading_start' and 'reading_end')");
  }
  if (has_speed) RequireNoColumns(root);
}

}  // namespace

void ReadSweepVideo(const YamlNode& root, const YamlNode& video, const ReadingOptions& options,
                    const SweepReading& reading, SweepFile* sweep,
                    std::vector<std::string>* notices) {
  VideoSelection selection = reading.video;
  if (video.IsMap()) {
    video.RequireKeys({"file", "reading_start", "reading_end", "time_start_s", "time_end_s",
                       "time_offset", "every", "frames"});
    selection = SelectionOf(video, reading.video);
  }
  const YamlNode file = video.IsMap() ? video.At("file") : video;
  std::string why;
  if (!selection.IsValid(&why)) {
    throw video.ErrorHere(
        why + (reading.video.IsGiven() ? "; the options of the command line are included" : ""));
  }
  if (reading.readings.IsWithoutTable()) {
    throw video.ErrorHere(
        "the frames of a video have one name and one set of metadata; --reading-from and "
        "--reading-from-name do not apply");
  }
  RequireOneSource(root, video, selection);
  if (!options.IsValid(&why)) throw root.ErrorHere("readings: " + why);
  const std::string path = file.ResolvePath(file.Text());
  try {
    RequireRegularFile(path);
  } catch (const Error& error) {
    throw file.ErrorHere(error.what());
  }
  VideoTable table;
  if (const auto csv = root.Find("frames_csv"))
    table = ReadVideoTable(csv->ResolvePath(csv->Text()), path, options, reading.reader);
  if (!reading.video_reader) {
    throw file.ErrorHere("this program reads no videos; thicklens::ReadSweep does");
  }
  SweepFile read = FramesFromVideo(path, reading.video_reader(path, notices), table, selection,
                                   options, VideoStatements::kSweepFile, notices);
  sweep->frames = std::move(read.frames);
  sweep->readings = std::move(read.readings);
}

}  // namespace thicklens::model
