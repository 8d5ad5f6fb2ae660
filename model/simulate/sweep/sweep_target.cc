#include "model/simulate/sweep/sweep_target.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <opencv2/imgproc.hpp>

#include "model/simulate/square_wave.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

// Default sizes, in px near the plane of focus.
constexpr double kLeafRadiusPx = 2;
constexpr double kNoisePeriodPx = 2;
constexpr double kSquarePx = 24;
constexpr int kStarCycles = 36;
constexpr double kMeshPeriodPx = 24;
constexpr double kMeshOpening = 2.0 / 3;  // part of a period between two wires
constexpr double kGrainPx = 4;
constexpr double kSpotPx = 3;
constexpr double kSpotSpacingPx = 36;
constexpr double kSpotDisplacement = 0.2;  // of the spacing, along each axis
// The largest leaf, as a fraction of the field.
constexpr double kLargestLeaf = 1.0 / 6;

// Maximum number of samples per side; more would need too much memory and time for a sweep (a tile
// of 4096 x 4096 has 128 MiB). If a sweep requires more, because its field is large or its nearest
// and farthest depth differ much, the spacing of the samples is larger, and the near frames lack
// the finest detail.
constexpr int kMaxSamples = 4096;

double FeatureSizeMm(const TargetOptions& options, double chosen_mm, double smallest_mm,
                     double largest_mm) {
  if (!(options.feature_size_mm > 0)) return std::max(chosen_mm, smallest_mm);
  const double size_mm = options.feature_size_mm;
  if (!(size_mm >= smallest_mm && size_mm <= largest_mm)) {
    throw Error(
        fmt::format("target.feature_size_mm is {}: in this field of view it must be between {:.4g} "
                    "and {:.4g}, or 0 for a size chosen by the program",
                    size_mm, smallest_mm, largest_mm));
  }
  return size_mm;
}

// The tile that is drawn and the positions of its samples.
class Canvas {
 public:
  // The sides of the period are whole multiples of `unit_mm`; if it is 0, they have any length.
  Canvas(const TileRequest& request, double unit_mm) {
    const auto rounded_up = [unit_mm](double length_mm) {
      return unit_mm > 0 ? unit_mm * std::ceil(length_mm / unit_mm) : length_mm;
    };
    tile_.width_mm = rounded_up(request.width_mm);
    tile_.height_mm = rounded_up(request.height_mm);
    const double spacing_mm =
        std::max(request.spacing_mm, std::max(tile_.width_mm, tile_.height_mm) / kMaxSamples);
    const auto count = [spacing_mm](double length_mm) {
      const int needed = static_cast<int>(std::ceil(length_mm / spacing_mm * (1 - 1e-12)));
      return std::min(cv::getOptimalDFTSize(std::max(needed, 4)), kMaxSamples);
    };
    const int columns = count(tile_.width_mm);
    const int rows = count(tile_.height_mm);
    if (!(unit_mm > 0)) {  // counts for a fast DFT may widen the tile
      tile_.width_mm = columns * spacing_mm;
      tile_.height_mm = rows * spacing_mm;
    }
    tile_.origin_mm = request.centre_mm - Eigen::Vector2d(tile_.width_mm, tile_.height_mm) / 2;
    tile_.samples = cv::Mat(rows, columns, CV_64F, cv::Scalar(1));
    spacing_x_mm_ = tile_.width_mm / columns;
    spacing_y_mm_ = tile_.height_mm / rows;
  }

  // Sets every sample to draw(X, Y), mm from the tile's centre.
  template <typename Draw>
  void Fill(const Draw& draw) {
    for (int i = 0; i < tile_.samples.rows; ++i) {
      double* row = tile_.samples.ptr<double>(i);
      for (int j = 0; j < tile_.samples.cols; ++j) {
        row[j] =
            draw(j * spacing_x_mm_ - tile_.width_mm / 2, i * spacing_y_mm_ - tile_.height_mm / 2);
      }
    }
  }

  cv::Mat& samples() { return tile_.samples; }
  double spacing_x_mm() const { return spacing_x_mm_; }
  double spacing_y_mm() const { return spacing_y_mm_; }
  double width_mm() const { return tile_.width_mm; }
  double height_mm() const { return tile_.height_mm; }

  TargetTile Finish() {
    tile_.samples /= cv::mean(tile_.samples)[0];
    return tile_;
  }

 private:
  TargetTile tile_;
  double spacing_x_mm_;
  double spacing_y_mm_;
};

