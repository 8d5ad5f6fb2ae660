#include "thicklens/image.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_description.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "tools/interface/stated_transfer.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

constexpr double kEncodedLevels = 255;

constexpr std::array<std::pair<ImageFileFormat, io::ImageFormat>, 8> kFormats = {
    {{ImageFileFormat::kPng, io::ImageFormat::kPng},
     {ImageFileFormat::kJpeg, io::ImageFormat::kJpeg},
     {ImageFileFormat::kTiff, io::ImageFormat::kTiff},
     {ImageFileFormat::kExr, io::ImageFormat::kExr},
     {ImageFileFormat::kWebp, io::ImageFormat::kWebp},
     {ImageFileFormat::kBmp, io::ImageFormat::kBmp},
     {ImageFileFormat::kPnm, io::ImageFormat::kPnm},
     {ImageFileFormat::kPfm, io::ImageFormat::kPfm}}};

ImageFileFormat PublicFormat(io::ImageFormat format) {
  for (const auto& [shown, inner] : kFormats) {
    if (inner == format) return shown;
  }
  return ImageFileFormat::kPng;
}

io::ImageFormat InnerFormat(ImageFileFormat format) {
  for (const auto& [shown, inner] : kFormats) {
    if (shown == format) return inner;
  }
  throw OptionError("format", fmt::format("format: {} is unknown", static_cast<int>(format)));
}

std::string Encoded(const model::EncodedImage& image, io::ImageFormat format,
                    const io::ImageWriting& writing) {
  if (format == io::ImageFormat::kPng) {
    const std::string png = io::EncodePng(image, writing.icc_profile);
    return writing.description.empty() ? png : io::WithDescription(png, writing.description);
  }
  const cv::Mat wide(image.height_px, image.width_px, CV_16UC(image.channels),
                     const_cast<std::uint16_t*>(image.values.data()));  // NOLINT: only read
  cv::Mat values = wide;
  if (image.bits == 8) wide.convertTo(values, CV_8U);
  return io::EncodeImageFile(values, format, writing);
}

int ChannelsOf(ChannelOrder order) {
  switch (order) {
    case ChannelOrder::kGrey:
      return 1;
    case ChannelOrder::kRgb:
    case ChannelOrder::kBgr:
      return 3;
    case ChannelOrder::kRgba:
    case ChannelOrder::kBgra:
      return 4;
  }
  throw Error(fmt::format("image: the channel order {} is unknown", static_cast<int>(order)));
}

void RequireSize(int width_px, int height_px, int channels, std::size_t values,
                 const std::string& source) {
  const std::string where = source.empty() ? "image" : source;
  if (width_px < 1 || height_px < 1) {
    throw Error(
        fmt::format("{}: sizes >= 1 are expected, found {} x {} px", where, width_px, height_px));
  }
  const std::size_t expected = static_cast<std::size_t>(width_px) *
                               static_cast<std::size_t>(height_px) *
                               static_cast<std::size_t>(channels);
  if (values != expected) {
    throw Error(fmt::format("{}: {} values are expected ({} x {} px, {} channel(s)), found {}",
                            where, expected, width_px, height_px, channels, values));
  }
}

void RequireBits(const std::string& where, int bits) {
  if (bits == 8 || bits == 16) return;
  throw Error(fmt::format("{}: 8 or 16 bits are expected, found {}", where, bits));
}

// Puts red first.
template <typename Value>
void ArrangeChannels(ChannelOrder order, std::vector<Value>* values) {
  if (order != ChannelOrder::kBgr && order != ChannelOrder::kBgra) return;
  const auto channels = static_cast<std::size_t>(ChannelsOf(order));
  for (std::size_t i = 0; i + channels <= values->size(); i += channels) {
    std::swap((*values)[i], (*values)[i + 2]);
  }
}

}  // namespace

std::string ChannelOrderName(ChannelOrder order) {
  constexpr const char* kNames[] = {"grey", "rgb", "rgba", "bgr", "bgra"};
  ChannelsOf(order);  // throws for what is no order
  return kNames[static_cast<int>(order)];
}

Image Image::FromEncoded(int width_px, int height_px, ChannelOrder order, int bits,
                         std::vector<std::uint16_t> values, std::optional<TransferCurve> transfer,
                         std::string source) {
  const int channels = ChannelsOf(order);
  RequireSize(width_px, height_px, channels, values.size(), source);
  RequireBits(source.empty() ? "image" : source, bits);
  if (bits == 8) {
    const auto above =
        std::find_if(values.begin(), values.end(), [](std::uint16_t value) { return value > 255; });
    if (above != values.end()) {
      throw Error(fmt::format("{}: values of 8 bits are expected, found {}",
                              source.empty() ? "image" : source, *above));
    }
  }
  ArrangeChannels(order, &values);
  Image image;
  image.pixels_ = model::EncodedImage{width_px, height_px, channels, bits, std::move(values)};
  image.transfer_ = transfer;
  image.source_ = std::move(source);
  return image;
}

