#include "environment.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <thread>

namespace estuary::coupler {
namespace {

#ifdef __clang__
constexpr const char* compiler = __VERSION__;
#else
constexpr const char* compiler = "g++ " __VERSION__;
#endif

std::string processor_name() {
  std::ifstream stream("/proc/cpuinfo");
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  }
  return "unknown";
}

}  // namespace

std::vector<std::vector<std::string>> environment_rows() {
  utsname system{};
  ::uname(&system);
  return {
      {"this page was made", fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)))},
      {"with Estuary", ESTUARY_VERSION},
      {"compiled by", compiler},
      {"on", fmt::format("{} {}, {}", system.sysname, system.release, system.machine)},
      {"processor", fmt::format("{}, {} threads", processor_name(), std::thread::hardware_concurrency())}};
}

}  // namespace estuary::coupler
