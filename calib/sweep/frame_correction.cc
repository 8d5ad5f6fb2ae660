#include "thicklens/calib/frame_correction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::calib {
namespace {

// Farther from the sound pixels, nothing is interpolated.
constexpr double kFarthestPx = 32;

// Farther than this many times the distance of the nearest sound pixel, the weights are small.
constexpr double kReach = 10;
constexpr int kConnected = 8;

// Whether a pixel borders on the hole of that number.
bool Touches(const cv::Mat& holes, int x, int y, int hole) {
  for (int v = std::max(0, y - 1); v <= std::min(y + 1, holes.rows - 1); ++v) {
    for (int u = std::max(0, x - 1); u <= std::min(x + 1, holes.cols - 1); ++u) {
      if (holes.at<int>(v, u) == hole) return true;
    }
  }
  return false;
}

std::string SizeText(const cv::Size& size) {
  return fmt::format("{} x {} px", size.width, size.height);
}

void RequireLight(const cv::Mat& image, const char* name) {
  if (image.depth() != CV_32F || (image.channels() != 1 && image.channels() != 3)) {
    throw Error(fmt::format("{}: linear light as floats with 1 or 3 channels is expected", name));
  }
  if (!cv::checkRange(image)) throw Error(fmt::format("{}: its values must be finite", name));
}

// Takes the size of the first image; the others must have it.
void TakeSize(const cv::Mat& image, const char* name, cv::Size* size) {
  if (size->empty()) *size = image.size();
  if (image.size() == *size) return;
  throw Error(fmt::format("{}: {} are expected as in the other images of the correction, found {}",
                          name, SizeText(*size), SizeText(image.size())));
}

}  // namespace

FrameCorrection::FrameCorrection(const cv::Mat& dark, const cv::Mat& flat, const cv::Mat& defects) {
  if (!dark.empty()) {
    RequireLight(dark, "dark");
    TakeSize(dark, "dark", &size_px_);
    dark_ = dark.clone();
    channels_ = dark.channels();
  }
  if (!defects.empty()) {
    if (defects.type() != CV_8U) throw Error("defects: a mask of one byte per pixel is expected");
    TakeSize(defects, "defects", &size_px_);
    defects_ = defects != 0;
  }
  if (!flat.empty()) {
    RequireLight(flat, "flat");
    TakeSize(flat, "flat", &size_px_);
    if (channels_ != 0 && flat.channels() != channels_) {
      throw Error(fmt::format("flat: it has {} channel(s), but the dark has {}", flat.channels(),
                              channels_));
    }
    channels_ = flat.channels();
    TakeFlat(flat);
  }
  if (!defects_.empty()) {
    FindNeighbours(defects.empty() ? cv::Mat(cv::Mat::zeros(size_px_, CV_8U))
                                   : cv::Mat(defects != 0));
  }
}

void FrameCorrection::TakeFlat(const cv::Mat& flat) {
  const cv::Mat light = dark_.empty() ? flat : cv::Mat(flat - dark_);
  const cv::Mat sound = defects_.empty() ? cv::Mat() : cv::Mat(defects_ == 0);
  const cv::Scalar means = cv::mean(light, sound);
  std::vector<cv::Mat> gains;
  cv::Mat unlit = cv::Mat::zeros(size_px_, CV_8U);
  for (int c = 0; c < channels_; ++c) {
    const double mean = means[c];
    if (!(mean > 0)) {
      throw Error(
          fmt::format("flat: its mean is {:.4g} of full scale{}: light is needed to divide by",
                      mean, dark_.empty() ? "" : " after the dark was subtracted"));
    }
    cv::Mat channel, gain;
    cv::extractChannel(light, channel, c);
    const cv::Mat none = channel < kMinFlat * mean;
    cv::divide(mean, channel, gain);
    gain.setTo(1, none);
    unlit |= none;
    gains.push_back(gain);
  }
  cv::merge(gains, gain_);
  if (cv::countNonZero(unlit) == 0) return;
  if (defects_.empty()) {
    defects_ = unlit;
  } else {
    defects_ |= unlit;
  }
}

