// What is measured of a medium: watches, frames for ParaView, the sample at the end.
#include <algorithm>
#include <cmath>
#include <limits>

#include "field_file.hpp"
#include "granular_medium.hpp"
#include "region.hpp"
#include "sample.hpp"

namespace estuary::grains {

template <int D>
WatchedValues GranularMedium<D>::watch(const WatchScene& watch) const {
  switch (watch.kind) {
    case WatchKind::grain:
      return watch_grain(watch.grain);
    case WatchKind::region:
      return watch_region(watch);
    case WatchKind::wall:
      return watch_wall(watch.wall);
    case WatchKind::totals:
      break;
  }
  return watch_totals();
}

template <int D>
std::size_t GranularMedium<D>::place_of(std::size_t grain) const {
  const auto& identity = dynamics_->state().identity;
  return static_cast<std::size_t>(std::find(identity.begin(), identity.end(), grain) - identity.begin());
}

template <int D>
WatchedValues GranularMedium<D>::watch_grain(std::size_t grain) const {
  const State<D>& state = dynamics_->state();
  const std::size_t i = place_of(grain);
  WatchedValues values;
  const Vector<D> x = dynamics_->unwrapped(i), v = grains::load<D>(state.velocity.data(), i);
  for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("position_") + kAxisName[c], x[c]);
  for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("velocity_") + kAxisName[c], v[c]);
  values.emplace_back("speed", norm(v));
  if constexpr (D == 2) {
    values.emplace_back("spin", state.spin[i]);
  } else {
    for (std::size_t c = 0; c < 3; ++c)
      values.emplace_back(std::string("spin_") + kAxisName[c], state.spin[3 * i + c]);
  }
  for (std::size_t c = 0; c < D; ++c)
    values.emplace_back(std::string("force_") + kAxisName[c], state.force[D * i + c]);
  double touching = 0;
  for (const auto& record : dynamics_->contacts())
    if (record.i == i || (!record.with_wall && record.j == i)) touching += 1;
  values.emplace_back("contacts", touching);
  // To the nearest other grain, between true surfaces.
  double gap = std::numeric_limits<double>::infinity();
  Vector<D> way{};
  const Domain<D>& domain = dynamics_->settings().domain;
  for (std::size_t j = 0; j < state.size(); ++j) {
    if (j == i) continue;
    Vector<D> apart = grains::load<D>(state.position.data(), j) - grains::load<D>(state.position.data(), i);
    for (std::size_t c = 0; c < D; ++c)
      if (domain.periodic[c]) apart[c] -= domain.length(c) * std::round(apart[c] / domain.length(c));
    const double to_it = norm(apart) - state.radius[i] - state.radius[j] + 2 * scene_.contact_margin;
    if (to_it >= gap) continue;
    gap = to_it;
    way = apart;
  }
  if (state.size() > 1) {
    values.emplace_back("nearest_gap", gap);
    for (std::size_t c = 0; c < D; ++c)
      values.emplace_back(std::string("to_nearest_") + kAxisName[c], way[c]);
  }
  for (std::size_t c = 0; c < D && !given_force_.empty(); ++c)
    values.emplace_back(std::string("fluid_force_") + kAxisName[c], given_force_[D * grain + c]);
  if (given_torque_.empty()) return values;
  if constexpr (D == 2) {
    values.emplace_back("fluid_torque", given_torque_[grain]);
  } else {
    for (std::size_t c = 0; c < 3; ++c)
      values.emplace_back(std::string("fluid_torque_") + kAxisName[c], given_torque_[3 * grain + c]);
  }
  return values;
}

