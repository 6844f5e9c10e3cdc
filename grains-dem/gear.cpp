// Gear's predictor-corrector of 3 to 6 terms, with any number of corrections (Gear 1971; Allen & Tildesley
// 1987, appendix E).
#include "dynamics.hpp"

namespace estuary::grains {

template <int D>
void Dynamics<D>::advance_gear(double dt, std::uint64_t steps, const StepMonitor& monitor) {
  // Coefficients for forces that depend on velocities; scaled by A_k so that all correct the acceleration.
  static constexpr std::array<std::array<double, 6>, 4> kCorrector{
      {{0, 1, 1, 0, 0, 0},
       {1.0 / 6, 5.0 / 6, 1, 1.0 / 3, 0, 0},
       {19.0 / 90, 3.0 / 4, 1, 1.0 / 2, 1.0 / 12, 0},
       {3.0 / 16, 251.0 / 360, 1, 11.0 / 18, 1.0 / 6, 1.0 / 60}}};
  const auto terms = static_cast<std::size_t>(settings_.gear_terms);
  const std::array<double, 6>& corrector = kCorrector[terms - 3];
  const std::array<double, 6> scale{0.5 * dt * dt, 0.5 * dt, 1, 3 / dt, 12 / (dt * dt), 60 / (dt * dt * dt)};
  const std::size_t n = state_.size();
  constexpr std::size_t d = D, s = spin_components<D>;
  const auto gather_all = [&] {
    for (std::size_t b = 0; b < block_count(n); ++b) gather(b);
  };
  if (gear_position_.empty()) {
    gear_position_.assign(terms - 2, std::vector<double>(d * n, 0.0));
    gear_angle_.assign(terms - 2, std::vector<double>(s * n, 0.0));
    for (std::size_t k = 0; k < d * n; ++k)
      gear_position_[0][k] = state_.force[k] * state_.inverse_mass[k / d];
    for (std::size_t k = 0; k < s * n; ++k)
      gear_angle_[0][k] = state_.torque[k] * state_.inverse_inertia[k / s];
  }
  // Taylor expansion of one coordinate (null for the angle, which no force depends on).
  const auto predict = [&](double* x, double& v, std::vector<std::vector<double>>& higher, std::size_t k) {
    std::array<double, 6> value{x ? *x : 0, v, 0, 0, 0, 0};
    for (std::size_t h = 2; h < terms; ++h) value[h] = higher[h - 2][k];
    for (std::size_t q = 0; q < terms; ++q) {
      double sum = 0, factor = 1;
      for (std::size_t h = q; h < terms; ++h) {
        sum += factor * value[h];
        factor *= dt / static_cast<double>(h - q + 1);
      }
      value[q] = sum;
    }
    if (x) *x = value[0];
    v = value[1];
    for (std::size_t h = 2; h < terms; ++h) higher[h - 2][k] = value[h];
  };
  const auto correct = [&](double* x, double& v, std::vector<std::vector<double>>& higher, std::size_t k,
                           double acceleration) {
    const double error = acceleration - higher[0][k];
    if (x) *x += corrector[0] * scale[0] * error;
    v += corrector[1] * scale[1] * error;
    for (std::size_t h = 2; h < terms; ++h) higher[h - 2][k] += corrector[h] * scale[h] * error;
  };
  for (std::uint64_t step = 0; step < steps; ++step) {
    const std::vector<double> before = state_.position;
    double worst = 0;
    for (std::size_t k = 0; k < d * n; ++k)
      predict(&state_.position[k], state_.velocity[k], gear_position_, k);
    for (std::size_t k = 0; k < s * n; ++k) predict(nullptr, state_.spin[k], gear_angle_, k);
    for (std::size_t i = 0; i < n; ++i) {
      double squared = 0, work = 0;
      for (std::size_t c = 0; c < d; ++c) {
        const double way = state_.position[d * i + c] - state_.reference_position[d * i + c];
        squared += way * way;
        work += state_.external_force[d * i + c] * (state_.position[d * i + c] - before[d * i + c]);
      }
      state_.external_work += work;
      if (!(squared <= worst)) worst = squared;
    }
    state_.time += dt;
    if (!walls_.empty()) move_walls(dt);
    rebuild_if_due(worst);
    const std::vector<double> history = state_.history, wall_history = state_.wall_history;
    const Bonds<D> bonds = bonds_;
    const EnergyLedger ledger = state_.ledger;
    const double bond_loss = state_.bond_loss;
    for (int correction = 0; correction < settings_.gear_corrections; ++correction) {
      if (correction > 0) {
        // Every evaluation moves the contacts' memory on from the step's start.
        state_.history = history;
        state_.wall_history = wall_history;
        bonds_ = bonds;
        state_.ledger = ledger;
        state_.bond_loss = bond_loss;
      }
      evaluate(dt);
      gather_all();
      for (std::size_t k = 0; k < d * n; ++k)
        correct(&state_.position[k], state_.velocity[k], gear_position_, k,
                state_.force[k] * state_.inverse_mass[k / d]);
      for (std::size_t k = 0; k < s * n; ++k)
        correct(nullptr, state_.spin[k], gear_angle_, k, state_.torque[k] * state_.inverse_inertia[k / s]);
    }
    if constexpr (D == 2) add_node_forces(walls_, state_, wall_force_, dt, node_force_);
    if (monitor) monitor(step + 1);
  }
}

template void Dynamics<2>::advance_gear(double, std::uint64_t, const StepMonitor&);
template void Dynamics<3>::advance_gear(double, std::uint64_t, const StepMonitor&);

}  // namespace estuary::grains