void FrameCorrection::FindNeighbours(const cv::Mat& given) {
  // The sound pixels that border on a defect, and the distance from each defect to a sound pixel.
  cv::Mat widened, distance;
  cv::dilate(defects_, widened, cv::Mat::ones(3, 3, CV_8U));
  const cv::Mat border = widened & (defects_ == 0);
  cv::distanceTransform(defects_, distance, cv::DIST_L2, cv::DIST_MASK_5);
  const cv::Mat deep = distance > kFarthestPx;
  if (cv::countNonZero(deep & given) > 0) {
    throw Error(fmt::format(
        "defects: a hole is wider than {:.0f} px to each side: what was there cannot be "
        "interpolated; leave it out by the region that is measured",
        kFarthestPx));
  }
  // Where a flat has no light far around, like outside of an image circle, the frame stays dark.
  defects_.setTo(0, deep);
  unlit_ = static_cast<std::size_t>(cv::countNonZero(defects_ & (given == 0)));
  const int count = cv::countNonZero(defects_);
  if (2 * static_cast<std::size_t>(count) > defects_.total()) {
    throw Error(fmt::format("defects: {} of {} pixels are defective: at most half may be", count,
                            defects_.total()));
  }
  if (count == 0) {
    defects_.release();
    return;
  }
  cv::Mat holes;
  cv::connectedComponents(defects_, holes, kConnected, CV_32S);
  replaced_.reserve(static_cast<std::size_t>(count));
  for (int y = 0; y < defects_.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < defects_.cols; ++x) {
      if (defects_.at<std::uint8_t>(y, x) == 0) continue;
      replaced_.push_back({y * defects_.cols + x, neighbours_.size()});
      const int own = holes.at<int>(y, x);
      const int reach = static_cast<int>(std::ceil(kReach * distance.at<float>(y, x)));
      double sum = 0;
      for (int v = std::max(0, y - reach); v <= std::min(y + reach, defects_.rows - 1); ++v) {
        for (int u = std::max(0, x - reach); u <= std::min(x + reach, defects_.cols - 1); ++u) {
          const int square = (u - x) * (u - x) + (v - y) * (v - y);
          if (border.at<std::uint8_t>(v, u) == 0 || square > reach * reach ||
              !Touches(holes, u, v, own))
            continue;
          neighbours_.push_back({v * defects_.cols + u, 1.0F / static_cast<float>(square)});
          sum += 1.0 / square;
        }
      }
      for (std::size_t i = replaced_.back().first; i < neighbours_.size(); ++i)
        neighbours_[i].weight /= static_cast<float>(sum);
    }
  }
}

void FrameCorrection::RequireSize(const cv::Mat& light) const {
  if (light.type() != CV_32FC1) throw Error("one channel of linear light as floats is expected");
  if (light.size() == size_px_) return;
  throw Error(fmt::format("the frame has {}, but dark, flat and defects have {}",
                          SizeText(light.size()), SizeText(size_px_)));
}

void FrameCorrection::Apply(int channel, cv::Mat* light) const {
  if (channels_ == 0) return;
  RequireSize(*light);
  const int from = channels_ == 1 ? 0 : channel;
  if (from < 0 || from >= channels_) {
    throw Error(fmt::format("channel {} is requested of a correction with {} channel(s)", channel,
                            channels_));
  }
  for (int y = 0; y < light->rows; ++y) {
    ThrowIfCancelled();
    auto* out = light->ptr<float>(y);
    const float* dark = dark_.empty() ? nullptr : dark_.ptr<float>(y) + from;
    const float* gain = gain_.empty() ? nullptr : gain_.ptr<float>(y) + from;
    for (int x = 0; x < light->cols; ++x) {
      const auto at = static_cast<std::ptrdiff_t>(x) * channels_;
      if (dark != nullptr) out[x] -= dark[at];
      if (gain != nullptr) out[x] *= gain[at];
    }
  }
}

void FrameCorrection::ReplaceDefects(cv::Mat* light) const {
  if (replaced_.empty()) return;
  RequireSize(*light);
  const auto pixel = [light](int index) -> float& {
    return light->at<float>(index / light->cols, index % light->cols);
  };
  // The neighbours are sound, so that no pixel that is replaced is read.
  for (std::size_t i = 0; i < replaced_.size(); ++i) {
    const std::size_t end = i + 1 < replaced_.size() ? replaced_[i + 1].first : neighbours_.size();
    double value = 0;
    for (std::size_t n = replaced_[i].first; n < end; ++n)
      value += static_cast<double>(neighbours_[n].weight * pixel(neighbours_[n].pixel));
    pixel(replaced_[i].pixel) = static_cast<float>(value);
  }
}

}  // namespace thicklens::calib
