// Which of two compared inputs an option about their layout is for.
#include "tools/options/compared_inputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

const ComparedInput kOwnInput{"own", true, true};
const ComparedInput kFolderInput{"folder", true, false};
const ComparedInput kFileInput{"file.h5", false, false};

ReadingOptions AllReadingOptions(const std::string& layout) {
  ReadingOptions options;
  options.grid = 9;
  options.layout = layout;
  options.name = "{v}_{u}";
  options.view_order = "mirror-u";
  return options;
}

TEST(ComparedReadings, AFolderOfThicklensStatesItself) {
  const ReadingOptions all = AllReadingOptions("names");
  const ComparedReadings readings = ReadingsOf(all, {}, kOwnInput, kFolderInput);
  EXPECT_EQ(readings.reference.grid, 0);
  EXPECT_EQ(readings.reference.layout, "");
  EXPECT_EQ(readings.reference.name, "");
  EXPECT_EQ(readings.reference.view_order, "");
  EXPECT_EQ(readings.other.grid, 9);
  EXPECT_EQ(readings.other.layout, "names");
  EXPECT_EQ(readings.other.name, "{v}_{u}");
  EXPECT_EQ(readings.other.view_order, "mirror-u");
  EXPECT_EQ(ReadingsOf(all, {}, kFolderInput, kOwnInput).other.view_order, "");
  EXPECT_EQ(ReadingsOf(all, {}, kFolderInput, kFolderInput).reference.view_order, "mirror-u");
  EXPECT_EQ(ReadingsOf(all, {}, kOwnInput, kOwnInput).other.layout, "names");
}

TEST(ComparedReadings, ALayoutIsForTheInputsOfItsKind) {
  ReadingOptions options;
  options.layout = "hdf5";
  options.view_order = "mirror-u";
  const ComparedReadings readings = ReadingsOf(options, {}, kFolderInput, kFileInput);
  EXPECT_EQ(readings.reference.layout, "");
  EXPECT_EQ(readings.reference.view_order, "");
  EXPECT_EQ(readings.other.layout, "hdf5");
  EXPECT_EQ(readings.other.view_order, "mirror-u");
  // No folder fits it better: reading the file says what is wrong.
  options.layout = "names";
  EXPECT_EQ(ReadingsOf(options, {}, kOwnInput, kFileInput).other.layout, "names");
  options = {};
  options.name = "{v}_{u}";
  EXPECT_EQ(ReadingsOf(options, {}, kFolderInput, kFileInput).other.name, "");
  EXPECT_EQ(ReadingsOf(options, {}, kFolderInput, kFileInput).reference.name, "{v}_{u}");
}

TEST(ComparedReadings, OptionsOfTheOtherReplaceTheseOfBoth) {
  OtherReadingOptions other;
  other.grid = 5;
  other.layout = "tiles:5x5";
  other.view_order = "none";
  ReadingOptions options;
  options.grid = 9;
  options.view_order = "mirror-u";
  const ComparedReadings readings = ReadingsOf(options, other, kFolderInput, kFileInput);
  EXPECT_EQ(readings.reference.grid, 9);
  EXPECT_EQ(readings.reference.layout, "");
  EXPECT_EQ(readings.other.grid, 5);
  EXPECT_EQ(readings.other.layout, "tiles:5x5");
  EXPECT_FALSE(LightFieldReadOptionsOf(readings.other).view_order.mirror_u);
  EXPECT_TRUE(LightFieldReadOptionsOf(readings.reference).view_order.mirror_u);
  other.view_order = "back";
  EXPECT_THROW(ReadingsOf(options, other, kFolderInput, kFileInput), UsageError);
}

// A file would take it as the size of its lenslets.
TEST(ComparedReadings, AGridIsForTheFolder) {
  ReadingOptions options;
  options.grid = 2;
  const ComparedReadings readings = ReadingsOf(options, {}, kFolderInput, kFileInput);
  EXPECT_EQ(readings.reference.grid, 2);
  EXPECT_EQ(readings.other.grid, 0);
  EXPECT_EQ(ReadingsOf(options, {}, kFileInput, kFolderInput).reference.grid, 0);
  EXPECT_EQ(ReadingsOf(options, {}, kFileInput, kFolderInput).other.grid, 2);
  EXPECT_EQ(ReadingsOf(options, {}, kFileInput, kFileInput).other.grid, 2);
}

TEST(ComparedReadings, MessagesAboutTheOtherNameItsOptions) {
  OtherReadingOptions other;
  other.layout = "foo";
  EXPECT_THAT(ErrorOf([&] { ReadingsOf({}, other, kFileInput, kFileInput); }),
              ::testing::StartsWith("--other-layout: "));
  const OptionNames names = OtherReadingOptionNames();
  EXPECT_EQ(names("view_order"), "--other-view-order");
  EXPECT_EQ(names("hci_grid"), "--other-grid");
  EXPECT_EQ(names("allow_missing_views"), "--sparse");
}

TEST(ComparedReadings, AnOrderForAnUnknownInputIsRefused) {
  ReadingOptions options;
  options.view_order = "swap";
  EXPECT_THAT(ErrorOf([&] { ReadingsOf(options, {}, kFolderInput, kFileInput); }),
              AllOf(HasSubstr("--other-view-order"), HasSubstr("file.h5")));
  EXPECT_EQ(ReadingsOf(options, {}, kFileInput, kFileInput).other.view_order, "swap");
}

TEST(ComparedReadings, InputsAreFoldersOfThicklensOrOthers) {
  TemporaryFolder folder;
  folder.Put("own/lightfield.yaml", "");
  folder.Put("names/1_1.png", "");
  EXPECT_TRUE(ComparedInputOf(folder / "own").is_own);
  EXPECT_FALSE(ComparedInputOf(folder / "names").is_own);
  EXPECT_TRUE(ComparedInputOf(folder / "names").is_folder);
  EXPECT_FALSE(ComparedInputOf(folder / "names/1_1.png").is_folder);
  EXPECT_THAT(ErrorOf([&] { ComparedInputOf(folder / "none"); }), HasSubstr("no such"));
}

}  // namespace
}  // namespace thicklens::tools
