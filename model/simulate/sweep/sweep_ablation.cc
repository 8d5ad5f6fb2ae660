#include "thicklens/model/sweep_ablation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/model/encoded_values.h"

namespace thicklens::model {
namespace {

// The frames of a sweep up to this size are kept in memory; those of a larger one are simulated
// each time that they are needed.
constexpr double kMaxHeldBytes = 1 << 30;

// The results for each frame. They are computed once and kept if they fit into kMaxHeldBytes;
// otherwise each is computed when it is asked for.
template <typename Frame>
class Frames {
 public:
  Frames(int count, double bytes, int threads, std::function<Frame(int)> make)
      : make_(std::move(make)) {
    if (count * bytes > kMaxHeldBytes) return;
    held_.resize(static_cast<std::size_t>(count));
    ParallelFor(count, threads, [this](int i) { held_[static_cast<std::size_t>(i)] = make_(i); });
  }
  Frame At(int i) const { return held_.empty() ? make_(i) : held_[static_cast<std::size_t>(i)]; }

 private:
  std::function<Frame(int)> make_;
  std::vector<Frame> held_;
};

// One simulation of the sweep.
class SweepWorld {
 public:
  SweepWorld(const SweepSimulationOptions& options, const LinearImage& target_image,
             const AblationRun& run, const std::function<void()>& tell)
      : start_(Clock::now()),
        options_(options),
        simulator_(options, target_image),
        tell_(tell),
        stored_(options.frame_count, Pixels() * 2, run.threads,
                [this](int i) {
                  tell_();
                  return simulator_.RenderFrame(i);
                }),
        seconds_(SecondsSince(start_)) {}
  SweepWorld(const SweepWorld&) = delete;
  SweepWorld& operator=(const SweepWorld&) = delete;

  double Pixels() const {
    return static_cast<double>(options_.camera.sensor.width_px) * options_.camera.sensor.height_px;
  }
  const SweepSimulator& simulator() const { return simulator_; }
  double seconds() const { return seconds_; }

  EncodedValues Values(int frame, bool with_noise) const {
    tell_();
    return with_noise ? EncodedValuesOf(stored_.At(frame))
                      : EncodedValuesOf(simulator_.RenderNoiseless(frame),
                                        simulator_.camera().sensor.transfer);
  }

  SweepCalibration Calibrated(const CalibrateSweep& calibrate) const {
    return calibrate({options_, simulator_, [this](int i) { return stored_.At(i); }, tell_});
  }

 private:
  Clock::time_point start_;
  SweepSimulationOptions options_;
  SweepSimulator simulator_;
  std::function<void()> tell_;
  Frames<EncodedImage> stored_;
  double seconds_;
};

class SweepAblator {
 public:
  SweepAblator(const SweepSimulationOptions& sweep, const LinearImage& target_image,
               const CalibrateSweep& calibrate, const AblationRun& run)
      : sweep_(sweep), target_image_(target_image), calibrate_(calibrate), run_(run) {}

  SweepAblation Run() {
    SweepSimulationOptions by_auto = sweep_;
    by_auto.effects.base = EffectSelectionOptions::Base::kAuto;
    const EffectSet kept = SweepSimulator(by_auto, target_image_).effects().on;

    sweep_.effects = AllInsteadOfAuto(sweep_.effects);
    const SweepWorld base(sweep_, target_image_, run_, [this] { Tell(); });
    const SweepSimulator& simulator = base.simulator();
    result_.on = simulator.effects().on;
    total_ = static_cast<int>(result_.on.Effects().size()) + 1;
    result_.frames = sweep_.frame_count;
    result_.true_image_distance_mm = simulator.truth().image_distance_mm;
    result_.true_blur_ratio = simulator.truth().blur_ratio;
    result_.image_seconds = base.seconds();
    CalibrateBase(base);
    const Frames<EncodedValues> noiseless(sweep_.frame_count, base.Pixels() * 4, run_.threads,
                                          [&](int i) { return base.Values(i, false); });
    for (const LargestEffectImpact& finding : simulator.effects().findings) {
      if (!result_.on.Has(finding.effect)) continue;
      ++done_;
      Tell();
      AblatedSweepEffect row;
      row.effect = finding.effect;
      row.bound_grey_levels = finding.impact.grey_levels;
      row.kept_by_auto = kept.Has(finding.effect);
      TakeAway(base, noiseless, &row);
      result_.effects.push_back(std::move(row));
    }
    return std::move(result_);
  }

