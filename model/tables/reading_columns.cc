#include "model/tables/reading_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "model/tables/reading_number.h"
#include "model/tables/reading_unit.h"
#include "model/tables/table_text.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using Words = std::set<std::string>;

// Names of the readings in English, German, French, Spanish, Portuguese, Italian, Dutch, Swedish,
// Danish, Polish, Czech, Russian, Chinese, Japanese and Korean.
const Words& ReadingWords() {
  static const Words words = {
      "position", "positions",     "pos",        "z",       "zpos",      "zposition", "focus",
      "focuspos", "focusposition", "foc",        "reading", "readings",  "distance",  "dist",
      "depth",    "dial",          "scale",      "travel",  "stage",     "rail",      "slider",
      "encoder",  "lensposition",  "defocus",    "fokus",   "messwert",  "ablesung",  "abstand",
      "stellung", "weg",           "entfernung", "lecture", "distancia", "mise",      "foyer",
      "posición", "posicion",      "lectura",    "enfoque", "foco",      "posição",   "posicao",
      "leitura",  "distância",     "posizione",  "lettura", "fuoco",     "distanza",  "positie",
      "stand",    "afstand",       "läge",       "avstånd", "stilling",  "pozycja",   "położenie",
      "odczyt",   "poloha",        "pozice",     "čtení",   "позиция",   "положение", "фокус",
      "отсчёт",   "отсчет",        "位置",       "焦点",    "焦距位置",  "读数",      "距离",
      "距離",     "ピント",        "위치",       "초점"};
  return words;
}

const Words& FileWords() {
  static const Words words = {
      "file",     "files",      "filename",   "filepath", "fname",     "image",        "images",
      "img",      "imagename",  "imagefile",  "frame",    "framename", "name",         "path",
      "photo",    "photograph", "pic",        "datei",    "dateiname", "bild",         "bildname",
      "aufnahme", "fichier",    "nom",        "cliché",   "archivo",   "imagen",       "nombre",
      "arquivo",  "imagem",     "nome",       "immagine", "bestand",   "bestandsnaam", "afbeelding",
      "fil",      "filnamn",    "filnavn",    "plik",     "obraz",     "zdjęcie",      "soubor",
      "snímek",   "файл",       "имя",        "кадр",     "文件",      "文件名",       "图像",
      "图片",     "ファイル",   "ファイル名", "画像",     "파일",      "파일명"};
  return words;
}

// Words of columns that are no reading although another word of their names says so, such as
// "focus_score" and "position_index".
const Words& OtherWords() {
  static const Words words = {
      "score",   "measure",    "metric",   "sharpness",    "fom",      "time",  "timestamp",
      "date",    "mjd",        "mjdate",   "jd",           "index",    "idx",   "no",
      "nr",      "number",     "num",      "id",           "exposure", "gain",  "temperature",
      "temp",    "sigma",      "std",      "stddev",       "error",    "err",   "uncertainty",
      "rms",     "fwhm",       "contrast", "mean",         "variance", "x",     "y",
      "r",       "theta",      "angle",    "tilt",         "roll",     "lux",   "iso",
      "zeit",    "datum",      "fehler",   "unsicherheit", "heure",    "temps", "fecha",
      "hora",    "tempo",      "width",    "height",       "size",     "mode",  "state",
      "quality", "confidence", "weight",   "elapsed",      "epoch"};
  return words;
}

// Names of times, in the same languages.
const Words& TimeWords() {
  static const Words words = {"time", "times", "timestamp", "timestamps", "elapsed",    "t",
                              "zeit", "temps", "heure",     "tiempo",     "hora",       "tempo",
                              "tijd", "tid",   "czas",      "čas",        "время",      "时间",
                              "時間", "시간",  "pts",       "seconds",    "zeitstempel"};
  return words;
}

bool IsUnitOfTime(const std::string& unit) {
  static const Words units = {"s",  "sec", "secs", "second", "seconds", "sekunde", "sekunden",
                              "ms", "us",  "ns",   "min",    "h",       "hr",      "hours"};
  return units.count(unit) > 0;
}

