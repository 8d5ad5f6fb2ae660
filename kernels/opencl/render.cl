// Kernels from a light field to its image, and from blocks to a light field.

// Number of pixels of a row that one item of FormImage sums up. It is a constant, so that the
// loops over them are unrolled and vectorised.
#define STRIP 16

// One item per strip of a row. It reads each view's strip as a whole and in the order of the views,
// with the sums of all its pixels in registers. An item per pixel, whose loop over the views has a
// length that is known only at run time, is never vectorised on a CPU. The strips cost a GPU some
// coalescing and divide the memory streams of a CPU into pieces of a strip. Every sample is read
// once for each tap.
kernel void FormImage(const Block whole, const int taps, global const int* shift,
                        global const REAL* fraction, global const REAL* view_weight,
                        global const REAL* views, global REAL* image) {
  const int strips = (whole.width_px + STRIP - 1) / STRIP;
  const int y = (int)(get_global_id(0) / strips);
  const int x = (int)(get_global_id(0) % strips) * STRIP;
  if (y >= whole.height_px) return;
  REAL sum[STRIP];
  REAL weights[STRIP];
  for (int i = 0; i < STRIP; ++i) sum[i] = weights[i] = 0;

  for (int l = 0; l < whole.v_count; ++l) {
    for (int k = 0; k < whole.u_count; ++k) {
      const int view = l * whole.u_count + k;
      for (int tap_y = 0; tap_y < taps; ++tap_y) {
        const REAL in_y = fraction[whole.u_count + l];
        const int ray_y = y + TapOffset(in_y, tap_y);
        const int t = whole.first_y + ray_y - shift[whole.u_count + l];
        if (ray_y < 0 || ray_y >= whole.height_px || t < 0 || t >= whole.t_count) continue;
        global const REAL* row = views + ((size_t)view * whole.t_count + t) * whole.s_count;
        for (int tap_x = 0; tap_x < taps; ++tap_x) {
          const REAL in_x = fraction[k];
          const REAL weight =
              view_weight[view] * TapShare(in_y, tap_y, taps) * TapShare(in_x, tap_x, taps);
          // A view without weight is not read, because it may be absent.
          if (weight == 0) continue;
          const int offset = TapOffset(in_x, tap_x);
          const int s = whole.first_x + x + offset - shift[k];
          // The pixels of the strip whose ray is in the block and in the light field.
          const int begin = max(max(0, -(x + offset)), -s);
          const int end = min(min(STRIP, whole.width_px - x - offset), whole.s_count - s);
          if (begin == 0 && end == STRIP) {
            for (int i = 0; i < STRIP; ++i) {
              sum[i] += weight * row[s + i];
              weights[i] += weight;
            }
          } else {
            for (int i = 0; i < STRIP; ++i) {
              if (i < begin || i >= end) continue;
              sum[i] += weight * row[s + i];
              weights[i] += weight;
            }
          }
        }
      }
    }
  }
  for (int i = 0; i < STRIP && x + i < whole.width_px; ++i) {
    image[(size_t)y * whole.width_px + x + i] = weights[i] > 0 ? sum[i] / weights[i] : 0;
  }
}

// One item per ray of the block. No two items share a sample.
kernel void AddBlock(const Block block, global const int* shift, global const REAL* rays,
                     global float* channel) {
  const int pixels = PixelsOf(block);
  const int item = (int)get_global_id(0);
  if (item >= pixels * block.u_count * block.v_count) return;
  const int x = item % block.width_px;
  const int y = item % pixels / block.width_px;
  const int view = item / pixels;
  const int s = block.first_x + x - shift[view % block.u_count];
  const int t = block.first_y + y - shift[block.u_count + view / block.u_count];
  if (s < 0 || s >= block.s_count || t < 0 || t >= block.t_count) return;
  channel[((size_t)view * block.t_count + t) * block.s_count + s] += (float)rays[item];
}
