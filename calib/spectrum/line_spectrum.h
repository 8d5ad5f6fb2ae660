#ifndef THICKLENS_CALIB_SPECTRUM_LINE_SPECTRUM_H_
#define THICKLENS_CALIB_SPECTRUM_LINE_SPECTRUM_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>

namespace thicklens::calib {

using Frequency = Eigen::Vector2d;  // cycles per px

// Hann window: rises from 0 to 1 at the middle and falls to 0, for t from 0 to 1; 0 outside.
double Hann(double t);

// Power spectrum of a frame under a Hann window, for the detection of lines: the power of a
// periodic target is concentrated in single points, that of an aperiodic one is spread. Indices are
// those of a transform of twice the frame's size, so that the spectrum is sampled twice as finely
// as the frame resolves.
class LineSpectrum {
 public:
  explicit LineSpectrum(const cv::Mat& grey);  // CV_32F

  double At(int kx, int ky) const;
  double At(const Frequency& f) const;
  cv::Point IndexOf(const Frequency& f) const;
  // Whether the frame's shorter side contains at least four periods, and the period is not so fine
  // that the pixels hide it.
  bool Resolves(const Frequency& f) const;

  // Power beside an isolated line, at 2.5 to 3.5 times the frame's own resolution, where a Hann
  // window leaves less than 1e-3 of the line.
  struct Surroundings {
    double largest = 0, mean = 0;
  };
  Surroundings Beside(int kx, int ky) const;

  // The strongest isolated line for which `wanted` is true; one of each pair +f, -f.
  std::optional<Frequency> StrongestLine(const std::function<bool(const Frequency&)>& wanted) const;

  // The frequency of which `f` is a multiple. In a grid whose lines are broken in halves or thirds,
  // the second or third line is the strongest.
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
