#include "calib/sweep/frame_store.h"

namespace thicklens::calib {

FrameStore::FrameStore(const FocusSweep& sweep, std::size_t byte_limit)
    : sweep_(sweep), byte_limit_(byte_limit), kept_(sweep.frames.size()) {}

cv::Mat FrameStore::Stored(std::size_t index) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!kept_[index].empty()) return kept_[index];
  }
  // The frame is read without the lock, so that threads decode in parallel. Two threads that
  // request the same frame at the same time both read it.
  const cv::Mat stored = sweep_.read_frame(index);
  const std::size_t bytes = stored.total() * stored.elemSize();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (kept_[index].empty() && bytes <= byte_limit_ - kept_bytes_) {
    kept_[index] = stored;
    kept_bytes_ += bytes;
  }
  return stored;
}

void FrameStore::SetCorrection(const FixedPatternRemoval& correction) {
  correction_ = std::make_unique<const FixedPatternRemoval>(correction);
}

cv::Mat FrameStore::Grey(std::size_t index) {
  cv::Mat grey = LinearGrey(Stored(index), sweep_, index);
  if (correction_) correction_->Apply(&grey);
  return grey;
}

cv::Mat FrameStore::Channel(std::size_t index, int channel) {
  cv::Mat light = LinearChannel(Stored(index), sweep_, index, channel);
  if (correction_) correction_->Apply(&light);
  return light;
}

std::size_t FrameStore::kept_bytes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return kept_bytes_;
}

}  // namespace thicklens::calib
