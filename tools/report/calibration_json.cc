#include "tools/report/calibration_json.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/printable_text.h"
#include "thicklens/calib/blur_model.h"
#include "thicklens/calib/error_budget.h"
#include "thicklens/calib/next_measurement.h"
#include "tools/report/calibration_answers.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/calibration_text.h"
#include "tools/report/determined.h"
#include "tools/report/grid_words.h"
#include "tools/report/target_words.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

json NumberOrNull(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json NumberOrNull(const std::optional<double>& value) {
  return value ? NumberOrNull(*value) : json(nullptr);
}

// An estimator that did not run leaves 0, which is never a measured value.
json Measured(double value) { return value == 0 ? json(nullptr) : NumberOrNull(value); }

json ResultJson(const std::optional<calib::Result>& result) {
  if (!result || (!std::isfinite(result->value) && !result->systematic)) return nullptr;
  json out = {{"value", NumberOrNull(result->value)}, {"sigma", NumberOrNull(result->sigma)}};
  out["systematic"] = nullptr;
  if (result->systematic && result->systematic->allFinite())
    out["systematic"] = json::array({result->systematic->x(), result->systematic->y()});
  return out;
}

// A value of the paper's recipe, which has no error estimate.
json SourceResultJson(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return nullptr;
  return {{"value", *value}, {"sigma", nullptr}, {"systematic", nullptr}};
}

json EstimateJson(const model::Estimate& estimate) {
  return {{"value", NumberOrNull(estimate.value)}, {"sigma", NumberOrNull(estimate.sigma)}};
}

json EstimateJson(const std::optional<model::Estimate>& estimate) {
  return estimate ? EstimateJson(*estimate) : json(nullptr);
}

json NumbersJson(const std::vector<double>& values) {
  json out = json::array();
  for (double value : values) out.push_back(NumberOrNull(value));
  return out;
}

json RangeJson(const Eigen::Vector2d& range) {
  return json::array({NumberOrNull(range.x()), NumberOrNull(range.y())});
}

json TextsJson(const std::vector<std::string>& texts) {
  json out = json::array();
  for (const std::string& text : texts) out.push_back(PrintableUtf8(text));
  return out;
}

json TextJson(const std::string& text) {
  return text.empty() ? json(nullptr) : json(PrintableUtf8(text));
}

json ComparedFocusJson(const std::vector<calib::ComparedFocus>& sources) {
  json list = json::array();
  for (const calib::ComparedFocus& source : sources)
    list.push_back(json{{"name", TextJson(source.name)},
                        {"focus_depth_mm", EstimateJson(source.focus_depth_mm)},
                        {"agrees", source.agrees}});
  return list;
}

// The count of a step that was done; null otherwise.
json Count(bool done, int count) { return done ? json(count) : json(nullptr); }

// A frame that was opened has at least one of these above 0, or was rejected.
bool IsMeasured(const calib::FrameMeasurement& frame) {
  const calib::FrameStatistics& s = frame.statistics;
  return !frame.rejection.empty() || s.mean_encoded != 0 || s.contrast != 0 || s.noise_sigma != 0;
}

json StatisticsJson(const calib::FrameStatistics& statistics) {
  return {{"mean_encoded", NumberOrNull(statistics.mean_encoded)},
          {"mean_linear", NumberOrNull(statistics.mean_linear)},
          {"contrast", NumberOrNull(statistics.contrast)},
          {"noise_sigma", NumberOrNull(statistics.noise_sigma)},
          {"top_gradient_per_px", NumberOrNull(statistics.top_gradient)},
          {"saturated_fraction", NumberOrNull(statistics.saturated_fraction)},
          {"saturation_level", NumberOrNull(statistics.saturation_level)}};
}

// The values that the figures show, for one frame. `law` may be null.
json FrameJson(const calib::FrameMeasurement& frame, const calib::BlurModel* law) {
  const bool has_blur = frame.blur_sigma_error_px != 0;
  const bool has_edges = frame.edge_count > 0 || frame.mean_edge_slope != 0;
  const bool has_reading_error = frame.reading_error_sigma_mm > 0;
  const bool has_law = law != nullptr && calib::IsDepth(frame.depth_mm);
  json out = {
      {"image", PrintableUtf8(frame.image)},
      {"reading_mm", NumberOrNull(frame.reading_mm)},
      {"depth_mm", Measured(frame.depth_mm)},
      {"image_distance_mm",
       frame.image_distance_mm ? NumberOrNull(*frame.image_distance_mm) : json(nullptr)},
      {"rejection", TextJson(frame.rejection)},
      {"not_in_fit", TextJson(frame.not_in_fit)},
      {"statistics", IsMeasured(frame) ? StatisticsJson(frame.statistics) : json(nullptr)},
      {"mean_edge_slope_per_px", Measured(frame.mean_edge_slope)},
      {"normalised_edge_slope_per_px", Measured(frame.normalised_edge_slope)},
      {"edge_count", Count(has_edges, frame.edge_count)},
      {"source_blur_sigma_px", Measured(frame.source_blur_sigma_px)},
      {"blur_sigma_px", has_blur ? NumberOrNull(frame.blur_sigma_px) : json(nullptr)},
      {"blur_sigma_error_px", has_blur ? NumberOrNull(frame.blur_sigma_error_px) : json(nullptr)},
      {"in_blur_fit", frame.in_blur_fit},
      {"blur_fit_weight", frame.in_blur_fit ? NumberOrNull(frame.blur_fit_weight) : json(nullptr)},
      {"image_scale", NumberOrNull(frame.image_scale)},
      {"image_scale_sigma", Measured(frame.image_scale ? frame.image_scale_sigma : 0)},
      {"in_scale_fit", frame.in_scale_fit},
      {"reading_error_mm",
       has_reading_error ? NumberOrNull(frame.reading_error_mm) : json(nullptr)},
      {"reading_error_sigma_mm",
       has_reading_error ? NumberOrNull(frame.reading_error_sigma_mm) : json(nullptr)},
      {"stage_error_mm", Measured(frame.stage_error_mm)}};
  out["blur_model_sigma_px"] = has_law ? NumberOrNull(law->SigmaPx(frame.depth_mm)) : json(nullptr);
  out["blur_model_error_px"] =
      has_law ? NumberOrNull(law->SigmaErrorPx(frame.depth_mm)) : json(nullptr);
  out["blur_residual_sigmas"] = has_law ? NumberOrNull(law->ResidualSigmas(frame)) : json(nullptr);
  return out;
}

json ImageJson(const calib::Calibration& calibration, int index) {
  if (index < 0 || index >= static_cast<int>(calibration.frames.size())) return nullptr;
  return PrintableUtf8(calibration.frames[static_cast<std::size_t>(index)].image);
}

json SourceJson(const calib::Calibration& calibration, const std::vector<ResultRow>& rows) {
  json out = {
      {"done", calibration.diagnostics.paper_recipe.done},
      {"message", PrintableUtf8(calibration.diagnostics.paper_recipe.message)},
      {"sharpest_image",
       ImageJson(calibration, calibration.diagnostics.paper_recipe.sharpest_frame)},
      {"ratio_frames", Count(calibration.diagnostics.paper_recipe.done,
                             calibration.diagnostics.paper_recipe.ratio_frames)},
      {"sharpest_normalised_image",
       ImageJson(calibration, calibration.diagnostics.paper_recipe.sharpest_normalised_frame)},
      {"normalised_focus_depth_mm",
       Measured(calibration.diagnostics.paper_recipe.normalised_focus_depth_mm)}};
  for (const ResultRow& row : rows)
    if (row.source || row.key == "image_distance_mm" || row.key == "focus_depth_mm" ||
        row.key == "blur_ratio")
      out[row.key] = SourceResultJson(row.source);
  return out;
}

json SharpnessPeakJson(const calib::Calibration& calibration, const std::vector<ResultRow>& rows) {
  const calib::SharpnessPeak& peak = calibration.diagnostics.sharpness;
  json out = {{"done", peak.done},
              {"message", PrintableUtf8(peak.message)},
              {"frames_used", Count(peak.done, peak.frames_used)}};
  for (const ResultRow& row : rows)
    if (row.key == "focus_depth_mm") out[row.key] = ResultJson(row.peak);
  out["fitted_depths_mm"] = nullptr;
  out["log_parabola"] = nullptr;
  if (peak.done) {
    out["fitted_depths_mm"] =
        json::array({NumberOrNull(peak.from_depth_mm), NumberOrNull(peak.to_depth_mm)});
    const Eigen::Vector3d& c = peak.log_parabola;
    out["log_parabola"] = {{"coefficients", NumbersJson({c[0], c[1], c[2]})},
                           {"reference_depth_mm", NumberOrNull(peak.reference_depth_mm)}};
  }
  return out;
}

json ScaleModelJson(const calib::Calibration& calibration) {
  const calib::ScaleModel& scale = calibration.diagnostics.scale;
  const bool done = scale.done;
  return {{"done", done},
          {"message", PrintableUtf8(scale.message)},
          {"kind", ScaleKindName(scale.kind)},
          {"reference_image", ImageJson(calibration, scale.reference_frame)},
          {"offset_mm", done ? ResultJson(scale.offset_mm) : json(nullptr)},
          {"reference_depth_mm", done ? NumberOrNull(scale.reference_depth_mm) : json(nullptr)},
          {"reading_rms_mm", done ? NumberOrNull(scale.reading_rms_mm) : json(nullptr)},
          {"frames_used", Count(done, scale.frames_used)},
          {"change_over_sweep", EstimateJson(scale.change_over_sweep)},
          {"distortion_at_corner", EstimateJson(scale.distortion_at_corner)}};
}

json CovarianceJson(const calib::Calibration& calibration) {
  if (calibration.diagnostics.covariance_order.empty() ||
      calibration.diagnostics.covariance.size() == 0)
    return nullptr;
  json rows = json::array();
  for (Eigen::Index i = 0; i < calibration.diagnostics.covariance.rows(); ++i) {
    json row = json::array();
    for (Eigen::Index j = 0; j < calibration.diagnostics.covariance.cols(); ++j)
      row.push_back(NumberOrNull(calibration.diagnostics.covariance(i, j)));
    rows.push_back(std::move(row));
  }
  return {{"order", TextsJson(calibration.diagnostics.covariance_order)},
          {"rows", std::move(rows)}};
}

json TruthJson(const std::vector<ResultRow>& rows) {
  json fit = json::object(), source = json::object(), peak = json::object(), out;
  for (const ResultRow& row : rows) {
    out[row.key] = NumberOrNull(row.truth);
    if (!row.truth) continue;
    if (row.fit) fit[row.key] = NumberOrNull(row.fit->value - *row.truth);
    if (row.source) source[row.key] = NumberOrNull(*row.source - *row.truth);
    if (row.peak) peak[row.key] = NumberOrNull(row.peak->value - *row.truth);
  }
  out["errors"] = {{"fit", fit}, {"source", source}, {"sharpness_peak", peak}};
  return out;
}

json BlurFitJson(const calib::BlurFit& blur) {
  const bool compared = blur.done && blur.gaussian_misfit && blur.disc_misfit;
  return {{"done", blur.done},
          {"message", PrintableUtf8(blur.message)},
          {"frames_used", Count(blur.done, blur.frames_used)},
          {"estimator", TextJson(blur.estimator)},
          {"family", model::PsfName(blur.family)},
          {"band", blur.band ? json(*blur.band) : json(nullptr)},
          {"tails", blur.tails > 0 ? json(blur.tails) : json(nullptr)},
          {"weak_direction", TextJson(blur.weak_direction)},
          {"better_psf", compared ? json(model::PsfName(blur.better_psf)) : json(nullptr)},
          {"gaussian_misfit_chi2_per_dof", NumberOrNull(blur.gaussian_misfit)},
          {"disc_misfit_chi2_per_dof", NumberOrNull(blur.disc_misfit)},
          {"outside_sweep_mm", blur.done ? NumberOrNull(blur.outside_mm) : json(nullptr)}};
}

json SideJson(const calib::SideFit& side) {
  return {{"done", side.done},
          {"message", PrintableUtf8(side.message)},
          {"focus_depth_mm", side.done ? EstimateJson(side.focus_depth_mm) : json(nullptr)},
          {"blur_ratio", side.done ? EstimateJson(side.blur_ratio) : json(nullptr)},
          {"frames_used", Count(side.done, side.frames_used)}};
}

json AxisFocusJson(const std::optional<calib::AxisFocus>& focus) {
  if (!focus) return nullptr;
  return {{"focus_depth_mm", EstimateJson(focus->focus_depth_mm)},
          {"blur_ratio", EstimateJson(focus->blur_ratio)}};
}

json FieldJson(const calib::FieldMap& field) {
  json tiles = json::array(), clusters = json::array();
  for (const calib::FieldTile& tile : field.tiles)
    tiles.push_back(
        {{"centre_px", RangeJson(tile.centre_px)},
         {"done", tile.done},
         {"message", PrintableUtf8(tile.message)},
         {"focus_depth_mm", tile.done ? EstimateJson(tile.focus_depth_mm) : json(nullptr)},
         {"blur_ratio", tile.done ? EstimateJson(tile.blur_ratio) : json(nullptr)},
         {"cluster", Count(tile.done, tile.cluster)},
         {"sagittal", AxisFocusJson(tile.sagittal)},
         {"tangential", AxisFocusJson(tile.tangential)}});
  for (const calib::DepthCluster& cluster : field.clusters)
    clusters.push_back(
        {{"focus_depth_mm", EstimateJson(cluster.focus_depth_mm)}, {"tiles", cluster.tiles}});
  return {{"done", field.done},
          {"message", PrintableUtf8(field.message)},
          {"columns", Count(field.done, field.columns)},
          {"rows", Count(field.done, field.rows)},
          {"tiles", std::move(tiles)},
          {"tilt_right_deg", EstimateJson(field.tilt_right_deg)},
          {"tilt_down_deg", EstimateJson(field.tilt_down_deg)},
          {"curvature_mm", EstimateJson(field.curvature_mm)},
          {"astigmatism_mm", EstimateJson(field.astigmatism_mm)},
          {"field_astigmatism_mm", EstimateJson(field.field_astigmatism_mm)},
          {"along_x", AxisFocusJson(field.along_x)},
          {"along_y", AxisFocusJson(field.along_y)},
          {"clusters", std::move(clusters)}};
}

json ChannelsJson(const std::vector<calib::ChannelFocus>& channels) {
  json out = json::array();
  for (const calib::ChannelFocus& channel : channels)
    out.push_back(
        {{"name", PrintableUtf8(channel.name)},
         {"done", channel.done},
         {"message", PrintableUtf8(channel.message)},
         {"focus_depth_mm", channel.done ? EstimateJson(channel.focus_depth_mm) : json(nullptr)},
         {"blur_ratio", channel.done ? EstimateJson(channel.blur_ratio) : json(nullptr)}});
  return out;
}

json MagnificationJson(const std::optional<calib::MagnificationCheck>& check) {
  if (!check) return nullptr;
  return {{"period_px", NumberOrNull(check->period_px)},
          {"period_mm", NumberOrNull(check->period_mm)},
          {"image_distance_mm", EstimateJson(check->image_distance_mm)}};
}

json PartsJson(const std::vector<calib::SystematicPart>& parts) {
  json out = json::array();
  for (const calib::SystematicPart& part : parts)
    out.push_back({{"name", PrintableUtf8(part.name)},
                   {"focus_depth_mm", RangeJson(part.focus_depth_mm)},
                   {"image_distance_mm", RangeJson(part.image_distance_mm)},
                   {"blur_ratio", RangeJson(part.blur_ratio)},
                   {"remedy", TextJson(part.remedy)}});
  return out;
}

json ExamplesJson(const calib::Calibration& calibration) {
  json out = json::array();
  for (const calib::BlurExample& example : calibration.examples)
    out.push_back(
        {{"image", ImageJson(calibration, example.frame)},
         {"kind", example.is_edge ? "edge" : "transfer"},
         {example.is_edge ? "distance_px" : "frequency_cycles_per_px", NumbersJson(example.x)},
         {"measured", NumbersJson(example.measured)},
         {"gaussian", NumbersJson(example.gaussian)},
         {"disc", NumbersJson(example.disc)}});
  return out;
}

// The values of the fit only, without the combined results.
json FitJson(const calib::Calibration& calibration) {
  const bool done = calibration.diagnostics.blur.done;
  return {{"chi2_per_dof",
           done ? NumberOrNull(calibration.diagnostics.blur.chi2_per_dof) : json(nullptr)},
          {"undetermined", TextsJson(calibration.diagnostics.blur.undetermined)},
          {"covariance", CovarianceJson(calibration)},
          {"blur_fit", BlurFitJson(calibration.diagnostics.blur)},
          {"sides",
           {{"nearer", SideJson(calibration.diagnostics.nearer)},
            {"farther", SideJson(calibration.diagnostics.farther)},
            {"apart_mm", EstimateJson(SidesApartMm(calibration))}}},
          {"field", FieldJson(calibration.diagnostics.field)},
          {"channels", ChannelsJson(calibration.diagnostics.channels)},
          {"systematic_parts", PartsJson(calibration.diagnostics.systematic_parts)},
          {"advice", TextJson(calibration.diagnostics.advice)},
          {"moves", model::SweepMotionName(calibration.diagnostics.moves)},
          {"step_length_mm", calibration.diagnostics.step_length_mm &&
                                     std::isfinite(calibration.diagnostics.step_length_mm->sigma)
                                 ? json{{"value", calibration.diagnostics.step_length_mm->value},
                                        {"sigma", calibration.diagnostics.step_length_mm->sigma}}
                                 : json(nullptr)},
          {"moves_is_recognised", calibration.diagnostics.moves_is_recognised},
          {"bench_offset_from", TextJson(calibration.diagnostics.bench_offset_from)},
          {"compared_focus", ComparedFocusJson(calibration.diagnostics.compared_focus)},
          {"magnification_at_focus", EstimateJson(calibration.diagnostics.magnification_at_focus)},
          {"examples", ExamplesJson(calibration)},
          {"frames_used", calibration.summary.frames_used},
          {"error_terms", ErrorTermsJson(calib::ErrorTerms(calibration))},
          {"status", calib::OutcomeName(calibration.summary.outcome)},
          {"reason", calibration.summary.outcome == calib::Outcome::kOk
                         ? ""
                         : PrintableUtf8(calibration.summary.reason)}};
}

json FramesJson(const calib::FocusSweep& sweep, const calib::Calibration& calibration) {
  const std::optional<calib::BlurModel> law = calib::BlurModel::Of(sweep, calibration);
  json frames = json::array();
  for (const calib::FrameMeasurement& frame : calibration.frames)
    frames.push_back(FrameJson(frame, law ? &*law : nullptr));
  return frames;
}

json RejectedJson(const calib::Calibration& calibration) {
  json rejected = json::array();
  for (const calib::FrameMeasurement& frame : calibration.frames)
    if (!frame.rejection.empty())
      rejected.push_back(
          {{"image", PrintableUtf8(frame.image)}, {"reason", PrintableUtf8(frame.rejection)}});
  return rejected;
}

json LeftOutJson(const calib::Calibration& calibration) {
  json left_out = json::array();
  for (const calib::FrameMeasurement& frame : calibration.frames) {
    if (frame.rejection.empty() && !frame.not_in_fit.empty())
      left_out.push_back(
          {{"image", PrintableUtf8(frame.image)}, {"reason", PrintableUtf8(frame.not_in_fit)}});
  }
  return left_out;
}

}  // namespace

