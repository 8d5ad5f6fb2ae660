#include "kernels/opencl/opencl_projection.h"

#include <algorithm>

#include "thicklens/base/index.h"

namespace thicklens::kernels {
namespace {

constexpr int kTogether = 4;  // channels that an entry of a row processes together
// Minimum number of numbers before and after planes that items may read beyond the reach of
// filters: a vector and a neighbour.
constexpr int kMinMargin = 64;

// The pixels that rows read, as ascending places on the plane, and for each pixel of the image its
// index among them (-1: none).
struct ReadPixels {
  std::vector<std::int32_t> pixel, place_of;
};
template <typename Real>
ReadPixels ReadPixelsOf(const PixelCsr<Real>& rows, const PackedPlane& plane) {
  ReadPixels read;
  const std::vector<std::int32_t> places = PackedPlaces(plane);
  std::vector<char> is_read(places.size(), 0);
  for (const std::int32_t index : rows.index) is_read[Index(index)] = 1;
  read.place_of.assign(places.size(), -1);
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (is_read[i] == 0) continue;
    read.place_of[i] = static_cast<std::int32_t>(read.pixel.size());
    read.pixel.push_back(places[i]);
  }
  return read;
}

}  // namespace

template <typename Real>
DeviceImage<Real>::DeviceImage(OpenClQueue* queue, const std::string& what,
                               const ImageLayout& layout, int channels)
    : layout_(layout), memory_(queue, what, layout.size(channels) * sizeof(Real)) {
  memory_.Clear();
}

template <typename Real>
void DeviceImage<Real>::Write(const std::vector<Real>& planes, Real beside) {
  std::vector<Real> padded(memory_.bytes() / sizeof(Real), Real{0});
  const std::size_t width = Index(layout_.width_px);
  const std::size_t rows = planes.size() / width;
  for (std::size_t row = 0; row < rows; ++row) {
    Real* to = padded.data() + Index(layout_.margin) + row * Index(layout_.stride_px);
    std::copy_n(planes.data() + row * width, width, to);
    std::fill(to + width, to + layout_.stride_px, beside);
  }
  memory_.Write(padded.data());
}

template <typename Real>
std::vector<Real> DeviceImage<Real>::Read(int channels) const {
  std::vector<Real> padded(memory_.bytes() / sizeof(Real));
  memory_.Read(padded.data());
  const std::size_t width = Index(layout_.width_px);
  const std::size_t rows = Index(layout_.height_px) * Index(channels);
  std::vector<Real> planes(rows * width);
  for (std::size_t row = 0; row < rows; ++row) {
    std::copy_n(padded.data() + Index(layout_.margin) + row * Index(layout_.stride_px), width,
                planes.data() + row * width);
  }
  return planes;
}

template <typename Real>
OpenClProjection<Real>::OpenClProjection(OpenClQueue* queue, const DataTerm<Real>& data,
                                         const ItemForm& form)
    : queue_(queue), form_(form) {
  const PackedPlane plane = PackedPlaneOf(data.width_px, data.height_px, form.tile);
  const PixelCsr<Real> rows = RowsOf(*data.filters.rows);
  int reach = 0;
  const auto pack = [&](const VaryingFilter<Real>& filter, bool transposed, bool leave_out) {
    const PackedFilter<Real> packed =
        Pack(filter, transposed, leave_out ? rows.pixel : std::vector<std::int32_t>(), plane,
             form.tile, data.threads);
    const bool across = filter.axis == Axis::kAcross;
    if (across) reach = std::max(reach, packed.reach_px);
    return ToDevice(packed, across ? 1 : plane.stride_px);
  };
  for (const auto& product : data.filters.products) {
    // At a pixel with a row, the product is ignored.
    products_.push_back({pack(*product.across, false, false), pack(*product.down, false, true),
                         pack(*product.across, true, false), pack(*product.down, true, true)});
  }
  layout_.width_px = plane.width_px;
  layout_.height_px = plane.height_px;
  layout_.stride_px = plane.stride_px;
  layout_.plane = static_cast<cl_int>(plane.size());
  layout_.margin = (reach + 2 * kMinMargin - 1) / kMinMargin * kMinMargin;

  const ReadPixels read = ReadPixelsOf(rows, plane);
  const PackedRows<Real> packed = Pack(rows, read.place_of, plane, form.slice, data.threads);
  rows_ = std::make_unique<Rows>(ToDevice(packed));
  read_ = std::make_unique<Pixels>(Pixels{static_cast<int>(read.pixel.size()),
                                          Copied(queue, "pixels that rows read", read.pixel)});
  // The index of a pixel's row.
  std::vector<std::int32_t> row_of(Index(data.width_px) * Index(data.height_px), 0);
  for (std::size_t i = 0; i < packed.order.size(); ++i) {
    row_of[Index(rows.pixel[Index(packed.order[i])])] = static_cast<std::int32_t>(i);
  }
  rows_transposed_ = std::make_unique<Rows>(
      ToDevice(Pack(Transposed(rows), row_of, plane, form.slice, data.threads)));

  between_ = std::make_unique<DeviceImage<Real>>(queue, "image between two filters", layout_,
                                                 data.channels);
  const std::size_t together = kTogether * sizeof(Real);
  if (rows_->count == 0) return;
  of_pixels_ =
      std::make_unique<DeviceMemory>(queue, "pixels for rows", together * Index(read_->count));
  of_rows_ =
      std::make_unique<DeviceMemory>(queue, "pixels of rows", together * Index(rows_->count));
}

