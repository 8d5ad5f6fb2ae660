// Tables of readings as text: layouts of the programs that write them, and what is wrong with them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;

ReadingSet Read(const std::string& bytes, const ReadingOptions& options = {}) {
  return ReadingsOfTable(bytes, "bench/t.csv", options);
}

std::string Refusal(const std::string& bytes, const ReadingOptions& options = {}) {
  return ErrorOf([&] { Read(bytes, options); });
}

std::vector<double> Values(const ReadingSet& set) {
  std::vector<double> values;
  for (const FileReading& row : set.rows) values.push_back(row.reading_mm);
  return values;
}

std::vector<double> ValuesOf(const std::string& bytes, const ReadingOptions& options = {}) {
  return Values(Read(bytes, options));
}

ReadingOptions WithUnit(const std::string& unit, std::optional<double> scale_mm = {}) {
  ReadingOptions options;
  options.unit = unit;
  options.scale_mm = scale_mm;
  return options;
}

std::string Utf16(const std::string& ascii, bool is_big, bool has_mark) {
  std::string wide = !has_mark ? "" : is_big ? "\xFE\xFF" : "\xFF\xFE";
  for (const char c : ascii) wide += is_big ? std::string({'\0', c}) : std::string({c, '\0'});
  return wide;
}

TEST(ReadingsTable, StatesWhatWasRead) {
  const ReadingSet set = Read("file,t_s,z_um\na.png,0.1,95000\nb.png,0.2,96000.5\n");
  EXPECT_EQ(set.description, "column 3 'z_um' of t.csv, um, 2 rows; files from column 1 'file'");
  EXPECT_EQ(set.source, "bench/t.csv");
  EXPECT_EQ(set.folder, "bench");
  ASSERT_THAT(set.rows, SizeIs(2));
  EXPECT_EQ(set.rows[1].file, "b.png");
  EXPECT_DOUBLE_EQ(set.rows[1].reading_mm, 96.0005);
  EXPECT_EQ(set.rows[1].place, "bench/t.csv:3: ");
  EXPECT_EQ(
      Read("a.png 95,5\n").description,
      "column 2 of t.csv, mm (no unit is stated), 1 row; files from column 1; spaces; decimal "
      "comma");
}

// An astronomer's table of a through-focus run: file, date, focus, and other columns.
TEST(ReadingsTable, ThroughFocusTable) {
  EXPECT_THAT(ValuesOf("file,MJDATE,FOCUS,FWHM\nf0.png,59417.829845,95.5,3\n"
                       "f1.png,59417.829965,96,2.5\n"),
              ElementsAre(95.5, 96));
}

// A motor controller's log with time stamps, positions in steps, and a figure of sharpness.
TEST(ReadingsTable, MotorLogInSteps) {
  const std::string log =
      "timestamp;motor_position_steps;focus_score;image\n"
      "2024-05-01T10:00:00.1;1000;0.5;img_0001.jpg\n2024-05-01T10:00:01.2;1200;0.7;img_0002.jpg\n";
  ReadingOptions options;
  // Without a length they are counts, which a focus drive may have.
  const ReadingSet counts = ReadingsOfTable(log, "t.csv", options);
  EXPECT_TRUE(counts.in_counts);
  EXPECT_EQ(counts.rows.at(1).reading_mm, 1200);
  EXPECT_THAT(counts.description, HasSubstr("steps"));
  options.scale_mm = 0.0025;
  EXPECT_THAT(ValuesOf(log, options), ElementsAre(2.5, 3));
}

// LabVIEW in a German locale: tabs, decimal comma, name and unit in brackets, Latin-1 letters.
TEST(ReadingsTable, GermanSpreadsheetInLatin1) {
  const std::string text =
      "Bild\tPosition [\xB5m]\tTemperatur [\xB0"
      "C]\r\nm\xFCnze 1.tif\t95000,25\t21,5\r\nm\xFCnze 2.tif\t96000,5\t21,6\r\n";
  const ReadingSet set = Read(text);
  EXPECT_THAT(Values(set), ElementsAre(DoubleNear(95.00025, 1e-12), DoubleNear(96.0005, 1e-12)));
  EXPECT_EQ(set.rows[0].file, "m\xC3\xBCnze 1.tif");
  EXPECT_THAT(set.description, AllOf(HasSubstr("Position [\xC2\xB5m]"), HasSubstr("um"),
                                     HasSubstr("decimal comma"), HasSubstr("Latin-1")));
}

// Excel's "Unicode text": UTF-16 with tabs; other programs leave out the mark or swap the bytes.
TEST(ReadingsTable, Utf16OfEitherOrder) {
  for (const bool is_big : {false, true}) {
    for (const bool has_mark : {false, true}) {
      const ReadingSet set =
          Read(Utf16("file\treading\r\na.png\t95.5\r\nb.png\t96\r\n", is_big, has_mark));
      EXPECT_THAT(Values(set), ElementsAre(95.5, 96));
      EXPECT_THAT(set.description, HasSubstr("UTF-16"));
    }
  }
}

