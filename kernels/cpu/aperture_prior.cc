#include "thicklens/kernels/aperture_prior.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "kernels/cpu/lanes.h"
#include "kernels/cpu/processor.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"

namespace thicklens::kernels {
namespace {

constexpr std::size_t kPacket = AperturePrior<float>::kPacket;
// Number of points for one call of ParallelFor's work.
constexpr std::size_t kChunk = 256 * kPacket;
constexpr int kMaxSamples = 64;  // along an axis

// Orthonormal DCT-II of one axis. Even functions need only the sums of the samples at the same
// distance from the middle, odd ones only the differences: `values` has count x (count + 1)/2
// numbers.
template <typename Real>
struct Transform {
  int count;
  const Real* values;
};

// The loops. kCount is the count of samples where the compiler knows it and keeps the samples in
// registers; otherwise it is 0.

// Transforms x in place, kLanes points, `stride` from sample to sample.
template <int kCount, typename Real>
inline __attribute__((always_inline)) void Forward(const Transform<Real>& transform,
                                                   std::ptrdiff_t stride, Real* x) {
  const int count = kCount > 0 ? kCount : transform.count;
  const int half = (count + 1) / 2, pairs = count / 2;
  Lanes<Real> sums[kCount > 0 ? kCount : kMaxSamples];
  Lanes<Real> differences[kCount > 0 ? kCount : kMaxSamples];
#pragma GCC unroll 8
  for (int k = 0; k < pairs; ++k) {
    Lanes<Real> a, b;
    Load(x + k * stride, &a);
    Load(x + (count - 1 - k) * stride, &b);
    sums[k] = a + b;
    differences[k] = a - b;
  }
  if (half > pairs) Load(x + pairs * stride, &sums[pairs]);
#pragma GCC unroll 8
  for (int i = 0; i < half; ++i) {
    const Real* even = transform.values + 2 * i * half;
    Lanes<Real> total{};
#pragma GCC unroll 8
    for (int k = 0; k < half; ++k) total += even[k] * sums[k];
    Store(total, x + 2 * i * stride);
  }
#pragma GCC unroll 8
  for (int i = 0; i < pairs; ++i) {
    const Real* odd = transform.values + (2 * i + 1) * half;
    Lanes<Real> total{};
#pragma GCC unroll 8
    for (int k = 0; k < pairs; ++k) total += odd[k] * differences[k];
    Store(total, x + (2 * i + 1) * stride);
  }
}

template <int kCount, typename Real>
inline __attribute__((always_inline)) void Backward(const Transform<Real>& transform,
                                                    std::ptrdiff_t stride, Real* x) {
  const int count = kCount > 0 ? kCount : transform.count;
  const int half = (count + 1) / 2, pairs = count / 2;
  Lanes<Real> waves[kCount > 0 ? kCount : kMaxSamples];
#pragma GCC unroll 16
  for (int i = 0; i < count; ++i) Load(x + i * stride, &waves[i]);
#pragma GCC unroll 8
  for (int k = 0; k < half; ++k) {
    Lanes<Real> even{}, odd{};
#pragma GCC unroll 8
    for (int i = 0; i < half; ++i) even += transform.values[2 * i * half + k] * waves[2 * i];
#pragma GCC unroll 8
    for (int i = 0; i < pairs; ++i) {
      odd += transform.values[(2 * i + 1) * half + k] * waves[2 * i + 1];
    }
    Store(even + odd, x + k * stride);
    if (k < pairs) Store(even - odd, x + (count - 1 - k) * stride);
  }
}

template <typename Real>
struct PacketJob {
  Transform<Real> across, down;
  const Real* inverse_eigenvalues;
  std::size_t stride;
  Real* work;  // V x U packets
};

template <int kCount, typename Real>
inline __attribute__((always_inline)) void Invert(const PacketJob<Real>& job, std::size_t point,
                                                  Real* planes) {
  const int u_count = kCount > 0 ? kCount : job.across.count;
  const int v_count = kCount > 0 ? kCount : job.down.count;
  constexpr auto kStep = static_cast<std::ptrdiff_t>(kPacket);
  const auto plane = [&](int l, int k) {
    return planes + Index(l * u_count + k) * job.stride + point;
  };
  for (int l = 0; l < v_count; ++l) {
    Real* row = job.work + l * u_count * kStep;
    for (int k = 0; k < u_count; ++k) {
      __builtin_memcpy(row + k * kStep, plane(l, k), kPacket * sizeof(Real));
    }
    for (std::size_t p = 0; p < kPacket; p += kLanes) Forward<kCount>(job.across, kStep, row + p);
  }
  for (int k = 0; k < u_count; ++k) {
    Real* column = job.work + k * kStep;
    for (std::size_t p = 0; p < kPacket; p += kLanes) {
      Forward<kCount>(job.down, u_count * kStep, column + p);
      for (int l = 0; l < v_count; ++l) {
        Real* value = column + l * u_count * kStep + p;
        Lanes<Real> wave;
        Load(value, &wave);
        Store(job.inverse_eigenvalues[l * u_count + k] * wave, value);
      }
      Backward<kCount>(job.down, u_count * kStep, column + p);
    }
  }
  for (int l = 0; l < v_count; ++l) {
    Real* row = job.work + l * u_count * kStep;
    for (std::size_t p = 0; p < kPacket; p += kLanes) Backward<kCount>(job.across, kStep, row + p);
    for (int k = 0; k < u_count; ++k) {
      __builtin_memcpy(plane(l, k), row + k * kStep, kPacket * sizeof(Real));
    }
  }
}

template <int kCount, typename Real>
inline __attribute__((always_inline)) void InvertAll(const PacketJob<Real>& job, std::size_t first,
                                                     std::size_t last, Real* planes) {
  for (std::size_t point = first; point < last; point += kPacket) {
    Invert<kCount>(job, point, planes);
  }
}

template <typename Real>
inline __attribute__((always_inline)) void InvertPackets(const PacketJob<Real>& job,
                                                         std::size_t first, std::size_t last,
                                                         Real* planes) {
  const int square = job.across.count == job.down.count ? job.across.count : 0;
  switch (square) {
    case 3:
      return InvertAll<3>(job, first, last, planes);
    case 5:
      return InvertAll<5>(job, first, last, planes);
    case 7:
      return InvertAll<7>(job, first, last, planes);
    case 9:
      return InvertAll<9>(job, first, last, planes);
    case 11:
      return InvertAll<11>(job, first, last, planes);
    default:
      return InvertAll<0>(job, first, last, planes);
  }
}

#if defined(__x86_64__)
template <typename Real>
__attribute__((target("avx2,fma"))) void InvertPacketsAvx2(const PacketJob<Real>& job,
                                                           std::size_t first, std::size_t last,
                                                           Real* planes) {
  InvertPackets(job, first, last, planes);
}
#endif

template <typename Real>
void InvertPacketsHere(const PacketJob<Real>& job, std::size_t first, std::size_t last,
                       Real* planes) {
#if defined(__x86_64__)
  if (HasAvx2AndFma()) {
    return InvertPacketsAvx2(job, first, last, planes);
  }
#endif
  InvertPackets(job, first, last, planes);
}

double Eigenvalue(int i, int count) {
  const double sine = std::sin(kPi * i / (2.0 * count));
  return 4 * sine * sine;
}

template <typename Real>
std::vector<Real> TransformOf(int count) {
  std::vector<Real> values;
  for (int i = 0; i < count; ++i) {
    const double scale = std::sqrt((i == 0 ? 1.0 : 2.0) / count);
    for (int k = 0; k < (count + 1) / 2; ++k) {
      values.push_back(static_cast<Real>(scale * std::cos(kPi * i * (k + 0.5) / count)));
    }
  }
  return values;
}

}  // namespace

template <typename Real>
AperturePrior<Real>::AperturePrior(int u_count, int v_count, double gamma, double mu)
    : u_count_(u_count), v_count_(v_count) {
  if (std::max(u_count, v_count) > kMaxSamples) {
    throw Error(fmt::format("views are {}x{}: each count must be at most {}", u_count, v_count,
                            kMaxSamples));
  }
  across_ = TransformOf<Real>(u_count);
  down_ = TransformOf<Real>(v_count);
  for (int j = 0; j < v_count; ++j) {
    for (int i = 0; i < u_count; ++i) {
      inverse_eigenvalues_.push_back(
          static_cast<Real>(1 / (gamma * (Eigenvalue(i, u_count) + Eigenvalue(j, v_count)) + mu)));
    }
  }
}

template <typename Real>
void AperturePrior<Real>::ApplyInverse(std::size_t points, std::size_t stride, int threads,
                                       Real* planes) {
  const std::size_t chunks = (points + kChunk - 1) / kChunk;
  const std::size_t room = inverse_eigenvalues_.size() * kPacket;
  work_.resize(chunks * room);
  ParallelFor(static_cast<int>(chunks), threads, [&](int n) {
    const PacketJob<Real> job{{u_count_, across_.data()},
                              {v_count_, down_.data()},
                              inverse_eigenvalues_.data(),
                              stride,
                              work_.data() + Index(n) * room};
    InvertPacketsHere(job, Index(n) * kChunk, std::min(points, (Index(n) + 1) * kChunk), planes);
  });
}

template class AperturePrior<float>;
template class AperturePrior<double>;

}  // namespace thicklens::kernels
