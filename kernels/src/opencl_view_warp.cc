// Views on a device: warp.cl.
#include <algorithm>
#include <cstddef>
#include <utility>

#include "opencl_call.h"
#include "opencl_device.h"
#include "thicklens/kernels/view_warp.h"
#include "warp_arguments.h"

namespace thicklens::kernels {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

constexpr int kBefore = 1, kAfter = 2;  // pixels of a border that are repeated

// Surfaces in warp.cl.
struct SurfacesArgument {
  cl_int width_px, height_px, channels;
  cl_float tolerance, limit_px;
};

// The channels of a picture in planes with repeated borders.
std::vector<float> PlanesOf(const SurfacePicture& picture) {
  std::vector<float> planes;
  planes.reserve(Index(picture.width_px + kBefore + kAfter) *
                 Index(picture.height_px + kBefore + kAfter) * Index(picture.channels));
  for (int channel = 0; channel < picture.channels; ++channel) {
    for (int y = -kBefore; y < picture.height_px + kAfter; ++y) {
      const std::size_t row =
          Index(std::clamp(y, 0, picture.height_px - 1)) * Index(picture.width_px);
      for (int x = -kBefore; x < picture.width_px + kAfter; ++x) {
        const std::size_t pixel = row + Index(std::clamp(x, 0, picture.width_px - 1));
        planes.push_back((*picture.values)[pixel * Index(picture.channels) + Index(channel)]);
      }
    }
  }
  return planes;
}

DeviceMemory Copied(OpenClQueue* queue, const char* what, const std::vector<float>& numbers) {
  DeviceMemory memory(queue, what, numbers.size() * sizeof(float));
  memory.Write(numbers.data());
  return memory;
}

class OpenClWarp : public ViewWarp {
 public:
  OpenClWarp(std::unique_ptr<OpenClQueue> queue, const SurfacePicture& picture,
             const TapRanges& ranges, int lanes)
      : queue_(std::move(queue)),
        lanes_(lanes),
        picture_(picture),
        planes_(Copied(queue_.get(), "picture of surfaces", PlanesOf(picture))),
        disparity_(Copied(queue_.get(), "disparity of a picture", *picture.disparity)),
        lowest_(Copied(queue_.get(), "least disparities", ranges.lowest)),
        highest_(Copied(queue_.get(), "largest disparities", ranges.highest)) {}

  void Warp(const ViewSources& view, std::vector<float>* values) override {
    CheckView(picture_, view);
    const SurfacesArgument surfaces{picture_.width_px, picture_.height_px, picture_.channels,
                                    picture_.tolerance,
                                    static_cast<cl_float>(picture_.width_px + picture_.height_px)};
    values->resize(picture_.values->size());
    OpenClCall(queue_.get(), "WarpView")
        .Value(surfaces)
        .OnDevice(planes_)
        .OnDevice(disparity_)
        .OnDevice(lowest_)
        .OnDevice(highest_)
        .Input("disparity of a view", *view.disparity)
        .Input("sources of a view across", *view.source_x)
        .Input("sources of a view down", *view.source_y)
        .Output("view", values)
        .Run(Index((picture_.width_px + lanes_ - 1) / lanes_) * Index(picture_.height_px));
  }

 private:
  const std::unique_ptr<OpenClQueue> queue_;
  const int lanes_;  // samples of an item
  const SurfacePicture picture_;
  const DeviceMemory planes_, disparity_, lowest_, highest_;
};

}  // namespace

std::unique_ptr<ViewWarp> NewOpenClWarp(std::shared_ptr<const OpenClDevice> device,
                                        const cl::Program& program, const SurfacePicture& picture) {
  const TapRanges ranges = TapRangesOf(picture);
  const HostMemory memory = HostMemoryOf(*device);
  const int lanes = FormOf(*device, sizeof(float)).lanes;
  return std::make_unique<OpenClWarp>(
      std::make_unique<OpenClQueue>(std::move(device), program, memory), picture, ranges, lanes);
}

}  // namespace thicklens::kernels
