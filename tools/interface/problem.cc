// The steps from a photograph, its depth and its camera to what a solver starts from. Their order
// is that of `thicklens estimate`; it determines the result and the first error that is reported.
#include "tools/interface/problem.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "thicklens/depth_fit.h"
#include "thicklens/distortion.h"
#include "thicklens/estimator/aperture_blur.h"
#include "thicklens/estimator/depth_noise.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/refine_depth.h"
#include "thicklens/io/exif.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/readings.h"
#include "thicklens/model/effect_impact.h"
#include "thicklens/model/undistort.h"
#include "tools/interface/clipped_highlights.h"
#include "tools/interface/depth_causes.h"
#include "tools/interface/depth_plausibility.h"
#include "tools/interface/depth_reports.h"
#include "tools/interface/depth_values_choice.h"
#include "tools/interface/effects_choice.h"
#include "tools/interface/exif_comparison.h"
#include "tools/interface/falloff_choice.h"
#include "tools/interface/fit_depth.h"
#include "tools/interface/prepare_aperture.h"
#include "tools/interface/stated_transfer.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

std::string NameOf(const Image& photo) { return photo.source().empty() ? "photo" : photo.source(); }
std::string NameOf(const DepthMap& depth) { return depth.source.empty() ? "depth" : depth.source; }
std::string NameOf(const Camera& camera) {
  return camera.source.empty() ? fmt::format("camera '{}'", camera.name) : camera.source;
}

// The photograph as a file; what remains of it once its pixels have been taken.
struct PhotoFile {
  std::string name;                   // in messages
  std::string path;                   // empty: it is not from a file
  const io::RawFacts* raw = nullptr;  // null: it is not a raw file
};

// Says what a user should know about the orientation that the file states; empty: nothing.
std::string OrientationRemark(const io::ImageFacts* facts, const RunScope& run) {
  if (facts == nullptr || facts->orientation == 1) return "";
  return facts->is_orientation_applied
             ? fmt::format("orientation {} is applied ({}): the depth map must be turned alike",
                           facts->orientation, run.Option("photo.orientation"))
             : fmt::format(
                   "orientation {} is not applied, the pixels are as stored: a depth map of "
                   "the turned image needs {}",
                   facts->orientation, run.Option("photo.orientation"));
}

// ---- 1. Sizes and crop.

Image Cropped(const Image& photo, const PixelRect& rect) {
  if (photo.is_linear()) {
    model::LinearImage part = model::CropImage(photo.light(), rect);
    return Image::FromLight(part.width_px, part.height_px, photo.order(), std::move(part.values),
                            photo.transfer().value_or(TransferCurve::Srgb()), photo.source());
  }
  model::EncodedImage part = model::CropImage(photo.encoded(), rect);
  return Image::FromEncoded(part.width_px, part.height_px, photo.order(), part.bits,
                            std::move(part.values), photo.transfer(), photo.source());
}

// Photograph and depth are cut alike. If only one of them has the crop's size, it was cut before.
void CutToCrop(const std::optional<PixelRect>& crop, Image* photo, DepthMap* depth, RunScope* run) {
  if (!crop) return;
  const bool differ =
      photo->width_px() != depth->width_px || photo->height_px() != depth->height_px;
  const auto was_cut = [&](int width_px, int height_px, const std::string& name) {
    const bool cut = width_px == crop->width && height_px == crop->height && differ;
    if (cut) {
      run->Warn(fmt::format(
          "{}: has the size of {} already and is not cropped (a smaller depth map of the whole "
          "photograph is stated by {} 0,0 and the photograph's size)",
          name, run->Option("crop"), run->Option("depth_fit.part")));
    }
    return cut;
  };
  const bool cut_photo = !was_cut(photo->width_px(), photo->height_px(), NameOf(*photo));
  const bool cut_depth = !was_cut(depth->width_px, depth->height_px, NameOf(*depth));
  if (cut_photo) {
    *photo = WithFileContext(run->Option("crop") + ": " + NameOf(*photo),
                             [&] { return Cropped(*photo, *crop); });
  }
  if (cut_depth) {
    *depth = WithFileContext(run->Option("crop"), [&] { return depth->Cropped(*crop); });
  }
}

