// WebP by libwebp: OpenImageIO 2.4 multiplies the colours by alpha and says that it did not.
#include <webp/decode.h>
#include <webp/encode.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>

#include "tools/io/library/decoders.h"

namespace thicklens::io {
namespace {

const std::uint8_t* Data(const std::string& bytes) {
  return reinterpret_cast<const std::uint8_t*>(bytes.data());  // NOLINT: bytes
}

WebPBitstreamFeatures FeaturesOf(const std::string& bytes) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(Data(bytes), bytes.size(), &features) != VP8_STATUS_OK)
    throw Refusal("its header is broken");
  if (features.has_animation != 0)
    throw Refusal("an animation: extract the frame that is meant into a file");
  return features;
}

}  // namespace

std::vector<LibraryPage> WebpPages(const std::string& bytes) {
  const WebPBitstreamFeatures features = FeaturesOf(bytes);
  return {{features.width, features.height, ""}};
}

DecodedImage DecodeWebp(const std::string& bytes, const LibraryReading& reading) {
  const WebPBitstreamFeatures features = FeaturesOf(bytes);
  const int channels = features.has_alpha != 0 ? 4 : 3;
  reading.require_memory(features.width, features.height, channels, "its pixels");
  DecodedImage image;
  image.pixels.create(features.height, features.width, CV_8UC(channels));
  const std::size_t size = image.pixels.total() * image.pixels.elemSize();
  const int stride = static_cast<int>(image.pixels.step);
  const std::uint8_t* const done =
      channels == 4 ? WebPDecodeRGBAInto(Data(bytes), bytes.size(), image.pixels.data, size, stride)
                    : WebPDecodeRGBInto(Data(bytes), bytes.size(), image.pixels.data, size, stride);
  if (done == nullptr) throw Refusal("it is broken, or ends in the middle of the image");
  ImageFacts& facts = image.facts;
  facts.container_bits = 8;
  facts.full_scale = 255;
  facts.sample_type = "unsigned 8-bit integers";
  facts.channels = {"R", "G", "B"};
  if (channels == 4) {
    facts.channels.emplace_back("A");
    facts.alpha = AlphaKind::kStraight;
  }
  return image;
}

// Grey becomes RGB, which is all that a WebP file has. A quality of 100 means no loss.
std::string EncodeWebp(const cv::Mat& pixels, const ImageWriting& writing) {
  cv::Mat values = pixels;
  if (pixels.channels() == 1) cv::merge(std::vector<cv::Mat>{pixels, pixels, pixels}, values);
  const bool is_lossless = writing.jpeg_quality >= 100;
  const auto quality = static_cast<float>(writing.jpeg_quality);
  const int stride = static_cast<int>(values.step);
  std::uint8_t* file = nullptr;
  std::size_t size = 0;
  if (values.channels() == 4) {
    size = is_lossless
               ? WebPEncodeLosslessRGBA(values.data, values.cols, values.rows, stride, &file)
               : WebPEncodeRGBA(values.data, values.cols, values.rows, stride, quality, &file);
  } else {
    size = is_lossless
               ? WebPEncodeLosslessRGB(values.data, values.cols, values.rows, stride, &file)
               : WebPEncodeRGB(values.data, values.cols, values.rows, stride, quality, &file);
  }
  const std::unique_ptr<std::uint8_t, void (*)(void*)> freed(file, WebPFree);
  if (size == 0) throw Refusal("a WebP file has at most 16383 px per side");
  return {reinterpret_cast<const char*>(file), size};  // NOLINT: bytes
}

}  // namespace thicklens::io