// numpy.savetxt writes the header as a comment, and spaces between the cells.
TEST(ReadingsTable, NumpyTextWithCommentedHeader) {
  EXPECT_THAT(ValuesOf("# file z_um temperature\na.png 95500 21\nb.png   96000\t22\n"),
              ElementsAre(95.5, 96));
  EXPECT_THAT(
      ValuesOf("% bench of May\n// by hand\n\nfile, z (mm)\na.png, 1\n# b.png, 7\nb.png, 2\n"),
      ElementsAre(1, 2));
}

// Programs of instruments write lines about the recording before the table.
TEST(ReadingsTable, LinesBeforeTheTableAreReported) {
  const ReadingSet set = Read(
      "Focus sweep\nOperator,me\nDate,2024-05-01,10:00\n\nfile,t_s,z_um\n"
      "a.png,1,5\nb.png,2,6\n");
  EXPECT_THAT(Values(set), ElementsAre(0.005, 0.006));
  EXPECT_THAT(set.notices, ElementsAre(HasSubstr("the lines up to 3")));
  EXPECT_THAT(ValuesOf("Focus sweep\na.png;1\nb.png;2\n"), ElementsAre(1, 2));
  // A row with a file is never left out.
  EXPECT_THAT(Refusal("file,z\na.png,two\nb.png,2\n"),
              AllOf(StartsWith("bench/t.csv:2: "), HasSubstr("'two'")));
}

// R writes names with points.
TEST(ReadingsTable, NamesWithPoints) {
  EXPECT_THAT(ValuesOf("\"file.name\",\"z.um\"\n\"a.png\",5\n"), ElementsAre(0.005));
}

TEST(ReadingsTable, ExcelStatesTheSeparator) {
  EXPECT_THAT(ValuesOf("sep=|\nfile|z\na.png|1\nb.png|2\n"), ElementsAre(1, 2));
  EXPECT_THAT(ValuesOf("sep=;\r\nfile;z\r\na.png;1,5\r\n"), ElementsAre(1.5));
}

TEST(ReadingsTable, OldMacLinesAndTheEndMarkOfDos) {
  EXPECT_THAT(ValuesOf("file,z\ra.png,1\rb.png,2\r\x1A"), ElementsAre(1, 2));
}

TEST(ReadingsTable, NamesOfColumnsInManyLanguages) {
  for (const char* name :
       {"position",    "Z",         "zPos",     "Focus Position", "stage_z_mm",
        "ZPositionMm", "Reading",   "Messwert", "Ablesung (mm)",  "Stellung",
        "Lecture",     "posición",  "POSIÇÃO",  "posizione",      "Läge",
        "pozycja",     "Положение", "位置",     "位置 [mm]",      "Position / mm",
        "z in mm"}) {
    EXPECT_THAT(
        ValuesOf("n,file,x," + std::string(name) + ",extra\n1,a.png,7,95,3\n2,b.png,7,96,4\n"),
        ElementsAre(95, 96))
        << name;
  }
  for (const char* name :
       {"Datei", "Bildname", "Fichier", "archivo", "Immagine", "ファイル名", "файл"}) {
    EXPECT_THAT(ValuesOf("operator," + std::string(name) + ",z\nme,0001,95\nyou,0002,96\n"),
                ElementsAre(95, 96))
        << name;
  }
}

TEST(ReadingsTable, UnitsOfHeadersCellsAndOptions) {
  const auto of_header = [](const std::string& name) {
    return ValuesOf("file," + name + "\na.png,2\n").at(0);
  };
  for (const char* name : {"z", "z_mm", "z [mm]", "z (millimetres)", "mm"})
    EXPECT_DOUBLE_EQ(of_header(name), 2) << name;
  for (const char* name : {"z_um", "z [\xC2\xB5m]", "z [\xCE\xBCm]", "Position (microns)", "zUm"})
    EXPECT_DOUBLE_EQ(of_header(name), 0.002) << name;
  EXPECT_DOUBLE_EQ(of_header("z_nm"), 2e-6);
  EXPECT_DOUBLE_EQ(of_header("z_cm"), 20);
  EXPECT_DOUBLE_EQ(of_header("z (m)"), 2000);
  EXPECT_DOUBLE_EQ(of_header("\"z, inch\""), 50.8);
  EXPECT_DOUBLE_EQ(of_header("z_in"), 50.8);
  EXPECT_DOUBLE_EQ(of_header("focus_dpt"), 500);
  EXPECT_DOUBLE_EQ(ValuesOf("a.png,2 cm\nb.png,3cm\n").at(1), 30);
  EXPECT_DOUBLE_EQ(ValuesOf("file,z_um\na.png,2 \xC2\xB5m\n").at(0), 0.002);
  EXPECT_DOUBLE_EQ(ValuesOf("a.png,2\n", WithUnit("in")).at(0), 50.8);
  EXPECT_DOUBLE_EQ(ValuesOf("file,z_counts\na.png,200\n", WithUnit("", 0.01)).at(0), 2);
  EXPECT_DOUBLE_EQ(ValuesOf("a.png,200\n", WithUnit("steps", -0.01)).at(0), -2);
  // The option replaces the unit of the header, and a notice reports it.
  const ReadingSet replaced = Read("file,z_um\na.png,2\n", WithUnit("mm"));
  EXPECT_THAT(Values(replaced), ElementsAre(2));
  EXPECT_THAT(replaced.notices, ElementsAre(HasSubstr("states 'um'")));
  EXPECT_THAT(Read("file,z_um\na.png,2\n", WithUnit("um")).notices, IsEmpty());
}

