// Depth maps in files of images: which channel holds the depth, and what its type can hold.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/depth_readers.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_library.h"
#include "tools/io/png_check.h"

namespace thicklens::io {
namespace {

constexpr std::array<ImageFileKind, 8> kDepthKinds = {
    ImageFileKind::kPng,  ImageFileKind::kTiff, ImageFileKind::kExr, ImageFileKind::kPnm,
    ImageFileKind::kJpeg, ImageFileKind::kPfm,  ImageFileKind::kBmp, ImageFileKind::kWebp};

std::string TypeName(const cv::Mat& image) {
  static const char* const kNames[] = {"8-bit",         "signed 8-bit",  "16-bit",
                                       "signed 16-bit", "signed 32-bit", "32-bit float",
                                       "64-bit float",  "16-bit float"};
  return fmt::format("{} values in {} channel(s)", kNames[image.depth()], image.channels());
}

std::string ExpectedOf(ImageFileKind kind) {
  if (kind == ImageFileKind::kPng) return "a PNG depth map has 8- or 16-bit values";
  if (kind == ImageFileKind::kTiff) return "a TIFF depth map has integer or float values";
  if (kind == ImageFileKind::kPnm) return "a PGM depth map has 8- or 16-bit values";
  if (kind == ImageFileKind::kExr) return "an EXR depth map has float values";
  return "a depth map has values";
}

std::string Listed(const std::vector<std::string>& names) {
  return PrintableUtf8(fmt::format("{}", fmt::join(names, ", ")));
}

std::string InLowerCase(std::string text) {
  for (char& letter : text) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return text;
}

// The parts of "ViewLayer.Depth.Z" in lower case.
std::vector<std::string> PartsOf(const std::string& name) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (std::size_t end = 0; end != std::string::npos; begin = end + 1) {
    end = name.find('.', begin);
    parts.push_back(InLowerCase(name.substr(begin, end - begin)));
  }
  return parts;
}

bool IsAlphaName(const std::string& name) { return PartsOf(name).back() == "a"; }

// The channels whose name says that they are a depth: by the last part Z or, if there is none, by
// any part.
std::vector<int> NamedDepth(const std::vector<std::string>& names) {
  std::vector<int> by_end, by_part;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::vector<std::string> parts = PartsOf(names[i]);
    if (parts.back() == "z") by_end.push_back(static_cast<int>(i));
    const bool is_depth = std::any_of(parts.begin(), parts.end(), [](const std::string& part) {
      return part == "depth" || part == "disparity";
    });
    if (is_depth && !IsAlphaName(names[i])) by_part.push_back(static_cast<int>(i));
  }
  return by_end.empty() ? by_part : by_end;
}

// "'left' (R, G, B, Z)".
std::string ShownPart(const LibraryPage& part) {
  return fmt::format("'{}' ({}{})", PrintableUtf8(part.name), Listed(part.channels),
                     part.is_deep ? "; deep" : "");
}

// Whether the names are those of an image without other channels: Y, or R, G and B, in any layer.
bool AreColourNames(const std::vector<std::string>& names) {
  return std::all_of(names.begin(), names.end(), [](const std::string& name) {
    const std::string last = PartsOf(name).back();
    return last == "r" || last == "g" || last == "b" || last == "a" || last == "y";
  });
}

// The largest difference between the channels of a pixel, as far as they are finite; infinite where
// only some of them are.
double LargestDifference(const cv::Mat& pixels, const std::vector<int>& channels) {
  double largest = 0;
  const auto stride = static_cast<std::size_t>(pixels.channels());
  for (int y = 0; y < pixels.rows; ++y) {
    ThrowIfCancelled();
    cv::Mat row;
    pixels.row(y).convertTo(row, CV_64F);
    const auto* values = row.ptr<double>(0);
    for (std::size_t x = 0; x < static_cast<std::size_t>(pixels.cols); ++x, values += stride) {
      const double first = values[channels[0]];
      for (const int channel : channels) {
        const double value = values[channel];
        if (value == first || (std::isnan(value) && std::isnan(first))) continue;
        const double difference = std::abs(value - first);
        largest = std::isnan(difference) ? std::numeric_limits<double>::infinity()
                                         : std::max(largest, difference);
      }
    }
  }
  return largest;
}

// Chooses the channel of the depth.
class DepthChannel {
 public:
  DepthChannel(const DecodedImage& image, ImageFileKind kind, bool is_lossy,
               const std::string& name)
      : pixels_(image.pixels),
        names_(image.facts.channels),
        kind_(kind),
        is_lossy_(is_lossy),
        name_(name) {}

