// Every reader of a file gets invalid files: the corpus of tests/fuzz, which `./dev fuzz` finds by
// searching for new paths through the code, and some random changes of each of its files.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "fuzz/readers.h"
#include "support/temporary_folder.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using thicklens::testing::FuzzedReader;
using thicklens::testing::FuzzedReaders;

// The name of a file that its reader must accept begins with this.
constexpr char kValid[] = "valid";

std::map<std::string, std::string> CorpusOf(const std::string& reader) {
  std::map<std::string, std::string> corpus;
  for (const auto& entry : fs::directory_iterator(fs::path(THICKLENS_SOURCE_DIR) / "tests" /
                                                  "fuzz" / "corpus" / reader)) {
    std::ifstream file(entry.path(), std::ios::binary);
    corpus[entry.path().filename().string()] = {std::istreambuf_iterator<char>(file), {}};
  }
  return corpus;
}

bool IsValid(const std::string& name) { return name.rfind(kValid, 0) == 0; }

class Mutations {
 public:
  explicit Mutations(unsigned seed) : engine_(seed) {}

  std::string Of(std::string bytes) {
    static const std::array<std::string, 12> kTokens = {"-1",
                                                        "0",
                                                        "1e308",
                                                        "-1e-320",
                                                        ".nan",
                                                        "99999999999999999999",
                                                        "{",
                                                        "[",
                                                        std::string(1, '\0'),
                                                        std::string(3000, '['),
                                                        "\xFF\xFE",
                                                        "*a"};
    for (std::size_t changes = 1 + Below(3); changes > 0; --changes) {
      const std::size_t begin = Below(bytes.size() + 1);
      const std::size_t length = std::min(Below(30), bytes.size() - begin);
      switch (Below(6)) {
        case 0:
          bytes.resize(begin);
          break;
        case 1:
          bytes.erase(begin, length);
          break;
        case 2:
          bytes.insert(begin, bytes.substr(begin, length));
          break;
        case 3:
          bytes.replace(begin, length, kTokens[Below(kTokens.size())]);
          break;
        default:
          if (begin < bytes.size()) bytes[begin] = static_cast<char>(Below(256));
      }
    }
    return bytes;
  }

 private:
  std::size_t Below(std::size_t limit) {
    return std::uniform_int_distribution<std::size_t>(0, limit - 1)(engine_);
  }

  std::mt19937 engine_;
};

// Returns the bytes as a C++ string for the message of a failed test.
std::string Shown(const std::string& bytes) {
  constexpr std::size_t kMax = 600;
  return ::testing::PrintToString(bytes.substr(0, kMax)) +
         (bytes.size() > kMax ? " and " + std::to_string(bytes.size() - kMax) + " more" : "");
}

class HostileInput : public ::testing::TestWithParam<FuzzedReader> {
 protected:
  HostileInput() { thicklens::testing::PrepareFuzzFolder(folder_); }

  // Returns the message of the reader, which may throw nothing except an Error.
  std::string RefusalOf(const std::string& bytes, const std::string& name) {
    try {
      return thicklens::testing::Refusal(GetParam(), bytes, folder_);
    } catch (const std::exception& error) {
      ADD_FAILURE() << name << ": " << error.what() << "\n" << Shown(bytes);
      return error.what();
    }
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_P(HostileInput, FilesOfTheCorpusAreReadOrRefused) {
  bool any_is_valid = false;
  for (const auto& [name, bytes] : CorpusOf(GetParam().name)) {
    const std::string refusal = RefusalOf(bytes, name);
    if (!IsValid(name)) continue;
    any_is_valid = true;
    EXPECT_EQ(refusal, "") << name;
  }
  EXPECT_TRUE(any_is_valid) << "the corpus has no file that can be read";
}

TEST_P(HostileInput, ChangedFilesAreReadOrRefused) {
  constexpr int kChanged = 150;
  Mutations mutations(7);
  int refused = 0;
  for (const auto& [name, bytes] : CorpusOf(GetParam().name)) {
    if (!IsValid(name)) continue;
    for (int i = 0; i < kChanged; ++i) {
      const std::string changed = mutations.Of(bytes);
      if (!RefusalOf(changed, name + " changed").empty()) ++refused;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(refused, kChanged / 20);
}

TEST_P(HostileInput, FilesThatEndTooEarlyAreReadOrRefused) {
  for (const auto& [name, bytes] : CorpusOf(GetParam().name)) {
    if (!IsValid(name)) continue;
    const std::size_t step = std::max<std::size_t>(1, bytes.size() / 60);
    for (std::size_t length = 0; length < bytes.size(); length += step) {
      RefusalOf(bytes.substr(0, length), name + " cut off");
      if (HasFailure()) return;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Of, HostileInput, ::testing::ValuesIn(FuzzedReaders()),
                         [](const ::testing::TestParamInfo<FuzzedReader>& reader) {
                           std::string name;
                           bool upper = true;
                           for (const char c : reader.param.name) {
                             if (c != '-') name += upper ? static_cast<char>(c - 32) : c;
                             upper = c == '-';
                           }
                           return name;
                         });

}  // namespace
}  // namespace thicklens::tools
