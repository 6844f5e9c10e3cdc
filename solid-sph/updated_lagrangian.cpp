#include "updated_lagrangian.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "on_team.hpp"

namespace estuary::solid {

UpdatedLagrangianSolver::UpdatedLagrangianSolver(const Body& body, const SolverOptions& options)
    : Solver(body, build_neighbourhood(
                       body, {.order = options.order, .spring_modulus = {}, .kernel = options.kernel})),
      materials_(options.materials),
      kernel_(options.kernel),
      artificial_stress_(options.artificial_stress),
      smoothing_(options.conservative_smoothing),
      repulsion_(artificial_stress_ > 0 ? 3 * body.size() : 0),
      weight_sum_(smoothing_ > 0 ? body.size() : 0),
      position_(2 * body.size()) {
  const std::size_t members = body.member.empty() ? 1 : std::size_t{body.member.back()} + 1;
  while (materials_.size() < members) materials_.push_back(materials_.front());
  SolverOptions elastic = options;
  for (Material& material : elastic.materials) material.viscosity = {};
  elastic.conservative_smoothing = 0;
  reference_ = make_solver<SaintVenantKirchhoff>(body, elastic);
  for (std::size_t i = 0; i < body.size(); ++i)
    history_.insert(history_.end(), {0, 0, 0, 0, body.mass[i] / body.volume[i]});
  rest_history_ = history_;
  const auto [least, most] = std::minmax_element(body.position.begin(), body.position.end());
  too_far_ = 1e6 * (*most - *least + body.mean_spacing());
}

std::int64_t UpdatedLagrangianSolver::evaluate(std::span<const double> displacement) {
  reference_->evaluate(displacement);
  fields_ = reference_->fields();
  // Particles may pass each other here without harm to the method; only what is not finite counts.
  std::int64_t bad = 0;
  for (const double u : displacement)
    if (!std::isfinite(u)) ++bad;
  for (const double h : history_)
    if (!std::isfinite(h)) ++bad;
  return bad;
}

double UpdatedLagrangianSolver::energy(std::span<const double>) const {
  return ordered_sum(body_.size(), [&](std::size_t i) {
    const double* h = &history_[kHistorySize * i];
    const ElasticConstants& c = materials_[body_.member[i]].constants;
    const double bulk = c.lambda + 2 * c.mu / 3, mean = (h[0] + h[2] + h[3]) / 3;
    const double deviator = (h[0] - mean) * (h[0] - mean) + (h[2] - mean) * (h[2] - mean) +
                            (h[3] - mean) * (h[3] - mean) + 2 * h[1] * h[1];
    return body_.mass[i] / h[4] * (0.5 * mean * mean / bulk + 0.25 * deviator / c.mu);
  });
}

std::array<double, 16> UpdatedLagrangianSolver::tangent_at(std::size_t i) const {
  return tangent(SaintVenantKirchhoff{materials_[body_.member[i]].constants}, identity());
}

Tensor<double> UpdatedLagrangianSolver::first_piola_kirchhoff_at(std::size_t i) const {
  const double* h = &history_[kHistorySize * i];
  return product(Tensor<double>{h[0], h[1], h[1], h[2]},
                 cofactor(tensor_at(fields_.deformation_gradient, i)));
}

EquilibriumReport UpdatedLagrangianSolver::relax(std::vector<double>&, const Loading&, double,
                                                 const EquilibriumSettings&, const Monitor&) {
  throw std::logic_error("the updated Lagrangian form has no equilibrium search");
}

// Cells of one support each; neighbours in ascending order of particle, so that sums do not depend on the
// cells.
void UpdatedLagrangianSolver::find_neighbours(const State& state) {
  const std::size_t n = body_.size();
  const double reach = support_ratio(kernel_) * body_.smoothing_length;
  double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (std::size_t c = 0; c < 2 * n; ++c) {
    position_[c] = body_.position[c] + state.displacement[c];
    low[c % 2] = std::min(low[c % 2], position_[c]);
    high[c % 2] = std::max(high[c % 2], position_[c]);
  }
  double width = reach;
  // Particles thrown far out must not ask for endless cells.
  while ((high[0] - low[0]) / width * ((high[1] - low[1]) / width) > 4.0 * static_cast<double>(n) + 64)
    width *= 2;
  const auto columns = static_cast<std::size_t>((high[0] - low[0]) / width) + 1;
  const auto rows = static_cast<std::size_t>((high[1] - low[1]) / width) + 1;
  const auto cell_of = [&](std::size_t i) {
    return static_cast<std::size_t>((position_[2 * i + 1] - low[1]) / width) * columns +
           static_cast<std::size_t>((position_[2 * i] - low[0]) / width);
  };
  cell_first_.assign(columns * rows + 1, 0);
  for (std::size_t i = 0; i < n; ++i) ++cell_first_[cell_of(i) + 1];
  for (std::size_t c = 0; c < columns * rows; ++c) cell_first_[c + 1] += cell_first_[c];
  cell_particle_.resize(n);
  std::vector<std::uint32_t> next(cell_first_.begin(), cell_first_.end() - 1);
  for (std::size_t i = 0; i < n; ++i) cell_particle_[next[cell_of(i)]++] = static_cast<std::uint32_t>(i);
  first_.assign(1, 0);
  neighbour_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const auto cx = static_cast<std::size_t>((position_[2 * i] - low[0]) / width);
    const auto cy = static_cast<std::size_t>((position_[2 * i + 1] - low[1]) / width);
    const std::size_t begin = neighbour_.size();
    for (std::size_t y = cy > 0 ? cy - 1 : 0; y < std::min(rows, cy + 2); ++y)
      for (std::size_t x = cx > 0 ? cx - 1 : 0; x < std::min(columns, cx + 2); ++x)
        for (std::size_t k = cell_first_[y * columns + x]; k < cell_first_[y * columns + x + 1]; ++k) {
          const std::size_t j = cell_particle_[k];
          const double dx = position_[2 * j] - position_[2 * i],
                       dy = position_[2 * j + 1] - position_[2 * i + 1];
          const double r2 = dx * dx + dy * dy;
          if (j != i && r2 < reach * reach && r2 > 0 && body_.member[j] == body_.member[i])
            neighbour_.push_back(static_cast<std::uint32_t>(j));
        }
    std::sort(neighbour_.begin() + static_cast<std::ptrdiff_t>(begin), neighbour_.end());
    first_.push_back(static_cast<std::uint32_t>(neighbour_.size()));
  }
}

