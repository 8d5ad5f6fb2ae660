#ifndef THICKLENS_IMAGE_H_
#define THICKLENS_IMAGE_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens {
namespace io {
struct ImageFacts;
}

// The curve between linear light and encoded values: Linear(), Srgb() or Gamma(2.2).
using TransferCurve = model::TransferCurve;

// The order of the channels of one pixel. There is no default: a reader states it.
enum class ChannelOrder {
  kGrey,  // one channel
  kRgb,   // red, green, blue
  kRgba,  // red, green, blue, alpha
  kBgr,   // blue, green, red, as OpenCV stores colours
  kBgra,  // blue, green, red, alpha
};
THICKLENS_EXPORT std::string ChannelOrderName(ChannelOrder order);  // "grey", "rgb", ...

// Whether the pixels of a file are turned as its EXIF, or its kind of file, states.
enum class Orientation {
  kAsStored,   // as the sensor has them; a camera file describes these
  kDisplayed,  // as a viewer shows them
};

// How ReadImage reads a file.
struct ImageReadOptions {
  // How light became the values; it replaces what the file states. Absent: not stated.
  std::optional<TransferCurve> transfer;
  // Which way up the photograph is read.
  Orientation orientation = Orientation::kAsStored;
};

// An image with everything that its values need to be understood: the order of its channels and
// how light became them. The values are either encoded (whole numbers of 8 or 16 bits, as files
// store them) or linear light (float, 1 at full scale). Rows go from top to bottom; the centre of
// the top-left pixel is (0, 0). An Image owns its values; a copy copies them.
class THICKLENS_EXPORT Image {
 public:
  // Makes an image of encoded values: width_px * height_px pixels of the channels of `order`, each
  // value from 0 to 2^bits - 1. Blue-first orders are rearranged, so that order() is kGrey, kRgb or
  // kRgba. `transfer` is how light became the values; absent: not stated, and whoever needs light
  // decides (a camera's curve, or sRGB without a camera). `source` names the image in messages.
  // Throws Error if a size is < 1, `bits` is not 8 or 16, the number of values does not fit, or a
  // value is above full scale.
  static Image FromEncoded(int width_px, int height_px, ChannelOrder order, int bits,
                           std::vector<std::uint16_t> values,
                           std::optional<TransferCurve> transfer = std::nullopt,
                           std::string source = "");
  // Makes an image of linear light. Values outside [0, 1] are kept. `transfer` is the curve with
  // which it will be stored. Throws Error if a size is < 1, the number of values does not fit, or a
  // value is not finite.
  static Image FromLight(int width_px, int height_px, ChannelOrder order, std::vector<float> values,
                         TransferCurve transfer = TransferCurve::Srgb(), std::string source = "");

  // Returns whether the image has no pixel, as a default-constructed one.
  bool is_empty() const;
  // Width, px.
  int width_px() const;
  // Height, px.
  int height_px() const;
  int channels() const;        // 1, 3 or 4
  ChannelOrder order() const;  // kGrey, kRgb or kRgba
  // Returns whether the values are linear light rather than encoded.
  bool is_linear() const { return std::holds_alternative<model::LinearImage>(pixels_); }
  int bits() const;  // 8 or 16; 32 for linear light
  // The stated curve between light and encoded values; absent: not stated.
  const std::optional<TransferCurve>& transfer() const { return transfer_; }
  // The file that ReadImage read, or the name that was given; empty: none. Messages name it.
  const std::string& source() const { return source_; }
  // Whether EXIF can be read from source(): true for images of ReadImage.
  bool is_from_file() const { return is_from_file_; }
  // What ReadImage found in the file (thicklens/io/image_file.h); null: the image was not read, or
  // is a part of one that was.
  const std::shared_ptr<const io::ImageFacts>& facts() const { return facts_; }

  // The curve that the file states; absent: the image is not from a file, the file states none, or
  // one that TransferCurve does not have.
  std::optional<TransferCurve> StatedTransfer() const;
  // The ICC profile of the values, which WriteImage writes with them: that of the file, if its
  // curve is `transfer`, or the one that was set. Empty: none.
  std::string ColourProfile(const TransferCurve& transfer) const;
  // Sets the profile of linear light that will be stored by transfer(). The curve of the profile
  // must be this one.
  void SetColourProfile(std::string icc_profile);

  // The values, channels interleaved in the order order(). encoded() throws Error for linear light,
  // light() for encoded values.
  const model::EncodedImage& encoded() const;
  // The values as linear light; see encoded().
  const model::LinearImage& light() const;

