#include "thicklens/estimator/inpaint.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/photo.hpp>
#include <utility>
#include <vector>

#include "estimator/render/shown_views.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

// Tolerance for points of one surface, as in RenderDisparity.
constexpr double kSameSurfacePx = 0.2;

// Holes of one view and the disparities of its points.
struct ViewHoles {
  int view = 0;         // l * U + k
  double a = 0, b = 0;  // steps from the middle
  std::vector<char> is_hole;
  std::size_t left = 0;
  std::vector<float> disparity;
};

ViewHoles HolesOf(const DisparityMap& map, const DisparityRenderer& renderer, int view, double a,
                  double b) {
  ViewDisparity rendered = renderer.Render(a, b);
  ViewHoles holes{view, a, b, std::vector<char>(rendered.visibility.size(), 0), 0, {}};
  for (int y = 0; y < map.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.width_px; ++x) {
      const std::size_t i = Index(y) * Index(map.width_px) + Index(x);
      if (rendered.visibility[i] != Visibility::kOccluded) continue;
      // Position in the centre view of the background that is seen here.
      const double centre_x = x + a * map.step.x() * rendered.disparity[i];
      const double centre_y = y + b * map.step.y() * rendered.disparity[i];
      if (!(centre_x >= 0) || !(centre_x <= map.width_px - 1) || !(centre_y >= 0) ||
          !(centre_y <= map.height_px - 1)) {
        continue;
      }
      holes.is_hole[i] = 1;
      ++holes.left;
    }
  }
  holes.disparity = std::move(rendered.disparity);
  return holes;
}

// In each row, holes get the nearest value that is not a hole: at the border of the image
// cv::inpaint reads pixels that it has not filled yet.
void PutNeighbours(const std::vector<char>& is_hole, cv::Mat* values) {
  for (int y = 0; y < values->rows; ++y) {
    ThrowIfCancelled();
    const char* hole = is_hole.data() + Index(y) * Index(values->cols);
    auto* row = values->ptr<float>(y);
    std::vector<int> nearest(Index(values->cols), -1);
    for (int x = 0, known = -1; x < values->cols; ++x) {
      if (hole[x] == 0) known = x;
      nearest[Index(x)] = known;
    }
    for (int x = values->cols - 1, known = -1; x >= 0; --x) {
      if (hole[x] == 0) known = x;
      int& left = nearest[Index(x)];
      if (known >= 0 && (left < 0 || known - x < x - left)) left = known;
    }
    for (int x = 0; x < values->cols; ++x) {
      if (hole[x] != 0 && nearest[Index(x)] >= 0) row[x] = row[nearest[Index(x)]];
    }
  }
}

// One pixel on each side is repeated, so that what cv::inpaint makes of the outermost pixels is cut
// off.
cv::Mat Padded(const cv::Mat& inner) {
  cv::Mat padded;
  cv::copyMakeBorder(inner, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  return padded;
}

// Fills all holes of the view, channel by channel.
void FillView(const ViewHoles& holes, const InpaintOptions& options,
              model::LightField* light_field) {
  const int width = light_field->s_count, height = light_field->t_count;
  cv::Mat mask(height, width, CV_8UC1);
  std::transform(holes.is_hole.begin(), holes.is_hole.end(), mask.begin<std::uint8_t>(),
                 [](char is_hole) { return static_cast<std::uint8_t>(is_hole != 0 ? 255 : 0); });
  const cv::Mat padded_mask = Padded(mask);
  ParallelFor(light_field->channels, options.threads, [&](int channel) {
    float* values = light_field->values.data() + light_field->ViewStart(channel, 0, 0) +
                    Index(holes.view) * light_field->view_size();
    // cv::inpaint adds up to 2 units of the values, meant as grey levels, to the mean of the
    // neighbours; if 1 were full scale, these units would exceed the image values.
    constexpr double kFullScale = 65535;
    cv::Mat scaled, filled;
    cv::Mat(height, width, CV_32FC1, values).convertTo(scaled, CV_32FC1, kFullScale);
    PutNeighbours(holes.is_hole, &scaled);
    cv::inpaint(Padded(scaled), padded_mask, filled, options.radius_px, cv::INPAINT_TELEA);
    for (int y = 0; y < height; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < width; ++x) {
        const std::size_t i = Index(y) * Index(width) + Index(x);
        if (holes.is_hole[i] == 0) continue;
        values[i] = static_cast<float>(filled.at<float>(y + 1, x + 1) / kFullScale);
      }
    }
  });
}

