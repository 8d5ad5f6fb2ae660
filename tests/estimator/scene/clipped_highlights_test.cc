// Lamps that are brighter than full scale, out of focus, behind an object in focus. The photograph
// is made from shifted copies of the background, not by the H of the solver.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "estimator/scene/lower_bounds.h"
#include "thicklens/estimator/blur_check.h"
#include "thicklens/estimator/photo_aperture.h"
#include "thicklens/estimator/render.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/kernels/view_warp.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

constexpr int kW = 96, kH = 72, kViews = 7;
constexpr int kDisparity = -1;  // of the background, px per view step

struct Lamp {
  int x, y, size;
  float colour[3];  // light, 1 at full scale
};

struct Scene {
  EstimateInput input;  // the photograph, clipped, of 8 bits
  model::LinearImage background, unclipped;
  std::vector<Lamp> lamps;
  double clipped_share = 0;
};

bool IsObject(int x, int y) { return std::hypot(x - 66, y - 44) < 14; }
float ObjectAt(int x, int y, int c) {
  return static_cast<float>(0.35 + 0.15 * std::sin(0.9 * x + c) * std::cos(1.1 * y));
}

Scene MakeScene(model::ApertureShape shape, double noise_levels, double level, unsigned seed) {
  Scene scene;
  scene.lamps = {{14, 16, 2, {30, 28, 25}},
                 {34, 20, 2, {60, 20, 5}},
                 {20, 50, 3, {12, 12, 30}},
                 {44, 60, 1, {90, 80, 70}},
                 {78, 14, 2, {25, 25, 25}}};
  model::LinearImage& background = scene.background;
  background = {kW, kH, 3, {}};
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      for (int c = 0; c < 3; ++c) {
        float value = static_cast<float>(0.05 + 0.02 * std::sin(0.31 * x + 0.2 * y + c));
        for (const Lamp& lamp : scene.lamps) {
          if (x >= lamp.x && x < lamp.x + lamp.size && y >= lamp.y && y < lamp.y + lamp.size)
            value = lamp.colour[c];
        }
        background.values.push_back(value);
      }
    }
  }
  EstimateInput& input = scene.input;
  input.weights = model::ApertureWeights(shape, kViews, kViews);
  input.image = {kW, kH, 3, {}};
  input.disparity = {kW, kH, {}, {1, 1}};
  scene.unclipped = input.image;
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0, 1);
  double clipped = 0;
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      input.disparity.disparity.push_back(IsObject(x, y) ? 0.0F : 1.0F * kDisparity);
      for (int c = 0; c < 3; ++c) {
        double light = 0;
        for (int l = 0; l < kViews; ++l) {
          for (int k = 0; k < kViews; ++k) {
            // The point at p of the centre view is at p - d a in the view a.
            const int a = k - kViews / 2, b = l - kViews / 2;
            const int px = std::clamp(x + kDisparity * a, 0, kW - 1);
            const int py = std::clamp(y + kDisparity * b, 0, kH - 1);
            light +=
                input.weights(l, k) *
                static_cast<double>(IsObject(x, y) ? ObjectAt(x, y, c) : background.at(px, py, c));
          }
        }
        scene.unclipped.values.push_back(static_cast<float>(light));
        const double stored =
            std::round(255 * input.transfer.Encode(light) + noise_levels * noise(engine));
        const bool is_clipped = stored >= std::round(255 * level);
        const double kept = std::clamp(stored, 0.0, std::round(255 * level)) / 255;
        input.image.values.push_back(static_cast<float>(input.transfer.Decode(kept)));
        input.clipped.push_back(is_clipped ? 1 : 0);
        clipped += is_clipped ? 1 : 0;
      }
    }
  }
  scene.clipped_share = clipped / static_cast<double>(input.clipped.size());
  return scene;
}