// Whether one of photograph and depth map is the crop of the other already, unless it is stated
// what the map shows. A map of the crop's size may also be a smaller one of the whole photograph;
// the warning of CutToCrop says as what it is taken.
bool IsCutAlready(const EstimateOptions& options, const Image& photo, const DepthMap& depth) {
  const std::optional<PixelRect>& crop = options.crop;
  if (!crop || options.depth_fit.part || options.depth_fit.camera != nullptr) return false;
  const auto is_crop = [&](int width_px, int height_px) {
    return width_px == crop->width && height_px == crop->height;
  };
  const auto contains_crop = [&](int width_px, int height_px) {
    return crop->x + crop->width <= width_px && crop->y + crop->height <= height_px;
  };
  const bool photo_is_crop = is_crop(photo.width_px(), photo.height_px());
  const bool depth_is_crop = is_crop(depth.width_px, depth.height_px);
  return (photo_is_crop && contains_crop(depth.width_px, depth.height_px)) ||
         (depth_is_crop && !photo_is_crop);
}

// ---- 2. The distortion of the lens.

// The distortion of this photograph, of which the camera's sensor may show more; absent: it is
// taken as undistorted.
std::optional<LensDistortion> DistortionOf(const std::string& photo, int width_px, int height_px,
                                           const std::optional<Camera>& camera,
                                           const EstimateOptions& options, RunScope* run) {
  if (!camera || !options.undistort) return std::nullopt;
  // A camera that was assumed or simulated was measured on no frames.
  const auto is_measured = [](const std::string& method) {
    return method != "assumed" && method != "simulated";
  };
  const model::CameraCalibration* const found =
      camera->calibration ? &*camera->calibration : nullptr;
  const bool was_undistorted = found != nullptr && found->evidence.undistorted;
  if (!camera->distortion) {
    if (was_undistorted) {
      run->Warn(fmt::format(
          "{}: it was calibrated on undistorted frames, but states no lens.distortion any more: {} "
          "is taken as undistorted",
          NameOf(*camera), photo));
    }
    return std::nullopt;
  }
  if (found != nullptr && !was_undistorted && is_measured(found->evidence.method)) {
    run->Warn(fmt::format(
        "{}: it states lens.distortion, but was calibrated on frames that were not undistorted: d1 "
        "and kappa may differ for {}, which is; calibrate with the same distortion",
        NameOf(*camera), photo));
  }
  const std::string doubt = DoubtOfDistortion(*camera);
  if (!doubt.empty()) run->Warn(fmt::format("{}: {}", NameOf(*camera), doubt));
  return WithFileContext(photo, [&] {
    const LensDistortion& stated = *camera->distortion;
    if (!options.sensor_origin) return stated.ScaledTo(width_px, height_px);
    return stated.ScaledTo(camera->sensor.width_px, camera->sensor.height_px)
        .OfPart(options.sensor_origin->x, options.sensor_origin->y, width_px, height_px);
  });
}

// A pixel without a source, whose number `missing` gets, continues the image: an edge to black
// would be light that no blur explains.
Image UndistortedAndContinued(const Image& image, const LensDistortion& distortion,
                              std::size_t* missing) {
  Image undistorted = UndistortImage(image, distortion, missing);
  if (*missing == 0) return undistorted;
  model::LinearImage light = undistorted.light();
  model::ContinueBeyondSource(distortion, &light);
  return undistorted.WithLight(std::move(light.values));
}

