#include "collide_step.hpp"

namespace estuary::fluid::step {

CollideAndStream in_single_precision(const StepChoice& choice) {
  return choice.dimension == 3 ? variant<D3Q19, ConstantViscosity, NoForce, float>(choice)
                               : variant<D2Q9, ConstantViscosity, NoForce, float>(choice);
}

}  // namespace estuary::fluid::step
