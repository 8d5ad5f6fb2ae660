#ifndef THICKLENS_CALIB_SPECTRUM_LINE_SPECTRUM_H_
#define THICKLENS_CALIB_SPECTRUM_LINE_SPECTRUM_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>

namespace thicklens::calib {

using Frequency = Eigen::Vector2d;  // cycles per px

// From 0 over 1 in the middle to 0, for t from 0 to 1; 0 outside.
double Hann(double t);

// Power spectrum of a frame under a Hann window, with an eye for lines: a periodic target's power
// stands in single points, an aperiodic one's is spread. Indices are those of a transform of twice
// the frame's size, so that the spectrum is twice as fine as the frame resolves.
class LineSpectrum {
 public:
  explicit LineSpectrum(const cv::Mat& grey);  // CV_32F

  double At(int kx, int ky) const;
  double At(const Frequency& f) const;
  cv::Point IndexOf(const Frequency& f) const;
  // Seen four times across the frame's shorter side, and not so fine that pixels hide it.
  bool Resolves(const Frequency& f) const;

  // Power beside a line that stands alone: 2.5 to 3.5 times the frame's own resolution away, where
  // a Hann window leaves less than 1e-3 of the line.
  struct Surroundings {
    double largest = 0, mean = 0;
  };
  Surroundings Beside(int kx, int ky) const;

  // The strongest lone line for which `wanted`; of each pair +f, -f one.
  std::optional<Frequency> StrongestLine(const std::function<bool(const Frequency&)>& wanted) const;

  // The frequency of which `f` is a multiple: lines of a grid that are broken in halves or thirds
  // make the second or third line the strongest.
  Frequency Fundamental(Frequency f) const;

 private:
  Frequency Of(int kx, int ky) const;
  double LowestFrequency() const;
  bool HasLinesBetween(const Frequency& f, int divisor) const;
  double LargestNear(int kx, int ky) const;
  Frequency Refined(int kx, int ky) const;

  cv::Size size_;
  cv::Mat power_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_LINE_SPECTRUM_H_
