#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_CHILD_PROCESS_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_CHILD_PROCESS_H_

#include <sys/types.h>

#include <string>
#include <vector>

namespace thicklens::tools {

struct ProgramResult {
  int exit_code = -1;  // -1: ended by a signal
  int signal = 0;      // which; 0: none
  std::string out;     // stdout
  std::string err;     // stderr
};

// The program thicklens as a child with its own stdout and stderr.
class ChildProgram {
 public:
  // `max_file_bytes` > 0 limits what it can write, as a full disk does.
  ChildProgram(const std::vector<std::string>& arguments, const std::string& scratch_folder,
               long max_file_bytes);
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;
  ~ChildProgram();

  void Interrupt();  // SIGINT
  void Send(int signal);
  bool Running();
  ProgramResult Wait();

 private:
  std::string out_path_, err_path_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_CHILD_PROCESS_H_
