// The files that correct the frames of a sweep: read, checked against a frame, and described.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/calib/frame_checks.h"
#include "thicklens/frames.h"
#include "thicklens/io/files_read.h"
#include "tools/interface/frame_light.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/stated_transfer.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

constexpr double kPercent = 100;

std::string ChannelsText(int channels) { return channels == 1 ? "1 channel" : "3 channels"; }

std::string FramesText(const AveragedFrames& frames) {
  const std::size_t count = frames.average.frames;
  return fmt::format("{} ({} frame{})", frames.source, count, count == 1 ? "" : "s");
}

// A dark or a flat of a frame, and the messages about it.
class ExposureCheck {
 public:
  ExposureCheck(const char* kind, const CorrectedFrame& frame) : kind_(kind), frame_(frame) {}

  // Throws Error unless both have the same pixels and the same processing. Light of a file that had
  // another value for white is converted to that of the frame.
  void RequireAlike(int frame_white, AveragedFrames* frames) const {
    const cv::Mat& light = frames->average.light;
    const cv::Mat& stored = frame_.stored;
    const int channels = std::min(stored.channels(), 3);
    if (light.size() != stored.size()) {
      throw Differ(frames->source, fmt::format("{} x {} px", light.cols, light.rows),
                   fmt::format("{} x {} px", stored.cols, stored.rows),
                   "both must have the same pixels of the sensor");
    }
    if (light.channels() != channels) {
      throw Differ(frames->source, ChannelsText(light.channels()), ChannelsText(channels),
                   "both must come from the same camera in the same mode");
    }
    if (frames->sensor != frame_.sensor) {
      const auto text = [](const std::string& sensor) {
        return sensor.empty() ? std::string("pixels of no raw file") : sensor;
      };
      throw Differ(frames->source, text(frames->sensor), text(frame_.sensor),
                   "both must have the same sensor, region and processing");
    }
    if (frames->bits == 0) return;
    const int bits = stored.depth() == CV_8U ? 8 : 16;
    if (frames->bits != bits) {
      throw Differ(frames->source, fmt::format("{} bits", frames->bits),
                   fmt::format("{} bits", bits),
                   "both must come from the same camera in the same mode");
    }
    if (frames->transfer != frame_.transfer.Name()) {
      throw Differ(frames->source, fmt::format("the transfer curve {}", frames->transfer),
                   frame_.transfer.Name(), "average it again with the curve of the camera file");
    }
    if (frames->white == frame_white) return;
    if (!(frame_.transfer == TransferCurve::Linear())) {
      throw Differ(frames->source, fmt::format("white at {}", frames->white),
                   fmt::format("white at {}", frame_white),
                   "average it again with the full scale of the frames");
    }
    const double factor = static_cast<double>(frames->white) / frame_white;
    frames->average.light = frames->average.light * factor;
    frames->average.mean_level *= factor;
    frames->average.noise_sigma *= factor;
    frames->clipped_level *= factor;
  }

  // Throws Error if a file states another curve than the one that it is decoded with, unless the
  // frame's file states the same.
  void RequireTransfer(const AveragedFrames& frames) const {
    if (frames.files_read == nullptr) return;
    Camera camera;
    camera.sensor.transfer = frame_.transfer;
    for (const io::FilesRead& group : *frames.files_read) {
      const std::string stated = StatedTransferName(group.facts);
      if (stated == frame_.stated_transfer || TransferContradiction(group.facts, camera).empty())
        continue;
      throw Differ(group.files.front(), fmt::format("the stated transfer curve {}", stated),
                   frame_.stated_transfer.empty()
                       ? "none, and the camera file " + frame_.transfer.Name()
                       : frame_.stated_transfer,
                   "both must be stored alike");
    }
  }

  Error Refusal(const AveragedFrames& frames, const std::string& why) const {
    return Error(fmt::format("{} {}: {}", kind_, frames.source, why));
  }

 private:
  Error Differ(const std::string& source, const std::string& found, const std::string& of_frame,
               const std::string& remedy) const {
    return Error(fmt::format("{} {}: it has {}, but the frame {} has {}: {}", kind_, source, found,
                             frame_.name, of_frame, remedy));
  }

