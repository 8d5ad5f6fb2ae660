#include "thicklens/distortion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <opencv2/core.hpp>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/lens_distortion_file.h"
#include "thicklens/model/undistort.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/stated_transfer.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

constexpr float kNoDepth = std::numeric_limits<float>::quiet_NaN();

// The ending of a path in small letters, with its dot.
std::string EndingOf(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

// The lossless kind in which the values are written: that of the file, if it is one.
std::string EndingFor(const std::string& path, bool are_floats, int bits) {
  const std::string ending = EndingOf(path);
  for (const char* lossless :
       {".png", ".tif", ".tiff", ".exr", ".bmp", ".pgm", ".ppm", ".pnm", ".pfm"}) {
    if (ending != lossless) continue;
    const io::ImageFormat format = io::FormatOfName(path);
    if (are_floats ? io::HoldsFloats(format) : io::HoldsBits(format, bits)) return ending;
  }
  return are_floats ? ".tif" : ".png";
}

std::string Encode(const cv::Mat& pixels, const std::string& ending,
                   const io::ImageWriting& writing) {
  return io::EncodeImageFile(pixels, io::FormatOfName("image" + ending), writing);
}

// Undistorts the values of the whole image of a file, floats.
cv::Mat UndistortedValues(const std::string& path, const cv::Mat& values,
                          const LensDistortion& distortion, model::Resampling resampling,
                          float without_source, std::size_t* missing) {
  const cv::Mat whole = values.isContinuous() ? values : values.clone();
  cv::Mat out(whole.size(), whole.type());
  *missing = WithFileContext(path, [&] {
    return model::UndistortInto(distortion.ScaledTo(whole.cols, whole.rows), whole.ptr<float>(),
                                whole.channels(), {0, 0, whole.cols, whole.rows}, resampling,
                                without_source, out.ptr<float>());
  });
  return out;
}

UndistortedFile UndistortImageFile(const std::string& path, const LensDistortion& distortion,
                                   const UndistortFileOptions& options) {
  const io::DecodedImage image = io::ReadImageData(path);
  const io::ImageFacts& facts = image.facts;
  const cv::Mat& pixels = image.pixels;
  const bool are_floats = pixels.depth() == CV_32F || pixels.depth() == CV_64F;
  if (!are_floats && pixels.depth() != CV_8U && pixels.depth() != CV_16U) {
    throw Error(
        fmt::format("{}: an image of 8 or 16 bits or of floats is expected, found {}; a "
                    "depth map is undistorted as one (is_depth)",
                    path, facts.sample_type));
  }
  UndistortedFile file;
  file.width_px = pixels.cols;
  file.height_px = pixels.rows;
  file.values = are_floats ? "32-bit floats" : pixels.depth() == CV_8U ? "8 bits" : "16 bits";
  io::ImageWriting writing;
  writing.icc_profile = facts.icc_profile;
  writing.is_linear = facts.transfer == io::StatedTransfer::kLinear;
  if (facts.orientation != 1 && !facts.is_orientation_applied) {
    file.remark = fmt::format(
        "orientation {} is not applied: the pixels are as stored, as the distortion's must be",
        facts.orientation);
  }
  if (are_floats) {
    cv::Mat values;
    pixels.convertTo(values, CV_32F);
    const cv::Mat out = UndistortedValues(path, values, distortion, model::Resampling::kLanczos, 0,
                                          &file.without_source);
    file.ending = EndingFor(path, true, 0);
    file.bytes = Encode(out, file.ending, writing);
    return file;
  }
  const TransferCurve transfer =
      options.transfer ? *options.transfer
      : facts.raw      ? TransferCurve::Linear()
                       : StatedTransferOf(facts).value_or(
                             options.assumed_transfer.value_or(TransferCurve::Srgb()));
  const int bits = pixels.depth() == CV_8U ? 8 : 16;
  const model::LinearImage light = WithFileContext(path, [&] {
    return model::Undistorted(model::ToLinear(io::ToEncodedImage(pixels), transfer), distortion,
                              &file.without_source);
  });
  const model::EncodedImage encoded = model::ToEncoded(light, transfer, bits);
  const cv::Mat wide(encoded.height_px, encoded.width_px, CV_MAKETYPE(CV_16U, encoded.channels),
                     const_cast<std::uint16_t*>(encoded.values.data()));  // NOLINT: only read
  cv::Mat out = wide;
  if (bits == 8) wide.convertTo(out, CV_8U);
  file.ending = EndingFor(path, false, bits);
  file.bytes = Encode(out, file.ending, writing);
  return file;
}

UndistortedFile UndistortDepthFile(const std::string& path, const LensDistortion& distortion) {
  const io::DepthFile depth = io::ReadDepthFile(path);
  const model::RawDepthMap& map = depth.map;
  constexpr double kLargestPng = 65535;
  const bool is_png = map.integer && map.largest_of_type.value_or(kLargestPng + 1) <= kLargestPng;
  const cv::Mat values(map.height_px, map.width_px, CV_32F,
                       const_cast<float*>(map.values.data()));  // NOLINT: only read
  UndistortedFile file;
  file.width_px = map.width_px;
  file.height_px = map.height_px;
  cv::Mat out = UndistortedValues(path, values, distortion, model::Resampling::kNearest,
                                  is_png ? 0 : kNoDepth, &file.without_source);
  if (!is_png) {
    file.values = "32-bit floats";
    file.ending = ".pfm";
    model::RawDepthMap floats = map;
    std::copy(out.begin<float>(), out.end<float>(), floats.values.begin());
    file.bytes = io::EncodePfm(floats);
    return file;
  }
  constexpr double kByte = 255;
  const bool is_byte = *map.largest_of_type <= kByte;
  cv::patchNaNs(out, 0);
  cv::Mat whole;
  out.convertTo(whole, is_byte ? CV_8U : CV_16U);
  file.values = is_byte ? "unsigned 8-bit integers" : "unsigned 16-bit integers";
  file.ending = ".png";
  file.bytes = Encode(whole, file.ending, {});
  return file;
}

}  // namespace

