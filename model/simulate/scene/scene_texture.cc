#include "model/simulate/scene/scene_texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "model/simulate/scene/texture_canvas.h"
#include "model/simulate/square_wave.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

// The largest leaf, as a fraction of the shorter side of the visible part.
constexpr double kLargestLeaf = 1.0 / 6;
// Number of cycles of a star without a given sector width.
constexpr double kStarCycles = 36;
constexpr double kStarMarginPx = 8;

constexpr int kRowsOfBand = 64;  // rows that a thread processes at once

struct FeatureRange {
  double chosen_px, smallest_px, largest_px;
};

FeatureRange FeatureRangeOf(TextureKind kind) {
  switch (kind) {
    case TextureKind::kUniform:
      return {1, 0, 1000};
    case TextureKind::kSine:
      return {8, 0, 1e6};  // the shortest period depends on the layer, see SetWave
    case TextureKind::kEdge:
      return {0, 0, 1e6};  // the minimum depends on the layer
    case TextureKind::kCheckerboard:
      return {12, 1, 1000};
    case TextureKind::kSiemensStar:
      return {0, 1, 1000};
    case TextureKind::kDeadLeaves:
      return {2, 0.5, 1000};
    case TextureKind::kNoise:
      return {4, 2, 1000};
    case TextureKind::kImage:
      return {0, 16, 10000};
  }
  throw Error("no such kind of texture");
}

double FeaturePx(const TextureOptions& options) {
  const FeatureRange range = FeatureRangeOf(options.kind);
  const double size_px = options.feature_size_px;
  if (size_px == 0) return range.chosen_px;
  if (!(size_px >= range.smallest_px && size_px <= range.largest_px)) {
    throw Error(
        fmt::format("texture.feature_size_px is {}: for {} it must be from {} to {}, or 0 for a "
                    "size chosen by the program",
                    size_px, TextureKindName(options.kind), range.smallest_px, range.largest_px));
  }
  return size_px;
}

// Colour that a leaf or a noise adds to each channel's mean, from -1 to 1: the sum of a common and
// an independent part.
std::array<double, 3> DrawnColour(const TextureOptions& options, RandomDraws* draws) {
  const double common = 2 * draws->Uniform() - 1;
  std::array<double, 3> colour;
  for (double& channel : colour) {
    channel = (1 - options.saturation) * common + options.saturation * (2 * draws->Uniform() - 1);
  }
  return colour;
}

// A disc, in samples of a canvas.
struct Leaf {
  double x = 0, y = 0, radius = 0;
  std::array<float, 3> light{};
};

// Draws a leaf behind the present ones. `through` is the transmitted part of each sample. Returns
// the sum of the newly hidden parts.
double PaintBehind(const Leaf& leaf, cv::Mat* through, std::array<cv::Mat, 3>* light) {
  const int columns = through->cols, rows = through->rows;
  const double outer_square = (leaf.radius + 0.5) * (leaf.radius + 0.5);
  const double inner = std::max(leaf.radius - 0.5, 0.0);
  double hidden_all = 0;
  // A leaf wider than the tile would overlap itself.
  const int reach = std::min(static_cast<int>(std::ceil(leaf.radius + 1)), (rows - 1) / 2);
  const int centre_y = static_cast<int>(leaf.y);
  for (int i = centre_y - reach; i <= centre_y + reach; ++i) {
    const double dy = i - leaf.y;
    if (!(dy * dy < outer_square)) continue;
    const int row = (i % rows + rows) % rows;
    float* open = through->ptr<float>(row);
    const std::array<float*, 3> to = {
        {(*light)[0].ptr<float>(row), (*light)[1].ptr<float>(row), (*light)[2].ptr<float>(row)}};
    const double half_chord = std::min(std::sqrt(outer_square - dy * dy), (columns - 1) / 2.0);
    const int first = static_cast<int>(std::ceil(leaf.x - half_chord));
    const int last = static_cast<int>(std::floor(leaf.x + half_chord));
    // Parts beyond a side continue at the opposite side.
    for (const int shift : {-columns, 0, columns}) {
      for (int j = std::max(first, shift); j <= std::min(last, shift + columns - 1); ++j) {
        const int column = j - shift;
        if (open[column] == 0) continue;
        // The covered part of the sample's cell, with the leaf's border assumed to be straight.
        const double distance_square = (j - leaf.x) * (j - leaf.x) + dy * dy;
        float hidden = open[column];
        if (distance_square > inner * inner) {
          const double inside = leaf.radius + 0.5 - std::sqrt(distance_square);
          hidden = static_cast<float>(hidden * std::clamp(inside, 0.0, 1.0));
        }
        for (std::size_t c = 0; c < 3; ++c) to[c][column] += hidden * leaf.light[c];
        open[column] -= hidden;
        hidden_all += hidden;
      }
    }
  }
  return hidden_all;
}

