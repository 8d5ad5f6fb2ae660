#include "estimator/scene/encoding_slope.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>

namespace thicklens::estimator {

EncodedValueTable::EncodedValueTable(const model::TransferCurve& transfer) : transfer_(transfer) {
  for (int i = 0; i <= kCells + 1; ++i) {
    const double root = static_cast<double>(i) / kCells;
    stored_.push_back(static_cast<float>(transfer.Encode(root * root)));
  }
}

namespace {

// Returns the grey of an image; for channels that are no colours, their mean.
model::LinearImage GreyOf(const model::LinearImage& image) {
  if (image.channels == 1 || image.channels == 3) return model::ToGrey(image);
  const auto channels = static_cast<std::size_t>(image.channels);
  model::LinearImage grey{image.width_px, image.height_px, 1, {}};
  grey.values.resize(image.values.size() / channels);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    grey.values[i / channels] += image.values[i] / static_cast<float>(channels);
  }
  return grey;
}

}  // namespace

std::vector<double> EncodingSlopes(const model::LinearImage& image,
                                   const model::TransferCurve& transfer, double smoothing_px) {
  model::LinearImage grey = GreyOf(image);
  cv::Mat smooth(grey.height_px, grey.width_px, CV_32F, grey.values.data());
  if (smoothing_px > 0) {
    cv::GaussianBlur(smooth, smooth, {}, smoothing_px, smoothing_px, cv::BORDER_REPLICATE);
  }
  // [D110] The slope is a central difference of the curve, because not every kind has a formula. In
  // the straight piece of sRGB and beyond it, the step stays on one side of the bend except for a
  // hundredth of the light.
  const double darkest = transfer.Decode(kDarkest);
  const auto slope = [&](double light) {
    const double at = std::clamp(light, darkest, 1.0);
    const double step = 1e-3 * at;
    return (transfer.Encode(at + step) - transfer.Encode(at - step)) / (2 * step);
  };
  constexpr int kCells = 2048;
  std::vector<double> table;
  for (int i = 0; i <= kCells + 1; ++i) {
    const double root = static_cast<double>(i) / kCells;
    table.push_back(slope(root * root));
  }
  std::vector<double> slopes;
  slopes.reserve(grey.values.size());
  for (const float light : grey.values) {
    const double at = std::sqrt(std::clamp(static_cast<double>(light), 0.0, 1.0)) * kCells;
    const auto cell = static_cast<std::size_t>(at);
    const double share = at - static_cast<double>(cell);
    slopes.push_back(table[cell] * (1 - share) + table[cell + 1] * share);
  }
  return slopes;
}

}  // namespace thicklens::estimator