void UpdatedLagrangianSolver::strain(const State& state, double dt) {
  const std::size_t n = body_.size();
  const double h = body_.smoothing_length;
  std::vector<double>& history = history_;
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      Tensor<double> l, k;
      for (std::size_t p = first_[i]; p < first_[i + 1]; ++p) {
        const std::size_t j = neighbour_[p];
        const double dx = position_[2 * j] - position_[2 * i],
                     dy = position_[2 * j + 1] - position_[2 * i + 1];
        const double r = std::hypot(dx, dy);
        // Gradient of the kernel at i, weighted by the reference volume: the weights matter only relative to
        // each other.
        const double w = -kernel_slope(kernel_, r, h) / r * body_.volume[j];
        const double vx = state.velocity[2 * j] - state.velocity[2 * i],
                     vy = state.velocity[2 * j + 1] - state.velocity[2 * i + 1];
        l.xx += w * vx * dx;
        l.xy += w * vx * dy;
        l.yx += w * vy * dx;
        l.yy += w * vy * dy;
        k.xx += w * dx * dx;
        k.xy += w * dx * dy;
        k.yy += w * dy * dy;
      }
      k.yx = k.xy;
      const double det = determinant(k);
      // A particle that has lost its neighbours strains no more: that is numerical fracture.
      if (!(det > 1e-6 * k.xx * k.yy)) continue;
      const Tensor<double> gradient = product(l, scaled(Tensor<double>{k.yy, -k.xy, -k.yx, k.xx}, 1 / det));
      const double dxx = gradient.xx, dyy = gradient.yy, dxy = 0.5 * (gradient.xy + gradient.yx);
      const double spin = 0.5 * (gradient.xy - gradient.yx);
      double* s = &history[kHistorySize * i];
      const ElasticConstants& c = materials_[body_.member[i]].constants;
      const double trace = dxx + dyy, sxx = s[0], sxy = s[1], syy = s[2];
      s[0] += dt * (c.lambda * trace + 2 * c.mu * dxx + 2 * spin * sxy);
      s[1] += dt * (2 * c.mu * dxy + spin * (syy - sxx));
      s[2] += dt * (c.lambda * trace + 2 * c.mu * dyy - 2 * spin * sxy);
      s[3] += dt * c.lambda_across * trace;
      s[4] *= std::exp(-dt * trace);
    }
  });
}