  const char* kind_;
  const CorrectedFrame& frame_;
};

cv::Mat PartOf(const cv::Mat& image, const model::RegionOfInterest& roi) {
  return roi.width > 0 ? image(cv::Rect(roi.x, roi.y, roi.width, roi.height)) : image;
}

double MeanOf(const cv::Mat& light) { return cv::mean(light.clone().reshape(1))[0]; }

// Statistics of the frame as it is measured, in linear light before the correction.
struct FrameLevel {
  double mean = 0, noise_sigma = 0;
};

void CheckDark(const AveragedFrames& dark, const FrameLevel& frame, const CorrectedFrame& checked,
               const ExposureCheck& check, std::vector<std::string>* notices) {
  const cv::Mat light = PartOf(dark.average.light, checked.roi);
  const double mean = MeanOf(light);
  if (!(frame.mean > 0)) return;
  const double share = mean / frame.mean;
  const std::string levels =
      fmt::format("its mean is {:.2f} % of full scale, that of {} is {:.2f} %", kPercent * mean,
                  checked.name, kPercent * frame.mean);
  constexpr double kNothingLeft = 0.9, kSuspicious = 0.25, kStructured = 0.02;
  if (share > kNothingLeft) {
    throw check.Refusal(dark, fmt::format("{}: the difference leaves no image: an exposure without "
                                          "light is expected",
                                          levels));
  }
  if (!(share > kSuspicious)) return;
  const calib::FlatStructure structure = calib::StructureOf(light);
  if (structure.relative > kStructured && structure.relative > 3 * structure.of_noise) {
    throw check.Refusal(
        dark,
        fmt::format("{}, and it shows structure of {:.1f} % of its level: an exposure without "
                    "light is expected",
                    levels, kPercent * structure.relative));
  }
  notices->push_back(
      fmt::format("dark {}: {}: if the camera adds no such level to its values, light reached the "
                  "sensor",
                  dark.source, levels));
}

