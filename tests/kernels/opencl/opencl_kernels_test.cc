#include "kernels/opencl/opencl_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "kernels/opencl/opencl_call.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/opencl_program.h"
#include "support/error_message.h"
#include "support/kernel_samples.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::BlockSize;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::RandomBlock;
using ::thicklens::testing::RandomCsr;
using ::thicklens::testing::RandomReals;

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

// A machine that runs the tests has an OpenCL device, so a missing one is a failure.
Backend* OpenClBackend() {
  static const std::shared_ptr<Backend> backend = [] {
    DeviceRequest request;
    request.kind = DeviceRequest::Kind::kOpenCl;
    return OpenBackend(request, nullptr);
  }();
  return backend.get();
}

// A number type, and how the device accesses its arrays. PoCL shares the host's memory, which would
// hide a missing copy to or from the device. Therefore copied memory is tested as well.
template <typename RealType, HostMemory kMemory>
struct Setting {
  using Real = RealType;
  static constexpr HostMemory memory = kMemory;
};

template <typename Real>
std::unique_ptr<Kernels<Real>> NewCopying() {
  const DeviceRequest place = ParseDeviceRequest(OpenClBackend()->name());
  static const auto device = OpenOpenClDevice(place.platform, place.device);
  static const cl::Program program =
      BuildKernels(*device, std::is_same_v<Real, float> ? "float" : "double");
  return NewOpenClKernelsOn<Real>(
      std::make_unique<OpenClQueue>(device, program, HostMemory::kCopied));
}

template <typename Setting>
std::unique_ptr<Kernels<typename Setting::Real>> NewOnDevice() {
  using Real = typename Setting::Real;
  if constexpr (Setting::memory == HostMemory::kCopied) {
    return NewCopying<Real>();
  } else if constexpr (std::is_same_v<Real, float>) {
    return OpenClBackend()->NewFloat();
  } else {
    return OpenClBackend()->NewDouble();
  }
}

// The largest difference, relative to the largest value of the reference.
template <typename Real>
double RelativeError(const std::vector<Real>& device, const std::vector<Real>& reference) {
  EXPECT_EQ(device.size(), reference.size());
  if (device.size() != reference.size()) return std::numeric_limits<double>::infinity();
  double scale = 0;
  double error = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    scale = std::max(scale, std::abs(static_cast<double>(reference[i])));
    const double difference =
        std::abs(static_cast<double>(device[i]) - static_cast<double>(reference[i]));
    if (!(difference <= error)) error = difference;  // also if it is NaN
  }
  return scale > 0 ? error / scale : error;
}

struct Case {
  std::string name;
  BlockSize size;
  int largest_shift;
};
const std::vector<Case>& Cases() {
  static const std::vector<Case> cases = {{"inside", {5, 4, 17, 13, 41, 33, 3, 3}, 3},
                                          {"corner", {0, 0, 7, 5, 23, 9, 5, 3}, 4},
                                          {"far corner", {18, 5, 5, 4, 23, 9, 2, 5}, 4},
                                          {"whole image", {0, 0, 53, 11, 53, 11, 3, 2}, 5},
                                          {"strips", {0, 0, 48, 3, 48, 3, 2, 2}, 1},
                                          {"beyond all sides", {-3, -2, 29, 13, 23, 9, 2, 2}, 2},
                                          {"one pixel", {3, 3, 1, 1, 8, 8, 3, 3}, 2},
                                          {"one view", {2, 1, 6, 5, 9, 9, 1, 1}, 2},
                                          {"one column", {0, 0, 1, 9, 1, 9, 5, 1}, 0},
                                          {"no ray", {40, 40, 3, 3, 9, 9, 2, 2}, 3}};
  return cases;
}

template <typename Setting>
class OpenClKernelsTest : public ::testing::Test {
 protected:
  using Number = typename Setting::Real;

  void ExpectAgreement(const EllMatrix<Number>& device, const EllMatrix<Number>& reference) const {
    EXPECT_EQ(device.rows, reference.rows);
    EXPECT_EQ(device.columns, reference.columns);
    EXPECT_EQ(device.slots, reference.slots);
    EXPECT_EQ(device.column, reference.column);
    EXPECT_LE(RelativeError(device.value, reference.value), kTolerance);
  }
  void ExpectAgreement(const std::vector<Number>& device,
                       const std::vector<Number>& reference) const {
    EXPECT_LE(RelativeError(device, reference), kTolerance);
  }

