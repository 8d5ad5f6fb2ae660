#include "model/schema/yaml_fields.h"

#include <fmt/format.h>

#include "thicklens/base/error.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

void ReadNumber(const YamlNode& node, const char* key, double* field) {
  if (const auto found = node.Find(key)) *field = found->Number();
}

Eigen::Vector2d ReadPair(const YamlNode& node) {
  const auto numbers = node.ElementsExactly(2);
  return {numbers[0].Number(), numbers[1].Number()};
}

Estimate ReadEstimate(const YamlNode& node, double (YamlNode::*number)() const) {
  if (!node.IsMap()) return {(node.*number)(), 0};
  node.RequireKeys({"value", "sigma"});
  Estimate estimate;
  estimate.value = (node.At("value").*number)();
  if (const auto sigma = node.Find("sigma")) estimate.sigma = sigma->NonNegativeNumber();
  return estimate;
}

LensAberrations ReadAberrations(const YamlNode& node) {
  node.RequireKeys({"field_curvature_mm", "field_astigmatism_mm", "astigmatism_mm", "distortion",
                    "axial_colour_mm"});
  LensAberrations aberrations;
  ReadNumber(node, "field_curvature_mm", &aberrations.field_curvature_mm);
  ReadNumber(node, "field_astigmatism_mm", &aberrations.field_astigmatism_mm);
  ReadNumber(node, "astigmatism_mm", &aberrations.astigmatism_mm);
  ReadNumber(node, "distortion", &aberrations.distortion);
  if (const auto colour = node.Find("axial_colour_mm")) {
    const auto numbers = colour->ElementsExactly(3);
    aberrations.axial_colour_mm.emplace(numbers[0].Number(), numbers[1].Number(),
                                        numbers[2].Number());
  }
  return aberrations;
}

ApertureOutline ReadAperture(const YamlNode& node) {
  node.RequireKeys({"blades", "rotation_deg", "roundness"});
  ApertureOutline aperture;
  aperture.blades = node.At("blades").Integer(0, 1000);
  ReadNumber(node, "rotation_deg", &aperture.rotation_deg);
  ReadNumber(node, "roundness", &aperture.roundness);
  return aperture;
}

TransferCurve ReadTransfer(const YamlNode& node) {
  try {
    return TransferCurve::FromName(node.Text());
  } catch (const Error& e) {
    throw node.ErrorHere(e.what());
  }
}

void ReadTruthValues(const YamlNode& node, const ThickLens& lens, CameraCalibration* truth) {
  if (const auto focus = node.Find("focus_depth_mm")) {
    const double focus_depth_mm = focus->PositiveNumber();
    const double focal_mm = lens.front_focal_length_mm;
    if (!(focus_depth_mm > focal_mm)) {
      throw focus->ErrorHere(fmt::format(
          "must be above the lens's front_focal_length_mm {}, found {}", focal_mm, focus_depth_mm));
    }
    truth->image_distance_mm = Estimate{ImageDistanceMm(lens, focus_depth_mm), 0};
  }
  if (const auto ratio = node.Find("blur_ratio")) {
    truth->blur_ratio = Estimate{ratio->NonNegativeNumber(), 0};
  }
  if (const auto floor = node.Find("blur_floor_px")) {
    truth->blur_floor_px = Estimate{floor->NonNegativeNumber(), 0};
  }
}

Camera ReadCrop(const YamlNode& node, const Camera& camera) {
  const auto sides = node.ElementsExactly(2);
  PixelRect rect;
  rect.width = sides[0].Integer(1, camera.sensor.width_px);
  rect.height = sides[1].Integer(1, camera.sensor.height_px);
  rect.x = (camera.sensor.width_px - rect.width) / 2;
  rect.y = (camera.sensor.height_px - rect.height) / 2;
  return CropCamera(camera, rect);
}

}  // namespace thicklens::model
