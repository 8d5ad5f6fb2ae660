#ifndef THICKLENS_TOOLS_PNG_CHECK_H_
#define THICKLENS_TOOLS_PNG_CHECK_H_

#include <string>

namespace thicklens::tools {

// Throws Error that begins with `name` if the bytes are a PNG file that ends early or of which a
// chunk is damaged; other files pass. To be called before such a file is decoded: decoders do not
// know the file's name, nor where the chunk is.
void RequireWholePng(const std::string& bytes, const std::string& name);

// A PNG file without what does not say how its pixels look: texts, which unpack to anything,
// profiles, and a palette that is only suggested. Other files, and those that end early, as they
// are.
std::string WithoutPngTexts(const std::string& bytes);

// Bits a value of a PNG file; 0 for other files.
int PngBits(const std::string& bytes);

// A PNG file, which must be whole and have no resolution yet, with its resolution: the chunk pHYs,
// by which programs print it at its true size.
std::string WithPngResolution(const std::string& png, int pixels_per_metre);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PNG_CHECK_H_
