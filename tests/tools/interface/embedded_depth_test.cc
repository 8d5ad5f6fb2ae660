// The depth map inside a photograph as a map of the interface. The files and the right values are
// those of tests/data/embedded_depth/README.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <optional>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/depth.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using testing::ContentOf;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using testing::TemporaryFolder;

std::string PathOfPhoto(const std::string& name) {
  return std::string(THICKLENS_SOURCE_DIR) + "/tests/data/embedded_depth/" + name;
}

TEST(EmbeddedDepthInterfaceTest, TheMapHasTheMeaningThatTheFileStates) {
  const std::optional<DepthMap> map = ReadEmbeddedDepth(PathOfPhoto("gdepth_inverse.jpg"));
  ASSERT_TRUE(map);
  std::string why;
  EXPECT_TRUE(map->IsValid(&why)) << why;
  EXPECT_EQ(map->meaning.kind, DepthKind::kInverse);
  EXPECT_EQ(map->meaning.unit, LengthUnit::kNone);
  EXPECT_EQ(map->meaning.inverse_scale_dpt, 1);
  EXPECT_EQ(map->width_px, 32);
  EXPECT_EQ(map->height_px, 24);
  EXPECT_NEAR(map->values.front(), 2.08, 1e-5);
  EXPECT_NEAR(map->values.back(), 0.4, 1e-5);
  const auto turned =
      ReadEmbeddedDepth(PathOfPhoto("gdepth_inverse.jpg"), 0, 0, model::DepthFlip::kBoth);
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->values.front(), map->values.back());
  EXPECT_FALSE(map->is_integer);
  EXPECT_THAT(map->notes.front(), StartsWith("The depth map inside is used: GDepth, RangeInverse"));
  const std::optional<DepthMap> range = ReadEmbeddedDepth(PathOfPhoto("gdepth_linear_ray.jpg"));
  ASSERT_TRUE(range);
  EXPECT_EQ(range->meaning.kind, DepthKind::kRange);
  EXPECT_EQ(range->meaning.unit, LengthUnit::kMillimetre);
  EXPECT_NEAR(range->values.front(), 420, 0.1);
  EXPECT_FALSE(ReadEmbeddedDepth(PathOfPhoto("second_image.jpg")));
}

TEST(EmbeddedDepthInterfaceTest, ItIsEnlargedToThePhotograph) {
  const std::string path = PathOfPhoto("dynamic_depth.jpg");
  const std::optional<DepthMap> map = ReadEmbeddedDepth(path, 64, 48);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->width_px, 64);
  EXPECT_EQ(map->values.size(), 64U * 48U);
  EXPECT_EQ(map->values.front(), 1400);
  EXPECT_EQ(map->values.back(), 3000);
  EXPECT_THAT(map->notes, Contains(HasSubstr("32 x 24 px and is enlarged to 64 x 48 px")));
  EXPECT_THAT(ErrorOf([&] { ReadEmbeddedDepth(path, 64, 64); }),
              AllOf(StartsWith(path), HasSubstr("an equal aspect ratio is expected")));
  EXPECT_EQ(FieldOfOptionError([&] { ReadEmbeddedDepth(path, 64, 0); }), "width_px");
  EXPECT_EQ(FieldOfOptionError([&] { ReadEmbeddedDepth(path, -1, -1); }), "width_px");
}

TEST(EmbeddedDepthInterfaceTest, AMapWithoutAUnitIsRefused) {
  const TemporaryFolder folder;
  std::string bytes = ContentOf(PathOfPhoto("dynamic_depth.jpg"));
  bytes.replace(bytes.find("Meters"), 6, "  None");
  const std::string path = folder.Put("photo.jpg", bytes);
  EXPECT_THAT(ErrorOf([&] { ReadEmbeddedDepth(path); }),
              AllOf(StartsWith(path), HasSubstr("no unit of length"),
                    HasSubstr("by io::ReadEmbeddedDepthFile"), Not(HasSubstr("thicklens depth"))));
}

// The photograph in the place of its depth map is refused with the way to the map.
TEST(EmbeddedDepthInterfaceTest, APhotographIsNoDepthMapButHoldsOne) {
  const std::string path = PathOfPhoto("gdepth_inverse.jpg");
  EXPECT_THAT(ErrorOf([&] {
                ReadDepth(path, {DepthKind::kZ, LengthUnit::kMillimetre});
              }),
              AllOf(StartsWith(path), HasSubstr("with a depth map inside (GDepth"),
                    HasSubstr("by ReadEmbeddedDepth"), Not(HasSubstr("thicklens depth"))));
  // A program says how its user gets the map.
  RunControl run;
  run.option_name = [](const std::string& name) { return "[" + name + "]"; };
  EXPECT_THAT(ErrorOf([&] {
                ReadDepth(path, {DepthKind::kZ, LengthUnit::kMillimetre}, {}, run);
              }),
              HasSubstr("by [ReadEmbeddedDepth]"));
}

}  // namespace
}  // namespace thicklens
