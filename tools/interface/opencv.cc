#include "thicklens/opencv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/io/frame_files.h"
#include "tools/interface/validation.h"

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

// The names of frames in messages.
std::vector<std::string> FrameNames(const std::vector<model::SweepFrame>& frames) {
  std::vector<std::string> names;
  names.reserve(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::string number = fmt::format("frame {}", i);
    names.push_back(frames[i].image.empty() ? number
                                            : fmt::format("{} ({})", number, frames[i].Name()));
  }
  return names;
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
  if (image.is_empty()) throw Error("image: it is empty");
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

DepthMap DepthMapFromMat(const cv::Mat& mat, const DepthMeaning& meaning,
                         const std::string& source) {
  checks::RequireValid(meaning);
  const std::string where = source.empty() ? "depth" : source;
  if (mat.empty()) throw Error(fmt::format("{}: the matrix is empty", where));
  if (mat.dims != 2 || mat.channels() != 1) {
    throw Error(
        fmt::format("{}: a matrix of two dimensions and one channel is expected, found {} "
                    "dimensions and {} channel(s)",
                    where, mat.dims, mat.channels()));
  }
  DepthMap depth{mat.cols, mat.rows, {}, mat.depth() != CV_32F, meaning, source};
  switch (mat.depth()) {
    case CV_8U:
      depth.values = ValuesOf<std::uint8_t, float>(mat);
      break;
    case CV_16U:
      depth.values = ValuesOf<std::uint16_t, float>(mat);
      break;
    case CV_32F:
      depth.values = ValuesOf<float, float>(mat);
      break;
    default:
      throw Error(fmt::format("{}: a matrix of CV_8U, CV_16U or CV_32F is expected", where));
  }
  return depth;
}

cv::Mat MatFromDepthMap(const DepthMap& depth) {
  checks::RequireValid(depth);
  if (!depth.is_integer) {
    return MatOf<float, float>(depth.values, depth.width_px, depth.height_px, 1, CV_32F, false);
  }
  constexpr float kMost = std::numeric_limits<std::uint16_t>::max();
  const auto other = std::find_if(depth.values.begin(), depth.values.end(), [](float value) {
    return !(value >= 0 && value <= kMost) || value != std::floor(value);
  });
  if (other != depth.values.end()) {
    throw Error(
        fmt::format("{}: whole numbers from 0 to {} are expected in a map of whole numbers, "
                    "found {}",
                    depth.source.empty() ? "depth" : depth.source, kMost, *other));
  }
  return MatOf<float, std::uint16_t>(depth.values, depth.width_px, depth.height_px, 1, CV_16U,
                                     false);
}

calib::FocusSweep FocusSweepOf(const Sweep& sweep) {
  calib::FocusSweep focus_sweep = calib::MakeFocusSweep(sweep.description, sweep.camera);
  // The correction of green planes has their size, and these frames have the sensor's.
  if (sweep.description.raw != model::SweepRaw::kGreen) focus_sweep.correction = sweep.correction;
  if (sweep.frames != nullptr) {
    focus_sweep.read_frame = [frames = sweep.frames,
                              names = FrameNames(sweep.description.frames)](std::size_t i) {
      const Image image = frames->Read(i);
      if (image.is_empty()) {
        throw Error(fmt::format("{}: FrameSource::Read returned an empty image", names.at(i)));
      }
      return MatFromImage(image, image.order());
    };
  } else {
    focus_sweep.read_frame = [files = std::make_shared<io::FrameFiles>(
                                  sweep.description.frames, sweep.description.full_scale)](
                                 std::size_t i) { return files->Read(i); };
  }
  if (!focus_sweep.grid_views.empty()) {
    std::vector<model::SweepFrame> views;
    for (const std::string& view : focus_sweep.grid_views) views.push_back({view, 0});
    focus_sweep.read_grid_view = [files = std::make_shared<io::FrameFiles>(
                                      views, sweep.description.full_scale)](std::size_t i) {
      return files->Read(i);
    };
  }
  return focus_sweep;
}

}  // namespace thicklens
