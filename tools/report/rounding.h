#ifndef THICKLENS_TOOLS_REPORT_ROUNDING_H_
#define THICKLENS_TOOLS_REPORT_ROUNDING_H_

#include <string>

namespace thicklens::tools {

bool UsableSigma(double sigma);  // finite and above 0

// Rounds a number to the digits that its error leaves meaningful: two digits of the error. With an
// error that is 0, NaN or infinite: five significant digits.
std::string RoundedTo(double value, double sigma);
std::string RoundedSigma(double sigma);  // two digits; "-" if 0, NaN or infinite
std::string SignedRoundedTo(double value, double sigma);
// Returns "400.12 +- 0.11 mm"; without a usable sigma the number alone.
std::string WithError(double value, double sigma, const std::string& unit);
std::string SignedWithError(double value, double sigma, const std::string& unit);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ROUNDING_H_
