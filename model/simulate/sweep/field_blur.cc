#include "model/simulate/sweep/field_blur.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

// Most places along a side, and their least distance, px. The outermost places lie beyond the
// image, for the interpolation of the weights.
constexpr int kMostPlaces = 37;
constexpr double kLeastDistancePx = 5;
constexpr int kCandidateStep = 3;  // every third place may be one of the sum
constexpr int kFrequencies = 24;   // along each half axis, up to one cycle per px
constexpr double kMaxError = 5e-4;

// The transfer function of a blur at the frequencies of the half plane, dense at low ones, where
// targets have their detail and strong blurs all of theirs.
Eigen::VectorXd TransferOf(const FrameBlur& blur) {
  Eigen::VectorXd transfer((2 * kFrequencies + 1) * (kFrequencies + 1));
  Eigen::Index at = 0;
  const auto frequency = [](int i) {
    const double part = static_cast<double>(i) / kFrequencies;
    return part * std::abs(part);
  };
  for (int b = 0; b <= kFrequencies; ++b) {
    for (int a = -kFrequencies; a <= kFrequencies; ++a) {
      const double fx = frequency(a), fy = frequency(b);
      transfer(at++) = GaussianTransfer(blur.floor_sigma_px, fx, fy) *
                       (blur.pixel_box ? PixelBoxTransfer(fx, fy) : 1) *
                       blur.DefocusTransferAt(fx, fy);
    }
  }
  return transfer;
}

// Places along a side of the image. The second one and the last but one are at the centres of the
// first and the last pixel.
struct SideOfGrid {
  explicit SideOfGrid(int length)
      : places(std::min(kMostPlaces, 4 + static_cast<int>(length / kLeastDistancePx))),
        distance_px(std::max(1, length - 1) / (places - 3.0)) {}

  double PlacePx(int place) const { return (place - 1) * distance_px; }
  double PlaceOf(double position_px) const { return 1 + position_px / distance_px; }

  int places;
  double distance_px;
};

// The weights of the grid, CV_32F, at every pixel.
cv::Mat AtPixels(const cv::Mat& of_places, cv::Size size, const SideOfGrid& across,
                 const SideOfGrid& down) {
  cv::Mat x(size, CV_32F), y(size, CV_32F), weights;
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      x.at<float>(row, column) = static_cast<float>(across.PlaceOf(column));
      y.at<float>(row, column) = static_cast<float>(down.PlaceOf(row));
    }
  }
  cv::remap(of_places, weights, x, y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return weights;
}

}  // namespace

FieldBlur DecomposeBlur(cv::Size size,
                        const std::function<FrameBlur(const Eigen::Vector2d&)>& blur_at) {
  const SideOfGrid across(size.width), down(size.height);
  std::vector<FrameBlur> blurs;
  std::vector<std::size_t> candidates;
  for (int row = 0; row < down.places; ++row) {
    for (int column = 0; column < across.places; ++column) {
      if (row % kCandidateStep == 0 && column % kCandidateStep == 0)
        candidates.push_back(blurs.size());
      blurs.push_back(blur_at(Eigen::Vector2d(across.PlacePx(column), down.PlacePx(row))));
    }
  }
  Eigen::MatrixXd transfers(TransferOf(blurs.front()).size(),
                            static_cast<Eigen::Index>(candidates.size()));
  for (Eigen::Index i = 0; i < transfers.cols(); ++i)
    transfers.col(i) = TransferOf(blurs[candidates[static_cast<std::size_t>(i)]]);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted(transfers);
  const double allowed = kMaxError * std::sqrt(static_cast<double>(transfers.rows()));
  const Eigen::MatrixXd& factor = pivoted.matrixQR();
  Eigen::Index rank = 1;
  while (rank < transfers.cols() && std::abs(factor(rank, rank)) > allowed) ++rank;
  Eigen::MatrixXd chosen(transfers.rows(), rank);
  FieldBlur field;
  for (Eigen::Index k = 0; k < rank; ++k) {
    const auto column = pivoted.colsPermutation().indices()(k);
    chosen.col(k) = transfers.col(column);
    field.blurs.push_back(blurs[candidates[static_cast<std::size_t>(column)]]);
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> solver(chosen);
  std::vector<cv::Mat> of_places;
  for (Eigen::Index k = 0; k < rank; ++k)
    of_places.emplace_back(down.places, across.places, CV_32F);
  for (std::size_t i = 0; i < blurs.size(); ++i) {
    ThrowIfCancelled();
    const Eigen::VectorXd weights = solver.solve(TransferOf(blurs[i]));
    for (Eigen::Index k = 0; k < rank; ++k) {
      of_places[static_cast<std::size_t>(k)].at<float>(static_cast<int>(i) / across.places,
                                                       static_cast<int>(i) % across.places) =
          static_cast<float>(weights(k));
    }
  }
  for (const cv::Mat& weights : of_places)
    field.weights.push_back(AtPixels(weights, size, across, down));
  return field;
}

}  // namespace thicklens::model
