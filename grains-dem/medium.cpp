#include "medium.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "checkpoint.hpp"
#include "deposit.hpp"
#include "expression.hpp"
#include "region.hpp"
#include "sample.hpp"

namespace estuary::grains {
namespace {

constexpr std::array<const char*, 3> kAxis{"x", "y", "z"};

template <int D>
class GranularMedium final : public Medium {
public:
  GranularMedium(const GrainsScene& scene, const v1::WetSurface* surface, std::span<const double> positions)
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
        wall.segment.assign(surface->connectivity().begin(), surface->connectivity().end());
        surface_wall_ = walls.size();
        walls.push_back(std::move(wall));
      }
    } else if (surface) {
      throw std::invalid_argument("grains next to a solid's wet surface are for two dimensions");
    }
    if (scene.deposit.active) deposit(scene, settings, walls, grains);
    check_room(settings, grains);
    mass_ = grains.mass;
    add_virtual_mass(grains);
    for (const WallScene& wall : scene.walls) {
      wall_velocity_.emplace_back();
      for (const std::string& text : wall.velocity) wall_velocity_.back().emplace_back(text);
    }
    limit_ =
        step_limit_of(scene, *std::min_element(mass_.begin(), mass_.end()),
                      *std::min_element(grains.radius.begin(), grains.radius.end()) - scene.contact_margin);
    dynamics_.emplace(std::move(settings), grains, std::move(walls));
    if (std::any_of(scene.walls.begin(), scene.walls.end(),
                    [](const WallScene& wall) { return !wall.velocity.empty(); }))
      dynamics_->wall_velocity = [this](std::size_t w, double t) {
        Vector<D> v{};
        if (w < wall_velocity_.size())
          for (std::size_t c = 0; c < wall_velocity_[w].size(); ++c) v[c] = wall_velocity_[w][c](0, 0, 0, t);
        return v;
      };
    pressure_force_.assign(D * mass_.size(), 0.0);
    for (std::size_t i = 0; i < mass_.size(); ++i)
      for (std::size_t c = 0; c < D; ++c)
        // What a driving body force, and the weight of the fluid itself where it is not in the fluid's own
        // pressure, add as pressure gradients.
        pressure_force_[D * i + c] = scene.fluid.density *
                                     grain_volume(D, grains.radius[i] - scene.contact_margin) *
                                     (scene.fluid.acceleration[c] -
                                      (scene.fluid.reduced_gravity ? dynamics_->settings().gravity[c] : 0.0));
    if (scene.fluid.present) set_fluid_forces({}, {});
    dynamics_->begin_audit();
  }

  [[nodiscard]] std::size_t size() const override { return mass_.size(); }
  [[nodiscard]] StepLimit step_limit() const override { return limit_; }

  void advance(double duration, std::uint64_t steps, const StepMonitor& monitor) override {
    if (virtual_mass_.empty()) {
      dynamics_->advance(duration, steps, monitor);
      return;
    }
    gather_velocities(-1 / duration, acceleration_, turning_);
    dynamics_->advance(duration, steps, monitor);
    std::vector<double> velocity(acceleration_.size()), spin(turning_.size());
    gather_velocities(1 / duration, velocity, spin);
    for (std::size_t k = 0; k < velocity.size(); ++k) acceleration_[k] += velocity[k];
    for (std::size_t k = 0; k < spin.size(); ++k) turning_[k] += spin[k];
  }

  [[nodiscard]] bool at_rest() const override {
    const State<D>& state = dynamics_->state();
    const auto zero = [](double value) { return value == 0; };
    return !surface_wall_ && !dynamics_->wall_velocity &&
           std::all_of(state.inverse_mass.begin(), state.inverse_mass.end(), zero) &&
           std::all_of(state.velocity.begin(), state.velocity.end(), zero) &&
           std::all_of(state.spin.begin(), state.spin.end(), zero);
  }

  void set_fluid_forces(std::span<const double> force, std::span<const double> torque) override {
    std::vector<double> total = pressure_force_;
    for (std::size_t k = 0; k < force.size(); ++k) total[k] += force[k];
    if (virtual_mass_.empty()) {
      dynamics_->set_external(total, torque);
    } else {
      constexpr std::size_t s = spin_components<D>;
      std::vector<double> total_torque(s * mass_.size(), 0.0);
      std::copy(torque.begin(), torque.end(), total_torque.begin());
      for (std::size_t k = 0; k < total.size(); ++k)  // a virtual mass weighs nothing
        total[k] += virtual_mass_[k / D] * (acceleration_[k] - dynamics_->settings().gravity[k % D]);
      for (std::size_t k = 0; k < total_torque.size(); ++k)
        total_torque[k] += virtual_inertia_[k / s] * turning_[k];
      dynamics_->set_external(total, total_torque);
    }
    fluid_force_ = {};
    for (std::size_t k = 0; k < force.size(); ++k) fluid_force_[k % D] += force[k];
    given_force_.assign(force.begin(), force.end());
    given_torque_.assign(torque.begin(), torque.end());
  }

  void set_surface(std::span<const double> positions) override {
    if (surface_wall_) dynamics_->set_wall_target(*surface_wall_, positions);
  }
  [[nodiscard]] std::vector<double> surface_forces() const override {
    return surface_wall_ ? dynamics_->node_force(*surface_wall_) : std::vector<double>{};
  }

  void keep() override {
    kept_.emplace(dynamics_->snapshot());
    kept_acceleration_ = acceleration_;
    kept_turning_ = turning_;
  }
  void go_back() override {
    if (!kept_) return;
    dynamics_->restore(*kept_);
    acceleration_ = kept_acceleration_;
    turning_ = kept_turning_;
  }

  void fill(v1::GrainStates& states) const override {
    const State<D>& state = dynamics_->state();
    constexpr int s = spin_components<D>;
    const auto n = static_cast<int>(state.size());
    states.set_dimension(D);
    states.mutable_centre()->Resize(D * n, 0.0);
    states.mutable_radius()->Resize(n, 0.0);
    states.mutable_velocity()->Resize(D * n, 0.0);
    states.mutable_spin()->Resize(s * n, 0.0);
    for (std::size_t i = 0; i < state.size(); ++i) {
      const auto k = static_cast<int>(state.identity[i]);
      states.set_radius(k, state.radius[i] - scene_.contact_margin);
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
  }

  [[nodiscard]] std::vector<std::pair<std::string, double>> watch(const WatchScene& watch) const override {
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

  void write_frame(const std::filesystem::path& file) const override {
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

  void write_sample_file(const std::filesystem::path& file) const override {
    const State<D>& state = dynamics_->state();
    std::vector<double> position(D * state.size()), radius(state.size());
    for (std::size_t i = 0; i < state.size(); ++i) {
      radius[state.identity[i]] = state.radius[i] - scene_.contact_margin;
      for (std::size_t c = 0; c < D; ++c) position[D * state.identity[i] + c] = state.position[D * i + c];
    }
    write_sample(file, D, position, radius);
  }

  void save(const std::filesystem::path& file) const override;
  void load(const std::filesystem::path& file) override;

  [[nodiscard]] double pairs_per_grain() const override {
    return static_cast<double>(dynamics_->state().partner.size()) / static_cast<double>(size());
  }

private:
  void add_virtual_mass(InitialGrains<D>& grains) {
    if (scene_.fluid.virtual_mass == 0 || !scene_.coupled_to_fluid) return;
    constexpr std::size_t s = spin_components<D>;
    for (std::size_t i = 0; i < grains.size(); ++i) {
      const double r = grains.radius[i] - scene_.contact_margin;
      const double mass = scene_.fluid.virtual_mass * scene_.fluid.density * grain_volume(D, r);
      virtual_mass_.push_back(mass);
      virtual_inertia_.push_back(grain_inertia(D, mass, r));
      grains.mass[i] += mass;
      grains.inertia[i] += virtual_inertia_.back();
    }
    acceleration_.assign(D * grains.size(), 0.0);
    turning_.assign(s * grains.size(), 0.0);
  }

  // Velocities and spins times `factor`, in the scene's order.
  void gather_velocities(double factor, std::vector<double>& velocity, std::vector<double>& spin) const {
    const State<D>& state = dynamics_->state();
    constexpr std::size_t s = spin_components<D>;
    for (std::size_t i = 0; i < state.size(); ++i) {
      const std::size_t k = state.identity[i];
      for (std::size_t c = 0; c < D; ++c) velocity[D * k + c] = factor * state.velocity[D * i + c];
      for (std::size_t c = 0; c < s; ++c) spin[s * k + c] = factor * state.spin[s * i + c];
    }
  }

  // Two grains in the same place have no direction to push each other.
  void check_room(const DynamicsSettings<D>& settings, const InitialGrains<D>& grains) const {
    for (std::size_t c = 0; c < D; ++c) {
      if (!settings.domain.periodic[c]) continue;
      const double largest = *std::max_element(grains.radius.begin(), grains.radius.end());
      if (settings.domain.length(c) < 4 * largest + 2 * settings.skin)
        throw std::invalid_argument(
            fmt::format("the periodic direction {} is shorter than two grain diameters: a "
                        "grain would touch another one twice",
                        kAxis[c]));
    }
    State<D> probe;
    probe.position = grains.position;
    probe.radius = grains.radius;
    std::vector<std::size_t> order(grains.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    const auto before = [&](std::size_t a, std::size_t b) {
      return std::lexicographical_compare(&grains.position[D * a], &grains.position[D * a] + D,
                                          &grains.position[D * b], &grains.position[D * b] + D);
    };
    std::sort(order.begin(), order.end(), before);
    for (std::size_t k = 1; k < order.size(); ++k)
      if (!before(order[k - 1], order[k]))
        throw std::invalid_argument(fmt::format("grains {} and {} have the same centre",
                                                std::min(order[k - 1], order[k]),
                                                std::max(order[k - 1], order[k])));
  }

  [[nodiscard]] std::size_t place_of(std::size_t grain) const {
    const auto& identity = dynamics_->state().identity;
    return static_cast<std::size_t>(std::find(identity.begin(), identity.end(), grain) - identity.begin());
  }

  [[nodiscard]] std::vector<std::pair<std::string, double>> watch_grain(std::size_t grain) const {
    const State<D>& state = dynamics_->state();
    const std::size_t i = place_of(grain);
    std::vector<std::pair<std::string, double>> values;
    const Vector<D> x = dynamics_->unwrapped(i), v = ::estuary::grains::load<D>(state.velocity.data(), i);
    for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("position_") + kAxis[c], x[c]);
    for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("velocity_") + kAxis[c], v[c]);
    values.emplace_back("speed", norm(v));
    if constexpr (D == 2) {
      values.emplace_back("spin", state.spin[i]);
    } else {
      for (std::size_t c = 0; c < 3; ++c)
        values.emplace_back(std::string("spin_") + kAxis[c], state.spin[3 * i + c]);
    }
    for (std::size_t c = 0; c < D; ++c)
      values.emplace_back(std::string("force_") + kAxis[c], state.force[D * i + c]);
    double touching = 0;
    for (const auto& record : dynamics_->contacts())
      if (record.i == i || (!record.with_wall && record.j == i)) touching += 1;
    values.emplace_back("contacts", touching);
    // To the nearest other grain, between true surfaces.
    double gap = std::numeric_limits<double>::infinity();
    const Domain<D>& domain = dynamics_->settings().domain;
    for (std::size_t j = 0; j < state.size(); ++j) {
      if (j == i) continue;
      Vector<D> apart = ::estuary::grains::load<D>(state.position.data(), j) -
                        ::estuary::grains::load<D>(state.position.data(), i);
      for (std::size_t c = 0; c < D; ++c)
        if (domain.periodic[c]) apart[c] -= domain.length(c) * std::round(apart[c] / domain.length(c));
      gap = std::min(gap, norm(apart) - state.radius[i] - state.radius[j] + 2 * scene_.contact_margin);
    }
    if (state.size() > 1) values.emplace_back("nearest_gap", gap);
    for (std::size_t c = 0; c < D && !given_force_.empty(); ++c)
      values.emplace_back(std::string("fluid_force_") + kAxis[c], given_force_[D * grain + c]);
    if (given_torque_.empty()) return values;
    if constexpr (D == 2) {
      values.emplace_back("fluid_torque", given_torque_[grain]);
    } else {
      for (std::size_t c = 0; c < 3; ++c)
        values.emplace_back(std::string("fluid_torque_") + kAxis[c], given_torque_[3 * grain + c]);
    }
    return values;
  }

  [[nodiscard]] std::vector<std::pair<std::string, double>> watch_region(const WatchScene& watch) const {
    Vector<D> from{}, to{};
    for (std::size_t c = 0; c < D; ++c) {
      from[c] = watch.from[c];
      to[c] = watch.to[c];
    }
    const RegionMeasure<D> measure = measure_region(*dynamics_, from, to, scene_.contact_margin);
    std::vector<std::pair<std::string, double>> values;
    double pressure = 0;
    for (std::size_t a = 0; a < D; ++a) {
      pressure += measure.stress[a][a] / D;
      for (std::size_t b = 0; b < D; ++b)
        values.emplace_back(std::string("stress_") + kAxis[a] + kAxis[b], measure.stress[a][b]);
    }
    values.emplace_back("pressure", pressure);
    values.emplace_back("porosity", 1 - measure.solid / measure.volume);
    values.emplace_back("temperature", measure.temperature);
    values.emplace_back("grains", measure.grains);
    for (std::size_t c = 0; c < D; ++c)
      values.emplace_back(std::string("velocity_") + kAxis[c], measure.velocity[c]);
    return values;
  }

  [[nodiscard]] std::vector<std::pair<std::string, double>> watch_wall(const std::string& name) const {
    std::vector<std::pair<std::string, double>> values;
    for (std::size_t w = 0; w < dynamics_->walls().size(); ++w) {
      if (dynamics_->walls()[w].name != name) continue;
      const Vector<D> force = dynamics_->wall_force(w);
      for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("force_") + kAxis[c], force[c]);
      for (std::size_t c = 0; c < D; ++c)
        values.emplace_back(std::string("displacement_") + kAxis[c],
                            dynamics_->state().wall_travel[D * w + c]);
    }
    return values;
  }

  [[nodiscard]] std::vector<std::pair<std::string, double>> watch_totals() const {
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
      const Vector<D> x = dynamics_->unwrapped(i), v = ::estuary::grains::load<D>(state.velocity.data(), i);
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
    std::vector<std::pair<std::string, double>> values{{"kinetic_energy", energies.translation},
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
    for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("momentum_") + kAxis[c], momentum[c]);
    for (std::size_t c = 0; c < D; ++c)
      values.emplace_back(std::string("centre_") + kAxis[c], mass > 0 ? centre[c] / mass : 0);
    for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("low_") + kAxis[c], low[c]);
    for (std::size_t c = 0; c < D; ++c) values.emplace_back(std::string("high_") + kAxis[c], high[c]);
    for (std::size_t c = 0; c < D; ++c)
      values.emplace_back(std::string("front_") + kAxis[c], std::isfinite(front[c]) ? front[c] : low[c]);
    for (std::size_t c = 0; c < D && !given_force_.empty(); ++c)
      values.emplace_back(std::string("fluid_force_") + kAxis[c], fluid_force_[c]);
    return values;
  }

  GrainsScene scene_;
  std::optional<Dynamics<D>> dynamics_;
  std::optional<typename Dynamics<D>::Snapshot> kept_;
  std::vector<std::vector<Expression>> wall_velocity_;
  std::optional<std::size_t> surface_wall_;
  std::vector<double> mass_, pressure_force_, given_force_, given_torque_;
  // Empty without virtual mass; accelerations over the last window, in the scene's order.
  std::vector<double> virtual_mass_, virtual_inertia_, acceleration_, turning_;
  std::vector<double> kept_acceleration_, kept_turning_;
  Vector<D> fluid_force_{};
  mutable double first_contact_ = -1;  // found while watching [s]
  StepLimit limit_;
};

