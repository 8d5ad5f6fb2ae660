#include "tools/options/picture_load.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <string>

#include "thicklens/base/stopwatch.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/stored_levels.h"

namespace thicklens::tools {
namespace {

// Returns the variance of the views' places along one axis, in view steps squared.
double VarianceOf(const Eigen::ArrayXd& weights) {
  const Eigen::ArrayXd places =
      Eigen::ArrayXd::LinSpaced(weights.size(), 0, static_cast<double>(weights.size() - 1));
  const double mean = (weights * places).sum();
  return (weights * (places - mean).square()).sum();
}

// Returns the seconds for the files of all views. They are extrapolated from a part of one view,
// for which the photograph is shifted by half a pixel, because views lie between the photograph's
// pixels.
double FileSeconds(const estimator::EstimateInput& input) {
  constexpr double kMostPixels = 1 << 16;
  constexpr int kRuns = 3, kBits = 16;
  const model::LinearPicture& picture = input.picture;
  // Pictures with other channels have no such files, and the model of the time does not cover them.
  if (picture.channels != 1 && picture.channels != 3) return 0;
  const int rows =
      std::clamp(static_cast<int>(kMostPixels / picture.width_px), 1, picture.height_px);
  model::LinearPicture part =
      model::CropPicture(picture, {0, (picture.height_px - rows) / 2, picture.width_px, rows});
  const auto channels = static_cast<std::size_t>(part.channels);
  for (std::size_t i = 0; i + channels < part.values.size(); ++i) {
    part.values[i] = (part.values[i] + part.values[i + channels]) / 2;
  }
  const model::StoredLevels levels(input.transfer, kBits);
  double best = 0;
  for (int run = 0; run < kRuns; ++run) {
    const auto start = Clock::now();
    const std::string file = io::EncodePng(model::ToStored(part, levels));
    const std::chrono::duration<double> seconds = Clock::now() - start;
    best = run == 0 ? seconds.count() : std::min(best, seconds.count());
  }
  return best * picture.height_px / rows * static_cast<double>(input.weights.size());
}

}  // namespace

PictureLoad PictureLoadOf(const estimator::EstimateInput& input) {
  const estimator::DisparityMap& map = input.disparity;
  double square_sum = 0;
  for (const float disparity : map.disparity) {
    square_sum += static_cast<double>(disparity) * static_cast<double>(disparity);
  }
  const auto pixels = static_cast<double>(map.disparity.size());
  // A point lands in the view (a, b) at its disparity times the view's place; the weights of the
  // views determine its spread in x and in y.
  const double spread_x = VarianceOf(input.weights.colwise().sum().transpose());
  const double spread_y = VarianceOf(input.weights.rowwise().sum());
  const double per_disparity =
      (map.step.x() * map.step.x() * spread_x + map.step.y() * map.step.y() * spread_y) / 2;
  PictureLoad load;
  load.megapixels = 1e-6 * pixels;
  load.channels = input.picture.channels;
  load.views = static_cast<int>(input.weights.size());
  load.blur_sigma_px = std::sqrt(square_sum / pixels * per_disparity);
  load.file_seconds = FileSeconds(input);
  return load;
}

}  // namespace thicklens::tools
