// Reference neighbour lists with their gradient weights, built once: total-Lagrangian SPH.
//
// Displacement gradient at particle i: sum_j (u_j - u_i) (x) g_ij. With the linear correction
//     g_ij = K_i^-1 grad W_ij,   K_i = sum_j (X_j - X_i) (x) grad W_ij
// (Randles & Libersky 1996; Bonet & Lok 1999); this is the gradient of the least-squares linear fit with
// weights |W'| / R (V_j is one value for all but the half cells on a clamp, and left out). The quadratic
// correction makes the same weights exact for quadratic fields as far as the neighbourhood allows, and widens
// it at edges to allow more.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "kernel_function.hpp"
#include "particles.hpp"
#include "reproducing_weights.hpp"

namespace estuary::solid {

/// Compressed rows: the pairs of particle i are first[i] .. first[i+1]-1. The pattern is symmetric. In a
/// narrow periodic body a pair of particles may occur more than once, with different images.
struct Neighbourhood {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> neighbour;
  std::vector<double> gradient;  // g_ij [1/m], 2 per pair
  std::vector<double>
      reverse_gradient;              // g_ji of the same pair, so that forces are gathered, never scattered
  std::vector<double> gradient_sum;  // sum_j g_ij, 2 per particle
  std::vector<double> offset;        // X_j - X_i [m], 2 per pair (nearest image when periodic)
  // Stabilisation against modes the gradient does not see; empty when off.
  std::vector<double> spring;         // k_ij = k_ji [N/m2 per pair, i.e. J/m of depth per m2]
  std::vector<double> spring_moment;  // sum_j k_ij X_ij (x) X_ij: xx xy yy per particle
  // Artificial viscosity; empty when off.
  std::vector<double> viscous_weight;  // m_i m_j |W'| / R, one per pair
  std::size_t incomplete = 0;          // particles whose quadratic terms were not all resolved

  [[nodiscard]] std::size_t pairs() const { return neighbour.size(); }
};

struct NeighbourhoodOptions {
  Order order = Order::linear;
  /// Stabilisation modulus of each body [Pa]; empty leaves it out.
  std::vector<double> spring_modulus;
  Kernel kernel = Kernel::cubic_spline;
  bool viscous = false;
};

/// Throws std::domain_error, naming the particle, when a particle has too few neighbours for a gradient.
Neighbourhood build_neighbourhood(const Body& body, const NeighbourhoodOptions& options);

/// Particles (not stress points) within `radius` of a point, with the vector from the point to (the nearest
/// image of) each.
class ReferenceSearch {
public:
  struct Found {
    std::uint32_t particle = 0;
    double x = 0, y = 0;
  };
  ReferenceSearch(const Body& body, double cell);
  /// In ascending order of particle, then of x; every periodic image within the radius counts.
  [[nodiscard]] std::vector<Found> within(double x, double y, double radius) const;

private:
  const Body& body_;
  double cell_;
  double period_;
  double origin_[2];
  std::int64_t cells_[2];
  std::vector<std::vector<std::uint32_t>> content_;
};

}  // namespace estuary::solid
