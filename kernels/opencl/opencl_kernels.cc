#include "kernels/opencl/opencl_kernels.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "kernels/opencl/opencl_call.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/reference/arguments.h"
#include "kernels/reference/splat.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/sparse.h"

namespace thicklens::kernels {
namespace {

constexpr const char* kChannel = "channel of the light field";

// The numbers of a block in the form of kernels: Block in project.cl.
struct BlockArgument {
  cl_int first_x, first_y, width_px, height_px;
  cl_int s_count, t_count, u_count, v_count;
};
BlockArgument ArgumentOf(const BlockGeometry& block) {
  return {block.first_x, block.first_y, block.width_px, block.height_px,
          block.s_count, block.t_count, block.u_count,  block.v_count};
}

std::vector<cl_int> ShiftsOf(const BlockGeometry& block) {
  std::vector<cl_int> shifts(block.s_shift.begin(), block.s_shift.end());
  shifts.insert(shifts.end(), block.t_shift.begin(), block.t_shift.end());
  return shifts;
}

template <typename Real>
std::vector<Real> RealsOf(const std::vector<double>& first, const std::vector<double>& second) {
  std::vector<Real> reals;
  reals.reserve(first.size() + second.size());
  for (const double value : first) reals.push_back(static_cast<Real>(value));
  for (const double value : second) reals.push_back(static_cast<Real>(value));
  return reals;
}

template <typename Real>
EllMatrix<Real> NewEll(int rows, int columns, int slots) {
  const std::size_t entries = Index(rows) * Index(slots);
  return {rows, columns, slots, std::vector<std::int32_t>(entries), std::vector<Real>(entries)};
}

// Each method checks its arguments like the reference, handles empty arguments itself, and runs the
// kernel of the same name otherwise.
template <typename Real>
class OpenClKernels : public Kernels<Real> {
 public:
  explicit OpenClKernels(std::unique_ptr<OpenClQueue> queue) : queue_(std::move(queue)) {}

  std::unique_ptr<Kernels<Real>> Clone() const override {
    return std::make_unique<OpenClKernels>(queue_->Clone());
  }

  std::vector<std::int32_t> FindRays(const BlockGeometry& block, Splat splat) override {
    CheckRayNumbers(block, 1);
    std::vector<std::int32_t> rays(Index(RaySlots(block, splat)) * Index(block.pixels()));
    if (rays.empty()) return rays;
    OpenClCall(queue_.get(), "FindRays")
        .Value(ArgumentOf(block))
        .Value(cl_int{TapCount(splat)})
        .Input("shifts", ShiftsOf(block))
        .Input("fractions", RealsOf<Real>(block.s_fraction, block.t_fraction))
        .Output("rays", &rays)
        .Run(Index(block.pixels()));
    return rays;
  }

  EllMatrix<Real> WeightRays(const BlockGeometry& block, Splat splat,
                             const std::vector<std::int32_t>& rays,
                             const std::vector<Real>& irradiance) override {
    CheckRayNumbers(block, 1);
    CheckRays(block, splat, rays);
    if (!irradiance.empty()) CheckSize("irradiance", irradiance.size(), Index(block.rays()));
    auto h = NewEll<Real>(block.pixels(), block.rays(), RaySlots(block, splat));
    if (rays.empty()) return h;
    const std::vector<Real> slot_weights = SlotWeights<Real>(block, splat);
    OpenClCall(queue_.get(), "WeightRays")
        .Value(cl_int{h.rows})
        .Value(cl_int{h.slots})
        .Input("slot weights", slot_weights)
        .Input("rays", rays)
        .Value(cl_int{irradiance.empty() ? 0 : 1})
        .Input("irradiance", irradiance.empty() ? slot_weights : irradiance)
        .Output("columns", &h.column)
        .Output("values", &h.value)
        .Run(Index(h.rows));
    return h;
  }

  EllMatrix<Real> WarpDifferences(const BlockGeometry& block, const std::vector<Real>& slope_u,
                                  const std::vector<Real>& slope_v) override {
    return MasksOf("WarpDifferences", block, 2, 3, slope_u, slope_v);
  }

  EllMatrix<Real> SixTermMasks(const BlockGeometry& block, const std::vector<Real>& slope_u,
                               const std::vector<Real>& slope_v) override {
    return MasksOf("SixTermMasks", block, 1, 17, slope_u, slope_v);
  }

  std::vector<Real> Multiply(const CsrMatrix<Real>& a, const std::vector<Real>& x) override {
    CheckCsr(a);
    CheckSize("vector to be multiplied", x.size(), Index(a.columns));
    return MultiplyRows(a, x);
  }

  std::vector<Real> MultiplyTransposed(const CsrMatrix<Real>& a,
                                       const std::vector<Real>& x) override {
    CheckCsr(a);
    CheckSize("vector to be multiplied", x.size(), Index(a.rows));
    return MultiplyRows(Transpose(a), x);
  }

  void AddNormalProduct(const CsrMatrix<Real>& a, Real scale, const CsrPattern& pattern,
                        std::vector<Real>* values) override {
    CheckCsr(a);
    CheckPattern(pattern, a.columns);
    CheckSize("values of a normal product", values->size(), pattern.column.size());
    if (values->empty() || a.entries() == 0) return;
    std::vector<std::int32_t> pattern_row;
    pattern_row.reserve(pattern.column.size());
    for (int row = 0; row < pattern.rows; ++row) {
      pattern_row.resize(Index(pattern.row_start[Index(row) + 1]), row);
    }
    const CsrMatrix<Real> a_t = Transpose(a);
    OpenClCall(queue_.get(), "AddNormalProduct")
        .Value(cl_long{pattern.entries()})
        .Value(scale)
        .Input("rows of the pattern", pattern_row)
        .Input("columns of the pattern", pattern.column)
        .Input("starts of rows", a_t.row_start)
        .Input("columns", a_t.column)
        .Input("values", a_t.value)
        .InputOutput("sums", values)
        .Run(values->size());
  }

