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

// One item a sample, of all channels.
kernel void WarpView(const Surfaces picture, global const float* planes,
                     global const float* disparity, global const float* lowest,
                     global const float* highest, global const float* view_disparity,
                     global const float* source_x, global const float* source_y,
                     global float* values) {
  const int sample = (int)get_global_id(0);
  if (sample >= picture.width_px * picture.height_px) return;
  float rest_x, rest_y;
  const int x = PixelBefore(sample % picture.width_px, source_x[sample], picture.width_px,
                            picture.limit_px, &rest_x);
  const int y = PixelBefore(sample / picture.width_px, source_y[sample], picture.height_px,
                            picture.limit_px, &rest_y);
  const float d = view_disparity[sample];
  const int there = y * picture.width_px + x;
  const int stride = picture.width_px + 3;
  const size_t plane = (size_t)stride * (picture.height_px + 3);
  global const float* tap = planes + (size_t)y * stride + x;  // at -1, -1
  values += (size_t)sample * picture.channels;

  if (fabs(lowest[there] - d) <= picture.tolerance && fabs(highest[there] - d) <= picture.tolerance) {
    const float4 weight_x = CatmullRom(rest_x);
    const float4 weight_y = CatmullRom(rest_y);
    for (int channel = 0; channel < picture.channels; ++channel, tap += plane) {
      const float4 down = weight_y.s0 * vload4(0, tap) + weight_y.s1 * vload4(0, tap + stride) +
                          weight_y.s2 * vload4(0, tap + 2 * stride) +
                          weight_y.s3 * vload4(0, tap + 3 * stride);
      values[channel] = dot(weight_x, down);
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
