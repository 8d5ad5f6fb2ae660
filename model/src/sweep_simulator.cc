#include "thicklens/model/sweep_simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "aperture_irradiance.h"
#include "edge_spread.h"
#include "periodic_picture.h"
#include "random_draws.h"
#include "sensor_noise.h"
#include "sweep_target.h"
#include "thicklens/error.h"

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;

bool IsEdge(TargetKind kind) {
  return kind == TargetKind::kPrintedEdge || kind == TargetKind::kKnifeEdge;
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

struct SweepSimulator::Impl {
  Impl(const SweepSimulationOptions& given, const LinearPicture& picture) : options(given) {
    std::string why;
    if (!options.IsValid(&why)) throw Error(why);
    Decide();
    frames = FramesWith(decision.on);
    MakeTruth();
    MakeFalloff();
    if (!IsEdge(options.target.kind)) MakeTile(picture);
  }

  EffectConditions Conditions() const {
    EffectConditions conditions;
    conditions.camera = options.camera;
    conditions.bits = options.bits;
    conditions.full_well_electrons = options.full_well_electrons;
    conditions.read_noise_electrons = options.read_noise_electrons;
    conditions.bench = BenchConditions{options.lamp_falloff, options.flicker,
                                       options.drift_sigma_px, options.reading_sigma_mm, 0};
    return conditions;
  }

  void Decide() {
    EffectChoice choice = options.effects;
    // All but fall-off costs nothing where frames are sums of waves; and that, with the thickness
    // it depends on, is for those who ask: what it does to a calibration is not known.
    if (choice.base == EffectChoice::Base::kAuto) {
      choice.without = choice.without.With({Effect::kThickness, Effect::kFalloff});
    }
    choice.kept = choice.kept.With(SweepEffects());
    const double last_depth_mm =
        options.first_depth_mm + (options.frame_count - 1) * options.step_mm;
    const auto [near, far] = std::minmax(options.first_depth_mm, last_depth_mm);
    decision = DecideEffects(choice, Conditions(), PlacesBetween(options.camera, near, far, false),
                             SweepEffects());
    stored_camera = options.camera;
    if (!On(Effect::kTransferCurve)) stored_camera.sensor.transfer = TransferCurve::Linear();
    if (!On(Effect::kApertureShape)) stored_camera.psf = Psf::kGaussian;
  }

  bool On(Effect effect) const { return decision.on.Has(effect); }

  // p/|m|, mm on the target, of one px at a depth.
  double PixelMm(double depth_mm, const EffectSet& on) const {
    if (!on.Has(Effect::kMagnification)) depth_mm = options.camera.focus_depth_mm();
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

  std::vector<FrameState> FramesWith(const EffectSet& on) const {
    const Camera& camera = options.camera;
    const double focus_depth_mm = camera.focus_depth_mm();
    const double focus_pixel_mm = PixelMm(focus_depth_mm, on);
    std::vector<FrameState> states;
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
          (on.Has(Effect::kReadingError) ? options.reading_sigma_mm * bench.Normal() : 0);
      // The lamp stands at the camera: irradiance of the target (zf/z)^2, 1 in the plane of focus.
      const double falloff = options.lamp_falloff && on.Has(Effect::kLampFalloff)
                                 ? std::pow(focus_depth_mm / frame.depth_mm, 2)
                                 : 1.0;
      const double flicker = on.Has(Effect::kFlicker) ? options.flicker : 0;
      frame.lamp = options.light_level * falloff * std::max(0.0, 1 + flicker * lamp.Normal());
      const double drift_sigma_mm =
          on.Has(Effect::kDrift) ? options.drift_sigma_px * focus_pixel_mm : 0;
      frame.drift_mm.x() = drift_sigma_mm * drift.Normal();
      frame.drift_mm.y() = drift_sigma_mm * drift.Normal();
      frame.pixel_mm = PixelMm(frame.depth_mm, on);
      // sigma = kappa r_defocus, here in px.
      if (on.Has(Effect::kDefocus)) {
        frame.defocus_sigma_px =
            camera.blur_ratio() *
            BlurRadiusMm(camera.lens, camera.image_distance_mm(), frame.depth_mm) /
            camera.sensor.pixel_pitch_mm;
      }
      states.push_back(frame);
    }
    return states;
  }

  void MakeTruth() {
    const Camera& camera = options.camera;
    if (On(Effect::kLensFloor)) floor_px = camera.calibration->blur_floor_px->value;
    truth.effects = RecordOf(decision);
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

  // What each pixel gets of a uniform target's light, 1 at the principal point: by symmetry a
  // function of the distance from there, and of no depth, since (12) knows the ray alone.
  void MakeFalloff() {
    if (!On(Effect::kFalloff)) return;
    const Sensor& sensor = options.camera.sensor;
    const EffectConditions conditions = Conditions();
    const EffectOptics optics(conditions, decision.on);
    const Aperture aperture = ApertureOf(optics, decision.on);
    const Eigen::Vector2d& axis_px = sensor.principal_point_px;
    const Eigen::Vector2d far_px(std::max(axis_px.x(), sensor.width_px - 1 - axis_px.x()),
                                 std::max(axis_px.y(), sensor.height_px - 1 - axis_px.y()));
    constexpr int kSteps = 1024;
    const double step_px = std::max(far_px.norm(), 1.0) / kSteps;
    std::vector<double> at_step;
    for (int i = 0; i <= kSteps + 1; ++i) {
      at_step.push_back(IrradianceAt(optics, axis_px + Eigen::Vector2d(i * step_px, 0),
                                     optics.image_distance_mm(), aperture)
                            .mean);
    }
    light_of_pixel.reserve(static_cast<std::size_t>(sensor.width_px) *
                           static_cast<std::size_t>(sensor.height_px));
    for (int y = 0; y < sensor.height_px; ++y) {
      for (int x = 0; x < sensor.width_px; ++x) {
        const double place = (Eigen::Vector2d(x, y) - axis_px).norm() / step_px;
        const auto below = std::min(static_cast<std::size_t>(place), std::size_t{kSteps});
        const double rest = place - static_cast<double>(below);
        light_of_pixel.push_back(
            static_cast<float>(at_step[below] + rest * (at_step[below + 1] - at_step[below])));
      }
    }
  }

  // The depth of the sweep at which the target is seen best; zf itself if the sweep passes it.
  double ReferenceDepthMm() const {
    const auto [near, far] = std::minmax(frames.front().depth_mm, frames.back().depth_mm);
    return std::clamp(truth.focus_depth_mm, near, far);
  }

  // Where the target's centre lies, mm: in the middle of the picture at the reference depth, which
  // is not on the axis where the principal point is not the middle.
  Eigen::Vector2d TargetCentreMm(const EffectSet& on) const {
    return CentrePx() * PixelMm(ReferenceDepthMm(), on);
  }

  // The tile must hold the field of every frame with its drift and blur (of a large blur a part:
  // beyond the tile the target repeats itself, it does not end), and its highest frequency
  // is one cycle per px in the nearest frame: what lies above is taken by the pixel box, whose
  // first zero is there, and what lies between that and half of it is the aliasing that a real
  // sensor has. Effects that are left out change nothing of what the target shows.
  void MakeTile(const LinearPicture& picture) {
    const Sensor& sensor = options.camera.sensor;
    const EffectSet all = SweepEffects();
    const std::vector<FrameState> with_all = FramesWith(all);
    const double most_floor_px = options.camera.calibration->blur_floor_px->value;
    TileRequest request;
    request.centre_mm = TargetCentreMm(all);
    request.pixel_mm = PixelMm(ReferenceDepthMm(), all);
    request.field_mm = std::min(sensor.width_px, sensor.height_px) * request.pixel_mm;
    double nearest_pixel_mm = with_all.front().pixel_mm;
    for (const FrameState& frame : with_all) {
      const double margin_px = std::min(3 * std::hypot(most_floor_px, frame.defocus_sigma_px),
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
    LinearPicture picture = tile_texture ? RenderTile(frame) : RenderEdge(frame);
    for (std::size_t i = 0; i < light_of_pixel.size(); ++i) picture.values[i] *= light_of_pixel[i];
    return picture;
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
    const cv::Mat light = tile_texture->Evaluate(
        x, y, {floor_px, stored_camera.psf, frame.defocus_sigma_px, On(Effect::kPixelBox)});
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
    const bool disc = stored_camera.psf == Psf::kDisc;
    const double gaussian_px =
        std::hypot(std::hypot(floor_px, ink_px), disc ? 0 : frame.defocus_sigma_px);
    const double angle_rad = target.edge_angle_deg * kPi / 180;
    const EdgeSpread edge(angle_rad, gaussian_px, disc ? 2 * frame.defocus_sigma_px : 0,
                          On(Effect::kPixelBox));

    const Eigen::Vector2d normal(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d on_edge_px =
        sensor.principal_point_px + (TargetCentreMm(decision.on) + frame.drift_mm) / frame.pixel_mm;
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

  SweepSimulationOptions options;
  EffectDecision decision;
  Camera stored_camera;
  double floor_px = 0;
  std::vector<float> light_of_pixel;  // none without fall-off
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
  const SweepSimulationOptions& options = impl_->options;
  AddSensorNoise({options.full_well_electrons, options.read_noise_electrons}, impl_->decision.on,
                 options.seed, static_cast<std::uint32_t>(frame_index), &picture);
  return ToStored(picture, impl_->stored_camera.sensor.transfer,
                  impl_->On(Effect::kQuantisation) ? options.bits : 16);
}

const SweepTruth& SweepSimulator::truth() const { return impl_->truth; }

const EffectDecision& SweepSimulator::effects() const { return impl_->decision; }

const Camera& SweepSimulator::camera() const { return impl_->stored_camera; }

}  // namespace thicklens::model
