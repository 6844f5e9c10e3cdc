#include "pair_sweep.hpp"

namespace estuary::grains {
template <>
LawFunctions<2> by_friction<2, NormalLaw::linear>(const LawChoice& choice) {
  return choose_friction<2, NormalLaw::linear>(choice);
}
}  // namespace estuary::grains
