// HEIC and AVIF by libheif, which keeps 10 and 12 bits; OpenImageIO 2.4 makes 8 bits of them.
#include <libheif/heif.h>
extern "C" {
#include <libavutil/csp.h>
}

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "tools/io/library/decoders.h"
#include "tools/io/library/heif_boxes.h"
#include "tools/io/transfer_code.h"

namespace thicklens::io {
namespace {

template <typename T, void (*Release)(T*)>
struct Releases {
  void operator()(T* object) const { Release(object); }
};

void ReleaseHandle(heif_image_handle* handle) { heif_image_handle_release(handle); }
void ReleaseImage(heif_image* image) { heif_image_release(image); }

using Context = std::unique_ptr<heif_context, Releases<heif_context, heif_context_free>>;
using Handle = std::unique_ptr<heif_image_handle, Releases<heif_image_handle, ReleaseHandle>>;
using Image = std::unique_ptr<heif_image, Releases<heif_image, ReleaseImage>>;

void Require(heif_error error) {
  if (error.code != heif_error_Ok) throw Refusal(error.message);
}

Context Opened(const std::string& bytes) {
  Context context(heif_context_alloc());
  if (!context) throw Refusal("no memory");
  Require(heif_context_read_from_memory_without_copy(context.get(), bytes.data(), bytes.size(),
                                                     nullptr));
  return context;
}

// The main image first, then the others in the file's order.
std::vector<heif_item_id> Images(heif_context* context) {
  heif_item_id main = 0;
  Require(heif_context_get_primary_image_ID(context, &main));
  const int count = heif_context_get_number_of_top_level_images(context);
  std::vector<heif_item_id> all(static_cast<std::size_t>(std::max(count, 0)));
  heif_context_get_list_of_top_level_image_IDs(context, all.data(), count);
  std::vector<heif_item_id> images = {main};
  for (const heif_item_id id : all) {
    if (id != main) images.push_back(id);
  }
  return images;
}

Handle HandleOf(heif_context* context, heif_item_id id) {
  heif_image_handle* handle = nullptr;
  Require(heif_context_get_image_handle(context, id, &handle));
  return Handle(handle);
}

// Copies a plane of interleaved values of 8 or, in the machine's order, 16 bits.
cv::Mat Interleaved(const heif_image* image, heif_channel channel, int type) {
  int stride = 0;
  const std::uint8_t* const plane = heif_image_get_plane_readonly(image, channel, &stride);
  const int width = heif_image_get_width(image, channel);
  const int height = heif_image_get_height(image, channel);
  if (plane == nullptr || width < 1 || height < 1) throw Refusal("it has no pixels");
  cv::Mat pixels(height, width, type);
  for (int y = 0; y < height; ++y)
    std::memcpy(pixels.ptr(y), plane + static_cast<std::ptrdiff_t>(stride) * y,
                static_cast<std::size_t>(width) * pixels.elemSize());
  return pixels;
}

// A code that FFmpeg's tables do not have means nothing.
void TakeCodes(const HeifColourCodes& codes, ImageFacts* facts) {
  facts->transfer = TransferOfCode(codes.transfer);
  const AVColorPrimariesDesc* const known =
      codes.primaries < AVCOL_PRI_NB
          ? av_csp_primaries_desc_from_id(static_cast<AVColorPrimaries>(codes.primaries))
          : nullptr;
  if (known == nullptr) return;
  facts->chromaticities = std::array<double, 8>{av_q2d(known->prim.r.x), av_q2d(known->prim.r.y),
                                                av_q2d(known->prim.g.x), av_q2d(known->prim.g.y),
                                                av_q2d(known->prim.b.x), av_q2d(known->prim.b.y),
                                                av_q2d(known->wp.x),     av_q2d(known->wp.y)};
}

void TakeProfile(const heif_image_handle* handle, ImageFacts* facts) {
  const std::size_t size = heif_image_handle_get_raw_color_profile_size(handle);
  constexpr std::size_t kMaxBytes = 32 << 20;
  if (size == 0 || size > kMaxBytes) return;
  facts->icc_profile.resize(size);
  if (heif_image_handle_get_raw_color_profile(handle, facts->icc_profile.data()).code !=
      heif_error_Ok) {
    facts->icc_profile.clear();
  }
}

}  // namespace

std::vector<LibraryPage> HeifPages(const std::string& bytes) {
  const Context context = Opened(bytes);
  std::vector<LibraryPage> pages;
  for (const heif_item_id id : Images(context.get())) {
    const Handle handle = HandleOf(context.get(), id);
    pages.push_back({heif_image_handle_get_width(handle.get()),
                     heif_image_handle_get_height(handle.get()),
                     "",
                     {}});
  }
  return pages;
}

// The pixels are those that the camera stored: turns, mirrors and crops are left to the caller, as
// for all other kinds. The orientation in EXIF, which says the same again, is not used.
DecodedImage DecodeHeif(const std::string& bytes, const LibraryReading& reading) {
  const Context context = Opened(bytes);
  const std::vector<heif_item_id> images = Images(context.get());
  const auto page = static_cast<std::size_t>(reading.reading.page.value_or(0));
  if (page >= images.size()) throw Refusal("it has no such image");
  const Handle handle = HandleOf(context.get(), images[page]);
  const int bits = heif_image_handle_get_luma_bits_per_pixel(handle.get());
  const bool has_alpha = heif_image_handle_has_alpha_channel(handle.get()) != 0;
  const bool is_wide = bits > 8;
  const int channels = has_alpha ? 4 : 3;
  reading.require_memory(heif_image_handle_get_width(handle.get()),
                         heif_image_handle_get_height(handle.get()), channels * (is_wide ? 2 : 1),
                         "its pixels");
  const std::unique_ptr<heif_decoding_options,
                        Releases<heif_decoding_options, heif_decoding_options_free>>
      options(heif_decoding_options_alloc());
  options->ignore_transformations = 1;
  heif_image* decoded = nullptr;
  const heif_chroma chroma =
      is_wide
          ? (has_alpha ? heif_chroma_interleaved_RRGGBBAA_LE : heif_chroma_interleaved_RRGGBB_LE)
          : (has_alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB);
  Require(heif_decode_image(handle.get(), &decoded, heif_colorspace_RGB, chroma, options.get()));
  const Image image(decoded);
  DecodedImage result;
  result.pixels = Interleaved(image.get(), heif_channel_interleaved,
                              CV_MAKETYPE(is_wide ? CV_16U : CV_8U, channels));
  ImageFacts& facts = result.facts;
  facts.container_bits = is_wide ? 16 : 8;
  facts.sample_type = "unsigned " + std::to_string(bits) + "-bit integers";
  facts.full_scale = std::ldexp(1.0, bits) - 1;
  if (is_wide) {
    facts.significant_bits = bits;
    if (reading.reading.spread_bits) {
      result.pixels.convertTo(result.pixels, result.pixels.type(), 65535 / *facts.full_scale);
      facts.full_scale = 65535;
    }
  }
  facts.channels = {"R", "G", "B"};
  if (has_alpha) {
    facts.channels.emplace_back("A");
    facts.alpha = heif_image_handle_is_premultiplied_alpha(handle.get()) != 0
                      ? AlphaKind::kAssociated
                      : AlphaKind::kStraight;
  }
  TakeProfile(handle.get(), &facts);
  const HeifBoxes boxes(bytes);
  if (const std::optional<HeifColourCodes> codes = boxes.ColourCodesOf(images[page]))
    TakeCodes(*codes, &facts);
  bool is_cropped = false;
  facts.orientation = boxes.OrientationOf(images[page], &is_cropped);
  if (is_cropped) facts.notes.emplace_back("The file's crop is not applied.");
  if (bytes.compare(8, 4, "avif") == 0 || bytes.compare(8, 4, "avis") == 0)
    facts.file_kind = "AVIF";
  if (images.size() > 1 && !reading.reading.page)
    facts.notes.emplace_back("The file's main image is taken.");
  return result;
}

namespace {

// The XMP packet that belongs to an image; empty: there is none.
std::string XmpOf(const heif_image_handle* handle) {
  const int count = heif_image_handle_get_number_of_metadata_blocks(handle, "mime");
  std::vector<heif_item_id> ids(static_cast<std::size_t>(std::max(count, 0)));
  heif_image_handle_get_list_of_metadata_block_IDs(handle, "mime", ids.data(), count);
  for (const heif_item_id id : ids) {
    const char* const type = heif_image_handle_get_metadata_content_type(handle, id);
    if (type == nullptr || std::strcmp(type, "application/rdf+xml") != 0) continue;
    const std::size_t size = heif_image_handle_get_metadata_size(handle, id);
    constexpr std::size_t kMaxBytes = 256 << 20;
    if (size > kMaxBytes) throw Refusal("XMP of " + std::to_string(size) + " bytes");
    std::string packet(size, '\0');
    Require(heif_image_handle_get_metadata(handle, id, packet.data()));
    return packet;
  }
  return "";
}

std::vector<std::string> AuxiliaryTypesOf(const heif_image_handle* handle, heif_item_id depth) {
  const int filter = LIBHEIF_AUX_IMAGE_FILTER_OMIT_ALPHA | LIBHEIF_AUX_IMAGE_FILTER_OMIT_DEPTH;
  const int count = heif_image_handle_get_number_of_auxiliary_images(handle, filter);
  std::vector<heif_item_id> ids(static_cast<std::size_t>(std::max(count, 0)));
  heif_image_handle_get_list_of_auxiliary_image_IDs(handle, filter, ids.data(), count);
  std::vector<std::string> types;
  for (const heif_item_id id : ids) {
    heif_image_handle* auxiliary = nullptr;
    if (id == depth || heif_image_handle_get_auxiliary_image_handle(handle, id, &auxiliary).code !=
                           heif_error_Ok) {
      continue;
    }
    const Handle owner(auxiliary);
    const char* type = nullptr;
    if (heif_image_handle_get_auxiliary_type(auxiliary, &type).code != heif_error_Ok || !type)
      continue;
    types.emplace_back(type);
    heif_image_handle_free_auxiliary_types(auxiliary, &type);
  }
  return types;
}

void TakeRepresentation(const heif_image_handle* handle, heif_item_id id, LibraryDepth* depth) {
  const heif_depth_representation_info* info = nullptr;
  if (heif_image_handle_get_depth_image_representation_info(handle, id, &info) == 0 || !info)
    return;
  depth->stated.emplace_back("depth_representation_type", info->depth_representation_type);
  if (info->has_z_near != 0) depth->stated.emplace_back("z_near", info->z_near);
  if (info->has_z_far != 0) depth->stated.emplace_back("z_far", info->z_far);
  if (info->has_d_min != 0) depth->stated.emplace_back("d_min", info->d_min);
  if (info->has_d_max != 0) depth->stated.emplace_back("d_max", info->d_max);
  heif_depth_representation_info_free(info);
}

}  // namespace

// The depth image is returned as it is stored, like the photograph by DecodeHeif: both are turned
// alike when they are displayed.
LibraryDepth HeifDepth(const std::string& bytes, const LibraryReading& reading) {
  const Context context = Opened(bytes);
  const Handle photo = HandleOf(context.get(), Images(context.get())[0]);
  LibraryDepth depth;
  depth.photo_xmp = XmpOf(photo.get());
  heif_item_id id = 0;
  const bool has_depth = heif_image_handle_has_depth_image(photo.get()) != 0 &&
                         heif_image_handle_get_list_of_depth_image_IDs(photo.get(), &id, 1) == 1;
  depth.other_types = AuxiliaryTypesOf(photo.get(), id);
  if (!has_depth) return depth;
  heif_image_handle* opened = nullptr;
  Require(heif_image_handle_get_depth_image_handle(photo.get(), id, &opened));
  const Handle handle(opened);
  depth.xmp = XmpOf(handle.get());
  TakeRepresentation(photo.get(), id, &depth);
  reading.require_memory(heif_image_handle_get_width(handle.get()),
                         heif_image_handle_get_height(handle.get()), 2, "its depth image");
  const std::unique_ptr<heif_decoding_options,
                        Releases<heif_decoding_options, heif_decoding_options_free>>
      options(heif_decoding_options_alloc());
  options->ignore_transformations = 1;
  heif_image* decoded = nullptr;
  // The numbers are those of the luma channel, which no conversion of colours may touch.
  Require(heif_decode_image(handle.get(), &decoded, heif_colorspace_undefined,
                            heif_chroma_undefined, options.get()));
  const Image image(decoded);
  // The header may state other bits than the compressed data have.
  depth.bits = heif_image_get_bits_per_pixel_range(image.get(), heif_channel_Y);
  const int stored_bits = heif_image_get_bits_per_pixel(image.get(), heif_channel_Y);
  if (depth.bits < 1 || depth.bits > 16 || stored_bits != (depth.bits > 8 ? 16 : 8))
    throw Refusal("a depth image of " + std::to_string(depth.bits) + " bits");
  depth.numbers = Interleaved(image.get(), heif_channel_Y, depth.bits > 8 ? CV_16UC1 : CV_8UC1);
  return depth;
}

}  // namespace thicklens::io
