// Elastic laws of the plane: first Piola-Kirchhoff stress P [Pa] from the deformation gradient F.
//
// Each law is a small value type with its constants; kernels take it as a template argument. The stress is
// written for any number type, so that `Dual` numbers give the exact tangent dP/dF. In plane stress the
// out-of-plane strain of the two laws linear in their strain is eliminated by lambda' = 2 lambda mu / (lambda
// + 2 mu); the neo-Hookean ones find the stretch across the plane from no stress there. Sources: Bonet &
// Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, ch. 6.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "tensor.hpp"

namespace estuary::solid {

enum class Plane { strain, stress };

/// Law of a scene by name; laws.hpp and plasticity.hpp hold them.
enum class LawName { saint_venant_kirchhoff, hooke_almansi, neo_hooke, neo_hooke_isochoric, j2_plasticity };

/// Lame's constants [Pa] as they act in the plane.
struct ElasticConstants {
  double lambda = 0;
  double mu = 0;
  /// Lambda for the stress across the plane; 0 in plane stress, where that stress vanishes.
  double lambda_across = 0;
  /// No number above tells: without Poisson's effect they are those of plane strain, where laws whose volume
  /// resists by itself still carry stress across.
  Plane plane = Plane::strain;

  static ElasticConstants from(double young_modulus, double poisson_ratio, Plane plane) {
    const double mu = young_modulus / (2 * (1 + poisson_ratio));
    const double lambda = young_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
    if (plane == Plane::strain) return {lambda, mu, lambda, plane};
    return {2 * lambda * mu / (lambda + 2 * mu), mu, 0, plane};
  }
  /// Modulus of a plane compression wave, rho c^2 [Pa].
  [[nodiscard]] double wave_modulus() const { return lambda + 2 * mu; }
  /// Modulus of a bar in the plane, E in plane stress and E / (1 - nu^2) in plane strain [Pa].
  [[nodiscard]] double bar_modulus() const { return 4 * mu * (lambda + mu) / (lambda + 2 * mu); }
  /// What stabilisation is measured by: the wave modulus, but no more than 4 mu, so that a nearly
  /// incompressible body does not lock (they are equal at a Poisson ratio of 1/3 in plane strain).
  [[nodiscard]] double stabilisation_modulus() const { return std::min(wave_modulus(), 4 * mu); }
  [[nodiscard]] bool plane_stress() const { return plane == Plane::stress; }
  /// Lambda of the solid itself, before plane stress changes it.
  [[nodiscard]] double solid_lambda() const {
    return plane_stress() ? 2 * mu * lambda / (2 * mu - lambda) : lambda;
  }
};

/// Root of an ascending function by Newton's method from `y`; `f` returns value and slope.
template <class Function>
double ascending_root(double y, Function&& f) {
  for (int iteration = 0; iteration < 60; ++iteration) {
    const auto [value, slope] = f(y);
    // No step changes the logarithm of a stretch by more than this.
    const double step = std::clamp(-value / slope, -1.0, 1.0);
    y += step;
    if (!(std::abs(step) > 1e-14)) break;
  }
  return y;
}

/// S = lambda tr(E) I + 2 mu E between second Piola-Kirchhoff stress and Green-Lagrange strain.
struct SaintVenantKirchhoff {
  static constexpr const char* name = "svk";
  static constexpr bool hyperelastic = true;
  static constexpr std::size_t history_size = 0;
  ElasticConstants constants;

  template <class T>
  Tensor<T> first_piola_kirchhoff(const Tensor<T>& f) const {
    const T exx = (f.xx * f.xx + f.yx * f.yx - 1.0) * 0.5;
    const T eyy = (f.xy * f.xy + f.yy * f.yy - 1.0) * 0.5;
    const T two_exy = f.xx * f.xy + f.yx * f.yy;
    const T pressure_part = (exx + eyy) * constants.lambda;
    const T sxx = pressure_part + exx * (2 * constants.mu);
    const T syy = pressure_part + eyy * (2 * constants.mu);
    const T sxy = two_exy * constants.mu;
    return {f.xx * sxx + f.xy * sxy, f.xx * sxy + f.xy * syy, f.yx * sxx + f.yy * sxy,
            f.yx * sxy + f.yy * syy};
  }
  /// Elastic energy per reference volume [J/m3].
  [[nodiscard]] double energy_density(const Tensor<double>& f) const {
    const double exx = (f.xx * f.xx + f.yx * f.yx - 1) * 0.5;
    const double eyy = (f.xy * f.xy + f.yy * f.yy - 1) * 0.5;
    const double exy = (f.xx * f.xy + f.yx * f.yy) * 0.5;
    return 0.5 * constants.lambda * (exx + eyy) * (exx + eyy) +
           constants.mu * (exx * exx + eyy * eyy + 2 * exy * exy);
  }
  /// Stretch across the plane: 1 in plane strain; in plane stress what no stress there asks for.
  [[nodiscard]] double stretch_across(const Tensor<double>& f) const {
    if (!constants.plane_stress()) return 1;
    const double trace = 0.5 * (f.xx * f.xx + f.yx * f.yx + f.xy * f.xy + f.yy * f.yy - 2);
    return std::sqrt(std::max(1e-6, 1 - constants.lambda / constants.mu * trace));
  }
  /// Cauchy stress across the plane [Pa].
  [[nodiscard]] double stress_across(const Tensor<double>& f) const {
    const double trace = 0.5 * (f.xx * f.xx + f.yx * f.yx + f.xy * f.xy + f.yy * f.yy - 2);
    return constants.lambda_across * trace / determinant(f);
  }
};

/// sigma = lambda tr(e) I + 2 mu e between Cauchy stress and Euler-Almansi strain. It has no energy function;
/// what is given as its energy is J sigma : e / 2, right to third order in the strain.
struct HookeAlmansi {
  static constexpr const char* name = "hooke-almansi";
  static constexpr bool hyperelastic = false;
  static constexpr std::size_t history_size = 0;
  ElasticConstants constants;

