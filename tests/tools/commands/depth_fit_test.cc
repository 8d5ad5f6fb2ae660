// The options of `estimate` for depth maps of another size or part, at the command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/scene.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;

// A photograph of 48 x 36 px, and maps of disparities of any size: a near square on a far plane.
class DepthFitCommandTest : public ::testing::Test {
 protected:
  ProgramResult Estimate(const std::string& map, const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {
        "estimate",  photo_, map,  "--depth-kind",  "disparity", "--views",         "3x3",
        "--threads", "1",    "-o", folder_ / "out", "--json",    folder_ / "e.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }
  nlohmann::json Json() const { return nlohmann::json::parse(ContentOf(folder_ / "e.json")); }

  std::string Map(int width, int height) const {
    model::RawDepthMap map{width, height, {}, false};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool is_near = x >= width / 3 && x < width / 2 && y >= height / 3 && y < height / 2;
        map.values.push_back(is_near ? 1.0F : -0.5F);
      }
    }
    return folder_.Put("map.pfm", io::EncodePfm(map));
  }

  TemporaryFolder folder_;
  std::string photo_ = [this] {
    model::EncodedImage photo{48, 36, 1, 8, std::vector<std::uint16_t>(std::size_t{48} * 36)};
    for (std::size_t i = 0; i < photo.values.size(); ++i)
      photo.values[i] = static_cast<std::uint16_t>(60 + (i * 37 + i / 48 * 11) % 120);
    return folder_.Put("photo.png", io::EncodePng(photo));
  }();
};

TEST_F(DepthFitCommandTest, SmallerAndLargerMapsAreBroughtToThePhotograph) {
  for (const int width : {12, 96}) {
    const ProgramResult result = Estimate(Map(width, width * 3 / 4), {});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::string sizes =
        std::to_string(width) + " x " + std::to_string(width * 3 / 4) + " px brought to 48 x 36 px";
    EXPECT_THAT(result.err, HasSubstr(sizes));
    EXPECT_THAT(Json()["depth_fit"].get<std::string>(), HasSubstr(sizes));
  }
  const ProgramResult result = Estimate(Map(48, 36), {});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(Json()["depth_fit"].is_null());
}

TEST_F(DepthFitCommandTest, AnotherAspectNeedsAStatedPart) {
  const std::string map = Map(24, 12);
  const ProgramResult refused = Estimate(map, {});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("it is 24x12 px"), HasSubstr("photo.png is 48x36 px"),
                                 HasSubstr("--depth-crop"), HasSubstr("--depth-camera")));
  const ProgramResult result = Estimate(map, {"--depth-crop", "0,6,48,24"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("on the part 0,6,48,24 of the photograph"));
  EXPECT_NEAR(Json()["holes_share"].get<double>(), 1 / 3.0, 1e-6);
}

TEST_F(DepthFitCommandTest, ConfidenceMakesHolesAndMustFit) {
  const std::string confidence =
      folder_.Put("confidence.pfm",
                  io::EncodePfm({12, 9, std::vector<float>(std::size_t{12} * 9, 0.4F), false}));
  const std::string map = Map(12, 9);
  ASSERT_EQ(Estimate(map, {"--depth-confidence", confidence}).exit_code, 0);
  const ProgramResult none =
      Estimate(map, {"--depth-confidence", confidence, "--min-confidence", "0.5"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err,
              AllOf(HasSubstr("no value has a confidence"), HasSubstr("--min-confidence")));
  EXPECT_THAT(Estimate(Map(24, 18), {"--depth-confidence", confidence}).err,
              HasSubstr("the sizes must be equal"));
}

TEST_F(DepthFitCommandTest, WrongOptionsAreUsage) {
  const std::string map = Map(12, 9);
  for (const std::string part : {"1,2,3", "1,2,3,0", "a,b,c,d", "1,2,3,4,5"}) {
    const ProgramResult result = Estimate(map, {"--depth-crop", part});
    EXPECT_EQ(result.exit_code, 2) << part;
    EXPECT_THAT(result.err, HasSubstr("--depth-crop")) << part;
  }
  EXPECT_EQ(Estimate(map, {"--min-confidence", "0.5"}).exit_code, 2);
  EXPECT_EQ(Estimate(map, {"--depth-crop", "0,0,4,3", "--depth-camera", "c.yaml"}).exit_code, 2);
}

}  // namespace
}  // namespace thicklens::tools
