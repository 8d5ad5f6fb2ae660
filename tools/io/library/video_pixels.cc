// The values of video frames: what they mean, and their conversion to grey or RGB.
#include "tools/io/library/video_pixels.h"

extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>

#include "tools/io/library/decoders.h"

namespace thicklens::io {
namespace {

const AVPixFmtDescriptor& Describe(const AVFrame& frame) {
  const AVPixFmtDescriptor* const known =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  if (known == nullptr) throw Refusal("its pixels are of an unknown kind");
  constexpr std::uint64_t kNotRead =
      AV_PIX_FMT_FLAG_HWACCEL | AV_PIX_FMT_FLAG_BAYER | AV_PIX_FMT_FLAG_FLOAT;
  if ((known->flags & kNotRead) != 0)
    throw Refusal(std::string("its pixels, ") + known->name + ", are not read");
  return *known;
}

bool IsRgb(const AVPixFmtDescriptor& known) {
  return (known.flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL)) != 0;
}
// One component, or two with alpha.
bool IsGrey(const AVPixFmtDescriptor& known) { return known.nb_components < 3 && !IsRgb(known); }

// The formats "yuvj" are of full range whatever the frame states.
bool IsJpegRange(const AVPixFmtDescriptor& known) {
  return std::string(known.name).rfind("yuvj", 0) == 0;
}

void TakeRange(const AVFrame& frame, const AVPixFmtDescriptor& known, VideoFacts* video) {
  video->is_range_stated = frame.color_range != AVCOL_RANGE_UNSPECIFIED || IsJpegRange(known);
  video->is_full_range = frame.color_range == AVCOL_RANGE_JPEG || IsJpegRange(known) ||
                         IsRgb(known) ||
                         // Motion JPEG and raw grey values: nobody subtracts a pedestal there.
                         (!video->is_range_stated &&
                          (video->codec == "Motion JPEG" ||
                           (IsGrey(known) && video->codec != "H.264" && video->codec != "H.265")));
}

// The coefficients of swscale; the files of small frames that state none follow BT.601, and those
// of large ones BT.709, as players assume.
int MatrixOf(const AVFrame& frame, VideoFacts* video) {
  constexpr int kHighDefinitionRows = 720;
  video->is_matrix_stated = frame.colorspace != AVCOL_SPC_UNSPECIFIED;
  switch (frame.colorspace) {
    case AVCOL_SPC_BT709:
      video->matrix = "BT.709";
      return SWS_CS_ITU709;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      video->matrix = "BT.601";
      return SWS_CS_ITU601;
    case AVCOL_SPC_FCC:
      video->matrix = "FCC";
      return SWS_CS_FCC;
    case AVCOL_SPC_SMPTE240M:
      video->matrix = "SMPTE 240M";
      return SWS_CS_SMPTE240M;
    case AVCOL_SPC_BT2020_NCL:
      video->matrix = "BT.2020";
      return SWS_CS_BT2020;
    case AVCOL_SPC_UNSPECIFIED:
      video->matrix = frame.height >= kHighDefinitionRows ? "BT.709" : "BT.601";
      return frame.height >= kHighDefinitionRows ? SWS_CS_ITU709 : SWS_CS_ITU601;
    default:
      break;
  }
  const char* const name = av_color_space_name(frame.colorspace);
  throw Refusal(std::string("its colours are coded as ") + (name == nullptr ? "unknown" : name) +
                "; BT.601, BT.709 and BT.2020 with constant coefficients are read");
}

void TakeTransfer(const AVFrame& frame, ImageFacts* facts) {
  switch (frame.color_trc) {
    case AVCOL_TRC_BT709:
    case AVCOL_TRC_SMPTE170M:
    case AVCOL_TRC_BT2020_10:
    case AVCOL_TRC_BT2020_12:
      facts->transfer = StatedTransfer::kBt709;
      break;
    case AVCOL_TRC_IEC61966_2_1:
      facts->transfer = StatedTransfer::kSrgb;
      break;
    case AVCOL_TRC_GAMMA22:
      facts->transfer = StatedTransfer::kGamma;
      facts->gamma = 2.2;
      break;
    case AVCOL_TRC_GAMMA28:
      facts->transfer = StatedTransfer::kGamma;
      facts->gamma = 2.8;
      break;
    case AVCOL_TRC_LINEAR:
      facts->transfer = StatedTransfer::kLinear;
      break;
    case AVCOL_TRC_SMPTE2084:
      facts->transfer = StatedTransfer::kPq;
      break;
    case AVCOL_TRC_ARIB_STD_B67:
      facts->transfer = StatedTransfer::kHlg;
      break;
    default: {
      const char* const name = av_color_transfer_name(frame.color_trc);
      if (frame.color_trc != AVCOL_TRC_UNSPECIFIED && name != nullptr)
        facts->notes.push_back(std::string("It states the transfer curve ") + name + ".");
      break;
    }
  }
}

std::string ChromaOf(const AVPixFmtDescriptor& known) {
  if (known.log2_chroma_w == 0) return known.log2_chroma_h == 0 ? "4:4:4" : "4:4:0";
  if (known.log2_chroma_w == 1) return known.log2_chroma_h == 0 ? "4:2:2" : "4:2:0";
  return known.log2_chroma_h == 0 ? "4:1:1" : "4:1:0";
}

int SwsMatrixOf(const AVFrame& frame) {
  VideoFacts ignored;
  return MatrixOf(frame, &ignored);
}

}  // namespace

