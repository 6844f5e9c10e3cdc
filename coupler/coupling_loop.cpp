#include "coupling_loop.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>

#include "elapsed.hpp"
#include "grain_fields.hpp"
#include "load_transfer.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// Relaxation of a window tried again with small steps, as a share of the scene's.
constexpr double small_step = 0.2;
// A load that the solid cannot take at once is halved at most this often.
constexpr int most_halvings = 5;

std::array<double, 2> first_two(const google::protobuf::RepeatedField<double>& field) {
  return {!field.empty() ? field[0] : 0.0, field.size() > 1 ? field[1] : 0.0};
}

void add_to(std::vector<double>& sum, const google::protobuf::RepeatedField<double>& values) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += values[static_cast<int>(i)];
}

AccelerationSettings settings_of(const CouplingScene& scene, std::size_t values) {
  AccelerationSettings settings{.kind = scene.acceleration,
                                .relaxation = scene.relaxation,
                                .windows_reused = static_cast<std::size_t>(scene.windows_reused),
                                .most_columns = static_cast<std::size_t>(scene.max_used_columns),
                                .filter = scene.filter,
                                .filter_limit = scene.filter_limit,
                                .remainder = 1.0,
                                .fields = {}};
  if (scene.residual_sum) {
    const std::size_t fields =
        (scene.mode == CouplingMode::transient ? 2U : 1U) + (scene.parallel() ? 1U : 0U);
    settings.fields.assign(fields, values);
  }
  return settings;
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
      grains_(participants.find("grains")) {}

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
    if (participants_.all().size() > 1) {
      compute_window();
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

// The solid brings the wet surface and the grains their states, so they start first; the fluid starts around
// both.
void CouplingLoop::start() {
  position_ = {};
  const auto ask_start = [&](RemoteParticipant& participant, v1::Exchange initial) {
    v1::Request request;
    *request.mutable_start()->mutable_initial() = std::move(initial);
    return participants_.ask(participant, std::move(request), position_).started().initial();
  };
  v1::Exchange for_others;
  if (solid_ != nullptr) {
    for_others = ask_start(*solid_, {});
    if (participants_.all().size() > 1) start_solid(for_others);
  }
  if (grains_ != nullptr) {
    const v1::Exchange grains_bring = ask_start(*grains_, for_others);
    if (fluid_ != nullptr) {
      grain_states_ = grains_bring.grain_states();
      check_grain_states(grain_states_, scene_.dimension, position_);
      *for_others.mutable_grain_states() = grain_states_;
    }
  }
  if (fluid_ != nullptr) ask_start(*fluid_, std::move(for_others));
}

void CouplingLoop::start_solid(v1::Exchange& for_others) {
  if (!for_others.has_wet_surface() || !for_others.has_displacements()) {
    throw RunFailure(ExitStatus::wrong_scene,
                     "participant 'solid' brings no wet surface, so nothing can act on it",
                     "name its wet sides");
  }
  surface_ = for_others.wet_surface();
  try {
    check_wet_surface(surface_);
  } catch (const std::invalid_argument& error) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("participant 'solid', in phase start: {}", error.what()));
  }
  accepted_.motion = checked_motion(*solid_, for_others, surface_, position_);
  const std::size_t values = accepted_.motion.displacement.size();
  accepted_.forces.assign(values, 0.0);
  last_forces_ = accepted_.forces;
  earlier_velocity_ = accepted_.motion.velocity;
  convergence_ = std::make_unique<Convergence>(scene_, displacement_scale(surface_));
  acceleration_ = make_acceleration(settings_of(scene_, values));
}

v1::Request CouplingLoop::advance_request(v1::Exchange inputs) const {
  v1::Request request;
  auto* advance = request.mutable_advance();
  advance->set_mode(scene_.mode == CouplingMode::steady ? v1::Advance::STEADY : v1::Advance::TRANSIENT);
  advance->set_time(window_start());
  advance->set_duration(scene_.window);
  *advance->mutable_inputs() = std::move(inputs);
  return request;
}

