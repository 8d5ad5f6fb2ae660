// Readings in JSON, in the metadata of images, and in OME-XML, in the layouts of the programs that
// write them.
#include "thicklens/io/readings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

class Readings : public ::testing::Test {
 protected:
  model::ReadingSet Table(const std::string& name, const std::string& text) {
    return ReadReadings(folder_.Put(name, text), {}, options_);
  }
  std::string Refusal(const std::string& name, const std::string& text) {
    return ErrorOf([&] { Table(name, text); });
  }
  static std::vector<double> Values(const model::ReadingSet& set) {
    std::vector<double> values;
    for (const model::FileReading& row : set.rows) values.push_back(row.reading_mm);
    return values;
  }

  TemporaryFolder folder_;
  model::ReadingOptions options_;
};

// Micro-Manager 1.4, "save as separate image files".
constexpr char kMicroManager[] = R"({
"Summary": {"Slices": 2, "z-step_um": -1, "MicroManagerVersion": "1.4.13", "PixelSize_um": 1},
"FrameKey-0-0-0": {
  "Core-Focus": "Z", "SlicePosition": 1, "Exposure-ms": 10, "PixelSizeUm": 1, "Width": 512,
  "XPositionUm": 4, "YPositionUm": 5, "ZPositionUm": 1000.5, "ElapsedTime-ms": 503,
  "FileName": "img_000000000_Cy5_000.tif"},
"FrameKey-0-0-1": {
  "SlicePosition": 0, "ZPositionUm": 999.5, "FileName": "img_000000000_Cy5_001.tif"}
})";

TEST_F(Readings, OfMicroManager) {
  const model::ReadingSet set = Table("metadata.txt", kMicroManager);
  EXPECT_THAT(Values(set), ElementsAre(DoubleEq(1.0005), DoubleEq(0.9995)));
  EXPECT_EQ(set.rows[1].file, "img_000000000_Cy5_001.tif");
  EXPECT_EQ(set.description, "'ZPositionUm' of metadata.txt, um, 2 files");
  EXPECT_EQ(set.folder, folder_.path());
  // Micro-Manager 2.0 has the path in the key.
  const model::ReadingSet two = Table("metadata.txt", R"({"Summary": {},
    "Coords-Default/img_channel000_position000_time000000000_z000.tif": {"z": 0},
    "Metadata-Default/img_channel000_position000_time000000000_z000.tif": {"ZPositionUm": -3},
    "Coords-Default/img_channel000_position000_time000000000_z001.tif": {"z": 1},
    "Metadata-Default/img_channel000_position000_time000000000_z001.tif": {"ZPositionUm": -2}})");
  EXPECT_THAT(Values(two), ElementsAre(DoubleEq(-0.003), DoubleEq(-0.002)));
  EXPECT_EQ(two.rows[1].file, "Default/img_channel000_position000_time000000000_z001.tif");
}

