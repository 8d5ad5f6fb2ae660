// Reads an image for the samples of a view: view_warp.h, reference_warp.cc.

// Fusing is off as in the C++ reference, because the same numbers must decide which taps are used.
#pragma OPENCL FP_CONTRACT OFF

// LANES numbers (filter.cl), which need not be REAL; WHOLE is from radiance.cl.
#if LANES == 1
#define FLOATS float
#define TO_WHOLE convert_int
#define LOAD_LANES(from) (*(from))
#define STORE_LANES(numbers, to) (*(to) = (numbers))
#else
#define FLOATS JOINED(float, LANES)
#define TO_WHOLE JOINED(convert_int, LANES)
#define LOAD_LANES(from) JOINED(vload, LANES)(0, from)
#define STORE_LANES(numbers, to) JOINED(vstore, LANES)(numbers, 0, to)
#endif

// Pixels are in rows of width_px + 3, and the rows in planes of height_px + 3: the borders of the
// image are repeated once before and twice after. A pixel is one number. If the image has several
// channels, it is a float4 of the next four channels in each plane, 0 beyond the last channel.
typedef struct {
  int width_px, height_px, channels;
  float tolerance, limit_px;
} Surfaces;

// OccludedSample in view_warp.h.
typedef struct {
  int index;
  float source_x, source_y, disparity;
} Occluded;

// BoundarySample in view_warp.h.
typedef struct {
  int index;
  Occluded other;
  float share;
} Boundary;

// Returns the pixels before the positions of samples on a line, and sets `rest` to the distances to
// the positions.
WHOLE PixelsBefore(WHOLE sample, FLOATS source, int count, float limit_px, FLOATS* rest) {
  const FLOATS way = clamp(source, -limit_px, limit_px);
  const FLOATS below = floor(way);
  const WHOLE at = sample + TO_WHOLE(below);
  const WHOLE pixel = clamp(at, 0, count - 1);
  *rest = select((FLOATS)0, way - below, at == pixel && at < (WHOLE)(count - 1));
  return pixel;
}

// Weights of the pixels at -1, 0, 1 and 2, after Catmull and Rom.
float4 CatmullRom(float t) {
  return mad(mad(mad((float4)(-0.5f, 1.5f, -1.5f, 0.5f), t, (float4)(1, -2.5f, 2, -0.5f)), t,
                 (float4)(-0.5f, 0, 0.5f, 0)),
             t, (float4)(0, 1, 0, 0));
}
// Each weight is repeated for the four channels of a pixel.
float16 CatmullRomOfFour(float t) {
  const float16 cubic = (float16)((float4)-0.5f, (float4)1.5f, (float4)-1.5f, (float4)0.5f);
  const float16 square = (float16)((float4)1, (float4)-2.5f, (float4)2, (float4)-0.5f);
  const float16 linear = (float16)((float4)-0.5f, (float4)0, (float4)0.5f, (float4)0);
  const float16 constant_term = (float16)((float4)0, (float4)1, (float4)0, (float4)0);
  return mad(mad(mad(cubic, t, square), t, linear), t, constant_term);
}

float BicubicOfOne(global const float* tap, int stride, float4 weight_x, float4 weight_y) {
  float4 sum = weight_y.s0 * vload4(0, tap);
  sum = mad(weight_y.s1, vload4(0, tap + stride), sum);
  sum = mad(weight_y.s2, vload4(0, tap + 2 * stride), sum);
  sum = weight_x * mad(weight_y.s3, vload4(0, tap + 3 * stride), sum);
  return (sum.s0 + sum.s1) + (sum.s2 + sum.s3);
}

float16 FourPixels(global const float4* tap) {
  return (float16)(tap[0], tap[1], tap[2], tap[3]);
}
float4 BicubicOfFour(global const float4* tap, int stride, float16 weight_x, float4 weight_y) {
  float16 sum = weight_y.s0 * FourPixels(tap);
  sum = mad((float16)weight_y.s1, FourPixels(tap + stride), sum);
  sum = mad((float16)weight_y.s2, FourPixels(tap + 2 * stride), sum);
  sum = weight_x * mad((float16)weight_y.s3, FourPixels(tap + 3 * stride), sum);
  const float8 half_sum = sum.lo + sum.hi;
  return half_sum.lo + half_sum.hi;
}

