// What the solid tells of its state: watched points, bodies, regions and totals.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "rigid_motion.hpp"
#include "solid.hpp"

namespace estuary::solid {

std::array<double, 7> Solid::particle_stress(std::size_t i) const {
  const Tensor<double> f = tensor_at(solver_->fields().deformation_gradient, i);
  const Tensor<double> sigma = scaled(product(solver_->first_piola_kirchhoff_at(i), transposed(f)),
                                      1 / (determinant(f) * solver_->stretch_across(i)));
  const double zz = solver_->stress_across(i), xy = 0.5 * (sigma.xy + sigma.yx);
  const double a = sigma.xx - sigma.yy, b = sigma.yy - zz, c = zz - sigma.xx;
  std::array<double, 7> result{sigma.xx, sigma.yy, xy, zz,
                               std::sqrt(0.5 * (a * a + b * b + c * c) + 3 * xy * xy)};
  if (scene_.plastic() && !scene_.shells() && !scene_.impact()) {
    const double* history = &solver_->history()[J2Plasticity::history_size * i];
    result[5] = history[4];
    result[6] = history[5];
  }
  return result;
}

std::array<double, 7> Solid::stress_at(const Transfer& transfer) const {
  std::array<double, 7> value{};
  for (std::size_t e = 0; e < transfer.weight.size(); ++e) {
    const auto one = particle_stress(transfer.touched[transfer.position[e]]);
    for (std::size_t c = 0; c < value.size(); ++c) value[c] += transfer.weight[e] * one[c];
  }
  return value;
}

std::array<double, 3> Solid::reaction_of(const std::vector<std::uint32_t>& particles,
                                         const std::array<bool, 2>& component,
                                         const std::vector<double>& external) const {
  std::array<double, 3> sum{};
  for (const std::size_t i : particles)
    for (std::size_t c = 0; c < 2; ++c) {
      if (!component[c] || !body_.holds(i, c) || body_.carried(i)) continue;
      const double force = -solver_->fields().force[2 * i + c] - external[2 * i + c];
      sum[c] += force;
      const std::size_t o = 2 * i + 1 - c;
      sum[2] += (c == 1 ? 1 : -1) * (body_.position[o] + state_.displacement[o]) * force;
    }
  return sum;
}

std::array<double, 3> Solid::reaction(double time) {
  std::vector<double> external;
  solver_->external_force(loading_, time, state_.displacement, external);
  std::vector<std::uint32_t> all(body_.size());
  std::iota(all.begin(), all.end(), 0U);
  std::array<double, 3> sum = reaction_of(all, {true, true}, external);
  sum[2] += solver_->held_moment();
  // What springs and dampers pull with; a held degree of freedom carries the rest.
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const RigidBody& rigid = body_.rigid[r];
    const std::span<const double> values = std::span<const double>(state_.rigid).subspan(6 * r, 6);
    const auto load = resultant(rigid, body_, state_.displacement, external, values);
    std::array<double, 3> support{};
    for (std::size_t c = 0; c < 3; ++c) {
      const double weight = c < 2 ? rigid.mass * loading_.gravity[c] : 0;
      support[c] = rigid.held[c]
                       ? -load[c] - weight
                       : -rigid.spring[c] * (values[c] - rigid.rest[c]) - rigid.damper[c] * values[3 + c];
      sum[c] += support[c];
    }
    sum[2] += (rigid.centre[0] + values[0]) * support[1] - (rigid.centre[1] + values[1]) * support[0];
  }
  return sum;
}

std::optional<std::size_t> Solid::rigid_at(const std::array<double, 2>& point, double slip) const {
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const auto loops = scene_.bodies[body_.rigid[r].member].outline(scene_.spacing);
    for (const double dx : {0.0, -slip, slip})
      for (const double dy : {0.0, -slip, slip})
        if (contains(loops, point[0] + dx, point[1] + dy)) return r;
  }
  return std::nullopt;
}

std::vector<std::pair<std::string, double>> Solid::rigid_quantities(
    std::size_t rigid, const std::array<double, 2>& point) const {
  const RigidBody& body = body_.rigid[rigid];
  const std::span<const double> q = std::span<const double>(state_.rigid).subspan(6 * rigid, 6);
  const double half = std::sin(0.5 * q[2]), less = -2 * half * half, sine = std::sin(q[2]);
  const double x = point[0] - body.centre[0], y = point[1] - body.centre[1];
  const double dx = less * x - sine * y, dy = sine * x + less * y;
  return {{"displacement_x", q[0] + dx},
          {"displacement_y", q[1] + dy},
          {"displacement", std::hypot(q[0] + dx, q[1] + dy)},
          {"velocity_x", q[3] - q[5] * (y + dy)},
          {"velocity_y", q[4] + q[5] * (x + dx)},
          {"rotation", q[2]},
          {"angular_velocity", q[5]}};
}