  static constexpr double kTolerance = sizeof(Number) == sizeof(float) ? 1e-4 : 1e-10;
  const std::unique_ptr<Kernels<Number>> device_ = NewOnDevice<Setting>();
  const std::unique_ptr<Kernels<Number>> reference_ = NewReference<Number>();
};

using Settings =
    ::testing::Types<Setting<float, HostMemory::kShared>, Setting<double, HostMemory::kShared>,
                     Setting<float, HostMemory::kCopied>, Setting<double, HostMemory::kCopied>>;
TYPED_TEST_SUITE(OpenClKernelsTest, Settings);

TYPED_TEST(OpenClKernelsTest, Projection) {
  using Real = typename TypeParam::Real;
  std::uint32_t seed = 0;
  for (const Case& c : Cases()) {
    for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) {
      SCOPED_TRACE(c.name);
      BlockGeometry block = RandomBlock(c.size, c.largest_shift, ++seed);
      const auto rays = this->reference_->FindRays(block, splat);
      EXPECT_EQ(this->device_->FindRays(block, splat), rays);
      const auto irradiance = RandomReals<Real>(Index(block.rays()), 0.5, 2, seed);
      this->ExpectAgreement(this->device_->WeightRays(block, splat, rays, irradiance),
                            this->reference_->WeightRays(block, splat, rays, irradiance));
      this->ExpectAgreement(this->device_->WeightRays(block, splat, rays, {}),
                            this->reference_->WeightRays(block, splat, rays, {}));
      // First some views have no weight, then all, which leaves rows without a sum.
      for (std::size_t view = 0; view < block.view_weight.size(); view += 2) {
        block.view_weight[view] = 0;
      }
      this->ExpectAgreement(this->device_->WeightRays(block, splat, rays, {}),
                            this->reference_->WeightRays(block, splat, rays, {}));
      std::fill(block.view_weight.begin(), block.view_weight.end(), 0);
      this->ExpectAgreement(this->device_->WeightRays(block, splat, rays, irradiance),
                            this->reference_->WeightRays(block, splat, rays, irradiance));
    }
  }
}

TYPED_TEST(OpenClKernelsTest, Masks) {
  using Real = typename TypeParam::Real;
  constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
  constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
  std::uint32_t seed = 100;
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    const BlockGeometry block = RandomBlock(c.size, c.largest_shift, ++seed);
    auto slope_u = RandomReals<Real>(Index(block.rays()), -2.5, 2.5, seed);
    auto slope_v = RandomReals<Real>(Index(block.rays()), -2.5, 2.5, seed + 100);
    for (std::size_t i = 0; i < slope_u.size(); i += 3) slope_u[i] = std::round(slope_u[i]);
    for (std::size_t i = 1; i < slope_v.size(); i += 3) slope_v[i] = std::round(slope_v[i]);
    const Real special[] = {kNan,       static_cast<Real>(-1e-12), kInfinity,
                            -kInfinity, static_cast<Real>(1e30),   static_cast<Real>(-3e9)};
    for (std::size_t i = 0; i < slope_u.size(); i += 7) slope_u[i] = special[i / 7 % 6];
    for (std::size_t i = 5; i < slope_v.size(); i += 7) slope_v[i] = special[i / 7 % 6];
    this->ExpectAgreement(this->device_->WarpDifferences(block, slope_u, slope_v),
                          this->reference_->WarpDifferences(block, slope_u, slope_v));
    // Without the squares of huge numbers: relative to them, any other difference would be
    // negligible.
    for (Real& slope : slope_u) slope = std::abs(slope) > 3 ? kNan : slope;
    for (Real& slope : slope_v) slope = std::abs(slope) > 3 ? kInfinity : slope;
    this->ExpectAgreement(this->device_->SixTermMasks(block, slope_u, slope_v),
                          this->reference_->SixTermMasks(block, slope_u, slope_v));
  }
}

