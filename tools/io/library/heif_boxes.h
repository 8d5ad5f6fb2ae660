#ifndef THICKLENS_TOOLS_IO_LIBRARY_HEIF_BOXES_H_
#define THICKLENS_TOOLS_IO_LIBRARY_HEIF_BOXES_H_

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace thicklens::io {

// Codes of ITU-T H.273, which a colr box of type nclx states.
struct HeifColourCodes {
  std::uint32_t primaries = 2;  // 2: not specified
  std::uint32_t transfer = 2;   // 2: not specified
};

// The boxes of a HEIF file (ISO/IEC 14496-12 and 23008-12), for what libheif 1.15 does not say, or
// says only at a price: it applies turns and mirrors without saying which, and loses the memory of
// a colour profile that has an unknown code. A damaged file has fewer properties.
class HeifBoxes {
 public:
  // `bytes` must outlive the object.
  explicit HeifBoxes(const std::string& bytes);

  // How the decoded image becomes the displayed one: 1 to 8 as in EXIF. *is_cropped becomes true
  // where the image has a crop.
  int OrientationOf(std::uint32_t item, bool* is_cropped) const;

  // The codes of the image or, where it is made of tiles and states none, of its first tile.
  std::optional<HeifColourCodes> ColourCodesOf(std::uint32_t item) const;

 private:
  struct Box {
    std::size_t begin = 0, end = 0;  // of its content, in bytes from the file's start
    std::string type;
  };

  std::uint32_t Number(std::size_t at, std::size_t count) const;
  std::vector<Box> Inside(std::size_t begin, std::size_t end) const;
  Box Find(const Box& box, std::size_t skip, const std::string& type) const;
  std::vector<Box> PropertiesOf(std::uint32_t item) const;
  std::optional<std::uint32_t> FirstTileOf(std::uint32_t item) const;
  std::optional<HeifColourCodes> OwnColourCodesOf(std::uint32_t item) const;

  const std::string& bytes_;
  Box meta_;
};

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIBRARY_HEIF_BOXES_H_
