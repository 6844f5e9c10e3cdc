// The time and equilibrium loops of one variant. Included only by the files that instantiate it.
#pragma once

#include <algorithm>
#include <cstdio>
#include <optional>

#include "guide.hpp"
#include "hourglass_viscosity.hpp"
#include "on_team.hpp"
#include "rigid_motion.hpp"
#include "rupture.hpp"
#include "solver.hpp"
#include "velocity_smoothing.hpp"

namespace estuary::solid {

template <class Law>
Law make_law(const Material& material) {
  if constexpr (Law::history_size > 0) {
    Law law;
    law.mu = material.constants.mu;
    law.bulk = material.constants.solid_lambda() + 2 * law.mu / 3;
    law.plane = material.plane;
    law.plasticity = &material.plasticity;
    return law;
  } else {
    return Law{material.constants};
  }
}

template <class Law, bool Stabilised, bool Viscous>
class CompiledSolver final : public Solver {
public:
  static constexpr bool kHistory = Law::history_size > 0;

  CompiledSolver(const Body& body, Neighbourhood pairs, const SolverOptions& options)
      : Solver(body, std::move(pairs)),
        materials_(options.materials),
        predicted_velocity_(Viscous ? 2 * body.size() : 0) {
    const std::size_t members = body.member.empty() ? 1 : std::size_t{body.member.back()} + 1;
    while (materials_.size() < members) materials_.push_back(materials_.front());
    for (const Material& material : materials_) {
      laws_.push_back(make_law<Law>(material));
      viscosities_.push_back(material.viscosity);
    }
    if (options.conservative_smoothing > 0)
      smoothing_.emplace(body_, pairs_, options.kernel, options.conservative_smoothing);
    if (kHistory && Stabilised && !options.hourglass_time.empty())
      hourglass_.emplace(body_, pairs_, options.hourglass_time);
    if constexpr (Viscous) fields_.viscous_power.assign(body.size(), 0.0);
    if constexpr (kHistory) {
      if constexpr (Stabilised) fields_.spring_share.assign(body.size(), 1.0);
      for (std::size_t i = 0; i < body.size(); ++i)
        history_.insert(history_.end(), Law::kRest.begin(), Law::kRest.end());
      rest_history_ = history_;
    }
    if (options.rupture.empty()) return;
    std::vector<double> moduli;
    for (const Material& material : materials_) moduli.push_back(material.constants.bar_modulus());
    rupture_.emplace(body_, pairs_, options.rupture, std::move(moduli), options.cracks, options.kernel);
    const std::vector<double> rest = rupture_->rest_history();
    history_.insert(history_.end(), rest.begin(), rest.end());
    rest_history_ = history_;
    restore();
  }

