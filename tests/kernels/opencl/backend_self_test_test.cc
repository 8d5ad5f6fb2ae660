#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {
namespace {

using ::testing::HasSubstr;

// A fault of a device: `method` adds `amount` to one of its numbers.
struct Fault {
  std::string method;
  double amount = 0;
  bool has_double = true;
};

// The reference with a fault. In each result the last number but one is changed.
template <typename Real>
class Faulty : public Kernels<Real> {
 public:
  explicit Faulty(Fault fault) : fault_(std::move(fault)), reference_(NewReference<Real>()) {}

  std::unique_ptr<Kernels<Real>> Clone() const override { return std::make_unique<Faulty>(fault_); }
  std::vector<std::int32_t> FindRays(const BlockGeometry& block, Splat splat) override {
    auto rays = reference_->FindRays(block, splat);
    if (fault_.method == "FindRays") ++rays.back();
    return rays;
  }
  EllMatrix<Real> WeightRays(const BlockGeometry& block, Splat splat,
                             const std::vector<std::int32_t>& rays,
                             const std::vector<Real>& irradiance) override {
    return Spoil("WeightRays", reference_->WeightRays(block, splat, rays, irradiance));
  }
  EllMatrix<Real> WarpDifferences(const BlockGeometry& block, const std::vector<Real>& slope_u,
                                  const std::vector<Real>& slope_v) override {
    return Spoil("WarpDifferences", reference_->WarpDifferences(block, slope_u, slope_v));
  }
  EllMatrix<Real> SixTermMasks(const BlockGeometry& block, const std::vector<Real>& slope_u,
                               const std::vector<Real>& slope_v) override {
    return Spoil("SixTermMasks", reference_->SixTermMasks(block, slope_u, slope_v));
  }
  std::vector<Real> Multiply(const CsrMatrix<Real>& a, const std::vector<Real>& x) override {
    return Spoil("Multiply", reference_->Multiply(a, x));
  }
  std::vector<Real> MultiplyTransposed(const CsrMatrix<Real>& a,
                                       const std::vector<Real>& x) override {
    return Spoil("MultiplyTransposed", reference_->MultiplyTransposed(a, x));
  }
  void AddNormalProduct(const CsrMatrix<Real>& a, Real scale, const CsrPattern& pattern,
                        std::vector<Real>* values) override {
    reference_->AddNormalProduct(a, scale, pattern, values);
    *values = Spoil("AddNormalProduct", *values);
  }
  std::vector<Real> FormImage(const BlockGeometry& whole, Splat splat,
                              const std::vector<Real>& views) override {
    return Spoil("FormImage", reference_->FormImage(whole, splat, views));
  }
  void StartWhole(int s_count, int t_count, int u_count, int v_count, int channels) override {
    reference_->StartWhole(s_count, t_count, u_count, v_count, channels);
  }
  void AddBlock(const BlockGeometry& block, int channel, const std::vector<Real>& rays) override {
    reference_->AddBlock(block, channel, rays);
  }
  std::vector<float> FinishWhole() override { return Spoil("AddBlock", reference_->FinishWhole()); }

 private:
  template <typename Number>
  std::vector<Number> Spoil(const std::string& method, std::vector<Number> numbers) const {
    if (method == fault_.method && numbers.size() > 1) {
      numbers[numbers.size() - 2] += static_cast<Number>(fault_.amount);
    }
    return numbers;
  }
  EllMatrix<Real> Spoil(const std::string& method, EllMatrix<Real> matrix) const {
    matrix.value = Spoil(method, matrix.value);
    if (fault_.method == method + " columns") ++matrix.column.front();
    return matrix;
  }

  Fault fault_;
  std::unique_ptr<Kernels<Real>> reference_;
};

// The native steps with a fault: sums are wrong by that relative amount, and in images the last
// number but one is changed.
template <typename Real>
class FaultySteps : public RadianceSteps<Real> {
 public:
  FaultySteps(Fault fault, const DataTerm<Real>& data)
      : fault_(std::move(fault)), cpu_(NewCpuRadianceSteps(data)) {}

