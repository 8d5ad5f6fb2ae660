#include "thicklens/model/sweep_simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "edge_spread.h"
#include "periodic_picture.h"
#include "random_draws.h"
#include "sweep_target.h"
#include "thicklens/error.h"

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;

bool Fail(std::string* why, const std::string& message) {
  if (why != nullptr) *why = message;
  return false;
}

bool IsEdge(TargetKind kind) {
  return kind == TargetKind::kPrintedEdge || kind == TargetKind::kKnifeEdge;
}

bool IsValidTarget(const TargetOptions& target, std::string* why) {
  if (!(target.contrast > 0 && target.contrast <= 1)) {
    return Fail(why, fmt::format("target.contrast is {}: it must be above 0 and at most 1",
                                 target.contrast));
  }
  if (!(target.feature_size_mm >= 0) || !std::isfinite(target.feature_size_mm)) {
    return Fail(why, fmt::format("target.feature_size_mm is {}: it must be > 0, or 0 to have it "
                                 "chosen",
                                 target.feature_size_mm));
  }
  if (!(std::abs(target.edge_angle_deg) <= 90)) {
    return Fail(why, fmt::format("target.edge_angle_deg is {}: it must be between -90 and 90",
                                 target.edge_angle_deg));
  }
  if (!(target.ink_sigma_mm >= 0) || !std::isfinite(target.ink_sigma_mm)) {
    return Fail(why,
                fmt::format("target.ink_sigma_mm is {}: it must be >= 0", target.ink_sigma_mm));
  }
  return true;
}

bool IsValidTruth(const Camera& camera, std::string* why) {
  std::string inner;
  if (!camera.IsValid(&inner)) return Fail(why, "camera: " + inner);
  const auto missing = [&](const char* field) {
    return Fail(why, fmt::format("camera '{}': {} is missing: a simulation needs it as the truth",
                                 camera.name, field));
  };
  if (!camera.calibration || !camera.calibration->image_distance_mm)
    return missing("image_distance_mm");
  if (!camera.calibration->blur_ratio) return missing("blur_ratio");
  if (!camera.calibration->blur_floor_px) return missing("blur_floor_px");
  if (!std::isfinite(camera.focus_depth_mm())) {
    return Fail(why, fmt::format("camera '{}' is focused at infinity: a sweep needs a finite plane "
                                 "of focus, because light and drift are stated there",
                                 camera.name));
  }
  return true;
}

// What distinguishes one frame from another.
struct FrameState {
  double depth_mm = 0;
  double reading_mm = 0;
  double lamp = 1;                 // irradiance, 1 = the mean of full scale
  Eigen::Vector2d drift_mm{0, 0};  // of the target, X right, Y down
  double pixel_mm = 0;             // one px on the target: p/|m|
  double defocus_sigma_px = 0;
};

}  // namespace

std::string TargetKindName(TargetKind kind) {
  switch (kind) {
    case TargetKind::kDeadLeaves:
      return "dead-leaves";
    case TargetKind::kPinkNoise:
      return "pink-noise";
    case TargetKind::kWhiteNoise:
      return "white-noise";
    case TargetKind::kCheckerboard:
      return "checkerboard";
    case TargetKind::kSiemensStar:
      return "siemens-star";
    case TargetKind::kPicture:
      return "picture";
    case TargetKind::kPrintedEdge:
      return "printed-edge";
    case TargetKind::kKnifeEdge:
      return "knife-edge";
  }
  throw Error("no such kind of target");
}

