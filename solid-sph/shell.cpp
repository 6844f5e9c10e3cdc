#include "shell.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace estuary::solid {
namespace {

using Vector = std::array<double, 2>;

Vector normal_of(double angle) {
  return {std::cos(angle), std::sin(angle)};
}
double inner(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1];
}

double norm(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (const double v : a) sum += v * v;
  for (const double v : b) sum += v * v;
  return std::sqrt(sum);
}

}  // namespace

Body fill_row(std::span<const Vector> points, bool closed, double spacing, const ShellSection& section) {
  Body body;
  double total = 0;
  std::size_t links = 0;
  const std::size_t pieces = closed ? points.size() : points.size() - 1;
  for (std::size_t p = 0; p < pieces; ++p) {
    const Vector &from = points[p], &to = points[(p + 1) % points.size()];
    const double length = std::hypot(to[0] - from[0], to[1] - from[1]);
    if (!(length > 1e-3 * spacing)) throw std::invalid_argument("two points of its polyline coincide");
    const auto parts = static_cast<std::size_t>(std::max(1.0, std::round(length / spacing)));
    for (std::size_t k = 0; k < parts; ++k) {
      const double share = static_cast<double>(k) / static_cast<double>(parts);
      body.position.insert(body.position.end(),
                           {from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])});
    }
    total += length;
    links += parts;
  }
  if (!closed) body.position.insert(body.position.end(), {points.back()[0], points.back()[1]});
  const std::size_t n = body.position.size() / 2;
  body.spacing = {total / static_cast<double>(links), total / static_cast<double>(links)};
  body.smoothing_length = body.spacing[0];
  body.volume.assign(n, 0.0);
  Outline outline;
  outline.closed = closed;
  for (std::size_t i = 0; i < n; ++i) outline.particle.push_back(static_cast<std::uint32_t>(i));
  for (std::size_t i = 0; i < (closed ? n : n - 1); ++i) {
    const std::size_t j = (i + 1) % n;
    const double length = std::hypot(body.position[2 * j] - body.position[2 * i],
                                     body.position[2 * j + 1] - body.position[2 * i + 1]);
    for (const std::size_t end : {i, j}) body.volume[end] += 0.5 * length * section.thickness;
  }
  body.energy_volume = body.volume;
  for (const double v : body.volume) body.mass.push_back(section.density * v);
  body.fixed.assign(n, 0);
  body.edge.assign(n, 1);
  body.member.assign(n, 0);
  body.outlines.push_back(std::move(outline));
  body.outline_member.push_back(0);
  return body;
}

Transfer row_transfer(const Body& body, const Vector& place) {
  double best = std::numeric_limits<double>::infinity(), share = 0;
  std::array<std::uint32_t, 2> ends{};
  for (const Outline& outline : body.outlines) {
    const std::size_t n = outline.particle.size();
    for (std::size_t k = 0; k < (outline.closed ? n : n - 1); ++k) {
      const std::uint32_t a = outline.particle[k], b = outline.particle[(k + 1) % n];
      const Vector from{body.position[2 * a], body.position[2 * a + 1]},
          along{body.position[2 * b] - from[0], body.position[2 * b + 1] - from[1]},
          to{place[0] - from[0], place[1] - from[1]};
      const double s = std::clamp(inner(to, along) / inner(along, along), 0.0, 1.0);
      const double distance = std::hypot(to[0] - s * along[0], to[1] - s * along[1]);
      if (!(distance < best)) continue;
      best = distance;
      share = s;
      ends = {a, b};
    }
  }
  Transfer transfer;
  transfer.first = {0, 2};
  transfer.position = {0, 1};
  transfer.touched = {ends[0], ends[1]};
  transfer.weight = {1 - share, share};
  return transfer;
}

