#include "thicklens/model/sweep_simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "model/base/random_draws.h"
#include "model/effects/aperture_irradiance.h"
#include "model/simulate/sensor_noise.h"
#include "model/simulate/sweep/edge_spread.h"
#include "model/simulate/sweep/field_blur.h"
#include "model/simulate/sweep/periodic_image.h"
#include "model/simulate/sweep/relief_image.h"
#include "model/simulate/sweep/sweep_target.h"
#include "model/simulate/sweep/tilted_target.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

// Minimum nearness of a drawn part of a tilted target: its depth is five times that of the middle.
constexpr double kMinNearness = 0.2;
// Sigma, px, above which a profile's transfer function is not tabulated up to one cycle per px. A
// disc's transfer function is then below 1e-3 there and is summed directly.
constexpr double kSharpestTail = 12;

bool IsEdge(TargetKind kind) {
  return kind == TargetKind::kPrintedEdge || kind == TargetKind::kKnifeEdge;
}

// The image of an aberrated lens is computed with samples this far apart, px, which hold its
// highest frequency, and with a border of so many samples for the interpolation, and of so many
// sigmas of the blur.
constexpr double kFinePx = 0.5;
constexpr int kFineBorder = 8;
constexpr double kBlurReach = 4.5;

// Evenly spaced pixel centres.
struct PixelGrid {
  Eigen::Vector2d first_px{0, 0};  // from the axis
  double step_px = 1;
  int columns = 0, rows = 0;

  double XPx(double column) const { return first_px.x() + step_px * column; }
  double YPx(double row) const { return first_px.y() + step_px * row; }
};

// Lanczos interpolation with six samples on each side, along both axes. `at` is in samples, at
// least six of them from every border.
double InterpolateSinc(const cv::Mat& image, const Eigen::Vector2d& at) {
  constexpr int kSide = 6;
  const auto kernel = [](double t) {
    if (t == 0) return 1.0;
    const double angle = kPi * t;
    return kSide * std::sin(angle) * std::sin(angle / kSide) / (angle * angle);
  };
  const Eigen::Vector2i below = at.array().floor().cast<int>();
  double x_weights[2 * kSide], sum_x = 0, sum_y = 0, sum = 0;
  for (int k = 0; k < 2 * kSide; ++k) {
    x_weights[k] = kernel(at.x() - (below.x() - kSide + 1 + k));
    sum_x += x_weights[k];
  }
  for (int j = 0; j < 2 * kSide; ++j) {
    const int row = below.y() - kSide + 1 + j;
    const double weight = kernel(at.y() - row);
    const double* values = image.ptr<double>(row) + below.x() - kSide + 1;
    double along = 0;
    for (int k = 0; k < 2 * kSide; ++k) along += x_weights[k] * values[k];
    sum += weight * along;
    sum_y += weight;
  }
  return sum / (sum_x * sum_y);
}

// The state of one frame.
struct FrameState {
  double depth_mm = 0;
  double image_distance_mm = 0;  // d1
  double reading_mm = 0;
  double lamp = 1;                 // irradiance, 1 = the mean of full scale
  double band_phase = 0;           // of the bands in the first row, periods
  Eigen::Vector2d drift_mm{0, 0};  // displacement of the target, X right, Y down
  double pixel_mm = 0;             // one px on the target: p/|m|
  double defocus_sigma_px = 0;     // value of kappa r_defocus
  bool in_focus = false;           // true: without defocus
  bool is_bare = false;            // true: without blur floor and pixel box
  double colour_per_mm = 0;        // ColourDisplacement of the light, 1/mm
};

}  // namespace

struct SweepSimulator::Impl {
  Impl(const SweepSimulationOptions& given, const LinearImage& image) : options(given) {
    std::string why;
    if (!options.IsValid(&why)) throw Error(why);
    Decide();
    frames = FramesWith(decision.on);
    MakePupil();
    MakeTruth();
    MakeOutline();
    MakeFalloff();
    MakeFixedToFrame();
    if (!IsEdge(options.target.kind)) MakeTile(image);
  }

  EffectConditions Conditions() const {
    EffectConditions conditions;
    conditions.camera = options.camera;
    conditions.bits = options.bits;
    conditions.full_well_electrons = options.full_well_electrons;
    conditions.read_noise_electrons = options.read_noise_electrons;
    conditions.bench = BenchConditions{options.lamp_falloff,
                                       options.flicker,
                                       options.drift_sigma_px,
                                       options.reading_sigma_mm,
                                       options.target.tilt_deg,
                                       options.corner_stops,
                                       options.speck_count > 0 ? options.speck_depth : 0,
                                       options.aberrations,
                                       options.band_amplitude,
                                       options.exposure_drift_stops};
    return conditions;
  }

  void Decide() {
    EffectSelectionOptions choice = options.effects;
    // All effects together cost nothing because frames are sums of waves.
    choice.kept = choice.kept.With(SweepEffects());
    const auto [near, far] =
        std::minmax({options.DepthMm(0), options.DepthMm(options.FarthestFrame())});
    // The sides of a tilted target are nearer and farther than its middle.
    const auto [least, most] = Nearnesses(options.target.tilt_deg * kPi / 180);
    decision = SelectEffects(choice, Conditions(),
                             PlacesBetween(options.camera, near / std::max(1.0, most),
                                           far / std::min(1.0, least), false),
                             SweepEffects());
    stored_camera = options.camera;
    if (!On(Effect::kTransferCurve)) stored_camera.sensor.transfer = TransferCurve::Linear();
    if (!On(Effect::kApertureShape)) stored_camera.psf = Psf::kGaussian;
  }

  bool On(Effect effect) const { return decision.on.Has(effect); }

  // Nearness (TiltedTarget) of the two sides of the image, the smaller first.
  std::pair<double, double> Nearnesses(double tilt_rad) const {
    const Sensor& sensor = options.camera.sensor;
    const TiltedTarget target(tilt_rad, 1, options.camera.focal_scale_px());
    const double axis_px = sensor.principal_point_px.x();
    return std::minmax(
        {target.Nearness(-0.5 - axis_px), target.Nearness(sensor.width_px - 0.5 - axis_px)});
  }

