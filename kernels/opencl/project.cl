// The common part of all kernel files, which are one program; then H, from rays to pixels.
//
// REAL is float or double. Each kernel computes the same as the function of its name in
// reference.cc, term by term and in the same order, and differs from it only by rounding. Items
// beyond the last do nothing, because the number of items is rounded up to whole groups.

// Fusing is off as in the C++ reference: where 1 - w is 0 there, it must be 0 here.
#pragma OPENCL FP_CONTRACT OFF

// The structure BlockGeometry. Its lists are buffers: `shift` holds s_shift, then t_shift;
// `fraction` holds s_fraction, then t_fraction.
typedef struct {
  int first_x, first_y, width_px, height_px;
  int s_count, t_count, u_count, v_count;
} Block;

int PixelsOf(const Block block) { return block.width_px * block.height_px; }

// Returns the ray of view (k, l) nearest to the block's pixel (x, y), or -1.
int RayAt(const Block block, global const int* shift, int k, int l, int x, int y) {
  if (k < 0 || k >= block.u_count || l < 0 || l >= block.v_count) return -1;
  if (x < 0 || x >= block.width_px || y < 0 || y >= block.height_px) return -1;
  const int s = block.first_x + x - shift[k];
  const int t = block.first_y + y - shift[block.u_count + l];
  if (s < 0 || s >= block.s_count || t < 0 || t >= block.t_count) return -1;
  return (l * block.u_count + k) * PixelsOf(block) + y * block.width_px + x;
}

// The shares of a pixel, on one axis, of rays that land `fraction` beside their nearest pixel: tap
// 0 is the ray nearest to it, tap 1 the neighbour. With `taps` 1 it gets all of the nearest ray.
int TapOffset(REAL fraction, int tap) { return tap == 0 ? 0 : fraction > 0 ? -1 : 1; }
REAL TapShare(REAL fraction, int tap, int taps) {
  return taps == 1 ? 1 : tap == 0 ? 1 - fabs(fraction) : fabs(fraction);
}

// One item per pixel: neighbours write neighbouring addresses in every slot.
kernel void FindRays(const Block block, const int taps, global const int* shift,
                     global const REAL* fraction, global int* rays) {
  const int pixels = PixelsOf(block);
  const int pixel = (int)get_global_id(0);
  if (pixel >= pixels) return;
  const int x = pixel % block.width_px;
  const int y = pixel / block.width_px;
  size_t at = pixel;
  for (int l = 0; l < block.v_count; ++l) {
    for (int k = 0; k < block.u_count; ++k) {
      for (int tap_y = 0; tap_y < taps; ++tap_y) {
        const REAL in_y = fraction[block.u_count + l];
        for (int tap_x = 0; tap_x < taps; ++tap_x) {
          const REAL in_x = fraction[k];
          const bool arrives =
              TapShare(in_x, tap_x, taps) != 0 && TapShare(in_y, tap_y, taps) != 0;
          rays[at] = arrives ? RayAt(block, shift, k, l, x + TapOffset(in_x, tap_x),
                                     y + TapOffset(in_y, tap_y))
                             : -1;
          at += pixels;
        }
      }
    }
  }
}

// One item per pixel, which reads its slots twice: for the sum, then for the division by it.
kernel void WeightRays(const int pixels, const int slots, global const REAL* slot_weight,
                      global const int* rays, const int has_irradiance,
                      global const REAL* irradiance, global int* column, global REAL* value) {
  const int pixel = (int)get_global_id(0);
  if (pixel >= pixels) return;
  REAL sum = 0;
  size_t at = pixel;
  for (int slot = 0; slot < slots; ++slot, at += pixels) {
    if (rays[at] >= 0) sum += slot_weight[slot];
  }
  at = pixel;
  for (int slot = 0; slot < slots; ++slot, at += pixels) {
    const int ray = rays[at];
    const REAL weight = slot_weight[slot];
    const bool is_used = ray >= 0 && weight != 0;
    REAL share = is_used ? weight / sum : 0;
    if (is_used && has_irradiance) share *= irradiance[ray];
    column[at] = is_used ? ray : -1;
    value[at] = share;
  }
}
