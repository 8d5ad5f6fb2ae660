#ifndef THICKLENS_MODEL_LIGHT_FIELD_DESCRIPTION_H_
#define THICKLENS_MODEL_LIGHT_FIELD_DESCRIPTION_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"

namespace thicklens::model {

// Returns what LightField::IsValid returns for everything but the values, which a description
// (DescriptionOf) does not have. `why`, if not null, gets the field and the value that is wrong.
THICKLENS_EXPORT bool IsValidDescription(const LightField& light_field, std::string* why);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_DESCRIPTION_H_
