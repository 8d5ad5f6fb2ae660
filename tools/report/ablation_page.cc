#include "tools/report/ablation_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core/mat.hpp>

#include "thicklens/base/printable_text.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/io/simulated_sweep.h"
#include "tools/report/light_field_figures.h"
#include "tools/report/page_figures.h"
#include "tools/report/page_images.h"
#include "tools/report/page_style.h"
#include "tools/report/svg_plot.h"
#include "tools/system/build_info.h"

namespace thicklens::tools {
namespace {

constexpr int kColumns = 3;
constexpr int kLongestEdgePx = 640;
// A change that is invisible in an image of 8 bits.
constexpr double kSeenGreyLevels = 0.5;

// Returns the largest absolute value, without the largest hundredth.
double RangeOf(const std::vector<float>& values) {
  std::vector<float> sizes(values.size());
  std::transform(values.begin(), values.end(), sizes.begin(),
                 [](float value) { return std::abs(value); });
  const auto place = static_cast<std::ptrdiff_t>(sizes.size() - 1 - sizes.size() / 100);
  std::nth_element(sizes.begin(), sizes.begin() + place, sizes.end());
  constexpr double kMin = 1e-3;
  return std::max(kMin, static_cast<double>(sizes[static_cast<std::size_t>(place)]));
}

std::string DifferenceCell(const model::AblatedEffect& effect) {
  const model::DifferenceImage& shown = effect.difference;
  if (effect.absent || shown.grey_levels.empty()) return "";
  const double range = RangeOf(shown.grey_levels);
  const std::string name = model::EffectName(effect.effect);
  const cv::Mat map =
      GreyMapped(shown.grey_levels, shown.width_px, shown.height_px, range, kLongestEdgePx);
  return Cell(EmbeddedImage(map, "change of " + shown.of + " without " + name, Packing::kSmall,
                            PlacePx(kColumns)),
              fmt::format("{}: white +{:.2g}, black -{:.2g} grey levels{}", name, range, range,
                          shown.of == "the image" ? "" : "; " + shown.of));
}

template <typename Effect>
std::string Differences(const std::vector<Effect>& effects, const std::string& first,
                        const std::string& title, const std::string& caption) {
  std::string cells = first;
  for (const Effect& effect : effects) cells += DifferenceCell(effect);
  return cells.empty() ? "" : Figure(Grid(kColumns, cells), title, caption);
}

std::string ImageCell(const model::EncodedImage& image) {
  cv::Mat stored(image.height_px, image.width_px, CV_16UC(image.channels),
                 const_cast<std::uint16_t*>(image.values.data()));  // NOLINT: only read
  cv::Mat shown;
  stored.convertTo(shown, CV_8U, 255 / image.full_scale());
  return Cell(
      EmbeddedImage(shown, "the image with all effects", Packing::kSmall, PlacePx(kColumns)),
      "the image with all effects");
}

// Formats a cell typographically.
std::string TypesetCell(const std::string& cell) {
  if (cell == "-") return "–";
  if (cell.rfind("+-", 0) == 0) return "±" + cell.substr(2);
  return TrueMinus(cell);
}

std::string TableHtml(const Ablation& ablation) {
  const AblationTable table = TableOf(ablation);
  std::string groups, names;
  for (std::size_t i = 0; i < table.columns.size();) {
    const std::string& group = table.columns[i].group;
    int span = 0;
    for (; i < table.columns.size() && table.columns[i].group == group; ++i, ++span) {
      names += fmt::format("<th class=\"number\">{}</th>", EscapeXml(table.columns[i].name));
    }
    groups += fmt::format("<th class=\"number\" colspan=\"{}\">{}</th>", span, EscapeXml(group));
  }
  std::string html = fmt::format(
      "<div class=\"wide\"><table>\n<thead><tr><th></th>{}</tr>\n<tr><th>without</th>{}</tr>"
      "</thead>\n<tbody>\n",
      groups, names);
  for (const AblationTable::Line& line : table.lines) {
    html += fmt::format("<tr><th scope=\"row\">{}</th>", EscapeXml(line.name));
    for (const std::string& cell : line.cells) html += TableCell(EscapeXml(TypesetCell(cell)));
    html += "</tr>\n";
  }
  html += "</tbody></table></div>\n";
  for (const std::string& note : AblationNotes(ablation)) {
    html += fmt::format("<p class=\"soft\">{}</p>\n", EscapeXml(TrueMinus(note)));
  }
  return html;
}

// Answers the main questions about the table.
std::string Verdict(const Ablation& ablation) {
  const std::vector<AblationRow> rows = RowsOf(ablation);
  std::string seen, unseen;
  for (const AblationRow& row : rows) {
    const bool is_seen =
        !row.image().absent && row.image().image.largest_grey_levels > kSeenGreyLevels;
    std::string& list = is_seen ? seen : unseen;
    list += (list.empty() ? "" : ", ") + model::EffectName(row.effect);
  }
  std::string html =
      fmt::format("<div class=\"verdict plain\">\n<p class=\"outcome\">{}</p>\n",
                  EscapeXml(seen.empty() ? "No effect is visible here" : "Visible here: " + seen));
  if (!unseen.empty()) {
    html += fmt::format("<p>At most half a grey level everywhere: {}.</p>\n", EscapeXml(unseen));
  }
  if (ablation.scene) {
    const model::AblatedSceneEffect* worst = nullptr;
    for (const model::AblatedSceneEffect& effect : ablation.scene->effects) {
      if (effect.ignored_db && (worst == nullptr || *effect.ignored_db < *worst->ignored_db)) {
        worst = &effect;
      }
    }
    html += fmt::format(
        "<p>The PSNR of the estimated views is {:.2f} dB.{}</p>\n",
        ablation.scene->light_field_psnr_db,
        worst == nullptr
            ? ""
            : TrueMinus(fmt::format(" Of the effects that an estimate can ignore, {} has the "
                                    "largest impact: {:+.2f} dB.",
                                    model::EffectName(worst->effect), *worst->ignored_db)));
  }
  if (ablation.sweep) {
    const model::SweepAblation& sweep = *ablation.sweep;
    const auto moved_mm = [&](const model::AblatedSweepEffect& effect) {
      return effect.calibration ? std::abs(effect.calibration->image_distance_mm -
                                           sweep.calibration.image_distance_mm)
                                : -1;
    };
    const auto most = std::max_element(
        sweep.effects.begin(), sweep.effects.end(),
        [&](const model::AblatedSweepEffect& a, const model::AblatedSweepEffect& b) {
          return moved_mm(a) < moved_mm(b);
        });
    if (most != sweep.effects.end() && moved_mm(*most) > 0) {
      html += fmt::format(
          "<p>The largest change of the calibrated d1 is by {}: {:.2g} µm, with a standard error "
          "of {:.2g} "
          "µm.</p>\n",
          model::EffectName(most->effect), 1000 * moved_mm(*most),
          1000 * sweep.calibration.image_distance_sigma_mm);
    }
  }
  return html + "</div>\n";
}

std::string Section(const std::string& id, const std::string& heading, const std::string& content) {
  if (content.empty()) return "";
  return fmt::format("<section id=\"{}\">\n<h2>{}</h2>\n{}</section>\n", id, EscapeXml(heading),
                     content);
}

}  // namespace

std::string AblationPage(const Ablation& ablation, const std::string& name,
                         const std::string& version, const std::string& date) {
  constexpr char kTitle[] = "What each effect changes";
  std::string html = PageHead("ablation", kTitle, SvgPlotStyle() + LightFieldFigureStyle());
  html += fmt::format(
      "<h1>{}</h1>\n<p class=\"under-title\">{}</p>\n", kTitle,
      EscapeXml(fmt::format("{} · thicklens {} · {}", PrintableUtf8(name), version, date)));
  html += Verdict(ablation);
  html += Section("table", "All effects", TableHtml(ablation));
  const std::string caption =
      "The image without the effect minus the one with it, mean of the channels; mid grey means "
      "no change, and each map has its own scale.";
  if (ablation.scene) {
    html += Section("image", "In the image",
                    Differences(ablation.scene->effects, ImageCell(ablation.scene->image),
                                "What each effect changes in the image", caption));
  }
  if (ablation.sweep) {
    html += Section(
        "sweep", "In the sweep",
        Differences(ablation.sweep->effects, "",
                    "What each effect changes in the frame where it changes most", caption));
  }
  return html + "</main>\n</body>\n</html>\n";
}

void WriteAblation(const Ablation& ablation, const std::string& name, OutputFolder* folder) {
  folder->Write(kAblationPage, AblationPage(ablation, name, Version(), NowIso8601()));
  folder->Write(kAblationTable, AblationCsv(ablation));
}

}  // namespace thicklens::tools
