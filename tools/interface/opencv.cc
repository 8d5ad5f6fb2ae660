#include "thicklens/opencv.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/io/image_io.h"

namespace thicklens {
namespace {

bool IsBlueFirst(ChannelOrder order) {
  return order == ChannelOrder::kBgr || order == ChannelOrder::kBgra;
}

int CountOf(ChannelOrder order) {
  if (order == ChannelOrder::kGrey) return 1;
  return order == ChannelOrder::kRgb || order == ChannelOrder::kBgr ? 3 : 4;
}

template <typename From, typename To>
std::vector<To> ValuesOf(const cv::Mat& mat) {
  std::vector<To> values;
  values.reserve(mat.total() * static_cast<std::size_t>(mat.channels()));
  for (int y = 0; y < mat.rows; ++y) {
    const From* row = mat.ptr<From>(y);
    values.insert(values.end(), row, row + static_cast<std::ptrdiff_t>(mat.cols) * mat.channels());
  }
  return values;
}

template <typename From, typename To>
cv::Mat MatOf(const std::vector<From>& values, int width_px, int height_px, int channels, int type,
              bool swap) {
  cv::Mat mat(height_px, width_px, CV_MAKETYPE(type, channels));
  for (int y = 0; y < height_px; ++y) {
    To* row = mat.ptr<To>(y);
    const std::size_t start = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) *
                              static_cast<std::size_t>(channels);
    for (int i = 0; i < width_px * channels; ++i) {
      const int channel = i % channels;
      const int from = swap && channel < 3 ? i - channel + (2 - channel) : i;
      row[i] = static_cast<To>(values[start + static_cast<std::size_t>(from)]);
    }
  }
  return mat;
}

}  // namespace

Image ImageFromMat(const cv::Mat& mat, ChannelOrder order, std::optional<TransferCurve> transfer,
                   const std::string& source) {
  const std::string where = source.empty() ? "image" : source;
  if (mat.empty()) throw Error(fmt::format("{}: the matrix is empty", where));
  if (mat.channels() != CountOf(order)) {
    throw Error(fmt::format("{}: the order {} has {} channel(s), the matrix {}", where,
                            ChannelOrderName(order), CountOf(order), mat.channels()));
  }
  switch (mat.depth()) {
    case CV_8U:
      return Image::FromEncoded(mat.cols, mat.rows, order, 8,
                                ValuesOf<std::uint8_t, std::uint16_t>(mat), transfer, source);
    case CV_16U:
      return Image::FromEncoded(mat.cols, mat.rows, order, 16,
                                ValuesOf<std::uint16_t, std::uint16_t>(mat), transfer, source);
    case CV_32F:
      return Image::FromLight(mat.cols, mat.rows, order, ValuesOf<float, float>(mat),
                              transfer.value_or(TransferCurve::Srgb()), source);
    default:
      throw Error(fmt::format("{}: a matrix of CV_8U, CV_16U or CV_32F is expected", where));
  }
}

cv::Mat MatFromImage(const Image& image, ChannelOrder order) {
  if (image.channels() != CountOf(order)) {
    throw Error(fmt::format("image: the order {} has {} channel(s), the image {}",
                            ChannelOrderName(order), CountOf(order), image.channels()));
  }
  const int width_px = image.width_px(), height_px = image.height_px();
  const int channels = image.channels();
  const bool swap = IsBlueFirst(order);
  if (image.is_linear()) {
    return MatOf<float, float>(image.light().values, width_px, height_px, channels, CV_32F, swap);
  }
  const std::vector<std::uint16_t>& values = image.encoded().values;
  if (image.bits() == 8) {
    return MatOf<std::uint16_t, std::uint8_t>(values, width_px, height_px, channels, CV_8U, swap);
  }
  return MatOf<std::uint16_t, std::uint16_t>(values, width_px, height_px, channels, CV_16U, swap);
}

calib::FocusSweep FocusSweepOf(const Sweep& sweep) {
  calib::FocusSweep focus_sweep = calib::MakeFocusSweep(sweep.description, sweep.camera);
  if (sweep.frames != nullptr) {
    focus_sweep.read_frame = [frames = sweep.frames](std::size_t i) {
      const Image image = frames->Read(i);
      return MatFromImage(image, image.order());
    };
  } else {
    focus_sweep.read_frame =
        [frames = std::make_shared<const std::vector<model::SweepFrame>>(sweep.description.frames)](
            std::size_t i) { return io::ReadImageFile(frames->at(i).image); };
  }
  return focus_sweep;
}

}  // namespace thicklens