// Lower case of Latin and Cyrillic letters in UTF-8; other bytes as they are.
std::string LowerCase(const std::string& text) {
  std::string lower;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0U;
    if (byte < 0x80) {
      lower += static_cast<char>(std::tolower(byte));
    } else if (byte == 0xC3 && next >= 0x80 && next <= 0x9E && next != 0x97) {  // U+00C0 to U+00DE
      lower += text[i];
      lower += static_cast<char>(next + 0x20);
      ++i;
    } else if (byte == 0xD0 && next >= 0x90 && next <= 0x9F) {  // U+0410 to U+041F
      lower += text[i];
      lower += static_cast<char>(next + 0x20);
      ++i;
    } else if (byte == 0xD0 && next >= 0xA0 && next <= 0xAF) {  // U+0420 to U+042F
      lower += '\xD1';
      lower += static_cast<char>(next - 0x20);
      ++i;
    } else {
      lower += text[i];
    }
  }
  return lower;
}

bool IsUpper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }
bool IsLower(char c) { return std::islower(static_cast<unsigned char>(c)) != 0; }

// The words of a name: "ZPositionUm" and "Z_position um" are z, position, um.
std::vector<std::string> WordsOf(const std::string& name) {
  std::vector<std::string> words(1);
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    const bool is_letter = static_cast<unsigned char>(c) >= 0x80 ||
                           std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '"' || c == '%';
    const bool begins_word =
        i > 0 && IsUpper(c) &&
        (IsLower(name[i - 1]) ||
         (IsUpper(name[i - 1]) && i + 1 < name.size() && IsLower(name[i + 1])));
    if ((!is_letter || begins_word) && !words.back().empty()) words.emplace_back();
    if (is_letter) words.back() += c;
  }
  if (words.back().empty()) words.pop_back();
  for (std::string& word : words) word = LowerCase(word);
  return words;
}

bool HasWord(const std::vector<std::string>& words, const Words& known) {
  return std::any_of(words.begin(), words.end(),
                     [&](const std::string& word) { return known.count(word) > 0; });
}

// The statements in the name of a column.
struct ColumnName {
  std::vector<std::string> words;    // without the unit
  std::string unit;                  // its text; empty: none
  std::optional<ReadingUnit> known;  // the unit, if it is known
};

// Words of names that describe a value or a device and are no unit: "z (absolute)", "Z stage".
const Words& PlainWords() {
  static const Words words = {
      "abs",      "absolute", "rel",        "relative",  "raw",     "corr",     "corrected",
      "cal",      "calib",    "calibrated", "nominal",   "actual",  "target",   "set",
      "setpoint", "cmd",      "command",    "commanded", "meas",    "measured", "measurement",
      "true",     "real",     "avg",        "average",   "median",  "value",    "values",
      "val",      "wert",     "valeur",     "valor",     "start",   "end",      "begin",
      "first",    "last",     "before",     "after",     "max",     "new",      "old",
      "current",  "final",    "initial",    "soll",      "aktuell", "motor",    "drive",
      "piezo",    "axis",     "achse",      "axe",       "lens",    "camera",   "cam",
      "slide",    "table",    "tisch",      "bench",     "bank",    "mount",    "controller",
      "device",   "carriage", "gauge",      "ruler",     "caliper", "sensor",   "lateral",
      "axial",    "optical",  "linear",     "near",      "far",     "offset",   "shift",
      "slice",    "slices",   "row",        "unit",      "units",   "in",       "of",
      "the",      "from",     "to",         "by",        "at",      "and",      "per",
      "de",       "du",       "des",        "del",       "la",      "le",       "au",
      "der",      "die",      "das",        "point",     "punkt",   "text",     "float",
      "double",   "int",      "number",     "n",         "i",       "left",     "right",
      "up",       "down",     "main",       "auto",      "manual"};
  return words;
}

std::string Trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t\n") - begin + 1);
}

// Units that are not read. Any other word in a name is taken for a part of the name.
bool IsUnreadUnit(const std::string& word) {
  static const Words units = {"km",      "kilometer", "kilometers", "kilometre", "kilometres",
                              "furlong", "furlongs",  "fathom",     "fathoms",   "mile",
                              "miles",   "league",    "leagues",    "parsec",    "parsecs",
                              "arb",     "dac",       "bit",        "bits"};
  return units.count(word) > 0;
}

bool HasLength(const std::optional<ReadingUnit>& unit) {
  return unit && unit->kind != ReadingUnit::Kind::kOther;
}

// "10um" and "mm2": another unit than the one that is known.
bool IsUnitWithNumber(const std::string& word) {
  constexpr char kDigits[] = "0123456789";
  const std::size_t begin = word.find_first_not_of(kDigits);
  if (begin == std::string::npos) return false;
  const std::string letters = word.substr(begin, word.find_last_not_of(kDigits) + 1 - begin);
  return letters.size() < word.size() && letters.size() > 1 && HasLength(FindUnit(letters));
}

