#include "tools/options/deprecated_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "thicklens/base/deprecation.h"
#include "thicklens/base/error.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

// All arrays and objects of a document; each comes before what contains it. Without recursion,
// because a file may be nested more deeply than the stack allows.
std::vector<json*> InsideOut(json* root) {
  std::vector<json*> nodes = {root};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    json& node = *nodes[i];
    if (!node.is_structured()) continue;
    for (json& child : node) {
      if (child.is_structured()) nodes.push_back(&child);
    }
  }
  std::reverse(nodes.begin(), nodes.end());
  return nodes;
}

bool IsRenamedIn(const json& object, const DeprecatedName& name) {
  return name.kind == NameKind::kJson && (name.beside.empty() || object.contains(name.beside));
}

void RenameKey(const std::string& source, const DeprecatedName& name, json* object) {
  const auto former = object->find(name.former);
  if (former == object->end()) return;
  const auto now = object->find(name.now);
  if (now == object->end()) {
    json value = std::move(*former);
    object->erase(former);
    (*object)[name.now] = std::move(value);
  } else if (*now != *former) {
    throw Error(fmt::format("{}: '{}' and its former name '{}' have different values", source,
                            name.now, name.former));
  }
}

}  // namespace

const std::vector<DeprecatedName>& DeprecatedNames() {
  using Kind = NameKind;
  static const std::vector<DeprecatedName> names = {
      {Kind::kCommand, "simulate picture", "simulate image", "command line"},
      {Kind::kCommand, "bench source", "bench paper", "command line"},
      {Kind::kOption, "--attribute", "--ablate", "`simulate image`, `simulate sweep`"},
      {Kind::kOption, "--tolerance", "--effect-tolerance",
       "`render`, `explain`, `simulate image`, `simulate light-field`"},
      {Kind::kOption, "--size", "--paper", "`target`"},
      {Kind::kValue, "--method source", "--method paper", "`calibrate`"},
      {Kind::kValue, "--stencil source", "--stencil paper", "`estimate`"},
      {Kind::kHardCase, "estimator/ridge-0-whole-picture", "estimator/ridge-0-whole-image",
       "`doctor --hard-cases --only`"},
      {Kind::kHardCase, "estimator/blur-beyond-the-picture", "estimator/blur-beyond-the-image",
       "`doctor --hard-cases --only`"},
      {Kind::kHardCase, "estimator/blocks-larger-than-the-picture",
       "estimator/blocks-larger-than-the-image", "`doctor --hard-cases --only`"},
      {Kind::kHardCase, "calibration/one-picture-thirty-one-times",
       "calibration/one-image-thirty-one-times", "`doctor --hard-cases --only`"},
      {Kind::kYaml, "kind: picture", "kind: image",
       "`target` of a simulated sweep, `layers[].texture` of a scene"},
      {Kind::kYaml, "picture", "image",
       "`target` of a simulated sweep, `layers[].texture` of a scene"},
      // A key that others have beside them comes before those.
      {Kind::kJson, "picture_seconds", "image_seconds",
       "`simulate --ablate --json`, `explain --costs --json`"},
      {Kind::kJson, "picture", "image", "`simulate --ablate --json`, of an effect",
       "image_seconds"},
      {Kind::kJson, "picture", "image", "`bench paper --json`, of a row", "implementation"},
      {Kind::kJson, "attribution", "ablation", "`simulate --ablate --json`"},
      {Kind::kJson, "picture_files", "image_files", "`doctor --json`"},
      {Kind::kJson, "agreement", "self_test", "`doctor --json`"},
      {Kind::kJson, "hidden_share", "occluded_fraction", "`estimate --json`, `report --estimate`"},
      {Kind::kJson, "seen_share", "visible_fraction", "`estimate --json`, in `rays`"},
      {Kind::kJson, "partly_seen_share", "partly_visible_fraction", "`estimate --json`, in `rays`"},
      {Kind::kJson, "mean_stored", "mean_encoded", "`calibrate --json`, in `frames`"},
      {Kind::kJson, "blur_law_sigma_px", "blur_model_sigma_px", "`calibrate --json`, in `frames`"},
      {Kind::kJson, "blur_law_error_px", "blur_model_error_px", "`calibrate --json`, in `frames`"},
      {Kind::kJson, "scale_law", "scale_model", "`calibrate --json`"},
      {Kind::kJson, "meter", "estimator", "`calibrate --json`, in `blur_fit`", "family"},
      {Kind::kJson, "psnr_picture_db", "psnr_image_db", "`bench --json`"},
      {Kind::kJson, "psnr_hidden_db", "psnr_occluded_db", "`bench --json`"},
      {Kind::kJson, "published_seconds_of_pictures", "published_seconds_of_images",
       "`bench paper --json`"},
      {Kind::kJson, "published_macade_of_pictures", "published_macade_of_images",
       "`bench paper --json`"},
      {Kind::kJson, "published_delta_e94_mean_of_pictures", "published_delta_e94_mean_of_images",
       "`bench paper --json`"},
      {Kind::kJson, "in_the_law", "in_the_model", "`bench accuracy --json`"},
      {Kind::kColumn, "picture_of", "image_of", "`attribution.csv`"},
      {Kind::kColumn, "picture_seconds", "image_seconds", "`attribution.csv`"},
  };
  return names;
}

