// The data of sensors by LibRaw. OpenImageIO reads raw files by LibRaw as well, but a mosaic only
// with its masked margins and black level, and by the name of the file; and its TIFF reader would
// take a preview of a DNG file for the image.
#include <libraw/libraw.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <sstream>

#include "tools/io/library/decoders.h"

namespace thicklens::io {
namespace {

void KeepStill(void* /*data*/, const char* /*file*/, int /*offset*/) {}

void Require(int code) {
  if (code == LIBRAW_SUCCESS) return;
  if (code > 0) throw Refusal(std::strerror(code));
  throw Refusal(std::string("the raw data of this camera cannot be read by LibRaw ") +
                LibRaw::version() + " (" + libraw_strerror(code) +
                "): develop them to a TIFF file; the embedded preview is not taken");
}

std::unique_ptr<LibRaw> Opened(const std::string& bytes) {
  auto raw = std::make_unique<LibRaw>(0U);
  raw->set_dataerror_handler(KeepStill, nullptr);
  Require(raw->open_buffer(const_cast<char*>(bytes.data()), bytes.size()));  // NOLINT: only read
  return raw;
}

// LibRaw's flip: the turn by which the image is displayed.
int OrientationOf(int flip) { return flip == 3 ? 3 : flip == 5 ? 8 : flip == 6 ? 6 : 1; }

std::string Joined(const char* maker, const char* model) {
  std::string text = maker;
  if (*model != '\0') text += (text.empty() ? "" : " ") + std::string(model);
  return text;
}

// The colours of the sites, row by row.
std::string Mosaic(LibRaw* raw) {
  const libraw_iparams_t& camera = raw->imgdata.idata;
  constexpr unsigned kXTrans = 9, kFirstPattern = 1000;
  if (camera.filters != kXTrans && camera.filters < kFirstPattern) return "";
  const int side = camera.filters == kXTrans ? 6 : 2;
  std::string mosaic;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) mosaic += camera.cdesc[raw->COLOR(y, x) & 3];
  }
  // A pattern that repeats after more than two rows is named as a whole.
  for (int y = 0; side == 2 && y < 8; ++y) {
    for (int x = 0; x < 2; ++x) {
      if (camera.cdesc[raw->COLOR(y, x) & 3] != mosaic[static_cast<std::size_t>(y % 2 * 2 + x)])
        return "of more than 2 x 2 px";
    }
  }
  return mosaic;
}

// sRAW and linear DNG files hold colours that were interpolated, often at another sampling. LibRaw
// turns and stretches the demosaiced images of sensors whose pixels are not upright squares.
std::string WhyResampled(LibRaw* raw) {
  const libraw_data_t& data = raw->imgdata;
  const bool is_interpolated = data.idata.filters == 0 && data.idata.colors > 1;
  if (data.rawdata.raw_image == nullptr || is_interpolated)
    return "it holds interpolated colours (sRAW, mRAW, linear DNG), not the pixels of a sensor";
  if (raw->is_fuji_rotated() != 0) return "the rows of its sensor are turned by 45 degrees";
  // As LibRaw decides.
  constexpr double kNarrow = 0.995, kWide = 1.005;
  const double aspect = data.sizes.pixel_aspect;
  if (aspect >= kNarrow && aspect <= kWide) return "";
  std::ostringstream text;
  text << "its pixels are " << aspect << " times as wide as high, and LibRaw makes them square";
  return text.str();
}

RawFacts FactsOf(LibRaw* raw) {
  const libraw_data_t& data = raw->imgdata;
  RawFacts facts;
  facts.camera = Joined(data.idata.make, data.idata.model);
  facts.mosaic = Mosaic(raw);
  facts.why_resampled = WhyResampled(raw);
  facts.sensor_width_px = data.sizes.raw_width;
  facts.sensor_height_px = data.sizes.raw_height;
  facts.active_left_px = data.sizes.left_margin;
  facts.active_top_px = data.sizes.top_margin;
  facts.active_width_px = data.sizes.width;
  facts.active_height_px = data.sizes.height;
  const libraw_colordata_t& colour = data.color;
  facts.white_level = colour.maximum;
  const unsigned rows = colour.cblack[4], columns = colour.cblack[5];
  for (unsigned site = 0; site < 4; ++site) {
    const unsigned y = site / 2, x = site % 2;
    double black =
        colour.black + colour.cblack[raw->COLOR(static_cast<int>(y), static_cast<int>(x)) & 3];
    if (rows > 0 && columns > 0) black += colour.cblack[6 + y % rows * columns + x % columns];
    facts.black_level[site] = black;
  }
  const float* const factors = colour.cam_mul;
  if (factors[0] > 0 && factors[1] > 0 && factors[2] > 0) {
    facts.camera_white_balance =
        std::array<double, 3>{factors[0] / factors[1], 1, factors[2] / factors[1]};
  }
  return facts;
}

