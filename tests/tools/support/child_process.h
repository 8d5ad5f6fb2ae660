#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_CHILD_PROCESS_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_CHILD_PROCESS_H_

#include <sys/types.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"

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
  // `max_file_bytes` > 0 limits how much the program can write, as a full disk does.
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

// Runs the program with --quiet. The test fails if the program does.
void MakeWithProgram(std::vector<std::string> arguments);

// The common part of fixtures of `thicklens estimate`: folders of their own, and an output there.
class EstimateCommand {
 protected:
  using Words = std::vector<std::string>;

  std::string Output() const { return folder_ / "lf"; }
  static Words With(Words arguments, const Words& more);
  ProgramResult Run(Words arguments) const;
  // Returns the JSON of a run that must succeed.
  nlohmann::json Summary(const Words& arguments, ProgramResult* result = nullptr) const;
  // Returns the message of a run that must end with the exit code and without output.
  std::string Refusal(const Words& arguments, int exit_code) const;

  thicklens::testing::TemporaryFolder folder_;
  thicklens::testing::TemporaryFolder scratch_;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_CHILD_PROCESS_H_
