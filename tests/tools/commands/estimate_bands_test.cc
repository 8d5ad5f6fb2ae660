// thicklens estimate with less memory than the image as a whole takes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/sanitizers.h"
#include "support/temporary_folder.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr int kW = 320, kH = 640;

class EstimateBandsTest : public ::testing::Test {
 protected:
  EstimateBandsTest() {
    model::EncodedImage image{kW, kH, 3, 8, {}};
    model::RawDepthMap map{kW, kH, {}, false};
    std::mt19937 engine(7);
    std::normal_distribution<double> noise(0, 1);
    for (int y = 0; y < kH; ++y) {
      for (int x = 0; x < kW; ++x) {
        map.values.push_back(static_cast<float>(0.002 * x - 0.001 * y));
        for (int c = 0; c < 3; ++c) {
          const double value = 120 + 50 * std::sin(0.7 * x + c) * std::sin(0.5 * y) + noise(engine);
          image.values.push_back(static_cast<std::uint16_t>(std::lround(value)));
        }
      }
    }
    usual_ = {folder_.Put("picture.png", io::EncodePng(image)),
              folder_.Put("depth.pfm", io::EncodePfm(map)),
              "--depth-kind",
              "disparity",
              "--views",
              "3x3",
              "--prior",
              "ridge",
              "--format",
              "tiff",
              "--tolerance",
              "5e-5"};
  }

