#ifndef THICKLENS_BASE_FORKED_PROCESS_H_
#define THICKLENS_BASE_FORKED_PROCESS_H_

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <initializer_list>

namespace thicklens {

// The common part of all processes that this one makes by fork. Their reports, their ends and the
// signals that they obey differ from one to the other.

// The new process calls this function first. It is killed when `parent` ends, and ends here if that
// is already so. The handlers of the program, which remove its outputs for example, are not for it:
// the signals of `by_default` act as the system says, those of `ignored` not at all, and none is
// blocked. It leaves no core file.
inline void BeginForkedProcess(pid_t parent, std::initializer_list<int> by_default,
                               std::initializer_list<int> ignored) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  for (const int number : ignored) ::signal(number, SIG_IGN);
  for (const int number : by_default) ::signal(number, SIG_DFL);
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
}

// Waits until the process ends, and returns its status as waitpid(2) gives it.
inline int StatusAtEnd(pid_t process) {
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace thicklens

#endif  // THICKLENS_BASE_FORKED_PROCESS_H_