  int Choose(const std::string& wanted, DepthFile* file) {
    if (!wanted.empty()) return OfName(wanted);
    if (names_.size() == 1) return 0;
    const std::vector<int> named = NamedDepth(names_);
    if (named.size() == 1) {
      file->notes.push_back(
          fmt::format("The channel '{}' of {} is taken.", NameAt(named[0]), Listed(names_)));
      return named[0];
    }
    if (named.size() > 1) {
      std::vector<std::string> names;
      for (const int channel : named) names.push_back(names_[static_cast<std::size_t>(channel)]);
      throw Error(fmt::format("{}: {} channels may be the depth: name one of {} by --depth-channel",
                              name_, named.size(), Listed(names)));
    }
    return OfEqualOnes(file);
  }

  // The alpha channel, or -1.
  int alpha() const { return alpha_; }

 private:
  std::string NameAt(int channel) const {
    return PrintableUtf8(names_[static_cast<std::size_t>(channel)]);
  }

  int OfName(const std::string& wanted) const {
    const auto found = std::find(names_.begin(), names_.end(), wanted);
    if (found == names_.end()) {
      throw Error(fmt::format("{}: no channel '{}': it has {}", name_, PrintableUtf8(wanted),
                              Listed(names_)));
    }
    return static_cast<int>(found - names_.begin());
  }

  int OfEqualOnes(DepthFile* file) {
    std::vector<int> colours;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (IsAlphaName(names_[i]) && (names_.size() == 2 || names_.size() == 4)) {
        alpha_ = static_cast<int>(i);
      } else {
        colours.push_back(static_cast<int>(i));
      }
    }
    if (colours.size() == 1) return colours[0];
    // The colours of a grey JPEG file that was stored as a colour one differ by rounding. WebP
    // leaves one level in a grey image, but an image of those 3 levels, a JPEG that was converted,
    // gets up to 10 at the quality of 75 that programs use by themselves (measured).
    constexpr double kJpegLevels = 3, kWebpLevels = 10;
    const double allowed = !is_lossy_                      ? 0
                           : kind_ == ImageFileKind::kWebp ? kWebpLevels
                                                           : kJpegLevels;
    const double difference = LargestDifference(pixels_, colours);
    if (colours.size() < 3 || difference > allowed) ThrowOfColours(colours);
    std::vector<std::string> names;
    for (const int channel : colours) names.push_back(names_[static_cast<std::size_t>(channel)]);
    file->notes.push_back(fmt::format("Its {} channels ({}) {}: they are one map.", colours.size(),
                                      Listed(names),
                                      difference == 0 ? "are equal" : "are equal up to rounding"));
    // Green is nearest to the luminance, which WebP stores.
    return is_lossy_ && kind_ == ImageFileKind::kWebp && difference > 0 ? colours[1] : colours[0];
  }

  [[noreturn]] void ThrowOfColours(const std::vector<int>& colours) const {
    std::string words = "its channels differ";
    if (colours.size() == 3) {
      cv::Mat rgb(pixels_.size(), CV_MAKETYPE(pixels_.depth(), 3));
      std::vector<int> from_to;
      for (int i = 0; i < 3; ++i) {
        from_to.push_back(colours[static_cast<std::size_t>(i)]);
        from_to.push_back(i);
      }
      cv::mixChannels(&pixels_, 1, &rgb, 1, from_to.data(), 3);
      words = WordsOnColours(rgb, is_lossy_);
    }
    throw Error(fmt::format(
        "{}: {} in one channel, or in three channels that are equal, found {} ({}); {}{}", name_,
        ExpectedOf(kind_), TypeName(pixels_), Listed(names_), words,
        colours.size() == 3 && AreColourNames(names_)
            ? ""
            : "; if one of them is the depth, name it by --depth-channel"));
  }

  const cv::Mat& pixels_;
  const std::vector<std::string>& names_;
  const ImageFileKind kind_;
  const bool is_lossy_;
  const std::string& name_;
  int alpha_ = -1;
};

std::optional<double> LargestOfType(const ImageFacts& facts) {
  if (facts.sample_type.find("float") != std::string::npos) return std::nullopt;
  if (facts.full_scale) return facts.full_scale;
  if (facts.container_bits < 1 || facts.container_bits > 64) return std::nullopt;
  const bool is_unsigned = facts.sample_type.find("unsigned") != std::string::npos;
  return std::ldexp(1.0, facts.container_bits - (is_unsigned ? 0 : 1)) - 1;
}

