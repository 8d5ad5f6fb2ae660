#include "calib/registration/spot_moments.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSpots = 6;
constexpr int kBlockPx = 32;
constexpr double kThreshold = 0.3;       // of the strongest point
constexpr double kThresholdNoises = 8;   // of the ground
constexpr double kSameStrength = 3;      // ratio to the median of the points
constexpr double kRoundness = 1.7;       // ratio of the sides of a point's box
constexpr double kEven = 0.08;           // of the strongest point: more is no ground
constexpr double kOutstanding = 12;      // of the ground's robust standard deviation
constexpr double kMaxUneven = 0.12;      // share of the pixels that may differ from the ground
constexpr double kApart = 4;             // spacing over the diameter of a point
constexpr double kRing = 1.5;            // outer radius of the ring over the inner
constexpr double kMinOfRing = 0.3;       // of its pixels without neighbours
constexpr double kReachOfNeighbour = 4;  // sigmas of a neighbour that stay outside the window
constexpr double kMinFlux = 8;           // of its standard deviation
constexpr int kIterations = 8;
constexpr double kSettledPx = 1e-3;

// The ground: medians of blocks, interpolated.
cv::Mat GroundOf(const cv::Mat& grey) {
  const int columns = std::max(1, grey.cols / kBlockPx), rows = std::max(1, grey.rows / kBlockPx);
  cv::Mat medians(rows, columns, CV_32F), ground;
  for (int row = 0; row < rows; ++row) {
    ThrowIfCancelled();
    for (int column = 0; column < columns; ++column) {
      const int top = row * grey.rows / rows, bottom = (row + 1) * grey.rows / rows;
      const int left = column * grey.cols / columns;
      const int right = (column + 1) * grey.cols / columns;
      std::vector<double> values;
      for (int y = top; y < bottom; ++y) {
        for (int x = left; x < right; ++x) values.push_back(grey.at<float>(y, x));
      }
      medians.at<float>(row, column) = static_cast<float>(Median(std::move(values)));
    }
  }
  cv::resize(medians, ground, grey.size(), 0, 0, cv::INTER_LINEAR);
  return ground;
}

double NoiseOf(const cv::Mat& difference) { return 1.4826 * Quantile(cv::abs(difference), 0.5); }

double NearestDistance(const std::vector<cv::Point2d>& points, std::size_t of) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i != of) nearest = std::min(nearest, cv::norm(points[i] - points[of]));
  }
  return nearest;
}

// Part of a pixel within a circle around the origin whose border is taken as straight.
double PartWithin(double distance, double radius) {
  return std::clamp(radius - distance + 0.5, 0.0, 1.0);
}

// The ground under a point: a plane with the noise about it.
struct Plane {
  double at_start = 0, along_x = 0, along_y = 0, noise = 0;
  int pixels = 0;
};

std::optional<Plane> FitGround(const cv::Mat& grey, const cv::Point2d& centre, double radius,
                               const std::vector<cv::Point2d>& neighbours, double keep_out_px) {
  const double outer = std::max(kRing * radius, radius + 3);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double squares = 0;
  int all = 0, count = 0;
  std::vector<cv::Point2d> near;
  for (const cv::Point2d& other : neighbours) {
    if (cv::norm(other - centre) < outer + keep_out_px) near.push_back(other);
  }
  for (int y = static_cast<int>(std::floor(centre.y - outer));
       y <= static_cast<int>(std::ceil(centre.y + outer)); ++y) {
    for (int x = static_cast<int>(std::floor(centre.x - outer));
         x <= static_cast<int>(std::ceil(centre.x + outer)); ++x) {
      const cv::Point2d place(x - centre.x, y - centre.y);
      const double distance = cv::norm(place);
      if (!(distance > radius + 0.5 && distance <= outer)) continue;
      ++all;
      if (x < 0 || y < 0 || x >= grey.cols || y >= grey.rows) continue;
      if (std::any_of(near.begin(), near.end(), [&](const cv::Point2d& other) {
            return cv::norm(cv::Point2d(x, y) - other) < keep_out_px;
          }))
        continue;
      const double value = grey.at<float>(y, x);
      const Eigen::Vector3d row(1, place.x, place.y);
      normal += row * row.transpose();
      right += row * value;
      squares += value * value;
      ++count;
    }
  }
  if (count < 8 || count < kMinOfRing * all) return std::nullopt;
  const Eigen::Vector3d plane = normal.ldlt().solve(right);
  const double rest = squares - plane.dot(right);
  return Plane{plane[0], plane[1], plane[2], std::sqrt(std::max(0.0, rest) / (count - 3)), count};
}

}  // namespace

