#include "collide_step.hpp"

namespace estuary::fluid::step {

// With Guo's force always: it costs little beside a viscosity at every node, and may be zero.
CollideAndStream space_with_varying_viscosity(const StepChoice& choice) {
  return choice.viscosity == ViscosityModel::smagorinsky
             ? variant<D3Q19, SmagorinskyViscosity, GuoForce>(choice)
             : variant<D3Q19, GeneralisedNewtonianViscosity, GuoForce>(choice);
}

}  // namespace estuary::fluid::step
