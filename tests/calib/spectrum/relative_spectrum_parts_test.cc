#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "calib/spectrum/relative_spectrum.h"
#include "tests/calib/spectrum/texture_scene.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::FitScene;
using thicklens::testing::GaussianOf;
using thicklens::testing::KnownTexture;
using thicklens::testing::TextureFrame;
using thicklens::testing::TextureScene;
using thicklens::testing::TextureSweep;
using thicklens::testing::WithWhiteNoise;

constexpr double kPi = 3.14159265358979323846;

// ---- transfer functions ----

TEST(BlurTransfer, OfAGaussianIsItsOwn) {
  RelativeBlurOptions options;
  for (const double v : {-0.3, 0.0, 2.5}) {
    EXPECT_NEAR(BlurTransfer(options, v, 0.8, 0.13), std::exp(-2 * kPi * kPi * v * 0.13 * 0.13),
                1e-12);
  }
}

TEST(BlurTransfer, OfADiscIsItsOwnTimesTheFloors) {
  RelativeBlurOptions options;
  options.psf = model::Psf::kDisc;
  options.floor_variance_px2 = 0.3;
  for (const double scale : {0.8, 1.0, 1.3}) {
    const double floor = 0.3 / (scale * scale);
    for (const double v : {0.0, 1e-12, 1e-6, 0.01, 0.3, 0.5, 1.0, 4.0, 9.0}) {
      for (double nu = 0.01; nu < 0.35; nu += 0.017) {
        const double expected = model::GaussianTransfer(std::sqrt(floor), nu, 0) *
                                model::DiscTransfer(2 * std::sqrt(v), nu, 0);
        EXPECT_NEAR(BlurTransfer(options, floor + v, scale, nu), expected, 3e-6) << v << " " << nu;
      }
    }
  }
}

// Noise may make the variance of a disc negative. The function continues smoothly there, as the
// power series sum (-x^2/4)^k/(k! (k + 1)!) does.
TEST(BlurTransfer, OfADiscGoesOnSmoothlyBelowZero) {
  RelativeBlurOptions options;
  options.psf = model::Psf::kDisc;
  options.floor_variance_px2 = 0.3;
  const auto series = [](double v, double nu) {
    const double quarter = -4 * kPi * kPi * nu * nu * v;
    double sum = 0, term = 1;
    for (int k = 0; k < 30; ++k) {
      sum += term;
      term *= quarter / ((k + 1.0) * (k + 2.0));
    }
    return sum;
  };
  for (const double v : {-0.4, -0.1, -1e-3, 0.0, 1e-3, 0.1, 0.4}) {
    for (const double nu : {0.02, 0.1, 0.2, 0.3}) {
      const double floor = std::exp(-2 * kPi * kPi * 0.3 * nu * nu);
      EXPECT_NEAR(BlurTransfer(options, 0.3 + v, 1, nu) / floor, series(v, nu), 0.01) << v << nu;
    }
  }
}

// ---- window leakage ----

TEST(WindowLeakage, IsWhatTheWindowsEdgeDoes) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    TextureScene scene;
    scene.psf = psf;
    scene.floor_px2 = 0;
    scene.window = {{0, -1}, {156, 154}};  // nearly the whole frame
    TextureFrame frame;
    scene.frames = {frame};
    const KnownTexture texture(4);
    const auto render = [&](double sigma_px) {
      return texture.Render(TextureScene::kSizePx, TextureScene::kSizePx, scene.origin, {},
                            [&](double nu) {
                              return model::GaussianTransfer(0.5, nu, 0) *
                                     model::DefocusTransfer(psf, sigma_px, nu, 0);
                            });
    };
    const std::vector<Mode> modes = scene.Modes();
    const cv::Mat sharp = render(0);
    const SpectrumSample sample = scene.Sample(0, sharp, modes);
    const WindowLeakage leakage = scene.Leakage(sharp, sample, modes, 4);
    EXPECT_EQ(leakage.At(0, modes.size()).abs().maxCoeff(), 0);
    EXPECT_EQ(leakage.At(-1, modes.size()).abs().maxCoeff(), 0);
    for (const double sigma_px : {0.15, 0.6, 1.1, 2.0, 2.95, 3.9}) {
      const SpectrumSample blurred = scene.Sample(0, render(sigma_px), modes);
      double leaked = 0, off = 0, count = 0;
      const Eigen::ArrayXcd table = leakage.At(sigma_px * sigma_px, modes.size());
      ASSERT_EQ(table.size(), static_cast<Eigen::Index>(modes.size()));
      for (std::size_t k = 0; k < modes.size(); ++k) {
        const double nu = ModeFrequency(modes[k], scene.window).norm();
        if (2 * kPi * kPi * sigma_px * sigma_px * nu * nu > 2) break;
        const auto i = static_cast<Eigen::Index>(k);
        const std::complex<double> direct =
            blurred.spectrum.values[i] -
            model::DefocusTransfer(psf, sigma_px, nu, 0) * sample.spectrum.values[i];
        leaked += std::norm(direct);
        off += std::norm(table[i] - direct);
        ++count;
      }
      // 1e-6 is the rounding of the floats, a twentieth of the effect of the weakest noise on a
      // value.
      EXPECT_LT(std::sqrt(off / count), 0.05 * std::sqrt(leaked / count) + 1e-6) << sigma_px;
    }
    // A smaller number of modes gives the first ones of a larger number.
    EXPECT_EQ((leakage.At(2, 10) - leakage.At(2, 40).head(10)).abs().maxCoeff(), 0);
  }
}

