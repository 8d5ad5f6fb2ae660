#include "fuzz/readers.h"

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <stdexcept>

#include "thicklens/base/error.h"
#include "thicklens/depth_fit.h"
#include "thicklens/io/block_checkpoint.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/exif.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/journal_file.h"
#include "thicklens/io/lens_distortion_file.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/io/readings.h"
#include "thicklens/io/video_file.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field_file.h"
#include "thicklens/model/psf_file.h"
#include "thicklens/model/readings.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/sweep_simulator.h"
#include "tools/io/image_library.h"
#include "tools/io/video/video_kind.h"
#include "tools/options/estimate_profile.h"
#include "tools/report/estimate_records.h"

namespace thicklens::testing {
namespace {

namespace fs = std::filesystem;

constexpr int kViews = 3;

// Reads a file of that name in the folder.
template <typename Read>
FuzzedReader OfFile(const std::string& reader, const std::string& name, Read read) {
  return {reader, [=](const std::string& bytes, const TemporaryFolder& folder) {
            read(folder.Put(name, bytes));
          }};
}

constexpr char kTiffLightField[] = R"(schema: thicklens/light-field/1
views: [1, 1]
size: [4, 3]
channels: 1
view_format: tiff
transfer: linear
disparity: px per view step, near positive
landing_step_px: [0, 0]
weights: [[1]]
origin: {method: simulated}
)";

constexpr char kCamera[] = R"(schema: thicklens/camera/2
name: 50 mm at f/2.8
lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, aperture_radius_mm: 8.9}
sensor: {width_px: 512, height_px: 512, pixel_pitch_mm: 0.0045, principal_point_px: [255.5, 255.5], transfer: linear}
psf: gaussian
)";

// Reads the file, and the same bytes as the content of records whose hashes are right.
void ReadCheckpoint(const std::string& bytes, const TemporaryFolder& folder) {
  const std::string records = folder / "records.blocks";
  fs::remove(records);
  {
    io::JournalFile journal(records, "thicklens-blocks/1");
    const std::size_t half = bytes.find('\n');
    journal.Append({bytes.substr(0, half)});
    journal.Append({half == std::string::npos ? "" : bytes.substr(half + 1)});
  }
  for (const std::string& path : {records, folder.Put("estimate.blocks", bytes)}) {
    io::BlockCheckpoint checkpoint(path, "a version");
    checkpoint.device();
    // The reader accepts a file from which something is missing; this function refuses it.
    const bool is_whole = checkpoint.block_px() && checkpoint.Find(0) && checkpoint.Find(1);
    if (path != records && !is_whole) throw Error(path + ": a block is missing");
  }
}

// A build without GPL parts only looks at the structure of the container.
void ReadVideo(const std::string& path) {
  if (io::HasImageLibrary()) {
    io::VideoFile(path).Survey();
    return;
  }
  const auto kind =
      io::KindOfVideo(thicklens::testing::ContentOf(path).substr(0, io::kVideoStart), path);
  if (!kind) throw Error(path + ": it is no video");
  io::RequireWholeVideo(path, *kind);
}

}  // namespace

