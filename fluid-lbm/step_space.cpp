#include "collide_step.hpp"

namespace estuary::fluid::step {

CollideAndStream space_without_force(const StepChoice& choice) {
  return variant<D3Q19, ConstantViscosity, NoForce>(choice);
}

}  // namespace estuary::fluid::step