template <int D>
void GranularMedium<D>::save(const std::filesystem::path& file) const {
  const State<D>& state = dynamics_->state();
  CheckpointWriter writer(file);
  const auto add_numbers = [&](const char* name, const auto& values) {
    const std::vector<double> numbers(values.begin(), values.end());
    writer.add(name, numbers);
  };
  writer.add("grains", static_cast<std::uint64_t>(state.size()));
  writer.add("pairs", static_cast<std::uint64_t>(state.partner.size()));
  writer.add("bonds", static_cast<std::uint64_t>(dynamics_->bonds().size()));
  writer.add("position", state.position);
  writer.add("velocity", state.velocity);
  writer.add("spin", state.spin);
  writer.add("force", state.force);
  writer.add("torque", state.torque);
  writer.add("external_force", state.external_force);
  writer.add("external_torque", state.external_torque);
  writer.add("radius", state.radius);
  writer.add("inverse_mass", state.inverse_mass);
  writer.add("inverse_inertia", state.inverse_inertia);
  writer.add("wrapped", state.wrapped);
  writer.add("reference_position", state.reference_position);
  writer.add("root_mass", state.root_mass);
  writer.add("history", state.history);
  writer.add("wall_history", state.wall_history);
  writer.add("wall_travel", state.wall_travel);
  add_numbers("identity", state.identity);
  add_numbers("row_start", state.row_start);
  add_numbers("partner", state.partner);
  writer.add("image", state.image);
  std::vector<double> wall_contact;
  for (const WallContact& contact : state.wall_contact)
    wall_contact.insert(wall_contact.end(),
                        {static_cast<double>(contact.grain), static_cast<double>(contact.wall),
                         static_cast<double>(contact.element), static_cast<double>(contact.near_begin),
                         static_cast<double>(contact.near_end)});
  writer.add("wall_contact", wall_contact);
  add_numbers("wall_segment", state.wall_segment);
  for (std::size_t w = 0; w < dynamics_->walls().size(); ++w) {
    writer.add(fmt::format("wall_{}_point", w), dynamics_->walls()[w].point);
    writer.add(fmt::format("wall_{}_node", w), dynamics_->walls()[w].node);
  }
  const Bonds<D>& bonds = dynamics_->bonds();
  add_numbers("bond_first", bonds.first);
  add_numbers("bond_second", bonds.second);
  writer.add("bond_length", bonds.length);
  writer.add("bond_shear", bonds.shear);
  writer.add("bond_turn", bonds.turn);
  writer.add("bond_broken", bonds.broken);
  const std::array<double, 8> numbers{
      state.time,         state.ledger.normal, state.ledger.tangential, state.ledger.rolling,
      state.ledger.given, state.external_work, state.bond_loss,         dynamics_->energy_at_start()};
  writer.add("numbers", numbers);
  if (!virtual_mass_.empty()) {
    writer.add("acceleration", acceleration_);
    writer.add("turning", turning_);
  }
  writer.commit();
}

