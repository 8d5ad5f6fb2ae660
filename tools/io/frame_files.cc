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

cv::Mat ReadFrame(const model::SweepFrame& frame, ImageFacts* facts) {
  ImageReading reading;
  reading.page = frame.page;
  return DecodeImage(ReadWholeFile(frame.image), frame.Name(), reading, facts);
}

FrameFiles::Bytes FrameFiles::ReadAndDigest(std::size_t index) {
  const model::SweepFrame& frame = frames_.at(index);
  if (frame.page) {
    // A file of many pages is read once, by the first thread that needs it.
    const std::lock_guard<std::mutex> one_reader(reading_stack_);
    if (stack_ == nullptr || stack_path_ != frame.image) {
      stack_ = std::make_shared<const std::string>(ReadWholeFile(frame.image));
      stack_path_ = frame.image;
      stack_digest_ = Sha256Hex(*stack_);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    digests_[index] = stack_digest_;
    return stack_;
  }
  auto bytes = std::make_shared<const std::string>(ReadWholeFile(frame.image));
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!digests_[index].empty()) return bytes;
  }
  std::string digest = Sha256Hex(*bytes);
  const std::lock_guard<std::mutex> lock(mutex_);
  digests_[index] = std::move(digest);
  return bytes;
}

cv::Mat FrameFiles::Read(std::size_t index) {
  const model::SweepFrame& frame = frames_.at(index);
  ImageReading reading;
  reading.page = frame.page;
  // A full scale that the caller states refers to the values as the file has them.
  reading.spread_bits = !full_scale_;
  ImageFacts facts;
  const cv::Mat image = DecodeImage(*ReadAndDigest(index), frame.Name(), reading, &facts);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    facts_[index] = std::move(facts);
  }
  return full_scale_ ? ScaledToContainer(image, *full_scale_, frame.Name()) : image;
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
    const std::optional<int>& page = frames_[i].page;
    lines += fmt::format("{} {}{}\n", digests_[i], page ? fmt::format("{} ", *page) : "",
                         YamlNumber(frames_[i].reading_mm));
  }
  return Sha256Hex(lines);
}

}  // namespace thicklens::io