template <int D>
WatchedValues GranularMedium<D>::watch_region(const WatchScene& watch) const {
  Vector<D> from{}, to{};
  for (std::size_t c = 0; c < D; ++c) {
    from[c] = watch.from[c];
    to[c] = watch.to[c];
  }
  const RegionMeasure<D> measure = measure_region(*dynamics_, from, to, scene_.contact_margin, given_force_);
  WatchedValues values;
  double pressure = 0;
  for (std::size_t a = 0; a < D; ++a) {
    pressure += measure.stress[a][a] / D;
    for (std::size_t b = 0; b < D; ++b)
      values.emplace_back(std::string("stress_") + kAxisName[a] + kAxisName[b], measure.stress[a][b]);
  }
  values.emplace_back("pressure", pressure);
  values.emplace_back("porosity", 1 - measure.solid / measure.volume);
  values.emplace_back("specific_surface", measure.solid > 0 ? measure.surface / measure.solid : 0);
  values.emplace_back("temperature", measure.temperature);
  values.emplace_back("grains", measure.grains);
  for (std::size_t c = 0; c < D; ++c)
    values.emplace_back(std::string("velocity_") + kAxisName[c], measure.velocity[c]);
  for (std::size_t c = 0; c < D && !given_force_.empty(); ++c)
    values.emplace_back(std::string("fluid_force_density_") + kAxisName[c], measure.outer_force[c]);
  return values;
}

template <int D>
WatchedValues GranularMedium<D>::watch_wall(const std::string& name) const {
  WatchedValues values;
  for (std::size_t w = 0; w < dynamics_->walls().size(); ++w) {
    if (dynamics_->walls()[w].name != name) continue;
    const Vector<D> force = dynamics_->wall_force(w);
    for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("force_") + kAxisName[c], force[c]);
    for (std::size_t c = 0; c < D; ++c)
      values.emplace_back(std::string("displacement_") + kAxisName[c],
                          dynamics_->state().wall_travel[D * w + c]);
    const Spin<D> torque = dynamics_->wall_torque(w);
    for (std::size_t c = 0; c < torque.size(); ++c)
      values.emplace_back(D == 2 ? std::string("torque") : std::string("torque_") + kAxisName[c], torque[c]);
  }
  return values;
}

template <int D>
WatchedValues GranularMedium<D>::watch_totals() const {
  const State<D>& state = dynamics_->state();
  const Energies energies = dynamics_->energies();
  const auto contacts = dynamics_->contacts();
  std::vector<double> touching(state.size(), 0.0);
  double deepest = 0;
  for (const auto& record : contacts) {
    touching[record.i] += 1;
    if (!record.with_wall) touching[record.j] += 1;
    deepest = std::max(deepest, record.kinematics.overlap / record.kinematics.radius_sum * 2);
  }
  double mobile = 0, touches = 0, mass = 0, fastest = 0;
  Vector<D> momentum{}, centre{}, low, high, front;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  front.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Vector<D> x = dynamics_->unwrapped(i), v = grains::load<D>(state.velocity.data(), i);
    if (state.inverse_mass[i] > 0) {
      const double m = mass_[state.identity[i]];
      mobile += 1;
      touches += touching[i];
      mass += m;
      momentum = momentum + m * v;
      centre = centre + m * x;
      fastest = std::max(fastest, norm(v));
      for (std::size_t c = 0; c < D; ++c) {
        low[c] = std::min(low[c], x[c] - state.radius[i]);
        high[c] = std::max(high[c], x[c] + state.radius[i]);
        if (touching[i] >= 2) front[c] = std::max(front[c], x[c] + state.radius[i]);
      }
    }
  }
  WatchedValues values{{"kinetic_energy", energies.translation},
                       {"rotational_energy", energies.rotation},
                       {"contact_energy", energies.contacts},
                       {"dissipated", state.ledger.dissipated()},
                       {"dissipated_normal", state.ledger.normal},
                       {"dissipated_tangential", state.ledger.tangential},
                       {"dissipated_rolling", state.ledger.rolling},
                       {"external_work", state.external_work},
                       {"given_work", state.ledger.given},
                       {"energy_error", dynamics_->energy_error()},
                       {"contacts", static_cast<double>(contacts.size())},
                       {"coordination", mobile > 0 ? touches / mobile : 0},
                       {"maximum_overlap", deepest},
                       {"maximum_speed", fastest}};
  // When two grains first touched, at the end of a window; -1 before.
  for (const auto& record : contacts)
    if (!record.with_wall && first_contact_ < 0) first_contact_ = state.time;
  values.emplace_back("first_contact_time", first_contact_);
  if (deposit_friction_) {
    values.emplace_back("deposit_friction", *deposit_friction_);
    values.emplace_back("deposit_porosity", *deposit_porosity_);
  }
  if (scene_.cement.model != CementScene::Model::none) {
    values.emplace_back("cement_saturation", cement_.saturation);
    values.emplace_back("cemented_porosity", cement_.porosity);
  }
  if (scene_.bond.active) {
    double whole = 0;
    for (const auto broken : dynamics_->bonds().broken) whole += broken ? 0 : 1;
    values.emplace_back("bonds", whole);
    values.emplace_back("bond_energy", energies.bonds);
  }
  // Temperature of the fluctuations about the mean velocity.
  double fluctuation = 2 * energies.translation;
  if (mass > 0) fluctuation -= dot(momentum, momentum) / mass;
  values.emplace_back("temperature", mobile > 0 ? fluctuation / (D * mobile) : 0);
  for (std::size_t c = 0; c < D; ++c)
    values.emplace_back(std::string("momentum_") + kAxisName[c], momentum[c]);
  for (std::size_t c = 0; c < D; ++c)
    values.emplace_back(std::string("centre_") + kAxisName[c], mass > 0 ? centre[c] / mass : 0);
  for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("low_") + kAxisName[c], low[c]);
  for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("high_") + kAxisName[c], high[c]);
  for (std::size_t c = 0; c < D; ++c)
    values.emplace_back(std::string("front_") + kAxisName[c], std::isfinite(front[c]) ? front[c] : low[c]);
  for (std::size_t c = 0; c < D && !given_force_.empty(); ++c)
    values.emplace_back(std::string("fluid_force_") + kAxisName[c], fluid_force_[c]);
  return values;
}