TEST_F(Readings, OfMicroManagerThatAreBroken) {
  const std::string whole = kMicroManager;
  // The last brace is missing after an aborted acquisition; less than that is refused.
  const model::ReadingSet aborted = Table("m.txt", whole.substr(0, whole.size() - 2));
  EXPECT_THAT(aborted.rows, SizeIs(2));
  EXPECT_THAT(aborted.notices, ElementsAre(HasSubstr("last brace")));
  EXPECT_THAT(Refusal("m.txt", whole.substr(0, 300)),
              AllOf(HasSubstr("m.txt:"), HasSubstr("not valid JSON")));
  EXPECT_THAT(Refusal("m.txt", R"({"FrameKey-0-0-0": {"ZPositionUm": 1}})"),
              HasSubstr("'FrameKey-0-0-0': the text 'FileName' is missing"));
  EXPECT_THAT(Refusal("m.txt", R"({"FrameKey-0-0-0": {"FileName": "a.tif", "ZPositionUm": 1},
                                   "FrameKey-0-0-1": {"FileName": "b.tif"}})"),
              HasSubstr("'FrameKey-0-0-1': the number 'ZPositionUm' is missing"));
  EXPECT_THAT(Refusal("m.txt", R"({"FrameKey-0-0-0": {"FileName": "s.ome.tif", "ZPositionUm": 1},
                                   "FrameKey-0-0-1": {"FileName": "s.ome.tif", "ZPositionUm": 2}})"),
              AllOf(HasSubstr("'s.ome.tif' already has a reading"), HasSubstr("pages")));
  EXPECT_THAT(Refusal("m.txt", R"({"FrameKey-0-0-0": {"FileName": "a.tif", "ZPositionUm": 7},
                                   "FrameKey-0-0-1": {"FileName": "b.tif", "ZPositionUm": 7}})"),
              AllOf(HasSubstr("the same in all 2 files"), HasSubstr("--readings")));
  EXPECT_THAT(Refusal("m.txt", R"({"FrameKey-0-0-0": {"FileName": "a.tif", "ZPositionUm": 1e99}})"),
              HasSubstr("at most 1e30"));
  EXPECT_THAT(Refusal("m.txt", R"({"FrameKey-0-0-0": {"FileName": "a.tif", "ZPositionUm": NaN}})"),
              HasSubstr("not valid JSON"));
  EXPECT_THAT(Refusal("m.txt", "{\n\"z\": 21e308}"),
              AllOf(HasSubstr("m.txt:2: not valid JSON"), HasSubstr("21e308")));
  EXPECT_THAT(Refusal("m.txt", std::string(100000, '[')), HasSubstr("not valid JSON"));
  EXPECT_THAT(Refusal("m.txt", std::string("{\0}", 3)), HasSubstr("not valid JSON"));
}

// pymmcore-plus, ImageSequenceWriter: _frame_metadata.json and the plan beside it.
TEST_F(Readings, OfAnMdaTable) {
  const auto frame = [](const std::string& z) {
    return R"({"format": "frame-dict", "version": "1.0", "pixel_size_um": 0.5, "exposure_ms": 10,
               "position": {"x": 1, "y": 2, "z": )" +
           z + R"(},
               "mda_event": {"index": {"z": 0}, "z_pos": 77}, "runner_time_ms": 12.5})";
  };
  const model::ReadingSet set =
      Table("_frame_metadata.json", "{\"00000_t0000_z000.tif\": " + frame("10.5") +
                                        ", \"00001_t0000_z001.tif\": " + frame("12.5") + "}");
  EXPECT_THAT(Values(set), ElementsAre(DoubleEq(0.0105), DoubleEq(0.0125)));
  EXPECT_THAT(set.description, StartsWith("'position.z'"));
  options_.column = "mda_event.z_pos";
  EXPECT_THAT(Values(Table("m.json", "{\"a.tif\": " + frame("1") + "}")),
              ElementsAre(DoubleEq(0.077)));
  options_ = {};
  EXPECT_THAT(
      Refusal("_useq_MDASequence.json", R"({"axis_order": "tpgcz", "z_plan": {"range": 4}})"),
      AllOf(HasSubstr("the plan of an acquisition"), HasSubstr("_frame_metadata.json")));
  EXPECT_THAT(Refusal("events.json", R"([{"index": {"z": 0}, "z_pos": 3}])"),
              AllOf(HasSubstr("element 1"), HasSubstr("a plan")));
}

TEST_F(Readings, OfAListOfObjects) {
  EXPECT_THAT(Values(Table("l.json", R"([{"image": "a.png", "z_um": 5, "t_s": 1},
                                         {"image": "b.png", "z_um": 6, "t_s": 2}])")),
              ElementsAre(DoubleEq(0.005), DoubleEq(0.006)));
  const std::string two = R"([{"file": "a.png", "target": {"z": 1}, "actual": {"z": 1.5}}])";
  EXPECT_THAT(Refusal("l.json", two),
              AllOf(HasSubstr("'actual.z', 'target.z'"), HasSubstr("--column")));
  options_.column = "actual.z";
  EXPECT_THAT(Values(Table("l.json", two)), ElementsAre(1.5));
  options_.column = "z";
  EXPECT_THAT(Refusal("l.json", two), AllOf(HasSubstr("--column"), HasSubstr("'actual.z'")));
  options_ = {};
  EXPECT_THAT(Refusal("l.json", R"([{"z": 1}])"), HasSubstr("no text names the file"));
  EXPECT_THAT(Refusal("l.json", "[1]"), HasSubstr("an object with a file"));
  EXPECT_THAT(Refusal("l.json", "[]"), HasSubstr("no frame"));
  EXPECT_THAT(Refusal("l.json", R"([{"file": "a.png", "gain": 1}])"),
              AllOf(HasSubstr("no number is named as a position"), HasSubstr("'gain'")));
}

