// Depth maps as bytes and files. The bytes are read here by a loop of its own and by OpenCV.
#include "thicklens/depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using testing::ContentOf;
using ::testing::ElementsAre;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;

const DepthMeaning kDepthInMm{DepthKind::kZ, LengthUnit::kMillimetre};

// Three columns and two rows, with values that are easily lost: holes, the sign of 0, a number
// below the normal ones, and one with all bits of the mantissa.
DepthMap MapOfSpecialValues() {
  using Float = std::numeric_limits<float>;
  return {
      3,     2,          {1.0F, -2.5F, Float::quiet_NaN(), -0.0F, Float::denorm_min(), 16777215},
      false, kDepthInMm, "simulated"};
}

std::vector<std::uint32_t> BitsOf(const std::vector<float>& values) {
  std::vector<std::uint32_t> bits(values.size());
  std::memcpy(bits.data(), values.data(), values.size() * sizeof(float));
  return bits;
}

// The rows of a PFM file go from bottom to top. -1.0 says that the bytes are little endian.
TEST(DepthInterfaceTest, TheBytesAreThoseOfPfm) {
  const DepthMap map{2, 2, {1.0F, 2.0F, -2.0F, 0.15625F}, false, kDepthInMm, ""};
  const std::string expected = std::string("Pf\n2 2\n-1.0\n") +
                               std::string("\x00\x00\x00\xC0", 4) +  // -2, of the second row
                               std::string("\x00\x00\x20\x3E", 4) +  // 0.15625 = 1.25/8
                               std::string("\x00\x00\x80\x3F", 4) +  // 1, of the first row
                               std::string("\x00\x00\x00\x40", 4);   // 2
  EXPECT_EQ(EncodeDepth(map), expected);
}

TEST(DepthInterfaceTest, OtherReadersFindTheSameValues) {
  const TemporaryFolder folder;
  const DepthMap map{3, 2, {1.5F, 2, 3, -4, 1e30F, 6e-30F}, false, kDepthInMm, ""};
  const cv::Mat read = cv::imread(folder.Put("map.pfm", EncodeDepth(map)), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.type(), CV_32FC1);
  ASSERT_EQ(read.size(), cv::Size(3, 2));
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      EXPECT_EQ(read.at<float>(y, x), map.values[static_cast<std::size_t>(3 * y + x)]) << x << y;
    }
  }
}

TEST(DepthInterfaceTest, EveryBitIsReadBack) {
  const TemporaryFolder folder;
  const DepthMap map = MapOfSpecialValues();
  const DepthMeaning other{DepthKind::kRange, LengthUnit::kMetre};
  const std::string path = folder.Put("map.pfm", EncodeDepth(map));
  const DepthMap read = ReadDepth(path, other);
  EXPECT_EQ(read.width_px, 3);
  EXPECT_EQ(read.height_px, 2);
  EXPECT_EQ(BitsOf(read.values), BitsOf(map.values));
  // The reader states the meaning, which the file does not contain.
  EXPECT_EQ(read.meaning.kind, DepthKind::kRange);
  EXPECT_EQ(read.meaning.unit, LengthUnit::kMetre);
  EXPECT_FALSE(read.is_integer);
  EXPECT_EQ(read.source, path);
}

TEST(DepthInterfaceTest, NearAndFarGiveTheScaleOfAnInverseDepth) {
  const TemporaryFolder folder;
  const std::string path = folder.Put("map.pgm", std::string("P5\n2 1\n255\n\x00\xFF", 13));
  DepthMeaning meaning;
  meaning.kind = DepthKind::kInverse;
  DepthReadOptions options;
  options.near_mm = 400;
  options.far_mm = 2500;
  const DepthMap map = ReadDepth(path, meaning, options);
  EXPECT_THAT(map.values, ElementsAre(0, 255));
  EXPECT_NEAR(map.meaning.inverse_offset_dpt, 0.4, 1e-12);
  EXPECT_NEAR(255 * map.meaning.inverse_scale_dpt + map.meaning.inverse_offset_dpt, 2.5, 1e-12);
  EXPECT_EQ(map.largest_of_type, 255);
  options.far_mm.reset();
  EXPECT_EQ(FieldOfOptionError([&] { ReadDepth(path, meaning, options); }), "far_mm");
  options.far_mm = 400;
  EXPECT_EQ(FieldOfOptionError([&] { ReadDepth(path, meaning, options); }), "far_mm");
  options.far_mm = 2500;
  EXPECT_EQ(FieldOfOptionError([&] { ReadDepth(path, kDepthInMm, options); }), "near_mm");
}

