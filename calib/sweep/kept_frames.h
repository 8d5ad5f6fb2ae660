#ifndef THICKLENS_CALIB_SWEEP_KEPT_FRAMES_H_
#define THICKLENS_CALIB_SWEEP_KEPT_FRAMES_H_

#include <cstddef>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>

namespace thicklens::calib {

// A reader of frames (FocusSweep::read_frame) that keeps the first frames that are read, up to a
// limit of memory in all. Beyond the limit a frame is read again each time, so that memory does not
// grow with the sweep. Copies share what they keep: all steps of a calibration, and all sweeps that
// are derived from one, decode a frame once. It is thread safe, and the frames do not depend on
// which of them are kept.
class KeptFrames {
 public:
  static constexpr std::size_t kDefaultLimit = std::size_t{256} << 20;  // bytes
  using Reader = std::function<cv::Mat(std::size_t index)>;

  // Returns `reader` itself if it already keeps frames. Otherwise it is called for the frames that
  // are not kept.
  static KeptFrames Of(const Reader& reader, std::size_t byte_limit = kDefaultLimit);

  // Returns the whole frame as its file stores it. The caller must not write to it. Throws what the
  // reader throws.
  cv::Mat operator()(std::size_t index) const;

  std::size_t kept_bytes() const;

 private:
  struct Shared;
  explicit KeptFrames(std::shared_ptr<Shared> shared);

  std::shared_ptr<Shared> shared_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_KEPT_FRAMES_H_
