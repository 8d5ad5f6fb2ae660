// The blur along x and along y is compared with textures that are blurred by exact transfer
// functions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <utility>
#include <vector>

#include "calib/spectrum/relative_spectrum.h"
#include "tests/calib/spectrum/texture_scene.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::KnownTexture;
using thicklens::testing::TextureScene;
using thicklens::testing::TextureSweep;
using thicklens::testing::WithWhiteNoise;

constexpr double kPi = 3.14159265358979323846;

// Frames of an astigmatic lens: V_x is smallest in the second frame and V_y in the last but one.
// The reference is between both, and neither V_x nor V_y is smallest there.
struct AxialScene {
  TextureScene scene = TextureSweep();
  double angle_rad = 0;  // of the axes of the blur, from x towards y
  std::vector<Eigen::Vector2d> variances_px2 = {{1.0, 7.5}, {0.3, 4.4}, {0.9, 2.2}, {1.6, 1.5},
                                                {2.5, 0.8}, {4.6, 0.3}, {7.0, 0.8}};

  std::vector<cv::Mat> Render() const {
    const KnownTexture texture(scene.seed);
    std::vector<cv::Mat> images;
    for (std::size_t i = 0; i < scene.frames.size(); ++i) {
      thicklens::testing::TextureView view = scene.frames[i].view;
      view.shift_px += view.scale * scene.frames[i].left_over_px;
      const Eigen::Vector2d v = variances_px2[i];
      const double floor = scene.floor_px2 / (view.scale * view.scale);
      images.push_back(texture.RenderPlane(
          TextureScene::kSizePx, TextureScene::kSizePx, scene.origin, view,
          [&](const Eigen::Vector2d& nu) {
            const Eigen::Vector2d along = Eigen::Rotation2Dd(-angle_rad).toRotationMatrix() * nu;
            if (scene.psf == model::Psf::kGaussian)
              return std::exp(-2 * kPi * kPi * v.dot(along.cwiseAbs2()));
            // An ellipse of the radii 2 sqrt(V - floor), times the floor's Gaussian.
            const Eigen::Vector2d stretched =
                along.cwiseProduct((v.array() - floor).sqrt().matrix());
            return model::GaussianTransfer(std::sqrt(floor), nu.x(), nu.y()) *
                   model::DiscTransfer(2, stretched.x(), stretched.y());
          }));
    }
    return images;
  }
  AxisLeakage Leakage(const cv::Mat& image, const SpectrumSample& sample,
                      const std::vector<Mode>& modes) const {
    const auto along = [&](const Eigen::Vector2d& axis) {
      return WindowLeakage(image, scene.origin, scene.window, modes, sample.spectrum, scene.psf, 4,
                           1, axis, angle_rad);
    };
    return {along({1, 0}), along({0, 1})};
  }
  RelativeBlurOptions Options() const {
    RelativeBlurOptions options = scene.Options();
    options.axis_angle_rad = angle_rad;
    return options;
  }
  // The start is the isotropic mean, which is far from both variances.
  std::vector<SpectrumSample> Samples(const std::vector<cv::Mat>& images,
                                      const std::vector<Mode>& modes) const {
    std::vector<SpectrumSample> samples = scene.Samples(images, modes);
    for (std::size_t i = 0; i < samples.size(); ++i)
      samples[i].start_variance_px2 = 0.5 * variances_px2[i].sum();
    samples[scene.reference].start_variances_px2 = variances_px2[scene.reference];
    return samples;
  }
};

// Axes that are turned by 0.6 rad share no direction with those of the pixels.
TEST(FitAxialBlur, RecoversBothVariances) {
  for (const auto& [psf, angle_rad] :
       {std::pair(model::Psf::kGaussian, 0.0), std::pair(model::Psf::kDisc, 0.0),
        std::pair(model::Psf::kGaussian, 0.6), std::pair(model::Psf::kDisc, -0.9)}) {
    SCOPED_TRACE(model::PsfName(psf));
    SCOPED_TRACE(angle_rad);
    AxialScene axial;
    axial.scene.psf = psf;
    axial.angle_rad = angle_rad;
    if (psf == model::Psf::kDisc) {
      for (Eigen::Vector2d& v : axial.variances_px2) v.array() += 0.1;
    }
    const std::vector<cv::Mat> images = axial.Render();
    const std::vector<Mode> modes = axial.scene.Modes();
    const auto samples = axial.Samples(images, modes);
    const AxialBlur fit =
        FitAxialBlur(samples, 3, axial.scene.window, modes,
                     axial.Leakage(images[3], samples[3], modes), axial.Options());
    ASSERT_TRUE(fit.done) << fit.message;
    EXPECT_EQ(fit.variances_px2.col(3), axial.variances_px2[3]);
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto column = static_cast<Eigen::Index>(i);
      for (const int axis : {0, 1}) {
        const double truth = axial.variances_px2[i][axis];
        EXPECT_NEAR(fit.variances_px2(axis, column), truth,
                    0.01 + 0.02 * std::abs(truth - axial.variances_px2[3][axis]))
            << "frame " << i << ", axis " << axis;
      }
      const double gain = axial.scene.frames[i].view.contrast / axial.scene.frames[3].view.contrast;
      EXPECT_NEAR(fit.gains[column] / gain, 1, 0.01) << "frame " << i;
    }
  }
}

