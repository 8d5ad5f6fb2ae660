#include "thicklens/calib/focus_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <set>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/calib/frame_correction.h"
#include "thicklens/model/undistort.h"

namespace thicklens::calib {
namespace {

using DecodeTable = std::vector<float>;

DecodeTable MakeDecodeTable(const model::TransferCurve& transfer, std::size_t levels) {
  DecodeTable table(levels);
  for (std::size_t i = 0; i < levels; ++i) {
    table[i] = static_cast<float>(
        transfer.Decode(static_cast<double>(i) / static_cast<double>(levels - 1)));
  }
  return table;
}

// Returns the table from encoded values to linear light. It is kept for the next frame, which is
// usually from the same camera.
std::shared_ptr<const DecodeTable> DecodeTableOf(const model::TransferCurve& transfer,
                                                 std::size_t levels) {
  struct Kept {
    model::TransferCurve transfer;
    std::shared_ptr<const DecodeTable> table;
  };
  static std::mutex mutex;
  static Kept kept_bytes, kept_words;
  const std::lock_guard<std::mutex> lock(mutex);
  Kept& kept = levels == 256 ? kept_bytes : kept_words;
  if (!kept.table || !(kept.transfer == transfer))
    kept = {transfer, std::make_shared<const DecodeTable>(MakeDecodeTable(transfer, levels))};
  return kept.table;
}

template <typename Value>
void DecodeGrey(const cv::Mat& stored, const DecodeTable& decode, cv::Mat* grey) {
  const int channels = stored.channels();
  for (int y = 0; y < stored.rows; ++y) {
    ThrowIfCancelled();
    const auto* in = stored.ptr<Value>(y);
    auto* out = grey->ptr<float>(y);
    for (int x = 0; x < stored.cols; ++x, in += channels) {
      out[x] = channels < 3
                   ? decode[in[0]]
                   : 0.2126F * decode[in[0]] + 0.7152F * decode[in[1]] + 0.0722F * decode[in[2]];
    }
  }
}

template <typename Value>
void DecodeChannel(const cv::Mat& stored, int channel, const DecodeTable& decode, cv::Mat* light) {
  const int channels = stored.channels();
  for (int y = 0; y < stored.rows; ++y) {
    ThrowIfCancelled();
    const auto* in = stored.ptr<Value>(y) + channel;
    auto* out = light->ptr<float>(y);
    for (int x = 0; x < stored.cols; ++x, in += channels) out[x] = decode[*in];
  }
}

cv::Mat DecodedChannel(const cv::Mat& stored, const model::TransferCurve& transfer, int channel) {
  const bool bytes = stored.depth() == CV_8U;
  const auto decode = DecodeTableOf(transfer, bytes ? 256 : 65536);
  cv::Mat light(stored.size(), CV_32F);
  if (bytes) {
    DecodeChannel<std::uint8_t>(stored, channel, *decode, &light);
  } else {
    DecodeChannel<std::uint16_t>(stored, channel, *decode, &light);
  }
  return light;
}

// Throws Error if the sweep's correction is not for frames like this one.
void RequireCorrectionOf(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index) {
  const FrameCorrection& correction = *sweep.correction;
  const int colours = stored.channels() == 4 ? 3 : stored.channels();
  const bool fits = correction.size_px().empty() ||
                    (correction.size_px() == stored.size() &&
                     (correction.channels() <= 1 || correction.channels() == colours));
  if (fits) return;
  throw Error(
      fmt::format("{}: the frame has {} x {} px and {} colour channel(s), but its dark, flat or "
                  "defects have {} "
                  "x {} px and {}",
                  sweep.frames[index].Name(), stored.cols, stored.rows, colours,
                  correction.size_px().width, correction.size_px().height, correction.channels()));
}

// The region of a whole frame; a defect at its border is replaced from both sides.
cv::Mat RegionOfLight(const cv::Mat& light, const model::RegionOfInterest& roi) {
  return roi.width > 0 ? light(cv::Rect(roi.x, roi.y, roi.width, roi.height)).clone() : light;
}

// One channel of a whole frame, corrected except for its defects.
cv::Mat CorrectedChannel(const cv::Mat& stored, const FocusSweep& sweep, int channel) {
  cv::Mat light = DecodedChannel(stored, sweep.camera.sensor.transfer, channel);
  sweep.correction->Apply(channel, &light);
  return light;
}

// The region of a whole frame without the distortion of the lens. The region lies where the frame
// shows it (MakeFocusSweep).
cv::Mat UndistortedRegion(const cv::Mat& light, const FocusSweep& sweep) {
  const model::RegionOfInterest& roi = sweep.roi;
  const model::PixelRect part = roi.width > 0
                                    ? model::PixelRect{roi.x, roi.y, roi.width, roi.height}
                                    : model::PixelRect{0, 0, light.cols, light.rows};
  cv::Mat out(part.height, part.width, CV_32F);
  model::UndistortInto(sweep.camera.distortion->ScaledTo(light.cols, light.rows),
                       light.ptr<float>(), 1, part, model::Resampling::kLanczos, 0,
                       out.ptr<float>());
  return out;
}

// The region of a whole frame in linear light.
cv::Mat RegionOfFrame(const cv::Mat& light, const FocusSweep& sweep) {
  return sweep.camera.distortion ? UndistortedRegion(light, sweep)
                                 : RegionOfLight(light, sweep.roi);
}

cv::Mat CorrectedGrey(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index) {
  RequireCorrectionOf(stored, sweep, index);
  cv::Mat grey = CorrectedChannel(stored, sweep, 0);
  if (stored.channels() >= 3) {
    grey = 0.2126 * grey + 0.7152 * CorrectedChannel(stored, sweep, 1) +
           0.0722 * CorrectedChannel(stored, sweep, 2);
  }
  sweep.correction->ReplaceDefects(&grey);
  return RegionOfFrame(grey, sweep);
}

// Whether value and sigma are numbers that can be used.
bool IsKnown(const model::Estimate& estimate) {
  return std::isfinite(estimate.value) && estimate.sigma >= 0 && std::isfinite(estimate.sigma);
}

// The tolerance that the camera file states of a number; 0: none.
double ToleranceOfField(const model::Camera& camera, const std::string& field) {
  const auto found = camera.statements.find(field);
  return found == camera.statements.end() ? 0 : found->second.tolerance;
}

// The standard deviation of an error of which only a bound is known: it is anywhere within.
double SigmaOfTolerance(double tolerance) { return tolerance / std::sqrt(3.0); }

// The depth from the aperture of the plane at the stated distance from the front of the lens.
model::StatedConjugate DepthOfWorkingDistance(const model::Estimate& distance_mm,
                                              const model::Camera& camera) {
  if (!camera.aperture_behind_front_mm) {
    throw Error(
        "working_distance_mm is measured from the front of the lens: state "
        "lens.aperture_behind_front_mm in the camera file (the distance from there to the "
        "aperture), or state focus_depth_mm");
  }
  const double behind_mm = *camera.aperture_behind_front_mm;
  const double depth_mm = distance_mm.value + behind_mm;
  // Checked here, because later the sum is all that is known of the distance.
  if (!(depth_mm > camera.lens.front_focal_length_mm)) {
    throw Error(fmt::format(
        "working_distance_mm is {}: with lens.aperture_behind_front_mm {} of the camera file it is "
        "a depth of {:.6g} mm from the aperture, which must be larger than the front focal length "
        "({:.6g} mm), because nothing nearer comes into focus",
        distance_mm.value, behind_mm, depth_mm, camera.lens.front_focal_length_mm));
  }
  const double sigma_mm =
      std::hypot(distance_mm.sigma,
                 SigmaOfTolerance(ToleranceOfField(camera, "lens.aperture_behind_front_mm")));
  return {model::ConjugateKind::kFocusDepth, {depth_mm, sigma_mm}, "working_distance_mm"};
}

// The magnification on the barrel of an objective. Its error is a tolerance (ToleranceOfStatement)
// and has no standard deviation.
model::StatedConjugate MagnificationOfObjective(const model::Camera& camera) {
  return {model::ConjugateKind::kMagnification,
          {camera.objective->magnification, 0},
          "lens.magnification"};
}

std::vector<model::StatedConjugate> StatedFocus(const model::SweepFile& file,
                                                const model::Camera& camera) {
  using Kind = model::ConjugateKind;
  std::vector<model::StatedConjugate> stated;
  const auto add = [&](Kind kind, const std::optional<model::Estimate>& value, const char* key) {
    if (!value) return;
    if (camera.objective && kind != Kind::kMagnification) {
      throw Error(fmt::format(
          "{} is stated, but the camera file states the lens by an objective, whose equivalent "
          "lens has no length that can be measured: state magnification",
          key));
    }
    stated.push_back({kind, *value, key});
  };
  add(Kind::kFocusDepth, file.focus_depth_mm, "focus_depth_mm");
  if (file.working_distance_mm) {
    const model::StatedConjugate depth = DepthOfWorkingDistance(*file.working_distance_mm, camera);
    add(depth.kind, depth.value, "working_distance_mm");
  }
  add(Kind::kImageDistance, file.image_distance_mm, "image_distance_mm");
  add(Kind::kTubeLength, file.optical_tube_length_mm, "optical_tube_length_mm");
  add(Kind::kMagnification, file.magnification, "magnification");
  if (camera.objective && !file.magnification) stated.push_back(MagnificationOfObjective(camera));
  return stated;
}

// The part of a region in which the undistorted frames have an image.
model::RegionOfInterest RegionThatIsShown(const model::Camera& camera,
                                          const model::RegionOfInterest& roi) {
  std::string why;
  // Whoever measures reports a camera or a region that is not valid.
  if (!camera.distortion || !camera.IsValid(&why)) return roi;
  const model::Sensor& sensor = camera.sensor;
  const model::PixelRect asked = roi.width > 0
                                     ? model::PixelRect{roi.x, roi.y, roi.width, roi.height}
                                     : model::PixelRect{0, 0, sensor.width_px, sensor.height_px};
  if (asked.x < 0 || asked.y < 0 || asked.width > sensor.width_px - asked.x ||
      asked.height > sensor.height_px - asked.y)
    return roi;
  const model::PixelRect shown = model::RegionWithSource(
      camera.distortion->ScaledTo(sensor.width_px, sensor.height_px), asked);
  if (shown.width == asked.width && shown.height == asked.height) return roi;
  if (shown.width == 0) {
    throw Error(fmt::format(
        "lens.distortion: the frames show nothing of the region {} x {} px from ({}, {}) of the "
        "undistorted field",
        asked.width, asked.height, asked.x, asked.y));
  }
  return {shown.x, shown.y, shown.width, shown.height};
}

}  // namespace

bool FocusSweep::IsValid(std::string* why) const {
  std::string inner;
  if (!camera.lens.IsValid(&inner)) return Fail(why, "camera: lens: " + inner);
  if (!camera.sensor.IsValid(&inner)) return Fail(why, "camera: sensor: " + inner);
  if (!read_frame) return Fail(why, "read_frame is not set");
  if (sensor_px_per_px < 1)
    return Fail(why, fmt::format("sensor_px_per_px must be >= 1, found {}", sensor_px_per_px));
  if (!(reading_sigma_mm >= 0) || !std::isfinite(reading_sigma_mm)) {
    return Fail(
        why, fmt::format("reading_sigma_mm must be finite and >= 0, found {}", reading_sigma_mm));
  }
  if (offset_mm && !IsKnown(*offset_mm)) {
    return Fail(why,
                fmt::format("offset_mm must be finite with a finite sigma >= 0, found {} +- {}",
                            offset_mm->value, offset_mm->sigma));
  }
  for (const model::StatedConjugate& stated : stated_focus) {
    try {
      model::FocusDepthOf(camera.lens, stated);
    } catch (const Error& error) {
      return Fail(why, error.what());
    }
  }
  if (floor.given_px && !(IsKnown(*floor.given_px) && floor.given_px->value >= 0)) {
    return Fail(why, fmt::format("floor.given_px must be finite and >= 0 with a finite sigma >= 0, "
                                 "found {} +- {}",
                                 floor.given_px->value, floor.given_px->sigma));
  }
  if (floor.from_px.has_value() != floor.to_px.has_value()) {
    return Fail(why, "floor.from_px and floor.to_px must be both set or both absent");
  }
  if (floor.from_px &&
      !(*floor.from_px >= 0 && *floor.from_px <= *floor.to_px && std::isfinite(*floor.to_px))) {
    return Fail(why,
                fmt::format("floor.from_px and floor.to_px must be finite with 0 <= from_px <= "
                            "to_px, found {} and {}",
                            *floor.from_px, *floor.to_px));
  }
  if (target_period_mm && !(*target_period_mm > 0 && std::isfinite(*target_period_mm))) {
    return Fail(
        why, fmt::format("target_period_mm must be finite and > 0, found {}", *target_period_mm));
  }
  for (const model::SweepFrame& frame : frames) {
    if (!std::isfinite(frame.reading_mm)) {
      return Fail(why, fmt::format("{}: reading_mm must be finite, found {}", frame.Name(),
                                   frame.reading_mm));
    }
  }
  if (roi.width > 0 && (roi.x < 0 || roi.y < 0 || roi.x + roi.width > camera.sensor.width_px ||
                        roi.y + roi.height > camera.sensor.height_px || roi.height <= 0)) {
    return Fail(why, fmt::format("roi_px [{}, {}, {}, {}] is not inside the sensor of {} x {} px",
                                 roi.x, roi.y, roi.width, roi.height, camera.sensor.width_px,
                                 camera.sensor.height_px));
  }
  return true;
}

FocusSweep MakeFocusSweep(const model::SweepFile& file, const model::Camera& camera) {
  model::RequireFloorOfCamera(file, camera);
  FocusSweep sweep;
  sweep.camera = camera;
  sweep.frames = file.frames;
  sweep.reading_sigma_mm = file.reading_sigma_mm;
  sweep.offset_mm = file.offset_mm;
  sweep.stated_focus = StatedFocus(file, camera);
  sweep.direction = file.direction;
  sweep.moves = file.moves;
  sweep.readings_are_focus_distances = file.readings_are_focus_distances;
  sweep.readings_are_counts = file.readings_are_counts;
  sweep.target = file.target;
  sweep.floor = file.floor;
  sweep.target_period_mm = file.target_period_mm;
  sweep.target_grid = file.target_grid;
  sweep.grid_views = file.grid_views;
  sweep.stage_alignment_deg = file.stage_alignment_deg;
  sweep.roi = RegionThatIsShown(camera, file.roi);
  return sweep;
}

FocusSweep WithDistortion(FocusSweep sweep, const model::LensDistortion& distortion,
                          const model::RegionOfInterest& region) {
  sweep.camera.distortion = distortion;
  sweep.roi = RegionThatIsShown(sweep.camera, region);
  return sweep;
}

cv::Mat RegionOf(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index) {
  const model::Sensor& sensor = sweep.camera.sensor;
  const std::string name = sweep.frames[index].Name();
  if (stored.cols != sensor.width_px || stored.rows != sensor.height_px) {
    throw Error(
        fmt::format("{}: the image has {} x {} px, but the camera's sensor has {} x {} px: the "
                    "sizes must be equal",
                    name, stored.cols, stored.rows, sensor.width_px, sensor.height_px));
  }
  if (stored.depth() != CV_8U && stored.depth() != CV_16U) {
    throw Error(fmt::format("{}: images of 8 or 16 bits a channel are expected", name));
  }
  if (stored.channels() != 1 && stored.channels() != 3 && stored.channels() != 4) {
    throw Error(
        fmt::format("{}: 1, 3 or 4 channels are expected, found {}", name, stored.channels()));
  }
  const model::RegionOfInterest& roi = sweep.roi;
  return roi.width > 0 ? stored(cv::Rect(roi.x, roi.y, roi.width, roi.height)) : stored;
}

cv::Mat LinearGrey(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index) {
  const cv::Mat region = RegionOf(stored, sweep, index);
  if (sweep.correction != nullptr) return CorrectedGrey(stored, sweep, index);
  const bool is_distorted = sweep.camera.distortion.has_value();
  const cv::Mat& decoded = is_distorted ? stored : region;
  const bool bytes = region.depth() == CV_8U;
  const auto decode = DecodeTableOf(sweep.camera.sensor.transfer, bytes ? 256 : 65536);
  cv::Mat grey(decoded.size(), CV_32F);
  if (bytes) {
    DecodeGrey<std::uint8_t>(decoded, *decode, &grey);
  } else {
    DecodeGrey<std::uint16_t>(decoded, *decode, &grey);
  }
  return is_distorted ? UndistortedRegion(grey, sweep) : grey;
}

cv::Mat LinearChannel(const cv::Mat& stored, const FocusSweep& sweep, std::size_t index,
                      int channel) {
  const cv::Mat region = RegionOf(stored, sweep, index);
  const int colours = region.channels() == 4 ? 3 : region.channels();
  if (channel < 0 || channel >= colours) {
    throw Error(
        fmt::format("{}: channel {} is requested, but the image has {} channel(s), counted from 0",
                    sweep.frames[index].Name(), channel, colours));
  }
  const model::TransferCurve& transfer = sweep.camera.sensor.transfer;
  if (sweep.correction == nullptr && !sweep.camera.distortion)
    return DecodedChannel(region, transfer, channel);
  if (sweep.correction == nullptr)
    return UndistortedRegion(DecodedChannel(stored, transfer, channel), sweep);
  RequireCorrectionOf(stored, sweep, index);
  cv::Mat light = CorrectedChannel(stored, sweep, channel);
  sweep.correction->ReplaceDefects(&light);
  return RegionOfFrame(light, sweep);
}

}  // namespace thicklens::calib
