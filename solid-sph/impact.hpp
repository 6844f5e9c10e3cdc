// Bodies of different kinds in one motion: fluids, solids, shells and rigid bodies that meet by impulses.
//
// Central differences with velocities half-way between the steps, as contact by multipliers wants them
// (Maurel 2008, ch. 3): positions are drifted by them, forces are found there, and the kick that follows ends
// with velocities that keep the bodies apart. A window begins and ends with half a kick, so that between
// windows positions and velocities belong to one time.
#pragma once

#include <memory>
#include <optional>

#include "fluid.hpp"
#include "impulses.hpp"
#include "pinball.hpp"
#include "shell_row.hpp"
#include "solver.hpp"

namespace estuary::solid {

struct ImpactOptions {
  static constexpr std::uint32_t kNoSurface = 0xffffffffU;
  FluidSettings fluid;
  std::vector<std::uint8_t> is_fluid;  // of each body
  std::vector<ShellSection> sections;  // of each body; without thickness: no shell. Empty: there is none
  PinballSettings contact;
  double friction = 0;
  std::array<bool, 2> held{};                // components of the displacement that stay zero
  std::uint32_t surface_first = kNoSurface;  // particle where a driven surface begins, if any
  /// Makes the solver of the solid bodies: all particles that are neither fluid nor rigid.
  std::function<std::unique_ptr<Solver>(const Body&)> make_solid;
};

/// History: that of the shells, that of the solid particles, then, with fluid particles, the density of each
/// [kg/m3], the forces that its last step ended with and, in one number, whether there are any: a window goes
/// on with them, so that its first half-kick costs no evaluation, and a state that is taken up again has
/// them.
class ImpactSolver final : public Solver {
public:
  ImpactSolver(const Body& body, ImpactOptions options);

  std::int64_t evaluate(std::span<const double> displacement) override;
  void commit(std::span<const double>) override {}
  double energy(std::span<const double> displacement) const override;
  double plastic_work() const override;
  double fracture_work() const override;
  double kinetic_energy(const State& state) const override;
  double spin(const State& state) const override;
  std::vector<std::uint32_t> isolated() const override;
  bool cut_hanging(std::span<const double> displacement, std::vector<double>& history) override;
  const ShellRow* shells() const override { return rows_ ? &*rows_ : nullptr; }
  double held_moment() const override { return rows_ ? rows_->held_moment() : 0; }
  std::array<double, 16> tangent_at(std::size_t particle) const override;
  Tensor<double> first_piola_kirchhoff_at(std::size_t particle) const override;
  double stress_across(std::size_t particle) const override;
  double stretch_across(std::size_t particle) const override;
  bool symmetric_tangent() const override { return true; }
  void begin_window() override;
  [[nodiscard]] std::span<const double> surface_impulse() const override { return surface_impulse_; }
  void advance(State& state, const Loading& loading, double duration, std::uint64_t steps, double damping,
               const Monitor& monitor) override;
  EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor) override;
  double longest_step(const State& state, double courant) override;
  NamedValues quantities_of(std::size_t particle, const State& state) const override;
  NamedValues totals(const State& state) const override;
  NamedValues quantities_of_body(std::size_t member, const State& state) const override;
  NamedValues phase_seconds() const override;

private:
  static constexpr std::uint32_t kNone = 0xffffffffU;

  static void copy_out(const std::vector<std::uint32_t>& particles, std::span<const double> from,
                       std::vector<double>& to);
  void place(std::span<const double> displacement);
  /// Forces of the state reached by a step of `time_step` (0: of the state as it is) at the velocities given.
  /// Returns whether links of shells broke.
  bool find_forces(State& state, double time_step, std::uint64_t step);
  /// Particles that have been removed stay where they are and meet nothing.
  void leave_out(const std::vector<std::uint8_t>& removed);
  /// Takes what is torn by now out of the surfaces that others meet.
  void open_torn();
  bool bend_shells(const State& state, bool commit, std::uint64_t step);
  void copy_fields();
  void kick(State& state, const Loading& loading, const ExternalForces& external, double duration,
            double time_step, double damping);
  void kick_rigid(State& state, const Loading& loading, double duration);
  void touch(State& state, double time_step);
  /// Of all degrees of freedom: of particles, rigid bodies and, with friction, fibres of shells.
  void collect_velocities(const State& state, std::vector<double>& velocity) const;
  /// What the moments will add to the rate of a fibre in the half-kick to come.
  [[nodiscard]] double coming_rate(std::size_t local, double time_step);
  void drive(State& state, const Loading& loading, double time, double time_step);
  void drift(State& state, const Loading& loading, double time, double time_step);
  void spread_history(const std::vector<double>& history);
  [[nodiscard]] std::vector<double> gathered_history() const;
  void say_degrees();
  /// Where the fibres of shells begin among the degrees of freedom.
  [[nodiscard]] std::size_t fibres_first() const { return 2 * body_.size() + 3 * body_.rigid.size(); }
  /// How much of the history belongs to the fluid.
  [[nodiscard]] std::size_t fluid_history() const { return density_.empty() ? 0 : 6 * density_.size() + 1; }

  double friction_;
  std::vector<std::uint32_t> fluid_particle_, solid_particle_;  // of the whole body
  std::vector<std::uint32_t> local_;                            // of every particle among its kind
  std::vector<std::uint8_t> is_fluid_;                          // of every particle
  std::vector<std::uint8_t> is_shell_;                          // likewise
  Fluid fluid_;
  Pinball pinball_;
  std::vector<std::array<std::uint32_t, 2>> torn_surface_;  // pieces of the driven one
  std::uint64_t tears_ = 0;                                 // of the solids, seen
  std::optional<ShellRow> rows_;
  std::vector<double> row_history_;
  std::vector<double> inverse_mass_;  // of every degree of freedom
  std::vector<std::uint8_t> removed_;
  ImpulseSolver impulses_;
  std::array<bool, 2> held_{};
  std::unique_ptr<Body> solid_body_;
  std::unique_ptr<Solver> solid_;
  std::vector<double> position_, velocity_, before_;  // before: at the kick's start
  std::vector<double> fluid_position_, fluid_velocity_, density_;
  std::vector<double> solid_displacement_, solid_velocity_;
  std::vector<double> external_;     // loads on particles [N/m]
  std::vector<double> impulse_;      // of contact on each body in this window, 2 each [N s/m]
  std::uint32_t surface_first_ = 0;  // first particle of the driven surface
  std::vector<double> surface_impulse_;
  double window_begin_ = 0;
  bool window_begins_ = false;
  std::vector<double> contact_force_;  // its mean over the window [N/m]
  double solid_viscous_power_ = 0;     // [W/m]
  bool touching_ = false;
  std::array<double, 2> said_degrees_{};  // most particles at degree 0 and 1 so far
  bool forces_kept_ = false;  // the fluid's forces are those the last step of this state ended with
  double contact_seconds_ = 0, fluid_seconds_ = 0, solid_seconds_ = 0;
};

}  // namespace estuary::solid