// Whether the text in brackets multiplies the unit before it or names another: "mm (1/10)".
bool ChangesUnit(const std::string& inside) {
  const bool is_formula = inside.find_first_not_of("0123456789xX*/^.,-+eE ") == std::string::npos &&
                          inside.find_first_of("0123456789") != std::string::npos &&
                          inside.find_first_of("xX*/^eE") != std::string::npos;
  const std::vector<std::string> words = WordsOf(inside);
  return is_formula || std::any_of(words.begin(), words.end(), [](const std::string& word) {
           return IsUnreadUnit(word) || IsUnitWithNumber(word) ||
                  (word != "in" && HasLength(FindUnit(word)));
         });
}

// Whether the word is known and no unit.
bool IsPlain(const std::string& text) {
  const std::string word = text.substr(0, text.find_last_not_of("0123456789") + 1);  // "z1"
  return PlainWords().count(word) > 0 || ReadingWords().count(word) > 0 ||
         FileWords().count(word) > 0 || OtherWords().count(word) > 0 || TimeWords().count(word) > 0;
}

// The unit that brackets in a name state; empty: none, as in "(abs)" and "(stage)". A text that is
// neither known as a unit nor as anything else is returned, too: it may be a unit.
std::string UnitInBrackets(const std::string& inside) {
  if (FindUnit(inside)) return inside;
  const std::vector<std::string> words = WordsOf(inside);
  if (words.empty()) return Trimmed(inside);  // "(')"
  std::string unit;
  bool is_plain = true;
  for (const std::string& word : words) {
    if (IsPlain(word)) continue;
    is_plain = is_plain && unit.empty() && FindUnit(word).has_value();
    unit = word;
  }
  return is_plain ? unit : inside;
}

// Takes the unit behind the other words: "z_um", "z um (stage)", "z mu m".
void TakeUnitOfWords(ColumnName* name) {
  std::vector<std::string>& words = name->words;
  std::size_t end = words.size();
  // Words behind the unit: "z_um_corrected". "in" is a unit only at the end.
  const auto is_behind = [&](const std::string& word) {
    return word == "in" ? end < words.size() : IsPlain(word) && !FindUnit(word);
  };
  while (end > 1 && is_behind(words[end - 1])) --end;
  if (end == 0) return;
  static const Words prefixes = {"mu", "micro", "milli", "nano", "centi", "pico", "deci"};
  if (end > 2 && prefixes.count(words[end - 2]) > 0) {
    const std::string joined = words[end - 2] + words[end - 1];
    if (const auto unit = FindUnit(joined)) {
      name->unit = joined;
      name->known = unit;
      words.erase(words.begin() + static_cast<std::ptrdiff_t>(end - 2),
                  words.begin() + static_cast<std::ptrdiff_t>(end));
      return;
    }
  }
  const std::string& last = words[end - 1];
  // A micrometer screw: "Micrometer reading" states no unit.
  static const Words screws = {"micrometer", "micrometre", "mikrometer"};
  if (end == 1 && words.size() > 1 && screws.count(last) > 0) return;
  const auto unit = FindUnit(last);
  // A name of one word is a unit only if it is no name: "m" and "in" alone say nothing.
  const bool may_be_unit =
      unit &&
      (end > 1 || (unit->kind == ReadingUnit::Kind::kLength && last != "m" && last != "in") ||
       unit->kind == ReadingUnit::Kind::kOther);
  if (may_be_unit) {
    name->unit = last;
    name->known = unit;
    words.erase(words.begin() + static_cast<std::ptrdiff_t>(end - 1));
    return;
  }
  // "z_um_smoothed", "z in mm from front"; "z mm per click2" and "z_furlong" have none that is
  // read.
  const bool is_rate = std::find(words.begin(), words.end(), "per") != words.end();
  for (std::size_t i = end; i-- > 1;) {
    const std::string word = words[i];
    const auto inner = FindUnit(word);
    const bool is_unread = IsUnreadUnit(word) || IsUnitWithNumber(word);
    const bool is_meant = HasLength(inner) && word != "in" && word != "m";
    if (!is_unread && !is_meant) continue;
    name->unit = word;
    if (is_meant && is_rate) name->unit += " per";
    if (is_meant && !is_rate) name->known = inner;
    words.erase(words.begin() + static_cast<std::ptrdiff_t>(i));
    return;
  }
}

