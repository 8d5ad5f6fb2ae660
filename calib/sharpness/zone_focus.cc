#include "calib/sharpness/zone_focus.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/sharpness/edge_pixels.h"
#include "calib/sharpness/log_parabola.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"

namespace thicklens::calib {
namespace {

constexpr double kZonePx = 20;
constexpr int kMaxZones = 16;
constexpr double kSmoothingPx = 1;
constexpr std::size_t kMinOfTop = 4;
constexpr double kTop = 0.5;
// A zone whose sharpest frame exceeds the least sharp ones by less than this shows noise alone.
constexpr double kMinRise = 1.3;
constexpr double kMinSigma = 0.05;  // of a step: two zones never agree better
constexpr double kMaxSigma = 1.5;   // of a step

struct Sample {
  double reading_mm = 0, sharpness = 0;
};

// First and last + 1 pixel of each zone along one axis, at the scale of the frame. Empty where the
// frame does not show them.
std::vector<cv::Range> PixelsOfZones(int zones, int length_px, double centre_px, double scale) {
  std::vector<cv::Range> ranges;
  const double size_px = static_cast<double>(length_px) / zones;
  for (int zone = 0; zone < zones; ++zone) {
    const double first = centre_px + scale * (zone * size_px - centre_px);
    const int begin = std::max(0, static_cast<int>(std::lround(first)));
    const int end = std::min(length_px, static_cast<int>(std::lround(first + scale * size_px)));
    ranges.emplace_back(begin, std::max(begin, end));
  }
  return ranges;
}

// Squares of the gradient of some rows of a smoothed frame; 0 on the frame's border. Only these
// rows are smoothed, so that they stay in the cache.
cv::Mat SquaredGradient(const cv::Mat& grey, const cv::Range& rows) {
  cv::Mat squares = cv::Mat::zeros(rows.size(), grey.cols, CV_32F);
  const cv::Range around(std::max(0, rows.start - 1), std::min(grey.rows, rows.end + 1));
  const cv::Mat smoothed = Smoothed(grey.rowRange(around), kSmoothingPx);
  for (int y = std::max(1, rows.start); y < std::min(grey.rows - 1, rows.end); ++y) {
    const auto* above = smoothed.ptr<float>(y - 1 - around.start);
    const auto* here = smoothed.ptr<float>(y - around.start);
    const auto* below = smoothed.ptr<float>(y + 1 - around.start);
    auto* square = squares.ptr<float>(y - rows.start);
    for (int x = 1; x + 1 < grey.cols; ++x) {
      const float gx = 0.5F * (here[x + 1] - here[x - 1]);
      const float gy = 0.5F * (below[x] - above[x]);
      square[x] = gx * gx + gy * gy;
    }
  }
  return squares;
}

// Sharpness of all zones of a frame; 0 where the frame does not show the whole zone.
std::vector<double> SharpnessOfZones(const cv::Mat& grey, const ZoneFocus& grid,
                                     const ZoneFrame& frame, const cv::Point2d& centre_px) {
  const std::vector<cv::Range> columns =
      PixelsOfZones(grid.columns, grey.cols, centre_px.x, frame.scale);
  const cv::Rect2d one = grid.Pixels({0, 0, 1, 1}, grey.size());
  const double least_area = 0.5 * frame.scale * frame.scale * one.area();
  std::vector<double> sharpness;
  for (const cv::Range& rows : PixelsOfZones(grid.rows, grey.rows, centre_px.y, frame.scale)) {
    ThrowIfCancelled();
    const cv::Mat squares = rows.empty() ? cv::Mat() : SquaredGradient(grey, rows);
    for (const cv::Range& part : columns) {
      const double area = static_cast<double>(part.size()) * rows.size();
      if (part.empty() || rows.empty() || area < least_area) {
        sharpness.push_back(0);
        continue;
      }
      const double light = cv::mean(grey(rows, part))[0];
      sharpness.push_back(light > 0 ? frame.scale * frame.scale *
                                          cv::mean(squares.colRange(part))[0] / (light * light)
                                    : 0);
    }
  }
  return sharpness;
}

// The vertex of a parabola through the logarithms over the top of the curve.
std::optional<model::Estimate> PeakOf(const std::vector<Sample>& samples) {
  if (samples.size() < kMinOfTop + 1) return std::nullopt;
  const auto top =
      std::max_element(samples.begin(), samples.end(),
                       [](const Sample& a, const Sample& b) { return a.sharpness < b.sharpness; });
  if (top == samples.begin() || top + 1 == samples.end()) return std::nullopt;
  const auto least =
      std::min_element(samples.begin(), samples.end(),
                       [](const Sample& a, const Sample& b) { return a.sharpness < b.sharpness; });
  if (!(top->sharpness > kMinRise * least->sharpness)) return std::nullopt;
  // The noise adds less than the smallest value to every frame.
  const double half = least->sharpness + kTop * (top->sharpness - least->sharpness);
  auto first = top, last = top + 1;
  while (first != samples.begin() && (first - 1)->sharpness >= half) --first;
  while (last != samples.end() && last->sharpness >= half) ++last;
  while (static_cast<std::size_t>(last - first) < kMinOfTop) {
    if (first != samples.begin()) --first;
    if (last != samples.end()) ++last;
    if (first == samples.begin() && last == samples.end()) break;
  }
  const auto n = static_cast<Eigen::Index>(last - first);
  const double middle_mm = top->reading_mm;
  const double half_mm =
      std::max(middle_mm - first->reading_mm, (last - 1)->reading_mm - middle_mm);
  Eigen::VectorXd readings_mm(n), logs(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    readings_mm[i] = (first + i)->reading_mm;
    logs[i] = std::log(std::max((first + i)->sharpness, 1e-12));
  }
  const auto vertex_mm = VertexOfLogs(readings_mm, logs, middle_mm, half_mm);
  if (!vertex_mm) return std::nullopt;
  const double step_mm = (samples.back().reading_mm - samples.front().reading_mm) /
                         static_cast<double>(samples.size() - 1);
  const double sigma_mm = std::hypot(vertex_mm->sigma, kMinSigma * step_mm);
  if (!(sigma_mm < kMaxSigma * step_mm)) return std::nullopt;
  return model::Estimate{vertex_mm->value, sigma_mm};
}

}  // namespace

cv::Rect2d ZoneFocus::Pixels(const cv::Rect& zones, cv::Size image) const {
  const double width = static_cast<double>(image.width) / columns;
  const double height = static_cast<double>(image.height) / rows;
  return {zones.x * width, zones.y * height, zones.width * width, zones.height * height};
}

ZoneFocus FindZoneFocus(const ZoneSetup& setup) {
  ZoneFocus grid;
  if (setup.frames.empty()) return grid;
  std::vector<ZoneFrame> frames = setup.frames;
  std::stable_sort(frames.begin(), frames.end(), [](const ZoneFrame& a, const ZoneFrame& b) {
    return a.reading_mm < b.reading_mm;
  });
  const cv::Size size = setup.read_grey(frames.front().frame).size();
  const auto count = [](int length_px) {
    return std::clamp(static_cast<int>(length_px / kZonePx), 1, kMaxZones);
  };
  grid.columns = count(size.width);
  grid.rows = count(size.height);
  std::vector<std::vector<double>> sharpness(frames.size());
  ParallelFor(static_cast<int>(frames.size()), setup.threads, [&](int i) {
    const auto index = static_cast<std::size_t>(i);
    sharpness[index] = SharpnessOfZones(setup.read_grey(frames[index].frame), grid, frames[index],
                                        setup.centre_px);
  });
  for (std::size_t zone = 0; zone < sharpness.front().size(); ++zone) {
    std::vector<Sample> samples;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (sharpness[i][zone] > 0) samples.push_back({frames[i].reading_mm, sharpness[i][zone]});
    }
    grid.sharpest_mm.push_back(PeakOf(samples));
  }
  return grid;
}

}  // namespace thicklens::calib
