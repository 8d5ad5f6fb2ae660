// Readings in the names of the files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Optional;
using ::thicklens::testing::ErrorOf;

ReadingOptions Named(const std::string& pattern, const std::string& unit = "") {
  ReadingOptions options;
  options.name_pattern = pattern;
  options.unit = unit;
  return options;
}

double ReadingOf(const std::string& name, const std::string& pattern,
                 const std::string& unit = "") {
  return ReadingsOfNames({"sweep/" + name}, Named(pattern, unit)).rows.at(0).reading_mm;
}

TEST(NameReadings, NumbersAndUnits) {
  EXPECT_DOUBLE_EQ(ReadingOf("z95.5mm.png", "z{reading}mm"), 95.5);
  EXPECT_DOUBLE_EQ(ReadingOf("z-12um_c0.tif", "z{reading}um"), -0.012);
  EXPECT_DOUBLE_EQ(ReadingOf("frame_0012.png", "frame_{reading}"), 12);
  EXPECT_DOUBLE_EQ(ReadingOf("frame-12.png", "frame-{reading}"), 12);
  EXPECT_DOUBLE_EQ(ReadingOf("1.25.png", "{reading}.png"), 1.25);
  EXPECT_DOUBLE_EQ(ReadingOf("95.png", "{reading}", "in"), 95 * 25.4);
  // The names of a multi-depth data set write 0.3 um as 0p3um.
  EXPECT_DOUBLE_EQ(ReadingOf("cell2G2Dz0p3um_ch0_stack0001.tif", "Dz{reading}um"), 0.0003);
  // Thorlabs' and a Raspberry Pi microscope's names: sign behind the letter, other axes behind.
  EXPECT_DOUBLE_EQ(ReadingOf("XP005_Z-1X0Y0@1#1.jpg", "_Z{reading}X"), -1);
  const ReadingSet set = ReadingsOfNames({"a/z1um.png", "a/z2um.png"}, Named("z{reading}um"));
  EXPECT_EQ(set.description, "'z{reading}um' in the names of 2 files, um");
  EXPECT_EQ(set.rows[1].file, "a/z2um.png");
}

TEST(NameReadings, NamesThatDoNotMatchAreNamed) {
  EXPECT_THAT(ErrorOf([] {
                ReadingsOfNames({"a/z1.png", "a/dark.png"}, Named("z{reading}"));
              }),
              AllOf(HasSubstr("a/dark.png: "), HasSubstr("does not contain 'z{reading}'")));
  EXPECT_THAT(ErrorOf([] { ReadingOf("z1_z2.png", "z{reading}"); }), HasSubstr("more than once"));
  EXPECT_THAT(ErrorOf([] { ReadingOf("z" + std::string(99, '9') + ".png", "z{reading}"); }),
              HasSubstr("at most 1e30"));
  EXPECT_EQ(ReadingOf("z5.png", "z{reading}", "steps"), 5) << "a count";
}

TEST(NameReadings, APatternIsProposedForOneChangingNumber) {
  EXPECT_THAT(ProposedNamePattern({"s/run2_z10um.png", "s/run2_z12.5um.png"}),
              Optional(std::string("run2_z{reading}um.png")));
  EXPECT_THAT(ProposedNamePattern({"z-1_x0.png", "z0_x0.png", "z1_x0.png"}),
              Optional(std::string("z{reading}_x0.png")));
  EXPECT_THAT(ProposedNamePattern({"f-001.png", "f-002.png"}),
              Optional(std::string("f-{reading}.png")));
  EXPECT_EQ(ProposedNamePattern({"z1_t1.png", "z2_t2.png"}), std::nullopt);
  EXPECT_EQ(ProposedNamePattern({"a1.png", "b2.png"}), std::nullopt);
  EXPECT_EQ(ProposedNamePattern({"a1.png", "a1.tif"}), std::nullopt);
  EXPECT_EQ(ProposedNamePattern({"a.png", "b.png"}), std::nullopt);
  EXPECT_EQ(ProposedNamePattern({"a1.png"}), std::nullopt);
  EXPECT_EQ(ProposedNamePattern({}), std::nullopt);
  // The proposed pattern reads the names.
  const std::vector<std::string> names = {"z-1_x0.png", "z0_x0.png", "z1_x0.png"};
  EXPECT_EQ(ReadingsOfNames(names, Named(*ProposedNamePattern(names))).rows.at(0).reading_mm, -1);
}

}  // namespace
}  // namespace thicklens::model