// "Position [µm]", "z (mm)", "z / mm", "z_um".
ColumnName NameOf(const std::string& cell) {
  constexpr std::size_t kLongest = 200;
  std::string text = cell.substr(0, kLongest);
  ColumnName name;
  bool has_several = false, changes_unit = false;
  for (;;) {
    const std::size_t close = text.find_last_of("])}");
    const std::size_t open = close == std::string::npos ? close : text.find_last_of("[({", close);
    if (open == std::string::npos) break;
    const std::string inside = text.substr(open + 1, close - open - 1);
    const std::string unit = UnitInBrackets(inside);
    text.replace(open, close - open + 1, unit.empty() ? " " + inside + " " : " ");
    if (unit.empty()) continue;
    const auto known = FindUnit(unit);
    if (!known) changes_unit = changes_unit || ChangesUnit(unit);
    // "[mm] (rounded)": a word that is not known says nothing beside a unit that is.
    if (!has_several && !changes_unit && !name.unit.empty() &&
        known.has_value() != name.known.has_value()) {
      if (known) name.unit = unit;
      if (known) name.known = known;
      continue;
    }
    // Two units are none that is known.
    has_several = has_several || (known && name.known);
    name.unit = name.unit.empty() ? unit : unit + " " + name.unit;
    name.known = FindUnit(name.unit);
  }
  name.words = WordsOf(text);
  if (name.unit.empty()) {
    TakeUnitOfWords(&name);
  } else if (!name.known && !has_several && !changes_unit) {  // "reading mm (rounded)"
    ColumnName of_words = name;
    TakeUnitOfWords(&of_words);
    if (HasLength(of_words.known)) name = of_words;
  }
  if (name.unit.empty() && name.words.size() > 1 && name.words.front() == "t") {
    name.words.front() = "time";
  }
  return name;
}

std::string Quoted(const std::string& text) { return "'" + Shown(text) + "'"; }

class Finder {
 public:
  Finder(const TableCells& table, const std::string& path, const ReadingOptions& options)
      : table_(table), path_(path), options_(options) {}

  // The columns that may have the times or the numbers of the frames of a video.
  VideoColumns FindForVideo(ReadingColumns* columns) {
    FindHeader();
    CountCells();
    VideoColumns found;
    found.has_header = HasHeader();
    for (std::size_t column = 0; column < found_.width; ++column) {
      if (HasHeader() ? IsTime(column) : IsContentOfTimes(column)) found.times.push_back(column);
      const auto words = NameOf(CellOf(column)).words;
      const bool is_page = std::find(words.begin(), words.end(), "page") != words.end();
      if (HasHeader() && (HasWord(words, FileWords()) || is_page)) found.files.push_back(column);
    }
    // Without names, only the first column can be distinguished from the readings.
    if (!HasHeader() && !found.times.empty() && found.times.front() != 0) found.times.clear();
    if (!HasHeader() && found.times.size() > 1) found.times.resize(1);
    *columns = found_;
    return found;
  }

  ReadingColumns Find() {
    FindHeader();
    CountCells();
    found_.file = FindFile();
    found_.reading = FindReading();
    if (!found_.header.cells.empty()) found_.unit = NameOf(CellOf(found_.reading)).unit;
    found_.unit_column = FindUnitColumn();
    RefuseDoubtfulUnits();
    return found_;
  }

 private:
  bool HasHeader() const { return !found_.header.cells.empty(); }
  const std::string& CellOf(std::size_t column) const {
    static const std::string none;
    return column < found_.header.cells.size() ? found_.header.cells[column] : none;
  }
  std::string Place() const {
    const std::size_t line = HasHeader() ? found_.header.line : table_.rows.front().line;
    return fmt::format("{}:{}: ", path_, line);
  }

  static bool HasFile(const TableRow& row) {
    return std::any_of(row.cells.begin(), row.cells.end(), LooksLikeFile);
  }
  static bool HasNumber(const TableRow& row) {
    return std::any_of(row.cells.begin(), row.cells.end(), LooksLikeNumber);
  }

  // Index of the header or, without one, of the first row with data. Programs of instruments write
  // lines about the recording before it. They name no file, and the table itself begins with the
  // row before the first one that has a file and a number.
  std::size_t FindBeginning() const {
    constexpr std::size_t kMaxPreamble = 200;
    for (std::size_t i = 0; i < std::min(table_.rows.size(), kMaxPreamble); ++i) {
      if (!HasFile(table_.rows[i])) continue;
      if (i == 0 || !HasNumber(table_.rows[i])) return 0;
      const TableRow& before = table_.rows[i - 1];
      // Rows with more cells than the only row before them are reported one by one.
      const bool is_as_wide =
          i == 1 ? before.cells.size() > 1 : before.cells.size() == table_.rows[i].cells.size();
      const bool is_header = is_as_wide && !HasNumber(before);
      return is_header ? i - 1 : i;
    }
    return 0;
  }

