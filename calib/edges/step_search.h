#ifndef THICKLENS_CALIB_EDGES_STEP_SEARCH_H_
#define THICKLENS_CALIB_EDGES_STEP_SEARCH_H_

#include <ceres/tiny_solver.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "calib/edges/edge_spread.h"
#include "calib/edges/feature_pixels.h"
#include "calib/edges/step_fit.h"
#include "thicklens/base/cancel.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The common part of the fits of an edge and of a corner: the gathered pixels, their model, and the
// search for its parameters. Both fits describe the grey value between two levels that change
// smoothly over the strip. The unit is one 200th of the contrast, so that the absolute tolerances
// of the solver have the same meaning for every frame.

// The data that a model of the pixels in a strip needs. A derived class computes the residuals and
// their Jacobian in the form that ceres::TinySolver requires.
template <int kParameterCount>
class StepModel {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = kParameterCount };

  StepModel(const FeaturePixels& pixels, const Strip& strip, double unit, model::Psf psf,
            double floor_px)
      : pixels_(pixels), strip_(strip), unit_(unit), psf_(psf), floor_px_(floor_px) {}

  int NumResiduals() const { return static_cast<int>(pixels_.size()); }

 protected:
  Eigen::Map<Eigen::MatrixXd> AsMatrix(double* jacobian) const {
    const bool is_wanted = jacobian != nullptr;
    return {jacobian, is_wanted ? static_cast<Eigen::Index>(pixels_.size()) : 0,
            is_wanted ? static_cast<Eigen::Index>(kParameterCount) : 0};
  }
  // A blur of more than twice the strip cannot be distinguished from a slope.
  double LargestVariance() const { return 4 * strip_.half_width_px * strip_.half_width_px; }

  const FeaturePixels& pixels_;
  Strip strip_;
  double unit_;
  model::Psf psf_;
  double floor_px_;
};

// The state of a search. A derived class defines where to gather the pixels and which result is
// plausible.
template <class Model>
class StepSearch {
 public:
  StepSearch(const cv::Mat& grey, const EdgeFeature& feature, model::Psf psf, double floor_px)
      : grey_(grey), feature_(feature), psf_(psf), floor_px_(floor_px) {}

 protected:
  static constexpr int kCount = Model::NUM_PARAMETERS;
  using Parameters = Eigen::Matrix<double, kCount, 1>;

  Model ModelOfPixels() const { return Model(pixels_, strip_, unit_, psf_, floor_px_); }

  // The means of the pixels on side 0 and on side 1. `side_of` returns the side of a pixel, or -1
  // if it is on neither side. The result is std::nullopt where a side is empty or the means are not
  // finite.
  template <class SideOf>
  std::optional<Eigen::Vector2d> MeansOfSides(const SideOf& side_of) const {
    double sum[2] = {0, 0}, count[2] = {0, 0};
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const int side = side_of(pixels_.x_px[i], pixels_.y_px[i]);
      if (side < 0) continue;
      sum[side] += pixels_.grey[i];
      ++count[side];
    }
    if (!(count[0] > 0 && count[1] > 0)) return std::nullopt;
    const Eigen::Vector2d means(sum[0] / count[0], sum[1] / count[1]);
    if (!std::isfinite(means[1] - means[0])) return std::nullopt;
    return means;
  }

  // Moves the parameters to the nearest local minimum of the cost, and returns that cost.
  double Solve() {
    ceres::TinySolver<Model> solver;
    solver.options.max_num_iterations = 30;
    solver.options.function_tolerance = 1e-3;  // relative; noise costs about 1 per pixel
    const Model model = ModelOfPixels();
    solver.Solve(model, &parameters_);
    return solver.summary.final_cost;
  }

  // Starts the search from several blurs, because the cost has no slope at a start that is far too
  // sharp. `set_variance` writes the sigma^2 of a start into the parameters. Returns false if no
  // start ends plausibly.
  template <class SetVariance, class IsPlausible>
  bool SolveFromSeveral(double width_px, const SetVariance& set_variance,
                        const IsPlausible& is_plausible) {
    const Parameters levels = parameters_;
    Parameters best = levels;
    double best_cost = std::numeric_limits<double>::infinity();
    for (const double sigma_px : {2.0, 0.7, 7.0}) {
      ThrowIfCancelled();
      if (sigma_px > 1 && sigma_px > width_px / 2) continue;
      parameters_ = levels;
      set_variance(sigma_px * sigma_px);
      const double cost = Solve();
      if (!(cost < best_cost) || !is_plausible()) continue;
      best_cost = cost;
      best = parameters_;
      // No other local minimum exists where the residual is within 3 % of the contrast.
      if (std::sqrt(2 * cost / static_cast<double>(pixels_.size())) < 6) break;
    }
    parameters_ = best;
    return std::isfinite(best_cost);
  }

  // Residual and Jacobian of the model at the end of the search.
  struct Ending {
    Eigen::VectorXd residual;
    Eigen::MatrixXd jacobian;
  };
  Ending AtTheEnd() const {
    const auto n = static_cast<Eigen::Index>(pixels_.size());
    Ending end{Eigen::VectorXd(n), Eigen::MatrixXd(n, static_cast<Eigen::Index>(kCount))};
    ModelOfPixels()(parameters_.data(), end.residual.data(), end.jacobian.data());
    return end;
  }
  // Covariance of the parameters if the end of the search is a step; otherwise std::nullopt.
  // `bright` is defined as for JudgeFit.
  struct Judgement {
    FitQuality quality;
    Eigen::MatrixXd covariance;
  };
  std::optional<Judgement> Judge(const Ending& end, const std::vector<double>& bright,
                                 double contrast) const {
    const FitQuality quality =
        JudgeFit(pixels_, end.residual, bright, static_cast<int>(end.jacobian.cols()));
    if (!IsStep(quality, contrast)) return std::nullopt;
    Eigen::MatrixXd covariance = FitCovariance(end.jacobian, end.residual, quality.clumping);
    if (covariance.size() == 0) return std::nullopt;
    return Judgement{quality, std::move(covariance)};
  }
  BlurSigma BlurOf(int parameter, const Eigen::MatrixXd& covariance) const {
    return SigmaWithError(parameters_[parameter], std::sqrt(covariance(parameter, parameter)));
  }

  const cv::Mat& grey_;
  EdgeFeature feature_;
  model::Psf psf_;
  double floor_px_;
  Strip strip_;
  FeaturePixels pixels_;
  double unit_ = 1;
  Parameters parameters_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_STEP_SEARCH_H_
