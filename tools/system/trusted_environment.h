#ifndef THICKLENS_TOOLS_SYSTEM_TRUSTED_ENVIRONMENT_H_
#define THICKLENS_TOOLS_SYSTEM_TRUSTED_ENVIRONMENT_H_

#include <string>
#include <vector>

namespace thicklens::tools {

// Removes from the environment what would let a library load code or configuration from the current
// folder, which may hold somebody else's data set, or from a folder that every user may write to:
// variables with a path (of caches, drivers, plugins, temporary files) that is not absolute, and
// the cache of OpenCL programs that PoCL puts into /tmp if there is no home folder. Returns one
// line for each removed variable. Call it before any library reads them.
std::vector<std::string> DistrustRelativePaths();

// Returns the line about a variable that holds one path.
std::string RelativePathIsIgnored(const std::string& name, const std::string& value);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_TRUSTED_ENVIRONMENT_H_