TEST_F(Readings, OtherLayoutsOfJson) {
  const auto expected = ElementsAre(DoubleEq(0.005), DoubleEq(0.006));
  EXPECT_THAT(Values(Table("l.json",
                           "{\"file\": \"a.png\", \"z_um\": 5}\n"
                           "{\"file\": \"b.png\", \"z_um\": 6}\n")),
              expected);
  EXPECT_THAT(Values(Table("l.json", R"({"lens": "x", "frames": [{"file": "a.png", "z_um": 5},
                                                                 {"file": "b.png", "z_um": 6}]})")),
              expected);
  EXPECT_THAT(Values(Table("l.json", R"({"a.png": 5, "b.png": 6, "unit": "um"})")), expected);
  EXPECT_THAT(Refusal("l.json", R"([{"file": "a.png", "z_um": "5,5"}])"),
              AllOf(HasSubstr("'z_um' is the text"), HasSubstr("5,5")));
}

// Objects of JSON have no order: the numbers in their names give it.
TEST_F(Readings, FramesOfObjectsAreInTheOrderOfTheirNumbers) {
  std::string text = "{";
  for (const int i : {9, 10, 11, 100}) {
    text += (text.size() > 1 ? ", " : "") + std::string("\"FrameKey-0-0-") + std::to_string(i) +
            "\": {\"FileName\": \"a" + std::to_string(i) +
            ".tif\", \"ZPositionUm\": " + std::to_string(i) + "}";
  }
  EXPECT_THAT(Values(Table("metadata.txt", text + "}")),
              ElementsAre(DoubleEq(0.009), DoubleEq(0.01), DoubleEq(0.011), DoubleEq(0.1)));
  EXPECT_THAT(Values(Table("l.json", R"({"z10.png": 3, "z9.png": 2})")), ElementsAre(2, 3));
}

TEST_F(Readings, UnitsBesideTheNumbersOfJson) {
  EXPECT_THAT(Values(Table("l.json", R"([{"file": "a.png", "z": 290000, "unit": "um"},
                                         {"file": "b.png", "z": 290100, "unit": "microns"}])")),
              ElementsAre(DoubleEq(290), DoubleEq(290.1)));
  EXPECT_THAT(Values(Table("l.json", R"([{"file": "a.png", "z": 2, "z_unit": "cm"}])")),
              ElementsAre(DoubleEq(20)));
  EXPECT_THAT(Values(Table("l.json", R"({"unit": "um", "a.png": {"z": 5}, "b.png": {"z": 6}})")),
              ElementsAre(DoubleEq(0.005), DoubleEq(0.006)));
  EXPECT_THAT(Refusal("l.json", R"([{"file": "a.png", "z_mm": 2, "unit": "um"}])"),
              AllOf(HasSubstr("'um'"), HasSubstr("mm"), HasSubstr("--unit")));
  EXPECT_THAT(Refusal("l.json", R"([{"file": "a.png", "z": 2, "unit": "um"},
                                    {"file": "b.png", "z": 3, "unit": "mm"}])"),
              AllOf(HasSubstr("'mm'"), HasSubstr("um"), HasSubstr("--unit")));
  EXPECT_THAT(Refusal("l.json", R"([{"file": "a.png", "z": 2, "unit": "parsec"}])"),
              AllOf(HasSubstr("'parsec'"), HasSubstr("--unit")));
  // The unit of another number.
  EXPECT_THAT(Values(Table("l.json", R"([{"file": "a.png", "z_mm": 95.5, "exposure": 10,
                                          "unit": "ms"}])")),
              ElementsAre(95.5));
  EXPECT_THAT(Refusal("l.json", R"([{"file": "a.png", "z": 95.5, "unit": "ms"}])"),
              HasSubstr("--unit"));
  EXPECT_THAT(Values(Table("l.json", R"({"f/2.8": 1, "frames": [{"file": "a.png", "z": 5}]})")),
              ElementsAre(5));
}

