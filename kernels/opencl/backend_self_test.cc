#include "kernels/opencl/backend_self_test.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {
namespace {

constexpr int kChannels = 2;

// Returns a block of a light field of 23 x 19 samples and 5 x 3 views.
BlockGeometry BlockAt(int first_x, int first_y, int width_px, int height_px) {
  BlockGeometry block;
  block.first_x = first_x;
  block.first_y = first_y;
  block.width_px = width_px;
  block.height_px = height_px;
  block.s_count = 23;
  block.t_count = 19;
  block.u_count = 5;
  block.v_count = 3;
  block.s_shift = {-3, -1, 0, 2, 4};
  block.t_shift = {2, 0, -1};
  block.s_fraction = {-0.5, 0.25, 0, 0.4375, -0.1};
  block.t_fraction = {0, -0.375, 0.3};
  for (int view = 0; view < block.views(); ++view) {
    block.view_weight.push_back(view == 7 ? 0 : 0.01 * (view + 1));
  }
  return block;
}

// Rays land on only a part of this block's pixels; the other pixels have none.
BlockGeometry BlockWithEmptyRows() {
  BlockGeometry block = BlockAt(0, 0, 13, 7);
  block.s_count = 5;
  block.t_count = 3;
  for (int& shift : block.s_shift) shift += 2;
  return block;
}

// Slopes of all kinds: whole numbers, zero, NaN and any other.
template <typename Real>
std::vector<Real> Slopes(const BlockGeometry& block, PortableRng* numbers) {
  std::vector<Real> slopes = numbers->Vector<Real>(block.rays(), -2.5, 2.5);
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    if (i % 7 == 1) slopes[i] = 0;
    if (i % 7 == 3) slopes[i] = std::round(slopes[i]);
    if (i % 11 == 5) slopes[i] = std::numeric_limits<Real>::quiet_NaN();
  }
  return slopes;
}

// Makes some of the rays leave the block. This is not used for masks, where the squares of these
// slopes would dominate all other numbers.
template <typename Real>
std::vector<Real> WithLongOnes(std::vector<Real> slopes) {
  for (std::size_t i = 9; i < slopes.size(); i += 31) slopes[i] = static_cast<Real>(1000.25);
  return slopes;
}

template <typename Real>
class Comparison {
 public:
  explicit Comparison(Kernels<Real>* device) : device_(device), reference_(NewReference<Real>()) {}

