#include "collide_step.hpp"

namespace estuary::fluid::step {

CollideAndStream plane_with_force(const StepChoice& choice) {
  return choice.force == ForceModel::guo ? variant<D2Q9, ConstantViscosity, GuoForce>(choice)
                                         : variant<D2Q9, ConstantViscosity, UnshiftedForce>(choice);
}

}  // namespace estuary::fluid::step
