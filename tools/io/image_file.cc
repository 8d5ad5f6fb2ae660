#include "thicklens/io/image_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <opencv2/core.hpp>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/image_description.h"
#include "tools/io/colour_profile.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_library.h"
#include "tools/io/image_metadata.h"
#include "tools/io/jpeg_pixels.h"
#include "tools/io/png_check.h"
#include "tools/io/png_pixels.h"
#include "tools/io/pnm_pixels.h"
#include "tools/io/tiff_pixels.h"

namespace thicklens::io {
namespace {

Error CannotBeDecoded(const std::string& bytes, const std::string& name, const std::string& why) {
  return Error(
      fmt::format("{}: cannot be decoded as an image ({} bytes): {}", name, bytes.size(), why));
}

// Puts the file's name in front of what a decoder says.
template <typename Function>
auto WithName(const std::string& bytes, const std::string& name, const Function& function) {
  try {
    return function();
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw CannotBeDecoded(bytes, name, error.what());
  }
}

ImageFileKind RequireKind(const std::string& bytes, const std::string& name) {
  if (const std::optional<ImageFileKind> kind = KindOfImage(bytes)) return *kind;
  const std::string other = NameOfOtherKind(bytes);
  throw CannotBeDecoded(
      bytes, name,
      fmt::format("{}a {} file is expected",
                  other.empty() ? "" : fmt::format("it is a {} file; ", other), ReadableKinds()));
}

DecodedImage DecodePng(const std::string& bytes, bool spread_bits) {
  DecodedImage image;
  std::string why;
  image.pixels = DecodePngPixels(bytes, &why);
  if (image.pixels.empty()) throw Error(why);
  const int bits = PngBits(bytes), channels = image.pixels.channels();
  constexpr int kPalette = 3;
  const bool has_palette = PngColourType(bytes) == kPalette;
  ImageFacts& facts = image.facts;
  facts.container_bits = image.pixels.depth() == CV_8U ? 8 : 16;
  facts.full_scale = image.pixels.depth() == CV_8U ? 255 : 65535;
  facts.sample_type = fmt::format("unsigned {}-bit integers", has_palette ? 8 : bits);
  if (has_palette) facts.notes.emplace_back("The colours of its palette are taken.");
  if (bits < 8 && !has_palette) {
    facts.significant_bits = bits;
    if (!spread_bits) {
      facts.full_scale = (1 << bits) - 1;
      image.pixels.convertTo(image.pixels, CV_8U, *facts.full_scale / 255);  // exact: a multiple
    }
  }
  if (channels >= 3) facts.channels = {"R", "G", "B"};
  if (channels < 3) facts.channels = {"Y"};
  if (channels % 2 == 0) {
    facts.channels.emplace_back("A");
    facts.alpha = AlphaKind::kStraight;
  }
  return image;
}

void CheckMemory(double width_px, double height_px, double bytes_per_px, const std::string& name) {
  RequireMemory(width_px, height_px, bytes_per_px, name);
}

// Returns a matrix whose pixel (x, y) is that of `from` at `place(x, y)`.
template <typename Place>
cv::Mat Moved(const cv::Mat& from, cv::Size size, const Place& place) {
  cv::Mat to(size, from.type());
  const std::size_t bytes = from.elemSize();
  for (int y = 0; y < to.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < to.cols; ++x) {
      const cv::Point at = place(x, y);
      std::memcpy(to.ptr(y) + bytes * static_cast<std::size_t>(x),
                  from.ptr(at.y) + bytes * static_cast<std::size_t>(at.x), bytes);
    }
  }
  return to;
}

// EXIF 2.3, table of Orientation: where row 0 and column 0 of the stored image are when it is
// displayed.
cv::Mat Upright(const cv::Mat& stored, int orientation) {
  const int right = stored.cols - 1, bottom = stored.rows - 1;
  const cv::Size same = stored.size(), turned(stored.rows, stored.cols);
  switch (orientation) {
    case 2:
      return Moved(stored, same, [&](int x, int y) { return cv::Point(right - x, y); });
    case 3:
      return Moved(stored, same, [&](int x, int y) { return cv::Point(right - x, bottom - y); });
    case 4:
      return Moved(stored, same, [&](int x, int y) { return cv::Point(x, bottom - y); });
    case 5:
      return Moved(stored, turned, [](int x, int y) { return cv::Point(y, x); });
    case 6:
      return Moved(stored, turned, [&](int x, int y) { return cv::Point(y, bottom - x); });
    case 7:
      return Moved(stored, turned, [&](int x, int y) { return cv::Point(right - y, bottom - x); });
    case 8:
      return Moved(stored, turned, [&](int x, int y) { return cv::Point(right - y, x); });
    default:
      return stored;
  }
}

void SelectChannels(const ImageReading& reading, DecodedImage* image) {
  const std::vector<std::string>& names = image->facts.channels;
  std::vector<std::string> wanted = reading.channels;
  if (!reading.layer.empty() && wanted.empty()) {
    for (const std::string& name : names) {
      if (name.compare(0, reading.layer.size() + 1, reading.layer + ".") == 0)
        wanted.push_back(name);
    }
    if (wanted.empty()) {
      throw Error(fmt::format("no channel of the layer '{}': it has {}",
                              PrintableUtf8(reading.layer), fmt::join(names, ", ")));
    }
  }
  if (wanted.empty() || wanted == names) return;
  std::vector<int> from_to;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto found = std::find(names.begin(), names.end(), wanted[i]);
    if (found == names.end()) {
      throw Error(fmt::format("no channel '{}': it has {}", PrintableUtf8(wanted[i]),
                              fmt::join(names, ", ")));
    }
    from_to.push_back(static_cast<int>(found - names.begin()));
    from_to.push_back(static_cast<int>(i));
  }
  cv::Mat selected(image->pixels.size(),
                   CV_MAKETYPE(image->pixels.depth(), static_cast<int>(wanted.size())));
  cv::mixChannels(&image->pixels, 1, &selected, 1, from_to.data(), wanted.size());
  image->pixels = selected;
  image->facts.channels = wanted;
}