void DescribePixels(const AVFrame& frame, ImageFacts* facts) {
  const AVPixFmtDescriptor& known = Describe(frame);
  facts->stored_width_px = facts->width_px = frame.width;
  facts->stored_height_px = facts->height_px = frame.height;
  VideoFacts* const video = &*facts->video;
  video->pixel_format = known.name;
  TakeRange(frame, known, video);
  if (!IsGrey(known) && !IsRgb(known)) {
    MatrixOf(frame, video);
    video->chroma = ChromaOf(known);
  }
  TakeTransfer(frame, facts);
  const int bits = (known.flags & AV_PIX_FMT_FLAG_PAL) != 0 ? 8 : known.comp[0].depth;
  facts->sample_type = "unsigned " + std::to_string(bits) + "-bit integers";
  facts->container_bits = bits <= 8 ? 8 : 16;
  if (bits < facts->container_bits) facts->significant_bits = bits;
  facts->full_scale = bits <= 8 ? 255 : 65535;
  facts->channels = {"R", "G", "B"};
  if (IsGrey(known)) facts->channels = {"Y"};
  if ((known.flags & AV_PIX_FMT_FLAG_ALPHA) != 0)
    facts->notes.emplace_back("Its alpha channel is not read.");
}

// FNV-1a over words of 8 bytes, folded: it has to distinguish frames of one video, not to resist
// anybody.
std::uint64_t DigestOfPixels(const AVFrame& frame) {
  const AVPixFmtDescriptor& known = Describe(frame);
  constexpr std::uint64_t kBasis = 0xCBF29CE484222325U, kPrime = 0x100000001B3U;
  std::uint64_t digest = kBasis;
  const auto add = [&](std::uint64_t word) {
    digest = (digest ^ word) * kPrime;
    digest ^= digest >> 29;
  };
  const int planes = av_pix_fmt_count_planes(static_cast<AVPixelFormat>(frame.format));
  for (int plane = 0; plane < planes; ++plane) {
    const int bytes =
        av_image_get_linesize(static_cast<AVPixelFormat>(frame.format), frame.width, plane);
    const bool is_chroma = (plane == 1 || plane == 2) && !IsRgb(known);
    const int rows = is_chroma ? AV_CEIL_RSHIFT(frame.height, known.log2_chroma_h) : frame.height;
    if (frame.data[plane] == nullptr || bytes <= 0) continue;
    for (int y = 0; y < rows; ++y) {
      const std::uint8_t* const row =
          frame.data[plane] + static_cast<std::ptrdiff_t>(y) * frame.linesize[plane];
      int x = 0;
      for (; x + 8 <= bytes; x += 8) {
        std::uint64_t word = 0;
        std::memcpy(&word, row + x, 8);
        add(word);
      }
      for (; x < bytes; ++x) add(row[x]);
    }
  }
  return digest;
}

PixelConverter::~PixelConverter() { sws_freeContext(context_); }

