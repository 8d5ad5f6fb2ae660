#include "thicklens/base/yaml_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

YamlNode Parse(const std::string& text) { return YamlNode::Parse(text, "f.yaml"); }

std::string NumberError(const std::string& scalar) {
  return ErrorOf([&] { Parse("x: " + scalar).At("x").Number(); });
}

TEST(YamlNumber, ReadsWhatYamlAndPeopleWrite) {
  const auto number = [](const std::string& scalar) {
    return Parse("x: " + scalar).At("x").Number();
  };
  EXPECT_EQ(number("12.5"), 12.5);
  EXPECT_EQ(number("-3"), -3);
  EXPECT_EQ(number("+7.25"), 7.25);
  EXPECT_EQ(number("1e-3"), 1e-3);
  EXPECT_EQ(number("1E+3"), 1000);
  EXPECT_EQ(number(".5"), 0.5);
  EXPECT_EQ(number("5."), 5);
}

TEST(YamlNumber, RefusesAUnitBehindTheNumber) {
  EXPECT_THAT(NumberError("6 um"), AllOf(StartsWith("f.yaml:1:4: x: "), HasSubstr("'6 um'"),
                                         HasSubstr("the key's name")));
  EXPECT_THAT(NumberError("6mm"), HasSubstr("the key's name"));
}

TEST(YamlNumber, RefusesWhatIsNotFinite) {
  for (const char* text :
       {"nan", "NaN", ".nan", "inf", "-inf", ".inf", "-.inf", "infinity", "1e999"})
    EXPECT_THAT(NumberError(text),
                AllOf(StartsWith("f.yaml:1:4: x: "), HasSubstr("number is expected")))
        << text;
}

TEST(YamlNumber, RefusesWhatIsNoNumber) {
  for (const char* text : {"abc", "1,5", "1_000", "0x10", "--5", "+-5", "-+5", "+", "''", "[1]",
                           "{a: 1}", "true", "1 2"})
    EXPECT_THAT(NumberError(text),
                AllOf(StartsWith("f.yaml:1:4: x: "), HasSubstr("number is expected")))
        << text;
  EXPECT_THAT(NumberError("abc"), Not(HasSubstr("unit")));
}

TEST(YamlNumber, BoundsNameTheValue) {
  const auto error = [](const std::string& scalar, double (YamlNode::*read)() const) {
    return ErrorOf([&] { (Parse("x: " + scalar).At("x").*read)(); });
  };
  EXPECT_THAT(error("0", &YamlNode::PositiveNumber), HasSubstr("must be > 0, found 0"));
  EXPECT_THAT(error("-2.5", &YamlNode::PositiveNumber), HasSubstr("found -2.5"));
  EXPECT_THAT(error("-1", &YamlNode::NonNegativeNumber), HasSubstr("must be >= 0, found -1"));
  EXPECT_EQ(error("0", &YamlNode::NonNegativeNumber), "(no error)");
  EXPECT_EQ(error("1.1e-30", &YamlNode::PositiveNumber), "(no error)");
}

TEST(YamlInteger, IsWholeAndInItsRange) {
  const auto read = [](const std::string& scalar) {
    return Parse("x: " + scalar).At("x").Integer(1, 10);
  };
  EXPECT_EQ(read("1"), 1);
  EXPECT_EQ(read("10"), 10);
  for (const char* text :
       {"0", "11", "3.0", "3.5", "1e0", "99999999999999", "a", "3 px", "[3]", "''"})
    EXPECT_THAT(ErrorOf([&] { read(text); }),
                AllOf(StartsWith("f.yaml:1:4: x: "), HasSubstr("whole number from 1 to 10")))
        << text;
}

TEST(YamlScalar, BooleanTextAndChoice) {
  EXPECT_TRUE(Parse("x: true").At("x").Boolean());
  EXPECT_FALSE(Parse("x: false").At("x").Boolean());
  EXPECT_THAT(ErrorOf([] { Parse("x: yes").At("x").Boolean(); }), HasSubstr("true, false"));
  EXPECT_EQ(Parse("x: a b").At("x").Text(), "a b");
  EXPECT_THAT(ErrorOf([] { Parse("x: ''").At("x").Text(); }), HasSubstr("text is expected"));
  EXPECT_THAT(ErrorOf([] { Parse("x: [a]").At("x").Text(); }), HasSubstr("found a list"));
  EXPECT_THAT(ErrorOf([] {
                Parse("x: up").At("x").OneOf({"away", "toward"});
              }),
              AllOf(HasSubstr("away, toward"), HasSubstr("'up'")));
}

