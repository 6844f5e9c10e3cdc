#include "coupling_loop.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "answer_jump.hpp"
#include "elapsed.hpp"
#include "watch_integrals.hpp"
#include "wet_crossing.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// Relaxation of a window tried again with small steps, as a share of the scene's.
constexpr double small_step = 0.2;

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
                           ProgressBar& bar, Checkpoints& checkpoints, steady_clock::time_point begun)
    : scene_(scene),
      participants_(participants),
      record_(record),
      bar_(bar),
      checkpoints_(checkpoints),
      begun_(begun),
      partners_(scene, participants),
      clock_(scene.window, scene.windows) {}

double CouplingLoop::time_of_window() const {
  return steady() ? static_cast<double>(position_.iteration) : clock_.end_of_span();
}

void CouplingLoop::run() {
  if (position_.window == 0) {
    write_frames(0.0);
    if (checkpoints_.start_wanted()) keep();
  }
  while (!clock_.at_end()) {
    ++position_.window;
    if (participants_.all().size() > 1) {
      compute_window();
    } else {
      compute_alone();
    }
    keep_if_due();
  }
  if (!steady() && (scene_.frame_interval == 0 || position_.window % scene_.frame_interval != 0))
    write_frames(time_of_window());
}

void CouplingLoop::start() {
  partners_.start();
  if (!partners_.agree()) return;
  history_.accepted = last_ = partners_.initial();
  convergence_ = std::make_unique<Convergence>(scene_, displacement_scale(partners_.surface()));
  take_care(Care::normal);
  bodies_can_meet_ = steady() && bodies_can_meet(partners_.surface());
  if (scene_.adaptive_window) clock_.allow_shorter(scene_.smallest_window, partners_.window_granularity());
}

void CouplingLoop::keep_if_due() {
  if (clock_.at_end()) return;
  if (participants_.interrupted()) {
    const bool kept = checkpoints_.wanted() && keep();
    throw RunFailure(ExitStatus::interrupted, fmt::format("interrupted after window {}{}", position_.window,
                                                          kept ? ", which is saved" : ""));
  }
  if (checkpoints_.due(position_.window)) keep();
}

bool CouplingLoop::keep() {
  // An interrupt lets a checkpoint be completed.
  constexpr double patience = 600;
  const double usual = participants_.after_interrupt();
  participants_.allow_after_interrupt(patience);
  CouplerState now = state();
  bool kept = false;
  try {
    now.record = record_.position();
    now.messages_record = participants_.record_positions();
    kept = checkpoints_.write(participants_, position_, std::move(now));
  } catch (const RunFailure&) {
    participants_.allow_after_interrupt(usual);
    throw;
  }
  participants_.allow_after_interrupt(usual);
  return kept;
}

CouplerState CouplingLoop::state() const {
  CouplerState state{.window = position_.window,
                     .time = clock_.at_end() ? 0 : clock_.span().begin,
                     .total_iterations = total_iterations_,
                     .frame = frame_,
                     .care = static_cast<std::uint64_t>(acceleration_care_),
                     .history = history_,
                     .clock = {},
                     .convergence = {},
                     .acceleration = {},
                     .messages = partners_.save(),
                     .record = {},
                     .messages_record = {},
                     .wall_s = seconds_since(begun_)};
  const auto values_of = [](const auto& object) {
    StateWriter writer;
    object.save(writer);
    return writer.values();
  };
  state.clock = values_of(clock_);
  if (convergence_) state.convergence = values_of(*convergence_);
  if (acceleration_) state.acceleration = values_of(*acceleration_);
  return state;
}

void CouplingLoop::go_to(const CheckpointSet& set) {
  const CouplerState& state = set.state;
  const auto take = [](const std::vector<double>& values, auto& object) {
    StateReader reader(values);
    object.load(reader);
    reader.require_end();
  };
  const InterfaceState& at = state.history.accepted;
  if (at.motion.displacement.size() != history_.accepted.motion.displacement.size() ||
      at.motion.velocity.size() != history_.accepted.motion.velocity.size() ||
      at.forces.size() != history_.accepted.forces.size())
    throw std::runtime_error("the checkpoint belongs to another wet surface");
  if (state.care > static_cast<std::uint64_t>(Care::small_steps))
    throw std::runtime_error("the checkpoint names a care that there is not");
  Checkpoints::load(participants_, set);
  partners_.load(state.messages);
  take(state.clock, clock_);
  if (convergence_) take(state.convergence, *convergence_);
  if (acceleration_) {
    take_care(static_cast<Care>(state.care));
    take(state.acceleration, *acceleration_);
  }
  history_ = state.history;
  last_ = history_.accepted;
  position_ = {.window = state.window, .iteration = 0};
  total_iterations_ = state.total_iterations;
  frame_ = state.frame;
  record_.go_back(state.record);
  participants_.records_go_back(state.messages_record);
}