// Makes the planes of a mosaic of 2 x 2 px, black subtracted.
void TreatMosaic(RawTreatment treatment, DecodedImage* image) {
  RawFacts& raw = *image->facts.raw;
  if (treatment == RawTreatment::kDemosaiced) {
    throw Error(
        fmt::format("a TIFF file with the mosaic ({}) of a sensor, which states no camera: develop "
                    "it to a TIFF "
                    "file of colours, or save it as DNG",
                    raw.mosaic.empty() ? "of unknown colours" : raw.mosaic));
  }
  std::string sorted = raw.mosaic;
  std::sort(sorted.begin(), sorted.end());
  const int columns = image->pixels.cols / 2, rows = image->pixels.rows / 2;
  if (sorted != "BGGR" || columns < 1 || rows < 1) {
    throw Error(
        fmt::format("planes of its mosaic: 2 x 2 px with two green sites are expected, found "
                    "'{}'",
                    raw.mosaic));
  }
  cv::Mat mosaic;
  image->pixels.convertTo(mosaic, CV_32F);
  std::array<cv::Mat, 4> sites;
  for (int site = 0; site < 4; ++site) {
    const double black = raw.black_level[static_cast<std::size_t>(site)];
    cv::Mat& plane = sites[static_cast<std::size_t>(site)];
    plane.create(rows, columns, CV_32F);
    for (int y = 0; y < rows; ++y) {
      ThrowIfCancelled();
      const float* from = mosaic.ptr<float>(2 * y + site / 2);
      for (int x = 0; x < columns; ++x) {
        plane.at<float>(y, x) =
            static_cast<float>((from[2 * x + site % 2] - black) / (raw.white_level - black));
      }
    }
  }
  std::vector<cv::Mat> greens, planes;
  std::vector<std::string> names;
  for (const char colour : {'R', 'G', 'B'}) {
    for (std::size_t site = 0, number = 1; site < 4; ++site) {
      if (raw.mosaic[site] != colour) continue;
      planes.push_back(sites[site]);
      names.push_back(colour == 'G' ? fmt::format("G{}", number++) : std::string(1, colour));
      if (colour == 'G') greens.push_back(sites[site]);
    }
  }
  if (treatment == RawTreatment::kMosaicGreen) {
    image->pixels = 0.5 * (greens[0] + greens[1]);
    image->facts.channels = {"G"};
    raw.treatment = "black subtracted, mean of the two green sites of each 2 x 2 px, linear";
  } else {
    cv::merge(planes, image->pixels);
    image->facts.channels = names;
    raw.treatment = "black subtracted, the four sites of each 2 x 2 px as channels, linear";
  }
  raw.sensor_px_per_px = 2;
  image->facts.full_scale = std::nullopt;
}

