#include "solver.hpp"

#include "rigid_motion.hpp"

#include <cmath>
#include <limits>
#include <utility>

namespace estuary::solid {

double Solver::reference_stable_step() {
  if (stable_step_ > 0) return stable_step_;
  // Of the body at rest, whenever it is asked for: a resumed run must take the same steps.
  const std::vector<double> kept = std::exchange(history_, rest_history_);
  const std::size_t n = body_.size();
  std::vector<double> mode(2 * n), zero(2 * n, 0.0);
  // A start without symmetry, so that it has a part in every mode.
  std::uint64_t random = 0x9e3779b97f4a7c15ULL;
  for (std::size_t c = 0; c < 2 * n; ++c) {
    random = random * 6364136223846793005ULL + 1442695040888963407ULL;
    mode[c] = body_.holds(c / 2, c % 2)
                  ? 0.0
                  : static_cast<double>(random >> 40) / static_cast<double>(1 << 24) - 0.5;
  }
  const double amplitude = 1e-7 * body_.mean_spacing();
  double squared_frequency = 0;
  for (int iteration = 0; iteration < 60; ++iteration) {
    double norm = 0;
    for (const double m : mode) norm = std::max(norm, std::abs(m));
    if (!(norm > 0)) break;
    for (double& m : mode) m *= amplitude / norm;
    evaluate(mode);
    double stiffness = 0, mass = 0;
    for (std::size_t c = 0; c < 2 * n; ++c) {
      if (body_.holds(c / 2, c % 2)) {
        mode[c] = 0;
        continue;
      }
      stiffness -= mode[c] * fields_.force[c];
      mass += mode[c] * mode[c] * body_.mass[c / 2];
      mode[c] = -fields_.force[c] / body_.mass[c / 2];
    }
    squared_frequency = std::max(squared_frequency, stiffness / mass);
  }
  evaluate(zero);
  rest_stiffness_ = 0;
  rest_stiffness_ = stiffening();
  history_ = kept;
  // Power iteration approaches the largest frequency from below.
  stable_step_ = squared_frequency > 0 ? 2 / std::sqrt(1.05 * squared_frequency)
                                       : std::numeric_limits<double>::infinity();
  return stable_step_;
}

double Solver::stiffening() const {
  const auto largest_eigenvalue = [](const std::array<double, 16>& a) {
    std::array<double, 4> v{1, 0.3, -0.2, 0.9};
    double value = 0;
    for (int iteration = 0; iteration < 12; ++iteration) {
      std::array<double, 4> w{};
      double norm = 0;
      for (std::size_t r = 0; r < 4; ++r) {
        for (std::size_t c = 0; c < 4; ++c) w[r] += a[4 * r + c] * v[c];
        norm += w[r] * w[r];
      }
      value = std::sqrt(norm);
      if (!(value > 0)) return 0.0;
      for (std::size_t r = 0; r < 4; ++r) v[r] = w[r] / value;
    }
    return value;
  };
  const std::size_t n = body_.size();
  double largest = 0;
  // The maximum does not depend on the order, so this reduction is deterministic.
#pragma omp parallel for schedule(static) reduction(max : largest)
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, largest_eigenvalue(tangent_at(i)));
  return rest_stiffness_ > 0 ? largest / rest_stiffness_ : largest;
}

double Solver::kinetic_energy(const State& state) const {
  double energy = ordered_sum(body_.size(), [&](std::size_t i) {
    const double vx = state.velocity[2 * i], vy = state.velocity[2 * i + 1];
    return 0.5 * body_.mass[i] * (vx * vx + vy * vy);
  });
  for (std::size_t r = 0; r < body_.rigid.size(); ++r)
    energy += estuary::solid::kinetic_energy(body_.rigid[r],
                                             std::span<const double>(state.rigid).subspan(6 * r, 6));
  return energy;
}

void Solver::external_force(const Loading& loading, double time, std::span<const double> displacement,
                            std::vector<double>& force) const {
  force.resize(2 * body_.size());
  for (std::size_t i = 0; i < body_.size(); ++i)
    for (std::size_t c = 0; c < 2; ++c) force[2 * i + c] = body_.mass[i] * loading.gravity[c];
  ExternalForces external(body_, loading);
  external.set(1.0, time, displacement);
  external.add_to(force);
}

void Solver::report_breakdown(std::uint64_t step) const {
  for (std::size_t i = 0; i < body_.size(); ++i) {
    const double j = determinant(tensor_at(fields_.deformation_gradient, i));
    double sum = j;
    for (std::size_t c = 0; c < 4; ++c) sum += fields_.stress[4 * i + c];
    if (!(j > 0) || !std::isfinite(sum)) throw Breakdown(i, step, j);
  }
  throw Breakdown(0, step, 0);
}

std::unique_ptr<Solver> make_solver(LawName law, const Body& body, const SolverOptions& options) {
  switch (law) {
    case LawName::hooke_almansi:
      return make_solver<HookeAlmansi>(body, options);
    case LawName::neo_hooke:
      return make_solver<NeoHooke>(body, options);
    case LawName::neo_hooke_isochoric:
      return make_solver<NeoHookeIsochoric>(body, options);
    case LawName::j2_plasticity:
      return make_solver<J2Plasticity>(body, options);
    case LawName::saint_venant_kirchhoff:
      break;
  }
  return make_solver<SaintVenantKirchhoff>(body, options);
}

}  // namespace estuary::solid