void CouplingLoop::compute_alone() {
  const auto begin = steady_clock::now();
  position_.iteration = 1;
  ++total_iterations_;
  bar_.begin(position_);
  partners_.advance_alone(clock_.span(), position_);
  partners_.accept(position_);
  record_watches(time_of_window());
  double remaining_error = 0;
  partners_.for_each_answer([&](const v1::Advanced& answer) { remaining_error = answer.remaining_error(); });
  finish_window("alone", remaining_error, seconds_since(begin));
  frames_if_due(position_.window, time_of_window());
  clock_.accept();
}

void CouplingLoop::compute_window() {
  const auto begin = steady_clock::now();
  position_.iteration = 0;
  care_ = Care::normal;  // the settings of the window before are kept
  while (true) {
    InterfaceState x =
        steady() ? history_.accepted : predict(scene_.predictor, history_, clock_.span().duration);
    if (acceleration_) acceleration_->begin_window();
    if (convergence_) convergence_->begin_window();
    bool used_up = false;  // the iterations allowed
    verdict_ = Verdict::go_on;
    try {
      const bool agreed = iterate_window(x);
      used_up = !agreed && !once() && scene_.at_maximum == AtMaximum::fail;
      if (used_up) {
        throw RunFailure(ExitStatus::no_solution,
                         fmt::format("the coupling did not converge: window {}, {} iterations, {}",
                                     position_.window, position_.iteration, convergence_->furthest()),
                         "raise coupling.max_iterations, or try another coupling.relaxation or acceleration",
                         true);
      }
      accept_window(once() ? "explicit" : agreed ? "converged" : "not converged", seconds_since(begin));
      return;
    } catch (const RunFailure& failure) {
      if (failure.status != ExitStatus::no_solution) throw;
      if (try_again(failure)) continue;
      if (used_up || verdict_ == Verdict::diverged || verdict_ == Verdict::stalled) {
        finish_window(used_up                         ? "not converged"
                      : verdict_ == Verdict::diverged ? "diverged"
                                                      : "stalled",
                      convergence_->relative(Field::displacement), seconds_since(begin));
      }
      throw explained(failure, std::move(x), !used_up && verdict_ != Verdict::stalled);
    }
  }
}

// A window can be tried again where participants go back to its start. The care stays for the windows after
// it: what was learnt with it is worth more than the larger steps.
bool CouplingLoop::try_again(const RunFailure& failure) {
  if (!failure.curable || !scene_.recover || steady() || once()) return false;
  std::string how;
  if (care_ != Care::small_steps) {
    take_care(care_ == Care::normal ? Care::without_history : Care::small_steps);
    how = care_ == Care::small_steps ? fmt::format("with relaxation {:g}", small_step * scene_.relaxation)
                                     : "without the history";
  } else if (clock_.shorten()) {
    // Changes of a window's answer per change of its motion depend on the window's length.
    take_care(Care::normal);
    how = fmt::format("with a window of {:g} s", clock_.span().duration);
  } else {
    return false;
  }
  spdlog::warn("window {}: tried again {} after iteration {}: {}", position_.window, how, position_.iteration,
               failure.what());
  return true;
}

// Two causes that no acceleration cures look like a failed iteration: windows that swing from one to the
// next, and a participant whose answer jumps where the iteration has to pass.
RunFailure CouplingLoop::explained(const RunFailure& failure, InterfaceState x, bool settles) {
  std::string line = failure.what(), advice = failure.advice;
  const auto add = [&](const std::string& what, const std::string& hint) {
    line += "; " + what;
    advice += (advice.empty() ? "" : "; or ") + hint;
  };
  // Explicit schemes swing by their splitting, which their own advice is about.
  if (const double share = swing_.share(); share > 0 && scene_.implicit()) {
    add(fmt::format(
            "before it the forces changed by {:.0f} % of themselves from window to window, back and forth",
            100 * share),
        "a window of another length, or loads without steps at its ends (solid.window_load = \"linear\" of "
        "solid-sph): the windows are unstable, not their iteration");
  }
  // Where forces are a part of the iterate its answers depend on more than the motion. Whoever allows few
  // iterations, as where each takes long, does not wait for more than those.
  if (!settles && !steady() && !scene_.parallel() && scene_.max_iterations >= answer_calls) {
    spdlog::info("window {}: asks up to {} times more whether an answer jumps", position_.window,
                 answer_calls);
    try {
      const auto jump = find_jump(
          std::move(x),
          [&](const InterfaceState& motion) {
            ++position_.iteration;
            bar_.begin(position_);
            IterationRow unused;  // no row of the tables, and not counted: the window is over
            return partners_.answer(motion, clock_.span(), position_, unused);
          },
          [&](InterfaceState& motion, const InterfaceState& answer) {
            accelerate(*acceleration_, motion, answer, clock_.span().duration, true, false,
                       acceleration_vectors_);
          });
      if (jump) {
        add(fmt::format("an answer jumps there: over {:.1e} m of motion the forces change by {:.1e} of "
                        "themselves, the velocity by {:.1e}, the displacement by {:.1e}",
                        jump->distance, jump->forces, jump->velocity, jump->displacement),
            "limits above these shares, which no iteration can pass, or a finer fluid, whose nodes the "
            "surface covers one by one");
      }
    } catch (const RunFailure& unanswered) {
      // What the window failed of is what a person has to know, whatever comes after.
      spdlog::warn("window {}: not known whether an answer jumps: {}", position_.window, unanswered.what());
    }
  }
  RunFailure result(failure.status, line, advice, failure.curable);
  result.lost = failure.lost;
  return result;
}

