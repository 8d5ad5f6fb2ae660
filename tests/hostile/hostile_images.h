#ifndef THICKLENS_TESTS_HOSTILE_HOSTILE_IMAGES_H_
#define THICKLENS_TESTS_HOSTILE_HOSTILE_IMAGES_H_

#include <cstddef>
#include <cstdint>
#include <string>

namespace thicklens::hostile {

// Image files that are composed byte by byte, so that their parts can contradict each other.

std::string Deflated(const std::string& bytes);
std::string DeflatedZeros(std::size_t count);

std::string PngChunk(const std::string& type, const std::string& content);
// A grey (0), RGB (2) or RGBA (6) image. `extra` is put before the pixels.
std::string PngOf(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                  const std::string& deflated_rows, const std::string& extra = "");

struct TiffParts {
  std::uint32_t width = 0, height = 0;
  int bits = 8;         // 32 means float
  int compression = 1;  // 1: none, 8: deflate
  std::string strip;
  std::uint32_t strip_at = 8;
  bool next_is_itself = false;  // the next directory is this one
};
std::string TiffOf(const TiffParts& parts);

// A header of one channel without any data after it.
std::string ExrOf(std::int32_t last_index);
std::string BmpOf(std::int32_t side);

}  // namespace thicklens::hostile

#endif  // THICKLENS_TESTS_HOSTILE_HOSTILE_IMAGES_H_
