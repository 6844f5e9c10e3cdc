#include "rigid_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace estuary::solid {
namespace {

using Matrix3 = std::array<double, 9>;

Matrix3 times(const Matrix3& a, const Matrix3& b) {
  Matrix3 c{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t j = 0; j < 3; ++j) c[3 * i + j] += a[3 * i + k] * b[3 * k + j];
  return c;
}

std::span<double> values_of(State& state, std::size_t r) {
  return std::span<double>(state.rigid).subspan(6 * r, 6);
}

const RigidDrive* drive_of(const Loading& loading, std::size_t r, std::size_t freedom) {
  for (const RigidDrive& drive : loading.rigid_drives)
    if (drive.rigid == r && drive.freedom == freedom) return &drive;
  return nullptr;
}

}  // namespace

OscillatorStep oscillator_step(double mass, double damper, double spring, double dt) {
  // In q, v dt and g dt^2 / m the matrix has no unit. Its trace is bounded before squaring; dampers and
  // springs too stiff for that decay to nothing within the step all the same.
  const double k = spring / mass * dt * dt, c = damper / mass * dt;
  const double size = std::max({1.0, std::sqrt(k), c});
  const int squarings = static_cast<int>(std::ceil(std::log2(size))) + 3;
  const double s = std::ldexp(1.0, -squarings);
  const Matrix3 a{0, s, 0, -k * s, -c * s, s, 0, 0, 0};
  Matrix3 result{1, 0, 0, 0, 1, 0, 0, 0, 1}, term = result;
  for (int order = 1; order <= 14; ++order) {
    term = times(term, a);
    for (double& t : term) t /= order;
    for (std::size_t e = 0; e < 9; ++e) result[e] += term[e];
  }
  for (int round = 0; round < squarings; ++round) result = times(result, result);
  OscillatorStep step;
  step.qq = result[0];
  step.qv = result[1] * dt;
  step.qg = result[2] * dt * dt / mass;
  step.vq = result[3] / dt;
  step.vv = result[4];
  step.vg = result[5] * dt / mass;
  step.vr = step.qg / dt;
  return step;
}

void carry(const RigidBody& rigid, const Body& body, std::span<const double> values,
           std::vector<double>& displacement, std::vector<double>& velocity) {
  // cos - 1 without cancellation.
  const double half = std::sin(0.5 * values[2]), less = -2 * half * half, sine = std::sin(values[2]);
  for (std::size_t i = rigid.first; i < rigid.last; ++i) {
    const double x = body.position[2 * i] - rigid.centre[0], y = body.position[2 * i + 1] - rigid.centre[1];
    const double dx = less * x - sine * y, dy = sine * x + less * y;
    displacement[2 * i] = values[0] + dx;
    displacement[2 * i + 1] = values[1] + dy;
    velocity[2 * i] = values[3] - values[5] * (y + dy);
    velocity[2 * i + 1] = values[4] + values[5] * (x + dx);
  }
}

std::array<double, 3> resultant(const RigidBody& rigid, const Body& body,
                                std::span<const double> displacement, const std::vector<double>& force,
                                std::span<const double> values) {
  std::array<double, 3> sum{};
  for (std::size_t i = rigid.first; i < rigid.last; ++i) {
    const double fx = force[2 * i], fy = force[2 * i + 1];
    const double x = body.position[2 * i] - rigid.centre[0] + displacement[2 * i] - values[0];
    const double y = body.position[2 * i + 1] - rigid.centre[1] + displacement[2 * i + 1] - values[1];
    sum[0] += fx;
    sum[1] += fy;
    sum[2] += x * fy - y * fx;
  }
  return sum;
}

double kinetic_energy(const RigidBody& rigid, std::span<const double> values) {
  double energy = 0;
  for (std::size_t c = 0; c < 3; ++c) energy += 0.5 * rigid.inertia_of(c) * values[3 + c] * values[3 + c];
  return energy;
}

double spring_energy(const RigidBody& rigid, std::span<const double> values) {
  double energy = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double stretch = values[c] - rigid.rest[c];
    energy += 0.5 * rigid.spring[c] * stretch * stretch;
  }
  return energy;
}

RigidMotion::RigidMotion(const Body& body, const Loading& loading, double dt)
    : body_(body), loading_(loading), dt_(dt), force_(body.rigid.size()) {
  position_ = energy_ = damped_ = force_;
  for (const RigidBody& rigid : body.rigid) {
    auto& steps = step_.emplace_back();
    for (std::size_t c = 0; c < 3; ++c)
      steps[c] = oscillator_step(rigid.inertia_of(c), rigid.damper[c], rigid.spring[c], dt);
  }
}

void RigidMotion::begin(const State& state, const std::vector<double>& force) {
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const std::span<const double> values = std::span<const double>(state.rigid).subspan(6 * r, 6);
    force_[r] = resultant(body_.rigid[r], body_, state.displacement, force, values);
    for (std::size_t c = 0; c < 2; ++c) force_[r][c] += body_.rigid[r].mass * loading_.gravity[c];
  }
}

