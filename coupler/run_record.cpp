#include "run_record.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ostream.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "csv_file.hpp"

namespace estuary::coupler {
namespace {

const std::string iterations_name = "iterations.csv";
const std::string convergence_name = "convergence.csv";
// Before the quantities of a watch.
constexpr const char* watch_columns = "window,iteration,time";

std::string watch_name(const std::string& watch) {
  return "watch/" + watch + ".csv";
}

// What was written so far survives the machine's end too.
void bring_to_disk(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0 || ::fsync(descriptor) != 0) {
    const std::string why = std::strerror(errno);
    if (descriptor >= 0) ::close(descriptor);
    throw std::runtime_error(fmt::format("cannot bring {} to the disk: {}", path.string(), why));
  }
  ::close(descriptor);
}

std::ofstream open_for_writing(const std::filesystem::path& path, std::ios::openmode mode = std::ios::out) {
  std::ofstream file(path, mode);
  if (!file) throw std::runtime_error(fmt::format("cannot write {}", path.string()));
  return file;
}

std::string optional_text(const std::optional<double>& value) {
  return value ? fmt::format("{:.17g}", *value) : std::string();
}

std::string mapping_text(const std::optional<std::array<double, 4>>& sums) {
  return sums ? fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}", (*sums)[0], (*sums)[1], (*sums)[2], (*sums)[3])
              : std::string(",,,");
}

std::vector<WindowRow> read_windows(const std::filesystem::path& path) {
  std::vector<WindowRow> windows;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);  // the names
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    // The only text in it has spaces ("not converged"): it is taken out first.
    WindowRow row;
    const auto begin = line.find_first_of("abcdefghijklmnopqrstuvwxyz");
    const auto end = line.find_first_of("0123456789", begin);
    if (begin == std::string::npos || end == std::string::npos) continue;
    row.verdict = line.substr(begin, end - begin - 1);
    std::istringstream numbers(line.substr(0, begin) + line.substr(end));
    numbers >> row.window >> row.total_iterations >> row.iterations >> row.time >> row.residual >>
        row.wall_s >> row.duration;
    windows.push_back(std::move(row));
  }
  return windows;
}

std::map<std::string, WatchSeries> read_watch(const std::filesystem::path& path) {
  const auto table = read_csv(path);
  const auto* time = table ? table->column("time") : nullptr;
  std::map<std::string, WatchSeries> quantities;
  if (time == nullptr) return quantities;
  constexpr std::size_t first_quantity = 3;  // after window, iteration, time
  for (std::size_t k = first_quantity; k < table->names.size(); ++k)
    quantities[table->names[k]] = {*time, table->columns[k]};
  return quantities;
}

}  // namespace

RunRecord::RunRecord(const std::filesystem::path& folder, const CouplingScene& scene)
    : folder_(folder), coupled_(scene.participants.size() > 1) {
  begin_anew();
}

RunRecord::RunRecord(const std::filesystem::path& folder, const CouplingScene& scene,
                     const RecordPosition& position)
    : folder_(folder), coupled_(scene.participants.size() > 1) {
  go_back(position);
}

void RunRecord::begin_anew() {
  // What they still hold back goes to the old files, not into the new ones.
  iterations_.close();
  convergence_.close();
  watch_files_.clear();
  std::filesystem::remove_all(folder_ / "watch");
  std::filesystem::create_directories(folder_ / "watch");
  iterations_ = open_for_writing(folder_ / iterations_name);
  iterations_ << "window,total_iterations,iterations,verdict,time,residual,wall_s,window_length\n";
  check(iterations_, iterations_name);
  if (coupled_) {
    convergence_ = open_for_writing(folder_ / convergence_name);
    convergence_
        << "window,iteration,time,residual,velocity_residual,force_residual,relaxation,load_share,"
           "displacement_norm,"
           "force_x,force_y,"
           "moment,fluid_force_x,fluid_force_y,fluid_moment,solid_force_x,solid_force_y,solid_moment,"
           "fluid_power,solid_power,fluid_s,solid_s,fluid_error,solid_error,"
           "unmapped_force_x,unmapped_force_y,unmapped_moment,unmapped_power\n";
    check(convergence_, convergence_name);
  }
}

RecordPosition RunRecord::position() {
  flush();
  RecordPosition position;
  for (const auto& [name, file] : files()) {
    bring_to_disk(folder_ / name);
    position[name] = std::filesystem::file_size(folder_ / name);
  }
  return position;
}

