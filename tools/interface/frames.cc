#include "thicklens/frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <opencv2/core.hpp>
#include <sstream>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/calib/frame_checks.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/video_file.h"
#include "tools/interface/frame_light.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/stated_transfer.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

constexpr char kMark[] = "thicklens frames average 1";

// "dark_01.png", "dark_01.png and 7 more"
std::string SourceOf(const std::vector<std::string>& files) {
  return files.size() == 1 ? files.front()
                           : fmt::format("{} and {} more", files.front(), files.size() - 1);
}

// The images of the files: all pages, and all frames of videos.
std::vector<model::SweepFrame> ImagesOf(const std::vector<std::string>& files) {
  std::vector<model::SweepFrame> images;
  for (const std::string& file : files) {
    ThrowIfCancelled();
    int pages = 1;
    if (io::IsVideoFile(file)) {
      const auto survey = io::VideoFile(file).Survey();
      for (std::size_t i = 0; i < survey.frames.size(); ++i)
        images.push_back({file, 0, static_cast<int>(i)});
      continue;
    }
    pages = io::PagesOfImage(ReadWholeFile(file), file);
    if (pages == 1) images.push_back({file, 0, std::nullopt});
    for (int page = 0; page < pages && pages > 1; ++page) images.push_back({file, 0, page});
  }
  return images;
}

// The entries "key: value" of the description of an average; empty: the file is none.
std::map<std::string, std::string> RecordOf(const std::string& description) {
  std::map<std::string, std::string> record;
  std::istringstream lines(description);
  std::string line;
  if (!std::getline(lines, line) || line.rfind(kMark, 0) != 0) return record;
  while (std::getline(lines, line)) {
    const auto colon = line.find(": ");
    if (colon != std::string::npos) record[line.substr(0, colon)] = line.substr(colon + 2);
  }
  return record;
}

double NumberOf(const std::map<std::string, std::string>& record, const char* key) {
  const auto found = record.find(key);
  return found == record.end() ? 0 : std::strtod(found->second.c_str(), nullptr);
}

std::string TextOf(const std::map<std::string, std::string>& record, const char* key) {
  const auto found = record.find(key);
  return found == record.end() ? "" : found->second;
}

cv::Mat FloatsOf(io::DecodedImage image, const std::string& name) {
  const int channels = image.pixels.channels();
  if (channels == 1 || channels == 3) return std::move(image.pixels);
  throw Error(fmt::format("{}: 1 or 3 channels are expected, found {}", name, channels));
}

io::DecodedImage ReadFloats(const model::SweepFrame& image) {
  io::ImageReading reading;
  reading.page = image.page;
  return io::ReadImageData(image.image, reading);
}

// Whether the file has floats, which are linear light; `found` gets its content.
bool HasFloats(const model::SweepFrame& image, io::DecodedImage* found) {
  if (image.page && io::IsVideoFile(image.image)) return false;
  *found = ReadFloats(image);
  return found->pixels.depth() == CV_32F;
}

// Averages files of floats. One that was made by EncodeAveragedFrames keeps its record.
AveragedFrames AverageOfFloats(const std::vector<model::SweepFrame>& images,
                               const io::DecodedImage& first, const FrameAverageOptions& options) {
  AveragedFrames frames;
  const auto record = RecordOf(first.facts.description);
  frames.average = calib::AverageFrames(
      images.size(),
      [&](std::size_t i) {
        io::DecodedImage image = i == 0 ? first : ReadFloats(images[i]);
        if (image.pixels.depth() != CV_32F) {
          throw Error(fmt::format("{}: 32-bit floats are expected as in {}, found {}",
                                  images[i].Name(), images.front().Name(),
                                  image.facts.sample_type));
        }
        return FloatsOf(std::move(image), images[i].Name());
      },
      options.method);
  if (!cv::checkRange(frames.average.light))
    throw Error(fmt::format("{}: its values must be finite", images.front().Name()));
  frames.bits = static_cast<int>(NumberOf(record, "bits"));
  frames.white = static_cast<int>(NumberOf(record, "white"));
  frames.transfer = TextOf(record, "transfer");
  frames.sensor = TextOf(record, "sensor");
  frames.clipped_share = NumberOf(record, "clipped_share");
  if (record.count("clipped_level") != 0) frames.clipped_level = NumberOf(record, "clipped_level");
  if (images.size() == 1 && !record.empty()) {
    frames.average.frames = static_cast<std::size_t>(std::max(1.0, NumberOf(record, "frames")));
    frames.average.noise_sigma = NumberOf(record, "noise_sigma");
    frames.average.left_out = NumberOf(record, "left_out");
  }
  return frames;
}

TransferCurve CurveOf(const io::ImageFacts& facts, const std::string& name,
                      const FrameAverageOptions& options, RunScope* run) {
  if (facts.raw) return TransferCurve::Linear();
  if (options.transfer) return *options.transfer;
  if (const auto stated = StatedTransferOf(facts)) return *stated;
  const std::string found = StatedTransferName(facts);
  run->Warn(
      fmt::format("{}: it states {}; its values are taken as linear in light; {} states "
                  "another curve",
                  name,
                  found.empty() ? "no transfer curve"
                                : fmt::format("the transfer curve {}, which is not known", found),
                  run->Option("transfer")));
  return TransferCurve::Linear();
}

