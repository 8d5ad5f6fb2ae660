#include "calib/response/response_sums.h"

#include <cmath>

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinParts = 4, kMinFrames = 3;

}  // namespace

void ResponseSums::Add(int part, std::size_t frame, double product, double square) {
  for (Sums* sums : {&parts_[part], &frames_[frame]}) {
    sums->first += product;
    sums->second += square;
  }
}

std::optional<model::Estimate> ResponseSums::Slope() const {
  if (parts_.size() < kMinParts || frames_.size() < kMinFrames) return std::nullopt;
  double product = 0, square = 0;
  for (const auto& [part, sums] : parts_) {
    product += sums.first;
    square += sums.second;
  }
  if (!(square > 0)) return std::nullopt;
  const double slope = product / square;

  double mean = 0, spread = 0;
  for (const auto& [part, sums] : parts_) mean += (product - sums.first) / (square - sums.second);
  const auto count = static_cast<double>(parts_.size());
  mean /= count;
  for (const auto& [part, sums] : parts_)
    spread += std::pow((product - sums.first) / (square - sums.second) - mean, 2);
  const double of_parts = std::sqrt(spread * (count - 1) / count);

  double scatter = 0;
  for (const auto& [frame, sums] : frames_)
    scatter += std::pow(sums.first - slope * sums.second, 2);
  const auto frames = static_cast<double>(frames_.size());
  const double of_frames = std::sqrt(scatter * frames / (frames - 1)) / square;
  const model::Estimate found{slope, std::hypot(of_parts, of_frames)};
  if (!std::isfinite(found.value) || !std::isfinite(found.sigma)) return std::nullopt;
  return found;
}

}  // namespace thicklens::calib
