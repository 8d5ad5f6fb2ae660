// EXR, BMP and DICOM by OpenImageIO 2.4.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>

#include "tools/io/library/decoders.h"

namespace thicklens::io {
namespace {

// Sets what holds for the whole process, once. OpenImageIO's own threads are not used: the program
// decodes several files at a time.
void SetUp() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);  // none besides the caller's
    OIIO::attribute("limits:channels", CV_CN_MAX);
  });
}

const char* NameOfFormat(ImageFileKind kind) {
  switch (kind) {
    case ImageFileKind::kBmp:
      return "bmp";
    case ImageFileKind::kDicom:
      return "dicom";
    default:
      return "openexr";
  }
}

// A file in memory that has a path, for decoders that only read paths. Nobody can replace it while
// it is read.
class FileInMemory {
 public:
  explicit FileInMemory(const std::string& bytes) : file_(memfd_create("image", MFD_CLOEXEC)) {
    std::size_t at = 0;
    while (file_ >= 0 && at < bytes.size()) {
      const ssize_t count = write(file_, bytes.data() + at, bytes.size() - at);
      if (count <= 0) break;
      at += static_cast<std::size_t>(count);
    }
    if (file_ < 0 || at < bytes.size()) {
      if (file_ >= 0) close(file_);
      throw Refusal("no memory for a file in memory");
    }
  }
  ~FileInMemory() { close(file_); }
  FileInMemory(const FileInMemory&) = delete;
  FileInMemory& operator=(const FileInMemory&) = delete;

  std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  int file_;
};

// OpenImageIO's reader of memory, version 2.4, copies from before the memory if a file states a
// negative place of its pixels.
class MemoryReader : public OIIO::Filesystem::IOMemReader {
 public:
  explicit MemoryReader(const std::string& bytes)
      : IOMemReader(bytes.data(), bytes.size()), bytes_(bytes.size()) {}
  std::size_t pread(void* to, std::size_t size, std::int64_t offset) override {
    if (offset < 0 || static_cast<std::uint64_t>(offset) >= bytes_) {
      error("a place that is not in the file");
      return 0;
    }
    return IOMemReader::pread(to, std::min(size, bytes_ - static_cast<std::size_t>(offset)),
                              offset);
  }

 private:
  std::size_t bytes_;
};

// An open file. Errors are always fetched: those that nobody fetches are printed.
class Input {
 public:
  Input(const std::string& bytes, ImageFileKind kind) : proxy_(bytes) {
    SetUp();
    input_ = OIIO::ImageInput::create(NameOfFormat(kind));
    if (!input_) throw Refusal(OIIO::geterror());
    OIIO::ImageSpec options;
    options.attribute("oiio:UnassociatedAlpha", 1);
    options.attribute("oiio:RawColor", 1);
    options.attribute("oiio:reorient", 0);
    std::string path = "image";
    if (input_->supports("ioproxy")) {
      void* const proxy = static_cast<OIIO::Filesystem::IOProxy*>(&proxy_);
      options.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
    } else {
      file_ = std::make_unique<FileInMemory>(bytes);
      path = file_->path();
    }
    OIIO::ImageSpec spec;
    const bool is_open = input_->open(path, spec, options);
    if (!is_open) Fail("it cannot be opened");
    input_->threads(1);
  }
  ~Input() {
    if (!input_) return;
    input_->close();
    if (input_->has_error()) input_->geterror();
    OIIO::geterror();
  }
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  OIIO::ImageInput& operator*() { return *input_; }
  OIIO::ImageInput* operator->() { return input_.get(); }

  [[noreturn]] void Fail(const std::string& otherwise) {
    std::string why = input_->geterror();
    if (why.empty()) why = OIIO::geterror();
    // The path of a file in memory means nothing to the user.
    const std::size_t at = file_ ? why.find(file_->path()) : std::string::npos;
    if (at != std::string::npos) why.erase(at, file_->path().size());
    throw Refusal(why.empty() ? otherwise : why);
  }

 private:
  MemoryReader proxy_;
  std::unique_ptr<FileInMemory> file_;
  std::unique_ptr<OIIO::ImageInput> input_;
};

struct SampleType {
  OIIO::TypeDesc read;  // the type that is asked for: no value changes
  int depth = CV_8U;
  int bits = 8;
  const char* name = "";
};

SampleType TypeOf(OIIO::TypeDesc stored) {
  using OIIO::TypeDesc;
  switch (stored.basetype) {
    case TypeDesc::UINT8:
      return {TypeDesc::UINT8, CV_8U, 8, "unsigned 8-bit integers"};
    case TypeDesc::INT8:
      return {TypeDesc::INT8, CV_8S, 8, "signed 8-bit integers"};
    case TypeDesc::UINT16:
      return {TypeDesc::UINT16, CV_16U, 16, "unsigned 16-bit integers"};
    case TypeDesc::INT16:
      return {TypeDesc::INT16, CV_16S, 16, "signed 16-bit integers"};
    case TypeDesc::UINT32:
      return {TypeDesc::UINT32, CV_64F, 32, "unsigned 32-bit integers"};
    case TypeDesc::INT32:
      return {TypeDesc::INT32, CV_32S, 32, "signed 32-bit integers"};
    case TypeDesc::HALF:
      return {TypeDesc::FLOAT, CV_32F, 16, "half floats"};
    case TypeDesc::FLOAT:
      return {TypeDesc::FLOAT, CV_32F, 32, "32-bit floats"};
    case TypeDesc::DOUBLE:
      return {TypeDesc::DOUBLE, CV_64F, 64, "64-bit floats"};
    default:
      throw Refusal("its values are of a type that is not read");
  }
}

