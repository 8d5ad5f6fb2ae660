#include "thicklens/io/image_io.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "tools/io/picture_kind.h"
#include "tools/io/png_pixels.h"

namespace thicklens::io {
namespace {

template <typename T>
void CopyValues(const cv::Mat& picture, std::vector<std::uint16_t>* values) {
  for (int y = 0; y < picture.rows; ++y) {
    ThrowIfCancelled();
    const T* row = picture.ptr<T>(y);
    values->insert(values->end(), row,
                   row + static_cast<std::ptrdiff_t>(picture.cols) * picture.channels());
  }
}

}  // namespace

cv::Mat DecodePicture(const std::string& bytes, const std::string& name) {
  std::string why;
  const cv::Mat picture =
      DecodeUnchanged(bytes, name,
                      {PictureKind::kPng, PictureKind::kJpeg, PictureKind::kTiff, PictureKind::kBmp,
                       PictureKind::kPnm},
                      &why);
  if (picture.empty()) {
    throw Error(fmt::format("{}: cannot be decoded as a picture ({} bytes): {}", name, bytes.size(),
                            why.empty() ? "a PNG, TIFF, JPEG, BMP or PNM file is expected" : why));
  }
  if (picture.depth() != CV_8U && picture.depth() != CV_16U) {
    throw Error(fmt::format(
        "{}: a picture with 8 or 16 bits per channel is expected, found one of {} bits{}", name,
        8 * picture.elemSize1(), picture.depth() >= CV_32F ? ", float" : ""));
  }
  const int channels = picture.channels();
  if (channels != 1 && channels != 3 && channels != 4) {
    throw Error(fmt::format("{}: 1, 3 or 4 channels are expected, found {}", name, channels));
  }
  return picture;
}

cv::Mat ReadPictureFile(const std::string& path) {
  return DecodePicture(ReadWholeFile(path), path);
}

model::StoredPicture ToStoredPicture(const cv::Mat& picture) {
  model::StoredPicture stored{
      picture.cols, picture.rows, picture.channels(), picture.depth() == CV_8U ? 8 : 16, {}};
  stored.values.reserve(picture.total() * static_cast<std::size_t>(picture.channels()));
  if (stored.bits == 8) {
    CopyValues<std::uint8_t>(picture, &stored.values);
  } else {
    CopyValues<std::uint16_t>(picture, &stored.values);
  }
  return stored;
}

model::StoredPicture WithoutAlpha(const model::StoredPicture& picture) {
  if (picture.channels != 4) return picture;
  model::StoredPicture opaque{picture.width_px, picture.height_px, 3, picture.bits, {}};
  opaque.values.reserve(picture.values.size() / 4 * 3);
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    if (i % 4 != 3) opaque.values.push_back(picture.values[i]);
  }
  return opaque;
}

std::string EncodePng(const model::StoredPicture& picture) {
  const cv::Mat wide(picture.height_px, picture.width_px, CV_16UC(picture.channels),
                     const_cast<std::uint16_t*>(picture.values.data()));  // NOLINT: only read
  cv::Mat values = wide;
  if (picture.bits == 8) wide.convertTo(values, CV_8U);
  // Trying every filter takes three times as long and does not make pictures of 16 bits smaller;
  // pictures of 8 bits have repetitions.
  return EncodePngPixels(values, picture.bits == 8 ? PngPacking::kRepetitions : PngPacking::kFast);
}

std::string EncodeBytesPng(const std::vector<std::uint8_t>& bytes, int width_px) {
  const auto width = static_cast<std::size_t>(width_px);
  if (width_px < 1 || bytes.empty() || bytes.size() % width != 0) {
    throw Error(fmt::format("a picture of bytes: {} bytes are not a whole number of rows of {} px",
                            bytes.size(), width_px));
  }
  const cv::Mat values(static_cast<int>(bytes.size() / width), width_px, CV_8U,
                       const_cast<std::uint8_t*>(bytes.data()));  // NOLINT: only read
  return EncodePngPixels(values, PngPacking::kFast);
}

}  // namespace thicklens::io
