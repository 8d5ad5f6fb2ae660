#include "model/simulate/scene/texture_canvas.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

// Number of rows that are transformed together: enough to share the set-up of the transform, few
// enough for the cache.
constexpr int kRowsAtOnce = 32;

// Detail decreases towards the limit of the band like that behind a Gaussian of this width, so that
// edges do not ring.
constexpr double kSoftnessPx = 0.5;

int QuickCount(double samples) {
  const int needed = static_cast<int>(std::ceil(samples * (1 - 1e-12)));
  return std::min(cv::getOptimalDFTSize(std::max(needed, 4)), kMaxTileSamples);
}

double SincSquared(double x) {
  if (x == 0) return 1;
  const double sinc = std::sin(kPi * x) / (kPi * x);
  return sinc * sinc;
}

}  // namespace

TextureCanvas MakeTextureCanvas(const Eigen::Vector2d& low_mm, const Eigen::Vector2d& high_mm,
                                double coarsest_pixel_mm, double unit_mm) {
  Eigen::Vector2d size_mm = high_mm - low_mm;
  if (unit_mm > 0) size_mm = unit_mm * (size_mm / unit_mm).array().ceil().max(1);
  const double spacing_mm =
      std::max(coarsest_pixel_mm / kSamplesPerPixel, size_mm.maxCoeff() / kMaxTileSamples);
  TextureCanvas canvas;
  canvas.columns = QuickCount(size_mm.x() / spacing_mm);
  canvas.rows = QuickCount(size_mm.y() / spacing_mm);
  canvas.spacing_mm = {spacing_mm, spacing_mm};
  if (unit_mm > 0) {
    canvas.spacing_mm = {size_mm.x() / canvas.columns, size_mm.y() / canvas.rows};
  }
  canvas.origin_mm = low_mm;
  for (cv::Mat& channel : canvas.light) {
    channel = cv::Mat(canvas.rows, canvas.columns, CV_32F, cv::Scalar(0));
  }
  return canvas;
}

void FilterSamples(const TextureCanvas& canvas, double highest_per_mm,
                   const std::function<double(double fx, double fy)>& gain, int threads,
                   cv::Mat* samples) {
  const int rows = canvas.rows, columns = canvas.columns;
  // The highest frequency of an even count has no phase of its own and is left out.
  const auto last_below = [&](double length_mm, int count) {
    return static_cast<int>(std::min(std::floor(highest_per_mm * length_mm), (count - 1) / 2.0));
  };
  const int last_x = last_below(canvas.width_mm(), columns);
  const int last_y = last_below(canvas.height_mm(), rows);
  const auto in_blocks = [&](int count, const std::function<void(const cv::Range&)>& work) {
    ParallelFor((count + kRowsAtOnce - 1) / kRowsAtOnce, threads, [&](int block) {
      work({block * kRowsAtOnce, std::min((block + 1) * kRowsAtOnce, count)});
    });
  };

  cv::Mat spectrum(last_x + 1, rows, CV_32FC2);  // a row for each fx; its columns are first y, then
                                                 // fy
  in_blocks(rows, [&](const cv::Range& range) {
    cv::Mat packed;  // format of a row: Re 0, Re 1, Im 1, Re 2, ..
    cv::dft(samples->rowRange(range), packed, cv::DFT_ROWS);
    for (int a = 0; a <= last_x; ++a) {
      auto* column = spectrum.ptr<std::complex<float>>(a) + range.start;
      for (int i = 0; i < packed.rows; ++i) {
        const float* row = packed.ptr<float>(i);
        column[i] = a == 0 ? row[0] : std::complex<float>(row[2 * a - 1], row[2 * a]);
      }
    }
  });
  in_blocks(last_x + 1, [&](const cv::Range& range) {
    cv::Mat part = spectrum.rowRange(range);
    cv::dft(part, part, cv::DFT_ROWS);
    for (int i = 0; i < part.rows; ++i) {
      auto* row = part.ptr<std::complex<float>>(i);
      const double fx = (range.start + i) / canvas.width_mm();
      for (int b = 0; b <= last_y; ++b) {
        const auto factor =
            static_cast<float>(gain(fx, b / canvas.height_mm()) / (columns * 1.0 * rows));
        row[b] *= factor;
        if (b > 0) row[rows - b] *= factor;
      }
      std::fill(row + last_y + 1, row + rows - last_y, 0.0F);
    }
    cv::dft(part, part, cv::DFT_INVERSE | cv::DFT_ROWS);
  });
  in_blocks(rows, [&](const cv::Range& range) {
    cv::Mat packed(range.size(), columns, CV_32F, cv::Scalar(0));
    for (int a = 0; a <= last_x; ++a) {
      const auto* column = spectrum.ptr<std::complex<float>>(a) + range.start;
      for (int i = 0; i < packed.rows; ++i) {
        float* row = packed.ptr<float>(i);
        if (a > 0) row[2 * a - 1] = column[i].real();
        row[2 * a] = a > 0 ? column[i].imag() : column[i].real();
      }
    }
    cv::dft(packed, samples->rowRange(range), cv::DFT_INVERSE | cv::DFT_ROWS | cv::DFT_REAL_OUTPUT);
  });
}

void LimitBand(double coarsest_pixel_mm, int threads, TextureCanvas* canvas) {
  // Linear interpolation between the samples has the transfer sinc^2(spacing f) on each axis.
  const auto gain = [&](double fx_per_mm, double fy_per_mm) {
    const double f2 =
        (fx_per_mm * fx_per_mm + fy_per_mm * fy_per_mm) * coarsest_pixel_mm * coarsest_pixel_mm;
    if (f2 >= kHighestFrequency * kHighestFrequency) return 0.0;
    return std::exp(-2 * kPi * kPi * kSoftnessPx * kSoftnessPx * f2) /
           (SincSquared(fx_per_mm * canvas->spacing_mm.x()) *
            SincSquared(fy_per_mm * canvas->spacing_mm.y()));
  };
  for (cv::Mat& channel : canvas->light) {
    FilterSamples(*canvas, kHighestFrequency / coarsest_pixel_mm, gain, threads, &channel);
  }
}

}  // namespace thicklens::model
