#include "tools/io/video/frame_spool.h"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <string>

namespace thicklens::io {
namespace {

std::string FolderOfSpool() {
  const char* const stated = std::getenv("TMPDIR");
  return stated != nullptr && *stated == '/' ? stated : "/var/tmp";
}

// Reads or writes all bytes; false on a failure.
template <typename Transfer>
bool TransferAll(std::size_t bytes, const Transfer& transfer) {
  std::size_t done = 0;
  while (done < bytes) {
    const ssize_t count = transfer(done, bytes - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    done += static_cast<std::size_t>(count);
  }
  return true;
}

}  // namespace

FrameSpool::FrameSpool(double bytes) {
  const std::string folder = FolderOfSpool();
  struct statvfs disk {};
  if (statvfs(folder.c_str(), &disk) != 0) return;
  const double left = static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
  if (left < 2 * bytes) return;
  constexpr int kOwnerOnly = 0600;
  file_ = open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, kOwnerOnly);
  if (file_ >= 0) return;
  // A file system without files that have no name.
  std::string name = folder + "/thicklens-frames-XXXXXX";
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ >= 0) unlink(name.c_str());
}

FrameSpool::~FrameSpool() { Close(); }

void FrameSpool::Close() {
  if (file_ >= 0) close(file_);
  file_ = -1;
  place_of_.clear();
}

void FrameSpool::Write(int frame, const cv::Mat& pixels) {
  if (!IsUsable() || Has(frame)) return;
  size_ = pixels.size();
  type_ = pixels.type();
  const cv::Mat values = pixels.isContinuous() ? pixels : pixels.clone();
  const std::size_t bytes = values.total() * values.elemSize();
  const bool done = TransferAll(bytes, [&](std::size_t at, std::size_t left) {
    return pwrite(file_, values.data + at, left, end_ + static_cast<std::int64_t>(at));
  });
  if (!done) {
    Close();
    return;
  }
  place_of_[frame] = end_;
  end_ += static_cast<std::int64_t>(bytes);
}

cv::Mat FrameSpool::Read(int frame) const {
  const auto place = place_of_.find(frame);
  if (place == place_of_.end()) return {};
  cv::Mat pixels(size_, type_);
  const bool done =
      TransferAll(pixels.total() * pixels.elemSize(), [&](std::size_t at, std::size_t left) {
        return pread(file_, pixels.data + at, left, place->second + static_cast<std::int64_t>(at));
      });
  return done ? pixels : cv::Mat();
}

}  // namespace thicklens::io
