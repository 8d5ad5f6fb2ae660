#include "calib/spectrum/line_spectrum.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr double kMinPeriods = 4;           // across the shorter side
constexpr double kHighestFrequency = 0.44;  // cycles per px, along each axis

}  // namespace

double Hann(double t) { return t > 0 && t < 1 ? 0.5 - 0.5 * std::cos(2 * CV_PI * t) : 0; }

LineSpectrum::LineSpectrum(const cv::Mat& grey) : size_(grey.size()) {
  cv::Mat wx(1, grey.cols, CV_32F), wy(grey.rows, 1, CV_32F);
  for (int x = 0; x < grey.cols; ++x)
    wx.at<float>(x) = static_cast<float>(Hann((x + 0.5) / grey.cols));
  for (int y = 0; y < grey.rows; ++y)
    wy.at<float>(y) = static_cast<float>(Hann((y + 0.5) / grey.rows));
  const cv::Mat window = wy * wx;
  const double mean = grey.dot(window) / cv::sum(window)[0];
  cv::Mat padded = cv::Mat::zeros(cv::getOptimalDFTSize(2 * grey.rows),
                                  cv::getOptimalDFTSize(2 * grey.cols), CV_32F);
  cv::Mat inside = padded(cv::Rect({0, 0}, grey.size()));
  cv::multiply(grey - mean, window, inside);
  cv::Mat transform;
  cv::dft(padded, transform, cv::DFT_COMPLEX_OUTPUT);
  std::vector<cv::Mat> parts;
  cv::split(transform, parts);
  power_ = parts[0].mul(parts[0]) + parts[1].mul(parts[1]);
}

double LineSpectrum::At(int kx, int ky) const {
  const int x = (kx % power_.cols + power_.cols) % power_.cols;
  const int y = (ky % power_.rows + power_.rows) % power_.rows;
  return power_.at<float>(y, x);
}

double LineSpectrum::At(const Frequency& f) const {
  const cv::Point index = IndexOf(f);
  return At(index.x, index.y);
}

cv::Point LineSpectrum::IndexOf(const Frequency& f) const {
  return {cvRound(f.x() * power_.cols), cvRound(f.y() * power_.rows)};
}

Frequency LineSpectrum::Of(int kx, int ky) const {
  return {kx / static_cast<double>(power_.cols), ky / static_cast<double>(power_.rows)};
}

double LineSpectrum::LowestFrequency() const {
  return kMinPeriods / std::min(size_.width, size_.height);
}

bool LineSpectrum::Resolves(const Frequency& f) const {
  return f.norm() >= LowestFrequency() && f.cwiseAbs().maxCoeff() <= kHighestFrequency;
}

LineSpectrum::Surroundings LineSpectrum::Beside(int kx, int ky) const {
  const double bin_x = static_cast<double>(power_.cols) / size_.width;
  const double bin_y = static_cast<double>(power_.rows) / size_.height;
  const int reach_x = static_cast<int>(3.5 * bin_x), reach_y = static_cast<int>(3.5 * bin_y);
  Surroundings result;
  int count = 0;
  for (int dy = -reach_y; dy <= reach_y; ++dy) {
    for (int dx = -reach_x; dx <= reach_x; ++dx) {
      const double distance = std::hypot(dx / bin_x, dy / bin_y);
      if (distance < 2.5 || distance > 3.5) continue;
      const double here = At(kx + dx, ky + dy);
      result.largest = std::max(result.largest, here);
      result.mean += here;
      ++count;
    }
  }
  result.mean /= count;
  return result;
}

std::optional<Frequency> LineSpectrum::StrongestLine(
    const std::function<bool(const Frequency&)>& wanted) const {
  constexpr double kLone = 10;  // the largest value of a random texture is about 3
  constexpr int kTries = 60;
  struct Peak {
    double power;
    int kx, ky;
  };
  std::vector<Peak> peaks;
  for (int ky = 0; ky <= power_.rows / 2; ++ky) {
    ThrowIfCancelled();
    for (int kx = -power_.cols / 2 + 1; kx <= power_.cols / 2; ++kx) {
      if (ky == 0 && kx <= 0) continue;
      const double here = At(kx, ky);
      if (!(here > At(kx - 1, ky)) || !(here > At(kx + 1, ky)) || !(here > At(kx, ky - 1)) ||
          !(here > At(kx, ky + 1))) {
        continue;
      }
      const Frequency f = Of(kx, ky);
      if (Resolves(f) && wanted(f)) peaks.push_back({here, kx, ky});
    }
  }
  const auto tried = std::min<std::size_t>(peaks.size(), kTries);
  std::partial_sort(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(tried), peaks.end(),
                    [](const Peak& a, const Peak& b) { return a.power > b.power; });
  for (std::size_t i = 0; i < tried; ++i) {
    if (peaks[i].power > kLone * Beside(peaks[i].kx, peaks[i].ky).largest)
      return Refined(peaks[i].kx, peaks[i].ky);
  }
  return std::nullopt;
}

Frequency LineSpectrum::Fundamental(Frequency f) const {
  for (bool found = true; found;) {
    found = false;
    for (const int divisor : {2, 3}) {
      const Frequency part = f / divisor;
      if (part.norm() < LowestFrequency() || !HasLinesBetween(f, divisor)) continue;
      f = part;
      found = true;
      break;
    }
  }
  return f;
}

// Whether the multiples of f/divisor that are no multiples of f stand out, on the average of their
// logarithms. For noise that average is 0 or less.
bool LineSpectrum::HasLinesBetween(const Frequency& f, int divisor) const {
  constexpr double kStandsOut = 1.5;
  double sum = 0;
  int count = 0;
  for (int m = 1; m < 3 * divisor; ++m) {
    const Frequency line = f * m / divisor;
    if (m % divisor == 0 || !Resolves(line)) continue;
    const cv::Point k = IndexOf(line);
    sum += std::log(LargestNear(k.x, k.y) / Beside(k.x, k.y).mean);
    ++count;
  }
  return count >= 2 && sum > kStandsOut * count;
}

double LineSpectrum::LargestNear(int kx, int ky) const {
  double largest = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) largest = std::max(largest, At(kx + dx, ky + dy));
  }
  return largest;
}

// The maximum of a parabola through the logarithms, along each axis.
Frequency LineSpectrum::Refined(int kx, int ky) const {
  const auto shift = [](double before, double here, double after) {
    const double a = std::log(before), b = std::log(here), c = std::log(after);
    return std::clamp(0.5 * (a - c) / (a - 2 * b + c), -0.5, 0.5);
  };
  const double sx = shift(At(kx - 1, ky), At(kx, ky), At(kx + 1, ky));
  const double sy = shift(At(kx, ky - 1), At(kx, ky), At(kx, ky + 1));
  return {(kx + sx) / power_.cols, (ky + sy) / power_.rows};
}

}  // namespace thicklens::calib
