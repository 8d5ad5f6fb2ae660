#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/opencl/opencl_call.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/opencl_projection.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::kernels {
namespace {

constexpr std::size_t kItemPixels = 16;  // equal to ITEM_PIXELS in radiance.cl
constexpr std::size_t kSums = 3;         // equal to SUMS in radiance.cl

// The steps as calls of the kernels of radiance.cl; see there and radiance_steps.h for their
// meaning.
template <typename Real>
class OpenClSteps : public RadianceSteps<Real> {
 public:
  OpenClSteps(std::unique_ptr<OpenClQueue> queue, const DataTerm<Real>& data, const ItemForm& form,
              bool sums_are_double)
      : queue_(std::move(queue)),
        form_(form),
        sums_are_double_(sums_are_double),
        most_channels_(data.channels),
        pixels_(data.pixels()),
        projection_(queue_.get(), data, form),
        layout_(projection_.layout()),
        sums_(queue_.get(), "sums", SumGroups() * kSums * sizeof(double)) {
    photograph_.Write(data.photograph);
    weight_.Write(data.weight);
    BackprojectWeighted(photograph_, data.channels, &right_);
    // The approximate diagonal, as in the reference.
    other_photograph_.Write(data.row_norm2);
    BackprojectWeighted(other_photograph_, 1, &data_diagonal_);
  }

  void SetPrior(const QuadraticPrior<Real>& prior) override {
    target_ = prior.target_is_photograph ? Target::kPhotograph
              : prior.target.empty()     ? Target::kNone
                                         : Target::kGiven;
    if (target_ == Target::kGiven) {
      if (!given_target_) given_target_.emplace(NewImage("target", most_channels_));
      given_target_->Write(prior.target);
    }
    SetTikhonovWeight(prior.tikhonov_weight);
    if (prior.gradient_weight.empty()) {
      gradient_weight_.Clear();
    } else {
      gradient_weight_.Write(prior.gradient_weight);
    }
  }

  void SetVariation(const TotalVariation<Real>& variation) override {
    variation_ = variation;
    variation_.slope_squared = nullptr;
    slope_squared_.Write(*variation.slope_squared);
  }

  void ReweightVariation() override {
    target_ = Target::kNone;
    if (tikhonov_value_ != variation_.tikhonov_weight) {
      SetTikhonovWeight(std::vector<Real>(pixels_, static_cast<Real>(variation_.tikhonov_weight)));
      tikhonov_value_ = variation_.tikhonov_weight;
    }
    Call("ReweightVariation")
        .Value(cl_int{channels_})
        .Value(static_cast<Real>(variation_.strength / 2))
        .Value(static_cast<Real>(variation_.eps * variation_.eps))
        .OnDevice(slope_squared_.memory())
        .OnDevice(x_.memory())
        .OnDevice(gradient_weight_.memory())
        .Enqueue(PlaneItems());
  }

  void Start(const std::vector<Real>& x) override {
    channels_ = most_channels_;
    started_photograph_ = &photograph_;
    started_right_ = &right_;
    StartAt(x);
  }

  void StartFor(const std::vector<Real>& photograph, const std::vector<Real>& x) override {
    channels_ = 1;
    other_photograph_.Write(photograph);
    BackprojectWeighted(other_photograph_, 1, &other_right_);
    started_photograph_ = &other_photograph_;
    started_right_ = &other_right_;
    StartAt(x);
  }

  double SquaredRightSide() override {
    return RunSums(Call("SquareRightSide")
                       .Value(cl_int{channels_})
                       .OnDevice(tikhonov_weight_.memory())
                       .OnDevice(started_right_->memory())
                       .Value(cl_int{target_ != Target::kNone})
                       .OnDevice(TargetImage().memory()))[0];
  }