// Takes the distortion out of photograph and depth map. The photograph becomes linear light, as it
// would be later. A pixel that it does not show continues the image and gets no depth, so that it
// is filled like a hole.
void Undistort(const LensDistortion& distortion, const TransferCurve& transfer, Image* photo,
               DepthMap* depth, EstimateDiagnostics* diagnostics, RunScope* run) {
  const std::string name = NameOf(*photo);
  if (depth->width_px != photo->width_px() || depth->height_px != photo->height_px()) {
    throw Error(fmt::format(
        "{}: it is {}x{} px, the image {} is {}x{} px: both are undistorted, for which the whole "
        "field of the same size is needed; undistort them before (thicklens undistort) and state "
        "that they are ({})",
        NameOf(*depth), depth->width_px, depth->height_px, name, photo->width_px(),
        photo->height_px(), run->Option("undistort")));
  }
  std::size_t missing = 0;
  const Image linear = Image::FromLight(photo->width_px(), photo->height_px(), photo->order(),
                                        photo->ToLight(transfer).values, transfer, photo->source());
  *photo = UndistortedAndContinued(linear, distortion, &missing);
  std::vector<float> confidence = std::move(depth->confidence);
  depth->confidence.clear();
  if (!confidence.empty()) {
    DepthMap map = *depth;
    map.values = std::move(confidence);
    confidence = UndistortDepth(map, distortion).values;
  }
  *depth = UndistortDepth(*depth, distortion);
  depth->confidence = std::move(confidence);
  diagnostics->without_source_share =
      static_cast<double>(missing) / (static_cast<double>(photo->width_px()) * photo->height_px());
  diagnostics->undistorted = distortion.Description();
  constexpr double kPercent = 100;
  run->Inform(fmt::format(
      "{}: photograph and depth map are undistorted by the {} of {}, by up to {:.3g} px{}", name,
      distortion.Description(), distortion.source.empty() ? "the camera" : distortion.source,
      distortion.LargestShiftPx(),
      missing == 0 ? ""
                   : fmt::format("; {:.2g} % of the pixels have no source and no depth",
                                 kPercent * diagnostics->without_source_share)));
}

// ---- 3. The camera of this photograph.

void CheckExif(const PhotoFile& photo, const Camera& camera, const PhotoSize& size, ExifCheck check,
               EstimateDiagnostics* diagnostics, RunScope* run) {
  if (photo.path.empty()) return;
  std::string damaged;
  const io::PhotoExif exif = io::ReadExifIfAny(photo.path, camera.sensor.width_px,
                                               camera.sensor.height_px, &damaged, photo.raw);
  if (!damaged.empty()) {
    run->Warn(damaged + "; it is not compared with the camera file");
    return;
  }
  if (exif.IsEmpty()) return;
  diagnostics->has_exif = true;
  std::string contradictions;
  diagnostics->exif = CompareExif(exif, camera, size);
  for (const ExifComparison& finding : diagnostics->exif) {
    if (finding.verdict == ExifComparison::Verdict::kAgrees) continue;
    const std::string text =
        fmt::format("{}: the photograph's EXIF states {}, the camera file {} ({})",
                    finding.quantity, finding.photo, finding.camera, finding.remark);
    const bool contradicts = finding.verdict == ExifComparison::Verdict::kContradicts;
    if (contradicts && check == ExifCheck::kRequire) {
      contradictions += (contradictions.empty() ? "" : "; ") + text;
    } else {
      run->Warn(fmt::format("{}: {}{}", photo.name, text,
                            contradicts ? fmt::format("; ignored ({})", run->Option("exif")) : ""));
    }
  }
  if (contradictions.empty()) return;
  throw Error(
      fmt::format("{}: it was not taken with the camera and setting of {}: {}; calibrate that "
                  "setting, name its "
                  "camera file, or use {} if EXIF is wrong",
                  photo.name, NameOf(camera), contradictions, run->Option("exif")));
}

// The position of the lens that the metadata of the photograph state in dioptres.
std::optional<double> DioptresOfFile(const PhotoFile& photo, std::string* from) {
  if (photo.path.empty()) return std::nullopt;
  constexpr double kMmPerMetre = 1000;
  try {
    model::ReadingOptions options;
    options.source = "exif";
    const model::ReadingSet found = io::ReadReadings("", {photo.path}, options);
    // A focus distance in m is too coarse, and a position without a unit may be a count.
    if (!found.in_dioptres || found.rows.empty()) return std::nullopt;
    *from = found.description;
    return kMmPerMetre / found.rows.front().reading_mm;
  } catch (const Error&) {
    return std::nullopt;  // the file states none
  }
}

