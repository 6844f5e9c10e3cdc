#include "partners.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <stdexcept>

#include "elapsed.hpp"
#include "failure.hpp"
#include "grain_fields.hpp"
#include "load_transfer.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// A load that the solid cannot take at once is halved at most this often.
constexpr int most_halvings = 5;

std::array<double, 2> first_two(const google::protobuf::RepeatedField<double>& field) {
  return {!field.empty() ? field[0] : 0.0, field.size() > 1 ? field[1] : 0.0};
}

void add_to(std::vector<double>& sum, const google::protobuf::RepeatedField<double>& values) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += values[static_cast<int>(i)];
}

}  // namespace

Partners::Partners(const CouplingScene& scene, Participants& participants)
    : scene_(scene),
      participants_(participants),
      fluid_(participants.find("fluid")),
      solid_(participants.find("solid")),
      grains_(participants.find("grains")) {}

v1::Exchange Partners::ask_start(RemoteParticipant& participant, v1::Exchange initial) {
  v1::Request request;
  *request.mutable_start()->mutable_initial() = std::move(initial);
  v1::Reply reply = participants_.ask(participant, std::move(request), position_);
  return std::move(*reply.mutable_started()->mutable_initial());
}

void Partners::start() {
  position_ = {};
  v1::Exchange for_others;
  if (solid_ != nullptr) {
    for_others = ask_start(*solid_, {});
    if (agree()) take_surface(for_others);
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

void Partners::take_surface(v1::Exchange& for_others) {
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
  initial_.motion = checked_motion(*solid_, for_others, surface_, position_);
  initial_.forces.assign(initial_.motion.displacement.size(), 0.0);
}

InterfaceState Partners::answer(const InterfaceState& x, const WindowSpan& span, const Position& position,
                                IterationRow& row) {
  span_ = span;
  position_ = position;
  InterfaceState result = scene_.parallel() ? answer_at_once(x, row) : answer_in_turn(x, row);
  if (agree()) describe(x, result, row);
  return result;
}

void Partners::advance_alone(const WindowSpan& span, const Position& position) {
  span_ = span;
  position_ = position;
  RemoteParticipant& only = *participants_.all().front();
  v1::Advanced& last = &only == fluid_ ? last_fluid_ : &only == solid_ ? last_solid_ : last_grains_;
  last = advance(only, {});
}

v1::Request Partners::advance_request(const RemoteParticipant& participant, v1::Exchange inputs) const {
  v1::Request request;
  auto* advance = request.mutable_advance();
  advance->set_accept(once() && participant.accepts_in_advance());
  advance->set_mode(scene_.mode == CouplingMode::steady ? v1::Advance::STEADY : v1::Advance::TRANSIENT);
  advance->set_time(span_.begin);
  advance->set_duration(span_.duration);
  *advance->mutable_inputs() = std::move(inputs);
  return request;
}

v1::Advanced Partners::advanced_of(const RemoteParticipant& participant, v1::Reply reply) const {
  if (!reply.has_advanced()) {
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("participant '{}' answered Advance with something else at window {}, iteration {}",
                    participant.role(), position_.window, position_.iteration));
  }
  return std::move(*reply.mutable_advanced());
}

v1::Advanced Partners::advance(RemoteParticipant& participant, v1::Exchange inputs) {
  return advanced_of(
      participant,
      participants_.ask(participant, advance_request(participant, std::move(inputs)), position_));
}

InterfaceState Partners::answer_in_turn(const InterfaceState& x, IterationRow& row) {
  InterfaceState answer;
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
double Partners::ask_solid(const std::vector<double>& forces) {
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
      ++halvings_;
      spdlog::warn("window {}, iteration {}: the solid cannot take {:g} of the load, gets half of that: {}",
                   position_.window, position_.iteration, share, failure.what());
    }
  }
}

InterfaceState Partners::answer_at_once(const InterfaceState& x, IterationRow& row) {
  std::vector<Participants::Question> questions;
  if (fluid_ != nullptr) questions.push_back({fluid_, advance_request(*fluid_, for_fluid(x.motion))});
  if (grains_ != nullptr) questions.push_back({grains_, advance_request(*grains_, for_grains(x.motion))});
  if (solid_ != nullptr) questions.push_back({solid_, advance_request(*solid_, for_solid(x.forces))});
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
  InterfaceState answer;
  if (solid_ == nullptr) return answer;
  answer.motion = checked_motion(*solid_, last_solid_.outputs(), surface_, position_);
  answer.forces = nodal_forces(x.motion);
  return answer;
}

v1::Exchange Partners::for_fluid(const WetMotion& motion) const {
  v1::Exchange inputs;
  if (solid_ != nullptr) *inputs.mutable_displacements() = message_of(motion, surface_);
  if (grains_ != nullptr) *inputs.mutable_grain_states() = grain_states_;
  return inputs;
}

v1::Exchange Partners::for_grains(const WetMotion& motion) const {
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

v1::Exchange Partners::for_solid(const std::vector<double>& forces) const {
  v1::Exchange inputs;
  inputs.mutable_forces()->set_surface(surface_.identity());
  inputs.mutable_forces()->mutable_force()->Assign(forces.begin(), forces.end());
  return inputs;
}

std::vector<double> Partners::nodal_forces(const WetMotion& motion) const {
  std::vector<double> sum(motion.displacement.size(), 0.0);
  if (fluid_ != nullptr) {
    const auto& loads = checked_pressures(*fluid_, last_fluid_.outputs(), surface_, position_);
    add_to(sum, consistent_nodal_forces(surface_, motion.displacement, loads).force());
  }
  if (grains_ != nullptr)
    add_to(sum, checked_forces(*grains_, last_grains_.outputs(), surface_, position_).force());
  return sum;
}

void Partners::describe(const InterfaceState& x, const InterfaceState& answer, IterationRow& row) const {
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

void Partners::accept(const Position& position) {
  std::vector<Participants::Question> questions;
  for (const auto& participant : participants_.all()) {
    if (once() && participant->accepts_in_advance()) continue;  // has done so
    questions.push_back({participant.get(), {}});
    questions.back().request.mutable_accept();
  }
  participants_.ask_all(std::move(questions), position);
  if (grains_ != nullptr && fluid_ != nullptr) {
    check_grain_states(last_grains_.outputs().grain_states(), scene_.dimension, position);
    grain_states_ = last_grains_.outputs().grain_states();
  }
}

void Partners::write_frames(std::uint64_t number, double time, const Position& position) {
  for (const auto& participant : participants_.all()) {
    v1::Request request;
    request.mutable_frame()->set_number(number);
    request.mutable_frame()->set_time(time);
    participants_.ask(*participant, std::move(request), position);
  }
}

}  // namespace estuary::coupler
