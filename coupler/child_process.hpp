// A solver process started by the coupler.
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace estuary::coupler {

/// Finds a program: a path with a slash (from the current folder), beside the coupler, or on PATH, in this
/// order. Nothing when there is no such program that may be executed.
std::optional<std::filesystem::path> find_program(const std::string& name);

/// Runs `words` with `input` on its standard input and returns what it wrote to standard output and its exit
/// status; throws std::runtime_error when it cannot be started or runs longer than `seconds`.
struct Finished {
  std::string output;
  std::string errors;
  int status = 0;  // exit status, or 128 + signal
};
Finished run_program(const std::vector<std::string>& words, const std::string& input, double seconds);

/// A running process in a process group of its own, told to end when the coupler dies. Its destructor ends
/// it.
class ChildProcess {
public:
  /// Output and errors are appended to `log`. Throws std::runtime_error when it cannot be started.
  ChildProcess(const std::vector<std::string>& words, const std::filesystem::path& log);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// How it ended ("killed by signal 9", "exit status 1"), or nothing while it runs.
  std::optional<std::string> ended();
  /// Exit status, or 128 + signal, once it has ended.
  [[nodiscard]] int exit_status() const { return exit_status_; }
  /// Processor time of it and of all processes it has waited for, once it has ended.
  [[nodiscard]] double processor_seconds() const { return processor_seconds_; }
  /// A signal has stopped it (SIGSTOP, SIGTSTP) and none has let it go on.
  [[nodiscard]] bool stopped() const;
  /// SIGTERM to the whole group.
  void ask_to_end() const;
  /// Waits up to `seconds` for its end, then kills the whole group.
  void end(double seconds);
  [[nodiscard]] pid_t process() const { return process_; }

private:
  void note_end(int status, const rusage& used);

  pid_t process_ = -1;
  std::optional<std::string> ended_;
  int exit_status_ = 0;
  double processor_seconds_ = 0;
};

}  // namespace estuary::coupler