// The camera with d1 of the position at which its lens was.
Camera AtLensPosition(const PhotoFile& photo, Camera camera, const EstimateOptions& options,
                      RunScope* run) {
  const bool has_positions = camera.calibration && camera.calibration->focus_positions &&
                             camera.calibration->image_distance_mm;
  if (!has_positions) {
    if (options.lens_position) {
      throw OptionError("lens_position",
                        fmt::format("{}: {} has no calibration.focus_positions with "
                                    "image_distance_mm; calibrate writes them from a sweep in "
                                    "which the lens or the sensor moves",
                                    run->Option("lens_position"), NameOf(camera)));
    }
    return camera;
  }
  const model::FocusPositions& positions = *camera.calibration->focus_positions;
  std::optional<double> position = options.lens_position;
  std::string from = run->Option("lens_position");
  if (!position && positions.unit == model::kDioptreUnit) position = DioptresOfFile(photo, &from);
  if (!position) {
    run->Warn(fmt::format(
        "{}: the camera's lens moves, and its position is not stated: d1 = {:.6g} mm of the "
        "calibration is used; state it by {}",
        photo.name, camera.image_distance_mm(), run->Option("lens_position")));
    return camera;
  }
  const double d1_mm = WithFileContext(from + ": " + NameOf(camera),
                                       [&] { return positions.ImageDistanceMm(*position); });
  camera.calibration->image_distance_mm->value = d1_mm;
  // The stored zf is that of the calibration.
  camera.calibration->evidence.focus_depth_mm.reset();
  run->Inform(fmt::format("{}: the lens at {:.6g} {} ({}): d1 = {:.6g} mm, zf = {:.6g} mm",
                          photo.name, *position, positions.unit, from, d1_mm,
                          camera.focus_depth_mm()));
  return camera;
}

// The camera behind an image of the full size, which may be a part of its sensor, and of that the
// crop.
Camera CameraFor(const PhotoFile& photo, const std::optional<TransferCurve>& transfer, int width_px,
                 int height_px, Camera camera, const EstimateOptions& options,
                 EstimateDiagnostics* diagnostics, RunScope* run) {
  if (transfer) camera.sensor.transfer = *transfer;
  for (const std::string& notice : NoticesOf(camera)) run->Warn(notice);
  camera = AtLensPosition(photo, std::move(camera), options, run);
  CheckExif(photo, camera, {width_px, height_px, options.sensor_origin.has_value()}, options.exif,
            diagnostics, run);
  if (options.sensor_origin) {
    const PixelRect part{options.sensor_origin->x, options.sensor_origin->y, width_px, height_px};
    camera = WithFileContext(run->Option("sensor_origin") + ": " + NameOf(camera),
                             [&] { return model::CropCamera(camera, part); });
  } else if (camera.sensor.width_px != width_px || camera.sensor.height_px != height_px) {
    throw Error(fmt::format(
        "{}: the image is {}x{} px, the sensor of {} has {}x{} px: they must be equal, or "
        "{} must state which part of the sensor the image is",
        photo.name, width_px, height_px, NameOf(camera), camera.sensor.width_px,
        camera.sensor.height_px, run->Option("sensor_origin")));
  }
  return options.crop ? model::CropCamera(camera, *options.crop) : camera;
}

// `facts` may be null.
TransferCurve TransferFor(const std::string& photo, const std::optional<TransferCurve>& given,
                          const io::ImageFacts* facts, const std::optional<Camera>& camera,
                          EstimateDiagnostics* diagnostics, RunScope* run) {
  diagnostics->transfer_from = given ? "image" : camera ? "camera" : "assumed";
  if (camera) {
    const std::string contradiction =
        given || facts == nullptr ? "" : TransferContradiction(*facts, *camera);
    if (!contradiction.empty()) {
      run->Warn(fmt::format("{}: {}, or state it by {}", photo, contradiction,
                            run->Option("photo.transfer")));
    }
    return camera->sensor.transfer;
  }
  if (given) return *given;
  if (facts != nullptr && !StatedTransferName(*facts).empty()) {
    const auto stated = StatedTransferOf(*facts);
    if (!stated) {
      throw Error(fmt::format(
          "{}: the file states the transfer curve {}, which cannot be decoded: convert the image "
          "to sRGB or linear light, or state another curve by {}",
          photo, StatedTransferName(*facts), run->Option("photo.transfer")));
    }
    diagnostics->transfer_from = "file";
    return *stated;
  }
  run->Inform(fmt::format("{}: encoded values are assumed to be sRGB ({})", photo,
                          run->Option("photo.transfer")));
  return TransferCurve::Srgb();
}

