// PDF and PNG are drawn through cairo, which draws both the same way. SVG is written here: cairo's
// file would be several times as long, with the text as outlines.
#include "tools/report/target_drawing.h"

#include <cairo-pdf.h>
#include <cairo.h>
#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/target_grid.h"
#include "tools/io/png_check.h"

namespace thicklens::tools {
namespace {

constexpr double kPointsPerMm = 72 / 25.4;
constexpr double kInchesPerMetre = 1 / 0.0254;
constexpr double kMmPerMetre = 1000;
constexpr double kMaxDrawingPixels = 150e6;
constexpr int kLongestSidePx = 32767;  // the limit of cairo
constexpr double kMinFeaturePx = 2;
constexpr double kFullGrey = 255;
constexpr int kLeavesPerLook = 4096;
constexpr double kModulesOfMark = 8;

struct DestroySurface {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct DestroyContext {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};
struct DestroyFontOptions {
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};
using Surface = std::unique_ptr<cairo_surface_t, DestroySurface>;
using Context = std::unique_ptr<cairo_t, DestroyContext>;
using FontOptions = std::unique_ptr<cairo_font_options_t, DestroyFontOptions>;

void RequireSuccess(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS) {
    throw Error(fmt::format("the target could not be drawn: {}", cairo_status_to_string(status)));
  }
}

void SetGrey(cairo_t* context, int grey) {
  const double level = grey / kFullGrey;
  cairo_set_source_rgb(context, level, level, level);
}

void FillRectangle(const model::SheetRectangle& area, int grey, cairo_t* context) {
  SetGrey(context, grey);
  cairo_rectangle(context, area.x, area.y, area.width, area.height);
  cairo_fill(context);
}

void DrawTexture(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves,
                 cairo_t* context) {
  const model::SheetRectangle& pattern = page.pattern;
  cairo_save(context);
  cairo_rectangle(context, pattern.x, pattern.y, pattern.width, pattern.height);
  cairo_clip(context);
  FillRectangle(pattern, model::GreyBehindLeaves(page), context);
  // A line without length and with round ends is a disc, and a fifth of the bytes of four arcs.
  cairo_set_line_cap(context, CAIRO_LINE_CAP_ROUND);
  int drawn = 0;
  for (const model::TargetLeaf& leaf : leaves) {
    if (drawn++ % kLeavesPerLook == 0) ThrowIfCancelled();
    SetGrey(context, leaf.grey);
    cairo_set_line_width(context, 2 * leaf.radius_mm);
    cairo_move_to(context, leaf.x_mm, leaf.y_mm);
    cairo_line_to(context, leaf.x_mm, leaf.y_mm);
    cairo_stroke(context);
  }
  cairo_restore(context);
}

void DrawEdge(const model::TargetPage& page, cairo_t* context) {
  const model::SheetRectangle& patch = page.patch;
  const double bottom_mm = patch.y + patch.height;
  FillRectangle(patch, 255, context);
  SetGrey(context, 0);
  cairo_move_to(context, patch.x, patch.y);
  cairo_line_to(context, page.EdgeX(patch.y), patch.y);
  cairo_line_to(context, page.EdgeX(bottom_mm), bottom_mm);
  cairo_line_to(context, patch.x, bottom_mm);
  cairo_close_path(context);
  cairo_fill(context);
}

// Black modules of the marks, on white with a border of one module.
std::vector<model::SheetRectangle> WhiteOfMarks(const model::TargetPage& page) {
  std::vector<model::SheetRectangle> white;
  for (const model::PlacedMark& mark : page.marks) {
    const double border_mm = mark.area.width / kModulesOfMark;
    white.push_back({mark.area.x - border_mm, mark.area.y - border_mm,
                     mark.area.width + 2 * border_mm, mark.area.height + 2 * border_mm});
  }
  return white;
}

// The rectangles of the marks and the shapes of a grid, mm on the sheet.
std::vector<model::GridShape> BlackOnSheet(const model::TargetPage& page) {
  std::vector<model::GridShape> black;
  if (page.grid) {
    for (model::GridShape shape : model::BlackShapes(*page.grid)) {
      shape.x += page.pattern.x;
      shape.y += page.pattern.y;
      black.push_back(shape);
    }
  }
  for (const model::PlacedMark& mark : page.marks) {
    const auto modules = model::MarkerModules(model::kSheetDictionary, mark.number);
    const double module_mm = mark.area.width / static_cast<double>(modules.size());
    for (std::size_t i = 0; i < modules.size(); ++i) {
      for (std::size_t j = 0; j < modules[i].size();) {
        std::size_t end = j;
        while (end < modules[i].size() && modules[i][end]) ++end;
        if (end > j) {
          black.push_back({false, mark.area.x + static_cast<double>(j) * module_mm,
                           mark.area.y + static_cast<double>(i) * module_mm,
                           static_cast<double>(end - j) * module_mm, module_mm});
        }
        j = end + 1;
      }
    }
  }
  return black;
}

void DrawBlack(const model::TargetPage& page, cairo_t* context) {
  for (const model::SheetRectangle& white : WhiteOfMarks(page)) FillRectangle(white, 255, context);
  SetGrey(context, 0);
  // One path for everything, so that no seam shows where shapes touch.
  for (const model::GridShape& shape : BlackOnSheet(page)) {
    if (shape.is_disc) {
      cairo_new_sub_path(context);
      cairo_arc(context, shape.x, shape.y, 0.5 * shape.width, 0, 2 * kPi);
    } else {
      cairo_rectangle(context, shape.x, shape.y, shape.width, shape.height);
    }
  }
  cairo_fill(context);
}

void DrawCaption(const model::TargetPage& page, cairo_antialias_t antialias, cairo_t* context) {
  FillRectangle(page.bar, 0, context);
  // Letters are placed exactly as the page states, and not aligned to the pixels of a screen.
  const FontOptions options(cairo_font_options_create());
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_antialias(options.get(), antialias);
  cairo_set_font_options(context, options.get());
  cairo_select_font_face(context, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context, page.text_size_mm);
  double baseline_y_mm = page.first_baseline_y_mm;
  for (const std::string& line : page.caption) {
    cairo_move_to(context, page.bar.x, baseline_y_mm);
    cairo_show_text(context, line.c_str());
    baseline_y_mm += model::kLineHeight * page.text_size_mm;
  }
}

// Draws everything, in mm, on a surface with `units_per_mm`.
void DrawPage(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves,
              double units_per_mm, cairo_surface_t* surface) {
  const Context context(cairo_create(surface));
  cairo_scale(context.get(), units_per_mm, units_per_mm);
  const cairo_antialias_t antialias = page.two_tone ? CAIRO_ANTIALIAS_NONE : CAIRO_ANTIALIAS_GRAY;
  cairo_set_antialias(context.get(), antialias);
  FillRectangle({0, 0, page.width_mm, page.height_mm}, 255, context.get());
  if (!page.grid) {
    DrawTexture(page, leaves, context.get());
    DrawEdge(page, context.get());
  }
  DrawBlack(page, context.get());
  DrawCaption(page, antialias, context.get());
  RequireSuccess(cairo_status(context.get()));
}

std::string JoinedCaption(const model::TargetPage& page) {
  return fmt::format("{}", fmt::join(page.caption, "; "));
}

cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

std::string TargetPdf(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves) {
  std::string bytes;
  const Surface surface(cairo_pdf_surface_create_for_stream(
      Append, &bytes, page.width_mm * kPointsPerMm, page.height_mm * kPointsPerMm));
  RequireSuccess(cairo_surface_status(surface.get()));
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, "thicklens target");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_SUBJECT,
                                 JoinedCaption(page).c_str());
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "");
  DrawPage(page, leaves, kPointsPerMm, surface.get());
  cairo_surface_finish(surface.get());
  RequireSuccess(cairo_surface_status(surface.get()));
  return bytes;
}

