#ifndef THICKLENS_TOOLS_IO_VIDEO_FRAME_SPOOL_H_
#define THICKLENS_TOOLS_IO_VIDEO_FRAME_SPOOL_H_

#include <cstdint>
#include <map>
#include <opencv2/core/mat.hpp>

namespace thicklens::io {

// Decoded frames in a file without a name, in the folder that TMPDIR states, otherwise in /var/tmp,
// which is on a disk where /tmp may be memory. The system removes the file with the program,
// however that ends. A video is decoded once with it, in whatever order its frames are read.
class FrameSpool {
 public:
  // Opens the file if twice `bytes` are free there.
  explicit FrameSpool(double bytes);
  ~FrameSpool();
  FrameSpool(const FrameSpool&) = delete;
  FrameSpool& operator=(const FrameSpool&) = delete;

  // False if there is no such file, or since a frame could not be written.
  bool IsUsable() const { return file_ >= 0; }
  bool Has(int frame) const { return place_of_.count(frame) > 0; }
  // Appends a frame. All frames have one size and type. On a failure nothing is kept any more.
  void Write(int frame, const cv::Mat& pixels);
  // Returns a frame that it has; empty if it cannot be read.
  cv::Mat Read(int frame) const;

 private:
  void Close();

  int file_ = -1;
  std::int64_t end_ = 0;
  cv::Size size_;
  int type_ = 0;
  std::map<int, std::int64_t> place_of_;
};

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_VIDEO_FRAME_SPOOL_H_
