#include "tools/io/image_library.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/io/image_io.h"

namespace thicklens::io {

#ifdef THICKLENS_IMAGE_LIBRARY
namespace {

constexpr char kLibrary[] = THICKLENS_IMAGE_LIBRARY;
constexpr char kEntry[] = "ThicklensImageLibrary";

// Looks where the search path of the program or of a shared library states; null is no such object.
// Only absolute folders of that path are used, so that a library of this name in the current folder
// is never loaded. Returns an empty path if no folder has the library.
std::string PathBySearchPathOf(void* object) {
  if (object == nullptr) return "";
  Dl_serinfo size{};
  std::string found;
  if (dlinfo(object, RTLD_DI_SERINFOSIZE, &size) == 0) {
    // The length is known only at run time: the array at its end is longer than its type states.
    std::vector<std::max_align_t> room(size.dls_size / sizeof(std::max_align_t) + 1);
    auto* const paths = reinterpret_cast<Dl_serinfo*>(room.data());  // NOLINT: as dlinfo has it
    *paths = size;
    if (dlinfo(object, RTLD_DI_SERINFOSIZE, paths) == 0 &&
        dlinfo(object, RTLD_DI_SERINFO, paths) == 0) {
      for (unsigned i = 0; i < paths->dls_cnt && found.empty(); ++i) {
        const std::filesystem::path folder = (&paths->dls_serpath[0] + i)->dls_name;
        std::error_code ignored;
        if (folder.is_absolute() && std::filesystem::is_regular_file(folder / kLibrary, ignored))
          found = (folder / kLibrary).string();
      }
    }
  }
  dlclose(object);
  return found;
}

// Looks beside the program and where it is installed, and then likewise for the shared library that
// contains this function, whose programs need not know of the library.
std::string LibraryPath() {
  std::string found = PathBySearchPathOf(dlopen(nullptr, RTLD_LAZY));
  Dl_info here{};
  if (found.empty() && dladdr(&kLibrary, &here) != 0 && here.dli_fname != nullptr)
    found = PathBySearchPathOf(dlopen(here.dli_fname, RTLD_LAZY | RTLD_NOLOAD));
  return found;
}

const ImageLibrary* Load() {
  // The library is never closed: the libraries that OpenCV loads do not support unloading.
  const std::string path = LibraryPath();
  void* const library = path.empty() ? nullptr : dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  using Entry = const ImageLibrary* (*)();
  const auto entry = library == nullptr ? nullptr : reinterpret_cast<Entry>(dlsym(library, kEntry));
  if (entry != nullptr) return entry();
  const char* const why = path.empty() ? "it is in no folder of the search path" : dlerror();
  throw Error(fmt::format(
      "the library that reads and writes EXR, WebP and BMP files and reads HEIF, DICOM and "
      "raw "
      "files, {}, cannot be loaded{}{}: it must be in the build folder or where thicklens was "
      "installed",
      kLibrary, why == nullptr ? "" : ": ", why == nullptr ? "" : why));
}

}  // namespace

const ImageLibrary& LoadedImageLibrary() {
  static const ImageLibrary* const library = Load();
  return *library;
}

bool HasImageLibrary() { return true; }
#else
const ImageLibrary& LoadedImageLibrary() {
  throw Error(
      "this build has no GPL parts (THICKLENS_WITH_GPL=OFF), and therefore not the library that "
      "reads this kind of file: it reads PNG, TIFF, JPEG, PFM and PNM");
}

bool HasImageLibrary() { return false; }
#endif

void RequireImageCodecs() {
  if (HasImageLibrary()) LoadedImageLibrary();
}

}  // namespace thicklens::io
