#ifndef THICKLENS_TOOLS_IO_IMAGE_FILE_KIND_H_
#define THICKLENS_TOOLS_IO_IMAGE_FILE_KIND_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

namespace thicklens::io {

// The kinds of image files that are read. OpenCV would accept many more, through libraries that
// nobody in this project has reviewed.
enum class ImageFileKind { kPng, kJpeg, kTiff, kExr, kBmp, kPnm };

// Finds the kind by the first bytes; absent: another kind.
std::optional<ImageFileKind> KindOfImage(const std::string& bytes);

// Decoders allocate memory by the size that a header states. Throws Error that begins with `name`
// if so few bytes cannot hold that size at the kind's maximum compression. A header that cannot be
// parsed passes; the decoder reports it.
void RequirePossibleSize(const std::string& bytes, ImageFileKind kind, const std::string& name);

// Decodes the image in the bytes of a file, unchanged and never rotated, red first. Empty if it is
// of none of the kinds or cannot be decoded; `why` then gets the reason if it is known. Throws
// Error that begins with `name` for incomplete PNG files and for impossible sizes.
cv::Mat DecodeUnchanged(const std::string& bytes, const std::string& name,
                        const std::vector<ImageFileKind>& kinds, std::string* why);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_IMAGE_FILE_KIND_H_
