// Light fields in MAT and HDF5 files. tests/data/lightfields/README.md says who wrote them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

std::string StoredFilePath(const std::string& name) {
  return THICKLENS_SOURCE_DIR "/tests/data/lightfields/" + name;
}

class StoredViews : public ::testing::Test {
 protected:
  model::LightField Read(const std::string& path) { return ReadLightField(path, {}, &facts_); }

  // Requires the levels of README.md, as light by the curve.
  static void ExpectLevels(const model::LightField& light_field,
                           const model::TransferCurve& curve) {
    ASSERT_EQ(light_field.u_count, 3);
    ASSERT_EQ(light_field.v_count, 2);
    ASSERT_EQ(light_field.s_count, 8);
    ASSERT_EQ(light_field.t_count, 6);
    ASSERT_EQ(light_field.channels, 3);
    for (int t = 0; t < 2; ++t) {
      for (int s = 0; s < 3; ++s) {
        if (!light_field.IsPresent(s, t)) continue;
        const model::LinearImage view = model::ViewImage(light_field, s, t);
        for (int v = 0; v < 6; ++v) {
          for (int u = 0; u < 8; ++u) {
            for (int c = 0; c < 3; ++c) {
              const int level = 17 * t + 29 * s + 5 * v + 3 * u + 11 * c;
              ASSERT_NEAR(view.at(u, v, c), curve.Decode(level / 255.0), 1e-6)
                  << t << s << v << u << c;
            }
          }
        }
      }
    }
  }

  // The error about a file with another byte at the first place of a text, moved by `away`.
  std::string ErrorWith(const std::string& name, const std::string& at, std::size_t away,
                        const std::string& bytes) {
    std::string content = ContentOf(StoredFilePath(name));
    const std::size_t place = content.find(at);
    EXPECT_NE(place, std::string::npos);
    content.replace(place + away, bytes.size(), bytes);
    const std::string path = folder_.Put(name, content);
    return ErrorOf([&] { Read(path); });
  }

  TemporaryFolder folder_;
  LightFieldFacts facts_;
};

TEST_F(StoredViews, TheToolboxHasTheRowOfTheViewFirst) {
  const model::LightField light_field = Read(StoredFilePath("levels-5.mat"));
  ExpectLevels(light_field, model::TransferCurve::Srgb());
  EXPECT_THAT(facts_.one_line, AllOf(HasSubstr("the variable LF of a MAT file: 3 x 2 views"),
                                     HasSubstr("integers are taken as sRGB")));
  EXPECT_EQ(facts_.kind, "the variable LF of a MAT file");
}

TEST_F(StoredViews, CorrectedColoursAreSrgb) {
  for (const char* name : {"corrected-5-compressed.mat", "corrected-7.3.mat"}) {
    ExpectLevels(Read(StoredFilePath(name)), model::TransferCurve::Srgb());
    EXPECT_THAT(facts_.one_line, HasSubstr("taken as sRGB")) << name;
  }
}

TEST_F(StoredViews, UncorrectedColoursAreLinear) {
  ExpectLevels(Read(StoredFilePath("linear-7.3.mat")), model::TransferCurve::Linear());
  EXPECT_THAT(facts_.one_line, HasSubstr("it is linear light"));
}

TEST_F(StoredViews, AViewWithoutWeightIsLeftOut) {
  for (const char* name : {"corrected-5-compressed.mat", "linear-7.3.mat"}) {
    const model::LightField light_field = Read(StoredFilePath(name));
    EXPECT_FALSE(light_field.IsPresent(2, 0)) << name;
    EXPECT_TRUE(light_field.IsPresent(0, 1)) << name;
    EXPECT_NEAR(light_field.weights(0, 0), 1.0 / 5, 1e-12) << name;
    EXPECT_THAT(facts_.one_line, HasSubstr("view (2, 0)")) << name;
  }
}

// The other file could be a pipe, which keeps whoever opens it waiting.
TEST_F(StoredViews, NumbersInOtherFilesAreNotRead) {
  for (const char* name : {"external.h5", "virtual.h5"}) {
    EXPECT_THAT(ErrorOf([&] { Read(StoredFilePath(name)); }),
                AllOf(HasSubstr(name), HasSubstr("in other files")));
  }
}

TEST_F(StoredViews, TheHeidelbergSetHasTheRowOfTheViewFirst) {
  ExpectLevels(Read(StoredFilePath("heidelberg.h5")), model::TransferCurve::Srgb());
  EXPECT_THAT(facts_.one_line,
              AllOf(HasSubstr("the data set LF of an HDF5 file"), HasSubstr("dH 0.1"),
                    HasSubstr("focalLength 9.375"), HasSubstr("GT_DEPTH is in it and not read")));
  EXPECT_THAT(facts_.notices, Not(Contains(HasSubstr("attribute"))));
}