  void SetPrior(const QuadraticPrior<Real>& prior) override { cpu_->SetPrior(prior); }
  void SetVariation(const TotalVariation<Real>& variation) override {
    cpu_->SetVariation(variation);
  }
  void ReweightVariation() override { cpu_->ReweightVariation(); }
  void Start(const std::vector<Real>& x) override { cpu_->Start(x); }
  void StartFor(const std::vector<Real>& photograph, const std::vector<Real>& x) override {
    cpu_->StartFor(photograph, x);
  }
  double SquaredRightSide() override { return Spoil("SquaredRightSide", cpu_->SquaredRightSide()); }
  ResidualSums UpdateResidual() override {
    ResidualSums sums = cpu_->UpdateResidual();
    sums.squared = Spoil("UpdateResidual", sums.squared);
    return sums;
  }
  double UpdateDirection(double beta) override {
    return Spoil("UpdateDirection", cpu_->UpdateDirection(beta));
  }
  double ApplyNormalOperator() override {
    return Spoil("ApplyNormalOperator", cpu_->ApplyNormalOperator());
  }
  void UpdateSolution(double step) override { cpu_->UpdateSolution(step); }
  std::vector<Real> Radiance() override { return Spoil("UpdateSolution", cpu_->Radiance()); }
  std::vector<Real> Project(const std::vector<Real>& x) override {
    return Spoil("Project", cpu_->Project(x));
  }
  std::vector<Real> ProjectTransposed(const std::vector<Real>& y) override {
    return Spoil("ProjectTransposed", cpu_->ProjectTransposed(y));
  }

 private:
  double Spoil(const std::string& method, double sum) const {
    return method == fault_.method ? sum * (1 + fault_.amount) : sum;
  }
  std::vector<Real> Spoil(const std::string& method, std::vector<Real> numbers) const {
    if (method == fault_.method) {
      numbers[numbers.size() - 2] += static_cast<Real>(fault_.amount);
    }
    return numbers;
  }

  Fault fault_;
  std::unique_ptr<RadianceSteps<Real>> cpu_;
};

class FaultyWarp : public ViewWarp {
 public:
  FaultyWarp(Fault fault, const SurfaceImage& image)
      : fault_(std::move(fault)), cpu_(NewReferenceWarp(image)) {}
  void Warp(const ViewSources& view, std::vector<float>* values) override {
    cpu_->Warp(view, values);
    if (fault_.method == "WarpView") (*values)[7] += static_cast<float>(fault_.amount);
  }

 private:
  Fault fault_;
  std::unique_ptr<ViewWarp> cpu_;
};

class FaultyBackend : public Backend {
 public:
  FaultyBackend(Fault in_float, Fault in_double)
      : in_float_(std::move(in_float)), in_double_(std::move(in_double)) {}
  bool is_opencl() const override { return false; }
  bool has_double() const override { return in_double_.has_double; }
  std::string name() const override { return "faulty"; }
  std::string description() const override { return "faulty"; }
  std::unique_ptr<Kernels<float>> NewFloat() override {
    return std::make_unique<Faulty<float>>(in_float_);
  }
  std::unique_ptr<Kernels<double>> NewDouble() override {
    return std::make_unique<Faulty<double>>(in_double_);
  }
  std::unique_ptr<RadianceSteps<float>> NewSteps(const DataTerm<float>& data) override {
    return std::make_unique<FaultySteps<float>>(in_float_, data);
  }
  std::unique_ptr<RadianceSteps<double>> NewSteps(const DataTerm<double>& data) override {
    return std::make_unique<FaultySteps<double>>(in_double_, data);
  }
  std::unique_ptr<ViewWarp> NewWarp(const SurfaceImage& image) override {
    return std::make_unique<FaultyWarp>(in_float_, image);
  }

