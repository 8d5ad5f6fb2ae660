#ifndef THICKLENS_TOOLS_REPORT_INPUT_SUMMARY_H_
#define THICKLENS_TOOLS_REPORT_INPUT_SUMMARY_H_

#include <cstddef>
#include <nlohmann/json.hpp>
#include <opencv2/core/types.hpp>
#include <string>

#include "thicklens/sweep.h"

namespace thicklens::tools {

// The findings of a dry run, which does not measure.
struct Understanding {
  cv::Size frame_size_px;
  int frame_bits = 0, frame_channels = 0;
  double min_reading_mm = 0, max_reading_mm = 0, median_step_mm = 0;
  std::size_t distinct_readings = 0;
};

// Opens only the first frame, so that a large sweep takes no longer. Throws Error for everything
// that would stop the calibration.
Understanding Understand(const Sweep& sweep);

// Returns the line that says which readings were read, and in which unit; empty for a sweep whose
// file lists them.
std::string ReadingsLine(const Sweep& sweep);

// Returns the lines that say what the frames are corrected by; empty: they are not.
std::string CorrectionText(const Sweep& sweep);
nlohmann::json CorrectionJson(const Sweep& sweep);

// Returns the text of a dry run. `outputs` names the files that a run would write.
std::string UnderstandingText(const Sweep& sweep, const Understanding& found,
                              const std::string& method, const std::string& outputs);
nlohmann::json UnderstandingJson(const Sweep& sweep, const Understanding& found,
                                 const std::string& method);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_INPUT_SUMMARY_H_
