#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "kernels/opencl/backend_self_test.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {
namespace {

constexpr int kWidth = 29, kHeight = 13;

// Flat, rough and steep surfaces side by side.
std::vector<float> Surfaces(PortableRng* numbers) {
  std::vector<float> disparity;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double rough = x > 18 ? numbers->Between(-0.4, 0.4) : 0;
      disparity.push_back(static_cast<float>((x > 9 ? 1 : -0.5) + 0.05 * y + rough));
    }
  }
  return disparity;
}

}  // namespace

void CompareWarp(Backend* device, MaxError* worst) {
  PortableRng numbers;
  const std::vector<float> disparity = Surfaces(&numbers);
  for (const int channels : {1, 3, 6}) {
    const auto values = numbers.Vector<float>(kWidth * kHeight * channels, 0, 1);
    const SurfaceImage image{kWidth, kHeight, channels, &values, &disparity, 0.3F};
    const std::unique_ptr<ViewWarp> found = device->NewWarp(image);
    const std::unique_ptr<ViewWarp> right = NewReferenceWarp(image);
    for (const double reach : {0.0, 2.5, 500.0}) {
      const auto source_x = numbers.Vector<float>(kWidth * kHeight, -reach, reach);
      const auto source_y = numbers.Vector<float>(kWidth * kHeight, -reach, reach);
      const auto of_view = numbers.Vector<float>(kWidth * kHeight, -0.6, 1.7);
      // The shifts are rounded to float, so that rounding cannot move a sample to another pixel.
      const double shift_x = numbers.Between(-reach, reach),
                   shift_y = numbers.Between(-reach, reach);
      for (const std::vector<float>* surface : {&disparity, &of_view}) {
        std::vector<float> seen = *surface;
        std::vector<OccludedSample> occluded;
        for (std::size_t i = 0; i < seen.size(); i += 3) {
          occluded.push_back({static_cast<std::int32_t>(i), source_x[i], source_y[i], seen[i]});
          if (i % 2 == 0) occluded.back().source_x = 1;
          seen[i] = std::numeric_limits<float>::quiet_NaN();
        }
        std::vector<BoundarySample> boundary;
        for (std::size_t i = 1; i < seen.size(); i += 4) {
          boundary.push_back({static_cast<std::int32_t>(i),
                              {0, source_x[i], source_y[i], (*surface)[i]},
                              static_cast<float>(numbers.Between(0, 1))});
        }
        const ViewSources view{&seen, static_cast<float>(shift_x), static_cast<float>(shift_y),
                               &occluded, &boundary};
        std::vector<float> of_device, of_reference;
        found->Warp(view, &of_device);
        right->Warp(view, &of_reference);
        worst->Add("WarpView", Difference(of_device, of_reference));
      }
    }
  }
}

}  // namespace thicklens::kernels
