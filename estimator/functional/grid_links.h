#ifndef THICKLENS_ESTIMATOR_FUNCTIONAL_GRID_LINKS_H_
#define THICKLENS_ESTIMATOR_FUNCTIONAL_GRID_LINKS_H_

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/estimator/disparity_map.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::estimator {

// D on the grid [D111] for a whole image: the differences between the rays of a view and those rays
// of the next view in u, and in v, that show the same points,
//   (D L)(i, k) = L(i + m, k + 1) - L(i, k),
// where m = -disparity * step in samples, linear between samples. The numbers are those of
// kernels::Kernels::WarpDifferences with the slopes of RayField. There is no difference where the
// next view does not show the point, and where a sample is missing or lands outside of the image.
class GridLinks {
 public:
  // `disparity` is rendered into each view (l * u_count + k), with the unit and size of `map`. The
  // block is the whole image.
  GridLinks(const DisparityMap& map, std::vector<std::vector<float>> disparity,
            const kernels::BlockGeometry& image, int threads);

  // Sets y = mu x + gamma D^T D x; views as in GridPhotograph.
  template <typename Real>
  void Apply(double gamma, double mu, const Real* x, Real* y) const;

  double bytes() const;

 private:
  enum class Axis { kU, kV };
  // Rays of a row whose points lie in the next view between the samples at `whole` and whole + 1
  // or, if `is_single`, on the sample at `whole`.
  struct Run {
    std::int32_t sample = 0;  // position in the row
    std::int32_t count = 0;
    std::int32_t whole = 0;
    bool is_single = false;
  };
  // Links of one view along one axis. The samples of a row are divided into bands, so that
  // differences down the columns of a band can be summed in parallel with those of other bands.
  struct ViewLinks {
    std::vector<Run> runs;
    std::vector<std::size_t> start;  // start of each band of each row, and the end
  };

  std::size_t BandCount() const;
  ViewLinks FindLinks(Axis axis, int view) const;
  // Returns false if there is no link.
  bool FindLink(Axis axis, int view, int s, int t, Run* run) const;
  template <typename Real>
  void AddBand(Axis axis, int view, int t, std::size_t band, Real gamma, const Real* x,
               Real* y) const;

  const DisparityMap& map_;
  std::vector<std::vector<float>> disparity_;
  kernels::BlockGeometry image_;
  int threads_;
  std::vector<ViewLinks> across_, down_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_GRID_LINKS_H_