TEST_F(Readings, OfTextAsBefore) {
  EXPECT_THAT(Values(Table("t.csv", "file,z\na.png,1\nb.png,2\n")), ElementsAre(1, 2));
  options_.name_pattern = "z{reading}um";
  EXPECT_THAT(Values(ReadReadings("", {"z1um.png", "z3um.png"}, options_)),
              ElementsAre(0.001, 0.003));
}

// rpicam-still --metadata and picamera2: the controls of libcamera; LensPosition is in dioptres.
TEST_F(Readings, OfSidecarsOfAPiCamera) {
  const auto metadata = [](const std::string& lens) {
    return R"({"SensorTimestamp": 1154038080000, "ScalerCrop": [108, 440, 3840, 2160],
               "FocusFoM": 818, "ExposureTime": 32987, "LensPosition": )" +
           lens +
           R"(, "SensorTemperature": 0.0, "ColourGains": [3.0, 1.5], "Lux": 26.4, "AfState": 0})";
  };
  options_.source = "sidecar";
  folder_.Put("a.jpg.json", metadata("10.0"));
  folder_.Put("b.json", metadata("8.0"));
  folder_.Put("c_metadata.json", "[" + metadata("5") + "]");
  const std::vector<std::string> files = {folder_ / "a.jpg", folder_ / "b.jpg", folder_ / "c.jpg"};
  const model::ReadingSet set = ReadReadings("", files, options_);
  EXPECT_THAT(Values(set), ElementsAre(100, 125, 200));
  EXPECT_EQ(set.rows[1].file, folder_ / "b.jpg");
  EXPECT_EQ(set.description, "'LensPosition' of the JSON files beside the images, dpt, 3 files");
  EXPECT_THAT(set.notices, ElementsAre(HasSubstr("not the position of the target")));
  const auto refusal = [&] { return ErrorOf([&] { ReadReadings("", files, options_); }); };
  folder_.Put("b.json", metadata("0.0"));
  EXPECT_THAT(refusal(), AllOf(StartsWith(folder_ / "b.json"), HasSubstr("0 is infinity")));
  folder_.Put("b.json", metadata("null"));
  EXPECT_THAT(refusal(), AllOf(StartsWith(folder_ / "b.json"), HasSubstr("'LensPosition'")));
  folder_.Put("b.json", "");
  EXPECT_THAT(refusal(), HasSubstr("not valid JSON"));
  EXPECT_THAT(ErrorOf([&] { ReadReadings("", {folder_ / "d.jpg"}, options_); }),
              AllOf(StartsWith(folder_ / "d.jpg: no JSON file"), HasSubstr("d.json")));
  EXPECT_THAT(ErrorOf([&] { ReadReadings("", {}, options_); }), HasSubstr("no image"));
}

class MetadataReadings : public Readings {
 protected:
  MetadataReadings() { options_.source = "exif"; }

  std::string Photo(const std::string& name, const Exiv2::ExifData& exif,
                    const Exiv2::XmpData& xmp = {}) {
    const std::string path = folder_ / name;
    cv::imwrite(path, cv::Mat(8, 8, CV_8UC1, cv::Scalar(100)));
    const auto image = Exiv2::ImageFactory::open(path);
    image->setExifData(exif);
    image->setXmpData(xmp);
    image->writeMetadata();
    return path;
  }
  std::string Distance(const std::string& name, int numerator, int denominator) {
    Exiv2::ExifData exif;
    exif["Exif.Photo.SubjectDistance"] = Exiv2::URational(static_cast<std::uint32_t>(numerator),
                                                          static_cast<std::uint32_t>(denominator));
    return Photo(name, exif);
  }
};

