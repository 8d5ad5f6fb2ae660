#include "estimator/scene/jpeg_blocks.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

constexpr int kBlock = 8, kGrids = kBlock * kBlock;
constexpr double kManyBlocks = 400;
// Frequencies from here on, sum of both indices, and the largest coefficient that is 0 but for the
// rounding of pixels, grey levels.
constexpr int kHighFrequency = 6;
constexpr double kZeroLevels = 0.5;
// Files had 0.03 and more, images without compression up to 0.006.
constexpr double kMoreZeros = 0.02;

using Block = Eigen::Matrix<double, kBlock, kBlock>;

Block CosineTransform() {
  constexpr double kPi = 3.14159265358979323846;
  Block matrix;
  for (int k = 0; k < kBlock; ++k) {
    for (int n = 0; n < kBlock; ++n) {
      matrix(k, n) =
          std::sqrt((k == 0 ? 1.0 : 2.0) / kBlock) * std::cos(kPi * (2 * n + 1) * k / (2 * kBlock));
    }
  }
  return matrix;
}

}  // namespace

bool ShowsJpegBlocks(const model::LinearImage& image, const model::TransferCurve& transfer) {
  constexpr int kMinPx = 4 * kBlock;
  if (std::min(image.width_px, image.height_px) < kMinPx) return false;
  const auto luminance = [&](int x, int y) {
    const auto level = [&](int channel) {
      return 255 * transfer.Encode(std::max(0.0, static_cast<double>(image.at(x, y, channel))));
    };
    return image.channels < 3 ? level(0) : 0.299 * level(0) + 0.587 * level(1) + 0.114 * level(2);
  };
  const double blocks = image.width_px / kBlock * 1.0 * (image.height_px / kBlock);
  const int stride = kBlock * std::max(1, static_cast<int>(std::sqrt(blocks / kManyBlocks)));
  const Block cosines = CosineTransform();
  std::array<double, kGrids> zeros{};
  double counted = 0;
  Eigen::Matrix<double, 2 * kBlock, 2 * kBlock> window;
  for (int y = 0; y + 2 * kBlock <= image.height_px; y += stride) {
    ThrowIfCancelled();
    for (int x = 0; x + 2 * kBlock <= image.width_px; x += stride) {
      for (int j = 0; j < 2 * kBlock; ++j) {
        for (int i = 0; i < 2 * kBlock; ++i) window(j, i) = luminance(x + i, y + j);
      }
      for (int grid = 0; grid < kGrids; ++grid) {
        const Block coefficients = cosines *
                                   window.block<kBlock, kBlock>(grid / kBlock, grid % kBlock) *
                                   cosines.transpose();
        for (int k = 0; k < kBlock; ++k) {
          for (int l = std::max(0, kHighFrequency - k); l < kBlock; ++l) {
            zeros[Index(grid)] += std::abs(coefficients(k, l)) < kZeroLevels ? 1 : 0;
            if (grid == 0) counted += 1;
          }
        }
      }
    }
  }
  std::partial_sort(zeros.begin(), zeros.begin() + 2, zeros.end(), std::greater<>());
  return zeros[0] - zeros[1] > kMoreZeros * counted;
}

}  // namespace thicklens::estimator
