#ifndef THICKLENS_TOOLS_IO_TABLES_METADATA_FIELDS_H_
#define THICKLENS_TOOLS_IO_TABLES_METADATA_FIELDS_H_

#include <string>

namespace thicklens::io {

// The ImageDescription of the first page of an image; empty: it has none. Throws Error if the file
// cannot be read as an image with metadata.
std::string ImageDescriptionOf(const std::string& path);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_TABLES_METADATA_FIELDS_H_
