#ifndef THICKLENS_ESTIMATOR_TIME_MODEL_H_
#define THICKLENS_ESTIMATOR_TIME_MODEL_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Quantities known before an estimate that determine its time.
struct Workload {
  double megapixels = 0;     // size of the photograph, in 10^6 px
  int channels = 1;          // of the photograph
  int views = 0;             // U V
  double blur_sigma_px = 0;  // of the photograph by its depth, root mean square over the pixels
  // Seconds that one thread needs to encode the files of all views, which depend on the content.
  double file_seconds = 0;
};

// Parts of the seconds of a run. The rest of the whole is making the views, and the end.
struct PartSeconds {
  // of the files, until the plan is chosen; it has passed by then and is in no model
  double read = 0;
  double setup = 0;  // geometry
  double solve = 0;  // depends on the plan alone; all other parts are equal for plans of one kind
  double files = 0;  // writing the views
};

// Returns the properties of a photograph, its depth and its views that determine how long an
// estimate takes. `file_seconds` is measured by the caller.
THICKLENS_EXPORT Workload WorkloadOf(const EstimateInput& input, double file_seconds);

// A workload with the time that it took.
struct TimedWorkload {
  Workload load;       // what was estimated
  double seconds = 0;  // of the whole run, > 0
  PartSeconds parts;   // none below 0; their sum is at most the whole
};

// Seconds of a run from the start of reading its files [D120], as a sum of terms, none of them
// negative. Pixels are in millions.
class THICKLENS_EXPORT TimeModel {
 public:
  // The terms are in the order of the profile's file, whose schema changes with it. s is the blur's
  // sigma in px.
  enum Term {
    kStart,                // seconds, independent of the image
    kPixels,               // depth
    kPixelsChannels,       // work of iterations for a pixel
    kPixelsViews,          // the geometry of the views
    kPixelsViewsChannels,  // making the views
    kPixelsChannelsBlur,   // times s: work of iterations for a blur
    kPixelsViewsBlur,      // times s: work of the geometry for a blur
    kFileSeconds,          // the threads' share in encoding
    kViews,                // files and threads of a view, independent of size
    // times s / (1 + s): iterations level off with blur, and are few without it
    kPixelsViewsChannelsIterations,
    kPixelsChannelsIterations,  // times s / (0.2 + s), on scene points: iterations level off sooner
    kPixelsViewsBlurArea,       // times s^2: pixels that a blur reaches
  };
  static constexpr int kTerms = kPixelsViewsBlurArea + 1;  // The number of terms.
  // One coefficient per term, in the order of the enumeration.
  using Terms = Eigen::Matrix<double, kTerms, 1>;

  // Makes a model that predicts no time at all.
  TimeModel() : coefficients_(Terms::Zero()) {}
  // Makes a model of these coefficients.
  explicit TimeModel(const Terms& coefficients) : coefficients_(coefficients) {}

  // Predicted time of a whole run, s.
  double Seconds(const Workload& load) const;
  // The coefficients of the terms.
  const Terms& coefficients() const { return coefficients_; }

 private:
  Terms coefficients_;
};

// Times of plans on the same images in the same order. The plans differ only in what they solve.
using TimesOfPlans = std::vector<std::vector<TimedWorkload>>;

// Fits a model for each plan. It is the sum of a model for each part of a run, with only the terms
// that such work has, because a few images cannot separate all terms. The common parts of the plans
// are fitted to the mean of all plans, so that noise does not separate plans where the images do
// not. Each model has the least sum of squared errors, relative to the whole time, with no
// coefficient below 0. Throws Error for fewer than two images, times that are not above 0, parts
// that do not fit their times, or plans with different images.
THICKLENS_EXPORT std::vector<TimeModel> FitTimeModels(const TimesOfPlans& plans);

// Returns for each plan and image the ratio of predicted to measured time. The prediction is made
// when the image has been read, by the model from the images of all other sizes.
THICKLENS_EXPORT std::vector<std::vector<double>> LeftOutRatios(const TimesOfPlans& plans);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_TIME_MODEL_H_
