// A picture read for the samples of a view: view_warp.h, reference_warp.cc.

// As the C++ twin: which taps count is decided by numbers that must be the same.
#pragma OPENCL FP_CONTRACT OFF

// The picture lies in planes of (height_px + 3) rows of (width_px + 3) numbers: its borders are
// repeated once before and twice after.
typedef struct {
  int width_px, height_px, channels;
  float tolerance, limit_px;
} Surfaces;

// The pixel before the place of a sample on a line, and the rest of the way to the next.
int PixelBefore(int sample, float source, int count, float limit_px, float* rest) {
  const float way = clamp(source, -limit_px, limit_px);
  const float below = floor(way);
  const int at = sample + (int)below;
  const int pixel = clamp(at, 0, count - 1);
  *rest = at == pixel && at < count - 1 ? way - below : 0;
  return pixel;
}

float4 CatmullRom(float t) {
  return (float4)(((-0.5f * t + 1) * t - 0.5f) * t, (1.5f * t - 2.5f) * t * t + 1,
                  ((-1.5f * t + 2) * t + 0.5f) * t, (0.5f * t - 0.5f) * t * t);
}

// One sample, of all channels, at x, y of the view.
void WarpSample(const Surfaces picture, global const float* planes, global const float* disparity,
                global const float* lowest, global const float* highest, int sample_x, int sample_y,
                float d, float source_x, float source_y, global float* values) {
  float rest_x, rest_y;
  const int x = PixelBefore(sample_x, source_x, picture.width_px, picture.limit_px, &rest_x);
  const int y = PixelBefore(sample_y, source_y, picture.height_px, picture.limit_px, &rest_y);
  const int there = y * picture.width_px + x;
  const int stride = picture.width_px + 3;
  const size_t plane = (size_t)stride * (picture.height_px + 3);
  global const float* tap = planes + (size_t)y * stride + x;  // at -1, -1

  if (fabs(lowest[there] - d) <= picture.tolerance && fabs(highest[there] - d) <= picture.tolerance) {
    const float4 weight_x = CatmullRom(rest_x);
    const float4 weight_y = CatmullRom(rest_y);
    for (int channel = 0; channel < picture.channels; ++channel, tap += plane) {
      float4 sum = weight_y.s0 * vload4(0, tap);
      sum = mad(weight_y.s1, vload4(0, tap + stride), sum);
      sum = mad(weight_y.s2, vload4(0, tap + 2 * stride), sum);
      sum = weight_x * mad(weight_y.s3, vload4(0, tap + 3 * stride), sum);
      values[channel] = (sum.s0 + sum.s1) + (sum.s2 + sum.s3);
    }
    return;
  }

  // The four taps around, those of the surface alone. Past the last pixel the weight is 0.
  const int right = min(x + 1, picture.width_px - 1) - x;
  const int below = (min(y + 1, picture.height_px - 1) - y) * picture.width_px;
  const float4 weight = (float4)((1 - rest_x) * (1 - rest_y), rest_x * (1 - rest_y),
                                 (1 - rest_x) * rest_y, rest_x * rest_y);
  const float4 away = fabs((float4)(disparity[there], disparity[there + right],
                                    disparity[there + below], disparity[there + below + right]) -
                           d);
  const float4 weighed = select(weight, (float4)(0), away > picture.tolerance);
  const float4 far = select(away, (float4)(INFINITY), weight == 0);
  float sum_of_weights = 0;
  sum_of_weights += weighed.s0;
  sum_of_weights += weighed.s1;
  sum_of_weights += weighed.s2;
  sum_of_weights += weighed.s3;
  const float closest = fmin(fmin(far.s0, far.s1), fmin(far.s2, far.s3));
  // The first of the closest.
  const float4 alone = far.s0 == closest   ? (float4)(1, 0, 0, 0)
                       : far.s1 == closest ? (float4)(0, 1, 0, 0)
                       : far.s2 == closest ? (float4)(0, 0, 1, 0)
                                           : (float4)(0, 0, 0, 1);
  const float4 share = sum_of_weights > 0 ? weighed / sum_of_weights : alone;
  tap += stride + 1;
  for (int channel = 0; channel < picture.channels; ++channel, tap += plane) {
    values[channel] = dot(share, (float4)(tap[0], tap[1], tap[stride], tap[stride + 1]));
  }
}

// One item LANES samples of a row: see filter.cl.
kernel void WarpView(const Surfaces picture, global const float* planes,
                     global const float* disparity, global const float* lowest,
                     global const float* highest, global const float* view_disparity,
                     global const float* source_x, global const float* source_y,
                     global float* values) {
  const int items_in_row = (picture.width_px + LANES - 1) / LANES;
  const int y = (int)get_global_id(0) / items_in_row;
  if (y >= picture.height_px) return;
  const int first = (int)get_global_id(0) % items_in_row * LANES;
  const int last = min(first + LANES, picture.width_px);
  for (int x = first; x < last; ++x) {
    const int sample = y * picture.width_px + x;
    WarpSample(picture, planes, disparity, lowest, highest, x, y, view_disparity[sample],
               source_x[sample], source_y[sample], values + (size_t)sample * picture.channels);
  }
}