// PSNR, dB, of encoded values in [0, 1], around the lamps.
double PsnrAtLamps(const Scene& scene, const model::LinearImage& found,
                   const model::LinearImage& truth) {
  double sum = 0, count = 0;
  const auto encoded = [&](float light) {
    return scene.input.transfer.Encode(std::clamp(static_cast<double>(light), 0.0, 1.0));
  };
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      const bool is_near = std::any_of(
          scene.lamps.begin(), scene.lamps.end(),
          [&](const Lamp& lamp) { return std::abs(x - lamp.x) <= 5 && std::abs(y - lamp.y) <= 5; });
      if (!is_near || IsObject(x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        sum += std::pow(encoded(found.at(x, y, c)) - encoded(truth.at(x, y, c)), 2);
        count += 1;
      }
    }
  }
  return -10 * std::log10(sum / count);
}

// The centre view of the truth.
model::LinearImage TrueView(const Scene& scene) {
  model::LinearImage view = scene.background;
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      for (int c = 0; IsObject(x, y) && c < 3; ++c)
        view.values[static_cast<std::size_t>((y * kW + x) * 3 + c)] = ObjectAt(x, y, c);
    }
  }
  return view;
}

// The photograph that a light field of planes gives with every view moved by `shift` px per step,
// away from the borders: the mean of shifted views.
model::LinearImage Refocused(const model::LightField& light_field, double exposure) {
  model::LinearImage mean{kW, kH, 3, std::vector<float>(static_cast<std::size_t>(kW) * kH * 3)};
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      const model::LinearImage view = model::ViewImage(light_field, k, l);
      const int a = (k - kViews / 2) / 2, b = (l - kViews / 2) / 2;  // half of the blur
      for (int y = 0; y < kH; ++y) {
        for (int x = 0; x < kW; ++x) {
          for (int c = 0; c < 3; ++c) {
            mean.values[static_cast<std::size_t>((y * kW + x) * 3 + c)] +=
                static_cast<float>(exposure * light_field.weights(l, k)) *
                view.at(std::clamp(x - kDisparity * a, 0, kW - 1),
                        std::clamp(y - kDisparity * b, 0, kH - 1), c);
          }
        }
      }
    }
  }
  return mean;
}

model::LightField TrueLightField(const Scene& scene, model::LightField like) {
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      model::LinearImage view = TrueView(scene);
      for (int y = 0; y < kH; ++y) {
        for (int x = 0; x < kW; ++x) {
          for (int c = 0; !IsObject(x, y) && c < 3; ++c) {
            const int px = std::clamp(x + kDisparity * (k - kViews / 2), 0, kW - 1);
            const int py = std::clamp(y + kDisparity * (l - kViews / 2), 0, kH - 1);
            view.values[static_cast<std::size_t>((y * kW + x) * 3 + c)] =
                scene.background.at(px, py, c);
          }
        }
      }
      model::SetView(&like, k, l, view);
    }
  }
  return like;
}

struct Solved {
  model::LightField light_field;
  model::LinearImage view;
  SceneSummary summary;
};
Solved Solve(const EstimateInput& input, Prior prior) {
  SceneOptions options;
  options.prior = prior;
  Solved solved;
  SolverRun run;
  run.threads = 1;
  solved.light_field = EstimateScene(input, options, run, &solved.summary);
  solved.view = model::ViewImage(solved.light_field, kViews / 2, kViews / 2);
  return solved;
}

class ClippedHighlightsOf : public ::testing::TestWithParam<Prior> {};