void RigidMotion::drift(State& state, double time) {
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const RigidBody& rigid = body_.rigid[r];
    const std::span<double> values = values_of(state, r);
    for (std::size_t c = 0; c < 3; ++c) {
      position_[r][c] = values[c];
      damped_[r][c] = 0;
      const double inertia = rigid.inertia_of(c), rest = rigid.rest[c], q0 = values[c] - rest,
                   v0 = values[3 + c], g = force_[r][c];
      const auto energy = [&](double q, double v) {
        return 0.5 * inertia * v * v + 0.5 * rigid.spring[c] * q * q;
      };
      if (rigid.held[c]) {
        const RigidDrive* drive = drive_of(loading_, r, c);
        if (drive == nullptr) continue;
        energy_[r][c] = energy(q0, v0);
        values[c] = drive->displacement(time);
        values[3 + c] = (drive->displacement(time + 0.5 * dt_) - drive->displacement(time - 0.5 * dt_)) / dt_;
        const double mean = (values[c] - position_[r][c]) / dt_;
        damped_[r][c] = rigid.damper[c] * mean * mean * dt_;
        continue;
      }
      const OscillatorStep& s = step_[r][c];
      const double q = s.qq * q0 + s.qv * v0 + s.qg * g, v = s.vq * q0 + s.vv * v0 + s.vg * g;
      // Of the exact motion under the force at the start, what its work and the energies leave.
      if (rigid.damper[c] > 0) damped_[r][c] = g * (q - q0) - energy(q, v) + energy(q0, v0);
      values[c] = rest + q;
      values[3 + c] = v;
    }
    carry(rigid, body_, values, state.displacement, state.velocity);
  }
}

void RigidMotion::kick(State& state, const std::vector<double>& force) {
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const RigidBody& rigid = body_.rigid[r];
    const std::span<double> values = values_of(state, r);
    std::array<double, 3> now = resultant(rigid, body_, state.displacement, force, values);
    std::array<double, 2> weight{};
    for (std::size_t c = 0; c < 2; ++c) {
      weight[c] = rigid.mass * loading_.gravity[c];
      now[c] += weight[c];
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const double moved = values[c] - position_[r][c];
      if (c < 2) external_work_ += weight[c] * moved;
      damper_work_ += damped_[r][c];
      if (!rigid.held[c]) {
        values[3 + c] += step_[r][c].vr * (now[c] - force_[r][c]);
      } else if (drive_of(loading_, r, c) != nullptr) {
        const double stretch = values[c] - rigid.rest[c], v = values[3 + c];
        const double energy = 0.5 * rigid.inertia_of(c) * v * v + 0.5 * rigid.spring[c] * stretch * stretch;
        external_work_ += energy - energy_[r][c] + damped_[r][c] - 0.5 * (now[c] + force_[r][c]) * moved;
      }
    }
    force_[r] = now;
    carry(rigid, body_, values, state.displacement, state.velocity);
  }
}

double RigidMotion::external_work() {
  return std::exchange(external_work_, 0.0);
}

double RigidMotion::damper_work() {
  return std::exchange(damper_work_, 0.0);
}

double rigid_step(const Body& body, const State& state) {
  // A sixtieth of a period and of a radian's turn: the forces on the contour, not the springs, need it.
  double rate = 0;
  for (std::size_t r = 0; r < body.rigid.size(); ++r) {
    const RigidBody& rigid = body.rigid[r];
    for (std::size_t c = 0; c < 3; ++c)
      if (!rigid.held[c]) rate = std::max(rate, std::sqrt(rigid.spring[c] / rigid.inertia_of(c)));
    rate = std::max(rate, 6 * std::abs(state.rigid[6 * r + 5]));
  }
  return rate > 0 ? 0.1 / rate : std::numeric_limits<double>::infinity();
}

double settle_rigid(const Body& body, const Loading& loading, double time, const std::vector<double>& force,
                    State& state) {
  double change = 0;
  for (std::size_t r = 0; r < body.rigid.size(); ++r) {
    const RigidBody& rigid = body.rigid[r];
    const std::span<double> values = values_of(state, r);
    const std::array<double, 6> before{values[0], values[1], values[2], 0, 0, 0};
    for (std::size_t c = 0; c < 3; ++c) {
      values[3 + c] = 0;
      if (const RigidDrive* drive = drive_of(loading, r, c)) values[c] = drive->displacement(time);
    }
    // Translations at once; the moment of forces fixed in direction depends on the rotation: Newton's method
    // on it.
    carry(rigid, body, values, state.displacement, state.velocity);
    double size = body.mean_spacing();
    const auto sum = resultant(rigid, body, state.displacement, force, values);
    for (std::size_t c = 0; c < 2; ++c)
      if (!rigid.held[c] && rigid.spring[c] > 0)
        values[c] = rigid.rest[c] + (sum[c] + rigid.mass * loading.gravity[c]) / rigid.spring[c];
    if (!rigid.held[2] && rigid.spring[2] > 0) {
      for (int round = 0; round < 60; ++round) {
        carry(rigid, body, values, state.displacement, state.velocity);
        const auto now = resultant(rigid, body, state.displacement, force, values);
        double slope = rigid.spring[2];  // of the restoring moment: d/dq (k q - x f_y + y f_x)
        for (std::size_t i = rigid.first; i < rigid.last; ++i)
          for (std::size_t c = 0; c < 2; ++c)
            slope +=
                (body.position[2 * i + c] - rigid.centre[c] + state.displacement[2 * i + c] - values[c]) *
                force[2 * i + c];
        // Where the forces alone would turn it over, the spring's slope still leads towards the equilibrium.
        const double step =
            (now[2] - rigid.spring[2] * (values[2] - rigid.rest[2])) / std::max(slope, 0.1 * rigid.spring[2]);
        values[2] += std::clamp(step, -0.5, 0.5);
        if (std::abs(step) < 1e-15) break;
      }
    }
    carry(rigid, body, values, state.displacement, state.velocity);
    for (std::size_t c = 0; c < 3; ++c) {
      const double scale = c == 2 ? 1.0 : std::max(size, std::abs(values[c]));
      change = std::max(change, std::abs(values[c] - before[c]) / scale);
    }
  }
  return change;
}

}  // namespace estuary::solid