class ImageFile {
 public:
  ImageFile(const std::string& bytes, const std::string& name, const ImageReading& reading)
      : bytes_(bytes), name_(name), reading_(reading), kind_(RequireKind(bytes, name)) {
    RequireWholePng(bytes, name);
    RequirePossibleSize(bytes, kind_, name);
    WithName(bytes, name, [&] { FindPages(); });
  }

  int pages() const { return static_cast<int>(sizes_.size()); }
  const std::vector<LibraryPage>& parts() const { return sizes_; }

  // The page that the reading selects. Throws Error that lists the pages if it selects none of
  // several.
  int ChosenPage() const {
    if (reading_.page) {
      if (*reading_.page >= 0 && *reading_.page < pages()) return *reading_.page;
      throw Error(fmt::format("{}: page {} is not there: it has {} page(s), counted from 0", name_,
                              *reading_.page, pages()));
    }
    if (!reading_.part.empty()) {
      const auto found = std::find_if(sizes_.begin(), sizes_.end(), [&](const LibraryPage& page) {
        return page.name == reading_.part;
      });
      if (found != sizes_.end()) return static_cast<int>(found - sizes_.begin());
      throw Error(fmt::format("{}: the part '{}' is not there: {}", name_,
                              PrintableUtf8(reading_.part), Listed()));
    }
    // The first image of a HEIF file is the one that the file declares to be the main one.
    if (pages() == 1 || kind_ == ImageFileKind::kHeif) return 0;
    throw Error(fmt::format(
        "{}: one image is expected, found {}: extract the one that is meant into a file", name_,
        Listed()));
  }

  DecodedImage Decode(int page) const {
    return WithName(bytes_, name_, [&] {
      DecodedImage image = DecodePixels(page);
      Complete(page, &image);
      return image;
    });
  }

 private:
  void FindPages() {
    if (kind_ == ImageFileKind::kTiff) {
      tiff_pages_ = TiffPages(bytes_);
      for (const TiffPage& page : tiff_pages_)
        sizes_.push_back({page.width_px, page.height_px, "", {}, false});
    } else if (IsByLibrary()) {
      std::string why;
      if (!LoadedImageLibrary().pages(bytes_, ForLibrary(0), &sizes_, &why)) throw Error(why);
    }
    if (sizes_.empty()) sizes_.resize(1);
  }

  bool IsByLibrary() const {
    return kind_ != ImageFileKind::kPng && kind_ != ImageFileKind::kTiff &&
           kind_ != ImageFileKind::kJpeg && kind_ != ImageFileKind::kPnm &&
           kind_ != ImageFileKind::kPfm;
  }

  LibraryReading ForLibrary(int page) const {
    LibraryReading library{kind_, reading_, CheckMemory};
    library.reading.page = page;
    return library;
  }

  DecodedImage DecodePixels(int page) const {
    switch (kind_) {
      case ImageFileKind::kPng:
        return DecodePng(bytes_, reading_.spread_bits);
      case ImageFileKind::kTiff:
        return DecodeTiff(bytes_, tiff_pages_[static_cast<std::size_t>(page)],
                          reading_.spread_bits);
      case ImageFileKind::kJpeg: {
        DecodedImage image = DecodeJpeg(bytes_);
        if (reading_.measures_compression) image.facts.jpeg_error = MeasureJpegError(bytes_);
        return image;
      }
      case ImageFileKind::kPnm:
        return DecodePnm(bytes_, reading_.spread_bits);
      case ImageFileKind::kPfm:
        return DecodePfmImage(bytes_);
      default:
        break;
    }
    DecodedImage image;
    std::string why;
    if (!LoadedImageLibrary().decode(bytes_, ForLibrary(page), &image, &why)) throw Error(why);
    return image;
  }

