#include "collide_step.hpp"

namespace estuary::fluid::step {

CollideAndStream plane_without_force(const StepChoice& choice) {
  return variant<D2Q9, ConstantViscosity, NoForce>(choice);
}

}  // namespace estuary::fluid::step