// Carries what was filled in one view to the holes of another view that show the same points.
// Returns how many were filled.
std::size_t Carry(const DisparityMap& map, const ViewHoles& from, ViewHoles* to,
                  model::LightField* light_field) {
  const double px_per_unit = map.step.cwiseAbs().maxCoeff();
  std::size_t carried = 0;
  for (int y = 0; y < map.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.width_px; ++x) {
      const std::size_t i = Index(y) * Index(map.width_px) + Index(x);
      if (from.is_hole[i] == 0) continue;
      const double disparity = from.disparity[i];
      const double there_x = std::round(x - (to->a - from.a) * map.step.x() * disparity);
      const double there_y = std::round(y - (to->b - from.b) * map.step.y() * disparity);
      if (!(there_x >= 0) || !(there_x < map.width_px) || !(there_y >= 0) ||
          !(there_y < map.height_px)) {
        continue;
      }
      const std::size_t j =
          Index(static_cast<int>(there_y)) * Index(map.width_px) + Index(static_cast<int>(there_x));
      if (to->is_hole[j] == 0 ||
          !(std::abs(to->disparity[j] - disparity) * px_per_unit <= kSameSurfacePx)) {
        continue;
      }
      for (int channel = 0; channel < light_field->channels; ++channel) {
        float* views = light_field->values.data() + light_field->ViewStart(channel, 0, 0);
        views[Index(to->view) * light_field->view_size() + j] =
            views[Index(from.view) * light_field->view_size() + i];
      }
      to->is_hole[j] = 0;
      --to->left;
      ++carried;
    }
  }
  return carried;
}

}  // namespace

bool InpaintOptions::IsValid(std::string* why) const {
  const auto fail = [why](std::string reason) {
    if (why != nullptr) *why = std::move(reason);
    return false;
  };
  if (!(radius_px > 0) || !std::isfinite(radius_px)) {
    return fail(fmt::format("radius_px is {}: it must be finite and > 0", radius_px));
  }
  if (threads < 0) return fail(fmt::format("threads is {}: it must be >= 0", threads));
  return true;
}

void InpaintOccludedRays(const DisparityMap& map, const InpaintOptions& options,
                         model::LightField* light_field, InpaintSummary* summary) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("inpainting: " + why);
  CheckLightField(*light_field);
  if (map.width_px != light_field->s_count || map.height_px != light_field->t_count) {
    throw Error(
        fmt::format("inpainting: the disparity map has {}x{} px, but the views have {}x{} px: the "
                    "sizes must be equal",
                    map.width_px, map.height_px, light_field->s_count, light_field->t_count));
  }
  const auto start = Clock::now();
  *summary = InpaintSummary();
  const DisparityRenderer renderer(map);
  std::vector<int> present;
  for (int view = 0; view < light_field->u_count * light_field->v_count; ++view) {
    if (light_field->IsPresent(view % light_field->u_count, view / light_field->u_count)) {
      present.push_back(view);
    }
  }
  std::vector<ViewHoles> views(present.size());
  ParallelFor(static_cast<int>(present.size()), options.threads, [&](int i) {
    const int view = present[Index(i)];
    views[Index(i)] =
        HolesOf(map, renderer, view, light_field->u_offset(view % light_field->u_count),
                light_field->v_offset(view / light_field->u_count));
  });
  std::stable_sort(views.begin(), views.end(), [](const ViewHoles& p, const ViewHoles& q) {
    return std::hypot(p.a, p.b) < std::hypot(q.a, q.b);
  });
  for (const ViewHoles& view : views) summary->holes += view.left;

  int done = 0;
  for (auto view = views.begin(); view != views.end(); ++view) {
    if (view->left > 0) {
      FillView(*view, options, light_field);
      ++summary->views_visited;
      summary->filled += view->left;
      std::vector<std::size_t> carried(static_cast<std::size_t>(views.end() - view), 0);
      ParallelFor(static_cast<int>(carried.size()) - 1, options.threads, [&](int i) {
        carried[Index(i)] = Carry(map, *view, &*(view + 1 + i), light_field);
      });
      summary->carried += std::accumulate(carried.begin(), carried.end(), std::size_t{0});
    }
    if (options.progress) options.progress(++done, static_cast<int>(views.size()));
  }
  summary->seconds = SecondsSince(start);
  summary->message = fmt::format(
      "{} rays of occluded background: {} filled in {} views by Telea's method, {} copied to other "
      "views",
      summary->holes, summary->filled, summary->views_visited, summary->carried);
}

}  // namespace thicklens::estimator
