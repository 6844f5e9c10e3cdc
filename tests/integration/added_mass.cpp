// A string above an incompressible fluid as two participants: the model problem of the added-mass effect, P.
// Causin, J.-F. Gerbeau, F. Nobile (2005), Comput. Methods Appl. Mech. Engrg. 194, 4506-4527. Everything is
// known of it.
//
//   solid  rho_s h u'' + k_i u_i = f_i - p_i,  k_i = k (1 + i^2),  for the modes sin(i pi x), 0 < x < 1
//   fluid  p_i = rho_f mu_i u_i'',  mu_i = 1 / (i pi tanh(i pi H)): potential flow in a channel of height H
//
// Both take one step of the implicit Euler method in a window; the load f_i = load / i on the first five
// modes acts from t = 0. The same step taken by both together is the exact answer of the coupling:
// `coupling_error` is the largest relative distance (L2) from it in any window so far, `time_error` the
// relative distance from the exact motion in continuous time at the window's end.
#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>

#include "checkpoint.hpp"
#include "serve.hpp"
#include "wet_surface.hpp"

namespace {

using namespace estuary;

constexpr std::uint64_t surface_identity = 5;
constexpr double thickness = 0.1;
constexpr double channel_height = 0.5;
constexpr int loaded_modes = 5;

using Array = Eigen::ArrayXd;

// Displacement and velocity of every mode.
struct Modes {
  Array place;
  Array velocity;
};

class AddedMassParticipant final : public Participant {
public:
  Identity identity() const override {
    return {"added-mass", "1", {"fluid", "solid"}, {"transient", "wet-surface", "rewind", "checkpoint"}, {2}};
  }
  Plan configure(Scene& scene, const std::string& role) override {
    solid_ = role == "solid";
    for (const std::string name : {"fluid", "solid"}) {
      SceneTable table = scene.root().table(name);
      table.leave_to_others({"solver", "connect", "threads"});
      if (name == "fluid") {
        fluid_density_ = table.number("density", Range::positive());
      } else {
        density_ = table.number("density", Range::positive());
        stiffness_ = table.number("stiffness", Range::positive());
        load_ = table.number("load");
        intervals_ = static_cast<int>(table.integer_or("intervals", 32, 6, 10'000));
      }
      if (name == role) table.refuse_unknown_keys();
    }
    return {};
  }
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& /*folder*/) override {
    v1::Exchange brought;
    if (solid_) {
      surface_.set_identity(surface_identity);
      surface_.set_dimension(2);
      for (int i = 0; i <= intervals_; ++i) {
        surface_.add_reference_positions(static_cast<double>(i) / intervals_);
        surface_.add_reference_positions(0.0);
        if (i == 0) continue;
        surface_.add_connectivity(static_cast<std::uint32_t>(i - 1));
        surface_.add_connectivity(static_cast<std::uint32_t>(i));
      }
      *brought.mutable_wet_surface() = surface_;
    } else {
      surface_ = initial.wet_surface();
      check_wet_surface(surface_);
      intervals_ = static_cast<int>(node_count(surface_)) - 1;
    }
    const int modes = intervals_ - 1;
    const double pi = std::numbers::pi;
    number_ = Array::LinSpaced(modes, 1, modes);
    sine_.resize(modes, modes);
    for (int j = 0; j < modes; ++j)
      for (int i = 0; i < modes; ++i) sine_(j, i) = std::sin(pi * (j + 1) * (i + 1) / intervals_);
    // The consistent load of the pressures sin(i pi x) is this times them.
    load_factor_ = (2 + (number_ * pi / intervals_).cos()) / 3 / intervals_;
    solid_mass_ = Array::Constant(modes, density_ * thickness);
    added_mass_ = fluid_density_ / (number_ * pi * (number_ * pi * channel_height).tanh());
    spring_ = stiffness_ * (1 + number_.square());
    force_ = (number_ <= loaded_modes).select(load_ / number_, Array::Zero(modes));
    accepted_ = now_ = together_accepted_ = together_ = {Array::Zero(modes), Array::Zero(modes)};
    if (solid_) fill(*brought.mutable_displacements());
    return brought;
  }
  std::optional<double> window_step() const override { return 0.0; }

  AdvanceResult advance(const Window& window, const v1::Exchange& inputs,
                        ProgressBoard& /*progress*/) override {
    AdvanceResult result;
    result.work.steps = ++work_;
    const double dt = window.duration;
    if (!solid_) {
      check_displacements(inputs.displacements(), surface_);
      now_.velocity = modes_of([&](int i) { return inputs.displacements().velocity(i); });
      const Eigen::VectorXd pressure =
          sine_ * (added_mass_ * (now_.velocity - accepted_.velocity) / dt).matrix();
      auto& pressures = *result.outputs.mutable_pressures();
      pressures.set_surface(surface_.identity());
      pressures.add_pressure(0);
      for (const double value : pressure) pressures.add_pressure(value);
      pressures.add_pressure(0);
      return result;
    }
    check_forces(inputs.forces(), surface_);
    const Array received = modes_of([&](int i) { return inputs.forces().force(i); }) / load_factor_;
    now_ = implicit_step(accepted_, solid_mass_, received, dt);
    together_ = implicit_step(together_accepted_, solid_mass_ + added_mass_, Array::Zero(number_.size()), dt);
    const double size = std::max(together_.place.matrix().norm(), 1e-300);
    error_ = std::max(accepted_error_, (now_.place - together_.place).matrix().norm() / size);
    const Array frequency = (spring_ / (solid_mass_ + added_mass_)).sqrt();
    const Array exact = force_ / spring_ * (1 - (frequency * (window.time + dt)).cos());
    fill(*result.outputs.mutable_displacements());
    result.watches.push_back({"string",
                              {{"coupling_error", error_},
                               {"time_error", (now_.place - exact).matrix().norm() / exact.matrix().norm()},
                               {"size", now_.place.matrix().norm()}}});
    return result;
  }
  void accept() override {
    accepted_ = now_;
    together_accepted_ = together_;
    accepted_error_ = error_;
  }
  void save(const std::filesystem::path& file) override {
    CheckpointWriter writer(file);
    for (const auto& [name, values] : amplitudes()) writer.add(name, {values->data(), size_of(*values)});
    writer.add("error", std::vector<double>{accepted_error_});
    writer.add("work", work_);
    writer.commit();
  }
  void load(const std::filesystem::path& file) override {
    const CheckpointReader reader(file);
    for (const auto& [name, values] : amplitudes()) reader.read(name, {values->data(), size_of(*values)});
    now_ = accepted_;
    together_ = together_accepted_;
    accepted_error_ = error_ = reader.read_all("error").at(0);
    work_ = reader.read_count("work");
  }
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {}; }

private:
  std::array<std::pair<const char*, Array*>, 4> amplitudes() {
    return {{{"place", &accepted_.place},
             {"velocity", &accepted_.velocity},
             {"place together", &together_accepted_.place},
             {"velocity together", &together_accepted_.velocity}}};
  }
  static std::size_t size_of(const Array& values) { return static_cast<std::size_t>(values.size()); }
  // mass a + k u = f + other, with v = v0 + dt a, u = u0 + dt v.
  Modes implicit_step(const Modes& before, const Array& mass, const Array& other, double dt) const {
    const Array acceleration =
        (force_ + other - spring_ * (before.place + dt * before.velocity)) / (mass + dt * dt * spring_);
    Modes after;
    after.velocity = before.velocity + dt * acceleration;
    after.place = before.place + dt * after.velocity;
    return after;
  }
  // Amplitudes of the y components of a field's inner nodes.
  template <typename Value>
  Array modes_of(const Value& value) const {
    Eigen::VectorXd nodes(intervals_ - 1);
    for (int j = 0; j < intervals_ - 1; ++j) nodes[j] = value(2 * (j + 1) + 1);
    return (2.0 / intervals_) * (sine_ * nodes).array();
  }
  void fill(v1::Displacements& message) const {
    const Eigen::VectorXd place = sine_ * now_.place.matrix();
    const Eigen::VectorXd velocity = sine_ * now_.velocity.matrix();
    message.set_surface(surface_identity);
    message.mutable_displacement()->Resize(2 * (intervals_ + 1), 0.0);
    message.mutable_velocity()->Resize(2 * (intervals_ + 1), 0.0);
    for (int j = 0; j < intervals_ - 1; ++j) {
      message.set_displacement(2 * (j + 1) + 1, place[j]);
      message.set_velocity(2 * (j + 1) + 1, velocity[j]);
    }
  }

  bool solid_ = false;
  double fluid_density_ = 1;
  double density_ = 1;
  double stiffness_ = 1;
  double load_ = 1;
  int intervals_ = 32;
  v1::WetSurface surface_;
  Eigen::MatrixXd sine_;  // nodes x modes
  Array number_;
  Array load_factor_;
  Array solid_mass_;
  Array added_mass_;
  Array spring_;
  Array force_;
  Modes accepted_;
  Modes now_;
  Modes together_accepted_;
  Modes together_;
  double error_ = 0;
  double accepted_error_ = 0;
  std::uint64_t work_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  return estuary::serve(argc, argv, std::make_unique<AddedMassParticipant>());
}
