#include "thicklens/model/undistort.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

// Rows whose source positions are held at once.
constexpr int kBandRows = 64;
// cv::remap counts pixels in 16 bits.
constexpr int kTooLargePx = 32767;

// Replaces positions that are NaN, which cv::remap must not see. Returns where they were.
cv::Mat TakeOutMissing(SourcePositions* sources, int width_px, int height_px) {
  cv::Mat missing(height_px, width_px, CV_8U, cv::Scalar(0));
  auto* flag = missing.ptr<std::uint8_t>();
  for (std::size_t i = 0; i < sources->x.size(); ++i) {
    if (!std::isnan(sources->x[i])) continue;
    flag[i] = 255;
    sources->x[i] = sources->y[i] = 0;
  }
  return missing;
}

// Share of the pixels without a source in one row or column of the image.
double MissingShare(const LensDistortion& distortion, const PixelRect& line) {
  if (line.width < 1 || line.height < 1) return 0;
  const SourcePositions sources = SourcesOf(distortion, line.x, line.y, line.width, line.height);
  const auto missing =
      std::count_if(sources.x.begin(), sources.x.end(), [](float x) { return std::isnan(x); });
  return static_cast<double>(missing) / static_cast<double>(sources.x.size());
}

}  // namespace

std::size_t UndistortInto(const LensDistortion& distortion, const float* values, int channels,
                          const PixelRect& part, Resampling resampling, float without_source,
                          float* out) {
  constexpr int kMaxChannels = 4;
  if (channels < 1 || channels > kMaxChannels) {
    throw Error(fmt::format("an image with 1 to {} channels can be undistorted, found {}",
                            kMaxChannels, channels));
  }
  if (std::max({distortion.width_px, distortion.height_px, part.width, part.height}) >=
      kTooLargePx) {
    throw Error(
        fmt::format("an image of {} x {} px is too large to be undistorted: each side must "
                    "have fewer than {} px",
                    distortion.width_px, distortion.height_px, kTooLargePx));
  }
  // OpenCV does not write to the source of a remapping.
  const cv::Mat whole(distortion.height_px, distortion.width_px, CV_MAKETYPE(CV_32F, channels),
                      const_cast<float*>(values));  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  std::size_t missing_count = 0;
  for (int row = 0; row < part.height; row += kBandRows) {
    ThrowIfCancelled();
    const int rows = std::min(kBandRows, part.height - row);
    SourcePositions sources = SourcesOf(distortion, part.x, part.y + row, part.width, rows);
    const cv::Mat missing = TakeOutMissing(&sources, part.width, rows);
    const cv::Mat map_x(rows, part.width, CV_32F, sources.x.data());
    const cv::Mat map_y(rows, part.width, CV_32F, sources.y.data());
    cv::Mat band(rows, part.width, whole.type(),
                 out + static_cast<std::size_t>(row) * static_cast<std::size_t>(part.width) *
                           static_cast<std::size_t>(channels));
    cv::remap(whole, band, map_x, map_y,
              resampling == Resampling::kNearest ? cv::INTER_NEAREST : cv::INTER_LANCZOS4,
              cv::BORDER_REFLECT_101);
    const int count = cv::countNonZero(missing);
    if (count > 0) band.setTo(cv::Scalar::all(without_source), missing);
    missing_count += static_cast<std::size_t>(count);
  }
  return missing_count;
}

LinearImage Undistorted(const LinearImage& image, const LensDistortion& distortion,
                        std::size_t* without_source) {
  LinearImage out = image;
  const std::size_t count = UndistortInto(
      distortion.ScaledTo(image.width_px, image.height_px), image.values.data(), image.channels,
      {0, 0, image.width_px, image.height_px}, Resampling::kLanczos, 0, out.values.data());
  if (without_source != nullptr) *without_source = count;
  return out;
}

void ContinueBeyondSource(const LensDistortion& distortion, LinearImage* image) {
  const int width = image->width_px, height = image->height_px;
  const std::vector<float> sources = SourcesOf(distortion, 0, 0, width, height).x;
  const auto index = [width](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  };
  const Eigen::Vector2d centre =
      distortion.principal_point_px.cwiseMax(0).cwiseMin(Eigen::Vector2d(width - 1, height - 1));
  const auto channels = static_cast<std::size_t>(image->channels);
  for (int y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width; ++x) {
      if (!std::isnan(sources[index(x, y)])) continue;
      const Eigen::Vector2d way = centre - Eigen::Vector2d(x, y);
      const int steps = static_cast<int>(std::ceil(way.cwiseAbs().maxCoeff()));
      for (int i = 1; i <= steps; ++i) {
        const Eigen::Vector2d at = Eigen::Vector2d(x, y) + way * i / steps;
        const std::size_t from =
            index(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
        if (std::isnan(sources[from])) continue;
        std::copy_n(image->values.begin() + static_cast<std::ptrdiff_t>(from * channels), channels,
                    image->values.begin() + static_cast<std::ptrdiff_t>(index(x, y) * channels));
        break;
      }
    }
  }
}

PixelRect RegionWithSource(const LensDistortion& distortion, const PixelRect& within) {
  PixelRect r = within;
  constexpr int kSteps = 512;
  while (r.width > 0 && r.height > 0) {
    ThrowIfCancelled();
    const std::array<double, 4> shares = {
        MissingShare(distortion, {r.x, r.y, r.width, 1}),
        MissingShare(distortion, {r.x, r.y + r.height - 1, r.width, 1}),
        MissingShare(distortion, {r.x, r.y, 1, r.height}),
        MissingShare(distortion, {r.x + r.width - 1, r.y, 1, r.height})};
    const auto worst = std::max_element(shares.begin(), shares.end());
    if (!(*worst > 0)) return r;
    const auto side = worst - shares.begin();
    const int step = std::max(1, std::min(within.width, within.height) / kSteps);
    if (side < 2) {
      if (side == 0) r.y += step;
      r.height -= step;
    } else {
      if (side == 2) r.x += step;
      r.width -= step;
    }
  }
  return {within.x, within.y, 0, 0};
}

}  // namespace thicklens::model