  ResidualSums UpdateResidual() override {
    const auto sums = RunSums(Call("UpdateResidual")
                                  .Value(cl_int{channels_})
                                  .OnDevice(data_diagonal_.memory())
                                  .OnDevice(tikhonov_weight_.memory())
                                  .OnDevice(gradient_weight_.memory())
                                  .OnDevice(x_.memory())
                                  .OnDevice(data_residual_.memory())
                                  .Value(cl_int{target_ != Target::kNone})
                                  .OnDevice(TargetImage().memory())
                                  .OnDevice(inverse_diagonal_.memory())
                                  .OnDevice(residual_.memory()));
    return {sums[0], sums[1], sums[2]};
  }

  double UpdateDirection(double beta) override {
    return RunSums(Call("UpdateDirection")
                       .Value(cl_int{channels_})
                       .Value(static_cast<Real>(beta))
                       .OnDevice(inverse_diagonal_.memory())
                       .OnDevice(residual_.memory())
                       .OnDevice(direction_.memory()))[0];
  }

  double ApplyNormalOperator() override {
    projection_.Apply(direction_, channels_, &weight_, &projected_);
    projection_.ApplyTransposed(projected_, channels_, &product_);
    const auto sums = RunSums(Call("ApplyNormalOperator")
                                  .Value(cl_int{channels_})
                                  .OnDevice(tikhonov_weight_.memory())
                                  .OnDevice(gradient_weight_.memory())
                                  .OnDevice(direction_.memory())
                                  .OnDevice(product_.memory()));
    return sums[0] + sums[1];
  }

  void UpdateSolution(double step) override {
    AddScaled(step, direction_, &x_);
    AddScaled(-step, product_, &data_residual_);
  }

  std::vector<Real> Radiance() override { return x_.Read(channels_); }

  std::vector<Real> Project(const std::vector<Real>& x) override {
    const int channels = static_cast<int>(x.size() / pixels_);
    product_.Write(x);
    projection_.Apply(product_, channels, nullptr, &projected_);
    return projected_.Read(channels);
  }

  std::vector<Real> ProjectTransposed(const std::vector<Real>& y) override {
    const int channels = static_cast<int>(y.size() / pixels_);
    projected_.Write(y);
    projection_.ApplyTransposed(projected_, channels, &product_);
    return product_.Read(channels);
  }

 private:
  enum class Target { kNone, kPhotograph, kGiven };

  // Without a target, any image is returned.
  const DeviceImage<Real>& TargetImage() const {
    return target_ == Target::kGiven ? *given_target_ : *started_photograph_;
  }

  std::size_t PlaneItems() const { return Index(layout_.plane / form_.lanes); }
  std::size_t SumItems() const { return (Index(layout_.plane) + kItemPixels - 1) / kItemPixels; }
  std::size_t SumGroups() { return OpenClCall(queue_.get(), "UpdateResidual").Groups(SumItems()); }

  OpenClCall Call(const char* kernel) {
    OpenClCall call(queue_.get(), kernel);
    call.Value(layout_);
    return call;
  }

  DeviceImage<Real> NewImage(const char* what, int channels) {
    return DeviceImage<Real>(queue_.get(), what, layout_, channels);
  }

  // The Tikhonov weight is 1 beside the image, so that the preconditioner is finite there.
  void SetTikhonovWeight(const std::vector<Real>& tikhonov_weight) {
    tikhonov_weight_.Write(tikhonov_weight, 1);
    tikhonov_value_ = std::nan("");
  }

  // Computes to = H^T W image.
  void BackprojectWeighted(const DeviceImage<Real>& image, int channels, DeviceImage<Real>* to) {
    Call("MultiplyPlanes")
        .Value(cl_int{channels})
        .OnDevice(weight_.memory())
        .OnDevice(image.memory())
        .OnDevice(projected_.memory())
        .Enqueue(PlaneItems());
    projection_.ApplyTransposed(projected_, channels, to);
  }

  void AddScaled(double scale, const DeviceImage<Real>& x, DeviceImage<Real>* y) {
    Call("AddScaled")
        .Value(cl_int{channels_})
        .Value(static_cast<Real>(scale))
        .OnDevice(x.memory())
        .OnDevice(y->memory())
        .Enqueue(PlaneItems() * Index(channels_));
  }

