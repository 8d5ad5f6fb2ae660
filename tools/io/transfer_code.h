#ifndef THICKLENS_TOOLS_IO_TRANSFER_CODE_H_
#define THICKLENS_TOOLS_IO_TRANSFER_CODE_H_

#include "thicklens/io/image_file.h"

namespace thicklens::io {

// The transfer curve of a code of ITU-T H.273, as PNG, HEIF and AVIF use it. It is defined here
// because the library of decoders is not linked with this one.
inline StatedTransfer TransferOfCode(unsigned code) {
  switch (code) {
    case 1:
    case 6:
    case 14:
    case 15:
      return StatedTransfer::kBt709;
    case 8:
      return StatedTransfer::kLinear;
    case 13:
      return StatedTransfer::kSrgb;
    case 16:
      return StatedTransfer::kPq;
    case 18:
      return StatedTransfer::kHlg;
    default:
      return StatedTransfer::kAbsent;
  }
}

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_TRANSFER_CODE_H_
