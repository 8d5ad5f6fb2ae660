#include "thicklens/kernels/photograph_loops.h"

#include "kernels/cpu/processor.h"

namespace thicklens::kernels {
namespace {

// Size of a register of AVX2. kVectors sums stay in registers over all taps: each ray is read once,
// and the photograph is updated once for a whole row of views.
constexpr std::size_t kVectorBytes = 32, kVectors = 8;
template <typename Real>
constexpr std::size_t kOfVector = kVectorBytes / sizeof(Real);
template <typename Real>
struct VectorOf {
  typedef Real Type __attribute__((vector_size(kVectorBytes)));
  typedef float Floats __attribute__((vector_size(kOfVector<Real> * sizeof(float))));
};

template <typename T>
inline __attribute__((always_inline)) void Load(const void* from, T* to) {
  __builtin_memcpy(to, from, sizeof(T));
}
template <typename T>
inline __attribute__((always_inline)) void Store(const T& from, void* to) {
  __builtin_memcpy(to, &from, sizeof(T));
}

// Loads one number, or as many as a vector has.
template <typename Real>
inline __attribute__((always_inline)) void LoadFloats(const float* from, Real* to) {
  *to = static_cast<Real>(*from);
}
template <typename Real>
inline __attribute__((always_inline)) void LoadFloats(const float* from,
                                                      typename VectorOf<Real>::Type* to) {
  typename VectorOf<Real>::Floats floats;
  Load(from, &floats);
  *to = __builtin_convertvector(floats, typename VectorOf<Real>::Type);
}

template <typename Real>
struct Taps {
  const std::vector<PixelTap<Real>>& taps;
  const Real* rays;
  std::size_t row_start;
  const std::array<SharedRow<Real>, 2>& rows;
};

// Sums the taps of the pixels from x on: `count` values of the type Value, which is Real or a
// vector of it.
template <bool kHasIrradiance, std::size_t count, typename Value, typename Real>
inline __attribute__((always_inline)) void SumTaps(const Taps<Real>& of, std::size_t x,
                                                   Value (&sums)[count]) {
  constexpr std::size_t kStep = sizeof(Value) / sizeof(Real);
  for (Value& sum : sums) sum = Value{};
  for (const PixelTap<Real>& tap : of.taps) {
    const std::size_t sample = of.row_start + x + static_cast<std::size_t>(tap.sample_of_first);
    const Real* const rays = of.rays + tap.view_start + sample;
    for (std::size_t i = 0; i < count; ++i) {
      Value ray;
      Load(rays + i * kStep, &ray);
      if constexpr (kHasIrradiance) {
        Value irradiance;
        LoadFloats<Real>(tap.irradiance + sample + i * kStep, &irradiance);
        ray *= irradiance;
      }
      sums[i] += tap.weight * ray;
    }
  }
}

template <bool kHasIrradiance, typename Value, std::size_t count, typename Real>
inline __attribute__((always_inline)) void AddStrip(const Taps<Real>& of, std::size_t x) {
  constexpr std::size_t kStep = sizeof(Value) / sizeof(Real);
  Value sums[count];
  SumTaps<kHasIrradiance>(of, x, sums);
  for (const SharedRow<Real>& row : of.rows) {
    if (row.pixels == nullptr) continue;
    for (std::size_t i = 0; i < count; ++i) {
      Value pixel;
      Load(row.pixels + x + i * kStep, &pixel);
      pixel += row.share * sums[i];
      Store(pixel, row.pixels + x + i * kStep);
    }
  }
}

// Adds the last `rest` pixels before `end`, less than a strip, using the sums of the strip that
// ends there.
template <bool kHasIrradiance, typename Value, std::size_t count, typename Real>
inline __attribute__((always_inline)) void AddRest(const Taps<Real>& of, std::size_t end,
                                                   std::size_t rest) {
  constexpr std::size_t kOfStrip = count * sizeof(Value) / sizeof(Real);
  Value sums[count];
  SumTaps<kHasIrradiance>(of, end - kOfStrip, sums);
  Real numbers[kOfStrip];
  Store(sums, numbers);
  for (const SharedRow<Real>& row : of.rows) {
    if (row.pixels == nullptr) continue;
    for (std::size_t i = 1; i <= rest; ++i) {
      row.pixels[end - i] += row.share * numbers[kOfStrip - i];
    }
  }
}

template <bool kHasIrradiance, typename Real>
inline __attribute__((always_inline)) void AddStrips(const Taps<Real>& taps, std::size_t begin,
                                                     std::size_t end) {
  using Vector = typename VectorOf<Real>::Type;
  constexpr std::size_t kStep = kOfVector<Real>, kStrip = kVectors * kStep;
  std::size_t x = begin;
  if (end - begin >= kStrip) {
    for (; x + kStrip <= end; x += kStrip) AddStrip<kHasIrradiance, Vector, kVectors>(taps, x);
    if (x < end) AddRest<kHasIrradiance, Vector, kVectors>(taps, end, end - x);
  } else if (end - begin >= kStep) {
    for (; x + kStep <= end; x += kStep) AddStrip<kHasIrradiance, Vector, 1>(taps, x);
    if (x < end) AddRest<kHasIrradiance, Vector, 1>(taps, end, end - x);
  } else {
    for (; x < end; ++x) AddStrip<kHasIrradiance, Real, 1>(taps, x);
  }
}

template <typename Real>
inline __attribute__((always_inline)) void AllTaps(const Taps<Real>& taps, std::size_t begin,
                                                   std::size_t end) {
  if (taps.taps.front().irradiance == nullptr) {
    AddStrips<false>(taps, begin, end);
  } else {
    AddStrips<true>(taps, begin, end);
  }
}

// Adds to the rays from i on, as many as a Value has.
template <bool kHasIrradiance, typename Value, std::size_t kPixels, typename Real>
inline __attribute__((always_inline)) void AddPixelsTo(const RayPixel<Real> (&pixels)[kPixels],
                                                       const float* irradiance, std::size_t i,
                                                       Real* rays) {
  Value sum = {}, value;
  for (const RayPixel<Real>& of : pixels) {
    Load(of.pixel + i, &value);
    sum += of.weight * value;
  }
  if constexpr (kHasIrradiance) {
    LoadFloats<Real>(irradiance + i, &value);
    sum *= value;
  }
  Load(rays + i, &value);
  value += sum;
  Store(value, rays + i);
}

template <bool kHasIrradiance, std::size_t kPixels, typename Real>
inline __attribute__((always_inline)) void AddPixelsOf(const std::vector<RayPixel<Real>>& given,
                                                       const float* irradiance, std::size_t count,
                                                       Real* rays) {
  RayPixel<Real> pixels[kPixels];  // a copy that no store to a ray changes
  for (std::size_t i = 0; i < kPixels; ++i) pixels[i] = given[i];
  std::size_t i = 0;
  for (; i + kOfVector<Real> <= count; i += kOfVector<Real>) {
    AddPixelsTo<kHasIrradiance, typename VectorOf<Real>::Type>(pixels, irradiance, i, rays);
  }
  for (; i < count; ++i) AddPixelsTo<kHasIrradiance, Real>(pixels, irradiance, i, rays);
}

template <bool kHasIrradiance, typename Real>
inline __attribute__((always_inline)) void AnyPixels(const std::vector<RayPixel<Real>>& pixels,
                                                     const float* irradiance, std::size_t count,
                                                     Real* rays) {
  switch (pixels.size()) {
    case 1:
      return AddPixelsOf<kHasIrradiance, 1>(pixels, irradiance, count, rays);
    case 2:
      return AddPixelsOf<kHasIrradiance, 2>(pixels, irradiance, count, rays);
    case 3:
      return AddPixelsOf<kHasIrradiance, 3>(pixels, irradiance, count, rays);
    default:
      return AddPixelsOf<kHasIrradiance, 4>(pixels, irradiance, count, rays);
  }
}

template <typename Real>
inline __attribute__((always_inline)) void AllPixels(const std::vector<RayPixel<Real>>& pixels,
                                                     const float* irradiance, std::size_t count,
                                                     Real* rays) {
  if (irradiance == nullptr) return AnyPixels<false>(pixels, irradiance, count, rays);
  AnyPixels<true>(pixels, irradiance, count, rays);
}

#if defined(__x86_64__)

template <typename Real>
__attribute__((target("avx2,fma"))) void AllTapsAvx2(const Taps<Real>& taps, std::size_t begin,
                                                     std::size_t end) {
  AllTaps(taps, begin, end);
}

template <typename Real>
__attribute__((target("avx2,fma"))) void AllPixelsAvx2(const std::vector<RayPixel<Real>>& pixels,
                                                       const float* irradiance, std::size_t count,
                                                       Real* rays) {
  AllPixels(pixels, irradiance, count, rays);
}

#endif

}  // namespace

template <typename Real>
void AddTaps(const std::vector<PixelTap<Real>>& taps, const Real* rays, std::size_t row_start,
             std::size_t begin, std::size_t end, const std::array<SharedRow<Real>, 2>& rows) {
  if (taps.empty()) return;
  const Taps<Real> all{taps, rays, row_start, rows};
#if defined(__x86_64__)
  if (HasAvx2AndFma()) return AllTapsAvx2(all, begin, end);
#endif
  AllTaps(all, begin, end);
}

template <typename Real>
void AddPixels(const std::vector<RayPixel<Real>>& pixels, const float* irradiance,
               std::size_t count, Real* rays) {
#if defined(__x86_64__)
  if (HasAvx2AndFma()) return AllPixelsAvx2(pixels, irradiance, count, rays);
#endif
  AllPixels(pixels, irradiance, count, rays);
}

template void AddTaps(const std::vector<PixelTap<float>>&, const float*, std::size_t, std::size_t,
                      std::size_t, const std::array<SharedRow<float>, 2>&);
template void AddTaps(const std::vector<PixelTap<double>>&, const double*, std::size_t, std::size_t,
                      std::size_t, const std::array<SharedRow<double>, 2>&);
template void AddPixels(const std::vector<RayPixel<float>>&, const float*, std::size_t, float*);
template void AddPixels(const std::vector<RayPixel<double>>&, const float*, std::size_t, double*);

}  // namespace thicklens::kernels