 private:
  void Tell() const {
    if (run_.progress) run_.progress(done_, total_);
  }

  void CalibrateBase(const SweepWorld& base) {
    const auto start = Clock::now();
    const SweepCalibration calibration = base.Calibrated(calibrate_);
    if (!calibration.values) {
      throw Error("the sweep with all its effects gives no calibration to compare with: " +
                  calibration.refusal);
    }
    result_.calibration = *calibration.values;
    result_.calibration_seconds = SecondsSince(start);
  }

  void TakeAway(const SweepWorld& base, const Frames<EncodedValues>& noiseless,
                AblatedSweepEffect* row) const {
    SweepSimulationOptions options = sweep_;
    options.effects.without.Add(row->effect);
    const SweepWorld world(options, target_image_, run_, [this] { Tell(); });
    row->image_seconds = world.seconds();
    Compare(base, noiseless, world, row);
    row->absent = row->image.nothing() && SameReadings(base, world);
    if (row->absent) {
      row->calibration = result_.calibration;
      return;
    }
    const auto start = Clock::now();
    SweepCalibration calibration = world.Calibrated(calibrate_);
    row->calibration = calibration.values;
    row->refusal = std::move(calibration.refusal);
    row->calibration_seconds = SecondsSince(start);
  }

  static bool SameReadings(const SweepWorld& a, const SweepWorld& b) {
    const auto& of_a = a.simulator().truth().frames;
    const auto& of_b = b.simulator().truth().frames;
    return std::equal(
        of_a.begin(), of_a.end(), of_b.begin(), of_b.end(),
        [](const auto& one, const auto& other) { return one.reading_mm == other.reading_mm; });
  }

  void Compare(const SweepWorld& base, const Frames<EncodedValues>& noiseless,
               const SweepWorld& world, AblatedSweepEffect* row) const {
    const bool with_noise = IsOfStorage(row->effect);
    const auto with = [&](int i) { return with_noise ? base.Values(i, true) : noiseless.At(i); };
    std::vector<ImageChangeAccumulator> meters(static_cast<std::size_t>(sweep_.frame_count));
    std::vector<double> rms(meters.size());
    ParallelFor(sweep_.frame_count, run_.threads, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      rms[at] = meters[at].Add(with(i), world.Values(i, with_noise));
    });
    ImageChangeAccumulator all;
    for (const ImageChangeAccumulator& meter : meters) all.Add(meter);
    row->image = all.Result();
    if (row->image.nothing()) return;
    const auto most = std::max_element(rms.begin(), rms.end()) - rms.begin();
    const auto frame = static_cast<int>(most);
    const EncodedValues there = with(frame);
    row->difference = {
        there.width_px, there.height_px,
        GreyLevelDifference(there, world.Values(frame, with_noise)),
        fmt::format("frame {} of {}, at {:.5g} mm", frame + 1, sweep_.frame_count,
                    base.simulator().truth().frames[static_cast<std::size_t>(most)].depth_mm)};
  }

  SweepSimulationOptions sweep_;
  const LinearImage& target_image_;
  const CalibrateSweep& calibrate_;
  const AblationRun& run_;
  int done_ = 0, total_ = 1;
  SweepAblation result_;
};

}  // namespace

SweepAblation AblateSweep(const SweepSimulationOptions& sweep, const LinearImage& target_image,
                          const CalibrateSweep& calibrate, const AblationRun& run) {
  return SweepAblator(sweep, target_image, calibrate, run).Run();
}

}  // namespace thicklens::model