cv::Mat MosaicPixels(LibRaw* raw, const RawFacts& facts) {
  const libraw_data_t& data = raw->imgdata;
  if (data.rawdata.raw_image == nullptr)
    throw Refusal("a raw file without a mosaic: its colours have been interpolated by the camera");
  constexpr unsigned kMaxRepeat = 2;
  if (data.color.cblack[4] > kMaxRepeat || data.color.cblack[5] > kMaxRepeat)
    throw Refusal(
        "a black level that differs over more than 2 x 2 px: only the demosaiced image is read");
  if (raw->is_fuji_rotated() != 0)
    throw Refusal("a mosaic that is turned by 45 degrees: only the demosaiced image is read");
  cv::Mat mosaic(facts.active_height_px, facts.active_width_px, CV_16U);
  const std::size_t row_bytes = data.sizes.raw_pitch;
  for (int y = 0; y < mosaic.rows; ++y) {
    const auto* from = reinterpret_cast<const std::uint8_t*>(data.rawdata.raw_image) +  // NOLINT
                       row_bytes * static_cast<std::size_t>(y + facts.active_top_px) +
                       2 * static_cast<std::size_t>(facts.active_left_px);
    std::memcpy(mosaic.ptr(y), from, 2 * static_cast<std::size_t>(mosaic.cols));
  }
  return mosaic;
}

cv::Mat Demosaiced(LibRaw* raw, RawFacts* facts) {
  libraw_output_params_t& options = raw->imgdata.params;
  options.output_bps = 16;
  options.gamm[0] = options.gamm[1] = 1;
  options.no_auto_bright = 1;
  options.adjust_maximum_thr = 0;  // the white level does not depend on the image
  options.use_auto_wb = 0;
  // Without factors in the file, LibRaw would take some from the image, other ones for each frame.
  options.use_camera_wb = facts->camera_white_balance ? 1 : 0;
  if (!facts->camera_white_balance) std::fill_n(options.user_mul, 4, 1.0F);
  // The primaries of sRGB; colours that are not balanced have no place in them.
  options.output_color = facts->camera_white_balance ? 1 : 0;
  options.user_flip = 0;  // as stored
  constexpr int kAhd = 3;
  options.user_qual = kAhd;
  options.highlight = 0;  // clipped
  Require(raw->dcraw_process());
  int code = LIBRAW_SUCCESS;
  const std::unique_ptr<libraw_processed_image_t, void (*)(libraw_processed_image_t*)> image(
      raw->dcraw_make_mem_image(&code), LibRaw::dcraw_clear_mem);
  Require(code);
  if (!image || image->bits != 16) throw Refusal("LibRaw made no image of 16 bits");
  cv::Mat pixels(image->height, image->width, CV_MAKETYPE(CV_16U, image->colors));
  if (image->data_size < pixels.total() * pixels.elemSize())
    throw Refusal("LibRaw made fewer pixels than it states");
  std::memcpy(pixels.data, image->data, pixels.total() * pixels.elemSize());
  facts->treatment =
      std::string(facts->mosaic.empty()        ? "black subtracted"
                  : facts->mosaic.size() == 36 ? "black subtracted, demosaiced (X-Trans by LibRaw)"
                                               : "black subtracted, demosaiced (AHD)") +
      ", linear" +
      (facts->camera_white_balance
           ? ", the camera's white balance, sRGB primaries"
           : ", the sensor's own colours (the file states no white balance)");
  return pixels;
}

}  // namespace

std::vector<LibraryPage> RawPages(const std::string& bytes) {
  const std::unique_ptr<LibRaw> raw = Opened(bytes);
  const unsigned count = std::max(raw->imgdata.idata.raw_count, 1U);
  return std::vector<LibraryPage>(count, {raw->imgdata.sizes.width, raw->imgdata.sizes.height, ""});
}

DecodedImage DecodeRaw(const std::string& bytes, const LibraryReading& reading) {
  const std::unique_ptr<LibRaw> raw = Opened(bytes);
  const int page = reading.reading.page.value_or(0);
  if (page > 0) {
    raw->imgdata.params.shot_select = static_cast<unsigned>(page);
    raw->recycle();
    Require(raw->open_buffer(const_cast<char*>(bytes.data()), bytes.size()));  // NOLINT: only read
  }
  constexpr double kBytesPerPx = 12;  // LibRaw's copies
  reading.require_memory(raw->imgdata.sizes.raw_width, raw->imgdata.sizes.raw_height, kBytesPerPx,
                         "its sensor");
  Require(raw->unpack());
  DecodedImage image;
  RawFacts facts = FactsOf(raw.get());
  image.facts.orientation = OrientationOf(raw->imgdata.sizes.flip);
  image.facts.container_bits = 16;
  image.facts.full_scale = 65535;
  image.facts.transfer = StatedTransfer::kLinear;
  if (reading.reading.raw == RawTreatment::kDemosaiced) {
    image.pixels = Demosaiced(raw.get(), &facts);
    image.facts.channels = image.pixels.channels() == 1 ? std::vector<std::string>{"Y"}
                                                        : std::vector<std::string>{"R", "G", "B"};
  } else {
    image.pixels = MosaicPixels(raw.get(), facts);
    image.facts.channels = {"mosaic"};
  }
  int bits = 0;
  while (bits < 16 && (1U << bits) <= static_cast<unsigned>(facts.white_level)) ++bits;
  image.facts.significant_bits = bits;
  image.facts.sample_type = "unsigned 16-bit integers";
  image.facts.raw = facts;
  return image;
}

}  // namespace thicklens::io
