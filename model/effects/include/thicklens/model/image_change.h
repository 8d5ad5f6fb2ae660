#ifndef THICKLENS_MODEL_IMAGE_CHANGE_H_
#define THICKLENS_MODEL_IMAGE_CHANGE_H_

#include <cstddef>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/encoded_values.h"

namespace thicklens::model {

// Difference between two images, or two sets of images, of encoded values in 1/255 of full scale.
struct ImageChange {
  double rms_grey_levels = 0;      // rms over the pixels and channels, in 1/255 of full scale
  double largest_grey_levels = 0;  // largest absolute difference, in 1/255 of full scale
  double psnr_db = 0;              // +inf where nothing changed
  // Displacement of the reference in any one direction that would change it by the same rms:
  // rms(d)/rms(slope along one axis), for small displacements. NaN if the reference is flat.
  double as_shift_px = 0;

  // Returns whether all values are equal.
  bool nothing() const { return largest_grey_levels == 0; }
};

// Sums the differences over images.
class THICKLENS_EXPORT ImageChangeAccumulator {
 public:
  // Both must have one size and number of channels. Returns the rms of this image, grey levels.
  double Add(const EncodedValues& reference, const EncodedValues& other);
  // Adds the sums of another meter.
  void Add(const ImageChangeAccumulator& other);
  // Returns the difference over all images that were added.
  ImageChange Result() const;

 private:
  double squares_ = 0, largest_ = 0, slope_squares_ = 0;  // in full scale
  std::size_t count_ = 0, slopes_ = 0;
};

// Returns `other` minus the reference, as the mean of the channels, in grey levels; pixel by pixel.
THICKLENS_EXPORT std::vector<float> GreyLevelDifference(const EncodedValues& reference,
                                                        const EncodedValues& other);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_IMAGE_CHANGE_H_