TEST(YamlKeys, UnknownKeyGetsASuggestion) {
  const auto error = [](const std::string& text) {
    return ErrorOf([&] { Parse(text).RequireKeys({"aperture_radius_mm", "name"}); });
  };
  EXPECT_EQ(error("aperture_radius_mm: 1\nname: a"), "(no error)");
  EXPECT_EQ(error("name: a\naperture_raduis_mm: 1"),
            "f.yaml:2:1: unknown key 'aperture_raduis_mm'; did you mean 'aperture_radius_mm'?");
  EXPECT_THAT(error("something: 1"), HasSubstr("allowed here: aperture_radius_mm, name"));
}

TEST(YamlKeys, SuggestsTheOneNameThatEndsWithAKey) {
  const auto message_for = [](const std::string& key) {
    return ErrorOf([&] {
      Parse(key + ": 1")
          .RequireKeys({"optical_tube_length_mm", "working_distance_mm", "image_distance_mm"});
    });
  };
  EXPECT_EQ(message_for("tube_length_mm"),
            "f.yaml:1:1: unknown key 'tube_length_mm'; did you mean 'optical_tube_length_mm'?");
  EXPECT_EQ(message_for("distance_mm"),
            "f.yaml:1:1: unknown key 'distance_mm'; allowed here: optical_tube_length_mm, "
            "working_distance_mm, image_distance_mm");
}

TEST(YamlKeys, WrongUnitSuffixIsCalledSo) {
  for (const char* key : {"aperture_radius_um", "aperture_radius_cm", "aperture_radius_m",
                          "aperture_radius_px", "aperture_radius"})
    EXPECT_EQ(ErrorOf([&] { Parse(std::string(key) + ": 1").RequireKeys({"aperture_radius_mm"}); }),
              "f.yaml:1:1: unknown key '" + std::string(key) +
                  "'; wrong unit: this field is 'aperture_radius_mm'");
}

TEST(YamlKeys, DuplicateKeyIsRefusedAtTheSecond) {
  EXPECT_EQ(ErrorOf([] {
              Parse("a: 1\nb: 2\na: 3").RequireKeys({"a", "b"});
            }),
            "f.yaml:3:1: key 'a' is given twice");
  EXPECT_EQ(ErrorOf([] {
              Parse("{a: 1, a: 1}").RequireKeys({"a", "b"});
            }),
            "f.yaml:1:8: key 'a' is given twice");
}

TEST(YamlKeys, OfSomethingThatIsNoMap) {
  EXPECT_THAT(ErrorOf([] { Parse("[1, 2]").RequireKeys({"a"}); }), HasSubstr("a map is expected"));
  EXPECT_THAT(ErrorOf([] { Parse("? [a]\n: 1").RequireKeys({"a"}); }), HasSubstr("plain word"));
}

TEST(YamlSchema, MissingOtherOrNoMap) {
  const auto error = [](const std::string& text) {
    return ErrorOf([&] { Parse(text).RequireSchema("thicklens/camera/2"); });
  };
  EXPECT_EQ(error("schema: thicklens/camera/2"), "(no error)");
  EXPECT_THAT(error("name: a"), HasSubstr("'schema: thicklens/camera/2' is missing"));
  EXPECT_EQ(error("name: a\nschema: thicklens/sweep/1"),
            "f.yaml:2:9: schema: 'thicklens/camera/2' is expected, found 'thicklens/sweep/1'");
  EXPECT_THAT(error("schema:"), HasSubstr("is missing"));
  EXPECT_THAT(error("just text"), HasSubstr("found 'just text'"));
  EXPECT_THAT(error("# nothing\n"), HasSubstr("f.yaml"));
  EXPECT_THAT(error(""), HasSubstr("f.yaml: one YAML document is expected"));
  EXPECT_THAT(error("a: 1\n---\nb: 2"), HasSubstr("one YAML document is expected, found more"));
  // yaml-cpp would find documents without end here.
  EXPECT_THAT(error(","), HasSubstr("f.yaml:1:1: not valid YAML"));
  EXPECT_THAT(error("\n ]a: 1"), HasSubstr("f.yaml:2:2: not valid YAML"));
}

