#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_PROJECTION_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_PROJECTION_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "kernels/opencl/opencl_call.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/packed_map.h"
#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::kernels {

// The layout of images on a device: Layout in filter.cl.
struct ImageLayout {
  cl_int width_px = 0, height_px = 0, stride_px = 0, plane = 0, margin = 0;

  std::size_t size(int channels) const {
    return 2 * static_cast<std::size_t>(margin) +
           static_cast<std::size_t>(plane) * static_cast<std::size_t>(channels);
  }
};

// An image on a device; it is converted from and to planes without gaps. The numbers beside the
// planes are 0.
template <typename Real>
class DeviceImage {
 public:
  DeviceImage(OpenClQueue* queue, const std::string& what, const ImageLayout& layout, int channels);
  // Writes as many planes as `planes` has. Numbers of a row beyond the image become `beside`.
  void Write(const std::vector<Real>& planes, Real beside = 0);
  std::vector<Real> Read(int channels) const;
  void Clear() { memory_.Clear(); }
  const DeviceMemory& memory() const { return memory_; }

 private:
  ImageLayout layout_;
  DeviceMemory memory_;
};

// A FilteredMap on a device.
template <typename Real>
class OpenClProjection {
 public:
  // The map processes up to the number of channels of `data` at once. No reference to `data` is
  // kept.
  OpenClProjection(OpenClQueue* queue, const DataTerm<Real>& data, const ItemForm& form);

  const ImageLayout& layout() const { return layout_; }
  // Computes y = H x, or with a plane of weights W, y = W H x.
  void Apply(const DeviceImage<Real>& x, int channels, const DeviceImage<Real>* weight,
             DeviceImage<Real>* y);
  void ApplyTransposed(const DeviceImage<Real>& y, int channels, DeviceImage<Real>* x);

 private:
  struct Filter {
    int step = 1;
    DeviceMemory first, start, coefficients;
  };
  struct Product {
    Filter across, down, across_transposed, down_transposed;
  };
  struct Rows {
    int count = 0;
    DeviceMemory pixel, start, index, weight;
  };
  struct Pixels {
    int count = 0;
    DeviceMemory pixel;
  };
  Filter ToDevice(const PackedFilter<Real>& packed, int step);
  Rows ToDevice(const PackedRows<Real>& packed);
  void Run(const Filter& filter, const DeviceImage<Real>& x, int channels,
           const DeviceImage<Real>* weight, bool add, DeviceImage<Real>* y);
  void Add(const Rows& rows, const DeviceMemory& values, int channel, int channels,
           const DeviceImage<Real>* weight, DeviceImage<Real>* y);

  // Copies four channels of the given pixels.
  void Take(const DeviceImage<Real>& from, int channel, int channels, int count,
            const DeviceMemory& pixel, const DeviceMemory& to);

  OpenClQueue* queue_;
  ItemForm form_;
  ImageLayout layout_;
  std::vector<Product> products_;
  std::unique_ptr<Rows> rows_, rows_transposed_;
  std::unique_ptr<Pixels> read_;  // pixels that rows read
  std::unique_ptr<DeviceImage<Real>> between_;
  // Four adjacent channels of the pixels that rows read and of those that have rows.
  std::unique_ptr<DeviceMemory> of_pixels_, of_rows_;
};

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_PROJECTION_H_