TEST_P(ClippedHighlightsOf, AreBetterAsBoundsThanAsData) {
  for (const double noise_levels : {0.0, 1.0}) {
    const Scene scene = MakeScene(model::ApertureShape::kDisc, noise_levels, 1, 3);
    ASSERT_GT(scene.clipped_share, 0.02);
    EstimateInput as_data = scene.input;
    as_data.clipped.clear();
    const Solved bounds = Solve(scene.input, GetParam()), data = Solve(as_data, GetParam());
    const model::LinearImage truth = TrueView(scene);
    const double with = PsnrAtLamps(scene, bounds.view, truth);
    const double without = PsnrAtLamps(scene, data.view, truth);
    EXPECT_GT(with, without + 2) << PriorName(GetParam()) << ", noise " << noise_levels;
    // Two exposures of another focus: as bright as the photograph, and where lamps are not clipped.
    const model::LightField true_field = TrueLightField(scene, bounds.light_field);
    for (const double exposure : {1.0, 0.1}) {
      const model::LinearImage expected = Refocused(true_field, exposure);
      const double refocused_with =
          PsnrAtLamps(scene, Refocused(bounds.light_field, exposure), expected);
      const double refocused_without =
          PsnrAtLamps(scene, Refocused(data.light_field, exposure), expected);
      EXPECT_GT(refocused_with, refocused_without + 2)
          << PriorName(GetParam()) << ", noise " << noise_levels << ", exposure " << exposure;
    }
    EXPECT_LT(bounds.summary.residual_rms, data.summary.residual_rms);
    EXPECT_GT(bounds.summary.brightest, 5);
    EXPECT_NEAR(bounds.summary.clipped_share, scene.clipped_share, 1e-12);
  }
}
INSTANTIATE_TEST_SUITE_P(Priors, ClippedHighlightsOf,
                         ::testing::Values(Prior::kRidge, Prior::kTotalVariation, Prior::kPatches),
                         [](const auto& prior) { return PriorName(prior.param); });

// A lamp of which some of the disc is not clipped is known: its light is found.
TEST(ClippedHighlights, OfKnownLampsHaveTheirLight) {
  const Scene scene = MakeScene(model::ApertureShape::kGaussian, 0, 1, 5);
  const Solved solved = Solve(scene.input, Prior::kTotalVariation);
  for (const Lamp& lamp : scene.lamps) {
    for (int c = 0; c < 3; ++c) {
      double found = 0, expected = 0;
      for (int y = lamp.y - 2; y < lamp.y + lamp.size + 2; ++y) {
        for (int x = lamp.x - 2; x < lamp.x + lamp.size + 2; ++x) {
          found += static_cast<double>(solved.view.at(x, y, c));
          expected += static_cast<double>(scene.background.at(x, y, c));
        }
      }
      EXPECT_NEAR(found / expected, 1, 0.15) << lamp.x << ", channel " << c;
    }
  }
}

TEST(ClippedHighlights, ChangeNothingWithoutAny) {
  Scene scene = MakeScene(model::ApertureShape::kDisc, 1, 1, 4);
  EstimateInput none = scene.input;
  none.clipped.clear();
  EstimateInput zeros = scene.input;
  std::fill(zeros.clipped.begin(), zeros.clipped.end(), std::uint8_t{0});
  for (const Prior prior : {Prior::kRidge, Prior::kTotalVariation, Prior::kPatches})
    EXPECT_EQ(Solve(none, prior).light_field.values, Solve(zeros, prior).light_field.values);
}

TEST(ClippedHighlights, AreNotPartOfTheNoise) {
  // Clipped at half of full scale, so that blocks at the limit are not too bright to count.
  model::LinearImage image{160, 160, 1, {}};
  std::vector<std::uint8_t> clipped;
  std::mt19937 engine(1);
  std::normal_distribution<double> noise(0, 2);
  const model::TransferCurve transfer = model::TransferCurve::Srgb();
  for (int i = 0; i < 160 * 160; ++i) {
    const double stored = std::round((i / 160 < 100 ? 250 : 80) + noise(engine));
    clipped.push_back(stored >= 128 ? 1 : 0);
    image.values.push_back(static_cast<float>(transfer.Decode(std::min(stored, 128.0) / 255)));
  }
  EXPECT_LT(EncodedNoiseSigma(image, transfer).value_or(1), 0.1 / 255);
  EXPECT_NEAR(255 * EncodedNoiseSigma(image, transfer, clipped).value_or(0), 2, 0.2);
}

