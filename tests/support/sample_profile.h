#ifndef THICKLENS_TESTS_SUPPORT_SAMPLE_PROFILE_H_
#define THICKLENS_TESTS_SUPPORT_SAMPLE_PROFILE_H_

#include <string>

#include "thicklens/estimator/estimate_profile.h"

namespace thicklens::testing {

// An image of one megapixel whose files take no time.
inline constexpr estimator::Workload kSampleWorkload{1, 1, 25, 1, 0};

// A plan of the scene solver that takes `seconds` for each megapixel.
inline estimator::PlanProfile SamplePlan(const std::string& prior, double seconds, double psnr_db) {
  estimator::PlanProfile plan;
  plan.plan.prior = prior;
  estimator::TimeModel::Terms terms = estimator::TimeModel::Terms::Zero();
  terms[estimator::TimeModel::kPixels] = seconds;
  plan.time_model = estimator::TimeModel(terms);
  plan.psnr_db = psnr_db;
  plan.median_error = 0.1;
  return plan;
}

// A profile of four plans: warping 30 dB, the best 40 dB.
inline estimator::EstimateProfile SampleProfile() {
  estimator::EstimateProfile profile;
  profile.from = "a test's profile";
  profile.processor = "a machine";
  profile.date = "2026-01-01T00:00:00Z";
  profile.build = "a build";
  profile.threads = 4;
  profile.runs = 3;
  profile.probe_seconds = 0.1;
  profile.warping_psnr_db = 30;
  profile.largest = {1, 3, 81, 3, 0};
  profile.plans = {SamplePlan("ridge", 1, 34.9), SamplePlan("gradient", 2, 35.5),
                   SamplePlan("tv", 4, 39.2), SamplePlan("patches", 8, 40)};
  return profile;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SAMPLE_PROFILE_H_
