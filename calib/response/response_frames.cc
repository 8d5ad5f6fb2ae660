#include "calib/response/response_frames.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace thicklens::calib {
namespace {

constexpr int kLargestCropPx = 512;

// A disc of the given radius, with the share of each pixel of its rim, sum 1.
cv::Mat DiscKernel(double radius_px) {
  constexpr int kSubpixels = 8;  // per pixel and axis
  const int reach = static_cast<int>(std::ceil(radius_px + 0.5));
  cv::Mat kernel = cv::Mat::zeros(2 * reach + 1, 2 * reach + 1, CV_32F);
  for (int y = 0; y < kernel.rows; ++y) {
    for (int x = 0; x < kernel.cols; ++x) {
      int inside = 0;
      for (int part = 0; part < kSubpixels * kSubpixels; ++part) {
        const int column = part % kSubpixels, row = part / kSubpixels;
        const double u = x - reach + (column + 0.5) / kSubpixels - 0.5;
        const double v = y - reach + (row + 0.5) / kSubpixels - 0.5;
        inside += u * u + v * v <= radius_px * radius_px ? 1 : 0;
      }
      kernel.at<float>(y, x) = static_cast<float>(inside);
    }
  }
  return kernel / cv::sum(kernel)[0];
}

struct Rotation {
  explicit Rotation(double angle_rad) : c(std::cos(angle_rad)), s(std::sin(angle_rad)) {}
  Eigen::Vector2d operator()(const Eigen::Vector2d& d) const {
    return {c * d.x() - s * d.y(), s * d.x() + c * d.y()};
  }
  double c, s;
};

// The place in one frame of what another one shows, for many places.
class Mapping {
 public:
  Mapping(const Registration& from, const Registration& to, const Eigen::Vector2d& centre)
      : from_(from), to_(to), centre_(centre), back_(-from.rotation_rad), on_(to.rotation_rad) {}

  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const {
    Eigen::Vector2d d = p - centre_ - from_.shift_px;
    d *= 1 - from_.cubic * d.squaredNorm();
    d = back_(d) / from_.scale;
    d = on_(d) * to_.scale;
    d *= 1 + to_.cubic * d.squaredNorm();
    return centre_ + to_.shift_px + d;
  }

 private:
  const Registration& from_;
  const Registration& to_;
  Eigen::Vector2d centre_;
  Rotation back_, on_;
};

}  // namespace

ResponseCrop::ResponseCrop(const ResponseFrames& frames, cv::Size whole) : frames_(frames) {
  const int width = std::min(whole.width, kLargestCropPx);
  const int height = std::min(whole.height, kLargestCropPx);
  part_ = cv::Rect((whole.width - width) / 2, (whole.height - height) / 2, width, height);
  centre_ = {frames.centre.x - part_.x, frames.centre.y - part_.y};
}

cv::Mat ResponseCrop::Read(std::size_t index) const {
  frames_.tick();
  return frames_.read_grey(frames_.frames[index].frame)(part_).clone();
}

Eigen::Vector2d ResponseCrop::Place(std::size_t from, std::size_t to,
                                    const Eigen::Vector2d& p) const {
  return Mapping(frames_.frames[from].registration, frames_.frames[to].registration, centre_)(p);
}

cv::Mat ResponseCrop::Seen(const cv::Mat& image, std::size_t of, std::size_t as) const {
  const Mapping mapping(frames_.frames[as].registration, frames_.frames[of].registration, centre_);
  cv::Mat map(part_.size(), CV_32FC2), seen;
  for (int y = 0; y < map.rows; ++y) {
    auto* at = map.ptr<cv::Vec2f>(y);
    for (int x = 0; x < map.cols; ++x) {
      const Eigen::Vector2d place = mapping({x, y});
      at[x] = {static_cast<float>(place.x()), static_cast<float>(place.y())};
    }
  }
  cv::remap(image, seen, map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
  return seen;
}

double ResponseCrop::Scale(std::size_t of, std::size_t to) const {
  return frames_.frames[of].registration.scale / frames_.frames[to].registration.scale;
}

double ResponseCrop::AddedVariancePx2(std::size_t of, std::size_t than) const {
  const double scale = Scale(of, than);
  return frames_.frames[of].variance_px2 - scale * scale * frames_.frames[than].variance_px2;
}

cv::Mat ClippedPixels(const cv::Mat& image, const ResponseFrame& frame) {
  cv::Mat clipped = (image >= frame.brightest) | (image <= frame.darkest);
  if (!frame.filled.empty()) {
    const cv::Rect part((frame.filled.cols - image.cols) / 2, (frame.filled.rows - image.rows) / 2,
                        image.cols, image.rows);
    clipped |= frame.filled(part) != 0;
  }
  clipped.convertTo(clipped, CV_32F, 1.0 / 255);
  return clipped;
}

cv::Mat GaussianOf(const cv::Mat& image, double sigma_px) {
  if (!(sigma_px > 0)) return image;
  cv::Mat blurred;
  cv::GaussianBlur(image, blurred, cv::Size(), sigma_px, sigma_px, cv::BORDER_REFLECT_101);
  return blurred;
}

cv::Mat BlurredByShape(const cv::Mat& image, double variance_px2, model::Psf psf) {
  if (psf == model::Psf::kGaussian) return GaussianOf(image, std::sqrt(variance_px2));
  cv::Mat blurred;  // the variance of a disc is a quarter of its squared radius
  cv::filter2D(image, blurred, -1, DiscKernel(2 * std::sqrt(variance_px2)), cv::Point(-1, -1), 0,
               cv::BORDER_REFLECT_101);
  return blurred;
}

std::vector<std::size_t> BySharpness(const ResponseFrames& frames) {
  std::vector<std::size_t> order(frames.frames.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto blur = [&](std::size_t i) {
    const ResponseFrame& frame = frames.frames[i];
    return frame.variance_px2 / (frame.registration.scale * frame.registration.scale);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return blur(a) < blur(b); });
  return order;
}

std::vector<std::size_t> Spread(const std::vector<std::size_t>& indices, std::size_t count) {
  if (indices.size() <= count) return indices;
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < count; ++i)
    chosen.push_back(indices[i * (indices.size() - 1) / (count - 1)]);
  return chosen;
}

}  // namespace thicklens::calib