TEST(ReadingsTable, UnitsThatAreRefused) {
  EXPECT_THAT(
      Refusal("file,z [furlong/2]\na.png,2\n"),
      AllOf(StartsWith("bench/t.csv:2: column 2"), HasSubstr("'furlong/2'"), HasSubstr("--unit")));
  EXPECT_THAT(Refusal("a.png,2 mm\nb.png,3\n"),
              AllOf(StartsWith("bench/t.csv:2: "), HasSubstr("no unit"), HasSubstr("'mm'")));
  EXPECT_THAT(Refusal("a.png,2 mm\nb.png,3 um\n"), AllOf(HasSubstr("'um'"), HasSubstr("'mm'")));
  EXPECT_THAT(Refusal("file,z_um\na.png,2 mm\n"),
              AllOf(HasSubstr("states 'um'"), HasSubstr("'mm'"), HasSubstr("--unit")));
  EXPECT_TRUE(ReadingsOfTable("a.png,2\n", "t.csv", WithUnit("counts")).in_counts);
  EXPECT_FALSE(ReadingsOfTable("a.png,2\n", "t.csv", WithUnit("counts", 0.1)).in_counts);
  std::string why;
  EXPECT_FALSE(WithUnit("lens-dioptres").IsValid(&why));
  EXPECT_THAT(why, HasSubstr("infinity is in focus"));
  EXPECT_THAT(Refusal("file,z_um\na.png,2\n", WithUnit("", 0.1)),
              AllOf(HasSubstr("--reading-scale is for steps and counts"), HasSubstr("um")));
  EXPECT_THAT(Refusal("file,focus_dpt\na.png,0\n"), HasSubstr("0 is infinity"));
}

TEST(ReadingsTable, MoreUnitsOfHeaders) {
  const auto of_header = [](const std::string& name) {
    return ValuesOf("file," + name + "\na.png,2\n").at(0);
  };
  for (const char* name : {"z (mil)", "z_mil", "z [thou]", "z_thou", "z (mils, corrected)"})
    EXPECT_DOUBLE_EQ(of_header("\"" + std::string(name) + "\""), 0.0508) << name;
  for (const char* name : {"z (feet)", "z_ft", "Position / ft"})
    EXPECT_DOUBLE_EQ(of_header(name), 609.6) << name;
  for (const char* name : {"z (microm)", "z (mu m)", "z mu m", "z [$\\mu$m]", "z_um_corrected",
                           "z [um] (stage)", "z (stage) [um]", "z um (abs)"})
    EXPECT_DOUBLE_EQ(of_header(name), 0.002) << name;
  EXPECT_DOUBLE_EQ(of_header("z (angstrom)"), 2e-7);
  EXPECT_DOUBLE_EQ(of_header("z [\xC3\x85]"), 2e-7);
  EXPECT_DOUBLE_EQ(of_header("z (dm)"), 200);
  EXPECT_DOUBLE_EQ(of_header("z (pm)"), 2e-9);
  for (const char* name : {"z (stage)", "Position (Z)", "z absolute", "Z stage", "focus motor"})
    EXPECT_DOUBLE_EQ(of_header(name), 2) << name;
  for (const char* name :
       {"z (turns)", "z_rev", "z (encoder)", "z_encoder", "z (counts)", "z [revolutions]"}) {
    EXPECT_TRUE(ReadingsOfTable("file," + std::string(name) + "\na.png,2\n", "t.csv", {}).in_counts)
        << name;
  }
  for (const char* name :
       {"z (furlong)", "z_furlong", "z [1/10 mm]", "z (arb)", "z_10um", "z (')", "z (mm) (um)"}) {
    EXPECT_THAT(Refusal("file," + std::string(name) + "\na.png,2\n"), HasSubstr("--unit")) << name;
    EXPECT_THAT(ValuesOf("file," + std::string(name) + "\na.png,2\n", WithUnit("mm")),
                ElementsAre(2))
        << name;
  }
}

