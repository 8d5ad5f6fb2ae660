#ifndef THICKLENS_TOOLS_PICTURE_KIND_H_
#define THICKLENS_TOOLS_PICTURE_KIND_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

namespace thicklens::tools {

// The kinds of picture files that are read. OpenCV would take many more, by libraries that nobody
// here has looked at.
enum class PictureKind { kPng, kJpeg, kTiff, kExr, kBmp, kPnm };

// By the first bytes; absent: another kind.
std::optional<PictureKind> KindOfPicture(const std::string& bytes);

// Decoders take memory by the size that a header states. Throws Error that begins with `name` where
// so few bytes cannot hold it, by what the kind's compression does at most; a header that cannot be
// understood passes, for the decoder to say so.
void RequirePossibleSize(const std::string& bytes, PictureKind kind, const std::string& name);

// The picture in the bytes of a file, unchanged and never turned, red first. Empty if it is of no
// such kind or cannot be decoded; `why` then says what is known, or nothing. Throws Error that
// begins with `name` for PNG files that are not whole and for impossible sizes.
cv::Mat DecodeUnchanged(const std::string& bytes, const std::string& name,
                        const std::vector<PictureKind>& kinds, std::string* why);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PICTURE_KIND_H_
