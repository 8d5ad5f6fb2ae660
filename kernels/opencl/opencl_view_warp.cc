// Views on a device: warp.cl.
#include <algorithm>
#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "kernels/opencl/opencl_call.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/reference/warp_arguments.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {
namespace {

constexpr int kBefore = 1, kAfter = 2;  // repeated border pixels before and after
constexpr int kFour = 4;  // channels of a pixel that are read at once if there are several

// The structure Surfaces of warp.cl.
struct SurfacesArgument {
  cl_int width_px, height_px, channels;
  cl_float tolerance, limit_px;
};

// Returns the pixels of an image in the layout of warp.cl.
std::vector<float> PixelsOf(const SurfaceImage& image) {
  const int of_pixel = image.channels == 1 ? 1 : kFour;
  const int planes = (image.channels + of_pixel - 1) / of_pixel;
  std::vector<float> pixels(Index(image.width_px + kBefore + kAfter) *
                            Index(image.height_px + kBefore + kAfter) * Index(of_pixel) *
                            Index(planes));
  float* to = pixels.data();
  for (int plane = 0; plane < planes; ++plane) {
    const int first = plane * of_pixel;
    const int count = std::min(of_pixel, image.channels - first);
    for (int y = -kBefore; y < image.height_px + kAfter; ++y) {
      const std::size_t row = Index(std::clamp(y, 0, image.height_px - 1)) * Index(image.width_px);
      for (int x = -kBefore; x < image.width_px + kAfter; ++x, to += of_pixel) {
        const std::size_t pixel = row + Index(std::clamp(x, 0, image.width_px - 1));
        std::copy_n(image.values->data() + pixel * Index(image.channels) + first, count, to);
      }
    }
  }
  return pixels;
}

// Returns the shift of a view as floats, and their rounding errors. A device without double then
// finds the sources with the full precision of float, like the reference. The product with a shift
// above the bound is outside of any image.
cl_float4 ShiftOf(const ViewSources& view) {
  constexpr double kBound = 1e30;
  const double x = std::clamp(view.shift_x, -kBound, kBound);
  const double y = std::clamp(view.shift_y, -kBound, kBound);
  const auto float_x = static_cast<float>(x), float_y = static_cast<float>(y);
  return {{float_x, float_y, static_cast<float>(x - float_x), static_cast<float>(y - float_y)}};
}

static_assert(sizeof(OccludedSample) == 16, "Occluded in warp.cl");
static_assert(sizeof(BoundarySample) == 24, "Boundary in warp.cl");

// Returns minimum and maximum alternately, pixel by pixel.
std::vector<float> PairsOf(const TapRanges& ranges) {
  std::vector<float> pairs;
  pairs.reserve(2 * ranges.lowest.size());
  for (std::size_t i = 0; i < ranges.lowest.size(); ++i) {
    pairs.insert(pairs.end(), {ranges.lowest[i], ranges.highest[i]});
  }
  return pairs;
}

class OpenClWarp : public ViewWarp {
 public:
  OpenClWarp(std::unique_ptr<OpenClQueue> queue, const SurfaceImage& image, const TapRanges& ranges,
             int lanes)
      : queue_(std::move(queue)),
        lanes_(lanes),
        image_(image),
        pixels_(Copied(queue_.get(), "image of surfaces", PixelsOf(image))),
        disparity_(Copied(queue_.get(), "disparity of an image", *image.disparity)),
        ranges_(Copied(queue_.get(), "ranges of disparities", PairsOf(ranges))) {
    queue_->Finish();  // the queues that read the image are not synchronised with this one
  }

  void Warp(const ViewSources& view, std::vector<float>* values) override {
    CheckView(image_, view);
    const SurfacesArgument surfaces{image_.width_px, image_.height_px, image_.channels,
                                    image_.tolerance,
                                    static_cast<cl_float>(image_.width_px + image_.height_px)};
    // Replaces an empty list, which OpenCL does not allow.
    const std::vector<OccludedSample> no_sample(1);
    const std::vector<OccludedSample>& occluded =
        view.occluded->empty() ? no_sample : *view.occluded;
    const auto occluded_count = static_cast<int>(view.occluded->size());
    values->resize(image_.values->size());
    std::unique_ptr<OpenClQueue> queue = TakeQueue();
    DeviceArray made(queue.get(), "view", values->data(), values->size() * sizeof(float),
                     DeviceArray::Holds::kNothing);
    OpenClCall(queue.get(), "WarpView")
        .Value(surfaces)
        .OnDevice(pixels_)
        .OnDevice(disparity_)
        .OnDevice(ranges_)
        .Input("disparity of a view", *view.disparity)
        .Value(ShiftOf(view))
        .Input("occluded samples of a view", occluded)
        .Value(static_cast<cl_int>(occluded_count))
        .OnDevice(made)
        .Enqueue(ItemsOf(image_.width_px) * Index(image_.height_px) + ItemsOf(occluded_count));
    if (view.boundary != nullptr && !view.boundary->empty()) {
      OpenClCall(queue.get(), "MixSamples")
          .Value(surfaces)
          .OnDevice(pixels_)
          .OnDevice(disparity_)
          .Input("boundary samples of a view", *view.boundary)
          .Value(static_cast<cl_int>(view.boundary->size()))
          .OnDevice(made)
          .Enqueue(view.boundary->size());
    }
    made.CopyToHost();
    const std::lock_guard<std::mutex> lock(mutex_);
    spare_queues_.push_back(std::move(queue));
  }

 private:
  // Each thread in Warp has its own queue, so that the device computes a view while another thread
  // waits for the result of the previous one. For small views this wait is most of the time.
  std::unique_ptr<OpenClQueue> TakeQueue() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (spare_queues_.empty()) return queue_->Clone();
    std::unique_ptr<OpenClQueue> queue = std::move(spare_queues_.back());
    spare_queues_.pop_back();
    return queue;
  }
  std::size_t ItemsOf(int samples) const { return Index((samples + lanes_ - 1) / lanes_); }

  const std::unique_ptr<OpenClQueue> queue_;  // queue that sent the image
  const int lanes_;                           // samples per item
  const SurfaceImage image_;
  const DeviceMemory pixels_, disparity_, ranges_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<OpenClQueue>> spare_queues_;
};

}  // namespace

std::unique_ptr<ViewWarp> NewOpenClWarp(std::shared_ptr<const OpenClDevice> device,
                                        const cl::Program& program, const SurfaceImage& image) {
  const TapRanges ranges = TapRangesOf(image);
  const HostMemory memory = HostMemoryOf(*device);
  const int lanes = FormOf(*device, sizeof(float)).lanes;
  return std::make_unique<OpenClWarp>(
      std::make_unique<OpenClQueue>(std::move(device), program, memory), image, ranges, lanes);
}

}  // namespace thicklens::kernels
