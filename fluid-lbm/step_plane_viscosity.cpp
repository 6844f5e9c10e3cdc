#include "collide_step.hpp"

namespace estuary::fluid::step {

// With Guo's force always: it costs little beside a viscosity at every node, and may be zero.
CollideAndStream plane_with_varying_viscosity(const StepChoice& choice) {
  return choice.viscosity == ViscosityModel::smagorinsky
             ? variant<D2Q9, SmagorinskyViscosity, GuoForce>(choice)
             : variant<D2Q9, GeneralisedNewtonianViscosity, GuoForce>(choice);
}

}  // namespace estuary::fluid::step
