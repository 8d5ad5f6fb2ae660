#ifndef THICKLENS_MODEL_SIMULATE_SCENE_TEXTURE_CANVAS_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_TEXTURE_CANVAS_H_

#include <Eigen/Core>
#include <array>
#include <functional>
#include <opencv2/core.hpp>

namespace thicklens::model {

// Samples of a texture's tile per coarsest px of its layer.
inline constexpr int kSamplesPerPixel = 4;
// A tile of 4096 x 4096 samples has 256 MiB. Larger tiles are drawn with a coarser spacing.
inline constexpr int kMaxTileSamples = 4096;
// Highest frequency of the detail, in cycles per px; higher ones would alias in the views.
inline constexpr double kHighestFrequency = 0.5;

// The samples of one period and their positions.
struct TextureCanvas {
  int columns = 0, rows = 0;
  Eigen::Vector2d spacing_mm{0, 0};
  Eigen::Vector2d origin_mm{0, 0};  // position of the sample (0, 0)
  std::array<cv::Mat, 3> light;     // R, G, B; CV_32F

  double width_mm() const { return columns * spacing_mm.x(); }
  double height_mm() const { return rows * spacing_mm.y(); }
  Eigen::Vector2d PositionMm(int row, int column) const {
    return origin_mm + spacing_mm.cwiseProduct(Eigen::Vector2d(column, row));
  }
};

// Returns a dark canvas from low_mm to at least high_mm. The sides are whole multiples of
// `unit_mm`; if it is 0, they have any length.
TextureCanvas MakeTextureCanvas(const Eigen::Vector2d& low_mm, const Eigen::Vector2d& high_mm,
                                double coarsest_pixel_mm, double unit_mm);

// Multiplies the spectrum of samples of the canvas, CV_32F, by gain(fx, fy), where fx and fy are
// cycles per mm and >= 0. The gain is 0 beyond `highest_per_mm`: only lower frequencies are
// computed, and of these only the half whose conjugates are the other half. `gain` is called from
// any thread.
void FilterSamples(const TextureCanvas& canvas, double highest_per_mm,
                   const std::function<double(double fx, double fy)>& gain, int threads,
                   cv::Mat* samples);

// Removes the frequencies that the pixels cannot show, and compensates for the linear interpolation
// between the samples.
void LimitBand(double coarsest_pixel_mm, int threads, TextureCanvas* canvas);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_TEXTURE_CANVAS_H_
