#ifndef THICKLENS_TESTS_CALIB_SPECTRUM_TEXTURE_SCENE_H_
#define THICKLENS_TESTS_CALIB_SPECTRUM_TEXTURE_SCENE_H_

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/spectrum/relative_spectrum.h"
#include "tests/calib/known_texture.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::testing {

// A frame of a known texture: its view, its blur and the result of its registration.
struct TextureFrame {
  double variance_px2 = 0;  // V
  TextureView view;
  Eigen::Vector2d left_over_px{0, 0};  // shift that the registration missed, px of the target
};

struct TextureScene {
  static constexpr int kSizePx = 160;

  std::vector<TextureFrame> frames;
  std::size_t reference = 0;
  model::Psf psf = model::Psf::kGaussian;
  double floor_px2 = 0.25;  // of a disc
  Eigen::Vector2d origin{79.2, 80.3};
  calib::TargetWindow window{{0.5, -0.7}, {128, 124}};
  double pixel_noise = 1e-3;  // stated; only Samples() adds it
  unsigned seed = 1;

  Transfer TransferOf(const TextureFrame& frame) const {
    if (psf == model::Psf::kGaussian) return GaussianOf(frame.variance_px2);
    const double floor = floor_px2 / (frame.view.scale * frame.view.scale);
    const double radius_px = 2 * std::sqrt(frame.variance_px2 - floor);
    return [floor, radius_px](double nu) {
      return model::GaussianTransfer(std::sqrt(floor), nu, 0) *
             model::DiscTransfer(radius_px, nu, 0);
    };
  }
  std::vector<cv::Mat> Render() const {
    const KnownTexture texture(seed);
    std::vector<cv::Mat> images;
    for (const TextureFrame& frame : frames) {
      TextureView view = frame.view;
      view.shift_px += view.scale * frame.left_over_px;
      images.push_back(texture.Render(kSizePx, kSizePx, origin, view, TransferOf(frame)));
    }
    return images;
  }
  std::vector<calib::Mode> Modes() const { return calib::ModesBetween(window, 2.5 / 124, 0.33); }
  calib::SpectrumSample Sample(std::size_t i, const cv::Mat& image,
                               const std::vector<calib::Mode>& modes) const {
    const TextureFrame& frame = frames[i];
    calib::SpectrumSample sample;
    sample.scale = frame.view.scale;
    sample.pixel_noise = pixel_noise;
    sample.start_variance_px2 = frame.variance_px2;
    auto spectrum = calib::MeasureSpectrum(image, origin, {frame.view.scale, frame.view.shift_px},
                                           window, modes, modes.size());
    EXPECT_TRUE(spectrum) << i;
    if (spectrum) sample.spectrum = *spectrum;
    return sample;
  }
  std::vector<calib::SpectrumSample> Samples(const std::vector<cv::Mat>& images,
                                             const std::vector<calib::Mode>& modes) const {
    std::vector<calib::SpectrumSample> samples;
    for (std::size_t i = 0; i < frames.size(); ++i) samples.push_back(Sample(i, images[i], modes));
    return samples;
  }
  calib::WindowLeakage Leakage(const cv::Mat& image, const calib::SpectrumSample& sample,
                               const std::vector<calib::Mode>& modes,
                               double largest_sigma_px) const {
    return {image, origin, window, modes, sample.spectrum, psf, largest_sigma_px, 1};
  }
  calib::RelativeBlurOptions Options() const {
    calib::RelativeBlurOptions options;
    options.psf = psf;
    options.band = psf == model::Psf::kGaussian ? 2 : 1;
    options.floor_variance_px2 = floor_px2;
    return options;
  }
};

// Frames on both sides of a sharp one, with all nuisance effects.
inline TextureScene TextureSweep() {
  TextureScene scene;
  const double scales[] = {1.12, 1.07, 1.03, 1, 0.97, 0.94, 0.9};
  const double variances[] = {6, 2.6, 0.8, 0.35, 0.7, 2.2, 5.2};
  for (int i = 0; i < 7; ++i) {
    TextureFrame frame;
    frame.variance_px2 = variances[i];
    frame.view.scale = scales[i];
    if (i != 3) {
      frame.view.shift_px = {0.7 * i - 1, 2.4 - 0.9 * i};
      frame.view.contrast = 1 + 0.02 * (i - 4);
      frame.view.mean = 0.3 + 0.05 * i;
      frame.left_over_px = {0.05 * i - 0.2, 0.11 - 0.04 * i};
    }
    scene.frames.push_back(frame);
  }
  scene.reference = 3;
  return scene;
}

inline calib::RelativeBlur FitScene(const TextureScene& scene, const std::vector<cv::Mat>& images,
                                    double start_factor, bool takes_leakage_out = true) {
  const std::vector<calib::Mode> modes = scene.Modes();
  std::vector<calib::SpectrumSample> samples = scene.Samples(images, modes);
  double largest = 0;
  const double base = scene.frames[scene.reference].variance_px2;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    double& start = samples[i].start_variance_px2;
    largest = std::max(largest, start - base);
    start = base + start_factor * (start - base);
  }
  calib::WindowLeakage leakage;
  if (takes_leakage_out) {
    leakage = scene.Leakage(images[scene.reference], samples[scene.reference], modes,
                            1.4 * std::sqrt(largest) + 0.5);
  }
  return calib::FitRelativeBlur(samples, scene.reference, scene.window, modes, leakage,
                                scene.Options());
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_SPECTRUM_TEXTURE_SCENE_H_
