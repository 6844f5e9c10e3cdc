#include "fluid.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <utility>

#include "internal_force.hpp"
#include "kernel_function.hpp"
#include "moving_fit.hpp"
#include "on_team.hpp"

namespace estuary::solid {
namespace {

// Least stiffness H may have across its weaker direction, of the undisturbed lattice's: a particle at a
// corner keeps its exact gradient, spray falls back to the uncorrected one.
constexpr double kLeastSupport = 0.2;
// A particle that has lost its neighbours keeps at least this share of its density.
constexpr double kLeastDensity = 0.05;
// Diameters beyond this share of the spacing do not widen the kernel further.
constexpr double kWidest = 1.3;

// W(r) of the cubic spline, from s = r / h and 1 / h^2.
inline double value_at(double s, double inverse_h2) {
  constexpr double kScale = 15.0 / (7.0 * std::numbers::pi);
  if (s < 1) return kScale * inverse_h2 * (2.0 / 3.0 - s * s * (1 - 0.5 * s));
  const double t = 2 - s;
  return kScale / 6 * inverse_h2 * t * t * t;
}

// -W'(r) / r of the cubic spline, up to a factor, from s = r / h and 1 / h^4.
inline double slope_over_distance(double s, double inverse_h4) {
  constexpr double kScale = 15.0 / (7.0 * std::numbers::pi);
  if (s < 1) return kScale * inverse_h4 * (2 - 1.5 * s);
  const double t = 2 - s;
  return 0.5 * kScale * inverse_h4 * t * t / s;
}

}  // namespace

struct Fluid::Corrected {
  static constexpr bool fitted = false;
};
template <int Degree, bool Full>
struct Fluid::Fitted {
  static constexpr bool fitted = true;
  using Fit = MovingFit<Degree, Full>;
};

template <class Gradients>
auto Fluid::make_fit() {
  if constexpr (Gradients::fitted)
    return typename Gradients::Fit{};
  else
    return 0;
}

template <class Work>
auto Fluid::with_gradients(Work&& work) {
  switch (settings_.gradients) {
    case Order::mls_linear:
      return work(Fitted<1, true>{});
    case Order::mls_linear_diffuse:
      return work(Fitted<1, false>{});
    case Order::mls_quadratic:
      return work(Fitted<2, true>{});
    case Order::mls_quadratic_diffuse:
      return work(Fitted<2, false>{});
    default:
      return work(Corrected{});
  }
}

Fluid::Fluid(FluidSettings settings, std::vector<double> mass, std::vector<std::uint8_t> member)
    : settings_(std::move(settings)),
      mass_(std::move(mass)),
      member_(std::move(member)),
      neighbours_(2 * settings_.smoothing_ratio * settings_.spacing, 0.25 * settings_.spacing),
      diameter_(mass_.size(), settings_.spacing),
      stress_(4 * mass_.size()),
      density_gradient_(2 * mass_.size()),
      diffusion_rate_(mass_.size(), 0.0),
      lost_(mass_.size(), 0.0),
      force_(2 * mass_.size()),
      viscous_force_(2 * mass_.size()) {
  for (const FluidMaterial& material : settings_.materials) {
    dissipative_ = dissipative_ || material.linear > 0 || material.quadratic > 0;
    diffusive_ = diffusive_ || material.diffusion > 0;
    viscous_ = viscous_ || material.viscosity > 0;
    riemann_ = riemann_ || material.riemann;
  }
  dissipative_ = dissipative_ || riemann_;
  diffusive_ = diffusive_ || riemann_;
  if (riemann_) support_.resize(mass_.size());
  if (viscous_) viscous_stress_.resize(4 * mass_.size());
  const double h = settings_.smoothing_ratio * settings_.spacing;
  for (const FluidMaterial& a : settings_.materials)
    for (const FluidMaterial& b : settings_.materials)
      dissipation_.push_back({.linear = 0.5 * (a.linear * a.sound_speed + b.linear * b.sound_speed) * h,
                              .quadratic = 0.5 * (a.quadratic + b.quadratic) * h * h,
                              .sound_speed = 0.5 * (a.sound_speed + b.sound_speed),
                              .limiter = 0.5 * (a.limiter + b.limiter),
                              .riemann = a.riemann && b.riemann});
  for (int a = -4; a <= 4; ++a)
    for (int b = -4; b <= 4; ++b) {
      const double x = a * settings_.spacing, r = settings_.spacing * std::hypot(a, b);
      if (r > 0 && r < 2 * h) reference_ += slope_over_distance(r / h, std::pow(h, -4)) * x * x;
    }
  reference_ *= settings_.spacing * settings_.spacing;
  with_gradients([this](auto gradients) { prepare(gradients); });
}

template <class Gradients>
void Fluid::prepare(Gradients) {
  if constexpr (Gradients::fitted) {
    typename Gradients::Fit fit;
    const double ratio = settings_.smoothing_ratio;
    for (int a = -4; a <= 4; ++a)
      for (int b = -4; b <= 4; ++b) {
        const double s = std::hypot(a, b) / ratio, h = ratio * settings_.spacing;
        if (s < 2) fit.add(value_at(s, 1 / (h * h)), 0, a, b);
      }
    const auto support = fit.decompose();
    lattice_support_ = {support.linear, support.curved};
    fit_.resize(Gradients::Fit::numbers * size());
    degree_.resize(size());
  }
}

template <bool Variable, class Gradients>
std::int64_t Fluid::measure_variant(const double* x, const double* v, double time_step, double* density) {
  const std::size_t n = size();
  const std::uint32_t* first = neighbours_.first().data();
  const std::uint32_t* neighbour = neighbours_.neighbour().data();
  const double ratio = settings_.smoothing_ratio, spacing = settings_.spacing;
  const double constant_inverse = 1 / (ratio * spacing), constant_inverse4 = std::pow(constant_inverse, 4);
  const double support2 = 4 * ratio * ratio * spacing * spacing;
  const double* diameter = diameter_.data();
  std::int64_t bad = 0;
  first_bad_ = n;
  double* fresh = fresh_density_.data();  // neighbours read the density at the step's start
  on_team(n > kSerialBelow, [&] {
    std::int64_t bad_here = 0;
    std::size_t first_here = n;
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      const double xi = x[2 * i], yi = x[2 * i + 1], vx = v[2 * i], vy = v[2 * i + 1], rho = density[i];
      double hxx = 0, hxy = 0, hyy = 0, lxx = 0, lxy = 0, lyx = 0, lyy = 0, gx = 0, gy = 0;
      [[maybe_unused]] auto fit = make_fit<Gradients>();
      for (std::uint32_t k = first[i]; k < first[i + 1]; ++k) {
        const std::uint32_t j = neighbour[k];
        const double dx = x[2 * j] - xi, dy = x[2 * j + 1] - yi, r2 = dx * dx + dy * dy;
        double inverse = constant_inverse, inverse4 = constant_inverse4, limit = support2;
        if constexpr (Variable) {
          const double h = 0.5 * ratio * (diameter[i] + diameter[j]);
          limit = 4 * h * h;
        }
        if (!(r2 < limit) || !(r2 > 0)) {
          weight_[k] = 0;
          continue;
        }
        if constexpr (Variable) {
          inverse = 2 / (ratio * (diameter[i] + diameter[j]));
          inverse4 = inverse * inverse * inverse * inverse;
        }
        const double w = slope_over_distance(std::sqrt(r2) * inverse, inverse4);
        weight_[k] = w;
        const double wx = w * dx, wy = w * dy;
        hxx += wx * dx;
        hxy += wx * dy;
        hyy += wy * dy;
        if constexpr (Gradients::fitted) {
          value_[k] = value_at(std::sqrt(r2) * inverse, inverse * inverse);
          fit.add(value_[k], w * spacing * spacing, dx / spacing, dy / spacing);
          continue;
        }
        const double ux = v[2 * j] - vx, uy = v[2 * j + 1] - vy;
        lxx += ux * wx;
        lxy += ux * wy;
        lyx += uy * wx;
        lyy += uy * wy;
        const double step = density[j] - rho;
        gx += step * wx;
        gy += step * wy;
      }
      const double mean = 0.5 * (hxx + hyy), spread = std::hypot(0.5 * (hxx - hyy), hxy);
      const double least = kLeastSupport * reference_ / (diameter[i] * diameter[i]);
      const double more = std::max(0.0, least - (mean - spread));
      hxx += more;
      hyy += more;
      const double d = 1 / (hxx * hyy - hxy * hxy), ixx = d * hyy, ixy = -d * hxy, iyy = d * hxx;
      double axx = lxx * ixx + lxy * ixy, axy = lxx * ixy + lxy * iyy, ayx = lyx * ixx + lyy * ixy,
             ayy = lyx * ixy + lyy * iyy;
      density_gradient_[2 * i] = gx * ixx + gy * ixy;
      density_gradient_[2 * i + 1] = gx * ixy + gy * iyy;
      // What the stress is multiplied by: of corrected kernels H^-1 comes from both ends, of a fit the pair
      // has its own gradients.
      double txx = ixx, txy = ixy, tyy = iyy;
      if constexpr (Gradients::fitted) {
        using Fit = typename Gradients::Fit;
        const double own = 1 / (ratio * diameter[i]), size = diameter[i] / spacing;
        fit.add(value_at(0, own * own), 0, 0, 0);
        const int degree =
            Fit::degree_of(fit.decompose(), {lattice_support_[0], lattice_support_[1] * size * size});
        degree_[i] = static_cast<std::uint8_t>(degree);
        double* shape = &fit_[Fit::numbers * i];
        fit.solve(degree, shape);
        axx = axy = ayx = ayy = gx = gy = 0;
        for (std::uint32_t k = first[i]; k < first[i + 1]; ++k) {
          if (weight_[k] == 0) continue;
          const std::uint32_t j = neighbour[k];
          const auto g = Fit::gradient(shape, value_[k], weight_[k] * spacing * spacing,
                                       (x[2 * j] - xi) / spacing, (x[2 * j + 1] - yi) / spacing);
          const double sx = g[0] / spacing, sy = g[1] / spacing, ux = v[2 * j] - vx, uy = v[2 * j + 1] - vy,
                       step = density[j] - rho;
          axx += ux * sx;
          axy += ux * sy;
          ayx += uy * sx;
          ayy += uy * sy;
          gx += step * sx;
          gy += step * sy;
        }
        density_gradient_[2 * i] = gx;
        density_gradient_[2 * i + 1] = gy;
        txx = tyy = 1;
        txy = 0;
      }
      const FluidMaterial& material = settings_.materials[member_[i]];
      const double change = (1 - time_step * axx) * (1 - time_step * ayy) - time_step * time_step * axy * ayx;
      const double moved = std::max(rho * change, kLeastDensity * material.density);
      const double now =
          diffusive_ ? std::max(moved + time_step * diffusion_rate_[i], kLeastDensity * material.density)
                     : moved;
      if (diffusive_) lost_[i] = mass_[i] * (material.energy(moved) - material.energy(now));
      fresh[i] = now;
      const double p = material.pressure(now), volume = mass_[i] / now;
      double* t = &stress_[4 * i];
      t[0] = -volume * p * txx;
      t[1] = t[2] = -volume * p * txy;
      t[3] = -volume * p * tyy;
      if (riemann_) support_[i] = 0.5 * volume * (ixx + iyy);
      if (viscous_) {
        const double m = volume * material.viscosity, sxx = 2 * m * axx, sxy = m * (axy + ayx),
                     syy = 2 * m * ayy;
        double* s = &viscous_stress_[4 * i];
        s[0] = sxx * txx + sxy * txy;
        s[1] = sxx * txy + sxy * tyy;
        s[2] = sxy * txx + syy * txy;
        s[3] = sxy * txy + syy * tyy;
      }
      // Written so that a NaN counts as bad.
      if (!(std::isfinite(p + axx + ayy + xi + yi) && change > 0)) {
        ++bad_here;
        first_here = std::min(first_here, i);
      }
    }
#pragma omp atomic
    bad += bad_here;
    if (bad_here > 0) {
      const std::atomic_ref<std::size_t> first_of_all(first_bad_);
      std::size_t so_far = first_of_all.load();
      while (first_here < so_far && !first_of_all.compare_exchange_weak(so_far, first_here)) {
      }
    }
  });
  return bad;
}