std::vector<std::pair<std::string, double>> Solid::body_quantities(std::size_t member) const {
  double mass = 0, energy = 0;
  std::array<double, 2> momentum{};
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (body_.member[i] != member) continue;
    const double m = body_.mass[i], vx = state_.velocity[2 * i], vy = state_.velocity[2 * i + 1];
    mass += m;
    momentum[0] += m * vx;
    momentum[1] += m * vy;
    energy += 0.5 * m * (vx * vx + vy * vy);
  }
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const RigidBody& rigid = body_.rigid[r];
    if (rigid.member != member) continue;
    const std::span<const double> q = std::span<const double>(state_.rigid).subspan(6 * r, 6);
    mass += rigid.mass;
    momentum[0] += rigid.mass * q[3];
    momentum[1] += rigid.mass * q[4];
    energy += kinetic_energy(rigid, q);
  }
  std::vector<std::pair<std::string, double>> result{{"momentum_x", momentum[0]},
                                                     {"momentum_y", momentum[1]},
                                                     {"velocity_x", momentum[0] / mass},
                                                     {"velocity_y", momentum[1] / mass},
                                                     {"kinetic_energy", energy}};
  if (contact_) {
    result.emplace_back("contact_force_x", contact_->body_force()[2 * member]);
    result.emplace_back("contact_force_y", contact_->body_force()[2 * member + 1]);
  }
  const NamedValues more = solver_->quantities_of_body(member, state_);
  result.insert(result.end(), more.begin(), more.end());
  return result;
}

// Of the particles that are now inside.
NamedValues Solid::region_quantities(const std::array<double, 4>& region) const {
  double mass = 0;
  std::array<double, 2> momentum{};
  for (std::size_t i = 0; i < body_.particles(); ++i) {
    const double x = body_.position[2 * i] + state_.displacement[2 * i],
                 y = body_.position[2 * i + 1] + state_.displacement[2 * i + 1];
    if (x < region[0] || y < region[1] || x > region[2] || y > region[3]) continue;
    mass += body_.mass[i];
    for (std::size_t c = 0; c < 2; ++c) momentum[c] += body_.mass[i] * state_.velocity[2 * i + c];
  }
  const double share = mass > 0 ? 1 / mass : 0;
  return {{"mass", mass},
          {"momentum_x", momentum[0]},
          {"momentum_y", momentum[1]},
          {"velocity_x", share * momentum[0]},
          {"velocity_y", share * momentum[1]}};
}

// What the method knows beyond displacements and stresses, in place of what is there under the same name.
void Solid::add_quantities(const Transfer& transfer, NamedValues& quantities) const {
  NamedValues sum;
  for (std::size_t e = 0; e < transfer.weight.size(); ++e) {
    const NamedValues one = solver_->quantities_of(transfer.touched[transfer.position[e]], state_);
    if (sum.empty())
      for (const auto& [name, value] : one) sum.emplace_back(name, 0.0);
    for (std::size_t k = 0; k < one.size(); ++k) sum[k].second += transfer.weight[e] * one[k].second;
  }
  for (const auto& entry : sum) {
    const auto same = std::find_if(quantities.begin(), quantities.end(),
                                   [&](const auto& other) { return other.first == entry.first; });
    if (same != quantities.end())
      same->second = entry.second;
    else
      quantities.push_back(entry);
  }
}

