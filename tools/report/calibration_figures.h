#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_FIGURES_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_FIGURES_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"
#include "tools/report/calibration_plots.h"
#include "tools/report/calibration_summary.h"

namespace thicklens::tools {

// One <svg> of class "plot". Its name is unique among the drawings of a calibration.
struct Drawing {
  std::string name;
  std::string svg;
};

// Drawings under one caption. Without drawings the figure is empty.
struct ReportFigure {
  std::vector<Drawing> drawings;
  std::string caption;
  bool beside = false;  // the drawings are shown side by side where there is room
};

ReportFigure FigureOf(const std::vector<Plot>& plots, const std::string& caption);

ReportFigure SharpnessFigure(const calib::Calibration& calibration,
                             const std::vector<ResultRow>& rows, const Abscissa& abscissa);
// The blur with its law, and the residuals. `truth` may be null.
std::vector<ReportFigure> BlurFigures(const calib::FocusSweep& sweep,
                                      const calib::Calibration& calibration,
                                      const std::vector<ResultRow>& rows,
                                      const model::SweepTruth* truth, const Abscissa& abscissa);
ReportFigure ReadingErrorFigure(const calib::FocusSweep& sweep,
                                const calib::Calibration& calibration, const Abscissa& abscissa);
ReportFigure ScaleFigure(const calib::FocusSweep& sweep, const calib::Calibration& calibration);
ReportFigure ExampleFigure(const calib::Calibration& calibration);
// The in-focus object distance of each tile as a colour.
ReportFigure FieldFigure(const calib::FieldMap& field);

// Names that drawings of a calibration can have.
const std::vector<std::string>& DrawingNames();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_FIGURES_H_
