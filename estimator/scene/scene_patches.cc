#include "estimator/scene/scene_patches.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "estimator/scene/encoding_slope.h"
#include "estimator/scene/guided_shading.h"
#include "thicklens/kernels/patch_filter.h"

namespace thicklens::estimator {
namespace {

// These values were chosen on rendered and simulated scenes with noise of 0.3 to 3 grey levels.
constexpr double kMinVariation = 0.5;
constexpr double kExplained = 0.7;  // sigma_p/sigma of a photograph that H explains
constexpr int kAroundPx = 4;
// Values for a noise of one grey level; both grow with the noise.
constexpr double kThreshold = 8.1;  // grey levels
constexpr double kPull = 0.15;
constexpr double kThresholdPower = 0.6;
constexpr double kPullPower = 2 * (1 - kThresholdPower);  // as (noise/threshold)^2

// s G, the shading in encoded values; 0 where there is no shading.
template <typename Real>
class EncodedShading {
 public:
  EncodedShading(const std::vector<Real>& shading, const std::vector<Real>& slope_squared)
      : shading_(shading), slope_squared_(slope_squared) {}
  Real operator()(std::size_t i) const {
    return shading_.empty() ? Real{0}
                            : shading_[i] * std::sqrt(slope_squared_[i % slope_squared_.size()]);
  }

 private:
  const std::vector<Real>& shading_;
  const std::vector<Real>& slope_squared_;
};

// Returns v of a radiance.
template <typename Real>
std::vector<Real> Filtered(const PatchPrior& prior, const DataTerm<Real>& data,
                           const std::vector<Real>& radiance, const EncodedShading<Real>& shading) {
  const double threshold = kThreshold / 255 * std::pow(255 * prior.noise_sigma, kThresholdPower);
  std::vector<Real> values(radiance.size());
  const auto convert = [&](const auto& one) {
    ForFixedBands(data.height_px * data.channels, data.threads, [&](int y0, int y1) {
      const auto width = static_cast<std::size_t>(data.width_px);
      for (std::size_t i = static_cast<std::size_t>(y0) * width;
           i < static_cast<std::size_t>(y1) * width; ++i) {
        values[i] = static_cast<Real>(one(i));
      }
    });
  };
  const EncodedValueTable table(prior.transfer);
  convert([&](std::size_t i) {
    return static_cast<Real>(table.Encode(static_cast<float>(radiance[i]))) - shading(i);
  });
  values = kernels::FilterPatches(data.width_px, data.height_px, data.channels, values, threshold,
                                  data.threads);
  convert([&](std::size_t i) {
    return prior.transfer.Decode(static_cast<double>(values[i] + shading(i)));
  });
  return values;
}

}  // namespace

template <typename Real>
std::vector<Real> LocalVariation(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                                 const std::vector<Real>& radiance, double noise_sigma) {
  std::vector<Real> shown(radiance.size());
  data.projection.apply(radiance.data(), data.channels, shown.data());
  for (const std::size_t i : data.bounds) shown[i] = std::min(shown[i], data.photograph[i]);
  std::vector<double> squares(data.pixels());
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const std::size_t pixel = i % data.pixels();
    const double left = static_cast<double>(shown[i]) - static_cast<double>(data.photograph[i]);
    squares[pixel] += static_cast<double>(slope_squared[pixel]) * left * left / data.channels;
  }
  cv::Mat around(data.height_px, data.width_px, CV_64F, squares.data());
  constexpr int kSize = 2 * kAroundPx + 1;
  cv::blur(around, around, {kSize, kSize}, {-1, -1}, cv::BORDER_REPLICATE);
  const double explained = kExplained * kExplained * noise_sigma * noise_sigma;
  std::vector<Real> shares;
  shares.reserve(squares.size());
  for (const double square : squares) {
    const double share = kMinVariation * std::pow(std::max(square, 0.0) / explained, 0.75);
    shares.push_back(static_cast<Real>(std::clamp(share, kMinVariation, 1.0)));
  }
  return shares;
}

namespace {

// The steps of one solution. The systems of the radiance share one limit of iterations.
template <typename Real>
class PatchRun {
 public:
  PatchRun(const PatchPrior& prior, const DataTerm<Real>& data,
           const std::vector<Real>& slope_squared, const RadianceLimits& limits,
           kernels::Backend* backend)
      : prior_(prior),
        data_(data),
        slope_squared_(slope_squared),
        limits_(limits),
        left_(limits),
        backend_(backend) {}

  void SolveVariation(const DataTerm<Real>& data, const std::vector<Real>& slopes,
                      SceneSystem<Real>* system, std::vector<Real>* radiance) {
    const RadianceOutcome outcome = SolveRadiance(Prior::kTotalVariation, prior_.strength, data,
                                                  slopes, left_, system, radiance);
    whole_.reweightings += outcome.reweightings;
    Count(outcome.iterations);
  }

  // Returns G and subtracts from r the part of it that the photograph contains; this is the start
  // of u. Returns an empty vector and leaves r unchanged if that part is not found within the limit
  // of iterations.
  std::vector<Real> TakeShading(std::vector<Real>* radiance) {
    const ShadingGuide<Real> guide = ShadingGuideOf<Real>(*prior_.disparity, prior_.guide_slope);
    std::vector<Real> estimated = guide.normals;
    if (!Estimate(*radiance, &estimated)) return {};
    GuidedShading<Real> shading =
        FitShading(guide, estimated, *radiance, data_.width_px, data_.height_px, data_.threads);
    AddTo(shading.already, -1, radiance);
    return std::move(shading.sharp);
  }

