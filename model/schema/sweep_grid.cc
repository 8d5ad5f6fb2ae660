#include "model/schema/sweep_grid.h"

#include <vector>

namespace thicklens::model {

TargetGrid ReadTargetGrid(const YamlNode& node) {
  if (!node.IsMap())
    throw node.ErrorHere("a map with pattern, columns, rows and square_mm is expected");
  node.RequireKeys({"pattern", "columns", "rows", "square_mm", "marker_mm", "dictionary"});
  TargetGrid grid;
  grid.pattern = *GridPatternOf(node.At("pattern").OneOf(
      {"chequerboard", "checkerboard", "chessboard", "charuco", "circles"}));
  constexpr int kMaxCount = 100000;  // IsValid has the limit
  grid.columns = node.At("columns").Integer(0, kMaxCount);
  grid.rows = node.At("rows").Integer(0, kMaxCount);
  grid.square_mm = node.At("square_mm").PositiveNumber();
  const auto marker = node.Find("marker_mm"), dictionary = node.Find("dictionary");
  if (grid.pattern == GridPattern::kCharuco) {
    grid.marker_mm = marker ? marker->PositiveNumber() : kMarkerPart * grid.square_mm;
    if (dictionary) grid.dictionary = dictionary->Text();
  } else if (marker || dictionary) {
    throw(marker ? marker : dictionary)->ErrorHere("only the pattern charuco has markers");
  }
  std::string why;
  if (!grid.IsValid(&why)) throw node.ErrorHere(why);
  return grid;
}

void WriteTargetGrid(const char* key, const TargetGrid& grid, YamlWriter* out) {
  out->BeginMapInLine(key);
  out->Text("pattern", GridPatternName(grid.pattern));
  out->Number("columns", grid.columns);
  out->Number("rows", grid.rows);
  out->Number("square_mm", grid.square_mm);
  if (grid.pattern == GridPattern::kCharuco) {
    out->Number("marker_mm", grid.marker_mm);
    out->Text("dictionary", grid.dictionary);
  }
  out->EndMap();
}

void ReadGrid(const YamlNode& root, SweepFile* sweep) {
  if (const auto grid = root.Find("target_grid")) sweep->target_grid = ReadTargetGrid(*grid);
  if (const auto views = root.Find("grid_views")) {
    if (!sweep->target_grid)
      throw views->ErrorHere("target_grid is missing, the grid that these images show");
    if (views->IsSequence()) {
      for (const YamlNode& file : views->Elements())
        sweep->grid_views.push_back(file.ResolvePath(file.Text()));
    } else {
      sweep->grid_views = ImagesOfFolder(views->ResolvePath(views->Text()));
    }
    if (sweep->grid_views.empty()) throw views->ErrorHere("one image or more is expected");
  }
  if (const auto alignment = root.Find("stage_alignment_deg")) {
    constexpr double kMaxCount = 45;
    sweep->stage_alignment_deg = alignment->PositiveNumber();
    if (*sweep->stage_alignment_deg > kMaxCount)
      throw alignment->ErrorHere("a standard deviation of at most 45 degrees is expected");
  }
}

void WriteGrid(const SweepFile& sweep, YamlWriter* out) {
  if (sweep.target_grid) WriteTargetGrid("target_grid", *sweep.target_grid, out);
  if (!sweep.grid_views.empty()) out->List("grid_views", sweep.grid_views);
  out->NumberIfAny("stage_alignment_deg", sweep.stage_alignment_deg);
}

}  // namespace thicklens::model