  std::int64_t evaluate(std::span<const double> displacement) override {
    restore();
    const std::int64_t bad = stresses<false>(displacement);
    forces<false>(displacement, {});
    return bad;
  }
  void commit(std::span<const double> displacement) override {
    if constexpr (kHistory) stresses<true>(displacement);
  }
  double energy(std::span<const double> displacement) const override {
    return internal_energy<Law, Stabilised>(own_body(), pairs_, laws_, displacement, fields_,
                                            history_.data());
  }
  double plastic_work() const override {
    if constexpr (kHistory)
      return ordered_sum(body_.size(), [&](std::size_t i) {
        return own_body().energy_volume[i] * history_[Law::history_size * i + Law::history_size - 1];
      });
    return 0;
  }
  double fracture_work() const override { return rupture_ ? rupture_->energy_set_free(torn()) : 0; }
  TornContours torn_contours() const override {
    return rupture_ ? rupture_->torn_contours(torn()) : TornContours{};
  }
  std::uint64_t tears() const override { return tears_; }
  std::vector<std::uint32_t> isolated() const override {
    return rupture_ ? rupture_->isolated(torn()) : std::vector<std::uint32_t>{};
  }
  bool cut_hanging(std::span<const double> displacement, std::vector<double>& history) override {
    if (!rupture_) return false;
    history_ = history;
    restore();
    bool cut = false;
    while (rupture_->find_hanging(torn())) {
      if (!cut) stresses<false>(displacement);
      cut = true;
      const double before = energy(displacement) + plastic_work();
      break_found(displacement);
      stresses<false>(displacement);
      set_free(before, displacement);
    }
    if (cut) history = history_;
    return cut;
  }
  double steepening() const override { return rupture_ ? rupture_->steepening() : 1; }
  std::size_t law_history() const override { return Law::history_size; }
  NamedValues totals(const State&) const override {
    if (!rupture_) return {};
    const auto lost = rupture_->losses(torn());
    return {{"broken_links", lost[0]}, {"isolated_particles", lost[1]}, {"isolated_mass", lost[2]}};
  }
  std::array<double, 16> tangent_at(std::size_t i) const override {
    const Tensor<double> f = tensor_at(fields_.deformation_gradient, i);
    if constexpr (kHistory)
      return tangent(laws_[body_.member[i]], f, &history_[Law::history_size * i]);
    else
      return tangent(laws_[body_.member[i]], f);
  }
  Tensor<double> first_piola_kirchhoff_at(std::size_t i) const override {
    const Tensor<double> f = tensor_at(fields_.deformation_gradient, i);
    if constexpr (kHistory)
      return laws_[body_.member[i]].first_piola_kirchhoff(f, &history_[Law::history_size * i]);
    else
      return laws_[body_.member[i]].first_piola_kirchhoff(f);
  }
  double stress_across(std::size_t i) const override {
    const Tensor<double> f = tensor_at(fields_.deformation_gradient, i);
    if constexpr (kHistory)
      return laws_[body_.member[i]].stress_across(f, &history_[Law::history_size * i]);
    else
      return laws_[body_.member[i]].stress_across(f);
  }
  double stretch_across(std::size_t i) const override {
    const Tensor<double> f = tensor_at(fields_.deformation_gradient, i);
    if constexpr (kHistory)
      return laws_[body_.member[i]].stretch_across(f, &history_[Law::history_size * i]);
    else
      return laws_[body_.member[i]].stretch_across(f);
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
    ExternalForces external(body_, loading);
    Guide guide(body_, loading);
    RigidMotion rigid(body_, loading, dt);
    std::optional<Contact> contact;
    if (!loading.contact.modulus.empty()) contact.emplace(body_, loading.contact);
    const auto open = [&] {
      if (contact && rupture_) contact->tear(rupture_->torn_contours(torn()).pieces);
    };

    if (kHistory || rupture_) history_ = state.history;
    restore();
    open();
    set_time_step(kNoTime);
    sweep<false>(state.displacement, state.velocity, 0);
    set_time_step(dt);
    external.set(0.0, start, state.displacement);
    external.add_to(fields_.force);
    if (contact) contact->add_to(state.displacement, fields_.force);
    guide.remember(fields_.force);
    rigid.begin(state, fields_.force);
    for (std::uint64_t step = 1; step <= steps; ++step) {
      const double fraction = static_cast<double>(step) / static_cast<double>(steps);
      const double time = start + fraction * duration;
      if (step == 1)
        update<false, true>(state, kick);
      else
        update<true, true>(state, kick);
      guide.move(state, time, dt);
      rigid.drift(state, time);
      if constexpr (Viscous) guide.copy_velocity(state.velocity, predicted_velocity_);
      sweep<true>(state.displacement, predicted_velocity_, step);
      if (rupture_) {
        set_time_step(kNoTime);  // what flows in this step has flowed
        const std::uint64_t before = tears_;
        tear(state.displacement, predicted_velocity_, step);
        if (tears_ != before) open();
        set_time_step(dt);
      }
      external.set(fraction, time, state.displacement);
      external.add_to(fields_.force);
      if (contact) {
        contact->add_to(state.displacement, fields_.force);
        if (contact->touching()) state.contact_time += dt;
      }
      if (hourglass_)
        state.viscous_work +=
            dt * hourglass_->add_to(Viscous ? predicted_velocity_ : state.velocity, fields_);
      rigid.kick(state, fields_.force);
      state.external_work +=
          external.work() + guide.work(fields_.force, loading.gravity) + rigid.external_work();
      state.viscous_work += rigid.damper_work();
      if constexpr (Viscous)
        state.viscous_work +=
            dt * ordered_sum(body_.size(), [&](std::size_t i) { return fields_.viscous_power[i]; });
      if (smoothing_) state.viscous_work += smoothing_->apply(state.velocity);
      if (damping > 0) state.viscous_work += 2 * dt * damping * kinetic_energy(state);
      if (step % 128 == 0) {
        char note[64];
        std::snprintf(note, sizeof note, "step %llu of %llu", static_cast<unsigned long long>(step),
                      static_cast<unsigned long long>(steps));
        monitor(fraction, note);
      }
    }
    update<true, false>(state, kick);
    set_time_step(kNoTime);
    if (kHistory || rupture_) state.history = history_;
    state.time = start + duration;
    state.external_work += gravity_work(state, loading) - gravity_work_before;
  }