  template <class T>
  [[nodiscard]] static Tensor<T> almansi_strain(const Tensor<T>& f) {
    const T j = determinant(f);
    const T ixx = f.yy / j, ixy = -f.xy / j, iyx = -f.yx / j, iyy = f.xx / j;
    const T cxx = ixx * ixx + iyx * iyx, cyy = ixy * ixy + iyy * iyy, cxy = ixx * ixy + iyx * iyy;
    const T exy = cxy * -0.5;
    return {(1.0 - cxx) * 0.5, exy, exy, (1.0 - cyy) * 0.5};
  }
  template <class T>
  [[nodiscard]] Tensor<T> cauchy(const Tensor<T>& f) const {
    const Tensor<T> e = almansi_strain(f);
    const T pressure_part = (e.xx + e.yy) * constants.lambda;
    return {pressure_part + e.xx * (2 * constants.mu), e.xy * (2 * constants.mu), e.yx * (2 * constants.mu),
            pressure_part + e.yy * (2 * constants.mu)};
  }
  template <class T>
  Tensor<T> first_piola_kirchhoff(const Tensor<T>& f) const {
    return product(cauchy(f), cofactor(f));
  }
  [[nodiscard]] double energy_density(const Tensor<double>& f) const {
    return 0.5 * determinant(f) * contraction(cauchy(f), almansi_strain(f));
  }
  // The thesis's law in the plane: areas change, the thickness does not.
  [[nodiscard]] static double stretch_across(const Tensor<double>&) { return 1; }
  [[nodiscard]] double stress_across(const Tensor<double>& f) const {
    const Tensor<double> e = almansi_strain(f);
    return constants.lambda_across * (e.xx + e.yy);
  }
};

/// Compressible neo-Hooke, P = mu (F - F^-T) + lambda ln J F^-T.
struct NeoHooke {
  static constexpr const char* name = "neo-hooke";
  static constexpr bool hyperelastic = true;
  static constexpr std::size_t history_size = 0;
  ElasticConstants constants;

  template <class T>
  Tensor<T> first_piola_kirchhoff(const Tensor<T>& f) const {
    using std::exp;
    using std::log;
    const T j = determinant(f);
    const Tensor<T> c = cofactor(f);
    T factor;
    if (constants.plane_stress()) {
      // Without stress across, lambda ln J = mu (1 - stretch^2). One more step of Newton's method in `T`
      // brings its derivatives.
      const double lambda = constants.solid_lambda();
      const double y = log_stretch_across(plain(j));
      const double squared = std::exp(2 * y);
      const T log_stretch = y - (constants.mu * (squared - 1) + (log(j) + y) * lambda) *
                                    (1 / (2 * constants.mu * squared + lambda));
      factor = exp(log_stretch * 2.0) * (-constants.mu) / j;
    } else {
      factor = (log(j) * constants.lambda - constants.mu) / j;
    }
    return {f.xx * constants.mu + c.xx * factor, f.xy * constants.mu + c.xy * factor,
            f.yx * constants.mu + c.yx * factor, f.yy * constants.mu + c.yy * factor};
  }
  [[nodiscard]] double energy_density(const Tensor<double>& f) const {
    const double across = stretch_across(f), log_j = std::log(determinant(f) * across);
    return 0.5 * constants.mu * (contraction(f, f) + across * across - 3) - constants.mu * log_j +
           0.5 * constants.solid_lambda() * log_j * log_j;
  }
  [[nodiscard]] double stretch_across(const Tensor<double>& f) const {
    return constants.plane_stress() ? std::exp(log_stretch_across(determinant(f))) : 1;
  }
  [[nodiscard]] double stress_across(const Tensor<double>& f) const {
    const double j = determinant(f);
    return constants.lambda_across * std::log(j) / j;
  }

private:
  // mu (stretch^2 - 1) + lambda ln (j stretch) = 0 for its logarithm.
  [[nodiscard]] double log_stretch_across(double j) const {
    const double lambda = constants.solid_lambda(), log_j = std::log(j);
    return ascending_root(-lambda * log_j / (lambda + 2 * constants.mu), [&](double y) {
      const double squared = std::exp(2 * y);
      return std::pair{constants.mu * (squared - 1) + lambda * (log_j + y),
                       2 * constants.mu * squared + lambda};
    });
  }
};

/// Neo-Hooke split into change of shape and of volume, for nearly incompressible bodies:
///     W = mu / 2 (J^(-2/3) (tr F^T F + 1) - 3) + kappa / 2 ((J^2 - 1) / 2 - ln J)
/// (Simo & Hughes, Computational Inelasticity, ch. 9).
struct NeoHookeIsochoric {
  static constexpr const char* name = "neo-hooke-isochoric";
  static constexpr bool hyperelastic = true;
  static constexpr std::size_t history_size = 0;
  ElasticConstants constants;

