#include "calib/spectrum/expected_blur.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "calib/spectrum/window_leakage.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kReference = 3;

// Spectra that follow the model, with a random texture and noise: nothing of an image.
struct Spectra {
  TargetWindow window{{0, 0}, {100, 90}};
  std::vector<Mode> modes = ModesBetween(window, 0.03, 0.33);
  std::vector<double> variances = {4, 2.5, 1.2, 0.4, 0.9, 2, 4.5};
  std::vector<double> scales = {1.06, 1.04, 1.02, 1, 0.98, 0.96, 0.94};
  std::vector<double> noises = {2e-6, 2e-6, 2e-6, 2e-6, 4e-6, 2e-6, 2e-6};
  RelativeBlurOptions options;
  Eigen::ArrayXd power;

  explicit Spectra(model::Psf psf) {
    options.psf = psf;
    if (psf == model::Psf::kDisc) options.band = 1;
    std::mt19937_64 engine(5);
    power.resize(static_cast<Eigen::Index>(modes.size()));
    for (double& p : power) {
      const double uniform = (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53;
      p = -1e-4 * std::log(uniform);
    }
  }

  std::vector<SpectrumSample> Samples(unsigned seed) const {
    std::mt19937_64 engine(seed);
    std::normal_distribution<double> normal;
    std::vector<SpectrumSample> samples;
    for (std::size_t i = 0; i < variances.size(); ++i) {
      SpectrumSample sample;
      sample.scale = scales[i];
      sample.pixel_noise = std::sqrt(noises[i]);
      sample.start_variance_px2 = variances[i];
      sample.spectrum.noise_gain = 1;
      sample.spectrum.mean = 1;
      sample.spectrum.values.resize(power.size());
      for (Eigen::Index k = 0; k < power.size(); ++k) {
        const Mode& mode = modes[static_cast<std::size_t>(k)];
        const double h =
            BlurTransfer(options, variances[i], scales[i], ModeFrequency(mode, window).norm());
        const double sigma = std::sqrt(noises[i] / 2) / BoxTransfer(mode, window, scales[i]);
        sample.spectrum.values[k] =
            std::polar(std::sqrt(power[k]) * h, static_cast<double>(k)) +
            std::complex<double>(sigma * normal(engine), sigma * normal(engine));
      }
      samples.push_back(std::move(sample));
    }
    return samples;
  }

  std::vector<ExpectedSpectrum> Expected() const {
    std::vector<ExpectedSpectrum> frames;
    for (std::size_t i = 0; i < variances.size(); ++i)
      frames.push_back({scales[i], variances[i], noises[i], modes.size()});
    return frames;
  }
};

// No leakage: spectra that are no windowed images have none.
WindowLeakage NoLeakage(const Spectra& spectra) {
  const cv::Mat even(130, 130, CV_32F, cv::Scalar(1));
  const Eigen::Vector2d origin(64.5, 64.5);
  const auto spectrum = MeasureSpectrum(even, origin, FramePlace(), spectra.window, spectra.modes,
                                        spectra.modes.size());
  return {even, origin, spectra.window, spectra.modes, *spectrum, spectra.options.psf, 3.5, 1};
}

TEST(ExpectBlur, IsTheCovarianceThatTheFitStates) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    const Spectra spectra(psf);
    const ExpectedBlur expected = ExpectBlur(spectra.Expected(), kReference, spectra.window,
                                             spectra.modes, spectra.power, spectra.options);
    ASSERT_TRUE(expected.done) << expected.message;
    const RelativeBlur fit = FitRelativeBlur(spectra.Samples(1), kReference, spectra.window,
                                             spectra.modes, NoLeakage(spectra), spectra.options);
    ASSERT_TRUE(fit.done) << fit.message;
    for (std::size_t i = 0; i < spectra.variances.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      // The band of the fit ends at the frequency that its own V gives.
      EXPECT_NEAR(expected.modes_used[i], fit.modes_used[i], 0.1 * fit.modes_used[i] + 2);
      if (i == kReference) {
        EXPECT_EQ(expected.covariance.row(row).norm(), 0);
        continue;
      }
      EXPECT_NEAR(std::sqrt(expected.covariance(row, row) / fit.covariance(row, row)), 1, 0.15)
          << "frame " << i;
      // Frames share the error of the reference.
      const Eigen::Index other = i == 0 ? 1 : 0;
      const auto correlation = [&](const Eigen::MatrixXd& c) {
        return c(row, other) / std::sqrt(c(row, row) * c(other, other));
      };
      EXPECT_NEAR(correlation(expected.covariance), correlation(fit.covariance), 0.05)
          << "frame " << i;
    }
  }
}

// Independent modes: the stated covariance has a factor for those of a window.
TEST(ExpectBlur, IsTheScatterOfTheFit) {
  const Spectra spectra(model::Psf::kGaussian);
  const ExpectedBlur expected = ExpectBlur(spectra.Expected(), kReference, spectra.window,
                                           spectra.modes, spectra.power, spectra.options);
  const WindowLeakage leakage = NoLeakage(spectra);
  constexpr int kFits = 60;
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(7);
  for (unsigned seed = 1; seed <= kFits; ++seed) {
    const RelativeBlur fit = FitRelativeBlur(spectra.Samples(seed), kReference, spectra.window,
                                             spectra.modes, leakage, spectra.options);
    for (Eigen::Index i = 0; i < 7; ++i)
      squares[i] +=
          std::pow(fit.variances_px2[i] - spectra.variances[static_cast<std::size_t>(i)], 2) /
          kFits;
  }
  double ratio = 0;  // the mean over the frames, whose errors are nearly independent
  for (Eigen::Index i = 0; i < 7; ++i) {
    if (i != static_cast<Eigen::Index>(kReference))
      ratio += std::sqrt(squares[i] * kSharedNoise / expected.covariance(i, i)) / 6;
  }
  EXPECT_NEAR(ratio, 1, 0.15);
}

TEST(ExpectBlur, SaysWhereNothingIsDetermined) {
  const Spectra spectra(model::Psf::kGaussian);
  const ExpectedBlur expected =
      ExpectBlur(spectra.Expected(), kReference, spectra.window, spectra.modes,
                 Eigen::ArrayXd::Zero(spectra.power.size()), spectra.options);
  EXPECT_EQ(expected.modes_used.size(), 7U);
  EXPECT_TRUE(!expected.done || expected.covariance(0, 0) > 1e6);
}

}  // namespace
}  // namespace thicklens::calib
