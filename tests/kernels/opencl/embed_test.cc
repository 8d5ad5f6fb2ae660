#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <regex>
#include <set>
#include <string>

#include "kernels/opencl/opencl_device.h"
#include "support/temporary_folder.h"

namespace thicklens::kernels {
namespace {

namespace fs = std::filesystem;
using testing::ContentOf;
using testing::TemporaryFolder;

TEST(EmbeddedKernelFiles, AreTheFilesOfTheSourceTree) {
  std::set<std::string> embedded;
  for (const EmbeddedFile& file : EmbeddedKernelFiles()) {
    const std::string path = std::string(THICKLENS_SOURCE_DIR) + "/" + file.path;
    ASSERT_TRUE(fs::exists(path)) << path;
    EXPECT_FALSE(file.text.empty()) << path;
    EXPECT_EQ(file.text, ContentOf(path)) << path;
    embedded.insert(file.path);
  }
  std::set<std::string> there;
  for (const auto& entry :
       fs::directory_iterator(std::string(THICKLENS_SOURCE_DIR) + "/kernels/opencl")) {
    if (entry.path().extension() == ".cl") {
      there.insert("kernels/opencl/" + entry.path().filename().string());
    }
  }
  EXPECT_EQ(embedded, there);
}

// Returns the bytes that a C++ compiler would read in the array `name`, without the 0 at the end.
std::string BytesOf(const std::string& source, const std::string& name) {
  const std::size_t begin = source.find('{', source.find("char " + name + "[]"));
  const std::string list = source.substr(begin, source.find('}', begin) - begin);
  const std::regex number("0x([0-9a-f]{2}),");
  std::string bytes;
  for (std::sregex_iterator i(list.begin(), list.end(), number), end; i != end; ++i) {
    bytes += static_cast<char>(std::stoi((*i)[1], nullptr, 16));
  }
  return bytes;
}

TEST(EmbedKernels, KeepsEveryByte) {
  std::string nasty = "a\"b\\n';[x];${y}@z@ /* \xc3\xa9 \xff\xfe */\r\n\t;;\n#define \\\n  )\"";
  nasty += std::string("\0\x01\x1a", 3);
  std::string every_byte;
  for (int i = 0; i < 40000; ++i) every_byte += static_cast<char>((i * 7 + i / 256) % 256);
  const TemporaryFolder folder;
  const std::string first = folder.Put("src/nasty.cl", nasty);
  const std::string second = folder.Put("src/empty.cl", "");
  const std::string third = folder.Put("long.cl", every_byte);
  const std::string command = "cmake '-Droot=" + folder.path() + "' '-Dfiles=" + first + ";" +
                              second + ";" + third + "' '-Doutput=" + folder / "made.cc" +
                              "' -P '" THICKLENS_SOURCE_DIR "/kernels/embed.cmake'";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const std::string made = ContentOf(folder / "made.cc");
  EXPECT_EQ(BytesOf(made, "kFile0"), nasty);
  EXPECT_EQ(BytesOf(made, "kFile1"), "");
  EXPECT_EQ(BytesOf(made, "kFile2"), every_byte);
  for (const auto& [path, size] :
       {std::pair<std::string, std::size_t>{"src/nasty.cl", nasty.size()},
        {"src/empty.cl", 0},
        {"long.cl", every_byte.size()}}) {
    EXPECT_NE(made.find("\"" + path + "\""), std::string::npos);
    EXPECT_NE(made.find(", " + std::to_string(size) + "}}"), std::string::npos) << size;
  }
}

}  // namespace
}  // namespace thicklens::kernels
