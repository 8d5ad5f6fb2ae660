#ifndef THICKLENS_MODEL_SRC_TEXTURE_CANVAS_H_
#define THICKLENS_MODEL_SRC_TEXTURE_CANVAS_H_

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <complex>
#include <opencv2/core.hpp>

namespace thicklens::model {

// Samples of a texture's tile, of the coarsest px of its layer.
inline constexpr int kSamplesPerPixel = 4;
// A tile of 4096 x 4096 samples holds 256 MiB. What is larger is drawn coarser.
inline constexpr int kMaxTileSamples = 4096;
// No detail above it, in cycles per px: more would alias in the views.
inline constexpr double kHighestFrequency = 0.5;

// The frame of a drawing: a period of samples.
struct TextureCanvas {
  int columns = 0, rows = 0;
  Eigen::Vector2d spacing_mm{0, 0};
  Eigen::Vector2d origin_mm{0, 0};  // of the sample (0, 0)
  std::array<cv::Mat, 3> light;     // R, G, B; CV_32F

  double width_mm() const { return columns * spacing_mm.x(); }
  double height_mm() const { return rows * spacing_mm.y(); }
  Eigen::Vector2d PositionMm(int row, int column) const {
    return origin_mm + spacing_mm.cwiseProduct(Eigen::Vector2d(column, row));
  }
};

// From low_mm to at least high_mm, dark. `unit_mm`: the sides are
// whole multiples of it; 0: any length.
TextureCanvas MakeTextureCanvas(const Eigen::Vector2d& low_mm, const Eigen::Vector2d& high_mm,
                                double coarsest_pixel_mm, double unit_mm);

// Multiplies the spectrum of one of its channels by gain(fx, fy), cycles per mm, both >= 0.
template <typename Gain>
void FilterChannel(const TextureCanvas& canvas, const Gain& gain, cv::Mat* samples) {
  cv::Mat spectrum;
  cv::dft(*samples, spectrum, cv::DFT_COMPLEX_OUTPUT);
  for (int i = 0; i < spectrum.rows; ++i) {
    auto* row = spectrum.ptr<std::complex<float>>(i);
    const double fy = std::min(i, spectrum.rows - i) / canvas.height_mm();
    for (int j = 0; j < spectrum.cols; ++j) {
      row[j] *= static_cast<float>(gain(std::min(j, spectrum.cols - j) / canvas.width_mm(), fy));
    }
  }
  cv::dft(spectrum, *samples, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
}

// Takes away what the pixels cannot show, and gives back what the lines between the samples will
// take.
void LimitBand(double coarsest_pixel_mm, TextureCanvas* canvas);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SRC_TEXTURE_CANVAS_H_
