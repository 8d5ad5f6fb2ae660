#include "calib/fit/blur_residuals.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/fit/blur_prediction.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {
namespace {

// A law of three terms needs more than three frames to constrain their errors.
constexpr std::size_t kMinScales = 6;

Eigen::Index Size(std::size_t size) { return static_cast<Eigen::Index>(size); }

}  // namespace

BlurResiduals::BlurResiduals(const BlurFitSetup& setup,
                             const std::vector<WhitenedCovariance>& information,
                             const BlurWeights& weights)
    : setup_(setup),
      information_(information),
      scale_frames_(ScaleFrames(setup)),
      scale_weights_(weights.scales),
      sign_(model::DirectionSign(setup.direction)) {
  const auto [low, high] = std::minmax_element(
      setup.frames.begin(), setup.frames.end(),
      [](const FitFrame& a, const FitFrame& b) { return a.reading_mm < b.reading_mm; });
  middle_mm_ = 0.5 * (low->reading_mm + high->reading_mm);
  half_range_mm_ = std::max(0.5 * (high->reading_mm - low->reading_mm), 1e-9);
  for (std::size_t m = 0; m < setup.estimators.size(); ++m) {
    factors_.push_back(information[m].Factors(weights.estimators[m]));
    rows_ += factors_.back().size();
  }
  if (setup.reading_sigma_mm > 0) readings_ = weights.readings.cwiseSqrt() / setup.reading_sigma_mm;
  rows_ += Size(scale_frames_.size()) + readings_.size();
}

std::vector<std::size_t> BlurResiduals::ScaleFrames(const BlurFitSetup& setup) {
  std::vector<std::size_t> frames;
  if (!(setup.reading_sigma_mm > 0)) return frames;
  for (std::size_t f = 0; f < setup.frames.size(); ++f) {
    if (setup.frames[f].scale_sigma) frames.push_back(f);
  }
  if (frames.size() < kMinScales) frames.clear();
  return frames;
}

Eigen::Index BlurResiduals::columns() const {
  return kBlurParameters + Size(setup_.estimators.size()) + (scale_frames_.empty() ? 0 : 3);
}

double BlurResiduals::ScaleFactor(std::size_t i) const {
  const std::size_t f = scale_frames_[i];
  return std::sqrt(scale_weights_[Size(f)]) / *setup_.frames[f].scale_sigma;
}

double BlurResiduals::ScaleRest(const BlurParameters& parameters, std::size_t frame) const {
  const double x = PlaceOnBench(parameters, frame);
  const Eigen::Vector3d& law = parameters.scale_model;
  return setup_.frames[frame].scale * (law[0] + x * (law[1] + x * law[2])) - 1;
}

std::optional<BlurResiduals::Terms> BlurResiduals::At(const BlurParameters& parameters) const {
  Terms terms;
  for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
    const BlurSamples& estimator = setup_.estimators[m];
    Rows& rows = terms.estimators.emplace_back(estimator.frames.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::size_t f = estimator.frames[i];
      const double depth_mm = DepthMm(parameters, f);
      if (!(depth_mm > 0)) return std::nullopt;
      const BlurPrediction p =
          PredictBlur(setup_, parameters.global, depth_mm, setup_.frames[f].scale);
      const double factor = factors_[m][Size(i)];
      rows[i].value =
          factor * (p.value + parameters.softness_px2[m] - estimator.variances_px2[Size(i)]);
      rows[i].by_error = -factor * sign_ * p.by_depth;
      rows[i].by_error_twice = factor * p.by_depth_twice;
    }
  }
  const Eigen::Vector3d& law = parameters.scale_model;
  for (std::size_t i = 0; i < scale_frames_.size(); ++i) {
    const std::size_t f = scale_frames_[i];
    const double x = PlaceOnBench(parameters, f), factor = ScaleFactor(i);
    const double by_x = factor * setup_.frames[f].scale;
    terms.scales.push_back({factor * ScaleRest(parameters, f),
                            -by_x * (law[1] + 2 * x * law[2]) / half_range_mm_,
                            by_x * 2 * law[2] / (half_range_mm_ * half_range_mm_)});
  }
  if (!readings_are_exact()) terms.readings = readings_.cwiseProduct(parameters.errors_mm);
  return terms;
}

Eigen::VectorXd BlurResiduals::Values(const Terms& terms) const {
  Eigen::VectorXd values(rows_);
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < terms.estimators.size(); ++m) {
    Eigen::VectorXd raw(Size(terms.estimators[m].size()));
    for (Eigen::Index i = 0; i < raw.size(); ++i)
      raw[i] = terms.estimators[m][static_cast<std::size_t>(i)].value;
    values.segment(row, raw.size()) = information_[m].Whitened(raw);
    row += raw.size();
  }
  for (const Row& scale : terms.scales) values[row++] = scale.value;
  values.tail(readings_.size()) = terms.readings;
  return values;
}

