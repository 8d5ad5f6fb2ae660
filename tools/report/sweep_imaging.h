#ifndef THICKLENS_TOOLS_REPORT_SWEEP_IMAGING_H_
#define THICKLENS_TOOLS_REPORT_SWEEP_IMAGING_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/frame_merge.h"
#include "thicklens/calib/psf_measurement.h"
#include "thicklens/calib/sweep_transfer.h"
#include "thicklens/model/depth_of_field.h"
#include "tools/report/calibration_figures.h"

namespace thicklens::tools {

// The properties of the camera's images that a calibrated sweep shows, beside the fit.
struct SweepImaging {
  calib::SweepTransfer transfer;
  calib::TransferUnits units;
  std::optional<model::FocusLimits> limits;  // absent: d1 or kappa is not known
  // Results that were asked for.
  bool has_psf = false, has_image = false, has_focus_map = false;
  std::optional<calib::PsfMeasurement> psf;   // absent: not asked for, or the sweep was refused
  std::optional<calib::MergedFrames> merged;  // likewise, without the images
};

// The frame with the best measured MTF or, if none was measured, the modelled one in the plane of
// focus; null: there is none.
const calib::FrameTransfer* BestTransfer(const calib::SweepTransfer& transfer);

// A frequency, cycles per px, with its error, and in line pairs per mm on the sensor and in the
// plane of focus: "0.312 +- 0.004 cycles/px (70.1 lp/mm on the sensor, 12.4 lp/mm in the plane of
// focus)".
std::string FrequencyText(const model::Estimate& per_px, const calib::TransferUnits& units);
nlohmann::json FrequencyJson(const std::optional<model::Estimate>& per_px,
                             const calib::TransferUnits& units);
// The curve up to 1 cycle per px, every second frequency.
nlohmann::json CurveJson(const calib::ModulationTransfer& curve);

// The findings for the terminal, one line each.
std::string SweepImagingText(const SweepImaging& imaging, const calib::Calibration& calibration);
// Adds the keys "mtf" and "focus_limits" to a summary and, if they were asked for, "measured_psf"
// and "all_in_focus", which are null after a refusal.
void AddSweepImaging(const SweepImaging& imaging, const calib::Calibration& calibration,
                     nlohmann::json* summary);

// The MTF as a table: one row per frequency, one column per frame, with what each was computed
// from.
std::string TransferCsv(const SweepImaging& imaging, const calib::Calibration& calibration);
// Name of that table in the folder of the figures.
inline constexpr char kTransferTable[] = "mtf.csv";

// Contrast at the levels through focus, and the curve of the best frame.
ReportFigure TransferFigure(const SweepImaging& imaging, const calib::Calibration& calibration,
                            const Abscissa& abscissa);
// The measured PSF as squares of grey.
ReportFigure PsfFigure(const SweepImaging& imaging);
// The lines that the page shows beside the figures, as HTML.
std::string SweepImagingWords(const SweepImaging& imaging, const calib::Calibration& calibration);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_SWEEP_IMAGING_H_
