// simulate --ablate as a user runs it, compared with the results of the program's other
// commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"
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

const nlohmann::json& RowOf(const nlohmann::json& part, const std::string& name) {
  for (const nlohmann::json& row : part.at("effects")) {
    if (row.at("name") == name) return row;
  }
  throw std::runtime_error("no row of " + name);
}

class AblationTest : public ::testing::Test {
 protected:
  void Succeed(const Arguments& arguments) const {
    const ProgramResult result = ChildProgram(arguments, scratch_.path(), 0).Wait();
    EXPECT_EQ(result.exit_code, 0) << result.err;
    out_ = result.out;
  }
  nlohmann::json JsonOf(const std::string& name) const {
    return nlohmann::json::parse(ContentOf(folder_ / name));
  }

  // A wide lens with a disc for its aperture, near its scene, so that all matters.
  std::string Scene() const {
    folder_.Put("camera.yaml",
                "schema: thicklens/camera/2\nname: wide\n"
                "lens: {front_focal_length_mm: 6, rear_focal_length_mm: 6, lens_thickness_mm: 1.5, "
                "aperture_radius_mm: 1.2}\n"
                "sensor: {width_px: 64, height_px: 48, pixel_pitch_mm: 0.09, "
                "principal_point_px: [31.5, 23.5], transfer: srgb}\n"
                "psf: disc\n");
    return folder_.Put("scene.yaml",
                       "schema: thicklens/simulate-scene/1\ncamera: camera.yaml\n"
                       "truth: {focus_depth_mm: 200, blur_ratio: 0.5, blur_floor_px: 0.4}\n"
                       "layers:\n"
                       "- {name: wall, plane: {depth_mm: 700}, texture: {kind: dead-leaves}}\n"
                       "- plane: {depth_mm: 90}\n"
                       "  outline: {centre_px: [30, 20], size_px: [22, 16]}\n"
                       "  texture: {kind: noise}\n"
                       "noise_sigma_grey_levels: 1\nviews: [3, 3]\n");
  }
  std::string Sweep() const {
    return folder_.Put("sweep-config.yaml",
                       std::string("schema: thicklens/simulate-sweep/1\ncamera: ") +
                           THICKLENS_SOURCE_DIR +
                           "/configs/cameras/case-ii.yaml\n"
                           "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
                           "size_px: [128, 128]\ntarget: {kind: dead-leaves, contrast: 0.6}\n"
                           "bench: {first_depth_mm: 290.4, step_mm: 2, frames: 11, offset_mm: 20, "
                           "reading_sigma_mm: 0.05}\ndrift_sigma_px: 0.3\n"
                           "noise: {full_well_electrons: 10000}\n");
  }

  // PSNR of an estimate from the scene's image against its true views, by files.
  double PsnrByFiles(const Arguments& of_estimate) const {
    Arguments estimate = {"estimate",
                          folder_ / "image/picture.png",
                          folder_ / "image/depth.pfm",
                          "--depth-kind",
                          "z",
                          "--depth-unit",
                          "mm",
                          "--camera",
                          folder_ / "image/camera.yaml",
                          "--views",
                          "3x3",
                          "--format",
                          "tiff",
                          "-o",
                          folder_ / "estimate"};
    estimate.insert(estimate.end(), of_estimate.begin(), of_estimate.end());
    Succeed(estimate);
    Succeed({"compare", folder_ / "views", folder_ / "estimate", "--dibr",
             folder_ / "image/picture.png", folder_ / "image/depth.pfm", "--depth-kind", "z",
             "--depth-unit", "mm", "--json", folder_ / "c.json"});
    return JsonOf("c.json").at("mean").at("psnr_db").get<double>();
  }

  TemporaryFolder folder_, scratch_;
  mutable std::string out_;
};

TEST_F(AblationTest, OfASceneIsWhatTheOtherCommandsFind) {
  const std::string scene = Scene();
  Succeed({"simulate", "image", scene, "-o", folder_ / "all", "--ablate", "--json",
           folder_ / "a.json"});
  const nlohmann::json part = JsonOf("a.json").at("ablation").at("scene");
  EXPECT_EQ(part.at("effects").size(), model::ImageEffects().Effects().size());
  for (const nlohmann::json& row : part.at("effects")) {
    const std::string name = row.at("name").get<std::string>();
    SCOPED_TRACE(name);
    EXPECT_THAT(out_, HasSubstr("\n" + name + " "));
    if (row.at("absent").get<bool>()) continue;
    const nlohmann::json& image = row.at("image");
    const double bound = row.at("bound_grey_levels").get<double>();
    if (model::FactsOf(model::EffectFromName(name)).random) {
      EXPECT_LE(image.at("rms_grey_levels").get<double>(), 1.1 * bound);
    } else if (name != "transfer-curve") {
      // The sampling error of a finite number of rays, at most four of its standard deviations.
      EXPECT_LE(image.at("largest_grey_levels").get<double>(),
                bound + 4 * part.at("sampling_error_grey_levels").get<double>());
    }
    EXPECT_GT(row.at("image_seconds").get<double>(), 0);
  }
  EXPECT_TRUE(RowOf(part, "shot-noise").at("absent").get<bool>());
  EXPECT_NEAR(RowOf(part, "read-noise").at("image").at("rms_grey_levels").get<double>(), 1.04,
              0.05);  // including the effect of rounding
  EXPECT_TRUE(RowOf(part, "read-noise").at("ignored_db").is_null());

  Succeed({"simulate", "image", scene, "-o", folder_ / "image", "--effects", "all"});
  Succeed({"simulate", "light-field", scene, "-o", folder_ / "views", "--effects", "all",
           "--format", "tiff"});
  const double by_files = PsnrByFiles({"--effects", "all"});
  EXPECT_NEAR(part.at("light_field_psnr_db").get<double>(), by_files, 0.02);
  EXPECT_NEAR(RowOf(part, "defocus").at("ignored_db").get<double>(),
              JsonOf("c.json").at("dibr").at("mean").at("psnr_db").get<double>() - by_files, 0.02);
  for (const std::string name : {"falloff", "thickness"}) {
    SCOPED_TRACE(name);
    EXPECT_NEAR(RowOf(part, name).at("ignored_db").get<double>(),
                PsnrByFiles({"--effects", "all", "--without", name}) - by_files, 0.03);
  }
  EXPECT_LT(RowOf(part, "falloff").at("ignored_db").get<double>(), -1);

  // The world without it.
  Succeed({"simulate", "image", scene, "-o", folder_ / "image", "--effects", "all", "--without",
           "falloff"});
  EXPECT_NEAR(RowOf(part, "falloff").at("light_field_db").get<double>(),
              PsnrByFiles({"--effects", "all", "--without", "falloff"}) - by_files, 0.03);
}

