#include "tools/report/calibration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_figures.h"
#include "tools/report/distortion_words.h"
#include "tools/report/page_style.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;

constexpr char kFigureFolder[] = "figures";

// Numbers the figures in the order in which they are added.
class Figures {
 public:
  void Add(ReportFigure figure) {
    if (figure.drawings.empty()) return;
    html_ += fmt::format("<figure>\n{}", figure.beside ? "<div class=\"beside\">\n" : "");
    for (Drawing& drawing : figure.drawings) {
      html_ += drawing.svg;
      names_.push_back(drawing.name + ".svg");
      files_.push_back({names_.back(), SvgFile(drawing.svg)});
    }
    const std::string number = fmt::format("Figure {}", ++count_);
    captions_ += fmt::format("{} ({}): {}\n", number, fmt::join(names_, ", "), figure.caption);
    names_.clear();
    html_ += fmt::format("{}<figcaption><b>{}.</b> {}</figcaption>\n</figure>\n",
                         figure.beside ? "</div>\n" : "", number, EscapeXml(figure.caption));
  }

  // Returns the HTML that was added since the last call.
  std::string TakeHtml() { return std::exchange(html_, ""); }
  const std::string& captions() const { return captions_; }
  std::vector<ReportFile> TakeFiles() { return std::move(files_); }

 private:
  std::string html_, captions_;
  std::vector<std::string> names_;
  std::vector<ReportFile> files_;
  int count_ = 0;
};

std::string AssumedWords(const model::Camera& camera) {
  const std::vector<std::string> fields = model::AssumedFields(camera);
  if (fields.empty()) return "";
  return fmt::format(
      "<p>Assumed in the camera file, neither published by the manufacturer nor measured: "
      "{}.</p>\n",
      EscapeXml(fmt::format("{}", fmt::join(fields, ", "))));
}

std::string CameraRow(const model::Camera& camera, const char* label, const std::string& field,
                      double value) {
  std::string remark;
  const auto statement = camera.statements.find(field);
  if (statement != camera.statements.end()) {
    if (statement->second.tolerance > 0)
      remark = fmt::format("± {:.3g}", statement->second.tolerance);
    if (statement->second.assumed) remark += remark.empty() ? "assumed" : ", assumed";
  }
  return fmt::format("<tr><th scope=\"row\">{}</th>", EscapeXml(label)) +
         TableCell(fmt::format("{:.6g}", value)) + TableCell(remark, "soft") + "</tr>\n";
}

std::string HowItWasMade(const FocusSweep& sweep, const Calibration& calibration,
                         const ReportOrigin& origin) {
  const model::Camera& camera = sweep.camera;
  std::string html =
      "<h2>How it was made</h2>\n<div class=\"wide\"><table>\n<thead><tr><th>given camera "
      "parameter</th><th class=\"number\">value</th><th>tolerance</th></tr></thead>\n<tbody>\n";
  if (const auto& objective = camera.objective) {
    html += CameraRow(camera, "magnification of the objective", "lens.magnification",
                      objective->magnification);
    html += CameraRow(camera, "numerical aperture", "lens.numerical_aperture",
                      objective->numerical_aperture);
    html += CameraRow(camera, "focal length of the tube lens [mm]",
                      "lens.tube_lens_focal_length_mm", objective->tube_lens_focal_length_mm);
  }
  html += CameraRow(camera, "front focal length f1 [mm]", "lens.front_focal_length_mm",
                    camera.lens.front_focal_length_mm);
  html += CameraRow(camera, "rear focal length f2 [mm]", "lens.rear_focal_length_mm",
                    camera.lens.rear_focal_length_mm);
  html += CameraRow(camera, "lens thickness rho [mm]", "lens.lens_thickness_mm",
                    camera.lens.lens_thickness_mm);
  html += CameraRow(camera, "aperture radius r [mm]", "lens.aperture_radius_mm",
                    camera.lens.aperture_radius_mm);
  html += CameraRow(camera, "pixel pitch p [mm]", "sensor.pixel_pitch_mm",
                    camera.sensor.pixel_pitch_mm);
  html += "</tbody></table></div>\n" + AssumedWords(camera) + "<ul>\n";
  const auto item = [&](const std::string& text) {
    html += fmt::format("<li>{}</li>\n", EscapeXml(text));
  };
  item(fmt::format("Camera {}: {} × {} px, transfer {}, point spread function {}.", camera.name,
                   camera.sensor.width_px, camera.sensor.height_px, camera.sensor.transfer.Name(),
                   model::PsfName(camera.psf)));
  if (camera.distortion) {
    item(fmt::format("The distortion of the lens was taken out of the frames: {}.",
                     DistortionWords(*camera.distortion)));
  }
  if (!sweep.frames.empty()) {
    const auto [lo, hi] =
        std::minmax_element(sweep.frames.begin(), sweep.frames.end(),
                            [](const model::SweepFrame& a, const model::SweepFrame& b) {
                              return a.reading_mm < b.reading_mm;
                            });
    item(
        fmt::format("{} frames, the {} moves{}, bench readings {:.6g} to {:.6g} mm, direction {}, "
                    "standard deviation of a reading {}.",
                    sweep.frames.size(), model::SweepMotionName(calibration.diagnostics.moves),
                    calibration.diagnostics.moves_is_recognised ? " (recognised, not stated)" : "",
                    lo->reading_mm, hi->reading_mm, model::BenchDirectionName(sweep.direction),
                    origin.reading_sigma_stated ? fmt::format("{:.3g} mm", sweep.reading_sigma_mm)
                                                : std::string("not stated")));
  }
  item(sweep.offset_mm ? fmt::format("Bench offset given: {:.6g} ± {:.3g} mm.",
                                     sweep.offset_mm->value, sweep.offset_mm->sigma)
       : calibration.diagnostics.bench_offset_from.empty()
           ? std::string("Bench offset not given, and not determined.")
           : fmt::format("Bench offset not given: determined by {}.",
                         calibration.diagnostics.bench_offset_from));
  if (sweep.floor.given_px)
    item(fmt::format("Blur floor given: {:.4g} ± {:.3g} px.", sweep.floor.given_px->value,
                     sweep.floor.given_px->sigma));
  else if (sweep.floor.from_px && sweep.floor.to_px)
    item(fmt::format("Blur floor given as an interval: {:.4g} to {:.4g} px.", *sweep.floor.from_px,
                     *sweep.floor.to_px));
  else
    item("Blur floor not given.");
  item(fmt::format("Target: {}{}.", model::SweepTargetName(sweep.target),
                   sweep.target_period_mm
                       ? fmt::format(", with a period of {:.6g} mm", *sweep.target_period_mm)
                       : ""));
  item(fmt::format("thicklens {}, {}; the calibration took {:.1f} s.", origin.version, origin.date,
                   calibration.summary.seconds));
  for (const std::string& note : origin.notes) item(note);
  html += "</ul>\n";
  return html;
}