// Measures what storing did to the photograph. `facts` may be null.
void FindStorageErrors(const Image& photo, const io::ImageFacts* facts,
                       EstimateDiagnostics* diagnostics) {
  if (photo.is_linear()) return;
  int bits = photo.encoded().bits;
  if (facts != nullptr && facts->significant_bits)
    bits = std::clamp(*facts->significant_bits, 1, bits);
  diagnostics->rounding_sigma = 1 / (std::sqrt(12.0) * (std::ldexp(1.0, bits) - 1));
  if (facts == nullptr || !facts->jpeg_error) return;
  constexpr double kLevels = 255;
  diagnostics->compression_sigma = facts->jpeg_error->rms_levels / kLevels;
  diagnostics->compression_sigma_of_mean = facts->jpeg_error->mean_levels / kLevels;
}

// ---- 4. The grid of the light field.

// UV on the aperture, where each view has one transmission; ST in the plane of focus unless a depth
// is given.
model::LightFieldGrid GridFor(const EstimateOptions& options, const Camera& camera,
                              const PreparedAperture& aperture, const RunScope& run) {
  const model::ApertureSamples samples =
      aperture.measured ? *aperture.measured
                        : model::SampleAperture(aperture.weights, camera.blur_ratio(),
                                                camera.lens.aperture_radius_mm);
  const double st_depth_mm = options.st_depth_mm.value_or(camera.focus_depth_mm());
  if (std::isinf(st_depth_mm)) {
    throw Error(fmt::format(
        "{}: the camera is focused at infinity, where no ST plane can lie: {} must give its depth",
        NameOf(camera), run.Option("st_depth_mm")));
  }
  return model::GridOnPlanes(camera, {0, st_depth_mm}, samples);
}

void CheckViewCounts(const Eigen::ArrayXXd& weights, RunScope* run) {
  if (weights.size() < 2) {
    throw OptionError("views",
                      "views: 1x1 is not a light field: one view is the image itself; at least two "
                      "views are expected, e.g. 3x3");
  }
  for (const auto& [count, axis] :
       {std::pair{weights.cols(), "u (across)"}, std::pair{weights.rows(), "v (down)"}}) {
    if (count == 1) {
      run->Warn(fmt::format("{}: one view along {}: no blur is modelled in that direction",
                            run->Option("views"), axis));
    }
  }
}

// ---- 5. The depth.

// A depth far from what the camera is focused at is possible, but more often its unit is wrong.
void WarnOfUnlikelyDepth(const DepthMap& map, const Camera& camera,
                         const model::DepthStatistics& depth, RunScope* run) {
  constexpr double kDefault = 4;
  const double focus_depth_mm = camera.focus_depth_mm();
  if (std::isinf(focus_depth_mm)) return;  // any depth is far from it
  if (depth.median_mm <= kDefault * focus_depth_mm &&
      depth.median_mm >= focus_depth_mm / kDefault) {
    return;
  }
  // Values beyond the near depth are reported in any case.
  const std::string cause = map.meaning.kind == DepthKind::kInverse ? "" : CauseInMap(map, *run);
  run->Warn(fmt::format(
      "{}: the median depth is {:.6g} mm, but the camera is focused at {:.6g} mm; is {} right?{}",
      NameOf(map), depth.median_mm, focus_depth_mm, run->Option("depth.meaning.unit"),
      cause.empty() ? "" : " Or: " + cause));
}

