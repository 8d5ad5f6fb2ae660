#include "model/tables/column_names.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

bool IsUpper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }
bool IsLower(char c) { return std::islower(static_cast<unsigned char>(c)) != 0; }

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

}  // namespace

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

std::string LowerCase(const std::string& text) {
  std::string lower;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0U;
    const bool is_latin =  // U+00C0 to U+00DE
        byte == 0xC3 && next >= 0x80 && next <= 0x9E && next != 0x97;
    const bool is_cyrillic = byte == 0xD0 && next >= 0x90 && next <= 0x9F;  // U+0410 to U+041F
    if (byte < 0x80) {
      lower += static_cast<char>(std::tolower(byte));
    } else if (is_latin || is_cyrillic) {
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

std::string Trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t\n") - begin + 1);
}

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

std::optional<std::string> UnitOfReadingName(const std::string& name) {
  const ColumnName column = NameOf(name);
  const bool is_other = column.known && column.known->kind == ReadingUnit::Kind::kOther;
  if (is_other || HasWord(column.words, OtherWords()) || !HasWord(column.words, ReadingWords()))
    return std::nullopt;
  return column.unit;
}

bool IsNameOfFiles(const std::string& name) { return HasWord(NameOf(name).words, FileWords()); }

}  // namespace thicklens::model