std::string TargetSvg(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves) {
  std::string svg;
  const auto add = [&](const auto&... parts) { fmt::format_to(std::back_inserter(svg), parts...); };
  const auto add_rectangle = [&](const char* id, const model::SheetRectangle& area, int grey) {
    add("<rect id=\"{}\" x=\"{:.4f}\" y=\"{:.4f}\" width=\"{:.4f}\" height=\"{:.4f}\" "
        "fill=\"#{:02x}{:02x}{:02x}\"/>\n",
        id, area.x, area.y, area.width, area.height, grey, grey, grey);
  };
  const model::SheetRectangle& pattern = page.pattern;
  const model::SheetRectangle& patch = page.patch;
  add("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" "
      "viewBox=\"0 0 {0} {1}\">\n<title>thicklens target</title>\n<desc>{2}</desc>\n",
      page.width_mm, page.height_mm, EscapeXml(JoinedCaption(page)));
  add_rectangle("sheet", {0, 0, page.width_mm, page.height_mm}, 255);
  if (!page.grid) {
    add("<clipPath id=\"clip\"><rect x=\"{:.4f}\" y=\"{:.4f}\" width=\"{:.4f}\" "
        "height=\"{:.4f}\"/></clipPath>\n",
        pattern.x, pattern.y, pattern.width, pattern.height);
    add_rectangle("pattern", pattern, model::GreyBehindLeaves(page));
    add("<g clip-path=\"url(#clip)\">\n");
    int drawn = 0;
    for (const model::TargetLeaf& leaf : leaves) {
      if (drawn++ % kLeavesPerLook == 0) ThrowIfCancelled();
      add("<circle cx=\"{0:.4f}\" cy=\"{1:.4f}\" r=\"{2:.4f}\" fill=\"#{3:02x}{3:02x}{3:02x}\"/>\n",
          leaf.x_mm, leaf.y_mm, leaf.radius_mm, leaf.grey);
    }
    add("</g>\n");
    add_rectangle("patch", patch, 255);
    const double bottom_mm = patch.y + patch.height;
    add("<path id=\"edge\" d=\"M{0:.4f} {1:.4f}L{2:.4f} {1:.4f}L{3:.4f} {4:.4f}L{0:.4f} {4:.4f}Z\" "
        "fill=\"#000000\"/>\n",
        patch.x, patch.y, page.EdgeX(patch.y), page.EdgeX(bottom_mm), bottom_mm);
  }
  int mark = 0;
  for (const model::SheetRectangle& white : WhiteOfMarks(page))
    add_rectangle(fmt::format("mark-{}", mark++).c_str(), white, 255);
  add("<g fill=\"#000000\">\n");
  for (const model::GridShape& shape : BlackOnSheet(page)) {
    if (shape.is_disc) {
      add("<circle cx=\"{:.4f}\" cy=\"{:.4f}\" r=\"{:.4f}\"/>\n", shape.x, shape.y,
          0.5 * shape.width);
    } else {
      add("<rect x=\"{:.4f}\" y=\"{:.4f}\" width=\"{:.4f}\" height=\"{:.4f}\"/>\n", shape.x,
          shape.y, shape.width, shape.height);
    }
  }
  add("</g>\n");
  add_rectangle("bar", page.bar, 0);
  double baseline_y_mm = page.first_baseline_y_mm;
  for (const std::string& line : page.caption) {
    add("<text x=\"{:.4f}\" y=\"{:.4f}\" font-family=\"sans-serif\" font-size=\"{:.4f}\">{}"
        "</text>\n",
        page.bar.x, baseline_y_mm, page.text_size_mm, EscapeXml(line));
    baseline_y_mm += model::kLineHeight * page.text_size_mm;
  }
  return svg + "</svg>\n";
}

