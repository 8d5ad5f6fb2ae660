#include "tools/report/estimate_records.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/printable_text.h"
#include "tools/options/deprecated_names.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

// Larger counts of views, pixels and blocks do not occur in a light field.
constexpr int kMaxCount = 100000000;
constexpr int kMaxViews = 1000;  // per axis

std::string Shown(const json& value) {
  constexpr std::size_t kLongest = 40;
  std::string text = PrintableUtf8(value.dump(-1, ' ', false, json::error_handler_t::replace));
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

// The members of one JSON object; messages name the file and the path of the member.
class Fields {
 public:
  Fields(const json& object, std::string where, std::string prefix)
      : object_(&object), where_(std::move(where)), prefix_(std::move(prefix)) {
    if (!object.is_object()) Complain(prefix_, "an object", object);
  }

  bool Has(const char* key) const { return object_->contains(key) && !object_->at(key).is_null(); }

  std::optional<double> Number(const char* key) const {
    if (!Has(key)) return std::nullopt;
    const json& value = object_->at(key);
    if (!value.is_number()) Complain(Name(key), "a number", value);
    return value.get<double>();
  }

  std::optional<int> Count(const char* key) const {
    if (!Has(key)) return std::nullopt;
    return AsCount(object_->at(key), Name(key), 0, kMaxCount);
  }

  std::optional<bool> YesOrNo(const char* key) const {
    if (!Has(key)) return std::nullopt;
    const json& value = object_->at(key);
    if (!value.is_boolean()) Complain(Name(key), "true or false", value);
    return value.get<bool>();
  }

  std::string Text(const char* key) const {
    if (!Has(key)) return "";
    const json& value = object_->at(key);
    if (!value.is_string()) Complain(Name(key), "a text", value);
    return value.get<std::string>();
  }

  std::optional<std::vector<std::string>> Texts(const char* key) const {
    if (!Has(key)) return std::nullopt;
    const json& list = object_->at(key);
    if (!list.is_array()) Complain(Name(key), "a list of texts", list);
    std::vector<std::string> texts;
    for (const json& entry : list) {
      if (!entry.is_string()) Complain(Name(key), "a list of texts", list);
      texts.push_back(entry.get<std::string>());
    }
    return texts;
  }

  std::pair<int, int> TwoCounts(const char* key) const {
    Require(key);
    const json& list = object_->at(key);
    if (!list.is_array() || list.size() != 2) Complain(Name(key), "two whole numbers", list);
    return {AsCount(list[0], Name(key), 1, kMaxCount), AsCount(list[1], Name(key), 1, kMaxCount)};
  }

  int ViewIndex(const char* key) const {
    Require(key);
    return AsCount(object_->at(key), Name(key), 0, kMaxViews - 1);
  }

  Fields Object(const char* key) const { return {object_->at(key), where_, Name(key)}; }

  std::vector<Fields> Objects(const char* key) const {
    std::vector<Fields> entries;
    if (!Has(key)) return entries;
    const json& list = object_->at(key);
    if (!list.is_array()) Complain(Name(key), "a list", list);
    for (std::size_t i = 0; i < list.size(); ++i) {
      entries.emplace_back(list[i], where_, fmt::format("{}[{}]", Name(key), i));
    }
    return entries;
  }

  void Require(const char* key) const {
    if (!Has(key)) throw Error(fmt::format("{}: '{}' is missing", where_, Name(key)));
  }

 private:
  std::string Name(const char* key) const {
    return prefix_.empty() ? key : fmt::format("{}.{}", prefix_, key);
  }

  int AsCount(const json& value, const std::string& name, int least, int most) const {
    if (!value.is_number_integer() || value.get<double>() < least || value.get<double>() > most) {
      Complain(name, fmt::format("a whole number from {} to {}", least, most), value);
    }
    return value.get<int>();
  }

  [[noreturn]] void Complain(const std::string& name, const std::string& expected,
                             const json& found) const {
    throw Error(fmt::format("{}: {}{} is expected, found {}", where_,
                            name.empty() ? "" : fmt::format("'{}': ", name), expected,
                            Shown(found)));
  }

  const json* object_;
  std::string where_, prefix_;
};

json ParseJson(const std::string& text, const std::string& path, const std::string& kind) {
  json parsed = json::parse(text, nullptr, false);
  if (parsed.is_discarded())
    throw Error(fmt::format("{}: not a JSON file; {} is expected", path, kind));
  if (!parsed.is_object()) {
    throw Error(
        fmt::format("{}: an object is expected, as in {}; found {}", path, kind, Shown(parsed)));
  }
  AcceptDeprecatedKeys(path, &parsed);
  return parsed;
}

// Throws Error for a run that was refused, because it has no results.
void RequireResults(const json& parsed, const char* key, const std::string& path,
                    const std::string& kind) {
  if (parsed.contains(key) && !parsed.at(key).is_null()) return;
  if (parsed.value("status", json()) == "refused") {
    throw Error(fmt::format("{}: this run was refused: {}", path,
                            Shown(parsed.value("reason", json("no reason is given")))));
  }
  throw Error(fmt::format("{}: '{}' is missing; {} is expected", path, key, kind));
}

double PsnrDb(const Fields& fields) {
  return fields.Number("psnr_db").value_or(std::numeric_limits<double>::infinity());
}

std::optional<ScoresRecord> Scores(const Fields& parent, const char* key) {
  if (!parent.Has(key)) return std::nullopt;
  const Fields fields = parent.Object(key);
  return ScoresRecord{PsnrDb(fields), fields.Number("ssim"), fields.Number("delta_e94_mean"),
                      fields.Number("macade_standin")};
}

ViewRecord View(const Fields& fields) {
  return {fields.ViewIndex("u"), fields.ViewIndex("v"), PsnrDb(fields),
          fields.Number("dibr_psnr_db")};
}

}  // namespace

