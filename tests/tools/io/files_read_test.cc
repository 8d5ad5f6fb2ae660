#include "thicklens/io/files_read.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

ImageFacts Facts(int width_px) {
  ImageFacts facts;
  facts.file_kind = "PNG";
  facts.width_px = width_px;
  facts.height_px = 48;
  facts.channels = {"Y"};
  facts.sample_type = "unsigned 8-bit integers";
  return facts;
}

TEST(FilesRead, EqualFilesAreOneGroupAndUnreadOnesNone) {
  const auto groups = GroupFilesRead({"a.png", "b.png", "c.png", "d.png"},
                                     {Facts(64), std::nullopt, Facts(32), Facts(32)});
  ASSERT_THAT(groups, SizeIs(2));
  EXPECT_THAT(groups[0].files, ElementsAre("c.png", "d.png"));
  EXPECT_THAT(groups[1].files, ElementsAre("a.png"));
}

TEST(FilesRead, TheLineSaysWhatDiffers) {
  const auto one = GroupFilesRead({"dir/a.png"}, {Facts(64)});
  EXPECT_EQ(FilesReadLine(one), Facts(64).OneLine());
  const auto equal = GroupFilesRead({"a.png", "b.png"}, {Facts(64), Facts(64)});
  EXPECT_THAT(FilesReadLine(equal), StartsWith("2 files: PNG, 64 x 48 px"));
  const auto mixed =
      GroupFilesRead({"a.png", "dir/b.png", "c.png"}, {Facts(64), Facts(32), Facts(64)});
  EXPECT_THAT(FilesReadLine(mixed),
              AllOf(StartsWith("2 files: PNG, 64 x 48 px"), HasSubstr("; b.png: PNG, 32 x 48 px")));
}

}  // namespace
}  // namespace thicklens::io
