#ifndef THICKLENS_TOOLS_INTERFACE_RUN_SCOPE_H_
#define THICKLENS_TOOLS_INTERFACE_RUN_SCOPE_H_

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/run.h"

namespace thicklens {

// The lifetime of a call of the interface: its cancel token is that of this thread, and notices are
// kept and handed on.
class RunScope {
 public:
  explicit RunScope(const RunControl& run)
      : run_(run), scope_(run.cancel != nullptr ? run.cancel : CurrentCancelToken()) {}

  const RunControl& control() const { return run_; }
  int threads() const { return run_.threads; }

  // The progress of a stage in the form that the modules call. It is a safe point too. Never
  // empty: a module without a callback has fewer safe points.
  std::function<void(int, int)> ProgressOf(std::string stage) const {
    return [this, stage = std::move(stage), token = CurrentCancelToken()](int done, int total) {
      if (token != nullptr && token->IsCancelled()) throw Interrupted();
      if (run_.progress) run_.progress({stage, done, total});
    };
  }

  // The name by which the program's user knows an option.
  std::string Option(const std::string& field) const {
    return run_.option_name ? run_.option_name(field) : field;
  }

  void Warn(const std::string& text) { Note(Notice::Level::kWarning, text); }
  void Detail(const std::string& text) { Note(Notice::Level::kDetail, text); }
  void Inform(const std::string& text) { Note(Notice::Level::kInformation, text); }
  const std::vector<Notice>& notices() const { return notices_; }

 private:
  void Note(Notice::Level level, const std::string& text) {
    notices_.push_back({level, text});
    if (run_.notice) run_.notice(notices_.back());
  }

  const RunControl& run_;
  const CancelScope scope_;
  std::vector<Notice> notices_;
};

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_RUN_SCOPE_H_
