#ifndef THICKLENS_IO_IMAGE_FILE_H_
#define THICKLENS_IO_IMAGE_FILE_H_

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/io/video_facts.h"

namespace thicklens::io {

// How the values of a file follow from light, as far as the file states it.
enum class StatedTransfer {
  kAbsent,  // the file does not state it
  kLinear,  // value = light
  kSrgb,    // IEC 61966-2-1
  kBt709,   // ITU-R BT.709
  kGamma,   // value = light^(1/gamma)
  kPq,      // SMPTE ST 2084
  kHlg,     // ITU-R BT.2100, hybrid log-gamma
};
// The meaning of the channel alpha, if there is one, for the others.
enum class AlphaKind {
  kNone,        // there is no such channel
  kStraight,    // the colours do not depend on it
  kAssociated,  // the colours have been multiplied by it
};

// The facts that a raw file states about its sensor. Levels are in the sensor's numbers.
struct RawFacts {
  std::string camera;  // maker and model; empty: not stated
  // Colours of the mosaic, row by row: "RGGB" for 2 x 2 px, 36 letters for X-Trans; empty: there is
  // no mosaic.
  std::string mosaic;
  // Levels of the sites of each 2 x 2 px of the active area, row by row. The black level has been
  // subtracted from the pixels, and the white level is their full scale.
  std::array<double, 4> black_level{};
  double white_level = 0;  // the sensor's number for white
  // Factors of red, green and blue, 1 for green; absent: the file has none.
  std::optional<std::array<double, 3>> camera_white_balance;
  int sensor_width_px = 0, sensor_height_px = 0;  // with the masked margins
  // The first pixel that saw light.
  int active_left_px = 0, active_top_px = 0;
  int active_width_px = 0, active_height_px = 0;  // the pixels that saw light
  std::string treatment;                          // how `pixels` came from the mosaic, in words
  // Why the pixels of the file, or of the demosaiced image, are not those of the sensor one by one;
  // empty: they are.
  std::string why_resampled;
  // Pixels of the sensor per pixel of the image: 1, or 2 for planes of the mosaic, whose pixel
  // pitch is twice that of the sensor.
  int sensor_px_per_px = 1;
};

// The errors that compression left in the values of a JPEG file, without their rounding to 8 bits:
// rms in grey levels. Derived here [D126]. Halved colours lose fine details besides, which the file
// does not show.
struct JpegError {
  double mean_levels = 0;  // of the mean of red, green and blue
  double rms_levels = 0;   // over all channels
};

// The facts that a file states about the image that was read from it.
struct ImageFacts {
  std::string file_kind;         // "PNG", "TIFF", "raw"
  std::uint64_t file_bytes = 0;  // size of the file
  // The size as stored, before any turning.
  int stored_width_px = 0, stored_height_px = 0;
  int width_px = 0, height_px = 0;    // of the pixels returned
  int page = 0, pages = 1;            // pages, parts or frames, counted from 0
  std::string part;                   // name of the part of an EXR file
  std::vector<std::string> channels;  // their names, in the order of `pixels`
  std::string sample_type;            // as stored: "unsigned 16-bit integers", "half floats"
  int container_bits = 0;             // of each value as stored
  // Bits of each value that carry data, if the file states it (BitsPerSample, sBIT, maxval, white
  // level).
  std::optional<int> significant_bits;
  // The value of `pixels` that stands for white; absent for floats and signed integers.
  std::optional<double> full_scale;
  // TIFF: the file states that 0 is white, and `pixels` are full_scale less the stored values.
  bool is_inverted = false;
  // TIFF: the value without data that the tag GDAL_NODATA states. Nothing is changed there.
  std::optional<double> no_data;
  // PFM: the magnitude of the header's scale, which is not applied to the values.
  double value_scale = 1;
  StatedTransfer transfer = StatedTransfer::kAbsent;  // what the file, or its profile, states
  double gamma = 0;  // of StatedTransfer::kGamma: value = light^(1/gamma)
  // The bytes of the colour profile. Its transfer curve is `transfer`; its primaries are those of
  // the values, which are not converted.
  std::string icc_profile;
  std::string icc_description;  // the profile's name for itself
  // x and y of red, green, blue and white in CIE 1931.
  std::optional<std::array<double, 8>> chromaticities;
  int orientation = 1;                   // 1 to 8 as in EXIF; 1: upright as stored
  bool is_orientation_applied = false;   // whether the pixels were turned by it
  AlphaKind alpha = AlphaKind::kNone;    // kNone: there is no alpha channel
  std::optional<double> pixel_pitch_mm;  // of the sensor, as EXIF states it
  std::string description;               // the file's own text, e.g. OME-XML
  std::optional<RawFacts> raw;           // absent: it is not a raw file
  std::optional<VideoFacts> video;       // absent: it is not a frame of a video
  // ImageReading::measures_compression; absent: not asked for, or unknown.
  std::optional<JpegError> jpeg_error;
  // Everything else that a user should know about this reading, one sentence each.
  std::vector<std::string> notes;

