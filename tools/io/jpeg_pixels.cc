#include "tools/io/jpeg_pixels.h"

// libjpeg's header needs stdio's.
#include <cstdio>
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include <algorithm>
#include <array>
#include <cmath>
#include <csetjmp>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

// libjpeg reports errors by a function that may not return.
struct Failures {
  jpeg_error_mgr manager{};  // the first member: libjpeg knows only this part
  std::jmp_buf back{};
  char message[JMSG_LENGTH_MAX] = "";
};

Failures* FailuresOf(j_common_ptr info) {
  return reinterpret_cast<Failures*>(info->err);  // NOLINT: its first member
}

void Fail(j_common_ptr info) {
  info->err->format_message(info, FailuresOf(info)->message);
  std::longjmp(FailuresOf(info)->back, 1);  // NOLINT: C has no exceptions
}

// Damaged data would otherwise become grey pixels. A few bytes too many do no harm.
void Warn(j_common_ptr info, int level) {
  if (level >= 0) return;
  const int code = info->err->msg_code;
  if (code != JWRN_EXTRANEOUS_DATA && code != JWRN_ADOBE_XFORM && code != JWRN_JFIF_MAJOR)
    Fail(info);
}

void KeepStill(j_common_ptr /*info*/) {}

jpeg_error_mgr* Prepared(Failures* failures) {
  jpeg_error_mgr* const manager = jpeg_std_error(&failures->manager);
  manager->error_exit = Fail;
  manager->emit_message = Warn;
  manager->output_message = KeepStill;
  return manager;
}

struct Decompression {
  Failures failures;
  jpeg_decompress_struct info{};

  Decompression() {
    info.err = Prepared(&failures);
    jpeg_create_decompress(&info);
  }
  ~Decompression() { jpeg_destroy_decompress(&info); }
  Decompression(const Decompression&) = delete;
  Decompression& operator=(const Decompression&) = delete;
};

struct Compression {
  Failures failures;
  jpeg_compress_struct info{};
  unsigned char* file = nullptr;
  unsigned long size = 0;  // NOLINT: libjpeg's type

  Compression() {
    info.err = Prepared(&failures);
    jpeg_create_compress(&info);
  }
  ~Compression() {
    jpeg_destroy_compress(&info);
    std::free(file);  // NOLINT: libjpeg takes it by malloc
  }
  Compression(const Compression&) = delete;
  Compression& operator=(const Compression&) = delete;
};

// Between setjmp and the end of such a function there is no object with a destructor.
bool ReadHeader(const std::string& bytes, Decompression* jpeg) {
  if (setjmp(jpeg->failures.back) != 0) return false;                              // NOLINT
  jpeg_mem_src(&jpeg->info, reinterpret_cast<const unsigned char*>(bytes.data()),  // NOLINT
               static_cast<unsigned long>(bytes.size()));                          // NOLINT
  jpeg_save_markers(&jpeg->info, JPEG_COM, 0xFFFF);
  jpeg_read_header(&jpeg->info, TRUE);
  return true;
}

bool Start(Decompression* jpeg) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  jpeg->info.out_color_space = jpeg->info.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_start_decompress(&jpeg->info);
  return true;
}

bool ReadRow(Decompression* jpeg, std::uint8_t* row) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  JSAMPROW rows[] = {row};
  jpeg_read_scanlines(&jpeg->info, static_cast<JSAMPARRAY>(rows), 1);
  return true;
}

bool Finish(Decompression* jpeg) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  jpeg_finish_decompress(&jpeg->info);
  return true;
}

bool ReadCoefficients(Decompression* jpeg, jvirt_barray_ptr** planes) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  *planes = jpeg_read_coefficients(&jpeg->info);
  return true;
}

constexpr std::size_t kCoefficients = DCTSIZE2;

// In how many blocks each coefficient is quantised to other than 0, and to other than -1, 0, 1.
struct LevelCounts {
  std::array<double, kCoefficients> not_zero{}, beyond_one{};
};