std::pair<double, double> DisparityRangePx(const estimator::DisparityMap& map) {
  const auto [least, most] = std::minmax_element(map.disparity.begin(), map.disparity.end());
  const double step = map.step.x() != 0 ? map.step.x() : map.step.y();
  return std::minmax({static_cast<double>(*least) * step, static_cast<double>(*most) * step});
}

// A disparity as large as the image does not occur in a scene.
void CheckDisparities(const DepthMap& map, const estimator::DisparityMap& disparity,
                      const RunScope& run) {
  const auto [low_px, high_px] = DisparityRangePx(disparity);
  const int size_px = std::max(disparity.width_px, disparity.height_px);
  if (std::max(std::abs(low_px), std::abs(high_px)) <= size_px) return;
  throw Error(fmt::format(
      "{}: disparities from {:.4g} to {:.4g} px per view step, but they must be within the {} px "
      "of the image; are {} right?",
      NameOf(map), low_px, high_px, size_px,
      map.meaning.kind == DepthKind::kDisparity
          ? fmt::format("{} and {}", run.Option("depth.meaning.disparity_scale"),
                        run.Option("depth.meaning.disparity_offset_px"))
      : map.meaning.kind == DepthKind::kInverse
          ? fmt::format("{} and {}, and the camera's aperture and focus,",
                        run.Option("depth.meaning.inverse_scale_dpt"),
                        run.Option("depth.meaning.inverse_offset_dpt"))
          : fmt::format("{}, and the camera's aperture and focus,",
                        run.Option("depth.meaning.unit"))));
}

void SmoothNoisyDepth(const EstimateOptions& options, const std::vector<float>& confidence,
                      estimator::DisparityMap* disparity, EstimateDiagnostics* diagnostics,
                      int threads) {
  diagnostics->depth_noise_px = estimator::DepthNoisePx(*disparity);
  if (!options.smooth_depth || !diagnostics->depth_noise_px ||
      !(*diagnostics->depth_noise_px > estimator::kSmoothedNoisePx)) {
    return;
  }
  estimator::SmoothedDepth smoothed =
      estimator::SmoothDepth(*disparity, *diagnostics->depth_noise_px, threads, confidence);
  *disparity = std::move(smoothed.map);
  diagnostics->depth_noise_left_px = smoothed.noise_left_px;
}

// The smoothing before it leaves little noise.
void RefineDepthOf(const EstimateOptions& options, const std::vector<bool>& was_hole, int threads,
                   estimator::EstimateInput* input, EstimateDiagnostics* diagnostics) {
  if (options.refine_depth == DepthRefining::kOff) return;
  estimator::DepthRefinementOptions refining;
  refining.eager = options.refine_depth == DepthRefining::kOn;
  refining.noise_px =
      diagnostics->depth_noise_left_px.value_or(diagnostics->depth_noise_px.value_or(0));
  refining.threads = threads;
  diagnostics->depth_refinement =
      estimator::RefineDepth(input->image, input->transfer, was_hole, refining, &input->disparity);
}

// ---- 6. The effects.

EffectSet EffectsOfModel(const AnySolver& solver, bool camera) {
  EffectSet effects = {Effect::kDefocus, Effect::kApertureShape};
  if (!std::holds_alternative<FunctionalSolver>(solver)) effects.Add(Effect::kOcclusion);
  return camera ? effects.With({Effect::kThickness, Effect::kFalloff}) : effects;
}

}  // namespace

