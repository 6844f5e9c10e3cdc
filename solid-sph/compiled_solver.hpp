// The time and equilibrium loops of one variant. Included only by the three files that instantiate it.
#pragma once

#include <algorithm>
#include <cstdio>

#include "solver.hpp"

namespace estuary::solid {

template <class Law, bool Stabilised, bool Viscous>
class CompiledSolver final : public Solver {
public:
  CompiledSolver(const Body& body, Neighbourhood pairs, const SolverOptions& options)
      : Solver(body, std::move(pairs)),
        law_{options.constants},
        viscosity_(options.viscosity),
        predicted_velocity_(Viscous ? 2 * body.size() : 0) {}

  std::int64_t evaluate(std::span<const double> displacement) override {
    const std::int64_t bad = compute_stress<Law, Stabilised>(body_, pairs_, law_, displacement, fields_);
    compute_force<Stabilised, false>(body_, pairs_, viscosity_, displacement, {}, fields_);
    return bad;
  }
  double energy(std::span<const double> displacement) const override {
    return internal_energy<Law, Stabilised>(body_, pairs_, law_, displacement, fields_);
  }
  std::array<double, 16> tangent_at(std::size_t i) const override {
    return tangent(law_, tensor_at(fields_.deformation_gradient, i));
  }
  Tensor<double> first_piola_kirchhoff_at(std::size_t i) const override {
    return law_.first_piola_kirchhoff(tensor_at(fields_.deformation_gradient, i));
  }
  double stress_across(std::size_t i) const override {
    return law_.stress_across(tensor_at(fields_.deformation_gradient, i));
  }
  bool symmetric_tangent() const override { return Law::hyperelastic; }

  void advance(State& state, const Loading& loading, double duration, std::uint64_t steps, double damping,
               const Monitor& monitor) override {
    const double dt = duration / static_cast<double>(steps);
    const Kick kick{.dt = dt,
                    .decay = 1 - 0.5 * damping * dt,
                    .gain = 1 / (1 + 0.5 * damping * dt),
                    .gravity = loading.gravity,
                    .held = loading.held};
    const double gravity_work_before = gravity_work(state, loading);
    const double start = state.time;

    sweep(state.displacement, state.velocity, 0);
    add_surface_loads(loading, 0.0, start);
    for (std::uint64_t step = 1; step <= steps; ++step) {
      const double fraction = static_cast<double>(step) / static_cast<double>(steps);
      const double time = start + fraction * duration;
      if (step == 1)
        update<false, true>(state, kick);
      else
        update<true, true>(state, kick);
      sweep(state.displacement, predicted_velocity_, step);
      state.external_work +=
          surface_work(loading, state, dt, fraction, 1.0 / static_cast<double>(steps), time);
      add_surface_loads(loading, fraction, time);
      if (step % 128 == 0) {
        char note[64];
        std::snprintf(note, sizeof note, "step %llu of %llu", static_cast<unsigned long long>(step),
                      static_cast<unsigned long long>(steps));
        monitor(fraction, note);
      }
    }
    update<true, false>(state, kick);
    state.time = start + duration;
    state.external_work += gravity_work(state, loading) - gravity_work_before;
  }

  EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor) override;

private:
  struct Kick {
    double dt, decay, gain;
    std::array<double, 2> gravity;
    std::array<bool, 2> held;
  };

  // Both sweeps for a state on the way.
  void sweep(std::span<const double> displacement, std::span<const double> velocity, std::uint64_t step) {
    if (compute_stress<Law, Stabilised>(body_, pairs_, law_, displacement, fields_) > 0)
      report_breakdown(step);
    compute_force<Stabilised, Viscous>(body_, pairs_, viscosity_, displacement, velocity, fields_);
  }

