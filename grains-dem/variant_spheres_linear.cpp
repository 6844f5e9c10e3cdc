#include "pair_sweep.hpp"

namespace estuary::grains {
template <>
LawFunctions<3> by_friction<3, NormalLaw::linear>(const LawChoice& choice) {
  return choose_friction<3, NormalLaw::linear>(choice);
}
}  // namespace estuary::grains