TEST(WindowLeakage, TakenOutItNoLongerBiasesTheBlur) {
  TextureScene scene = TextureSweep();
  scene.seed = 3;  // some textures leak only a little
  const std::vector<cv::Mat> images = scene.Render();
  const RelativeBlur with = FitScene(scene, images, 1), without = FitScene(scene, images, 1, false);
  ASSERT_TRUE(with.done && without.done);
  double left = 0, bias = 0;
  for (const int i : {0, 1, 5, 6}) {
    const double truth = scene.frames[static_cast<std::size_t>(i)].variance_px2;
    left += std::abs(with.variances_px2[i] - truth);
    bias += std::abs(without.variances_px2[i] - truth);
  }
  EXPECT_LT(left, 0.3 * bias);
}

TEST(WindowLeakage, DoesNotDependOnThreads) {
  const TextureScene scene = TextureSweep();
  const cv::Mat image = scene.Render()[3];
  const std::vector<Mode> modes = scene.Modes();
  const SpectrumSample sample = scene.Sample(3, image, modes);
  const auto table = [&](int threads) {
    return WindowLeakage(image, scene.origin, scene.window, modes, sample.spectrum, scene.psf, 3,
                         threads)
        .At(2.3, modes.size());
  };
  EXPECT_TRUE((table(1) == table(3)).all());
}

// ---- data for plots, and the selection of modes ----

TEST(MeasuredTransfer, IsTheBlursOwn) {
  TextureScene scene = TextureSweep();
  scene.frames[5].left_over_px = {1.1, -0.8};  // the shift of the fit itself is removed
  std::vector<cv::Mat> images = scene.Render();
  for (std::size_t i = 0; i < images.size(); ++i)
    images[i] = WithWhiteNoise(images[i], scene.pixel_noise, 30 + static_cast<unsigned>(i));
  const std::vector<Mode> modes = scene.Modes();
  const auto samples = scene.Samples(images, modes);
  const WindowLeakage leakage = scene.Leakage(images[3], samples[3], modes, 3.8);
  const RelativeBlur fit =
      FitRelativeBlur(samples, 3, scene.window, modes, leakage, scene.Options());
  ASSERT_TRUE(fit.done);
  for (const std::size_t i : {0U, 3U, 5U}) {
    const auto rings =
        MeasuredTransfer(samples[i], fit, i, fit.variances_px2[3], scene.window, modes, leakage);
    ASSERT_GE(rings.size(), 8U);
    for (const TransferRing& ring : rings) {
      EXPECT_NEAR(ring.measured, GaussianOf(scene.frames[i].variance_px2)(ring.nu), 0.04)
          << i << " at " << ring.nu;
    }
    EXPECT_TRUE(std::is_sorted(rings.begin(), rings.end(),
                               [](const auto& a, const auto& b) { return a.nu < b.nu; }));
  }
}

TEST(StrongestModes, KeepsTheStrongestOfEveryRing) {
  const TargetWindow window{{0, 0}, {128, 128}};
  const std::vector<Mode> modes = ModesBetween(window, 0.02, 0.33);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  Eigen::ArrayXd power(static_cast<Eigen::Index>(modes.size()));
  for (double& p : power) p = unit(random);
  const std::vector<Mode> kept = StrongestModes(modes, power, window, 0.1, 9);
  const auto index = [&](const Mode& mode) {
    return std::find_if(modes.begin(), modes.end(),
                        [&](const Mode& m) { return m.jx == mode.jx && m.jy == mode.jy; }) -
           modes.begin();
  };
  const double first = std::log(ModeFrequency(modes.front(), window).norm());
  const double last = std::log(ModeFrequency(modes.back(), window).norm());
  const auto ring = [&](const Mode& mode) {
    const double part = (std::log(ModeFrequency(mode, window).norm()) - first) / (last - first);
    return std::min(static_cast<int>(24 * part), 23);
  };
  std::vector<int> in_ring(24, 0);
  std::vector<double> weakest(24, 2);
  std::vector<bool> is_kept(modes.size(), false);
  std::ptrdiff_t before = -1;
  for (const Mode& mode : kept) {
    const auto k = index(mode);
    EXPECT_GT(k, before);  // sorted by |nu|
    before = k;
    EXPECT_GT(power[k], 0.1);
    is_kept[static_cast<std::size_t>(k)] = true;
    const auto r = static_cast<std::size_t>(ring(mode));
    ++in_ring[r];
    weakest[r] = std::min(weakest[r], power[k]);
  }
  for (std::size_t k = 0; k < modes.size(); ++k) {
    if (is_kept[k]) continue;
    const auto r = static_cast<std::size_t>(ring(modes[k]));
    const double p = power[static_cast<Eigen::Index>(k)];
    // A mode that was left out is too weak, or its ring contains only stronger ones.
    EXPECT_TRUE(!(p > 0.1) || (in_ring[r] == 9 && p <= weakest[r])) << k;
  }
  EXPECT_EQ(*std::max_element(in_ring.begin(), in_ring.end()), 9);
  EXPECT_TRUE(StrongestModes({}, {}, window, 0, 9).empty());
}

}  // namespace
}  // namespace thicklens::calib
