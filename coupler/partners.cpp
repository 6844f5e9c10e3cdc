#include "partners.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "elapsed.hpp"
#include "failure.hpp"
#include "grain_fields.hpp"
#include "load_transfer.hpp"
#include "requirements.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// A load that the solid cannot take at once is halved at most this often.
constexpr int most_halvings = 5;

std::array<double, 2> first_two(const google::protobuf::RepeatedField<double>& field) {
  return {!field.empty() ? field[0] : 0.0, field.size() > 1 ? field[1] : 0.0};
}

}  // namespace

Partners::Partners(const CouplingScene& scene, Participants& participants)
    : scene_(scene),
      participants_(participants),
      fluid_{.participant = participants.find("fluid")},
      solid_{.participant = participants.find("solid")},
      grains_{.participant = participants.find("grains")} {}

v1::Exchange Partners::ask_start(Partner& partner, v1::Exchange initial) {
  v1::Started started;
  if (partner.participant->started()) {
    started = *partner.participant->started();
  } else {
    v1::Request request;
    *request.mutable_start()->mutable_initial() = std::move(initial);
    started =
        std::move(*participants_.ask(*partner.participant, std::move(request), position_).mutable_started());
  }
  if (started.has_window_step()) partner.window_step = started.window_step();
  if (agree() && &partner != &solid_ && started.initial().has_wet_surface())
    link_surface(partner, started.initial());
  return std::move(*started.mutable_initial());
}

void Partners::link_surface(Partner& partner, const v1::Exchange& brought) {
  const std::string& role = partner.participant->role();
  if (brought.wet_surface().identity() == surface_.identity()) {
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("participant '{}' brings a wet surface of its own with the identity of the solid's, {}",
                    role, surface_.identity()),
        "a surface of its own needs an identity of its own");
  }
  try {
    if (surface_.tears())
      throw RunFailure(
          ExitStatus::wrong_scene,
          fmt::format("the surface of participant 'solid' may tear, and '{}' brings one of its own",
                      partner.participant->role()),
          "only whoever meets the solid's own facets can open them");
    partner.link.emplace(brought.wet_surface(), surface_, scene_.mapping, scene_.mapped_loads);
  } catch (const std::invalid_argument& error) {
    throw RunFailure(ExitStatus::wrong_scene, fmt::format("the wet surface of '{}': {}", role, error.what()));
  }
  spdlog::info("{} brings a wet surface of its own: {}", role, partner.link->description());
}

double Partners::window_granularity() const {
  double largest = 0;
  for (const Partner* partner : {&fluid_, &solid_, &grains_}) {
    if (!partner->there()) continue;
    if (!partner->window_step) {
      throw RunFailure(
          ExitStatus::wrong_scene,
          fmt::format("coupling.adaptive_window: '{}' computes windows of the scene's length only",
                      partner->participant->role()),
          "take adaptive_window out of the scene");
    }
    largest = std::max(largest, *partner->window_step);
  }
  for (const Partner* partner : {&fluid_, &solid_, &grains_}) {
    if (!partner->there() || !(*partner->window_step > 0)) continue;
    const double ratio = largest / *partner->window_step;
    if (std::abs(ratio - std::round(ratio)) > 1e-6 * ratio) {
      throw RunFailure(
          ExitStatus::wrong_scene,
          fmt::format("coupling.adaptive_window: '{}' takes steps of {:g} s, of which {:g} s is no multiple",
                      partner->participant->role(), *partner->window_step, largest),
          "choose time steps that divide each other");
    }
  }
  return largest;
}

void Partners::start() {
  position_ = {};
  v1::Exchange for_others;
  if (solid_.there()) {
    for_others = ask_start(solid_, {});
    if (agree()) take_surface(for_others);
    for (const Partner* partner : {&fluid_, &grains_})
      if (surface_.tears() && partner->there() && !can(partner->participant->identity(), "torn-surface"))
        throw RunFailure(
            ExitStatus::wrong_scene,
            fmt::format("the surface of participant 'solid' may tear, and '{}' cannot open it: it lacks "
                        "\"torn-surface\"",
                        partner->participant->role()),
            "take the solid's `rupture` out of the scene, or name a solver that can");
  }
  if (grains_.there()) {
    const v1::Exchange grains_bring = ask_start(grains_, for_others);
    if (fluid_.there()) {
      if (!grains_bring.has_grain_states())
        throw RunFailure(
            ExitStatus::wrong_scene,
            "participant 'grains' brings no states of its grains, which the fluid needs",
            "its answer to Start has to hold `grain_states`; or leave the fluid out: --set fluid=off");
      grain_states_ = grains_bring.grain_states();
      check_grain_states(grain_states_, scene_.dimension, position_);
      *for_others.mutable_grain_states() = grain_states_;
    }
  }
  if (fluid_.there()) ask_start(fluid_, std::move(for_others));
}

