#include "calib/registration/reading_checks.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/registration/frame_structure.h"
#include "calib/sweep/frame_selection.h"

namespace thicklens::calib {
namespace {

constexpr double kFarOff = 6;  // standard deviations

// A frame whose scale contradicts the written reading.
struct WrongReading {
  std::size_t frame = 0;
  double error_mm = 0;  // written reading minus the reading that the scale gives
  double sigma_mm = 0;
};

std::vector<WrongReading> FindWrongReadings(const FocusSweep& sweep,
                                            const std::vector<ScaleSample>& samples,
                                            const ScaleModel& law) {
  std::vector<WrongReading> wrong;
  if (!law.done) return wrong;
  const double sign = model::DirectionSign(sweep.direction);
  for (const ScaleSample& sample : samples) {
    const double depth_mm = law.reference_depth_mm / sample.scale;
    const double error_mm = sample.reading_mm - sign * (depth_mm - law.line_zero_mm());
    const double sigma_mm = std::hypot(std::max(sweep.reading_sigma_mm, law.reading_rms_mm),
                                       depth_mm * sample.registration.scale_sigma / sample.scale);
    if (std::abs(error_mm) > kFarOff * sigma_mm)
      wrong.push_back({sample.frame, error_mm, sigma_mm});
  }
  return wrong;
}

// Digits behind the point that an error of this size leaves: at least one.
int DigitsOf(double sigma_mm) {
  if (!(sigma_mm > 0)) return 1;
  return std::clamp(static_cast<int>(std::ceil(-std::log10(sigma_mm))), 1, 7);
}

// Finds another frame such that each of the two has the other's reading.
std::optional<std::size_t> SwappedWith(const WrongReading& one,
                                       const std::vector<WrongReading>& all,
                                       const FocusSweep& sweep) {
  for (const WrongReading& other : all) {
    if (other.frame == one.frame) continue;
    const double apart_mm =
        sweep.frames[one.frame].reading_mm - sweep.frames[other.frame].reading_mm;
    if (std::abs(one.error_mm - apart_mm) < kFarOff * one.sigma_mm &&
        std::abs(other.error_mm + apart_mm) < kFarOff * other.sigma_mm)
      return other.frame;
  }
  return std::nullopt;
}

// Rejects identical frames at different readings, because nothing shows which reading is theirs.
void RejectRepeated(const FocusSweep& sweep, std::vector<FrameMeasurement>* frames) {
  std::map<std::uint64_t, std::vector<std::size_t>> same;
  for (std::size_t i = 0; i < frames->size(); ++i) {
    if ((*frames)[i].rejection.empty()) same[(*frames)[i].statistics.content_hash].push_back(i);
  }
  for (const auto& [hash, members] : same) {
    std::set<double> readings;
    for (const std::size_t i : members) readings.insert((*frames)[i].reading_mm);
    if (readings.size() < 2) continue;
    for (const std::size_t i : members) {
      const std::size_t other = *std::find_if(members.begin(), members.end(), [&](std::size_t m) {
        return (*frames)[m].reading_mm != (*frames)[i].reading_mm;
      });
      (*frames)[i].rejection = fmt::format("repeated image: the same as {} at reading {}",
                                           FileName((*frames)[other].image),
                                           ReadingInWords(sweep, (*frames)[other].reading_mm));
    }
  }
}

bool IsStatedEdge(const FocusSweep& sweep) {
  return sweep.target == model::SweepTarget::kKnifeEdge ||
         sweep.target == model::SweepTarget::kPrintedEdge;
}

}  // namespace

bool IsLoneEdge(const FocusSweep& sweep, std::size_t used, std::size_t registered,
                const ScaleModel& law) {
  return IsStatedEdge(sweep) && law.kind == ScaleKind::kUnknown &&
         (law.contradicts_readings || 2 * registered < used);
}

std::string RegistrationAdvice(const FocusSweep& sweep, const std::vector<FrameMeasurement>& frames,
                               const std::vector<std::size_t>& used, const ScaleModel& law,
                               const FrameStructureFinding& structure) {
  const auto registered = static_cast<std::size_t>(std::count_if(
      used.begin(), used.end(), [&](std::size_t i) { return frames[i].image_scale.has_value(); }));
  const bool was_tried = law.reference_frame >= 0;
  if (!was_tried || law.done || law.shows_no_scale || IsStatedEdge(sweep) ||
      2 * registered >= used.size())
    return "";
  // Among the structures found, only strong bands are known to prevent the registration of frames.
  const std::string seen = StructureInWords(structure);
  constexpr char kNeeded[] =
      "every frame must show the same part of the target, sharp enough to be recognised. If the "
      "target is a lone edge, which shows no image scale, state target: knife-edge or "
      "printed-edge; if the images look torn or scrambled, their files were decoded wrongly";
  return fmt::format("only {} of {} frames could be registered to one another{}", registered,
                     used.size(),
                     seen.empty() ? fmt::format(": {}", kNeeded)
                     : BandsExplain(structure, used.size() - registered, used.size())
                         ? fmt::format(": {}", BandsInWords(structure))
                         : fmt::format(": {}. If this is not the cause: {}", seen, kNeeded));
}

void ForgetScales(const FocusSweep& sweep, std::vector<ScaleSample>* samples, ScaleModel* law) {
  const auto is_other = [&](const ScaleSample& sample) {
    return static_cast<int>(sample.frame) != law->reference_frame;
  };
  samples->erase(std::remove_if(samples->begin(), samples->end(), is_other), samples->end());
  law->contradicts_readings = false;
  law->message = "a lone edge shows no image scale";
  if (sweep.offset_mm) law->message += ": the given offset_mm is used unchecked";
}

std::string ReasonOfUnknownOffset(const ScaleModel& law) {
  return fmt::format("offset_mm is not stated and could not be determined: {}; {}", law.message,
                     law.shows_no_scale ? "state offset_mm, or use a texture"
                                        : "to calibrate without the image scale, state offset_mm");
}

std::optional<std::string> ReasonAgainstScales(const std::vector<FrameMeasurement>& frames,
                                               const std::vector<std::size_t>& used,
                                               const ScaleModel& law) {
  std::set<std::uint64_t> different;
  for (const std::size_t i : used) different.insert(frames[i].statistics.content_hash);
  if (used.size() > 2 && different.size() < std::max<std::size_t>(2, used.size() / 4)) {
    return fmt::format(
        "one image was repeated: {} frames contain only {} different images (image scale: {})",
        used.size(), different.size(), law.message);
  }
  if (law.kind == ScaleKind::kReversed || law.contradicts_readings) return law.message;
  return std::nullopt;
}

void RejectWrongReadings(const FocusSweep& sweep, const std::vector<ScaleSample>& samples,
                         const ScaleModel& law, std::vector<FrameMeasurement>* frames) {
  RejectRepeated(sweep, frames);
  const std::vector<WrongReading> wrong = FindWrongReadings(sweep, samples, law);
  for (const WrongReading& one : wrong) {
    FrameMeasurement& frame = (*frames)[one.frame];
    if (!frame.rejection.empty()) continue;
    frame.reading_error_mm = one.error_mm;
    const int digits = DigitsOf(one.sigma_mm);
    const double right_mm = frame.reading_mm - one.error_mm;
    frame.rejection = fmt::format(
        "reading off by {}, or frame damaged: its image scale belongs to the reading {}",
        ReadingErrorInWords(sweep, frame.reading_mm, right_mm, digits),
        ReadingInWords(sweep, right_mm, digits));
    if (const auto other = SwappedWith(one, wrong, sweep))
      frame.rejection += fmt::format("; swapped with {}", FileName((*frames)[*other].image));
  }
}

void RejectUnregistered(const std::vector<ScaleSample>& samples,
                        const std::vector<std::size_t>& used, std::size_t reference,
                        const ScaleModel& law, const FrameStructureFinding& structure,
                        std::vector<FrameMeasurement>* frames) {
  if (!law.done) return;
  std::set<std::size_t> registered;
  for (const ScaleSample& sample : samples) registered.insert(sample.frame);
  const auto missing = static_cast<std::size_t>(std::count_if(
      used.begin(), used.end(), [&](std::size_t i) { return registered.count(i) == 0; }));
  std::string why = "it shows another part of the target, or too little of it to be recognised";
  const std::string bands = "its rows or columns brighten in bands that other frames do not have";
  if (BandsExplain(structure, missing, used.size())) {
    why = bands;
  } else if (structure.HasBands()) {
    why = bands + ", or " + why;
  }
  for (const std::size_t i : used) {
    if (registered.count(i) > 0) continue;
    (*frames)[i].rejection =
        fmt::format("cannot be registered: to {}, the sharpest frame, because {}",
                    FileName((*frames)[reference].image), why);
  }
}

// [D64] Least squares of reading = a + b/scale + c (b/scale)^2 + jump H, scanned over the position
// of the jump. The square describes the smooth bend of a real lens or rail.
std::optional<ReadingStep> FindReadingStep(std::vector<ScaleSample> samples,
                                           const ScaleModel& law) {
  constexpr std::size_t kMinOnEachSide = 4;
  constexpr double kExplained = 0.6;  // maximum remaining part of the squares
  const std::size_t n = samples.size();
  if (!law.done || n < 3 * kMinOnEachSide) return std::nullopt;
  std::sort(samples.begin(), samples.end(),
            [](const ScaleSample& a, const ScaleSample& b) { return a.reading_mm < b.reading_mm; });
  Eigen::MatrixXd design(static_cast<Eigen::Index>(n), 4);
  Eigen::VectorXd readings(static_cast<Eigen::Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double x = samples.front().scale / samples[i].scale;
    design.row(row) << 1, x, x * x, 0;
    readings[row] = samples[i].reading_mm;
  }
  const auto rest_of = [&](const Eigen::MatrixXd& terms) {
    return (readings - terms * terms.colPivHouseholderQr().solve(readings)).squaredNorm();
  };
  const double without = rest_of(design.leftCols(3));
  std::optional<ReadingStep> reading_step;
  double least = without;
  for (std::size_t k = kMinOnEachSide; k + kMinOnEachSide <= n; ++k) {
    design.col(3).setZero();
    design.col(3).tail(static_cast<Eigen::Index>(n - k)).setOnes();
    const double rest = rest_of(design);
    if (!(rest < least)) continue;
    least = rest;
    const Eigen::Matrix4d normal = design.transpose() * design;
    const double variance = rest / static_cast<double>(n - 4);
    const Eigen::Vector4d solved = design.colPivHouseholderQr().solve(readings);
    reading_step =
        ReadingStep{samples[k].frame, {solved[3], std::sqrt(variance * normal.inverse()(3, 3))}};
  }
  if (!reading_step || !(least < kExplained * without) ||
      !(std::abs(reading_step->jump_mm.value) > kFarOff * reading_step->jump_mm.sigma))
    return std::nullopt;
  return reading_step;
}

}  // namespace thicklens::calib
