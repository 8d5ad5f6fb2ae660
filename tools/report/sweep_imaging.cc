#include "tools/report/sweep_imaging.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/focus_limits.h"
#include "tools/report/page_style.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FrameTransfer;
using nlohmann::json;

json NumberOrNone(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json ScaledJson(const model::Estimate& estimate, double factor) {
  return {{"value", NumberOrNone(factor * estimate.value)},
          {"sigma", NumberOrNone(factor * estimate.sigma)}};
}

std::string TransferOrigin(const FrameTransfer& frame) {
  return frame.is_measured ? fmt::format("measured at {} slanted edge{}", frame.edges,
                                         frame.edges == 1 ? "" : "s")
                           : "modelled from the fitted blur, not measured";
}

std::string TransferLine(const SweepImaging& imaging, const Calibration& calibration) {
  const FrameTransfer* best = BestTransfer(imaging.transfer);
  if (best == nullptr) return "";
  std::string text =
      best->is_measured
          ? fmt::format("MTF of the sharpest frame, {}",
                        PrintableUtf8(FrameName(calibration.frames[best->frame].image)))
          : std::string("MTF in the plane of focus");
  for (const auto& [name, level] : {std::pair("50 %", &best->mtf50), {"10 %", &best->mtf10}}) {
    text += *level ? fmt::format("; {} at {}", name, FrequencyText(**level, imaging.units))
                   : fmt::format("; above {} up to 1 cycle/px", name);
  }
  text += "; " + TransferOrigin(*best);
  const std::vector<std::string>& open = calibration.diagnostics.blur.undetermined;
  if (!best->is_measured && std::find(open.begin(), open.end(), "blur_floor_px") != open.end()) {
    text +=
        ", with the floor that the frames have together with the target, because the blur floor is "
        "not determined";
  }
  return text;
}

std::string PsfLine(const calib::PsfMeasurement& psf) {
  if (!psf.done) return "not measured: " + psf.message;
  return fmt::format(
      "measured from {} frames ({} nearer, {} farther than the plane of focus); sigma along x "
      "{:.3f} "
      "and along y {:.3f} of their mean",
      psf.frames, psf.nearer, psf.farther, psf.sigma_x_ratio, psf.sigma_y_ratio);
}

std::string MergeLine(const SweepImaging& imaging) {
  const calib::MergedFrames& merged = *imaging.merged;
  const std::string name = !imaging.has_focus_map ? "all-in-focus image"
                           : !imaging.has_image   ? "focus map"
                                                  : "all-in-focus image and focus map";
  if (!merged.done) return name + ": none: " + merged.message;
  return fmt::format("{}: {} frames merged{}", name, merged.frames,
                     merged.left_out > 0 ? fmt::format(", {} could not be aligned and are left out",
                                                       merged.left_out)
                                         : "");
}

json FrameTransferJson(const FrameTransfer& frame, const calib::TransferUnits& units) {
  return {{"origin", frame.is_measured ? "measured" : "modelled"},
          {"edges", frame.edges},
          {"curve", CurveJson(frame.curve)},
          {"mtf50", FrequencyJson(frame.mtf50, units)},
          {"mtf10", FrequencyJson(frame.mtf10, units)}};
}

void AddLevel(const Abscissa& abscissa, const calib::FrameMeasurement& frame,
              const std::optional<model::Estimate>& level, const char* name, PlotSeries* series) {
  if (!level) return;
  AddPoint(series, abscissa.Of(frame), level->value,
           PointName(frame, abscissa, name, level->value));
  series->y_error.push_back(level->sigma);
}

}  // namespace

const FrameTransfer* BestTransfer(const calib::SweepTransfer& transfer) {
  const FrameTransfer* best = nullptr;
  for (const FrameTransfer& frame : transfer.frames) {
    if (!frame.is_measured || !frame.mtf50) continue;
    if (best == nullptr || frame.mtf50->value > best->mtf50->value) best = &frame;
  }
  if (best != nullptr) return best;
  return transfer.at_focus ? &*transfer.at_focus : nullptr;
}

std::string FrequencyText(const model::Estimate& per_px, const calib::TransferUnits& units) {
  std::string text = per_px.sigma > 0
                         ? fmt::format("{} +- {} cycles/px", RoundedTo(per_px.value, per_px.sigma),
                                       RoundedSigma(per_px.sigma))
                         : fmt::format("{:.3g} cycles/px", per_px.value);
  if (units.sensor_lp_per_mm > 0)
    text += fmt::format(" ({:.3g} lp/mm on the sensor", units.sensor_lp_per_mm * per_px.value);
  if (units.object_lp_per_mm)
    text +=
        fmt::format(", {:.3g} lp/mm in the plane of focus", *units.object_lp_per_mm * per_px.value);
  return text + (units.sensor_lp_per_mm > 0 ? ")" : "");
}