void RunRecord::go_back(const RecordPosition& position) {
  for (const auto& [name, size] : position) {
    std::error_code missing;
    if (std::filesystem::file_size(folder_ / name, missing) < size || missing)
      throw std::runtime_error(fmt::format("{} does not reach as far as the checkpoint does", name));
  }
  iterations_.close();
  convergence_.close();
  watch_files_.clear();
  // A watch that had no row yet has no file.
  if (std::filesystem::exists(folder_ / "watch")) {
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "watch")) {
      if (!position.contains(watch_name(entry.path().stem().string()))) std::filesystem::remove(entry.path());
    }
  }
  for (const auto& [name, size] : position) {
    std::filesystem::resize_file(folder_ / name, size);
    auto file = open_for_writing(folder_ / name, std::ios::app);
    if (name == iterations_name) {
      iterations_ = std::move(file);
    } else if (name == convergence_name) {
      convergence_ = std::move(file);
    } else {
      const std::string watch = std::filesystem::path(name).stem().string();
      std::string names;
      if (!std::getline(std::ifstream(folder_ / name), names) || !names.starts_with(watch_columns))
        throw std::runtime_error(fmt::format("{} cannot be read back", name));
      watch_files_.emplace(watch, std::move(file));
    }
  }
}

RecordedRun RunRecord::read() {
  for (const auto& [name, file] : files()) file->flush();
  RecordedRun run{.windows = read_windows(folder_ / iterations_name), .watches = {}};
  for (const auto& [name, file] : watch_files_) run.watches[name] = read_watch(folder_ / watch_name(name));
  return run;
}

void RunRecord::check(std::ofstream& file, const std::string& name) const {
  file.flush();
  if (!file)
    throw std::runtime_error(fmt::format("cannot write {}: is the disk full?", (folder_ / name).string()));
}

void RunRecord::add(const IterationRow& row) {
  fmt::print(convergence_,
             "{},{},{:.17g},{:.17g},{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:."
             "17g},{:.17g},"
             "{:.17g},{:.17g},{:.17g},{:.17g},{:.6f},{:.6f},{:.17g},{:.17g},{}\n",
             row.window, row.iteration, row.time, row.residual, optional_text(row.velocity_residual),
             optional_text(row.force_residual), row.relaxation, row.load_share, row.displacement_norm,
             row.force[0], row.force[1], row.moment, row.fluid_force[0], row.fluid_force[1], row.fluid_moment,
             row.solid_force[0], row.solid_force[1], row.solid_moment, row.fluid_power, row.solid_power,
             row.fluid_s, row.solid_s, row.fluid_error, row.solid_error, mapping_text(row.before_mapping));
}

void RunRecord::add(const WindowRow& row) {
  fmt::print(iterations_, "{},{},{},{},{:.17g},{:.17g},{:.6f},{:.17g}\n", row.window, row.total_iterations,
             row.iterations, row.verdict, row.time, row.residual, row.wall_s, row.duration);
}

std::map<std::string, std::ofstream*> RunRecord::files() {
  std::map<std::string, std::ofstream*> all{{iterations_name, &iterations_}};
  if (coupled_) all.emplace(convergence_name, &convergence_);
  for (auto& [name, file] : watch_files_) all.emplace(watch_name(name), &file);
  return all;
}

void RunRecord::flush() {
  for (const auto& [name, file] : files()) check(*file, name);
  flushed_ = std::chrono::steady_clock::now();
}

bool RunRecord::flush_if_due() {
  // Row by row it would cost as much as the smallest windows' exchange.
  constexpr std::chrono::milliseconds interval{20};
  if (std::chrono::steady_clock::now() - flushed_ < interval) return false;
  flush();
  return true;
}

std::ofstream& RunRecord::watch_file(const v1::WatchSample& sample) {
  const auto found = watch_files_.find(sample.name());
  if (found != watch_files_.end()) return found->second;
  auto file = open_for_writing(folder_ / watch_name(sample.name()));
  file << watch_columns;
  for (const auto& quantity : sample.quantity()) file << ',' << quantity;
  file << '\n';
  return watch_files_.emplace(sample.name(), std::move(file)).first->second;
}

void RunRecord::add(const v1::WatchSample& sample, std::uint64_t window, std::uint64_t iteration,
                    double time) {
  std::ofstream& file = watch_file(sample);
  fmt::print(file, "{},{},{:.17g}", window, iteration, time);
  for (const double value : sample.value()) fmt::print(file, ",{:.17g}", value);
  file << '\n';
}

}  // namespace estuary::coupler
