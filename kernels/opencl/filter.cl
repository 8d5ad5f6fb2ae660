// Linear maps between pictures with weights of each pixel's own: the device's form of
// picture_filter.h, as opencl_projection.cc lays it out.
//
// LANES pixels beside each other are an item's work: on a processor's cores a vector, since what
// compilers make vectors of is straight code, and loops over terms are not; elsewhere one, so that
// neighbouring items read neighbouring numbers. TILE pixels (a multiple of LANES) share their
// terms, SLICE rows their number of entries. SUM is the widest real number that the device has.

// Sums of products may be fused from here on.
#pragma OPENCL FP_CONTRACT ON

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#if LANES == 1
#define NUMBERS REAL
#define LOAD(from) (*(from))
#define STORE(numbers, to) (*(to) = (numbers))
#else
#define NUMBERS JOINED(REAL, LANES)
#define LOAD(from) JOINED(vload, LANES)(0, from)
#define STORE(numbers, to) JOINED(vstore, LANES)(numbers, 0, to)
#endif
#define REAL4 JOINED(REAL, 4)

// Pictures lie in planes of `plane` numbers: rows of stride_px numbers, of which those beyond
// width_px are 0. `margin` numbers before the first plane and after the last are there to be read.
typedef struct {
  int width_px, height_px, stride_px, plane, margin;
} Layout;

// y = sum_k c_k x(p + (first + k) step), times `weight` if it is weighted, and added to y if `add`.
// One item LANES pixels of all channels.
kernel void FilterPicture(const Layout layout, const int channels, const int step,
                          global const int* first_term, global const int* start,
                          global const REAL* coefficients, global const REAL* x, const int weighted,
                          global const REAL* weight, const int add, global REAL* y) {
  const int p = (int)get_global_id(0) * LANES;
  if (p >= layout.plane) return;
  const int tile = p / TILE;
  const int terms = start[tile + 1] - start[tile];
  coefficients += (size_t)start[tile] * TILE + p % TILE;
  x += layout.margin + p + first_term[tile] * step;
  y += layout.margin + p;
  weight += layout.margin + p;
  int channel = 0;
  // A coefficient that is read serves three channels.
  for (; channel + 3 <= channels; channel += 3) {
    NUMBERS sum0 = 0;
    NUMBERS sum1 = 0;
    NUMBERS sum2 = 0;
    global const REAL* from = x;
    for (int k = 0; k < terms; ++k) {
      const NUMBERS c = LOAD(coefficients + k * TILE);
      sum0 += c * LOAD(from);
      sum1 += c * LOAD(from + layout.plane);
      sum2 += c * LOAD(from + 2 * layout.plane);
      from += step;
    }
    if (weighted) {
      const NUMBERS w = LOAD(weight);
      sum0 *= w;
      sum1 *= w;
      sum2 *= w;
    }
    if (add) {
      sum0 += LOAD(y);
      sum1 += LOAD(y + layout.plane);
      sum2 += LOAD(y + 2 * layout.plane);
    }
    STORE(sum0, y);
    STORE(sum1, y + layout.plane);
    STORE(sum2, y + 2 * layout.plane);
    x += 3 * layout.plane;
    y += 3 * layout.plane;
  }
  for (; channel < channels; ++channel) {
    NUMBERS sum = 0;
    for (int k = 0; k < terms; ++k) sum += LOAD(coefficients + k * TILE) * LOAD(x + k * step);
    if (weighted) sum *= LOAD(weight);
    if (add) sum += LOAD(y);
    STORE(sum, y);
    x += layout.plane;
    y += layout.plane;
  }
}

// Four planes from `channel` on, 0 beyond the last, pixel by pixel: what a row looks for is then in
// one place.
REAL4 FourOf(global const REAL* x, int plane, int channel, int channels) {
  REAL4 values = 0;
  x += (size_t)channel * plane;
  values.s0 = x[0];
  if (channel + 1 < channels) values.s1 = x[plane];
  if (channel + 2 < channels) values.s2 = x[2 * plane];
  if (channel + 3 < channels) values.s3 = x[3 * plane];
  return values;
}

// One item a pixel of the list.
kernel void TakePixels(const Layout layout, const int channel, const int channels, const int count,
                       global const int* pixel, global const REAL* x, global REAL4* values) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  values[i] = FourOf(x + layout.margin + pixel[i], layout.plane, channel, channels);
}

// y(pixel) += sum_e weight_e values(index_e), or that times `picture_weight` of the pixel if it is
// weighted. One item a row; entry e of row `lane` of a slice is at start + e SLICE + lane. Entries
// are added in four sums, so that one need not wait for the one before.
kernel void AddRows(const Layout layout, const int channel, const int channels, const int rows,
                    global const int* pixel, global const long* start, global const int* index,
                    global const REAL* weight, global const REAL4* values, const int weighted,
                    global const REAL* picture_weight, global REAL* y) {
  const int row = (int)get_global_id(0);
  if (row >= rows) return;
  const int slice = row / SLICE;
  const int entries = (int)((start[slice + 1] - start[slice]) / SLICE);
  const size_t at = (size_t)start[slice] + row % SLICE;
  index += at;
  weight += at;
  REAL4 sum0 = 0;
  REAL4 sum1 = 0;
  REAL4 sum2 = 0;
  REAL4 sum3 = 0;
  int e = 0;
  for (; e + 4 <= entries; e += 4) {
    sum0 += weight[e * SLICE] * values[index[e * SLICE]];
    sum1 += weight[(e + 1) * SLICE] * values[index[(e + 1) * SLICE]];
    sum2 += weight[(e + 2) * SLICE] * values[index[(e + 2) * SLICE]];
    sum3 += weight[(e + 3) * SLICE] * values[index[(e + 3) * SLICE]];
  }
  for (; e < entries; ++e) sum0 += weight[e * SLICE] * values[index[e * SLICE]];
  REAL4 sum = (sum0 + sum1) + (sum2 + sum3);
  const int p = layout.margin + pixel[row];
  if (weighted) sum *= picture_weight[p];
  y += (size_t)channel * layout.plane + p;
  y[0] += sum.s0;
  if (channel + 1 < channels) y[layout.plane] += sum.s1;
  if (channel + 2 < channels) y[2 * layout.plane] += sum.s2;
  if (channel + 3 < channels) y[3 * layout.plane] += sum.s3;
}
