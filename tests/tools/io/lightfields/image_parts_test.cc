// Light fields in EXR files of several parts or views. tests/data/lightfields/README.md says who
// wrote them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/io/light_field_io.h"
#include "tools/io/image_library.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::ContentOf;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

std::string ExrPartsPath(const std::string& name) {
  return THICKLENS_SOURCE_DIR "/tests/data/lightfields/" + name;
}

class ExrLightFields : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts reads no EXR files";
  }
  // Requires 2 rows of 3 views whose red is that of the column and whose green is that of the row.
  void ExpectParts(const std::string& name, const LightFieldReading& reading = {}) {
    const model::LightField light_field = ReadLightField(ExrPartsPath(name), reading, &facts_);
    ASSERT_EQ(light_field.u_count, 3);
    ASSERT_EQ(light_field.v_count, 2);
    ASSERT_EQ(light_field.channels, 3);
    for (int l = 0; l < 2; ++l) {
      for (int k = 0; k < 3; ++k) {
        const model::LinearImage view = model::ViewImage(light_field, k, l);
        EXPECT_NEAR(view.at(3, 2, 0), 0.1 * (k + 1), 1e-3) << k << ", " << l;
        EXPECT_NEAR(view.at(3, 2, 1), 0.1 * (2 * l + 1), 1e-3) << k << ", " << l;
        EXPECT_NEAR(view.at(3, 2, 2), 0.5, 1e-3) << k << ", " << l;
      }
    }
  }
  TemporaryFolder folder_;
  LightFieldFacts facts_;
};

TEST_F(ExrLightFields, PartsAreNamedByRowAndColumn) {
  ExpectParts("parts.exr");
  EXPECT_THAT(facts_.one_line, HasSubstr("a file of 6 parts named 'view_{v}_{u}'"));
  LightFieldReading reading;
  reading.name = "view_{v}_{u}";
  ExpectParts("parts.exr", reading);
  reading.name = "other_{v}_{u}";
  EXPECT_THAT(ErrorOf([&] { ExpectParts("parts.exr", reading); }), HasSubstr("no name fits"));
}

TEST_F(ExrLightFields, ViewsOfPartsAreNamedByTheirAttribute) {
  ExpectParts("multiview-parts.exr");
  EXPECT_THAT(facts_.one_line, HasSubstr("r{v}c{u}"));
}

TEST_F(ExrLightFields, ViewsOfOnePartAreItsChannels) {
  ExpectParts("multiview.exr");
  EXPECT_THAT(facts_.one_line, HasSubstr("an EXR file of 6 views named 'r{v}c{u}'"));
}

TEST_F(ExrLightFields, ALeftAndARightViewAreInOneRow) {
  for (const char* name : {"stereo.exr", "stereo-parts.exr"}) {
    const model::LightField light_field = ReadLightField(ExrPartsPath(name), {}, &facts_);
    ASSERT_EQ(light_field.u_count, 2) << name;
    ASSERT_EQ(light_field.v_count, 1) << name;
    for (int k = 0; k < 2; ++k)
      EXPECT_NEAR(model::ViewImage(light_field, k, 0).at(3, 2, 0), 0.1 * (k + 1), 1e-3) << name;
    EXPECT_THAT(facts_.one_line, HasSubstr("a left and a right view"));
  }
}

TEST_F(ExrLightFields, OtherPartsAreNamed) {
  EXPECT_THAT(ErrorOf([&] { ReadLightField(ExrPartsPath("unnamed-parts.exr"), {}); }),
              AllOf(HasSubstr("unnamed-parts.exr"), HasSubstr("2")));
}

// An image may follow another in such a file, which has a main image and no pages.
TEST_F(ExrLightFields, OnlyPagesOfTiffMayBeViews) {
  EXPECT_THAT(ErrorOf([&] { ReadLightField(ExrPartsPath("two_images.heic"), {}); }),
              AllOf(HasSubstr("views side by side, which this image does not show"),
                    ::testing::Not(HasSubstr("pages"))));
}

TEST_F(ExrLightFields, BrokenFilesAreNamed) {
  for (const char* name : {"parts.exr", "multiview.exr", "multiview-parts.exr"}) {
    const std::string content = ContentOf(ExrPartsPath(name));
    ASSERT_FALSE(content.empty()) << name;
    for (std::size_t part = 1; part < 8; ++part) {
      const std::string path = folder_.Put(name, content.substr(0, content.size() * part / 8));
      EXPECT_THAT(ErrorOf([&] { ReadLightField(path, {}); }), HasSubstr(name)) << part;
    }
  }
}

}  // namespace
}  // namespace thicklens::io