PngSize TargetPngSize(const model::TargetPage& page, double dots_per_inch) {
  const double pixels_per_metre = std::round(dots_per_inch * kInchesPerMetre);
  const double width_px = std::round(page.width_mm * pixels_per_metre / kMmPerMetre);
  const double height_px = std::round(page.height_mm * pixels_per_metre / kMmPerMetre);
  if (!(width_px * height_px <= kMaxDrawingPixels) || !(width_px <= kLongestSidePx) ||
      !(height_px <= kLongestSidePx)) {
    throw Error(fmt::format(
        "{:g} x {:g} mm at {:g} dpi are {:.0f} x {:.0f} px, more than {:g} million or than {} in a "
        "row: choose a smaller --dpi or --size, or write a PDF, which has no px",
        page.width_mm, page.height_mm, dots_per_inch, width_px, height_px, kMaxDrawingPixels / 1e6,
        kLongestSidePx));
  }
  const double feature_px = page.feature_mm * pixels_per_metre / kMmPerMetre;
  if (!(feature_px >= kMinFeaturePx)) {
    throw Error(
        fmt::format("features of {:g} mm are {:.2f} px at {:g} dpi, below {:g}: choose a larger "
                    "--dpi or --feature-mm, or write a PDF, which has no px",
                    page.feature_mm, feature_px, dots_per_inch, kMinFeaturePx));
  }
  return {static_cast<int>(pixels_per_metre), static_cast<int>(width_px),
          static_cast<int>(height_px)};
}

std::string TargetPng(const model::TargetPage& page, const std::vector<model::TargetLeaf>& leaves,
                      const PngSize& size) {
  model::EncodedImage image{size.width_px, size.height_px, 1, 8, {}};
  {
    const Surface surface(
        cairo_image_surface_create(CAIRO_FORMAT_RGB24, size.width_px, size.height_px));
    RequireSuccess(cairo_surface_status(surface.get()));
    DrawPage(page, leaves, size.pixels_per_metre / kMmPerMetre, surface.get());
    cairo_surface_flush(surface.get());
    const unsigned char* bytes = cairo_image_surface_get_data(surface.get());
    const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(surface.get()));
    const auto width = static_cast<std::size_t>(size.width_px);
    image.values.reserve(width * static_cast<std::size_t>(size.height_px));
    for (std::size_t y = 0; y < static_cast<std::size_t>(size.height_px); ++y) {
      ThrowIfCancelled();
      // A px of RGB24 is a word of 32 bits with blue in its lowest byte; all three colours are
      // equal.
      const auto* row = reinterpret_cast<const std::uint32_t*>(bytes + y * stride);
      for (std::size_t x = 0; x < width; ++x)
        image.values.push_back(static_cast<std::uint16_t>(row[x] & 0xFFU));
    }
  }
  return io::WithPngResolution(io::EncodePng(image), size.pixels_per_metre);
}

}  // namespace thicklens::tools
