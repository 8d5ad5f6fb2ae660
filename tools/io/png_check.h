#ifndef THICKLENS_TOOLS_IO_PNG_CHECK_H_
#define THICKLENS_TOOLS_IO_PNG_CHECK_H_

#include <string>

namespace thicklens::io {

// Throws Error that begins with `name` if the bytes are a PNG file that ends early or has a damaged
// chunk; other files pass. Call it before such a file is decoded: decoders know neither the file's
// name nor the position of the chunk.
void RequireWholePng(const std::string& bytes, const std::string& name);

// Returns a PNG file without chunks that do not affect the look of its pixels: texts, which may
// decompress to any size, profiles, and a merely suggested palette. Other files, and files that end
// early, are returned unchanged.
std::string WithoutPngTexts(const std::string& bytes);

// Bits of each value of a PNG file; 0 for other files.
int PngBits(const std::string& bytes);

// 0 grey, 2 RGB, 3 with a palette, 4 grey with alpha, 6 RGBA; -1 for other files.
int PngColourType(const std::string& bytes);

// Returns a PNG file with another chunk directly behind its first one.
std::string WithPngChunk(const std::string& png, const std::string& type,
                         const std::string& content);

// Returns a PNG file with an ICC profile: the chunk iCCP.
std::string WithPngProfile(const std::string& png, const std::string& icc_profile);

// Returns a PNG file with its resolution: the chunk pHYs, by which programs print it at its true
// size. `png` must be complete and have no resolution yet.
std::string WithPngResolution(const std::string& png, int pixels_per_metre);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_PNG_CHECK_H_