TEST_F(StoredViews, OtherContentsAreNamed) {
  EXPECT_THAT(ErrorOf([&] { Read(StoredFilePath("signed-5.mat")); }),
              AllOf(HasSubstr("signed-5.mat"), HasSubstr("signed 16-bit integers"),
                    HasSubstr("2 x 3 x 6 x 8 x 3")));
  EXPECT_THAT(ErrorOf([&] { Read(StoredFilePath("image-5.mat")); }),
              AllOf(HasSubstr("LF(t, s, v, u, c)"), HasSubstr("image (6 x 8 x 3")));
  LightFieldReading reading;
  reading.layout = "hdf5";
  EXPECT_THAT(ErrorOf([&] { ReadLightField(StoredFilePath("levels-5.mat"), reading); }),
              HasSubstr("the layout mat"));
  EXPECT_THAT(ErrorOf([&] { ReadLightField(StoredFilePath("README.md"), reading); }),
              HasSubstr("neither"));
}

// Taken as (v, u, y, x), they would be views that are 3 px wide.
TEST_F(StoredViews, ViewsInOneAxisNeedTheirNumbers) {
  for (const auto& [name, layout] :
       {std::pair("numbered.h5", "hdf5"), std::pair("numbered-5.mat", "mat")}) {
    EXPECT_THAT(ErrorOf([&] { Read(StoredFilePath(name)); }),
                AllOf(HasSubstr(name), HasSubstr("6 x 6 x 8 x 3"), HasSubstr("3 px wide"),
                      HasSubstr(std::string(layout) + ":UxV")));
    LightFieldReading reading;
    reading.layout = layout;
    reading.layout_u = 3;
    reading.layout_v = 2;
    ExpectLevels(ReadLightField(StoredFilePath(name), reading), model::TransferCurve::Srgb());
    reading.layout_u = 2;
    EXPECT_THAT(ErrorOf([&] { ReadLightField(StoredFilePath(name), reading); }),
                AllOf(HasSubstr(name), HasSubstr("3 px wide")));
  }
  LightFieldReading reading;
  reading.layout = "mat";
  reading.layout_u = reading.layout_v = 2;
  EXPECT_THAT(ErrorOf([&] { ReadLightField(StoredFilePath("levels-5.mat"), reading); }),
              HasSubstr("states 2 x 2 views, but LF (2 x 3 x 6 x 8 x 3) has 3 x 2"));
}

TEST_F(StoredViews, TruncatedFilesAreRefused) {
  for (const char* name : {"levels-5.mat", "corrected-5-compressed.mat", "linear-7.3.mat",
                           "corrected-7.3.mat", "heidelberg.h5"}) {
    const std::string content = ContentOf(StoredFilePath(name));
    ASSERT_FALSE(content.empty()) << name;
    for (const std::size_t part : {2, 3, 4}) {
      const std::string path = folder_.Put(name, content.substr(0, content.size() * part / 5));
      EXPECT_THAT(ErrorOf([&] { Read(path); }), HasSubstr(name)) << part;
    }
  }
}

// The last byte of each compressed variable belongs to zlib's checksum of its contents.
TEST_F(StoredViews, WrongChecksumsAreRefused) {
  const std::string content = ContentOf(StoredFilePath("corrected-5-compressed.mat"));
  constexpr std::size_t kHeaderBytes = 128, kTag = 8;
  int variables = 0;
  for (std::size_t at = kHeaderBytes; at + kTag < content.size(); ++variables) {
    std::size_t length = 0;
    for (std::size_t i = 4; i-- > 0;)
      length = length << 8U | static_cast<unsigned char>(content[at + 4 + i]);
    at += kTag + length;
    ASSERT_LE(at, content.size());
    std::string damaged = content;
    damaged[at - 1] = static_cast<char>(damaged[at - 1] ^ 1);
    const std::string path = folder_.Put("damaged.mat", damaged);
    EXPECT_THAT(ErrorOf([&] { Read(path); }),
                AllOf(HasSubstr("damaged.mat"), HasSubstr("variable are damaged")))
        << variables;
  }
  EXPECT_EQ(variables, 3);
}

TEST_F(StoredViews, AnArrayOfAnotherNameMayHoldViewsInOneAxis) {
  std::string content = ContentOf(StoredFilePath("numbered.h5"));
  const std::size_t at = content.find("LF");
  ASSERT_NE(at, std::string::npos);
  content.replace(at, 2, "ab");
  const std::string path = folder_.Put("ab.h5", content);
  EXPECT_THAT(ErrorOf([&] { Read(path); }), HasSubstr("no light field is in it"));
  LightFieldReading reading;
  reading.layout = "hdf5";
  reading.layout_u = 3;
  reading.layout_v = 2;
  ExpectLevels(ReadLightField(path, reading), model::TransferCurve::Srgb());
}

