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
};

struct TimedLoad {
  PictureLoad load;
  double seconds = 0;  // > 0
};

// Seconds as a sum of terms, none of them negative:
//   start + pixels (c1 + c2 channels + c3 views + c4 views channels + c5 channels sigma
//                   + c6 views sigma)
// reading and depth, the picture, the geometry of the views, the views and their files, and what
// iterations and geometry do for a pixel's blur.
class TimeLaw {
 public:
  static constexpr int kTerms = 7;
  using Terms = Eigen::Matrix<double, kTerms, 1>;

  TimeLaw() : coefficients_(Terms::Zero()) {}
  explicit TimeLaw(const Terms& coefficients) : coefficients_(coefficients) {}

  double Seconds(const PictureLoad& load) const;
  const Terms& coefficients() const { return coefficients_; }

 private:
  Terms coefficients_;
};

// The least sum of squared relative errors with no coefficient below 0. Throws Error for fewer than
// two loads or a time that is not above 0.
TimeLaw FitTimeLaw(const std::vector<TimedLoad>& measured);

// Of each load the law's prediction from those of all other sizes, over what was measured.
std::vector<double> LeftOutRatios(const std::vector<TimedLoad>& measured);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_TIME_LAW_H_
