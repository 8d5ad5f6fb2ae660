#ifndef THICKLENS_IO_FRAME_FILES_H_
#define THICKLENS_IO_FRAME_FILES_H_

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/io/files_read.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/video_file.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::io {

// Reads the image of a frame, its page, or the frame of that number of a video. Throws Error that
// names the frame.
THICKLENS_EXPORT cv::Mat ReadFrame(const model::SweepFrame& frame, ImageFacts* facts = nullptr);

// The image files of a sweep, read on request; several threads may read.
class THICKLENS_EXPORT FrameFiles {
 public:
  // Takes the paths of the frames; opens none. `full_scale` is the value in the files that stands
  // for white; absent: that of their container, or the one that they state.
  // `raw` is what is made of raw files; kMosaicGreen, with white at 65535, is refused for others.
  explicit FrameFiles(std::vector<model::SweepFrame> frames,
                      std::optional<int> full_scale = std::nullopt,
                      RawTreatment raw = RawTreatment::kDemosaiced);

  // Returns a frame whose white is the full scale of its type. Throws Error that names the file.
  cv::Mat Read(std::size_t index);
  // Returns what was read from the files so far.
  std::vector<FilesRead> Files();

  // SHA-256 over lines "digest reading", one for each frame in the sweep's order, where digest is
  // that of the file's bytes and reading is in mm; "digest page reading" for the page of a file of
  // several, and of a video, whose pages are its frames. The digest of a file is computed when the
  // file is first read, or here.
  std::string DataSha256();

 private:
  using Bytes = std::shared_ptr<const std::string>;
  Bytes ReadAndDigest(std::size_t index);
  // The video that the frame is of; null: it is of another file.
  VideoFile* VideoOf(std::size_t index);
  cv::Mat ReadVideo(VideoFile* video, std::size_t index);
  void DigestVideo(std::size_t index);

  std::vector<model::SweepFrame> frames_;
  std::optional<int> full_scale_;
  RawTreatment raw_ = RawTreatment::kDemosaiced;
  std::vector<std::string> digests_;              // empty: not read yet
  std::vector<std::optional<ImageFacts>> facts_;  // absent: not read yet
  // The file that was read last, kept for its other pages.
  std::string stack_path_;
  Bytes stack_;
  std::string stack_digest_;
  // A video is opened once, for all of its frames; null: the file is no video.
  std::map<std::string, std::unique_ptr<VideoFile>> videos_;
  std::map<std::string, std::string> video_digests_;
  std::mutex mutex_, reading_stack_, opening_video_;
};

}  // namespace thicklens::io

#endif  // THICKLENS_IO_FRAME_FILES_H_
