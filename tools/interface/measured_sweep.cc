#include "tools/interface/measured_sweep.h"

#include <cstddef>
#include <string>

#include "thicklens/base/cancel.h"
#include "thicklens/opencv.h"

namespace thicklens {
namespace {

// A sweep with too few frames is refused without opening them.
Sweep Examined(const Sweep& sweep, const RunScope& run) {
  std::string why;
  if (!calib::HasEnoughFrames(FocusSweepOf(sweep), &why)) return sweep;
  return ExamineFrames(sweep, run.control());
}

}  // namespace

MeasuredSweep MeasureSweep(const Sweep& given, bool map_field, RunScope* run) {
  const Sweep sweep = Examined(given, *run);
  for (const std::string& notice : NoticesOf(sweep)) run->Warn(notice);
  MeasuredSweep measured;
  measured.sweep = FocusSweepOf(sweep);
  if (sweep.frames == nullptr) {  // the files are hashed as they are read
    measured.files =
        std::make_shared<io::FrameFiles>(sweep.description.frames, sweep.description.full_scale);
    measured.sweep.read_frame = [files = measured.files](std::size_t i) { return files->Read(i); };
  }
  calib::CalibrationOptions settings;
  settings.map_field = map_field;
  settings.threads = run->threads();
  settings.progress = run->ProgressOf("measuring");
  measured.calibration = calib::Calibrate(measured.sweep, settings);
  ThrowIfCancelled();
  return measured;
}

}  // namespace thicklens
