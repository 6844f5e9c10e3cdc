// Newton-Raphson for the equilibrium of the discrete energy, with its exact sparse tangent.
//
// The geometric part of the tangent uses the stress predicted by the previous linear step instead of the
// stress of the current displacement (mixed integration point iteration; Magisano, Leonetti & Garcea 2017).
// The residual is the true one, so the solution is the same; but a slender beam no longer needs tiny load
// steps, because the spurious axial stress of a rotating step does not enter the matrix. When that fails, the
// total potential is minimised with a line search, and when that fails too, the load is applied in steps.
#pragma once

#include <cstdint>
#include <vector>

#include "solver.hpp"
#include "sparse_solver.hpp"

namespace estuary::solid {

class NewtonSolver {
public:
  /// Builds the sparse pattern: a particle couples with the neighbours of its neighbours. `split_pressure` is
  /// for laws P = mu F + p(F) cof F, or nearly: p then counts as a stress that the last linear step predicts,
  /// as in a mixed method with pressures of their own; the volume's stiffness no longer spoils steps that
  /// change the shape.
  explicit NewtonSolver(Solver& solver, bool split_pressure = false);

  /// From the displacement given to equilibrium under the loading's end values and prescribed motion at
  /// `time`; pressures follow the surface of the displacement given and stay (call again until nothing
  /// changes). `steps` in the report counts linear solves; `maximum_steps` limits them.
  EquilibriumReport solve(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor);

private:
  struct Outcome {
    bool converged = false;
    double residual = 0;
    double change = 0;
  };
  Outcome iterate(std::vector<double>& displacement, const std::vector<double>& target, double scale,
                  double tolerance, const EquilibriumSettings& settings, EquilibriumReport& report,
                  const Monitor& monitor);
  Outcome minimise(std::vector<double>& displacement, const std::vector<double>& target, double scale,
                   double tolerance, const EquilibriumSettings& settings, EquilibriumReport& report,
                   const Monitor& monitor);
  void hold_components();
  bool follow_prescribed(std::vector<double>& displacement, const std::vector<double>& target,
                         const std::vector<double>& prescribed_step);
  // The stress in the two parts that steps predict: P = pressure cof F + F S.
  struct Parts {
    double pressure = 0;
    Tensor<double> s;
  };
  [[nodiscard]] Parts parts_at(std::size_t particle) const;
  void use_current_stress();
  /// What rounding alone leaves of the residual [N/m].
  [[nodiscard]] double round_off() const;
  double set_residual(const std::vector<double>& target);
  void assemble();
  void add_springs();
  bool factorise();
  void predict_stress(const std::vector<double>& change);
  /// Row of the system of component c of a free particle.
  [[nodiscard]] std::size_t row_of(std::size_t particle, std::size_t c) const {
    return 2 * static_cast<std::size_t>(unknown_[particle]) + c;
  }
  [[nodiscard]] std::int64_t block(std::size_t particle, std::size_t a, std::size_t b) const;

  Solver& solver_;
  std::vector<std::int64_t> unknown_;     // of each particle, -1 when fixed
  std::vector<std::size_t> first_block_;  // into block_ for each particle
  std::vector<std::int32_t> block_;       // value position of each pair (a, b) of a stencil, -1 when not free
  std::vector<std::int64_t> zeroed_;      // value positions in rows and columns of held single components
  std::vector<std::int64_t> diagonal_;    // their diagonal entries
  std::vector<std::int64_t> held_row_;    // and rows
  std::vector<double> predicted_stress_;  // S, xx xy yx yy per particle
  std::vector<double> predicted_pressure_;
  std::vector<double> shear_modulus_;  // at rest, of each particle; empty unless the pressure is split off
  std::vector<double> spring_values_;  // the constant part of the matrix
  std::vector<double> change_;         // of the last linear solve, all particles
  SparseMatrix matrix_;
  SparseSolver linear_;
  std::vector<double> right_hand_side_, solution_;
};

}  // namespace estuary::solid
