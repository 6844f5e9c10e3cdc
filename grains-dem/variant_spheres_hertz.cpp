#include "pair_sweep.hpp"

namespace estuary::grains {
template <>
LawFunctions<3> by_friction<3, NormalLaw::hertz>(const LawChoice& choice) {
  return choose_friction<3, NormalLaw::hertz>(choice);
}
}  // namespace estuary::grains
