#ifndef THICKLENS_ESTIMATOR_VIEWS_DISPARITY_BUFFER_H_
#define THICKLENS_ESTIMATOR_VIEWS_DISPARITY_BUFFER_H_

#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace thicklens::estimator {

// Position of a point of the centre view in another view.
struct Vertex {
  double x = 0, y = 0;
  double disparity = 0;
};

// The nearest surface at each sample of a view.
class DisparityBuffer {
 public:
  DisparityBuffer(int width_px, int height_px)
      : width_px_(width_px), height_px_(height_px), disparity_(Index(0, height_px), kUncovered) {}

  // Draws a triangle with linearly interpolated disparity. Both sides are drawn because the front
  // of a surface occludes its back. A triangle seen edge-on is not drawn.
  void DrawTriangle(const Vertex& p, const Vertex& q, const Vertex& r);
  // Draws a square of +-0.5 px.
  void DrawSquare(const Vertex& centre);
  // Stores the disparity if it is nearer than the stored one. The sample must be inside.
  void Put(int x, int y, float disparity) {
    float& there = disparity_[Index(x, y)];
    there = there < disparity ? disparity : there;
  }

  bool IsCovered(int x, int y) const { return at(x, y) != kUncovered; }
  bool IsInside(int x, int y) const { return x >= 0 && x < width_px_ && y >= 0 && y < height_px_; }
  float at(int x, int y) const { return disparity_[Index(x, y)]; }
  float* row(int y) { return disparity_.data() + Index(0, y); }
  const float* row(int y) const { return disparity_.data() + Index(0, y); }
  std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px_) +
           static_cast<std::size_t>(x);
  }
  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }

  std::vector<float> TakeDisparity() && { return std::move(disparity_); }

  static constexpr float kUncovered = -std::numeric_limits<float>::infinity();

 private:
  int width_px_;
  int height_px_;
  std::vector<float> disparity_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_DISPARITY_BUFFER_H_
