#ifndef THICKLENS_TOOLS_IO_LIBRARY_DECODERS_H_
#define THICKLENS_TOOLS_IO_LIBRARY_DECODERS_H_

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "tools/io/image_library.h"
#include "tools/io/video/video_decoder.h"

// The parts of the library that image_library.h describes. They are not linked with the program's
// own libraries: a reason is a std::runtime_error.
namespace thicklens::io {

using Refusal = std::runtime_error;

std::vector<LibraryPage> RawPages(const std::string& bytes);
DecodedImage DecodeRaw(const std::string& bytes, const LibraryReading& reading);

std::vector<LibraryPage> HeifPages(const std::string& bytes);
DecodedImage DecodeHeif(const std::string& bytes, const LibraryReading& reading);
LibraryDepth HeifDepth(const std::string& bytes, const LibraryReading& reading);

std::vector<LibraryPage> WebpPages(const std::string& bytes);
DecodedImage DecodeWebp(const std::string& bytes, const LibraryReading& reading);
std::string EncodeWebp(const cv::Mat& pixels, const ImageWriting& writing);
std::string EncodeWebpFrames(const AnimationFrames& frames, int quality);

std::vector<LibraryPage> OiioPages(const std::string& bytes, ImageFileKind kind);
DecodedImage DecodeByOiio(const std::string& bytes, const LibraryReading& reading);
std::string EncodeByOiio(const cv::Mat& pixels, ImageFormat format, const ImageWriting& writing);

std::unique_ptr<VideoDecoder> OpenVideo(const std::string& path, const VideoOpening& opening);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIBRARY_DECODERS_H_