void Partners::take_surface(v1::Exchange& for_others) {
  if (!for_others.has_wet_surface()) {
    throw RunFailure(ExitStatus::wrong_scene,
                     "participant 'solid' brings no wet surface, so nothing can act on it",
                     "name its wet sides");
  }
  surface_ = for_others.wet_surface();
  const auto& motion = for_others.displacements();
  if (motion.displacement().empty() || motion.velocity().empty()) {
    throw RunFailure(ExitStatus::wrong_scene,
                     fmt::format("participant 'solid' brings a wet surface, but no {} of its nodes",
                                 motion.displacement().empty() ? "displacement" : "velocity"),
                     "its answer to Start has to hold `displacements` with both, as many values as the "
                     "surface's positions: zeros at rest");
  }
  try {
    check_wet_surface(surface_);
  } catch (const std::invalid_argument& error) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("participant 'solid', in phase start: {}", error.what()));
  }
  if (surface_.dimension() != static_cast<std::uint32_t>(scene_.dimension)) {
    throw RunFailure(ExitStatus::wrong_scene,
                     fmt::format("participant 'solid' brings a wet surface in {} dimensions to a scene in {}",
                                 surface_.dimension(), scene_.dimension),
                     "the scene's `dimension` and the solver's own must be the same");
  }
  initial_.motion = checked_motion(*solid_.participant, for_others, surface_, position_);
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
  for (Partner* partner : {&fluid_, &solid_, &grains_})
    if (partner->there()) advance(*partner, {});
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

void Partners::advance(Partner& partner, v1::Exchange inputs) {
  RemoteParticipant& participant = *partner.participant;
  partner.last =
      advanced_of(participant,
                  participants_.ask(participant, advance_request(participant, std::move(inputs)), position_));
}

InterfaceState Partners::answer_in_turn(const InterfaceState& x, IterationRow& row) {
  InterfaceState answer;
  if (fluid_.there()) {
    const auto begin = steady_clock::now();
    advance(fluid_, for_fluid(x.motion));
    row.fluid_s = seconds_since(begin);
  }
  if (grains_.there()) advance(grains_, for_grains(x.motion));
  if (!solid_.there()) return answer;
  answer.forces = nodal_forces(x.motion, row);
  const auto begin = steady_clock::now();
  row.load_share = ask_solid(answer.forces);
  row.solid_s = seconds_since(begin);
  answer.motion = checked_motion(*solid_.participant, solid_.last.outputs(), surface_, position_);
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
      advance(solid_, for_solid(given));
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
  const auto ask = [&](const Partner& partner, v1::Exchange inputs) {
    questions.push_back({partner.participant, advance_request(*partner.participant, std::move(inputs))});
  };
  if (fluid_.there()) ask(fluid_, for_fluid(x.motion));
  if (grains_.there()) ask(grains_, for_grains(x.motion));
  if (solid_.there()) ask(solid_, for_solid(x.forces));
  std::vector<double> before;
  before.reserve(questions.size());
  for (const auto& question : questions) before.push_back(question.participant->usage().wall_s);
  std::vector<RemoteParticipant*> asked;
  asked.reserve(questions.size());
  for (const auto& question : questions) asked.push_back(question.participant);
  std::vector<v1::Reply> replies = participants_.ask_all(std::move(questions), position_);
  for (std::size_t k = 0; k < asked.size(); ++k) {
    const double seconds = asked[k]->usage().wall_s - before[k];
    v1::Advanced advanced = advanced_of(*asked[k], std::move(replies[k]));
    if (asked[k] == fluid_.participant) {
      fluid_.last = std::move(advanced);
      row.fluid_s = seconds;
    } else if (asked[k] == solid_.participant) {
      solid_.last = std::move(advanced);
      row.solid_s = seconds;
    } else {
      grains_.last = std::move(advanced);
    }
  }
  InterfaceState answer;
  if (!solid_.there()) return answer;
  answer.motion = checked_motion(*solid_.participant, solid_.last.outputs(), surface_, position_);
  answer.forces = nodal_forces(x.motion, row);
  return answer;
}

v1::Displacements Partners::motion_for(const Partner& partner, const WetMotion& motion) const {
  return partner.link ? message_of(partner.link->motion(motion), partner.link->surface())
                      : message_of(motion, surface_);
}

v1::Exchange Partners::for_fluid(const WetMotion& motion) const {
  v1::Exchange inputs;
  if (solid_.there()) *inputs.mutable_displacements() = motion_for(fluid_, motion);
  if (grains_.there()) *inputs.mutable_grain_states() = grain_states_;
  return inputs;
}

