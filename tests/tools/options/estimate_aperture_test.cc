// thicklens estimate --aperture-of: the views, their aperture, and the origin of both.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"
#include "tools/bench/bench_scene.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr int kViews = 7;
constexpr int kSizePx = 96;

// 33 of 49 views, scattered as they are in a benchmark that keeps the rest to itself.
bool IsKept(int k, int l) { return (2 * k + l) % 3 != 1; }

// A simulated slanted plane out of focus, as a relative light field: its true views, and their
// disparity in px per view step.
class SparseApertureTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const BenchScene scene = MakeBenchScene(kSizePx, kSizePx, kViews, kViews, 5, 2, {});
    truth_ = new model::LightField(scene.truth);
    truth_->grid.reset();
    truth_->camera.reset();
    truth_->landing_step_px = {0, 0};
    truth_->transfer = model::TransferCurve::Srgb();
    map_ = new model::RawDepthMap{kSizePx, kSizePx, scene.input.disparity.disparity, false};
    for (float& d : map_->values) {
      d = static_cast<float>(d * scene.input.disparity.step.x());
    }
  }
  static void TearDownTestSuite() {
    delete truth_;
    delete map_;
  }

  // The views that are kept, in a folder of the HCI layout, which states no aperture.
  std::string PutHci(bool sparse) const {
    const std::string folder = folder_ / (sparse ? "sparse-hci" : "hci");
    OutputFolder output = io::ClaimHciFolder(folder);
    io::WriteHciLightField(Views(sparse), &output);
    output.Commit();
    return folder;
  }
  // Writes the same views as a folder of the project, which states the weights of `shape`.
  std::string PutOwn(model::ApertureShape shape) const {
    const std::string folder = folder_ / ("own-" + model::ApertureShapeName(shape));
    model::LightField light_field = Views(true);
    light_field.weights = io::ShapeOfPresentViews(shape, light_field);
    OutputFolder output(folder, io::kLightFieldMarker, io::LightFieldEntries());
    io::WriteLightField(light_field, io::ViewFormat::kPng, &output);
    output.Commit();
    return folder;
  }
  static model::LightField Views(bool sparse) {
    model::LightField views = *truth_;
    views.weights = Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
    if (!sparse) return views;
    views.present.clear();
    for (int l = 0; l < kViews; ++l) {
      for (int k = 0; k < kViews; ++k) views.present.push_back(IsKept(k, l));
    }
    views.weights = io::OwnWeightsOfPresentViews(views);
    return views;
  }

  ProgramResult Run(const Arguments& arguments) const {
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  std::string Photo(const std::string& light_field, const std::string& shape) const {
    const std::string photo = folder_ / ("photo-" + shape + ".png");
    const ProgramResult result = Run({"render", light_field, "--grid", fmt::format("{}", kViews),
                                      "--sparse", "--as-captured", "--aperture-shape", shape,
                                      "--noise", "1", "--bits", "8", "--seed", "1", "-o", photo});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return photo;
  }
  std::string Disparity() const { return folder_.Put("disparity.pfm", io::EncodePfm(*map_)); }

  ProgramResult Estimate(const std::string& photo, const std::string& light_field,
                         const Arguments& aperture) const {
    Arguments all = {"estimate",  photo,           Disparity(), "--depth-kind",
                     "disparity", "--aperture-of", light_field, "--sparse",
                     "-o",        folder_ / "est", "--json",    folder_ / "est.json"};
    if (!io::StatesAperture(light_field)) {
      all.insert(all.end(), {"--grid", fmt::format("{}", kViews)});
    }
    all.insert(all.end(), aperture.begin(), aperture.end());
    return Run(all);
  }
  nlohmann::json Json(const std::string& name) const {
    return nlohmann::json::parse(ContentOf(folder_ / name));
  }
  nlohmann::json ComparedWith(const std::string& light_field, const std::string& photo) const {
    const ProgramResult result = Run(
        {"compare", light_field, folder_ / "est", "--grid", fmt::format("{}", kViews), "--sparse",
         "--border", "12", "--dibr", photo, Disparity(), "--json", folder_ / "compare.json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Json("compare.json");
  }

  static model::LightField* truth_;
  static model::RawDepthMap* map_;
  TemporaryFolder folder_, scratch_;
};

model::LightField* SparseApertureTest::truth_ = nullptr;
model::RawDepthMap* SparseApertureTest::map_ = nullptr;

// The positions are from --aperture-of, the weights from --aperture-shape.
TEST_F(SparseApertureTest, AGaussianPhotographIsEstimatedByItsShape) {
  const std::string sparse = PutHci(true);
  const std::string photo = Photo(PutHci(false), "gaussian");
  const ProgramResult result = Estimate(photo, sparse, {"--aperture-shape", "gaussian"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, Not(HasSubstr("one is assumed")));
  const nlohmann::json aperture = Json("est.json")["aperture"];
  EXPECT_EQ(aperture["shape"], "gaussian");
  EXPECT_EQ(aperture["from"], "option");
  EXPECT_EQ(aperture["views_of"], sparse);
  const nlohmann::json right = ComparedWith(sparse, photo);
  EXPECT_EQ(right["views_above_dibr"], right["per_view"].size());
  EXPECT_GT(right["mean"]["psnr_db"].get<double>(),
            right["dibr"]["mean"]["psnr_db"].get<double>() + 1);

  // Without the option a uniform aperture is assumed, which is reported and gives a worse result.
  const ProgramResult assumed = Estimate(photo, sparse, {});
  ASSERT_EQ(assumed.exit_code, 0) << assumed.err;
  EXPECT_THAT(assumed.err, AllOf(HasSubstr("sparse-hci"), HasSubstr("uniform one is assumed"),
                                 HasSubstr("--aperture-shape")));
  EXPECT_EQ(Json("est.json")["aperture"]["from"], "assumed");
  const nlohmann::json wrong = ComparedWith(sparse, photo);
  EXPECT_GT(right["mean"]["psnr_db"].get<double>(), wrong["mean"]["psnr_db"].get<double>() + 1);
}

TEST_F(SparseApertureTest, WhatTheFileStatesIsUsed) {
  const std::string own = PutOwn(model::ApertureShape::kGaussian);
  const std::string photo = Photo(PutHci(false), "gaussian");
  const ProgramResult result = Estimate(photo, own, {});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, Not(HasSubstr("assumed; --aperture-shape")));
  EXPECT_EQ(Json("est.json")["aperture"]["shape"], "gaussian");
  EXPECT_EQ(Json("est.json")["aperture"]["from"], "light-field");
  // Repeating the same shape is no conflict.
  const ProgramResult same = Estimate(photo, own, {"--aperture-shape", "gaussian"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_EQ(Json("est.json")["aperture"]["from"], "option");
}

TEST_F(SparseApertureTest, AConflictNamesBothValues) {
  const std::string own = PutOwn(model::ApertureShape::kUniform);
  const std::string photo = Photo(PutHci(false), "gaussian");
  const ProgramResult result = Estimate(photo, own, {"--aperture-shape", "gaussian"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("lightfield.yaml: weights"), HasSubstr("uniform"),
                                HasSubstr("--aperture-shape gaussian"), HasSubstr("0.03")));
  EXPECT_FALSE(fs::exists(folder_ / "est"));
}

TEST_F(SparseApertureTest, RenderSaysWhetherTheApertureIsStatedOrAssumed) {
  const std::string photo = folder_ / "photo.png";
  const auto from = [&](const std::string& light_field) {
    const ProgramResult result =
        Run({"render", light_field, "--grid", fmt::format("{}", kViews), "--sparse",
             "--as-captured", "-o", photo, "--json", folder_ / "render.json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Json("render.json");
  };
  EXPECT_EQ(from(PutHci(true))["aperture_from"], "assumed");
  EXPECT_EQ(Json("render.json")["aperture_shape"], "uniform");
  EXPECT_EQ(from(PutOwn(model::ApertureShape::kGaussian))["aperture_from"], "light-field");
}

// Estimates that were made for another aperture than the reference states.
TEST_F(SparseApertureTest, CompareReportsDifferentApertures) {
  const auto compared = [&](const std::string& a, const std::string& b) {
    const ProgramResult result = Run({"compare", a, b, "--sparse"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  const std::string uniform = PutOwn(model::ApertureShape::kUniform);
  const std::string gaussian = PutOwn(model::ApertureShape::kGaussian);
  EXPECT_THAT(compared(gaussian, uniform),
              AllOf(HasSubstr("states a gaussian aperture"), HasSubstr("a uniform one")));
  EXPECT_THAT(compared(gaussian, gaussian), Not(HasSubstr("aperture")));
}

TEST_F(SparseApertureTest, SharesAreOfTheViewsThatThereAre) {
  const model::LightField views = Views(true);
  const Eigen::ArrayXXd weights = io::ShapeOfPresentViews(model::ApertureShape::kGaussian, views);
  EXPECT_NEAR(weights.sum(), 1, 1e-12);
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k) {
      if (!IsKept(k, l)) {
        EXPECT_EQ(weights(l, k), 0);
        continue;
      }
      // exp(-(4 a/U)^2/2) per axis, relative to the middle.
      const double a = k - 3, b = l - 3;
      EXPECT_NEAR(weights(l, k) / weights(3, 3), std::exp(-8 * (a * a + b * b) / (kViews * kViews)),
                  1e-12);
    }
  }
}

}  // namespace
}  // namespace thicklens::tools