// Counts one row of blocks.
bool CountRow(Decompression* jpeg, jvirt_barray_ptr plane, JDIMENSION row, JDIMENSION blocks,
              LevelCounts* counts) {
  if (setjmp(jpeg->failures.back) != 0) return false;              // NOLINT
  auto* const info = reinterpret_cast<j_common_ptr>(&jpeg->info);  // NOLINT: as libjpeg does
  JBLOCKARRAY rows = jpeg->info.mem->access_virt_barray(info, plane, row, 1, FALSE);
  for (JDIMENSION block = 0; block < blocks; ++block) {
    for (std::size_t k = 0; k < kCoefficients; ++k) {
      const int level = std::abs(rows[0][block][k]);  // NOLINT: libjpeg's arrays
      if (level > 0) ++counts->not_zero[k];
      if (level > 1) ++counts->beyond_one[k];
    }
  }
  return true;
}

// The distributions that the coefficients of a component probably had before they were quantised:
// in a share `active` of the blocks Laplace ones of the scale b = scale/f^fall at the frequency f =
// hypot(u, v), and in the others 0. Edges are in few blocks.
struct Spectrum {
  double active = 1, scale = 1, fall = 1;
};

double Frequency(std::size_t k) {
  return std::hypot(static_cast<double>(k / DCTSIZE), static_cast<double>(k % DCTSIZE));
}

// Finds the spectrum by the likelihood of the counts. Coefficients that are often other than 0 are
// many draws of one spectrum that is no exact power: each counts as a few of them.
Spectrum SpectrumOf(const std::array<double, kCoefficients>& steps, const LevelCounts& counts,
                    double blocks) {
  constexpr double kMaxDraws = 10, kMinShare = 1e-12;
  constexpr int kScales = 48, kFalls = 13;
  constexpr double kMinScale = 0.2, kMaxScale = 400, kFallStep = 1.0 / 3;
  Spectrum best;
  double most = -std::numeric_limits<double>::infinity();
  for (const double active : {0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.0}) {
    ThrowIfCancelled();
    for (int i = 0; i < kScales; ++i) {
      const double scale = kMinScale * std::pow(kMaxScale / kMinScale, i / (kScales - 1.0));
      for (int j = 0; j < kFalls; ++j) {
        double likelihood = 0;
        for (std::size_t k = 1; k < kCoefficients && likelihood > most; ++k) {
          if (!(steps[k] > 0)) continue;  // a broken table, which decodes to 0
          const double half_steps = steps[k] / (2 * scale) * std::pow(Frequency(k), kFallStep * j);
          const double outside = std::exp(-half_steps);
          const double first = active * outside, second = first * outside * outside;
          const double sum =
              (blocks - counts.not_zero[k]) * std::log(std::max(1 - first, kMinShare)) +
              (counts.not_zero[k] - counts.beyond_one[k]) *
                  std::log(std::max(first - second, std::numeric_limits<double>::min())) +
              counts.beyond_one[k] * std::log(std::max(second, std::numeric_limits<double>::min()));
          likelihood += sum * std::min(1.0, kMaxDraws / std::max(counts.not_zero[k], 1.0));
        }
        if (!(likelihood > most)) continue;
        most = likelihood;
        best = {active, scale, kFallStep * j};
      }
    }
  }
  return best;
}

// The part of the variance of a Laplace distribution of the scale b that is within q/2 of 0: what
// the coefficients lose that become 0.
double VarianceOfZeros(double b, double q) {
  return 2 * b * b - std::exp(-q / (2 * b)) * (q * q / 4 + q * b + 2 * b * b);
}