  // Describes the file in one line: "PNG, 640 x 480 px, RGB, unsigned 16-bit integers (12
  // significant), sRGB, ...".
  THICKLENS_EXPORT std::string OneLine() const;
};

// The image that is made from the mosaic of a raw file. The black level is always subtracted, and
// the values are linear in light.
enum class RawTreatment {
  // Three colours at the sensor's sampling: AHD interpolation, the camera's white balance, linear
  // light with sRGB's primaries, 16 bits. Interpolation changes the spectrum of each colour.
  kDemosaiced,
  // The mean of the two green sites of each 2 x 2 px, as float, 1 at the white level, not clipped
  // at 0. The image has half of the sensor's sides, and its pixel pitch is twice the sensor's.
  // Pixel (x, y) is centred at (2 x + 0.5, 2 y + 0.5) of the active area. The two sites are half a
  // diagonal away from that centre, which adds a variance of 1/4 sensor pixel^2 per axis, 1/16
  // pixel^2 of this image, to the blur. With the box of a sensor pixel, 1/12 pixel^2, this
  // is the variance of the box of one pixel of this image.
  kMosaicGreen,
  // Each of the four sites of 2 x 2 px by itself, as four channels named by colour ("R", "G1",
  // "G2", "B"), as float likewise. They are sampled at sites 1 sensor pixel apart.
  kMosaicPlanes,
};

// Which way up the pixels are returned.
enum class ImageOrientation {
  kAsStored,   // the pixels as the sensor has them; a calibration refers to these
  kDisplayed,  // turned as EXIF states it
};

// The choices of what is read from a file, and how.
struct ImageReading {
  // Which page, part or frame, counted from 0. A file of several is refused if this is absent.
  std::optional<int> page;
  std::string part;  // EXR: the part of this name, instead of `page`
  // EXR: only the channels "LAYER.X"; they are returned under their full names.
  std::string layer;
  std::vector<std::string> channels;  // only these, in this order; empty: all
  ImageOrientation orientation = ImageOrientation::kAsStored;  // which way up
  RawTreatment raw = RawTreatment::kDemosaiced;  // what is made of a raw file's mosaic
  // Values of 1 to 7 and 9 to 15 bits are spread over 8 or 16 bits, so that white is the full scale
  // of the container; false: they keep their values, and `full_scale` says what white is.
  bool spread_bits = true;
  // JPEG: MeasureJpegError is part of the facts. It reads the file a second time.
  bool measures_compression = false;
};

// The values of a file, and the facts that it states.
struct DecodedImage {
  // The values as the file has them, channels interleaved: CV_8U, 8S, 16U, 16S, 32S, 32F or 64F.
  // Half floats become 32F; unsigned integers of 32 bits become 64F.
  cv::Mat pixels;
  ImageFacts facts;  // what the file states
};

// Decodes the image in the bytes of a file, whatever the file is called: PNG, TIFF, JPEG, PFM and
// PNM, and, unless the build has no GPL parts, EXR, WebP, HEIF, AVIF, BMP, DICOM and camera raw.
// Several threads may decode at once. Throws Error that begins with `name` for other kinds, broken
// files, and files of several pages where no page is chosen.
THICKLENS_EXPORT DecodedImage DecodeImageFile(const std::string& bytes, const std::string& name,
                                              const ImageReading& reading = {});
// Decodes all pages, in the file's order; `reading.page` must be absent.
THICKLENS_EXPORT std::vector<DecodedImage> DecodeImagePages(const std::string& bytes,
                                                            const std::string& name,
                                                            const ImageReading& reading = {});
// Returns how many images the bytes of a file have: pages, parts or frames. Throws Error as
// DecodeImageFile does.
THICKLENS_EXPORT int PagesOfImage(const std::string& bytes, const std::string& name);
// Reads the file and decodes it as DecodeImageFile does. Throws Error that names the path.
THICKLENS_EXPORT DecodedImage ReadImageData(const std::string& path,
                                            const ImageReading& reading = {});

// Estimates the error of a JPEG file from its quantisation tables and from how many coefficients
// are 0: compression removes noise and fine details, so that the pixels show less noise than their
// error. Returns nothing for files that are no JPEG, damaged, or neither grey, RGB nor YCbCr.
THICKLENS_EXPORT std::optional<JpegError> MeasureJpegError(const std::string& bytes);

// Which numbers an image of integers has. `set_bits` is 0 for an image of zeros.
struct UsedBits {
  std::uint32_t highest = 0;   // the highest value
  std::uint32_t set_bits = 0;  // bitwise OR of all values
  // Index of the lowest set bit, 0 to 31; -1 if there is none.
  THICKLENS_EXPORT int LowestBit() const;
};
// Throws Error if the pixels are not unsigned integers of 8 or 16 bits.
THICKLENS_EXPORT UsedBits BitsOf(const cv::Mat& pixels);

// The kinds of files that are written.
enum class ImageFormat {
  kPng,   // 8 and 16 bits
  kJpeg,  // 8 bits, lossy
  kTiff,  // 8 and 16 bits, and floats
  kExr,   // linear light as floats
  kWebp,  // 8 bits, lossy unless the quality is 100
  kBmp,   // 8 bits
  kPnm,   // 8 and 16 bits
  kPfm,   // linear light as floats
};
// The kind that the ending of a file's name stands for: .png .jpg .jpeg .tif .tiff .exr .webp .bmp
// .pgm .ppm .pnm .pfm, in capitals or not. Throws Error that names the file and these endings. It
// also throws if the build cannot write the kind.
THICKLENS_EXPORT ImageFormat FormatOfName(const std::string& path);
// Whether the kind holds floats: EXR, PFM and TIFF do.
THICKLENS_EXPORT bool HoldsFloats(ImageFormat format);
// Whether the kind holds integers of that many bits, 8 or 16.
THICKLENS_EXPORT bool HoldsBits(ImageFormat format, int bits);
// "JPEG"
THICKLENS_EXPORT std::string NameOf(ImageFormat format);

// How an image is written.
struct ImageWriting {
  int jpeg_quality = 95;        // 1 to 100, also of WebP; 100 is lossless for WebP
  bool halves_colours = false;  // JPEG: colours at half resolution, for smaller files
  bool is_linear = false;       // the values are linear in light; TIFF and PNG then say so
  bool half_floats = false;     // EXR
  std::string description;      // PNG, JPEG, TIFF and EXR
  std::string icc_profile;      // PNG, JPEG and TIFF
};
// Returns the bytes of a file. The values are written as they are: whoever makes 8 bits of light
// says whether they are rounded or dithered. Grey, RGB or, in PNG, TIFF, EXR and WebP, RGBA with
// straight alpha. Throws Error if the kind does not hold the type of the values.
THICKLENS_EXPORT std::string EncodeImageFile(const cv::Mat& pixels, ImageFormat format,
                                             const ImageWriting& writing = {});

}  // namespace thicklens::io

#endif  // THICKLENS_IO_IMAGE_FILE_H_
