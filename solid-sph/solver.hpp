// The solver of one compiled variant (law, stabilisation, viscosity) behind an interface that is called once
// per window or once per Newton iteration, never inside a step.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "internal_force.hpp"
#include "loading.hpp"
#include "rupture_limits.hpp"

namespace estuary::solid {

class ShellRow;

/// The state left the range of the method; `particle` is the first one seen.
struct Breakdown : std::runtime_error {
  Breakdown(std::size_t which, std::uint64_t at_step, double volume_ratio)
      : std::runtime_error("inverted or not finite"), particle(which), step(at_step), j(volume_ratio) {}
  /// With what has become of the particle, to follow its place, and what to try.
  Breakdown(std::size_t which, std::uint64_t at_step, std::string the_field, const std::string& what,
            std::string advice_text)
      : std::runtime_error(what),
        particle(which),
        step(at_step),
        field(std::move(the_field)),
        advice(std::move(advice_text)) {}
  std::size_t particle;
  std::uint64_t step;
  double j = 0;
  std::string field, advice;  // empty: by `j`
};

/// Called now and then with the share of the request done and a note; it may throw to end the computation.
using Monitor = std::function<void(double fraction, const std::string& note)>;

using NamedValues = std::vector<std::pair<std::string, double>>;

struct EquilibriumSettings {
  double tolerance = 1e-6;
  std::uint64_t maximum_steps = 0;
};

struct EquilibriumReport {
  bool converged = false;
  std::uint64_t steps = 0;
  double residual = 0;          // |F_ext + F_int| over free particles, relative to |F_ext|
  double remaining_change = 0;  // estimated displacement still to come, relative to the displacement
  bool stable = true;           // false when Newton's method found none but an unstable equilibrium
  double reached = 0;           // share of the load up to which Newton's method found one
};

/// What one body is made of.
struct Material {
  ElasticConstants constants;
  Plane plane = Plane::strain;
  ArtificialViscosity viscosity;
  Plasticity plasticity;  // of J2Plasticity only
};

struct SolverOptions {
  std::vector<Material> materials;  // one for each body, or one for all
  double stabilisation = 0;         // share of ElasticConstants::stabilisation_modulus
  Order order = Order::linear;
  Kernel kernel = Kernel::cubic_spline;
  double conservative_smoothing = 0;        // alpha of VelocitySmoothing, transient only
  double artificial_stress = 0;             // of UpdatedLagrangianSolver
  std::vector<double> hourglass_time;       // of HourglassViscosity, of each body [s]; empty without it
  std::vector<RuptureLimits> rupture = {};  // of each body; empty without it
  std::vector<std::array<double, 4>> cracks = {};  // from the start: x0, y0, x1, y1 [m]
};

class Solver {
public:
  Solver(const Body& body, Neighbourhood pairs)
      : body_(body), pairs_(std::move(pairs)), fields_(body.size()) {}
  Solver(const Solver&) = delete;
  Solver& operator=(const Solver&) = delete;
  virtual ~Solver() = default;

  [[nodiscard]] const Body& body() const { return body_; }
  [[nodiscard]] const Neighbourhood& pairs() const { return pairs_; }
  /// Of the last evaluation.
  [[nodiscard]] const Fields& fields() const { return fields_; }

  /// Stresses and elastic forces of a displacement (no viscosity). Returns the number of particles with J <=
  /// 0 or values that are not finite.
  virtual std::int64_t evaluate(std::span<const double> displacement) = 0;
  /// Makes a displacement the one from which the next increment starts; nothing for laws without history.
  virtual void commit(std::span<const double> displacement) = 0;
  /// Of laws that have one; empty otherwise.
  [[nodiscard]] const std::vector<double>& history() const { return history_; }
  /// How many of its values belong to the law, for each particle; they come first.
  [[nodiscard]] virtual std::size_t law_history() const { return 0; }
  void set_history(const std::vector<double>& history) { history_ = history; }
  /// Of the state last evaluated: elastic energy, that of the stabilisation, and what the increment would
  /// dissipate.
  [[nodiscard]] virtual double energy(std::span<const double> displacement) const = 0;
  [[nodiscard]] virtual std::array<double, 16> tangent_at(std::size_t particle) const = 0;
  [[nodiscard]] virtual Tensor<double> first_piola_kirchhoff_at(std::size_t particle) const = 0;
  [[nodiscard]] virtual double stress_across(std::size_t particle) const = 0;
  [[nodiscard]] virtual double stretch_across(std::size_t particle) const = 0;
  /// Dissipated by plastic flow and damage up to the last commit [J/m].
  [[nodiscard]] virtual double plastic_work() const = 0;
  /// Elastic energy that rupture has set free up to the last commit [J/m].
  [[nodiscard]] virtual double fracture_work() const { return 0; }
  [[nodiscard]] virtual bool symmetric_tangent() const = 0;
  /// What rupture has made of the bodies' contours, and how often it has made something of them.
  [[nodiscard]] virtual TornContours torn_contours() const { return {}; }
  [[nodiscard]] virtual std::uint64_t tears() const { return 0; }
  /// Particles without a link, in the state last reached. `advance` leaves those alone that State::removed
  /// names.
  [[nodiscard]] virtual std::vector<std::uint32_t> isolated() const { return {}; }
  /// Cuts the last link of particles that hang on one and carry nothing, and of those that then do; what it
  /// held is set free. `history` becomes that after the cuts. Returns whether there were any.
  virtual bool cut_hanging(std::span<const double> displacement, std::vector<double>& history) {
    static_cast<void>(displacement);
    static_cast<void>(history);
    return false;
  }

