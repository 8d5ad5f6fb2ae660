#ifndef THICKLENS_TOOLS_BENCH_SOURCE_FIGURES_H_
#define THICKLENS_TOOLS_BENCH_SOURCE_FIGURES_H_

#include <array>
#include <optional>
#include <string>

namespace thicklens::tools {

// Published values of the paper for its four images of one size, in their order: K1 to K4 (640 x
// 480) or L1 to L4 (256 x 256).
using PublishedFigures = std::array<double, 4>;

// Returns the seconds of the paper's tables 1 (implementation "opencl" or "cpu"), 2 (the same) and
// 3 ("bicgstab", "umfpack", "viennacl"). Size: 'K' or 'L'; views: 3, 5 or 7 across and down. Absent
// if the paper has no such row.
std::optional<PublishedFigures> PublishedSeconds(int table, const std::string& implementation,
                                                 char size, int views);

// Values of the paper's table 4, lens "thick" or "thin"; the paper does not state the number of
// views.
struct PublishedFidelity {
  PublishedFigures macade, delta_e94_mean;
};
std::optional<PublishedFidelity> PublishedFidelityOf(const std::string& lens, char size);

double MeanOf(const PublishedFigures& figures);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SOURCE_FIGURES_H_
