#ifndef THICKLENS_TOOLS_OPTIONS_RUN_FILES_H_
#define THICKLENS_TOOLS_OPTIONS_RUN_FILES_H_

#include <string>
#include <vector>

#include "tools/options/option_values.h"

namespace thicklens::tools {

// No output of a run may be one of its inputs under any name: the paths of the command line, the
// files that these name (frames, tables, cameras, textures, maps, views), and symbolic and hard
// links to them. All outputs of a run are entered here before anything is read; WatchInputs then
// checks the name of every input.

// An output is one of the inputs. Nothing may be written any more, not even to --json.
class InputWouldBeLost : public UsageError {
 public:
  using UsageError::UsageError;
};

// Enters the outputs and starts to watch. Throws UsageError if two of them are the same file, or
// one is inside another that is replaced as a whole. Throws InputWouldBeLost for an input of the
// command line that is an output, is inside one, or is the folder of a light field that an output
// would be inside. Empty paths and "-" are left out. A folder of frames may receive its results.
void RequireDistinctFiles(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs);

// Enters an output that may have been entered before.
void EnterRunOutput(const std::string& output);

// Throws InputWouldBeLost if it was thrown before: code that reads a file may have turned it into
// another error.
void RethrowIfInputWouldBeLost();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_RUN_FILES_H_
