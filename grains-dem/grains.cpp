#include "grains.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "wet_surface.hpp"

namespace estuary::grains {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kStepsBetweenAudits = 10'000;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

void require(const char* field, const google::protobuf::RepeatedField<double>& values, std::size_t size) {
  if (static_cast<std::size_t>(values.size()) != size)
    throw BadInput(field, fmt::format("{} numbers, expected {}", values.size(), size));
  for (int k = 0; k < values.size(); ++k)
    if (!std::isfinite(values[k])) throw BadInput(field, fmt::format("number {} is {}", k, values[k]));
}

std::span<const double> view(const google::protobuf::RepeatedField<double>& field) {
  return {field.data(), static_cast<std::size_t>(field.size())};
}

std::vector<double> displaced(const v1::WetSurface& surface, const v1::Displacements& displacements) {
  std::vector<double> position(surface.reference_positions().begin(), surface.reference_positions().end());
  for (std::size_t k = 0; k < position.size(); ++k)
    position[k] += displacements.displacement(static_cast<int>(k));
  return position;
}

}  // namespace

Identity Grains::identity() const {
  return {.name = "grains-dem",
          .version = ESTUARY_VERSION,
          .roles = {"grains"},
          .capabilities = {"transient", "steady", "grains", "wet-surface", "rewind", "checkpoint"},
          .dimensions = {2, 3}};
}

UnknownGrain::UnknownGrain(const WatchScene& watch, std::size_t count)
    : std::invalid_argument(fmt::format("there is no grain {}: they count from 0 to {}", watch.grain,
                                        static_cast<std::ptrdiff_t>(count) - 1)),
      watch_(watch.name) {}

Plan Grains::configure(Scene& scene, const std::string& role) {
  scene_ = read_grains_scene(scene, role);
  if (!scene.problems().empty()) return {};
  try {
    return plan_of(scene_);
  } catch (const UnknownGrain& error) {
    for (SceneTable& table : scene.root().tables("watch"))
      if (table.text_or("name", "") == error.watch()) table.problem("grain", error.what());
    return {};
  } catch (const std::invalid_argument& error) {
    // A sample file that cannot be read, grains that do not fit.
    scene.root().table(role).problem("group", error.what());
    return {};
  }
}

v1::Exchange Grains::start(const v1::Exchange& initial, const std::filesystem::path& folder) {
  folder_ = folder;
  std::filesystem::create_directories(folder_);
  surface_.Clear();
  std::vector<double> positions;
  if (initial.has_wet_surface()) {
    surface_ = initial.wet_surface();
    check_wet_surface(surface_);
    check_displacements(initial.displacements(), surface_);
    positions = displaced(surface_, initial.displacements());
  } else if (scene_.coupled_to_solid) {
    throw BadInput("initial.wet_surface", "the scene has a solid, but no wet surface was sent");
  }
  const DepositMonitor monitor = [this](double part) {
    if (board_ == nullptr) return;
    board_->report(part, "deposit");
    if (board_->stop_requested()) throw Interrupted();
  };
  try {
    medium_ = make_medium(scene_, initial.has_wet_surface() ? &surface_ : nullptr, positions, monitor);
  } catch (const Breakdown& breakdown) {
    throw Diverged("position",
                   fmt::format("grain {} {}, while grains are deposited", breakdown.grain, breakdown.what()),
                   breakdown.advice);
  }
  if (scene_.repeats_windows) medium_->keep();
  series_ = std::make_unique<FieldSeries>(folder_, "frame");
  work_ = {};
  // Positions, velocities, forces and radii once per step; per pair index, image, mass and history, and the
  // partner.
  work_.bytes_per_update = 150 + medium_->pairs_per_grain() * 90;
  step_seconds_ = transfer_seconds_ = 0;
  next_audit_ = kStepsBetweenAudits;
  current_window_ = 0;
  v1::Exchange brought;
  if (scene_.coupled_to_fluid) medium_->fill(*brought.mutable_grain_states());
  return brought;
}

void Grains::take_inputs(const v1::Exchange& inputs, double middle) {
  const std::size_t n = medium_->bodies();
  if (scene_.coupled_to_fluid && !inputs.has_grain_forces())
    throw BadInput("inputs.grain_forces", "the forces of the fluid are missing");
  if (scene_.coupled_to_solid && !inputs.has_displacements())
    throw BadInput("inputs.displacements", "the motion of the wet surface is missing");
  if (inputs.has_grain_forces()) {
    if (!scene_.coupled_to_fluid)
      throw BadInput("inputs.grain_forces", "forces of a fluid were sent, but the scene has no [fluid]");
    const auto& forces = inputs.grain_forces();
    require("inputs.grain_forces.force", forces.force(), n * scene_.axes());
    require("inputs.grain_forces.torque", forces.torque(), n * (scene_.dimension == 2 ? 1 : 3));
    medium_->set_fluid_forces(view(forces.force()), view(forces.torque()), middle);
  }
  if (inputs.has_displacements()) {
    if (surface_.reference_positions().empty())
      throw BadInput("inputs.displacements", "a wet surface moves that was never sent");
    try {
      check_displacements(inputs.displacements(), surface_);
    } catch (const std::invalid_argument& error) {
      throw BadInput("inputs.displacements", error.what());
    }
    medium_->set_surface(displaced(surface_, inputs.displacements()));
  }
}