std::string FieldSection(const Calibration& calibration, Figures* figures) {
  figures->Add(FieldFigure(calibration.diagnostics.field));
  const std::string content = figures->TakeHtml() + FieldWords(calibration);
  if (!content.empty()) return "<h2>Over the field</h2>\n" + content;
  if (calibration.diagnostics.field.message == calib::FieldMap().message) return "";
  return fmt::format("<h2>Over the field</h2>\n<p>No map: {}</p>\n",
                     EscapeXml(calibration.diagnostics.field.message));
}

std::string ImagingSection(const Calibration& calibration, const SweepImaging& imaging,
                           Figures* figures) {
  figures->Add(TransferFigure(imaging, calibration, AbscissaOf(calibration)));
  figures->Add(PsfFigure(imaging));
  const std::string content = SweepImagingWords(imaging, calibration) + figures->TakeHtml();
  return content.empty() ? "" : "<h2>Resolution and depth of field</h2>\n" + content;
}

std::string MeasuredSection(const FocusSweep& sweep, const Calibration& calibration,
                            const std::vector<ResultRow>& rows, const model::SweepTruth* truth,
                            Figures* figures) {
  const Abscissa abscissa = AbscissaOf(calibration);
  figures->Add(SharpnessFigure(calibration, rows, abscissa));
  for (ReportFigure& figure : BlurFigures(sweep, calibration, rows, truth, abscissa))
    figures->Add(std::move(figure));
  figures->Add(ReadingErrorFigure(sweep, calibration, abscissa));
  figures->Add(ExampleFigure(calibration));
  figures->Add(ScaleFigure(sweep, calibration));
  const std::string html = figures->TakeHtml();
  return html.empty() ? "" : "<h2>What was measured</h2>\n" + html;
}

}  // namespace

CalibrationReport MakeCalibrationReport(const FocusSweep& sweep, const Calibration& calibration,
                                        const model::SweepTruth* truth, const ReportOrigin& origin,
                                        const FrameImages& images, const SweepImaging* imaging) {
  const std::vector<ResultRow> rows = ResultRows(calibration, truth);
  const std::string title = "Calibration of " + sweep.camera.name;
  const std::string about = fmt::format("Focus sweep {}, {} frames · {}", origin.sweep_name,
                                        sweep.frames.size(), origin.date);
  Figures figures;
  CalibrationReport report;
  report.html = PageHead(kCalibrationPage, title, SvgPlotStyle());
  report.html += fmt::format("<h1>{}</h1>\n<p class=\"under-title\">{}</p>\n", EscapeXml(title),
                             EscapeXml(about));
  report.html += VerdictSection(sweep, calibration);
  report.html += ResultsSection(rows, truth != nullptr);
  report.html += SystematicSection(sweep, calibration, truth != nullptr);
  report.html += OtherWaysSection(calibration, rows);
  report.html += MeasuredSection(sweep, calibration, rows, truth, &figures);
  report.html += FieldSection(calibration, &figures);
  if (imaging != nullptr) report.html += ImagingSection(calibration, *imaging, &figures);
  report.html += RejectedSection(sweep, calibration, images);
  report.html += CorrelationSection(calibration);
  report.html += HowItWasMade(sweep, calibration, origin);
  report.html += "</main>\n</body>\n</html>\n";
  report.figures = figures.TakeFiles();
  report.captions =
      fmt::format("{}\n{}\n\n{}", PrintableUtf8(title), PrintableUtf8(about), figures.captions());
  return report;
}

std::vector<std::string> ReportFigureNames() {
  std::vector<std::string> names;
  for (const std::string& name : DrawingNames()) names.push_back(name + ".svg");
  names.emplace_back(kTransferTable);
  return names;
}

}  // namespace thicklens::tools