TEST(DepthInterfaceTest, TheBytesContainNothingButTheValues) {
  DepthMap other = MapOfSpecialValues();
  other.meaning = {DepthKind::kDisparity, LengthUnit::kNone, 0.5, -3};
  other.source = "another";
  other.is_integer = true;
  EXPECT_EQ(EncodeDepth(other), EncodeDepth(MapOfSpecialValues()));
}

TEST(DepthInterfaceTest, TheFileHasTheEncodedBytes) {
  const TemporaryFolder folder;
  WriteDepth(folder / "map.pfm", MapOfSpecialValues());
  EXPECT_EQ(ContentOf(folder / "map.pfm"), EncodeDepth(MapOfSpecialValues()));
  EXPECT_THAT(folder.Entries(), ElementsAre("map.pfm"));
}

// Changes a valid map and expects that it is neither encoded nor written.
void ExpectNotEncoded(const std::string& field, const std::function<void(DepthMap*)>& change) {
  SCOPED_TRACE(field);
  const TemporaryFolder folder;
  const std::string older = folder.Put("older.pfm", "of an older run");
  DepthMap map = MapOfSpecialValues();
  change(&map);
  EXPECT_EQ(FieldOfOptionError([&] { EncodeDepth(map); }), field);
  EXPECT_EQ(FieldOfOptionError([&] { WriteDepth(older, map); }), field);
  EXPECT_EQ(ContentOf(older), "of an older run");
  EXPECT_THAT(folder.Entries(), ElementsAre("older.pfm"));
}

TEST(DepthInterfaceTest, AWrongMapIsNotEncoded) {
  ExpectNotEncoded("width_px", [](DepthMap* map) { map->width_px = 0; });
  ExpectNotEncoded("height_px", [](DepthMap* map) { map->height_px = -2; });
  ExpectNotEncoded("values", [](DepthMap* map) { map->values.pop_back(); });
  ExpectNotEncoded("values", [](DepthMap* map) { map->values.clear(); });
  ExpectNotEncoded("meaning.unit", [](DepthMap* map) { map->meaning.unit = LengthUnit::kNone; });
  ExpectNotEncoded("meaning.disparity_scale", [](DepthMap* map) {
    map->meaning = {DepthKind::kDisparity, LengthUnit::kNone,
                    std::numeric_limits<double>::quiet_NaN()};
  });
}

TEST(DepthInterfaceTest, AFileThatCannotBeWrittenIsNamed) {
  const TemporaryFolder folder;
  EXPECT_NE(ErrorOf([] { WriteDepth("", MapOfSpecialValues()); }), "(no error)");
  EXPECT_THAT(ErrorOf([&] { WriteDepth(folder / "none/map.pfm", MapOfSpecialValues()); }),
              HasSubstr(folder / "none"));
  EXPECT_THAT(ErrorOf([&] { WriteDepth(folder.path(), MapOfSpecialValues()); }),
              HasSubstr(folder.path()));
  EXPECT_THAT(folder.Entries(), IsEmpty());
}

TEST(DepthInterfaceTest, AFileThatCannotBeReadIsNamed) {
  const TemporaryFolder folder;
  EXPECT_NE(ErrorOf([] { ReadDepth("", kDepthInMm); }), "(no error)");
  const std::string bytes = EncodeDepth(MapOfSpecialValues());
  const std::string cut = folder.Put("cut.pfm", bytes.substr(0, bytes.size() - 1));
  EXPECT_THAT(ErrorOf([&] { ReadDepth(cut, kDepthInMm); }), HasSubstr(cut));
}

TEST(MarkedDepthTest, MarksHolesAndReportsWhatIsFound) {
  DepthMap map;
  map.width_px = 10;
  map.height_px = 3;
  map.values.assign(30, 800);
  for (std::size_t i = 0; i < 10; ++i) map.values[i] = 9999;
  map.values[29] = -1;
  map.meaning = {DepthKind::kZ, LengthUnit::kMillimetre};
  map.source = "d.npy";
  map.warnings = {"A doubt."};
  std::string notices;
  RunControl run;
  run.notice = [&](const Notice& notice) { notices += notice.text + "\n"; };
  const model::RawDepthMap marked = MarkedDepth(map, run);
  EXPECT_EQ(marked.values[28], 800);
  EXPECT_TRUE(std::isnan(marked.values[29]));
  EXPECT_EQ(notices,
            "d.npy: A doubt.\n"
            "d.npy: 3.3 % of its values are negative and taken as 'no depth'\n"
            "d.npy: 10 pixels (33.3 %) have exactly the value 9999, far beyond all others: if it "
            "means 'no depth', state it by depth.holes 9999\n");
}

}  // namespace
}  // namespace thicklens
