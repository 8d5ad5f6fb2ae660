#include "estimator/scene/scene_data.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "estimator/scene/encoding_slope.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

constexpr double kOccludedWeight = 20;

// Returns the sum of the squares of the weights that the rays of one axis put on the pixels of a
// line, linear between pixels, for neighbours `step_px` apart.
double SquaredAxis(const Eigen::ArrayXd& weights, double step_px) {
  const auto count = static_cast<int>(weights.size());
  const double half_px = (count - 1) / 2.0 * step_px;
  const int reach = static_cast<int>(std::ceil(half_px)) + 1;
  std::vector<double> line(Index(2 * reach + 1), 0.0);
  for (int k = 0; k < count; ++k) {
    const double at = k * step_px - half_px + reach;
    const int below = static_cast<int>(at);
    const double share = at - below;
    line[Index(below)] += weights[k] * (1 - share);
    line[Index(below) + 1] += weights[k] * share;
  }
  double sum = 0;
  for (const double value : line) sum += value * value;
  return sum;
}

// Returns the variance of the positions on an axis, in view steps.
double SpreadOf(const Eigen::ArrayXd& weights) {
  double sum = 0;
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    const double offset = static_cast<double>(k) - static_cast<double>(weights.size() - 1) / 2;
    sum += weights[k] * offset * offset;
  }
  return sum;
}

}  // namespace

template <typename Real>
DataTerm<Real> DataTermOf(const SceneProjection<Real>& projection,
                          const model::LinearImage& photograph, int threads) {
  DataTerm<Real> data;
  data.width_px = photograph.width_px;
  data.height_px = photograph.height_px;
  data.channels = photograph.channels;
  data.threads = threads;
  data.projection.apply = [&projection](const Real* x, int channels, Real* y) {
    projection.Apply(x, channels, y);
  };
  data.projection.apply_transposed = [&projection](const Real* y, int channels, Real* x) {
    projection.ApplyTransposed(y, channels, x);
  };
  for (const auto& term : projection.terms) {
    data.filters.products.push_back({&term.across, &term.down});
  }
  data.filters.rows = &projection.rows;
  data.photograph = Planar<Real>(photograph);
  return data;
}

template <typename Real>
std::vector<Real> Planar(const model::LinearImage& image) {
  const std::size_t channels = Index(image.channels);
  const std::size_t pixels = image.values.size() / channels;
  std::vector<Real> planes(image.values.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    planes[i % channels * pixels + i / channels] = static_cast<Real>(image.values[i]);
  }
  return planes;
}

template <typename Real>
model::LinearImage Interleaved(const std::vector<Real>& planes, int width_px, int height_px,
                               int channels) {
  model::LinearImage image{width_px, height_px, channels, std::vector<float>(planes.size())};
  const std::size_t pixels = planes.size() / Index(channels);
  for (std::size_t i = 0; i < planes.size(); ++i) {
    image.values[i] =
        static_cast<float>(planes[i % Index(channels) * pixels + i / Index(channels)]);
  }
  return image;
}

template <typename Real>
std::vector<Real> SquaredRows(const DisparityMap& disparity, const Eigen::ArrayXXd& weights) {
  constexpr double kPerUnit = 32;  // table entries per px of the larger step
  const double largest_step = disparity.step.cwiseAbs().maxCoeff();
  // An aperture without blur has no steps: all views are the same.
  const Eigen::Vector2d share = largest_step > 0
                                    ? Eigen::Vector2d(disparity.step.cwiseAbs() / largest_step)
                                    : Eigen::Vector2d::Zero();
  const Eigen::ArrayXd across = weights.colwise().sum().transpose();
  const Eigen::ArrayXd down = weights.rowwise().sum();
  std::vector<Real> table;
  std::vector<Real> rows;
  rows.reserve(disparity.disparity.size());
  for (const float value : disparity.disparity) {
    const double size_px = std::abs(static_cast<double>(value)) * largest_step;
    const auto cell = static_cast<std::size_t>(size_px * kPerUnit + 0.5);
    while (table.size() <= cell) {
      const double step_px = static_cast<double>(table.size()) / kPerUnit;
      table.push_back(static_cast<Real>(SquaredAxis(across, step_px * share.x()) *
                                        SquaredAxis(down, step_px * share.y())));
    }
    rows.push_back(table[cell]);
  }
  return rows;
}

