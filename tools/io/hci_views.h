#ifndef THICKLENS_TOOLS_IO_HCI_VIEWS_H_
#define THICKLENS_TOOLS_IO_HCI_VIEWS_H_

#include <string>
#include <vector>

namespace thicklens::io {

// Returns the numbers NNN of the views input_CamNNN.png in the folder, in ascending order. Throws
// Error if the folder cannot be read.
std::vector<int> HciNumbers(const std::string& folder);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_HCI_VIEWS_H_
