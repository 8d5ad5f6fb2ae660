#include "architecture/rooms_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "architecture/repository.h"

namespace thicklens::architecture {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

TEST(RoomsOfTheRepository, AreInNoCircle) { EXPECT_THAT(RepositoryTable().Circle(), IsEmpty()); }

TEST(RoomsTable, SaysWhatARoomMayInclude) {
  const RoomsTable table = RoomsTable::Parse(
      "# A comment.\n\nglass/base:\nglass/optics: glass/base\nfits: glass\ntools: glass/optics "
      "fits\n");
  EXPECT_THAT(table.rooms(), ElementsAre("glass/base", "glass/optics", "fits", "tools"));
  EXPECT_THAT(table.Modules(), ElementsAre("glass", "fits", "tools"));
  EXPECT_TRUE(table.MayInclude("glass/optics", "glass/base"));
  EXPECT_TRUE(table.MayInclude("glass/optics", "glass/optics"));
  EXPECT_FALSE(table.MayInclude("glass/base", "glass/optics"));
  EXPECT_TRUE(table.MayInclude("fits", "glass/base"));
  // A permission is not transitive: tools may not include what the rooms that it includes may
  // include.
  EXPECT_FALSE(table.MayInclude("tools", "glass/base"));
  EXPECT_EQ(table.WhatMayInclude("tools"), "glass/optics, fits");
  EXPECT_EQ(table.WhatMayInclude("glass/base"), "nothing");
  EXPECT_TRUE(table.IsModuleWithRooms("glass"));
  EXPECT_FALSE(table.IsModuleWithRooms("fits"));
}

TEST(RoomsTable, FindsTheInnermostRoom) {
  const RoomsTable table = RoomsTable::Parse("glass/simulate:\nglass/simulate/scene:\nfits:\n");
  EXPECT_EQ(table.RoomOf("glass/simulate/a.cc"), "glass/simulate");
  EXPECT_EQ(table.RoomOf("glass/simulate/scene/a.cc"), "glass/simulate/scene");
  EXPECT_EQ(table.RoomOf("glass/simulate/scenes/a.cc"), "glass/simulate");
  EXPECT_EQ(table.RoomOf("fits/src/a.cc"), "fits");
  EXPECT_FALSE(table.RoomOf("glass/a.cc").has_value());
}

TEST(RoomsTable, TakesFromTheModuleWhatARoomDoesNotSay) {
  const RoomsTable table = RoomsTable::Parse(
      "glass uses: fmt/ csv.h\nglass shows: Eigen/\nglass/base:\nglass/base shows:\n"
      "glass/base headers: thicklens/base\nglass/optics:\nglass/optics uses: fmt/\n");
  EXPECT_THAT(table.Uses("glass/base"), ElementsAre("fmt/", "csv.h"));
  EXPECT_THAT(table.Shows("glass/base"), IsEmpty());
  EXPECT_THAT(table.Uses("glass/optics"), ElementsAre("fmt/"));
  EXPECT_THAT(table.Shows("glass/optics"), ElementsAre("Eigen/"));
  EXPECT_THAT(table.Headers("glass/base"), ElementsAre("thicklens/base"));
  EXPECT_THAT(table.Headers("glass/optics"), ElementsAre("thicklens/glass"));
}

TEST(RoomsTable, FindsACircle) {
  EXPECT_THAT(RoomsTable::Parse("a:\nb: a\nc: a b\nd: b c\n").Circle(), IsEmpty());
  EXPECT_THAT(RoomsTable::Parse("a: b\nb: a\n").Circle(), ElementsAre("a", "b"));
  EXPECT_THAT(RoomsTable::Parse("z: a\na: b\nb: c\nc: a\n").Circle(),
              UnorderedElementsAre("a", "b", "c"));
  // The line refers to rooms by the name of their module.
  EXPECT_THAT(RoomsTable::Parse("glass/base: fits\nglass/optics:\nfits: glass\n").Circle(),
              UnorderedElementsAre("glass/base", "fits"));
}

std::string WhatIsWrongWith(const std::string& text) {
  try {
    RoomsTable::Parse(text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(RoomsTable, RefusesWhatItCannotRead) {
  EXPECT_THAT(WhatIsWrongWith("a:\nb a\n"), HasSubstr("line 2 "));
  EXPECT_THAT(WhatIsWrongWith("a:\nb likes: a\n"), HasSubstr("found 'b likes: a'"));
  EXPECT_THAT(WhatIsWrongWith("a:\na:\n"), HasSubstr("'a' was there before"));
  EXPECT_THAT(WhatIsWrongWith("a: b\n"), HasSubstr("a may include 'b', which is no room"));
}

}  // namespace
}  // namespace thicklens::architecture
