#include "tools/interface/measured_sweep.h"

#include <fmt/format.h>

#include <cstddef>
#include <string>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/io/image_file.h"
#include "thicklens/opencv.h"
#include "tools/interface/green_plane.h"

namespace thicklens {
namespace {

// A sweep with too few frames is refused without opening them.
Sweep Examined(const Sweep& sweep, const RunScope& run) {
  std::string why;
  if (!calib::HasEnoughFrames(FocusSweepOf(sweep), &why)) return sweep;
  return ExamineFrames(sweep, run.control());
}

// Returns the green plane unless the raw file has another size than the sensor.
cv::Mat OfHalfTheSensor(cv::Mat plane, const model::Sensor& sensor, const std::string& name) {
  if (plane.cols == sensor.width_px / 2 && plane.rows == sensor.height_px / 2) return plane;
  throw Error(
      fmt::format("{}: its green plane has {} x {} px, half of the raw file's active area, "
                  "but the camera's sensor has {} x {} px: the areas must be equal",
                  name, plane.cols, plane.rows, sensor.width_px, sensor.height_px));
}

}  // namespace

MeasuredSweep MeasureSweep(const Sweep& given, bool map_field, RunScope* run) {
  const Sweep sweep = Examined(given, *run);
  for (const std::string& notice : NoticesOf(sweep)) run->Warn(notice);
  MeasuredSweep measured;
  measured.sweep = FocusSweepOf(sweep);
  const bool is_green = sweep.description.raw == model::SweepRaw::kGreen;
  if (is_green && sweep.frames != nullptr) {
    throw OptionError("raw",
                      "raw: the green sites of a mosaic are in raw files only; these frames are no "
                      "files");
  }
  if (sweep.frames == nullptr) {  // the files are hashed as they are read
    measured.files = std::make_shared<io::FrameFiles>(
        sweep.description.frames, sweep.description.full_scale,
        is_green ? io::RawTreatment::kMosaicGreen : io::RawTreatment::kDemosaiced);
  }
  if (measured.files != nullptr && !is_green)
    measured.sweep.read_frame = [files = measured.files](std::size_t i) { return files->Read(i); };
  calib::CalibrationOptions settings;
  settings.map_field = map_field;
  settings.threads = run->threads();
  settings.progress = run->ProgressOf("measuring");
  if (is_green) {
    std::string why;  // in pixels of the sensor
    if (!measured.sweep.IsValid(&why)) throw Error("sweep: " + why);
    calib::FocusSweep green = GreenPlaneSweep(measured.sweep);
    green.correction = sweep.correction;
    green.read_frame = [files = measured.files, &green,
                        &sensor = measured.sweep.camera.sensor](std::size_t i) {
      return OfHalfTheSensor(files->Read(i), sensor, green.frames[i].Name());
    };
    measured.calibration = calib::Calibrate(green, settings);
    ConvertToSensorPixels(&measured.calibration);
  } else {
    measured.calibration = calib::Calibrate(measured.sweep, settings);
  }
  ThrowIfCancelled();
  return measured;
}

}  // namespace thicklens
