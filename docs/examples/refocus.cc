// Refocuses a light field at a disparity, and renders the photograph that its aperture would take:
//   refocus LIGHT_FIELD DISPARITY_PX REFOCUSED.png PHOTOGRAPH.png
#include <thicklens/thicklens.h>

#include <cstdlib>
#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 5) {
    std::cerr << "usage: refocus LIGHT_FIELD DISPARITY_PX REFOCUSED.png PHOTOGRAPH.png\n";
    return 2;
  }
  const auto light_field = thicklens::ReadLightField(argv[1]);
  thicklens::FocusOptions focus;
  focus.disparity_px = std::strtod(argv[2], nullptr);  // px per view step; near is positive
  thicklens::WriteImage(argv[3], thicklens::Refocus(light_field, focus));
  thicklens::ImageFileOptions file;
  file.bits = 16;
  thicklens::WriteImage(argv[4], thicklens::RenderPhotograph(light_field), file);
} catch (const thicklens::Error& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