template <typename Real>
typename OpenClProjection<Real>::Filter OpenClProjection<Real>::ToDevice(
    const PackedFilter<Real>& packed, int step) {
  return {step, Copied(queue_, "first terms of a filter", packed.first),
          Copied(queue_, "starts of a filter", packed.start),
          Copied(queue_, "coefficients of a filter", packed.coefficients)};
}

template <typename Real>
typename OpenClProjection<Real>::Rows OpenClProjection<Real>::ToDevice(
    const PackedRows<Real>& packed) {
  return {static_cast<int>(packed.pixel.size()), Copied(queue_, "pixels of rows", packed.pixel),
          Copied(queue_, "starts of rows", packed.start),
          Copied(queue_, "indices of rows", packed.index),
          Copied(queue_, "weights of rows", packed.weight)};
}

template <typename Real>
void OpenClProjection<Real>::Run(const Filter& filter, const DeviceImage<Real>& x, int channels,
                                 const DeviceImage<Real>* weight, bool add, DeviceImage<Real>* y) {
  OpenClCall(queue_, "FilterImage")
      .Value(layout_)
      .Value(cl_int{channels})
      .Value(cl_int{filter.step})
      .OnDevice(filter.first)
      .OnDevice(filter.start)
      .OnDevice(filter.coefficients)
      .OnDevice(x.memory())
      .Value(cl_int{weight != nullptr})
      .OnDevice(weight != nullptr ? weight->memory() : x.memory())
      .Value(cl_int{add})
      .OnDevice(y->memory())
      .Enqueue(Index(layout_.plane / form_.lanes));
}

template <typename Real>
void OpenClProjection<Real>::Add(const Rows& rows, const DeviceMemory& values, int channel,
                                 int channels, const DeviceImage<Real>* weight,
                                 DeviceImage<Real>* y) {
  OpenClCall(queue_, "AddRows")
      .Value(layout_)
      .Value(cl_int{channel})
      .Value(cl_int{channels})
      .Value(cl_int{rows.count})
      .OnDevice(rows.pixel)
      .OnDevice(rows.start)
      .OnDevice(rows.index)
      .OnDevice(rows.weight)
      .OnDevice(values)
      .Value(cl_int{weight != nullptr})
      .OnDevice(weight != nullptr ? weight->memory() : y->memory())
      .OnDevice(y->memory())
      .Enqueue(Index(rows.count));
}

template <typename Real>
void OpenClProjection<Real>::Take(const DeviceImage<Real>& from, int channel, int channels,
                                  int count, const DeviceMemory& pixel, const DeviceMemory& to) {
  if (count == 0) return;
  OpenClCall(queue_, "TakePixels")
      .Value(layout_)
      .Value(cl_int{channel})
      .Value(cl_int{channels})
      .Value(cl_int{count})
      .OnDevice(pixel)
      .OnDevice(from.memory())
      .OnDevice(to)
      .Enqueue(Index(count));
}

template <typename Real>
void OpenClProjection<Real>::Apply(const DeviceImage<Real>& x, int channels,
                                   const DeviceImage<Real>* weight, DeviceImage<Real>* y) {
  if (products_.empty()) y->Clear();
  for (std::size_t i = 0; i < products_.size(); ++i) {
    Run(products_[i].across, x, channels, nullptr, false, between_.get());
    Run(products_[i].down, *between_, channels, weight, i > 0, y);
  }
  for (int channel = 0; rows_->count > 0 && channel < channels; channel += kTogether) {
    Take(x, channel, channels, read_->count, read_->pixel, *of_pixels_);
    Add(*rows_, *of_pixels_, channel, channels, weight, y);
  }
}

template <typename Real>
void OpenClProjection<Real>::ApplyTransposed(const DeviceImage<Real>& y, int channels,
                                             DeviceImage<Real>* x) {
  if (products_.empty()) x->Clear();
  for (std::size_t i = 0; i < products_.size(); ++i) {
    Run(products_[i].down_transposed, y, channels, nullptr, false, between_.get());
    Run(products_[i].across_transposed, *between_, channels, nullptr, i > 0, x);
  }
  for (int channel = 0; rows_->count > 0 && channel < channels; channel += kTogether) {
    Take(y, channel, channels, rows_->count, rows_->pixel, *of_rows_);
    Add(*rows_transposed_, *of_rows_, channel, channels, nullptr, x);
  }
}

template class DeviceImage<float>;
template class DeviceImage<double>;
template class OpenClProjection<float>;
template class OpenClProjection<double>;

}  // namespace thicklens::kernels
