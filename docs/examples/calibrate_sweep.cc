// Calibrates a camera from a focus sweep:
//   calibrate_sweep SWEEP.yaml CAMERA.yaml
#include <thicklens/thicklens.h>

#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: calibrate_sweep SWEEP.yaml CAMERA.yaml\n";
    return 2;
  }
  const auto sweep = thicklens::ReadSweep(argv[1]);
  thicklens::CalibrateOptions options;
  options.map_field = false;  // no tilt and no focus per colour: faster
  thicklens::RunControl run;
  run.progress = [](const thicklens::Progress& progress) {
    std::cerr << '\r' << progress.stage << ' ' << 100 * progress.done / progress.total << " %";
  };
  const auto calibration = thicklens::Calibrate(sweep, options, run);
  thicklens::WriteCamera(argv[2], calibration.camera);
  std::cout << '\n' << calibration.summary.BriefReport() << '\n';
  for (const auto& frame : calibration.frames) {
    if (!frame.rejection.empty()) std::cout << frame.image << ": " << frame.rejection << '\n';
  }
} catch (const thicklens::Error& error) {  // also a sweep that determines no camera
  std::cerr << error.what() << '\n';
  return 1;
}