template <int D>
void GranularMedium<D>::load(const std::filesystem::path& file) {
  const CheckpointReader reader(file);
  typename Dynamics<D>::Snapshot snapshot = dynamics_->snapshot();
  State<D>& state = snapshot.state;
  const std::size_t n = state.size();
  if (reader.read_count("grains") != n || reader.read_count("bonds") != snapshot.bonds.size())
    throw std::runtime_error(fmt::format("{} belongs to another sample: {} grains there, {} here",
                                         file.string(), reader.read_count("grains"), n));
  const auto finite = [&](const std::vector<double>& values) {
    for (const double value : values)
      if (!std::isfinite(value))
        throw std::runtime_error(file.string() + " holds a value that is not finite");
  };
  const auto whole = [&](const char* name, std::vector<std::uint32_t>& values, std::size_t size,
                         double limit) {
    const std::vector<double> numbers = reader.read_all(name);
    if (numbers.size() != size)
      throw std::runtime_error(fmt::format("{}: '{}' has a wrong length", file.string(), name));
    values.clear();
    for (const double number : numbers) {
      if (!(number >= 0 && number <= limit))
        throw std::runtime_error(fmt::format("{}: '{}' holds {}", file.string(), name, number));
      values.push_back(static_cast<std::uint32_t>(number));
    }
  };
  for (auto [name, values] : std::initializer_list<std::pair<const char*, std::vector<double>*>>{
           {"position", &state.position},
           {"velocity", &state.velocity},
           {"spin", &state.spin},
           {"force", &state.force},
           {"torque", &state.torque},
           {"external_force", &state.external_force},
           {"external_torque", &state.external_torque},
           {"radius", &state.radius},
           {"inverse_mass", &state.inverse_mass},
           {"inverse_inertia", &state.inverse_inertia},
           {"wrapped", &state.wrapped},
           {"reference_position", &state.reference_position},
           {"wall_travel", &state.wall_travel}}) {
    reader.read(name, *values);
    finite(*values);
  }
  const std::size_t pairs = reader.read_count("pairs");
  const std::size_t former_pairs = state.partner.size();
  const std::size_t memory = history_size_of<D>(scene_.law);
  (void)former_pairs;
  const double last_grain = static_cast<double>(n) - 1;
  whole("identity", state.identity, n, last_grain);
  whole("row_start", state.row_start, n + 1, static_cast<double>(pairs));
  whole("partner", state.partner, pairs, last_grain);
  state.image.resize(pairs);
  reader.read("image", state.image);
  for (const auto image : state.image)
    if (image >= kImages<D>) throw std::runtime_error(file.string() + " names an image that there is not");
  state.root_mass.resize(pairs);
  reader.read("root_mass", state.root_mass);
  state.history.resize(memory * pairs + 8);
  reader.read("history", state.history);
  finite(state.history);
  if (!std::is_sorted(state.row_start.begin(), state.row_start.end()) || state.row_start.back() != pairs)
    throw std::runtime_error(file.string() + ": the pair list is broken");
  const std::vector<double> wall_contact = reader.read_all("wall_contact");
  const std::size_t near = reader.read_all("wall_segment").size();
  std::size_t most_segments = 0;
  for (const Wall<D>& wall : snapshot.walls) most_segments = std::max(most_segments, wall.segments());
  whole("wall_segment", state.wall_segment, near, static_cast<double>(most_segments));
  state.wall_contact.clear();
  for (std::size_t k = 0; k + 4 < wall_contact.size(); k += 5) {
    const auto number = [&](std::size_t at) { return static_cast<std::uint32_t>(wall_contact[k + at]); };
    const WallContact contact{number(0), number(1), number(2), number(3), number(4)};
    if (contact.grain >= n || contact.wall >= snapshot.walls.size() ||
        contact.near_begin > contact.near_end || contact.near_end > near)
      throw std::runtime_error(file.string() + " names a grain, wall or segment that there is not");
    for (std::uint32_t m = contact.near_begin; m < contact.near_end; ++m)
      if (state.wall_segment[m] >= snapshot.walls[contact.wall].segments())
        throw std::runtime_error(file.string() + " names a segment that there is not");
    state.wall_contact.push_back(contact);
  }
  state.wall_history.resize(memory * state.wall_contact.size() + 8);
  reader.read("wall_history", state.wall_history);
  for (std::size_t w = 0; w < snapshot.walls.size(); ++w) {
    reader.read(fmt::format("wall_{}_point", w), snapshot.walls[w].point);
    reader.read(fmt::format("wall_{}_node", w), snapshot.walls[w].node);
  }
  Bonds<D>& bonds = snapshot.bonds;
  whole("bond_first", bonds.first, bonds.size(), last_grain);
  whole("bond_second", bonds.second, bonds.size(), last_grain);
  reader.read("bond_length", bonds.length);
  reader.read("bond_shear", bonds.shear);
  reader.read("bond_turn", bonds.turn);
  reader.read("bond_broken", bonds.broken);
  std::array<double, 8> numbers{};
  reader.read("numbers", numbers);
  if (!virtual_mass_.empty()) {
    for (auto [name, values] : std::initializer_list<std::pair<const char*, std::vector<double>*>>{
             {"acceleration", &acceleration_}, {"turning", &turning_}}) {
      reader.read(name, *values);
      finite(*values);
    }
  }
  state.time = numbers[0];
  state.ledger = {numbers[1], numbers[2], numbers[3], numbers[4]};
  state.external_work = numbers[5];
  state.bond_loss = numbers[6];
  dynamics_->restore(snapshot);
  dynamics_->set_energy_at_start(numbers[7]);
}

}  // namespace

