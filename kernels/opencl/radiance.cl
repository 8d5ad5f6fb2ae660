// The steps of radiance_steps.h. Images and planes have the layout of filter.cl.

#if LANES == 1
#define WHOLE int
#define ORDER 0
#define REAL_OF(whole) ((REAL)(whole))
#elif LANES == 8
#define WHOLE int8
#define ORDER (int8)(0, 1, 2, 3, 4, 5, 6, 7)
#define REAL_OF(whole) JOINED(JOINED(convert_, REAL), 8)(whole)
#else
#define WHOLE int16
#define ORDER (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#define REAL_OF(whole) JOINED(JOINED(convert_, REAL), 16)(whole)
#endif

// Return 1 for a pixel in the image with a neighbour on its right (or left), and 0 otherwise.
NUMBERS HasRight(int x, int width_px) {
  return REAL_OF(clamp((WHOLE)(width_px - 1 - x) - ORDER, (WHOLE)0, (WHOLE)1));
}
NUMBERS HasLeft(int x, int width_px) {
  return REAL_OF(clamp(min((WHOLE)x + ORDER, (WHOLE)(width_px - x) - ORDER), (WHOLE)0, (WHOLE)1));
}

// The gradient weight t of the four differences that include a pixel; 0 where there is none.
typedef struct {
  NUMBERS right, left, below, above;
} Ties;

Ties TiesAt(const Layout layout, int p, global const REAL* t) {
  const int x = p % layout.stride_px;
  const int y = p / layout.stride_px;
  const NUMBERS here = LOAD(t + p);
  Ties ties;
  ties.right = here * HasRight(x, layout.width_px);
  ties.left = LOAD(t + p - 1) * HasLeft(x, layout.width_px);
  ties.below = y + 1 < layout.height_px ? here : (NUMBERS)0;
  ties.above = y > 0 ? LOAD(t + p - layout.stride_px) : (NUMBERS)0;
  return ties;
}

// Returns P r of one channel.
NUMBERS PriorOf(const Layout layout, int p, const Ties ties, NUMBERS tikhonov_weight, global const REAL* r) {
  const int y = p / layout.stride_px;
  const int down = y + 1 < layout.height_px ? layout.stride_px : 0;
  const int up = y > 0 ? layout.stride_px : 0;
  const NUMBERS here = LOAD(r + p);
  return tikhonov_weight * here + ties.right * (here - LOAD(r + p + 1)) +
         ties.left * (here - LOAD(r + p - 1)) + ties.below * (here - LOAD(r + p + down)) +
         ties.above * (here - LOAD(r + p - up));
}

#if LANES == 1
#define SumOf(numbers) (numbers)
#elif LANES == 8
REAL SumOf(NUMBERS numbers) {
  const REAL4 four = numbers.lo + numbers.hi;
  return (four.s0 + four.s1) + (four.s2 + four.s3);
}
#else
REAL SumOf(NUMBERS numbers) {
  const JOINED(REAL, 8) eight = numbers.lo + numbers.hi;
  const REAL4 four = eight.lo + eight.hi;
  return (four.s0 + four.s1) + (four.s2 + four.s3);
}
#endif

// An item of a sum processes up to ITEM_PIXELS pixels, LANES at a time. The items of its group
// process the pixels beside it.
#define ITEM_PIXELS 16
#define FOR_PIXELS(p)                                                                  \
  for (int p = ((int)get_group_id(0) * ITEM_PIXELS * (int)get_local_size(0) +          \
                (int)get_local_id(0) * LANES),                                         \
           turn = 0;                                                                   \
       turn < ITEM_PIXELS / LANES && p < layout.plane;                                 \
       ++turn, p += (int)get_local_size(0) * LANES)

// Up to SUMS sums of a group.
#define SUMS 3
#define MOST_ITEMS 64
void PutSums(SUM first, SUM second, SUM third, local SUM* of_item) {
  of_item += (int)get_local_id(0) * SUMS;
  of_item[0] = first;
  of_item[1] = second;
  of_item[2] = third;
}
void AddUp(local const SUM* of_item, global SUM* sums) {
  SUM total[SUMS] = {0, 0, 0};
  for (int item = 0; item < (int)get_local_size(0); ++item) {
    for (int i = 0; i < SUMS; ++i) total[i] += of_item[item * SUMS + i];
  }
  for (int i = 0; i < SUMS; ++i) sums[(int)get_group_id(0) * SUMS + i] = total[i];
}
// Sets the quadratic that touches the total variation at x: t = half s^2/(s^2 |dx|^2 +
// floor)^(1/2).
kernel void ReweightVariation(const Layout layout, const int channels, const REAL half_strength,
                           const REAL floor_squared, global const REAL* slope_squared,
                           global const REAL* x, global REAL* t) {
  const int p = (int)get_global_id(0) * LANES;
  if (p >= layout.plane) return;
  const NUMBERS has_right = HasRight(p % layout.stride_px, layout.width_px);
  const int down = p / layout.stride_px + 1 < layout.height_px ? layout.stride_px : 0;
  x += layout.margin + p;
  NUMBERS squares = 0;
  for (int channel = 0; channel < channels; ++channel) {
    const NUMBERS here = LOAD(x);
    const NUMBERS across = (LOAD(x + 1) - here) * has_right;
    const NUMBERS below = LOAD(x + down) - here;
    squares += across * across + below * below;
    x += layout.plane;
  }
  const NUMBERS s2 = LOAD(slope_squared + layout.margin + p);
  STORE(half_strength * s2 / sqrt(s2 * squares + floor_squared), t + layout.margin + p);
}

