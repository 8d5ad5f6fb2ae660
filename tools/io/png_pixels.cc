#include "tools/io/png_pixels.h"

#include <fmt/format.h>
#include <spng.h>
#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "tools/io/png_check.h"

namespace thicklens::io {
namespace {

// The maximum side of an image; a larger one means a broken header.
constexpr std::uint32_t kMaxSidePx = 1 << 20;
constexpr double kMaxPngPixels = 1 << 30;

// zlib says only that the data are bad where it was refused memory, so that libspng takes its
// memory here.
thread_local bool was_refused_memory = false;

void* Noted(void* memory) {
  if (memory == nullptr) was_refused_memory = true;
  return memory;
}

void* Allocate(std::size_t bytes) { return Noted(std::malloc(bytes)); }
void* Reallocate(void* memory, std::size_t bytes) { return Noted(std::realloc(memory, bytes)); }
void* AllocateZeros(std::size_t count, std::size_t bytes) {
  return Noted(std::calloc(count, bytes));
}

spng_ctx* NewContext(int flags) {
  was_refused_memory = false;
  spng_alloc memory{Allocate, Reallocate, AllocateZeros, std::free};
  return spng_ctx_new2(&memory, flags);
}

void ThrowIfMemoryWasRefused(int error) {
  if (error == SPNG_EMEM || (error != SPNG_OK && was_refused_memory)) throw std::bad_alloc();
}

struct FreeContext {
  void operator()(spng_ctx* context) const { spng_ctx_free(context); }
};
using Context = std::unique_ptr<spng_ctx, FreeContext>;

struct Free {
  void operator()(void* memory) const { std::free(memory); }
};

// The pixel format that a file is decoded to.
struct Decoding {
  int format = SPNG_FMT_PNG;
  int flags = 0;
  int channels = 1;
  int depth = CV_8U;
};

Decoding DecodingOf(const spng_ihdr& header, bool has_transparency) {
  const int depth = header.bit_depth == 16 ? CV_16U : CV_8U;
  const int with_alpha = depth == CV_16U ? SPNG_FMT_RGBA16 : SPNG_FMT_RGBA8;
  switch (header.color_type) {
    case SPNG_COLOR_TYPE_TRUECOLOR:
      if (has_transparency) return {with_alpha, SPNG_DECODE_TRNS, 4, depth};
      return {SPNG_FMT_PNG, 0, 3, depth};
    case SPNG_COLOR_TYPE_TRUECOLOR_ALPHA:
      return {SPNG_FMT_PNG, 0, 4, depth};
    case SPNG_COLOR_TYPE_GRAYSCALE_ALPHA:
      return {SPNG_FMT_PNG, 0, 2, depth};
    case SPNG_COLOR_TYPE_INDEXED:
      if (has_transparency) return {SPNG_FMT_RGBA8, SPNG_DECODE_TRNS, 4, CV_8U};
      return {SPNG_FMT_RGB8, 0, 3, CV_8U};
    default:
      return {depth == CV_16U ? SPNG_FMT_PNG : SPNG_FMT_G8, 0, 1, depth};
  }
}

struct Effort {
  int filters, level, strategy;
};

// In 16-bit images compression meets only noise.
Effort EffortOf(PngPacking packing) {
  switch (packing) {
    case PngPacking::kFast:
      return {SPNG_FILTER_CHOICE_SUB, Z_BEST_SPEED, Z_RLE};
    case PngPacking::kRepetitions:
      return {SPNG_FILTER_CHOICE_ALL, Z_BEST_SPEED, Z_DEFAULT_STRATEGY};
    case PngPacking::kSmall:
      break;
  }
  return {SPNG_FILTER_CHOICE_ALL, Z_BEST_COMPRESSION, Z_DEFAULT_STRATEGY};
}

// Decodes row by row, so that it can be cancelled between two rows. An interlaced image passes each
// row several times.
int DecodeRows(const Decoding& decoding, spng_ctx* context, cv::Mat* image) {
  int code = spng_decode_image(context, nullptr, 0, decoding.format,
                               decoding.flags | SPNG_DECODE_PROGRESSIVE);
  const std::size_t row_bytes = static_cast<std::size_t>(image->cols) * image->elemSize();
  while (code == SPNG_OK) {
    ThrowIfCancelled();
    spng_row_info row{};
    code = spng_get_row_info(context, &row);
    if (code != SPNG_OK) break;
    code = spng_decode_row(context, image->ptr(static_cast<int>(row.row_num)), row_bytes);
  }
  return code == SPNG_EOI ? SPNG_OK : code;
}

int EncodeRows(const cv::Mat& image, spng_ctx* context) {
  int code = spng_encode_image(context, nullptr, 0, SPNG_FMT_PNG,
                               SPNG_ENCODE_PROGRESSIVE | SPNG_ENCODE_FINALIZE);
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  for (int y = 0; y < image.rows && code == SPNG_OK; ++y) {
    ThrowIfCancelled();
    code = spng_encode_row(context, image.ptr(y), row_bytes);
  }
  return code == SPNG_EOI ? SPNG_OK : code;
}

}  // namespace

cv::Mat DecodePngPixels(const std::string& bytes, std::string* why) {
  const std::string pixels = WithoutPngTexts(bytes);
  const Context context(NewContext(0));
  int error = context == nullptr ? SPNG_EMEM : SPNG_OK;
  const auto works = [&](int code) {
    error = code;
    return code == SPNG_OK;
  };
  spng_ihdr header{};
  cv::Mat image;
  if (error == SPNG_OK && works(spng_set_image_limits(context.get(), kMaxSidePx, kMaxSidePx)) &&
      works(spng_set_png_buffer(context.get(), pixels.data(), pixels.size())) &&
      works(spng_get_ihdr(context.get(), &header))) {
    if (static_cast<double>(header.width) * header.height > kMaxPngPixels) {
      *why = fmt::format("{}x{} px exceed the maximum of {:.0f} px", header.width, header.height,
                         kMaxPngPixels);
      return {};
    }
    spng_trns transparency{};
    // Reads all chunks before the pixels.
    const int found = spng_get_trns(context.get(), &transparency);
    if (works(found == SPNG_ECHUNKAVAIL ? SPNG_OK : found)) {
      const Decoding decoding = DecodingOf(header, found == SPNG_OK);
      image.create(static_cast<int>(header.height), static_cast<int>(header.width),
                   CV_MAKETYPE(decoding.depth, decoding.channels));
      works(DecodeRows(decoding, context.get(), &image));
    }
  }
  ThrowIfMemoryWasRefused(error);
  if (error == SPNG_OK) return image;
  *why = spng_strerror(error);
  return {};
}

std::string EncodePngPixels(const cv::Mat& image, PngPacking packing) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  const Context context(NewContext(SPNG_CTX_ENCODER));
  spng_ihdr header{};
  header.width = static_cast<std::uint32_t>(whole.cols);
  header.height = static_cast<std::uint32_t>(whole.rows);
  header.bit_depth = whole.depth() == CV_16U ? 16 : 8;
  header.color_type = whole.channels() == 1   ? SPNG_COLOR_TYPE_GRAYSCALE
                      : whole.channels() == 3 ? SPNG_COLOR_TYPE_TRUECOLOR
                                              : SPNG_COLOR_TYPE_TRUECOLOR_ALPHA;
  const Effort effort = EffortOf(packing);
  int error = context == nullptr ? SPNG_EMEM : SPNG_OK;
  for (const auto& [option, value] :
       {std::pair(SPNG_ENCODE_TO_BUFFER, 1), std::pair(SPNG_FILTER_CHOICE, effort.filters),
        std::pair(SPNG_IMG_COMPRESSION_LEVEL, effort.level),
        std::pair(SPNG_IMG_COMPRESSION_STRATEGY, effort.strategy)}) {
    if (error == SPNG_OK) error = spng_set_option(context.get(), option, value);
  }
  if (error == SPNG_OK) error = spng_set_ihdr(context.get(), &header);
  if (error == SPNG_OK) error = EncodeRows(whole, context.get());
  std::size_t size = 0;
  std::unique_ptr<void, Free> file;
  if (error == SPNG_OK) file.reset(spng_get_png_buffer(context.get(), &size, &error));
  ThrowIfMemoryWasRefused(error);
  if (error != SPNG_OK || file == nullptr) {
    throw Error(fmt::format("an image of {}x{} px could not be encoded as PNG: {}", whole.cols,
                            whole.rows, spng_strerror(error)));
  }
  return {static_cast<const char*>(file.get()), size};
}

}  // namespace thicklens::io