json FrequencyJson(const std::optional<model::Estimate>& per_px,
                   const calib::TransferUnits& units) {
  if (!per_px) return nullptr;
  json out = {{"cycles_per_px", ScaledJson(*per_px, 1)},
              {"sensor_lp_per_mm", nullptr},
              {"object_lp_per_mm", nullptr}};
  if (units.sensor_lp_per_mm > 0)
    out["sensor_lp_per_mm"] = ScaledJson(*per_px, units.sensor_lp_per_mm);
  if (units.object_lp_per_mm)
    out["object_lp_per_mm"] = ScaledJson(*per_px, *units.object_lp_per_mm);
  return out;
}

json CurveJson(const calib::ModulationTransfer& curve) {
  json out = {{"frequency_cycles_per_px", json::array()},
              {"transfer", json::array()},
              {"sigma", curve.sigma.empty() ? json(nullptr) : json::array()}};
  for (std::size_t i = 0; i < curve.transfer.size(); i += 2) {
    out["frequency_cycles_per_px"].push_back(NumberOrNone(curve.frequency_per_px[i]));
    out["transfer"].push_back(NumberOrNone(curve.transfer[i]));
    if (!curve.sigma.empty()) out["sigma"].push_back(NumberOrNone(curve.sigma[i]));
  }
  return out;
}

std::string SweepImagingText(const SweepImaging& imaging, const Calibration& calibration) {
  std::string text;
  const std::string transfer = TransferLine(imaging, calibration);
  if (!transfer.empty()) text += transfer + '\n';
  if (imaging.limits) {
    for (const std::string& line : FocusLimitsLines(*imaging.limits)) text += line + '\n';
  }
  if (imaging.psf) text += "measured PSF: " + PrintableUtf8(PsfLine(*imaging.psf)) + '\n';
  if (imaging.merged) text += PrintableUtf8(MergeLine(imaging)) + '\n';
  return text;
}

void AddSweepImaging(const SweepImaging& imaging, const Calibration& calibration, json* summary) {
  json frames = json::array();
  for (const FrameTransfer& frame : imaging.transfer.frames) {
    json entry = FrameTransferJson(frame, imaging.units);
    const calib::FrameMeasurement& measured = calibration.frames[frame.frame];
    entry["image"] = PrintableUtf8(measured.image);
    entry["reading_mm"] = NumberOrNone(measured.reading_mm);
    frames.push_back(std::move(entry));
  }
  (*summary)["mtf"] = {
      {"done", imaging.transfer.done},
      {"message", PrintableUtf8(imaging.transfer.message)},
      {"in_focus", imaging.transfer.at_focus
                       ? FrameTransferJson(*imaging.transfer.at_focus, imaging.units)
                       : json(nullptr)},
      {"frames", std::move(frames)}};
  (*summary)["focus_limits"] = imaging.limits ? FocusLimitsJson(*imaging.limits) : json(nullptr);
  if (imaging.has_psf) (*summary)["measured_psf"] = nullptr;
  if (imaging.psf) {
    const calib::PsfMeasurement& psf = *imaging.psf;
    (*summary)["measured_psf"] = {{"done", psf.done},
                                  {"message", PrintableUtf8(psf.message)},
                                  {"frames", psf.frames},
                                  {"frames_nearer", psf.nearer},
                                  {"frames_farther", psf.farther},
                                  {"sigma_x_ratio", psf.sigma_x_ratio},
                                  {"sigma_y_ratio", psf.sigma_y_ratio}};
  }
  if (imaging.has_image || imaging.has_focus_map) (*summary)["all_in_focus"] = nullptr;
  if (imaging.merged) {
    (*summary)["all_in_focus"] = {{"done", imaging.merged->done},
                                  {"message", PrintableUtf8(imaging.merged->message)},
                                  {"frames", imaging.merged->frames},
                                  {"left_out", imaging.merged->left_out}};
  }
}

std::string TransferCsv(const SweepImaging& imaging, const Calibration& calibration) {
  std::vector<std::pair<std::string, const FrameTransfer*>> columns;
  if (imaging.transfer.at_focus) columns.emplace_back("in focus", &*imaging.transfer.at_focus);
  for (const FrameTransfer& frame : imaging.transfer.frames) {
    const calib::FrameMeasurement& measured = calibration.frames[frame.frame];
    std::string name =
        fmt::format("{} at {:.6g}", PrintableUtf8(FrameName(measured.image)), measured.reading_mm);
    std::replace_if(
        name.begin(), name.end(), [](char c) { return c == ',' || c == '"' || c == '\n'; }, '_');
    columns.emplace_back(std::move(name), &frame);
  }
  std::string csv = "frequency_cycles_per_px,frequency_lp_per_mm_on_sensor";
  for (const auto& [name, frame] : columns) csv += "," + name;
  csv += "\norigin,";
  for (const auto& [name, frame] : columns) csv += frame->is_measured ? ",measured" : ",modelled";
  csv += '\n';
  const std::vector<double> frequencies = calib::TransferFrequencies();
  for (std::size_t i = 0; i < frequencies.size(); ++i) {
    csv += fmt::format("{:.4g},{:.6g}", frequencies[i],
                       frequencies[i] * imaging.units.sensor_lp_per_mm);
    for (const auto& [name, frame] : columns)
      csv += fmt::format(",{:.6f}", frame->curve.transfer[i]);
    csv += '\n';
  }
  return csv;
}