  /// Before the first `advance` of a window.
  virtual void begin_window() {}
  /// Impulses that a driven surface has taken up since then [N s/m], 2 per node; empty without one.
  [[nodiscard]] virtual std::span<const double> surface_impulse() const { return {}; }
  /// Advances by `steps` equal steps of velocity Verlet (Swope et al. 1982; with mass damping, second order
  /// in time).
  virtual void advance(State& state, const Loading& loading, double duration, std::uint64_t steps,
                       double damping, const Monitor& monitor) = 0;
  /// Forces of a displacement that a step of `time_step` has led to (0: of a state as it is), with artificial
  /// viscosity at `velocity`; what has flowed stays. For methods that move the particles themselves. Returns
  /// what the viscosity takes [W/m].
  virtual double forces_in_motion(std::span<const double> displacement, const std::vector<double>& velocity,
                                  double time_step, std::uint64_t step) {
    static_cast<void>(velocity);
    if (evaluate(displacement) > 0) report_breakdown(step);
    if (time_step > 0) commit(displacement);
    return 0;
  }
  /// Dynamic relaxation to equilibrium under the loading's end values at `time`, from the displacement given.
  virtual EquilibriumReport relax(std::vector<double>& displacement, const Loading& loading, double time,
                                  const EquilibriumSettings& settings, const Monitor& monitor) = 0;

  /// Longest stable step of the reference state, 2 / omega_max [s], by power iteration on the linearised
  /// operator.
  [[nodiscard]] virtual double reference_stable_step();
  /// How much stiffer the material is now than at rest: largest singular value of dP/dF over all
  /// particles of the last evaluation, relative to that of the undeformed body.
  [[nodiscard]] double stiffening() const;
  /// By how much links lost since may raise squared frequencies over those of the reference state, at
  /// least 1.
  [[nodiscard]] virtual double steepening() const { return 1; }
  [[nodiscard]] virtual double kinetic_energy(const State& state) const;
  /// Angular momentum of particles that turn about themselves [kg m2/s per m].
  [[nodiscard]] virtual double spin(const State&) const { return 0; }
  /// Rows of particles that are shells, if there are any; their history comes first in that of the solver.
  [[nodiscard]] virtual const ShellRow* shells() const { return nullptr; }
  /// What else a method knows about the whole, about a particle, and about one body.
  [[nodiscard]] virtual NamedValues totals(const State&) const { return {}; }
  [[nodiscard]] virtual NamedValues quantities_of(std::size_t, const State&) const { return {}; }
  [[nodiscard]] virtual NamedValues quantities_of_body(std::size_t, const State&) const { return {}; }
  /// Parts of its run time, when it measures them [s].
  [[nodiscard]] virtual NamedValues phase_seconds() const { return {}; }
  /// Longest step from a state that was just evaluated [s]; 0: the caller knows it from the material.
  [[nodiscard]] virtual double longest_step(const State&, double) { return 0; }
  /// Sum of the moments that hold rotations of particles, of the last evaluation [N m/m].
  [[nodiscard]] virtual double held_moment() const { return 0; }
  /// Force of the loading's end values at `time` on every particle, gravity included [N/m].
  void external_force(const Loading& loading, double time, std::span<const double> displacement,
                      std::vector<double>& force) const;
  /// Throws Breakdown for the first particle out of range in the last evaluation.
  [[noreturn]] void report_breakdown(std::uint64_t step) const;

protected:
  const Body& body_;
  Neighbourhood pairs_;
  Fields fields_;
  std::vector<double> history_;
  std::vector<double> rest_history_;  // of the undeformed body
  double stable_step_ = 0;
  double rest_stiffness_ = 0;
};

/// `Law` is one of laws.hpp or plasticity.hpp. Throws std::domain_error when the particles do not allow a
/// gradient.
template <class Law>
std::unique_ptr<Solver> make_solver(const Body& body, const SolverOptions& options);

std::unique_ptr<Solver> make_solver(LawName law, const Body& body, const SolverOptions& options);

}  // namespace estuary::solid
