#include "thicklens/io/animation_file.h"

#include <fmt/format.h>

#include <exception>
#include <opencv2/core/mat.hpp>

#include "thicklens/base/error.h"
#include "tools/io/image_library.h"

namespace thicklens::io {

std::string EncodeWebpAnimation(const AnimationFile& animation) {
  constexpr int kMaxSidePx = 16383;
  if (animation.width_px > kMaxSidePx || animation.height_px > kMaxSidePx) {
    throw Error(fmt::format("animation: {}x{} px: a WebP file has at most {} px per side",
                            animation.width_px, animation.height_px, kMaxSidePx));
  }
  // No exception crosses the library.
  std::exception_ptr failure;
  AnimationFrames frames;
  frames.count = animation.count;
  frames.width_px = animation.width_px;
  frames.height_px = animation.height_px;
  frames.seconds = animation.seconds;
  frames.icc_profile = animation.icc_profile;
  frames.frame = [&](int number) -> cv::Mat {
    try {
      const model::EncodedImage image = animation.frame(number);
      if (image.width_px != animation.width_px || image.height_px != animation.height_px ||
          image.bits != 8 || (image.channels != 1 && image.channels != 3)) {
        throw Error(fmt::format(
            "frame {} has {}x{} px in {} channel(s) of {} bits: {}x{} px in 1 or 3 of 8 bits are "
            "needed",
            number, image.width_px, image.height_px, image.channels, image.bits, animation.width_px,
            animation.height_px));
      }
      cv::Mat pixels(image.height_px, image.width_px, CV_8UC(image.channels));
      auto value = image.values.begin();
      for (int y = 0; y < pixels.rows; ++y) {
        auto* const row = pixels.ptr<unsigned char>(y);
        for (int i = 0; i < pixels.cols * pixels.channels(); ++i)
          row[i] = static_cast<unsigned char>(*value++);
      }
      return pixels;
    } catch (...) {
      failure = std::current_exception();
      return {};
    }
  };
  std::string bytes, why;
  const bool done = LoadedImageLibrary().encode_animation(frames, animation.quality, &bytes, &why);
  if (failure) std::rethrow_exception(failure);
  if (!done) throw Error("animation: " + why);
  return bytes;
}

}  // namespace thicklens::io
