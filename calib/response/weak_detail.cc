#include "calib/response/weak_detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/registration/target_period.h"
#include "calib/response/response_sums.h"

namespace thicklens::calib {
namespace {

constexpr double kBand = 0.6;       // inner sigma of the band over that of the blur
constexpr double kBandWidth = 1.6;  // outer sigma of the band over the inner one
constexpr double kNeighbours = 2;   // sigma of the contrast's neighbourhood over the inner one
constexpr double kMinBlurPx = 1.2, kMaxBlurPx = 10;
constexpr double kMaxBlurOfSide = 1.0 / 30;
constexpr double kMinAddedPx2 = 1;
constexpr std::size_t kDetailFrames = 12;
constexpr int kRows = 3, kColumns = 4;  // parts of the field
constexpr std::size_t kContrasts = 4;   // classes of contrast in each part
constexpr double kMinIndependent = 40;  // pixels of a part over the square of the inner sigma
constexpr double kSmallestError = 1e-4;
constexpr double kMinResponse = 0.2;
constexpr double kMaxClipped = 0.002;  // share of the neighbourhood of a pixel

// Detail in a band of frequencies, relative to the mean.
cv::Mat Band(const cv::Mat& image, double sigma_px) {
  return (GaussianOf(image, sigma_px) - GaussianOf(image, kBandWidth * sigma_px)) /
         cv::mean(image)[0];
}

// The response of one class of contrast, and the logarithm of that contrast.
struct ResponseOfContrast {
  double response = 0, error = 0, log_contrast = 0;
};

struct DetailPixel {
  float contrast, seen, predicted, other;
};

ResponseOfContrast ResponseOf(const DetailPixel* begin, const DetailPixel* end,
                              double pixels_per_value) {
  double seen = 0, predicted = 0, power = 0;
  for (const DetailPixel* pixel = begin; pixel != end; ++pixel) {
    seen += static_cast<double>(pixel->seen) * pixel->other;
    predicted += static_cast<double>(pixel->predicted) * pixel->other;
    power += static_cast<double>(pixel->other) * pixel->other;
  }
  ResponseOfContrast found;
  found.response = seen / predicted;
  found.log_contrast = 0.5 * std::log(power / static_cast<double>(end - begin));
  double spread = 0;
  for (const DetailPixel* pixel = begin; pixel != end; ++pixel) {
    const double rest = pixel->seen - found.response * pixel->predicted;
    spread += rest * rest * pixel->other * pixel->other;
  }
  found.error = std::sqrt(spread * pixels_per_value) / std::abs(predicted) + kSmallestError;
  return found;
}

class DetailLoss {
 public:
  DetailLoss(const ResponseFrames& frames, cv::Size whole)
      : frames_(frames), crop_(frames, whole), order_(BySharpness(frames)) {}

  std::optional<model::Estimate> Run() {
    const double side = std::min(crop_.size().width, crop_.size().height);
    std::vector<std::size_t> blurred;
    for (std::size_t k = 2; k < order_.size(); ++k) {
      const double sigma_px = std::sqrt(frames_.frames[order_[k]].variance_px2);
      if (sigma_px > kMinBlurPx && sigma_px < std::min(kMaxBlurPx, kMaxBlurOfSide * side) &&
          crop_.AddedVariancePx2(order_[k], order_[0]) > kMinAddedPx2 &&
          crop_.AddedVariancePx2(order_[k], order_[1]) > kMinAddedPx2)
        blurred.push_back(order_[k]);
    }
    if (blurred.size() < 3) return std::nullopt;
    first_ = crop_.Read(order_[0]);
    if (MeasurePeriodPx(first_)) return std::nullopt;
    second_ = crop_.Read(order_[1]);
    for (std::size_t k = 0; k < sharp_clipped_.size(); ++k) {
      const cv::Mat clipped = ClippedPixels(k == 0 ? first_ : second_, frames_.frames[order_[k]]);
      if (cv::countNonZero(clipped) > 0) sharp_clipped_[k] = clipped;
    }
    // Processing shows best where detail is fine.
    blurred.resize(std::min(blurred.size(), kDetailFrames));
    for (const std::size_t index : blurred) AddFrame(index);
    return sums_.Slope();
  }

 private:
  cv::Mat Predicted(const cv::Mat& sharp, std::size_t of, std::size_t index) const {
    const double scale = crop_.Scale(index, of);
    const double added_px2 = crop_.AddedVariancePx2(index, of) / (scale * scale);
    return crop_.Seen(BlurredByShape(sharp, added_px2, frames_.psf), of, index);
  }

