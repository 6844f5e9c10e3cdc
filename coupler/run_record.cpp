#include "run_record.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <stdexcept>

namespace estuary::coupler {
namespace {

std::ofstream open_for_writing(const std::filesystem::path& path) {
  std::ofstream file(path);
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

}  // namespace

RunRecord::RunRecord(const std::filesystem::path& folder, const CouplingScene& scene) : folder_(folder) {
  std::filesystem::create_directories(folder / "watch");
  iterations_ = open_for_writing(folder / "iterations.csv");
  iterations_ << "window,total_iterations,iterations,verdict,time,residual,wall_s,window_length\n";
  if (scene.participants.size() > 1) {
    convergence_ = open_for_writing(folder / "convergence.csv");
    convergence_
        << "window,iteration,time,residual,velocity_residual,force_residual,relaxation,load_share,"
           "displacement_norm,"
           "force_x,force_y,"
           "moment,fluid_force_x,fluid_force_y,fluid_moment,solid_force_x,solid_force_y,solid_moment,"
           "fluid_power,solid_power,fluid_s,solid_s,fluid_error,solid_error,"
           "unmapped_force_x,unmapped_force_y,unmapped_moment,unmapped_power\n";
  }
}

void RunRecord::check(std::ofstream& file, const std::string& name) const {
  // Flushed row by row, so that what was computed up to a fault is on disk.
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
  check(convergence_, "convergence.csv");
}

void RunRecord::add(const WindowRow& row) {
  fmt::print(iterations_, "{},{},{},{},{:.17g},{:.17g},{:.6f},{:.17g}\n", row.window, row.total_iterations,
             row.iterations, row.verdict, row.time, row.residual, row.wall_s, row.duration);
  check(iterations_, "iterations.csv");
  windows_.push_back(row);
}

std::ofstream& RunRecord::watch_file(const v1::WatchSample& sample) {
  const auto found = watch_files_.find(sample.name());
  if (found != watch_files_.end()) return found->second;
  auto file = open_for_writing(folder_ / "watch" / (sample.name() + ".csv"));
  file << "window,iteration,time";
  for (const auto& quantity : sample.quantity()) file << ',' << quantity;
  file << '\n';
  return watch_files_.emplace(sample.name(), std::move(file)).first->second;
}

void RunRecord::add(const v1::WatchSample& sample, std::uint64_t window, std::uint64_t iteration,
                    double time) {
  std::ofstream& file = watch_file(sample);
  fmt::print(file, "{},{},{:.17g}", window, iteration, time);
  auto& quantities = watches_[sample.name()];
  for (int i = 0; i < sample.quantity_size(); ++i) {
    fmt::print(file, ",{:.17g}", sample.value(i));
    auto& series = quantities[sample.quantity(i)];
    series.time.push_back(time);
    series.value.push_back(sample.value(i));
  }
  file << '\n';
  check(file, "watch/" + sample.name() + ".csv");
}

}  // namespace estuary::coupler
