// A real focus sweep: a Pi camera over a grid, 131 photographs whose bench readings are no
// distances. The program is run on it as a person would.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using thicklens::testing::TemporaryFolder;

const std::string kFolder = THICKLENS_SHARED_DATA_DIR "/picam_sweep";

class PicamSweep : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kFolder + "/positions.csv")) GTEST_SKIP() << kFolder << " is not here";
  }

  nlohmann::json Calibrate(const std::vector<std::string>& offset) const {
    std::vector<std::string> arguments = {
        "calibrate",  kFolder + "/frames",
        "--readings", kFolder + "/positions.csv",
        "--camera",   THICKLENS_SOURCE_DIR "/configs/cameras/picam.yaml",
        "-o",         folder_ / "camera.yaml",
        "--json",     folder_ / "result.json"};
    arguments.insert(arguments.end(), offset.begin(), offset.end());
    const ProgramResult result = ChildProgram(arguments, folder_.path(), 0).Wait();
    EXPECT_EQ(result.exit_code, 0) << result.err;
    std::ifstream json(folder_ / "result.json");
    return json ? nlohmann::json::parse(json) : nlohmann::json::object();
  }

  // Defensible methods put the plane of focus between 54.6 and 61.6 mm.
  static void ExpectSensible(const nlohmann::json& result) {
    const auto& others = result.at("other_methods");
    for (const nlohmann::json& found : {result, others.at("source")}) {
      const double focus_mm = found.at("focus_depth_mm").at("value");
      EXPECT_GT(focus_mm, 52);
      EXPECT_LT(focus_mm, 64);
    }
    // The peak of the sharpness is shifted to the near side; it shows roughly where the focus is.
    EXPECT_NEAR(others.at("sharpness_peak").at("focus_depth_mm").at("value").get<double>(), 54, 8);
    // Every frame is used, rejected or left out.
    EXPECT_EQ(result.at("frames_used").get<std::size_t>() + result.at("frames_rejected").size() +
                  result.at("frames_left_out").size(),
              result.at("frames").size());
    // The advice is about the largest term of the error.
    const auto& terms = result.at("error_terms");
    ASSERT_FALSE(terms.empty());
    EXPECT_THAT(result.at("advice").get<std::string>(),
                ::testing::HasSubstr(terms[0].at("name").get<std::string>()));
    EXPECT_EQ(result.at("next_measurement").at("term"), terms[0].at("name"));
    // Below -95 mm the lens rests on the bed.
    std::vector<std::string> rejected;
    for (const auto& frame : result.at("frames_rejected"))
      rejected.push_back(frame.at("image").get<std::string>());
    for (int z_mm = -110; z_mm <= -96; ++z_mm) {
      EXPECT_THAT(rejected, ::testing::Contains(
                                ::testing::HasSubstr("XP005_Z" + std::to_string(z_mm) + "X0")));
    }
  }

  TemporaryFolder folder_;
};

TEST_F(PicamSweep, BenchZeroIsFoundFromTheImageScale) {
  const nlohmann::json result = Calibrate({});
  ASSERT_TRUE(result.contains("bench_offset_mm")) << result.dump();
  EXPECT_NEAR(result.at("bench_offset_mm").at("value").get<double>(), 106.5, 3);
  ExpectSensible(result);
}

TEST_F(PicamSweep, GivenBenchZeroIsTaken) {
  const nlohmann::json result = Calibrate({"--offset-mm", "106.2", "--offset-sigma-mm", "0.5"});
  ASSERT_TRUE(result.contains("bench_offset_mm")) << result.dump();
  EXPECT_EQ(result.at("bench_offset_mm").at("value").get<double>(), 106.2);
  ExpectSensible(result);
}

}  // namespace
}  // namespace thicklens::tools
