#include "opencv_codecs.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

// Beside the program, or where it is installed: the program's own search path says where.
constexpr char kLibrary[] = THICKLENS_OPENCV_CODECS;
constexpr char kEntry[] = "ThicklensOpenCvCodecs";

const OpenCvCodecs* Load() {
  // Never closed: what OpenCV brings along is not made to be unloaded.
  void* const library = dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
  using Entry = const OpenCvCodecs* (*)();
  const auto entry = library == nullptr ? nullptr : reinterpret_cast<Entry>(dlsym(library, kEntry));
  if (entry != nullptr) return entry();
  const char* const why = dlerror();
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

}  // namespace thicklens::tools
