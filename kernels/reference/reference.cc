#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "kernels/reference/arguments.h"
#include "kernels/reference/splat.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/sparse.h"

namespace thicklens::kernels {
namespace {

// Displacements of more samples than this leave every block.
constexpr int kFarAway = 1 << 30;

// Returns the number of a ray (see BlockGeometry).
std::int32_t RayNumber(const BlockGeometry& block, int k, int l, int x, int y) {
  return (l * block.u_count + k) * block.pixels() + y * block.width_px + x;
}

// Returns the ray of view (k, l) nearest to the block's pixel (x, y), or -1.
std::int32_t RayAt(const BlockGeometry& block, int k, int l, int x, int y) {
  if (k < 0 || k >= block.u_count || l < 0 || l >= block.v_count) return -1;
  if (x < 0 || x >= block.width_px || y < 0 || y >= block.height_px) return -1;
  return block.Exists(k, l, x, y) ? RayNumber(block, k, l, x, y) : -1;
}

// Returns the shift by which sample s + step of view `to` has the number x + step + shift, if
// sample s of view `from` has the number x.
int ShiftBetween(const std::vector<int>& shift, int from, int to) {
  return to < 0 || to >= static_cast<int>(shift.size()) ? 0 : shift[Index(to)] - shift[Index(from)];
}

// Writes the slots of one row in turn.
template <typename Real>
class RowWriter {
 public:
  RowWriter(EllMatrix<Real>* matrix, int row) : matrix_(matrix), at_(Index(row)) {}

  void Put(std::int32_t column, Real value) {
    matrix_->column[at_] = column;
    matrix_->value[at_] = value;
    at_ += Index(matrix_->rows);
  }

 private:
  EllMatrix<Real>* matrix_;
  std::size_t at_;
};

template <typename Real>
EllMatrix<Real> EmptyEll(int rows, int columns, int slots) {
  const std::size_t entries = Index(rows) * Index(slots);
  return {rows, columns, slots, std::vector<std::int32_t>(entries, -1),
          std::vector<Real>(entries, Real{0})};
}

// Calls visit(k, l, x, y) for every ray that exists, in the order of their numbers.
template <typename Visit>
void ForEachRay(const BlockGeometry& block, const Visit& visit) {
  for (int l = 0; l < block.v_count; ++l) {
    for (int k = 0; k < block.u_count; ++k) {
      for (int y = 0; y < block.height_px; ++y) {
        for (int x = 0; x < block.width_px; ++x) {
          if (block.Exists(k, l, x, y)) visit(k, l, x, y);
        }
      }
    }
  }
}

// Splits a slope into whole samples and the rest. Returns false for NaN and for slopes that are too
// large.
template <typename Real>
bool SplitSlope(Real slope, int* whole, Real* rest) {
  const Real floored = std::floor(slope);
  if (!(std::abs(floored) < static_cast<Real>(kFarAway))) return false;
  *whole = static_cast<int>(floored);
  *rest = slope - floored;
  return true;
}

// Writes one row of D: -1 at the ray, 1 - w and w at the next view's samples around it.
template <typename Real>
void PutDifference(std::int32_t ray, std::int32_t tap0, std::int32_t tap1, Real rest,
                   RowWriter<Real>* row) {
  const Real share = Real{1} - rest;
  if ((share != 0 && tap0 < 0) || (rest != 0 && tap1 < 0)) return;
  row->Put(ray, Real{-1});
  row->Put(share != 0 ? tap0 : -1, share != 0 ? share : Real{0});
  row->Put(rest != 0 ? tap1 : -1, rest);
}

// The eight neighbours of a ray in one plane, (s, u) or (t, v), and their weights in
//   m^2 L_ss + 2 m L_su + L_uu,
// as (step along the samples, step along the views, weight).
template <typename Real>
struct Neighbour {
  int samples;
  int views;
  Real weight;
};
template <typename Real>
std::vector<Neighbour<Real>> NeighboursOf(Real slope) {
  const Real along = slope * slope;
  const Real across = slope / 2;  // 2 m over the 4 of the diagonal difference
  return {{-1, 0, along},   {1, 0, along},    {0, -1, Real{1}}, {0, 1, Real{1}},
          {-1, -1, across}, {1, -1, -across}, {-1, 1, -across}, {1, 1, across}};
}

template <typename Real>
class Reference : public Kernels<Real> {
 public:
  std::unique_ptr<Kernels<Real>> Clone() const override { return NewReference<Real>(); }

