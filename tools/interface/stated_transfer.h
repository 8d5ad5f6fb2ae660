#ifndef THICKLENS_TOOLS_INTERFACE_STATED_TRANSFER_H_
#define THICKLENS_TOOLS_INTERFACE_STATED_TRANSFER_H_

#include <optional>
#include <string>

#include "thicklens/camera.h"
#include "thicklens/image.h"
#include "thicklens/io/image_file.h"

namespace thicklens {

// The curve that an image file states; absent if it states none, or one that TransferCurve does not
// have (BT.709, PQ, HLG).
std::optional<TransferCurve> StatedTransferOf(const io::ImageFacts& facts);
// Its name, also of a curve that TransferCurve does not have; empty: the file states none.
std::string StatedTransferName(const io::ImageFacts& facts);

// "the file states .., the camera file ..": one sentence with both values; empty: they agree, or
// the file states nothing. Exponents that differ by 5 % or less agree: files round them.
std::string TransferContradiction(const io::ImageFacts& facts, const Camera& camera);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_STATED_TRANSFER_H_
