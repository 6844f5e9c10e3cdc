// Elasto-plasticity of metals at finite strain: von Mises yield, isotropic hardening, damage, strain rate.
//
// F = F_e F_p; elastic law of Hencky, tau = kappa tr(e) I + 2 mu dev(e) with e = 1/2 ln b_e; radial return in
// principal logarithmic strains (Simo 1992; Simo & Hughes, Computational Inelasticity, ch. 9), exact for
// rotations and for the out-of-plane strain of plane strain. In plane stress the stretch across the plane is
// found from tau_zz = 0. Yield stress: piecewise linear in the equivalent plastic strain, times the rate
// factor of Cowper & Symonds (1957). Damage: effective stress (Kachanov 1958; Lemaitre 1985), growing
// linearly with plastic strain between two given values.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "laws.hpp"

namespace estuary::solid {

struct Plasticity {
  /// Yield stress [Pa] over equivalent plastic strain, ascending from 0; beyond the last point the last slope
  /// goes on. Empty: elastic.
  std::vector<double> strain, yield;
  /// Cowper & Symonds: yield times 1 + (rate / reference_rate)^(1 / rate_exponent); off when reference_rate
  /// is 0.
  double reference_rate = 0;  // [1/s]
  double rate_exponent = 1;
  /// Damage grows from 0 at `damage_from` to `damage_limit` at `damage_to`; off when damage_limit is 0.
  double damage_from = 0, damage_to = 0, damage_limit = 0;

  /// Static yield stress and its slope.
  [[nodiscard]] double at(double alpha, double& slope) const {
    if (strain.size() < 2) {
      slope = 0;
      return yield.empty() ? std::numeric_limits<double>::infinity() : yield.front();
    }
    std::size_t k = 0;
    while (k + 2 < strain.size() && alpha >= strain[k + 1]) ++k;
    slope = (yield[k + 1] - yield[k]) / (strain[k + 1] - strain[k]);
    return yield[k] + slope * (alpha - strain[k]);
  }
  /// What flow from one plastic strain to another dissipates [J/m3]: the static yield stress times what
  /// damage leaves of it, integrated exactly over every kink of both.
  [[nodiscard]] double dissipation(double from, double to) const;
  [[nodiscard]] double damage(double alpha) const {
    if (!(damage_limit > 0) || alpha <= damage_from) return 0;
    return damage_limit * std::min(1.0, (alpha - damage_from) / (damage_to - damage_from));
  }
};

struct J2Plasticity {
  static constexpr const char* name = "j2";
  static constexpr bool hyperelastic = true;  // each increment has a potential, so the tangent is symmetric
  /// C_p^-1 (xx xy yy zz), equivalent plastic strain, damage, work dissipated [J/m3].
  static constexpr std::size_t history_size = 7;
  static constexpr std::array<double, history_size> kRest{1, 0, 1, 1, 0, 0, 0};

  double mu = 0, bulk = 0;
  Plane plane = Plane::strain;
  const Plasticity* plasticity = nullptr;
  double time_step = 0;  // [s]; 0 leaves strain rate out

  struct Result {
    Tensor<double> stress;  // first Piola-Kirchhoff
    double stored = 0;      // elastic energy per reference volume
    double dissipated = 0;  // in this increment
    double across = 0;      // Cauchy stress across the plane
    double stretch = 1;     // across the plane
    bool plastic = false;
  };

  /// From the history at the increment's start; `next`, when given, receives that at its end.
  Result update(const Tensor<double>& f, const double* history, double* next) const;

  [[nodiscard]] Tensor<double> first_piola_kirchhoff(const Tensor<double>& f, const double* history) const {
    return update(f, history, nullptr).stress;
  }
  /// Elastic energy and what the increment dissipates.
  [[nodiscard]] double energy_density(const Tensor<double>& f, const double* history) const {
    const Result result = update(f, history, nullptr);
    return result.stored + result.dissipated;
  }
  [[nodiscard]] double stretch_across(const Tensor<double>& f, const double* history) const {
    return update(f, history, nullptr).stretch;
  }
  [[nodiscard]] double stress_across(const Tensor<double>& f, const double* history) const {
    return update(f, history, nullptr).across;
  }

private:
  struct Returned {
    std::array<double, 3> strain{};  // elastic logarithmic, in plane twice and across
    double gamma = 0, equivalent = 0, yield = 0;
  };
  Returned return_map(std::array<double, 3> trial, double alpha) const;
};

/// dP/dF by central differences.
std::array<double, 16> tangent(const J2Plasticity& law, const Tensor<double>& f, const double* history);

}  // namespace estuary::solid