ShellSolver::ShellSolver(const Body& body, std::vector<ShellSection> sections)
    : Solver(body, Neighbourhood{}),
      sections_(std::move(sections)),
      before_(body.size(), kNone),
      after_(body.size(), kNone),
      fibre_angle_(body.size()),
      inertia_(body.size(), 0.0),
      moment_(body.size(), 0.0) {
  const std::size_t n = body.size();
  pairs_.first.assign(n + 1, 0);
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    const Outline& outline = body.outlines[o];
    const ShellSection& section = sections_[body.outline_member[o]];
    const std::size_t count = outline.particle.size();
    for (std::size_t k = 0; k < (outline.closed ? count : count - 1); ++k) {
      Link link{};
      link.a = outline.particle[k];
      link.b = outline.particle[(k + 1) % count];
      const double dx = body.position[2 * link.b] - body.position[2 * link.a],
                   dy = body.position[2 * link.b + 1] - body.position[2 * link.a + 1];
      link.length = std::hypot(dx, dy);
      link.tangent = {dx / link.length, dy / link.length};
      link.membrane = section.young_modulus * section.thickness;
      link.shear = section.shear_correction * section.shear_modulus * section.thickness;
      link.bending = link.membrane * section.thickness * section.thickness / 12;
      after_[link.a] = before_[link.b] = static_cast<std::uint32_t>(links_.size());
      links_.push_back(link);
    }
  }
  // The fibre at a particle is normal to the mean of its links' directions.
  for (std::size_t i = 0; i < n; ++i) {
    Vector t{};
    for (const std::uint32_t l : {before_[i], after_[i]}) {
      if (l == kNone) continue;
      for (std::size_t c = 0; c < 2; ++c) t[c] += links_[l].tangent[c];
      const ShellSection& section = sections_[body.member[i]];
      inertia_[i] += 0.5 * links_[l].length * section.density * std::pow(section.thickness, 3) / 12;
    }
    fibre_angle_[i] = std::atan2(t[0], -t[1]);
    rest_fibre_.push_back(normal_of(fibre_angle_[i]));
  }
  for (Link& link : links_) {
    const Vector na = normal_of(fibre_angle_[link.a]), nb = normal_of(fibre_angle_[link.b]);
    link.shear_rest = 0.5 * (inner(link.tangent, na) + inner(link.tangent, nb));
    link.curvature_rest = (inner(link.tangent, nb) - inner(link.tangent, na)) / link.length;
  }
  at_.resize(links_.size());
  fibre_ = rest_fibre_;
  history_.assign(2 * n, 0.0);
  rest_history_ = history_;
}

std::int64_t ShellSolver::evaluate(std::span<const double> displacement) {
  const std::size_t count = links_.size(), n = body_.size();
#pragma omp parallel for schedule(static) if (n > kSerialBelow)
  for (std::size_t i = 0; i < n; ++i) fibre_[i] = normal_of(fibre_angle_[i] + history_[2 * i]);
#pragma omp parallel for schedule(static) if (n > kSerialBelow)
  for (std::size_t l = 0; l < count; ++l) {
    const Link& link = links_[l];
    LinkState& now = at_[l];
    Vector x{}, mean{}, slope{};
    const Vector &na = fibre_[link.a], &nb = fibre_[link.b];
    for (std::size_t c = 0; c < 2; ++c) {
      x[c] = link.tangent[c] + (displacement[2 * link.b + c] - displacement[2 * link.a + c]) / link.length;
      mean[c] = 0.5 * (na[c] + nb[c]);
      slope[c] = (nb[c] - na[c]) / link.length;
    }
    const double e = 0.5 * (inner(x, x) - 1), gamma = inner(x, mean) - link.shear_rest,
                 kappa = inner(x, slope) - link.curvature_rest;
    now.normal_force = link.membrane * e;
    now.shear_force = link.shear * gamma;
    now.moment = link.bending * kappa;
    now.stretch = std::sqrt(inner(x, x));
    now.energy = 0.5 * link.length * (now.normal_force * e + now.shear_force * gamma + now.moment * kappa);
    for (std::size_t c = 0; c < 2; ++c) {
      now.force[c] = now.normal_force * x[c] + now.shear_force * mean[c] + now.moment * slope[c];
      now.shear[c] = now.shear_force * x[c];
      now.bending[c] = now.moment * x[c];
    }
  }
  std::int64_t bad = 0;
#pragma omp parallel for schedule(static) reduction(+ : bad) if (n > kSerialBelow)
  for (std::size_t i = 0; i < n; ++i) {
    const Vector normal = fibre_[i], across{-normal[1], normal[0]};  // and its derivative by the angle
    Vector force{};
    double moment = 0;
    if (after_[i] != kNone) {
      const LinkState& link = at_[after_[i]];
      for (std::size_t c = 0; c < 2; ++c) force[c] += link.force[c];
      moment += inner(link.bending, across) - 0.5 * links_[after_[i]].length * inner(link.shear, across);
    }
    if (before_[i] != kNone) {
      const LinkState& link = at_[before_[i]];
      for (std::size_t c = 0; c < 2; ++c) force[c] -= link.force[c];
      moment -= inner(link.bending, across) + 0.5 * links_[before_[i]].length * inner(link.shear, across);
    }
    fields_.force[2 * i] = force[0];
    fields_.force[2 * i + 1] = force[1];
    moment_[i] = moment;
    // The mid-line's direction and the fibre, from the reference's.
    const Vector rest = rest_fibre_[i];
    Vector x{};
    double links = 0;
    for (const std::uint32_t l : {before_[i], after_[i]}) {
      if (l == kNone) continue;
      const Link& link = links_[l];
      for (std::size_t c = 0; c < 2; ++c)
        x[c] += link.tangent[c] + (displacement[2 * link.b + c] - displacement[2 * link.a + c]) / link.length;
      links += 1;
    }
    double* f = &fields_.deformation_gradient[4 * i];
    for (std::size_t c = 0; c < 2; ++c) {
      // The reference direction is the fibre turned back by a quarter.
      f[2 * c] = x[c] / links * rest[1] + normal[c] * rest[0];
      f[2 * c + 1] = -x[c] / links * rest[0] + normal[c] * rest[1];
    }
    if (!std::isfinite(force[0] + force[1] + moment)) ++bad;
  }
  return bad;
}

