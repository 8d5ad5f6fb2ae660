// Linear maps between images with separate weights for each pixel: the device's form of
// image_filter.h, in the layout of opencl_projection.cc.
//
// An item computes LANES adjacent pixels. On a CPU they are a vector, because compilers vectorise
// straight code but not loops over terms. On other devices LANES is 1, so that neighbouring items
// read neighbouring numbers. TILE pixels (a multiple of LANES) share their terms, and SLICE rows
// share their number of entries. SUM is the widest real number of the device.

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

// Images are planes of `plane` numbers: rows of stride_px numbers, which are 0 beyond width_px.
// `margin` numbers before the first plane and after the last may be read.
typedef struct {
  int width_px, height_px, stride_px, plane, margin;
} Layout;

// Computes y = sum_k c_k x(p + (first + k) step), times `weight` if `weighted` is set; it is added
// to y if `add` is set. One item computes LANES pixels of all channels.
kernel void FilterImage(const Layout layout, const int channels, const int step,
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
  // Each coefficient is read once for three channels.
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

// Returns four planes from `channel` on (0 beyond the last) of one pixel, so that a row finds them
// in one place.
REAL4 FourOf(global const REAL* x, int plane, int channel, int channels) {
  REAL4 values = 0;
  x += (size_t)channel * plane;
  values.s0 = x[0];
  if (channel + 1 < channels) values.s1 = x[plane];
  if (channel + 2 < channels) values.s2 = x[2 * plane];
  if (channel + 3 < channels) values.s3 = x[3 * plane];
  return values;
}

// One item per pixel of the list.
kernel void TakePixels(const Layout layout, const int channel, const int channels, const int count,
                       global const int* pixel, global const REAL* x, global REAL4* values) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  values[i] = FourOf(x + layout.margin + pixel[i], layout.plane, channel, channels);
}

// Computes y(pixel) += sum_e weight_e values(index_e), times `image_weight` of the pixel if
// `weighted` is set. One item per row; entry e of row `lane` of a slice is at start + e SLICE +
// lane. Entries are added in four sums, so that no sum waits for the previous one.
kernel void AddRows(const Layout layout, const int channel, const int channels, const int rows,
                    global const int* pixel, global const long* start, global const int* index,
                    global const REAL* weight, global const REAL4* values, const int weighted,
                    global const REAL* image_weight, global REAL* y) {
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
  if (weighted) sum *= image_weight[p];
  y += (size_t)channel * layout.plane + p;
  y[0] += sum.s0;
  if (channel + 1 < channels) y[layout.plane] += sum.s1;
  if (channel + 2 < channels) y[2 * layout.plane] += sum.s2;
  if (channel + 3 < channels) y[3 * layout.plane] += sum.s3;
}
