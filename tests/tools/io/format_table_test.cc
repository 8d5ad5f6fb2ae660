// The table of kinds in docs/file-formats.md says what the program does: each row is compared with
// files of that kind which other programs wrote, and with files that this one writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_library.h"

namespace thicklens::io {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

struct FormatRow {
  std::string kind, read, written;
};

// The rows of the first table below "## Images".
std::vector<FormatRow> FormatRows() {
  std::istringstream lines(
      ReadTextFile(std::string(THICKLENS_SOURCE_DIR) + "/docs/file-formats.md"));
  std::string line;
  while (std::getline(lines, line) && line != "| kind | read | written |") {
  }
  std::getline(lines, line);  // the rule below the header
  std::vector<FormatRow> rows;
  while (std::getline(lines, line) && !line.empty()) {
    std::vector<std::string> cells;
    std::istringstream cell_stream(line.substr(1));
    for (std::string cell; std::getline(cell_stream, cell, '|');) {
      const auto begin = cell.find_first_not_of(' ');
      const auto end = cell.find_last_not_of(' ');
      cells.push_back(begin == std::string::npos ? "" : cell.substr(begin, end - begin + 1));
    }
    if (cells.size() == 3) rows.push_back({cells[0], cells[1], cells[2]});
  }
  return rows;
}

// The kind of a row as DecodeImageFile names it.
std::string KindOfRow(const std::string& row) {
  if (row.rfind("PBM", 0) == 0) return "PNM";
  return row.substr(0, row.find_first_of(",:"));
}

// Files of a kind that are refused, each for a reason that the row of the kind states.
const std::map<std::string, std::string> kRefused = {
    {"cmyk.jpg", "CMYK"},           {"cmyk.tif", "CMYK"},          {"lab.tif", "Lab"},
    {"c64.tif", "complex numbers"}, {"i64.tif", "64-bit"},         {"imagej.tif", "ImageJ"},
    {"mosaic.tif", "mosaic"},       {"animated.webp", "animation"}};

TEST(FormatTable, NamesEveryKindThatIsRead) {
  std::vector<std::string> kinds;
  for (const FormatRow& row : FormatRows()) kinds.push_back(KindOfRow(row.kind));
  ASSERT_GE(kinds.size(), 12U);
  for (const ImageFileKind kind :
       {ImageFileKind::kPng, ImageFileKind::kTiff, ImageFileKind::kPnm, ImageFileKind::kPfm,
        ImageFileKind::kJpeg, ImageFileKind::kExr, ImageFileKind::kWebp, ImageFileKind::kHeif,
        ImageFileKind::kBmp, ImageFileKind::kDicom, ImageFileKind::kRaw}) {
    EXPECT_THAT(kinds, ::testing::Contains(NameOf(kind)));
  }
}

TEST(FormatTable, WhatTheRowsSayIsReadIsRead) {
  std::map<std::string, FormatRow> rows;
  for (const FormatRow& row : FormatRows()) rows[KindOfRow(row.kind)] = row;
  std::map<std::string, int> files_read;
  const std::string folder = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".md" || entry.path().extension() == ".py") continue;
    const std::string bytes = ReadWholeFile(entry.path().string());
    const auto kind = KindOfImage(bytes);
    ASSERT_TRUE(kind) << name;
    const auto row = rows.find(NameOf(*kind));
    ASSERT_NE(row, rows.end()) << name;
    ImageReading reading;
    const auto refused = kRefused.find(name);
    if (refused != kRefused.end()) {
      EXPECT_THAT(row->second.read, HasSubstr(refused->second)) << name;
      const std::string refusal = ErrorOf([&] { DecodeImageFile(bytes, name, reading); });
      if (HasImageLibrary()) {
        EXPECT_THAT(refusal, HasSubstr(refused->second)) << name;
      }
      continue;
    }
    try {
      EXPECT_FALSE(DecodeImageFile(bytes, name, reading).pixels.empty()) << name;
      ++files_read[NameOf(*kind)];
    } catch (const Error& error) {
      const std::string what = error.what();
      if (what.find("THICKLENS_WITH_GPL=OFF") != std::string::npos) continue;
      // Files of several pages are read once one is chosen; the first part of this file is deep.
      reading.page = name == "deep_and_z.exr" ? 1 : 0;
      EXPECT_FALSE(DecodeImageFile(bytes, name, reading).pixels.empty()) << name << ": " << what;
      ++files_read[NameOf(*kind)];
    }
  }
  for (const auto& [kind, row] : rows) {
    if (row.read.rfind("refused by name", 0) == 0) continue;
    if (row.read.rfind("as sweeps only", 0) == 0) continue;
    const bool is_own =
        kind == "PNG" || kind == "TIFF" || kind == "PNM" || kind == "PFM" || kind == "JPEG";
    if (HasImageLibrary() || is_own) {
      EXPECT_GE(files_read[kind], 1) << kind;
    } else {
      EXPECT_EQ(files_read[kind], 0) << kind;
    }
  }
}