double ShellSolver::energy(std::span<const double>) const {
  double sum = 0;
  for (const LinkState& link : at_) sum += link.energy;
  return sum;
}

std::array<double, 16> ShellSolver::tangent_at(std::size_t i) const {
  double stretch = 0;
  for (const std::uint32_t l : {before_[i], after_[i]})
    if (l != kNone) stretch = std::max(stretch, at_[l].stretch);
  // d(N x')/dx' along the line, relative to rest.
  const double a = std::max(1.0, 0.5 * (3 * stretch * stretch - 1));
  return {a, 0, 0, 0, 0, a, 0, 0, 0, 0, a, 0, 0, 0, 0, a};
}

Tensor<double> ShellSolver::first_piola_kirchhoff_at(std::size_t i) const {
  const double h = sections_[body_.member[i]].thickness;
  const Vector rest = rest_fibre_[i];
  Vector stress{};
  double links = 0;
  for (const std::uint32_t l : {before_[i], after_[i]}) {
    if (l == kNone) continue;
    for (std::size_t c = 0; c < 2; ++c) stress[c] += at_[l].force[c] / h;
    links += 1;
  }
  const Vector t{rest[1] / links, -rest[0] / links};
  return {stress[0] * t[0], stress[0] * t[1], stress[1] * t[0], stress[1] * t[1]};
}

double ShellSolver::bending_moment(std::size_t i) const {
  double sum = 0, links = 0;
  for (const std::uint32_t l : {before_[i], after_[i]})
    if (l != kNone) {
      sum += at_[l].moment;
      links += 1;
    }
  return sum / links;
}

double ShellSolver::reference_stable_step() {
  double squared = 0;
  for (const Link& link : links_) {
    const ShellSection& s = sections_[body_.member[link.a]];
    const double length = 4 / (link.length * link.length);
    squared = std::max(
        {squared, s.young_modulus / s.density * length,
         s.shear_correction * s.shear_modulus / s.density * (length + 12 / (s.thickness * s.thickness))});
  }
  rest_stiffness_ = 1;
  stable_step_ = 2 / std::sqrt(squared);
  return stable_step_;
}

double ShellSolver::kinetic_energy(const State& state) const {
  double sum = Solver::kinetic_energy(state);
  for (std::size_t i = 0; i < body_.size(); ++i)
    sum += 0.5 * inertia_[i] * state.history[2 * i + 1] * state.history[2 * i + 1];
  return sum;
}

double ShellSolver::spin(const State& state) const {
  double sum = 0;
  for (std::size_t i = 0; i < body_.size(); ++i) sum += inertia_[i] * state.history[2 * i + 1];
  return sum;
}

double ShellSolver::held_moment() const {
  double sum = 0;
  for (std::size_t i = 0; i < body_.size(); ++i)
    if ((body_.fixed[i] & kRotationFixed) != 0) sum -= moment_[i];
  return sum;
}

