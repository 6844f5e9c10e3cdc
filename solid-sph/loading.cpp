#include "loading.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {

ExternalForces::ExternalForces(const Body& body, const Loading& loading) : body_(body), loading_(loading) {
  for (const ParticleLoad& load : loading.loads)
    touched_.insert(touched_.end(), load.particle.begin(), load.particle.end());
  for (const TractionLoad& load : loading.tractions)
    for (const auto& segment : load.segment) touched_.insert(touched_.end(), segment.begin(), segment.end());
  for (const PressureLoad& load : loading.pressures)
    for (const auto& segment : load.segment) touched_.insert(touched_.end(), segment.begin(), segment.end());
  std::sort(touched_.begin(), touched_.end());
  touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
  place_.assign(touched_.empty() ? 0 : body.size(), 0);
  for (std::size_t k = 0; k < touched_.size(); ++k) place_[touched_[k]] = static_cast<std::uint32_t>(k);
  force_.assign(2 * touched_.size(), 0.0);
  last_force_ = last_displacement_ = force_;
}

void ExternalForces::set(double fraction, double time, std::span<const double> displacement) {
  if (touched_.empty()) return;
  last_force_.swap(force_);
  std::fill(force_.begin(), force_.end(), 0.0);
  for (const ParticleLoad& load : loading_.loads) {
    const double factor = load.factor ? load.factor(time) : 1.0;
    for (std::size_t k = 0; k < load.particle.size(); ++k)
      for (std::size_t c = 0; c < 2; ++c)
        force_[2 * place_[load.particle[k]] + c] += factor * load.at(2 * k + c, fraction);
  }
  for (const TractionLoad& load : loading_.tractions)
    for (const auto& [a, b] : load.segment) {
      const double xa = body_.position[2 * a], ya = body_.position[2 * a + 1];
      const double dx = body_.position[2 * b] - xa, dy = body_.position[2 * b + 1] - ya;
      const double half_length = 0.5 * std::hypot(dx, dy), gauss = 0.5 / std::sqrt(3.0);
      for (const double share : {0.5 - gauss, 0.5 + gauss}) {
        const auto traction = load.traction(xa + share * dx, ya + share * dy, time);
        for (std::size_t c = 0; c < 2; ++c) {
          force_[2 * place_[a] + c] += (1 - share) * half_length * traction[c];
          force_[2 * place_[b] + c] += share * half_length * traction[c];
        }
      }
    }
  for (const PressureLoad& load : loading_.pressures)
    for (const auto& [a, b] : load.segment) {
      const auto now = [&](std::size_t i, std::size_t c) {
        return body_.position[2 * i + c] + displacement[2 * i + c];
      };
      const auto pressure = [&](std::size_t i) {
        return load.pressure(body_.position[2 * i], body_.position[2 * i + 1], time);
      };
      // Outward normal times length, left of the walk from a to b; consistent load of a linear pressure.
      const double nx = -(now(b, 1) - now(a, 1)), ny = now(b, 0) - now(a, 0);
      const double pa = pressure(a), pb = pressure(b);
      const double at_a = -(2 * pa + pb) / 6, at_b = -(pa + 2 * pb) / 6;
      force_[2 * place_[a]] += at_a * nx;
      force_[2 * place_[a] + 1] += at_a * ny;
      force_[2 * place_[b]] += at_b * nx;
      force_[2 * place_[b] + 1] += at_b * ny;
    }
  work_ = 0;
  for (std::size_t k = 0; k < touched_.size(); ++k)
    for (std::size_t c = 0; c < 2; ++c) {
      const double u = displacement[2 * touched_[k] + c];
      if (started_)
        work_ += 0.5 * (force_[2 * k + c] + last_force_[2 * k + c]) * (u - last_displacement_[2 * k + c]);
      last_displacement_[2 * k + c] = u;
    }
  started_ = true;
}

void ExternalForces::add_to(std::vector<double>& force) const {
  for (std::size_t k = 0; k < touched_.size(); ++k)
    for (std::size_t c = 0; c < 2; ++c) force[2 * touched_[k] + c] += force_[2 * k + c];
}

}  // namespace estuary::solid
