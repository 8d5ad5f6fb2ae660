#ifndef THICKLENS_CALIB_FIT_BLUR_RESIDUALS_H_
#define THICKLENS_CALIB_FIT_BLUR_RESIDUALS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/fit/meter_information.h"

namespace thicklens::calib {

// Everything that is fitted. Readings' errors e: the bench stood at reading - e.
struct BlurParameters {
  Eigen::Vector4d global{0, 0, 0, 0};  // in the order of BlurParameter
  std::vector<double> softness_px2;    // c of each meter
  Eigen::Vector3d scale_law{1, 0, 0};  // 1/scale = l0 + l1 x + l2 x^2, x the reading in [-1, 1]
  Eigen::VectorXd errors_mm;
};

// Of a sample's residual squared, 0 to 1.
struct BlurWeights {
  std::vector<Eigen::VectorXd> meters;  // of each sample
  Eigen::VectorXd readings, scales;     // of each frame
};

// The residuals that FitBlur makes small [D74], each in its standard deviations, one below the
// other:
//   of a meter:   B f (V_model + c - V), B its covariance's inverse root, f the weights' factors;
//   of a scale:   sqrt(w) (scale (l0 + l1 x + l2 x^2) - 1)/sigma, x by the believed reading;
//   of a reading: sqrt(w) e/sigma; none, and e = 0, where the readings are exact.
// Their Jacobian by the errors is never written down: it is B with its columns scaled, and diagonal
// below.
class BlurResiduals {
 public:
  // `setup` and `information` (of each meter) must outlive this.
  BlurResiduals(const BlurFitSetup& setup, const std::vector<MeterInformation>& information,
                const BlurWeights& weights);

  // Frames whose scale tells something of their reading's error.
  static std::vector<std::size_t> ScaleFrames(const BlurFitSetup& setup);
  bool has_scales() const { return !scale_frames_.empty(); }
  bool readings_are_exact() const { return readings_.size() == 0; }
  Eigen::Index rows() const { return rows_; }
  // Of the parameters but the errors: global, a softness for each meter, the scale's law if there
  // are scales.
  Eigen::Index columns() const;

  // A sample's or a scale's residual before B, with its derivatives by its reading's error.
  struct Row {
    double value = 0, by_error = 0, by_error_twice = 0;
  };
  using Rows = std::vector<Row>;
  struct Terms {
    std::vector<Rows> meters;  // of each sample
    Rows scales;
    Eigen::VectorXd readings;
  };
  // Nothing where a depth is not positive.
  std::optional<Terms> At(const BlurParameters& parameters) const;
  double ScaleRest(const BlurParameters& parameters, std::size_t frame) const;

  Eigen::VectorXd Values(const Terms& terms) const;
  // By the parameters but the errors.
  Eigen::MatrixXd Jacobian(const BlurParameters& parameters) const;

  // J x and J^T y of columns, J the Jacobian by the errors, and J^T J.
  Eigen::MatrixXd TimesErrors(const Terms& terms, const Eigen::MatrixXd& x) const;
  Eigen::MatrixXd TransposeTimesErrors(const Terms& terms, const Eigen::MatrixXd& y) const;
  Eigen::MatrixXd ErrorNormal(const Terms& terms) const;
  // Diagonal of J^T J without the meters' part: what is known of each error beforehand.
  Eigen::VectorXd OwnInformation(const Terms& terms) const;
  // Diagonal of the second derivative of half the residuals' squares by the errors, less J^T J's.
  Eigen::VectorXd ErrorCurvature(const Terms& terms, const Eigen::VectorXd& values) const;

 private:
  double BelievedReading(const BlurParameters& parameters, std::size_t frame) const {
    return setup_.frames[frame].reading_mm - parameters.errors_mm[static_cast<Eigen::Index>(frame)];
  }
  double PlaceOnBench(const BlurParameters& parameters, std::size_t frame) const {
    return (BelievedReading(parameters, frame) - middle_mm_) / half_range_mm_;
  }
  double DepthMm(const BlurParameters& parameters, std::size_t frame) const {
    return parameters.global[kBenchOffset] + sign_ * BelievedReading(parameters, frame);
  }
  double ScaleFactor(std::size_t i) const;

  const BlurFitSetup& setup_;
  const std::vector<MeterInformation>& information_;
  std::vector<Eigen::VectorXd> factors_;  // f of each meter's samples
  std::vector<std::size_t> scale_frames_;
  Eigen::VectorXd scale_weights_;  // of each frame
  Eigen::VectorXd readings_;       // sqrt(w)/sigma
  double sign_ = 1, middle_mm_ = 0, half_range_mm_ = 1;
  Eigen::Index rows_ = 0;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_RESIDUALS_H_
