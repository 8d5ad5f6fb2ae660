#include "thicklens/calib/diagnosis.h"

#include <algorithm>
#include <cmath>

namespace thicklens::calib {
namespace {

bool IsThere(const std::optional<model::Estimate>& found, double least) {
  return found && std::abs(found->value) >
                      std::max(least, FrameStructureFinding::kSignificant * found->sigma);
}

}  // namespace

bool Diagnosis::Names(const std::string& cause) const {
  for (std::size_t i = 0; i < named; ++i) {
    if (causes[i].cause == cause) return true;
  }
  return false;
}

bool Diagnosis::NamesOnly(const std::string& cause) const {
  return named == 1 && causes[0].cause == cause;
}

void SortCauses(Diagnosis* diagnosis) {
  std::vector<CauseFit>& causes = diagnosis->causes;
  std::stable_sort(causes.begin(), causes.end(),
                   [](const CauseFit& a, const CauseFit& b) { return a.chi2 < b.chi2; });
  diagnosis->named = 0;
  if (causes.empty() || !(diagnosis->chi2_of_none - causes.front().chi2 >= Diagnosis::kDecisive))
    return;
  for (const CauseFit& cause : causes) {
    if (cause.chi2 - causes.front().chi2 < Diagnosis::kDecisive) ++diagnosis->named;
  }
}

bool FrameStructureFinding::HasVignetting() const { return IsThere(vignetting, kMinVignetting); }
bool FrameStructureFinding::HasBands() const { return IsThere(bands, kMinBands); }
bool FrameStructureFinding::HasFixedStructure() const {
  return IsThere(fixed_structure, kMinFixed);
}

}  // namespace thicklens::calib
