#include "tools/io/metadata_image.h"

#include <algorithm>
#include <array>

namespace thicklens::io {
namespace {

// Exiv2 has names for these numbers only where it is built with videos.
constexpr int kRiff = 20, kMatroska = 21, kQuickTime = 22, kAsf = 24;
constexpr std::array<int, 4> kVideos = {kRiff, kMatroska, kQuickTime, kAsf};

const Exiv2::byte* Start(const std::string& bytes) {
  return reinterpret_cast<const Exiv2::byte*>(bytes.data());  // NOLINT: bytes
}

}  // namespace

bool CanHoldMetadata(const std::string& bytes) {
  const int type = Exiv2::ImageFactory::getType(Start(bytes), static_cast<long>(bytes.size()));
  return type != Exiv2::ImageType::none &&
         std::find(kVideos.begin(), kVideos.end(), type) == kVideos.end();
}

Exiv2::Image::AutoPtr ReadMetadata(const std::string& bytes) {
  if (!CanHoldMetadata(bytes)) throw Exiv2::Error(Exiv2::kerMemoryContainsUnknownImageType);
  auto image = Exiv2::ImageFactory::open(Start(bytes), static_cast<long>(bytes.size()));
  image->readMetadata();
  return image;
}

}  // namespace thicklens::io