// Discs that occlude each other, with radii distributed as r^-3 between the smallest and the
// largest: the statistics of natural images. They are drawn from the front backward until nothing
// shines through.
TextureCanvas DrawDeadLeaves(const TextureOptions& options, const TextureRequest& request,
                             RandomDraws* draws) {
  TextureCanvas canvas =
      MakeTextureCanvas(request.low_mm, request.high_mm, request.coarsest_pixel_mm, 0);
  const double spacing_mm = canvas.spacing_mm.x();
  const double smallest_mm = FeaturePx(options) * request.pixel_mm;
  const double largest_mm =
      std::max(kLargestLeaf * std::min(canvas.width_mm(), canvas.height_mm()), 2 * smallest_mm);
  const double small_term = 1 / (smallest_mm * smallest_mm);
  const double large_term = 1 / (largest_mm * largest_mm);
  // transmitted part of each sample
  cv::Mat open(canvas.rows, canvas.columns, CV_32F, cv::Scalar(1));
  const double total = static_cast<double>(open.total());
  double remaining = total;
  while (remaining > 1e-4 * total) {
    Leaf leaf;
    leaf.radius =
        1 / std::sqrt(small_term - draws->Uniform() * (small_term - large_term)) / spacing_mm;
    leaf.x = draws->Uniform() * canvas.columns;
    leaf.y = draws->Uniform() * canvas.rows;
    const std::array<double, 3> colour = DrawnColour(options, draws);
    for (std::size_t c = 0; c < 3; ++c) {
      leaf.light[c] = static_cast<float>(1 + options.contrast * colour[c]);
    }
    remaining -= PaintBehind(leaf, &open, &canvas.light);
  }
  for (cv::Mat& channel : canvas.light) channel += open;
  return canvas;
}

// Gaussian noise whose amplitude decreases as 1/f, from one cycle per side of the visible part up
// to the shortest period. A tanh limits it to the range from 0 to twice the mean.
TextureCanvas DrawNoise(const TextureOptions& options, const TextureRequest& request,
                        RandomDraws* draws, int threads) {
  TextureCanvas canvas =
      MakeTextureCanvas(request.low_mm, request.high_mm, request.coarsest_pixel_mm, 0);
  const double period_mm = FeaturePx(options) * request.pixel_mm;
  const double lowest_per_mm = 1 / std::min(canvas.width_mm(), canvas.height_mm());
  const auto gain = [&](double fx, double fy) {
    const double f = std::hypot(fx, fy);
    return f > 0 && f * period_mm <= 1 ? 1 / std::max(f, lowest_per_mm) : 0.0;
  };
  const auto draw = [&] {
    cv::Mat samples(canvas.rows, canvas.columns, CV_32F);
    for (int i = 0; i < samples.rows; ++i) {
      ThrowIfCancelled();
      for (int j = 0; j < samples.cols; ++j) {
        samples.at<float>(i, j) = static_cast<float>(draws->Normal());
      }
    }
    FilterSamples(canvas, 1 / period_mm, gain, threads, &samples);
    const double rms = std::sqrt(samples.dot(samples) / static_cast<double>(samples.total()));
    if (rms > 0) samples /= rms;
    return samples;
  };
  const cv::Mat common = draw();
  for (cv::Mat& channel : canvas.light) {
    channel = (1 - options.saturation) * common + options.saturation * draw();
    // The two parts are independent and have the variance 1.
    channel /= std::hypot(1 - options.saturation, options.saturation);
    for (int i = 0; i < channel.rows; ++i) {
      ThrowIfCancelled();
      float* row = channel.ptr<float>(i);
      for (int j = 0; j < channel.cols; ++j) {
        row[j] = static_cast<float>(1 + std::tanh(options.contrast / 2 * row[j]));
      }
    }
  }
  return canvas;
}

