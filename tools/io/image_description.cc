#include "thicklens/io/image_description.h"

#include <fmt/format.h>

#include "thicklens/base/error.h"
#include "tools/io/metadata_image.h"

namespace thicklens::io {

std::string WithDescription(const std::string& png, const std::string& text) {
  try {
    const auto image = ReadMetadata(png);
    image->setComment(text);
    image->writeMetadata();
    Exiv2::BasicIo& file = image->io();
    file.open();
    const Exiv2::DataBuf bytes = file.read(static_cast<long>(file.size()));
    return {reinterpret_cast<const char*>(bytes.pData_),  // NOLINT: bytes
            static_cast<std::size_t>(bytes.size_)};
  } catch (const Exiv2::AnyError& error) {
    throw Error(fmt::format("the description of a PNG file: {}", error.what()));
  }
}

std::string DescriptionOf(const std::string& png, const std::string& name) {
  try {
    return ReadMetadata(png)->comment();
  } catch (const Exiv2::AnyError& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  }
}

}  // namespace thicklens::io