TEST(ReadingsTable, OtherWordsInHeadersAreNoUnits) {
  const auto header = [](const std::string& name) { return "file," + name + "\na.png,2\n"; };
  for (const char* name : {"reading mm (rounded)", "position_mm_bottom", "z in mm from front",
                           "Position [mm] (rounded)", "focus [mm] (Mitutoyo)",
                           "Position (mm) [left side]", "focus (Mitutoyo) [mm]"}) {
    EXPECT_THAT(ValuesOf(header(name)), ElementsAre(2)) << name;
    EXPECT_THAT(Read(header(name)).description, Not(HasSubstr("no unit is stated"))) << name;
  }
  EXPECT_THAT(ValuesOf(header("z_um_smoothed")), ElementsAre(0.002));
  for (const char* name : {"focus ring", "Micrometer reading", "z coarse", "zpos_b", "position ch1",
                           "Distance object", "position grob"}) {
    EXPECT_THAT(ValuesOf(header(name)), ElementsAre(2)) << name;
    EXPECT_THAT(Read(header(name)).description, HasSubstr("no unit is stated")) << name;
  }
  for (const char* name : {"z_km", "z_um2", "z mm per click2", "z [mm] (1/10)", "z (mm) (1/10 mm)"})
    EXPECT_NE(Refusal(header(name)), "(no error)") << name;
  for (const char* name : {"z_encoder_b", "z turns coarse"})
    EXPECT_TRUE(Read(header(name)).in_counts) << name;
}

TEST(ReadingsTable, FractionsAreNamed) {
  for (const char* text : {"11 1/2", "11-1/2 in", "1/2"}) {
    EXPECT_THAT(Refusal("file,z\na.png," + std::string(text) + "\n"),
                AllOf(StartsWith("bench/t.csv:2: "), HasSubstr("the fraction"), HasSubstr(text)))
        << text;
  }
}

TEST(ReadingsTable, UnitsInTheirOwnColumn) {
  for (const char* header :
       {"file,value,unit", "file,Position,Unit", "file,z,Einheit", "file,z,z unit"}) {
    EXPECT_THAT(ValuesOf(std::string(header) + "\na.png,290000,um\nb.png,290100,um\n"),
                ElementsAre(290, DoubleNear(290.1, 1e-9)))
        << header;
  }
  EXPECT_THAT(ValuesOf("a.png,290000,um\n"), ElementsAre(290));
  // It belongs to the numbers before it.
  EXPECT_THAT(ValuesOf("file,temperature,unit,z\na.png,20,C,3\n"), ElementsAre(3));
  EXPECT_THAT(Refusal("file,z,unit\na.png,1,um\nb.png,2,mm\n"), HasSubstr("one unit"));
  EXPECT_THAT(Refusal("file,z,unit\na.png,1,parsec\n"),
              AllOf(HasSubstr("'parsec'"), HasSubstr("column 3 'unit'"), HasSubstr("--unit")));
  EXPECT_THAT(Refusal("file,z_mm,unit\na.png,1,um\n"),
              AllOf(HasSubstr("'mm'"), HasSubstr("'um'"), HasSubstr("--unit")));
  EXPECT_THAT(Refusal("file,z,u\na.png,1,um\n"),
              AllOf(HasSubstr("column 3 'u'"), HasSubstr("--unit")));
  EXPECT_THAT(ValuesOf("file,z,unit\na.png,1,um\n", WithUnit("cm")), ElementsAre(10));
  // A unit may be a device.
  for (const char* table : {"file,unit,z\na.png,A,1\n", "file,lens unit,z\na.png,A,1\n",
                            "file,z,unit id\na.png,1,SN7\n", "unit,file,z\ncam A,a.png,1\n"})
    EXPECT_THAT(ValuesOf(table), ElementsAre(1)) << table;
  EXPECT_THAT(ValuesOf("file,unit,z\na.png,um,1\n"), ElementsAre(0.001));
  EXPECT_THAT(Refusal("file,unit,z\na.png,parsec,1\n"), HasSubstr("'parsec'"));
  EXPECT_THAT(Refusal("file,z,position unit\na.png,1,parsec\n"), HasSubstr("'parsec'"));
  EXPECT_THAT(Refusal("file,z,unit\na.png,1,volts\n"), HasSubstr("'volts'"));
}

