#ifndef THICKLENS_BASE_TEMPORARIES_H_
#define THICKLENS_BASE_TEMPORARIES_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

// The list of the files and folders that a process has made and will remove or rename before it
// ends: the unfinished outputs and the temporary folders. A process that must end while a library
// computes, so that no destructor runs in time, removes them by AbandonOutputs.
namespace thicklens {

// Treatment of a folder by AbandonOutputs: remove it with its content (kWhole), or only if it is
// empty (kIfEmpty).
enum class Abandon { kWhole, kIfEmpty };

// The entry of one file or folder in the list of this process. Functions may be called from any
// thread.
class THICKLENS_EXPORT Temporary {
 public:
  Temporary() = default;  // no entry
  // `create` makes the file or folder and returns its path. It must be short and must not make
  // another Temporary. Its exceptions propagate. After AbandonOutputs, Interrupted is thrown and
  // `create` is not called.
  // kIfEmpty is for a folder of the user in which outputs are placed; it is removed only while it
  // is empty.
  explicit Temporary(const std::function<std::string()>& create, Abandon abandon = Abandon::kWhole);
  // Removes the entry from the list, but not the file or folder.
  ~Temporary();
  Temporary(Temporary&& other) noexcept;
  Temporary& operator=(Temporary&& other) noexcept;

  // Removes the entry from the list because the file is complete and will be kept. Throws
  // Interrupted after AbandonOutputs, which has removed the file or is about to remove it.
  void Keep();

  const std::string& path() const { return path_; }  // empty: no entry

 private:
  friend std::optional<Temporary> PutInPlace(
      const std::string& shown, const std::function<std::optional<std::string>()>& put);

  unsigned long long id_ = 0;  // 0: no entry
  std::string path_;
};

// Runs `put`, which moves the output `shown` to its target, typically by a rename. AbandonOutputs
// runs either before `put` or after it, never during it; if it ran before, Interrupted is thrown
// and `put` is not called. `put` must be short and must not make or destroy a Temporary. It
// returns the path of the replaced file or folder if that must still be removed, otherwise an empty
// path. The result is the list entry of that path. If `put` returns std::nullopt, nothing was moved
// and the result is std::nullopt as well.
THICKLENS_EXPORT std::optional<Temporary> PutInPlace(
    const std::string& shown, const std::function<std::optional<std::string>()>& put);

// The outputs that this process has moved to their targets, by their names for messages. Outputs in
// temporary folders are not included.
THICKLENS_EXPORT std::vector<std::string> OutputsInPlace();

// Removes every file and folder in the list whose path still leads to the file or folder that was
// made there, the newest first. Afterwards no output is moved to its target and no temporary is
// made. The function is for the end of a process: other threads may still run, and their later
// attempts fail. Returns OutputsInPlace, or an empty list if the time limit passed before the list
// was available. An output that is being moved to its target is always waited for. The wait for a
// thread that is about to create a temporary, and for folders in which other threads are still
// making files, is limited to `limit_s`, in seconds.
THICKLENS_EXPORT std::vector<std::string> AbandonOutputs(double limit_s);

}  // namespace thicklens

#endif  // THICKLENS_BASE_TEMPORARIES_H_