const std::vector<FuzzedReader>& FuzzedReaders() {
  static const std::vector<FuzzedReader> readers = {
      OfFile("camera-yaml", "camera.yaml",
             [](const std::string& path) { model::ReadCamera(path); }),
      OfFile("psf-yaml", "psf.yaml", [](const std::string& path) { model::ReadPsf(path); }),
      OfFile("sweep-yaml", "sweep.yaml",
             [](const std::string& path) {
               std::vector<std::string> notices;
               model::SweepReading reading;
               reading.video_reader = [](const std::string&, std::vector<std::string>*) {
                 return std::vector<model::VideoFrame>{{0.0}, {0.5}, {1.0}};
               };
               model::ReadSweep(path, reading, &notices);
             }),
      OfFile("readings-csv", "frames/readings.csv",
             [](const std::string& path) {
               std::vector<std::string> notices;
               model::SweepFromFolder(fs::path(path).parent_path().string(), path, "", &notices);
             }),
      {"readings-text",
       [](const std::string& bytes, const TemporaryFolder&) {
         model::ReadingOptions options;
         options.scale_mm = 0.01;  // for steps and counts
         try {
           model::ReadingsOfTable(bytes, "table.csv", options);
         } catch (const Error&) {
           model::ReadingsOfTable(bytes, "table.csv", {});
         }
       }},
      OfFile("readings-json", "frames/metadata.txt",
             [](const std::string& path) { io::ReadReadings(path, {}, {}); }),
      {"readings-ome",
       [](const std::string& bytes, const TemporaryFolder&) {
         io::ReadingsOfOmeXml(bytes, "stack.ome.tif", {});
       }},
      {"readings-times",
       [](const std::string& bytes, const TemporaryFolder&) {
         model::HasTimes(bytes, "times.csv", {});
         model::TimedReadingsOfTable(bytes, "times.csv", {});
       }},
      OfFile("video", "sweep.mkv", ReadVideo),
      OfFile("sweep-truth-yaml", "truth.yaml",
             [](const std::string& path) { model::ReadSweepTruth(path); }),
      OfFile("sweep-simulation-yaml", "simulation.yaml",
             [](const std::string& path) { model::ReadSweepSimulation(path); }),
      OfFile("scene-yaml", "scene.yaml",
             [](const std::string& path) { model::ReadSceneSimulation(path); }),
      OfFile("light-field-yaml", "lightfield.yaml",
             [](const std::string& path) { model::ReadLightFieldDescription(path); }),
      OfFile("hci-cfg", "hci/parameters.cfg",
             [](const std::string& path) {
               io::ReadLightField(fs::path(path).parent_path().string(), {});
             }),
      OfFile("hci-view", "hci-view/input_Cam000.png",
             [](const std::string& path) {
               io::ReadLightField(fs::path(path).parent_path().string(), {});
             }),
      OfFile("view-tiff", "tiff/views/view_00_00.tiff",
             [](const std::string& path) {
               io::ReadLightField(fs::path(path).parent_path().parent_path().string(), {});
             }),
      OfFile("light-field-file", "light-field",
             [](const std::string& path) { io::ReadLightField(path, {}); }),
      OfFile("depth-map", "depth.pfm", [](const std::string& path) { io::ReadDepthMap(path); }),
      {"embedded-depth",
       [](const std::string& bytes, const TemporaryFolder&) {
         const io::EmbeddedDepthSearch found = io::FindEmbeddedDepth(bytes, "photo.jpg");
         if (found.depth) io::DepthsOf(*found.depth);
       }},
      {"image",
       [](const std::string& bytes, const TemporaryFolder&) {
         io::ToEncodedImage(io::DecodeImage(bytes, "picture.png"));
       }},
      {"image-file",
       [](const std::string& bytes, const TemporaryFolder&) {
         io::ImageReading reading;
         reading.orientation = io::ImageOrientation::kDisplayed;
         reading.raw = io::RawTreatment::kMosaicPlanes;
         reading.spread_bits = false;
         for (const io::DecodedImage& page : io::DecodeImagePages(bytes, "file", reading))
           page.facts.OneLine();
       }},
      OfFile("photo-exif", "photo.jpg",
             [](const std::string& path) { io::ReadPhotoExif(path, 640, 480); }),
      {"lens-distortion",
       [](const std::string& bytes, const TemporaryFolder&) {
         io::ParseLensDistortion(bytes, "calibration", "", 640, 480);
       }},
      OfFile("depth-camera", "depth-camera.yaml",
             [](const std::string& path) { ReadDepthCamera(path); }),
      {"block-checkpoint", ReadCheckpoint},
      OfFile("profile-json", "profile.json",
             [](const std::string& path) { tools::ReadProfile(path); }),
      OfFile("estimate-json", "estimate.json",
             [](const std::string& path) { tools::ReadEstimateRecord(path); }),
      OfFile("comparison-json", "comparison.json",
             [](const std::string& path) { tools::ReadComparisonRecord(path); }),
  };
  return readers;
}

void PrepareFuzzFolder(const TemporaryFolder& folder) {
  const model::EncodedImage grey{4, 3, 1, 8, std::vector<std::uint16_t>(12, 100)};
  const std::string png = io::EncodePng(grey);
  for (int i = 0; i < kViews; ++i) folder.Put("frames/frame_00" + std::to_string(i) + ".png", png);
  for (int i = 0; i < kViews * kViews; ++i) {
    folder.Put("hci/input_Cam00" + std::to_string(i) + ".png", png);
  }
  folder.Put("positions.csv", "frame_000.png,412\nframe_001.png,413\nframe_002.png,414\n");
  folder.Put("camera.yaml", kCamera);
  folder.Put("tiff/lightfield.yaml", kTiffLightField);
}

std::string Refusal(const FuzzedReader& reader, const std::string& bytes,
                    const TemporaryFolder& folder) {
  try {
    reader.read(bytes, folder);
    return "";
  } catch (const Error& error) {
    std::string message = error.what();
    if (message.empty()) throw std::runtime_error("an Error without a message");
    return message;
  }
}

}  // namespace thicklens::testing
