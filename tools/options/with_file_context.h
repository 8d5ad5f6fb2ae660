#ifndef THICKLENS_TOOLS_OPTIONS_WITH_FILE_CONTEXT_H_
#define THICKLENS_TOOLS_OPTIONS_WITH_FILE_CONTEXT_H_

#include <fmt/format.h>

#include <string>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {

// Returns the result of `work`. An Error of `work`, which does not know the file, is rethrown with
// the file's name.
template <typename Work>
auto WithFileContext(const std::string& path, const Work& work) {
  try {
    return work();
  } catch (const Interrupted&) {
    throw;
  } catch (const UsageError&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", PrintableUtf8(path), error.what()));
  }
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_WITH_FILE_CONTEXT_H_
