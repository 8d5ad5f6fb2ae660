#ifndef THICKLENS_TOOLS_REPORT_ABLATION_TABLE_H_
#define THICKLENS_TOOLS_REPORT_ABLATION_TABLE_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/scene_ablation.h"
#include "thicklens/model/sweep_ablation.h"

namespace thicklens::tools {

// At least one of the two ablations.
struct Ablation {
  std::optional<model::SceneAblation> scene;
  std::optional<model::SweepAblation> sweep;
};

// One effect in all that was simulated, in the order of the enumeration. A null pointer means that
// the effect was not part of that simulation.
struct AblationRow {
  model::Effect effect = model::Effect::kDefocus;
  const model::AblatedSceneEffect* scene = nullptr;
  const model::AblatedSweepEffect* sweep = nullptr;

  // The ablation for the scene, or for the sweep's frames if there is no scene.
  const model::AblatedEffect& image() const {
    if (scene != nullptr) return *scene;
    return *sweep;
  }
  bool absent() const {
    return (scene == nullptr || scene->absent) && (sweep == nullptr || sweep->absent);
  }
};
std::vector<AblationRow> RowsOf(const Ablation& ablation);

// The columns of the table beyond the effect's name; a scene and a sweep each add columns. Cells
// are texts as shown, "-" where there is no value.
struct AblationTable {
  struct Column {
    std::string group, name;  // "image", "rms gl"
  };
  std::vector<Column> columns;  // columns of one group are adjacent
  struct Line {
    std::string name;
    std::vector<std::string> cells;
  };
  std::vector<Line> lines;  // the first line is "with all"
};
AblationTable TableOf(const Ablation& ablation);
// Notes that are needed to read the table, one sentence each.
std::vector<std::string> AblationNotes(const Ablation& ablation);

std::string AblationText(const Ablation& ablation);
std::string AblationCsv(const Ablation& ablation);
nlohmann::json AblationJson(const Ablation& ablation);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ABLATION_TABLE_H_
