#ifndef THICKLENS_CALIB_FRAME_AVERAGE_H_
#define THICKLENS_CALIB_FRAME_AVERAGE_H_

#include <cstddef>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens::calib {

// How exposures of one scene are averaged, pixel by pixel.
enum class FrameAveraging {
  kClippedMean,  // the mean of the values within 4 standard deviations of the median
  kMedian,       // the median
  kMean,         // the mean
};
// Name of the method: "clipped-mean", "median" or "mean".
THICKLENS_EXPORT std::string FrameAveragingName(FrameAveraging method);

// Returns an exposure in linear light with full scale 1, CV_32F with 1 or 3 channels. Throws Error
// that names it.
using LightReader = std::function<cv::Mat(std::size_t index)>;

// The average of exposures of one scene.
struct FrameAverage {
  cv::Mat light;           // CV_32F, as the exposures
  std::size_t frames = 0;  // how many exposures were averaged
  double mean_level = 0;   // mean of `light` over all pixels and channels
  // Standard deviation of a pixel of one exposure, median over the pixels (root mean square, if
  // half of the pixels do not vary). Of a single exposure it is found from neighbouring pixels, so
  // that it includes what is fixed to the pixels.
  double noise_sigma = 0;
  double left_out = 0;  // share of the values that kClippedMean left out
};

// Averages exposures. The median and the clipped mean read all of them several times if they need
// more than `byte_limit` bytes as floats. Fewer than 3 exposures have no outliers: their mean is
// taken. Throws Error if there is none or if their types or sizes differ.
THICKLENS_EXPORT FrameAverage AverageFrames(std::size_t count, const LightReader& read,
                                            FrameAveraging method,
                                            std::size_t byte_limit = std::size_t{512} << 20);

// Which pixels are defective.
struct DefectOptions {
  // A hot pixel is brighter in the dark than the median of the 5 x 5 px around it by more than this
  // many robust standard deviations of that difference over the frame, and by more than
  // `least_hot`.
  double hot_sigmas = 8;
  double least_hot = 0.005;  // linear light, full scale 1
  // A pixel is dead, or stuck, if its flat differs by more than this part from the median of the
  // 5 x 5 px around it.
  double flat_deviation = 0.25;

  // The values are finite and > 0; the last is below 1.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The pixels that are defective.
struct Defects {
  cv::Mat mask;          // CV_8U, 255 where a pixel is defective in any channel
  std::size_t hot = 0;   // pixels found in the dark
  std::size_t dead = 0;  // pixels found in the flat, among them those that are too bright
};

// Finds single defective pixels in the averages of darks and flats, in linear light; one of them
// may be empty. The dark is subtracted from the flat. What is wider than the 5 x 5 px of the median
// by half, like dust, is shading that the division by the flat removes. Throws Error if both are
// empty, and for types or sizes that differ.
THICKLENS_EXPORT Defects FindDefects(const cv::Mat& dark, const cv::Mat& flat,
                                     const DefectOptions& options = {});

// Structure of a flat between the scale of its noise and that of shading, as a target or a printed
// surface leaves it.
struct FlatStructure {
  double relative = 0;  // its robust standard deviation over the mean, in blocks of 4 x 4 px
  double of_noise = 0;  // the same that its pixels' noise alone would leave
};
// Measures a flat in linear light, CV_32F, of which the dark was subtracted; each channel by
// itself, the largest is returned. Single specks do not count.
THICKLENS_EXPORT FlatStructure StructureOf(const cv::Mat& flat);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_AVERAGE_H_