  [[nodiscard]] double bulk() const { return constants.solid_lambda() + 2 * constants.mu / 3; }
  template <class T>
  Tensor<T> first_piola_kirchhoff(const Tensor<T>& f) const {
    using std::exp;
    using std::log;
    const T j = determinant(f);
    if (constants.plane_stress()) {
      // Without stress across, what follows the volume is the pressure of shape; see NeoHooke.
      const double y = log_stretch_across(plain(j), plain(contraction(f, f)));
      const double squared = std::exp(2 * y);
      const auto [value, slope] = imbalance<T>(log(j), contraction(f, f), y, squared);
      const T log_stretch = y - value * (1 / plain(slope));
      const T shape = exp((log(j) + log_stretch) * (-2.0 / 3.0)) * constants.mu;
      const T factor = shape * exp(log_stretch * 2.0) * -1.0 / j;
      const Tensor<T> c = cofactor(f);
      return {f.xx * shape + c.xx * factor, f.xy * shape + c.xy * factor, f.yx * shape + c.yx * factor,
              f.yy * shape + c.yy * factor};
    }
    const T shape = exp(log(j) * (-2.0 / 3.0)) * constants.mu;
    const T trace = contraction(f, f) + 1.0;
    const T factor = ((j * j - 1.0) * (0.5 * bulk()) - shape * trace * (1.0 / 3.0)) / j;
    const Tensor<T> c = cofactor(f);
    return {f.xx * shape + c.xx * factor, f.xy * shape + c.xy * factor, f.yx * shape + c.yx * factor,
            f.yy * shape + c.yy * factor};
  }
  [[nodiscard]] double energy_density(const Tensor<double>& f) const {
    const double across = stretch_across(f), j = determinant(f) * across;
    return 0.5 * constants.mu * (std::pow(j, -2.0 / 3.0) * (contraction(f, f) + across * across) - 3) +
           0.5 * bulk() * (0.5 * (j * j - 1) - std::log(j));
  }
  [[nodiscard]] double stretch_across(const Tensor<double>& f) const {
    return constants.plane_stress() ? std::exp(log_stretch_across(determinant(f), contraction(f, f))) : 1;
  }
  [[nodiscard]] double stress_across(const Tensor<double>& f) const {
    if (constants.plane_stress()) return 0;
    const double j = determinant(f), shape = constants.mu * std::pow(j, -5.0 / 3.0);
    return shape * (1 - (contraction(f, f) + 1) / 3) + 0.5 * bulk() * (j - 1 / j);
  }

private:
  // Kirchhoff stress across and its slope over the logarithm y of the stretch there; `trace` is that of F^T F
  // in the plane.
  template <class T>
  [[nodiscard]] std::pair<T, T> imbalance(const T& log_j, const T& trace, double y, double squared) const {
    using std::exp;
    const T shape = exp((log_j + y) * (-2.0 / 3.0)) * constants.mu;
    const T j_squared = exp((log_j + y) * 2.0);
    return {shape * (squared * (2.0 / 3.0) - trace * (1.0 / 3.0)) + (j_squared - 1.0) * (0.5 * bulk()),
            shape * (squared * (8.0 / 9.0) + trace * (2.0 / 9.0)) + j_squared * bulk()};
  }
  [[nodiscard]] double log_stretch_across(double j, double trace) const {
    const double lambda = constants.solid_lambda(), log_j = std::log(j);
    return ascending_root(-lambda * log_j / (lambda + 2 * constants.mu),
                          [&](double y) { return imbalance<double>(log_j, trace, y, std::exp(2 * y)); });
  }
};

/// dP/dF at `f`, rows and columns in the order xx xy yx yy.
template <class Law>
std::array<double, 16> tangent(const Law& law, const Tensor<double>& f) {
  const Tensor<Dual> dual{Dual::variable(f.xx, 0), Dual::variable(f.xy, 1), Dual::variable(f.yx, 2),
                          Dual::variable(f.yy, 3)};
  const Tensor<Dual> p = law.first_piola_kirchhoff(dual);
  std::array<double, 16> a;
  for (std::size_t c = 0; c < 4; ++c) {
    a[c] = p.xx.derivative[c];
    a[4 + c] = p.xy.derivative[c];
    a[8 + c] = p.yx.derivative[c];
    a[12 + c] = p.yy.derivative[c];
  }
  return a;
}

}  // namespace estuary::solid