double grain_volume(int dimension, double r) {
  return dimension == 2 ? std::numbers::pi * r * r : 4.0 / 3 * std::numbers::pi * r * r * r;
}
double grain_inertia(int dimension, double mass, double r) {
  return (dimension == 2 ? 0.5 : 0.4) * mass * r * r;
}

StepLimit step_limit_of(const GrainsScene& scene, double mass, double radius) {
  StepLimit limit;
  const double pair_mass = 0.5 * mass;
  const bool hertz = scene.law.normal == NormalLaw::hertz;
  const double modulus = 0.75 * scene.constants.normal_stiffness;
  limit.contact_time =
      hertz ? hertz_contact_time(modulus, pair_mass, 0.5 * radius, scene.impact_speed)
            : linear_contact_time(scene.constants.normal_stiffness, scene.restitution, pair_mass);
  limit.step = limit.contact_time / scene.steps_per_contact;
  limit.by = "contact time";
  const auto lower = [&](double step, const char* by) {
    if (step >= limit.step) return;
    limit.step = step;
    limit.by = by;
  };
  constexpr double pi = std::numbers::pi;
  if (!hertz && scene.law.friction == FrictionLaw::spring) {
    const double lever = scene.dimension == 2 ? 3 : 3.5;  // 1 + m r^2 / I
    lower(pi / std::sqrt(lever * scene.constants.tangential_stiffness / pair_mass) / scene.steps_per_contact,
          "tangential stiffness");
  }
  if (scene.bond.active) {
    const double r = scene.bond.radius_ratio * radius;
    const double area = scene.dimension == 2 ? 2 * r : pi * r * r;
    const double stiffness = std::max(scene.bond.normal_stiffness, scene.bond.shear_stiffness) * area;
    // A grain in the middle of a bonded body hangs on several bonds.
    lower(pi / std::sqrt(6 * stiffness / mass) / scene.steps_per_contact, "bond stiffness");
  }
  if (scene.law.rolling == RollingLaw::viscous)
    lower(0.2 * grain_inertia(scene.dimension, mass, radius) / scene.constants.rolling_damping,
          "rolling damping");
  if (scene.lubrication.active()) {
    const double ratio = 0.5 * radius / scene.lubrication.minimum_gap;
    const double resistance =
        scene.dimension == 2
            ? 3 * std::numbers::sqrt2 * pi * scene.lubrication.viscosity * std::pow(ratio, 1.5)
            : 6 * pi * scene.lubrication.viscosity * ratio * 0.5 * radius;
    lower(0.2 * pair_mass / resistance, "lubrication at the smallest gap");
  }
  if (scene.time_step) lower(*scene.time_step, "time_step of the scene");
  return limit;
}

std::unique_ptr<Medium> make_medium(const GrainsScene& scene, const v1::WetSurface* surface,
                                    std::span<const double> surface_positions) {
  if (scene.dimension == 2) return std::make_unique<GranularMedium<2>>(scene, surface, surface_positions);
  return std::make_unique<GranularMedium<3>>(scene, surface, surface_positions);
}

}  // namespace estuary::grains
