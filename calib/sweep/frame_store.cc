#include "calib/sweep/frame_store.h"

#include <cmath>
#include <opencv2/core.hpp>

namespace thicklens::calib {

FrameStore::FrameStore(const FocusSweep& sweep, std::size_t byte_limit)
    : sweep_(sweep), kept_(KeptFrames::Of(sweep.read_frame, byte_limit)) {}

cv::Mat FrameStore::Stored(std::size_t index) { return kept_(index); }

void FrameStore::SetCorrection(const std::optional<FixedPatternRemoval>& correction) {
  correction_ = correction ? std::make_unique<const FixedPatternRemoval>(*correction) : nullptr;
}

void FrameStore::SetLineGains(const std::vector<std::vector<double>>& log_gain, bool are_columns) {
  line_factors_.assign(sweep_.frames.size(), cv::Mat());
  for (std::size_t i = 0; i < log_gain.size(); ++i) {
    if (log_gain[i].empty()) continue;
    const auto lines = static_cast<int>(log_gain[i].size());
    cv::Mat factors(are_columns ? 1 : lines, are_columns ? lines : 1, CV_32F);
    for (int k = 0; k < lines; ++k)
      factors.ptr<float>()[k] = static_cast<float>(std::exp(-log_gain[i][std::size_t(k)]));
    line_factors_[i] = factors;
  }
}

void FrameStore::Correct(std::size_t index, cv::Mat* light) const {
  if (!line_factors_.empty() && !line_factors_[index].empty()) {
    const cv::Mat& factors = line_factors_[index];
    for (int y = 0; y < light->rows; ++y) {
      cv::Mat row = light->row(y);
      if (factors.cols == 1) {
        row.convertTo(row, -1, static_cast<double>(factors.at<float>(y)));
      } else {
        cv::multiply(row, factors, row);
      }
    }
  }
  if (correction_) correction_->Apply(light);
}

cv::Mat FrameStore::Grey(std::size_t index) {
  cv::Mat grey = LinearGrey(Stored(index), sweep_, index);
  Correct(index, &grey);
  return grey;
}

cv::Mat FrameStore::Channel(std::size_t index, int channel) {
  cv::Mat light = LinearChannel(Stored(index), sweep_, index, channel);
  Correct(index, &light);
  return light;
}

}  // namespace thicklens::calib