// Reads the channels [begin, end), all of one type, into channels of `image` at the same places.
void ReadChannels(Input* input, int page, const OIIO::ImageSpec& spec, int begin, int end,
                  const SampleType& type, cv::Mat* image) {
  const auto columns = static_cast<std::size_t>(spec.width);
  const auto rows = static_cast<std::size_t>(spec.height);
  const auto channels = static_cast<std::size_t>(end - begin);
  const bool is_direct = channels == static_cast<std::size_t>(image->channels()) &&
                         type.depth == image->depth() && type.read.size() == image->elemSize1() &&
                         image->isContinuous();
  std::vector<std::uint8_t> buffer;
  if (!is_direct) buffer.resize(columns * rows * channels * type.read.size());
  void* const to = is_direct ? static_cast<void*>(image->data) : buffer.data();
  if (!(*input)->read_image(page, 0, begin, end, type.read, to))
    input->Fail("its pixels cannot be read");
  if (is_direct) return;
  const bool is_unsigned_32 = type.read == OIIO::TypeDesc::UINT32;
  for (std::size_t y = 0; y < rows; ++y) {
    for (std::size_t x = 0; x < columns; ++x) {
      for (std::size_t c = 0; c < channels; ++c) {
        const std::size_t i = (y * columns + x) * channels + c;
        const std::size_t at =
            x * static_cast<std::size_t>(image->channels()) + static_cast<std::size_t>(begin) + c;
        double value = 0;
        if (is_unsigned_32) {
          std::uint32_t number = 0;
          std::memcpy(&number, buffer.data() + 4 * i, 4);
          value = number;
        } else {
          float number = 0;  // only EXR mixes types, of these two
          std::memcpy(&number, buffer.data() + 4 * i, 4);
          value = number;
        }
        if (image->depth() == CV_64F) {
          image->ptr<double>(static_cast<int>(y))[at] = value;
        } else {
          image->ptr<float>(static_cast<int>(y))[at] = static_cast<float>(value);
        }
      }
    }
  }
}

// Places the data window into the display window: what lies beside the latter is cut, and it
// has zeros where there are no data.
void FitDisplayWindow(const OIIO::ImageSpec& spec, DecodedImage* image) {
  const cv::Rect data(spec.x, spec.y, spec.width, spec.height);
  const cv::Rect display(spec.full_x, spec.full_y, spec.full_width, spec.full_height);
  if (data == display || display.area() <= 0) return;
  // Nothing in the file stands for the pixels beside the data.
  constexpr double kMaxTimes = 64, kAlwaysBytes = 5e8;
  const double px = static_cast<double>(display.width) * display.height;
  const double data_px = static_cast<double>(data.width) * data.height;
  if (px > kMaxTimes * data_px &&
      px * static_cast<double>(image->pixels.elemSize()) > kAlwaysBytes) {
    throw Refusal("its display window of " + std::to_string(display.width) + " x " +
                  std::to_string(display.height) + " px holds a data window of " +
                  std::to_string(data.width) + " x " + std::to_string(data.height) +
                  " px only: cut it to the data window");
  }
  cv::Mat shown = cv::Mat::zeros(display.size(), image->pixels.type());
  const cv::Rect both = data & display;
  if (both.area() > 0) image->pixels(both - data.tl()).copyTo(shown(both - display.tl()));
  image->pixels = shown;
  image->facts.notes.push_back(
      "Its data window, " + std::to_string(data.width) + " x " + std::to_string(data.height) +
      " px at (" + std::to_string(data.x - display.x) + ", " + std::to_string(data.y - display.y) +
      "), is not its display window: the display window is returned, with "
      "zeros where it has no data.");
}

void Undo12Bits(int bits, cv::Mat* pixels) {
  const double full = std::ldexp(1.0, bits) - 1;
  const double container = pixels->depth() == CV_8U ? 255 : 65535;
  pixels->convertTo(*pixels, pixels->type(), full / container);
}

}  // namespace

std::vector<LibraryPage> OiioPages(const std::string& bytes, ImageFileKind kind) {
  Input input(bytes, kind);
  std::vector<LibraryPage> pages;
  constexpr int kMaxPages = 10000;
  for (int i = 0; i < kMaxPages; ++i) {
    const OIIO::ImageSpec spec = input->spec_dimensions(i);
    if (spec.format == OIIO::TypeUnknown || spec.width <= 0) {
      input->geterror();
      break;
    }
    const OIIO::ImageSpec whole = kind == ImageFileKind::kExr ? input->spec(i) : spec;
    pages.push_back({spec.full_width, spec.full_height,
                     std::string(whole.get_string_attribute(
                         "name", whole.get_string_attribute("oiio:subimagename"))),
                     whole.channelnames, whole.deep});
  }
  input->geterror();
  if (pages.empty()) throw Refusal("it has no image");
  return pages;
}

