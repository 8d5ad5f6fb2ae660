#include "calib/spectrum/relative_spectrum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "tests/calib/drawn_edges.h"
#include "tests/calib/spectrum/texture_scene.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::FitScene;
using thicklens::testing::TextureFrame;
using thicklens::testing::TextureScene;
using thicklens::testing::TextureSweep;
using thicklens::testing::WithWhiteNoise;

constexpr double kPi = 3.14159265358979323846;

void ExpectRecovered(const TextureScene& scene, const RelativeBlur& fit, double within_px2,
                     double relative) {
  ASSERT_TRUE(fit.done) << fit.message;
  const auto r = static_cast<Eigen::Index>(scene.reference);
  EXPECT_EQ(fit.variances_px2[r], scene.frames[scene.reference].variance_px2);
  EXPECT_EQ(fit.covariance.row(r).norm(), 0);
  EXPECT_EQ(fit.covariance.col(r).norm(), 0);
  for (std::size_t i = 0; i < scene.frames.size(); ++i) {
    const TextureFrame& frame = scene.frames[i];
    const auto row = static_cast<Eigen::Index>(i);
    const double change = frame.variance_px2 - scene.frames[scene.reference].variance_px2;
    EXPECT_NEAR(fit.variances_px2[row], frame.variance_px2,
                within_px2 + relative * std::abs(change))
        << "frame " << i;
    const double gain = frame.view.contrast / scene.frames[scene.reference].view.contrast;
    EXPECT_NEAR(fit.gains[row] / gain, 1, 0.01) << "frame " << i;
    // A common shift belongs to the texture.
    const Eigen::Vector2d shift = fit.shifts_px.col(row) - fit.shifts_px.col(r);
    EXPECT_LT((shift - frame.left_over_px).norm(), 0.03) << "frame " << i;
  }
}

TEST(FitRelativeBlur, RecoversGaussianBlurGainAndShift) {
  const TextureScene scene = TextureSweep();
  const std::vector<cv::Mat> images = scene.Render();
  for (const double start_factor : {1.0, 0.6, 1.6}) {
    SCOPED_TRACE(start_factor);
    ExpectRecovered(scene, FitScene(scene, images, start_factor), 0.003, 0.004);
  }
}

TEST(FitRelativeBlur, RecoversDiscs) {
  TextureScene scene = TextureSweep();
  scene.psf = model::Psf::kDisc;
  // The disc of the reference is small, v = 0.1 px^2; that of one frame is almost 0.
  scene.frames[4].variance_px2 = scene.floor_px2 / std::pow(scene.frames[4].view.scale, 2) + 0.002;
  const std::vector<cv::Mat> images = scene.Render();
  for (const double start_factor : {1.0, 1.3})
    ExpectRecovered(scene, FitScene(scene, images, start_factor), 0.003, 0.01);
}

// A Gaussian blur fitted as a disc has a larger misfit, and vice versa.
TEST(FitRelativeBlur, MisfitTellsTheShape) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    TextureScene scene = TextureSweep();
    scene.psf = psf;
    std::vector<cv::Mat> images = scene.Render();
    for (std::size_t i = 0; i < images.size(); ++i)
      images[i] = WithWhiteNoise(images[i], scene.pixel_noise, 10 + static_cast<unsigned>(i));
    const auto misfit = [&](model::Psf fitted) {
      scene.psf = fitted;
      const std::vector<Mode> modes = scene.Modes();
      const auto samples = scene.Samples(images, modes);
      RelativeBlurOptions options = scene.Options();
      options.band = 1;
      return FitRelativeBlur(samples, scene.reference, scene.window, modes,
                             scene.Leakage(images[3], samples[3], modes, 3.8), options)
          .chi2_per_dof;
    };
    const double gaussian = misfit(model::Psf::kGaussian), disc = misfit(model::Psf::kDisc);
    const double right = psf == model::Psf::kGaussian ? gaussian : disc;
    const double wrong = psf == model::Psf::kGaussian ? disc : gaussian;
    EXPECT_LT(right, 1.4);
    EXPECT_GT(wrong, 1.5 * right);
  }
}