model::EffectSelection SelectEffects(const EstimateOptions& options,
                                     const std::optional<Camera>& camera,
                                     const std::optional<model::DepthStatistics>& depth) {
  const EffectSet of_model = EffectsOfModel(options.solver, camera.has_value());
  RequireEffectsOf(options.effects, of_model);
  model::EffectSelectionOptions choice = ChoiceOf(options.effects);
  // Effects of the solution itself, which cost the time that they take.
  choice.kept = EffectsOfModel(options.solver, false);
  const bool is_gaussian = !options.aperture.shape && options.aperture.views_of == nullptr &&
                           camera && camera->psf == model::Psf::kGaussian &&
                           camera->measured_psf == nullptr;
  if (is_gaussian) choice.kept.Remove(Effect::kApertureShape);
  if (options.effects.LeavesOut(Effect::kDefocus)) {
    throw OptionError("effects",
                      "effects: defocus is what an estimate inverts and cannot be left out; the "
                      "image that is only warped by its depth is the baseline (DIBR) of a "
                      "comparison (thicklens compare --dibr)");
  }
  if (of_model.Has(Effect::kOcclusion) && options.effects.LeavesOut(Effect::kOcclusion)) {
    throw OptionError("effects",
                      "effects: occlusion cannot be left out of an estimate, because each view "
                      "shows the depth map from its own position; where nothing is occluded it "
                      "costs nothing");
  }
  if (!camera) return DecideWithoutCamera(options.effects, of_model);
  model::EffectConditions conditions;
  conditions.camera = *camera;
  const double focus_depth_mm = camera->focus_depth_mm();
  return model::SelectEffects(choice, conditions,
                              model::PlacesBetween(*camera, depth ? depth->min_mm : focus_depth_mm,
                                                   depth ? depth->max_mm : focus_depth_mm, true),
                              of_model);
}