  // Ends one step (second half kick) and begins the next (first half kick and drift) in one pass over memory.
  template <bool Ends, bool Begins>
  void update(State& state, const Kick& kick) {
    double* u = state.displacement.data();
    double* v = state.velocity.data();
    const double* force = fields_.force.data();
    const double half = 0.5 * kick.dt;
    const std::size_t n = body_.size();
#pragma omp parallel for schedule(static) if (n > kSerialBelow)
    for (std::size_t i = 0; i < n; ++i) {
      if (body_.fixed[i]) continue;
      const double inverse_mass = 1 / body_.mass[i];
      for (std::size_t c = 0; c < 2; ++c) {
        if (kick.held[c]) continue;
        const double a = force[2 * i + c] * inverse_mass + kick.gravity[c];
        double velocity = v[2 * i + c];
        if constexpr (Ends) velocity = kick.gain * (velocity + half * a);
        if constexpr (Begins) {
          velocity = kick.decay * velocity + half * a;
          u[2 * i + c] += kick.dt * velocity;
          // The viscous force wants the velocity at the step's end; half a step's extrapolation keeps second
          // order.
          if constexpr (Viscous) predicted_velocity_[2 * i + c] = velocity + half * a;
        }
        v[2 * i + c] = velocity;
      }
    }
  }

  void add_surface_loads(const Loading& loading, double fraction, double time) {
    for (const ParticleLoad& load : loading.loads) {
      const double factor = load.factor ? load.factor(time) : 1.0;
      for (std::size_t k = 0; k < load.particle.size(); ++k)
        for (std::size_t c = 0; c < 2; ++c)
          fields_.force[2 * load.particle[k] + c] +=
              factor * (load.start[2 * k + c] + fraction * (load.end[2 * k + c] - load.start[2 * k + c]));
    }
  }

  // Trapezoidal work of the surface loads over the step just drifted.
  double surface_work(const Loading& loading, const State& state, double dt, double fraction, double share,
                      double time) const {
    double work = 0;
    for (const ParticleLoad& load : loading.loads) {
      const double now = load.factor ? load.factor(time) : 1.0;
      const double before = load.factor ? load.factor(time - dt) : 1.0;
      for (std::size_t k = 0; k < load.particle.size(); ++k)
        for (std::size_t c = 0; c < 2; ++c) {
          const double change = load.end[2 * k + c] - load.start[2 * k + c], first = load.start[2 * k + c];
          const double mean =
              0.5 * (now * (first + fraction * change) + before * (first + (fraction - share) * change));
          work += mean * dt * state.velocity[2 * load.particle[k] + c];
        }
    }
    return work;
  }

  double gravity_work(const State& state, const Loading& loading) const {
    if (loading.gravity[0] == 0 && loading.gravity[1] == 0) return 0;
    return ordered_sum(body_.size(), [&](std::size_t i) {
      return body_.mass[i] * (loading.gravity[0] * state.displacement[2 * i] +
                              loading.gravity[1] * state.displacement[2 * i + 1]);
    });
  }

  Law law_;
  ArtificialViscosity viscosity_;
  std::vector<double> predicted_velocity_;
};

template <class Law>
std::unique_ptr<Solver> make_solver(const Body& body, const SolverOptions& options) {
  const bool stabilised = options.stabilisation_modulus > 0;
  const bool viscous = options.viscosity.linear > 0 || options.viscosity.quadratic > 0;
  Neighbourhood pairs = build_neighbourhood(
      body, {.order = options.order, .spring_modulus = options.stabilisation_modulus, .viscous = viscous});
  if (stabilised && viscous)
    return std::make_unique<CompiledSolver<Law, true, true>>(body, std::move(pairs), options);
  if (stabilised) return std::make_unique<CompiledSolver<Law, true, false>>(body, std::move(pairs), options);
  if (viscous) return std::make_unique<CompiledSolver<Law, false, true>>(body, std::move(pairs), options);
  return std::make_unique<CompiledSolver<Law, false, false>>(body, std::move(pairs), options);
}

}  // namespace estuary::solid

#include "relaxation.hpp"
