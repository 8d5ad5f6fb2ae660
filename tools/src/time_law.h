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

// Of the seconds of a run: what is left of the whole is making the views, and the end.
struct PartSeconds {
  double read = 0;   // of the files, until the plan is chosen: over by then, and in no law
  double setup = 0;  // geometry
  double solve = 0;  // what the plan alone decides; all else is the same for others of its kind
  double files = 0;  // writing the views
};

struct TimedLoad {
  PictureLoad load;
  double seconds = 0;  // > 0, of the whole run
  PartSeconds parts;   // none below 0, together no more than the whole
};

// Seconds of a run from when its files are read [D120], as a sum of terms, none of them negative.
// Pixels are in millions.
class TimeLaw {
 public:
  // In the order of the profile's file, whose schema changes with it. s: the blur's sigma in px.
  enum Term {
    kStart,                          // seconds, whatever the picture
    kPixels,                         // depth
    kPixelsChannels,                 // what iterations do for a pixel
    kPixelsViews,                    // the geometry of the views
    kPixelsViewsChannels,            // making them
    kPixelsChannelsBlur,             // times s: what iterations do for a blur
    kPixelsViewsBlur,                // times s: what geometry does for it
    kFileSeconds,                    // the share of the threads in encoding
    kViews,                          // a view's files and threads, whatever their size
    kPixelsViewsChannelsIterations,  // times s / (1 + s): a blur of many pixels takes no more
                                     // iterations than one of a few, and none at all takes few
    kPixelsChannelsIterations,       // times s / (.2 + s), of what is solved on scene points: with
                                     // more blur their iterations soon level off
    kPixelsViewsBlurArea,            // times s^2: the pixels that a blur reaches
  };
  static constexpr int kTerms = kPixelsViewsBlurArea + 1;
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

// A law for each plan, the sum of a law for each part of a run, of the terms that such work has:
// few pictures cannot tell all of them apart. What the plans have in common is found from the mean
// of them all, so that noise does not tell them apart where the pictures do not; each law has the
// least sum of squared errors, relative to the whole time, with no coefficient below 0. Throws
// Error for fewer than two pictures, times that are not above 0, parts that are not of them, or
// plans of different pictures.
std::vector<TimeLaw> FitTimeLaws(const TimesOfPlans& plans);

// Of each plan and picture what was foreseen once it was read, by the law from the pictures of all
// other sizes, over what was measured.
std::vector<std::vector<double>> LeftOutRatios(const TimesOfPlans& plans);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_TIME_LAW_H_
