#include "calib/sweep/kept_frames.h"

#include <map>
#include <mutex>
#include <utility>

namespace thicklens::calib {

struct KeptFrames::Shared {
  Reader read;
  std::size_t byte_limit = 0;
  std::mutex mutex;
  std::map<std::size_t, cv::Mat> kept;  // by the index of the frame
  std::size_t kept_bytes = 0;
};

KeptFrames::KeptFrames(std::shared_ptr<Shared> shared) : shared_(std::move(shared)) {}

KeptFrames KeptFrames::Of(const Reader& reader, std::size_t byte_limit) {
  if (const auto* keeps = reader.target<KeptFrames>()) return *keeps;
  auto shared = std::make_shared<Shared>();
  shared->read = reader;
  shared->byte_limit = byte_limit;
  return KeptFrames(std::move(shared));
}

cv::Mat KeptFrames::operator()(std::size_t index) const {
  {
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    const auto found = shared_->kept.find(index);
    if (found != shared_->kept.end()) return found->second;
  }
  // The frame is read without the lock, so that threads decode in parallel. Two threads that
  // request the same frame at the same time both read it.
  const cv::Mat stored = shared_->read(index);
  const std::size_t bytes = stored.total() * stored.elemSize();
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  if (bytes <= shared_->byte_limit - shared_->kept_bytes &&
      shared_->kept.emplace(index, stored).second)
    shared_->kept_bytes += bytes;
  return stored;
}

std::size_t KeptFrames::kept_bytes() const {
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  return shared_->kept_bytes;
}

}  // namespace thicklens::calib