ReportFigure TransferFigure(const SweepImaging& imaging, const Calibration& calibration,
                            const Abscissa& abscissa) {
  if (imaging.transfer.frames.size() < 2) return {};
  Plot focus;
  focus.id = "mtf-through-focus";
  focus.title = "MTF through focus";
  focus.x_axis.label = abscissa.label;
  focus.y_axis.label = "frequency [cycles/px]";
  focus.height_px = 290;
  PlotSeries of_half = Points("50 %, measured", Ink::kFit, Mark::kDot);
  PlotSeries of_tenth = Points("10 %, measured", Ink::kSource, Mark::kDot);
  PlotSeries half = Points("50 %, modelled", Ink::kFit, Mark::kRing);
  PlotSeries tenth = Points("10 %, modelled", Ink::kSource, Mark::kRing);
  for (const FrameTransfer& frame : imaging.transfer.frames) {
    const calib::FrameMeasurement& measured = calibration.frames[frame.frame];
    AddLevel(abscissa, measured, frame.mtf50, "MTF50 [cycles/px]",
             frame.is_measured ? &of_half : &half);
    AddLevel(abscissa, measured, frame.mtf10, "MTF10 [cycles/px]",
             frame.is_measured ? &of_tenth : &tenth);
  }
  for (PlotSeries* series : {&of_half, &of_tenth, &half, &tenth}) {
    if (!series->x.empty()) focus.series.push_back(std::move(*series));
  }
  if (focus.series.empty()) return {};
  Plot curve;
  curve.id = "mtf-in-focus";
  curve.title = "MTF in focus";
  curve.x_axis.label = "frequency [cycles/px]";
  curve.y_axis.label = "contrast";
  curve.height_px = 290;
  const auto add = [&curve](const char* label, Ink ink, Stroke stroke, const FrameTransfer& frame) {
    CurvePoints points;
    for (std::size_t i = 0; i < frame.curve.transfer.size(); ++i)
      points.emplace_back(frame.curve.frequency_per_px[i], frame.curve.transfer[i]);
    curve.series.push_back(Curve(label, ink, stroke, points));
  };
  const FrameTransfer* best = BestTransfer(imaging.transfer);
  if (best != nullptr && best->is_measured)
    add("sharpest frame, measured", Ink::kFit, Stroke::kSolid, *best);
  if (imaging.transfer.at_focus)
    add("in the plane of focus, modelled", Ink::kMuted, Stroke::kDashed,
        *imaging.transfer.at_focus);
  return FigureOf(
      {focus, curve},
      "The frequency at which the contrast falls to 50 % and to 10 % in each frame, and the curve "
      "in "
      "focus. Measured: at slanted edges of the frame (ISO 12233). Modelled: computed from the "
      "fitted blur floor, defocus and pixel, which no edge confirms. Above 0.5 cycles/px the "
      "sensor "
      "shows aliases.");
}

ReportFigure PsfFigure(const SweepImaging& imaging) {
  if (!imaging.psf || !imaging.psf->done) return {};
  const model::MeasuredPsf& psf = imaging.psf->psf;
  constexpr double kSidePx = 12;
  const auto side = static_cast<double>(psf.light.rows());
  const double largest = psf.light.maxCoeff();
  std::string svg = fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {0:.0f} {0:.0f}\" width=\"{0:.0f}\" height=\"{0:.0f}\" "
      "role=\"img\" aria-labelledby=\"psf-title\">\n<title id=\"psf-title\">Measured shape of the "
      "defocus blur</title>\n",
      kSidePx * side);
  for (Eigen::Index j = 0; j < psf.light.rows(); ++j) {
    for (Eigen::Index i = 0; i < psf.light.cols(); ++i) {
      const int grey = static_cast<int>(std::lround(255 * psf.light(j, i) / largest));
      svg += fmt::format(
          "<rect x=\"{:.0f}\" y=\"{:.0f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
          "fill=\"rgb({},{},{})\"/>",
          kSidePx * static_cast<double>(i), kSidePx * static_cast<double>(j), kSidePx + 0.5,
          kSidePx + 0.5, grey, grey, grey);
    }
  }
  svg += "</svg>\n";
  return {
      {{"psf", svg}},
      fmt::format("The measured shape of the defocus blur: the image of a point farther than the "
                  "plane of focus. A nearer point has it turned by half a turn. A square is "
                  "{:.3g} blur radii wide.",
                  psf.step),
      false};
}

std::string SweepImagingWords(const SweepImaging& imaging, const Calibration& calibration) {
  std::string items;
  const auto item = [&](const std::string& text) {
    if (!text.empty()) items += fmt::format("<li>{}</li>\n", EscapeXml(Typeset(AsSentence(text))));
  };
  item(TransferLine(imaging, calibration));
  if (imaging.limits) {
    for (const std::string& line : FocusLimitsLines(*imaging.limits)) item(line);
  }
  if (imaging.psf) item("measured PSF: " + PsfLine(*imaging.psf));
  if (imaging.merged) item(MergeLine(imaging));
  return items.empty() ? "" : "<ul>\n" + items + "</ul>\n";
}

}  // namespace thicklens::tools
