#include "estimator/scene/coarse_start.h"

#include <algorithm>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

int Half(int count) { return (count + 1) / 2; }

}  // namespace

model::LinearImage HalfSize(const model::LinearImage& image) {
  const int channels = image.channels;
  model::LinearImage half{Half(image.width_px), Half(image.height_px), channels, {}};
  half.values.reserve(Index(half.width_px) * Index(half.height_px) * Index(channels));
  for (int y = 0; y < half.height_px; ++y) {
    ThrowIfCancelled();
    const int y1 = std::min(2 * y + 1, image.height_px - 1);
    for (int x = 0; x < half.width_px; ++x) {
      const int x1 = std::min(2 * x + 1, image.width_px - 1);
      for (int c = 0; c < channels; ++c) {
        half.values.push_back((image.at(2 * x, 2 * y, c) + image.at(x1, 2 * y, c) +
                               image.at(2 * x, y1, c) + image.at(x1, y1, c)) /
                              4);
      }
    }
  }
  return half;
}

DisparityMap HalfSize(const DisparityMap& map) {
  DisparityMap half{Half(map.width_px), Half(map.height_px), {}, map.step / 2};
  half.disparity.reserve(Index(half.width_px) * Index(half.height_px));
  for (int y = 0; y < map.height_px; y += 2) {
    ThrowIfCancelled();
    const float* const row = map.disparity.data() + Index(y) * Index(map.width_px);
    for (int x = 0; x < map.width_px; x += 2) half.disparity.push_back(row[x]);
  }
  return half;
}

model::LinearImage WithDetail(const model::LinearImage& image, const model::LinearImage& blurred,
                              const model::LinearImage& sharp) {
  model::LinearImage result = image;
  const std::size_t channels = Index(image.channels);
  std::vector<float> plane(Index(blurred.width_px) * Index(blurred.height_px));
  const cv::Mat detail(blurred.height_px, blurred.width_px, CV_32F, plane.data());
  cv::Mat at_full_size;
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t i = 0; i < plane.size(); ++i) {
      plane[i] = sharp.values[i * channels + c] - blurred.values[i * channels + c];
    }
    cv::resize(detail, at_full_size, {2 * blurred.width_px, 2 * blurred.height_px}, 0, 0,
               cv::INTER_CUBIC);
    float* to = result.values.data() + c;
    for (int y = 0; y < image.height_px; ++y) {
      ThrowIfCancelled();
      const float* const row = at_full_size.ptr<float>(y);
      for (int x = 0; x < image.width_px; ++x, to += channels) *to += row[x];
    }
  }
  return result;
}

}  // namespace thicklens::estimator
