#include "tools/report/ablation_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace thicklens::tools {
namespace {

constexpr char kNone[] = "-";

double ShiftUm(const model::SweepAblation& sweep, const model::CalibratedValues& values) {
  return 1000 * (values.image_distance_mm - sweep.calibration.image_distance_mm);
}
double RatioPercent(const model::SweepAblation& sweep, const model::CalibratedValues& values) {
  return 100 * (values.blur_ratio / sweep.calibration.blur_ratio - 1);
}

// Three digits, but no value below a thousandth.
std::string Amount(double value) {
  if (value == 0) return "0";
  if (!std::isfinite(value)) return kNone;
  if (std::abs(value) < 0.001) return "< 0.001";
  return std::abs(value) < 1 ? fmt::format("{:.2g}", value) : fmt::format("{:.3g}", value);
}

std::string Signed(double value, int decimals) {
  if (!std::isfinite(value)) return kNone;
  const std::string text = fmt::format("{:+.{}f}", value, decimals);
  return text.find_first_of("123456789") == std::string::npos ? "0" : text;
}

std::string Psnr(double psnr_db) {
  return std::isfinite(psnr_db) ? fmt::format("{:.1f}", psnr_db) : "same";
}

std::string Seconds(double seconds) { return fmt::format("{:.2f}", seconds); }

template <typename Effect>
const Effect* Find(const std::vector<Effect>& effects, model::Effect effect) {
  const auto found = std::find_if(effects.begin(), effects.end(),
                                  [&](const Effect& entry) { return entry.effect == effect; });
  return found == effects.end() ? nullptr : &*found;
}

std::vector<std::string> ImageCells(const AblationRow& row) {
  const model::AblatedEffect& effect = row.image();
  if (effect.absent) return {kNone, "0", "0", "same", "0"};
  const model::ImageChange& change = effect.image;
  return {Amount(change.as_shift_px), Amount(change.rms_grey_levels),
          Amount(change.largest_grey_levels), Psnr(change.psnr_db),
          Amount(effect.bound_grey_levels)};
}

std::vector<std::string> LightFieldCells(const model::AblatedSceneEffect* row) {
  if (row == nullptr) return {kNone, kNone};
  if (row->absent) return {"0", kNone};
  return {Signed(row->light_field_db, 2), row->ignored_db ? Signed(*row->ignored_db, 2) : kNone};
}

std::vector<std::string> CalibrationCells(const model::SweepAblation& sweep,
                                          const model::AblatedSweepEffect* row) {
  if (row == nullptr) return {kNone, kNone};
  if (row->absent) return {"0", "0"};
  if (!row->calibration) return {"refused", "refused"};
  return {Signed(ShiftUm(sweep, *row->calibration), 2),
          Signed(RatioPercent(sweep, *row->calibration), 2)};
}

template <typename Effect>
std::vector<std::string> SecondsCells(const Effect* row, double Effect::*of_result) {
  if (row == nullptr || row->absent) return {kNone, kNone};
  return {Seconds(row->image_seconds), Seconds(row->*of_result)};
}

void Append(const std::vector<std::string>& cells, std::vector<std::string>* line) {
  line->insert(line->end(), cells.begin(), cells.end());
}

AblationTable::Line WithAll(const Ablation& ablation) {
  AblationTable::Line line{"with all", {kNone, kNone, kNone, kNone, kNone}};
  if (ablation.scene) {
    Append({fmt::format("{:.2f}", ablation.scene->light_field_psnr_db), kNone}, &line.cells);
  }
  if (ablation.sweep) {
    const model::CalibratedValues& values = ablation.sweep->calibration;
    Append({fmt::format("+-{:.2g}", 1000 * values.image_distance_sigma_mm),
            fmt::format("+-{:.2g}", 100 * values.blur_ratio_sigma / values.blur_ratio)},
           &line.cells);
  }
  if (ablation.scene) {
    Append({Seconds(ablation.scene->image_seconds), Seconds(ablation.scene->estimate_seconds)},
           &line.cells);
  }
  if (ablation.sweep) {
    Append({Seconds(ablation.sweep->image_seconds), Seconds(ablation.sweep->calibration_seconds)},
           &line.cells);
  }
  line.cells.emplace_back(kNone);
  return line;
}

nlohmann::json CellNumber(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

nlohmann::json ImageChangeJson(const model::AblatedEffect& effect) {
  nlohmann::json json = {{"name", model::EffectName(effect.effect)},
                         {"absent", effect.absent},
                         {"kept_by_auto", effect.kept_by_auto},
                         {"bound_grey_levels", effect.bound_grey_levels}};
  if (effect.absent) return json;
  json["image"] = {{"rms_grey_levels", effect.image.rms_grey_levels},
                   {"largest_grey_levels", effect.image.largest_grey_levels},
                   {"psnr_db", CellNumber(effect.image.psnr_db)},
                   {"as_shift_px", CellNumber(effect.image.as_shift_px)}};
  json["image_seconds"] = effect.image_seconds;
  return json;
}

nlohmann::json SceneJson(const model::SceneAblation& scene) {
  nlohmann::json effects = nlohmann::json::array();
  for (const model::AblatedSceneEffect& effect : scene.effects) {
    nlohmann::json json = ImageChangeJson(effect);
    if (!effect.absent) {
      json["light_field_db"] = CellNumber(effect.light_field_db);
      json["ignored_db"] = effect.ignored_db ? CellNumber(*effect.ignored_db) : nlohmann::json();
      json["estimate_seconds"] = effect.estimate_seconds;
    }
    effects.push_back(std::move(json));
  }
  return {{"views", {scene.u_count, scene.v_count}},
          {"light_field_psnr_db", CellNumber(scene.light_field_psnr_db)},
          {"image_seconds", scene.image_seconds},
          {"estimate_seconds", scene.estimate_seconds},
          {"sampling_error_grey_levels", scene.sampling_error_grey_levels},
          {"effects", std::move(effects)}};
}

nlohmann::json SweepJson(const model::SweepAblation& sweep) {
  nlohmann::json effects = nlohmann::json::array();
  for (const model::AblatedSweepEffect& effect : sweep.effects) {
    nlohmann::json json = ImageChangeJson(effect);
    if (!effect.absent) {
      json["calibration_seconds"] = effect.calibration_seconds;
      json["refusal"] = effect.refusal;
      if (effect.calibration) {
        json["image_distance_um"] = ShiftUm(sweep, *effect.calibration);
        json["blur_ratio_percent"] = RatioPercent(sweep, *effect.calibration);
      }
    }
    effects.push_back(std::move(json));
  }
  const model::CalibratedValues& values = sweep.calibration;
  return {{"frames", sweep.frames},
          {"image_distance_mm",
           {{"value", values.image_distance_mm},
            {"sigma", values.image_distance_sigma_mm},
            {"truth", sweep.true_image_distance_mm}}},
          {"blur_ratio",
           {{"value", values.blur_ratio},
            {"sigma", values.blur_ratio_sigma},
            {"truth", sweep.true_blur_ratio}}},
          {"image_seconds", sweep.image_seconds},
          {"calibration_seconds", sweep.calibration_seconds},
          {"effects", std::move(effects)}};
}

std::string AlignedText(const AblationTable& table) {
  constexpr int kNameWidth = 15;
  std::string groups = fmt::format("{:<{}}", "", kNameWidth);
  std::string names = fmt::format("{:<{}}", "without", kNameWidth);
  std::vector<std::size_t> widths;
  std::size_t group_end = 0;  // the end of the last group's columns
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const AblationTable::Column& column = table.columns[i];
    std::size_t width = column.name.size();
    for (const AblationTable::Line& line : table.lines) {
      width = std::max(width, line.cells[i].size());
    }
    const bool starts_group = i == 0 || table.columns[i - 1].group != column.group;
    widths.push_back(std::max<std::size_t>(width, 4) + (starts_group ? 3 : 2));
    names += fmt::format("{:>{}}", column.name, widths.back());
    if (starts_group) {
      groups.resize(std::max(groups.size(), group_end), ' ');
      groups += "   " + column.group;
    }
    group_end = names.size();
  }
  std::string text = groups + "\n" + names + "\n";
  for (const AblationTable::Line& line : table.lines) {
    text += fmt::format("{:<{}}", line.name, kNameWidth);
    for (std::size_t i = 0; i < line.cells.size(); ++i) {
      text += fmt::format("{:>{}}", line.cells[i], widths[i]);
    }
    text += "\n";
  }
  return text;
}

// A field of the CSV table: all digits, or empty if there is no value.
std::string Field(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? fmt::format(",{}", *value) : ",";
}

}  // namespace