TEST(ClippedHighlights, AreNoReasonForAnotherBlur) {
  const Scene scene = MakeScene(model::ApertureShape::kDisc, 1, 1, 6);
  BlurCheckOptions options;
  options.threads = 1;
  const BlurCheck check = CheckBlur(scene.input, options);
  EstimateInput as_data = scene.input;
  as_data.clipped.clear();
  const BlurCheck misled = CheckBlur(as_data, options);
  EXPECT_LT(check.unexplained_blocks, misled.unexplained_blocks);
}

// A device that counts the systems it was asked to solve.
class CountingDevice : public kernels::Backend {
 public:
  int systems = 0;
  bool is_opencl() const override { return false; }
  bool has_double() const override { return true; }
  std::string name() const override { return "counting"; }
  std::string description() const override { return "simulated"; }
  std::unique_ptr<kernels::Kernels<float>> NewFloat() override { return nullptr; }
  std::unique_ptr<kernels::Kernels<double>> NewDouble() override { return nullptr; }
  std::unique_ptr<kernels::RadianceSteps<float>> NewSteps(
      const kernels::DataTerm<float>& data) override {
    ++systems;
    return kernels::NewCpuRadianceSteps(data);
  }
  std::unique_ptr<kernels::RadianceSteps<double>> NewSteps(
      const kernels::DataTerm<double>& data) override {
    ++systems;
    return kernels::NewCpuRadianceSteps(data);
  }
  std::unique_ptr<kernels::ViewWarp> NewWarp(const kernels::SurfaceImage&) override {
    return nullptr;
  }
};

// One device is stated for all bands.
TEST(ClippedHighlights, InOneBandTakeAllBandsToTheProcessor) {
  EstimateInput input = MakeScene(model::ApertureShape::kDisc, 1, 1, 7).input;
  for (const bool has_bounds : {true, false}) {
    const auto first = input.clipped.begin() + (has_bounds ? kW * kH * 3 / 4 : 0);
    std::fill(first, input.clipped.end(), std::uint8_t{0});  // the lower bands have none
    for (const Prior prior : {Prior::kTotalVariation, Prior::kPatches}) {
      CountingDevice device;
      SceneOptions options;
      options.prior = prior;
      options.least_bands = 3;
      SolverRun run;
      run.threads = 1;
      run.backend = &device;
      SceneSummary summary;
      EstimateScene(input, options, run, &summary);
      EXPECT_EQ(summary.bands, 3);
      EXPECT_EQ(summary.device, has_bounds ? "cpu" : "counting") << PriorName(prior);
      EXPECT_EQ(device.systems > 0, !has_bounds) << PriorName(prior);
    }
  }
}

TEST(ClippedHighlights, OfHalfTheSizeAreThoseOfAnyOfFourValues) {
  const ClippedValues clipped = {0, 0, 0, 1, 0,   //
                                 0, 0, 0, 0, 0,   //
                                 0, 0, 0, 0, 1};  // 5 x 3 px
  EXPECT_EQ(HalfSize(clipped, 5, 3, 1), (ClippedValues{0, 1, 0, 0, 0, 1}));
  EXPECT_EQ(CutRows(clipped, 5, 1, 1, 3), ClippedValues(clipped.begin() + 5, clipped.end()));
  const ClippedValues colours = {0, 1, 0, 0, 0, 0, 1, 0, 1};  // 3 px
  EXPECT_EQ(InAnyChannel(colours, 3), (ClippedValues{1, 0, 1}));
  EXPECT_EQ(BoundsInPlanes(colours, 1, 3, 0, 3), (std::vector<std::size_t>{2, 3, 8}));
  EXPECT_EQ(BoundsInPlanes(colours, 1, 3, 1, 3), (std::vector<std::size_t>{1, 5}));
  EXPECT_TRUE(BoundsInPlanes({}, 1, 3, 0, 3).empty());
}

}  // namespace
}  // namespace thicklens::estimator
