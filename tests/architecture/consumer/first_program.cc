// A whole way with the public interface: a sweep gives a camera, and a photograph with its depth a
// light field.
#include <thicklens/thicklens.h>

#include <iostream>
int main() {
  const auto sweep = thicklens::ReadSweep("sweep.yaml");
  const auto calibration = thicklens::Calibrate(sweep, {});
  thicklens::WriteCamera("camera.yaml", calibration.camera);
  const auto photo = thicklens::ReadImage("photo.png");
  const auto depth = thicklens::ReadDepth(
      "depth.png", {thicklens::DepthKind::kZ, thicklens::LengthUnit::kMillimetre});
  thicklens::EstimateOptions options;
  options.views = {7, 7};
  const auto estimate = thicklens::EstimateLightField(photo, depth, calibration.camera, options);
  thicklens::WriteLightField("light_field", estimate.light_field);
  std::cout << estimate.summary.BriefReport() << '\n';
}