  void StartAt(const std::vector<Real>& x) {
    x_.Write(x);
    data_residual_.Clear();
    residual_.Clear();
    direction_.Clear();
    AddScaled(1, *started_right_, &data_residual_);
    projection_.Apply(x_, channels_, &weight_, &projected_);
    projection_.ApplyTransposed(projected_, channels_, &product_);
    AddScaled(-1, product_, &data_residual_);
  }

  // Runs a kernel whose last argument is the sums of its groups, and adds these.
  std::array<double, kSums> RunSums(OpenClCall& call) {
    call.OnDevice(sums_).Enqueue(SumItems());
    return sums_are_double_ ? Added<double>() : Added<float>();
  }
  template <typename Number>
  std::array<double, kSums> Added() {
    std::vector<Number> of_group(sums_.bytes() / sizeof(Number));
    sums_.Read(of_group.data());
    std::array<double, kSums> sums{};
    const std::size_t count = SumGroups() * kSums;  // called once, because it is a look-up
    for (std::size_t i = 0; i < count; ++i) {
      sums[i % kSums] += static_cast<double>(of_group[i]);
    }
    return sums;
  }

  const std::unique_ptr<OpenClQueue> queue_;
  const ItemForm form_;
  const bool sums_are_double_;
  const int most_channels_;
  const std::size_t pixels_;
  OpenClProjection<Real> projection_;
  const ImageLayout layout_;
  DeviceMemory sums_;
  DeviceImage<Real> photograph_ = NewImage("photograph", most_channels_);
  DeviceImage<Real> weight_ = NewImage("weights", 1);
  DeviceImage<Real> right_ = NewImage("right side", most_channels_);
  DeviceImage<Real> other_photograph_ = NewImage("probe", 1);
  DeviceImage<Real> other_right_ = NewImage("right side of a probe", 1);
  DeviceImage<Real> data_diagonal_ = NewImage("diagonal", 1);
  DeviceImage<Real> inverse_diagonal_ = NewImage("preconditioner", 1);
  DeviceImage<Real> tikhonov_weight_ = NewImage("tikhonov_weight", 1);
  DeviceImage<Real> gradient_weight_ = NewImage("gradient_weight", 1);
  DeviceImage<Real> slope_squared_ = NewImage("slopes", 1);
  DeviceImage<Real> x_ = NewImage("radiance", most_channels_);
  DeviceImage<Real> data_residual_ = NewImage("residual of the data", most_channels_);
  DeviceImage<Real> residual_ = NewImage("residual", most_channels_);
  DeviceImage<Real> direction_ = NewImage("direction", most_channels_);
  DeviceImage<Real> product_ = NewImage("product", most_channels_);
  DeviceImage<Real> projected_ = NewImage("projected image", most_channels_);

  TotalVariation<Real> variation_;
  double tikhonov_value_ = std::nan("");  // value of all pixels; NaN if they differ
  Target target_ = Target::kNone;
  std::optional<DeviceImage<Real>> given_target_;
  int channels_ = 1;
  const DeviceImage<Real>* started_photograph_ = nullptr;
  const DeviceImage<Real>* started_right_ = nullptr;
};

}  // namespace

template <typename Real>
std::unique_ptr<RadianceSteps<Real>> NewOpenClSteps(std::shared_ptr<const OpenClDevice> device,
                                                    const cl::Program& program,
                                                    const DataTerm<Real>& data) {
  const ItemForm form = FormOf(*device, sizeof(Real));
  const bool sums_are_double = device->has_double;
  return std::make_unique<OpenClSteps<Real>>(
      std::make_unique<OpenClQueue>(std::move(device), program, HostMemory::kCopied), data, form,
      sums_are_double);
}
template std::unique_ptr<RadianceSteps<float>> NewOpenClSteps(std::shared_ptr<const OpenClDevice>,
                                                              const cl::Program&,
                                                              const DataTerm<float>&);
template std::unique_ptr<RadianceSteps<double>> NewOpenClSteps(std::shared_ptr<const OpenClDevice>,
                                                               const cl::Program&,
                                                               const DataTerm<double>&);

}  // namespace thicklens::kernels