  std::vector<std::int32_t> FindRays(const BlockGeometry& block, Splat splat) override {
    CheckRayNumbers(block, 1);
    const int taps = TapCount(splat);
    std::vector<std::int32_t> rays;
    rays.reserve(Index(RaySlots(block, splat)) * Index(block.pixels()));
    for (int l = 0; l < block.v_count; ++l) {
      for (int k = 0; k < block.u_count; ++k) {
        for (int tap_y = 0; tap_y < taps; ++tap_y) {
          const auto in_y = TapOf<Real>(splat, block.t_fraction[Index(l)], tap_y);
          for (int tap_x = 0; tap_x < taps; ++tap_x) {
            const auto in_x = TapOf<Real>(splat, block.s_fraction[Index(k)], tap_x);
            const bool arrives = in_x.share != 0 && in_y.share != 0;
            for (int y = 0; y < block.height_px; ++y) {
              for (int x = 0; x < block.width_px; ++x) {
                rays.push_back(arrives ? RayAt(block, k, l, x + in_x.offset, y + in_y.offset) : -1);
              }
            }
          }
        }
      }
    }
    return rays;
  }

  // [M16]: H(x, ray) = E(ray) H0(x, ray) / sum over rays of H0(x, ray), H0 = view weight * g.
  EllMatrix<Real> WeightRays(const BlockGeometry& block, Splat splat,
                             const std::vector<std::int32_t>& rays,
                             const std::vector<Real>& irradiance) override {
    CheckRayNumbers(block, 1);
    CheckRays(block, splat, rays);
    if (!irradiance.empty()) CheckSize("irradiance", irradiance.size(), Index(block.rays()));
    auto h = EmptyEll<Real>(block.pixels(), block.rays(), RaySlots(block, splat));
    const std::vector<Real> weights = SlotWeights<Real>(block, splat);

    const std::size_t pixels = Index(block.pixels());
    std::vector<Real> sums(pixels, Real{0});
    for (std::size_t e = 0; e < rays.size(); ++e) {
      if (rays[e] >= 0) sums[e % pixels] += weights[e / pixels];
    }
    for (std::size_t e = 0; e < rays.size(); ++e) {
      const Real weight = weights[e / pixels];
      if (rays[e] < 0 || weight == 0) continue;
      h.column[e] = rays[e];
      h.value[e] = weight / sums[e % pixels];
      if (!irradiance.empty()) h.value[e] *= irradiance[Index(rays[e])];
    }
    return h;
  }

  // [D111] (D L)(i, k) = L(i + m, k + 1) - L(i, k)
  //   = (1 - w) L(i + n, k + 1) + w L(i + n + 1, k + 1) - L(i, k), n = floor(m), w = m - n.
  EllMatrix<Real> WarpDifferences(const BlockGeometry& block, const std::vector<Real>& slope_u,
                                  const std::vector<Real>& slope_v) override {
    CheckSlopes(block, 2, slope_u.size(), slope_v.size());
    const int rays = block.rays();
    auto d = EmptyEll<Real>(2 * rays, rays, 3);
    ForEachRay(block, [&](int k, int l, int x, int y) {
      const std::int32_t ray = RayNumber(block, k, l, x, y);
      int whole = 0;
      Real rest = 0;
      if (SplitSlope(slope_u[Index(ray)], &whole, &rest)) {
        const int next_x = x + ShiftBetween(block.s_shift, k, k + 1) + whole;
        RowWriter<Real> row(&d, ray);
        PutDifference(ray, RayAt(block, k + 1, l, next_x, y), RayAt(block, k + 1, l, next_x + 1, y),
                      rest, &row);
      }
      if (SplitSlope(slope_v[Index(ray)], &whole, &rest)) {
        const int next_y = y + ShiftBetween(block.t_shift, l, l + 1) + whole;
        RowWriter<Real> row(&d, rays + ray);
        PutDifference(ray, RayAt(block, k, l + 1, x, next_y), RayAt(block, k, l + 1, x, next_y + 1),
                      rest, &row);
      }
    });
    return d;
  }

