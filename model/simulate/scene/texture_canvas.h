#ifndef THICKLENS_MODEL_SIMULATE_SCENE_TEXTURE_CANVAS_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_TEXTURE_CANVAS_H_

#include <Eigen/Core>
#include <array>
#include <functional>
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

// Multiplies the spectrum of samples of the canvas, CV_32F, by gain(fx, fy), cycles per mm, both
// >= 0, which is 0 beyond `highest_per_mm`: only the frequencies up to it are worked out, and of
// these the half whose conjugates the others are. `gain` is called from any thread.
void FilterSamples(const TextureCanvas& canvas, double highest_per_mm,
                   const std::function<double(double fx, double fy)>& gain, int threads,
                   cv::Mat* samples);

// Takes away what the pixels cannot show, and gives back what the lines between the samples will
// take.
void LimitBand(double coarsest_pixel_mm, int threads, TextureCanvas* canvas);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_TEXTURE_CANVAS_H_