// Discs that occlude each other, with radii distributed as r^-3 between the smallest and the
// largest: the statistics of natural images, without a preferred size. They are drawn from the
// front backward until nothing shines through, so that the first leaves that cover a sample
// determine it.
TargetTile DrawDeadLeaves(const TargetOptions& options, const TileRequest& request,
                          RandomDraws* draws) {
  Canvas canvas(request, 0);
  const double spacing_mm = canvas.spacing_x_mm();  // equal in y because the sides are free
  const double smallest_mm =
      FeatureSizeMm(options, kLeafRadiusPx * request.pixel_mm, 2 * spacing_mm, request.field_mm);
  const double largest_mm = std::max(kLargestLeaf * request.field_mm, 2 * smallest_mm);
  const double small_term = 1 / (smallest_mm * smallest_mm);
  const double large_term = 1 / (largest_mm * largest_mm);

  cv::Mat& samples = canvas.samples();
  samples.setTo(0);
  cv::Mat open(samples.size(), CV_64F, cv::Scalar(1));  // transmitted part of each sample
  const int columns = samples.cols;
  const int rows = samples.rows;
  const double total = static_cast<double>(columns) * rows;
  double remaining = total;
  while (remaining > 1e-4 * total) {
    ThrowIfCancelled();
    const double radius =
        1 / std::sqrt(small_term - draws->Uniform() * (small_term - large_term)) / spacing_mm;
    const double x = draws->Uniform() * columns;
    const double y = draws->Uniform() * rows;
    const double grey = 1 + options.contrast * (2 * draws->Uniform() - 1);
    const int reach = static_cast<int>(std::ceil(radius + 1));
    const int centre_y = static_cast<int>(y);
    for (int i = centre_y - reach; i <= centre_y + reach; ++i) {
      const int row = (i % rows + rows) % rows;
      double* light = samples.ptr<double>(row);
      double* through = open.ptr<double>(row);
      const double dy = i - y;
      const double half_chord_square = (radius + 0.5) * (radius + 0.5) - dy * dy;
      if (!(half_chord_square > 0)) continue;
      const double half_chord = std::sqrt(half_chord_square);
      const int last = static_cast<int>(std::floor(x + half_chord));
      for (int j = static_cast<int>(std::ceil(x - half_chord)); j <= last; ++j) {
        const int column = (j % columns + columns) % columns;
        if (through[column] == 0) continue;
        // The covered part of the sample's cell, with the leaf's border assumed to be straight.
        const double inside = radius + 0.5 - std::hypot(j - x, dy);
        const double hidden = through[column] * std::clamp(inside, 0.0, 1.0);
        light[column] += hidden * grey;
        through[column] -= hidden;
        remaining -= hidden;
      }
    }
  }
  samples += open;
  return canvas.Finish();
}

