#include "thicklens/calib/camera_response.h"

#include <cmath>

namespace thicklens::calib {
namespace {

bool IsPositive(const std::optional<model::Estimate>& found, double least) {
  return found && found->value > least &&
         found->value > CameraResponse::kSignificant * found->sigma;
}

// Largest -ln of the power that sharpening alone causes, because its overshoots do not keep the
// mean of the light: an upper bound of simulated sweeps with unsharp masks of 0.7 to 2 px and 50 to
// 150 %, as a function of the rise of the noise.
double PowerOfSharpening(double noise_rise) {
  return 0.2 * noise_rise + 0.17 * noise_rise * noise_rise;
}

}  // namespace

bool CameraResponse::ContradictsTransfer() const {
  if (!light_exponent || !(light_exponent->value > 0)) return false;
  double off = std::abs(std::log(light_exponent->value));
  if (light_exponent->value < 1 && IsSharpened()) off -= PowerOfSharpening(noise_rise->value);
  return off > kMinExponent && off > kSignificant * light_exponent->sigma / light_exponent->value;
}

bool CameraResponse::LosesWeakDetail() const { return IsPositive(weak_detail_loss, kMinLoss); }
bool CameraResponse::IsSharpened() const { return IsPositive(noise_rise, kMinNoiseRise); }
bool CameraResponse::IsCompressed() const { return IsPositive(block_grid, kMinBlockGrid); }

}  // namespace thicklens::calib