template <class Gradients>
std::int64_t Fluid::measure_with(const double* x, const double* v, double time_step, double* density) {
  return settings_.variable_smoothing ? measure_variant<true, Gradients>(x, v, time_step, density)
                                      : measure_variant<false, Gradients>(x, v, time_step, density);
}

std::int64_t Fluid::measure(std::span<const double> position, std::span<const double> velocity,
                            double time_step, std::vector<double>& density) {
  const std::size_t n = size();
  if (n == 0) return 0;
  if (settings_.variable_smoothing) {
    double widest = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double rest = settings_.materials[member_[i]].density;
      diameter_[i] = settings_.spacing * std::min(kWidest, std::sqrt(rest / density[i]));
      widest = std::max(widest, diameter_[i]);
    }
    neighbours_.need_reach(2 * settings_.smoothing_ratio * widest);
  }
  if (neighbours_.update(position)) {
    weight_.resize(neighbours_.neighbour().size());
    if (!degree_.empty()) value_.resize(weight_.size());
  }
  fresh_density_.resize(n);
  const std::int64_t bad = with_gradients([&](auto gradients) {
    return measure_with<decltype(gradients)>(position.data(), velocity.data(), time_step, density.data());
  });
  density.swap(fresh_density_);
  if (diffusive_ && time_step > 0) diffusion_work_ += ordered_sum(n, [&](std::size_t i) { return lost_[i]; });
  return bad;
}

