#ifndef THICKLENS_TESTS_SUPPORT_MATRIX_LENS_H_
#define THICKLENS_TESTS_SUPPORT_MATRIX_LENS_H_

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/thick_lens.h"

namespace thicklens::testing {

// One refracting surface. The radius is positive if its centre of curvature is on the sensor side.
struct RefractingSurface {
  double radius_mm = 0;
  double index_after = 1;
  double to_next_vertex_mm = 0;  // 0 at the last surface
};

// Paraxial rays through a row of refracting surfaces, one surface after the other: an oracle for
// the thick-lens formulas. The class uses no focal lengths or principal planes, but reads them from
// the product of the matrices.
//
// A ray is (height, slope). Light travels in +y of the axis coordinate, which is 0 at the first
// vertex.
class MatrixLens {
 public:
  MatrixLens(std::string name, double index_before, std::vector<RefractingSurface> surfaces)
      : name_(std::move(name)), index_before_(index_before), surfaces_(std::move(surfaces)) {
    system_ = Eigen::Matrix2d::Identity();
    double index = index_before_;
    for (const RefractingSurface& surface : surfaces_) {
      system_ = Gap(surface.to_next_vertex_mm) * Refraction(surface, index) * system_;
      index = surface.index_after;
      last_vertex_mm_ += surface.to_next_vertex_mm;
    }
    index_after_ = index;
  }

  const std::string& name() const { return name_; }
  double index_before() const { return index_before_; }
  double index_after() const { return index_after_; }

  // A ray that is parallel to the axis at height 1 leaves with slope C at height A. The rear
  // principal plane is where its height is 1, the rear focal point where it is 0.
  double rear_principal_mm() const { return last_vertex_mm_ + (1 - system_(0, 0)) / system_(1, 0); }
  double rear_focal_point_mm() const { return last_vertex_mm_ - system_(0, 0) / system_(1, 0); }

  // The ray that leaves parallel at height 1 enters as the inverse matrix says.
  double front_principal_mm() const {
    const Eigen::Vector2d in = RayThatLeavesParallel();
    return (1 - in(0)) / in(1);
  }
  double front_focal_point_mm() const {
    const Eigen::Vector2d in = RayThatLeavesParallel();
    return -in(0) / in(1);
  }

  // This lens as a lens of the model.
  model::ThickLens AsThickLens(double aperture_radius_mm) const {
    model::ThickLens lens;
    lens.front_focal_length_mm = front_principal_mm() - front_focal_point_mm();
    lens.rear_focal_length_mm = rear_focal_point_mm() - rear_principal_mm();
    lens.lens_thickness_mm = rear_principal_mm() - front_principal_mm();
    lens.aperture_radius_mm = aperture_radius_mm;
    return lens;
  }

  // Returns the ray behind the last surface: its height extrapolated to the aperture plane, and its
  // slope. In front, the ray passes height `object_mm` at `depth_mm` before the aperture plane (the
  // front principal plane) and is aimed at height `aperture_mm` on that plane.
  Eigen::Vector2d Trace(double object_mm, double depth_mm, double aperture_mm) const {
    return TraceSlope(aperture_mm, (aperture_mm - object_mm) / depth_mm);
  }

  // Traces a ray given by its height on the aperture plane and its slope in front.
  Eigen::Vector2d TraceSlope(double aperture_mm, double slope) const {
    Eigen::Vector2d ray = Gap(-front_principal_mm()) * Eigen::Vector2d(aperture_mm, slope);
    double index = index_before_;
    for (const RefractingSurface& surface : surfaces_) {
      ray = Refraction(surface, index) * ray;
      ray = Gap(surface.to_next_vertex_mm) * ray;
      index = surface.index_after;
    }
    return Gap(front_principal_mm() - last_vertex_mm_) * ray;
  }

  // Height of the ray of Trace() on a sensor `image_distance_mm` behind the aperture plane.
  double Landing(double object_mm, double depth_mm, double aperture_mm,
                 double image_distance_mm) const {
    return (Gap(image_distance_mm) * Trace(object_mm, depth_mm, aperture_mm))(0);
  }

  // Distance behind the aperture plane, mm, at which the rays of a point on the axis meet again.
  double ConjugateMm(double depth_mm) const {
    const Eigen::Vector2d ray = Trace(0, depth_mm, 1);
    return -ray(0) / ray(1);
  }

 private:
  static Eigen::Matrix2d Gap(double distance_mm) {
    Eigen::Matrix2d m;
    m << 1, distance_mm, 0, 1;
    return m;
  }

  // Paraxial refraction law at height h: n' slope' = n slope - (n' - n) h/R.
  static Eigen::Matrix2d Refraction(const RefractingSurface& surface, double index_before) {
    const double after = surface.index_after;
    Eigen::Matrix2d m;
    m << 1, 0, (index_before - after) / (after * surface.radius_mm), index_before / after;
    return m;
  }

  Eigen::Vector2d RayThatLeavesParallel() const {
    const double determinant = system_(0, 0) * system_(1, 1) - system_(0, 1) * system_(1, 0);
    return Eigen::Vector2d(system_(1, 1), -system_(1, 0)) / determinant;
  }

  std::string name_;
  double index_before_;
  double index_after_ = 1;
  double last_vertex_mm_ = 0;
  std::vector<RefractingSurface> surfaces_;
  Eigen::Matrix2d system_;
};

// Lenses of all kinds for which the formulas must hold. rho is positive unless the name says
// otherwise.
inline std::vector<MatrixLens> MatrixLenses() {
  return {
      // Here f1 = f2.
      {"biconvex in air", 1, {{14, 1.52, 4}, {-18, 1, 0}}},
      {"meniscus in air", 1, {{8, 1.7, 3}, {25, 1, 0}}},
      // This lens is thicker than a ball of the same radii, so the principal planes cross.
      {"crossed planes in air", 1, {{10, 1.5, 25}, {-10, 1, 0}}},
      // Two separate positive lenses, as in an early camera lens. The planes cross here, too.
      {"crossed planes, two lenses", 1, {{30, 1.6, 2}, {-30, 1, 16}, {30, 1.6, 2}, {-30, 1, 0}}},
      // Here f2/f1 = n2/n1.
      {"water in front", 1.333, {{9, 1.62, 4}, {-11, 1, 0}}},
      {"oil behind", 1, {{12, 1.6, 3}, {-30, 1.4, 0}}},
      {"crossed planes, water in front", 1.333, {{12, 1.9, 30}, {-12, 1, 0}}},
      {"crossed planes, oil behind", 1, {{12, 1.5, 34}, {-16, 1.1, 0}}},
  };
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_MATRIX_LENS_H_