  EllMatrix<Real> SixTermMasks(const BlockGeometry& block, const std::vector<Real>& slope_u,
                               const std::vector<Real>& slope_v) override {
    CheckSlopes(block, 1, slope_u.size(), slope_v.size());
    auto g = EmptyEll<Real>(block.rays(), block.rays(), 17);
    ForEachRay(block, [&](int k, int l, int x, int y) {
      const std::int32_t ray = RayNumber(block, k, l, x, y);
      const Real m = slope_u[Index(ray)];
      const Real n = slope_v[Index(ray)];
      if (!std::isfinite(m) || !std::isfinite(n)) return;
      Real centre = -2 * m * m - 2 - 2 * n * n - 2;
      RowWriter<Real> row(&g, ray);
      row.Put(ray, 0);
      const auto put = [&](std::int32_t neighbour, Real weight) {
        if (neighbour < 0) centre += weight;
        row.Put(neighbour, neighbour < 0 ? Real{0} : weight);
      };
      for (const auto& at : NeighboursOf(m)) {
        const int shift = ShiftBetween(block.s_shift, k, k + at.views);
        put(RayAt(block, k + at.views, l, x + at.samples + shift, y), at.weight);
      }
      for (const auto& at : NeighboursOf(n)) {
        const int shift = ShiftBetween(block.t_shift, l, l + at.views);
        put(RayAt(block, k, l + at.views, x, y + at.samples + shift), at.weight);
      }
      g.value[Index(ray)] = centre;
    });
    return g;
  }

  // Computes y_i = sum_j A_ij x_j, columns ascending.
  std::vector<Real> Multiply(const CsrMatrix<Real>& a, const std::vector<Real>& x) override {
    CheckCsr(a);
    CheckSize("vector to be multiplied", x.size(), Index(a.columns));
    std::vector<Real> y(Index(a.rows));
    for (std::size_t i = 0; i < y.size(); ++i) {
      Real sum = 0;
      for (std::int64_t e = a.row_start[i]; e < a.row_start[i + 1]; ++e) {
        sum += a.value[Index(e)] * x[Index(a.column[Index(e)])];
      }
      y[i] = sum;
    }
    return y;
  }

  // Computes y_j = sum_i A_ij x_i, rows ascending.
  std::vector<Real> MultiplyTransposed(const CsrMatrix<Real>& a,
                                       const std::vector<Real>& x) override {
    CheckCsr(a);
    CheckSize("vector to be multiplied", x.size(), Index(a.rows));
    std::vector<Real> y(Index(a.columns), Real{0});
    for (std::size_t i = 0; i < x.size(); ++i) {
      for (std::int64_t e = a.row_start[i]; e < a.row_start[i + 1]; ++e) {
        y[Index(a.column[Index(e)])] += a.value[Index(e)] * x[i];
      }
    }
    return y;
  }

  // Computes N_ij += scale * sum_r A_ri A_rj, r ascending: row i of N gathers the rows of A that
  // have an entry in column i.
  void AddNormalProduct(const CsrMatrix<Real>& a, Real scale, const CsrPattern& pattern,
                        std::vector<Real>* values) override {
    CheckCsr(a);
    CheckPattern(pattern, a.columns);
    CheckSize("values of a normal product", values->size(), pattern.column.size());
    const CsrMatrix<Real> a_t = Transpose(a);
    std::vector<Real> sums(Index(a.columns), Real{0});
    for (std::size_t i = 0; i < Index(a.columns); ++i) {
      for (std::int64_t e = a_t.row_start[i]; e < a_t.row_start[i + 1]; ++e) {
        const std::size_t r = Index(a_t.column[Index(e)]);
        for (std::int64_t f = a.row_start[r]; f < a.row_start[r + 1]; ++f) {
          sums[Index(a.column[Index(f)])] += a_t.value[Index(e)] * a.value[Index(f)];
        }
      }
      for (std::int64_t e = pattern.row_start[i]; e < pattern.row_start[i + 1]; ++e) {
        Real& sum = sums[Index(pattern.column[Index(e)])];
        (*values)[Index(e)] += scale * sum;
        sum = 0;
      }
    }
  }