std::vector<std::string> FormerNames(NameKind kind, const std::string& now) {
  std::vector<std::string> former;
  for (const DeprecatedName& name : DeprecatedNames()) {
    if (name.kind == kind && name.now == now) former.push_back(name.former);
  }
  return former;
}

std::string PresentName(NameKind kind, const std::string& name) {
  for (const DeprecatedName& renamed : DeprecatedNames()) {
    if (renamed.kind == kind && renamed.former == name) return renamed.now;
  }
  return name;
}

void AddDeprecatedFlags(CLI::App* command, const std::string& now, bool* flag,
                        CommonOptions* common) {
  for (const std::string& former : FormerNames(NameKind::kOption, now)) {
    const auto set = [=] {
      *flag = true;
      common->deprecated.push_back(DeprecationText({former, now}));
    };
    command->add_flag_callback(former, set)->group(kFormerNamesGroup);
  }
}

void AddDeprecatedOptions(CLI::App* command, const std::string& now,
                          const std::function<void(const std::string&)>& take,
                          CommonOptions* common) {
  const CLI::Option* present = command->get_option(now);
  for (const std::string& former : FormerNames(NameKind::kOption, now)) {
    const std::function<void(const std::string&)> take_former = [=](const std::string& value) {
      if (value.empty()) throw UsageError(former + ": a value is expected, found ''");
      if (present->count() > 0) {
        throw UsageError(fmt::format("{} and its former name {}: give {} alone", now, former, now));
      }
      take(value);
      common->deprecated.push_back(DeprecationText({former, now}));
    };
    command->add_option_function(former, take_former)->group(kFormerNamesGroup);
  }
}

void AcceptDeprecatedValues(CLI::Option* option, CommonOptions* common) {
  const std::string begin = option->get_name() + " ";
  for (const DeprecatedName& name : DeprecatedNames()) {
    if (name.kind != NameKind::kValue || name.former.rfind(begin, 0) != 0) continue;
    const auto rename = [name, begin, common](std::string& value) {
      if (begin + value == name.former) {
        value = name.now.substr(begin.size());
        common->deprecated.push_back(DeprecationText({name.former, name.now}));
      }
      return std::string();
    };
    option->transform(CLI::Validator(rename, ""));
  }
}

void AddDeprecatedKeys(json* written) {
  for (json* node : InsideOut(written)) {
    if (!node->is_object()) continue;
    for (const DeprecatedName& name : DeprecatedNames()) {
      if (!IsRenamedIn(*node, name) || node->contains(name.former)) continue;
      const auto now = node->find(name.now);
      if (now == node->end()) continue;
      json value = *now;
      (*node)[name.former] = std::move(value);
    }
  }
}

void AcceptDeprecatedKeys(const std::string& source, json* read) {
  for (json* node : InsideOut(read)) {
    if (!node->is_object()) continue;
    for (const DeprecatedName& name : DeprecatedNames()) {
      if (IsRenamedIn(*node, name)) RenameKey(source, name, node);
    }
  }
}

}  // namespace thicklens::tools