// Returns the shares of the four surrounding pixels; only pixels of the surface have one.
float4 Shares(const Surfaces image, global const float* disparity, int x, int y, float rest_x,
              float rest_y, float d) {
  // Beyond the last pixel the weight is 0.
  const int there = y * image.width_px + x;
  const int right = min(x + 1, image.width_px - 1) - x;
  const int below = (min(y + 1, image.height_px - 1) - y) * image.width_px;
  const float4 weight = (float4)((1 - rest_x) * (1 - rest_y), rest_x * (1 - rest_y),
                                 (1 - rest_x) * rest_y, rest_x * rest_y);
  const float4 away = fabs((float4)(disparity[there], disparity[there + right],
                                    disparity[there + below], disparity[there + below + right]) -
                           d);
  const float4 weighted = select(weight, (float4)(0), away > image.tolerance);
  float sum_of_weights = 0;
  sum_of_weights += weighted.s0;
  sum_of_weights += weighted.s1;
  sum_of_weights += weighted.s2;
  sum_of_weights += weighted.s3;
  if (sum_of_weights > 0) return weighted / sum_of_weights;
  // The first of the closest pixels.
  const float4 far = select(away, (float4)(INFINITY), weight == 0);
  const float closest = fmin(fmin(far.s0, far.s1), fmin(far.s2, far.s3));
  return far.s0 == closest   ? (float4)(1, 0, 0, 0)
         : far.s1 == closest ? (float4)(0, 1, 0, 0)
         : far.s2 == closest ? (float4)(0, 0, 1, 0)
                             : (float4)(0, 0, 0, 1);
}

// Stores the first `count` of four channels.
void StoreChannels(float4 channels, int count, global float* to) {
  if (count >= 4) {
    vstore4(channels, 0, to);
  } else if (count == 3) {
    vstore3(channels.xyz, 0, to);
  } else if (count == 2) {
    vstore2(channels.xy, 0, to);
  } else {
    *to = channels.x;
  }
}

// Loads the first `count` of LANES samples and repeats the last of these.
FLOATS LoadSamples(global const float* from, int count) {
  if (count == LANES) return LOAD_LANES(from);
  float padded[LANES];
  for (int lane = 0; lane < LANES; ++lane) padded[lane] = from[min(lane, count - 1)];
  return LOAD_LANES(padded);
}

