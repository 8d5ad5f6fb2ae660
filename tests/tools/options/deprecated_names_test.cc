#include "tools/options/deprecated_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "tools/report/estimate_records.h"
#include "tools/stress/stress_case.h"
#include "tools/stress/stress_suite.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Optional;
using thicklens::testing::ContentOf;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

std::vector<DeprecatedName> NamesOfKind(NameKind kind) {
  std::vector<DeprecatedName> names;
  for (const DeprecatedName& name : DeprecatedNames()) {
    if (name.kind == kind) names.push_back(name);
  }
  return names;
}

// The text with each run of white space as one space.
std::string OnOneLine(const std::string& text) {
  std::string line;
  for (const char letter : text) {
    const bool is_space = letter == ' ' || letter == '\n';
    if (!is_space) line += letter;
    if (is_space && !line.empty() && line.back() != ' ') line += ' ';
  }
  return line;
}

std::string SectionOf(const std::string& file, const std::string& heading) {
  const std::string text = ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/" + file);
  const std::size_t begin = text.find("\n" + heading + "\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find("\n#", begin + heading.size()) - begin);
}

std::string KindText(NameKind kind) {
  switch (kind) {
    case NameKind::kCommand:
      return "command";
    case NameKind::kOption:
      return "option";
    case NameKind::kValue:
      return "value";
    case NameKind::kHardCase:
      return "hard case";
    case NameKind::kYaml:
      return "YAML";
    case NameKind::kJson:
      return "JSON key";
    case NameKind::kColumn:
      break;
  }
  return "column";
}

TEST(DeprecatedNamesTest, EachIsInTheDocumentationAndTheChangelog) {
  const std::string formats = SectionOf("docs/file-formats.md", "## Deprecated names");
  const std::string changes = OnOneLine(SectionOf("CHANGELOG.md", "#### Deprecated names"));
  for (const DeprecatedName& name : DeprecatedNames()) {
    EXPECT_THAT(formats, HasSubstr("\n| `" + name.now + "` | `" + name.former + "` | " +
                                   KindText(name.kind) + " | " + name.where + " |\n"));
    EXPECT_THAT(changes, HasSubstr("`" + name.now + "` was `" + name.former + "`"));
  }
  const auto rows = std::count(formats.begin(), formats.end(), '\n');
  const auto text = formats.find("\n| name |");
  ASSERT_NE(text, std::string::npos);
  const auto before =
      std::count(formats.begin(), formats.begin() + static_cast<std::ptrdiff_t>(text), '\n');
  // Besides the rows there are the heading of the table and the line below it.
  EXPECT_EQ(rows - before - 3, static_cast<std::ptrdiff_t>(DeprecatedNames().size()));
}

TEST(DeprecatedNamesTest, OfHardCasesLeadToCasesThatExist) {
  const std::vector<StressCase> cases = AllStressCases();
  for (const DeprecatedName& name : NamesOfKind(NameKind::kHardCase)) {
    EXPECT_EQ(PresentName(NameKind::kHardCase, name.former), name.now);
    const auto exists = [&cases](const std::string& wanted) {
      return std::any_of(cases.begin(), cases.end(),
                         [&wanted](const StressCase& hard) { return hard.name == wanted; });
    };
    EXPECT_TRUE(exists(name.now)) << name.now;
    EXPECT_FALSE(exists(name.former)) << name.former;
  }
  EXPECT_EQ(PresentName(NameKind::kHardCase, "estimator"), "estimator");
}

TEST(DeprecatedKeys, AreWrittenBesideThePresentOnes) {
  for (const DeprecatedName& name : NamesOfKind(NameKind::kJson)) {
    SCOPED_TRACE(name.former);
    const json value = {{"of", {1, 2.5, "text"}}};
    json object = {{name.now, value}, {"unrelated", true}};
    if (!name.beside.empty()) object[name.beside] = 1;
    json written = {{"list", {1, object}}};
    AddDeprecatedKeys(&written);
    EXPECT_EQ(written["list"][1][name.former], value);
    EXPECT_EQ(written["list"][1][name.now], value);
    EXPECT_EQ(written["list"][1]["unrelated"], true);
    EXPECT_FALSE(written.contains(name.former));
  }
}

// `image` of a frame is the name of its file, and `estimator` may be many things.
TEST(DeprecatedKeys, WithAnotherMeaningElsewhereAreWrittenWhereTheyWereRenamed) {
  for (const DeprecatedName& name : NamesOfKind(NameKind::kJson)) {
    if (name.beside.empty()) continue;
    json written = {{name.now, "a.png"}, {"reading_mm", 3}};
    const json as_before = written;
    AddDeprecatedKeys(&written);
    EXPECT_EQ(written, as_before);
    json read = {{name.former, "a.png"}, {"reading_mm", 3}};
    AcceptDeprecatedKeys("f.json", &read);
    EXPECT_TRUE(read.contains(name.former));
  }
}

TEST(DeprecatedKeys, OfAnObjectContainThoseInsideIt) {
  json written = json::parse(
      R"({"ablation": {"effects": [{"image": {"psnr_db": 30}, "image_seconds": 0.5}]}})");
  AddDeprecatedKeys(&written);
  EXPECT_EQ(written["attribution"], written["ablation"]);
  const json& effect = written["attribution"]["effects"][0];
  EXPECT_EQ(effect["picture"]["psnr_db"], 30);
  EXPECT_EQ(effect["picture_seconds"], 0.5);
}

TEST(DeprecatedKeys, AreInTheSummaryOfACommand) {
  const TemporaryFolder folder;
  CommonOptions options;
  options.json_path = folder / "summary.json";
  RunCommand(options, [] {
    return CommandResult{{{"status", "ok"}, {"occluded_fraction", 0.25}}, "", true};
  });
  const json written = json::parse(ContentOf(options.json_path));
  EXPECT_EQ(written, (json{{"status", "ok"}, {"occluded_fraction", 0.25}, {"hidden_share", 0.25}}));
}

TEST(DeprecatedKeys, AreReadAsThePresentOnes) {
  for (const DeprecatedName& name : NamesOfKind(NameKind::kJson)) {
    SCOPED_TRACE(name.former);
    json object = {{name.former, 7}};
    if (!name.beside.empty()) object[name.beside] = 1;
    json read = {{"list", json::array({object})}};
    AcceptDeprecatedKeys("f.json", &read);
    EXPECT_EQ(read["list"][0][name.now], 7);
    EXPECT_FALSE(read["list"][0].contains(name.former));
    // Both names, as the program writes them.
    AddDeprecatedKeys(&read);
    AcceptDeprecatedKeys("f.json", &read);
    EXPECT_EQ(read["list"][0][name.now], 7);
    read["list"][0][name.former] = 8;
    EXPECT_THAT(ErrorOf([&] { AcceptDeprecatedKeys("f.json", &read); }),
                AllOf(HasSubstr("f.json: "), HasSubstr("'" + name.now + "'"),
                      HasSubstr("'" + name.former + "'")));
  }
}

TEST(DeprecatedKeys, MayBeNestedDeeply) {
  json read = 1;
  for (int i = 0; i < 100000; ++i) {
    json outer = json::array();
    outer.push_back(std::move(read));
    read = std::move(outer);
  }
  AcceptDeprecatedKeys("f.json", &read);
  AddDeprecatedKeys(&read);
  EXPECT_EQ(read.size(), 1U);
}

TEST(DeprecatedKeys, OfAnEstimateAreRead) {
  const std::string former = R"({"solver": "scene", "views": [3, 3], "size": [64, 48],
                                 "hidden_share": 0.125})";
  EXPECT_THAT(ParseEstimateRecord(former, "e.json").occluded_fraction, Optional(0.125));
  const std::string path = "/tests/fuzz/corpus/estimate-json/valid-scene.json";
  EXPECT_THAT(ReadEstimateRecord(THICKLENS_SOURCE_DIR + path).occluded_fraction,
              Optional(0.1336866357596591));
}

}  // namespace
}  // namespace thicklens::tools
