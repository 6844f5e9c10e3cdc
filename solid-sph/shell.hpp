// A shell in the plane: one row of particles on its mid-line, each with a displacement and the rotation of
// its fibre across the thickness (Mindlin-Reissner). A section of a cylindrical shell in plane strain, or a
// beam of unit width in plane stress; total Lagrangian, stresses at points between the particles.
//
// With the mid-line x(s) and the rotation theta(s), which turns the reference's tangent and normal into t
// and n,
//     membrane   E = 1/2 ((x'.t)^2 - 1),          N = E' h E  along t, times x'.t
//     shear      gamma = x'.n,                    T = k G h gamma  along n
//     bending    kappa = -theta',                 M = E' h^3 / 12 kappa
// (Reissner 1972; Simo 1985; E' = E / (1 - nu^2) in plane strain), and from the energy
// 1/2 (N E + T gamma + M kappa) per length
//     rho h x'' = (N (x'.t) t + T n)' + load,  rho h^3/12 theta'' = -d(energy)/d(theta) + moment.
// To first order in the strains this is Maurel's (2008, ch. 2), whose 1/2 (x'.x' - 1), x'.n and x'.n' take
// the fibres themselves. A link then bears its moment times the cosine of half the angle between its ends:
// a hinge, which gathers in one link, gives way as it turns, the sooner the shorter the links are.
// Stress points lie half-way between particles, where differences of neighbours are exact to second order;
// one of them per link neither locks in shear however thin the shell is, nor leaves an alternating mode.
// Momentum and angular momentum are conserved to round-off. Plasticity and rupture: shell_section.hpp.
#pragma once

#include "shell_row.hpp"
#include "solver.hpp"

namespace estuary::solid {

/// Of scenes with nothing but shells. History: that of the row.
class ShellSolver final : public Solver {
public:
  /// One section for each member of the body.
  ShellSolver(const Body& body, std::vector<ShellSection> sections);

  std::int64_t evaluate(std::span<const double> displacement) override;
  void commit(std::span<const double> displacement) override;
  double energy(std::span<const double>) const override { return row_.energy(); }
  double plastic_work() const override { return row_.plastic_work(history_); }
  double fracture_work() const override { return row_.fracture_work(history_); }
  /// That of rest: how links stiffen is in longest_step.
  std::array<double, 16> tangent_at(std::size_t) const override {
    return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  }
  Tensor<double> first_piola_kirchhoff_at(std::size_t particle) const override {
    return row_.first_piola_kirchhoff_at(particle);
  }
  double stress_across(std::size_t) const override { return 0; }
  double stretch_across(std::size_t) const override { return 1; }
  bool symmetric_tangent() const override { return true; }
  void advance(State& state, const Loading& loading, double duration, std::uint64_t steps, double damping,
               const Monitor& monitor) override;
  /// Dynamic relaxation with masses of its own, of the size of the stiffness: the number of steps grows with
  /// the number of particles and with length over thickness only (Underwood 1983).
  EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor) override;
  double reference_stable_step() override;
  double longest_step(const State& state, double courant) override;
  double kinetic_energy(const State& state) const override;
  double spin(const State& state) const override { return row_.spin(state.history); }
  const ShellRow* shells() const override { return &row_; }
  std::vector<std::uint32_t> isolated() const override { return row_.isolated(history_); }
  double held_moment() const override { return row_.held_moment(); }
  NamedValues totals(const State& state) const override;
  NamedValues quantities_of(std::size_t particle, const State& state) const override;

private:
  std::int64_t sweep(std::span<const double> displacement, bool commit,
                     std::span<const double> velocity = {});
  /// Gravity, forces and moments at `time` on top of the internal ones.
  void add_loads(const Loading& loading, const ExternalForces& external, double time, double fraction);

  /// Throws Breakdown for the first particle whose forces are not finite.
  void refuse_what_is_not_finite(std::uint64_t step);

  ShellRow row_;
};

}  // namespace estuary::solid
