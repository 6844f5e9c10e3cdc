// A shell in the plane: one row of particles on its mid-line, each with a displacement and the rotation of
// its fibre across the thickness (Mindlin-Reissner). A section of a cylindrical shell in plane strain, or a
// beam of unit width in plane stress; total Lagrangian, stresses at points between the particles.
//
// With the mid-line x(s), its reference X(s), the fibre n(theta) and its reference n_0,
//     membrane   E = 1/2 (x'.x' - X'.X'),         N = E' h E
//     shear      gamma = x'.n - X'.n_0,           T = k G h gamma
//     bending    kappa = x'.n' - X'.n_0',         M = E' h^3 / 12 kappa
// (Maurel 2008, ch. 2, with the non-linear terms; E' = E / (1 - nu^2) in plane strain), and from the energy
// 1/2 (N E + T gamma + M kappa) per length
//     rho h x'' = (N x' + T n + M n')' + load,  rho h^3/12 theta'' = -d(energy)/d(theta) + moment.
// Stress points lie half-way between particles, where differences of neighbours are exact to second order;
// one of them per link neither locks in shear however thin the shell is, nor leaves an alternating mode.
// Momentum and angular momentum are conserved to round-off.
#pragma once

#include "solver.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {

struct ShellSection {
  double thickness = 0;                         // [m]
  double young_modulus = 0, shear_modulus = 0;  // E' and G [Pa]
  double shear_correction = 5.0 / 6.0;          // k
  double density = 0;                           // [kg/m3]
};

/// A row of particles along a polyline, each straight piece divided evenly; the last piece closes it when
/// `closed`. Its outline has the left of the walk outside. Throws std::invalid_argument when a piece is
/// shorter than a thousandth of the spacing.
Body fill_row(std::span<const std::array<double, 2>> points, bool closed, double spacing,
              const ShellSection& section);

/// The point of the row nearest to a place: linear between its two particles.
Transfer row_transfer(const Body& body, const std::array<double, 2>& place);

/// Bit of Body::fixed: the rotation of a particle of a shell does not move.
inline constexpr std::uint8_t kRotationFixed = 8;

/// History: rotation [rad] and its rate [1/s] of each particle.
class ShellSolver final : public Solver {
public:
  /// One section for each member of the body.
  ShellSolver(const Body& body, std::vector<ShellSection> sections);

  std::int64_t evaluate(std::span<const double> displacement) override;
  void commit(std::span<const double>) override {}
  double energy(std::span<const double> displacement) const override;
  double plastic_work() const override { return 0; }
  /// Diagonal; the stretch stiffens it.
  std::array<double, 16> tangent_at(std::size_t particle) const override;
  /// Of the mid-line: (N x' + T n) / h across it.
  Tensor<double> first_piola_kirchhoff_at(std::size_t particle) const override;
  double stress_across(std::size_t) const override { return 0; }
  double stretch_across(std::size_t) const override { return 1; }
  bool symmetric_tangent() const override { return true; }
  void advance(State& state, const Loading& loading, double duration, std::uint64_t steps, double damping,
               const Monitor& monitor) override;
  /// Dynamic relaxation with masses of its own, of the size of the stiffness: the number of steps grows with
  /// the number of particles and with length over thickness only (Underwood 1983).
  EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor) override;
  /// By the largest frequency of a single link, an upper bound of the body's.
  double reference_stable_step() override;
  double kinetic_energy(const State& state) const override;
  double spin(const State& state) const override;
  double held_moment() const override;
  /// Bending moment at a particle, the mean of its links' [N m/m].
  [[nodiscard]] double bending_moment(std::size_t particle) const;

private:
  static constexpr std::uint32_t kNone = 0xffffffffU;
  // Between particles `a` and `b`.
  struct Link {
    std::uint32_t a, b;
    double length;
    std::array<double, 2> tangent;      // reference
    double shear_rest, curvature_rest;  // X'.n_0, X'.n_0'
    double membrane, shear, bending;    // E' h, k G h, E' h^3 / 12
  };
  struct LinkState {
    std::array<double, 2> force, shear, bending;  // N x' + T n + M n', T x', M x'
    double normal_force, shear_force, moment, stretch, energy;
  };
  void add_loads(const Loading& loading, const ExternalForces& external, double time);

  std::vector<ShellSection> sections_;
  std::vector<Link> links_;
  std::vector<LinkState> at_;
  std::vector<std::uint32_t> before_, after_;  // links that end and begin at a particle
  std::vector<double> fibre_angle_;            // of the reference fibres [rad]
  std::vector<double> inertia_;                // rotary [kg m2/m]
  std::vector<std::array<double, 2>> rest_fibre_, fibre_;
  std::vector<double> moment_;  // on every particle [N m/m]
};

}  // namespace estuary::solid