SpotPattern FindSpots(const cv::Mat& grey) {
  SpotPattern pattern;
  const cv::Mat difference = grey - GroundOf(grey);
  const double noise = NoiseOf(difference);
  const cv::Mat smooth = Smoothed(difference, 1);
  double lowest = 0, highest = 0;
  cv::minMaxLoc(smooth, &lowest, &highest);
  pattern.are_bright = highest > -lowest;
  const double strongest = std::max(highest, -lowest);
  const cv::Mat light = pattern.are_bright ? smooth : cv::Mat(-smooth);
  const double threshold =
      std::max(kThreshold * strongest, kThresholdNoises * noise / std::sqrt(4 * CV_PI));
  cv::Mat labels, boxes, centres;
  const cv::Mat above = light > threshold;
  const int count = cv::connectedComponentsWithStats(above, labels, boxes, centres, 8, CV_32S);
  std::vector<double> peaks(static_cast<std::size_t>(count), 0);
  for (int y = 0; y < labels.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < labels.cols; ++x) {
      double& peak = peaks[static_cast<std::size_t>(labels.at<int>(y, x))];
      peak = std::max(peak, static_cast<double>(light.at<float>(y, x)));
    }
  }
  std::vector<double> areas;
  for (int i = 1; i < count; ++i) areas.push_back(boxes.at<int>(i, cv::CC_STAT_AREA));
  if (areas.size() < kMinSpots) {
    pattern.message = fmt::format("{} points stand out of the ground, but {} are needed",
                                  areas.size(), kMinSpots);
    return pattern;
  }
  const double typical_area = Median(areas);
  const double typical_peak = Median({peaks.begin() + 1, peaks.end()});
  int others = 0;
  for (int i = 1; i < count; ++i) {
    const double width = boxes.at<int>(i, cv::CC_STAT_WIDTH);
    const double height = boxes.at<int>(i, cv::CC_STAT_HEIGHT);
    const double area = boxes.at<int>(i, cv::CC_STAT_AREA);
    const double peak = peaks[static_cast<std::size_t>(i)];
    const bool is_point = std::max(width, height) <= kRoundness * std::min(width, height) + 1 &&
                          area <= kSameStrength * typical_area &&
                          peak * kSameStrength >= typical_peak &&
                          peak <= kSameStrength * typical_peak;
    if (is_point) {
      pattern.centres_px.emplace_back(centres.at<double>(i, 0), centres.at<double>(i, 1));
    } else {
      ++others;
    }
  }
  if (pattern.centres_px.size() < kMinSpots) {
    pattern.message = fmt::format(
        "{} of {} spots are compact and of similar strength, but {} are "
        "needed",
        pattern.centres_px.size(), areas.size(), kMinSpots);
    return pattern;
  }
  std::vector<double> distances;
  for (std::size_t i = 0; i < pattern.centres_px.size(); ++i)
    distances.push_back(NearestDistance(pattern.centres_px, i));
  pattern.spacing_px = Median(distances);
  pattern.done = true;
  pattern.message = "done";
  const double diameter_px = 2 * std::sqrt(typical_area / CV_PI);
  // A Gaussian exceeds 0.3 of its peak within 1.55 sigma.
  pattern.sigma_px = std::max(0.6, diameter_px / 3.1);
  const double uneven = static_cast<double>(cv::countNonZero(
                            cv::abs(smooth) > std::max(kEven * strongest, 4 * noise))) /
                        static_cast<double>(smooth.total());
  pattern.is_nothing_else = strongest > kOutstanding * NoiseOf(smooth) && uneven < kMaxUneven &&
                            others < 0.2 * static_cast<double>(pattern.centres_px.size()) &&
                            pattern.spacing_px > kApart * diameter_px;
  return pattern;
}

std::string SpotFaultInWords(SpotFault fault) {
  switch (fault) {
    case SpotFault::kOutside:
      return "at the border";
    case SpotFault::kOverlapped:
      return "overlapped by a neighbour";
    case SpotFault::kClipped:
      return "clipped";
    case SpotFault::kFaint:
      return "too faint";
    case SpotFault::kNone:
      break;
  }
  return "";
}

