#include "model/simulate/sweep/field_blur.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

// Most places along a side, and their least distance in samples. The outermost places lie beyond
// the image, for the interpolation of the weights.
constexpr int kMaxPlaces = 37;
constexpr double kMinDistance = 5;
constexpr int kCandidateStep = 3;  // every third place may be one of the sum
constexpr int kFrequencies = 24;   // along each half axis, up to one cycle per px
constexpr double kMaxError = 5e-5;

// The transfer function of the defocus under a matrix, at a frequency in cycles per px.
double TransferAt(const FieldBlur& blur, const Eigen::Matrix2d& map_px, const Eigen::Vector2d& f) {
  const Eigen::Vector2d mapped = map_px * f;
  return blur.profile == nullptr ? DefocusTransfer(blur.psf, 1, mapped.x(), mapped.y())
                                 : blur.profile->Transfer(2 * kPi * mapped.norm());
}

// Weight of a frequency in the decomposition: what blur floor and pixel box leave of it.
double WeightOf(const FieldBlur& blur, const Eigen::Vector2d& f) {
  return GaussianTransfer(blur.floor_sigma_px, f.x(), f.y()) *
         std::abs(PixelBoxTransfer(f.x(), f.y()));
}

// Frequencies of the half plane, dense at low ones, where targets have their detail and strong
// blurs all of theirs.
std::vector<Eigen::Vector2d> Frequencies() {
  const auto frequency = [](int i) {
    const double part = static_cast<double>(i) / kFrequencies;
    return part * std::abs(part);
  };
  std::vector<Eigen::Vector2d> frequencies;
  for (int b = 0; b <= kFrequencies; ++b) {
    for (int a = -kFrequencies; a <= kFrequencies; ++a)
      frequencies.emplace_back(frequency(a), frequency(b));
  }
  return frequencies;
}

// Places along a side of the image. The second one and the last but one are at the centres of the
// first and the last pixel.
struct SideOfGrid {
  explicit SideOfGrid(int length)
      : places(std::min(kMaxPlaces, 4 + static_cast<int>(length / kMinDistance))),
        distance(std::max(1, length - 1) / (places - 3.0)) {}

  double Position(int place) const { return (place - 1) * distance; }
  double PlaceOf(double position) const { return 1 + position / distance; }

  int places;
  double distance;
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

// A blur with a weight at every pixel.
struct Term {
  Eigen::Matrix2d map_px;
  cv::Mat weights;  // CV_32F
};

std::vector<Term> Decompose(cv::Size size, const FieldBlur& blur) {
  const SideOfGrid across(size.width), down(size.height);
  std::vector<Eigen::Matrix2d> maps_px;
  std::vector<std::size_t> candidates;
  for (int row = 0; row < down.places; ++row) {
    for (int column = 0; column < across.places; ++column) {
      if (row % kCandidateStep == 0 && column % kCandidateStep == 0)
        candidates.push_back(maps_px.size());
      maps_px.push_back(blur.map_px({across.Position(column), down.Position(row)}));
    }
  }
  const std::vector<Eigen::Vector2d> frequencies = Frequencies();
  const auto transfer_of = [&](const Eigen::Matrix2d& map_px) {
    Eigen::VectorXd transfer(static_cast<Eigen::Index>(frequencies.size()));
    for (Eigen::Index i = 0; i < transfer.size(); ++i) {
      const Eigen::Vector2d& f = frequencies[static_cast<std::size_t>(i)];
      transfer(i) = WeightOf(blur, f) * TransferAt(blur, map_px, f);
    }
    return transfer;
  };
  Eigen::MatrixXd transfers(static_cast<Eigen::Index>(frequencies.size()),
                            static_cast<Eigen::Index>(candidates.size()));
  for (Eigen::Index i = 0; i < transfers.cols(); ++i)
    transfers.col(i) = transfer_of(maps_px[candidates[static_cast<std::size_t>(i)]]);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted(transfers);
  const double allowed = kMaxError * std::sqrt(static_cast<double>(transfers.rows()));
  const Eigen::MatrixXd& factor = pivoted.matrixQR();
  Eigen::Index rank = 1;
  while (rank < transfers.cols() && std::abs(factor(rank, rank)) > allowed) ++rank;
  Eigen::MatrixXd chosen(transfers.rows(), rank);
  std::vector<Term> terms;
  std::vector<cv::Mat> of_places;
  for (Eigen::Index k = 0; k < rank; ++k) {
    const auto column = pivoted.colsPermutation().indices()(k);
    chosen.col(k) = transfers.col(column);
    terms.push_back({maps_px[candidates[static_cast<std::size_t>(column)]], cv::Mat()});
    of_places.emplace_back(down.places, across.places, CV_32F);
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> solver(chosen);
  for (std::size_t i = 0; i < maps_px.size(); ++i) {
    ThrowIfCancelled();
    const Eigen::VectorXd weights = solver.solve(transfer_of(maps_px[i]));
    for (Eigen::Index k = 0; k < rank; ++k) {
      of_places[static_cast<std::size_t>(k)].at<float>(static_cast<int>(i) / across.places,
                                                       static_cast<int>(i) % across.places) =
          static_cast<float>(weights(k));
    }
  }
  for (std::size_t k = 0; k < terms.size(); ++k)
    terms[k].weights = AtPixels(of_places[k], size, across, down);
  return terms;
}

}  // namespace

cv::Mat Blurred(const cv::Mat& image, double step_px, const FieldBlur& blur) {
  // A size that the FFT likes; what is added continues the image periodically.
  const cv::Size size(cv::getOptimalDFTSize(image.cols), cv::getOptimalDFTSize(image.rows));
  cv::Mat sharp;
  cv::copyMakeBorder(image, sharp, 0, size.height - image.rows, 0, size.width - image.cols,
                     cv::BORDER_WRAP);
  const auto frequency = [&](int i, int count) {
    return static_cast<double>(2 * i <= count ? i : i - count) / (count * step_px);
  };
  cv::Mat spectrum = cv::Mat::zeros(size, CV_64FC2);
  for (const Term& term : Decompose(size, blur)) {
    ThrowIfCancelled();
    cv::Mat weights, part;
    term.weights.convertTo(weights, CV_64F);
    cv::dft(sharp.mul(weights), part, cv::DFT_COMPLEX_OUTPUT);
    for (int y = 0; y < size.height; ++y) {
      auto* sum = spectrum.ptr<cv::Vec2d>(y);
      const auto* of_part = part.ptr<cv::Vec2d>(y);
      for (int x = 0; x < size.width; ++x) {
        sum[x] += of_part[x] * TransferAt(blur, term.map_px,
                                          {frequency(x, size.width), frequency(y, size.height)});
      }
    }
  }
  cv::Mat blurred;
  cv::dft(spectrum, blurred, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  return blurred(cv::Rect(0, 0, image.cols, image.rows));
}

}  // namespace thicklens::model