// Gaussian noise up to the shortest period. Its amplitude decreases as 1/f (pink, from one cycle
// per field on) or is constant (white). A tanh limits it to the range from 0 to twice the mean.
TargetTile DrawNoise(const TargetOptions& options, const TileRequest& request, RandomDraws* draws) {
  Canvas canvas(request, 0);
  const double spacing_mm = canvas.spacing_x_mm();
  const double period_mm =
      FeatureSizeMm(options, kNoisePeriodPx * request.pixel_mm, 2 * spacing_mm, request.field_mm);
  cv::Mat& samples = canvas.samples();
  canvas.Fill([draws](double, double) { return draws->Normal(); });
  cv::Mat spectrum;
  cv::dft(samples, spectrum, cv::DFT_COMPLEX_OUTPUT);
  for (int i = 0; i < spectrum.rows; ++i) {
    ThrowIfCancelled();
    auto* row = spectrum.ptr<std::complex<double>>(i);
    const double fy = std::min(i, spectrum.rows - i) / canvas.height_mm();
    for (int j = 0; j < spectrum.cols; ++j) {
      const double fx = std::min(j, spectrum.cols - j) / canvas.width_mm();
      const double f = std::hypot(fx, fy);
      double amplitude = f > 0 && f * period_mm <= 1 ? 1 : 0;
      if (options.kind == TargetKind::kPinkNoise) amplitude /= std::max(f, 1 / request.field_mm);
      row[j] *= amplitude;
    }
  }
  cv::dft(spectrum, samples, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  const double rms =
      std::sqrt(samples.dot(samples) / (static_cast<double>(samples.rows) * samples.cols));
  for (int i = 0; i < samples.rows; ++i) {
    ThrowIfCancelled();
    double* row = samples.ptr<double>(i);
    for (int j = 0; j < samples.cols; ++j) {
      row[j] = 1 + std::tanh(options.contrast / 2 * row[j] / rms);
    }
  }
  return canvas.Finish();
}

TargetTile DrawCheckerboard(const TargetOptions& options, const TileRequest& request) {
  const double square_mm =
      FeatureSizeMm(options, kSquarePx * request.pixel_mm, request.pixel_mm, request.field_mm);
  Canvas canvas(request, 2 * square_mm);
  canvas.Fill([&](double x, double y) {
    return 1 + options.contrast * SquareWaveMean(x, 2 * square_mm, canvas.spacing_x_mm()) *
                   SquareWaveMean(y, 2 * square_mm, canvas.spacing_y_mm());
  });
  return canvas.Finish();
}

// Bright and dark sectors around the field's centre. The feature size is a sector's width at half
// the field's shorter side from the centre. Each sample is the mean over its cell along its circle.
TargetTile DrawSiemensStar(const TargetOptions& options, const TileRequest& request) {
  const double rim_mm = request.field_mm / 2;
  const double sector_mm =
      FeatureSizeMm(options, kPi * rim_mm / kStarCycles, request.pixel_mm, rim_mm);
  const double cycles = std::max(1.0, std::round(kPi * rim_mm / sector_mm));
  Canvas canvas(request, 0);
  canvas.Fill([&](double x, double y) {
    return 1 + options.contrast * StarMean(x, y, cycles, canvas.spacing_x_mm());
  });
  return canvas.Finish();
}

// Mean over [x - width/2, x + width/2] of the openings between wires: 1 in the first part of each
// period, 0 in the rest.
double OpeningMean(double x, double period, double width) {
  const auto opened = [period](double to) {
    const double periods = std::floor(to / period);
    return kMeshOpening * period * periods + std::min(to - period * periods, kMeshOpening * period);
  };
  return (opened(x + width / 2) - opened(x - width / 2)) / width;
}

// Wires of a third of a period, which cross.
TargetTile DrawMesh(const TargetOptions& options, const TileRequest& request) {
  const double period_mm = FeatureSizeMm(options, kMeshPeriodPx * request.pixel_mm,
                                         2 * request.pixel_mm, request.field_mm);
  Canvas canvas(request, period_mm);
  canvas.Fill([&](double x, double y) {
    return 1 + options.contrast * (2 * OpeningMean(x, period_mm, canvas.spacing_x_mm()) *
                                       OpeningMean(y, period_mm, canvas.spacing_y_mm()) -
                                   1);
  });
  return canvas.Finish();
}

// Speckle, |u|^2 with the mean 1, where u is complex Gaussian noise up to half a cycle per grain,
// so that the light has frequencies up to one. Its distribution is exponential; `contrast` is its
// relative standard deviation.
TargetTile DrawGroundGlass(const TargetOptions& options, const TileRequest& request,
                           RandomDraws* draws) {
  Canvas canvas(request, 0);
  const double grain_mm = FeatureSizeMm(options, kGrainPx * request.pixel_mm,
                                        2 * canvas.spacing_x_mm(), request.field_mm);
  cv::Mat& samples = canvas.samples();
  cv::Mat wave(samples.size(), CV_64FC2, cv::Scalar::all(0));
  for (int i = 0; i < wave.rows; ++i) {
    ThrowIfCancelled();
    auto* row = wave.ptr<cv::Vec2d>(i);
    const double fy = std::min(i, wave.rows - i) / canvas.height_mm();
    for (int j = 0; j < wave.cols; ++j) {
      const double fx = std::min(j, wave.cols - j) / canvas.width_mm();
      if (2 * grain_mm * std::hypot(fx, fy) <= 1) row[j] = {draws->Normal(), draws->Normal()};
    }
  }
  cv::dft(wave, wave, cv::DFT_INVERSE);
  for (int i = 0; i < samples.rows; ++i) {
    for (int j = 0; j < samples.cols; ++j) {
      const cv::Vec2d& u = wave.at<cv::Vec2d>(i, j);
      samples.at<double>(i, j) = u.dot(u);
    }
  }
  samples = 1 + options.contrast * (samples / cv::mean(samples)[0] - 1);
  return canvas.Finish();
}

// Discs near the points of a square grid, bright ones on a dark ground or dark ones on a bright
// one.
TargetTile DrawPoints(const TargetOptions& options, const TileRequest& request,
                      RandomDraws* draws) {
  const double diameter_mm =
      FeatureSizeMm(options, kSpotPx * request.pixel_mm, request.pixel_mm, request.field_mm);
  const double spacing_mm =
      options.spacing_mm > 0 ? options.spacing_mm : kSpotSpacingPx * request.pixel_mm;
  if (!(spacing_mm >= 2 * diameter_mm && spacing_mm <= request.field_mm)) {
    throw Error(
        fmt::format("target.spacing_mm is {:.4g}: it must be from {:.4g}, twice the "
                    "diameter of the points, to {:.4g}, the field of view",
                    spacing_mm, 2 * diameter_mm, request.field_mm));
  }
  Canvas canvas(request, spacing_mm);
  const int columns = static_cast<int>(std::lround(canvas.width_mm() / spacing_mm));
  const int rows = static_cast<int>(std::lround(canvas.height_mm() / spacing_mm));
  std::vector<cv::Point2d> displacements_mm;
  for (int i = 0; i < rows * columns; ++i) {
    const double x_mm = (2 * draws->Uniform() - 1) * kSpotDisplacement * spacing_mm;
    displacements_mm.emplace_back(x_mm,
                                  (2 * draws->Uniform() - 1) * kSpotDisplacement * spacing_mm);
  }
  const double sign = options.kind == TargetKind::kPinholes ? 1 : -1;
  constexpr int kParts = 5;  // a cell is sampled so many times along each axis
  canvas.Fill([&](double x_mm, double y_mm) {
    const double x = x_mm + canvas.width_mm() / 2, y = y_mm + canvas.height_mm() / 2;
    const int column = std::min(static_cast<int>(x / spacing_mm), columns - 1);
    const int row = std::min(static_cast<int>(y / spacing_mm), rows - 1);
    const cv::Point2d& beside_mm =
        displacements_mm[static_cast<std::size_t>(row * columns + column)];
    const double dx = x - (column + 0.5) * spacing_mm - beside_mm.x;
    const double dy = y - (row + 0.5) * spacing_mm - beside_mm.y;
    if (std::hypot(dx, dy) > diameter_mm) return 1 - sign * options.contrast;
    int inside = 0;
    for (int i = 0; i < kParts * kParts; ++i) {
      const double cell_x = ((i % kParts + 0.5) / kParts - 0.5) * canvas.spacing_x_mm();
      const double cell_y = ((i / kParts + 0.5) / kParts - 0.5) * canvas.spacing_y_mm();
      inside += std::hypot(dx + cell_x, dy + cell_y) <= diameter_mm / 2 ? 1 : 0;
    }
    return 1 + sign * options.contrast * (2.0 * inside / (kParts * kParts) - 1);
  });
  return canvas.Finish();
}

// The user's image, upright and centred, mirrored at its sides where the tile is larger. Its width
// is the feature size or, by default, such that it covers all that the frames see. The contrast is
// its own.
TargetTile DrawImage(const TargetOptions& options, const TileRequest& request,
                     const LinearImage& image) {
  if (image.width_px < 1 || image.height_px < 1) {
    throw Error(fmt::format("target.image '{}' is empty", options.image_path));
  }
  const LinearImage grey = ToGrey(image);
  cv::Mat source(grey.height_px, grey.width_px, CV_32F);
  std::copy(grey.values.begin(), grey.values.end(), source.ptr<float>());

  Canvas canvas(request, 0);
  const double shape = static_cast<double>(grey.height_px) / grey.width_px;
  const double width_mm =
      FeatureSizeMm(options, std::max(canvas.width_mm(), canvas.height_mm() / shape),
                    16 * request.pixel_mm, 4 * canvas.width_mm());
  const cv::Size size(
      std::max(1, static_cast<int>(std::lround(width_mm / canvas.spacing_x_mm()))),
      std::max(1, static_cast<int>(std::lround(width_mm * shape / canvas.spacing_y_mm()))));
  cv::Mat resized;
  cv::resize(source, resized, size, 0, 0,
             size.width < source.cols ? cv::INTER_AREA : cv::INTER_CUBIC);
  cv::Mat& samples = canvas.samples();
  for (int i = 0; i < samples.rows; ++i) {
    ThrowIfCancelled();
    const int row = cv::borderInterpolate(i - samples.rows / 2 + size.height / 2, size.height,
                                          cv::BORDER_REFLECT);
    for (int j = 0; j < samples.cols; ++j) {
      const int column = cv::borderInterpolate(j - samples.cols / 2 + size.width / 2, size.width,
                                               cv::BORDER_REFLECT);
      samples.at<double>(i, j) = std::max(0.0f, resized.at<float>(row, column));
    }
  }
  if (!(cv::mean(samples)[0] > 0)) {
    throw Error(fmt::format("target.image '{}' is black: some of its values must be > 0",
                            options.image_path));
  }
  return canvas.Finish();
}

// The part of the interval [from, to] that lies in [first, last].
double PartWithin(double from, double to, double first, double last) {
  return std::max(0.0, std::min(to, last) - std::max(from, first)) / (to - from);
}

// The grid once, in the middle of the tile, black on white. Each sample is the mean over its cell;
// the border of a disc is taken for straight within a cell.
TargetTile DrawGrid(const TargetOptions& options, const TileRequest& asked) {
  const TargetGrid& grid = *options.grid;
  const Eigen::Vector2d size_mm = grid.SizeMm();
  TileRequest request = asked;
  // White paper around it: a tile is repeated.
  request.width_mm = std::max(asked.width_mm, size_mm.x() + 2 * grid.square_mm);
  request.height_mm = std::max(asked.height_mm, size_mm.y() + 2 * grid.square_mm);
  Canvas canvas(request, 0);
  const double step_x = canvas.spacing_x_mm(), step_y = canvas.spacing_y_mm();
  if (!(grid.square_mm >= 4 * std::max(step_x, step_y))) {
    throw Error(fmt::format(
        "target.grid: squares of {} mm are below four samples of the field ({:.4g} mm): "
        "choose larger squares or a nearer target",
        grid.square_mm, 4 * std::max(step_x, step_y)));
  }
  cv::Mat& samples = canvas.samples();
  samples.setTo(1 + options.contrast);
  // The sample (i, j) is at (j step - width/2, i step - height/2) from the tile's centre.
  const double left_mm = 0.5 * canvas.width_mm() - 0.5 * size_mm.x();
  const double top_mm = 0.5 * canvas.height_mm() - 0.5 * size_mm.y();
  for (const GridShape& shape : BlackShapes(grid)) {
    ThrowIfCancelled();
    const double reach_x = shape.is_disc ? 0.5 * shape.width : 0;
    const double reach_y = shape.is_disc ? 0.5 * shape.height : 0;
    const double from_x = left_mm + shape.x - reach_x, to_x = from_x + shape.width;
    const double from_y = top_mm + shape.y - reach_y, to_y = from_y + shape.height;
    const int first_j = std::max(0, static_cast<int>(from_x / step_x - 1));
    const int last_j = std::min(samples.cols - 1, static_cast<int>(to_x / step_x + 2));
    const int first_i = std::max(0, static_cast<int>(from_y / step_y - 1));
    const int last_i = std::min(samples.rows - 1, static_cast<int>(to_y / step_y + 2));
    for (int i = first_i; i <= last_i; ++i) {
      auto* row = samples.ptr<double>(i);
      const double y = i * step_y;
      for (int j = first_j; j <= last_j; ++j) {
        const double x = j * step_x;
        const double covered =
            shape.is_disc ? std::clamp((0.5 * shape.width -
                                        std::hypot(x - left_mm - shape.x, y - top_mm - shape.y)) /
                                               std::sqrt(step_x * step_y) +
                                           0.5,
                                       0.0, 1.0)
                          : PartWithin(x - 0.5 * step_x, x + 0.5 * step_x, from_x, to_x) *
                                PartWithin(y - 0.5 * step_y, y + 0.5 * step_y, from_y, to_y);
        row[j] -= 2 * options.contrast * covered;
      }
    }
  }
  return canvas.Finish();
}

}  // namespace

TargetTile DrawTargetTile(const TargetOptions& options, const TileRequest& request,
                          const LinearImage& image, RandomDraws* draws) {
  switch (options.kind) {
    case TargetKind::kDeadLeaves:
      return DrawDeadLeaves(options, request, draws);
    case TargetKind::kPinkNoise:
    case TargetKind::kWhiteNoise:
      return DrawNoise(options, request, draws);
    case TargetKind::kCheckerboard:
      return DrawCheckerboard(options, request);
    case TargetKind::kSiemensStar:
      return DrawSiemensStar(options, request);
    case TargetKind::kMesh:
      return DrawMesh(options, request);
    case TargetKind::kGroundGlass:
      return DrawGroundGlass(options, request, draws);
    case TargetKind::kPinholes:
    case TargetKind::kBeads:
      return DrawPoints(options, request, draws);
    case TargetKind::kImage:
      return DrawImage(options, request, image);
    case TargetKind::kGrid:
      return DrawGrid(options, request);
    case TargetKind::kPrintedEdge:
    case TargetKind::kKnifeEdge:
      break;
  }
  throw Error("an edge is drawn in closed form, not as a tile");
}

}  // namespace thicklens::model
