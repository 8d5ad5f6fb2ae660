#ifndef THICKLENS_TOOLS_RUN_FILES_H_
#define THICKLENS_TOOLS_RUN_FILES_H_

#include <string>
#include <vector>

#include "option_values.h"

namespace thicklens::tools {

// No output of a run may be one of its inputs, by whatever name: the paths of the command line,
// the files that those name (frames, tables, cameras, textures, maps, views), symbolic and hard
// links to them. All outputs of a run are entered here before anything is read; WatchInputs
// then names every input.

// An output is one of the inputs. Nothing may be written any more, not even to --json.
class InputWouldBeLost : public UsageError {
 public:
  using UsageError::UsageError;
};

// Enters the outputs and begins to watch. Throws UsageError if two of them are the same file, or
// one lies in another that is replaced as a whole, and InputWouldBeLost for an input of the command
// line: it is an output, lies in one, or is the folder of a light field that an output would lie
// in. Empty paths and "-" are left out. A folder of frames may well get its results.
void RequireDistinctFiles(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs);

// Enters an output that may have been entered before.
void EnterRunOutput(const std::string& output);

// Throws InputWouldBeLost if it was thrown before: whoever reads a file may have made another error
// of it.
void RethrowIfInputWouldBeLost();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_RUN_FILES_H_