// Rows and columns of pixels before those of views.
TEST_F(StoredViews, MoreViewsThanPixelsAreRefused) {
  using namespace std::string_literals;
  const std::string sizes = "\2\0\0\0\3\0\0\0\6\0\0\0\10\0\0\0\3\0\0\0"s;
  const std::string pixels_first = "\6\0\0\0\10\0\0\0\2\0\0\0\3\0\0\0\3\0\0\0"s;
  EXPECT_THAT(ErrorWith("levels-5.mat", sizes, 0, pixels_first),
              AllOf(HasSubstr("8 x 6 views of 3 x 2 px"), HasSubstr("LF(t, s, v, u, c)"),
                    HasSubstr("mat:8x6")));
  LightFieldReading reading;
  reading.layout = "mat";
  reading.layout_u = 8;
  reading.layout_v = 6;
  EXPECT_EQ(ReadLightField(folder_ / "levels-5.mat", reading).u_count, 8);
}

// Before, a file of 4 MB was inflated to 4 GB for its checksum.
TEST_F(StoredViews, MoreThanAVariableStatesIsNotInflated) {
  using namespace std::string_literals;
  const std::string content = ContentOf(StoredFilePath("levels-5.mat"));
  constexpr std::size_t kHeaderBytes = 128, kMore = 64;
  // zlib's format with a block that is not compressed, and its checksum (RFC 1950).
  const std::string contained = content.substr(kHeaderBytes) + std::string(kMore, '\0');
  ASSERT_LT(contained.size(), 0xFFFFU);
  const auto low = [](std::size_t size) { return static_cast<char>(size & 0xFFU); };
  const auto high = [](std::size_t size) { return static_cast<char>(size >> 8U & 0xFFU); };
  const std::size_t size = contained.size(), inverse = ~size;
  std::uint32_t a = 1, b = 0;
  for (const char c : contained) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const std::string checksum = {high(b), low(b), high(a), low(a)};
  const std::string stream = "\x78\x01\x01"s + low(size) + high(size) + low(inverse) +
                             high(inverse) + contained + checksum;
  const std::string tag = "\17\0\0\0"s + low(stream.size()) + high(stream.size()) + "\0\0"s;
  const std::string path = folder_.Put("more.mat", content.substr(0, kHeaderBytes) + tag + stream);
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("more.mat"), HasSubstr("hold more than it states")));
}

TEST_F(StoredViews, LyingSizesAreRefused) {
  using namespace std::string_literals;
  // The number of channels in levels-5.mat, after the four other sizes.
  const std::string sizes = "\2\0\0\0\3\0\0\0\6\0\0\0\10\0\0\0\3\0\0\0"s;
  EXPECT_THAT(ErrorWith("levels-5.mat", sizes, 16, "\4"),
              HasSubstr("states 1152 numbers, its data are 864 bytes"));
  // 2 billion columns.
  EXPECT_THAT(ErrorWith("levels-5.mat", sizes, 12, "\xFF\xFF\xFF\x7F"), HasSubstr("levels-5.mat"));
  EXPECT_THAT(ErrorWith("levels-5.mat", sizes, 0, "\0"s), HasSubstr("0 views"));
  EXPECT_THAT(ErrorWith("levels-5.mat", sizes, 0, "\xFF\xFF\xFF\xFF"), HasSubstr("negative"));
  // The first size of LF in heidelberg.h5, 8 bytes each.
  const std::string shape = "\2\0\0\0\0\0\0\0\3\0\0\0\0\0\0\0\6\0\0\0\0\0\0\0"s;
  EXPECT_THAT(ErrorWith("heidelberg.h5", shape, 0, "\xE8\3"), HasSubstr("heidelberg.h5"));
  EXPECT_THAT(ErrorWith("heidelberg.h5", shape, 0, "\xFF\xFF\xFF\xFF\xFF\xFF\xFF\x7F"),
              HasSubstr("heidelberg.h5"));
}

// Which of them is meant cannot be known.
TEST_F(StoredViews, TwoVariablesOfOneNameAreRefused) {
  const std::string content = ContentOf(StoredFilePath("levels-5.mat"));
  constexpr std::size_t kHeaderBytes = 128;
  const std::string path = folder_.Put("two.mat", content + content.substr(kHeaderBytes));
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("two.mat"), HasSubstr("two of its variables have the name 'LF'")));
}

// libhdf5 fails for some of these files: that must not end this process.
TEST_F(StoredViews, DamagedFilesAreReadOrRefused) {
  for (const char* name : {"heidelberg.h5", "corrected-7.3.mat", "corrected-5-compressed.mat"}) {
    const std::string content = ContentOf(StoredFilePath(name));
    ASSERT_FALSE(content.empty()) << name;
    unsigned random = 12345;
    const auto next = [&random](std::size_t below) {
      random = random * 1664525U + 1013904223U;
      return static_cast<std::size_t>(random >> 8U) % below;
    };
    for (int i = 0; i < 60; ++i) {
      std::string damaged = content;
      for (int bytes = 0; bytes < 3; ++bytes)
        damaged[next(damaged.size())] = static_cast<char>(next(256));
      const std::string path = folder_.Put(name, damaged);
      try {
        Read(path);
      } catch (const Error& error) {
        ASSERT_THAT(error.what(), HasSubstr(name));
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::io