// A part of an EXR file that may have the depth.
struct DepthPart {
  int index = 0;
  std::string shown;    // "'left' (R, G, B, Z)"
  std::string channel;  // that is the depth; empty: the part has the name of a depth
};

// The parts with the channel `wanted`, or, if that is empty, with a channel whose name says that it
// is a depth; if there are none, those whose own name says so. Deep parts only if there are no
// others.
std::vector<DepthPart> PartsWithDepth(const std::vector<LibraryPage>& parts,
                                      const std::string& wanted) {
  std::vector<DepthPart> named, deep, by_part;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::vector<std::string>& names = parts[i].channels;
    DepthPart part{static_cast<int>(i), ShownPart(parts[i]), ""};
    if (!wanted.empty()) {
      if (std::find(names.begin(), names.end(), wanted) != names.end()) part.channel = wanted;
    } else if (const std::vector<int> found = NamedDepth(names); !found.empty()) {
      part.channel = names[static_cast<std::size_t>(found[0])];
    }
    if (!part.channel.empty()) {
      (parts[i].is_deep ? deep : named).push_back(part);
    } else if (wanted.empty() && !parts[i].is_deep && !NamedDepth({parts[i].name}).empty()) {
      by_part.push_back(part);
    }
  }
  if (!named.empty()) return named;
  return by_part.empty() ? deep : by_part;
}

// Decodes the image, or the part of an EXR file of several parts that has the depth.
DecodedImage DecodedDepth(const std::string& bytes, const std::string& name, ImageFileKind kind,
                          const std::string& wanted, DepthFile* file) {
  ImageReading reading;
  reading.spread_bits = false;
  if (kind != ImageFileKind::kExr) return DecodeImageFile(bytes, name, reading);
  const std::vector<LibraryPage> parts = PartsOfImage(bytes, name);
  if (parts.size() == 1) return DecodeImageFile(bytes, name, reading);
  const std::vector<DepthPart> found = PartsWithDepth(parts, wanted);
  const std::string channel = wanted.empty() ? "a channel named Z, depth or disparity"
                                             : "the channel '" + PrintableUtf8(wanted) + "'";
  if (found.empty()) {
    std::vector<std::string> all;
    for (const LibraryPage& part : parts) all.push_back(ShownPart(part));
    throw Error(
        fmt::format("{}: none of its {} parts has {}: {}; name the channel that is the "
                    "depth by --depth-channel",
                    name, parts.size(), channel, fmt::join(all, ", ")));
  }
  if (found.size() > 1) {
    std::vector<std::string> shown, channels;
    for (const DepthPart& part : found) {
      shown.push_back(part.shown);
      channels.push_back(part.channel);
    }
    std::sort(channels.begin(), channels.end());
    // A name chooses a part only if no other one has it.
    const bool do_names_differ =
        std::adjacent_find(channels.begin(), channels.end()) == channels.end();
    throw Error(fmt::format(
        "{}: {} of its {} parts have {}: {}; {}extract the part that is meant "
        "into a file",
        name, found.size(), parts.size(),
        found[0].channel.empty() ? "the name of a depth" : channel, fmt::join(shown, ", "),
        do_names_differ ? "name the channel by --depth-channel, or " : ""));
  }
  reading.page = found[0].index;
  file->notes.push_back(fmt::format("The part {} of {} is taken.", found[0].shown, parts.size()));
  return DecodeImageFile(bytes, name, reading);
}

// Transparent pixels are holes; a channel that is transparent everywhere says nothing.
void TakeAlpha(const cv::Mat& pixels, int channel, DepthFile* file) {
  cv::Mat alpha;
  cv::extractChannel(pixels, alpha, channel);
  std::vector<std::size_t> transparent;
  std::size_t place = 0;
  for (int y = 0; y < alpha.rows; ++y) {
    cv::Mat row;
    alpha.row(y).convertTo(row, CV_64F);
    for (int x = 0; x < alpha.cols; ++x, ++place) {
      if (row.at<double>(0, x) == 0) transparent.push_back(place);
    }
  }
  if (transparent.empty() || transparent.size() == place) {
    file->notes.emplace_back("Its alpha channel is ignored.");
    return;
  }
  for (const std::size_t hole : transparent)
    file->map.values[hole] = std::numeric_limits<float>::quiet_NaN();
  file->notes.push_back(fmt::format("{} transparent pixels are holes (NaN).", transparent.size()));
}

