#ifndef THICKLENS_TOOLS_INTERFACE_WITH_FILE_CONTEXT_H_
#define THICKLENS_TOOLS_INTERFACE_WITH_FILE_CONTEXT_H_

#include <fmt/format.h>

#include <string>

#include "thicklens/run.h"

namespace thicklens {

// Returns the result of `work`. An Error of `work`, which does not know the file, is thrown again
// with the file's printable name in front. `OfCaller` is an error about what the caller states and
// not about the file; it passes unchanged, as Interrupted does.
template <typename OfCaller = OptionError, typename Work>
auto WithFileContext(const std::string& name, const Work& work) {
  try {
    return work();
  } catch (const Interrupted&) {
    throw;
  } catch (const OfCaller&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  }
}

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_WITH_FILE_CONTEXT_H_
