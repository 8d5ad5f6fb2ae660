#ifndef THICKLENS_TOOLS_IO_VIDEO_VIDEO_KIND_H_
#define THICKLENS_TOOLS_IO_VIDEO_VIDEO_KIND_H_

#include <optional>
#include <string>

#include "tools/io/video/video_decoder.h"

namespace thicklens::io {

// Finds the kind by the first bytes of a file (kVideoStart of them are enough); absent: it is no
// video. Streams without a container begin as an image (Motion JPEG) or hardly as anything, and
// also need the ending of their name.
std::optional<VideoKind> KindOfVideo(const std::string& start, const std::string& path);
constexpr int kVideoStart = 4096;

// Throws Error that begins with `path` if the container states to be longer than the file, or has
// no index because its recording was not finished.
void RequireWholeVideo(const std::string& path, VideoKind kind);
// Whether the file may end in the middle of a frame although nothing in it states its length:
// MPEG-TS whose last packet is not filled up, as it is behind nearly all frames.
bool MayBeCut(const std::string& path, VideoKind kind);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_VIDEO_VIDEO_KIND_H_