bool SweepSimulationOptions::IsValid(std::string* why) const {
  if (!IsValidTruth(camera, why) || !IsValidTarget(target, why)) return false;
  if (!(frame_count >= 1 && frame_count <= 100000)) {
    return Fail(why, fmt::format("bench.frames is {}: it must be from 1 to 100000", frame_count));
  }
  const double last_depth_mm = first_depth_mm + (frame_count - 1) * step_mm;
  const auto possible = [](double depth_mm) { return depth_mm > 0 && std::isfinite(depth_mm); };
  if (!possible(first_depth_mm) || !possible(last_depth_mm)) {
    return Fail(why, fmt::format("bench: the depths run from {} to {} mm: they must be finite and "
                                 "> 0",
                                 first_depth_mm, last_depth_mm));
  }
  if (!std::isfinite(bench_offset_mm)) {
    return Fail(why, fmt::format("bench.offset_mm is {}: it must be finite", bench_offset_mm));
  }
  const std::pair<const char*, double> amounts[] = {
      {"bench.reading_sigma_mm", reading_sigma_mm},
      {"drift_sigma_px", drift_sigma_px},
      {"noise.full_well_electrons", full_well_electrons},
      {"noise.read_noise_electrons", read_noise_electrons}};
  for (const auto& [field, value] : amounts) {
    if (!(value >= 0) || !std::isfinite(value)) {
      return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, value));
    }
  }
  if (read_noise_electrons > 0 && !(full_well_electrons > 0)) {
    return Fail(why, fmt::format("noise.read_noise_electrons is {}: noise in electrons needs "
                                 "noise.full_well_electrons > 0",
                                 read_noise_electrons));
  }
  if (!(light_level > 0 && light_level <= 1)) {
    return Fail(why,
                fmt::format("light.level is {}: it must be above 0 and at most 1", light_level));
  }
  if (!(flicker >= 0 && flicker <= 0.5)) {
    return Fail(why, fmt::format("light.flicker is {}: it must be from 0 to 0.5", flicker));
  }
  if (bits != 8 && bits != 16) {
    return Fail(why, fmt::format("bits is {}: it must be 8 or 16", bits));
  }
  return true;
}

struct SweepSimulator::Impl {
  Impl(const SweepSimulationOptions& given, const LinearPicture& picture) : options(given) {
    std::string why;
    if (!options.IsValid(&why)) throw Error(why);
    MakeFrames();
    MakeTruth();
    if (!IsEdge(options.target.kind)) MakeTile(picture);
  }

  // p/|m|, mm on the target, of one px at a depth.
  double PixelMm(double depth_mm) const {
    return options.camera.sensor.pixel_pitch_mm /
           std::abs(ChiefRayMagnification(options.camera.lens, options.camera.image_distance_mm(),
                                          depth_mm));
  }

  // The pixel in the middle of the sensor, from the principal point.
  Eigen::Vector2d CentrePx() const {
    const Sensor& sensor = options.camera.sensor;
    return Eigen::Vector2d(sensor.width_px - 1, sensor.height_px - 1) / 2 -
           sensor.principal_point_px;
  }

  void MakeFrames() {
    const Camera& camera = options.camera;
    const double focus_depth_mm = camera.focus_depth_mm();
    const double focus_pixel_mm = PixelMm(focus_depth_mm);
    for (int i = 0; i < options.frame_count; ++i) {
      using Purpose = RandomDraws::Purpose;
      const auto item = static_cast<std::uint32_t>(i);
      RandomDraws bench(options.seed, Purpose::kBench, item);
      RandomDraws lamp(options.seed, Purpose::kLamp, item);
      RandomDraws drift(options.seed, Purpose::kDrift, item);
      FrameState frame;
      frame.depth_mm = options.first_depth_mm + i * options.step_mm;
      frame.reading_mm =
          DirectionSign(options.direction) * (frame.depth_mm - options.bench_offset_mm) +
          options.reading_sigma_mm * bench.Normal();
      // The lamp stands at the camera: irradiance of the target (zf/z)^2, 1 in the plane of focus.
      const double falloff =
          options.lamp_falloff ? std::pow(focus_depth_mm / frame.depth_mm, 2) : 1.0;
      frame.lamp =
          options.light_level * falloff * std::max(0.0, 1 + options.flicker * lamp.Normal());
      const double drift_sigma_mm = options.drift_sigma_px * focus_pixel_mm;
      frame.drift_mm.x() = drift_sigma_mm * drift.Normal();
      frame.drift_mm.y() = drift_sigma_mm * drift.Normal();
      frame.pixel_mm = PixelMm(frame.depth_mm);
      // sigma = kappa r_defocus, here in px.
      frame.defocus_sigma_px =
          camera.blur_ratio() *
          BlurRadiusMm(camera.lens, camera.image_distance_mm(), frame.depth_mm) /
          camera.sensor.pixel_pitch_mm;
      frames.push_back(frame);
    }
  }

