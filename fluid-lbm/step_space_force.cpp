#include "collide_step.hpp"

namespace estuary::fluid::step {

CollideAndStream space_with_force(const StepChoice& choice) {
  return choice.force == ForceModel::guo ? variant<D3Q19, ConstantViscosity, GuoForce>(choice)
                                         : variant<D3Q19, ConstantViscosity, UnshiftedForce>(choice);
}

}  // namespace estuary::fluid::step