  MaxError Run() {
    const std::vector<BlockGeometry> blocks = {BlockAt(6, 5, 9, 7), BlockAt(0, 0, 7, 11),
                                               BlockAt(18, 13, 5, 6), BlockAt(4, 9, 1, 1),
                                               BlockWithEmptyRows()};
    for (const BlockGeometry& block : blocks) {
      for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) CompareBlock(block, splat);
    }
    for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) CompareImage(splat);
    CompareSums();
    return worst_;
  }

 private:
  void CompareBlock(const BlockGeometry& block, Splat splat) {
    const auto rays = reference_->FindRays(block, splat);
    worst_.Add("FindRays", Exactly(device_->FindRays(block, splat), rays));
    const auto irradiance = numbers_.Vector<Real>(block.rays(), 0.5, 1);
    CompareEll("WeightRays", device_->WeightRays(block, splat, rays, {}),
               reference_->WeightRays(block, splat, rays, {}));
    const auto h = reference_->WeightRays(block, splat, rays, irradiance);
    CompareEll("WeightRays", device_->WeightRays(block, splat, rays, irradiance), h);

    const auto slope_u = Slopes<Real>(block, &numbers_);
    const auto slope_v = Slopes<Real>(block, &numbers_);
    const auto long_u = WithLongOnes(slope_u);
    const auto long_v = WithLongOnes(slope_v);
    const auto d = reference_->WarpDifferences(block, long_u, long_v);
    CompareEll("WarpDifferences", device_->WarpDifferences(block, long_u, long_v), d);
    const auto g = reference_->SixTermMasks(block, slope_u, slope_v);
    CompareEll("SixTermMasks", device_->SixTermMasks(block, slope_u, slope_v), g);

    const CsrMatrix<Real> h_rows = Compress(h);
    const CsrMatrix<Real> d_rows = Compress(d);
    for (const CsrMatrix<Real>& a : {h_rows, d_rows, Compress(g)}) CompareProducts(a);
    CompareNormalProduct(h_rows, d_rows);
  }

  void CompareProducts(const CsrMatrix<Real>& a) {
    const auto x = numbers_.Vector<Real>(a.columns, -1, 1);
    worst_.Add("Multiply", Difference(device_->Multiply(a, x), reference_->Multiply(a, x)));
    const auto y = numbers_.Vector<Real>(a.rows, -1, 1);
    worst_.Add("MultiplyTransposed",
               Difference(device_->MultiplyTransposed(a, y), reference_->MultiplyTransposed(a, y)));
  }

  // The product is added to given numbers, in a pattern with more entries than the product.
  void CompareNormalProduct(const CsrMatrix<Real>& h, const CsrMatrix<Real>& d) {
    const CsrPattern pattern = SumPattern(NormalPattern(h), NormalPattern(d));
    auto right = numbers_.Vector<Real>(static_cast<int>(pattern.entries()), -1, 1);
    auto found = right;
    reference_->AddNormalProduct(d, static_cast<Real>(1.5), pattern, &right);
    device_->AddNormalProduct(d, static_cast<Real>(1.5), pattern, &found);
    worst_.Add("AddNormalProduct", Difference(found, right));
  }

  void CompareImage(Splat splat) {
    for (const BlockGeometry& whole : {BlockAt(0, 0, 23, 19), BlockWithEmptyRows()}) {
      const auto views = numbers_.Vector<Real>(whole.s_count * whole.t_count * whole.views(), 0, 1);
      worst_.Add("FormImage", Difference(device_->FormImage(whole, splat, views),
                                         reference_->FormImage(whole, splat, views)));
    }
  }

  // Adds adjacent and overlapping blocks.
  void CompareSums() {
    const BlockGeometry first = BlockAt(0, 0, 13, 19);
    for (Kernels<Real>* kernels : {device_, reference_.get()}) {
      kernels->StartWhole(first.s_count, first.t_count, first.u_count, first.v_count, kChannels);
    }
    for (const BlockGeometry& block : {first, BlockAt(13, 0, 10, 19), BlockAt(7, 3, 9, 11)}) {
      for (int channel = 0; channel < kChannels; ++channel) {
        const auto rays = numbers_.Vector<Real>(block.rays(), 0, 1);
        device_->AddBlock(block, channel, rays);
        reference_->AddBlock(block, channel, rays);
      }
    }
    worst_.Add("AddBlock", Difference(device_->FinishWhole(), reference_->FinishWhole()));
  }

  static double Exactly(const std::vector<std::int32_t>& found,
                        const std::vector<std::int32_t>& right) {
    return found == right ? 0 : kInfinity;
  }

  void CompareEll(const std::string& name, const EllMatrix<Real>& found,
                  const EllMatrix<Real>& right) {
    const bool alike =
        found.rows == right.rows && found.columns == right.columns && found.slots == right.slots;
    worst_.Add(name, alike ? Exactly(found.column, right.column) : kInfinity);
    worst_.Add(name, Difference(found.value, right.value));
  }

  Kernels<Real>* device_;
  std::unique_ptr<Kernels<Real>> reference_;
  PortableRng numbers_;
  MaxError worst_;
};

template <typename Real>
MaxError Compare(Backend* backend, Kernels<Real>* device) {
  MaxError worst = Comparison<Real>(device).Run();
  CompareSteps<Real>(backend, &worst);
  return worst;
}

}  // namespace

BackendSelfTest RunBackendSelfTest(Backend* backend) {
  BackendSelfTest check;
  MaxError in_float = Compare(backend, backend->NewFloat().get());
  CompareWarp(backend, &in_float);
  check.float_error = in_float.error;
  check.double_error = std::numeric_limits<double>::quiet_NaN();
  check.worst = in_float.error > 0 ? in_float.what + " in float" : in_float.what;
  check.agrees = in_float.error <= check.float_limit;
  if (!backend->has_double()) return check;
  const MaxError in_double = Compare(backend, backend->NewDouble().get());
  check.double_error = in_double.error;
  check.agrees = check.agrees && in_double.error <= check.double_limit;
  if (in_double.error / check.double_limit > in_float.error / check.float_limit) {
    check.worst = in_double.what + " in double";
  }
  return check;
}

}  // namespace thicklens::kernels
