#ifndef THICKLENS_CALIB_FIT_BLUR_RESIDUALS_H_
#define THICKLENS_CALIB_FIT_BLUR_RESIDUALS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/fit/whitened_covariance.h"

namespace thicklens::calib {

// All fitted quantities. The errors e of the readings mean: the bench was at reading - e.
struct BlurParameters {
  Eigen::Vector4d global{0, 0, 0, 0};    // in the order of BlurParameter
  std::vector<double> softness_px2;      // c of each estimator
  Eigen::Vector3d scale_model{1, 0, 0};  // 1/scale = l0 + l1 x + l2 x^2, x the reading in [-1, 1]
  Eigen::VectorXd errors_mm;
};

// Weights, 0 to 1, of the squared residuals.
struct BlurWeights {
  std::vector<Eigen::VectorXd> estimators;  // one for each sample
  Eigen::VectorXd readings, scales;         // one for each frame
};

// The residuals that FitBlur minimises [D74], each in its standard deviations, stacked:
//   estimator:   B f (V_model + c - V), B its covariance's inverse root, f the weights' factors;
//   scale:   sqrt(w) (scale (l0 + l1 x + l2 x^2) - 1)/sigma, x from the corrected reading;
//   reading: sqrt(w) e/sigma; none, and e = 0, where the readings are exact.
// Their Jacobian by the errors is never stored as a matrix: its part of the estimators is B with
// scaled columns, and the parts below are diagonal.
class BlurResiduals {
 public:
  // `setup` and `information` (one for each estimator) must outlive this object.
  BlurResiduals(const BlurFitSetup& setup, const std::vector<WhitenedCovariance>& information,
                const BlurWeights& weights);

  // Returns the frames whose scale constrains their reading's error.
  static std::vector<std::size_t> ScaleFrames(const BlurFitSetup& setup);
  bool has_scales() const { return !scale_frames_.empty(); }
  bool readings_are_exact() const { return readings_.size() == 0; }
  Eigen::Index rows() const { return rows_; }
  // Number of parameters without the errors: global, a softness for each estimator, and the scale's
  // law if there are scales.
  Eigen::Index columns() const;

  // A sample's or a scale's residual before B, with its derivatives by its reading's error.
  struct Row {
    double value = 0, by_error = 0, by_error_twice = 0;
  };
  using Rows = std::vector<Row>;
  struct Terms {
    std::vector<Rows> estimators;  // one for each sample
    Rows scales;
    Eigen::VectorXd readings;
  };
  // Returns nothing where a depth is not positive.
  std::optional<Terms> At(const BlurParameters& parameters) const;
  double ScaleRest(const BlurParameters& parameters, std::size_t frame) const;

  Eigen::VectorXd Values(const Terms& terms) const;
  // Returns the derivatives of the residuals by the parameters without the errors.
  Eigen::MatrixXd Jacobian(const BlurParameters& parameters) const;

  // J x and J^T y for columns, and J^T J, where J is the Jacobian by the errors.
  Eigen::MatrixXd TimesErrors(const Terms& terms, const Eigen::MatrixXd& x) const;
  Eigen::MatrixXd TransposeTimesErrors(const Terms& terms, const Eigen::MatrixXd& y) const;
  Eigen::MatrixXd ErrorNormal(const Terms& terms) const;
  // Diagonal of J^T J without the estimators' part: the prior information on each error.
  Eigen::VectorXd OwnInformation(const Terms& terms) const;
  // Diagonal of the second derivative of half the squared residuals by the errors, minus that of
  // J^T J.
  Eigen::VectorXd ErrorCurvature(const Terms& terms, const Eigen::VectorXd& values) const;

 private:
  double EstimatedReading(const BlurParameters& parameters, std::size_t frame) const {
    return setup_.frames[frame].reading_mm - parameters.errors_mm[static_cast<Eigen::Index>(frame)];
  }
  double PlaceOnBench(const BlurParameters& parameters, std::size_t frame) const {
    return (EstimatedReading(parameters, frame) - middle_mm_) / half_range_mm_;
  }
  double DepthMm(const BlurParameters& parameters, std::size_t frame) const {
    return parameters.global[kBenchOffset] + sign_ * EstimatedReading(parameters, frame);
  }
  double ScaleFactor(std::size_t i) const;

  const BlurFitSetup& setup_;
  const std::vector<WhitenedCovariance>& information_;
  std::vector<Eigen::VectorXd> factors_;  // f for each estimator's samples
  std::vector<std::size_t> scale_frames_;
  Eigen::VectorXd scale_weights_;  // one for each frame
  Eigen::VectorXd readings_;       // sqrt(w)/sigma
  double sign_ = 1, middle_mm_ = 0, half_range_mm_ = 1;
  Eigen::Index rows_ = 0;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_RESIDUALS_H_