void Fluid::find_forces(std::span<const double> position, std::span<const double> velocity,
                        std::span<const double> density) {
  with_gradients([&](auto gradients) {
    find_forces_with<decltype(gradients)>(position.data(), velocity.data(), density);
  });
}

template <class Gradients>
void Fluid::find_forces_with(const double* x, const double* v, std::span<const double> density) {
  if (riemann_)
    find_forces_variant<true, Gradients>(x, v, density);
  else
    find_forces_variant<false, Gradients>(x, v, density);
}

template <bool Riemann, class Gradients>
void Fluid::find_forces_variant(const double* x, const double* v, std::span<const double> density) {
  const std::size_t n = size();
  const std::uint32_t* first = neighbours_.first().data();
  const std::uint32_t* neighbour = neighbours_.neighbour().data();
  const double h = settings_.smoothing_ratio * settings_.spacing;
  [[maybe_unused]] const double spacing = settings_.spacing;
  const bool dissipative = dissipative_, diffusive = diffusive_, viscous = viscous_;
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      const double xi = x[2 * i], yi = x[2 * i + 1], vx = v[2 * i], vy = v[2 * i + 1];
      const double* ti = &stress_[4 * i];
      const FluidMaterial& material = settings_.materials[member_[i]];
      const double c = material.sound_speed;
      const Dissipation* with = &dissipation_[settings_.materials.size() * member_[i]];
      double fx = 0, fy = 0, qx = 0, qy = 0, rate = 0;
      for (std::uint32_t k = first[i]; k < first[i + 1]; ++k) {
        const double w = weight_[k];
        if (w == 0) continue;
        const std::uint32_t j = neighbour[k];
        const double dx = x[2 * j] - xi, dy = x[2 * j + 1] - yi;
        const double* tj = &stress_[4 * j];
        if constexpr (Gradients::fitted) {
          using Fit = typename Gradients::Fit;
          const double *own = &fit_[Fit::numbers * i], *other = &fit_[Fit::numbers * j],
                       slope = w * spacing * spacing;
          const auto g = Fit::gradient(own, value_[k], slope, dx / spacing, dy / spacing),
                     r = Fit::gradient(other, value_[k], slope, -dx / spacing, -dy / spacing);
          fx += (ti[0] * g[0] + ti[1] * g[1] - tj[0] * r[0] - tj[1] * r[1]) / spacing;
          fy += (ti[2] * g[0] + ti[3] * g[1] - tj[2] * r[0] - tj[3] * r[1]) / spacing;
          if (viscous) {
            const double *si = &viscous_stress_[4 * i], *sj = &viscous_stress_[4 * j];
            qx += (si[0] * g[0] + si[1] * g[1] - sj[0] * r[0] - sj[1] * r[1]) / spacing;
            qy += (si[2] * g[0] + si[3] * g[1] - sj[2] * r[0] - sj[3] * r[1]) / spacing;
          }
        } else {
          fx += w * ((ti[0] + tj[0]) * dx + (ti[1] + tj[1]) * dy);
          fy += w * ((ti[2] + tj[2]) * dx + (ti[3] + tj[3]) * dy);
          if (viscous) {
            const double *si = &viscous_stress_[4 * i], *sj = &viscous_stress_[4 * j];
            qx += w * ((si[0] + sj[0]) * dx + (si[1] + sj[1]) * dy);
            qy += w * ((si[2] + sj[2]) * dx + (si[3] + sj[3]) * dy);
          }
        }
        if (dissipative) {
          const double approach = (v[2 * j] - vx) * dx + (v[2 * j + 1] - vy) * dy;
          const Dissipation& pair = with[member_[j]];
          if (Riemann && approach < 0 && pair.riemann) {
            const double r2 = dx * dx + dy * dy, speed = -approach / std::sqrt(r2);
            const double push = 0.25 * w * (support_[i] + support_[j]) * (density[i] + density[j]) *
                                std::min(pair.limiter * speed, pair.sound_speed) * speed;
            qx -= push * dx;
            qy -= push * dy;
          } else if (approach < 0) {
            const double mu = approach / (dx * dx + dy * dy + 0.1 * h * h);
            const double push = w * mass_[i] * mass_[j] * 2 * (-pair.linear * mu + pair.quadratic * mu * mu) /
                                (density[i] + density[j]);
            qx -= push * dx;
            qy -= push * dy;
          }
        }
        if (diffusive && member_[i] == member_[j]) {
          const double gx = density_gradient_[2 * i] + density_gradient_[2 * j],
                       gy = density_gradient_[2 * i + 1] + density_gradient_[2 * j + 1];
          // The Riemann problem's diffusion is as wide as the pair.
          const double width = Riemann && material.riemann ? std::sqrt(dx * dx + dy * dy) : 1.0;
          rate += w * width * mass_[j] / density[j] * (density[j] - density[i] - 0.5 * (gx * dx + gy * dy));
        }
      }
      force_[2 * i] = fx + qx;
      force_[2 * i + 1] = fy + qy;
      viscous_force_[2 * i] = qx;
      viscous_force_[2 * i + 1] = qy;
      if (diffusive)
        diffusion_rate_[i] = Riemann && material.riemann ? c * rate : 2 * material.diffusion * h * c * rate;
    }
  });
}