  void Complete(int page, DecodedImage* image) const {
    ImageFacts& facts = image->facts;
    if (facts.file_kind.empty()) facts.file_kind = NameOf(kind_);
    facts.file_bytes = bytes_.size();
    facts.page = page;
    facts.pages = pages();
    facts.part = sizes_[static_cast<std::size_t>(page)].name;
    facts.stored_width_px = image->pixels.cols;
    facts.stored_height_px = image->pixels.rows;
    TakeMetadata(bytes_, kind_, &facts);
    const bool is_mosaic = facts.raw && facts.raw->treatment.empty();
    if (is_mosaic) {
      TreatMosaic(reading_.raw, image);
      facts.transfer = StatedTransfer::kLinear;
    }
    TakeProfileTransfer(&facts);
    SelectChannels(reading_, image);
    if (reading_.orientation == ImageOrientation::kDisplayed && facts.orientation != 1) {
      image->pixels = Upright(image->pixels, facts.orientation);
      facts.is_orientation_applied = true;
    }
    facts.width_px = image->pixels.cols;
    facts.height_px = image->pixels.rows;
  }

  // "3 pages (800x600, 800x600, 64x48 px)"
  std::string Listed() const {
    constexpr std::size_t kShown = 6;
    std::vector<std::string> shown;
    for (const LibraryPage& page : sizes_) {
      if (shown.size() == kShown) break;
      const std::string name = page.name.empty() ? "" : "'" + PrintableUtf8(page.name) + "' ";
      shown.push_back(fmt::format("{}{}x{}", name, page.width_px, page.height_px));
    }
    return fmt::format("{} {} ({}{} px)", pages(), kind_ == ImageFileKind::kExr ? "parts" : "pages",
                       fmt::join(shown, ", "), sizes_.size() > kShown ? ", .." : "");
  }

  const std::string& bytes_;
  const std::string& name_;
  const ImageReading& reading_;
  const ImageFileKind kind_;
  std::vector<TiffPage> tiff_pages_;
  std::vector<LibraryPage> sizes_;
};

std::string TransferText(const ImageFacts& facts) {
  switch (facts.transfer) {
    case StatedTransfer::kLinear:
      return "linear";
    case StatedTransfer::kSrgb:
      return "sRGB";
    case StatedTransfer::kBt709:
      return "BT.709";
    case StatedTransfer::kGamma:
      return fmt::format("gamma {:.4g}", facts.gamma);
    case StatedTransfer::kPq:
      return "PQ";
    case StatedTransfer::kHlg:
      return "HLG";
    case StatedTransfer::kAbsent:
      break;
  }
  return "transfer not stated";
}

// "; yuv420p, chroma 4:2:0, matrix BT.601 (assumed), limited range (assumed)"
std::string VideoText(const VideoFacts& video) {
  const auto assumed = [](bool is_stated) { return is_stated ? "" : " (assumed)"; };
  std::string text = "; " + video.pixel_format;
  if (!video.chroma.empty()) text += ", chroma " + video.chroma;
  if (!video.matrix.empty())
    text += fmt::format(", matrix {}{}", video.matrix, assumed(video.is_matrix_stated));
  text += fmt::format(", {} range{}", video.is_full_range ? "full" : "limited",
                      assumed(video.is_range_stated));
  if (video.pixel_aspect != 1) {
    text += fmt::format(", pixels {:.4g} times as wide as high (not applied)", video.pixel_aspect);
  }
  return text;
}

std::string DepthName(int depth) {
  static const char* const kNames[] = {"unsigned 8-bit integers",
                                       "signed 8-bit integers",
                                       "unsigned 16-bit integers",
                                       "signed 16-bit integers",
                                       "signed 32-bit integers",
                                       "32-bit floats",
                                       "64-bit floats",
                                       "half floats"};
  return kNames[depth & CV_MAT_DEPTH_MASK];
}

bool IsByLibrary(ImageFormat format) {
  return format == ImageFormat::kExr || format == ImageFormat::kWebp || format == ImageFormat::kBmp;
}

bool HoldsDepth(ImageFormat format, int depth) {
  if (depth == CV_8U) return HoldsBits(format, 8);
  if (depth == CV_16U) return HoldsBits(format, 16);
  return depth == CV_32F && HoldsFloats(format);
}

bool HoldsChannels(ImageFormat format, int channels) {
  const bool holds_alpha = format == ImageFormat::kPng || format == ImageFormat::kTiff ||
                           format == ImageFormat::kExr || format == ImageFormat::kWebp;
  return channels == 1 || channels == 3 || (channels == 4 && holds_alpha);
}

