#include "thicklens/io/frame_files.h"

#include <fmt/format.h>

#include <fstream>
#include <string_view>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/io/data_hash.h"
#include "thicklens/io/full_scale.h"
#include "thicklens/io/image_io.h"

namespace thicklens::io {

FrameFiles::FrameFiles(std::vector<model::SweepFrame> frames, std::optional<int> full_scale,
                       RawTreatment raw)
    : frames_(std::move(frames)),
      full_scale_(full_scale),
      raw_(raw),
      digests_(frames_.size()),
      facts_(frames_.size()) {}

namespace {

// Throws Error for the name of a video without the number of a frame.
void RequireNumber(const model::SweepFrame& frame) {
  if (frame.page || !IsNameOfVideo(frame.image) || !IsVideoFile(frame.image)) return;
  throw Error(fmt::format(
      "{}: a video has many frames: 'page' states the number of the one that is meant, from 0",
      frame.image));
}

// The green plane of a raw file in 16 bits. Values beyond white and black are clipped, as in a
// demosaiced image.
cv::Mat GreenPlane(const std::string& bytes, const std::string& name, const ImageReading& reading,
                   ImageFacts* facts) {
  DecodedImage image = DecodeImageFile(bytes, name, reading);
  if (!image.facts.raw) {
    throw Error(
        fmt::format("{}: a raw file is expected, of which the green sites are measured, "
                    "found {}",
                    name, image.facts.file_kind));
  }
  const std::string& why = image.facts.raw->why_resampled;
  if (!why.empty()) throw Error(fmt::format("{}: its green sites are not measured: {}", name, why));
  constexpr double kWhite = 65535;
  cv::Mat plane;
  image.pixels.convertTo(plane, CV_16U, kWhite);
  *facts = std::move(image.facts);
  return plane;
}

std::string DigestOfFile(const std::string& path) {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  std::ifstream file(path, std::ios::binary);
  std::string piece(kPiece, '\0');
  Sha256 digest;
  while (file) {
    ThrowIfCancelled();
    file.read(piece.data(), static_cast<std::streamsize>(kPiece));
    digest.Add(std::string_view(piece).substr(0, static_cast<std::size_t>(file.gcount())));
  }
  if (!file.eof()) throw Error(fmt::format("{}: cannot be read to its end", path));
  return digest.Hex();
}

}  // namespace

cv::Mat ReadFrame(const model::SweepFrame& frame, ImageFacts* facts) {
  RequireNumber(frame);
  if (frame.page && IsVideoFile(frame.image)) {
    DecodedImage image = VideoFile(frame.image).Read(*frame.page);
    if (facts != nullptr) *facts = std::move(image.facts);
    return image.pixels;
  }
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

VideoFile* FrameFiles::VideoOf(std::size_t index) {
  const model::SweepFrame& frame = frames_.at(index);
  if (!frame.page) return nullptr;
  const std::lock_guard<std::mutex> one_opener(opening_video_);
  const auto known = videos_.find(frame.image);
  if (known != videos_.end()) return known->second.get();
  std::unique_ptr<VideoFile> video;
  if (IsVideoFile(frame.image)) {
    video = std::make_unique<VideoFile>(frame.image);
    std::vector<int> numbers;
    for (const model::SweepFrame& other : frames_) {
      if (other.page && other.image == frame.image) numbers.push_back(*other.page);
    }
    video->Expect(numbers);
  }
  return videos_.emplace(frame.image, std::move(video)).first->second.get();
}

void FrameFiles::DigestVideo(std::size_t index) {
  const std::string& path = frames_.at(index).image;
  const std::lock_guard<std::mutex> one_reader(reading_stack_);
  std::string& digest = video_digests_[path];
  if (digest.empty()) digest = DigestOfFile(path);
  const std::lock_guard<std::mutex> lock(mutex_);
  digests_[index] = digest;
}

cv::Mat FrameFiles::ReadVideo(VideoFile* video, std::size_t index) {
  const model::SweepFrame& frame = frames_.at(index);
  DigestVideo(index);
  DecodedImage image = video->Read(*frame.page);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    facts_[index] = std::move(image.facts);
  }
  return full_scale_ ? ScaledToContainer(image.pixels, *full_scale_, frame.Name()) : image.pixels;
}

cv::Mat FrameFiles::Read(std::size_t index) {
  const model::SweepFrame& frame = frames_.at(index);
  RequireNumber(frame);
  const bool is_green = raw_ == RawTreatment::kMosaicGreen;
  if (VideoFile* const video = VideoOf(index)) {
    if (is_green) throw Error(fmt::format("{}: a video has no green sites", frame.Name()));
    return ReadVideo(video, index);
  }
  ImageReading reading;
  reading.page = frame.page;
  // A full scale that the caller states refers to the values as the file has them.
  reading.spread_bits = !full_scale_;
  reading.raw = raw_;
  const Bytes bytes = ReadAndDigest(index);
  ImageFacts facts;
  const cv::Mat image = is_green ? GreenPlane(*bytes, frame.Name(), reading, &facts)
                                 : DecodeImage(*bytes, frame.Name(), reading, &facts);
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
    if (digests_[i].empty()) {
      if (VideoOf(i) != nullptr) {
        DigestVideo(i);
      } else {
        ReadAndDigest(i);
      }
    }
    const std::optional<int>& page = frames_[i].page;
    lines += fmt::format("{} {}{}\n", digests_[i], page ? fmt::format("{} ", *page) : "",
                         YamlNumber(frames_[i].reading_mm));
  }
  return Sha256Hex(lines);
}

}  // namespace thicklens::io