EstimateRecord ReadEstimateRecord(const std::string& path) {
  return ParseEstimateRecord(ReadTextFile(path), path);
}

EstimateRecord ParseEstimateRecord(const std::string& text, const std::string& name) {
  const std::string kind = "the output of `thicklens estimate --json`";
  const json parsed = ParseJson(text, name, kind);
  RequireResults(parsed, "solver", name, kind);
  const Fields fields(parsed, name, "");
  EstimateRecord record;
  record.solver = fields.Text("solver");
  std::tie(record.u_count, record.v_count) = fields.TwoCounts("views");
  std::tie(record.s_count, record.t_count) = fields.TwoCounts("size");
  record.block_solver = fields.Text("block_solver");
  record.stencil = fields.Text("stencil");
  record.splat = fields.Text("splat");
  record.device = fields.Text("device");
  record.prior = fields.Text("prior");
  record.strength_rule = fields.Text("strength_rule");
  record.strength = fields.Number("strength");
  record.noise_sigma = fields.Number("noise_sigma");
  record.residual_rms = fields.Number("residual_rms");
  record.row_share = fields.Number("row_share");
  record.occluded_fraction = fields.Number("occluded_fraction");
  record.iterations = fields.Count("iterations");
  record.converged = fields.YesOrNo("converged");
  record.gamma = fields.Number("gamma");
  record.ridge = fields.Number("ridge");
  record.threads = fields.Count("threads");
  record.block_px = fields.Count("block_px");
  record.blocks = fields.Count("blocks");
  record.holes_filled = fields.Count("holes_filled");
  if (fields.Has("seconds")) {
    const Fields seconds = fields.Object("seconds");
    record.setup_seconds = seconds.Number("setup");
    record.solve_seconds = seconds.Number("solve");
    record.views_seconds = seconds.Number("views");
    record.files_seconds = seconds.Number("files");
    record.total_seconds = seconds.Number("total");
  }
  record.peak_rss_mib = fields.Number("peak_rss_mib");
  record.relative_residual = fields.Number("relative_residual");
  record.rcond_min = fields.Number("rcond_min");
  record.effects = fields.Texts("effects");
  return record;
}

ComparisonRecord ReadComparisonRecord(const std::string& path) {
  const std::string kind =
      "the output of `thicklens compare TRUE_LF LF --json` for two light fields";
  const json parsed = ParseJson(ReadTextFile(path), path, kind);
  RequireResults(parsed, "mean", path, kind);
  const Fields fields(parsed, path, "");
  ComparisonRecord record;
  if (fields.Has("views")) {
    std::tie(record.u_count, record.v_count) = fields.TwoCounts("views");
  }
  if (fields.Has("size")) std::tie(record.s_count, record.t_count) = fields.TwoCounts("size");
  record.border_px = fields.Count("border_px");
  record.mean = *Scores(fields, "mean");
  record.centre = Scores(fields, "centre");
  record.corner = Scores(fields, "corner");
  if (fields.Has("dibr")) {
    const Fields dibr = fields.Object("dibr");
    record.dibr_mean = Scores(dibr, "mean");
    record.dibr_centre = Scores(dibr, "centre");
    record.dibr_corner = Scores(dibr, "corner");
  }
  for (const Fields& view : fields.Objects("per_view")) record.views.push_back(View(view));
  record.views_above_dibr = fields.Count("views_above_dibr");
  return record;
}

}  // namespace thicklens::tools
