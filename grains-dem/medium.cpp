#include "medium.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "deposit.hpp"
#include "granular_medium.hpp"
#include "placement.hpp"

namespace estuary::grains {
namespace {

// The motion given for wall `w`; the wet surface, the last one, has none here.
template <std::size_t N>
std::array<double, N> evaluated(const std::vector<std::vector<Expression>>& motion, std::size_t w, double t) {
  std::array<double, N> components{};
  if (w >= motion.size() || motion[w].size() != N) return components;
  for (std::size_t c = 0; c < N; ++c) components[c] = motion[w][c](0, 0, 0, t);
  return components;
}

}  // namespace

template <int D>
GranularMedium<D>::GranularMedium(const GrainsScene& scene, const v1::WetSurface* surface,
                                  std::span<const double> positions, const DepositMonitor& monitor)
    : scene_(scene) {
  InitialGrains<D> grains = initial_grains<D>(scene);
  DynamicsSettings<D> settings = dynamics_settings<D>(scene, grains);
  std::vector<Wall<D>> walls = scene_walls<D>(scene);
  if constexpr (D == 2) {
    if (surface) {
      Wall<2> wall;
      wall.name = "wet surface";
      wall.constants = scene.solid_constants;
      wall.node.assign(positions.begin(), positions.end());
      wall.facet.assign(surface->connectivity().begin(), surface->connectivity().end());
      surface_wall_ = walls.size();
      walls.push_back(std::move(wall));
    }
  } else if (surface) {
    throw std::invalid_argument("grains next to a solid's wet surface are for two dimensions");
  }
  if (scene.deposit.active) {
    const double friction = deposit(scene, settings, walls, grains, monitor);
    if (scene.deposit.target_porosity) deposit_friction_ = friction;
  }
  check_placement(settings, walls, grains);
  mass_ = grains.mass;
  add_virtual_mass(grains);
  for (const WallScene& wall : scene.walls) {
    wall_velocity_.emplace_back(wall.velocity.begin(), wall.velocity.end());
    wall_spin_.emplace_back(wall.spin.begin(), wall.spin.end());
  }
  limit_ =
      step_limit_of(scene, *std::min_element(mass_.begin(), mass_.end()),
                    *std::min_element(grains.radius.begin(), grains.radius.end()) - scene.contact_margin);
  dynamics_.emplace(std::move(settings), grains, std::move(walls));
  if (deposit_friction_)
    deposit_porosity_ = middle_porosity(*dynamics_, scene.deposit.gravity, scene.contact_margin);
  const auto any = [](const std::vector<std::vector<Expression>>& motion) {
    return std::any_of(motion.begin(), motion.end(), [](const auto& parts) { return !parts.empty(); });
  };
  if (any(wall_velocity_))
    dynamics_->wall_velocity = [this](std::size_t w, double t) {
      return evaluated<static_cast<std::size_t>(D)>(wall_velocity_, w, t);
    };
  if (any(wall_spin_))
    dynamics_->wall_spin = [this](std::size_t w, double t) {
      return evaluated<static_cast<std::size_t>(spin_components<D>)>(wall_spin_, w, t);
    };
  if (scene.cement.model != CementScene::Model::none) {
    std::vector<double> radius = grains.radius;
    for (double& r : radius) r -= scene.contact_margin;
    cement_ = make_cement<D>(scene.cement, dynamics_->settings().domain, grains.position, radius);
  }
  displaced_mass_.resize(mass_.size());
  for (std::size_t i = 0; i < mass_.size(); ++i)
    displaced_mass_[i] = scene.fluid.density * grain_volume(D, grains.radius[i] - scene.contact_margin);
  for (const std::string& part : scene.fluid.acceleration) drive_.emplace_back(part);
  if (scene.fluid.present) set_fluid_forces({}, {}, 0);
  dynamics_->begin_audit();
}

template <int D>
void GranularMedium<D>::advance(double duration, std::uint64_t steps, const StepMonitor& monitor) {
  if (virtual_mass_.empty()) {
    dynamics_->advance(duration, steps, monitor);
    return;
  }
  // Acceleration by what acts from outside alone, in the scene's order.
  const State<D>& state = dynamics_->state();
  constexpr std::size_t s = spin_components<D>;
  Accelerations& a = accelerations_;
  std::vector<double> outside(a.last.size()), outside_turning(a.last_turning.size());
  for (std::size_t i = 0; i < state.size(); ++i) {
    const std::size_t k = state.identity[i];
    for (std::size_t c = 0; c < D; ++c)
      outside[D * k + c] = state.inverse_mass[i] * state.external_force[D * i + c];
    for (std::size_t c = 0; c < s; ++c)
      outside_turning[s * k + c] = state.inverse_inertia[i] * state.external_torque[s * i + c];
  }
  // Until the velocities after it are there: the acceleration before the last one, and the velocities before.
  a.expected.swap(a.last);
  a.expected_turning.swap(a.last_turning);
  gather_velocities(-1 / duration, a.last, a.last_turning);
  dynamics_->advance(duration, steps, monitor);
  std::vector<double> velocity(a.last.size()), spin(a.last_turning.size());
  gather_velocities(1 / duration, velocity, spin);
  const auto go_on = [lead = scene_.fluid.lead](std::vector<double>& last, std::vector<double>& expected,
                                                const std::vector<double>& now) {
    for (std::size_t k = 0; k < now.size(); ++k) {
      last[k] += now[k];
      expected[k] = last[k] + lead * (last[k] - expected[k]);
    }
  };
  go_on(a.last, a.expected, velocity);
  go_on(a.last_turning, a.expected_turning, spin);
  // A blow is over when the next window begins: going on with it would throw the grain back faster than it
  // came.
  constexpr double kBlow = 10;
  for (std::size_t k = 0; k < mass_.size(); ++k) {
    if (norm(grains::load<D>(a.last.data(), k)) <= kBlow * norm(grains::load<D>(outside.data(), k))) continue;
    for (std::vector<double>* values : {&a.last, &a.expected})
      store<D>(values->data(), k, grains::load<D>(outside.data(), k));
    for (std::vector<double>* values : {&a.last_turning, &a.expected_turning})
      store<s>(values->data(), k, grains::load<s>(outside_turning.data(), k));
  }
}

template <int D>
bool GranularMedium<D>::at_rest() const {
  const State<D>& state = dynamics_->state();
  const auto zero = [](double value) { return value == 0; };
  return !surface_wall_ && !dynamics_->wall_velocity && !dynamics_->wall_spin &&
         std::all_of(state.inverse_mass.begin(), state.inverse_mass.end(), zero) &&
         std::all_of(state.velocity.begin(), state.velocity.end(), zero) &&
         std::all_of(state.spin.begin(), state.spin.end(), zero);
}

template <int D>
void GranularMedium<D>::set_fluid_forces(std::span<const double> force, std::span<const double> torque,
                                         double time) {
  take_cement_loads(force, torque);
  // What a driving body force, and the weight of the fluid itself where it is not in the fluid's own
  // pressure, add as pressure gradients.
  Vector<D> gradient{};
  for (std::size_t c = 0; c < D; ++c) {
    if (!drive_.empty()) gradient[c] = drive_[c](0, 0, 0, time);
    if (scene_.fluid.reduced_gravity) gradient[c] -= dynamics_->settings().gravity[c];
  }
  std::vector<double> total(D * mass_.size());
  for (std::size_t k = 0; k < total.size(); ++k) total[k] = displaced_mass_[k / D] * gradient[k % D];
  for (std::size_t k = 0; k < given_force_.size(); ++k) total[k] += given_force_[k];
  if (scene_.fluid.lead > 0) {
    for (std::size_t k = 0; k < last_force_.size(); ++k)
      total[k] += scene_.fluid.lead * (given_force_[k] - last_force_[k]);
    last_force_ = given_force_;
  }
  if (virtual_mass_.empty()) {
    dynamics_->set_external(total, given_torque_);
  } else {
    constexpr std::size_t s = spin_components<D>;
    std::vector<double> total_torque(s * mass_.size(), 0.0);
    std::copy(given_torque_.begin(), given_torque_.end(), total_torque.begin());
    for (std::size_t k = 0; k < total.size(); ++k)  // a virtual mass weighs nothing
      total[k] += virtual_mass_[k / D] * (accelerations_.expected[k] - dynamics_->settings().gravity[k % D]);
    for (std::size_t k = 0; k < total_torque.size(); ++k)
      total_torque[k] += virtual_inertia_[k / s] * accelerations_.expected_turning[k];
    dynamics_->set_external(total, total_torque);
  }
  fluid_force_ = {};
  for (std::size_t k = 0; k < given_force_.size(); ++k) fluid_force_[k % D] += given_force_[k];
}

template <int D>
void GranularMedium<D>::take_cement_loads(std::span<const double> force, std::span<const double> torque) {
  constexpr std::size_t d = D, s = spin_components<D>;
  const std::size_t n = size();
  given_force_.assign(force.begin(),
                      force.begin() + static_cast<std::ptrdiff_t>(std::min(d * n, force.size())));
  given_torque_.assign(torque.begin(),
                       torque.begin() + static_cast<std::ptrdiff_t>(std::min(s * n, torque.size())));
  if (force.size() < d * bodies() || cement_.bodies() == 0) return;
  const Domain<D>& domain = dynamics_->settings().domain;
  std::vector<std::size_t> place(n);
  for (std::size_t i = 0; i < n; ++i) place[dynamics_->state().identity[i]] = i;
  for (std::size_t b = 0; b < cement_.bodies(); ++b) {
    const std::size_t k = cement_.owner[b];
    const Vector<D> on_body = grains::load<d>(force.data(), n + b);
    add(given_force_.data(), k, on_body);
    if (given_torque_.empty()) continue;
    Vector<D> arm = grains::load<d>(cement_.centre.data(), b) -
                    grains::load<d>(dynamics_->state().position.data(), place[k]);
    for (std::size_t c = 0; c < d; ++c)
      if (domain.periodic[c]) arm[c] -= domain.length(c) * std::round(arm[c] / domain.length(c));
    add(given_torque_.data(), k, grains::load<s>(torque.data(), n + b) + arm_times_force(arm, on_body));
  }
}

template <int D>
void GranularMedium<D>::keep() {
  kept_.emplace(dynamics_->snapshot());
  kept_accelerations_ = accelerations_;
}

template <int D>
void GranularMedium<D>::go_back() {
  if (!kept_) return;
  dynamics_->restore(*kept_);
  accelerations_ = kept_accelerations_;
}

template <int D>
void GranularMedium<D>::fill(v1::GrainStates& states) const {
  const State<D>& state = dynamics_->state();
  constexpr int s = spin_components<D>;
  const auto n = static_cast<int>(bodies());
  states.set_dimension(D);
  states.mutable_centre()->Resize(D * n, 0.0);
  states.mutable_radius()->Resize(n, 0.0);
  states.mutable_velocity()->Resize(D * n, 0.0);
  states.mutable_spin()->Resize(s * n, 0.0);
  for (std::size_t i = 0; i < state.size(); ++i) {
    const auto k = static_cast<int>(state.identity[i]);
    states.set_radius(k, state.radius[i] - scene_.contact_margin + cement_.coating);
    for (int c = 0; c < D; ++c) {
      const std::size_t from = D * i + static_cast<std::size_t>(c);
      // In the box: the fluid knows no other turns of a periodic side.
      double x = state.position[from];
      const auto axis = static_cast<std::size_t>(c);
      const Domain<D>& domain = dynamics_->settings().domain;
      if (domain.periodic[axis])
        x -= domain.length(axis) * std::floor((x - domain.from[axis]) / domain.length(axis));
      states.set_centre(D * k + c, x);
      states.set_velocity(D * k + c, state.velocity[from]);
    }
    for (int c = 0; c < s; ++c)
      states.set_spin(s * k + c, state.spin[static_cast<std::size_t>(s) * i + static_cast<std::size_t>(c)]);
  }
  for (std::size_t b = 0; b < cement_.bodies(); ++b) {
    const auto k = static_cast<int>(size() + b);
    states.set_radius(k, cement_.radius[b]);
    for (int c = 0; c < D; ++c)
      states.set_centre(D * k + c, cement_.centre[D * b + static_cast<std::size_t>(c)]);
  }
}

template <int D>
void GranularMedium<D>::add_virtual_mass(InitialGrains<D>& grains) {
  const FluidScene& fluid = scene_.fluid;
  if (fluid.virtual_mass == 0 || !scene_.coupled_to_fluid) return;
  constexpr std::size_t s = spin_components<D>;
  accelerations_.last.assign(D * grains.size(), 0.0);
  accelerations_.last_turning.assign(s * grains.size(), 0.0);
  accelerations_.expected = accelerations_.last;
  accelerations_.expected_turning = accelerations_.last_turning;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const double r = grains.radius[i] - scene_.contact_margin;
    const double share = fluid.virtual_mass_over_radius > 0
                             ? std::min(fluid.virtual_mass, fluid.virtual_mass_over_radius / r)
                             : fluid.virtual_mass;
    const double mass = share * fluid.density * grain_volume(D, r);
    virtual_mass_.push_back(mass);
    virtual_inertia_.push_back(grain_inertia(D, mass, r));
    grains.mass[i] += mass;
    grains.inertia[i] += virtual_inertia_.back();
  }
}

template <int D>
void GranularMedium<D>::gather_velocities(double factor, std::vector<double>& velocity,
                                          std::vector<double>& spin) const {
  const State<D>& state = dynamics_->state();
  constexpr std::size_t s = spin_components<D>;
  for (std::size_t i = 0; i < state.size(); ++i) {
    const std::size_t k = state.identity[i];
    for (std::size_t c = 0; c < D; ++c) velocity[D * k + c] = factor * state.velocity[D * i + c];
    for (std::size_t c = 0; c < s; ++c) spin[s * k + c] = factor * state.spin[s * i + c];
  }
}

std::unique_ptr<Medium> make_medium(const GrainsScene& scene, const v1::WetSurface* surface,
                                    std::span<const double> surface_positions,
                                    const DepositMonitor& monitor) {
  if (scene.dimension == 2)
    return std::make_unique<GranularMedium<2>>(scene, surface, surface_positions, monitor);
  return std::make_unique<GranularMedium<3>>(scene, surface, surface_positions, monitor);
}

}  // namespace estuary::grains
