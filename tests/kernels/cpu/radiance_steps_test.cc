// The device's steps are compared with those of the CPU, which get the dense matrix of the
// projection.
#include "thicklens/kernels/radiance_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/opencl_program.h"
#include "support/sample_projection.h"
#include "thicklens/kernels/device.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::SampleProjection;

// A machine that runs the tests has an OpenCL device, so a missing one is a failure.
std::shared_ptr<const OpenClDevice> Device() {
  static const std::shared_ptr<const OpenClDevice> device = [] {
    DeviceRequest request;
    request.kind = DeviceRequest::Kind::kOpenCl;
    const DeviceRequest place = ParseDeviceRequest(OpenBackend(request, nullptr)->name());
    return OpenOpenClDevice(place.platform, place.device);
  }();
  return device;
}

// The device as it is, or with single pixels as its items.
enum class Form { kOwn, kSinglePixels };

std::shared_ptr<const OpenClDevice> DeviceIn(Form form) {
  if (form == Form::kOwn) return Device();
  auto device = std::make_shared<OpenClDevice>(*Device());
  device->is_cpu = false;
  return device;
}

template <typename RealType, Form kForm>
struct Setting {
  using Real = RealType;
  static constexpr Form form = kForm;
};

template <typename Real>
double RelativeError(const std::vector<Real>& found, const std::vector<Real>& right) {
  if (found.size() != right.size()) return std::numeric_limits<double>::infinity();
  double scale = 0;
  double error = 0;
  for (std::size_t i = 0; i < right.size(); ++i) {
    scale = std::max(scale, std::abs(static_cast<double>(right[i])));
    const double difference =
        std::abs(static_cast<double>(found[i]) - static_cast<double>(right[i]));
    if (!(difference <= error)) error = difference;  // also if it is NaN
  }
  return scale > 0 ? error / scale : error;
}

struct Case {
  int width, height, channels, products;
  unsigned every;  // every how many pixels one has a row; 0: none has one
};
const std::vector<Case>& Cases() {
  static const std::vector<Case> cases = {{37, 21, 3, 1, 4}, {64, 9, 1, 1, 0}, {65, 8, 3, 0, 1},
                                          {130, 5, 5, 2, 3}, {1, 40, 3, 1, 5}, {45, 2, 2, 1, 6},
                                          {3, 2, 1, 0, 1},   {16, 24, 4, 1, 2}};
  return cases;
}

template <typename Setting>
class RadianceStepsTest : public ::testing::Test {
 protected:
  using Number = typename Setting::Real;
  static constexpr double kTolerance = std::is_same_v<Number, float> ? 2e-5 : 1e-12;

  static std::unique_ptr<RadianceSteps<Number>> OnDevice(const DataTerm<Number>& data) {
    const auto device = DeviceIn(Setting::form);
    static const cl::Program program =
        BuildKernels(*device, std::is_same_v<Number, float> ? "float" : "double");
    return NewOpenClSteps(device, program, data);
  }

  static void ExpectAlike(double found, double right) {
    EXPECT_NEAR(found, right, 10 * kTolerance * std::abs(right) + 1e-30);
  }

  // Compares the steps of both. Before each step, the device gets the numbers of the native one.
  static void ExpectSameSteps(int count, RadianceSteps<Number>* device, RadianceSteps<Number>* cpu,
                              bool touch) {
    ExpectAlike(device->SquaredRightSide(), cpu->SquaredRightSide());
    double before = 0;
    for (int n = 0; n < count; ++n) {
      if (touch) device->ReweightVariation();
      if (touch) cpu->ReweightVariation();
      const ResidualSums found = device->UpdateResidual();
      const ResidualSums right = cpu->UpdateResidual();
      ExpectAlike(found.squared, right.squared);
      ExpectAlike(found.preconditioned, right.preconditioned);
      EXPECT_NEAR(found.with_previous, right.with_previous,
                  10 * kTolerance * (right.preconditioned + before));
      const double beta = before > 0 ? 0.5 * right.preconditioned / before : 0;
      before = right.preconditioned;
      const double steepness = cpu->UpdateDirection(beta);
      ExpectAlike(device->UpdateDirection(beta), steepness);
      const double curvature = cpu->ApplyNormalOperator();
      ExpectAlike(device->ApplyNormalOperator(), curvature);
      cpu->UpdateSolution(steepness / curvature);
      device->UpdateSolution(steepness / curvature);
      EXPECT_LE(RelativeError(device->Radiance(), cpu->Radiance()), kTolerance) << n;
    }
  }
};

using Settings =
    ::testing::Types<Setting<float, Form::kOwn>, Setting<double, Form::kOwn>,
                     Setting<float, Form::kSinglePixels>, Setting<double, Form::kSinglePixels>>;
struct SettingNames {
  template <typename Setting>
  static std::string GetName(int) {
    return std::string(std::is_same_v<typename Setting::Real, float> ? "Float" : "Double") +
           (Setting::form == Form::kOwn ? "" : "SinglePixels");
  }
};
TYPED_TEST_SUITE(RadianceStepsTest, Settings, SettingNames);

