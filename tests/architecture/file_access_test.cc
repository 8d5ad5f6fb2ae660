// Inputs are read and outputs are written in one place (input_file.h and output_file.h of
// model/base), which checks what exists under the name. A source that opens files in another way
// must be listed here.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <istream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

namespace thicklens {
namespace {

namespace fs = std::filesystem;

const std::regex& WaysToOpenAFile() {
  static const std::regex ways(
      R"(\bstd::[io]?fstream\b|\bfopen\s*\(|(^|[^\w])::open(at)?\s*\(|\bcreat\s*\(|\bim(read|write)\s*\()"
      R"(|\bTIFF(Fd)?Open\w*\s*\(|ImageFactory::open\(\s*\w*path|\bcairo_\w+_surface_create\s*\(\s*\w*path)",
      std::regex::ECMAScript | std::regex::multiline);
  return ways;
}

// Sources that may open files, each with the reason.
const std::set<std::string>& Known() {
  static const std::set<std::string> known = {
      "model/base/input_file.cc",               // the reader
      "model/base/output_file.cc",              // the writers
      "model/base/output_folder.cc",            //
      "model/base/output_part.cc",              //
      "model/base/output_target.cc",            //
      "tools/io/journal_file.cc",               // grows during a run
      "tools/report/report_folder.cc",          // the head of an output: reading reports an input
      "tools/io/plain_tiff.cc",                 // writes a file in an output folder
      "tools/io/array_file.cc",                 // the first bytes of an input; /proc
      "tools/io/frame_files.cc",                // digests of videos, which may exceed the memory
      "tools/io/video/video_file.cc",           // the first bytes of an input
      "tools/io/video/video_kind.cc",           // parts of an input that may exceed the memory
      "tools/io/tiff_pixels.cc",                // libtiff reads and writes in memory
      "tools/system/standard_descriptors.cc",   // the null device
      "kernels/opencl/isolated_subprocess.cc",  // the null device
      "model/base/run_cost.cc",                 // files of /proc
      "tools/system/machine.cc",                //
      "tools/io/block_checkpoint.cc",           //
      "model/base/memory_available.cc",         //
      "tools/system/peak_memory.cc"};           //
  return known;
}

// Regular expressions are slow, and most lines contain none of these words.
bool MayOpenAFile(const std::string& line) {
  for (const char* word : {"fstream", "fopen", "::open", "creat", "imread", "imwrite", "TIFF",
                           "ImageFactory", "_surface_create"}) {
    if (line.find(word) != std::string::npos) return true;
  }
  return false;
}

// Returns the call by which a source opens files, or an empty string if there is none.
std::string WayToOpenAFile(std::istream* source) {
  for (std::string line; std::getline(*source, line);) {
    line.resize(std::min(line.size(), line.find("//")));
    std::smatch way;
    if (MayOpenAFile(line) && std::regex_search(line, way, WaysToOpenAFile())) return way.str();
  }
  return "";
}

TEST(FileAccess, IsInKnownPlacesAlone) {
  const fs::path root(THICKLENS_SOURCE_DIR);
  std::set<std::string> found;
  for (const char* module : {"model", "calib", "kernels", "estimator", "tools"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / module)) {
      const std::string ending = entry.path().extension().string();
      if (ending != ".cc" && ending != ".h") continue;
      std::ifstream file(entry.path());
      const std::string way = WayToOpenAFile(&file);
      if (way.empty()) continue;
      const std::string name = fs::relative(entry.path(), root).string();
      found.insert(name);
      EXPECT_EQ(Known().count(name), 1U)
          << name << " opens files by '" << way
          << "': ReadTextFile, ReadWholeFile, OutputFile or OutputFolder is expected";
    }
  }
  EXPECT_EQ(found, Known()) << "what opens no files any more is not to be known";
}

TEST(FileAccess, WaysAreSeen) {
  for (const char* line :
       {"std::ifstream file(path);", "std::fopen(path, \"r\")", "  const int fd = ::open(path, 0);",
        "cv::imread(path)", "TIFFOpen(path, \"w\")", "Exiv2::ImageFactory::open(path)"}) {
    std::istringstream source(line);
    EXPECT_NE(WayToOpenAFile(&source), "") << line;
  }
  for (const char* other :
       {"cv::Mat open(rows, columns, CV_32F)", "file.open();", "ImageFactory::open(bytes, size)",
        "OpenBackend(request)", "// std::ifstream"}) {
    std::istringstream source(other);
    EXPECT_EQ(WayToOpenAFile(&source), "") << other;
  }
}

}  // namespace
}  // namespace thicklens