std::vector<WatchValues> Solid::watch_values(double time) {
  std::vector<WatchValues> values;
  if (contact_) {
    std::vector<double> unused(2 * body_.size());
    contact_->add_to(state_.displacement, unused);
  }
  for (const PointWatch& watch : watches_) {
    WatchValues entry{watch.name, {}};
    if (watch.region) {
      entry.quantities = region_quantities(*watch.region);
    } else if (watch.hold) {
      std::vector<double> external;
      solver_->external_force(loading_, time, state_.displacement, external);
      const auto force = reaction_of(watch.held, scene_.holds[*watch.hold].component, external);
      entry.quantities = {{"reaction_x", force[0]}, {"reaction_y", force[1]}, {"reaction_moment", force[2]}};
    } else if (watch.body) {
      entry.quantities = body_quantities(*watch.body);
    } else if (watch.rigid) {
      entry.quantities = rigid_quantities(*watch.rigid, watch.point);
    } else if (watch.transfer) {
      std::array<double, 2> u{}, v{};
      interpolate(*watch.transfer, state_.displacement, u);
      interpolate(*watch.transfer, state_.velocity, v);
      const std::array<double, 7> stress = stress_at(*watch.transfer);
      entry.quantities = {
          {"displacement_x", u[0]}, {"displacement_y", u[1]},     {"displacement", std::hypot(u[0], u[1])},
          {"velocity_x", v[0]},     {"velocity_y", v[1]},         {"cauchy_xx", stress[0]},
          {"cauchy_yy", stress[1]}, {"cauchy_xy", stress[2]},     {"cauchy_zz", stress[3]},
          {"von_mises", stress[4]}, {"plastic_strain", stress[5]}};
      // Of bodies that meet by impulses among what the solver knows, below; shells have none.
      if (scene_.plastic() && !scene_.shells() && !scene_.impact())
        entry.quantities.emplace_back("damage", stress[6]);
      add_quantities(*watch.transfer, entry.quantities);
    } else {
      double largest = 0;
      for (std::size_t i = 0; i < body_.size(); ++i)
        largest = std::max(largest, std::hypot(state_.displacement[2 * i], state_.displacement[2 * i + 1]));
      const auto force = reaction(time);
      std::array<double, 2> momentum{};
      double spin = 0;
      for (std::size_t i = 0; i < body_.size(); ++i) {
        const double m = body_.mass[i], vx = state_.velocity[2 * i], vy = state_.velocity[2 * i + 1];
        momentum[0] += m * vx;
        momentum[1] += m * vy;
        spin += m * ((body_.position[2 * i] + state_.displacement[2 * i]) * vy -
                     (body_.position[2 * i + 1] + state_.displacement[2 * i + 1]) * vx);
      }
      spin += solver_->spin(state_);
      double springs = 0;
      for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
        const RigidBody& rigid = body_.rigid[r];
        const std::span<const double> q = std::span<const double>(state_.rigid).subspan(6 * r, 6);
        momentum[0] += rigid.mass * q[3];
        momentum[1] += rigid.mass * q[4];
        spin += rigid.inertia * q[5] +
                rigid.mass * ((rigid.centre[0] + q[0]) * q[4] - (rigid.centre[1] + q[1]) * q[3]);
        springs += spring_energy(rigid, q);
      }
      const double kinetic = solver_->kinetic_energy(state_),
                   internal =
                       solver_->energy(state_.displacement) + springs + (contact_ ? contact_->energy() : 0.0),
                   plastic = solver_->plastic_work(), fracture = solver_->fracture_work(),
                   removed = state_.lost.energy;
      entry.quantities = {{"kinetic_energy", kinetic},   {"internal_energy", internal},
                          {"plastic_work", plastic},     {"maximum_displacement", largest},
                          {"reaction_x", force[0]},      {"reaction_y", force[1]},
                          {"reaction_moment", force[2]}, {"momentum_x", momentum[0]},
                          {"momentum_y", momentum[1]},   {"angular_momentum", spin}};
      // An equilibrium is found without following the path on which the load did its work.
      if (scene_.mode == Mode::transient) {
        if (contact_) entry.quantities.emplace_back("contact_time", state_.contact_time);
        entry.quantities.emplace_back("external_work", state_.external_work);
        entry.quantities.emplace_back("viscous_work", state_.viscous_work);
        entry.quantities.emplace_back("total_energy", kinetic + internal + plastic + fracture + removed +
                                                          state_.viscous_work + state_.contact_work -
                                                          state_.external_work);
      }
      if (scene_.breaks()) entry.quantities.emplace_back("fracture_work", fracture);
      if (scene_.remove_isolated)
        entry.quantities.insert(entry.quantities.end(),
                                {{"removed_particles", state_.lost.count},
                                 {"removed_mass", state_.lost.mass},
                                 {"removed_momentum_x", state_.lost.momentum[0]},
                                 {"removed_momentum_y", state_.lost.momentum[1]},
                                 {"removed_angular_momentum", state_.lost.angular_momentum},
                                 {"removed_energy", removed}});
      const NamedValues more = solver_->totals(state_);
      entry.quantities.insert(entry.quantities.end(), more.begin(), more.end());
    }
    values.push_back(std::move(entry));
  }
  return values;
}

}  // namespace estuary::solid
