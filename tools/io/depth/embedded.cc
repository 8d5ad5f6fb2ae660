// Finds the depth map inside a photograph, whichever form it has.
#include <fmt/format.h>

#include <cstdint>
#include <exiv2/exiv2.hpp>
#include <opencv2/core.hpp>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/depth_readers.h"
#include "tools/io/depth/embedded_parts.h"
#include "tools/io/depth/jpeg_parts.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_library.h"
#include "tools/io/metadata_image.h"

namespace thicklens::io {
namespace {

// The packet of a PNG, TIFF or WebP file; empty: there is none, or the file is damaged, which the
// reader of its pixels reports.
std::string PacketOf(const std::string& bytes) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  try {
    return ReadMetadata(bytes)->xmpPacket();
  } catch (const Exiv2::AnyError&) {
    return "";
  }
}

XmpNode TreeOf(const std::string& packet, const std::string& extended, const std::string& name) {
  XmpNode tree;
  if (!packet.empty()) tree.inner.push_back(ParseXmp(packet, name));
  if (!extended.empty()) tree.inner.push_back(ParseXmp(extended, name + ": extended XMP"));
  return tree;
}

// The packet of an image that is not asked for: what is damaged there says nothing.
XmpNode TreeOrNone(const std::string& packet) {
  try {
    return TreeOf(packet, "", "");
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return {};
  }
}

// The packets of the photograph itself. What is damaged there is an error only if it states depth.
XmpNode TreeOfPhoto(const std::string& packet, const std::string& extended,
                    const std::string& extended_fault, const std::string& name) {
  try {
    if (!extended_fault.empty()) throw Error(extended_fault);
    return TreeOf(packet, extended, name);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    if (HasGoogleDepthFields(packet) || HasGoogleDepthFields(extended)) throw;
    return TreeOrNone(packet);
  }
}

// A JPEG image behind the photograph.
class FurtherImage {
 public:
  FurtherImage(const std::string& bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {
    is_jpeg_ = bytes.compare(0, 3, "\xFF\xD8\xFF") == 0;
    if (!is_jpeg_) return;
    parts_ = PartsOfJpeg(bytes, name_);
    xmp_ = TreeOrNone(parts_.xmp);
  }

  bool is_jpeg() const { return is_jpeg_; }

  std::optional<EmbeddedDepth> Depth() const {
    if (!is_jpeg_ || !IsAppleDepth(xmp_)) return std::nullopt;
    EmbeddedDepth depth = OfStoredImage(bytes_, "", name_);
    TakeAppleMeaning(xmp_, name_, &depth);
    return depth;
  }

  // "a second image of 320 x 240 px that is not stated to be depth"
  std::string InWords(std::uint32_t mpf_type) const {
    if (!is_jpeg_) return "data behind the photograph that are no JPEG image";
    const std::string size = fmt::format("{} x {} px", parts_.width_px, parts_.height_px);
    const bool is_gain_map = parts_.xmp.find("hdrgainmap") != std::string::npos ||
                             parts_.xmp.find("hdr-gain-map") != std::string::npos;
    if (is_gain_map)
      return fmt::format("a gain map of {} for HDR displays, which is no depth", size);
    if (mpf_type == kMpfStereo) {
      return fmt::format(
          "a second view of {} of a stereo pair (MPF: multi-frame, disparity), which is a "
          "photograph "
          "and no depth map",
          size);
    }
    return fmt::format("a second image of {} that is not stated to be depth", size);
  }

 private:
  const std::string& bytes_;
  const std::string name_;
  bool is_jpeg_ = false;
  JpegParts parts_;
  XmpNode xmp_;
};

// Cameras store fewer images than this.
constexpr std::size_t kMaxImages = 100;

// Looks at the images that the index lists, and at the one directly behind the photograph.
void SearchBehindPicture(const std::string& bytes, const std::string& name, const JpegParts& parts,
                         EmbeddedDepthSearch* search) {
  std::vector<MpfImage> images = parts.images;
  if (images.empty() && parts.end < bytes.size())
    images.push_back({kMpfUndefined, parts.end, bytes.size() - parts.end});
  // Images do not overlap: a file that lists itself again and again is not read as often.
  std::size_t bytes_left = bytes.size();
  for (std::size_t i = 0; i < images.size(); ++i) {
    ThrowIfCancelled();
    const MpfImage& image = images[i];
    if (i == kMaxImages) {
      search->others.push_back(
          fmt::format("an index (MPF) of {} images, of which {} behind the first one are searched",
                      images.size() + 1, kMaxImages));
      break;
    }
    if (image.type == kMpfSmallPreview || image.type == kMpfLargePreview) continue;
    if (image.begin > bytes.size() || image.size > bytes.size() - image.begin) {
      search->others.push_back(fmt::format(
          "an index (MPF) that puts image {} of {} bytes at {}, outside the {} bytes of the file: "
          "it "
          "was cut, or saved again by a program that dropped what is behind the photograph",
          i + 2, image.size, image.begin, bytes.size()));
      continue;
    }
    if (image.size > bytes_left) {
      search->others.push_back(
          fmt::format("an index (MPF) whose images up to number {} are together larger than the {} "
                      "bytes of the file",
                      i + 2, bytes.size()));
      break;
    }
    bytes_left -= image.size;
    const std::string part = bytes.substr(image.begin, image.size);
    const FurtherImage further(part,
                               fmt::format("{}: image {} behind the photograph", name, i + 2));
    if (!further.is_jpeg() && parts.images.empty()) break;  // a trailer of some program
    search->depth = further.Depth();
    if (search->depth) return;
    search->others.push_back(further.InWords(image.type));
  }
  // Samsung's trailer names its parts in plain text.
  if (bytes.find("DualShot_DepthMap", parts.end) != std::string::npos ||
      bytes.find("_DepthMap_", parts.end) != std::string::npos) {
    search->others.emplace_back(
        "a depth map of Samsung (DualShot or SingeShot) whose encoding is not published");
  }
}

void SearchJpeg(const std::string& bytes, const std::string& name, EmbeddedDepthSearch* search) {
  const JpegParts parts = PartsOfJpeg(bytes, name);
  PhotoParts photo{&bytes, name,
                   TreeOfPhoto(parts.xmp, parts.extended_xmp, parts.extended_fault, name),
                   parts.end, true};
  search->depth = GDepthOf(photo);
  if (!search->depth) search->depth = DynamicDepthOf(photo, &search->others);
  if (!search->depth) SearchBehindPicture(bytes, name, parts, search);
}

void SearchOther(const std::string& bytes, const std::string& name, const std::string& packet,
                 EmbeddedDepthSearch* search) {
  if (packet.empty()) return;
  const PhotoParts photo{&bytes, name, TreeOfPhoto(packet, "", "", name), bytes.size(), false};
  search->depth = GDepthOf(photo);
  if (!search->depth) search->depth = DynamicDepthOf(photo, &search->others);
}

// The range of a depth image as HEVC states it (ITU-T H.265, depth representation information) has
// no unit.
std::string RangeInWords(const LibraryDepth& depth) {
  std::string text;
  for (const auto& [field, value] : depth.stated)
    text += fmt::format("{}{} {:g}", text.empty() ? "" : ", ", field, value);
  return text.empty() ? "nothing" : text;
}

void SearchHeif(const std::string& bytes, const std::string& name, EmbeddedDepthSearch* search) {
  LibraryReading reading;
  reading.kind = ImageFileKind::kHeif;
  reading.require_memory = [](double width_px, double height_px, double bytes_per_px,
                              const std::string& what) {
    RequireMemory(width_px, height_px, bytes_per_px, what);
  };
  LibraryDepth found;
  std::string why;
  try {
    if (!LoadedImageLibrary().depth(bytes, reading, &found, &why)) throw Error(why);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: its depth cannot be searched: {}", name, error.what()));
  }
  for (const std::string& type : found.other_types) {
    search->others.push_back(
        fmt::format("an auxiliary image of the type '{}', which is no depth", PrintableUtf8(type)));
  }
  if (found.numbers.empty()) {
    SearchOther(bytes, name, found.photo_xmp, search);
    return;
  }
  const std::string place = name + ": depth image";
  const XmpNode xmp = TreeOf(found.xmp, "", place);
  if (!IsAppleDepth(xmp)) {
    search->others.push_back(fmt::format(
        "a depth image of {} x {} px whose unit no field states (it has {}; Apple's cameras state "
        "apdi:FloatMinValue and apdi:FloatMaxValue): save it as an image, e.g. by heif-convert, "
        "and "
        "give it with --depth-kind and its options",
        found.numbers.cols, found.numbers.rows, RangeInWords(found)));
    return;
  }
  EmbeddedDepth& depth = search->depth.emplace();
  depth.map.width_px = found.numbers.cols;
  depth.map.height_px = found.numbers.rows;
  depth.map.integer = true;
  depth.map.largest_of_type = (1 << found.bits) - 1;
  cv::Mat numbers;
  found.numbers.convertTo(numbers, CV_32F);
  depth.map.values.assign(numbers.begin<float>(), numbers.end<float>());
  depth.description = fmt::format("HEIF, {} x {} px, numbers to {:g}", found.numbers.cols,
                                  found.numbers.rows, *depth.map.largest_of_type);
  TakeAppleMeaning(xmp, place, &depth);
}

}  // namespace

std::string EmbeddedDepthForms() {
  return "GDepth and Dynamic Depth of Google's formats, Apple's depth and disparity in HEIC and "
         "JPEG";
}

EmbeddedDepthSearch FindEmbeddedDepth(const std::string& bytes, const std::string& name) {
  EmbeddedDepthSearch search;
  const std::optional<ImageFileKind> kind = KindOfImage(bytes);
  if (kind == ImageFileKind::kJpeg) {
    SearchJpeg(bytes, name, &search);
  } else if (kind == ImageFileKind::kHeif) {
    SearchHeif(bytes, name, &search);
  } else if (kind == ImageFileKind::kPng || kind == ImageFileKind::kTiff ||
             kind == ImageFileKind::kWebp) {
    SearchOther(bytes, name, PacketOf(bytes), &search);
  }
  return search;
}

EmbeddedDepthSearch ReadEmbeddedDepthFile(const std::string& path) {
  return FindEmbeddedDepth(ReadWholeFile(path), path);
}

}  // namespace thicklens::io
