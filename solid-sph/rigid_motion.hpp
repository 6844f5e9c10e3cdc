// Rigid bodies on springs and dampers, step by step.
//
// Each degree of freedom obeys m q'' + c q' + k (q - rest) = g(t). Over a step with constant g the solution
// is exact (the matrix exponential, by scaling and squaring: Moler & Van Loan 2003, method 3), whatever the
// step; a change of g over the step enters the velocity as a ramp. With k = c = 0 this is velocity Verlet, so
// contact and loads that depend on the position are treated to second order.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "loading.hpp"
#include "particles.hpp"

namespace estuary::solid {

/// Solution of m q'' + c q' + k q = g after a step: q = qq q0 + qv v0 + qg g, v = vq q0 + vv v0 + vg g, for
/// constant g; a ramp of g from 0 to g_end adds vr g_end to v.
struct OscillatorStep {
  double qq = 1, qv = 0, qg = 0, vq = 0, vv = 1, vg = 0, vr = 0;
};
OscillatorStep oscillator_step(double mass, double damper, double spring, double dt);

/// Places the particles of a rigid body: displacement and velocity from its six state values.
void carry(const RigidBody& rigid, const Body& body, std::span<const double> values,
           std::vector<double>& displacement, std::vector<double>& velocity);
/// Resultant of the particles' forces on a rigid body: x, y, moment about the centre of mass.
std::array<double, 3> resultant(const RigidBody& rigid, const Body& body,
                                std::span<const double> displacement, const std::vector<double>& force,
                                std::span<const double> values);

/// Kinetic energy and that of the springs [J/m].
double kinetic_energy(const RigidBody& rigid, std::span<const double> values);
double spring_energy(const RigidBody& rigid, std::span<const double> values);

class RigidMotion {
public:
  /// For steps of `dt` from `state` on.
  RigidMotion(const Body& body, const Loading& loading, double dt);

  [[nodiscard]] bool empty() const { return body_.rigid.empty(); }
  /// Takes the particles' forces at the start of the first step.
  void begin(const State& state, const std::vector<double>& force);
  /// Moves bodies and particles to the end of a step, at `time`.
  void drift(State& state, double time);
  /// Takes the particles' forces there and completes the velocities.
  void kick(State& state, const std::vector<double>& force);
  /// Since the last call: work of gravity and of prescribed motion, and what the dampers took [J/m].
  [[nodiscard]] double external_work();
  [[nodiscard]] double damper_work();

private:
  const Body& body_;
  const Loading& loading_;
  double dt_;
  std::vector<std::array<OscillatorStep, 3>> step_;
  std::vector<std::array<double, 3>> force_;     // at the start of the step [N/m], [N m/m]
  std::vector<std::array<double, 3>> position_;  // there [m], [rad]
  std::vector<std::array<double, 3>> energy_;    // of prescribed degrees of freedom, there
  std::vector<std::array<double, 3>> damped_;    // taken from them in the step
  double external_work_ = 0, damper_work_ = 0;
};

/// Longest step that resolves the bodies' own oscillations and spin [s]; infinite without bodies.
double rigid_step(const Body& body, const State& state);

/// Equilibrium of every rigid body on its springs under `force` on its particles and gravity, moved there.
/// Returns the largest relative change; call again when forces depend on the position. Degrees of freedom
/// without a spring stay.
double settle_rigid(const Body& body, const Loading& loading, double time, const std::vector<double>& force,
                    State& state);

}  // namespace estuary::solid