  // The first row is a header if it has neither a number nor the name of a file.
  void FindHeader() {
    const bool is_first = NamesCell(table_.rows.front(), options_.column) ||
                          NamesCell(table_.rows.front(), options_.file_column) ||
                          NamesCell(table_.rows.front(), options_.time_column);
    const std::size_t beginning = is_first ? 0 : FindBeginning();
    found_.first_row = beginning;
    if (beginning > 0) found_.last_skipped_line = table_.rows[beginning - 1].line;
    const TableRow& first = table_.rows[beginning];
    const bool is_asked_for = NamesCell(first, options_.column) ||
                              NamesCell(first, options_.file_column) ||
                              NamesCell(first, options_.time_column);
    const bool has_data = HasNumber(first) || HasFile(first);
    const auto& comment = table_.comment.cells;
    if (is_asked_for || !has_data) {
      found_.header = first;
      found_.first_row = beginning + 1;
    } else if (comment.size() == first.cells.size() &&
               std::none_of(comment.begin(), comment.end(), LooksLikeNumber)) {
      found_.header = table_.comment;
    }
    found_.width = HasHeader() ? found_.header.cells.size() : first.cells.size();
  }

  static bool NamesCell(const TableRow& row, const std::string& name) {
    return !name.empty() && std::find(row.cells.begin(), row.cells.end(), name) != row.cells.end();
  }

