#ifndef THICKLENS_TOOLS_IO_VIDEO_VIDEO_DECODER_H_
#define THICKLENS_TOOLS_IO_VIDEO_VIDEO_DECODER_H_

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "thicklens/io/image_file.h"

namespace thicklens::io {

// The containers of videos that are read.
enum class VideoKind {
  kIsoMedia,         // MP4, MOV, M4V, 3GP
  kMatroska,         // also WebM
  kAvi,              // RIFF
  kTransportStream,  // MPEG-TS
  kRawMjpeg,         // JPEG files one after the other, without time stamps
  kRawH264,          // without time stamps
  kRawHevc,          // without time stamps
};

// The facts about a decoded frame besides its pixels.
struct VideoStamp {
  bool has_stamp = false;      // whether the container states when it is shown
  std::int64_t stamp = 0;      // in the units of the stream; finds the frame again
  double time_s = 0;           // the same in seconds
  bool is_key = false;         // decoding can begin here
  bool is_damaged = false;     // its bits contradict the codec: the pixels are partly invented
  bool is_interlaced = false;  // its even and odd rows are of two times
  std::int64_t bytes = 0;      // of its compressed bits
  std::uint64_t digest = 0;    // hash of all its decoded values
};

// The frames of which the file has bits and the decoder gave no image, because they are damaged.
struct VideoLosses {
  std::vector<std::int64_t> stamps;  // of those that have one, as VideoStamp::stamp
  int without_stamp = 0;             // further ones
};

// The request that opens a video.
struct VideoOpening {
  VideoKind kind = VideoKind::kIsoMedia;
  // Throws if an image of that size needs more memory than there is.
  void (*require_memory)(double width_px, double height_px, double bytes_per_px,
                         const std::string& name) = nullptr;
};

// One open video of the library that image_library.h describes. One thread at a time may use it. No
// exception leaves a function; `why` gets the reason of a failure.
class VideoDecoder {
 public:
  enum class Step { kFrame, kEnd, kFailure };

  virtual ~VideoDecoder() = default;
  // The facts of all frames: `page`, `pages` and sizes are those of no frame in particular.
  virtual const ImageFacts& facts() const = 0;
  // Decodes the next frame in the order of display.
  virtual Step Next(VideoStamp* stamp, std::string* why) = 0;
  // The pixels of that frame: CV_8U or CV_16U, grey or RGB.
  virtual bool Pixels(cv::Mat* pixels, std::string* why) = 0;
  // The frames that were lost on the way from the first to the last one, without a jump.
  virtual VideoLosses Losses() const = 0;
  // Goes to the key frame of that stamp. Next then returns frames that are shown at this time or
  // around it; the caller compares their stamps and digests.
  virtual bool Seek(std::int64_t stamp, std::string* why) = 0;
};

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_VIDEO_VIDEO_DECODER_H_
