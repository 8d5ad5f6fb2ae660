// H is compared with a photograph that is independent of it: the mean of the views of a rendered
// light field.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/encoded_values.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {
namespace {

class TrueLightFieldTest : public ::testing::TestWithParam<model::ApertureShape> {
 protected:
  void SetUp() override {
    const std::string folder = std::string(THICKLENS_SHARED_DATA_DIR) + "/lf_antinous";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
    io::LightFieldReading reading;
    reading.grid = 9;
    views_ = io::ReadLightField(folder, reading);
    weights_ = model::ApertureWeights(GetParam(), views_.u_count, views_.v_count);
    map_ = {views_.s_count,
            views_.t_count,
            io::ReadDepthMap(folder + "/gt_disp_lowres.pfm").values,
            {1, 1}};
  }

  // PSNR of encoded values, without the border, beyond which H has to guess.
  double PsnrOf(const model::LinearImage& image, const model::LinearImage& reference) const {
    return estimator::CompareImages(model::EncodedValuesOf(reference, views_.transfer),
                                    model::EncodedValuesOf(image, views_.transfer), 20)
        .psnr_db;
  }

  model::LightField views_;
  Eigen::ArrayXXd weights_;
  estimator::DisparityMap map_;
};

TEST_P(TrueLightFieldTest, ThroughHIsThePhotograph) {
  const model::LinearImage centre =
      model::ViewImage(views_, views_.u_count / 2, views_.v_count / 2);
  model::LinearImage photograph = centre;
  for (std::size_t i = 0; i < photograph.values.size(); ++i) photograph.values[i] = 0;
  for (int l = 0; l < views_.v_count; ++l) {
    for (int k = 0; k < views_.u_count; ++k) {
      const model::LinearImage view = model::ViewImage(views_, k, l);
      const auto weight = static_cast<float>(weights_(l, k));
      for (std::size_t i = 0; i < view.values.size(); ++i) {
        photograph.values[i] += weight * view.values[i];
      }
    }
  }
  estimator::ProjectionOptions options;
  options.threads = 2;
  const auto projection = estimator::MakeSceneProjection<float>(map_, weights_, options);
  // H has one plane after the other, an image its channels beside each other.
  const std::size_t pixels = projection.pixels(), channels = 3;
  ASSERT_EQ(centre.values.size(), channels * pixels);
  std::vector<float> planes(channels * pixels), shown(channels * pixels);
  for (std::size_t i = 0; i < planes.size(); ++i) {
    planes[i] = centre.values[i % pixels * channels + i / pixels];
  }
  projection.Apply(planes.data(), static_cast<int>(channels), shown.data());
  model::LinearImage through = centre;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    through.values[i % pixels * channels + i / pixels] = shown[i];
  }
  EXPECT_GE(PsnrOf(through, photograph), 54);
  // The difference that the light field has to explain.
  EXPECT_LT(PsnrOf(centre, photograph), 35);
}
INSTANTIATE_TEST_SUITE_P(Apertures, TrueLightFieldTest,
                         ::testing::Values(model::ApertureShape::kUniform,
                                           model::ApertureShape::kGaussian),
                         [](const ::testing::TestParamInfo<model::ApertureShape>& shape) {
                           return shape.param == model::ApertureShape::kUniform ? "Uniform"
                                                                                : "Gaussian";
                         });

}  // namespace
}  // namespace thicklens::tools
