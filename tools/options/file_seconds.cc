#include "tools/options/file_seconds.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>

#include "thicklens/base/stopwatch.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/quantised_levels.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// The part of a view is the photograph half a pixel farther to the right, because views lie between
// the photograph's pixels.
double FileSeconds(const estimator::EstimateInput& input) {
  constexpr double kMaxPixels = 1 << 16;
  constexpr int kRuns = 3, kBits = 16;
  const model::LinearImage& image = input.image;
  // Others have no such files, and the model of the time does not know theirs.
  if (image.channels != 1 && image.channels != 3) return 0;
  const int rows = std::clamp(static_cast<int>(kMaxPixels / image.width_px), 1, image.height_px);
  model::LinearImage part =
      model::CropImage(image, {0, (image.height_px - rows) / 2, image.width_px, rows});
  const auto channels = static_cast<std::size_t>(part.channels);
  for (std::size_t i = 0; i + channels < part.values.size(); ++i) {
    part.values[i] = (part.values[i] + part.values[i + channels]) / 2;
  }
  const model::QuantisedLevels levels(input.transfer, kBits);
  double best = 0;
  for (int run = 0; run < kRuns; ++run) {
    const auto start = Clock::now();
    const std::string file = io::EncodePng(model::ToEncoded(part, levels));
    const std::chrono::duration<double> seconds = Clock::now() - start;
    best = run == 0 ? seconds.count() : std::min(best, seconds.count());
  }
  return best * image.height_px / rows * static_cast<double>(input.weights.size());
}

estimator::Workload MeasuredWorkload(const estimator::EstimateInput& input) {
  return estimator::WorkloadOf(input, FileSeconds(input));
}

}  // namespace thicklens::tools
