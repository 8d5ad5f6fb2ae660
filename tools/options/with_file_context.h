#ifndef THICKLENS_TOOLS_OPTIONS_WITH_FILE_CONTEXT_H_
#define THICKLENS_TOOLS_OPTIONS_WITH_FILE_CONTEXT_H_

#include <string>

#include "thicklens/base/printable_text.h"
#include "tools/interface/with_file_context.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {

// Returns the result of `work`. An Error of `work`, which does not know the file, is rethrown with
// the file's name.
template <typename Work>
auto WithFileContext(const std::string& path, const Work& work) {
  return thicklens::WithFileContext<UsageError>(PrintableUtf8(path), work);
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_WITH_FILE_CONTEXT_H_