  // The share of each pixel's neighbourhood that is clipped in one of the three frames that are
  // compared. Clipping removes the detail of dark or bright places, whatever its contrast.
  cv::Mat ClippedShare(const cv::Mat& image, std::size_t index, double sigma_px) const {
    cv::Mat clipped = ClippedPixels(image, frames_.frames[index]);
    for (std::size_t k = 0; k < sharp_clipped_.size(); ++k) {
      const cv::Mat& there = sharp_clipped_[k];
      if (!there.empty()) clipped = cv::max(clipped, Predicted(there, order_[k], index));
    }
    return cv::countNonZero(clipped) > 0 ? GaussianOf(clipped, sigma_px) : clipped;
  }

  void AddFrame(std::size_t index) {
    const double sigma_px = std::sqrt(frames_.frames[index].variance_px2);
    const double inner_px = kBand * sigma_px;
    const int margin = static_cast<int>(4 * sigma_px) + 6;
    const cv::Size size = crop_.size();
    if (size.width <= 3 * margin || size.height <= 3 * margin) return;
    const cv::Rect inside(margin, margin, size.width - 2 * margin, size.height - 2 * margin);
    const cv::Mat image = crop_.Read(index);
    const cv::Mat seen = Band(image, inner_px)(inside);
    const cv::Mat predicted = Band(Predicted(first_, order_[0], index), inner_px)(inside);
    const cv::Mat other = Band(Predicted(second_, order_[1], index), inner_px)(inside);
    const cv::Mat contrast = GaussianOf(other.mul(other), kNeighbours * inner_px);
    const cv::Mat clipped = ClippedShare(image, index, kBandWidth * inner_px)(inside);
    for (int part = 0; part < kRows * kColumns; ++part) {
      const cv::Point from(part % kColumns * inside.width / kColumns,
                           part / kColumns * inside.height / kRows);
      const cv::Point to((part % kColumns + 1) * inside.width / kColumns,
                         (part / kColumns + 1) * inside.height / kRows);
      std::vector<DetailPixel> pixels;
      pixels.reserve(static_cast<std::size_t>((to - from).x) *
                     static_cast<std::size_t>((to - from).y));
      for (int y = from.y; y < to.y; ++y) {
        for (int x = from.x; x < to.x; ++x) {
          if (clipped.at<float>(y, x) > kMaxClipped) continue;
          pixels.push_back({contrast.at<float>(y, x), seen.at<float>(y, x),
                            predicted.at<float>(y, x), other.at<float>(y, x)});
        }
      }
      AddPart(part, index, inner_px, &pixels);
    }
  }

  void AddPart(int part, std::size_t index, double inner_px, std::vector<DetailPixel>* pixels) {
    if (static_cast<double>(pixels->size()) < kMinIndependent * inner_px * inner_px) return;
    // The classes are sorted by contrast, their pixels need not be.
    auto from = pixels->begin();
    for (std::size_t c = 1; c < kContrasts; ++c) {
      const auto to =
          pixels->begin() + static_cast<std::ptrdiff_t>(c * pixels->size() / kContrasts);
      std::nth_element(from, to, pixels->end(), [](const DetailPixel& a, const DetailPixel& b) {
        return a.contrast < b.contrast;
      });
      from = to;
    }
    std::array<ResponseOfContrast, kContrasts> classes;
    double weights = 0, response = 0, log_contrast = 0;
    for (std::size_t c = 0; c < kContrasts; ++c) {
      classes[c] = ResponseOf(pixels->data() + c * pixels->size() / kContrasts,
                              pixels->data() + (c + 1) * pixels->size() / kContrasts,
                              4 * CV_PI * inner_px * inner_px);
      const double weight = 1 / (classes[c].error * classes[c].error);
      weights += weight;
      response += weight * classes[c].response;
      log_contrast += weight * classes[c].log_contrast;
    }
    response /= weights;
    log_contrast /= weights;
    if (!std::isfinite(response) || !std::isfinite(log_contrast)) return;
    double product = 0, square = 0;
    for (const ResponseOfContrast& of : classes) {
      const double weight = 1 / (of.error * of.error);
      const double x = of.log_contrast - log_contrast;
      product += weight * x * (of.response - response);
      square += weight * x * x;
    }
    sums_.Add(part, index, product / std::max(std::abs(response), kMinResponse), square);
  }

  const ResponseFrames& frames_;
  ResponseCrop crop_;
  std::vector<std::size_t> order_;
  cv::Mat first_, second_;
  std::array<cv::Mat, 2> sharp_clipped_;  // of these two; empty if nothing is clipped
  ResponseSums sums_;
};

}  // namespace

std::optional<model::Estimate> MeasureWeakDetailLoss(const ResponseFrames& frames, cv::Size size) {
  if (frames.frames.size() < 5) return std::nullopt;
  return DetailLoss(frames, size).Run();
}

}  // namespace thicklens::calib
