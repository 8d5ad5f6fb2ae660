#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "kernels/cpu/bands.h"
#include "kernels/cpu/prior_rows.h"
#include "kernels/cpu/radiance_loops.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::kernels {
namespace {

constexpr int kBandRows = 16;  // rows of a band of a sum, for any number of threads

using Sums = std::array<double, 3>;

template <typename Real>
class CpuRadianceSteps : public RadianceSteps<Real> {
 public:
  explicit CpuRadianceSteps(const DataTerm<Real>& data);

  void SetPrior(const QuadraticPrior<Real>& prior) override;
  void SetVariation(const TotalVariation<Real>& variation) override;
  void ReweightVariation() override;
  void Start(const std::vector<Real>& x) override;
  void StartFor(const std::vector<Real>& photograph, const std::vector<Real>& x) override;
  double SquaredRightSide() override;
  ResidualSums UpdateResidual() override;
  double UpdateDirection(double beta) override;
  double ApplyNormalOperator() override;
  double StepLength(double steepness, double curvature) override;
  void UpdateSolution(double step) override;
  std::vector<Real> Radiance() override { return x_; }
  std::vector<Real> Project(const std::vector<Real>& x) override;
  std::vector<Real> ProjectTransposed(const std::vector<Real>& y) override;

 private:
  // Memory for a row of differences and one of results.
  struct Room {
    std::vector<Real> across, row;
  };
  // Work rows(y0, y1, room) for bands that do not depend on the number of threads.
  using Rows = std::function<Sums(int y0, int y1, Room* room)>;
  Sums SumOverBands(const Rows& rows) const;
  // Calls row(first, pixel, y, room) for all rows y of all channels, in bands: `first` is the index
  // of the row's first number, `pixel` that of its first pixel.
  template <typename RowWork>
  Sums SumRows(const RowWork& row) const;

  std::vector<Real> Weighted(const std::vector<Real>& image) const;
  void UpdatePreconditioner();
  void StartAt(const std::vector<Real>& x);
  void MultiplyData(const std::vector<Real>& x, std::vector<Real>* y);  // y = H^T W H x
  // Whether the system that was started has values that are lower bounds. A photograph given to
  // StartFor has none.
  bool HasBounds() const { return !data_.bounds.empty() && photograph_ == &data_.photograph; }
  // Computes H x anew, and from it which bounds count and the residual of the data.
  void MeetBounds();
  // Computes the sum over the channels of the squared forward differences of x at each pixel of a
  // row.
  void SquaredDifferences(int y, std::vector<Real>* squares) const;

  // Null: the target is 0.
  const Real* Target() const {
    if (prior_.target_is_photograph) return photograph_->data();
    return prior_.target.empty() ? nullptr : prior_.target.data();
  }

  const DataTerm<Real>& data_;
  QuadraticPrior<Real> prior_;
  TotalVariation<Real> variation_;
  std::vector<Real> slope_squared_;
  std::vector<Real> weighted_photograph_;  // H^T W I
  std::vector<Real> data_diagonal_;        // diagonal of H^T W H, approximate
  std::vector<Real> inverse_diagonal_;
  // State of the system that was started.
  int channels_ = 1;
  std::vector<Real> other_photograph_, other_right_;
  const std::vector<Real>* photograph_ = nullptr;
  const std::vector<Real>* right_ = nullptr;  // H^T W I
  std::vector<Real> x_, data_residual_, residual_, direction_, product_;
  std::vector<Real> projected_;  // H x
  // At the values that are bounds: H x, H p, and whether the residual counts.
  std::vector<Real> shown_, along_;
  std::vector<char> counts_;
};

template <typename Real>
CpuRadianceSteps<Real>::CpuRadianceSteps(const DataTerm<Real>& data)
    : data_(data),
      weighted_photograph_(data.photograph.size()),
      data_diagonal_(data.pixels()),
      inverse_diagonal_(data.pixels()),
      projected_(data.photograph.size()) {
  const std::vector<Real> weighted = Weighted(data.photograph);
  data.projection.apply_transposed(weighted.data(), data.channels, weighted_photograph_.data());
  // The diagonal is sum_i W_i H_ij^2. If H_ij^2 is replaced by H_ij times the mean of H over the
  // row with weights H, sum_j H_ij^2, one application suffices. This is exact if the weights of a
  // row are equal.
  const std::vector<Real> squares = Weighted(data.row_norm2);
  data.projection.apply_transposed(squares.data(), 1, data_diagonal_.data());
}

template <typename Real>
Sums CpuRadianceSteps<Real>::SumOverBands(const Rows& rows) const {
  const int bands = (data_.height_px + kBandRows - 1) / kBandRows;
  const int threads = BandCount(bands, data_.threads, 1);
  std::vector<Sums> of_band(Index(bands));
  // The memory is allocated before the threads start, because threads must not throw.
  std::vector<Room> rooms(Index(threads), Room{std::vector<Real>(Index(data_.width_px) + 1),
                                               std::vector<Real>(Index(data_.width_px))});
  ForBands(bands, threads, [&](int thread, int first, int last) {
    for (int band = first; band < last; ++band) {
      of_band[Index(band)] =
          rows(band * kBandRows, std::min((band + 1) * kBandRows, data_.height_px),
               &rooms[Index(thread)]);
    }
  });
  Sums sums{};
  for (const Sums& band : of_band) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += band[i];
  }
  return sums;
}

