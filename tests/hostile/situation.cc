#include "hostile/situation.h"

namespace thicklens::hostile {

std::vector<Situation>& Situations() {
  static std::vector<Situation> situations;
  return situations;
}

bool ListSituation(const std::string& test, const std::string& done, const std::string& required) {
  Situations().push_back({test, done, required});
  return true;
}

}  // namespace thicklens::hostile
