// A sweep whose images and readings are still being written.
#include "thicklens/model/growing_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"

namespace thicklens::model {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

class GrowingSweepTest : public ::testing::Test {
 protected:
  GrowingSweep Read(const std::vector<std::string>& images, const std::string& table,
                    const SweepReading& reading = {}) {
    return SweepOfImages(folder_.path(), images, table, "camera.yaml", reading, &notices_);
  }

  TemporaryFolder folder_;
  std::string a_ = folder_.Put("a.png"), b_ = folder_.Put("b.png"), c_ = folder_.Put("c.png");
  std::vector<std::string> notices_;
};

// Neither a row whose image is not there yet, nor an image without a row, is an error.
TEST_F(GrowingSweepTest, TakesThePairsThatAreThere) {
  const std::string table =
      folder_.Put("table.csv", "file,reading_mm\nb.png,2\nlater.png,3\nc.png,4\na.png,1\n");
  const GrowingSweep growing = Read({a_, b_}, table);
  ASSERT_EQ(growing.sweep.frames.size(), 2U);
  EXPECT_EQ(growing.sweep.frames[0].image, b_);  // in the order of the table
  EXPECT_EQ(growing.sweep.frames[0].reading_mm, 2);
  EXPECT_EQ(growing.sweep.frames[1].image, a_);
  EXPECT_THAT(growing.without_reading, IsEmpty());
  EXPECT_EQ(growing.sweep.source, folder_.path());
}

TEST_F(GrowingSweepTest, NamesImagesWithoutAReading) {
  const std::string table = folder_.Put("table.csv", "file,reading_mm\nb.png,2\n");
  EXPECT_THAT(Read({a_, b_, c_}, table).without_reading, ElementsAre(a_, c_));
}

// A finished sweep reads a folder as ReadSweepFolder does.
TEST_F(GrowingSweepTest, IsTheSweepOfTheFolderInTheEnd) {
  const std::string table =
      folder_.Put("table.csv", "file,reading_mm\nb.png,2\nc.png,4\na.png,1\n");
  const SweepFile whole = SweepFromFolder(folder_.path(), table, "camera.yaml", nullptr);
  const SweepFile grown = Read({a_, b_, c_}, table).sweep;
  ASSERT_EQ(grown.frames.size(), whole.frames.size());
  for (std::size_t i = 0; i < whole.frames.size(); ++i) {
    EXPECT_EQ(grown.frames[i].image, whole.frames[i].image);
    EXPECT_EQ(grown.frames[i].reading_mm, whole.frames[i].reading_mm);
  }
  EXPECT_EQ(grown.readings, whole.readings);
}

TEST_F(GrowingSweepTest, OrdersNamesByTheirReadings) {
  const std::string z10 = folder_.Put("z10.png"), z9 = folder_.Put("z9.png");
  SweepReading reading;
  reading.readings.name_pattern = "z{reading}";
  const GrowingSweep growing = Read({z10, z9}, "", reading);
  ASSERT_EQ(growing.sweep.frames.size(), 2U);
  EXPECT_EQ(growing.sweep.frames[0].reading_mm, 9);
}

TEST_F(GrowingSweepTest, RefusesTwoReadingsOfOneImage) {
  const std::string table = folder_.Put("table.csv", "file,reading_mm\na.png,2\na.png,3\n");
  EXPECT_THAT(ErrorOf([&] { Read({a_}, table); }), HasSubstr("already has a reading"));
}

}  // namespace
}  // namespace thicklens::model
