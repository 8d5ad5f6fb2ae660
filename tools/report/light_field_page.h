#ifndef THICKLENS_TOOLS_REPORT_LIGHT_FIELD_PAGE_H_
#define THICKLENS_TOOLS_REPORT_LIGHT_FIELD_PAGE_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "tools/report/estimate_records.h"

namespace thicklens::tools {

// Some frames of a focus sweep.
struct SweepShot {
  cv::Mat image;  // as stored, cropped to the region that is shown
  std::string file_name;
  double reading_mm = 0;
  bool nearest_to_focus = false;
};
struct SweepStrip {
  std::string name;              // file or folder, as the user gave it
  int frame_count = 0;           // of the whole sweep
  std::vector<SweepShot> shots;  // from near to far
};

// The depth of the photograph's pixels, NaN where it is not known.
struct PageDepth {
  int width_px = 0, height_px = 0;
  std::vector<float> values;
  bool in_mm = false;  // z from the aperture; otherwise disparity in px per view step
  double v_per_u = 1;  // factor from the values, which are along u, to the disparity along v
};

// The content of a page. The page does not mention absent (null, empty) data.
struct LightFieldPageInput {
  std::string name;  // of the light field, as the user gave it
  const model::LightField* light_field = nullptr;
  const model::LightField* truth = nullptr;  // of the same views and size
  const model::LinearImage* photo = nullptr;
  std::optional<PageDepth> depth;
  std::optional<SweepStrip> sweep;
  std::string calibration;                     // from InlinedCalibrationReport
  const estimator::SceneMaps* maps = nullptr;  // maps of the photograph from the estimate
  std::vector<std::string> warnings;           // of the estimate, one line each
  // The inputs and assumptions of the estimate: names and values.
  std::vector<std::pair<std::string, std::string>> sources;
  bool mosaic = false;  // all views in one image, not some side by side
  std::optional<EstimateRecord> estimate;
  std::optional<ComparisonRecord> comparison;
  std::string version;  // of thicklens
  std::string date;     // ISO 8601
  int threads = 0;
};

struct LightFieldPage {
  std::string html;
  std::vector<std::string> sections;  // their ids, in order
};
// Makes one self-contained page without network access or scripts, with its images inside. It is
// also well-formed XML. Sections without data are left out.
LightFieldPage MakeLightFieldPage(const LightFieldPageInput& input);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_LIGHT_FIELD_PAGE_H_