TEST(ReadingsTable, UnitsInOtherLines) {
  for (const char* line : {"# unit: um", "# units = um", "% Unit um", "//unit: um", "Units,um",
                           "Unit: um", "# time unit: s; position unit: um"}) {
    const ReadingSet set = Read(std::string(line) + "\nfile,z\na.png,290000\n");
    EXPECT_THAT(Values(set), ElementsAre(290)) << line;
    EXPECT_THAT(set.description, HasSubstr("line 1")) << line;
  }
  EXPECT_THAT(ValuesOf("# unit: um\nfile,z_um\na.png,290000\n"), ElementsAre(290));
  for (const char* line :
       {"# All units in mm", "# units in mm", "# Einheiten in mm",
        "# units: z in mm, exposure in ms", "# units: mm, pitch = 4.5 um",
        "# units: mm; resolution 1 um", "# units: mm, millimeter", "Control unit in rack"}) {
    for (const char* name : {"z", "z [mm]"}) {
      EXPECT_THAT(ValuesOf(std::string(line) + "\nfile;" + name + "\na.png;290\n"),
                  ElementsAre(290))
          << line << " above " << name;
    }
  }
  EXPECT_THAT(ValuesOf("# units: x in um, z in mm\nfile,z_mm\na.png,2\n"), ElementsAre(2));
  EXPECT_THAT(Refusal("# units: x in um, z in mm\nfile,z\na.png,2\n"), HasSubstr("--unit"));
  EXPECT_THAT(Refusal("# unit: 0.1 mm\nfile,z\na.png,2\n"), HasSubstr("'0.1 mm'"));
  EXPECT_THAT(ValuesOf("# unit: in\nfile,z\na.png,2\n"), ElementsAre(50.8));
  EXPECT_THAT(ValuesOf("# unit of time: s\nfile,z\na.png,290\n"), ElementsAre(290));
  EXPECT_THAT(Refusal("# unit: um\nfile,z_mm\na.png,2\n"),
              AllOf(StartsWith("bench/t.csv:1: "), HasSubstr("'um'"), HasSubstr("'mm'"),
                    HasSubstr("--unit")));
  EXPECT_THAT(Refusal("# unit: um\nfile,z\na.png,2 mm\n"), HasSubstr("--unit"));
  EXPECT_THAT(Refusal("# unit: parsec\nfile,z\na.png,2\n"),
              AllOf(HasSubstr("'parsec'"), HasSubstr("--unit")));
  EXPECT_THAT(Refusal("# unit: um\n# unit: mm\nfile,z\na.png,2\n"),
              AllOf(StartsWith("bench/t.csv:2: "), HasSubstr("line 1")));
  EXPECT_THAT(ValuesOf("# unit: parsec\nfile,z\na.png,2\n", WithUnit("mm")), ElementsAre(2));
}

TEST(ReadingsTable, ACountOfRowsIsNoReading) {
  EXPECT_THAT(Refusal(" ,Label,Mean,StdDev\n1,a.png,120,4\n2,b.png,130,5\n"),
              AllOf(HasSubstr("only counts the rows"), HasSubstr("column 3 'Mean'"),
                    HasSubstr("--column")));
  for (const char* name : {"Frame", "Slice", "\"#\"", "z_slice", "Unnamed: 0"}) {
    EXPECT_THAT(
        Refusal(std::string(name) + ",file\n0,a.png\n1,b.png\n2,c.png\n"),
        AllOf(HasSubstr("only counts the rows"), HasSubstr("column 1 '"), HasSubstr("--column")))
        << name;
  }
  ReadingOptions options;
  options.column = "Frame";
  EXPECT_THAT(ValuesOf("Frame,file\n0,a.png\n1,b.png\n", options), ElementsAre(0, 1));
  EXPECT_THAT(ValuesOf("z,file\n0,a.png\n1,b.png\n"), ElementsAre(0, 1));
  // Readings in steps of 1 mm, and numbers that the options state to be readings.
  EXPECT_THAT(ValuesOf("file,\na.png,95\nb.png,96\nc.png,97\n"), ElementsAre(95, 96, 97));
  EXPECT_THAT(ValuesOf("file,line\na.png,1\nb.png,2\n", WithUnit("steps", 0.5)),
              ElementsAre(0.5, 1));
  EXPECT_THAT(ValuesOf("frame,z\n0,5\n1,7\n"), ElementsAre(5, 7));
}

TEST(ReadingsTable, DecimalMarks) {
  EXPECT_THAT(ValuesOf("a.png;95,5\nb.png;96\n"), ElementsAre(95.5, 96));
  EXPECT_THAT(ValuesOf("a.png;95,500\nb.png;96,000\n"), ElementsAre(95.5, 96));
  EXPECT_THAT(ValuesOf("a.png\t95,25\nb.png\t96,125\n"), ElementsAre(95.25, 96.125));
  EXPECT_THAT(ValuesOf("\"a.png\",\"95,5\"\n\"b.png\",\"96,0\"\n"), ElementsAre(95.5, 96));
  EXPECT_THAT(ValuesOf("a.png;1.234,5\nb.png;12.345.678,25\n"), ElementsAre(1234.5, 12345678.25));
  EXPECT_THAT(ValuesOf("a.png\t1,234.5\nb.png\t1,235\n"), ElementsAre(1234.5, 1235));
  EXPECT_THAT(ValuesOf("a.png;1'234.5\nb.png;1\xE2\x80\xAF"
                       "235.5\n"),
              ElementsAre(1234.5, 1235.5));
  EXPECT_THAT(ValuesOf("a.png\t\xE2\x88\x92"
                       "1,5e1\n"),
              ElementsAre(-15));
  const std::string either = "a.png\t1,234\nb.png\t1,235\n";
  EXPECT_THAT(Refusal(either), AllOf(StartsWith("bench/t.csv:1: "), HasSubstr("'1,234'"),
                                     HasSubstr("--decimal comma")));
  ReadingOptions options;
  options.decimal = "comma";
  EXPECT_THAT(ValuesOf(either, options), ElementsAre(1.234, 1.235));
  options.decimal = "point";
  EXPECT_THAT(ValuesOf(either, options), ElementsAre(1234, 1235));
  EXPECT_THAT(Refusal("a.png;95,5\nb.png;96.25\n"),
              AllOf(StartsWith("bench/t.csv:2: "), HasSubstr("'96.25'"), HasSubstr("'95,5'"),
                    HasSubstr("line 1")));
  EXPECT_THAT(Refusal("a.png;1.2,34.5\n"), HasSubstr("1.2,34.5"));
}

