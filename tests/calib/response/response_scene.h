#ifndef THICKLENS_TESTS_CALIB_RESPONSE_RESPONSE_SCENE_H_
#define THICKLENS_TESTS_CALIB_RESPONSE_RESPONSE_SCENE_H_

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/response/response_frames.h"

namespace thicklens::testing {

// Frames of one texture that are made without the project's simulator: overlapping discs of random
// grey, blurred by OpenCV, scaled by resampling, with white noise. The random numbers are those of
// OpenCV's generator, which gives the same on every machine.
struct ResponseScene {
  int width_px = 320, height_px = 240;
  double noise = 0.005;           // standard deviation of a pixel, full scale 1
  double black_level = 0;         // added after the exposure
  double vignetting = 0;          // relative loss at the corners
  double scale_step = 0.004;      // from frame to frame
  double smallest_disc_px = 1.5;  // radius
  double largest_sigma_px = 7;    // of the blur
  int frames = 17;                // an odd number; the middle one is in focus
  std::uint64_t seed = 1;
  model::Psf psf = model::Psf::kGaussian;

  cv::Mat Texture() const {
    constexpr int kFiner = 2;  // for the rims of the discs
    cv::RNG random(seed);
    cv::Mat texture(kFiner * (height_px + 120), kFiner * (width_px + 120), CV_32F, cv::Scalar(0.4));
    const int count = texture.rows * texture.cols / 60;
    for (int i = 0; i < count; ++i) {
      // Areas of equal share for each octave of the radius.
      const double radius = kFiner * smallest_disc_px / std::sqrt(random.uniform(0.01, 1.0));
      const cv::Point at(random.uniform(0, texture.cols), random.uniform(0, texture.rows));
      cv::circle(texture, at, static_cast<int>(radius), cv::Scalar(random.uniform(0.12, 0.75)),
                 cv::FILLED);
    }
    cv::Mat shrunk;
    cv::resize(texture, shrunk, texture.size() / kFiner, 0, 0, cv::INTER_AREA);
    return shrunk;
  }

  // The light on the sensor for each frame, with a place and a blur for each.
  calib::ResponseFrames Make(std::vector<cv::Mat>* light) const {
    cv::RNG random(seed + 1000);
    const cv::Mat texture = calib::GaussianOf(Texture(), 0.7);
    calib::ResponseFrames made;
    made.centre = {0.5 * (width_px - 1), 0.5 * (height_px - 1)};
    made.psf = psf;
    light->clear();
    for (int i = 0; i < frames; ++i) {
      const double u = 2.0 * i / (frames - 1) - 1;
      calib::ResponseFrame frame;
      frame.frame = static_cast<std::size_t>(i);
      const int from_middle = i - frames / 2;
      frame.registration.scale = 1 - scale_step * from_middle;
      frame.registration.shift_px = {random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5)};
      frame.variance_px2 = std::pow(largest_sigma_px * u, 2);
      light->push_back(Light(texture, frame, &random));
      made.frames.push_back(frame);
    }
    return made;
  }

 private:
  cv::Mat Light(const cv::Mat& texture, const calib::ResponseFrame& frame, cv::RNG* random) const {
    const double s = frame.registration.scale;
    cv::Mat blurred = texture, seen, noise_image(height_px, width_px, CV_32F);
    if (frame.variance_px2 > 0)
      blurred = calib::BlurredByShape(texture, frame.variance_px2 / (s * s), psf);
    const double x = 0.5 * (width_px - 1) + frame.registration.shift_px.x();
    const double y = 0.5 * (height_px - 1) + frame.registration.shift_px.y();
    const cv::Mat map = (cv::Mat_<double>(2, 3) << s, 0, x - s * 0.5 * (texture.cols - 1), 0, s,
                         y - s * 0.5 * (texture.rows - 1));
    cv::warpAffine(blurred, seen, map, cv::Size(width_px, height_px), cv::INTER_CUBIC);
    const double gain = random->uniform(0.85, 1.15);
    random->fill(noise_image, cv::RNG::NORMAL, 0, noise);
    for (int row = 0; row < height_px; ++row) {
      for (int column = 0; column < width_px; ++column) {
        const double u = 2.0 * column / width_px - 1, v = 2.0 * row / height_px - 1;
        float& pixel = seen.at<float>(row, column);
        pixel =
            static_cast<float>(std::clamp(pixel * gain * (1 - vignetting * (u * u + v * v) / 2) +
                                              black_level + noise_image.at<float>(row, column),
                                          0.0, 1.0));
      }
    }
    return seen;
  }
};

// Lets the frames be read from `values`, which are copied.
inline void ReadFrom(const std::vector<cv::Mat>& values, calib::ResponseFrames* frames) {
  const auto kept = std::make_shared<std::vector<cv::Mat>>(values);
  frames->read_grey = [kept](std::size_t frame) { return (*kept)[frame]; };
}

// The values in steps of 1/levels.
inline cv::Mat Rounded(const cv::Mat& values, double levels) {
  cv::Mat steps, rounded;
  values.convertTo(steps, CV_16U, levels);
  steps.convertTo(rounded, CV_32F, 1 / levels);
  return rounded;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_RESPONSE_RESPONSE_SCENE_H_
