#include "coupling_loop.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>

#include "failure.hpp"
#include "grain_fields.hpp"
#include "load_transfer.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// A displacement this many times the size of the wet surface is no solution of anything.
constexpr double absurd_displacement = 1e3;
// A residual that grew this much over the window's first belongs to a diverging iteration.
constexpr double diverging_growth = 1e6;
// Velocities below this share of the largest so far need no relative accuracy: the surface is turning round.
constexpr double slow_velocity = 1e-2;
// Displacements below this share of the surface's size count as zero: nothing moves, and that is converged.
constexpr double zero_displacement = 1e-14;

double seconds_since(steady_clock::time_point begin) {
  return std::chrono::duration<double>(steady_clock::now() - begin).count();
}

double l2_norm(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum);
}

double l2_distance(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

std::span<const double> view(const google::protobuf::RepeatedField<double>& field) {
  return {field.data(), static_cast<std::size_t>(field.size())};
}

std::vector<double> copy(const google::protobuf::RepeatedField<double>& field) {
  return {field.begin(), field.end()};
}

// Largest extent of the reference surface, the scale that displacements are judged by.
double extent(const v1::WetSurface& surface) {
  double largest = 0;
  const auto dimension = static_cast<int>(surface.dimension());
  for (int axis = 0; axis < dimension; ++axis) {
    double low = surface.reference_positions(axis);
    double high = low;
    for (int i = axis; i < surface.reference_positions_size(); i += dimension) {
      low = std::min(low, surface.reference_positions(i));
      high = std::max(high, surface.reference_positions(i));
    }
    largest = std::max(largest, high - low);
  }
  return largest;
}

void require_finite(const RemoteParticipant& participant, const Position& position, const char* field,
                    std::span<const double> values, std::size_t per_node) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    throw RunFailure(
        ExitStatus::no_solution,
        fmt::format("participant '{}' gave {} = {} at wet node {}, window {}, iteration {}",
                    participant.role(), field, values[i], i / per_node, position.window, position.iteration),
        "its solution has blown up: try a smaller time step or window, or more relaxation");
  }
}

std::array<double, 2> first_two(const google::protobuf::RepeatedField<double>& field) {
  return {!field.empty() ? field[0] : 0.0, field.size() > 1 ? field[1] : 0.0};
}

}  // namespace

CouplingLoop::CouplingLoop(const CouplingScene& scene, Participants& participants, RunRecord& record,
                           ProgressBar& bar)
    : scene_(scene),
      participants_(participants),
      record_(record),
      bar_(bar),
      fluid_(participants.find("fluid")),
      solid_(participants.find("solid")),
      grains_(participants.find("grains")),
      acceleration_(make_acceleration({.kind = scene.acceleration,
                                       .relaxation = scene.relaxation,
                                       .windows_reused = static_cast<std::size_t>(scene.windows_reused)})) {}

double CouplingLoop::window_start() const {
  return scene_.mode == CouplingMode::steady ? 0.0
                                             : static_cast<double>(position_.window - 1) * scene_.window;
}

double CouplingLoop::window_end() const {
  return scene_.mode == CouplingMode::steady ? static_cast<double>(position_.iteration)
                                             : static_cast<double>(position_.window) * scene_.window;
}

void CouplingLoop::run() {
  start();
  write_frames(0.0);
  for (position_.window = 1; position_.window <= scene_.windows; ++position_.window) {
    acceleration_->begin_window();
    if (grains_ != nullptr && participants_.all().size() > 1) {
      compute_with_grains();
    } else if (fluid_ != nullptr && solid_ != nullptr) {
      compute_coupled();
    } else {
      compute_alone(*participants_.all().front());
    }
  }
  position_.window = scene_.windows;
  if (scene_.mode == CouplingMode::transient &&
      (scene_.frame_interval == 0 || scene_.windows % scene_.frame_interval != 0)) {
    write_frames(window_end());
  }
}