// swscale takes every grey value to be of full range.
cv::Mat PixelConverter::ConvertGrey(const AVFrame& frame, const ImageFacts& facts) const {
  const AVPixFmtDescriptor& known = Describe(frame);
  const AVComponentDescriptor& component = known.comp[0];
  const int bits = component.depth, bytes = component.depth > 8 ? 2 : 1;
  const bool is_big_endian = (known.flags & AV_PIX_FMT_FLAG_BE) != 0;
  if (bits < 8 || (known.flags & AV_PIX_FMT_FLAG_BITSTREAM) != 0)
    throw Refusal(std::string("its pixels, ") + known.name + ", are not read");
  const double unit = std::ldexp(1.0, bits - 8);
  const double black = facts.video->is_full_range ? 0 : 16 * unit;
  const double white = facts.video->is_full_range ? std::ldexp(1.0, bits) - 1 : 235 * unit;
  const double full = facts.container_bits == 8 ? 255 : 65535;
  cv::Mat table(1, 1 << bits, CV_64F);
  for (int value = 0; value < table.cols; ++value) {
    table.at<double>(value) =
        std::floor(std::clamp((value - black) / (white - black), 0.0, 1.0) * full + 0.5);
  }
  cv::Mat pixels(frame.height, frame.width, facts.container_bits == 8 ? CV_8U : CV_16U);
  for (int y = 0; y < frame.height; ++y) {
    const std::uint8_t* const row =
        frame.data[component.plane] +
        static_cast<std::ptrdiff_t>(y) * frame.linesize[component.plane] + component.offset;
    for (int x = 0; x < frame.width; ++x) {
      const std::uint8_t* const at = row + static_cast<std::ptrdiff_t>(x) * component.step;
      int value = at[0];
      if (bytes == 2) value = is_big_endian ? at[0] << 8 | at[1] : at[1] << 8 | at[0];
      value = (value >> component.shift) & (table.cols - 1);
      if (facts.container_bits == 8) {
        pixels.ptr(y)[x] = static_cast<std::uint8_t>(table.at<double>(value));
      } else {
        pixels.ptr<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(table.at<double>(value));
      }
    }
  }
  return pixels;
}

cv::Mat PixelConverter::Convert(const AVFrame& frame, const ImageFacts& facts) {
  const AVPixFmtDescriptor& known = Describe(frame);
  if (IsGrey(known)) return ConvertGrey(frame, facts);
  const bool is_wide = facts.container_bits == 16;
  const auto from = static_cast<AVPixelFormat>(frame.format);
  const AVPixelFormat to = is_wide ? AV_PIX_FMT_RGB48 : AV_PIX_FMT_RGB24;
  // Rounded values, and colours that are interpolated between their samples.
  const int flags =
      SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT;
  context_ = sws_getCachedContext(context_, frame.width, frame.height, from, frame.width,
                                  frame.height, to, flags, nullptr, nullptr, nullptr);
  if (context_ == nullptr)
    throw Refusal(std::string("its pixels, ") + known.name + ", are not converted");
  if (!IsRgb(known)) {
    constexpr int kOne = 1 << 16;  // contrast and saturation as they are
    const int* const matrix = sws_getCoefficients(SwsMatrixOf(frame));
    if (sws_setColorspaceDetails(context_, matrix, facts.video->is_full_range ? 1 : 0, matrix, 1, 0,
                                 kOne, kOne) < 0) {
      throw Refusal(std::string("the colours of its pixels, ") + known.name +
                    ", are not converted");
    }
  }
  cv::Mat pixels(frame.height, frame.width, is_wide ? CV_16UC3 : CV_8UC3);
  // The vector code of swscale may write beyond the end of a row that is not a multiple of 16 px.
  constexpr int kPadding = 64;
  cv::Mat padded(frame.height + 1, frame.width + kPadding, pixels.type());
  std::uint8_t* const data[4] = {padded.data, nullptr, nullptr, nullptr};
  const int steps[4] = {static_cast<int>(padded.step), 0, 0, 0};
  if (sws_scale(context_, frame.data, frame.linesize, 0, frame.height, data, steps) !=
      frame.height) {
    throw Refusal("the colours of its pixels are not converted");
  }
  padded(cv::Rect(0, 0, frame.width, frame.height)).copyTo(pixels);
  return pixels;
}

}  // namespace thicklens::io