std::vector<AblationRow> RowsOf(const Ablation& ablation) {
  std::vector<AblationRow> rows;
  for (const model::EffectFacts& facts : model::AllEffects()) {
    AblationRow row;
    row.effect = facts.effect;
    if (ablation.scene) row.scene = Find(ablation.scene->effects, facts.effect);
    if (ablation.sweep) row.sweep = Find(ablation.sweep->effects, facts.effect);
    if (row.scene != nullptr || row.sweep != nullptr) rows.push_back(row);
  }
  return rows;
}

AblationTable TableOf(const Ablation& ablation) {
  AblationTable table;
  const bool scene = ablation.scene.has_value(), sweep = ablation.sweep.has_value();
  const auto add = [&table](bool there, const std::string& group,
                            const std::vector<std::string>& names) {
    if (!there) return;
    for (const std::string& name : names) table.columns.push_back({group, name});
  };
  add(true, scene ? "image" : "frames", {"shift px", "rms gl", "most gl", "PSNR dB", "bound gl"});
  add(scene, "views, dB", {"without", "ignored"});
  add(sweep, "calibration", {"d1 um", "kappa %"});
  add(scene, "seconds", {"image", "estimate"});
  add(sweep, "seconds", {"sweep", "calibrate"});
  add(true, "auto", {""});
  table.lines.push_back(WithAll(ablation));
  for (const AblationRow& row : RowsOf(ablation)) {
    const std::string star = ablation.scene && row.scene == nullptr ? "*" : "";
    AblationTable::Line line{model::EffectName(row.effect) + star, ImageCells(row)};
    if (ablation.scene) Append(LightFieldCells(row.scene), &line.cells);
    if (ablation.sweep) Append(CalibrationCells(*ablation.sweep, row.sweep), &line.cells);
    if (ablation.scene) {
      Append(SecondsCells(row.scene, &model::AblatedSceneEffect::estimate_seconds), &line.cells);
    }
    if (ablation.sweep) {
      Append(SecondsCells(row.sweep, &model::AblatedSweepEffect::calibration_seconds), &line.cells);
    }
    line.cells.emplace_back(row.image().kept_by_auto ? "on" : "off");
    table.lines.push_back(std::move(line));
  }
  return table;
}

