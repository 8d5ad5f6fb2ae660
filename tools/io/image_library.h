#ifndef THICKLENS_TOOLS_IO_IMAGE_LIBRARY_H_
#define THICKLENS_TOOLS_IO_IMAGE_LIBRARY_H_

#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/io/image_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/video/video_decoder.h"

namespace thicklens::io {

// The request that the library of decoders gets besides the bytes of a file.
struct LibraryReading {
  ImageFileKind kind = ImageFileKind::kExr;
  ImageReading reading;
  // Throws if an image of that size needs more memory than there is.
  void (*require_memory)(double width_px, double height_px, double bytes_per_px,
                         const std::string& name) = nullptr;
};

// One page or part of a file.
struct LibraryPage {
  int width_px = 0, height_px = 0;
  std::string name;
  std::vector<std::string> channels;  // EXR: the names of the part's channels
  bool is_deep = false;               // EXR: it has any number of values per pixel
};

// The depth image of a HEIF file, and what belongs to it.
struct LibraryDepth {
  cv::Mat numbers;  // CV_8U or CV_16U, as stored, neither turned nor cropped; empty: there is none
  int bits = 0;     // of each number
  std::string xmp;  // of the depth image; empty: it has none
  // The fields of its depth representation information (ITU-T H.265): "z_near" 0.3.
  std::vector<std::pair<std::string, double>> stated;
  std::string photo_xmp;                 // of the photograph
  std::vector<std::string> other_types;  // of the other auxiliary images, without alpha
};

// The frames of an animation that repeats, each asked for when it is encoded.
struct AnimationFrames {
  int count = 0, width_px = 0, height_px = 0;
  double seconds = 0;       // length of all frames
  std::string icc_profile;  // of all frames; empty: none
  // 8 bits, grey or RGB; throws nothing, and returns an empty image where it fails.
  std::function<cv::Mat(int frame)> frame;
};

// OpenImageIO with LibRaw, libheif and FFmpeg. They are in a library of their own, which is loaded
// when an image first needs it: with the 260 libraries that it depends on it takes more time and
// memory than everything else that the program does at its start. No exception leaves a function,
// and nothing is printed: `why` gets the reason if the result is false.
struct ImageLibrary {
  bool (*pages)(const std::string& bytes, const LibraryReading& reading,
                std::vector<LibraryPage>* pages, std::string* why);
  // Decodes page `reading.reading.page`. Of the facts, only those are set that the decoder knows:
  // image_file.cc sets what the bytes of the file state by themselves. The pixels of a raw file are
  // its mosaic, unless they are to be demosaiced.
  bool (*decode)(const std::string& bytes, const LibraryReading& reading, DecodedImage* image,
                 std::string* why);
  // Finds the depth image of the main image; a file without one is no failure.
  bool (*depth)(const std::string& bytes, const LibraryReading& reading, LibraryDepth* depth,
                std::string* why);
  bool (*encode)(const cv::Mat& pixels, ImageFormat format, const ImageWriting& writing,
                 std::string* bytes, std::string* why);
  // Opens a video by its path: it may be larger than the memory.
  bool (*open_video)(const std::string& path, const VideoOpening& opening,
                     std::unique_ptr<VideoDecoder>* video, std::string* why);
  // As WebP.
  bool (*encode_animation)(const AnimationFrames& frames, int quality, std::string* bytes,
                           std::string* why);
};

// Throws Error if that library is missing from the program's installation, or left out of the
// build. Many threads may call it.
const ImageLibrary& LoadedImageLibrary();
// Whether the build has the library.
bool HasImageLibrary();

// The pages or parts of the file with these bytes, as its headers state them. Throws Error that
// begins with `name`.
std::vector<LibraryPage> PartsOfImage(const std::string& bytes, const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_IMAGE_LIBRARY_H_
