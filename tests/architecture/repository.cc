#include "architecture/repository.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace thicklens::architecture {

namespace fs = std::filesystem;

std::string ContentOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.good()) << path;
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

RoomsTable RepositoryTable() {
  return RoomsTable::Parse(ContentOf(std::string(THICKLENS_SOURCE_DIR) + "/docs/rooms.txt"));
}

SourceTree ReadRepository(const std::vector<std::string>& modules) {
  SourceTree tree;
  const fs::path top = THICKLENS_SOURCE_DIR;
  for (const std::string& module : modules) {
    if (!fs::is_directory(top / module)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(top / module)) {
      const std::string path = fs::relative(entry.path(), top).generic_string();
      if (entry.is_regular_file() && IsSource(path)) tree[path] = ContentOf(entry.path().string());
    }
  }
  return tree;
}

}  // namespace thicklens::architecture