TEST(YamlPlace, LineAndColumnAreOnesOfTheValue) {
  const YamlNode root = Parse("lens:\n  # a comment\n  list: [1,  oops, 3]\n");
  const std::vector<YamlNode> list = root.At("lens").At("list").Elements();
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[1].path(), "lens.list[1]");
  EXPECT_THAT(ErrorOf([&] { list[1].Number(); }), StartsWith("f.yaml:3:14: lens.list[1]: "));
  EXPECT_THAT(
      ErrorOf([&] { root.At("lens").At("list").ElementsExactly(2); }),
      AllOf(StartsWith("f.yaml:3:9: lens.list: "), HasSubstr("a list of 2 is expected, found 3")));
  EXPECT_THAT(ErrorOf([&] { root.At("lens").At("absent"); }),
              AllOf(StartsWith("f.yaml:3:3: "), HasSubstr("lens: 'absent' is missing")));
}

TEST(YamlPlace, SyntaxErrorsToo) {
  EXPECT_THAT(ErrorOf([] { Parse("a: [1, 2\nb: 3\n"); }), StartsWith("f.yaml:2:"));
  EXPECT_THAT(ErrorOf([] { Parse("a: \"open"); }), StartsWith("f.yaml:1:"));
  EXPECT_THAT(ErrorOf([] { Parse(std::string(20000, '[')); }), StartsWith("f.yaml:1:"));
}

TEST(YamlNode, LookingForAKeyDoesNotMakeIt) {
  const YamlNode root = Parse("a: 1\nempty:\n");
  EXPECT_FALSE(root.Has("b"));
  EXPECT_FALSE(root.Find("b").has_value());
  EXPECT_FALSE(root.Has("empty"));
  EXPECT_EQ(ErrorOf([&] { root.RequireKeys({"a", "empty"}); }), "(no error)");
  EXPECT_THAT(ErrorOf([&] { root.At("a").Find("b"); }), HasSubstr("a map is expected, found '1'"));
}

TEST(YamlNode, PathsAreSeenFromTheFilesFolder) {
  const auto resolved = [](const std::string& source, const std::string& relative) {
    return YamlNode::Parse("a: 1", source).ResolvePath(relative);
  };
  EXPECT_EQ(resolved("dir/f.yaml", "x.png"), "dir/x.png");
  EXPECT_EQ(resolved("dir/sub/f.yaml", "../x.png"), "dir/x.png");
  EXPECT_EQ(resolved("f.yaml", "x.png"), "x.png");
  EXPECT_EQ(resolved("/a/f.yaml", "x.png"), "/a/x.png");
  EXPECT_EQ(resolved("dir/f.yaml", "/x.png"), "/x.png");
}

TEST(YamlNode, LoadsFilesAndNamesWhatIsMissing) {
  const TemporaryFolder folder;
  const std::string file = folder.Put("a.yaml", "x: 6 um\n");
  EXPECT_THAT(ErrorOf([&] { YamlNode::LoadFile(file).At("x").Number(); }),
              StartsWith(file + ":1:4: x: "));
  EXPECT_THAT(ErrorOf([&] { YamlNode::LoadFile(folder / "none.yaml"); }),
              AllOf(HasSubstr("none.yaml"), HasSubstr("No such file")));
  EXPECT_THAT(ErrorOf([&] { YamlNode::LoadFile(folder.path()); }), HasSubstr("is a folder"));
}

TEST(YamlNumber, WritesWhatReadsBackToTheSameBits) {
  using Limits = std::numeric_limits<double>;
  std::vector<double> values = {0.0,           -0.0,
                                1.0 / 3,       1e30,
                                -1e-300,       -1e30,
                                Limits::min(), Limits::denorm_min(),
                                0.1,           123456789012345680.0};
  std::mt19937_64 random(7);
  while (values.size() < 20000) {
    const std::uint64_t bits = random();
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    if (std::abs(value) <= 1e30) values.push_back(value);
  }
  std::string text = "x:\n";
  for (const double value : values) text += "- " + YamlNumber(value) + "\n";
  const std::vector<YamlNode> read = Parse(text).At("x").Elements();
  ASSERT_EQ(read.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double back = read[i].Number();
    ASSERT_EQ(std::memcmp(&back, &values[i], sizeof back), 0) << YamlNumber(values[i]);
  }
  EXPECT_EQ(YamlNumber(0.1), "0.1");
}

}  // namespace
}  // namespace thicklens