TEST(ReadingsTable, ADecimalCommaIsNoExtraColumn) {
  EXPECT_THAT(Refusal("file,reading\nf000.png,95,5\n"),
              AllOf(StartsWith("bench/t.csv:2: 3 cells in a table of 2 columns"),
                    HasSubstr("95,5 with a decimal comma"), HasSubstr("95.5")));
  // A number with a point is no fraction behind a decimal comma.
  EXPECT_THAT(Refusal("file,reading\nf000.png,95,21.5\n"),
              AllOf(HasSubstr("'21.5' in column 3"), HasSubstr("name it in the first line"),
                    Not(HasSubstr("decimal comma"))));
  EXPECT_THAT(
      Refusal("f000.png,95,5\nf001.png,96,0\n"),
      AllOf(HasSubstr("column 2, column 3"), HasSubstr("decimal comma"), HasSubstr("--column")));
  EXPECT_THAT(Refusal("f000.png,95.5,5\nf001.png,96.5,-1\n"),
              AllOf(HasSubstr("column 2, column 3"), Not(HasSubstr("decimal comma"))));
  // Text beyond the last column is not read, and empty cells are none.
  EXPECT_THAT(ValuesOf("file,reading\na.png,95,good\nb.png,96,,\n"), ElementsAre(95, 96));
}

TEST(ReadingsTable, AmbiguousColumnsAreNamed) {
  const std::string two = "file,target_z,actual_z\na.png,1,1.5\nb.png,2,2.5\n";
  EXPECT_THAT(Refusal(two),
              AllOf(StartsWith("bench/t.csv:1: "),
                    HasSubstr("column 2 'target_z', column 3 'actual_z'"), HasSubstr("--column")));
  ReadingOptions options;
  options.column = "actual_z";
  EXPECT_THAT(ValuesOf(two, options), ElementsAre(1.5, 2.5));
  options.column = "Target Z";
  EXPECT_THAT(ValuesOf(two, options), ElementsAre(1, 2));
  options.column = "3";
  EXPECT_THAT(ValuesOf(two, options), ElementsAre(1.5, 2.5));
  options.column = "4";
  EXPECT_THAT(Refusal(two, options),
              AllOf(HasSubstr("--column: the table has no column '4'"), HasSubstr("'actual_z'")));
  options.column = "file";
  EXPECT_THAT(Refusal(two, options), HasSubstr("has the files"));
  EXPECT_THAT(Refusal("file,t_s,mjd\na.png,1,2\n"),
              AllOf(HasSubstr("column 2 't_s', column 3 'mjd'"), HasSubstr("--column")));
  const std::string files = "raw,jpg,z\na.dng,a.jpg,1\nb.dng,b.jpg,2\n";
  EXPECT_THAT(Refusal(files),
              AllOf(HasSubstr("column 1 'raw', column 2 'jpg'"), HasSubstr("--file-column")));
  options = {};
  options.file_column = "jpg";
  EXPECT_EQ(Read(files, options).rows.at(1).file, "b.jpg");
  // One of two names of a file column says so.
  EXPECT_EQ(Read("file,mask,z\na.png,m.png,1\nb.png,n.png,2\n").rows.at(1).file, "b.png");
}

TEST(ReadingsTable, BrokenTablesNameLineColumnAndValue) {
  EXPECT_THAT(Refusal(""), HasSubstr("no row has"));
  EXPECT_THAT(Refusal("file,z\n"), HasSubstr("no row has"));
  EXPECT_THAT(Refusal("# nothing\n\n"), HasSubstr("no row has"));
  EXPECT_THAT(Refusal("file,t,z_mm\na.png,1,2\nb.png,1\n"),
              AllOf(StartsWith("bench/t.csv:3: 2 cells"), HasSubstr("column 3 'z_mm'")));
  EXPECT_THAT(Refusal("file,z\na.png,1\nb.png,nan\nc.png,3\n"),
              AllOf(StartsWith("bench/t.csv:3: "), HasSubstr("'nan'"), HasSubstr("column 2 'z'")));
  EXPECT_THAT(Refusal("file,z\na.png,1\nb.png,-inf\n"), HasSubstr("'-inf'"));
  EXPECT_THAT(Refusal("file,z\na.png,1\nb.png,1e31\n"),
              AllOf(StartsWith("bench/t.csv:3: "), HasSubstr("'1e31'")));
  EXPECT_THAT(Refusal("file,z\na.png,1\nb.png,1e999999\n"), StartsWith("bench/t.csv:3: "));
  EXPECT_THAT(Refusal("file,z\na.png,1\nb.png,\n"),
              AllOf(StartsWith("bench/t.csv:3: "), HasSubstr("found ''")));
  EXPECT_THAT(Refusal("file,z\na.png,1\n,2\n"), HasSubstr("the file is missing"));
  EXPECT_THAT(Refusal("file,z\na.png,1\nb.png,2\na.png,3\n"),
              AllOf(StartsWith("bench/t.csv:4: "), HasSubstr("'a.png'"), HasSubstr("line 2")));
  EXPECT_THAT(Refusal("file,z\na.png,1\n\"b.png,2\n"),
              AllOf(StartsWith("bench/t.csv:3: "), HasSubstr("CSV"), HasSubstr("quotation mark")));
  EXPECT_THAT(Refusal("file,z\na.png,--1\n"), HasSubstr("'--1'"));
  EXPECT_THAT(Refusal("file,z\na.png,1 parsec\n"),
              AllOf(HasSubstr("'parsec'"), HasSubstr("mm, um")));
}

