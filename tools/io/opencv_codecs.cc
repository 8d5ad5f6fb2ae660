#include "tools/io/opencv_codecs.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr char kLibrary[] = THICKLENS_OPENCV_CODECS;
constexpr char kEntry[] = "ThicklensOpenCvCodecs";

// Beside the program, or where it is installed: the program's own search path says where. Only its
// absolute folders count, lest a library of this name in the current folder is taken. Empty: in
// none of them.
std::string LibraryPath() {
  void* const program = dlopen(nullptr, RTLD_LAZY);
  if (program == nullptr) return "";
  Dl_serinfo size{};
  std::string found;
  if (dlinfo(program, RTLD_DI_SERINFOSIZE, &size) == 0) {
    // Its length is known when it runs: the array at its end is longer than the type says.
    std::vector<std::max_align_t> room(size.dls_size / sizeof(std::max_align_t) + 1);
    auto* const paths = reinterpret_cast<Dl_serinfo*>(room.data());  // NOLINT: as dlinfo has it
    *paths = size;
    if (dlinfo(program, RTLD_DI_SERINFOSIZE, paths) == 0 &&
        dlinfo(program, RTLD_DI_SERINFO, paths) == 0) {
      for (unsigned i = 0; i < paths->dls_cnt && found.empty(); ++i) {
        const std::filesystem::path folder = (&paths->dls_serpath[0] + i)->dls_name;
        std::error_code ignored;
        if (folder.is_absolute() && std::filesystem::is_regular_file(folder / kLibrary, ignored))
          found = (folder / kLibrary).string();
      }
    }
  }
  dlclose(program);
  return found;
}

const OpenCvCodecs* Load() {
  // Never closed: what OpenCV brings along is not made to be unloaded.
  const std::string path = LibraryPath();
  void* const library = path.empty() ? nullptr : dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  using Entry = const OpenCvCodecs* (*)();
  const auto entry = library == nullptr ? nullptr : reinterpret_cast<Entry>(dlsym(library, kEntry));
  if (entry != nullptr) return entry();
  const char* const why = path.empty() ? "it is in no folder of the search path" : dlerror();
  throw Error(
      fmt::format("what reads JPEG, TIFF, EXR, BMP and PNM files and writes JPEG, {}, cannot be "
                  "loaded{}{}: is it where thicklens was built or installed?",
                  kLibrary, why == nullptr ? "" : ": ", why == nullptr ? "" : why));
}

}  // namespace

const OpenCvCodecs& LoadedOpenCvCodecs() {
  static const OpenCvCodecs* const codecs = Load();
  return *codecs;
}

}  // namespace thicklens::io