void UpdatedLagrangianSolver::accelerate(const State& state) {
  const std::size_t n = body_.size();
  const double h = body_.smoothing_length;
  for (std::size_t i = 0; i < repulsion_.size() / 3; ++i) {
    const double* s = &history_[kHistorySize * i];
    const double mean = 0.5 * (s[0] + s[2]), half = 0.5 * (s[0] - s[2]), radius = std::hypot(half, s[1]);
    const double scale = -artificial_stress_ / (s[4] * s[4]);
    const double a = scale * std::max(0.0, mean + radius), b = scale * std::max(0.0, mean - radius);
    const double cosine = radius > 0 ? half / radius : 0, sine = radius > 0 ? s[1] / radius : 0;
    repulsion_[3 * i] = 0.5 * (a + b) + 0.5 * (a - b) * cosine;
    repulsion_[3 * i + 1] = 0.5 * (a - b) * sine;
    repulsion_[3 * i + 2] = 0.5 * (a + b) - 0.5 * (a - b) * cosine;
  }
  const double at_spacing = kernel_value(kernel_, body_.mean_spacing(), h);
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      double fx = 0, fy = 0;
      const double* si = &history_[kHistorySize * i];
      const double ii = 1 / (si[4] * si[4]);
      const ArtificialViscosity& viscosity = materials_[body_.member[i]].viscosity;
      for (std::size_t p = first_[i]; p < first_[i + 1]; ++p) {
        const std::size_t j = neighbour_[p];
        const double dx = position_[2 * j] - position_[2 * i],
                     dy = position_[2 * j + 1] - position_[2 * i + 1];
        const double r = std::hypot(dx, dy);
        const double* sj = &history_[kHistorySize * j];
        const double jj = 1 / (sj[4] * sj[4]);
        // grad_i W points from i to j times minus the slope.
        const double w = -kernel_slope(kernel_, r, h) / r * body_.mass[i] * body_.mass[j];
        const double gx = w * dx, gy = w * dy;
        const double approach = (state.velocity[2 * j] - state.velocity[2 * i]) * dx +
                                (state.velocity[2 * j + 1] - state.velocity[2 * i + 1]) * dy;
        double pi = 0;
        if (approach < 0) {
          const double phi = h * approach / (r * r + 0.01 * h * h);
          pi = (-viscosity.linear * viscosity.sound_speed * phi + viscosity.quadratic * phi * phi) /
               (0.5 * (si[4] + sj[4]));
        }
        double txx = si[0] * ii + sj[0] * jj - pi, txy = si[1] * ii + sj[1] * jj,
               tyy = si[2] * ii + sj[2] * jj - pi;
        if (!repulsion_.empty()) {
          const double nearness = std::pow(kernel_value(kernel_, r, h) / at_spacing, 4);
          txx += nearness * (repulsion_[3 * i] + repulsion_[3 * j]);
          txy += nearness * (repulsion_[3 * i + 1] + repulsion_[3 * j + 1]);
          tyy += nearness * (repulsion_[3 * i + 2] + repulsion_[3 * j + 2]);
        }
        fx += txx * gx + txy * gy;
        fy += txy * gx + tyy * gy;
      }
      fields_.force[2 * i] = fx;
      fields_.force[2 * i + 1] = fy;
    }
  });
}