TEST(ReadingsTable, BytesThatAreNoText) {
  EXPECT_THAT(Refusal(std::string("file,z\na.png,\0\n", 15)),
              AllOf(StartsWith("bench/t.csv:2: "), HasSubstr("NUL")));
  EXPECT_THAT(Refusal(std::string(4096, '\0')), HasSubstr("NUL"));
  EXPECT_THAT(Refusal("file,z\n\x01\xFF.png,1\n"), AllOf(HasSubstr("t.csv:2"), HasSubstr("0x01")));
  EXPECT_EQ(Read("file,z\n\x01.png,1\n").rows.at(0).file, "\x01.png");
  EXPECT_THAT(Refusal("PK\x03\x04\x14"), HasSubstr("workbook"));
  EXPECT_THAT(Refusal("\x89PNG\r\n\x1A\n"), HasSubstr("a PNG image"));
  EXPECT_THAT(Refusal(std::string("\xFF\xFE\0\0f\0\0\0", 8)), HasSubstr("UTF-32"));
  const std::string wide = Utf16("file\tz\na.png\t1\n", false, true);
  EXPECT_THAT(Refusal(wide.substr(0, wide.size() - 1)), HasSubstr("cut off"));
  EXPECT_THAT(Refusal(wide + "\x3D\xD8\n" + std::string(1, '\0')), HasSubstr("half a character"));
}

TEST(ReadingsTable, AMillionColumns) {
  std::string row = "a.png";
  for (int i = 0; i < 1'000'000; ++i) row += ",7";
  const std::string message = Refusal(row + "\n");
  EXPECT_THAT(message, AllOf(HasSubstr("999994 more"), HasSubstr("--column")));
  EXPECT_LT(message.size(), 400U);
  EXPECT_THAT(Refusal(std::string(20'000'000, ',')),
              StartsWith("bench/t.csv:1: more than 4000000 cells"));
}

TEST(ReadingsTable, LongCellsAreShortened) {
  const std::string big(1'000'000, '9');
  EXPECT_LT(Refusal("file,z\na.png,1\nb.png," + big + "\n").size(), 400U);
  EXPECT_LT(Refusal("file," + big + "\na.png,x\n").size(), 400U);
}

