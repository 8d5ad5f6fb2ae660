// The library that tools/io/array_library.h describes.
#include <exception>

#include "tools/io/arrays/arrays.h"
#include "tools/io/plugin.h"

namespace thicklens::io {
namespace {

void* OpenArrays(const std::string& path, ArrayFormat format, StoredFile* content,
                 std::string* why) {
  try {
    ArraySource* const source =
        format == ArrayFormat::kMat ? OpenMatArrays(path) : OpenHdfArrays(path);
    *content = source->Content();
    return source;
  } catch (const std::exception& error) {
    *why = error.what();
  } catch (...) {
    *why = "an exception of the library";
  }
  return nullptr;
}

bool ReadArray(void* file, const std::string& name, const PutBytes& put, std::string* why) {
  try {
    static_cast<ArraySource*>(file)->Read(name, put);
    return true;
  } catch (const std::exception& error) {
    *why = error.what();
  } catch (...) {
    *why = "an exception of the library";
  }
  return false;
}

}  // namespace
}  // namespace thicklens::io

THICKLENS_STATE_PLUGIN_IDENTITY()

extern "C" __attribute__((visibility("default"))) const void* ThicklensArrayLibrary() {
  static const thicklens::io::ArrayLibrary library{
      thicklens::io::PrepareHdf, thicklens::io::OpenArrays, thicklens::io::ReadArray};
  return &library;
}
