#include "tools/options/estimate_profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <memory>
#include <system_error>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/estimate_input.h"
#include "tools/options/estimate_plan.h"
#include "tools/system/build_info.h"
#include "tools/system/machine.h"

namespace thicklens::tools {

// Returns the text of configs/profiles/default.json, which CMake embeds.
std::string DefaultProfileText();

namespace {

using nlohmann::json;

constexpr char kSchema[] = "thicklens/estimate-profile/5";

const json& Field(const json& fields, const char* name, const std::string& where) {
  const auto found = fields.find(name);
  if (found == fields.end()) throw Error(fmt::format("{}: '{}' is missing", where, name));
  return *found;
}

double NumberOf(const json& fields, const char* name, double least, const std::string& where) {
  const json& found = Field(fields, name, where);
  if (!found.is_number() || !(found.get<double>() >= least)) {
    throw Error(fmt::format("{}: {}: a number of at least {} is expected, found {}", where, name,
                            least, found.dump()));
  }
  return found.get<double>();
}

int WholeNumberOf(const json& fields, const char* name, int least, const std::string& where) {
  const json& found = Field(fields, name, where);
  if (!found.is_number_integer() || !(found.get<double>() >= least) ||
      !(found.get<double>() <= std::numeric_limits<int>::max())) {
    throw Error(fmt::format("{}: {}: a whole number from {} to {} is expected, found {}", where,
                            name, least, std::numeric_limits<int>::max(), found.dump()));
  }
  return found.get<int>();
}

std::string TextOf(const json& fields, const char* name, const std::string& where) {
  const json& found = Field(fields, name, where);
  if (!found.is_string()) {
    throw Error(fmt::format("{}: {}: a text is expected, found {}", where, name, found.dump()));
  }
  return found.get<std::string>();
}

estimator::TimeModel TimeModelOf(const json& fields, const std::string& where) {
  const json& found = Field(fields, "seconds", where);
  estimator::TimeModel::Terms terms;
  const auto is_term = [](const json& term) { return term.is_number() && term.get<double>() >= 0; };
  if (!found.is_array() || found.size() != estimator::TimeModel::kTerms ||
      !std::all_of(found.begin(), found.end(), is_term)) {
    throw Error(fmt::format("{}: seconds: {} numbers of at least 0 are expected, found {}", where,
                            estimator::TimeModel::kTerms, found.dump()));
  }
  for (int i = 0; i < estimator::TimeModel::kTerms; ++i) {
    terms[i] = found[static_cast<std::size_t>(i)].get<double>();
  }
  return estimator::TimeModel(terms);
}

estimator::EstimateProfile Parse(const std::string& text, const std::string& where) {
  const json fields = json::parse(text, nullptr, false);
  if (!fields.is_object()) {
    throw Error(
        fmt::format("{}: is not a JSON object; make a profile with thicklens bench accuracy "
                    "--save-profile",
                    where));
  }
  if (TextOf(fields, "schema", where) != kSchema) {
    throw Error(fmt::format("{}: schema: '{}' is expected, found {}", where, kSchema,
                            fields["schema"].dump()));
  }
  estimator::EstimateProfile profile;
  profile.from = where;
  profile.processor = TextOf(fields, "processor", where);
  profile.date = TextOf(fields, "date", where);
  profile.build = TextOf(fields, "build", where);
  profile.threads = WholeNumberOf(fields, "threads", 1, where);
  profile.runs = WholeNumberOf(fields, "runs", 1, where);
  profile.probe_seconds = NumberOf(fields, "probe_seconds", 1e-9, where);
  profile.warping_psnr_db = NumberOf(fields, "warping_psnr_db", 0, where);
  const json& largest = Field(fields, "largest", where);
  if (!largest.is_object()) {
    throw Error(fmt::format("{}: largest: a map is expected, found {}", where, largest.dump()));
  }
  profile.largest.megapixels = NumberOf(largest, "megapixels", 0, where + ": largest");
  profile.largest.channels = WholeNumberOf(largest, "channels", 1, where + ": largest");
  profile.largest.views = WholeNumberOf(largest, "views", 2, where + ": largest");
  profile.largest.blur_sigma_px = NumberOf(largest, "blur_sigma_px", 0, where + ": largest");
  const json& plans = Field(fields, "plans", where);
  if (!plans.is_array() || plans.empty()) {
    throw Error(fmt::format("{}: plans: a list of at least one plan is expected", where));
  }
  for (std::size_t i = 0; i < plans.size(); ++i) {
    const std::string of_plan = fmt::format("{}: plans[{}]", where, i);
    estimator::PlanProfile plan;
    plan.plan = PlanFromJson(Field(plans[i], "plan", of_plan), of_plan);
    plan.time_model = TimeModelOf(plans[i], of_plan);
    plan.median_error = NumberOf(plans[i], "median_error", 0, of_plan);
    plan.largest_error = NumberOf(plans[i], "largest_error", 0, of_plan);
    plan.psnr_db = NumberOf(plans[i], "psnr_db", 0, of_plan);
    profile.plans.push_back(plan);
  }
  return profile;
}

}  // namespace

bool IsFromHere(const estimator::EstimateProfile& profile, int threads_here) {
  const std::string processor_here = ProcessorName();
  return processor_here != kUnknownProcessor &&
         profile.WasMeasuredBy(BuildInfo(), processor_here, threads_here);
}

json ProfileJson(const estimator::EstimateProfile& profile) {
  json plans = json::array();
  for (const estimator::PlanProfile& plan : profile.plans) {
    const estimator::TimeModel::Terms& terms = plan.time_model.coefficients();
    plans.push_back({{"plan", PlanJson(plan.plan)},
                     {"seconds", std::vector<double>(terms.data(), terms.data() + terms.size())},
                     {"median_error", plan.median_error},
                     {"largest_error", plan.largest_error},
                     {"psnr_db", plan.psnr_db}});
  }
  return {{"schema", kSchema},
          {"processor", profile.processor},
          {"date", profile.date},
          {"build", profile.build},
          {"threads", profile.threads},
          {"runs", profile.runs},
          {"probe_seconds", profile.probe_seconds},
          {"warping_psnr_db", profile.warping_psnr_db},
          {"largest",
           {{"megapixels", profile.largest.megapixels},
            {"channels", profile.largest.channels},
            {"views", profile.largest.views},
            {"blur_sigma_px", profile.largest.blur_sigma_px}}},
          {"plans", plans}};
}

estimator::EstimateProfile ReadProfile(const std::string& path) {
  estimator::EstimateProfile profile = Parse(ReadTextFile(path), path);
  profile.is_own = true;
  return profile;
}

estimator::EstimateProfile DefaultProfile() {
  return Parse(DefaultProfileText(), "the profile that ships");
}

std::string UserProfilePath() {
  const auto folder = [](const char* variable) -> std::filesystem::path {
    const char* value = std::getenv(variable);  // NOLINT: nothing sets it meanwhile
    // A relative path would start at the current folder, which anybody may have filled.
    const std::filesystem::path path = value == nullptr ? "" : value;
    return path.is_absolute() ? path : std::filesystem::path();
  };
  std::filesystem::path config = folder("XDG_CONFIG_HOME");
  if (config.empty() && !folder("HOME").empty()) config = folder("HOME") / ".config";
  return config.empty() ? "" : (config / "thicklens" / "profile.json").string();
}

estimator::EstimateProfile ProfileFor(const std::string& path) {
  if (!path.empty()) return ReadProfile(path);
  const std::string own = UserProfilePath();
  std::error_code unreachable;
  if (own.empty() || !std::filesystem::exists(own, unreachable)) return DefaultProfile();
  try {
    return ReadProfile(own);
  } catch (const Error& error) {
    throw Error(
        fmt::format("{}; measure it again with `thicklens bench accuracy --save-profile`, or "
                    "delete it to use the one that ships",
                    error.what()));
  }
}

double ProbeSeconds(int threads) {
  constexpr int kSizePx = 256, kViews = 5, kRuns = 3;
  // The content of the scene does not matter: it is a plane with the same blur everywhere.
  estimator::EstimateInput input;
  input.image = model::LinearImage{kSizePx, kSizePx, 1, {}};
  input.image.values.resize(kSizePx * kSizePx);
  for (std::size_t i = 0; i < input.image.values.size(); ++i) {
    input.image.values[i] =
        0.5F + 0.4F * static_cast<float>(std::sin(0.7 * static_cast<double>(i % 977)));
  }
  input.disparity.width_px = input.disparity.height_px = kSizePx;
  input.disparity.disparity.assign(kSizePx * kSizePx, 1.0F);
  input.weights = Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
  // On a machine that is so busy that one run takes this long, more runs give no new information.
  constexpr double kEnoughSeconds = 0.4;
  double best = 0, spent = 0;
  for (int run = 0; run < kRuns && spent < kEnoughSeconds; ++run) {
    const auto start = Clock::now();
    RunPlan({}, input, threads, nullptr);
    const double seconds = SecondsSince(start);
    best = run == 0 ? seconds : std::min(best, seconds);
    spent += seconds;
  }
  return best;
}

}  // namespace thicklens::tools