  void CountCells() {
    numbers_.assign(found_.width, 0);
    files_ = texts_ = numbers_;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      for (std::size_t k = 0; k < std::min(cells.size(), found_.width); ++k) {
        if (LooksLikeNumber(cells[k])) {
          ++numbers_[k];
        } else if (!cells[k].empty()) {
          ++texts_[k];
          files_[k] += LooksLikeFile(cells[k]);
        }
      }
    }
  }

  // A few wrong cells do not change what a column is.
  bool IsMost(std::size_t count) const {
    return count > 0 && 2 * count >= table_.rows.size() - found_.first_row;
  }

  std::vector<std::size_t> Select(const std::vector<std::size_t>& among,
                                  const std::function<bool(std::size_t)>& is_meant) const {
    std::vector<std::size_t> selected;
    std::copy_if(among.begin(), among.end(), std::back_inserter(selected), is_meant);
    return selected;
  }
  std::vector<std::size_t> All() const {
    std::vector<std::size_t> all(found_.width);
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    return all;
  }

  std::string List(const std::vector<std::size_t>& columns) const {
    constexpr std::size_t kMost = 6;
    std::string text;
    for (std::size_t i = 0; i < std::min(columns.size(), kMost); ++i) {
      text += (i == 0 ? "" : ", ") + ColumnText(found_, columns[i]);
    }
    if (columns.size() > kMost) text += fmt::format(" and {} more", columns.size() - kMost);
    return text;
  }

  // The column that an option names.
  std::size_t Named(const std::string& name, const char* option) const {
    const auto matches = [&](const std::function<bool(const std::string&)>& is_same) {
      return Select(All(), [&](std::size_t column) { return is_same(CellOf(column)); });
    };
    std::vector<std::size_t> found;
    if (HasHeader()) {
      found = matches([&](const std::string& cell) { return cell == name; });
      if (found.empty()) {
        found = matches([&](const std::string& cell) {
          return LowerCase(Trimmed(cell)) == LowerCase(Trimmed(name));
        });
      }
      if (found.empty()) {
        const auto words = WordsOf(name);
        found = matches([&](const std::string& cell) {
          return !words.empty() && (NameOf(cell).words == words || WordsOf(cell) == words);
        });
      }
    }
    if (found.empty()) {
      std::size_t number = 0;
      const auto [rest, status] = std::from_chars(name.data(), name.data() + name.size(), number);
      const bool is_number = status == std::errc() && rest == name.data() + name.size();
      if (is_number && number >= 1 && number <= found_.width) return number - 1;
      throw Error(fmt::format("{}{}: the table has no column {}; it has {}", Place(), option,
                              Quoted(name), List(All())));
    }
    if (found.size() > 1) {
      throw Error(fmt::format("{}{}: {} may be {}; give its number", Place(), option, Quoted(name),
                              List(found)));
    }
    return found.front();
  }

  bool IsTime(std::size_t column) const {
    const ColumnName name = NameOf(CellOf(column));
    if (std::find(name.words.begin(), name.words.end(), "exposure") != name.words.end())
      return false;
    // A column of positions may have a name such as "focus_time_avg", but hardly a unit of time.
    if (HasWord(name.words, ReadingWords())) return false;
    return HasWord(name.words, TimeWords()) ||
           (name.words.empty() && IsUnitOfTime(LowerCase(name.unit)));
  }

  // Whether the cells are "00:01:02" or numbers that are not whole.
  bool IsContentOfTimes(std::size_t column) const {
    bool has_fraction = false;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size()) continue;
      const std::string& cell = cells[column];
      if (cell.find(':') != std::string::npos) return true;
      if (LooksLikeNumber(cell) && cell.find_first_of(".,") != std::string::npos)
        has_fraction = true;
    }
    return has_fraction;
  }

  std::size_t FindFile() const {
    if (!options_.time_column.empty()) return Named(options_.time_column, "--time-column");
    if (!options_.file_column.empty()) return Named(options_.file_column, "--file-column");
    const auto has_file_name = [&](std::size_t column) {
      return HasWord(NameOf(CellOf(column)).words, FileWords());
    };
    const auto files = Select(All(), [&](std::size_t column) { return IsMost(files_[column]); });
    if (files.size() == 1) return files.front();
    if (files.size() > 1) {
      const auto named = Select(files, has_file_name);
      if (named.size() == 1) return named.front();
      throw Error(fmt::format("{}several columns name files: {}; --file-column selects one",
                              Place(), List(named.empty() ? files : named)));
    }
    const auto texts = Select(
        All(), [&](std::size_t column) { return IsMost(texts_[column]) && !IsUnits(column); });
    auto named = Select(texts, has_file_name);
    if (named.size() == 1) return named.front();
    if (texts.size() == 1 && named.empty()) return texts.front();
    // Names without an ending may be numbers.
    named = Select(All(), has_file_name);
    if (named.size() == 1) return named.front();
    if (found_.width <= 2) return 0;
    throw Error(fmt::format(
        "{}no column names the files of the images; the table has {}; {}", Place(), List(All()),
        texts.empty()
            ? "a column with their names is needed (a table by time, or by the numbers of "
              "frames, is for a video)"
            : "--file-column selects one of them"));
  }

  // How likely the column is the reading: 0 the least likely.
  int RankOf(std::size_t column) const {
    const ColumnName name = NameOf(CellOf(column));
    if (name.known && name.known->kind == ReadingUnit::Kind::kOther) return 0;
    if (HasWord(name.words, OtherWords())) {
      // "x, y, z" in one name, as in "stage_z_x", is not meant by any known program.
      return 0;
    }
    if (HasWord(name.words, ReadingWords())) return 3;
    return name.known ? 2 : 1;
  }

  std::size_t FindReading() const {
    if (!options_.column.empty()) return RequireOther(Named(options_.column, "--column"));
    const auto others = Select(All(), [&](std::size_t column) { return column != found_.file; });
    const auto numbers =
        Select(others, [&](std::size_t column) { return IsMost(numbers_[column]); });
    std::vector<std::size_t> candidates;
    int best = 0;
    for (const std::size_t column : numbers) {
      const int rank = HasHeader() ? RankOf(column) : 1;
      if (rank > best) candidates.clear();
      if (rank > 0 && rank >= best) candidates.push_back(column);
      best = std::max(best, rank);
    }
    if (candidates.size() == 1) {
      if (IsCount(candidates.front())) RefuseCount(candidates.front(), numbers);
      return candidates.front();
    }
    if (candidates.size() > 1) RefuseSeveral(candidates);
    if (!numbers.empty()) {
      throw Error(fmt::format(
          "{}no column is named as a position or has a unit of length; the numbers are in {}; "
          "--column selects one, and --unit states its unit",
          Place(), List(numbers)));
    }
    // No column of numbers: the message about the first wrong cell says more.
    const auto named = Select(others, [&](std::size_t column) { return RankOf(column) == 3; });
    if (named.size() == 1) return named.front();
    if (found_.width <= 2) return others.empty() ? 1 : others.front();
    throw Error(fmt::format("{}no column has numbers in most rows; the table has {}", Place(),
                            List(All())));
  }

  // Whether a column only counts the rows: by its name, and by whole numbers one after the other.
  bool IsCount(std::size_t column) const {
    static const Words counts = {"frame",  "frames", "slice",  "slices", "index", "idx",  "id",
                                 "row",    "rows",   "line",   "n",      "i",     "no",   "nr",
                                 "number", "num",    "nummer", "image",  "img",   "bild", "page",
                                 "shot",   "photo",  "sample", "record", "count"};
    if (!HasHeader() || !options_.unit.empty() || options_.scale_mm) return false;
    const ColumnName name = NameOf(CellOf(column));
    const bool is_of_pandas = !name.words.empty() && name.words.front() == "unnamed";
    const bool may_count =
        name.words.empty() || is_of_pandas || counts.count(name.words.back()) > 0;
    if (!name.unit.empty() || !may_count) return false;
    std::optional<double> before;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size() || cells[column].empty()) continue;
      const auto value = ToNumber(Trimmed(cells[column]), '.');
      if (!value || (before && *value != *before + 1)) return false;
      // Without a name, readings in steps of 1 mm are as likely.
      if (!before && Trimmed(CellOf(column)).empty() && *value != 0 && *value != 1) return false;
      before = value;
    }
    return before && *before == std::floor(*before);
  }

  [[noreturn]] void RefuseCount(std::size_t column, const std::vector<std::size_t>& numbers) const {
    throw Error(fmt::format(
        "{}{} only counts the rows, and no other column is named as a position or has a unit of "
        "length; the numbers are in {}; --column selects the readings by name or number, and "
        "--unit states their unit",
        Place(), ColumnText(found_, column), List(numbers)));
  }

  // The column that states the unit of the readings in each row. One that is named so belongs to
  // the column that it also names ("z unit"), or to the numbers before it.
  std::optional<std::size_t> FindUnitColumn() const {
    std::optional<std::size_t> found;
    for (std::size_t column = 0; column < found_.width; ++column) {
      if (column == found_.file || column == found_.reading || !IsUnits(column)) continue;
      if (OwnerOf(column) != found_.reading) continue;
      if (found) {
        throw Error(fmt::format("{}{} and {} may be the unit of {}; state it by --unit", Place(),
                                ColumnText(found_, *found), ColumnText(found_, column),
                                ColumnText(found_, found_.reading)));
      }
      found = column;
    }
    return options_.unit.empty() ? found : std::nullopt;
  }

  static bool IsUnitWord(const std::string& word) {
    static const Words words = {
        "unit",     "units",    "einheit", "einheiten", "unité",   "unite", "unités",
        "unidad",   "unidades", "unidade", "unità",     "eenheid", "enhet", "jednostka",
        "jednotka", "единица",  "единицы", "单位",      "單位",    "単位",  "단위"};
    return words.count(word) > 0;
  }

  // Whether the cells are units: by the name of the column or, without a header, by all of them.
  bool IsUnits(std::size_t column) const {
    const std::vector<std::string> words = WordsOf(CellOf(column));
    if (std::any_of(words.begin(), words.end(), IsUnitWord)) {
      return IsMost(texts_[column]) && (HasOnlyUnits(column) || MayBeUnits(column, words));
    }
    if (HasHeader() && !words.empty()) return false;
    return HasOnlyUnits(column);
  }

  // A "unit" may be a device, too: "lens unit", or "cam A" before the readings.
  bool MayBeUnits(std::size_t column, std::vector<std::string> words) const {
    words.erase(std::remove_if(words.begin(), words.end(), IsUnitWord), words.end());
    const auto all = All();
    const bool names_column = std::any_of(all.begin(), all.end(), [&](std::size_t other) {
      return other != column && !words.empty() && NameOf(CellOf(other)).words == words;
    });
    if (names_column) return true;
    if (!words.empty() && !HasWord(words, ReadingWords())) return false;
    const bool is_behind_numbers = words.empty() && column > 0 && IsMost(numbers_[column - 1]) &&
                                   !HasWord(WordsOf(CellOf(column - 1)), FileWords());
    if (is_behind_numbers) return true;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size()) continue;
      const auto unit = FindUnit(cells[column]);
      const bool is_letter = cells[column].size() == 1;  // "A", "C", and "V" name devices
      if (HasLength(unit) || (unit && !is_letter) || IsUnreadUnit(LowerCase(cells[column])))
        return true;
    }
    return false;
  }

  bool HasOnlyUnits(std::size_t column) const {
    if (!IsMost(texts_[column]) || numbers_[column] > 0) return false;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size() || cells[column].empty()) continue;
      const auto unit = FindUnit(cells[column]);
      if (!unit || unit->kind == ReadingUnit::Kind::kOther) return false;
    }
    return true;
  }

  // A column of another name with nothing but units may be theirs, or may mean anything ("in").
  void RefuseDoubtfulUnits() const {
    if (!options_.unit.empty() || !found_.unit.empty() || found_.unit_column) return;
    for (std::size_t column = 0; column < found_.width; ++column) {
      if (column == found_.file || column == found_.reading || !HasOnlyUnits(column)) continue;
      if (OwnerOf(column) != found_.reading) continue;
      throw Error(
          fmt::format("{}{} has nothing but units, and {} states none: name that column 'unit' if "
                      "it is theirs, "
                      "or state the unit of the readings by --unit",
                      Place(), ColumnText(found_, column), ColumnText(found_, found_.reading)));
    }
  }

  std::size_t OwnerOf(std::size_t column) const {
    std::vector<std::string> words = WordsOf(CellOf(column));
    words.erase(std::remove_if(words.begin(), words.end(), IsUnitWord), words.end());
    for (std::size_t other = 0; other < found_.width && !words.empty(); ++other) {
      if (other != column && NameOf(CellOf(other)).words == words) return other;
    }
    for (std::size_t other = column; other-- > 0;) {
      const bool is_name = other == found_.file && options_.time_column.empty();
      if (IsMost(numbers_[other]) && !is_name) return other;
    }
    for (std::size_t other = column + 1; other < found_.width; ++other) {
      if (IsMost(numbers_[other]) && other != found_.file) return other;
    }
    return column;
  }

  std::size_t RequireOther(std::size_t column) const {
    if (column == found_.file && found_.width > 1) {
      throw Error(fmt::format("{}--column: {} has the {}; name the column of the readings", Place(),
                              ColumnText(found_, column),
                              options_.time_column.empty() ? "files" : "times"));
    }
    return column;
  }

  [[noreturn]] void RefuseSeveral(const std::vector<std::size_t>& candidates) const {
    std::string comma;
    const bool may_be_comma = table_.separator == ',' && candidates.size() == 2 &&
                              candidates[1] == candidates[0] + 1 && AreDigits(candidates[1]);
    if (may_be_comma && !HasHeader()) {
      comma = fmt::format(
          " (or one number with a decimal comma, which a table with commas must have in quotation "
          "marks)");
    }
    throw Error(fmt::format("{}which column is the reading, {}{}? --column selects it by its {}",
                            Place(), List(candidates), comma,
                            HasHeader() ? "name or number" : "number"));
  }

  bool AreDigits(std::size_t column) const {
    return std::all_of(table_.rows.begin() + static_cast<std::ptrdiff_t>(found_.first_row),
                       table_.rows.end(), [&](const TableRow& row) {
                         if (column >= row.cells.size()) return true;
                         const std::string& cell = row.cells[column];
                         return std::all_of(cell.begin(), cell.end(), [](char c) {
                           return std::isdigit(static_cast<unsigned char>(c)) != 0;
                         });
                       });
  }

  const TableCells& table_;
  const std::string& path_;
  const ReadingOptions& options_;
  ReadingColumns found_;
  std::vector<std::size_t> numbers_, files_, texts_;  // how many cells of each column are such
};

}  // namespace

std::optional<std::string> UnitOfReadingName(const std::string& name) {
  const ColumnName column = NameOf(name);
  const bool is_other = column.known && column.known->kind == ReadingUnit::Kind::kOther;
  if (is_other || HasWord(column.words, OtherWords()) || !HasWord(column.words, ReadingWords()))
    return std::nullopt;
  return column.unit;
}

bool IsNameOfFiles(const std::string& name) { return HasWord(NameOf(name).words, FileWords()); }

std::string ColumnText(const ReadingColumns& columns, std::size_t column) {
  const std::string number = fmt::format("column {}", column + 1);
  if (column >= columns.header.cells.size() || columns.header.cells[column].empty()) return number;
  return number + " " + Quoted(columns.header.cells[column]);
}

VideoColumns FindVideoColumns(const TableCells& table, const std::string& path,
                              const ReadingOptions& options, ReadingColumns* columns) {
  return Finder(table, path, options).FindForVideo(columns);
}

ReadingColumns FindColumns(const TableCells& table, const std::string& path,
                           const ReadingOptions& options) {
  return Finder(table, path, options).Find();
}

}  // namespace thicklens::model
