#include "tools/support/child_process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <stdexcept>

#include "thicklens/base/output_file.h"
#include "tools/system/program_run.h"

namespace thicklens::tools {
namespace {

// Uses only functions that are allowed between fork and exec.
void RedirectTo(const char* path, int descriptor) {
  const int file = ::open(path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  ::dup2(file, descriptor);
  ::close(file);
}

}  // namespace

ChildProgram::ChildProgram(const std::vector<std::string>& arguments,
                           const std::string& scratch_folder, long max_file_bytes)
    : out_path_(scratch_folder + "/stdout"), err_path_(scratch_folder + "/stderr") {
  std::vector<std::string> all = {THICKLENS_PROGRAM};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& argument : all) argv.push_back(argument.data());
  argv.push_back(nullptr);
  pid_ = ::fork();
  if (pid_ < 0) throw std::runtime_error("no child process could be started");
  if (pid_ > 0) return;
  // If the tests run in the background, these signals may be ignored, and the program would inherit
  // that.
  for (const int signal : {SIGINT, SIGHUP}) ::signal(signal, SIG_DFL);
  RedirectTo(out_path_.c_str(), STDOUT_FILENO);
  RedirectTo(err_path_.c_str(), STDERR_FILENO);
  if (max_file_bytes > 0) {
    const rlimit limit{static_cast<rlim_t>(max_file_bytes), static_cast<rlim_t>(max_file_bytes)};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

ChildProgram::~ChildProgram() {
  if (ended_) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, &status_, 0);
}

void ChildProgram::Interrupt() { Send(SIGINT); }

void ChildProgram::Send(int signal) {
  if (!ended_) ::kill(pid_, signal);
}

bool ChildProgram::Running() {
  if (!ended_) ended_ = ::waitpid(pid_, &status_, WNOHANG) == pid_;
  return !ended_;
}

ProgramResult ChildProgram::Wait() {
  if (!ended_) ::waitpid(pid_, &status_, 0);
  ended_ = true;
  return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1,
          WIFSIGNALED(status_) ? WTERMSIG(status_) : 0, ReadWholeFile(out_path_),
          ReadWholeFile(err_path_)};
}

void MakeWithProgram(std::vector<std::string> arguments) {
  arguments.emplace_back("--quiet");
  const thicklens::testing::TemporaryFolder scratch;
  const ProgramResult result = ChildProgram(arguments, scratch.path(), 0).Wait();
  ASSERT_EQ(result.exit_code, 0) << ShellCommand(arguments) << "\n" << result.err;
}

EstimateCommand::Words EstimateCommand::With(Words arguments, const Words& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

ProgramResult EstimateCommand::Run(Words arguments) const {
  arguments.insert(arguments.begin(), "estimate");
  arguments.insert(arguments.end(), {"-o", Output()});
  return ChildProgram(arguments, scratch_.path(), 0).Wait();
}

nlohmann::json EstimateCommand::Summary(const Words& arguments, ProgramResult* result) const {
  const std::string path = folder_ / "summary.json";
  const ProgramResult ended = Run(With(arguments, {"--json", path}));
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  if (result != nullptr) *result = ended;
  return nlohmann::json::parse(thicklens::testing::ContentOf(path));
}

std::string EstimateCommand::Refusal(const Words& arguments, int exit_code) const {
  const ProgramResult result = Run(arguments);
  EXPECT_EQ(result.exit_code, exit_code) << result.err;
  EXPECT_FALSE(std::filesystem::exists(Output()));
  return result.err;
}

}  // namespace thicklens::tools