PreparedProblem Prepare(Image photo, DepthMap map, const std::optional<Camera>& camera,
                        const EstimateOptions& options, EstimateDiagnostics* diagnostics,
                        RunScope* run) {
  const std::shared_ptr<const io::ImageFacts> facts = photo.facts();
  const PhotoFile file{NameOf(photo), photo.is_from_file() ? photo.source() : "",
                       facts != nullptr && facts->raw ? &*facts->raw : nullptr};
  const std::string turned = OrientationRemark(facts.get(), *run);
  // If there is a camera, the comparison with EXIF says it.
  if (!turned.empty() && !camera) run->Warn(file.name + ": " + turned);
  if (photo.channels() == 4) run->Warn(file.name + ": its alpha channel is ignored");
  Image part = photo.channels() == 4 ? photo.WithoutAlpha() : std::move(photo);
  FindStorageErrors(part, facts.get(), diagnostics);
  std::optional<Image> clipped = ClippedPartsOf(part, diagnostics);
  const std::optional<TransferCurve> given = part.transfer();
  DropDoubtful(options.depth_fit, &map, run);
  if (!IsCutAlready(options, part, map)) {
    try {
      map = FitDepthWithin(std::move(map), part, options.depth_fit, &diagnostics->depth_fit, run);
    } catch (const OptionError&) {
      throw;
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      if (turned.empty()) throw;
      throw Error(fmt::format("{}; of the image, {}", error.what(), turned));
    }
  }
  if (const auto distortion =
          DistortionOf(file.name, part.width_px(), part.height_px(), camera, options, run)) {
    Undistort(*distortion, given.value_or(camera->sensor.transfer), &part, &map, diagnostics, run);
    std::size_t missing = 0;
    if (clipped) clipped = UndistortedAndContinued(*clipped, *distortion, &missing);
  }
  const int full_width_px = std::max(part.width_px(), map.width_px);
  const int full_height_px = std::max(part.height_px(), map.height_px);
  CutToCrop(options.crop, &part, &map, run);
  if (clipped && clipped->width_px() * clipped->height_px() != part.width_px() * part.height_px())
    clipped = clipped->Cropped(*options.crop);
  if (map.width_px != part.width_px() || map.height_px != part.height_px()) {
    throw Error(
        fmt::format("{}: it is {}x{} px, the image {} is {}x{} px: the sizes must be equal{}",
                    NameOf(map), map.width_px, map.height_px, NameOf(part), part.width_px(),
                    part.height_px(), turned.empty() ? "" : "; of the image, " + turned));
  }
  PreparedProblem prepared;
  prepared.compression_sigma = diagnostics->compression_sigma.value_or(0);
  prepared.input = std::make_shared<estimator::EstimateInput>();
  estimator::EstimateInput& input = *prepared.input;
  if (camera) {
    Camera undistorted = *camera;
    undistorted.distortion.reset();  // from here on, there is none
    input.camera = CameraFor(file, given, full_width_px, full_height_px, std::move(undistorted),
                             options, diagnostics, run);
  }
  input.transfer = TransferFor(file.name, given, facts.get(), input.camera, diagnostics, run);
  diagnostics->transfer = input.transfer;
  if (facts != nullptr && StatedTransferOf(*facts) == input.transfer)
    prepared.colour_profile = facts->icc_profile;
  input.image = part.ToLight(input.transfer);
  if (clipped) {
    std::vector<std::uint8_t> marks = MarksOf(*clipped);
    clipped.reset();  // its memory is needed
    LimitToMarks(marks, &diagnostics->clipping);
    const bool has_bounds =
        diagnostics->clipping.share > 0 && options.clipped == ClippedHighlights::kBounds;
    if (has_bounds) input.clipped = std::move(marks);
  }
  ReportClipping(file.name, options, diagnostics->clipping, run);
  part = Image();  // its memory is needed
  const Camera* const known = input.camera ? &*input.camera : nullptr;
  const PreparedAperture aperture = PrepareAperture(options, known, run);
  diagnostics->aperture_shape = aperture.shape;
  diagnostics->aperture_from = aperture.from;
  input.weights = aperture.weights;
  CheckViewCounts(input.weights, run);
  if (input.camera) {
    input.grid = GridFor(options, *input.camera, aperture, *run);
    WarnOfOtherSteps(options, aperture, *input.grid, *input.camera, run);
  }
  ReportReading(map, run);  // also where the map is refused
  FindRelativeValues(options, prepared, &map, diagnostics, run);
  PreparedDepth prepared_depth =
      PrepareDepth(map, input.image, known, input.grid ? &*input.grid : nullptr, run);
  const std::string beyond = ValuesBeyondNear(map, *run);
  if (!beyond.empty()) run->Warn(fmt::format("{}: {}", NameOf(map), beyond));
  input.disparity = std::move(prepared_depth.disparity);
  prepared.was_hole = std::move(prepared_depth.was_hole);
  diagnostics->depth = prepared_depth.depth;
  diagnostics->holes_filled = prepared_depth.holes;
  diagnostics->holes = prepared_depth.found_holes;
  diagnostics->holes_share = static_cast<double>(prepared_depth.holes) /
                             static_cast<double>(input.disparity.disparity.size());
  if (prepared_depth.depth && map.meaning.kind != DepthKind::kDisparity) {
    WarnOfUnlikelyDepth(map, *input.camera, *prepared_depth.depth, run);
  }
  CheckDisparities(map, input.disparity, *run);
  ReportPlausibility(map, input.disparity, input.weights, !options.st_depth_mm, input.camera,
                     prepared_depth.depth, run);
  SmoothNoisyDepth(options, map.confidence, &input.disparity, diagnostics, run->threads());
  RefineDepthOf(options, prepared.was_hole, run->threads(), &input, diagnostics);
  prepared.depth_meaning = map.meaning;
  CorrectValues(options, &prepared.depth_meaning, &prepared, diagnostics, run);
  diagnostics->disparity_range_px = DisparityRangePx(input.disparity);
  prepared.effects = SelectEffects(options, input.camera, prepared_depth.depth);
  if (input.camera && !prepared.effects.on.Has(Effect::kThickness)) {
    input.falloff_camera = model::ThinLensEquivalent(*input.camera);
  }
  DecideFalloff(file.name, options, &prepared, diagnostics, run);
  diagnostics->effects = prepared.effects;
  if (input.grid) {
    const bool falloff = prepared.effects.on.Has(Effect::kFalloff);
    const estimator::ApertureBlur blur = estimator::MeasureApertureBlur(
        *input.grid, *input.camera, input.weights, falloff ? &input.camera_of_falloff() : nullptr);
    diagnostics->aperture_calibrated_sigma_mm = blur.calibrated_sigma_mm;
    diagnostics->aperture_sigma_mm = blur.sigma_mm;
    diagnostics->aperture_corner_change = blur.corner_change;
  }
  return prepared;
}

}  // namespace thicklens