  ProgramResult Run(const std::string& output, const Arguments& more) const {
    Arguments arguments = usual_;
    arguments.insert(arguments.begin(), "estimate");
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments.insert(arguments.end(), {"-o", folder_ / output, "--json", JsonPath()});
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  std::string JsonPath() const { return folder_ / "summary.json"; }
  json Summary() const { return json::parse(ContentOf(JsonPath())); }

  TemporaryFolder folder_, scratch_;
  Arguments usual_;
};

TEST_F(EstimateBandsTest, GiveTheSameViewsInLessMemory) {
  ProgramResult result = Run("whole", {});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json whole = Summary();
  EXPECT_EQ(whole["bands"], 1);
  EXPECT_THAT(result.out, Not(HasSubstr("bands")));

  result = Run("none", {"--memory-limit", "5"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_FALSE(fs::exists(folder_ / "none"));
  ASSERT_THAT(result.err, HasSubstr("memory limit 5 MiB: with any number of bands "));
  const double least = std::stod(result.err.substr(result.err.find("of bands ") + 9));
  const double limit = (least + whole["predicted_memory_mib"].get<double>()) / 2;

  result = Run("bands", {"--memory-limit", std::to_string(limit)});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json bands = Summary();
  EXPECT_GT(bands["bands"].get<int>(), 1);
  EXPECT_THAT(result.out, HasSubstr(std::to_string(bands["bands"].get<int>()) + " bands"));
  EXPECT_LE(bands["predicted_memory_mib"].get<double>(), limit);
  if (!testing::kIsSanitized) {  // sanitizers keep freed memory
    EXPECT_LE(bands["peak_rss_mib"].get<double>(), limit);
  }
  EXPECT_EQ(bands["noise_sigma"], whole["noise_sigma"]);

  const model::LightField expected = io::ReadLightField(folder_ / "whole", {});
  const model::LightField found = io::ReadLightField(folder_ / "bands", {});
  ASSERT_EQ(found.values.size(), expected.values.size());
  EXPECT_EQ(found.origin.method, "scene");
  EXPECT_GT(found.origin.seconds.value(), 0);
  for (std::size_t i = 0; i < found.values.size(); ++i)
    ASSERT_NEAR(found.values[i], expected.values[i], 1e-3) << i;
}

// The relief of an image takes three planes of the largest system, however few channels it has.
TEST_F(EstimateBandsTest, TheForecastHoldsForTheShadingOfARelief) {
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer holds back what was freed";
  constexpr int kSize = 500;
  model::EncodedImage grey{kSize, kSize, 1, 8, {}};
  model::RawDepthMap waves{kSize, kSize, {}, false};
  for (int i = 0; i < kSize * kSize; ++i) {
    const double wave = std::sin(0.5 * (i % kSize)) * std::sin(0.4 * (i / kSize));
    grey.values.push_back(static_cast<std::uint16_t>(std::lround(120 + 60 * wave)));
    waves.values.push_back(static_cast<float>(0.04 * wave));
  }
  usual_[0] = folder_.Put("grey.png", io::EncodePng(grey));
  usual_[1] = folder_.Put("waves.pfm", io::EncodePfm(waves));
  *std::find(usual_.begin(), usual_.end(), "ridge") = "patches";
  usual_.insert(usual_.end(), {"--keep-depth-noise", "--threads", "2"});
  for (const Arguments& precision : {Arguments{}, Arguments{"--double"}}) {
    fs::remove_all(folder_ / "grey");
    ASSERT_EQ(Run("grey", precision).exit_code, 0);
    const json summary = Summary();
    EXPECT_LE(summary["peak_rss_mib"].get<double>(), summary["predicted_memory_mib"].get<double>());
  }
}

// Rough depth hides and mixes pixels and needs rows of its own. With many views, the rays need most
// of the memory. The depth is rough in one strip or everywhere, and there are few threads or many.
TEST_F(EstimateBandsTest, TheForecastHoldsForRoughDepthAndManyViews) {
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer holds back what was freed";
  constexpr int kWidth = 160, kHeight = 400;
  model::EncodedImage grey{kWidth, kHeight, 1, 8, {}};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    grey.values.push_back(static_cast<std::uint16_t>(100 + i % 97));
  }
  usual_[0] = folder_.Put("grey.png", io::EncodePng(grey));
  *std::find(usual_.begin(), usual_.end(), "3x3") = "9x9";
  *std::find(usual_.begin(), usual_.end(), "5e-5") = "0.05";
  usual_.push_back("--keep-depth-noise");
  for (const auto& [rough_rows, threads] : {std::pair{kHeight, "2"}, {40, "12"}}) {
    SCOPED_TRACE(rough_rows);
    model::RawDepthMap rough{kWidth, kHeight, {}, false};
    std::mt19937 engine(3);
    std::normal_distribution<double> noise(0, 0.4);
    for (int i = 0; i < kWidth * kHeight; ++i) {
      const int y = i / kWidth - kHeight / 2;
      rough.values.push_back(
          2 * y < rough_rows && 2 * y >= -rough_rows ? static_cast<float>(noise(engine)) : 0.3F);
    }
    usual_[1] = folder_.Put("rough.pfm", io::EncodePfm(rough));
    const auto run = [&](double limit_mib) {
      fs::remove_all(folder_ / "lf");
      const ProgramResult result =
          Run("lf", {"--threads", threads, "--memory-limit", std::to_string(limit_mib)});
      EXPECT_EQ(result.exit_code, 0) << result.err;
      const json summary = Summary();
      EXPECT_LE(summary["peak_rss_mib"].get<double>(),
                summary["predicted_memory_mib"].get<double>() + 1);
      EXPECT_LE(summary["peak_rss_mib"].get<double>(), limit_mib);
      return summary;
    };
    const json whole = run(3000);
    EXPECT_EQ(whole["bands"], 1);
    const ProgramResult refused = Run("none", {"--threads", threads, "--memory-limit", "5"});
    ASSERT_THAT(refused.err, HasSubstr("with any number of bands "));
    const double least = std::stod(refused.err.substr(refused.err.find("of bands ") + 9));
    const double forecast = whole["predicted_memory_mib"];
    ASSERT_LT(least, forecast);
    EXPECT_GT(run((least + forecast) / 2)["bands"].get<int>(), 1);
  }
}

// A page shows all views, which are held for it; without one they never are.
TEST_F(EstimateBandsTest, ViewsAreHeldForAPageOnly) {
  // So many views are most of the memory.
  *std::find(usual_.begin(), usual_.end(), "3x3") = "7x7";
  constexpr double kViewsMib = 7 * 7 * 3 * sizeof(float) * kW * kH / double{1 << 20};
  ASSERT_EQ(Run("streamed", {}).exit_code, 0);
  const double streamed_mib = Summary()["predicted_memory_mib"];
  ASSERT_EQ(Run("held", {"--report", folder_ / "page"}).exit_code, 0);
  EXPECT_GT(Summary()["predicted_memory_mib"].get<double>(), streamed_mib + 0.5 * kViewsMib);
  EXPECT_TRUE(fs::exists(folder_ / "page/index.html"));
  const model::LightField streamed = io::ReadLightField(folder_ / "streamed", {});
  const model::LightField held = io::ReadLightField(folder_ / "held", {});
  EXPECT_EQ(streamed.values, held.values);
  EXPECT_EQ(streamed.weights.matrix(), held.weights.matrix());
}

}  // namespace
}  // namespace thicklens::tools
