// thicklens explain: the cost of effects, and the curve of blur with its error.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/model/thick_lens.h"
#include "tools/report/explain_figure.h"
#include "tools/report/explain_table.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr char kCamera[] =
    "schema: thicklens/camera/2\n"
    "name: small\n"
    "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, "
    "aperture_radius_mm: 5}\n"
    "sensor: {width_px: 200, height_px: 150, pixel_pitch_mm: 0.005, "
    "principal_point_px: [99.5, 74.5], transfer: srgb}\n"
    "psf: gaussian\n"
    "calibration:\n"
    "  image_distance_mm: {value: 60, sigma: 0.01}\n"
    "  blur_ratio: {value: 0.5, sigma: 0.01}\n"
    "  blur_floor_px: {value: 0.4, sigma: 0}\n"
    "  evidence: {method: assumed}\n";

class ExplainCostsTest : public ::testing::Test {
 protected:
  ProgramResult Run(Arguments more) const {
    Arguments arguments = {"explain", folder_.Put("camera.yaml", kCamera)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }
  TemporaryFolder folder_;
};

TEST_F(ExplainCostsTest, BlurIsWhatAnImageCosts) {
  const ProgramResult result =
      Run({"--depth-range", "280:320", "--costs", "--json", folder_ / "e.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(ContentOf(folder_ / "e.json"));
  EXPECT_GT(json.at("image_seconds").get<double>(), 0);
  for (const nlohmann::json& effect : json.at("effects")) {
    const std::string name = effect.at("name").get<std::string>();
    SCOPED_TRACE(name);
    // The factor is hundreds of rays instead of a few. Effects of a bench do not occur in a
    // image.
    if (name == "defocus") {
      EXPECT_GT(effect.at("cost_seconds").get<double>(), 0);
    } else if (name == "shot-noise" || name == "thickness") {
      EXPECT_EQ(effect.at("cost_seconds").get<double>(), 0);
    } else if (name == "drift" || name == "vignetting") {
      EXPECT_FALSE(effect.contains("cost_seconds"));
    }
  }
  EXPECT_THAT(result.out, AllOf(HasSubstr("cost s"), HasSubstr("seconds on one core")));
  EXPECT_THAT(Run({"--depth-range", "280:320"}).out, Not(HasSubstr("cost")));
}

TEST_F(ExplainCostsTest, SaysWhatCannotBeMeasured) {
  const ProgramResult of_sweep = Run({"--depth-range", "280:320", "--costs", "--as-sweep"});
  EXPECT_EQ(of_sweep.exit_code, 2);
  EXPECT_THAT(of_sweep.err, HasSubstr("--costs"));
}

TEST_F(ExplainCostsTest, DrawsTheCurve) {
  ASSERT_EQ(Run({"--depth-range", "280:320", "--figure", folder_ / "c.svg"}).exit_code, 0);
  EXPECT_THAT(ContentOf(folder_ / "c.svg"),
              AllOf(HasSubstr("<svg"), HasSubstr("depth [mm]"), HasSubstr("standard errors"),
                    HasSubstr("in focus at 300 mm"), Not(HasSubstr("thin lens"))));
  ASSERT_EQ(Run({"--depth-range", "200:inf", "--figure", folder_ / "c.svg"}).exit_code, 0);
  EXPECT_THAT(ContentOf(folder_ / "c.svg"), HasSubstr("1/depth [1/m]"));
  const ProgramResult clash =
      Run({"--depth-range", "200:inf", "--figure", folder_ / "camera.yaml"});
  EXPECT_EQ(clash.exit_code, 2);
  EXPECT_EQ(ContentOf(folder_ / "camera.yaml"), kCamera);
}

}  // namespace
}  // namespace thicklens::tools
