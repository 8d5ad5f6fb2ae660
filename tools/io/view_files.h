#ifndef THICKLENS_TOOLS_IO_VIEW_FILES_H_
#define THICKLENS_TOOLS_IO_VIEW_FILES_H_

#include <fmt/format.h>

#include <string>

#include "thicklens/model/light_field_file.h"

namespace thicklens::io {

// Names of the files of a light field's views, for its reader and its writer.

constexpr char kHciStem[] = "input_Cam";

// The file of the view (k, l) in our own layout, relative to the folder.
inline std::string ViewFile(int k, int l, const std::string& format) {
  return fmt::format("views/{}.{}", model::ViewFileStem(k, l), format);
}

// The file of a view in the HCI layout.
inline std::string HciFile(int number, const std::string& ending = ".png") {
  return fmt::format("{}{:03}{}", kHciStem, number, ending);
}

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_VIEW_FILES_H_