TextureCanvas DrawCheckerboard(const TextureOptions& options, const TextureRequest& request) {
  const double period_mm = 2 * FeaturePx(options) * request.pixel_mm;
  TextureCanvas canvas =
      MakeTextureCanvas(request.low_mm, request.high_mm, request.coarsest_pixel_mm, period_mm);
  for (int i = 0; i < canvas.rows; ++i) {
    ThrowIfCancelled();
    for (int j = 0; j < canvas.columns; ++j) {
      const Eigen::Vector2d at_mm = canvas.PositionMm(i, j);
      const double light = 1 + options.contrast *
                                   SquareWaveMean(at_mm.x(), period_mm, canvas.spacing_mm.x()) *
                                   SquareWaveMean(at_mm.y(), period_mm, canvas.spacing_mm.y());
      for (cv::Mat& channel : canvas.light) channel.at<float>(i, j) = static_cast<float>(light);
    }
  }
  return canvas;
}

// Bright and dark sectors around the middle of the visible part.
TextureCanvas DrawSiemensStar(const TextureOptions& options, const TextureRequest& request) {
  // The sectors do not match where the tile repeats; the margin keeps this outside of the visible
  // part.
  const Eigen::Vector2d margin_mm =
      Eigen::Vector2d::Constant(kStarMarginPx * request.coarsest_pixel_mm);
  TextureCanvas canvas = MakeTextureCanvas(request.low_mm - margin_mm, request.high_mm + margin_mm,
                                           request.coarsest_pixel_mm, 0);
  const double rim_mm = (request.high_mm - request.low_mm).minCoeff() / 2;
  const double sector_mm = FeaturePx(options) * request.pixel_mm;
  const double cycles =
      sector_mm > 0 ? std::max(1.0, std::round(kPi * rim_mm / sector_mm)) : kStarCycles;
  for (int i = 0; i < canvas.rows; ++i) {
    ThrowIfCancelled();
    for (int j = 0; j < canvas.columns; ++j) {
      const Eigen::Vector2d at_mm = canvas.PositionMm(i, j) - request.centre_mm;
      const double light =
          1 + options.contrast * StarMean(at_mm.x(), at_mm.y(), cycles, canvas.spacing_mm.x());
      for (cv::Mat& channel : canvas.light) channel.at<float>(i, j) = static_cast<float>(light);
    }
  }
  return canvas;
}

// One channel of an image of 1 (grey), 3 (RGB) or 4 (RGBA) channels.
cv::Mat ChannelOf(const LinearImage& image, int channel) {
  cv::Mat values(image.height_px, image.width_px, CV_32F);
  for (int y = 0; y < image.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < image.width_px; ++x) {
      values.at<float>(y, x) = image.at(x, y, image.channels < 3 ? 0 : channel);
    }
  }
  return values;
}

// The user's image, upright and around the centre. It is mirrored beyond its sides, so that its
// tile is twice as large.
TextureCanvas DrawImage(const TextureOptions& options, const TextureRequest& request,
                        const LinearImage& image) {
  if (image.width_px < 1 || image.height_px < 1) {
    throw Error(fmt::format("texture.image '{}' is empty", options.image_path));
  }
  const double shape = static_cast<double>(image.height_px) / image.width_px;
  // The default width covers the whole visible part.
  const Eigen::Vector2d reach_mm =
      (request.high_mm - request.centre_mm).cwiseMax(request.centre_mm - request.low_mm);
  const double feature_px = FeaturePx(options);
  const double width_mm = feature_px > 0 ? feature_px * request.pixel_mm
                                         : 2 * std::max(reach_mm.x(), reach_mm.y() / shape);
  const Eigen::Vector2d size_mm(width_mm, width_mm * shape);

  const double spacing_mm = std::max(request.coarsest_pixel_mm / kSamplesPerPixel,
                                     2 * size_mm.maxCoeff() / kMaxTileSamples);
  const auto count = [&](double length_mm) {
    return std::clamp(static_cast<int>(std::lround(length_mm / spacing_mm)), 2,
                      kMaxTileSamples / 2);
  };
  const cv::Size size(count(size_mm.x()), count(size_mm.y()));
  TextureCanvas canvas;
  canvas.columns = 2 * size.width;
  canvas.rows = 2 * size.height;
  canvas.spacing_mm = {size_mm.x() / size.width, size_mm.y() / size.height};
  // Samples are in the middle of their cells.
  canvas.origin_mm = request.centre_mm - size_mm / 2 + canvas.spacing_mm / 2;
  for (int c = 0; c < 3; ++c) {
    cv::Mat resized;
    cv::resize(ChannelOf(image, c), resized, size, 0, 0,
               size.width < image.width_px ? cv::INTER_AREA : cv::INTER_CUBIC);
    cv::copyMakeBorder(resized, canvas.light[static_cast<std::size_t>(c)], 0, size.height, 0,
                       size.width, cv::BORDER_REFLECT);
  }
  return canvas;
}