TYPED_TEST(OpenClKernelsTest, SparseProducts) {
  using Real = typename TypeParam::Real;
  const int sizes[][2] = {{1, 1}, {67, 129}, {200, 31}, {5, 1}, {1, 300}};
  std::uint32_t seed = 200;
  for (const auto& [rows, columns] : sizes) {
    for (const double density : {0.0, 0.1, 1.0}) {
      SCOPED_TRACE(std::to_string(rows) + " x " + std::to_string(columns));
      const auto a = RandomCsr<Real>(rows, columns, density, ++seed);
      const auto x = RandomReals<Real>(Index(columns), -1, 1, seed);
      const auto y = RandomReals<Real>(Index(rows), -1, 1, seed);
      this->ExpectAgreement(this->device_->Multiply(a, x), this->reference_->Multiply(a, x));
      this->ExpectAgreement(this->device_->MultiplyTransposed(a, y),
                            this->reference_->MultiplyTransposed(a, y));
      // The pattern has more entries than the product.
      const CsrPattern pattern =
          SumPattern(NormalPattern(a), PatternOf(RandomCsr<float>(columns, columns, 0.2, seed)));
      auto on_device = RandomReals<Real>(pattern.column.size(), -1, 1, seed);
      auto expected = on_device;
      const auto scale = static_cast<Real>(0.7);
      this->device_->AddNormalProduct(a, scale, pattern, &on_device);
      this->reference_->AddNormalProduct(a, scale, pattern, &expected);
      this->ExpectAgreement(on_device, expected);
    }
  }
}

TYPED_TEST(OpenClKernelsTest, SystemOfABlock) {
  using Real = typename TypeParam::Real;
  const BlockGeometry block = RandomBlock({4, 3, 9, 7, 20, 20, 3, 3}, 2, 1);
  const auto slope = RandomReals<Real>(Index(block.rays()), -1, 1, 2);
  const auto h = Compress(this->reference_->WeightRays(
      block, Splat::kBilinear, this->reference_->FindRays(block, Splat::kBilinear), {}));
  const auto d = Compress(this->reference_->WarpDifferences(block, slope, slope));
  const CsrPattern pattern = SumPattern(NormalPattern(h), NormalPattern(d));
  std::vector<Real> on_device(pattern.column.size());
  std::vector<Real> expected(pattern.column.size());
  for (Kernels<Real>* kernels : {this->device_.get(), this->reference_.get()}) {
    auto* values = kernels == this->device_.get() ? &on_device : &expected;
    kernels->AddNormalProduct(h, 1, pattern, values);
    kernels->AddNormalProduct(d, static_cast<Real>(0.5), pattern, values);
  }
  this->ExpectAgreement(on_device, expected);
}

TYPED_TEST(OpenClKernelsTest, Image) {
  using Real = typename TypeParam::Real;
  std::uint32_t seed = 300;
  for (const Case& c : Cases()) {
    for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) {
      SCOPED_TRACE(c.name);
      BlockGeometry block = RandomBlock(c.size, c.largest_shift, ++seed);
      const std::size_t view_samples = Index(block.s_count) * Index(block.t_count);
      auto views = RandomReals<Real>(view_samples * Index(block.views()), -1, 1, seed);
      this->ExpectAgreement(this->device_->FormImage(block, splat, views),
                            this->reference_->FormImage(block, splat, views));
      // A view without weight is ignored.
      block.view_weight[0] = 0;
      std::fill_n(views.begin(), view_samples, std::numeric_limits<Real>::quiet_NaN());
      this->ExpectAgreement(this->device_->FormImage(block, splat, views),
                            this->reference_->FormImage(block, splat, views));
    }
  }
}

TYPED_TEST(OpenClKernelsTest, BlocksAddUp) {
  using Real = typename TypeParam::Real;
  std::uint32_t seed = 400;
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    const BlockGeometry block = RandomBlock(c.size, c.largest_shift, ++seed);
    for (Kernels<Real>* kernels : {this->device_.get(), this->reference_.get()}) {
      kernels->StartWhole(block.s_count, block.t_count, block.u_count, block.v_count, 3);
    }
    for (const int channel : {0, 2, 2}) {
      BlockGeometry shifted = block;
      shifted.first_x += channel;
      const auto rays = RandomReals<Real>(Index(block.rays()), -1, 1, ++seed);
      this->device_->AddBlock(shifted, channel, rays);
      this->reference_->AddBlock(shifted, channel, rays);
    }
    EXPECT_LE(RelativeError(this->device_->FinishWhole(), this->reference_->FinishWhole()), 1e-7);
  }
}

