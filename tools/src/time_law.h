#ifndef THICKLENS_TOOLS_TIME_LAW_H_
#define THICKLENS_TOOLS_TIME_LAW_H_

#include <Eigen/Core>
#include <vector>

namespace thicklens::tools {

// What the time of an estimate depends on, of what is known before it.
struct PictureLoad {
  double megapixels = 0;
  int channels = 1;
  int views = 0;             // U V
  double blur_sigma_px = 0;  // of the photograph by its depth, root mean square of the pixels
  // What one thread takes to make the files of all views: it depends on what they show.
  double file_seconds = 0;
};

struct TimedLoad {
  PictureLoad load;
  double seconds = 0;  // > 0
  // Of these, what the plan alone decides, from 0 to `seconds`; the rest (reading, geometry, files)
  // is the same for others of its kind.
  double solve_seconds = 0;
};

// Seconds as a sum of terms, none of them negative:
//   start + pixels (c1 + c2 channels + c3 views + c4 views channels + c5 channels sigma
//                   + c6 views sigma) + c7 file seconds
// reading and depth, the picture, the geometry of the views, the views, what iterations and
// geometry do for a pixel's blur, and the views' files.
class TimeLaw {
 public:
  static constexpr int kTerms = 8;
  using Terms = Eigen::Matrix<double, kTerms, 1>;

  TimeLaw() : coefficients_(Terms::Zero()) {}
  explicit TimeLaw(const Terms& coefficients) : coefficients_(coefficients) {}

  double Seconds(const PictureLoad& load) const;
  const Terms& coefficients() const { return coefficients_; }

 private:
  Terms coefficients_;
};

// Plans that took the same pictures, in one order, and do the same but for what they solve.
using TimesOfPlans = std::vector<std::vector<TimedLoad>>;

// A law for each plan: what they have in common is found from the mean of them all, so that noise
// does not tell them apart where the pictures do not; each has the least sum of squared errors,
// relative to the whole time, with no coefficient below 0. Throws Error for fewer than two
// pictures, times that are not above 0, or plans of different pictures.
std::vector<TimeLaw> FitTimeLaws(const TimesOfPlans& plans);

// Of each plan and picture the law's prediction from the pictures of all other sizes, over what was
// measured.
std::vector<std::vector<double>> LeftOutRatios(const TimesOfPlans& plans);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_TIME_LAW_H_