TYPED_TEST(RadianceStepsTest, ProjectsAsTheDenseMatrixDoes) {
  using Real = typename TypeParam::Real;
  std::uint32_t seed = 1;
  for (const Case& c : Cases()) {
    SCOPED_TRACE(std::to_string(c.width) + "x" + std::to_string(c.height));
    const SampleProjection<Real> projection(c.width, c.height, c.products, c.every, ++seed);
    const DataTerm<Real> data = projection.Data(c.channels, ++seed);
    const auto steps = this->OnDevice(data);
    for (const int channels : {1, c.channels}) {
      const auto x = SampleProjection<Real>::Numbers(
          static_cast<std::size_t>(channels) * data.pixels(), ++seed);
      EXPECT_LE(RelativeError(steps->Project(x), projection.Multiply(false, x.data(), channels)),
                this->kTolerance);
      EXPECT_LE(
          RelativeError(steps->ProjectTransposed(x), projection.Multiply(true, x.data(), channels)),
          this->kTolerance);
    }
  }
}

TYPED_TEST(RadianceStepsTest, TheTransposedIsTheAdjoint) {
  using Real = typename TypeParam::Real;
  const SampleProjection<Real> projection(67, 7, 2, 5, 7);
  const DataTerm<Real> data = projection.Data(3, 8);
  const auto steps = this->OnDevice(data);
  const auto x = SampleProjection<Real>::Numbers(3 * data.pixels(), 9);
  const auto y = SampleProjection<Real>::Numbers(3 * data.pixels(), 10);
  const auto dot = [](const std::vector<Real>& a, const std::vector<Real>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
    }
    return sum;
  };
  const double forward = dot(steps->Project(x), y);
  EXPECT_NEAR(dot(x, steps->ProjectTransposed(y)), forward, this->kTolerance * std::abs(forward));
}

TYPED_TEST(RadianceStepsTest, StepsAreTheNativeOnes) {
  using Real = typename TypeParam::Real;
  std::uint32_t seed = 20;
  for (const Case& c : Cases()) {
    SCOPED_TRACE(std::to_string(c.width) + "x" + std::to_string(c.height));
    const SampleProjection<Real> projection(c.width, c.height, c.products, c.every, ++seed);
    const DataTerm<Real> data = projection.Data(c.channels, ++seed);
    const auto device = this->OnDevice(data);
    const auto cpu = NewCpuRadianceSteps(data);
    const auto plane = SampleProjection<Real>::Numbers(data.pixels(), ++seed);
    std::vector<Real> start = data.photograph;
    std::reverse(start.begin(), start.end());

    QuadraticPrior<Real> ridge;
    ridge.tikhonov_weight = plane;
    ridge.target_is_photograph = true;
    QuadraticPrior<Real> gradient;
    gradient.gradient_weight = plane;
    gradient.tikhonov_weight.assign(data.pixels(), static_cast<Real>(0.01));
    QuadraticPrior<Real> near_another = gradient;
    near_another.tikhonov_weight = plane;
    near_another.target = start;
    for (const auto* prior : {&ridge, &near_another, &gradient}) {
      SCOPED_TRACE(prior == &ridge ? "ridge" : prior == &gradient ? "gradient" : "target");
      for (auto* steps : {device.get(), cpu.get()}) {
        steps->SetPrior(*prior);
        steps->Start(start);
      }
      this->ExpectSameSteps(3, device.get(), cpu.get(), false);
    }
    SCOPED_TRACE("total variation");
    TotalVariation<Real> variation;
    variation.slope_squared = &plane;
    variation.strength = 0.1;
    variation.eps = 0.05;
    variation.tikhonov_weight = 0.02;
    for (auto* steps : {device.get(), cpu.get()}) {
      steps->SetVariation(variation);
      steps->Start(start);
    }
    this->ExpectSameSteps(3, device.get(), cpu.get(), true);
    SCOPED_TRACE("then one plane");
    // The steps for one plane use the quadratic that was set last.
    const std::vector<Real> other = SampleProjection<Real>::Numbers(data.pixels(), ++seed);
    for (auto* steps : {device.get(), cpu.get()}) {
      steps->StartFor(other, std::vector<Real>(data.pixels(), Real{0}));
    }
    this->ExpectSameSteps(3, device.get(), cpu.get(), false);
  }
}

TYPED_TEST(RadianceStepsTest, RunsGiveTheSameBits) {
  using Real = typename TypeParam::Real;
  const SampleProjection<Real> projection(67, 7, 1, 4, 30);
  const DataTerm<Real> data = projection.Data(3, 31);
  const auto plane = SampleProjection<Real>::Numbers(data.pixels(), 32);
  QuadraticPrior<Real> gradient;
  gradient.gradient_weight = plane;
  gradient.tikhonov_weight = plane;
  std::vector<Real> first;
  for (int run = 0; run < 3; ++run) {
    const auto steps = this->OnDevice(data);
    steps->SetPrior(gradient);
    steps->Start(data.photograph);
    for (int n = 0; n < 4; ++n) {
      const double squared = steps->UpdateResidual().squared;
      steps->UpdateSolution(steps->UpdateDirection(0.3) / (steps->ApplyNormalOperator() + squared));
    }
    if (run == 0) first = steps->Radiance();
    EXPECT_EQ(steps->Radiance(), first);
  }
}

}  // namespace
}  // namespace thicklens::kernels