template <typename Real>
template <typename RowWork>
Sums CpuRadianceSteps<Real>::SumRows(const RowWork& row) const {
  return SumOverBands([&](int y0, int y1, Room* room) {
    Sums sums{};
    for (int channel = 0; channel < channels_; ++channel) {
      for (int y = y0; y < y1; ++y) {
        const std::size_t pixel = Index(y) * Index(data_.width_px);
        const Sums of_row = row(Index(channel) * data_.pixels() + pixel, pixel, y, room);
        for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += of_row[i];
      }
    }
    return sums;
  });
}

template <typename Real>
std::vector<Real> CpuRadianceSteps<Real>::Weighted(const std::vector<Real>& image) const {
  std::vector<Real> weighted(image.size());
  const std::size_t pixels = data_.pixels();
  for (std::size_t plane = 0; plane < image.size(); plane += pixels) {
    for (std::size_t i = 0; i < pixels; ++i) {
      weighted[plane + i] = data_.weight[i] * image[plane + i];
    }
  }
  return weighted;
}

template <typename Real>
void CpuRadianceSteps<Real>::SetPrior(const QuadraticPrior<Real>& prior) {
  prior_ = prior;
  UpdatePreconditioner();
}

template <typename Real>
void CpuRadianceSteps<Real>::SetVariation(const TotalVariation<Real>& variation) {
  variation_ = variation;
  slope_squared_ = *variation.slope_squared;
  variation_.slope_squared = nullptr;
}

template <typename Real>
void CpuRadianceSteps<Real>::SquaredDifferences(int y, std::vector<Real>* squares) const {
  std::fill(squares->begin(), squares->end(), Real(0));
  for (int channel = 0; channel < channels_; ++channel) {
    const Real* r = x_.data() + Index(channel) * data_.pixels() + Index(y) * Index(data_.width_px);
    AddSquaredDifferences(r, y + 1 < data_.height_px ? r + data_.width_px : nullptr, data_.width_px,
                          squares->data());
  }
}

template <typename Real>
void CpuRadianceSteps<Real>::ReweightVariation() {
  prior_.target_is_photograph = false;
  prior_.target.clear();
  prior_.tikhonov_weight.assign(data_.pixels(), static_cast<Real>(variation_.tikhonov_weight));
  prior_.gradient_weight.resize(data_.pixels());
  const int width = data_.width_px;
  const Real half = static_cast<Real>(variation_.strength / 2);
  const Real floor = static_cast<Real>(variation_.eps * variation_.eps);
  SumOverBands([&](int y0, int y1, Room* room) {
    for (int y = y0; y < y1; ++y) {
      const std::size_t row = Index(y) * Index(width);
      SquaredDifferences(y, &room->row);
      ReweightRow(slope_squared_.data() + row, room->row.data(), half, floor, width,
                  prior_.gradient_weight.data() + row);
    }
    return Sums{};
  });
  UpdatePreconditioner();
}

template <typename Real>
void CpuRadianceSteps<Real>::UpdatePreconditioner() {
  const int width = data_.width_px;
  const PriorRows<Real> prior(prior_, width, data_.height_px);
  SumOverBands([&](int y0, int y1, Room*) {
    for (int y = y0; y < y1; ++y) {
      const std::size_t row = Index(y) * Index(width);
      Real* out = inverse_diagonal_.data() + row;
      std::copy_n(data_diagonal_.data() + row, width, out);
      prior.AddDiagonal(y, out);
      for (int i = 0; i < width; ++i) out[i] = 1 / out[i];
    }
    return Sums{};
  });
}

