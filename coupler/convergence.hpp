// When a window's iteration has converged, goes on, stalls or diverges.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "state_numbers.hpp"

namespace estuary::coupler {

enum class Verdict { go_on, converged, stalled, diverged };

/// Norms of one iteration's increments i = H(x) - x and of its answers H(x) [SI units, L2 over the wet
/// nodes].
struct IterationNorms {
  double displacement_increment = 0;
  double displacement = 0;
  double velocity_increment = 0;
  double velocity = 0;
  double force_increment = 0;
  double force = 0;
};

class Convergence {
public:
  /// `displacement_scale`: what counts as large, and at 1e-14 of it as nothing [m].
  Convergence(const CouplingScene& scene, double displacement_scale);

  void begin_window();
  [[nodiscard]] Verdict judge(const IterationNorms& norms, std::uint64_t iteration);
  /// For explicit schemes, once in each window: true when the motion that the fluid saw and the one that the
  /// solid answered have differed by more than the motion itself, and more and more, for several windows.
  /// That is the instability of added mass (Causin, Gerbeau & Nobile 2005), not a splitting error.
  [[nodiscard]] bool runs_away(const IterationNorms& norms);
  /// After the window: its velocities belong to what later ones are compared with.
  void accept(const IterationNorms& norms);

  /// Relative increment of a field at the last iteration: |i| / |H(x)|. Zero when nothing moves; never
  /// divides by zero.
  [[nodiscard]] double relative(Field field) const;
  /// The measure that is furthest from its limit at the last iteration, for people: "relative increment of
  /// the velocity 1.3e-03, limit 1e-05".
  [[nodiscard]] std::string furthest() const;

  /// What later windows are compared with.
  void save(StateWriter& state) const;
  void load(StateReader& state);

private:
  struct Norm {
    double increment = 0;
    double size = 0;
    double first_increment = 0;
  };
  [[nodiscard]] const Norm& of(Field field) const { return fields_[static_cast<std::size_t>(field)]; }
  // What the measure holds against its limit; below the limit when it holds.
  [[nodiscard]] double value_of(const Measure& measure) const;
  [[nodiscard]] bool grows(const IterationNorms& norms) const;

  std::vector<Measure> measures_;
  std::uint64_t least_iterations_;
  double scale_;
  double window_;
  std::array<Norm, 3> fields_{};
  std::uint64_t judged_ = 0;    // iterations since begin_window
  double early_increment_ = 0;  // largest of the displacement in the first of them
  double largest_velocity_ = 0;
  double largest_force_ = 0;
  double last_mismatch_ = 0;  // of the velocity, in explicit schemes
  int mismatches_ = 0;        // growing, in a row
  // Smallest increments in this window, and the last iteration that had one.
  double best_displacement_ = 0;
  double best_force_ = 0;
  std::uint64_t best_at_ = 0;
};

}  // namespace estuary::coupler
