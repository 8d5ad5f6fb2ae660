#ifndef THICKLENS_CALIB_CAMERA_RESPONSE_H_
#define THICKLENS_CALIB_CAMERA_RESPONSE_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// How the camera made its values from the light, as far as the frames of a sweep show it. A lens
// out of focus spreads light and loses none, and it blurs weak and strong detail alike. Frames that
// do otherwise were read with a wrong transfer curve, or were processed by the camera. Each value
// is present only where it could be measured.
struct CameraResponse {
  // Limits above which a finding is reported: those of the effects on kappa that matter.
  static constexpr double kSignificant = 4;     // standard deviations
  static constexpr double kMinExponent = 0.25;  // |ln exponent|
  static constexpr double kMinLoss = 0.01;      // of weak detail, per factor e of contrast
  static constexpr double kMinNoiseRise = 0.2;  // relative to white noise
  static constexpr double kMinBlockGrid = 1.5;  // relative to the steps between other pixels
  static constexpr double kLossToRatio = 0.5;   // d ln kappa/d loss of a power law of contrast
  static constexpr double kLargestFactor = 4;   // largest shift of kappa over that of the law
  static constexpr double kSharpeningOnRatio = 0.001;  // relative change of kappa by sharpening

  bool measured = false;  // true if the frames were examined
  // The light is the value that was read, by the stated transfer, to this power: 1 where the stated
  // transfer is right. Dimensionless.
  std::optional<model::Estimate> light_exponent;
  // The transfer of the camera file that describes the frames, in the words of that file
  // ("linear"); empty where the stated one does, or where it is not known.
  std::string better_transfer;
  // Part of the contrast that detail loses if its contrast is smaller by the factor e, beyond what
  // the blur takes: 0 for a camera that does not process its images. Positive: noise reduction or
  // compression, which remove weak detail.
  std::optional<model::Estimate> weak_detail_loss;
  // Noise power of single pixels over that of 4 x 4 px, relative to white noise, minus 1. Positive:
  // sharpening. Demosaicing and smoothing make it negative.
  std::optional<model::Estimate> noise_rise;
  // Mean step between pixels of different blocks of 8 x 8 px over the mean step between others,
  // minus 1. Positive: compression as JPEG.
  std::optional<model::Estimate> block_grid;

  // Whether the stated transfer is wrong by more than 4 standard deviations and by enough to
  // matter.
  THICKLENS_EXPORT bool ContradictsTransfer() const;
  // Whether weak detail is lost, by the same rule.
  THICKLENS_EXPORT bool LosesWeakDetail() const;
  // Whether the frames are sharpened, by the same rule.
  THICKLENS_EXPORT bool IsSharpened() const;
  // Whether the frames were compressed strongly, by the same rule.
  THICKLENS_EXPORT bool IsCompressed() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CAMERA_RESPONSE_H_
