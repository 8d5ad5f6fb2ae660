#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/opencl/backend_self_test.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::kernels {
namespace {

constexpr int kWidth = 37;  // size of the images, px
constexpr int kHeight = 9;
constexpr int kPixels = kWidth * kHeight;
constexpr int kChannels = 3;
constexpr int kRadius = 3;
constexpr int kSteps = 3;  // steps for each prior

template <typename Real>
VaryingFilter<Real> MakeFilter(Axis axis, PortableRng* numbers) {
  VaryingFilter<Real> filter{axis, kWidth, kHeight, {}, {0}, {}};
  for (int y = 0; y < kHeight; ++y) {
    const int radius = y % (kRadius + 1);
    filter.radius_px.push_back(radius);
    for (int n = -radius; n <= radius; ++n) {
      for (int x = 0; x < kFilterBlockPx; ++x) {
        const int from = (axis == Axis::kAcross ? x : y) + n;
        const bool inside =
            x < kWidth && from >= 0 && from < (axis == Axis::kAcross ? kWidth : kHeight);
        filter.coefficients.push_back(inside ? static_cast<Real>(numbers->Between(0, 0.5))
                                             : Real{0});
      }
    }
    filter.start.push_back(filter.coefficients.size());
  }
  return filter;
}

// Rows of every fourth pixel, with 0 to 12 entries.
template <typename Real>
PixelCsr<Real> MakeRows(PortableRng* numbers) {
  PixelCsr<Real> rows;
  rows.pixels = kPixels;
  rows.start = {0};
  for (int pixel = 1; pixel < kPixels; pixel += 4) {
    rows.pixel.push_back(pixel);
    for (int entry = 0; entry < pixel % 13; ++entry) {
      rows.index.push_back(static_cast<std::int32_t>(numbers->Between(0, kPixels - 0.5)));
      rows.weight.push_back(static_cast<Real>(numbers->Between(0, 0.3)));
    }
    rows.start.push_back(static_cast<std::int64_t>(rows.index.size()));
  }
  return rows;
}

template <typename Real>
class StepsComparison {
 public:
  StepsComparison()
      : across_(MakeFilter<Real>(Axis::kAcross, &numbers_)),
        down_(MakeFilter<Real>(Axis::kDown, &numbers_)),
        rows_(RunsOf(MakeRows<Real>(&numbers_), kWidth)) {
    data_.width_px = kWidth;
    data_.height_px = kHeight;
    data_.channels = kChannels;
    data_.filters = {{{&across_, &down_}}, &rows_};
    data_.projection.apply = [this](const Real* x, int channels, Real* y) {
      Project(x, channels, y);
    };
    data_.projection.apply_transposed = [this](const Real* y, int channels, Real* x) {
      ProjectTransposed(y, channels, x);
    };
    data_.photograph = numbers_.Vector<Real>(kChannels * kPixels, 0.1, 1);
    data_.weight = numbers_.Vector<Real>(kPixels, 0.5, 1);
    data_.row_norm2 = numbers_.Vector<Real>(kPixels, 0.5, 1);
  }

  void Run(Backend* backend, MaxError* worst) {
    device_ = backend->NewSteps(data_);
    cpu_ = NewCpuRadianceSteps(data_);
    worst_ = worst;
    const auto plane = numbers_.Vector<Real>(kPixels, 0.1, 1);
    ForBoth([&](RadianceSteps<Real>* steps) {
      steps->SetPrior({{}, plane, true});
      steps->Start(data_.photograph);
    });
    CompareIterations(false);
    const auto target = numbers_.Vector<Real>(kChannels * kPixels, 0.1, 1);
    ForBoth([&](RadianceSteps<Real>* steps) {
      steps->SetPrior({{}, plane, false, target});
      steps->Start(data_.photograph);
    });
    CompareIterations(false);
    ForBoth([&](RadianceSteps<Real>* steps) {
      steps->SetPrior({plane, plane, false});
      steps->SetVariation({&plane, 0.1, 0.05, 0.02});
      steps->Start(data_.photograph);
    });
    CompareIterations(true);
    Add("Project", device_->Project(data_.photograph), cpu_->Project(data_.photograph));
    Add("ProjectTransposed", device_->ProjectTransposed(data_.photograph),
        cpu_->ProjectTransposed(data_.photograph));
  }

 private:
  void Project(const Real* x, int channels, Real* y) {
    std::vector<Real> between(Index(channels) * kPixels);
    Apply(across_, {x, kPixels, channels}, {between.data(), kPixels, channels}, 1);
    Apply(down_, {between.data(), kPixels, channels}, {y, kPixels, channels}, 1);
    ApplyRuns(rows_, {x, kPixels, channels}, {y, kPixels, channels}, 1);
  }

  void ProjectTransposed(const Real* y, int channels, Real* x) {
    std::vector<Real> without_rows(y, y + Index(channels) * kPixels);
    for (int channel = 0; channel < channels; ++channel) {
      for (const std::int32_t pixel : rows_.pixel) {
        without_rows[Index(channel) * kPixels + Index(pixel)] = 0;
      }
    }
    std::vector<Real> between(without_rows.size());
    ApplyTransposed(down_, {without_rows.data(), kPixels, channels},
                    {between.data(), kPixels, channels}, 1);
    ApplyTransposed(across_, {between.data(), kPixels, channels}, {x, kPixels, channels}, 1);
    AddTransposed(rows_, {y, kPixels, channels}, {x, kPixels, channels}, 1);
  }

  template <typename Work>
  void ForBoth(const Work& work) {
    work(device_.get());
    work(cpu_.get());
  }

  void Add(const char* what, const std::vector<Real>& found, const std::vector<Real>& right) {
    worst_->Add(what, Difference(found, right));
  }
  void AddSum(const char* what, double found, double right) {
    worst_->Add(what, Difference<double>({found}, {right}));
  }

  // Both continue with the step length of the native result, so that differences do not accumulate.
  void CompareIterations(bool touch) {
    AddSum("SquaredRightSide", device_->SquaredRightSide(), cpu_->SquaredRightSide());
    for (int step = 0; step < kSteps; ++step) {
      if (touch) ForBoth([](RadianceSteps<Real>* steps) { steps->ReweightVariation(); });
      const ResidualSums found = device_->UpdateResidual();
      const ResidualSums right = cpu_->UpdateResidual();
      AddSum("UpdateResidual", found.squared, right.squared);
      AddSum("UpdateResidual", found.preconditioned, right.preconditioned);
      const double beta = step == 0 ? 0 : 0.25;
      const double steepness = cpu_->UpdateDirection(beta);
      AddSum("UpdateDirection", device_->UpdateDirection(beta), steepness);
      const double curvature = cpu_->ApplyNormalOperator();
      AddSum("ApplyNormalOperator", device_->ApplyNormalOperator(), curvature);
      const double length = steepness / curvature;
      ForBoth([&](RadianceSteps<Real>* steps) { steps->UpdateSolution(length); });
    }
    Add("UpdateSolution", device_->Radiance(), cpu_->Radiance());
  }

  PortableRng numbers_;
  const VaryingFilter<Real> across_, down_;
  const PixelBlockedCsr<Real> rows_;
  DataTerm<Real> data_;
  std::unique_ptr<RadianceSteps<Real>> device_, cpu_;
  MaxError* worst_ = nullptr;
};

}  // namespace

template <typename Real>
void CompareSteps(Backend* device, MaxError* worst) {
  StepsComparison<Real>().Run(device, worst);
}
template void CompareSteps<float>(Backend*, MaxError*);
template void CompareSteps<double>(Backend*, MaxError*);

}  // namespace thicklens::kernels
