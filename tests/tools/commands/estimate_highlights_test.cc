// thicklens estimate of a photograph with clipped highlights.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kLampsAcrossPx = 64, kLampsDownPx = 48;

// Squares of 5 x 5 px: points through 5 x 5 views of the disparity -1, two of which are brighter
// than full scale.
model::EncodedImage BlurredPoints() {
  model::EncodedImage image{kLampsAcrossPx, kLampsDownPx, 3, 8, {}};
  std::mt19937 engine(3);
  std::normal_distribution<double> noise(0, 1);
  for (int y = 0; y < kLampsDownPx; ++y) {
    for (int x = 0; x < kLampsAcrossPx; ++x) {
      for (int c = 0; c < 3; ++c) {
        double value = 60 + 8 * std::sin(0.4 * x + 0.3 * y);
        for (const int lamp : {12, 32, 52}) {
          if (std::abs(x - lamp) <= 2 && std::abs(y - 24) <= 2) value = lamp == 32 ? 150 : 400;
        }
        image.values.push_back(
            static_cast<std::uint16_t>(std::lround(std::clamp(value + noise(engine), 0.0, 255.0))));
      }
    }
  }
  return image;
}

class EstimateHighlightsTest : public ::testing::Test, protected EstimateCommand {
 protected:
  Words Usual() const {
    model::RawDepthMap map{kLampsAcrossPx, kLampsDownPx,
                           std::vector<float>(kLampsAcrossPx * kLampsDownPx, -1.0F), false};
    return {folder_.Put("lamps.png", io::EncodePng(BlurredPoints())),
            folder_.Put("depth.pfm", io::EncodePfm(map)),
            "--views",
            "5x5",
            "--depth-kind",
            "disparity",
            "--threads",
            "1",
            "--store",
            "views"};
  }
};

TEST_F(EstimateHighlightsTest, SaysWhatIsClippedAndKeepsItsLight) {
  ProgramResult result;
  const json bounds = Summary(Usual(), &result);
  EXPECT_THAT(result.err, AllOf(HasSubstr("lamps.png: 1.6 % of its values are clipped (at full "
                                          "scale): the light there is at least that"),
                                HasSubstr("--clipped data")));
  EXPECT_NEAR(bounds["photo_clipping"]["share"], 50.0 / (kLampsAcrossPx * kLampsDownPx), 1e-9);
  EXPECT_EQ(bounds["photo_clipping"]["levels"], json({1, 1, 1}));
  EXPECT_TRUE(fs::exists(fs::path(Output()) / "views/view_00_00.tiff"));
  fs::remove_all(Output());
  EXPECT_GT(Summary(With(Usual(), {"--format", "png"}))["clipped_fraction"], 0);
  EXPECT_TRUE(fs::exists(fs::path(Output()) / "views/view_00_00.png"));
  fs::remove_all(Output());
  const json data = Summary(With(Usual(), {"--clipped", "data"}), &result);
  EXPECT_THAT(result.err, HasSubstr("they are taken as the light itself"));
  EXPECT_TRUE(fs::exists(fs::path(Output()) / "views/view_00_00.png"));
  EXPECT_LT(bounds["residual_rms"], data["residual_rms"].get<double>() + 1e-6);
  fs::remove_all(Output());
  Summary(With(Usual(), {"--solver", "grid"}), &result);
  EXPECT_THAT(result.err, HasSubstr("this solver takes them as the light itself"));
}

TEST_F(EstimateHighlightsTest, APartWithoutClippedValuesIsAnOrdinaryPhotograph) {
  ProgramResult result;
  const Words part = With(Usual(), {"--crop", "20,0,24,48"});  // the lamp that is not clipped
  EXPECT_EQ(Summary(part, &result)["photo_clipping"]["share"], 0);
  EXPECT_THAT(result.err, Not(HasSubstr("clipped")));
  EXPECT_TRUE(fs::exists(fs::path(Output()) / "views/view_00_00.png"));
  fs::remove_all(Output());
  const Words lamp = With(Usual(), {"--crop", "0,0,24,48"});
  EXPECT_NEAR(Summary(lamp, &result)["photo_clipping"]["share"], 25.0 / (24 * 48), 1e-9);
  EXPECT_THAT(result.err, HasSubstr("lamps.png: 2.2 % of its values are clipped"));
  EXPECT_TRUE(fs::exists(fs::path(Output()) / "views/view_00_00.tiff"));
}

TEST_F(EstimateHighlightsTest, AnUnknownMeaningIsWrongUsage) {
  EXPECT_THAT(Refusal(With(Usual(), {"--clipped", "ignored"}), 2), HasSubstr("--clipped"));
}

}  // namespace
}  // namespace thicklens::tools
