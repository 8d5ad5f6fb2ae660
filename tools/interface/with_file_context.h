#ifndef THICKLENS_TOOLS_INTERFACE_WITH_FILE_CONTEXT_H_
#define THICKLENS_TOOLS_INTERFACE_WITH_FILE_CONTEXT_H_

#include <fmt/format.h>

#include <string>

#include "thicklens/run.h"

namespace thicklens {

// Returns the result of `work`. An Error of `work`, which does not know the file, is thrown again
// with `name`, the file's name, in front.
template <typename Work>
auto WithFileContext(const std::string& name, const Work& work) {
  try {
    return work();
  } catch (const Interrupted&) {
    throw;
  } catch (const OptionError&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  }
}

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_WITH_FILE_CONTEXT_H_