Image Image::FromLight(int width_px, int height_px, ChannelOrder order, std::vector<float> values,
                       TransferCurve transfer, std::string source) {
  const int channels = ChannelsOf(order);
  RequireSize(width_px, height_px, channels, values.size(), source);
  if (!std::all_of(values.begin(), values.end(),
                   [](float value) { return std::isfinite(value); })) {
    throw Error(fmt::format("{}: finite values are expected, found NaN or an infinity",
                            source.empty() ? "image" : source));
  }
  ArrangeChannels(order, &values);
  Image image;
  image.pixels_ = model::LinearImage{width_px, height_px, channels, std::move(values)};
  image.transfer_ = transfer;
  image.source_ = std::move(source);
  return image;
}

bool Image::is_empty() const {
  return std::visit([](const auto& pixels) { return pixels.values.empty(); }, pixels_);
}
int Image::width_px() const {
  return std::visit([](const auto& pixels) { return pixels.width_px; }, pixels_);
}
int Image::height_px() const {
  return std::visit([](const auto& pixels) { return pixels.height_px; }, pixels_);
}
int Image::channels() const {
  return std::visit([](const auto& pixels) { return pixels.channels; }, pixels_);
}
ChannelOrder Image::order() const {
  const int count = channels();
  return count == 1 ? ChannelOrder::kGrey : count == 3 ? ChannelOrder::kRgb : ChannelOrder::kRgba;
}
int Image::bits() const { return is_linear() ? 32 : encoded().bits; }

const model::EncodedImage& Image::encoded() const {
  const auto* stored = std::get_if<model::EncodedImage>(&pixels_);
  if (stored == nullptr) {
    throw Error(fmt::format(
        "{}: encoded values are expected, found linear light, which Image::Encoded converts",
        source_.empty() ? "image" : source_));
  }
  return *stored;
}
const model::LinearImage& Image::light() const {
  const auto* light = std::get_if<model::LinearImage>(&pixels_);
  if (light == nullptr) {
    throw Error(fmt::format("{}: linear light is expected, found encoded values",
                            source_.empty() ? "image" : source_));
  }
  return *light;
}

model::LinearImage Image::ToLight(const TransferCurve& transfer) const {
  return is_linear() ? light() : model::ToLinear(encoded(), transfer);
}

std::optional<TransferCurve> Image::StatedTransfer() const {
  return facts_ == nullptr ? std::nullopt : StatedTransferOf(*facts_);
}

std::string Image::ColourProfile(const TransferCurve& transfer) const {
  const auto stated = facts_ == nullptr ? transfer_ : StatedTransfer();
  if (!(stated == transfer)) return "";
  return facts_ == nullptr ? colour_profile_ : facts_->icc_profile;
}

void Image::SetColourProfile(std::string icc_profile) { colour_profile_ = std::move(icc_profile); }

Image Image::Encoded(int bits) const {
  const std::string where = source_.empty() ? "image" : source_;
  RequireBits(where, bits);
  if (is_empty()) throw Error(where + ": at least one pixel is expected, found an empty image");
  if (!is_linear()) {
    if (encoded().bits == bits) return *this;
    throw Error(fmt::format("{}: its values are encoded in {} bits already, {} are requested",
                            where, encoded().bits, bits));
  }
  Image stored;
  stored.transfer_ = transfer_.value_or(TransferCurve::Srgb());
  stored.source_ = source_;
  stored.colour_profile_ = colour_profile_;
  stored.is_from_file_ = is_from_file_;
  stored.pixels_ =
      WithFileContext(where, [&] { return model::ToEncoded(light(), *stored.transfer_, bits); });
  return stored;
}
Image Image::WithoutAlpha() const {
  if (channels() != 4) return *this;
  Image opaque = *this;
  if (is_linear()) {
    const model::LinearImage& four = light();
    model::LinearImage three{four.width_px, four.height_px, 3, {}};
    three.values.reserve(four.values.size() / 4 * 3);
    for (std::size_t i = 0; i < four.values.size(); ++i) {
      if (i % 4 != 3) three.values.push_back(four.values[i]);
    }
    opaque.pixels_ = std::move(three);
  } else {
    opaque.pixels_ = io::WithoutAlpha(encoded());
  }
  return opaque;
}