TEST(FormatTable, WhatTheRowsSayIsWrittenIsWritten) {
  const std::map<std::string, std::string> endings = {
      {"PNG", ".png"},  {"TIFF", ".tif"},  {"PNM", ".ppm"},   {"PFM", ".pfm"},
      {"JPEG", ".jpg"}, {"EXR", ".exr"},   {"WebP", ".webp"}, {"HEIF", ".heic"},
      {"BMP", ".bmp"},  {"DICOM", ".dcm"}, {"raw", ".dng"}};
  for (const FormatRow& row : FormatRows()) {
    const auto ending = endings.find(KindOfRow(row.kind));
    if (ending == endings.end()) continue;
    std::string refusal;
    try {
      FormatOfName("image" + ending->second);
    } catch (const Error& error) {
      refusal = error.what();
    }
    if (row.written.empty()) {
      EXPECT_FALSE(refusal.empty()) << row.kind;
      continue;
    }
    if (!refusal.empty()) {
      EXPECT_FALSE(HasImageLibrary()) << row.kind << ": " << refusal;
      continue;
    }
    const ImageFormat format = FormatOfName("image" + ending->second);
    const bool has_floats = row.written.find("float") != std::string::npos || row.written == "both";
    EXPECT_EQ(HoldsFloats(format), has_floats) << row.kind;
    const cv::Mat image(5, 7, has_floats ? CV_32FC3 : CV_8UC3, cv::Scalar(1, 0, 1));
    const DecodedImage back = DecodeImageFile(EncodeImageFile(image, format), "memory");
    EXPECT_EQ(back.facts.file_kind, KindOfRow(row.kind));
    EXPECT_EQ(back.pixels.size(), image.size());
    if (row.written.find("16 bits") != std::string::npos) {
      const cv::Mat deep(5, 7, CV_16UC3, cv::Scalar(40000, 1, 2));
      EXPECT_EQ(DecodeImageFile(EncodeImageFile(deep, format), "memory").pixels.type(), CV_16UC3);
    }
  }
}

// The first bytes of kinds that are no photographs here.
TEST(FormatTable, WhatTheRowsSayIsRefusedByNameIsNamed) {
  using namespace std::string_literals;
  const std::map<std::string, std::vector<std::string>> starts = {
      {"GIF", {"GIF89a"}},
      {"PSD", {"8BPS"}},
      {"JPEG 2000", {"\0\0\0\x0CjP  "s, "\xFF\x4F\xFF\x51"}},
      {"JPEG XL", {"\xFF\x0A", "\0\0\0\x0CJXL "s}},
      {"Radiance HDR", {"#?RADIANCE"}},
      {"DPX", {"SDPX"}},
      {"FITS", {"SIMPLE  =                    T"}},
      {"PDF", {"%PDF-1.5"}},
      {"NPY", {"\x93NUMPY"}},
      {"MAT", {"MATLAB 5.0 MAT-file"}},
      {"HDF5", {"\x89HDF\r\n"}}};
  std::vector<FormatRow> rows = FormatRows();
  const auto row = std::find_if(rows.begin(), rows.end(), [](const FormatRow& candidate) {
    return candidate.read.rfind("refused by name", 0) == 0;
  });
  ASSERT_NE(row, rows.end());
  for (const auto& [kind, beginnings] : starts) {
    EXPECT_THAT(row->kind, HasSubstr(kind));
    for (const std::string& bytes : beginnings) {
      EXPECT_THAT(ErrorOf([&] { DecodeImageFile(bytes, "f"); }), HasSubstr(kind)) << kind;
    }
  }
}

// A video is a sweep and no photograph; the tests of videos read them.
TEST(FormatTable, AVideoIsNoPhotograph) {
  const std::string folder = std::string(THICKLENS_SOURCE_DIR) + "/tests/data/video/";
  for (const char* name : {"constant.mp4", "colours.mkv", "ten_bits.webm", "motion_jpeg.avi"}) {
    const std::string bytes = ReadWholeFile(folder + name);
    EXPECT_FALSE(KindOfImage(bytes)) << name;
    EXPECT_THAT(ErrorOf([&] { DecodeImageFile(bytes, "f"); }), HasSubstr("video")) << name;
  }
}

}  // namespace
}  // namespace thicklens::io