template <typename Real>
void CpuRadianceSteps<Real>::MultiplyData(const std::vector<Real>& x, std::vector<Real>* y) {
  const std::size_t pixels = data_.pixels();
  data_.projection.apply(x.data(), channels_, projected_.data());
  SumOverBands([&](int y0, int y1, Room*) {
    const std::size_t end = Index(y1) * Index(data_.width_px);
    for (int channel = 0; channel < channels_; ++channel) {
      Real* plane = projected_.data() + Index(channel) * pixels;
      for (std::size_t i = Index(y0) * Index(data_.width_px); i < end; ++i) {
        plane[i] *= data_.weight[i];
      }
    }
    return Sums{};
  });
  if (HasBounds()) {
    for (std::size_t j = 0; j < data_.bounds.size(); ++j) {
      Real& value = projected_[data_.bounds[j]];
      along_[j] = value / data_.weight[data_.bounds[j] % pixels];
      if (counts_[j] == 0) value = 0;
    }
  }
  data_.projection.apply_transposed(projected_.data(), channels_, y->data());
}

template <typename Real>
void CpuRadianceSteps<Real>::MeetBounds() {
  const std::size_t pixels = data_.pixels();
  data_.projection.apply(x_.data(), channels_, projected_.data());
  for (std::size_t j = 0; j < data_.bounds.size(); ++j) {
    const std::size_t i = data_.bounds[j];
    shown_[j] = projected_[i];
    counts_[j] = shown_[j] < data_.photograph[i] ? 1 : 0;
  }
  SumOverBands([&](int y0, int y1, Room*) {
    const std::size_t end = Index(y1) * Index(data_.width_px);
    for (int channel = 0; channel < channels_; ++channel) {
      const std::size_t plane = Index(channel) * pixels;
      for (std::size_t i = Index(y0) * Index(data_.width_px); i < end; ++i) {
        projected_[plane + i] =
            data_.weight[i] * (data_.photograph[plane + i] - projected_[plane + i]);
      }
    }
    return Sums{};
  });
  for (std::size_t j = 0; j < data_.bounds.size(); ++j) {
    if (counts_[j] == 0) projected_[data_.bounds[j]] = 0;
  }
  data_.projection.apply_transposed(projected_.data(), channels_, data_residual_.data());
}

template <typename Real>
void CpuRadianceSteps<Real>::Start(const std::vector<Real>& x) {
  channels_ = data_.channels;
  photograph_ = &data_.photograph;
  right_ = &weighted_photograph_;
  StartAt(x);
}

template <typename Real>
void CpuRadianceSteps<Real>::StartFor(const std::vector<Real>& photograph,
                                      const std::vector<Real>& x) {
  channels_ = 1;
  other_photograph_ = photograph;
  other_right_ = ProjectTransposed(Weighted(photograph));
  photograph_ = &other_photograph_;
  right_ = &other_right_;
  StartAt(x);
}

template <typename Real>
void CpuRadianceSteps<Real>::StartAt(const std::vector<Real>& x) {
  x_ = x;
  data_residual_ = *right_;
  residual_.assign(x.size(), Real(0));
  direction_.assign(x.size(), Real(0));
  product_.resize(x.size());
  if (HasBounds()) {
    shown_.resize(data_.bounds.size());
    along_.resize(data_.bounds.size());
    counts_.resize(data_.bounds.size());
    MeetBounds();
    return;
  }
  MultiplyData(x_, &product_);
  for (std::size_t i = 0; i < x.size(); ++i) data_residual_[i] -= product_[i];
}

template <typename Real>
double CpuRadianceSteps<Real>::SquaredRightSide() {
  const Real* target = Target();
  double sum = 0;
  for (std::size_t i = 0; i < right_->size(); ++i) {
    Real b = (*right_)[i];
    if (target != nullptr) b += prior_.tikhonov_weight[i % data_.pixels()] * target[i];
    sum += static_cast<double>(b) * static_cast<double>(b);
  }
  return sum;
}

template <typename Real>
ResidualSums CpuRadianceSteps<Real>::UpdateResidual() {
  const Real* target = Target();
  const Sums sums = SumRows([&](std::size_t first, std::size_t pixel, int y, Room* room) {
    MultiplyPriorRow(prior_, data_.width_px, data_.height_px, x_.data() + (first - pixel), y,
                     room->across.data(), room->row.data());
    ResidualRow<Real> row;
    row.data = data_residual_.data() + first;
    row.prior = room->row.data();
    if (target != nullptr) {
      row.tikhonov_weight = prior_.tikhonov_weight.data() + pixel;
      row.target = target + first;
    }
    row.inverse_diagonal = inverse_diagonal_.data() + pixel;
    row.residual = residual_.data() + first;
    const ResidualSums of_row = UpdateRow(row, data_.width_px);
    return Sums{of_row.squared, of_row.preconditioned, of_row.with_previous};
  });
  return {sums[0], sums[1], sums[2]};
}

