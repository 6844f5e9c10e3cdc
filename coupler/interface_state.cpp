#include "interface_state.hpp"

#include <stdexcept>

namespace estuary::coupler {

InterfaceState predict(Predictor predictor, const InterfaceHistory& history, double duration) {
  InterfaceState x = history.accepted;
  if (predictor == Predictor::none) return x;
  const bool quadratic = predictor == Predictor::quadratic && !history.earlier_velocity.empty();
  for (std::size_t i = 0; i < x.motion.displacement.size(); ++i) {
    const double velocity = history.accepted.motion.velocity[i];
    const double change =  // of the velocity over the window
        quadratic ? (velocity - history.earlier_velocity[i]) * (duration / history.earlier_duration) : 0.0;
    x.motion.displacement[i] += duration * (velocity + 0.5 * change);
    x.motion.velocity[i] += change;
  }
  return x;
}

void accelerate(Acceleration& acceleration, InterfaceState& x, const InterfaceState& answer, double duration,
                bool moves, bool with_forces, AccelerationVectors& vectors) {
  auto& [iterate, residual] = vectors;
  const std::size_t size = x.motion.displacement.size() + (moves ? x.motion.velocity.size() : 0) +
                           (with_forces ? x.forces.size() : 0);
  iterate.resize(size);
  residual.resize(size);
  std::size_t taken = 0;
  const auto take = [&](const std::vector<double>& from, const std::vector<double>& to, double scale) {
    if (to.size() != from.size()) throw std::logic_error("the answer has another length than the iterate");
    double *value = iterate.data() + taken, *change = residual.data() + taken;
    for (std::size_t i = 0; i < from.size(); ++i) {
      value[i] = scale * from[i];
      change[i] = scale * (to[i] - from[i]);
    }
    taken += from.size();
  };
  take(x.motion.displacement, answer.motion.displacement, 1.0);
  if (moves) take(x.motion.velocity, answer.motion.velocity, duration);
  if (with_forces) take(x.forces, answer.forces, 1.0);
  acceleration.update(residual, iterate);
  auto next = iterate.begin();
  const auto give = [&](std::vector<double>& to, double scale) {
    for (double& value : to) value = *next++ / scale;
  };
  give(x.motion.displacement, 1.0);
  if (moves) give(x.motion.velocity, duration);
  if (with_forces) give(x.forces, 1.0);
}

}  // namespace estuary::coupler