  std::vector<Real> FormImage(const BlockGeometry& whole, Splat splat,
                              const std::vector<Real>& views) override {
    CheckBlock(whole);
    CheckSize("light field to form an image of", views.size(),
              Index(whole.s_count) * Index(whole.t_count) * Index(whole.views()));
    std::vector<Real> image(Index(whole.pixels()));
    if (image.empty() || views.empty()) return image;
    constexpr std::size_t kStripPx = 16;  // equal to STRIP in render.cl
    const std::size_t strips = (Index(whole.width_px) + kStripPx - 1) / kStripPx;
    OpenClCall(queue_.get(), "FormImage")
        .Value(ArgumentOf(whole))
        .Value(cl_int{TapCount(splat)})
        .Input("shifts", ShiftsOf(whole))
        .Input("fractions", RealsOf<Real>(whole.s_fraction, whole.t_fraction))
        .Input("view weights", RealsOf<Real>(whole.view_weight, {}))
        .Input("views", views)
        .Output("image", &image)
        .Run(strips * Index(whole.height_px));
    return image;
  }

  void StartWhole(int s_count, int t_count, int u_count, int v_count, int channels) override {
    const WholeShape shape{s_count, t_count, u_count, v_count, channels};
    CheckWhole(shape);
    const std::size_t bytes = shape.channel_samples() * sizeof(float);
    queue_->CheckAllocation(kChannel, bytes);
    channels_.clear();
    shape_ = shape;
    whole_.assign(shape.channel_samples() * Index(channels), 0.0F);
    if (whole_.empty()) return;
    for (std::size_t c = 0; c < Index(channels); ++c) {
      channels_.emplace_back(queue_.get(), kChannel, whole_.data() + c * shape.channel_samples(),
                             bytes);
    }
  }

  void AddBlock(const BlockGeometry& block, int channel, const std::vector<Real>& rays) override {
    CheckAddition(shape_, block, channel, rays.size());
    if (rays.empty() || whole_.empty()) return;
    OpenClCall(queue_.get(), "AddBlock")
        .Value(ArgumentOf(block))
        .Input("shifts", ShiftsOf(block))
        .Input("rays", rays)
        .OnDevice(channels_[Index(channel)])
        .Run(rays.size());
  }

  std::vector<float> FinishWhole() override {
    for (DeviceArray& channel : channels_) channel.CopyToHost();
    channels_.clear();
    shape_ = {};
    return std::exchange(whole_, {});
  }

 private:
  EllMatrix<Real> MasksOf(const char* kernel, const BlockGeometry& block, int rows_per_ray,
                          int slots, const std::vector<Real>& slope_u,
                          const std::vector<Real>& slope_v) {
    CheckSlopes(block, rows_per_ray, slope_u.size(), slope_v.size());
    auto masks = NewEll<Real>(rows_per_ray * block.rays(), block.rays(), slots);
    if (masks.rows == 0) return masks;
    OpenClCall(queue_.get(), kernel)
        .Value(ArgumentOf(block))
        .Input("shifts", ShiftsOf(block))
        .Input("slopes in u", slope_u)
        .Input("slopes in v", slope_v)
        .Output("columns", &masks.column)
        .Output("values", &masks.value)
        .Run(slope_u.size());
    return masks;
  }

  std::vector<Real> MultiplyRows(const CsrMatrix<Real>& a, const std::vector<Real>& x) {
    std::vector<Real> y(Index(a.rows));
    if (y.empty() || a.entries() == 0) return y;
    OpenClCall(queue_.get(), "MultiplyRows")
        .Value(cl_int{a.rows})
        .Input("starts of rows", a.row_start)
        .Input("columns", a.column)
        .Input("values", a.value)
        .Input("vector", x)
        .Output("product", &y)
        .Run(y.size());
    return y;
  }

  std::unique_ptr<OpenClQueue> queue_;
  WholeShape shape_;
  std::vector<float> whole_;  // declared before channels_, which use its memory
  std::vector<DeviceArray> channels_;
};

}  // namespace

template <typename Real>
std::unique_ptr<Kernels<Real>> NewOpenClKernelsOn(std::unique_ptr<OpenClQueue> queue) {
  return std::make_unique<OpenClKernels<Real>>(std::move(queue));
}
template std::unique_ptr<Kernels<float>> NewOpenClKernelsOn<float>(std::unique_ptr<OpenClQueue>);
template std::unique_ptr<Kernels<double>> NewOpenClKernelsOn<double>(std::unique_ptr<OpenClQueue>);

template <typename Real>
std::unique_ptr<Kernels<Real>> NewOpenClKernels(std::shared_ptr<const OpenClDevice> device,
                                                const cl::Program& program) {
  const HostMemory memory = HostMemoryOf(*device);
  return NewOpenClKernelsOn<Real>(
      std::make_unique<OpenClQueue>(std::move(device), program, memory));
}
template std::unique_ptr<Kernels<float>> NewOpenClKernels<float>(
    std::shared_ptr<const OpenClDevice>, const cl::Program&);
template std::unique_ptr<Kernels<double>> NewOpenClKernels<double>(
    std::shared_ptr<const OpenClDevice>, const cl::Program&);

}  // namespace thicklens::kernels
