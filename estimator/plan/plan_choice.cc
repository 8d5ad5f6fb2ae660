#include "thicklens/estimator/plan_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

// Shares of the best plan's gain over warping that "draft" and "standard" require.
constexpr double kDraftShare = 0.5, kStandardShare = 0.9;

struct Offer {
  const PlanProfile* plan = nullptr;
  double seconds = 0, loss_db = 0;
};

bool IsFaster(const Offer& a, const Offer& b) { return a.seconds < b.seconds; }
bool IsBetter(const Offer& a, const Offer& b) {
  return a.loss_db < b.loss_db || (a.loss_db == b.loss_db && a.seconds < b.seconds);
}

std::string OfferText(const Offer& offer) {
  return fmt::format("{} ({:.2g} s, {:.2f} dB below the best)", PlanName(offer.plan->plan),
                     offer.seconds, offer.loss_db);
}

[[noreturn]] void Refuse(const std::string& target_text, const EstimateProfile& profile,
                         const std::string& nearest) {
  throw Error(
      fmt::format("{} cannot be met by any plan of {}: {}", target_text, profile.from, nearest));
}

Offer Choose(const EstimateProfile& profile, const QualityTarget& target,
             const std::string& target_text, const std::vector<Offer>& offers) {
  const auto fastest_with_loss = [&](double loss_db) {
    std::vector<Offer> good;
    std::copy_if(offers.begin(), offers.end(), std::back_inserter(good),
                 [&](const Offer& offer) { return offer.loss_db <= loss_db; });
    return *std::min_element(good.begin(), good.end(), IsFaster);  // the best loses nothing
  };
  const double gain_db = std::max(0.0, profile.best_psnr_db() - profile.warping_psnr_db);
  if (target.quality == "draft") return fastest_with_loss((1 - kDraftShare) * gain_db);
  if (target.quality == "standard") return fastest_with_loss((1 - kStandardShare) * gain_db);
  if (target.quality == "best") return *std::min_element(offers.begin(), offers.end(), IsBetter);

  if (target.psnr_loss_db) {
    const Offer fastest = fastest_with_loss(*target.psnr_loss_db);
    if (!target.within_s || fastest.seconds <= *target.within_s) return fastest;
  }
  std::vector<Offer> soon;
  std::copy_if(offers.begin(), offers.end(), std::back_inserter(soon),
               [&](const Offer& offer) { return offer.seconds <= *target.within_s; });
  if (soon.empty()) {
    const Offer fastest = *std::min_element(offers.begin(), offers.end(), IsFaster);
    Refuse(
        target_text, profile,
        fmt::format("the fastest plan is {}; reading and writing files counts, and other programs "
                    "that compute; fewer views or a smaller image take less time",
                    OfferText(fastest)));
  }
  const Offer best = *std::min_element(soon.begin(), soon.end(), IsBetter);
  if (!target.psnr_loss_db) return best;
  Refuse(target_text, profile,
         fmt::format("in that time the best plan is {}; the fastest plan of that quality is {}",
                     OfferText(best), OfferText(fastest_with_loss(*target.psnr_loss_db))));
}

// Where the model of the time speaks of what was never measured.
std::vector<std::string> BeyondProfile(const EstimateProfile& profile, const Workload& load) {
  constexpr double kFar = 2;
  std::vector<std::string> beyond;
  const auto look = [&](double value, double most, const std::string& what) {
    if (value > kFar * most) {
      beyond.push_back(
          fmt::format("far beyond its {1} of {2:.2g} with {0:.2g}", value, what, most));
    }
  };
  look(load.megapixels, profile.largest.megapixels, "megapixels");
  look(load.views, profile.largest.views, "views");
  look(load.blur_sigma_px, profile.largest.blur_sigma_px, "blur sigma in px");
  return beyond;
}

}  // namespace

PlanChoice ChoosePlan(const EstimateProfile& profile, const QualityTarget& target,
                      const std::string& target_text, const Workload& load, double speed_ratio,
                      double spent_seconds) {
  std::vector<Offer> offers;
  // The files' time is of this machine already.
  Workload there = load;
  there.file_seconds /= speed_ratio;
  for (const PlanProfile& plan : profile.plans) {
    offers.push_back({&plan, spent_seconds + speed_ratio * plan.time_model.Seconds(there),
                      profile.LossDb(plan)});
  }
  const Offer chosen = Choose(profile, target, target_text, offers);
  const Offer best = *std::min_element(offers.begin(), offers.end(), IsBetter);
  PlanChoice choice;
  choice.plan = chosen.plan->plan;
  choice.expected_seconds = chosen.seconds;
  choice.loss_db = chosen.loss_db;
  choice.median_error = chosen.plan->median_error;
  choice.speed_ratio = speed_ratio;
  choice.message = fmt::format("{}: {}, about {:.2g} s (+- {:.0f} %)", target_text,
                               PlanName(choice.plan), chosen.seconds, 100 * choice.median_error);
  if (chosen.plan == best.plan) {
    choice.message += "; the best of its plans";
  } else if (chosen.loss_db < 0.005) {
    choice.message +=
        fmt::format("; as good as {} ({:.2g} s)", PlanName(best.plan->plan), best.seconds);
  } else {
    choice.message += fmt::format("; {:.2f} dB below {} ({:.2g} s)", chosen.loss_db,
                                  PlanName(best.plan->plan), best.seconds);
  }
  choice.message += "; from " + profile.from;
  if (speed_ratio != 1) {
    choice.message += fmt::format(", scaled by {:.2g} after a speed test (rough)", speed_ratio);
  }
  for (const std::string& beyond : BeyondProfile(profile, load)) choice.message += ", " + beyond;
  return choice;
}

}  // namespace thicklens::estimator