  // Width p/|m|, mm on the target, of one px at a depth, for a sensor at a distance d1.
  double PixelMm(double depth_mm, double image_distance_mm, const EffectSet& on) const {
    if (!on.Has(Effect::kMagnification)) {
      depth_mm = options.camera.focus_depth_mm();
      image_distance_mm = options.camera.image_distance_mm();
    }
    return options.camera.sensor.pixel_pitch_mm /
           std::abs(ChiefRayMagnification(options.camera.lens, image_distance_mm, depth_mm));
  }

  // The middle of the sensor, px from the principal point.
  Eigen::Vector2d CentrePx() const {
    const Sensor& sensor = options.camera.sensor;
    return Eigen::Vector2d(sensor.width_px - 1, sensor.height_px - 1) / 2 -
           sensor.principal_point_px;
  }

  // The displacement of a ray on the sensor per mm on Ap, with the plane of focus displaced by
  // `colour_per_mm` (ColourDisplacement).
  double Landing(double depth_mm, double image_distance_mm, double colour_per_mm) const {
    const ThickLens& lens = options.camera.lens;
    return DefocusPerAperture(lens, image_distance_mm, depth_mm) -
           DefocusScaleMm(lens, image_distance_mm) * colour_per_mm;
  }
  // Defocus sigma = kappa r_defocus, here in px.
  double DefocusPx(double depth_mm, double image_distance_mm, double colour_per_mm) const {
    const Camera& camera = options.camera;
    const double radius_mm =
        colour_per_mm == 0 ? BlurRadiusMm(camera.lens, image_distance_mm, depth_mm)
                           : camera.lens.aperture_radius_mm *
                                 std::abs(Landing(depth_mm, image_distance_mm, colour_per_mm));
    return camera.blur_ratio() * radius_mm / camera.sensor.pixel_pitch_mm;
  }
  bool IsInColour() const { return options.aberrations.axial_colour_mm.has_value(); }
  bool DisplacesColours() const { return On(Effect::kAberrations) && On(Effect::kDefocus); }
  // ColourDisplacement of each channel, 1/mm; of grey frames one, 0.
  std::vector<double> ColoursPerMm(bool displaces) const {
    if (!IsInColour()) return {0};
    std::vector<double> colours(3, 0);
    if (!displaces) return colours;
    for (int c = 0; c < 3; ++c) {
      colours[static_cast<std::size_t>(c)] =
          ColourDisplacement(options.aberrations, options.camera.focus_depth_mm(), c);
    }
    return colours;
  }
  // The frame in another colour of light.
  FrameState OfColour(FrameState frame, double colour_per_mm) const {
    if (colour_per_mm == 0) return frame;
    frame.colour_per_mm = colour_per_mm;
    frame.defocus_sigma_px = DefocusPx(frame.depth_mm, frame.image_distance_mm, colour_per_mm);
    return frame;
  }
  bool DisplacesFocus() const {
    return On(Effect::kAberrations) && On(Effect::kDefocus) && options.aberrations.DisplaceFocus();
  }
  double Distortion() const { return On(Effect::kDistortion) ? options.aberrations.distortion : 0; }
  // The defocus, px, of a light whose sigma on Ap is kappa r, as a matrix: DefocusPx for each
  // direction.
  Eigen::Matrix2d DefocusMapPx(double depth_mm, double image_distance_mm, double colour_per_mm,
                               const Eigen::Vector2d& from_axis_px) const {
    const Camera& camera = options.camera;
    const double sigma_px =
        camera.blur_ratio() * camera.lens.aperture_radius_mm / camera.sensor.pixel_pitch_mm;
    return sigma_px *
           (Landing(depth_mm, image_distance_mm, colour_per_mm) * Eigen::Matrix2d::Identity() -
            DefocusScaleMm(camera.lens, image_distance_mm) *
                FocusDisplacement(options.aberrations, camera.focus_depth_mm(), from_axis_px,
                                  FarthestCornerPx(camera.sensor)));
  }
  // The largest sigma of the defocus of a frame, over the field and all directions.
  double MostDefocusPx(const FrameState& grey, bool displaces_focus, bool displaces_colours) const {
    double most_px = 0;
    for (const double colour_per_mm : ColoursPerMm(displaces_colours))
      most_px = std::max(most_px, MostDefocusOfPx(OfColour(grey, colour_per_mm), displaces_focus));
    return most_px;
  }
  double MostDefocusOfPx(const FrameState& frame, bool displaces_focus) const {
    double most_px = frame.defocus_sigma_px;
    if (!displaces_focus) return most_px;
    const Eigen::Vector2d to_corner_px(FarthestCornerPx(options.camera.sensor), 0);
    for (const Eigen::Vector2d& place_px :
         {Eigen::Vector2d(0, 0), to_corner_px, Eigen::Vector2d(0, to_corner_px.x())}) {
      const Eigen::Matrix2d map_px =
          DefocusMapPx(frame.depth_mm, frame.image_distance_mm, frame.colour_per_mm, place_px);
      most_px = std::max(most_px, map_px.cwiseAbs().rowwise().sum().maxCoeff());
    }
    return most_px;
  }
  // K/p of a frame, px per unit slope of the chief ray.
  double ScalePx(double image_distance_mm) const {
    return DefocusScaleMm(options.camera.lens, image_distance_mm) /
           options.camera.sensor.pixel_pitch_mm;
  }

  // The target of a frame, as if a pixel of it had the width `pixel_mm` on the target's middle. Its
  // scale is the frame's at each depth.
  TiltedTarget TargetOf(const FrameState& frame, double pixel_mm, const EffectSet& on) const {
    const double scale_px = ScalePx(frame.image_distance_mm);
    return {on.Has(Effect::kTilt) ? options.target.tilt_deg * kPi / 180 : 0, frame.depth_mm,
            scale_px, pixel_mm * scale_px / frame.depth_mm};
  }
  // The target of a frame as seen by the columns around `x_px`, px from the axis.
  TiltedTarget SeenTarget(const FrameState& frame, double x_px) const {
    const double depth_mm = TargetOf(frame, frame.pixel_mm, decision.on).DepthMm(x_px);
    return TargetOf(frame, frame.pixel_mm * SeenScale(frame, depth_mm), decision.on);
  }
  bool IsTilted() const { return On(Effect::kTilt) && options.target.tilt_deg != 0; }

