// The kernel reports that the heap uses huge pages.
#include "tools/system/program_memory.h"

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "support/sanitizers.h"

namespace thicklens::tools {
namespace {

constexpr std::size_t kMib = std::size_t{1} << 20;

// The flags of the mapping that contains the address, from the kernel's list.
std::string FlagsOfMappingAt(const void* place) {
  const auto at = reinterpret_cast<std::uintptr_t>(place);
  std::ifstream file("/proc/self/smaps");
  bool holds = false;
  for (std::string line; std::getline(file, line);) {
    std::uintmax_t from = 0, to = 0;
    if (std::sscanf(line.c_str(), "%jx-%jx ", &from, &to) == 2) holds = from <= at && at < to;
    if (holds && line.rfind("VmFlags:", 0) == 0) return line + " ";
  }
  return "";
}

class ProgramMemory : public ::testing::Test {
 protected:
  void SetUp() override {
    if (thicklens::testing::kIsSanitized) GTEST_SKIP() << "a sanitizer has a malloc of its own";
#ifndef __GLIBC__
    GTEST_SKIP() << "not glibc";
#endif
    if (!std::filesystem::exists("/sys/kernel/mm/transparent_hugepage/enabled")) {
      GTEST_SKIP() << "this system has no huge pages to give";
    }
    KeepFreedMemory();
  }

  // Expects huge pages except at the front of the heap, which existed before.
  static void ExpectHugePages(std::size_t bytes) {
    const auto piece = std::make_unique<char[]>(bytes);
    for (const std::size_t at : {kMib, bytes / 2, bytes - 1}) {
      EXPECT_NE(FlagsOfMappingAt(piece.get() + at).find(" hg "), std::string::npos) << at;
    }
  }
};

TEST_F(ProgramMemory, IsAskedForInHugePages) {
  ExpectHugePages(48 * kMib);   // of the heap
  ExpectHugePages(4 * kMib);    // in the rest of the heap
  ExpectHugePages(100 * kMib);  // on its own
}

// The piece that makes the heap grow again is the first that is taken after it shrank.
TEST_F(ProgramMemory, IsAskedForAgainAfterItWentBack) {
  std::vector<std::unique_ptr<char[]>> pieces;
  for (int i = 0; i < 3; ++i) pieces.push_back(std::make_unique<char[]>(60 * kMib));
  pieces.pop_back();
  void* const before = ::sbrk(0);
  ASSERT_EQ(malloc_trim(0), 1);
  ASSERT_LT(::sbrk(0), before);
  ExpectHugePages(60 * kMib);
}

TEST(ProgramMemoryLimits, NothingAndTooMuchAreWhatTheyAreElsewhere) {
  if (thicklens::testing::kIsSanitized) GTEST_SKIP() << "a sanitizer ends the program";
  void* const nothing = ::operator new(0);
  EXPECT_NE(nothing, nullptr);
  ::operator delete(nothing);
  const std::size_t too_much = std::numeric_limits<std::size_t>::max() / 2;
  EXPECT_THROW(::operator delete(::operator new(too_much)), std::bad_alloc);
  EXPECT_EQ(::operator new(too_much, std::nothrow), nullptr);
}

}  // namespace
}  // namespace thicklens::tools
