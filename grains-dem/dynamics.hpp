// Motion of grains under contact, bond, lubrication and given forces: lists, force sweeps and time
// integration.
//
//   velocity Verlet (Swope et al. 1982), forces from positions at the step's end and velocities at its
//   middle; or Gear's predictor-corrector of 3 to 6 terms (Gear 1971; Allen & Tildesley 1987, appendix E).
#pragma once

#include <functional>
#include <memory>
#include <stdexcept>

#include "bonds.hpp"
#include "contact_forces.hpp"
#include "lubrication.hpp"

namespace estuary::grains {

enum class Integrator { verlet, gear };

template <int D>
struct DynamicsSettings {
  Domain<D> domain;
  LawChoice law;
  ContactConstants constants;
  Vector<D> gravity{};
  double skin = 0;  // [m]
  Integrator integrator = Integrator::verlet;
  int gear_terms = 5;
  int gear_corrections = 1;
  Lubrication lubrication;
  BondLaw bond_law;
};

/// What a run of grains begins with; one entry per grain (D or one per spin component where vectors).
template <int D>
struct InitialGrains {
  std::vector<double> position, velocity, spin;
  std::vector<double> radius;   // of contact [m]
  std::vector<double> mass;     // [kg; kg/m in the plane]
  std::vector<double> inertia;  // [kg m2; kg m]
  std::vector<bool> held;       // moves with its velocity whatever acts on it
  [[nodiscard]] std::size_t size() const { return radius.size(); }
};

/// Thrown when the motion stopped making sense; `grain` counts in the scene's order.
struct Breakdown : std::runtime_error {
  Breakdown(std::size_t grain_number, const std::string& what,
            std::string what_to_try =
                "use more steps_per_contact, a smaller time_step, or less overlap at the start")
      : std::runtime_error(what), grain(grain_number), advice(std::move(what_to_try)) {}
  std::size_t grain;
  std::string advice;
};

struct Energies {
  double translation = 0, rotation = 0, contacts = 0, bonds = 0;
  [[nodiscard]] double total() const { return translation + rotation + contacts + bonds; }
};

/// Called now and then with the number of steps done; may throw to stop.
using StepMonitor = std::function<void(std::uint64_t step)>;

template <int D>
class Dynamics {
public:
  Dynamics(DynamicsSettings<D> settings, const InitialGrains<D>& grains, std::vector<Wall<D>> walls);

  /// `steps` equal steps over `duration` [s].
  void advance(double duration, std::uint64_t steps, const StepMonitor& monitor = {});

  /// Forces and torques from outside, in the scene's order, constant until set again; gravity is added.
  void set_external(std::span<const double> force, std::span<const double> torque);
  /// Velocity of wall `w` as a function of time; called once per step.
  std::function<Vector<D>(std::size_t wall, double time)> wall_velocity;
  /// Its spin about its pivot; planes do not turn.
  std::function<Spin<D>(std::size_t wall, double time)> wall_spin;
  /// Nodes of polyline `w` go from where they are to `target` during the next advance.
  void set_wall_target(std::size_t wall, std::span<const double> target);

  [[nodiscard]] const State<D>& state() const { return state_; }
  [[nodiscard]] const std::vector<Wall<D>>& walls() const { return walls_; }
  [[nodiscard]] const DynamicsSettings<D>& settings() const { return settings_; }
  [[nodiscard]] Bonds<D>& bonds() { return bonds_; }
  [[nodiscard]] const Bonds<D>& bonds() const { return bonds_; }
  [[nodiscard]] std::uint64_t rebuilds() const { return rebuilds_; }

  [[nodiscard]] Energies energies() const;
  /// Energy now, minus what came in and plus what left, minus energy at the start, over the largest of these
  /// amounts: 0 when the books balance.
  [[nodiscard]] double energy_error() const;
  [[nodiscard]] std::vector<ContactRecord<D>> contacts() const;
  /// Force of the grains on wall `w` at the last step [N].
  [[nodiscard]] Vector<D> wall_force(std::size_t wall) const;
  /// Its torque about the wall's pivot [N m].
  [[nodiscard]] Spin<D> wall_torque(std::size_t wall) const;
  /// The same shared between the nodes of a polyline, mean over the last advance; 2 per node.
  [[nodiscard]] const std::vector<double>& node_force(std::size_t wall) const { return node_force_[wall]; }

  /// Position without the wrapping of periodic sides; grain in the order of the state.
  [[nodiscard]] Vector<D> unwrapped(std::size_t i) const {
    return load<D>(state_.position.data(), i) + load<D>(state_.wrapped.data(), i);
  }

  struct Snapshot {
    State<D> state;
    Bonds<D> bonds;
    std::vector<Wall<D>> walls;
    std::vector<std::vector<double>> gear_position, gear_angle;
  };
  [[nodiscard]] Snapshot snapshot() const { return {state_, bonds_, walls_, gear_position_, gear_angle_}; }
  void restore(const Snapshot& snapshot);
  /// Sets the reference of the energy audit to now.
  void begin_audit();
  /// Makes the lists again: after bonds were made or grains were moved by hand.
  void rebuild();
  [[nodiscard]] State<D>& edit_state() { return state_; }
  [[nodiscard]] double energy_at_start() const { return energy_at_start_; }
  void set_energy_at_start(double energy) { energy_at_start_ = energy; }

private:
  void evaluate(double dt);
  void gather(std::size_t block);
  /// Adds forces that crossed blocks, kicks, drifts; returns the largest displacement since the last rebuild,
  /// squared.
  double update(double kick, double drift, bool gather_first, double dt);
  void move_walls(double dt);
  void rebuild_if_due(double displacement_squared);
  void after_rebuild();
  void check_finite() const;
  [[noreturn]] void name_pair_that_goes_through(double dt) const;
  [[noreturn]] void name_grain_behind(std::size_t wall_contact) const;
  void advance_verlet(double dt, std::uint64_t steps, const StepMonitor& monitor);
  void advance_gear(double dt, std::uint64_t steps, const StepMonitor& monitor);

  DynamicsSettings<D> settings_;
  ListSettings list_;
  LawFunctions<D> law_;
  SweepInput<D> input_;
  State<D> state_;
  std::vector<Wall<D>> walls_;
  std::vector<std::vector<double>> wall_target_, node_force_;
  Bonds<D> bonds_;
  CrossForces<D> cross_;
  std::vector<std::uint32_t> origin_, first_wall_contact_;
  std::vector<Vector<D>> wall_force_;
  std::vector<EnergyLedger> block_ledger_;
  std::vector<double> block_work_, block_displacement_;
  std::vector<std::uint8_t> block_through_;
  std::vector<std::size_t> block_behind_;  // a wall contact from behind, or kNoWallContact
  double smallest_radius_ = 0;
  bool external_torque_ = false;
  double energy_at_start_ = 0, ledger_at_start_ = 0;
  std::uint64_t rebuilds_ = 0;
  std::vector<std::vector<double>> gear_position_, gear_angle_;  // higher derivatives, from the second on
};

}  // namespace estuary::grains
