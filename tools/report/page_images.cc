#include "tools/report/page_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/transfer_curve.h"
#include "tools/io/png_pixels.h"

namespace thicklens::tools {
namespace {

constexpr int kJpegQuality = 90;
// In smaller images JPEG saves little and its blocks would be visible.
constexpr int kSmallestJpegPx = 160 * 160;
constexpr double kMidGrey = 128;
constexpr int kHatchPx = 4;
constexpr int kMaxZoom = 4;

cv::Size Fitted(cv::Size size, int longest_edge_px) {
  const int longest = std::max(size.width, size.height);
  if (longest <= longest_edge_px) return size;
  const double scale = static_cast<double>(longest_edge_px) / longest;
  return {std::max(1, static_cast<int>(std::lround(size.width * scale))),
          std::max(1, static_cast<int>(std::lround(size.height * scale)))};
}

std::uint8_t Level(double value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

// Returns the sample that represents pixel (x, y) of a map shown at that size.
float SampleFor(const std::vector<float>& values, int width_px, int height_px, cv::Size size, int x,
                int y) {
  const int from_x = static_cast<int>((x + 0.5) * width_px / size.width);
  const int from_y = static_cast<int>((y + 0.5) * height_px / size.height);
  return values[static_cast<std::size_t>(from_y) * static_cast<std::size_t>(width_px) +
                static_cast<std::size_t>(from_x)];
}

cv::Mat EncodedSrgb(const cv::Mat& light) {
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  cv::Mat shown(light.size(), CV_8UC(light.channels()));
  for (int y = 0; y < light.rows; ++y) {
    ThrowIfCancelled();
    const float* from = light.ptr<float>(y);
    std::uint8_t* to = shown.ptr<std::uint8_t>(y);
    for (int i = 0; i < light.cols * light.channels(); ++i) {
      to[i] = std::isfinite(from[i]) ? Level(255 * srgb.Encode(std::clamp(from[i], 0.0F, 1.0F)))
                                     : std::uint8_t{0};
    }
  }
  return shown;
}

std::array<std::uint8_t, 3> HatchColour(int x, int y) {
  const std::uint8_t grey = (x + y) / kHatchPx % 2 == 0 ? 150 : 190;
  return {grey, grey, grey};
}

std::vector<unsigned char> Encoded(const cv::Mat& shown, bool jpeg) {
  io::ImageWriting writing;
  writing.jpeg_quality = kJpegQuality;
  writing.halves_colours = true;
  const std::string file = jpeg ? io::EncodeImageFile(shown, io::ImageFormat::kJpeg, writing)
                                : io::EncodePngPixels(shown, io::PngPacking::kSmall);
  return {file.begin(), file.end()};
}

}  // namespace

cv::Mat ShownImage(const model::LinearImage& image, int longest_edge_px) {
  const cv::Mat light(image.height_px, image.width_px, CV_32FC(image.channels),
                      const_cast<float*>(image.values.data()));  // NOLINT: only read
  const cv::Size size = Fitted(light.size(), longest_edge_px);
  if (size == light.size()) return EncodedSrgb(light);
  cv::Mat shrunk;
  cv::resize(light, shrunk, size, 0, 0, cv::INTER_AREA);
  return EncodedSrgb(shrunk);
}

cv::Mat ShownImage(const cv::Mat& stored) {
  cv::Mat shown = stored;
  if (stored.depth() == CV_16U) stored.convertTo(shown, CV_8U, 255.0 / 65535.0);
  if (shown.channels() == 4) cv::cvtColor(shown, shown, cv::COLOR_RGBA2RGB);
  return shown;
}

cv::Mat AmplifiedDifference(const cv::Mat& image, const cv::Mat& reference, double gain) {
  cv::Mat difference(image.size(), image.type());
  for (int y = 0; y < image.rows; ++y) {
    ThrowIfCancelled();
    const std::uint8_t* a = image.ptr<std::uint8_t>(y);
    const std::uint8_t* b = reference.ptr<std::uint8_t>(y);
    std::uint8_t* to = difference.ptr<std::uint8_t>(y);
    for (int i = 0; i < image.cols * image.channels(); ++i) {
      to[i] = Level(kMidGrey + gain * (static_cast<double>(a[i]) - b[i]));
    }
  }
  return difference;
}

int GainForDifferences(const std::vector<std::pair<cv::Mat, cv::Mat>>& pairs) {
  std::array<std::size_t, 256> counts{};
  std::size_t total = 0;
  for (const auto& [image, reference] : pairs) {
    for (int y = 0; y < image.rows; ++y) {
      ThrowIfCancelled();
      for (int i = 0; i < image.cols * image.channels(); ++i) {
        ++counts[static_cast<std::size_t>(
            std::abs(image.ptr<std::uint8_t>(y)[i] - reference.ptr<std::uint8_t>(y)[i]))];
        ++total;
      }
    }
  }
  int level = 255;
  for (std::size_t above = 0; level > 1; --level) {
    above += counts[static_cast<std::size_t>(level)];
    if (above * 100 > total) break;
  }
  int gain = 1;
  while (gain < 32 && 2 * gain * level <= kMidGrey) gain *= 2;
  return gain;
}

std::array<std::uint8_t, 3> MapColour(double position) {
  static constexpr std::array<std::array<double, 3>, 9> kPoints = {{{68, 1, 84},
                                                                    {71, 44, 122},
                                                                    {59, 81, 139},
                                                                    {44, 113, 142},
                                                                    {33, 144, 141},
                                                                    {39, 173, 129},
                                                                    {92, 200, 99},
                                                                    {170, 220, 50},
                                                                    {253, 231, 37}}};
  const double at = std::clamp(std::isnan(position) ? 0.0 : position, 0.0, 1.0) *
                    static_cast<double>(kPoints.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(at), kPoints.size() - 2);
  const double share = at - static_cast<double>(below);
  std::array<std::uint8_t, 3> colour{};
  for (std::size_t c = 0; c < 3; ++c) {
    colour[c] = Level((1 - share) * kPoints[below][c] + share * kPoints[below + 1][c]);
  }
  return colour;
}

std::string MapColourCss(double position) {
  const std::array<std::uint8_t, 3> colour = MapColour(position);
  return fmt::format("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2]);
}

double ColourRange::Position(double value) const {
  const double position = hi > lo ? (value - lo) / (hi - lo) : 0.5;
  return bright_is_low ? 1 - position : position;
}

cv::Mat ColourMapped(const std::vector<float>& values, int width_px, int height_px,
                     const ColourRange& range, int longest_edge_px) {
  const cv::Size size = Fitted({width_px, height_px}, longest_edge_px);
  cv::Mat shown(size, CV_8UC3);
  for (int y = 0; y < size.height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < size.width; ++x) {
      const float value = SampleFor(values, width_px, height_px, size, x, y);
      const auto colour = std::isnan(value) ? HatchColour(x, y) : MapColour(range.Position(value));
      for (int c = 0; c < 3; ++c) {
        shown.ptr<std::uint8_t>(y)[3 * x + c] = colour[static_cast<std::size_t>(c)];
      }
    }
  }
  return shown;
}

cv::Mat GreyMapped(const std::vector<float>& values, int width_px, int height_px, double range,
                   int longest_edge_px) {
  const cv::Size size = Fitted({width_px, height_px}, longest_edge_px);
  cv::Mat shown(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < size.width; ++x) {
      const double value = SampleFor(values, width_px, height_px, size, x, y);
      shown.ptr<std::uint8_t>(y)[x] = Level(kMidGrey + (255 - kMidGrey) * value / range);
    }
  }
  return shown;
}

std::string EmbeddedImage(const cv::Mat& shown, const std::string& alt, Packing packing,
                          int place_px) {
  const bool jpeg = packing == Packing::kSmall && shown.rows * shown.cols >= kSmallestJpegPx;
  return fmt::format(
      "<img{} src=\"data:image/{};base64,{}\" width=\"{}\" height=\"{}\" alt=\"{}\" "
      "style=\"max-width: {}px\"/>",
      shown.cols < place_px ? " class=\"crisp\"" : "", jpeg ? "jpeg" : "png",
      Base64(Encoded(shown, jpeg)), shown.cols, shown.rows, EscapeXml(alt), kMaxZoom * shown.cols);
}

std::string Base64(const std::vector<unsigned char>& bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = bytes.size() - i;
    const unsigned group = static_cast<unsigned>(bytes[i]) << 16 |
                           (left > 1 ? static_cast<unsigned>(bytes[i + 1]) << 8 : 0U) |
                           (left > 2 ? static_cast<unsigned>(bytes[i + 2]) : 0U);
    text += kDigits[group >> 18 & 63];
    text += kDigits[group >> 12 & 63];
    text += left > 1 ? kDigits[group >> 6 & 63] : '=';
    text += left > 2 ? kDigits[group & 63] : '=';
  }
  return text;
}

}  // namespace thicklens::tools