// One variance in all directions is a special case, in which both fits agree.
TEST(FitAxialBlur, OfAnIsotropicBlurIsThatOfTheIsotropicFit) {
  AxialScene axial;
  for (std::size_t i = 0; i < axial.scene.frames.size(); ++i)
    axial.variances_px2[i].setConstant(axial.scene.frames[i].variance_px2);
  std::vector<cv::Mat> images = axial.Render();
  for (std::size_t i = 0; i < images.size(); ++i)
    images[i] = WithWhiteNoise(images[i], axial.scene.pixel_noise, 10 + static_cast<unsigned>(i));
  const std::vector<Mode> modes = axial.scene.Modes();
  const auto samples = axial.Samples(images, modes);
  const AxialBlur axes =
      FitAxialBlur(samples, 3, axial.scene.window, modes,
                   axial.Leakage(images[3], samples[3], modes), axial.scene.Options());
  const RelativeBlur one =
      FitRelativeBlur(samples, 3, axial.scene.window, modes,
                      axial.scene.Leakage(images[3], samples[3], modes, 4), axial.scene.Options());
  ASSERT_TRUE(axes.done) << axes.message;
  ASSERT_TRUE(one.done) << one.message;
  for (Eigen::Index i = 0; i < one.variances_px2.size(); ++i) {
    const double sigma = std::sqrt(one.covariance(i, i));
    const double mean = 0.5 * axes.variances_px2.col(i).sum();
    EXPECT_NEAR(mean, one.variances_px2[i], 0.5 * sigma + 0.002) << i;
    if (i == 3) continue;
    // Each axis has half of the information, or somewhat less because its gain is its own.
    for (const Eigen::Index axis : {0, 1}) {
      const double own = std::sqrt(axes.covariance(2 * i + axis, 2 * i + axis));
      EXPECT_GT(own, sigma) << i;
      EXPECT_LT(own, 2.5 * sigma) << i;
    }
  }
}

TEST(FitAxialBlur, TwoFramesAreTooFew) {
  AxialScene axial;
  axial.scene.frames.resize(2);
  axial.scene.reference = 0;
  axial.scene.frames[0].view = {};
  const std::vector<Mode> modes = axial.scene.Modes();
  const AxialBlur fit = FitAxialBlur(axial.Samples(axial.Render(), modes), 0, axial.scene.window,
                                     modes, {}, axial.scene.Options());
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("at least 3"));
}

// The scatter of V_x and V_y over new draws of noise is compared with the stated covariance.
TEST(FitAxialBlur, CovarianceIsTheScatterOverNoise) {
  constexpr int kRuns = 100;
  AxialScene axial;
  axial.scene.pixel_noise = 4e-3;
  const std::vector<cv::Mat> clean = axial.Render();
  const std::vector<Mode> modes = axial.scene.Modes();
  const auto clean_samples = axial.Samples(clean, modes);
  const AxisLeakage leakage = axial.Leakage(clean[3], clean_samples[3], modes);
  const auto n = 2 * static_cast<Eigen::Index>(clean.size());
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n), stated = Eigen::MatrixXd::Zero(n, n);
  double misfit = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<cv::Mat> images;
    for (std::size_t i = 0; i < clean.size(); ++i) {
      const auto draw = static_cast<unsigned>(1000 * (run + 1)) + static_cast<unsigned>(i);
      images.push_back(WithWhiteNoise(clean[i], axial.scene.pixel_noise, draw));
    }
    const AxialBlur fit = FitAxialBlur(axial.Samples(images, modes), 3, axial.scene.window, modes,
                                       leakage, axial.scene.Options());
    ASSERT_TRUE(fit.done) << fit.message;
    const Eigen::VectorXd values = fit.variances_px2.reshaped();
    mean += values / kRuns;
    squares += values * values.transpose() / kRuns;
    stated += fit.covariance / kRuns;
    misfit += fit.chi2_per_dof / kRuns;
  }
  const Eigen::MatrixXd scatter = squares - mean * mean.transpose();
  double ratio = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index i = k / 2;
    if (i == 3) continue;
    const double own = std::sqrt(stated(k, k) / scatter(k, k));
    // With 100 runs, chance contributes 7 %.
    EXPECT_NEAR(own, 1, 0.25) << k;
    ratio += own / static_cast<double>(n - 2);
    const double truth = axial.variances_px2[static_cast<std::size_t>(i)][k % 2];
    EXPECT_LT(std::abs(mean[k] - truth), 3 * std::sqrt(stated(k, k))) << k;
  }
  EXPECT_NEAR(ratio, 1, 0.12);
  EXPECT_NEAR(misfit, 1, 0.05);
}

}  // namespace
}  // namespace thicklens::calib
