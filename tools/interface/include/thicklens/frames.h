#ifndef THICKLENS_FRAMES_H_
#define THICKLENS_FRAMES_H_

#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/frame_average.h"
#include "thicklens/calib/frame_correction.h"
#include "thicklens/camera.h"
#include "thicklens/image.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/run.h"

namespace thicklens {
namespace io {
struct FilesRead;
}

// The options of AverageFrames.
struct FrameAverageOptions {
  calib::FrameAveraging method = calib::FrameAveraging::kClippedMean;  // how pixels are averaged
  // The value in the files that stands for white, 1 to 65535; absent: that of their container, or
  // the one that they state.
  std::optional<int> full_scale;
  model::SweepRaw raw = model::SweepRaw::kDemosaiced;  // what is taken of raw files
  // Transfer curve of files of integers; absent: the one that they state, or linear.
  std::optional<TransferCurve> transfer;

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The average of exposures of one scene in linear light, and how it was read.
struct AveragedFrames {
  calib::FrameAverage average;  // the image and its statistics, full scale 1
  std::string source;           // the files, for messages: "dark_01.png and 7 more"
  int bits = 0;                 // of the containers of the files, 8 or 16; 0: floats, or not stated
  int white = 0;                // the value in the files that stands for 1; 0: likewise
  std::string transfer;         // name of the curve that was decoded; empty: likewise
  std::string sensor;           // what a raw file states of its sensor and processing; empty: none
  // The larger share of a channel's pixels that is clipped at its bright end, 0 to 1, in the first
  // file, and the value there, in units of full scale.
  double clipped_share = 0, clipped_level = 1;
  // The facts about the files (thicklens/io/files_read.h).
  std::shared_ptr<const std::vector<io::FilesRead>> files_read = nullptr;
};

// Reads and averages exposures of one scene, as darks and flats are: images, all pages of files of
// several, and all frames of videos. A single file may be one that EncodeAveragedFrames made, which
// is returned as it is. Throws Error that names the files, and OptionError.
THICKLENS_EXPORT AveragedFrames AverageFrames(const std::vector<std::string>& files,
                                              const FrameAverageOptions& options = {},
                                              const RunControl& run = {});

// Returns the bytes of a TIFF file of 32-bit floats in linear light with full scale 1, whose
// description says how the average was made.
THICKLENS_EXPORT std::string EncodeAveragedFrames(const AveragedFrames& frames);

// Reads masks of defective pixels (images of one channel, not 0 where a pixel is defective) and
// lists (text with x and y of a pixel in a line, from 0 at the top left; further columns and what
// follows # are ignored), and returns the pixels of all of them, CV_8U with 0 and 255. Throws Error
// that names file and line for another size and for pixels outside of it.
THICKLENS_EXPORT cv::Mat ReadDefects(const std::vector<std::string>& files, int width_px,
                                     int height_px);
// Returns such a list of a mask, CV_8U, row by row.
THICKLENS_EXPORT std::string DefectList(const cv::Mat& mask);

// A correction, and one line for each of dark, flat and defects that says what was read.
struct FrameCorrectionFiles {
  std::shared_ptr<const calib::FrameCorrection> correction;  // null: no file was given
  std::vector<std::string> lines;                            // what was applied
  std::vector<std::string> notices;                          // doubts, one line each
};

// The frame by which ReadFrameCorrection checks the files.
struct CorrectedFrame {
  std::string name;  // for messages
  cv::Mat stored;    // as it is measured: 8 or 16 bits, 1, 3 or 4 channels
  TransferCurve transfer = TransferCurve::Linear();  // of its values
  std::string stated_transfer;                       // what its file states; empty: nothing
  std::string sensor;                                // as in AveragedFrames
  model::RegionOfInterest roi;                       // the part that is measured
};

// Reads, averages and checks the files that correct frames like `frame`. Throws Error that names
// both where size, channels, bits, transfer curve or sensor differ, for a flat that has no light,
// is clipped or shows a target, for a dark that is as bright as the frame, and OptionError.
THICKLENS_EXPORT FrameCorrectionFiles ReadFrameCorrection(const model::CorrectionFiles& files,
                                                          const CorrectedFrame& frame,
                                                          const FrameAverageOptions& options = {},
                                                          const RunControl& run = {});

// Returns a photograph, decoded by `transfer` unless it states its own curve, freed of what stays
// in place on the sensor, as ReadFrameCorrection frees frames; alpha is not changed. What was
// applied and doubts are notices. Without files the photograph is returned as it is. Throws Error
// as ReadFrameCorrection does, and OptionError for a photograph that is linear light already.
THICKLENS_EXPORT Image CorrectPhotograph(const Image& photo, const model::CorrectionFiles& files,
                                         const TransferCurve& transfer, const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_FRAMES_H_
