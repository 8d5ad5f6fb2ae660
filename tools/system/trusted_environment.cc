#include "tools/system/trusted_environment.h"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// Variables with one path each. If one is not set, the library uses its usual folder.
constexpr const char* kPaths[] = {
    "HOME",
    "TMPDIR",
    "TMP",
    "TEMP",
    "TEMPDIR",
    "XDG_CACHE_HOME",
    "XDG_CONFIG_HOME",
    "XDG_DATA_HOME",   // all
    "POCL_CACHE_DIR",  // PoCL: compiled kernels
    "OPENCV_OPENCL_CACHE_DIR",
    "OPENCV_TEMP_PATH",  // OpenCV
    "OPENSSL_CONF",
    "OPENSSL_MODULES",
    "OPENSSL_ENGINES",  // OpenSSL
    "FONTCONFIG_FILE",
    "FONTCONFIG_SYSROOT",  // fontconfig, of Cairo
    "GDAL_CONFIG_FILE",
    "GDAL_DATA",
    "PROJ_LIB",
    "PROJ_DATA"  // GDAL, of OpenCV
};
// Variables with lists of paths, separated by colons.
constexpr const char* kPathLists[] = {
    "XDG_CONFIG_DIRS",         "XDG_DATA_DIRS",      "FONTCONFIG_PATH",     "GDAL_DRIVER_PATH",
    "OPENCV_CORE_PLUGIN_PATH", "HWLOC_PLUGINS_PATH", "LIBHEIF_PLUGIN_PATH", "DCMDICTPATH"};
// Variables with a path, or with the name of a library that the system searches for in its folders.
constexpr const char* kPathsOrNames[] = {"OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "OPENCL_LAYERS",
                                         "OPENCV_OPENCL_RUNTIME"};

std::string ValueOf(const char* name) {
  const char* value = std::getenv(name);  // NOLINT: no other thread reads or sets it yet
  return value == nullptr ? "" : value;
}

bool IsRelative(const std::string& path) { return !path.empty() && path.front() != '/'; }

// A list of paths without the parts that are not absolute.
struct ListOfPaths {
  explicit ListOfPaths(const std::string& list) {
    std::istringstream parts(list);
    for (std::string part; std::getline(parts, part, ':');) {
      if (IsRelative(part)) relative.push_back(part);
      if (!part.empty() && !IsRelative(part)) absolute += (absolute.empty() ? "" : ":") + part;
    }
  }

  std::string absolute;
  std::vector<std::string> relative;
};

// A name counts as a path if the current folder has a file of that name.
bool IsFoundHere(const std::string& name) {
  std::error_code unreachable;
  return IsRelative(name) &&
         (name.find('/') != std::string::npos || fs::exists(name, unreachable) || unreachable);
}

void TakeOut(const char* name, std::vector<std::string>* reported) {
  reported->push_back(RelativePathIsIgnored(name, ValueOf(name)));
  ::unsetenv(name);
}

// An empty part, which a line such as X="$X:/opt/share" in a shell's start-up file leaves, means
// the current folder to some libraries. Nobody intends that, so it is removed without a warning.
void KeepAbsoluteParts(const char* name, std::vector<std::string>* reported) {
  const std::string value = ValueOf(name);
  const ListOfPaths list(value);
  for (const std::string& part : list.relative) {
    reported->push_back(
        fmt::format("{}: its part '{}' is ignored, because it would be looked for in the current "
                    "folder; an absolute path is expected",
                    name, PrintableUtf8(part)));
  }
  if (list.absolute.empty()) {
    ::unsetenv(name);
  } else if (list.absolute != value) {
    ::setenv(name, list.absolute.c_str(), 1);
  }
}

// PoCL loads the content of its cache as code.
void GivePoclAPrivateCache() {
  if (!ValueOf("POCL_CACHE_DIR").empty() || !ValueOf("XDG_CACHE_HOME").empty() ||
      !ValueOf("HOME").empty()) {
    return;
  }
  const passwd* user = ::getpwuid(::geteuid());  // NOLINT: no other thread asks yet
  const std::string home = user == nullptr || user->pw_dir == nullptr ? "" : user->pw_dir;
  std::error_code unreachable;
  const bool has_home = !home.empty() && !IsRelative(home) && fs::is_directory(home, unreachable);
  // In such a folder PoCL cannot create anything; it finds no device and reports that.
  const std::string cache = has_home ? home + "/.cache/pocl/kcache" : "/dev/null/no-home-folder";
  ::setenv("POCL_CACHE_DIR", cache.c_str(), 1);
}

}  // namespace

std::string RelativePathIsIgnored(const std::string& name, const std::string& value) {
  return fmt::format(
      "{} is ignored: an absolute path is expected, found '{}', which would be looked for in the "
      "current folder",
      name, PrintableUtf8(value));
}

std::vector<std::string> DistrustRelativePaths() {
  std::vector<std::string> reported;
  for (const char* name : kPaths) {
    if (IsRelative(ValueOf(name))) TakeOut(name, &reported);
  }
  for (const char* name : kPathLists) {
    KeepAbsoluteParts(name, &reported);
  }
  for (const char* name : kPathsOrNames) {
    std::istringstream parts(ValueOf(name));
    bool is_found_here = false;
    for (std::string part; std::getline(parts, part, ':');)
      is_found_here = is_found_here || IsFoundHere(part);
    if (is_found_here) TakeOut(name, &reported);
  }
  GivePoclAPrivateCache();
  return reported;
}

}  // namespace thicklens::tools
