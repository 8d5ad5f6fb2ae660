#include "thicklens/model/growing_sweep.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <set>

#include "model/schema/frame_pairing.h"
#include "model/schema/sweep_frames.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {

GrowingSweep SweepOfImages(const std::string& folder, const std::vector<std::string>& images,
                           const std::string& table, const std::string& camera_path,
                           const SweepReading& reading, std::vector<std::string>* notices) {
  GrowingSweep growing;
  SweepFile& sweep = growing.sweep;
  sweep.source = folder;
  sweep.camera_path = camera_path;
  const ReadingReader reader = reading.reader ? reading.reader : ReadTextReadings;
  ReadingSet readings = reader(table, images, reading.readings);
  if (notices != nullptr)
    notices->insert(notices->end(), readings.notices.begin(), readings.notices.end());
  sweep.readings = readings.description;
  sweep.readings_are_focus_distances = readings.in_dioptres;
  sweep.readings_are_counts = readings.in_counts;
  const std::vector<std::string> image_of = ImagesOfRows(readings, images, folder);
  std::vector<FileReading> rows;
  std::set<std::string> with_reading;
  for (std::size_t i = 0; i < image_of.size(); ++i) {
    if (image_of[i].empty()) continue;
    rows.push_back(readings.rows[i]);
    with_reading.insert(image_of[i]);
  }
  readings.rows = std::move(rows);
  std::vector<std::string> paired;
  for (const std::string& image : images) {
    const std::string path = std::filesystem::path(image).lexically_normal().string();
    (with_reading.count(path) > 0 ? paired : growing.without_reading).push_back(image);
  }
  sweep.frames = PairFrames(readings, paired, folder, notices);
  if (table.empty()) {  // the order of names means nothing
    std::stable_sort(
        sweep.frames.begin(), sweep.frames.end(),
        [](const SweepFrame& a, const SweepFrame& b) { return a.reading_mm < b.reading_mm; });
  }
  NoteOrderAndRepeats(sweep, notices);
  return growing;
}

}  // namespace thicklens::model
