// The two sweeps of a step over the reference neighbourhood: stresses from displacements, forces from
// stresses.
//
// The internal force is minus the derivative of the elastic energy sum_i V_i W(F_i) (V the energy volume) +
// E_spring with F_i = I + sum_j (u_j - u_i) (x) g_ij, that is
//     f_i = sum_j (V_i P_i g_ij - V_j P_j g_ji),
// the symmetrised corrected operator of total-Lagrangian SPH (Bonet & Kulasegaram 2000). A function of
// relative positions that is invariant under rotation, it conserves linear and angular momentum whatever the
// weights are.
//
// The stabilisation penalises what a particle's neighbours do beyond its own deformation gradient,
//     E_spring = 1/2 sum_i sum_j k_ij |x_j - x_i - F_i (X_j - X_i)|^2
// (after Ganzenmueller 2015, in energy form): zero for every affine motion, objective, and of the size of the
// neglected curvature, so it vanishes at second order with the spacing.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "laws.hpp"
#include "neighbourhood.hpp"
#include "on_team.hpp"
#include "ordered_sum.hpp"
#include "particles.hpp"
#include "plasticity.hpp"

namespace estuary::solid {

/// Bodies up to this size are swept by one thread: waking others takes longer.
inline constexpr std::size_t kSerialBelow = 1024;

/// Work arrays of the sweeps.
struct Fields {
  std::vector<double> deformation_gradient;  // F, xx xy yx yy per particle
  std::vector<double> stress;                // V (P + spring part) [J/m], 4 per particle
  std::vector<double> force;                 // internal force [N/m], 2 per particle
  std::vector<double> viscous_power;         // taken by artificial viscosity [W/m]; empty without it
  // Share of the stabilisation each particle keeps; empty for laws without history. A particle that has
  // flowed resists less, and the springs would otherwise carry what the law no longer does.
  std::vector<double> spring_share;
  // F of zero displacement, 4 per particle, where bodies are torn (Rupture::base); else null.
  const double* base = nullptr;

