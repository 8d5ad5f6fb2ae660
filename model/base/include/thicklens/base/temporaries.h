#ifndef THICKLENS_BASE_TEMPORARIES_H_
#define THICKLENS_BASE_TEMPORARIES_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

// What a process has made and will remove or rename before it ends: the unfinished outputs and the
// temporary folders. A process that has to end while a library computes, so that no destructor runs
// in time, removes them by AbandonOutputs.
namespace thicklens {

// What AbandonOutputs does with a folder that is not empty.
enum class Abandon { kWhole, kIfEmpty };

// The entry of one file or folder in the list of this process. Functions may be called from any
// thread.
class Temporary {
 public:
  Temporary() = default;  // of nothing
  // `create` makes the file or folder and returns its path; it must be short and must not make
  // another Temporary. What it throws passes on. After AbandonOutputs it is not called: Interrupted
  // is thrown.
  // kIfEmpty: the folder is one of the person's, outputs come to lie in it, and it is removed only
  // while nothing is in it.
  explicit Temporary(const std::function<std::string()>& create, Abandon abandon = Abandon::kWhole);
  // Takes the entry out of the list. Removes nothing.
  ~Temporary();
  Temporary(Temporary&& other) noexcept;
  Temporary& operator=(Temporary&& other) noexcept;

  // Takes the entry out of the list because the file is complete and stays. Throws Interrupted
  // after AbandonOutputs, which has removed or is about to remove it.
  void Keep();

  const std::string& path() const { return path_; }  // empty: of nothing

 private:
  friend std::optional<Temporary> PutInPlace(
      const std::string& shown, const std::function<std::optional<std::string>()>& put);

  unsigned long long id_ = 0;  // 0: of nothing
  std::string path_;
};

// Runs `put`, which puts the output `shown` in place, typically by a rename. AbandonOutputs comes
// either before all of it, and then Interrupted is thrown here and `put` is not called, or after
// all of it. `put` must be short and must not make or destroy a Temporary. It returns the path of
// what it has replaced, if that is still to be removed, or else an empty one: the result lists it.
// std::nullopt: nothing was put in place, and the result is empty as well.
std::optional<Temporary> PutInPlace(const std::string& shown,
                                    const std::function<std::optional<std::string>()>& put);

// The outputs that this process has put in place, those in temporary folders apart, as they were
// named for messages.
std::vector<std::string> OutputsInPlace();

// Removes every file and folder in the list whose path still leads to what was made there, the
// newest first. From
// then on no output is put in place and no temporary is made. Meant for the last moment of a
// process: other threads may be at work, and what they try afterwards fails. Returns
// OutputsInPlace. Waits to its end for an output that is being put in place, and no longer than
// `limit_s` for a thread that is about to create a temporary and for folders in which other threads
// are still making files.
std::vector<std::string> AbandonOutputs(double limit_s);

}  // namespace thicklens

#endif  // THICKLENS_BASE_TEMPORARIES_H_