DecodedImage DecodeByOiio(const std::string& bytes, const LibraryReading& reading) {
  Input input(bytes, reading.kind);
  const int page = reading.reading.page.value_or(0);
  const OIIO::ImageSpec spec = input->spec(page);
  if (spec.width <= 0 || spec.height <= 0) input.Fail("it has no such page");
  if (spec.deep) throw Refusal("an EXR file of deep pixels: flatten it to one value per pixel");
  if (spec.depth > 1) throw Refusal("a volume of " + std::to_string(spec.depth) + " slices");
  DecodedImage image;
  ImageFacts& facts = image.facts;
  std::vector<SampleType> types;
  for (int c = 0; c < spec.nchannels; ++c) types.push_back(TypeOf(spec.channelformat(c)));
  int depth = types[0].depth;
  for (const SampleType& type : types) {
    // Only EXR mixes types; double holds each of them.
    if (type.depth != depth) depth = CV_64F;
    facts.container_bits = std::max(facts.container_bits, type.bits);
    const std::string name = type.name;
    if (facts.sample_type.find(name) == std::string::npos)
      facts.sample_type += (facts.sample_type.empty() ? "" : " and ") + name;
  }
  const double pixel_bytes = CV_ELEM_SIZE(CV_MAKETYPE(depth, spec.nchannels));
  reading.require_memory(std::max(spec.width, spec.full_width),
                         std::max(spec.height, spec.full_height), pixel_bytes, "its pixels");
  image.pixels.create(spec.height, spec.width, CV_MAKETYPE(depth, spec.nchannels));
  for (int begin = 0; begin < spec.nchannels;) {
    int end = begin + 1;
    while (end < spec.nchannels && types[static_cast<std::size_t>(end)].read ==
                                       types[static_cast<std::size_t>(begin)].read) {
      ++end;
    }
    ReadChannels(&input, page, spec, begin, end, types[static_cast<std::size_t>(begin)],
                 &image.pixels);
    begin = end;
  }

  facts.channels = spec.channelnames;
  const bool is_unsigned = depth == CV_8U || depth == CV_16U;
  if (is_unsigned) facts.full_scale = depth == CV_8U ? 255 : 65535;
  const int bits = spec.get_int_attribute("oiio:BitsPerSample");
  if (is_unsigned && bits > 0 && bits < facts.container_bits) {
    facts.significant_bits = bits;
    if (reading.kind == ImageFileKind::kDicom && !reading.reading.spread_bits) {
      Undo12Bits(bits, &image.pixels);
      facts.full_scale = std::ldexp(1.0, bits) - 1;
    }
  }
  if (spec.alpha_channel >= 0)
    facts.alpha =
        reading.kind == ImageFileKind::kExr ? AlphaKind::kAssociated : AlphaKind::kStraight;
  if (reading.kind == ImageFileKind::kExr) {
    facts.transfer = StatedTransfer::kLinear;  // by the definition of the format
    float xy[8];
    if (spec.getattribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), xy)) {
      std::array<double, 8> stated{};
      std::copy(xy, xy + 8, stated.begin());
      facts.chromaticities = stated;
    }
    FitDisplayWindow(spec, &image);
  }
  facts.description = std::string(spec.get_string_attribute("ImageDescription"));
  return image;
}

std::string EncodeByOiio(const cv::Mat& pixels, ImageFormat format, const ImageWriting& writing) {
  SetUp();
  const bool is_exr = format == ImageFormat::kExr, is_bmp = !is_exr;
  const char* const name = is_exr ? "openexr" : "bmp";
  cv::Mat values = pixels.isContinuous() ? pixels : pixels.clone();
  if (is_bmp && values.channels() == 1)
    cv::merge(std::vector<cv::Mat>{values, values, values}, values);
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(name);
  if (!output) throw Refusal(OIIO::geterror());
  OIIO::ImageSpec spec(values.cols, values.rows, values.channels(),
                       is_exr ? (writing.half_floats ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::FLOAT)
                              : OIIO::TypeDesc::UINT8);
  if (is_exr) spec.attribute("compression", "zip");
  if (!writing.description.empty()) spec.attribute("ImageDescription", writing.description);
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput proxy(bytes);
  void* const pointer = static_cast<OIIO::Filesystem::IOProxy*>(&proxy);
  spec.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &pointer);
  output->threads(1);
  const bool done =
      output->open(std::string("image.") + (is_exr ? "exr" : name), spec) &&
      output->write_image(is_exr ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8, values.data) &&
      output->close();
  std::string why = output->geterror();
  if (why.empty()) why = OIIO::geterror();
  if (!done) throw Refusal(why);
  return {bytes.begin(), bytes.end()};
}

}  // namespace thicklens::io