TEST(FitRelativeBlur, AFrameSharperThanTheReferenceIsReported) {
  TextureScene scene = TextureSweep();
  scene.reference = 4;  // 0.7 px^2 instead of 0.35
  const TextureFrame old_reference = scene.frames[3];
  scene.frames[4].view = {};
  scene.frames[4].left_over_px.setZero();
  ASSERT_LT(old_reference.variance_px2, scene.frames[4].variance_px2 - 0.3);
  ExpectRecovered(scene, FitScene(scene, scene.Render(), 1), 0.006, 0.01);
}

// An edge has power along one line of frequencies only, and its shift along itself is undetermined.
TEST(FitRelativeBlur, ALoneEdgeIsTextureEnough) {
  TextureScene scene;
  scene.origin = {79.5, 79.5};
  scene.window = {{0, 0}, {140, 140}};
  std::vector<cv::Mat> images;
  for (const double sigma_px : {2.4, 1.6, 0.9, 0.5, 0.8, 1.7, 2.2}) {
    TextureFrame frame;
    frame.variance_px2 = sigma_px * sigma_px;
    scene.frames.push_back(frame);
    images.push_back(thicklens::testing::DrawnEdge(TextureScene::kSizePx, 7, sigma_px, 0.2, 0.8));
  }
  scene.reference = 3;
  const std::vector<Mode> all = scene.Modes();
  const SpectrumSample reference = scene.Sample(3, images[3], all);
  const std::vector<Mode> modes =
      StrongestModes(all, reference.spectrum.values.abs2(), scene.window, 1e-8, 200);
  const auto samples = scene.Samples(images, modes);
  const RelativeBlur fit =
      FitRelativeBlur(samples, 3, scene.window, modes,
                      scene.Leakage(images[3], samples[3], modes, 3.8), scene.Options());
  ExpectRecovered(scene, fit, 0.005, 0.02);
}

TEST(FitRelativeBlur, UsesNoModeBeyondItsBand) {
  TextureScene scene = TextureSweep();
  const std::vector<cv::Mat> images = scene.Render();
  const std::vector<Mode> modes = scene.Modes();
  const auto samples = scene.Samples(images, modes);
  for (const double band : {0.7, 2.0}) {
    RelativeBlurOptions options = scene.Options();
    options.band = band;
    const RelativeBlur fit = FitRelativeBlur(
        samples, 3, scene.window, modes, scene.Leakage(images[3], samples[3], modes, 3.8), options);
    ASSERT_TRUE(fit.done);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double added = fit.variances_px2[static_cast<Eigen::Index>(i)] - 0.35;
      const auto within = std::count_if(modes.begin(), modes.end(), [&](const Mode& mode) {
        return 2 * kPi * kPi * added * ModeFrequency(mode, scene.window).squaredNorm() < band;
      });
      EXPECT_NEAR(fit.modes_used[i], static_cast<double>(within), 3) << i;
    }
  }
}

TEST(FitRelativeBlur, TwoFramesAreTooFew) {
  TextureScene scene = TextureSweep();
  scene.frames.resize(2);
  scene.reference = 0;
  scene.frames[0].view = {};
  const std::vector<Mode> modes = scene.Modes();
  const RelativeBlur fit = FitRelativeBlur(scene.Samples(scene.Render(), modes), 0, scene.window,
                                           modes, {}, scene.Options());
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("at least 3"));
}

// ---- covariance ----

