#include "tools/io/plugin.h"

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

// An address in the library that contains this file.
constexpr char kHere = 0;

// Looks where the search path of the program or of a shared library states; null is no such object.
// Only absolute folders of that path are used, so that a library of this name in the current folder
// is never loaded. Returns an empty path if no folder has the library.
std::string PathBySearchPathOf(void* object, const std::string& file) {
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
        if (folder.is_absolute() && std::filesystem::is_regular_file(folder / file, ignored))
          found = (folder / file).string();
      }
    }
  }
  dlclose(object);
  return found;
}

// Looks beside the program and where it is installed, and then likewise for the shared library that
// contains this function, whose programs need not know of the library.
std::string LibraryPath(const std::string& file) {
  std::string found = PathBySearchPathOf(dlopen(nullptr, RTLD_LAZY), file);
  Dl_info here{};
  if (found.empty() && dladdr(&kHere, &here) != 0 && here.dli_fname != nullptr)
    found = PathBySearchPathOf(dlopen(here.dli_fname, RTLD_LAZY | RTLD_NOLOAD), file);
  return found;
}

}  // namespace

const void* LoadPluginAt(const std::string& path, const Plugin& plugin) {
  // The library is never closed: the libraries that OpenCV loads do not support unloading.
  void* const library = path.empty() ? nullptr : dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  using Entry = const void* (*)();
  using Identity = const char* (*)();
  const auto entry =
      library == nullptr ? nullptr : reinterpret_cast<Entry>(dlsym(library, plugin.entry));
  if (entry == nullptr) {
    const char* const why = path.empty() ? "it is in no folder of the search path" : dlerror();
    throw Error(fmt::format(
        "the library that {}, {}, cannot be loaded{}{}: it must be in the build folder "
        "or where thicklens was installed",
        plugin.purpose, plugin.file, why == nullptr ? "" : ": ", why == nullptr ? "" : why));
  }
  const auto identity = reinterpret_cast<Identity>(dlsym(library, "ThicklensPluginIdentity"));
  const std::string found = identity == nullptr ? "none" : identity();
  if (found != THICKLENS_PLUGIN_IDENTITY) {
    throw Error(fmt::format(
        "the library that {}, {}, belongs to another build of thicklens (its identity is {}, and "
        "{} is needed): build or install the program and its libraries again, together",
        plugin.purpose, path, found, THICKLENS_PLUGIN_IDENTITY));
  }
  return entry();
}

const void* LoadPlugin(const Plugin& plugin) {
  return LoadPluginAt(LibraryPath(plugin.file), plugin);
}

}  // namespace thicklens::io