TYPED_TEST(OpenClKernelsTest, EmptyArgumentsHaveEmptyResults) {
  using Real = typename TypeParam::Real;
  BlockGeometry block = RandomBlock({0, 0, 0, 5, 9, 9, 2, 2}, 0, 1);
  const auto& device = this->device_;
  EXPECT_TRUE(device->FindRays(block, Splat::kBilinear).empty());
  EXPECT_TRUE(device->WeightRays(block, Splat::kBilinear, {}, {}).value.empty());
  EXPECT_EQ(device->WarpDifferences(block, {}, {}).rows, 0);
  EXPECT_EQ(device->SixTermMasks(block, {}, {}).rows, 0);
  EXPECT_TRUE(device->Multiply({}, {}).empty());
  EXPECT_TRUE(device->MultiplyTransposed({}, {}).empty());
  EXPECT_EQ(device->MultiplyTransposed({0, 3, {0}, {}, {}}, {}), std::vector<Real>(3));
  std::vector<Real> nothing;
  device->AddNormalProduct({}, 1, {}, &nothing);
  EXPECT_TRUE(device->FormImage(block, Splat::kNearest, std::vector<Real>(Index(4 * 81))).empty());
  device->StartWhole(9, 9, 2, 2, 1);
  device->AddBlock(block, 0, {});
  EXPECT_EQ(device->FinishWhole(), std::vector<float>(Index(4 * 81)));

  // A block without a view, and a light field without samples.
  block = RandomBlock({0, 0, 3, 5, 9, 9, 0, 2}, 0, 1);
  EXPECT_TRUE(device->FindRays(block, Splat::kBilinear).empty());
  EXPECT_EQ(device->FormImage(block, Splat::kNearest, {}), std::vector<Real>(15));
  block = RandomBlock({0, 0, 3, 5, 0, 9, 2, 1}, 0, 1);
  EXPECT_EQ(device->FindRays(block, Splat::kNearest), std::vector<std::int32_t>(30, -1));
  EXPECT_EQ(device->FormImage(block, Splat::kNearest, {}), std::vector<Real>(15));
  device->StartWhole(0, 9, 2, 1, 3);
  device->AddBlock(block, 2, std::vector<Real>(30));
  EXPECT_TRUE(device->FinishWhole().empty());
}

TYPED_TEST(OpenClKernelsTest, WrongArgumentsAreRefusedAsByTheReference) {
  using Real = typename TypeParam::Real;
  const BlockGeometry block = RandomBlock({0, 0, 3, 2, 9, 9, 2, 1}, 0, 1);
  const std::vector<Real> short_one(11);
  const auto a = RandomCsr<Real>(3, 4, 0.5, 1);
  std::vector<Real> values;
  const auto both = [&](const auto& call) {
    const std::string said = ErrorOf([&] { call(this->reference_.get()); });
    EXPECT_NE(said, "(no error)");
    EXPECT_EQ(ErrorOf([&] { call(this->device_.get()); }), said);
  };
  using K = Kernels<Real>;
  BlockGeometry bad = block;
  bad.s_shift.clear();
  both([&](K* k) { k->FindRays(bad, Splat::kNearest); });
  both([&](K* k) { k->WeightRays(block, Splat::kNearest, {1}, {}); });
  both([&](K* k) {
    k->WeightRays(block, Splat::kNearest, std::vector<std::int32_t>(12), short_one);
  });
  both([&](K* k) { k->WarpDifferences(block, short_one, short_one); });
  both([&](K* k) { k->SixTermMasks(block, short_one, short_one); });
  both([&](K* k) { k->Multiply(a, short_one); });
  both([&](K* k) { k->MultiplyTransposed(a, short_one); });
  both([&](K* k) { k->AddNormalProduct(a, 1, NormalPattern(a), &values); });
  both([&](K* k) { k->FormImage(block, Splat::kNearest, short_one); });
  both([&](K* k) { k->StartWhole(9, 9, -1, 1, 1); });
  both([&](K* k) { k->AddBlock(block, 0, std::vector<Real>(12)); });
}

