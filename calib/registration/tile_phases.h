#ifndef THICKLENS_CALIB_REGISTRATION_TILE_PHASES_H_
#define THICKLENS_CALIB_REGISTRATION_TILE_PHASES_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

namespace thicklens::calib {

// How one tile of a frame lies against the same tile of a reference that was brought to the frame's
// geometry.
struct TileShift {
  Eigen::Vector2d centre_px{0, 0};
  Eigen::Vector2d shift_px{0, 0};  // frame(p) shows reference(p - shift)
  // Inverse covariance of the shift, px^-2. A tile that holds one straight edge has next to none
  // along it.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
};

// The shifts of square tiles of two pictures by the phases of their cross-spectra. A blur that is
// symmetric leaves the phases alone; frequencies where it turns the sign (beyond the first zero of
// a disc) do not agree and drop out. Gain and offset of the illumination do not matter, a slope
// only below the lowest frequency used. Shifts of up to 1.5 px or so.
class TilePhases {
 public:
  explicit TilePhases(int size_px);

  // The tiles at `corner` of two pictures of one geometry, CV_32F.
  void Add(const cv::Mat& reference, const cv::Mat& frame, cv::Point corner);

  // A plane through the phases of each tile. Every frequency has the weight that the coherence of
  // all tiles at its radius gives it: noise counts there, and what the window cuts off a blurred
  // picture but not off a sharp one. Tiles without texture are left out.
  std::vector<TileShift> Solve();

  // After Solve, over the frequencies that agree at all: the correlation coefficient, 1 where the
  // pictures differ by a linear filter alone.
  double agreement() const { return agreement_; }
  // By how much the frame's blur exceeds the reference's, as the variance of a Gaussian; negative
  // where the reference is the softer one. Nothing if too few frequencies tell.
  std::optional<double> added_variance_px2() const { return added_variance_px2_; }
  // Second moment about the tile's centre, along one axis, of the weight with which its parts enter
  // the shift (the square of the window), px^2.
  double weight_variance_px2() const { return weight_variance_px2_; }

 private:
  struct Frequency {
    int row, column, ring;
    float x, y;  // cycles per px
  };
  struct Bin {
    float real, imaginary;   // F conj(R), of modulus 1
    float frame, reference;  // powers
    float weight;            // 1/variance of the phase, rad^-2
  };
  struct Tile {
    TileShift shift;
    std::vector<Bin> bins;  // of frequencies_
  };
  struct Ring {
    double count = 0, cross = 0, frame = 0, reference = 0;
    double Coherence() const;  // squared, 0 where the phases oppose
  };
  // Of exp(2 pi i k shift) along both axes, for every k of a transform.
  struct Turns;

  void Step(std::size_t count, Tile* tile) const;
  void SumRings();
  void Weigh(Tile* tile) const;
  void Summarise();

  int size_px_;
  std::vector<float> window_;  // along one axis
  double weight_variance_px2_ = 0;
  std::vector<Frequency> frequencies_;  // of a half plane, lowest first
  std::vector<Tile> tiles_;
  std::vector<Ring> rings_;  // one cycle per tile wide
  double agreement_ = 0;
  std::optional<double> added_variance_px2_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TILE_PHASES_H_