AdvanceResult Grains::advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) {
  if ((window.mode == Mode::steady) != scene_.steady)
    throw BadInput("advance.mode", "differs from the scene's coupling mode");
  const bool moves = !scene_.steady && !medium_->at_rest();
  if (moves && (!std::isfinite(window.time) || !std::isfinite(window.duration) || !(window.duration > 0)))
    throw BadInput("advance.duration", "a window needs a finite start and a positive, finite length");
  auto begin = Clock::now();
  if (window.iteration > 1) {
    if (!scene_.repeats_windows)
      throw BadInput("header.iteration",
                     "a window is repeated, but this scene couples grains explicitly: once per window");
    medium_->go_back();
  }
  // In a steady flow nothing moves, and no time is given.
  take_inputs(inputs, moves ? window.time + 0.5 * window.duration : 0.0);
  transfer_seconds_ += seconds_since(begin);

  if (moves) move(window, progress);
  // The balance of energies looks at every contact: now and then, and at the end.
  if (moves && (work_.steps >= next_audit_ || window.time + 1.5 * window.duration > scene_.end_time)) {
    work_.energy_error = medium_->energy_error();
    next_audit_ = work_.steps + kStepsBetweenAudits;
  }

  begin = Clock::now();
  AdvanceResult result;
  if (scene_.coupled_to_fluid) medium_->fill(*result.outputs.mutable_grain_states());
  if (!surface_.reference_positions().empty()) {
    const std::vector<double> forces = medium_->surface_forces();
    auto* field = result.outputs.mutable_forces();
    field->set_surface(surface_.identity());
    field->mutable_force()->Add(forces.begin(), forces.end());
  }
  for (const WatchScene& watch : scene_.watches)
    result.watches.push_back({watch.name, medium_->watch(watch)});
  transfer_seconds_ += seconds_since(begin);
  work_.phase_seconds = {{"time steps", step_seconds_}, {"transfer and watches", transfer_seconds_}};
  result.work = work_;
  return result;
}

void Grains::move(const Window& window, ProgressBoard& progress) {
  const auto begin = Clock::now();
  const double wanted = window.duration / medium_->step_limit().step;
  if (!(wanted < 1e12))
    throw BadInput("advance.duration",
                   fmt::format("{} steps of {:.3g} s in one window", wanted, medium_->step_limit().step));
  const auto steps = static_cast<std::uint64_t>(wanted) + 1;
  const std::uint64_t every = std::max<std::uint64_t>(1, 200'000 / (medium_->size() + 1));
  try {
    medium_->advance(window.duration, steps, [&](std::uint64_t step) {
      if (step % every != 0) return;
      progress.report(static_cast<double>(step) / static_cast<double>(steps));
      if (progress.stop_requested()) throw Interrupted();
    });
  } catch (const Breakdown& breakdown) {
    try {
      medium_->write_frame(folder_ / "last-state.hdf");
    } catch (const std::exception&) {  // the picture is a courtesy; the diagnosis must not be lost with it
    }
    throw Diverged("position",
                   fmt::format("grain {} {}, window {}; fields are in last-state.hdf", breakdown.grain,
                               breakdown.what(), window.number),
                   breakdown.advice);
  }
  work_.steps += steps;
  work_.updates += static_cast<double>(steps) * static_cast<double>(medium_->size());
  step_seconds_ += seconds_since(begin);
}

void Grains::accept() {
  if (scene_.repeats_windows) medium_->keep();
}

void Grains::save(const std::filesystem::path& file) {
  medium_->save(file);
}

void Grains::load(const std::filesystem::path& file) {
  medium_->load(file);
  if (scene_.repeats_windows) medium_->keep();
}

std::vector<std::string> Grains::frame(std::uint64_t number, double time) {
  const std::string name = series_->file_name(number);
  medium_->write_frame(folder_ / name);
  series_->add(number, time);
  return {name};
}

void Grains::stop() {
  // The last positions, for scenes that start from them.
  if (medium_) medium_->write_sample_file(folder_ / "sample.csv");
}

}  // namespace estuary::grains
