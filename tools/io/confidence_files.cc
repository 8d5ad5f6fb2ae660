#include "thicklens/io/confidence_files.h"

#include <cstddef>

#include "thicklens/base/cancel.h"

namespace thicklens::io {

void WriteConfidence(const std::vector<estimator::Confidence>& of_rays, int u_count, int width_px,
                     int height_px, LightFieldWriter* writer) {
  const auto pixels = static_cast<std::ptrdiff_t>(width_px) * height_px;
  const auto views = static_cast<int>(static_cast<std::ptrdiff_t>(of_rays.size()) / pixels);
  for (int i = 0; i < views; ++i) {
    ThrowIfCancelled();
    const auto first = of_rays.begin() + i * pixels;
    writer->WriteConfidence(i % u_count, i / u_count, {first, first + pixels}, width_px);
  }
}

}  // namespace thicklens::io
