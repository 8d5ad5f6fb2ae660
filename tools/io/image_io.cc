#include "thicklens/io/image_io.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "tools/io/colour_profile.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/png_check.h"
#include "tools/io/png_pixels.h"

namespace thicklens::io {
namespace {

template <typename T>
void CopyValues(const cv::Mat& image, std::vector<std::uint16_t>* values) {
  for (int y = 0; y < image.rows; ++y) {
    ThrowIfCancelled();
    const T* row = image.ptr<T>(y);
    values->insert(values->end(), row,
                   row + static_cast<std::ptrdiff_t>(image.cols) * image.channels());
  }
}

// Returns the channels that are a photograph, in the order red, green, blue, alpha.
cv::Mat PhotographOf(const DecodedImage& image, const std::string& name) {
  const std::vector<std::string>& names = image.facts.channels;
  const auto place = [&](const std::string& channel) {
    return static_cast<int>(std::find(names.begin(), names.end(), channel) - names.begin());
  };
  const int none = static_cast<int>(names.size()), red = place("R"), green = place("G"),
            blue = place("B"), grey = place("Y"), alpha = place("A");
  std::vector<int> wanted;
  if (red < none && green < none && blue < none) {
    wanted = {red, green, blue};
    if (alpha < none) wanted.push_back(alpha);
  } else if (none == 2 && grey < none && alpha < none) {
    wanted = {grey, grey, grey, alpha};
  }
  const bool is_usual = none == 1 || none == 3 || none == 4;
  if (wanted.empty() || (none == 4 && wanted.size() == 3)) {
    if (is_usual) return image.pixels;
    throw Error(fmt::format("{}: 1, 3 or 4 channels are expected, found {} ({})", name, none,
                            fmt::join(names, ", ")));
  }
  std::vector<int> from_to;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    from_to.push_back(wanted[i]);
    from_to.push_back(static_cast<int>(i));
  }
  cv::Mat photograph(image.pixels.size(),
                     CV_MAKETYPE(image.pixels.depth(), static_cast<int>(wanted.size())));
  cv::mixChannels(&image.pixels, 1, &photograph, 1, from_to.data(), wanted.size());
  return photograph;
}

}  // namespace

cv::Mat DecodeImage(const std::string& bytes, const std::string& name, ImageFacts* facts) {
  return DecodeImage(bytes, name, ImageReading(), facts);
}

cv::Mat DecodeImage(const std::string& bytes, const std::string& name, const ImageReading& reading,
                    ImageFacts* facts) {
  DecodedImage image = DecodeImageFile(bytes, name, reading);
  const cv::Mat& pixels = image.pixels;
  if (pixels.depth() != CV_8U && pixels.depth() != CV_16U) {
    throw Error(fmt::format("{}: an image with 8 or 16 bits per channel is expected, found {}: {}",
                            name, image.facts.sample_type,
                            "convert it, or read it as a depth map"));
  }
  cv::Mat photograph = PhotographOf(image, name);
  try {
    ConvertFromProfile(&image.facts, &photograph);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  }
  if (facts != nullptr) *facts = std::move(image.facts);
  return photograph;
}

cv::Mat ReadImageFile(const std::string& path, ImageFacts* facts) {
  return DecodeImage(ReadWholeFile(path), path, facts);
}

std::string ReadableImageKinds() { return ReadableKinds(); }

model::EncodedImage ToEncodedImage(const cv::Mat& image) {
  model::EncodedImage stored{
      image.cols, image.rows, image.channels(), image.depth() == CV_8U ? 8 : 16, {}};
  stored.values.reserve(image.total() * static_cast<std::size_t>(image.channels()));
  if (stored.bits == 8) {
    CopyValues<std::uint8_t>(image, &stored.values);
  } else {
    CopyValues<std::uint16_t>(image, &stored.values);
  }
  return stored;
}

model::EncodedImage WithoutAlpha(const model::EncodedImage& image) {
  if (image.channels != 4) return image;
  model::EncodedImage opaque{image.width_px, image.height_px, 3, image.bits, {}};
  opaque.values.reserve(image.values.size() / 4 * 3);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (i % 4 != 3) opaque.values.push_back(image.values[i]);
  }
  return opaque;
}

std::string EncodePng(const model::EncodedImage& image, const std::string& icc_profile) {
  const cv::Mat wide(image.height_px, image.width_px, CV_16UC(image.channels),
                     const_cast<std::uint16_t*>(image.values.data()));  // NOLINT: only read
  cv::Mat values = wide;
  if (image.bits == 8) wide.convertTo(values, CV_8U);
  // Trying every filter takes three times as long and does not make images of 16 bits smaller;
  // images of 8 bits have repetitions.
  const PngPacking packing = image.bits == 8 ? PngPacking::kRepetitions : PngPacking::kFast;
  const std::string png = EncodePngPixels(values, packing);
  return icc_profile.empty() ? png : WithPngProfile(png, icc_profile);
}

std::string EncodeBytesPng(const std::vector<std::uint8_t>& bytes, int width_px) {
  const auto width = static_cast<std::size_t>(width_px);
  if (width_px < 1 || bytes.empty() || bytes.size() % width != 0) {
    throw Error(fmt::format("an image of bytes: {} bytes are not a whole number of rows of {} px",
                            bytes.size(), width_px));
  }
  const cv::Mat values(static_cast<int>(bytes.size() / width), width_px, CV_8U,
                       const_cast<std::uint8_t*>(bytes.data()));  // NOLINT: only read
  return EncodePngPixels(values, PngPacking::kFast);
}

}  // namespace thicklens::io