void CouplingLoop::start() {
  position_ = {};
  const auto ask_start = [&](RemoteParticipant& participant, v1::Exchange initial) {
    v1::Request request;
    *request.mutable_start()->mutable_initial() = std::move(initial);
    return participants_.ask(participant, std::move(request), position_).started().initial();
  };
  // The solid brings the wet surface and the grains their states, so they start first; the fluid starts
  // around them.
  v1::Exchange solid_brings;
  if (solid_ != nullptr) solid_brings = ask_start(*solid_, {});
  v1::Exchange for_fluid;
  if (grains_ != nullptr) {
    const v1::Exchange grains_bring = ask_start(*grains_, {});
    if (fluid_ != nullptr) {
      grain_states_ = grains_bring.grain_states();
      check_grain_states(grain_states_, scene_.dimension, position_);
      *for_fluid.mutable_grain_states() = grain_states_;
    }
  }
  if (fluid_ == nullptr) return;
  if (solid_ != nullptr) {
    if (!solid_brings.has_wet_surface() || !solid_brings.has_displacements()) {
      throw RunFailure(ExitStatus::wrong_scene,
                       "participant 'solid' brings no wet surface, so the fluid cannot act on it",
                       "name its wet sides");
    }
    surface_ = solid_brings.wet_surface();
    try {
      check_wet_surface(surface_);
      check_displacements(solid_brings.displacements(), surface_);
    } catch (const std::invalid_argument& error) {
      throw RunFailure(ExitStatus::participant_lost,
                       fmt::format("participant 'solid', in phase start: {}", error.what()));
    }
    accepted_ = {copy(solid_brings.displacements().displacement()),
                 copy(solid_brings.displacements().velocity())};
    forces_.assign(accepted_.displacement.size(), 0.0);
    *for_fluid.mutable_wet_surface() = surface_;
    *for_fluid.mutable_displacements() = solid_brings.displacements();
  }
  ask_start(*fluid_, std::move(for_fluid));
}

v1::Advanced CouplingLoop::advance(RemoteParticipant& participant, v1::Exchange inputs) {
  v1::Request request;
  auto* advance = request.mutable_advance();
  advance->set_mode(scene_.mode == CouplingMode::steady ? v1::Advance::STEADY : v1::Advance::TRANSIENT);
  advance->set_time(window_start());
  advance->set_duration(scene_.window);
  *advance->mutable_inputs() = std::move(inputs);
  v1::Reply reply = participants_.ask(participant, std::move(request), position_);
  if (!reply.has_advanced()) {
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("participant '{}' answered Advance with something else at window {}, iteration {}",
                    participant.role(), position_.window, position_.iteration));
  }
  return std::move(*reply.mutable_advanced());
}

void CouplingLoop::compute_alone(RemoteParticipant& participant) {
  const auto begin = steady_clock::now();
  position_.iteration = 1;
  ++total_iterations_;
  bar_.begin(position_);
  const v1::Advanced advanced = advance(participant, {});
  accept();
  record_watches(advanced, window_end());
  finish_window("alone", advanced.remaining_error(), seconds_since(begin));
  frames_if_due(position_.window, window_end());
}

void CouplingLoop::compute_with_grains() {
  const auto begin = steady_clock::now();
  position_.iteration = 1;
  ++total_iterations_;
  bar_.begin(position_);
  v1::Exchange to_fluid;
  *to_fluid.mutable_grain_states() = grain_states_;
  const v1::Advanced fluid = advance(*fluid_, std::move(to_fluid));
  check_grain_forces(fluid.outputs().grain_forces(), grain_states_, position_);
  v1::Exchange to_grains;
  *to_grains.mutable_grain_forces() = fluid.outputs().grain_forces();
  const v1::Advanced grains = advance(*grains_, std::move(to_grains));
  check_grain_states(grains.outputs().grain_states(), scene_.dimension, position_);
  grain_states_ = grains.outputs().grain_states();
  accept();
  record_watches(fluid, window_end());
  record_watches(grains, window_end());
  finish_window("explicit", 0.0, seconds_since(begin));
  frames_if_due(position_.window, window_end());
}

void CouplingLoop::compute_coupled() {
  const auto begin = steady_clock::now();
  Motion motion = predict();
  const auto limit = scene_.scheme == Scheme::serial_explicit
                         ? std::uint64_t{1}
                         : static_cast<std::uint64_t>(scene_.max_iterations);
  for (position_.iteration = 1;; ++position_.iteration) {
    bar_.begin(position_);
    IterationRow row;
    row.window = position_.window;
    row.iteration = position_.iteration;
    row.time = window_end();
    const Verdict verdict = iterate(motion, row);
    ++total_iterations_;
    record_.add(row);
    bar_.residual(row.residual);
    if (scene_.mode == CouplingMode::steady) {
      record_watches(last_fluid_, window_end());
      record_watches(last_solid_, window_end());
    }
    const bool last = position_.iteration >= limit;
    if (verdict == Verdict::diverged) {
      finish_window("diverged", row.residual, seconds_since(begin));
      throw RunFailure(
          ExitStatus::no_solution,
          fmt::format("the coupling diverged: window {}, iteration {}, displacement of the wet surface, "
                      "residual {:.3e}, norm {:.3e} m",
                      position_.window, position_.iteration, row.residual, row.displacement_norm),
          "try coupling.acceleration = \"aitken\", a smaller coupling.relaxation or a shorter window");
    }
    if (verdict == Verdict::converged || last) {
      const bool converged = verdict == Verdict::converged;
      const bool is_explicit = scene_.scheme == Scheme::serial_explicit;
      const char* text = is_explicit ? "explicit" : converged ? "converged" : "not converged";
      if (!converged && !is_explicit && scene_.at_maximum == AtMaximum::fail) {
        finish_window(text, row.residual, seconds_since(begin));
        throw RunFailure(
            ExitStatus::no_solution,
            fmt::format("the coupling did not converge: window {}, {} iterations, residual of the "
                        "displacement {:.3e} above {:.1e}",
                        position_.window, position_.iteration, row.residual, scene_.tolerance),
            "raise coupling.max_iterations, or try another coupling.relaxation or acceleration");
      }
      accept();
      accepted_ = {copy(last_solid_.outputs().displacements().displacement()),
                   copy(last_solid_.outputs().displacements().velocity())};
      largest_velocity_norm_ = std::max(largest_velocity_norm_, l2_norm(accepted_.velocity));
      if (scene_.mode == CouplingMode::transient) {
        record_watches(last_fluid_, window_end());
        record_watches(last_solid_, window_end());
      }
      finish_window(text, row.residual, seconds_since(begin));
      // In steady mode the last iteration is always shown.
      if (scene_.mode == CouplingMode::steady) {
        write_frames(window_end());
      } else {
        frames_if_due(position_.window, window_end());
      }
      return;
    }
    if (scene_.mode == CouplingMode::steady) frames_if_due(position_.iteration, window_end());
  }
}

