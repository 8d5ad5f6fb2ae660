// thicklens explain: which effects of image formation matter.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/model/camera_file.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

// f1 = f2 = 50, zf = 300, so K = 60; 40 x 32 px.
constexpr char kCameraWithEffects[] =
    "schema: thicklens/camera/2\n"
    "name: small\n"
    "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, "
    "aperture_radius_mm: 5}\n"
    "sensor: {width_px: 40, height_px: 32, pixel_pitch_mm: 0.005, "
    "principal_point_px: [19.5, 15.5], transfer: srgb}\n"
    "psf: gaussian\n"
    "calibration:\n"
    "  image_distance_mm: {value: 60, sigma: 0}\n"
    "  blur_ratio: {value: 0.5, sigma: 0}\n"
    "  blur_floor_px: {value: 0.4, sigma: 0}\n"
    "  evidence: {method: assumed}\n";
// Sigma of defocus, px.
double SigmaPx(double depth_mm) {
  return 0.5 * 5 * 60 / 0.005 * std::abs(1 / depth_mm - 1 / 300.0);
}

class ExplainEffectsTest : public ::testing::Test {
 protected:
  ProgramResult Run(Arguments more) const {
    Arguments arguments = {"explain", camera_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }
  nlohmann::json EffectsOf(Arguments more) const {
    more.insert(more.end(), {"--json", folder_ / "e.json"});
    const ProgramResult result = Run(more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json json = nlohmann::json::parse(ContentOf(folder_ / "e.json"));
    nlohmann::json by_name;
    for (const auto& effect : json["effects"]) {
      by_name[effect["name"].get<std::string>()] = effect;
    }
    return by_name;
  }
  // A wall at 330 mm with a card at `card_mm` before its middle.
  std::string DepthMap(float card_mm) const {
    model::RawDepthMap map{40, 32, std::vector<float>(40 * 32, 330), false};
    for (int y = 10; y < 20; ++y) {
      for (int x = 12; x < 30; ++x) map.values[static_cast<std::size_t>(y * 40 + x)] = card_mm;
    }
    map.values[5] = std::numeric_limits<float>::quiet_NaN();
    return folder_.Put("depth.pfm", io::EncodePfm(map));
  }

  TemporaryFolder folder_;
  std::string camera_ = folder_.Put("camera.yaml", kCameraWithEffects);
};

TEST_F(ExplainEffectsTest, TheLargestImpactOfEachEffectHasItsPlace) {
  const nlohmann::json effects = EffectsOf({"--depth-range", "250:330"});
  EXPECT_EQ(effects.size(), 25U);
  EXPECT_NEAR(effects["defocus"]["impact"], SigmaPx(250), 1e-9);
  EXPECT_EQ(effects["defocus"]["unit"], "px");
  EXPECT_EQ(effects["defocus"]["where"]["depth_mm"], 250);
  EXPECT_TRUE(effects["defocus"]["on"]);
  EXPECT_NEAR(effects["occlusion"]["impact"], SigmaPx(250) + SigmaPx(330), 1e-9);
  EXPECT_FALSE(effects["thickness"]["on"]);  // it is a thin lens
  EXPECT_FALSE(effects["magnification"]["on"]);
  EXPECT_EQ(effects["falloff"]["unit"], "relative");

  const nlohmann::json sweep = EffectsOf({"--depth-range", "250:330", "--as-sweep"});
  EXPECT_TRUE(sweep["magnification"]["on"]);
  EXPECT_NEAR(sweep["lamp-falloff"]["impact"], std::pow(300 / 250.0, 2) - 1, 1e-9);
  EXPECT_FALSE(sweep["occlusion"]["on"]);
  const nlohmann::json bench =
      EffectsOf({"--depth-range", "250:330", "--as-sweep", "--drift", "0.3", "--flicker", "0.02",
                 "--tilt", "2", "--reading-error", "0.1", "--uv-depth", "20"});
  for (const char* name : {"drift", "flicker", "tilt", "reading-error", "vignetting"}) {
    EXPECT_GT(bench[name]["impact"], 0) << name;
  }
}

TEST_F(ExplainEffectsTest, TakesADepthMap) {
  const Arguments kind = {"--depth-kind", "z", "--depth-unit", "mm", "--depth"};
  const auto with = [&](const std::string& map) {
    Arguments arguments = kind;
    arguments.push_back(map);
    return arguments;
  };
  const nlohmann::json effects = EffectsOf(with(DepthMap(280)));
  EXPECT_NEAR(effects["defocus"]["impact"], SigmaPx(330), 1e-4);
  EXPECT_NEAR(effects["occlusion"]["impact"], SigmaPx(280) + SigmaPx(330), 1e-4);
  // One surface: nothing hides anything.
  EXPECT_EQ(EffectsOf(with(DepthMap(330)))["occlusion"]["impact"], 0);
}

TEST_F(ExplainEffectsTest, ToleranceAndSensorDecideWhatIsOn) {
  const double near_mm = 1 / (1 / 300.0 + 1 / 30000.0);
  ASSERT_NEAR(SigmaPx(near_mm), 1, 1e-9);
  const std::string range = std::to_string(near_mm) + ":300";
  EXPECT_TRUE(EffectsOf({"--depth-range", range, "--effect-tolerance", "0.9px"})["defocus"]["on"]);
  EXPECT_FALSE(EffectsOf({"--depth-range", range, "--effect-tolerance", "1.1px", "--without",
                          "falloff"})["defocus"]["on"]);
  const nlohmann::json noisy = EffectsOf(
      {"--depth-range", "290:310", "--full-well", "4000", "--read-noise", "20", "--bits", "4"});
  for (const char* name : {"shot-noise", "read-noise", "quantisation"}) {
    EXPECT_TRUE(noisy[name]["on"]) << name;
    EXPECT_TRUE(noisy[name]["random"]) << name;
  }
  // 1/sqrt(4000) of full scale at white, through the curve's slope there, is less than in the dark.
  EXPECT_GT(noisy["shot-noise"]["impact"], 255 / std::sqrt(4000.0) / 2.4);
  EXPECT_NEAR(noisy["quantisation"]["impact"], 255 / 15.0 / std::sqrt(12.0), 1e-9);
}

TEST_F(ExplainEffectsTest, SaysWhatIsWrong) {
  const std::string map = DepthMap(280);
  EXPECT_EQ(Run({}).exit_code, 2);
  EXPECT_THAT(Run({}).err, HasSubstr("--depth-range or --depth is missing"));
  EXPECT_EQ(
      Run({"--depth-range", "200:300", "--depth", map, "--depth-kind", "z", "--depth-unit", "mm"})
          .exit_code,
      2);
  EXPECT_EQ(Run({"--depth", map}).exit_code, 2);
  EXPECT_THAT(Run({"--depth", map, "--depth-kind", "disparity"}).err,
              HasSubstr("z or range is expected"));
  EXPECT_THAT(Run({"--depth-range", "200:300", "--depth-unit", "mm"}).err,
              HasSubstr("require --depth"));
  EXPECT_THAT(Run({"--depth-range", "200:300", "--read-noise", "3"}).err,
              HasSubstr("needs --full-well"));
  EXPECT_THAT(Run({"--depth-range", "200:300", "--drift", "0.2"}).err,
              HasSubstr("require --as-sweep"));
  EXPECT_EQ(Run({"--depth-range", "200:300", "--effects", ""}).exit_code, 2);
  EXPECT_EQ(Run({"--depth-range", "200:300", "--effect-tolerance", "1"}).exit_code, 2);
  model::RawDepthMap small{8, 8, std::vector<float>(64, 300), false};
  const ProgramResult wrong_size = Run({"--depth", folder_.Put("small.pfm", io::EncodePfm(small)),
                                        "--depth-kind", "z", "--depth-unit", "mm"});
  EXPECT_EQ(wrong_size.exit_code, 1);
  EXPECT_THAT(wrong_size.err, HasSubstr("it is 8x8 px, but the camera's sensor has 40x32 px"));
}

}  // namespace
}  // namespace thicklens::tools
