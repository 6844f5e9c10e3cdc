// Weakly compressible fluid bodies as particles: smoothed particle hydrodynamics in the current
// configuration.
//
// The velocity gradient at a particle is the least-squares fit over its neighbours,
//     L_i = sum_j (v_j - v_i) (x) g_ij,  g_ij = F_ij H_i^-1 x_ij,  H_i = sum_j F_ij x_ij (x) x_ij,  F =
//     -W'/r,
// exact for linear fields up to free surfaces (Randles & Libersky 1996; Bonet & Lok 1999). The density of a
// step follows from rho_new = rho det(I - dt L), exact for homogeneous motions. Forces are those that do the
// work of the stress S = -p I + 2 mu D on this very gradient,
//     f_i = sum_j F_ij (V_i S_i H_i^-1 + V_j S_j H_j^-1) x_ij,
// so that momentum is conserved to round-off and energy to the order of the step; missing neighbours act as a
// free surface. To this come Monaghan's artificial viscosity (Monaghan 1992) and, for a smooth pressure, the
// density diffusion of delta-SPH with the gradient correction of Antuono et al. (2010).
//
// Or these gradients are the derivatives of moving least squares of degree 1 or 2 (moving_fit.hpp; Dilts
// 1999): the forces then are the transpose of the velocities' gradient,
//     f_i = sum_j (V_i S_i g_ij - V_j S_j g_ji),
// which conserves momentum to round-off and, where linear fields are reproduced, angular momentum; the force
// of an even slope of pressure among disordered particles is right as a whole, not at each of them. Degrees
// fall where neighbours are lost; Shepard's gradient, which then is left, conserves momentum only.
//
// Or, in place of viscosity and diffusion, the states between particles are those of an acoustic Riemann
// problem (Vila 1999; Zhang, Hu & Adams 2017): with U the speed of approach along the line of centres, p* - p
// = 1/2 rho min(n U, c) U, and v* - v = (p_L - p_R) / (2 rho c) with pressures reconstructed linearly to the
// middle. The limiter n is 3 there; a large one leaves the full dissipation.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "fluid_material.hpp"
#include "moving_neighbours.hpp"
#include "particles.hpp"
#include "reproducing_weights.hpp"

namespace estuary::solid {

struct FluidSettings {
  std::vector<FluidMaterial> materials;  // one for each member
  double spacing = 0;                    // [m]
  double smoothing_ratio = 0.95;         // h over the particles' diameter
  bool variable_smoothing = true;        // h_ij = ratio (d_i + d_j) / 2 with d = sqrt(m / rho); else constant
  Order gradients = Order::linear;       // or one of moving least squares
};

class Fluid {
public:
  /// Particles in structures of arrays: mass [kg/m] and member of each.
  Fluid(FluidSettings settings, std::vector<double> mass, std::vector<std::uint8_t> member);

  [[nodiscard]] std::size_t size() const { return mass_.size(); }
  /// Geometry, velocity gradient and density at positions reached by a step of `time_step` with `velocity`
  /// (0: of the state as it is, the density stays). Returns how many particles are not finite or have no
  /// volume; `first_bad` is then the first of them.
  std::int64_t measure(std::span<const double> position, std::span<const double> velocity, double time_step,
                       std::vector<double>& density);
  [[nodiscard]] std::size_t first_bad() const { return first_bad_; }
  /// Forces [N/m] of the state last measured, 2 per particle; those of artificial and real viscosity alone.
  void find_forces(std::span<const double> position, std::span<const double> velocity,
                   std::span<const double> density);
  [[nodiscard]] const std::vector<double>& force() const { return force_; }
  [[nodiscard]] const std::vector<double>& viscous_force() const { return viscous_force_; }
  /// What a motion that goes on needs of the forces last found, 5 numbers per particle: forces, their viscous
  /// part and the rate of the density's diffusion.
  void append_forces(std::vector<double>& values) const;
  void set_forces(std::span<const double> values);

