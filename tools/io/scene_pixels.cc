#include "thicklens/io/scene_pixels.h"

#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"

namespace thicklens::io {

std::vector<model::LayerPixels> ReadScenePixels(const model::SceneSimulationOptions& scene) {
  std::vector<model::LayerPixels> pixels(scene.layers.size());
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    const model::SceneLayer& layer = scene.layers[i];
    if (layer.texture.kind == model::TextureKind::kImage) {
      pixels[i].texture = model::ToLinear(ToEncodedImage(ReadImageFile(layer.texture.image_path)),
                                          model::TransferCurve::Srgb());
    }
    if (layer.outline.shape == model::OutlineOptions::Shape::kMask) {
      pixels[i].mask = model::ToLinear(ToEncodedImage(ReadImageFile(layer.outline.mask_path)),
                                       model::TransferCurve::Linear());
    }
    if (layer.depth) pixels[i].depth = ReadDepthMap(layer.depth->map_path);
  }
  return pixels;
}

}  // namespace thicklens::io