Eigen::MatrixXd BlurResiduals::Jacobian(const BlurParameters& parameters) const {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(rows_, columns());
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
    const BlurSamples& estimator = setup_.estimators[m];
    const Eigen::Index n = Size(estimator.frames.size());
    Eigen::MatrixXd raw(n, kBlurParameters + 1);
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t f = estimator.frames[static_cast<std::size_t>(i)];
      raw.row(i) << PredictBlur(setup_, parameters.global, DepthMm(parameters, f),
                                setup_.frames[f].scale)
                        .by_global.transpose(),
          1;
    }
    const Eigen::MatrixXd white = information_[m].Whitened(factors_[m].asDiagonal() * raw);
    jacobian.block(row, 0, n, kBlurParameters) = white.leftCols<kBlurParameters>();
    jacobian.block(row, kBlurParameters + Size(m), n, 1) = white.rightCols<1>();
    row += n;
  }
  for (std::size_t i = 0; i < scale_frames_.size(); ++i) {
    const double x = PlaceOnBench(parameters, scale_frames_[i]);
    jacobian.block<1, 3>(row++, columns() - 3) =
        ScaleFactor(i) * setup_.frames[scale_frames_[i]].scale * Eigen::RowVector3d(1, x, x * x);
  }
  return jacobian;
}

Eigen::MatrixXd BlurResiduals::TimesErrors(const Terms& terms, const Eigen::MatrixXd& x) const {
  Eigen::MatrixXd product(rows_, x.cols());
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < terms.estimators.size(); ++m) {
    const Rows& rows = terms.estimators[m];
    Eigen::MatrixXd raw(Size(rows.size()), x.cols());
    for (std::size_t i = 0; i < rows.size(); ++i)
      raw.row(Size(i)) = rows[i].by_error * x.row(Size(setup_.estimators[m].frames[i]));
    product.middleRows(row, raw.rows()) = information_[m].Whitened(raw);
    row += raw.rows();
  }
  for (std::size_t i = 0; i < scale_frames_.size(); ++i)
    product.row(row++) = terms.scales[i].by_error * x.row(Size(scale_frames_[i]));
  product.bottomRows(readings_.size()) = readings_.asDiagonal() * x;
  return product;
}

Eigen::MatrixXd BlurResiduals::TransposeTimesErrors(const Terms& terms,
                                                    const Eigen::MatrixXd& y) const {
  Eigen::MatrixXd product = readings_.asDiagonal() * y.bottomRows(readings_.size());
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < terms.estimators.size(); ++m) {
    const Rows& rows = terms.estimators[m];
    const Eigen::MatrixXd raw =
        information_[m].TransposeWhitened(y.middleRows(row, Size(rows.size())));
    for (std::size_t i = 0; i < rows.size(); ++i)
      product.row(Size(setup_.estimators[m].frames[i])) += rows[i].by_error * raw.row(Size(i));
    row += raw.rows();
  }
  for (std::size_t i = 0; i < scale_frames_.size(); ++i)
    product.row(Size(scale_frames_[i])) += terms.scales[i].by_error * y.row(row++);
  return product;
}

Eigen::VectorXd BlurResiduals::OwnInformation(const Terms& terms) const {
  Eigen::VectorXd own = readings_.cwiseAbs2();
  for (std::size_t i = 0; i < scale_frames_.size(); ++i)
    own[Size(scale_frames_[i])] += terms.scales[i].by_error * terms.scales[i].by_error;
  return own;
}

Eigen::MatrixXd BlurResiduals::ErrorNormal(const Terms& terms) const {
  Eigen::MatrixXd normal = OwnInformation(terms).asDiagonal();
  for (std::size_t m = 0; m < terms.estimators.size(); ++m) {
    const Rows& rows = terms.estimators[m];
    const std::vector<std::size_t>& frames = setup_.estimators[m].frames;
    const Eigen::MatrixXd& information = information_[m].matrix();
    for (std::size_t j = 0; j < rows.size(); ++j) {
      for (std::size_t i = 0; i < rows.size(); ++i) {
        normal(Size(frames[i]), Size(frames[j])) +=
            rows[i].by_error * rows[j].by_error * information(Size(i), Size(j));
      }
    }
  }
  return normal;
}

Eigen::VectorXd BlurResiduals::ErrorCurvature(const Terms& terms,
                                              const Eigen::VectorXd& values) const {
  Eigen::VectorXd curvature = Eigen::VectorXd::Zero(readings_.size());
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < terms.estimators.size(); ++m) {
    const Rows& rows = terms.estimators[m];
    const Eigen::VectorXd pull =
        information_[m].TransposeWhitened(values.segment(row, Size(rows.size())));
    for (std::size_t i = 0; i < rows.size(); ++i)
      curvature[Size(setup_.estimators[m].frames[i])] += rows[i].by_error_twice * pull[Size(i)];
    row += pull.size();
  }
  for (std::size_t i = 0; i < scale_frames_.size(); ++i)
    curvature[Size(scale_frames_[i])] += terms.scales[i].by_error_twice * terms.scales[i].value;
  return curvature;
}

}  // namespace thicklens::calib
