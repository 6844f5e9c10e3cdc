// The granular medium of a scene: grains placed (and deposited), moved window by window, measured. The same
// interface for discs and spheres, so that the participant around it does not depend on the dimension.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "field_file.hpp"
#include "grains_scene.hpp"

namespace estuary::grains {

/// Largest step the scene's contacts allow [s], and what limits it.
struct StepLimit {
  double step = 0;
  double contact_time = 0;  // of the shortest contact [s]
  std::string by;
};

class Medium {
public:
  virtual ~Medium() = default;

  [[nodiscard]] virtual std::size_t size() const = 0;
  /// Grains and pieces of cement that the fluid is told of: entries of GrainStates and GrainForces.
  [[nodiscard]] virtual std::size_t bodies() const = 0;
  [[nodiscard]] virtual StepLimit step_limit() const = 0;
  /// Moves everything over `duration`.
  virtual void advance(double duration, std::uint64_t steps, const StepMonitor& monitor) = 0;
  /// Forces of the fluid, in the scene's order, those on pieces of cement after them; constant during the
  /// next advance. `time`: at which a body force that drives the fluid is taken, the middle of that advance.
  ///
  /// The fluid answers a grain's acceleration one exchange late. Where its added mass exceeds the grain's
  /// own, that delay grows without bound. With C masses of the displaced fluid m_f as virtual mass the grain
  /// moves by
  ///     (m + C m_f) a = F + C m_f a_expected,
  /// a_expected = a_1 + lead (a_1 - a_2) from its mean accelerations over the last two windows: the same
  /// equation as long as accelerations change little from one window to the next, and with lead = 0 stable
  /// for any m when m_added < 2 C m_f + m. Source: the idea of Schwarz, Kempe, Froehlich, J. Comput. Phys.
  /// 281 (2015). Where a_1 is a blow (above ten times what acts from outside) that outer part is taken
  /// instead.
  ///
  /// A late answer is work: sound in a closed box takes it up and grows where little damps it. So what acts
  /// in a window is F = F_1 + lead (F_1 - F_2), carried on from the forces that came for it and before;
  /// torques act as they come.
  virtual void set_fluid_forces(std::span<const double> force, std::span<const double> torque,
                                double time) = 0;
  /// What the balance of energies misses, over the energy turned over; a look at every contact.
  [[nodiscard]] virtual double energy_error() const = 0;
  virtual void set_surface(std::span<const double> node_positions) = 0;
  /// Force on each node of the wet surface, mean over the last advance.
  [[nodiscard]] virtual std::vector<double> surface_forces() const = 0;

  /// Every grain is held at rest, and so are the walls.
  [[nodiscard]] virtual bool at_rest() const = 0;

  virtual void keep() = 0;     // the present is where the window starts
  virtual void go_back() = 0;  // to what was kept

  virtual void fill(v1::GrainStates& states) const = 0;
  [[nodiscard]] virtual std::vector<std::pair<std::string, double>> watch(const WatchScene& watch) const = 0;
  virtual void write_frame(const std::filesystem::path& file) const = 0;
  virtual void write_sample_file(const std::filesystem::path& file) const = 0;
  virtual void save(const std::filesystem::path& file) const = 0;
  virtual void load(const std::filesystem::path& file) = 0;
  /// Mean pairs per grain in the list, for the traffic estimate.
  [[nodiscard]] virtual double pairs_per_grain() const = 0;
};

/// Called now and then while grains are deposited, with the share of the longest time that this may take; may
/// throw to stop.
using DepositMonitor = std::function<void(double part)>;

/// Places (and deposits) the grains. `surface` adds the wet surface of a solid as a wall. Throws
/// std::invalid_argument.
std::unique_ptr<Medium> make_medium(const GrainsScene& scene, const v1::WetSurface* surface,
                                    std::span<const double> surface_positions,
                                    const DepositMonitor& monitor = {});

/// Step limit from the smallest mass and radius alone, before anything is placed.
StepLimit step_limit_of(const GrainsScene& scene, double smallest_mass, double smallest_radius);

/// Area or volume, mass and moment of inertia of a grain of true radius r.
double grain_volume(int dimension, double r);
double grain_inertia(int dimension, double mass, double r);

}  // namespace estuary::grains