Image Image::WithLight(std::vector<float> values) const {
  Image other = *this;
  // It checks the values.
  other.pixels_ = FromLight(width_px(), height_px(), order(), std::move(values)).pixels_;
  return other;
}

Image Image::Cropped(const model::PixelRect& rect) const {
  Image cropped;
  cropped.transfer_ = transfer_;
  cropped.source_ = source_;
  cropped.colour_profile_ = ColourProfile(transfer_.value_or(TransferCurve::Srgb()));
  cropped.is_from_file_ = is_from_file_;
  WithFileContext(source_.empty() ? "image" : source_, [&] {
    if (is_linear()) {
      cropped.pixels_ = model::CropImage(light(), rect);
    } else {
      cropped.pixels_ = model::CropImage(encoded(), rect);
    }
  });
  return cropped;
}

Image ReadImage(const std::string& path, std::optional<TransferCurve> transfer) {
  ImageReadOptions options;
  options.transfer = transfer;
  return ReadImage(path, options);
}

Image ReadImage(const std::string& path, const ImageReadOptions& options) {
  checks::RequireOneOf("orientation", Orientation::kDisplayed, options.orientation);
  io::ImageReading reading;
  if (options.orientation == Orientation::kDisplayed)
    reading.orientation = io::ImageOrientation::kDisplayed;
  reading.measures_compression = true;  // of these bytes: the file may change later
  Image image;
  io::ImageFacts facts;
  image.pixels_ = io::ToEncodedImage(io::DecodeImage(ReadWholeFile(path), path, reading, &facts));
  image.transfer_ = options.transfer;
  if (!options.transfer && facts.raw) image.transfer_ = TransferCurve::Linear();
  image.source_ = path;
  image.is_from_file_ = true;
  image.facts_ = std::make_shared<const io::ImageFacts>(std::move(facts));
  return image;
}

ImageFileFormat ImageFormatOfName(const std::string& path) {
  return PublicFormat(io::FormatOfName(path));
}

EncodedImageFile EncodeImage(const Image& image, const ImageFileOptions& options) {
  checks::RequireValid(options);
  if (image.is_empty()) throw Error("image: at least one pixel is expected, found an empty image");
  const io::ImageFormat format = InnerFormat(options.format);
  io::ImageWriting writing;
  writing.description = options.description;
  writing.icc_profile = image.ColourProfile(
      image.transfer().value_or(image.StatedTransfer().value_or(TransferCurve::Srgb())));
  EncodedImageFile file;
  if (!image.is_linear() && options.noise_levels != 0)
    throw OptionError("noise_levels", "noise_levels: is for linear light only");
  const int bits = image.is_linear() ? options.bits : image.encoded().bits;
  if (!io::HoldsBits(format, bits) && !io::HoldsBits(format, 8)) {  // EXR and PFM
    if (options.noise_levels != 0) {
      throw OptionError(
          "noise_levels",
          fmt::format("noise_levels: is for files of integers, not {}", io::NameOf(format)));
    }
    const model::LinearImage light =
        image.ToLight(image.transfer().value_or(TransferCurve::Srgb()));
    const cv::Mat values(light.height_px, light.width_px, CV_32FC(light.channels),
                         const_cast<float*>(light.values.data()));  // NOLINT: only read
    writing.is_linear = true;
    writing.icc_profile.clear();  // its curve is another one
    file.bytes = io::EncodeImageFile(values, format, writing);
    return file;
  }
  if (!io::HoldsBits(format, bits)) {
    throw OptionError(
        "bits", fmt::format("bits: a {} file has 8 bits, found {}", io::NameOf(format), bits));
  }
  if (image.is_linear()) {
    const TransferCurve transfer = image.transfer().value_or(TransferCurve::Srgb());
    file.clipped_values = io::CountClipped(image.light(), transfer, options.bits);
    file.bytes =
        Encoded(model::ToEncodedWithNoise(image.light(), transfer, options.bits,
                                          options.noise_levels / kEncodedLevels, options.seed),
                format, writing);
  } else {
    if (options.bits > image.bits()) {  // 8 is the default
      throw OptionError("bits", "bits: 16 is for linear light and for values of 16 bits only");
    }
    file.bytes = Encoded(image.encoded(), format, writing);
  }
  return file;
}

std::size_t WriteImage(const std::string& path, const Image& image,
                       const ImageFileOptions& options) {
  ImageFileOptions by_name = options;
  by_name.format = ImageFormatOfName(path);
  checks::RequireValid(by_name);
  OutputFile output(path);
  const EncodedImageFile file = WithFileContext(path, [&] { return EncodeImage(image, by_name); });
  output.Commit(file.bytes);
  return file.clipped_values;
}

}  // namespace thicklens