// Variance of the error that quantising the coefficients leaves in a pixel of the component, by
// [D126].
double QuantisationVariance(const std::array<double, kCoefficients>& steps,
                            const LevelCounts& counts, double blocks) {
  constexpr double kCoarse = 0.75;  // of the blocks: as if the coefficients were uniform
  constexpr double kMinDraws = 8;   // for a scale of its own
  constexpr double kNearlyAll = 1e-9;
  const Spectrum spectrum = SpectrumOf(steps, counts, blocks);
  double sum = 0;
  for (std::size_t k = 0; k < kCoefficients; ++k) {
    const double q = steps[k], uniform = q * q / 12;
    if (!(q > 0)) continue;
    const double share = counts.not_zero[k] / blocks;
    // The mean of a block follows no power of the frequency 0.
    const bool has_own = k == 0 || counts.not_zero[k] >= kMinDraws;
    const double active = k == 0 ? 1 : has_own ? std::max(spectrum.active, share) : spectrum.active;
    const double b =
        has_own ? q / (-2 * std::log(std::clamp(share / active, 0.5 / blocks, 1 - kNearlyAll)))
                : spectrum.scale / std::pow(Frequency(k), spectrum.fall);
    const double error = active * VarianceOfZeros(b, q) + share * uniform;
    sum += share > kCoarse ? uniform : std::min(error, uniform);
  }
  return sum / kCoefficients;
}

bool Begin(const cv::Mat& pixels, const ImageWriting& writing, Compression* jpeg) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  jpeg_mem_dest(&jpeg->info, &jpeg->file, &jpeg->size);
  jpeg->info.image_width = static_cast<JDIMENSION>(pixels.cols);
  jpeg->info.image_height = static_cast<JDIMENSION>(pixels.rows);
  jpeg->info.input_components = pixels.channels();
  jpeg->info.in_color_space = pixels.channels() == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&jpeg->info);
  jpeg_set_quality(&jpeg->info, std::clamp(writing.jpeg_quality, 1, 100), TRUE);
  if (!writing.halves_colours) {
    jpeg->info.comp_info[0].h_samp_factor = 1;
    jpeg->info.comp_info[0].v_samp_factor = 1;
  }
  jpeg_start_compress(&jpeg->info, TRUE);
  constexpr std::size_t kMaxMarker = 65533;
  if (!writing.icc_profile.empty()) {
    jpeg_write_icc_profile(&jpeg->info,
                           reinterpret_cast<const JOCTET*>(writing.icc_profile.data()),  // NOLINT
                           static_cast<unsigned>(writing.icc_profile.size()));
  }
  if (!writing.description.empty()) {
    jpeg_write_marker(&jpeg->info, JPEG_COM,
                      reinterpret_cast<const JOCTET*>(writing.description.data()),  // NOLINT
                      static_cast<unsigned>(std::min(writing.description.size(), kMaxMarker)));
  }
  return true;
}

bool WriteRow(const std::uint8_t* row, Compression* jpeg) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  JSAMPROW rows[] = {const_cast<JSAMPROW>(row)};       // NOLINT: libjpeg only reads them
  jpeg_write_scanlines(&jpeg->info, static_cast<JSAMPARRAY>(rows), 1);
  return true;
}

bool Finish(Compression* jpeg) {
  if (setjmp(jpeg->failures.back) != 0) return false;  // NOLINT
  jpeg_finish_compress(&jpeg->info);
  return true;
}

}  // namespace