template <typename Real>
double CpuRadianceSteps<Real>::UpdateDirection(double beta) {
  return SumRows([&](std::size_t first, std::size_t pixel, int, Room*) {
    return Sums{UpdateDirectionRow(inverse_diagonal_.data() + pixel, residual_.data() + first,
                                   static_cast<Real>(beta), data_.width_px,
                                   direction_.data() + first)};
  })[0];
}

template <typename Real>
double CpuRadianceSteps<Real>::ApplyNormalOperator() {
  const int width = data_.width_px;
  MultiplyData(direction_, &product_);
  const Sums sums = SumRows([&](std::size_t first, std::size_t pixel, int y, Room* room) {
    const Real* p = direction_.data() + first;
    MultiplyPriorRow(prior_, width, data_.height_px, p - pixel, y, room->across.data(),
                     room->row.data());
    return Sums{DotRow(p, room->row.data(), width), DotRow(p, product_.data() + first, width)};
  });
  return sums[0] + sums[1];
}

template <typename Real>
void CpuRadianceSteps<Real>::UpdateSolution(double step_along_direction) {
  const Real step = static_cast<Real>(step_along_direction);
  SumRows([&](std::size_t first, std::size_t, int, Room*) {
    UpdateSolutionRow(step, direction_.data() + first, product_.data() + first, data_.width_px,
                      x_.data() + first, data_residual_.data() + first);
    return Sums{};
  });
  if (!HasBounds()) return;
  bool is_changed = false;
  for (std::size_t j = 0; j < data_.bounds.size(); ++j) {
    shown_[j] += step * along_[j];
    is_changed |= (counts_[j] != 0) != (shown_[j] < data_.photograph[data_.bounds[j]]);
  }
  if (is_changed) MeetBounds();
}

// Half of the derivative along p at the distance a is -p.r + a p.A p, of the values that counted at
// a = 0, plus the change of the terms -W Hp max(0, I - H x - a Hp) of the bounds. It increases with
// a. Its zero is found by Newton's method on the pieces, within a bracket.
template <typename Real>
double CpuRadianceSteps<Real>::StepLength(double steepness, double curvature) {
  double at = steepness / curvature;
  if (!HasBounds()) return at;
  constexpr int kMaxTries = 40;
  constexpr double kTolerance = 1e-6;  // of the steepness
  double low = 0, high = 0;            // high: 0 while it is not known
  for (int i = 0; i < kMaxTries; ++i) {
    double slope = at * curvature - steepness, bend = curvature;
    for (std::size_t j = 0; j < data_.bounds.size(); ++j) {
      const std::size_t index = data_.bounds[j];
      const auto along = static_cast<double>(along_[j]);
      const double below = static_cast<double>(data_.photograph[index]) -
                           static_cast<double>(shown_[j]) - at * along;
      const bool counted = counts_[j] != 0, counts = below > 0;
      if (counted == counts) continue;
      const double weight = static_cast<double>(data_.weight[index % data_.pixels()]);
      const double sign = counts ? 1 : -1;
      slope -= sign * weight * along * below;
      bend += sign * weight * along * along;
    }
    if (std::abs(slope) <= kTolerance * steepness) break;
    (slope < 0 ? low : high) = at;
    const double next = bend > 0 ? at - slope / bend : 0;
    if (next > low && (high == 0 || next < high)) {
      at = next;
    } else {
      at = high == 0 ? 2 * at : (low + high) / 2;
    }
  }
  return at;
}

template <typename Real>
std::vector<Real> CpuRadianceSteps<Real>::Project(const std::vector<Real>& x) {
  std::vector<Real> y(x.size());
  data_.projection.apply(x.data(), static_cast<int>(x.size() / data_.pixels()), y.data());
  return y;
}

template <typename Real>
std::vector<Real> CpuRadianceSteps<Real>::ProjectTransposed(const std::vector<Real>& y) {
  std::vector<Real> x(y.size());
  data_.projection.apply_transposed(y.data(), static_cast<int>(y.size() / data_.pixels()),
                                    x.data());
  return x;
}

}  // namespace

template <typename Real>
std::unique_ptr<RadianceSteps<Real>> NewCpuRadianceSteps(const DataTerm<Real>& data) {
  return std::make_unique<CpuRadianceSteps<Real>>(data);
}
template std::unique_ptr<RadianceSteps<float>> NewCpuRadianceSteps(const DataTerm<float>&);
template std::unique_ptr<RadianceSteps<double>> NewCpuRadianceSteps(const DataTerm<double>&);

}  // namespace thicklens::kernels
