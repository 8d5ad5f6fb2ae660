#ifndef THICKLENS_TOOLS_REPORT_TARGET_DRAWING_H_
#define THICKLENS_TOOLS_REPORT_TARGET_DRAWING_H_

#include <string>
#include <vector>

#include "thicklens/model/target_page.h"
#include "thicklens/model/target_texture.h"

namespace thicklens::tools {

// Return the bytes of a file that shows the target at true scale. Equal pages give equal bytes on
// one machine; text in PDF and PNG uses the sans serif font of the machine.
std::string TargetPdf(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves);
std::string TargetSvg(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves);

// Image size at a resolution. PNG states whole px per metre, and the image is drawn at the stated
// resolution, so that its scale is true to half a px over the sheet.
struct PngSize {
  int pixels_per_metre = 0;
  int width_px = 0;
  int height_px = 0;
};
// Throws Error for too many px, or too few for the smallest feature.
PngSize TargetPngSize(const model::TargetPage& page, double dots_per_inch);
std::string TargetPng(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves,
                      const PngSize& size);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_TARGET_DRAWING_H_