// The values that the file states as holes. Whether 0 is one in a map of integers is for the rules
// of holes to say.
void TakeNoData(double no_data, DepthFile* file) {
  if (std::isnan(no_data)) return;
  // Whether zeros are depths is a choice of the caller, model::HoleRules.
  if (no_data == 0) {
    if (!file->map.integer)
      file->notes.emplace_back("It states 0 as its value without data (GDAL_NODATA).");
    return;
  }
  constexpr double kLargest = std::numeric_limits<float>::max();
  const auto mark = static_cast<float>(std::clamp(no_data, -kLargest, kLargest));
  std::size_t holes = 0;
  for (float& value : file->map.values) {
    if (value != mark) continue;
    value = std::numeric_limits<float>::quiet_NaN();
    ++holes;
  }
  file->notes.push_back(fmt::format(
      "It states {} as its value without data (GDAL_NODATA): {} pixels are holes (NaN).", mark,
      holes));
}

}  // namespace

DepthFile DecodeImageDepth(const std::string& bytes, const std::string& name,
                           const DepthReading& reading) {
  const std::optional<ImageFileKind> kind = KindOfImage(bytes);
  if (!kind || std::find(kDepthKinds.begin(), kDepthKinds.end(), *kind) == kDepthKinds.end()) {
    const std::string other = kind ? NameOf(*kind) : NameOfOtherKind(bytes);
    throw Error(
        fmt::format("{}: not a depth map: a PFM, NPY, PNG, PGM, TIFF, EXR or JPEG file is "
                    "expected{}",
                    name, other.empty() ? "" : fmt::format(", found {}", other)));
  }
  DepthFile file;
  DecodedImage decoded = DecodedDepth(bytes, name, *kind, reading.channel, &file);
  // A PNG of fewer bits is more likely a drawing.
  if (*kind == ImageFileKind::kPng && PngBits(bytes) < 8 && decoded.pixels.channels() == 1) {
    const int bits = PngBits(bytes);
    throw Error(fmt::format("{}: {} in one channel, found values of {} bit{}, as of a {}", name,
                            ExpectedOf(*kind), bits, bits == 1 ? "" : "s",
                            bits == 1 ? "mask" : "drawing"));
  }
  file.is_lossy = IsLossy(bytes, *kind);
  DepthChannel chooser(decoded, *kind, file.is_lossy, name);
  const int channel = chooser.Choose(reading.channel, &file);
  cv::Mat values;
  cv::extractChannel(decoded.pixels, values, channel);
  // The note says whether it is applied.
  const double factor =
      PfmFactor(std::exchange(decoded.facts.value_scale, 1), reading.pfm_scale, &file);
  if (decoded.facts.is_inverted && decoded.facts.full_scale) {
    // The photometric interpretation is about light. Data has it by mistake more often than not.
    cv::Mat stored;
    cv::subtract(cv::Scalar(*decoded.facts.full_scale), values, stored, cv::noArray(), CV_64F);
    values = stored;
    file.notes.emplace_back(
        "The file states that 0 is white (MINISWHITE): that is about images, and the values are "
        "read as they are stored, not inverted.");
  }
  values.convertTo(values, CV_32F);  // exact for 16 bits
  file.map.width_px = values.cols;
  file.map.height_px = values.rows;
  file.map.integer = decoded.facts.sample_type.find("float") == std::string::npos;
  file.map.largest_of_type = LargestOfType(decoded.facts);
  file.map.values.reserve(values.total());
  for (int y = 0; y < values.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) file.map.values.push_back(PfmValue(factor, row[x]));
  }
  if (decoded.facts.no_data) TakeNoData(*decoded.facts.no_data, &file);
  if (chooser.alpha() >= 0) TakeAlpha(decoded.pixels, chooser.alpha(), &file);
  file.description = decoded.facts.OneLine();
  if (file.is_lossy) {
    file.warnings.push_back(fmt::format(
        "A depth map in a {} file: compression blurs its edges and changes its values by some "
        "levels, also those that mean 'no depth'; use PNG, TIFF or PFM if the program that made it "
        "can write them.",
        *kind == ImageFileKind::kWebp ? "lossy WebP" : "JPEG"));
  }
  if (decoded.facts.orientation != 1) {
    file.notes.push_back(fmt::format(
        "It states the orientation {}, which is not applied: the map is read as it is stored.",
        decoded.facts.orientation));
  }
  return file;
}

}  // namespace thicklens::io
