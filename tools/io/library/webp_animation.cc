// Animations in WebP by libwebp and libwebpmux.
#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>

#include "tools/io/library/decoders.h"

namespace thicklens::io {
namespace {

struct FreePicture {
  void operator()(WebPPicture* picture) const { WebPPictureFree(picture); }
};

std::string WithProfile(const WebPData& file, const std::string& icc_profile) {
  const std::unique_ptr<WebPMux, void (*)(WebPMux*)> mux(WebPMuxCreate(&file, 1), WebPMuxDelete);
  const WebPData profile{reinterpret_cast<const std::uint8_t*>(icc_profile.data()),  // NOLINT
                         icc_profile.size()};
  WebPData whole;
  WebPDataInit(&whole);
  const std::unique_ptr<WebPData, void (*)(WebPData*)> freed(&whole, WebPDataClear);
  if (!mux || WebPMuxSetChunk(mux.get(), "ICCP", &profile, 1) != WEBP_MUX_OK ||
      WebPMuxAssemble(mux.get(), &whole) != WEBP_MUX_OK)
    throw Refusal("its colour profile cannot be stored");
  return {reinterpret_cast<const char*>(whole.bytes), whole.size};  // NOLINT: bytes
}

}  // namespace

std::string EncodeWebpFrames(const AnimationFrames& frames, int quality) {
  WebPAnimEncoderOptions options;
  WebPConfig config;
  if (WebPAnimEncoderOptionsInit(&options) == 0 || WebPConfigInit(&config) == 0)
    throw Refusal("libwebp has another version than the one that this program was built with");
  config.quality = static_cast<float>(quality);
  options.anim_params.loop_count = 0;  // for ever
  const std::unique_ptr<WebPAnimEncoder, void (*)(WebPAnimEncoder*)> encoder(
      WebPAnimEncoderNew(frames.width_px, frames.height_px, &options), WebPAnimEncoderDelete);
  if (!encoder) throw Refusal("libwebpmux makes no encoder of this size");
  // Times are whole milliseconds; rounding each keeps the length of the whole.
  const auto time_ms = [&frames](int frame) {
    return static_cast<int>(std::lround(1000 * frames.seconds * frame / frames.count));
  };
  for (int frame = 0; frame < frames.count; ++frame) {
    cv::Mat pixels = frames.frame(frame);
    if (pixels.empty()) throw Refusal("a frame is missing");
    if (pixels.channels() == 1) cv::merge(std::vector<cv::Mat>{pixels, pixels, pixels}, pixels);
    WebPPicture picture;
    if (WebPPictureInit(&picture) == 0) throw Refusal("libwebp has another version");
    const std::unique_ptr<WebPPicture, FreePicture> freed(&picture);
    picture.use_argb = 1;
    picture.width = pixels.cols;
    picture.height = pixels.rows;
    if (WebPPictureImportRGB(&picture, pixels.data, static_cast<int>(pixels.step)) == 0)
      throw Refusal("there is too little memory for a frame");
    if (WebPAnimEncoderAdd(encoder.get(), &picture, time_ms(frame), &config) == 0)
      throw Refusal(WebPAnimEncoderGetError(encoder.get()));
  }
  WebPData data;
  WebPDataInit(&data);
  const std::unique_ptr<WebPData, void (*)(WebPData*)> freed(&data, WebPDataClear);
  if (WebPAnimEncoderAdd(encoder.get(), nullptr, time_ms(frames.count), nullptr) == 0 ||
      WebPAnimEncoderAssemble(encoder.get(), &data) == 0)
    throw Refusal(WebPAnimEncoderGetError(encoder.get()));
  if (frames.icc_profile.empty())
    return {reinterpret_cast<const char*>(data.bytes), data.size};  // NOLINT: bytes
  return WithProfile(data, frames.icc_profile);
}

}  // namespace thicklens::io