std::vector<std::string> AblationNotes(const Ablation& ablation) {
  std::vector<std::string> notes = {
      "Each line compares the simulation without that effect with the one with all effects.",
      fmt::format(
          "In {}, encoded values, 255 at full scale: the rms and the largest change, its PSNR, the "
          "shift of the whole image that would change it as much, and the bound that --effects "
          "auto uses to keep or leave out the effect (noise: its standard "
          "deviation).",
          ablation.scene ? "the image" : "all frames together")};
  if (ablation.scene) {
    const model::SceneAblation& scene = *ablation.scene;
    notes.push_back(
        fmt::format("Views: gain of the {}x{} views estimated from the image, against the true "
                    "ones, if the effect does not exist; ignored: if the image has the effect "
                    "and the estimate ignores it.",
                    scene.u_count, scene.v_count));
    if (scene.sampling_error_grey_levels > 0) {
      notes.push_back(
          fmt::format("The sampling by rays has an error of up to about {:.2g} grey levels rms: "
                      "smaller changes may be due to it.",
                      scene.sampling_error_grey_levels));
    }
  }
  if (ablation.sweep) {
    const model::SweepAblation& sweep = *ablation.sweep;
    notes.push_back(fmt::format(
        "Calibration from {} frames: d1 = {:.6g} +- {:.2g} mm (truth {:.6g}), kappa = {:.5g} +- "
        "{:.2g} (truth {:.5g}); the table lists their changes.",
        sweep.frames, sweep.calibration.image_distance_mm,
        sweep.calibration.image_distance_sigma_mm, sweep.true_image_distance_mm,
        sweep.calibration.blur_ratio, sweep.calibration.blur_ratio_sigma, sweep.true_blur_ratio));
    for (const model::AblatedSweepEffect& effect : sweep.effects) {
      if (effect.absent || effect.calibration) continue;
      notes.push_back(fmt::format("Without {} the calibration fails: {}.",
                                  model::EffectName(effect.effect), effect.refusal));
    }
  }
  if (ablation.scene && ablation.sweep) {
    notes.emplace_back(
        "*: absent from the image of a scene; the values are for the frames of the sweep.");
  }
  notes.emplace_back(
      "Seconds are for one run without the effect; the run with all effects came first, when "
      "nothing was in memory yet.");
  return notes;
}

