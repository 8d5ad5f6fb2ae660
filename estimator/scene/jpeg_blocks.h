#ifndef THICKLENS_ESTIMATOR_SCENE_JPEG_BLOCKS_H_
#define THICKLENS_ESTIMATOR_SCENE_JPEG_BLOCKS_H_

#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// Whether an image shows that it was compressed by JPEG, whatever its file is now: in blocks of 8 x
// 8 px at one place of their grid, more of the high frequencies of luminance are 0 than at the 63
// others. Such an image lacks fine details and has edges at blocks, so that its spectrum says
// little of its blur. An image that is smaller than 32 px or was reduced shows nothing.
bool ShowsJpegBlocks(const model::LinearImage& image, const model::TransferCurve& transfer);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_JPEG_BLOCKS_H_