v1::Advanced CouplingLoop::advanced_of(const RemoteParticipant& participant, v1::Reply reply) const {
  if (!reply.has_advanced()) {
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("participant '{}' answered Advance with something else at window {}, iteration {}",
                    participant.role(), position_.window, position_.iteration));
  }
  return std::move(*reply.mutable_advanced());
}

v1::Advanced CouplingLoop::advance(RemoteParticipant& participant, v1::Exchange inputs) {
  return advanced_of(participant,
                     participants_.ask(participant, advance_request(std::move(inputs)), position_));
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

void CouplingLoop::compute_window() {
  const auto begin = steady_clock::now();
  care_ = Care::normal;
  position_.iteration = 0;
  while (true) {
    Interface x = predict();
    if (acceleration_) acceleration_->begin_window();
    if (convergence_) convergence_->begin_window();
    bool used_up = false;  // the iterations allowed
    try {
      const bool agreed = iterate_window(x);
      const bool once = !scene_.implicit() || solid_ == nullptr;
      used_up = !agreed && !once && scene_.at_maximum == AtMaximum::fail;
      if (used_up) {
        throw RunFailure(
            ExitStatus::no_solution,
            fmt::format("the coupling did not converge: window {}, {} iterations, residual of the "
                        "displacement {:.3e}",
                        position_.window, position_.iteration, convergence_->relative(Field::displacement)),
            "raise coupling.max_iterations, or try another coupling.relaxation or acceleration", true);
      }
      accept_window(once ? "explicit" : agreed ? "converged" : "not converged", seconds_since(begin));
      return;
    } catch (const RunFailure& failure) {
      if (failure.status != ExitStatus::no_solution) throw;
      if (more_care(failure)) continue;
      if (used_up || verdict_ == Verdict::diverged || verdict_ == Verdict::stalled) {
        finish_window(used_up                         ? "not converged"
                      : verdict_ == Verdict::diverged ? "diverged"
                                                      : "stalled",
                      convergence_->relative(Field::displacement), seconds_since(begin));
      }
      throw;
    }
  }
}

// A window can be tried again where participants go back to its start. The care stays for the windows after
// it: what was learnt with it is worth more than the larger steps.
bool CouplingLoop::more_care(const RunFailure& failure) {
  const bool goes_back = scene_.mode == CouplingMode::transient && scene_.implicit() && solid_ != nullptr;
  if (!failure.curable || !scene_.recover || !goes_back || care_ == Care::small_steps) return false;
  care_ = care_ == Care::normal ? Care::without_history : Care::small_steps;
  const bool small = care_ == Care::small_steps;
  AccelerationSettings settings = settings_of(scene_, accepted_.forces.size());
  if (small) {
    settings.relaxation *= small_step;
    settings.remainder = small_step;
  }
  acceleration_ = make_acceleration(settings);
  ++recoveries_;
  spdlog::warn("window {}: tried again {} after iteration {}: {}", position_.window,
               small ? fmt::format("with relaxation {:g}", settings.relaxation) : "without the history",
               position_.iteration, failure.what());
  return true;
}

bool CouplingLoop::iterate_window(Interface& x) {
  const bool once = !scene_.implicit() || solid_ == nullptr;
  // Each attempt at a window may use all iterations allowed.
  const auto limit =
      position_.iteration + (once ? std::uint64_t{1} : static_cast<std::uint64_t>(scene_.max_iterations));
  while (position_.iteration < limit) {
    ++position_.iteration;
    ++total_iterations_;
    bar_.begin(position_);
    iterate(x);
    if (scene_.mode == CouplingMode::steady) record_all_watches();
    if (verdict_ == Verdict::converged) return true;
    const double residual = convergence_ ? convergence_->relative(Field::displacement) : 0.0;
    if (verdict_ == Verdict::diverged) {
      throw RunFailure(
          ExitStatus::no_solution,
          fmt::format("the coupling diverged: window {}, iteration {}, displacement of the wet surface, "
                      "residual {:.3e}, norm {:.3e} m",
                      position_.window, position_.iteration, residual, norms_.displacement),
          "try coupling.acceleration = \"iqn-ils\", a smaller coupling.relaxation or a shorter window", true);
    }
    if (verdict_ == Verdict::stalled) {
      throw RunFailure(
          ExitStatus::no_solution,
          fmt::format("the coupling stalled: window {}, iteration {}, residual of the displacement "
                      "{:.3e} no longer shrinks",
                      position_.window, position_.iteration, residual),
          "one of the participants may not answer smoothly: a finer fluid or a tighter steady "
          "tolerance helps; or raise coupling.tolerance",
          true);
    }
    if (scene_.mode == CouplingMode::steady && position_.iteration < limit)
      frames_if_due(position_.iteration, window_end());
  }
  return false;
}

void CouplingLoop::iterate(Interface& x) {
  IterationRow row;
  row.window = position_.window;
  row.iteration = position_.iteration;
  row.time = window_end();
  const Interface answer = scene_.parallel() ? answer_at_once(x, row) : answer_in_turn(x, row);
  verdict_ = Verdict::go_on;
  if (solid_ == nullptr) return;  // nothing to agree on
  norms_ = {.displacement_increment = l2_distance(answer.motion.displacement, x.motion.displacement),
            .displacement = l2_norm(answer.motion.displacement),
            .velocity_increment = l2_distance(answer.motion.velocity, x.motion.velocity),
            .velocity = l2_norm(answer.motion.velocity),
            .force_increment = l2_distance(answer.forces, scene_.parallel() ? x.forces : last_forces_),
            .force = l2_norm(answer.forces)};
  last_forces_ = answer.forces;
  verdict_ = convergence_->judge(norms_, position_.iteration);
  describe(x, answer, row);
  if (row.load_share < 1) {
    // A shape under a part of the load is a place to go on from, and teaches nothing about the whole.
    x.motion = answer.motion;
    acceleration_->forget();
    verdict_ = Verdict::go_on;
  } else if (verdict_ == Verdict::go_on && scene_.implicit()) {
    accelerate(x, answer);
    row.relaxation = acceleration_->relaxation();
  }
  record_.add(row);
  bar_.residual(row.residual);
}

CouplingLoop::Interface CouplingLoop::answer_in_turn(const Interface& x, IterationRow& row) {
  Interface answer;
  if (fluid_ != nullptr) {
    const auto begin = steady_clock::now();
    last_fluid_ = advance(*fluid_, for_fluid(x.motion));
    row.fluid_s = seconds_since(begin);
  }
  if (grains_ != nullptr) last_grains_ = advance(*grains_, for_grains(x.motion));
  if (solid_ == nullptr) return answer;
  answer.forces = nodal_forces(x.motion);
  const auto begin = steady_clock::now();
  row.load_share = ask_solid(answer.forces);
  row.solid_s = seconds_since(begin);
  answer.motion = checked_motion(*solid_, last_solid_.outputs(), surface_, position_);
  return answer;
}

// In steady mode a first load may be far from the last and too much for the solid; the part that it can take
// brings it nearer. Returns that part.
double CouplingLoop::ask_solid(const std::vector<double>& forces) {
  double share = 1;
  for (int halving = 0;; ++halving, share *= 0.5) {
    try {
      std::vector<double> given = forces;
      for (double& force : given) force *= share;
      last_solid_ = advance(*solid_, for_solid(given));
      return share;
    } catch (const RunFailure& failure) {
      const bool can_halve = scene_.mode == CouplingMode::steady && scene_.recover && halving < most_halvings;
      if (!failure.curable || !can_halve) throw;
      ++recoveries_;
      spdlog::warn("window {}, iteration {}: the solid cannot take {:g} of the load, gets half of that: {}",
                   position_.window, position_.iteration, share, failure.what());
    }
  }
}

CouplingLoop::Interface CouplingLoop::answer_at_once(const Interface& x, IterationRow& row) {
  std::vector<Participants::Question> questions;
  if (fluid_ != nullptr) questions.push_back({fluid_, advance_request(for_fluid(x.motion))});
  if (grains_ != nullptr) questions.push_back({grains_, advance_request(for_grains(x.motion))});
  if (solid_ != nullptr) questions.push_back({solid_, advance_request(for_solid(x.forces))});
  std::vector<double> before;
  for (const auto& question : questions) before.push_back(question.participant->usage().wall_s);
  std::vector<RemoteParticipant*> asked;
  for (const auto& question : questions) asked.push_back(question.participant);
  std::vector<v1::Reply> replies = participants_.ask_all(std::move(questions), position_);
  for (std::size_t k = 0; k < asked.size(); ++k) {
    const double seconds = asked[k]->usage().wall_s - before[k];
    v1::Advanced advanced = advanced_of(*asked[k], std::move(replies[k]));
    if (asked[k] == fluid_) {
      last_fluid_ = std::move(advanced);
      row.fluid_s = seconds;
    } else if (asked[k] == solid_) {
      last_solid_ = std::move(advanced);
      row.solid_s = seconds;
    } else {
      last_grains_ = std::move(advanced);
    }
  }
  Interface answer;
  if (solid_ == nullptr) return answer;
  answer.motion = checked_motion(*solid_, last_solid_.outputs(), surface_, position_);
  answer.forces = nodal_forces(x.motion);
  return answer;
}

v1::Exchange CouplingLoop::for_fluid(const WetMotion& motion) const {
  v1::Exchange inputs;
  if (solid_ != nullptr) *inputs.mutable_displacements() = message_of(motion, surface_);
  if (grains_ != nullptr) *inputs.mutable_grain_states() = grain_states_;
  return inputs;
}

v1::Exchange CouplingLoop::for_grains(const WetMotion& motion) const {
  v1::Exchange inputs;
  if (solid_ != nullptr) *inputs.mutable_displacements() = message_of(motion, surface_);
  if (fluid_ != nullptr) {
    if (last_fluid_.outputs().has_grain_forces()) {
      check_grain_forces(last_fluid_.outputs().grain_forces(), grain_states_, position_);
      *inputs.mutable_grain_forces() = last_fluid_.outputs().grain_forces();
    } else {  // a parallel scheme's first window: the fluid has not answered yet
      auto& none = *inputs.mutable_grain_forces();
      none.mutable_force()->Resize(grain_states_.centre_size(), 0.0);
      none.mutable_torque()->Resize(grain_states_.spin_size(), 0.0);
    }
  }
  return inputs;
}

v1::Exchange CouplingLoop::for_solid(const std::vector<double>& forces) const {
  v1::Exchange inputs;
  inputs.mutable_forces()->set_surface(surface_.identity());
  inputs.mutable_forces()->mutable_force()->Assign(forces.begin(), forces.end());
  return inputs;
}

std::vector<double> CouplingLoop::nodal_forces(const WetMotion& motion) const {
  std::vector<double> sum(motion.displacement.size(), 0.0);
  if (fluid_ != nullptr) {
    const auto& loads = checked_pressures(*fluid_, last_fluid_.outputs(), surface_, position_);
    add_to(sum, consistent_nodal_forces(surface_, motion.displacement, loads).force());
  }
  if (grains_ != nullptr)
    add_to(sum, checked_forces(*grains_, last_grains_.outputs(), surface_, position_).force());
  return sum;
}

void CouplingLoop::describe(const Interface& x, const Interface& answer, IterationRow& row) const {
  row.displacement_norm = norms_.displacement;
  row.residual = convergence_->relative(Field::displacement);
  // A solid that takes one step per window answers with a displacement that does not depend on the new load:
  // only its velocity tells whether they agree.
  if (scene_.mode == CouplingMode::transient) row.velocity_residual = convergence_->relative(Field::velocity);
  row.force_residual = convergence_->relative(Field::force);
  const LoadSums given = sum_load(surface_, x.motion.displacement, x.motion.velocity, answer.forces);
  row.force = {given.force[0], given.force[1]};
  row.moment = given.moment;
  row.fluid_power = given.power;
  row.solid_power =
      sum_load(surface_, answer.motion.displacement, answer.motion.velocity, answer.forces).power;
  row.fluid_force = first_two(last_fluid_.surface_force());
  row.fluid_moment = last_fluid_.surface_moment();
  row.solid_force = first_two(last_solid_.surface_force());
  row.solid_moment = last_solid_.surface_moment();
  row.fluid_error = last_fluid_.remaining_error();
  row.solid_error = last_solid_.remaining_error();
}

// Where the surface will be if it goes on as it moves, and the forces as they are.
CouplingLoop::Interface CouplingLoop::predict() const {
  Interface x = accepted_;
  if (scene_.mode == CouplingMode::steady || scene_.predictor == Predictor::none) return x;
  for (std::size_t i = 0; i < x.motion.displacement.size(); ++i) {
    const double velocity = accepted_.motion.velocity[i];
    double change = 0;  // of the velocity over the window
    if (scene_.predictor == Predictor::quadratic && position_.window > 1)
      change = velocity - earlier_velocity_[i];
    x.motion.displacement[i] += scene_.window * (velocity + 0.5 * change);
    x.motion.velocity[i] += change;
  }
  return x;
}

// The fields are accelerated as one vector, the velocity as the displacement it makes in one window, so that
// both take part with the same unit and the same factor.
void CouplingLoop::accelerate(Interface& x, const Interface& answer) {
  std::vector<double> iterate;
  std::vector<double> residual;
  const auto take = [&](const std::vector<double>& from, const std::vector<double>& to, double scale) {
    for (std::size_t i = 0; i < from.size(); ++i) {
      iterate.push_back(scale * from[i]);
      residual.push_back(scale * (to[i] - from[i]));
    }
  };
  const bool moves = scene_.mode == CouplingMode::transient;
  take(x.motion.displacement, answer.motion.displacement, 1.0);
  if (moves) take(x.motion.velocity, answer.motion.velocity, scene_.window);
  if (scene_.parallel()) take(x.forces, answer.forces, 1.0);
  acceleration_->update(residual, iterate);
  auto next = iterate.begin();
  const auto give = [&](std::vector<double>& to, double scale) {
    for (double& value : to) value = *next++ / scale;
  };
  give(x.motion.displacement, 1.0);
  if (moves) give(x.motion.velocity, scene_.window);
  if (scene_.parallel()) give(x.forces, 1.0);
}

void CouplingLoop::accept_window(const char* verdict, double wall_s) {
  accept();
  if (solid_ != nullptr) {
    convergence_->accept(norms_);
    earlier_velocity_ = accepted_.motion.velocity;
    accepted_ = {motion_of(last_solid_.outputs().displacements()), last_forces_};
  }
  if (grains_ != nullptr && fluid_ != nullptr) {
    check_grain_states(last_grains_.outputs().grain_states(), scene_.dimension, position_);
    grain_states_ = last_grains_.outputs().grain_states();
  }
  if (scene_.mode == CouplingMode::transient) record_all_watches();
  finish_window(verdict, convergence_ ? convergence_->relative(Field::displacement) : 0.0, wall_s);
  // In steady mode the last iteration is always shown.
  if (scene_.mode == CouplingMode::steady) {
    write_frames(window_end());
  } else {
    frames_if_due(position_.window, window_end());
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

void CouplingLoop::record_all_watches() {
  if (fluid_ != nullptr) record_watches(last_fluid_, window_end());
  if (grains_ != nullptr) record_watches(last_grains_, window_end());
  if (solid_ != nullptr) record_watches(last_solid_, window_end());
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
