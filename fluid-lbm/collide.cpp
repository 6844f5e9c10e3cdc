#include "collide.hpp"

#include "collide_step.hpp"

namespace estuary::fluid {

CollideAndStream collide_and_stream(const StepChoice& choice) {
  const bool space = choice.dimension == 3;
  if (choice.storage == Storage::single_precision) {
    if (choice.viscosity != ViscosityModel::constant || choice.force != ForceModel::none) return nullptr;
    return step::in_single_precision(choice);
  }
  if (choice.viscosity != ViscosityModel::constant) {
    if (choice.force == ForceModel::unshifted) return nullptr;
    return space ? step::space_with_varying_viscosity(choice) : step::plane_with_varying_viscosity(choice);
  }
  if (choice.force != ForceModel::none) {
    return space ? step::space_with_force(choice) : step::plane_with_force(choice);
  }
  return space ? step::space_without_force(choice) : step::plane_without_force(choice);
}

std::string variant_name(const StepChoice& choice) {
  std::string name = choice.dimension == 3 ? D3Q19::name : D2Q9::name;
  switch (choice.collision) {
    case CollisionModel::trt:
      name += "-trt";
      break;
    case CollisionModel::bgk:
      name += "-bgk";
      break;
    case CollisionModel::recursive_regularised:
      name += "-recursive-regularised";
      break;
    case CollisionModel::central_moment:
      name += "-central-moment";
      break;
  }
  name += choice.equilibrium == EquilibriumModel::incompressible ? "-incompressible" : "-compressible";
  if (choice.force == ForceModel::guo) name += "-guo";
  if (choice.force == ForceModel::unshifted) name += "-unshifted";
  if (choice.viscosity == ViscosityModel::smagorinsky) name += "-smagorinsky";
  if (choice.viscosity == ViscosityModel::generalised_newtonian) name += "-generalised-newtonian";
  if (choice.storage == Storage::single_precision) name += "-single";
  return name;
}

Rates relaxation_rates(double viscosity, double magic_parameter) {
  const double even = 3.0 * viscosity;  // tau+ - 1/2
  return {1.0 / (even + 0.5), 1.0 / (magic_parameter / even + 0.5)};
}

}  // namespace estuary::fluid