json CalibrationJson(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                     const model::SweepTruth* truth, bool use_source_recipe) {
  const std::vector<ResultRow> rows = ResultRows(calibration, truth);
  json fit = FitJson(calibration), out;
  for (const ResultRow& row : rows) fit[row.key] = ResultJson(row.fit);
  out["other_methods"] = {{"source", SourceJson(calibration, rows)},
                          {"sharpness_peak", SharpnessPeakJson(calibration, rows)}};
  if (use_source_recipe) {
    const calib::SourceRecipe& source = calibration.diagnostics.paper_recipe;
    out["status"] = source.done ? "ok" : "refused";
    out["reason"] = source.done ? "" : PrintableUtf8(source.message);
    out["frames_used"] = Count(source.done, source.ratio_frames);
    out["chi2_per_dof"] = nullptr;
    for (const ResultRow& row : rows) out[row.key] = SourceResultJson(row.source);
    out["other_methods"]["fit"] = std::move(fit);
  } else {
    out.update(fit);
  }
  out["method"] = use_source_recipe ? "source" : "fit";
  out["frames"] = FramesJson(sweep, calibration);
  out["frames_rejected"] = RejectedJson(calibration);
  out["frames_left_out"] = LeftOutJson(calibration);
  out["next_measurement"] = NextMeasurementJson(calib::ProposeNext(sweep, calibration));
  out["seconds"] = NumberOrNull(calibration.summary.seconds);
  out["camera"] = PrintableUtf8(sweep.camera.name);
  out["assumed_fields"] = TextsJson(model::AssumedFields(sweep.camera));
  out["warnings"] = TextsJson(calibration.summary.warnings);
  out["scale_model"] = ScaleModelJson(calibration);
  out["sharpest_reading"] = SharpestJson(calibration);
  out["diagnoses"] = DiagnosesJson(calibration);
  out["frame_structure"] = StructureJson(calibration.diagnostics.structure);
  out["frame_light"] = LightJson(calibration.diagnostics.light);
  out["fixed_pattern"] = PatternJson(calibration.diagnostics.fixed_pattern);
  out["target"] = TargetJson(calibration.diagnostics.target);
  out["stage_errors"] = StageJson(calibration.diagnostics.stage);
  out["camera_response"] = ResponseJson(calibration.diagnostics.response);
  out["magnification"] = MagnificationJson(calibration.diagnostics.magnification);
  out["grid"] = GridJson(calibration.diagnostics.grid);
  out["sheet_marks"] = MarksJson(calibration.diagnostics.marks);
  if (truth != nullptr) out["truth"] = TruthJson(rows);
  return out;
}

}  // namespace thicklens::tools
