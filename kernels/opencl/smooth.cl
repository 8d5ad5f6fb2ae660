// The derivation masks of rays, one item per ray.

// Displacements of more samples than this leave every block.
#define FAR_AWAY ((REAL)(1 << 30))

// Difference of the sample numbers of view `to` from those of view `from`, on one axis.
int ShiftBetween(global const int* shift, int from, int to, int count) {
  return to < 0 || to >= count ? 0 : shift[to] - shift[from];
}

// Writes one row of D: -1 at the ray, 1 - w and w at the next view's samples around it. Slots are
// `rows` apart.
void PutDifference(int ray, int tap0, int tap1, REAL rest, size_t row, size_t rows,
                   global int* column, global REAL* value) {
  const REAL share = 1 - rest;
  const bool is_empty = ray < 0 || (share != 0 && tap0 < 0) || (rest != 0 && tap1 < 0);
  column[row] = is_empty ? -1 : ray;
  value[row] = is_empty ? 0 : -1;
  column[row + rows] = is_empty || share == 0 ? -1 : tap0;
  value[row + rows] = is_empty || share == 0 ? 0 : share;
  column[row + 2 * rows] = is_empty || rest == 0 ? -1 : tap1;
  value[row + 2 * rows] = is_empty || rest == 0 ? 0 : rest;
}

kernel void WarpDifferences(const Block block, global const int* shift, global const REAL* slope_u,
                            global const REAL* slope_v, global int* column, global REAL* value) {
  const int pixels = PixelsOf(block);
  const int rays = pixels * block.u_count * block.v_count;
  const int item = (int)get_global_id(0);
  if (item >= rays) return;
  const int x = item % block.width_px;
  const int y = item % pixels / block.width_px;
  const int k = item / pixels % block.u_count;
  const int l = item / pixels / block.u_count;
  const int ray = RayAt(block, shift, k, l, x, y);
  const size_t rows = 2 * (size_t)rays;

  // A slope that is NaN or too large fails the comparison and gives an empty row.
  const REAL whole_u = floor(slope_u[item]);
  const bool is_near_u = fabs(whole_u) < FAR_AWAY;
  const int next_x = x + ShiftBetween(shift, k, k + 1, block.u_count) +
                     (is_near_u ? (int)whole_u : 0);
  PutDifference(is_near_u ? ray : -1, RayAt(block, shift, k + 1, l, next_x, y),
                RayAt(block, shift, k + 1, l, next_x + 1, y), slope_u[item] - whole_u, item, rows,
                column, value);

  const REAL whole_v = floor(slope_v[item]);
  const bool is_near_v = fabs(whole_v) < FAR_AWAY;
  const int next_y = y + ShiftBetween(shift + block.u_count, l, l + 1, block.v_count) +
                     (is_near_v ? (int)whole_v : 0);
  PutDifference(is_near_v ? ray : -1, RayAt(block, shift, k, l + 1, x, next_y),
                RayAt(block, shift, k, l + 1, x, next_y + 1), slope_v[item] - whole_v,
                (size_t)rays + item, rows, column, value);
}

// The eight neighbours in one plane, (s, u) or (t, v), for m^2 L_ss + 2 m L_su + L_uu, as steps
// along the samples and along the views. Their weights are m^2 for the first two, 1 for the next
// two, and m/2 with the diagonal's sign.
constant int sample_step[8] = {-1, 1, 0, 0, -1, 1, -1, 1};
constant int view_step[8] = {0, 0, -1, 1, -1, -1, 1, 1};

REAL NeighbourWeight(REAL slope, int neighbour) {
  if (neighbour < 2) return slope * slope;
  if (neighbour < 4) return 1;
  return neighbour == 4 || neighbour == 7 ? slope / 2 : -(slope / 2);
}

kernel void SixTermMasks(const Block block, global const int* shift, global const REAL* slope_u,
                         global const REAL* slope_v, global int* column, global REAL* value) {
  const int pixels = PixelsOf(block);
  const int rays = pixels * block.u_count * block.v_count;
  const int item = (int)get_global_id(0);
  if (item >= rays) return;
  const int x = item % block.width_px;
  const int y = item % pixels / block.width_px;
  const int k = item / pixels % block.u_count;
  const int l = item / pixels / block.u_count;
  const REAL m = slope_u[item];
  const REAL n = slope_v[item];
  const bool is_empty = RayAt(block, shift, k, l, x, y) < 0 || !isfinite(m) || !isfinite(n);

  REAL centre = -2 * m * m - 2 - 2 * n * n - 2;
  size_t at = item;
  for (int i = 0; i < 16; ++i) {
    const bool is_in_u = i < 8;
    const int samples = sample_step[i % 8];
    const int views = view_step[i % 8];
    int neighbour;
    if (is_in_u) {
      const int step = samples + ShiftBetween(shift, k, k + views, block.u_count);
      neighbour = RayAt(block, shift, k + views, l, x + step, y);
    } else {
      const int step = samples + ShiftBetween(shift + block.u_count, l, l + views, block.v_count);
      neighbour = RayAt(block, shift, k, l + views, x, y + step);
    }
    const REAL weight = NeighbourWeight(is_in_u ? m : n, i % 8);
    const bool is_used = !is_empty && neighbour >= 0;
    if (!is_used) centre += weight;
    at += rays;
    column[at] = is_used ? neighbour : -1;
    value[at] = is_used ? weight : 0;
  }
  column[item] = is_empty ? -1 : item;
  value[item] = is_empty ? 0 : centre;
}