std::string EncodePngFile(const cv::Mat& pixels, const ImageWriting& writing) {
  std::string png = EncodePngPixels(
      pixels, pixels.depth() == CV_8U ? PngPacking::kRepetitions : PngPacking::kFast);
  if (!writing.icc_profile.empty()) {
    png = WithPngProfile(png, writing.icc_profile);
  } else if (writing.is_linear) {
    using namespace std::string_literals;
    png = WithPngChunk(png, "gAMA", "\0\x01\x86\xA0"s);  // 100000: gamma 1
  }
  return writing.description.empty() ? png : WithDescription(png, writing.description);
}

}  // namespace

DecodedImage DecodeImageFile(const std::string& bytes, const std::string& name,
                             const ImageReading& reading) {
  const ImageFile file(bytes, name, reading);
  return file.Decode(file.ChosenPage());
}

std::vector<DecodedImage> DecodeImagePages(const std::string& bytes, const std::string& name,
                                           const ImageReading& reading) {
  if (reading.page || !reading.part.empty())
    throw Error(fmt::format("{}: all pages are asked for, and also one of them", name));
  const ImageFile file(bytes, name, reading);
  std::vector<DecodedImage> pages;
  for (int i = 0; i < file.pages(); ++i) pages.push_back(file.Decode(i));
  return pages;
}

std::vector<LibraryPage> PartsOfImage(const std::string& bytes, const std::string& name) {
  const ImageReading reading;
  return ImageFile(bytes, name, reading).parts();
}

int PagesOfImage(const std::string& bytes, const std::string& name) {
  const ImageReading reading;
  return ImageFile(bytes, name, reading).pages();
}

DecodedImage ReadImageData(const std::string& path, const ImageReading& reading) {
  return DecodeImageFile(ReadWholeFile(path), path, reading);
}

std::string ImageFacts::OneLine() const {
  std::string line = fmt::format("{}, {} x {} px", file_kind, width_px, height_px);
  if (pages > 1) line += fmt::format(", page {} of {} (counted from 0)", page, pages);
  if (!part.empty()) line += fmt::format(", part '{}'", PrintableUtf8(part));
  std::vector<std::string> names;
  for (const std::string& channel : channels) names.push_back(PrintableUtf8(channel));
  line += fmt::format(", {} channel{} ({}), {}", channels.size(), channels.size() == 1 ? "" : "s",
                      fmt::join(names, " "), sample_type);
  if (significant_bits && *significant_bits != container_bits)
    line += fmt::format(" ({} significant in {} bits)", *significant_bits, container_bits);
  line += ", " + TransferText(*this);
  if (!icc_profile.empty()) {
    line += fmt::format(", profile '{}'", icc_description.empty() ? "without a name"
                                                                  : PrintableUtf8(icc_description));
  }
  if (chromaticities) line += ", primaries stated";
  if (alpha != AlphaKind::kNone)
    line += alpha == AlphaKind::kStraight ? ", straight alpha" : ", associated alpha";
  if (orientation != 1) {
    line += fmt::format(", orientation {} ({})", orientation,
                        is_orientation_applied ? "applied" : "not applied: as stored");
  }
  if (value_scale != 1)
    line += fmt::format(", scale {:g} in its header (not applied)", value_scale);
  if (raw) {
    line += fmt::format(
        "; sensor {} x {} px, active area {} x {} px at ({}, {}), mosaic {}, black "
        "{:g}, white {:g}{}: {}",
        raw->sensor_width_px, raw->sensor_height_px, raw->active_width_px, raw->active_height_px,
        raw->active_left_px, raw->active_top_px, raw->mosaic.empty() ? "none" : raw->mosaic,
        raw->black_level[0], raw->white_level,
        raw->camera.empty() ? "" : ", " + PrintableUtf8(raw->camera), raw->treatment);
  }
  if (video) line += VideoText(*video);
  for (const std::string& note : notes) line += " " + note;
  return line;
}

int UsedBits::LowestBit() const {
  if (set_bits == 0) return -1;
  int bit = 0;
  while ((set_bits >> bit & 1U) == 0) ++bit;
  return bit;
}