SpotMoments MeasureSpot(const cv::Mat& grey, const cv::Point2d& start,
                        const std::vector<cv::Point2d>& neighbours, const SpotWindow& window,
                        model::Psf psf) {
  SpotMoments result;
  const double radius = SpotWindow::kRadius * window.sigma_px;
  const double keep_out_px = kReachOfNeighbour * window.sigma_px;
  cv::Point2d centre = start;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    result.centre_px = centre;
    if (centre.x - radius < -0.5 || centre.y - radius < -0.5 ||
        centre.x + radius > grey.cols - 0.5 || centre.y + radius > grey.rows - 0.5) {
      result.fault = SpotFault::kOutside;
      return result;
    }
    if (std::any_of(neighbours.begin(), neighbours.end(), [&](const cv::Point2d& other) {
          return cv::norm(other - centre) < radius + keep_out_px;
        })) {
      result.fault = SpotFault::kOverlapped;
      return result;
    }
    const std::optional<Plane> ground = FitGround(grey, centre, radius, neighbours, keep_out_px);
    if (!ground) {
      result.fault = SpotFault::kOverlapped;
      return result;
    }
    double flux = 0, moment_x = 0, moment_y = 0, moment_2 = 0;
    double pixels = 0, sum_2 = 0, sum_4 = 0;
    bool is_clipped = false;
    for (int y = static_cast<int>(std::floor(centre.y - radius - 0.5));
         y <= static_cast<int>(std::ceil(centre.y + radius + 0.5)); ++y) {
      if (y < 0 || y >= grey.rows) continue;
      const auto* row = grey.ptr<float>(y);
      for (int x = static_cast<int>(std::floor(centre.x - radius - 0.5));
           x <= static_cast<int>(std::ceil(centre.x + radius + 0.5)); ++x) {
        if (x < 0 || x >= grey.cols) continue;
        const double dx = x - centre.x, dy = y - centre.y;
        const double square = dx * dx + dy * dy;
        const double part = PartWithin(std::sqrt(square), radius);
        if (part == 0) continue;
        is_clipped |= row[x] >= window.clip_light;
        const double light =
            part * window.sign *
            (row[x] - ground->at_start - ground->along_x * dx - ground->along_y * dy);
        flux += light;
        moment_x += light * dx;
        moment_y += light * dy;
        moment_2 += light * square;
        pixels += part;
        sum_2 += part * square;
        sum_4 += part * square * square;
      }
    }
    const double noise2 = ground->noise * ground->noise;
    if (!(flux > kMinFlux * std::sqrt(noise2 * pixels))) {
      result.fault = SpotFault::kFaint;
      return result;
    }
    const cv::Point2d step(moment_x / flux, moment_y / flux);
    const double seen = 0.5 * (moment_2 / flux - step.dot(step));
    if (!(seen > 0)) {
      result.fault = SpotFault::kFaint;
      return result;
    }
    const double flux2 = flux * flux;
    const double of_centroid = noise2 * sum_2 / (2 * flux2);
    const double quotient = 1 + noise2 * pixels / flux2 - noise2 * sum_2 / (2 * flux2 * seen);
    const double reach2 = SpotWindow::kRadius * SpotWindow::kRadius;
    const double beyond =
        psf == model::Psf::kGaussian ? (1 + reach2 / 2) * std::exp(-reach2 / 2) : 0;
    result.variance_px2 = (seen + of_centroid) / std::max(0.5, quotient) / (1 - beyond);
    // d sigma^2 = sum n (r^2/2 - sigma^2)/F, and the same for the error of the ground.
    const double spread = sum_4 / 4 - seen * sum_2 + seen * seen * pixels;
    const double of_ground = (sum_2 / 2 - seen * pixels) / std::sqrt(ground->pixels);
    result.variance_sigma_px2 =
        std::sqrt(noise2 * (std::max(0.0, spread) + of_ground * of_ground)) / flux;
    result.centre_px = centre + step;
    // Clipping leaves the centroid of a symmetric image where it is.
    result.fault = is_clipped ? SpotFault::kClipped : SpotFault::kNone;
    if (cv::norm(result.centre_px - start) > radius) {
      result.fault = SpotFault::kOverlapped;
      return result;
    }
    if (cv::norm(step) < kSettledPx) break;
    centre = result.centre_px;
  }
  return result;
}

}  // namespace thicklens::calib
