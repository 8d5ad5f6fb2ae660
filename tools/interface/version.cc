#include "thicklens/version.h"

namespace thicklens {

std::string LibraryVersion() { return THICKLENS_VERSION_STRING; }

}  // namespace thicklens