CouplingLoop::Verdict CouplingLoop::iterate(Motion& motion, IterationRow& row) {
  const std::size_t dimension = surface_.dimension();
  // Fluid, around the surface where `motion` puts it.
  v1::Exchange to_fluid;
  auto* displacements = to_fluid.mutable_displacements();
  displacements->set_surface(surface_.identity());
  displacements->mutable_displacement()->Assign(motion.displacement.begin(), motion.displacement.end());
  displacements->mutable_velocity()->Assign(motion.velocity.begin(), motion.velocity.end());
  auto begin = steady_clock::now();
  last_fluid_ = advance(*fluid_, std::move(to_fluid));
  row.fluid_s = seconds_since(begin);
  const auto& pressures = last_fluid_.outputs().pressures();
  require_finite(*fluid_, position_, "pressure", view(pressures.pressure()), 1);
  require_finite(*fluid_, position_, "viscous_traction", view(pressures.viscous_traction()), dimension);

  // Loads to consistent nodal forces.
  v1::Exchange to_solid;
  try {
    check_pressures(pressures, surface_);
    *to_solid.mutable_forces() = consistent_nodal_forces(surface_, motion.displacement, pressures);
  } catch (const std::invalid_argument& error) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("participant 'fluid' at window {}, iteration {}: {}", position_.window,
                                 position_.iteration, error.what()));
  }
  const std::vector<double> forces = copy(to_solid.forces().force());
  const LoadSums given = sum_load(surface_, motion.displacement, motion.velocity, forces);

  // Solid, under these forces.
  begin = steady_clock::now();
  last_solid_ = advance(*solid_, std::move(to_solid));
  row.solid_s = seconds_since(begin);
  const auto& answered = last_solid_.outputs().displacements();
  require_finite(*solid_, position_, "displacement", view(answered.displacement()), dimension);
  require_finite(*solid_, position_, "velocity", view(answered.velocity()), dimension);
  try {
    check_displacements(answered, surface_);
  } catch (const std::invalid_argument& error) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("participant 'solid' at window {}, iteration {}: {}", position_.window,
                                 position_.iteration, error.what()));
  }
  const Motion answer{copy(answered.displacement()), copy(answered.velocity())};

  // How far apart they still are.
  const double increment = l2_distance(answer.displacement, motion.displacement);
  const double norm = l2_norm(answer.displacement);
  const double scale = extent(surface_) * std::sqrt(static_cast<double>(node_count(surface_)));
  const bool nothing_moves = norm <= zero_displacement * scale && increment <= zero_displacement * scale;
  row.displacement_norm = norm;
  row.residual = nothing_moves ? 0.0 : increment / std::max(norm, zero_displacement * scale);
  if (scene_.mode == CouplingMode::transient) {
    // A solid that takes one step per window answers with a displacement that does not depend on the new
    // load: only its velocity tells whether fluid and solid agree.
    const double velocity_norm = l2_norm(answer.velocity);
    const double floor =
        std::max(slow_velocity * largest_velocity_norm_, zero_displacement * scale / scene_.window);
    row.velocity_residual = l2_distance(answer.velocity, motion.velocity) / std::max(velocity_norm, floor);
  }
  if (scene_.force_tolerance) {
    const double force_norm = l2_norm(forces);
    row.force_residual = force_norm > 0 ? l2_distance(forces, forces_) / force_norm : 0.0;
  }
  forces_ = forces;
  row.force = {given.force[0], given.force[1]};
  row.moment = given.moment;
  row.fluid_power = given.power;
  row.solid_power = sum_load(surface_, answer.displacement, answer.velocity, forces).power;
  row.fluid_force = first_two(last_fluid_.surface_force());
  row.fluid_moment = last_fluid_.surface_moment();
  row.solid_force = first_two(last_solid_.surface_force());
  row.solid_moment = last_solid_.surface_moment();
  row.fluid_error = last_fluid_.remaining_error();
  row.solid_error = last_solid_.remaining_error();

  if (position_.iteration == 1) first_residual_norm_ = increment;
  if (norm > absurd_displacement * scale ||
      increment > diverging_growth * std::max(first_residual_norm_, 1e-12 * scale)) {
    row.relaxation = 0;
    return Verdict::diverged;
  }
  const bool displacement_agrees = row.residual < scene_.tolerance;
  const bool velocity_agrees = !row.velocity_residual || *row.velocity_residual < scene_.velocity_tolerance;
  const bool force_agrees = !scene_.force_tolerance || *row.force_residual < *scene_.force_tolerance;
  if (displacement_agrees && velocity_agrees && force_agrees) {
    row.relaxation = 0;
    return Verdict::converged;
  }
  relax(motion, answer, row);
  return Verdict::go_on;
}

