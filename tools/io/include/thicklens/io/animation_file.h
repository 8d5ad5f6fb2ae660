#ifndef THICKLENS_IO_ANIMATION_FILE_H_
#define THICKLENS_IO_ANIMATION_FILE_H_

#include <functional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"

namespace thicklens::io {

// An animation that repeats for ever.
struct AnimationFile {
  int count = 0;                    // number of frames, >= 1
  int width_px = 0, height_px = 0;  // of each frame, px
  double seconds = 0;               // length of all frames, s, > 0
  int quality = 90;                 // of the compression, 0 to 100
  std::string icc_profile;          // of the frames; empty: none
  // Returns a frame of 8 bits, grey or RGB, encoded values. Frames are asked for in their order.
  std::function<model::EncodedImage(int frame)> frame;
};

// Encodes it as a WebP file and returns the bytes. What `frame` throws leaves this function. Throws
// Error if the build has no encoder of WebP, for more than 16383 px per side, and where the encoder
// fails.
THICKLENS_EXPORT std::string EncodeWebpAnimation(const AnimationFile& animation);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_ANIMATION_FILE_H_