TEST_F(MetadataReadings, OfExif) {
  const model::ReadingSet set =
      ReadReadings("", {Distance("a.jpg", 1, 4), Distance("b.jpg", 3, 10)}, options_);
  EXPECT_THAT(Values(set), ElementsAre(DoubleEq(250), DoubleEq(300)));
  EXPECT_EQ(set.description, "Exif.Photo.SubjectDistance, m, 2 files");
  EXPECT_THAT(set.notices, SizeIs(1));
  // Infinity, an unknown distance, none, and the same in all.
  for (const std::string& file :
       {Distance("c.jpg", -1, 1), Distance("c.jpg", 1, 0), Photo("c.jpg", {})}) {
    EXPECT_THAT(ErrorOf([&] { ReadReadings("", {file}, options_); }),
                AllOf(StartsWith(file), HasSubstr("no finite focus distance")));
    EXPECT_THAT(
        ErrorOf([&] {
          ReadReadings("", {folder_ / "a.jpg", file}, options_);
        }),
        AllOf(StartsWith(file), HasSubstr("Exif.Photo.SubjectDistance has no finite number")));
  }
  EXPECT_THAT(ErrorOf([&] {
                ReadReadings("", {folder_ / "a.jpg", Distance("d.jpg", 1, 4)}, options_);
              }),
              HasSubstr("the same in all 2 files"));
  const std::string text = folder_.Put("e.jpg", "no image");
  EXPECT_THAT(ErrorOf([&] { ReadReadings("", {text}, options_); }),
              AllOf(StartsWith(text), HasSubstr("cannot be read")));
}

TEST_F(MetadataReadings, OfXmp) {
  Exiv2::XmpData xmp;
  xmp["Xmp.aux.ApproximateFocusDistance"] = "45/100";  // as Lightroom writes it
  EXPECT_THAT(Values(ReadReadings("", {Photo("a.jpg", {}, xmp)}, options_)),
              ElementsAre(DoubleEq(450)));
  Exiv2::XmpProperties::registerNs("http://example.org/bench/", "bench");
  Exiv2::XmpData own;
  own["Xmp.bench.LensPosition"] = "2.5";
  own["Xmp.bench.Rail"] = "17.25";
  const std::string photo = Photo("b.jpg", {}, own);
  EXPECT_THAT(Values(ReadReadings("", {photo}, options_)), ElementsAre(DoubleEq(400)));
  options_.column = "Xmp.bench.Rail";
  EXPECT_THAT(Values(ReadReadings("", {photo}, options_)), ElementsAre(17.25));
  options_.column = "Xmp.bench.Height";
  EXPECT_THAT(ErrorOf([&] { ReadReadings("", {photo}, options_); }),
              HasSubstr("--column: EXIF and XMP have no number 'Xmp.bench.Height'"));
}

// The XML of Bio-Formats, schema 2016-06.
std::string Ome(const std::string& pixels, const std::string& inside) {
  return R"(<?xml version="1.0" encoding="UTF-8"?>
<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" Creator="OME Bio-Formats 6.6.0">
<Image ID="Image:0" Name="sweep"><Pixels BigEndian="false" DimensionOrder="XYCZT" ID="Pixels:0"
 SizeC="1" SizeT="1" SizeX="512" SizeY="512" Type="uint16" )" +
         pixels + "><Channel ID=\"Channel:0:0\" SamplesPerPixel=\"1\"/>" + inside +
         "</Pixels></Image></OME>";
}

class OmeReadings : public Readings {
 protected:
  std::vector<double> Pages(const std::string& xml) {
    std::vector<double> values;
    for (const PageReading& page : ReadingsOfOmeXml(xml, "s.ome.tif", options_).pages)
      values.push_back(page.reading_mm);
    return values;
  }
  std::string OmeRefusal(const std::string& xml) {
    return ErrorOf([&] { Pages(xml); });
  }
};