// Gravity, forces and moments at `time` on top of the internal ones.
void ShellSolver::add_loads(const Loading& loading, const ExternalForces& external, double time) {
  external.add_to(fields_.force);
  for (std::size_t i = 0; i < body_.size(); ++i)
    for (std::size_t c = 0; c < 2; ++c) fields_.force[2 * i + c] += body_.mass[i] * loading.gravity[c];
  for (const MomentLoad& load : loading.moments) {
    const double each =
        load.moment * (load.factor ? load.factor(time) : 1.0) / static_cast<double>(load.particle.size());
    for (const std::uint32_t i : load.particle) moment_[i] += each;
  }
}

void ShellSolver::advance(State& state, const Loading& loading, double duration, std::uint64_t steps,
                          double damping, const Monitor& monitor) {
  const std::size_t n = body_.size();
  const double dt = duration / static_cast<double>(steps), start = state.time;
  const double decay = 1 - 0.5 * damping * dt, gain = 1 / (1 + 0.5 * damping * dt);
  history_ = state.history;
  ExternalForces external(body_, loading);
  const auto moment_power = [&](double time) {  // times a step
    double sum = 0;
    for (const MomentLoad& load : loading.moments)
      for (const std::uint32_t i : load.particle)
        sum += load.moment * (load.factor ? load.factor(time) : 1.0) /
               static_cast<double>(load.particle.size()) * history_[2 * i + 1] * dt;
    return sum;
  };
  const auto gravity_work = [&] {
    double sum = 0;
    for (std::size_t c = 0; c < 2 * n; ++c)
      sum += body_.mass[c / 2] * loading.gravity[c % 2] * state.displacement[c];
    return sum;
  };
  state.external_work -= gravity_work();
  evaluate(state.displacement);
  external.set(0, start, state.displacement);
  add_loads(loading, external, start);
  for (std::uint64_t step = 1; step <= steps; ++step) {
    const double fraction = static_cast<double>(step) / static_cast<double>(steps);
    const double time = start + fraction * duration;
    const auto kick = [&](bool ends) {
      const auto one = [&](double v, double a) {
        return ends ? gain * (v + 0.5 * dt * a) : decay * v + 0.5 * dt * a;
      };
#pragma omp parallel for schedule(static) if (n > kSerialBelow)
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t c = 0; c < 2; ++c)
          if (!body_.holds(i, c) && !loading.held[c])
            state.velocity[2 * i + c] =
                one(state.velocity[2 * i + c], fields_.force[2 * i + c] / body_.mass[i]);
        if ((body_.fixed[i] & kRotationFixed) == 0)
          history_[2 * i + 1] = one(history_[2 * i + 1], moment_[i] / inertia_[i]);
        if (ends) continue;
        for (std::size_t c = 0; c < 2; ++c) state.displacement[2 * i + c] += dt * state.velocity[2 * i + c];
        history_[2 * i] += dt * history_[2 * i + 1];
      }
    };
    kick(false);
    // Half-way through the step, where the rates are those of the motion.
    if (!loading.moments.empty()) state.external_work += moment_power(time - 0.5 * dt);
    if (evaluate(state.displacement) > 0) {
      for (std::size_t i = 0; i < n; ++i)
        if (!std::isfinite(fields_.force[2 * i] + fields_.force[2 * i + 1] + moment_[i]))
          throw Breakdown(i, step, std::numeric_limits<double>::quiet_NaN());
    }
    external.set(fraction, time, state.displacement);
    add_loads(loading, external, time);
    state.external_work += external.work();
    kick(true);
    if (damping > 0) {
      state.history = history_;
      state.viscous_work += 2 * dt * damping * kinetic_energy(state);
    }
    if (step % 128 == 0) monitor(fraction, "shell");
  }
  state.history = history_;
  state.time = start + duration;
  state.external_work += gravity_work();
}

