#include "thicklens/io/frame_files.h"

#include <fmt/format.h>

#include <utility>

#include "thicklens/base/output_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/io/data_hash.h"
#include "thicklens/io/full_scale.h"
#include "thicklens/io/image_io.h"

namespace thicklens::io {

FrameFiles::FrameFiles(std::vector<model::SweepFrame> frames, std::optional<int> full_scale)
    : frames_(std::move(frames)),
      full_scale_(full_scale),
      digests_(frames_.size()),
      facts_(frames_.size()) {}

std::string FrameFiles::ReadAndDigest(std::size_t index) {
  std::string bytes = ReadWholeFile(frames_.at(index).image);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!digests_[index].empty()) return bytes;
  }
  std::string digest = Sha256Hex(bytes);
  const std::lock_guard<std::mutex> lock(mutex_);
  digests_[index] = std::move(digest);
  return bytes;
}

cv::Mat FrameFiles::Read(std::size_t index) {
  const std::string& path = frames_.at(index).image;
  ImageReading reading;
  // A full scale that the caller states refers to the values as the file has them.
  reading.spread_bits = !full_scale_;
  ImageFacts facts;
  const cv::Mat frame = DecodeImage(ReadAndDigest(index), path, reading, &facts);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    facts_[index] = std::move(facts);
  }
  return full_scale_ ? ScaledToContainer(frame, *full_scale_, path) : frame;
}

std::vector<FilesRead> FrameFiles::Files() {
  std::vector<std::string> paths;
  for (const model::SweepFrame& frame : frames_) paths.push_back(frame.image);
  const std::lock_guard<std::mutex> lock(mutex_);
  return GroupFilesRead(paths, facts_);
}

std::string FrameFiles::DataSha256() {
  std::string lines;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (digests_[i].empty()) ReadAndDigest(i);
    lines += fmt::format("{} {}\n", digests_[i], YamlNumber(frames_[i].reading_mm));
  }
  return Sha256Hex(lines);
}

}  // namespace thicklens::io