// The covariance for independent noise with the variances that the fit found, from the normal
// equations of the whole problem, in which every value of T and every shift is unknown. Derivatives
// are differences.
Eigen::MatrixXd CovarianceByAllUnknowns(const TextureScene& scene, const RelativeBlur& fit,
                                        const std::vector<SpectrumSample>& samples,
                                        const std::vector<Mode>& modes) {
  const auto n = static_cast<Eigen::Index>(samples.size());
  const Eigen::Index count = *std::max_element(fit.modes_used.begin(), fit.modes_used.end());
  Eigen::Index rows = 0;
  for (const int used : fit.modes_used) rows += 2 * used;
  const Eigen::Index own = 4 * (n - 1);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(rows, own + 2 * count);
  const auto value = [&](Eigen::Index i, Eigen::Index k, const Eigen::Vector4d& step,
                         std::complex<double> texture) {
    const Eigen::Vector2d nu = ModeFrequency(modes[static_cast<std::size_t>(k)], scene.window);
    const double h = BlurTransfer(scene.Options(), fit.variances_px2[i] + step[1],
                                  scene.frames[static_cast<std::size_t>(i)].view.scale, nu.norm());
    const double phase = -2 * kPi * nu.dot(fit.shifts_px.col(i) + step.tail<2>());
    return fit.gains[i] * std::exp(step[0]) * h * std::polar(1.0, phase) * texture;
  };
  Eigen::Index row = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto s = static_cast<std::size_t>(i);
    const auto r = static_cast<Eigen::Index>(scene.reference);
    for (Eigen::Index k = 0; k < fit.modes_used[s]; ++k, row += 2) {
      const double box =
          BoxTransfer(modes[static_cast<std::size_t>(k)], scene.window, samples[s].scale);
      // The sigma of the real and of the imaginary part.
      const double sigma = std::sqrt(0.5 * fit.noise_ratio[i] * samples[s].spectrum.noise_gain) *
                           samples[s].pixel_noise / box;
      const auto put = [&](Eigen::Index column, std::complex<double> derivative) {
        jacobian(row, column) = derivative.real() / sigma;
        jacobian(row + 1, column) = derivative.imag() / sigma;
      };
      if (i != r) {
        for (int p = 0; p < 4; ++p) {
          const Eigen::Vector4d step = 1e-5 * Eigen::Vector4d::Unit(p);
          put(4 * (i - (i > r ? 1 : 0)) + p,
              (value(i, k, step, fit.texture[k]) - value(i, k, -step, fit.texture[k])) / 2e-5);
        }
      }
      put(own + 2 * k, value(i, k, Eigen::Vector4d::Zero(), 1));
      put(own + 2 * k + 1, value(i, k, Eigen::Vector4d::Zero(), {0, 1}));
    }
  }
  const Eigen::VectorXd norms = jacobian.colwise().norm();
  jacobian = jacobian * norms.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd inverse = (jacobian.transpose() * jacobian).inverse();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      const auto r = static_cast<Eigen::Index>(scene.reference);
      if (a == r || b == r) continue;
      const Eigen::Index i = 4 * (a - (a > r ? 1 : 0)) + 1, j = 4 * (b - (b > r ? 1 : 0)) + 1;
      covariance(a, b) = inverse(i, j) / (norms[i] * norms[j]);
    }
  }
  return covariance;
}

TEST(FitRelativeBlur, CovarianceIsThatOfTheWholeProblem) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    TextureScene scene = TextureSweep();
    scene.psf = psf;
    scene.window.size_px = {60, 58};
    const std::vector<cv::Mat> clean = scene.Render();
    std::vector<cv::Mat> images;
    for (std::size_t i = 0; i < clean.size(); ++i) {
      images.push_back(WithWhiteNoise(clean[i], scene.pixel_noise, 70 + static_cast<unsigned>(i)));
    }
    const std::vector<Mode> modes = ModesBetween(scene.window, 2.5 / 58, 0.25);
    const auto samples = scene.Samples(images, modes);
    const RelativeBlur fit =
        FitRelativeBlur(samples, 3, scene.window, modes,
                        scene.Leakage(clean[3], samples[3], modes, 3.8), scene.Options());
    ASSERT_TRUE(fit.done);
    const Eigen::MatrixXd expected = CovarianceByAllUnknowns(scene, fit, samples, modes);
    // Noise that neighbouring modes share widens the covariance: by 1/36 for each of two
    // neighbours, per axis.
    const double shared = std::pow(1 + 2.0 / 36, 2);
    // The noise is that of the last round but one, so a difference of one round is left.
    EXPECT_LT((fit.covariance - shared * expected).norm(), 0.1 * expected.norm());
    for (Eigen::Index i = 0; i < expected.rows(); ++i) {
      if (i != 3) {
        EXPECT_NEAR(fit.covariance(i, i) / (shared * expected(i, i)), 1, 0.1) << i;
      }
    }
  }
}

