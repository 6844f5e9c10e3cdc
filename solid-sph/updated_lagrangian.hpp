// Classical SPH of solids in the current configuration, for comparison: it shows the tensile instability that
// the total Lagrangian form does not have.
//
// Kernel, neighbours and gradients follow the particles (Libersky & Petschek 1991; Gray, Monaghan & Swift
// 2001):
//     L_i = [sum_j m_j/rho_j (v_j - v_i) (x) grad W_ij] K_i^-1  (Randles & Libersky 1996),  rho' = -rho tr L,
//     Jaumann rate of Cauchy stress = lambda tr(D) I + 2 mu D,
//     a_i = sum_j m_j (sigma_i/rho_i^2 + sigma_j/rho_j^2 - Pi_ij I + f_ij^4 (R_i + R_j)) grad W_ij.
// Two of the remedies tried in the literature: Gray, Monaghan & Swift's artificial stress, R = -eta
// sigma/rho^2 of principal stresses in tension, f_ij = W_ij over W at the particles' spacing; and Swegle's
// conservative smoothing of velocities, by pairs (VelocitySmoothing), so that momentum is kept to round-off.
#pragma once

#include <memory>
#include <stdexcept>

#include "solver.hpp"

namespace estuary::solid {

/// An unstable run has thrown a particle out, while all numbers are still finite.
struct ThrownOut : std::runtime_error {
  ThrownOut(std::size_t which, std::uint64_t at_step, double moved)
      : std::runtime_error("thrown out"), particle(which), step(at_step), displacement(moved) {}
  std::size_t particle;
  std::uint64_t step;
  double displacement;  // its length [m]
};

/// History: Cauchy stress xx xy yy zz [Pa] and density [kg/m3] of each particle. Transient only.
class UpdatedLagrangianSolver final : public Solver {
public:
  static constexpr std::size_t kHistorySize = 5;

  UpdatedLagrangianSolver(const Body& body, const SolverOptions& options);

  std::int64_t evaluate(std::span<const double> displacement) override;
  void commit(std::span<const double>) override {}
  double energy(std::span<const double> displacement) const override;
  double plastic_work() const override { return 0; }
  std::array<double, 16> tangent_at(std::size_t particle) const override;
  Tensor<double> first_piola_kirchhoff_at(std::size_t particle) const override;
  double stress_across(std::size_t particle) const override { return history_[kHistorySize * particle + 3]; }
  double stretch_across(std::size_t) const override { return 1; }
  bool symmetric_tangent() const override { return false; }
  void advance(State& state, const Loading& loading, double duration, std::uint64_t steps, double damping,
               const Monitor& monitor) override;
  /// Throws std::logic_error: this form only moves.
  EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor) override;

private:
  void find_neighbours(const State& state);
  void strain(const State& state, double dt);
  void accelerate(const State& state);
  // What it takes from the kinetic energy [J/m].
  double smooth(State& state);

  std::vector<Material> materials_;
  Kernel kernel_;
  double artificial_stress_, smoothing_;
  double too_far_ = 0;             // a particle that has moved so far was thrown out by an unstable run [m]
  std::vector<double> repulsion_;  // R of each particle, xx xy yy [Pa m6/kg2]
  std::vector<double> smoothed_, weight_sum_;
  std::unique_ptr<Solver>
      reference_;  // the same body in total Lagrangian form: stable step, deformation gradient
  std::vector<double> position_;
  std::vector<std::uint32_t> first_, neighbour_, cell_first_, cell_particle_;
};

}  // namespace estuary::solid
