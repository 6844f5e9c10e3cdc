// Time steps of a window, and until a flow is steady.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "fluid.hpp"
#include "stopwatch.hpp"

namespace estuary::fluid {
namespace {

using Clock = std::chrono::steady_clock;

// A flow that leaves the method's range is found at the latest after so many steps.
constexpr std::uint64_t steps_between_looks = 100;

double relative(double change, double norm) {
  return change == 0 ? 0 : std::sqrt(change / norm);
}

}  // namespace

void Fluid::advance_transient(const Window& window, const Motion& end, ProgressBoard& progress) {
  const double exact = window.duration / scene_.units.time_step;
  const double rounded = std::round(exact);
  if (rounded < 1 || std::abs(exact - rounded) > 1e-6 * rounded) {
    throw BadInput("duration", fmt::format("a window of {:g} s is not a whole number of time steps of {:g} s",
                                           window.duration, scene_.units.time_step));
  }
  if (window.iteration > 1) {
    if (!window_start_)
      throw BadInput("header.iteration",
                     "this scene goes through every window once, so its start was not kept");
    place_bodies(window.time, 0.0, false);
    give_back(*window_start_);
  } else if (window_start_) {
    flow_->copy_to(*window_start_);
  }
  time_ = window.time;
  end_time_ = window.time + window.duration;
  place_bodies(window.time, 0.0, true);
  restart_body_loads();
  set_time(window.time);
  const auto steps = static_cast<std::size_t>(rounded);
  const bool resting = end.displacement == accepted_.displacement && end.velocity == accepted_.velocity &&
                       std::all_of(end.velocity.begin(), end.velocity.end(), [](double v) { return v == 0; });
  const bool all_fixed = resting && sides_constant_ && grains_.resting() && bodies_->fixed();
  auto reported = Clock::now();
  restart_exchanged();
  for (std::size_t done = 0; done < steps;) {
    const std::size_t count = all_fixed ? std::min(steps - done, steps_at_once()) : 1;
    run(count);
    done += count;
    const double fraction = static_cast<double>(done) / rounded;
    if (!resting) move_inside_window(end, done == steps ? 1.0 : fraction, window.duration);
    const double time = done == steps ? end_time_ : window.time + window.duration * fraction;
    if (!all_fixed) place_bodies(time, done == steps ? 1.0 : fraction, true);
    set_time(time);
    add_exchanged(static_cast<double>(count) / rounded);
    if (as_first_rank(ranks_, Clock::now() - reported > std::chrono::milliseconds(100))) {
      check_progress(progress, fraction, fmt::format("step {} of {}", done, steps));
      // To look at every node takes longer than a step, and on a large lattice a step takes longer than this.
      if (steps_ - steps_checked_ >= steps_between_looks) check_state();
      reported = Clock::now();
    }
  }
  // A window may be a single step, and to look at every node takes longer than the step.
  const bool last = scene_.end_time > 0 && end_time_ > scene_.end_time - 0.5 * scene_.units.time_step;
  if (last || steps_ - steps_checked_ >= steps_between_looks) check_state();
  flow_->apply_boundaries();
  evaluate_loads();
}

double Fluid::advance_steady(const Window& window, const Motion& end, ProgressBoard& progress) {
  if (!end.displacement.empty()) move_surface(end);
  place_bodies(0.0, 1.0, true);
  const auto between = static_cast<std::uint64_t>(steps_between_checks(flow_->grid().nx, flow_->grid().ny));
  fields_current_ = false;
  evaluate_fields();
  update_velocities(fields_, flow_->cells(), previous_x_, previous_y_, previous_z_, ranks_);
  previous_load_.clear();
  restart_exchanged();
  add_exchanged(1.0);
  evaluate_loads();
  load_change();
  RemainingChange of_flow;
  RemainingChange of_load;
  int satisfied = 0;
  double first = 0;
  const std::uint64_t begin = steps_;
  while (true) {
    restart_body_loads();
    for (std::uint64_t done = 0; done < between;) {
      const std::size_t count = std::min<std::uint64_t>(between - done, steps_at_once());
      run(count);
      done += count;
      check_progress(progress, -1, {});
    }
    check_state();
    restart_exchanged();
    add_exchanged(1.0);
    evaluate_loads();
    const VelocityChange change =
        update_velocities(fields_, flow_->cells(), previous_x_, previous_y_, previous_z_, ranks_);
    of_flow.add(relative(change.change, change.norm));
    of_load.add(load_change());
    const double remaining = std::max(of_flow.estimate(), of_load.estimate());
    satisfied = remaining < scene_.steady_tolerance ? satisfied + 1 : 0;
    if (satisfied == 2) return remaining;
    if (first == 0 && std::isfinite(remaining)) first = remaining;
    const double fraction =
        first > scene_.steady_tolerance && std::isfinite(remaining)
            ? std::clamp(std::log(first / remaining) / std::log(first / scene_.steady_tolerance), 0.0, 1.0)
            : -1;
    const std::uint64_t steps = steps_ - begin;
    check_progress(progress, fraction,
                   std::isfinite(remaining) ? fmt::format("step {}, change left {:.2g}", steps, remaining)
                                            : fmt::format("step {}", steps));
    if (steps >= scene_.steady_maximum_steps) {
      throw NotConverged(
          fmt::format(
              "the flow is not steady after {} steps (iteration {}): estimated relative change left {:.3g}, "
              "tolerance {:.3g}",
              steps, window.iteration, remaining, scene_.steady_tolerance),
          "raise fluid.steady.maximum_steps or fluid.steady.tolerance; when the change does not shrink the "
          "flow may have no "
          "steady state at this Reynolds number: use coupling.mode = \"transient\"");
    }
  }
}

void Fluid::run(std::size_t steps) {
  const Stopwatch stopwatch(seconds_.collide_and_stream);
  flow_->run(steps);
  fields_current_ = false;
  steps_ += steps;
  updates_ += static_cast<double>(steps) * static_cast<double>(flow_->cells().fluid_count());
}

// About a tenth of a second's worth, so that a stop or a report is never late.
std::size_t Fluid::steps_at_once() const {
  const auto nodes = static_cast<double>(flow_->cells().fluid_count());
  const double per_second = updates_ > 20 * nodes ? updates_ / seconds_.collide_and_stream : 2e7;
  return as_first_rank(ranks_, static_cast<std::size_t>(std::clamp(0.1 * per_second / nodes, 1.0, 1e6)));
}

void Fluid::check_progress(ProgressBoard& progress, double fraction, const std::string& note) {
  progress.report(fraction, note);
  if (as_first_rank(ranks_, progress.stop_requested())) throw Interrupted();
}

void Fluid::evaluate_fields() {
  if (fields_current_) return;
  const Stopwatch stopwatch(seconds_.fields_and_loads);
  flow_->compute_fields(fields_);
  fields_current_ = true;
}

// Relative L2 change of the load since the last call.
double Fluid::load_change() {
  if (!flow_->wet_surface()) return 0;
  std::vector<double> load = pressure_;
  load.insert(load.end(), traction_.begin(), traction_.end());
  double change = 0;
  double norm = 0;
  for (std::size_t k = 0; k < load.size() && k < previous_load_.size(); ++k) {
    change += (load[k] - previous_load_[k]) * (load[k] - previous_load_[k]);
    norm += load[k] * load[k];
  }
  previous_load_ = std::move(load);
  return relative(change, norm);
}

void Fluid::check_state() {
  evaluate_fields();
  steps_checked_ = steps_;
  const auto bad = find_bad_node(fields_, flow_->cells(), ranks_);
  if (!bad) return;
  const Grid& grid = flow_->grid();
  std::string saved;
  gather_fields(ranks_, grid, fields_);
  try {
    if (first_rank()) saved = output_->write_diverged(*flow_, fields_, scene_.units);
  } catch (const std::exception& error) {
    saved = fmt::format("nowhere: {}", error.what());
  }
  throw Diverged(
      "velocity",
      fmt::format("{} at cell ({}, {}, {}), x = {:g} m, y = {:g} m, z = {:g} m, step {}; last fields in {}",
                  bad->finite ? fmt::format("speed {:.3g} m/s (Mach {:.2g})",
                                            bad->speed / scene_.units.velocity_to_lattice(),
                                            bad->speed * std::sqrt(3.0))
                              : std::string("a value that is not finite"),
                  bad->node.x, bad->node.y, bad->node.z, grid.x(bad->node.x), grid.y(bad->node.y),
                  grid.nz > 0 ? grid.z(bad->node.z) : 0.0, steps_, saved),
      fmt::format("the relaxation time is {:.4g}: use a finer spacing, a smaller fluid.lattice_velocity, or "
                  "check that the "
                  "velocities at the sides and of the wet surface stay near fluid.reference_velocity",
                  scene_.units.relaxation_time()));
}

}  // namespace estuary::fluid