 private:
  Fault in_float_, in_double_;
};

BackendSelfTest Check(const Fault& in_float, const Fault& in_double) {
  FaultyBackend backend(in_float, in_double);
  return RunBackendSelfTest(&backend);
}

TEST(Agreement, TheReferenceAgreesWithItself) {
  const BackendSelfTest check = Check({}, {});
  EXPECT_TRUE(check.agrees);
  EXPECT_EQ(check.float_error, 0);
  EXPECT_EQ(check.double_error, 0);
}

// A wrong number in any of the methods is detected and reported, in both precisions.
TEST(Agreement, SeesAFaultOfEveryMethod) {
  for (const char* method :
       {"FindRays", "WeightRays", "WarpDifferences", "SixTermMasks", "Multiply",
        "MultiplyTransposed", "AddNormalProduct", "FormImage", "AddBlock", "WeightRays columns",
        "WarpDifferences columns", "SixTermMasks columns", "SquaredRightSide", "UpdateResidual",
        "UpdateDirection", "ApplyNormalOperator", "UpdateSolution", "Project",
        "ProjectTransposed"}) {
    const std::string name = std::string(method).substr(0, std::string(method).find(' '));
    const BackendSelfTest in_float = Check({method, 0.01}, {});
    EXPECT_FALSE(in_float.agrees) << method;
    EXPECT_GT(in_float.float_error, 1e-4) << method;
    EXPECT_EQ(in_float.double_error, 0) << method;
    EXPECT_EQ(in_float.worst, name + " in float");
    const BackendSelfTest in_double = Check({}, {method, 0.01});
    EXPECT_FALSE(in_double.agrees) << method;
    EXPECT_EQ(in_double.float_error, 0) << method;
    EXPECT_GT(in_double.double_error, 1e-10) << method;
    EXPECT_EQ(in_double.worst, name + " in double");
  }
}

// Views are made in float only.
TEST(Agreement, SeesAFaultyView) {
  const BackendSelfTest check = Check({"WarpView", 0.01}, {});
  EXPECT_FALSE(check.agrees);
  EXPECT_GT(check.float_error, 1e-4);
  EXPECT_EQ(check.worst, "WarpView in float");
}

TEST(Agreement, HasItsLimits) {
  EXPECT_TRUE(Check({"FormImage", 1e-6}, {}).agrees);
  EXPECT_FALSE(Check({"FormImage", 1e-3}, {}).agrees);
  EXPECT_TRUE(Check({}, {"FormImage", 1e-12}).agrees);
  EXPECT_FALSE(Check({}, {"FormImage", 1e-9}).agrees);
  // The values of images are between 0 and 1.
  EXPECT_NEAR(Check({"FormImage", 1e-3}, {}).float_error, 1e-3, 1e-3);
}

// Comparisons of NaN with < are always false, so NaN needs a check of its own.
TEST(Agreement, NoNumberIsADifference) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Check({"Multiply", nan}, {}).agrees);
  EXPECT_FALSE(Check({}, {"AddBlock", nan}).agrees);
}

TEST(Agreement, WithoutDoubleTheFloatDecides) {
  const Fault no_double = {"", 0, false};
  const BackendSelfTest check = Check({}, no_double);
  EXPECT_TRUE(check.agrees);
  EXPECT_TRUE(std::isnan(check.double_error));
  EXPECT_FALSE(Check({"Multiply", 1}, no_double).agrees);
}

TEST(Agreement, TheDeviceAgrees) {
  const auto backend = OpenBackend(ParseDeviceRequest("opencl"), nullptr);
  const BackendSelfTest check = RunBackendSelfTest(backend.get());
  EXPECT_TRUE(check.agrees) << check.worst;
  EXPECT_LE(check.float_error, 1e-4);
}

}  // namespace
}  // namespace thicklens::kernels