TEST_F(AblationTest, OfASweepIsWhatTheOtherCommandsFind) {
  const std::string sweep = Sweep();
  Succeed({"simulate", "sweep", sweep, "-o", folder_ / "all", "--ablate", "--json",
           folder_ / "a.json"});
  const nlohmann::json part = JsonOf("a.json").at("ablation").at("sweep");
  // Without blur there is nothing to calibrate, but the other values are reported nevertheless.
  EXPECT_THAT(RowOf(part, "defocus").at("refusal").get<std::string>(), Not(::testing::IsEmpty()));
  EXPECT_THAT(out_, AllOf(HasSubstr("Without defocus the calibration fails: "),
                          HasSubstr("refused  refused")));
  EXPECT_EQ(part.at("effects").size(), model::SweepEffects().Effects().size());
  const auto calibrated = [&](const Arguments& of_simulation) {
    Arguments simulate = {"simulate", "sweep", sweep, "-o", folder_ / "sweep", "--effects", "all"};
    simulate.insert(simulate.end(), of_simulation.begin(), of_simulation.end());
    Succeed(simulate);
    Succeed(
        {"calibrate", folder_ / "sweep/sweep.yaml", "--no-field", "--json", folder_ / "c.json"});
    return JsonOf("c.json");
  };
  const nlohmann::json all = calibrated({});
  const auto value = [](const nlohmann::json& json, const char* name) {
    return json.at(name).at("value").get<double>();
  };
  EXPECT_NEAR(value(part, "image_distance_mm"), value(all, "image_distance_mm"), 1e-9);
  EXPECT_NEAR(value(part, "blur_ratio"), value(all, "blur_ratio"), 1e-9);
  for (const std::string name : {"drift", "reading-error", "lens-floor"}) {
    SCOPED_TRACE(name);
    const nlohmann::json without = calibrated({"--without", name});
    const nlohmann::json& row = RowOf(part, name);
    EXPECT_NEAR(row.at("image_distance_um").get<double>(),
                1000 * (value(without, "image_distance_mm") - value(all, "image_distance_mm")),
                1e-6);
    EXPECT_NEAR(row.at("blur_ratio_percent").get<double>(),
                100 * (value(without, "blur_ratio") / value(all, "blur_ratio") - 1), 1e-6);
    EXPECT_NE(row.at("image_distance_um").get<double>(), 0);
  }
  EXPECT_TRUE(RowOf(part, "flicker").at("absent").get<bool>());
}

TEST_F(AblationTest, WritesOneTableAndOnePageOfBoth) {
  Succeed({"simulate", "image", Scene(), "-o", folder_ / "both", "--ablate", "--sweep", Sweep(),
           "--effects", "defocus,falloff,pixel-box"});
  const std::string page = ContentOf(folder_ / "both/attribution.html");
  EXPECT_THAT(page,
              AllOf(HasSubstr("change of the image without falloff"), HasSubstr("without drift"),
                    HasSubstr("views, dB"), HasSubstr("kappa %"), HasSubstr("</html>")));
  const std::string csv = ContentOf(folder_ / "both/attribution.csv");
  EXPECT_THAT(csv, AllOf(HasSubstr("\ndefocus,scene,0,"), HasSubstr("\ndrift,sweep,0,"),
                         Not(HasSubstr("thickness,scene"))));
  // Lines have as many fields as the first.
  std::size_t commas = 0;
  for (std::size_t from = 0; from < csv.size();) {
    const std::size_t end = csv.find('\n', from);
    const auto count =
        static_cast<std::size_t>(std::count(csv.begin() + static_cast<std::ptrdiff_t>(from),
                                            csv.begin() + static_cast<std::ptrdiff_t>(end), ','));
    if (from == 0) commas = count;
    EXPECT_EQ(count, commas) << csv.substr(from, end - from);
    from = end + 1;
  }
  EXPECT_THAT(out_, HasSubstr("drift*"));
  // A folder with an ablation is the program's own, and its next image has none.
  Succeed({"simulate", "image", folder_ / "scene.yaml", "-o", folder_ / "both"});
  EXPECT_FALSE(fs::exists(folder_ / "both/attribution.html"));
}

TEST_F(AblationTest, ASweepWithoutAblationIsRefused) {
  const ProgramResult result =
      ChildProgram({"simulate", "image", Scene(), "-o", folder_ / "x", "--sweep", Sweep()},
                   scratch_.path(), 0)
          .Wait();
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--sweep requires --ablate"));
}

}  // namespace
}  // namespace thicklens::tools