void CheckFlat(const AveragedFrames& flat, const cv::Mat& dark, const FrameLevel& frame,
               const CorrectedFrame& checked, const ExposureCheck& check,
               std::vector<std::string>* notices) {
  constexpr double kMaxClipped = 0.001, kMinLight = 0.005;
  if (flat.clipped_share > kMaxClipped) {
    throw check.Refusal(
        flat,
        fmt::format("{:.1f} % of the pixels of a channel are clipped at {:.3g} of full scale: "
                    "expose it shorter, to about half of full scale",
                    kPercent * flat.clipped_share, flat.clipped_level));
  }
  const cv::Mat whole = dark.empty() ? flat.average.light : cv::Mat(flat.average.light - dark);
  const cv::Mat light = PartOf(whole, checked.roi);
  const double mean = MeanOf(light);
  const char* const subtracted = dark.empty() ? "" : " after the dark was subtracted";
  if (!(mean > kMinLight)) {
    throw check.Refusal(flat, fmt::format("its mean is {:.2f} % of full scale{}: it shows no light "
                                          "to divide by; expose it to about half of full scale",
                                          kPercent * mean, subtracted));
  }
  // A plateau that a camera clips below its full scale is found by its statistics; values at full
  // scale itself need none.
  constexpr double kFull = 0.9995;
  const double at_full =
      static_cast<double>(
          cv::countNonZero(PartOf(flat.average.light, checked.roi).clone().reshape(1) >= kFull)) /
      static_cast<double>(light.total() * static_cast<std::size_t>(light.channels()));
  if (at_full > kMaxClipped) {
    throw check.Refusal(flat, fmt::format("{:.1f} % of its values are at full scale: expose it "
                                          "shorter, to about half of full scale",
                                          kPercent * at_full));
  }
  std::vector<cv::Mat> channels;
  cv::split(light, channels);
  for (const cv::Mat& channel : channels) {
    const double limit = calib::FrameCorrection::kMinFlat * cv::mean(channel)[0];
    const int none = cv::countNonZero(channel < limit);
    if (static_cast<double>(none) > kMaxClipped * static_cast<double>(channel.total())) {
      throw check.Refusal(
          flat, fmt::format("{} pixels ({:.1f} %) are below {:.0f} % of its mean{}: there is no "
                            "light to divide by; state the part with light as the region (roi_px)",
                            none, kPercent * none / static_cast<double>(channel.total()),
                            kPercent * calib::FrameCorrection::kMinFlat, subtracted));
    }
  }
  constexpr double kTarget = 0.04, kDoubtful = 0.01, kAboveNoise = 3;
  const calib::FlatStructure structure = calib::StructureOf(light);
  if (structure.relative > kAboveNoise * structure.of_noise) {
    const std::string amount = fmt::format(
        "it shows structure of {:.1f} % of its level, finer than shading, where its noise would "
        "leave {:.1f} %",
        kPercent * structure.relative, kPercent * structure.of_noise);
    if (structure.relative > kTarget) {
      throw check.Refusal(flat, amount +
                                    ": an even surface without a target, out of focus, is "
                                    "expected");
    }
    if (structure.relative > kDoubtful) {
      notices->push_back(fmt::format(
          "flat {}: {}: structure that is not fixed to the sensor (paper, a target) is printed on "
          "every frame by the division",
          flat.source, amount));
    }
  }
  // The noise that is left in the flat is the same in all frames, as dirt on the sensor is.
  const double noise =
      flat.average.noise_sigma / mean /
      std::sqrt(static_cast<double>(std::max<std::size_t>(1, flat.average.frames)));
  const double of_frame = frame.mean > 0 ? frame.noise_sigma / frame.mean : 0;
  constexpr double kMaxNoise = 1;
  if (of_frame > 0 && noise > kMaxNoise * of_frame) {
    const double needed = std::ceil(static_cast<double>(flat.average.frames) *
                                    std::pow(noise / (kMaxNoise * of_frame), 2));
    notices->push_back(fmt::format(
        "flat {}: its noise ({:.2f} % of its level, from {} frame{}) is {:.2g} times that of a "
        "frame "
        "({:.2f} %), and the division prints it on every frame in the same place: average at least "
        "{:.0f} flats",
        flat.source, kPercent * noise, flat.average.frames, flat.average.frames == 1 ? "" : "s",
        noise / of_frame, kPercent * of_frame, needed));
  }
}

// The mask for frames of half of the sensor's size: a pixel of them is defective if one of its four
// is.
cv::Mat HalvedMask(const cv::Mat& mask) {
  cv::Mat half = cv::Mat::zeros(mask.rows / 2, mask.cols / 2, CV_8U);
  for (int y = 0; y < 2 * half.rows; ++y) {
    for (int x = 0; x < 2 * half.cols; ++x) {
      if (mask.at<std::uint8_t>(y, x) != 0) half.at<std::uint8_t>(y / 2, x / 2) = 255;
    }
  }
  return half;
}

std::string AverageLine(const char* kind, const AveragedFrames& frames) {
  const calib::FrameAverage& average = frames.average;
  std::string line = fmt::format("{} {}: mean {:.3g} % of full scale, noise of one frame {:.2g} %",
                                 kind, FramesText(frames), kPercent * average.mean_level,
                                 kPercent * average.noise_sigma);
  if (average.left_out > 0)
    line += fmt::format(", {:.2g} % of the values left out", kPercent * average.left_out);
  return line;
}

}  // namespace

