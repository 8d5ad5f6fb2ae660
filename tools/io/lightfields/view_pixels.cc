#include "tools/io/lightfields/view_pixels.h"

#include <fmt/format.h>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/io/image_io.h"

namespace thicklens::io {
namespace {

model::EncodedImage WithoutAnyAlpha(const model::EncodedImage& image) {
  if (image.channels != 2) return WithoutAlpha(image);
  model::EncodedImage opaque{image.width_px, image.height_px, 1, image.bits, {}};
  for (std::size_t i = 0; i < image.values.size(); i += 2) opaque.values.push_back(image.values[i]);
  return opaque;
}

model::TransferCurve TransferOf(const ImageFacts& facts, const std::string& name) {
  switch (facts.transfer) {
    case StatedTransfer::kLinear:
      return model::TransferCurve::Linear();
    case StatedTransfer::kPq:
    case StatedTransfer::kHlg:
      throw Error(fmt::format(
          "{}: its values are encoded for high dynamic range ({}): views in sRGB or linear light "
          "are expected",
          name, facts.transfer == StatedTransfer::kPq ? "PQ" : "HLG"));
    default:
      return model::TransferCurve::Srgb();
  }
}

}  // namespace

model::LinearImage ReadPngView(const std::string& path, const model::TransferCurve& transfer) {
  return model::ToLinear(WithoutAlpha(ToEncodedImage(ReadImageFile(path))), transfer);
}

model::LinearImage LightOfPixels(const cv::Mat& pixels, const ImageFacts& facts,
                                 const std::string& name) {
  const int channels = pixels.channels();
  if (channels < 1 || channels > 4) {
    throw Error(
        fmt::format("{}: 1 (grey) or 3 (RGB) channels are expected, found {}", name, channels));
  }
  if (pixels.depth() == CV_8U || pixels.depth() == CV_16U)
    return model::ToLinear(WithoutAnyAlpha(ToEncodedImage(pixels)), TransferOf(facts, name));
  if (pixels.depth() != CV_32F && pixels.depth() != CV_64F) {
    throw Error(
        fmt::format("{}: floats, or unsigned integers of 8 or 16 bits are expected, found {}", name,
                    facts.sample_type));
  }
  cv::Mat floats;
  pixels.convertTo(floats, CV_32F);
  const int kept = channels <= 2 ? 1 : 3;
  model::LinearImage light{floats.cols, floats.rows, kept, {}};
  light.values.reserve(floats.total() * static_cast<std::size_t>(kept));
  for (int y = 0; y < floats.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = floats.ptr<float>(y);
    for (int x = 0; x < floats.cols; ++x) {
      const float* pixel = row + static_cast<std::ptrdiff_t>(x) * channels;
      light.values.insert(light.values.end(), pixel, pixel + kept);
    }
  }
  return light;
}

model::LinearImage ReadLightOfFile(const std::string& path) {
  const DecodedImage image = ReadImageData(path);
  return LightOfPixels(image.pixels, image.facts, path);
}

}  // namespace thicklens::io
