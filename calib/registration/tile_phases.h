#ifndef THICKLENS_CALIB_REGISTRATION_TILE_PHASES_H_
#define THICKLENS_CALIB_REGISTRATION_TILE_PHASES_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

#include "calib/registration/blur_field.h"

namespace thicklens::calib {

// Shift of one tile of a frame relative to the same tile of a reference that was brought to the
// geometry of the frame.
struct TileShift {
  Eigen::Vector2d centre_px{0, 0};
  Eigen::Vector2d shift_px{0, 0};  // frame(p) shows reference(p - shift)
  // Inverse covariance of the shift, px^-2. A tile that contains one straight edge has almost no
  // information along it.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
};

// Measures the shifts of square tiles of two images by the phases of their cross-spectra. A
// symmetric blur leaves the phases unchanged; frequencies where it changes the sign (beyond the
// first zero of a disc) do not agree and are excluded. Gain and offset of the illumination do not
// matter; a slope matters only below the lowest frequency used. Shifts may be up to about 1.5 px.
class TilePhases {
 public:
  explicit TilePhases(int size_px);

  // Adds the tiles at `corner` of two CV_32F images of one geometry.
  void Add(const cv::Mat& reference, const cv::Mat& frame, cv::Point corner);

  // Fits a plane to the phases of each tile. Every frequency has the weight that follows from the
  // coherence of all tiles at its radius. That accounts for noise, and for the parts that the
  // window cuts off a blurred image but not off a sharp one. Tiles without texture are left out.
  std::vector<TileShift> Solve();

  // Powers of one frequency in a tile, relative to each other: of the texture in both images, whose
  // blurs have been matched, and of their noise.
  struct Powers {
    double texture = 0, frame_noise = 0, reference_noise = 0;
  };
  // The inverse variance, px^-2 along each axis, that the shift of a tile of random texture has on
  // average [D154]. `powers` is a function of the frequency, cycles per px.
  double ExpectedInformation(const std::function<Powers(double frequency)>& powers) const;

  // The blur of the tiles along both axes after Solve, relative to that which the images were
  // brought to by a Gaussian of the variance `blur_px2` on the reference or, where it is negative,
  // on the frame. Frequencies that it attenuates much show what the window cut off, and are not
  // used. Tiles with too few frequencies are left out.
  std::vector<TileBlur> Blurs(double blur_px2) const;
  // The power of the texture over the frequencies that determine the shifts, after Solve. The
  // blur that the reference got, as in Blurs, is taken out.
  TexturePower PowerOfTexture(double blur_px2) const;

  // Correlation coefficient after Solve, over the frequencies that agree at all; 1 where the images
  // differ only by a linear filter.
  double agreement() const { return agreement_; }
  // Blur of the frame minus that of the reference, as the variance of a Gaussian; negative where
  // the reference is the more blurred one. It is std::nullopt if too few frequencies determine it.
  std::optional<double> added_variance_px2() const { return added_variance_px2_; }
  // Second moment about the centre of the tile, along one axis, of the weight with which its parts
  // contribute to the shift (the square of the window), px^2.
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
    std::vector<Bin> bins;  // one bin per frequency of frequencies_
  };
  struct Ring {
    double count = 0, cross = 0, frame = 0, reference = 0;
    double Coherence() const;  // squared, 0 where the phases oppose
  };
  // exp(2 pi i k shift) along both axes, for every k of a transform.
  struct Turns;

  void Step(std::size_t count, Tile* tile) const;
  void SumRings();
  void WeightByErrors(Tile* tile) const;
  void Summarise();

  int size_px_;
  std::vector<float> window_;  // along one axis
  double weight_variance_px2_ = 0;
  std::vector<Frequency> frequencies_;  // frequencies of a half plane, lowest first
  std::vector<Tile> tiles_;
  std::vector<Ring> rings_;  // rings one cycle per tile wide
  double agreement_ = 0;
  std::optional<double> added_variance_px2_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TILE_PHASES_H_
