#include "thicklens/model/image_change.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thicklens::model {
namespace {

// Rms of the slopes, in full scale per px, that the rounding of a flat image causes.
constexpr double kFlat = 1e-4;

}  // namespace

double ImageChangeAccumulator::Add(const EncodedValues& reference, const EncodedValues& other) {
  double squares = 0;
  for (std::size_t i = 0; i < reference.values.size(); ++i) {
    const double difference = static_cast<double>(other.values[i]) - reference.values[i];
    squares += difference * difference;
    largest_ = std::max(largest_, std::abs(difference));
  }
  squares_ += squares;
  count_ += reference.values.size();

  // Central differences along both axes.
  const auto channels = static_cast<std::size_t>(reference.channels);
  const auto row = static_cast<std::size_t>(reference.width_px) * channels;
  const auto square_of = [&](std::size_t at, std::size_t step) {
    const double slope =
        (static_cast<double>(reference.values[at + step]) - reference.values[at - step]) / 2;
    return slope * slope;
  };
  for (int y = 1; y + 1 < reference.height_px; ++y) {
    const std::size_t start = static_cast<std::size_t>(y) * row;
    for (std::size_t i = channels; i + channels < row; ++i) {
      slope_squares_ += square_of(start + i, channels) + square_of(start + i, row);
      slopes_ += 2;
    }
  }
  return 255 * std::sqrt(squares / static_cast<double>(reference.values.size()));
}

void ImageChangeAccumulator::Add(const ImageChangeAccumulator& other) {
  squares_ += other.squares_;
  largest_ = std::max(largest_, other.largest_);
  slope_squares_ += other.slope_squares_;
  count_ += other.count_;
  slopes_ += other.slopes_;
}

ImageChange ImageChangeAccumulator::Result() const {
  ImageChange change;
  const double mean_square = count_ > 0 ? squares_ / static_cast<double>(count_) : 0;
  change.rms_grey_levels = 255 * std::sqrt(mean_square);
  change.largest_grey_levels = 255 * largest_;
  change.psnr_db = -10 * std::log10(mean_square);
  const double slope = slopes_ > 0 ? std::sqrt(slope_squares_ / static_cast<double>(slopes_)) : 0;
  change.as_shift_px =
      slope > kFlat ? std::sqrt(mean_square) / slope : std::numeric_limits<double>::quiet_NaN();
  return change;
}

std::vector<float> GreyLevelDifference(const EncodedValues& reference, const EncodedValues& other) {
  const auto channels = static_cast<std::size_t>(reference.channels);
  std::vector<float> difference(reference.values.size() / channels);
  for (std::size_t i = 0; i < reference.values.size(); ++i) {
    difference[i / channels] +=
        255 * (other.values[i] - reference.values[i]) / static_cast<float>(reference.channels);
  }
  return difference;
}

}  // namespace thicklens::model