  explicit Fields(std::size_t particles)
      : deformation_gradient(4 * particles), stress(4 * particles), force(2 * particles) {}
};

/// Monaghan's artificial viscosity (Monaghan 1992), on the reference neighbourhood.
struct ArtificialViscosity {
  double linear = 0;       // alpha
  double quadratic = 0;    // beta
  double sound_speed = 0;  // [m/s]
  double smoothing_length = 0;
  double density = 0;  // reference [kg/m3]
};

inline Tensor<double> tensor_at(const std::vector<double>& field, std::size_t i) {
  return {field[4 * i], field[4 * i + 1], field[4 * i + 2], field[4 * i + 3]};
}

/// Share of its stabilisation a particle keeps once it has flowed by more than kFlowed.
inline constexpr double kFlowedShare = 0.05;
inline constexpr double kFlowed = 1e-3;

/// First sweep: F and V P at every particle, each by the law of its body. Returns how many particles have J
/// <= 0 or a state that is not finite. `history` (Law::history_size per particle, else null) is that at the
/// increment's start; with Commit it becomes that at its end.
template <class Law, bool Stabilised, bool Commit>
std::int64_t compute_stress(const Body& body, const Neighbourhood& pairs, std::span<const Law> laws,
                            std::span<const double> displacement, Fields& fields, double* history) {
  const double* u = displacement.data();
  const std::uint32_t* neighbour = pairs.neighbour.data();
  const double* gradient = pairs.gradient.data();
  const double* offset = pairs.offset.data();
  const double* spring = pairs.spring.data();
  double* deformation = fields.deformation_gradient.data();
  double* stress = fields.stress.data();
  const std::uint8_t* member = body.member.data();
  const double* base = fields.base;
  [[maybe_unused]] double* spring_share = fields.spring_share.data();
  const std::size_t n = body.size();
  std::int64_t bad = 0;
  on_team(n > kSerialBelow, [&] {
    std::int64_t bad_here = 0;
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      const double ux = u[2 * i], uy = u[2 * i + 1];
      double hxx = 0, hxy = 0, hyx = 0, hyy = 0;
      double mxx = 0, mxy = 0, myx = 0, myy = 0;
      const std::size_t end = pairs.first[i + 1];
      for (std::size_t k = pairs.first[i]; k < end; ++k) {
        const std::size_t j = neighbour[k];
        const double dx = u[2 * j] - ux, dy = u[2 * j + 1] - uy;
        const double gx = gradient[2 * k], gy = gradient[2 * k + 1];
        hxx += dx * gx;
        hxy += dx * gy;
        hyx += dy * gx;
        hyy += dy * gy;
        if constexpr (Stabilised) {
          const double sx = spring[k] * offset[2 * k], sy = spring[k] * offset[2 * k + 1];
          mxx += dx * sx;
          mxy += dx * sy;
          myx += dy * sx;
          myy += dy * sy;
        }
      }
      Tensor<double> f{1 + hxx, hxy, hyx, 1 + hyy};
      if (base != nullptr)
        f = {base[4 * i] + hxx, base[4 * i + 1] + hxy, base[4 * i + 2] + hyx, base[4 * i + 3] + hyy};
      const Law& law = laws[member[i]];
      Tensor<double> p;
      double share = 1;
      if constexpr (Law::history_size > 0) {
        double* own = history + Law::history_size * i;
        p = law.update(f, own, Commit ? own : nullptr).stress;
        if constexpr (Stabilised) share = own[4] > kFlowed ? kFlowedShare : 1.0;
        if constexpr (Stabilised) spring_share[i] = share;
      } else {
        p = law.first_piola_kirchhoff(f);
      }
      const double v = body.energy_volume[i];
      Tensor<double> vp{v * p.xx, v * p.xy, v * p.yx, v * p.yy};
      if constexpr (Stabilised) {
        // The deviations depend on F, and so on g: minus sum_j k_ij (deviation) (x) X_ij acts as a stress.
        const double kxx = pairs.spring_moment[3 * i], kxy = pairs.spring_moment[3 * i + 1],
                     kyy = pairs.spring_moment[3 * i + 2];
        vp.xx -= share * (mxx - (hxx * kxx + hxy * kxy));
        vp.xy -= share * (mxy - (hxx * kxy + hxy * kyy));
        vp.yx -= share * (myx - (hyx * kxx + hyy * kxy));
        vp.yy -= share * (myy - (hyx * kxy + hyy * kyy));
      }
      deformation[4 * i] = f.xx;
      deformation[4 * i + 1] = f.xy;
      deformation[4 * i + 2] = f.yx;
      deformation[4 * i + 3] = f.yy;
      stress[4 * i] = vp.xx;
      stress[4 * i + 1] = vp.xy;
      stress[4 * i + 2] = vp.yx;
      stress[4 * i + 3] = vp.yy;
      // Written so that a NaN counts as bad.
      if (!(determinant(f) > 0) || !std::isfinite(vp.xx + vp.xy + vp.yx + vp.yy)) ++bad_here;
    }
#pragma omp atomic
    bad += bad_here;
  });
  return bad;
}