template <typename Real>
std::vector<Real> DataWeights(const std::vector<Real>& slope_squared,
                              const std::vector<float>& occluded_fraction,
                              bool disocclusion_weights) {
  std::vector<Real> weights = slope_squared;
  if (!disocclusion_weights) return weights;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double occluded = kOccludedWeight * static_cast<double>(occluded_fraction[i]);
    weights[i] = static_cast<Real>(static_cast<double>(weights[i]) / (1 + occluded * occluded));
  }
  return weights;
}

std::vector<float> BlurSigmaPx(const DisparityMap& disparity, const Eigen::ArrayXXd& weights) {
  const Eigen::Vector2d step = disparity.step;
  const double across = SpreadOf(weights.colwise().sum().transpose()) * step.x() * step.x();
  const double down = SpreadOf(weights.rowwise().sum()) * step.y() * step.y();
  const double per_unit = std::sqrt((across + down) / 2);
  std::vector<float> sigma_px;
  sigma_px.reserve(disparity.disparity.size());
  for (const float value : disparity.disparity) {
    sigma_px.push_back(static_cast<float>(per_unit * std::abs(static_cast<double>(value))));
  }
  return sigma_px;
}

template <typename Real>
EncodedResidual EncodedResidualOf(const DataTerm<Real>& data, const std::vector<Real>& radiance,
                                  const model::TransferCurve& transfer, int first_row,
                                  int last_row) {
  const EncodedValueTable table(transfer);
  std::vector<Real> shown(radiance.size());
  data.projection.apply(radiance.data(), data.channels, shown.data());
  // Light above a lower bound agrees with it.
  for (const std::size_t i : data.bounds) shown[i] = std::min(shown[i], data.photograph[i]);
  EncodedResidual residual;
  residual.mean.assign(data.pixels(), 0.0F);
  const Sums sums = SumOverBands(data.height_px, data.threads, [&](int y0, int y1) {
    double sum = 0;
    const int begin = std::max(y0, first_row), end = std::min(y1, last_row);
    for (int channel = 0; begin < end && channel < data.channels; ++channel) {
      const std::size_t plane = Index(channel) * data.pixels();
      for (std::size_t i = Index(begin) * Index(data.width_px);
           i < Index(end) * Index(data.width_px); ++i) {
        const float difference = table.Encode(static_cast<float>(shown[plane + i])) -
                                 table.Encode(static_cast<float>(data.photograph[plane + i]));
        residual.mean[i] += difference / static_cast<float>(data.channels);
        sum += static_cast<double>(difference) * static_cast<double>(difference);
      }
    }
    return Sums{sum};
  });
  residual.rms = std::sqrt(
      sums[0] / (static_cast<double>(last_row - first_row) * data.width_px * data.channels));
  return residual;
}

#define THICKLENS_SCENE_DATA(Real)                                                            \
  template DataTerm<Real> DataTermOf(const SceneProjection<Real>&, const model::LinearImage&, \
                                     int);                                                    \
  template std::vector<Real> Planar(const model::LinearImage&);                               \
  template model::LinearImage Interleaved(const std::vector<Real>&, int, int, int);           \
  template std::vector<Real> SquaredRows(const DisparityMap&, const Eigen::ArrayXXd&);        \
  template std::vector<Real> DataWeights(const std::vector<Real>&, const std::vector<float>&, \
                                         bool);                                               \
  template EncodedResidual EncodedResidualOf(const DataTerm<Real>&, const std::vector<Real>&, \
                                             const model::TransferCurve&, int, int);
THICKLENS_SCENE_DATA(float)
THICKLENS_SCENE_DATA(double)
#undef THICKLENS_SCENE_DATA

}  // namespace thicklens::estimator