TYPED_TEST(OpenClKernelsTest, WhatTheDeviceCannotAllocateIsNamed) {
  const std::string said = ErrorOf([&] { this->device_->StartWhole(10000, 10000, 1000, 1000, 1); });
  EXPECT_NE(said.find("400000000000000 bytes are needed"), std::string::npos) << said;
  EXPECT_NE(said.find("channel of the light field"), std::string::npos) << said;
  EXPECT_NE(said.find("the device cpu has no such limit"), std::string::npos) << said;
  // The device still works afterwards.
  this->device_->StartWhole(2, 2, 1, 1, 1);
  EXPECT_EQ(this->device_->FinishWhole().size(), 4U);
}

TYPED_TEST(OpenClKernelsTest, ClonesWorkAtTheSameTime) {
  using Real = typename TypeParam::Real;
  constexpr int kThreads = 2;
  std::vector<std::unique_ptr<Kernels<Real>>> clones;
  for (int i = 0; i < kThreads; ++i) clones.push_back(this->device_->Clone());
  std::vector<std::string> failures(kThreads);
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, i] {
      Kernels<Real>& device = *clones[Index(i)];
      const auto reference = NewReference<Real>();
      for (std::uint32_t round = 0; round < 20 && failures[Index(i)].empty(); ++round) {
        const std::uint32_t seed = round + static_cast<std::uint32_t>(1000 * i);
        const BlockGeometry block = RandomBlock({4, 3, 9 + i, 7, 20, 20, 3, 3}, 2, seed);
        const auto rays = device.FindRays(block, Splat::kBilinear);
        const auto h = device.WeightRays(block, Splat::kBilinear, rays, {});
        const auto x = RandomReals<Real>(Index(block.rays()), -1, 1, seed);
        const auto product = device.Multiply(Compress(h), x);
        const auto true_rays = reference->FindRays(block, Splat::kBilinear);
        const auto true_h = reference->WeightRays(block, Splat::kBilinear, true_rays, {});
        if (rays != true_rays) failures[Index(i)] = "rays";
        if (RelativeError(product, reference->Multiply(Compress(true_h), x)) > this->kTolerance) {
          failures[Index(i)] += " product";
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(failures, std::vector<std::string>(kThreads));
}

TYPED_TEST(OpenClKernelsTest, TheSameBitsEveryTime) {
  using Real = typename TypeParam::Real;
  const BlockGeometry block = RandomBlock({0, 0, 53, 11, 53, 11, 3, 2}, 3, 1);
  const auto views = RandomReals<Real>(53 * 11 * 6, -1, 1, 2);
  const auto once = this->device_->FormImage(block, Splat::kBilinear, views);
  EXPECT_EQ(this->device_->FormImage(block, Splat::kBilinear, views), once);
  EXPECT_EQ(this->device_->Clone()->FormImage(block, Splat::kBilinear, views), once);
}

// Memory that is lent to the device is freed when an error or a request to stop unwinds its owner.
TEST(DeviceArray, WaitsForCallsThatWorkInItBeforeItGoes) {
  const DeviceRequest place = ParseDeviceRequest(OpenClBackend()->name());
  const auto device = OpenOpenClDevice(place.platform, place.device);
  cl::Program program(device->context, std::string(R"(
      kernel void CountUp(global volatile int* values) {
        for (int i = 0; i < 20000000; ++i) ++values[get_global_id(0)];
      })"));
  program.build();
  OpenClQueue queue(device, program, HostMemory::kShared);
  std::vector<std::int32_t> values(4096, 0);
  {
    DeviceArray array(&queue, "values", values.data(), values.size() * sizeof(std::int32_t));
    OpenClCall call(&queue, "CountUp");
    call.OnDevice(array).Enqueue(1);
  }
  const std::vector<std::int32_t> after = values;
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(values, after);
}

}  // namespace
}  // namespace thicklens::kernels