/// Second sweep: the internal force on every particle, from `fields.stress`. `velocity` is read only when
/// Viscous, `fields.spring_share` only when Shared.
template <bool Stabilised, bool Viscous, bool Shared>
void compute_force(const Body& body, const Neighbourhood& pairs,
                   std::span<const ArtificialViscosity> viscosities, std::span<const double> displacement,
                   std::span<const double> velocity, Fields& fields) {
  const double* u = displacement.data();
  const double* vel = velocity.data();
  const std::uint32_t* neighbour = pairs.neighbour.data();
  const double* reverse = pairs.reverse_gradient.data();
  const double* offset = pairs.offset.data();
  const double* spring = pairs.spring.data();
  const double* deformation = fields.deformation_gradient.data();
  const double* stress = fields.stress.data();
  double* force = fields.force.data();
  const std::size_t n = body.size();
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      const double gx = pairs.gradient_sum[2 * i], gy = pairs.gradient_sum[2 * i + 1];
      double fx = stress[4 * i] * gx + stress[4 * i + 1] * gy;
      double fy = stress[4 * i + 2] * gx + stress[4 * i + 3] * gy;
      const double* fi = deformation + 4 * i;
      [[maybe_unused]] const ArtificialViscosity& viscosity = viscosities[body.member[i]];
      [[maybe_unused]] double taken = 0;
      const std::size_t end = pairs.first[i + 1];
      for (std::size_t k = pairs.first[i]; k < end; ++k) {
        const std::size_t j = neighbour[k];
        const double rx = reverse[2 * k], ry = reverse[2 * k + 1];
        const double* sj = stress + 4 * j;
        fx -= sj[0] * rx + sj[1] * ry;
        fy -= sj[2] * rx + sj[3] * ry;
        if constexpr (Stabilised || Viscous) {
          const double* fj = deformation + 4 * j;
          const double ox = offset[2 * k], oy = offset[2 * k + 1];
          const double dx = u[2 * j] - u[2 * i], dy = u[2 * j + 1] - u[2 * i + 1];
          if constexpr (Stabilised) {
            if constexpr (Shared) {
              const double a = fields.spring_share[i], b = fields.spring_share[j];
              fx += spring[k] *
                    ((a + b) * (dx + ox) - (a * fi[0] + b * fj[0]) * ox - (a * fi[1] + b * fj[1]) * oy);
              fy += spring[k] *
                    ((a + b) * (dy + oy) - (a * fi[2] + b * fj[2]) * ox - (a * fi[3] + b * fj[3]) * oy);
            } else {
              fx += spring[k] * (2 * (dx + ox) - (fi[0] + fj[0]) * ox - (fi[1] + fj[1]) * oy);
              fy += spring[k] * (2 * (dy + oy) - (fi[2] + fj[2]) * ox - (fi[3] + fj[3]) * oy);
            }
          }
          if constexpr (Viscous) {
            // P_v = J Pi F^-T on both sides, its resultant taken along the line of centres: no moment.
            const double x = ox + dx, y = oy + dy;
            const double approach = (vel[2 * j] - vel[2 * i]) * x + (vel[2 * j + 1] - vel[2 * i + 1]) * y;
            if (approach < 0) {
              const double h = viscosity.smoothing_length, r2 = x * x + y * y;
              const double phi = h * approach / (r2 + 0.01 * h * h);
              const double volume_ratio =
                  0.5 * (fi[0] * fi[3] - fi[1] * fi[2] + fj[0] * fj[3] - fj[1] * fj[2]);
              const double pi =
                  (-viscosity.linear * viscosity.sound_speed * phi + viscosity.quadratic * phi * phi) *
                  volume_ratio / viscosity.density;
              const double qx = 0.5 * ((fi[3] + fj[3]) * ox - (fi[2] + fj[2]) * oy);
              const double qy = 0.5 * ((fi[0] + fj[0]) * oy - (fi[1] + fj[1]) * ox);
              const double push = pairs.viscous_weight[k] * pi * (qx * x + qy * y) / r2;
              fx -= push * x;
              fy -= push * y;
              taken -= 0.5 * push * approach;  // the other particle of the pair counts the other half
            }
          }
        }
      }
      force[2 * i] = fx;
      force[2 * i + 1] = fy;
      if constexpr (Viscous) fields.viscous_power[i] = taken;
    }
  });
}

/// Elastic energy [J/m], of the state the last `compute_stress` saw; with what the increment since `history`
/// dissipates.
template <class Law, bool Stabilised>
double internal_energy(const Body& body, const Neighbourhood& pairs, std::span<const Law> laws,
                       std::span<const double> displacement, const Fields& fields, const double* history) {
  return ordered_sum(body.size(), [&](std::size_t i) {
    const Tensor<double> f = tensor_at(fields.deformation_gradient, i);
    const Law& law = laws[body.member[i]];
    double energy = body.energy_volume[i], share = 1;
    if constexpr (Law::history_size > 0) {
      energy *= law.energy_density(f, history + Law::history_size * i);
      if constexpr (Stabilised) share = fields.spring_share[i];
    } else {
      energy *= law.energy_density(f);
    }
    if constexpr (Stabilised) {
      for (std::size_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k) {
        const std::size_t j = pairs.neighbour[k];
        const double ox = pairs.offset[2 * k], oy = pairs.offset[2 * k + 1];
        const double x = ox + displacement[2 * j] - displacement[2 * i] - f.xx * ox - f.xy * oy;
        const double y = oy + displacement[2 * j + 1] - displacement[2 * i + 1] - f.yx * ox - f.yy * oy;
        energy += 0.5 * share * pairs.spring[k] * (x * x + y * y);
      }
    }
    return energy;
  });
}

}  // namespace estuary::solid