TextureCanvas Draw(const TextureOptions& options, const TextureRequest& request,
                   const LinearImage& image, RandomDraws* draws, int threads) {
  switch (options.kind) {
    case TextureKind::kCheckerboard:
      return DrawCheckerboard(options, request);
    case TextureKind::kSiemensStar:
      return DrawSiemensStar(options, request);
    case TextureKind::kDeadLeaves:
      return DrawDeadLeaves(options, request, draws);
    case TextureKind::kNoise:
      return DrawNoise(options, request, draws, threads);
    default:
      return DrawImage(options, request, image);
  }
}

// Scales the mean of each channel to its colour.
void Paint(const Eigen::Vector3d& colour, TextureCanvas* canvas) {
  for (std::size_t c = 0; c < 3; ++c) {
    cv::Mat& channel = canvas->light[c];
    channel *= colour(static_cast<int>(c)) / cv::mean(channel)[0];
  }
}

}  // namespace

SceneTexture::SceneTexture(const TextureOptions& options, const TextureRequest& request,
                           const LinearImage& image, RandomDraws* draws, int threads) {
  FeaturePx(options);  // throws Error for a wrong size
  colour_.head<3>() = options.colour.cast<float>().array();
  if (options.kind == TextureKind::kUniform) return;
  if (options.kind == TextureKind::kSine || options.kind == TextureKind::kEdge) {
    SetWave(options, request);
    return;
  }
  TextureCanvas canvas = Draw(options, request, image, draws, threads);
  LimitBand(request.coarsest_pixel_mm, threads, &canvas);
  if (options.kind != TextureKind::kImage) Paint(options.colour, &canvas);
  columns_ = canvas.columns;
  rows_ = canvas.rows;
  origin_mm_ = canvas.origin_mm;
  per_mm_ = canvas.spacing_mm.cwiseInverse();
  tile_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  darkest_.setConstant(std::numeric_limits<float>::infinity());
  brightest_ = -darkest_;
  std::mutex mutex;
  const int bands = (rows_ + kRowsOfBand - 1) / kRowsOfBand;
  ParallelFor(bands, threads, [&](int band) {
    Eigen::Array4f darkest = Eigen::Array4f::Constant(std::numeric_limits<float>::infinity());
    Eigen::Array4f brightest = -darkest;
    for (int i = band * kRowsOfBand; i < std::min((band + 1) * kRowsOfBand, rows_); ++i) {
      Eigen::Array4f* sample =
          &tile_[static_cast<std::size_t>(i) * static_cast<std::size_t>(columns_)];
      const float* red = canvas.light[0].ptr<float>(i);
      const float* green = canvas.light[1].ptr<float>(i);
      const float* blue = canvas.light[2].ptr<float>(i);
      for (int j = 0; j < columns_; ++j, ++sample) {
        // The limited band may overshoot beside a dark edge, but light is never negative.
        *sample = Eigen::Array4f(red[j], green[j], blue[j], 0).max(0);
        darkest = darkest.min(*sample);
        brightest = brightest.max(*sample);
      }
    }
    const std::lock_guard<std::mutex> lock(mutex);
    darkest_ = darkest_.min(darkest);
    brightest_ = brightest_.max(brightest);
  });
}