void CouplingLoop::take_care(Care care) {
  care_ = acceleration_care_ = care;
  AccelerationSettings settings = settings_of(scene_, history_.accepted.forces.size());
  if (care == Care::small_steps) {
    settings.relaxation *= small_step;
    settings.remainder = small_step;
  }
  acceleration_ = make_acceleration(settings);
}

bool CouplingLoop::iterate_window(InterfaceState& x) {
  // Each attempt at a window may use all iterations allowed.
  const auto limit =
      position_.iteration + (once() ? std::uint64_t{1} : static_cast<std::uint64_t>(scene_.max_iterations));
  while (position_.iteration < limit) {
    ++position_.iteration;
    ++total_iterations_;
    bar_.begin(position_);
    iterate(x);
    if (steady()) record_watches(time_of_window());
    if (bodies_can_meet_) look_for_crossing();
    if (verdict_ == Verdict::converged) return true;
    const double residual = convergence_ ? convergence_->relative(Field::displacement) : 0.0;
    if (verdict_ == Verdict::diverged) {
      throw RunFailure(
          ExitStatus::no_solution,
          fmt::format("the coupling diverged: window {}, iteration {}, displacement of the wet surface, "
                      "residual {:.3e}, norm {:.3e} m",
                      position_.window, position_.iteration, residual, norms_.displacement),
          scene_.implicit()
              ? "try coupling.acceleration = \"iqn-ils\", a smaller coupling.relaxation or a shorter window"
              : "an explicit scheme is unstable where the fluid's added mass exceeds the solid's: use "
                "coupling.scheme = "
                "\"serial-implicit\"",
          true);
    }
    if (verdict_ == Verdict::stalled) {
      throw RunFailure(ExitStatus::no_solution,
                       fmt::format("the coupling stalled: window {}, iteration {}, {}, no longer shrinks",
                                   position_.window, position_.iteration, convergence_->furthest()),
                       "one of the participants may not answer smoothly: a finer fluid or a tighter steady "
                       "tolerance helps; or raise coupling.tolerance",
                       true);
    }
    if (steady() && position_.iteration < limit) frames_if_due(position_.iteration, time_of_window());
  }
  return false;
}

void CouplingLoop::iterate(InterfaceState& x) {
  IterationRow row;
  row.window = position_.window;
  row.iteration = position_.iteration;
  row.time = time_of_window();
  InterfaceState answer = partners_.answer(x, clock_.span(), position_, row);
  verdict_ = Verdict::go_on;
  if (!partners_.agree()) return;
  judge(x, answer, row);
  if (row.load_share < 1) {
    // A shape under a part of the load is a place to go on from, and teaches nothing about the whole.
    x.motion = answer.motion;
    acceleration_->forget();
    verdict_ = Verdict::go_on;
  } else if (verdict_ == Verdict::go_on && scene_.implicit()) {
    accelerate(*acceleration_, x, answer, clock_.span().duration, !steady(), scene_.parallel(),
               acceleration_vectors_);
    row.relaxation = acceleration_->relaxation();
  }
  last_ = std::move(answer);
  record_.add(row);
  bar_.residual(row.residual);
}

