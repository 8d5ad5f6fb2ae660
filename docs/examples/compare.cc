// Compares an estimated light field with the true one, view by view:
//   compare TRUE_LIGHT_FIELD LIGHT_FIELD
#include <thicklens/thicklens.h>

#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: compare TRUE_LIGHT_FIELD LIGHT_FIELD\n";
    return 2;
  }
  const auto reference = thicklens::ReadLightField(argv[1]);
  const auto estimate = thicklens::ReadLightField(argv[2]);
  thicklens::CompareOptions options;
  options.border_px = 8;
  const auto scores = thicklens::CompareLightFields(reference, estimate, options);
  std::cout << scores.BriefReport() << '\n';
  for (const auto& view : scores.views) {
    std::cout << "view (" << view.k << ", " << view.l << "): " << view.scores.psnr_db << " dB\n";
  }
} catch (const thicklens::Error& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
