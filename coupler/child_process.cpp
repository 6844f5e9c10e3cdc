#include "child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <thread>

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

bool executable(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error) && ::access(path.c_str(), X_OK) == 0;
}

std::vector<char*> argument_pointers(const std::vector<std::string>& words) {
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (const auto& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

// In the child, between fork and exec: only calls that are safe there.
[[noreturn]] void become(char* const* arguments, pid_t parent) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(127);  // the coupler died before the line above took effect
  ::signal(SIGINT, SIG_DFL);
  ::signal(SIGTERM, SIG_DFL);
  ::signal(SIGPIPE, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  // While one participant computes the others wait; a thread team that spins at its barrier for long takes
  // their cores.
  ::setenv("GOMP_SPINCOUNT", "2000", 0);
  ::execv(arguments[0], arguments);
  constexpr std::string_view message = "cannot be executed\n";
  [[maybe_unused]] const auto ignored = ::write(STDERR_FILENO, message.data(), message.size());
  ::_exit(127);
}

std::string describe_status(int status) {
  if (WIFSIGNALED(status))
    return fmt::format("killed by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  return fmt::format("ended with exit status {}", WEXITSTATUS(status));
}

struct Pipe {
  std::array<int, 2> ends{-1, -1};
  Pipe() {
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error(std::strerror(errno));
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  void close_end(std::size_t end) {
    if (ends[end] >= 0) ::close(ends[end]);
    ends[end] = -1;
  }
};

}  // namespace

std::optional<std::filesystem::path> find_program(const std::string& name) {
  if (name.find('/') != std::string::npos) {
    if (executable(name)) return std::filesystem::absolute(name);
    return std::nullopt;
  }
  std::error_code error;
  const auto own = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error && executable(own.parent_path() / name)) return own.parent_path() / name;
  const char* path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const std::size_t colon = std::min(rest.find(':'), rest.size());
    const std::filesystem::path candidate = std::filesystem::path(rest.substr(0, colon)) / name;
    if (executable(candidate)) return candidate;
    rest.remove_prefix(std::min(colon + 1, rest.size()));
  }
  return std::nullopt;
}

Finished run_program(const std::vector<std::string>& words, const std::string& input, double seconds) {
  Pipe in;
  Pipe out;
  Pipe errors;
  const auto arguments = argument_pointers(words);
  const pid_t parent = ::getpid();
  const pid_t process = ::fork();
  if (process < 0) throw std::runtime_error(std::strerror(errno));
  if (process == 0) {
    ::dup2(in.ends[0], STDIN_FILENO);
    ::dup2(out.ends[1], STDOUT_FILENO);
    ::dup2(errors.ends[1], STDERR_FILENO);
    become(arguments.data(), parent);
  }
  in.close_end(0);
  out.close_end(1);
  errors.close_end(1);
  ::fcntl(in.ends[1], F_SETFL, O_NONBLOCK);
  Finished result;
  std::size_t written = 0;
  const auto deadline = steady_clock::now() + std::chrono::duration<double>(seconds);
  bool late = false;
  while (out.ends[0] >= 0 || errors.ends[0] >= 0) {
    if (written == input.size()) in.close_end(1);
    std::array<pollfd, 3> polled{
        {{in.ends[1], POLLOUT, 0}, {out.ends[0], POLLIN, 0}, {errors.ends[0], POLLIN, 0}}};
    ::poll(polled.data(), polled.size(), 100);
    if (steady_clock::now() > deadline) {
      late = true;
      break;
    }
    if (polled[0].revents != 0) {
      const auto count = ::write(in.ends[1], input.data() + written, input.size() - written);
      if (count > 0) written += static_cast<std::size_t>(count);
      if (count < 0 && errno != EAGAIN) written = input.size();  // it does not read: its answer tells why
    }
    const auto drain = [](Pipe& pipe, short events, std::string& text) {
      if (events == 0) return;
      std::array<char, 65536> buffer;
      const auto count = ::read(pipe.ends[0], buffer.data(), buffer.size());
      if (count > 0) {
        text.append(buffer.data(), static_cast<std::size_t>(count));
      } else if (count == 0 || errno != EINTR) {
        pipe.close_end(0);
      }
    };
    drain(out, polled[1].revents, result.output);
    drain(errors, polled[2].revents, result.errors);
  }
  if (late) ::kill(-process, SIGKILL);
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  if (late) throw std::runtime_error(fmt::format("'{}' did not answer within {} s", words[0], seconds));
  result.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  return result;
}

ChildProcess::ChildProcess(const std::vector<std::string>& words, const std::filesystem::path& log) {
  const int file = ::open(log.c_str(), O_CREAT | O_WRONLY | O_APPEND | O_CLOEXEC, 0644);
  if (file < 0)
    throw std::runtime_error(fmt::format("cannot write {}: {}", log.string(), std::strerror(errno)));
  const auto arguments = argument_pointers(words);
  const pid_t parent = ::getpid();
  process_ = ::fork();
  if (process_ == 0) {
    const int nothing = ::open("/dev/null", O_RDONLY);
    ::dup2(nothing, STDIN_FILENO);
    ::dup2(file, STDOUT_FILENO);
    ::dup2(file, STDERR_FILENO);
    become(arguments.data(), parent);
  }
  const int fork_error = errno;
  ::close(file);
  if (process_ < 0)
    throw std::runtime_error(fmt::format("cannot start '{}': {}", words[0], std::strerror(fork_error)));
  ::setpgid(process_, process_);  // also here: whoever comes first
}

ChildProcess::~ChildProcess() {
  end(0.2);
}

std::optional<std::string> ChildProcess::ended() {
  if (ended_) return ended_;
  int status = 0;
  rusage used{};
  const pid_t result = ::wait4(process_, &status, WNOHANG, &used);
  if (result == process_) {
    note_end(status, used);
  } else if (result < 0 && errno == ECHILD) {
    ended_ = "ended";
  }
  return ended_;
}

bool ChildProcess::stopped() const {
  siginfo_t state{};
  // WNOWAIT: only looked at, so that the next look finds the same.
  return !ended_ && ::waitid(P_PID, static_cast<id_t>(process_), &state, WSTOPPED | WNOHANG | WNOWAIT) == 0 &&
         state.si_pid == process_;
}

void ChildProcess::ask_to_end() const {
  if (!ended_) ::kill(-process_, SIGTERM);
}

void ChildProcess::end(double seconds) {
  const auto deadline = steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!ended() && steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  // The whole group, so that what the solver itself started goes too; a stopped process dies of this as well.
  ::kill(-process_, SIGKILL);
  if (ended_) return;
  int status = 0;
  rusage used{};
  while (::wait4(process_, &status, 0, &used) < 0 && errno == EINTR) {
  }
  note_end(status, used);
}

void ChildProcess::note_end(int status, const rusage& used) {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  ended_ = describe_status(status);
  exit_status_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  processor_seconds_ = seconds(used.ru_utime) + seconds(used.ru_stime);
}

}  // namespace estuary::coupler
