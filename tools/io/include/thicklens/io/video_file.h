#ifndef THICKLENS_IO_VIDEO_FILE_H_
#define THICKLENS_IO_VIDEO_FILE_H_

#include <memory>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/video_sweep.h"

namespace thicklens::io {

// Whether the ending of the name is one of a video, in capitals or not: mp4, m4v, mov, mkv, webm,
// avi, ts, m2ts, mts, mjpeg, mjpg, h264, avc, 264, hevc, h265, 265, or one of a video that
// VideoFile refuses by its kind: y4m, yuv, gif.
THICKLENS_EXPORT bool IsNameOfVideo(const std::string& path);
// Whether the file is a video, by its content: MP4, MOV, Matroska, WebM, AVI, MPEG-TS or, with
// their endings, raw streams of Motion JPEG, H.264 and H.265. False for a file that cannot be read.
THICKLENS_EXPORT bool IsVideoFile(const std::string& path);
// Whether the file is a JPEG image, by its content, and no stream of Motion JPEG, which begins like
// one. False for a file that cannot be read.
THICKLENS_EXPORT bool IsJpegFile(const std::string& path);

// The findings of a pass over all frames of a video.
struct VideoSurvey {
  std::vector<model::VideoFrame> frames;  // in the order of display
  ImageFacts facts;                       // of the first frame; `page` is 0
  VideoCompression compression;           // of all frames
  bool is_interlaced = false;             // the rows of some frames are of two times
};

// A video file, whose frames are read by their number, from 0 in the order of display. Frames are
// found by counting, never by a frame rate: a jump to a key frame is used only if the frame that is
// then found has the time stamp and the values that counting found. At most 128 MiB of frames are
// kept in memory. If those that Expect states are larger, they are kept in a file without a name in
// TMPDIR or /var/tmp, so that a sweep is decoded once, or, if that has no room, decoded again when
// they are read. Several threads may read; one of them decodes at a time.
class THICKLENS_EXPORT VideoFile {
 public:
  // Opens the file and its first stream of images. Throws Error that begins with `path` if it is
  // no video, is truncated, has no images, or if this build reads none.
  explicit VideoFile(const std::string& path);
  ~VideoFile();
  VideoFile(VideoFile&&) noexcept;
  VideoFile& operator=(VideoFile&&) noexcept;

  // Decodes all frames once and keeps none. Throws Error that names the frame.
  VideoSurvey Survey();
  // States which frames will be read: those beside them are decoded, but not kept.
  void Expect(const std::vector<int>& frames);
  // Returns a frame, as stored: grey or RGB, CV_8U or CV_16U, white at full scale. Throws Error
  // that names the frame, also if there is no such frame.
  DecodedImage Read(int frame);

 private:
  class Reader;
  std::unique_ptr<Reader> reader_;
};

}  // namespace thicklens::io

#endif  // THICKLENS_IO_VIDEO_FILE_H_
