#ifndef THICKLENS_TOOLS_IO_CONFIDENCE_FILE_NAME_H_
#define THICKLENS_TOOLS_IO_CONFIDENCE_FILE_NAME_H_

#include <string>

#include "thicklens/model/light_field_file.h"

namespace thicklens::io {

constexpr char kConfidenceFolder[] = "confidence";

// The file with the confidence of the view (k, l), below the folder of a light field.
inline std::string ConfidenceFileName(int k, int l) {
  return std::string(kConfidenceFolder) + "/" + model::ViewFileStem(k, l) + ".png";
}

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_CONFIDENCE_FILE_NAME_H_
