// Programs and libraries look for libraries in absolute folders or beside themselves, never in the
// current folder, which an empty entry means. The test checks the build tree, or the folder that
// THICKLENS_INSTALLED names (install_test.cmake).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "architecture/elf_bytes.h"

namespace thicklens::architecture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct SearchPaths {
  std::vector<std::string> lists;   // values of DT_RPATH and DT_RUNPATH
  std::vector<std::string> needed;  // values of DT_NEEDED
};

// Returns the search paths of a program or a shared library of this machine's kind, or nothing for
// any other file.
std::optional<SearchPaths> ReadSearchPaths(const std::string& bytes) {
  const auto header = HeaderOf(bytes);
  if (!header || (header->e_type != ET_EXEC && header->e_type != ET_DYN)) {
    return std::nullopt;
  }
  std::vector<Elf64_Phdr> segments;
  for (std::size_t i = 0; i < header->e_phnum; ++i) {
    const auto segment = At<Elf64_Phdr>(bytes, header->e_phoff + i * header->e_phentsize);
    if (segment) segments.push_back(*segment);
  }
  std::vector<Elf64_Dyn> entries;
  for (const Elf64_Phdr& segment : segments) {
    if (segment.p_type != PT_DYNAMIC) continue;
    for (std::size_t at = 0; at + sizeof(Elf64_Dyn) <= segment.p_filesz; at += sizeof(Elf64_Dyn)) {
      const auto entry = At<Elf64_Dyn>(bytes, segment.p_offset + at);
      if (!entry || entry->d_tag == DT_NULL) break;
      entries.push_back(*entry);
    }
  }
  std::size_t texts = bytes.size();
  for (const Elf64_Dyn& entry : entries) {
    if (entry.d_tag != DT_STRTAB) continue;
    for (const Elf64_Phdr& segment : segments) {
      if (segment.p_type == PT_LOAD && entry.d_un.d_ptr >= segment.p_vaddr &&
          entry.d_un.d_ptr - segment.p_vaddr < segment.p_filesz) {
        texts = segment.p_offset + (entry.d_un.d_ptr - segment.p_vaddr);
      }
    }
  }
  SearchPaths paths;
  for (const Elf64_Dyn& entry : entries) {
    if (entry.d_tag == DT_RPATH || entry.d_tag == DT_RUNPATH)
      paths.lists.push_back(TextAt(bytes, texts + entry.d_un.d_val));
    if (entry.d_tag == DT_NEEDED) paths.needed.push_back(TextAt(bytes, texts + entry.d_un.d_val));
  }
  return paths;
}

// Returns the entries and names that could be found in the current folder.
std::vector<std::string> Dubious(const SearchPaths& paths) {
  std::vector<std::string> dubious;
  for (const std::string& list : paths.lists) {
    std::istringstream entries(list + ":");
    for (std::string entry; std::getline(entries, entry, ':');) {
      if (entry.rfind('/', 0) != 0 && entry != "$ORIGIN" && entry.rfind("$ORIGIN/", 0) != 0)
        dubious.push_back("'" + entry + "' in '" + list + "'");
    }
  }
  for (const std::string& name : paths.needed) {
    if (name.find('/') != std::string::npos && name.front() != '/') dubious.push_back(name);
  }
  return dubious;
}

TEST(ElfSearchPaths, AreAbsoluteOrBesideTheProgram) {
  const char* const installed = std::getenv("THICKLENS_INSTALLED");
  const fs::path root = installed != nullptr
                            ? fs::path(installed)
                            : fs::path(THICKLENS_PROGRAM).parent_path().parent_path();
  int programs = 0, with_paths = 0;
  for (fs::recursive_directory_iterator entry(root), end; entry != end; ++entry) {
    if (entry->path().filename() == "CMakeFiles") entry.disable_recursion_pending();
    if (!entry->is_regular_file() || entry->is_symlink()) continue;
    if (entry->path().extension() == ".o" || entry->path().extension() == ".a") continue;
    const std::optional<SearchPaths> paths = ReadSearchPaths(BytesOf(entry->path()));
    if (!paths) continue;
    ++programs;
    if (!paths->lists.empty()) ++with_paths;
    EXPECT_THAT(Dubious(*paths), IsEmpty()) << entry->path();
  }
  // A build without GPL parts has no library of decoders for images.
  constexpr int kFiles = THICKLENS_HAS_IMAGE_LIBRARY ? 3 : 2;
  EXPECT_GE(programs, kFiles) << "the program and the libraries of decoders are in " << root;
  EXPECT_GE(with_paths, 1) << "the program finds that library by its search path";
}

TEST(ElfSearchPaths, AnEmptyEntryIsSeen) {
  EXPECT_THAT(Dubious({{"/a:/b", "$ORIGIN/../lib:$ORIGIN"}, {"libm.so.6"}}), IsEmpty());
  EXPECT_THAT(Dubious({{"/a:", "/a::/b", ":/a"}, {}}).size(), 3);
  EXPECT_THAT(Dubious({{"", "lib", "$ORIGINAL/lib", "./"}, {}}).size(), 4);
  EXPECT_THAT(Dubious({{}, {"./libm.so.6"}}), ElementsAre("./libm.so.6"));
}

}  // namespace
}  // namespace thicklens::architecture
