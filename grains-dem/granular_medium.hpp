// The medium of discs or of spheres. What it measures is in medium_watches.cpp, how it is written and read
// again in medium_checkpoint.cpp.
#pragma once

#include <optional>

#include "cement.hpp"
#include "expression.hpp"
#include "medium.hpp"

namespace estuary::grains {

inline constexpr std::array<const char*, 3> kAxisName{"x", "y", "z"};
using WatchedValues = std::vector<std::pair<std::string, double>>;

template <int D>
class GranularMedium final : public Medium {
public:
  GranularMedium(const GrainsScene& scene, const v1::WetSurface* surface, std::span<const double> positions,
                 const DepositMonitor& monitor);

  [[nodiscard]] std::size_t size() const override { return mass_.size(); }
  [[nodiscard]] std::size_t bodies() const override { return size() + cement_.bodies(); }
  [[nodiscard]] StepLimit step_limit() const override { return limit_; }

  void advance(double duration, std::uint64_t steps, const StepMonitor& monitor) override;

  [[nodiscard]] bool at_rest() const override;

  void set_fluid_forces(std::span<const double> force, std::span<const double> torque, double time) override;

  [[nodiscard]] double energy_error() const override { return dynamics_->energy_error(); }
  void set_surface(std::span<const double> positions) override {
    if (surface_wall_) dynamics_->set_wall_target(*surface_wall_, positions);
  }
  [[nodiscard]] std::vector<double> surface_forces() const override {
    return surface_wall_ ? dynamics_->node_force(*surface_wall_) : std::vector<double>{};
  }

  void keep() override;
  void go_back() override;

  void fill(v1::GrainStates& states) const override;

  [[nodiscard]] WatchedValues watch(const WatchScene& watch) const override;
  void write_frame(const std::filesystem::path& file) const override;
  void write_sample_file(const std::filesystem::path& file) const override;
  void save(const std::filesystem::path& file) const override;
  void load(const std::filesystem::path& file) override;

  [[nodiscard]] double pairs_per_grain() const override {
    return static_cast<double>(dynamics_->state().partner.size()) / static_cast<double>(size());
  }

private:
  void add_virtual_mass(InitialGrains<D>& grains);

  // Forces and torques on cement, added to those of the grains it sticks to.
  void take_cement_loads(std::span<const double> force, std::span<const double> torque);
  // Velocities and spins times `factor`, in the scene's order.
  void gather_velocities(double factor, std::vector<double>& velocity, std::vector<double>& spin) const;

  [[nodiscard]] std::size_t place_of(std::size_t grain) const;
  [[nodiscard]] WatchedValues watch_grain(std::size_t grain) const;
  [[nodiscard]] WatchedValues watch_region(const WatchScene& watch) const;
  [[nodiscard]] WatchedValues watch_wall(const std::string& name) const;
  [[nodiscard]] WatchedValues watch_totals() const;

  GrainsScene scene_;
  std::optional<Dynamics<D>> dynamics_;
  std::optional<typename Dynamics<D>::Snapshot> kept_;
  std::vector<std::vector<Expression>> wall_velocity_, wall_spin_;
  std::optional<std::size_t> surface_wall_;
  std::vector<Expression> drive_;  // accelerations of the fluid by the body force that drives it
  std::vector<double> mass_, displaced_mass_, given_force_, given_torque_;
  std::vector<double> last_force_;  // given for the window before, where forces are carried on
  // Empty without virtual mass; accelerations over the last window and as expected of the next, in the
  // scene's order.
  std::vector<double> virtual_mass_, virtual_inertia_;
  struct Accelerations {
    std::vector<double> last, expected, last_turning, expected_turning;
  };
  Accelerations accelerations_, kept_accelerations_;
  Cement<D> cement_;
  // What the search for a porosity found.
  std::optional<double> deposit_friction_, deposit_porosity_;
  Vector<D> fluid_force_{};
  mutable double first_contact_ = -1;  // found while watching [s]
  StepLimit limit_;
};

}  // namespace estuary::grains