TEST_F(OmeReadings, PositionsOfThePlanes) {
  const std::string planes =
      R"(<TiffData FirstC="0" FirstT="0" FirstZ="0" IFD="1" PlaneCount="1"/>
         <TiffData FirstC="0" FirstT="0" FirstZ="1" IFD="0" PlaneCount="1"/>
         <Plane TheZ="0" TheC="0" TheT="0" PositionZ="-254.5" PositionZUnit="&#181;m"/>
         <Plane TheZ="1" TheC="0" TheT="0" PositionZ="-254.0" PositionZUnit="&#181;m"/>)";
  const PageReadings readings =
      ReadingsOfOmeXml(Ome("SizeZ=\"2\" PhysicalSizeZ=\"0.4\"", planes), "s.ome.tif", options_);
  ASSERT_THAT(readings.pages, SizeIs(2));
  EXPECT_EQ(readings.pages[0].slice, 1);
  EXPECT_DOUBLE_EQ(readings.pages[0].reading_mm, -0.254);
  EXPECT_DOUBLE_EQ(readings.pages[1].reading_mm, -0.2545);
  EXPECT_EQ(readings.description, "PositionZ, um");
  // Abberior: a prefix of the name space, metres.
  EXPECT_THAT(Pages(R"(<ome:OME xmlns:ome="http://www.openmicroscopy.org/Schemas/OME/2016-06">
      <ome:Image ID="Image:2"><ome:Pixels DimensionOrder="XYZTC" SizeZ="1" SizeC="1" SizeT="1">
      <ome:Plane PositionZ="3.8e-05" PositionZUnit="m" TheC="0" TheT="0" TheZ="0"/>
      </ome:Pixels></ome:Image></ome:OME>)"),
              ElementsAre(DoubleEq(0.038)));
}

TEST_F(OmeReadings, SpacingOfTheSlices) {
  EXPECT_THAT(Pages(Ome("SizeZ=\"3\" PhysicalSizeZ=\"2.5\"", "<TiffData/>")),
              ElementsAre(0, DoubleEq(0.0025), DoubleEq(0.005)));
  EXPECT_THAT(Pages(Ome("SizeZ=\"2\" PhysicalSizeZ=\"0.5\" PhysicalSizeZUnit=\"mm\"", "")),
              ElementsAre(0, 0.5));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"2\" PhysicalSizeZ=\"1\" PhysicalSizeZUnit=\"pixel\"", "")),
              AllOf(HasSubstr("'pixel'"), HasSubstr("--unit")));
  // Channels change before slices, as the order says.
  const PageReadings two = ReadingsOfOmeXml(
      R"(<OME><Image><Pixels DimensionOrder="XYCZT" SizeZ="2" SizeC="2" SizeT="1" PhysicalSizeZ="1"/>
         </Image></OME>)",
      "s.ome.tif", options_);
  ASSERT_THAT(two.pages, SizeIs(4));
  EXPECT_EQ(two.pages[1].channel, 1);
  EXPECT_EQ(two.pages[1].slice, 0);
  EXPECT_EQ(two.pages[2].slice, 1);
  EXPECT_EQ(two.pages[3].page, 3);
}

TEST_F(OmeReadings, WhatIsRefused) {
  const std::string plane = R"(<Plane TheZ="0" TheC="0" TheT="0" PositionZ="1"/>)";
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"1\"", plane)),
              AllOf(HasSubstr("PositionZ has no unit"), HasSubstr("--unit")));
  options_.unit = "um";
  EXPECT_THAT(Pages(Ome("SizeZ=\"1\"", plane)), ElementsAre(0.001));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"2\"", plane)), HasSubstr("z=1 c=0 t=0 has no PositionZ"));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"2\"", "")), HasSubstr("neither"));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"-2\"", "")), AllOf(HasSubstr("SizeZ"), HasSubstr("'-2'")));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"999999999999\"", "")), HasSubstr("SizeZ"));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"1000000\" PhysicalSizeZ=\"nan\"", "")),
              AllOf(HasSubstr("PhysicalSizeZ"), HasSubstr("'nan'")));
  EXPECT_THAT(OmeRefusal(Ome("SizeZ=\"1\" PhysicalSizeZ=\"1\"", "<TiffData FirstZ=\"5\"/>")),
              HasSubstr("outside of the stated size"));
  EXPECT_THAT(
      OmeRefusal(Ome("SizeZ=\"2\" PhysicalSizeZ=\"1\"",
                     "<TiffData IFD=\"0\" FirstZ=\"0\"/><TiffData IFD=\"0\" FirstZ=\"1\"/>")),
      HasSubstr("page 0 of '' is stated to be two planes"));
  const std::string whole = Ome("SizeZ=\"1\"", plane);
  for (std::size_t size = 0; size + 1 < whole.size(); size += 7) {
    EXPECT_THAT(OmeRefusal(whole.substr(0, size)), StartsWith("s.ome.tif: ")) << size;
  }
  EXPECT_THAT(OmeRefusal("<html/>"), HasSubstr("no element OME"));
  EXPECT_THAT(OmeRefusal("<OME/>"), HasSubstr("0 images"));
  EXPECT_THAT(OmeRefusal(R"(<OME><BinaryOnly MetadataFile="m.companion.ome" UUID="x"/></OME>)"),
              AllOf(HasSubstr("'m.companion.ome'"), HasSubstr("--readings")));
  EXPECT_THAT(OmeRefusal("<!DOCTYPE x [<!ENTITY a \"b\">]><OME/>"), HasSubstr("entities"));
}