// Sets r = data_residual - P x + tikhonov_weight target, m = M^-1, and computes the sums r.r, r.m r and r.m
// (previous r).
kernel void UpdateResidual(const Layout layout, const int channels,
                           global const REAL* data_diagonal, global const REAL* tikhonov_weight,
                           global const REAL* t, global const REAL* x,
                           global const REAL* data_residual, const int has_target,
                           global const REAL* target, global REAL* m, global REAL* r,
                           global SUM* sums) {
  NUMBERS squared = 0;
  NUMBERS preconditioned = 0;
  NUMBERS with_previous = 0;
  FOR_PIXELS(p) {
    const Ties ties = TiesAt(layout, p, t + layout.margin);
    const NUMBERS tikhonov_here = LOAD(tikhonov_weight + layout.margin + p);
    const NUMBERS m_here = 1 / (LOAD(data_diagonal + layout.margin + p) + tikhonov_here + ties.right +
                                ties.left + ties.below + ties.above);
    STORE(m_here, m + layout.margin + p);
    for (int channel = 0; channel < channels; ++channel) {
      const size_t plane = layout.margin + (size_t)channel * layout.plane;
      NUMBERS now = LOAD(data_residual + plane + p) -
                    PriorOf(layout, p, ties, tikhonov_here, x + plane);
      if (has_target) now += tikhonov_here * LOAD(target + plane + p);
      const NUMBERS weighted = m_here * now;
      squared += now * now;
      preconditioned += now * weighted;
      with_previous += LOAD(r + plane + p) * weighted;
      STORE(now, r + plane + p);
    }
  }
  local SUM of_item[SUMS * MOST_ITEMS];
  PutSums(SumOf(squared), SumOf(preconditioned), SumOf(with_previous), of_item);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) AddUp(of_item, sums);
}

// Computes |b|^2.
kernel void SquareRightSide(const Layout layout, const int channels, global const REAL* tikhonov_weight,
                            global const REAL* right, const int has_target,
                            global const REAL* target, global SUM* sums) {
  NUMBERS squared = 0;
  FOR_PIXELS(p) {
    for (int channel = 0; channel < channels; ++channel) {
      const size_t at = layout.margin + (size_t)channel * layout.plane + p;
      NUMBERS b = LOAD(right + at);
      if (has_target) b += LOAD(tikhonov_weight + layout.margin + p) * LOAD(target + at);
      squared += b * b;
    }
  }
  local SUM of_item[SUMS * MOST_ITEMS];
  PutSums(SumOf(squared), 0, 0, of_item);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) AddUp(of_item, sums);
}

// Sets direction = m r + beta direction and computes the sum direction.r.
kernel void UpdateDirection(const Layout layout, const int channels, const REAL beta,
                          global const REAL* m, global const REAL* r, global REAL* direction,
                          global SUM* sums) {
  NUMBERS steepness = 0;
  FOR_PIXELS(p) {
    const NUMBERS m_here = LOAD(m + layout.margin + p);
    for (int channel = 0; channel < channels; ++channel) {
      const size_t at = layout.margin + (size_t)channel * layout.plane + p;
      const NUMBERS r_here = LOAD(r + at);
      const NUMBERS turned = m_here * r_here + beta * LOAD(direction + at);
      STORE(turned, direction + at);
      steepness += turned * r_here;
    }
  }
  local SUM of_item[SUMS * MOST_ITEMS];
  PutSums(SumOf(steepness), 0, 0, of_item);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) AddUp(of_item, sums);
}

// Computes the sums direction.P direction and direction.product.
kernel void ApplyNormalOperator(const Layout layout, const int channels, global const REAL* tikhonov_weight,
                             global const REAL* t, global const REAL* direction,
                             global const REAL* product, global SUM* sums) {
  NUMBERS of_prior = 0;
  NUMBERS of_data = 0;
  FOR_PIXELS(p) {
    const Ties ties = TiesAt(layout, p, t + layout.margin);
    const NUMBERS tikhonov_here = LOAD(tikhonov_weight + layout.margin + p);
    for (int channel = 0; channel < channels; ++channel) {
      const size_t plane = layout.margin + (size_t)channel * layout.plane;
      const NUMBERS here = LOAD(direction + plane + p);
      of_prior += here * PriorOf(layout, p, ties, tikhonov_here, direction + plane);
      of_data += here * LOAD(product + plane + p);
    }
  }
  local SUM of_item[SUMS * MOST_ITEMS];
  PutSums(SumOf(of_prior), SumOf(of_data), 0, of_item);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) AddUp(of_item, sums);
}

// Computes y += scale x, over all channels. One item computes LANES numbers.
kernel void AddScaled(const Layout layout, const int channels, const REAL scale,
                      global const REAL* x, global REAL* y) {
  const size_t i = (size_t)get_global_id(0) * LANES;
  if (i >= (size_t)layout.plane * channels) return;
  x += layout.margin + i;
  y += layout.margin + i;
  STORE(LOAD(y) + scale * LOAD(x), y);
}

// Computes y = weight x with one plane of weights. One item computes LANES numbers of each channel.
kernel void MultiplyPlanes(const Layout layout, const int channels, global const REAL* weight,
                           global const REAL* x, global REAL* y) {
  const int p = (int)get_global_id(0) * LANES;
  if (p >= layout.plane) return;
  const NUMBERS w = LOAD(weight + layout.margin + p);
  for (int channel = 0; channel < channels; ++channel) {
    const size_t at = layout.margin + (size_t)channel * layout.plane + p;
    STORE(w * LOAD(x + at), y + at);
  }
}