void Fluid::append_forces(std::vector<double>& values) const {
  for (const auto* part : {&force_, &viscous_force_, &diffusion_rate_})
    values.insert(values.end(), part->begin(), part->end());
}

void Fluid::set_forces(std::span<const double> values) {
  for (auto* part : {&force_, &viscous_force_, &diffusion_rate_}) {
    std::copy_n(values.begin(), part->size(), part->begin());
    values = values.subspan(part->size());
  }
}

std::array<double, 3> Fluid::degree_counts() const {
  std::array<double, 3> count{};
  for (const std::uint8_t degree : degree_) count[degree] += 1;
  return count;
}

double Fluid::energy(std::span<const double> density) const {
  return ordered_sum(
      size(), [&](std::size_t i) { return mass_[i] * settings_.materials[member_[i]].energy(density[i]); });
}

double Fluid::diffusion_work() {
  return std::exchange(diffusion_work_, 0.0);
}

double Fluid::stable_step(std::span<const double> velocity, std::span<const double> density) const {
  double rate = 0;
  const double h = settings_.smoothing_ratio * settings_.spacing;
  double fastest = 0;
  for (std::size_t i = 0; i < size(); ++i)
    fastest =
        std::max(fastest, velocity[2 * i] * velocity[2 * i] + velocity[2 * i + 1] * velocity[2 * i + 1]);
  for (std::size_t i = 0; i < size(); ++i) {
    const FluidMaterial& material = settings_.materials[member_[i]];
    // A compressed lattice is finer.
    const double ratio = std::max(1.0, density[i] / material.density),
                 c = material.sound_speed_at(density[i]) * ratio;
    const double kinematic = 4 * material.viscosity / (density[i] * h);
    // The speed counts once more: what it can be compressed to within a window.
    rate = std::max(rate, (std::sqrt(c * c + fastest) + std::sqrt(fastest) +
                           0.2 * (material.riemann ? 1.0 : material.linear) * c + kinematic) /
                              h);
  }
  return rate > 0 ? 1 / rate : std::numeric_limits<double>::infinity();
}

}  // namespace estuary::solid