  /// Of the state last measured, 2 per particle.
  [[nodiscard]] const std::vector<double>& density_gradient() const { return density_gradient_; }
  /// With moving least squares, the degree of each particle in the state last measured; empty without.
  [[nodiscard]] const std::vector<std::uint8_t>& degrees() const { return degree_; }

  /// How many have degree 0, 1 and 2, likewise: forces that are set bring none.
  [[nodiscard]] std::array<double, 3> degree_counts() const;

  [[nodiscard]] double energy(std::span<const double> density) const;  // [J/m]
  /// Taken by the density diffusion in the steps since the last call [J/m].
  [[nodiscard]] double diffusion_work();
  [[nodiscard]] double pressure(std::size_t i, double density) const {
    return settings_.materials[member_[i]].pressure(density);
  }
  /// Longest stable step of a state [s] for a Courant number of 1.
  [[nodiscard]] double stable_step(std::span<const double> velocity, std::span<const double> density) const;
  [[nodiscard]] const MovingNeighbours& neighbours() const { return neighbours_; }
  [[nodiscard]] double mass(std::size_t i) const { return mass_[i]; }
  /// Elastic, per mass [J/kg].
  [[nodiscard]] double energy_of(std::size_t i, double density) const {
    return settings_.materials[member_[i]].energy(density);
  }

private:
  /// Of the gradients: corrected kernel, or moving least squares.
  struct Corrected;
  template <int Degree, bool Full>
  struct Fitted;
  template <class Gradients>
  static auto make_fit();
  template <class Gradients>
  void prepare(Gradients);
  template <class Gradients>
  std::int64_t measure_with(const double* x, const double* v, double time_step, double* density);
  template <class Gradients>
  void find_forces_with(const double* x, const double* v, std::span<const double> density);
  template <bool Riemann, class Gradients>
  void find_forces_variant(const double* x, const double* v, std::span<const double> density);
  template <bool Variable, class Gradients>
  std::int64_t measure_variant(const double* x, const double* v, double time_step, double* density);
  /// Calls `work` with the gradients that the settings name.
  template <class Work>
  auto with_gradients(Work&& work);

  FluidSettings settings_;
  std::vector<double> mass_;
  std::vector<std::uint8_t> member_;
  MovingNeighbours neighbours_;
  std::size_t first_bad_ = 0;
  bool dissipative_ = false, diffusive_ = false, viscous_ = false, riemann_ = false;
  double reference_ = 0;                     // H of the undisturbed lattice times spacing^2
  std::vector<double> weight_;               // F of every pair [1/m4]
  std::vector<double> value_;                // W of every pair [1/m2]; empty without moving least squares
  std::vector<double> fit_;                  // coefficients of MovingFit, likewise
  std::vector<std::uint8_t> degree_;         // likewise
  std::array<double, 2> lattice_support_{};  // of the undisturbed lattice, for degrees 1 and 2
  std::vector<double> diameter_;             // [m]
  std::vector<double> fresh_density_;
  std::vector<double> stress_;            // V S H^-1 (moving least squares: V S), 4 per particle
  std::vector<double> viscous_stress_;    // its viscous part; empty without viscosity
  std::vector<double> support_;           // V tr(H^-1) / 2; empty without Riemann problems
  std::vector<double> density_gradient_;  // 2 per particle
  std::vector<double> diffusion_rate_;    // of the density [kg/m3/s]
  std::vector<double> lost_;              // by diffusion in the last step [J/m]
  std::vector<double> force_, viscous_force_;
  double diffusion_work_ = 0;
  // What pairs of two members dissipate by, the mean of both: action and reaction are the same.
  struct Dissipation {
    double linear, quadratic;  // alpha c h [m2/s], beta h^2 [m2]
    double sound_speed, limiter;
    bool riemann;  // between particles that both have it
  };
  std::vector<Dissipation> dissipation_;  // of every member with every member
};

}  // namespace estuary::solid
