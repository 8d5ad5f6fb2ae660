#ifndef THICKLENS_MODEL_SCHEMA_RENAMED_KEYS_H_
#define THICKLENS_MODEL_SCHEMA_RENAMED_KEYS_H_

#include "thicklens/base/deprecation.h"

namespace thicklens::model {

// Textures and targets: `kind: image` with `image: FILE` was `kind: picture` with `picture: FILE`.
inline RenamedWord RenamedImage() { return {"picture", "image"}; }

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_RENAMED_KEYS_H_
