// The selection of the modes that are worth using in a fit of relative blur.
#include <algorithm>
#include <cmath>

#include "calib/spectrum/relative_spectrum.h"

namespace thicklens::calib {
namespace {

constexpr int kRings = 24;

}  // namespace

std::vector<Mode> StrongestModes(const std::vector<Mode>& modes, const Eigen::ArrayXd& power,
                                 const TargetWindow& window, double least_power,
                                 int most_per_ring) {
  if (modes.empty()) return {};
  const double first = std::log(ModeFrequency(modes.front(), window).norm());
  const double last = std::log(ModeFrequency(modes.back(), window).norm());
  std::vector<std::vector<std::size_t>> rings(kRings);
  for (std::size_t k = 0; k < modes.size(); ++k) {
    if (!(power[static_cast<Eigen::Index>(k)] > least_power)) continue;
    const double part =
        (std::log(ModeFrequency(modes[k], window).norm()) - first) / std::max(last - first, 1e-9);
    rings[static_cast<std::size_t>(std::clamp(part * kRings, 0.0, kRings - 1.0))].push_back(k);
  }
  std::vector<std::size_t> kept;
  for (std::vector<std::size_t>& ring : rings) {
    std::stable_sort(ring.begin(), ring.end(), [&](std::size_t a, std::size_t b) {
      return power[static_cast<Eigen::Index>(a)] > power[static_cast<Eigen::Index>(b)];
    });
    if (ring.size() > static_cast<std::size_t>(most_per_ring))
      ring.resize(static_cast<std::size_t>(most_per_ring));
    kept.insert(kept.end(), ring.begin(), ring.end());
  }
  std::sort(kept.begin(), kept.end());
  std::vector<Mode> strongest;
  strongest.reserve(kept.size());
  for (const std::size_t k : kept) strongest.push_back(modes[k]);
  return strongest;
}
}  // namespace thicklens::calib
