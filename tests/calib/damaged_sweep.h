#ifndef THICKLENS_TESTS_CALIB_DAMAGED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_DAMAGED_SWEEP_H_

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <utility>
#include <vector>

#include "tests/calib/simulated_sweep.h"

// Faults of a bench, applied to a simulated sweep.
namespace thicklens::testing {

// Copies the frames as well, so that they can be damaged without a change to the original.
inline SimulatedSweep DeepCopy(const SimulatedSweep& original) {
  SimulatedSweep copy = original;
  copy.stored = std::make_shared<std::vector<cv::Mat>>();
  for (const cv::Mat& frame : *original.stored) copy.stored->push_back(frame.clone());
  copy.sweep.read_frame = [stored = copy.stored](std::size_t i) { return (*stored)[i]; };
  return copy;
}

// Keeps every `every`th frame, including the first one.
inline SimulatedSweep Thinned(const SimulatedSweep& original, std::size_t every) {
  SimulatedSweep thinned = original;
  thinned.stored = std::make_shared<std::vector<cv::Mat>>();
  thinned.sweep.frames.clear();
  for (std::size_t i = 0; i < original.stored->size(); i += every) {
    thinned.stored->push_back((*original.stored)[i]);
    thinned.sweep.frames.push_back(original.sweep.frames[i]);
  }
  thinned.sweep.read_frame = [stored = thinned.stored](std::size_t i) { return (*stored)[i]; };
  return thinned;
}

// The frames that PlantFaults damaged: among them a reading that is off by `shift_mm`, and two
// exchanged frames, whose readings are off by `swap_mm`.
struct PlantedFaults {
  std::size_t black = 0, white = 0, overexposed = 0, smeared = 0;
  std::size_t shifted = 0;
  double shift_mm = 0;
  std::size_t swapped_first = 0, swapped_second = 0;
  double swap_mm = 0;
};

// Damages seven frames of a sweep of thirty or more, on both sides of a focus in the middle. The
// smeared frame is near focus, because a smear that is smaller than the defocus is invisible.
inline PlantedFaults PlantFaults(SimulatedSweep* simulated) {
  const auto at = [&](double part) {
    return static_cast<std::size_t>(part * static_cast<double>(simulated->stored->size()));
  };
  PlantedFaults faults;
  faults.black = at(0.1);
  faults.white = at(0.2);
  faults.swapped_first = at(0.25);
  faults.overexposed = at(0.3);
  faults.swapped_second = faults.swapped_first + 6;
  faults.shifted = at(0.65);
  faults.smeared = at(0.6);
  auto& frames = *simulated->stored;
  auto& readings = simulated->sweep.frames;
  frames[faults.black].setTo(0);
  frames[faults.white].setTo(255);
  frames[faults.overexposed].convertTo(frames[faults.overexposed], CV_8U, 4);
  cv::blur(frames[faults.smeared], frames[faults.smeared], cv::Size(15, 1));
  const double step_mm = readings[1].reading_mm - readings[0].reading_mm;
  faults.shift_mm = 4 * std::round(step_mm);
  readings[faults.shifted].reading_mm += faults.shift_mm;
  faults.swap_mm =
      readings[faults.swapped_second].reading_mm - readings[faults.swapped_first].reading_mm;
  cv::swap(frames[faults.swapped_first], frames[faults.swapped_second]);
  return faults;
}

// Gives the first frame the reading of the last one, and so on.
inline void ReverseReadings(SimulatedSweep* simulated) {
  auto& frames = simulated->sweep.frames;
  for (std::size_t i = 0, j = frames.size() - 1; i < j; ++i, --j) {
    std::swap(frames[i].reading_mm, frames[j].reading_mm);
  }
}

inline void ScaleReadings(SimulatedSweep* simulated, double factor) {
  for (model::SweepFrame& frame : simulated->sweep.frames) frame.reading_mm *= factor;
}

inline void StoreAsJpeg(SimulatedSweep* simulated, int quality) {
  for (cv::Mat& frame : *simulated->stored) {
    std::vector<unsigned char> bytes;
    cv::imencode(".jpg", frame, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
    frame = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  }
}

// Multiplies and adds pixel by pixel, in the same way in each frame.
inline void ApplyToEachFrame(SimulatedSweep* simulated, const cv::Mat& gain, const cv::Mat& add) {
  for (cv::Mat& frame : *simulated->stored) {
    cv::Mat light;
    frame.convertTo(light, CV_32F);
    light = light.mul(gain) + add;
    light.convertTo(frame, CV_8U);
  }
}

// exp(-r^2/(2 sigma^2)) about a point of the sensor.
inline cv::Mat Spot(cv::Size size, cv::Point2d centre_px, double sigma_px) {
  cv::Mat spot(size, CV_32F);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const double r2 = std::pow(x - centre_px.x, 2) + std::pow(y - centre_px.y, 2);
      spot.at<float>(y, x) = static_cast<float>(std::exp(-r2 / (2 * sigma_px * sigma_px)));
    }
  }
  return spot;
}

// Six dark spots on the sensor, 2 px wide, that take 15 % of the light.
inline void AddDust(SimulatedSweep* simulated) {
  const cv::Size size = simulated->frame(0).size();
  cv::Mat gain(size, CV_32F, cv::Scalar(1));
  std::mt19937 engine(9);
  for (int i = 0; i < 6; ++i) {
    const auto x = static_cast<double>(engine() % static_cast<unsigned>(size.width));
    const auto y = static_cast<double>(engine() % static_cast<unsigned>(size.height));
    gain -= 0.15 * Spot(size, {x, y}, 2);
  }
  ApplyToEachFrame(simulated, gain, cv::Mat::zeros(size, CV_32F));
}

// The light decreases with the square of the distance from the centre, by `loss` in the corners.
inline void Vignette(SimulatedSweep* simulated, double loss) {
  const cv::Size size = simulated->frame(0).size();
  const cv::Point2d centre((size.width - 1) / 2.0, (size.height - 1) / 2.0);
  cv::Mat gain(size, CV_32F);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const double r2 = std::pow(x - centre.x, 2) + std::pow(y - centre.y, 2);
      gain.at<float>(y, x) = static_cast<float>(1 - loss * r2 / centre.dot(centre));
    }
  }
  ApplyToEachFrame(simulated, gain, cv::Mat::zeros(size, CV_32F));
}

// A reflection that is fixed on the sensor.
inline void AddGlare(SimulatedSweep* simulated) {
  const cv::Size size = simulated->frame(0).size();
  const cv::Point2d centre(0.62 * size.width, 0.4 * size.height);
  ApplyToEachFrame(simulated, cv::Mat::ones(size, CV_32F), 80 * Spot(size, centre, 6));
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_DAMAGED_SWEEP_H_
