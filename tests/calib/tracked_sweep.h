#ifndef THICKLENS_TESTS_CALIB_TRACKED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_TRACKED_SWEEP_H_

#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/registration/frame_structure.h"
#include "calib/registration/scale_tracking.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::testing {

// The frames of a simulated sweep, registered to its middle frame. `s` must outlive the result.
inline calib::FramePlaces TrackedPlaces(const SimulatedSweep& s) {
  calib::FramePlaces places{
      s.sweep,
      [&s](std::size_t i) { return calib::LinearGrey((*s.stored)[i], s.sweep, i); },
      {},
      {},
      calib::RegionCentre(s.sweep),
      {}};
  for (std::size_t i = 0; i < s.sweep.frames.size(); ++i) places.used.push_back(i);
  places.samples = calib::TrackScale(s.sweep, places.read_grey, places.used, places.used.size() / 2,
                                     std::nullopt, 1, [] {});
  return places;
}

// The light that falls on the sensor changes by a factor that is fixed to the frame; the camera
// encodes it with its own transfer curve. The frames have 8 bits.
inline void MultiplyLight(SimulatedSweep* s, const cv::Mat& gain) {
  const model::TransferCurve& transfer = s->sweep.camera.sensor.transfer;
  for (cv::Mat& frame : *s->stored) {
    for (int y = 0; y < frame.rows; ++y) {
      for (int x = 0; x < frame.cols; ++x) {
        auto& value = frame.at<std::uint8_t>(y, x);
        const double light =
            static_cast<double>(gain.at<float>(y, x)) * transfer.Decode(value / 255.0);
        value = cv::saturate_cast<std::uint8_t>(255 * transfer.Encode(light));
      }
    }
  }
}

// Discs of 3 to 6 px radius, softened by 1.2 px, that take `depth` of the light.
inline cv::Mat GainOfSpecks(cv::Size size, int count, double depth, std::uint32_t seed) {
  std::mt19937 engine(seed);
  const auto below = [&engine](int n) {
    return static_cast<int>(engine() % static_cast<unsigned>(n));
  };
  cv::Mat gain(size, CV_32F, cv::Scalar(1));
  for (int i = 0; i < count; ++i) {
    const cv::Point at(10 + below(size.width - 20), 10 + below(size.height - 20));
    cv::circle(gain, at, 3 + below(4), cv::Scalar(1 - depth), cv::FILLED);
  }
  cv::GaussianBlur(gain, gain, cv::Size(), 1.2);
  return gain;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_TRACKED_SWEEP_H_