// One item computes LANES samples of a row (see filter.cl). The items after those of all rows
// compute LANES occluded samples each, at any position. `ranges`: minimum and maximum of the
// disparities around each pixel. `shift`: across and down, then the rounding errors of these
// floats.
kernel void WarpView(const Surfaces image, global const float* pixels,
                     global const float* disparity, global const float2* ranges,
                     global const float* view_disparity, const float4 shift,
                     global const Occluded* occluded, const int occluded_count, global float* values) {
  const int items_in_row = (image.width_px + LANES - 1) / LANES;
  const int row = (int)get_global_id(0) / items_in_row;
  int count, sample[LANES];
  float sample_disparity[LANES];
  WHOLE sample_x, sample_y;
  FLOATS source_x, source_y;
  if (row < image.height_px) {
    const int first = (int)get_global_id(0) % items_in_row * LANES;
    count = min(LANES, image.width_px - first);
    sample_x = (WHOLE)first + ORDER;
    sample_y = (WHOLE)row;
    STORE_LANES((WHOLE)(row * image.width_px) + sample_x, sample);
    const FLOATS seen =
        LoadSamples(view_disparity + (size_t)row * image.width_px + first, count);
    source_x = fma((FLOATS)shift.s0, seen, shift.s2 * seen);
    source_y = fma((FLOATS)shift.s1, seen, shift.s3 * seen);
    STORE_LANES(seen, sample_disparity);
  } else {
    const int first = ((int)get_global_id(0) - items_in_row * image.height_px) * LANES;
    count = min(LANES, occluded_count - first);
    if (count <= 0) return;
    int column[LANES], line[LANES];
    float across[LANES], down[LANES];
    for (int lane = 0; lane < LANES; ++lane) {
      const Occluded one = occluded[first + min(lane, count - 1)];
      sample[lane] = one.index;
      column[lane] = one.index % image.width_px;
      line[lane] = one.index / image.width_px;
      across[lane] = one.source_x;
      down[lane] = one.source_y;
      sample_disparity[lane] = one.disparity;
    }
    sample_x = LOAD_LANES(column);
    sample_y = LOAD_LANES(line);
    source_x = LOAD_LANES(across);
    source_y = LOAD_LANES(down);
  }

  FLOATS rests_x, rests_y;
  int pixel_x[LANES], pixel_y[LANES];
  float rest_x[LANES], rest_y[LANES];
  STORE_LANES(PixelsBefore(sample_x, source_x, image.width_px, image.limit_px, &rests_x),
              pixel_x);
  STORE_LANES(PixelsBefore(sample_y, source_y, image.height_px, image.limit_px, &rests_y),
              pixel_y);
  STORE_LANES(rests_x, rest_x);
  STORE_LANES(rests_y, rest_y);

  const int stride = image.width_px + 3;
  const int plane = stride * (image.height_px + 3);
  for (int lane = 0; lane < count; ++lane) {
    const float d = sample_disparity[lane];
    if (isnan(d)) continue;  // an occluded sample, which another item reads
    const int x = pixel_x[lane];
    const int y = pixel_y[lane];
    global float* to = values + (size_t)sample[lane] * image.channels;
    const float2 range = ranges[y * image.width_px + x];
    const bool is_cubic =
        fabs(range.s0 - d) <= image.tolerance && fabs(range.s1 - d) <= image.tolerance;
    if (image.channels == 1) {
      global const float* tap = pixels + y * stride + x;  // at -1, -1
      if (is_cubic) {
        *to = BicubicOfOne(tap, stride, CatmullRom(rest_x[lane]), CatmullRom(rest_y[lane]));
        continue;
      }
      tap += stride + 1;
      *to = dot(Shares(image, disparity, x, y, rest_x[lane], rest_y[lane], d),
                (float4)(tap[0], tap[1], tap[stride], tap[stride + 1]));
      continue;
    }
    global const float4* tap = (global const float4*)pixels + y * stride + x;
    if (is_cubic) {
      const float16 weight_x = CatmullRomOfFour(rest_x[lane]);
      const float4 weight_y = CatmullRom(rest_y[lane]);
      for (int c = 0; c < image.channels; c += 4, tap += plane) {
        StoreChannels(BicubicOfFour(tap, stride, weight_x, weight_y), image.channels - c, to + c);
      }
      continue;
    }
    const float4 share = Shares(image, disparity, x, y, rest_x[lane], rest_y[lane], d);
    tap += stride + 1;
    for (int c = 0; c < image.channels; c += 4, tap += plane) {
      StoreChannels(share.s0 * tap[0] + share.s1 * tap[1] + share.s2 * tap[stride] +
                        share.s3 * tap[stride + 1],
                    image.channels - c, to + c);
    }
  }
}

// One item per sample whose pixel two surfaces share; it runs after WarpView.
kernel void MixSamples(const Surfaces image, global const float* pixels,
                       global const float* disparity, global const Boundary* boundary, const int count,
                       global float* values) {
  if ((int)get_global_id(0) >= count) return;
  const Boundary one = boundary[get_global_id(0)];
  const float source_x = clamp(one.other.source_x, -image.limit_px, image.limit_px);
  const float source_y = clamp(one.other.source_y, -image.limit_px, image.limit_px);
  const int at_x = one.index % image.width_px + (int)floor(source_x);
  const int at_y = one.index / image.width_px + (int)floor(source_y);
  const int x = clamp(at_x, 0, image.width_px - 1);
  const int y = clamp(at_y, 0, image.height_px - 1);
  const float rest_x = at_x == x && x < image.width_px - 1 ? source_x - floor(source_x) : 0;
  const float rest_y = at_y == y && y < image.height_px - 1 ? source_y - floor(source_y) : 0;
  const float4 share = Shares(image, disparity, x, y, rest_x, rest_y, one.other.disparity);
  const int stride = image.width_px + 3;
  const int plane = stride * (image.height_px + 3);
  const int there = (y + 1) * stride + x + 1;
  global float* to = values + (size_t)one.index * image.channels;
  if (image.channels == 1) {
    global const float* tap = pixels + there;
    const float value = dot(share, (float4)(tap[0], tap[1], tap[stride], tap[stride + 1]));
    *to += one.share * (value - *to);
    return;
  }
  global const float4* tap = (global const float4*)pixels + there;
  for (int c = 0; c < image.channels; c += 4, tap += plane) {
    const float4 value = share.s0 * tap[0] + share.s1 * tap[1] + share.s2 * tap[stride] +
                         share.s3 * tap[stride + 1];
    const float of_four[4] = {value.s0, value.s1, value.s2, value.s3};
    for (int n = 0; n < min(4, image.channels - c); ++n) {
      to[c + n] += one.share * (of_four[n] - to[c + n]);
    }
  }
}