  void MakeTruth() {
    const Camera& camera = options.camera;
    floor_px = camera.calibration->blur_floor_px->value;
    truth.image_distance_mm = camera.image_distance_mm();
    truth.focus_depth_mm = camera.focus_depth_mm();
    truth.blur_ratio = camera.blur_ratio();
    truth.blur_floor_px = floor_px;
    truth.bench_offset_mm = options.bench_offset_mm;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      truth.frames.push_back({fmt::format("frames/frame_{:03d}.png", i), frames[i].depth_mm,
                              frames[i].reading_mm,
                              std::hypot(floor_px, frames[i].defocus_sigma_px)});
    }
  }

  // The depth of the sweep at which the target is seen best; zf itself if the sweep passes it.
  double ReferenceDepthMm() const {
    const auto [near, far] = std::minmax(frames.front().depth_mm, frames.back().depth_mm);
    return std::clamp(truth.focus_depth_mm, near, far);
  }

  // Where the target's centre lies, mm: in the middle of the picture at the reference depth, which
  // is not on the axis where the principal point is not the middle.
  Eigen::Vector2d TargetCentreMm() const { return CentrePx() * PixelMm(ReferenceDepthMm()); }

  // The tile must hold the field of every frame with its drift and blur (of a large blur a part:
  // beyond the tile the target repeats itself, it does not end), and its highest frequency
  // is one cycle per px in the nearest frame: what lies above is taken by the pixel box, whose
  // first zero is there, and what lies between that and half of it is the aliasing that a real
  // sensor has.
  void MakeTile(const LinearPicture& picture) {
    const Sensor& sensor = options.camera.sensor;
    TileRequest request;
    request.centre_mm = TargetCentreMm();
    request.pixel_mm = PixelMm(ReferenceDepthMm());
    request.field_mm = std::min(sensor.width_px, sensor.height_px) * request.pixel_mm;
    double nearest_pixel_mm = frames.front().pixel_mm;
    for (const FrameState& frame : frames) {
      const double margin_px = std::min(3 * std::hypot(floor_px, frame.defocus_sigma_px),
                                        std::min(sensor.width_px, sensor.height_px) / 4.0) +
                               1;
      const Eigen::Vector2d middle_mm = CentrePx() * frame.pixel_mm - frame.drift_mm;
      const Eigen::Vector2d half_mm =
          (Eigen::Vector2d(sensor.width_px, sensor.height_px) / 2).array() * frame.pixel_mm +
          margin_px * frame.pixel_mm;
      const Eigen::Vector2d reach_mm = half_mm + (middle_mm - request.centre_mm).cwiseAbs();
      request.width_mm = std::max(request.width_mm, 2 * reach_mm.x());
      request.height_mm = std::max(request.height_mm, 2 * reach_mm.y());
      nearest_pixel_mm = std::min(nearest_pixel_mm, frame.pixel_mm);
    }
    request.spacing_mm = nearest_pixel_mm / 2;
    RandomDraws draws(options.seed, RandomDraws::Purpose::kTexture, 0);
    TargetTile tile = DrawTargetTile(options.target, request, picture, &draws);
    tile_texture.emplace(tile.samples);
    tile.samples.release();
    tile_frame = tile;
  }

  LinearPicture Render(int frame_index) const {
    if (!(frame_index >= 0 && frame_index < options.frame_count)) {
      throw Error(fmt::format("frame {} does not exist: the sweep has {}", frame_index,
                              options.frame_count));
    }
    const FrameState& frame = frames[static_cast<std::size_t>(frame_index)];
    return tile_texture ? RenderTile(frame) : RenderEdge(frame);
  }

  LinearPicture RenderTile(const FrameState& frame) const {
    const Sensor& sensor = options.camera.sensor;
    // Pixel (x, y) looks at (x - cx) p/|m| from the axis: the picture shows the target upright.
    const Eigen::Vector2d first_mm =
        -sensor.principal_point_px * frame.pixel_mm - frame.drift_mm - tile_frame.origin_mm;
    const AxisSampling x{first_mm.x() / tile_frame.width_mm, frame.pixel_mm / tile_frame.width_mm,
                         sensor.width_px};
    const AxisSampling y{first_mm.y() / tile_frame.height_mm, frame.pixel_mm / tile_frame.height_mm,
                         sensor.height_px};
    const cv::Mat light =
        tile_texture->Evaluate(x, y, {floor_px, options.camera.psf, frame.defocus_sigma_px});
    LinearPicture picture{sensor.width_px, sensor.height_px, 1, {}};
    picture.values.reserve(light.total());
    for (int i = 0; i < light.rows; ++i) {
      const double* row = light.ptr<double>(i);
      for (int j = 0; j < light.cols; ++j) {
        picture.values.push_back(static_cast<float>(frame.lamp * row[j]));
      }
    }
    return picture;
  }

  // Dark left, bright right of an edge through the target's centre; a positive angle leans its
  // upper end to the right.
  LinearPicture RenderEdge(const FrameState& frame) const {
    const Sensor& sensor = options.camera.sensor;
    const TargetOptions& target = options.target;
    const double ink_px =
        target.kind == TargetKind::kPrintedEdge ? target.ink_sigma_mm / frame.pixel_mm : 0;
    const bool disc = options.camera.psf == Psf::kDisc;
    const double gaussian_px =
        std::hypot(std::hypot(floor_px, ink_px), disc ? 0 : frame.defocus_sigma_px);
    const double angle_rad = target.edge_angle_deg * kPi / 180;
    const EdgeSpread edge(angle_rad, gaussian_px, disc ? 2 * frame.defocus_sigma_px : 0);

    const Eigen::Vector2d normal(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d on_edge_px =
        sensor.principal_point_px + (TargetCentreMm() + frame.drift_mm) / frame.pixel_mm;
    const double dark = frame.lamp * (1 - target.contrast);
    const double step = 2 * frame.lamp * target.contrast;
    LinearPicture picture{sensor.width_px, sensor.height_px, 1, {}};
    picture.values.reserve(static_cast<std::size_t>(sensor.width_px) *
                           static_cast<std::size_t>(sensor.height_px));
    for (int y = 0; y < sensor.height_px; ++y) {
      for (int x = 0; x < sensor.width_px; ++x) {
        const double distance_px = normal.dot(Eigen::Vector2d(x, y) - on_edge_px);
        picture.values.push_back(static_cast<float>(dark + step * edge.At(distance_px)));
      }
    }
    return picture;
  }

  // Electrons: Poisson with the mean light * full well, plus the reading's Gaussian.
  void AddNoise(int frame_index, LinearPicture* picture) const {
    if (!(options.full_well_electrons > 0)) return;
    RandomDraws draws(options.seed, RandomDraws::Purpose::kSensor,
                      static_cast<std::uint32_t>(frame_index));
    for (float& light : picture->values) {
      double electrons = draws.Poisson(light * options.full_well_electrons);
      if (options.read_noise_electrons > 0) {
        electrons += options.read_noise_electrons * draws.Normal();
      }
      light = static_cast<float>(electrons / options.full_well_electrons);
    }
  }

  SweepSimulationOptions options;
  double floor_px = 0;
  std::vector<FrameState> frames;
  SweepTruth truth;
  std::optional<PeriodicPicture> tile_texture;  // none for an edge
  TargetTile tile_frame;                        // its place; the samples are in tile_texture
};

SweepSimulator::SweepSimulator(const SweepSimulationOptions& options,
                               const LinearPicture& target_picture)
    : impl_(std::make_unique<Impl>(options, target_picture)) {}

SweepSimulator::~SweepSimulator() = default;

LinearPicture SweepSimulator::RenderNoiseless(int frame_index) const {
  return impl_->Render(frame_index);
}

StoredPicture SweepSimulator::RenderFrame(int frame_index) const {
  LinearPicture picture = impl_->Render(frame_index);
  impl_->AddNoise(frame_index, &picture);
  return ToStored(picture, impl_->options.camera.sensor.transfer, impl_->options.bits);
}

const SweepTruth& SweepSimulator::truth() const { return impl_->truth; }

}  // namespace thicklens::model