  double forces_in_motion(std::span<const double> displacement, const std::vector<double>& velocity,
                          double time_step, std::uint64_t step) override {
    if (time_step > 0) {
      set_time_step(time_step);
      sweep<true>(displacement, velocity, step);
      set_time_step(kNoTime);
      if (rupture_) tear(displacement, velocity, step);
    } else {
      restore();
      sweep<false>(displacement, velocity, step);
    }
    double taken = hourglass_ ? hourglass_->add_to(velocity, fields_) : 0.0;
    if constexpr (Viscous)
      taken += ordered_sum(body_.size(), [&](std::size_t i) { return fields_.viscous_power[i]; });
    return taken;
  }

  EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                          const EquilibriumSettings& settings, const Monitor& monitor) override;

private:
  // Too short for any flow where the yield stress depends on the rate: the stress of a state as it is.
  static constexpr double kNoTime = 1e-290;

  struct Kick {
    double dt, decay, gain;
    std::array<double, 2> gravity;
    std::array<bool, 2> held;
  };

  void set_time_step([[maybe_unused]] double time_step) {
    if constexpr (kHistory)
      for (Law& law : laws_) law.time_step = time_step;
  }
  template <bool Commit>
  std::int64_t stresses(std::span<const double> displacement) {
    return compute_stress<Law, Stabilised, Commit>(own_body(), pairs_, laws_, displacement, fields_,
                                                   history_.data());
  }
  template <bool WithViscosity>
  void forces(std::span<const double> displacement, std::span<const double> velocity) {
    compute_force<Stabilised, WithViscosity, kHistory && Stabilised>(body_, pairs_, viscosities_,
                                                                     displacement, velocity, fields_);
  }
  // What is left of the body.
  [[nodiscard]] const Body& own_body() const { return rupture_ ? rupture_->body() : body_; }
  // The part of the history that is about broken links.
  [[nodiscard]] std::span<const double> torn() const {
    return std::span<const double>(history_).subspan(Law::history_size * body_.size());
  }
  // The operator of the history, which may have been set to that of another time.
  void restore() {
    if (!rupture_) return;
    rupture_->restore(torn());
    fields_.base = rupture_->base().data();
  }
  // Breaks links that are past their limits; forces are then those without them.
  void tear(std::span<const double> displacement, std::span<const double> velocity, std::uint64_t step) {
    constexpr std::size_t size = Law::history_size;
    if (!rupture_->find_overloaded(displacement,
                                   {.stress = fields_.stress, .law = history_, .law_size = size}, torn()))
      return;
    const double before = energy(displacement) + plastic_work();
    break_found(displacement);
    const std::vector<double> whole = fields_.force;
    sweep<false>(displacement, velocity, step);
    // Up to here the links held: the kick about this instant is half theirs. (With the new forces alone
    // bodies gain energy at first order in the step.)
    for (std::size_t c = 0; c < whole.size(); ++c) fields_.force[c] = 0.5 * (fields_.force[c] + whole[c]);
    set_free(before, displacement);
  }
  // Breaks the links that have been found.
  void break_found(std::span<const double> displacement) {
    constexpr std::size_t size = Law::history_size;
    const std::span<double> own = std::span<double>(history_).subspan(size * body_.size());
    ++tears_;
    for (const std::uint32_t i :
         rupture_->break_links(displacement, fields_.deformation_gradient, kHistory, own))
      if constexpr (kHistory)
        std::copy(Law::kRest.begin(), Law::kRest.begin() + 4,
                  history_.begin() + static_cast<std::ptrdiff_t>(size * i));
    fields_.base = rupture_->base().data();
  }
  // What a break has left of the energy that was there `before`, counted.
  void set_free(double before, std::span<const double> displacement) {
    const std::span<double> own = std::span<double>(history_).subspan(Law::history_size * body_.size());
    rupture_->set_free(before - energy(displacement) - plastic_work(), own);
  }
  // Both sweeps for a state on the way.
  template <bool Commit>
  void sweep(std::span<const double> displacement, std::span<const double> velocity, std::uint64_t step) {
    if (stresses<Commit>(displacement) > 0) report_breakdown(step);
    forces<Viscous>(displacement, velocity);
  }

