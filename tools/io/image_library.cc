#include "tools/io/image_library.h"

#include "thicklens/base/error.h"
#include "thicklens/io/image_io.h"
#include "tools/io/plugin.h"

namespace thicklens::io {

#ifdef THICKLENS_IMAGE_LIBRARY
const ImageLibrary& LoadedImageLibrary() {
  static const auto* const library = static_cast<const ImageLibrary*>(
      LoadPlugin({THICKLENS_IMAGE_LIBRARY, "ThicklensImageLibrary",
                  "reads and writes EXR, WebP and BMP files and reads HEIF, DICOM and raw files"}));
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
