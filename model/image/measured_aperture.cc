#include "thicklens/model/measured_aperture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

// Shares of the cells of the PSF along one axis that lie in each view's cell, (views x cells).
Eigen::MatrixXd Overlaps(int views, Eigen::Index cells, double view_step, double cell_step) {
  Eigen::MatrixXd overlaps(views, cells);
  for (int k = 0; k < views; ++k) {
    const double middle = (k - (views - 1) / 2.0) * view_step;
    for (Eigen::Index i = 0; i < cells; ++i) {
      const double at = (static_cast<double>(i) - static_cast<double>(cells - 1) / 2) * cell_step;
      const double from = std::max(middle - view_step / 2, at - cell_step / 2);
      const double to = std::min(middle + view_step / 2, at + cell_step / 2);
      overlaps(k, i) = std::max(0.0, to - from) / cell_step;
    }
  }
  return overlaps;
}

// Second moment of the shares about their centroid, in steps squared.
double SecondMoment(const Eigen::ArrayXd& shares) {
  const Eigen::Index n = shares.size();
  const Eigen::ArrayXd at = Eigen::ArrayXd::LinSpaced(n, 0, static_cast<double>(n - 1));
  const double mean = (shares * at).sum() / shares.sum();
  return (shares * (at - mean).square()).sum() / shares.sum();
}

}  // namespace

ApertureSamples SampleAperture(const MeasuredPsf& psf, double blur_ratio, double aperture_radius_mm,
                               int u_count, int v_count) {
  std::string why;
  if (!psf.IsValid(&why)) throw Error("measured PSF: " + why);
  if (u_count < 1 || v_count < 1)
    throw Error(fmt::format("views are {}x{}: both counts must be >= 1", u_count, v_count));
  // Blur ratio and radius are checked by the function for given weights.
  const ApertureSamples checked =
      SampleAperture(Eigen::ArrayXXd::Ones(1, 1), blur_ratio, aperture_radius_mm);
  ApertureSamples samples = checked;
  samples.u_count = u_count;
  samples.v_count = v_count;
  const Eigen::Vector2d sigmas = psf.AxisSigmas();
  const Eigen::MatrixXd across =
      Overlaps(u_count, psf.light.cols(), 4 * sigmas.x() / u_count, psf.step);
  const Eigen::MatrixXd down =
      Overlaps(v_count, psf.light.rows(), 4 * sigmas.y() / v_count, psf.step);
  samples.weights = (down * psf.light.matrix() * across.transpose()).array();
  samples.weights /= samples.weights.sum();
  const double scale_mm = blur_ratio * aperture_radius_mm / psf.BlurRatio();
  const auto step_mm = [&](double sigma, const Eigen::ArrayXd& shares) {
    const double moment = SecondMoment(shares);
    return moment > 0 ? scale_mm * sigma / std::sqrt(moment) : 0.0;
  };
  samples.u_step_mm = step_mm(sigmas.x(), samples.weights.colwise().sum().transpose());
  samples.v_step_mm = step_mm(sigmas.y(), samples.weights.rowwise().sum());
  return samples;
}

}  // namespace thicklens::model
