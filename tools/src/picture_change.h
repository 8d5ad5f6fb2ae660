#ifndef THICKLENS_TOOLS_PICTURE_CHANGE_H_
#define THICKLENS_TOOLS_PICTURE_CHANGE_H_

#include <cstddef>
#include <vector>

#include "thicklens/estimator/compare.h"

namespace thicklens::tools {

// How far one picture, or one set of pictures, is from another, of stored values in 1/255 of full
// scale.
struct PictureChange {
  double rms_grey_levels = 0;
  double largest_grey_levels = 0;
  double psnr_db = 0;  // +inf where nothing changed
  // A displacement of the reference by so much, in a direction of any kind, would change it by the
  // same rms: rms(d)/rms(slope along one axis), by small displacements. NaN where the reference is
  // flat.
  double as_shift_px = 0;

  bool nothing() const { return largest_grey_levels == 0; }
};

// Adds up over pictures.
class PictureChangeMeter {
 public:
  // Both of one size and number of channels. Returns the rms of this picture, grey levels.
  double Add(const estimator::StoredValues& reference, const estimator::StoredValues& other);
  // What another has added up.
  void Add(const PictureChangeMeter& other);
  PictureChange Result() const;

 private:
  double squares_ = 0, largest_ = 0, slope_squares_ = 0;  // of full scale
  std::size_t count_ = 0, slopes_ = 0;
};

// `other` less the reference, mean of the channels, in grey levels; pixel by pixel.
std::vector<float> GreyLevelDifference(const estimator::StoredValues& reference,
                                       const estimator::StoredValues& other);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PICTURE_CHANGE_H_
