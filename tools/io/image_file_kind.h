#ifndef THICKLENS_TOOLS_IO_IMAGE_FILE_KIND_H_
#define THICKLENS_TOOLS_IO_IMAGE_FILE_KIND_H_

#include <optional>
#include <string>

namespace thicklens::io {

// The kinds of image files that are read.
enum class ImageFileKind {
  kPng,
  kTiff,
  kPnm,
  kPfm,
  kJpeg,
  kExr,
  kWebp,
  kHeif,  // also AVIF
  kBmp,
  kDicom,
  kRaw
};

// Finds the kind by the contents, never by the name; absent: another kind. A TIFF file that
// contains the mosaic of a camera is kRaw.
std::optional<ImageFileKind> KindOfImage(const std::string& bytes);
// Names a kind that is not read ("GIF", "PSD"); empty if it is not known either.
std::string NameOfOtherKind(const std::string& bytes);
// Lists the kinds that are read: "PNG, TIFF, ... or raw".
std::string ReadableKinds();
std::string NameOf(ImageFileKind kind);

// Whether the file is compressed with losses: JPEG, and WebP with a chunk "VP8 ".
bool IsLossy(const std::string& bytes, ImageFileKind kind);

// Decoders allocate memory by the size that a header states. Throws Error that begins with `name`
// if so few bytes cannot hold that size at the kind's maximum compression. A header that cannot be
// parsed passes; the decoder reports it. Kinds whose size is found by their decoder pass as well.
void RequirePossibleSize(const std::string& bytes, ImageFileKind kind, const std::string& name);
// Throws Error that begins with `name` if an image that size needs more memory than there is.
void RequireMemory(double width_px, double height_px, double bytes_per_px, const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_IMAGE_FILE_KIND_H_