// Averages files of integers.
AveragedFrames AverageOfIntegers(const std::vector<model::SweepFrame>& images,
                                 const FrameAverageOptions& options, RunScope* run) {
  AveragedFrames frames;
  io::FrameFiles files(images, options.full_scale,
                       options.raw == model::SweepRaw::kGreen ? io::RawTreatment::kMosaicGreen
                                                              : io::RawTreatment::kDemosaiced);
  const cv::Mat first = files.Read(0);
  const auto read = std::make_shared<const std::vector<io::FilesRead>>(files.Files());
  const io::ImageFacts& facts = read->front().facts;
  const TransferCurve curve = CurveOf(facts, images.front().Name(), options, run);
  frames.bits = first.depth() == CV_8U ? 8 : 16;
  constexpr int kWhiteOfBytes = 255, kWhiteOfWords = 65535;
  frames.white = options.full_scale.value_or(frames.bits == 8 ? kWhiteOfBytes : kWhiteOfWords);
  frames.transfer = curve.Name();
  frames.sensor = SensorTextOf(facts);
  const auto step = run->ProgressOf("averaging");
  const auto total = static_cast<int>(images.size());
  int done = 0;
  frames.average = calib::AverageFrames(
      images.size(),
      [&](std::size_t i) {
        const cv::Mat stored = i == 0 ? first : files.Read(i);
        if (stored.type() != first.type()) {
          throw Error(fmt::format("{}: it has {} channel(s) of {} bits, but {} has {} of {}",
                                  images[i].Name(), stored.channels(),
                                  stored.depth() == CV_8U ? 8 : 16, images.front().Name(),
                                  first.channels(), frames.bits));
        }
        step(std::min(++done, total), total);
        return LightOf(stored, curve);
      },
      options.method);
  const calib::FrameStatistics statistics =
      calib::MeasureFrame(first, GreyOf(LightOf(first, curve)));
  frames.clipped_share = statistics.saturated_fraction;
  if (frames.clipped_share > 0)
    frames.clipped_level =
        statistics.saturation_level / (frames.bits == 8 ? kWhiteOfBytes : kWhiteOfWords);
  frames.files_read = std::make_shared<const std::vector<io::FilesRead>>(files.Files());
  return frames;
}

// The numbers at the beginning of a line; fewer than two: the line has other text.
std::vector<double> LeadingNumbers(std::string line) {
  line.resize(std::min(line.size(), line.find('#')));
  for (char& c : line) {
    if (c == ',' || c == ';' || c == '\t' || c == '\r') c = ' ';
  }
  std::vector<double> numbers;
  const char* at = line.c_str();
  while (numbers.size() < 2) {
    char* end = nullptr;
    const double number = std::strtod(at, &end);
    if (end == at || (*end != ' ' && *end != '\0')) break;
    numbers.push_back(number);
    at = end;
  }
  return numbers;
}

bool IsBlank(const std::string& line) {
  const auto first = line.find_first_not_of(" \t\r,;");
  return first == std::string::npos || line[first] == '#';
}

void AddList(const std::string& text, const std::string& name, cv::Mat* mask) {
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (IsBlank(line)) continue;
    const std::vector<double> numbers = LeadingNumbers(line);
    if (numbers.size() < 2 || numbers[0] != std::floor(numbers[0]) ||
        numbers[1] != std::floor(numbers[1])) {
      throw Error(
          fmt::format("{}:{}: two whole numbers are expected, x and y of a pixel, found '{}'", name,
                      number, line.substr(0, 60)));
    }
    if (!(numbers[0] >= 0 && numbers[0] < mask->cols && numbers[1] >= 0 &&
          numbers[1] < mask->rows)) {
      throw Error(fmt::format(
          "{}:{}: the pixel ({}, {}) is outside of the frames of {} x {} px; x and y are counted "
          "from 0",
          name, number, numbers[0], numbers[1], mask->cols, mask->rows));
    }
    mask->at<std::uint8_t>(static_cast<int>(numbers[1]), static_cast<int>(numbers[0])) = 255;
  }
}

bool IsNameOfList(const std::string& path) {
  for (const char* ending : {".txt", ".csv", ".tsv", ".list", ".badpixels"}) {
    const std::string text = ending;
    if (path.size() >= text.size() &&
        path.compare(path.size() - text.size(), std::string::npos, text) == 0)
      return true;
  }
  return false;
}

void AddMask(const std::string& path, cv::Mat* mask) {
  const io::DecodedImage image = io::ReadImageData(path);
  if (image.pixels.size() != mask->size()) {
    throw Error(fmt::format("{}: it has {} x {} px, but the frames have {} x {} px", path,
                            image.pixels.cols, image.pixels.rows, mask->cols, mask->rows));
  }
  const std::vector<std::string>& names = image.facts.channels;
  std::vector<cv::Mat> channels;
  cv::split(image.pixels, channels);
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (c < names.size() && names[c] == "A") continue;
    *mask |= channels[c] != 0;
  }
}

}  // namespace

