#include "thicklens/base/temporaries.h"

#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "thicklens/base/error.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// A path and the identity of the file or folder that was made there.
struct Entry {
  std::string path;
  dev_t device = 0;
  ino_t inode = 0;
  Abandon abandon = Abandon::kWhole;

  bool IsStillThere() const {
    struct stat now {};
    return ::lstat(path.c_str(), &now) == 0 && now.st_dev == device && now.st_ino == inode;
  }
};

struct List {
  std::timed_mutex mutex;  // protects the members below
  std::map<unsigned long long, Entry> entries;
  unsigned long long last_id = 0;
  std::vector<std::string> in_place;
  bool is_abandoned = false;
  std::atomic<bool> is_putting{false};  // a thread holds the mutex and puts an output in place
};

// The list is never destroyed, because threads may need it while the process ends.
List& TheList() {
  static List& list = *new List;
  return list;
}

Entry EntryOf(std::string path, Abandon abandon) {
  struct stat made {};
  if (::lstat(path.c_str(), &made) != 0) return {std::move(path), 0, 0, abandon};
  return {std::move(path), made.st_dev, made.st_ino, abandon};
}

class Putting {
 public:
  explicit Putting(std::atomic<bool>* is_putting) : is_putting_(is_putting) { *is_putting_ = true; }
  ~Putting() { *is_putting_ = false; }
  Putting(const Putting&) = delete;
  Putting& operator=(const Putting&) = delete;

 private:
  std::atomic<bool>* is_putting_;
};

// Other threads may create files in a folder while it is emptied; removal is then repeated until
// the deadline.
void Remove(const Entry& entry, Clock::time_point deadline) {
  constexpr auto kPause = std::chrono::milliseconds(5);
  std::error_code ignored;
  if (entry.abandon == Abandon::kIfEmpty) {
    if (entry.IsStillThere()) fs::remove(entry.path, ignored);
    return;
  }
  while (entry.IsStillThere()) {
    fs::remove_all(entry.path, ignored);
    if (Clock::now() > deadline) return;
    if (entry.IsStillThere()) std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

Temporary::Temporary(const std::function<std::string()>& create, Abandon abandon) {
  List& list = TheList();
  const std::lock_guard<std::timed_mutex> lock(list.mutex);
  if (list.is_abandoned) throw Interrupted();
  const auto at = list.entries.emplace(++list.last_id, Entry()).first;
  try {
    path_ = create();
    at->second = EntryOf(path_, abandon);
  } catch (...) {
    list.entries.erase(at);
    throw;
  }
  id_ = at->first;
}

Temporary::~Temporary() {
  if (id_ == 0) return;
  List& list = TheList();
  const std::lock_guard<std::timed_mutex> lock(list.mutex);
  list.entries.erase(id_);
}

void Temporary::Keep() {
  List& list = TheList();
  const std::lock_guard<std::timed_mutex> lock(list.mutex);
  if (list.is_abandoned) throw Interrupted();
  list.entries.erase(std::exchange(id_, 0));
}

Temporary::Temporary(Temporary&& other) noexcept
    : id_(std::exchange(other.id_, 0)), path_(std::move(other.path_)) {}

Temporary& Temporary::operator=(Temporary&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(path_, other.path_);
  return *this;
}

std::optional<Temporary> PutInPlace(const std::string& shown,
                                    const std::function<std::optional<std::string>()>& put) {
  List& list = TheList();
  const std::lock_guard<std::timed_mutex> lock(list.mutex);
  if (list.is_abandoned) throw Interrupted();
  const Putting putting(&list.is_putting);
  const std::optional<std::string> replaced = put();
  if (!replaced) return std::nullopt;
  // An output in a temporary folder is removed with the folder and is not reported.
  const bool is_temporary =
      std::any_of(list.entries.begin(), list.entries.end(), [&](const auto& entry) {
        const std::string& folder = entry.second.path;
        return entry.second.abandon == Abandon::kWhole && !folder.empty() &&
               shown.rfind(folder + "/", 0) == 0;
      });
  if (!is_temporary) list.in_place.push_back(shown);
  Temporary rest;
  if (!replaced->empty()) {
    rest.path_ = *replaced;
    rest.id_ = ++list.last_id;
    list.entries.emplace(rest.id_, EntryOf(*replaced, Abandon::kWhole));
  }
  return rest;
}

std::vector<std::string> OutputsInPlace() {
  List& list = TheList();
  const std::lock_guard<std::timed_mutex> lock(list.mutex);
  return list.in_place;
}

std::vector<std::string> AbandonOutputs(double limit_s) {
  const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(limit_s));
  List& list = TheList();
  std::map<unsigned long long, Entry> entries;
  std::vector<std::string> in_place;
  {
    std::unique_lock<std::timed_mutex> lock(list.mutex, deadline);
    // An output that is being moved to its target would be left incomplete. Its end is always
    // waited for.
    constexpr auto kPause = std::chrono::milliseconds(20);
    while (!lock.owns_lock() && list.is_putting) static_cast<void>(lock.try_lock_for(kPause));
    if (!lock.owns_lock()) return {};
    list.is_abandoned = true;
    entries = list.entries;
    in_place = list.in_place;
  }
  // The newest entries are removed first, because a folder is older than its content.
  for (auto entry = entries.rbegin(); entry != entries.rend(); ++entry)
    Remove(entry->second, deadline);
  return in_place;
}

}  // namespace thicklens