  std::vector<FrameState> FramesWith(const EffectSet& on) const {
    const Camera& camera = options.camera;
    const double focus_depth_mm = camera.focus_depth_mm();
    const double focus_pixel_mm = PixelMm(focus_depth_mm, camera.image_distance_mm(), on);
    std::vector<FrameState> states;
    for (int i = 0; i < options.frame_count; ++i) {
      using Purpose = RandomDraws::Purpose;
      const auto item = static_cast<std::uint32_t>(i);
      RandomDraws bench(options.seed, Purpose::kBench, item);
      RandomDraws lamp(options.seed, Purpose::kLamp, item);
      RandomDraws drift(options.seed, Purpose::kDrift, item);
      FrameState frame;
      frame.depth_mm = options.DepthMm(i);
      frame.image_distance_mm = options.ImageDistanceMm(i);
      const double position_mm =
          MovesFocus(options.moves) ? frame.image_distance_mm : frame.depth_mm;
      frame.reading_mm = DirectionSign(options.direction) * (position_mm - options.bench_offset_mm);
      if (on.Has(Effect::kReadingError)) {
        frame.reading_mm = options.stage.Written(
            frame.reading_mm + options.reading_sigma_mm * bench.Normal(), options.IsFalling(i), i);
      }
      if (options.counts_per_mm > 0)
        frame.reading_mm = std::round(options.counts_per_mm * frame.reading_mm);
      // The lamp is at the camera: the irradiance of the target is (zf/z)^2, 1 in the plane of
      // focus.
      const double falloff = options.lamp_falloff && on.Has(Effect::kLampFalloff)
                                 ? std::pow(focus_depth_mm / frame.depth_mm, 2)
                                 : 1.0;
      const double flicker = on.Has(Effect::kFlicker) ? options.flicker : 0;
      const double part =
          options.frame_count > 1 ? static_cast<double>(i) / (options.frame_count - 1) - 0.5 : 0;
      const double exposure =
          on.Has(Effect::kExposureDrift) ? std::exp2(options.exposure_drift_stops * part) : 1;
      frame.lamp =
          options.light_level * falloff * exposure * std::max(0.0, 1 + flicker * lamp.Normal());
      frame.band_phase = RandomDraws(options.seed, Purpose::kBands, item).Uniform();
      const double drift_sigma_mm =
          on.Has(Effect::kDrift) ? options.drift_sigma_px * focus_pixel_mm : 0;
      frame.drift_mm.x() = drift_sigma_mm * drift.Normal();
      frame.drift_mm.y() = drift_sigma_mm * drift.Normal();
      frame.pixel_mm = PixelMm(frame.depth_mm, frame.image_distance_mm, on);
      if (on.Has(Effect::kDefocus))
        frame.defocus_sigma_px = DefocusPx(frame.depth_mm, frame.image_distance_mm, 0);
      states.push_back(frame);
    }
    return states;
  }

  // Sets the distribution of the light of a point over the pupil. Its second moment is (kappa r)^2
  // for any law; the mean of the rays of a pixel off the axis is slightly displaced.
  void MakePupil() {
    law = options.pupil_law.value_or(On(Effect::kFalloff) ? PupilLaw::kPaper : PupilLaw::kUniform);
    if (law == PupilLaw::kUniform || !On(Effect::kDefocus) || options.camera.blur_ratio() == 0)
      return;
    const Camera& camera = options.camera;
    const double scale_mm = DefocusScaleMm(camera.lens, camera.image_distance_mm());
    const double distance_mm = On(Effect::kThickness) ? camera.image_distance_mm() : scale_mm;
    double most_px = 0;
    for (const FrameState& frame : frames)
      most_px = std::max(most_px, MostDefocusPx(frame, DisplacesFocus(), DisplacesColours()));
    // Every frequency of a frame is at most one cycle per px on each axis.
    profile.emplace(
        law,
        PupilOptics{stored_camera.psf, camera.blur_ratio() * camera.lens.aperture_radius_mm,
                    camera.focus_depth_mm(), distance_mm, scale_mm},
        2 * kPi * std::sqrt(2.0) * std::min(most_px, kSharpestTail));
    mean_per_landing = profile->mean_per_landing();
  }
  // Factor of the positions that a pixel sees at a depth, for the mean of its rays.
  double SeenScale(const FrameState& frame, double depth_mm) const {
    return 1 + mean_per_landing * Landing(depth_mm, frame.image_distance_mm, frame.colour_per_mm);
  }