std::string SensorTextOf(const io::ImageFacts& facts) {
  if (!facts.raw) return "";
  const io::RawFacts& raw = *facts.raw;
  std::string text = fmt::format("raw of {}, {}, {} x {} px from ({}, {}) of {} x {}, {}",
                                 raw.camera.empty() ? "an unnamed camera" : raw.camera,
                                 raw.mosaic.empty() ? "no mosaic" : raw.mosaic, raw.active_width_px,
                                 raw.active_height_px, raw.active_left_px, raw.active_top_px,
                                 raw.sensor_width_px, raw.sensor_height_px, raw.treatment);
  if (raw.camera_white_balance && raw.sensor_px_per_px == 1) {
    const auto& balance = *raw.camera_white_balance;
    text += fmt::format(", white balance {:.4g} {:.4g} {:.4g}", balance[0], balance[1], balance[2]);
  }
  return text;
}

cv::Mat LightOf(const cv::Mat& stored, const TransferCurve& transfer) {
  const int channels = std::min(stored.channels(), 3);
  const bool bytes = stored.depth() == CV_8U;
  const std::size_t levels = bytes ? 256 : 65536;
  std::vector<float> table(levels);
  for (std::size_t i = 0; i < levels; ++i) {
    table[i] = static_cast<float>(
        transfer.Decode(static_cast<double>(i) / static_cast<double>(levels - 1)));
  }
  cv::Mat light(stored.size(), CV_32FC(channels));
  for (int y = 0; y < stored.rows; ++y) {
    ThrowIfCancelled();
    auto* out = light.ptr<float>(y);
    for (int x = 0; x < stored.cols; ++x) {
      for (int c = 0; c < channels; ++c) {
        const int at = x * stored.channels() + c;
        out[x * channels + c] =
            table[bytes ? stored.ptr<std::uint8_t>(y)[at] : stored.ptr<std::uint16_t>(y)[at]];
      }
    }
  }
  return light;
}

cv::Mat GreyOf(const cv::Mat& light) {
  if (light.channels() == 1) return light;
  std::vector<cv::Mat> channels;
  cv::split(light, channels);
  return 0.2126 * channels[0] + 0.7152 * channels[1] + 0.0722 * channels[2];
}

AveragedFrames AverageFrames(const std::vector<std::string>& files,
                             const FrameAverageOptions& options, const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  RunScope run(control);
  if (files.empty()) throw Error("no file is given: at least one exposure is needed");
  const std::vector<model::SweepFrame> images = ImagesOf(files);
  io::DecodedImage first;
  AveragedFrames frames;
  if (HasFloats(images.front(), &first)) {
    frames = AverageOfFloats(images, first, options);
  } else {
    frames = AverageOfIntegers(images, options, &run);
  }
  frames.source = SourceOf(files);
  return frames;
}

std::string EncodeAveragedFrames(const AveragedFrames& frames) {
  const calib::FrameAverage& average = frames.average;
  io::ImageWriting writing;
  writing.is_linear = true;
  writing.description =
      fmt::format("{}\nframes: {}\nnoise_sigma: {}\nleft_out: {}\n", kMark, average.frames,
                  YamlNumber(average.noise_sigma), YamlNumber(average.left_out));
  if (frames.bits > 0) {
    writing.description +=
        fmt::format("bits: {}\nwhite: {}\ntransfer: {}\nclipped_share: {}\nclipped_level: {}\n",
                    frames.bits, frames.white, frames.transfer, YamlNumber(frames.clipped_share),
                    YamlNumber(frames.clipped_level));
  }
  if (!frames.sensor.empty()) writing.description += fmt::format("sensor: {}\n", frames.sensor);
  return io::EncodeImageFile(average.light, io::ImageFormat::kTiff, writing);
}

cv::Mat ReadDefects(const std::vector<std::string>& files, int width_px, int height_px) {
  if (width_px < 1 || height_px < 1)
    throw Error(
        fmt::format("defects: a size >= 1 is expected, found {} x {}", width_px, height_px));
  cv::Mat mask = cv::Mat::zeros(height_px, width_px, CV_8U);
  for (const std::string& path : files) {
    ThrowIfCancelled();
    if (IsNameOfList(path)) {
      AddList(ReadTextFile(path), path, &mask);
    } else {
      AddMask(path, &mask);
    }
  }
  return mask;
}

std::string DefectList(const cv::Mat& mask) {
  if (mask.type() != CV_8U) throw Error("a mask of one byte per pixel is expected");
  std::string text = fmt::format("# defective pixels of {} x {} px: x y, from 0 at the top left\n",
                                 mask.cols, mask.rows);
  for (int y = 0; y < mask.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < mask.cols; ++x) {
      if (mask.at<std::uint8_t>(y, x) != 0) text += fmt::format("{} {}\n", x, y);
    }
  }
  return text;
}

}  // namespace thicklens
