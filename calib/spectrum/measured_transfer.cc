// The transfer function of each frame as a fit of relative blur has measured it, ring by ring.
#include <algorithm>
#include <cmath>
#include <complex>

#include "calib/spectrum/relative_spectrum.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr int kPlottedRings = 16;

}  // namespace

std::vector<TransferRing> MeasuredTransfer(const SpectrumSample& sample, const RelativeBlur& fit,
                                           std::size_t index, double reference_variance_px2,
                                           const TargetWindow& window,
                                           const std::vector<Mode>& modes,
                                           const WindowLeakage& leakage) {
  const auto i = static_cast<Eigen::Index>(index);
  const auto count = std::min<Eigen::Index>(fit.modes_used[index], fit.texture.size());
  const Eigen::ArrayXcd data =
      sample.spectrum.values.head(count) -
      leakage.At(fit.variances_px2[i] - reference_variance_px2, static_cast<std::size_t>(count));
  std::vector<TransferRing> rings;
  Eigen::Index k = 0;
  for (int ring = 1; ring <= kPlottedRings; ++ring) {
    const Eigen::Index end = count * ring / kPlottedRings;
    double product = 0, power = 0, nu_sum = 0;
    const Eigen::Index first = k;
    for (; k < end; ++k) {
      const Eigen::Vector2d nu = ModeFrequency(modes[static_cast<std::size_t>(k)], window);
      const double phase = 2 * kPi * nu.dot(fit.shifts_px.col(i));
      product += (data[k] * std::conj(fit.texture[k]) * std::polar(1.0, phase)).real();
      power += std::norm(fit.texture[k]);
      nu_sum += nu.norm();
    }
    if (k == first || !(power > 0)) continue;
    rings.push_back({nu_sum / static_cast<double>(k - first), product / (power * fit.gains[i])});
  }
  return rings;
}
}  // namespace thicklens::calib
