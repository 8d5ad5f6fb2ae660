// Estimates the light field of one photograph from its depth map in millimetres:
//   estimate PHOTO.png DEPTH.png CAMERA.yaml LIGHT_FIELD
#include <thicklens/thicklens.h>

#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 5) {
    std::cerr << "usage: estimate PHOTO DEPTH CAMERA.yaml LIGHT_FIELD\n";
    return 2;
  }
  const auto photo = thicklens::ReadImage(argv[1]);
  const auto depth =
      thicklens::ReadDepth(argv[2], {thicklens::DepthKind::kZ, thicklens::LengthUnit::kMillimetre});
  const auto camera = thicklens::ReadCamera(argv[3]);
  thicklens::EstimateOptions options;
  options.views = {5, 5};
  thicklens::SceneSolver solver;
  solver.prior = thicklens::Prior::kTotalVariation;
  options.solver = solver;
  const auto estimate = thicklens::EstimateLightField(photo, depth, camera, options);
  thicklens::WriteLightField(argv[4], estimate);  // with the confidence of every ray
  std::cout << estimate.summary.BriefReport() << '\n';
  for (const auto& warning : estimate.summary.warnings) std::cout << warning << '\n';
} catch (const thicklens::Error& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