// Where the surface will be if it goes on as it moves.
CouplingLoop::Motion CouplingLoop::predict() const {
  Motion motion = accepted_;
  if (scene_.mode == CouplingMode::transient && scene_.predictor == Predictor::linear) {
    for (std::size_t i = 0; i < motion.displacement.size(); ++i) {
      motion.displacement[i] += scene_.window * motion.velocity[i];
    }
  }
  return motion;
}

// Displacement and velocity are accelerated as one vector, the velocity as the displacement it makes in one
// window, so that both take part with the same unit and the same factor.
void CouplingLoop::relax(Motion& motion, const Motion& answer, IterationRow& row) {
  const std::size_t size = motion.displacement.size();
  const bool moves = scene_.mode == CouplingMode::transient;
  std::vector<double> iterate(moves ? 2 * size : size);
  std::vector<double> residual(iterate.size());
  for (std::size_t i = 0; i < size; ++i) {
    iterate[i] = motion.displacement[i];
    residual[i] = answer.displacement[i] - motion.displacement[i];
    if (moves) {
      iterate[size + i] = scene_.window * motion.velocity[i];
      residual[size + i] = scene_.window * (answer.velocity[i] - motion.velocity[i]);
    }
  }
  acceleration_->update(residual, iterate);
  row.relaxation = acceleration_->relaxation();
  for (std::size_t i = 0; i < size; ++i) {
    motion.displacement[i] = iterate[i];
    if (moves) motion.velocity[i] = iterate[size + i] / scene_.window;
  }
}

void CouplingLoop::accept() {
  for (const auto& participant : participants_.all()) {
    v1::Request request;
    request.mutable_accept();
    participants_.ask(*participant, std::move(request), position_);
  }
}

void CouplingLoop::finish_window(const char* verdict, double residual, double wall_s) {
  record_.add(WindowRow{.window = position_.window,
                        .total_iterations = total_iterations_,
                        .iterations = position_.iteration,
                        .verdict = verdict,
                        .time = window_end(),
                        .residual = residual,
                        .wall_s = wall_s});
  spdlog::info("window {}: {} after {} iterations, residual {:.3e}, {:.3f} s", position_.window, verdict,
               position_.iteration, residual, wall_s);
}

void CouplingLoop::frames_if_due(std::uint64_t count, double time) {
  const bool single_equilibrium = scene_.mode == CouplingMode::steady && scene_.participants.size() == 1;
  const bool due = scene_.frame_interval != 0 && count % scene_.frame_interval == 0;
  if (single_equilibrium || due) write_frames(time);
}

void CouplingLoop::write_frames(double time) {
  if (!scene_.frames) return;
  for (const auto& participant : participants_.all()) {
    v1::Request request;
    request.mutable_frame()->set_number(frame_);
    request.mutable_frame()->set_time(time);
    participants_.ask(*participant, std::move(request), position_);
  }
  ++frame_;
}

void CouplingLoop::record_watches(const v1::Advanced& advanced, double time) {
  for (const auto& sample : advanced.watches()) {
    if (sample.quantity_size() != sample.value_size()) {
      throw RunFailure(ExitStatus::participant_lost,
                       fmt::format("the watch '{}' came with {} names and {} values", sample.name(),
                                   sample.quantity_size(), sample.value_size()));
    }
    record_.add(sample, position_.window, position_.iteration, time);
  }
}

}  // namespace estuary::coupler
