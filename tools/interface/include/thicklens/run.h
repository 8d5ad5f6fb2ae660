#ifndef THICKLENS_RUN_H_
#define THICKLENS_RUN_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/export.h"

// How a long call is run: the one protocol for threads, cancellation, progress and notices. It
// never changes a result. The functions that may take long have a RunControl parameter. Those that
// read, write or compare single images have none; they take up to some seconds for a large image.
// Reading a depth map has one because its errors name another way to read it.
// Calibrating, verifying, estimating, simulating and explaining report their progress; the other
// functions report none.
namespace thicklens {

// An option whose value is not valid, or that contradicts another option. `field()` is the name of
// the member, for example "solver.tolerance"; the message begins with it and states the value and
// the constraint. It is thrown as soon as the value can be judged, and before any output is
// written.
class THICKLENS_EXPORT OptionError : public Error {
 public:
  // Makes the error of the member `field`, whose name the message must begin with.
  OptionError(std::string field, const std::string& message);
  ~OptionError() override;
  // The path of the member.
  const std::string& field() const { return field_; }

 private:
  std::string field_;
};

// A step of a long call.
struct Progress {
  std::string stage;  // "measuring", "checking the blur", "estimating", "inpainting", "rendering",
                      // "measuring costs"
  int done = 0;       // steps of the stage that are done, 0 to `total`
  int total = 0;      // steps of the stage, >= 1
};

// A remark of a call on what it found or assumed. It does not end the call.
struct Notice {
  // How much a notice matters.
  enum class Level {
    kDetail,       // for whoever examines a run: the device that computes
    kInformation,  // an assumption that is usually right
    kWarning,      // something that may make the result wrong
  };
  Level level = Level::kWarning;  // how much it matters
  std::string text;               // one line
};

// Threads, cancelling, progress and notices of one call.
struct RunControl {
  int threads = 0;  // maximum number of threads, 0 to 1024; 0: one per core
  // A cancelled token ends the call, which throws Interrupted at its next safe point
  // (thicklens/base/cancel.h). Null: the token of the calling thread's CancelScope, if it has one.
  // Not owned.
  const CancelToken* cancel = nullptr;
  // Called for each step, from any thread, never by two threads at once. A stage that has to
  // do a step again reports it again. An exception that the function throws ends the call and is
  // thrown by the call. Empty: none.
  std::function<void(const Progress&)> progress;
  // Called with each notice when it arises, on the calling thread. EstimateDiagnostics,
  // LightFieldScores and RenderSummary also keep them. The warnings of a calibration are in its
  // summary. Empty: none.
  std::function<void(const Notice&)> notice;
  // How errors and notices name an option: it gets the path of the member ("sensor_origin",
  // "depth.meaning.unit") and returns the name that the program's user knows ("--sensor-origin").
  // Where another function of the interface is the remedy, it gets the name of the function
  // ("ReadEmbeddedDepth") and returns what the user would do. Empty: the path or the name itself.
  // OptionError::field() is always the path.
  std::function<std::string(const std::string& field)> option_name;

  // Returns true if `threads` is in its range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

}  // namespace thicklens

#endif  // THICKLENS_RUN_H_