  // Ends one step (second half kick) and begins the next (first half kick and drift) in one pass over memory.
  template <bool Ends, bool Begins>
  void update(State& state, const Kick& kick) {
    double* u = state.displacement.data();
    double* v = state.velocity.data();
    const double* force = fields_.force.data();
    const double half = 0.5 * kick.dt;
    const std::size_t n = body_.size();
    on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
      for (std::size_t i = 0; i < n; ++i) {
        if ((body_.fixed[i] & 3U) == 3 || (!state.removed.empty() && state.removed[i] != 0)) continue;
        const double inverse_mass = 1 / body_.mass[i];
        for (std::size_t c = 0; c < 2; ++c) {
          if (kick.held[c] || body_.holds(i, c)) continue;
          const double a = force[2 * i + c] * inverse_mass + kick.gravity[c];
          double velocity = v[2 * i + c];
          if constexpr (Ends) velocity = kick.gain * (velocity + half * a);
          if constexpr (Begins) {
            velocity = kick.decay * velocity + half * a;
            u[2 * i + c] += kick.dt * velocity;
            // The viscous force wants the velocity at the step's end; half a step's extrapolation keeps
            // second order.
            if constexpr (Viscous) predicted_velocity_[2 * i + c] = velocity + half * a;
          }
          v[2 * i + c] = velocity;
        }
      }
    });
  }

  double gravity_work(const State& state, const Loading& loading) const {
    if (loading.gravity[0] == 0 && loading.gravity[1] == 0) return 0;
    return ordered_sum(body_.size(), [&](std::size_t i) {
      return body_.mass[i] * (loading.gravity[0] * state.displacement[2 * i] +
                              loading.gravity[1] * state.displacement[2 * i + 1]);
    });
  }

  std::vector<Material> materials_;
  std::vector<Law> laws_;
  std::vector<ArtificialViscosity> viscosities_;
  std::vector<double> predicted_velocity_;
  std::optional<VelocitySmoothing> smoothing_;
  std::optional<HourglassViscosity> hourglass_;
  std::optional<Rupture> rupture_;
  std::uint64_t tears_ = 0;
};

template <class Law>
std::unique_ptr<Solver> make_solver(const Body& body, const SolverOptions& options) {
  const bool stabilised = options.stabilisation > 0;
  bool viscous = false;
  NeighbourhoodOptions wanted{
      .order = options.order, .spring_modulus = {}, .kernel = options.kernel, .viscous = false};
  const std::size_t members = body.member.empty() ? 1 : std::size_t{body.member.back()} + 1;
  for (std::size_t m = 0; m < members; ++m) {
    const Material& material = options.materials[std::min(m, options.materials.size() - 1)];
    viscous = viscous || material.viscosity.linear > 0 || material.viscosity.quadratic > 0;
    if (stabilised)
      wanted.spring_modulus.push_back(options.stabilisation * material.constants.stabilisation_modulus());
  }
  wanted.viscous = viscous;
  Neighbourhood pairs = build_neighbourhood(body, wanted);
  if (stabilised && viscous)
    return std::make_unique<CompiledSolver<Law, true, true>>(body, std::move(pairs), options);
  if (stabilised) return std::make_unique<CompiledSolver<Law, true, false>>(body, std::move(pairs), options);
  if (viscous) return std::make_unique<CompiledSolver<Law, false, true>>(body, std::move(pairs), options);
  return std::make_unique<CompiledSolver<Law, false, false>>(body, std::move(pairs), options);
}

}  // namespace estuary::solid

#include "relaxation.hpp"
