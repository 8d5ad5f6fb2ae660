#include "thicklens/calib/camera_response.h"

#include <cmath>

namespace thicklens::calib {
namespace {

bool IsPositive(const std::optional<model::Estimate>& found, double least) {
  return found && found->value > least &&
         found->value > CameraResponse::kSignificant * found->sigma;
}

}  // namespace

bool CameraResponse::ContradictsTransfer() const {
  if (!light_exponent || !(light_exponent->value > 0)) return false;
  const double off = std::abs(std::log(light_exponent->value));
  return off > kMinExponent && off > kSignificant * light_exponent->sigma / light_exponent->value;
}

bool CameraResponse::LosesWeakDetail() const { return IsPositive(weak_detail_loss, kMinLoss); }
bool CameraResponse::IsSharpened() const { return IsPositive(noise_rise, kMinNoiseRise); }
bool CameraResponse::IsCompressed() const { return IsPositive(block_grid, kMinBlockGrid); }

}  // namespace thicklens::calib