// The scatter of V over new draws of noise is compared with the stated covariance.
TEST(FitRelativeBlur, CovarianceIsTheScatterOverNoise) {
  constexpr int kRuns = 100;
  TextureScene scene = TextureSweep();
  scene.pixel_noise = 4e-3;
  const std::vector<cv::Mat> clean = scene.Render();
  const std::vector<Mode> modes = scene.Modes();
  const auto clean_samples = scene.Samples(clean, modes);
  const WindowLeakage leakage = scene.Leakage(clean[3], clean_samples[3], modes, 3.8);
  const auto n = static_cast<Eigen::Index>(clean.size());
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n), stated = Eigen::MatrixXd::Zero(n, n);
  double misfit = 0;
  Eigen::VectorXd noise = Eigen::VectorXd::Zero(n);
  for (int run = 0; run < kRuns; ++run) {
    std::vector<SpectrumSample> samples;
    for (std::size_t i = 0; i < clean.size(); ++i) {
      const auto draw = static_cast<unsigned>(1000 * (run + 1)) + static_cast<unsigned>(i);
      samples.push_back(scene.Sample(i, WithWhiteNoise(clean[i], scene.pixel_noise, draw), modes));
    }
    const RelativeBlur fit =
        FitRelativeBlur(samples, 3, scene.window, modes, leakage, scene.Options());
    ASSERT_TRUE(fit.done) << fit.message;
    mean += fit.variances_px2 / kRuns;
    squares += fit.variances_px2 * fit.variances_px2.transpose() / kRuns;
    stated += fit.covariance / kRuns;
    misfit += fit.chi2_per_dof / kRuns;
    noise += fit.noise_ratio / kRuns;
  }
  const Eigen::MatrixXd scatter = squares - mean * mean.transpose();
  double ratio = 0, common = 0, common_stated = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    EXPECT_NEAR(noise[i], 1, 0.1) << i;
    if (i == 3) continue;
    const double own = std::sqrt(stated(i, i) / scatter(i, i));
    // With 100 runs, chance contributes 7 %.
    EXPECT_NEAR(own, 1, 0.2) << i;
    ratio += own / static_cast<double>(n - 1);
    const double truth = scene.frames[static_cast<std::size_t>(i)].variance_px2;
    EXPECT_LT(std::abs(mean[i] - truth), 0.5 * std::sqrt(stated(i, i)) + 0.002 * truth) << i;
    for (Eigen::Index j = 0; j < i; ++j) {
      if (j == 3) continue;
      const double unit = std::sqrt(stated(i, i) * stated(j, j));
      common += scatter(i, j) / unit;
      common_stated += stated(i, j) / unit;
    }
  }
  EXPECT_NEAR(ratio, 1, 0.1);
  // The noise of the reference contributes a common part to all frames.
  EXPECT_NEAR(common / common_stated, 1, 0.35);
  EXPECT_NEAR(misfit, 1, 0.05);
}

TEST(FitRelativeBlur, SaysWhichFrameScattersMore) {
  TextureScene scene = TextureSweep();
  std::vector<cv::Mat> images = scene.Render();
  for (std::size_t i = 0; i < images.size(); ++i) {
    images[i] = WithWhiteNoise(images[i], (i == 4 ? 5 : 1) * scene.pixel_noise,
                               10 + static_cast<unsigned>(i));
  }
  const RelativeBlur fit = FitScene(scene, images, 1);
  ASSERT_TRUE(fit.done);
  for (Eigen::Index i = 0; i < fit.noise_ratio.size(); ++i) {
    if (i == 4) {
      EXPECT_NEAR(fit.noise_ratio[i], 25, 5);
    } else {
      EXPECT_LT(fit.noise_ratio[i], 2.5) << i;
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