v1::Exchange Partners::for_grains(const WetMotion& motion) const {
  v1::Exchange inputs;
  if (solid_.there()) *inputs.mutable_displacements() = motion_for(grains_, motion);
  if (fluid_.there()) {
    if (fluid_.last.outputs().has_grain_forces()) {
      check_grain_forces(fluid_.last.outputs().grain_forces(), grain_states_, position_);
      *inputs.mutable_grain_forces() = fluid_.last.outputs().grain_forces();
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

std::vector<double> Partners::nodal_forces(const WetMotion& motion, IterationRow& row) const {
  std::vector<double> sum(motion.displacement.size(), 0.0);
  LoadSums unmapped;
  const auto add = [&](std::span<const double> forces) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += forces[i];
  };
  // What acts on the solid's own nodes takes part in the sums as it is.
  const auto add_own = [&](const v1::NodalForces& forces) {
    const std::span<const double> values(forces.force().data(),
                                         static_cast<std::size_t>(forces.force_size()));
    add(values);
    unmapped = sum_load(surface_, motion.displacement, motion.velocity, values);
  };
  const auto count = [&] {
    if (!fluid_.link && !grains_.link) return;
    if (!row.before_mapping) row.before_mapping.emplace();
    auto& sums = *row.before_mapping;
    const std::array<double, 4> own = {unmapped.force[0], unmapped.force[1], unmapped.moment, unmapped.power};
    for (std::size_t k = 0; k < own.size(); ++k) sums[k] += own[k];
  };
  if (fluid_.there()) {
    const v1::Exchange& outputs = fluid_.last.outputs();
    // A fluid of particles gives the forces of its impacts.
    if (outputs.has_forces()) {
      const v1::WetSurface& own = fluid_.link ? fluid_.link->surface() : surface_;
      const auto& forces = checked_forces(*fluid_.participant, outputs, own, position_);
      if (fluid_.link)
        add(fluid_.link->forces(forces, motion, unmapped));
      else
        add_own(forces);
    } else if (fluid_.link) {
      const auto& loads = checked_pressures(*fluid_.participant, outputs, fluid_.link->surface(), position_);
      add(fluid_.link->forces(loads, motion, unmapped));
    } else {
      const auto& loads = checked_pressures(*fluid_.participant, outputs, surface_, position_);
      add_own(consistent_nodal_forces(surface_, motion.displacement, loads));
    }
    count();
  }
  if (grains_.there()) {
    const v1::Exchange& outputs = grains_.last.outputs();
    if (grains_.link) {
      const auto& forces = checked_forces(*grains_.participant, outputs, grains_.link->surface(), position_);
      add(grains_.link->forces(forces, motion, unmapped));
    } else {
      add_own(checked_forces(*grains_.participant, outputs, surface_, position_));
    }
    count();
  }
  return sum;
}

void Partners::describe(const InterfaceState& x, const InterfaceState& answer, IterationRow& row) const {
  const LoadSums given = sum_load(surface_, x.motion.displacement, x.motion.velocity, answer.forces);
  row.force = {given.force[0], given.force[1]};
  row.moment = given.moment;
  row.fluid_power = given.power;
  row.solid_power =
      sum_load(surface_, answer.motion.displacement, answer.motion.velocity, answer.forces).power;
  row.fluid_force = first_two(fluid_.last.surface_force());
  row.fluid_moment = fluid_.last.surface_moment();
  row.solid_force = first_two(solid_.last.surface_force());
  row.solid_moment = solid_.last.surface_moment();
  row.fluid_error = fluid_.last.remaining_error();
  row.solid_error = solid_.last.remaining_error();
}

void Partners::accept(const Position& position) {
  std::vector<Participants::Question> questions;
  for (const auto& participant : participants_.all()) {
    if (once() && participant->accepts_in_advance()) continue;  // has done so
    questions.push_back({participant.get(), {}});
    questions.back().request.mutable_accept();
  }
  participants_.ask_all(std::move(questions), position);
  if (grains_.there() && fluid_.there()) {
    check_grain_states(grains_.last.outputs().grain_states(), scene_.dimension, position);
    grain_states_ = grains_.last.outputs().grain_states();
  }
}

std::map<std::string, std::string> Partners::save() const {
  std::map<std::string, std::string> messages{{"grain states", grain_states_.SerializeAsString()}};
  for (const Partner* partner : {&fluid_, &grains_, &solid_})
    if (partner->there()) messages[partner->participant->role()] = partner->last.SerializeAsString();
  return messages;
}

void Partners::load(const std::map<std::string, std::string>& messages) {
  const auto read = [&](const std::string& name, google::protobuf::MessageLite& message) {
    const auto found = messages.find(name);
    if (found == messages.end() || !message.ParseFromString(found->second))
      throw std::runtime_error(fmt::format("the message '{}' cannot be read", name));
  };
  read("grain states", grain_states_);
  for (Partner* partner : {&fluid_, &grains_, &solid_})
    if (partner->there()) read(partner->participant->role(), partner->last);
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