// On the way to an equilibrium bodies may pass through each other and come apart again; an equilibrium in
// which they do is none.
void CouplingLoop::look_for_crossing() {
  const bool at_the_end = verdict_ == Verdict::converged;
  if (warned_of_crossing_ && !at_the_end) return;
  const auto crossing = find_crossing(partners_.surface(), last_.motion.displacement);
  if (!crossing) return;
  const auto& rest = partners_.surface().reference_positions();
  const auto node = [&](std::size_t k) {
    const auto n = static_cast<int>(crossing->nodes[k]);
    return fmt::format("{} (at rest {:.5g}, {:.5g})", n, rest[2 * n], rest[2 * n + 1]);
  };
  const std::string what = fmt::format(
      "participant 'solid' at window {}, iteration {}: two lines of the wet surface pass through each other "
      "at {:.5g}, {:.5g}, beside its nodes {} and {}",
      position_.window, position_.iteration, crossing->place[0], crossing->place[1], node(0), node(1));
  if (!at_the_end) {
    warned_of_crossing_ = true;
    spdlog::warn("{}; an equilibrium like that ends the run", what);
    return;
  }
  write_frames(time_of_window());
  throw RunFailure(
      ExitStatus::no_solution, what,
      "a steady run knows no contact between bodies: lower the load or what moves the held parts, "
      "or compute the scene with coupling.mode = \"transient\" and a [solid.contact]");
}

void CouplingLoop::judge(const InterfaceState& x, const InterfaceState& answer, IterationRow& row) {
  norms_ = {.displacement_increment = l2_distance(answer.motion.displacement, x.motion.displacement),
            .displacement = l2_norm(answer.motion.displacement),
            .velocity_increment = l2_distance(answer.motion.velocity, x.motion.velocity),
            .velocity = l2_norm(answer.motion.velocity),
            .force_increment = l2_distance(answer.forces, scene_.parallel() ? x.forces : last_.forces),
            .force = l2_norm(answer.forces)};
  verdict_ = convergence_->judge(norms_, position_.iteration);
  if (!scene_.implicit() && convergence_->runs_away(norms_)) verdict_ = Verdict::diverged;
  row.displacement_norm = norms_.displacement;
  row.residual = convergence_->relative(Field::displacement);
  // A solid that takes one step per window answers with a displacement that does not depend on the new load:
  // only its velocity tells whether they agree.
  if (!steady()) row.velocity_residual = convergence_->relative(Field::velocity);
  row.force_residual = convergence_->relative(Field::force);
}

void CouplingLoop::accept_window(const char* verdict, double wall_s) {
  partners_.accept(position_);
  if (partners_.agree()) {
    convergence_->accept(norms_);
    history_.earlier_velocity = std::move(history_.accepted.motion.velocity);
    history_.earlier_duration = clock_.span().duration;
    history_.accepted = last_;
    // Grains that hit the surface make forces of their own from window to window.
    if (!steady() && scene_.find("grains") == nullptr) swing_.accept(last_.forces);
  }
  if (!steady()) record_watches(time_of_window());
  finish_window(verdict, convergence_ ? convergence_->relative(Field::displacement) : 0.0, wall_s);
  // In steady mode the last iteration is always shown.
  if (steady()) {
    write_frames(time_of_window());
  } else {
    frames_if_due(position_.window, time_of_window());
  }
  const double duration = clock_.span().duration;
  clock_.accept();
  // What was learnt holds for windows of that length.
  if (acceleration_ && !clock_.at_end() && clock_.span().duration != duration) acceleration_->forget();
}

void CouplingLoop::finish_window(const char* verdict, double residual, double wall_s) {
  record_.add(WindowRow{.window = position_.window,
                        .total_iterations = total_iterations_,
                        .iterations = position_.iteration,
                        .verdict = verdict,
                        .time = time_of_window(),
                        .residual = residual,
                        .wall_s = wall_s,
                        .duration = clock_.span().duration});
  spdlog::info("window {}: {} after {} iterations, residual {:.3e}, {:.3f} s", position_.window, verdict,
               position_.iteration, residual, wall_s);
  if (record_.flush_if_due()) spdlog::default_logger()->flush();
}

void CouplingLoop::frames_if_due(std::uint64_t count, double time) {
  const bool single_equilibrium = steady() && scene_.participants.size() == 1;
  const bool due = scene_.frame_interval != 0 && count % scene_.frame_interval == 0;
  if (single_equilibrium || due) write_frames(time);
}

void CouplingLoop::write_frames(double time) {
  if (scene_.frames) partners_.write_frames(frame_++, time, position_);
}

void CouplingLoop::record_watches(double time) {
  partners_.for_each_answer([&](const v1::Advanced& answer) {
    for (const auto& sample : answer.watches()) record(sample, time);
  });
  for (const auto& watch : scene_.watches)
    if (watch.participant == "coupling")
      record(surface_integrals(watch.name, partners_.surface(), last_, position_.iteration), time);
}

void CouplingLoop::record(const v1::WatchSample& sample, double time) {
  if (sample.quantity_size() != sample.value_size()) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("the watch '{}' came with {} names and {} values", sample.name(),
                                 sample.quantity_size(), sample.value_size()));
  }
  record_.add(sample, position_.window, position_.iteration, time);
}

}  // namespace estuary::coupler
