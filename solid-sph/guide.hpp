// Particles with a prescribed motion, on their way through the steps of a window.
#pragma once

#include "loading.hpp"

namespace estuary::solid {

/// Moves what has a prescribed motion, and measures the work of what moves it.
class Guide {
public:
  Guide(const Body& body, const Loading& loading) : body_(body), motions_(loading.prescribed) {
    for (const PrescribedMotion& motion : motions_) count_ += motion.particle.size();
    last_force_.resize(count_);
    step_.resize(count_);
  }
  void remember(const std::vector<double>& force) {
    visit([&](std::size_t k, std::size_t c) { last_force_[k] = force[c]; });
  }
  void move(State& state, double time, double dt) {
    gained_ = 0;
    std::size_t k = 0;
    for (const PrescribedMotion& motion : motions_)
      for (const std::uint32_t i : motion.particle) {
        const std::size_t c = 2 * i + motion.component;
        const double next = motion.displacement(body_.position[2 * i], body_.position[2 * i + 1], time);
        step_[k] = next - state.displacement[c];
        const double velocity = step_[k] / dt;
        gained_ += 0.5 * body_.mass[i] * (velocity * velocity - state.velocity[c] * state.velocity[c]);
        state.displacement[c] = next;
        state.velocity[c] = velocity;
        ++k;
      }
  }
  void copy_velocity(const std::vector<double>& from, std::vector<double>& to) const {
    visit([&](std::size_t, std::size_t c) { to[c] = from[c]; });
  }
  // Kinetic energy gained and work against all other forces.
  double work(const std::vector<double>& force, const std::array<double, 2>& gravity) {
    double work = gained_;
    visit([&](std::size_t k, std::size_t c) {
      work -= (0.5 * (force[c] + last_force_[k]) + body_.mass[c / 2] * gravity[c % 2]) * step_[k];
      last_force_[k] = force[c];
    });
    return work;
  }

private:
  template <class Action>
  void visit(Action&& action) const {
    std::size_t k = 0;
    for (const PrescribedMotion& motion : motions_)
      for (const std::uint32_t i : motion.particle) action(k++, 2 * i + motion.component);
  }
  const Body& body_;
  const std::vector<PrescribedMotion>& motions_;
  std::size_t count_ = 0;
  std::vector<double> last_force_, step_;
  double gained_ = 0;
};

}  // namespace estuary::solid
