// The library that tools/io/image_library.h describes.
#include <exception>
#include <memory>

#include "tools/io/library/decoders.h"
#include "tools/io/plugin.h"

namespace thicklens::io {
namespace {

// Puts the reason of a failure into `why`; no exception leaves the library.
template <typename Function>
bool Guarded(std::string* why, const Function& function) {
  try {
    function();
    return true;
  } catch (const std::exception& error) {
    *why = error.what();
  } catch (...) {
    *why = "an exception of the decoder";
  }
  if (why->empty()) *why = "the decoder gives no reason";
  return false;
}

bool Pages(const std::string& bytes, const LibraryReading& reading, std::vector<LibraryPage>* pages,
           std::string* why) {
  return Guarded(why, [&] {
    if (reading.kind == ImageFileKind::kRaw) {
      *pages = RawPages(bytes);
    } else if (reading.kind == ImageFileKind::kHeif) {
      *pages = HeifPages(bytes);
    } else if (reading.kind == ImageFileKind::kWebp) {
      *pages = WebpPages(bytes);
    } else {
      *pages = OiioPages(bytes, reading.kind);
    }
  });
}

bool Decode(const std::string& bytes, const LibraryReading& reading, DecodedImage* image,
            std::string* why) {
  return Guarded(why, [&] {
    if (reading.kind == ImageFileKind::kRaw) {
      *image = DecodeRaw(bytes, reading);
    } else if (reading.kind == ImageFileKind::kHeif) {
      *image = DecodeHeif(bytes, reading);
    } else if (reading.kind == ImageFileKind::kWebp) {
      *image = DecodeWebp(bytes, reading);
    } else {
      *image = DecodeByOiio(bytes, reading);
    }
  });
}

bool Depth(const std::string& bytes, const LibraryReading& reading, LibraryDepth* depth,
           std::string* why) {
  return Guarded(why, [&] { *depth = HeifDepth(bytes, reading); });
}

bool Encode(const cv::Mat& pixels, ImageFormat format, const ImageWriting& writing,
            std::string* bytes, std::string* why) {
  return Guarded(why, [&] {
    *bytes = format == ImageFormat::kWebp ? EncodeWebp(pixels, writing)
                                          : EncodeByOiio(pixels, format, writing);
  });
}

bool OpenVideoFile(const std::string& path, const VideoOpening& opening,
                   std::unique_ptr<VideoDecoder>* video, std::string* why) {
  return Guarded(why, [&] { *video = OpenVideo(path, opening); });
}

bool EncodeAnimation(const AnimationFrames& frames, int quality, std::string* bytes,
                     std::string* why) {
  return Guarded(why, [&] { *bytes = EncodeWebpFrames(frames, quality); });
}

}  // namespace
}  // namespace thicklens::io

THICKLENS_STATE_PLUGIN_IDENTITY()

extern "C" __attribute__((visibility("default"))) const thicklens::io::ImageLibrary*
ThicklensImageLibrary() {
  static const thicklens::io::ImageLibrary library{
      thicklens::io::Pages,  thicklens::io::Decode,        thicklens::io::Depth,
      thicklens::io::Encode, thicklens::io::OpenVideoFile, thicklens::io::EncodeAnimation};
  return &library;
}
