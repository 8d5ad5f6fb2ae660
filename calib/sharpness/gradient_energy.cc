#include "calib/sharpness/gradient_energy.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr double kSmoothingPx = 1;
// Parts of the range of the energies, and of the largest energy, by which the energy of the frame
// with the largest slope may be below the largest one. Neighbours of the plane of focus differ by
// less than the former, and frames without defocus by less than the latter.
constexpr double kPartOfRange = 0.3, kPartOfLargest = 0.05;

}  // namespace

double GradientEnergy(const cv::Mat& grey, double noise_sigma) {
  const double mean = cv::mean(grey)[0];
  if (!(mean > 0)) return 0;
  const cv::Mat magnitude = GradientMagnitude(Smoothed(grey, kSmoothingPx));
  constexpr double kVariancePx2 = kSmoothingPx * kSmoothingPx;
  const double of_noise =
      noise_sigma * noise_sigma * (1 - std::exp(-1 / kVariancePx2)) / (4 * kPi * kVariancePx2);
  const double squares = cv::norm(magnitude, cv::NORM_L2SQR) / static_cast<double>(grey.total());
  return (squares - of_noise) / (mean * mean);
}

std::size_t SharpestFrame(const std::vector<std::size_t>& frames, const std::vector<double>& slopes,
                          const std::vector<double>& energies) {
  const auto largest = [&frames](const std::vector<double>& values) {
    return *std::max_element(frames.begin(), frames.end(),
                             [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  };
  const std::size_t steepest = largest(slopes), strongest = largest(energies);
  double least = energies[strongest];
  for (const std::size_t frame : frames) least = std::min(least, energies[frame]);
  const double most = energies[strongest], missing = most - energies[steepest];
  const bool is_misled = missing > kPartOfRange * (most - least) && missing > kPartOfLargest * most;
  return is_misled ? strongest : steepest;
}

}  // namespace thicklens::calib