FrameCorrectionFiles ReadFrameCorrection(const model::CorrectionFiles& files,
                                         const CorrectedFrame& frame,
                                         const FrameAverageOptions& given,
                                         const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(given);
  const RunScope run(control);
  FrameCorrectionFiles result;
  if (files.IsEmpty()) return result;
  FrameAverageOptions options = given;
  options.transfer = frame.transfer;
  const int container = frame.stored.depth() == CV_8U ? 255 : 65535;
  const int white = given.full_scale.value_or(container);
  FrameLevel level;
  {
    const cv::Mat stored = PartOf(frame.stored, frame.roi);
    const calib::FrameStatistics statistics =
        calib::MeasureFrame(stored, GreyOf(LightOf(stored, frame.transfer)));
    level = {statistics.mean_linear, statistics.noise_sigma};
  }
  cv::Mat dark, flat, defects;
  if (!files.dark.empty()) {
    const ExposureCheck check("dark", frame);
    AveragedFrames frames = AverageFrames(files.dark, options, control);
    check.RequireAlike(white, &frames);
    check.RequireTransfer(frames);
    CheckDark(frames, level, frame, check, &result.notices);
    result.lines.push_back(AverageLine("dark", frames));
    dark = frames.average.light;
  }
  if (!files.flat.empty()) {
    const ExposureCheck check("flat", frame);
    AveragedFrames frames = AverageFrames(files.flat, options, control);
    check.RequireAlike(white, &frames);
    check.RequireTransfer(frames);
    CheckFlat(frames, dark, level, frame, check, &result.notices);
    result.lines.push_back(AverageLine("flat", frames) +
                           (dark.empty() ? "" : ", of which the dark was subtracted"));
    flat = frames.average.light;
  }
  if (!files.defects.empty()) {
    const int factor = given.raw == model::SweepRaw::kGreen ? 2 : 1;
    defects = ReadDefects(files.defects, factor * frame.stored.cols, factor * frame.stored.rows);
    if (factor > 1) defects = HalvedMask(defects);
  }
  auto correction = std::make_shared<const calib::FrameCorrection>(dark, flat, defects);
  if (!files.defects.empty()) {
    result.lines.push_back(fmt::format(
        "defects {}{}: {} pixels are interpolated", files.defects.front(),
        files.defects.size() > 1 ? fmt::format(" and {} more", files.defects.size() - 1) : "",
        correction->defect_count() - correction->unlit_count()));
  }
  if (correction->unlit_count() > 0) {
    result.lines.push_back(
        fmt::format("{} pixels are interpolated because their flat is below {:.0f} % of its mean",
                    correction->unlit_count(), kPercent * calib::FrameCorrection::kMinFlat));
  }
  result.correction = std::move(correction);
  return result;
}

Image CorrectPhotograph(const Image& photo, const model::CorrectionFiles& files,
                        const TransferCurve& transfer, const RunControl& control) {
  if (files.IsEmpty()) return photo;
  RunScope run(control);
  const std::string name = photo.source().empty() ? "photo" : photo.source();
  if (photo.is_linear()) {
    throw OptionError(
        "correction",
        fmt::format("{}: {}: the values of the photograph are floats of linear light, "
                    "and an 8 or 16 bit file is expected",
                    run.Option("correction"), name));
  }
  const model::EncodedImage& encoded = photo.encoded();
  CorrectedFrame frame;
  frame.name = name;
  frame.transfer = photo.transfer().value_or(transfer);
  if (photo.facts() != nullptr) {
    frame.stated_transfer = StatedTransferName(*photo.facts());
    frame.sensor = SensorTextOf(*photo.facts());
  }
  const int channels = photo.channels();
  const cv::Mat values(photo.height_px(), photo.width_px(), CV_16UC(channels),
                       const_cast<std::uint16_t*>(encoded.values.data()));
  values.convertTo(frame.stored, encoded.bits == 8 ? CV_8U : CV_16U);
  const FrameCorrectionFiles found = ReadFrameCorrection(files, frame, {}, control);
  for (const std::string& line : found.lines) run.Inform(fmt::format("{}: {}", name, line));
  for (const std::string& notice : found.notices) run.Warn(notice);
  model::LinearImage light = photo.ToLight(frame.transfer);
  cv::Mat pixels(light.height_px, light.width_px, CV_32FC(channels), light.values.data());
  for (int channel = 0; channel < std::min(channels, 3); ++channel) {
    ThrowIfCancelled();
    cv::Mat plane;
    cv::extractChannel(pixels, plane, channel);
    found.correction->Apply(channel, &plane);
    found.correction->ReplaceDefects(&plane);
    cv::insertChannel(plane, pixels, channel);
  }
  return photo.WithLight(std::move(light.values));
}

}  // namespace thicklens