  // Returns the image in linear light. Encoded values are decoded by `transfer`; it has no effect
  // on an image that is linear already. Alpha is decoded like a colour, as model::ToLinear does.
  model::LinearImage ToLight(const TransferCurve& transfer) const;
  // Returns the image with encoded values of 8 or 16 bits, which its transfer curve (sRGB if none
  // is stated) gives, rounded to the nearest level and clipped to [0, 1]. CompareImages takes such
  // images. An image that has encoded values of that many bits is returned as it is. Throws Error
  // for other bits, for encoded values of other bits, and for an empty image.
  Image Encoded(int bits) const;
  // Returns a copy without the alpha channel.
  Image WithoutAlpha() const;
  // Returns the image with `values` as its linear light, of the same size and channels. The rest,
  // as what its file states, stays. Throws Error if the number of values is another or one is not
  // finite.
  Image WithLight(std::vector<float> values) const;
  // Returns a rectangle of the image. Throws Error if it is empty or not inside.
  Image Cropped(const model::PixelRect& rect) const;

 private:
  friend THICKLENS_EXPORT Image ReadImage(const std::string& path, const ImageReadOptions& options);
  std::variant<model::EncodedImage, model::LinearImage> pixels_;
  std::optional<TransferCurve> transfer_;
  std::string source_;
  bool is_from_file_ = false;
  std::shared_ptr<const io::ImageFacts> facts_;
  std::string colour_profile_;
};

// Reads an image file of 8 or 16 bits: grey, RGB or RGBA; PNG, TIFF, JPEG, WebP, HEIF, raw and what
// else the build's library knows, by its contents. The values are exactly those of the file, raw
// ones demosaiced; the image is never rotated by its EXIF. `transfer` states how light became the
// values, and replaces what a camera's file states; if it is absent, the image has the transfer
// that the file itself states (raw: linear). Throws Error that names the file.
THICKLENS_EXPORT Image ReadImage(const std::string& path,
                                 std::optional<TransferCurve> transfer = std::nullopt);
// Likewise, with choices of how it is read.
THICKLENS_EXPORT Image ReadImage(const std::string& path, const ImageReadOptions& options);

// The kinds of image files that are written.
enum class ImageFileFormat {
  kPng,   // 8 and 16 bits
  kJpeg,  // 8 bits, lossy
  kTiff,  // 8 and 16 bits
  kExr,   // linear light as floats
  kWebp,  // 8 bits, lossy unless the quality is 100
  kBmp,   // 8 bits
  kPnm,   // 8 and 16 bits
  kPfm,   // linear light as floats
};
// The kind that the ending of a file's name stands for: .png .jpg .jpeg .tif .tiff .exr .webp .bmp
// .pgm .ppm .pnm .pfm, in capitals or not. Throws Error that names the file and lists the endings,
// also if this build cannot write the kind.
THICKLENS_EXPORT ImageFileFormat ImageFormatOfName(const std::string& path);

// The options of WriteImage and EncodeImage.
struct ImageFileOptions {
  // WriteImage takes the kind from the ending of the file's name instead.
  ImageFileFormat format = ImageFileFormat::kPng;
  // 8 or 16, of linear light in a file of integers, rounded to the nearest level; encoded values
  // keep their own, and 16 is refused for values of 8 bits.
  int bits = 8;
  // Standard deviation of normal noise that is added to the encoded values before rounding, in
  // 1/255 of full scale, finite and >= 0; only for linear light.
  double noise_levels = 0;
  std::uint64_t seed = 0;  // of the noise, which depends on nothing else
  // Written into the file as its description; empty: none.
  std::string description;

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};
// An image file in memory.
struct EncodedImageFile {
  std::string bytes;  // all bytes of the file
  // Values of linear light half a level or more beyond the range, or NaN; 0 for encoded values.
  std::size_t clipped_values = 0;
};
// Makes what WriteImage writes. `source` of the image is not part of it. Throws OptionError, and
// Error if the kind does not hold such an image.
THICKLENS_EXPORT EncodedImageFile EncodeImage(const Image& image,
                                              const ImageFileOptions& options = {});
// Writes a file of the kind that its name ends with. For a file of integers, linear light is
// encoded by the image's transfer curve and clipped. The file appears completely or not at all.
// Returns the number of clipped values (half a level beyond the range, or NaN); 0 for encoded
// values. Throws OptionError, and Error that names the file.
THICKLENS_EXPORT std::size_t WriteImage(const std::string& path, const Image& image,
                                        const ImageFileOptions& options = {});

}  // namespace thicklens

#endif  // THICKLENS_IMAGE_H_