EquilibriumReport ShellSolver::relax(std::vector<double>& displacement, const Loading& loading, double time,
                                     const EquilibriumSettings& settings, const Monitor& monitor) {
  constexpr std::uint64_t kBlock = 50;
  const std::size_t n = body_.size();
  // Sums of the stiffness over a row, with rotations measured by the displacement they make along a link; a
  // quarter of them bounds the frequency by 2 (Gershgorin).
  std::vector<double> mass(n, 0.0), inertia(n, 0.0), velocity(2 * n, 0.0), rate(n, 0.0);
  for (const Link& link : links_)
    for (const std::uint32_t i : {link.a, link.b}) {
      mass[i] += 0.25 * (2 * link.membrane + 3 * link.shear) / link.length;
      inertia[i] += 0.25 * (1.5 * link.shear * link.length + 2 * link.bending / link.length);
    }
  const auto turns = [&](std::size_t i) { return (body_.fixed[i] & kRotationFixed) == 0; };
  std::vector<double> before = displacement, before_turn(n), before_force(2 * n), before_moment(n);
  ExternalForces external(body_, loading);
  EquilibriumReport report;
  double damping = 0, dt = 0.9, reference = 0, last_change = 0;
  bool near_before = false;
  // What rounding alone leaves of the forces.
  double round_off = 0;
  for (const Link& link : links_) round_off += link.membrane * link.membrane;
  round_off = 4 * std::numeric_limits<double>::epsilon() * std::sqrt(round_off);
  // Moments count by the force that makes them along a link.
  const double arm = body_.mean_spacing();
  for (;; ++report.steps) {
    if (evaluate(displacement) > 0)
      throw Breakdown(0, report.steps, std::numeric_limits<double>::quiet_NaN());
    const double energy_scale = energy(displacement);
    external.set(1, time, displacement);
    add_loads(loading, external, time);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t c = 0; c < 2; ++c)
        if (body_.holds(i, c)) fields_.force[2 * i + c] = 0;
      if (!turns(i)) moment_[i] = 0;
    }
    if (report.steps % kBlock == 0) {
      std::vector<double> turned(n);
      for (std::size_t i = 0; i < n; ++i) turned[i] = moment_[i] / arm;
      const double residual = norm(fields_.force, turned);
      if (report.steps == 0) {
        reference = residual;
        if (!(reference > 0)) {
          report.converged = true;
          return report;
        }
      }
      report.residual = residual / reference;
      if (report.steps > 0) {
        double change = 0, size = 0, stiffness = 0, weight = 0;
        for (std::size_t i = 0; i < n; ++i) {
          for (std::size_t c = 2 * i; c < 2 * i + 2; ++c) {
            const double d = displacement[c] - before[c];
            change += d * d;
            size += displacement[c] * displacement[c];
            stiffness += d * (before_force[c] - fields_.force[c]);
            weight += d * d * mass[i];
          }
          const double d = history_[2 * i] - before_turn[i];
          stiffness += d * (before_moment[i] - moment_[i]);
          weight += d * d * inertia[i];
        }
        change = std::sqrt(change);
        const double ratio = last_change > 0 ? std::min(change / last_change, 0.9999) : 0.9999;
        report.remaining_change = size > 0 ? change * ratio / (1 - ratio) / std::sqrt(size) : 0;
        last_change = change;
        const bool near = (report.residual < settings.tolerance || residual < round_off) &&
                          report.remaining_change < settings.tolerance;
        if (near && near_before) {
          report.converged = true;
          return report;
        }
        near_before = near;
        damping = weight > 0 && stiffness > 0 ? 2 * std::sqrt(stiffness / weight) : 0;
      }
      if (report.steps >= settings.maximum_steps || !std::isfinite(energy_scale)) return report;
      double stretch = 1;
      for (const LinkState& link : at_) stretch = std::max(stretch, link.stretch);
      dt = 0.9 / std::sqrt(0.5 * (3 * stretch * stretch - 1));
      damping = std::min(damping, 1 / dt);
      before = displacement;
      before_force = fields_.force;
      before_moment = moment_;
      for (std::size_t i = 0; i < n; ++i) before_turn[i] = history_[2 * i];
      monitor(-1, "shell, residual " + std::to_string(report.residual));
    }
    const double decay = (2 - damping * dt) / (2 + damping * dt), gain = 2 * dt / (2 + damping * dt);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t c = 0; c < 2; ++c) {
        if (body_.holds(i, c)) continue;
        velocity[2 * i + c] = decay * velocity[2 * i + c] + gain * fields_.force[2 * i + c] / mass[i];
        displacement[2 * i + c] += dt * velocity[2 * i + c];
      }
      if (!turns(i)) continue;
      rate[i] = decay * rate[i] + gain * moment_[i] / inertia[i];
      history_[2 * i] += dt * rate[i];
    }
  }
}

}  // namespace estuary::solid