  // The last step: r near v. `radiance` and the data are without the shading.
  void SolveNearFiltered(const DataTerm<Real>& data, const std::vector<Real>& shading,
                         SceneSystem<Real>* system, std::vector<Real>* radiance) {
    QuadraticPrior<Real> near_filtered;
    near_filtered.target = *radiance;
    AddTo(shading, 1, &near_filtered.target);
    near_filtered.target =
        Filtered(prior_, data, near_filtered.target, EncodedShading(shading, slope_squared_));
    AddTo(shading, -1, &near_filtered.target);
    near_filtered.tikhonov_weight = slope_squared_;
    const double share = kPull * std::pow(255 * prior_.noise_sigma, kPullPower);
    for (Real& tikhonov_weight : near_filtered.tikhonov_weight)
      tikhonov_weight *= static_cast<Real>(share);
    system->SetPrior(near_filtered);
    *radiance = std::move(near_filtered.target);
    Count(system->Solve(CgOfWhatIsLeft(), radiance).iterations);
    whole_.relative_residual = system->RelativeResidual(*radiance);
    whole_.converged = whole_.relative_residual <= left_.tolerance;
  }

  const RadianceOutcome& whole() const { return whole_; }

  static void AddTo(const std::vector<Real>& shading, Real sign, std::vector<Real>* radiance) {
    for (std::size_t i = 0; i < shading.size(); ++i) (*radiance)[i] += sign * shading[i];
  }

 private:
  // Replaces sharp planes by the estimate from a photograph of them, made with the quadratic that
  // touches the total variation at `radiance`. Its iterations do not count against the limit of r,
  // which must not end early because of them. Returns false if it does not converge.
  bool Estimate(const std::vector<Real>& radiance, std::vector<Real>* planes) {
    DataTerm<Real> of_planes = data_;
    of_planes.bounds.clear();
    of_planes.channels = static_cast<int>(planes->size() / data_.pixels());
    of_planes.photograph.resize(planes->size());
    data_.projection.apply(planes->data(), of_planes.channels, of_planes.photograph.data());
    SceneSystem<Real> system(of_planes, backend_);
    system.SetPrior(ReweightedPrior(data_, slope_squared_, prior_.strength, radiance));
    const CgOutcome outcome =
        system.Solve({limits_.tolerance, limits_.max_iterations, limits_.on_iteration}, planes);
    whole_.iterations += outcome.iterations;
    return outcome.converged;
  }

  CgLimits CgOfWhatIsLeft() const {
    return {left_.tolerance, left_.max_iterations, left_.on_iteration};
  }
  void Count(int iterations) {
    whole_.iterations += iterations;
    left_.max_iterations -= iterations;
  }

  const PatchPrior& prior_;
  const DataTerm<Real>& data_;
  const std::vector<Real>& slope_squared_;
  const RadianceLimits& limits_;
  RadianceLimits left_;
  kernels::Backend* backend_;
  RadianceOutcome whole_;
};

}  // namespace

template <typename Real>
RadianceOutcome SolveWithPatches(const PatchPrior& prior, const DataTerm<Real>& data,
                                 const std::vector<Real>& slope_squared,
                                 const RadianceLimits& limits,
                                 std::unique_ptr<SceneSystem<Real>> system,
                                 kernels::Backend* backend, std::vector<Real>* radiance) {
  PatchRun<Real> run(prior, data, slope_squared, limits, backend);
  run.SolveVariation(data, slope_squared, system.get(), radiance);
  std::vector<Real> shading;
  std::optional<DataTerm<Real>> without_shading;
  if (prior.guide_slope >= kMinShadingGuideSlope) {
    system.reset();  // a device holds one at a time
    shading = run.TakeShading(radiance);
    if (!shading.empty()) {
      without_shading = data;
      std::vector<Real> shown(shading.size());
      data.projection.apply(shading.data(), data.channels, shown.data());
      PatchRun<Real>::AddTo(shown, -1, &without_shading->photograph);
    }
  }
  const DataTerm<Real>& rest = without_shading ? *without_shading : data;
  if (!system) system = std::make_unique<SceneSystem<Real>>(rest, backend);
  // The factor applies to the square of the slopes: f s |dr| replaces s |dr|.
  std::vector<Real> slopes = LocalVariation(rest, slope_squared, *radiance, prior.noise_sigma);
  for (std::size_t i = 0; i < slopes.size(); ++i) slopes[i] *= slopes[i] * slope_squared[i];
  run.SolveVariation(rest, slopes, system.get(), radiance);
  run.SolveNearFiltered(rest, shading, system.get(), radiance);
  PatchRun<Real>::AddTo(shading, 1, radiance);
  return run.whole();
}

#define THICKLENS_PATCHES(Real)                                                                  \
  template RadianceOutcome SolveWithPatches(                                                     \
      const PatchPrior&, const DataTerm<Real>&, const std::vector<Real>&, const RadianceLimits&, \
      std::unique_ptr<SceneSystem<Real>>, kernels::Backend*, std::vector<Real>*);                \
  template std::vector<Real> LocalVariation(const DataTerm<Real>&, const std::vector<Real>&,     \
                                            const std::vector<Real>&, double);
THICKLENS_PATCHES(float)
THICKLENS_PATCHES(double)
#undef THICKLENS_PATCHES

}  // namespace thicklens::estimator