std::string AblationText(const Ablation& ablation) {
  const AblationTable table = TableOf(ablation);
  std::string text = "\n";
  for (const std::string& note : AblationNotes(ablation)) text += note + "\n";
  return text + "\n" + AlignedText(table);
}

std::string AblationCsv(const Ablation& ablation) {
  std::string text =
      "effect,image_of,absent,kept_by_auto,bound_grey_levels,as_shift_px,rms_grey_levels,"
      "largest_grey_levels,psnr_db,light_field_db,ignored_db,image_distance_um,"
      "blur_ratio_percent,image_seconds,estimate_seconds,sweep_seconds,calibration_seconds,"
      "picture_of,picture_seconds\n";  // the former names, until version 1.0
  for (const AblationRow& row : RowsOf(ablation)) {
    const model::AblatedEffect& effect = row.image();
    text += fmt::format("{},{},{},{},{}", model::EffectName(row.effect),
                        row.scene != nullptr ? "scene" : "sweep", row.absent() ? 1 : 0,
                        effect.kept_by_auto ? 1 : 0, effect.bound_grey_levels);
    const auto of_image = [&](double value) {
      return Field(effect.absent ? std::nullopt : std::optional(value));
    };
    text += of_image(effect.image.as_shift_px) + of_image(effect.image.rms_grey_levels) +
            of_image(effect.image.largest_grey_levels) + of_image(effect.image.psnr_db);
    const model::AblatedSceneEffect* scene =
        row.scene != nullptr && !row.scene->absent ? row.scene : nullptr;
    const model::AblatedSweepEffect* sweep =
        row.sweep != nullptr && !row.sweep->absent ? row.sweep : nullptr;
    text += scene == nullptr ? ",," : Field(scene->light_field_db) + Field(scene->ignored_db);
    text += sweep == nullptr || !sweep->calibration
                ? ",,"
                : Field(ShiftUm(*ablation.sweep, *sweep->calibration)) +
                      Field(RatioPercent(*ablation.sweep, *sweep->calibration));
    text += scene == nullptr ? ",," : Field(scene->image_seconds) + Field(scene->estimate_seconds);
    text +=
        sweep == nullptr ? ",," : Field(sweep->image_seconds) + Field(sweep->calibration_seconds);
    text += row.scene != nullptr ? ",scene" : ",sweep";
    text += Field(scene == nullptr ? std::nullopt : std::optional(scene->image_seconds));
    text += "\n";
  }
  return text;
}

nlohmann::json AblationJson(const Ablation& ablation) {
  nlohmann::json json = nlohmann::json::object();
  if (ablation.scene) json["scene"] = SceneJson(*ablation.scene);
  if (ablation.sweep) json["sweep"] = SweepJson(*ablation.sweep);
  return json;
}

}  // namespace thicklens::tools