TEST_F(OmeReadings, CompanionFile) {
  const auto page = [](int z, const std::string& file) {
    return "<TiffData FirstZ=\"" + std::to_string(z) +
           "\" FirstC=\"0\" FirstT=\"0\" IFD=\"0\" PlaneCount=\"1\"><UUID FileName=\"" + file +
           "\">urn:uuid:d830ec74</UUID></TiffData>";
  };
  const std::string size = "SizeZ=\"2\" PhysicalSizeZ=\"2\" PhysicalSizeZUnit=\"mm\"";
  const model::ReadingSet set =
      Table("s.companion.ome", Ome(size, page(0, "z0.ome.tif") + page(1, "z1.ome.tif")));
  EXPECT_THAT(Values(set), ElementsAre(0, 2));
  EXPECT_EQ(set.rows[1].file, "z1.ome.tif");
  EXPECT_THAT(set.description, HasSubstr("PhysicalSizeZ times the slice, mm of s.companion.ome"));
  EXPECT_THAT(Refusal("s.companion.ome", Ome(size, "<TiffData/>")), HasSubstr("FileName"));
  EXPECT_THAT(
      Refusal("s.companion.ome",
              Ome(size, "<TiffData PlaneCount=\"2\"><UUID FileName=\"s.tif\"/></TiffData>")),
      HasSubstr("page 1 of 's.tif'"));
}

TEST_F(OmeReadings, OfFilesOfOnePageEach) {
  const auto frame = [&](const std::string& name, const std::string& z) {
    const std::string path = folder_ / name;
    cv::imwrite(path, cv::Mat(8, 8, CV_8UC1, cv::Scalar(100)));
    const auto image = Exiv2::ImageFactory::open(path);
    Exiv2::ExifData exif;
    image->readMetadata();
    exif = image->exifData();
    exif["Exif.Image.ImageDescription"] =
        Ome("SizeZ=\"1\"", "<Plane TheZ=\"0\" TheC=\"0\" TheT=\"0\" PositionZ=\"" + z +
                               "\" PositionZUnit=\"mm\"/>");
    image->setExifData(exif);
    image->writeMetadata();
    return path;
  };
  options_.source = "ome";
  const model::ReadingSet set =
      ReadReadings("", {frame("a.tif", "1.5"), frame("b.tif", "2.5")}, options_);
  EXPECT_THAT(Values(set), ElementsAre(1.5, 2.5));
  EXPECT_EQ(set.description, "PositionZ, mm in the OME-XML of 2 files");
  EXPECT_THAT(set.notices, IsEmpty());
  const std::string plain = folder_ / "c.tif";
  cv::imwrite(plain, cv::Mat(8, 8, CV_8UC1, cv::Scalar(100)));
  EXPECT_THAT(ErrorOf([&] { ReadReadings("", {plain}, options_); }),
              AllOf(StartsWith(plain), HasSubstr("no OME-XML")));
}

}  // namespace
}  // namespace thicklens::io
