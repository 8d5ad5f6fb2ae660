#ifndef THICKLENS_TOOLS_ATTRIBUTION_TABLE_H_
#define THICKLENS_TOOLS_ATTRIBUTION_TABLE_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "attribution.h"

namespace thicklens::tools {

// One of them, or both.
struct Attribution {
  std::optional<SceneAttribution> scene;
  std::optional<SweepAttribution> sweep;
};

// One effect in all that was simulated, in the order of the enumeration. Null: not part of it.
struct AttributionRow {
  model::Effect effect = model::Effect::kDefocus;
  const SceneEffect* scene = nullptr;
  const SweepEffect* sweep = nullptr;

  // Of the scene; of the sweep's frames where the scene has none.
  const AttributedEffect& picture() const {
    if (scene != nullptr) return *scene;
    return *sweep;
  }
  bool absent() const {
    return (scene == nullptr || scene->absent) && (sweep == nullptr || sweep->absent);
  }
};
std::vector<AttributionRow> RowsOf(const Attribution& attribution);

// The table's columns beyond the effect's name, with and without what a scene or a sweep adds.
// Texts as they are shown, "-" for what there is not.
struct AttributionTable {
  struct Column {
    std::string group, name;  // "picture", "rms gl"
  };
  std::vector<Column> columns;  // those of one group stand together
  struct Line {
    std::string name;
    std::vector<std::string> cells;
  };
  std::vector<Line> lines;  // first "with all"
};
AttributionTable TableOf(const Attribution& attribution);
// What must be known to read it, a sentence each.
std::vector<std::string> AttributionNotes(const Attribution& attribution);

std::string AttributionText(const Attribution& attribution);
std::string AttributionCsv(const Attribution& attribution);
nlohmann::json AttributionJson(const Attribution& attribution);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ATTRIBUTION_TABLE_H_