  // Root of the mean variance over both axes, at the principal point.
  double MeanDefocusPx(const FrameState& frame) const {
    if (!DisplacesFocus()) return frame.defocus_sigma_px;
    return DefocusMapPx(frame.depth_mm, frame.image_distance_mm, 0, {0, 0}).norm() / std::sqrt(2.0);
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
    truth.pupil_law = PupilLawName(law);
    truth.moves = options.moves;
    if (On(Effect::kTilt)) truth.tilt_deg = options.target.tilt_deg;
    for (const ReliefPartOptions& part : options.target.relief)
      truth.relief_mm.push_back(part.height_mm);
    if (On(Effect::kShading)) truth.corner_stops = options.corner_stops;
    if (On(Effect::kDust)) truth.specks = options.speck_count;
    if (On(Effect::kAberrations)) truth.aberrations = options.aberrations;
    truth.counts_per_mm = options.counts_per_mm;
    truth.aberrations.distortion = Distortion();
    if (On(Effect::kBands)) truth.band_amplitude = options.band_amplitude;
    if (On(Effect::kExposureDrift)) truth.exposure_drift_stops = options.exposure_drift_stops;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      truth.frames.push_back({fmt::format("frames/frame_{:03d}.png", i), frames[i].depth_mm,
                              frames[i].reading_mm, std::hypot(floor_px, MeanDefocusPx(frames[i])),
                              frames[i].image_distance_mm});
    }
  }

  // Computes the light of a uniform target at each pixel, 1 at the principal point. By symmetry it
  // is a function of the distance from the principal point. It does not depend on the depth because
  // [S12] depends only on the ray.
  void MakeFalloff() {
    if (!On(Effect::kFalloff)) return;
    const Sensor& sensor = options.camera.sensor;
    const EffectConditions conditions = Conditions();
    const EffectOptics optics(conditions, decision.on);
    const Aperture aperture = ApertureOf(optics, decision.on);
    const Eigen::Vector2d& axis_px = sensor.principal_point_px;
    constexpr int kSteps = 1024;
    const double step_px = std::max(FarthestCornerPx(sensor), 1.0) / kSteps;
    std::vector<double> at_step;
    for (int i = 0; i <= kSteps + 1; ++i) {
      at_step.push_back(IrradianceAt(optics, axis_px + Eigen::Vector2d(i * step_px, 0),
                                     optics.image_distance_mm(), aperture)
                            .mean);
    }
    light_of_pixel.reserve(static_cast<std::size_t>(sensor.width_px) *
                           static_cast<std::size_t>(sensor.height_px));
    for (int y = 0; y < sensor.height_px; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < sensor.width_px; ++x) {
        const double place = (Eigen::Vector2d(x, y) - axis_px).norm() / step_px;
        const auto below = std::min(static_cast<std::size_t>(place), std::size_t{kSteps});
        const double rest = place - static_cast<double>(below);
        light_of_pixel.push_back(
            static_cast<float>(at_step[below] + rest * (at_step[below + 1] - at_step[below])));
      }
    }
  }

  // Multiplies the light of each pixel by what is fixed to the frame.
  void MakeFixedToFrame() {
    const Sensor& sensor = options.camera.sensor;
    const bool shades = On(Effect::kShading) && options.corner_stops != 0;
    const bool dusty = On(Effect::kDust) && options.speck_count > 0;
    if (!shades && !dusty) return;
    light_of_pixel.resize(
        static_cast<std::size_t>(sensor.width_px) * static_cast<std::size_t>(sensor.height_px), 1);
    if (shades) {
      for (int y = 0; y < sensor.height_px; ++y) {
        ThrowIfCancelled();
        for (int x = 0; x < sensor.width_px; ++x) {
          light_of_pixel[static_cast<std::size_t>(y * sensor.width_px + x)] *=
              static_cast<float>(ShadingAt(sensor, options.corner_stops, Eigen::Vector2d(x, y)));
        }
      }
    }
    if (!dusty) return;
    RandomDraws draws(options.seed, RandomDraws::Purpose::kSpecks, 0);
    for (int i = 0; i < options.speck_count; ++i) AddSpeck(&draws);
  }

  // A disc whose edge is a ramp of the error function. Where specks overlap, each takes its part.
  void AddSpeck(RandomDraws* draws) {
    constexpr double kSoftnessPx = 1.5;  // sigma of the edge
    const Sensor& sensor = options.camera.sensor;
    const double x_px = draws->Uniform() * (sensor.width_px - 1);
    const double y_px = draws->Uniform() * (sensor.height_px - 1);
    const double radius_px = options.speck_radius_px * (1 + 2 * draws->Uniform()) / 3;
    const double reach_px = radius_px + 4 * kSoftnessPx;
    const int bottom = std::min(sensor.height_px - 1, static_cast<int>(y_px + reach_px));
    const int right = std::min(sensor.width_px - 1, static_cast<int>(x_px + reach_px));
    for (int y = std::max(0, static_cast<int>(y_px - reach_px)); y <= bottom; ++y) {
      for (int x = std::max(0, static_cast<int>(x_px - reach_px)); x <= right; ++x) {
        const double inside_px = radius_px - std::hypot(x - x_px, y - y_px);
        const double part = 0.5 * std::erfc(-inside_px / (std::sqrt(2.0) * kSoftnessPx));
        light_of_pixel[static_cast<std::size_t>(y * sensor.width_px + x)] *=
            static_cast<float>(1 - options.speck_depth * part);
      }
    }
  }

  // The state in which the target is sharpest: the plane of focus if the sweep passes it, otherwise
  // the end of the sweep that is nearest to it.
  FrameState ReferenceState() const {
    FrameState state;
    if (MovesFocus(options.moves)) {
      const auto [least, most] =
          std::minmax(frames.front().image_distance_mm, frames.back().image_distance_mm);
      state.image_distance_mm = std::clamp(truth.image_distance_mm, least, most);
      state.depth_mm = options.DepthAt(state.image_distance_mm);
      return state;
    }
    const auto [near, far] = std::minmax(frames.front().depth_mm, frames.back().depth_mm);
    state.depth_mm = std::clamp(truth.focus_depth_mm, near, far);
    state.image_distance_mm = truth.image_distance_mm;
    return state;
  }

  // Position of the target's centre, mm: in the middle of the image at the reference depth. It is
  // off the axis if the principal point is not in the middle.
  Eigen::Vector2d TargetCentreMm(const EffectSet& on) const {
    const FrameState state = ReferenceState();
    return TargetOf(state, PixelMm(state.depth_mm, state.image_distance_mm, on), on).At(CentrePx());
  }

  // The tile must cover the field of every frame with its drift and blur; of a large blur it covers
  // only a part, because the target repeats itself beyond the tile. Its highest frequency is one
  // cycle per px in the nearest frame. The pixel box removes higher frequencies because its first
  // zero is there. Frequencies between half of that and that are the aliasing of a real sensor.
  // Effects that are left out do not change the content of the target.
  void MakeTile(const LinearImage& image) {
    const Sensor& sensor = options.camera.sensor;
    const EffectSet all = SweepEffects();
    const std::vector<FrameState> with_all = FramesWith(all);
    const double most_floor_px = options.camera.calibration->blur_floor_px->value;
    TileRequest request;
    request.centre_mm = TargetCentreMm(all);
    const FrameState reference = ReferenceState();
    request.pixel_mm = PixelMm(reference.depth_mm, reference.image_distance_mm, all);
    request.field_mm = std::min(sensor.width_px, sensor.height_px) * request.pixel_mm;
    double nearest_pixel_mm = with_all.front().pixel_mm;
    const Eigen::Vector2d& axis_px = sensor.principal_point_px;
    for (const FrameState& frame : with_all) {
      const double most_px = MostDefocusPx(frame, options.aberrations.DisplaceFocus(), true);
      const double margin_px = std::min(3 * std::hypot(most_floor_px, most_px),
                                        std::min(sensor.width_px, sensor.height_px) / 4.0) +
                               1;
      const TiltedTarget target = TargetOf(frame, frame.pixel_mm, all);
      for (double x_px : {-0.5 - margin_px, sensor.width_px - 0.5 + margin_px}) {
        // Beyond a side that is so far away, the target repeats itself.
        if (target.Nearness(x_px - axis_px.x()) < kMinNearness) {
          x_px = std::clamp(x_px, -0.5, sensor.width_px - 0.5);
        }
        nearest_pixel_mm = std::min({nearest_pixel_mm, target.PixelAcrossMm(x_px - axis_px.x()),
                                     target.PixelDownMm(x_px - axis_px.x())});
        for (const double y_px : {-0.5 - margin_px, sensor.height_px - 0.5 + margin_px}) {
          // A barrel shows more of the target.
          const Eigen::Vector2d seen_px =
              WithoutDistortion(std::min(0.0, options.aberrations.distortion),
                                Eigen::Vector2d(x_px, y_px) - axis_px, FarthestCornerPx(sensor));
          const Eigen::Vector2d reach_mm =
              (target.At(seen_px) - frame.drift_mm - request.centre_mm).cwiseAbs();
          request.width_mm = std::max(request.width_mm, 2 * reach_mm.x());
          request.height_mm = std::max(request.height_mm, 2 * reach_mm.y());
        }
      }
    }
    request.spacing_mm = nearest_pixel_mm / 2;
    RandomDraws draws(options.seed, RandomDraws::Purpose::kTexture, 0);
    TargetTile tile = DrawTargetTile(options.target, request, image, &draws);
    tile_texture.emplace(tile.samples);
    tile.samples.release();
    tile_frame = tile;
  }

  LinearImage Render(int frame_index) const {
    if (!(frame_index >= 0 && frame_index < options.frame_count)) {
      throw Error(fmt::format("frame {} does not exist: the sweep has {}", frame_index,
                              options.frame_count));
    }
    const FrameState& frame = frames[static_cast<std::size_t>(frame_index)];
    const std::vector<double> colours = ColoursPerMm(DisplacesColours());
    std::vector<LinearImage> channels;
    for (const double colour_per_mm : colours) {
      if (!channels.empty() && colour_per_mm == colours[channels.size() - 1]) {
        channels.push_back(channels.back());
        continue;
      }
      LinearImage image = RenderFrame(OfColour(frame, colour_per_mm));
      for (std::size_t i = 0; i < light_of_pixel.size(); ++i) image.values[i] *= light_of_pixel[i];
      if (On(Effect::kBands) && options.band_amplitude > 0) AddBands(frame.band_phase, &image);
      channels.push_back(std::move(image));
    }
    return Interleaved(std::move(channels));
  }

  // One image with the channels of several, which have one channel each.
  static LinearImage Interleaved(std::vector<LinearImage> channels) {
    if (channels.size() == 1) return std::move(channels[0]);
    LinearImage image{
        channels[0].width_px, channels[0].height_px, static_cast<int>(channels.size()), {}};
    image.values.reserve(channels.size() * channels[0].values.size());
    for (std::size_t i = 0; i < channels[0].values.size(); ++i) {
      for (const LinearImage& channel : channels) image.values.push_back(channel.values[i]);
    }
    return image;
  }

  // [D140] Each row (or column) is exposed at another phase of the lamp.
  void AddBands(double first_phase, LinearImage* image) const {
    const Sensor& sensor = options.camera.sensor;
    for (int y = 0; y < sensor.height_px; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < sensor.width_px; ++x) {
        const int line = options.bands_are_columns ? x : y;
        image->values[static_cast<std::size_t>(y * sensor.width_px + x)] *= static_cast<float>(
            BandFactor(options.band_amplitude, first_phase + line / options.band_period_px,
                       options.bands_are_square));
      }
    }
  }

  // [D44] Maximum change of the blur, or of the position that the outermost rows show, from one
  // column to the next: d(1/z)/dx = tan(tilt)/(z0 K/p), and sigma = kappa r K/p |1/z - 1/zf|; a row
  // y shows Y = (y p/K) z, and dz/z = -tan(tilt)/(N K/p) dx.
  double ChangePerColumnPx(const FrameState& frame) const {
    if (!IsTilted()) return 0;
    const Camera& camera = options.camera;
    const double tilt_rad = std::abs(options.target.tilt_deg) * kPi / 180;
    const double far_px =
        std::max(camera.sensor.principal_point_px.y(),
                 camera.sensor.height_px - 1 - camera.sensor.principal_point_px.y());
    const double least = Nearnesses(options.target.tilt_deg * kPi / 180).first;
    return std::tan(tilt_rad) *
           std::max(camera.blur_ratio() * camera.lens.aperture_radius_mm / frame.depth_mm,
                    std::max(far_px, 1.0) / (ScalePx(frame.image_distance_mm) * least));
  }

  // Sigma of the defocus, and below the light, of a column at a depth.
  double SeenDefocusPx(const FrameState& frame, double depth_mm) const {
    if (frame.in_focus) return 0;
    return IsTilted() && On(Effect::kDefocus)
               ? DefocusPx(depth_mm, frame.image_distance_mm, frame.colour_per_mm)
               : frame.defocus_sigma_px;
  }
  double LampAt(const FrameState& frame, double depth_mm) const {
    const bool falls = options.lamp_falloff && On(Effect::kLampFalloff);
    return frame.lamp * (falls ? std::pow(frame.depth_mm / depth_mm, 2) : 1);
  }

  // The transfer function of an aperture that is not round. A ray through A lands at -A c(z)/p in
  // the image: points nearer than the plane of focus show the outline turned by half a turn.
  std::function<std::complex<double>(const Eigen::Vector2d&)> ShapeOf(const FrameState& frame,
                                                                      double depth_mm) const {
    if (outline.empty() || frame.in_focus) return {};
    const double sigma_px =
        std::copysign(SeenDefocusPx(frame, depth_mm),
                      Landing(depth_mm, frame.image_distance_mm, frame.colour_per_mm));
    return [this, sigma_px](const Eigen::Vector2d& f) {
      return PolygonTransfer(outline, outline_moments, -sigma_px * f);
    };
  }

  // The outline of the aperture, scaled to a sigma of 1.
  void MakeOutline() {
    if (options.aperture.IsRound() || !On(Effect::kApertureShape) || !On(Effect::kDefocus)) return;
    outline = options.aperture.Corners();
    const PolygonMoments moments = MomentsOf(outline);
    for (Eigen::Vector2d& corner : outline) corner = (corner - moments.centroid) / moments.Sigma();
    outline_moments = MomentsOf(outline);
    truth.aperture = options.aperture;
  }

  // Columns `first` .. `last` of a grid of pixels with the blur and the scale at the column
  // `node_px` from the axis. Pixel (x, y) shows the point that its chief ray meets, so that the
  // image shows the target upright.
  cv::Mat TileColumns(const FrameState& frame, const PixelGrid& grid, int first, int last,
                      double node_px) const {
    const Eigen::Vector2d beside_mm = -frame.drift_mm - tile_frame.origin_mm;
    const TiltedTarget target = SeenTarget(frame, node_px);
    const double across_mm = grid.step_px * target.PixelAcrossMm(node_px);
    const double down_mm = target.PixelDownMm(node_px);
    const auto periods_at = [&](const TiltedTarget& seen, double x_px) {
      return (seen.At({x_px, 0}).x() + beside_mm.x()) / tile_frame.width_mm;
    };
    AxisSampling x{periods_at(target, grid.XPx(first)), across_mm / tile_frame.width_mm,
                   last - first + 1};
    if (IsTilted()) {
      for (int column = first; column <= last; ++column) {
        const double x_px = grid.XPx(column);
        x.at.push_back(periods_at(SeenTarget(frame, x_px), x_px));
      }
    }
    const AxisSampling y{(grid.YPx(0) * down_mm + beside_mm.y()) / tile_frame.height_mm,
                         grid.step_px * down_mm / tile_frame.height_mm, grid.rows};
    const double depth_mm = target.DepthMm(node_px);
    return tile_texture->Evaluate(
        x, y,
        {frame.is_bare ? 0 : floor_px, stored_camera.psf, SeenDefocusPx(frame, depth_mm),
         !frame.is_bare && On(Effect::kPixelBox), profile ? &*profile : nullptr, 1 / grid.step_px,
         ShapeOf(frame, depth_mm)});
  }

  // The light of a grid of pixels of a texture, without the factors of each pixel, CV_64F.
  cv::Mat RenderTile(const FrameState& frame, const PixelGrid& grid) const {
    cv::Mat image = cv::Mat::zeros(grid.rows, grid.columns, CV_64F);
    const auto add = [&](const cv::Mat& light, int first, const auto& factor) {
      for (int i = 0; i < light.rows; ++i) {
        ThrowIfCancelled();
        const double* row = light.ptr<double>(i);
        double* to = image.ptr<double>(i) + first;
        for (int j = 0; j < light.cols; ++j) to[j] += factor(first + j) * row[j];
      }
    };
    if (!IsTilted()) {
      add(TileColumns(frame, grid, 0, grid.columns - 1, 0), 0, [&](int) { return frame.lamp; });
      return image;
    }
    const std::vector<int> nodes = NodesOf(grid.columns, grid.step_px * ChangePerColumnPx(frame));
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const int node = nodes[n];
      const int before = n > 0 ? nodes[n - 1] : node - 1;
      const int after = n + 1 < nodes.size() ? nodes[n + 1] : node + 1;
      add(TileColumns(frame, grid, before + 1, after - 1, grid.XPx(node)), before + 1,
          [&](int column) {
            const double share = column < node
                                     ? static_cast<double>(column - before) / (node - before)
                                     : static_cast<double>(after - column) / (after - node);
            const double x_px = grid.XPx(column);
            return share * LampAt(frame, SeenTarget(frame, x_px).DepthMm(x_px));
          });
    }
    return image;
  }

  LinearImage RenderFrame(const FrameState& frame) const {
    const Sensor& sensor = options.camera.sensor;
    const PixelGrid pixels{-sensor.principal_point_px, 1, sensor.width_px, sensor.height_px};
    const cv::Mat light = !options.target.relief.empty()          ? RenderRelief(frame, pixels)
                          : DisplacesFocus() || Distortion() != 0 ? RenderAberrated(frame, pixels)
                                                                  : RenderGrid(frame, pixels);
    LinearImage image{sensor.width_px, sensor.height_px, 1, {}};
    image.values.reserve(light.total());
    for (int y = 0; y < light.rows; ++y) {
      const double* row = light.ptr<double>(y);
      for (int x = 0; x < light.cols; ++x) image.values.push_back(static_cast<float>(row[x]));
    }
    return image;
  }
  cv::Mat RenderGrid(const FrameState& frame, const PixelGrid& grid) const {
    return tile_texture ? RenderTile(frame, grid) : RenderEdge(frame, grid);
  }

  // A part of a relief in a frame, without blur floor and pixel box.
  FrameState StateOfPart(const FrameState& frame, double height_mm) const {
    FrameState part = frame;
    part.depth_mm = frame.depth_mm - height_mm;
    part.lamp = LampAt(frame, part.depth_mm);
    part.pixel_mm = PixelMm(part.depth_mm, part.image_distance_mm, decision.on);
    if (On(Effect::kDefocus))
      part.defocus_sigma_px = DefocusPx(part.depth_mm, part.image_distance_mm, 0);
    part.is_bare = true;
    return part;
  }
  // The defocus with its sign: points nearer than the plane of focus have a positive one.
  double SignedDefocusPx(const FrameState& frame) const {
    return std::copysign(
        frame.defocus_sigma_px,
        DefocusPerAperture(options.camera.lens, frame.image_distance_mm, frame.depth_mm));
  }

  // Computes the target and the parts in front of it on a fine grid, and lets each spread its light
  // by its own defocus. Blur floor and pixel box belong to the sensor's side and come last.
  cv::Mat RenderRelief(const FrameState& frame, const PixelGrid& pixels) const {
    const std::vector<ReliefPartOptions>& heights = options.target.relief;
    std::vector<FrameState> states = {StateOfPart(frame, 0)};
    double most_px = states[0].defocus_sigma_px;
    for (const ReliefPartOptions& part : heights) {
      states.push_back(StateOfPart(frame, part.height_mm));
      most_px = std::max(most_px, states.back().defocus_sigma_px);
    }
    const double border = kFineBorder + std::ceil(kBlurReach * most_px / kFinePx);
    const int twice = static_cast<int>(2 * border);
    const PixelGrid fine{pixels.first_px - Eigen::Vector2d::Constant(kFinePx * border), kFinePx,
                         static_cast<int>(std::lround((pixels.columns - 1) / kFinePx)) + 1 + twice,
                         static_cast<int>(std::lround((pixels.rows - 1) / kFinePx)) + 1 + twice};
    const Eigen::Vector2d centre_mm = TargetCentreMm(decision.on);
    std::vector<ReliefLayer> layers;
    for (std::size_t k = 0; k < states.size(); ++k) {
      ReliefLayer layer;
      FrameState still = states[k];
      still.in_focus = true;
      layer.light = RenderTile(still, fine);
      layer.defocus_px = SignedDefocusPx(states[k]);
      if (k == 0) layer.blurred = RenderTile(states[k], fine);
      if (k > 0) {
        layer.cover = cv::Mat(fine.rows, fine.columns, CV_64F);
        const double px_mm = SeenTarget(states[k], 0).PixelDownMm(0);
        for (int y = 0; y < fine.rows; ++y) {
          ThrowIfCancelled();
          for (int x = 0; x < fine.columns; ++x) {
            const Eigen::Vector2d place_mm =
                px_mm * Eigen::Vector2d(fine.XPx(x), fine.YPx(y)) - frame.drift_mm - centre_mm;
            layer.cover.at<double>(y, x) = CoverAt(heights[k - 1], place_mm, kFinePx * px_mm);
          }
        }
      }
      layers.push_back(layer);
    }
    const auto transfer = [this](double sigma_px, const Eigen::Vector2d& f) {
      return profile ? profile->Transfer(2 * kPi * sigma_px * f.norm())
                     : DefocusTransfer(stored_camera.psf, sigma_px, f.x(), f.y());
    };
    const cv::Mat light =
        Filtered(ReliefImage(layers[0], {layers.begin() + 1, layers.end()}, kFinePx,
                             stored_camera.psf, transfer),
                 kFinePx, [this](const Eigen::Vector2d& f) {
                   return GaussianTransfer(floor_px, f.x(), f.y()) *
                          (On(Effect::kPixelBox) ? PixelBoxTransfer(f.x(), f.y()) : 1);
                 });
    cv::Mat image(pixels.rows, pixels.columns, CV_64F);
    const int steps = static_cast<int>(std::lround(1 / kFinePx));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        image.at<double>(y, x) = light.at<double>(static_cast<int>(border) + steps * y,
                                                  static_cast<int>(border) + steps * x);
      }
    }
    return image;
  }

  // Computes the image of a lens without distortion on a fine grid, in focus, lets each point of it
  // spread its light, and displaces it.
  cv::Mat RenderAberrated(const FrameState& frame, const PixelGrid& pixels) const {
    const PixelGrid fine = FineGrid(frame, pixels);
    FrameState still = frame;
    if (DisplacesFocus()) still.in_focus = true;
    cv::Mat light = RenderGrid(still, fine);
    if (DisplacesFocus()) {
      const auto map_px = [&](const Eigen::Vector2d& at) {
        const Eigen::Vector2d from_axis_px = fine.first_px + fine.step_px * at;
        const double depth_mm = TargetOf(frame, frame.pixel_mm, decision.on)
                                    .DepthMm(std::clamp(from_axis_px.x(), pixels.first_px.x(),
                                                        pixels.XPx(pixels.columns - 1)));
        return DefocusMapPx(depth_mm, frame.image_distance_mm, frame.colour_per_mm, from_axis_px);
      };
      light = Blurred(light, fine.step_px,
                      {stored_camera.psf, profile ? &*profile : nullptr, map_px, floor_px});
    }
    cv::Mat image(pixels.rows, pixels.columns, CV_64F);
    for (int y = 0; y < image.rows; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < image.cols; ++x) {
        const Eigen::Vector2d place_px = Undistorted({pixels.XPx(x), pixels.YPx(y)});
        image.at<double>(y, x) = InterpolateSinc(light, (place_px - fine.first_px) / fine.step_px);
      }
    }
    return image;
  }

  // The grid for the undistorted image of these pixels, with a border for the interpolation and for
  // the light that comes from beyond the image.
  PixelGrid FineGrid(const FrameState& frame, const PixelGrid& pixels) const {
    const Eigen::Vector2d last_px(pixels.XPx(pixels.columns - 1), pixels.YPx(pixels.rows - 1));
    Eigen::Vector2d low_px = pixels.first_px, high_px = last_px;
    for (const double x_px : {pixels.first_px.x(), 0.0, last_px.x()}) {
      for (const double y_px : {pixels.first_px.y(), 0.0, last_px.y()}) {
        const Eigen::Vector2d place_px = Undistorted({x_px, y_px});
        low_px = low_px.cwiseMin(place_px);
        high_px = high_px.cwiseMax(place_px);
      }
    }
    const double reach_px = DisplacesFocus() ? kBlurReach * MostDefocusOfPx(frame, true) : 0;
    const double border = kFineBorder + std::ceil(reach_px / kFinePx);
    // Whole steps from the first pixel, so that pixels of an undistorted image are samples.
    const Eigen::Vector2d before = ((pixels.first_px - low_px) / kFinePx).array().ceil() + border;
    const Eigen::Vector2d after = ((high_px - pixels.first_px) / kFinePx).array().ceil() + border;
    const Eigen::Vector2d count = before + after;
    return {pixels.first_px - kFinePx * before, kFinePx, static_cast<int>(count.x()) + 1,
            static_cast<int>(count.y()) + 1};
  }
  Eigen::Vector2d Undistorted(const Eigen::Vector2d& from_axis_px) const {
    return WithoutDistortion(Distortion(), from_axis_px, FarthestCornerPx(options.camera.sensor));
  }

  // An edge through the target's centre, dark on the left and bright on the right. A positive angle
  // leans its upper end to the right.
  cv::Mat RenderEdge(const FrameState& frame, const PixelGrid& grid) const {
    cv::Mat image(grid.rows, grid.columns, CV_64F);
    for (const ColumnStrip& strip :
         StripsOf(grid.columns, grid.step_px * ChangePerColumnPx(frame))) {
      ThrowIfCancelled();
      RenderEdge(frame, grid, strip, &image);
    }
    return image;
  }

  // An edge on the target is a line g = 0, where g is the distance on the target in mm. The
  // gradient of g in the image converts it to the distance of a pixel from the line, in px, and
  // gives its direction.
  void RenderEdge(const FrameState& frame, const PixelGrid& grid, const ColumnStrip& strip,
                  cv::Mat* image) const {
    const TargetOptions& options_of = options.target;
    const double middle_x_px = grid.XPx(strip.middle_px());
    const TiltedTarget target = SeenTarget(frame, middle_x_px);
    const Eigen::Vector2d on_edge_mm = TargetCentreMm(decision.on) + frame.drift_mm;
    const double angle_rad = options_of.edge_angle_deg * kPi / 180;
    const Eigen::Vector2d normal(std::cos(angle_rad), std::sin(angle_rad));
    const auto distance_mm = [&](const Eigen::Vector2d& from_axis_px) {
      return normal.dot(target.At(from_axis_px) - on_edge_mm);
    };

    // The point where the edge crosses the middle of the strip, or the end of the middle that is
    // nearest to the edge.
    Eigen::Vector2d middle_px(middle_x_px, 0);
    const double down_mm = target.PixelDownMm(middle_px.x());
    const double row_px = -distance_mm(middle_px) / (normal.y() * down_mm);
    middle_px.y() =
        std::clamp(std::isnan(row_px) ? 0 : row_px, grid.YPx(0), grid.YPx(grid.rows - 1));
    const Eigen::Vector2d gradient(normal.x() * target.PixelAcrossMm(middle_px.x()) +
                                       normal.y() * target.DownPerColumnMm(middle_px),
                                   normal.y() * down_mm);
    const double pixel_mm = gradient.norm();

    const double depth_mm = target.DepthMm(middle_px.x());
    const double defocus_px = SeenDefocusPx(frame, depth_mm);
    const double ink_px =
        options_of.kind == TargetKind::kPrintedEdge ? options_of.ink_sigma_mm / pixel_mm : 0;
    const bool disc = stored_camera.psf == Psf::kDisc;
    const double angle_of_normal_rad = std::atan2(gradient.y(), gradient.x());
    const double still_px = std::hypot(floor_px, ink_px);
    const EdgeSpread edge =
        profile && defocus_px > 0
            ? EdgeSpread(angle_of_normal_rad, still_px, *profile, defocus_px, On(Effect::kPixelBox))
            : EdgeSpread(angle_of_normal_rad, std::hypot(still_px, disc ? 0 : defocus_px),
                         disc ? 2 * defocus_px : 0, On(Effect::kPixelBox));
    const double lamp = LampAt(frame, depth_mm);
    const double dark = lamp * (1 - options_of.contrast);
    const double step = 2 * lamp * options_of.contrast;
    for (int y = 0; y < grid.rows; ++y) {
      ThrowIfCancelled();
      auto* row = image->ptr<double>(y);
      for (int x = strip.first; x < strip.first + strip.count; ++x) {
        row[x] = dark + step * edge.At(distance_mm({grid.XPx(x), grid.YPx(y)}) / pixel_mm);
      }
    }
  }

  SweepSimulationOptions options;
  EffectSelection decision;
  Camera stored_camera;
  double floor_px = 0;
  PupilLaw law = PupilLaw::kUniform;
  std::optional<PupilProfile> profile;  // none for the uniform law, whose blur is that of the PSF
  double mean_per_landing = 0;
  std::vector<Eigen::Vector2d> outline;  // of sigma 1; empty: a round aperture
  PolygonMoments outline_moments;
  std::vector<float> light_of_pixel;  // empty without fall-off
  std::vector<FrameState> frames;
  SweepTruth truth;
  std::optional<PeriodicImage> tile_texture;  // none for an edge
  TargetTile tile_frame;  // position of the tile; the samples are in tile_texture
};

SweepSimulator::SweepSimulator(const SweepSimulationOptions& options,
                               const LinearImage& target_image)
    : impl_(std::make_unique<Impl>(options, target_image)) {}

SweepSimulator::~SweepSimulator() = default;

LinearImage SweepSimulator::RenderNoiseless(int frame_index) const {
  return impl_->Render(frame_index);
}

EncodedImage SweepSimulator::RenderFrame(int frame_index) const {
  LinearImage image = impl_->Render(frame_index);
  const SweepSimulationOptions& options = impl_->options;
  AddSensorNoise({options.full_well_electrons, options.read_noise_electrons}, impl_->decision.on,
                 options.seed, static_cast<std::uint32_t>(frame_index), &image);
  return ToEncoded(image, impl_->stored_camera.sensor.transfer,
                   impl_->On(Effect::kQuantisation) ? options.bits : 16);
}

const SweepTruth& SweepSimulator::truth() const { return impl_->truth; }

const EffectSelection& SweepSimulator::effects() const { return impl_->decision; }

const Camera& SweepSimulator::camera() const { return impl_->stored_camera; }

}  // namespace thicklens::model