// A table is written in a random dialect and read back: the same files, and the same numbers.
TEST(ReadingsTable, EveryDialectIsReadBack) {
  std::mt19937 random(20261127);
  const auto draw = [&](int count) {
    return static_cast<int>(random() % static_cast<unsigned>(count));
  };
  const std::vector<char> separators = {',', ';', '\t', ' '};
  const std::vector<std::string> ends = {"\n", "\r\n", "\r"};
  const std::vector<std::pair<std::string, double>> units = {
      {"", 1}, {"mm", 1}, {"um", 1e-3}, {"\xC2\xB5m", 1e-3}, {"inch", 25.4}, {"cm", 10}};
  for (int round = 0; round < 2000; ++round) {
    const char separator = separators[static_cast<std::size_t>(draw(4))];
    const std::string& end = ends[static_cast<std::size_t>(draw(3))];
    const auto& [unit, mm] = units[static_cast<std::size_t>(draw(6))];
    const bool has_comma = draw(2) == 0;
    const bool is_quoted = draw(3) == 0 || (has_comma && separator == ',');
    const bool has_header = draw(3) > 0 || (!unit.empty());
    const int rows = 2 + draw(30);
    const int digits = 1 + draw(5);
    const int extra = has_header ? draw(3) : 0;  // further columns, on both sides
    const auto cell = [&](const std::string& text) {
      const bool needs = text.find(separator) != std::string::npos;
      return is_quoted || needs ? "\"" + text + "\"" : text;
    };
    const auto join = [&](const std::vector<std::string>& cells) {
      std::string line;
      for (const std::string& text : cells)
        line += (line.empty() ? "" : std::string(1, separator)) + cell(text);
      return line + end;
    };
    std::string text;
    if (draw(3) == 0) text += "# a comment" + end;
    if (has_header) {
      std::vector<std::string> names = {"file",
                                        unit.empty() ? "Position" : "Position [" + unit + "]"};
      if (extra > 0) names.insert(names.begin(), "no");
      if (extra > 1) names.emplace_back("t_s");
      text += join(names);
    }
    std::vector<double> expected;
    for (int i = 0; i < rows; ++i) {
      // At least one number shows the decimal mark beyond doubt.
      const double value = i == 0 ? 0.5 : (draw(2'000'000) - 1'000'000) / 977.0;
      char buffer[64];
      std::snprintf(buffer, sizeof(buffer), "%.*f", i == 0 ? 1 : digits, value);
      expected.push_back(std::atof(buffer) * mm);
      std::string number = buffer;
      if (has_comma) number.replace(number.find('.'), 1, ",");
      std::vector<std::string> cells = {"frame " + std::to_string(i) + ".png", number};
      if (extra > 0) cells.insert(cells.begin(), std::to_string(i));
      if (extra > 1) cells.push_back(std::to_string(i) + (has_comma ? "," : ".") + "25");
      text += join(cells);
    }
    const int encoding = draw(4);
    std::string bytes = text;
    if (encoding == 1) bytes = "\xEF\xBB\xBF" + text;
    const bool is_ascii = text.find('\xC2') == std::string::npos;
    if (encoding > 1 && is_ascii) bytes = Utf16(text, encoding == 2, draw(2) == 0);
    SCOPED_TRACE(text);
    ReadingSet set;
    ASSERT_NO_THROW(set = Read(bytes));
    ASSERT_THAT(set.rows, SizeIs(rows));
    for (int i = 0; i < rows; ++i) {
      const FileReading& row = set.rows[static_cast<std::size_t>(i)];
      EXPECT_EQ(row.file, "frame " + std::to_string(i) + ".png");
      ASSERT_DOUBLE_EQ(row.reading_mm, expected[static_cast<std::size_t>(i)]);
    }
  }
}

// Every cut of a table is read or refused in words.
TEST(ReadingsTable, CutOffAnywhere) {
  const std::string table =
      "\xEF\xBB\xBF# bench\nDatei;\"Position [\xC2\xB5m]\";t_s\n\"a \"\"1\"\".png\";1.234,5;7\n"
      "b.png;-3,25;8\n";
  for (std::size_t size = 0; size <= table.size(); ++size) {
    try {
      Read(table.substr(0, size));
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), StartsWith("bench/t.csv"));
    }
  }
}

TEST(ReadingOptions, AreChecked) {
  std::string why;
  EXPECT_TRUE(ReadingOptions{}.IsValid(&why));
  EXPECT_FALSE(WithUnit("furlong").IsValid(&why));
  EXPECT_THAT(why, AllOf(StartsWith("unit: "), HasSubstr("'furlong'")));
  EXPECT_FALSE(WithUnit("steps", std::nan("")).IsValid(&why));
  EXPECT_THAT(why, StartsWith("scale_mm: "));
  EXPECT_FALSE(WithUnit("steps", 0).IsValid(nullptr));
  EXPECT_FALSE(WithUnit("V").IsValid(nullptr));
  EXPECT_TRUE(WithUnit("V", 0.2).IsValid(nullptr));
  ReadingOptions options;
  options.name_pattern = "z{reading}{reading}";
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, StartsWith("name_pattern: "));
  options.name_pattern = "z{reading}";
  EXPECT_TRUE(options.IsValid(&why));
  options.source = "exif";
  EXPECT_FALSE(options.IsValid(&why));
  options = {};
  options.source = "tea leaves";
  EXPECT_FALSE(options.IsValid(&why));
  options = {};
  options.decimal = ";";
  EXPECT_FALSE(options.IsValid(&why));
}

// LensPosition is the name by which libcamera states dioptres; counts of a motor have it, too.
TEST(ReadingsTable, TakesLensPositionAsDioptresUnlessItIsCounts) {
  const ReadingSet dioptres =
      ReadingsOfTable("file,LensPosition\na.png,2.5\nb.png,4\nc.png,8\n", "t.csv", {});
  EXPECT_TRUE(dioptres.in_dioptres);
  EXPECT_EQ(dioptres.rows[0].reading_mm, 400);
  EXPECT_THAT(dioptres.description, ::testing::HasSubstr("dpt"));
  const ReadingSet counts =
      ReadingsOfTable("file,LensPosition\na.png,250\nb.png,400\nc.png,800\n", "t.csv", {});
  EXPECT_FALSE(counts.in_dioptres);
  EXPECT_EQ(counts.rows[0].reading_mm, 250);
  ReadingOptions in_mm;
  in_mm.unit = "mm";
  EXPECT_FALSE(
      ReadingsOfTable("file,LensPosition\na.png,2.5\nb.png,4\n", "t.csv", in_mm).in_dioptres);
}

}  // namespace
}  // namespace thicklens::model