template <int D>
void GranularMedium<D>::write_frame(const std::filesystem::path& file) const {
  const State<D>& state = dynamics_->state();
  const std::size_t n = state.size();
  constexpr std::size_t s = spin_components<D>;
  std::vector<double> position(D * n), velocity(D * n), force(D * n), radius(n), spin(s * n), identity(n),
      coordination(n);
  for (const auto& record : dynamics_->contacts()) {
    coordination[state.identity[record.i]] += 1;
    if (!record.with_wall) coordination[state.identity[record.j]] += 1;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = state.identity[i];
    radius[k] = state.radius[i] - scene_.contact_margin;
    identity[k] = static_cast<double>(k);
    for (std::size_t c = 0; c < D; ++c) {
      position[D * k + c] = state.position[D * i + c];
      velocity[D * k + c] = state.velocity[D * i + c];
      force[D * k + c] = state.force[D * i + c];
    }
    for (std::size_t c = 0; c < s; ++c) spin[s * k + c] = state.spin[s * i + c];
  }
  std::vector<FieldView> views{{"radius", 1, radius},     {"velocity", D, velocity},
                               {"force", D, force},       {"spin", spin_components<D>, spin},
                               {"identity", 1, identity}, {"coordination", 1, coordination}};
  if (!given_force_.empty()) views.push_back({"fluid_force", D, given_force_});
  write_points(file, D, position, {}, views);
}

template <int D>
void GranularMedium<D>::write_sample_file(const std::filesystem::path& file) const {
  const State<D>& state = dynamics_->state();
  std::vector<double> position(D * state.size()), radius(state.size());
  for (std::size_t i = 0; i < state.size(); ++i) {
    radius[state.identity[i]] = state.radius[i] - scene_.contact_margin;
    for (std::size_t c = 0; c < D; ++c) position[D * state.identity[i] + c] = state.position[D * i + c];
  }
  write_sample(file, D, position, radius);
}

#define ESTUARY_MEASURES(D)                                                         \
  template WatchedValues GranularMedium<D>::watch(const WatchScene&) const;         \
  template void GranularMedium<D>::write_frame(const std::filesystem::path&) const; \
  template void GranularMedium<D>::write_sample_file(const std::filesystem::path&) const;
ESTUARY_MEASURES(2)
ESTUARY_MEASURES(3)
#undef ESTUARY_MEASURES

}  // namespace estuary::grains