// The weights of a pair are those of VelocitySmoothing, of the neighbours of now.
double UpdatedLagrangianSolver::smooth(State& state) {
  const std::size_t n = body_.size();
  const double before = kinetic_energy(state), h = body_.smoothing_length;
  const auto volume = [&](std::size_t i) { return body_.mass[i] / history_[kHistorySize * i + 4]; };
  const auto value = [&](std::size_t i, std::size_t j) {
    return kernel_value(
        kernel_, std::hypot(position_[2 * j] - position_[2 * i], position_[2 * j + 1] - position_[2 * i + 1]),
        h);
  };
  for (std::size_t i = 0; i < n; ++i) {
    weight_sum_[i] = 0;
    for (std::size_t p = first_[i]; p < first_[i + 1]; ++p)
      weight_sum_[i] += volume(neighbour_[p]) * value(i, neighbour_[p]);
  }
  smoothed_ = state.velocity;
  for (std::size_t i = 0; i < n; ++i) {
    double vx = 0, vy = 0;
    for (std::size_t p = first_[i]; p < first_[i + 1]; ++p) {
      const std::size_t j = neighbour_[p];
      const double w = value(i, j);
      if (!(w > 0)) continue;
      const double weight =
          0.5 * w * (body_.mass[i] * volume(j) / weight_sum_[i] + body_.mass[j] * volume(i) / weight_sum_[j]);
      vx += weight * (state.velocity[2 * j] - state.velocity[2 * i]);
      vy += weight * (state.velocity[2 * j + 1] - state.velocity[2 * i + 1]);
    }
    if (!body_.holds(i, 0)) smoothed_[2 * i] += smoothing_ / body_.mass[i] * vx;
    if (!body_.holds(i, 1)) smoothed_[2 * i + 1] += smoothing_ / body_.mass[i] * vy;
  }
  state.velocity.swap(smoothed_);
  return before - kinetic_energy(state);
}

void UpdatedLagrangianSolver::advance(State& state, const Loading& loading, double duration,
                                      std::uint64_t steps, double damping, const Monitor& monitor) {
  const double dt = duration / static_cast<double>(steps), start = state.time;
  const std::size_t n = body_.size();
  history_ = state.history;
  ExternalForces external(body_, loading);
  find_neighbours(state);
  accelerate(state);
  external.set(0, start, state.displacement);
  external.add_to(fields_.force);
  const auto kick = [&] {
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t c = 0; c < 2; ++c)
        if (!body_.holds(i, c) && !loading.held[c])
          state.velocity[2 * i + c] += 0.5 * dt *
                                       (fields_.force[2 * i + c] / body_.mass[i] + loading.gravity[c] -
                                        damping * state.velocity[2 * i + c]);
  };
  for (std::uint64_t step = 1; step <= steps; ++step) {
    const double fraction = static_cast<double>(step) / static_cast<double>(steps);
    const double time = start + fraction * duration;
    kick();
    for (const PrescribedMotion& motion : loading.prescribed)
      for (const std::uint32_t i : motion.particle) {
        const std::size_t c = 2 * i + motion.component;
        state.velocity[c] = (motion.displacement(body_.position[2 * i], body_.position[2 * i + 1], time) -
                             state.displacement[c]) /
                            dt;
      }
    strain(state, dt);
    for (std::size_t c = 0; c < 2 * n; ++c) state.displacement[c] += dt * state.velocity[c];
    for (std::size_t i = 0; i < n; ++i) {
      const double moved = std::hypot(state.displacement[2 * i], state.displacement[2 * i + 1]);
      if (!std::isfinite(moved) || !std::isfinite(history_[kHistorySize * i]))
        throw Breakdown(i, step, std::nan(""));
      if (!(moved < too_far_)) throw ThrownOut(i, step, moved);
    }
    find_neighbours(state);
    accelerate(state);
    external.set(fraction, time, state.displacement);
    external.add_to(fields_.force);
    state.external_work += external.work();
    kick();
    if (smoothing_ > 0) state.viscous_work += smooth(state);
    if (step % 128 == 0) monitor(fraction, "updated Lagrangian");
  }
  state.history = history_;
  state.time = start + duration;
}

}  // namespace estuary::solid
