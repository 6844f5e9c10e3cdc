// A step of the fluid written for one scene, as somebody would who needs nothing else.
#pragma once

#include "cells.hpp"
#include "collide.hpp"

namespace estuary::fluid {

/// D2Q9, two relaxation times, incompressible, double precision, the whole grid in memory: no option exists
/// in its text. To be called by every thread of a parallel region. The same bits as the step of `Flow` with
/// its options off.
void plain_step(Populations& populations, Parity parity, const std::vector<std::vector<Span>>& rows,
                Rates rates);

}  // namespace estuary::fluid
