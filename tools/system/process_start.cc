// Prepares what must be in order before the program begins. The first part runs before any library
// is initialised, so this file is part of the program itself and not of its library.
#include "tools/system/process_start.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include "thicklens/base/error.h"
#include "tools/system/sanitized.h"

// OpenBLAS starts a thread for each processor when it is loaded, before main() and although the
// program lets it use only one. If memory is short, such a thread tries to allocate for ever and a
// fork waits for its end; if no memory is left, OpenBLAS ends the program. This is OpenBLAS's own
// function that returns the value of OPENBLAS_NUM_THREADS; the program's version of it is found
// first.
extern "C" __attribute__((visibility("default"))) int openblas_num_threads_env();
extern "C" int openblas_num_threads_env() { return 1; }

namespace thicklens::tools {
namespace {

#if defined(__ELF__) && defined(__GLIBC__) && !defined(THICKLENS_IS_SANITIZED)

// No function of a library may be called here.
bool BeginsWith(const char* text, const char* start) {
  while (*start != '\0' && *text == *start) {
    ++text;
    ++start;
  }
  return *start == '\0';
}

// Compiled kernels are code. A relative path would take them from the current folder, which anybody
// may have filled, and the standard for these folders requires that relative paths are ignored.
constexpr int kFolderCount = 2;
constexpr const char* kFolders[kFolderCount] = {"XDG_CACHE_HOME=", "POCL_CACHE_DIR="};
const char* forgotten_folders[kFolderCount] = {};  // their values; the text itself remains

bool IsRelativeCache(const char* variable) {
  for (int i = 0; i < kFolderCount; ++i) {
    if (!BeginsWith(variable, kFolders[i])) continue;
    while (*variable != '=') ++variable;
    if (variable[1] == '\0' || variable[1] == '/') return false;
    forgotten_folders[i] = variable + 1;
    return true;
  }
  return false;
}

// Variables in the environment can make OpenCV end a program before its main() runs, if it cannot
// read the value (OPENCV_DUMP_ERRORS=abc), or write files into the current folder (OPENCV_TRACE=1).
// OpenImageIO loads decoders from the folders of OIIO_LIBRARY_PATH and takes limits and numbers of
// threads from OPENIMAGEIO_OPTIONS. None of these variables is a setting of thicklens.
bool IsSettingToForget(const char* variable) {
  return IsRelativeCache(variable) || BeginsWith(variable, "OPENCV_") ||
         BeginsWith(variable, "OPENIMAGEIO_") || BeginsWith(variable, "OIIO_");
}

void ForgetSettings(int /*argc*/, char** /*argv*/, char** environment) {
  char** kept = environment;
  for (char** variable = environment; *variable != nullptr; ++variable) {
    if (!IsSettingToForget(*variable)) *kept++ = *variable;
  }
  *kept = nullptr;
}

__attribute__((section(".preinit_array"),
               used)) void (*const forget_settings)(int, char**, char**) = ForgetSettings;

#endif

}  // namespace

std::vector<std::pair<std::string, std::string>> ForgottenCaches() {
  std::vector<std::pair<std::string, std::string>> caches;
#if defined(__ELF__) && defined(__GLIBC__) && !defined(THICKLENS_IS_SANITIZED)
  for (int i = 0; i < kFolderCount; ++i) {
    if (forgotten_folders[i] == nullptr) continue;
    const std::string name = kFolders[i];
    caches.emplace_back(name.substr(0, name.size() - 1), forgotten_folders[i]);
  }
#endif
  return caches;
}

void RequireStack() {
  constexpr rlim_t kNeededKib = 512;  // a calibration fails with 128 and works with 256
  rlimit limit{};
  if (::getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY ||
      limit.rlim_cur >= kNeededKib * 1024) {
    return;
  }
  throw Error(fmt::format("ulimit -s: the stack is limited to {} KiB; at least {} KiB are needed",
                          limit.rlim_cur / 1024, kNeededKib));
}

}  // namespace thicklens::tools