DecodedImage DecodeJpeg(const std::string& bytes) {
  Decompression jpeg;
  const auto require = [&](bool done) {
    if (!done) throw Error(jpeg.failures.message);
  };
  require(ReadHeader(bytes, &jpeg));
  if (jpeg.info.num_components == 4 || jpeg.info.jpeg_color_space == JCS_CMYK ||
      jpeg.info.jpeg_color_space == JCS_YCCK) {
    throw Error("a JPEG file in CMYK, whose colours depend on inks: convert it to RGB");
  }
  if (jpeg.info.num_components != 1 && jpeg.info.num_components != 3)
    throw Error("a JPEG file of 2 channels, whose meaning is not known");
  require(Start(&jpeg));
  DecodedImage image;
  image.pixels.create(static_cast<int>(jpeg.info.output_height),
                      static_cast<int>(jpeg.info.output_width), CV_8UC(jpeg.info.num_components));
  for (int y = 0; y < image.pixels.rows; ++y) {
    ThrowIfCancelled();
    require(ReadRow(&jpeg, image.pixels.ptr(y)));
  }
  ImageFacts& facts = image.facts;
  facts.container_bits = 8;
  facts.full_scale = 255;
  facts.sample_type = "unsigned 8-bit integers";
  facts.channels = jpeg.info.num_components == 1 ? std::vector<std::string>{"Y"}
                                                 : std::vector<std::string>{"R", "G", "B"};
  for (const jpeg_marker_struct* marker = jpeg.info.marker_list; marker != nullptr;
       marker = marker->next) {
    if (marker->marker == JPEG_COM && facts.description.empty())
      facts.description.assign(reinterpret_cast<const char*>(marker->data),  // NOLINT: text
                               marker->data_length);
  }
  require(Finish(&jpeg));  // frees the markers
  return image;
}

std::optional<JpegError> MeasureJpegError(const std::string& bytes) {
  Decompression jpeg;
  jvirt_barray_ptr* planes = nullptr;
  if (!ReadHeader(bytes, &jpeg)) return std::nullopt;
  const bool is_grey = jpeg.info.num_components == 1;
  const bool is_rgb = jpeg.info.jpeg_color_space == JCS_RGB;
  if (!is_grey && !is_rgb && jpeg.info.jpeg_color_space != JCS_YCbCr) return std::nullopt;
  if (!ReadCoefficients(&jpeg, &planes)) return std::nullopt;
  // JFIF has R = Y + 1.402 Cr, G = Y - 0.344 Cb - 0.714 Cr, B = Y + 1.772 Cb. The first are the
  // means over red, green and blue of the variance that a unit variance of Y, Cb or Cr makes, the
  // others the variances of their mean, Y + 0.476 Cb + 0.229 Cr.
  constexpr std::array<double, 3> kOfYcc = {1, 1.086, 0.825}, kMeanOfYcc = {1, 0.2266, 0.0526};
  double mean = 0, all = 0;
  for (int c = 0; c < jpeg.info.num_components; ++c) {
    const jpeg_component_info& component = jpeg.info.comp_info[c];  // NOLINT: libjpeg's array
    if (component.quant_table == nullptr) return std::nullopt;
    std::array<double, kCoefficients> steps{};
    LevelCounts counts;
    std::copy(std::begin(component.quant_table->quantval),
              std::end(component.quant_table->quantval), steps.begin());
    for (JDIMENSION row = 0; row < component.height_in_blocks; ++row) {
      ThrowIfCancelled();
      if (!CountRow(&jpeg, planes[c], row, component.width_in_blocks, &counts))  // NOLINT
        return std::nullopt;
    }
    const double blocks = static_cast<double>(component.height_in_blocks) *
                          static_cast<double>(component.width_in_blocks);
    const double variance = QuantisationVariance(steps, counts, blocks);
    const auto which = static_cast<std::size_t>(c);
    all += is_rgb ? variance / 3 : kOfYcc[which] * variance;
    mean += is_rgb ? variance / 9 : kMeanOfYcc[which] * variance;
  }
  return JpegError{std::sqrt(mean), std::sqrt(all)};
}

std::string EncodeJpeg(const cv::Mat& pixels, const ImageWriting& writing) {
  Compression jpeg;
  const auto require = [&](bool done) {
    if (!done)
      throw Error(std::string("an image could not be encoded as JPEG: ") + jpeg.failures.message);
  };
  require(Begin(pixels, writing, &jpeg));
  for (int y = 0; y < pixels.rows; ++y) {
    ThrowIfCancelled();
    require(WriteRow(pixels.ptr(y), &jpeg));
  }
  require(Finish(&jpeg));
  return {reinterpret_cast<const char*>(jpeg.file), jpeg.size};  // NOLINT: bytes
}

}  // namespace thicklens::io