UsedBits BitsOf(const cv::Mat& pixels) {
  if (pixels.depth() != CV_8U && pixels.depth() != CV_16U)
    throw Error("used bits: unsigned integers of 8 or 16 bits are expected, found " +
                DepthName(pixels.depth()));
  UsedBits used;
  const auto add = [&](std::uint32_t value) {
    used.highest = std::max(used.highest, value);
    used.set_bits |= value;
  };
  for (int y = 0; y < pixels.rows; ++y) {
    ThrowIfCancelled();
    const int values = pixels.cols * pixels.channels();
    for (int i = 0; i < values; ++i)
      add(pixels.depth() == CV_8U ? pixels.ptr(y)[i] : pixels.ptr<std::uint16_t>(y)[i]);
  }
  return used;
}

ImageFormat FormatOfName(const std::string& path) {
  static const std::vector<std::pair<std::string, ImageFormat>> endings = {
      {".png", ImageFormat::kPng},   {".jpg", ImageFormat::kJpeg},  {".jpeg", ImageFormat::kJpeg},
      {".tif", ImageFormat::kTiff},  {".tiff", ImageFormat::kTiff}, {".exr", ImageFormat::kExr},
      {".webp", ImageFormat::kWebp}, {".bmp", ImageFormat::kBmp},   {".pgm", ImageFormat::kPnm},
      {".ppm", ImageFormat::kPnm},   {".pnm", ImageFormat::kPnm},   {".pfm", ImageFormat::kPfm}};
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const auto& [known, format] : endings) {
    if (known != ending) continue;
    if (IsByLibrary(format)) {
      try {
        LoadedImageLibrary();
      } catch (const Error& error) {
        throw Error(fmt::format("{}: {}", path, error.what()));
      }
    }
    return format;
  }
  std::vector<std::string> names;
  for (const auto& [known, format] : endings) names.push_back(known);
  throw Error(fmt::format("{}: the ending of an image file is expected ({}), found '{}'", path,
                          fmt::join(names, " "), PrintableUtf8(ending)));
}

bool HoldsFloats(ImageFormat format) {
  return format == ImageFormat::kExr || format == ImageFormat::kPfm || format == ImageFormat::kTiff;
}

bool HoldsBits(ImageFormat format, int bits) {
  if (bits == 8) return format != ImageFormat::kExr && format != ImageFormat::kPfm;
  return bits == 16 && (format == ImageFormat::kPng || format == ImageFormat::kTiff ||
                        format == ImageFormat::kPnm);
}

std::string NameOf(ImageFormat format) {
  switch (format) {
    case ImageFormat::kPng:
      return "PNG";
    case ImageFormat::kJpeg:
      return "JPEG";
    case ImageFormat::kTiff:
      return "TIFF";
    case ImageFormat::kExr:
      return "EXR";
    case ImageFormat::kWebp:
      return "WebP";
    case ImageFormat::kBmp:
      return "BMP";
    case ImageFormat::kPnm:
      return "PNM";
    case ImageFormat::kPfm:
      break;
  }
  return "PFM";
}

std::string EncodeImageFile(const cv::Mat& pixels, ImageFormat format,
                            const ImageWriting& writing) {
  if (pixels.empty()) throw Error("an image to be written: it has no pixels");
  if (!HoldsDepth(format, pixels.depth()) || !HoldsChannels(format, pixels.channels())) {
    throw Error(fmt::format("a {} file does not hold {} in {} channel(s)", NameOf(format),
                            DepthName(pixels.depth()), pixels.channels()));
  }
  switch (format) {
    case ImageFormat::kPng:
      return EncodePngFile(pixels, writing);
    case ImageFormat::kTiff:
      return EncodeTiff(pixels, writing);
    case ImageFormat::kJpeg:
      return EncodeJpeg(pixels, writing);
    case ImageFormat::kPnm:
      return EncodePnm(pixels);
    case ImageFormat::kPfm:
      return EncodePfmImage(pixels);
    default:
      break;
  }
  std::string bytes, why;
  if (!LoadedImageLibrary().encode(pixels, format, writing, &bytes, &why))
    throw Error(fmt::format("an image of {}x{} px could not be encoded as {}: {}", pixels.cols,
                            pixels.rows, NameOf(format), why));
  return bytes;
}

}  // namespace thicklens::io