LensDistortion ReadLensDistortion(const std::string& file_and_camera, int width_px, int height_px,
                                  const RunControl& control) {
  checks::RequireValid(control);
  RunScope run(control);
  const io::LensDistortionFile file = io::ReadLensDistortion(file_and_camera, width_px, height_px);
  if (!file.states_size) {
    run.Warn(fmt::format(
        "{}: it states no size of the photographs that it was measured on: {} x {} px, that of the "
        "images here, is taken",
        file.distortion.source, width_px, height_px));
  }
  return file.distortion;
}

// The camera matrix of a lens in focus has fx = D/p in px, where D is d1 behind the rear principal
// plane. If the camera is not calibrated, D is known to be f2 at infinity and larger for near
// objects.
std::string DoubtOfDistortion(const Camera& camera) {
  std::string why;
  if (!camera.distortion || !camera.IsValid(&why)) return "";
  constexpr double kMin = 0.8, kMax = 1.25, kMaxOfMacro = 2.5;
  const bool is_known = camera.calibration && camera.calibration->image_distance_mm;
  const double pitch_mm = camera.sensor.pixel_pitch_mm;
  const double lens_px = (is_known ? camera.image_distance_mm() - camera.lens.lens_thickness_mm
                                   : camera.lens.rear_focal_length_mm) /
                         pitch_mm;
  const double found_px =
      camera.distortion->ScaledTo(camera.sensor.width_px, camera.sensor.height_px)
          .focal_length_px.x();
  const double ratio = found_px / lens_px;
  if (ratio >= kMin && ratio <= (is_known ? kMax : kMaxOfMacro)) return "";
  return fmt::format(
      "the lens distortion{} was measured with a focal length of {:.5g} px, which is {:.4g} mm on "
      "this sensor, but the camera file has {} {:.4g} mm: it is of another lens, zoom or focus, or "
      "the pixel pitch or the size of its images is wrong",
      camera.distortion->source.empty() ? "" : " of " + camera.distortion->source, found_px,
      found_px * pitch_mm, is_known ? "an image distance of" : "a focal length of",
      lens_px * pitch_mm);
}

Image UndistortImage(const Image& image, const LensDistortion& distortion,
                     std::size_t* without_source) {
  const std::string where = image.source().empty() ? "image" : image.source();
  if (image.is_empty()) throw Error(where + ": at least one pixel is expected");
  const TransferCurve transfer =
      image.transfer().value_or(image.StatedTransfer().value_or(TransferCurve::Srgb()));
  return WithFileContext(where, [&] {
    model::LinearImage light =
        model::Undistorted(image.ToLight(transfer), distortion, without_source);
    Image out = Image::FromLight(light.width_px, light.height_px, image.order(),
                                 std::move(light.values), transfer, image.source());
    out.SetColourProfile(image.ColourProfile(transfer));
    return out;
  });
}

DepthMap UndistortDepth(const DepthMap& depth, const LensDistortion& distortion,
                        std::size_t* without_source) {
  const std::string where = depth.source.empty() ? "depth" : depth.source;
  std::string why;
  if (!depth.IsValid(&why)) throw OptionError("depth", fmt::format("{}: {}", where, why));
  return WithFileContext(where, [&] {
    DepthMap out = depth;
    const std::size_t missing =
        model::UndistortInto(distortion.ScaledTo(depth.width_px, depth.height_px),
                             depth.values.data(), 1, {0, 0, depth.width_px, depth.height_px},
                             model::Resampling::kNearest, kNoDepth, out.values.data());
    if (without_source != nullptr) *without_source = missing;
    return out;
  });
}

UndistortedFile UndistortFile(const std::string& path, const LensDistortion& distortion,
                              const UndistortFileOptions& options) {
  std::string why;
  if (!distortion.IsValid(&why)) throw Error("lens distortion: " + why);
  return options.is_depth ? UndistortDepthFile(path, distortion)
                          : UndistortImageFile(path, distortion, options);
}

}  // namespace thicklens