  // Computes I(x) = sum over rays of H0(x, ray) L(ray) / sum over rays of H0(x, ray). One row of
  // the image is computed at a time, so that the sums stay in the cache while the views are read in
  // their order.
  std::vector<Real> FormImage(const BlockGeometry& whole, Splat splat,
                              const std::vector<Real>& views) override {
    CheckBlock(whole);
    const std::size_t view_samples = Index(whole.s_count) * Index(whole.t_count);
    CheckSize("light field to form an image of", views.size(), view_samples * Index(whole.views()));
    std::vector<Real> image(Index(whole.pixels()));
    std::vector<Real> sums(Index(whole.width_px));
    std::vector<Real> weights(Index(whole.width_px));
    for (int y = 0; y < whole.height_px; ++y) {
      std::fill(sums.begin(), sums.end(), Real{0});
      std::fill(weights.begin(), weights.end(), Real{0});
      for (int l = 0; l < whole.v_count; ++l) {
        for (int k = 0; k < whole.u_count; ++k) {
          AddView(whole, splat, k, l, y, views.data() + Index(l * whole.u_count + k) * view_samples,
                  &sums, &weights);
        }
      }
      Real* row = image.data() + Index(y) * Index(whole.width_px);
      for (std::size_t x = 0; x < sums.size(); ++x) {
        row[x] = weights[x] > 0 ? sums[x] / weights[x] : Real{0};
      }
    }
    return image;
  }

  void StartWhole(int s_count, int t_count, int u_count, int v_count, int channels) override {
    const WholeShape shape{s_count, t_count, u_count, v_count, channels};
    CheckWhole(shape);
    shape_ = shape;
    whole_.assign(shape.channel_samples() * Index(channels), 0.0F);
  }

  void AddBlock(const BlockGeometry& block, int channel, const std::vector<Real>& rays) override {
    CheckAddition(shape_, block, channel, rays.size());
    ForEachRay(block, [&](int k, int l, int x, int y) {
      const int s = block.first_x + x - block.s_shift[Index(k)];
      const int t = block.first_y + y - block.t_shift[Index(l)];
      const std::size_t view =
          (Index(channel) * Index(shape_.v_count) + Index(l)) * Index(shape_.u_count) + Index(k);
      whole_[view * shape_.view_samples() + Index(t) * Index(shape_.s_count) + Index(s)] +=
          static_cast<float>(rays[Index(RayNumber(block, k, l, x, y))]);
    });
  }

  std::vector<float> FinishWhole() override {
    shape_ = {};
    return std::exchange(whole_, {});
  }

 private:
  // Adds the contribution of view (k, l) to row y of the image.
  static void AddView(const BlockGeometry& whole, Splat splat, int k, int l, int y,
                      const Real* view, std::vector<Real>* sums, std::vector<Real>* weights) {
    const int taps = TapCount(splat);
    const Real view_weight = static_cast<Real>(whole.view_weight[Index(l * whole.u_count + k)]);
    for (int tap_y = 0; tap_y < taps; ++tap_y) {
      const auto in_y = TapOf<Real>(splat, whole.t_fraction[Index(l)], tap_y);
      const int ray_y = y + in_y.offset;
      const int t = whole.first_y + ray_y - whole.t_shift[Index(l)];
      if (ray_y < 0 || ray_y >= whole.height_px || t < 0 || t >= whole.t_count) continue;
      for (int tap_x = 0; tap_x < taps; ++tap_x) {
        const auto in_x = TapOf<Real>(splat, whole.s_fraction[Index(k)], tap_x);
        const Real weight = view_weight * in_y.share * in_x.share;
        // A view without weight is not read, because it may be absent.
        if (weight == 0) continue;
        // Pixel x has ray x + offset, sample x + to_s.
        const int to_s = whole.first_x + in_x.offset - whole.s_shift[Index(k)];
        const int begin = std::max({0, -in_x.offset, -to_s});
        const int end =
            std::min({whole.width_px, whole.width_px - in_x.offset, whole.s_count - to_s});
        const Real* row = view + Index(t) * Index(whole.s_count);
        for (int x = begin; x < end; ++x) {
          (*sums)[Index(x)] += weight * row[x + to_s];
          (*weights)[Index(x)] += weight;
        }
      }
    }
  }

  WholeShape shape_;
  std::vector<float> whole_;
};

}  // namespace

template <typename Real>
std::unique_ptr<Kernels<Real>> NewReference() {
  return std::make_unique<Reference<Real>>();
}
template std::unique_ptr<Kernels<float>> NewReference<float>();
template std::unique_ptr<Kernels<double>> NewReference<double>();

}  // namespace thicklens::kernels
