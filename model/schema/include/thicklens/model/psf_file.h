#ifndef THICKLENS_MODEL_PSF_FILE_H_
#define THICKLENS_MODEL_PSF_FILE_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/measured_psf.h"

namespace thicklens::model {

// The file of a measured PSF, schema thicklens/psf/1 (docs/file-formats.md). Shares of any positive
// sum are accepted and divided by it. Unknown keys, wrong types, rows of unequal length, a negative
// share, no light and a centroid off the middle throw Error with file:line:column; `source_name` is
// the file name in these messages.
THICKLENS_EXPORT MeasuredPsf ReadPsf(const std::string& path);
// Reads the text of such a file.
THICKLENS_EXPORT MeasuredPsf ParsePsf(const std::string& text, const std::string& source_name);

// The YAML text of a measured PSF.
THICKLENS_EXPORT std::string PsfToYaml(const MeasuredPsf& psf);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_PSF_FILE_H_
