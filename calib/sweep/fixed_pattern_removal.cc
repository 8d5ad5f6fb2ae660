#include "calib/sweep/fixed_pattern_removal.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace thicklens::calib {

FixedPatternRemoval::FixedPatternRemoval(const cv::Mat& log_gain, const cv::Mat& filled)
    : log_gain_(log_gain),
      filled_(filled.empty() ? cv::Mat(cv::Mat::zeros(log_gain.size(), CV_8U)) : filled) {
  cv::exp(-log_gain_, inverse_gain_);
  cv::Mat labels, statistics, centroids;
  const int groups =
      cv::connectedComponentsWithStats(filled_, labels, statistics, centroids, 8, CV_32S);
  for (int group = 1; group < groups; ++group) {
    const cv::Rect box(statistics.at<int>(group, cv::CC_STAT_LEFT),
                       statistics.at<int>(group, cv::CC_STAT_TOP),
                       statistics.at<int>(group, cv::CC_STAT_WIDTH),
                       statistics.at<int>(group, cv::CC_STAT_HEIGHT));
    const cv::Rect around = cv::Rect(box.x - 1, box.y - 1, box.width + 2, box.height + 2) &
                            cv::Rect(0, 0, filled_.cols, filled_.rows);
    const cv::Mat own = labels(around) == group;
    cv::Mat grown;
    cv::dilate(own, grown, cv::Mat::ones(3, 3, CV_8U));
    std::vector<cv::Point> rim, inside;
    for (int y = 0; y < around.height; ++y) {
      for (int x = 0; x < around.width; ++x) {
        const cv::Point p = around.tl() + cv::Point(x, y);
        if (own.at<uchar>(y, x) != 0) {
          inside.push_back(p);
        } else if (grown.at<uchar>(y, x) != 0 && filled_.at<uchar>(p) == 0) {
          rim.push_back(p);
        }
      }
    }
    for (const cv::Point& p : inside) {
      Fill fill{p, {}};
      float sum = 0;
      for (const cv::Point& from : rim) {
        const auto distance = static_cast<float>(std::hypot(from.x - p.x, from.y - p.y));
        fill.sources.push_back({from, 1 / (distance * distance * distance)});
        sum += fill.sources.back().weight;
      }
      for (Source& source : fill.sources) source.weight /= sum;
      if (!fill.sources.empty()) fills_.push_back(std::move(fill));
    }
  }
}

FixedPatternRemoval FixedPatternRemoval::With(const FixedPatternRemoval& more) const {
  return {log_gain_ + more.log_gain_, filled_ | more.filled_};
}

void FixedPatternRemoval::Apply(cv::Mat* light) const {
  cv::multiply(*light, inverse_gain_, *light);
  for (const Fill& fill : fills_) {
    float sum = 0;
    for (const Source& source : fill.sources) sum += source.weight * light->at<float>(source.from);
    light->at<float>(fill.at) = sum;
  }
}

}  // namespace thicklens::calib
