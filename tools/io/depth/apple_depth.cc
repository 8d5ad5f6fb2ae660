// The depth and disparity of Apple's cameras, in HEIC and JPEG files: an image of integers whose
// XMP states the range of the values that they stand for.
#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/embedded_parts.h"

namespace thicklens::io {
namespace {

constexpr char kPixelData[] = "http://ns.apple.com/pixeldatainfo/1.0/";
constexpr char kDepthData[] = "http://ns.apple.com/depthData/1.0/";

double PixelNumber(const XmpNode& xmp, const char* field, const std::string& meaning,
                   const std::string& name) {
  return XmpNumberOf(xmp, {kPixelData, "apdi", field}, meaning, name);
}

}  // namespace

bool IsAppleDepth(const XmpNode& xmp) {
  const std::string type = xmp.Text(kPixelData, "AuxiliaryImageType").value_or("");
  return type == "disparity" || type == "depth";
}

void TakeAppleMeaning(const XmpNode& xmp, const std::string& name, EmbeddedDepth* depth) {
  const std::string type = xmp.Text(kPixelData, "AuxiliaryImageType").value_or("");
  const bool is_disparity = type == "disparity";
  if (!is_disparity && type != "depth") {
    throw Error(fmt::format("{}: apdi:AuxiliaryImageType is '{}': disparity or depth is expected",
                            name, PrintableUtf8(type)));
  }
  const double low = PixelNumber(xmp, "FloatMinValue", "the value of the smallest number", name);
  const double high = PixelNumber(xmp, "FloatMaxValue", "the value of the largest number", name);
  if (!(high > low) || !(high > 0)) {
    throw Error(
        fmt::format("{}: apdi:FloatMinValue is {:g} and apdi:FloatMaxValue is {:g}: "
                    "FloatMinValue < FloatMaxValue, and FloatMaxValue > 0, are expected",
                    name, low, high));
  }
  const bool has_least = xmp.Find(kPixelData, "IntMinValue") != nullptr;
  const bool has_most = xmp.Find(kPixelData, "IntMaxValue") != nullptr;
  const double least = has_least ? PixelNumber(xmp, "IntMinValue", "the smallest number", name) : 0;
  const double most = has_most ? PixelNumber(xmp, "IntMaxValue", "the largest number", name)
                               : depth->map.largest_of_type.value_or(1);
  if (!(most > least)) {
    throw Error(
        fmt::format("{}: apdi:IntMinValue is {:g} and apdi:IntMaxValue is {:g}: "
                    "IntMinValue < IntMaxValue is expected",
                    name, least, most));
  }
  constexpr double kMmPerMetre = 1000;
  const double unit = is_disparity ? 1 : kMmPerMetre;
  depth->kind = is_disparity ? model::DepthKind::kInverse : model::DepthKind::kZ;
  depth->is_inverse = is_disparity;
  depth->scale = unit * (high - low) / (most - least);
  depth->offset = unit * low - depth->scale * least;
  depth->form = is_disparity ? "Apple's disparity" : "Apple's depth";
  depth->description = fmt::format("{} from {:g} to {:g} {}; {}", depth->form, low, high,
                                   is_disparity ? "1/m" : "m", depth->description);
  if (xmp.Text(kDepthData, "Accuracy").value_or("") == "relative") {
    depth->warnings.emplace_back(
        "depthData:Accuracy is relative: which point is nearer is right, but scale and offset of "
        "the depths may be wrong, and with them the disparities of the views.");
  }
}

}  // namespace thicklens::io