void SceneTexture::SetWave(const TextureOptions& options, const TextureRequest& request) {
  const double angle_rad = options.angle_deg * kPi / 180;
  const Eigen::Vector2d direction(std::cos(angle_rad), std::sin(angle_rad));
  is_edge_ = options.kind == TextureKind::kEdge;
  amplitude_ = options.contrast;
  // Period of a sine or sigma of an edge. The latter has exp(-2 pi^2/4) at half a cycle per px.
  const double least_mm = request.coarsest_pixel_mm * (is_edge_ ? 1 : 1 / kHighestFrequency);
  double size_mm = FeaturePx(options) * request.pixel_mm;
  if (is_edge_ && size_mm == 0) size_mm = least_mm;
  // A chosen value, or one given to the last digit, must not fail because of rounding.
  if (!(size_mm >= least_mm * (1 - 1e-12))) {
    throw Error(
        fmt::format("texture.feature_size_px is {}: the {} must be at least {:.4g} in this layer, "
                    "{} of its largest px",
                    size_mm / request.pixel_mm, is_edge_ ? "sigma of an edge" : "period of a sine",
                    least_mm / request.pixel_mm, is_edge_ ? "one" : "two"));
  }
  wave_ = (is_edge_ ? 1 / (std::sqrt(2.0) * size_mm) : 2 * kPi / size_mm) * direction;
  edge_at_ = wave_.dot(request.centre_mm);
}

Eigen::Array4f SceneTexture::SumAround(const Eigen::Vector2d& centre_mm, const float* x_mm,
                                       const float* y_mm, const float* weight, int count) const {
  using Numbers = Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxAtOnce, 1>;
  using Integers = Eigen::Array<int, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxAtOnce, 1>;
  const Eigen::Map<const Eigen::ArrayXf> dx_mm(x_mm, count), dy_mm(y_mm, count);
  if (count < 1) return Eigen::Array4f::Zero();
  if (tile_.empty() && amplitude_ == 0) {
    return colour_ * Eigen::Map<const Eigen::ArrayXf>(weight, count).sum();
  }
  Eigen::Array4f sum = Eigen::Array4f::Zero();
  if (!tile_.empty()) {
    // Positions in samples, relative to the first sample at or before all positions on both axes.
    const Eigen::Vector2d centre = (centre_mm - origin_mm_).cwiseProduct(per_mm_);
    const Eigen::Vector2d whole = centre.array().floor();
    const Eigen::Vector2f part = (centre - whole).cast<float>(), per_mm = per_mm_.cast<float>();
    Numbers x = part.x() + per_mm.x() * dx_mm, y = part.y() + per_mm.y() * dy_mm;
    const float left = std::floor(x.minCoeff()), above = std::floor(y.minCoeff());
    const double first_column = whole.x() + static_cast<double>(left);
    const double first_row = whole.y() + static_cast<double>(above);
    x -= left;
    y -= above;
    if (first_column >= 0 && first_row >= 0 &&
        first_column + static_cast<double>(x.maxCoeff()) + 2 < columns_ &&
        first_row + static_cast<double>(y.maxCoeff()) + 2 < rows_) {
      const Eigen::Array4f* corner =
          &Sample(static_cast<int>(first_row), static_cast<int>(first_column));
      const Integers column = x.cast<int>(), row = y.cast<int>();
      const Integers offset = row * columns_ + column;
      const Eigen::Map<const Eigen::ArrayXf> all(weight, count);
      const Numbers fx = x - column.cast<float>(), fy = y - row.cast<float>();
      const Numbers right = all * fx, lower_right = right * fy;
      const Numbers upper_right = right - lower_right, lower_left = all * fy - lower_right;
      const Numbers upper_left = all - right - lower_left;
      Eigen::Array4f upper_sum = sum, lower_sum = sum;
      for (int i = 0; i < count; ++i) {
        const Eigen::Array4f* upper = corner + offset(i);
        const Eigen::Array4f* lower = upper + columns_;
        upper_sum += upper_left(i) * upper[0] + upper_right(i) * upper[1];
        lower_sum += lower_left(i) * lower[0] + lower_right(i) * lower[1];
      }
      return upper_sum + lower_sum;
    }
  }
  for (int i = 0; i < count; ++i) {
    sum += weight[i] * At(centre_mm.x() + static_cast<double>(x_mm[i]),
                          centre_mm.y() + static_cast<double>(y_mm[i]));
  }
  return sum;
}

}  // namespace thicklens::model
